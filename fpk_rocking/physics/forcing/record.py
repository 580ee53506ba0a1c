"""Forcing by a recorded motion of the base, linear between samples."""

import dataclasses
import functools
import math
import pathlib
import re
from typing import Any, ClassVar, Self, cast

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array, File
from fpk_rocking.physics.forcing.base import RANGES, Size
from fpk_rocking.physics.forcing.readers import reading
from fpk_rocking.physics.forcing.readers.terms import UNITS, divided, is_component, unit_of
from fpk_rocking.physics.forcing.samples import BASELINES, CORNER_HZ, Drift, Samples, corners, corrected, drift_of
from fpk_rocking.physics.forcing.transient import TransientForcing
from fpk_rocking.physics.motion import TERMS

_REMEDY = "A unit is given by units (--units); one that the file states has to be changed in the file."

_UNSIZED = "block.dimensions: missing, required for a forcing of kind 'record', which is in seconds"


_FILLS = 10.0 ** np.arange(3, 10) - 1.0
"""Sizes by which files mark missing samples: 999, 9999, ..."""


@dataclasses.dataclass(frozen=True)
class Record(TransientForcing):
    """Recorded acceleration of the base, linear between equally spaced samples and 0 after the last one.

    A scene with a record needs ``block.dimensions``, from which its time τ = pt and force a/(g θ_cr) follow. The first
    sample is at τ = 0. A `vertical` motion multiplies the weight of the block by 1 + a_v/g.

    Parameters
    ----------
    interval : float
        Time between samples, seconds.
    samples : sequence of float
        Accelerations, 2 to 2^20 of them. A positive value accelerates the base towards negative angles.
    units : {"g", "m/s2", "cm/s2", "mm/s2", "mg", "g/10", "%g", "ft/s2", "in/s2"}
        Unit of the samples; g is 9.80665 m/s². Other spellings, such as "m/s^2" and "gal", become one of these.
    scale : float
        Factor of the samples, and of the vertical ones: both are of one event.
    source, event, note : str
        Name of the file; event, date and station, as far as the file states them; and what else a user should know of
        the record. They do not count when records are compared.
    baseline : {"none", "mean", "linear", "high-pass"}
        Correction of the samples: it removes nothing; their mean; their line of least squares; or that line and the
        frequencies below `corner_hz`. `corrected_samples` are what is left.
    corner_hz : float
        Corner of "high-pass", Hz: Butterworth's filter of order 2 forwards and backwards, so that the amplitude at f is
        multiplied by 1 / (1 + (corner / f)^4), over samples padded with 6 / corner seconds of zeros on either side.
    vertical : Record, optional
        Acceleration of the base upwards at the same times: 0 after its own end, ignored after the end of this record.

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
    baseline: str = "none"
    corner_hz: float = CORNER_HZ
    event: str = dataclasses.field(default="", compare=False)
    note: str = dataclasses.field(default="", compare=False)
    vertical: "Record | None" = None

    _size: ClassVar[Size | None] = None
    time_scale: ClassVar[float] = 2.0
    shortest_period: ClassVar[float] = math.inf

    def __post_init__(self):
        checks.keep_numbers(self, "forcing", "interval", above=0.0)
        checks.keep(self, samples=Samples.of(self.samples), units=_unit(self.units))
        checks.keep_numbers(self, "forcing", "scale")
        checks.keep(self, source=checks.sentence("forcing.source", self.source))
        checks.keep(self, event=checks.sentence("forcing.event", self.event))
        checks.keep(self, note=checks.sentence("forcing.note", self.note))
        checks.keep(self, baseline=check_baseline("forcing.baseline", self.baseline))
        checks.keep_numbers(self, "forcing", "corner_hz", above=0.0)
        low, high = corners(self.interval)
        if self.baseline == "high-pass" and not low <= self.corner_hz <= high:
            accepted = f"from {low:.3g} to {high:.3g} Hz for samples at {self.interval:g} s"
            raise ValueError(checks.refusal("forcing.corner_hz", self.corner_hz, accepted))
        if self.vertical is not None:
            checks.instance("forcing.vertical", self.vertical, Record)
            if self.vertical.vertical is not None:
                raise ValueError(checks.refusal("forcing.vertical.vertical", str(self.vertical.vertical), "nothing"))
            if not math.isclose(self.vertical.interval, self.interval, rel_tol=1e-6):
                accepted = f"{self.interval:g}, as the horizontal motion has"
                raise ValueError(checks.refusal("forcing.vertical.interval", self.vertical.interval, accepted))

    @classmethod
    def from_file(
        cls,
        path: File,
        *,
        units: str | None = None,
        interval: float | None = None,
        component: str | int | None = None,
        scale: float = 1.0,
        baseline: str = "none",
        corner_hz: float = CORNER_HZ,
        where_unstated: bool = False,
        vertical: File | None = None,
        upright: bool = False,
    ) -> Self:
        """Read a record from a file.

        Parameters
        ----------
        path : str or pathlib.Path
            A file of an archive of accelerograms or a text of columns, also in gzip or UTF-16; docs/howto/records.md
            lists the formats. The format is recognized by the content of the file, not by its name.
        units : str, optional
            Unit of the accelerations. Required where the file does not say it.
        interval : float, optional
            Time between samples, seconds. Required where the file does not say it.
        component : str or int, optional
            Name of a component in the file, or its number from 1. Required if several can be read.
        scale, baseline, corner_hz
            See `Record`.
        where_unstated : bool
            Whether `units`, `interval` and `component` count only where the file leaves them open.
        vertical : str or pathlib.Path, optional
            File of the vertical motion, or the same file if it has both. `units` and `interval` hold for it too, if
            it does not state them.
        upright : bool
            Whether the vertical component of the file is the one to read.

        Raises
        ------
        FileNotFoundError
            There is no such file.
        TypeError, ValueError
            A parameter is refused, or the file has no horizontal (or, `upright`, vertical) acceleration, several of
            them, another format, is truncated, or has values that are not finite or times that are not equally spaced;
            the message says what and where.
        """
        file = checks.path("forcing.file", path)
        wanted = None if units is None else _unit(units)
        if interval is not None:
            interval = checks.number("forcing.interval", interval, above=0.0)
        if component is not None and (isinstance(component, bool) or not isinstance(component, str | int)):
            raise TypeError(checks.refusal("forcing.component", component, "a name, or a number from 1"))
        found = reading(file).chosen(component, if_several=where_unstated, upright=upright)
        says, unit, step = f"the file {str(file)!r}", found.unit or wanted, found.interval or interval
        if not where_unstated:
            if wanted and wanted != unit:
                raise ValueError(checks.refusal("forcing.units", units, f"{unit!r}, as {says} says, or nothing"))
            if interval and step and not math.isclose(interval, step, rel_tol=1e-3):
                raise ValueError(checks.refusal("forcing.interval", interval, f"{step:g}, as {says} says, or nothing"))
            step = interval or step
        if not unit or not step:
            accepted = {"units": ", ".join(UNITS)} if not unit else {}
            accepted |= {"interval": "the seconds between two samples"} if not step else {}
            lacks = [f"forcing.{key}: missing, {says} does not say it, accepted: {accepted[key]}" for key in accepted]
            raise ValueError(f"{'; '.join(lacks)} (in a shell --{' and --'.join(accepted)})")
        _refuse_filled(found.values, file)
        values = -found.values if upright and found.downward else found.values
        samples, note = tuple(values.tolist()), " ".join(found.sentences)
        # Where one was chosen, a table of motions says which.
        # A letter such as E stands in many texts.
        said = divided(found.event)[1] if is_component(found.name) else found.name in found.event
        event = ", ".join(filter(None, [found.event, found.name if component is not None and not said else ""]))
        about = {"source": file.name, "event": event, "note": note}
        beside = None
        if vertical is not None:
            beside = cls.from_file(
                vertical,
                units=units,
                interval=interval,
                baseline=baseline,
                corner_hz=corner_hz,
                where_unstated=True,
                upright=True,
            )
        return cls(step, samples, unit, scale=scale, baseline=baseline, corner_hz=corner_hz, vertical=beside, **about)

    @classmethod
    def from_table(cls, name: str, table: dict, folder: File) -> Self:
        """The record of a TOML table: its keys are those of `from_file`, or the parameters of the class."""
        if "file" not in table:
            table = dict(table)
            if "vertical" in table:
                own = dict(checks.table(f"{name}.vertical", table["vertical"]))
                own.pop("kind", None)
                table["vertical"] = cls.from_table(f"{name}.vertical", own, folder)
            return super().from_table(name, table, folder)
        keys = ("file", "units", "interval", "component", "scale", "baseline", "corner_hz", "vertical")
        for key in table:
            if key not in keys:
                raise ValueError(f"{name}.{key}: unknown, accepted beside {name}.file: {', '.join(keys[1:])}")
        files = {
            key: pathlib.Path(folder, checks.path(f"{name}.{key}", table[key]))
            for key in ("file", "vertical")
            if key in table
        }
        return cls.from_file(files.pop("file"), **{key: table[key] for key in table if key != "file"} | files)

    def scaled(self, strength: float, rate: float) -> Self:
        scale, interval, corner_hz = self.scale * strength, self.interval / rate, self.corner_hz * rate
        vertical = self.vertical and self.vertical.scaled(1.0, rate)
        changed = dataclasses.replace(self, scale=scale, interval=interval, corner_hz=corner_hz, vertical=vertical)
        return changed if self._size is None else changed.for_size(self._size)

    def corrected(self, **changes: Any) -> Self:
        """The record with another `baseline` or `corner_hz`, and its vertical motion too."""
        vertical = self.vertical and self.vertical.corrected(**changes)
        return dataclasses.replace(self, **changes, vertical=vertical)

    def check_range(self) -> None:
        """Raise ValueError, by name, for accelerations or times that the engines cannot carry."""
        super().check_range()
        most = RANGES["amplitude"][1]
        if not self.largest <= most:
            accepted = f"accelerations up to {most:g} g θ_cr{checks.ENGINES}"
            raise ValueError(checks.refusal("forcing.scale", self.scale, accepted))
        if not np.abs(self.swaying).max(initial=0.0) <= most:
            raise ValueError(checks.refusal("forcing.scale", self.scale, f"a vertical motion up to {most:g} g"))

    def for_size(self, size: Size | None) -> Self:
        """The record made nondimensional by a block's size; None is a ValueError."""
        if size is None:
            raise ValueError(_UNSIZED)
        if size == self._size:
            return self
        bound = dataclasses.replace(self)
        checks.keep(bound, _size=size)
        return bound

    @property
    def _bound_size(self) -> Size:
        if self._size is None:
            raise ValueError(_UNSIZED)
        return self._size

    @functools.cached_property
    def forces(self) -> Array:
        """Force f (n,) at the samples. What overflows is inf or nan, and refused with all that is too strong."""
        with np.errstate(over="ignore", invalid="ignore"):
            return self._bound_size.amplitude(self.scale * UNITS[self.units] * self.corrected_samples)

    @functools.cached_property
    def swaying(self) -> Array:
        """Vertical acceleration over g at the samples (n,), upwards; (0,) where there is none."""
        if self.vertical is None:
            return np.empty(0)
        count, other = len(self.samples), self.vertical
        samples = np.pad(other.corrected_samples[:count], (0, max(0, count - len(other.samples))))
        with np.errstate(over="ignore", invalid="ignore"):
            return self.scale * other.scale * UNITS[other.units] / self._bound_size.gravity * samples

    @property
    def corrected_samples(self) -> Array:
        """Samples after the correction of the `baseline`, (n,), in their own unit, without the factor `scale`."""

        def compute():
            with np.errstate(over="ignore", invalid="ignore"):
                return corrected(self._samples.array, self.interval, self.baseline, self.corner_hz)

        return self._samples.once(("samples", *self._correction_of), compute)

    @property
    def _samples(self) -> Samples:
        """The samples, which keep what does not depend on `scale`."""
        return cast("Samples", self.samples)

    @property
    def _correction_of(self) -> tuple[float, str, float]:
        return self.interval, self.baseline, self.corner_hz

    @property
    def drift(self) -> Drift:
        """Peaks of `corrected_samples` without `scale`, before and after another correction, "high-pass".

        If the interval does not resolve the corner, the other correction is "linear".
        """

        def compute():
            low, high = corners(self.interval)
            kind = "high-pass" if low <= self.corner_hz <= high else "linear"
            with np.errstate(over="ignore", invalid="ignore"):
                straight = corrected(self.corrected_samples, self.interval, kind, self.corner_hz)
                unit = UNITS[self.units]
                return drift_of(unit * self.corrected_samples, unit * straight, self.interval)

        return self._samples.once(("drift", self.units, *self._correction_of), compute)

    @property
    def correction(self) -> Drift:
        """Peaks of the samples, before and after the correction of the `baseline`; without the factor `scale`."""
        unit = UNITS[self.units]
        with np.errstate(over="ignore", invalid="ignore"):
            return drift_of(unit * self._samples.array, unit * self.corrected_samples, self.interval)

    @property
    def implausible(self) -> list[str]:
        """Sentences on accelerations, velocities and times that are hardly meant, before `scale`."""
        drift, lasts = self.drift, self.interval * (len(self.samples) - 1)
        name, samples = self.source or "the record", self._samples.array
        sentences = [f"{self.source}{': ' * bool(self.source)}{self.note}"] * bool(self.note)
        # The strongest horizontal accelerations of the ground are below 3 g, the fastest velocities about 3 m/s.
        peak = f"The peak acceleration of {name} is {drift.pga:.4g} m/s² ({drift.pga / UNITS['g']:.2g} g)"
        number = drift.pga / UNITS[self.units]
        if 3.0 * UNITS["g"] < drift.pga < math.inf and self.units in ("g", "m/s2"):
            units = ["m/s2"] * (self.units == "g" and number <= 2.0 * UNITS["g"]) + ["cm/s2"]
            texts = (f"in {unit.replace('2', '²')}, with {number * UNITS[unit]:.4g} m/s²" for unit in units)
            ones = f"1 g is {UNITS['g']} m/s² or {100.0 * UNITS['g']} cm/s²"
            sentences.append(f"{peak}. Are its numbers {', or '.join(texts)}? {ones}. {_REMEDY}")
        elif 3.0 * UNITS["g"] < drift.pga < math.inf or 0.0 < drift.pga < 1e-3 * UNITS["g"]:
            counts = f"is its unit {self.units}, or are its numbers, up to {number:.4g}, counts?"
            sentences.append(f"{peak}: {counts} {_REMEDY}")
        elif 5.0 < drift.corrected_pgv < math.inf or lasts > 1800.0:
            sentences.append(
                f"The PGV of {name} is {drift.corrected_pgv:.3g} m/s without drift, and it lasts {lasts:.4g} s: is its "
                f"interval {self.interval:g} s, and its unit {self.units}?"
            )
        if len(samples) >= 100 and samples.any():
            if (samples == np.round(samples)).all() and np.abs(samples).max() >= 1000.0:
                sentences.append(f"The samples of {name} are whole numbers: are they counts of a recorder?")
            if samples.min() >= 0.0 or samples.max() <= 0.0:
                offset = float(samples.mean())
                # The largest of a spectrum are far above its mean; those of an offset record lie around it.
                if abs(offset) <= np.abs(samples - offset).max():
                    sentences.append(f"All samples of {name} have one sign: are they a spectrum, or have an offset?")
                elif self.baseline == "none":
                    level = f"{offset * UNITS[self.units] / UNITS['g']:.2g} g"
                    sentences.append(
                        f"All samples of {name} lie around an offset of {level}, which its PGA contains: take baseline "
                        '= "mean" (--baseline mean), or "high-pass".'
                    )
            sentences += self._spoiled(name)
        return sentences + ([] if self.vertical is None else self._beside(self.vertical))

    def _spoiled(self, name):
        """Sentences on a lone sample far above all others, and on a peak that is held, of the record of a `name`."""

        def compute():
            sizes = np.abs(self._samples.array)
            second, peak = np.partition(sizes, -2)[-2:]
            at = np.flatnonzero(np.diff(np.pad(sizes == peak, 1).astype(int))).reshape(-1, 2)
            beside = np.maximum(*np.pad(sizes, 1)[at + np.arange(2)].T)
            # Beside the flat top of a wave in coarse counts is one that is a count or two lower.
            far = peak - beside > 5.0 * np.diff(np.unique(sizes)).min(initial=peak)
            held = np.count_nonzero((np.diff(at).ravel() >= 3) & far)
            return float(peak), float(second), int(sizes.argmax()), held

        peak, second, place, held = self._samples.once("spoiled", compute)
        unit, sentences = UNITS[self.units] / UNITS["g"], []
        # None of 1,152 components of recorded motions has a second sample below .55 of its peak, or holds its peak so.
        if second < 0.5 * peak:
            sentences.append(
                f"One sample of {name}, at {self.interval * place:.4g} s, has {unit * peak:.3g} g, all others at most "
                f"{unit * second:.3g} g: is it an error of the recorder?"
            )
        if held >= 2:
            sentences.append(
                f"The peak of {name}, {unit * peak:.3g} g, is held for 3 samples or more at {held} places: are its "
                "peaks cut off?"
            )
        return sentences

    def _beside(self, vertical):
        """Sentences on a vertical motion that is hardly meant, or hardly of the same place."""
        if same_place(self.event, vertical.event):
            return vertical.implausible
        said = f"{vertical.source} and {self.source} state different places: {vertical.event}; {self.event}."
        return [*vertical.implausible, said]

    @property
    def drift_source(self) -> str:
        """Source of the samples that `drift` is of."""
        return self.source

    @property
    def drifts(self) -> bool:
        """Whether the base's velocity is that of a drift, see `Drift`, and does not end near 0.

        False for a record shorter than .2 / `corner_hz` (2 s by default): too short to tell.
        """
        # A fifth of a period of the corner: 2 s, whatever the record's times were divided by.
        lasts = self.interval * (len(self.samples) - 1) * self.corner_hz >= 0.2
        # Of samples as they are; a mean or a line that is removed takes the velocity to 0 at the end.
        rests = self.baseline == "none" and abs(self.drift.end_velocity) < 0.1 * self.drift.corrected_pgv
        return lasts and self.baseline != "high-pass" and not rests and self.drift.drifts

    @functools.cached_property
    def unit(self) -> float:
        return self._bound_size.tau(self.interval)

    @property
    def duration(self) -> float:
        return self.unit * (len(self.samples) - 1)

    @functools.cached_property
    def largest(self) -> float:
        return float(np.abs(self.forces).max())

    @functools.cached_property
    def steepest(self) -> float:
        return float(np.abs(np.diff(self.forces)).max()) / self.unit

    def series(self, times: Array) -> Array:
        return self._pieces(self.forces, np.asarray(times), TERMS)

    def weights(self, spacing: float, count: int) -> Array:
        if self.vertical is None:
            return super().weights(spacing, count)
        rows = self._pieces(self.swaying, spacing * np.arange(count), 3)
        begin, slope = rows[:, 0], rows[:, 1]
        rows[:, 2] = np.maximum(np.abs(begin), np.abs(begin + spacing * slope))
        rows[:, 0] += 1.0
        return rows

    def weight(self, times: Array) -> Array:
        if self.vertical is None:
            return super().weight(times)
        return 1.0 + self._pieces(self.swaying, times, 2)[:, 0]

    def _pieces(self, samples, times, terms):
        """Value and slope at times (n,) of what is linear between `samples`, 0 from the last one on, in (n, terms)."""
        out = np.zeros((len(times), terms))
        place = np.floor(times / self.unit + 1e-9).astype(np.int64)
        on = (place >= 0) & (place < len(samples) - 1)
        k = place[on]
        slope = (samples[k + 1] - samples[k]) / self.unit
        out[on, 0], out[on, 1] = samples[k] + slope * (times[on] - k * self.unit), slope
        return out

    def lifting(self, level: float) -> float:
        if self.vertical is None:
            return super().lifting(level)
        return float((np.abs(self.forces) / level - self.swaying).max())

    def weightless(self, most: float) -> float:
        """Seconds at which the motion times a factor up to `most` first leaves a block no weight; nan where never."""
        places = np.flatnonzero(1.0 + most * self.swaying <= 0.0)
        return float(self.interval * places[0]) if places.size else math.nan

    def __str__(self):
        name = self.source or "a record"
        beside = "" if self.vertical is None else f" with {self.vertical.source or 'a vertical motion'}"
        return f"{name}{beside}, {len(self.samples)} samples of {self.interval:g} s, {self.scale:g} times"


