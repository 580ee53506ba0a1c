"""`fragility`: the probability of overturning against the scale of the shaking; `Fragility`, its result."""

import dataclasses
import functools
import math
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from typing import Annotated, Any, ClassVar, Self

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array, ArrayLike, File, Progress, not_none
from fpk_rocking.results.remarks import EXACT_PATH, baseline_remark, path_diagnostics, scene_diagnostics
from fpk_rocking.results.result import Result
from fpk_rocking.results.sampling import wilson_interval
from fpk_rocking.results.storage import plain
from fpk_rocking.results.trust import CAUTION, UNASKED, UNUSABLE, Diagnostic
from fpk_rocking.risk.critical import CriticalIntensities, critical_of
from fpk_rocking.risk.lognormal import LognormalFit, fit_lognormal, limits_text, outcomes_text
from fpk_rocking.risk.motions import (
    Intensities,
    floor_diagnostics,
    intensity_of,
    measure_of,
    measured,
    motion_names,
    motion_table,
)
from fpk_rocking.risk.population import IntensityCurve
from fpk_rocking.risk.search import FARTHEST, MotionOutcomes, overturns, search
from fpk_rocking.risk.search import kernels_of as kernels_of_paths
from fpk_rocking.scene.axes import result_times
from fpk_rocking.scene.scene import Scene
from fpk_rocking.studies.execution import Job, run_jobs, seed_of
from fpk_rocking.studies.scenes import checked_scenes, grid, scaled
from fpk_rocking.studies.tasks import TASKS, kernels_of
from montecarlo.engines import engine_of


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Fragility(Result):
    """Fragility curves: the probability of overturning, or of reaching an angle, against the scale of the shaking.

    There are m curves, one for each scene, n scales and l levels, which are angles below that of overturning.

    Parameters
    ----------
    scenes : tuple of Scene, (m,)
        The scenes at scale 1.
    axis : str
        Name of the parameter in which the scenes differ, as `fpk_rocking.studies.scenes.varied` takes it; "scene" for
        a list of scenes.
    place : ndarray, shape (m,)
        Values of this parameter; numbers from 0 for "scene".
    level : ndarray, shape (l,)
        Levels of the largest |Θ|, in units of θ_cr.
    scale : ndarray, shape (n,)
        Factors of the shaking, ascending.
    probability : ndarray, shape (m, l + 1, n)
        [:, 0] that the block overturns, [:, 1:] that |Θ| reaches each level; nan where the engine gave no answer.
    error_estimate : ndarray, shape (m, l + 1, n)
        Estimated error of a density; nan for a sample.
    engine : str
        "exact", "rk4", "white", "filtered" or "density".
    realizations : int
        Size of each sample; 0 for a density. A deterministic scene has one path.
    noise_scaled : bool
        Whether the scale multiplies the noise as well.
    options : dict
        Cycles, seed and settings of the engine, as passed to `fpk_rocking.risk.fragility`.
    noise_replacement : str
        Which noise replaced that of the scenes, as a sentence; empty where none did.
    reasons : dict of str to str
        Why the engine gave no answer, by the indices "scene,level,scale" into `probability`.
    wall_s : float
        Seconds that the call took.
    motions : MotionOutcomes or None
        For scenes without noise by the method "exact": all changes of outcome, and what happens at scale 1.
    """

    kind: ClassVar = "fragility"
    scenes: tuple[Scene, ...]
    axis: str
    place: Annotated[Array, "f8 m"]
    level: Annotated[Array, "f8 l"]
    scale: Annotated[Array, "f8 n"]
    probability: Annotated[Array, "f8 m l+1 n"]
    error_estimate: Annotated[Array, "f8 m l+1 n"]
    engine: str
    realizations: int
    noise_scaled: bool
    options: dict[str, Any]
    noise_replacement: str
    reasons: dict[str, str]
    wall_s: float
    motions: MotionOutcomes | None = None

    def __post_init__(self) -> None:
        if len(self.place) != len(self.scenes):
            raise ValueError(f"{len(self.scenes)} scenes for {len(self.place)} places")
        super().__post_init__()

    @property
    def overturned(self) -> Array:
        """Probability that the block overturns, shape (m, n)."""
        return self.probability[:, 0]

    @property
    def reached(self) -> Array:
        """Probability that |Θ| reaches each level, shape (m, l, n)."""
        return self.probability[:, 1:]

    @property
    def deterministic(self) -> Array:
        """Whether nothing is random behind a curve, so that each scale has one outcome of each scene, shape (m,)."""
        return np.array([scene.deterministic and self.realizations > 0 for scene in self.scenes])

    def interval(self, level: float = 0.95) -> Array:
        """Return limits of the probabilities.

        Parameters
        ----------
        level : float
            Confidence of intervals of a sample, in (0, 1).

        Returns
        -------
        ndarray, shape (m, l + 1, n, 2)
            Wilson's for a sample; for a density the error estimate to either side; none where nothing is random.
        """
        if self.realizations:
            limits = wilson_interval(np.round(self.probability * self.realizations), self.realizations, level)
            return np.where(self.deterministic[:, None, None, None], self.probability[..., None], limits)
        limits = np.stack([self.probability - self.error_estimate, self.probability + self.error_estimate], axis=-1)
        return np.clip(limits, 0.0, 1.0)

    def at_scales(self, scale: Array) -> Self:
        """Return the curves at other scales, from the changes of outcome that were found without noise.

        Parameters
        ----------
        scale : ndarray, shape (n,)
            Ascending.
        """
        jumps = not_none(self.motions).jumps
        probability = overturns(jumps.reshape(-1, jumps.shape[-1]), scale).astype(float)
        probability = probability.reshape(*jumps.shape[:2], len(scale))
        unknown = np.full(probability.shape, math.nan)
        return dataclasses.replace(self, scale=np.array(scale), probability=probability, error_estimate=unknown)

    @functools.cached_property
    def critical(self) -> CriticalIntensities | None:
        """`CriticalIntensities`: critical scales of each scene, and what it does at scale 1; None with noise."""
        if self.motions is None:
            return None
        end = math.inf if "farthest" in self.options else float(self.scale[-1])
        options = {name: value for name, value in self.options.items() if name in {"cycles", "times"}}
        return critical_of(self.motions, self.scenes, "scale", end, np.ones(len(self.scenes)), options, self.wall_s)

    @property
    def measure(self) -> str:
        """Measure of the scale: as stated; else "PGV" or "PGA" if it is 1 for all scenes at scale 1; else "scale"."""
        if "measure" in self.options:
            return self.options["measure"]
        for name in ("PGV", "PGA"):
            peaks = [getattr(motion, measure_of(name).field) / measure_of(name).si for motion in self.intensities]
            if np.allclose(peaks, 1.0, rtol=1e-9):
                return name
        return "scale"

    @property
    def motion_table(self) -> dict[str, Array]:
        """Columns (m,) by name, a row for each scene's motion: name, PGA, PGV; without noise those of `critical`."""
        return self.critical.table() if self.critical else motion_table(self.scenes)

    @functools.cached_property
    def fits(self) -> list[list[LognormalFit]]:
        """Lognormal fit of each curve, for samples with 95 % intervals: a list (m) of lists (l + 1) of `LognormalFit`.

        The outcomes of a deterministic scene are not fitted.
        """
        scenes = zip(self.probability, self.deterministic, strict=True)
        return [[self._fit(curve, still) for curve in curves] for curves, still in scenes]

    def _fit(self, curve, deterministic):
        """Return the `LognormalFit` of a `curve` (n,) of probabilities; of one path it has a reason alone."""
        if deterministic:
            return LognormalFit(reason=f"nothing is random; {outcomes_text(self.scale, curve)}")
        return fit_lognormal(self.scale, curve, self.realizations or None)

    @functools.cached_property
    def intensities(self) -> list[Intensities]:
        """Intensity measures of each scene at scale 1, a list (m); they are proportional to the scale."""
        return [measured(scene) for scene in self.scenes]

    @functools.cached_property
    def pooled(self) -> IntensityCurve:
        """`IntensityCurve` of overturning against the scale, for a motion drawn from the population of the scenes."""
        return IntensityCurve.of(self, "scale")

    @property
    def names(self) -> list[str]:
        """Labels of the probabilities: "overturned", then one for each of the l levels."""
        return ["overturned", *(f"|Θ| ≥ {level:g}" for level in self.level)]

    @property
    def names_with_degrees(self) -> list[str]:
        """Labels as `names`, with the levels in degrees too where all blocks have one critical angle above 0."""
        angles = np.degrees([scene.block.critical_angle for scene in self.scenes])
        angle = angles[0]  # Blocks of other sizes round it differently.
        if not angle > 0.0 or np.ptp(angles) > 1e-9 * angle:
            return self.names
        return ["overturned", *(f"|Θ| ≥ {level:g} ({angle * level:.3g}°)" for level in self.level)]

    def label(self, scene: int) -> str:
        """Return a label of a scene: its value of the parameter, the size of its block, or its number.

        Parameters
        ----------
        scene : int
            Number of the scene, from 0.
        """
        sizes = [motion.block.size for motion in self.scenes]
        size = sizes[scene]
        if self.axis != "scene":
            return f"{self.axis} {self.place[scene]:.4g}"
        if size is not None and None not in sizes and len(set(sizes)) == len(sizes):
            return size.label
        return motion_names(self.scenes)[scene] if self._of_motions else f"scene {scene}"

    @property
    def _of_motions(self) -> bool:
        """Whether the scenes differ in their forcing."""
        return self.axis == "scene" and len({scene.forcing for scene in self.scenes}) == len(self.scenes) > 1

    @property
    def remarks(self) -> tuple[str, ...]:
        """Sentences that a reader of this result needs: the noise that was replaced, and what is not to be trusted."""
        baseline = baseline_remark(scene.forcing for scene in self.scenes)
        of = (*(scene.noise.remark for scene in self.scenes), self.noise_replacement, baseline)
        return tuple(
            dict.fromkeys((*filter(None, of), *(diagnostic.message for diagnostic in self.model_diagnostics())))
        )

    def scene_diagnostics(self) -> list[Diagnostic]:
        """Return a list of `Diagnostic` on scenes, noise and engine, each kind once."""
        own = self._unanswered() + self._noise() + floor_diagnostics(self.scenes, self.measure)
        return own + (path_diagnostics(self.engine) if self.deterministic.any() else [])

    def model_diagnostics(self) -> list[Diagnostic]:
        """Return a list of `Diagnostic` beside sampling errors, each kind once: `scene_diagnostics`, fits, falls."""
        return self.scene_diagnostics() + self._rejected() + self._falling()

    def _unanswered(self):
        """Return a list with a `Diagnostic` if some probabilities have no answer; else an empty list."""
        if not self.reasons:
            return []
        count, first = self.probability.size, next(iter(self.reasons.values()))
        sentence = f"The engine gave no answer for {len(self.reasons)} of {count} probabilities: {first}"
        return [Diagnostic(CAUTION if len(self.reasons) < count else UNUSABLE, sentence, "unanswered")]

    def _noise(self):
        """Return a list of `Diagnostic` on model and noise of the scenes, the severest of each kind."""
        kinds: dict[str, dict[Diagnostic, None]] = {}
        for scene in self.scenes:
            for diagnostic in scene_diagnostics(scene, self.noise_replacement, scales=(self.scale[0], self.scale[-1])):
                kinds.setdefault(diagnostic.kind, {})[diagnostic] = None
        grouped = []
        for kind in kinds.values():
            first, *others = sorted(kind, key=lambda diagnostic: -diagnostic.severity)
            likewise = f" (The same holds for {len(others)} of the others.)" * bool(others)
            grouped.append(first._replace(message=first.message + likewise))
        return grouped

    def _rejected(self):
        """Return a list with a `Diagnostic` if the data reject lognormal fits; else an empty list."""
        curves = [fit for fits in self.fits for fit in fits]
        rejected = [fit for fit in curves if fit.rejected]
        if not rejected:
            return []
        worst = max(rejected, key=lambda fit: fit.misfit)
        which = f" of {len(rejected)} of {len(curves)} curves" if len(curves) > 1 else ""
        sentence = (
            f"The lognormal fit{which} is rejected ({worst.rejected}): it is off by up to {worst.misfit:.2g}. "
            "Use the probabilities themselves."
        )
        return [Diagnostic(CAUTION, sentence, "fit")]

    def _falling(self):
        """Return a list with a `Diagnostic` if a curve falls as the shaking grows; else an empty list."""
        # At this confidence chance alone seldom makes any curve fall.
        low, high = np.moveaxis(self.interval(0.9999), -1, 0)
        most = np.fmax.accumulate(low, axis=-1)
        fall = np.nan_to_num(most - high, nan=-1.0)
        fall[self.deterministic] = -1.0
        if fall.max() <= 0.0:
            return []
        m, which, last = np.unravel_index(fall.argmax(), fall.shape)
        curve, scale = self.probability[m, which], self.scale
        first = int(np.nanargmax(low[m, which, : last + 1]))
        repeats = "The phase of the harmonic shaking may cause this: try others." if self.scenes[0].repeats else ""
        sentence = (
            f"The probability falls as the shaking grows: {curve[first]:.3g} at scale {scale[first]:.4g}, "
            f"{curve[last]:.3g} at {scale[last]:.4g}. {repeats}"
        )
        return [Diagnostic(CAUTION, sentence.strip(), "falls")]

    @property
    def error_figures(self) -> dict[str, Any]:
        """Dict with "half_width" or "error_estimate", the largest of probabilities with an answer; empty if exact."""
        limits = self.interval()
        own = {"half_width": 0.5 * np.diff(limits)} if self.realizations else {"error_estimate": self.error_estimate}
        own = {} if self.deterministic.all() else own
        return {name: np.nanmax(values) for name, values in own.items() if np.isfinite(values).any()}

    @property
    def tol(self) -> float:
        """Error of a probability that was asked for; `UNASKED` if none was, as for a sample."""
        return self.options.get("tol", UNASKED)

    @property
    def reason_if_ok(self) -> str:
        """Reason of the verdict "ok", a sentence, where all scenes are deterministic; else empty."""
        return EXACT_PATH if self.deterministic.all() else ""

    @property
    def title(self) -> str:
        """Engine, scales and the median of the fit, as a line of text."""
        count, (low, high) = len(self.place), self.scale[[0, -1]]
        fit = self.fits[0][0]
        fitted = count == 1 and not fit.reason and not (fit.rejected and self._beyond(fit))
        lognormal = f", median {fit.median:.3g}, dispersion {fit.dispersion:.2g}" if fitted else ""
        scenes = f"{count} scene{'s' * (count > 1)}"
        return f"by {self.engine}, {scenes} at {self.scale.size} scales from {low:.3g} to {high:.3g}{lognormal}"

    def _beyond(self, fit: LognormalFit) -> bool:
        """Whether the median of a fit lies outside the scales."""
        return not self.scale[0] <= fit.median <= self.scale[-1]

    def describe(self, scene: int, which: int = 0) -> str:
        """Return the lognormal fit of a curve as a sentence.

        Parameters
        ----------
        scene : int
            Number of the scene, from 0.
        which : int
            Index of the probability: 0 overturning, 1, 2, ... the levels.
        """
        fit, name, curve = self.fits[scene][which], self.names[which], self.probability[scene, which]
        where = f"{name}, {self.label(scene)}" if len(self.place) > 1 else name
        if fit.reason:
            return f"Lognormal ({where}): no fit, {fit.reason}."
        reached = f"the probability is {np.nanmin(curve):.3g} to {np.nanmax(curve):.3g} at these scales"
        beyond = self._beyond(fit)
        if beyond and fit.rejected:
            return f"Lognormal ({where}): no median, {reached}, and the fit is rejected."
        text = f"Lognormal ({where}): median {fit.median:.4g}{limits_text(fit.median_interval)}, dispersion "
        text += f"{fit.dispersion:.3g}{limits_text(fit.dispersion_interval)}, largest misfit {fit.misfit:.2g}"
        text += f", p = {fit.p_value:.2g}" if np.isfinite(fit.p_value) else ""
        text += f"; the median is extrapolated, {reached}" * beyond
        measures = self.intensities[scene].at(fit.median)
        return text + f". At the median: {measures}" * bool(measures) + "."

    @property
    def row_dims(self) -> tuple[str, ...]:
        """A row of the table is a scene, a scale and a level."""
        return self.axis, "scale", "level"

    def places(self) -> dict[str, Any]:
        """Names of the motions, or values of the parameter in which the scenes differ; scales; levels, first inf."""
        place: Any = range(len(self.place)) if self.axis == "scene" else self.place
        place = motion_names(self.scenes) if self._of_motions else place
        return {self.axis: place, "scale": self.scale, "level": [np.inf, *self.level]}

    def derived(self) -> dict[str, Any]:
        """Probabilities with their limits and fits, angles of the levels, and intensities at each scale."""
        limits, dims, last = self.interval(), (self.axis, "level", "scale"), len(self.level)
        angles = [scene.overturning.angle for scene in self.scenes]
        degrees = [math.degrees(scene.block.critical_angle) or math.nan for scene in self.scenes]
        levels = np.array([[angle, *self.level] for angle in angles])
        fitted = [
            [np.full(len(self.scale), math.nan) if fit.reason else fit(self.scale) for fit in fits]
            for fits in self.fits
        ]
        reasons = np.full(self.probability.shape, "", dtype=object)
        for key, reason in self.reasons.items():
            reasons[tuple(map(int, key.split(",")))] = reason
        measures = [[measure.columns(scale) for scale in self.scale] for measure in self.intensities]
        return {
            "event_angle": (dims[:2], levels),
            "level_deg": (dims[:2], levels * np.array(degrees)[:, None]),
            "event": ("level", np.array(["overturned", *["reached"] * last])),
            "probability": (dims, self.probability),
            "low": (dims, limits[..., 0]),
            "high": (dims, limits[..., 1]),
            "lognormal": (dims, np.array(fitted)),
            **{
                name: ((self.axis, "scale"), np.array([[at[name] for at in row] for row in measures]))
                for name in measures[0][0]
            },
            "reason": (dims, reasons.astype(str)),
        }

    def table(self) -> dict[str, Array]:
        """Return the table's columns by name; its "level" of overturning is the angle at which a block overturns."""
        columns = super().table()
        columns["level"] = columns.pop("event_angle")
        return columns

    def plot(self) -> Any:
        """Draw the first three curves with their fits, or the surface over a parameter; returns a matplotlib figure.

        If there are more curves, the title says how many.
        """
        from fpk_rocking.risk.picture import small_figure

        return small_figure(self)

    def summary(self) -> dict[str, Any]:
        """Return a dict for JSON: fields other than the scenes, limits, fits, intensities, verdict and remarks."""
        own = {field.name for field in dataclasses.fields(self)} - {"scenes", "probability", "noise_replacement"}
        values = {
            name: getattr(self, name) for name in (*sorted(own), "overturned", "reached", "deterministic", "remarks")
        }
        fits = [[fit._asdict() for fit in row] for row in self.fits]
        measures = [measure._asdict() for measure in self.intensities]
        more = {"interval": self.interval(), "fits": fits, "intensities": measures, "trust": self.trust.plain}
        more["motions"] = self.motion_table
        return plain(values | more)


