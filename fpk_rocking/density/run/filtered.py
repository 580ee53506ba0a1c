"""A scene with filtered noise at one resolution: densities at the nodes of the filter's states, and blocks at rest.

In a step the noise is held: at every node a density of angle and velocity moves under the forcing and a constant, by
the paths of a block without other noise. Between steps the filter mixes the nodes, exactly. So the noise is a process
that is constant over each step and has, from step to step, the law of the filter.

Blocks whose impacts accumulate while the force cannot lift them off come to rest at x = v = 0, an atom of each node. It
is set free, on the side of f, in the first step in which |f| passes the level of lift-off.
"""

import dataclasses
import math
from collections.abc import Iterator

import numpy as np

from fpk_rocking.base import ahead
from fpk_rocking.base.jit import kernel
from fpk_rocking.base.types import Array
from fpk_rocking.density.memory.nodes import Nodes
from fpk_rocking.density.memory.resolution import NodeGrid, node_grid
from fpk_rocking.density.memory.start import Flight, deposit_points
from fpk_rocking.density.resolution import Grid
from fpk_rocking.density.run.base import Seen
from fpk_rocking.density.run.cyclic import CyclicRun, State
from fpk_rocking.density.space.space import reflected
from fpk_rocking.density.step.free_flight import angle_remap_of
from fpk_rocking.density.step.step import (
    Characteristics,
    Dynamics,
    Quadrature,
    Step,
    mark_massive_cells,
    with_neighbours,
)
from fpk_rocking.physics.forcing import periodic
from fpk_rocking.physics.motion.events import advance_through_events
from fpk_rocking.scene.parts import Start
from fpk_rocking.scene.scene import Scene

_BETWEEN = 0.1
"""What nodes may leave unseen of blocks at rest, over the weight of a node where the level of lift-off is; up to .05
was measured, under three filters."""


