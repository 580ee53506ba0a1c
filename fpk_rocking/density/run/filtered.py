"""A scene with filtered noise at one resolution: densities at the nodes of the filter's states, and blocks at rest.

In a step the noise is held: at every node a density of angle and velocity moves under the forcing and a constant, by
the paths of a block without other noise. Between steps the filter mixes the nodes, exactly. So the noise is a process
that is constant over each step and has, from step to step, the law of the filter.

Blocks whose impacts accumulate under |f| <= 1 come to rest at x = v = 0, an atom of each node. It is set free, on the
side of f, in the first step in which |f| passes 1.
"""

import dataclasses

import numpy as np

from fpk_rocking.base.jit import kernel
from fpk_rocking.density.memory.nodes import Nodes
from fpk_rocking.density.memory.start import Flight, deposit_points
from fpk_rocking.density.space.solution import Solution
from fpk_rocking.density.space.space import Space, turn
from fpk_rocking.density.step.free_flight import angle_shear_of
from fpk_rocking.density.step.occupied import meeting, occupy, with_neighbours
from fpk_rocking.density.step.step import Dynamics, Quadrature, Step, Trace, deposit_buffers
from fpk_rocking.physics.forcing import PeriodicForcing
from fpk_rocking.physics.transition import advance


@dataclasses.dataclass(frozen=True)
class Held:
    """A forcing with a constant added to it; see `PeriodicForcing`."""

    forcing: PeriodicForcing
    constant: float

    def over(self, start, duration):
        """Coefficients of the particular solution over a step: that of a constant c is -c."""
        out = self.forcing.over(start, duration).copy()
        out[0] -= self.constant
        return out

    def particular(self, time):
        """Particular solution and its derivative at a time."""
        value, slope = self.forcing.particular(time)
        return value - self.constant, slope


