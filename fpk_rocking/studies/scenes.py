"""Scenes of a study: scaled shaking, blocks of another size, grids over parameters, and how strong a motion is.

All of it is a change of the scene's numbers. A base acceleration a enters as a/(g θ_cr) and a frequency as ω/p
(docs/theory.md, section 1), so a block of another size has other numbers under the same shaking.
"""

import dataclasses
import itertools
import math
import warnings
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from fpk_rocking.base import checks
from fpk_rocking.base.types import Array, ArrayLike, File
from fpk_rocking.physics.forcing import Forcing, Record
from fpk_rocking.physics.forcing.files import unit_of
from fpk_rocking.physics.forcing.record import check_baseline
from fpk_rocking.results.remarks import drifting
from fpk_rocking.scene.parts import Block, Start
from fpk_rocking.scene.scene import Scene
from fpk_rocking.scene.units import STANDARD_GRAVITY, Dimensions


class Grid(NamedTuple):
    """Scenes of all combinations of some parameters, as `grid` returns them.

    Parameters
    ----------
    scenes : tuple of Scene
        In the order of the combinations, the last axis changing fastest.
    axes : dict of str to tuple of float
        Values of each parameter by its name.

    Examples
    --------
    >>> from fpk_rocking import load_scene
    >>> from fpk_rocking.studies import grid
    >>> cells = grid(load_scene("main"), {"forcing.amplitude": [4.2, 4.6], "noise.variance": [0.01, 0.04]})
    >>> print(len(cells.scenes), cells.scenes[1].noise.variance, cells.axes["noise.variance"])
    4 0.04 (0.01, 0.04)
    """

    scenes: tuple[Scene, ...]
    axes: dict[str, tuple[float, ...]]

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values of each parameter."""
        return tuple(len(values) for values in self.axes.values())

    def parameters(self, number: int) -> dict[str, float]:
        """Return the values of the parameters of one scene, by name.

        Parameters
        ----------
        number : int
            Place of the scene in `scenes`, from 0.

        Returns
        -------
        dict of str to float
        """
        values = next(itertools.islice(itertools.product(*self.axes.values()), number, None))
        return dict(zip(self.axes, values, strict=True))


def grid(scene: Scene, axes: Mapping[str, ArrayLike]) -> Grid:
    """Return the scenes of all combinations of some parameters.

    Parameters
    ----------
    scene : Scene
        Scene that is changed.
    axes : dict of str to sequence of float
        Values of each parameter by its name, as `varied` takes it. The parameters are set in this order.

    Returns
    -------
    Grid

    Raises
    ------
    TypeError, ValueError
        A name or a value is refused.

    Examples
    --------
    >>> from fpk_rocking import load_scene
    >>> from fpk_rocking.studies import grid
    >>> cells = grid(load_scene("main"), {"forcing.amplitude": [4.2, 4.6], "noise.variance": [0.01, 0.04]})
    >>> print(cells.shape, cells.parameters(2))
    (2, 2) {'forcing.amplitude': 4.6, 'noise.variance': 0.01}
    """
    checks.instance("scene", scene, Scene)
    if not isinstance(axes, dict) or not axes:
        raise TypeError(checks.refusal("axes", axes, 'a dict such as {"forcing.amplitude": [3.0, 4.0]}'))
    lists = {name: checks.several(f"axes[{name!r}]", values, most=100_000) for name, values in axes.items()}
    scenes = [scene]
    for name, values in lists.items():
        scenes = [varied(changed, name, value) for changed in scenes for value in values]
    return Grid(tuple(scenes), lists)


def varied(scene: Scene, name: str, value: float) -> Scene:
    """Return a scene with one parameter changed.

    Parameters
    ----------
    scene : Scene
        Scene that is changed.
    name : str
        A dotted name of a scene file, such as "noise.variance"; "scale", a factor of forcing and noise (`scaled`); or,
        for another block under the same shaking (`resized`), "width", "height" or "size" (the half diagonal R), all in
        metres, or "slenderness" (height over width at the same R).
    value : float
        New value of the parameter.

    Returns
    -------
    Scene

    Raises
    ------
    TypeError, ValueError
        The name is unknown, or the value is refused.

    Examples
    --------
    >>> from fpk_rocking import Scene
    >>> from fpk_rocking.studies.scenes import varied
    >>> rack = varied(Scene.from_block(0.5, 1.8, "0.3 g", "1.5 Hz"), "height", 2.4)
    >>> print(rack.block.dimensions.height, f"{rack.block.critical_angle:.3f}")
    2.4 0.205
    """
    part, _, field = str(name).partition(".")
    if name == "scale":
        return scaled(scene, value)
    sizes = "width", "height", "size", "slenderness"
    if name in sizes:
        size = dimensions_of(scene, name)
        value = checks.number(name, value, above=0.0)
        if name in {"width", "height"}:
            return resized(scene, **{name: value})
        radius, slenderness = size.half_diagonal, size.height / size.width
        radius, slenderness = (value, slenderness) if name == "size" else (radius, value)
        width = 2.0 * radius / math.hypot(1.0, slenderness)
        return resized(scene, width=width, height=slenderness * width)
    if part not in {"block", "forcing", "noise", "start", "overturning"} or not field:
        accepted = f"a dotted name of a scene file such as 'forcing.amplitude', 'scale', {', '.join(map(repr, sizes))}"
        raise ValueError(checks.refusal("parameter", name, accepted))
    integer = isinstance(getattr(getattr(scene, part), field, None), int) and float(value).is_integer()
    return scene.varied(**{part: {field: int(value) if integer else value}})


def scaled(scene: Scene, factor: float, *, noise: bool = True) -> Scene:
    """Return a scene with the acceleration of the base multiplied by a factor.

    Parameters
    ----------
    scene : Scene
        Scene that is changed.
    factor : float
        Factor of the forcing, above 0.
    noise : bool
        Whether the noise is multiplied too: its variance, or diffusion, by the square of the factor.

    Returns
    -------
    Scene

    Examples
    --------
    >>> from fpk_rocking import load_scene
    >>> from fpk_rocking.studies import scaled
    >>> strong = scaled(load_scene("main"), 2.0)
    >>> print(strong.forcing.amplitude, round(strong.noise.variance, 2))
    9.2 0.16
    """
    factor = checks.number("factor", factor, above=0.0)
    shaken = scene.noise.scaled(factor, 1.0) if noise else scene.noise
    return dataclasses.replace(scene, forcing=scene.forcing.scaled(factor, 1.0), noise=shaken)


def resized(scene: Scene, *, width: float | None = None, height: float | None = None) -> Scene:
    """Return the scene of a block of another size under the same shaking in m/s² and Hz.

    The start keeps its radians and seconds, the overturning angle its value in units of θ_cr. A restitution that was
    Housner's for the old block becomes Housner's for the new one; any other is kept.

    Parameters
    ----------
    scene : Scene
        Scene of a block with dimensions.
    width, height : float, optional
        New full width and height, metres; one that is left out is kept.

    Returns
    -------
    Scene

    Examples
    --------
    >>> from fpk_rocking import Scene
    >>> from fpk_rocking.studies import intensities, resized
    >>> rack = Scene.from_block(0.5, 1.8, "0.3 g", "1.5 Hz")
    >>> tall = resized(rack, height=2.4)
    >>> print(f"{rack.forcing.amplitude:.3f} {tall.forcing.amplitude:.3f}, PGA {intensities(tall).pga:.2f} m/s²")
    1.107 1.461, PGA 2.94 m/s²
    """
    old = dimensions_of(scene, "width" if width is not None else "height")
    new = Dimensions(old.width if width is None else width, old.height if height is None else height, old.gravity)
    angle = old.critical_angle / new.critical_angle
    rate = old.frequency_parameter / new.frequency_parameter
    own = scene.block.restitution
    housner = old.width <= math.sqrt(2.0) * old.height and own == old.restitution
    start = scene.start
    covariance = start.covariance
    if covariance is not None:
        (xx, xv), (_, vv) = covariance
        xv *= angle**2 * rate
        covariance = (xx * angle**2, xv), (xv, vv * (angle * rate) ** 2)
    # What is in seconds takes the size of the scene's block by itself.
    forcing = scene.forcing
    return dataclasses.replace(
        scene,
        block=Block(new.restitution if housner else own, new, slender=scene.block.slender),
        forcing=forcing if forcing.dimensional else forcing.scaled(angle, rate),
        noise=scene.noise.scaled(angle, rate),
        start=Start(start.angle * angle, start.velocity * angle * rate, covariance),
    )


def dimensions_of(scene: Scene, name: str) -> Dimensions:
    """Return the dimensions of a scene's block, or refuse a parameter that needs them."""
    if scene.block.dimensions is None:
        raise ValueError(
            checks.refusal(
                "parameter", name, "only where the scene has [block.dimensions], a rectangle; this one has none"
            )
        )
    return scene.block.dimensions


