"""The Melnikov process: energy that forcing and noise bring along the heteroclinic orbit, less what the impact takes.

Energy H = v²/2 + |x| - x²/2. Without forcing and losses the saddles x = ±1, where H = 1/2, are joined by one orbit
through the impact at x = 0. To first order in A, σ and 1 - e, an orbit that starts from one saddle and meets x = 0 at
the time τ₀ passes the other saddle with the excess energy (paper eqs. 12 to 16; derived in docs/theory)

    M(τ₀) = ∫ v₀(τ) f(τ + τ₀) dτ - M,    M = (1 - e²)/2,    v₀ = e^(-|τ|)

for the orbit from left to right. Where it is positive, blocks cross the separatrix and leave.
"""

import math

import numpy as np

from fpk_rocking.analytics.inputs import amplitude_and_frequency, numbers
from fpk_rocking.base import checks
from fpk_rocking.base.types import Array, ArrayLike, Number
from fpk_rocking.physics.forcing import FORCINGS, Harmonic, Harmonics, refuse_transient
from fpk_rocking.physics.noise.kinds import Noise
from fpk_rocking.scene.parts import BandNoise


def heteroclinic_orbit(times: ArrayLike) -> tuple[Number, Number]:
    """Orbit from the saddle x = -1 to the saddle x = 1 without forcing and losses; it meets x = 0 at the time 0.

    Parameters
    ----------
    times : array_like
        Times τ, nondimensional.

    Returns
    -------
    angle, velocity : ndarray or float
        sgn(τ)(1 - e^(-|τ|)) and e^(-|τ|), nondimensional, of the shape of `times`.

    Raises
    ------
    TypeError, ValueError
        `times` are not finite numbers.
    """
    tau = numbers("times", times)
    return (-np.sign(tau) * np.expm1(-np.abs(tau)))[()], np.exp(-np.abs(tau))[()]


def transfer(frequency: ArrayLike) -> Number:
    """Fourier transform 2/(1 + ω²) of the orbit's velocity e^(-|τ|) (paper eq. 16).

    Parameters
    ----------
    frequency : array_like
        Angular frequency ω, nondimensional.

    Returns
    -------
    ndarray or float
        Work that a force cos ωτ does along the orbit, nondimensional, of the shape of `frequency`.

    Raises
    ------
    TypeError, ValueError
        `frequency` is not of finite numbers.
    """
    return (2.0 / (1.0 + numbers("frequency", frequency) ** 2))[()]


def harmonic_amplitude(forcing: Harmonic | Harmonics | tuple[ArrayLike, ArrayLike]) -> Number:
    """Amplitude D_m = 2A/(1 + Ω²) of the periodic part of the Melnikov process (paper eqs. 12 to 14).

    Parameters
    ----------
    forcing : Harmonic, Harmonics or (amplitude, frequency)
        The pair holds array_like A >= 0 and Ω > 0, which broadcast. For several harmonics D_m is the largest absolute
        value of their sum, each multiplied by its `transfer`.

    Returns
    -------
    ndarray or float
        Nondimensional, of the broadcast shape.

    Raises
    ------
    TypeError, ValueError
        `forcing` is none of these, or a value is refused.
    """
    if isinstance(forcing, Harmonics):
        return forcing.filtered(transfer).largest
    amplitude, frequency = amplitude_and_frequency(forcing)
    return amplitude * transfer(frequency)


def impact_loss(restitution: ArrayLike) -> Number:
    """Energy M = (1 - e²)/2 that the impact takes from a block on the heteroclinic orbit.

    Parameters
    ----------
    restitution : array_like
        Restitution e, from 0 to 1.

    Returns
    -------
    ndarray or float
        Nondimensional, of the shape of `restitution`.

    Raises
    ------
    TypeError, ValueError
        `restitution` is not of numbers from 0 to 1.
    """
    e = numbers("restitution", restitution, at_least=0.0, at_most=1.0)
    return (0.5 * (1.0 - e) * (1.0 + e))[()]


def process_mean(forcing: Harmonic | Harmonics, restitution: ArrayLike, times: ArrayLike) -> Number:
    """Mean of the Melnikov process over the noise, for the orbit from left to right (paper eqs. 12 to 14).

    It is -D_m cos(Ωτ₀ + Ψ) - M for a harmonic forcing, and -Σ D_k cos(kΩτ₀ + Ψ_k) - M with D_k = 2A_k/(1 + k²Ω²) for
    several harmonics.

    Parameters
    ----------
    forcing : Harmonic or Harmonics
        Periodic forcing.
    restitution : array_like
        Restitution e, from 0 to 1; it broadcasts with `times`.
    times : array_like
        Times τ₀ at which the orbit meets x = 0, nondimensional.

    Returns
    -------
    ndarray or float
        Nondimensional, of the broadcast shape.

    Raises
    ------
    TypeError, ValueError
        A parameter is refused.
    """
    checks.instance("forcing", forcing, *FORCINGS.values())
    refuse_transient(forcing, "the Melnikov process")
    tau = numbers("times", times)
    waves = (
        a * transfer(k * forcing.frequency) * np.cos(k * forcing.frequency * tau + phase)
        for k, a, phase in forcing.components
    )
    return -sum(waves) - impact_loss(restitution)


def sampled_process(
    forcing: Harmonic | Harmonics,
    restitution: float,
    noise: Noise,
    times: ArrayLike,
    frequencies: ArrayLike,
    phases: ArrayLike,
) -> Array:
    """Melnikov process of given realizations of band noise, in closed form.

    Parameters
    ----------
    forcing : Harmonic or Harmonics
        Periodic forcing.
    restitution : float
        Restitution e, from 0 to 1.
    noise : BandNoise
        Its variance is used; its number of harmonics has to be N.
    times : array_like, shape (T,)
        Times τ₀ at which the orbit meets x = 0, nondimensional.
    frequencies, phases : array_like, shape (..., N)
        Frequencies ν_n and phases φ_n of the realizations (paper eq. 4).

    Returns
    -------
    ndarray, shape (..., T)
        Nondimensional. Its mean over realizations is `process_mean`, its variance `noise_variance` (paper eq. 15).

    Raises
    ------
    TypeError, ValueError
        A parameter is refused, or the realizations have another number of harmonics than the noise.
    """
    banded: BandNoise = checks.instance("noise", noise, BandNoise)
    e = checks.number("restitution", restitution, at_least=0.0, at_most=1.0)
    tau = np.atleast_1d(numbers("times", times))
    nu, phi = np.broadcast_arrays(numbers("frequencies", frequencies), numbers("phases", phases))
    if nu.shape[-1:] != (banded.harmonics,):
        accepted = f"(..., {banded.harmonics}), the number of harmonics of the noise"
        raise ValueError(checks.refusal("shape of frequencies and phases", nu.shape, accepted))
    weights = math.sqrt(2.0 * banded.variance / banded.harmonics) * transfer(nu)
    waves = np.cos(nu[..., None, :] * tau[:, None] + phi[..., None, :])
    return np.einsum("...tn,...n->...t", waves, weights) + process_mean(forcing, e, tau)
