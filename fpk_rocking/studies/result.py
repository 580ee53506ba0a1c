"""The result of `fragility`: probabilities against the scale of the shaking, with their errors and fits."""

import dataclasses
import functools
import math
from typing import Annotated, Any, ClassVar, Self

import numpy as np

from fpk_rocking.base.checks import Array, not_none
from fpk_rocking.results.remarks import EXACT_PATH, baseline_remark
from fpk_rocking.results.result import Result
from fpk_rocking.results.sampling import wilson_interval
from fpk_rocking.results.storage import plain
from fpk_rocking.results.trust import UNASKED, Diagnostic
from fpk_rocking.scene.scene import Scene
from fpk_rocking.studies.critical import CriticalIntensities
from fpk_rocking.studies.lognormal import LognormalFit, fit_lognormal, limits_text, outcomes_text
from fpk_rocking.studies.motions import Intensities, measure_of, measured, motion_names, motion_table
from fpk_rocking.studies.outcomes import MotionOutcomes, overturns
from fpk_rocking.studies.pooled import IntensityCurve
from fpk_rocking.studies.suites import curve_diagnostics


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
        Probability within the time of the study: [:, 0] that the block overturns, [:, 1:] that |Θ| reaches each level.
        nan where the engine gave no answer.
    error_estimate : ndarray, shape (m, l + 1, n)
        Estimated error of a density; nan for a sample.
    engine : str
        "exact", "rk4", "white", "filtered" or "density".
    realizations : int
        Number of realizations of each sample; 0 for a density. A deterministic scene has one path whatever the number.
    noise_scaled : bool
        Whether the scale multiplies the noise as well.
    options : dict
        Cycles, seed and settings of the engine, as passed to `fpk_rocking.studies.fragility`.
    noise_replacement : str
        Which noise replaced that of the scenes, as a sentence; empty where none did.
    reasons : dict of str to str
        Why the engine gave no answer, by the indices "scene,level,scale" into `probability`.
    wall_s : float
        Seconds that the call took.
    motions : MotionOutcomes or None
        Of scenes without noise by the method "exact" all scales at which an outcome changes, and what each scene does
        at scale 1; None of others.

    Examples
    --------
    >>> from fpk_rocking import Scene
    >>> from fpk_rocking.studies import fragility
    >>> rack = Scene.from_block(0.5, 1.8, "0.5 g", "1.5 Hz",
    ...                         noise_rms_acceleration=0.5, noise_band_hz=(0, 5))
    >>> curve = fragility(rack, scale=[0.8, 1.0, 1.2], cycles=4, realizations=500)
    >>> print(curve.interval()[0, 0].round(2))
    [[0.   0.01]
     [0.07 0.12]
     [0.31 0.39]]
    >>> print(f"median {curve.fits[0][0].median:.2f}, {curve.intensities[0].pga:.2f} m/s² at scale 1")
    median 1.28, 4.90 m/s² at scale 1
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
            Confidence of each interval of a sample, in (0, 1). For a density it has no effect.

        Returns
        -------
        ndarray, shape (m, l + 1, n, 2)
            Wilson's confidence limits of a sample; for a density, its error estimate to either side within [0, 1]; the
            probability itself where nothing is random.
        """
        if self.realizations:
            limits = wilson_interval(np.round(self.probability * self.realizations), self.realizations, level)
            return np.where(self.deterministic[:, None, None, None], self.probability[..., None], limits)
        limits = np.stack([self.probability - self.error_estimate, self.probability + self.error_estimate], axis=-1)
        return np.clip(limits, 0.0, 1.0)

    def at_scales(self, scale: Array) -> Self:
        """Return the curves at other scales, by the outcomes that were searched for without noise.

        Parameters
        ----------
        scale : ndarray, shape (n,)
            Ascending.

        Returns
        -------
        Fragility
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
        return CriticalIntensities(
            scenes=self.scenes,
            measure="scale",
            highest=math.inf if "farthest" in self.options else float(self.scale[-1]),
            own=np.ones(len(self.scenes)),
            jumps=self.motions.jumps[:, 0].copy(),
            peak=self.motions.peak,
            overturn_time=self.motions.overturn_time,
            overturn_side=self.motions.overturn_side,
            options={name: self.options[name] for name in ("cycles", "times") if name in self.options},
            wall_s=self.wall_s,
        )

    @property
    def measure(self) -> str:
        """What the scale is: "PGV" in m/s or "PGA" in g where that is 1 for all scenes at scale 1, else "scale"."""
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
        """Lognormal fit of each curve, with 95 % intervals of a sample: a list (m) of lists (l + 1) of `LognormalFit`.

        The outcomes of a deterministic scene are not fitted.
        """
        scenes = zip(self.probability, self.deterministic, strict=True)
        return [[self._fit(curve, still) for curve in curves] for curves, still in scenes]

    def _fit(self, curve, deterministic):
        """Return the `LognormalFit` of a `curve` (n,) of probabilities; of one path it has a reason alone."""
        if deterministic:
            return LognormalFit(reason=f"deterministic: {outcomes_text(self.scale, curve)}")
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

        Returns
        -------
        str
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

    def model_diagnostics(self) -> list[Diagnostic]:
        """Return a list of `Diagnostic` of this result beside its sampling errors, each kind once."""
        return curve_diagnostics(self)

    @property
    def error_figures(self) -> dict[str, Any]:
        """Dict with "half_width" or "error_estimate", the largest of probabilities with an answer; empty if exact."""
        limits = self.interval()
        own = {"half_width": 0.5 * np.diff(limits)} if self.realizations else {"error_estimate": self.error_estimate}
        own = {} if self.deterministic.all() else own
        return {name: np.nanmax(values) for name, values in own.items() if np.isfinite(values).any()}

    @property
    def tol(self) -> float:
        """Error of a probability that was asked for; where none was, as for a sample, `UNASKED`."""
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

        Returns
        -------
        str
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

        The title says how many curves there are, where they are more.
        """
        from fpk_rocking.studies.picture import small_figure

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
