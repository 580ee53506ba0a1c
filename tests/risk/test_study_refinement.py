"""Intensities that are added with noise: the rate does not depend on those that were asked for."""

import dataclasses
import functools

import numpy as np
import pytest
from scipy.special import ndtr
from suites import SIZE, record

from fpk_rocking import BandNoise, Block, Scene
from fpk_rocking.results.trust import CAUTION
from fpk_rocking.risk import (
    Hazard,
    IntensityCurve,
    annual_frequency,
    at_intensity,
    fragility,
    intensities,
    study,
    synthetic_records,
)
from fpk_rocking.risk.curves import Fragility
from fpk_rocking.risk.lognormal import LognormalFit
from fpk_rocking.risk.study import with_added_intensities

MOTIONS, HAZARD = 8, Hazard.power_law(1e-4, 2.5)


@pytest.mark.parametrize("suite", [0, *(pytest.param(suite, marks=pytest.mark.slow) for suite in range(1, 5))])
def test_rates_by_8_24_and_48_intensities_are_within_two_percent(suite):
    """Curves that rise, fall at a resonance and rise again, sampled with 10,000 paths; the truth is their integral.

    By the lognormal fit, which stands in some of these suites, the rates differed by up to 10 %.
    """
    rng, draw = np.random.default_rng(100 + suite), np.random.default_rng(suite)
    medians, noise = np.exp(0.5 * rng.standard_normal(MOTIONS)), rng.uniform(0.08, 0.35, MOTIONS)
    weight, low = rng.uniform(0.0, 0.25, MOTIONS), medians * rng.uniform(0.4, 0.7, MOTIONS)
    scenes = tuple(
        at_intensity(Scene(Block(0.9, SIZE), record(n), BandNoise(0.01, (0.0, 9.0), 9))) for n in range(MOTIONS)
    )

    def probability(scale):
        """Probability of each motion (8, n) at scales."""
        away = np.log(scale / low[:, None]) / 0.1
        bump = weight[:, None] * ndtr(away) * (1.0 - ndtr(away - np.log(1.4) / 0.1))
        return np.minimum(bump + ndtr(np.log(scale / medians[:, None]) / noise[:, None]), 1.0)

    def sample(scale, _):
        """Return the fragility of a sample of 10,000 paths of each motion at each scale."""
        shares = draw.binomial(10_000, probability(scale))[:, None] / 10_000
        return Fragility(
            scenes, "scene", np.arange(MOTIONS), np.empty(0), scale, shares, np.full(shares.shape, np.nan),
            "exact", 10_000, True, {}, "", {}, 0.0,
        )  # fmt: skip

    def risk_of(curves):
        """Return the risk by the points of a fragility."""
        curve = IntensityCurve.of(curves, "PGV", samples=1)
        return annual_frequency(dataclasses.replace(curve, by_points=True), HAZARD)

    grid = np.geomspace(0.01, 100.0, 100_001)
    truth = (probability(np.sqrt(grid[1:] * grid[:-1])).mean(axis=0) * -np.diff(HAZARD(grid))).sum()
    rates = [
        risk_of(with_added_intensities(sample, risk_of, np.geomspace(0.1, 4.0, count))[0]).rate for count in (8, 24, 48)
    ]
    assert max(rates) < 1.02 * min(rates)
    assert rates == pytest.approx([truth] * 3, rel=0.02)


def test_where_nothing_overturns_no_intensities_are_added():
    asked, sampled = np.geomspace(0.1, 1.0, 4), []

    def sample(scale, number):
        sampled.append(number)
        shares = np.zeros((MOTIONS, 1, scale.size))
        scenes = (at_intensity(Scene(Block(0.9, SIZE), record(0), BandNoise(0.01, (0.0, 9.0), 9))),) * MOTIONS
        return Fragility(
            scenes, "scene", np.arange(MOTIONS), np.empty(0), scale, shares, np.full(shares.shape, np.nan),
            "exact", 10_000, True, {}, "", {}, 0.0,
        )  # fmt: skip

    curves, added, moved = with_added_intensities(
        sample, lambda curves: annual_frequency(IntensityCurve.of(curves, "PGV", samples=1), HAZARD), asked
    )
    assert (curves.scale.size, added, moved, sampled) == (4, 0, np.inf, [0])


