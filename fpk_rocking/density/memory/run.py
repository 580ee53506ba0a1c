"""Filtered noise held over a step: the density at every node of the filter's states, evolved over whole cycles."""

import dataclasses
import math
from typing import NamedTuple

import numpy as np

from fpk_rocking.density.memory.nodes import Nodes
from fpk_rocking.density.space.space import Space, shapes
from fpk_rocking.density.step.landing import LEFT, LOST, REST, RIGHT, settle_in_cells
from fpk_rocking.density.step.step import Dynamics, Quadrature, Step, Trace, deposit_buffers, grid_of
from fpk_rocking.physics.forcing import PeriodicForcing


@dataclasses.dataclass(frozen=True)
class Held:
    """A forcing with noise that is constant in time added to it."""

    forcing: PeriodicForcing
    noise: float

    def pieces(self, instants):
        """Coefficients of the particular solution, see `PeriodicForcing.pieces`."""
        out = self.forcing.pieces(instants)
        out[:, 0] -= self.noise
        return out

    def particular(self, time):
        """Particular solution and its derivative at a time."""
        value, slope = self.forcing.particular(time)
        return value - self.noise, slope


class MemorySolution(NamedTuple):
    inside: np.ndarray
    gone: np.ndarray
    at_rest: np.ndarray
    coefficients: np.ndarray


class MemoryRun:
    def __init__(self, scene, grid, steps, counts, points, negligible):
        self.scene, self.grid, self.steps, self.negligible = scene, grid, steps, negligible
        self.space = Space(grid.angle_lines, grid.velocity_lines, grid.degree)
        self.nodes = Nodes(scene.noise, counts)
        self.duration = scene.period / steps
        self.legs = 2 if scene.forcing.half_antisymmetric else 1
        import os
        self.factor = self.nodes.held(self.duration) if not os.environ.get('NOC') else 1.0
        self.mixing = self.nodes.mixing(self.duration)
        self.held = [
            Dynamics(Held(scene.forcing, self.factor * eta), 0.0, scene.block.restitution, scene.overturning.angle)
            for eta in self.nodes.values
        ]
        buffers = deposit_buffers(self.space)
        quadrature = Quadrature(points, points, 1, 1, 1)
        self.leg = [
            [
                Step(
                    Trace(self.space, k * self.duration, self.duration, held, quadrature, cells=False),
                    self.space,
                    buffers,
                )
                for held in self.held
            ]
            for k in range(steps // self.legs)
        ]
        self.occupied = np.zeros((len(self.leg), *self.space.shape[:2]), dtype=bool)

    @property
    def memory(self):
        return sum(step.memory for steps in self.leg for step in steps)

    def evolve(self, cycles, progress=None):
        space, start = self.space, self.scene.start
        shape = self.nodes.weights.shape
        density = np.zeros((*shape, *space.shape))
        rest = np.zeros(shape)
        gone = np.zeros(3)
        if start.covariance is None and start.angle == start.velocity == 0.0:
            rest += self.nodes.weights
        elif start.covariance is None:
            spot = self.spot(start.angle, start.velocity, 1 if (start.angle or start.velocity) > 0 else -1)
            i, j, values = spot
            density[:, :, i, j] += self.nodes.weights[:, :, None, None] * values
        inside, out, at_rest = np.ones(cycles + 1), np.zeros((cycles + 1, 3)), np.zeros(cycles + 1)
        at_rest[0] = rest.sum()
        coefficients = np.zeros((cycles + 1, *space.shape))
        turned = False
        for k in range(cycles * self.steps + 1):
            if k % self.steps == 0 and k > 0:
                now = density.sum(axis=(0, 1))
                cycle = k // self.steps
                if turned:
                    now = turn(now)
                inside[cycle], out[cycle], at_rest[cycle] = space.masses(now).sum() + rest.sum(), gone, rest.sum()
                coefficients[cycle] = now
            if k == cycles * self.steps:
                break
            if (k % self.steps >= len(self.leg)) != turned:
                density = turn(density)[::-1, ::-1]
                rest = rest[::-1, ::-1]
                turned = not turned
            density = (self.mixing @ density.reshape(len(self.mixing), -1)).reshape(density.shape)
            rest = (self.mixing @ rest.ravel()).reshape(rest.shape)
            self.activate(k % len(self.leg), density)
            sinks = np.zeros(3)
            for a, step in enumerate(self.leg[k % len(self.leg)]):
                released = self.released(step.trace)
                for b in range(shape[1]):
                    density[a, b], left = step.apply(density[a, b])
                    sinks += left[:3]
                    if released is not None:
                        i, j, values = released
                        density[a, b, i, j] += rest[a, b] * values
                        rest[a, b] = 0.0
                    rest[a, b] += left[3]
            gone += sinks[[1, 0, 2]] if turned else sinks
        return MemorySolution(inside, out, at_rest, coefficients)

    def activate(self, k, density):
        masses = np.abs(density).max(axis=(0, 1, 4, 5)) * self.space.areas > self.negligible
        self.occupied[k] |= masses
        if (masses & ~self.leg[k][0].trace.active).any():
            grown = with_neighbours(self.occupied[k])
            for step in self.leg[k]:
                step.activate(grown)

    def released(self, trace):
        from fpk_rocking.physics.transition import advance

        x, v, side, _ = rest_path(trace._segment, trace.duration, trace.dynamics.restitution, trace.dynamics.cutoff)
        if side == 0:
            return None
        return self.spot(x, v, side)

    def spot(self, x, v, side):
        points, codes = np.array([[[[x, v]]]]), np.array([[[side]]], dtype=np.int32)
        cell = settle_in_cells(points[..., None, :], codes[..., None], *self._grids, self.space.first_positive)
        i, j = np.unravel_index(int(cell.ravel()[0]), self.space.shape[:2])
        xi, eta = points.ravel()
        one = shapes(np.array([0.5 * (xi + 1), 0.5 * (eta + 1)]), self.space.degree)
        return i, j, np.outer(one[0], one[1]) / self.space.areas[i, j]

    @property
    def _grids(self):
        return grid_of(self.space.angle_lines), grid_of(self.space.velocity_lines)


from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.transition import advance


@kernel
def rest_path(segment, duration, restitution, cutoff):
    return advance(0.0, 0.0, 0, segment, 0.0, duration, restitution, cutoff)


def turn(coefficients):
    signs = (-1.0) ** np.arange(coefficients.shape[-1])
    return np.ascontiguousarray(coefficients[..., ::-1, ::-1, :, :]) * np.outer(signs, signs)


def with_neighbours(cells):
    grown = cells.copy()
    grown[1:] |= cells[:-1]
    grown[:-1] |= cells[1:]
    grown[:, 1:] |= cells[:, :-1]
    grown[:, :-1] |= cells[:, 1:]
    return grown
