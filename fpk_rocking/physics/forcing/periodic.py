"""Periodic forcing: one harmonic or several.

A sum of harmonics has its particular solution, its largest value and its lift-offs in closed form.
"""

import abc
import dataclasses
import functools
import math
from collections.abc import Callable, Sequence
from typing import ClassVar, Self

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array, Number
from fpk_rocking.physics.forcing.base import RANGES, Forcing
from fpk_rocking.physics.motion import LIFT_OFF, TERMS


class PeriodicForcing(Forcing):
    """A forcing f = -Σ A_k cos(Ω_k τ + Ψ_k) with Ω_k = k Ω, k = 1, 2, ...; all are nondimensional, phases in radians.

    A kind is a frozen dataclass with `frequency`, `components`, `largest_velocity` and `scaled`; and, for the operator
    of a cycle and the Melnikov process, `at_phase` and `filtered`.
    """

    __slots__ = ()

    frequency: float
    """Ω."""
    duration = math.inf

    @property
    @abc.abstractmethod
    def components(self) -> tuple[tuple[int, float, float], ...]:
        """Multiple, amplitude and phase (k, A_k, Ψ_k) of every harmonic."""

    @property
    def phase(self) -> float:
        """Phase Ψ_1 of the first harmonic."""
        return self.components[0][2]

    @property
    def period(self) -> float:
        return 2.0 * math.pi / self.frequency

    @property
    def half_antisymmetric(self) -> bool:
        return all(k % 2 == 1 or amplitude == 0.0 for k, amplitude, _ in self.components)

    @property
    def shortest_period(self) -> float:
        return self.period / max(1, 1, *(k for k, amplitude, _ in self.components if amplitude))

    @property
    def longest_piece(self) -> float:
        return 0.8 * self.shortest_period / (2.0 * math.pi)

    @property
    def time_scale(self) -> float:
        return self.period

    @property
    def steepest(self) -> float:
        return sum(k * self.frequency * a for k, a, _ in self.components)

    @property
    def swing(self) -> float:
        return sum(a / math.hypot(1.0, k * self.frequency) for k, a, _ in self.components)

    @property
    def largest(self) -> float:
        return _passages(self)[0]

    @property
    def largest_velocity(self) -> float:
        parts = ((k, a / (k * self.frequency), phase - 0.5 * math.pi) for k, a, phase in self.components if k)
        return _Sum(self.frequency, tuple(parts)).largest

    @property
    def longest_rest(self) -> float:
        _, lift_offs, landings = _passages(self)
        if not lift_offs.size:
            return math.inf
        # From each time at which |f| falls to 1 to the next lift-off.
        waits = lift_offs - landings[:, None]
        return float(np.where(waits < 0.0, waits + self.period, waits).min(axis=1).max())

    def value(self, time: float) -> float:
        return -sum(a * math.cos(k * self.frequency * time + phase) for k, a, phase in self.components)

    def slope(self, time: float) -> float:
        omega = self.frequency
        return sum(a * k * omega * math.sin(k * omega * time + phase) for k, a, phase in self.components)

    def particular(self, time: float) -> tuple[float, float]:
        ((value, slope, *_),) = self.pieces([time])
        return float(value), float(slope)

    def particular_over(self, start: float, duration: float) -> Array:  # noqa: ARG002  (a step is short against the shortest period)
        return self.pieces([start])[0]

    def pieces(self, instants: Sequence[float] | Array) -> Array:
        out = np.zeros((len(instants), TERMS))
        for row, instant in zip(out, instants, strict=True):
            for k, amplitude, phase in self.components:
                _add_cosine(row, instant, amplitude, k * self.frequency, phase)
        return out

    def spacing(self, longest: float) -> float:
        """Largest spacing, up to `longest`, of a grid that divides the cycle."""
        return self.period / math.ceil(self.period / longest - 1e-9)

    def values_in_cycle(self, places: Array, count: int) -> Array:
        """Force (n,) at places (n,) of a cycle, from 0 to `count`, its end: periodic to the last digit."""
        waves = (a * np.cos(2.0 * math.pi * (k * places) / count + phase) for k, a, phase in self.components)
        return np.asarray(-sum(waves))

    def stage_values(self, spacing: float, count: int) -> Array:
        values = self.values_in_cycle(np.arange(2 * count + 1), 2 * round(self.period / spacing))
        return np.stack([values[:-1:2], values[1::2], values[2::2]], axis=-1)

    def since_lift_off(self, time: float) -> tuple[float, float]:
        lift_offs = _passages(self)[1]
        if not lift_offs.size:
            return math.inf, 0.0
        # At a lift-off, rounding decides whether it is just over or a period ago.
        elapsed = np.mod(time - lift_offs + 1e-12 * self.period, self.period)
        last = int(np.argmin(elapsed))
        return float(elapsed[last]), abs(self.slope(float(lift_offs[last])))

    def with_constant(self, constant: float) -> "PeriodicForcing":
        """The forcing f + `constant`, a harmonic k = 0; P becomes P - `constant`."""
        mean = 0, abs(constant), math.pi if constant > 0.0 else 0.0
        return _Sum(self.frequency, (*self.components, mean))

    def mean_excess(self, level: float) -> float:
        """Mean of max(f - level, 0) over a cycle, in closed form."""
        times = np.array([0.0, *_zeros(self, level, 0), self.period])
        middles, total = 0.5 * (times[1:] + times[:-1]), 0.0
        for begin, end, middle in zip(times[:-1], times[1:], middles, strict=True):
            if self.value(middle) > level:
                total += self._integral(end) - self._integral(begin) - level * (end - begin)
        return total / self.period

    def _integral(self, time):
        """Antiderivative, of mean 0, of f without its mean."""
        omega = self.frequency
        return -sum(a * math.sin(k * omega * time + phase) / (k * omega) for k, a, phase in self.components)


