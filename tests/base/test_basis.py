"""Quadrature rules, bases and the cell search, held against exact integrals and scipy."""

import math

import numpy as np
import pytest
from scipy.stats import binom

from fpk_rocking.base.basis import (
    bernstein_basis,
    find_cells,
    gauss_hermite,
    gauss_hermite_product,
    gauss_legendre,
    legendre_at_gauss_points,
    legendre_basis,
    locate,
)


def test_rules_are_exact_to_their_degree_and_no_further():
    for interval in ((0.0, 1.0), (-1.0, 1.0), (2.0, 5.0)):
        points, weights = gauss_legendre(4, *interval)
        for power in range(8):
            expected = (interval[1] ** (power + 1) - interval[0] ** (power + 1)) / (power + 1)
            assert weights @ points**power == pytest.approx(expected, rel=1e-13, abs=1e-15)
    nodes, weights = gauss_hermite(4)
    moments = [1.0, 0.0, 1.0, 0.0, 3.0, 0.0, 15.0, 0.0]
    assert [weights @ nodes**power for power in range(8)] == pytest.approx(moments, abs=1e-13)
    assert weights @ nodes**8 != pytest.approx(105.0, rel=0.1)


def test_a_product_rule_has_the_second_node_fastest():
    (x, u), (y, w) = gauss_hermite(3), gauss_hermite(2)
    nodes, weights = gauss_hermite_product(3, 2)
    assert nodes.tolist() == [[a, b] for a in x for b in y]
    assert weights == pytest.approx(np.outer(u, w).ravel(), rel=1e-14)


def test_legendre_polynomials_are_orthonormal_on_the_unit_interval():
    values, weights = legendre_at_gauss_points(7, 5), gauss_legendre(7)[1]
    assert np.abs((values.T * weights) @ values - np.eye(6)).max() < 1e-13
    assert legendre_basis(1.0, 2) == pytest.approx([1.0, math.sqrt(3.0), math.sqrt(5.0)])
    assert legendre_basis(np.zeros((2, 3)), 4).shape == (2, 3, 5)


def test_bernstein_polynomials_are_binomial_probabilities():
    points = np.linspace(0.0, 1.0, 7)
    expected = binom.pmf(np.arange(6)[:, None], 5, points)
    assert np.abs(bernstein_basis(points, 5) - expected).max() < 1e-14


def test_cells_of_points_on_lines_and_beyond_the_mesh():
    lines = np.array([0.0, 1.0, 3.0, 7.0])
    points = np.array([-1.0, 0.0, 0.5, 1.0, 3.0, 7.0, 9.0])
    assert find_cells(lines, points).tolist() == [0, 0, 0, 1, 2, 2, 2]
    assert find_cells(lines, points, side="left").tolist() == [0, 0, 0, 0, 1, 2, 2]
    cells, reference = locate(lines, points)
    assert cells.tolist() == [0, 0, 0, 1, 2, 2, 2]
    assert reference.tolist() == [-1.0, 0.0, 0.5, 0.0, 0.0, 1.0, 1.5]
