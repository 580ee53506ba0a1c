"""A scene at one resolution: its mesh, the time steps of a forcing cycle or of half of it, and the density they evolve.

Where the forcing is its own mirror image half a cycle later, the steps of the first half serve the second one too: the
density is turned about the origin instead. That half, or else the whole cycle, is a *leg* here.
"""

import numpy as np

from fpk_rocking.density.space.solution import Solution
from fpk_rocking.density.space.space import Space, turn
from fpk_rocking.density.start.departure import Departure, first_resolved, initial_density
from fpk_rocking.density.step.occupied import meeting, occupy, with_neighbours
from fpk_rocking.density.step.step import Dynamics, Step, Trace, deposit_buffers


class PeriodicRun:
    """A scene with white noise at one resolution.

    Parameters
    ----------
    white : Scene
        With white noise.
    grid : Grid
        Mesh and steps.
    negligible : float
        A cell that has never held more is not active: what comes to it is lost, and counted.
    guide : PeriodicRun, optional
        A run of the same scene that tells which cells to activate.

    Attributes
    ----------
    legs : int
        Legs in a cycle, 1 or 2; with 2 the density is turned after each.
    leg : list of Step
        The steps of one.
    """

    def __init__(self, white, grid, negligible, guide=None):
        self.scene, self.dynamics, self.grid = white, Dynamics.of(white), grid
        self.steps, self.negligible = grid.steps, negligible
        self.space = Space(grid.angle_lines, grid.velocity_lines, grid.degree)
        self.legs = 2 if white.forcing.half_antisymmetric else 1
        self.duration, buffers = white.period / self.steps, deposit_buffers(self.space)
        self.leg = [
            Step(
                Trace(self.space, k * self.duration, self.duration, self.dynamics, grid.quadrature, cells=False),
                self.space,
                buffers,
            )
            for k in range(self.steps // self.legs)
        ]
        self.occupied = np.zeros((len(self.leg), *self.space.shape[:2]), dtype=bool)
        if guide:
            self.occupied[:] = [guide.occupied_near(k / self.steps, self.space) for k in range(len(self.leg))]

    @property
    def memory(self):
        """Bytes that the run holds, densities of all cycles left out."""
        return self.leg[0].buffers.nbytes + sum(step.memory for step in self.leg)

    def occupied_near(self, part, space):
        """Cells of another space that meet one which was occupied about a part of the cycle, within its first leg."""
        before = int(part * self.steps + 1e-9)
        after = min(before + (part * self.steps - before > 1e-9), len(self.leg) - 1)
        return meeting(self.space, self.occupied[before] | self.occupied[after], space)

    def departure(self, windows):
        """Return the `Departure` of the scene's start."""
        return Departure(self.dynamics, self.scene.start, windows, self.scene.period)

    def evolve(self, cycles, departure: Departure, progress=None):
        """Evolve over whole cycles, from where the mesh takes over from the windows of a start."""
        steps, scene = self.steps, self.scene
        inside, out = np.ones(cycles + 1), np.zeros((cycles + 1, 3))
        coefficients = np.zeros((cycles + 1, *self.space.shape))
        coefficients[0], out[0, :2] = initial_density(departure.start, self.space, scene.overturning.angle)
        inside[0] -= out[0].sum()
        first = first_resolved(departure, self.space, np.arange(steps + 1) * self.duration)
        now, gone = departure.land(first * self.duration, self.space)
        turned = False
        for k in range(first, cycles * steps + 1):
            if k % steps == 0:
                current, cycle = turn(now) if turned else now, k // steps
                inside[cycle], out[cycle], coefficients[cycle] = self.space.masses(current).sum(), gone, current
                if progress:
                    progress()
            if k == cycles * steps:
                break
            if (k % steps >= len(self.leg)) != turned:
                now, turned = turn(now), not turned
            now, sinks = self._activated(k % len(self.leg), now).apply(now)
            gone += sinks[[1, 0, 2]] if turned else sinks
        return Solution(inside, out, coefficients)

    def _activated(self, k, coefficients):
        """Step k of the leg, with all cells active that hold something."""
        step = self.leg[k]
        if occupy(coefficients, self.space.areas, self.negligible, step.trace.active, self.occupied[k]):
            step.activate(with_neighbours(self.occupied[k]))
        return step
