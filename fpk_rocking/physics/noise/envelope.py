"""Envelopes: the strength g(τ) of a noise that rises and dies away, η(τ) g(τ) in place of η(τ)."""

import abc
import dataclasses
import functools
import itertools
import math
from typing import ClassVar, NamedTuple, Self

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array


class Envelope(abc.ABC):
    """An envelope g(τ), nondimensional."""

    spacing: float
    """Longest interval in which it may be taken as linear, to 5e-5 of its peak, if it has no kink there."""

    @property
    @abc.abstractmethod
    def kinks(self) -> Array:
        """Times (n,) at which the slope jumps."""

    @property
    def extremes(self) -> Array:
        """Times (n,), between which it rises or falls throughout."""
        return self.kinks

    @property
    def largest(self) -> float:
        """Largest value of g."""
        return float(self.value(self.extremes).max())

    @property
    def with_unit_peak(self) -> Self:
        """The envelope over its largest value."""
        return self

    @abc.abstractmethod
    def value(self, times: Array) -> Array:
        """Value g (n,) at times (n,)."""

    @abc.abstractmethod
    def series(self, times: Array, terms: int) -> Array:
        """Taylor coefficients (n, terms), at least 2 terms, of g about times (n,), none of which is a kink."""

    @abc.abstractmethod
    def squared_integral(self, times: Array) -> Array:
        """Integral of g² from 0 to each of n times."""

    @abc.abstractmethod
    def faster(self, factor: float) -> Self:
        """The envelope with all times divided by a factor."""


class _Linear(Envelope):
    """An envelope that is linear between corners, and constant beyond them."""

    spacing = math.inf

    @property
    @abc.abstractmethod
    def corners(self) -> tuple[Array, Array]:
        """Times and values, (n,) each."""

    def value(self, times: Array) -> Array:
        return np.interp(times, *self.corners)

    @property
    def kinks(self) -> Array:
        return self.corners[0]

    def series(self, times: Array, terms: int) -> Array:
        places, values = self.corners
        slopes = np.concatenate([[0.0], np.diff(values) / np.diff(places), [0.0]])
        out = np.zeros((len(times), terms))
        out[:, 0], out[:, 1] = self.value(times), slopes[np.searchsorted(places, times)]
        return out

    def squared_integral(self, times: Array) -> Array:
        places, values = self.corners
        inside = np.diff(places) * (values[1:] ** 2 + values[1:] * values[:-1] + values[:-1] ** 2) / 3.0
        before = np.concatenate([[values[0] ** 2 * places[0]], inside]).cumsum()
        k = np.searchsorted(places, times, side="right") - 1
        since = times - places[np.maximum(k, 0)]
        begin, end = values[np.maximum(k, 0)], self.value(times)
        return np.where(k < 0, values[0] ** 2 * times, before[k] + since * (begin**2 + begin * end + end**2) / 3.0)


@dataclasses.dataclass(frozen=True)
class Trapezoid(_Linear):
    """Envelope that rises linearly from 0 to 1, holds, and decays linearly to 0.

    Parameters
    ----------
    rise, hold, decay : float
        Nondimensional durations, each at least 0, not all 0.

    Examples
    --------
    >>> import numpy as np
    >>> from fpk_rocking.envelopes import Trapezoid
    >>> print(Trapezoid(rise=2.0, hold=4.0, decay=4.0).value(np.array([1.0, 3.0, 8.0])))
    [0.5 1.  0.5]
    """

    kind: ClassVar[str] = "trapezoid"
    rise: float
    hold: float
    decay: float

    def __post_init__(self):
        checks.keep_numbers(self, "noise.envelope", "rise", "hold", "decay", at_least=0.0)
        if not 0.0 < self.rise + self.hold + self.decay < math.inf:
            accepted = "rise, hold and decay, of which at least one is above 0"
            raise ValueError(checks.refusal("noise.envelope", self, accepted))

    @functools.cached_property
    def corners(self) -> tuple[Array, Array]:
        # A jump takes no time, but no two corners may be at one.
        least = 1e-9 * (self.rise + self.hold + self.decay)
        times = np.cumsum([0.0, max(self.rise, least), max(self.hold, least), max(self.decay, least)])
        return times, np.array([0.0, 1.0, 1.0, 0.0])

    def faster(self, factor: float) -> Self:
        return type(self)(self.rise / factor, self.hold / factor, self.decay / factor)

    def __str__(self):
        return f"trapezoid of {self.rise:g}, {self.hold:g} and {self.decay:g}"


@dataclasses.dataclass(frozen=True)
class Table(_Linear):
    """Envelope that is linear between given values, and constant before the first and after the last.

    Parameters
    ----------
    times : sequence of float
        Nondimensional times, ascending, at least 0; 2 to 1000 of them.
    values : sequence of float
        Values of the envelope at these times, each at least 0, not all 0.

    Examples
    --------
    >>> import numpy as np
    >>> from fpk_rocking.envelopes import Table
    >>> print(Table(times=(0.0, 5.0, 10.0), values=(0.0, 1.0, 0.5)).value(np.array([2.5, 7.5, 20.0])))
    [0.5  0.75 0.5 ]
    """

    kind: ClassVar[str] = "table"
    times: tuple[float, ...]
    values: tuple[float, ...]

    def __post_init__(self):
        for name in ("times", "values"):
            values = checks.several(f"noise.envelope.{name}", getattr(self, name), most=1000, at_least=0.0)
            checks.keep(self, **{name: values})
        if len(self.times) < 2 or not all(a < b for a, b in itertools.pairwise(self.times)):
            raise ValueError(checks.refusal("noise.envelope.times", self.times, "two or more ascending times"))
        if len(self.values) != len(self.times) or not any(self.values):
            accepted = f"{len(self.times)} values, as many as noise.envelope.times, not all 0"
            raise ValueError(checks.refusal("noise.envelope.values", self.values, accepted))

    @functools.cached_property
    def corners(self) -> tuple[Array, Array]:
        return np.array(self.times), np.array(self.values)

    def faster(self, factor: float) -> Self:
        return type(self)(tuple(time / factor for time in self.times), self.values)

    @property
    def with_unit_peak(self) -> Self:
        return type(self)(self.times, tuple(value / self.largest for value in self.values))

    def __str__(self):
        return f"table of {len(self.times)} values up to {max(self.values):g}"


