"""Splitting: exact probabilities of a lattice walk, plain ensembles, independent runs at 1e-8, and scores."""

import math

import numpy as np
import oracle
import pytest

from fpk_rocking.base.jit import at_most, kernel, thread_count
from fpk_rocking.physics.motion import CRITICAL_RESTITUTION
from fpk_rocking.scene import BandNoise, Block, Harmonic, NoNoise, Scene, Start, WhiteNoise
from montecarlo import Splitting, simulate, split
from montecarlo.engines.random import open_stream, stream_keys, uniform
from montecarlo.engines.walkers import (
    ScoreTable,
    allocate_population,
    raise_level,
    record_score,
    score_of_state,
    score_table,
)
from montecarlo.tuning import TUNING

REST = Start()
UP = 0.3


def scene_of(diffusion, amplitude=4.6, restitution=0.5, frequency=2.7, start=REST):
    return Scene(Block(restitution), Harmonic(amplitude, frequency, math.pi), WhiteNoise(diffusion), start)


@kernel
def _lattice_score(place, step, top, rough):
    if place == top:
        return math.inf
    return float(place // 2 + step % 3) if rough else float(place)


@kernel
def _lattice(keys, walkers, steps, top, rough, estimates, extinct):
    """Split a walk on 0 ... top, one up with probability UP, else one down if it can, up to its first visit of top."""
    for repeat in range(estimates.shape[0]):
        stream = open_stream(keys, repeat)
        population = allocate_population(walkers, steps)
        for i in range(walkers):
            record_score(population, i, _lattice_score(0, 0, top, rough), 0, 0.0, 0.0, 0.0)
        while True:
            for i in range(walkers):
                if population.unfinished[i]:
                    k = population.records[i] - 1
                    place, step = population.state[i, k, 0], population.step[i, k]
                    while step < steps and place < top:
                        place = place + 1.0 if uniform(stream) < UP else max(place - 1.0, 0.0)
                        step += 1
                        record_score(population, i, _lattice_score(place, step, top, rough), step, place, 0.0, 0.0)
            if not raise_level(population, stream):
                break
        extinct[repeat] = population.weight[0] == 0.0
        if population.weight[0] > 0.0:
            for i in range(walkers):
                estimates[repeat, population.step[i, population.records[i] - 1] :] += population.weight[0] / walkers


def lattice(walkers, steps, top, rough, repeats):
    """Estimates (repeats, steps + 1) of P(visit of top by a step), their exact values and the share of extinctions."""
    estimates, extinct = np.zeros((repeats, steps + 1)), np.zeros(repeats, np.bool_)
    _lattice(stream_keys(11), walkers, steps, top, rough, estimates, extinct)
    chain = np.diag(np.full(top, UP), 1) + np.diag(np.full(top, 1.0 - UP), -1)
    chain[0, 0] = 1.0 - UP
    chain[top] = np.eye(top + 1)[top]
    law, exact = np.eye(top + 1)[0], []
    for _ in range(steps + 1):
        exact.append(law[top])
        law = law @ chain
    return estimates, np.array(exact), extinct.mean()


@pytest.mark.parametrize(
    ("rough", "walkers"), [*(pytest.param(False, count, marks=pytest.mark.slow) for count in (3, 12)), (True, 12)]
)
def test_lattice_walk_is_split_without_bias(rough, walkers):
    """Ties at every level, extinctions, a good score and a bad one: exact by 10, 20 and 30; false alarm 9 x 6e-5."""
    estimates, exact, extinct = lattice(walkers, 30, 5, rough, 30_000)
    assert 0.001 < extinct < 0.9
    error = estimates.std(axis=0, ddof=1) / math.sqrt(len(estimates))
    for step in (10, 20, 30):
        assert error[step] < 0.06 * exact[step]
        assert abs(estimates[:, step].mean() - exact[step]) < 4.0 * error[step]


def test_lattice_walk_reaches_1e_8():
    """500 walkers against the exact 9.9e-9; false alarm 6e-5."""
    estimates, exact, _ = lattice(500, 80, 24, False, 60)
    error = estimates[:, -1].std(ddof=1) / math.sqrt(len(estimates))
    assert 5e-9 < exact[-1] < 2e-8
    assert error < 0.1 * exact[-1]
    assert abs(estimates[:, -1].mean() - exact[-1]) < 4.0 * error


SPREAD = Start(0.1, 0.2, ((0.25, 0.0), (0.0, 0.25)))
MAIN = scene_of(2.5e-4)


@pytest.mark.parametrize(
    ("scene", "cycles", "which"),
    [
        (scene_of(0.004, 4.0, 0.6, 6.0, SPREAD), 2, (0, 1, 2)),
        pytest.param(MAIN, 10, (5, 7, 10), marks=pytest.mark.slow),
    ],
)
def test_agrees_with_a_plain_ensemble(scene, cycles, which):
    """Each side at three cycles, where any overturned; false alarm 6 x 6e-5."""
    compare(scene, cycles, which)


@pytest.mark.slow
def test_agrees_with_a_plain_ensemble_of_exact_blocks():
    """False alarm 6 x 6e-5."""
    scene = scene_of(0.004, 4.0, 0.6, 6.0, SPREAD)
    compare(scene.varied(block=Block(0.6, critical_angle=0.4)), 2, (0, 1, 2))


def compare(scene, cycles, which):
    """Hold a splitting against plain sampling."""
    plain = simulate(scene, cycles=cycles, realizations=60_000, seed=21)
    rare = split(scene, cycles=cycles, walkers=100, repeats=40, seed=22)
    assert not rare.skewed
    plain_variance = plain.overturned * (1.0 - plain.overturned) / plain.realizations
    variance = rare.repeat_overturned.var(axis=0, ddof=1) / rare.repeats + plain_variance
    compared = 0
    for k in which:
        for side in (0, 1):
            if plain_variance[k, side] > 0.0:
                compared += 1
                assert abs(rare.overturned[k, side] - plain.overturned[k, side]) < 4.0 * math.sqrt(variance[k, side])
    assert compared >= 5


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scene", "cycles"), [(scene_of(0.0055, 6.0, 0.6, 6.0), 20), (scene_of(3.6e-4, 3.0, 0.5, 2.7), 5)]
)
def test_independent_runs_agree_at_1e_8(scene, cycles):
    """Two seeds and numbers of walkers; false alarm 6e-5 each."""
    runs = [split(scene, cycles=cycles, walkers=n, seed=n) for n in (600, 1500)]
    for run in runs:
        assert not run.skewed
        assert 3e-9 < run.probability[-1] < 3e-8
        assert run.standard_error[-1] < 0.2 * run.probability[-1]
    difference = runs[0].probability[-1] - runs[1].probability[-1]
    assert abs(difference) < 4.0 * math.hypot(*(run.standard_error[-1] for run in runs))


