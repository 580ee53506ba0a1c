"""How many realizations a batch has: as many as take a given time."""

import itertools

import numpy as np
import pytest

from fpk_rocking.scene import BandNoise, Block, Harmonic, Scene
from montecarlo.engines import batches


@pytest.mark.parametrize(
    ("seconds", "firsts"), [(0.6, [0, 4096, 6144, 7168, 7680, 7936]), (0.1, [0, 4096]), (1e-3, [0, 4096])]
)
def test_batches_take_the_time_they_should(monkeypatch, seconds, firsts):
    """By a clock on which a batch takes as long as it is said to: of 4096 at first, and .3 s are wanted."""
    monkeypatch.setattr(batches.time, "perf_counter", itertools.count(100.0, seconds).__next__)
    scene = Scene(Block(0.5), Harmonic(0.3, 2.7), BandNoise(1e-4, (0.0, 9.0), 1))
    run = batches.checked_run(scene, 1, 8000, 1, "exact", 200)
    parts = list(batches.simulate_batches(run))
    assert [batch.first for batch in parts] == firsts
    assert sum(len(batch.angle) for batch in parts) == 8000
    assert not np.concatenate([batch.angle for batch in parts]).any()


def test_a_batch_is_at_most_four_times_the_last_one(monkeypatch):
    monkeypatch.setattr(batches.time, "perf_counter", itertools.count(100.0, 1e-3).__next__)
    monkeypatch.setattr(batches, "TUNING", batches.TUNING._replace(first_batch=64))
    scene = Scene(Block(0.5), Harmonic(0.3, 2.7), BandNoise(1e-4, (0.0, 9.0), 1))
    parts = batches.simulate_batches(batches.checked_run(scene, 1, 3000, 1, "exact", 200))
    assert [batch.first for batch in parts] == [0, 64, 320, 1344]
