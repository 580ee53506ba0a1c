"""Filtered noise: its closed forms against quadrature and against the state space, its checks and its equivalents."""

import dataclasses
import itertools
import math
from typing import ClassVar

import filter_formulas as formulas
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.linalg import expm

from fpk_rocking import (
    BandNoise,
    CloughPenzien,
    Filter,
    FilteredNoise,
    LinearFilter,
    NoNoise,
    Scene,
    StateSpace,
    WhiteNoise,
    melnikov,
)
from fpk_rocking.envelopes import Trapezoid
from fpk_rocking.physics.noise import equivalence
from fpk_rocking.physics.noise.state_space import transition_and_factor
from fpk_rocking.results.remarks import noise_text

NOISES = [
    FilteredNoise("exponential", 0.3, 0.7),
    FilteredNoise("exponential", 0.3, 35.0),
    *(FilteredNoise(kind, 0.3, 2.3, zeta) for kind in ("low-pass", "kanai-tajimi") for zeta in (0.05, 0.6, 1.0, 4.0)),
    FilteredNoise("low-pass", 0.3, 0.05, math.sqrt(0.5)),
    FilteredNoise("kanai-tajimi", 0.3, 30.0, 0.6),
]
EXTREME = [
    FilteredNoise(kind, 0.3, 10.0**power, None if kind == "exponential" else zeta)
    for kind in ("exponential", "low-pass", "kanai-tajimi")
    for power in (-8, -3, 0, 4, 8)
    for zeta in (1e-3, 0.7, 1.0, 1e3)
]
each = pytest.mark.parametrize("noise", NOISES, ids=lambda noise: f"{noise.filter}-{noise.frequency}-{noise.damping}")


@dataclasses.dataclass(frozen=True)
class Butterworth(Filter):
    """A filter of order 3, as a user would add one: (d + ω)(d² + ω d + ω²) η = w with d = d/dτ."""

    kind: ClassVar[str] = "butterworth"
    frequency: float

    @property
    def space(self):
        omega = self.frequency
        drift = [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-(omega**3), -2.0 * omega**2, -2.0 * omega]]
        return StateSpace.stationary(drift, [0.0, 0.0, 1.0], [1.0, 0.0, 0.0])


def butterworth_density(omega):
    """Its spectral density, for the frequency 2."""
    return 3.0 / (2.0 * math.pi) / (1.0 + (omega / 2.0) ** 6)


def soil_density(omega, high=15.0, damping=0.6, low=1.5, low_damping=0.4):
    """The spectral density of Clough and Penzien (1975), but for a factor."""
    soil, second = (omega / high) ** 2, (omega / low) ** 2
    passed = (1.0 + 4.0 * damping**2 * soil) / ((1.0 - soil) ** 2 + 4.0 * damping**2 * soil)
    return passed * second**2 / ((1.0 - second) ** 2 + 4.0 * low_damping**2 * second)


SOIL = CloughPenzien(15.0, 0.6, 1.5, 0.4)
OWN = [(Butterworth(2.0), 2.0, butterworth_density), (SOIL, 4.0, soil_density)]
own = pytest.mark.parametrize(("own", "centre", "formula"), OWN, ids=["butterworth", "clough-penzien"])


def _integral(density, centre, weight):
    """∫ G weight dω over ω > 0, in s = ω/(ω + ω₀), with breaks around a resonance."""

    def integrand(s):
        omega = centre * s / (1.0 - s)
        return density(omega) * weight(omega) * centre / (1.0 - s) ** 2

    breaks = sorted({0.0, 0.45, 0.48, 0.5, 0.52, 0.55, *(1.0 / (1.0 + centre / w) for w in (0.1, 1.0, 10.0))} | {1.0})
    return sum(quad(integrand, a, b, epsabs=0.0, epsrel=1e-12, limit=200)[0] for a, b in itertools.pairwise(breaks))


def _melnikov(omega):
    return 4.0 / (1.0 + omega * omega) ** 2


@each
def test_the_formulas_against_quadrature(noise):
    """Variance, Melnikov variance and autocovariance, ∫ G cos(ω t) dω, of the closed forms that the next test takes."""

    def density(omega):
        return formulas.spectral_density(noise, omega)

    assert _integral(density, noise.frequency, lambda _: 1.0) == pytest.approx(noise.variance, rel=1e-10)
    variance = _integral(density, noise.frequency, _melnikov)
    assert formulas.melnikov_variance(noise) == pytest.approx(variance, rel=1e-10)
    for lag in (0.1 / noise.frequency, 2.0 / noise.frequency):
        transform, _ = quad(density, 0.0, np.inf, weight="cos", wvar=lag, epsabs=1e-11)
        assert formulas.autocovariance(noise, lag) == pytest.approx(transform, abs=1e-8)


