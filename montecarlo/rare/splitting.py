"""`split`: probabilities of rare overturning under white noise, by adaptive multilevel splitting."""

import concurrent.futures
import dataclasses
import functools
import math
import time
from typing import Any

import numba
import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.types import Array, Progress
from fpk_rocking.physics.envelope import refuse_envelope
from fpk_rocking.physics.forcing import refuse_transient
from fpk_rocking.results.remarks import doubts
from fpk_rocking.results.shown import Shown
from fpk_rocking.results.trust import CAUTION, UNUSABLE, Doubt, Trust, trust_of
from fpk_rocking.scene.scene import Scene
from montecarlo.engines import running
from montecarlo.engines.random import stream_keys
from montecarlo.engines.white import problem_of
from montecarlo.rare import branching
from montecarlo.rare.prospects import prospects_of

_FEWEST_WALKERS = 10
_FEWEST_REPEATS = 2
_USUAL_REPEATS = 20
_SKEWED = 0.5
"""Part of the repeats that have to be effective."""

_STATES = 2**26
_INTERVALS = 2000
_UNBRANCHED = {
    "band": "a Shinozuka path is fixed at τ = 0 and cannot branch; scene.white_equivalent() has white noise instead",
    "filtered": "branches would need the filter's states; scene.white_equivalent() has white noise instead",
    "none": "without noise there is one path alone and nothing to branch",
}


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Splitting(Shown):
    """Estimates of overturning by independent repeats of adaptive multilevel splitting; nondimensional.

    Each repeat, and so their mean, is unbiased for P(overturned by kT) at every cycle k and to either side, for any
    number of walkers: its expectation is what `simulate` with method "white" has at the same `steps_per_cycle`. A
    function of it, such as a rate or its logarithm, is not. `standard_error` is estimated from the repeats; where they
    are `skewed` both it and the mean are probably too small.

    Parameters
    ----------
    scene : Scene
        As it was asked for.
    walkers : int
        Paths that climb together in each repeat.
    seed : int
        With a repeat's number and the walkers, all that its random numbers depend on.
    steps_per_cycle : int
        As it was asked for.
    wall_s : float
        Seconds that the splitting took, compilation included.
    repeat_overturned : ndarray, shape (repeats, cycles + 1, 2)
        Each repeat's estimate of P(overturned by kT) to the left and to the right.
    levels, killed : ndarray of int, shape (repeats,)
        Levels that each repeat passed, and walkers that it killed at them.
    """

    scene: Scene
    walkers: int
    seed: int
    steps_per_cycle: int
    wall_s: float
    repeat_overturned: np.ndarray
    levels: np.ndarray
    killed: np.ndarray

    def __post_init__(self):
        for name in ("repeat_overturned", "levels", "killed"):
            getattr(self, name).flags.writeable = False

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
        """P(overturned by kT) to the left and to the right, shape (cycles + 1, 2)."""
        return self.repeat_overturned.mean(axis=0)

    @functools.cached_property
    def repeat_probability(self) -> Array:
        """Each repeat's estimate of P(overturned by kT), shape (repeats, cycles + 1)."""
        return self.repeat_overturned.sum(axis=2)

    @property
    def probability(self) -> Array:
        """P(overturned by kT), shape (cycles + 1,)."""
        return self.repeat_probability.mean(axis=0)

    @property
    def survival(self) -> Array:
        """P(not overturned by kT), shape (cycles + 1,)."""
        return 1.0 - self.probability

    @property
    def standard_error(self) -> Array:
        """Standard error of `probability` and of `survival`, shape (cycles + 1,)."""
        return self.repeat_probability.std(axis=0, ddof=1) / math.sqrt(self.repeats)

    @property
    def effective_repeats(self) -> Array:
        """(Σp)²/Σp² over the repeats' estimates p, shape (cycles + 1,).

        All the repeats where they agree, 1 where one of them outweighs the rest, 0 where none saw an overturning.
        """
        squares = (self.repeat_probability**2).sum(axis=0)
        total = self.repeat_probability.sum(axis=0) ** 2
        return np.divide(total, squares, out=np.zeros_like(total), where=squares > 0.0)

    @property
    def extinct(self) -> int:
        """Number of repeats that lost all walkers; their estimates are 0, which the mean needs to be unbiased."""
        return int(np.count_nonzero(self.repeat_probability[:, -1] == 0.0))

    @property
    def skewed(self) -> bool:
        """Whether at the last cycle less than half of the repeats are effective: take more walkers, then ask again."""
        return bool(self.effective_repeats[-1] < _SKEWED * self.repeats)

    closure = ""
    averaged = False

    @property
    def facts(self) -> dict[str, Any]:
        """What it says of itself, as plain values; "relative_error" is that of the last probability, if it is not 0."""
        names = "walkers", "repeats", "extinct", "skewed", "seed", "steps_per_cycle", "wall_s"
        found, last = {name: getattr(self, name) for name in names}, float(self.probability[-1])
        return found | ({"relative_error": float(self.standard_error[-1]) / last} if last else {})

    @functools.cached_property
    def trust(self) -> Trust:
        """Whether to use it: a verdict and its reasons, see `fpk_rocking.results.trust`."""
        found = doubts(self)
        if self.skewed:
            few = (
                f"Skewed: {self.effective_repeats[-1]:.1f} of {self.repeats} repeats are effective; take more walkers."
            )
            found.append(Doubt(UNUSABLE, few))
        if self.repeats < _USUAL_REPEATS:
            few = f"{self.repeats} repeats: {_USUAL_REPEATS} or more are wanted for a standard error."
            found.append(Doubt(CAUTION, few))
        return trust_of(self.facts, found)

    @property
    def headline(self) -> str:
        """What it found, in a few words."""
        error = f"{self.probability[-1]:.3g} ± {self.standard_error[-1]:.1g}"
        return f"P(overturned) {error} after {self.cycles} cycles, {self.repeats} repeats of {self.walkers:,} walkers"

    def columns(self) -> dict[str, Array]:
        """Probability of having overturned and its standard error by cycle: arrays by name."""
        sides = dict(zip(("overturned_left", "overturned_right"), self.overturned.T, strict=True))
        cycle = np.arange(self.cycles + 1)
        return {"cycle": cycle, "probability": self.probability, "standard_error": self.standard_error} | sides

    def grids(self) -> tuple[dict[str, Any], dict[str, Any]]:
        """Arrays by name and coordinates for `to_xarray`."""
        variables = {name: ("cycle", getattr(self, name)) for name in ("probability", "standard_error")}
        variables["repeat_overturned"] = ("repeat", "cycle", "side"), self.repeat_overturned
        variables |= {name: ("repeat", getattr(self, name)) for name in ("levels", "killed")}
        return variables, {"cycle": np.arange(self.cycles + 1), "side": ["left", "right"]}

    def plot(self) -> Any:
        """Draw the probability of having overturned, with two standard errors; returns a matplotlib figure."""
        from fpk_rocking.results.pictures import figure_of

        def probability(_, axes):
            from matplotlib.ticker import MaxNLocator

            axes.xaxis.set_major_locator(MaxNLocator(integer=True))
            seen = self.probability > 0.0
            bars = 2.0 * self.standard_error[seen]
            label = "two standard errors"
            axes.errorbar(np.flatnonzero(seen), self.probability[seen], bars, marker="o", markersize=4.0, label=label)
            axes.set(xlabel="forcing cycles", ylabel="P(overturned)", yscale="log" if seen.any() else "linear")
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
    """Estimate the probability of rare overturning under white noise, cycle by cycle, by splitting paths.

    Paths that come nearer to overturning than others are continued several times, from there on, and the others are
    given up: `rare.levels` has the algorithm, `rare.prospects` the measure of nearness. Where plain
    paths need 1/p of them to see a probability p once, a repeat simulates `walkers` (1 + ln(1/p)) or so at most.

    Parameters
    ----------
    scene : Scene
        With white noise and a restitution above exp(-π/√3).
    cycles : int
        Forcing cycles, at least 1; what is rare is overturning by the last of them.
    walkers : int
        At least 10. Where the repeats are skewed, more walkers help and more repeats hardly.
    repeats : int
        Independent repeats, at least 2; 20 or more for a standard error worth its name.
    seed : int
        From 0 to 2**64 - 1.
    steps_per_cycle : int
        At least 8; no step is shorter than a 256th of a cycle over this number.
    progress : callable, optional
        Called as ``progress(done, total)`` between repeats; may raise.

    Returns
    -------
    Splitting

    Raises
    ------
    TypeError, ValueError
        A parameter is refused; so are scenes with band noise or none, whose paths cannot branch, and cycles so long
        that the prospects over them would take hundreds of megabytes.
    """
    started = time.perf_counter()
    checks.instance("scene", scene, Scene)
    if scene.noise.kind in _UNBRANCHED:
        raise ValueError(checks.refusal("noise.kind", scene.noise.kind, f"'white': {_UNBRANCHED[scene.noise.kind]}"))
    refuse_transient(scene.forcing, "splitting")
    refuse_envelope(scene.noise, "splitting")
    walkers = _at_least("walkers", walkers, _FEWEST_WALKERS)
    repeats = _at_least("repeats", repeats, _FEWEST_REPEATS)
    run = running.checked(scene, cycles, repeats, seed, "white", steps_per_cycle, progress)
    problem, keys = problem_of(scene, run.steps_per_cycle), stream_keys(run.seed)
    if problem.low.size > _INTERVALS:
        accepted = f"a cycle of {_INTERVALS} intervals or fewer for `split`, {problem.span:.2g} each"
        raise ValueError(checks.refusal("forcing.frequency", scene.forcing.frequency, accepted))
    _refuse_large("walkers", walkers, run.rows * problem.low.size)
    _refuse_large("repeats", repeats, run.rows)
    prospects = prospects_of(scene, problem.low.size)
    overturned = np.zeros((repeats, run.rows + 1, 2))
    levels, killed = np.empty((2, repeats), np.int64)
    pool = concurrent.futures.ThreadPoolExecutor(numba.get_num_threads())
    try:
        common = keys, walkers, problem, prospects
        counts = pool.map(lambda r: branching.realize(r, *common, overturned[r]), range(repeats))
        for r, (levels[r], killed[r]) in enumerate(counts):
            if progress is not None:
                progress(r + 1, repeats)
    finally:
        pool.shutdown(cancel_futures=True)
    if not np.all(np.isfinite(overturned)):
        raise FloatingPointError(f"repeat_overturned: has a number that is not finite; this must not be, in {scene}")
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
    """Refuse more states than 2.5 GiB hold, `each` of a number of walkers or repeats."""
    if number * (each + 1) > _STATES:
        raise ValueError(checks.refusal(name, number, f"at most {_STATES // (each + 1)} with {each} steps of a path"))


def _at_least(name, value, least):
    value = checks.count(name, value)
    if value < least:
        raise ValueError(checks.refusal(name, value, f"a whole number >= {least}"))
    return value
