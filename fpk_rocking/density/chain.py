"""The evolution of point masses on the nodes of one mesh, over whole forcing cycles."""

import dataclasses
import math
from typing import NamedTuple

import numpy as np

from fpk_rocking.density.mesh import graded_lines
from fpk_rocking.density.nodes import Clouds, NodeMesh
from fpk_rocking.density.positive_start import NodeDeparture, cell_sizes
from fpk_rocking.density.run import BINS
from fpk_rocking.density.start import Gaussian, first_resolved
from fpk_rocking.density.step import Dynamics
from fpk_rocking.physics.gaussian import flight_covariance

ANGLE_GRADING, VELOCITY_GRADING = 1.3, 1.1

_LONGEST_STEPS = 0.59, 0.39, 0.295, 0.2

_COARSER, _FEWEST_CELLS = 0.7, 40


@dataclasses.dataclass(frozen=True)
class NodeResolution:
    """Fineness of a solution.

    Parameters
    ----------
    angle_cells, velocity_cells : int
        Cells of the mesh, even.
    steps : int
        Steps a cycle, even.
    """

    angle_cells: int
    velocity_cells: int
    steps: int

    @classmethod
    def of(cls, scene, bound, steps, finer=1.0):
        """Return the resolution whose largest cells are those that the noise of a step allows, over `finer`."""
        sizes = cell_sizes(scene.noise.diffusion, scene.period / steps)
        widths = ANGLE_GRADING * scene.overturning.angle, VELOCITY_GRADING * bound
        counts = (2 * math.ceil(finer * width / size) for width, size in zip(widths, sizes, strict=True))
        return cls(*(max(count, _FEWEST_CELLS) for count in counts), steps)

    @property
    def nodes(self):
        """Number of nodes."""
        return (self.angle_cells + 2) * (self.velocity_cells + 1)


def ladder(scene, bound):
    """Resolutions for a scene, each finer than the one before.

    Steps are shorter for strong noise, which what happens at impacts demands, and up to half longer for weak noise,
    which has then more variance to spare. The mesh follows from the step; of rungs with the same steps it is finer.
    """
    scale = min((0.00628 / scene.noise.diffusion) ** 0.25, 1.5)
    steps = [2 * math.ceil(0.5 * scene.period / (scale * longest)) for longest in _LONGEST_STEPS]
    finer = [_COARSER ** steps[rung + 1 :].count(count) for rung, count in enumerate(steps)]
    return [NodeResolution.of(scene, bound, *rung) for rung in zip(steps, finer, strict=True)]


class Solution(NamedTuple):
    """Survival and density after each cycle, and figures of all steps.

    Attributes
    ----------
    inside, gone : ndarray, shape (cycles + 1,), (cycles + 1, 3)
        Masses that stand, and that overturned to the left, to the right, or left the mesh.
    coefficients : ndarray, shape (cycles + 1, ...)
        Of the density in `NodeMesh.space`.
    bins : ndarray, shape (cycles + 1, *BINS)
        Probabilities of equal bins between the bounds.
    excess : float
        Variance that the mesh adds to the density in a step, at worst, over the velocity variance of the noise.
    origin : float
        Largest mass on the nodes around the origin after a step.
    negative : float
        Sum of negative masses after a step, at worst.
    """

    inside: np.ndarray
    gone: np.ndarray
    coefficients: np.ndarray
    bins: np.ndarray
    excess: float
    origin: float
    negative: float


class Chain:
    """The steps of half a cycle on one mesh, a Markov chain; the other half is their mirror image.

    Parameters
    ----------
    white : Scene
        With white noise.
    resolution : NodeResolution
    bound : float
        Velocity at which the mesh ends.
    """

    def __init__(self, white, resolution, bound):
        self.scene, self.dynamics, self.steps = white, Dynamics.of(white), resolution.steps
        self.duration = white.period / self.steps
        self.mesh = NodeMesh.of(
            graded_lines(white.overturning.angle, resolution.angle_cells, ANGLE_GRADING),
            graded_lines(bound, resolution.velocity_cells, VELOCITY_GRADING),
        )
        self.half = []
        for k in range(self.steps // 2):
            clouds = Clouds(self.mesh.points, k * self.duration, self.duration, self.dynamics)
            self.half.append(clouds.onto(self.mesh))
        # For looking at: masses of hat functions, whose own width is taken from the noise as well.
        self.view = clouds.onto(self.mesh, spread=True)

    def evolve(self, cycles, departure: NodeDeparture, progress=None):
        """Evolve over whole cycles from the scene's start: a `Solution`."""
        steps, half, space, centre = self.steps, self.steps // 2, self.mesh.space, self.mesh.origin
        noise = flight_covariance(self.dynamics.diffusion, self.duration)[2]
        first, turned = first_resolved(departure, space, steps), False
        now, gone = departure.masses(first * self.duration, self.mesh)
        inside, out, worst = np.ones(cycles + 1), np.zeros((cycles + 1, 3)), np.zeros(3)
        coefficients = np.zeros((cycles + 1, *space.shape))
        coefficients[0], out[0, :2] = self._initial()
        inside[0] -= out[0].sum()
        seen = now
        for k in range(first, cycles * steps + 1):
            if k % steps == 0:
                cycle = k // steps
                inside[cycle], out[cycle] = now.sum(), gone
                coefficients[cycle] = self.mesh.coefficients(seen[::-1] if turned else seen)
                if progress:
                    progress()
            if k == cycles * steps:
                break
            if (k % steps >= half) != turned:
                now, turned = np.ascontiguousarray(now[::-1]), not turned
            step = self.half[k % half]
            excess = step.excess(now) / noise
            if (k + 1) % steps == 0:
                seen, _ = self.view.apply(now)
            now, sinks = step.apply(now)
            gone += sinks[[1, 0, 2]] if turned else sinks
            worst = np.maximum(worst, (excess, now[centre].sum(), np.maximum(-now, 0.0).sum()))
        edges = [np.linspace(line[0], line[-1], count + 1) for line, count in zip(space.lines, BINS, strict=True)]
        bins = space.bin_integrals(coefficients, *edges)
        return Solution(inside, out, coefficients, bins, *worst.tolist())

    def _initial(self):
        """Coefficients of a Gaussian start, for looking at it, and what of it is beyond the cut-off; 0 for a point."""
        start, mesh = self.scene.start, self.mesh
        if start.covariance is None:
            return np.zeros(mesh.space.shape), [0.0, 0.0]
        gaussian = Gaussian.of(start)
        x, v, _ = mesh.points
        masses, tails = gaussian(x, v) * mesh.areas, gaussian.tails(self.dynamics.cutoff)
        return mesh.coefficients(masses * (1.0 - sum(tails)) / masses.sum()), tails
