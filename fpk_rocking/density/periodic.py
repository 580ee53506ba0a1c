"""Scenes that repeat: the steps of a symmetry period, set up once, serve all cycles.

Where the forcing is its own mirror image half a cycle later, the symmetry period is half a cycle: its steps serve the
other half too, with the density reflected, (x, v) -> (-x, -v). Else it is the whole cycle.
"""

import abc
import math
from typing import Any, NamedTuple

import numpy as np

from fpk_rocking.base.types import Array, not_none
from fpk_rocking.density.propagator import Propagator, Snapshot
from fpk_rocking.density.space.space import Space, reflected
from fpk_rocking.density.startup import StartUp, takeover_step
from fpk_rocking.density.step.dynamics import Dynamics
from fpk_rocking.density.step.step import Characteristics, Step, mark_massive_cells, overlapping_cells, with_neighbours
from fpk_rocking.scene.parts import Start


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
        """State reflected about the origin, or back."""
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
        """Cells of another `Space` that meet an active cell of the steps about a `time`: a mask.

        The time is within the symmetry period; the mask is (..., angle cells, velocity cells) like those in `active`.
        """
        before, after = self._steps_about(time)
        return overlapping_cells(self.space, self.active[before] | self.active[min(after, len(self.active) - 1)], space)

    @abc.abstractmethod
    def _steps_about(self, time):
        """Numbers of the last step that begins by a `time`, and of one that begins after it or then.

        The time is within the symmetry period.
        """

    @abc.abstractmethod
    def _apply(self, k, state):
        """Density, outflow (3,) and masses at rest of a `PeriodicState` after step k of the symmetry period."""

    def advance(self, state: PeriodicState, latest: float) -> PeriodicState:  # noqa: ARG002  (as of other kinds)
        """`PeriodicState` after the next step; `latest` is not used.

        It is reflected where that step is the mirror image of one of the symmetry period.
        """
        k = state.step % len(self.active)
        if (state.step % self.steps_per_cycle != k) != state.reflected:
            state = state.mirror_image()
        density, outflow, at_rest = self._apply(k, state)
        outflow = state.outflow + (outflow[[1, 0, 2]] if state.reflected else outflow)
        return PeriodicState(state.step + 1, self.time_of(state.step + 1), density, outflow, state.reflected, at_rest)

    def time_of(self, step: int) -> float:
        """Time τ at which a step begins, by its number from τ = 0 on."""
        period, k = divmod(step, len(self.active))
        return period * not_none(self.scene.period) / self.periods_per_cycle + self.step_begins[k]


class PeriodicPropagator(CyclicPropagator):
    """A scene with white noise that repeats, at one resolution; parameters as of `Propagator`."""

    def __init__(self, scene, discretization, negligible, coarse=None):
        self.dynamics, self.duration = Dynamics.of(scene), scene.period / discretization.steps
        count = discretization.steps // (2 if scene.forcing.half_antisymmetric else 1)
        step_begins = np.arange(count + 1) * self.duration
        super().__init__(scene, discretization, discretization, negligible, step_begins, coarse)
        self.steps = [self._step(begin) for begin in step_begins[:-1].tolist()]
        # What a start leaves on patches does not depend on the mesh.
        same = coarse and coarse.discretization.patches == discretization.patches
        self._startups = coarse._startups if same else {}

    def _step(self, begin):
        """`Step` from a time `begin` on, without active cells."""
        rule = self.discretization.quadrature
        characteristics = Characteristics(self.space, begin, self.duration, self.dynamics, rule, cells=False)
        return Step(characteristics, self.space, self.buffers)

    @property
    def memory(self) -> float:
        """Bytes that the steps take."""
        return self.buffers.nbytes + sum(step.nbytes for step in self.steps)

    def _steps_about(self, time):
        """Numbers of the last step that begins by a `time`, and of one that begins after it or then."""
        place = time / self.duration
        return math.floor(place + 1e-9), math.ceil(place - 1e-9)

    def initial_state(self, start: Start, times: Array) -> PeriodicState:  # noqa: ARG002  (as of other kinds)
        """State at the end of the step at which the mesh takes the start over; `times` is not used."""
        if start not in self._startups:
            patches = self.discretization.patches
            self._startups[start] = StartUp(self.dynamics, start, patches, self.scene.period)
        startup = self._startups[start]
        first = takeover_step(startup, self.space, np.arange(self.steps_per_cycle + 1) * self.duration)
        time = first * self.duration
        return PeriodicState(first, self.time_of(first), *startup.project(time, self.space))

    def _apply(self, k, state):
        """Density and outflow (3,) of a `PeriodicState` after step k of the symmetry period, and None.

        All cells of the step that are not negligible are made active.
        """
        step = self.steps[k]
        if mark_massive_cells(
            state.density, self.space.areas, self.negligible, step.characteristics.active, self.active[k]
        ):
            step.activate(with_neighbours(self.active[k]))
        return *step.apply(state.density), None

    def snapshot(self, state: PeriodicState) -> Snapshot:
        """Density and outflow of a `PeriodicState`, reflected back where it is the mirror image."""
        return Snapshot(reflected(state.density) if state.reflected else state.density, state.outflow)
