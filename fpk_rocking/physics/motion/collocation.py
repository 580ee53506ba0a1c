"""The exact block through an interval of a grid, fast: flights by Gauss-Legendre collocation, joined by impacts.

With y = u - m, the folded angle from the saddle, and F = s f a flight is y'' = κ (sin(α y)/α + F cos(α y)); m = κ = 1
for equal sides. The polynomial that obeys it at the `NODES` Gauss points of a time has at its end an error of order 2
`NODES` (E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I, 1993, section II.7). Iteration
by repeated integrals finds it: each round gains about three digits. The sine and cosine are those at a first guess,
turned by the little angle from there, so that they cost a few products.

An impact is located on that polynomial, and the flight up to it is made anew, which gives its time and velocity the
order of the end. It is accepted only where a bound of the acceleration proves that it is the first event. Everything
else goes to `events.advance_through_events`.
"""

import math

import numpy as np

from fpk_rocking.base.arrays import borrowed, load, scratch, spread, store, total
from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion import TERMS
from fpk_rocking.physics.motion.equation import (
    acceleration_scale,
    restitution_from,
    saddle,
    segment_from_force,
    value_and_slope,
)
from fpk_rocking.physics.motion.events import (
    CHATTER_TIME,
    Event,
    advance_through_events,
    chord_excludes_event,
    curvature_bounds,
    downward_root,
    lift_off_time,
    record_impact,
    rest_or_flight,
)
from fpk_rocking.physics.motion.impact import velocity_after_impact
from fpk_rocking.physics.motion.intervals import (
    COSINE,
    INNER,
    MONOMIALS,
    NODES,
    POINTS,
    SINE,
    TUNING,
)

_polynomials = scratch(2, TERMS)

_BEND = np.array([k * (k - 1.0) if k > 2 else 0.0 for k in range(TERMS)])


@kernel(fastmath={"contract"}, forceinline=True)
def lanes_times_table(m, a):
    """Return the row `a` times the table `m` (NODES, NODES): a SIMD vector of NODES = 8 floats (`Lanes`), as `a`."""
    first = load(m, 0) * spread(a, 0) + load(m, 1) * spread(a, 1)
    second = load(m, 2) * spread(a, 2) + load(m, 3) * spread(a, 3)
    third = load(m, 4) * spread(a, 4) + load(m, 5) * spread(a, 5)
    return (first + second) + (third + (load(m, 6) * spread(a, 6) + load(m, 7) * spread(a, 7)))


@kernel(fastmath={"contract"}, forceinline=True)
def _iterate(table, factor, base, own, near, force, square, alpha, scale):
    """Find the accelerations at the points of a flight from a guess `near` of y = u - m there.

    `Lanes` are SIMD vectors of eight floats, one a Gauss point. `base`, `near` and `force`, which is s f, are such;
    `square` is the duration squared, `alpha` α, radians, and `scale` κ. y is `base` plus `factor` times the integrals,
    by the `table` (NODES, NODES), of what is returned first: y'', less y if `own`. Return (that, y, converged):
    `Lanes`, `Lanes`, and a bool, whether the iteration has come to its end. All are nondimensional.
    """
    # The acceleration as a Taylor polynomial about the guess.
    turn = alpha * alpha
    q = turn * (near * near)
    qq = q * q
    r = qq * qq
    sine = near * (
        (SINE[0] + q * SINE[1])
        + qq * (SINE[2] + q * SINE[3])
        + r * ((SINE[4] + q * SINE[5]) + qq * (SINE[6] + q * SINE[7]) + r * SINE[8])
    )
    cosine = (
        (COSINE[0] + q * COSINE[1])
        + qq * (COSINE[2] + q * COSINE[3])
        + r * ((COSINE[4] + q * COSINE[5]) + qq * (COSINE[6] + q * COSINE[7]) + r * COSINE[8])
    )
    c0, c1 = scale * (sine + force * cosine), scale * (cosine - turn * (force * sine))
    c2, c3 = (-0.5 * turn) * c0, (-turn / 6.0) * c1
    c4 = (-turn / 12.0) * c2
    if own:
        c0, c1 = c0 - near, c1 - 1.0
    # Each round gains about three digits; the square of what the first is sure to gain is 1e-4.
    lack, pull, last, ratio = base - near, c0, 0.0, 1e-4
    for _ in range(12):
        off = lack + factor * lanes_times_table(table, pull)
        away = off * off
        new = (c0 + off * c1) + away * ((c2 + off * c3) + away * c4)
        shift = new - pull
        change, pull = total(shift * shift), new
        if last > 0.0:
            ratio = change / last
        if change * ratio * square <= TUNING.collocation_change:
            return pull, near + off, turn * total(away) < TUNING.collocation_turn
        last = change
    return pull, near, False


