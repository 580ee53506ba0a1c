"""What an evolution of a density leaves: masses and coefficients after every cycle."""

from typing import NamedTuple

import numpy as np


class Solution(NamedTuple):
    """A density over whole cycles.

    Parameters
    ----------
    inside : ndarray, shape (cycles + 1,)
        Mass that has not overturned, at rest or not.
    gone : ndarray, shape (cycles + 1, 3)
        Masses that have overturned to the left, to the right, and that are lost.
    coefficients : ndarray, shape (cycles + 1, *space.shape)
        Of the density; that of the blocks that move, where `at_rest` holds the others.
    at_rest : ndarray, shape (cycles + 1,), optional
        Mass at rest, which has no density.
    resolved : ndarray of bool, shape (cycles + 1,), optional
        Rows in which the density itself is to be resolved, all but the first unless given; of others survival alone.
    released : float
        Largest mass that had come to rest and was lifted off again.
    """

    inside: np.ndarray
    gone: np.ndarray
    coefficients: np.ndarray
    at_rest: np.ndarray | None = None
    resolved: np.ndarray | None = None
    released: float = 0.0

    @property
    def shown(self):
        """Numbers of the rows in which the density is resolved."""
        rows = np.arange(len(self.inside)) > 0 if self.resolved is None else self.resolved
        return np.flatnonzero(rows)
