"""Mean Poincaré maps, and the statistics of first passages, impact speeds and bins."""

import dataclasses
import math
import pathlib

import numpy as np
import pytest

from fpk_rocking.scene import Block, Harmonic, NoNoise, Overturning, Scene, Start, load_scene
from montecarlo import (
    bin_errors,
    first_passage,
    histories,
    impact_speeds,
    mean_poincare_map,
    poincare,
    restarted_poincare_map,
    simulate,
)
from montecarlo.engines import batches

SCENES = pathlib.Path(__file__).parents[2] / "cases" / "scenes"
MAIN = load_scene(SCENES / "main.toml")
WHITE = MAIN.white_equivalent()
ORBIT = dataclasses.replace(load_scene(SCENES / "fig05.toml"), noise=NoNoise())
# x - 1 = (x0 - 1) cosh t + v0 sinh t without forcing: linear while no block reaches x = 0 or the cut-off.
FLIGHT = Scene(Block(0.5), Harmonic(0.0, 8.0), NoNoise(), Start(0.7, 0.1, ((1e-3, 2e-4), (2e-4, 1e-3))))


@pytest.fixture(scope="module")
def ensemble():
    return simulate(MAIN, cycles=8, realizations=3000, seed=2)


def test_mean_map_of_an_ensemble_clamps_or_leaves_out(ensemble):
    clamped, left_out = (mean_poincare_map(ensemble, rule) for rule in ("clamped", "left out"))
    assert clamped.points.shape == clamped.standard_error.shape == (9, 2)
    assert clamped.counted.tolist() == [3000] * 9
    assert left_out.counted.tolist() == ensemble.survivors.tolist()
    assert left_out.points == pytest.approx(
        np.stack([np.nanmean(ensemble.angle, axis=0), np.nanmean(ensemble.velocity, axis=0)], axis=1), abs=1e-12
    )
    share, pushed = ensemble.survival, np.diff(ensemble.overturned, axis=1)[:, 0] * math.pi / 2
    assert clamped.points[:, 0] == pytest.approx(share * left_out.points[:, 0] + pushed, abs=1e-12)
    assert clamped.points[:, 1] == pytest.approx(share * left_out.points[:, 1], abs=1e-12)
    assert left_out.standard_error[8, 0] == pytest.approx(
        np.nanstd(ensemble.angle[:, 8], ddof=1) / math.sqrt(ensemble.survivors[8])
    )


def test_a_noise_free_map_is_the_orbit_in_both_readings():
    run = simulate(ORBIT, cycles=6, realizations=3)
    free, restarted = mean_poincare_map(run), restarted_poincare_map(ORBIT, cycles=6, realizations=3)
    for points in (free, restarted):
        assert points.points == pytest.approx(np.stack([run.angle[0], run.velocity[0]], axis=1), abs=1e-9)
        assert points.standard_error == pytest.approx(np.zeros((7, 2)), abs=1e-12)


def test_both_readings_agree_on_a_linear_map():
    """The mean of a linear map's images is the image of the mean: cosh and sinh of the time. 4 standard errors."""
    restarted = restarted_poincare_map(FLIGHT, cycles=2, realizations=2000)
    free = mean_poincare_map(simulate(FLIGHT, cycles=2, realizations=2000))
    x, v = restarted.points[0] - [1.0, 0.0]
    assert np.abs((restarted.points[0] - [0.7, 0.1]) / restarted.standard_error[0]).max() < 4.0
    t = FLIGHT.period * np.arange(3)
    exact = np.stack([1.0 + x * np.cosh(t) + v * np.sinh(t), x * np.sinh(t) + v * np.cosh(t)], axis=1)
    assert restarted.points == pytest.approx(exact, abs=1e-8)
    assert free.points == pytest.approx(exact, abs=1e-8)
    assert np.all(restarted.standard_error[:2] > 1e-4)
    assert restarted.standard_error[2] == pytest.approx([0.0, 0.0], abs=1e-12)