@kernel(fastmath={"contract"}, forceinline=True)
def fly_by_tables(u, w, side, force, tables, span, block):
    """Return (u, w, bend, converged) after a flight over the duration `span` of `tables`, a `FlightTables`.

    `u`, `w`, floats, are s x and s v, at the begin and at the end; `bend`, as `Lanes`, SIMD vectors of eight floats, is
    u'' at the Gauss points, `converged` whether the iteration has come to its end. `side` is s, +1 or -1, `force` is s
    f at the points, `Lanes`, and `block` an exact `KernelBlock`. All are nondimensional.
    """
    alpha, middle, scale = block.critical_angle, saddle(side, block), acceleration_scale(side, block)
    cosh, y = load(tables.points, 0), u - middle
    base = cosh * y + load(tables.points, 1) * w
    half = 0.5 * alpha * alpha
    fall, less = half / 3.0 * y * (y * y), 1.0 - half * (y * y) - half * span / 1.5 * (y * w)
    if scale != 1.0:
        fall += (1.0 - scale) * y
    near = (base - fall * (cosh - 1.0)) + scale * less * lanes_times_table(tables.inner, force)
    pull, angle, converged = _iterate(tables.inner, 1.0, base, True, near, force, span * span, alpha, scale)
    y, w = tables.cosh * y + tables.sinh * w, tables.sinh * y + tables.cosh * w
    end = middle + y + total(load(tables.points, 2) * pull)
    return end, w + total(load(tables.points, 3) * pull), pull + angle, converged


@kernel(fastmath={"contract"}, forceinline=True)
def fly_collocated(u, w, side, force, span, block, near):
    """Carry an exact block in flight over a time by collocation at eight Gauss points; all nondimensional.

    Parameters
    ----------
    u, w : float
        Folded angle s x and velocity s v at its begin.
    side : int
        The side s, +1 or -1.
    force : Lanes
        Folded force s f at the points, a SIMD vector of eight floats.
    span : float
        The time.
    block : KernelBlock
    near : Lanes
        A guess of u - m at the points, m the folded angle of unstable balance.

    Returns
    -------
    u, w, bend, converged : float, float, Lanes, bool
        State at the end, u'' at the points, and whether the iteration has come to its end.
    """
    y, slope, square, scale = u - saddle(side, block), span * w, span * span, acceleration_scale(side, block)
    base = y + slope * load(POINTS, 0)
    bend, _, converged = _iterate(INNER, square, base, False, near, force, square, block.critical_angle, scale)
    return u + slope + square * total(load(POINTS, 1) * bend), w + span * total(load(POINTS, 2) * bend), bend, converged


@kernel(fastmath={"contract"}, forceinline=True)
def _guess(u, w, side, begin, end, span, block):
    """Return a guess of u - m at the Gauss points of a flight, `Lanes` (eight floats), for a cubic polynomial u = s x.

    `u`, `w` are s x and s v at its begin, `side` is s, +1 or -1, `begin` and `end` are s f at the first and the last
    point, `span` is the duration, all nondimensional, and `block` a `KernelBlock`.
    """
    y, slope, c = u - saddle(side, block), span * w, load(POINTS, 0)
    square = acceleration_scale(side, block) * (span * span)
    bend = 0.5 * square * (y + begin)
    twist = (square * (y + slope + end) - 2.0 * bend) / 6.0
    return y + c * (slope + c * (bend + c * twist))


