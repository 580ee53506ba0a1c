"""Filtered noise: white noise through a linear filter, its spectrum, its correlation and its exact steps in time.

    exponential     η' + ω η = w
    low-pass        η'' + 2 ζ ω η' + ω² η = w
    kanai-tajimi    η = g + (2 ζ/ω) g',   g'' + 2 ζ ω g' + ω² g = w

with white noise w, whose intensity follows from the variance of η. The last is the acceleration of the ground above a
rock that shakes in white noise: K. Kanai, Bull. Earthq. Res. Inst. Univ. Tokyo 35, 309-325, 1957; H. Tajimi, Proc. 2nd
World Conf. Earthq. Eng. II, 781-797, 1960. The noise is stationary. Formulas are derived in docs/theory, "Noise"; all
quantities are nondimensional. A scene imports this module, so scipy is imported where it is used.
"""

import math
from typing import NamedTuple

import numpy as np

FILTERS = ("exponential", "low-pass", "kanai-tajimi")
"""Filters by their name in a scene."""

BUTTERWORTH = math.sqrt(0.5)
"""Damping of the low-pass filter whose spectrum is flattest at low frequencies."""

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(20)
_SLOWEST, _FASTEST = 1e-8, 1e8


class StateSpace(NamedTuple):
    """A filter of n states: dz = drift z dτ + input dW, η = output z.

    `drift` (n, n), `input` (n,), `output` (n,); `spread` (n,): standard deviations of the states, which are independent
    of each other at any one time. The states are η alone; η and η'; or g and g'.
    """

    drift: np.ndarray
    input: np.ndarray
    output: np.ndarray
    spread: np.ndarray


def state_space(noise):
    """Return the `StateSpace` of a filtered noise."""
    omega, sigma = noise.frequency, math.sqrt(noise.variance)
    if noise.filter == "exponential":
        return StateSpace(
            np.array([[-omega]]), np.array([sigma * math.sqrt(2.0 * omega)]), np.ones(1), np.array([sigma])
        )
    zeta, output = noise.damping, np.array([1.0, 0.0])
    if noise.filter == "kanai-tajimi":
        sigma /= math.hypot(1.0, 2.0 * zeta)
        output[1] = 2.0 * zeta / omega
    return StateSpace(
        np.array([[0.0, 1.0], [-omega * omega, -2.0 * zeta * omega]]),
        np.array([0.0, 2.0 * sigma * omega * math.sqrt(zeta * omega)]),
        output,
        np.array([sigma, omega * sigma]),
    )


def transition(drift, source, duration):
    """Exact step of a linear system dz = drift z dτ + source dW.

    Parameters
    ----------
    drift : ndarray, shape (n, n)
    source : ndarray, shape (n,)
    duration : float
        Of the step.

    Returns
    -------
    ndarray, shape (n, n)
        Φ: the mean moves from z to Φ z.
    ndarray, shape (n, n)
        Covariance that the noise adds: ∫ Φ(t) source sourceᵀ Φ(t)ᵀ dt, by Gauss-Legendre quadrature over a part of the
        step in which nothing moves fast, then doubled. Nothing cancels, so short steps lose no digits.
    """
    from scipy.linalg import expm

    rate = np.abs(np.linalg.eigvals(drift)).max()
    doublings = max(0, math.ceil(math.log2(max(rate * duration, 1.0))))
    short = duration / 2**doublings
    moved = expm(drift * (0.5 * short * (1.0 + _NODES))[:, None, None]) @ source
    covariance = (moved.T * (0.5 * short * _WEIGHTS)) @ moved
    phi = expm(drift * short)
    for _ in range(doublings):
        covariance = covariance + phi @ covariance @ phi.T
        phi = phi @ phi
    return phi, covariance


def fastest(noise):
    """Return the largest rate of a filter, the size of its fastest eigenvalue: noise is sampled in parts of 1/rate."""
    damping = noise.damping or 0.0
    return noise.frequency * (damping + math.sqrt(damping**2 - 1.0) if damping > 1.0 else 1.0)


def spectral_density(noise, frequency):
    """One-sided spectral density G, whose integral over all ω > 0 is the variance.

    Parameters
    ----------
    noise : FilteredNoise
    frequency : array_like
        ω, at least 0.

    Returns
    -------
    ndarray or float
        With r = (ω/ω₀)²: (2 σ²/(π ω₀))/(1 + r) for the exponential filter of frequency ω₀; else
        (4 ζ σ²/(π ω₀))/((1 - r)² + 4 ζ² r), and for Kanai-Tajimi that times (1 + 4 ζ² r)/(1 + 4 ζ²).
    """
    ratio = np.square(np.asarray(frequency) / noise.frequency)
    if noise.filter == "exponential":
        return 2.0 * noise.variance / (math.pi * noise.frequency) / (1.0 + ratio)
    level = 4.0 * noise.damping * noise.variance / (math.pi * noise.frequency)
    loss = 4.0 * noise.damping**2
    if noise.filter == "kanai-tajimi":
        level = level * (1.0 + loss * ratio) / (1.0 + loss)
    return level / (np.square(1.0 - ratio) + loss * ratio)


