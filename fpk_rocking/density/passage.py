"""A scene that does not repeat at one resolution: a step is set up once, where the density is, and dropped."""

import numpy as np

from fpk_rocking.density.propagator import Solution, occupy, with_neighbours
from fpk_rocking.density.resolution import cycle_of
from fpk_rocking.density.space.space import Space
from fpk_rocking.density.start.departure import Departure, first_resolved, initial_density
from fpk_rocking.density.step.step import Dynamics, Step, Trace, deposit_buffers

_NEAR = 0.3
"""Part of a step by which a time that is wanted, or the end of the motion, takes the place of a step's end."""

FAINT = 0.01
"""Mass over that of `Propagator` that a cell must hold to be active: here it is lost in every step anew."""


class Passage:
    """A scene with white noise, its forcing or noise a transient, at one resolution.

    Parameters
    ----------
    white : Scene
        With white noise.
    grid : Grid
        Mesh and steps.
    negligible : float
        A cell that holds less is not active: what is in it is lost, and counted.
    """

    def __init__(self, white, grid, negligible):
        self.scene, self.dynamics, self.grid = white, Dynamics.of(white), grid
        self.negligible = FAINT * negligible
        self.space = Space(grid.angle_lines, grid.velocity_lines, grid.degree)
        self.duration = cycle_of(white) / grid.steps
        self._buffers = deposit_buffers(self.space)

    @property
    def memory(self):
        """Bytes that the run holds, densities of all times left out."""
        return 2 * self._buffers.nbytes

    def evolve(self, times, departure: Departure, progress=None):
        """Evolve over times from 0 on, from where the mesh takes over from the windows of a start."""
        count, edges = len(times), _edges(self.scene, self.duration, times)
        inside, out = np.ones(count), np.zeros((count, 3))
        coefficients = np.zeros((count, *self.space.shape))
        coefficients[0], out[0, :2] = initial_density(departure.start, self.space, self.scene.overturning.angle)
        inside[0] -= out[0].sum()
        place, now, gone = self._begun(edges, departure)
        row = 1
        while row < count:
            if edges[place] >= times[row] * (1.0 - 1e-12):
                inside[row], out[row], coefficients[row] = self.space.masses(now).sum(), gone, now
                row += 1
                if progress:
                    progress()
                continue
            now, sinks = self._step(*edges[place : place + 2], now).apply(now)
            gone = gone + sinks
            place += 1
        return Solution(inside, out, coefficients)

    def _begun(self, edges, departure):
        """Return number of the edge, coefficients and masses gone (3,) where the mesh takes over."""
        if departure.rests:
            return 0, resting(self.space), np.zeros(3)
        place = first_resolved(departure, self.space, edges[: np.searchsorted(edges, departure.period) + 1])
        return place, *departure.land(edges[place], self.space)

    def _step(self, start, end, now):
        """Make the step from one time to another, for the cells that hold something and those beside them."""
        occupied = np.zeros(self.space.shape[:2], dtype=bool)
        occupy(now, self.space.areas, self.negligible, occupied, occupied)
        cells = with_neighbours(occupied)
        trace = Trace(self.space, start, end - start, self.dynamics, self.grid.quadrature, cells)
        return Step(trace, self.space, self._buffers)


def resting(space):
    """Coefficients of a block at rest: its mass is spread evenly over the cells around the origin."""
    coefficients = np.zeros(space.shape)
    angle, velocity = (np.flatnonzero((lines[:-1] <= 0.0) & (lines[1:] >= 0.0)) for lines in space.lines)
    cells = np.ix_(angle, velocity)
    masses = np.zeros(space.shape[:2])
    masses[cells] = 0.25
    coefficients[..., 0, 0] = masses / space.areas
    return coefficients


def _edges(scene, duration, times):
    """Edges of steps of about a duration, to the last time: among them all times and the end of the forcing."""
    fixed = [*times[1:]]
    if scene.period is None:
        fixed.append(scene.forcing.duration)
    fixed = np.unique([time for time in fixed if time <= times[-1]])
    fixed = fixed[np.append(True, np.diff(fixed) > 1e-9)]
    even = np.arange(np.ceil(times[-1] / duration)) * duration
    apart = np.abs(even[:, None] - fixed).min(axis=1) if fixed.size else np.full(even.size, np.inf)
    return np.unique(np.append(even[(apart > _NEAR * duration) | (even == 0.0)], fixed))
