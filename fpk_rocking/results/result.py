"""The interface of a result, whichever engine it comes from, for comparisons, tables, pictures and files."""

import dataclasses
import functools
from typing import TYPE_CHECKING, Any, Protocol, Self

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.types import Array, ArrayLike
from fpk_rocking.results.binning import joint_edges
from fpk_rocking.results.remarks import doubts
from fpk_rocking.results.replacement import measured
from fpk_rocking.results.shown import Shown
from fpk_rocking.results.times import cycles_of, seconds_of, when
from fpk_rocking.results.trust import Trust, trust_of
from fpk_rocking.scene.scene import Scene


class Result(Protocol):
    """What a result of any engine has; `compare`, tables, pictures and VTK files take every such object.

    Examples
    --------
    >>> from fpk_rocking import load_scene, solve_fpk
    >>> from montecarlo import simulate
    >>> scene = load_scene("main")
    >>> for result in (solve_fpk(scene, cycles=4, tol=1e-2), simulate(scene, cycles=4, realizations=1000)):
    ...     print(result.engine, result.survival[4].round(2))
    Fokker-Planck density 0.86
    Monte Carlo exact 0.86
    """

    @property
    def scene(self) -> Scene:
        """The scene that was given."""

    @property
    def times(self) -> Array:
        """Times τ of the rows of all arrays, from 0 on, shape (cycles + 1,).

        They are whole cycles where the forcing repeats. Where it does not, a parameter ``cycle`` is a row's number.
        """

    @property
    def cycles(self) -> int | None:
        """Forcing cycles; None where the forcing does not repeat."""

    @property
    def survival(self) -> Array:
        """Probability of not having overturned by kT, shape (cycles + 1,)."""

    @property
    def overturned(self) -> Array:
        """Probability of having overturned by kT to the left and to the right, shape (cycles + 1, 2)."""

    @property
    def wall_s(self) -> float:
        """Seconds that the call took."""

    @property
    def engine(self) -> str:
        """Name of the engine, for tables and legends."""

    @property
    def realizations(self) -> int | None:
        """Number of realizations of a sample; None for a density."""

    @property
    def deterministic(self) -> bool:
        """Whether nothing is random, so that one path decides and there are no intervals."""

    @property
    def outcome(self) -> str:
        """What the one path of a deterministic scene does, as a text; empty for any other result."""

    @property
    def closure(self) -> str:
        """Which noise replaced that of the scene, as a sentence; empty where none did."""

    @property
    def facts(self) -> dict[str, Any]:
        """Further plain values by name: seed and sizes of a sample, error figures of a density."""

    @property
    def account(self) -> str:
        """The most important of these values as a sentence."""

    @property
    def trust(self) -> Trust:
        """Verdict with its reasons: "ok", "caution" or "do not use"."""

    def survival_interval(self, level: float = 0.95) -> Array | None:
        """Confidence limits of survival.

        Parameters
        ----------
        level : float
            Confidence of each interval, in (0, 1).

        Returns
        -------
        ndarray, shape (cycles + 1, 2), or None
            None for a density, which is no sample.
        """

    def bin_probabilities(self, cycle: int, angle_edges: ArrayLike, velocity_edges: ArrayLike) -> Array:
        """Probability of standing, with angle and velocity in each of some bins.

        Parameters
        ----------
        cycle : int
            Number of the row.
        angle_edges, velocity_edges : array_like
            Ascending bin edges, nondimensional.

        Returns
        -------
        ndarray, shape (angle bins, velocity bins)
        """

    def at(self, cycle: int) -> Any:
        """Return the density as a function on a mesh.

        Parameters
        ----------
        cycle : int
            Number of the row.

        Returns
        -------
        Density, or None
            None for a sample, which is known in bins only.
        """


# For the type checker alone, as with `Shown`.
if TYPE_CHECKING:
    _Result = Result
else:
    _Result = object