@pytest.mark.parametrize("noise", NOISES + EXTREME, ids=noise_text)
def test_a_named_filter_is_its_closed_form(noise):
    """From its state space alone follows what the formulas say, to 1e-13, whatever its rate and damping."""
    space, unit = noise.space, dataclasses.replace(noise, variance=1.0)
    assert space.melnikov_variance == pytest.approx(formulas.melnikov_variance(unit), rel=1e-13)
    assert melnikov.noise_variance(noise) == pytest.approx(formulas.melnikov_variance(noise), rel=1e-13)
    assert melnikov.equivalent_diffusion(noise) == 0.5 * melnikov.noise_variance(noise)
    assert space.inward_variance == pytest.approx(formulas.inward_variance(unit), rel=1e-13)
    assert space.peak_density == pytest.approx(formulas.peak_density(unit), rel=1e-13)
    # Two eigenvalues that meet, at ζ = 1, are known to the root of rounding.
    assert space.fastest == pytest.approx(formulas.fastest(unit), rel=1e-7 if noise.damping == 1.0 else 1e-13)
    assert space.smooth is (noise.filter == "low-pass")
    omega = noise.frequency * np.array([0.0, 0.01, 0.5, 1.0, 3.0, 1e3])
    assert space.spectral_density(omega) == pytest.approx(formulas.spectral_density(unit, omega), rel=1e-13, abs=0.0)
    if noise.damping != 1e3:
        lags = np.array([0.0, 0.01, 1.0, -10.0]) / noise.frequency
        assert space.autocovariance(lags) == pytest.approx(formulas.autocovariance(unit, lags), abs=2e-14)
    expected = melnikov.noise_variance(noise) / (math.pi * formulas.peak_density(noise))
    assert melnikov.relative_variance(noise) == pytest.approx(expected, rel=1e-13)


@own
def test_a_filter_of_any_order_against_quadrature(own, centre, formula):
    """Its spectral density is the formula of its author, and what follows from it has the integrals of that."""
    space, total = own.space, _integral(formula, centre, lambda _: 1.0)

    def density(omega):
        return formula(omega) / total

    omega = np.array([0.0, 0.3, 1.1, 2.0, 4.5, 20.0, 300.0])
    assert space.spectral_density(omega) == pytest.approx(density(omega), rel=1e-10, abs=1e-18)
    covariance = space.correlation @ space.output
    for frequency in omega:
        other = np.linalg.solve(1j * frequency * np.eye(space.order) - space.drift, covariance)
        assert space.spectral_density(frequency) == pytest.approx(
            2.0 / math.pi * (space.output @ other).real, abs=1e-15
        )
    assert space.autocovariance(0.0) == pytest.approx(1.0, rel=1e-12)
    for lag in (0.07, 0.9):
        transform, _ = quad(density, 0.0, np.inf, weight="cos", wvar=lag, epsabs=1e-11, limlst=200)
        assert space.autocovariance(lag) == space.autocovariance(-lag) == pytest.approx(transform, abs=1e-8)
    assert space.melnikov_variance == pytest.approx(_integral(density, centre, _melnikov), rel=1e-10)
    inward = _integral(density, centre, lambda w: 1.0 / (1.0 + w * w))
    assert space.inward_variance == pytest.approx(inward, rel=1e-10)
    assert space.peak_density == pytest.approx(density(np.linspace(0.0, 30.0, 300_001)).max(), rel=1e-8)
    noise = FilteredNoise(own, 0.3)
    assert melnikov.noise_variance(noise) == pytest.approx(0.3 * space.melnikov_variance, rel=1e-14)
    assert 0.0 < melnikov.relative_variance(noise) < 1.0


