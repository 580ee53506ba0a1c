"""Critical intensities: against paths at single scales, and where the search begins, ends and passes over."""

import csv
import dataclasses
import math

import numpy as np
import pytest

from fpk_rocking import NoNoise, Scene
from fpk_rocking.risk import (
    CriticalIntensities,
    Fragility,
    at_intensity,
    critical_intensities,
    fragility,
    intensities,
    synthetic_records,
)
from fpk_rocking.risk.critical import factor_diagnostics
from fpk_rocking.risk.motions import motion_names, recorded_scenes
from fpk_rocking.risk.search import first_scale, overturns
from fpk_rocking.studies import scaled
from montecarlo import simulate
from montecarlo.engines.scaled_paths import ScaledPaths

BLOCK = Scene.from_block(0.5, 1.8, "0.3 g", "1.5 Hz")
MOTIONS = synthetic_records(4, duration=5.0, rms=1.5)
HIGHEST = 8.0


@pytest.fixture(scope="module")
def suite():
    return critical_intensities(BLOCK, MOTIONS, measure="scale", highest=HIGHEST)


def outcome(scene, scale):
    return simulate(scaled(scene, scale)).overturn_side[0] != 0


def test_outcomes_are_those_of_single_paths(suite):
    scales = np.exp(np.random.default_rng(3).uniform(math.log(0.8), math.log(HIGHEST), 40))
    got = suite.overturned(scales)
    wanted = np.array([[outcome(scene, scale) for scale in scales] for scene in suite.scenes])
    assert 0.3 < wanted.mean() < 0.7
    # An interval narrower than the scan is met by chance: about one point in a hundred lies in one that is missed.
    assert np.count_nonzero(got != wanted) <= 3


def test_each_jump_is_where_the_outcome_changes(suite):
    for scene, row in zip(suite.scenes, suite.jumps, strict=True):
        scales = row[np.isfinite(row)]
        assert scales.size % 2 == 1
        assert (np.diff(scales) > 0.0).all()
        # Halved from steps of .01, a jump lies between two scales that were followed; the last step may be shorter.
        for number, scale in enumerate(scales[scales < HIGHEST * math.exp(-0.04)].tolist()):
            before, after = (outcome(scene, scale * math.exp(sign * 0.01 / 32.0)) for sign in (-1, 1))
            assert (before, after) == (number % 2 == 1, number % 2 == 0)


def test_there_are_several_intervals(suite):
    assert np.isfinite(suite.jumps).sum(axis=1).max() >= 5


def test_at_its_own_scale_it_is_one_path(suite):
    for number, scene in enumerate(suite.scenes):
        path = simulate(scene)
        assert suite.overturn_side[number] == path.overturn_side[0]
        assert suite.overturn_time[number] == pytest.approx(path.overturn_time[0], abs=1e-11, nan_ok=True)
    assert (suite.overturn_side == 0).any()


@pytest.mark.parametrize("measure", ["PGA", "PGV"])
def test_intensities_are_scales_times_the_motions_own(suite, measure):
    field, unit = ("pga", 9.80665) if measure == "PGA" else ("pgv", 1.0)
    own = np.array([getattr(intensities(scene), field) / unit for scene in suite.scenes])
    other = critical_intensities(BLOCK, MOTIONS, measure=measure, highest=HIGHEST * own.max())
    assert other.own == pytest.approx(own, rel=1e-12)
    # What the last cell of the scan holds depends on where it ends.
    below = suite.jumps < HIGHEST * math.exp(-0.04)
    for number, row in enumerate(suite.jumps):
        kept = row[below[number]]
        assert other.jumps[number, : kept.size] == pytest.approx(kept * own[number], rel=1e-9)
    assert other.factor == pytest.approx(suite.factor, rel=1e-9)
    assert not np.array_equal(other.critical, suite.critical)


