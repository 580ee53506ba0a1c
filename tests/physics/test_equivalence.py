"""The variance of the Melnikov process against quadrature of its spectrum, of the orbit, and of synthesized noise."""

import itertools
import math
import types

import numpy as np
import pytest
from scipy.integrate import quad, simpson

from fpk_rocking import BandNoise, NoNoise, WhiteNoise, melnikov
from fpk_rocking.physics.noise.equivalence import response

BANDS = [(0.0, 10.0), (0.0, 2.7), (1.0, 6.0), (2.0, 10.0), (4.0, 10.0), (0.0, 1e4), (100.0, 101.0)]


@pytest.mark.parametrize("band", BANDS)
def test_band_noise_against_the_integral_of_its_spectrum(band):
    low, high = band
    density = 0.3 / (high - low)
    edges = [low, 1.0, high] if low < 1.0 < high else [low, high]
    integral = 0.0
    for a, b in itertools.pairwise(edges):
        integral += quad(lambda w: density * (2 / (1 + w * w)) ** 2, a, b, epsabs=0, epsrel=1e-12, limit=500)[0]
    assert melnikov.noise_variance(BandNoise(0.3, band, 5)) == pytest.approx(integral, rel=1e-10)


@pytest.mark.parametrize(
    ("band", "sigma", "diffusion"),
    [
        ((0, 10), 0.2, 0.00628),
        ((0, 2.7), 0.2, 0.02284),
        ((1, 6), 0.2, 0.00226),
        ((2, 10), 0.3, 0.00071),
        ((4, 10), 0.6, 0.00054),
    ],
)
def test_diffusion_of_known_bands(band, sigma, diffusion):
    assert melnikov.equivalent_diffusion(BandNoise(sigma**2, band, 100)) == pytest.approx(diffusion, abs=5e-6)


def test_a_narrow_band_is_a_line_and_loses_no_digits():
    line = 0.5 * (2 / (1 + 1.7**2)) ** 2
    assert melnikov.noise_variance(BandNoise(0.5, (1.7, 1.7 + 1e-9), 1)) == pytest.approx(line, rel=1e-8)


def test_white_noise_is_exact_and_the_limit_of_wide_bands():
    assert melnikov.noise_variance(WhiteNoise(0.012)) == 0.024
    assert melnikov.equivalent_diffusion(WhiteNoise(0.012)) == 0.012
    orbit, _ = quad(lambda t: math.exp(-2 * abs(t)), -40, 40, points=[0])
    assert orbit * 2 * 0.012 == pytest.approx(0.024, rel=1e-12)
    # A band of density G has <ηη> → πG δ, that is 2D = πG.
    wide, density = 1e6, 2 * 0.012 / math.pi
    assert melnikov.noise_variance(BandNoise(density * wide, (0, wide), 1)) == pytest.approx(0.024, rel=1e-9)


def test_no_noise_has_none():
    assert melnikov.noise_variance(NoNoise()) == melnikov.equivalent_diffusion(NoNoise()) == 0.0


def test_unknown_kind_is_refused():
    with pytest.raises(
        TypeError, match=r"noise: got .*'pink'.*, accepted: BandNoise, WhiteNoise, FilteredNoise or NoNoise"
    ):
        melnikov.noise_variance(types.SimpleNamespace(kind="pink"))


