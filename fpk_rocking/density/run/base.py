"""What every run has: a scene and a mesh, and one way to evolve the density from the scene's start."""

import abc
from collections.abc import Callable, Iterator
from typing import Any, ClassVar, NamedTuple

import numpy as np

from fpk_rocking.base.types import Array
from fpk_rocking.density.resolution import Grid
from fpk_rocking.density.space.solution import Solution
from fpk_rocking.density.space.space import Space
from fpk_rocking.density.start.departure import initial_density
from fpk_rocking.density.step.step import scatter_buffers
from fpk_rocking.scene.parts import Start
from fpk_rocking.scene.scene import Scene


class Seen(NamedTuple):
    """What a run shows at a time that is wanted; see `Solution`, of which it becomes a row.

    Parameters
    ----------
    coefficients : ndarray, shape ``space.shape``
    gone : ndarray, shape (3,)
    at_rest : float
    resolved : bool
    released : float
        Up to this time.
    """

    coefficients: Array
    gone: Array
    at_rest: float = 0.0
    resolved: bool = True
    released: float = 0.0


class Run(abc.ABC):
    """A scene at one resolution: its mesh, its steps, and the density that they evolve.

    A kind of run is a subclass with `march`, `memory` and a constructor ``(scene, grid, negligible, guide=None)``.

    Parameters
    ----------
    scene : Scene
        With white or filtered noise.
    grid : Grid or NodeGrid
        Mesh and steps.
    plane : Grid
        The mesh.
    negligible : float
        A cell that holds less is not active: what comes to it is lost, and counted.
    """

    atom: ClassVar[bool] = False
    """Whether blocks rest at x = v = 0 exactly, with a probability that the density does not contain."""

    @property
    @abc.abstractmethod
    def memory(self) -> float:
        """Bytes that the run holds, or an evolution took, without the densities of all rows."""

    def __init__(self, scene: Scene, grid, plane: Grid, negligible: float) -> None:
        self.scene, self.grid, self.negligible = scene, grid, negligible
        self.space = Space(plane.angle_lines, plane.velocity_lines, plane.degree)
        self.buffers = scatter_buffers(self.space)

    @staticmethod
    def adapted(scene: Scene, grid: Grid, number: int) -> Any:  # noqa: ARG004  (as of other kinds)
        """Return the grid of a run, from that of the mesh and the number of the resolution."""
        return grid

    @abc.abstractmethod
    def march(self, times: Array, start: Start) -> Iterator[Seen]:
        """Evolve from a start, and show what there is at each of the times (n + 1,) but the first, which is 0."""

    def evolve(self, times: Array, progress: Callable[[], None] | None = None, start: Start | None = None) -> Solution:
        """Evolve over times (n + 1,) from 0 on; of a scene that repeats they are whole cycles.

        Parameters
        ----------
        times : ndarray, shape (n + 1,)
            Ascending nondimensional times, the first 0.
        progress : callable, optional
            Called at each time but the first.
        start : Start, optional
            In place of the scene's.

        Returns
        -------
        Solution
        """
        count, start = len(times), start or self.scene.start
        coefficients, gone = np.zeros((count, *self.space.shape)), np.zeros((count, 3))
        inside, at_rest, resolved, released = np.ones(count), np.zeros(count), np.zeros(count, dtype=bool), 0.0
        coefficients[0], gone[0, :2] = initial_density(start, self.space, self.scene.overturning.angle)
        inside[0] -= gone[0].sum()
        at_rest[0] = float(self.atom and not (start.angle or start.velocity or start.covariance))
        for row, seen in enumerate(self.march(times, start), 1):
            coefficients[row], gone[row], at_rest[row], resolved[row], released = seen
            inside[row] = self.space.masses(coefficients[row]).sum() + at_rest[row]
            if progress:
                progress()
        return Solution(inside, gone, coefficients, at_rest if self.atom else None, resolved, released)