class SurvivalResult(Shown, _Result):
    """What results of all engines have in common; a subclass adds the rest of `Result`.

    `shown_bins` is the least number of bins along an axis in pictures, 0 where only some bins are known.
    """

    shown_bins: int

    @property
    def cycles(self) -> int | None:
        """Number of forcing cycles; None where the forcing does not repeat."""
        return cycles_of(self)

    @property
    def bin_edges(self) -> tuple[Array, Array]:
        """Edges of the bins in pictures and tables: angles and velocities, nondimensional."""
        return joint_edges(self.scene)

    @functools.cached_property
    def trust(self) -> Trust:
        """Verdict with its reasons: "ok", "caution" or "do not use"."""
        return trust_of(self.facts, doubts(self))

    @property
    def headline(self) -> str:
        """The engine, and the last survival with its error or what the one path does, as a line of text."""
        if self.deterministic:
            return f"{label_of(self)}, {self.outcome}"
        interval, survival = self.survival_interval(), float(self.survival[-1])
        if interval is None:
            error = f"{survival:.4f} ± {self.facts['error_estimate']:.1g}"
        else:
            error = f"{survival:.4f} ({interval[-1][0]:.4f} to {interval[-1][1]:.4f})"
        until = when(self, len(self.times) - 1).removeprefix("after ")
        return f"{label_of(self)}, survival {error} after {until}"

    @property
    def answer(self) -> str:
        """Probability of overturning until the last time with its whole error, as a line of text."""
        last, size = len(self.times) - 1, self.scene.block.dimensions
        seconds = "" if size is None or self.cycles is None else f" ({seconds_of(self)[last]:.4g} s)"
        return f"{self._whole()}, {when(self, last)}{seconds}"

    def _whole(self):
        """Probability of overturning at the last time with its errors, as a text."""
        over, interval = 1.0 - float(self.survival[-1]), self.survival_interval()
        if self.deterministic or interval is None:
            return f"P(overturned) = {over:.0f} (one path)"
        return f"P(overturned) = {over:z.4f} ± {np.abs(interval[-1] - self.survival[-1]).max():#.2g} (95 %, sampling)"

    def columns(self) -> dict[str, Array]:
        """Table of survival and overturned to either side, a row a time: arrays by column name."""
        interval, (left, right) = interval_of(self), np.asarray(self.overturned).T
        return {
            **({} if self.cycles is None else {"cycle": np.arange(self.cycles + 1)}),
            "time": self.times,
            **({} if self.scene.block.dimensions is None else {"time_s": seconds_of(self)}),
            "survival": self.survival,
            **({} if interval is None else {"survival_low": interval[:, 0], "survival_high": interval[:, 1]}),
            "overturned_left": left,
            "overturned_right": right,
        }

    def grids(self) -> tuple[dict[str, Any], dict[str, Any]]:
        """Arrays with named dimensions, and their coordinates, of which `to_xarray` makes a dataset."""
        edges, interval = self.bin_edges, interval_of(self)
        angle, velocity = (0.5 * (line[1:] + line[:-1]) for line in edges)
        bins = np.array([self.bin_probabilities(row, *edges) for row in range(len(self.times))])
        variables: dict[str, Any] = {
            "survival": ("time", self.survival),
            "overturned": (("time", "side"), self.overturned),
            "bin_probability": (("time", "bin_angle", "bin_velocity"), bins),
        }
        coordinates = {"time": self.times, "side": ["left", "right"], "bin_angle": angle, "bin_velocity": velocity}
        if interval is not None:
            variables["survival_interval"] = ("time", "limit"), interval
            coordinates["limit"] = ["low", "high"]
        return variables, coordinates

    def plot(self, what: str | None = None, cycle: int | None = None) -> Any:
        """Draw the result.

        Parameters
        ----------
        what : str, optional
            "survival", with its 95 % interval or estimated error if it has one; "bins", the probability in each bin
            divided by its area; "density", the density itself where there is one. By default survival and bins.
        cycle : int, optional
            Cycle of the bins or the density; by default the last one after which more than one block in 1,000 stands.

        Returns
        -------
        matplotlib.figure.Figure

        Raises
        ------
        TypeError, ValueError
            This result has no such picture, or no such cycle.
        """
        from fpk_rocking.results.pictures import figure_of, result_panels

        if cycle is None:
            cycle = int(max(np.flatnonzero(np.asarray(self.survival) > 1e-3), default=0))
        known = ["survival", "bins"] + ["density"] * (cycle > 0 and self.at(cycle) is not None)
        if what is not None and what not in known:
            raise ValueError(checks.refusal("what", what, ", ".join(map(repr, known))))
        return figure_of(*result_panels(self, what, cycle))


class Errors(Protocol):
    """Error figures that a subclass of `DensityResult` provides."""

    @property
    def error_estimate(self) -> float:
        """Estimated error of survival."""

    @property
    def mass_defect(self) -> float:
        """Probability that the solver created or lost."""

    @property
    def negative_mass(self) -> float:
        """Integral of the density where it is below 0."""

    @property
    def moving_negative_mass(self) -> float:
        """The same without the blocks at rest."""


if TYPE_CHECKING:
    _Errors = Errors
