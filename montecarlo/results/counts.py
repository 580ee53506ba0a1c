"""Counts of realizations: a tally's sums, and `Sample`, survival from counts, the base of an ensemble and a tally.

Counts and sums over batches of realizations are integers, so that the order of adding them makes no difference. Counts
are integers by nature. For the moments each state is rounded to whole multiples of a quantum, and the sums of
these numbers and of their products are exact. Of a number at most 2^31 in size, up to 2^31 - 1 realizations sum to less
than 2^62. A product, at most 2^62, is split into p = 2^32 high + low with 0 <= low < 2^32; both halves are summed on
their own, the low ones to less than 2^63: nothing overflows an int64.
"""

import dataclasses
import math
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import numpy as np

from fpk_rocking.base.checks import Array
from fpk_rocking.base.jit import kernel
from fpk_rocking.results.remarks import EXACT_PATH, path_diagnostics
from fpk_rocking.results.result import Result
from fpk_rocking.results.returns import return_diagnostics
from fpk_rocking.results.sampling import wilson_interval
from fpk_rocking.results.survival import SurvivalResult
from fpk_rocking.results.trust import Diagnostic
from fpk_rocking.scene.axes import joint_edges
from fpk_rocking.scene.scene import Scene

LARGEST = 2**31 - 1
"""Realizations at most."""

PARTS = 20
"""Parts of a cycle in which first passages are counted."""

_RANGE = 2.0**31
_HALF = 32


class Counts(NamedTuple):
    """Counts over the realizations of a tally so far, at each of its times.

    Parameters
    ----------
    times : ndarray, shape (rows,)
        Nondimensional times from 0 on.
    angle_edges, velocity_edges : ndarray
        Edges of the bins, nondimensional.
    quantum : ndarray, shape (2,)
        What angles and velocities are rounded to in the sums: powers of two.
    standing, histogram : ndarray of int, shape (rows,) and (rows, n_angle, n_velocity)
        Number of realizations that have not overturned, and of these in each bin.
    passages : ndarray of int, shape (20 (rows - 1) + 1, 2)
        Number that overturned to the left and to the right in each 20th of the time between two times; in row 0, that
        start beyond the cut-off.
    sums, products : ndarray of int, shape (rows, 2) and (rows, 3, 2)
        Sums over the standing realizations, in quanta: of angle and velocity; of xx, xv and vv, high and low halves.
    returns : ndarray of int, shape (2,)
        As of `montecarlo.Ensemble`.
    """

    times: Annotated[Array, "f8 k+1"]
    angle_edges: Annotated[Array, "f8 a+1"]
    velocity_edges: Annotated[Array, "f8 v+1"]
    quantum: Annotated[Array, "f8 2"]
    standing: Annotated[Array, "i8 k+1"]
    passages: Annotated[Array, f"i8 {PARTS}k+1 2"]
    histogram: Annotated[Array, "i4 k+1 a v"]
    sums: Annotated[Array, "i8 k+1 2"]
    products: Annotated[Array, "i8 k+1 3 2"]
    returns: Annotated[Array, "i8 2"]


def empty_counts(scene: Scene, times: Array, angle_edges: Array, velocity_edges: Array) -> Counts:
    """Return `Counts` of zeros, with room for velocities of eight times the bound of `joint_edges`."""
    bounds = scene.overturning.angle, 8.0 * joint_edges(scene)[1][-1]
    rows = len(times)
    return Counts(
        times,
        angle_edges,
        velocity_edges,
        np.array([2.0 ** math.ceil(math.log2(bound)) / _RANGE for bound in bounds]),
        np.zeros(rows, np.int64),
        np.zeros(((rows - 1) * PARTS + 1, 2), np.int64),
        np.zeros((rows, angle_edges.size - 1, velocity_edges.size - 1), np.int32),
        np.zeros((rows, 2), np.int64),
        np.zeros((rows, 3, 2), np.int64),
        np.zeros(2, np.int64),
    )


def add(counts: Counts, batch: Any) -> None:
    """Add the realizations of a `Batch` in place; ValueError, and nothing is added, where the sums could overflow."""
    rows = np.interp(batch.overturn_time, counts.times, np.arange(float(len(counts.times))))
    if not _add(counts, batch.angle, batch.velocity, rows, batch.overturn_side, batch.returns):
        limits = " and ".join(f"{limit:g}" for limit in _RANGE * counts.quantum)
        raise ValueError(
            f"realizations: got a block beyond angle and velocity {limits} among those from number {batch.first} on, "
            "accepted: scenes whose states stay within, so that their moments can be summed"
        )


