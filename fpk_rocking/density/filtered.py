"""Scenes with filtered noise: densities at nodes of the filter's states, and blocks at rest.

In a step the noise is piecewise constant: at every node a density of angle and velocity moves under the forcing and a
constant, by the paths of a block without other noise. Between steps the filter's transition matrix exchanges mass
between the nodes, exactly (`filter_nodes`). So the noise is constant over each step and has, from step to step, the law
of the filter.

Blocks whose impacts accumulate while the force cannot lift them off come to rest at x = v = 0, a point mass of each
place of a lattice of the states. It is re-injected, on the side of f, in the first step in which |f| passes the level
of lift-off; of the interval of the noise in which the level is, the part beyond it is.

A block that starts at rest stays in the mass at rest; every other start is a `FilteredStart`.
"""

import dataclasses
from collections.abc import Callable

import numpy as np

from fpk_rocking.base.checks import Array, not_none
from fpk_rocking.base.jit import kernel
from fpk_rocking.base.precompilation import Compilation
from fpk_rocking.density.filter_nodes import Nodes, RestNodes
from fpk_rocking.density.propagator import CyclicPropagator, PeriodicState, Solution
from fpk_rocking.density.space import reflected
from fpk_rocking.density.startup import FilteredStart, deposit_points
from fpk_rocking.density.step.dynamics import Dynamics
from fpk_rocking.density.step.free_flight import angle_remap_of
from fpk_rocking.density.step.step import Characteristics, Quadrature, Step, with_neighbours
from fpk_rocking.density.sticking import density_at_rest
from fpk_rocking.physics.forcing import periodic
from fpk_rocking.physics.motion.equation import block_of_scene
from fpk_rocking.physics.motion.events import advance_through_events
from fpk_rocking.scene.least import KINDS, least_scenes
from fpk_rocking.scene.parts import Start

_NO_MASS = 1e-18
"""Mass at rest that is dropped: of 1 in all, it is below rounding."""


