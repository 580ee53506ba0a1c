"""The force over a segment of time as a polynomial: its value, its bounds, and the particular solution that it has.

With a particular solution P of P'' = P + f a flight of a slender block is s + P and two exponentials, and f = P'' - P.
Coefficients of P are the only thing that distinguishes harmonic forcing, a noise realization or the path of a
quadrature node. Polynomials have TERMS coefficients, in the time since some instant; all quantities are nondimensional.
"""

import math
from typing import NamedTuple

import numpy as np

from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion import TERMS


class Segment(NamedTuple):
    """Forcing over one segment of time, as a flight of a block needs it.

    `particular` and `force` are coefficients (TERMS,) of P and of f = P'' - P in the time since the segment's start;
    `force_low`, `force_high` bound f and `force_curvature` bounds |f''| over the segment.
    """

    particular: np.ndarray
    force: np.ndarray
    force_low: float
    force_high: float
    force_curvature: float


@kernel
def force_bounds_over(force, duration):
    """Bounds of f below and above and of |f''| up to a time on both sides of 0, from its coefficients (TERMS,)."""
    spread, curvature, power = 0.0, 0.0, 1.0
    for k in range(1, TERMS):
        if k >= 2:
            curvature += k * (k - 1) * abs(force[k]) * power / duration
        power *= duration
        spread += abs(force[k]) * power
    return force[0] - spread, force[0] + spread, curvature


@kernel
def force_from_particular(particular, duration, force):
    """Write the coefficients (TERMS,) of f = P'' - P from those of P; return its bounds, as `force_bounds_over`."""
    for k in range(TERMS):
        force[k] = -particular[k]
        if k + 2 < TERMS:
            force[k] += (k + 2) * (k + 1) * particular[k + 2]
    return force_bounds_over(force, duration)


@kernel
def force_bounds(particular, duration, low, high):
    """Write bounds (n,) of the forces of particular solutions (n, TERMS), up to a time on both sides of 0."""
    scratch = np.empty(TERMS)
    for i in range(low.size):
        low[i], high[i], _ = force_from_particular(particular[i], duration, scratch)


@kernel(inline="always")
def segment_from_force(force, duration):
    """Return the `Segment` of coefficients (TERMS,) of a force alone, for an exact block."""
    return Segment(force, force, *force_bounds_over(force, duration))


@kernel(inline="always")
def segment_from_particular(particular, force, duration):
    """Return the `Segment` of a particular solution (TERMS,); `force` (TERMS,) is scratch that the segment keeps.

    It hands on arrays, so it is made a part of every kernel that calls it: some count references, some borrow.
    """
    return Segment(particular, force, *force_from_particular(particular, duration, force))


@kernel
def particular_from_rest(force, particular):
    """Write P (TERMS,) of the force (TERMS,) that begins with zero angle and velocity."""
    particular[0], particular[1] = 0.0, 0.0
    for k in range(TERMS - 2):
        particular[k + 2] = (particular[k] + force[k]) / ((k + 1) * (k + 2))


@kernel
def move_origin(coefficients, t, out):
    """Write the coefficients (TERMS,) of the same polynomial in the time since t."""
    for k in range(TERMS):
        out[k] = coefficients[k]
    for k in range(TERMS - 1 if t != 0.0 else 0):
        for i in range(TERMS - 2, k - 1, -1):
            out[i] += t * out[i + 1]


@kernel(fastmath={"contract"})
def value_and_slope(coefficients, t):
    """Value and derivative at t of the polynomial with coefficients (TERMS,); even and odd powers apart, for speed."""
    if t == 0.0:
        return coefficients[0], coefficients[1]
    square = t * t
    even, odd = coefficients[TERMS - 2], coefficients[TERMS - 1]
    even_slope, odd_slope = 0.0, 0.0
    for k in range(TERMS - 4, -1, -2):
        even_slope = even_slope * square + even
        odd_slope = odd_slope * square + odd
        even = even * square + coefficients[k]
        odd = odd * square + coefficients[k + 1]
    return even + t * odd, odd + 2.0 * t * (even_slope + t * odd_slope)


@kernel
def least_closing_time(gap, slope, curvature):
    """Least time in which a gap >= 0 with this slope and a second derivative >= -curvature can close; or inf."""
    discriminant = slope * slope + 2.0 * curvature * gap
    if discriminant < 0.0:
        return math.inf
    root = math.sqrt(discriminant)
    if slope < 0.0:
        return 2.0 * gap / (root - slope)
    if curvature <= 0.0:
        return math.inf
    return (slope + root) / curvature
