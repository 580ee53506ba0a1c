"""Least runs that need the kernels of the density solver; see `fpk_rocking.base.precompilation`."""

import numpy as np

from fpk_rocking.density.filtered import advance_from_rest
from fpk_rocking.density.resolution import RESOLUTIONS, USUAL
from fpk_rocking.density.solver import solve_fpk
from fpk_rocking.density.space.mesh import graded_lines
from fpk_rocking.density.space.space import Space
from fpk_rocking.density.step.dynamics import Dynamics
from fpk_rocking.density.step.free_flight import FreeFlight
from fpk_rocking.scene import Block, Harmonic, Overturning, Scene, Start, WhiteNoise

SCENE = Scene(
    block=Block(0.5),
    forcing=Harmonic(4.6, 2.7, 0.0),
    noise=WhiteNoise(0.05),
    start=Start(),
    overturning=Overturning(),
)
_EXACT = SCENE.varied(block=Block(0.5, critical_angle=0.3))
_USUAL = 1e-3


def flight():
    """Compile the kernels of free flight, which a solution needs last."""
    degree = RESOLUTIONS[USUAL[_USUAL]].degree
    space = Space(graded_lines(1.5, 4, 1.0), graded_lines(2.0, 4, 1.0), degree)
    free = np.ones(space.shape[:2], dtype=bool)
    FreeFlight(space, free, Dynamics.of(SCENE).affine(0.0, 0.1), 0.05, 0.1, 5).apply(
        np.ones(space.shape), np.zeros(space.shape)
    )


def solve():
    """Compile all kernels of a solution under white noise, by solving one cycle coarsely."""
    solve_fpk(SCENE, cycles=1, tol=_USUAL)


def solve_exact():
    """Compile all kernels of a solution under white noise for an exact block, by solving one cycle coarsely."""
    solve_fpk(_EXACT, cycles=1, tol=_USUAL)


def filtered():
    """Compile the kernels that filtered noise needs beside those of `solve`."""
    _carry_from_rest(SCENE)


def filtered_exact():
    """Compile the kernels that filtered noise needs beside those of `solve_exact`."""
    _carry_from_rest(_EXACT)


def _carry_from_rest(scene):
    """Compile the kernel that carries a block at rest through a step, for a scene with white noise."""
    dynamics = Dynamics.of(scene)
    advance_from_rest(dynamics.segment(0.0, 0.1), 0.1, dynamics.block)