@kernel(fastmath={"contract"}, forceinline=True)
def _value(coefficients, terms, t):
    """Return the values of a polynomial at eight times `t`, `Lanes` as `t` (SIMD vectors of eight floats).

    `coefficients` has `terms` (even) of them, lowest power first; even and odd powers are summed apart, for speed.
    """
    square = t * t
    even, odd = square * 0.0 + coefficients[terms - 2], square * 0.0 + coefficients[terms - 1]
    for k in range(terms - 4, -1, -2):
        even, odd = even * square + coefficients[k], odd * square + coefficients[k + 1]
    return even + t * odd


@kernel(fastmath={"contract"}, forceinline=True)
def _expand(u, w, span, bend, scratch, angle):
    """Write to `angle` (TERMS,) the coefficients of u = s x in the time since the flight's middle, lowest power first.

    The unit of that time is half of the duration. `u`, `w` are s x and s v at the begin, `span` the duration, `bend` is
    u'' at the Gauss points, `Lanes`, all nondimensional. Row 1 of `scratch` (2, TERMS) is written to.
    """
    half = 0.5 * span
    store(scratch, 1, (half * half) * (load(POINTS, 3) * lanes_times_table(MONOMIALS, bend)))
    low, rise = u, half * w
    for k in range(NODES):
        c = scratch[1, k]
        angle[k + 2] = c
        sign = 1.0 - 2.0 * (k % 2)
        low -= sign * c
        rise += sign * (k + 2) * c
    for k in range(NODES + 2, TERMS):
        angle[k] = 0.0
    angle[0], angle[1] = low + rise, rise


@kernel(forceinline=True)
def _without_begin(angle, quotient):
    """Write to `quotient` (TERMS,) the coefficients of a polynomial divided by t + 1; lowest power first.

    `angle` (TERMS,) are the polynomial's coefficients in t; it is 0 at the flight's begin, t = -1.
    """
    value = 0.0
    for k in range(TERMS - 1, 0, -1):
        value = angle[k] - value
        quotient[k - 1] = value
    quotient[TERMS - 1] = 0.0


@kernel(forceinline=True)
def _leaves(u, w, angle, last, fall, block):
    """Whether a flight from x = 0 surely rises, a bool: its acceleration does, from 0 or more, but for 1e-9.

    `u`, `w` are s x and s v at the begin, `angle` (TERMS,) the coefficients of s x in time from -1 to 1 (`_expand`),
    `last` is s x at the end, `fall` half of the bound of -u'' in that time, and `block` a `KernelBlock`.
    """
    if u != 0.0 or w < 0.0 or last + fall >= block.cutoff:
        return False
    bend, jerk, others, sign = 2.0 * angle[2] - 6.0 * angle[3], 6.0 * angle[3], 0.0, 1.0
    for k in range(4, NODES + 2):
        term = k * (k - 1) * angle[k]
        bend, others, sign = bend + sign * term, others + (k - 2) * abs(term), -sign
    return bend > -1e-9 and jerk > others


