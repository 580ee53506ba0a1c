"""Phase flux: the mean positive part of the Melnikov process (paper eqs. 17 to 20).

Φ is the phase-space area that crosses the separatrix of one saddle per unit time, to first order; the area inside the
heteroclinic orbits is (16/α²)(1 - cos(α/2)), 2 for a slender block. With y₁ a standard normal number and y₂ the cosine
of a uniform phase

    Φ = E[(σ_M y₁ + D_m y₂ - M)⁺] = (1/π) ∫₀^π σ_M [φ(u) + u N(u)] dθ,    u = (D_m cos θ - M)/σ_M,

φ and N the normal density and distribution. The bracket is u⁺ + ψ(|u|) with ψ(t) = φ(t) - t N(-t): the first part is
the flux without noise, in closed form, and ψ is left to quadrature where it matters, within a few σ_M of u = 0.
"""

import itertools
import math
from collections.abc import Sequence

import numpy as np

from fpk_rocking.analytics.process import (
    amplitude_and_frequency,
    forcing_along_orbit,
    noise_array,
    process_terms,
    refuse_exact,
)
from fpk_rocking.base import checks
from fpk_rocking.base.basis import gauss_legendre
from fpk_rocking.base.checks import Array, ArrayLike, Number
from fpk_rocking.physics.forcing import Harmonic, Harmonics
from fpk_rocking.physics.noise.kinds import Noise


def phase_flux(
    forcing: Harmonic | Harmonics | tuple[ArrayLike, ArrayLike],
    restitution: ArrayLike,
    noise: Noise | Sequence[Noise],
    *,
    critical_angle: float = 0.0,
) -> Number:
    """Phase flux Φ = E[(σ_M y₁ + D_m y₂ - M)⁺] (paper eq. 17, corrected).

    It is the phase-space area that crosses a separatrix per unit time. y₁ is a standard normal number and y₂ the cosine
    of a uniform phase; σ_M² is that of `noise_variance`, D_m that of `harmonic_amplitude` and M that of `impact_loss`.
    Without noise it is (1/π)[√(D_m² - M²) - M arccos(M/D_m)] where D_m > M, else 0. The error is 1e-13 of the larger of
    Φ and D_m. Amplitudes, frequencies, restitutions and noises broadcast.

    Parameters
    ----------
    forcing : Harmonic, Harmonics or (amplitude, frequency)
        The pair holds array_like A >= 0 and Ω > 0; the phase of a single harmonic has no influence. Where several
        harmonics make the two saddles differ, the flux is the mean over both.
    restitution : array_like
        e, from 0 to 1.
    noise : BandNoise, WhiteNoise, FilteredNoise or NoNoise, or a sequence of them
    critical_angle : float
        α of the block, from 0, a slender one, to π/2, radians.

    Examples
    --------
    >>> from fpk_rocking import NoNoise, WhiteNoise, melnikov
    >>> print(melnikov.phase_flux((4.6, 2.7), 0.5, [NoNoise(), WhiteNoise(0.005)]).round(4))
    [0.1861 0.1876]
    """
    harmonic, loss, sigma = process_terms(forcing, restitution, noise, critical_angle)
    if not isinstance(forcing, Harmonics):
        return _excess(harmonic, loss, sigma)
    along = forcing_along_orbit(forcing, critical_angle)
    pairs = zip(loss.flat, sigma.flat, strict=True)
    return np.reshape([_excess_of_sum(along, *pair) for pair in pairs], loss.shape)[()]


def phase_flux_as_printed(
    forcing: Harmonic | Harmonics | tuple[ArrayLike, ArrayLike],
    restitution: ArrayLike,
    noise: Noise | Sequence[Noise],
    equation: int = 17,
    *,
    critical_angle: float = 0.0,
) -> Number:
    """Phase flux of a slender block with the paper's misprints, only for comparison with its figures.

    Eq. 17 as printed multiplies the noise by σ σ_M, although the σ_M of eq. 15 contains σ already. Eq. 18 has the same
    factor and does not divide by it where the variable is normalized. The sign and the √2 of erf in eq. 18 and the
    definition of erf (eq. 19a) are corrected here. With L = M - D_m y₂ this function evaluates

    * 17: E[(σ σ_M y₁ + D_m y₂ - M)⁺],
    * 18: E over y₂ of ∫_L^∞ (σ σ_M y₁ - L) φ(y₁) dy₁ = σ σ_M φ(L) - (L/2)(1 - erf(L/√2)).

    Without noise eq. 17 as printed is right, eq. 18 is not.

    Parameters
    ----------
    forcing, restitution
        As for `phase_flux`, of one harmonic.
    noise : BandNoise, FilteredNoise or NoNoise, or a sequence of them
        White noise is refused, as it has no σ.
    equation : {17, 18}
        Equation of the paper.
    critical_angle : float
        α of the block, 0: a block with another is refused.

    Examples
    --------
    >>> from fpk_rocking import load_scene, melnikov
    >>> noise = load_scene("main").noise
    >>> print(f"{melnikov.phase_flux_as_printed((4.6, 2.7), 0.5, noise, equation=17):.3f}")
    0.186
    >>> print(f"{melnikov.phase_flux_as_printed((4.6, 2.7), 0.5, noise, equation=18):.3f}")
    0.063
    """
    refuse_exact(critical_angle, "the flux as printed")
    if equation not in (17, 18):
        raise ValueError(checks.refusal("equation", equation, "17 or 18"))
    harmonic, loss, sigma = process_terms(amplitude_and_frequency(forcing), restitution, noise)
    scale = sigma * _strengths(noise)
    if equation == 17:
        return _excess(harmonic, loss, scale)
    # σσ_M φ(L) - L N(-L) is the unscaled bracket, that of σ_M = 1, and (σσ_M - 1) φ(L).
    unit = np.ones(scale.shape)
    return (_excess(harmonic, loss, unit) + (scale - 1.0) * _mean_near_zero(normal_density, harmonic, loss, unit))[()]


