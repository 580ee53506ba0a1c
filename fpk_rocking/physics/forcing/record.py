"""Forcing by a recorded motion of the base, linear between samples."""

import dataclasses
import functools
import math
import pathlib
from typing import ClassVar, Self

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.types import Array, File
from fpk_rocking.physics.forcing.base import RANGES, Size
from fpk_rocking.physics.forcing.files import MOST, UNITS, read, unit_of
from fpk_rocking.physics.forcing.transient import TransientForcing
from fpk_rocking.physics.motion import TERMS


@dataclasses.dataclass(frozen=True)
class Record(TransientForcing):
    """Recorded acceleration of the base, linear between equally spaced samples and 0 after the last one.

    A scene with a record needs ``block.dimensions``, from which its time τ = pt and force a/(g θ_cr) follow. The first
    sample is at τ = 0.

    Parameters
    ----------
    interval : float
        Time between samples, seconds.
    samples : sequence of float
        Accelerations, 2 to 2^20 of them. A positive value accelerates the base towards negative angles.
    units : {"g", "m/s2", "cm/s2"}
        Unit of the samples; g is 9.80665 m/s². Other spellings, such as "m/s^2" and "gal", become one of these.
    scale : float
        Factor of the samples.
    source : str
        Where the record is from, such as the name of a file. It does not count when records are compared.

    Examples
    --------
    >>> from fpk_rocking import Record, Scene
    >>> from montecarlo import simulate
    >>> record = Record(interval=0.25, samples=(0.0, 0.6, -0.6, 0.0), units="g")
    >>> print(simulate(Scene.from_block(0.5, 1.8, record=record)).metadata["outcome"])
    deterministic: overturns to the left at τ = 3.691 (1.32 s)
    """

    kind: ClassVar[str] = "record"
    ranges: ClassVar = {"duration": RANGES["time"], "unit": RANGES["time"]}
    dimensional: ClassVar[bool] = True
    interval: float
    samples: tuple[float, ...] = dataclasses.field(repr=False)
    units: str
    scale: float = 1.0
    source: str = dataclasses.field(default="", compare=False)

    _size: ClassVar[Size | None] = None
    time_scale: ClassVar[float] = 2.0
    shortest_period: ClassVar[float] = math.inf

    def __post_init__(self):
        checks.keep_numbers(self, "forcing", "interval", above=0.0)
        checks.keep(self, samples=_samples(self.samples), units=_unit(self.units))
        checks.keep_numbers(self, "forcing", "scale")
        checks.keep(self, source=checks.sentence("forcing.source", self.source))

    @classmethod
    def from_file(cls, path: File, *, units: str | None = None, scale: float = 1.0) -> Self:
        """Read a record from a file.

        Parameters
        ----------
        path : str or pathlib.Path
            A PEER file (.AT2), whose third line says the unit and whose fourth has ``NPTS= n, DT= seconds`` or ``n
            seconds NPTS, DT``; a file of the ESM database (.ASC); or a text of two columns, time in seconds and
            acceleration, parted by commas, semicolons, tabs or blanks. A first line of names may say the unit; lines
            that begin with # are comments.
        units : str, optional
            Unit of the accelerations, see `Record`. Required where the file does not say it.
        scale : float
            Factor of the samples.

        Returns
        -------
        Record

        Raises
        ------
        FileNotFoundError
            There is no such file.
        TypeError, ValueError
            A parameter is refused, or the file has another format, is truncated, or has values that are not finite or
            times that are not equally spaced; the message says what and where.
        """
        file = checks.path("forcing.file", path)
        wanted = None if units is None else _unit(units)
        motion = read(file)
        if wanted and motion.units and wanted != motion.units:
            accepted = f"{motion.units!r}, as the file {str(file)!r} says, or nothing"
            raise ValueError(checks.refusal("forcing.units", units, accepted))
        if not wanted and not motion.units:
            raise ValueError(
                f"forcing.units: missing, the file {str(file)!r} does not say it, accepted: {', '.join(UNITS)}"
            )
        return cls(motion.interval, tuple(motion.samples.tolist()), wanted or motion.units, scale, file.name)

    @classmethod
    def from_table(cls, name: str, table: dict, folder: File) -> Self:
        """Read a record from its file, or from a table that holds its samples."""
        if "file" not in table:
            return super().from_table(name, table, folder)
        keys = ("file", "units", "scale")
        for key in table:
            if key not in keys:
                raise ValueError(f"{name}.{key}: unknown, accepted beside {name}.file: {', '.join(keys[1:])}")
        path = pathlib.Path(folder, checks.path(f"{name}.file", table["file"]))
        return cls.from_file(path, **{key: value for key, value in table.items() if key != "file"})

    def scaled(self, strength: float, rate: float) -> Self:
        """Return the record with accelerations multiplied by a factor, and times divided by one."""
        changed = dataclasses.replace(self, scale=self.scale * strength, interval=self.interval / rate)
        return changed if self._size is None else changed.for_size(self._size)

    def check_range(self) -> None:
        """Refuse sizes that the engines cannot carry, by name."""
        super().check_range()
        most = RANGES["amplitude"][1]
        if not self.largest <= most:
            accepted = f"accelerations up to {most:g} g θ_cr{checks.ENGINES}"
            raise ValueError(checks.refusal("forcing.scale", self.scale, accepted))

    def for_size(self, size: Size | None) -> Self:
        """Return the record made nondimensional by the size of a block; None for one without dimensions is refused."""
        if size is None:
            raise _unsized()
        if size == self._size:
            return self
        bound = dataclasses.replace(self)
        checks.keep(bound, _size=size)
        return bound

    @property
    def _bound_size(self) -> Size:
        if self._size is None:
            raise _unsized()
        return self._size

    @functools.cached_property
    def forces(self) -> Array:
        """Nondimensional force at the samples, shape (n,); what overflows is refused with all that is too strong."""
        with np.errstate(over="ignore"):
            return self._bound_size.amplitude(self.scale * UNITS[self.units] * np.array(self.samples))

    @functools.cached_property
    def unit(self) -> float:
        """Nondimensional time between samples."""
        return self._bound_size.tau(self.interval)

    @property
    def duration(self) -> float:
        """Time at which it ends: that of the last sample."""
        return self.unit * (len(self.samples) - 1)

    @functools.cached_property
    def largest(self) -> float:
        """Largest |f|."""
        return float(np.abs(self.forces).max())

    @functools.cached_property
    def steepest(self) -> float:
        """Largest slope of the force between samples."""
        return float(np.abs(np.diff(self.forces)).max()) / self.unit

    def series(self, times: Array) -> Array:
        """Return Taylor coefficients (n, TERMS) of f about times (n,)."""
        out, forces = np.zeros((len(times), TERMS)), self.forces
        place = np.floor(np.asarray(times) / self.unit + 1e-9).astype(np.int64)
        on = (place >= 0) & (place < len(forces) - 1)
        k = place[on]
        slope = (forces[k + 1] - forces[k]) / self.unit
        out[on, 0], out[on, 1] = forces[k] + slope * (times[on] - k * self.unit), slope
        return out

    def __str__(self):
        name = self.source or "a record"
        return f"{name}, {len(self.samples)} samples of {self.interval:g} s, {self.scale:g} times"


