"""What a forcing is: the parts that the rest of the code asks of every kind."""

import abc
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, Self

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array, File

RANGES = {"amplitude": (0.0, 1e4), "frequency": (1e-3, 1e4), "phase": (0.0, 1e6), "time": (1e-5, 1e5)}
"""Smallest and largest sizes that the engines carry, by the kind of a quantity."""


class Size(Protocol):
    """What a forcing in seconds and m/s² needs of the size of a block, see `Dimensions`."""

    gravity: float
    """Acceleration of gravity, m/s²."""

    def amplitude(self, peak_acceleration: Array) -> Array:
        """Accelerations (...) in m/s² over g θ_cr."""

    def tau(self, seconds: float) -> float:
        """Nondimensional time."""


class Forcing(abc.ABC):
    """Acceleration of the base f(τ) from τ = 0 on, nondimensional: the forcing of a scene.

    This class is abstract: use `Harmonic`, `Harmonics`, `Pulse` or `Record`. A new kind is a frozen dataclass, equal
    and hashed by its values, with all methods and properties of this class; `PeriodicForcing` and `TransientForcing`
    supply most of them. P is the bounded solution of P'' = P + f; it is given by TERMS Taylor coefficients, lowest
    power first.

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
    vertical: "Forcing | None" = None
    """Vertical acceleration of the base beside f; None where there is none."""

    if TYPE_CHECKING:  # a property here would forbid a field of this name

        @property
        @abc.abstractmethod
        def duration(self) -> float:
            """Time at which it ends; inf where it does not."""

    @property
    @abc.abstractmethod
    def period(self) -> float | None:
        """Time of one cycle; None where it does not repeat."""

    @property
    @abc.abstractmethod
    def half_antisymmetric(self) -> bool:
        """Whether f(τ + T/2) = -f(τ), T the period: half of a cycle is then the mirror image of the other."""

    @property
    @abc.abstractmethod
    def shortest_period(self) -> float:
        """Shortest period of f, over a sixth of which a `piece` is right to 1e-13; inf where f is piecewise linear."""

    @property
    @abc.abstractmethod
    def longest_piece(self) -> float:
        """Time from its instant for which a polynomial of `pieces` is right to 1e-14 if f has no kink before."""

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
        """Largest |∫f dτ|; the integral's mean over a cycle, or its value at τ = 0, is 0."""

    @property
    @abc.abstractmethod
    def steepest(self) -> float:
        """Upper bound of |df/dτ|."""

    @property
    @abc.abstractmethod
    def swing(self) -> float:
        """Bound of |P + P'| and |P - P'|: how far f moves the separatrices, and a block that follows it."""

    @property
    @abc.abstractmethod
    def longest_rest(self) -> float:
        """Longest time in which |f| stays at most 1, so that a block at rest stays there."""

    @abc.abstractmethod
    def value(self, time: float) -> float:
        """Force f at a time; at a jump, that after it."""

    @abc.abstractmethod
    def slope(self, time: float) -> float:
        """Slope df/dτ at a time."""

    @abc.abstractmethod
    def particular(self, time: float) -> tuple[float, float]:
        """(P, P') at a time."""

    @abc.abstractmethod
    def particular_over(self, start: float, duration: float) -> Array:
        """Coefficients (TERMS,) of P in the time since `start`, for one time step."""

    @abc.abstractmethod
    def pieces(self, instants: Array) -> Array:
        """Coefficients (n, TERMS) of P in the time since each of n instants; at a kink, of what begins there."""

    @abc.abstractmethod
    def spacing(self, longest: float) -> float:
        """Largest spacing, up to `longest`, of a grid from τ = 0 on whose intervals have no kink of f inside."""

    @abc.abstractmethod
    def stage_values(self, spacing: float, count: int) -> Array:
        """Force f (count, 3) at start, middle and end of each interval of a uniform grid from τ = 0 on."""

    @abc.abstractmethod
    def since_lift_off(self, time: float) -> tuple[float, float]:
        """(elapsed, slope): time since |f| last rose through 1, and d|f|/dτ there; (inf, 0) if never before."""

    def weights(self, spacing: float, count: int) -> Array:  # noqa: ARG002  (a base that does not move vertically)
        """Weight of a block over mg in each interval of a uniform grid from τ = 0 on, rows (count, 3) of `Weight`.

        No rows, (0, 3), where the base does not move vertically.
        """
        return np.empty((0, 3))

    def weight(self, times: Array) -> Array:
        """Weight of a block over mg at times (n,)."""
        return np.ones(len(times))

    def lifting(self, level: float) -> float:
        """Largest |f| / `level` - a_v/g; up to 1 a block that lifts off at |f| = `level` with the weight mg rests."""
        return self.largest / level

    @abc.abstractmethod
    def scaled(self, strength: float, rate: float) -> Self:
        """The forcing with accelerations multiplied by `strength` and frequencies by `rate`, both above 0."""

    def in_units_of(self, level: float) -> Self:
        """The forcing divided by the |f| at which a block lifts off: `since_lift_off` supposes that this is 1."""
        return self if level == 1.0 else self.scaled(1.0 / level, 1.0)

    def check_range(self) -> None:
        """Raise ValueError, by name, for a size outside `ranges`."""
        for name, (low, high) in self.ranges.items():
            checks.sizes(f"forcing.{name}", getattr(self, name), low, high)

    def for_size(self, size: Size | None) -> Self:  # noqa: ARG002  (only what is in seconds depends on it)
        """The forcing made nondimensional by a block's size, or itself if it is so already."""
        return self

    @classmethod
    def from_table(cls, name: str, table: dict, folder: File) -> Self:  # noqa: ARG003  (for those from files)
        """The forcing of a TOML table without its kind; `name` is for messages, files are relative to `folder`."""
        return cls(**checks.arguments(name, table, cls))


def refuse_vertical(forcing: Forcing, what: str) -> None:
    """Raise ValueError for a base that moves vertically too; `what` names the computation that leaves this out."""
    if forcing.vertical is not None:
        accepted = f"none, as {what} leave it out; Monte Carlo by the methods 'exact' and 'rk4' includes it"
        raise ValueError(checks.refusal("forcing.vertical", str(forcing.vertical), accepted))


def refuse_transient(forcing: Any, what: str) -> None:
    """Raise ValueError for a forcing that does not repeat; `what` names the computation that needs one."""
    if isinstance(forcing, Forcing) and forcing.period is None:
        accepted = f"'harmonic' or 'harmonics', as {what} is only defined for a forcing that repeats"
        raise ValueError(checks.refusal("forcing.kind", forcing.kind, accepted))
