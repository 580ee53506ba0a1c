"""The motion of one block: x'' = F(x, t) on the side s = ±1, v → e v at x = 0, and rest under a weak force.

Compiled, from the bottom: `equation` (accelerations, and the force over a time as a polynomial), `flight` (motion
between events), `impact` (the impact law and its derivative), `events` (a block through impacts, rest, lift-off and
overturning); `intervals` and `collocation` do what `events` does, fast, over the intervals of a grid, for slender and
for exact blocks. In plain numbers: `slender` (flights in closed form), `separatrix` (the orbit between the saddles),
`floor` (contact forces).
"""

import math

LIFT_OFF = 1.0
"""Largest |f| under which a slender block at rest stays."""

CRITICAL_RESTITUTION = math.exp(-math.pi / math.sqrt(3.0))
"""Below it white noise gives infinitely many impacts in finite time (Cornell, Swift, Bray 1998, cond-mat/9804229)."""

TERMS = 16
"""Coefficients of a piece of the forcing: for its `longest_piece` it is right to 1e-14 of the forcing's size."""


def lift_off(critical_angle: float) -> float:
    """Largest |f| under which a block at rest stays: tan(α)/α, or 1 for α = 0."""
    return math.tan(critical_angle) / critical_angle if critical_angle > 0.0 else LIFT_OFF
