"""Least runs that need the kernels of each engine; see `fpk_rocking.base.ahead`."""

from fpk_rocking.physics.envelope import Trapezoid
from fpk_rocking.scene import Block, Harmonic, Overturning, Scene, Start, WhiteNoise
from fpk_rocking.scene.parts import BandNoise, FilteredNoise
from montecarlo.simulation import simulate

_MOTION = {"block": Block(0.5), "forcing": Harmonic(4.6, 2.7, 0.0), "start": Start(), "overturning": Overturning()}


def exact():
    """Event-driven paths."""
    _simulate(BandNoise(0.04, (0.0, 10.0), 4), "exact")


def enveloped():
    """Event-driven paths under noise with an envelope."""
    _simulate(BandNoise(0.04, (0.0, 10.0), 4, envelope=Trapezoid(1.0, 1.0, 1.0)), "exact")


def rk4():
    """Runge-Kutta paths."""
    _simulate(BandNoise(0.04, (0.0, 10.0), 4), "rk4")


def white():
    """Paths under white noise."""
    _simulate(WhiteNoise(0.01), "white")


def filtered():
    """Paths under filtered noise."""
    _simulate(FilteredNoise("low-pass", 0.04, 9.0, 0.7), "filtered")


def _simulate(noise, method):
    simulate(Scene(noise=noise, **_MOTION), cycles=1, realizations=1, seed=1, method=method)
