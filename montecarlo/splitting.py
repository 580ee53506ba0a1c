"""`split`: probabilities of rare overturning under white noise, by adaptive multilevel splitting."""

import concurrent.futures
import dataclasses
import functools
import math
import time
from typing import Annotated, Any, ClassVar

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array, Progress
from fpk_rocking.base.jit import thread_count
from fpk_rocking.physics.forcing import refuse_transient
from fpk_rocking.physics.noise.kinds import refuse_envelope
from fpk_rocking.results.result import Result
from fpk_rocking.results.trust import CAUTION, UNUSABLE, Diagnostic
from fpk_rocking.scene.scene import Scene
from montecarlo.engines.batches import checked_run
from montecarlo.engines.random import stream_keys
from montecarlo.engines.walkers import score_table, simulate_splitting
from montecarlo.engines.white import parameters_of
from montecarlo.tuning import TUNING

_USUAL_REPEATS = 20
_SKEWED = 0.5
"""Repeats for a standard error, and the part of them that has to be effective."""


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Splitting(Result):
    """Probabilities of rare overturning, from independent repeats of adaptive multilevel splitting.

    The estimate of every repeat is unbiased for any number of walkers: its expectation is that of `simulate` with the
    method "white". A nonlinear function of it, such as the logarithm, is biased. Where the repeats are `skewed`, the
    mean and its error are probably too small.

    Parameters
    ----------
    scene, walkers, seed, steps_per_cycle
        As given to `split`.
    wall_s : float
        Seconds that the call took, compilation included.
    repeat_overturned : ndarray, shape (repeats, cycles + 1, 2)
        Estimates of each repeat: probability of having overturned by kT to the left and to the right.
    levels, killed : ndarray of int, shape (repeats,)
        Number of levels that each repeat passed, and of paths that it gave up.
    """

    kind: ClassVar = "splitting"
    scene: Scene
    walkers: int
    seed: int
    steps_per_cycle: int
    wall_s: float
    repeat_overturned: Annotated[Array, "f8 repeat cycle side"]
    levels: Annotated[Array, "i8 repeat"]
    killed: Annotated[Array, "i8 repeat"]

    row_dims = ("cycle",)
    more_metadata = ("repeats", "extinct", "skewed")

    @property
    def repeats(self) -> int:
        """Number of independent repeats."""
        return self.repeat_overturned.shape[0]

    @property
    def cycles(self) -> int:
        """Number of forcing cycles."""
        return self.repeat_overturned.shape[1] - 1

    @property
    def overturned(self) -> Array:
        """Probability of having overturned to the left and to the right, (cycles + 1, 2)."""
        return self.repeat_overturned.mean(axis=0)

    @functools.cached_property
    def repeat_probability(self) -> Array:
        """Estimates of each repeat of `probability`, (repeats, cycles + 1)."""
        return self.repeat_overturned.sum(axis=2)

    @property
    def probability(self) -> Array:
        """Probability of having overturned after each cycle, (cycles + 1,)."""
        return self.repeat_probability.mean(axis=0)

    @property
    def survival(self) -> Array:
        """Probability of not having overturned after each cycle, (cycles + 1,)."""
        return 1.0 - self.probability

    @property
    def standard_error(self) -> Array:
        """Standard error of `probability` by the scatter of the repeats, (cycles + 1,)."""
        return self.repeat_probability.std(axis=0, ddof=1) / math.sqrt(self.repeats)

    @property
    def effective_repeats(self) -> Array:
        """Effective number of repeats, (Σp)²/Σp² over their estimates p, (cycles + 1,); 0 where none overturned."""
        squares = (self.repeat_probability**2).sum(axis=0)
        total = self.repeat_probability.sum(axis=0) ** 2
        return np.divide(total, squares, out=np.zeros_like(total), where=squares > 0.0)

    @property
    def extinct(self) -> int:
        """Number of repeats that lost all paths. Their estimates are 0 and count in the mean."""
        return int(np.count_nonzero(self.repeat_probability[:, -1] == 0.0))

    @property
    def skewed(self) -> bool:
        """Whether less than half of the repeats are effective at the last cycle: more walkers are then needed."""
        return bool(self.effective_repeats[-1] < _SKEWED * self.repeats)

    @property
    def relative_error(self) -> float | None:
        """Standard error of the last probability over this probability; None where it is 0."""
        last = float(self.probability[-1])
        return float(self.standard_error[-1]) / last if last else None

    def model_diagnostics(self) -> list[Diagnostic]:
        """Diagnostics of the model, and of the number of walkers and repeats."""
        diagnostics = super().model_diagnostics()
        if self.skewed:
            few = (
                f"Few repeats dominate the mean: {self.effective_repeats[-1]:.1f} of {self.repeats} are effective, "
                f"less than {_SKEWED:g} of them, so it is probably too small; take more walkers."
            )
            diagnostics.append(Diagnostic(UNUSABLE, few, "skewed"))
        if self.repeats < _USUAL_REPEATS:
            few = f"{self.repeats} repeats are few for a standard error; take {_USUAL_REPEATS} or more."
            diagnostics.append(Diagnostic(CAUTION, few, "few repeats"))
        return diagnostics

    @property
    def title(self) -> str:
        """The last probability with its standard error, as a line of text."""
        error = f"{self.probability[-1]:.3g} ± {self.standard_error[-1]:.1g}"
        return f"P(overturned) {error} after {self.cycles} cycles, {self.repeats} repeats of {self.walkers:,} walkers"

    def derived(self) -> dict[str, Any]:
        """Probability with its standard error, and to either side, after each cycle."""
        return {
            "probability": ("cycle", self.probability),
            "standard_error": ("cycle", self.standard_error),
            "overturned": ("cycle side", self.overturned),
        }

    def plot(self) -> Any:
        """Draw the probability of having overturned with two standard errors: a matplotlib figure."""
        from fpk_rocking.results.pictures import figure_of

        def probability(_, axes):
            from matplotlib.ticker import MaxNLocator

            axes.xaxis.set_major_locator(MaxNLocator(integer=True))
            rows = np.flatnonzero(self.probability > 0.0)
            bars = 2.0 * self.standard_error[rows]
            label = "two standard errors"
            axes.errorbar(rows, self.probability[rows], bars, marker="o", markersize=4.0, label=label)
            axes.set(xlabel="forcing cycles", ylabel="P(overturned)", yscale="log" if rows.size else "linear")
            axes.legend(fontsize=8)

        return figure_of(probability)


