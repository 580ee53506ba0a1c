"""What every propagator has: a scene at one resolution, and the loop that carries its density from time to time.

`PeriodicPropagator` below, `transient` and `filtered` each know one kind of scene: how its density begins, and how a
step changes it. Where a scene repeats, the steps of a symmetry period are set up once and serve all cycles. Where the
forcing is its own mirror image half a cycle later, and the sides of the block are equal, the symmetry period is half a
cycle: its steps serve the other half too, with the density reflected, (x, v) -> (-x, -v). Else it is the whole cycle.
"""

import abc
import math
from collections.abc import Callable, Iterator
from typing import Any, ClassVar, NamedTuple

import numpy as np

from fpk_rocking.base.checks import Array, not_none
from fpk_rocking.density.patches import initial_density
from fpk_rocking.density.resolution import Discretization, periods_per_cycle
from fpk_rocking.density.space import Space, reflected
from fpk_rocking.density.startup import StartUp, takeover_step
from fpk_rocking.density.step.dynamics import Dynamics
from fpk_rocking.density.step.step import (
    Characteristics,
    Step,
    mark_massive_cells,
    overlapping_cells,
    scatter_buffers,
    with_neighbours,
)
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

    The outflow (3,) is the mass that has left the mesh so far: overturned left and right, and truncated. It has these
    entries, and `solve_fpk` makes `Evolution.overturned` of it:

    * before the mesh takes over: `initial_density` at time 0 (here, `propagate`), the start-up (`StartUp.project`) and,
      under filtered noise, `FilteredStart.project`;
    * in a step: `Step.apply` returns the masses of the paths that end in an `Exit`, and of free flights that pass a
      cut-off, whose side is that of their cell. `CyclicPropagator.advance` adds them, left and right exchanged where
      the step stands for its mirror image, and `TransientPropagator.advance`, where no step does;
    * on return from rest: the start-up of a `ReInjection` (`transient`), and blocks that filtered noise lifts off
      (`FilteredPropagator._move`).

    Rest is one of three things:

    * white noise, a scene that repeats: no block rests. `Evolution.at_rest` is the mass next to rest, by `near_rest`;
    * white noise, a scene that does not: mass next to rest is taken as resting from times that `Sticking` allows
      (`TransientPropagator._stick`) and returns as a `ReInjection` at the next lift-off;
    * filtered noise: a path that comes to rest ends in `Exit.REST` (`step.characteristics._split_kicks`), and its mass
      stays at its node of the noise until `advance_from_rest` lifts it off (`FilteredPropagator._move`).

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
        """Bytes that steps and states take, a number, without the densities of all rows."""

    def __init__(self, scene: Scene, discretization: Any, plane: Discretization, negligible: float) -> None:
        self.scene, self.discretization, self.negligible = scene, discretization, negligible
        self.space = Space(plane.angle_lines, plane.velocity_lines, plane.degree)
        self.buffers = scatter_buffers(self.space)

    @staticmethod
    def adapted(scene: Scene, plane: Discretization, number: int) -> Any:  # noqa: ARG004  (as of other kinds)
        """Return the discretization for the constructor, from `plane`, mesh and steps of the plane at one resolution.

        `number` is that of the resolution in `RESOLUTIONS`, an int; here it is `plane` itself.
        """
        return plane

    @abc.abstractmethod
    def initial_state(self, start: Start, times: Array) -> Any:
        """Return the first state from the start on whose density the mesh resolves; its class is the subclass's.

        `times` (rows,) are those of the results, nondimensional; `start` is a `Start`.
        """

    @abc.abstractmethod
    def advance(self, state: Any, latest: float) -> Any:
        """Return the state after one step or more, not later than `latest`, a time at which a step ends.

        Its class is that of `state`, the subclass's.
        """

    @abc.abstractmethod
    def snapshot(self, state: Any) -> Snapshot:
        """Return the `Snapshot` of a state: coefficients of its density, its outflow and its mass at rest."""

    def states(self, times: Array, start: Start) -> Iterator[Any]:
        """Yield the first state that the mesh resolves and the state after every step, to the last of the times.

        `times` (rows,) are those of the results, nondimensional, from 0 on; `start`, a `Start`, is where the block
        begins. The class of states is the subclass's.
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
            Named tuple of survival, outflow, coefficients and masses at rest by row.
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
    """Whether a `state`, of a class of a propagator, is at a `time` or after it, to rounding: a bool."""
    return state.time >= time * (1.0 - 1e-12)


class PeriodicState(NamedTuple):
    """A density between two steps.

    Parameters
    ----------
    step : int
        Number of steps since τ = 0.
    time : float
        τ, nondimensional.
    density : ndarray, shape (..., *space.shape)
        Coefficients; under filtered noise at each node of it.
    outflow : ndarray, shape (3,)
        Masses absorbed at the left and at the right cut-off, and truncated; never reflected.
    reflected : bool
        Whether density and rest are those of the mirror image: reflected, with the nodes in reverse.
    at_rest : ndarray, optional
        Masses at rest at the nodes of filtered noise.
    first : bool
        Whether no step has been taken yet.
    """

    step: int
    time: float
    density: Array
    outflow: Array
    reflected: bool = False
    at_rest: Array | None = None
    first: bool = False

    def mirror_image(self) -> "PeriodicState":
        """Return the state reflected about the origin, (x, v) -> (-x, -v), or back."""
        density, at_rest = reflected(self.density), self.at_rest
        if at_rest is not None:
            density, at_rest = density[::-1, ::-1], at_rest[::-1, ::-1]
        return self._replace(density=density, at_rest=at_rest, reflected=not self.reflected)


class CyclicPropagator(Propagator):
    """A propagator over whole forcing cycles; a subclass makes the steps of a symmetry period and applies them.

    Attributes
    ----------
    step_begins : ndarray, shape (steps of a symmetry period + 1,)
        Begins of the steps and the end of the last, nondimensional.
    steps_per_cycle : int
    periods_per_cycle : int
        Symmetry periods in a cycle, 1 or 2; with 2 the density is reflected after each.
    steps : list
        The steps of a symmetry period.
    active : ndarray of bool, shape (steps of a symmetry period, ..., angle cells, velocity cells)
        Cells that have held more than a negligible mass at the begin of a step.
    """

    steps: list[Any]

    def __init__(self, scene, discretization, plane, negligible, step_begins, coarse=None):
        super().__init__(scene, discretization, plane, negligible)
        self.step_begins, self.steps_per_cycle = step_begins, discretization.steps
        self.periods_per_cycle = self.steps_per_cycle // (len(step_begins) - 1)
        self.active = np.zeros((len(step_begins) - 1, *self.space.shape[:2]), dtype=bool)
        if coarse:
            self.active[:] = [coarse.active_about(begin, self.space) for begin in step_begins[:-1]]

    def active_about(self, time: float, space: Space) -> Array:
        """Return a mask of the cells of another `Space` that meet an active cell of the steps about a `time`.

        The time is within the symmetry period; the mask is (..., angle cells, velocity cells) like those in `active`.
        """
        before, after = self._steps_about(time)
        return overlapping_cells(self.space, self.active[before] | self.active[min(after, len(self.active) - 1)], space)

    @abc.abstractmethod
    def _steps_about(self, time):
        """Return two numbers: that of the last step that begins by a `time`, and of one that begins after it or then.

        The time is within the symmetry period.
        """

    @abc.abstractmethod
    def _apply(self, k, state):
        """Return (density, outflow, at rest) of a `PeriodicState` after step k of the symmetry period.

        They are coefficients (..., *space.shape), masses (3,) and masses at rest at the nodes of filtered noise, else
        None.
        """

    def advance(self, state: PeriodicState, latest: float) -> PeriodicState:  # noqa: ARG002  (as of other kinds)
        """Return the `PeriodicState` after the next step; `latest` is not used.

        It is reflected where that step is the mirror image of one of the symmetry period.
        """
        k = state.step % len(self.active)
        if (state.step % self.steps_per_cycle != k) != state.reflected:
            state = state.mirror_image()
        density, outflow, at_rest = self._apply(k, state)
        outflow = state.outflow + (outflow[[1, 0, 2]] if state.reflected else outflow)
        return PeriodicState(state.step + 1, self.time_of(state.step + 1), density, outflow, state.reflected, at_rest)

    def time_of(self, step: int) -> float:
        """Return the nondimensional time τ at which a step begins, by its number from τ = 0 on."""
        period, k = divmod(step, len(self.active))
        return period * not_none(self.scene.period) / self.periods_per_cycle + self.step_begins[k]


class PeriodicPropagator(CyclicPropagator):
    """A scene with white noise that repeats, at one resolution; parameters as of `Propagator`."""

    def __init__(self, scene, discretization, negligible, coarse=None):
        self.dynamics, self.duration = Dynamics.of(scene), scene.period / discretization.steps
        count = discretization.steps // periods_per_cycle(scene)
        step_begins = np.arange(count + 1) * self.duration
        super().__init__(scene, discretization, discretization, negligible, step_begins, coarse)
        self.steps = [self._step(begin) for begin in step_begins[:-1].tolist()]
        # What a start leaves on patches does not depend on the mesh.
        same = coarse and coarse.discretization.patches == discretization.patches
        self._startups = coarse._startups if same else {}

    def _step(self, begin):
        """Return a `Step` from a time `begin` on, without active cells."""
        rule = self.discretization.quadrature
        characteristics = Characteristics(self.space, begin, self.duration, self.dynamics, rule, cells=False)
        return Step(characteristics, self.space, self.buffers)

    @property
    def memory(self) -> float:
        """Bytes that the steps take, an int."""
        return self.buffers.nbytes + sum(step.nbytes for step in self.steps)

    def _steps_about(self, time):
        """Return two numbers: of the last step that begins by a `time`, and of one that begins after it or then."""
        place = time / self.duration
        return math.floor(place + 1e-9), math.ceil(place - 1e-9)

    def initial_state(self, start: Start, times: Array) -> PeriodicState:  # noqa: ARG002  (as of other kinds)
        """Return the `PeriodicState` at the end of the step at which the mesh takes the start over, for any `times`."""
        if start not in self._startups:
            patches = self.discretization.patches
            self._startups[start] = StartUp(self.dynamics, start, patches, self.scene.period)
        startup = self._startups[start]
        first = takeover_step(startup, self.space, np.arange(self.steps_per_cycle + 1) * self.duration)
        time = first * self.duration
        return PeriodicState(first, self.time_of(first), *startup.project(time, self.space))

    def _apply(self, k, state):
        """Return (density, outflow, None) of a `PeriodicState` after step k: shapes ``space.shape`` and (3,).

        All cells of the step that are not negligible are made active.
        """
        step = self.steps[k]
        if mark_massive_cells(
            state.density, self.space.areas, self.negligible, step.characteristics.active, self.active[k]
        ):
            step.activate(with_neighbours(self.active[k]))
        return *step.apply(state.density), None

    def snapshot(self, state: PeriodicState) -> Snapshot:
        """Return the `Snapshot`, density and outflow, of a `PeriodicState`, reflected back if it is a mirror image."""
        return Snapshot(reflected(state.density) if state.reflected else state.density, state.outflow)
