"""Tables and tuned numbers of flights by Gauss-Legendre collocation (`collocation`)."""

import math
from typing import NamedTuple

import numpy as np

from fpk_rocking.base.arrays import WIDTH
from fpk_rocking.base.basis import gauss_legendre

NODES = WIDTH


def _collocation():
    """Return Gauss points c (NODES,) of [0, 1], and tables of the polynomials that are 1 at one of them, 0 at others.

    The tuple is c; the polynomials' double integrals from 0 up to the points, (NODES, NODES) [polynomial, point]; their
    coefficients on [-1, 1], lowest power first, (NODES, NODES) [polynomial, power]; and six rows (6, NODES): c, the
    double and the single integral to 1, 1/((k + 1)(k + 2)), and the unit vectors of the first and the last point.
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

    `points` (4, NODES): cosh and sinh of the time at the Gauss points; angle and velocity at the end that a unit value
    of a at a point adds. `inner` (NODES, NODES) [j, i]: angle at point i by the value at point j. `cosh`, `sinh`: at
    the end.
    """

    points: np.ndarray
    inner: np.ndarray
    cosh: float
    sinh: float


def flight_tables(span: float) -> FlightTables:
    """Return the `FlightTables`, a named tuple of arrays over the Gauss points, of flights of the duration `span`.

    The duration is nondimensional.
    """
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
    """Return values (n,), at `places` (n,) of [0, 1], of the polynomial that is 1 at `PLACES[j]`, 0 at the others."""
    others = np.delete(PLACES, j)
    return np.prod((places[:, None] - others) / (PLACES[j] - others), axis=1)


def _economized(start):
    """Return 9 polynomial coefficients, a tuple, lowest power of φ² first, of sin φ/φ (`start` 1) or cos φ (`start` 0).

    They are right to 1e-16 for |φ| <= π/2.
    """
    terms, most = 9, (0.5 * math.pi) ** 2
    angles = np.sqrt(0.5 * most * (1.0 + np.cos(np.pi * (np.arange(terms) + 0.5) / terms)))
    values = np.sin(angles) / angles if start else np.cos(angles)
    fit = np.polynomial.Chebyshev.fit(angles**2, values, terms - 1, domain=[0.0, most])
    return tuple(float(c) for c in fit.convert(kind=np.polynomial.Polynomial).coef)


SINE, COSINE = _economized(1), _economized(0)


class Tuning(NamedTuple):
    """Tuned numbers of the iteration for the accelerations of an exact flight; nondimensional."""

    collocation_change: float = 1e-24
    """Square of an acceleration, times the duration, that the next round may still change."""
    collocation_turn: float = 1e-5
    """Largest sum of squares of the turns from the first guess for which a series has their sine and cosine."""


TUNING = Tuning()
