"""Shinozuka noise: exact at late times, the law of the paper's equation (4), and its interpolant between samples."""

import functools
import itertools
import math
from fractions import Fraction

import numpy as np
import pytest
from scipy.stats import kstest, norm

from fpk_rocking.physics.motion import TERMS
from fpk_rocking.physics.noise import band
from fpk_rocking.physics.noise.band import (
    OVERSAMPLING,
    WIDTH,
    evaluate_compensation,
    interpolant_polynomials,
    window_compensation,
)
from fpk_rocking.scene import BandNoise, Block, Harmonic, Scene
from montecarlo.engines import rk4
from montecarlo.engines.band_noise import draw_start_and_noise
from montecarlo.engines.random import open_stream, stream_keys, uniform_pairs

VARIANCE, BAND = 0.04, (1.0, 6.0)


@functools.cache
def parameters_of(count, frequencies):
    """The engine's parameters for noise of a number of harmonics."""
    noise = BandNoise(VARIANCE, BAND, count, frequencies=frequencies)
    return rk4.parameters_of(Scene(Block(0.5), Harmonic(1.0, 2.7), noise), 8)


def draw(realization, half=1, count=100, frequencies="independent"):
    harmonics, parameters = band.allocate_realization(count, half), parameters_of(count, frequencies)
    draw_start_and_noise(open_stream(stream_keys(5), realization), parameters.start, parameters.band, harmonics)
    return harmonics


def exact(harmonics, cycles):
    """The sum at a rational number of cycles, phases reduced in rational arithmetic."""
    total = 0.0
    for ratio, phase, weight in zip(harmonics.ratios, harmonics.phases, harmonics.weights, strict=True):
        turns = (Fraction(ratio) * cycles + Fraction(phase)) % 1
        total += weight * math.cos(2.0 * math.pi * float(turns))
    return total


def test_independent_frequencies_are_those_of_the_random_numbers_themselves():
    """To the last bit, with equal amplitudes: the paper's scenes do not change."""
    drawn, numbers, phases = draw(7, count=96), *np.empty((2, 96))
    uniform_pairs(open_stream(stream_keys(5), 7), numbers, phases, 96)
    low, high = (2.0 * math.pi / 2.7 * frequency / (2.0 * math.pi) for frequency in BAND)
    assert np.array_equal(drawn.ratios, low + (high - low) * numbers)
    assert np.array_equal(drawn.phases, phases)
    assert np.array_equal(drawn.weights, np.full(96, math.sqrt(2.0 * VARIANCE / 96)))


def test_stratified_frequencies_are_one_in_each_part_of_the_band():
    count = 24
    drawn = [draw(number, count=count, frequencies="stratified").ratios * 2.7 for number in range(400)]
    places = (np.array(drawn) - BAND[0]) / (BAND[1] - BAND[0]) * count - np.arange(count)
    assert ((places >= 0.0) & (places < 1.0)).all()
    assert kstest(places.ravel(), "uniform").pvalue > 1e-3


@pytest.mark.parametrize("count", [1, *(pytest.param(count, marks=pytest.mark.slow) for count in (2, 8))])
def test_stratified_noise_is_gaussian_whatever_the_number_of_harmonics(count):
    """At one time and between two, of 20,000 realizations; false alarm 2e-3. Equal amplitudes fail with p < 1e-20."""
    drawn = [draw(number, count=count, frequencies="stratified") for number in range(20_000)]
    rates, phases, weights = (
        np.array([getattr(harmonics, name)[:count] for harmonics in drawn]) for name in ("ratios", "phases", "weights")
    )
    first, second = ((weights * np.cos(2.0 * math.pi * (rates * t + phases))).sum(axis=1) for t in (0.0, 0.15))
    assert kstest(first, norm(0.0, math.sqrt(VARIANCE)).cdf).pvalue > 1e-3
    lag, (low, high) = 0.15 * 2.0 * math.pi / 2.7, BAND
    covariance = VARIANCE * (math.sin(high * lag) - math.sin(low * lag)) / (lag * (high - low))
    products = first * second
    assert abs(products.mean() - covariance) < 3.3 * products.std() / math.sqrt(len(products))


def noise_at(harmonics, cycle, fraction):
    """The noise at a time given in cycles, as the centre of a chunk there."""
    band.set_centre(harmonics, cycle, fraction)
    return harmonics.cosines.sum()


