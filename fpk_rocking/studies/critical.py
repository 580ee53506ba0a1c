"""Critical intensities: from which scale of a motion on a block without noise overturns, and where it stands again.

What one path comes to is a function of the scale that jumps between standing and overturning. The jumps are bracketed
by a scan in the logarithm of the scale and then halved. The scan is coarse where the block hardly rocks, and fine where
it overturns or comes within sight of it.

The function is a fractal: of the intervals that a scan five times as fine shows under 238 motions of a shake table,
three in four are narrower than `FINE`, and two in five of all are missed. They change the mean of the probability by
2e-4 at most, for those of overturning and those of standing balance. But the lowest scale at which a motion overturns
falls on and on as the scan gets finer; taken for the capacity it made a rate 1.3 to 1.4 times as large. So the critical
scale is that from which the block overturns over a part of `FINE` at least (1.05 times).
"""

import dataclasses
import functools
import math
import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Executor
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.types import Array, ArrayLike, File, Progress
from fpk_rocking.physics.forcing import Forcing
from fpk_rocking.results.pictures import figure_of
from fpk_rocking.results.remarks import baseline_remark, scene_diagnostics
from fpk_rocking.results.result import Dataset, Result
from fpk_rocking.results.storage import Saved
from fpk_rocking.results.style import COLOURS
from fpk_rocking.results.times import result_times
from fpk_rocking.results.trust import CAUTION, Diagnostic
from fpk_rocking.scene.scene import Scene
from fpk_rocking.studies.execution import Job, run_jobs
from fpk_rocking.studies.scenes import (
    checked_scenes,
    intensity_of,
    measure_of,
    measured,
    motion_names,
    recorded_scenes,
)
from montecarlo.engines import engine_of, task_of
from montecarlo.engines.scales import Outcomes, ScaledPaths
from montecarlo.results.ensemble import EXACT_PATH

COARSE, FINE, EDGE = 0.04, 0.01, 1e-3
"""Steps of the scan in the logarithm of the scale, and the width to which a jump is bracketed. FINE is COARSE halved
twice. All intervals wider than FINE are met but those that CALM hides: 3 and 5 in 1,000, for two blocks."""

CALM = 0.125
"""Part of the angle of overturning below which a path counts as far from it: the coarse scan does there."""

LARGEST_FACTOR = 5.0
"""Factor of a motion's own acceleration above which there is a caution."""


def jumps(paths: ScaledPaths, low: float, high: float) -> Array:
    """Scales at which what a path comes to changes, ascending: odd ones begin to overturn, even ones to stand.

    Parameters
    ----------
    paths : ScaledPaths
    low, high : float
        Range of scales, above 0. At the lowest a block has to stand; if it does not, that is the first jump.

    Returns
    -------
    ndarray, shape (k,)
        Each right to `EDGE`.
    """
    scales = np.append(low * np.exp(COARSE * np.arange(math.ceil(math.log(high / low) / COARSE))), high)
    found = paths(scales)
    while True:
        over, gap = found.overturned, np.diff(np.log(scales))
        jump, calm = over[1:] != over[:-1], np.maximum(found.peak[1:], found.peak[:-1]) < CALM * paths.cutoff
        split = np.where(jump, gap > EDGE, ~calm & (gap > FINE * (1.0 + 1e-9)))
        middles = np.sqrt(scales[1:] * scales[:-1])
        if not split.any():
            return np.append(low, middles[jump]) if over[0] else middles[jump]
        places = np.flatnonzero(split) + 1
        more = paths(middles[split])
        scales = np.insert(scales, places, middles[split])
        found = Outcomes(*(np.insert(old, places, new) for old, new in zip(found, more, strict=True)))


def overturns(jumps: Array, scales: ArrayLike) -> Array:
    """Whether a block overturns at scales (n,), by its jumps (m, k) with nan at their ends: (m, n)."""
    return (jumps[:, None, :] <= np.asarray(scales, float)[:, None]).sum(axis=-1) % 2 == 1


