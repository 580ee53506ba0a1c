"""The interface of a result, whichever engine it comes from, for comparisons, tables, pictures and files."""

from typing import Protocol

import numpy as np

from fpk_rocking.results.times import cycles_of
from fpk_rocking.scene.scene import Scene


class Result(Protocol):
    """The joint law of angle and velocity after every forcing cycle, as an engine found it.

    Attributes
    ----------
    scene : Scene
        As it was asked for.
    times : ndarray, shape (cycles + 1,)
        Times τ that it is for, from 0 on: whole cycles where the forcing repeats, else times of its own, which the rows
        and what is said of a cycle then count.
    cycles : int or None
        Forcing cycles; None where the forcing does not repeat.
    survival : ndarray, shape (cycles + 1,)
        Probability of not having overturned by kT.
    overturned : ndarray, shape (cycles + 1, 2)
        Probability of having overturned by kT to the left and to the right.
    wall_s : float
        Seconds that it took.
    engine : str
        What it was found by, for tables and legends.
    realizations : int or None
        Size of a sample; None for what is none.
    closure : str
        How the noise of the scene was replaced by another; empty where it was not.
    averaged : bool
        Whether it is an average over the realizations of a noise of few harmonics.
    facts : dict
        What else it says of itself, as plain values: of a sample its seed and sizes, of a density its errors.
    account : str
        The most important of them as a sentence.
    """

    scene: Scene
    times: np.ndarray
    cycles: int | None
    survival: np.ndarray
    overturned: np.ndarray
    wall_s: float
    engine: str
    realizations: int | None
    closure: str
    averaged: bool
    facts: dict
    account: str

    def survival_interval(self, level=0.95):
        """Confidence limits of the survival of a sample, shape (cycles + 1, 2); None of what is no sample."""

    def bin_probabilities(self, cycle, angle_edges, velocity_edges):
        """Probability of not having overturned and being in each bin, shape (angle bins, velocity bins)."""

    def at(self, cycle):
        """Density after a cycle as a function on a mesh; None of what is known in bins only."""


class DensityResult:
    """What results of density solvers have in common; a subclass has ``scene``, ``times``, ``error_estimate`` and the like."""

    engine = "Fokker-Planck density"
    realizations = None
    averaged = False
    unresolved = ""

    @property
    def cycles(self):
        """Number of forcing cycles; None where the forcing does not repeat."""
        return cycles_of(self)

    def survival_interval(self, level=0.95):  # noqa: ARG002  (the same call as of a sample)
        """Return None: a density is no sample; see its ``error_estimate``."""
        return

    @property
    def account(self):
        """Its errors as a sentence."""
        return (
            f"Estimated error of survival {self.error_estimate:.1e}, mass defect {self.mass_defect:.1e}, negative mass "
            f"{self.negative_mass:.1e}, {self.wall_s:.1f} s."
        )


def label_of(result) -> str:
    """Return the engine of a result and the size of a sample, as in ``"Monte Carlo rk4, 1,000 realizations"``."""
    return result.engine if result.realizations is None else f"{result.engine}, {result.realizations:,} realizations"