class FilteredPropagator(CyclicPropagator):
    """A scene that repeats, under filtered noise, at one resolution; parameters as of `Propagator`."""

    rests_exactly = True
    memory = 0.0

    def __init__(self, scene, discretization, negligible, coarse=None):
        begins = scene.period * discretization.time_grid
        super().__init__(scene, discretization, discretization.plane, negligible, begins, coarse)
        self.nodes = Nodes(scene.noise, discretization.nodes)
        self.rest_nodes = RestNodes(self.nodes, discretization.rest_spacing)
        self.durations = np.diff(self.step_begins)
        self._transitions, self._lifted, self._parts = {}, {}, {}
        self.steps = [self._steps_at_nodes(k, duration) for k, duration in enumerate(self.durations)]

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

    def _transition(self, time):
        """Matrix (nodes, nodes) that takes the masses of the nodes over a `time`; kept for the next cycle."""
        return self._kept(self.nodes, time)

    def _resting(self, at_rest, time):
        """Return the masses at rest after a `time` in which the noise alone changes."""
        if not at_rest.any():
            return at_rest
        return (self._kept(self.rest_nodes, time) @ at_rest.ravel()).reshape(at_rest.shape)

    def _kept(self, nodes, time):
        """Return the transition matrix of some nodes over a `time`; it serves all cycles."""
        key = nodes, round(time / self.scene.period, 12)
        if key not in self._transitions:
            self._transitions[key] = nodes.transition_matrix(time)
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
        densities += 3 * 8 * self.rest_nodes.weights.size**2
        shears = sum(part.nbytes for steps in self.steps for part in steps[0].angle_remap)
        paths = sum(step.nbytes for steps in self.steps for step in steps)
        self.memory, self.steps, self.buffers = self.buffers.nbytes + densities + shears + paths, [], None
        return solution

    def initial_state(self, start: Start, times: Array) -> PeriodicState:  # noqa: ARG002  (as of other kinds)
        """Return the `PeriodicState` at the time when the mesh takes over from the start: τ = 0 for a start at rest."""
        begin = FilteredStart(dataclasses.replace(self.scene, start=start), self.nodes, self._dynamics(0.0))
        shape = self.nodes.weights.shape
        if begin.at_rest:
            density, at_rest = np.zeros((*shape, *self.space.shape)), self.rest_nodes.weights.copy()
            return PeriodicState(0, 0.0, density, np.zeros(3), at_rest=at_rest, first=True)
        begins = np.array([self.time_of(k) for k in range(self.steps_per_cycle + 1)])
        first = begin.takeover_step(self.space, begins)
        density, outflow = begin.project(begins[first], self.space)
        at_rest = np.zeros(self.rest_nodes.weights.shape)
        return PeriodicState(first, begins[first], density, outflow, at_rest=at_rest, first=True)

    def early_state(self, start: Start, time: float) -> PeriodicState:
        """Return the `PeriodicState` at a `time` before the mesh takes the start over; it is narrower than cells."""
        begin = FilteredStart(dataclasses.replace(self.scene, start=start), self.nodes, self._dynamics(0.0))
        density, outflow = begin.project(time, self.space)
        return PeriodicState(0, time, density, outflow, at_rest=np.zeros(self.rest_nodes.weights.shape))

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
        at_rest = state.at_rest.copy()
        if not state.first:  # the states of a filter, and so masses of a start at rest, are stationary
            at_rest = self._resting(self._resting(at_rest, 0.5 * before), 0.5 * duration)
        return density, self._move(k, density, at_rest, number), at_rest

    def _move(self, k, density, at_rest, number=None):
        """Move densities and masses at rest, in place, by step k, or the part of it with a number; return outflow (3,).

        The outflow is that to the left, to the right, and what is truncated.
        """
        steps = self.steps[k if number is None else number]
        self._activate(k, steps, density)
        outflow, rested = np.zeros(3), np.zeros(self.nodes.weights.shape)
        for a, step in enumerate(steps):
            for b in range(rested.shape[1]):
                density[a, b], masses = step.apply(density[a, b])
                outflow += masses[:3]
                rested[a, b] = masses[3]
        if at_rest.any():
            outflow += self._lift_off(k, steps[0].characteristics.duration, density, at_rest)
        at_rest += self.rest_nodes.rested(rested)
        if np.abs(at_rest).sum() < _NO_MASS:
            at_rest[:] = 0.0
        return outflow

    def _lift_off(self, k, duration, density, at_rest):
        """Move the masses at rest that are lifted off from begin k on to the density, in place; return outflow (3,)."""
        outflow, stays = np.zeros(3), np.ones(len(at_rest))
        for place, part, value, (cells, values, beyond) in self._lifted_off(k, duration):
            lifted = part * at_rest[place]
            stays[place] -= part
            density[:, :, *cells] += np.multiply.outer(self.rest_nodes.lifted(value, lifted), values)
            outflow += lifted.sum() * beyond
        at_rest *= stays[:, None]
        return outflow

    def _lifted_off(self, k, duration):
        """List (place, part, value, unit) of what is lifted off from begin k on: part, y1, and what 1 becomes."""
        if (k, duration) not in self._lifted:
            begin, level, lifted = self.step_begins[k], self.scene.block.lift_off, []
            factor = self.nodes.sigma * self.nodes.piecewise_constant_factor(duration)
            forces = [self.scene.forcing.value(begin + part * duration) for part in np.linspace(0.0, 1.0, 17)]
            right, left = (level - max(forces)) / factor, (-level - min(forces)) / factor
            # What would leave to either side leaves to that on which it is lifted off first.
            ranges = ((-np.inf, np.inf),) if right <= left else ((-np.inf, left), (right, np.inf))
            for low, high in ranges:
                for place, (part, value) in enumerate(zip(*self.rest_nodes.parts_between(low, high), strict=True)):
                    unit = self._from_rest(begin, duration, factor * value) if part > 0.0 else None
                    if unit:
                        lifted.append((place, part, value, unit))
            self._lifted[k, duration] = lifted
        return self._lifted[k, duration]

    def _from_rest(self, begin, duration, constant):
        """What a mass of 1 at rest becomes in a step under the forcing plus a `constant` force; None where it rests."""
        dynamics = self._dynamics(constant)
        x, v, side = advance_from_rest(dynamics.segment(begin, duration), duration, dynamics.block)
        unit = np.zeros(self.space.shape)
        outflow = deposit_points(self.space, np.array([[x, v]]), np.ones(1), side, unit)
        cells = np.nonzero(unit.any(axis=(2, 3)))
        return (cells, unit[cells], outflow) if side else None

    def _activate(self, k, steps, density):
        """Activate in the `steps` at all nodes the cells with more than a negligible mass in step k at one of them."""
        nodes = density.reshape(-1, *density.shape[2:])  # over these first: four times as fast as over all axes
        largest = np.maximum(nodes.max(axis=0), -nodes.min(axis=0)).max(axis=(2, 3)) * self.space.areas
        self.active[k] |= largest > self.negligible
        if (self.active[k] & ~steps[0].active).any():
            grown = with_neighbours(self.active[k])
            for step in steps:
                step.activate(grown)

    def masses_at_rest(self, state: PeriodicState) -> Array:
        """Return the masses (places of y1, of y2) at rest at a state's time; those of a state are of its last middle.

        What the noise lifts off in between is left out.
        """
        at_rest = not_none(state.at_rest)
        if at_rest.any() and not state.first:
            within = state.time - self.time_of(state.step)
            last = within if within > 1e-12 else self.durations[state.step % len(self.active) - 1]
            at_rest = self._resting(at_rest, 0.5 * last)
        force, level = self.scene.forcing.value(state.time), self.scene.block.lift_off
        ends = [(end - (-force if state.reflected else force)) / self.nodes.sigma for end in (-level, level)]
        return self.rest_nodes.parts_between(*ends)[0][:, None] * at_rest

    def density_of(self, state: PeriodicState) -> tuple[Array, Array, float, bool]:
        """Return density, outflow and mass at rest of a state, summed over all nodes.

        What was lifted off since the middle of the last step has hardly moved: it is in the density, next to x = v = 0.
        """
        density, rests = state.density.sum(axis=(0, 1)), self.masses_at_rest(state).sum()
        density += (not_none(state.at_rest).sum() - rests) * density_at_rest(self.space)
        return reflected(density) if state.reflected else density, state.outflow, rests, self.is_resolved(state)


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
