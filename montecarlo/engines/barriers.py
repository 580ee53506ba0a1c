"""A white-noise path near the barriers, x = 0 and the cut-off: steps as long as is safe, impacts, and low bounces.

Folded, nondimensional coordinates u = s x, w = s v as in `montecarlo.engines.white`, whose parameters these kernels
read. Times count from the beginning of an interval, at `origin` since τ = 0; overturned, u is at or above the cut-off.

A block that rattles, or is pressed back where it landed, makes low bounces: each is one draw.
From an impact that it leaves at speed w, under a pull g + a t back to x = 0, the block returns after T at speed v with
the density

    sqrt(3) v / (2 pi D T^2) exp(-(v + w - G)^2 / (4 D T) - 3 (v - w - a T^2 / 6)^2 / (4 D T)) erf sqrt(3 w v / (D T)),

G = g T + a T^2 / 2: McKean's law of the first return of an integrated Brownian motion, which a pull linear in time
changes by a factor of T and v alone (H. P. McKean, J. Math. Kyoto Univ. 2, 227-235, 1963; docs/theory, section 8).
`first_return` draws from it without error.
"""

import math

from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion.equation import (
    acceleration,
    acceleration_bounds,
    acceleration_gradient,
    dispatch_on_block,
    force_factor,
    least_closing_time,
    restitution_from,
    value_and_slope,
)
from fpk_rocking.physics.motion.events import record_impact
from fpk_rocking.physics.motion.flight import covariance_factor, slender_flight_end
from fpk_rocking.physics.motion.impact import velocity_after_impact
from montecarlo.engines.random import normal, uniform
from montecarlo.tuning import TUNING


@kernel
def safe_step(gap, slope, bend, reach, limit, shortest):
    """Return the longest step h, up to `limit`, with gap + slope h + bend h^2 / 2 > reach h^1.5, the noise's share."""
    # With bend <= 0 the difference is concave in h, and Newton's iteration comes down on the root from above. It stops
    # once nine tenths of `reach` are kept, or below `shortest`.
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
    """Return (u, w, side, time) after the impact of a block drawn at (u, w) for `end`; without one as they are."""
    # The impact lies on the parabola through the drawn state. Where that has none from `start` to `latest`, the motion
    # since the impact is the drawn one scaled by the restitution.
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
    """Return (u, w) after a step of Nyström's method of order 4, and κ cos φ halfway, the factor of the noise."""
    first = acceleration(u, side, begin, block)
    halfway = u + 0.5 * h * (w + 0.25 * h * first)
    second = acceleration(halfway, side, middle, block)
    third = acceleration(u + h * (w + 0.5 * h * second), side, end, block)
    u, w = u + h * (w + h * (first + 2.0 * second) / 6.0), w + h * (first + 4.0 * second + third) / 6.0
    return u, w, force_factor(halfway, side, block)


@kernel(inline="always")
def _slender_mean(x, v, side, segment, start, end, block):
    x, v = slender_flight_end(x, v, side, segment, start, end, block)
    return x, v, 1.0


@kernel(inline="always")
def _exact_mean(x, v, side, segment, start, end, block):
    """Return (x, v, κ cos φ) at `end` of a step without noise; the factor of the noise is 1 for a slender block."""
    begin, middle = value_and_slope(segment.force, start)[0], value_and_slope(segment.force, 0.5 * (start + end))[0]
    last = value_and_slope(segment.force, end)[0]
    u, w, strength = nystrom_step(side * x, side * v, side, begin, middle, last, end - start, block)
    return side * u, side * w, strength


_mean = dispatch_on_block(_slender_mean, _exact_mean)


@kernel(forceinline=True)  # see events.next_event
def step_near_barrier(stream, u, w, side, segment, j, start, limit, parameters, impacts, origin):
    """Take one step near a barrier in interval j, from `start` up to `limit`; return (u, w, side, time reached)."""
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


@kernel
def leave_rest(stream, segment, j, start, limit, parameters, impacts, origin):
    """Take the shortest step from rest, to the side of the larger angle; return (u, w, side, time reached)."""
    # In it noise may beat the force. To one side alone it would begin with an impact on the way to the other, which
    # takes energy: the sides would be off in proportion to a low power of the step.
    end = min(start + parameters.shortest, limit)
    side = 1 if value_and_slope(segment.force, start)[0] > 0.0 else -1
    first, second = normal(stream), normal(stream)
    u, w = _draw_from_rest(side, first, second, segment, j, start, end, parameters)
    other = _draw_from_rest(-side, first, second, segment, j, start, end, parameters)
    if other[0] > u:
        (u, w), side = other, -side
    if u < 0.0:
        return reflect_draw(u, w, side, segment, start, end, end, parameters, impacts, origin)
    return u, w, side, end


@kernel
def _draw_from_rest(side, first, second, segment, j, start, end, parameters):
    """Return (u, w) at `end` of a flight on a `side` from rest, by two normal numbers."""
    x, v, strength = _mean(0.0, 0.0, side, segment, start, end, parameters.block)
    xx, vx, vv = covariance_factor(parameters.diffusion[j] * strength * strength, end - start)
    return side * (x + xx * first), side * (v + vx * first + vv * second)


