"""Motions of upper floors, each with the motion of the ground that it comes from and whose intensity counts."""

import dataclasses
import functools
import math
from typing import Any, ClassVar, Self

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array
from fpk_rocking.physics.forcing import FORCINGS, Drift, Forcing, Record
from fpk_rocking.physics.forcing.readers.terms import UNITS
from fpk_rocking.physics.forcing.record import same_place
from fpk_rocking.physics.forcing.samples import Samples
from fpk_rocking.risk.spectra import finer, oscillator

PER_PERIOD = 60
"""Samples of a floor's motion in a period of the building: lines between them are off by at most .0014 of the mode."""

_FADED = 1e-3
"""Part of the free vibration after the ground motion at which the motion of a floor ends."""


@dataclasses.dataclass(frozen=True)
class FloorMotion(Record):
    """Motion of a floor, which moves the block. Its intensity is that of the ground motion, which is scaled with it.

    Parameters
    ----------
    interval, samples, units, scale, source, baseline, corner_hz, event, note, vertical
        Those of the floor, see `Record`; scale and baseline hold for the ground too.
    ground : sequence of float
        Accelerations of the ground at the same time, before `scale`.
    ground_interval : float
        Time between them, seconds.
    ground_units : str
        Their unit.
    ground_source, ground_event : str
        Name of their file, and event and station as it states them.
    building : str
        Building from which the floor's motion was computed, see `Building`; empty if it was recorded. Computed samples
        come from a ground motion whose baseline is corrected already.
    """

    kind: ClassVar[str] = "floor"
    ground: tuple[float, ...] = dataclasses.field(default=(), repr=False)
    ground_interval: float = 0.0
    ground_units: str = "m/s2"
    ground_source: str = dataclasses.field(default="", compare=False)
    ground_event: str = dataclasses.field(default="", compare=False)
    building: str = ""

    def __post_init__(self):
        super().__post_init__()
        # The record of the ground checks what it is made of.
        checks.keep(self, ground=Samples.of(self.ground), ground_units=self.ground_record.units)

    @classmethod
    def of(cls, floor: Record, ground: Record, building: str = "") -> Self:
        """Return the motion of a floor with that of its ground; ValueError unless both are corrected and scaled alike.

        Parameters
        ----------
        floor, ground : Record
        building : str
            Building from which the floor's motion was computed.
        """
        for name in ("scale", "baseline", "corner_hz"):
            if getattr(floor, name) != getattr(ground, name):
                accepted = f"{getattr(floor, name)!r}, that of the floor"
                raise ValueError(checks.refusal(f"ground.{name}", getattr(ground, name), accepted))
        fields: dict[str, Any] = {field.name: getattr(floor, field.name) for field in dataclasses.fields(Record)}
        fields |= {"ground": ground.samples, "ground_interval": ground.interval, "ground_units": ground.units}
        return cls(**fields, ground_source=ground.source, ground_event=ground.event, building=building)

    @functools.cached_property
    def ground_record(self) -> Record:
        """Motion of the ground."""
        common: dict[str, Any] = {"scale": self.scale, "baseline": self.baseline, "corner_hz": self.corner_hz}
        common |= {"source": self.ground_source, "event": self.ground_event}
        return Record(self.ground_interval, self.ground, self.ground_units, **common)

    def scaled(self, strength: float, rate: float) -> Self:
        slower = dataclasses.replace(self, ground_interval=self.ground_interval / rate)
        return Record.scaled(slower if self._size is None else slower.for_size(self._size), strength, rate)

    @property
    def corrected_samples(self) -> Array:
        return self._samples.array if self.building else super().corrected_samples

    @property
    def correction(self) -> Drift:
        return self.ground_record.correction

    @property
    def drift(self) -> Drift:
        return self.ground_record.drift if self.building or self.ground_record.drifts else super().drift

    @property
    def drift_source(self) -> str:
        return self.ground_source if self.building or self.ground_record.drifts else self.source

    @property
    def drifts(self) -> bool:
        return self.ground_record.drifts or (not self.building and super().drifts)

    @property
    def implausible(self) -> list[str]:
        sentences = list(self.ground_record.implausible)
        if self.building:
            return sentences
        floor, ground = (
            UNITS[record.units] * np.abs(record.corrected_samples).max() for record in (self, self.ground_record)
        )
        if not 0.1 * ground <= floor <= 20.0 * ground:
            pair = f"The peak of {self.source or 'a floor'} is {floor:.3g} m/s², that of its ground {ground:.3g} m/s²"
            sentences.append(f"{pair} ({self.ground_source}): are units and order of the files right?")
        lasting = [record.interval * (len(record.samples) - 1) for record in (self, self.ground_record)]
        if max(lasting) > 1.1 * min(lasting):
            pair = f"{self.source or 'A floor'} lasts {lasting[0]:.4g} s, its ground, {self.ground_source}, "
            sentences.append(f"{pair}{lasting[1]:.4g} s: is the order of the files right?")
        if not same_place(self.event, self.ground_event):
            said = f"({self.event}; {self.ground_event}): is their order right?"
            files = f"The files of {self.source} and of its ground, {self.ground_source},"
            sentences.append(f"{files} say different events or places {said}")
        return sentences + super().implausible


