"""What sampling explains: intervals of probabilities, distances of binned probabilities and their sampling floors.

Bins hold sub-probabilities: their sum is the survival, not one. A sample size is the number of realizations behind the
bins, ``math.inf`` for bins that come from a density and carry no sampling error.
"""

import math
import statistics

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.types import Array, ArrayLike

__all__ = ["hellinger", "hellinger_floor", "l1", "l1_floor", "pooled", "wilson_interval"]


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


def l1(first: ArrayLike, second: ArrayLike) -> float:
    """Sum of absolute differences of two arrays (...) of bin probabilities, between 0 and 2."""
    return float(np.abs(np.asarray(first) - np.asarray(second)).sum())


def hellinger(first: Array, second: Array) -> float:
    """Hellinger distance ``sqrt(1/2 sum (sqrt p - sqrt q)^2)`` of two arrays (...) of bin probabilities, from 0 to 1.

    A negative bin, the undershoot of a density, counts as zero here; `l1` takes it as it is.
    """
    roots = [np.sqrt(np.maximum(values, 0.0)) for values in (first, second)]
    return float(np.sqrt(0.5 * np.square(roots[0] - roots[1]).sum()))


def pooled(first: ArrayLike, second: ArrayLike, first_size: float, second_size: float) -> np.ndarray:
    """Best estimate of a probability that two results share: the exact one, or the mean weighted by sample size.

    Parameters
    ----------
    first, second : array_like
        Probabilities of equal shape.
    first_size, second_size : float
        Sample sizes, ``math.inf`` where there is no sampling error.

    Returns
    -------
    ndarray
        Probabilities within [0, 1]. Two exact results are averaged.
    """
    if math.isinf(first_size) or math.isinf(second_size):
        weight = float(math.isinf(first_size)) / (math.isinf(first_size) + math.isinf(second_size))
    else:
        weight = first_size / (first_size + second_size)
    return np.clip(weight * np.asarray(first) + (1.0 - weight) * np.asarray(second), 0.0, 1.0)


def l1_floor(probabilities: ArrayLike, first_size: float, second_size: float) -> float:
    """Return the expected `l1` of two samples drawn from one law.

    A bin's difference is nearly normal with variance ``p (1 - p) (1/n1 + 1/n2)``, so its expected absolute value is
    ``sqrt(2/pi)`` times the square root of that. Where less than about one sample is expected in a bin the difference
    is not normal, and the bound ``2 p`` that always holds is the smaller and the better value.

    Parameters
    ----------
    probabilities : array_like
        The common bin probabilities, see `pooled`.
    first_size, second_size : float
        Sample sizes, ``math.inf`` where there is no sampling error.

    Returns
    -------
    float
        The sampling floor: a distance near it is explained by sampling alone.
    """
    p = np.asarray(probabilities, dtype=float)
    variance = p * (1.0 - p) * (1.0 / first_size + 1.0 / second_size)
    return float(np.minimum(np.sqrt(2.0 / math.pi * variance), 2.0 * p).sum())


def hellinger_floor(probabilities: ArrayLike, first_size: float, second_size: float) -> float:
    """Return the root mean square `hellinger` of two samples drawn from one law.

    Of two independent samples ``E (sqrt p1 - sqrt p2)^2 = 2 p - 2 E sqrt p1 E sqrt p2``, where p1 and p2 are a bin's
    observed frequencies and p is their mean; summed and halved this is the mean square distance. ``E sqrt p1`` is taken
    from the Poisson distribution of the bin's count, its deficit below ``sqrt p`` scaled by the binomial ``1 - p``, so
    bins with few or no samples are counted right. In bins with many samples the sum tends to
    ``(1 - p)/8 (1/n1 + 1/n2)`` a bin, hence about ``sqrt(bins/8 (1/n1 + 1/n2))`` for the distance.

    Parameters
    ----------
    probabilities : array_like
        The common bin probabilities, see `pooled`.
    first_size, second_size : float
        Sample sizes, ``math.inf`` where there is no sampling error.

    Returns
    -------
    float
        The sampling floor: a distance near it is explained by sampling alone.
    """
    p = np.asarray(probabilities, dtype=float).ravel()
    roots = [_mean_root(p, size) for size in (first_size, second_size)]
    return math.sqrt(max(float((p - roots[0] * roots[1]).sum()), 0.0))


def _mean_root(p, size) -> np.ndarray:
    """E sqrt(count/size) (n,) in bins of probability p (n,), for a sample size, which may be ``math.inf``."""
    if math.isinf(size):
        return np.sqrt(p)
    return np.sqrt(p) - (1.0 - p) * _root_deficit(p * size) / math.sqrt(size)


def _root_deficit(mean) -> np.ndarray:
    """sqrt(mean) - E sqrt(count) (n,) of Poisson counts with the means `mean` (n,).

    It is summed up to a mean of 30, and follows from its asymptotic series above.
    """
    from scipy.special import gammaln

    series_from = 30.0  # the counts up to 159 hold all but 1e-60 of a Poisson distribution of this mean
    large = np.maximum(mean, series_from)
    asymptotic = (1.0 / 8.0 + (7.0 / 128.0 + 75.0 / (1024.0 * large)) / large) / np.sqrt(large)
    small = np.clip(mean, 1e-300, series_from)[:, None]
    count = np.arange(1, 160)
    weights = np.exp(count * np.log(small) - small - gammaln(count + 1.0))
    summed = np.sqrt(small[:, 0]) - weights @ np.sqrt(count)
    return np.where(mean > series_from, asymptotic, summed)
