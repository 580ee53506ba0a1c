"""Tallies: survival, histograms and moments of an ensemble whose realizations are not kept; files to resume from."""

import dataclasses
import functools
import time
from typing import Any, ClassVar

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array, File
from montecarlo.results.counts import PARTS, Counts, Sample, moments


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Tally(Sample):
    """Counts over independent realizations of a scene; all quantities are nondimensional.

    Parameters
    ----------
    scene, seed, steps_per_cycle
        As given to `tally`.
    method, wall_s
        As of `Ensemble`; seconds of all parts of the run.
    counts : Counts
        The counts themselves, from which all else here follows.
    """

    kind: ClassVar = "tally"
    counts: Counts
    shown_bins = 0

    def __post_init__(self):
        views = [array.view() for array in self.counts]
        for view in views:
            view.flags.writeable = False
        object.__setattr__(self, "counts", Counts(*views))

    @property
    def realizations(self) -> int:
        """Number of realizations."""
        return int(self.counts.standing[-1] + self.counts.passages.sum())

    @property
    def times(self) -> Array:
        """Times τ from 0 on, shape (cycles + 1,): whole cycles where the forcing repeats."""
        return self.counts.times

    @property
    def bin_edges(self) -> tuple[Array, Array]:
        """Edges of the bins in pictures and tables: angles (n + 1,) and velocities (m + 1,)."""
        usual, counted = super().bin_edges, (self.counts.angle_edges, self.counts.velocity_edges)
        return usual if all(np.isin(*pair).all() for pair in zip(usual, counted, strict=True)) else counted

    @property
    def returns(self) -> Array:
        """How many paths that overturned were followed on to the fall, and how many of these came back, (2,)."""
        return self.counts.returns

    @functools.cached_property
    def overturned_counts(self) -> Array:
        """Number of realizations that have overturned to the left and to the right, shape (cycles + 1, 2)."""
        return np.cumsum(self.counts.passages, axis=0)[::PARTS]

    @property
    def first_overturning(self) -> tuple[float, float, int] | None:
        """Times τ, a 20th of a row apart, between which the first block overturned, and the side; None if all stand."""
        rows, sides = np.nonzero(self.counts.passages)
        if not rows.size:
            return None
        ends = np.interp(np.maximum([rows[0] - 1, rows[0]], 0) / PARTS, np.arange(self.times.size), self.times)
        return *ends.tolist(), 2 * int(sides[0]) - 1

    @property
    def first_passage(self) -> Array:
        """Probability of overturning in each 20th of a row, to the left and to the right, (20 cycles + 1, 2).

        Row j is for the j-th of these, row 0 for blocks that start beyond the cut-off.
        """
        return self.counts.passages / self.realizations

    @property
    def outside(self) -> Array:
        """Probability of standing outside all bins that were counted, shape (cycles + 1,)."""
        return (self.counts.standing - self.counts.histogram.sum(axis=(1, 2), dtype=np.int64)) / self.realizations

    @property
    def mean(self) -> Array:
        """Mean of angle and velocity of the standing blocks, (cycles + 1, 2), rounded to ``counts.quantum``."""
        return self._moments[0]

    @property
    def covariance(self) -> Array:
        """Covariance of angle and velocity of the blocks that stand, over their number, shape (cycles + 1, 2, 2)."""
        return self._moments[1]

    @functools.cached_property
    def _moments(self):
        return moments(self.counts)

    def _binned(self, row, edges):
        """Return the shares of all realizations that stand in each bin at a row; edges are to be counted ones."""
        histogram = self.counts.histogram[row]
        angles = _edge_numbers("angle_edges", edges[0], self.counts.angle_edges)
        velocities = _edge_numbers("velocity_edges", edges[1], self.counts.velocity_edges)
        inner = histogram[angles[0] : angles[-1], velocities[0] : velocities[-1]]
        inner = np.add.reduceat(inner, angles[:-1] - angles[0], axis=0, dtype=np.int64)
        return np.add.reduceat(inner, velocities[:-1] - velocities[0], axis=1) / self.realizations


def _edge_numbers(name, edges, counted):
    """Return the places (n,) of bin edges among the `counted` ones, or refuse the parameter `name`."""
    accepted = (
        f"two or more of the {counted.size} edges kept, ascending from {counted[0]:g} to {counted[-1]:g} "
        f"with the least distance {np.diff(counted).min():g}; for others call tally with your own {name}"
    )
    middles = 0.5 * (counted[1:] + counted[:-1])
    places = np.searchsorted(middles, edges)
    unknown = ~(np.abs(counted[places] - edges) <= 1e-6 * np.diff(counted).min())
    if unknown.any():
        raise ValueError(checks.refusal(name, float(edges[unknown][0]), accepted))
    if np.any(np.diff(places) <= 0):
        raise ValueError(checks.refusal(name, edges.tolist(), accepted))
    return places


class Checkpoint:
    """Keeps a tally in a file, None for none: at once, so that a path is refused early, then now and then."""

    least_s = 30.0
    """Least seconds between two savings."""

    share = 0.02
    """Largest part of a run that saving takes."""

    def __init__(self, path, done):
        self._path, self._done, self._due = path, done, 0.0

    @property
    def is_due(self) -> bool:
        return self._path is not None and time.perf_counter() >= self._due

    def save(self, tally: Tally) -> None:
        """Save, unless the file holds as many realizations already."""
        if self._path is None or tally.realizations == self._done:
            return
        began = time.perf_counter()
        tally.save(self._path)
        ended = time.perf_counter()
        self._done, self._due = tally.realizations, ended + max(self.least_s, (ended - began) / self.share)


def resumed(path: File, run: Any, empty: Counts) -> tuple[Counts, float]:
    """Return the counts of a checkpoint, to be written to, and the seconds spent; ValueError for another run."""
    try:
        saved = Tally.load(path)
    except ValueError as error:
        raise ValueError(f"checkpoint: {error}") from error
    counts = Counts(*(array.copy() for array in saved.counts))  # a loaded result cannot be written to
    if not np.array_equal(saved.times, run.times):
        raise _other_run_error(path, _rows_text(saved), _rows_text(run))
    for name in ("scene", "seed", "method", "steps_per_cycle"):
        if getattr(saved, name) != getattr(run, name):
            raise _other_run_error(path, f"{name} {getattr(saved, name)}", f"{name} {getattr(run, name)}")
    for name in ("angle_edges", "velocity_edges"):
        if not np.array_equal(getattr(counts, name), getattr(empty, name)):
            raise _other_run_error(path, f"other {name}", f"the {name} that are asked for")
    if saved.realizations > run.realizations:
        raise _other_run_error(path, f"realizations {saved.realizations}", f"at most {run.realizations}, as asked for")
    return counts, saved.wall_s


def _rows_text(run):
    if run.scene.period is None:
        return f"{len(run.times) - 1} times up to {run.times[-1]:g}"
    return f"cycles {len(run.times) - 1}"


def _other_run_error(path, got, accepted):
    return ValueError(f"checkpoint: got {path} with {got}, accepted: {accepted}, or the name of a new file")
