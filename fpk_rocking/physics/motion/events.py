"""The motion of a block through a segment of time: flights joined by impacts, chatter, rest and lift-off.

Events are found in the folded motion u = s x >= 0, w = s v. A bound of u'' over the segment gives a parabola that u
cannot undercut; marching from one parabola's root to the next can approach the first event but never step over it,
grazing included, and converges quadratically. Where a flight has no closed form it goes from one series to the next.
Bounds of the acceleration are all that is used, so it holds for slender and exact blocks.
"""

import enum
import math
from typing import NamedTuple

import numpy as np

from fpk_rocking.base.arrays import scratch
from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion.equation import (
    acceleration_bounds,
    least_closing_time,
    lift_off_level,
    restitution_from,
    value_and_slope,
)
from fpk_rocking.physics.motion.flight import SERIES, flight_state, outward_time, start_flight
from fpk_rocking.physics.motion.impact import chatter_time, velocity_after_impact

SPEED_FLOOR = 1e-9
"""Slower than this at zero angle, a block that the force presses down is in contact rather than in flight."""
CHATTER_TIME = 1e-6
"""Chatter that ends within it is summed in closed form; a segment that ends meanwhile sees it over already."""


class Event(enum.IntEnum):
    """What ends a flight: the segment's end (NONE), an impact, the cut-off angle, or what no bound decides."""

    UNKNOWN = -1
    NONE = 0
    IMPACT = 1
    OVERTURNING = 2


_series = scratch(*SERIES)


class ImpactRecord(NamedTuple):
    """Room for the impacts of one block: `count` (1,), `time` and `velocity` (capacity,), nondimensional.

    `velocity` is that before impact. Impacts beyond the capacity are counted and not kept.
    """

    count: np.ndarray  # type: ignore[assignment]  # a field, in place of the method of a tuple
    time: np.ndarray
    velocity: np.ndarray


@kernel
def record_impact(impacts, time, velocity):
    """Write `time` and `velocity`, just before an impact, to the arrays of `impacts`, an `ImpactRecord`, and count it.

    Both are nondimensional. An impact beyond the record's capacity is only counted.
    """
    place = impacts.count[0]
    if place < impacts.time.size:
        impacts.time[place] = time
        impacts.velocity[place] = velocity
    impacts.count[0] = place + 1


# Inlined by force: a call would count references to the segment's arrays, which costs as much as the flight itself.
@kernel(forceinline=True)
def next_event(x, v, side, segment, start, end, block):
    """First impact or overturning of a flight, or the segment's end.

    Parameters
    ----------
    x, v : float
        Angle (side * x >= 0) and velocity at `start`, nondimensional.
    side : int
        +1 or -1.
    segment : Segment
        The forcing, as polynomials in the time since the segment's start.
    start, end : float
        Times since the segment's start, nondimensional.
    block : KernelBlock

    Returns
    -------
    event, time, x, v : Event, float, float, float
        NONE, IMPACT or OVERTURNING, and the state at that time; at an impact x is 0 and v still the velocity before it
        (0 for a block in contact, slower than `SPEED_FLOOR`).
    """
    cutoff, work = block.cutoff, _series()
    touch = 2e-15  # distance that counts as contact: ten times the rounding of an angle
    t, u, w = start, side * x, side * v
    while t < end:
        flight = start_flight(side * u, side * w, side, segment, t, end, work, block)
        while t < flight.end:
            if u >= cutoff - touch and w > 0.0:
                return Event.OVERTURNING, t, side * cutoff, side * w
            stay = least_closing_time(max(cutoff - u, 0.0), -w, flight.rise)
            if w < 0.0 and u <= touch:
                return Event.IMPACT, t, 0.0, side * w
            fly = least_closing_time(max(u, 0.0), w, flight.fall)
            if w >= 0.0 and fly < flight.end - t:
                rising = outward_time(flight, u, side, segment, t, work, block)
                if rising >= 0.0:
                    fly += rising
                elif u <= touch and w < SPEED_FLOOR:
                    return Event.IMPACT, t, 0.0, 0.0
            t_next = t + min(fly, stay)
            if not t_next > t:
                if stay < fly:
                    return Event.OVERTURNING, t, side * cutoff, side * w
                return Event.IMPACT, t, 0.0, side * w
            t = min(t_next, flight.end)
            x, v = flight_state(flight, side, segment, t, work, block)
            u, w = side * x, side * v
    return Event.NONE, end, side * u, side * w


@kernel(inline="always")
def can_lift_off(low, high, block):
    """Whether a force f, from `low` to `high`, nondimensional, may lift off a `KernelBlock` at rest: a bool."""
    return high >= lift_off_level(1, block) or -low >= lift_off_level(-1, block)


@kernel
def chord_clearance(side, low, high, span, block):
    """How far, at most, a flight's folded angle u = s x goes below and above the chord between its ends: two floats.

    They are bounds of |u''| times span² / 8. `side` is s, +1 or -1, `low` and `high` bound f over the flight, `span` is
    its duration, all nondimensional, and `block` a `KernelBlock`.
    """
    fall, rise = acceleration_bounds(side, low, high, block)
    sag = 0.125 * span * span
    return sag * max(rise, 0.0), sag * max(fall, 0.0)


