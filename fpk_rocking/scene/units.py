"""Metres, seconds and hertz of a rectangular block against the nondimensional scene.

A rigid block of width 2b and height 2h on a rigid base turns about a bottom corner. With the half diagonal R, the
critical angle θ_cr = atan(b/h) and I = 4mR²/3 it obeys d²θ/dt² = p² [-s sin(θ_cr - sθ) + cos(θ_cr - sθ) a(t)/g] with
p² = 3g/(4R). In Θ = θ/θ_cr and τ = pt this is the scene's equation, with a base acceleration a in the place of an
amplitude a/(g θ_cr). Taken as slender, sine linear and cosine 1, a block has a restoring moment too large by about
θ_cr²/6 and a forcing too large by up to θ_cr²/2: 1 % and 3 % at θ_cr = 0.25. a counts positive towards θ < 0.
"""

import abc
import dataclasses
import math
import re
from typing import Any, TypeVar

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array
from fpk_rocking.physics.forcing.readers.terms import UNITS, unit_of

_Number = TypeVar("_Number", float, Array)

STANDARD_GRAVITY = UNITS["g"]
"""Acceleration of gravity, m/s², where none is given; also what "g" means as a unit."""

_UNITS: dict[str, dict[str, float]] = {
    "length": {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048},
    "acceleration": {unit: UNITS[unit] for unit in ("m/s2", "g", "cm/s2")},
    "frequency": {"Hz": 1.0, "rad/s": 0.5 / math.pi},
    "time": {"s": 1.0, "ms": 0.001},
    "angle": {"deg": math.pi / 180.0, "°": math.pi / 180.0, "rad": 1.0},
}
"""Units of each kind of quantity in SI (of frequencies in Hz), that of a bare number first."""

_QUANTITY = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*?)\s*")


def in_units(name: str, value: Any, kind: str) -> Any:
    """Return a quantity in SI units, or in Hz or radians, of a number, a text with a unit, or a list of these.

    A bare number is in m, m/s², Hz, s, or degrees. What is no text, number or list comes back as it is.
    """
    units = _UNITS[kind]
    bare = next(iter(units.values()))
    if isinstance(value, list | tuple):
        return type(value)(in_units(f"{name}[{place}]", item, kind) for place, item in enumerate(value))
    if not isinstance(value, str):
        return value if bare == 1.0 or isinstance(value, bool) or not isinstance(value, int | float) else bare * value
    match = _QUANTITY.fullmatch(value)
    unit = match and (unit_of(match[2]) if kind == "acceleration" else _unit_in(match[2], units))
    if not match or unit not in units:
        first, number = next(iter(units)), match[1] if match else "1"
        accepted = f'a number in {first}, or a text with a unit such as "{number} {first}" ({", ".join(units)})'
        raise ValueError(checks.refusal(name, value, accepted))
    return float(match[1]) * units[unit]


def _unit_in(text, units):
    """Return the unit that a text means, in letters of any size, or None."""
    return next((unit for unit in units if unit.lower() == text.lower()), None)


def keep_sizes(size: Any, table: str, *lengths: str) -> None:
    """Check lengths and gravity of a frozen dataclass, and keep them in m and m/s²."""
    for name, kind in (*((name, "length") for name in lengths), ("gravity", "acceleration")):
        full = f"{table}.{name}"
        value = checks.number(full, in_units(full, getattr(size, name), kind), above=0.0)
        # Beyond, a conversion of units divides by 0 or overflows.
        checks.keep(size, **{name: checks.number(full, value, at_least=1e-100, at_most=1e100)})