def _unit(text):
    """Return the unit that a text means, or refuse it."""
    if not isinstance(text, str):
        raise TypeError(checks.refusal("forcing.units", text, " or ".join(map(repr, UNITS))))
    units = unit_of(text)
    if units is None:
        raise ValueError(checks.refusal("forcing.units", text, " or ".join(map(repr, UNITS))))
    return units


def _unsized():
    """Return the error of a record without the dimensions of a block."""
    return ValueError("block.dimensions: missing, required for a forcing of kind 'record', which is in seconds")


def _samples(value):
    """Return samples as a tuple of floats, or refuse them."""
    accepted = f"a list of 2 to {MOST} finite numbers"
    if isinstance(value, str | bytes):
        raise TypeError(checks.refusal("forcing.samples", value, accepted))
    try:
        array = np.asarray(value)
    except ValueError:
        raise TypeError(checks.refusal("forcing.samples", value, accepted)) from None
    if array.dtype.kind not in "fiu":
        raise TypeError(checks.refusal("forcing.samples", type(value).__name__, accepted))
    if array.ndim != 1 or not 2 <= array.size <= MOST:
        raise ValueError(checks.refusal("forcing.samples", f"an array of shape {array.shape}", accepted))
    array = array.astype(float)
    wild = np.flatnonzero(~np.isfinite(array))
    if wild.size:
        raise ValueError(checks.refusal(f"forcing.samples[{wild[0]}]", float(array[wild[0]]), accepted))
    return tuple(array.tolist())
