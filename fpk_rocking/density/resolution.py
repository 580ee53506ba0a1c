"""How fine a solution is: resolutions made for the main scene, from coarse to fine, and their adaptation to others.

What finer ones gain: docs/benchmarks/density_solver_mesh_nodes_and_orders.json.
"""

import dataclasses
import math

import numpy as np

from fpk_rocking.density.pilot import REST
from fpk_rocking.density.space.mesh import extended_lines, graded_lines
from fpk_rocking.density.space.tuning import TUNING
from fpk_rocking.density.start.windows import WindowSettings
from fpk_rocking.density.step.step import Quadrature

_MAIN_DIFFUSION, _MAIN_PERIOD, _MAIN_ANGLE, _MAIN_SPEED = 0.00628, 2.33, 1.57, 1.78
"""Diffusion, period, cut-off and `Motion.velocity` of the main scene, rounded."""

_COARSEST = 0.5
"""Cells an axis over those for the main scene, at least, where stronger noise would allow fewer."""

_RESTS, _RESTING_STEP, _STEP = 0.5, 0.07, 2.33 / 16
"""Time with |f| <= 1 from which on impacts are slow for long; the longest step then, and else, at 16 steps a cycle."""

_BENDING = 10.0
"""Where blocks do not rest an exact block of critical angle α takes 1 + this α² times the steps of a slender one: what
its acceleration has beyond that of a slender one is taken half way through a step, and is of order α²."""

_NOISY_STEP = 0.03
"""Longest step in which noise does not move a block by more than a quarter of its usual speed, times D / speed^2."""

_TAIL_CELLS = 32.0
"""With up to so many cells an axis for the motion, the cells beyond it grow by `tail` each; with more, by less."""

FEWEST = 6
"""Steps in a period of the forcing's highest harmonic, in which it is a polynomial to 1e-13."""

REST_GRADING = 2.0
"""Exponent of the lines of the angle where a block comes to rest: x goes with v^2 there."""

_BYTES = 2.0
"""Bytes that a run holds, about, for each unknown of a density and each path of a step."""

_FAR = 0.6
"""A motion that usually goes this part of the way to the cut-off has a mesh that is not made for less."""


@dataclasses.dataclass(frozen=True)
class Grid:
    """What a solution of one scene is made with: a `Resolution` that has been adapted to it.

    Parameters
    ----------
    angle_lines, velocity_lines : ndarray
        Mesh lines, nondimensional, symmetric about 0.
    degree : int
        Polynomial degree.
    quadrature : Quadrature
        Sampling of a step.
    steps : int
        Steps a cycle, even.
    windows : WindowSettings
        What the start is carried on until the mesh resolves it.
    """

    angle_lines: np.ndarray
    velocity_lines: np.ndarray
    degree: int
    quadrature: Quadrature
    steps: int
    windows: WindowSettings

    @property
    def cells(self):
        """Cells of the mesh, in angle and velocity."""
        return len(self.angle_lines) - 1, len(self.velocity_lines) - 1

    def stored(self, cycles):
        """Bytes of the densities after all cycles."""
        return 8 * (cycles + 1) * math.prod(self.cells) * (self.degree + 1) ** 2

    @property
    def memory(self):
        """Bytes that a run takes, about, densities after all cycles left out."""
        points = self.quadrature.angle * self.quadrature.velocity * self.quadrature.long * self.quadrature.short
        return _BYTES * math.prod(self.cells) * ((self.degree + 1) ** 2 * 20 + points * self.steps)

    @property
    def settings(self):
        """Mesh, degree, quadrature and steps as plain values."""
        angle_cells, velocity_cells = self.cells
        plain = {"angle_cells": angle_cells, "velocity_cells": velocity_cells, "degree": self.degree}
        plain |= {"quadrature": dataclasses.asdict(self.quadrature), "steps": self.steps}
        return plain | {"windows": dataclasses.asdict(self.windows)}


