"""Probability of having overturned, by time, with its error: the result, and the parts by which `overturning` gets it.

The parts: how many paths a wanted error needs, their counts by side, a stop for a slow density, joined splittings.
"""

import dataclasses
import math
import statistics
import time
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np

from fpk_rocking.base.checks import Array, Progress
from fpk_rocking.results.remarks import EXACT_PATH
from fpk_rocking.results.returns import return_diagnostics
from fpk_rocking.results.sampling import wilson_interval
from fpk_rocking.results.survival import RowResult
from fpk_rocking.results.trust import CAUTION, UNUSABLE, USELESS, Diagnostic
from fpk_rocking.scene.scene import Scene
from montecarlo.splitting import Splitting

QUANTILE = statistics.NormalDist().inv_cdf(0.975)
"""97.5 % point of the standard normal distribution."""
GROWTH = 16
"""How many times more paths may follow before what is needed is predicted anew."""


class WantedError(NamedTuple):
    """The error (95 %) that is wanted of a probability: absolute `tol`, relative `rtol`, each 0 where not asked for."""

    tol: float
    rtol: float

    def of(self, share: float) -> float:
        """Return the error (float) that is small enough for a probability `share`: `tol`, or `rtol` of it if larger."""
        return max(self.tol, self.rtol * share)

    def paths(self, overturned: int, paths: int) -> float:
        """Return how many paths are needed in all (a float), by the 95 % limits of the share that overturned so far.

        `overturned` (int) of a number of `paths` (int) have overturned.
        """
        low, high = wilson_interval(overturned, paths).tolist()
        widest = min(max(0.5, low), high)
        share = 0.5 * (low + overturned / paths) or high  # where none has overturned, as few as can be
        return min(self._absolute(widest), self._relative(share))

    def range_of_paths(self, overturned: int, paths: int) -> tuple[float, float]:
        """Return how many paths are needed at least and at most, of all shares between the limits of the interval."""
        low, high = wilson_interval(overturned, paths).tolist()
        needed = [min(self._absolute(share), self._relative(share)) for share in (low, high, min(max(0.5, low), high))]
        return min(needed), max(needed)

    def _absolute(self, share: float) -> float:
        """Return how many paths bring the error (95 %) of a probability `share` to `tol`; inf where `tol` is 0."""
        return 1.02 * share * (1.0 - share) * (QUANTILE / self.tol) ** 2 + QUANTILE**2 if self.tol else math.inf

    def _relative(self, share: float) -> float:
        """Return how many paths bring the error (95 %) of a `share` to `rtol` times it; inf where either is 0."""
        return (1.0 - share) / share * (QUANTILE / self.rtol) ** 2 if self.rtol and share else math.inf

    def next_stage(self, overturned: int, paths: int) -> int:
        """Return how many paths (int) there are to be after the next stage: 1.25 to 16 times as many as now.

        `overturned` (int) of a number of `paths` (int) so far have overturned.
        """
        return int(min(max(self.paths(overturned, paths), 1.25 * paths), GROWTH * paths))


class SlowerError(Exception):
    """A density would take too long."""


def stop_if_slow(predicted: list[float], limit: float, rows: int, progress: Progress | None) -> Progress:
    """Return a function (done, total), for `progress` of `solve_fpk`: it stops a density slower than predicted.

    What the solutions so far took, over what was predicted for them, holds for the others.

    Parameters
    ----------
    predicted : list of float
        Seconds of each solution.
    limit : float
        `SlowerError` is raised where more seconds than this are to come.
    rows : int
        Times of a solution, without the first.
    progress : callable or None
        Called as well.
    """
    began = time.perf_counter()

    def watch(done, total):
        """Report `done` of `total` rows, and compare the seconds after each solution but the last."""
        if progress:
            progress(done, total)
        solutions = done // rows
        if done % rows == 0 and solutions < len(predicted):
            slower = (time.perf_counter() - began) / sum(predicted[:solutions])
            if slower * sum(predicted[solutions:]) > limit:
                raise SlowerError

    return watch