class FilteredRun(CyclicRun):
    """A scene that repeats, under filtered noise, at one resolution; parameters as of `Run`.

    Attributes
    ----------
    leg : list of list of Step
        The steps of a leg, each at every node of the noise.
    memory : int
        Bytes that an evolution took.
    """

    atom = True
    memory = 0.0

    def __init__(self, scene, grid, negligible, guide=None):
        super().__init__(scene, grid, grid.plane, negligible, scene.period * grid.marks)
        self.nodes = Nodes(scene.noise, grid.nodes, grid.spacing)
        # Near nodes alone exchange mass where the spacing is one: then each has cells of its own.
        self.occupied = np.repeat(self.occupied[:, None], len(self.nodes.values) if grid.spacing else 1, axis=1)
        if guide:
            self._follow(guide)
        self.durations = np.diff(self.begins)
        self._mixing = {}
        self.quadrature = Quadrature(grid.points, grid.points, 1, 1, 1)
        self.leg = [self._steps(k) for k in range(len(self.durations))]

    @staticmethod
    def adapted(scene: Scene, grid: Grid, number: int) -> NodeGrid:
        """Return the mesh with the nodes and steps of a resolution."""
        ahead.before(ahead.of_block("fpk_rocking.density.ahead:filtered", scene))
        return node_grid(scene, grid, number)

    def _follow(self, guide):
        """Count as occupied what was at the nodes of a coarser run on either side, about the same time."""
        places = np.searchsorted(guide.nodes.values, self.nodes.values)[: self.occupied.shape[1]]
        for k, begin in enumerate(self.begins[:-1]):
            found = guide.occupied_near(begin, self.space)
            last = len(found) - 1
            self.occupied[k] = found[np.clip(places - 1, 0, last)] | found[np.clip(places, 0, last)]

    def _dynamics(self, constant):
        forcing, block = periodic(self.scene.forcing).with_constant(constant), self.scene.block
        common = forcing, 0.0, block.restitution, self.scene.overturning.angle
        return Dynamics(*common, critical_angle=block.critical_angle or None)

    def _steps(self, k):
        """Step k of a leg at every node of the noise; they share what does not depend on the node."""
        begin, duration, space = self.begins[k], self.durations[k], self.space
        factor = self.nodes.held(duration)
        each = [self._dynamics(factor * value) for value in self.nodes.values]
        shear = angle_remap_of(space, each[0].affine(begin, duration), 0.0, duration)
        return [
            Step(
                Characteristics(space, begin, duration, dynamics, self.quadrature, cells=False),
                space,
                self.buffers,
                shear,
            )
            for dynamics in each
        ]

    @property
    def unseen(self) -> float:
        """Part of the blocks at rest after a cycle that the nodes may misplace, though all resolutions agree.

        It is what nodes beyond the level of lift-off weigh too much or too little, and a part of a node's weight there.
        """
        if self.grid.spacing is None:
            return 0.0
        level, sigma = self.scene.block.lift_off, self.nodes.sigma
        force, weights = self.scene.forcing.value(0.0), self.nodes.weights.sum(axis=1)
        stays = np.abs(force + self.nodes.values) <= level
        below, above = (0.5 * math.erf((end - force) / (sigma * math.sqrt(2.0))) for end in (-level, level))
        between = 0.5 * (weights[1:] + weights[:-1])[stays[1:] != stays[:-1]].sum()
        return (abs(weights[stays].sum() - (above - below)) + _BETWEEN * between) / (above - below)

    def _mixed(self, time):
        """Return the matrix that takes the masses of the nodes over a time."""
        key = round(time / self.scene.period, 12)
        if key not in self._mixing:
            self._mixing[key] = self.nodes.mixing(time)
        return self._mixing[key]

    def _memory(self):
        """Bytes that the run holds, marginal densities of all cycles left out."""
        densities = 3 * 8 * self.nodes.weights.size * self.space.unknowns
        shears = sum(part.nbytes for steps in self.leg for part in steps[0].angle_remap)
        return self.buffers.nbytes + densities + shears + sum(step.nbytes for steps in self.leg for step in steps)

    def _around(self, time):
        before = int(np.searchsorted(self.begins, time, side="right")) - 1
        return before, before + 1

    def march(self, times: Array, start: Start) -> Iterator[Seen]:
        """Show the density after every cycle, once: the steps are let go of then, and `memory` tells what they took."""
        yield from super().march(times, start)
        self.memory, self.leg, self.buffers = self._memory(), [], None

    def _begin(self, start):
        flight = Flight(dataclasses.replace(self.scene, start=start), self.nodes, self._dynamics(0.0))
        shape = self.nodes.weights.shape
        if flight.at_rest:
            return State(np.zeros((*shape, *self.space.shape)), np.zeros(3), rest=self.nodes.weights.copy()), 0
        begins = np.unique(np.concatenate([self.begins + lap * self.begins[-1] for lap in range(self.legs)]))
        first = flight.last_step(self.space, begins)
        density, gone = flight.land(begins[first], self.space)
        return State(density, gone, rest=np.zeros(shape)), first

    def _after(self, k, state, first):
        """Mix the nodes over half of the step before and half of step k of the leg, and carry them by the latter."""
        mixing = self._mixed(0.5 * (self.durations[k] + (0.0 if first else self.durations[k - 1])))
        density = (mixing @ state.density.reshape(len(mixing), -1)).reshape(state.density.shape)
        rest = (mixing @ state.rest.ravel()).reshape(state.rest.shape)
        sinks = self._move(k, density, rest)
        return state.after(density, sinks, rest)

    def _seen(self, state):
        marginal = state.density.sum(axis=(0, 1))
        return Seen(reflected(marginal) if state.turned else marginal, state.gone, state.rest.sum())

    def _move(self, k, density, rest):
        """Move densities and what is at rest by step k of the leg, in place; return the masses (3,) that are gone."""
        self._activate(k, density)
        sinks = np.zeros(3)
        for a, step in enumerate(self.leg[k]):
            x, v, side = self._lifted_off(step.characteristics)
            for b in range(rest.shape[1]):
                density[a, b], left = step.apply(density[a, b])
                sinks += left[:3]
                if side:
                    state, mass = np.array([[x, v]]), rest[a, b : b + 1]
                    sinks += deposit_points(self.space, state, mass, side, density[a, b])
                    rest[a, b] = 0.0
                rest[a, b] += left[3]
        return sinks

    def _lifted_off(self, trace):
        """Angle, velocity and side (0: none) at the end of a step of a block that is at rest at its begin."""
        dynamics = trace.dynamics
        segment = dynamics.segment(trace.start, trace.duration)
        return carried_from_rest(segment, trace.duration, dynamics.block)

    def _activate(self, k, density):
        """Make all cells active that hold something, at one of the nodes that share their cells."""
        size = len(density) // self.occupied.shape[1]
        for g, occupied in enumerate(self.occupied[k]):
            steps, beyond = self.leg[k][g * size : (g + 1) * size], False
            for part in density[g * size : (g + 1) * size].reshape(-1, *self.space.shape):
                beyond |= mark_massive_cells(
                    part, self.space.areas, self.negligible, steps[0].characteristics.active, occupied
                )
            if beyond:
                cells = with_neighbours(occupied)
                for step in steps:
                    step.activate(cells)


@kernel
def carried_from_rest(segment, duration, block):
    """Angle, velocity and side (0: at rest) after a step of a block that is at rest at its begin."""
    x, v, side, _ = advance_through_events(0.0, 0.0, 0, segment, 0.0, duration, block)
    return x, v, side
