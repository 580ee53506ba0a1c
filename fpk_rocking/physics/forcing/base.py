"""What a forcing is: the parts that the rest of the code asks of every kind.

A time step asks a `Force`. A scene holds a `Forcing`: a force from τ = 0 on, with what is known of it as a whole.
"""

import abc
import dataclasses
import math
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, Self

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array, File

RANGES = {"amplitude": (0.0, 1e4), "frequency": (1e-3, 1e4), "phase": (0.0, 1e6), "time": (1e-5, 1e5)}
"""Smallest and largest sizes that the engines carry, by the kind of a quantity."""


class Size(Protocol):
    """The conversions by the size of a block that a forcing in seconds and m/s² needs, see `Dimensions`."""

    def amplitude(self, peak_acceleration: Array) -> Array:
        """Return accelerations (...), m/s², as nondimensional ones, a/(g θ_cr), of the same shape."""

    def tau(self, seconds: float) -> float:
        """Return a time in seconds as a nondimensional one, a float."""


class Force(abc.ABC):
    """A force f(τ), nondimensional, with the values and polynomials that a time step needs.

    P is the bounded solution of P'' = P + f.
    """

    __slots__ = ()

    @property
    @abc.abstractmethod
    def shortest_period(self) -> float:
        """Shortest nondimensional period of f; inf where f is piecewise linear.

        Over a sixth of it a polynomial of TERMS coefficients is right to 1e-13.
        """

    @property
    @abc.abstractmethod
    def steepest(self) -> float:
        """Upper bound of |df/dτ|, nondimensional."""

    @abc.abstractmethod
    def value(self, time: float) -> float:
        """Return the force f at `time` τ, a float, both nondimensional; at a jump, that after it."""

    @abc.abstractmethod
    def slope(self, time: float) -> float:
        """Return df/dτ at `time` τ, a float, both nondimensional."""

    @abc.abstractmethod
    def particular(self, time: float) -> tuple[float, float]:
        """Return (P, P') at `time` τ, nondimensional: the bounded solution of P'' = P + f and its derivative."""

    @abc.abstractmethod
    def particular_over(self, start: float, duration: float) -> Array:
        """Return polynomial coefficients (TERMS,) of P, the bounded solution of P'' = P + f, over one time step.

        The lowest power of the time since the step's `start` comes first; `duration` is that of the step,
        nondimensional.
        """

    @abc.abstractmethod
    def since_lift_off(self, time: float) -> tuple[float, float]:
        """Return (elapsed, slope): the time since |f| last rose through 1, as seen at `time`, and d|f|/dτ at that rise.

        Both are nondimensional; (inf, 0) where |f| has not risen through 1 before.
        """

    @abc.abstractmethod
    def scaled(self, strength: float, rate: float) -> "Force":
        """Return the force with accelerations multiplied by `strength` and frequencies by `rate`, both above 0."""

    def in_units_of(self, level: float) -> "Force":
        """Return the `Force` divided by `level`, the |f| at which a block lifts off (nondimensional).

        What a force says of lift-off, as `since_lift_off`, supposes that this is 1.
        """
        return self if level == 1.0 else self.scaled(1.0 / level, 1.0)

    def shifted(self, time: float) -> "Force":
        """Return the `Force` f(time + τ): its times count from the nondimensional `time` on."""
        return _Shifted(self, time)


@dataclasses.dataclass(frozen=True)
class _Shifted(Force):
    """The force f(origin + τ), `force` being f: its times τ count from `origin`; all are nondimensional."""

    force: Force
    origin: float

    @property
    def shortest_period(self):
        """Shortest period of the force, a float, nondimensional."""
        return self.force.shortest_period

    @property
    def steepest(self):
        """Bound of the absolute slope of the force, a float, nondimensional."""
        return self.force.steepest

    def value(self, time):
        """Return the force, a float, at a nondimensional `time` since the origin."""
        return self.force.value(time + self.origin)

    def slope(self, time):
        """Return the slope of the force, a float, at a nondimensional `time` since the origin."""
        return self.force.slope(time + self.origin)

    def particular(self, time):
        """Return (P, P'), floats, at a nondimensional `time` since the origin: the bounded solution of P'' = P + f."""
        return self.force.particular(time + self.origin)

    def particular_over(self, start, duration):
        """Return coefficients (TERMS,) of P over a step of a duration, in the time since its start, lowest power first.

        P is the bounded solution of P'' = P + f. `start` is a time since the origin; it and `duration` are
        nondimensional.
        """
        return self.force.particular_over(start + self.origin, duration)

    def since_lift_off(self, time):
        """Return (elapsed, slope): the time since |f| last rose through 1, and d|f|/dτ there; (inf, 0) if never.

        It is as seen at a nondimensional `time` since the origin.
        """
        return self.force.since_lift_off(time + self.origin)

    def scaled(self, strength, rate):
        """Return the force with accelerations times `strength` and frequencies times `rate`; its origin moves along."""
        return _Shifted(self.force.scaled(strength, rate), self.origin / rate)


