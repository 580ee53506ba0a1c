"""The exact block through an interval of a grid, fast: flights by Gauss-Legendre collocation, joined by impacts.

With y = u - m, the folded angle from the saddle, and F = s f a flight is y'' = κ (G sin(α y)/α + F cos(α y)); the
weight G is 1 unless the base moves vertically, m = κ = 1 for equal sides. The polynomial that obeys it at the `NODES`
Gauss points of a time has at its end an error of order 2 `NODES` (E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary
Differential Equations I, 1993, section II.7). Iteration by repeated integrals finds it: each round gains about three
digits. The sine and cosine are those at a first guess, turned by the little angle from there, so that they cost a few
products. Values at the points are SIMD vectors of eight floats.

An impact is located on that polynomial, and the flight up to it is made anew, which gives its time and velocity the
order of the end. It is accepted only where a bound of the acceleration proves that it is the first event. Everything
else goes to `events.advance_through_events`.
"""

import functools
import math
from typing import NamedTuple

import numpy as np

from fpk_rocking.base.arrays import WIDTH, borrowed, load, scratch, spread, store, total
from fpk_rocking.base.basis import gauss_legendre
from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion import TERMS
from fpk_rocking.physics.motion.equation import (
    acceleration_scale,
    block_at,
    dispatch_on_weight,
    restitution_from,
    saddle,
    segment_from_force,
    value_and_slope,
    weight_of,
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

NODES = WIDTH


def _collocation():
    """Gauss points c (NODES,) of [0, 1], and tables of the polynomials that are 1 at one of them, 0 at others.

    They are: double integrals from 0 up to the points [polynomial, point]; coefficients on [-1, 1] [polynomial, power];
    and six rows (6, NODES): c, the double and the single integral to 1, 1/((k + 1)(k + 2)), and the unit vectors of the
    first and the last point.
    """
    points, weights = gauss_legendre(NODES, -1.0, 1.0)
    lagrange = np.linalg.inv(np.polynomial.legendre.legvander(points, NODES - 1)).T
    twice = np.array([np.polynomial.legendre.legint(row, 2, lbnd=-1) for row in lagrange])
    inner = 0.25 * np.polynomial.legendre.legval(points, twice.T)
    places, order, unit = 0.5 * (1.0 + points), np.arange(NODES), np.eye(NODES)
    monomials = np.array([np.polynomial.legendre.leg2poly(row) for row in lagrange])
    rows = 0.5 * weights * (1.0 - places), 0.5 * weights, 1.0 / ((order + 1.0) * (order + 2.0)), unit[0], unit[-1]
    return places, inner, monomials, np.stack([places, *rows])


PLACES, INNER, MONOMIALS, POINTS = _collocation()


class FlightTables(NamedTuple):
    """Tables for flights u'' = u - m + a over one duration: without a, and what a adds by its values at the points.

    `points` (4, NODES): cosh and sinh of the time at the points; angle and velocity at the end that a unit value of a
    at a point adds. `inner` (NODES, NODES) [j, i]: angle at point i by the value at point j; `cosh`, `sinh` at the end.
    """

    points: np.ndarray
    inner: np.ndarray
    cosh: float
    sinh: float


@functools.lru_cache(maxsize=64)
def flight_tables(span: float) -> FlightTables:
    """Tables of flights of the duration `span`; they are cached, so that nothing may write to them."""
    points, weights = gauss_legendre(24, -1.0, 1.0)
    ends, parts = span * np.append(PLACES, 1.0), 0.5 * (1.0 + points)
    lagrange = np.array([[_lagrange(j, end / span * parts) for end in ends] for j in range(NODES)])
    left = ends[:, None] * (1.0 - parts)
    weights = 0.5 * weights * ends[:, None]
    angle = np.einsum("jip,ip->ji", lagrange, weights * np.sinh(left))
    velocity = np.einsum("jp,p->j", lagrange[:, -1], (weights * np.cosh(left))[-1])
    rows = np.stack([np.cosh(ends[:-1]), np.sinh(ends[:-1]), angle[:, -1], velocity])
    return FlightTables(rows, angle[:, :-1].copy(), math.cosh(span), math.sinh(span))


def _lagrange(j, places):
    """Values (n,), at places of [0, 1], of the polynomial that is 1 at `PLACES[j]`, 0 at the other points."""
    others = np.delete(PLACES, j)
    return np.prod((places[:, None] - others) / (PLACES[j] - others), axis=1)


def _economized(start):
    """Coefficients of powers of φ² of sin φ/φ (`start` 1) or cos φ (0), right to 1e-16 for |φ| <= π/2."""
    terms, most = 9, (0.5 * math.pi) ** 2
    angles = np.sqrt(0.5 * most * (1.0 + np.cos(np.pi * (np.arange(terms) + 0.5) / terms)))
    values = np.sin(angles) / angles if start else np.cos(angles)
    fit = np.polynomial.Chebyshev.fit(angles**2, values, terms - 1, domain=[0.0, most])
    return tuple(float(c) for c in fit.convert(kind=np.polynomial.Polynomial).coef)


SINE, COSINE = _economized(1), _economized(0)


class Tuning(NamedTuple):
    """Tuned numbers of the iteration for the accelerations of an exact flight."""

    collocation_change: float = 1e-24
    """Square of an acceleration, times the duration, that the next round may still change."""
    collocation_turn: float = 1e-5
    """Largest sum of squares of the turns from the first guess for which a series has their sine and cosine."""


TUNING = Tuning()

_polynomials = scratch(2, TERMS)

_BEND = np.array([k * (k - 1.0) if k > 2 else 0.0 for k in range(TERMS)])


@kernel(fastmath={"contract"}, forceinline=True)
def lanes_times_table(m, a):
    """Row `a` times the table `m` (NODES, NODES)."""
    first = load(m, 0) * spread(a, 0) + load(m, 1) * spread(a, 1)
    second = load(m, 2) * spread(a, 2) + load(m, 3) * spread(a, 3)
    third = load(m, 4) * spread(a, 4) + load(m, 5) * spread(a, 5)
    return (first + second) + (third + (load(m, 6) * spread(a, 6) + load(m, 7) * spread(a, 7)))


@kernel(inline="always")
def _still_weights(_span, _block):
    return 1.0


@kernel(inline="always")
def _moving_weights(span, block):
    return block.weight.start + span * block.weight.slope * load(POINTS, 0)


_weights = dispatch_on_weight(_still_weights, _moving_weights)
"""Weight at the points of a flight, with which that of the block starts."""


@kernel(fastmath={"contract"}, forceinline=True)
def _iterate(table, factor, base, own, near, force, weight, square, alpha, scale):
    """(accelerations, y, converged) at the points of a flight, from a guess `near` of y.

    y is `base` plus `factor` times the integrals, by the `table` (NODES, NODES), of the accelerations: y'', less y if
    `own`. `force` is s f and `weight` G at the points, `square` the duration squared.
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
    c0, c1 = scale * (weight * sine + force * cosine), scale * (weight * cosine - turn * (force * sine))
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
    """(u, w, u'' at the points, converged) after a flight over the time of `tables`, under s f at the points."""
    alpha, middle, scale = block.critical_angle, saddle(side, block), acceleration_scale(side, block)
    cosh, y = load(tables.points, 0), u - middle
    base = cosh * y + load(tables.points, 1) * w
    half = 0.5 * alpha * alpha
    fall, less = half / 3.0 * y * (y * y), 1.0 - half * (y * y) - half * span / 1.5 * (y * w)
    if scale != 1.0:
        fall += (1.0 - scale) * y
    near = (base - fall * (cosh - 1.0)) + scale * less * lanes_times_table(tables.inner, force)
    weight, square = _weights(span, block), span * span
    pull, angle, converged = _iterate(tables.inner, 1.0, base, True, near, force, weight, square, alpha, scale)
    y, w = tables.cosh * y + tables.sinh * w, tables.sinh * y + tables.cosh * w
    end = middle + y + total(load(tables.points, 2) * pull)
    return end, w + total(load(tables.points, 3) * pull), pull + angle, converged


@kernel(fastmath={"contract"}, forceinline=True)
def fly_collocated(u, w, side, force, span, block, near):
    """(u, w, u'' at the points, converged) after a flight over `span`; `near` is a guess of y at the points."""
    y, slope, square, scale = u - saddle(side, block), span * w, span * span, acceleration_scale(side, block)
    base = y + slope * load(POINTS, 0)
    weight, alpha = _weights(span, block), block.critical_angle
    bend, _, converged = _iterate(INNER, square, base, False, near, force, weight, square, alpha, scale)
    return u + slope + square * total(load(POINTS, 1) * bend), w + span * total(load(POINTS, 2) * bend), bend, converged


@kernel(fastmath={"contract"}, forceinline=True)
def _guess(u, w, side, begin, end, span, block):
    """Guess of y at the points of a flight, for a cubic u; `begin`, `end` are s f at the first and the last point."""
    y, slope, c = u - saddle(side, block), span * w, load(POINTS, 0)
    square = acceleration_scale(side, block) * (span * span)
    first, last = weight_of(block), weight_of(block_at(span, block))
    bend = 0.5 * square * (first.start * y + begin)
    twist = (square * (last.start * (y + slope) + end) - 2.0 * bend) / 6.0
    return y + c * (slope + c * (bend + c * twist))


@kernel(fastmath={"contract"}, forceinline=True)
def _value(coefficients, terms, t):
    """Values of a polynomial at eight times; even and odd powers are summed apart, for speed."""
    square = t * t
    even, odd = square * 0.0 + coefficients[terms - 2], square * 0.0 + coefficients[terms - 1]
    for k in range(terms - 4, -1, -2):
        even, odd = even * square + coefficients[k], odd * square + coefficients[k + 1]
    return even + t * odd


@kernel(fastmath={"contract"}, forceinline=True)
def _expand(u, w, span, bend, scratch, angle):
    """Write to `angle` (TERMS,) the coefficients of u in the time, from -1 to 1, of a flight with u'' at the points.

    Row 1 of `scratch` (2, TERMS) is written to.
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
def divide_by_time_since_start(angle, quotient):
    """Write to `quotient` (TERMS,) the polynomial `angle`, which is 0 at t = -1, divided by t + 1."""
    value = 0.0
    for k in range(TERMS - 1, 0, -1):
        value = angle[k] - value
        quotient[k - 1] = value
    quotient[TERMS - 1] = 0.0


@kernel(forceinline=True)
def surely_rises(u, w, angle, last, fall, block):
    """Whether a flight from x = 0 surely rises: its acceleration does, from 0 or more, but for 1e-9.

    `angle` are coefficients by `_expand`, `last` is u at the end, `fall` half of the bound of -u''.
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
    """(duration, w) of a low hop from x = 0 to the next impact; (0, 0) if it may take half of the time to `until`."""
    if u != 0.0 or not 0.0 < w <= 2e-4:  # a faster hop is no polynomial of fourth order
        return 0.0, 0.0
    (f, slope), alpha = value_and_slope(force, start), block.critical_angle
    phi, scale, weight = alpha * saddle(side, block), acceleration_scale(side, block), weight_of(block)
    cosine, sine = math.cos(phi), math.sin(phi)
    bend = scale * (side * f * cosine - weight.start * sine / alpha)
    stiff = scale * (weight.start * cosine + alpha * side * f * sine)
    jerk = stiff * w + scale * (side * slope * cosine)
    if weight.slope != 0.0:
        jerk -= scale * (weight.slope * sine / alpha)
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
    """As `fly_collocated`, from `start` in the time of the coefficients (TERMS,) of f."""
    push = side * _value(force, TERMS, start + span * load(POINTS, 0))
    near = _guess(u, w, side, total(push * load(POINTS, 4)), total(push * load(POINTS, 5)), span, block)
    return fly_collocated(u, w, side, push, span, block, near)


@kernel(forceinline=True)
def _event(u, w, last, angle, quotient, block):
    """(event, place): the first `Event` in a flight, UNKNOWN where no bound decides, and its time from -1 to 1.

    `angle` are coefficients by `_expand`, `last` is u at the end; `quotient` (TERMS,) is written to.
    """
    fall, rise = curvature_bounds(angle, _BEND)
    if last > 0.0:
        sure = chord_excludes_event(u, last, 4.0, rise, fall, block.cutoff) or surely_rises(
            u, w, angle, last, fall, block
        )
        return (Event.NONE if sure else Event.UNKNOWN), 1.0
    if u == 0.0:
        divide_by_time_since_start(angle, quotient)
        place, slope = downward_root(quotient, 1.0)
    else:
        place, slope = downward_root(angle, 1.0)
    square = (place + 1.0) ** 2
    sure = slope < 0.0 and u >= rise * square and u + 0.25 * fall * square < block.cutoff
    return (Event.IMPACT if sure else Event.UNKNOWN), place


@kernel(fastmath={"contract"}, forceinline=True)
def _arrive(u, w, side, force, start, time, place, angle, block):
    """(duration, w) of a flight up to its impact near `time` after `start`, or (0, 0) if that is not within 1e-7."""
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
    """(x, v, side, time) after an impact at `time`, or those of rest, side 0, when it begins."""
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
    """(x, v, side, time) of an exact block through a part of an interval, as accurate as `advance_through_events`.

    `force` (TERMS,) are the coefficients of f for |t| <= `half`. `followed`: whether the flight from `start` to `end`,
    on over impacts, has been followed; `last`, `speed`, `bend` are then what `fly_collocated` gave.
    """
    work, until, converged = _polynomials(), end, True
    angle, quotient = work[0], work[1]
    while start < end:
        if side == 0:
            start, side = lift_off_time(borrowed(segment_from_force(force, half)), start, end, block)
            x, v = 0.0, 0.0
            continue
        u, w, span, now = side * x, side * v, until - start, block_at(start, block)
        time, landing = _hop(u, w, side, force, start, until, now)
        if time == 0.0:
            if not followed:
                last, speed, bend, converged = _flight(u, w, side, force, start, span, now)
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
            time, landing = _arrive(u, w, side, force, start, 0.5 * (place + 1.0) * span, place, angle, now)
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
    """As `advance_from_flight`, of which no flight is followed yet."""
    nothing = load(POINTS, 0)
    return advance_from_flight(
        force, half, x, v, side, start, end, block, impacts, origin, False, 0.0, 0.0, nothing, slow
    )
