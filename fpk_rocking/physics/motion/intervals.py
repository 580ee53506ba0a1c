"""A slender block through an interval of a grid, fast, for the engine `montecarlo.engines.exact_slender`.

An impact between two grid points is met by Halley's iteration on the flight written as a polynomial, and accepted only
where a bound of the acceleration proves that it is the first event and the only one. Everything else, slow and repeated
impacts, chatter, rest, lift-off, grazing and overturning, goes to `events.advance_through_events`. A flight is
s + P(t) + grow e^t + decay e^-t. Times count from the interval's middle; `grow` and `decay` are passed as they are at
the interval's start and returned as they are at its end.
"""

import math
from typing import NamedTuple

import numpy as np

from fpk_rocking.base.arrays import borrowed
from fpk_rocking.base.checks import Array
from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion import TERMS
from fpk_rocking.physics.motion.equation import segment_from_particular
from fpk_rocking.physics.motion.events import (
    advance_through_events,
    chord_excludes_event,
    curvature_bounds,
    downward_root,
    record_impact,
)
from fpk_rocking.physics.motion.flight import exponential_parts, folded_angle, state_from_exponentials
from fpk_rocking.physics.motion.impact import velocity_after_impact, velocity_jump


class Interval(NamedTuple):
    """One interval: `particular` (TERMS,) is P in the time since its middle; `force`, `folded` (TERMS,) are scratch.

    `exponentials` (2, TERMS): Taylor coefficients of e^t and e^-t. `bend` (TERMS,): k (k-1) half^(k-2) for k > 2.
    `half`: half of the interval's duration; `factor`: its exponential.
    """

    particular: np.ndarray
    force: np.ndarray
    folded: np.ndarray
    exponentials: np.ndarray
    bend: np.ndarray
    half: float
    factor: float


def interval_tables(half: float) -> tuple[Array, Array]:
    """Fields (exponentials, bend) of an `Interval`."""
    order = np.arange(TERMS)
    inverse = np.array([1.0 / math.factorial(k) for k in order])
    bend = np.where(order > 2, order * (order - 1.0) * half ** np.maximum(order - 2.0, 0.0), 0.0)
    return np.stack([inverse, inverse * (-1.0) ** order]), bend


@kernel(fastmath={"contract"}, forceinline=True)
def _fold(interval, grow, decay, sign):
    """Write the coefficients of u = s x to `interval.folded` (TERMS,), from the exponential parts at the middle."""
    particular, folded, exponentials = interval.particular, interval.folded, interval.exponentials
    grow, decay = sign * grow, sign * decay
    for k in range(particular.size):
        folded[k] = sign * particular[k] + (grow * exponentials[0, k] + decay * exponentials[1, k])
    folded[0] += 1.0


@kernel
def _through_events(particular, scratch, half, x, v, side, begin, end, block, impacts, origin):
    """(x, v, side, time) of a block carried from `begin` to `end`, as `advance_through_events` does."""
    segment = borrowed(segment_from_particular(particular, scratch, half))
    return advance_through_events(x, v, side, segment, begin, end, block, impacts, origin)


@kernel
def state_at_begin(particular, half, grow, decay, side):
    """(x, v) at the interval's start; zeros at rest."""
    if side == 0:
        return 0.0, 0.0
    return state_from_exponentials(grow, decay, side, particular, -half)


@kernel(forceinline=True)
def cross_interval(interval, node, grow, decay, folded_begin, folded_end, side, block, impacts, origin):
    """(grow, decay, folded angle, side, time) at the end of an interval in which a slender block may have an event.

    `node` is P at the interval's end. `folded_begin` is the folded angle s x at its start, `folded_end` that at its end
    if nothing happens. `origin` is the time of its middle; `time` is that of overturning within it, or inf. `grow` and
    `decay` are not used at rest.
    """
    half, factor, cutoff = interval.half, interval.factor, block.cutoff
    x, v, begin = 0.0, 0.0, -half
    if side != 0:
        middle_grow, middle_decay = grow * factor, decay / factor
        _fold(interval, middle_grow, middle_decay, float(side))
        fall, rise = curvature_bounds(interval.folded, interval.bend)
        if (
            folded_end > 0.0
            and folded_begin > 0.0
            and chord_excludes_event(folded_begin, folded_end, 4.0 * half * half, rise, fall, cutoff)
        ):
            return middle_grow * factor, middle_decay / factor, folded_end, side, math.inf
        time, slope = downward_root(interval.folded, half) if folded_begin > 0.0 >= folded_end else (0.0, 0.0)
        speed, square = -velocity_after_impact(slope, block.restitution), (time + half) ** 2
        # Slower impacts go to the search for events, which decides about chatter: the limit costs time at most.
        if speed > 1e-4 and folded_begin >= rise * square and folded_begin + 0.25 * fall * square < cutoff:
            v = side * slope
            record_impact(impacts, origin + time, v)
            shift, shrink = 0.5 * velocity_jump(v, block.restitution), math.exp(-time)
            middle_grow += (side + shift) * shrink
            middle_decay += (side - shift) / shrink
            side = -side
            grow, decay = middle_grow * factor, middle_decay / factor
            old, folded_end = folded_end, folded_angle(side, node, grow, decay)
            # Seen from the new side, u'' is that of the old flight turned round, plus the sum of both angles less 2.
            rise, fall = max(1.01 * fall + 0.5 * cutoff - 1.0, 0.0), 1.01 * rise + 1.0 - 0.5 * old
            if folded_end > 0.0 and chord_excludes_event(0.0, folded_end, (half - time) ** 2, rise, fall, cutoff):
                return grow, decay, folded_end, side, math.inf
            v, begin = velocity_after_impact(v, block.restitution), time
        else:
            x, v = state_at_begin(interval.particular, half, grow, decay, side)
    particular = interval.particular
    x, v, side, time = _through_events(
        particular, interval.force, half, x, v, side, begin, half, block, impacts, origin
    )
    if abs(x) >= cutoff:
        return 0.0, 0.0, cutoff, side, origin + time
    if side == 0:
        return 0.0, 0.0, 0.0, 0, math.inf
    grow, decay = exponential_parts(x, v, side, particular, half)
    return grow, decay, side * x, side, math.inf


@kernel(forceinline=True)
def state_in_interval(interval, grow, decay, side, time, block, impacts):
    """(x, v) at a time since the interval's middle, (nan, nan) if overturned by then; see `cross_interval`."""
    x, v = state_at_begin(interval.particular, interval.half, grow, decay, side)
    begin = -interval.half
    x, v, _, _ = _through_events(
        interval.particular, interval.force, interval.half, x, v, side, begin, time, block, impacts, 0.0
    )
    if abs(x) >= block.cutoff:
        return math.nan, math.nan
    return x, v
