"""Sampling errors of probabilities: errors of bins, and the test whether two samples come from one law."""

from typing import NamedTuple

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.types import Array, ArrayLike


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