def test_same_estimates_for_any_threads_and_more_repeats():
    threads = thread_count()
    results = []
    for count, repeats in ((1, 5), (threads, 5), (threads, 6)):
        with at_most(count):
            results.append(split(MAIN, cycles=7, walkers=30, repeats=repeats, seed=2**63))
    for name in ("repeat_overturned", "levels", "killed"):
        first = getattr(results[0], name)
        for other in results[1:]:
            assert first.tobytes() == getattr(other, name)[:5].tobytes()
    estimates = results[2].repeat_probability[:, -1]
    assert np.unique(estimates).size == 6


def test_steps_are_as_short_as_they_are_asked_for():
    """A start at rest sees its shortest step: other steps are other paths, and the result says which they were."""
    coarse, fine, again = (split(MAIN, cycles=7, walkers=30, repeats=4, steps_per_cycle=n) for n in (8, 200, 8))
    assert (coarse.steps_per_cycle, fine.steps_per_cycle) == (8, 200)
    assert np.array_equal(coarse.repeat_overturned, again.repeat_overturned)
    assert not np.any(coarse.repeat_probability[:, -1] == fine.repeat_probability[:, -1])


def test_the_score_is_the_nearest_approach_of_an_independent_block():
    """At nodes of the table, scipy's integration and its impacts; one state that escapes among them."""
    intervals = 32
    scores = score_table(MAIN, intervals)
    _, _, n_angle, n_velocity = scores.table.shape
    shift = 4.6 / math.hypot(1.0, 2.7)
    cutoff, nearest = MAIN.overturning.angle, []
    for j, side, a, b in ((5, -1, 13, 36), (17, 1, 23, 26), (30, -1, 2, 50)):
        u, w = cutoff * a / (n_angle - 1), scores.fastest * (2.0 * b / (n_velocity - 1) - 1.0)
        block = oracle.Block(4.6, 2.7, math.pi, 0.5, cutoff, side * u, side * w, side)
        block.t = begin = j * MAIN.period / intervals
        best, impacts = -math.inf, -1
        while block.t < begin + TUNING.foresight and not block.overturned:
            if len(block.events) != impacts:  # z is largest right after an impact
                saddle = shift * math.cos(2.7 * block.t + math.pi + math.atan(2.7))
                best = max(best, block.side * (block.x + block.v - saddle) - 1.0)
                impacts = len(block.events)
            block.advance(block.t + 0.002)
        nearest.append(best)
        assert score_of_state(u, w, side, j, scores) == pytest.approx(best, rel=0.01, abs=1e-3)
    assert max(nearest) > 0.0 > min(nearest)


