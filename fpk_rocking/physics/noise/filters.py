"""Filters of white noise: those with a name in a scene, and those that a user describes.

    exponential     η' + ω η = w
    low-pass        η'' + 2 ζ ω η' + ω² η = w
    kanai-tajimi    η = g + (2 ζ/ω) g',   g'' + 2 ζ ω g' + ω² g = w

with white noise w, whose intensity follows from the variance of η. The last is the acceleration of the ground above a
rock that shakes in white noise: K. Kanai, Bull. Earthq. Res. Inst. Univ. Tokyo 35, 309-325, 1957; H. Tajimi, Proc. 2nd
World Conf. Earthq. Eng. II, 781-797, 1960. Any other filter is a `Filter`, a class of its own with a `StateSpace`.
"""

import abc
import dataclasses
import math
from collections.abc import Callable
from typing import ClassVar, NamedTuple

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.physics.motion.separatrix import melnikov_kernel
from fpk_rocking.physics.noise.state_space import StateSpace

__all__ = ["BUTTERWORTH", "FILTERS", "CloughPenzien", "Filter", "LinearFilter", "low_pass_frequency"]

BUTTERWORTH = math.sqrt(0.5)
"""Damping of the low-pass filter whose spectrum is flattest at low frequencies."""


class Filter(abc.ABC):
    """A filter of white noise: a frozen dataclass of its parameters that derives from this.

    Attributes
    ----------
    kind : str
        Name of the class in a scene file.
    space : StateSpace
        State space of the filter, for noise of variance 1 (`StateSpace.stationary`).

    Examples
    --------
    >>> from fpk_rocking import CloughPenzien, Filter
    >>> soil = CloughPenzien(frequency=15.0, damping=0.6, low_frequency=1.5, low_damping=0.6)
    >>> print(isinstance(soil, Filter), soil.space.order, soil.faster(2.0).space.fastest > soil.space.fastest)
    True 4 True
    """

    kind: ClassVar[str]

    @property
    @abc.abstractmethod
    def space(self) -> StateSpace:
        """State space of the filter, for noise of variance 1."""

    def faster(self, factor: float) -> "Filter":
        """The filter with all rates multiplied by a factor: η has the same variance and changes `factor` times as fast.

        Parameters
        ----------
        factor : float
            Above 0.
        """
        space = self.space
        drift = tuple(tuple(row) for row in (factor * space.drift).tolist())
        return LinearFilter(drift, tuple(space.input.tolist()), tuple(space.output.tolist()))

    def __str__(self):
        return f"{self.kind} noise"


@dataclasses.dataclass(frozen=True)
class LinearFilter(Filter):
    """A filter of n states, given by its matrices: dz = drift z dτ + input dW, η = output z.

    The strength of the white noise follows from the variance of `FilteredNoise`, whatever the size of `input`.

    Parameters
    ----------
    drift : sequence of n sequences of n floats
        Rates of change of the states, per nondimensional time. Its eigenvalues have negative real parts.
    input : sequence of n floats
        How the white noise enters the states.
    output : sequence of n floats
        How the noise η follows from the states.

    Raises
    ------
    TypeError, ValueError
        The shapes do not fit, there are more than 12 states, the filter is not stable, the white noise does not reach
        every state independently, or no state reaches the output.

    Examples
    --------
    >>> from fpk_rocking import FilteredNoise, LinearFilter, melnikov
    >>> twice = LinearFilter(drift=((-9.0, 0.0), (9.0, -9.0)), input=(1.0, 0.0), output=(0.0, 1.0))
    >>> print(f"{melnikov.noise_variance(FilteredNoise(twice, variance=0.04)):.4f}")
    0.0174
    """

    kind: ClassVar[str] = "linear"
    drift: tuple[tuple[float, ...], ...]
    input: tuple[float, ...]
    output: tuple[float, ...]

    def __post_init__(self):
        name = "noise.filter"
        accepted = f"{name}.drift as n rows of n numbers, {name}.input and {name}.output as n numbers, n up to 12"
        rows = checks.sequence(f"{name}.drift", self.drift, accepted)
        drift = tuple(checks.several(f"{name}.drift[{i}]", row, most=12) for i, row in enumerate(rows))
        sides = [checks.several(f"{name}.{side}", getattr(self, side), most=12) for side in ("input", "output")]
        if not drift or {len(drift)} != {len(entries) for entries in (*drift, *sides)}:
            raise ValueError(checks.refusal(f"{name}.drift", self.drift, accepted))
        checks.keep(self, drift=drift, input=sides[0], output=sides[1])
        StateSpace.stationary(*self._matrices)

    @property
    def _matrices(self):
        return np.array(self.drift), np.array(self.input), np.array(self.output)

    @property
    def space(self) -> StateSpace:
        return StateSpace.stationary(*self._matrices)

    def __str__(self):
        return f"noise of a linear filter, fastest rate {self.space.fastest:.4g}"


