"""Confidence intervals of probabilities from counts."""

import statistics

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.types import Array, ArrayLike


def wilson_interval(successes: ArrayLike, trials: int | Array, level: float = 0.95) -> Array:
    """Confidence interval of a probability from a count (E. B. Wilson, J. Am. Stat. Assoc. 22, 209-212, 1927).

    Parameters
    ----------
    successes : array_like of int
        Counts.
    trials : int or array_like
        Size of the sample.
    level : float
        Confidence of each interval, in (0, 1).

    Returns
    -------
    ndarray, shape (..., 2)
        Lower and upper limits, within [0, 1] also where the count is 0 or `trials`.

    Raises
    ------
    TypeError, ValueError
        The level is not a number above 0 and below 1.
    """
    z = statistics.NormalDist().inv_cdf(0.5 + 0.5 * checks.part("level", level))
    share = np.asarray(successes) / trials
    scale = 1.0 / (1.0 + z * z / trials)
    centre = scale * (share + 0.5 * z * z / trials)
    half = scale * z * np.sqrt(share * (1.0 - share) / trials + 0.25 * (z / trials) ** 2)
    return np.stack([np.where(share == 0.0, 0.0, centre - half), np.where(share == 1.0, 1.0, centre + half)], axis=-1)
