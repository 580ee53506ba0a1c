"""Results that say how many blocks still stand, row by row, whichever engine they come from."""

import pathlib
from typing import TYPE_CHECKING, Any

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array, ArrayLike, File, Progress
from fpk_rocking.results.remarks import noise_text
from fpk_rocking.results.result import Result
from fpk_rocking.scene.axes import ascending_edges, joint_edges

LEAST_OVERTURNING = 1e-6
"""Probability of overturning below which the error of a density is held against this one."""


class RowResult(Result):
    """A result with a `scene` and a row for each of its `times` τ: in forcing cycles, if the forcing repeats."""

    if TYPE_CHECKING:
        times: Any

    row_dims = ("time",)

    def places(self) -> dict[str, Any]:
        """Places along the dimensions: "cycle" where the forcing repeats, "time" τ, and "time_s" in seconds."""
        cycle = {} if self.cycles is None else {"cycle": ("time", self.row_values)}
        seconds = {} if self.time_s is None else {"time_s": ("time", self.time_s)}
        return cycle | {"time": self.times} | seconds

    @property
    def cycles(self) -> int | None:
        """Number of forcing cycles; None where the forcing does not repeat."""
        return None if self.scene.period is None else round(float(self.times[-1]) / self.scene.period)

    @property
    def samples_per_cycle(self) -> int:
        """Number of rows in a forcing cycle; 1 where the forcing does not repeat."""
        return (len(self.times) - 1) // (self.cycles or len(self.times) - 1)

    @property
    def time_s(self) -> Array | None:
        """Times of the rows in seconds; None where the size of the block is unknown."""
        size = self.scene.block.size
        return None if size is None else size.seconds(np.asarray(self.times))

    @property
    def row_label(self) -> str:
        """What the rows are counted in, for axes and tables: "forcing cycles", "time, s" or "time τ"."""
        return "forcing cycles" if self.cycles is not None else "time τ" if self.time_s is None else "time, s"

    @property
    def row_values(self) -> Array:
        """Rows as `row_label` counts them, (rows,)."""
        if self.cycles is not None:
            rows, samples = np.arange(len(self.times)), self.samples_per_cycle
            return rows if samples == 1 else rows / samples
        return np.asarray(self.times) if self.time_s is None else self.time_s

    def when(self, row: int) -> str:
        """Return the time of a row, from 0 on, as a text: "after 3 cycles", "after 2.5 s" or "τ = 2.5".

        Parameters
        ----------
        row : int
        """
        if self.cycles is not None:
            return f"after {row / self.samples_per_cycle:.6g} cycle{'s' * (row != self.samples_per_cycle)}"
        return f"τ = {self.times[row]:.4g}" if self.time_s is None else f"after {self.time_s[row]:.4g} s"


