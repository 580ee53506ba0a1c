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
from fpk_rocking.base.stack import scratch
from fpk_rocking.physics.motion import TERMS
from fpk_rocking.physics.motion.crossing import LEAST_SPEED, bend_bounds, meet, stays
from fpk_rocking.physics.motion.slender import force_segment
from fpk_rocking.physics.motion.transition import advance, record

NODES = 8

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


class Cruise(NamedTuple):
    """Tables for flights over one duration: those without force, and what it adds, by the values of it at the points.

    `cosh`, `sinh` (NODES + 1,): at the points and the end. `inner` (NODES, NODES) [j, i]: angle at point i from the
    value at point j. `angle`, `velocity` (NODES,): at the end.
    """

    cosh: np.ndarray
    sinh: np.ndarray
    inner: np.ndarray
    angle: np.ndarray
    velocity: np.ndarray


def cruise_tables(span: float) -> Cruise:
    """Return the `Cruise` of a duration."""
    points, weights = np.polynomial.legendre.leggauss(24)
    ends, parts = span * np.append(PLACES, 1.0), 0.5 * (1.0 + points)
    lagrange = np.array([[_lagrange(j, end / span * parts) for end in ends] for j in range(NODES)])
    left = ends[:, None] * (1.0 - parts)
    weights = 0.5 * weights * ends[:, None]
    angle = np.einsum("jip,ip->ji", lagrange, weights * np.sinh(left))
    velocity = np.einsum("jp,p->j", lagrange[:, -1], (weights * np.cosh(left))[-1])
    return Cruise(np.cosh(ends), np.sinh(ends), angle[:, :-1].copy(), angle[:, -1].copy(), velocity)


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

_places = scratch(6, NODES)
_rows = scratch(3, NODES)
_polynomials = scratch(2, TERMS)

_BEND = np.array([k * (k - 1.0) if k > 2 else 0.0 for k in range(TERMS)])


@kernel(fastmath={"contract"}, forceinline=True, borrows=True)
def _expand_about(near, force, alpha, own, one, two, three, four, pull):
    """Write the Taylor coefficients of the acceleration about a guess of y at the points, and it less `own` y."""
    square = alpha * alpha
    for i in range(NODES):
        z = near[i]
        q = square * z * z
        qq = q * q
        r = qq * qq
        s = (S0 + q * S1) + qq * (S2 + q * S3) + r * ((S4 + q * S5) + qq * (S6 + q * S7) + r * S8)
        c = (C0 + q * C1) + qq * (C2 + q * C3) + r * ((C4 + q * C5) + qq * (C6 + q * C7) + r * C8)
        s *= z
        value, slope = s + force[i] * c, c - square * force[i] * s
        one[i] = value
        two[i] = slope
        three[i] = -0.5 * square * value
        four[i] = -square / 6.0 * slope
        pull[i] = value - own * z


# In one expression, and without leave to reorder it: a chain of sums would take twice the time.
@kernel(fastmath={"contract"}, forceinline=True, borrows=True)
def _sum(m, i, a, b, c, d, e, f, g, h):
    """Product of row i of a table (NODES, NODES) [j, i] with the values at the points."""
    first = (m[0, i] * a + m[1, i] * b) + (m[2, i] * c + m[3, i] * d)
    return first + ((m[4, i] * e + m[5, i] * f) + (m[6, i] * g + m[7, i] * h))


@kernel(fastmath={"contract", "reassoc"}, forceinline=True, borrows=True)
def _round(table, factor, base, own, alpha, near, one, two, three, four, pull, bend):
    """Take a round of the iteration: write accelerations at the points; return squares of changes and of turns."""
    a, b, c, d, e, f, g, h = pull[0], pull[1], pull[2], pull[3], pull[4], pull[5], pull[6], pull[7]
    change, turn = 0.0, 0.0
    for i in range(NODES):
        off = (base[i] - near[i]) + factor * _sum(table, i, a, b, c, d, e, f, g, h)
        square = off * off
        q = alpha * alpha * square
        value = (one[i] + off * two[i]) + square * ((three[i] + off * four[i]) - q * three[i] / 12.0)
        bend[i] = value
        value -= own * (near[i] + off)
        shift = value - pull[i]
        change += shift * shift
        turn += q
        pull[i] = value
    return change, turn


@kernel(fastmath={"contract"}, forceinline=True, borrows=True)
def _iterate(table, factor, base, own, near, force, square, alpha, pull, bend):
    """Find the accelerations at the points of a flight, from a guess of its angles; tell whether that worked.

    The angles are `base` and `factor` times the `table` of what is written into `pull`: the accelerations less `own`
    times the angles. `bend` becomes the accelerations.
    """
    rows, last, ratio = _places(), 0.0, _FIRST
    one, two, three, four = rows[0], rows[1], rows[2], rows[3]
    _expand_about(near, force, alpha, own, one, two, three, four, pull)
    for _ in range(_MOST):
        change, turn = _round(table, factor, base, own, alpha, near, one, two, three, four, pull, bend)
        if last > 0.0:
            ratio = change / last
        if change * ratio * square <= _ENOUGH:
            return turn < _TURN
        last = change
    return False


@kernel(fastmath={"contract", "reassoc"}, forceinline=True, borrows=True)
def _dot(weights, values):
    total = 0.0
    for i in range(NODES):
        total += weights[i] * values[i]
    return total


