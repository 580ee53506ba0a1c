"""Tallies as results: the counts of the ensemble they stand for, moments, bins, refusals; beside other results."""

import dataclasses
import math

import fakes
import numpy as np
import pytest

from fpk_rocking.compare import compare
from fpk_rocking.results import storage
from fpk_rocking.scene import Block, Harmonic, NoNoise, Scene, Start, WhiteNoise
from fpk_rocking.scene.axes import joint_edges
from montecarlo import Tally, simulate, tally
from montecarlo.engines import batches
from montecarlo.results import counts

MAIN = Scene(Block(0.5), Harmonic(4.6, 2.7, math.pi), WhiteNoise(0.002 * math.pi))
SIZE = {"cycles": 6, "realizations": 3000}


def content(result):
    return [array.tobytes() for array in result.counts]


def batch_of(first, angle, velocity):
    count = len(angle)
    ends, returns = np.full(count, math.nan), np.zeros(2, int)
    return batches.Batch(first, angle, velocity, ends, np.zeros(count, np.int8), None, returns)


@pytest.fixture(scope="module")
def ensemble():
    return simulate(MAIN, **SIZE)


@pytest.fixture(scope="module")
def counted():
    return tally(MAIN, **SIZE)


def test_counts_are_those_of_the_ensemble(counted, ensemble):
    assert 0.5 < ensemble.survival[6] < 0.9
    assert (counted.realizations, counted.cycles) == (ensemble.realizations, ensemble.cycles)
    assert (counted.scene, counted.method, counted.seed, counted.steps_per_cycle) == (MAIN, "white", 1, 200)
    for name in ("survivors", "survival", "overturned"):
        assert np.array_equal(getattr(counted, name), getattr(ensemble, name)), name
    assert np.array_equal(counted.survival_interval(0.9), ensemble.survival_interval(0.9))
    assert np.array_equal(counted.counts.standing, ensemble.survivors)


def test_bins_are_those_of_the_ensemble(counted, ensemble):
    edges = joint_edges(MAIN)
    halves = [np.linspace(values[0], values[-1], 2 * values.size - 1) for values in edges]
    rough = np.array([-1.6, -0.3, 0.0, 1.6]), np.array([-3.2, 0.1, 3.2])
    part = np.array([-0.5, 0.25, 0.3]), np.array([0.1, 0.2])
    for cycle in range(7):
        for wanted in (edges, halves, rough, part):
            assert np.array_equal(counted.bin_probabilities(cycle, *wanted), ensemble.bin_probabilities(cycle, *wanted))
        assert counted.bin_probabilities(cycle, *edges).sum() == pytest.approx(counted.survival[cycle], abs=1e-15)
    assert np.all(counted.outside == 0.0)


def test_own_bins_leave_some_outside(ensemble):
    edges = np.array([-0.7, -0.1, 0.4]), np.array([-1, 0, 1, 2])
    own = tally(MAIN, **SIZE, angle_edges=edges[0], velocity_edges=edges[1])
    for cycle in (1, 6):
        bins = ensemble.bin_probabilities(cycle, *edges)
        assert np.array_equal(own.bin_probabilities(cycle, *edges), bins)
        assert own.outside[cycle] == pytest.approx(ensemble.survival[cycle] - bins.sum(), abs=1e-15)
        assert own.outside[cycle] > 0.01


def test_states_on_edges_are_binned_as_numpy_does():
    """A block at rest is at the common edge of four bins; the last bins are closed on both sides."""
    scene = Scene(Block(0.5), Harmonic(0.5, 2.7), NoNoise())
    rest, truth = tally(scene, cycles=2, realizations=3), simulate(scene, cycles=2, realizations=3)
    edges = joint_edges(scene)
    assert np.array_equal(rest.bin_probabilities(2, *edges), truth.bin_probabilities(2, *edges))
    last = [-0.1, 0.0]
    assert tally(scene, cycles=1, realizations=3, angle_edges=last).bin_probabilities(1, last, edges[1]).sum() == 1.0


