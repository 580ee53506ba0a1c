"""Filters of one and two states in closed form: what their noise is, formula by formula (docs/theory, "Noise")."""

import math

import numpy as np


def state_space(noise):
    """Drift, input, output and standard deviations of the states: η; η and η'; or g and g'. They are independent."""
    omega, sigma = noise.frequency, math.sqrt(noise.variance)
    if noise.filter == "exponential":
        return (np.array([[-omega]]), np.array([sigma * math.sqrt(2.0 * omega)]), np.ones(1), np.array([sigma]))
    zeta, output = noise.damping, np.array([1.0, 0.0])
    if noise.filter == "kanai-tajimi":
        sigma /= math.hypot(1.0, 2.0 * zeta)
        output[1] = 2.0 * zeta / omega
    return (
        np.array([[0.0, 1.0], [-omega * omega, -2.0 * zeta * omega]]),
        np.array([0.0, 2.0 * sigma * omega * math.sqrt(zeta * omega)]),
        output,
        np.array([sigma, omega * sigma]),
    )


def fastest(noise):
    """Size of the fastest eigenvalue."""
    damping = noise.damping or 0.0
    return noise.frequency * (damping + math.sqrt(damping**2 - 1.0) if damping > 1.0 else 1.0)


def spectral_density(noise, frequency):
    """One-sided spectral density G at frequencies of at least 0."""
    ratio = np.square(np.asarray(frequency) / noise.frequency)
    if noise.filter == "exponential":
        return 2.0 * noise.variance / (math.pi * noise.frequency) / (1.0 + ratio)
    level = 4.0 * noise.damping * noise.variance / (math.pi * noise.frequency)
    loss = 4.0 * noise.damping**2
    if noise.filter == "kanai-tajimi":
        level = level * (1.0 + loss * ratio) / (1.0 + loss)
    return level / (np.square(1.0 - ratio) + loss * ratio)


def peak_density(noise):
    """Largest value of `spectral_density`."""
    square = 0.0
    if noise.filter == "low-pass":
        square = max(0.0, 1.0 - 2.0 * noise.damping**2)
    if noise.filter == "kanai-tajimi":
        # (√(1 + 8 ζ²) - 1)/(4 ζ²), which would cancel.
        square = 2.0 / (math.sqrt(1.0 + 8.0 * noise.damping**2) + 1.0)
    return float(spectral_density(noise, noise.frequency * math.sqrt(square)))


def autocovariance(noise, lag):
    """Mean of η(τ) η(τ + lag)."""
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
    """Variance of the Melnikov process: 2 [R^(1) - R^'(1)] with the Laplace transform R^ of the autocovariance."""
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


def _slope(noise):
    """Return μ: the Laplace transform of the autocovariance over σ² is (s + μ)/(s² + 2ζω s + ω²)."""
    full = 2.0 * noise.damping * noise.frequency
    return full / (1.0 + 4.0 * noise.damping**2) if noise.filter == "kanai-tajimi" else full


def own_autocovariance(own, lag):
    """Mean of η(τ) η(τ + lag) of a filter of any order for a variance of 1, by its eigenvectors."""
    drift, source, output, _ = own.space
    rates, vectors = np.linalg.eig(drift)
    weights = (output @ vectors) * np.linalg.solve(vectors, source)
    # ∫ h(t) h(t + lag) dt of the response h = Σ weights exp(rates t)
    pairs = -np.sum(weights[:, None] * weights / (rates[:, None] + rates), axis=1)
    return np.sum(pairs * np.exp(np.abs(lag)[..., None] * rates), axis=-1).real
