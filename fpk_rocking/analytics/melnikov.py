"""Melnikov analysis of the rocking block under noisy periodic excitation (paper eqs. 12-20).

The Melnikov process measures how far noise and forcing push the block across the heteroclinic orbit that separates
rocking from overturning. Its variance σ_M² (eq. 15) also says which white noise stands for a band of noise:

* `noise_variance`: σ_M² of a noise,
* `equivalent_diffusion`: D_M = σ_M²/2.

Source: H. Lin and S. C. S. Yim, "Nonlinear rocking motions. I: Chaos under noisy periodic excitations", J. Eng. Mech.
122(8), 719-727, 1996.
"""

from fpk_rocking.equivalence import equivalent_diffusion, noise_variance

__all__ = ["equivalent_diffusion", "noise_variance"]
