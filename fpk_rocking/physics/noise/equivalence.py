"""White noise that stands for band noise or filtered noise: equal variance of the Melnikov process.

Noise seen along the heteroclinic orbit of the undamped, unforced block, M(τ₀) = ∫ K(τ) η(τ + τ₀) dτ with the kernel K
of `physics.motion.separatrix`, has the variance σ_M² = ∫ G(ω) K̂(ω)² dω, with G the one-sided spectral density of η. A
slender block has K = e^(-|τ|) and K̂ = 2/(1+ω²) (H. Lin and S. C. S. Yim, J. Eng. Mech. 122(8), 719-727, 1996, eq. 15).

What the replacement changes has to be measured. What may explain it is `relative_variance`, the part of the orbit's
frequencies that the band takes in, and `realized_spread`, by how much the realizations of finitely many harmonics
differ.
"""

import math

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.basis import gauss_legendre
from fpk_rocking.base.checks import Array, ArrayLike, Number
from fpk_rocking.physics.motion.separatrix import checked_angle, kernel_halves, melnikov_kernel, white_gain
from fpk_rocking.physics.noise.kinds import NOISES, BandNoise, Noise


def noise_variance(noise: Noise, *, critical_angle: float = 0.0) -> float:
    """Variance σ_M² of the Melnikov process of a noise, nondimensional.

    For a slender block it is 2D for white noise; for a band [a, b] it is (2 variance/(b-a)) [ω/(1+ω²) + atan ω] from a
    to b (eq. 15, with its σ²); for filtered noise it is the value of its `StateSpace` times the variance. For α > 0
    that of a band is computed by quadrature, the others in closed form.

    Parameters
    ----------
    noise : BandNoise, WhiteNoise, FilteredNoise or NoNoise
    critical_angle : float
        α of the block, from 0, a slender one, to π/2, radians.

    Raises
    ------
    TypeError, ValueError
        The noise is not one of these, or α is out of bounds.

    Examples
    --------
    >>> from fpk_rocking import BandNoise, WhiteNoise, melnikov
    >>> print(f"{melnikov.noise_variance(BandNoise(variance=0.04, band=(0.0, 10.0), harmonics=100)):.4f}")
    0.0126
    >>> print(melnikov.noise_variance(WhiteNoise(diffusion=0.005)))
    0.01
    """
    _check(noise)
    if noise.kind == "none":
        return 0.0
    if noise.kind == "white":
        return 2.0 * noise.diffusion * white_gain(critical_angle)
    if noise.kind == "band":
        if checked_angle(critical_angle) > 0.0:
            weights, frequencies = _quadrature(noise)
            cosine, _ = kernel_halves(frequencies, critical_angle)
            return 4.0 * noise.variance * float(weights @ np.square(cosine))
        low, high = noise.band
        width = high - low
        # The two differences of eq. 15 divided by the width in closed form, so that a narrow band loses no digits.
        arcs = math.atan2(width, 1.0 + low * high) / width
        ratios = (1.0 - low * high) / ((1.0 + low * low) * (1.0 + high * high))
        return 2.0 * noise.variance * (arcs + ratios)
    return noise.variance * noise.space.variance_along(*melnikov_kernel(critical_angle))


def equivalent_diffusion(noise: Noise, *, critical_angle: float = 0.0) -> float:
    """Diffusion D_M, ⟨ηη⟩ = 2Dδ, of the white noise with the same Melnikov variance: σ_M²/2 for a slender block.

    Replacing band noise or filtered noise by this white noise is an approximation (a closure): check it by Monte Carlo
    with the noise itself. For white noise this is its own diffusion.

    Parameters
    ----------
    noise : BandNoise, WhiteNoise, FilteredNoise or NoNoise
    critical_angle : float
        α of the block, from 0 to π/2, radians. For α > 0 D_M is σ_M² over twice the integral of the squared kernel.

    Raises
    ------
    TypeError, ValueError
        As `noise_variance`.

    Examples
    --------
    >>> from fpk_rocking import BandNoise, melnikov
    >>> print(f"{melnikov.equivalent_diffusion(BandNoise(variance=0.04, band=(0.0, 10.0), harmonics=100)):.5f}")
    0.00628
    """
    _check(noise)
    if noise.kind == "white":
        return noise.diffusion
    return 0.5 * noise_variance(noise, critical_angle=critical_angle) / white_gain(critical_angle)


def relative_variance(noise: Noise, *, critical_angle: float = 0.0) -> float:
    """Melnikov variance of a noise over that of white noise as strong as the peak of its spectrum, from 0 to 1.

    It is near 1 if the spectrum contains all frequencies that move the block, and small if it lacks them. With G the
    peak of the one-sided spectral density it is σ_M²/(πG) for a slender block, for a band (1/π) ∫ 4/(1+ω²)² dω over it.

    Parameters
    ----------
    noise : BandNoise or FilteredNoise
        Of a variance above 0.
    critical_angle : float
        α of the block, from 0 to π/2, radians.

    Raises
    ------
    TypeError, ValueError
        The noise has another kind, or the variance 0, or α is out of bounds.

    Examples
    --------
    >>> from fpk_rocking import BandNoise, melnikov
    >>> bands = [(0.0, 10.0), (1.0, 6.0), (4.0, 10.0)]
    >>> print([round(melnikov.relative_variance(BandNoise(0.04, band, harmonics=100)), 3) for band in bands])
    [1.0, 0.18, 0.006]
    """
    _check(noise)
    white = math.pi * white_gain(critical_angle)
    if noise.kind == "filtered" and noise.variance > 0.0:
        along = noise.space.variance_along(*melnikov_kernel(critical_angle))
        return along / (white * noise.space.peak_density)
    banded = _band(noise)
    low, high = banded.band
    return noise_variance(noise, critical_angle=critical_angle) * (high - low) / (white * banded.variance)


