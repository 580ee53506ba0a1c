"""Least runs that need the kernels of each engine; see `fpk_rocking.base.precompilation`."""

import dataclasses
import functools

from fpk_rocking.physics.noise.envelope import Trapezoid
from fpk_rocking.scene import BandNoise, Block, FilteredNoise, Harmonic, NoNoise, Scene, WhiteNoise
from montecarlo.simulation import simulate

_QUIET = Scene(Block(0.5), Harmonic(4.6, 2.7, 0.0), NoNoise())
_EXACT = Block(0.9, critical_angle=0.3)


def exact() -> None:
    """Compile event-driven paths."""
    _simulate(BandNoise(0.04, (0.0, 10.0), 4), "exact")


def enveloped() -> None:
    """Compile event-driven paths under noise with an envelope."""
    _simulate(BandNoise(0.04, (0.0, 10.0), 4, envelope=Trapezoid(1.0, 1.0, 1.0)), "exact")


def nonlinear_exact() -> None:
    """Compile event-driven paths of an exact block."""
    _simulate(BandNoise(0.04, (0.0, 10.0), 4), "exact", _EXACT)


def rk4(block: Block = _QUIET.block) -> None:
    """Compile Runge-Kutta paths of a block."""
    _simulate(BandNoise(0.04, (0.0, 10.0), 4), "rk4", block)


def white(block: Block = _QUIET.block) -> None:
    """Compile paths of a block under white noise."""
    _simulate(WhiteNoise(0.01), "white", block)


def filtered(block: Block = _QUIET.block) -> None:
    """Compile paths of a block under filtered noise."""
    _simulate(FilteredNoise("low-pass", 0.04, 9.0, 0.7), "filtered", block)


rk4_exact = functools.partial(rk4, _EXACT)
white_exact = functools.partial(white, _EXACT)
filtered_exact = functools.partial(filtered, _EXACT)


def _simulate(noise, method, block=_QUIET.block):
    """Simulate one realization over one cycle of the quiet scene with a noise and a block, by a method (its name)."""
    simulate(dataclasses.replace(_QUIET, noise=noise, block=block), cycles=1, realizations=1, seed=1, method=method)
