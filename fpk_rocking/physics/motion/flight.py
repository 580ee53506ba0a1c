"""Flights of a block between events: in closed form for a slender block, by Taylor series for an exact one.

A slender block has y = x - s - P with y'' = y, a growing and a decaying exponential (derived in docs/theory). For an
exact block the force over a segment is a polynomial, its weight is linear, and the series of the angle about any time
in it follows from three Cauchy products an order: (sin φ)' = φ' cos φ, (cos φ)' = -φ' sin φ and the equation itself. It
is used for as long as its last terms are below rounding, and then made anew.

`start_flight`, `flight_state` and `outward_time` march through a flight in search of events; `flight_end` goes straight
to its end. Times count from the segment's start. The last functions have the covariance that white noise gathers in a
flight, dv = (x - s + f) dt + sqrt(2 D) dW.
"""

import math
from typing import NamedTuple

import numpy as np

from fpk_rocking.base.arrays import scratch
from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion import TERMS
from fpk_rocking.physics.motion.equation import (
    acceleration_scale,
    block_at,
    dispatch_on_block,
    least_closing_time,
    move_origin,
    saddle,
    slender_acceleration,
    slender_acceleration_bounds,
    value_and_slope,
    weight_of,
)

# Arguments with an underscore are there for the other form.


@kernel(forceinline=True)
def exponential_parts(x, v, side, particular, t):
    """(grow, decay) at t: y = x - s - P is their sum, y' their difference; P counts from the same time as t."""
    p, q = value_and_slope(particular, t)
    y, z = x - side - p, v - q
    return 0.5 * (y + z), 0.5 * (y - z)


@kernel(forceinline=True)
def state_from_exponentials(grow, decay, side, particular, t):
    """(x, v) at t, the inverse of `exponential_parts`."""
    p, q = value_and_slope(particular, t)
    return side + p + grow + decay, q + grow - decay


@kernel(inline="always")
def folded_angle(side, p, grow, decay):
    """Folded angle u = s x of a slender flight, from P and the exponential parts."""
    return 1.0 + side * (p + grow + decay)


class SlenderFlight(NamedTuple):
    """Times, bounds `fall` of -u'' and `rise` of u'' over them, and the exponential parts at `begin`."""

    begin: float
    end: float
    fall: float
    rise: float
    grow: float
    decay: float


@kernel(forceinline=True)
def _start_slender(x, v, side, segment, start, end, _work, block):
    p, q = value_and_slope(segment.particular, start)
    fall, rise = slender_acceleration_bounds(side, segment.force_low, segment.force_high, block)
    return SlenderFlight(start, end, fall, rise, 0.5 * (x - side - p + v - q), 0.5 * (x - side - p - v + q))


@kernel(forceinline=True)
def _slender_state(flight, side, segment, t, _work, _block):
    factor = math.exp(t - flight.begin)
    return state_from_exponentials(flight.grow * factor, flight.decay / factor, side, segment.particular, t)


@kernel(forceinline=True)
def _slender_outward_time(_flight, u, side, segment, t, _work, block):
    force, jerk = value_and_slope(segment.force, t)
    rising = slender_acceleration(u, side, force, block)
    return least_closing_time(rising, side * jerk, segment.force_curvature) if rising >= 0.0 else -1.0


@kernel
def slender_flight_end(x, v, side, segment, start, end, _block):
    p, q = value_and_slope(segment.particular, start)
    factor = math.exp(end - start)
    grow, decay = 0.5 * (x - side - p + v - q), 0.5 * (x - side - p - v + q)
    return state_from_exponentials(grow * factor, decay / factor, side, segment.particular, end)


_RECIPROCALS = 1.0 / np.maximum(np.arange(TERMS), 1)

SERIES = 4, TERMS
"""Shape of what `start_flight` writes for an exact block: the series of u, sin φ, cos φ and s f."""

_series = scratch(*SERIES)