def phase_flux_sampled(
    forcing: Harmonic | Harmonics | tuple[ArrayLike, ArrayLike],
    restitution: ArrayLike,
    noise: Noise | Sequence[Noise],
    *,
    strata: int = 256,
    repeats: int = 16,
    seed: int = 1,
    critical_angle: float = 0.0,
) -> tuple[Number, Number]:
    """Phase flux by Monte Carlo of the expectation, a check of `phase_flux`: (mean of the repeats, its standard error).

    Sampling is stratified (W. J. Cochran, Sampling Techniques, 1977): y₁ and y₂ are drawn once in each of strata² cells
    of equal probability. The estimate is unbiased, and its error falls nearly like 1/strata².

    Parameters
    ----------
    forcing, restitution, noise
        As for `phase_flux`, of one harmonic. All their values share the random numbers.
    strata, repeats : int
        Number of strata along each axis, at least 1, and of repeats, at least 2.
    seed : int
        Seed of numpy's default generator.
    critical_angle : float
        α of the block, from 0, a slender one, to π/2, radians.

    Examples
    --------
    >>> from fpk_rocking import WhiteNoise, melnikov
    >>> flux, error = melnikov.phase_flux_sampled((4.6, 2.7), 0.5, WhiteNoise(0.005), strata=64)
    >>> print(f"{flux:.4f}", error < 1e-4)
    0.1876 True
    """
    from scipy.special import ndtri

    strata, repeats = checks.count("strata", strata), checks.count("repeats", repeats)
    if repeats == 1:
        raise ValueError(checks.refusal("repeats", repeats, "a whole number >= 2"))
    terms = process_terms(amplitude_and_frequency(forcing), restitution, noise, critical_angle)
    harmonic, loss, sigma = (part[..., None, None] for part in terms)
    generator, corners = np.random.default_rng(seed), np.arange(strata)
    means = []
    for _ in range(repeats):
        jitter = generator.random((2, strata, strata))
        normal = ndtri(np.maximum((corners[:, None] + jitter[0]) / strata, np.finfo(float).tiny))
        cosine = np.cos(math.pi * (corners + jitter[1]) / strata)
        means.append(np.maximum(sigma * normal + harmonic * cosine - loss, 0.0).mean(axis=(-2, -1)))
    return np.mean(means, axis=0)[()], (np.std(means, axis=0, ddof=1) / math.sqrt(repeats))[()]


def _excess_of_sum(along, loss, sigma):
    """Return E[(σ y + d - M)⁺] for the periodic part d of a Melnikov process, averaged over both saddles."""
    if sigma == 0.0:
        # The mean of d is 0, so that of max(-d - M, 0) is that of max(d + M, 0) less M.
        return 0.5 * (along.mean_excess(loss) + along.mean_excess(-loss) - loss)
    mirrored = [(k, amplitude, phase + math.pi) for k, amplitude, phase in along.components]
    return 0.5 * (mean_excess(along.components, loss, sigma) + mean_excess(mirrored, loss, sigma))


def _strengths(noise):
    """Return the standard deviations σ of one noise, or of each of a nested sequence; ValueError for white noise."""
    array = noise_array(noise)
    for entry in array.flat:
        if entry.kind == "white":
            raise ValueError(
                checks.refusal("noise.kind", entry.kind, "'band', 'filtered' or 'none' (white noise has no σ)")
            )
    return np.sqrt([getattr(entry, "variance", 0.0) for entry in array.flat]).reshape(array.shape)


def _excess(harmonic, loss, sigma):
    """Return E[(σ y₁ + D y₂ - M)⁺] for arrays that broadcast: `harmonic` D, `loss` M and `sigma` σ."""
    quiet = np.sqrt(np.maximum(harmonic - loss, 0.0) * (harmonic + loss))
    quiet = (quiet - loss * np.arctan2(quiet, loss)) / math.pi
    return (quiet + sigma * _mean_near_zero(kink_rounding, harmonic, loss, sigma))[()]


