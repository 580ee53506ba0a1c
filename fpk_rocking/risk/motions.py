"""Motions of a study: records under which a scene is placed, how strong each is, and its name."""

import dataclasses
import math
import re
import warnings
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array, File
from fpk_rocking.physics.forcing import Forcing, PeriodicForcing, Record
from fpk_rocking.physics.forcing.readers.terms import azimuth, divided, unit_of
from fpk_rocking.physics.forcing.record import check_baseline
from fpk_rocking.results.remarks import drifting
from fpk_rocking.results.trust import CAUTION, Diagnostic
from fpk_rocking.risk.floors import Building, FloorMotion, ground_of
from fpk_rocking.risk.spectra import PERIODS, narrowness, response_spectrum
from fpk_rocking.scene.scene import Scene, under_motion
from fpk_rocking.scene.units import STANDARD_GRAVITY
from fpk_rocking.studies.scenes import scaled


class Intensities(NamedTuple):
    """Intensity measures of the forcing of a scene, without its noise; of a `FloorMotion` those of the ground.

    Parameters
    ----------
    acceleration : float
        Largest |f|: the peak ground acceleration over g θ_cr.
    velocity : float
        Largest |∫f dτ|: the peak ground velocity over g θ_cr / p.
    pga, pgv : float
        Peak ground acceleration, m/s², and velocity, m/s; nan for a block without dimensions.
    relative_velocity : float
        p PGV / (g tan θ_cr) (E. G. Dimitrakopoulos, T. S. Paraskeva, "Dimensionless fragility curves for rocking
        response to near-fault excitations", Earthquake Eng. Struct. Dyn. 44(12), 2015-2033, 2015). A block without
        dimensions counts as slender, tan θ_cr = θ_cr.
    """

    acceleration: float
    velocity: float
    pga: float
    pgv: float
    relative_velocity: float

    def columns(self, scale: float) -> dict[str, float]:
        """Return the measures times `scale`, a factor of the forcing, as floats by name, for tables."""
        return {
            "acceleration": scale * self.acceleration,
            "velocity": scale * self.velocity,
            "pga_g": scale * self.pga / STANDARD_GRAVITY,
            "pgv_m_per_s": scale * self.pgv,
            "relative_velocity": scale * self.relative_velocity,
        }

    def at(self, scale: float) -> str:
        """Return a text, "PGA 0.3 g, PGV 0.3 m/s", at a `scale` of the forcing; empty for a block without a size."""
        peaks = {"PGA {:.4g} g": self.pga / STANDARD_GRAVITY, "PGV {:.4g} m/s": self.pgv}
        return ", ".join(text.format(scale * value) for text, value in peaks.items() if math.isfinite(value))


def intensities(scene: Scene) -> Intensities:
    """Return the named tuple `Intensities` of a scene's forcing, with a warning where the velocity is that of a drift.

    The ground velocity of a periodic forcing has mean 0; that of a pulse or a record is 0 at τ = 0.

    Parameters
    ----------
    scene : Scene
        Its forcing is measured; block dimensions give the measures with units.

    Returns
    -------
    Intensities
        Nondimensional measures, and `pga`, m/s², and `pgv`, m/s.

    Examples
    --------
    >>> from fpk_rocking import Scene
    >>> from fpk_rocking.risk import intensities
    >>> motion = intensities(Scene.from_block(0.5, 1.8, "0.3 g", "1.5 Hz"))
    >>> print(f"PGA {motion.pga:.2f} m/s², PGV {motion.pgv:.2f} m/s")
    PGA 2.94 m/s², PGV 0.31 m/s
    """
    checks.instance("scene", scene, Scene)
    for diagnostic in drifting(scene.forcing):
        warnings.warn(diagnostic.message, stacklevel=2)
    return measured(scene)


def measured(scene: Scene) -> Intensities:
    """Return the named tuple `Intensities` of a scene's forcing without a warning, for results that have a verdict."""
    size = scene.block.size
    return _peaks(size, ground_of(scene.forcing).for_size(size))


