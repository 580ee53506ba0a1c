"""Forcing that ends: its particular solution from its Taylor series, and the standard pulses of the rocking literature.

The bounded particular solution is P = -½ (L + R), with P' = ½ (L - R), where L(τ) = ∫ exp(-(τ-s)) f(s) ds up to τ and
R(τ) = ∫ exp(-(s-τ)) f(s) ds from τ on. Both are sums over the intervals of a grid that no kink of f falls into. P and
P' are continuous whatever jumps f has, and P falls off like exp(-τ) after the end.
"""

import dataclasses
import functools
import itertools
import math
from collections.abc import Callable
from typing import ClassVar

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.physics.motion import LIFT_OFF, TERMS
from fpk_rocking.physics.motion.particular import added, added_by_line, continued

_LONGEST = 0.2
"""Longest interval of the grid on which P is held."""

_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(12)
_LOOKS = 8


class TransientForcing:
    """A forcing that is 0 from `duration` on, and does not repeat.

    A subclass is a frozen dataclass, equal and hashed by its values, with `duration`, `unit`, `shortest_period`,
    `largest`, `steepest`, `time_scale` and `series`. It has a ``__dict__``, in which what is worked out is kept.
    """

    period = None
    half_antisymmetric = False
    duration: float
    """Time at which it ends."""
    unit: float
    """Spacing of a grid from 0 on that all kinks and jumps of f fall on; it divides the duration."""
    shortest_period: float
    """A time of which a sixth is a polynomial piece to 1e-13; inf where f is piecewise linear."""
    time_scale: float
    """Time that an engine's `steps_per_cycle` count in."""

    series: Callable[[np.ndarray], np.ndarray]
    """Taylor coefficients (n, TERMS) of f about times (n,); at a kink, of the piece that begins there."""

    @property
    def longest_piece(self):
        """Time from its instant for which a piece of `pieces` is right to 1e-14, if no kink of f lies between."""
        return min(0.8 * self.shortest_period / (2.0 * math.pi), 0.5)

    def spacing(self, longest):
        """Largest spacing up to a longest one of a grid from 0 on whose intervals each see one polynomial piece."""
        return self.unit / math.ceil(self.unit / longest - 1e-9)

    def pieces(self, instants):
        """Coefficients of the particular solution P in the time since given instants.

        Parameters
        ----------
        instants : array_like, shape (n,)
            Nondimensional times, 0 or later.

        Returns
        -------
        ndarray, shape (n, TERMS)
            Taylor coefficients of P, for the piece of f that begins at an instant or goes on there.
        """
        times = np.asarray(instants, dtype=float)
        spacing, states = self._grid
        last = len(states) - 1
        node = np.minimum((times / spacing + 1e-9).astype(np.int64), last)
        since = times - node * spacing
        p, q = states[node].T
        near = continued(p, q, self.series(node * spacing))
        # After the end P = P(end) exp(-since); a piece from there need not reach as far.
        decay = np.exp(-since)
        ended = node == last
        powers, order = since[:, None] ** np.arange(TERMS), np.arange(1, TERMS)
        p = np.where(ended, p * decay, (near * powers).sum(axis=1))
        q = np.where(ended, q * decay, (near[:, 1:] * order * powers[:, :-1]).sum(axis=1))
        return continued(p, q, self.series(times))

    def over(self, start, duration):
        """Coefficients (TERMS,) of P in the time since the start of a step.

        In a step with kinks the force is replaced by the linear one under which flights over the step are the same.
        """
        first, last = (
            int(np.floor(time / self.unit + shift)) for time, shift in ((start, 1e-6), (start + duration, -1e-6))
        )
        if last <= first or start >= self.duration:
            return self.pieces([start])[0]
        (p0, q0), (p1, q1) = self.particular(start), self.particular(start + duration)
        force = np.zeros((1, TERMS))
        force[0, :2] = np.linalg.solve(added_by_line(duration), added(p0, q0, p1, q1, duration))
        return continued(np.array([p0]), np.array([q0]), force)[0]

    @functools.cached_property
    def _grid(self):
        """Spacing, and P and P' at the nodes (n + 1, 2) of a grid from 0 to the end."""
        spacing = self.spacing(min(_LONGEST, self.longest_piece))
        count = round(self.duration / spacing)
        inside = 0.5 * spacing * (1.0 + _POINTS)
        order = np.arange(TERMS)
        forces = self.series(np.arange(count) * spacing) @ (inside ** order[:, None])
        weights = 0.5 * spacing * _WEIGHTS
        before, after = forces @ (weights * np.exp(inside - spacing)), forces @ (weights * np.exp(-inside))
        fade = math.exp(-spacing)
        left = np.fromiter(itertools.accumulate(before, lambda sum_, new: sum_ * fade + new, initial=0.0), float)
        right = np.fromiter(itertools.accumulate(after[::-1], lambda sum_, new: sum_ * fade + new, initial=0.0), float)
        right = right[::-1]
        return spacing, np.stack([-0.5 * (left + right), 0.5 * (left - right)], axis=-1)

    def particular(self, time):
        """Particular solution P and its derivative at a time; kept, as the steps on both sides of it ask for them."""
        if time not in self._known:
            ((value, slope, *_),) = self.pieces([time])
            self._known[time] = float(value), float(slope)
        return self._known[time]

    @functools.cached_property
    def _known(self):
        """What `particular` has found, by its time."""
        return {}

    def values(self, times):
        """Force f at times (n,), that after a jump where there is one."""
        return self.series(np.asarray(times, dtype=float))[:, 0]

    def value(self, time):
        """Force f at a time."""
        return float(self.values([time])[0])

    def slope(self, time):
        """Slope of the force at a time."""
        return float(self.series(np.array([time]))[0, 1])

    @functools.cached_property
    def swing(self):
        """Bound of |P + P'| and |P - P'|: how far the forcing moves the separatrices, and a block that follows it."""
        # Both change by less than the force and themselves, so between two looks by no more than at a distance of one.
        times = self._looks
        p, q = self.pieces(times)[:, :2].T
        seen = float(max(np.abs(p + q).max(), np.abs(p - q).max()))
        return seen + times[1] * max(seen, self.largest)

    @property
    def _looks(self):
        """Times from 0 to the end, a part of the grid's spacing apart."""
        spacing = self._grid[0] / _LOOKS
        return np.arange(round(self.duration / spacing) + 1) * spacing

    @functools.cached_property
    def _lift_offs(self):
        """Times (n,) at which |f| rises through 1, ascending, and those (m,) at which it falls back."""
        grid = self._looks
        above = np.concatenate([[False], np.abs(self.values(grid[:-1])) > LIFT_OFF, [False]])
        rises, falls = ([], [])
        for place in np.flatnonzero(above[1:] != above[:-1]):
            low, high = grid[max(place - 1, 0)], grid[place]
            for _ in range(60):
                middle = 0.5 * (low + high)
                if (abs(self.value(middle)) > LIFT_OFF) == above[place + 1]:
                    high = middle
                else:
                    low = middle
            (rises if above[place + 1] else falls).append(high)
        return np.array(rises), np.array(falls)

    @property
    def longest_rest(self):
        """Longest time in which |f| stays at most 1, so that a block at rest stays there: inf, after the end."""
        return math.inf

    def since_lift_off(self, time):
        """Time since |f| last rose through 1, and the slope of |f| there; (inf, 0) where it has not yet."""
        rises = self._lift_offs[0]
        before = rises[rises <= time + 1e-12 * self.duration]
        if not before.size:
            return math.inf, 0.0
        return max(time - float(before[-1]), 0.0), abs(self.slope(float(before[-1])))


