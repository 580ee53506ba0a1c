"""The sine sweep of shake-table and floor tests."""

import dataclasses
import math
from typing import ClassVar, Self

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.types import Array
from fpk_rocking.physics.forcing.base import AMPLITUDES, FREQUENCIES, TIMES, keep
from fpk_rocking.physics.forcing.transient import TransientForcing
from fpk_rocking.physics.motion import TERMS

_MOST_TURNS = 10_000

_SWEPT = 2.5
"""Weight of √|Ω'| beside Ω in the frequency that Taylor series are as long as: the coefficients of sin(Ω' t²/2) fall
like those of sin(2.5 √Ω' t), to the order of a piece."""


@dataclasses.dataclass(frozen=True)
class Chirp(TransientForcing):
    """Linear sine sweep A sin φ(τ) of base acceleration, from τ = 0 to a duration d, and 0 after it.

    The frequency φ' changes at a constant rate from Ω₀ to Ω₁: φ = Ω₀ τ + (Ω₁ - Ω₀) τ² / (2d).

    Parameters
    ----------
    amplitude : float
        Amplitude A, nondimensional, at least 0. Where the sine is positive the base accelerates towards negative
        angles.
    start_frequency, end_frequency : float
        Angular frequencies Ω₀ and Ω₁, nondimensional, above 0.
    duration : float
        d, nondimensional, above 0; at most 10,000 cycles may fall in it.

    Raises
    ------
    TypeError, ValueError
        A value is refused.

    Examples
    --------
    >>> from fpk_rocking import load_scene
    >>> from fpk_rocking.forcings import Chirp
    >>> from montecarlo import simulate
    >>> chirp = Chirp(amplitude=1.5, start_frequency=5.0, end_frequency=1.0, duration=20.0)
    >>> print(simulate(load_scene("main").varied(forcing=chirp), realizations=1000).survival[-1].round(2))
    0.16
    """

    kind: ClassVar[str] = "chirp"
    ranges: ClassVar = {
        "amplitude": AMPLITUDES, "start_frequency": FREQUENCIES, "end_frequency": FREQUENCIES, "duration": TIMES
    }  # fmt: skip
    amplitude: float
    start_frequency: float
    end_frequency: float
    duration: float

    def __post_init__(self):
        keep(self, amplitude=checks.number("forcing.amplitude", self.amplitude, at_least=0.0))
        for name in ("start_frequency", "end_frequency", "duration"):
            keep(self, **{name: checks.number(f"forcing.{name}", getattr(self, name), above=0.0)})
        if self._phase_at_end > 2.0 * math.pi * _MOST_TURNS:
            longest = 4.0 * math.pi * _MOST_TURNS / (self.start_frequency + self.end_frequency)
            accepted = f"at most {longest:g}, {_MOST_TURNS:,} cycles of these frequencies"
            raise ValueError(checks.refusal("forcing.duration", self.duration, accepted))

    @property
    def _rate(self):
        """Change of the frequency per time, Ω'."""
        return (self.end_frequency - self.start_frequency) / self.duration

    @property
    def _phase_at_end(self):
        return 0.5 * (self.start_frequency + self.end_frequency) * self.duration

    @property
    def _fastest(self):
        return max(self.start_frequency, self.end_frequency)

    @property
    def unit(self) -> float:
        """The duration: kinks are at its ends alone."""
        return self.duration

    @property
    def shortest_period(self) -> float:
        """Period of the sine that is no smoother."""
        return 2.0 * math.pi / (self._fastest + _SWEPT * math.sqrt(abs(self._rate)))

    @property
    def time_scale(self) -> float:
        """Shortest period of the sweep."""
        return 2.0 * math.pi / self._fastest

    @property
    def largest(self) -> float:
        """Largest |f|: that at the end where the phase does not reach π/2."""
        return self.amplitude * math.sin(min(self._phase_at_end, 0.5 * math.pi))

    @property
    def steepest(self) -> float:
        """Bound of the slope of the force."""
        return self.amplitude * self._fastest

    def series(self, times: Array) -> Array:
        """Return Taylor coefficients (n, TERMS) of f about times (n,), from (sin φ)' = φ' cos φ and its like."""
        times = np.asarray(times, dtype=float)
        frequency, rate = self.start_frequency + self._rate * times, self._rate
        phase = times * (self.start_frequency + 0.5 * rate * times)
        sine, cosine = np.zeros((2, TERMS, len(times)))
        sine[0], cosine[0] = np.sin(phase), np.cos(phase)
        sine[1], cosine[1] = frequency * cosine[0], -frequency * sine[0]
        for k in range(1, TERMS - 1):
            sine[k + 1] = (frequency * cosine[k] + rate * cosine[k - 1]) / (k + 1)
            cosine[k + 1] = -(frequency * sine[k] + rate * sine[k - 1]) / (k + 1)
        on = (times >= 0.0) & (times < self.duration * (1.0 - 1e-12))
        return np.where(on, self.amplitude, 0.0)[:, None] * sine.T

    def scaled(self, strength: float, rate: float) -> Self:
        """Return the sweep with amplitude and frequencies multiplied by factors."""
        frequencies = self.start_frequency * rate, self.end_frequency * rate
        return type(self)(strength * self.amplitude, *frequencies, self.duration / rate)

    def __str__(self):
        sweep = f"Ω = {self.start_frequency:g} to {self.end_frequency:g}"
        return f"sine sweep, A = {self.amplitude:g}, {sweep} in τ = {self.duration:g}"
