"""From the start to the first masses on the nodes of the main mesh, without a negative weight.

The same windows as in `density.start`, but of nodes: they grow with the density, and their nodes lie as close as the
noise of the step that leads to them demands.
"""

import dataclasses
import math

import numpy as np

from fpk_rocking.density.clouds import moments
from fpk_rocking.density.landing import free
from fpk_rocking.density.mesh import window_lines
from fpk_rocking.density.nodes import Clouds, NodeMesh
from fpk_rocking.density.paths import OVERTURNED_SIDE
from fpk_rocking.density.resolution import LADDER
from fpk_rocking.density.start import Departure, Gaussian
from fpk_rocking.density.window import NEGLIGIBLE, VISIBLE
from fpk_rocking.jit import kernel
from fpk_rocking.physics.flight import TERMS, harmonic_particular, segment_of
from fpk_rocking.physics.gaussian import flight_covariance

REACH = 8.0
"""Half-width of a window in standard deviations."""

ANGLE_CELL, VELOCITY_CELL = 0.67, 0.64
"""Largest cells over sqrt(D h^3) and sqrt(2 D h), at which the noise of a step has the variance to spare."""

# Cells and Gauss points are those of the other windows, which are not used here.
_WINDOWS = dataclasses.replace(LADDER[-1].windows, reach=REACH, growth=0.35, early=0.02)
_MOST_CELLS = 400


def lattice(gaussian: Gaussian, cells):
    """Points (angle, velocity, side) and masses (n,) of a Gaussian: a lattice along its axes, REACH to all sides.

    Its spacing is at most a quarter of a standard deviation, and at most the size `cells` (angle, velocity).
    """
    root = np.linalg.cholesky(gaussian.covariance)
    axes = [_axis(cell / spread) for cell, spread in zip(cells, np.diag(root), strict=True)]
    u, w = (part.ravel() for part in np.meshgrid(*axes, indexing="ij"))
    x, v = gaussian.mean[:, None] + root @ np.array([u, w])
    masses = np.exp(-0.5 * (u * u + w * w))
    return (x, v, np.where((x > 0.0) | ((x == 0.0) & (v > 0.0)), 1, -1)), masses / masses.sum()


def _axis(spacing):
    half = math.ceil(REACH / min(0.25, spacing))
    return REACH / half * np.arange(-half, half + 1)


class NodeDeparture(Departure):
    """A start carried to the nodes of a mesh.

    Parameters
    ----------
    dynamics : Dynamics
    start : Start
        Of the scene.
    period : float
        Of the forcing.
    """

    def __init__(self, dynamics, start, period):
        super().__init__(dynamics, start, _WINDOWS, period)

    def masses(self, end, mesh: NodeMesh):
        """Masses (nodes,) at a time on the nodes of a mesh, and what has gone (3,): overturned, or out of a window."""
        time = min(self._quiet, 0.75 * end)
        gaussian = self.flight(time)
        points, masses = lattice(gaussian, cell_sizes(self.dynamics.diffusion, end))
        masses[np.abs(points[0]) >= self.dynamics.cutoff] = 0.0
        gone = np.array([*gaussian.tails(self.dynamics.cutoff), 0.0])
        masses *= (1.0 - gone.sum()) / masses.sum()
        while time < end:
            points, masses = tuple(part[masses > 0.0] for part in points), masses[masses > 0.0]
            longest = min(_WINDOWS.growth * (time + self._gathered), self._longest(time), self.period / 32)
            duration = min(max(self._free(points, masses, time, end - time), longest), end - time)
            if end - time - duration < 0.1 * duration:
                duration = end - time
            clouds = Clouds(points, time, duration, self.dynamics)
            time += duration
            target = mesh if time >= end else self._window(clouds, masses, duration, mesh)
            masses, sinks = clouds.onto(target).apply(masses)
            gone += sinks
            points = target.points
        return masses, gone

    def _free(self, points, masses, time, longest):
        """Longest of the halvings of a duration within which nothing can happen; 0 below a 64th of it."""
        dynamics = self.dynamics
        for duration in longest * 0.5 ** np.arange(7):
            reach = REACH * math.sqrt(flight_covariance(dynamics.diffusion, duration)[0])
            quiet = free_points(*points, time, duration, dynamics.harmonic, dynamics.cutoff, reach)
            if masses[~quiet].sum() < NEGLIGIBLE:
                return duration
        return 0.0

    def _window(self, clouds, masses, duration, mesh):
        """Mesh that holds REACH standard deviations of what has not overturned, and every visible node of it."""
        standing = np.abs(clouds.codes) < OVERTURNED_SIDE
        parts = (masses[:, None] * clouds.weights)[standing]
        if parts.sum() < NEGLIGIBLE:
            return mesh
        x, v = clouds.states[standing].T
        cells = cell_sizes(self.dynamics.diffusion, duration)
        _, mx, mv, xx, _, vv = moments(x, v, parts)
        lines = []
        for values, mean, spread, cell in ((x, mx, math.sqrt(xx), cells[0]), (v, mv, math.sqrt(vv), cells[1])):
            visible = values[parts > VISIBLE]
            low, high = visible.min(initial=mean - REACH * spread), visible.max(initial=mean + REACH * spread)
            lines.append((low, high, min(math.ceil((high - low) / cell), _MOST_CELLS)))
        cutoff = self.dynamics.cutoff
        (low, high, count), across = lines
        angle = window_lines(max(low, -cutoff), min(high, cutoff), count)
        return NodeMesh.of(np.unique(np.clip(angle, -cutoff, cutoff)), window_lines(*across))


def cell_sizes(diffusion, duration):
    """Largest cells (angle, velocity) whose hats add no more variance than the noise of a step has to spare."""
    return ANGLE_CELL * math.sqrt(diffusion * duration**3), VELOCITY_CELL * math.sqrt(2.0 * diffusion * duration)


@kernel
def free_points(x, v, side, start, duration, harmonic, cutoff, margin):
    """Whether no path from each point comes within `margin` of an impact or the cut-off during a step: (n,) of bool."""
    particular, force = np.empty(TERMS), np.empty(TERMS)
    harmonic_particular(start, *harmonic, particular)
    segment = segment_of(particular, force, duration)
    out = np.empty(len(x), np.bool_)
    for p in range(len(x)):
        u, w = side[p] * x[p], side[p] * v[p]
        out[p] = free(u, u, w, w, side[p], segment, duration, cutoff, margin)
    return out