def test_the_first_interval_that_is_wide_enough_counts():
    rows = [[1.0, 1.005, 2.0, 2.1], [1.0, 1.02, math.nan, math.nan], [1.0, 1.001, 3.0, math.nan], [math.nan] * 4,
            [1.0, 1.001, 2.0, 2.001]]  # fmt: skip
    assert first_scale(np.array(rows)).tolist() == [2.0, 1.0, 3.0, math.inf, math.inf]
    assert first_scale(np.array(rows)[:, :3]).tolist() == [2.0, 1.0, 3.0, math.inf, 2.0]
    assert first_scale(np.empty((2, 0))).tolist() == [math.inf, math.inf]


def test_between_jumps_the_outcome_alternates():
    rows = np.array([[1.0, 2.0, 3.0], [1.5, math.nan, math.nan]])
    got = overturns(rows, [0.5, 1.0, 1.9, 2.0, 2.9, 3.0, 9.0])
    assert got.astype(int).tolist() == [[0, 1, 1, 0, 0, 1, 1], [0, 0, 1, 1, 1, 1, 1]]


def test_a_motion_that_never_overturns_is_censored():
    weak = critical_intensities(BLOCK, MOTIONS[:2], measure="PGA", highest=0.2)
    assert weak.critical.tolist() == [math.inf, math.inf]
    assert weak.jumps.shape == (2, 0)
    assert weak.title == "0 of 2 motions overturn the block up to PGA 0.2 g"
    assert not weak.overturned([0.1, 0.2]).any()


def test_a_block_that_starts_tilted_may_overturn_at_once():
    tilted = BLOCK.varied(start={"angle": 1.2})
    (row,) = critical_intensities(tilted, MOTIONS[:1], measure="scale", highest=1.0).jumps
    assert row[0] == pytest.approx(1e-3)


def test_motions_have_names_that_differ():
    scenes = [*(Scene.from_block(0.5, 1.8, record=motion) for motion in (MOTIONS[0], MOTIONS[1], MOTIONS[0])), BLOCK]
    first, second, third, fourth = motion_names(scenes)
    assert (first, third) == (MOTIONS[0].source + " (1)", MOTIONS[0].source + " (2)")
    assert (second, fourth) == (MOTIONS[1].source, str(BLOCK.forcing))


def test_a_large_factor_is_a_caution():
    assert factor_diagnostics(np.array([0.5, 5.0, math.inf])) == []
    (caution,) = factor_diagnostics(np.array([0.5, 7.3, math.inf]))
    assert caution.severity == 1
    assert caution.message.startswith(
        "1 of 3 motions must be scaled by more than 5, up to 7.3, to overturn the block. Common"
    )
    (caution,) = factor_diagnostics(np.array([0.5, 7.3, math.inf]), np.array([6.0, 9.0, math.inf]))
    always = "to overturn the block. For 3 of 3 the factor from which it always overturns is above 5. Common"
    assert always in caution.message


def test_files_hold_it(suite, tmp_path):
    suite.save(tmp_path / "suite.npz")
    again = CriticalIntensities.load(tmp_path / "suite.npz")
    assert np.array_equal(again.jumps, suite.jumps, equal_nan=True)
    again.to_csv(tmp_path / "suite.csv")
    rows = list(csv.DictReader((tmp_path / "suite.csv").open(encoding="utf-8")))
    assert [row["motion"] for row in rows] == [motion.source for motion in MOTIONS]
    assert [float(row["critical_scale"]) for row in rows] == suite.critical.tolist()
    assert suite.summary()["jumps"][1] == suite.jumps[1][np.isfinite(suite.jumps[1])].tolist()


def test_workers_and_stores_change_nothing(suite, tmp_path):
    wanted = {"measure": "scale", "highest": HIGHEST, "store": tmp_path / "rows.jsonl"}
    critical_intensities(BLOCK, MOTIONS[:1], **wanted)
    again = critical_intensities(BLOCK, MOTIONS, workers=2, **wanted)
    assert np.array_equal(again.jumps, suite.jumps, equal_nan=True)
    assert np.array_equal(again.peak, suite.peak)


