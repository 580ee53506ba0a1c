"""The curve over several motions: dispersions that are known, limits by independent functions, refusals."""

import dataclasses
import math

import numpy as np
import pytest
from scipy import stats
from suites import SCALES, SIZE, curve_of, record, searched, suite

from fpk_rocking import BandNoise, Block, NoNoise, Pulse, Scene
from fpk_rocking.risk import Hazard, IntensityCurve, annual_frequency, at_intensity, drawn, fragility
from fpk_rocking.risk.lognormal import LognormalFit, fit_lognormal
from fpk_rocking.risk.motions import intensity_of
from fpk_rocking.risk.search import MotionOutcomes, overturns


def test_the_dispersion_over_records_is_parted_from_that_of_the_noise():
    """Medians of 60 records with β_R = .4, curves of β_N = .3: total .5; 4 standard errors of 60, false alarm 1e-4."""
    medians = np.exp(0.4 * np.random.default_rng(3).standard_normal(60))
    scenes = [at_intensity(Scene(Block(0.9, SIZE), record(n), BandNoise(0.01, (0.0, 9.0), 9))) for n in range(60)]
    shares = [LognormalFit(m, 0.3)(SCALES) for m in medians]
    curve = IntensityCurve.of(suite(shares, scenes, 1_000_000), "PGV", samples=400)
    noise, between = curve.sources["noise"], curve.sources["record to record"]
    assert noise == pytest.approx(0.3, abs=0.003)
    assert between == pytest.approx(np.log(medians).std(), abs=0.02)
    assert curve.fit.dispersion == pytest.approx(math.hypot(noise, between), rel=1e-12)
    assert curve.source_errors["record to record"] == pytest.approx(0.4 / math.sqrt(2 * 59), rel=0.3)
    assert curve.fit.median == pytest.approx(np.exp(np.log(medians).mean()), rel=0.03)
    low, high = curve.fit.median_interval
    assert math.log(high / low) == pytest.approx(2 * 1.96 * 0.4 / math.sqrt(60), rel=0.25)
    assert np.all((curve.interval[:, 0] <= curve.probability) & (curve.probability <= curve.interval[:, 1]))


def test_the_dispersion_of_uncertain_blocks_is_parted_from_that_of_records():
    """80 records of β_R = .3 with 4 blocks each of β_j = .25, noise .2: 4 standard errors of 80, false alarm 1e-4.

    Blocks under one record are no motions of their own: the interval is wider than that of 320 motions.
    """
    scenes = [at_intensity(Scene(Block(0.9, SIZE), record(n), BandNoise(0.01, (0.0, 9.0), 9))) for n in range(80)]
    rng = np.random.default_rng(8)
    draws = drawn(scenes, {"block.restitution": "normal:0.9:0.01"}, 4)
    scores = (np.array(draws.values["block.restitution"]) - 0.9) / 0.01
    medians = 0.7 * np.exp(0.3 * np.repeat(rng.standard_normal(80), 4) - 0.25 * scores)
    shares = [LognormalFit(m, 0.2)(SCALES) for m in medians]
    curve = IntensityCurve.of(suite(shares, draws.scenes, 1_000_000), "PGV", draws=draws, samples=400)
    assert (curve.records, list(curve.sources)) == (80, ["noise", "block.restitution", "record to record"])
    assert curve.sources["noise"] == pytest.approx(0.2, abs=0.01)
    assert curve.sources["block.restitution"] == pytest.approx(0.25, abs=0.02)
    assert curve.source_errors["block.restitution"] < 0.01  # the medians are nothing but the value and the record
    assert curve.sources["record to record"] == pytest.approx(0.3, abs=0.1)
    total = math.sqrt(sum(value**2 for value in curve.sources.values()))
    assert total == pytest.approx(curve.fit.dispersion, rel=1e-12)
    low, high = curve.fit.median_interval
    assert math.log(high / low) == pytest.approx(2 * 1.96 * math.hypot(0.3, 0.125) / math.sqrt(80), rel=0.3)
    blocks = drawn(scenes[1], {"block.restitution": "normal:0.9:0.01"}, 320)
    alone = IntensityCurve.of(suite(shares, blocks.scenes, 1_000_000), "PGV", draws=blocks, samples=200)
    assert alone.records == 1
    assert list(alone.sources) == ["noise", "block.restitution"]
    assert math.log(alone.fit.median_interval[1] / alone.fit.median_interval[0]) < 0.9 * math.log(high / low)


