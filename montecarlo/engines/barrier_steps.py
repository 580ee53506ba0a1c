"""Steps of a white-noise path near the barriers, x = 0 and the cut-off: as long as is safe, and across an impact.

Folded, nondimensional coordinates as in `montecarlo.engines.white`, whose `Parameters` these kernels read.
"""

import math

from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion.equation import (
    acceleration,
    acceleration_bounds,
    dispatch_on_block,
    force_factor,
    restitution_from,
)
from fpk_rocking.physics.motion.events import record_impact
from fpk_rocking.physics.motion.flight import covariance_factor, slender_flight_end
from fpk_rocking.physics.motion.impact import velocity_after_impact
from fpk_rocking.physics.motion.segment import least_closing_time, value_and_slope
from montecarlo.engines.random import normal
from montecarlo.tuning import TUNING


@kernel
def safe_step(gap, slope, bend, reach, limit, shortest):
    """Longest step h, up to `limit`, in which a gap between folded angle and barrier stays open; nondimensional.

    It is open while gap + slope h + bend h^2 / 2 - reach h^1.5 > 0, where the last term is what noise may close. With
    bend <= 0 that is concave in h, so Newton's iteration comes down on the root from above; it stops once nine tenths
    of `reach` are kept, or below `shortest`.
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


@kernel
def reflect_draw(u, w, side, segment, start, end, latest, parameters, impacts, origin):
    """Return u, w, side and the time of a draw (u, w) at `end` that lies beyond x = 0, or was meant to end there.

    They are those right after the impact, if there is one. It lies on the parabola through the drawn state; where that
    has none within the step from `start`, the motion since the impact is the drawn one scaled by the restitution. Times
    count from the begin of the `Segment`, at `origin` since τ = 0; `latest` is the latest for an impact: `end`, or that
    of a step that was to end with it. `impacts` records it, unless None. `parameters`: those of the engine `white`.
    """
    restitution = restitution_from(side, parameters.block)
    pull = acceleration(u, side, value_and_slope(segment.force, end)[0], parameters.block)
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
def nystrom_step(u, w, side, begin, middle, end, h, block):
    """Folded angle and velocity after a step h of Nyström's method of order 4, and κ cos φ halfway.

    (u, w) is before it; `begin`, `middle`, `end` are the force at these times, nondimensional. κ cos φ is the factor of
    the noise. The method is that for forces which do not depend on the velocity.
    """
    first = acceleration(u, side, begin, block)
    halfway = u + 0.5 * h * (w + 0.25 * h * first)
    second = acceleration(halfway, side, middle, block)
    third = acceleration(u + h * (w + 0.5 * h * second), side, end, block)
    u, w = u + h * (w + h * (first + 2.0 * second) / 6.0), w + h * (first + 4.0 * second + third) / 6.0
    return u, w, force_factor(halfway, side, block)


@kernel(inline="always")
def _slender_mean(x, v, side, segment, start, end, block):
    """Angle and velocity of a slender block at `end` of a step without noise, and the noise's factor in it: 1.

    (x, v) is at `start`; both times count from the begin of the `Segment`.
    """
    x, v = slender_flight_end(x, v, side, segment, start, end, block)
    return x, v, 1.0


@kernel(inline="always")
def _exact_mean(x, v, side, segment, start, end, block):
    """Angle and velocity of an exact block at `end` of a step without noise, and the noise's factor cos φ in it.

    (x, v) is at `start`; both times count from the begin of the `Segment`.
    """
    begin, middle = value_and_slope(segment.force, start)[0], value_and_slope(segment.force, 0.5 * (start + end))[0]
    last = value_and_slope(segment.force, end)[0]
    u, w, strength = nystrom_step(side * x, side * v, side, begin, middle, last, end - start, block)
    return side * u, side * w, strength


_mean = dispatch_on_block(_slender_mean, _exact_mean)


@kernel(forceinline=True)  # see events.next_event
def step_near_barrier(stream, u, w, side, segment, j, start, limit, parameters, impacts, origin):
    """Take one step near a barrier in interval j, from `start` up to `limit`; return u, w, side, time reached.

    u >= cutoff means overturned. Times count from the begin of the interval, whose `Segment` is the forcing's and which
    is at `origin` since τ = 0; `impacts` is an `ImpactRecord` or None. `stream` (4,) gives the random numbers;
    `parameters`: those of the engine `white`.
    """
    block, left, diffusion, reach = parameters.block, limit - start, parameters.diffusion[j], parameters.reach[j]
    cutoff = block.cutoff
    fall, rise = acceleration_bounds(side, segment.force_low, segment.force_high, block)
    down = safe_step(u, w, min(0.0, -fall), reach, left, parameters.shortest)
    up = safe_step(cutoff - u, -w, min(0.0, -rise), reach, left, parameters.shortest)
    duration, arrives = min(down, up), False
    if duration < left:
        duration = min(max(duration, parameters.shortest), left)
        pull = acceleration(u, side, value_and_slope(segment.force, start)[0], block)
        falls = down <= up
        needed = least_closing_time(u, w, -pull) if falls else least_closing_time(cutoff - u, -w, pull)
        towards = w < 0.0 if falls else w > 0.0
        soon = 0.0 < needed < min(left, TUNING.longest_arrival)
        if towards and soon and 2.0 * diffusion * needed < TUNING.sure_arrival * w * w:
            if not falls:
                return cutoff, w, side, start + needed
            duration, arrives = needed, True
    end = limit if duration == left else start + duration
    x, v, strength = _mean(side * u, side * w, side, segment, start, end, block)
    xx, vx, vv = covariance_factor(diffusion * strength * strength, end - start)
    first, second = normal(stream), normal(stream)
    u, w = side * (x + xx * first), side * (v + vx * first + vv * second)
    if u < 0.0 or arrives:
        return reflect_draw(u, w, side, segment, start, end, limit if arrives else end, parameters, impacts, origin)
    return u, w, side, end
