"""The slender block: x'' = x - s + f(t) on the side s, with flights in closed form (derived in docs/theory).

With a particular solution P of P'' = P + f, the difference y = x - s - P obeys y'' = y: it is a sum of two
exponentials. Over one *segment* of time, P is a polynomial in the time since the segment's start; its coefficients are
the only thing that distinguishes harmonic forcing, a noise realization or the path of a quadrature node. All quantities
are nondimensional.
"""

import math
from typing import NamedTuple

import numpy as np

from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion import TERMS
from fpk_rocking.physics.motion.polynomial import polynomial


class Segment(NamedTuple):
    """Forcing over one segment of time: what `next_event` and `advance` need to know of it.

    `particular` and `force` are coefficients (TERMS,) of P and of f = P'' - P in the time since the segment's start;
    `force_low`, `force_high` bound f and `force_curvature` bounds |f''| over the segment.
    """

    particular: np.ndarray
    force: np.ndarray
    force_low: float
    force_high: float
    force_curvature: float


@kernel(borrows=True)
def bounds(particular, duration, force):
    """Write the coefficients (TERMS,) of f = P'' - P; return bounds of f below and above and of |f''| up to a time."""
    for k in range(TERMS):
        force[k] = -particular[k]
        if k + 2 < TERMS:
            force[k] += (k + 2) * (k + 1) * particular[k + 2]
    spread, curvature, power = 0.0, 0.0, 1.0
    for k in range(1, TERMS):
        if k >= 2:
            curvature += k * (k - 1) * abs(force[k]) * power / duration
        power *= duration
        spread += abs(force[k]) * power
    return force[0] - spread, force[0] + spread, curvature


@kernel(inline="always")
def segment_of(particular, force, duration):
    """Make the `Segment` of a particular solution; `force` (TERMS,) is scratch that the segment keeps.

    It hands on arrays, so it is made a part of every kernel that calls it: some count references, some borrow.
    """
    return Segment(particular, force, *bounds(particular, duration, force))


@kernel(borrows=True)
def flight(x, v, side, segment, start, end):
    """Angle and velocity at `end` of a flight that is at (x, v) at `start`, times since the segment's start."""
    p0, q0 = polynomial(segment.particular, start)
    p1, q1 = polynomial(segment.particular, end)
    grow, decay = 0.5 * (x - side - p0 + v - q0), 0.5 * (x - side - p0 - v + q0)
    factor = math.exp(end - start)
    grow *= factor
    decay /= factor
    return side + p1 + grow + decay, q1 + grow - decay
