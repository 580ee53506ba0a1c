"""Least runs that need the kernels of each engine and solver: the tasks of `fpk_rocking.base.precompilation`.

A task imports what it runs itself, so that the process of a task loads no other engine.
"""

import dataclasses
import functools

from fpk_rocking.physics.noise.envelope import Trapezoid
from fpk_rocking.scene import BandNoise, Block, Body, FilteredNoise, Harmonic, Scene, WhiteNoise

_BAND = Scene(Block(0.5), Harmonic(4.6, 2.7, 0.0), BandNoise(0.04, (0.0, 10.0), 4))
_WHITE = _BAND.varied(noise=WhiteNoise(0.05))
_EXACT = Block(0.5, critical_angle=0.3)
_BODY = Block((0.5, 0.6), body=Body(1.0, 0.3, 0.32, 0.6))
_USUAL = 1e-3


def free_flight() -> None:
    """Compile the kernels of free flight, which a density needs last."""
    import numpy as np

    from fpk_rocking.density.resolution import RESOLUTIONS, USUAL
    from fpk_rocking.density.space import Space, graded_lines
    from fpk_rocking.density.step.dynamics import Dynamics
    from fpk_rocking.density.step.free_flight import FreeFlight

    degree = RESOLUTIONS[USUAL[_USUAL]].degree
    space = Space(graded_lines(1.5, 4, 1.0), graded_lines(2.0, 4, 1.0), degree)
    free = np.ones(space.shape[:2], dtype=bool)
    FreeFlight(space, free, Dynamics.of(_WHITE).affine(0.0, 0.1), 0.05, 0.1, 5).apply(
        np.ones(space.shape), np.zeros(space.shape)
    )


def density(scene: Scene = _WHITE) -> None:
    """Compile all kernels of a density under white noise, by solving one cycle coarsely."""
    from fpk_rocking.density.solver import solve_fpk

    solve_fpk(scene, cycles=1, tol=_USUAL)


def rest(scene: Scene = _WHITE) -> None:
    """Compile the kernel that a density under filtered noise needs beside those of `density`."""
    from fpk_rocking.density.filtered import advance_from_rest
    from fpk_rocking.density.step.dynamics import Dynamics

    dynamics = Dynamics.of(scene)
    advance_from_rest(dynamics.segment(0.0, 0.1), 0.1, dynamics.block)


def operator() -> None:
    """Compile all kernels of the one-cycle operator, by the leading mode of a scene that is easy to resolve."""
    from fpk_rocking.horizon.operator import CycleOperator

    CycleOperator(_WHITE, tol=1e-2).survival(1)


def paths(method: str, scene: Scene = _BAND) -> None:
    """Compile the kernels of an engine, `method`, by one realization over one cycle of a scene."""
    from montecarlo.simulation import simulate

    simulate(scene, cycles=1, realizations=1, seed=1, method=method)


_FILTERED = _BAND.varied(noise=FilteredNoise("low-pass", 0.04, 9.0, 0.7))
_ENVELOPED = _BAND.varied(noise=dataclasses.replace(_BAND.noise, envelope=Trapezoid(1.0, 1.0, 1.0)))

density_exact = functools.partial(density, _WHITE.varied(block=_EXACT))
rest_exact = functools.partial(rest, _WHITE.varied(block=_EXACT))
exact = functools.partial(paths, "exact")
enveloped = functools.partial(paths, "exact", _ENVELOPED)
nonlinear_exact = functools.partial(paths, "exact", _BAND.varied(block=_EXACT))
rk4 = functools.partial(paths, "rk4")
rk4_exact = functools.partial(paths, "rk4", _BAND.varied(block=_EXACT))
white = functools.partial(paths, "white", _WHITE)
white_exact = functools.partial(paths, "white", _WHITE.varied(block=_EXACT))
filtered = functools.partial(paths, "filtered", _FILTERED)
filtered_exact = functools.partial(paths, "filtered", _FILTERED.varied(block=_EXACT))

density_body = functools.partial(density, _WHITE.varied(block=_BODY))
nonlinear_body = functools.partial(paths, "exact", _BAND.varied(block=_BODY))
rk4_body = functools.partial(paths, "rk4", _BAND.varied(block=_BODY))
white_body = functools.partial(paths, "white", _WHITE.varied(block=_BODY))
filtered_body = functools.partial(paths, "filtered", _FILTERED.varied(block=_BODY))
