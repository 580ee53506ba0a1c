"""Polynomials of TERMS coefficients in the time since some instant, and how long a gap stays open."""

import math

from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion import TERMS


@kernel(borrows=True)
def move_origin(coefficients, t, out):
    """Write the coefficients (TERMS,) of the same polynomial in the time since t."""
    for k in range(TERMS):
        out[k] = coefficients[k]
    for k in range(TERMS - 1 if t != 0.0 else 0):
        for i in range(TERMS - 2, k - 1, -1):
            out[i] += t * out[i + 1]


@kernel(fastmath={"contract"}, borrows=True)
def polynomial(coefficients, t):
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


@kernel(borrows=True)
def safe_time(gap, slope, curvature):
    """Time for which a gap >= 0 with this slope and second derivative >= -curvature surely stays open (or inf)."""
    discriminant = slope * slope + 2.0 * curvature * gap
    if discriminant < 0.0:
        return math.inf
    root = math.sqrt(discriminant)
    if slope < 0.0:
        return 2.0 * gap / (root - slope)
    if curvature <= 0.0:
        return math.inf
    return (slope + root) / curvature
