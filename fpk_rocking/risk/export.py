"""Fragility curves in the formats of OpenQuake (NRML 0.5) and pelicun, and what OpenQuake makes of hazard levels.

Both programs join points by straight lines in the intensity, and nothing lies below the first. Points are therefore
written at more levels than they were computed at: along lines in ln(intensity), and along the tail below the lowest.
"""

import dataclasses
import itertools
import json
import math
import re
from collections.abc import Mapping, Sequence
from xml.etree import ElementTree as ET

import numpy as np
import scipy

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array, File
from fpk_rocking.results.storage import write_text
from fpk_rocking.results.trust import Trust
from fpk_rocking.risk.floors import FloorMotion
from fpk_rocking.risk.motions import FLOOR, measure_of
from fpk_rocking.risk.population import IntensityCurve
from fpk_rocking.risk.rate import Risk, rate_text

_TAKEN = "risk", "curve", "motions"
"""Names whose files would replace others of a study: risk.json, curve.csv, motions.csv."""

_STEP, _TAIL = 0.03, 5.0
"""Levels of a curve of points lie no farther apart in ln(intensity), down to so many dispersions below its median."""

_FARTHEST = 12.0
"""Levels of a curve of points begin no farther below the lowest in ln(intensity)."""

_DIRECTIONAL = (
    "Demand-Directional is 1: the demand is that in the plane of the block, as it is. A demand without a direction (0, "
    "as of FEMA's items) pelicun takes as 1.2 times the larger of two."
)

_OF_GROUND = " The block stands on an upper floor, but the demand is that of the ground: give the component location 0."
_OF_FLOOR = " pelicun takes the floor below the location: a component that stands on floor 3 has location 4."

_DEMANDS = {
    "PGA": "Peak Ground Acceleration",
    "PGV": "Peak Ground Velocity",
    "PFA": "Peak Floor Acceleration",
    "PFV": "Peak Floor Velocity",
}
"""Demands of pelicun by measure; Sa(T) is "Spectral Acceleration|T"."""

_CROSSING = 0.01
"""Difference up to which a severer limit state may be likelier than a milder one: fits cross in their tails."""

_RISE, _APART = 1e-6, 2e-5
"""Least rise of probability, and relative step of intensity, of points for pelicun, which rounds them to six digits."""

NAMES = rf"(?!(?:{'|'.join(_TAKEN)})$)[A-Za-z0-9_-]{{1,75}}"
"""Regular expression of a name that the formats take."""


