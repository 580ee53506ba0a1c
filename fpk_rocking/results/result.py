"""The interface of a result, whichever engine it comes from, for comparisons, tables, pictures and files."""

import functools
from typing import Any, Protocol

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.types import Array, ArrayLike
from fpk_rocking.results.binning import joint_edges
from fpk_rocking.results.remarks import doubts
from fpk_rocking.results.shown import Shown
from fpk_rocking.results.times import cycles_of
from fpk_rocking.results.trust import Trust, trust_of
from fpk_rocking.scene.scene import Scene


class Result(Protocol):
    """The joint law of angle and velocity after every forcing cycle, as an engine found it."""

    @property
    def scene(self) -> Scene:
        """As it was asked for."""

    @property
    def times(self) -> Array:
        """Times τ that it is for, from 0 on, shape (cycles + 1,).

        Whole cycles where the forcing repeats, else times of its own, which the rows and what is said of a cycle then
        count.
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
        """Seconds that it took."""

    @property
    def engine(self) -> str:
        """What it was found by, for tables and legends."""

    @property
    def realizations(self) -> int | None:
        """Size of a sample; None for what is none."""

    @property
    def closure(self) -> str:
        """How the noise of the scene was replaced by another; empty where it was not."""

    @property
    def averaged(self) -> bool:
        """Whether it is an average over the realizations of a noise of few harmonics."""

    @property
    def facts(self) -> dict[str, Any]:
        """What else it says of itself, as plain values: of a sample its seed and sizes, of a density its errors."""

    @property
    def account(self) -> str:
        """The most important of them as a sentence."""

    @property
    def trust(self) -> Trust:
        """Whether to use it."""

    def survival_interval(self, level: float = 0.95) -> Array | None:
        """Confidence limits of the survival of a sample, shape (cycles + 1, 2); None of what is no sample."""

    def bin_probabilities(self, cycle: int, angle_edges: ArrayLike, velocity_edges: ArrayLike) -> Array:
        """Probability of not having overturned and being in each bin, shape (angle bins, velocity bins)."""

    def at(self, cycle: int) -> Any:
        """Density after a cycle as a function on a mesh; None of what is known in bins only."""


class SurvivalResult(Shown):
    """What results of all engines have in common; a subclass has what `Result` says and leaves out here.

    `shown_bins` is how many bins an axis pictures show at least, 0 where only some bins are known.
    """

    averaged = False
    unresolved = ""

    @property
    def cycles(self) -> int | None:
        """Number of forcing cycles; None where the forcing does not repeat."""
        return cycles_of(self)

    @property
    def bin_edges(self) -> list[Array]:
        """Edges of the bins that it is shown in: those of `joint_edges`."""
        return joint_edges(self.scene)

    @functools.cached_property
    def trust(self) -> Trust:
        """Whether to use it: a verdict and its reasons, see `fpk_rocking.results.trust`."""
        return trust_of(self.facts, doubts(self))

    @property
    def headline(self) -> str:
        """What it is, and the survival at the end with its error, in a few words."""
        interval, survival = self.survival_interval(), float(self.survival[-1])
        if interval is None:
            error = f"{survival:.4f} ± {self.facts['error_estimate']:.1g}"
        else:
            error = f"{survival:.4f} ({interval[-1][0]:.4f} to {interval[-1][1]:.4f})"
        until = f"τ = {self.times[-1]:.4g}" if self.cycles is None else f"{self.cycles} cycles"
        return f"{label_of(self)}, survival {error} after {until}"

    def columns(self) -> dict[str, Array]:
        """Survival, its interval if any, and what overturned to either side, by cycle and time: arrays by name."""
        found = {} if self.cycles is None else {"cycle": np.arange(self.cycles + 1)}
        found |= {"time": self.times, "survival": self.survival}
        interval = self.survival_interval()
        if interval is not None:
            found |= dict(zip(("survival_low", "survival_high"), np.asarray(interval).T, strict=True))
        return found | dict(zip(("overturned_left", "overturned_right"), np.asarray(self.overturned).T, strict=True))

    def grids(self) -> tuple[dict[str, Any], dict[str, Any]]:
        """Arrays by name and coordinates for `to_xarray`; "bin_probability" is that of `bin_edges`."""
        edges, rows = self.bin_edges, range(len(self.times))
        bins = np.array([self.bin_probabilities(row, *edges) for row in rows])
        variables = {
            "survival": ("time", self.survival),
            "overturned": (("time", "side"), self.overturned),
            "bin_probability": (("time", "bin_angle", "bin_velocity"), bins),
        }
        coordinates = {"time": self.times, "side": ["left", "right"]}
        coordinates |= {
            name: 0.5 * (line[1:] + line[:-1]) for name, line in zip(("bin_angle", "bin_velocity"), edges, strict=True)
        }
        interval = self.survival_interval()
        if interval is not None:
            variables["survival_interval"] = ("time", "limit"), interval
            coordinates["limit"] = ["low", "high"]
        return variables, coordinates

    def plot(self, what: str | None = None, cycle: int | None = None) -> Any:
        """Draw the result.

        Parameters
        ----------
        what : str, optional
            "survival", with its 95 % interval or its estimated error; "bins", the probability in each bin over its
            area; "density", the density itself, of what has one. By default survival and bins.
        cycle : int, optional
            Of bins and density; by default the last after which more than one in a thousand stand.

        Returns
        -------
        matplotlib.figure.Figure

        Raises
        ------
        TypeError, ValueError
            There is no such picture of this result, or no such cycle.
        """
        from fpk_rocking.results.pictures import figure_of, result_panels

        if cycle is None:
            cycle = int(max(np.flatnonzero(np.asarray(self.survival) > 1e-3), default=0))
        known = ["survival", "bins"] + ["density"] * (cycle > 0 and self.at(cycle) is not None)
        if what is not None and what not in known:
            raise ValueError(checks.refusal("what", what, ", ".join(map(repr, known))))
        return figure_of(*result_panels(self, what, cycle))


class DensityResult(SurvivalResult):
    """What results of density solvers have in common; a subclass has ``scene``, ``times``, ``error_estimate``."""

    engine = "Fokker-Planck density"
    shown_bins = 64
    realizations = None

    def survival_interval(self, level: float = 0.95) -> None:  # noqa: ARG002  (the same call as of a sample)
        """Return None: a density is no sample; see its ``error_estimate``."""
        return

    @property
    def account(self) -> str:
        """Its errors as a sentence."""
        return (
            f"Estimated error of survival {self.error_estimate:.1e}, mass defect {self.mass_defect:.1e}, negative mass "
            f"{self.negative_mass:.1e}, {self.wall_s:.1f} s."
        )


def label_of(result) -> str:
    """Return the engine of a result and the size of a sample, as in ``"Monte Carlo rk4, 1,000 realizations"``."""
    return result.engine if result.realizations is None else f"{result.engine}, {result.realizations:,} realizations"
