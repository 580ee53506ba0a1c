"""Scenes with filtered noise: densities at nodes of the filter's states, and blocks at rest.

In a step the noise is piecewise constant: at every node a density of angle and velocity moves under the forcing and a
constant, by the paths of a block without other noise. Between steps the filter's transition matrix exchanges mass
between the nodes, exactly. So the noise is constant over each step and has, from step to step, the law of the filter.

Blocks whose impacts accumulate while the force cannot lift them off come to rest at x = v = 0, a point mass of each
node. It is re-injected, on the side of f, in the first step in which |f| passes the level of lift-off.
"""

import dataclasses
import math
from collections.abc import Callable

import numpy as np

from fpk_rocking.base import precompilation
from fpk_rocking.base.jit import kernel
from fpk_rocking.base.types import Array, not_none
from fpk_rocking.density.filter_nodes import FilteredDiscretization, Nodes, filtered_discretization
from fpk_rocking.density.filtered_start import FilteredStart, deposit_points
from fpk_rocking.density.periodic import CyclicPropagator, PeriodicState
from fpk_rocking.density.propagator import Snapshot, Solution
from fpk_rocking.density.resolution import Discretization
from fpk_rocking.density.space.space import reflected
from fpk_rocking.density.step.dynamics import Dynamics
from fpk_rocking.density.step.free_flight import angle_remap_of
from fpk_rocking.density.step.step import Characteristics, Quadrature, Step, mark_massive_cells, with_neighbours
from fpk_rocking.density.tuning import TUNING
from fpk_rocking.physics.forcing import periodic
from fpk_rocking.physics.motion.events import advance_through_events
from fpk_rocking.scene.parts import Start
from fpk_rocking.scene.scene import Scene


