"""Equal intervals of time, and the times at which states are wanted."""

import numpy as np
import pytest

from fpk_rocking import Block, Harmonic, NoNoise, Pulse, Scene
from montecarlo.engines.engine import time_grid

SWUNG = Scene(Block(0.9), Harmonic(2.6, 3.0, 0.0), NoNoise())
PULSED = Scene(Block(0.9), Pulse("one-cosine", 2.6, 3.0), NoNoise())


def test_more_intervals_than_there_may_be_are_refused_by_what_makes_them():
    for scene, name in ((SWUNG, "scene"), (PULSED, "times")):
        with pytest.raises(ValueError, match=rf"^{name}: got 'a duration of .*', accepted: at most 4194304 intervals"):
            time_grid(scene, 1e-7, np.array([scene.forcing.duration if name == "times" else scene.period]))


def test_times_wanted_are_marked_in_intervals():
    grid = time_grid(PULSED, 0.1, np.array([0.55, 0.7, 2.0]))
    assert grid.spacing <= 0.1
    assert grid.duration >= 2.0 > grid.duration - grid.spacing
    assert grid.output_times * grid.spacing == pytest.approx([0.55, 0.7, 2.0], rel=1e-12)
