"""Ensembles and histories as results: counts, bins, files, refusals; and the statistics of survival."""

import dataclasses
import math
import pathlib

import numpy as np
import pytest
from scipy import stats
from two_samples import survival_test

from fpk_rocking.envelopes import Table
from fpk_rocking.physics.motion import TERMS
from fpk_rocking.physics.motion.equation import block_of_scene, segment_from_particular
from fpk_rocking.physics.motion.events import ImpactRecord, advance_through_events
from fpk_rocking.results.sampling import wilson_interval
from fpk_rocking.scene import (
    BandNoise,
    Block,
    FilteredNoise,
    Harmonic,
    NoNoise,
    Overturning,
    Pulse,
    Scene,
    Start,
    load_scene,
)
from montecarlo import Ensemble, Histories, correlation_dimension, first_passage, histories, overturning_rate, simulate
from montecarlo.engines import batches

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


SCENES = pathlib.Path(__file__).parents[2] / "cases" / "scenes"
MAIN = load_scene(SCENES / "main.toml")
WHITE = MAIN.white_equivalent()
ORBIT = dataclasses.replace(load_scene(SCENES / "fig05.toml"), noise=NoNoise())


def exact(scene, x, v, side, times):
    """States at ascending times and the impacts up to the last, by closed-form flights of the noise-free motion."""
    forcing, t = scene.forcing, 0.0
    impacts, states = ImpactRecord(np.zeros(1, np.int64), np.empty(200), np.empty(200)), [(x, v)]
    for end in times[1:]:
        while t < end:
            span = min(end - t, 0.1)
            segment = segment_from_particular(forcing.pieces([t])[0], np.empty(TERMS), span)
            numbers = (0.0, span, block_of_scene(scene), impacts, t)
            x, v, side, _ = advance_through_events(x, v, side, segment, *numbers)
            t = end if span < 0.1 else t + span
        states.append((x, v))
    count = impacts.count[0]
    return np.array(states).T, impacts.time[:count], impacts.velocity[:count]


@pytest.mark.parametrize(("method", "samples"), [("rk4", 16), ("rk4", 7), ("exact", 7)])
def test_states_and_impacts_are_those_of_the_exact_motion(method, samples):
    """Between steps too: 7 samples do not fit 400 steps. Two cycles, before small errors have grown."""
    run = histories(ORBIT, cycles=2, method=method, steps_per_cycle=400, samples_per_cycle=samples)
    states, time, velocity = exact(ORBIT, 0.0, 0.0, 1, run.time)
    assert run.time == pytest.approx(np.arange(2 * samples + 1) * ORBIT.period / samples)
    assert run.angle[0] == pytest.approx(states[0], abs=1e-7)
    assert run.velocity[0] == pytest.approx(states[1], abs=1e-7)
    assert run.impacts.tolist() == [time.size]
    assert run.impact_time == pytest.approx(time, abs=1e-7)
    assert run.impact_velocity == pytest.approx(velocity, abs=1e-7)
    assert time.size == 3


@pytest.mark.parametrize(
    ("scene", "method", "samples"),
    [(MAIN, "rk4", 100), (MAIN, "rk4", 7), (MAIN, "exact", 100), (MAIN, "exact", 7), (WHITE, "white", 16)],
)
def test_realizations_are_those_of_an_ensemble(scene, method, samples):
    asked = {"cycles": 6, "realizations": 80, "seed": 4, "method": method, "steps_per_cycle": 100}
    run, ensemble = histories(scene, samples_per_cycle=samples, **asked), simulate(scene, **asked)
    for own, other in zip(run.poincare(), (ensemble.angle, ensemble.velocity), strict=True):
        assert own.tobytes() == other.tobytes()
    assert run.overturn_time.tobytes() == ensemble.overturn_time.tobytes()
    assert run.overturn_side.tobytes() == ensemble.overturn_side.tobytes()
    standing = run.time <= np.where(np.isnan(run.overturn_time), np.inf, run.overturn_time)[:, None]
    assert np.array_equal(np.isfinite(run.angle), standing)
    assert 0 < np.count_nonzero(run.overturn_side) < 80
    assert (run.realizations, run.cycles) == (80, 6)


