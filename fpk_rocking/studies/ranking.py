"""Which intensity measure orders overturning best, over many scenes at many scales."""

import math
from typing import NamedTuple

import numpy as np

from fpk_rocking.studies.lognormal import fit_lognormal, shares_deviance
from fpk_rocking.studies.result import Fragility

_NAMES = {"pga_g": "PGA, g", "pgv_m_per_s": "PGV, m/s", "relative_velocity": "p PGV / (g tan θ_cr)"}


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
        The best first; without those that a scene does not have, or that determine no curve.
    """
    shares, found = fragility.probability[:, which].ravel(), []
    for field, name in _NAMES.items():
        rows = [measure.columns(1.0)[field] * fragility.scale for measure in fragility.intensities]
        values = np.concatenate(rows)
        known = np.isfinite(shares) & np.isfinite(values) & (values > 0.0)
        if not known.all() or (fit := fit_lognormal(values, shares)).reason:
            continue
        deviance = shares_deviance(values, shares, fit)
        found.append(Ranking(name, deviance if math.isfinite(deviance) else math.inf, fit.median, fit.dispersion))
    return sorted(found, key=lambda one: one.deviance)