@dataclasses.dataclass(frozen=True, slots=True)
class Harmonic(PeriodicForcing):
    """Harmonic base acceleration -A cos(Ωτ + Ψ) (paper eq. 2).

    Parameters
    ----------
    amplitude : float
        Amplitude A, nondimensional, at least 0.
    frequency : float
        Angular frequency Ω, nondimensional, above 0.
    phase : float
        Phase Ψ, radians.

    Examples
    --------
    >>> from fpk_rocking import Harmonic
    >>> forcing = Harmonic(amplitude=4.6, frequency=2.7)
    >>> print(f"{forcing.period:.3f} {forcing.largest:.2f}")
    2.327 4.60
    """

    kind: ClassVar[str] = "harmonic"
    ranges: ClassVar = {"amplitude": RANGES["amplitude"], "frequency": RANGES["frequency"], "phase": RANGES["phase"]}
    amplitude: float
    frequency: float
    phase: float = 0.0

    def __post_init__(self):
        checks.keep_numbers(self, "forcing", "amplitude", at_least=0.0)
        checks.keep_numbers(self, "forcing", "frequency", above=0.0)
        checks.keep_numbers(self, "forcing", "phase")

    @property
    def components(self) -> tuple[tuple[int, float, float], ...]:
        return ((1, self.amplitude, self.phase),)

    @property
    def largest_velocity(self) -> float:
        return self.amplitude / self.frequency

    def at_phase(self, phase: float) -> Self:
        """The forcing with another phase Ψ: begun at another time of its cycle."""
        return dataclasses.replace(self, phase=phase)

    def filtered(self, gain: Callable[[float], Number]) -> Self:
        """The forcing with its harmonic times gain(Ω), a real number of either sign."""
        factor = float(gain(self.frequency))
        return dataclasses.replace(self, amplitude=self.amplitude * abs(factor), phase=_phase_times(self.phase, factor))

    def scaled(self, strength: float, rate: float) -> Self:
        return dataclasses.replace(self, amplitude=strength * self.amplitude, frequency=self.frequency * rate)

    def __str__(self):
        turns = self.phase / math.pi
        phase = f"{turns:g}π" if turns == round(turns, 3) and turns not in (0.0, 1.0) else f"{self.phase:g}"
        return f"A = {self.amplitude:g}, Ω = {self.frequency:g}, Ψ = {'π' if turns == 1.0 else phase}"