def test_moments_are_those_of_the_ensemble(counted, ensemble):
    """Within 8 standard deviations of what rounding does: q/√12 to a state, 2 q/√12 times its size to a square."""
    quantum = counted.counts.quantum
    assert quantum.tolist() == [2.0**-30, 2.0**-26]
    for cycle in range(1, 7):
        standing = np.isfinite(ensemble.angle[:, cycle])
        points = np.stack([ensemble.angle[standing, cycle], ensemble.velocity[standing, cycle]])
        rounding = 8.0 * quantum / math.sqrt(12.0 * points.shape[1])
        assert np.all(np.abs(counted.mean[cycle] - points.mean(axis=1)) < rounding)
        assert np.abs(counted.covariance[cycle] - np.cov(points, bias=True)).max() < 2.0 * points.std() * rounding.max()
    assert np.all(counted.mean[0] == 0.0)


def test_threads_lose_no_state():
    """Adding to one bin from several threads at once would lose some of the 3e5 states."""
    scene = dataclasses.replace(MAIN, start=Start(0.3, 0.2))
    totals = counts.empty_counts(scene, scene.period * np.arange(4), *joint_edges(scene))
    states = np.full((2, 300_000, 4), [[[0.3]], [[0.2]]])
    counts.add(totals, batch_of(0, *states))
    assert totals.standing.tolist() == [300_000] * 4
    assert totals.histogram.max(axis=(1, 2)).tolist() == [300_000] * 4


def test_moments_of_a_point_and_of_nothing():
    """No spread at the start, to the last bit; nan where none stands."""
    scene = dataclasses.replace(MAIN, start=Start(-1.2, -1.0))
    overturned = tally(scene, cycles=1, realizations=70)
    assert overturned.mean[0] == pytest.approx([-1.2, -1.0], abs=2e-8)
    assert np.all(overturned.covariance[0] == 0.0)
    assert overturned.survival.tolist() == [1.0, 0.0]
    assert np.isnan(overturned.mean[1]).all()
    assert np.isnan(overturned.covariance[1]).all()


def test_first_passages_are_those_of_the_ensemble(counted, ensemble):
    edges = np.arange(6 * 20 + 1) * MAIN.period / 20
    for column, side in enumerate((-1, 1)):
        times = ensemble.overturn_time[ensemble.overturn_side == side]
        assert np.array_equal(counted.counts.passages[1:, column], np.histogram(times, edges)[0])
    assert np.array_equal(np.cumsum(counted.counts.passages, axis=0)[::20], np.rint(ensemble.overturned * 3000))
    assert counted.first_passage.sum() == pytest.approx(1.0 - counted.survival[6])


def test_a_start_beyond_the_cut_off_is_counted_first():
    start = Start(1.5, 0.0, ((1e-2, 0.0), (0.0, 1e-6)))
    asked = {"scene": dataclasses.replace(MAIN, start=start), "cycles": 1, "realizations": 100}
    left, right = tally(**asked).counts.passages[0]
    assert [left, right] == [0, np.count_nonzero(simulate(**asked).overturn_time == 0.0)]
    assert 5 < right < 50


@pytest.mark.parametrize("states", [[(1, -1)], [(2**31, 2**31)], [(2**31, -(2**31)), (-(2**31), 2**31 - 1)]])
def test_the_largest_tally_does_not_overflow(states):
    """As many copies of a state as a tally takes: the mean is exact, and so is the covariance."""
    empty = counts.empty_counts(MAIN, MAIN.period * np.arange(2), *joint_edges(MAIN))
    angle, velocity = np.ascontiguousarray((np.array(states) * empty.quantum).T)
    batch = batch_of(0, angle[:, None], velocity[:, None])
    counts.add(counts.Counts(*empty[:4], *(array[:1] for array in empty[4:])), batch)
    many = counts.LARGEST // len(states)
    grown = [array * array.dtype.type(many) for array in empty[4:]]
    mean, covariance = counts.moments(counts.Counts(*empty[:4], *grown))
    assert grown[0][0] == many * len(states)
    points = np.stack([angle, velocity])
    assert mean[0].tolist() == points.mean(axis=1).tolist()
    assert covariance[0] == pytest.approx(np.cov(points, bias=True) if len(states) > 1 else np.zeros((2, 2)), rel=1e-15)


