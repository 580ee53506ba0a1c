"""The Melnikov process: energy that forcing and noise bring along the heteroclinic orbit, less what the impact takes.

Energy H = v²/2 + |x| - x²/2. Without forcing and losses the saddles x = ±1, where H = 1/2, are joined by one orbit
through the impact at x = 0. To first order in A, σ and 1 - e, an orbit that starts from one saddle and meets x = 0 at
the time τ₀ passes the other saddle with the excess energy (paper eqs. 12 to 16; derived in docs/theory)

    M(τ₀) = ∫ v₀(τ) f(τ + τ₀) dτ - M,    M = (1 - e²)/2,    v₀ = e^(-|τ|)

for the orbit from left to right. Where it is positive, blocks cross the separatrix and leave. This is for a slender
block. With a critical angle α > 0 the energy is v²/2 - (1 - cos φ)/α², φ = α (1 - |x|). The kernel v cos φ takes the
place of v₀ in the integral, and M = (1 - e²) (2/α²) sin²(α/2), see `physics.motion.separatrix`.
"""

import math
from typing import Any

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array, ArrayLike, Number
from fpk_rocking.physics.forcing import Harmonic, Harmonics, refuse_transient
from fpk_rocking.physics.motion.separatrix import kernel_halves, separatrix_orbit, separatrix_speed
from fpk_rocking.physics.noise.equivalence import noise_variance
from fpk_rocking.physics.noise.kinds import NOISES, BandNoise, Noise, refuse_envelope


def heteroclinic_orbit(times: ArrayLike, *, critical_angle: float = 0.0) -> tuple[Number, Number]:
    """Orbit from the saddle x = -1 to the saddle x = 1 without forcing and losses; it meets x = 0 at the time 0.

    (angle, velocity) are sgn(τ)(1 - e^(-|τ|)) and e^(-|τ|) for a slender block, else sgn(τ)(1 - φ/α) and (2/α) sin(φ/2)
    with tan(φ/4) = tan(α/4) e^(-|τ|).

    Parameters
    ----------
    times : array_like
        Times τ, nondimensional.
    critical_angle : float
        α of the block, from 0, a slender one, to π/2, radians.

    Examples
    --------
    >>> from fpk_rocking import melnikov
    >>> angle, velocity = melnikov.heteroclinic_orbit([0.0, 1.0], critical_angle=0.271)
    >>> print(angle.round(3), velocity.round(3))
    [0.    0.632] [0.997 0.368]
    """
    return separatrix_orbit(numbers("times", times), critical_angle)


def transfer(frequency: ArrayLike, *, critical_angle: float = 0.0) -> Number:
    """Fourier transform of the kernel of the process: 2/(1 + ω²) for a slender block (paper eq. 16).

    It is the work that a force cos ωτ does along the orbit. Where cos α < 2/3 it is negative at high frequencies.

    Parameters
    ----------
    frequency : array_like
        Angular frequency ω, nondimensional.
    critical_angle : float
        α of the block, from 0, a slender one, to π/2, radians.

    Examples
    --------
    >>> from fpk_rocking import melnikov
    >>> print(melnikov.transfer([0.0, 2.7]).round(3), melnikov.transfer([0.0, 2.7], critical_angle=0.271).round(3))
    [2.    0.241] [1.976 0.227]
    """
    return 2.0 * kernel_halves(numbers("frequency", frequency), critical_angle)[0]


def harmonic_amplitude(
    forcing: Harmonic | Harmonics | tuple[ArrayLike, ArrayLike], *, critical_angle: float = 0.0
) -> Number:
    """Amplitude D_m of the periodic part of the Melnikov process, 2A/(1 + Ω²) for a slender block (paper eqs. 12-14).

    Parameters
    ----------
    forcing : Harmonic, Harmonics or (amplitude, frequency)
        The pair holds array_like A >= 0 and Ω > 0, which broadcast. For several harmonics D_m is the largest absolute
        value of their sum, each multiplied by its `transfer`.
    critical_angle : float
        α of the block, from 0, a slender one, to π/2, radians.

    Examples
    --------
    >>> from fpk_rocking import melnikov
    >>> print(melnikov.harmonic_amplitude(([1.0, 4.6], 2.7)).round(3))
    [0.241 1.11 ]
    """
    if isinstance(forcing, Harmonics):
        return forcing_along_orbit(forcing, critical_angle).largest
    amplitude, frequency = amplitude_and_frequency(forcing, "a Harmonic, Harmonics, or a tuple (amplitude, frequency)")
    return amplitude * np.abs(transfer(frequency, critical_angle=critical_angle))


