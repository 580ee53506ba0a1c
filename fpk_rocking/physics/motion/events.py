"""The first impact or overturning in a flight.

Events are found in the folded motion u = s x >= 0, w = s v. A bound of u'' over the segment gives a parabola that u
cannot undercut; marching from one parabola's root to the next can approach the first event but never step over it,
grazing included, and converges quadratically. Where a flight has no closed form it goes from one series to the next.
"""

from fpk_rocking.base.jit import kernel
from fpk_rocking.base.stack import scratch
from fpk_rocking.physics.motion.equation import WORK, later, launch, pulls, rising_time, stays_below
from fpk_rocking.physics.motion.polynomial import safe_time

NOTHING, IMPACT, OVERTURNING = 0, 1, 2
"""What ends a flight: the segment's end, an impact, the cut-off angle."""

SPEED_FLOOR = 1e-9
"""Slower than this at zero angle, a block that the force presses down is in contact rather than in flight."""

_TOUCH = 2e-15

_work = scratch(*WORK)


# Inlined by force: a call would count references to the segment's arrays, which costs as much as the flight itself.
@kernel(forceinline=True, borrows=True)
def next_event(x, v, side, segment, start, end, block):
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
    block : Body

    Returns
    -------
    kind, time, x, v : int, float, float, float
        NOTHING, IMPACT or OVERTURNING, and the state there; at an impact x is 0 and v still the velocity before it
        (0 for a block in contact, see `SPEED_FLOOR`).
    """
    cutoff, work = block.cutoff, _work()
    t, u, w = start, side * x, side * v
    while t < end:
        course = launch(side * u, side * w, side, segment, t, end, work, block)
        while t < course.end:
            if u >= cutoff - _TOUCH and w > 0.0:
                return OVERTURNING, t, side * cutoff, side * w
            stay = safe_time(max(cutoff - u, 0.0), -w, course.rise)
            if w < 0.0 and u <= _TOUCH:
                return IMPACT, t, 0.0, side * w
            fly = safe_time(max(u, 0.0), w, course.fall)
            if w >= 0.0 and fly < course.end - t:
                rising = rising_time(course, u, side, segment, t, work, block)
                if rising >= 0.0:
                    fly += rising
                elif u <= _TOUCH and w < SPEED_FLOOR:
                    return IMPACT, t, 0.0, 0.0
            t_next = t + min(fly, stay)
            if not t_next > t:
                if stay < fly:
                    return OVERTURNING, t, side * cutoff, side * w
                return IMPACT, t, 0.0, side * w
            t = min(t_next, course.end)
            x, v = later(course, side, segment, t, work, block)
            u, w = side * x, side * v
    return NOTHING, end, side * u, side * w


@kernel(inline="always")
def can_lift_off(low, high, block):
    """Whether a force between two bounds may lift a block off that is at rest."""
    return max(high, -low) >= stays_below(block)


@kernel
def clearance(side, low, high, span, block):
    """How far a flight may leave the chord between its ends below and above it: |u''| span^2 / 8 within bounds of f."""
    fall, rise = pulls(side, low, high, block)
    sag = 0.125 * span * span
    return sag * max(rise, 0.0), sag * max(fall, 0.0)


@kernel
def is_eventless(u, end, side, low, high, span, block, margin=0.0):
    """Whether a flight between two folded angles surely keeps a distance from x = 0 and from the cut-off."""
    below, above = clearance(side, low, high, span, block)
    return min(u, end) - below > margin and max(u, end) + above < block.cutoff - margin


@kernel(inline="always")
def reach(u, w, side, low, high, span, block):
    """Least and greatest folded angle at the end of a time, from that at its begin, of a flight that meets no event."""
    fall, rise = pulls(side, low, high, block)
    half, straight = 0.5 * span * span, u + span * w
    return straight - half * max(fall, 0.0), straight + half * max(rise, 0.0)
