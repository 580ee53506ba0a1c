"""The slender block: x'' = x - s + f(t) on the side s, with flights in closed form (derived in docs/theory).

With a particular solution P of P'' = P + f, the difference y = x - s - P obeys y'' = y: it is a sum of two
exponentials. Over one *segment* of time, P is a polynomial in the time since the segment's start; its coefficients are
the only thing that distinguishes harmonic forcing, a noise realization or the path of a quadrature node.

Folded, u = s x >= 0 is the angle, w = s v the velocity and s f the force. All quantities are nondimensional.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion import LIFT_OFF, TERMS, particular
from fpk_rocking.physics.motion.polynomial import polynomial

stiffness = kernel(inline="always")(particular.stiffness)


class Slender(NamedTuple):
    """A slender block in numbers: the restitution e, and the angle whose first passage is overturning."""

    restitution: float
    cutoff: float


def block_of(scene: Any) -> Slender:
    """Return what the kernels have to know of a scene's block."""
    return Slender(scene.block.restitution, scene.overturning.angle)


@kernel(inline="always")
def block_in(problem):
    """Return the block of something that has its numbers among others."""
    return Slender(problem.restitution, problem.cutoff)


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
def lift(u, side, force):
    """Folded acceleration u'' = u - 1 + s f."""
    return u - 1.0 + side * force


@kernel(inline="always")
def pulls(side, low, high, block):
    """Bounds of -u'' and of u'' on the side s, from x = 0 to the cut-off, under a force between two bounds."""
    if side > 0:
        return 1.0 - low, block.cutoff - 1.0 + high
    return 1.0 + high, block.cutoff - 1.0 - low


@kernel(inline="always")
def can_lift_off(low, high):
    """Whether a force between two bounds may lift a block off that is at rest."""
    return max(high, -low) >= LIFT_OFF


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


@kernel(forceinline=True, borrows=True)
def launch(x, v, side, segment, start):
    """Return what `later` continues: the parts of a flight that is at (x, v) at `start`."""
    p, q = polynomial(segment.particular, start)
    return 0.5 * (x - side - p + v - q), 0.5 * (x - side - p - v + q)


@kernel(forceinline=True, borrows=True)
def later(grow, decay, side, segment, t, since):
    """Angle and velocity at t of a flight whose parts were those a time `since` before."""
    factor = math.exp(since)
    return join(grow * factor, decay / factor, side, segment.particular, t)


@kernel(borrows=True)
def flight(x, v, side, segment, start, end):
    """Angle and velocity at `end` of a flight that is at (x, v) at `start`, times since the segment's start."""
    return later(*launch(x, v, side, segment, start), side, segment, end, end - start)


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
