"""`probability`: with what probability a block overturns, to a wanted error, by the engine that gets there soonest."""

import dataclasses
import functools
import math
import sys
import time
from typing import Any

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import ArrayLike, Progress
from fpk_rocking.results.sampling import wilson_interval
from fpk_rocking.scene.scene import Scene
from fpk_rocking.studies.probability import (
    QUANTILE,
    Probability,
    SideCounts,
    SlowerError,
    WantedError,
    joined,
    stop_if_slow,
)
from montecarlo.engines.batches import checked_run, simulate_batches
from montecarlo.splitting import split

_PILOT = 1000
"""Paths before anything is predicted."""
_FEW, _FEW_S = 5, 1.0
"""Overturned paths below which their share is too uncertain to choose another way by, and seconds to find more."""
_SHORT_S = 1.0
"""Predicted seconds of paths below which nothing else is tried."""
_SPLITTING_S = 5.0
"""Predicted seconds of paths below which splitting is not tried: score and first walkers take 1 to 2 s."""
_TRIAL, _TRIAL_S = 0.1, 2.0
"""Part of `limit_s`, and the seconds if these are more, in which it has to be decided whether the limit is enough."""
_FINER = 2.0
"""Seconds of a density whose forcing does not repeat over those predicted, which leave finer solutions out."""
_LONG_S = 5.0
"""Predicted seconds from which on a call says how long it will take."""
_REPEATS, _STUDENT = 32, 2.0395
"""Repeats of splitting, and the 97.5 % point of Student's distribution of one degree of freedom less."""
_WALKERS, _PATHS_EACH = 100, 10
"""Walkers in each of the first repeats of splitting, and as how many plain paths each may count."""
_COARSER, _FEWER = 4, 4
"""How many times longer the steps are with which the error of an engine's steps is measured, and how many times fewer
the paths."""


def probability(
    scene: Scene,
    *,
    cycles: int | None = None,
    times: ArrayLike | None = None,
    tol: float | None = None,
    rtol: float | None = None,
    limit_s: float = 600.0,
    seed: int = 1,
    progress: Progress | None = None,
) -> Probability:
    """Estimate the probability that a block has overturned, to a wanted error, for the scene as it is.

    A scene without noise has one path. Else 1,000 paths are sampled first. From them the seconds are predicted that
    more paths take until the error is small enough, under white noise also those of the density (`solve_fpk`) and of
    splitting (`montecarlo.split`), and the shortest way is taken. The density is left where its first solutions take so
    much longer than predicted that paths are shorter. Band noise and filtered noise act as they are.

    Whether the limit is enough is decided within a tenth of it, or 2 s: where the first paths do not tell, more are
    sampled for so long, and the first repeats of splitting are as short.

    Paths are added in stages until half of the 95 % interval (Wilson's) is within the wanted error, each stage as long
    as the limits of the interval so far ask for. The interval at the end contains the probability in 94.8 % of
    repetitions or more, whatever the probability (benchmarks/probability.py). Where an engine has time steps, a quarter
    as many paths are sampled again with steps four times as long, and what these change beyond sampling is added to the
    error: for any order from 1/2 on the error of the shorter steps is smaller than that.

    Parameters
    ----------
    scene : Scene
        Block, forcing, noise, start and overturning.
    cycles : int, optional
        Number of forcing cycles. Required where the forcing repeats, refused where it does not.
    times : array_like, optional
        For a pulse or a record: ascending nondimensional times. By default 21 times over its duration, and 10 units of
        time after its end.
    tol : float, optional
        Wanted error (95 %) of the last probability, above 0. By default .005, unless `rtol` is given.
    rtol : float, optional
        Wanted error in parts of the probability, above 0. With both, the larger error is enough.
    limit_s : float
        Seconds that the call may take. Where more are predicted it is refused before the work begins.
    seed : int
        Seed of the random numbers, from 0 to 2**64 - 1.
    progress : callable, optional
        Called as ``progress(done, total)``.

    Returns
    -------
    Probability
        `overturned`, the probability by the last time, and its `error`; `left`, `right` and `errors` by row; `verdict`,
        `method`. After an interruption from the keyboard what the paths until then say.

    Raises
    ------
    TypeError, ValueError
        A parameter is refused, or the wanted error takes longer than `limit_s`.

    Examples
    --------
    >>> from fpk_rocking import load_scene, probability
    >>> answer = probability(load_scene("main"), cycles=4, tol=0.01)
    >>> print(f"{answer.overturned:.2f}")
    0.14
    """
    call = _Call.of(scene, cycles, times, tol, rtol, limit_s, seed, progress)
    if scene.deterministic:
        return call.one_path()
    return call.answer()


