"""Phase flux against other quadratures, its limits in closed form, and Monte Carlo."""

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import ndtr

from fpk_rocking import BandNoise, Harmonic, Harmonics, NoNoise, WhiteNoise, melnikov
from fpk_rocking.analytics.flux import mean_excess

FORCING = Harmonic(4.0, 4.0)
NOISE = BandNoise(0.16, (0.0, 10.0), 100)
RESTITUTIONS = [0.3, 0.5, 0.7, 0.9, 1.0]
# (A, Ω) = (4, 4), one value a restitution, without noise and with NOISE.
QUIET = [8.528473805274991e-4, 1.306466202052308e-2, 4.487756791660220e-2, 1.053556760759549e-1, 8 / 17 / math.pi]
NOISY = [2.293752245623269e-2, 3.671025543489212e-2, 6.648488906361345e-2, 1.242271414828377e-1, 1.681779929605055e-1]


def trapezoid(harmonic, loss, sigma, count=4096):
    """Φ by the trapezoidal rule on the phase, spectrally convergent while D/σ is far below the number of points."""
    level = harmonic * np.cos(2.0 * np.pi * np.arange(count) / count) - loss
    density = np.exp(-0.5 * (level / sigma) ** 2) / math.sqrt(2.0 * math.pi)
    return float(np.mean(sigma * density + level * ndtr(level / sigma)))


def test_pinned_fluxes():
    assert melnikov.phase_flux(FORCING, RESTITUTIONS, NoNoise()) == pytest.approx(QUIET, abs=1e-14)
    assert melnikov.phase_flux(FORCING, RESTITUTIONS, NOISE) == pytest.approx(NOISY, abs=1e-14)


def test_flux_without_noise_is_the_closed_form():
    harmonic = 8.0 / 17.0
    for e, flux in zip(RESTITUTIONS, QUIET, strict=True):
        loss = (1.0 - e * e) / 2.0
        closed = (math.sqrt(harmonic**2 - loss**2) - loss * math.acos(loss / harmonic)) / math.pi
        assert flux == pytest.approx(closed, abs=1e-14)
        integral, _ = quad(lambda t, loss=loss: harmonic * math.cos(t) - loss, 0.0, math.acos(loss / harmonic))
        assert flux == pytest.approx(integral / math.pi, abs=1e-13)
    assert melnikov.phase_flux((3.8, 4.0), 0.3, NoNoise()) == 0.0
    assert melnikov.phase_flux((0.0, 4.0), [0.0, 0.5, 1.0], NoNoise()).tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("amplitude", [0.0, 0.5, 3.87, 4.0, 30.0])
@pytest.mark.parametrize("diffusion", [4.0, 0.025, 1e-4])
def test_flux_with_noise_by_another_quadrature(amplitude, diffusion):
    """The trapezoidal rule, right to rounding for these deviations."""
    for e in (0.0, 0.3, 0.9, 1.0):
        harmonic, loss, sigma = 2.0 * amplitude / 17.0, (1.0 - e * e) / 2.0, math.sqrt(2.0 * diffusion)
        flux = melnikov.phase_flux((amplitude, 4.0), e, WhiteNoise(diffusion))
        assert flux == pytest.approx(trapezoid(harmonic, loss, sigma), abs=3e-15 * (1.0 + harmonic))


def test_flux_that_hardly_is_keeps_its_digits():
    """The forcing ends 7.5 deviations below the loss; against 30 digits."""
    mpmath = pytest.importorskip("mpmath")
    with mpmath.workdps(30):
        harmonic, loss, sigma = mpmath.mpf(2) / 17, mpmath.mpf("0.455"), mpmath.sqrt(mpmath.mpf("0.002"))

        def integrand(phase):
            u = (harmonic * mpmath.cos(phase) - loss) / sigma
            return sigma * mpmath.npdf(u) + sigma * u * mpmath.ncdf(u)

        exact = float(mpmath.quad(integrand, [0, 0.5, 1, 2, mpmath.pi]) / mpmath.pi)
    assert exact < 1e-14
    assert melnikov.phase_flux((1.0, 4.0), 0.3, WhiteNoise(0.001)) == pytest.approx(exact, rel=1e-11, abs=0.0)


def test_flux_for_vanishing_noise_tends_to_that_without():
    """Where D > M the excess is the curvature term, σ²/(2π √(D² - M²)) to leading order."""
    harmonic, loss = 8.0 / 17.0, 0.375
    quiet = melnikov.phase_flux(FORCING, 0.5, NoNoise())
    for diffusion in (1e-6, 1e-8):
        excess = melnikov.phase_flux(FORCING, 0.5, WhiteNoise(diffusion)) - quiet
        leading = 2.0 * diffusion / (2.0 * math.pi * math.sqrt(harmonic**2 - loss**2))
        assert excess == pytest.approx(leading, rel=2e3 * diffusion, abs=1e-16)
    for diffusion in (1e-30, 1e-200, 5e-324):
        assert melnikov.phase_flux(FORCING, 0.5, WhiteNoise(diffusion)) == pytest.approx(quiet, abs=1e-15)