def split(
    scene: Scene,
    *,
    cycles: int,
    walkers: int = 1000,
    repeats: int = 32,
    seed: int = 1,
    steps_per_cycle: int = 200,
    progress: Progress | None = None,
) -> Splitting:
    """Estimate the probability of rare overturning under white noise by adaptive multilevel splitting.

    Paths that come nearer to overturning than others are continued several times from there, and the others are given
    up. Plain simulation needs 1/p paths to see an event of probability p once; a repeat simulates about `walkers` (1 +
    ln(1/p)).

    Parameters
    ----------
    scene : Scene
        With white noise (`Scene.white_equivalent` makes it), a restitution above exp(-π/√3) and a cycle that is not so
        long that the work would take hundreds of megabytes, else ValueError.
    cycles : int
        Number of forcing cycles, at least 1. Splitting works towards overturning by the last of them.
    walkers : int
        Number of paths in each repeat, at least 10. If the repeats are skewed, take more walkers, not more repeats.
    repeats : int
        Number of independent repeats, at least 2; a standard error needs 20 or more.
    seed, steps_per_cycle, progress
        As for `simulate`; progress between repeats.

    Examples
    --------
    >>> from fpk_rocking import load_scene
    >>> from montecarlo import split
    >>> weak = load_scene("main").varied(noise={"variance": 0.03}).white_equivalent()
    >>> rare = split(weak, cycles=2, walkers=200, repeats=20)
    >>> print(f"{rare.probability[2]:.5f} ± {rare.standard_error[2]:.5f}")
    0.00074 ± 0.00012
    """
    started = time.perf_counter()
    checks.instance("scene", scene, Scene)
    unbranched = {
        "band": "band noise is drawn at τ = 0 for a whole path and cannot branch; scene.white_equivalent() replaces it",
        "filtered": "the states of a filter are not branched; scene.white_equivalent() replaces the filtered noise",
        "none": "without noise there is only one path",
    }
    if scene.noise.kind in unbranched:
        raise ValueError(checks.refusal("noise.kind", scene.noise.kind, f"'white': {unbranched[scene.noise.kind]}"))
    refuse_transient(scene.forcing, "splitting")
    refuse_envelope(scene.noise, "splitting")
    walkers = checks.count("walkers", walkers, at_least=10)
    repeats = checks.count("repeats", repeats, at_least=2)
    run = checked_run(scene, cycles, repeats, seed, "white", steps_per_cycle, progress)
    parameters, keys = parameters_of(scene, run.steps_per_cycle), stream_keys(run.seed)
    if parameters.grid.count > TUNING.splitting_intervals:
        most = TUNING.splitting_intervals
        accepted = f"a cycle of {most} intervals or fewer for `split`, {parameters.grid.spacing:.2g} each"
        forcing: Any = scene.forcing  # it repeats, so it has a frequency
        raise ValueError(checks.refusal("forcing.frequency", forcing.frequency, accepted))
    _refuse_large("walkers", walkers, run.rows * parameters.grid.count)
    _refuse_large("repeats", repeats, run.rows)
    scores = score_table(scene, parameters.grid.count)
    overturned = np.zeros((repeats, run.rows + 1, 2))
    levels, killed = np.empty((2, repeats), np.int64)
    pool = concurrent.futures.ThreadPoolExecutor(thread_count())
    try:
        common = keys, walkers, parameters, scores
        counts = pool.map(lambda r: simulate_splitting(r, *common, overturned[r]), range(repeats))
        for r, (levels[r], killed[r]) in enumerate(counts):
            if progress is not None:
                progress(r + 1, repeats)
    finally:
        pool.shutdown(cancel_futures=True)
    if not np.all(np.isfinite(overturned)):
        raise FloatingPointError(
            f"repeat_overturned: got a number that is not finite, an error of the engine in {scene}"
        )
    return Splitting(
        scene=scene,
        walkers=walkers,
        seed=run.seed,
        steps_per_cycle=run.steps_per_cycle,
        wall_s=time.perf_counter() - started,
        repeat_overturned=overturned,
        levels=levels,
        killed=killed,
    )


def _refuse_large(name, number, each):
    """Refuse walkers of `each` steps, or repeats of `each` cycles, that would take over 2.5 GiB."""
    if number * (each + 1) > TUNING.splitting_states:
        raise ValueError(
            checks.refusal(name, number, f"at most {TUNING.splitting_states // (each + 1)} with {each} steps of a path")
        )
