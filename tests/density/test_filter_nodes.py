"""Nodes of a filter's states: transition matrices, weights beyond lift-off, and piecewise constant noise."""

import math

import filter_formulas as formulas
import numpy as np
import pytest
from scipy import integrate, special

from fpk_rocking import FilteredNoise
from fpk_rocking.density.filter_nodes import Nodes, RestNodes

NOISES = (
    FilteredNoise("exponential", 0.03, 2.0),
    FilteredNoise("low-pass", 0.04, 6.0, 0.7),
    FilteredNoise("kanai-tajimi", 0.05, 4.0, 0.5),
)


KINDS = pytest.mark.parametrize("noise", NOISES, ids=lambda noise: noise.filter)


@KINDS
def test_the_transition_matrix_keeps_mass_and_has_the_law_of_the_filter(noise):
    nodes, lag = Nodes(noise, (7, 6)), 0.13
    matrix, weights = nodes.transition_matrix(lag), nodes.weights.ravel()
    assert matrix.sum(axis=0) == pytest.approx(np.ones(len(weights)), abs=1e-12)
    assert matrix @ weights == pytest.approx(weights, abs=1e-13)
    eta = np.repeat(nodes.values, nodes.weights.shape[1])
    later, joint = np.linalg.matrix_power(matrix, 3), formulas.autocovariance(noise, 3 * lag)
    assert eta @ later @ (eta * weights) == pytest.approx(joint, abs=1e-12)
    # Fourth moment of a Gaussian pair (Isserlis).
    assert eta**2 @ later @ (eta**2 * weights) == pytest.approx(noise.variance**2 + 2.0 * joint**2, abs=1e-12)


@KINDS
def test_the_transition_of_the_lattice_is_of_third_order_or_better(noise):
    """The mean of cos y1 after a lag, known in closed form; up to the third moment it is exact."""
    errors, lag, spacings = [], 0.1, (0.5, 0.35, 0.25)
    for spacing in spacings:
        nodes = Nodes(noise, (5, 5))
        lattice, (phi, factor) = RestNodes(nodes, spacing), nodes.transition(lag)
        y = np.repeat(lattice.values, lattice.weights.shape[1])
        means = phi[0, 0] * y + phi[0, 1] * np.tile(lattice.beside, len(lattice.values))
        spread, inner = factor[0] @ factor[0], np.abs(means) < 1.2
        matrix = lattice.transition_matrix(lag)
        assert matrix.sum(axis=0) == pytest.approx(np.ones(y.size), abs=1e-12)
        for power, exact_moment in enumerate((means, means**2 + spread, means**3 + 3.0 * means * spread), 1):
            assert (y**power @ matrix)[inner] == pytest.approx(exact_moment[inner], abs=1e-4)  # beyond the lattice
        errors.append(np.std((np.cos(y) @ matrix - np.cos(means) * np.exp(-0.5 * spread))[inner]))
    assert np.polyfit(np.log(spacings), np.log(errors), 1)[0] > 3.4
    assert errors[-1] < 3e-5


@KINDS
def test_mass_that_is_lifted_off_or_comes_to_rest_keeps_the_moments_that_nodes_know(noise):
    nodes = Nodes(noise, (5, 4))
    lattice, shape = RestNodes(nodes, 0.25), nodes.weights.shape
    resting = lattice.weights.sum(axis=0)
    lifted = lattice.lifted(1.3, resting)
    for power in range(5):
        assert (nodes.states[..., 0] ** power * lifted).sum() == pytest.approx(1.3**power, rel=1e-6)
    masses = nodes.weights * np.arange(1.0, 1.0 + nodes.weights.size).reshape(shape)
    rested = lattice.rested(masses)
    assert rested.sum() == pytest.approx(masses.sum(), rel=1e-13)
    for power in range(1, 5):
        expected = (nodes.states[..., 0] ** power * masses).sum()
        assert lattice.values**power @ rested.sum(axis=1) == pytest.approx(expected, abs=2e-3 * 10.0 * masses.sum())


@pytest.mark.parametrize("level", [-2.13, -0.14, 0.0, 0.66, 3.27])
def test_parts_of_the_lattice_beyond_a_level_weigh_what_the_noise_does(level):
    lattice = RestNodes(Nodes(FilteredNoise("exponential", 0.04, 5.0), (5,)), 0.2)
    below, above = (lattice.parts_between(*ends) for ends in ((-math.inf, level), (level, math.inf)))
    assert below[0] + above[0] == pytest.approx(np.ones(len(lattice.values)), abs=1e-12)
    assert below[0] @ lattice.weights[:, 0] == pytest.approx(special.ndtr(level), abs=1e-3)
    assert below[1][below[0] > 0.0].max() < level < above[1][above[0] > 0.0].min()


@KINDS
def test_piecewise_constant_noise_has_the_melnikov_variance(noise):
    nodes, step = Nodes(noise, (2, 2)), 0.3
    factor = nodes.piecewise_constant_factor(step)

    def weighed(lag):
        place = abs(lag) / step
        low, part = math.floor(place), place - math.floor(place)
        held = [formulas.autocovariance(noise, k * step) for k in (low, low + 1)]
        return ((1.0 - part) * held[0] + part * held[1]) * (1.0 + abs(lag)) * math.exp(-abs(lag))

    variance = sum(2.0 * integrate.quad(weighed, k * step, (k + 1) * step)[0] for k in range(130))
    assert factor**2 * variance == pytest.approx(formulas.melnikov_variance(noise), rel=1e-9)