@pytest.mark.parametrize("noise", NOISES + [FilteredNoise(own, 0.3) for own, _, _ in OWN], ids=noise_text)
def test_a_state_space_is_stationary(noise):
    """Its Lyapunov equation, states of variance 1, and noise of variance 1."""
    drift, source, output, correlation = noise.space
    loss = drift @ correlation + correlation @ drift.T + np.outer(source, source)
    assert np.abs(loss).max() < 1e-13 * np.abs(drift).max()
    assert np.diag(correlation) == pytest.approx(np.ones(len(source)), abs=1e-14)
    assert output @ correlation @ output == pytest.approx(1.0, rel=1e-13)


def test_only_ratios_of_the_matrices_count():
    """The states of a filter in any units, and any white noise, give one noise; smooth where c b is 0."""
    space, units = Butterworth(2.0).space, np.array([1e-6, 3.0, 1e7])
    drift = space.drift * units[:, None] / units
    other = LinearFilter(drift.tolist(), (7.0 * units * space.input).tolist(), (1e4 * space.output / units).tolist())
    for matrix, wanted in zip(other.space, space, strict=True):
        assert np.abs(matrix - wanted).max() < 1e-13 * np.abs(wanted).max()
    assert space.smooth
    assert not SOIL.space.smooth
    twice = Butterworth(2.0).faster(3.0), SOIL.faster(3.0)
    assert isinstance(twice[1], CloughPenzien)
    for fast, slow in zip(twice, (space, SOIL.space), strict=True):
        assert fast.space.autocovariance(0.2) == pytest.approx(slow.autocovariance(0.6), rel=1e-12)


@each
@pytest.mark.parametrize("steps", [1e-4, 0.3, 40.0])
def test_transition_against_its_definition(noise, steps):
    """The covariance part by part, without doubling, and with what is left of the stationary one it is that again."""
    drift, source, _, spread = formulas.state_space(noise)
    duration = steps / noise.frequency
    phi, factor = transition_and_factor(drift, source, duration)
    covariance = factor @ factor.T
    assert phi == pytest.approx(expm(drift * duration), rel=1e-9, abs=1e-13)
    part = duration / (1 + math.ceil(8.0 * steps))
    nodes, weights = 0.5 * part * (1.0 + np.polynomial.legendre.leggauss(8)[0]), np.polynomial.legendre.leggauss(8)[1]
    within, complete = expm(drift * nodes[:, None, None]), expm(drift * part)
    exact, begin = np.zeros(phi.shape), source
    for _ in range(round(duration / part)):
        moved, begin = within @ begin, complete @ begin
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


def test_melnikov_functions_take_filtered_noise(main_scene):
    noise = main_scene.filtered_equivalent().noise
    for of in (
        lambda noise: melnikov.critical_amplitude(2.7, 0.5, noise),
        lambda noise: melnikov.phase_flux((4.6, 2.7), 0.5, noise),
    ):
        assert of(noise) == pytest.approx(of(main_scene.noise), rel=1e-12)
    white = main_scene.varied(noise=noise).white_equivalent()
    assert white.noise.diffusion == pytest.approx(main_scene.white_equivalent().noise.diffusion, rel=1e-12)


@pytest.mark.parametrize("band", [(0.0, 10.0), (0.0, 1e-3), (1.0, 6.0), (4.0, 10.0), (0.0, 35.3)])
def test_filtered_equivalent_has_both_variances(main_scene, band):
    scene = main_scene.varied(noise={"band": band})
    equivalent = scene.filtered_equivalent()
    assert equivalent.noise.filter == "low-pass"
    assert equivalent.noise.damping == math.sqrt(0.5)
    assert equivalent.noise.variance == scene.noise.variance
    assert melnikov.noise_variance(equivalent.noise) == pytest.approx(melnikov.noise_variance(scene.noise), rel=1e-12)
    assert equivalent.filtered_equivalent() is equivalent


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
        (("low-pass", 1.0), TypeError, r"^noise\.frequency: got None, accepted: a finite number > 0"),
        ((SOIL, 1.0, 2.0), ValueError, r"^noise\.frequency: got 2\.0, accepted: nothing; the filter has its own"),
        ((SOIL, 1.0, None, 0.5), ValueError, r"^noise\.damping: got 0\.5, accepted: nothing; the filter has its own"),
    ],
)
def test_a_filter_is_checked_by_name(arguments, error, message):
    with pytest.raises(error, match=message):
        FilteredNoise(*arguments)


