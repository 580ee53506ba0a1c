"""Steps of a white-noise path near the barriers, x = 0 and the cut-off: as long as is safe, and across an impact.

Folded, nondimensional coordinates as in `montecarlo.engines.white`, whose `Problem` these kernels read.
"""

import math

from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion.equation import acceleration, acceleration_bounds, block_of, dispatch_on_block
from fpk_rocking.physics.motion.events import record_impact
from fpk_rocking.physics.motion.flight import covariance_factor, slender_flight_end
from fpk_rocking.physics.motion.impact import velocity_after_impact
from fpk_rocking.physics.motion.segment import least_closing_time, value_and_slope
from montecarlo.engines.random import normal
from montecarlo.engines.steps import nystrom

FAST = 1e-3
"""A block arrives at a barrier after t at speed w, all but certainly and nearly on time, if 2 D t < FAST w^2."""

_BRIEF = 0.02
"""Longest flight that is drawn as one step to its arrival at a barrier."""


@kernel
def safe_step(gap, slope, bend, reach, limit, shortest):
    """Longest step, up to `limit`, in which a gap stays open.

    It is open while gap + slope h + bend h^2 / 2 - reach h^1.5 > 0. With bend <= 0 that is concave in h, so Newton's
    iteration comes down on the root from above; it stops once nine tenths of `reach` are kept, or below `shortest`.
    """
    h = limit
    root = math.sqrt(h)
    value = gap + h * (slope + 0.5 * bend * h - reach * root)
    if value >= 0.0:
        return limit
    if slope < 0.0 and -gap / slope < h:
        h = -gap / slope
    while h > shortest:
        root = math.sqrt(h)
        noise = reach * root
        value = gap + h * (slope + 0.5 * bend * h - noise)
        if value >= -0.1 * h * noise:
            return h
        less = h - value / (slope + bend * h - 1.5 * noise)
        if not less < h:  # to rounding at the root, where no noise leaves anything to keep
            return h
        h = less
    return h


@kernel(borrows=True)
def land(u, w, side, segment, start, end, latest, problem, impacts, origin):
    """Say where a draw that ended beyond x = 0, or was meant to end there, has led: through an impact if one is found.

    The impact lies on the parabola through the drawn state. Where that has none within the step, the motion since the
    impact is the drawn one scaled by the restitution. The impact is recorded, unless `impacts` is None. `latest` is the
    latest time for it: `end`, or that of a step that was to end with it.
    """
    restitution = problem.restitution
    pull = acceleration(u, side, value_and_slope(segment.force, end)[0], block_of(problem))
    square = w * w - 2.0 * pull * u
    if w < 0.0 and square >= 0.0:
        speed = math.sqrt(square)
        time = end + 2.0 * u / (speed - w)
        if start <= time <= latest:
            if impacts is not None:
                record_impact(impacts, origin + time, -side * speed)
            return 0.0, velocity_after_impact(speed, restitution), -side, time
    if u < 0.0:
        if impacts is not None:
            record_impact(impacts, origin + end, -side * abs(w))
        return -velocity_after_impact(u, restitution), -velocity_after_impact(w, restitution), -side, end
    return u, w, side, end


@kernel(inline="always")
def _slender_mean(x, v, side, segment, start, end, block):
    x, v = slender_flight_end(x, v, side, segment, start, end, block)
    return x, v, 1.0


@kernel(inline="always")
def _exact_mean(x, v, side, segment, start, end, block):
    begin, middle = value_and_slope(segment.force, start)[0], value_and_slope(segment.force, 0.5 * (start + end))[0]
    last = value_and_slope(segment.force, end)[0]
    u, w, strength = nystrom(side * x, side * v, side, begin, middle, last, end - start, block)
    return side * u, side * w, strength


_mean = dispatch_on_block(_slender_mean, _exact_mean)
"""Angle and velocity after a step without noise, and the factor by which the noise enters in it."""


@kernel(forceinline=True, borrows=True)  # see events.next_event
def near(stream, u, w, side, segment, j, start, limit, problem, impacts, origin):
    """Take one step near a barrier in interval j, up to a time; return u, w, side and the time reached.

    u >= cutoff means overturned.
    """
    cutoff, left, diffusion, reach = problem.cutoff, limit - start, problem.diffusion[j], problem.reach[j]
    fall, rise = acceleration_bounds(side, segment.force_low, segment.force_high, block_of(problem))
    down = safe_step(u, w, min(0.0, -fall), reach, left, problem.shortest)
    up = safe_step(cutoff - u, -w, min(0.0, -rise), reach, left, problem.shortest)
    duration, arrives = min(down, up), False
    if duration < left:
        duration = min(max(duration, problem.shortest), left)
        pull = acceleration(u, side, value_and_slope(segment.force, start)[0], block_of(problem))
        falls = down <= up
        needed = least_closing_time(u, w, -pull) if falls else least_closing_time(cutoff - u, -w, pull)
        towards = w < 0.0 if falls else w > 0.0
        if towards and 0.0 < needed < min(left, _BRIEF) and 2.0 * diffusion * needed < FAST * w * w:
            if not falls:
                return cutoff, w, side, start + needed
            duration, arrives = needed, True
    end = limit if duration == left else start + duration
    x, v, strength = _mean(side * u, side * w, side, segment, start, end, block_of(problem))
    xx, vx, vv = covariance_factor(diffusion * strength * strength, end - start)
    first, second = normal(stream), normal(stream)
    u, w = side * (x + xx * first), side * (v + vx * first + vv * second)
    if u < 0.0 or arrives:
        return land(u, w, side, segment, start, end, limit if arrives else end, problem, impacts, origin)
    return u, w, side, end
