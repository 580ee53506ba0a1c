"""How many steps a scene gets: enough for the highest harmonic of its forcing, at every resolution."""

import math

import numpy as np
import pytest

from fpk_rocking import Block, Scene, WhiteNoise
from fpk_rocking.density.resolution import RESOLUTIONS, StateRange
from fpk_rocking.physics.forcing import Harmonics


@pytest.mark.parametrize("highest", [1, 3, 32])
def test_the_forcing_is_a_polynomial_in_every_step(highest):
    """To 1e-11 of its size, for a cycle with one harmonic of any number; the highest one sets the shortest step."""
    amplitudes = np.zeros(highest)
    amplitudes[-1] = 3.0
    forcing = Harmonics(1.5, tuple(amplitudes), (0.4,) * highest)
    scene = Scene(Block(0.5), forcing, WhiteNoise(0.02))
    for resolution in RESOLUTIONS:
        steps = resolution.adapted(scene, 4.0, StateRange(1.2, 1.8, (-1.2, 1.2), (-1.8, 1.8), 2.0)).steps
        assert steps % 2 == 0
        duration = scene.period / steps
        size = 3.0 / (1.0 + (1.5 * highest) ** 2)
        for begin in (0.0, 0.3 * scene.period):
            rows = np.asarray(forcing.particular_over(begin, duration))
            for part in (0.25, 0.6, 1.0):
                value = np.polynomial.polynomial.polyval(part * duration, rows)
                assert value == pytest.approx(forcing.particular(begin + part * duration)[0], abs=1e-11 * size)
    assert math.isclose(forcing.shortest_period, scene.period / highest)