class ExactFlight(NamedTuple):
    """Times for which the series holds, and bounds of -u'', u'' and |u''''| over them."""

    begin: float
    end: float
    fall: float
    rise: float
    snap: float


@kernel
def flight_series(u, w, side, force, t, span, block, work):
    """Write Taylor series about t of u, sin φ, cos φ and s f to `work` (4, TERMS); return for how long that of u holds.

    It ends where its terms are below rounding at the end of the time `span`, for which it then holds.
    """
    angle, sine, cosine, push, alpha = work[0], work[1], work[2], work[3], block.critical_angle
    move_origin(force, t, push)
    phi, scale = alpha * (saddle(side, block) - u), acceleration_scale(side, block)
    angle[0], angle[1], sine[0], cosine[0] = u, w, math.sin(phi), math.cos(phi)
    size, power, before, weight = max(1.0, abs(u)), span * span, math.inf, weight_of(block_at(t, block))
    pull, growth = weight.start / alpha, weight.slope / alpha
    angle[2] = scale * (0.5 * (side * push[0] * cosine[0] - pull * sine[0]))
    for k in range(1, TERMS - 2):
        s, c, total = 0.0, 0.0, 0.0
        for i in range(1, k + 1):
            turn = i * angle[i]
            s -= turn * cosine[k - i]
            c += turn * sine[k - i]
            total += push[i] * cosine[k - i]
        share = alpha * _RECIPROCALS[k]
        sine[k], cosine[k] = share * s, share * c
        total += push[0] * cosine[k]
        fall = pull * sine[k]
        if weight.slope != 0.0:
            fall += growth * sine[k - 1]
        angle[k + 2] = scale * (side * total - fall) * (_RECIPROCALS[k + 1] * _RECIPROCALS[k + 2])
        power *= span
        term = abs(angle[k + 2]) * power
        if before + term < 1e-18 * size:  # those that follow are far below rounding
            angle[k + 3 :] = 0.0
            return span
        before = term
    last = max(abs(angle[TERMS - 1]), 1e-300)
    before = max(abs(angle[TERMS - 2]), 1e-300)
    rounding = 1e-16 * size  # which the last of all terms may reach
    return min((rounding / last) ** (1.0 / (TERMS - 1)), (rounding / before) ** (1.0 / (TERMS - 2)))


@kernel
def _start_exact(x, v, side, segment, start, end, work, block):
    """It ends where its series, written to `work` (4, TERMS), ceases to hold."""
    reach = flight_series(side * x, side * v, side, segment.force, start, end - start, block, work)
    angle, step = work[0], min(reach, end - start)
    spread, snap, power = 0.0, 0.0, 1.0
    for k in range(3, TERMS):
        term = k * (k - 1) * abs(angle[k]) * power
        if k > 3:
            snap += (k - 2) * (k - 3) * term
        power *= step
        spread += term * step
    end = start + step if step < end - start else end
    return ExactFlight(start, end, spread - 2.0 * angle[2], spread + 2.0 * angle[2], snap / step)


@kernel
def _exact_state(flight, side, _segment, t, work, _block):
    u, w = value_and_slope(work[0], t - flight.begin)
    return side * u, side * w


@kernel
def _exact_outward_time(flight, _u, _side, _segment, t, work, _block):
    angle, since = work[0], t - flight.begin
    rising, jerk = 0.0, 0.0
    for k in range(TERMS - 1, 1, -1):
        jerk = jerk * since + rising
        rising = rising * since + k * (k - 1) * angle[k]
    return least_closing_time(rising, jerk, flight.snap) if rising >= 0.0 else -1.0


@kernel
def _exact_flight_end(x, v, side, segment, start, end, block):
    work, t, u, w = _series(), start, side * x, side * v
    while t < end:
        reach = flight_series(u, w, side, segment.force, t, end - t, block, work)
        u, w = value_and_slope(work[0], min(reach, end - t))
        t = t + reach if reach < end - t else end
    return side * u, side * w