def _peaks(size, forcing):
    """`Intensities` of a forcing for the size of a block."""
    acceleration, velocity = forcing.largest, forcing.largest_velocity
    if size is None:
        return Intensities(acceleration, velocity, math.nan, math.nan, velocity)
    unit = size.gravity * size.critical_angle
    pgv = velocity * unit / size.frequency_parameter
    relative = velocity * size.critical_angle / math.tan(size.critical_angle)
    return Intensities(acceleration, velocity, acceleration * unit, pgv, relative)


class Measure(NamedTuple):
    """An intensity of the motion: its name, that in `Intensities`, its unit, that in SI, and the T of Sa(T), s."""

    name: str
    field: str
    unit: str
    si: float
    period: float = math.nan


MEASURES = {
    "PGA": Measure("PGA", "pga", "g", STANDARD_GRAVITY),
    "PGV": Measure("PGV", "pgv", "m/s", 1.0),
    "PFA": Measure("PFA", "pga", "g", STANDARD_GRAVITY),
    "PFV": Measure("PFV", "pgv", "m/s", 1.0),
    "PGV*": Measure("PGV*", "relative_velocity", "", 1.0),
}
"""Intensities that a curve may be for beside Sa(T): peaks of the ground and of the floor, p PGV/(g tan θ_cr)."""

SPECTRAL = r"p?sa ?\((?:t ?= ?)?(\d+\.?\d*|\.\d+) ?s?\)"
"""Regular expression of Sa(T) in small letters, with T in seconds."""

FLOOR = "PFA", "PFV"
"""Those of the motion that the block sees, on whatever floor; all others are of the ground."""


def measure_of(name: str, what: str = "measure") -> Measure:
    """Return the `Measure` of a name, as "PGA" or "Sa(1.0)", OpenQuake's "SA(1.0)" too; ValueError for another one."""
    text = str(name).strip()
    spectral = re.fullmatch(SPECTRAL, text.lower())
    if spectral and PERIODS[0] <= float(spectral[1]) <= PERIODS[1]:
        return Measure(f"Sa({float(spectral[1])!r})", "", "g", STANDARD_GRAVITY, float(spectral[1]))
    if name not in MEASURES:
        periods = "{:g} to {:g}".format(*PERIODS)
        accepted = f"{', '.join(map(repr, MEASURES))}, or 'Sa(T)' with a period of {periods} s"
        accepted += f"; did you mean {text.upper()}?" * (text.upper() in MEASURES)
        raise ValueError(checks.refusal(what, name, accepted))
    return MEASURES[name]


def intensity_of(scene: Scene, measure: str) -> float:
    """Return an intensity of a scene's forcing, in the unit of the `measure`: of the ground, or for `FLOOR` its own."""
    chosen = measure_of(measure)
    forcing = checks.instance("scene", scene, Scene).forcing
    motion = (forcing if chosen.name in FLOOR else ground_of(forcing)).for_size(scene.block.size)
    if chosen.field:
        peak = getattr(_peaks(scene.block.size, motion), chosen.field) / chosen.si
    elif isinstance(motion, Record):
        peak = response_spectrum(motion, [chosen.period])[0] / chosen.si
    else:
        raise ValueError(checks.refusal("measure", measure, "PGA or PGV of a motion that is no record"))
    if not peak > 0.0:
        why = "a scene of a block with dimensions and a forcing that is not 0"
        raise ValueError(checks.refusal("scene", scene, why))
    return float(peak)