class Intensities(NamedTuple):
    """Intensity measures of the forcing of a scene, without its noise.

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

    Examples
    --------
    >>> from fpk_rocking import load_scene
    >>> from fpk_rocking.studies import intensities
    >>> motion = intensities(load_scene("main"))
    >>> print(motion.acceleration, f"{motion.velocity:.3f}", motion.pga)
    4.6 1.704 nan
    """

    acceleration: float
    velocity: float
    pga: float
    pgv: float
    relative_velocity: float

    def columns(self, scale: float) -> dict[str, float]:
        """Return the measures at a scale by names that say their units, for tables."""
        return {
            "acceleration": scale * self.acceleration,
            "velocity": scale * self.velocity,
            "pga_g": scale * self.pga / STANDARD_GRAVITY,
            "pgv_m_per_s": scale * self.pgv,
            "relative_velocity": scale * self.relative_velocity,
        }

    def at(self, scale: float) -> str:
        """Return peak acceleration and velocity at a scale as a text; empty for a block without dimensions."""
        peaks = {"PGA {:.4g} g": self.pga / STANDARD_GRAVITY, "PGV {:.4g} m/s": self.pgv}
        return ", ".join(text.format(scale * value) for text, value in peaks.items() if math.isfinite(value))


def intensities(scene: Scene) -> Intensities:
    """Return the intensity measures of a scene's forcing, with a warning where the velocity is that of a drift.

    The ground velocity of a periodic forcing has mean 0; that of a pulse or a record is 0 at τ = 0.

    Parameters
    ----------
    scene : Scene
        Its forcing is measured; block dimensions give the measures with units.

    Returns
    -------
    Intensities

    Examples
    --------
    >>> from fpk_rocking import Scene
    >>> from fpk_rocking.studies import intensities
    >>> motion = intensities(Scene.from_block(0.5, 1.8, "0.3 g", "1.5 Hz"))
    >>> print(f"PGA {motion.pga:.2f} m/s², PGV {motion.pgv:.2f} m/s")
    PGA 2.94 m/s², PGV 0.31 m/s
    """
    checks.instance("scene", scene, Scene)
    for diagnostic in drifting(scene.forcing):
        warnings.warn(diagnostic.message, stacklevel=2)
    return measured(scene)


