"""Nodes of a filter's states: transition matrices, weights beyond lift-off, and piecewise constant noise."""

import math

import filter_formulas as formulas
import numpy as np
import pytest
from scipy import integrate, special

from fpk_rocking import (
    Block,
    FilteredNoise,
    Harmonic,
    Scene,
)
from fpk_rocking.density.filter_nodes import Nodes, node_spacing
from fpk_rocking.physics.noise.state_space import transition_and_factor

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
def test_the_transition_between_near_nodes_is_of_fourth_order(noise):
    """The mean of cos y1 after a lag, known in closed form; up to the third moment it is exact."""
    errors, lag, spacings = [], 0.1, (0.5, 0.35, 0.25)
    for spacing in spacings:
        nodes = Nodes(noise, (round(18.0 / spacing) + 1, 5), spacing)
        phi, factor = transition_and_factor(nodes.drift, nodes.input, lag)
        means = (nodes.states.reshape(-1, 2)[:, : len(phi)] @ phi.T)[:, 0]
        spread, inner = factor[0] @ factor[0], np.abs(means) < 3.0
        matrix, y = nodes.transition_matrix(lag), nodes.states[..., 0].ravel()
        assert matrix.sum(axis=0) == pytest.approx(np.ones(y.size), abs=1e-12)
        for power, exact_moment in enumerate((means, means**2 + spread, means**3 + 3.0 * means * spread), 1):
            assert (y**power @ matrix)[inner] == pytest.approx(
                exact_moment[inner], abs=1e-6
            )  # of what is beyond 6 deviations
        errors.append(np.std((np.cos(y) @ matrix - np.cos(means) * np.exp(-0.5 * spread))[inner]))
    assert np.polyfit(np.log(spacings), np.log(errors), 1)[0] == pytest.approx(4.0, abs=0.15)


@pytest.mark.parametrize("force", [-0.8, 0.0, 0.45, 0.99, 1.7])
def test_nodes_weigh_what_the_noise_lifts_off(force):
    """The level is half way between two nodes, and those on one side of it have the probability of that side."""
    noise = FilteredNoise("exponential", 0.04, 5.0)
    scene = Scene(Block(0.5), Harmonic(abs(force), 5.0, 0.0 if force < 0.0 else math.pi), noise)
    count, spacing = node_spacing(scene, 0.5)
    nodes = Nodes(noise, (count,), spacing)
    places = (1.0 - abs(force)) / (0.2 * spacing) + 0.5 * (count - 1)
    beyond = nodes.weights[np.abs(scene.forcing.value(0.0) + nodes.values) > 1.0].sum()
    ends = [special.ndtr((end - scene.forcing.value(0.0)) / 0.2) for end in (-1.0, 1.0)]
    assert beyond == pytest.approx(1.0 - (ends[1] - ends[0]), abs=0.003 if force != 0.99 else 0.02)
    assert 0.25 < spacing <= 0.5
    assert nodes.states[-1, 0, 0] >= 5.0
    assert places % 1.0 == pytest.approx(0.5, abs=1e-9 if force != 0.99 else 0.2)


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