def at_intensity(scene: Scene, measure: str = "PGV", value: float = 1.0, *, noise: bool = True) -> Scene:
    """Return a scene whose forcing is scaled to an intensity.

    With the default value, 1, the scales of `fpk_rocking.risk.fragility` are then the intensities (stripes).

    Parameters
    ----------
    scene : Scene
        Scene of a block with dimensions.
    measure : str
        "PGA" (in g), "PGV" (in m/s), "Sa(1.0)" (5 % damped pseudo-acceleration at 1 s, in g) or "PGV*"
        (p PGV/(g tan θ_cr)), of the forcing without the noise, for a block on a floor of the ground motion; "PFA" (in
        g) or "PFV" (in m/s), of the motion below the block.
    value : float
        Intensity, in its unit, above 0.
    noise : bool
        Whether the noise is scaled too.

    Returns
    -------
    Scene

    Raises
    ------
    ValueError
        The measure is unknown, the block has no dimensions, or the forcing is 0.

    Examples
    --------
    >>> from fpk_rocking import Scene
    >>> from fpk_rocking.risk import at_intensity
    >>> from fpk_rocking.risk import intensities
    >>> rack = Scene.from_block(0.5, 1.8, "0.3 g", "1.5 Hz")
    >>> print(f"{intensities(at_intensity(rack, 'PGV', 0.5)).pgv:.2f} m/s")
    0.50 m/s
    """
    value = checks.number("value", value, above=0.0)
    return scaled(scene, value / intensity_of(scene, measure), noise=noise)


def recorded_scenes(
    scene: Scene,
    records: Sequence[Forcing | File],
    *,
    units: str | None = None,
    interval: float | None = None,
    component: str | int | None = None,
    baseline: str | None = None,
    corner_hz: float | None = None,
    ground: Sequence[Record | File] = (),
    building: Building | None = None,
    vertical: Sequence[Record | File] = (),
) -> list[Scene]:
    """Return a scene under each of several motions, with the default number of harmonics for each where it has one."""
    for name, beside in (("vertical", vertical), ("ground", ground)):
        _check_beside(name, beside, records, building)
    given, lists = (*records, *ground), {"records": records, "ground": ground, "vertical": vertical}
    files = [(name, motion) for name, of in lists.items() for motion in of if not isinstance(motion, Forcing)]
    read = _read(files, units, interval, component)
    motions = [motion if isinstance(motion, Forcing) else read[str(motion), False] for motion in given]
    for place, motion in enumerate(vertical):
        upward = motion if isinstance(motion, Forcing) else read[str(motion), True]
        motions[place] = dataclasses.replace(checks.instance("records", motions[place], Record), vertical=upward)
    motions = motions or [scene.forcing]
    asked: dict[str, Any] = {"baseline": baseline, "corner_hz": corner_hz}
    changes = {name: value for name, value in asked.items() if value is not None}
    if changes:
        if baseline is not None:
            check_baseline("baseline", baseline)
        if {type(motion) for motion in motions} & {Record, FloorMotion} != {Record}:
            name, value = next(iter(changes.items()))
            raise ValueError(checks.refusal(name, value, "nothing where there is no record"))
        motions = [motion.corrected(**changes) if type(motion) is Record else motion for motion in motions]
        if corner_hz is not None and all(getattr(motion, "baseline", "") != "high-pass" for motion in motions):
            raise ValueError(checks.refusal("corner_hz", corner_hz, 'nothing without the baseline "high-pass"'))
    if ground:
        pairs: Any = zip(motions[: len(records)], motions[len(records) :], strict=True)
        motions = [FloorMotion.of(floor, below) for floor, below in pairs]
    if building is not None:
        motions = [checks.instance("building", building, Building).floor_motion(motion) for motion in motions]
    return [under_motion(scene, motion) for motion in motions]


def unused_forcing_text(scene: Scene, records: Sequence[Any], shaken: Sequence[Scene]) -> str:
    """Return a sentence, that `records`, if any, replace the forcing of a scene; empty where it is 0 or one of them.

    `shaken`: the scene under each of the records.
    """
    own = scene.forcing
    if not len(records) or not own.largest > 0.0 or own in [*records, *(one.forcing for one in shaken)]:
        return ""
    return f"The forcing of the scene ({own.kind}: {own}) is not used: the records replace it."


def _check_beside(name, motions, records, building):
    """ValueError for motions beside records, as `name` says, that are not one for each, or beside a building."""
    if motions and building is not None:
        raise ValueError(checks.refusal("building", str(building), f"no building beside {name} (--{name})"))
    if motions and len(motions) != len(records):
        got = f"{len(motions)} motion{'s' * (len(motions) > 1)}"
        raise ValueError(checks.refusal(name, got, f"{len(records)}, one for each record in the same order"))