def _mean_near_zero(function, harmonic, loss, sigma):
    """Return the mean over the phase θ of an even function of u = (D cos θ - M)/σ that falls like exp(-u²/2).

    It is smooth beside u = 0, and takes |u|. Gauss-Legendre on the phases with 0 < u < 9 and on those with u < 0, down
    to 9 below the largest one: u varies by 9 at most, so that the number of nodes suffices for every σ.
    """
    harmonic, loss, sigma = (np.asarray(part, float)[..., None] for part in np.broadcast_arrays(harmonic, loss, sigma))
    nodes, weights = gauss_legendre(48, -1.0, 1.0)
    reach = 9.0 * sigma
    ends = [_phase_of(level, harmonic) for level in (loss + reach, loss, np.minimum(loss, harmonic) - reach)]
    total = 0.0
    for first, last in itertools.pairwise(ends):
        middle, half = 0.5 * (last + first), 0.5 * (last - first)
        height = np.abs(harmonic * np.cos(middle + half * nodes) - loss)
        # Beyond 40 all is zero; without noise the phases have no width.
        u = np.minimum(height, 40.0 * sigma) / np.where(sigma > 0.0, sigma, 1.0)
        total = total + (half * weights * function(u)).sum(axis=-1)
    return total / math.pi


def _phase_of(level, harmonic):
    """Return the phase from 0 to π at which D cos θ falls to a level, an end where it does not."""
    cosine = np.clip(level, -harmonic, harmonic) / np.where(harmonic > 0.0, harmonic, 1.0)
    return np.arccos(np.where(harmonic > 0.0, cosine, np.sign(level)))


def mean_excess(components: Sequence[tuple[int, float, float]], loss: float, sigma: float) -> float:
    """Mean of E[(σ y + d - M)⁺] over a cycle, y a standard normal number and d the sum of components D_k cos(kθ + Ψ_k).

    `components` are (k, D_k, Ψ_k), `sigma` is above 0. Gauss-Legendre quadrature on panels: one is halved until a bound
    of the range of u = (d - M)/σ in it shows that its nodes resolve the integrand. So the error is known before the
    quadrature is made, and nothing depends on the agreement of two sums, which may agree by chance. The rounding of d
    limits it to 1e-15 (|M| + Σ D_k) for the part of the cycle in which u is above -10.
    """
    table = np.array(components, float)
    k, amplitude, phase = table[table[:, 1] > 0.0].T
    # The nodes have the integrand to 1e-13 of its largest value in a panel with a range of u up to 3. Above u = 10 the
    # noise adds nothing, and 10 below the largest u nothing is left: exp(-50). A panel is at most an eighth of a period
    # of the highest harmonic, in which d is close to a polynomial.
    far = 10.0
    # Middles and widths are in cycles and dyadic, so that k times a middle loses no digit.
    count = 2 ** math.ceil(math.log2(8 * k.max()))
    middles, width, total, top = (np.arange(count) + 0.5) / count, 1.0 / count, 0.0, -math.inf
    curvature, finest = float(amplitude @ k**2), np.finfo(float).eps * (abs(loss) + float(amplitude.sum()))
    while middles.size:
        angles = 2.0 * math.pi * np.mod(np.outer(middles, k), 1.0) + phase
        height, half = np.cos(angles) @ amplitude - loss, math.pi * width
        reach = np.abs(np.sin(angles) @ (k * amplitude)) * half + 0.5 * curvature * half * half
        top = max(top, float(height.max()))
        matters = height + reach > min(top, 0.0) - far * sigma
        fine = (2.0 * reach <= max(3.0 * sigma, finest)) | (height - reach > far * sigma)
        total += width * _panels(angles[matters & fine], half * k, amplitude, loss, sigma)
        middles = middles[matters & ~fine]
        width *= 0.5
        middles = np.concatenate([middles - 0.5 * width, middles + 0.5 * width])
    return total


def _panels(phases, half_turns, amplitudes, loss, sigma):
    """Sum the means of E[(σ y + d - M)⁺] in panels; `phases` (panels, n) are at their middles."""
    nodes, weights = gauss_legendre(24, -1.0, 1.0)
    height = np.full((len(phases), nodes.size), -loss)
    for n, size in enumerate(amplitudes):
        height += size * np.cos(phases[:, n, None] + half_turns[n] * nodes)
    excess = np.maximum(height, 0.0) + sigma * kink_rounding(np.abs(height) / sigma)
    return 0.5 * float(np.sum(excess @ weights))


def kink_rounding(u: Array) -> Array:
    """ψ(u) = φ(u) - u N(-u), by which noise rounds the kink of u⁺, without loss of digits in the tail."""
    from scipy.special import erfcx

    return normal_density(u) * (1.0 - math.sqrt(0.5 * math.pi) * u * erfcx(math.sqrt(0.5) * u))


def normal_density(u: Array) -> Array:
    """Return the standard normal density."""
    return np.exp(-0.5 * u * u) / math.sqrt(2.0 * math.pi)
