"""The slender block: x'' = x - s + f(t) on the side s, with flights in closed form (derived in docs/theory).

With a particular solution P of P'' = P + f, the difference y = x - s - P obeys y'' = y: it is a sum of two
exponentials. Over one *segment* of time, P is a polynomial in the time since the segment's start; its coefficients are
the only thing that distinguishes harmonic forcing, a noise realization or the path of a quadrature node.

Folded, u = s x >= 0 is the angle, w = s v the velocity and s f the force. All quantities are nondimensional.
"""

import math
from typing import NamedTuple

import numpy as np

from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion import LIFT_OFF, TERMS, particular
from fpk_rocking.physics.motion.polynomial import polynomial, safe_time

stiffness = kernel(inline="always")(particular.stiffness)


class Segment(NamedTuple):
    """Forcing over one segment of time: what a flight of the block needs to know of it.

    `particular` and `force` are coefficients (TERMS,) of P and of f = P'' - P in the time since the segment's start;
    `force_low`, `force_high` bound f and `force_curvature` bounds |f''| over the segment.
    """

    particular: np.ndarray
    force: np.ndarray
    force_low: float
    force_high: float
    force_curvature: float


@kernel(borrows=True)
def bounds_of(force, duration):
    """Bounds of f below and above and of |f''| up to a time on both sides of 0."""
    spread, curvature, power = 0.0, 0.0, 1.0
    for k in range(1, TERMS):
        if k >= 2:
            curvature += k * (k - 1) * abs(force[k]) * power / duration
        power *= duration
        spread += abs(force[k]) * power
    return force[0] - spread, force[0] + spread, curvature


@kernel(borrows=True)
def bounds(particular, duration, force):
    """Write the coefficients (TERMS,) of f = P'' - P; return its bounds, as `bounds_of`."""
    for k in range(TERMS):
        force[k] = -particular[k]
        if k + 2 < TERMS:
            force[k] += (k + 2) * (k + 1) * particular[k + 2]
    return bounds_of(force, duration)


@kernel(inline="always")
def force_segment(force, duration):
    """Make the `Segment` of a force alone, for an exact block; see `segment_of`."""
    return Segment(force, force, *bounds_of(force, duration))


@kernel(inline="always")
def segment_of(particular, force, duration):
    """Make the `Segment` of a particular solution; `force` (TERMS,) is scratch that the segment keeps.

    It hands on arrays, so it is made a part of every kernel that calls it: some count references, some borrow.
    """
    return Segment(particular, force, *bounds(particular, duration, force))


@kernel
def force_bounds(particular, duration, low, high):
    """Write bounds (n,) of the forces of particular solutions (n, TERMS), up to a time on both sides of 0."""
    scratch = np.empty(TERMS)
    for i in range(low.size):
        low[i], high[i], _ = bounds(particular[i], duration, scratch)


@kernel(borrows=True)
def respond(force, particular):
    """Write P (TERMS,) of the force (TERMS,) that begins with zero angle and velocity."""
    particular[0], particular[1] = 0.0, 0.0
    for k in range(TERMS - 2):
        particular[k + 2] = (particular[k] + force[k]) / ((k + 1) * (k + 2))


@kernel(inline="always")
def lift(u, side, force, block):  # noqa: ARG001  (see `equation`)
    """Folded acceleration u'' = u - 1 + s f."""
    return u - 1.0 + side * force


@kernel(inline="always")
def cosine(u, block):  # noqa: ARG001
    """Factor of the force, and of noise, in u''."""
    return 1.0


@kernel(inline="always")
def steepness(u, side, force, block):  # noqa: ARG001
    """Change of u'' with u."""
    return 1.0


@kernel(inline="always")
def stays_below(block):  # noqa: ARG001
    """Largest |f| under which a block at rest stays."""
    return LIFT_OFF


@kernel(inline="always")
def pulls(side, low, high, block):
    """Bounds of -u'' and of u'' on the side s, from x = 0 to the cut-off, under a force between two bounds."""
    if side > 0:
        return 1.0 - low, block.cutoff - 1.0 + high
    return 1.0 + high, block.cutoff - 1.0 - low


