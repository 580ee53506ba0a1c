"""The standard pulses of the rocking literature."""

import dataclasses
import functools
import math
from typing import ClassVar, Self

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.types import Array
from fpk_rocking.physics.forcing.base import AMPLITUDES, FREQUENCIES, TIMES, keep
from fpk_rocking.physics.forcing.transient import TransientForcing
from fpk_rocking.physics.motion import TERMS


def _sine(shift):
    """Return the series of sin(z + shift)."""
    order = np.arange(TERMS)
    inverse = np.array([1.0 / math.factorial(k) for k in order])
    return lambda z: np.sin(z[:, None] + shift + 0.5 * math.pi * order) * inverse


_REACH = 6.5
"""Standard deviations of its bell at which a Ricker pulse is cut: what is cut is below 1e-6 of its peak."""


def _bell(polynomial):
    """Return the series of a polynomial times exp(-z²/2), the peak of the bell at _REACH."""
    whole = np.polynomial.Polynomial(polynomial)
    parts = [whole.deriv(k) / math.factorial(k) if k else whole for k in range(len(polynomial))]

    def series(z):
        z = z - _REACH
        # exp(-(z+t)²/2) = exp(-z²/2) Σ He_k(z) (-t)^k / k!, and the polynomial about z.
        bell = np.empty((len(z), TERMS))
        bell[:, 0], bell[:, 1] = np.exp(-0.5 * z * z), -z * np.exp(-0.5 * z * z)
        for k in range(1, TERMS - 1):
            bell[:, k + 1] = -(z * bell[:, k] + bell[:, k - 1]) / (k + 1)
        out = np.zeros((len(z), TERMS))
        for k, part in enumerate(parts):
            out[:, k:] += part(z)[:, None] * bell[:, : TERMS - k]
        return out

    return series


_TURN = 2.0 * math.pi
_ANTISYMMETRIC_PEAK = math.sqrt(3.0 - math.sqrt(6.0)) * math.sqrt(6.0) * math.exp(-0.5 * (3.0 - math.sqrt(6.0)))

SHAPES = ("one-sine", "one-cosine", "n-sine", "symmetric-ricker", "antisymmetric-ricker")
"""Pulses by their names."""


