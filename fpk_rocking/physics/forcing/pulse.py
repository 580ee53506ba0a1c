"""Transient forcings in closed form: the standard pulses of the rocking literature, and the linear sine sweep."""

import dataclasses
import math
from collections.abc import Callable
from typing import ClassVar, NamedTuple, Self

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array
from fpk_rocking.physics.forcing.base import RANGES
from fpk_rocking.physics.forcing.transient import TransientForcing
from fpk_rocking.physics.motion import TERMS


def _sine(shift):
    """Function of phases z (n,) with the Taylor coefficients (n, TERMS) of sin(z + shift) about them."""
    order = np.arange(TERMS)
    inverse = np.array([1.0 / math.factorial(k) for k in order])
    return lambda z: np.sin(z[:, None] + shift + 0.5 * math.pi * order) * inverse


_REACH = 6.5
"""Standard deviations of its bell at which a Ricker pulse is cut: what is cut is below 1e-6 of its peak."""


def _bell(polynomial):
    """Function of phases z (n,) with the Taylor coefficients (n, TERMS) of p(z - `_REACH`) exp(-(z - `_REACH`)²/2)."""
    factor = np.polynomial.Polynomial(polynomial)
    parts = [factor.deriv(k) / math.factorial(k) if k else factor for k in range(len(polynomial))]

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


_ANTISYMMETRIC_PEAK = math.sqrt(3.0 - math.sqrt(6.0)) * math.sqrt(6.0) * math.exp(-0.5 * (3.0 - math.sqrt(6.0)))
"""Largest value of (3y - y³) exp(-y²/2)."""


class _Shape(NamedTuple):
    """Shape of a pulse in a phase y, of which z = Ωτ is a multiple, `stretch`.

    `length` in y; `series`: function of y (n,) with the Taylor coefficients (n, TERMS); `slope`: the largest one.
    """

    length: float
    series: Callable[[Array], Array]
    stretch: float = 1.0
    slope: float = 1.0