def test_synthesized_noise_seen_along_the_heteroclinic_orbit():
    """M = ∫ v(τ) η(τ) dτ with v = e^(-|τ|), by quadrature in time over 4000 realizations of eq. 4.

    Fails falsely with probability 7e-6 (4.5 standard errors of the mean square); the seed is fixed.
    """
    noise, realizations = BandNoise(0.3, (0.3, 3.0), 4), 4000
    generator = np.random.default_rng(3)
    tau = np.linspace(-20.0, 20.0, 401)
    orbit_velocity = np.exp(-np.abs(tau))
    process = np.zeros(realizations)
    for _ in range(noise.harmonics):
        frequency = generator.uniform(*noise.band, realizations)
        phase = generator.uniform(0.0, 2 * np.pi, realizations)
        harmonic = math.sqrt(2 * noise.variance / noise.harmonics) * np.cos(np.outer(frequency, tau) + phase[:, None])
        # Simpson on each side: the orbit's velocity has a kink at the impact, τ = 0.
        for side in (slice(None, 201), slice(200, None)):
            process += simpson(harmonic[:, side] * orbit_velocity[side], x=tau[side], axis=1)
    squares = process**2
    standard_error = squares.std() / math.sqrt(realizations)
    assert abs(squares.mean() - melnikov.noise_variance(noise)) < 4.5 * standard_error
    assert standard_error < 0.03 * melnikov.noise_variance(noise)


def test_cover_of_known_bands():
    """(1/π) ∫ 4/(1+ω²)² dω over the band, by quadrature; all of it for a wide band, whatever σ and N."""
    for low, high in BANDS[:5]:
        part, _ = quad(lambda w: 4.0 / (1.0 + w * w) ** 2 / math.pi, low, high, epsabs=1e-13)
        assert melnikov.relative_variance(BandNoise(0.3, (low, high), 5)) == pytest.approx(part, rel=1e-9)
    assert melnikov.relative_variance(BandNoise(2.0, (0.0, 1e4), 1)) == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize(("band", "restitution"), [((0.0, 10.0), 0.5), ((1.0, 6.0), 0.7), ((0.0, 1e4), 0.3)])
def test_spread_against_quadrature_of_the_response(band, restitution):
    (low, high), e = band, restitution

    def kernel(w):
        return ((1 + e) ** 2 + (1 - e) ** 2 * w * w) / (1 + w * w) ** 2 / (1 + e * e)

    breaks = [low, *(edge for edge in (1.0, 10.0, 100.0) if low < edge < high), high]
    exact = {"epsabs": 0, "epsrel": 1e-11}
    pieces = list(itertools.pairwise(breaks))
    mean = sum(quad(kernel, a, b, **exact)[0] for a, b in pieces) / (high - low)
    square = sum(quad(lambda w: kernel(w) ** 2, a, b, **exact)[0] for a, b in pieces) / (high - low)
    noise = BandNoise(0.3, band, 7)
    spread = math.sqrt((square / mean**2 - 1.0) / 7)
    assert melnikov.realized_spread(noise, e) == pytest.approx(spread, rel=1e-8)


@pytest.mark.parametrize("count", [1, 6, 200])
def test_spread_of_stratified_harmonics_is_that_of_drawn_ones(count):
    """Diffusions Σ a² response(ν)/2 of 40,000 draws, within 4.5 standard errors; false alarm 3 x 7e-6."""
    noise, generator = BandNoise(0.3, (0.0, 10.0), count, frequencies="stratified"), np.random.default_rng(8)
    frequencies = 10.0 * (np.arange(count) + generator.random((40_000, count))) / count
    strengths = (generator.exponential(size=frequencies.shape) * response(frequencies, 0.5)).sum(axis=1)
    spread = strengths.std() / strengths.mean()
    fourth = np.mean((strengths / strengths.mean() - 1.0) ** 4)
    error = math.sqrt(fourth / spread**4 - 1.0) / 2.0 / math.sqrt(len(strengths)) + spread / math.sqrt(len(strengths))
    assert melnikov.realized_spread(noise, 0.5) == pytest.approx(spread, rel=4.5 * error)


@pytest.mark.parametrize("noise", [WhiteNoise(0.01), NoNoise(), BandNoise(0.0, (0.0, 10.0), 10)])
def test_cover_and_spread_need_a_band(noise):
    for measure in (melnikov.relative_variance, lambda noise: melnikov.realized_spread(noise, 0.5)):
        with pytest.raises(ValueError, match=r"noise: got .* accepted: band noise of a variance > 0"):
            measure(noise)
