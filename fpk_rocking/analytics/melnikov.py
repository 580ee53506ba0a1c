"""Melnikov analysis of the rocking block under noisy periodic excitation (paper eqs. 12 to 20).

The Melnikov process measures how far noise and forcing push the block across the heteroclinic orbit that separates
rocking from overturning. Its variance σ_M² (eq. 15) also determines which white noise replaces a band of noise.

* The process: `heteroclinic_orbit`, `transfer` (16), `harmonic_amplitude` D_m, `impact_loss` M, `process_mean`,
  `noise_variance` σ_M² (15), `equivalent_diffusion` D_M = σ_M²/2, `sampled_process` for given realizations.
* How far D_M can be trusted: `relative_variance` of a band, `realized_spread` of its realizations.
* Criteria: `critical_amplitude` (14, and its mean-square variant), `margin`, `exact_critical_amplitude`.
* Phase flux: `phase_flux` (17, corrected), `phase_flux_as_printed`, `phase_flux_sampled`.

Amplitudes, frequencies, restitutions and noises may be arrays or sequences, which broadcast. The critical angle α of
the block is a number, given by its name: 0, a slender block (the paper), or `scene.block.critical_angle`.
`exact_critical_amplitude` and `phase_flux_as_printed` refuse any but 0. Everything is derived in docs/theory, "Melnikov
process and phase flux".

Source: H. Lin and S. C. S. Yim, "Nonlinear rocking motions. I: Chaos under noisy periodic excitations", J. Eng. Mech.
122(8), 719-727, 1996.

Paper eq. 14 is a condition, in the mean-square sense, for zeros of the process M(τ₀) (see `process`). It adds the
largest value of (D_m cos)², that is D_m², to the mean square σ_M² of the noise; the mean square of the sum over all τ₀
is D_m²/2 + σ_M². `critical_amplitude` offers both. Without noise only the first is the condition for zeros, D_m >= M.
With Gaussian noise neither is a threshold: the process then crosses zero at any amplitude, and the phase flux measures
how much it does.
"""

from collections.abc import Sequence

import numpy as np

from fpk_rocking.analytics.flux import phase_flux, phase_flux_as_printed, phase_flux_sampled
from fpk_rocking.analytics.process import (
    broadcast,
    harmonic_amplitude,
    heteroclinic_orbit,
    impact_loss,
    melnikov_deviations,
    numbers,
    process_mean,
    process_terms,
    refuse_exact,
    sampled_process,
    transfer,
)
from fpk_rocking.base import checks
from fpk_rocking.base.checks import ArrayLike, Number
from fpk_rocking.physics.forcing import Harmonic, Harmonics
from fpk_rocking.physics.noise.equivalence import (
    equivalent_diffusion,
    noise_variance,
    realized_spread,
    relative_variance,
)
from fpk_rocking.physics.noise.kinds import Noise

__all__ = [
    "critical_amplitude",
    "equivalent_diffusion",
    "exact_critical_amplitude",
    "harmonic_amplitude",
    "heteroclinic_orbit",
    "impact_loss",
    "margin",
    "noise_variance",
    "phase_flux",
    "phase_flux_as_printed",
    "phase_flux_sampled",
    "process_mean",
    "realized_spread",
    "relative_variance",
    "sampled_process",
    "transfer",
]