@pytest.mark.parametrize("first", [0, 10_000])
@pytest.mark.parametrize(("steps", "chunks", "half"), [(50, 3, 17), (200, 10, 20)])
def test_samples_by_rotation_are_exact_at_late_times(first, steps, chunks, half):
    harmonics = draw(3, half, count=99)
    band.write_sample_rotations(harmonics, half, 0.5 / steps)
    band.write_rotation(harmonics.ratios, half / steps, harmonics.hop[0], harmonics.hop[1])
    band.write_rotation(harmonics.ratios, 1.0 - half * (chunks - 1) / steps, harmonics.wrap[0], harmonics.wrap[1])
    rng = np.random.default_rng(1)
    worst = 0.0
    for cycle in range(first, first + band.ANCHOR_CYCLES):
        for chunk in range(chunks):
            if cycle == first and chunk == 0:
                band.set_centre(harmonics, cycle, 0.5 * half / steps)
            else:
                band.rotate_centre(harmonics, harmonics.hop if chunk else harmonics.wrap)
            samples = np.zeros(2 * half + 1)
            band.add_samples(harmonics, half, samples)
            i = int(rng.integers(samples.size))
            truth = exact(harmonics, cycle + Fraction(2 * half * chunk + i, 2 * steps))
            worst = max(worst, abs(samples[i] - truth))
    assert worst < 1e-13


def test_direct_evaluation_is_exact_at_late_times():
    harmonics = draw(4)
    for cycle, fraction in ((0, 0.0), (17, 0.625), (10_000, 0.25), (10**8, 0.5)):
        truth = exact(harmonics, cycle + Fraction(fraction))
        assert noise_at(harmonics, cycle, fraction) == pytest.approx(truth, abs=1e-13)


def test_variance_and_spectrum_are_those_of_the_band():
    """Autocovariance at four lags against the band's own; false alarm 5 x 6e-5 (4 standard errors each)."""
    period = 2.0 * math.pi / 2.7
    lags = np.array([0.0, 0.1, 0.3, 0.7, 1.5])
    values = np.array([[noise_at(draw_, 3, lag) for lag in lags] for draw_ in map(draw, range(6000))])
    products = values * values[:, :1]
    low, high = BAND
    arguments = np.where(lags == 0.0, 1.0, lags * period)
    truth = VARIANCE * (np.sin(high * arguments) - np.sin(low * arguments)) / ((high - low) * arguments)
    truth[0] = VARIANCE
    z = (products.mean(axis=0) - truth) / (products.std(axis=0) / math.sqrt(len(products)))
    assert np.abs(z).max() < 4.0
    assert np.sum(draw(0).weights ** 2) / 2.0 == pytest.approx(VARIANCE, rel=1e-12)
    assert abs(values.mean()) < 4.0 * math.sqrt(VARIANCE / len(values))


def errors(frequencies, weights, phases, spacing, intervals=100, parts=1):
    """Largest errors of value and slope of the interpolant between samples, in equal parts, the first from 0 on."""
    bound = np.pi / (OVERSAMPLING * spacing)
    gains = np.array([evaluate_compensation(window_compensation(), frequency / bound) for frequency in frequencies])
    times = spacing * (np.arange(intervals + WIDTH) - WIDTH // 2 + 1)
    samples = np.cos(np.outer(times, frequencies) + phases) @ (weights * gains)
    shapes, place = interpolant_polynomials(spacing / parts, parts), spacing / parts * np.linspace(-0.5, 0.5, 11)
    worst = np.zeros(2)
    for k, part in itertools.product(range(intervals), range(parts)):
        polynomial = np.polynomial.Polynomial(samples[k : k + WIDTH] @ shapes[part])
        angle = np.outer(spacing * (k + (part + 0.5) / parts) + place, frequencies) + phases
        value, slope = np.cos(angle) @ weights, -np.sin(angle) @ (weights * frequencies)
        worst = np.maximum(worst, [abs(polynomial(place) - value).max(), abs(polynomial.deriv()(place) - slope).max()])
    return worst


@pytest.mark.parametrize("parts", [1, 2, 16])
@pytest.mark.parametrize(("low", "high", "variance"), [(0.0, 10.0, 0.04), (7.0, 12.0, 0.3), (0.0, 2.7, 0.3)])
def test_particular_solution_of_noise_is_right_to_1e_11(low, high, variance, parts):
    rng = np.random.default_rng(7)
    for _ in range(5):
        frequencies, phases = rng.uniform(low, high, 100), rng.uniform(0.0, 2.0 * np.pi, 100)
        weights = math.sqrt(0.02 * variance) / (1.0 + frequencies**2)
        value, slope = errors(frequencies, weights, phases, np.pi / (OVERSAMPLING * high), 100 // parts, parts)
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
    shapes = interpolant_polynomials(0.3)[0]
    assert shapes.shape == (WIDTH, TERMS)
    ends = np.polynomial.polynomial.polyval(np.array([-0.15, 0.15]), shapes.T)
    assert ends[1:, 1] == pytest.approx(ends[:-1, 0], abs=1e-14)