class SideCounts:
    """How many of some paths have overturned at each time to the left and to the right: `sides` (rows, 2).

    `returns` (2,): how many of them were followed on to the fall, and how many of these came back.
    """

    def __init__(self, times: Array) -> None:
        self.returns = np.zeros(2, np.int64)
        self.times, self.paths, self.sides = times, 0, np.zeros((len(times), 2), np.int64)

    def add(self, batch: Any) -> None:
        """Add the realizations of a `Batch` of `montecarlo.engines.batches` to the counts."""
        over = batch.overturn_side != 0
        rows = np.searchsorted(self.times, batch.overturn_time[over])
        passages = np.zeros_like(self.sides)
        np.add.at(passages, (rows, (batch.overturn_side[over] > 0).astype(int)), 1)
        self.sides += np.cumsum(passages, axis=0)
        self.returns += batch.returns
        self.paths += len(batch.overturn_side)

    @property
    def columns(self) -> Array:
        """Numbers of paths that stand, and that overturned to the left and to the right, by time: ints, (rows, 3)."""
        return np.column_stack([self.paths - self.sides.sum(axis=1), self.sides])

    @property
    def overturned(self) -> int:
        """Number of paths that have overturned by the last time."""
        return int(self.sides[-1].sum())

    @property
    def half_widths(self) -> Array:
        """Larger distance of the shares that stand, overturned left and right from their 95 % limits, (rows, 3)."""
        limits = wilson_interval(self.columns, self.paths)
        return np.abs(limits - (self.columns / self.paths)[..., None]).max(axis=-1)


