"""The separatrix of a block without forcing and losses, and how a force is seen along it (docs/theory, section 10).

The orbit from one saddle through x = 0 to the other has, with φ = α (1 - s x) and the critical angle α,

    tan(φ/4) = tan(α/4) e^(-|τ|),    v = (2/α) sin(φ/2),

if it meets x = 0 at τ = 0. A force changes the energy by f v cos φ, and v cos φ = v''. So the kernel of the Melnikov
process is a sum of exponentials, which converges like tan(α/4)^(2n), and is e^(-|τ|) for a slender block, α = 0:

    v cos φ = Σ c_n e^(-m_n |τ|),    m_n = 2n + 1,    c_n = (-1)^n (4/α) tan(α/4)^m_n m_n².
"""

import math

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array, ArrayLike, Number


def checked(critical_angle: float) -> float:
    """Return `critical_angle` α as a float from 0 to π/2, radians, or raise TypeError or ValueError."""
    return checks.number("critical_angle", critical_angle, at_least=0.0, at_most=0.5 * math.pi)


def orbit(times: ArrayLike, critical_angle: float) -> tuple[Number, Number]:
    """Angle sgn(τ)(1 - φ/α) and velocity on the orbit from x = -1 to x = 1 that meets x = 0 at the time 0.

    There φ(τ) is the tilt with tan(φ/4) = tan(α/4) e^(-|τ|). Angle and velocity are nondimensional.

    Parameters
    ----------
    times : array_like
        Times τ of either sign, nondimensional.
    critical_angle : float
        α, from 0 to π/2, radians.

    Returns
    -------
    angle, velocity : ndarray or float
        Of the shape of `times`.
    """
    tau, (scale, ratio) = np.asarray(times, float), _scales(critical_angle)
    fall, risen = np.exp(-np.abs(tau)), -np.expm1(-np.abs(tau))
    turned = ratio * risen / (1.0 + ratio**2 * fall)
    part = np.arctan(turned) / ratio if ratio > 0.0 else risen
    return (np.sign(tau) * scale * part)[()], (scale * fall / (1.0 + (ratio * fall) ** 2))[()]


def speed(critical_angle: float) -> float:
    """Return the nondimensional speed v₀ = (2/α) sin(α/2) at which the orbit between the saddles passes x = 0.

    An impulse of this size overturns a block at rest. `critical_angle` is α, radians, 0 to π/2; for 0, v₀ is 1.
    """
    return float(np.sinc(checked(critical_angle) / (2.0 * math.pi)))


def kernel(critical_angle: float) -> tuple[Array, Array]:
    """Weights c_n and rates m_n, each (terms,), of the kernel Σ c_n e^(-m_n |τ|) by which the orbit sees a force.

    The kernel is v cos φ along the orbit between the saddles. `critical_angle` is α, radians; for α = 0 both are [1].
    """
    scale, ratio = _scales(critical_angle)
    order = np.arange(25)  # enough for α = π/2, where tan(α/4)² is 0.17
    rates = 2.0 * order + 1.0
    weights = scale * (-(ratio**2)) ** order * rates**2
    resolved = np.abs(weights) > 1e-18
    return weights[resolved], rates[resolved]


def halves(frequency: ArrayLike, critical_angle: float) -> tuple[Number, Number]:
    """Integrals over τ > 0 of the Melnikov kernel Σ c_n e^(-m_n τ) times cos ωτ and times sin ωτ.

    Parameters
    ----------
    frequency : array_like
        Angular frequency ω, nondimensional.
    critical_angle : float
        α, from 0 to π/2, radians.

    Returns
    -------
    cosine, sine : ndarray or float
        Σ c_n m_n/(m_n² + ω²) and Σ c_n ω/(m_n² + ω²), of the shape of `frequency`.
    """
    omega, cosine, sine = np.asarray(frequency, float), 0.0, 0.0
    for weight, rate in zip(*kernel(critical_angle), strict=True):
        part = weight / (rate * rate + omega**2)
        cosine, sine = cosine + rate * part, sine + omega * part
    return cosine, sine


def white_gain(critical_angle: float) -> float:
    """Integral, a float, of the squared Melnikov kernel over all times; white noise has 2D times it.

    2D times it is the variance of the Melnikov process. It is (8/α²) ∫ (2c² - 1)² dc from c = cos(α/2) to 1, and 1 for
    a slender block; `critical_angle` is α, radians.
    """
    alpha = checked(critical_angle)
    rise = 2.0 * math.sin(0.25 * alpha) ** 2
    terms = 1.0 - rise * (4.0 - rise * (20.0 / 3.0 - rise * (4.0 - 0.8 * rise)))
    return float(np.sinc(alpha / (4.0 * math.pi))) ** 2 * terms


def _scales(critical_angle):
    """Return the tuple ((4/α) tan(α/4), tan(α/4)) for `critical_angle` α in radians, (1, 0) for α = 0."""
    alpha = checked(critical_angle)
    ratio = math.tan(0.25 * alpha)
    return (4.0 * ratio / alpha if alpha > 0.0 else 1.0), ratio
