"""The interpolant of a band-limited signal against the sum of harmonics itself."""

import math

import numpy as np
import pytest

from fpk_rocking.physics.motion import TERMS
from fpk_rocking.physics.noise.band import (
    OVERSAMPLING,
    WIDTH,
    evaluate_compensation,
    interpolant_polynomials,
    window_compensation,
)


def errors(frequencies, weights, phases, spacing, intervals=100):
    """Largest errors of value and slope of the interpolant over some intervals, the first beginning at 0."""
    bound = np.pi / (OVERSAMPLING * spacing)
    gains = np.array([evaluate_compensation(window_compensation(), frequency / bound) for frequency in frequencies])
    times = spacing * (np.arange(intervals + WIDTH) - WIDTH // 2 + 1)
    samples = np.cos(np.outer(times, frequencies) + phases) @ (weights * gains)
    shapes, place = interpolant_polynomials(spacing), spacing * np.linspace(-0.5, 0.5, 11)
    worst = np.zeros(2)
    for k in range(intervals):
        polynomial = np.polynomial.Polynomial(samples[k : k + WIDTH] @ shapes)
        angle = np.outer(spacing * (k + 0.5) + place, frequencies) + phases
        value, slope = np.cos(angle) @ weights, -np.sin(angle) @ (weights * frequencies)
        worst = np.maximum(worst, [abs(polynomial(place) - value).max(), abs(polynomial.deriv()(place) - slope).max()])
    return worst


@pytest.mark.parametrize(("low", "high", "variance"), [(0.0, 10.0, 0.04), (7.0, 12.0, 0.3), (0.0, 2.7, 0.3)])
def test_particular_solution_of_noise_is_right_to_1e_11(low, high, variance):
    rng = np.random.default_rng(7)
    for _ in range(5):
        frequencies, phases = rng.uniform(low, high, 100), rng.uniform(0.0, 2.0 * np.pi, 100)
        weights = math.sqrt(0.02 * variance) / (1.0 + frequencies**2)
        value, slope = errors(frequencies, weights, phases, np.pi / (OVERSAMPLING * high))
        assert value < 1e-12
        assert slope < 1e-11


@pytest.mark.parametrize(("share", "limit"), [(1.0, 4e-12), (0.9, 1e-12), (0.5, 1e-13), (0.0, 1e-13)])
def test_one_harmonic_is_right_up_to_the_edge_of_the_band(share, limit):
    frequency = np.array([share * np.pi / OVERSAMPLING])
    assert errors(frequency, np.ones(1), np.full(1, 0.3), 1.0)[0] < limit


def test_beyond_the_band_the_interpolant_is_wrong():
    """What the bound on the spacing is for: 20 % too coarse a grid costs four digits at least."""
    frequency = np.array([1.2 * np.pi / OVERSAMPLING])
    assert errors(frequency, np.ones(1), np.full(1, 0.3), 1.0)[0] > 1e-9


def test_neighbouring_pieces_join():
    shapes = interpolant_polynomials(0.3)
    assert shapes.shape == (WIDTH, TERMS)
    ends = np.polynomial.polynomial.polyval(np.array([-0.15, 0.15]), shapes.T)
    assert ends[1:, 1] == pytest.approx(ends[:-1, 0], abs=1e-14)