def _read(files, units, interval, component):
    """Records of files, with the names of their lists, by name and whether it is a vertical one.

    ValueError lists all files that are refused.
    """
    stated: dict[str, Any] = {"units": units, "interval": interval, "where_unstated": True}
    for name, value in {"units": units, "interval": interval, "component": component}.items():
        if value is not None and not files:
            raise ValueError(checks.refusal(name, value, "nothing where no motion is the name of a file"))
    read, refused = {}, []
    for name, file in files:
        which = {"upright": True} if name == "vertical" else {"component": component}
        try:
            read[str(file), name == "vertical"] = Record.from_file(file, **stated, **which)
        except (ValueError, OSError) as error:
            text = re.sub("^forcing.file: ", f"{name}: ", str(error))
            refused.append(OSError(text) if isinstance(error, OSError) else ValueError(text))
    if len(refused) > 1:
        listed = f"(a line for each: fpk-rocking records): {'; '.join(map(str, refused))}"
        raise ValueError(f"records: {len(refused)} of {len(files)} files are refused {listed}")
    if refused:
        raise refused[0]
    said = dict.fromkeys(record.units for record in read.values())
    if read and units is not None and unit_of(units) not in said:
        accepted = f"nothing, as all files say their unit ({', '.join(said)})"
        raise ValueError(checks.refusal("units", units, accepted))
    if read and interval is not None and interval not in [record.interval for record in read.values()]:
        raise ValueError(checks.refusal("interval", interval, "nothing, as all files say their interval"))
    return read


NARROW = 0.62
"""`narrowness` above which a record looks like that of a floor: no far-field record of FEMA P-695 has more, 6 of 238
motions of a shake table, and nine in ten of floors that were computed (docs/benchmarks/upper_floors.json)."""


def floor_diagnostics(scenes: Sequence[Scene], measure: str) -> list[Diagnostic]:
    """Return a list with a `Diagnostic` if half of the motions look like those of floors and count as of the ground."""
    records = {id(scene.forcing.samples): scene.forcing for scene in scenes if type(scene.forcing) is Record}
    narrow = sum(narrowness(record) > NARROW for record in records.values())
    if measure in (*FLOOR, "scale") or not narrow or 2 * narrow < len(records):
        return []
    sentence = (
        f"{narrow} of {len(records)} motions have one narrow peak in their spectrum, as on an upper floor (or on soft "
        f"soil). A hazard curve is for the {measure} of the ground, not of a floor: give the motions of the ground too "
        "(--ground), or take motions of the ground and the building (--building)."
    )
    return [Diagnostic(CAUTION, sentence, "floor")]


def motion_table(scenes: Sequence[Scene]) -> dict[str, Array]:
    """Return columns by name, with a row for the motion of each scene at its own scale; on floors with their PFA."""
    measures = [measured(scene).columns(1.0) for scene in scenes]
    columns = {name: np.array([row[name] for row in measures]) for name in ("pga_g", "pgv_m_per_s")}
    if any(isinstance(scene.forcing, FloorMotion) for scene in scenes):
        columns["pfa_g"] = np.array([intensity_of(scene, "PFA") for scene in scenes])
    if any(scene.forcing.vertical is not None for scene in scenes):
        columns["vertical"] = np.array([getattr(scene.forcing.vertical, "source", "") for scene in scenes])
        columns["vertical_pga_g"] = np.array([_vertical_peak(scene) for scene in scenes])
    return {"motion": np.array(motion_names(scenes))} | columns


def _vertical_peak(scene):
    """Peak vertical acceleration of the base of a scene, g; 0 where it does not move vertically."""
    if scene.forcing.vertical is None:
        return 0.0
    return np.abs(scene.forcing.swaying).max() * scene.block.size.gravity / STANDARD_GRAVITY


