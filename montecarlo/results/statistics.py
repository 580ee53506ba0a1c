"""Sampling errors of the probabilities of bins."""

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