def first_scale(jumps: Array) -> Array:
    """Lowest scales (m,) from which blocks overturn over a part of `FINE` at least; inf where there is none."""
    begins = jumps[:, ::2]
    ends = np.full(begins.shape, math.inf)
    ends[:, : jumps.shape[1] // 2] = np.nan_to_num(jumps[:, 1::2], nan=math.inf)
    with np.errstate(invalid="ignore"):
        wide = ends >= math.exp(FINE) * begins
    return np.where(wide, begins, math.inf).min(axis=1, initial=math.inf)


class MotionOutcomes(NamedTuple):
    """What s scenes without noise come to over their scales, and at their own.

    Parameters
    ----------
    jumps : ndarray, shape (s, l + 1, k)
        Scales, ascending, from which a block overturns (the first, third, ...) or stands (the second, fourth, ...), nan
        behind the last; [:, 1:] from which it reaches each of l levels.
    peak : ndarray, shape (s,)
        Largest |Θ| = |θ|/θ_cr at scale 1; where the block overturns that of overturning.
    overturn_time : ndarray, shape (s,)
        Time τ of overturning at scale 1, nan where the block stands.
    overturn_side : ndarray, shape (s,)
        -1 (left) or 1 (right), 0 where it stands.
    """

    jumps: Annotated[Array, "f8 s l+1 k"]
    peak: Annotated[Array, "f8 s"]
    overturn_time: Annotated[Array, "f8 s"]
    overturn_side: Annotated[Array, "i1 s"]

    @property
    def critical(self) -> Array:
        """Lowest scale (s,) from which each scene overturns over 1 % at least; inf for one that does not."""
        return first_scale(self.jumps[:, 0])

    @classmethod
    def of(cls, values: Sequence[dict[str, Any]], curves: int = 1) -> "MotionOutcomes":
        """Return the outcomes of what `search` has returned for each scene and each of its curves, in this order."""
        own = values[::curves]
        rows = _padded([one.get("jumps", ()) for one in values])
        return cls(
            rows.reshape(len(own), curves, rows.shape[1]),
            np.array([one.get("peak") for one in own], float),
            np.array([one.get("overturn_time") for one in own], float),
            np.array([one.get("overturn_side", 0) for one in own], np.int8),
        )


def search(scene: Scene, *, seed: int, measure: str, highest: float, **lasting: Any) -> dict[str, Any]:  # noqa: ARG001  (a task has a seed)
    """Follow a scene without noise over its scales; return jumps, and what it comes to at its own scale, by name."""
    paths = ScaledPaths(scene, **lasting)
    (overturn_time,), (side,), (peak,) = paths([1.0])
    high = highest if measure == "scale" else highest / intensity_of(scene, measure)
    low = paths.least_scale or 1e-3 * high
    return {
        "jumps": jumps(paths, low, high).tolist() if low < high else [],
        "peak": float(peak),
        "overturn_time": None if math.isnan(overturn_time) else float(overturn_time),
        "overturn_side": int(side),
    }


def kernels_of(
    task: Callable[..., Any],  # noqa: ARG001  (as `tasks.kernels_of`)
    scenes: Iterable[Scene],
    options: dict[str, Any],  # noqa: ARG001
) -> list[str]:
    """Return the names in `base.precompilation` of the kernels of the paths of some scenes."""
    return sorted({task_of(engine_of(scene, "exact"), scene) for scene in scenes})


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class CriticalIntensities(Saved, Result):
    """At which intensity each of m motions overturns a block, and what it does at its own scale.

    Parameters
    ----------
    scenes : tuple of Scene, (m,)
        The block under each motion, at the motion's own scale.
    measure : str
        "PGA" (in g), "PGV" (in m/s), or "scale".
    highest : float
        Intensity up to which was searched.
    own : ndarray, shape (m,)
        Intensity of each motion at its own scale; 1 for "scale".
    jumps : ndarray, shape (m, k)
        Intensities, ascending, from which the block overturns (the first, third, ...) or stands (the second, fourth,
        ...), each right to 0.001 of it; nan behind the last one. Intervals narrower than 0.01 are met by chance.
    peak : ndarray, shape (m,)
        Largest |Θ| = |θ|/θ_cr at the motion's own scale; where the block overturns that of overturning.
    overturn_time : ndarray, shape (m,)
        Time τ of overturning at the motion's own scale, nan where the block stands.
    overturn_side : ndarray, shape (m,)
        -1 (left) or 1 (right), 0 where it stands.
    options : dict
        Cycles or times, as passed to `critical_intensities`.
    wall_s : float
        Seconds that the call took.

    Examples
    --------
    >>> from fpk_rocking import Scene
    >>> from fpk_rocking.studies import critical_intensities, synthetic_records
    >>> block = Scene.from_block(0.5, 1.8, "0.3 g", "1.5 Hz")
    >>> found = critical_intensities(block, synthetic_records(5, duration=5.0), highest=2.0)
    >>> print(found.critical.round(2), found.factor.round(1))
    [0.92 0.97 0.69 0.86 0.53] [2.8 4.2 1.8 3.5 2.1]
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

    @property
    def unit(self) -> str:
        """Unit of the intensity; empty for "scale"."""
        return "" if self.measure == "scale" else measure_of(self.measure).unit

    @functools.cached_property
    def critical(self) -> Array:
        """Critical intensity of each motion, (m,): the lowest from which the block overturns over 1 % at least.

        inf for a motion under which it stands up to `highest` (right-censored).
        """
        return first_scale(self.jumps)

    @property
    def factor(self) -> Array:
        """Critical scale: the critical intensity over the motion's own, (m,)."""
        return self.critical / self.own

    def overturned(self, intensity: ArrayLike) -> Array:
        """Whether each motion overturns the block at intensities.

        Parameters
        ----------
        intensity : array_like, shape (n,)
            Up to `highest`.

        Returns
        -------
        ndarray of bool, shape (m, n)
        """
        asked = checks.several("intensity", intensity, most=1_000_000, above=0.0, at_most=self.highest)
        return overturns(self.jumps, asked)

    @property
    def names(self) -> list[str]:
        """Names of the motions."""
        return motion_names(self.scenes)

    @property
    def remarks(self) -> tuple[str, ...]:
        """Sentences that a reader of this result needs: corrected baselines, and what is not to be trusted."""
        baseline = baseline_remark(scene.forcing for scene in self.scenes)
        return tuple(filter(None, dict.fromkeys((baseline, *(one.message for one in self.model_diagnostics())))))

    def model_diagnostics(self) -> list[Diagnostic]:
        """Diagnostics of the model, each once, and of motions that are scaled far."""
        ranges = [(1.0, max(1.0, most)) for most in (self.highest / self.own).tolist()]
        pairs = zip(self.scenes, ranges, strict=True)
        of_scenes = {one.kind: one for scene, scales in pairs for one in scene_diagnostics(scene, "", scales=scales)}
        return [*of_scenes.values(), *factor_diagnostics(self.factor)]

    @property
    def reason_if_ok(self) -> str:
        """Reason of the verdict "ok": each path is exact."""
        return EXACT_PATH

    @property
    def title(self) -> str:
        """How many motions overturn the block, and from which intensities."""
        reached = self.critical[np.isfinite(self.critical)]
        text = f"{reached.size} of {len(self.scenes)} motions overturn the block up to {self._text(self.highest)}"
        return text + f", the first at {self._text(reached.min())}" if reached.size else text

    def _text(self, intensity):
        """Return an intensity with its measure and unit."""
        return f"{self.measure} {intensity:.3g} {self.unit}".rstrip()

    def dataset(self) -> Dataset:
        """Return a row for each motion: own PGA, PGV and intensity, critical ones, and what it does at its own scale.

        "overturns_at" are all intervals of overturning as a text. Seconds and m/s are nan without block dimensions.
        """
        peaks = motion_table(self.scenes)
        return Dataset(
            {
                **{name: ("motion", peaks[name]) for name in ("pga_g", "pgv_m_per_s")},
                "own_intensity": ("motion", self.own),
                "critical_intensity": ("motion", self.critical),
                "critical_scale": ("motion", self.factor),
                "peak_rotation": ("motion", self.peak),
                "overturn_time": ("motion", self.overturn_time),
                "overturn_s": ("motion", seconds_of(self.scenes, self.overturn_time)),
                "overturn_side": ("motion", side_names(self.overturn_side)),
                "overturns_at": ("motion", np.array(list(map(intervals_text, self.jumps)), dtype=str)),
                "jump": (("motion", "number"), self.jumps),
            },
            {"motion": self.names, "number": np.arange(1, self.jumps.shape[1] + 1)},
            rows=("motion",),
        )

    def summary(self) -> dict[str, Any]:
        """Metadata, columns and jumps of each motion, verdict and remarks as plain values, for JSON."""
        found = [row[np.isfinite(row)].tolist() for row in self.jumps]
        return super().summary() | {"motion": self.names, "jumps": found}

    def plot(self) -> Any:
        """Draw the intervals of overturning of each motion, and its own intensity; returns a matplotlib figure."""
        order = np.argsort(self.critical, kind="stable")

        def panel(_, axes):
            """Draw a line for each motion, the weakest critical intensity lowest."""
            for place, number in enumerate(order):
                row = self.jumps[number][np.isfinite(self.jumps[number])]
                ends = np.append(row, self.highest) if row.size % 2 else row
                axes.hlines(np.full(ends.size // 2, place), ends[::2], ends[1::2], color=COLOURS[0], linewidth=2.0)
            axes.plot(self.own[order], range(len(order)), "|", color="black", label="own intensity")
            axes.set(
                xscale="log", xlabel=f"{self.measure} {self.unit}".rstrip() + " (bars: overturns)", ylabel="motion"
            )
            axes.legend(fontsize=8)

        return figure_of(panel)


def motion_table(scenes: Sequence[Scene], critical: CriticalIntensities | None = None) -> dict[str, Array]:
    """Return columns with a row for the motion of each scene: name, own PGA and PGV, and without noise what it does.

    Parameters
    ----------
    scenes : sequence of Scene, (m,)
        At the motions' own scales.
    critical : CriticalIntensities, optional
        Of these scenes: its table is returned.

    Returns
    -------
    dict of str to ndarray, (m,)
    """
    if critical is not None:
        return critical.table()
    measures = [measured(scene).columns(1.0) for scene in scenes]
    columns = {name: np.array([one[name] for one in measures]) for name in ("pga_g", "pgv_m_per_s")}
    return {"motion": np.array(motion_names(scenes))} | columns


def seconds_of(scenes: Sequence[Scene], times: Array) -> Array:
    """Return times τ (m,) of scenes in seconds, nan for a block without dimensions."""
    sizes = [scene.block.size for scene in scenes]
    pairs = zip(sizes, times.tolist(), strict=True)
    return np.array([math.nan if size is None else size.seconds(time) for size, time in pairs])


def side_names(sides: Array) -> Array:
    """Sides (m,) of overturning as texts: "left", "right", or "" for none."""
    return np.array(["", "right", "left"])[np.asarray(sides, int)]


def intervals_text(jumps: Array) -> str:
    """Return the intervals of overturning that lie between jumps (k,) as a text, as in "0.41-0.43; 0.5-"."""
    texts = [f"{one:.4g}" for one in jumps[np.isfinite(jumps)]]
    return "; ".join(f"{begin}-{end}" for begin, end in zip(texts[::2], [*texts[1::2], ""], strict=False))


def factor_diagnostics(factor: Array) -> list[Diagnostic]:
    """Return a caution in a list where motions overturn a block only if scaled far up; factors (m,), inf for none."""
    far = factor[np.isfinite(factor) & (factor > LARGEST_FACTOR)]
    if not far.size:
        return []
    sentence = (
        f"{far.size} of {factor.size} motions overturn the block at more than {LARGEST_FACTOR:g} times their own "
        f"strength, up to {far.max():.3g} times. Common advice is to scale a record by 4 or 5 at most (reviewed by "
        "Bommer and Acevedo, J. Earthquake Eng. 8(S1), 43-91, 2004): strong motions differ from weak ones in frequency "
        "content and duration, which no factor changes. Take stronger records."
    )
    return [Diagnostic(CAUTION, sentence, "large factors")]


def critical_intensities(
    scene: Scene | Sequence[Scene],
    motions: Sequence[Forcing | File] = (),
    *,
    highest: float,
    measure: str = "PGV",
    units: str | None = None,
    baseline: str | None = None,
    cycles: int | None = None,
    times: ArrayLike | None = None,
    workers: int | Executor = 1,
    store: File | None = None,
    progress: Progress | None = None,
) -> CriticalIntensities:
    """Find at which intensities of each motion a block overturns without noise.

    The search begins where the motion begins to lift the block off. It scans the logarithm of the intensity in steps of
    0.04, and of 0.01 wherever a neighbour overturns or comes to an eighth of the angle of overturning; each change is
    then halved to 0.001. Intervals of overturning or of standing that are narrower than 0.01 are met by chance: such
    outcomes are a fractal, and no scan has all of them. A record of 40 s takes half a second.

    Parameters
    ----------
    scene : Scene, or sequence of Scene
        The block, without noise and from a start that is a point; its forcing is replaced by each motion. Or a scene
        for each motion.
    motions : sequence of Record, str or pathlib.Path
        Motions, or files that `Record.from_file` reads.
    highest : float
        Largest intensity of the search, in the unit of the measure.
    measure : str
        "PGV" (in m/s), "PGA" (in g), or "scale" (the factor of the motion itself).
    units, baseline
        Of records, as for `fpk_rocking.risk.study`.
    cycles, times
        As for `montecarlo.simulate`: overturning counts until the last of them.
    workers, store, progress
        As for `fpk_rocking.studies.sweep`, with a motion for a scene.

    Returns
    -------
    CriticalIntensities

    Raises
    ------
    TypeError, ValueError, OSError
        A parameter or a file is refused, or a scene has noise.

    Examples
    --------
    >>> from fpk_rocking import Scene
    >>> from fpk_rocking.studies import critical_intensities, synthetic_records
    >>> block = Scene.from_block(0.5, 1.8, "0.3 g", "1.5 Hz")
    >>> found = critical_intensities(block, synthetic_records(5, duration=5.0), highest=2.0)
    >>> print(found.title)
    5 of 5 motions overturn the block up to PGV 2 m/s, the first at PGV 0.533 m/s
    """
    started = time.perf_counter()
    if isinstance(scene, Scene):
        scenes = tuple(recorded_scenes(scene, motions, units=units, baseline=baseline))
    elif motions:
        raise ValueError(checks.refusal("motions", motions, "nothing beside several scenes, which have their own"))
    else:
        scenes = checked_scenes("scene", scene)
    highest = checks.number("highest", highest, above=0.0)
    if measure != "scale":
        measure_of(measure)
    lasting: dict[str, Any] = {} if cycles is None else {"cycles": int(cycles)}
    lasting |= {} if times is None else {"times": np.asarray(times, float).tolist()}
    for number, one in enumerate(scenes):
        if not one.deterministic:
            accepted = "scenes without noise, whose start has no covariance"
            raise ValueError(checks.refusal(f"scene[{number}]", one, accepted))
        result_times(one, cycles, times)
    own = np.array([1.0 if measure == "scale" else intensity_of(one, measure) for one in scenes])
    jobs = [Job(number, one, 0) for number, one in enumerate(scenes)]
    options = {"measure": measure, "highest": highest} | lasting
    rows = run_jobs(search, jobs, options, kernels_of, workers=workers, store=store, progress=progress)
    failed = next((row for row in rows if row["reason"]), None)
    if failed:
        raise ValueError(f"motion {motion_names(scenes)[failed['cell']]}: {failed['reason']}")
    outcomes = MotionOutcomes.of([row["values"] for row in rows])
    return CriticalIntensities(
        scenes=scenes,
        measure=measure,
        highest=highest,
        own=own,
        jumps=outcomes.jumps[:, 0] * own[:, None],
        peak=outcomes.peak,
        overturn_time=outcomes.overturn_time,
        overturn_side=outcomes.overturn_side,
        options=options,
        wall_s=time.perf_counter() - started,
    )


def _padded(rows: Sequence[Array]) -> Array:
    """Return rows of numbers as one array (m, k), with nan behind the last number of a shorter row."""
    out = np.full((len(rows), max(map(len, rows), default=0)), math.nan)
    for row, values in zip(out, rows, strict=True):
        row[: len(values)] = values
    return out