PIECES = Table((0.0, 0.31, 0.32, 1.7, 3.1), (1.0, 1.5, 0.3, 1.0, 0.5))


@pytest.mark.parametrize(
    ("scene", "method"),
    [
        (MAIN, "rk4"),
        (MAIN, "exact"),
        (WHITE, "white"),
        (MAIN.varied(noise=BandNoise(0.04, (0.0, 10.0), 20, envelope=PIECES)), "exact"),
        (MAIN.varied(noise=FilteredNoise("low-pass", 0.04, 6.0, 0.7, PIECES)), "filtered"),
    ],
    ids=["rk4", "exact", "white", "enveloped", "filtered"],
)
def test_every_impact_turns_the_side(scene, method):
    """Between two samples the side has changed as often as there were impacts, and each impact is from its side."""
    run = histories(scene, cycles=3, realizations=50, method=method, samples_per_cycle=64)
    for r in range(50):
        mine = run.impact_realization == r
        time, velocity = run.impact_time[mine], run.impact_velocity[mine]
        assert np.all(np.diff(time) >= 0.0)
        assert np.all(velocity[1:] * velocity[:-1] <= 0.0)
        angle = run.angle[r][np.isfinite(run.angle[r])]
        times = run.time[: angle.size]
        before = np.searchsorted(time, times, side="right")
        odd = np.diff(before) % 2 == 1
        apart = (np.abs(angle[1:]) > 1e-3) & (np.abs(angle[:-1]) > 1e-3)
        assert np.array_equal((angle[1:] * angle[:-1] < 0.0)[apart], odd[apart])


def test_no_impact_is_dropped_where_there_are_many():
    """A block rattles at 1e4 impacts a cycle or so: more than there is space for at first."""
    scene = Scene(Block(0.999), Harmonic(0.0, 0.05), NoNoise(), Start(1e-4))
    few = next(batches.simulate_batches(batches.checked_run(scene, 1, 2, 1, None, 400), capacity=3)).impacts
    run = histories(scene, cycles=1, realizations=2, steps_per_cycle=400)
    assert few.count.tolist() == run.impacts.tolist()
    assert run.impacts[0] > 1000
    assert np.array_equal(few.time[0], run.impact_time[:3])
    # Two flights of one speed under the force 1 take 2 w each: the second impact comes at 3 sqrt(2 x0).
    assert run.impact_time[:2] == pytest.approx([math.sqrt(2e-4), 3.0 * math.sqrt(2e-4)], rel=2e-3)
    assert np.abs(run.impact_velocity[0]) == pytest.approx(math.sqrt(2e-4), rel=1e-3)


def test_no_impact_is_dropped_where_one_realization_has_more_than_there_is_room_for():
    """There is room for 16 in a cycle at first."""
    scene = Scene(Block(0.9), Harmonic(1.2, 1.0), BandNoise(0.1, (0.0, 6.0), 20))
    run = histories(scene, cycles=1, realizations=20, samples_per_cycle=1)
    assert run.impacts.min() < 16 < run.impacts.max()
    (roomy,) = batches.simulate_batches(batches.checked_run(scene, 1, 20, 1, None, 200), capacity=200)
    assert run.angle.tobytes() == roomy.angle.tobytes()
    assert run.impacts.tolist() == roomy.impacts.count.tolist()
    kept = np.isfinite(roomy.impacts.time)
    assert run.impact_time.tobytes() == roomy.impacts.time[kept].tobytes()
    assert run.impact_velocity.tobytes() == roomy.impacts.velocity[kept].tobytes()


