"""The Clough-Penzien filter: Kanai-Tajimi noise without its lowest frequencies."""

import dataclasses
from typing import ClassVar

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.physics.noise.filters import Filter
from fpk_rocking.physics.noise.state_space import StateSpace


@dataclasses.dataclass(frozen=True)
class CloughPenzien(Filter):
    """White noise through a layer of soil and a filter that takes out the lowest frequencies, for ground accelerations.

    With Kanai-Tajimi noise u of frequency ω_g and damping ζ_g, η = y'' where y'' + 2 ζ_f ω_f y' + ω_f² y = u. The
    filter has 4 states. Its spectral density is that of u times (ω/ω_f)⁴/[(1 - (ω/ω_f)²)² + 4 ζ_f² (ω/ω_f)²]: it is 0
    at ω = 0, so that velocity and displacement of the ground stay finite. Source: R. W. Clough and J. Penzien, Dynamics
    of Structures, McGraw-Hill, 1975.

    Parameters
    ----------
    frequency, damping : float
        ω_g, nondimensional, and ζ_g of the soil, each above 0.
    low_frequency, low_damping : float
        ω_f, nondimensional, and ζ_f of the second filter, each above 0.

    Raises
    ------
    TypeError, ValueError
        A parameter is not a finite number above 0.

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
        for field in dataclasses.fields(self):
            value = checks.number(f"noise.filter.{field.name}", getattr(self, field.name), above=0.0)
            object.__setattr__(self, field.name, value)

    @property
    def space(self) -> StateSpace:
        """State space of the filter, for noise of variance 1."""
        high, low = self.frequency, self.low_frequency
        loss_high, loss_low = 2.0 * self.damping, 2.0 * self.low_damping
        # The states are g and g'/ω_g of the soil, with u = g + 2 ζ_g g'/ω_g, and ω_f² y and ω_f y'.
        acceleration = np.array([1.0, loss_high, -1.0, -loss_low])
        drift = [[0, high, 0, 0], [-high, -loss_high * high, 0, 0], [0, 0, 0, low], low * acceleration]
        return StateSpace.stationary(np.array(drift), np.array([0.0, 1.0, 0.0, 0.0]), acceleration)

    def faster(self, factor: float) -> "CloughPenzien":
        """Return the filter with all its rates multiplied by a factor."""
        return dataclasses.replace(self, frequency=factor * self.frequency, low_frequency=factor * self.low_frequency)

    def __str__(self):
        return (
            f"Clough-Penzien noise of frequency {self.frequency:g}, damping {self.damping:g}, low frequency "
            f"{self.low_frequency:g}, low damping {self.low_damping:g}"
        )
