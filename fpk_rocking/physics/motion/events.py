"""The motion of a block through a segment of time: flights joined by impacts, chatter, rest and lift-off.

Events are found in the folded motion u = s x >= 0, w = s v. A bound of u'' over the segment gives a parabola that u
cannot undercut; marching from one parabola's root to the next can approach the first event but never step over it,
grazing included, and converges quadratically. Where a flight has no closed form it goes from one series to the next.
Bounds of the acceleration are all that is used, so it holds for slender and exact blocks. Times count from the start of
the segment.
"""

import enum
import math
from typing import NamedTuple

import numpy as np

from fpk_rocking.base.arrays import scratch
from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion.equation import (
    acceleration_bounds,
    block_at,
    least_closing_time,
    lift_off_level,
    restitution_from,
    value_and_slope,
    weight_of,
)
from fpk_rocking.physics.motion.flight import SERIES, flight_state, outward_time, start_flight
from fpk_rocking.physics.motion.impact import chatter_time, velocity_after_impact

SPEED_FLOOR = 1e-9
"""Slower than this at zero angle, a block that the force presses down is in contact rather than in flight.

Like `CHATTER_TIME` it is compared with gravity and the cut-off, which are about 1 in these units whatever the scene."""
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
    """Room for the impacts of one block: `count` (1,), `time` and `velocity`, that before impact, (capacity,).

    Impacts beyond the capacity are counted and not kept.
    """

    count: np.ndarray  # type: ignore[assignment]  # a field, in place of the method of a tuple
    time: np.ndarray
    velocity: np.ndarray


@kernel
def record_impact(impacts, time, velocity):
    place = impacts.count[0]
    if place < impacts.time.size:
        impacts.time[place] = time
        impacts.velocity[place] = velocity
    impacts.count[0] = place + 1


# Inlined by force: a call would count references to the segment's arrays, which costs as much as the flight itself.
@kernel(forceinline=True)
def next_event(x, v, side, segment, start, end, block):
    """(event, time, x, v): first impact or overturning of a flight from (x, v) at `start`, or NONE at `end`.

    At an impact x is 0 and v still the velocity before it (0 for a block in contact, slower than `SPEED_FLOOR`).
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
    """Whether a force from `low` to `high` may lift off a block at rest."""
    least = 1.0 - weight_of(block).sway
    return high >= least * lift_off_level(1, block) or -low >= least * lift_off_level(-1, block)


@kernel
def chord_clearance(side, low, high, span, block):
    """How far, at most, u goes below and above the chord between a flight's ends: bounds of |u''| times span² / 8."""
    fall, rise = acceleration_bounds(side, low, high, block)
    sag = 0.125 * span * span
    return sag * max(rise, 0.0), sag * max(fall, 0.0)


@kernel
def surely_eventless(u, end, side, low, high, span, block, margin=0.0):
    """Whether a flight with u at its ends surely keeps the distance `margin` from x = 0 and from the cut-off."""
    below, above = chord_clearance(side, low, high, span, block)
    return min(u, end) - below > margin and max(u, end) + above < block.cutoff - margin


@kernel(inline="always")
def folded_angle_bounds(u, w, side, low, high, span, block):
    """Bounds (least, greatest) of u after a time `span` of a flight without event."""
    fall, rise = acceleration_bounds(side, low, high, block)
    half, straight = 0.5 * span * span, u + span * w
    return straight - half * max(fall, 0.0), straight + half * max(rise, 0.0)


@kernel
def lift_off_time(segment, start, end, block):
    """(time, side) at which a block at rest lifts off in [start, end]; else (end, 0).

    |f| must pass its level, times the weight, by more than a margin, a thousand times the rounding of f: the block then
    surely leaves, and whoever asks again at the same time gets the same answer. The march heads for twice the margin,
    so its steps cannot dwindle to nothing.
    """
    margin = 1e-12 * max(1.0, -segment.force_low, segment.force_high)
    left, right = lift_off_level(-1, block), lift_off_level(1, block)
    t = start
    while t < end:
        force, slope = value_and_slope(segment.force, t)
        weight = weight_of(block_at(t, block))
        if force > weight.start * right + margin or -force > weight.start * left + margin:
            return t, (1 if force > 0.0 else -1)
        below, above = weight.start * left + 2.0 * margin + force, weight.start * right + 2.0 * margin - force
        below = least_closing_time(below, slope + weight.slope * left, segment.force_curvature)
        above = least_closing_time(above, weight.slope * right - slope, segment.force_curvature)
        t += min(below, above)
    return end, 0


@kernel
def rest_or_flight(speed, side, segment, time, block, slow=CHATTER_TIME):
    """(side, 0.0) for flight or (0, delay) for rest after an impact that leads to `side` at a `speed`.

    Chatter is summed, as a delay, where it ends within the time `slow` under a force that changes by less than a
    hundredth of its distance to lift-off. Speeds below `SPEED_FLOOR` are dropped: (0, 0.0). Rest may end at once.
    """
    (force, slope), block = value_and_slope(segment.force, time), block_at(time, block)
    weight = weight_of(block)
    gap = min(weight.start * lift_off_level(1, block) - force, weight.start * lift_off_level(-1, block) + force)
    if gap > 0.0:
        delay = chatter_time(speed, side, force, block)
        if delay <= slow and (abs(slope) + abs(weight.slope)) * delay <= 0.01 * gap:
            return 0, delay
    return (side if speed >= SPEED_FLOOR else 0), 0.0


@kernel(forceinline=True)  # see next_event
def advance_through_events(x, v, side, segment, start, end, block, impacts=None, origin=0.0, slow=CHATTER_TIME):
    """(x, v, side, time) of a block carried from `start` to `end` of a segment through everything that happens to it.

    The side is 0 at rest (then x = v = 0); `time` is `end` unless the block overturned earlier, and then |x| = cutoff.
    `impacts`, an `ImpactRecord` or None, gets times counted from -`origin`, and no chatter; chatter that ends within
    the time `slow` is summed in closed form.
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
    """(fall, rise), at least 0: half of the bounds of -u'' and of u'' over an interval, for a polynomial u (TERMS,).

    Its time counts from the middle; `bend` (TERMS,) is k (k - 1) half^(k - 2) for k > 2, else 0.
    """
    spread = 0.0
    for k in range(folded.size):
        spread += bend[k] * abs(folded[k])
    return max(0.5 * spread - folded[2], 0.0), max(0.5 * spread + folded[2], 0.0)


@kernel(fastmath={"contract"}, forceinline=True)
def downward_root(q, half):
    """(time, slope) in [-half, half] at which a polynomial (TERMS,) falls through zero; (0.0, 0.0) if none is found."""
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

    `square` is its duration squared, `rise` and `fall` are half of the bounds of u'' and -u''.
    """
    higher, lower = max(u, end), min(u, end)
    return (higher >= rise * square or lower >= 0.25 * rise * square) and higher + 0.25 * fall * square < cutoff
