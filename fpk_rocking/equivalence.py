"""White noise that stands for band noise: equal variance of the Melnikov process.

The heteroclinic orbit of the undamped, unforced block has the velocity e^(-|τ|), whose transform is 2/(1+ω²). Noise
seen through it, M(τ₀) = ∫ e^(-|τ|) η(τ + τ₀) dτ, has the variance σ_M² = ∫ 4 G(ω)/(1+ω²)² dω, with G the one-sided
spectral density of η (H. Lin and S. C. S. Yim, J. Eng. Mech. 122(8), 719-727, 1996, eq. 15).
"""

import math


def noise_variance(noise):
    """Variance σ_M² of the Melnikov process of a noise.

    Parameters
    ----------
    noise : BandNoise, WhiteNoise or NoNoise
        Band noise has G = variance/(b - a) on its band [a, b]; white noise has ⟨ηη⟩ = 2Dδ.

    Returns
    -------
    float
        Nondimensional; (2 variance/(b-a)) [ω/(1+ω²) + atan ω] from a to b for a band (eq. 15, its σ² included), exactly
        2D for white noise, 0 without noise.

    Raises
    ------
    ValueError
        The kind of the noise is unknown.
    """
    if noise.kind == "none":
        return 0.0
    if noise.kind == "white":
        return 2.0 * noise.diffusion
    if noise.kind == "band":
        low, high = noise.band
        width = high - low
        # The two differences of (15) divided by the width in closed form, so that a narrow band loses no digits.
        arcs = math.atan2(width, 1.0 + low * high) / width
        ratios = (1.0 - low * high) / ((1.0 + low * low) * (1.0 + high * high))
        return 2.0 * noise.variance * (arcs + ratios)
    raise ValueError(f"noise.kind: got {noise.kind!r}, accepted: 'band', 'white', 'none'")


def equivalent_diffusion(noise):
    """Diffusion D_M = σ_M²/2 of the white noise with the same Melnikov variance.

    For band noise this is a closure, good where the band covers the system's own frequencies (about 0 to 3) and to be
    judged by simulation elsewhere; for white noise it is the diffusion itself.

    Parameters
    ----------
    noise : BandNoise, WhiteNoise or NoNoise

    Returns
    -------
    float
        Nondimensional, with ⟨ηη⟩ = 2Dδ.
    """
    return 0.5 * noise_variance(noise)