@dataclasses.dataclass(frozen=True, slots=True)
class Harmonics(PeriodicForcing):
    """Periodic base acceleration -Σ A_k cos(kΩτ + Ψ_k), k = 1, 2, ...

    Parameters
    ----------
    frequency : float
        Angular frequency Ω of the first harmonic, nondimensional, above 0.
    amplitudes : sequence of float
        Amplitudes A_1, A_2, ..., nondimensional, each at least 0, not all 0; up to 32 of them.
    phases : sequence of float
        Phases Ψ_1, Ψ_2, ..., radians, as many as amplitudes.

    Examples
    --------
    >>> from fpk_rocking import Harmonics
    >>> forcing = Harmonics(frequency=2.7, amplitudes=(4.6, 0.5), phases=(0.0, 1.0))
    >>> print(f"{forcing.period:.3f} {forcing.largest:.2f}")
    2.327 4.93
    """

    kind: ClassVar[str] = "harmonics"
    ranges: ClassVar = {"frequency": RANGES["frequency"], "amplitudes": RANGES["amplitude"], "phases": RANGES["phase"]}
    frequency: float
    amplitudes: tuple[float, ...]
    phases: tuple[float, ...]

    def __post_init__(self):
        checks.keep_numbers(self, "forcing", "frequency", above=0.0)
        checks.keep(self, amplitudes=checks.several("forcing.amplitudes", self.amplitudes, most=32, at_least=0.0))
        checks.keep(self, phases=checks.several("forcing.phases", self.phases, most=32))
        if len(self.phases) != len(self.amplitudes):
            accepted = f"{len(self.amplitudes)} phases, as many as forcing.amplitudes"
            raise ValueError(checks.refusal("forcing.phases", self.phases, accepted))
        if not any(self.amplitudes):
            raise ValueError(checks.refusal("forcing.amplitudes", self.amplitudes, "at least one above 0"))

    @property
    def components(self) -> tuple[tuple[int, float, float], ...]:
        pairs = zip(self.amplitudes, self.phases, strict=True)
        return tuple((k, amplitude, phase) for k, (amplitude, phase) in enumerate(pairs, 1))

    def at_phase(self, phase: float) -> Self:
        """The forcing begun at another time of its cycle: that at which its first harmonic has the phase `phase`."""
        ahead = phase - self.phases[0]
        return dataclasses.replace(self, phases=tuple(psi + k * ahead for k, psi in enumerate(self.phases, 1)))

    def filtered(self, gain: Callable[[float], Number]) -> Self:
        """The forcing with every harmonic times gain(kΩ), a real number of either sign."""
        factors = [float(gain(k * self.frequency)) for k, _, _ in self.components]
        amplitudes = (size * abs(factor) for size, factor in zip(self.amplitudes, factors, strict=True))
        phases = map(_phase_times, self.phases, factors)
        return dataclasses.replace(self, amplitudes=tuple(amplitudes), phases=tuple(phases))

    def scaled(self, strength: float, rate: float) -> Self:
        amplitudes = tuple(strength * amplitude for amplitude in self.amplitudes)
        return dataclasses.replace(self, amplitudes=amplitudes, frequency=self.frequency * rate)

    def __str__(self):
        lists = (", ".join(f"{value:g}" for value in values) for values in (self.amplitudes, self.phases))
        return "A_k = {}, Ω = {:g}, Ψ_k = {}".format(*(next(lists), self.frequency, next(lists)))


