"""Polynomial bases, quadrature rules and the cell search of one dimension: Legendre, Gauss-Hermite, Bernstein.

The shape functions of the density are products of the Legendre polynomials of this module. Cached arrays are not to be
written to.
"""

import functools
import math

import numpy as np


@functools.cache
def gauss_legendre(count, low=0.0, high=1.0):
    """Return Gauss-Legendre points, ascending, and weights on the interval from `low` to `high`, (count,) each."""
    points, weights = np.polynomial.legendre.leggauss(count)
    half = 0.5 * (high - low)
    return 0.5 * (low + high) + half * points, half * weights


@functools.cache
def gauss_hermite(count):
    """Return Gauss-Hermite nodes, ascending and in standard deviations, and weights of sum 1, (count,) each."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(count)
    return nodes, weights / weights.sum()


@functools.cache
def gauss_hermite_product(first, second):
    """Return nodes (first * second, 2) and weights of sum 1 of a product of two Gauss-Hermite rules."""
    (x, u), (y, w) = np.polynomial.hermite_e.hermegauss(first), np.polynomial.hermite_e.hermegauss(second)
    nodes = np.array([(a, b) for a in x for b in y])
    weights = np.outer(u, w).ravel()
    return nodes, weights / weights.sum()


def legendre_basis(points, degree):
    """Return values (..., degree + 1) of the Legendre polynomials, orthonormal on [0, 1], at points (...)."""
    points = np.asarray(points, dtype=float)
    values = np.polynomial.legendre.legvander(2.0 * points.ravel() - 1.0, degree)
    return (values * np.sqrt(2.0 * np.arange(degree + 1) + 1.0)).reshape(*points.shape, degree + 1)


@functools.cache
def legendre_at_gauss_points(count, degree):
    """Return values (count, degree + 1) of the Legendre polynomials, orthonormal on [0, 1], at its Gauss points."""
    return legendre_basis(gauss_legendre(count)[0], degree)


def bernstein_basis(points, degree):
    """Return values (degree + 1, n) of the Bernstein polynomials of a degree on [0, 1] at points (n,)."""
    return np.array([math.comb(degree, k) * points**k * (1.0 - points) ** (degree - k) for k in range(degree + 1)])


def find_cells(lines, points, side="right"):
    """Return the cells (...) between ascending mesh lines (n + 1,) that hold points (...); else the nearest.

    A point on a mesh line belongs to the cell above it for the side "right", to the one below it for "left".
    """
    return np.clip(np.searchsorted(lines, points, side=side) - 1, 0, len(lines) - 2)


def locate(lines, points):
    """Return (cells, places) of points (...): see `find_cells`; places in cells are from 0 to 1 but beyond the mesh."""
    cells = find_cells(lines, points)
    return cells, (points - lines[cells]) / (lines[cells + 1] - lines[cells])