SHAPES = {
    "one-sine": _Shape(2.0 * math.pi, _sine(0.0)),
    "one-cosine": _Shape(2.0 * math.pi, _sine(0.5 * math.pi)),
    "n-sine": _Shape(2.0 * math.pi, _sine(0.0)),  # n times as long
    "symmetric-ricker": _Shape(2.0 * _REACH, _bell([1.0, 0.0, -1.0]), math.sqrt(2.0), _ANTISYMMETRIC_PEAK),
    "antisymmetric-ricker": _Shape(
        2.0 * _REACH,
        _bell(np.array([0.0, -3.0, 0.0, 1.0]) / _ANTISYMMETRIC_PEAK),
        math.sqrt(3.0),
        3.0 / _ANTISYMMETRIC_PEAK,
    ),
}
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
    >>> print(simulate(Scene(Block(0.9, critical_angle=0.1), pulse, NoNoise())).metadata["outcome"])
    deterministic: overturns to the left at τ = 4.561
    """

    kind: ClassVar[str] = "pulse"
    ranges: ClassVar = {"amplitude": RANGES["amplitude"], "frequency": RANGES["frequency"], "duration": RANGES["time"]}
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
        checks.keep_numbers(self, "forcing", "amplitude", at_least=0.0)
        checks.keep_numbers(self, "forcing", "frequency", above=0.0)
        if self.shape == "n-sine":
            count = checks.count("forcing.cycles", self.cycles)
            checks.keep(self, cycles=count)
            if count > 1000:
                raise ValueError(checks.refusal("forcing.cycles", count, "a whole number from 1 to 1000"))
        elif self.cycles is not None:
            accepted = "nothing; only the shape 'n-sine' has cycles"
            raise ValueError(checks.refusal("forcing.cycles", self.cycles, accepted))

    @property
    def _rate(self):
        """Phase y of the shape per time."""
        return self.frequency / SHAPES[self.shape].stretch

    @property
    def _length(self):
        """Length in that phase."""
        return SHAPES[self.shape].length * (self.cycles or 1)

    @property
    def duration(self) -> float:
        return self._length / self._rate

    @property
    def shortest_period(self) -> float:
        """That of the sine, or of one that is as smooth as a bell."""
        return (2.0 if "ricker" in self.shape else 2.0 * math.pi) / self._rate

    @property
    def time_scale(self) -> float:
        return 2.0 * math.pi / self.frequency

    @property
    def largest(self) -> float:
        return self.amplitude

    @property
    def steepest(self) -> float:
        return self.amplitude * self._rate * SHAPES[self.shape].slope

    def series(self, times: Array) -> Array:
        phase = self._rate * times
        on = (phase >= 0.0) & (phase < self._length * (1.0 - 1e-12))
        series = SHAPES[self.shape].series(phase)
        return np.where(on, self.amplitude, 0.0)[:, None] * series * self._rate ** np.arange(TERMS)

    def scaled(self, strength: float, rate: float) -> Self:
        return dataclasses.replace(self, amplitude=strength * self.amplitude, frequency=self.frequency * rate)

    def __str__(self):
        name = f"{self.cycles} cycles of sine" if self.cycles else self.shape
        return f"{name} pulse, A = {self.amplitude:g}, Ω = {self.frequency:g}"


@dataclasses.dataclass(frozen=True)
class Chirp(TransientForcing):
    """Linear sine sweep A sin φ(τ) of base acceleration, from τ = 0 to a duration d, and 0 after it.

    The frequency φ' changes at a constant rate from Ω₀ to Ω₁: φ = Ω₀ τ + (Ω₁ - Ω₀) τ² / (2d).

    Parameters
    ----------
    amplitude : float
        A, nondimensional, at least 0. Where the sine is positive the base accelerates towards negative angles.
    start_frequency, end_frequency : float
        Angular frequencies Ω₀ and Ω₁, nondimensional, above 0.
    duration : float
        d, nondimensional, above 0; at most 10,000 cycles may fall in it.

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
        "amplitude": RANGES["amplitude"],
        **dict.fromkeys(("start_frequency", "end_frequency"), RANGES["frequency"]),
        "duration": RANGES["time"],
    }
    amplitude: float
    start_frequency: float
    end_frequency: float
    duration: float

    def __post_init__(self):
        checks.keep_numbers(self, "forcing", "amplitude", at_least=0.0)
        checks.keep_numbers(self, "forcing", "start_frequency", "end_frequency", "duration", above=0.0)
        most = 10_000
        if self._phase_at_end > 2.0 * math.pi * most:
            longest = 4.0 * math.pi * most / (self.start_frequency + self.end_frequency)
            accepted = f"at most {longest:g}, {most:,} cycles of these frequencies"
            raise ValueError(checks.refusal("forcing.duration", self.duration, accepted))

    @property
    def _rate(self):
        """Change of the angular frequency per time."""
        return (self.end_frequency - self.start_frequency) / self.duration

    @property
    def _phase_at_end(self):
        return 0.5 * (self.start_frequency + self.end_frequency) * self.duration

    @property
    def _fastest(self):
        """Highest angular frequency."""
        return max(self.start_frequency, self.end_frequency)

    @property
    def shortest_period(self) -> float:
        """Period of a sine that is no smoother than the sweep.

        Taylor coefficients of sin(Ω' t²/2) fall like those of sin(2.5 √Ω' t), to the order of a piece.
        """
        return 2.0 * math.pi / (self._fastest + 2.5 * math.sqrt(abs(self._rate)))

    @property
    def time_scale(self) -> float:
        return 2.0 * math.pi / self._fastest

    @property
    def largest(self) -> float:
        return self.amplitude * math.sin(min(self._phase_at_end, 0.5 * math.pi))

    @property
    def steepest(self) -> float:
        return self.amplitude * self._fastest

    def series(self, times: Array) -> Array:
        """Taylor coefficients of f from (sin φ)' = φ' cos φ and its like."""
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
        frequencies = self.start_frequency * rate, self.end_frequency * rate
        return type(self)(strength * self.amplitude, *frequencies, self.duration / rate)

    def __str__(self):
        sweep = f"Ω = {self.start_frequency:g} to {self.end_frequency:g}"
        return f"sine sweep, A = {self.amplitude:g}, {sweep} in τ = {self.duration:g}"
