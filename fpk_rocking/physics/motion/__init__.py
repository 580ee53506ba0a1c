"""The equation of motion on the side s = ±1, v → e v at x = 0, and rest under a weak force. Nobody else writes it.

`exact` holds it as it is, x'' = -s sin φ/α + f cos φ with φ = α (1 - s x) and the critical angle α: flights by Taylor
series under a force that is a polynomial over a `Segment` of time, and bounds of the acceleration. `slender` holds its
limit α → 0, x'' = x - s + f, with flights in closed form. `equation` is either of them, by the `Body` that a kernel is
given. `contact`, `events` and `transition` carry a block through impacts, rest and lift-off by bounds of the
acceleration alone, and so hold for both.

What follows from the slender equation alone is in `particular` (tables, without a compiler), `gaussian` (what white
noise adds to a flight), `saltation` (displacements through an impact) and `crossing` (impacts by iteration).
"""

import math

LIFT_OFF = 1.0
"""Largest |f| under which a slender block at rest stays."""


def lift_off(critical_angle: float) -> float:
    """Return the largest |f| under which a block of this critical angle α at rest stays: tan(α)/α, or 1 for α = 0."""
    return math.tan(critical_angle) / critical_angle if critical_angle > 0.0 else LIFT_OFF


TERMS = 16
"""Coefficients of a piece of the forcing: for its `longest_piece` it is right to 1e-14 of the forcing's size."""