@kernel(forceinline=True)
def _hop(u, w, side, force, start, until, block):
    """Return (duration, w) of a low hop from x = 0 to the next impact, w = s v then; (0, 0) if it may be long.

    `u`, `w` are s x and s v at `start`, `side` is s, +1 or -1, `force` (TERMS,) are the coefficients of f, lowest power
    first, in the time of `start`, `block` is a `KernelBlock`. A hop that takes more than half of the time up to `until`
    counts as long. All are nondimensional.
    """
    if u != 0.0 or not 0.0 < w <= 2e-4:  # a faster hop is no polynomial of fourth order
        return 0.0, 0.0
    (f, slope), alpha = value_and_slope(force, start), block.critical_angle
    phi, scale = alpha * saddle(side, block), acceleration_scale(side, block)
    cosine, sine = math.cos(phi), math.sin(phi)
    bend, stiff = scale * (side * f * cosine - sine / alpha), scale * (cosine + alpha * side * f * sine)
    jerk = stiff * w + scale * (side * slope * cosine)
    snap = stiff * bend
    time = -2.0 * w / bend
    if not 0.0 < 2.0 * time < until - start or abs(jerk) * time > -0.1 * bend:
        return 0.0, 0.0
    for _ in range(3):
        height = w + time * (bend / 2.0 + time * (jerk / 6.0 + time * snap / 24.0))
        time -= height / (bend / 2.0 + time * (jerk / 3.0 + time * snap / 8.0))
    return time, w + time * (bend + time * (jerk / 2.0 + time * snap / 6.0))


@kernel(fastmath={"contract"}, forceinline=True)
def _flight(u, w, side, force, start, span, block):
    """Return (u, w, bend, converged) after a flight over the time `span` from `start`, as `fly_collocated` does.

    `u`, `w`, floats, are s x and s v, `bend` is u'' at the Gauss points (`Lanes`), `converged` a bool. `side` is s, +1
    or -1, `force` (TERMS,) are the coefficients of f, lowest power first, in the time of `start`, and `block` is a
    `KernelBlock`. All are nondimensional.
    """
    push = side * _value(force, TERMS, start + span * load(POINTS, 0))
    near = _guess(u, w, side, total(push * load(POINTS, 4)), total(push * load(POINTS, 5)), span, block)
    return fly_collocated(u, w, side, push, span, block, near)


@kernel(forceinline=True)
def _event(u, w, last, angle, quotient, block):
    """Return (event, place): the first `Event` in a flight, UNKNOWN where no bound decides, and its time from -1 to 1.

    That time is the one of the polynomial `angle` (TERMS,) that `_expand` wrote, -1 at the begin and 1 at the end. `u`,
    `w` are s x and s v at the begin, `last` is s x at the end, `quotient` (TERMS,) is written to, and `block` is a
    `KernelBlock`.
    """
    fall, rise = curvature_bounds(angle, _BEND)
    if last > 0.0:
        sure = chord_excludes_event(u, last, 4.0, rise, fall, block.cutoff) or _leaves(u, w, angle, last, fall, block)
        return (Event.NONE if sure else Event.UNKNOWN), 1.0
    if u == 0.0:
        _without_begin(angle, quotient)
        place, slope = downward_root(quotient, 1.0)
    else:
        place, slope = downward_root(angle, 1.0)
    square = (place + 1.0) ** 2
    sure = slope < 0.0 and u >= rise * square and u + 0.25 * fall * square < block.cutoff
    return (Event.IMPACT if sure else Event.UNKNOWN), place


@kernel(fastmath={"contract"}, forceinline=True)
def _arrive(u, w, side, force, start, time, place, angle, block):
    """Return (duration, w), time and velocity s v of a flight up to its impact near `time` after `start`; or (0, 0).

    `u`, `w` are s x and s v at `start`, `side` is s, +1 or -1, `force` (TERMS,) are the coefficients of f, lowest power
    first, `place` is `time` in the time (-1 to 1) of the polynomial `angle` (TERMS,) that `_expand` wrote, and `block`
    is a `KernelBlock`. Zeros say that the impact is not within 1e-7 of `time`.
    """
    places = load(POINTS, 0)
    push = side * _value(force, TERMS, start + time * places)
    near = _value(angle, NODES + 2, (place + 1.0) * places - 1.0) - saddle(side, block)
    rest, speed, bend, converged = fly_collocated(u, w, side, push, time, block, near)
    late = -rest / speed
    if not (converged and abs(late) < 1e-7):  # farther from the root of the polynomial it may be another impact
        return 0.0, 0.0
    return time + late, speed + late * total(bend * load(POINTS, 5))


