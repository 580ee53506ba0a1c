"""`probability`: with what probability a block overturns, to a wanted error, by the engine that gets there soonest.

The result; how many paths a wanted error takes; what the paths so far say of the work to come; and the ways: paths, the
density, splitting.
"""

import dataclasses
import functools
import math
import statistics
import sys
import time
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array, ArrayLike, Progress
from fpk_rocking.results.remarks import EXACT_PATH
from fpk_rocking.results.returns import return_diagnostics
from fpk_rocking.results.sampling import wilson_interval
from fpk_rocking.results.survival import RowResult
from fpk_rocking.results.trust import CAUTION, UNUSABLE, USELESS, Diagnostic
from fpk_rocking.scene.scene import Scene
from montecarlo.engines.batches import Run, checked_run, simulate_batches
from montecarlo.splitting import Splitting, split

PILOT = 1000
"""Paths before anything is predicted."""
QUANTILE = statistics.NormalDist().inv_cdf(0.975)
"""97.5 % point of the standard normal distribution."""
GROWTH = 16
"""How many times more paths may follow before what is needed is predicted anew."""
REPEATS, STUDENT = 32, 2.0395
"""Repeats of splitting, and the 97.5 % point of Student's distribution of one degree of freedom less."""
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
_WALKERS, _PATHS_EACH = 100, 10
"""Walkers in each of the first repeats of splitting, and as how many plain paths each may count."""
_COARSER, _FEWER = 4, 4
"""How many times longer the steps are with which the error of an engine's steps is measured, and how many times fewer
the paths."""


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Probability(RowResult):
    """Probability of overturning with its error, after each cycle or at each of the times; see `probability`.

    Parameters
    ----------
    scene : Scene
    times : ndarray, shape (rows,)
        Nondimensional, from 0 on; whole cycles where the forcing repeats.
    left, right : ndarray, shape (rows,)
        Probability of having overturned to either side.
    errors : ndarray, shape (rows, 3)
        Errors of the survival, of `left` and of `right`: for a sample half of the 95 % interval plus the measured error
        of its time steps, for a density the estimated error.
    method : {"one path", "paths", "density", "splitting"}
    engine, reason : str
        The Monte Carlo method, empty for a density; and why `method` was taken, as a sentence.
    tol, rtol : float
        Wanted error of the last probability, absolute and relative; 0 where none was given.
    returns : ndarray of int, shape (2,)
        Number of overturned paths that were followed further to the fall, 90 degrees, and of those that came back.
    realizations : int
        Number of paths, or of walkers in all repeats of splitting; 0 for a density.
    seed : int
    interrupted : bool
        Whether the result is that of the paths until an interruption.
    seconds : float
        Seconds of the call, with compilation.
    """

    kind: ClassVar = "probability"
    scene: Scene
    times: Annotated[Array, "f8 time"]
    left: Annotated[Array, "f8 time"]
    right: Annotated[Array, "f8 time"]
    errors: Annotated[Array, "f8 time 3"]
    method: str
    engine: str
    reason: str
    tol: float
    rtol: float
    returns: Annotated[Array, "i8 2"]
    realizations: int
    seed: int
    interrupted: bool
    seconds: float

    @property
    def survival(self) -> Array:
        """Probability of not having overturned, shape (rows,)."""
        return 1.0 - self.left - self.right

    @property
    def overturned(self) -> float:
        """Probability of having overturned by the last time."""
        return float(self.left[-1] + self.right[-1])

    @property
    def error(self) -> float:
        """Error of `overturned`: half of its 95 % interval, or the estimate of a density."""
        return float(self.errors[-1, 0])

    @property
    def verdict(self) -> str:
        """The verdict of `trust`: "ok", "caution" or "do not use"."""
        return self.trust.verdict

    @property
    def wanted(self) -> float:
        """The wanted error: `tol`, or `rtol` times the probability where that is larger."""
        return WantedError(self.tol, self.rtol).of(self.overturned)

    @property
    def reason_if_ok(self) -> str:
        """Reason of the verdict "ok", a sentence, where nothing is random in the scene; else empty."""
        return EXACT_PATH if self.method == "one path" else ""

    @property
    def diagnostics(self) -> list[Diagnostic]:
        """Diagnostics of the model, of blocks that come back, of the error, and of an interruption."""
        diagnostics = self.model_diagnostics()
        diagnostics += return_diagnostics(self.scene, self.overturned, self.error, self.returns)
        if self.interrupted:
            diagnostics.append(Diagnostic(CAUTION, "The call was interrupted before it was done.", "interrupted"))
        if self.method == "one path":
            return diagnostics
        text = f"The error of P(overturned) is {self.error:.2g} ({self._level})"
        if self.error <= self.wanted:
            return [*diagnostics, Diagnostic(0, f"{text}, within {self.wanted:.2g}.", "error", self.error)]
        useless = self.error > max(USELESS, self.tol) if self.tol else self.error > 0.5 * self.overturned
        severity = UNUSABLE if useless else CAUTION
        return [*diagnostics, Diagnostic(severity, f"{text}, above {self.wanted:.2g}.", "error", self.error)]

    @property
    def title(self) -> str:
        """P(overturned) with its error and the method, as a line of text."""
        when = self.when(len(self.times) - 1)
        if self.method == "one path":
            return f"P(overturned) = {self.overturned:.0f} (one path), {when}"
        return f"P(overturned) = {_with_error(self.overturned, self.error)} ({self._level}), {when}; {self.label}"

    @property
    def _level(self):
        """What the error is: half of a 95 % interval, or the estimate of a density, which has no level."""
        return "estimated" if self.method == "density" else "95 %"

    @property
    def label(self) -> str:
        """Method, engine and number of paths, as in "19,000 paths (exact)"."""
        if self.method == "paths":
            return f"{self.realizations:,} paths ({self.engine})"
        return f"splitting of {self.realizations:,} paths" if self.method == "splitting" else self.method

    @property
    def remarks(self) -> tuple[str, ...]:
        """Sentences: why this method was taken, about the scene, and that a probability is below its error."""
        small = "The probability is smaller than its error: ask for a relative error by `rtol`."
        return (self.reason, *super().remarks, *[small] * (self.error > self.overturned))

    def derived(self) -> dict[str, Any]:
        """Survival, and probability to the left and to the right, at each time, then the error of each."""
        names = "survival", "left", "right"
        values = {name: ("time", getattr(self, name)) for name in names}
        return values | {f"{name}_error": ("time", self.errors[:, k]) for k, name in enumerate(names)}

    def summary(self) -> dict[str, Any]:
        """Return "overturned", "error", "verdict" and all of `Result.summary`, for JSON."""
        return {"overturned": self.overturned, "error": self.error, "verdict": self.verdict} | super().summary()

    def plot(self) -> Any:
        """Draw the probability of having overturned, and that to the left, with errors."""
        from matplotlib.ticker import MaxNLocator

        from fpk_rocking.results.pictures import COLOURS, figure_of

        def panel(_, axes):
            curves = (1.0 - self.survival, "either side"), (self.left, "to the left")
            for (values, label), error, colour in zip(curves, self.errors.T[:2], COLOURS[:2], strict=True):
                axes.fill_between(self.row_values, values - error, values + error, color=colour, alpha=0.3, linewidth=0)
                axes.plot(self.row_values, values, color=colour, marker=".", label=label)
            axes.set(xlabel=self.row_label, ylabel="P(overturned)", ylim=(0.0, None))
            axes.set_title(f"{_with_error(self.overturned, self.error)}, {self.when(len(self.times) - 1)}")
            if self.cycles is not None:
                axes.xaxis.set_major_locator(MaxNLocator(integer=True))
            axes.legend(fontsize=8)

        return figure_of(panel)