@dataclasses.dataclass(frozen=True)
class Exponential(Envelope):
    """Envelope (τ/t) exp(1 - τ/t), which is 1 at its peak at τ = t.

    Parameters
    ----------
    peak : float
        Time t of the peak, nondimensional, above 0.

    Examples
    --------
    >>> import numpy as np
    >>> from fpk_rocking.envelopes import Exponential
    >>> print(Exponential(peak=2.0).value(np.array([0.5, 2.0, 8.0])).round(3))
    [0.529 1.    0.199]
    """

    kind: ClassVar[str] = "exponential"
    kinks: ClassVar = np.zeros(0)
    peak: float

    def __post_init__(self):
        checks.keep_numbers(self, "noise.envelope", "peak", above=0.0)

    @property
    def spacing(self) -> float:  # type: ignore[override]  # a class attribute of other envelopes
        return 0.02 * self.peak

    @property
    def extremes(self) -> Array:
        return np.array([self.peak])

    def value(self, times: Array) -> Array:
        part = np.asarray(times) / self.peak
        return part * np.exp(1.0 - part)

    def series(self, times: Array, terms: int) -> Array:
        # g^(k) = (-1)^k (u - k) exp(1 - u) / t^k with u = τ/t.
        order = np.arange(terms)
        inverse = np.array([1.0 / math.factorial(k) for k in order]) * (-1.0 / self.peak) ** order
        part = np.asarray(times)[:, None] / self.peak
        return (part - order) * np.exp(1.0 - part) * inverse

    def squared_integral(self, times: Array) -> Array:
        part = np.asarray(times) / self.peak
        return math.e**2 * self.peak * (0.25 - np.exp(-2.0 * part) * (0.5 * part * (part + 1.0) + 0.25))

    def faster(self, factor: float) -> Self:
        return type(self)(self.peak / factor)

    def __str__(self):
        return f"exponential with its peak at {self.peak:g}"


ENVELOPES = {cls.kind: cls for cls in (Trapezoid, Exponential, Table)}
"""Envelopes by their kind."""


FAINTEST = 1e-5
"""Diffusion below which white noise may count as none, but never above 1e-4 of its largest: in a time of 1 it gives a
block a speed of .0045, where one of about 1 overturns it."""


def mean_diffusions(diffusion: float, envelope: Envelope | None, edges: Array) -> Array:
    """Mean of D g², D being a `diffusion`, in each interval between n + 1 edges.

    Noise that has faded to 1e-4 of its largest diffusion, and to `FAINTEST`, is 0, so that a block can rest.
    """
    if envelope is None:
        return np.full(len(edges) - 1, diffusion)
    means = diffusion * (np.diff(envelope.squared_integral(edges)) / np.diff(edges))
    return np.where(means < min(1e-4 * diffusion * envelope.largest**2, FAINTEST), 0.0, means)


class EnvelopePieces(NamedTuple):
    """The envelope g as polynomials, in pieces that end at its kinks, over m intervals.

    `first` (m + 1,): number of the first piece in each interval. `ends` (pieces,): their ends, times since the
    interval's middle. `strength` (pieces, order): coefficients of g in the time since the interval's middle.
    """

    first: np.ndarray
    ends: np.ndarray
    strength: np.ndarray


def envelope_pieces(envelope: Envelope | None, middles: Array, half: float, order: int) -> EnvelopePieces:
    """Polynomials of g, 1 for None, about the `middles` of intervals; of `order` terms unless g is piecewise linear."""
    if envelope is None:
        count = len(middles)
        return EnvelopePieces(np.arange(count + 1), np.full(count, half), np.ones((count, 1)))
    first, ends, centres, owners = [0], [], [], []
    order = 2 if math.isinf(envelope.spacing) else order
    kinks = np.sort(envelope.kinks)
    for middle in middles:
        inside = kinks[np.abs(kinks - middle) < half * (1.0 - 1e-9)] - middle
        stops = [*inside.tolist(), half]
        for begin, end in zip([-half, *stops[:-1]], stops, strict=True):
            ends.append(end)
            centres.append(middle + 0.5 * (begin + end))
            owners.append(middle)
        first.append(len(ends))
    # Linear pieces are moved to the interval's middle, and others begin there.
    strength = envelope.series(np.array(centres), order)
    if order == 2:
        strength[:, 0] += strength[:, 1] * (np.array(owners) - np.array(centres))
    return EnvelopePieces(np.array(first), np.array(ends), strength)


def largest_values(envelope: Envelope | None, edges: Array) -> Array:
    """Largest g in each interval between n + 1 edges; 1 without an envelope."""
    if envelope is None:
        return np.ones(len(edges) - 1)
    values, inside = envelope.value(edges), envelope.extremes
    largest = np.maximum(values[:-1], values[1:])
    places = np.searchsorted(edges, inside) - 1
    within = (places >= 0) & (places < len(largest))
    np.maximum.at(largest, places[within], envelope.value(inside[within]))
    return largest