@pytest.mark.parametrize(
    ("change", "message"),
    [({"scene": None, "motions": ()}, "scene: got None"),
     ({"highest": 0.0}, "highest: got 0.0, accepted: "),
     ({"measure": "PGD"}, "measure: got 'PGD', accepted: 'PGA', 'PGV'"),
     ({"scene": [BLOCK]}, "motions: got "),
     ({"cycles": 3}, "cycles: got 3, accepted: nothing")],
)  # fmt: skip
def test_refusals(change, message):
    with pytest.raises((TypeError, ValueError), match=message):
        critical_intensities(**{"scene": BLOCK, "motions": MOTIONS[:1], "highest": 1.0} | change)


def test_noise_is_refused():
    noisy = Scene.from_block(0.5, 1.8, "0.3 g", "1.5 Hz", noise_rms_acceleration=0.5, noise_band_hz=(0, 5))
    assert noisy.noise != NoNoise()
    with pytest.raises(ValueError, match=r"scene\[0\]: got .*, accepted: scenes without noise"):
        critical_intensities(noisy, MOTIONS[:1], highest=1.0)


def test_fragility_without_noise_is_by_the_jumps_and_not_by_the_number_of_scales(suite, tmp_path):
    scenes = list(suite.scenes)
    few, many = (fragility(scenes, scale=np.geomspace(1.0, HIGHEST, count), levels=[0.5]) for count in (3, 20))
    for curves in (few, many):
        assert np.array_equal(curves.motions.jumps[:, 0, : suite.jumps.shape[1]], suite.jumps, equal_nan=True)
        by_jumps = suite.overturned(np.minimum(curves.scale, HIGHEST))
        assert np.count_nonzero(curves.overturned != by_jumps) <= 0.05 * by_jumps.size
        assert curves.motions.critical.tolist() == suite.critical.tolist()
    # A block that overturns has passed each level before.
    assert (many.reached[:, 0] >= many.overturned).all()
    assert (many.reached[:, 0] > many.overturned).any()
    many.save(tmp_path / "curves.npz")
    again = Fragility.load(tmp_path / "curves.npz")
    assert np.array_equal(again.motions.jumps, many.motions.jumps, equal_nan=True)
    assert again.motions.peak.tolist() == suite.peak.tolist()


def test_outcomes_where_they_are_asked_for_are_those_of_paths():
    """Of 2 times 40 scales the search alone missed 3, in intervals that its scan passes over."""
    block, scales = Scene.from_block(0.4, 1.8, "0.3 g", "1.5 Hz"), np.geomspace(0.5, 3.0, 40)
    for shaken in recorded_scenes(block, synthetic_records(2, duration=8.0)):
        found = fragility(shaken, scale=scales)
        np.testing.assert_array_equal(found.overturned[0], ScaledPaths(shaken)(scales).overturned)


def test_the_block_overturns_all_over_the_first_hundredth_from_the_critical_intensity():
    """At 120 scales that the search has not seen; by a scan of 1 % alone at 20 and 51 % of them under two motions."""
    block = Scene.from_block(0.5, 1.8, "0.3 g", "1.5 Hz")
    motions = [synthetic_records(20, duration=10.0, seed=3)[number] for number in (0, 15, 16)]
    suite = critical_intensities(block, motions, measure="PGA")
    for shaken, factor in zip(suite.scenes, suite.factor, strict=True):
        shares = ScaledPaths(shaken)(factor * np.exp(np.linspace(7e-4, 9.3e-3, 120))).overturned
        assert shares.mean() > 0.9


def test_a_motion_overturns_at_its_own_strength_if_it_is_said_to():
    """A record as it was recorded, seen from the intensity 1: the scan alone misses the interval."""
    block = Scene.from_block(0.4, 1.8, "0.3 g", "1.5 Hz")
    (shaken,) = recorded_scenes(block, synthetic_records(1, duration=8.0))
    for strength in (1.3738114092, 1.984028416):
        record = dataclasses.replace(shaken.forcing, samples=strength * np.array(shaken.forcing.samples))
        scene = shaken.varied(forcing=record)
        own = critical_intensities([scene], measure="PGV")
        assert own.overturned(own.own).diagonal() == (own.overturn_side != 0)
        found = fragility(at_intensity(scene, "PGV"), scale=[0.1])
        assert overturns(found.motions.jumps[:, 0], own.own)[0, 0] == (own.overturn_side[0] != 0)