def fragility(
    scene: Scene | Sequence[Scene],
    *,
    scale: ArrayLike,
    cycles: int | None = None,
    times: ArrayLike | None = None,
    measure: str | None = None,
    engine: str | None = None,
    levels: ArrayLike = (),
    over: Mapping[str, ArrayLike] | None = None,
    scale_noise: bool = True,
    realizations: int = 10_000,
    tol: float = 1e-2,
    seed: int = 1,
    workers: int | Executor = 1,
    store: File | None = None,
    progress: Progress | None = None,
) -> Fragility:
    """Compute the probability of overturning as a function of the scale of the shaking.

    The result is a curve, a curve for each of several scenes, or a surface over a parameter. Each level x gives the
    probability P(max |Θ| ≥ x) too. The samples of different scales and of different scenes are independent of each
    other, as the fit supposes. Levels share random numbers, and so do the values of a parameter, so their differences
    have less sampling noise; the curves of two levels never cross under band noise or none.

    Without noise all scales at which the outcome changes are searched for (`critical_intensities`), and a probability
    is 0 or 1 by the path at each `scale`. The search does not depend on `scale`.

    Parameters
    ----------
    scene : Scene, or sequence of Scene
        The scene at scale 1, or several, such as one for each recorded motion.
    scale : sequence of float
        Factors of the acceleration of the forcing and of the noise, above 0.
    cycles : int, optional
        Number of forcing cycles in which the block may overturn. Required where the forcing repeats, refused where it
        does not.
    times : sequence of float, optional
        For a pulse or a record: ascending nondimensional times; overturning counts until the last one. By default it
        counts until 10 units of time after the end of each motion.
    measure : str, optional
        Measure of the scale, as for `at_intensity`, in which all scenes have the intensity 1; by default "PGV" or
        "PGA" if they have it.
    engine : {"exact", "rk4", "white", "filtered", "density"}, optional
        A method of `montecarlo.simulate`, or "density" for `fpk_rocking.solve_fpk`. "white" and "filtered" replace band
        noise. By default the Monte Carlo method that fits the noise.
    levels : sequence of float
        Angles x in units of θ_cr, between the start and overturning.
    over : dict of str to sequence of float, optional
        One parameter of a single scene with its values, for a surface: ``{"size": [0.5, 1.0, 2.0]}``. Names are those
        of `fpk_rocking.studies.scenes.varied`.
    scale_noise : bool
        Whether the noise is scaled with the forcing.
    realizations : int
        Number of realizations of each sample. Deterministic scenes have one path each whatever the number.
    tol : float
        Wanted error of the engine "density".
    seed : int
        Seed of the random numbers, at least 0.
    workers, store, progress
        As for `fpk_rocking.studies.sweep`.

    Returns
    -------
    Fragility
        `probability` (scenes, 1 + levels, scales), its `interval`, lognormal `fits` and others. Where the engine
        refuses some of the scales, the probability is nan there and `Fragility.reasons` says why.

    Raises
    ------
    TypeError, ValueError
        A parameter is refused, the engine refuses all scales, or the store belongs to another study or to one that
        still runs.
    RuntimeError
        The executor ended, for example because the scheduler of a cluster was killed. The store keeps finished points.

    Examples
    --------
    >>> from fpk_rocking import Scene
    >>> from fpk_rocking.risk import fragility
    >>> rack = Scene.from_block(0.5, 1.8, "0.5 g", "1.5 Hz",
    ...                         noise_rms_acceleration=0.5, noise_band_hz=(0, 5))
    >>> print(fragility(rack, scale=[0.8, 1.0, 1.2], cycles=4, realizations=500).overturned)
    [[0.002 0.094 0.352]]
    """
    started = time.perf_counter()
    scenes, axis, places = _scenes(scene, over)
    factors = tuple(sorted(checks.several("scale", scale, most=10_000, above=0.0)))
    if len(set(factors)) != len(factors):
        raise ValueError(checks.refusal("scale", scale, "numbers that differ from each other"))
    levels = () if isinstance(levels, tuple | list) and not levels else checks.several("levels", levels, most=10_000)
    _check_levels(levels, scenes)
    stated = {} if measure is None else {"measure": measure_of(measure).name}
    for scene_at_one in scenes if stated else ():
        if not math.isclose(own := intensity_of(scene_at_one, stated["measure"]), 1.0, rel_tol=1e-6):
            accepted = "1 for all scenes, as by `at_intensity` (for drawn blocks not PGV*)"
            raise ValueError(checks.refusal("measure", f"{measure} {own:.4g} at scale 1", accepted))
    seed = checks.count("seed", seed, at_least=0)
    engine, shaken = _engine(engine, scenes)
    for scene_at_one in shaken:
        result_times(scene_at_one, cycles, times)
    lasting: dict[str, Any] = {} if cycles is None else {"cycles": int(cycles)}
    lasting |= {} if times is None else {"times": np.asarray(times, float).tolist()}
    options, realizations = _options(engine, shaken, lasting, realizations, tol)
    shape = len(scenes), 1 + len(levels), len(factors)
    searched = engine == "exact" and all(scene_at_one.deterministic for scene_at_one in shaken)
    jobs: list[Job] = []
    job_of = np.arange(math.prod(shape[:2] if searched else shape)).reshape(*shape[:2], -1) + np.zeros(shape, int)
    for m, which, n in np.ndindex(*shape[:2], 1 if searched else shape[2]):
        own = seed_of(seed, n if over else m * len(factors) + n)
        level = levels[which - 1] if which else None
        jobs.append(Job(len(jobs), _at(shaken[m], 1.0 if searched else factors[n], level, scale_noise), own))
    running: dict[str, Any] = {"workers": workers, "store": store, "progress": progress}
    if searched:
        bounds = {"measure": "scale", "highest": None, "at": list(factors)} | lasting
        options |= {"farthest": FARTHEST}
        rows = run_jobs(search, jobs, bounds, kernels_of_paths, **running)
    else:
        rows = run_jobs(TASKS["fpk" if engine == "density" else "mc"], jobs, options, kernels_of, **running)
    values = [row["values"] for row in rows]
    if not any(values):
        raise ValueError(f"scale: the engine answers none of {list(factors)}; the first reason: {rows[0]['reason']}")
    outcomes = MotionOutcomes.of(values, shape[1]) if searched else None
    if outcomes is None:
        probability = np.array([_overturned(row) for row in values])[job_of]
    else:
        unknown = [math.nan] * len(factors)
        probability = np.array([row["at"] if row else unknown for row in values], float).reshape(shape)
    noise = "white" if any(row.get("noise_replacement") for row in values) else engine if shaken != scenes else ""
    replaced = (
        f"At every scale {noise} noise of equal Melnikov variance replaces that of the scene: an approximation, which "
        "Monte Carlo under the noise of the scene can check."
    )
    return Fragility(
        scenes=scenes,
        axis=axis,
        place=np.array(places, float),
        level=np.array(levels, float),
        scale=np.array(factors),
        probability=probability,
        error_estimate=np.array([row.get("error_estimate", np.nan) for row in values])[job_of],
        engine=engine,
        realizations=realizations,
        noise_scaled=bool(scale_noise),
        options=options | {"seed": seed} | stated,
        noise_replacement=replaced * bool(noise),
        reasons={
            ",".join(map(str, place)): rows[number]["reason"]
            for place, number in np.ndenumerate(job_of)
            if rows[number]["reason"]
        },
        wall_s=time.perf_counter() - started,
        motions=outcomes,
    )


