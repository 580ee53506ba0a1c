"""Closed-form flight between impacts, and the first impact or overturning in it (derived in docs/theory).

On the side s the motion is x'' = x - s + f(t). With a particular solution P of P'' = P + f, the difference
y = x - s - P obeys y'' = y and is a sum of two exponentials. Over one *segment* of time, P is a polynomial in the time
since the segment's start; its coefficients are the only thing that distinguishes harmonic forcing, a noise realization
or the path of a quadrature node. All quantities are nondimensional.

Events are found in the folded motion u = s x >= 0, w = s v. A bound of u'' over the segment gives a parabola that u
cannot undercut; marching from one parabola's root to the next can approach the first event but never step over it,
grazing included, and converges quadratically.
"""

import math
from typing import NamedTuple

import numpy as np

from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.forcing import TERMS

NOTHING, IMPACT, OVERTURNING = 0, 1, 2
"""What ends a flight: the segment's end, an impact, the cut-off angle."""

SPEED_FLOOR = 1e-9
"""Slower than this at zero angle, a block that the force presses down is in contact rather than in flight."""

_TOUCH = 2e-15


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
def move_origin(coefficients, t, out):
    """Write the coefficients (TERMS,) of the same polynomial in the time since t."""
    for k in range(TERMS):
        out[k] = coefficients[k]
    for k in range(TERMS - 1):
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
def flight(x, v, side, segment, start, end):
    """Angle and velocity at `end` of a flight that is at (x, v) at `start`, times since the segment's start."""
    p0, q0 = polynomial(segment.particular, start)
    p1, q1 = polynomial(segment.particular, end)
    grow, decay = 0.5 * (x - side - p0 + v - q0), 0.5 * (x - side - p0 - v + q0)
    factor = math.exp(end - start)
    grow *= factor
    decay /= factor
    return side + p1 + grow + decay, q1 + grow - decay


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


# Inlined by force: a call would count references to the segment's arrays, which costs as much as the flight itself.
@kernel(forceinline=True, borrows=True)
def next_event(x, v, side, segment, start, end, cutoff):
    """First impact or overturning of a flight, or the segment's end.

    Parameters
    ----------
    x, v : float
        Angle (side * x >= 0) and velocity at `start`.
    side : int
        +1 or -1.
    segment : Segment
        The forcing.
    start, end : float
        Times since the segment's start.
    cutoff : float
        Angle whose first passage is overturning.

    Returns
    -------
    kind, time, x, v : int, float, float, float
        NOTHING, IMPACT or OVERTURNING, and the state there; at an impact x is 0 and v still the velocity before it
        (0 for a block in contact, see `SPEED_FLOOR`).
    """
    p0, q0 = polynomial(segment.particular, start)
    grow, decay = 0.5 * (x - side - p0 + v - q0), 0.5 * (x - side - p0 - v + q0)
    if side > 0:
        fall, rise = 1.0 - segment.force_low, cutoff - 1.0 + segment.force_high
    else:
        fall, rise = 1.0 + segment.force_high, cutoff - 1.0 - segment.force_low
    t, u, w = start, side * x, side * v
    while t < end:
        if u >= cutoff - _TOUCH and w > 0.0:
            return OVERTURNING, t, side * cutoff, side * w
        stay = safe_time(max(cutoff - u, 0.0), -w, rise)
        if w < 0.0 and u <= _TOUCH:
            return IMPACT, t, 0.0, side * w
        fly = safe_time(max(u, 0.0), w, fall)
        if w >= 0.0 and fly < end - t:
            force, jerk = polynomial(segment.force, t)
            lift = u - 1.0 + side * force
            if lift >= 0.0:
                fly += safe_time(lift, side * jerk, segment.force_curvature)
            elif u <= _TOUCH and w < SPEED_FLOOR:
                return IMPACT, t, 0.0, 0.0
        t_next = t + min(fly, stay)
        if not t_next > t:
            if stay < fly:
                return OVERTURNING, t, side * cutoff, side * w
            return IMPACT, t, 0.0, side * w
        t = min(t_next, end)
        p, q = polynomial(segment.particular, t)
        factor = math.exp(t - start)
        u = side * (side + p + grow * factor + decay / factor)
        w = side * (q + grow * factor - decay / factor)
    return NOTHING, end, side * u, side * w
