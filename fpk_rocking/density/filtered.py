"""Scenes with filtered noise: densities at nodes of the filter's states, and blocks at rest.

In a step the noise is piecewise constant: at every node a density of angle and velocity moves under the forcing and a
constant, by the paths of a block without other noise. Between steps the filter's transition matrix exchanges mass
between the nodes, exactly between Gauss-Hermite nodes and by cubic interpolation between equispaced ones
(`filter_nodes`). So the noise is constant over each step and has, from step to step, the law of the filter.

Blocks whose impacts accumulate while the force cannot lift them off come to rest at x = v = 0, a point mass of each
node. It is re-injected, on the side of f, in the first step in which |f| passes the level of lift-off.

A block that starts at rest stays in the mass at rest of its node; every other start is a `FilteredStart`.
"""

import dataclasses
import math
from collections.abc import Callable

import numpy as np

from fpk_rocking.base.checks import Array, not_none
from fpk_rocking.base.jit import kernel
from fpk_rocking.base.precompilation import Compilation
from fpk_rocking.density.filter_nodes import (
    Nodes,
)
from fpk_rocking.density.propagator import CyclicPropagator, PeriodicState, Solution
from fpk_rocking.density.space import reflected
from fpk_rocking.density.startup import FilteredStart, deposit_points
from fpk_rocking.density.step.dynamics import Dynamics
from fpk_rocking.density.step.free_flight import angle_remap_of
from fpk_rocking.density.step.step import Characteristics, Quadrature, Step, mark_massive_cells, with_neighbours
from fpk_rocking.density.tuning import TUNING
from fpk_rocking.physics.forcing import periodic
from fpk_rocking.physics.motion.equation import block_of_scene
from fpk_rocking.physics.motion.events import advance_through_events
from fpk_rocking.scene.least import KINDS, least_scenes
from fpk_rocking.scene.parts import Start


