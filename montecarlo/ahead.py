"""Least runs that need the kernels of each engine; see `fpk_rocking.base.ahead`."""

import dataclasses

from fpk_rocking.physics.noise.envelope import Trapezoid
from fpk_rocking.scene import BandNoise, Block, FilteredNoise, Harmonic, NoNoise, Scene, WhiteNoise
from montecarlo.simulation import simulate

_QUIET = Scene(Block(0.5), Harmonic(4.6, 2.7, 0.0), NoNoise())


def exact() -> None:
    """Event-driven paths."""
    _simulate(BandNoise(0.04, (0.0, 10.0), 4), "exact")


def enveloped() -> None:
    """Event-driven paths under noise with an envelope."""
    _simulate(BandNoise(0.04, (0.0, 10.0), 4, envelope=Trapezoid(1.0, 1.0, 1.0)), "exact")


def nonlinear() -> None:
    """Event-driven paths of an exact block."""
    _simulate(BandNoise(0.04, (0.0, 10.0), 4), "exact", Block(0.9, critical_angle=0.3))


def rk4() -> None:
    """Runge-Kutta paths."""
    _simulate(BandNoise(0.04, (0.0, 10.0), 4), "rk4")


def white() -> None:
    """Paths under white noise."""
    _simulate(WhiteNoise(0.01), "white")


def filtered() -> None:
    """Paths under filtered noise."""
    _simulate(FilteredNoise("low-pass", 0.04, 9.0, 0.7), "filtered")


def _simulate(noise, method, block=_QUIET.block):
    simulate(dataclasses.replace(_QUIET, noise=noise, block=block), cycles=1, realizations=1, seed=1, method=method)