@dataclasses.dataclass(frozen=True)
class Building:
    """A building that moves in one mode: a floor moves with the ground and Γφ times an oscillator on it.

    Parameters
    ----------
    period : float
        T, seconds.
    damping : float
        Damping ratio, such as .05; at most .5 (isolators with dampers have .3).
    factor : float
        Γφ: participation factor times mode shape at the floor, about 1.3 at the top, 0 on the ground.

    Examples
    --------
    >>> from fpk_rocking.risk import Building, synthetic_records
    >>> floor = Building(period=0.5, damping=0.05, factor=1.3).floor_motion(synthetic_records(1, duration=5.0)[0])
    >>> print(f"{max(map(abs, floor.ground)):.1f} m/s² on the ground, {max(map(abs, floor.samples)):.1f} on the floor")
    2.7 m/s² on the ground, 5.1 on the floor
    """

    period: float
    damping: float
    factor: float

    def __post_init__(self):
        checks.keep_numbers(self, "building", "period", at_least=0.02, at_most=20.0)
        checks.keep_numbers(self, "building", "damping", above=0.0, at_most=0.5)
        checks.keep_numbers(self, "building", "factor", at_least=0.0, at_most=10.0)

    def __str__(self):
        return f"T = {self.period:g} s, ζ = {self.damping:g}, Γφ = {self.factor:g}"

    def floor_motion(self, ground: Record) -> FloorMotion:
        """Return the motion of the floor under a record: exact at its samples, and followed until it has faded.

        The ground acceleration is linear between its samples, and rises from 0 to the first one. The floor has 60
        samples or more in a period, and the engines take lines between them.

        Parameters
        ----------
        ground : Record
        """
        if type(ground) is not Record:
            raise TypeError(checks.refusal("ground", ground, "a Record, of the ground"))
        frequency = 2.0 * math.pi / self.period
        lasts = -math.log(_FADED) / (self.damping * frequency)
        samples, interval = finer(ground.corrected_samples, ground.interval, self.period / PER_PERIOD, lasts)
        mode = oscillator([1.0, 0.0, 0.0], samples, interval, frequency, self.damping)
        moved = tuple((samples - self.factor * mode).tolist())
        floor = dataclasses.replace(ground, interval=interval, samples=moved)
        return FloorMotion.of(floor, ground, building=str(self))


def ground_of(forcing: Forcing) -> Forcing:
    """Return the motion of the ground of a forcing: that below a floor, else itself."""
    return forcing.ground_record if isinstance(forcing, FloorMotion) else forcing


# A file of a result holds scenes as text; whoever reads one with intensities has this module.
FORCINGS[FloorMotion.kind] = FloorMotion
