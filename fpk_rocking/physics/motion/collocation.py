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

import numpy as np

from fpk_rocking.base.jit import kernel
from fpk_rocking.base.stack import scratch
from fpk_rocking.physics.motion import TERMS
from fpk_rocking.physics.motion.crossing import LEAST_SPEED, bend_bounds, meet, stays
from fpk_rocking.physics.motion.slender import force_segment
from fpk_rocking.physics.motion.transition import advance, record

NODES = 8

_MOST, _ENOUGH = 12, 1e-13
"""Most rounds of the iteration, and the change of the acceleration that the next round would bring when it ends."""

_TURN = 1e-3
"""Largest square of a turn from the first guess for which its sine and cosine are those of their series."""

_NEAR = 1e-6
"""Part of a flight by which an impact may lie beside the root that was found on its polynomial."""


def _tables():
    """Return the points c of [0, 1], weights of the double integrals up to them [j, i], and of both integrals to 1.

    And the coefficients [j, k] of the polynomials that are 1 at one point, on [-1, 1].
    """
    points, weights = np.polynomial.legendre.leggauss(NODES)
    lagrange = np.linalg.inv(np.polynomial.legendre.legvander(points, NODES - 1)).T
    twice = np.array([np.polynomial.legendre.legint(row, 2, lbnd=-1) for row in lagrange])
    inner = 0.25 * np.polynomial.legendre.legval(points, twice.T)
    places = 0.5 * (1.0 + points)
    monomials = np.array([np.pad(part, (0, NODES - part.size)) for part in map(np.polynomial.legendre.leg2poly, lagrange)])
    return places, inner, 0.5 * weights * (1.0 - places), 0.5 * weights, monomials


PLACES, _INNER, _FAR, _WEIGHTS, _MONOMIALS = _tables()


def _economized(start):
    """Return coefficients in φ² of sin φ/φ (start 1) or cos φ (0), right to 1e-16 for |φ| <= π/2."""
    terms, most = 9, (0.5 * math.pi) ** 2
    angles = np.sqrt(0.5 * most * (1.0 + np.cos(np.pi * (np.arange(terms) + 0.5) / terms)))
    values = np.sin(angles) / angles if start else np.cos(angles)
    fit = np.polynomial.Chebyshev.fit(angles**2, values, terms - 1, domain=[0.0, most])
    return tuple(float(c) for c in fit.convert(kind=np.polynomial.Polynomial).coef)


S0, S1, S2, S3, S4, S5, S6, S7, S8 = _economized(1)
C0, C1, C2, C3, C4, C5, C6, C7, C8 = _economized(0)

_places = scratch(4, NODES)
_rows = scratch(2, NODES)
_polynomials = scratch(2, TERMS)

_BEND = np.array([k * (k - 1.0) if k > 2 else 0.0 for k in range(TERMS)])


@kernel(fastmath={"contract", "reassoc"}, forceinline=True, borrows=True)
def _guess(y, slope, bend, force, alpha, near, pull, stiff):
    """Write a first guess of y at the points, the acceleration there, and its derivative with respect to y."""
    for i in range(NODES):
        c = PLACES[i]
        z = y + c * (slope + c * bend)
        near[i] = z
        q = alpha * z
        q *= q
        s = z * (S0 + q * (S1 + q * (S2 + q * (S3 + q * (S4 + q * (S5 + q * (S6 + q * (S7 + q * S8))))))))
        c = C0 + q * (C1 + q * (C2 + q * (C3 + q * (C4 + q * (C5 + q * (C6 + q * (C7 + q * C8)))))))
        pull[i] = s + force[i] * c
        stiff[i] = c - alpha * alpha * force[i] * s


@kernel(fastmath={"contract", "reassoc"}, forceinline=True, borrows=True)
def fly(u, w, force, span, block, pull):
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
    pull : ndarray (NODES,)
        Filled with u'' at the points.

    Returns
    -------
    u, w, found : float, float, bool
        State at the end, and whether the iteration has come to its end.
    """
    rows, alpha, y, slope, square = _places(), block.critical_angle, u - 1.0, span * w, span * span
    near, first, stiff = rows[0], rows[1], rows[2]
    _guess(y, slope, 0.5 * square * (y + force[0]), force, alpha, near, first, stiff)
    for i in range(NODES):
        pull[i] = first[i]
    last, found = 1.0, False
    for _ in range(_MOST):
        a, b, c, d, e, f, g, h = pull[0], pull[1], pull[2], pull[3], pull[4], pull[5], pull[6], pull[7]
        change, turn = 0.0, 0.0
        for i in range(NODES):
            one = (_INNER[0, i] * a + _INNER[1, i] * b) + (_INNER[2, i] * c + _INNER[3, i] * d)
            two = (_INNER[4, i] * e + _INNER[5, i] * f) + (_INNER[6, i] * g + _INNER[7, i] * h)
            off = y + PLACES[i] * slope + square * (one + two) - near[i]
            q = alpha * off
            q *= q
            value = first[i] * (1.0 - q * (0.5 - q * (1.0 / 24.0 - q / 720.0)))
            value += stiff[i] * off * (1.0 - q * (1.0 / 6.0 - q * (1.0 / 120.0 - q / 5040.0)))
            change += abs(value - pull[i])
            turn = max(turn, q)
            pull[i] = value
        if change * change <= _ENOUGH * last:
            found = turn < _TURN
            break
        last = change
    x, v = 0.0, 0.0
    for i in range(NODES):
        x += _FAR[i] * pull[i]
        v += _WEIGHTS[i] * pull[i]
    return u + slope + square * x, w + span * v, found


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
    push, pull, angle, quotient = rows[0], rows[1], polynomials[0], polynomials[1]
    while side != 0 and start < end:
        u, w, span = side * x, side * v, end - start
        _force_at(force, start, span, side, push)
        last, speed, found = fly(u, w, push, span, block, pull)
        if not found:
            break
        _expand(u, w, span, pull, angle)
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
        rest, speed, found = fly(u, w, push, time, block, pull)
        late = -rest / speed
        if not (found and abs(late) < _NEAR * span and -block.restitution * speed > LEAST_SPEED):
            break
        speed += late * pull[NODES - 1]
        start += time + late
        if impacts is not None:
            record(impacts, origin + start, side * speed)
        x, v, side = 0.0, block.restitution * side * speed, -side
    if start >= end:
        return x, v, side, end
    return advance(x, v, side, force_segment(force, half), start, end, block, impacts, origin)
