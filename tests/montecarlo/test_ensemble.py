"""Ensembles as results: counts, bins, files, refusals; and the statistics of survival."""

import dataclasses
import math
import pathlib

import numpy as np
import pytest
from scipy import stats
from two_samples import survival_test

from fpk_rocking.results.sampling import wilson_interval
from fpk_rocking.scene.scene import load_scene
from montecarlo import Ensemble, correlation_dimension, simulate

SCENE = load_scene(pathlib.Path(__file__).parents[2] / "cases" / "scenes" / "main.toml")


@pytest.fixture(scope="module")
def ensemble():
    return simulate(SCENE, cycles=8, realizations=300, steps_per_cycle=40)


def test_counts_agree_with_each_other(ensemble):
    assert ensemble.survival[0] == 1.0
    assert 0.3 < ensemble.survival[8] < 0.9
    assert ensemble.survival + ensemble.overturned.sum(axis=1) == pytest.approx(1.0, abs=1e-15)
    assert np.all(np.diff(ensemble.overturned, axis=0) >= 0.0)
    by_time = [np.mean(~(ensemble.overturn_time <= k * SCENE.period)) for k in range(9)]
    assert ensemble.survival.tolist() == by_time
    assert np.array_equal(ensemble.overturn_side == 0, np.isnan(ensemble.overturn_time))
    assert (ensemble.realizations, ensemble.cycles) == (300, 8)


def test_what_is_at_rest_has_angle_and_velocity_0():
    values = np.array([[0.0, 0.0, 0.0, np.nan], [0.0, 0.2, 0.0, 0.1]])
    ensemble = simulate(SCENE, cycles=3, realizations=2)
    still = dataclasses.replace(ensemble, angle=values, velocity=np.array([[0.0, 0.0, 0.3, np.nan], [0.0] * 4]))
    assert still.at_rest.tolist() == [1.0, 0.5, 0.5, 0.0]


def test_bins_sum_to_the_survival(ensemble):
    edges = np.linspace(-1.6, 1.6, 33), np.linspace(-4.0, 4.0, 41)
    for cycle in (0, 8):
        bins = ensemble.bin_probabilities(cycle, *edges)
        assert bins.shape == (32, 40)
        assert bins.sum() == pytest.approx(ensemble.survival[cycle], abs=1e-12)
    with pytest.raises(ValueError, match="cycle: got 9, accepted: a whole number from 0 to 8"):
        ensemble.bin_probabilities(9, *edges)


def test_a_saved_ensemble_comes_back(ensemble, tmp_path):
    ensemble.save(tmp_path / "ensemble.npz")
    loaded = Ensemble.load(tmp_path / "ensemble.npz")
    assert loaded.scene == SCENE
    for name in ("angle", "velocity", "overturn_time", "overturn_side"):
        assert getattr(loaded, name).tobytes() == getattr(ensemble, name).tobytes()
    for name in ("method", "seed", "steps_per_cycle", "wall_s"):
        assert getattr(loaded, name) == getattr(ensemble, name)
    with pytest.raises(ValueError, match="read-only"):
        loaded.angle[0, 0] = 1.0


def test_progress_is_told_and_may_interrupt():
    reports = []
    simulate(SCENE, cycles=1, realizations=6000, steps_per_cycle=8, progress=lambda *counts: reports.append(counts))
    assert reports[-1] == (6000, 6000)
    assert len(reports) > 1
    assert sorted(reports) == reports

    def interrupt(*_):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        simulate(SCENE, cycles=1, realizations=6000, steps_per_cycle=8, progress=interrupt)


@pytest.mark.parametrize(
    ("changed", "error", "message"),
    [
        ({"realizations": 0}, ValueError, "realizations: got 0, accepted: a whole number >= 1"),
        ({"realizations": 10.0}, TypeError, "realizations: got 10.0, accepted: a whole number >= 1"),
        ({"cycles": 0}, ValueError, "cycles: got 0, accepted: a whole number from 1 to"),
        ({"cycles": True}, TypeError, "cycles: got True"),
        ({"steps_per_cycle": 7}, ValueError, "steps_per_cycle: got 7, accepted: a whole number from 8 to"),
        ({"steps_per_cycle": 8.5}, TypeError, "steps_per_cycle: got 8.5"),
        ({"seed": -1}, ValueError, "seed: got -1, accepted: a whole number from 0 to 18446744073709551615"),
        ({"seed": "one"}, TypeError, "seed: got 'one'"),
        ({"method": "euler"}, ValueError, "method: got 'euler', accepted: 'exact', 'rk4', 'white', 'filtered' or None"),
        (
            {"method": "white"},
            ValueError,
            r"method: got 'white', accepted: 'exact' or 'rk4' for .*'band'; .*white_equivalent\(\)",
        ),
    ],
)
def test_refusals_name_the_parameter(changed, error, message):
    with pytest.raises(error, match=message):
        simulate(SCENE, **{"cycles": 1, "realizations": 1} | changed)


