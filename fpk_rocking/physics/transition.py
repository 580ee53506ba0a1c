"""The motion of a block through a segment of time: flights joined by impacts, chatter, rest and uplift."""

from fpk_rocking.jit import kernel
from fpk_rocking.physics.contact import chatter_time, impact
from fpk_rocking.physics.flight import IMPACT, OVERTURNING, SPEED_FLOOR, next_event, polynomial, safe_time

SLOW = 1e-6
"""Chatter that ends within this time is summed in closed form; the sum is then right to about SLOW^2."""

_FORCE_FLOOR = 1e-12


@kernel
def uplift_level(segment):
    """Force beyond which a block at rest uplifts: 1 and a margin above the rounding of f, so that it surely leaves."""
    return 1.0 + _FORCE_FLOOR * max(1.0, -segment.force_low, segment.force_high)


@kernel
def uplift_time(segment, start, end):
    """First time in [start, end] at which a block at rest uplifts, |f| passing 1, and the side it goes to (0: none)."""
    level = uplift_level(segment)
    target = 2.0 * level - 1.0
    t = start
    while t < end:
        force, slope = polynomial(segment.force, t)
        if abs(force) > level:
            return t, (1 if force > 0.0 else -1)
        below = safe_time(target + force, slope, segment.force_curvature)
        above = safe_time(target - force, -slope, segment.force_curvature)
        t += min(below, above)
    return end, 0


@kernel
def settle(speed, side, segment, time, restitution):
    """Decide what follows an impact: flight (side, 0), rest after a delay (0, delay), or uplift at once (side, 0).

    `speed` is that just after the impact and `side` the side it leads to. Chatter is summed where it ends within `SLOW`
    under a force that changes by less than a hundredth of its distance to 1; below a speed of 1e-9 the force decides.
    """
    force, slope = polynomial(segment.force, time)
    gap = 1.0 - abs(force)
    if gap > 0.0:
        delay = chatter_time(speed, side * force, restitution)
        if delay <= SLOW and abs(slope) * delay <= 0.01 * gap:
            return 0, delay
    if speed >= SPEED_FLOOR:
        return side, 0.0
    if abs(force) > uplift_level(segment):
        return (1 if force > 0.0 else -1), 0.0
    return 0, 0.0


@kernel(forceinline=True)
def advance(x, v, side, segment, start, end, restitution, cutoff):
    """Carry a block from `start` to `end` of a segment, exactly, through everything that happens to it.

    Parameters
    ----------
    x, v : float
        Angle and velocity at `start`, nondimensional.
    side : int
        +1, -1, or 0 at rest (then x = v = 0).
    segment : Segment
        The forcing; times count from its start.
    start, end : float
        Times since the segment's start.
    restitution, cutoff : float
        Velocity ratio e, and the angle whose first passage is overturning.

    Returns
    -------
    x, v, side, time : float, float, int, float
        The state at `time`, which is `end` unless the block overturned earlier, and then |x| = cutoff.
    """
    t = start
    while t < end:
        if side == 0:
            t, side = uplift_time(segment, t, end)
            x, v = 0.0, 0.0
            continue
        kind, t, x, v = next_event(x, v, side, segment, t, end, cutoff)
        if kind == OVERTURNING:
            return x, v, side, t
        if kind == IMPACT:
            v = impact(v, restitution)
            side, delay = settle(abs(v), -side, segment, t, restitution)
            if side == 0:
                x, v, t = 0.0, 0.0, t + delay
            elif abs(v) < SPEED_FLOOR:
                v = 0.0
    return x, v, side, min(t, end)

