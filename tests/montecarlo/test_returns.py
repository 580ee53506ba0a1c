"""Paths that count as overturned and come back: those that are followed to the fall, and what a result says of them."""

import math

import numpy as np

from fpk_rocking import NoNoise, Overturning, Pulse, Scene, load_scene, probability
from fpk_rocking.results.returns import angle_of_fall, return_diagnostics
from montecarlo import simulate, tally

# A strong pulse, under which more than a third of the blocks that pass 29 degrees come back.
PULSED = Scene.from_block(
    1.0, 3.0, "1.667 g", "0.7 Hz", pulse="one-cosine", noise_rms_acceleration=1.6, noise_band_hz=(0.0, 5.0)
)
FALLING = PULSED.varied(overturning=Overturning(0.5 * math.pi / PULSED.block.critical_angle))
TIMES = {"times": [4.0, 12.0]}


def test_paths_that_overturn_are_followed_to_the_fall():
    """Those followed are counted here among all paths to the fall, which have the same noise."""
    early, late = (simulate(scene, **TIMES, realizations=900, seed=4) for scene in (PULSED, FALLING))
    followed = []
    for number in np.flatnonzero(early.overturn_side):
        if len(followed) <= 0.5 * math.sqrt(number):
            followed.append(number)
    back = np.abs(late.angle[followed, -1]) < PULSED.overturning.angle
    assert early.returns.tolist() == [len(followed), back.sum()]
    assert len(followed) == 15
    assert 0 < back.sum() < 15
    assert late.returns.tolist() == [0, 0]


def test_returns_do_not_depend_on_the_batches(tmp_path):
    expected = simulate(PULSED, **TIMES, realizations=400).returns
    for size in (30, 150, 230, 400):
        counted = tally(PULSED, **TIMES, realizations=size, checkpoint=tmp_path / "counts.npz")
    assert counted.returns.tolist() == expected.tolist()


def test_white_noise_brings_back_as_many_of_other_paths():
    """Of every path whose half root is whole: 3.7 standard errors are wrong once in 5,000 seeds."""
    white, falling = PULSED.white_equivalent(), FALLING.white_equivalent()
    followed, back = simulate(white, **TIMES, realizations=40_000, seed=2).returns
    early, late = (simulate(scene, **TIMES, realizations=4_000, seed=3) for scene in (white, falling))
    share = 1.0 - late.survival[-1] / 1.0
    overturned = 1.0 - early.survival[-1]
    assert 80 < followed <= 100
    expected = 1.0 - share / overturned
    assert abs(back / followed - expected) < 3.7 * math.sqrt(
        expected * (1.0 - expected) * (1.0 / followed + 1.0 / 4_000)
    )


def test_a_result_says_so_where_it_matters_by_more_than_its_error():
    sample = simulate(PULSED, **TIMES, realizations=900, seed=4)
    (reason,) = sample.trust.reasons
    followed, back = sample.returns
    assert sample.trust.verdict == "caution"
    assert reason.startswith("A block counts as overturned here from 29° on (π/2 critical angles, the default)")
    assert f"{back} of {followed} such paths followed further did not fall" in reason
    assert 'overturning_angle = "90 deg"' in reason
    assert reason in sample.remarks
    answer = probability(PULSED, **TIMES, tol=0.05)
    assert answer.verdict == "caution"
    assert any("29°" in text for text in answer.trust.reasons)
    assert simulate(FALLING, **TIMES, realizations=900, seed=4).trust.verdict == "ok"


def test_one_path_that_comes_back_is_told():
    alone = Scene.from_block(1.0, 3.0, "1.667 g", "0.7 Hz", pulse="one-cosine")
    path, to_the_fall = (
        simulate(scene, times=[12.0]) for scene in (alone, alone.varied(overturning=FALLING.overturning))
    )
    assert path.overturn_side[0] != 0 == to_the_fall.overturn_side[0]
    assert path.returns.tolist() == [1, 1]
    told = (
        "the one path followed further did not fall. If the fall itself counted, P(overturned) would be about 0.00 in"
    )
    assert told in str(path.trust)


def test_limits_of_what_comes_back_are_held_against_the_error():
    assert return_diagnostics(PULSED, 0.5, 0.05, np.array([0, 0])) == []
    assert return_diagnostics(PULSED, 0.5, 0.05, np.array([40, 0])) == []
    # Wilson's lower limit of 8 of 40 is .105.
    assert return_diagnostics(PULSED, 0.5, 0.053, np.array([40, 8])) == []
    (told,) = return_diagnostics(PULSED, 0.5, 0.052, np.array([40, 8]))
    assert "P(overturned) would be about 0.40 (95 %: 0.33 to 0.45) in place of 0.50" in told.message


def test_only_the_default_angle_of_a_block_with_a_critical_angle_is_followed():
    assert angle_of_fall(PULSED) == FALLING.overturning.angle
    others = (
        PULSED.varied(overturning=Overturning(1.5)),
        FALLING,
        load_scene("main"),
        PULSED.varied(block={"slender": True}),
        Scene.from_block(8.0, 3.0, "2 g", "1 Hz", restitution=0.3),
    )
    assert [angle_of_fall(scene) for scene in others] == [None] * 5
    quiet = Scene(PULSED.block, Pulse("one-sine", 1.2, 3.0), NoNoise())
    assert simulate(quiet, times=[9.0]).returns.tolist() == [0, 0]
