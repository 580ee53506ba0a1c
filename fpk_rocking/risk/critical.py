"""Critical intensities: the lowest intensity of each motion from which it overturns a block without noise."""

import dataclasses
import functools
import math
import time
from collections.abc import Sequence
from concurrent.futures import Executor
from typing import Annotated, Any, ClassVar

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array, ArrayLike, File, Progress
from fpk_rocking.physics.forcing import Forcing, Record
from fpk_rocking.results.pictures import COLOURS, figure_of
from fpk_rocking.results.remarks import EXACT_PATH, airborne, baseline_remark, scene_diagnostics
from fpk_rocking.results.result import Result
from fpk_rocking.results.trust import CAUTION, Diagnostic
from fpk_rocking.risk.floors import Building
from fpk_rocking.risk.motions import (
    floor_diagnostics,
    intensity_of,
    measure_of,
    motion_names,
    motion_table,
    recorded_scenes,
)
from fpk_rocking.risk.search import (
    FARTHEST,
    MotionOutcomes,
    equivalent_scale,
    first_scale,
    kernels_of,
    last_scale,
    overturns,
    search,
)
from fpk_rocking.scene.axes import result_times
from fpk_rocking.scene.scene import Scene
from fpk_rocking.studies.execution import Job, run_jobs
from fpk_rocking.studies.scenes import checked_scenes


def critical_text(measure: str) -> str:
    """Return what critical, always and equivalent intensities are, as sentences beside a table."""
    return (
        f"The critical {measure} of a motion is the lowest from which it overturns the block over an interval of 1 % "
        "at least. Above it the block may stand again, until it always overturns. Narrower intervals may be missed: "
        f"this can change the outcome at one {measure}, but hardly the rate. P(overturned) is the share of the "
        f"motions that overturn the block at a {measure}; a motion under which the block stands again above its "
        f"critical {measure} does not count there. A lognormal fit takes each motion at its equivalent {measure}: the "
        f"threshold above which overturning at all intensities would cover the same total length of ln({measure})."
    )