@pytest.mark.parametrize("method", ["rk4", "exact"])
def test_a_run_from_a_later_cycle_goes_on_with_the_same_noise(method):
    """Band noise: restarted at kT from where it was, a realization repeats itself, with times from τ = 0."""
    complete = histories(MAIN, cycles=20, realizations=60, seed=3, method=method, samples_per_cycle=1)
    angle, velocity = complete.poincare()
    r = np.flatnonzero(complete.overturn_side == 0)[0]
    for cycle in (1, 5, 18):
        scene = dataclasses.replace(MAIN, start=Start(angle[r, cycle], velocity[r, cycle]))
        run = batches.checked_run(scene, 1, r + 1, 3, method, 200)
        batch = next(batches.simulate_batches(run, r, capacity=50, cycle=cycle))
        assert batch.angle[0, 1] == pytest.approx(angle[r, cycle + 1], abs=1e-9)
        assert batch.velocity[0, 1] == pytest.approx(velocity[r, cycle + 1], abs=1e-9)
        begin, end = cycle * MAIN.period, (cycle + 1) * MAIN.period
        during = (complete.impact_realization == r) & (complete.impact_time >= begin) & (complete.impact_time < end)
        assert batch.impacts.time[0, : batch.impacts.count[0]] == pytest.approx(complete.impact_time[during], abs=1e-9)


@pytest.mark.parametrize("method", ["rk4", "exact"])
def test_a_long_run_from_a_later_cycle_keeps_its_noise(method):
    """Over 50 cycles, in which the noise's rotations are begun anew; weak forcing, so that the start is forgotten."""
    scene = Scene(Block(0.5), Harmonic(0.2, 2.7), BandNoise(0.3, (0.0, 10.0), 40))
    complete = histories(scene, cycles=57, seed=3, method=method, samples_per_cycle=1)
    run = batches.checked_run(scene, 50, 1, 3, method, 200)
    late = next(batches.simulate_batches(run, capacity=1000, cycle=7)).impacts
    late_impacts = complete.impact_time[
        (complete.impact_time > 20.0 * scene.period) & (np.abs(complete.impact_velocity) > 1e-3)
    ]
    time, speed = late.time[0, : late.count[0]], np.abs(late.velocity[0, : late.count[0]])
    other = time[(time > 20.0 * scene.period) & (speed > 1e-3)]
    assert late_impacts.size == other.size > 50
    assert late_impacts == pytest.approx(other, abs=1e-6)
    assert late_impacts[-1] > 50.0 * scene.period


def test_white_paths_of_a_later_cycle_are_others():
    run = batches.checked_run(WHITE, 1, 40, 3, None, 200)
    first, second = (next(batches.simulate_batches(run, cycle=cycle)) for cycle in (0, 1))
    assert not np.any(first.angle[:, 1] == second.angle[:, 1])
    scene = dataclasses.replace(WHITE, start=Start(1.4, 0.8))
    later = next(batches.simulate_batches(batches.checked_run(scene, 1, 40, 3, None, 200), cycle=7))
    assert np.all(later.overturn_time > 7.0 * scene.period)


def test_saved_histories_come_back(tmp_path):
    run = histories(MAIN, cycles=1, realizations=3, steps_per_cycle=20, samples_per_cycle=4)
    run.save(tmp_path / "histories.npz")
    loaded = Histories.load(tmp_path / "histories.npz")
    for field in dataclasses.fields(Histories):
        kept, read = getattr(run, field.name), getattr(loaded, field.name)
        assert read.tobytes() == kept.tobytes() if isinstance(kept, np.ndarray) else read == kept
    with pytest.raises(ValueError, match="read-only"):
        loaded.angle[0, 0] = 1.0


@pytest.mark.parametrize(
    ("changed", "error", "message"),
    [
        ({"samples_per_cycle": 0}, ValueError, "samples_per_cycle: got 0, accepted: a whole number >= 1"),
        ({"samples_per_cycle": 2.5}, TypeError, "samples_per_cycle: got 2.5"),
        ({"realizations": 0}, ValueError, "realizations: got 0"),
        ({"method": "white"}, ValueError, "method: got 'white'"),
    ],
)
def test_refusals_of_histories_name_the_parameter(changed, error, message):
    with pytest.raises(error, match=message):
        histories(MAIN, **{"cycles": 1} | changed)