@dataclasses.dataclass(frozen=True)
class CloughPenzien(Filter):
    """White noise that has passed a layer of soil and a filter against the lowest frequencies: ground accelerations.

    With Kanai-Tajimi noise u of frequency ω_g and damping ζ_g, η = y'' where y'' + 2 ζ_f ω_f y' + ω_f² y = u. Its
    spectral density is that of u times (ω/ω_f)⁴/[(1 - (ω/ω_f)²)² + 4 ζ_f² (ω/ω_f)²]: it is 0 at ω = 0, so that velocity
    and displacement of the ground stay finite. Source: R. W. Clough and J. Penzien, Dynamics of Structures,
    McGraw-Hill, 1975.

    Parameters
    ----------
    frequency, damping : float
        ω_g, nondimensional, and ζ_g of the soil, each above 0.
    low_frequency, low_damping : float
        ω_f, nondimensional, and ζ_f of the second filter, each above 0.

    Examples
    --------
    >>> from fpk_rocking import CloughPenzien, FilteredNoise, melnikov
    >>> soil = CloughPenzien(frequency=15.0, damping=0.6, low_frequency=1.5, low_damping=0.6)
    >>> print(soil.space.spectral_density([0.0, 1.5, 15.0]).round(3))
    [0.    0.015 0.036]
    >>> print(f"{melnikov.equivalent_diffusion(FilteredNoise(soil, variance=0.3)):.4f}")
    0.0014
    """

    kind: ClassVar[str] = "clough-penzien"
    frequency: float
    damping: float
    low_frequency: float
    low_damping: float

    def __post_init__(self):
        names = (field.name for field in dataclasses.fields(self))
        checks.keep_numbers(self, "noise.filter", *names, above=0.0)

    @property
    def space(self) -> StateSpace:
        high, low = self.frequency, self.low_frequency
        loss_high, loss_low = 2.0 * self.damping, 2.0 * self.low_damping
        # The states are g and g'/ω_g of the soil, with u = g + 2 ζ_g g'/ω_g, and ω_f² y and ω_f y'.
        acceleration = np.array([1.0, loss_high, -1.0, -loss_low])
        drift = [[0, high, 0, 0], [-high, -loss_high * high, 0, 0], [0, 0, 0, low], low * acceleration]
        return StateSpace.stationary(np.array(drift), np.array([0.0, 1.0, 0.0, 0.0]), acceleration)

    def faster(self, factor: float) -> "CloughPenzien":
        return dataclasses.replace(self, frequency=factor * self.frequency, low_frequency=factor * self.low_frequency)

    def __str__(self):
        return (
            f"Clough-Penzien noise of frequency {self.frequency:g}, damping {self.damping:g}, low frequency "
            f"{self.low_frequency:g}, low damping {self.low_damping:g}"
        )


class _NamedFilter(NamedTuple):
    """A filter with a name: its `space` of frequency and damping, whether it has a damping, and its name in a text."""

    space: Callable[[float, float | None], StateSpace]
    damped: bool
    text: str


def _exponential(omega, _):
    """η' + ω η = w; the only state is η."""
    return StateSpace(np.array([[-omega]]), np.array([math.sqrt(2.0 * omega)]), np.ones(1), np.eye(1))


def _low_pass(omega, zeta):
    """η'' + 2ζω η' + ω² η = w; the states are η and η'/ω, each of variance 1."""
    drift = omega * np.array([[0.0, 1.0], [-1.0, -2.0 * zeta]])
    return StateSpace(drift, np.array([0.0, 2.0 * math.sqrt(zeta * omega)]), np.array([1.0, 0.0]), np.eye(2))


def _kanai_tajimi(omega, zeta):
    """η = ω² y + 2ζω y', y'' + 2ζω y' + ω² y = w; the states are y and y'/ω, scaled to variance 1."""
    output = np.array([1.0, 2.0 * zeta]) / math.hypot(1.0, 2.0 * zeta)
    return _low_pass(omega, zeta)._replace(output=output)


FILTERS = {
    "exponential": _NamedFilter(_exponential, False, "exponential"),
    "low-pass": _NamedFilter(_low_pass, True, "low-pass"),
    "kanai-tajimi": _NamedFilter(_kanai_tajimi, True, "Kanai-Tajimi"),
}
"""Filters by their name in a scene."""


def low_pass_frequency(
    ratio: float, damping: float = BUTTERWORTH, critical_angle: float = 0.0, states: int = 2
) -> float | None:
    """Angular frequency ω of the low-pass filter whose noise has a given `ratio` σ_M²/σ²; None where none is found.

    With one of the `states` it is that of exponential noise. σ_M², the Melnikov variance, falls from 4 (sin α/α)² to 0
    as ω grows, so there is one ω; those from 1e-8 to 1e8 are searched. α is the critical angle.
    """
    from scipy.optimize import brentq

    terms = melnikov_kernel(critical_angle)

    def excess(power):
        return (_low_pass if states == 2 else _exponential)(math.exp(power), damping).variance_along(*terms) - ratio

    low, high = math.log(1e-8), math.log(1e8)
    if not excess(low) > 0.0 > excess(high):
        return None
    return math.exp(brentq(excess, low, high, xtol=1e-15, rtol=1e-15))