@dataclasses.dataclass(frozen=True)
class Resolution:
    """Fineness of a solution, for the diffusion, the motion and the cycle of the main scene.

    Parameters
    ----------
    angle_cells, velocity_cells, degree : int
        Mesh and polynomial degree.
    quadrature : Quadrature
        Sampling of a step.
    steps : int
        Steps a cycle, even.
    windows : WindowSettings
        What the start is carried on until the mesh resolves it.
    """

    angle_cells: int
    velocity_cells: int
    degree: int
    quadrature: Quadrature
    steps: int
    windows: WindowSettings

    def of(self, scene, bound, motion, beyond=0.0, growth=TUNING.tail):
        """Adapt the resolution to a scene.

        Parameters
        ----------
        scene : Scene
            With white noise.
        bound : float
            Velocity bound of the mesh.
        motion : Motion
            Where the mesh has to be fine.
        beyond : float
            Velocity to which cells that grow continue the mesh, where it is above the bound.
        growth : float
            Of the cells from the motion to the bounds.

        Returns
        -------
        Grid
        """
        cutoff, far, fast = scene.overturning.angle, max(motion.angle, REST[0]), max(motion.velocity, REST[1])
        small, fast = far < _FAR * cutoff, min(fast, bound)
        far, grading = (far, REST_GRADING) if small else (cutoff, TUNING.angle_grading)
        period = cycle_of(scene)
        time = min(period, _MAIN_PERIOD) / _MAIN_PERIOD
        noise = scene.noise.diffusion / _MAIN_DIFFUSION
        spreads = noise * time**3 * (_MAIN_ANGLE / far) ** 2, noise * time * (_MAIN_SPEED / fast) ** 2
        angle_cells, velocity_cells = (
            _even(cells * max(spread**-0.25, _COARSEST))
            for cells, spread in zip((self.angle_cells, self.velocity_cells), spreads, strict=True)
        )
        angle = graded_lines(far, angle_cells, grading)
        velocity = graded_lines(fast, velocity_cells, TUNING.velocity_grading)
        rests = scene.forcing.in_units_of(scene.block.lift_off).longest_rest > _RESTS
        # A slow motion meets impacts more often.
        moving = _STEP * math.sqrt(min(fast, 1.0)) / (1.0 + _BENDING * scene.block.critical_angle**2)
        step = min(_RESTING_STEP if rests else moving, _NOISY_STEP * fast**2 / scene.noise.diffusion)
        steps = self.steps / 16 * period / step
        fewest = FEWEST * period / scene.forcing.shortest_period
        growths = [1.0 + (growth - 1.0) * min(_TAIL_CELLS / cells, 1.0) for cells in (angle_cells, velocity_cells)]
        return Grid(
            extended_lines(angle, cutoff, growths[0]),
            extended_lines(extended_lines(velocity, bound, growths[1]), beyond),
            self.degree,
            self.quadrature,
            _even(max(steps, 0.5 * self.steps, fewest)),
            self.windows,
        )


def cycle_of(scene):
    """Return the time in which a grid's steps are counted: a cycle, or that of the main scene where there is none."""
    return scene.period or _MAIN_PERIOD


def _even(number):
    """Even whole number, at least 4, that is not below a number."""
    return 2 * max(2, math.ceil(0.5 * number - 1e-9))


_ROUGH, _GOOD = WindowSettings(10, 5.0, 0.7, 0.01, 4), WindowSettings(14, 6.0, 0.4, 0.01, 4)
_BETTER = WindowSettings(16, 6.5, 0.35, 0.008, 4)
_FINE, _FINEST = WindowSettings(20, 8.0, 0.2, 0.005, 5), WindowSettings(28, 8.0, 0.1, 0.002, 5)

RESOLUTIONS = (
    Resolution(16, 16, 3, Quadrature(5, 5, 5, 2, 9), 6, _ROUGH),
    Resolution(22, 22, 3, Quadrature(5, 5, 5, 2, 9), 8, _ROUGH),
    Resolution(32, 32, 3, Quadrature(5, 5, 5, 2, 9), 12, _GOOD),
    Resolution(44, 44, 3, Quadrature(6, 6, 5, 2, 9), 16, _BETTER),
    Resolution(60, 56, 4, Quadrature(10, 10, 7, 2), 20, _FINE),
    Resolution(84, 78, 4, Quadrature(12, 12, 7, 2), 28, _FINEST),
    Resolution(116, 108, 4, Quadrature(12, 12, 9, 3), 40, _FINEST),
)
"""Each about 1.4 times as fine as the one before, most with windows of their own: neighbours tell the error."""

USUAL = {1e-2: 2, 1e-3: 3, 1e-4: 4}
"""Number of the resolution that is usually fine enough, by tolerance; never one of the first two."""