@pytest.mark.parametrize("scene", [MAIN, WHITE])
def test_restart_is_one_cycle_from_the_mean(scene):
    """The second image against a fresh ensemble that starts at the first: 4.5 standard errors, 4 x 7e-6."""
    restarted = restarted_poincare_map(scene, cycles=2, realizations=2000)
    again = dataclasses.replace(scene, start=Start(*restarted.points[1]))
    fresh = mean_poincare_map(simulate(again, cycles=1, realizations=2000, seed=9))
    error = np.hypot(restarted.standard_error[2], fresh.standard_error[1])
    assert np.abs((restarted.points[2] - fresh.points[1]) / error).max() < 4.5
    free = mean_poincare_map(simulate(scene, cycles=2, realizations=2000))
    assert np.array_equal(free.points[:2], restarted.points[:2])
    assert np.abs(free.points[2] - restarted.points[2]).max() > 10.0 * error.max()


@pytest.mark.parametrize("scene", [MAIN, WHITE])
def test_noise_goes_on_through_a_restart(scene):
    """The third image is that of the cycle from 2 T to 3 T in the same realizations."""
    restarted = restarted_poincare_map(scene, cycles=3, realizations=100, overturned="left out")
    again = dataclasses.replace(scene, start=Start(*restarted.points[2]))
    means = []
    for cycle in (0, 2):
        parts = batches.simulate_batches(batches.checked_run(again, 1, 100, 1, None, 200), cycle=cycle)
        means.append(np.nanmean(np.concatenate([batch.angle[:, 1] for batch in parts])))
    assert restarted.points[3, 0] == pytest.approx(means[1], abs=1e-12)
    assert abs(means[0] - means[1]) > 1e-6


@pytest.mark.parametrize(
    ("angles", "rule", "mean", "error", "counted"),
    [
        ((0.1, 0.3), "left out", (0.2, 0.5), (0.1, 0.5), 2),
        ((0.1, np.nan), "left out", (0.1, 0.0), (np.nan, np.nan), 1),
        ((np.nan, np.nan), "left out", (np.nan, np.nan), (np.nan, np.nan), 0),
        ((0.1, np.nan), "clamped", (-0.7, 0.0), (0.8, 0.0), 2),
    ],
)
def test_the_mean_of_few_states_and_its_standard_error(angles, rule, mean, error, counted):
    angle, velocity, side = np.array(angles), np.array([0.0, 1.0]), np.array([0, -1])
    estimate = poincare.mean_state(angle, velocity, side, 1.5, rule)
    assert estimate[0] == pytest.approx(mean, nan_ok=True)
    assert estimate[1] == pytest.approx(error, nan_ok=True)
    assert estimate[2] == counted


def test_restart_ends_where_all_have_overturned():
    scene = dataclasses.replace(ORBIT, start=Start(-1.2, -1.0))
    clamped = restarted_poincare_map(scene, cycles=3, realizations=4)
    assert clamped.points[1:].tolist() == [[-math.pi / 2, 0.0]] * 3
    assert clamped.standard_error.tolist() == [[0.0, 0.0]] * 4
    left_out = restarted_poincare_map(scene, cycles=3, realizations=4, overturned="left out")
    assert np.isnan(left_out.points[1:]).all()
    assert left_out.counted.tolist() == [4, 0, 0, 0]


def test_first_passage_integrates_to_the_overturned(ensemble):
    edges = np.linspace(0.0, 8.0 * MAIN.period, 33)
    passage = first_passage(ensemble, edges)
    by_cycle = (passage.density * np.diff(edges)).reshape(8, 4).sum(axis=1)
    assert np.cumsum(by_cycle) == pytest.approx(1.0 - ensemble.survival[1:], abs=1e-12)
    assert passage.counts.sum() == np.count_nonzero(ensemble.overturn_side)
    assert np.all(passage.interval[:, 0] <= passage.density)
    assert np.all(passage.interval[:, 1] > passage.density)


def test_first_passage_intervals_cover():
    """Those of 150 parts of an ensemble hold its whole: 0.949 ± 0.011 over 12 seeds, bounds four deviations away."""
    edges = MAIN.period * np.arange(2.0, 9.0)
    large = simulate(MAIN, cycles=8, realizations=30_000, seed=7)
    truth, held = first_passage(large, edges).density, []
    for part in np.split(large.overturn_time, 150):
        low, high = first_passage(dataclasses.replace(large, overturn_time=part), edges).interval.T
        held.append((low <= truth) & (truth <= high))
    assert 0.905 < np.mean(held) < 0.993


def with_impacts(run, chosen):
    """The same histories with other impacts: a mask, or indices with repetitions."""
    names = ("impact_realization", "impact_time", "impact_velocity")
    return dataclasses.replace(run, **{name: getattr(run, name)[chosen] for name in names})


