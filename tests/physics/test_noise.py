"""Shinozuka noise: exact at late times, and the law that the paper's equation (4) gives it."""

import math
from fractions import Fraction

import numpy as np
import pytest

from fpk_rocking.physics.noise import band
from fpk_rocking.scene import BandNoise, Block, Harmonic, Scene
from montecarlo.engines import rk4
from montecarlo.engines.random import open_stream, stream_keys
from montecarlo.engines.shinozuka import draw_band

VARIANCE, BAND = 0.04, (1.0, 6.0)


def draw(realization, half=1, count=100):
    scene = Scene(Block(0.5), Harmonic(1.0, 2.7), BandNoise(VARIANCE, BAND, count))
    harmonics = band.allocate_realization(count, half)
    draw_band(open_stream(stream_keys(5), realization), rk4.problem_of(scene, 8), harmonics)
    return harmonics


def exact(harmonics, cycles):
    """The sum at a rational number of cycles, phases reduced in rational arithmetic."""
    total = 0.0
    for ratio, phase, weight in zip(harmonics.ratios, harmonics.phases, harmonics.weights, strict=True):
        turns = (Fraction(ratio) * cycles + Fraction(phase)) % 1
        total += weight * math.cos(2.0 * math.pi * float(turns))
    return total


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
        assert band.noise_at(harmonics, cycle, fraction) == pytest.approx(truth, abs=1e-13)


def test_variance_and_spectrum_are_those_of_the_band():
    """Autocovariance at four lags against the band's own; false alarm 5 x 6e-5 (4 standard errors each)."""
    period = 2.0 * math.pi / 2.7
    lags = np.array([0.0, 0.1, 0.3, 0.7, 1.5])
    values = np.array([[band.noise_at(draw_, 3, lag) for lag in lags] for draw_ in map(draw, range(6000))])
    products = values * values[:, :1]
    low, high = BAND
    arguments = np.where(lags == 0.0, 1.0, lags * period)
    truth = VARIANCE * (np.sin(high * arguments) - np.sin(low * arguments)) / ((high - low) * arguments)
    truth[0] = VARIANCE
    z = (products.mean(axis=0) - truth) / (products.std(axis=0) / math.sqrt(len(products)))
    assert np.abs(z).max() < 4.0
    assert np.sum(draw(0).weights ** 2) / 2.0 == pytest.approx(VARIANCE, rel=1e-12)
    assert abs(values.mean()) < 4.0 * math.sqrt(VARIANCE / len(values))