@kernel(forceinline=True, borrows=True)
def split(x, v, side, particular, t):
    """Growing and decaying part of y = x - s - P, for a flight that is at (x, v) at a time."""
    p, q = polynomial(particular, t)
    y, z = x - side - p, v - q
    return 0.5 * (y + z), 0.5 * (y - z)


@kernel(forceinline=True, borrows=True)
def join(grow, decay, side, particular, t):
    """Angle and velocity of a flight at a time, from its parts there: the inverse of `split`."""
    p, q = polynomial(particular, t)
    return side + p + grow + decay, q + grow - decay


@kernel(inline="always")
def fold(side, p, grow, decay):
    """Folded angle of a flight, from P and its parts."""
    return 1.0 + side * (p + grow + decay)


class Course(NamedTuple):
    """A flight from (x, v) on, for `later`: its exponentials at `begin`, and bounds of -u'' and u'' up to `end`."""

    begin: float
    end: float
    fall: float
    rise: float
    grow: float
    decay: float


@kernel(forceinline=True, borrows=True)
def launch(x, v, side, segment, start, end, work, block):  # noqa: ARG001
    """Return the `Course` of a flight that is at (x, v) at `start`."""
    p, q = polynomial(segment.particular, start)
    fall, rise = pulls(side, segment.force_low, segment.force_high, block)
    return Course(start, end, fall, rise, 0.5 * (x - side - p + v - q), 0.5 * (x - side - p - v + q))


@kernel(forceinline=True, borrows=True)
def later(course, side, segment, t, work, block):  # noqa: ARG001
    """Angle and velocity at t of a flight."""
    factor = math.exp(t - course.begin)
    return join(course.grow * factor, course.decay / factor, side, segment.particular, t)


@kernel(forceinline=True, borrows=True)
def rising_time(course, u, side, segment, t, work, block):  # noqa: ARG001
    """Time for which u'' surely stays >= 0 from t on, where the folded angle is u; -1 where u'' < 0 at t."""
    force, jerk = polynomial(segment.force, t)
    rising = lift(u, side, force, block)
    return safe_time(rising, side * jerk, segment.force_curvature) if rising >= 0.0 else -1.0


@kernel(borrows=True)
def flight(x, v, side, segment, start, end, block):  # noqa: ARG001
    """Angle and velocity at `end` of a flight that is at (x, v) at `start`, times since the segment's start."""
    p, q = polynomial(segment.particular, start)
    factor = math.exp(end - start)
    grow, decay = 0.5 * (x - side - p + v - q), 0.5 * (x - side - p - v + q)
    return join(grow * factor, decay / factor, side, segment.particular, end)


@kernel
def escape(u, w, side, particular, t):
    """Unstable coordinate z = u + w - 1 - s (P + P'): above 0 a flight without noise or impact escapes."""
    value, slope = polynomial(particular, t)
    return u + w - 1.0 - side * (value + slope)


@kernel(inline="always")
def hyperbolic_turn(y, v, keep, swap):
    """Carry y = x - s and v over a time with this cosh and sinh; the force adds to both."""
    return keep * y + swap * v, swap * y + keep * v


@kernel(inline="always")
def carried(x, v, affine):
    """Angle and velocity after a flight that is given as an affine map: its cosh, its sinh, and its shift (2,)."""
    cosh, sinh, shift = affine
    return shift[0] + cosh * x + sinh * v, shift[1] + sinh * x + cosh * v


@kernel(fastmath={"contract"}, borrows=True)
def runge_kutta(h):
    """Return what a step of the classical method of order 4 has in place of cosh, sinh and cosh - 1."""
    keep, swap = 1.0 + h * h * (0.5 + h * h / 24.0), h * (1.0 + h * h / 6.0)
    return keep, swap, h * h * (3.0 + 0.25 * h * h) / 6.0


@kernel(fastmath={"contract"}, borrows=True)
def runge_kutta_push(begin, middle, end, h):
    """Angle and velocity that a force of these values adds to a step of that method."""
    x = h * h * ((1.0 + 0.25 * h * h) * begin + 2.0 * middle) / 6.0
    return x, h * ((1.0 + 0.5 * h * h) * begin + (4.0 + 0.5 * h * h) * middle + end) / 6.0