def test_flux_without_loss_or_forcing():
    assert melnikov.phase_flux(FORCING, 1.0, NoNoise()) == pytest.approx(8.0 / 17.0 / math.pi, rel=1e-15)
    sigma = math.sqrt(0.05)
    assert melnikov.phase_flux((0.0, 1.0), 1.0, WhiteNoise(0.025)) == pytest.approx(sigma / math.sqrt(2.0 * math.pi))


def test_sampled_expectation_agrees_to_four_digits():
    """Fails falsely with probability 4e-6 a value (6 standard errors, Student's t of 23); the seed is fixed."""
    noises = [[NoNoise()], [NOISE]]
    sampled, error = melnikov.phase_flux_sampled(FORCING, RESTITUTIONS, noises, strata=400, repeats=24, seed=4)
    exact = np.array([QUIET, NOISY])
    assert np.all(np.abs(sampled - exact) < 6.0 * error)
    assert np.all(error < 1e-4 * exact)
    again, _ = melnikov.phase_flux_sampled(FORCING, 0.5, NOISE, strata=400, repeats=24, seed=4)
    assert again == pytest.approx(sampled[1, 1], rel=1e-12)
    other, own = (melnikov.phase_flux_sampled(FORCING, 0.5, NOISE, strata=400, repeats=24, seed=s)[0] for s in (5, 5))
    assert other == own
    assert 0.0 < abs(other - again) < 9.0 * error[1, 1]


def test_fluxes_as_printed():
    """(17) weighs the noise with σσ_M; (18) integrates the unscaled normal density from M - D y₂ on."""
    sigma = math.sqrt(melnikov.noise_variance(NOISE))
    for e in RESTITUTIONS:
        loss, scale = (1.0 - e * e) / 2.0, 0.4 * sigma
        printed = melnikov.phase_flux_as_printed(FORCING, e, NOISE)
        assert printed == pytest.approx(trapezoid(8 / 17, loss, scale), abs=1e-14)
        phases = np.pi * (np.arange(40) + 0.5) / 40.0
        inner = [
            quad(lambda y, low, scale: (scale * y - low) * math.exp(-y * y / 2.0), low, 12.0, (low, scale))[0]
            for low in loss - 8 / 17 * np.cos(phases)
        ]
        printed = melnikov.phase_flux_as_printed(FORCING, e, NOISE, equation=18)
        assert printed == pytest.approx(np.mean(inner) / math.sqrt(2.0 * math.pi), abs=1e-12)
    assert melnikov.phase_flux_as_printed(FORCING, RESTITUTIONS, NoNoise()) == pytest.approx(QUIET, abs=1e-14)
    # As read, (18) is negative where a flux cannot be.
    assert melnikov.phase_flux_as_printed(FORCING, 0.5, NOISE, equation=18) < -0.06


@pytest.mark.parametrize("k", [1, 2, 3, 4, 8, 16, 31, 32])
def test_a_single_harmonic_of_any_multiple_is_a_harmonic(k):
    """The mean over the phase does not depend on the multiple; within 1e-10 of the flux."""
    for ratio in (0.85, 0.95, 1.1):
        amplitude = 0.5 * 0.375 / ratio * (1.0 + (0.3 * k) ** 2)
        harmonic, several = (amplitude, 0.3 * k), Harmonics(0.3, (*[0.0] * (k - 1), amplitude), (0.25 * math.pi,) * k)
        for sigma in (1e-5, 1e-4, 1e-3, 1e-2, 0.1, 1.0):
            noise = WhiteNoise(0.5 * sigma**2)
            flux = melnikov.phase_flux(harmonic, 0.5, noise)
            assert melnikov.phase_flux(several, 0.5, noise) == pytest.approx(flux, rel=1e-10, abs=1e-300)
        assert melnikov.phase_flux(several, 0.5, NoNoise()) == pytest.approx(
            melnikov.phase_flux(harmonic, 0.5, NoNoise()), rel=1e-10, abs=1e-15
        )


@pytest.mark.parametrize("sigma", [1e-3, 1e-2, 1.0])
def test_sums_of_harmonics_by_another_quadrature(sigma):
    """Random sums up to the 64th harmonic, against the trapezoidal rule with its points far denser than σ."""
    rng, loss = np.random.default_rng(3), 0.375
    for _ in range(4):
        multiples = [1, *rng.choice(np.arange(2, 65), 2, replace=False).tolist()]
        parts = [(k, rng.uniform(0.1, 0.4), rng.uniform(0.0, 6.0)) for k in multiples]
        count = int(max(2**13, 30 * sum(k * a for k, a, _ in parts) / sigma))
        phases = 2.0 * np.pi * (np.arange(count) + 0.37) / count
        u = (sum(a * np.cos(k * phases + psi) for k, a, psi in parts) - loss) / sigma
        truth = sigma * np.mean(np.exp(-0.5 * u * u) / math.sqrt(2.0 * math.pi) + u * ndtr(u))
        assert mean_excess(parts, loss, sigma) == pytest.approx(truth, rel=1e-11)
