"""The test whether two samples come from one law."""

from typing import NamedTuple

import numpy as np
from scipy import stats


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

    law = stats.hypergeom(first_size + second_size, first + second, first_size)
    p_values = np.minimum(1.0, 2.0 * np.minimum(law.cdf(first), law.sf(first - 1)))
    level = (1.0 - familywise) / first.size
    return SurvivalTest(p_values, level, bool(np.all(p_values > level)))