def measured(scene: Scene) -> Intensities:
    """Return the intensity measures of a scene's forcing without a warning, for results that have their verdict."""
    forcing, size = scene.forcing, scene.block.size
    acceleration, velocity = forcing.largest, forcing.largest_velocity
    if size is None:
        return Intensities(acceleration, velocity, math.nan, math.nan, velocity)
    unit = size.gravity * size.critical_angle
    pgv = velocity * unit / size.frequency_parameter
    relative = velocity * size.critical_angle / math.tan(size.critical_angle)
    return Intensities(acceleration, velocity, acceleration * unit, pgv, relative)


class Measure(NamedTuple):
    """An intensity of the ground motion: its name in `Intensities`, its unit, and that in SI."""

    field: str
    unit: str
    si: float


MEASURES = {"PGA": Measure("pga", "g", STANDARD_GRAVITY), "PGV": Measure("pgv", "m/s", 1.0)}
"""Intensities that a curve may be for: peak ground acceleration in g, peak ground velocity in m/s."""


def measure_of(name: str) -> Measure:
    """Return field, unit and factor of the intensity "PGA" or "PGV", or refuse another name."""
    if name not in MEASURES:
        raise ValueError(checks.refusal("measure", name, ", ".join(map(repr, MEASURES))))
    return MEASURES[name]


def intensity_of(scene: Scene, measure: str) -> float:
    """Return the peak ground acceleration or velocity of a scene's forcing.

    Parameters
    ----------
    scene : Scene
        Of a block with dimensions.
    measure : str
        "PGA" (in g) or "PGV" (in m/s).

    Returns
    -------
    float

    Raises
    ------
    ValueError
        The measure is unknown, the block has no dimensions, or the forcing is 0.
    """
    chosen = measure_of(measure)
    peak = getattr(measured(checks.instance("scene", scene, Scene)), chosen.field) / chosen.si
    if not peak > 0.0:
        why = "a scene of a block with dimensions and a forcing that is not 0"
        raise ValueError(checks.refusal("scene", scene, why))
    return peak