def test_rk4_refuses_white_noise_and_anything_but_a_scene():
    with pytest.raises(ValueError, match="method: got 'rk4', accepted: 'white' for noise of kind 'white'"):
        simulate(SCENE.white_equivalent(), cycles=1, realizations=1, method="rk4")
    with pytest.raises(TypeError, match=r"scene: got 'main\.toml', accepted: Scene"):
        simulate("main.toml", cycles=1, realizations=1)


def test_wilson_interval_at_known_counts():
    """Values of the closed form; 5 of 10 from E. B. Wilson's formula by hand: (0.2366, 0.7634)."""
    intervals = wilson_interval([0, 5, 10], 10)
    z = 1.959963984540054
    assert intervals[0] == pytest.approx([0.0, z * z / (10 + z * z)])
    assert intervals[1] == pytest.approx([0.2366, 0.7634], abs=5e-5)
    assert intervals[2] == pytest.approx([10 / (10 + z * z), 1.0])
    with pytest.raises(ValueError, match=r"level: got 1\.0, accepted: a number above 0 and below 1"):
        wilson_interval(5, 10, 1.0)


def test_wilson_interval_covers_at_its_level():
    """Exact coverage at p = 0.3, n = 200: the binomial weight of the counts whose interval holds p."""
    counts = np.arange(201)
    low, high = wilson_interval(counts, 200, 0.9).T
    log_choose = np.array([math.lgamma(201) - math.lgamma(k + 1) - math.lgamma(201 - k) for k in counts])
    weight = np.exp(log_choose + counts * math.log(0.3) + (200 - counts) * math.log(0.7))
    assert weight[(low <= 0.3) & (high >= 0.3)].sum() == pytest.approx(0.9, abs=0.015)


def test_survival_test_is_fishers():
    outcome = survival_test([3, 9, 10], 10, [9, 3, 12], 12)
    smaller = [stats.fisher_exact([[3, 9], [7, 3]], side).pvalue for side in ("less", "greater")]
    assert outcome.p_values[0] == pytest.approx(2.0 * min(smaller))
    assert outcome.p_values[2] == 1.0


def test_survival_test_has_its_level_and_its_power():
    """200 families of one law at familywise 95 %: more than 20 alarms has probability 1e-3. A shift is found."""
    rng = np.random.default_rng(3)
    law = 0.9 ** np.arange(1, 11)
    alarms = 0
    for _ in range(200):
        first, second = (np.sum(rng.random((n, 1)) < law, axis=0) for n in (2000, 5000))
        alarms += not survival_test(first, 2000, second, 5000, 0.95).agrees
    assert alarms <= 20
    shifted = np.rint(5000 * (law - 0.06 * law * (1.0 - law) * 4.0)).astype(int)
    outcome = survival_test(np.rint(2000 * law).astype(int), 2000, shifted, 5000)
    assert not outcome.agrees
    assert outcome.level == pytest.approx(1e-4)


def test_correlation_dimension_of_known_sets():
    """A line and a filled square, ends and edges included, and Sierpinski's triangle, log 3 / log 2; fixed seed."""
    rng = np.random.default_rng(5)
    line = np.outer(rng.random(20_000), [0.6, 0.8])
    square = rng.random((20_000, 2))
    triangle = np.zeros((20_000, 2))
    corners = np.array([(0.0, 0.0), (1.0, 0.0), (0.5, 1.0)])
    for _ in range(40):
        triangle = 0.5 * (triangle + corners[rng.integers(3, size=20_000)])
    lengths = np.array([0.0125, 0.05])
    on_line = np.diff(np.log(2.0 * lengths - lengths**2))[0] / math.log(4.0)
    in_square = np.diff(np.log(math.pi * lengths**2 - 8.0 / 3.0 * lengths**3 + 0.5 * lengths**4))[0] / math.log(4.0)
    for points, dimension, margin in (
        (line, on_line, 0.005),
        (square, in_square, 0.01),
        (triangle, math.log2(3.0), 0.03),
    ):
        assert correlation_dimension(points, *lengths) == pytest.approx(dimension, abs=margin)
    few = np.array([(0.0, 0.0), (1.0, 0.0), (np.nan, 0.0)])
    assert math.isnan(correlation_dimension(few, 0.1, 2.0))
    with pytest.raises(ValueError, match=r"longest: got 0.1, accepted: a finite number > 0.1"):
        correlation_dimension(line, 0.1, 0.1)
    with pytest.raises(ValueError, match=r"points: got 'an array of shape \(3,\)', accepted"):
        correlation_dimension([1.0, 2.0, 3.0], 0.1, 0.2)
