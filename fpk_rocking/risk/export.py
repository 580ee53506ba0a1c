"""Fragility curves in the formats of OpenQuake (NRML 0.5) and pelicun."""

import json
import math
import pathlib
import re
from collections.abc import Sequence
from xml.etree import ElementTree as ET

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import File
from fpk_rocking.results.storage import write_text
from fpk_rocking.results.trust import Trust
from fpk_rocking.risk.population import IntensityCurve

_TAKEN = "risk", "curve", "motions"
"""Names whose files would replace others of a study: risk.json, curve.csv, motions.csv."""

NAMES = rf"(?!(?:{'|'.join(_TAKEN)})$)[A-Za-z0-9_-]{{1,75}}"
"""Regular expression of a name that the formats take."""


def to_nrml(
    path: File, curves: Sequence[IntensityCurve], name: str, description: str = "", trust: Trust | None = None
) -> None:
    """Write curves as the limit states of one fragility function in OpenQuake's NRML 0.5.

    The function is continuous (lognormal) where each curve has a lognormal fit that is not rejected, else discrete: the
    points as they are. PGA is in g, PGV in cm/s.

    Parameters
    ----------
    path : str or pathlib.Path
        File to write.
    curves : sequence of IntensityCurve
        Of one measure, the mildest limit state first.
    name : str
        Identifier of the function, which an exposure model refers to: letters, digits, ``_`` and ``-``.
    description : str
        For a reader; by default how the curves were made.
    trust : Trust, optional
        Verdict that follows the description; by default that of the last curve.

    Raises
    ------
    ValueError
        There is no curve, their measures or, where discrete, intensities differ, or the name is not accepted.

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
    measure, factor = curves[0].measure, 100.0 if curves[0].measure == "PGV" else 1.0  # OpenQuake takes PGV in cm/s
    states = [_identifier(curve.name) for curve in curves]
    root = ET.Element("nrml", xmlns="http://openquake.org/xmlns/nrml/0.5")
    model = ET.SubElement(root, "fragilityModel", assetCategory="contents", id=name, lossCategory="contents")
    unit = " PGV in this file is in cm/s." * (measure == "PGV")
    ET.SubElement(model, "description").text = _described(curves[-1], description, trust) + unit
    ET.SubElement(model, "limitStates").text = " ".join(states)
    fitted = all(curve.fitted for curve in curves)
    kind: dict[str, str] = {"format": "continuous", "shape": "logncdf"} if fitted else {"format": "discrete"}
    function = ET.SubElement(model, "fragilityFunction", kind, id=name)
    intensity = factor * curves[0].intensity
    imls = ET.SubElement(function, "imls", imt=measure, noDamageLimit=repr(1e-6 * float(intensity[0])))
    if fitted:
        # OpenQuake samples a few intensities of this range, and takes the probability beyond it as constant: it spans
        # probabilities from 5e-7 to 1 - 5e-7.
        low = min(curve.fit.median * math.exp(-4.9 * curve.fit.dispersion) for curve in curves)
        high = max(curve.fit.median * math.exp(4.9 * curve.fit.dispersion) for curve in curves)
        imls.set("minIML", repr(factor * low))
        imls.set("maxIML", repr(factor * high))
        imls.set("noDamageLimit", repr(factor * low))
        for state, curve in zip(states, curves, strict=True):
            median, spread = factor * curve.fit.median, curve.fit.dispersion
            mean = median * math.exp(0.5 * spread**2)
            deviation = mean * math.sqrt(math.expm1(spread**2))
            ET.SubElement(function, "params", ls=state, mean=repr(mean), stddev=repr(deviation))
    else:
        imls.text = _numbers(intensity)
        for state, curve in zip(states, curves, strict=True):
            ET.SubElement(function, "poes", ls=state).text = _numbers(curve.probability)
    ET.indent(root)
    write_text(path, '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n")


def to_pelicun(path: File, curve: IntensityCurve, name: str, description: str = "", trust: Trust | None = None) -> None:
    """Write a curve as a row of pelicun's fragility table (CSV), with its description beside it (JSON).

    Lognormal where the curve has a fit that is not rejected, else the points (``multilinear_CDF``).

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
    check_name(name)
    if refused := not_for_pelicun(curve):
        raise ValueError(refused)
    path = checks.path("path", path)
    demands = {"PGA": ("Peak Ground Acceleration", "g"), "PGV": ("Peak Ground Velocity", "mps")}
    demand, unit = demands[curve.measure]
    if curve.fitted:
        family, first, second = "lognormal", repr(curve.fit.median), repr(curve.fit.dispersion)
    else:
        family, second = "multilinear_CDF", ""
        points = _distribution(curve)
        first = '"' + "|".join(",".join(map(repr, values.tolist())) for values in points) + '"'
    header = "ID,Incomplete,Demand-Type,Demand-Unit,Demand-Offset,Demand-Directional,LS1-Family,LS1-Theta_0,LS1-Theta_1"
    trust = trust or curve.trust
    row = f"{name},0,{demand},{unit},0,0,{family},{first},{second},,{trust.verdict}"
    write_text(path, f"{header},LS1-DamageStateWeights,Verdict\n{row}\n")
    about = {
        "Description": _described(curve, description, trust),
        "Verdict": trust.plain,
        "LimitStates": {"LS1": {"DS1": {"Description": curve.name}}},
    }
    write_text(pathlib.Path(path).with_suffix(".json"), json.dumps({name: about}, indent=2) + "\n")


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


def _distribution(curve):
    """Return (intensities, probabilities), (n,) each, of an `IntensityCurve`, as pelicun wants them."""
    # Without shaking no block overturns.
    x, y = np.append(0.0, curve.intensity), np.append(0.0, np.maximum.accumulate(curve.probability))
    rises = np.diff(y) > 0.0
    needed = np.append(False, rises) | (np.append(rises, False) & (y == 0.0))
    return x[needed], y[needed]


def not_for_pelicun(curve: IntensityCurve) -> str:
    """Return why pelicun could not take a curve, as a text."""
    if curve.fitted or curve.probability[-1] == 1.0:
        return ""
    accepted = "1, which pelicun asks of a curve without a lognormal fit: give higher intensities"
    return checks.refusal("probability at the highest intensity", float(curve.probability[-1]), accepted)


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
