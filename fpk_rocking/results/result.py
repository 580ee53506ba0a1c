"""The interface of a result, whichever engine it comes from, for comparisons, tables, pictures and files."""

from typing import Any, Protocol

from fpk_rocking.base.types import Array, ArrayLike
from fpk_rocking.results.times import cycles_of
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

    def survival_interval(self, level: float = 0.95) -> Array | None:
        """Confidence limits of the survival of a sample, shape (cycles + 1, 2); None of what is no sample."""

    def bin_probabilities(self, cycle: int, angle_edges: ArrayLike, velocity_edges: ArrayLike) -> Array:
        """Probability of not having overturned and being in each bin, shape (angle bins, velocity bins)."""

    def at(self, cycle: int) -> Any:
        """Density after a cycle as a function on a mesh; None of what is known in bins only."""


class DensityResult:
    """What results of density solvers have in common, for a subclass with ``scene``, ``times``, ``error_estimate``."""

    engine = "Fokker-Planck density"
    realizations = None
    averaged = False

    @property
    def cycles(self) -> int | None:
        """Number of forcing cycles; None where the forcing does not repeat."""
        return cycles_of(self)

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
