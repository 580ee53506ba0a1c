"""Samples of realizations: what an ensemble and a tally have in common, and the ensemble.

An ensemble keeps the states of all its realizations at the Poincaré points.
"""

import dataclasses
import functools
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np

from fpk_rocking.base.checks import Array
from fpk_rocking.results.remarks import EXACT_PATH, path_diagnostics
from fpk_rocking.results.result import Dataset
from fpk_rocking.results.sampling import return_diagnostics, wilson_interval
from fpk_rocking.results.storage import Saved
from fpk_rocking.results.survival import SurvivalResult
from fpk_rocking.results.trust import Diagnostic
from fpk_rocking.scene.scene import Scene


class Sample(SurvivalResult):
    """What an ensemble and a tally have in common: survival from counts, with its sampling error.

    A subclass is a dataclass with the scene, `method`, `seed`, `steps_per_cycle` and `wall_s`. It has besides

    * ``realizations``: their number;
    * ``overturned_counts``: how many have overturned to the left and to the right, (cycles + 1, 2);
    * ``returns``: how many paths that overturned were followed on to the fall, and how many of them came back, (2,);
    * ``first_overturning``: earliest and latest time of overturning of the first realization, and the side; None if it
      stands.
    """

    if TYPE_CHECKING:
        method: Any
        overturned_counts: Any
        returns: Any
        first_overturning: Any

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
        """Method, seed and sizes, half width, or what the one path does as "outcome": plain values by name.

        The outcome is as in ``"deterministic: overturns to the left at τ = 7.62 (1.84 s)"``, with seconds where the
        size of the block is known.
        """
        settings = super().metadata | {"realizations": int(self.realizations)}
        return settings | ({"outcome": self._outcome()} if self.deterministic else {})

    def _outcome(self):
        """Return what the one path of a deterministic scene does as a text: whether, where and when it overturns."""
        if self.first_overturning is None:
            return f"deterministic: stands until {self._time_text(self.times[-1])}"
        low, high, side = self.first_overturning
        at = f"at {self._time_text(high)}"
        when = at if low == high else f"between {self._time_text(low)} and {self._time_text(high)}"
        return f"deterministic: overturns to the {'left' if side < 0 else 'right'} {when}"

    def _time_text(self, time):
        """Return a `time` τ (float) as a text, with seconds where the size of the block is known."""
        size = self.scene.block.size
        return f"τ = {time:.4g}" + ("" if size is None else f" ({size.seconds(time):.3g} s)")

    def model_diagnostics(self) -> list[Diagnostic]:
        """Diagnostics of this sample beside its sampling error: of the model, and of the steps of a single path.

        The model's are also those of blocks that count as overturned and come back.
        """
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
        """Return a dict for JSON: noise, rows, metadata, survival, "interval" (95 %), overturned, verdict, remarks."""
        values = super().summary()
        interval = values.pop("survival_interval", None)
        return values if interval is None else values | {"interval": interval}

    def at(self, cycle: int) -> None:  # noqa: ARG002  (the same call as of a density)
        """Return None: a sample has no density. Use `bin_probabilities`.

        Parameters
        ----------
        cycle : int
            Not used.
        """
        return

    @property
    def survivors(self) -> Array:
        """Number of realizations that have not overturned after each cycle, shape (cycles + 1,)."""
        return self.realizations - self.overturned_counts.sum(axis=1)

    @property
    def survival(self) -> Array:
        """Probability of not having overturned after each cycle, shape (cycles + 1,)."""
        return self.survivors / self.realizations

    @property
    def overturned(self) -> Array:
        """Probability of having overturned, after each cycle, to the left and to the right, shape (cycles + 1, 2)."""
        return self.overturned_counts / self.realizations

    def survival_interval(self, level: float = 0.95) -> Array:
        """Return Wilson's confidence limits of survival; of a deterministic scene survival itself, which is exact.

        Parameters
        ----------
        level : float
            Confidence of each interval, in (0, 1).

        Returns
        -------
        ndarray, shape (cycles + 1, 2)
        """
        limits = wilson_interval(self.survivors, self.realizations, level)
        return np.stack([self.survival, self.survival], axis=-1) if self.deterministic else limits


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Ensemble(Saved, Sample):
    """Independent realizations of a scene; all quantities are nondimensional.

    Column k of an array is for the time kT after k forcing cycles. Where the forcing does not repeat there are no
    cycles: it is then for ``times[k]``, and a parameter ``cycle`` is such a number k.

    Parameters
    ----------
    scene : Scene
        The scene that was given to `simulate`.
    method : str
        "exact", "rk4", "white" or "filtered".
    seed : int
        Seed of the random numbers.
    steps_per_cycle : int
        As given to `simulate`.
    wall_s : float
        Seconds that the call took, compilation included.
    times : ndarray, shape (cycles + 1,)
        Times τ of the states, from 0 on.
    angle, velocity : ndarray, shape (realizations, cycles + 1)
        States at these times: Poincaré points where the forcing repeats; nan after overturning.
    overturn_time : ndarray, shape (realizations,)
        Time τ of overturning; nan for a block that stands.
    overturn_side : ndarray of int8, shape (realizations,)
        -1 for a block that overturned to the left, +1 to the right, 0 for one that stands.
    returns : ndarray of int, shape (2,)
        How many paths that overturned were followed on to the fall, 90 degrees, and how many of these came back. 0
        where the critical angle is unknown, or the angle of overturning is not the default.

    Examples
    --------
    >>> from fpk_rocking import load_scene
    >>> from montecarlo import simulate
    >>> ensemble = simulate(load_scene("main"), cycles=4, realizations=1000)
    >>> print(ensemble.survival.round(2), ensemble.angle.shape)
    [1.   1.   1.   0.97 0.86] (1000, 5)
    >>> print(ensemble.overturned[4])
    [0.027 0.111]
    """

    kind: ClassVar = "ensemble"
    scene: Scene
    method: str
    seed: int
    steps_per_cycle: int
    wall_s: float
    times: Annotated[Array, "f8 k+1"]
    angle: Annotated[Array, "f8 n k+1"]
    velocity: Annotated[Array, "f8 n k+1"]
    overturn_time: Annotated[Array, "f8 n"]
    overturn_side: Annotated[Array, "i1 n"]
    returns: Annotated[Array, "i8 2"]

    @property
    def realizations(self) -> int:
        """Number of realizations."""
        return self.angle.shape[0]

    @property
    def at_rest(self) -> Array:
        """Part of the realizations (cycles + 1,) at rest, angle and velocity 0: a part of survival.

        Under white noise no block rests after the start.
        """
        return np.count_nonzero((self.angle == 0.0) & (self.velocity == 0.0), axis=0) / self.realizations

    @functools.cached_property
    def overturned_counts(self) -> Array:
        """Number of realizations that have overturned to the left and to the right, shape (cycles + 1, 2)."""
        sides = [np.count_nonzero(np.isnan(self.angle[self.overturn_side == side]), axis=0) for side in (-1, 1)]
        return np.stack(sides, axis=-1)

    @property
    def first_overturning(self) -> tuple[float, float, int] | None:
        """(time, time, side) of overturning of realization 0: τ twice, and -1 or 1; None if it stands."""
        time, side = float(self.overturn_time[0]), int(self.overturn_side[0])
        return (time, time, side) if side else None

    def _binned(self, row, edges):
        """Return the shares of all realizations that stand in each bin at a `row`, shape (angle bins, velocity bins).

        `row` (int) is the number of a time; `edges` are a pair of arrays, bin edges in angle and velocity.
        """
        standing = np.isfinite(self.angle[:, row])
        points = self.angle[standing, row], self.velocity[standing, row]
        return np.histogram2d(*points, bins=edges)[0] / self.realizations

    def dataset(self) -> Dataset:
        """Return the `Dataset` (named arrays) of a `Sample`, with states and overturnings of every realization."""
        dataset = super().dataset()
        dataset.variables.update(
            angle=(("realization", "time"), self.angle),
            velocity=(("realization", "time"), self.velocity),
            overturn_time=("realization", self.overturn_time),
            overturn_side=("realization", self.overturn_side),
        )
        return dataset