@dataclasses.dataclass(frozen=True)
class Pulse(TransientForcing):
    """Pulse A ψ(Ωτ) of base acceleration from τ = 0 on, and 0 after it.

    The shapes ψ are, with z = Ωτ,

    * "one-sine": sin z for 0 ≤ z ≤ 2π,
    * "one-cosine": cos z for 0 ≤ z ≤ 2π,
    * "n-sine": sin z for 0 ≤ z ≤ 2πn,
    * "symmetric-ricker": (1 - y²) exp(-y²/2) with y = z/√2 - 6.5, for |y| ≤ 6.5,
    * "antisymmetric-ricker": (y³ - 3y) exp(-y²/2)/1.3801 with y = z/√3 - 6.5, for |y| ≤ 6.5.

    Parameters
    ----------
    shape : str
        One of the names above.
    amplitude : float
        Peak A, nondimensional, at least 0. Where ψ is positive the base accelerates towards negative angles, which
        pushes the block, as seen from its base, towards positive ones.
    frequency : float
        Angular frequency Ω, nondimensional, above 0.
    cycles : int, optional
        n, from 1 to 1000. Required for "n-sine", refused for other shapes.

    References
    ----------
    Sine and cosine: N. Makris, Y. Roussos, Géotechnique 50, 243-262, 2000; J. Zhang, N. Makris, J. Eng. Mech. 127,
    473-483, 2001. Ricker: M. F. Vassiliou, N. Makris, Bull. Seism. Soc. Am. 101, 596-618, 2011.

    Examples
    --------
    >>> from fpk_rocking import Block, NoNoise, Pulse, Scene
    >>> from montecarlo import simulate
    >>> pulse = Pulse("one-sine", amplitude=3.0, frequency=3.0)
    >>> print(simulate(Scene(Block(0.9, critical_angle=0.1), pulse, NoNoise())).outcome)
    deterministic: overturns to the left at τ = 4.561
    """

    kind: ClassVar[str] = "pulse"
    ranges: ClassVar = {"amplitude": AMPLITUDES, "frequency": FREQUENCIES, "duration": TIMES, "unit": TIMES}
    shape: str
    amplitude: float
    frequency: float
    cycles: int | None = None

    def __post_init__(self):
        accepted = ", ".join(map(repr, SHAPES))
        if not isinstance(self.shape, str):
            raise TypeError(checks.refusal("forcing.shape", self.shape, accepted))
        if self.shape not in SHAPES:
            raise ValueError(checks.refusal("forcing.shape", self.shape, accepted))
        keep(self, amplitude=checks.number("forcing.amplitude", self.amplitude, at_least=0.0))
        keep(self, frequency=checks.number("forcing.frequency", self.frequency, above=0.0))
        if self.shape == "n-sine":
            count = checks.count("forcing.cycles", self.cycles)
            keep(self, cycles=count)
            if count > _MOST_CYCLES:
                raise ValueError(
                    checks.refusal("forcing.cycles", self.cycles, f"a whole number from 1 to {_MOST_CYCLES}")
                )
        elif self.cycles is not None:
            raise ValueError(
                checks.refusal("forcing.cycles", self.cycles, "nothing; only the shape 'n-sine' has cycles")
            )

    @functools.cached_property
    def _wave(self):
        """Length of the pulse in z, series in a phase y, z per y, and the largest slope in y."""
        if self.shape == "symmetric-ricker":
            return _BELL_LENGTH, _bell([1.0, 0.0, -1.0]), math.sqrt(2.0), _ANTISYMMETRIC_PEAK
        if self.shape == "antisymmetric-ricker":
            odd = np.array([0.0, -3.0, 0.0, 1.0]) / _ANTISYMMETRIC_PEAK
            return _BELL_LENGTH, _bell(odd), math.sqrt(3.0), 3.0 / _ANTISYMMETRIC_PEAK
        return _TURN * (self.cycles or 1), _sine(0.5 * math.pi if self.shape == "one-cosine" else 0.0), 1.0, 1.0

    @property
    def _rate(self):
        """Phase y per time."""
        return self.frequency / self._wave[2]

    @property
    def duration(self) -> float:
        """Time at which it ends."""
        return self._wave[0] / self._rate

    @property
    def unit(self) -> float:
        """The duration: kinks are at its ends alone."""
        return self.duration

    @property
    def shortest_period(self) -> float:
        """Its period; of a bell what is as smooth."""
        return (_TURN if self._wave[2] == 1.0 else _BELL_PERIOD) / self._rate

    @property
    def time_scale(self) -> float:
        """2π/Ω."""
        return _TURN / self.frequency

    @property
    def largest(self) -> float:
        """Largest |f|."""
        return self.amplitude

    @property
    def steepest(self) -> float:
        """Bound of the slope of the force."""
        return self.amplitude * self._rate * self._wave[3]

    def series(self, times: Array) -> Array:
        """Return Taylor coefficients (n, TERMS) of f about times (n,)."""
        length, series, *_ = self._wave
        phase = self._rate * times
        on = (phase >= 0.0) & (phase < length * (1.0 - 1e-12))
        return np.where(on, self.amplitude, 0.0)[:, None] * series(phase) * self._rate ** np.arange(TERMS)

    def scaled(self, strength: float, rate: float) -> Self:
        """Return the pulse with amplitude and frequency multiplied by factors."""
        return dataclasses.replace(self, amplitude=strength * self.amplitude, frequency=self.frequency * rate)

    def __str__(self):
        name = f"{self.cycles} cycles of sine" if self.cycles else self.shape
        return f"{name} pulse, A = {self.amplitude:g}, Ω = {self.frequency:g}"


_MOST_CYCLES = 1000
_BELL_LENGTH, _BELL_PERIOD = 2.0 * _REACH, 2.0
