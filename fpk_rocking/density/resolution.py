"""How fine a solution is: resolutions made for the main scene, from coarse to fine, and their adaptation to others.

Where the constants below were measured: docs/numerics.md, "Calibrated constants".
"""

import dataclasses
import math

from fpk_rocking.density.space.mesh import ANGLE_GRADING, VELOCITY_GRADING
from fpk_rocking.density.start.windows import WindowSettings
from fpk_rocking.density.step.step import Quadrature

_MAIN_DIFFUSION = 0.00628
"""Diffusion of the main scene, rounded."""

_MAIN_BOUND = 3.24
"""Velocity bound of the main scene, rounded up."""

_MAIN_STEP = 2.33 / 16
"""Step of the main scene at 16 steps a cycle; its period of 2.327 is rounded up."""

_COARSEST = 0.7
"""Cells an axis over those for the main scene, at least, where stronger noise would allow fewer."""

_RESTS, _RESTING_STEP = 0.5, 0.036
"""Time with |f| <= 1 from which on impacts are slow for long, and the longest step then."""

_RATTLING_STEP = 0.15
"""Longest step over `rattling_speed`."""

_LAYER_VELOCITY, _LAYER_ANGLE = 0.04, 0.08
"""Smallest cell over `rattling_speed` in velocity, and over its square in angle."""

FEWEST = 6
"""Steps in a period of the forcing's highest harmonic, in which it is a polynomial to 1e-13."""

THINNEST = 0.04
"""Least speed of rattling at rest that a mesh is made for."""


@dataclasses.dataclass(frozen=True)
class Resolution:
    """Fineness of a solution, for the diffusion, the strip and the cycle of the main scene; `of` adapts it to others.

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
    angle_grading, velocity_grading : float
        Exponents of the mesh lines, see `graded_lines`.
    """

    angle_cells: int
    velocity_cells: int
    degree: int
    quadrature: Quadrature
    steps: int
    windows: WindowSettings
    angle_grading: float = ANGLE_GRADING
    velocity_grading: float = VELOCITY_GRADING

    def of(self, scene, bound):
        """Return the resolution for a scene: cells by the extents and D^(-1/4), steps by `longest_step`.

        Where the block is never lifted off the mesh is also graded down to the layer in which it rattles.
        """
        cutoff, layer = scene.overturning.angle, rattling_speed(scene)
        finer = max((_MAIN_DIFFUSION / scene.noise.diffusion) ** 0.25, _COARSEST)
        angle = 2 * max(2, math.ceil(0.5 * self.angle_cells * finer * cutoff / (math.pi / 2) - 1e-9))
        velocity = 2 * max(2, math.ceil(0.5 * self.velocity_cells * finer * bound / _MAIN_BOUND - 1e-9))
        steps = self.steps / 16 * scene.period / longest_step(scene)
        fewest = FEWEST * scene.period / scene.forcing.shortest_period
        return dataclasses.replace(
            self,
            angle_cells=angle,
            velocity_cells=velocity,
            steps=2 * math.ceil(0.5 * max(steps, 0.5 * self.steps, fewest) - 1e-9),
            angle_grading=_grading(cutoff, angle, _LAYER_ANGLE * layer * layer, ANGLE_GRADING),
            velocity_grading=_grading(bound, velocity, _LAYER_VELOCITY * layer, VELOCITY_GRADING),
        )

    def stored(self, cycles):
        """Bytes of the densities after all cycles."""
        return 8 * (cycles + 1) * self.angle_cells * self.velocity_cells * (self.degree + 1) ** 2

    @property
    def work(self):
        """Size of a step's sampling and of the density, in proportion to the memory of a run."""
        points = self.quadrature.angle * self.quadrature.velocity * self.quadrature.long * self.quadrature.short
        return self.angle_cells * self.velocity_cells * ((self.degree + 1) ** 2 * 20 + points * self.steps)


def rattling_speed(scene):
    """Speed 2 D / (1 - e) at which a block rattles that the forcing never lifts off, at the time when f = 0.

    The mean square over the mean of the speeds at impact; at other times it is 2 D / ((1 - e) (1 - f^2)), which is
    larger (derived in docs/theory, "Rattling at rest"). Its scale in angle is v^2 / 2. Infinite where the block is
    lifted off, where nothing slows it (e = 1), and where the layer is too thin to be resolved.
    """
    restitution = scene.block.restitution
    if scene.forcing.largest > 1.0 or restitution == 1.0:
        return math.inf
    speed = 2.0 * scene.noise.diffusion / (1.0 - restitution)
    return speed if speed > THINNEST else math.inf


def longest_step(scene):
    """Longest time step for a scene, at 16 steps a cycle of the main scene.

    Slow impacts must be few in a step where the forcing leaves the block at rest for long, and the layer in which it
    rattles must not be left.
    """
    rests = scene.forcing.longest_rest > _RESTS
    return min(_MAIN_STEP, _RESTING_STEP if rests else math.inf, _RATTLING_STEP * rattling_speed(scene))


def _grading(half_width, cells, smallest, usual):
    """Exponent that makes the smallest cell no larger than asked for."""
    return max(usual, math.log(half_width / smallest) / math.log(cells // 2)) if smallest < half_width else usual


_ROUGH, _GOOD = WindowSettings(10, 5.0, 0.7, 0.01, 4), WindowSettings(14, 6.0, 0.4, 0.01, 4)
_BETTER = WindowSettings(16, 6.5, 0.35, 0.008, 4)
_FINE, _FINEST = WindowSettings(20, 8.0, 0.2, 0.005, 5), WindowSettings(28, 8.0, 0.1, 0.002, 5)

RESOLUTIONS = (
    Resolution(16, 28, 3, Quadrature(5, 5, 5, 2, 9), 6, _ROUGH),
    Resolution(22, 40, 3, Quadrature(5, 5, 5, 2, 9), 8, _ROUGH),
    Resolution(32, 56, 3, Quadrature(5, 5, 5, 2, 9), 12, _GOOD),
    Resolution(44, 80, 3, Quadrature(6, 6, 5, 2, 9), 16, _BETTER),
    Resolution(60, 100, 4, Quadrature(10, 10, 7, 2), 20, _FINE),
    Resolution(84, 140, 4, Quadrature(12, 12, 7, 2), 28, _FINEST),
    Resolution(116, 196, 4, Quadrature(12, 12, 9, 3), 40, _FINEST),
)
"""Each about 1.4 times as fine as the one before, most with windows of their own: neighbours tell the error."""

USUAL = {1e-2: 2, 1e-3: 3, 1e-4: 4}
"""Number of the resolution that is usually fine enough, by tolerance; never one of the first two."""