def forcing_along_orbit(forcing: Harmonics, critical_angle: float) -> Harmonics:
    """Return the periodic part of the Melnikov process: each harmonic multiplied by its `transfer`."""
    return forcing.filtered(lambda frequency: transfer(frequency, critical_angle=critical_angle))


def impact_loss(restitution: ArrayLike, *, critical_angle: float = 0.0) -> Number:
    """Energy M = (1 - e²) v₀²/2 that the impact takes from a block on the heteroclinic orbit.

    The speed v₀ of the orbit at x = 0 is 1 for a slender block, else (2/α) sin(α/2).

    Parameters
    ----------
    restitution : array_like
        Restitution e, from 0 to 1.
    critical_angle : float
        α of the block, from 0, a slender one, to π/2, radians.

    Examples
    --------
    >>> from fpk_rocking import melnikov
    >>> print(melnikov.impact_loss([0.5, 0.9]).round(3))
    [0.375 0.095]
    """
    e = numbers("restitution", restitution, at_least=0.0, at_most=1.0)
    return (0.5 * (1.0 - e) * (1.0 + e) * separatrix_speed(critical_angle) ** 2)[()]


def process_mean(
    forcing: Harmonic | Harmonics, restitution: ArrayLike, times: ArrayLike, *, critical_angle: float = 0.0
) -> Number:
    """Mean of the Melnikov process over the noise, for the orbit from left to right (paper eqs. 12 to 14).

    It is -D_m cos(Ωτ₀ + Ψ) - M for a harmonic forcing, and -Σ D_k cos(kΩτ₀ + Ψ_k) - M for several harmonics, with D_k
    the amplitude A_k times the `transfer` of kΩ.

    Parameters
    ----------
    forcing : Harmonic or Harmonics
    restitution : array_like
        Restitution e, from 0 to 1; it broadcasts with `times`.
    times : array_like
        Times τ₀ at which the orbit meets x = 0, nondimensional.
    critical_angle : float
        α of the block, from 0, a slender one, to π/2, radians.

    Examples
    --------
    >>> from fpk_rocking import load_scene, melnikov
    >>> print(melnikov.process_mean(load_scene("main").forcing, 0.5, [0.0, 0.5]).round(3))
    [ 0.735 -0.132]
    """
    refuse_transient(forcing, "the Melnikov process")
    checks.instance("forcing", forcing, Harmonic, Harmonics)
    tau, loss = broadcast(
        times=numbers("times", times), restitution=impact_loss(restitution, critical_angle=critical_angle)
    )
    waves = (
        a * transfer(k * forcing.frequency, critical_angle=critical_angle) * np.cos(k * forcing.frequency * tau + phase)
        for k, a, phase in forcing.components
    )
    return -sum(waves) - loss


def sampled_process(
    forcing: Harmonic | Harmonics,
    restitution: float,
    noise: Noise,
    times: ArrayLike,
    frequencies: ArrayLike,
    phases: ArrayLike,
    *,
    critical_angle: float = 0.0,
) -> Array:
    """Melnikov process of given realizations of band noise, in closed form.

    Its mean over realizations is `process_mean`, its variance `noise_variance` (paper eq. 15).

    Parameters
    ----------
    forcing : Harmonic or Harmonics
    restitution : float
        Restitution e, from 0 to 1.
    noise : BandNoise
        Its variance is used; its number of harmonics has to be N.
    times : array_like, shape (T,)
        Times τ₀ at which the orbit meets x = 0, nondimensional.
    frequencies, phases : array_like, shape (..., N)
        Angular frequencies ν_n, nondimensional, and phases φ_n, radians, of the realizations (paper eq. 4).
    critical_angle : float
        α of the block, from 0, a slender one, to π/2, radians.

    Returns
    -------
    ndarray, shape (..., T)

    Examples
    --------
    >>> from fpk_rocking import BandNoise, Harmonic, melnikov
    >>> noise = BandNoise(variance=0.04, band=(0.0, 10.0), harmonics=2)
    >>> print(melnikov.sampled_process(Harmonic(4.6, 2.7), 0.5, noise, [0.0, 0.5], [0.8, 3.1], [0.0, 1.0]).round(3))
    [-1.22  -0.425]
    """
    banded: BandNoise = checks.instance("noise", noise, BandNoise)
    e = checks.number("restitution", restitution, at_least=0.0, at_most=1.0)
    tau = np.atleast_1d(numbers("times", times))
    nu, phi = broadcast(frequencies=numbers("frequencies", frequencies), phases=numbers("phases", phases))
    if nu.shape[-1:] != (banded.harmonics,):
        accepted = f"(..., {banded.harmonics}), the number of harmonics of the noise"
        raise ValueError(checks.refusal("shape of frequencies and phases", nu.shape, accepted))
    weights = math.sqrt(2.0 * banded.variance / banded.harmonics) * transfer(nu, critical_angle=critical_angle)
    waves = np.cos(nu[..., None, :] * tau[:, None] + phi[..., None, :])
    return np.einsum("...tn,...n->...t", waves, weights) + process_mean(forcing, e, tau, critical_angle=critical_angle)


