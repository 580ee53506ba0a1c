"""How many paths a wanted error needs, and what has been counted so far."""

import dataclasses
import math
import statistics
import time
from typing import Any, NamedTuple

import numpy as np

from fpk_rocking.base.checks import Array, Progress
from fpk_rocking.results.sampling import wilson_interval
from montecarlo.splitting import Splitting

QUANTILE = statistics.NormalDist().inv_cdf(0.975)
"""97.5 % point of the standard normal distribution."""
GROWTH = 16
"""How many times more paths may follow before what is needed is predicted anew."""


class WantedError(NamedTuple):
    """The error that is wanted: absolute, relative; 0 where none."""

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
        """Return how many paths bring the error of a share to `tol`."""
        return 1.02 * share * (1.0 - share) * (QUANTILE / self.tol) ** 2 + QUANTILE**2 if self.tol else math.inf

    def _relative(self, share: float) -> float:
        """Return how many paths bring the error of a share to `rtol` times it."""
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
