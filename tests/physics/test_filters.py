"""Filtered noise: its closed forms against quadrature and against the state space, its checks and its equivalents."""

import dataclasses
import itertools
import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.linalg import expm, solve_continuous_lyapunov

from fpk_rocking import BandNoise, FilteredNoise, NoNoise, Scene, WhiteNoise, melnikov
from fpk_rocking.physics.noise import equivalence, filters

NOISES = [
    FilteredNoise("exponential", 0.3, 0.7),
    FilteredNoise("exponential", 0.3, 35.0),
    *(FilteredNoise(kind, 0.3, 2.3, zeta) for kind in ("low-pass", "kanai-tajimi") for zeta in (0.05, 0.6, 1.0, 4.0)),
    FilteredNoise("low-pass", 0.3, 0.05, math.sqrt(0.5)),
    FilteredNoise("kanai-tajimi", 0.3, 30.0, 0.6),
]
each = pytest.mark.parametrize("noise", NOISES, ids=lambda one: f"{one.filter}-{one.frequency}-{one.damping}")


def _integral(noise, weight):
    """∫ G weight dω over ω > 0, in s = ω/(ω + ω₀), with breaks around a resonance."""
    centre = noise.frequency

    def integrand(s):
        omega = centre * s / (1.0 - s)
        return filters.spectral_density(noise, omega) * weight(omega) * centre / (1.0 - s) ** 2

    breaks = sorted({0.0, 0.45, 0.48, 0.5, 0.52, 0.55, *(1.0 / (1.0 + centre / w) for w in (0.1, 1.0, 10.0))} | {1.0})
    return sum(quad(integrand, a, b, epsabs=0.0, epsrel=1e-12, limit=200)[0] for a, b in itertools.pairwise(breaks))


@each
def test_the_spectrum_has_the_variance(noise):
    assert _integral(noise, lambda _: 1.0) == pytest.approx(noise.variance, rel=1e-10)


@each
def test_melnikov_variance_against_the_integral_over_the_spectrum(noise):
    integral = _integral(noise, lambda w: 4.0 / (1.0 + w * w) ** 2)
    assert melnikov.noise_variance(noise) == pytest.approx(integral, rel=1e-10)
    assert melnikov.equivalent_diffusion(noise) == 0.5 * melnikov.noise_variance(noise)


@each
def test_autocovariance_against_the_transform_of_the_spectrum(noise):
    """∫ G cos(ω t) dω, by quadrature for oscillating integrands."""
    for lag in (0.0, 0.1 / noise.frequency, 2.0 / noise.frequency):
        if lag == 0.0:
            transform = _integral(noise, lambda _: 1.0)
        else:
            transform, _ = quad(
                lambda w: filters.spectral_density(noise, w), 0.0, np.inf, weight="cos", wvar=lag, epsabs=1e-11
            )
        assert filters.autocovariance(noise, lag) == pytest.approx(transform, abs=1e-8)
        assert filters.autocovariance(noise, -lag) == filters.autocovariance(noise, lag)


@each
def test_state_space_is_the_same_noise(noise):
    """Its Lyapunov equation, its autocovariance and its transfer function."""
    drift, source, output, spread = filters.state_space(noise)
    assert np.diag(spread**2) == pytest.approx(solve_continuous_lyapunov(drift, -np.outer(source, source)), abs=1e-12)
    assert output @ (spread**2 * output) == pytest.approx(noise.variance, rel=1e-14)
    lags = np.array([0.0, 0.3, 1.7, 5.0]) / noise.frequency
    expected = [output @ expm(drift * lag) @ (spread**2 * output) for lag in lags]
    assert filters.autocovariance(noise, lags) == pytest.approx(np.array(expected), abs=1e-14)
    for omega in (0.0, 0.4 * noise.frequency, 1.1 * noise.frequency, 30.0):
        gain = output @ np.linalg.solve(1j * omega * np.eye(source.size) - drift, source)
        assert filters.spectral_density(noise, omega) == pytest.approx(abs(gain) ** 2 / math.pi, rel=1e-11)


@each
@pytest.mark.parametrize("steps", [1e-4, 0.3, 40.0])
def test_transition_against_its_definition(noise, steps):
    """The covariance part by part, without doubling, and with what is left of the stationary one it is that again."""
    drift, source, _, spread = filters.state_space(noise)
    duration = steps / noise.frequency
    phi, covariance = filters.transition(drift, source, duration)
    assert phi == pytest.approx(expm(drift * duration), rel=1e-9, abs=1e-13)
    part = duration / (1 + math.ceil(8.0 * steps))
    nodes, weights = 0.5 * part * (1.0 + np.polynomial.legendre.leggauss(8)[0]), np.polynomial.legendre.leggauss(8)[1]
    within, whole = expm(drift * nodes[:, None, None]), expm(drift * part)
    exact, begin = np.zeros(phi.shape), source
    for _ in range(round(duration / part)):
        moved, begin = within @ begin, whole @ begin
        exact += 0.5 * part * (moved.T * weights) @ moved
    size = np.sqrt(np.outer(np.diag(exact), np.diag(exact)))
    assert np.abs((covariance - exact) / size).max() < 1e-11
    stationary = np.diag(spread**2)
    assert covariance + phi @ stationary @ phi.T == pytest.approx(stationary, rel=1e-12, abs=1e-15)


def test_white_noise_is_the_limit_of_fast_filters():
    """σ² (1/ω) for the exponential filter, σ² 2ζ/ω for the low-pass one."""
    assert melnikov.equivalent_diffusion(FilteredNoise("exponential", 0.012e6, 1e6)) == pytest.approx(0.012, rel=1e-5)
    assert melnikov.equivalent_diffusion(FilteredNoise("low-pass", 6e3, 1e6, 1.0)) == pytest.approx(0.012, rel=1e-5)