def motion_lines(table: Mapping[str, Array], measure: str, *, at_one: bool = False) -> list[str]:
    """Return a line of text for each motion of a `motion_table`."""
    lines = []
    unit = "" if measure == "scale" else f" {measure_of(measure).unit}"
    for place, name in enumerate(table["motion"]):
        row = {column: values[place] for column, values in table.items()}
        peaks = {"PGA {:.3g} g": row["pga_g"], "PGV {:.3g} m/s": row["pgv_m_per_s"]}
        peaks["on the floor {:.3g} g"] = row.get("pfa_g", math.nan)
        peaks["vertical PGA {:.3g} g"] = row.get("vertical_pga_g", math.nan)
        if measure not in ("PGA", "PGV", "PFA", "scale"):
            peaks[f"{measure} {{:.3g}}{unit}"] = row.get("own_intensity", math.nan)
        texts = [form.format(value) for form, value in peaks.items() if math.isfinite(value)]
        if "critical_scale" in row:
            time = f"τ = {row['overturn_time']:.4g}" if math.isnan(row["overturn_s"]) else f"{row['overturn_s']:.4g} s"
            turned = f"overturns to the {row['overturn_side']} at {time}"
            texts.append(turned if row["overturn_side"] else f"peak rotation {row['peak_rotation']:.3g} θ_cr")
            critical = f"critical at {measure} {row['critical_intensity']:.4g}{unit}"
            critical += "" if at_one else f", {row['critical_scale']:.3g} times its own strength"
            again = row["always_intensity"] / row["critical_intensity"] if math.isfinite(row["critical_scale"]) else 1.0
            if math.isinf(again):
                critical += ", stands again at the end of the search"
            elif again > 1.01:
                critical += f", always from {row['always_intensity']:.4g}"
            texts.append(critical if math.isfinite(row["critical_scale"]) else "stands up to the end of the search")
        begin = ("at scale 1 " if measure == "scale" else f"scaled to {measure} 1{unit}: " * at_one) * bool(texts)
        lines.append(f"{name}: {begin}{', '.join(texts) or 'no size, no units'}.")
    return lines


def same_event(scenes: Sequence[Scene]) -> list[int]:
    """Return a number for the event of each scene's motion: one for two components of which files say the same event.

    Components that they say have to differ. Three or more of one text stay apart: it may be a general one. Equal
    motions have one number, whatever their files say, but for shaking that repeats.
    """
    motions = [n if isinstance(scene.forcing, PeriodicForcing) else scene.forcing for n, scene in enumerate(scenes)]
    first: dict[Any, int] = {}
    places = [first.setdefault(motion, n) for n, motion in enumerate(motions)]
    unique = list(first.values())
    numbers = _same_text([getattr(scenes[n].forcing, "event", "") for n in unique])
    events = dict(zip(unique, (unique[number] for number in numbers), strict=True))
    return [events[place] for place in places]


def _same_text(events):
    """Return a number for each of some texts, the place of the first that may be of the same event and station."""
    said = [divided(event) for event in events]
    texts, names = ([pair[part] for pair in said] for part in (0, 1))
    labels = list(range(len(texts)))
    for text in filter(None, dict.fromkeys(texts)):
        places = [place for place, other in enumerate(texts) if other == text]
        turns = {_direction(names[place]) for place in places}
        # Two of one direction are of two stations.
        if len(places) == 2 and (turns == {""} or (len(turns) == 2 and "" not in turns)):
            labels[places[1]] = places[0]
    return labels


def _direction(name):
    """Azimuth in [0, 360) that a component's name says, else the name in capitals."""
    turn = azimuth(name)
    return name.upper() if turn is None else turn % 360.0


def motion_names(scenes: Sequence[Scene]) -> list[str]:
    """Return a list of the names of the motions of scenes: the source of a record, else what the forcing is."""
    names = [getattr(scene.forcing, "source", "") or str(scene.forcing) for scene in scenes]
    count = dict.fromkeys(names, 0)
    for place, name in enumerate(names):
        count[name] += 1
        names[place] = name if names.count(name) == 1 and count[name] == 1 else f"{name} ({count[name]})"
    return names