class FilteredPropagator(CyclicPropagator):
    """A scene that repeats, under filtered noise, at one resolution; parameters as of `Propagator`."""

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
        self._transitions, self._lifted, self._parts = {}, {}, {}
        self.steps = [self._steps_at_nodes(k, duration) for k, duration in enumerate(self.durations)]

    def _follow(self, coarse):
        """Mark as active, for each step and node of the noise, the cells that a coarser propagator has active then."""
        places = np.searchsorted(coarse.nodes.values, self.nodes.values)[: self.active.shape[1]]
        for k, begin in enumerate(self.step_begins[:-1]):
            cells = coarse.active_about(begin, self.space)
            last = len(cells) - 1
            self.active[k] = cells[np.clip(places - 1, 0, last)] | cells[np.clip(places, 0, last)]

    def _dynamics(self, constant):
        """Return the `Dynamics` of a block under the forcing plus a `constant` force, nondimensional, without noise."""
        return Dynamics(periodic(self.scene.forcing).with_constant(constant), 0.0, block_of_scene(self.scene))

    def _steps_at_nodes(self, k, duration):
        """Return a list of the `Step` of a `duration` from begin k of the symmetry period at each node of y1."""
        begin, space = self.step_begins[k], self.space
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
        """Part of the blocks at rest after a cycle that the nodes may misplace, though all resolutions agree."""
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
        """Matrix (nodes, nodes) that takes the masses of the nodes over a `time`; kept for the next cycle."""
        key = round(time / self.scene.period, 12)
        if key not in self._transitions:
            self._transitions[key] = self.nodes.transition_matrix(time)
        return self._transitions[key]

    def _steps_about(self, time):
        """Return the numbers (k, k + 1) of the last step begun by a `time` in a symmetry period, and of the next."""
        before = int(np.searchsorted(self.step_begins, time, side="right")) - 1
        return before, before + 1

    def propagate(
        self, times: Array, progress: Callable[[], object] | None = None, start: Start | None = None
    ) -> Solution:
        """Return the `Solution`, as `Propagator.propagate`; the steps are dropped then, and `memory` set."""
        solution = super().propagate(times, progress, start)
        densities = 3 * 8 * self.nodes.weights.size * self.space.unknowns
        shears = sum(part.nbytes for steps in self.steps for part in steps[0].angle_remap)
        paths = sum(step.nbytes for steps in self.steps for step in steps)
        self.memory, self.steps, self.buffers = self.buffers.nbytes + densities + shears + paths, [], None
        return solution

    def initial_state(self, start: Start, times: Array) -> PeriodicState:  # noqa: ARG002  (as of other kinds)
        """Return the `PeriodicState` at the time when the mesh takes over from the start: τ = 0 for a start at rest."""
        begin = FilteredStart(dataclasses.replace(self.scene, start=start), self.nodes, self._dynamics(0.0))
        shape = self.nodes.weights.shape
        if begin.at_rest:
            density, at_rest = np.zeros((*shape, *self.space.shape)), self.nodes.weights.copy()
            return PeriodicState(0, 0.0, density, np.zeros(3), at_rest=at_rest, first=True)
        begins = np.array([self.time_of(k) for k in range(self.steps_per_cycle + 1)])
        first = begin.takeover_step(self.space, begins)
        density, outflow = begin.project(begins[first], self.space)
        return PeriodicState(first, begins[first], density, outflow, at_rest=np.zeros(shape), first=True)

    def early_state(self, start: Start, time: float) -> PeriodicState:
        """Return the `PeriodicState` at a `time` before the mesh takes the start over; it is narrower than cells."""
        begin = FilteredStart(dataclasses.replace(self.scene, start=start), self.nodes, self._dynamics(0.0))
        density, outflow = begin.project(time, self.space)
        return PeriodicState(0, time, density, outflow, at_rest=np.zeros(self.nodes.weights.shape))

    def _apply(self, k, state, duration=None):
        """Return (density, outflow, masses at rest) of a `PeriodicState` after step k, or a `duration` of it."""
        number, before = k, 0.0 if state.first else self.durations[k - 1]
        if duration is None:
            duration = self.durations[k]
        else:  # such parts are kept behind the steps
            number = self._parts.setdefault((k, round(duration / self.durations[k], 9)), len(self.steps))
            if number == len(self.steps):
                self.steps.append(self._steps_at_nodes(k, duration))
        matrix = self._transition(0.5 * (duration + before))
        density = (matrix @ state.density.reshape(len(matrix), -1)).reshape(state.density.shape)
        at_rest = (matrix @ state.at_rest.ravel()).reshape(state.at_rest.shape)
        return density, self._move(k, density, at_rest, number), at_rest

    def _move(self, k, density, at_rest, number=None):
        """Move densities and masses at rest, in place, by step k, or the part of it with a number; return outflow (3,).

        The outflow is that to the left, to the right, and what is truncated.
        """
        number = k if number is None else number
        self._activate(k, number, density)
        outflow = np.zeros(3)
        for a, step in enumerate(self.steps[number]):
            lifted = at_rest[a].copy()
            unit = self._lifted_off(number, a)
            at_rest[a] *= unit is None
            for b in range(at_rest.shape[1]):
                density[a, b], masses = step.apply(density[a, b])
                outflow += masses[:3]
                at_rest[a, b] += masses[3]
            if unit:
                cells, values, beyond = unit
                density[a][:, *cells] += np.multiply.outer(lifted, values)
                outflow += lifted.sum() * beyond
        return outflow

    def _lifted_off(self, number, a):
        """What a mass of 1 at rest becomes in a step at node a of y1, None where it stays; kept for all cycles."""
        if (number, a) not in self._lifted:
            x, v, side = self._from_rest(self.steps[number][a].characteristics)
            unit = np.zeros(self.space.shape)
            outflow = deposit_points(self.space, np.array([[x, v]]), np.ones(1), side, unit)
            cells = np.nonzero(unit.any(axis=(2, 3)))
            self._lifted[number, a] = (cells, unit[cells], outflow) if side else None
        return self._lifted[number, a]

    def _from_rest(self, characteristics):
        """Return (x, v, side), at the end of a step, of a block that is at rest at its begin; side ±1, or 0 at rest."""
        segment = characteristics.dynamics.segment(characteristics.start, characteristics.duration)
        return advance_from_rest(segment, characteristics.duration, characteristics.dynamics.block)

    def _activate(self, k, number, density):
        """Activate the cells with more than a negligible mass in step k, at one of the nodes that share them."""
        size = len(density) // self.active.shape[1]
        for group, cells in enumerate(self.active[k]):
            nodes, beyond = slice(group * size, (group + 1) * size), False
            steps = self.steps[number][nodes]
            for part in density[nodes].reshape(-1, *self.space.shape):
                beyond |= mark_massive_cells(
                    part, self.space.areas, self.negligible, steps[0].characteristics.active, cells
                )
            if beyond:
                grown = with_neighbours(cells)
                for step in steps:
                    step.activate(grown)

    def density_of(self, state: PeriodicState) -> tuple[Array, Array, float, bool]:
        """Return density, outflow and mass at rest of a state, summed over all nodes."""
        marginal = state.density.sum(axis=(0, 1))
        density = reflected(marginal) if state.reflected else marginal
        return density, state.outflow, not_none(state.at_rest).sum(), self.is_resolved(state)


@kernel
def advance_from_rest(segment, duration, block):
    """Return (x, v, side) after a step of a block that is at rest at its begin; side ±1, or 0 at rest."""
    x, v, side, _ = advance_through_events(0.0, 0.0, 0, segment, 0.0, duration, block)
    return x, v, side


REST = {kind: Compilation(f"{__name__}:compile_rest:{kind}", 3) for kind in KINDS}
"""Compilations of what a density needs under filtered noise alone, by kind of block."""


def compile_rest(kind: str) -> None:
    """Move a block from rest."""
    dynamics = Dynamics.of(least_scenes(kind)["white"])
    advance_from_rest(dynamics.segment(0.0, 0.1), 0.1, dynamics.block)
