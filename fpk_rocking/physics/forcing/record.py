"""Forcing by a recorded motion of the base, linear between samples, and the files that such records come in."""

import codecs
import dataclasses
import functools
import math
import pathlib
import re
from typing import ClassVar, Self

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.types import Array, File
from fpk_rocking.physics.forcing.base import AMPLITUDES, TIMES, Size, keep
from fpk_rocking.physics.forcing.transient import TransientForcing
from fpk_rocking.physics.motion import TERMS

MOST = 2**20
"""Most samples: 87 minutes at 200 Hz."""

UNITS = {"g": 9.80665, "m/s2": 1.0}
"""Metres per second squared of a unit of acceleration."""

_MOST_BYTES = 64 * MOST
_EVEN = 0.02
"""Part of the interval by which a time in a file may be off: files round times."""


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
    units : {"g", "m/s2"}
        Unit of the samples; g is 9.80665 m/s².
    scale : float
        Factor of the samples.
    source : str
        Where the record is from, such as the name of a file. It does not count when records are compared.
    """

    kind: ClassVar[str] = "record"
    ranges: ClassVar = {"duration": TIMES, "unit": TIMES}
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
        keep(self, interval=checks.number("forcing.interval", self.interval, above=0.0))
        keep(self, samples=_samples(self.samples))
        if not isinstance(self.units, str) or self.units not in UNITS:
            error = ValueError if isinstance(self.units, str) else TypeError
            raise error(checks.refusal("forcing.units", self.units, " or ".join(map(repr, UNITS))))
        keep(self, scale=checks.number("forcing.scale", self.scale))
        keep(self, source=checks.sentence("forcing.source", self.source))

    @classmethod
    def from_file(cls, path: File, *, units: str | None = None, scale: float = 1.0) -> Self:
        """Read a record from a file.

        Parameters
        ----------
        path : str or pathlib.Path
            A PEER file (.AT2, in g), whose fourth line has ``NPTS= n, DT= seconds`` or ``n seconds NPTS, DT``; or a
            text file of two columns, time in seconds and acceleration. Lines that begin with # are comments.
        units : {"g", "m/s2"}, optional
            Unit of the accelerations. Required for columns; an .AT2 file is in g.
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
        peer = file.suffix.lower() == ".at2"
        if peer and units not in (None, "g"):
            raise ValueError(checks.refusal("forcing.units", units, "'g', the unit of an .AT2 file, or nothing"))
        if not peer and units is None:
            raise ValueError(f"forcing.units: missing, required for a file of two columns: {', '.join(UNITS)}")
        text = _text(file)
        try:
            interval, samples = (_peer if peer else _columns)(text)
        except ValueError as error:
            raise ValueError(f"forcing.file: {str(file)!r}: {error}") from None
        return cls(interval, samples, units or "g", scale, file.name)

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
        return changed if self._size is None else changed.on(self._size)

    def check_range(self) -> None:
        """Refuse sizes that the engines cannot carry, by name."""
        super().check_range()
        if not self.largest <= AMPLITUDES[1]:
            accepted = f"accelerations up to {AMPLITUDES[1]:g} g θ_cr{checks.ENGINES}"
            raise ValueError(checks.refusal("forcing.scale", self.scale, accepted))

    def on(self, size: Size | None) -> Self:
        """Return the record as the forcing of a block of a size, None for none; see `fpk_rocking.scene.units`."""
        if size is None:
            raise _unsized()
        if size == self._size:
            return self
        bound = dataclasses.replace(self)
        keep(bound, _size=size)
        return bound

    @property
    def _known_size(self) -> Size:
        if self._size is None:
            raise _unsized()
        return self._size

    @functools.cached_property
    def forces(self) -> Array:
        """Nondimensional force at the samples, shape (n,); what overflows is refused with all that is too strong."""
        with np.errstate(over="ignore"):
            return self._known_size.amplitude(self.scale * UNITS[self.units] * np.array(self.samples))

    @functools.cached_property
    def unit(self) -> float:
        """Nondimensional time between samples."""
        return self._known_size.tau(self.interval)

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


def _unsized():
    return ValueError("block.dimensions: missing, required for a forcing of kind 'record', which is in seconds")


def _samples(value):
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


