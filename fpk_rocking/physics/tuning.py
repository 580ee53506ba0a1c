"""The numbers of the physics that follow from no formula; those that move no result stand where they are used."""

from typing import NamedTuple


class Tuning(NamedTuple):
    """Tuned numbers of the iteration for the accelerations of an exact flight; nondimensional."""

    collocation_change: float = 1e-24
    """Square of an acceleration, times the duration, that the next round may still change."""
    collocation_turn: float = 1e-5
    """Largest sum of squares of the turns from the first guess for which a series has their sine and cosine."""


TUNING = Tuning()