class FilteredPropagator(CyclicPropagator):
    """A scene that repeats, under filtered noise, at one resolution; parameters as of `Propagator`.

    Attributes
    ----------
    steps : list of list of Step
        The steps of a symmetry period, each at every node of the noise. They are dropped after `propagate`.
    memory : float
        Bytes that steps and states took.
    """

    rests_exactly = True
    memory = 0.0

    def __init__(self, scene, discretization, negligible, coarse=None):
        begins = scene.period * discretization.time_grid
        super().__init__(scene, discretization, discretization.plane, negligible, begins)
        self.nodes = Nodes(scene.noise, discretization.nodes, discretization.spacing)
        # Where the nodes have one spacing only near ones exchange mass: then each has cells of its own.
        groups = len(self.nodes.values) if discretization.spacing else 1
        self.active = np.repeat(self.active[:, None], groups, axis=1)
        if coarse:
            self._follow(coarse)
        self.durations = np.diff(self.step_begins)
        self._transitions = {}
        self.steps = [self._steps_at_nodes(k) for k in range(len(self.durations))]

    @staticmethod
    def adapted(scene: Scene, plane: Discretization, number: int) -> FilteredDiscretization:
        """Mesh of the plane with the nodes and steps of the resolution of a number in `RESOLUTIONS`."""
        precompilation.start_helpers(
            precompilation.task_for_block("fpk_rocking.density.precompilation:filtered", scene)
        )
        return filtered_discretization(scene, plane, number)

    def _follow(self, coarse):
        """Mark as active, for each step and node of the noise, the cells that a coarser propagator has active then.

        `coarse` is a `FilteredPropagator`; those of its noise nodes below and above count, in the steps about the begin
        of the step.
        """
        places = np.searchsorted(coarse.nodes.values, self.nodes.values)[: self.active.shape[1]]
        for k, begin in enumerate(self.step_begins[:-1]):
            cells = coarse.active_about(begin, self.space)
            last = len(cells) - 1
            self.active[k] = cells[np.clip(places - 1, 0, last)] | cells[np.clip(places, 0, last)]

    def _dynamics(self, constant):
        """`Dynamics` of a block under the forcing plus a constant force, without noise.

        `constant` is that force, nondimensional, in units of the forcing.
        """
        forcing, block = periodic(self.scene.forcing).with_constant(constant), self.scene.block
        common = forcing, 0.0, block.restitution_by_side[0], self.scene.overturning.angle
        return Dynamics(*common, critical_angle=block.critical_angle or None)

    def _steps_at_nodes(self, k):
        """Return the `Step` with number k of the symmetry period at each node of y1, a list.

        They share tables.
        """
        begin, duration, space = self.step_begins[k], self.durations[k], self.space
        points = self.discretization.points
        rule, factor = Quadrature(points, points, 1, 1, 1), self.nodes.piecewise_constant_factor(duration)
        each = [self._dynamics(factor * value) for value in self.nodes.values]
        shear = angle_remap_of(space, each[0].affine(begin, duration), 0.0, duration)
        return [
            Step(Characteristics(space, begin, duration, dynamics, rule, cells=False), space, self.buffers, shear)
            for dynamics in each
        ]

    @property
    def node_error(self) -> float:
        """Part of the blocks at rest after a cycle that the nodes may misplace, though all resolutions agree.

        It is what nodes beyond the level of lift-off weigh too much or too little, and a part of a node's weight there.
        Relative to the probability that the force at τ = 0 holds a block at rest; one number for all cycles. It is 0
        where the nodes have no `spacing`, as where no block can rest.
        """
        if self.discretization.spacing is None:
            return 0.0
        level, sigma = self.scene.block.lift_off, self.nodes.sigma
        force, weights = self.scene.forcing.value(0.0), self.nodes.weights.sum(axis=1)
        stays = np.abs(force + self.nodes.values) <= level
        below, above = (0.5 * math.erf((end - force) / (sigma * math.sqrt(2.0))) for end in (-level, level))
        between = 0.5 * (weights[1:] + weights[:-1])[stays[1:] != stays[:-1]].sum()
        misplaced = abs(weights[stays].sum() - (above - below)) + TUNING.unseen_between_nodes * between
        return misplaced / (above - below)

    def _transition(self, time):
        """Matrix (nodes, nodes) that takes the masses of the nodes over a time; kept for the next cycle.

        The time is a duration, nondimensional.
        """
        key = round(time / self.scene.period, 12)
        if key not in self._transitions:
            self._transitions[key] = self.nodes.transition_matrix(time)
        return self._transitions[key]

    def _steps_about(self, time):
        """Numbers of the last step that begins by a `time` in the symmetry period, and of the next one."""
        before = int(np.searchsorted(self.step_begins, time, side="right")) - 1
        return before, before + 1

    def propagate(
        self, times: Array, progress: Callable[[], object] | None = None, start: Start | None = None
    ) -> Solution:
        """Propagate once, as `Propagator.propagate`; the steps are dropped then, and `memory` tells what they took."""
        solution = super().propagate(times, progress, start)
        densities = 3 * 8 * self.nodes.weights.size * self.space.unknowns
        shears = sum(part.nbytes for steps in self.steps for part in steps[0].angle_remap)
        paths = sum(step.nbytes for steps in self.steps for step in steps)
        self.memory, self.steps, self.buffers = self.buffers.nbytes + densities + shears + paths, [], None
        return solution

    def initial_state(self, start: Start, times: Array) -> PeriodicState:  # noqa: ARG002  (as of other kinds)
        """State at the begin of the step before which the mesh takes the start over; at rest, the start.

        `times` is not used.
        """
        begin = FilteredStart(dataclasses.replace(self.scene, start=start), self.nodes, self._dynamics(0.0))
        shape = self.nodes.weights.shape
        if begin.at_rest:
            density, at_rest = np.zeros((*shape, *self.space.shape)), self.nodes.weights.copy()
            return PeriodicState(0, 0.0, density, np.zeros(3), at_rest=at_rest, first=True)
        begins = np.array([self.time_of(k) for k in range(self.steps_per_cycle + 1)])
        first = begin.takeover_step(self.space, begins)
        density, outflow = begin.project(begins[first], self.space)
        return PeriodicState(first, begins[first], density, outflow, at_rest=np.zeros(shape), first=True)

    def _apply(self, k, state):
        """Density, outflow (3,) and masses at rest of a `PeriodicState` after step k of the symmetry period.

        Mass is exchanged between nodes over half of the step before and half of step k, and then step k is taken.
        Density (nodes in y1, nodes in y2, ``space.shape``) and masses (nodes in y1, nodes in y2) are new arrays.
        """
        before = 0.0 if state.first else self.durations[k - 1]
        matrix = self._transition(0.5 * (self.durations[k] + before))
        density = (matrix @ state.density.reshape(len(matrix), -1)).reshape(state.density.shape)
        at_rest = (matrix @ state.at_rest.ravel()).reshape(state.at_rest.shape)
        return density, self._move(k, density, at_rest), at_rest

    def _move(self, k, density, at_rest):
        """Move densities and masses at rest, in place, by step k; return the outflow (3,).

        `density` (nodes in y1, nodes in y2, ``space.shape``) are coefficients, `at_rest` (nodes in y1, nodes in y2)
        masses.
        """
        self._activate(k, density)
        outflow = np.zeros(3)
        for a, step in enumerate(self.steps[k]):
            x, v, side = self._from_rest(step.characteristics)
            for b in range(at_rest.shape[1]):
                density[a, b], masses = step.apply(density[a, b])
                outflow += masses[:3]
                if side:
                    state, mass = np.array([[x, v]]), at_rest[a, b : b + 1]
                    outflow += deposit_points(self.space, state, mass, side, density[a, b])
                    at_rest[a, b] = 0.0
                at_rest[a, b] += masses[3]
        return outflow

    def _from_rest(self, characteristics):
        """Angle, velocity and side (0: at rest) at the end of a step of a block that is at rest at its begin.

        The step is that of the `Characteristics`.
        """
        segment = characteristics.dynamics.segment(characteristics.start, characteristics.duration)
        return advance_from_rest(segment, characteristics.duration, characteristics.dynamics.block)

    def _activate(self, k, density):
        """Activate in step k the cells with more than a negligible mass at one of the nodes that share them.

        `density` (nodes in y1, nodes in y2, ``space.shape``) are coefficients.
        """
        size = len(density) // self.active.shape[1]
        for group, cells in enumerate(self.active[k]):
            nodes, beyond = slice(group * size, (group + 1) * size), False
            steps = self.steps[k][nodes]
            for part in density[nodes].reshape(-1, *self.space.shape):
                beyond |= mark_massive_cells(
                    part, self.space.areas, self.negligible, steps[0].characteristics.active, cells
                )
            if beyond:
                grown = with_neighbours(cells)
                for step in steps:
                    step.activate(grown)

    def snapshot(self, state: PeriodicState) -> Snapshot:
        """Density, outflow and mass at rest of a `PeriodicState`, summed over all nodes.

        They are reflected back where it is the mirror image.
        """
        marginal = state.density.sum(axis=(0, 1))
        return Snapshot(
            reflected(marginal) if state.reflected else marginal, state.outflow, not_none(state.at_rest).sum()
        )


@kernel
def advance_from_rest(segment, duration, block):
    """Angle, velocity and side (0: at rest) after a step of a block that is at rest at its begin.

    The forcing is that of the `Segment` up to its time `duration`; `block` is a `KernelBlock`.
    """
    x, v, side, _ = advance_through_events(0.0, 0.0, 0, segment, 0.0, duration, block)
    return x, v, side