@each
def test_the_toml_form_of_a_filter_round_trips(main_scene, noise):
    scene = main_scene.varied(noise=noise)
    assert 'kind = "filtered"' in scene.to_toml()
    assert ("damping" in scene.to_toml()) is (noise.filter != "exponential")
    assert Scene.from_toml(scene.to_toml()) == scene
    assert scene.varied(noise={"variance": 0.1}).noise == dataclasses.replace(noise, variance=0.1)


@pytest.mark.parametrize(
    ("own", "arguments", "message"),
    [
        (CloughPenzien, (15.0, 0.0, 1.5, 0.6), r"^noise\.filter\.damping: got 0\.0, accepted: a finite number > 0"),
        (CloughPenzien, (15.0, 0.6, math.inf, 0.6), r"^noise\.filter\.low_frequency: got inf"),
        (LinearFilter, ([[-1.0, 0.0]], [1.0], [1.0]), r"^noise\.filter\.drift: got .*n rows of n numbers"),
        (LinearFilter, ([[-1.0]], [1.0, 0.0], [1.0]), r"^noise\.filter\.drift: got .*n rows of n numbers"),
        (LinearFilter, ([], [1.0], [1.0]), r"^noise\.filter\.drift: got \[\]"),
        (LinearFilter, ([[0.0, 1.0], [-1.0, 0.0]], [0.0, 1.0], [1.0, 0.0]), r"^noise\.filter\.drift: .* below 0"),
        (LinearFilter, ([[0.0, 1.0], [40.0, -6.0]], [0.0, 1.0], [1.0, 0.0]), r"got \[\[0.0, 1.0\], \[40.0, -6.0\]\], "),
        (LinearFilter, ([[-1e-6, 0.0], [0.0, -2e6]], [0.0, 1e5], [1.0, 1.0]), r"got input \[0.0, 100000.0\] and"),
        (LinearFilter, ([[-1.0, 0.0], [0.0, -2.0]], [1.0, 0.0], [1.0, 1.0]), r"^noise\.filter: .* reaches every state"),
        (LinearFilter, ([[-1.0, 0.0], [0.0, -1.0]], [1.0, 1.0], [1.0, 1.0]), r"^noise\.filter: .* reaches every state"),
        (LinearFilter, ([[-1.0]], [0.0], [1.0]), r"^noise\.filter: .* reaches every state"),
        (LinearFilter, ([[-1.0]], [1.0], [0.0]), r"^noise\.filter: .* reach the output"),
    ],
)
def test_a_filter_of_ones_own_is_checked_by_name(own, arguments, message):
    with pytest.raises(ValueError, match=message):
        own(*arguments)


@pytest.mark.parametrize("own", [SOIL, Butterworth(2.0).faster(1.0)], ids=lambda noise: noise.kind)
def test_toml_form_of_a_filter_of_ones_own(main_scene, own):
    scene = main_scene.varied(noise=FilteredNoise(own, 0.04, envelope=Trapezoid(1.0, 2.0, 3.0)))
    assert Scene.from_toml(scene.to_toml()) == scene
    text = scene.to_toml().replace(f'kind = "{own.kind}"', 'kind = "mine"')
    with pytest.raises(ValueError, match=r"noise\.filter\.kind: got 'mine', accepted: 'linear', 'clough-penzien'"):
        Scene.from_toml(text)


def test_a_filter_without_its_states_is_refused_as_it_is_made():
    class Nothing(Filter):
        kind = "nothing"

    with pytest.raises(TypeError, match="space"):
        Nothing()


def test_a_class_that_no_file_knows_is_written_as_its_matrices(main_scene):
    """The same noise: autocovariance and Melnikov variance are right to rounding."""
    scene = main_scene.varied(noise=FilteredNoise(Butterworth(2.0), 0.04))
    read = Scene.from_toml(scene.to_toml())
    assert read.noise.filter.kind == "linear"
    lags = np.linspace(0.0, 3.0, 7)
    assert read.noise.space.autocovariance(lags) == pytest.approx(scene.noise.space.autocovariance(lags), abs=1e-13)
    assert read.noise.space.melnikov_variance == pytest.approx(scene.noise.space.melnikov_variance, rel=1e-12)


def test_doubts_need_a_strength():
    with pytest.raises(ValueError, match=r"noise: got FilteredNoise.* accepted: .* of a variance > 0"):
        equivalence.relative_variance(FilteredNoise("exponential", 0.0, 1.0))
    with pytest.raises(ValueError, match=r"accepted: band noise"):
        equivalence.realized_spread(NOISES[0], 0.5)