def test_a_wild_state_is_refused_before_anything_is_counted():
    empty = counts.empty_counts(MAIN, MAIN.period * np.arange(2), *joint_edges(MAIN))
    angle, velocity = np.zeros((2, 2)), np.array([[0.0, 0.0], [0.0, 33.0]])
    with pytest.raises(
        ValueError, match=r"realizations: got a block .* velocity 2 and 32 among those from number 64 on"
    ):
        counts.add(empty, batch_of(64, angle, velocity))
    assert all(not array.any() for array in empty[4:])


@pytest.mark.parametrize(
    ("edges", "message"),
    [
        (
            [0.0, 0.03],
            r"angle_edges: got 0\.03, accepted: two or more of the 65 edges kept, .* -1\.6 to 1\.6 .* 0\.05;",
        ),
        ([0.0, 1.7], r"angle_edges: got 1\.7"),
        ([0.0, math.nan], r"angle_edges: got .*nan.*, accepted: two or more numbers"),
        ([0.1, 0.0], r"angle_edges: got \[0\.1, 0\.0\]"),
        ([0.1, 0.1], r"angle_edges: got \[0\.1, 0\.1\]"),
        ([0.1], "angle_edges: got"),
        (32, "angle_edges: got"),
    ],
)
def test_edges_that_are_not_kept_are_refused(counted, edges, message):
    with pytest.raises(ValueError, match=message):
        counted.bin_probabilities(1, edges, [-1.0, 1.0])


@pytest.mark.parametrize(
    ("changed", "error", "message"),
    [
        (
            {"realizations": 2**31},
            ValueError,
            "realizations: got 2147483648, accepted: a whole number from 1 to 21474836",
        ),
        ({"realizations": 0}, ValueError, "realizations: got 0"),
        ({"cycles": 20_000}, ValueError, "cycles: got 20000, accepted: 1 to 16383 with 64 x 128 bins, more with fewer"),
        ({"angle_edges": [0.0, 0.0]}, ValueError, r"angle_edges: got \[0\.0, 0\.0\], accepted: two or more finite"),
        ({"angle_edges": [0.0, math.inf]}, ValueError, "angle_edges: got"),
        ({"velocity_edges": 10}, ValueError, "velocity_edges: got 10"),
        ({"velocity_edges": "ab"}, TypeError, "velocity_edges: got 'ab'"),
        ({"method": "rk4"}, ValueError, "method: got 'rk4'"),
    ],
)
def test_refusals_name_the_parameter(changed, error, message):
    with pytest.raises(error, match=message):
        tally(MAIN, **{"cycles": 1, "realizations": 1} | changed)


def test_an_ensemble_that_does_not_fit_is_sent_here():
    with pytest.raises(
        ValueError, match=r"realizations: got 1000000000, accepted: .* 4 GiB of states; a tally keeps counts"
    ):
        simulate(MAIN, cycles=10, realizations=10**9)


@pytest.mark.parametrize(("cycle", "rows"), [(1, "cycles"), (16, "cycles x 16")])
def test_a_run_that_does_not_fit_tells_what_it_counts(cycle, rows):
    run = batches.checked_run(MAIN, 10, 10**8, 1, None, 200)
    with pytest.raises(ValueError, match=rf"accepted: realizations x \({rows} \+ 1\) <= \d+, 4 GiB of states$"):
        batches.refuse_large(run, cycle)


def test_a_tally_compares_as_the_ensemble_does(counted, ensemble):
    against = fakes.FakeEvolution(MAIN, cycles=6)
    compared, truth = compare(counted, against).summary(), compare(ensemble, against).summary()
    assert compared["names"] == ["Monte Carlo white", "Fokker-Planck density"]
    for values in (compared, truth):
        values.pop("wall_s")
    assert compared == truth
    with pytest.raises(ValueError, match="cycle: got 7, accepted: a whole number from 0 to 6"):
        counted.bin_probabilities(7, *joint_edges(MAIN))


def test_a_saved_tally_comes_back(counted, tmp_path):
    counted.save(tmp_path / "tally.npz")
    loaded = Tally.load(tmp_path / "tally.npz")
    assert storage.result_kind(tmp_path / "tally.npz") == "tally"
    assert loaded.scene == MAIN
    assert content(loaded) == content(counted)
    assert loaded.wall_s == counted.wall_s
    with pytest.raises(ValueError, match="read-only"):
        loaded.counts.standing[0] = 1