class BlockSize(abc.ABC):
    """Conversions of nondimensional quantities to units and back: by critical angle, frequency parameter, gravity.

    Examples
    --------
    >>> from fpk_rocking import Dimensions
    >>> size = Dimensions(width=0.5, height=1.8)
    >>> print(f"{size.seconds(1.0):.3f} s, {size.critical_angle:.3f} rad")
    0.356 s, 0.271 rad
    """

    __slots__ = ()
    gravity: float

    @property
    @abc.abstractmethod
    def critical_angle(self) -> float:
        """Critical angle θ_cr, radians, the unit of angles."""

    @property
    @abc.abstractmethod
    def frequency_parameter(self) -> float:
        """Frequency parameter p, rad/s: nondimensional time is τ = pt."""

    @property
    @abc.abstractmethod
    def label(self) -> str:
        """The size as a short text."""

    @property
    @abc.abstractmethod
    def restitution(self) -> float | tuple[float, float]:
        """Velocity ratio of an impact without bounce or slip: one number, or (from the left, from the right)."""

    @property
    def slenderness_error(self) -> tuple[float, float]:
        """Largest relative errors of the linearized moments about the corner: (of gravity, of the shaking).

        They are θ_cr / sin θ_cr - 1 and 1 / cos θ_cr - 1, small for a slender block.
        """
        angle = self.critical_angle
        return angle / math.sin(angle) - 1.0, 1.0 / math.cos(angle) - 1.0

    def seconds(self, tau: _Number) -> _Number:
        """Convert nondimensional time to seconds.

        Parameters
        ----------
        tau : float or ndarray
            Nondimensional time τ = pt.
        """
        return tau / self.frequency_parameter

    def tau(self, seconds: _Number) -> _Number:
        """Convert seconds to nondimensional time τ = pt.

        Parameters
        ----------
        seconds : float or ndarray
        """
        return seconds * self.frequency_parameter

    def radians(self, angle: _Number) -> _Number:
        """Convert a nondimensional angle to radians.

        Parameters
        ----------
        angle : float or ndarray
            Θ = θ/θ_cr, in units of the critical angle.
        """
        return angle * self.critical_angle

    def amplitude(self, peak_acceleration: _Number) -> _Number:
        """Convert a base acceleration to the nondimensional amplitude a/(g θ_cr).

        Parameters
        ----------
        peak_acceleration : float or ndarray
            a, m/s².
        """
        return peak_acceleration / (self.gravity * self.critical_angle)

    def frequency(self, frequency_hz: _Number) -> _Number:
        """Convert a frequency to the nondimensional angular frequency 2πf/p.

        Parameters
        ----------
        frequency_hz : float or ndarray
            f, Hz.
        """
        return 2.0 * math.pi * frequency_hz / self.frequency_parameter


@dataclasses.dataclass(frozen=True, slots=True)
class Dimensions(BlockSize):
    """Size of a rectangular block, which converts nondimensional quantities to units and back.

    Parameters
    ----------
    width, height : float
        Full width and full height, metres, or a text with a unit ("50 cm").
    gravity : float
        Acceleration of gravity, m/s².

    Raises
    ------
    TypeError, ValueError
        A value is not a positive number from 1e-100 to 1e100.

    Examples
    --------
    >>> from fpk_rocking import Dimensions
    >>> size = Dimensions(width="50 cm", height=1.8)
    >>> print(f"p = {size.frequency_parameter:.2f} rad/s, {size.seconds(10.0):.2f} s, {size.radians(1.0):.3f} rad")
    p = 2.81 rad/s, 3.56 s, 0.271 rad
    """

    width: float
    height: float
    gravity: float = STANDARD_GRAVITY

    def __post_init__(self):
        keep_sizes(self, "block.dimensions", "width", "height")

    @property
    def critical_angle(self) -> float:
        """Critical angle θ_cr, radians: tilted by it, the block is balanced on its corner."""
        return math.atan2(self.width, self.height)

    @property
    def half_diagonal(self) -> float:
        """Half diagonal R, metres: the distance from the corner to the centre of mass."""
        return 0.5 * math.hypot(self.width, self.height)

    @property
    def frequency_parameter(self) -> float:
        """Frequency parameter p = √(3g/(4R)), rad/s: nondimensional time is τ = pt."""
        return math.sqrt(3.0 * self.gravity / (4.0 * self.half_diagonal))

    @property
    def restitution(self) -> float:
        """Velocity ratio e = 1 - (3/2) sin²θ_cr of an impact without bounce or slip.

        From the balance of angular momentum about the new corner: G. W. Housner, "The behavior of inverted pendulum
        structures during earthquakes", Bull. Seism. Soc. Am. 53(2), 403-417, 1963 (his r is e²).

        Raises
        ------
        ValueError
            The block is so squat (width/height > √2) that e would be negative: it stops at the first impact.
        """
        value = 1.0 - 1.5 * math.sin(self.critical_angle) ** 2
        if value < 0.0:
            raise ValueError(
                f"block.dimensions: got width/height = {self.width / self.height:.6g}, accepted: <= √2 = 1.41421, as "
                f"Housner's restitution is negative here ({value:.6g}); for so squat a block give block.restitution"
            )
        return value

    @property
    def label(self) -> str:
        """Width and height as a short text."""
        return f"{self.width:.3g} m × {self.height:.3g} m"

    def __str__(self):
        return f"{self.width:.3g} m by {self.height:.3g} m"
