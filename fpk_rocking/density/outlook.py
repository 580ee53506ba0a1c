"""How long a density will take, told before the work begins."""

import math
import sys
from collections.abc import Sequence

import numpy as np

from fpk_rocking.base.types import Array
from fpk_rocking.density.resolution import Grid, cycle_of
from fpk_rocking.density.space.space import Space
from fpk_rocking.density.step.step import Characteristics, Dynamics
from fpk_rocking.scene.scene import Scene

LONG = 20.0
"""Seconds from which on a call says how long it will take."""

_SAMPLES = 8
"""Steps by which the cells that events can reach are counted."""

_TRACED, _TRACED_EXACT, _DEPOSITED, _PREPARED, _FLOWN = 8e-8, 1.6e-7, 4e-9, 4e-7, 2e-8
"""Seconds for a path of a slender block, of an exact one, and for its mass; for an unknown in a step to be set up, and
in one to be taken: on one core of 2024, and for the part of the mesh that usually holds something."""


def seconds_of(scene: Scene, grid: Grid, times: Array) -> float:
    """Return the seconds that a solution takes, to about a factor of two.

    Parameters
    ----------
    scene : Scene
        With white noise.
    grid : Grid
    times : ndarray, shape (n + 1,)
        That it is wanted for.

    Returns
    -------
    float
    """
    space = Space(grid.angle_lines, grid.velocity_lines, grid.degree)
    dynamics, rule, duration = Dynamics.of(scene), grid.quadrature, cycle_of(scene) / grid.steps
    begins = np.linspace(0.0, scene.period or times[-1], _SAMPLES, endpoint=False)
    traces = [Characteristics(space, begin, duration, dynamics, rule, cells=False) for begin in begins.tolist()]
    paths = np.mean([trace.event_cells.sum() for trace in traces]) * rule.angle * rule.velocity * rule.long * rule.short
    steps = times[-1] / duration
    different = grid.steps / (2.0 if scene.forcing.half_antisymmetric else 1.0) if scene.repeats else steps
    set_up = paths * (_TRACED_EXACT if scene.block.critical_angle else _TRACED) + space.unknowns * _PREPARED
    return float(different * set_up + steps * (paths * _DEPOSITED + space.unknowns * _FLOWN))


def tell(scene: Scene, grids: Sequence[Grid], times: Array, tol: float) -> None:
    """Say on standard error how long the solutions on some grids will take, and what sampling would, if it is long."""
    if scene.noise.kind != "white":
        return
    seconds = sum(seconds_of(scene, grid, times) for grid in grids)
    if seconds >= LONG:
        rounded, paths = float(f"{seconds:.1g}"), 10 ** math.ceil(math.log10(0.25 / tol**2) - 1e-9)
        sys.stderr.write(
            f"density: about {rounded:,.0f} s of one processor, more where the tolerance asks for a finer solution; "
            f"{paths:,} sampled paths give a standard error of {0.5 / math.sqrt(paths):.1g}\n"
        )


def tell_finer(scene: Scene, before: Grid, grid: Grid, times: Array, taken: float) -> None:
    """Say how long a finer solution will take if it is long, by the seconds `taken` by the one before."""
    if scene.noise.kind != "white":
        return
    seconds = taken * seconds_of(scene, grid, times) / seconds_of(scene, before, times)
    if seconds >= LONG:
        sys.stderr.write(f"density: the tolerance asks for a finer solution, about {float(f'{seconds:.1g}'):,.0f} s\n")