def test_impact_speed_intervals_cover():
    """Those of 150 parts hold the whole: 0.967 ± 0.006 over 12 seeds, bounds four deviations away."""
    edges = np.array([0.0, 0.5, 1.0, 1.5, 2.0, 2.25, 2.5, 3.0])
    large = histories(MAIN, cycles=4, realizations=6000, seed=8, samples_per_cycle=1)
    truth, held = impact_speeds(large, edges).density, []
    assert truth @ np.diff(edges) == pytest.approx(1.0, abs=1e-12)
    for part in range(150):
        low, high = impact_speeds(with_impacts(large, large.impact_realization % 150 == part), edges).interval.T
        held.append((low <= truth) & (truth <= high))
    assert 0.945 < np.mean(held) < 0.989


def test_impacts_that_repeat_each_other_tell_nothing_new():
    """Each impact listed four times: intervals of independent impacts would be half as wide."""
    run = histories(MAIN, cycles=2, realizations=500, samples_per_cycle=1)
    repeated = with_impacts(run, np.repeat(np.arange(run.impact_time.size), 4))
    edges = np.array([0.0, 0.5, 1.5, 2.25, 3.0])
    once, often = impact_speeds(run, edges), impact_speeds(repeated, edges)
    assert often.density == pytest.approx(once.density, abs=1e-12)
    assert np.all(np.diff(often.interval) > 0.75 * np.diff(once.interval))


def test_an_empty_bin_has_an_interval():
    run = histories(MAIN, cycles=1, realizations=20, samples_per_cycle=1)
    speeds = impact_speeds(run, [50.0, 51.0, 53.0])
    assert speeds.counts.tolist() == [0, 0]
    z = 1.959963984540054
    assert speeds.interval == pytest.approx(np.array([[0.0, 1.0], [0.0, 0.5]]) * z * z / (20 + z * z))


def test_bin_errors_are_the_binomial_ones():
    """Spread of 400 counts against the formula within 15 %, 4 standard errors of a standard deviation."""
    rng, truth = np.random.default_rng(1), np.array([0.5, 0.1, 0.02])
    spread = np.std(rng.binomial(2000, truth, (400, 3)) / 2000, axis=0)
    assert bin_errors(truth, 2000) == pytest.approx(spread, rel=0.15)
    assert bin_errors([0.0, 1.0], 99) == pytest.approx([0.005, 0.005])


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda e: mean_poincare_map(e, "dropped"), ValueError, "overturned: got 'dropped', accepted: 'clamped' or"),
        (lambda e: mean_poincare_map(e.angle), TypeError, r"(?s)ensemble: got array\(.*, accepted: Ensemble"),
        (
            lambda _: restarted_poincare_map(MAIN, cycles=1, realizations=2, overturned=None),
            ValueError,
            "overturned: got None",
        ),
        (lambda _: restarted_poincare_map(MAIN, cycles=0, realizations=2), ValueError, "cycles: got 0"),
        (lambda e: first_passage(e, [1.0]), ValueError, "edges: got .*, accepted: two or more finite"),
        (lambda e: first_passage(e, [1.0, 1.0]), ValueError, "edges: got .*, accepted: two or more finite"),
        (lambda e: first_passage(e, [0.0, 1.0], level=1.0), ValueError, "level: got 1.0"),
        (lambda e: impact_speeds(e, [0.0, 1.0]), TypeError, "(?s)histories: got .*, accepted: Histories"),
        (
            lambda _: impact_speeds(histories(ORBIT, cycles=1), [0.0, 1.0]),
            ValueError,
            "histories: realizations with an impact: got 1, accepted: at least 2",
        ),
        (lambda _: bin_errors([0.5], 0), ValueError, "realizations: got 0"),
    ],
)
def test_refusals_name_the_parameter(ensemble, call, error, message):
    with pytest.raises(error, match=message):
        call(ensemble)


def test_certain_overturning_falls_into_its_bin():
    """x - 1 = 0.3 cosh t + 0.5 sinh t passes 0.4 at 0.179."""
    scene = dataclasses.replace(FLIGHT, start=Start(1.3, 0.5), overturning=Overturning(1.4))
    passage = first_passage(simulate(scene, cycles=1, realizations=5), [0.0, 0.17, 0.19, 0.6])
    assert passage.counts.tolist() == [0, 5, 0]
    assert passage.density == pytest.approx([0.0, 50.0, 0.0])
