"""The velocities that a mesh has to hold: each part of the bound by itself."""

import math

import pytest

from fpk_rocking.density.space.mesh import velocity_bound
from fpk_rocking.scene import Block, Harmonic, Overturning, Scene, Start, WhiteNoise


def bound(start, cutoff=1.5, diffusion=0.01, amplitude=0.0, phase=0.0):
    scene = Scene(Block(0.5), Harmonic(amplitude, 2.0, phase), WhiteNoise(0.02), start, Overturning(cutoff))
    return velocity_bound(scene, diffusion)


def test_the_velocity_bound_has_room_for_escapes_and_noise():
    assert bound(Start()) == pytest.approx(1.0 + 8.0 * 0.1)
    assert bound(Start(), cutoff=3.5) == pytest.approx(2.5 + 0.8)
    swing = bound(Start(), amplitude=3.0) - bound(Start())
    assert 3.0 / math.sqrt(5.0) <= swing <= 3.0 * 2.0 / math.sqrt(5.0)
    assert bound(Start(1.0, 20.0)) == pytest.approx(1.2 * 20.0)
    assert bound(Start(1.0, 1.0, ((1e-4, 0.0), (0.0, 9.0)))) >= 1.2 * (1.0 + 8.0 * 3.0)


def test_the_velocity_bound_has_room_for_what_a_start_that_falls_has_in_excess():
    """It falls by x - v beyond the saddle's 1 + P - P', of which eight standard deviations are counted."""
    assert bound(Start(1.4, -3.0)) == bound(Start(-1.4, 3.0)) == pytest.approx(1.8 + 3.4)
    assert bound(Start(1.4, 0.3)) == bound(Start(1.4)) == bound(Start())
    for phase in (0.4, 2.0):
        swing = bound(Start(), amplitude=3.0, phase=phase) - bound(Start())
        saddle = 3.0 * (math.cos(phase) + 2.0 * math.sin(phase)) / 5.0
        assert bound(Start(1.4, -3.0), amplitude=3.0, phase=phase) == pytest.approx(1.8 + swing + 3.4 - saddle)
        assert bound(Start(-1.4, 3.0), amplitude=3.0, phase=phase) == pytest.approx(1.8 + swing + 3.4 + saddle)
    covariance = 0.01, -0.004, 0.02
    one, other = (
        bound(Start(1.4, -3.0, ((xx, xv), (xv, vv)))) for xx, xv, vv in (covariance, [4.0 * c for c in covariance])
    )
    assert one == pytest.approx(1.8 + 3.4 + 8.0 * math.sqrt(0.038))
    assert other == pytest.approx(1.8 + 3.4 + 16.0 * math.sqrt(0.038))
