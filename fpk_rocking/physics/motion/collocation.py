"""The exact block through an interval of a grid, fast: flights by Gauss-Legendre collocation, joined by impacts.

With y = u - 1, the folded angle from the saddle, and F = s f a flight is y'' = sin(α y)/α + F cos(α y). The polynomial
that obeys it at the `NODES` Gauss points of a time has at its end an error of order 2 `NODES` (E. Hairer, S. P.
Norsett, G. Wanner, Solving Ordinary Differential Equations I, 1993, section II.7). Iteration by repeated integrals
finds it: each round gains about three digits. The sine and cosine are those at a first guess, turned by the little
angle from there, so that they cost a few products.

An impact is located on that polynomial, and the flight up to it is made anew, which gives its time and velocity the
order of the end. It is accepted only where a bound of the acceleration proves that it is the first event. Everything
else goes to `fpk_rocking.physics.motion.transition.advance`.
"""

import math
from typing import NamedTuple

import numpy as np

from fpk_rocking.base.jit import kernel
from fpk_rocking.base.lanes import WIDTH, load, spread, store, total
from fpk_rocking.base.stack import scratch
from fpk_rocking.physics.motion import TERMS
from fpk_rocking.physics.motion.crossing import LEAST_SPEED, bend_bounds, meet, stays
from fpk_rocking.physics.motion.slender import force_segment
from fpk_rocking.physics.motion.transition import advance, record

NODES = WIDTH

_MOST, _ENOUGH = 12, 1e-24
"""Most rounds of the iteration. It ends when the next would change an acceleration, times the duration, by less than
the root of the second.
"""

_FIRST = 1e-4
"""Square of what a first round is sure to gain."""

_TURN = 1e-5
"""Largest sum of squares of the turns from the first guess for which its sine and cosine are those of their series."""

_NEAR = 1e-6
"""Part of a flight by which an impact may lie beside the root that was found on its polynomial."""


def _tables():
    """Return the points c of [0, 1], the double integrals up to them [j, i] of the polynomials that are 1 at one point,
    their double and single integrals to 1, and their coefficients [j, k] on [-1, 1].
    """
    points, weights = np.polynomial.legendre.leggauss(NODES)
    lagrange = np.linalg.inv(np.polynomial.legendre.legvander(points, NODES - 1)).T
    twice = np.array([np.polynomial.legendre.legint(row, 2, lbnd=-1) for row in lagrange])
    inner = 0.25 * np.polynomial.legendre.legval(points, twice.T)
    places = 0.5 * (1.0 + points)
    monomials = [np.polynomial.legendre.leg2poly(row) for row in lagrange]
    return places, inner, 0.5 * weights * (1.0 - places), 0.5 * weights, np.array(monomials)


PLACES, _INNER, _FAR, _WEIGHTS, _MONOMIALS = _tables()

_POINTS = np.stack(
    [
        PLACES,
        _FAR,
        _WEIGHTS,
        1.0 / ((np.arange(NODES) + 1.0) * (np.arange(NODES) + 2.0)),
        np.eye(NODES)[0],
        np.eye(NODES)[-1],
    ]
)


class Cruise(NamedTuple):
    """Tables for flights over one duration: those without force, and what it adds, by the values of it at the points.

    `points` (4, NODES): cosh and sinh at the points; angle and velocity at the end by the value at a point. `inner`
    (NODES, NODES) [j, i]: angle at point i by the value at point j. `cosh`, `sinh`: at the end.
    """

    points: np.ndarray
    inner: np.ndarray
    cosh: float
    sinh: float


def cruise_tables(span: float) -> Cruise:
    """Return the `Cruise` of a duration."""
    points, weights = np.polynomial.legendre.leggauss(24)
    ends, parts = span * np.append(PLACES, 1.0), 0.5 * (1.0 + points)
    lagrange = np.array([[_lagrange(j, end / span * parts) for end in ends] for j in range(NODES)])
    left = ends[:, None] * (1.0 - parts)
    weights = 0.5 * weights * ends[:, None]
    angle = np.einsum("jip,ip->ji", lagrange, weights * np.sinh(left))
    velocity = np.einsum("jp,p->j", lagrange[:, -1], (weights * np.cosh(left))[-1])
    rows = np.stack([np.cosh(ends[:-1]), np.sinh(ends[:-1]), angle[:, -1], velocity])
    return Cruise(rows, angle[:, :-1].copy(), math.cosh(span), math.sinh(span))