def to_nrml(
    path: File, curves: Sequence[IntensityCurve], name: str, description: str = "", trust: Trust | None = None
) -> None:
    """Write curves as the limit states of one fragility function in OpenQuake's NRML 0.5.

    The function is continuous (lognormal) where each curve has a lognormal fit that is not rejected, else discrete:
    the points, with others between and below them on the curve that `IntensityCurve.along` gives, as OpenQuake joins
    levels by straight lines. PGA is in g, PGV in cm/s.

    Parameters
    ----------
    path : str or pathlib.Path
        File to write.
    curves : sequence of IntensityCurve
        Of one measure, PGA, PGV or Sa(T), the mildest limit state first.
    name : str
        Identifier of the function, which an exposure model refers to: letters, digits, ``_`` and ``-``.
    description : str
        For a reader; by default how the curves were made.
    trust : Trust, optional
        Verdict that follows the description; by default that of the last curve.

    Raises
    ------
    ValueError
        There is no curve, their measures or intensities differ or are none of OpenQuake's, the name is not accepted, or
        a severer limit state is likelier than the one before it by more than .01 at some intensity: OpenQuake would
        count negative shares. A difference below that is stated in the description.

    Examples
    --------
    >>> from fpk_rocking import Scene
    >>> from fpk_rocking.risk import IntensityCurve, at_intensity, to_nrml
    >>> from fpk_rocking.risk import fragility
    >>> rack = Scene.from_block(0.5, 1.8, "0.3 g", "1.5 Hz",
    ...                         noise_rms_acceleration=0.5, noise_band_hz=(0, 5))
    >>> curves = fragility(at_intensity(rack, "PGV"), scale=[0.5, 0.6, 0.7, 0.8], cycles=4, realizations=500)
    >>> to_nrml("rack.xml", [IntensityCurve.of(curves, "PGV")], name="RACK")
    """
    curves = _same(curves)
    check_name(name)
    if refused := not_for_openquake(curves[0]):
        raise ValueError(refused)
    measure = curves[0].measure.replace("Sa", "SA")
    factor = 100.0 if measure == "PGV" else 1.0  # OpenQuake takes PGV in cm/s
    states = [_identifier(curve.name) for curve in curves]
    root = ET.Element("nrml", xmlns="http://openquake.org/xmlns/nrml/0.5")
    model = ET.SubElement(root, "fragilityModel", assetCategory="contents", id=name, lossCategory="contents")
    levels, rows = _levels(curves)
    fitted = all(curve.fitted for curve in curves)
    said = _crossing(curves, levels, rows) + " PGV in this file is in cm/s." * (measure == "PGV")
    if not fitted:
        said += f" The curve stands here at {levels.size} levels, for straight lines between them."
    ET.SubElement(model, "description").text = _described(curves[-1], description, trust) + said
    ET.SubElement(model, "limitStates").text = " ".join(states)
    kind: dict[str, str] = {"format": "continuous", "shape": "logncdf"} if fitted else {"format": "discrete"}
    function = ET.SubElement(model, "fragilityFunction", kind, id=name)
    imls = ET.SubElement(function, "imls", imt=measure, noDamageLimit=repr(factor * float(levels[0])))
    if fitted:
        low, high = _range(curves)
        imls.set("minIML", repr(factor * low))
        imls.set("maxIML", repr(factor * high))
        imls.set("noDamageLimit", repr(factor * low))
        for state, curve in zip(states, curves, strict=True):
            median, spread = factor * curve.fit.median, curve.fit.dispersion
            mean = median * math.exp(0.5 * spread**2)
            deviation = mean * math.sqrt(math.expm1(spread**2))
            ET.SubElement(function, "params", ls=state, mean=repr(mean), stddev=repr(deviation))
    else:
        imls.text = _numbers(factor * levels)
        for state, row in zip(states, rows, strict=True):
            ET.SubElement(function, "poes", ls=state).text = _numbers(row)
    ET.indent(root)
    write_text(path, '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n")


def to_pelicun(path: File, curve: IntensityCurve, name: str, description: str = "", trust: Trust | None = None) -> None:
    """Write a curve as a row of pelicun's fragility table (CSV), with its description beside it (JSON).

    Lognormal where the curve has a fit that is not rejected, else the points (``multilinear_CDF``), with others between
    and below them, where they do not fall. The demand is directional: it is that in the plane of the block. For items
    without a direction, such as FEMA's own, pelicun takes 1.2 times the larger demand of two directions.

    Parameters
    ----------
    path : str or pathlib.Path
        CSV file to write; the description has the same name with the suffix ``.json``.
    curve : IntensityCurve
    name : str
        Identifier of the component: letters, digits, ``_`` and ``-``.
    description : str
        For a reader; by default how the curve was made.
    trust : Trust, optional
        Verdict, in the table and the description; by default that of the curve.

    Raises
    ------
    ValueError
        The name is not accepted, or pelicun does not take the curve.

    Examples
    --------
    >>> from fpk_rocking import Scene
    >>> from fpk_rocking.risk import IntensityCurve, at_intensity, to_pelicun
    >>> from fpk_rocking.risk import fragility
    >>> rack = Scene.from_block(0.5, 1.8, "0.3 g", "1.5 Hz",
    ...                         noise_rms_acceleration=0.5, noise_band_hz=(0, 5))
    >>> curves = fragility(at_intensity(rack, "PGV"), scale=[0.5, 0.6, 0.7, 0.8], cycles=4, realizations=500)
    >>> to_pelicun("rack.csv", IntensityCurve.of(curves, "PGV"), name="RACK")
    """
    write_pelicun(path, {name: (curve, description, trust)})


def write_pelicun(path: File, items: Mapping[str, tuple[IntensityCurve, str, Trust | None]]) -> None:
    """Write several curves as rows of one of pelicun's tables, as `to_pelicun` does one.

    Parameters
    ----------
    path : str or pathlib.Path
    items : dict of str to tuple of (IntensityCurve, str, Trust or None)
        Curve, description and verdict of each, by the identifiers of the components.
    """
    # pelicun multiplies a demand without a direction by 1.2.
    header = "ID,Incomplete,Demand-Type,Demand-Unit,Demand-Offset,Demand-Directional,LS1-Family,LS1-Theta_0,LS1-Theta_1"
    lines, about = [f"{header},LS1-DamageStateWeights,Verdict"], {}
    for name, (curve, description, trust) in items.items():
        check_name(name)
        if refused := not_for_pelicun(curve):
            raise ValueError(refused)
        verdict = trust or curve.trust
        lines.append(f"{name},0,{_pelicun_law(curve)},,{verdict.verdict}")
        about[name] = {
            "Description": f"{_described(curve, description, verdict)} {_DIRECTIONAL}{_where(curve)}",
            "Verdict": verdict.plain,
            "LimitStates": {"LS1": {"DS1": {"Description": curve.name}}},
        }
    table = checks.path("path", path)
    write_text(table, "\n".join([*lines, ""]))
    write_text(table.with_suffix(".json"), json.dumps(about, indent=2) + "\n")


def _pelicun_law(curve):
    """Return the cells of a row of pelicun's table from the demand to the parameters of the law, as a text."""
    demand, unit = _demand(curve.measure), "mps" if curve.unit == "m/s" else "g"
    if curve.fitted:
        law = f"lognormal,{curve.fit.median!r},{curve.fit.dispersion!r}"
    else:
        points = "|".join(",".join(map(repr, values.tolist())) for values in _distribution(curve))
        law = f'multilinear_CDF,"{points}",'
    return f"{demand},{unit},0,1,{law}"


def _demand(measure):
    """Return pelicun's name of the demand of a measure; empty where it has none."""
    period = measure_of(measure).period if measure != "scale" else math.nan
    return f"Spectral Acceleration|{period!r}" if period > 0.0 else _DEMANDS.get(measure, "")


def _where(curve):
    """Return at which location pelicun has to take the demand of a curve, as a sentence; empty for the usual one."""
    if curve.measure in FLOOR:
        return _OF_FLOOR
    return _OF_GROUND * any(isinstance(scene.forcing, FloorMotion) for scene in curve.scenes)


def not_for_openquake(curve: IntensityCurve) -> str:
    """Return why OpenQuake has no hazard for a curve, as a text; empty where it has."""
    accepted = "PGA, PGV or Sa(T), of which OpenQuake has hazards"
    known = curve.measure in ("PGA", "PGV") or curve.measure.startswith("Sa(")
    return "" if known else checks.refusal("measure", curve.measure, accepted)


def _described(curve, description, trust):
    """Return a description of a curve, by default its own, with a verdict, by default its own."""
    trust = trust or curve.trust
    return f"{description or curve.describe()} Verdict: {trust.verdict}. {' '.join(trust.reasons)}"


def _same(curves):
    """Return `curves`, of class `IntensityCurve`, as a list; ValueError if their measures or intensities differ."""
    curves = list(curves)
    if not curves:
        raise ValueError(checks.refusal("curves", curves, "at least one"))
    for curve in curves[1:]:
        if curve.measure != curves[0].measure or curve.intensity.tolist() != curves[0].intensity.tolist():
            raise ValueError(checks.refusal("curves", curve.name, "curves of one measure at the same intensities"))
    return curves


def _levels(curves):
    """Return levels (n,) between which straight lines are good enough, and the probabilities (s, n) of curves there."""
    places = np.log(curves[0].intensity)
    below = max(curve.tail * (scipy.special.ndtri(min(curve.probability[0], 0.99)) + _TAIL) for curve in curves)
    ends = np.concatenate([[places[0] - min(max(below, _STEP), _FARTHEST)], [places[0] - 1e-4], places])
    parts = (np.linspace(a, b, math.ceil((b - a) / _STEP), endpoint=False) for a, b in itertools.pairwise(ends))
    logs = np.append(np.concatenate(list(parts)), places[-1])
    # The points themselves keep all their digits.
    point = np.clip(np.searchsorted(places, logs - 1e-9), 0, places.size - 1)
    levels = np.where(np.abs(places[point] - logs) < 1e-9, curves[0].intensity[point], np.exp(logs))
    return levels, np.array([curve.along(curve.probability, levels) for curve in curves])


def _range(curves):
    """Return (low, high) intensities between which OpenQuake takes lognormal curves: from 5e-7 to 1 - 5e-7."""
    low = min(curve.fit.median * math.exp(-4.9 * curve.fit.dispersion) for curve in curves)
    return low, max(curve.fit.median * math.exp(4.9 * curve.fit.dispersion) for curve in curves)


def _crossing(curves, levels, rows):
    """Return by how much a severer state is likelier than the one before, a sentence; ValueError if by too much."""
    if all(curve.fitted for curve in curves):
        low, high = _range(curves)
        levels = np.geomspace(low, high, 500)
        rows = np.array([curve.fit(levels) for curve in curves])
    above = np.diff(rows, axis=0)
    if len(curves) < 2 or above.max() <= _RISE:
        return ""
    state, level = np.unravel_index(above.argmax(), above.shape)
    where = f"at {curves[0].measure} {levels[level]:.3g} {curves[0].unit}"
    text = f"'{curves[state + 1].name}' likelier than '{curves[state].name}' by {above.max():.2g} {where}"
    if above.max() > _CROSSING:
        accepted = f"the milder state first, and the severer one likelier by at most {_CROSSING}"
        raise ValueError(checks.refusal("curves", text, accepted))
    return f" The states cross: {text}; OpenQuake counts that as a negative share."


def rising(curve: IntensityCurve) -> IntensityCurve:
    """Return a curve with points that do not fall, each the largest up to it."""
    return dataclasses.replace(curve, probability=np.maximum.accumulate(curve.probability))


def _distribution(curve):
    """Return (intensities, probabilities), (n,) each, of an `IntensityCurve`, as pelicun wants them."""
    levels, (row,) = _levels([rising(curve)])
    x, y, last = [0.0], [0.0], 0.0  # without shaking no block overturns
    for place, share in zip(levels.tolist(), row.tolist(), strict=True):
        if share < _RISE:
            x = [place]
        elif share - y[-1] > 4.0 * _RISE and (share <= 1.0 - 4.0 * _RISE or share == 1.0):
            # A plateau may rise by the least that pelicun takes.
            for point in ((last, y[-1] + 2.0 * _RISE), (place, share)):
                if point[0] > (1.0 + _APART) * x[-1] + 1e-7:
                    x.append(point[0])
                    y.append(point[1])
        last = place
    return np.array(x), np.array(y)


def not_for_pelicun(curve: IntensityCurve) -> str:
    """Return why pelicun could not take a curve, as a text."""
    if not _demand(curve.measure):
        return checks.refusal("measure", curve.measure, f"{', '.join(_DEMANDS)} or Sa(T), which pelicun has")
    if curve.fitted or curve.probability[-1] == 1.0:
        return ""
    accepted = "1, which pelicun asks of a curve without a lognormal fit: give higher intensities"
    return checks.refusal("probability at the highest intensity", float(curve.probability[-1]), accepted)


def rate_by_levels(curve: IntensityCurve, intensity: Array, rate: Array) -> float:
    """Return the annual rate of OpenQuake's `classical_damage` from a hazard at levels alone.

    At a level counts half of what is exceeded between its neighbours, and nothing that exceeds the last one.

    Parameters
    ----------
    curve : IntensityCurve
    intensity, rate : ndarray, shape (n,)
        Levels, ascending, in the unit of the curve, and the annual rates of exceedance there.
    """
    means = np.convolve(np.concatenate([rate[:1], rate, rate[-1:]]), [0.5, 0.5], "valid")
    return float(-np.diff(means) @ curve(intensity))


def enough_levels(risk: Risk) -> Array:
    """Return levels (n,) 5 % apart, of which OpenQuake gives the rate: up to where a thousandth of it is exceeded."""
    above = np.geomspace(risk.edges[-1], 1e3 * risk.edges[-1], 400)
    last = above[np.argmax(risk.hazard(above) < 1e-3 * risk.exported_rate)]
    return risk.edges[0] * 1.05 ** np.arange(math.ceil(math.log(last / risk.edges[0]) / math.log(1.05)) + 1)


def levels_text(risk: Risk) -> str:
    """Return what OpenQuake makes of a `Risk` with the levels of its hazard, and with denser ones, as a sentence."""
    curve, hazard, levels = risk.curve, risk.hazard, enough_levels(risk)
    own, dense = (rate_by_levels(curve, im, np.asarray(hazard(im))) for im in (hazard.intensity, levels))
    low, high = (100.0 if curve.measure == "PGV" else 1.0) * levels[[0, -1]]
    text = "OpenQuake takes a hazard at its levels alone: its classical_damage gives the rate "
    text += f"{rate_text(own)} from the {hazard.intensity.size} levels of this study, and {rate_text(dense)} from "
    text += f"{levels.size} levels 5 % apart from {low:.3g} to {high:.3g} "
    return text + f"{'cm/s' if curve.measure == 'PGV' else curve.unit}."


def check_name(name: str) -> None:
    """Raise ValueError for a name that the formats do not take; else return None."""
    if not isinstance(name, str) or not re.fullmatch(NAMES, name):
        accepted = f"up to 75 letters, digits, _ and -, and none of {', '.join(_TAKEN)}"
        raise ValueError(checks.refusal("name", name, accepted))


def _identifier(name):
    """Return the `name` of a limit state without blanks and signs, as "angle_0p5" for "|Θ| ≥ 0.5"."""
    return "_".join(re.findall(r"[A-Za-z0-9.]+", name.replace("|Θ| ≥", "angle"))).replace(".", "p")


def _numbers(values):
    """Return numbers (n,) with all their digits, parted by blanks, as a text."""
    return " ".join(repr(float(value)) for value in values)
