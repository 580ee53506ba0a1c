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
        """Convert accelerations (...), m/s², to nondimensional ones of the same shape."""

    def tau(self, seconds: float) -> float:
        """Convert seconds to nondimensional time."""


class Force(abc.ABC):
    """A force f(τ) with the values and polynomials that a time step needs; P is the bounded solution of P'' = P + f."""

    __slots__ = ()

    @property
    @abc.abstractmethod
    def shortest_period(self) -> float:
        """Shortest period of f, over a sixth of which a piece is right to 1e-13; inf where f is piecewise linear."""

    @property
    @abc.abstractmethod
    def steepest(self) -> float:
        """Bound of the slope of f."""

    @abc.abstractmethod
    def value(self, time: float) -> float:
        """Force f at a nondimensional time, that after a jump where there is one."""

    @abc.abstractmethod
    def slope(self, time: float) -> float:
        """Slope of the force at a nondimensional time."""

    @abc.abstractmethod
    def particular(self, time: float) -> tuple[float, float]:
        """Particular solution P and its derivative P' at a nondimensional time."""

    @abc.abstractmethod
    def particular_over(self, start: float, duration: float) -> Array:
        """Polynomial coefficients (TERMS,) of P over a step of a duration, in the time since its start."""

    @abc.abstractmethod
    def since_lift_off(self, time: float) -> tuple[float, float]:
        """Time since |f| last rose through 1 before a time, and the slope of |f| there; (inf, 0) where it has not."""

    @abc.abstractmethod
    def scaled(self, strength: float, rate: float) -> "Force":
        """Return the force of accelerations multiplied by `strength` and frequencies by `rate`, both above 0."""

    def in_units_of(self, level: float) -> "Force":
        """Return the force divided by `level`, the |f| at which a block lifts off (nondimensional).

        What a force says of lift-off, as `since_lift_off`, supposes that this is 1.
        """
        return self if level == 1.0 else self.scaled(1.0 / level, 1.0)

    def shifted(self, time: float) -> "Force":
        """Return the force whose times count from a nondimensional time on."""
        return _Shifted(self, time)


@dataclasses.dataclass(frozen=True)
class _Shifted(Force):
    """A force whose times count from an origin."""

    force: Force
    origin: float

    @property
    def shortest_period(self):
        """Shortest period of the force."""
        return self.force.shortest_period

    @property
    def steepest(self):
        """Bound of the slope of the force."""
        return self.force.steepest

    def value(self, time):
        """Force at a time since the origin, a float."""
        return self.force.value(time + self.origin)

    def slope(self, time):
        """Slope of the force at a time since the origin, a float."""
        return self.force.slope(time + self.origin)

    def particular(self, time):
        """Particular solution P and its derivative P', floats, at a time since the origin."""
        return self.force.particular(time + self.origin)

    def particular_over(self, start, duration):
        """Coefficients (TERMS,) of P over a step of a duration, in the time since its start.

        `start` is a time since the origin.
        """
        return self.force.particular_over(start + self.origin, duration)

    def since_lift_off(self, time):
        """Time since |f| last rose through 1, and the slope of |f| there, as seen at a time since the origin."""
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
        """Time of one cycle; None where it does not repeat."""

    @property
    @abc.abstractmethod
    def half_antisymmetric(self) -> bool:
        """Whether f(τ + T/2) = -f(τ): the second half of a cycle is then the mirror image of the first."""

    if TYPE_CHECKING:  # a property here would forbid a field of this name

        @property
        @abc.abstractmethod
        def duration(self) -> float:
            """Time at which it ends; inf where it does not."""

    @property
    @abc.abstractmethod
    def longest_piece(self) -> float:
        """Time from its instant for which a piece of `pieces` is right to 1e-14, if no kink of f lies between."""

    @property
    @abc.abstractmethod
    def time_scale(self) -> float:
        """Time that an engine's `steps_per_cycle` count in."""

    @property
    @abc.abstractmethod
    def largest(self) -> float:
        """Largest |f|."""

    @property
    @abc.abstractmethod
    def largest_velocity(self) -> float:
        """Largest |∫f dτ|; the mean over a cycle, or the velocity at τ = 0, is 0."""

    @property
    @abc.abstractmethod
    def swing(self) -> float:
        """Bound of |P + P'| and |P - P'|: how far the forcing moves the separatrices, and a block that follows it."""

    @property
    @abc.abstractmethod
    def longest_rest(self) -> float:
        """Longest time in which |f| stays at most 1, so that a block at rest stays there."""

    @abc.abstractmethod
    def spacing(self, longest: float) -> float:
        """Largest spacing up to `longest` of a grid from 0 on whose intervals each see one polynomial piece."""

    @abc.abstractmethod
    def pieces(self, instants: Array) -> Array:
        """Coefficients (n, TERMS) of P in the time since instants (n,), each of the piece of f that begins there."""

    @abc.abstractmethod
    def stage_values(self, spacing: float, count: int) -> Array:
        """Force (count, 3) at the begin, the middle and the end of each interval of a uniform grid from 0 on.

        `spacing` is that of the grid, nondimensional, and `count` the number of its intervals.
        """

    @abc.abstractmethod
    def scaled(self, strength: float, rate: float) -> Self:
        """Return the forcing of accelerations multiplied by `strength` and frequencies by `rate`, both above 0."""

    def check_range(self) -> None:
        """Refuse sizes that the engines cannot carry, by name."""
        for name, (low, high) in self.ranges.items():
            checks.sizes(f"forcing.{name}", getattr(self, name), low, high)

    def for_size(self, size: Size | None) -> Self:  # noqa: ARG002  (only what is in seconds depends on it)
        """Return the forcing made nondimensional by the size of a block; None for a block without dimensions."""
        return self

    @classmethod
    def from_table(cls, name: str, table: dict, folder: File) -> Self:  # noqa: ARG003  (for those from files)
        """Read the forcing from a TOML table (dict) without its kind; `name` is the table's, for messages.

        Files that it names are relative to a folder.
        """
        return cls(**checks.arguments(name, table, cls))


def refuse_transient(forcing: Any, what: str) -> None:
    """Raise ValueError for a forcing that does not repeat; `what` names the computation that needs one that does."""
    if isinstance(forcing, Forcing) and forcing.period is None:
        accepted = f"'harmonic' or 'harmonics', as {what} is only defined for a forcing that repeats"
        raise ValueError(checks.refusal("forcing.kind", forcing.kind, accepted))


def longest_of(period: float) -> float:
    """Longest time for which a Taylor series of TERMS terms is right to 1e-14, nondimensional.

    `period` is the shortest period of f.
    """
    return 0.8 * period / (2.0 * math.pi)