def joined(first: Splitting | None, second: Splitting) -> Splitting:
    """Return two `Splitting` of as many repeats as one: mean estimates of each repeat, weighted by the walkers.

    `first` may be None.
    """
    if first is None:
        return second
    walkers = first.walkers + second.walkers
    estimates = first.walkers * first.repeat_overturned + second.walkers * second.repeat_overturned
    return dataclasses.replace(second, walkers=walkers, repeat_overturned=estimates / walkers)


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Probability(RowResult):
    """Probability of overturning with its error, after each cycle or at each of the times; see `probability`.

    Parameters
    ----------
    scene : Scene
    times : ndarray, shape (rows,)
        Nondimensional times τ from 0 on: whole cycles where the forcing repeats.
    left, right : ndarray, shape (rows,)
        Probability of having overturned to either side.
    errors : ndarray, shape (rows, 3)
        Errors of the survival, of `left` and of `right`: half of the 95 % interval of a sample, with the measured error
        of its time steps; of a density the estimated error.
    method : {"one path", "paths", "density", "splitting"}
    engine : str
        The Monte Carlo method, as in "exact"; empty for a density.
    reason : str
        Why this method was taken, as a sentence.
    tol, rtol : float
        Wanted error of the last probability, absolute and in parts of it; 0 where none was asked for.
    returns : ndarray of int, shape (2,)
        How many of the paths that overturned were followed on to the fall, 90 degrees, and how many of these came back.
    realizations : int
        Number of paths; of walkers in all repeats of splitting; 0 for a density.
    seed : int
        Seed of the random numbers.
    interrupted : bool
        Whether the call was interrupted; the numbers are those of the paths until then.
    seconds : float
        That the call took, compilation included.

    Examples
    --------
    >>> from fpk_rocking import Scene, probability
    >>> rack = Scene.from_block(0.6, 2.0, "0.35 g", "1.2 Hz", noise_rms_acceleration=0.5, noise_band_hz=(0, 5))
    >>> answer = probability(rack, cycles=10, tol=0.01)
    >>> print(f"{answer.overturned:.2f} {answer.method} {answer.error <= 0.01} {answer.verdict}")
    0.10 paths True ok
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
        """Error of `overturned` (95 %), absolute: half the width of its interval."""
        return float(self.errors[-1, 0])

    @property
    def verdict(self) -> str:
        """The verdict "ok", "caution" or "do not use"; `trust` has the reasons."""
        return self.trust.verdict

    @property
    def wanted(self) -> float:
        """The error that was asked for: `tol`, or `rtol` times the probability where that is larger."""
        return max(self.tol, self.rtol * self.overturned)

    @property
    def reason_if_ok(self) -> str:
        """Reason of the verdict "ok", a sentence, where nothing is random in the scene; else empty."""
        return EXACT_PATH if self.method == "one path" else ""

    @property
    def diagnostics(self) -> list[Diagnostic]:
        """A list of `Diagnostic`: of the model, of blocks that come back, of the error, and of an interruption."""
        diagnostics = self.model_diagnostics()
        diagnostics += return_diagnostics(self.scene, self.overturned, self.error, self.returns)
        if self.interrupted:
            diagnostics.append(Diagnostic(CAUTION, "The call was interrupted before it was done.", "interrupted"))
        if self.method == "one path":
            return diagnostics
        text = f"The error of P(overturned) is {self.error:.2g} (95 %)"
        if self.error <= self.wanted:
            return [*diagnostics, Diagnostic(0, f"{text}, within {self.wanted:.2g}.", "error", self.error)]
        useless = self.error > max(USELESS, self.tol) if self.tol else self.error > 0.5 * self.overturned
        return [
            *diagnostics,
            Diagnostic(UNUSABLE if useless else CAUTION, f"{text}, above {self.wanted:.2g}.", "error", self.error),
        ]

    @property
    def title(self) -> str:
        """P(overturned) with its error and the method, as a line of text."""
        when, label = self.when(len(self.times) - 1), "one path" if self.method == "one path" else self.label
        if self.method == "one path":
            return f"P(overturned) = {self.overturned:.0f} (one path), {when}"
        return f"P(overturned) = {_with_error(self.overturned, self.error)} (95 %), {when}; {label}"

    @property
    def label(self) -> str:
        """Method, engine and number of paths, as in "19,000 paths (exact)"."""
        if self.method == "paths":
            return f"{self.realizations:,} paths ({self.engine})"
        return f"splitting of {self.realizations:,} paths" if self.method == "splitting" else self.method

    @property
    def remarks(self) -> tuple[str, ...]:
        """Sentences: why this method was taken, about the scene, and that a probability is below its error."""
        small = "The probability is below its error: `rtol` asks for an error in parts of the probability."
        return (self.reason, *super().remarks, *[small] * (self.error > self.overturned))

    def derived(self) -> dict[str, Any]:
        """Survival, and probability to the left and to the right, at each time, then the error of each."""
        names = "survival", "left", "right"
        values = {name: ("time", getattr(self, name)) for name in names}
        return values | {f"{name}_error": ("time", self.errors[:, k]) for k, name in enumerate(names)}

    def summary(self) -> dict[str, Any]:
        """Return a dict for JSON: "overturned", "error" and "verdict", and all of `Result.summary`."""
        return {"overturned": self.overturned, "error": self.error, "verdict": self.verdict} | super().summary()

    def plot(self) -> Any:
        """Draw the probability of having overturned, and that to the left, with errors; return a matplotlib figure."""
        from matplotlib.ticker import MaxNLocator

        from fpk_rocking.results.pictures import COLOURS, figure_of

        def panel(_, axes):
            """Draw both probabilities over the rows on matplotlib `axes`; the first argument is not used."""
            shown = (1.0 - self.survival, 0, "either side"), (self.left, 1, "to the left")
            for (values, column, label), colour in zip(shown, COLOURS, strict=False):
                error = self.errors[:, column]
                axes.fill_between(self.row_values, values - error, values + error, color=colour, alpha=0.3, linewidth=0)
                axes.plot(self.row_values, values, color=colour, marker=".", label=label)
            axes.set(xlabel=self.row_label, ylabel="P(overturned)", ylim=(0.0, None))
            axes.set_title(f"{_with_error(self.overturned, self.error)}, {self.when(len(self.times) - 1)}")
            if self.cycles is not None:
                axes.xaxis.set_major_locator(MaxNLocator(integer=True))
            axes.legend(fontsize=8)

        return figure_of(panel)


def _with_error(value, error):
    """Return a probability `value` ± its `error` (floats) as a text, with as many digits as the error has."""
    if not error > 0.0:
        return f"{value:.4g}"
    digits = max(0, 1 - math.floor(math.log10(error)))
    if value > 0.0 and digits > 6:
        return f"{value:.3g} ± {error:.2g}"
    return f"{value:.{digits}f} ± {error:.{digits}f}"
