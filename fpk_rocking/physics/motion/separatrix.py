"""The separatrix: the orbit from one saddle through x = 0 to the other, without forcing and losses.

With the critical angle α (docs/theory, section 10), if it meets x = 0 at τ = 0, it is

    tan(φ/4) = tan(α/4) e^(-|τ|),    v = (2/α) sin(φ/2).

A force changes the energy by f v cos φ, and v cos φ = v''. So the kernel of the Melnikov process is a sum of
exponentials, which converges like tan(α/4)^(2n), and is e^(-|τ|) for a slender block, α = 0:

    v cos φ = Σ c_n e^(-m_n |τ|),    m_n = 2n + 1,    c_n = (-1)^n (4/α) tan(α/4)^m_n m_n².
"""

import math

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array, ArrayLike, Number


def checked_angle(critical_angle: float) -> float:
    """`critical_angle` as a float from 0 to π/2, or TypeError or ValueError."""
    return checks.number("critical_angle", critical_angle, at_least=0.0, at_most=0.5 * math.pi)


def separatrix_orbit(times: ArrayLike, critical_angle: float) -> tuple[Number, Number]:
    """Angle and velocity of the orbit from the left saddle to the right one, at times since it passes x = 0."""
    tau, (scale, ratio) = np.asarray(times, float), _scales(critical_angle)
    fall, risen = np.exp(-np.abs(tau)), -np.expm1(-np.abs(tau))
    turned = ratio * risen / (1.0 + ratio**2 * fall)
    part = np.arctan(turned) / ratio if ratio > 0.0 else risen
    return (np.sign(tau) * scale * part)[()], (scale * fall / (1.0 + (ratio * fall) ** 2))[()]


def separatrix_speed(critical_angle: float) -> float:
    """Speed v₀ = (2/α) sin(α/2) at which the orbit passes x = 0: an impulse of this size overturns a block at rest."""
    return float(np.sinc(checked_angle(critical_angle) / (2.0 * math.pi)))


def melnikov_kernel(critical_angle: float) -> tuple[Array, Array]:
    """Weights c_n and rates m_n, each (terms,), of the kernel Σ c_n e^(-m_n |τ|) by which the orbit sees a force."""
    scale, ratio = _scales(critical_angle)
    order = np.arange(25)  # enough for α = π/2, where tan(α/4)² is 0.17
    rates = 2.0 * order + 1.0
    weights = scale * (-(ratio**2)) ** order * rates**2
    resolved = np.abs(weights) > 1e-18 * np.abs(weights).max()
    return weights[resolved], rates[resolved]


def kernel_halves(frequency: ArrayLike, critical_angle: float) -> tuple[Number, Number]:
    """Integrals over τ > 0 of the kernel times cos ωτ and sin ωτ: Σ c_n m_n/(m_n² + ω²), Σ c_n ω/(m_n² + ω²)."""
    omega, cosine, sine = np.asarray(frequency, float), 0.0, 0.0
    for weight, rate in zip(*melnikov_kernel(critical_angle), strict=True):
        part = weight / (rate * rate + omega**2)
        cosine, sine = cosine + rate * part, sine + omega * part
    return cosine, sine


def white_gain(critical_angle: float) -> float:
    """Integral of the squared kernel over all times; white noise has 2D times it as its Melnikov variance.

    It is (8/α²) ∫ (2c² - 1)² dc from c = cos(α/2) to 1, and 1 for a slender block.
    """
    alpha = checked_angle(critical_angle)
    rise = 2.0 * math.sin(0.25 * alpha) ** 2
    terms = 1.0 - rise * (4.0 - rise * (20.0 / 3.0 - rise * (4.0 - 0.8 * rise)))
    return float(np.sinc(alpha / (4.0 * math.pi))) ** 2 * terms


def _scales(critical_angle):
    """((4/α) tan(α/4), tan(α/4)); (1, 0) for α = 0."""
    alpha = checked_angle(critical_angle)
    ratio = math.tan(0.25 * alpha)
    return (4.0 * ratio / alpha if alpha > 0.0 else 1.0), ratio