start_flight = dispatch_on_block(_start_slender, _start_exact)
"""A flight from (x, v) at `start`, in which events can be searched for, up to `end` or less."""
flight_state = dispatch_on_block(_slender_state, _exact_state)
"""(x, v) at t of a flight."""
outward_time = dispatch_on_block(_slender_outward_time, _exact_outward_time)
"""Time for which u'' of a flight surely stays >= 0 from t on; -1.0 where u'' < 0 at t."""
flight_end = dispatch_on_block(slender_flight_end, _exact_flight_end)
"""(x, v) at `end` of a flight from (x, v) at `start`."""


@kernel
def unstable_coordinate(u, w, side, particular, t):
    """Z = u + w - 1 - s (P + P') at t: above 0 a slender flight without noise or impact escapes."""
    value, slope = value_and_slope(particular, t)
    return u + w - 1.0 - side * (value + slope)


@kernel(inline="always")
def homogeneous_flight(y, v, cosh, sinh):
    """(y, v) after a slender flight without force, y = x - s."""
    return cosh * y + sinh * v, sinh * y + cosh * v


@kernel(inline="always")
def apply_affine(x, v, affine):
    """(x, v) after a flight that is an affine map (cosh, sinh, shift)."""
    cosh, sinh, shift = affine
    return shift[0] + cosh * x + sinh * v, shift[1] + sinh * x + cosh * v


@kernel(fastmath={"contract"})
def runge_kutta_coefficients(h):
    """What a classical Runge-Kutta step h of x'' = x - s + f has in place of cosh h, sinh h, cosh h - 1."""
    keep, swap = 1.0 + h * h * (0.5 + h * h / 24.0), h * (1.0 + h * h / 6.0)
    return keep, swap, h * h * (3.0 + 0.25 * h * h) / 6.0


@kernel(fastmath={"contract"})
def runge_kutta_forcing(begin, middle, end, h):
    """(x, v) that a force adds in a classical Runge-Kutta step, by its values at start, middle and end."""
    x = h * h * ((1.0 + 0.25 * h * h) * begin + 2.0 * middle) / 6.0
    return x, h * ((1.0 + 0.5 * h * h) * begin + (4.0 + 0.5 * h * h) * middle + end) / 6.0


@kernel
def flight_covariance(diffusion, duration):
    """Covariance (xx, xv, vv) of angle and velocity after a flight of the time t from a point, by the diffusion D.

    D (sinh(2t)/2 - t), D sinh(t)^2, D (t + sinh(2t)/2). Short flights use the series of xx, which would cancel.
    """
    t = duration
    sinh = math.sinh(t)
    if t < 0.1:
        square = t * t
        xx = t * square * (2.0 / 3.0) * (1.0 + square / 5.0 * (1.0 + square * (2.0 / 21.0) * (1.0 + square / 18.0)))
    else:
        xx = 0.5 * math.sinh(2.0 * t) - t
    return diffusion * xx, diffusion * sinh * sinh, diffusion * (t + 0.5 * math.sinh(2.0 * t))


@kernel
def covariance_factor(diffusion, duration):
    """Lower Cholesky factor [[xx, 0], [vx, vv]] of `flight_covariance` for a time up to 0.1, to rounding."""
    root, square = math.sqrt(diffusion * duration), duration * duration
    xx = 1.0 + square * (1.0 / 10.0 + square * (19.0 / 4200.0 + square * (29.0 / 378000.0)))
    vx = 1.0 + square * (7.0 / 30.0 + square * (209.0 / 12600.0 + square * (29.0 / 75600.0)))
    vv = 1.0 - square * (1.0 / 30.0 - square * (17.0 / 12600.0 - square / 54000.0))
    return (
        math.sqrt(2.0 / 3.0) * duration * root * xx,
        math.sqrt(1.5) * root * vx,
        math.sqrt(0.5) * root * vv,
    )