def _with_error(value, error):
    """Return a probability ± its error as a text, with as many digits as the error has."""
    if not error > 0.0:
        return f"{value:.4g}"
    digits = max(0, 1 - math.floor(math.log10(error)))
    if value > 0.0 and digits > 6:
        return f"{value:.3g} ± {error:.2g}"
    return f"{value:.{digits}f} ± {error:.{digits}f}"


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
    """Estimate the probability that a block has overturned, to a wanted error, with the noise of the scene.

    A scene without noise has one path. Else paths are sampled in stages until half of the 95 % interval (Wilson's) is
    within the wanted error; it contains the probability in 94.8 % of repetitions or more (benchmarks/probability.py).
    Under white noise the density (`solve_fpk`) or splitting (`montecarlo.split`) is used if the first paths predict
    that it is faster. Band noise and filtered noise are not replaced. After an interruption from the keyboard the
    result is that of the paths so far.

    If an engine has time steps, a quarter as many paths are sampled with steps four times as long. Their difference,
    beyond sampling, is added to the error. It bounds the error of the shorter steps, if that error falls at least with
    the square root of the step.

    Parameters
    ----------
    scene : Scene
    cycles : int, optional
        Required where the forcing repeats, refused where it does not.
    times : array_like, optional
        For a pulse or a record: ascending, nondimensional; by default 21 over its duration, and one 10 after its end.
    tol, rtol : float, optional
        Wanted error of the last probability, absolute and relative, above 0; if both are given, the larger error is
        enough. By default `tol` is .005, unless `rtol` is given.
    limit_s : float
        Seconds of sampling or solving that are accepted. ValueError if more are predicted: after the first paths, or
        after a part of this time if these do not suffice to predict. Compilation in the first run on a machine is not
        included (up to some minutes; ``fpk-rocking warmup`` compiles ahead), nor are delays on a busy machine.
    seed : int
        From 0 to 2**64 - 1.
    progress : callable, optional
        Called as ``progress(done, total)``.

    Examples
    --------
    >>> from fpk_rocking import load_scene, probability
    >>> answer = probability(load_scene("main"), cycles=4, tol=0.01)
    >>> print(f"{answer.overturned:.2f}")
    0.14
    """
    began = time.perf_counter()
    run = checked_run(scene, cycles, PILOT, seed, None, 200, progress, times)
    if tol is None and rtol is None:
        tol = 5e-3
    wanted = WantedError(
        0.0 if tol is None else checks.number("tol", tol, above=0.0),
        0.0 if rtol is None else checks.number("rtol", rtol, above=0.0),
    )
    if limit_s != math.inf:
        limit_s = checks.number("limit_s", limit_s, above=0.0)
    paths = Paths(run, progress)
    if scene.deterministic:
        paths.sample(1)
        found = Found("one path", "Nothing is random: one path decides.", paths.sides, 0.0, 1)
    else:
        found = soonest(paths, wanted, limit_s)
    left, right = np.asarray(found.sides, dtype=float).T.copy()
    errors = np.broadcast_to(found.errors, (len(left), 3)).astype(float)
    if scene.start.covariance is None:
        errors[0] = 0.0  # nothing has happened yet
    return Probability(
        scene=scene,
        times=run.times.astype(float),
        left=left,
        right=right,
        errors=errors,
        method=found.method,
        engine="" if found.method == "density" else run.method,
        reason=found.reason,
        tol=wanted.tol,
        rtol=wanted.rtol,
        returns=paths.returns,
        realizations=found.realizations,
        seed=run.seed,
        interrupted=found.interrupted,
        seconds=time.perf_counter() - began,
    )


