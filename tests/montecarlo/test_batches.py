"""How many realizations a batch has: as many as take a given time; and paths at many scales of the forcing."""

import numpy as np
import pytest
from transient_paths import random_scene

from fpk_rocking import Dimensions, NoNoise, Pulse, Record
from fpk_rocking.scene import BandNoise, Block, Harmonic, Scene
from fpk_rocking.studies import scaled
from montecarlo import histories, simulate
from montecarlo.engines import batches
from montecarlo.engines.scaled_paths import ScaledPaths


@pytest.mark.parametrize(
    ("size", "seconds", "following"), [(4096, 0.6, 2048), (4096, 0.125, 9830), (64, 1e-3, 256), (100, 0.6, 64)]
)
def test_the_next_batch_takes_the_time_it_should(size, seconds, following):
    """0.3 s, but it is at most four times the last one, and at least 64."""
    assert batches.next_size(size, seconds) == following


def test_batches_are_all_realizations_in_turn():
    scene = Scene(Block(0.5), Harmonic(0.3, 2.7), BandNoise(1e-4, (0.0, 9.0), 1))
    run = batches.checked_run(scene, 1, 8000, 1, "exact", 200)
    parts = list(batches.simulate_batches(run))
    ends = np.cumsum([len(batch.angle) for batch in parts])
    assert [batch.first for batch in parts] == [0, *ends[:-1]]
    assert (ends[0], ends[-1]) == (4096, 8000)
    assert not np.concatenate([batch.angle for batch in parts]).any()


def test_one_path_that_an_engine_loses_is_an_error_that_names_it(monkeypatch):
    simulated = batches._simulated

    def losing(*arguments):
        batch = simulated(*arguments)
        batch.velocity[5, 2:] = np.nan
        return batch

    monkeypatch.setattr(batches, "_simulated", losing)
    scene = Scene(Block(0.5), Harmonic(2.0, 2.7), BandNoise(1e-4, (0.0, 9.0), 1))
    with pytest.raises(
        FloatingPointError, match=r"realization 5 of method 'exact', seed 1: 2 finite states, .* fails on"
    ):
        simulate(scene, cycles=3, realizations=9, seed=1, method="exact")


SAMPLES = np.sin(np.arange(70) * 0.35) * np.sin(np.arange(70) * np.pi / 69)
SHAKEN = Scene(Block(None, Dimensions(0.5, 1.8)), Record(0.04, SAMPLES, "g", 0.45), NoNoise())
PULSED = Scene(Block(0.9), Pulse("one-cosine", 2.6, 3.0), NoNoise())
CYCLIC = Scene.from_block(0.5, 1.8, "0.4 g", "1.5 Hz")
SCENES = {
    "record": (SHAKEN, {}),
    "slender record": (SHAKEN.varied(block={"slender": True}), {}),
    "pulse": (PULSED, {"times": [0.7, 3.3, 12.1]}),
    "harmonic": (CYCLIC, {"cycles": 7}),
    "slender harmonic": (Scene(Block(0.5), Harmonic(4.2, 2.7, 3.14), NoNoise()), {"cycles": 7}),
}


def outcome_of(scene, lasting):
    path = simulate(scene, **lasting)
    return path.overturn_time[0], path.overturn_side[0]


@pytest.mark.parametrize("name", SCENES)
def test_paths_are_those_of_the_scaled_scene(name):
    scene, lasting = SCENES[name]
    # Powers of two scale the tables without rounding. Other factors round them as often as new tables do.
    scales = np.array([0.5, 1.0, 2.0, 4.0, 0.7, 1.3, 2.6, 3.1, 5.7])
    paths = ScaledPaths(scene, **lasting)(scales)
    times, sides = zip(*(outcome_of(scaled(scene, scale), lasting) for scale in scales), strict=True)
    assert {0, 1} <= set(np.abs(sides).tolist())
    assert np.array_equal(paths.overturn_side, sides)
    assert np.array_equal(paths.overturn_time[:4], times[:4], equal_nan=True)
    assert paths.overturn_time == pytest.approx(np.array(times), abs=1e-11, nan_ok=True)


@pytest.mark.parametrize("name", SCENES)
def test_the_largest_angle_is_that_of_a_fine_history(name):
    scene, lasting = SCENES[name]
    scales = np.array([0.4, 0.55, 1.0, 1.35])
    paths = ScaledPaths(scene, **lasting)(scales)
    end = lasting.get("times", [scene.forcing.duration + 10.0])[-1]
    fine = lasting | {"samples_per_cycle": 20_000} if scene.repeats else {"times": np.linspace(0.0, end, 100_000)}
    for scale, peak, side in zip(scales, paths.peak, paths.overturn_side, strict=True):
        path = histories(scaled(scene, scale), **fine)
        expected = scene.overturning.angle if side else np.nanmax(np.abs(path.angle))
        # Cubics over intervals of .2 are right to some 1e-5, over the .1 of this record to 1e-6.
        assert peak == pytest.approx(expected, abs=5e-5 if scene.forcing.kind != "record" else 2e-6)
    assert (paths.overturn_side == 0).any()


@pytest.mark.parametrize("number", [1, 4, 9, 15])
def test_below_the_least_scale_the_block_rests_and_above_it_moves(number):
    scene = random_scene(number).varied(start={"angle": 0.0, "velocity": 0.0})
    paths = ScaledPaths(scene)
    peaks = paths(paths.least_scale * np.array([0.5, 1.0 - 1e-9, 1.1])).peak
    assert (peaks[:2] == 0.0).all()
    assert peaks[2] > 0.0


def test_without_a_start_at_rest_there_is_no_least_scale():
    assert ScaledPaths(SHAKEN.varied(start={"angle": 0.1})).least_scale == 0.0