@kernel
def surely_eventless(u, end, side, low, high, span, block, margin=0.0):
    """Whether a flight surely keeps the distance `margin` from x = 0 and from the cut-off: a bool.

    `u` and `end` are the folded angles s x at its ends, `side` is s, +1 or -1, `low` and `high` bound f, `span` is its
    duration, all nondimensional, and `block` a `KernelBlock`.
    """
    below, above = chord_clearance(side, low, high, span, block)
    return min(u, end) - below > margin and max(u, end) + above < block.cutoff - margin


@kernel(inline="always")
def folded_angle_bounds(u, w, side, low, high, span, block):
    """Bounds (least, greatest), two floats, of the folded angle u = s x after a time `span` of a flight without event.

    `u`, `w` are s x and s v at its begin, `side` is s, +1 or -1, `low` and `high` bound f, all nondimensional, and
    `block` is a `KernelBlock`.
    """
    fall, rise = acceleration_bounds(side, low, high, block)
    half, straight = 0.5 * span * span, u + span * w
    return straight - half * max(fall, 0.0), straight + half * max(rise, 0.0)


@kernel
def lift_off_time(segment, start, end, block):
    """Return (time, side): when in [start, end] a block at rest lifts off, and to which side, ±1; else (end, 0).

    Times are nondimensional and count from the start of `segment`, a `Segment` of the forcing; `block` is a
    `KernelBlock`. |f| must pass its level by more than a margin, a thousand times the rounding of f: the block then
    surely leaves, and whoever asks again at the same time gets the same answer. The march heads for twice the margin,
    so its steps cannot dwindle to nothing.
    """
    margin = 1e-12 * max(1.0, -segment.force_low, segment.force_high)
    left, right = lift_off_level(-1, block), lift_off_level(1, block)
    t = start
    while t < end:
        force, slope = value_and_slope(segment.force, t)
        if force > right + margin or -force > left + margin:
            return t, (1 if force > 0.0 else -1)
        below = least_closing_time(left + 2.0 * margin + force, slope, segment.force_curvature)
        above = least_closing_time(right + 2.0 * margin - force, -slope, segment.force_curvature)
        t += min(below, above)
    return end, 0


@kernel
def rest_or_flight(speed, side, segment, time, block, slow=CHATTER_TIME):
    """Return (side, delay) of what follows an impact: (side, 0.0) for flight, (0, delay) for rest after a time `delay`.

    Rest may end at once. `speed` is |v| just after the impact, `side` (1 or -1) the side it leads to, `time` that of
    the impact since the start of `segment`, a `Segment`, all nondimensional, and `block` a `KernelBlock`. Chatter is
    summed, as a delay, where it ends within the time `slow` under a force that changes by less than a hundredth of its
    distance to lift-off. Speeds below `SPEED_FLOOR` are dropped: (0, 0.0).
    """
    force, slope = value_and_slope(segment.force, time)
    gap = min(lift_off_level(1, block) - force, lift_off_level(-1, block) + force)
    if gap > 0.0:
        delay = chatter_time(speed, side, force, block)
        if delay <= slow and abs(slope) * delay <= 0.01 * gap:
            return 0, delay
    return (side if speed >= SPEED_FLOOR else 0), 0.0


@kernel(forceinline=True)  # see next_event
def advance_through_events(x, v, side, segment, start, end, block, impacts=None, origin=0.0, slow=CHATTER_TIME):
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
        Nondimensional times since the segment's start.
    block : KernelBlock
    impacts : ImpactRecord, optional
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
            t, side = lift_off_time(segment, t, end, block)
            x, v = 0.0, 0.0
            continue
        event, t, x, v = next_event(x, v, side, segment, t, end, block)
        if event == Event.OVERTURNING:
            return x, v, side, t
        if event == Event.IMPACT:
            if impacts is not None and v != 0.0:
                record_impact(impacts, origin + t, v)
            v = velocity_after_impact(v, restitution_from(side, block))
            side, delay = rest_or_flight(abs(v), -side, segment, t, block, slow)
            if side == 0:
                v, t = 0.0, t + delay
    return x, v, side, min(t, end)


@kernel(fastmath={"contract", "reassoc"}, forceinline=True)
def curvature_bounds(folded, bend):
    """Return (fall, rise), at least 0: half of the bounds of -u'' and of u'' over an interval, for a polynomial u.

    `folded` (TERMS,) are the coefficients of u, lowest power first, in the time since the middle, and `bend` (TERMS,)
    is, for k > 2, k (k - 1) times the half of the interval's duration to the power k - 2, else 0. All are
    nondimensional.
    """
    spread = 0.0
    for k in range(folded.size):
        spread += bend[k] * abs(folded[k])
    return max(0.5 * spread - folded[2], 0.0), max(0.5 * spread + folded[2], 0.0)


@kernel(fastmath={"contract"}, forceinline=True)
def downward_root(q, half):
    """Return (t, slope): a time in [-half, half] at which a polynomial falls through zero, and its slope there.

    (0.0, 0.0) says that none is found. `q` (TERMS,) are its coefficients, lowest power first.
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
    """Whether a flight surely has no event between its ends, a bool: the parabolas over its chord tell.

    `u` and `end` are the folded angles s x at its ends, `square` is its duration squared, `rise` and `fall` are half of
    the bounds of u'' and -u'', and `cutoff` is the angle of overturning; all are nondimensional.
    """
    higher, lower = max(u, end), min(u, end)
    return (higher >= rise * square or lower >= 0.25 * rise * square) and higher + 0.25 * fall * square < cutoff