class SurvivalResult(RowResult):
    """Survival and overturning of the blocks of a scene; `compare`, tables, pictures and VTK files take such results.

    Row k of an array is for ``times[k]``: after k forcing cycles, if the forcing repeats, or k parts of cycles where
    `samples_per_cycle` is above 1. A parameter ``cycle`` is a number of cycles, as 2 or 2.25 with 4 samples; where the
    forcing does not repeat, the number of a row. A subclass has ``_binned(row, edges)`` for `bin_probabilities`, and
    ``overturning_text()``, the last probability of overturning with its error. A density has ``at(cycle)``, itself as a
    function on a mesh.

    Attributes
    ----------
    scene : Scene
    times, survival : ndarray, shape (rows,)
        Nondimensional times from 0 on, and probability of not having overturned.
    overturned : ndarray, shape (rows, 2)
        Probability of having overturned to the left and to the right.
    wall_s : float
        Seconds of the call.
    engine : str
        Name for tables and legends.
    realizations : int or None
        Number of paths of a sample; None for a density.
    deterministic : bool
        Whether nothing is random: one path decides, without intervals.
    noise_replacement : str
        Which noise replaced that of the scene, as a sentence, or empty.
    shown_bins : int
        Least number of bins along an axis in pictures; 0 where only some bins are known.
    """

    if TYPE_CHECKING:  # of every subclass, listed above
        survival: Any
        overturned: Any
        wall_s: Any
        realizations: Any
        engine: Any
        deterministic: Any
        _binned: Any
        error_estimate: Any

    @property
    def interval(self) -> Array | None:
        """95 % limits of survival, shape (cycles + 1, 2); None for a density, and where nothing is random."""
        return None

    @property
    def overturning_error(self) -> float | None:
        """Relative error of the last probability of overturning; None where nothing is random or none overturned.

        The error is half the width of the 95 % interval for a sample. For a density it is the total error, or the
        solver's if the replacement of the noise was not checked.
        """
        if self.deterministic:
            return None
        over, total = 1.0 - float(self.survival[-1]), getattr(self, "total_error", None)
        if self.interval is not None:
            return 0.5 * float(np.diff(self.interval[-1])[0]) / over if over > 0.0 else None
        error = self.error_estimate if total is None else float(total[-1, 0])
        return error / max(over, LEAST_OVERTURNING)

    @property
    def bin_edges(self) -> tuple[Array, Array]:
        """Edges of the bins in pictures and tables, in angle and in velocity, nondimensional."""
        return joint_edges(self.scene)

    @property
    def label(self) -> str:
        """The engine and the size of a sample, as in ``"Monte Carlo rk4, 1,000 realizations"``."""
        if self.deterministic:
            return f"{self.engine}, one path"
        return self.engine if self.realizations is None else f"{self.engine}, {self.realizations:,} realizations"

    @property
    def title(self) -> str:
        """The engine, and the last survival with its error, as a line of text."""
        survival, until = float(self.survival[-1]), self.when(len(self.times) - 1).removeprefix("after ")
        if self.interval is None:
            error = f"{survival:.4f} ± {self.error_estimate:.1g}"
        else:
            error = f"{survival:.4f} ({self.interval[-1][0]:.4f} to {self.interval[-1][1]:.4f})"
        return f"{self.label}, survival {error} after {until}"

    def summary(self) -> dict[str, Any]:
        """Return a dict for JSON: "noise", "cycles" (their number) or "times" τ, and all of `Result.summary`."""
        rows = {"times": np.asarray(self.times).tolist()} if self.cycles is None else {"cycles": int(self.cycles)}
        rows |= {"samples_per_cycle": self.samples_per_cycle} if self.samples_per_cycle > 1 else {}
        return {"noise": noise_text(self.scene.noise)} | rows | super().summary()

    def derived(self) -> dict[str, Any]:
        """Probability in each of `bin_edges`, "bin_probability" (time, bin_angle, bin_velocity)."""
        return {"bin_probability": ("time bin_angle bin_velocity", self._all_bins)}

    def _all_bins(self):
        """Binned probabilities at all times, (times, angle bins, velocity bins)."""
        return np.array([self.bin_probabilities(self.cycle_of(k), *self.bin_edges) for k in range(len(self.times))])

    def row_of(self, cycle: float, name: str = "cycle") -> int:
        """Return the row of a number of cycles; TypeError or ValueError where there is none.

        Parameters
        ----------
        cycle : int or float
            As of `bin_probabilities`.
        name : str
            Of the parameter, for the error.
        """
        samples, last = self.samples_per_cycle, len(self.times) - 1
        if samples == 1:
            return checks.count(name, cycle, at_least=0, at_most=last)
        place = checks.number(name, cycle) * samples
        if not -0.5 < place < last + 0.5 or abs(place - round(place)) > 1e-6:
            raise ValueError(checks.refusal(name, cycle, f"0 to {self.cycles} in steps of 1/{samples}"))
        return round(place)

    def cycle_of(self, row: int) -> float:
        """Return the number of cycles of a row, where the forcing does not repeat that of the row.

        Parameters
        ----------
        row : int
            From 0.
        """
        return row if self.samples_per_cycle == 1 else row / self.samples_per_cycle

    def places(self) -> dict[str, Any]:
        """Places along the dimensions by name: those of `RowResult`, and the middles of the bins."""
        middles = (0.5 * (line[1:] + line[:-1]) for line in self.bin_edges)
        return super().places() | dict(zip(("bin_angle", "bin_velocity"), middles, strict=True))

    def bin_probabilities(self, cycle: float, angle_edges: ArrayLike, velocity_edges: ArrayLike) -> Array:
        """Return the probability of standing with angle and velocity in each of some bins.

        Parameters
        ----------
        cycle : int or float
            From 0.
        angle_edges, velocity_edges : array_like
            Ascending, nondimensional, as of `numpy.histogram2d`; of a `Tally`, among the edges that were counted.

        Returns
        -------
        ndarray, shape (angle bins, velocity bins)
            Blocks at rest are in the bin that contains (0, 0). A bin of a density may be slightly below 0 where the
            mesh does not resolve it.

        Raises
        ------
        TypeError, ValueError
            There is no such cycle, or the edges do not ascend or were not counted.
        """
        row = self.row_of(cycle)
        named = ("angle_edges", angle_edges), ("velocity_edges", velocity_edges)
        return self._binned(row, [ascending_edges(name, values, finite=False) for name, values in named])

    def plot(self, what: str | None = None, cycle: float | None = None) -> Any:
        """Draw the result; returns a matplotlib figure, and raises TypeError or ValueError where there is none.

        Parameters
        ----------
        what : str, optional
            "survival", with its 95 % interval or estimated error; "bins", the probability in each divided by its area;
            "density", where there is one. By default survival and bins.
        cycle : int or float, optional
            Of the bins or the density; by default the last after which more than one block in 1,000 stands.
        """
        from fpk_rocking.results.pictures import figure_of, result_panels

        if cycle is None:
            cycle = self.cycle_of(int(max(np.flatnonzero(np.asarray(self.survival) > 1e-3), default=0)))
        names = ["survival", "bins"] + ["density"] * (cycle > 0 and self.realizations is None)
        if what is not None and what not in names:
            raise ValueError(checks.refusal("what", what, ", ".join(map(repr, names))))
        return figure_of(*result_panels(self, what, cycle))

    def animate(self, path: File, *, frames_per_second: float = 10.0, progress: Progress | None = None) -> pathlib.Path:
        """Write a movie, a frame for each row: probability in bins over the plane, what has overturned, and survival.

        Rows within the cycles are asked for by ``samples_per_cycle`` of `solve_fpk` and `montecarlo.simulate`.

        Parameters
        ----------
        path : str or pathlib.Path
            The suffix chooses the format: .gif, or .mp4, which needs the program ffmpeg.
        frames_per_second : float
            Above 0.
        progress : callable, optional
            Called as ``progress(done, total)`` after each frame.

        Raises
        ------
        TypeError, ValueError
            A parameter is refused, or ffmpeg is missing.
        OSError
            The file cannot be written, or ffmpeg fails.
        """
        from fpk_rocking.results.movie import write_movie

        return write_movie(path, self, frames_per_second, progress)