def peak_density(noise):
    """Return the largest value of `spectral_density`."""
    square = 0.0
    if noise.filter == "low-pass":
        square = max(0.0, 1.0 - 2.0 * noise.damping**2)
    if noise.filter == "kanai-tajimi":
        # (√(1 + 8 ζ²) - 1)/(4 ζ²), which would cancel.
        square = 2.0 / (math.sqrt(1.0 + 8.0 * noise.damping**2) + 1.0)
    return float(spectral_density(noise, noise.frequency * math.sqrt(square)))


def autocovariance(noise, lag):
    """Mean of η(τ) η(τ + lag).

    Parameters
    ----------
    noise : FilteredNoise
    lag : array_like
        Of either sign.

    Returns
    -------
    ndarray or float
        σ² exp(-ω|lag|) for the exponential filter; else σ² exp(-ζω|lag|) [cos + (μ - ζω) sin /ω_d] of ω_d |lag|, with
        ω_d = ω √(1 - ζ²) and μ of `_slope`.
    """
    time, omega = np.abs(lag), noise.frequency
    if noise.filter == "exponential":
        return noise.variance * np.exp(-omega * time)
    # Both rates, complex below critical damping; the mean of their exponentials, and the difference over that of rates.
    split = omega * np.sqrt(complex(noise.damping**2 - 1.0))
    slow = omega * omega / (noise.damping * omega + split)
    decay, twice = np.exp(-slow * time), 2.0 * split
    even = 0.5 * decay * (1.0 + np.exp(-twice * time))
    odd = time * decay if twice == 0.0 else -decay * np.expm1(-twice * time) / twice
    return noise.variance * (even + (_slope(noise) - noise.damping * omega) * odd).real


def melnikov_variance(noise):
    """Variance of the Melnikov process, σ_M² = ∫ 4 G/(1 + ω²)² dω over all ω > 0, in closed form.

    Returns
    -------
    float
        2 σ² (2 + ω)/(1 + ω)² for the exponential filter; else 2 σ² [μ d + 2 (1 + μ)(1 + ζω)]/d² with
        d = 1 + 2ζω + ω² and μ of `_slope`.
    """
    omega = noise.frequency
    if noise.filter == "exponential":
        return 2.0 * noise.variance * (2.0 + omega) / (1.0 + omega) ** 2
    return noise.variance * _melnikov_ratio(omega, noise.damping, _slope(noise))


def inward_variance(noise):
    """Variance of the stationary q' = -q - η, by which a flight moves inward: ∫ R(t) exp(-t) dt over t > 0."""
    if noise.filter == "exponential":
        return noise.variance / (1.0 + noise.frequency)
    slope, omega = _slope(noise), noise.frequency
    return noise.variance * (1.0 + slope) / (1.0 + 2.0 * noise.damping * omega + omega * omega)


def _melnikov_ratio(omega, zeta, mu):
    """σ_M²/σ² of a filter of second order."""
    d = 1.0 + 2.0 * zeta * omega + omega * omega
    return 2.0 * (mu * d + 2.0 * (1.0 + mu) * (1.0 + zeta * omega)) / (d * d)


def low_pass_frequency(ratio, damping=BUTTERWORTH):
    """Frequency ω of the low-pass filter with a given σ_M² of noise of variance 1.

    σ_M² falls from 4 to 0 as ω grows, as that of every filter does, so there is one ω.

    Parameters
    ----------
    ratio : float
        σ_M²/σ².
    damping : float
        ζ.

    Returns
    -------
    float or None
        None where no ω from 1e-8 to 1e8 has it.
    """
    from scipy.optimize import brentq

    def excess(power):
        omega = math.exp(power)
        return _melnikov_ratio(omega, damping, 2.0 * damping * omega) - ratio

    low, high = math.log(_SLOWEST), math.log(_FASTEST)
    if not excess(low) > 0.0 > excess(high):
        return None
    return math.exp(brentq(excess, low, high, xtol=1e-15, rtol=1e-15))


def _slope(noise):
    """Return μ: the Laplace transform of the autocovariance over σ² is (s + μ)/(s² + 2ζω s + ω²)."""
    full = 2.0 * noise.damping * noise.frequency
    return full / (1.0 + 4.0 * noise.damping**2) if noise.filter == "kanai-tajimi" else full