@kernel
def _mean_negative_part(ratio):
    """Return the mean of max(-y, 0) for a normal number y of mean 1 and standard deviation 1/`ratio`."""
    return math.exp(-0.5 * ratio * ratio) / (math.sqrt(2.0 * math.pi) * ratio) - 0.5 * math.erfc(ratio * math.sqrt(0.5))


@kernel
def _draw_beyond(stream, ratio):
    """Draw y > 0 with the density y exp(-(y + ratio)^2 / 2), up to its factor, for a ratio >= 0."""
    while True:
        if ratio < 1.0:
            y = math.sqrt(-2.0 * math.log(1.0 - uniform(stream)))
            kept = math.exp(-ratio * y)
        else:
            y = -math.log((1.0 - uniform(stream)) * (1.0 - uniform(stream))) / ratio
            kept = math.exp(-0.5 * y * y)
        if uniform(stream) < kept:
            return y


@kernel
def first_return(stream, speed, pull, growth, diffusion, least):
    """Draw time and speed of the return to x = 0 under a pull + growth t; (inf, 0) if the pull ends before."""
    # `least` bounds the mean of the arrival speed at a known time, over its standard deviation, from below for all
    # times; with growth >= 0 it is the root of `speed` in units of D/pull.
    width, most = math.sqrt(8.0 / 3.0) * math.sqrt(diffusion), _mean_negative_part(least) if least < 8.0 else 0.0
    while True:
        pick, noise = (1.0 + most) * uniform(stream), width * normal(stream)
        disc = math.sqrt(noise * noise + 8.0 * pull * speed)
        root = 4.0 * speed / (noise + disc) if noise > 0.0 else 0.5 * (disc - noise) / pull
        if growth != 0.0:
            for _ in range(4):
                square = root * root
                slope = 2.0 * pull * root + 4.0 / 3.0 * growth * square * root + noise
                if not slope > 0.0:
                    return math.inf, 0.0
                change = (square * (pull + growth * square / 3.0) + noise * root - 2.0 * speed) / slope
                root -= change
                if abs(change) < 1e-9 * root:
                    break
        time = root * root
        mean = 0.5 * (speed + 0.5 * time * (pull + growth * time))
        spread = math.sqrt(0.5 * diffusion) * root
        if pick < 1.0:
            # At a known time the density is v/mean times the normal one: of v and its mirror image take one by that.
            arrival = mean + spread * normal(stream)
            if arrival < 0.0 or (arrival < 2.0 * mean and arrival < 2.0 * mean * pick):
                arrival = 2.0 * mean - arrival
        else:
            ratio = mean / spread
            if uniform(stream) * most >= _mean_negative_part(ratio):
                continue
            arrival = 2.0 * mean + spread * _draw_beyond(stream, ratio)
        apart = 3.0 * speed * arrival / (diffusion * time)
        if apart > 16.0 or uniform(stream) < math.erf(math.sqrt(apart)):
            return time, arrival


@kernel(forceinline=True)  # see events.next_event
def draw_bounce(stream, w, side, j, time, until, parameters, impacts, origin):
    """Draw a low bounce from an impact at x = 0 to the next; return (speed, side, time), (w, 0, time) for none."""
    # None if it is not low enough, could last beyond `until`, or meets a pull too far from linear. The linear pull has
    # the impulse and the first moment of the forcing, a cubic through its values and slopes at the beginning and at the
    # middle of the flight, less the mean of the angle.
    block, span = parameters.block, parameters.grid.spacing
    share = force_factor(0.0, side, block)
    diffusion = parameters.diffusion[j] * share * share
    force, slope = value_and_slope(parameters.forcing.force[j], time)
    pull = -acceleration(0.0, side, force, block)
    if not w < parameters.brief * pull:
        return w, 0, time
    disc = pull * pull - 8.0 / 3.0 * side * share * slope * w
    if not disc > 0.5 * pull * pull:
        return w, 0, time
    half = 2.0 * w / (pull + math.sqrt(disc))
    if time + half <= span:
        middle, rate = value_and_slope(parameters.forcing.force[j], time + half)
    else:
        following = (j + 1) % parameters.grid.count
        middle, rate = value_and_slope(parameters.forcing.force[following], time + half - span)
    chord = (middle - force) / half
    growth = -side * share * (rate + 0.6 * (slope + rate) - 1.2 * chord)
    mean = middle + half * (slope / 3.0 + rate * 2.0 / 3.0 - chord)
    pull = -acceleration(0.0, side, mean, block) - half * (
        acceleration_gradient(0.0, side, mean, block) * w / 3.0 + growth
    )
    if not w * pull > TUNING.bounce_slowest * diffusion:
        return w, 0, time
    noise = TUNING.bounce_deviations * math.sqrt(8.0 / 3.0) * math.sqrt(diffusion)
    root = 0.5 * (noise + math.sqrt(noise * noise + 8.0 * pull * w)) / pull
    latest = root * root
    lost = max(0.0, -growth) * latest / pull
    if (
        time + latest > until
        or lost > TUNING.bounce_lost
        or parameters.forcing.force_curvature[j] * latest * latest > TUNING.bounce_curved * pull
    ):
        return w, 0, time
    duration, speed = first_return(stream, w, pull, growth, diffusion, math.sqrt((1.0 - lost) * w * pull / diffusion))
    if time + duration > until:
        return w, 0, time
    if impacts is not None:
        record_impact(impacts, origin + time + duration, -side * speed)
    return velocity_after_impact(speed, restitution_from(side, block)), -side, time + duration
