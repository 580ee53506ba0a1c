"""Arguments of the Melnikov functions as arrays that broadcast; what is not acceptable is refused by name."""

from typing import Any

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.types import Array, ArrayLike
from fpk_rocking.physics.forcing import Harmonic, refuse_transient
from fpk_rocking.physics.noise.envelope import refuse_envelope
from fpk_rocking.physics.noise.equivalence import noise_variance
from fpk_rocking.scene.parts import NOISES


def numbers(
    name: str,
    value: ArrayLike,
    *,
    at_least: float | None = None,
    above: float | None = None,
    at_most: float | None = None,
) -> Array:
    """Return a float array of finite numbers within bounds.

    Parameters
    ----------
    name : str
        Of the parameter, for the message.
    value : array_like
        Of any shape.
    at_least, above, at_most : float, optional
        Bounds of every entry; `above` is strict.

    Raises
    ------
    TypeError
        Not real numbers.
    ValueError
        An entry is not finite or out of bounds; the message shows the first such entry.
    """
    bounds = {">=": at_least, ">": above, "<=": at_most}
    accepted = " and ".join(f"{sign} {bound}" for sign, bound in bounds.items() if bound is not None)
    accepted = f"finite numbers {accepted}".rstrip()
    try:
        array = np.asarray(value)
    except ValueError:
        raise TypeError(checks.refusal(name, value, accepted)) from None
    if array.dtype.kind not in "fiu":
        raise TypeError(checks.refusal(name, value, accepted))
    array = array.astype(float)
    inside = np.isfinite(array)
    for bound, fits in ((at_least, np.greater_equal), (above, np.greater), (at_most, np.less_equal)):
        if bound is not None:
            inside &= fits(array, bound)
    if not inside.all():
        raise ValueError(checks.refusal(name, float(array[~inside][0]), accepted))
    return array


def refuse_exact(critical_angle: float, what: str) -> None:
    """Refuse what is known for a slender block alone where the block has a critical angle above 0."""
    if checks.number("critical_angle", critical_angle, at_least=0.0) > 0.0:
        raise ValueError(checks.refusal("critical_angle", critical_angle, f"0 (block.slender = true) for {what}"))


def amplitude_and_frequency(forcing: Any) -> tuple[Array, Array]:
    """Return A and Ω as arrays, from a Harmonic or from a pair (amplitude, frequency) of arrays."""
    if isinstance(forcing, Harmonic):
        return np.asarray(forcing.amplitude), np.asarray(forcing.frequency)
    refuse_transient(forcing, "the Melnikov process")
    if not isinstance(forcing, tuple) or len(forcing) != 2:
        raise TypeError(checks.refusal("forcing", forcing, "a Harmonic, or a pair (amplitude, frequency)"))
    amplitude, frequency = forcing
    return (
        numbers("forcing amplitude", amplitude, at_least=0.0),
        numbers("forcing frequency", frequency, above=0.0),
    )


def noises(noise: Any) -> Array:
    """Return an object array of noises, from one noise or a nested sequence of noises."""
    array = np.asarray(noise, dtype=object)
    for entry in array.flat:
        checks.instance("noise", entry, *NOISES.values())
        refuse_envelope(entry, "a Melnikov variance")
    return array


def deviations(noise: Any, critical_angle: float = 0.0) -> Array:
    """Return σ_M as an array, from one noise or a nested sequence of noises."""
    array = noises(noise)
    return np.sqrt([noise_variance(entry, critical_angle) for entry in array.flat]).reshape(array.shape)
