"""Motions in a vertical plane of a block, from two horizontal components each.

A sensor that lies at the azimuth A₁ records the acceleration a₁ of the base towards A₁. With a second one at A₂ the
base has towards the azimuth φ

    a(φ) = (a₁ sin(A₂ - φ) + a₂ sin(φ - A₁)) / sin(A₂ - A₁).
"""

import math
import pathlib
from collections.abc import Sequence

from fpk_rocking.base import checks
from fpk_rocking.base.checks import File
from fpk_rocking.physics.forcing import Record
from fpk_rocking.physics.forcing.readers import reading, said_by_name
from fpk_rocking.physics.forcing.readers.components import ACCEPTED
from fpk_rocking.physics.forcing.readers.terms import UNITS, divided, unit_of

_SQUARE, _LENGTHS = 10.0, 0.01
"""Degrees by which two components may miss a right angle, and part by which their numbers of samples may differ."""


def in_plane(
    files: Sequence[File], azimuth: float, *, units: str | None = None, interval: float | None = None
) -> list[Record]:
    r"""Return the motions along a horizontal direction, one for each pair of horizontal components of record files.

    Parameters
    ----------
    files : sequence of str or pathlib.Path
        Files with both horizontal components of a motion, or with one each, the two of a motion one after the other.
        The names of the components have to state the azimuths: NS, N30E, 120 DEG, 279.
    azimuth : float
        Direction of the plane of the block, degrees clockwise from north. The left side of the block, where angles are
        negative, faces it. Positive samples accelerate the base towards it.
    units, interval : optional
        As for `Record.from_file`, if the files do not state them.

    Returns
    -------
    list of Record

    Raises
    ------
    TypeError, ValueError, OSError
        A parameter or a file is refused, or two components are no pair.

    Examples
    --------
    >>> import pathlib
    >>> from fpk_rocking.risk import in_plane
    >>> rows = "0.00,0.0,0.0", "0.01,0.2,0.1", "0.02,0.1,0.3"
    >>> _ = pathlib.Path("pair.csv").write_text("\n".join(["time (s),acc_NS (g),acc_EW (g)", *rows]))
    >>> (motion,) = in_plane(["pair.csv"], azimuth=30.0)
    >>> print([round(sample / 9.80665, 4) for sample in motion.samples])
    [0.0, 0.2232, 0.2366]
    """
    azimuth = checks.number("azimuth", azimuth)
    if units is not None and unit_of(units) is None:
        raise ValueError(checks.refusal("units", units, ", ".join(UNITS)))
    interval = None if interval is None else checks.number("interval", interval, above=0.0)
    found = [(pathlib.Path(file), component) for file in files for component in _horizontal(pathlib.Path(file))]
    if len(found) % 2:
        accepted = "two each, north and east or the like, the two of a motion one after the other"
        raise ValueError(checks.refusal("azimuth", f"{len(found)} horizontal components", accepted))
    return [_turned(*pair, azimuth, units, interval) for pair in zip(found[::2], found[1::2], strict=True)]


def _horizontal(path):
    """Return the horizontal components of a file, a list of one or two `Component`; else ValueError."""
    have = reading(path)
    usable = [one for one in have.components if one.quantity and not one.objection]
    said = said_by_name(have)
    if said or len(usable) not in (1, 2):
        listed = "; ".join(one.description for one in have.components)
        got = f"a {said}, as the name of the file says" if said else f"{len(usable)} horizontal components ({listed})"
        raise ValueError(f"azimuth: {str(path)!r}: got {got}, accepted: one or two, of {ACCEPTED}")
    return usable


def _turned(first, second, azimuth, units, interval):
    """Return the `Record` along an azimuth from two pairs of a path and its `Component`."""
    (path, one), (other, two) = first, second
    where = f"azimuth: {' and '.join(map(repr, dict.fromkeys(map(str, (path, other)))))}"
    own = [component.azimuth for component in (one, two)]
    if None in own:
        named = f"components {one.name!r} and {two.name!r}"
        raise ValueError(f"{where}: got {named}, accepted: names that say the azimuth: NS, N30E, 120 DEG, 279")
    apart = math.sin(math.radians(own[1] - own[0]))
    events = {divided(component.event)[0] for component in (one, two)} - {""}
    if abs(apart) < math.cos(math.radians(_SQUARE)) or len(events) > 1:
        got = f"{one.description} of {one.event or path.name}; {two.description} of {two.event or other.name}"
        raise ValueError(
            f"{where}: got {got}, accepted: two components of one motion at right angles, one after the other"
        )
    steps, scales = [part.interval or interval for part in (one, two)], [part.unit or units for part in (one, two)]
    for name, values in (("interval", steps), ("units", scales)):
        if None in values or "" in values:
            raise ValueError(f"{where}: {name} is missing (in a shell --{name})")
    length = min(one.values.size, two.values.size)
    if not math.isclose(*steps, rel_tol=1e-6) or max(one.values.size, two.values.size) > (1.0 + _LENGTHS) * length:
        got = " and ".join(
            f"{part.values.size} samples at {step:g} s" for part, step in zip((one, two), steps, strict=True)
        )
        raise ValueError(f"{where}: got {got}, accepted: the same of both")
    metres = [UNITS[str(unit_of(scale))] * part.values[:length] for part, scale in zip((one, two), scales, strict=True)]
    weights = [math.sin(math.radians(turn)) / apart for turn in (own[1] - azimuth, azimuth - own[0])]
    samples = sum(weight * values for weight, values in zip(weights, metres, strict=True)).tolist()
    source = " + ".join(dict.fromkeys((path.name, other.name)))
    event = ", ".join(filter(None, [*events, f"along {azimuth:g}°"]))
    notes = [*one.sentences, *two.sentences]
    if path != other and not (one.event and two.event):
        notes.append(f"Paired with {other.name} as the next file: they do not both say event and station.")
    note = " ".join(dict.fromkeys(notes))
    return Record(steps[0], tuple(samples), "m/s2", source=source, event=event, note=note)