def response(frequency: ArrayLike, restitution: float, *, critical_angle: float = 0.0) -> Number:
    """Weight of a frequency in the diffusion that a realization stands for, with the jump of velocity kept.

    A block that passes the impact leaves x = 0 with e times the velocity it arrived with. The squared transform of that
    motion is [(1+e)² + (1-e)²ω²]/(1+ω²)². The response is this over 1 + e²: a realization with the spectrum G stands
    for white noise of the diffusion D = ∫ G(ω) response dω (derived in docs/theory, "Noise"). At e = 1 it is K̂²/2. For
    α > 0 it is made of the kernel before and after the impact, and right to first order in the noise.
    """
    e, square = restitution, np.square(frequency)
    if checked_angle(critical_angle) > 0.0:
        cosine, sine = kernel_halves(frequency, critical_angle)
        white = (1.0 + e * e) * white_gain(critical_angle)
        return (((1.0 + e) * cosine) ** 2 + ((1.0 - e) * sine) ** 2) / white
    return ((1.0 + e) ** 2 + (1.0 - e) ** 2 * square) / ((1.0 + e * e) * (1.0 + square) ** 2)


def forgetful_diffusion(noise: Noise) -> float:
    """Diffusion of the white noise as strong as a noise for a block that an impact lets forget its flight before.

    Such a block has the `response` of e = 0, 1/(1+ω²) if it is slender, for which this is derived.

    Parameters
    ----------
    noise : BandNoise, WhiteNoise or FilteredNoise
    """
    _check(noise)
    if noise.kind == "white":
        return noise.diffusion
    if noise.kind == "filtered":
        return noise.variance * noise.space.inward_variance
    low, high = _band(noise).band
    return noise.variance * math.atan2(high - low, 1.0 + low * high) / (high - low)


def realized_spread(noise: Noise, restitution: float, *, critical_angle: float = 0.0) -> float:
    """Relative scatter between realizations of band noise: standard deviation over mean of their equivalent diffusions.

    A realization draws its N harmonics once. How strongly it acts on the block depends on their frequencies, and on
    the amplitudes of stratified ones. The scatter falls like N^(-1/2). It matters over long times only: as long as
    stratified harmonics are enough (`BandNoise`), they act as Gaussian noise does.

    Parameters
    ----------
    noise : BandNoise
        Of a variance above 0.
    restitution : float
        Restitution e, from 0 to 1.
    critical_angle : float
        α of the block, from 0 to π/2, radians.

    Raises
    ------
    TypeError, ValueError
        The noise has another kind, or the variance 0, or e or α is out of bounds.

    Examples
    --------
    >>> from fpk_rocking import BandNoise, melnikov
    >>> print([round(melnikov.realized_spread(BandNoise(0.04, (0.0, 10.0), n), 0.5), 2) for n in (30, 100, 1000)])
    [0.44, 0.24, 0.08]
    """
    banded, e = _band(noise), checks.number("restitution", restitution, at_least=0.0, at_most=1.0)
    weights, frequency = _quadrature(banded)
    values = np.asarray(response(frequency, e, critical_angle=critical_angle))
    mean, square = weights @ values, weights @ values**2
    if banded.frequencies == "stratified":
        (low, high), parts = banded.band, np.arange(banded.harmonics)[:, None]
        nodes, weights = gauss_legendre(8, 0.0, 1.0)
        places = low + (high - low) * (parts + nodes) / banded.harmonics
        means = np.asarray(response(places, e, critical_angle=critical_angle)) @ weights
        # Squared amplitudes are exponential: their mean square is twice their squared mean.
        return math.sqrt((2.0 * square - np.mean(means**2)) / banded.harmonics) / mean
    # A band so narrow that its responses do not differ may come out below zero by rounding.
    return math.sqrt(max(square / mean**2 - 1.0, 0.0) / banded.harmonics)


def _quadrature(noise: BandNoise) -> tuple[Array, Array]:
    """Weights and frequencies, (32,) each, of means over the band of `noise`.

    Gauss-Legendre in θ = atan ω, where the responses of a slender block are trigonometric polynomials.
    """
    low, high = noise.band
    half = 0.5 * math.atan2(high - low, 1.0 + low * high)
    nodes, weights = gauss_legendre(32, -1.0, 1.0)
    frequency = np.tan(math.atan(low) + half * (1.0 + nodes))
    return half * weights * (1.0 + frequency**2) / (high - low), frequency


def _check(noise: Noise) -> None:
    """Raise TypeError for a value that is no noise."""
    if getattr(noise, "kind", None) not in NOISES:
        raise TypeError(checks.refusal("noise", noise, "BandNoise, WhiteNoise, FilteredNoise or NoNoise"))


def _band(noise: Noise) -> BandNoise:
    """`noise` itself if it is band noise of a variance above 0; else ValueError."""
    if noise.kind != "band" or noise.variance == 0.0:
        raise ValueError(f"noise: got {noise!r}, accepted: band noise of a variance > 0")
    return noise