class Forcing(Force):
    """Deterministic acceleration of the base f(τ) from τ = 0 on, nondimensional: the forcing of a scene.

    A kind of forcing is a frozen dataclass, equal and hashed by its values, with all that stands here; most of it comes
    from `PeriodicForcing` or `TransientForcing`. This class itself makes no values: see `Harmonic`, `Harmonics`,
    `Pulse` and `Record`.

    Examples
    --------
    >>> from fpk_rocking import Forcing, load_scene
    >>> forcing = load_scene("main").forcing
    >>> print(isinstance(forcing, Forcing), forcing.kind, f"{forcing.period:.3f}")
    True harmonic 2.327
    """

    __slots__ = ()

    kind: ClassVar[str]
    """Its name in a scene file."""
    ranges: ClassVar[dict[str, tuple[float, float]]]
    """Smallest and largest size that the engines carry, of fields or other parts, by name."""
    dimensional: ClassVar[bool] = False
    """Whether it is in seconds and m/s², so that it needs the dimensions of the block and follows them."""

    @property
    @abc.abstractmethod
    def period(self) -> float | None:
        """Nondimensional time of one cycle; None where it does not repeat."""

    @property
    @abc.abstractmethod
    def half_antisymmetric(self) -> bool:
        """Whether f(τ + T/2) = -f(τ), T the period: half of a cycle is then the mirror image of the other."""

    if TYPE_CHECKING:  # a property here would forbid a field of this name

        @property
        @abc.abstractmethod
        def duration(self) -> float:
            """Nondimensional time at which it ends; inf where it does not."""

    @property
    @abc.abstractmethod
    def longest_piece(self) -> float:
        """Nondimensional time from its instant for which a polynomial of `pieces` is right to 1e-14.

        That holds if no kink of f lies between.
        """

    @property
    @abc.abstractmethod
    def time_scale(self) -> float:
        """Nondimensional time that an engine's `steps_per_cycle` count in."""

    @property
    @abc.abstractmethod
    def largest(self) -> float:
        """Largest |f|, nondimensional."""

    @property
    @abc.abstractmethod
    def largest_velocity(self) -> float:
        """Largest |∫f dτ|, nondimensional; the integral's mean over a cycle, or its value at τ = 0, is 0."""

    @property
    @abc.abstractmethod
    def swing(self) -> float:
        """Bound of |P + P'| and |P - P'|, nondimensional, P being the bounded solution of P'' = P + f.

        It says how far the forcing moves the separatrices, and a block that follows it.
        """

    @property
    @abc.abstractmethod
    def longest_rest(self) -> float:
        """Longest nondimensional time in which |f| stays at most 1, so that a block at rest stays there."""

    @abc.abstractmethod
    def spacing(self, longest: float) -> float:
        """Return the largest spacing, up to `longest`, of a grid from τ = 0 on whose intervals have no kink inside.

        So f and P have one polynomial on each interval. Spacing and `longest` are nondimensional times.
        """

    @abc.abstractmethod
    def pieces(self, instants: Array) -> Array:
        """Return coefficients (n, TERMS) of P in the time since each of the `instants` (n,), lowest power first.

        P is the bounded solution of P'' = P + f; at a kink of f it is that of the piece that begins there. Times are
        nondimensional.
        """

    @abc.abstractmethod
    def stage_values(self, spacing: float, count: int) -> Array:
        """Force f (count, 3) at the begin, the middle and the end of each interval of a uniform grid from τ = 0 on.

        `spacing` is that of the grid, nondimensional as f is, and `count` the number of its intervals.
        """

    @abc.abstractmethod
    def scaled(self, strength: float, rate: float) -> Self:
        """Return the forcing with accelerations multiplied by `strength` and frequencies by `rate`, both above 0."""

    def check_range(self) -> None:
        """Raise ValueError, by name, for a size outside `ranges`, which the engines cannot carry; else return None."""
        for name, (low, high) in self.ranges.items():
            checks.sizes(f"forcing.{name}", getattr(self, name), low, high)

    def for_size(self, size: Size | None) -> Self:  # noqa: ARG002  (only what is in seconds depends on it)
        """Return the forcing made nondimensional by the `Size` of a block, or itself if it is so already.

        `size` is None for a block without dimensions.
        """
        return self

    @classmethod
    def from_table(cls, name: str, table: dict, folder: File) -> Self:  # noqa: ARG003  (for those from files)
        """Return the forcing that a TOML table (dict) without its kind describes; `name` is the table's, for messages.

        Files that it names are relative to `folder`, a path.
        """
        return cls(**checks.arguments(name, table, cls))


def refuse_transient(forcing: Any, what: str) -> None:
    """Raise ValueError for a forcing that does not repeat, else return None.

    `what`, a text, names the computation that needs a forcing that repeats, for the message.
    """
    if isinstance(forcing, Forcing) and forcing.period is None:
        accepted = f"'harmonic' or 'harmonics', as {what} is only defined for a forcing that repeats"
        raise ValueError(checks.refusal("forcing.kind", forcing.kind, accepted))


def longest_of(period: float) -> float:
    """Return the longest time, nondimensional, for which a Taylor series of f of TERMS terms is right to 1e-14.

    `period` is the shortest period of f, nondimensional.
    """
    return 0.8 * period / (2.0 * math.pi)