def same_place(one: str, other: str) -> bool:
    """Whether two texts `event` of a `Record` may be of one event and station; an empty one may be of any."""
    (first, name), (second, beside) = divided(one), divided(other)
    # A last word may name a component in a way that is not known.
    stems = [text if known else re.sub(r"\W*\w+\W*$", "", text) for text, known in ((first, name), (second, beside))]
    return first.startswith(stems[1]) or second.startswith(stems[0])


def check_baseline(name: str, value: str) -> str:
    """`value`, if it is one of `BASELINES`; else TypeError or ValueError."""
    if not isinstance(value, str) or value not in BASELINES:
        kind = ValueError if isinstance(value, str) else TypeError
        raise kind(checks.refusal(name, value, " or ".join(map(repr, BASELINES))))
    return value


def _refuse_filled(values, file):
    """Raise ValueError for samples (n,) of a `file` of which some are 999, -9999 and the like, 50 times all others."""
    sizes = np.abs(values)
    filled = np.isin(sizes, _FILLS) & (sizes > 50.0 * np.max(sizes, where=~np.isin(sizes, _FILLS), initial=0.0))
    if filled.any():
        place = int(filled.argmax())
        got = f"got {values[place]:g} as sample {place + 1} of the file {str(file)!r}"
        raise ValueError(f"forcing.samples: {got}, which may stand for a missing one, accepted: a file without such")


def _unit(text):
    """Key of `UNITS` that a text means; else TypeError or ValueError."""
    if not isinstance(text, str):
        raise TypeError(checks.refusal("forcing.units", text, " or ".join(map(repr, UNITS))))
    units = unit_of(text)
    if units is None:
        raise ValueError(checks.refusal("forcing.units", text, " or ".join(map(repr, UNITS))))
    return units
