"""The equation of motion: x'' = x - s + f on the side s = ±1, v → e v at x = 0, and rest while |f| <= 1.

Nobody else writes it. `slender` holds it: flights in closed form under a force that is a polynomial over a `Segment` of
time, and bounds of the acceleration. What follows from it alone is in `particular` (tables, without a compiler),
`gaussian` (what white noise adds to a flight), `saltation` (displacements through an impact) and `crossing` (impacts by
iteration). `contact`, `events` and `transition` carry a block through impacts, rest and lift-off by bounds of the
acceleration alone: they hold for any equation that has a `Segment`, `launch` and `later`, `lift` and `pulls`.
"""

LIFT_OFF = 1.0
"""Largest |f| under which a block at rest stays."""

TERMS = 16
"""Coefficients of a piece of the forcing: for its `longest_piece` it is right to 1e-14 of the forcing's size."""