@kernel(fastmath={"contract"}, forceinline=True, borrows=True)
def cruise(u, w, force, tables, span, block, bend):
    """Carry a flight over the duration of tables; as `fly`."""
    rows, alpha, y = _places(), block.critical_angle, u - 1.0
    base, near, pull = rows[0], rows[1], rows[2]
    a, b, c, d, e, f, g, h = force[0], force[1], force[2], force[3], force[4], force[5], force[6], force[7]
    later = alpha * (y + span / 3.0 * w)
    less, fall = 1.0 - 0.5 * later * later, -alpha * alpha * y * y * y / 6.0
    for i in range(NODES):
        base[i] = tables.cosh[i] * y + tables.sinh[i] * w
        near[i] = base[i] + (tables.cosh[i] - 1.0) * fall + less * _sum(tables.inner, i, a, b, c, d, e, f, g, h)
    found = _iterate(tables.inner, 1.0, base, 1.0, near, force, span * span, alpha, pull, bend)
    y, w = tables.cosh[NODES] * y + tables.sinh[NODES] * w, tables.sinh[NODES] * y + tables.cosh[NODES] * w
    return 1.0 + y + _dot(tables.angle, pull), w + _dot(tables.velocity, pull), found


@kernel(fastmath={"contract"}, forceinline=True, borrows=True)
def fly(u, w, force, span, block, near, bend):
    """Carry a flight over a time.

    Parameters
    ----------
    u, w : float
        Folded angle and velocity at its begin.
    force : ndarray (NODES,)
        Folded force s f at the points.
    span : float
        The time.
    block : Body
    near : ndarray (NODES,)
        A guess of u - 1 at the points.
    bend : ndarray (NODES,)
        Filled with u'' at the points.

    Returns
    -------
    u, w, found : float, float, bool
        State at the end, and whether the iteration has come to its end.
    """
    rows, y, slope, square = _places(), u - 1.0, span * w, span * span
    base, pull = rows[0], rows[1]
    for i in range(NODES):
        base[i] = y + slope * PLACES[i]
    found = _iterate(_INNER, square, base, 0.0, near, force, square, block.critical_angle, pull, bend)
    return u + slope + square * _dot(_FAR, bend), w + span * _dot(_WEIGHTS, bend), found


@kernel(fastmath={"contract"}, forceinline=True, borrows=True)
def _guess(u, w, force, span, near):
    """Write a guess of u - 1 at the points: that of an acceleration linear in time."""
    y, slope, square = u - 1.0, span * w, span * span
    bend = 0.5 * square * (y + force[0])
    twist = (square * (y + slope + force[NODES - 1]) - 2.0 * bend) / 6.0
    for i in range(NODES):
        c = PLACES[i]
        near[i] = y + c * (slope + c * (bend + c * twist))


@kernel(fastmath={"contract", "reassoc"}, forceinline=True, borrows=True)
def _force_at(force, start, span, side, out):
    """Write the folded force at the points of a time."""
    for i in range(NODES):
        t, value = start + span * PLACES[i], 0.0
        for k in range(TERMS - 1, -1, -1):
            value = value * t + force[k]
        out[i] = side * value


@kernel(fastmath={"contract", "reassoc"}, forceinline=True, borrows=True)
def _expand(u, w, span, pull, angle):
    """Write u as a polynomial in the time since the flight's middle, in halves of its duration."""
    half = 0.5 * span
    for k in range(TERMS):
        angle[k] = 0.0
    low, rise = u, half * w
    for k in range(NODES):
        c = 0.0
        for j in range(NODES):
            c += _MONOMIALS[j, k] * pull[j]
        c *= half * half / ((k + 1) * (k + 2))
        angle[k + 2] = c
        sign = 1.0 - 2.0 * (k % 2)
        low -= sign * c
        rise += sign * (k + 2) * c
    angle[0], angle[1] = low + rise, rise


@kernel(forceinline=True, borrows=True)
def _without_begin(angle, quotient):
    """Write the polynomial divided by the time since the flight's begin, where it is 0."""
    value = 0.0
    for k in range(TERMS - 1, 0, -1):
        value = angle[k] - value
        quotient[k - 1] = value
    quotient[TERMS - 1] = 0.0


@kernel(fastmath={"contract"}, forceinline=True, borrows=True)
def _guess_on(angle, end, near):
    """Write a guess of u - 1 at the points of a flight's part up to a place: that on the flight's polynomial."""
    for i in range(NODES):
        m, value = PLACES[i] * (end + 1.0) - 1.0, 0.0
        for k in range(NODES + 1, -1, -1):
            value = value * m + angle[k]
        near[i] = value - 1.0


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
    rows, polynomials = _rows(), _polynomials()
    push, bend, near, angle, quotient = rows[0], rows[1], rows[2], polynomials[0], polynomials[1]
    while side != 0 and start < end:
        u, w, span = side * x, side * v, end - start
        _force_at(force, start, span, side, push)
        _guess(u, w, push, span, near)
        last, speed, found = fly(u, w, push, span, block, near, bend)
        if not found:
            break
        _expand(u, w, span, bend, angle)
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
        _force_at(force, start, time, side, push)
        _guess_on(angle, place, near)
        rest, speed, found = fly(u, w, push, time, block, near, bend)
        late = -rest / speed
        if not (found and abs(late) < _NEAR * span and -block.restitution * speed > LEAST_SPEED):
            break
        speed += late * bend[NODES - 1]
        start += time + late
        if impacts is not None:
            record(impacts, origin + start, side * speed)
        x, v, side = 0.0, block.restitution * side * speed, -side
    if start >= end:
        return x, v, side, end
    return advance(x, v, side, force_segment(force, half), start, end, block, impacts, origin)
