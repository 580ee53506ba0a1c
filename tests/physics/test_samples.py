"""Samples of a record: what follows from them is computed once for all scales, and for nothing else."""

import dataclasses
import pickle

import numpy as np

from fpk_rocking import Block, Dimensions, NoNoise, Record, Scene
from fpk_rocking.physics.forcing.samples import Samples

ACCELERATIONS = np.random.default_rng(1).normal(size=400)
RECORD = Record(0.02, ACCELERATIONS, "m/s2", baseline="high-pass", corner_hz=0.3)


def test_scales_and_blocks_share_what_the_correction_leaves():
    for other in (RECORD.scaled(3.0, 1.0), RECORD.for_size(Dimensions(0.5, 1.8)), dataclasses.replace(RECORD, scale=2)):
        assert other.samples is RECORD.samples
        assert other.corrected_samples is RECORD.corrected_samples
        assert other.drift is RECORD.drift


def test_another_correction_interval_or_unit_has_results_of_its_own():
    changes = {"baseline": "mean", "corner_hz": 0.6, "interval": 0.01, "units": "g"}
    for name, value in changes.items():
        shared = dataclasses.replace(RECORD, **{name: value})
        alone = Record(**{"interval": 0.02, "samples": ACCELERATIONS, "units": "m/s2", "baseline": "high-pass"}
                       | {"corner_hz": 0.3, name: value})  # fmt: skip
        assert RECORD.drift != shared.drift == alone.drift
        assert np.array_equal(shared.corrected_samples, alone.corrected_samples)
        assert np.array_equal(shared.corrected_samples, RECORD.corrected_samples) == (name == "units")


def test_they_are_a_tuple_that_is_written_exactly_and_sent_without_what_is_kept():
    signed = [Samples.of(samples) for samples in ((0.1, 0.0, 1e-7), (0.1, -0.0, 1e-7))]
    assert signed[0] == signed[1] == (0.1, 0.0, 1e-7)
    assert [samples.toml for samples in signed] == ["[0.1, 0.0, 1e-07]", "[0.1, -0.0, 1e-07]"]
    assert signed[0].once("key", lambda: 1) == 1 == signed[0].once("key", lambda: 2)
    sent = pickle.loads(pickle.dumps(signed[0]))
    assert type(sent) is Samples
    assert sent == signed[0]
    assert sent.once("key", lambda: 3) == 3
    scene = Scene(Block(0.9, Dimensions(0.6, 2.0)), RECORD, NoNoise())
    assert Scene.from_toml(scene.to_toml()) == scene
