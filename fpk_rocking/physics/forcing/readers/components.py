"""Components of a record file: what speaks against one, and which one is read."""

import dataclasses
import math
import re
from collections.abc import Sequence

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array
from fpk_rocking.physics.forcing.readers import terms

MOST = 2**20
"""Most samples: 87 minutes at 200 Hz."""

ACCEPTED = "a horizontal acceleration of the base"

_AXES = {"N": 0.0, "NS": 0.0, "E": 90.0, "EW": 90.0}
"""Degrees from north of the directions that may be asked for whatever a file calls its components."""


class ReadingError(ValueError):
    """A file has what is not read: what was got, what is accepted, and the number of its line, or 0."""

    def __init__(self, got: str, accepted: str, line: int = 0):
        super().__init__(f"got {got}, accepted: {accepted}" + f" (line {line})" * (line > 0))
        self.got, self.accepted = got, accepted


@dataclasses.dataclass(frozen=True, eq=False)
class Component:
    """One component of a record file, as the file has it.

    Parameters
    ----------
    name : str
        As the file calls it, such as "360 Deg", "N08W" or "acc_EW (gal)"; "" where it does not.
    values : array_like
        Samples (n,), in `unit`.
    interval : float or None
        Seconds between them; None where the file does not say it.
    unit : str
        Key of `UNITS` in any spelling, or another text that the file says; "" where it says none.
    quantity : str
        "acceleration", or what else it is; "" for a column of unknown meaning, which is read only where it is asked
        for.
    vertical : bool
        Whether the file says so by more than the name.
    notes : tuple of str
        Sentences on what a user should know.
    peak : float
        Peak that the file states, in `unit`; nan where it states none.
    event : str
        Event, date and station; at most 200 characters that a terminal shows are kept.
    upright : bool
        Whether the vertical component is wanted, and not a horizontal one.
    """

    name: str
    values: Array
    interval: float | None = None
    unit: str = ""
    quantity: str = "acceleration"
    vertical: bool = False
    notes: tuple[str, ...] = ()
    peak: float = math.nan
    event: str = ""
    upright: bool = False

    @property
    def is_vertical(self) -> bool:
        """Whether the file says that it is a vertical component, by its name or otherwise."""
        return self.vertical or terms.is_vertical(self.name)

    @property
    def downward(self) -> bool:
        """Whether its name says that downwards is positive."""
        return terms.is_downward(self.name)

    def __post_init__(self):
        shown = "".join(letter if letter.isprintable() else " " for letter in self.event)
        checks.keep(self, unit=terms.unit_of(self.unit) or self.unit, event=" ".join(shown.split())[:200])

    @property
    def azimuth(self) -> float | None:
        """Degrees from north that the name says; None where it says none, or the component is vertical."""
        return terms.azimuth(self.name)

    @property
    def objection(self) -> ReadingError | None:
        """Why the component is not read; None where nothing speaks against it."""
        named, other = f" {self.name!r}" if self.name else "", terms.quantity_of_unit(self.unit)
        units = ", ".join(terms.UNITS)
        if self.quantity not in ("acceleration", ""):
            return ReadingError(f"a {self.quantity}{named}".replace("a counts", "raw counts"), ACCEPTED)
        if self.upright:
            if not self.is_vertical and (self.azimuth is not None or terms.is_horizontal(self.name)):
                return ReadingError(f"the horizontal component{named}", "the vertical one")
        elif self.is_vertical:
            return ReadingError(f"the vertical component{named}", "a horizontal one (the vertical one is `vertical`)")
        if other:
            return ReadingError(f"the unit {self.unit!r} of a {other}{named}", f"an acceleration in {units}")
        if self.unit and self.unit not in terms.UNITS:
            return ReadingError(f"the unknown unit {self.unit!r}{named}", units)
        return None

    @property
    def sentences(self) -> tuple[str, ...]:
        """The notes, and a stated peak that the samples do not have to a tenth, with or without their mean."""
        found, stated = [float(np.abs(self.values - mean).max()) for mean in (0.0, self.values.mean())], abs(self.peak)
        if math.isnan(stated) or any(abs(stated - peak) <= 0.1 * peak + 1e-3 for peak in found):
            return self.notes
        return (*self.notes, f"The file states a peak of {stated:g}, its samples have {found[0]:.4g}.")

    @property
    def description(self) -> str:
        """Name, azimuth and peak of the component, or why it is not read, as a text."""
        azimuth = "" if self.azimuth is None else f", {self.azimuth:g}°"
        text = f"peak {np.abs(self.values).max():.4g} {self.unit or '(unit not said)'}{azimuth}"
        return f"{self.name or 'no name'} ({f'not read: {self.objection.got}' if self.objection else text})"


def chosen(components: Sequence[Component], wanted: str | int | None, *, if_several: bool = False) -> Component:
    """The component with a name or a number from 1, or the only one that can be read; else `ReadingError`.

    With `if_several` what is wanted counts only where more than one can be read.
    """
    usable = [component for component in components if component.quantity and not component.objection]
    usable = [component for component in usable if component.upright and component.is_vertical] or usable
    listed = "; ".join(f"{number} {component.description}" for number, component in enumerate(components, 1))
    if wanted is None or (if_several and len(usable) == 1):
        if len(usable) == 1:
            return usable[0]
        objections = [component.objection for component in components]
        if objections[0] and all(objections):
            more = f"; the file has: {listed}" * (len(components) > 1)
            raise ReadingError(objections[0].got, objections[0].accepted + more)
        got = f"{len(components)} components" if len(components) > 1 else "a column whose name says no acceleration"
        raise ReadingError(got, f"one of them by component (in a shell --component), its name or its number: {listed}")
    component = _named(components, wanted)
    if component is None:
        raise ReadingError(f"the component {wanted!r}", f"a name or a number of {listed}")
    if component.objection:
        raise component.objection
    return component


def _named(components, wanted):
    """The component that a name or a number means; None where it means none, or several."""
    text = str(wanted).strip()
    if re.fullmatch(r"\d+", text) and 1 <= int(text) <= len(components):
        return components[int(text) - 1]
    name = _letters(text)
    found = [one for one in components if _letters(one.name) == name] or [
        one for one in components if name in map(_letters, re.split(r"[\s_()\[\],;:/]+", one.name))
    ]
    if not found and name in _AXES:
        # Archives write one direction as N-S, N00E, 360 Deg or N(+), and one option serves for all of them.
        lying = [(one, one.azimuth) for one in components if not one.objection]
        found = [one for one, azimuth in lying if azimuth is not None and azimuth % 180.0 == _AXES[name]]
    return found[0] if name and len(found) == 1 else None


def _letters(text):
    """Letters and digits of a text, in capitals."""
    return re.sub(r"[^A-Z0-9]", "", text.upper())
