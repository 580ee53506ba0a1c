"""The result of a simulation: every realization's Poincaré points and its overturning."""

import dataclasses
import functools
from typing import Any, Self

import numpy as np

from fpk_rocking.base.types import Array, ArrayLike, File
from fpk_rocking.results import storage
from fpk_rocking.results.binning import ascending_edges
from fpk_rocking.results.layout import Layout
from fpk_rocking.scene.scene import Scene
from montecarlo.results.sample import Sample

_LAYOUT = Layout(
    {"times": "f8 k+1", "angle": "f8 n k+1", "velocity": "f8 n k+1", "overturn_time": "f8 n", "overturn_side": "i1 n"},
    {"method": str, "seed": int, "steps_per_cycle": int, "wall_s": float},
)


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Ensemble(Sample):
    """Independent realizations of a scene; all quantities are nondimensional.

    Parameters
    ----------
    scene : Scene
        As it was asked for.
    method : str
        "rk4", "exact", "white" or "filtered".
    seed : int
        With a realization's number, all that its random numbers depend on.
    steps_per_cycle : int
        As it was asked for.
    wall_s : float
        Seconds that the simulation took, compilation included.
    times : ndarray, shape (cycles + 1,)
        Times τ of the states, from 0 on: kT, the whole cycles, where the forcing repeats. Where it does not, there are
        no cycles, and rows and what is said of a cycle count these times.
    angle, velocity : ndarray, shape (realizations, cycles + 1)
        States at the times, Poincaré points where the forcing repeats; nan after overturning.
    overturn_time : ndarray, shape (realizations,)
        Time τ of overturning, nan where it never came.
    overturn_side : ndarray of int8, shape (realizations,)
        -1 overturned to the left, +1 to the right, 0 not at all.
    """

    scene: Scene
    method: str
    seed: int
    steps_per_cycle: int
    wall_s: float
    times: np.ndarray
    angle: np.ndarray
    velocity: np.ndarray
    overturn_time: np.ndarray
    overturn_side: np.ndarray

    def __post_init__(self):
        for name in _LAYOUT.arrays:
            getattr(self, name).flags.writeable = False

    @property
    def realizations(self) -> int:
        """Number of realizations."""
        return self.angle.shape[0]

    @functools.cached_property
    def _gone(self):
        sides = [np.count_nonzero(np.isnan(self.angle[self.overturn_side == side]), axis=0) for side in (-1, 1)]
        return np.stack(sides, axis=-1)

    def bin_probabilities(self, cycle: int, angle_edges: ArrayLike, velocity_edges: ArrayLike) -> Array:
        """Estimate P(not overturned and in a bin) after a cycle.

        Parameters
        ----------
        cycle : int
            0 to `cycles`, or the number of one of the `times`.
        angle_edges, velocity_edges : array_like
            Two or more ascending edges; the bins are those of `numpy.histogram2d`.

        Returns
        -------
        ndarray, shape (n_angle, n_velocity)
            Sums to the survival where the bins cover the ensemble.

        Raises
        ------
        TypeError, ValueError
            The cycle is not one of the ensemble's, or the edges do not ascend.
        """
        cycle = self._checked_cycle(cycle)
        named = ("angle_edges", angle_edges), ("velocity_edges", velocity_edges)
        edges = [ascending_edges(*given, finite=False) for given in named]
        standing = np.isfinite(self.angle[:, cycle])
        points = self.angle[standing, cycle], self.velocity[standing, cycle]
        return np.histogram2d(*points, bins=edges)[0] / self.realizations

    def grids(self) -> tuple[dict[str, Any], dict[str, Any]]:
        """Arrays by name and coordinates for `to_xarray`, every realization's among them."""
        variables, coordinates = super().grids()
        states = {name: (("realization", "time"), getattr(self, name)) for name in ("angle", "velocity")}
        ends = {name: ("realization", getattr(self, name)) for name in ("overturn_time", "overturn_side")}
        return variables | states | ends, coordinates

    def save(self, path: File) -> None:
        """Save the ensemble, whole or not at all; `path` by custom ends in .npz."""
        storage.write_result(path, "ensemble", self.scene, *_LAYOUT.of(self))

    @classmethod
    def load(cls, path: File) -> Self:
        """Load a saved ensemble; raises as `fpk_rocking.results.storage.read_result`."""
        scene, arrays, attributes = storage.read_result(path, "ensemble", _LAYOUT)
        return cls(scene=scene, **arrays, **attributes)
