"""How fine a solution is: a ladder of resolutions for the main scene, and its adaptation to other scenes."""

import dataclasses
import math

from fpk_rocking.density.step import Quadrature
from fpk_rocking.density.window import Windows


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
    windows : Windows
        What the start is carried on until the mesh resolves it.
    """

    angle_cells: int
    velocity_cells: int
    degree: int
    quadrature: Quadrature
    steps: int
    windows: Windows

    def of(self, scene, bound):
        """Return the resolution for a scene: cells in proportion to the extents and to D^(-1/4), steps to the cycle."""
        finer = max((0.00628 / scene.noise.diffusion) ** 0.25, 0.5)
        angle = self.angle_cells * finer * scene.overturning.angle / (math.pi / 2)
        velocity = self.velocity_cells * finer * bound / 3.24
        steps = max(self.steps * scene.period / 2.33, 0.5 * self.steps)
        angle, velocity, steps = (2 * math.ceil(0.5 * value - 1e-9) for value in (angle, velocity, steps))
        return dataclasses.replace(self, angle_cells=angle, velocity_cells=velocity, steps=steps)

    @property
    def work(self):
        """Size of a step's sampling and of the density, in proportion to the memory of a run."""
        points = self.quadrature.angle * self.quadrature.velocity * self.quadrature.long * self.quadrature.short
        return self.angle_cells * self.velocity_cells * ((self.degree + 1) ** 2 * 20 + points * self.steps)


_ROUGH, _GOOD = Windows(12, 5.0, 0.5, 0.1), Windows(14, 6.0, 0.4, 0.05)
_FINE, _FINEST = Windows(20, 8.0, 0.2, 0.02), Windows(28, 8.0, 0.1, 0.02)

LADDER = (
    Resolution(22, 40, 3, Quadrature(5, 5, 5, 2), 10, _ROUGH),
    Resolution(32, 56, 3, Quadrature(5, 5, 5, 2), 12, _ROUGH),
    Resolution(44, 80, 3, Quadrature(6, 6, 5, 2), 16, _GOOD),
    Resolution(60, 100, 4, Quadrature(10, 10, 7, 2), 20, _FINE),
    Resolution(84, 140, 4, Quadrature(12, 12, 7, 2), 28, _FINEST),
    Resolution(116, 196, 4, Quadrature(12, 12, 9, 3), 40, _FINEST),
)
"""Each about 1.4 times as fine as the one before: the difference of two neighbours is the error estimate."""

FIRST = {1e-2: 1, 1e-3: 2, 1e-4: 3}
"""The rung on which to begin, by tolerance."""
