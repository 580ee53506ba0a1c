"""How many paths check a density for which nobody asked for a number of them."""

import numpy as np

from fpk_rocking import BandNoise, Block, Dimensions, Harmonic, NoNoise, Record, Scene
from fpk_rocking.base import ahead
from fpk_rocking.studies import checking

CYCLIC = Scene(Block(0.5), Harmonic(1.0, 2.0), BandNoise(0.04, (0.0, 9.0), 10))


def test_there_are_fewer_paths_in_a_record():
    shaken = Scene(Block(None, Dimensions(0.5, 1.8)), Record(0.04, np.sin(np.arange(50)), "g", 0.4), NoNoise())
    assert checking._asked(CYCLIC, None, 3) == (40_000, 3)
    assert checking._asked(shaken, None, 3) == (10_000, 3)
    assert checking._asked(shaken, 7, 0) == (7, 0)


def test_paths_are_expected_where_noise_is_replaced(monkeypatch):
    expected = []
    monkeypatch.setattr(ahead, "expect", expected.append)
    checking.expect(CYCLIC.white_equivalent())
    assert expected == []
    checking.expect(CYCLIC)
    assert len(expected) == 1
