"""The kinds of noise, as far as what is below a scene asks for them; `fpk_rocking.scene` makes them."""

from typing import ClassVar, Literal, Protocol

from fpk_rocking.physics.noise.envelope import Enveloped
from fpk_rocking.physics.noise.state_space import StateSpace

__all__ = ["Band", "Filtered", "Noise", "Silent", "White"]


class Band(Enveloped, Protocol):
    """Band noise, see `fpk_rocking.scene.BandNoise`."""

    kind: ClassVar[Literal["band"]]

    @property
    def variance(self) -> float:
        """Variance σ²."""

    @property
    def band(self) -> tuple[float, float]:
        """Lowest and highest angular frequency."""

    @property
    def harmonics(self) -> int:
        """Number N of harmonics."""


class White(Enveloped, Protocol):
    """White noise, see `fpk_rocking.scene.WhiteNoise`."""

    kind: ClassVar[Literal["white"]]

    @property
    def diffusion(self) -> float:
        """Diffusion D."""


class Filtered(Enveloped, Protocol):
    """Filtered noise, see `fpk_rocking.scene.FilteredNoise`."""

    kind: ClassVar[Literal["filtered"]]

    @property
    def variance(self) -> float:
        """Variance σ²."""

    @property
    def space(self) -> StateSpace:
        """State space of the filter, for noise of variance 1."""


class Silent(Enveloped, Protocol):
    """No noise, see `fpk_rocking.scene.NoNoise`."""

    kind: ClassVar[Literal["none"]]


Noise = Band | White | Filtered | Silent
"""Noise of any kind; its `kind` tells which."""