@dataclasses.dataclass
class _Call:
    """A call of `probability`: its checked parameters, and what it has learned so far."""

    run: Any
    wanted: WantedError
    limit_s: float
    progress: Progress | None
    began: float
    counts: SideCounts
    splitting_s: float | None = None

    @classmethod
    def of(cls, scene, cycles, times, tol, rtol, limit_s, seed, progress):
        """Return the `_Call` with parameters, those of `probability`; TypeError or ValueError for a wrong one."""
        began = time.perf_counter()
        run = checked_run(scene, cycles, _PILOT, seed, None, 200, progress, times)
        if tol is None and rtol is None:
            tol = 5e-3
        tol, rtol = (
            0.0 if value is None else checks.number(name, value, above=0.0)
            for name, value in (("tol", tol), ("rtol", rtol))
        )
        limit_s = limit_s if limit_s == math.inf else checks.number("limit_s", limit_s, above=0.0)
        return cls(run, WantedError(tol, rtol), limit_s, progress, began, SideCounts(run.times))

    def one_path(self):
        """Return the `Probability` of a scene in which nothing is random, by its one path."""
        (batch,) = simulate_batches(self.run._replace(realizations=1), progress=self.progress, followed=0)
        self.counts.add(batch)
        return self.result("one path", "Nothing is random: one path decides.", self.counts.sides, 0.0, 1)

    def answer(self):
        """Return the `Probability` of a scene with noise: sample, predict, and take the shortest way."""
        try:
            self.sample(_PILOT)
            begin = time.perf_counter()
            self.sample(2 * _PILOT)  # the first paths wait for machine code
            path_s = (time.perf_counter() - begin) / _PILOT
            if self.run.method != "exact":
                path_s *= 1.0 + 1.0 / _FEWER
            answer = None
            while not self.reached:
                if self._too_few(path_s):
                    self.sample(min(self._next_stage(), math.ceil(self._few_s / path_s)))
                    continue
                needed = self.wanted.paths(self.counts.overturned, self.counts.paths)
                seconds = (needed - self.counts.paths) * path_s
                if self._density_pays(seconds):
                    answer = self._density(seconds)
                elif self._splitting_pays(seconds):
                    answer = self._splitting(seconds, path_s)
                if answer:
                    return answer
                until = self._next_stage()
                if self._undecided(path_s):
                    until = min(until, math.ceil(self._trial_s / path_s))
                else:
                    self._announce(needed, seconds)
                self.sample(until)
            return self._from_paths()
        except KeyboardInterrupt:
            if not self.counts.paths:
                raise
            return self._from_paths(interrupted=True)

    @property
    def reached(self):
        """Whether the paths so far give the wanted error (bool)."""
        counts = self.counts
        return counts.half_widths[-1, 0] <= self.wanted.of(counts.overturned / counts.paths)

    def sample(self, until, counts=None, steps_per_cycle=None):
        """Simulate further paths until there are `until` in `counts`, a `SideCounts`, by default those of the call.

        `steps_per_cycle` (int): by default that of the run.
        """
        counts = self.counts if counts is None else counts
        run = self.run._replace(realizations=int(until))
        if steps_per_cycle:
            run = run._replace(steps_per_cycle=steps_per_cycle)
        followed = int(counts.returns[0])
        for batch in simulate_batches(run, first=counts.paths, progress=self.progress, followed=followed):
            counts.add(batch)

    @property
    def _trial_s(self):
        """Seconds in which it has to be decided whether the limit is enough."""
        return max(_TRIAL * self.limit_s, min(_TRIAL_S, self.limit_s))

    def _undecided(self, path_s):
        """Whether the limit may be enough or not by the paths so far, and time is left to sample more of them."""
        paths = self.counts.paths
        least, most = self.wanted.range_of_paths(self.counts.overturned, paths)
        affordable = paths + self.limit_s / path_s
        return least <= affordable < most and paths * path_s < self._trial_s

    def _too_few(self, path_s):
        """Whether so few paths have overturned that more are sampled before anything else is tried (bool)."""
        counts = self.counts
        few = counts.overturned < _FEW and 2.0 * counts.paths * path_s < self._few_s
        least, _ = self.wanted.range_of_paths(counts.overturned, counts.paths)
        return few and least <= counts.paths + self.limit_s / path_s

    @property
    def _few_s(self):
        """Seconds in which more overturned paths are looked for."""
        return min(_FEW_S, self._trial_s)

    def _next_stage(self):
        """Return how many paths (int) there are to be after the next stage."""
        return self.wanted.next_stage(self.counts.overturned, self.counts.paths)

    def _announce(self, needed, seconds):
        """Write on standard error that `needed` paths take `seconds`, if long; ValueError where above `limit_s`."""
        if seconds > self.limit_s:
            self._refuse(needed, seconds)
        if seconds > _LONG_S:
            sys.stderr.write(f"probability: about {float(f'{seconds:.1g}'):,.0f} s for {needed:,.0f} paths\n")

    def _refuse(self, needed, seconds):
        """Raise ValueError: the wanted error takes too long, `needed` paths or about `seconds`."""
        counts = self.counts
        high = wilson_interval(counts.overturned, counts.paths)[1]
        name = "tol" if self.wanted.tol else "rtol"
        least = "at least " * (not counts.overturned)
        paths = self.limit_s / seconds * needed
        share = max(counts.overturned, 1) / counts.paths
        within = QUANTILE * math.sqrt(share / paths)
        splitting = f", splitting about {self.splitting_s:.2g} s" if math.isfinite(self.splitting_s or math.inf) else ""
        raise ValueError(
            f"{name}: got {getattr(self.wanted, name):g}, which takes {least}{needed:.2g} paths, about {seconds:.2g} s"
            f"{splitting} "
            f"({counts.overturned} of {counts.paths:,} paths overturned, the probability is below {high:.2g}); "
            f"accepted: a larger limit_s (got {self.limit_s:g} s), or a larger error, as tol={within:.1g}"
        )

    def _from_paths(self, interrupted=False):
        """Return the `Probability` by the paths so far; its errors contain that of the engine's time steps.

        `interrupted`: whether the call was interrupted, after which that error is not measured.
        """
        counts, errors, engine = self.counts, self.counts.half_widths, self.run.method
        reason = f"Paths under the noise as it is reach the wanted error soonest ({engine} engine)."
        if engine != "exact" and not interrupted:
            coarse = SideCounts(self.run.times)
            self.sample(max(counts.paths // _FEWER, _PILOT), coarse, max(8, self.run.steps_per_cycle // _COARSER))
            change = np.abs(coarse.columns / coarse.paths - counts.columns / counts.paths)
            errors = errors + np.maximum(change - math.sqrt(1.0 + _FEWER) * errors, 0.0)
            reason += f" Steps {_COARSER} times as long change the last probability by {change[-1, 0]:.1g}."
        return self.result("paths", reason, counts.sides / counts.paths, errors, counts.paths, interrupted)

    @property
    def _share(self):
        """Share (float) of the paths so far that has overturned, at least one of them."""
        return max(self.counts.overturned, 1) / self.counts.paths

    @functools.cached_property
    def _solutions_s(self):
        """List of the predicted seconds of each solution of the density; [inf] if it cannot do this scene or error."""
        from fpk_rocking.density.solver import predicted_seconds

        scene, tol = self.run.scene, self.wanted.of(self._share)
        if scene.noise.kind != "white" or tol < 1e-4 or tol > 0.1:
            return [math.inf]
        try:
            predicted = predicted_seconds(scene, tol=tol, **self._rows)
        except ValueError:
            return [math.inf]
        return [seconds if scene.repeats else _FINER * seconds for seconds in predicted]

    def _density_pays(self, paths_s):
        """Whether the density, not yet tried, is predicted to take less time than paths, `paths_s` seconds (bool)."""
        return paths_s > _SHORT_S and sum(self._solutions_s) < min(paths_s, self.limit_s)

    def _density(self, paths_s):
        """Return the `Probability` by the density, or None.

        None if it is not accurate enough, not that of the paths so far, or slower than predicted, and so than paths,
        which take `paths_s` seconds.
        """
        from fpk_rocking.density.solver import solve_fpk

        counts, tol, predicted = self.counts, self.wanted.of(self._share), self._solutions_s
        self._solutions_s = [math.inf]  # once
        watch = stop_if_slow(predicted, min(paths_s, self.limit_s), len(self.run.times) - 1, self.progress)
        try:
            density = solve_fpk(self.run.scene, tol=tol, bins_tol=math.inf, progress=watch, **self._rows)
        except (ValueError, SlowerError):  # the first: no mesh resolves this scene
            return None
        error = density.error_estimate
        difference = abs(density.survival[-1] - 1.0 + counts.overturned / counts.paths)
        if error > tol or difference > error + 2.0 * counts.half_widths[-1, 0]:
            return None
        reason = f"The density was predicted to take {sum(predicted):.1g} s, paths {paths_s:.1g} s."
        return self.result("density", reason, np.asarray(density.overturned), error, 0)

    def _splitting_pays(self, paths_s):
        """Whether to try splitting: it takes the scene, overturning is rare, and paths take long, `paths_s` seconds."""
        scene = self.run.scene
        rare = self.wanted.of(self._share) < self._share < 0.02
        white = scene.repeats and scene.noise.kind == "white"
        return paths_s > _SPLITTING_S and rare and white and self.splitting_s is None

    def _splitting(self, paths_s, path_s):
        """Return the `Probability` by splitting; None where it would take longer than the limit, or than paths.

        Paths of `path_s` seconds each take `paths_s` seconds. Walkers are added to each repeat, and its estimates
        averaged, until the error is small enough. What is still predicted once the first ones tell it has to be within
        the limit, later within twice as much.
        """
        walkers, spent = int(min(_WALKERS, self._trial_s / (_REPEATS * _PATHS_EACH * path_s))), 0.0
        self.splitting_s = math.inf
        # Of an event that few paths saw, what plain paths take is a lower bound.
        limit = min(self.limit_s, paths_s) if self.counts.overturned > 4 else self.limit_s
        split_scene = functools.partial(split, self.run.scene, progress=self.progress, **self._rows)
        try:
            if walkers < 10:
                return None
            split_scene(walkers=10, repeats=2)  # makes the score, which serves the others
            total = None
            while True:
                began = time.perf_counter()
                seed = (self.run.seed + (total.walkers if total else 0)) % 2**64
                total = joined(total, split_scene(walkers=walkers, repeats=_REPEATS, seed=seed))
                spent += time.perf_counter() - began
                last = float(total.probability[-1])
                error, wanted = _STUDENT * float(total.standard_error[-1]), self.wanted.of(last)
                if last and error <= wanted and not total.skewed:
                    break
                more = max(1.2 * (error / wanted) ** 2, 1.2) if last else math.inf
                self.splitting_s = (more - 1.0) * spent
                if not total.skewed or spent > self._trial_s:
                    if self.splitting_s > limit:
                        return None
                    limit = 2.0 * self.limit_s
                walkers = math.ceil(total.walkers * (min(more, 4.0) if total.skewed else more) - total.walkers)
        except ValueError:  # more walkers than memory holds
            return None
        sides = total.repeat_overturned
        columns = np.concatenate([sides.sum(axis=2, keepdims=True), sides], axis=2)
        errors = _STUDENT * columns.std(axis=0, ddof=1) / math.sqrt(_REPEATS)
        reason = f"Overturning is rare: plain paths were predicted to take {paths_s:.1g} s."
        return self.result("splitting", reason, total.overturned, errors, _REPEATS * total.walkers)

    @property
    def _rows(self):
        """A dict, "cycles" (their number) or "times" (rows,), keyword arguments of the functions that solve a scene."""
        cycles = self.run.scene.period is not None
        return {"cycles": len(self.run.times) - 1} if cycles else {"times": self.run.times[1:]}

    def result(self, method, reason, sides, errors, realizations, interrupted=False):
        """Return the `Probability` by a method.

        `method`, `reason`, `realizations` and `interrupted` are its fields. `sides` (rows, 2): probability of having
        overturned to the left and to the right; `errors`: (rows, 3), of survival and of these, or a number for all.
        """
        left, right = np.asarray(sides, dtype=float).T.copy()
        errors = np.broadcast_to(errors, (len(left), 3)).astype(float)
        if self.run.scene.start.covariance is None:
            errors[0] = 0.0  # nothing has happened yet
        return Probability(
            scene=self.run.scene,
            times=self.run.times.astype(float),
            left=left,
            right=right,
            errors=errors,
            method=method,
            engine="" if method == "density" else self.run.method,
            reason=reason,
            tol=self.wanted.tol,
            rtol=self.wanted.rtol,
            returns=self.counts.returns,
            realizations=realizations,
            seed=self.run.seed,
            interrupted=interrupted,
            seconds=time.perf_counter() - self.began,
        )
