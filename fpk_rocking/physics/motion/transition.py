"""The motion of a block through a segment of time: flights joined by impacts, chatter, rest and uplift."""

from typing import NamedTuple

import numpy as np

from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion.contact import chatter_time, impact
from fpk_rocking.physics.motion.equation import stays_below
from fpk_rocking.physics.motion.events import IMPACT, OVERTURNING, SPEED_FLOOR, next_event
from fpk_rocking.physics.motion.polynomial import polynomial, safe_time

SLOW = 1e-6
"""Chatter that ends within this time is summed in closed form; a segment that ends meanwhile sees it over already."""

_FORCE_FLOOR = 1e-12


class Impacts(NamedTuple):
    """Room for the impacts of one block: `count` (1,), `time` and `velocity` (capacity,), the velocity before impact.

    Impacts beyond the capacity are counted and not kept.
    """

    count: np.ndarray  # type: ignore[assignment]  # a field, in place of the method of a tuple
    time: np.ndarray
    velocity: np.ndarray


@kernel(borrows=True)
def record(impacts, time, velocity):
    """Add an impact."""
    place = impacts.count[0]
    if place < impacts.time.size:
        impacts.time[place] = time
        impacts.velocity[place] = velocity
    impacts.count[0] = place + 1


@kernel(borrows=True)
def uplift_time(segment, start, end, block):
    """First time in [start, end] at which a block at rest uplifts, and the side it goes to (0: none).

    |f| must pass its level by more than a margin above the rounding of f: the block then surely leaves, and whoever
    asks again at the same time gets the same answer. The march heads for twice the margin, so its steps cannot dwindle
    to nothing.
    """
    margin = _FORCE_FLOOR * max(1.0, -segment.force_low, segment.force_high)
    level = stays_below(block)
    level, target = level + margin, level + 2.0 * margin
    t = start
    while t < end:
        force, slope = polynomial(segment.force, t)
        if abs(force) > level:
            return t, (1 if force > 0.0 else -1)
        below = safe_time(target + force, slope, segment.force_curvature)
        above = safe_time(target - force, -slope, segment.force_curvature)
        t += min(below, above)
    return end, 0


@kernel(borrows=True)
def settle(speed, side, segment, time, block, slow=SLOW):
    """Decide what follows an impact: flight (side, 0), or after a delay rest (0, delay), which may end at once.

    `speed` is that just after the impact and `side` the side it leads to. Chatter is summed where it ends within `slow`
    under a force that changes by less than a hundredth of its distance to lift-off. Speeds below `SPEED_FLOOR` are
    dropped.
    """
    force, slope = polynomial(segment.force, time)
    gap = stays_below(block) - abs(force)
    if gap > 0.0:
        delay = chatter_time(speed, side * force, block)
        if delay <= slow and abs(slope) * delay <= 0.01 * gap:
            return 0, delay
    return (side if speed >= SPEED_FLOOR else 0), 0.0


@kernel(forceinline=True, borrows=True)  # see next_event
def advance(x, v, side, segment, start, end, block, impacts=None, origin=0.0, slow=SLOW):
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
    block : Body
    impacts : Impacts, optional
        Records the impacts, at times counted from `origin`; those that are summed as chatter are not recorded.
    origin : float
        Time of the segment's start.
    slow : float
        Chatter that ends within this time is summed in closed form.

    Returns
    -------
    x, v, side, time : float, float, int, float
        The state at `time`, which is `end` unless the block overturned earlier, and then |x| = cutoff.
    """
    t = start
    while t < end:
        if side == 0:
            t, side = uplift_time(segment, t, end, block)
            x, v = 0.0, 0.0
            continue
        kind, t, x, v = next_event(x, v, side, segment, t, end, block)
        if kind == OVERTURNING:
            return x, v, side, t
        if kind == IMPACT:
            if impacts is not None and v != 0.0:
                record(impacts, origin + t, v)
            v = impact(v, block.restitution)
            side, delay = settle(abs(v), -side, segment, t, block, slow)
            if side == 0:
                v, t = 0.0, t + delay
    return x, v, side, min(t, end)
