"""The benchmark of practical blocks: the scenes that it draws, and a row whatever the solver does."""

import importlib
import pathlib
import sys

import numpy as np
import pytest

from fpk_rocking.scene import Block, Harmonic, Scene, WhiteNoise
from montecarlo import simulate

ROOT = pathlib.Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "benchmarks"))
benchmark = importlib.import_module("practical_blocks")


def test_scenes_are_those_of_the_definition():
    """Ranges of every draw in metres, m/s² and Hz; the first of many are the same scenes as a few."""
    scenes = list(benchmark.practical_blocks(3, 4))
    assert scenes[:2] == list(benchmark.practical_blocks(3, 2))
    rng = np.random.default_rng(3)
    assert scenes[0].block.dimensions.width == rng.uniform(0.3, 1.2)
    for scene in scenes:
        size, rate = scene.block.dimensions, scene.block.dimensions.frequency_parameter / (2.0 * np.pi)
        unit = size.gravity * size.critical_angle / 9.81
        assert 0.3 <= size.width <= 1.2
        assert 2.5 <= size.height / size.width <= 6.0
        assert scene.block.restitution == size.restitution
        assert 0.15 <= scene.forcing.amplitude * unit <= 0.8
        assert 0.6 <= scene.forcing.frequency * rate <= 4.0
        assert 0.02 <= np.sqrt(scene.noise.variance) * unit <= 0.1
        assert scene.noise.band[0] == 0.0
        assert 5.0 <= scene.noise.band[1] * rate <= 10.0


def test_scenes_that_hardly_stand_are_drawn_again():
    scenes = list(benchmark.practical_blocks(3, 6, least=0.0))
    run = {"cycles": benchmark.CYCLES, "realizations": 1000, "method": "exact"}
    survival = [simulate(scene, **run).survival[-1] for scene in scenes]
    standing = [scene for scene, share in zip(scenes, survival, strict=True) if share > 0.5]
    assert 0 < len(standing) < len(scenes)
    assert list(benchmark.practical_blocks(3, len(standing), least=0.5)) == standing


@pytest.fixture
def scene():
    return Scene.from_block(0.6, 2.0, 2.5, 1.5, noise_rms_acceleration=0.3, noise_band_hz=(0.0, 6.0))


def test_a_refusal_is_a_row_with_its_reason(scene, tmp_path):
    row = benchmark.judged(scene, 0.0, 60, tmp_path)
    assert row.survival == benchmark.reference_of(scene.white_equivalent(), 60, tmp_path).standing[-1] / 60
    assert not row.answered
    cells = benchmark.cells_of(1, row)
    assert cells[-1].startswith("ValueError: tol: got 0.0")
    assert len(cells) == len(benchmark.COLUMNS)
    assert benchmark.cells_of(1, row._replace(remark="no | answer"))[-1] == "no ¦ answer"
    assert "answered: 0 of 1" in benchmark.summary([row], 1e-2)


def test_sampling_seconds_give_the_standard_error(scene):
    """S = .5 known to .01 takes 2,500 paths; an answer that takes longer is not cheaper."""
    row = benchmark.Row(
        scene, 1.0, 0.5, 0.001, 0.1, 0.001, 0.01, [(0.02, 0.02), (0.05, 0.04)], 100, 2.0,
        {"white": 0.25, "exact": 0.25}, {"white": 1e-2, "exact": 1e-3}, "",
    )  # fmt: skip
    assert row.sampling_seconds("white", 0.01) == pytest.approx(25.0)
    assert not row.is_cheapest(row.sampling_seconds, 0.02)
    assert row.is_cheapest(row.sampling_seconds, 0.01)
    assert not row._replace(error=None).is_cheapest(row.sampling_seconds, 0.01)


def test_binning_seconds_give_the_distance(scene):
    """100 paths have an L1 of .04 in the worse of two binned cycles: .004 takes 10,000."""
    row = benchmark.Row(
        scene, 1.0, 0.5, 0.001, 0.1, 0.001, 0.01, [(0.02, 0.02), (0.05, 0.04)], 100, 2.0, {}, {"white": 1e-3}, ""
    )
    assert row.binning_seconds("white", 0.004) == pytest.approx(10.0)
    assert row.is_cheapest(row.binning_seconds, 0.004)
    assert not row.is_cheapest(row.binning_seconds, 0.01)


def test_references_are_kept_and_are_of_their_scene(tmp_path):
    scene = Scene(Block(0.5), Harmonic(4.6, 2.7), WhiteNoise(0.006))
    sampled = benchmark.reference_of(scene, 300, tmp_path)
    assert (sampled.counts.sum(axis=(1, 2)) == sampled.standing[list(benchmark.BINNED)]).all()
    again = benchmark.reference_of(scene, 300, tmp_path)
    for name, value in sampled._asdict().items():
        assert np.array_equal(value, getattr(again, name))
    (file,) = tmp_path.iterdir()
    np.savez(file, **sampled._replace(standing=np.full(11, 7))._asdict())
    assert (benchmark.reference_of(scene, 300, tmp_path).standing == 7).all()
    assert (benchmark.reference_of(scene, 301, tmp_path).standing != 7).any()