class FilteredRun:
    """A scene with filtered noise at one resolution.

    Parameters
    ----------
    scene : Scene
        With filtered noise.
    grid : NodeGrid
        Mesh, nodes and steps.
    negligible : float
        A cell that has never held more at any node is not active: what comes to it is lost, and counted.
    guide : FilteredRun, optional
        A run of the same scene that tells which cells to activate.

    Attributes
    ----------
    leg : list of list of Step
        The steps of a leg (half a cycle, or a cycle), each at every node of the noise.
    memory : int
        Bytes that an evolution took.
    """

    def __init__(self, scene, grid, negligible, guide=None):
        self.scene, self.grid, self.negligible, self.steps = scene, grid, negligible, grid.steps
        plane = grid.plane
        self.space = Space(plane.angle_lines, plane.velocity_lines, plane.degree)
        self.nodes = Nodes(scene.noise, grid.nodes)
        self.begins = scene.period * grid.marks
        self.durations = np.diff(self.begins)
        self._mixing = {}
        self.buffers, self.quadrature = deposit_buffers(self.space), Quadrature(grid.points, grid.points, 1, 1, 1)
        self.leg = [self._steps(k) for k in range(len(self.durations))]
        self.occupied, self.memory = np.zeros((len(self.leg), *self.space.shape[:2]), dtype=bool), 0
        if guide:
            self.occupied[:] = [guide.occupied_near(begin, self.space) for begin in self.begins[:-1]]

    def _dynamics(self, constant):
        scene = self.scene
        return Dynamics(Held(scene.forcing, constant), 0.0, scene.block.restitution, scene.overturning.angle)

    def _steps(self, k):
        """Step k of a leg at every node of the noise; they share what does not depend on the node."""
        begin, duration, space = self.begins[k], self.durations[k], self.space
        factor = self.nodes.held(duration)
        each = [self._dynamics(factor * value) for value in self.nodes.values]
        shear = angle_shear_of(space, each[0].affine(begin, duration), 0.0, duration)
        return [
            Step(Trace(space, begin, duration, dynamics, self.quadrature, cells=False), space, self.buffers, shear)
            for dynamics in each
        ]

    def _mixed(self, time):
        """Return the matrix that takes the masses of the nodes over a time."""
        key = round(time / self.scene.period, 12)
        if key not in self._mixing:
            self._mixing[key] = self.nodes.mixing(time)
        return self._mixing[key]

    def _memory(self):
        """Bytes that the run holds, marginal densities of all cycles left out."""
        densities = 3 * 8 * self.nodes.weights.size * self.space.unknowns
        shears = sum(part.nbytes for steps in self.leg for part in steps[0].angle_shear)
        return self.buffers.nbytes + densities + shears + sum(step.memory for steps in self.leg for step in steps)

    def occupied_near(self, time, space):
        """Cells of another space that meet one which was occupied about a time, within the first leg."""
        before = int(np.searchsorted(self.begins, time, side="right")) - 1
        after = min(before + 1, len(self.occupied) - 1)
        return meeting(self.space, self.occupied[before] | self.occupied[after], space)

    def evolve(self, cycles, progress=None, watch=None):
        """Evolve over whole cycles, once; returns a `Solution` of the marginal over the filter's states.

        The steps are let go of then, and `memory` tells what they took. Before each step, and at the end, `watch` is
        called with the time in cycles, the densities of the nodes, their masses at rest, and whether these are
        those of the mirror image (turned, with the nodes in reverse).
        """
        density, rest, gone, first = self._begin()
        inside, out, at_rest = np.ones(cycles + 1), np.zeros((cycles + 1, 3)), np.zeros(cycles + 1)
        coefficients, turned = np.zeros((cycles + 1, *self.space.shape)), False
        at_rest[0] = float(not (self.scene.start.angle or self.scene.start.velocity or self.scene.start.covariance))
        for k in range(first, cycles * self.steps + 1):
            if k % self.steps == 0 and k > 0:
                now, cycle = density.sum(axis=(0, 1)), k // self.steps
                coefficients[cycle] = turn(now) if turned else now
                at_rest[cycle], out[cycle] = rest.sum(), gone
                inside[cycle] = self.space.masses(now).sum() + at_rest[cycle]
                if progress:
                    progress()
            here = k % len(self.leg)
            if watch:
                watch(k // len(self.leg) / self.grid.legs + self.grid.marks[here], density, rest, turned)
            if k == cycles * self.steps:
                break
            if (k % self.steps >= len(self.leg)) != turned:
                density, rest, turned = turn(density)[::-1, ::-1], rest[::-1, ::-1], not turned
            mixing = self._mixed(0.5 * (self.durations[here] + (self.durations[here - 1] if k > first else 0.0)))
            density = (mixing @ density.reshape(len(mixing), -1)).reshape(density.shape)
            rest = (mixing @ rest.ravel()).reshape(rest.shape)
            sinks = self._move(here, density, rest)
            gone = gone + (sinks[[1, 0, 2]] if turned else sinks)
        self.memory, self.leg, self.buffers = self._memory(), None, None
        return Solution(inside, out, coefficients, at_rest=at_rest)

    def _begin(self):
        """Densities and masses at rest of the nodes, what is gone (3,), and the number of steps that led there."""
        flight = Flight(self.scene, self.nodes, self._dynamics(0.0))
        shape = self.nodes.weights.shape
        if flight.at_rest:
            return np.zeros((*shape, *self.space.shape)), self.nodes.weights.copy(), np.zeros(3), 0
        begins = np.unique(np.concatenate([self.begins + lap * self.begins[-1] for lap in range(self.grid.legs)]))
        first = flight.last_step(self.space, begins)
        density, gone = flight.land(begins[first], self.space)
        return density, np.zeros(shape), gone, first

    def _move(self, k, density, rest):
        """Move densities and what is at rest by step k of the leg, in place; return the masses (3,) that are gone."""
        self._activate(k, density)
        sinks = np.zeros(3)
        for a, step in enumerate(self.leg[k]):
            x, v, side = self._lifted_off(step.trace)
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
        return carried_from_rest(segment, trace.duration, dynamics.restitution, dynamics.cutoff)

    def _activate(self, k, density):
        """Make all cells active, at every node, that hold something at one of them."""
        steps, beyond = self.leg[k], False
        for part in density.reshape(-1, *self.space.shape):
            beyond |= occupy(part, self.space.areas, self.negligible, steps[0].trace.active, self.occupied[k])
        if beyond:
            cells = with_neighbours(self.occupied[k])
            for step in steps:
                step.activate(cells)


@kernel
def carried_from_rest(segment, duration, restitution, cutoff):
    """Angle, velocity and side (0: at rest) after a step of a block that is at rest at its begin."""
    x, v, side, _ = advance(0.0, 0.0, 0, segment, 0.0, duration, restitution, cutoff)
    return x, v, side
