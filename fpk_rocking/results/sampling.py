"""Sampling intervals of probabilities, and distances of binned probabilities with what sampling alone makes of them.

Bins hold sub-probabilities: their sum is the survival, not one. A sample size is the number of realizations behind the
bins, ``math.inf`` for bins that come from a density and carry no sampling error.
"""

import math
import statistics

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array, ArrayLike


def wilson_interval(successes: ArrayLike, trials: int | Array, level: float = 0.95) -> Array:
    """Return confidence limits (..., 2) of probabilities from counts (...), by E. B. Wilson (JASA 22, 209-212, 1927).

    They are within [0, 1] also where a count is 0 or `trials`, the size of each sample. ValueError for a `level`, the
    confidence of each interval, beyond (0, 1).
    """
    z = statistics.NormalDist().inv_cdf(0.5 + 0.5 * checks.part("level", level))
    share = np.asarray(successes) / trials
    scale = 1.0 / (1.0 + z * z / trials)
    centre = scale * (share + 0.5 * z * z / trials)
    half = scale * z * np.sqrt(share * (1.0 - share) / trials + 0.25 * (z / trials) ** 2)
    return np.stack([np.where(share == 0.0, 0.0, centre - half), np.where(share == 1.0, 1.0, centre + half)], axis=-1)


def l1(first: ArrayLike, second: ArrayLike) -> float:
    """Return the sum of absolute differences of two arrays of bin probabilities, of one shape: from 0 to 2."""
    return float(np.abs(np.asarray(first) - np.asarray(second)).sum())


def hellinger(first: Array, second: Array) -> float:
    """Return the Hellinger distance ``sqrt(1/2 sum (sqrt p - sqrt q)^2)`` of two arrays of bin probabilities, 0 to 1.

    They have one shape. A negative bin, the undershoot of a density, counts as zero here; `l1` takes it as it is.
    """
    roots = [np.sqrt(np.maximum(values, 0.0)) for values in (first, second)]
    return float(np.sqrt(0.5 * np.square(roots[0] - roots[1]).sum()))


def pooled(first: ArrayLike, second: ArrayLike, first_size: float, second_size: float) -> np.ndarray:
    """Return the best estimate of probabilities that two results share: the exact ones, or means by sample size.

    Two exact results are averaged. The estimate is within [0, 1].
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
    is not normal, and the bound ``2 p`` that always holds is the smaller and the better value. `probabilities` are
    those of the law, see `pooled`; a distance near this floor is explained by sampling alone.
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
    """
    p = np.asarray(probabilities, dtype=float).ravel()
    roots = [_mean_root(p, size) for size in (first_size, second_size)]
    return math.sqrt(max(float((p - roots[0] * roots[1]).sum()), 0.0))


def _mean_root(p, size) -> np.ndarray:
    """E sqrt(count/size) (n,) of bins of probability p (n,), for a sample `size`, which may be ``math.inf``."""
    if math.isinf(size):
        return np.sqrt(p)
    return np.sqrt(p) - (1.0 - p) * _root_deficit(p * size) / math.sqrt(size)


def _root_deficit(mean) -> np.ndarray:
    """sqrt(mean) - E sqrt(count), (n,), of Poisson counts: summed up to a mean of 30, then its asymptotic series."""
    from scipy.special import gammaln

    series_from = 30.0  # the counts up to 159 hold all but 1e-60 of a Poisson distribution of this mean
    large = np.maximum(mean, series_from)
    asymptotic = (1.0 / 8.0 + (7.0 / 128.0 + 75.0 / (1024.0 * large)) / large) / np.sqrt(large)
    small = np.clip(mean, 1e-300, series_from)[:, None]
    count = np.arange(1, 160)
    weights = np.exp(count * np.log(small) - small - gammaln(count + 1.0))
    summed = np.sqrt(small[:, 0]) - weights @ np.sqrt(count)
    return np.where(mean > series_from, asymptotic, summed)