def numbers(
    name: str,
    value: ArrayLike,
    *,
    at_least: float | None = None,
    above: float | None = None,
    at_most: float | None = None,
) -> Array:
    """Return an array of floats, of any shape, after a check that all are finite and within bounds."""
    bounds = {">=": at_least, ">": above, "<=": at_most}
    accepted = " and ".join(f"{sign} {bound}" for sign, bound in bounds.items() if bound is not None)
    accepted = f"finite numbers {accepted}".rstrip()
    array = checks.array(name, value, accepted)
    inside = np.isfinite(array)
    for bound, fits in ((at_least, np.greater_equal), (above, np.greater), (at_most, np.less_equal)):
        if bound is not None:
            inside &= fits(array, bound)
    if not inside.all():
        raise ValueError(checks.refusal(name, float(array[~inside][0]), accepted))
    return array


def refuse_exact(critical_angle: float, what: str) -> None:
    """Raise ValueError for a critical angle above 0; `what`, for the message, is known for a slender block alone."""
    if checks.number("critical_angle", critical_angle, at_least=0.0) > 0.0:
        raise ValueError(checks.refusal("critical_angle", critical_angle, f"0 (block.slender = true) for {what}"))


def amplitude_and_frequency(
    forcing: Any, accepted: str = "a Harmonic, or a tuple (amplitude, frequency)"
) -> tuple[Array, ...]:
    """Return (A, Ω), which broadcast, of a Harmonic or of a tuple; `accepted` is what a refusal says."""
    if isinstance(forcing, Harmonic):
        return np.asarray(forcing.amplitude), np.asarray(forcing.frequency)
    refuse_transient(forcing, "the Melnikov process")
    if not isinstance(forcing, tuple) or len(forcing) != 2:
        raise TypeError(checks.refusal("forcing", forcing, accepted))
    a = numbers("forcing amplitude", forcing[0], at_least=0.0)
    return broadcast(amplitude=a, frequency=numbers("forcing frequency", forcing[1], above=0.0))


def broadcast(**arrays: ArrayLike) -> tuple[Array, ...]:
    """Return arrays of one shape; ValueError that names them where their shapes do not broadcast."""
    try:
        return np.broadcast_arrays(*arrays.values())
    except ValueError:
        shapes = [np.shape(array) for array in arrays.values()]
        raise ValueError(checks.refusal(f"shapes of {', '.join(arrays)}", shapes, "shapes that broadcast")) from None


def process_terms(forcing: Any, restitution: Any, noise: Any, critical_angle: float = 0.0) -> tuple[Array, ...]:
    """Return D_m, M and σ_M in one shape; the forcing is looked at first, as it stands first in every call."""
    return broadcast(
        forcing=harmonic_amplitude(forcing, critical_angle=critical_angle),
        restitution=impact_loss(restitution, critical_angle=critical_angle),
        noise=melnikov_deviations(noise, critical_angle),
    )


def noise_array(noise: Any) -> Array:
    """Return an object array of one noise, shape (), or of nested sequences of noises, none with an envelope."""
    array = np.asarray(noise, dtype=object)
    for entry in array.flat:
        checks.instance("noise", entry, *NOISES.values())
        refuse_envelope(entry, "a Melnikov variance")
    return array


def melnikov_deviations(noise: Any, critical_angle: float = 0.0) -> Array:
    """Return the standard deviations σ_M of the Melnikov process under one noise, shape (), or a nested sequence."""
    array = noise_array(noise)
    return np.sqrt([noise_variance(entry, critical_angle=critical_angle) for entry in array.flat]).reshape(array.shape)
