"""Which intensity measure orders overturning best, over many scenes at many scales."""

import math
from typing import NamedTuple

import numpy as np

from fpk_rocking.base.types import Array
from fpk_rocking.studies.lognormal import fit_lognormal, shares_deviance
from fpk_rocking.studies.result import Fragility

_NAMES = {"pga_g": "PGA, g", "pgv_m_per_s": "PGV, m/s", "relative_velocity": "p PGV / (g tan θ_cr)"}


_SAME = 1e-9
"""Relative spread of the ratio of two measures that are one in two units."""


class Ranking(NamedTuple):
    """How well an intensity measure orders the outcomes of many motions.

    Parameters
    ----------
    measure : str
        Its name, with its unit.
    deviance : float
        Of the lognormal curve over the measure: twice the log-likelihood that it loses to the probabilities themselves,
        each of which counts like one outcome. The smaller, the better does the measure alone say what happens.
    median, dispersion : float
        Of that curve.

    Examples
    --------
    >>> from fpk_rocking import Scene
    >>> from fpk_rocking.studies import fragility, ranked, synthetic_records
    >>> motions = zip((1.2, 1.8, 2.4), synthetic_records(3, duration=5.0))
    >>> racks = [Scene.from_block(0.28 * height, height, record=record) for height, record in motions]
    >>> best = ranked(fragility(racks, scale=[1.0, 2.0, 3.0, 4.0]))[0]
    >>> print(f"{best.measure}: median {best.median:.2f}, dispersion {best.dispersion:.2f}")
    p PGV / (g tan θ_cr): median 0.88, dispersion 0.17
    """

    measure: str
    deviance: float
    median: float
    dispersion: float


def ranked(fragility: Fragility, which: int = 0) -> list[Ranking]:
    """Order intensity measures by how well they tell overturning, over all scenes and scales of a fragility.

    Parameters
    ----------
    fragility : Fragility
        Of several motions, not pooled.
    which : int
        Index of the probability: 0 overturning, 1, 2, ... the levels.

    Returns
    -------
    list of Ranking
        The best first; without those that a scene does not have, that determine no curve, or that are another one in
        other units, as p PGV/(g tan θ_cr) is for motions of one block.

    Examples
    --------
    >>> from fpk_rocking import Scene
    >>> from fpk_rocking.studies import fragility, ranked, synthetic_records
    >>> motions = zip((1.2, 1.8, 2.4), synthetic_records(3, duration=5.0))
    >>> racks = [Scene.from_block(0.28 * height, height, record=record) for height, record in motions]
    >>> for one in ranked(fragility(racks, scale=[1.0, 2.0, 3.0, 4.0])):
    ...     print(f"{one.measure}: deviance {one.deviance:.1f}")
    p PGV / (g tan θ_cr): deviance 5.1
    PGV, m/s: deviance 8.0
    PGA, g: deviance 13.3
    """
    shares, found = fragility.probability[:, which].ravel(), []
    taken: list[Array] = []
    for field, name in _NAMES.items():
        rows = [measure.columns(1.0)[field] * fragility.scale for measure in fragility.intensities]
        values = np.concatenate(rows)
        known = np.isfinite(shares) & np.isfinite(values) & (values > 0.0)
        if not known.all() or (fit := fit_lognormal(values, shares)).reason:
            continue
        if any(np.ptp(values / other) < _SAME * (values / other).max() for other in taken):
            continue
        taken.append(values)
        deviance = shares_deviance(values, shares, fit)
        found.append(Ranking(name, deviance if math.isfinite(deviance) else math.inf, fit.median, fit.dispersion))
    return sorted(found, key=lambda one: one.deviance)