class WantedError(NamedTuple):
    """The error that is wanted of a probability: absolute `tol`, relative `rtol`, each 0 where not asked for."""

    tol: float
    rtol: float

    def of(self, share: float) -> float:
        """Error that is small enough for a probability `share`."""
        return max(self.tol, self.rtol * share)

    def paths(self, overturned: int, paths: int) -> float:
        """How many paths are needed in all, by the 95 % limits of the share of `paths` that `overturned` so far."""
        low, high = wilson_interval(overturned, paths).tolist()
        widest = min(max(0.5, low), high)
        share = 0.5 * (low + overturned / paths) or high  # where none has overturned, as few as can be
        return self._paths(widest, share)

    def range_of_paths(self, overturned: int, paths: int) -> tuple[float, float]:
        """How many paths are needed at least and at most, of all shares between the limits of the interval."""
        low, high = wilson_interval(overturned, paths).tolist()
        needed = [self._paths(share, share) for share in (low, high, min(max(0.5, low), high))]
        return min(needed), max(needed)

    def next_stage(self, overturned: int, paths: int) -> int:
        """How many paths there are to be after the next stage: 1.25 to 16 times as many as now."""
        return int(min(max(self.paths(overturned, paths), 1.25 * paths), GROWTH * paths))

    def _paths(self, widest, share):
        """Paths that bring the error of a probability `widest` to `tol`, or that of `share` to `rtol` times it."""
        absolute = 1.02 * widest * (1.0 - widest) * (QUANTILE / self.tol) ** 2 + QUANTILE**2 if self.tol else math.inf
        relative = (1.0 - share) / share * (QUANTILE / self.rtol) ** 2 if self.rtol and share else math.inf
        return min(absolute, relative)