else:
    _Errors = object


class DensityResult(SurvivalResult, _Errors):
    """What results of density solvers have in common.

    A subclass is a dataclass with the rest of `Result`, `Errors` and ``replacement``, which is None until `checked`
    measures it.
    """

    engine = "Fokker-Planck density"
    shown_bins = 64
    realizations = None
    deterministic = False
    outcome = ""

    def survival_interval(self, level: float = 0.95) -> None:  # noqa: ARG002  (the same call as of a sample)
        """Return None: a density is no sample. Its ``error_estimate`` is that of the solver.

        Parameters
        ----------
        level : float
            Not used.
        """
        return

    def checked(self, paths: Any) -> Self:
        """Return this result with its replacement of noise measured by paths under the noise of the scene.

        Parameters
        ----------
        paths : Ensemble or Tally
            Of the scene as it is, at the times of this result or more; `fpk_rocking.studies.checked` samples them.

        Returns
        -------
        DensityResult
            The same probabilities; `replacement`, `total_error` and the verdict tell what the paths say.

        Raises
        ------
        TypeError, ValueError
            The paths are no sample, are of another scene or of other times, or no noise was replaced.
        """
        if not isinstance(paths, SurvivalResult) or paths.realizations is None:
            raise TypeError(checks.refusal("paths", type(paths).__name__, "an Ensemble or a Tally"))
        return dataclasses.replace(self, replacement=measured(self, paths))  # type: ignore[type-var]  # is a dataclass

    @property
    def total_error(self) -> Array | None:
        """Whole errors of survival, overturned left and overturned right, shape (cycles + 1, 3).

        The solver's estimate where the noise was solved as it is; `Replacement.total` where another noise replaced it
        and that was checked; None where it was not checked.
        """
        if self.replacement is not None:
            return self.replacement.total(self.error_estimate)
        return None if self.closure else np.full((len(self.times), 3), self.error_estimate)

    @property
    def replacement_facts(self) -> dict[str, Any]:
        """The largest total error, and the measured replacement, as plain values; empty where nothing was checked."""
        if self.replacement is None or self.total_error is None:
            return {}
        return {"total_error": float(self.total_error.max()), "replacement": self.replacement.plain}

    @property
    def headline(self) -> str:
        """The engine, and the last probability with its error, as a line of text."""
        if not self.closure:
            return super().headline
        until = when(self, len(self.times) - 1).removeprefix("after ")
        return f"{self.engine}, {self._whole()}, after {until}"

    def _whole(self):
        """Probability of overturning at the last time, its numerical and its whole error, as a text."""
        text = f"P(overturned) = {1.0 - self.survival[-1]:z.4f} ± {self.error_estimate:.1g} (numerics)"
        if not self.closure:
            return text
        if self.replacement is None or self.total_error is None:
            return f"{text}, replacement of the noise: not checked"
        found, error = -self.replacement.difference[-1, 0], self.replacement.sampling_error[-1, 0]
        return f"{text}, replacement of the noise: {found:+z.4f} ± {error:#.2g}, total ± {self.total_error[-1, 0]:#.2g}"

    @property
    def check(self) -> str:
        """The probability of overturning with its whole error, and how the replacement of the noise was measured."""
        check = self.replacement
        if check is None:
            return ""
        return (
            f"{self._whole()}. Replacement: {check.realizations:,} paths under the noise of the scene ({check.method}, "
            f"seed {check.seed}, {check.wall_s:.1f} s) less the density, with its 95 % sampling error. Total: numerics "
            "+ |replacement| + sampling error."
        )

    @property
    def account(self) -> str:
        """Error figures and the seconds of the call, as a sentence."""
        return (
            f"Estimated error of survival {self.error_estimate:.1e}; mass defect (probability that the solver created "
            f"or lost) {self.mass_defect:.1e}; negative mass (integral of the density where it is below 0) "
            f"{self.negative_mass:.1e}, without the blocks at rest {self.moving_negative_mass:.1e}; "
            f"{self.wall_s:.1f} s."
        )


def interval_of(result: Any) -> Array | None:
    """Return the 95 % limits of survival that are shown; None for a density, and where nothing is random."""
    return None if result.deterministic else result.survival_interval(0.95)


def label_of(result: Any) -> str:
    """Return the engine of a result and the size of a sample, as in ``"Monte Carlo rk4, 1,000 realizations"``."""
    if result.deterministic:
        return f"{result.engine}, one path"
    return result.engine if result.realizations is None else f"{result.engine}, {result.realizations:,} realizations"