def _lagrange(j, places):
    """Polynomial that is 1 at point j and 0 at the others, at places of [0, 1]."""
    others = np.delete(PLACES, j)
    return np.prod((places[:, None] - others) / (PLACES[j] - others), axis=1)


def _economized(start):
    """Return coefficients in φ² of sin φ/φ (start 1) or cos φ (0), right to 1e-16 for |φ| <= π/2."""
    terms, most = 9, (0.5 * math.pi) ** 2
    angles = np.sqrt(0.5 * most * (1.0 + np.cos(np.pi * (np.arange(terms) + 0.5) / terms)))
    values = np.sin(angles) / angles if start else np.cos(angles)
    fit = np.polynomial.Chebyshev.fit(angles**2, values, terms - 1, domain=[0.0, most])
    return tuple(float(c) for c in fit.convert(kind=np.polynomial.Polynomial).coef)


S0, S1, S2, S3, S4, S5, S6, S7, S8 = _economized(1)
C0, C1, C2, C3, C4, C5, C6, C7, C8 = _economized(0)

_polynomials = scratch(2, TERMS)

_BEND = np.array([k * (k - 1.0) if k > 2 else 0.0 for k in range(TERMS)])


@kernel(fastmath={"contract"}, forceinline=True, borrows=True)
def integrals(m, a):
    """Sum of the rows of a table (NODES, NODES), times eight numbers."""
    one = load(m, 0) * spread(a, 0) + load(m, 1) * spread(a, 1)
    two = load(m, 2) * spread(a, 2) + load(m, 3) * spread(a, 3)
    three = load(m, 4) * spread(a, 4) + load(m, 5) * spread(a, 5)
    return (one + two) + (three + (load(m, 6) * spread(a, 6) + load(m, 7) * spread(a, 7)))


@kernel(fastmath={"contract"}, forceinline=True, borrows=True)
def _iterate(table, factor, base, own, near, force, square, alpha):
    """Find the accelerations at the points of a flight from a guess `near` of u - 1 there.

    The angles u - 1 are `base` and `factor` times the integrals, by the `table`, of the accelerations less `own` times
    the angles. Return these, the accelerations, and whether the iteration has come to its end.
    """
    # The acceleration as a Taylor polynomial about the guess.
    turn = alpha * alpha
    q = turn * (near * near)
    qq = q * q
    r = qq * qq
    sine = near * ((S0 + q * S1) + qq * (S2 + q * S3) + r * ((S4 + q * S5) + qq * (S6 + q * S7) + r * S8))
    cosine = (C0 + q * C1) + qq * (C2 + q * C3) + r * ((C4 + q * C5) + qq * (C6 + q * C7) + r * C8)
    one, two = sine + force * cosine, cosine - turn * (force * sine)
    three, four = (-0.5 * turn) * one, (-turn / 6.0) * two
    five = (-turn / 12.0) * three
    bend, pull, last, ratio = one, one - own * near, 0.0, _FIRST
    for _ in range(_MOST):
        off = (base - near) + factor * integrals(table, pull)
        away = off * off
        bend = (one + off * two) + away * ((three + off * four) + away * five)
        new = bend - own * (near + off)
        shift = new - pull
        change, pull = total(shift * shift), new
        if last > 0.0:
            ratio = change / last
        if change * ratio * square <= _ENOUGH:
            return pull, bend, turn * total(away) < _TURN
        last = change
    return pull, bend, False


@kernel(fastmath={"contract"}, forceinline=True, borrows=True)
def cruise(u, w, force, tables, span, block):
    """Carry a flight over the duration of tables; as `fly`."""
    alpha, y = block.critical_angle, u - 1.0
    later = alpha * (y + span / 3.0 * w)
    cosh = load(tables.points, 0)
    base = cosh * y + load(tables.points, 1) * w
    near = base + (cosh - 1.0) * (-alpha * alpha * y * y * y / 6.0)
    near = near + (1.0 - 0.5 * later * later) * integrals(tables.inner, force)
    pull, bend, found = _iterate(tables.inner, 1.0, base, 1.0, near, force, span * span, alpha)
    y, w = tables.cosh * y + tables.sinh * w, tables.sinh * y + tables.cosh * w
    return 1.0 + y + total(load(tables.points, 2) * pull), w + total(load(tables.points, 3) * pull), bend, found