def test_scores_are_bilinear_between_the_nodes_and_those_of_the_edge_beyond():
    def plane(u, w):
        return 0.3 + 2.0 * u - 0.7 * w + 0.4 * u * w

    angles, velocities = np.linspace(0.0, 1.5, 4), np.linspace(-2.0, 2.0, 6)
    table = np.zeros((3, 2, 4, 6))
    table[1, 1] = plane(angles[:, None], velocities)
    scores = ScoreTable(table, 2.0, 2.0, 1.25)
    for u, w in ((0.0, -2.0), (0.2, 0.1), (0.75, -1.3), (1.3, 1.9), (1.5, 2.0), (1.1, -2.5), (0.4, 3.0), (1.8, 0.5)):
        inside = min(u, 1.5), min(max(w, -2.0), 2.0)
        assert score_of_state.py_func(u, w, 1, 1, scores) == pytest.approx(plane(*inside), rel=1e-12)
        assert score_of_state.py_func(u, w, -1, 1, scores) == score_of_state.py_func(u, w, 1, 2, scores) == 0.0


def test_estimates_and_errors_follow_from_the_repeats():
    repeat_overturned = np.zeros((4, 3, 2))
    repeat_overturned[:, 2, 0] = (1e-6, 3e-6, 0.0, 0.0)
    repeat_overturned[0, 1:, 1] = 4e-6
    result = Splitting(scene_of(1e-4), 10, 1, 200, 0.1, repeat_overturned, np.ones(4), np.ones(4))
    assert (result.repeats, result.cycles, result.extinct, result.skewed) == (4, 2, 2, True)
    assert result.overturned[2] == pytest.approx([1e-6, 1e-6])
    assert result.probability == pytest.approx([0.0, 1e-6, 2e-6])
    assert result.survival == pytest.approx([1.0, 1.0 - 1e-6, 1.0 - 2e-6], abs=1e-15)
    assert result.standard_error == pytest.approx([0.0, 1e-6, math.sqrt((9 + 1 + 4 + 4) / 12) * 1e-6])
    assert result.effective_repeats == pytest.approx([0.0, 1.0, 64 / 34])
    with pytest.raises(ValueError, match="read-only"):
        result.repeat_overturned[0] = 0.0


def test_progress_is_told_and_may_interrupt():
    heard = []
    split(MAIN, cycles=1, walkers=10, repeats=7, progress=lambda *at: heard.append(at))
    assert heard == sorted(heard)
    assert heard[-1] == (7, 7)

    def stop(*_):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        split(MAIN, cycles=1, walkers=10, repeats=7, progress=stop)


@pytest.mark.parametrize(
    ("error", "message", "options"),
    [
        (ValueError, r"walkers: got 9, accepted: a whole number >= 10", {"walkers": 9}),
        (TypeError, r"walkers: got 50\.0", {"walkers": 50.0}),
        (ValueError, r"walkers: got 10000000, accepted: at most \d+ with \d+ steps of a path", {"walkers": 10**7}),
        (ValueError, r"repeats: got 40000000, accepted: at most 33554432 with 1 steps", {"repeats": 4 * 10**7}),
        (ValueError, r"repeats: got 1, accepted: a whole number >= 2", {"repeats": 1}),
        (ValueError, r"cycles: got 0", {"cycles": 0}),
        (ValueError, r"seed: got -1", {"seed": -1}),
        (ValueError, r"steps_per_cycle: got 7", {"steps_per_cycle": 7}),
        (TypeError, r"scene: got 'main', accepted: Scene", {"scene": "main"}),
    ],
)
def test_refuses_parameters_by_name(error, message, options):
    with pytest.raises(error, match=message):
        split(**({"scene": scene_of(1e-4), "cycles": 1} | options))


@pytest.mark.parametrize(
    ("scene", "message"),
    [
        (
            Scene(Block(0.5), Harmonic(4.6, 2.7), BandNoise(0.04, (0.0, 10.0), 100)),
            r"noise\.kind: got 'band', accepted: 'white'.*drawn at τ = 0.*scene\.white_equivalent\(\)",
        ),
        (Scene(Block(0.5), Harmonic(4.6, 2.7), NoNoise()), r"noise\.kind: got 'none', accepted: 'white'"),
        (scene_of(0.0), r"noise\.diffusion: got 0\.0, accepted: a number > 0"),
        (scene_of(1e-4, restitution=0.99 * CRITICAL_RESTITUTION), r"block\.restitution: got 0\.16.*impacts accumulate"),
    ],
)
def test_refuses_what_cannot_branch(scene, message):
    with pytest.raises(ValueError, match=message):
        split(scene, cycles=1)