@kernel(forceinline=True)
def _land(side, speed, force, half, time, block, impacts, origin, slow):
    """Return (x, v, side, time) after an impact at `time`, or those of rest, side 0, at the time of its begin.

    `side`, ±1, is that before the impact, `speed` s v then, `force` (TERMS,) are the coefficients of f, lowest power
    first, for |t| up to `half`; `block`, `impacts`, `origin` and `slow` are as of `advance_through_events`.
    """
    if impacts is not None:
        record_impact(impacts, origin + time, side * speed)
    v, side = velocity_after_impact(side * speed, restitution_from(side, block)), -side
    # Chatter takes a longer time than the number |v|: it can only end within `slow` where |v| is at most `slow`.
    if abs(v) <= slow:
        side, delay = rest_or_flight(abs(v), side, borrowed(segment_from_force(force, half)), time, block, slow)
        if side == 0:
            return 0.0, 0.0, side, time + delay
    return 0.0, v, side, time


@kernel
def advance_from_flight(
    force, half, x, v, side, start, end, block, impacts, origin, followed, last, speed, bend, slow=CHATTER_TIME
):
    """Carry an exact block through a part of an interval: as `events.advance_through_events`, with the same accuracy.

    Parameters
    ----------
    force : ndarray (TERMS,)
        Coefficients of the force, a polynomial of time, lowest power first.
    half : float
        Largest |t| for which it is used.
    x, v, side, start, end, block, impacts, origin, slow
        As of `advance_through_events`; times are those of the polynomial.
    followed, last, speed, bend : bool, float, float, Lanes
        Whether the flight from `start` to `end`, on over impacts, has been followed, and what `fly_collocated` gave:
        s x and s v at its end, and u'' at the Gauss points.

    Returns
    -------
    x, v, side, time : float, float, int, float
        Angle, velocity and side (0 at rest) at `time`, which is `end` unless the block overturned earlier.
    """
    work, until, converged = _polynomials(), end, True
    angle, quotient = work[0], work[1]
    while start < end:
        if side == 0:
            start, side = lift_off_time(borrowed(segment_from_force(force, half)), start, end, block)
            x, v = 0.0, 0.0
            continue
        u, w, span = side * x, side * v, until - start
        time, landing = _hop(u, w, side, force, start, until, block)
        if time == 0.0:
            if not followed:
                last, speed, bend, converged = _flight(u, w, side, force, start, span, block)
            followed = False
            _expand(u, w, span, bend, work, angle)
            event, place = _event(u, w, last, angle, quotient, block)
            if converged and event == Event.NONE:
                x, v, start, until = side * last, side * speed, until, end
                continue
            if not converged or event == Event.UNKNOWN:
                if span < 0.02 * half:  # no bound decides: the search for events does
                    break
                until = start + 0.4 * span
                continue
            time, landing = _arrive(u, w, side, force, start, 0.5 * (place + 1.0) * span, place, angle, block)
            if time == 0.0:
                break
        until = end
        x, v, side, start = _land(side, landing, force, half, start + time, block, impacts, origin, slow)
    if start >= end:
        return x, v, side, end
    return advance_through_events(
        x, v, side, borrowed(segment_from_force(force, half)), start, end, block, impacts, origin, slow
    )


@kernel
def advance_collocated(force, half, x, v, side, start, end, block, impacts, origin, slow=CHATTER_TIME):
    """Return (x, v, side, time) of an exact block carried from `start` to `end`, or until it overturns.

    The arguments are those of `advance_from_flight`, without its flight: none is followed yet.
    """
    nothing = load(POINTS, 0)
    return advance_from_flight(
        force, half, x, v, side, start, end, block, impacts, origin, False, 0.0, 0.0, nothing, slow
    )