@kernel(fastmath={"contract"}, forceinline=True, borrows=True)
def fly(u, w, force, span, block, near):
    """Carry a flight over a time.

    Parameters
    ----------
    u, w : float
        Folded angle and velocity at its begin.
    force : Lanes
        Folded force s f at the points.
    span : float
        The time.
    block : Body
    near : Lanes
        A guess of u - 1 at the points.

    Returns
    -------
    u, w, bend, found : float, float, Lanes, bool
        State at the end, u'' at the points, and whether the iteration has come to its end.
    """
    y, slope, square = u - 1.0, span * w, span * span
    base = y + slope * load(_POINTS, 0)
    _, bend, found = _iterate(_INNER, square, base, 0.0, near, force, square, block.critical_angle)
    return u + slope + square * total(load(_POINTS, 1) * bend), w + span * total(load(_POINTS, 2) * bend), bend, found


@kernel(fastmath={"contract"}, forceinline=True, borrows=True)
def _guess(u, w, begin, end, span):
    """Guess of u - 1 at the points, for an acceleration linear in time, from the force at the first and last of them."""
    y, slope, square, c = u - 1.0, span * w, span * span, load(_POINTS, 0)
    bend = 0.5 * square * (y + begin)
    twist = (square * (y + slope + end) - 2.0 * bend) / 6.0
    return y + c * (slope + c * (bend + c * twist))


@kernel(fastmath={"contract"}, forceinline=True, borrows=True)
def _value(coefficients, first, t):
    """Value of a polynomial of TERMS coefficients, from number `first` down to 0, at eight times."""
    value = t * 0.0
    for k in range(first, -1, -1):
        value = value * t + coefficients[k]
    return value


@kernel(fastmath={"contract"}, forceinline=True, borrows=True)
def _expand(u, w, span, bend, scratch, angle):
    """Write u as a polynomial in the time since the flight's middle, in halves of its duration."""
    half = 0.5 * span
    store(scratch, 1, (half * half) * (load(_POINTS, 3) * integrals(_MONOMIALS, bend)))
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


@kernel(forceinline=True, borrows=True)
def _without_begin(angle, quotient):
    """Write the polynomial divided by the time since the flight's begin, where it is 0."""
    value = 0.0
    for k in range(TERMS - 1, 0, -1):
        value = angle[k] - value
        quotient[k - 1] = value
    quotient[TERMS - 1] = 0.0


@kernel(borrows=True)
def through(force, half, x, v, side, start, end, block, impacts, origin):
    """Carry an exact block through a part of an interval: as `transition.advance`, and as right.

    Parameters
    ----------
    force : ndarray (TERMS,)
        Coefficients of the force.
    half : float
        Largest |t| for which it is used.
    x, v, side, start, end, block, impacts, origin
        As of `advance`; times are those of the polynomial.

    Returns
    -------
    x, v, side, time : float, float, int, float
        As of `advance`.
    """
    work = _polynomials()
    angle, quotient, places = work[0], work[1], load(_POINTS, 0)
    while side != 0 and start < end:
        u, w, span = side * x, side * v, end - start
        push = side * _value(force, TERMS - 1, start + span * places)
        near = _guess(u, w, total(push * load(_POINTS, 4)), total(push * load(_POINTS, 5)), span)
        last, speed, bend, found = fly(u, w, push, span, block, near)
        if not found:
            break
        _expand(u, w, span, bend, work, angle)
        fall, rise = bend_bounds(angle, _BEND)
        if last > 0.0 and stays(u, last, 4.0, rise, fall, block.cutoff):
            return side * last, side * speed, side, end
        if last > 0.0 or u < 0.0 or (u == 0.0 and w <= 0.0):
            break
        if u == 0.0:
            _without_begin(angle, quotient)
            place, slope = meet(quotient, 1.0)
        else:
            place, slope = meet(angle, 1.0)
        square = (place + 1.0) ** 2
        if not (slope < 0.0 and u >= rise * square and u + 0.25 * fall * square < block.cutoff):
            break
        time = 0.5 * (place + 1.0) * span
        push = side * _value(force, TERMS - 1, start + time * places)
        near = _value(angle, NODES + 1, (place + 1.0) * places - 1.0) - 1.0
        rest, speed, bend, found = fly(u, w, push, time, block, near)
        late = -rest / speed
        if not (found and abs(late) < _NEAR * span and -block.restitution * speed > LEAST_SPEED):
            break
        speed += late * total(bend * load(_POINTS, 5))
        start += time + late
        if impacts is not None:
            record(impacts, origin + start, side * speed)
        x, v, side = 0.0, block.restitution * side * speed, -side
    if start >= end:
        return x, v, side, end
    return advance(x, v, side, force_segment(force, half), start, end, block, impacts, origin)
