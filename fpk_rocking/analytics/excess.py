"""Mean positive part of a periodic function with Gaussian noise, E[(σ y + d - M)⁺], for a sum of harmonics d.

The mean over a cycle is integrated by Gauss-Legendre quadrature on panels. A panel is halved until a bound of the range
of u = (d - M)/σ in it shows that its nodes resolve the integrand. So the error is known before the quadrature is made,
and nothing depends on the agreement of two sums, which may agree by chance.
"""

import math
from collections.abc import Sequence

import numpy as np

from fpk_rocking.base.types import Array

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(24)

_RANGE = 3.0
"""Range of u in a panel at most: the nodes then have the integrand to 1e-13 of its largest value in the panel."""

_FAR = 10.0
"""u above which the noise adds nothing, and distance below the largest u from which on nothing is left: exp(-50)."""

_FIRST = 8
"""Panels at least in a period of the highest harmonic, in which d is close to a polynomial."""


def mean_excess(components: Sequence[tuple[int, float, float]], loss: float, sigma: float) -> float:
    """Mean of E[(σ y + d - M)⁺] over a cycle, y a standard normal number.

    Parameters
    ----------
    components : sequence of (int, float, float)
        Multiple k of the first harmonic, amplitude D_k and phase Ψ_k, radians, of each part D_k cos(kθ + Ψ_k) of d.
    loss, sigma : float
        M, and the standard deviation σ > 0, nondimensional.

    Returns
    -------
    float
        Nondimensional. The rounding of d limits it to an error of 1e-15 (|M| + Σ D_k) for the part of the cycle in
        which u is above -10.
    """
    table = np.array(components, float)
    k, amplitude, phase = table[table[:, 1] > 0.0].T
    # Middles and widths are in cycles and dyadic, so that k times a middle loses no digit.
    count = 2 ** math.ceil(math.log2(_FIRST * k.max()))
    middles, width, total, top = (np.arange(count) + 0.5) / count, 1.0 / count, 0.0, -math.inf
    curvature, finest = float(amplitude @ k**2), np.finfo(float).eps * (abs(loss) + float(amplitude.sum()))
    while middles.size:
        angles = 2.0 * math.pi * np.mod(np.outer(middles, k), 1.0) + phase
        height, half = np.cos(angles) @ amplitude - loss, math.pi * width
        reach = np.abs(np.sin(angles) @ (k * amplitude)) * half + 0.5 * curvature * half * half
        top = max(top, float(height.max()))
        wanted = height + reach > min(top, 0.0) - _FAR * sigma
        fine = (2.0 * reach <= max(_RANGE * sigma, finest)) | (height - reach > _FAR * sigma)
        total += width * _panels(angles[wanted & fine], half * k, amplitude, loss, sigma)
        middles = middles[wanted & ~fine]
        width *= 0.5
        middles = np.concatenate([middles - 0.5 * width, middles + 0.5 * width])
    return total


def _panels(angles, turns, amplitude, loss, sigma):
    """Sum of the means over panels: angles (panels, n) in the middle, and turns (n,) from there to an end."""
    height = np.full((len(angles), _NODES.size), -loss)
    for n, size in enumerate(amplitude):
        height += size * np.cos(angles[:, n, None] + turns[n] * _NODES)
    excess = np.maximum(height, 0.0) + sigma * rounding(np.abs(height) / sigma)
    return 0.5 * float(np.sum(excess @ _WEIGHTS))


def rounding(u: Array) -> Array:
    """ψ(u) = φ(u) - u N(-u), by which noise rounds the kink of u⁺, without loss of digits in the tail.

    Parameters
    ----------
    u : ndarray
        At least 0.

    Returns
    -------
    ndarray
        Of the shape of `u`; φ and N are the normal density and distribution.
    """
    from scipy.special import erfcx

    return density(u) * (1.0 - math.sqrt(0.5 * math.pi) * u * erfcx(math.sqrt(0.5) * u))


def density(u: Array) -> Array:
    """Return the standard normal density.

    Parameters
    ----------
    u : ndarray

    Returns
    -------
    ndarray
        Of the shape of `u`.
    """
    return np.exp(-0.5 * u * u) / math.sqrt(2.0 * math.pi)