def critical_amplitude(
    frequency: ArrayLike,
    restitution: ArrayLike,
    noise: Noise | Sequence[Noise],
    criterion: str = "peak",
    *,
    critical_angle: float = 0.0,
) -> Number:
    """Smallest amplitude A of the forcing that meets a Melnikov criterion; 0 where the noise alone meets it, σ_M >= M.

    D_m is that of `harmonic_amplitude`, σ_M² that of `noise_variance`, M that of `impact_loss`. Frequencies,
    restitutions and noises broadcast.

    Parameters
    ----------
    frequency : array_like
        Angular frequency Ω of the forcing, nondimensional, above 0.
    restitution : array_like
        Restitution e, from 0 to 1.
    noise : BandNoise, WhiteNoise, FilteredNoise or NoNoise, or a sequence of them
    criterion : {"peak", "mean square"}
        "peak" is the paper's eq. 14, D_m² + σ_M² >= M²: the peak of the harmonic part squared, plus the mean square of
        the noise. "mean square" is D_m²/2 + σ_M² >= M², with the mean square of both.
    critical_angle : float
        α of the block, from 0, a slender one, to π/2, radians.

    Examples
    --------
    >>> from fpk_rocking import BandNoise, NoNoise, melnikov
    >>> band = BandNoise(variance=0.04, band=(0.0, 10.0), harmonics=100)
    >>> print(melnikov.critical_amplitude(2.7, 0.5, [NoNoise(), band]).round(3))
    [1.554 1.483]
    """
    shares = {"peak": 1.0, "mean square": 0.5}
    if criterion not in shares:
        accepted = " or ".join(map(repr, shares))
        raise ValueError(checks.refusal("criterion", criterion, accepted))
    omega, loss, sigma = broadcast(
        frequency=numbers("frequency", frequency, above=0.0),
        restitution=impact_loss(restitution, critical_angle=critical_angle),
        noise=melnikov_deviations(noise, critical_angle),
    )
    lacking = np.maximum(loss - sigma, 0.0) * (loss + sigma)
    if critical_angle == 0.0:
        needed = 0.5 * (1.0 + omega**2)
    else:
        needed = 1.0 / np.abs(transfer(omega, critical_angle=critical_angle))
    return (needed * np.sqrt(lacking / shares[criterion]))[()]


def exact_critical_amplitude(frequency: ArrayLike, restitution: ArrayLike, *, critical_angle: float = 0.0) -> Number:
    """Amplitude from which the manifolds of a slender block cross without noise, exactly (derived in docs/theory).

    Its flights are linear, so both manifolds are known at x = 0 in closed form. They cross from
    A = (1 - e)(1 + Ω²)/√((1 + e)² + (1 - e)²Ω²) on (cf. Hogan 1992; Lenci and Rega 2006). The Melnikov criterion,
    `critical_amplitude`, agrees with it to first order in 1 - e. At high frequencies they differ: this amplitude grows
    like Ω, the other like Ω².

    Parameters
    ----------
    frequency : array_like
        Angular frequency Ω of the forcing, nondimensional, above 0.
    restitution : array_like
        Restitution e, from 0 to 1; it broadcasts with `frequency`.
    critical_angle : float
        α of the block, 0: a block with another is refused.

    Examples
    --------
    >>> from fpk_rocking import melnikov
    >>> print(melnikov.exact_critical_amplitude([1.0, 2.7], 0.5).round(3))
    [0.632 2.054]
    """
    refuse_exact(critical_angle, "the exact critical amplitude")
    omega, e = broadcast(
        frequency=numbers("frequency", frequency, above=0.0),
        restitution=numbers("restitution", restitution, at_least=0.0, at_most=1.0),
    )
    return ((1.0 - e) * (1.0 + omega**2) / np.hypot(1.0 + e, (1.0 - e) * omega))[()]


def margin(
    forcing: Harmonic | Harmonics | tuple[ArrayLike, ArrayLike],
    restitution: ArrayLike,
    noise: Noise | Sequence[Noise],
    *,
    critical_angle: float = 0.0,
) -> Number:
    """Margin √(D_m² + σ_M²) - M by which forcing and noise exceed the Melnikov criterion (paper eq. 14).

    D_m is that of `harmonic_amplitude`, σ_M² that of `noise_variance`, M that of `impact_loss`. Amplitudes,
    frequencies, restitutions and noises broadcast.

    Parameters
    ----------
    forcing : Harmonic, Harmonics or (amplitude, frequency)
        As for `harmonic_amplitude`.
    restitution : array_like
        Restitution e, from 0 to 1.
    noise : BandNoise, WhiteNoise, FilteredNoise or NoNoise, or a sequence of them
    critical_angle : float
        α of the block, from 0, a slender one, to π/2, radians.

    Examples
    --------
    >>> from fpk_rocking import NoNoise, melnikov
    >>> print(melnikov.margin(([1.0, 4.6], 2.7), 0.5, NoNoise()).round(3))
    [-0.134  0.735]
    """
    harmonic, loss, sigma = process_terms(forcing, restitution, noise, critical_angle)
    return (np.hypot(harmonic, sigma) - loss)[()]