LARGEST_FACTOR = 5.0
"""Factor of a motion's own acceleration above which there is a caution."""


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class CriticalIntensities(Result):
    """At which intensity each of m motions overturns a block, and what the block does at the motion's own scale.

    Parameters
    ----------
    scenes : tuple of Scene, (m,)
        The block under each motion, at the motion's own scale.
    measure : str
        As for `at_intensity`, or "scale".
    highest : float
        Highest intensity of the search; inf for the default of `critical_intensities`.
    own : ndarray, shape (m,)
        Intensity of each motion at its own scale; 1 for "scale".
    jumps : ndarray, shape (m, k)
        Ascending intensities from which the block in turn overturns and stands, to a relative 0.001; nan behind the
        last. Intervals narrower than 0.01 may be missed.
    peak : ndarray, shape (m,)
        Largest |Θ| = |θ|/θ_cr at the motion's own scale, at most that of overturning.
    overturn_time : ndarray, shape (m,)
        Time τ of overturning at the motion's own scale, nan where the block stands.
    overturn_side : ndarray, shape (m,)
        -1 (left) or 1 (right), 0 where it stands.
    options : dict
        Cycles or times, as passed to `critical_intensities`.
    wall_s : float
        Seconds that the call took.
    """

    kind: ClassVar = "critical"
    scenes: tuple[Scene, ...]
    measure: str
    highest: float
    own: Annotated[Array, "f8 m"]
    jumps: Annotated[Array, "f8 m k"]
    peak: Annotated[Array, "f8 m"]
    overturn_time: Annotated[Array, "f8 m"]
    overturn_side: Annotated[Array, "i1 m"]
    options: dict[str, Any]
    wall_s: float

    row_dims = ("motion",)

    @property
    def unit(self) -> str:
        """Unit of the intensity, "g" or "m/s"; empty for "scale"."""
        return "" if self.measure == "scale" else measure_of(self.measure).unit

    @functools.cached_property
    def critical(self) -> Array:
        """Critical intensity of each motion, (m,): the lowest from which the block overturns over at least 1 %.

        inf for a motion under which it stands up to the end of the search (right-censored).
        """
        return first_scale(self.jumps)

    @property
    def always(self) -> Array:
        """Intensity of each motion from which the block overturns at all higher ones, (m,); inf where it stands."""
        return last_scale(self.jumps)

    @property
    def equivalent(self) -> Array:
        """Intensity of each motion that a lognormal fit is made of, (m,).

        Overturning at all intensities above it would cover the same range of their logarithm as the intervals do; inf
        where the block stands at the end of the search.
        """
        return equivalent_scale(self.jumps)

    @property
    def factor(self) -> Array:
        """Critical scale: the critical intensity over the motion's own, (m,)."""
        return self.critical / self.own

    def overturned(self, intensity: ArrayLike) -> Array:
        """Return whether each motion overturns the block at each of some intensities.

        Parameters
        ----------
        intensity : array_like, shape (n,)
            In the unit of the measure, above 0 and up to `highest`.

        Returns
        -------
        ndarray of bool, shape (m, n)
        """
        asked = checks.several("intensity", intensity, most=1_000_000, above=0.0, at_most=self.highest)
        return overturns(self.jumps, asked)

    @property
    def names(self) -> list[str]:
        """Names of the motions, a list (m) of texts that differ."""
        return motion_names(self.scenes)

    @property
    def remarks(self) -> tuple[str, ...]:
        """Sentences that a reader of this result needs: corrected baselines, and what is not to be trusted."""
        baseline = baseline_remark(scene.forcing for scene in self.scenes)
        return tuple(
            filter(None, dict.fromkeys((baseline, *(diagnostic.message for diagnostic in self.model_diagnostics()))))
        )

    def model_diagnostics(self) -> list[Diagnostic]:
        """Return a list of `Diagnostic`: on the model, each kind once, and on motions that are scaled far."""
        ranges = [(1.0, max(1.0, most)) for most in (self.highest / self.own).tolist()]
        pairs = zip(self.scenes, ranges, strict=True)
        of_scenes = {
            diagnostic.kind: diagnostic
            for scene, scales in pairs
            for diagnostic in scene_diagnostics(scene, "", scales=scales)
        }
        top = np.where(np.isfinite(self.always), self.always, self.critical) / self.own
        away = airborne(zip((scene.forcing for scene in self.scenes), top, strict=True))
        own = floor_diagnostics(self.scenes, self.measure) + factor_diagnostics(self.factor, self.always / self.own)
        return [*of_scenes.values(), *away, *own]

    @property
    def reason_if_ok(self) -> str:
        """Reason of the verdict "ok", as a sentence: each path is exact."""
        return EXACT_PATH

    @property
    def title(self) -> str:
        """How many motions overturn the block, and the lowest intensity that does, as a line of text."""
        reached = self.critical[np.isfinite(self.critical)]
        end = f"up to {self._text(self.highest)}"
        if math.isinf(self.highest):
            end = f"up to {FARTHEST:,.0f} times the acceleration that lifts it off" * (reached.size < len(self.scenes))
        text = f"{reached.size} of {len(self.scenes)} motions overturn the block {end}".rstrip()
        return text + f", the first at {self._text(reached.min())}" if reached.size else text

    def _text(self, intensity):
        """Return an `intensity` (float) with its measure and unit as a text."""
        return f"{self.measure} {intensity:.3g} {self.unit}".rstrip()

    def places(self) -> dict[str, Any]:
        """Names of the motions, and numbers of the intensities at which outcomes change."""
        return {"motion": self.names, "number": np.arange(1, self.jumps.shape[1] + 1)}

    def derived(self) -> dict[str, Any]:
        """PGA, PGV, own and critical intensities of each motion, and what the block does at the motion's own scale.

        "overturns_at" are all intervals of overturning as a text. Seconds and m/s are nan without block dimensions.
        """
        peaks = {name: values for name, values in motion_table(self.scenes).items() if name != "motion"}
        columns = peaks | {
            "own_intensity": self.own,
            "critical_intensity": self.critical,
            "always_intensity": self.always,
            "equivalent_intensity": self.equivalent,
            "critical_scale": self.factor,
            "peak_rotation": self.peak,
            "overturn_time": self.overturn_time,
            "overturn_s": seconds_of(self.scenes, self.overturn_time),
            "overturn_side": side_names(self.overturn_side),
            "overturns_at": np.array(list(map(intervals_text, self.jumps)), dtype=str),
        }
        return {name: ("motion", values) for name, values in columns.items()} | {"jump": ("motion number", self.jumps)}

    def summary(self) -> dict[str, Any]:
        """Return a dict for JSON: metadata, columns and jumps of each motion, verdict and remarks."""
        jumps = [row[np.isfinite(row)].tolist() for row in self.jumps]
        return super().summary() | {"motion": self.names, "jumps": jumps}

    def plot(self) -> Any:
        """Draw the intervals of overturning of each motion, and its own intensity; returns a matplotlib figure."""
        order = np.argsort(self.critical, kind="stable")

        def panel(_, axes):
            end = min(self.highest, 1.25 * max(self.own.max(), np.nanmax(self.jumps, initial=0.0)))
            for place, number in enumerate(order):
                row = self.jumps[number][np.isfinite(self.jumps[number])]
                ends = np.append(row, end) if row.size % 2 else row
                axes.hlines(np.full(ends.size // 2, place), ends[::2], ends[1::2], color=COLOURS[0], linewidth=2.0)
            axes.plot(self.own[order], range(len(order)), "|", color="black", label="own intensity")
            axes.set(
                xscale="log", xlabel=f"{self.measure} {self.unit}".rstrip() + " (bars: overturns)", ylabel="motion"
            )
            axes.legend(fontsize=8)

        return figure_of(panel)


def critical_of(
    outcomes: MotionOutcomes,
    scenes: tuple[Scene, ...],
    measure: str,
    highest: float,
    own: Array,
    options: dict[str, Any],
    wall_s: float,
) -> CriticalIntensities:
    """Return critical intensities from outcomes over the scale, of which the first curve of a scene is overturning."""
    jumps = outcomes.jumps[:, 0] * own[:, None]
    at_own = outcomes.peak, outcomes.overturn_time, outcomes.overturn_side
    return CriticalIntensities(scenes, measure, highest, own, jumps, *at_own, options, wall_s)


def seconds_of(scenes: Sequence[Scene], times: Array) -> Array:
    """Return `times` τ (m,), one of each scene, in seconds (m,); nan for a block without dimensions."""
    sizes = [scene.block.size for scene in scenes]
    pairs = zip(sizes, times.tolist(), strict=True)
    return np.array([math.nan if size is None else size.seconds(time) for size, time in pairs])


def side_names(sides: Array) -> Array:
    """Return an array (m,) of texts, "left", "right" or "", for `sides` (m,) of overturning: -1, 1, or 0 for none."""
    return np.array(["", "right", "left"])[np.asarray(sides, int)]


def intervals_text(jumps: Array) -> str:
    """Return the intervals of overturning as a text, as in "0.41-0.43; 0.5-"."""
    texts = [f"{jump:.4g}" for jump in jumps[np.isfinite(jumps)]]
    return "; ".join(f"{begin}-{end}" for begin, end in zip(texts[::2], [*texts[1::2], ""], strict=False))


def factor_diagnostics(factor: Array, always: Array | None = None) -> list[Diagnostic]:
    """Return a list with a `Diagnostic` if motions overturn a block only when scaled far up; else an empty list."""
    far = factor[np.isfinite(factor) & (factor > LARGEST_FACTOR)]
    if not far.size:
        return []
    far_always = 0 if always is None else int((always > LARGEST_FACTOR).sum())
    more = f" For {far_always} of {factor.size} the factor from which it always overturns is above {LARGEST_FACTOR:g}."
    more *= far_always > far.size
    sentence = (
        f"{far.size} of {factor.size} motions must be scaled by more than {LARGEST_FACTOR:g}, up to {far.max():.3g}, "
        f"to overturn the block.{more} Common advice is to scale a record by 4 or 5 at most "
        "(reviewed by Bommer and Acevedo, J. Earthquake Eng. 8(S1), 43-91, 2004): strong motions differ from weak ones "
        "in frequency content and duration, which no factor changes. Take stronger records."
    )
    return [Diagnostic(CAUTION, sentence, "large factors")]


def critical_intensities(
    scene: Scene | Sequence[Scene],
    motions: Sequence[Forcing | File] = (),
    *,
    highest: float | None = None,
    measure: str = "PGV",
    units: str | None = None,
    baseline: str | None = None,
    ground: Sequence[Record | File] = (),
    building: Building | None = None,
    vertical: Sequence[Record | File] = (),
    cycles: int | None = None,
    times: ArrayLike | None = None,
    workers: int | Executor = 1,
    store: File | None = None,
    progress: Progress | None = None,
) -> CriticalIntensities:
    """Find at which intensities of each motion a block overturns without noise.

    From uplift on, the logarithm of the intensity is scanned in steps of 0.04, and of 0.01 beside intensities that
    overturn the block or reach an eighth of the angle of overturning; changes are bisected to 0.001. From the first
    change to the critical intensity the steps are 0.0025. Outcomes are a fractal: narrower intervals may be missed.

    Parameters
    ----------
    scene : Scene, or sequence of Scene
        The block, without noise, its start a point; each motion replaces its forcing. Or a scene for each motion.
    motions : sequence of Record, str or pathlib.Path
        Motions, or files that `Record.from_file` reads.
    highest : float, optional
        Largest intensity of the search. By default the search ends where the block overturns at all intensities over a
        factor of 2, or at 1,000 times the acceleration of uplift.
    measure : str
        As for `fpk_rocking.risk.at_intensity`, or "scale" (the factor of the motion itself).
    units, baseline, ground, building, vertical
        Of records, as for `fpk_rocking.risk.study`.
    cycles, times
        As for `montecarlo.simulate`: overturning counts until the last of them.
    workers, store, progress
        As for `fpk_rocking.studies.sweep`. Each scene of it is here one motion.

    Returns
    -------
    CriticalIntensities
        `critical` (m,): lowest intensity of each motion that overturns the block; `jumps`: all intervals; and what the
        block does at the motion's own scale.

    Raises
    ------
    TypeError, ValueError, OSError
        A parameter or a file is refused, or a scene has noise.

    Examples
    --------
    >>> from fpk_rocking import Scene
    >>> from fpk_rocking.risk import critical_intensities, synthetic_records
    >>> block = Scene.from_block(0.5, 1.8, "0.3 g", "1.5 Hz")
    >>> suite = critical_intensities(block, synthetic_records(5, duration=5.0), highest=2.0)
    >>> print(suite.title)
    5 of 5 motions overturn the block up to PGV 2 m/s, the first at PGV 0.533 m/s
    """
    started = time.perf_counter()
    if isinstance(scene, Scene):
        reading: dict[str, Any] = {"units": units, "baseline": baseline, "ground": ground, "building": building}
        scenes = tuple(recorded_scenes(scene, motions, **reading, vertical=vertical))
    elif motions or ground or building is not None or vertical:
        raise ValueError(
            checks.refusal(
                "motions",
                motions or ground or building or vertical,
                "nothing beside several scenes, which have their own",
            )
        )
    else:
        scenes = checked_scenes("scene", scene)
    highest = None if highest is None else checks.number("highest", highest, above=0.0)
    if measure != "scale":
        measure = measure_of(measure).name
    lasting: dict[str, Any] = {} if cycles is None else {"cycles": int(cycles)}
    lasting |= {} if times is None else {"times": np.asarray(times, float).tolist()}
    for number, shaken in enumerate(scenes):
        if not shaken.deterministic:
            accepted = "scenes without noise, whose start has no covariance"
            raise ValueError(checks.refusal(f"scene[{number}]", shaken, accepted))
        result_times(shaken, cycles, times)
    own = np.array([1.0 if measure == "scale" else intensity_of(shaken, measure) for shaken in scenes])
    jobs = [Job(number, shaken, 0) for number, shaken in enumerate(scenes)]
    options = {"measure": measure, "highest": highest} | lasting
    rows = run_jobs(search, jobs, options, kernels_of, workers=workers, store=store, progress=progress)
    failed = next((row for row in rows if row["reason"]), None)
    if failed:
        raise ValueError(f"motion {motion_names(scenes)[failed['cell']]}: {failed['reason']}")
    outcomes = MotionOutcomes.of([row["values"] for row in rows])
    end = math.inf if highest is None else highest
    return critical_of(outcomes, scenes, measure, end, own, options, time.perf_counter() - started)