def test_limits_of_a_rejected_fit_are_those_of_so_many_outcomes():
    """Two groups of motions, 8 and 12: Clopper and Pearson's for 20, by an independent function."""
    scenes = [at_intensity(Scene(Block(0.9, SIZE), record(n), NoNoise())) for n in range(20)]
    shares = [(critical < SCALES).astype(float) for critical in [0.2] * 8 + [2.0] * 12]
    curve = IntensityCurve.of(suite(shares, scenes, 1), "PGV")
    assert curve.fit.rejected
    assert curve.fit.rejected.endswith("below 0.05")
    for share, limits in zip(curve.probability, curve.interval, strict=True):
        proper = stats.binomtest(round(20 * share), 20).proportion_ci(method="exact")
        assert limits == pytest.approx((proper.low, proper.high), abs=1e-9)
    assert np.array_equal(curve(curve.intensity), curve.probability)


def test_a_fit_that_leaves_the_share_of_the_motions_is_rejected():
    """Thresholds of 20 motions are lognormal; if each also overturns the block far below its own, the share is not."""
    logs = 0.3 * stats.norm.ppf((np.arange(20) + 0.5) / 20)
    plain = IntensityCurve.of(searched(logs), "scale", samples=99)
    assert (plain.fit.rejected, plain.fit.p_value > 0.9) == ("", True)
    made = searched(logs)
    jumps = np.exp(logs[:, None, None] + np.array([-1.0, -0.5, 0.5]))
    curve = IntensityCurve.of(dataclasses.replace(made, motions=MotionOutcomes(jumps, *np.zeros((3, 20)))), "scale")
    assert curve.fit.median == pytest.approx(plain.fit.median, rel=1e-9)
    assert curve.fit.dispersion**2 == pytest.approx(plain.fit.dispersion**2 + 1.0, rel=1e-9)  # 1² - .5² + .5²
    assert curve.fit.misfit > 0.3
    assert curve.fit.p_value < 0.001
    assert "is rejected (p = 0.0005, below 0.05)" in curve.fit_diagnostics[0].message


def test_limits_without_a_fit_do_not_depend_on_the_points_of_the_curve():
    """Two groups of motions that were searched, 8 and 12: steps of Clopper and Pearson's limits, and a tail below."""
    critical, hazard = np.repeat([0.2, 2.0], [8, 12]) * np.tile([1.0, 1.1], 10), Hazard.power_law(1e-3, 2.0)
    jumps = np.full((20, 1, 3), math.nan)
    jumps[:, 0, 0] = critical
    jumps[0, 0] = 0.15, 0.1501, critical[0]  # too narrow to count
    scenes, risks = [at_intensity(Scene(Block(0.9, SIZE), record(n), NoNoise())) for n in range(20)], []
    for places in (SCALES, SCALES[4:9], np.geomspace(0.01, 0.1, 3)):
        shares = overturns(jumps[:, 0], places)[:, None].astype(float)
        fields = {"scale": places, "probability": shares, "error_estimate": np.full_like(shares, math.nan)}
        fields |= {"motions": MotionOutcomes(jumps, *np.zeros((3, 20))), "options": {"farthest": 1000.0}}
        curve = IntensityCurve.of(dataclasses.replace(suite(np.zeros((20, 12)), scenes, 1), **fields), "PGV")
        risks.append(annual_frequency(curve, hazard))
        assert curve.fit.rejected
    assert len({(risk.rate, *risk.interval) for risk in risks}) == 1
    # By an independent sum over a fine grid.
    grid = np.linspace(math.log(0.2) - 25.0, math.log(2.2) + 15.0, 400_001)
    middle = np.exp(0.5 * (grid[1:] + grid[:-1]))
    happened = (critical <= middle[:, None]).sum(axis=1)
    limits = [stats.binomtest(k, 20).proportion_ci(method="exact") for k in range(21)]
    for side, name in enumerate(("low", "high")):
        law = np.array([getattr(limit, name) for limit in limits])[happened]
        first = getattr(limits[4], name)
        tail = stats.norm.cdf(stats.norm.ppf(first) + np.log(middle / 0.2) / curve.fit.dispersion)
        law = np.where(middle < 0.2, tail if name == "high" else 0.0, law)
        assert risks[0].interval[side] == pytest.approx((law * -np.diff(hazard(np.exp(grid)))).sum(), rel=1e-3)