def at_intensity(scene: Scene, measure: str = "PGV", value: float = 1.0, *, noise: bool = True) -> Scene:
    """Return a scene whose forcing is scaled to an intensity.

    With the default value, the scales of `fpk_rocking.studies.fragility` of such scenes are the intensity itself: all
    records of a suite are then compared at equal intensities (stripes).

    Parameters
    ----------
    scene : Scene
        Of a block with dimensions.
    measure : str
        "PGA" (in g) or "PGV" (in m/s), of the forcing without the noise.
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
    >>> from fpk_rocking.studies import intensities
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
    baseline: str | None = None,
    corner_hz: float | None = None,
) -> list[Scene]:
    """Return a scene under each of several motions.

    Parameters
    ----------
    scene : Scene
        Its forcing is replaced; it stays where there are no motions.
    records : sequence of Record, str or pathlib.Path
        Motions, or files that `Record.from_file` reads.
    units : str, optional
        Unit of the records where their files do not say it.
    baseline : {"none", "mean", "linear", "high-pass"}, optional
        Correction of all records, that of the scene included; by default each keeps its own.
    corner_hz : float, optional
        Corner of the correction "high-pass", Hz; by default each keeps its own.

    Returns
    -------
    list of Scene

    Raises
    ------
    TypeError, ValueError, OSError
        A parameter or a file is refused; or no file lacks a unit and none has the given one; or a baseline is to be
        corrected where there is no record.
    """
    files = [motion for motion in records if not isinstance(motion, Forcing)]
    read = {str(file): Record.from_file(file, units_if_unstated=units) for file in files}
    said = dict.fromkeys(record.units for record in read.values())
    if read and units is not None and unit_of(units) not in said:
        accepted = f"nothing, as all files say their unit ({', '.join(said)})"
        raise ValueError(checks.refusal("units", units, accepted))
    motions = [motion if isinstance(motion, Forcing) else read[str(motion)] for motion in records]
    motions = motions or [scene.forcing]
    asked: dict[str, Any] = {"baseline": baseline, "corner_hz": corner_hz}
    changes = {name: value for name, value in asked.items() if value is not None}
    if changes:
        if baseline is not None:
            check_baseline("baseline", baseline)
        if not any(isinstance(motion, Record) for motion in motions):
            name, value = next(iter(changes.items()))
            raise ValueError(checks.refusal(name, value, "nothing where there is no record"))
        motions = [
            dataclasses.replace(motion, **changes) if isinstance(motion, Record) else motion for motion in motions
        ]
        if corner_hz is not None and all(getattr(motion, "baseline", "") != "high-pass" for motion in motions):
            raise ValueError(checks.refusal("corner_hz", corner_hz, 'nothing without the baseline "high-pass"'))
    return [dataclasses.replace(scene, forcing=motion) for motion in motions]


def checked_scenes(name: str, scenes: Any) -> tuple[Scene, ...]:
    """Return a tuple of scenes, at least one."""
    accepted = "one or more scenes"
    scenes = checks.sequence(name, scenes, accepted)
    if not scenes:
        raise ValueError(checks.refusal(name, scenes, accepted))
    return tuple(checks.instance(f"{name}[{number}]", scene, Scene) for number, scene in enumerate(scenes))


def motion_lines(table: Mapping[str, Array], measure: str) -> list[str]:
    """Return a line of text for each motion of a `motion_table`."""
    unit = "" if measure == "scale" else f" {measure_of(measure).unit}"
    lines = []
    for place, name in enumerate(table["motion"]):
        row = {column: values[place] for column, values in table.items()}
        peaks = {"PGA {:.3g} g": row["pga_g"], "PGV {:.3g} m/s": row["pgv_m_per_s"]}
        texts = [form.format(value) for form, value in peaks.items() if math.isfinite(value)]
        if "critical_scale" in row:
            turned = f"overturns to the {row['overturn_side']} at τ = {row['overturn_time']:.4g}"
            texts.append(turned if row["overturn_side"] else f"peak rotation {row['peak_rotation']:.3g} θ_cr")
            at = f"{measure} {row['critical_intensity']:.4g}{unit}, " * (measure != "scale")
            critical = f"critical at {at}{row['critical_scale']:.3g} times its own strength"
            texts.append(critical if math.isfinite(row["critical_scale"]) else "stands up to the highest intensity")
        lines.append(f"{name}: {', '.join(texts) or 'no size, no units'}.")
    return lines


def motion_names(scenes: Sequence[Scene]) -> list[str]:
    """Return the name of the motion of each scene: the source of a record, else what the forcing is; all differ."""
    names = [getattr(scene.forcing, "source", "") or str(scene.forcing) for scene in scenes]
    count = dict.fromkeys(names, 0)
    for place, name in enumerate(names):
        count[name] += 1
        names[place] = name if names.count(name) == 1 and count[name] == 1 else f"{name} ({count[name]})"
    return names