def test_the_rate_of_a_refined_curve_is_by_its_points_and_within_its_limits():
    """A fit of twice the probability: by it the rate is outside what the points say, and its limits are widened."""
    scale = np.geomspace(0.2, 3.0, 40)
    share = 0.5 * LognormalFit(0.7, 0.4)(scale)
    fit = LognormalFit(0.7, 0.4, misfit=0.0)
    curve = IntensityCurve(
        "overturned",
        "PGV",
        scale,
        share,
        np.stack([share, share], axis=-1),
        fit,
        np.array([(0.7, 0.4)] * 9),
        8,
        units=8,
    )
    by_fit, by_points = (annual_frequency(dataclasses.replace(curve, by_points=by), HAZARD) for by in (False, True))
    inside = (0.5 * (share[1:] + share[:-1]) * -np.diff(HAZARD(scale))).sum() + share[-1] * HAZARD(scale[-1])
    assert by_points.rate == pytest.approx(inside / (1.0 - by_points.below_curve), rel=5e-3)
    assert by_fit.rate == pytest.approx(2.0 * by_points.rate, rel=0.1)
    assert by_points.interval == pytest.approx((by_points.rate, by_fit.rate), rel=1e-6)
    assert "Computed from the points, joined by lines" in by_points.sentences[0]
    assert "Computed from the lognormal curve" in by_fit.sentences[0]


@functools.cache
def shaken(count, realizations=60):
    noise = {"noise_rms_acceleration": 0.3, "noise_band_hz": (0, 8), "harmonics": 200}
    block = Scene.from_block(0.5, 1.8, "0.3 g", "1.5 Hz", **noise)
    motions = synthetic_records(6, duration=4.0, rms=1.5)
    return study(block, motions, Hazard.power_law(1e-4, 2.5), np.geomspace(0.3, 3.0, count), realizations=realizations)


def test_with_noise_intensities_are_added_where_the_rate_comes_from():
    few, asked = shaken(4), np.geomspace(0.3, 3.0, 4)
    scale = few.fragility.scale
    assert np.isin(np.round(asked, 12), np.round(scale, 12)).all()
    assert few.added == scale.size - 4 > 2
    assert (np.diff(scale) > 0.0).all()
    assert few.moved <= 0.01
    assert f"{few.added} intensities were added" in few.text()
    # A curve that is as dense everywhere has this rate but for the scatter of its samples; as asked for, another.
    dense = np.geomspace(0.1, 3.0, 30)
    paths = few.fragility
    finer = fragility(list(paths.scenes), scale=dense, realizations=180, seed=7)
    dense_rate = annual_frequency(IntensityCurve.of(finer, "PGV"), few.risk.hazard).rate
    coarse = fragility(list(paths.scenes), scale=asked, realizations=60, seed=7)
    assert few.risk.rate == pytest.approx(dense_rate, rel=0.08)
    assert annual_frequency(IntensityCurve.of(coarse, "PGV"), few.risk.hazard).rate != pytest.approx(
        dense_rate, rel=0.1
    )


def test_intensities_asked_for_keep_their_samples():
    result, asked = shaken(4), np.geomspace(0.3, 3.0, 4)
    alone = fragility(list(result.fragility.scenes), scale=asked, realizations=60, seed=1)
    places = np.searchsorted(result.fragility.scale, asked * (1.0 - 1e-9))
    assert np.array_equal(result.fragility.overturned[:, places], alone.overturned)


def test_motions_that_overturn_only_scaled_far_are_a_caution():
    result = shaken(4)
    passed = [np.extract(shares >= 0.5, result.curve.intensity) for shares in result.records]
    own = np.array([intensities(scene).pgv for scene in result.recorded])
    assert result.factors == pytest.approx([some[0] if some.size else np.inf for some in passed] / own)
    weak = dataclasses.replace(result, recorded=[scene.varied(forcing={"scale": 0.01}) for scene in result.recorded])
    assert np.isfinite(result.factors).any()
    assert any("must be scaled by more than 5" in reason for reason in weak.trust.reasons)
    assert result.factors[np.isfinite(result.factors)].max() < 5.0
    assert not any("must be scaled by more than 5" in reason for reason in result.trust.reasons)


def test_a_rate_that_still_moves_is_a_caution():
    restless = dataclasses.replace(shaken(4), moved=0.07)
    (reason,) = [text for text in restless.trust.reasons if "still changed" in text]
    assert "by 7 % with the last of" in reason
    (moving,) = [diagnostic for diagnostic in restless.diagnostics if diagnostic.name == "intensities"]
    assert (moving.message, moving.severity) == (reason, CAUTION)
