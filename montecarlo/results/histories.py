"""The result of `histories`: states between the Poincaré points of some realizations, and their impacts."""

import dataclasses
from typing import Self

import numpy as np

from fpk_rocking.base.types import Array, File
from fpk_rocking.physics.forcing import refuse_transient
from fpk_rocking.results import storage
from fpk_rocking.results.layout import Layout
from fpk_rocking.scene.scene import Scene

_LAYOUT = Layout(
    {
        "time": "f8 k",
        "angle": "f8 n k",
        "velocity": "f8 n k",
        "overturn_time": "f8 n",
        "overturn_side": "i1 n",
        "impact_realization": "i8 i",
        "impact_time": "f8 i",
        "impact_velocity": "f8 i",
    },
    {"method": str, "seed": int, "steps_per_cycle": int, "samples_per_cycle": int, "wall_s": float},
)


@dataclasses.dataclass(frozen=True, eq=False)
class Histories:
    """Time histories of independent realizations; all quantities are nondimensional, n = cycles * samples + 1.

    Parameters
    ----------
    scene : Scene
        As it was asked for.
    method : str
        Name of the engine.
    seed : int
        With a realization's number, all that its random numbers depend on.
    steps_per_cycle, samples_per_cycle : int
        As they were asked for.
    wall_s : float
        Seconds that the simulation took, compilation included.
    time : ndarray, shape (n,)
        Times τ of the states, equally spaced from 0 where the forcing repeats.
    angle, velocity : ndarray, shape (realizations, n)
        States; nan after overturning.
    overturn_time : ndarray, shape (realizations,)
        Time τ of overturning, nan where it never came.
    overturn_side : ndarray of int8, shape (realizations,)
        -1 overturned to the left, +1 to the right, 0 not at all.
    impact_realization : ndarray of int, shape (n_impacts,)
        Realization of each impact, ascending; its impacts are in the order of time.
    impact_time, impact_velocity : ndarray, shape (n_impacts,)
        Time τ of each impact, and the velocity just before it. Impacts that a method sums as chatter are not listed.
    """

    scene: Scene
    method: str
    seed: int
    steps_per_cycle: int
    samples_per_cycle: int
    wall_s: float
    time: np.ndarray
    angle: np.ndarray
    velocity: np.ndarray
    overturn_time: np.ndarray
    overturn_side: np.ndarray
    impact_realization: np.ndarray
    impact_time: np.ndarray
    impact_velocity: np.ndarray

    def __post_init__(self):
        for name in _LAYOUT.arrays:
            getattr(self, name).flags.writeable = False

    @property
    def realizations(self) -> int:
        """Number of realizations."""
        return self.angle.shape[0]

    @property
    def cycles(self) -> int | None:
        """Number of forcing cycles; None where the forcing does not repeat."""
        return None if self.scene.period is None else (self.time.size - 1) // self.samples_per_cycle

    @property
    def impacts(self) -> Array:
        """Number of impacts of each realization, shape (realizations,)."""
        return np.bincount(self.impact_realization, minlength=self.realizations)

    def poincare(self) -> tuple[Array, Array]:
        """Return angle and velocity at τ = kT, each of shape (realizations, cycles + 1); nan after overturning."""
        refuse_transient(self.scene.forcing, "a Poincaré map")
        return self.angle[:, :: self.samples_per_cycle], self.velocity[:, :: self.samples_per_cycle]

    def save(self, path: File) -> None:
        """Save the histories, whole or not at all; `path` by custom ends in .npz."""
        storage.write_result(path, "histories", self.scene, *_LAYOUT.of(self))

    @classmethod
    def load(cls, path: File) -> Self:
        """Load saved histories; raises as `fpk_rocking.results.storage.read_result`."""
        scene, arrays, attributes = storage.read_result(path, "histories", _LAYOUT)
        return cls(scene=scene, **arrays, **attributes)
