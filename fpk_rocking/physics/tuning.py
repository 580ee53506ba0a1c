"""The numbers of the physics that follow from no formula: tolerances, bounds of iterations, and where a method ends."""

from typing import NamedTuple


class Tuning(NamedTuple):
    """Tuned numbers of motion; times, angles and speeds are nondimensional."""

    touch: float = 2e-15
    """Distance from zero angle or the cut-off that counts as contact: ten times the rounding of an angle."""
    speed_floor: float = 1e-9
    """Slower than this at zero angle, a block that the force presses down is in contact rather than in flight."""
    chatter_time: float = 1e-6
    """Chatter that ends within it is summed in closed form; a segment that ends meanwhile sees it over already."""
    force_margin: float = 1e-12
    """Part of the largest |f| by which it must pass its level to lift a block off: a thousand times its rounding."""

    series_rounding: float = 1e-16
    """Last term, over the angle, up to which a Taylor series that has all its terms is used."""
    series_end: float = 1e-18
    """Sum of two terms, over the angle, below which a Taylor series ends before it has all its terms."""

    interval_least_speed: float = 1e-4
    """Impacts of slender blocks that leave with less speed go to the search for events, which decides about chatter."""
    root_change: float = 1e-7
    """Last change of the time in the iteration for a root, which converges cubically."""
    root_rounds: int = 8
    """Most rounds of it: from a start that has six terms of the polynomial three are enough."""

    collocation_rounds: int = 12
    """Most rounds of the iteration for the accelerations of an exact flight; each gains about three digits."""
    collocation_change: float = 1e-24
    """Square of an acceleration, times the duration, that the next round may still change."""
    collocation_first_gain: float = 1e-4
    """Square of what the first round of it is sure to gain."""
    collocation_turn: float = 1e-5
    """Largest sum of squares of the turns from the first guess for which a series has their sine and cosine."""
    collocation_shortest: float = 0.02
    """Shortest flight, in halves of the interval, that is tried where no bound decides about a longer one."""
    hop_speed: float = 2e-4
    """Speed after an impact up to which the hop to the next one is a polynomial of fourth order."""
    hop_rounding: float = 1e-9
    """Acceleration, times a quarter of the square of a flight's duration, that counts as none."""
    root_distance: float = 1e-7
    """Time by which an impact may lie beside the root that was found on the polynomial of a flight."""


TUNING = Tuning()