@kernel
def _add(counts, angle, velocity, overturn_row, overturn_side, returns):
    """Add a batch in one call, which no interrupt can cut in two; return whether it was done. Times count in rows."""
    count, rows = angle.shape
    to_quanta = 1.0 / counts.quantum
    stands = np.empty(count, np.int64)
    wild = 0
    for r in range(count):
        stands[r] = _cycles_standing(angle[r], velocity[r], to_quanta)
        wild += stands[r] < 0
    if wild > 0:
        return False
    for k in range(2):
        counts.returns[k] += returns[k]
    for r in range(count):
        if stands[r] < rows:
            row = _passage(stands[r], overturn_row[r])
            counts.passages[row, 1 if overturn_side[r] > 0 else 0] += 1
    for k in range(rows):
        for r in range(count):
            if k < stands[r]:
                _add_state(counts, k, angle[r, k], velocity[r, k], to_quanta)
    return True


@kernel
def _cycles_standing(angle, velocity, to_quanta):
    """Return at how many times a block stands, or -1 if one of its states is too large to be counted."""
    k = 0
    while k < angle.size and not math.isnan(angle[k]):
        if not (abs(angle[k] * to_quanta[0]) <= _RANGE and abs(velocity[k] * to_quanta[1]) <= _RANGE):
            return -1
        k += 1
    return k


@kernel
def _passage(standing, time):
    """Return the row of `passages` for an overturning at a `time` in rows, after `standing` rows at which it stood."""
    part = math.ceil((time - (standing - 1)) * PARTS)
    return (standing - 1) * PARTS + min(max(part, 1), PARTS)


@kernel
def _add_state(counts, k, angle, velocity, to_quanta):
    counts.standing[k] += 1
    i, j = _bin_of(counts.angle_edges, angle), _bin_of(counts.velocity_edges, velocity)
    if i >= 0 and j >= 0:
        counts.histogram[k, i, j] += 1
    x, v = np.int64(np.rint(angle * to_quanta[0])), np.int64(np.rint(velocity * to_quanta[1]))
    counts.sums[k, 0] += x
    counts.sums[k, 1] += v
    _add_product(counts.products[k, 0], x * x)
    _add_product(counts.products[k, 1], x * v)
    _add_product(counts.products[k, 2], v * v)


@kernel
def _add_product(total, product):
    """Add a product of two numbers of quanta to `total` (2,), sums of high and of low halves."""
    high = product >> _HALF
    total[0] += high
    total[1] += product - (high << _HALF)


@kernel
def _bin_of(edges, value):
    """Return the bin of a value among ascending `edges`, -1 for none; as in numpy the last one is closed."""
    low, high = 0, edges.size - 1
    if not edges[low] <= value <= edges[high]:
        return -1
    while high - low > 1:
        middle = (low + high) // 2
        if value >= edges[middle]:
            low = middle
        else:
            high = middle
    return low


def moments(counts: Counts) -> tuple[Array, Array]:
    """Return mean (rows, 2) and covariance (rows, 2, 2) of the standing blocks, exact for the rounded states."""
    mean = np.full(counts.sums.shape, math.nan)
    covariance = np.full((*counts.sums.shape, 2), math.nan)
    quantum = counts.quantum
    for k, n in enumerate(counts.standing.tolist()):
        if n == 0:
            continue
        sums = counts.sums[k].tolist()
        xx, xv, vv = ((high << _HALF) + low for high, low in counts.products[k].tolist())
        mean[k] = [total / n * unit for total, unit in zip(sums, quantum, strict=True)]
        for i, j, product in ((0, 0, xx), (0, 1, xv), (1, 0, xv), (1, 1, vv)):
            covariance[k, i, j] = (n * product - sums[i] * sums[j]) / (n * n) * quantum[i] * quantum[j]
    return mean, covariance


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Paths(Result):
    """What all results of paths have in common: how they were simulated."""

    scene: Scene
    method: str
    seed: int
    steps_per_cycle: int
    wall_s: float


