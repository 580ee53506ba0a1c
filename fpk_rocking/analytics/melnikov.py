"""Melnikov analysis of the rocking block under noisy periodic excitation (paper eqs. 12 to 20).

The Melnikov process measures how far noise and forcing push the block across the heteroclinic orbit that separates
rocking from overturning. Its variance σ_M² (eq. 15) also says which white noise stands for a band of noise.

* The process: `heteroclinic_orbit`, `transfer` (16), `harmonic_amplitude` D_m, `impact_loss` M, `process_mean`,
  `noise_variance` σ_M² (15), `equivalent_diffusion` D_M = σ_M²/2, `sampled_process` for given realizations.
* How far D_M can be trusted: `relative_variance` of a band, `realized_spread` of its realizations.
* Criteria: `critical_amplitude` (14, and its mean-square variant), `margin`, `exact_critical_amplitude`.
* Phase flux: `phase_flux` (17, corrected), `phase_flux_as_printed`, `phase_flux_sampled`.

Amplitudes, frequencies, restitutions and noises may be arrays or sequences, which broadcast. The critical angle α of
the block is a number: 0, a slender block (the paper), or `scene.block.critical_angle`. `exact_critical_amplitude` and
`phase_flux_as_printed` refuse any but 0. Everything is derived in docs/theory, "Melnikov process and phase
flux".

Source: H. Lin and S. C. S. Yim, "Nonlinear rocking motions. I: Chaos under noisy periodic excitations", J. Eng. Mech.
122(8), 719-727, 1996.
"""

from fpk_rocking.analytics.criteria import critical_amplitude, exact_critical_amplitude, margin
from fpk_rocking.analytics.flux import phase_flux, phase_flux_as_printed, phase_flux_sampled
from fpk_rocking.analytics.process import (
    harmonic_amplitude,
    heteroclinic_orbit,
    impact_loss,
    process_mean,
    sampled_process,
    transfer,
)
from fpk_rocking.physics.noise.equivalence import (
    equivalent_diffusion,
    noise_variance,
    realized_spread,
    relative_variance,
)

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
