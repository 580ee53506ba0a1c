"""The force over a segment of time as a polynomial: value, bounds, roots, and the particular solution that it has.

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
    """Return bounds of f below and above, and a bound of |f''|, for times up to `duration` on both sides of 0.

    `force` (TERMS,) are the coefficients of f.
    """
    spread, curvature, power = 0.0, 0.0, 1.0
    for k in range(1, TERMS):
        if k >= 2:
            curvature += k * (k - 1) * abs(force[k]) * power / duration
        power *= duration
        spread += abs(force[k]) * power
    return force[0] - spread, force[0] + spread, curvature


@kernel
def force_from_particular(particular, duration, force):
    """Write the coefficients of f = P'' - P to `force` (TERMS,); return its bounds, as `force_bounds_over` does.

    `particular` (TERMS,) are the coefficients of P; the bounds hold for times up to `duration` on both sides of 0.
    """
    for k in range(TERMS):
        force[k] = -particular[k]
        if k + 2 < TERMS:
            force[k] += (k + 2) * (k + 1) * particular[k + 2]
    return force_bounds_over(force, duration)


@kernel
def force_bounds(particular, duration, low, high):
    """Write bounds of n forces below, to `low` (n,), and above, to `high` (n,).

    `particular` (n, TERMS) are the coefficients of P of each; the bounds hold for times up to `duration` on both sides
    of 0.
    """
    scratch = np.empty(TERMS)
    for i in range(low.size):
        low[i], high[i], _ = force_from_particular(particular[i], duration, scratch)


@kernel(inline="always")
def segment_from_force(force, duration):
    """Return the `Segment` of a force alone, for an exact block.

    `force` (TERMS,) are the coefficients of f; they stand in the place of P too, which an exact block does not use. The
    bounds hold for times up to `duration` on both sides of 0.
    """
    return Segment(force, force, *force_bounds_over(force, duration))


@kernel(inline="always")
def segment_from_particular(particular, force, duration):
    """Return the `Segment` of P, `particular` (TERMS,), with bounds of f for times up to `duration` on both sides of 0.

    The coefficients of f are written to `force` (TERMS,), which the segment keeps. It hands on arrays, so it is made a
    part of every kernel that calls it: some count references, some borrow.
    """
    return Segment(particular, force, *force_from_particular(particular, duration, force))


@kernel
def particular_from_rest(force, particular):
    """Write to `particular` (TERMS,) the P with P = P' = 0 at the time 0, for a force.

    `force` (TERMS,) are the coefficients of f.
    """
    particular[0], particular[1] = 0.0, 0.0
    for k in range(TERMS - 2):
        particular[k + 2] = (particular[k] + force[k]) / ((k + 1) * (k + 2))


@kernel
def move_origin(coefficients, t, out):
    """Write to `out` (TERMS,) the coefficients, in the time since t, of the polynomial with `coefficients` (TERMS,)."""
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
    """Least time in which a gap >= 0 can close, or inf; all nondimensional.

    `slope` is the gap's derivative at the begin; `-curvature` bounds its second derivative from below.
    """
    discriminant = slope * slope + 2.0 * curvature * gap
    if discriminant < 0.0:
        return math.inf
    root = math.sqrt(discriminant)
    if slope < 0.0:
        return 2.0 * gap / (root - slope)
    if curvature <= 0.0:
        return math.inf
    return (slope + root) / curvature


@kernel(fastmath={"contract", "reassoc"}, forceinline=True)
def curvature_bounds(folded, bend):
    """Half of the bounds of -u'' and of u'' over an interval, at least 0.

    `folded` (TERMS,) are the coefficients of u in the time since the middle, and `bend` (TERMS,) is, for k > 2,
    k (k - 1) times the half of the interval's duration to the power k - 2, else 0.
    """
    spread = 0.0
    for k in range(folded.size):
        spread += bend[k] * abs(folded[k])
    return max(0.5 * spread - folded[2], 0.0), max(0.5 * spread + folded[2], 0.0)


@kernel(fastmath={"contract"}, forceinline=True)
def downward_root(q, half):
    """Time in [-half, half] at which a polynomial falls through zero, and its slope there; 0, 0 if none is found.

    `q` (TERMS,) are its coefficients.
    """
    square = q[1] * q[1] - 4.0 * q[2] * q[0]
    if square <= 0.0:
        return 0.0, 0.0
    # Root of the first three terms, then one step of Newton's iteration on six.
    root = math.sqrt(square)
    t = 2.0 * q[0] / (root - q[1])
    t += t * t * t * (q[3] + t * (q[4] + t * q[5])) / (root - t * t * (3.0 * q[3] + t * (4.0 * q[4] + t * 5.0 * q[5])))
    least = 1e-7  # the last change of the time: the iteration converges cubically, in three rounds of these eight
    for _ in range(8):
        if not -half <= t <= half:
            break
        value, slope = value_and_slope(q, t)
        if slope >= 0.0:
            break
        bend = t * (30.0 * q[6] + t * (42.0 * q[7] + t * (56.0 * q[8] + t * 72.0 * q[9])))
        bend = 2.0 * q[2] + t * (6.0 * q[3] + t * (12.0 * q[4] + t * (20.0 * q[5] + bend)))
        shift = -value / slope
        shift *= 1.0 + 0.5 * shift * bend / slope
        t += shift
        if abs(shift) < least and abs(shift * bend) < -least * slope:
            jerk = 6.0 * q[3] + t * (24.0 * q[4] + t * 60.0 * q[5])
            return t, slope + shift * (bend + 0.5 * shift * jerk)
    return 0.0, 0.0


@kernel(forceinline=True)
def chord_excludes_event(u, end, square, rise, fall, cutoff):
    """Whether a flight surely has no event between its ends: the parabolas over its chord tell.

    `u` and `end` are the folded angles at its ends, `square` is that of its duration, `rise` and `fall` are half of the
    bounds of u'' and -u'', and `cutoff` is the angle of overturning.
    """
    higher, lower = max(u, end), min(u, end)
    return (higher >= rise * square or lower >= 0.25 * rise * square) and higher + 0.25 * fall * square < cutoff