class Sample(Paths, SurvivalResult):
    """What an ensemble and a tally have in common: survival from counts, with its sampling error."""

    if TYPE_CHECKING:
        overturned_counts: Any
        returns: Any
        first_overturning: Any  # earliest and latest time of the first realization's, and the side; None if it stands

    noise_replacement = ""
    shown_bins = 24

    @property
    def engine(self) -> str:
        """Name of the engine and its method, as "Monte Carlo rk4"."""
        return f"Monte Carlo {self.method}"

    @property
    def deterministic(self) -> bool:
        """Whether nothing is random (`Scene.deterministic`): all realizations are one path."""
        return self.scene.deterministic

    @property
    def half_width(self) -> float | None:
        """Largest half width of the 95 % interval of survival; None where nothing is random."""
        return None if self.interval is None else float(0.5 * np.diff(self.interval).max())

    @property
    def metadata(self) -> dict[str, Any]:
        """Method, seed, sizes and half width by name; "outcome" of a single path.

        As in ``"deterministic: overturns to the left at τ = 7.62 (1.84 s)"``, with seconds where the block has a size.
        """
        settings = super().metadata | {"realizations": int(self.realizations)}
        return settings | ({"outcome": self._outcome()} if self.deterministic else {})

    def _outcome(self):
        if self.first_overturning is None:
            still = self.scene.start.at_rest and self.scene.forcing.lifting(self.scene.block.lift_off) <= 1.0
            return f"deterministic: {'rests' if still else 'stands'} until {self._time_text(self.times[-1])}"
        low, high, side = self.first_overturning
        at = f"at {self._time_text(high)}"
        when = at if low == high else f"between {self._time_text(low)} and {self._time_text(high)}"
        return f"deterministic: overturns to the {'left' if side < 0 else 'right'} {when}"

    def _time_text(self, time):
        size = self.scene.block.size
        return f"τ = {time:.4g}" + ("" if size is None else f" ({size.seconds(time):.3g} s)")

    def model_diagnostics(self) -> list[Diagnostic]:
        """Diagnostics of the model, of blocks that overturn and come back, and of the steps of a single path."""
        error = 0.0 if self.interval is None else 0.5 * float(np.diff(self.interval[-1])[0])
        returning = return_diagnostics(self.scene, 1.0 - float(self.survival[-1]), error, self.returns)
        return super().model_diagnostics() + returning + (path_diagnostics(self.method) if self.deterministic else [])

    @property
    def reason_if_ok(self) -> str:
        """Reason of the verdict "ok" on a deterministic scene, which has no sampling error."""
        return EXACT_PATH if self.deterministic else ""

    @property
    def title(self) -> str:
        """The engine, and the last survival with its interval or what the one path does, as a line of text."""
        return f"{self.label}, {self._outcome()}" if self.deterministic else super().title

    def overturning_text(self) -> str:
        """Text of the probability of overturning until the last time ± half of its 95 % interval; one path has no ±."""
        over = 1.0 - float(self.survival[-1])
        if self.interval is None:
            return f"P(overturned) = {over:.0f} (one path)"
        half = np.abs(self.interval[-1] - self.survival[-1]).max()
        return f"P(overturned) = {over:z.4f} ± {half:#.2g} (95 %, sampling)"

    def summary(self) -> dict[str, Any]:
        """Plain values for JSON: noise, rows, metadata, survival, "interval" (95 %), overturned, verdict, remarks."""
        values = super().summary()
        interval = values.pop("survival_interval", None)
        return values if interval is None else values | {"interval": interval}

    @property
    def interval(self) -> Array | None:
        """95 % limits of survival, shape (cycles + 1, 2); None where nothing is random."""
        return None if self.deterministic else self.survival_interval(0.95)

    @property
    def survivors(self) -> Array:
        """Number of realizations that have not overturned after each cycle, (cycles + 1,)."""
        return self.realizations - self.overturned_counts.sum(axis=1)

    @property
    def survival(self) -> Array:
        """Probability of not having overturned after each cycle, shape (cycles + 1,)."""
        return self.survivors / self.realizations

    @property
    def overturned(self) -> Array:
        """Probability of having overturned to the left and to the right, (cycles + 1, 2)."""
        return self.overturned_counts / self.realizations

    def derived(self) -> dict[str, Any]:
        """Survival with its 95 % interval, if it has one, and overturned, besides the bins."""
        interval = {} if self.interval is None else {"survival_interval": ("time limit", self.interval)}
        own = {"survival": ("time", self.survival), **interval, "overturned": ("time side", self.overturned)}
        return own | super().derived()

    def survival_interval(self, level: float = 0.95) -> Array:
        """Wilson's confidence limits of survival, (cycles + 1, 2); survival itself where nothing is random.

        Parameters
        ----------
        level : float
            Confidence of each interval, in (0, 1).
        """
        limits = wilson_interval(self.survivors, self.realizations, level)
        return np.stack([self.survival, self.survival], axis=-1) if self.deterministic else limits
