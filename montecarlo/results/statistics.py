"""Sampling errors of probabilities: intervals, errors of bins, and the test whether two samples come from one law."""

from typing import NamedTuple

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.types import Array, ArrayLike


def wilson_interval(successes, trials, level=0.95):
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
    level = checks.number("level", level, above=0.0)
    if level >= 1.0:
        raise ValueError(checks.refusal("level", level, "a number above 0 and below 1"))
    from scipy import special

    z = special.ndtri(0.5 + 0.5 * level)
    share = np.asarray(successes) / trials
    scale = 1.0 / (1.0 + z * z / trials)
    centre = scale * (share + 0.5 * z * z / trials)
    half = scale * z * np.sqrt(share * (1.0 - share) / trials + 0.25 * (z / trials) ** 2)
    return np.stack([np.where(share == 0.0, 0.0, centre - half), np.where(share == 1.0, 1.0, centre + half)], axis=-1)


def bin_errors(probabilities: ArrayLike, realizations: int) -> Array:
    """Return the sampling error of each bin's probability, as `Ensemble.bin_probabilities` estimates them.

    Parameters
    ----------
    probabilities : array_like
        Estimates, each a count over `realizations`.
    realizations : int
        Size of the sample.

    Returns
    -------
    ndarray, shape of the probabilities
        Half the width of Wilson's interval of one standard deviation: √(p (1 - p)/n) in a bin of many realizations, and
        about 1/(2 n) in an empty one, where that would be 0.
    """
    share = np.asarray(probabilities, float)
    trials = checks.count("realizations", realizations)
    return np.sqrt(share * (1.0 - share) / trials + 0.25 / trials**2) / (1.0 + 1.0 / trials)


class SurvivalTest(NamedTuple):
    """Outcome of `survival_test`: p-values (n,) of each cycle, the level each is held against, and whether all pass."""

    p_values: np.ndarray
    level: float
    agrees: bool


def survival_test(first, first_size, second, second_size, familywise=0.999):
    """Test whether two independent ensembles have the same survival at every cycle.

    Each cycle has its exact conditional p-value (Fisher: the survivors of the first among all survivors are
    hypergeometric), doubled for two sides; Bonferroni's correction over the cycles bounds the chance of any false alarm
    by 1 - familywise, however the cycles depend on each other.

    Parameters
    ----------
    first, second : array_like of int, shape (n,)
        Survivors at each cycle.
    first_size, second_size : int
        Sizes of the ensembles.
    familywise : float
        Probability that two samples of one law pass, at least.

    Returns
    -------
    SurvivalTest
    """
    first, second = np.asarray(first), np.asarray(second)
    from scipy import stats

    law = stats.hypergeom(first_size + second_size, first + second, first_size)
    p_values = np.minimum(1.0, 2.0 * np.minimum(law.cdf(first), law.sf(first - 1)))
    level = (1.0 - familywise) / first.size
    return SurvivalTest(p_values, level, bool(np.all(p_values > level)))
