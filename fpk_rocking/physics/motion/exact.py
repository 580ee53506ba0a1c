"""The block as it is: x'' = -s sin(φ)/α + f cos φ, φ = α (1 - s x), by Taylor series (derived in docs/theory).

Over a segment of time the force is a polynomial. The series of the angle about any time in it follows from three Cauchy
products an order: (sin φ)' = φ' cos φ, (cos φ)' = -φ' sin φ and the equation itself. It is used for as long as its last
terms are below rounding, and then made anew. On it the folded angle u = s x is a polynomial, whose coefficients bound
its derivatives, so events are found as for the slender block.
"""

import math
from typing import NamedTuple

import numpy as np

from fpk_rocking.base.jit import kernel
from fpk_rocking.base.stack import scratch
from fpk_rocking.physics.motion import TERMS
from fpk_rocking.physics.motion.polynomial import move_origin, polynomial, safe_time

WORK = 4, TERMS
"""Shape of what `launch` writes: the series of u, sin φ, cos φ and s f."""

_ROUNDING, _BELOW = 1e-16, 1e-18
"""Last term of a series that has all its terms, and sum of the last two of one that ends before, over the angle."""

_PARTS = 1.0 / np.maximum(np.arange(TERMS), 1)

_work = scratch(*WORK)


@kernel(inline="always")
def lift(u, side, force, block):
    """Folded acceleration u'' = -sin φ/α + s f cos φ."""
    phi = block.critical_angle * (1.0 - u)
    return side * force * math.cos(phi) - math.sin(phi) / block.critical_angle


@kernel(inline="always")
def cosine(u, block):
    """Factor cos φ of the force, and of noise, in u''."""
    return math.cos(block.critical_angle * (1.0 - u))


@kernel(inline="always")
def steepness(u, side, force, block):
    """Change of u'' with u: cos φ + s f α sin φ."""
    phi = block.critical_angle * (1.0 - u)
    return math.cos(phi) + side * force * block.critical_angle * math.sin(phi)


@kernel(inline="always")
def stays_below(block):
    """Largest |f| under which a block at rest stays."""
    return math.tan(block.critical_angle) / block.critical_angle


@kernel(inline="always")
def pulls(side, low, high, block):
    """Bounds of -u'' and of u'' on the side s, from x = 0 to the cut-off, under a force between two bounds."""
    alpha, over = block.critical_angle, block.critical_angle * (block.cutoff - 1.0)
    least = min(math.cos(alpha), math.cos(over))
    if side < 0:
        low, high = -high, -low
    weakest, strongest = min(low, low * least), max(high, high * least)
    return math.sin(alpha) / alpha - weakest, math.sin(over) / alpha + strongest


class Course(NamedTuple):
    """A flight from (x, v) on, for `later`: its series holds from `begin` to `end`, with these bounds of -u'', u''."""

    begin: float
    end: float
    fall: float
    rise: float
    snap: float


@kernel(borrows=True)
def _expand(u, w, side, force, t, span, block, work):
    """Write the series (4, TERMS) of u, sin φ, cos φ and s f about a time; return for how long that of u holds.

    It ends where its terms are below rounding at the end of a span, for which it then holds.
    """
    angle, sine, cosine, push, alpha = work[0], work[1], work[2], work[3], block.critical_angle
    move_origin(force, t, push)
    phi = alpha * (1.0 - u)
    angle[0], angle[1], sine[0], cosine[0] = u, w, math.sin(phi), math.cos(phi)
    size, power, before, weight = max(1.0, abs(u)), span * span, math.inf, 1.0 / alpha
    angle[2] = 0.5 * (side * push[0] * cosine[0] - weight * sine[0])
    for k in range(1, TERMS - 2):
        s, c, total = 0.0, 0.0, 0.0
        for i in range(1, k + 1):
            turn = i * angle[i]
            s -= turn * cosine[k - i]
            c += turn * sine[k - i]
            total += push[i] * cosine[k - i]
        share = alpha * _PARTS[k]
        sine[k], cosine[k] = share * s, share * c
        total += push[0] * cosine[k]
        angle[k + 2] = (side * total - weight * sine[k]) * (_PARTS[k + 1] * _PARTS[k + 2])
        power *= span
        term = abs(angle[k + 2]) * power
        if before + term < _BELOW * size:
            angle[k + 3 :] = 0.0
            return span
        before = term
    last = max(abs(angle[TERMS - 1]), 1e-300)
    before = max(abs(angle[TERMS - 2]), 1e-300)
    reach = (_ROUNDING * size / last) ** (1.0 / (TERMS - 1))
    return min(reach, (_ROUNDING * size / before) ** (1.0 / (TERMS - 2)))


@kernel(borrows=True)
def launch(x, v, side, segment, start, end, work, block):
    """Return the `Course` of a flight that is at (x, v) at `start`."""
    reach = _expand(side * x, side * v, side, segment.force, start, end - start, block, work)
    angle, step = work[0], min(reach, end - start)
    spread, snap, power = 0.0, 0.0, 1.0
    for k in range(3, TERMS):
        term = k * (k - 1) * abs(angle[k]) * power
        if k > 3:
            snap += (k - 2) * (k - 3) * term
        power *= step
        spread += term * step
    end = start + step if step < end - start else end
    return Course(start, end, spread - 2.0 * angle[2], spread + 2.0 * angle[2], snap / step)


@kernel(borrows=True)
def later(course, side, segment, t, work, block):  # noqa: ARG001  (see `equation`)
    """Angle and velocity at t of a flight."""
    u, w = polynomial(work[0], t - course.begin)
    return side * u, side * w


@kernel(borrows=True)
def rising_time(course, u, side, segment, t, work, block):  # noqa: ARG001
    """Time for which u'' surely stays >= 0 from t on, within the series; -1 where u'' < 0 at t."""
    angle, since = work[0], t - course.begin
    rising, jerk = 0.0, 0.0
    for k in range(TERMS - 1, 1, -1):
        jerk = jerk * since + rising
        rising = rising * since + k * (k - 1) * angle[k]
    return safe_time(rising, jerk, course.snap) if rising >= 0.0 else -1.0


@kernel(borrows=True)
def flight(x, v, side, segment, start, end, block):
    """Angle and velocity at `end` of a flight that is at (x, v) at `start`, times since the segment's start."""
    work, t, u, w = _work(), start, side * x, side * v
    while t < end:
        reach = _expand(u, w, side, segment.force, t, end - t, block, work)
        u, w = polynomial(work[0], min(reach, end - t))
        t = t + reach if reach < end - t else end
    return side * u, side * w