def test_two_of_five_motions_give_limits_without_a_warning():
    """They agree with medians that no number holds, and with rates from 0 up; numpy's warnings are errors here."""
    scenes = [at_intensity(Scene(Block(0.9, SIZE), record(n), NoNoise())) for n in range(5)]
    shares = [(critical < SCALES).astype(float) for critical in (0.2, 2.0, 9.0, 9.0, 9.0)]
    curves = [IntensityCurve.of(suite(shares, scenes, 1), "PGV", seed=seed) for seed in range(1, 5)]
    assert any(np.isinf(curve.replicates).any() for curve in curves)
    for curve in curves:
        risk = annual_frequency(curve, Hazard.power_law(1e-3, 2.5))
        assert 0.0 <= risk.interval[0] < risk.rate < risk.interval[1] < np.inf


def test_one_scene_has_the_limits_of_its_sample():
    scene = at_intensity(Scene(Block(0.9, SIZE), Pulse("one-sine", 2.0, 4.0), BandNoise(0.05, (0.0, 10.0), 30)), "PGV")
    curves = fragility(scene, scale=np.geomspace(0.4, 2.5, 8), realizations=300)
    curve = IntensityCurve.of(curves, "PGV")
    assert np.array_equal(curve.probability, curves.overturned[0])
    assert np.array_equal(curve.intensity, curves.scale * intensity_of(scene, "PGV"))
    direct = fit_lognormal(curve.intensity, curve.probability, 300)
    assert curve.fit.median == pytest.approx(direct.median, rel=1e-9)
    # Two ways to the same interval: information, and counts drawn from the curve.
    for mine, other in zip(curve.fit.median_interval, direct.median_interval, strict=True):
        assert math.log(mine / direct.median) == pytest.approx(math.log(other / direct.median), rel=0.15)
    assert curve.records == 1
    assert curve.sources == {"noise": curve.fit.dispersion}


def test_what_is_no_suite_is_refused_by_name():
    scenes = [Scene(Block(0.9, SIZE), record(n), BandNoise(0.01, (0.0, 9.0), 9)) for n in range(6)]
    shares = [curve_of().probability] * 6
    with pytest.raises(ValueError, match=r"PGV of the scenes at scale 1: got .*at_intensity"):
        IntensityCurve.of(suite(shares, scenes, 100), "PGV")
    equal = [at_intensity(scene) for scene in scenes]
    sizes = dataclasses.replace(suite(shares, equal, 100), axis="size")
    with pytest.raises(ValueError, match=r"fragility: got .* of one scene, or of a list of scenes"):
        IntensityCurve.of(sizes, "PGV")
    shares = np.array(shares)
    shares[2, 3] = np.nan
    curve = IntensityCurve.of(suite(shares, equal, 100), "PGV")
    assert curve.intensity == pytest.approx(np.delete(SCALES, 3), rel=1e-12)
    with pytest.raises(ValueError, match="got no scale at which all scenes have a probability"):
        IntensityCurve.of(suite(np.full(shares.shape, np.nan), equal, 100), "PGV")


def test_a_mean_over_drawn_blocks_is_at_most_one():
    """Or pelicun would refuse it. Weights of nine blocks of each of two motions have a sum of 1 + 2e-16."""
    scenes = [at_intensity(Scene(Block(0.9, SIZE), record(n), NoNoise())) for n in range(2)]
    draws = drawn(scenes, {"block.restitution": "normal:0.9:0.01"}, 9)
    overturned = dataclasses.replace(searched(np.log(np.linspace(0.6, 0.9, 18))), scenes=draws.scenes)
    assert IntensityCurve.of(overturned, "PGV", draws=draws, samples=99).probability[-1] == 1.0