@dataclasses.dataclass(frozen=True, slots=True)
class _Sum(PeriodicForcing):
    """Any sum of harmonics; k = 0 is a mean."""

    frequency: float
    components: tuple[tuple[int, float, float], ...]

    def scaled(self, strength, rate):
        return _Sum(self.frequency * rate, tuple((k, strength * a, phase) for k, a, phase in self.components))


def periodic(forcing: Forcing) -> PeriodicForcing:
    """`forcing` itself if it repeats; else a TypeError."""
    if not isinstance(forcing, PeriodicForcing):
        raise TypeError(checks.refusal("forcing", forcing, "a forcing that repeats"))
    return forcing


def _add_cosine(row, instant, amplitude, frequency, phase):
    """Add the Taylor coefficients about an instant of A cos(Ωτ + Ψ)/(1 + Ω²) to `row` (TERMS,)."""
    angle = frequency * instant + phase
    scale = amplitude / (1.0 + frequency * frequency)
    even, odd = scale * math.cos(angle), -scale * math.sin(angle)
    for k in range(0, TERMS, 2):
        row[k] += even
        even *= -frequency * frequency / ((k + 1) * (k + 2))
    for k in range(1, TERMS, 2):
        row[k] += odd * frequency
        odd *= -frequency * frequency / ((k + 1) * (k + 2))


def _phase_times(phase, factor):
    """Phase of a harmonic after multiplication by `factor`."""
    return phase if factor >= 0.0 else phase + math.pi


@functools.lru_cache(maxsize=16)
def _passages(forcing):
    """(largest |f|, lift_offs, landings): times (n,) of a period at which |f| rises and falls through 1."""
    turning = [abs(forcing.value(time)) for time in _zeros(forcing, 0.0, 1)]
    mean = sum((a for k, a, _ in forcing.components if k == 0), 0.0)
    largest = max(turning, default=mean)
    lift_offs: list[float] = []
    landings: list[float] = []
    if largest > LIFT_OFF:
        for level in (LIFT_OFF, -LIFT_OFF):
            for time in _zeros(forcing, level, 0):
                rises = level * forcing.slope(time) > 0.0
                (lift_offs if rises else landings).append(time)
    return largest, np.sort(lift_offs), np.sort(landings)


def _zeros(forcing, level, derivative):
    """Times in [0, T), a list, of the zeros of f - `level` (`derivative` 0) or of f' (1) of a periodic forcing.

    They are roots on the unit circle: with z = exp(iΩτ) a sum of harmonics up to K, times z^K, is a polynomial of
    degree 2K.
    """
    highest = max(k for k, _, _ in forcing.components)
    if forcing.steepest < 1e-300:
        return []
    coefficients = np.zeros(2 * highest + 1, dtype=complex)  # of z^0, z^1, ...
    coefficients[highest] = -level
    for k, amplitude, phase in forcing.components:
        turned = -0.5 * amplitude * np.exp(1j * phase) * (1j * k * forcing.frequency) ** derivative
        coefficients[highest + k] += turned
        coefficients[highest - k] += np.conj(turned)
    # A highest harmonic too small to show in any digit would be divided by, and overflow.
    coefficients[np.abs(coefficients) < 1e-30 * np.abs(coefficients).max()] = 0.0
    roots = np.polynomial.polynomial.polyroots(np.trim_zeros(coefficients, "b"))
    roots = roots[np.abs(np.abs(roots) - 1.0) < 1e-6] if roots.size else roots
    times = np.sort(np.mod(np.angle(roots), 2.0 * math.pi) / forcing.frequency)
    return times.tolist() if derivative else [_newton_step(forcing, time, level) for time in times.tolist()]


def _newton_step(forcing, time, level):
    """A `time` near a simple zero of f - `level`, improved by one step of Newton's iteration."""
    slope = forcing.slope(time)
    if abs(slope) < 1e-6 * forcing.steepest:
        return time
    return time - (forcing.value(time) - level) / slope
