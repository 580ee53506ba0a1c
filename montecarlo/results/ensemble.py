"""The result of a simulation: every realization's Poincaré points and its overturning."""

import dataclasses
import functools
from typing import Any, ClassVar

import numpy as np

from fpk_rocking.base.types import Array, ArrayLike
from fpk_rocking.results.binning import ascending_edges
from fpk_rocking.results.layout import Layout
from fpk_rocking.results.storage import Saved
from fpk_rocking.scene.scene import Scene
from montecarlo.results.sample import Sample

_LAYOUT = Layout(
    {"times": "f8 k+1", "angle": "f8 n k+1", "velocity": "f8 n k+1", "overturn_time": "f8 n", "overturn_side": "i1 n"},
    {"method": str, "seed": int, "steps_per_cycle": int, "wall_s": float},
)


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

    _kind: ClassVar = "ensemble"
    _layouts: ClassVar = (_LAYOUT,)
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

    @property
    def at_rest(self) -> Array:
        """Part of the realizations (cycles + 1,) at rest, angle and velocity 0: a part of survival.

        Under white noise no block rests after the start.
        """
        return np.count_nonzero((self.angle == 0.0) & (self.velocity == 0.0), axis=0) / self.realizations

    @functools.cached_property
    def _gone(self) -> Array:
        sides = [np.count_nonzero(np.isnan(self.angle[self.overturn_side == side]), axis=0) for side in (-1, 1)]
        return np.stack(sides, axis=-1)

    @property
    def _overturning(self) -> tuple[float, float, int] | None:
        time, side = float(self.overturn_time[0]), int(self.overturn_side[0])
        return (time, time, side) if side else None

    def bin_probabilities(self, cycle: int, angle_edges: ArrayLike, velocity_edges: ArrayLike) -> Array:
        """Estimate the probability of standing, with angle and velocity in each of some bins.

        Parameters
        ----------
        cycle : int
            From 0 to ``cycles``.
        angle_edges, velocity_edges : array_like
            Ascending bin edges, nondimensional; the bins are those of `numpy.histogram2d`.

        Returns
        -------
        ndarray, shape (n_angle, n_velocity)
            Sums to the survival where the bins cover the ensemble.

        Raises
        ------
        TypeError, ValueError
            There is no such cycle, or the edges do not ascend.
        """
        cycle = self._checked_cycle(cycle)
        named = ("angle_edges", angle_edges), ("velocity_edges", velocity_edges)
        edges = [ascending_edges(*given, finite=False) for given in named]
        standing = np.isfinite(self.angle[:, cycle])
        points = self.angle[standing, cycle], self.velocity[standing, cycle]
        return np.histogram2d(*points, bins=edges)[0] / self.realizations

    def grids(self) -> tuple[dict[str, Any], dict[str, Any]]:
        """Arrays with named dimensions, those of every realization among them, and their coordinates."""
        variables, coordinates = super().grids()
        own = {
            "angle": (("realization", "time"), self.angle),
            "velocity": (("realization", "time"), self.velocity),
            "overturn_time": ("realization", self.overturn_time),
            "overturn_side": ("realization", self.overturn_side),
        }
        return variables | own, coordinates