class Paths:
    """Paths of a run, sampled as they are needed: how many have overturned at each time.

    `sides` (rows, 2): of `paths`, to the left and to the right. `returns` (2,): as in `Probability`.
    """

    def __init__(self, run: Run, progress: Progress | None = None) -> None:
        self.run, self.progress, self.paths = run, progress, 0
        self.sides, self.returns = np.zeros((len(run.times), 2), np.int64), np.zeros(2, np.int64)

    def sample(self, until: int) -> None:
        """Simulate further paths until there are `until`."""
        run, followed = self.run._replace(realizations=int(until)), int(self.returns[0])
        for batch in simulate_batches(run, first=self.paths, progress=self.progress, followed=followed):
            self.add(batch.overturn_side, batch.overturn_time)
            self.returns += batch.returns

    def add(self, side: Array, time: Array) -> None:
        """Count paths by the `side` (count,) to which they overturn, 0 if none, and the time at which they do."""
        over = side != 0
        passages = np.zeros_like(self.sides)
        np.add.at(passages, (np.searchsorted(self.run.times, time[over]), (side[over] > 0).astype(int)), 1)
        self.sides += np.cumsum(passages, axis=0)
        self.paths += len(side)

    def pilot(self) -> float:
        """Sample the first paths; return the seconds that each further one will take."""
        self.sample(PILOT)
        began = time.perf_counter()
        self.sample(2 * PILOT)  # the first paths wait for machine code
        path_s = (time.perf_counter() - began) / PILOT
        return path_s if self.run.method == "exact" else path_s * (1.0 + 1.0 / _FEWER)

    def coarser(self) -> "Paths":
        """Return no paths yet of the same run with longer time steps."""
        return Paths(self.run._replace(steps_per_cycle=max(8, self.run.steps_per_cycle // _COARSER)), self.progress)

    @property
    def rows(self) -> dict[str, Any]:
        """The number of cycles, or the times, as keyword argument of the functions that solve a scene."""
        return {"times": self.run.times[1:]} if self.run.scene.period is None else {"cycles": self.run.rows}

    @property
    def overturned(self) -> int:
        """Number of paths that have overturned by the last time."""
        return int(self.sides[-1].sum())

    @property
    def least_share(self) -> float:
        """Share of the paths that has overturned, at least one of them."""
        return max(self.overturned, 1) / self.paths

    @property
    def shares(self) -> Array:
        """Shares of the paths that stand, and that overturned to the left and to the right, by time, (rows, 3)."""
        return self._columns / self.paths

    @property
    def half_widths(self) -> Array:
        """Larger distance of the `shares` from their 95 % limits, (rows, 3)."""
        return np.abs(wilson_interval(self._columns, self.paths) - self.shares[..., None]).max(axis=-1)

    @property
    def _columns(self):
        return np.column_stack([self.paths - self.sides.sum(axis=1), self.sides])

    def reach(self, wanted: WantedError) -> bool:
        """Whether the paths so far give the wanted error."""
        return self.half_widths[-1, 0] <= wanted.of(self.overturned / self.paths)


class Outlook(NamedTuple):
    """What the paths so far say of the work to come: `overturned` of `paths`, of which each takes `path_s` seconds."""

    wanted: WantedError
    limit_s: float
    path_s: float
    overturned: int
    paths: int

    @property
    def needed(self) -> float:
        """How many paths are needed in all."""
        return self.wanted.paths(self.overturned, self.paths)

    @property
    def seconds(self) -> float:
        """Seconds that the paths will take which are still needed."""
        return (self.needed - self.paths) * self.path_s

    @property
    def trial_s(self) -> float:
        """Seconds in which it has to be decided whether the limit is enough."""
        return max(_TRIAL * self.limit_s, min(_TRIAL_S, self.limit_s))

    @property
    def few_s(self) -> float:
        """Seconds in which more overturned paths are looked for."""
        return min(_FEW_S, self.trial_s)

    @property
    def too_few(self) -> bool:
        """Whether so few paths have overturned that more are sampled before anything else is tried."""
        few = self.overturned < _FEW and 2.0 * self.paths * self.path_s < self.few_s
        least, _ = self.wanted.range_of_paths(self.overturned, self.paths)
        return few and least <= self._affordable

    @property
    def undecided(self) -> bool:
        """Whether the limit may be enough or not by the paths so far, and time is left to sample more of them."""
        least, most = self.wanted.range_of_paths(self.overturned, self.paths)
        return least <= self._affordable < most and self.paths * self.path_s < self.trial_s

    @property
    def _affordable(self):
        return self.paths + self.limit_s / self.path_s

    def next_stage(self, seconds: float = math.inf) -> int:
        """How many paths there are to be after the next stage: as many as are needed, or take some `seconds` in all."""
        stage = self.wanted.next_stage(self.overturned, self.paths)
        return stage if seconds == math.inf else min(stage, math.ceil(seconds / self.path_s))


class Found(NamedTuple):
    """What a way found: `sides` (rows, 2), overturned to the left and right, and `errors` (rows, 3) or one for all."""

    method: str
    reason: str
    sides: Array
    errors: Array | float
    realizations: int
    interrupted: bool = False


def soonest(paths: Paths, wanted: WantedError, limit_s: float) -> Found:
    """Sample, predict, and take the shortest way to the wanted error; ValueError where it is beyond the limit."""
    predicted: dict[str, list[float]] = {}
    try:
        path_s = paths.pilot()
        while not paths.reach(wanted):
            outlook = Outlook(wanted, limit_s, path_s, paths.overturned, paths.paths)
            if outlook.too_few:
                paths.sample(outlook.next_stage(outlook.few_s))
                continue
            found = _by_another_way(paths, outlook, predicted)
            if found:
                return found
            if outlook.undecided:
                paths.sample(outlook.next_stage(outlook.trial_s))
                continue
            if outlook.seconds > limit_s:
                _refuse(outlook, predicted.get("splitting", [math.inf])[0])
            if outlook.seconds > _LONG_S:
                about = float(f"{outlook.seconds:.1g}")
                sys.stderr.write(f"probability: about {about:,.0f} s for {outlook.needed:,.0f} paths\n")
            paths.sample(outlook.next_stage())
        return by_paths(paths)
    except KeyboardInterrupt:
        if not paths.paths:
            raise
        return by_paths(paths, interrupted=True)


def _by_another_way(paths, outlook, predicted):
    """`Found` by the density or by splitting, each tried once if sooner than paths; seconds go to `predicted`."""
    if outlook.seconds <= _SHORT_S:
        return None
    if "density" not in predicted:
        predicted["density"] = _density_seconds(paths, outlook.wanted)
    solutions = predicted["density"]
    if sum(solutions) < min(outlook.seconds, outlook.limit_s):
        predicted["density"] = [math.inf]
        return by_density(paths, outlook, solutions)
    if "splitting" not in predicted and outlook.seconds > _SPLITTING_S and _splits(paths, outlook.wanted):
        found, seconds = by_splitting(paths, outlook)
        predicted["splitting"] = [seconds]
        return found
    return None


def _refuse(outlook, splitting_s):
    """Raise ValueError: the wanted error takes too long, by paths and, in `splitting_s` seconds, by splitting."""
    wanted, limit_s, _, overturned, paths = outlook
    high = wilson_interval(overturned, paths)[1]
    name = "tol" if wanted.tol else "rtol"
    least = "at least " * (not overturned)
    affordable = limit_s / outlook.seconds * outlook.needed
    within = QUANTILE * math.sqrt(max(overturned, 1) / paths / affordable)
    splitting = f", splitting about {splitting_s:.2g} s" if math.isfinite(splitting_s) else ""
    raise ValueError(
        f"{name}: got {getattr(wanted, name):g}, which takes {least}{outlook.needed:.2g} paths, about "
        f"{outlook.seconds:.2g} s{splitting} "
        f"({overturned} of {paths:,} paths overturned, the probability is below {high:.2g}); "
        f"accepted: a larger limit_s (got {limit_s:g} s), or a larger error, as tol={within:.1g}"
    )


def by_paths(paths: Paths, interrupted: bool = False) -> Found:
    """Return what the paths so far say; the error of their time steps is not measured where they are `interrupted`."""
    errors, engine = paths.half_widths, paths.run.method
    reason = f"Paths under the noise of the scene reach the wanted error soonest ({engine} engine)."
    if engine != "exact" and not interrupted:
        coarse = paths.coarser()
        coarse.sample(max(paths.paths // _FEWER, PILOT))
        change = np.abs(coarse.shares - paths.shares)
        errors = errors + np.maximum(change - math.sqrt(1.0 + _FEWER) * errors, 0.0)
        reason += f" Steps {_COARSER} times as long change the last probability by {change[-1, 0]:.1g}."
    return Found("paths", reason, paths.sides / paths.paths, errors, paths.paths, interrupted)


def _density_seconds(paths, wanted):
    """Predicted seconds of each solution of the density; [inf] if it cannot do this scene or error."""
    from fpk_rocking.density.solver import predicted_seconds

    scene, tol = paths.run.scene, wanted.of(paths.least_share)
    if scene.noise.kind != "white" or tol < 1e-4 or tol > 0.1:
        return [math.inf]
    try:
        predicted = predicted_seconds(scene, tol=tol, **paths.rows)
    except ValueError:
        return [math.inf]
    return [seconds if scene.repeats else _FINER * seconds for seconds in predicted]


class SlowerError(Exception):
    """A density would take too long."""


def stop_if_slow(predicted: list[float], limit: float, rows: int, progress: Progress | None = None) -> Progress:
    """Return a `progress` for `solve_fpk` that raises `SlowerError` where more than `limit` seconds are to come.

    It scales the seconds `predicted` by what the solutions so far took; each has `rows` times beside the first.
    """
    began = time.perf_counter()

    def watch(done, total):
        if progress:
            progress(done, total)
        solutions = done // rows
        if done % rows == 0 and solutions < len(predicted):
            slower = (time.perf_counter() - began) / sum(predicted[:solutions])
            if slower * sum(predicted[solutions:]) > limit:
                raise SlowerError

    return watch


def by_density(paths: Paths, outlook: Outlook, predicted: list[float]) -> Found | None:
    """Solve for the density; None where it is not accurate enough, contradicts the paths, or is slower than these."""
    from fpk_rocking.density.solver import solve_fpk

    tol, paths_s = outlook.wanted.of(paths.least_share), outlook.seconds
    watch = stop_if_slow(predicted, min(paths_s, outlook.limit_s), paths.run.rows, paths.progress)
    try:
        density = solve_fpk(paths.run.scene, tol=tol, bins_tol=math.inf, progress=watch, **paths.rows)
    except (ValueError, SlowerError):  # the first: no mesh resolves this scene
        return None
    error = density.error_estimate
    difference = abs(density.survival[-1] - 1.0 + paths.overturned / paths.paths)
    if error > tol or difference > error + 2.0 * paths.half_widths[-1, 0]:
        return None
    reason = f"The density was predicted to take {sum(predicted):.1g} s, paths {paths_s:.1g} s."
    return Found("density", reason, np.asarray(density.overturned), error, 0)


def _splits(paths, wanted):
    """Whether splitting takes the scene, and overturning is rare."""
    scene, share = paths.run.scene, paths.least_share
    return wanted.of(share) < share < 0.02 and scene.repeats and scene.noise.kind == "white"


def by_splitting(paths: Paths, outlook: Outlook) -> tuple[Found | None, float]:
    """Split, and return the seconds predicted for it too; None where these are above the limit, or those of paths.

    Walkers are added to each repeat, and its estimates averaged, until the error is small enough. What is still
    predicted once the first ones tell it has to be within the limit, later within twice as much.
    """
    run, wanted, paths_s = paths.run, outlook.wanted, outlook.seconds
    walkers, spent = int(min(_WALKERS, outlook.trial_s / (REPEATS * _PATHS_EACH * outlook.path_s))), 0.0
    predicted = math.inf
    # Of an event that few paths saw, what plain paths take is a lower bound.
    limit = min(outlook.limit_s, paths_s) if outlook.overturned > 4 else outlook.limit_s
    split_scene = functools.partial(split, run.scene, progress=paths.progress, **paths.rows)
    if walkers < 10:
        return None, predicted
    try:
        split_scene(walkers=10, repeats=2)  # makes the score, which serves the others
        total = None
        while True:
            began = time.perf_counter()
            seed = (run.seed + (total.walkers if total else 0)) % 2**64
            total = joined(total, split_scene(walkers=walkers, repeats=REPEATS, seed=seed))
            spent += time.perf_counter() - began
            last = float(total.probability[-1])
            error, enough = STUDENT * float(total.standard_error[-1]), wanted.of(last)
            if last and error <= enough and not total.skewed:
                break
            more = max(1.2 * (error / enough) ** 2, 1.2) if last else math.inf
            predicted = (more - 1.0) * spent
            if not total.skewed or spent > outlook.trial_s:
                if predicted > limit:
                    return None, predicted
                limit = 2.0 * outlook.limit_s
            walkers = math.ceil(total.walkers * (min(more, 4.0) if total.skewed else more) - total.walkers)
    except ValueError:  # more walkers than memory holds
        return None, predicted
    sides = total.repeat_overturned
    columns = np.concatenate([sides.sum(axis=2, keepdims=True), sides], axis=2)
    errors = STUDENT * columns.std(axis=0, ddof=1) / math.sqrt(REPEATS)
    reason = f"Overturning is rare: plain paths would take at least {float(f'{paths_s:.1g}'):,g} s."
    return Found("splitting", reason, total.overturned, errors, REPEATS * total.walkers), predicted


def joined(first: Splitting | None, second: Splitting) -> Splitting:
    """Two splittings of as many repeats as one: mean estimates of each repeat, weighted by the walkers."""
    if first is None:
        return second
    walkers = first.walkers + second.walkers
    estimates = first.walkers * first.repeat_overturned + second.walkers * second.repeat_overturned
    return dataclasses.replace(second, walkers=walkers, repeat_overturned=estimates / walkers)