def test_a_slow_filter_is_a_constant_force():
    """σ_M² → 4 σ², the square of ∫ exp(-|τ|) dτ."""
    for noise in (FilteredNoise("exponential", 0.3, 1e-9), FilteredNoise("low-pass", 0.3, 1e-6, 0.7)):
        assert melnikov.noise_variance(noise) == pytest.approx(1.2, rel=1e-5)


@each
def test_cover_is_held_against_the_peak(noise):
    grid = noise.frequency * np.linspace(0.0, 5.0, 200_001)
    peak = filters.spectral_density(noise, grid).max()
    assert filters.peak_density(noise) == pytest.approx(peak, rel=1e-6)
    assert melnikov.cover(noise) == pytest.approx(melnikov.noise_variance(noise) / (math.pi * peak), rel=1e-6)
    assert 0.0 < melnikov.cover(noise) < 1.0


def test_melnikov_functions_take_filtered_noise(main_scene):
    noise = main_scene.filtered_equivalent().noise
    for of in (
        lambda one: melnikov.critical_amplitude(2.7, 0.5, one),
        lambda one: melnikov.phase_flux((4.6, 2.7), 0.5, one),
    ):
        assert of(noise) == pytest.approx(of(main_scene.noise), rel=1e-12)
    white = main_scene.varied(noise=noise).white_equivalent()
    assert white.noise.diffusion == pytest.approx(main_scene.white_equivalent().noise.diffusion, rel=1e-12)


@pytest.mark.parametrize("band", [(0.0, 10.0), (0.0, 1e-3), (1.0, 6.0), (4.0, 10.0), (0.0, 35.3)])
def test_filtered_equivalent_has_both_variances(main_scene, band):
    scene = main_scene.varied(noise={"band": band})
    found = scene.filtered_equivalent()
    assert found.noise.filter == "low-pass"
    assert found.noise.damping == math.sqrt(0.5)
    assert found.noise.variance == scene.noise.variance
    assert melnikov.noise_variance(found.noise) == pytest.approx(melnikov.noise_variance(scene.noise), rel=1e-12)
    assert found.filtered_equivalent() is found


def test_filtered_equivalent_of_the_main_scene(main_scene):
    """2ζσ²/D at low frequencies is 9.0."""
    assert main_scene.filtered_equivalent().noise.frequency == pytest.approx(8.9931, abs=1e-4)


@pytest.mark.parametrize(
    ("noise", "message"),
    [
        (WhiteNoise(0.1), r"noise: got WhiteNoise\(.*accepted: band noise of a variance > 0, or filtered noise"),
        (NoNoise(), r"noise: got NoNoise"),
        (BandNoise(0.0, (0.0, 1.0), 3), r"noise: got BandNoise\(variance=0\.0"),
        (BandNoise(0.1, (0.0, 1e-10), 3), r"noise\.band: got \(0\.0, 1e-10\), accepted: a band that low-pass"),
        (BandNoise(0.1, (1e9, 2e9), 3), r"noise\.band: got \(1000000000\.0, 2000000000\.0\), accepted: a band that"),
    ],
)
def test_filtered_equivalent_refuses_by_name(main_scene, noise, message):
    with pytest.raises(ValueError, match=message):
        dataclasses.replace(main_scene, noise=noise).filtered_equivalent()


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        (
            ("pink", 1.0, 1.0),
            ValueError,
            r"^noise\.filter: got 'pink', accepted: 'exponential', 'low-pass', 'kanai-taj",
        ),
        ((3, 1.0, 1.0), TypeError, r"^noise\.filter: got 3, accepted: 'exponential'"),
        (("exponential", -1.0, 1.0), ValueError, r"^noise\.variance: got -1\.0, accepted: a finite number >= 0"),
        (("exponential", math.nan, 1.0), ValueError, r"^noise\.variance: got nan"),
        (("exponential", 1.0, 0.0), ValueError, r"^noise\.frequency: got 0\.0, accepted: a finite number > 0"),
        (("exponential", 1.0, math.inf), ValueError, r"^noise\.frequency: got inf"),
        (("exponential", 1.0, 1.0, 0.7), ValueError, r"^noise\.damping: got 0\.7, accepted: nothing; .*exponential"),
        (("low-pass", 1.0, 1.0), TypeError, r"^noise\.damping: got None, accepted: a finite number > 0"),
        (("kanai-tajimi", 1.0, 1.0, 0.0), ValueError, r"^noise\.damping: got 0\.0, accepted: a finite number > 0"),
        (("kanai-tajimi", 1.0, 1.0, math.nan), ValueError, r"^noise\.damping: got nan"),
    ],
)
def test_a_filter_is_checked_by_name(arguments, error, message):
    with pytest.raises(error, match=message):
        FilteredNoise(*arguments)


@each
def test_toml_form(main_scene, noise):
    scene = main_scene.varied(noise=noise)
    assert 'kind = "filtered"' in scene.to_toml()
    assert ("damping" in scene.to_toml()) is (noise.filter != "exponential")
    assert Scene.from_toml(scene.to_toml()) == scene
    assert scene.varied(noise={"variance": 0.1}).noise == dataclasses.replace(noise, variance=0.1)


def test_doubts_need_a_strength():
    with pytest.raises(ValueError, match=r"noise: got FilteredNoise.* accepted: .* of a variance > 0"):
        equivalence.cover(FilteredNoise("exponential", 0.0, 1.0))
    with pytest.raises(ValueError, match=r"accepted: band noise"):
        equivalence.realized_spread(NOISES[0], 0.5)