def _scenes(scene, over):
    """Return (scenes, axis, places): scenes at scale 1, the name of what they differ in, and its value for each."""
    if over is None:
        scenes = (scene,) if isinstance(scene, Scene) else checked_scenes("scene", scene)
        return scenes, "scene", range(len(scenes))
    surface = grid(scene, over)
    if len(surface.axes) != 1 or "scale" in surface.axes:
        raise ValueError(checks.refusal("over", over, 'one parameter other than the scale, {"size": [0.5, 1.0]}'))
    ((axis, places),) = surface.axes.items()
    return surface.scenes, axis, places


def _check_levels(levels, scenes):
    """Raise ValueError for one of `levels`, angles in units of θ_cr, not between all scenes' start and overturning."""
    least = max(abs(scene.start.angle) for scene in scenes)
    most = min(scene.overturning.angle for scene in scenes)
    for number, level in enumerate(levels):
        if not least < level < most:
            accepted = f"an angle above that of the start, {least:g}, and below that of overturning, {most:g}"
            raise ValueError(checks.refusal(f"levels[{number}]", level, accepted))


def _engine(engine, scenes):
    """Return (engine, scenes): the name of the engine, one that fits for None, and the scenes with noise it takes."""
    engines = "exact", "rk4", "white", "filtered", "density"
    if engine is not None and engine not in engines:
        accepted = ", ".join(map(repr, engines)) + " or None (the Monte Carlo method that fits the noise)"
        raise ValueError(checks.refusal("engine", engine, accepted))
    if engine is None:
        kinds = {engine_of(scene).method for scene in scenes}
        if len(kinds) != 1:
            accepted = "scenes whose noise one method takes, or an `engine` that replaces it"
            raise ValueError(checks.refusal("scene", f"methods {sorted(kinds)}", accepted))
        return kinds.pop(), scenes
    if engine in {"white", "filtered"}:
        return engine, tuple(getattr(scene, f"{engine}_equivalent")() for scene in scenes)
    return engine, scenes


def _options(engine, scenes, lasting, realizations, tol):
    """Return (options, realizations): a dict of options of the task, and the size of a sample, 0 for a density."""
    if engine == "density":
        # One noise at all scales, or the curve would have steps.
        return lasting | {"tol": tol, "noise_replacement": "white"}, 0
    realizations = checks.count("realizations", realizations)
    realizations = 1 if all(scene.deterministic for scene in scenes) else realizations
    return lasting | {"realizations": realizations, "method": engine}, realizations


def _at(scene, factor, level, scale_noise):
    """Return the scene scaled by `factor`, its angle of overturning set to `level`, or kept where that is None."""
    shaken = scaled(scene, factor, noise=scale_noise)
    return shaken if level is None else shaken.varied(overturning={"angle": level})


def _overturned(values):
    """Return the last probability of overturning by `values`, the dict of a row of a task; nan of an empty one."""
    if not values:
        return np.nan
    if "survivors" in values:
        return (values["realizations"] - values["survivors"]) / values["realizations"]
    return 1.0 - values["survival"][-1]