def refuse_transient(forcing, what):
    """Refuse a forcing that does not repeat, where something is not defined for it."""
    if isinstance(forcing, TransientForcing):
        accepted = f"'harmonic' or 'harmonics', as {what} is only defined for a forcing that repeats"
        raise ValueError(checks.refusal("forcing.kind", forcing.kind, accepted))


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
    """

    kind: ClassVar[str] = "pulse"
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
        _set(self, "amplitude", checks.number("forcing.amplitude", self.amplitude, at_least=0.0))
        _set(self, "frequency", checks.number("forcing.frequency", self.frequency, above=0.0))
        if self.shape == "n-sine":
            _set(self, "cycles", checks.count("forcing.cycles", self.cycles))
            if self.cycles > _MOST_CYCLES:
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
    def duration(self):
        """Time at which it ends."""
        return self._wave[0] / self._rate

    @property
    def unit(self):
        """The duration: kinks are at its ends alone."""
        return self.duration

    @property
    def shortest_period(self):
        """Its period; of a bell what is as smooth."""
        return (_TURN if self._wave[2] == 1.0 else _BELL_PERIOD) / self._rate

    @property
    def time_scale(self):
        """2π/Ω."""
        return _TURN / self.frequency

    @property
    def largest(self):
        """Largest |f|."""
        return self.amplitude

    @property
    def steepest(self):
        """Bound of the slope of the force."""
        return self.amplitude * self._rate * self._wave[3]

    def series(self, times):
        """Return Taylor coefficients (n, TERMS) of f about times (n,)."""
        length, series, *_ = self._wave
        phase = self._rate * times
        on = (phase >= 0.0) & (phase < length * (1.0 - 1e-12))
        return np.where(on, self.amplitude, 0.0)[:, None] * series(phase) * self._rate ** np.arange(TERMS)

    def __str__(self):
        name = f"{self.cycles} cycles of sine" if self.cycles else self.shape
        return f"{name} pulse, A = {self.amplitude:g}, Ω = {self.frequency:g}"


_MOST_CYCLES = 1000
_BELL_LENGTH, _BELL_PERIOD = 2.0 * _REACH, 2.0


def _set(value, name, checked):
    object.__setattr__(value, name, checked)
