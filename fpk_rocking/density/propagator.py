"""What every propagator has: a scene at one resolution, and the loop that carries its density from time to time.

`periodic`, `transient` and `filtered` each know one kind of scene: how its density begins, and how a step changes it.
"""

import abc
from collections.abc import Callable, Iterator
from typing import Any, ClassVar, NamedTuple

import numpy as np

from fpk_rocking.base.types import Array
from fpk_rocking.density.gaussian import initial_density
from fpk_rocking.density.resolution import Discretization
from fpk_rocking.density.space.space import Space
from fpk_rocking.density.step.step import scatter_buffers
from fpk_rocking.scene.parts import Start
from fpk_rocking.scene.scene import Scene


class Snapshot(NamedTuple):
    """The density at one time, with the masses that it does not contain.

    Parameters
    ----------
    coefficients : ndarray, shape ``space.shape``
        Of the density of the blocks that stand; of those that move, where `at_rest` has the others.
    outflow : ndarray, shape (3,)
        Masses that left the mesh so far: absorbed at the left and at the right cut-off, and truncated.
    at_rest : float
        Mass at rest, which has no density.
    resolved : bool
        Whether the mesh resolves the density; else it tells survival alone.
    reinjected : float
        Largest mass so far that had come to rest and was lifted off again.
    """

    coefficients: Array
    outflow: Array
    at_rest: float = 0.0
    resolved: bool = True
    reinjected: float = 0.0


class Solution(NamedTuple):
    """A density at all times that are asked for: the rows of its arrays.

    Parameters
    ----------
    survival : ndarray, shape (rows,)
        Mass that has not overturned, at rest or not.
    outflow : ndarray, shape (rows, 3)
        Masses absorbed at the left and at the right cut-off, and truncated.
    coefficients : ndarray, shape (rows, *space.shape)
        Of the density; of the blocks that move, where `at_rest` has the others.
    at_rest : ndarray, shape (rows,), or None
        Mass at rest, where blocks can rest exactly.
    resolved : ndarray of bool, shape (rows,)
        Rows whose density the mesh resolves; of others survival alone is judged.
    reinjected : float
        Largest mass that had come to rest and was lifted off again.
    """

    survival: Array
    outflow: Array
    coefficients: Array
    at_rest: Array | None
    resolved: Array
    reinjected: float = 0.0


class Propagator(abc.ABC):
    """A scene at one resolution: its mesh, its steps, and the loop over them.

    A kind of propagator is a subclass with `initial_state`, `advance`, `snapshot`, `memory` and a constructor
    ``(scene, discretization, negligible, coarse=None)``. Its states have a `time`.

    Parameters
    ----------
    scene : Scene
        With white or filtered noise.
    discretization : Discretization or FilteredDiscretization
        Mesh and steps.
    plane : Discretization
        The mesh of the plane.
    negligible : float
        A cell that holds less mass is not active: what comes to it is truncated, and counted.
    """

    rests_exactly: ClassVar[bool] = False
    """Whether blocks rest at x = v = 0, with a probability that the density does not contain."""

    @property
    @abc.abstractmethod
    def memory(self) -> float:
        """Bytes that steps and states take, without the densities of all rows."""

    def __init__(self, scene: Scene, discretization: Any, plane: Discretization, negligible: float) -> None:
        self.scene, self.discretization, self.negligible = scene, discretization, negligible
        self.space = Space(plane.angle_lines, plane.velocity_lines, plane.degree)
        self.buffers = scatter_buffers(self.space)

    @staticmethod
    def adapted(scene: Scene, plane: Discretization, number: int) -> Any:  # noqa: ARG004  (as of other kinds)
        """Discretization for the constructor, from the mesh and steps of the plane at one resolution.

        `number` is that of the resolution in `RESOLUTIONS`.
        """
        return plane

    @abc.abstractmethod
    def initial_state(self, start: Start, times: Array) -> Any:
        """First state from the start on whose density the mesh resolves; its class is the subclass's.

        `times` (rows,) are those of the results, nondimensional.
        """

    @abc.abstractmethod
    def advance(self, state: Any, latest: float) -> Any:
        """State after one step or more, not later than `latest`, a time at which a step ends."""

    @abc.abstractmethod
    def snapshot(self, state: Any) -> Snapshot:
        """`Snapshot` of a state: coefficients of its density, its outflow and its mass at rest."""

    def states(self, times: Array, start: Start) -> Iterator[Any]:
        """Yield the first state that the mesh resolves and the state after every step, to the last of the times.

        `times` (rows,) are those of the results, from 0 on; `start` is where the block begins, of a scene.
        """
        state = self.initial_state(start, times)
        yield state
        for time in times[1:]:
            while not _reached(state, time):
                state = self.advance(state, time)
                yield state

    def propagate(
        self, times: Array, progress: Callable[[], object] | None = None, start: Start | None = None
    ) -> Solution:
        """Propagate the density from the start of the scene to all times that are asked for.

        Parameters
        ----------
        times : ndarray, shape (rows,)
            Ascending nondimensional times, the first 0; of a scene that repeats they are whole cycles.
        progress : callable, optional
            Called at each time but the first.
        start : Start, optional
            In place of the scene's.

        Returns
        -------
        Solution
        """
        rows, row, start = len(times), 1, start or self.scene.start
        coefficients, outflow = np.zeros((rows, *self.space.shape)), np.zeros((rows, 3))
        survival, at_rest, resolved, reinjected = np.ones(rows), np.zeros(rows), np.zeros(rows, dtype=bool), 0.0
        coefficients[0], outflow[0, :2] = initial_density(start, self.space, self.scene.overturning.angle)
        survival[0] -= outflow[0].sum()
        at_rest[0] = float(self.rests_exactly and not (start.angle or start.velocity or start.covariance))
        for state in self.states(times, start):
            if _reached(state, times[row]):
                coefficients[row], outflow[row], at_rest[row], resolved[row], reinjected = self.snapshot(state)
                survival[row] = self.space.masses(coefficients[row]).sum() + at_rest[row]
                row += 1
                if progress:
                    progress()
        return Solution(survival, outflow, coefficients, at_rest if self.rests_exactly else None, resolved, reinjected)


def _reached(state, time):
    """Whether a state is at a `time` or after it, to rounding; its class is that of a propagator."""
    return state.time >= time * (1.0 - 1e-12)