def _text(path):
    """Read a text file of a size that a record can have."""
    try:
        size = path.stat().st_size
        # A device or a pipe may never end.
        if not path.is_file():
            raise OSError("it is no file")
        if size > _MOST_BYTES:
            accepted = f"at most {_MOST_BYTES} bytes, and {MOST} samples"
            raise ValueError(f"forcing.file: {str(path)!r}: got {size} bytes, accepted: {accepted}")
        data = path.read_bytes()
    except FileNotFoundError:
        raise FileNotFoundError(f"forcing.file: no file {str(path)!r}") from None
    except OSError as error:
        raise OSError(f"forcing.file: {str(path)!r} cannot be read ({error})") from None
    if not data.strip():
        raise ValueError(f"forcing.file: {str(path)!r}: got an empty file, accepted: a record")
    if b"\0" in data:
        raise ValueError(f"forcing.file: {str(path)!r}: got binary data, accepted: a text file")
    return data.removeprefix(codecs.BOM_UTF8).decode("latin-1")


# The letter of an exponent may be Fortran's D here, so that what is refused is the number and not a part of it.
_HEADERS = (
    re.compile(r"NPTS\s*=\s*(\d{1,9})\s*,?\s*DT\s*=\s*([-+.\dDE]+)", re.IGNORECASE),
    re.compile(r"^\s*(\d{1,9})\s+([-+.\dDE]+)\s+NPTS\s*,\s*DT", re.IGNORECASE),
)


def _peer(text):
    """Return the interval and the samples (n,) of a PEER file."""
    lines = text.splitlines()
    if len(lines) < 5:
        raise ValueError(f"got {len(lines)} lines, accepted: four of header and the samples")
    if not re.search(r"units\s+of\s+g\b", lines[2], re.IGNORECASE):
        raise ValueError(f"got the third line {lines[2][:80]!r}, accepted: one that says 'UNITS OF G'")
    found = next(filter(None, (header.search(lines[3]) for header in _HEADERS)), None)
    if found is None:
        accepted = "'NPTS= n, DT= seconds' or 'n seconds NPTS, DT'"
        raise ValueError(f"got the fourth line {lines[3][:80]!r}, accepted: {accepted}")
    count = int(found[1])
    interval = _numbers([found[2]])[0]
    if not 0.0 < interval < math.inf:
        raise ValueError(f"got DT = {found[2]}, accepted: a number above 0")
    _accept_count(count)
    words = " ".join(lines[4:]).split()
    if len(words) != count:
        # Numbers that are glued together make the count wrong, and tell more; the last one may be cut.
        _numbers(words[:-1])
        raise ValueError(f"got {len(words)} samples, accepted: the {count} that its fourth line states")
    return float(interval), _numbers(words)


def _columns(text):
    """Return the interval and the samples (n,) of a text of two columns."""
    lines = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    _accept_count(len(lines))
    rows = [line.replace(",", " ").split() for line in lines]
    wrong = next((row for row in rows if len(row) != 2), None)
    if wrong is not None:
        raise ValueError(f"got a line of {len(wrong)} columns, accepted: time in seconds and acceleration")
    times, samples = _numbers([entry for row in rows for entry in row]).reshape(-1, 2).T
    # Times at the ends of double precision may be further apart than that reaches, and the interval is then refused.
    with np.errstate(over="ignore", invalid="ignore"):
        return _interval(times), samples


def _interval(times):
    """Return the interval of times (n,), or refuse them where it is not one."""
    steps = np.diff(times)
    if not (steps > 0.0).all():
        place = int(np.argmax(~(steps > 0.0)))
        raise ValueError(f"got the time {times[place + 1]:g} after {times[place]:g}, accepted: ascending times")
    interval = (times[-1] - times[0]) / (len(times) - 1)
    late = times - (times[0] + interval * np.arange(len(times)))
    place = int(np.argmax(np.abs(late)))
    if abs(late[place]) > _EVEN * interval:
        expected = times[place] - late[place]
        raise ValueError(f"got the time {times[place]:g} for {expected:g}, accepted: equally spaced times")
    return float(interval)


def _accept_count(count):
    if not 2 <= count <= MOST:
        raise ValueError(f"got {count} samples, accepted: 2 to {MOST}")


def _numbers(words):
    """Return words as finite numbers."""
    try:
        values = np.array(words, dtype=float)
    except ValueError:
        values = np.array([_number(word) for word in words])
    # Python reads 1_0 as 10.
    wild = np.flatnonzero(~np.isfinite(values) | np.array(["_" in word for word in words], dtype=bool))
    if wild.size:
        raise ValueError(f"got {words[wild[0]][:40]!r}, accepted: finite numbers")
    return values


def _number(word):
    try:
        return float(word)
    except ValueError:
        return math.nan