def test_overturning_ends_a_history():
    scene = dataclasses.replace(ORBIT, start=Start(1.2, 1.0), overturning=Overturning(1.5))
    run = histories(scene, cycles=1, samples_per_cycle=50)
    assert np.array_equal(np.isfinite(run.angle[0]), run.time < run.overturn_time[0])
    assert np.nanmax(run.angle) < 1.5
    assert run.impact_time.size == 0


def own_paths(ensemble):
    """Paths of an ensemble as another integrator would give them: beyond the angle they go on."""
    over, side = np.isnan(ensemble.angle), ensemble.overturn_side[:, None]
    return np.where(over, 2.0 * side, ensemble.angle), np.where(over, side, ensemble.velocity)


def test_an_ensemble_of_own_paths_is_that_of_the_engine(ensemble, tmp_path):
    angle, velocity = own_paths(ensemble)
    own = Ensemble.from_paths(SCENE, angle, velocity, method="mine")
    assert 0.0 < own.survival[-1] < 1.0
    for name in ("times", "angle", "velocity", "overturn_side", "overturned_counts", "survival"):
        np.testing.assert_array_equal(getattr(own, name), getattr(ensemble, name), err_msg=name)
    ended = own.overturn_side != 0
    late = own.overturn_time[ended] - ensemble.overturn_time[ended]
    assert late.min() >= 0.0
    assert late.max() <= SCENE.period
    for refused in (lambda: overturning_rate(own, after=1), lambda: first_passage(own, [0.0, 4.0])):
        with pytest.raises(ValueError, match=r"got 'own paths, whose times of overturning are those of the first"):
            refused()
    assert "mine" in own.title
    own.save(tmp_path / "own.npz")
    np.testing.assert_array_equal(Ensemble.load(tmp_path / "own.npz").angle, own.angle)


def test_own_paths_may_end_in_nan_once_the_block_is_over(ensemble):
    angle, velocity = own_paths(ensemble)
    after = np.cumsum(np.abs(angle) >= 2.0, axis=1) > 1
    lost = Ensemble.from_paths(SCENE, np.where(after, np.nan, angle), np.where(after, np.nan, velocity))
    np.testing.assert_array_equal(lost.overturned_counts, ensemble.overturned_counts)


@pytest.mark.parametrize(
    ("angle", "velocity", "times", "message"),
    [
        ([[0, 1]], [[0, 1, 2]], None, r"shapes \(1, 2\) and \(1, 3\)"),
        ([0, 1], [0, 1], None, "a row for each path"),
        ([[0, np.nan]], [[0, 1]], None, "numbers up to the first state at an angle of ±1.57.* or beyond"),
        ([[0, 1]], [[0, np.inf]], None, "numbers up to the first state at an angle of ±1.57.* or beyond"),
        ([[0, 1], [0.1, 1]], [[0, 1], [0, 1]], None, r"got \[0.1, 0.0\], accepted: the start of the scene, \[0"),
        ([[0, 1]], [[0, 1]], [0, 1], "times"),
    ],
)
def test_own_paths_that_are_no_paths_are_refused(angle, velocity, times, message):
    with pytest.raises(ValueError, match=message):
        Ensemble.from_paths(SCENE, angle, velocity, times)


def test_own_paths_of_a_motion_have_the_times_that_are_given():
    pulse = dataclasses.replace(SCENE, forcing=Pulse("one-sine", 3.0, 3.0), noise=NoNoise())
    own = Ensemble.from_paths(pulse, [[0, 1.0, -1.6]], [[0, 1, -1]], times=[0.0, 2.0, 5.0])
    assert own.overturn_side.tolist() == [-1]
    assert own.overturn_time.tolist() == [5.0]
    assert own.first_overturning == (2.0, 5.0, -1)
    assert own.metadata["outcome"] == "deterministic: overturns to the left between τ = 2 and τ = 5"
    with pytest.raises(ValueError, match="the 3 of the columns"):
        Ensemble.from_paths(pulse, [[0, 1.0, -1.6]], [[0, 1, -1]], times=[2.0, 5.0, 6.0])
