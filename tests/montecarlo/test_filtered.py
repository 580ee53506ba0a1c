"""Paths under filtered noise: the law of the noise, the limits, rest and lift-off, and independent survival."""

import dataclasses
import math

import numpy as np
import pytest
from filtered_paths import coupled
from filtered_scenes import LOW_PASS, NOISES, SOIL, THIRD, scene_of, soil_noise
from scipy.stats import kstest
from stepped_paths import soil, survival
from two_samples import survival_test

from fpk_rocking import CloughPenzien, CycleOperator, FilteredNoise, NoNoise, Start, load_scene
from fpk_rocking.base.jit import at_most, thread_count
from fpk_rocking.results.remarks import noise_text, remarks
from fpk_rocking.scene import BandNoise, Block, Harmonic, Overturning, Scene
from montecarlo import histories, simulate, split, tally
from montecarlo.engines import batches

drawn = pytest.mark.parametrize("noise", [*NOISES, SOIL, THIRD], ids=lambda noise: noise_text(noise)[:30])
each = pytest.mark.parametrize("noise", NOISES, ids=lambda noise: f"{noise.filter}-{noise.damping}")


def blocks(amplitude, frequency, restitution, variance, highest):
    noise = BandNoise(variance, (0.0, highest), 100)
    return Scene(Block(restitution), Harmonic(amplitude, frequency), noise).filtered_equivalent()


@pytest.mark.slow
def test_share_at_rest_is_that_of_short_intervals():
    """Rough noise lifts blocks off between the ends of an interval: 40,000 paths each; false alarm 1e-3.

    Without parts the share is .013 larger, which is nearly four standard errors, and 8 times more steps halve that.
    """
    scene = Scene(Block(0.63, critical_angle=0.17), Harmonic(0.78, 3.0), FilteredNoise("exponential", 0.073, 4.0))
    usual, fine = (
        simulate(scene, cycles=2, realizations=40_000, seed=seed, steps_per_cycle=steps).at_rest[2]
        for seed, steps in ((1, 200), (2, 1600))
    )
    assert abs(usual - fine) < 3.3 * math.sqrt(0.5 / 40_000)


@each
@pytest.mark.parametrize("variance", [0.0, 1e-30])
def test_without_variance_it_is_the_deterministic_path(noise, variance):
    scene = scene_of(dataclasses.replace(noise, variance=variance), start=Start(0.1, 0.2))
    truth = simulate(scene.varied(noise=NoNoise()), cycles=8, realizations=1)
    path = simulate(scene, cycles=8, realizations=3)
    assert path.method == "filtered"
    assert np.abs(path.angle - truth.angle).max() < 1e-10
    assert np.abs(path.velocity - truth.velocity).max() < 1e-10


@pytest.mark.parametrize("name", ["exponential", "low-pass", "kanai-tajimi"])
def test_a_slow_filter_is_a_constant_force(name):
    """From rest a block stays where |η| < 1, else it is at (|η| - 1)(cosh τ - 1) on the side of η; false alarm 2e-3."""
    damping = None if name == "exponential" else 0.5
    # Of Kanai-Tajimi noise, whose fast part is as strong as the slow one, the limit is that of its filter.
    variance = 2.25
    scene = scene_of(FilteredNoise(name, variance, 1e-3, damping), 0.0, 2.0 * math.pi)
    if name == "kanai-tajimi":
        scene = scene.varied(noise={"damping": 1e-3})
    scene = dataclasses.replace(scene, overturning=Overturning(100.0))
    angle = simulate(scene, cycles=1, realizations=20_000, seed=5).angle[:, 1]
    still = angle == 0.0
    expected = math.erf(1.0 / math.sqrt(2.0 * variance))
    # A filter as slow as this still moves η by some 0.05 in a cycle, which lifts a few more blocks off.
    assert abs(still.mean() - expected) < 0.02
    eta = (1.0 + np.abs(angle) / (math.cosh(1.0) - 1.0)) * np.sign(angle)
    moved = eta[~still & (np.abs(eta) > 1.2)]
    tail = math.erfc(1.2 / math.sqrt(2.0 * variance))

    def law(value):
        outer = 0.5 * np.vectorize(math.erfc)(np.maximum(np.abs(value), 1.2) / math.sqrt(2.0 * variance)) / tail
        return np.where(value < 0.0, outer, 1.0 - outer)

    assert kstest(moved, law).pvalue > 1e-3


def test_a_block_that_the_noise_cannot_lift_rests_for_ever():
    scene = scene_of(FilteredNoise("low-pass", 1e-4, 5.0, 0.7), 0.9)
    run = histories(scene, cycles=20, realizations=50, samples_per_cycle=16)
    assert not np.any(run.angle)
    assert not np.any(run.velocity)
    assert run.impact_time.size == 0


def test_noise_lifts_a_block_to_the_side_of_the_force():
    """|f| < 1 without noise, at its largest at τ = 0; a block that has left at 1/16 of a cycle went with the force."""
    scene = scene_of(FilteredNoise("low-pass", 0.09, 3.0, 0.7), 0.8)
    run = histories(scene, cycles=1, realizations=4000, samples_per_cycle=16)
    bounced = np.unique(run.impact_realization[run.impact_time <= run.scene.period / 16])
    angle = np.delete(run.angle[:, 1], bounced)
    assert np.count_nonzero(angle > 0.0) > 500
    assert (angle >= 0.0).all()


@each
def test_same_paths_for_any_threads_size_and_samples(noise):
    scene, threads, results = scene_of(noise), thread_count(), []
    for count, size in ((1, 300), (threads, 300), (threads, 500)):
        with at_most(count):
            results.append(simulate(scene, cycles=4, realizations=size, seed=2**63))
    sampled = histories(scene, cycles=4, realizations=300, seed=2**63, samples_per_cycle=5)
    for name in ("angle", "velocity", "overturn_time", "overturn_side"):
        first = getattr(results[0], name)
        for other in results[1:]:
            assert first.tobytes() == getattr(other, name)[:300].tobytes()
        if name in {"angle", "velocity"}:
            assert first.tobytes() == np.ascontiguousarray(getattr(sampled, name)[:, ::5]).tobytes()


def test_a_run_that_begins_later_sees_the_same_noise():
    """From where a path is after three cycles a run that begins there goes on as the path does."""
    scene = scene_of(LOW_PASS)
    complete = simulate(scene, cycles=4, realizations=6, seed=7)
    for r in np.nonzero(np.isfinite(complete.angle[:, 4]))[0]:
        begun = scene.varied(start=Start(complete.angle[r, 3], complete.velocity[r, 3]))
        run = batches.checked_run(begun, 1, int(r) + 1, 7, "filtered", 200)
        (batch,) = batches.simulate_batches(run, first=int(r), cycle=3)
        assert batch.angle[0, 1] == pytest.approx(complete.angle[r, 4], abs=1e-12)


@pytest.mark.parametrize(
    ("scene", "cycles", "truth"),
    [
        (blocks(0.867, 1.374, 0.813, 0.0406, 17.2), 10, 0.893),
        (blocks(1.008, 2.587, 0.948, 0.0221, 35.3), 10, 0.539),
        (load_scene("cases/scenes/main.toml").filtered_equivalent(), 10, 0.475),
    ],
)
@pytest.mark.slow
def test_survival_is_that_of_an_independent_program(scene, cycles, truth):
    """40,000 paths against 100,000 of an independent program, whose results have three digits; false alarm 3 x 5e-4."""
    survival = simulate(scene, cycles=cycles, realizations=40_000, seed=8).survival[cycles]
    error = math.sqrt(truth * (1.0 - truth) * (1.0 / 40_000 + 1.0 / 100_000))
    assert abs(survival - truth) < 3.5 * error + 5e-4


@pytest.mark.parametrize("paths", [2_000, pytest.param(10_000, marks=pytest.mark.slow)])
def test_survival_under_clough_penzien_noise_is_that_of_small_steps(paths):
    """40,000 paths against fewer in steps of 1/400 of a cycle; one false alarm in a thousand: 3.6 standard errors.

    Kanai-Tajimi noise without the second filter leaves .24 fewer after three cycles.
    """
    scene = scene_of(FilteredNoise(CloughPenzien(15.0, 0.6, 1.5, 0.4), 1.2))
    sampled = simulate(scene, cycles=3, realizations=40_000, seed=3).survival[1:]
    truth = survival(soil(15.0, 0.6, 1.5, 0.4), 1.2, 4.6, 2.7, 0.5, 0.5 * math.pi, 3, paths, 400, 1)
    assert 0.5 < truth[-1] < 0.95
    error = np.sqrt(truth * (1.0 - truth) * (1.0 / 40_000 + 1.0 / paths))
    assert np.all(np.abs(sampled - truth) < 3.6 * error + 5e-4)


@pytest.mark.slow
def test_fast_filters_approach_white_noise():
    """Exponential noise of correlation time .025 at the main scene's diffusion; white: .8627, .4697.

    25,000 paths; within 4 standard errors, 6e-5 each, of a difference of first order in the correlation time: .011 and
    .015 at four and at ten cycles.
    """
    noise = FilteredNoise("exponential", 0.002 * math.pi / 0.025, 1.0 / 0.025)
    survival = simulate(scene_of(noise), cycles=10, realizations=25_000, seed=9).survival
    for cycle, white in ((4, 0.8627), (10, 0.4697)):
        assert abs(survival[cycle] - white) < 4.0 * math.sqrt(white * (1.0 - white) / 25_000) + 0.0025


def test_tally_counts_the_same_paths(tmp_path):
    scene, sampled = scene_of(LOW_PASS), {"cycles": 3, "seed": 2}
    ensemble = simulate(scene, realizations=700, **sampled)
    tally(scene, realizations=300, checkpoint=tmp_path / "kept.npz", **sampled)
    counted = tally(scene, realizations=700, checkpoint=tmp_path / "kept.npz", **sampled)
    assert np.array_equal(counted.survivors, ensemble.survivors)
    assert counted.method == "filtered"
    assert survival_test(counted.survivors[1:], 700, ensemble.survivors[1:], 700).agrees


def one_path(noise, **asked):
    return simulate(scene_of(noise), cycles=1, realizations=1, **asked)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: simulate(load_scene("main"), cycles=1, realizations=1, method="filtered"),
         r"method: got 'filtered', accepted: 'exact' or 'rk4' .*scene\.filtered_equivalent\(\)"),
        (lambda: one_path(LOW_PASS, method="exact"),
         "method: got 'exact', accepted: 'filtered' for noise of kind 'filtered'"),
        (lambda: one_path(FilteredNoise("exponential", 0.1, 1e3), steps_per_cycle=10**6),
         r"steps_per_cycle: got 1000000, accepted: up to 2252. with a filter of this rate"),
        (lambda: one_path(FilteredNoise("exponential", 0.1, 1e-4)),
         r"noise\.frequency: got 0\.0001, accepted: an absolute value from 0\.001 to 10000"),
        (lambda: one_path(FilteredNoise("low-pass", 0.1, 9e3, 40.0)),
         r"noise\.frequency: got 9000\.0, accepted: a filter whose fastest rate"),
        (lambda: one_path(FilteredNoise("low-pass", 0.1, 9.0, 1e-4)),
         r"noise\.damping: got 0\.0001, accepted: from 0\.001 to 1000"),
        (lambda: one_path(soil_noise(1e-4, 0.6)),
         r"noise\.filter: got 'Clough-Penzien noise.*, accepted: eigenvalues of sizes from 0\.001 to 10000"),
        (lambda: one_path(soil_noise(1.0, 1e-4)),
         r"noise\.filter: got 'Clough-Penzien noise.*, accepted: eigenvalues .* decay by 0\.001 of their size"),
        (lambda: split(scene_of(LOW_PASS), cycles=1),
         r"noise\.kind: got 'filtered', accepted: 'white'.*scene\.white_equivalent\(\)"),
        (lambda: CycleOperator(scene_of(LOW_PASS)), r"noise\.kind: got 'filtered', accepted: .*solve_fpk\(\)"),
    ],
)  # fmt: skip
def test_what_filtered_noise_does_not_allow_is_refused_by_name(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_results_name_their_noise():
    assert noise_text(LOW_PASS) == "low-pass noise, variance 0.04, frequency 9, damping 0.707107"
    assert noise_text(NOISES[1]) == "exponential noise, variance 0.04, frequency 5"
    assert noise_text(NOISES[2]).startswith("Kanai-Tajimi noise, variance 0.04")
    assert noise_text(SOIL).startswith(
        "Clough-Penzien noise of frequency 9, damping 0.6, low frequency 1.5, low damping"
    )
    assert noise_text(THIRD) == "noise of a linear filter, fastest rate 5, variance 0.04"
    scene = scene_of(FilteredNoise("exponential", 0.04, 1.0))
    assert remarks(simulate(scene, cycles=1, realizations=2)) == ()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("noise", "order"), [(NOISES[1], 1.65), (FilteredNoise("low-pass", 0.0406, 15.5, 0.7071), 2.4)]
)
def test_intervals_have_the_order_of_their_noise(noise, order):
    """Coupled paths of a block near |f| = 1 after a cycle, intervals in the ratio 1 : 2 : 4 against eight times finer.

    The intervals have no parts. The order is that of the mean angle where the noise is rough, and of the share at rest
    where it is smooth, whose mean angle is too good to tell. 200,000 paths tell it to 0.1; false alarm below 1e-2.
    """
    scene = dataclasses.replace(blocks(0.867, 1.374, 0.813, 0.0406, 17.2), noise=noise)
    errors = []
    for factor in (4, 8, 16):
        _, angle = coupled(scene, 256, factor, 1, 200_000, parts=False)
        size = np.abs(angle) if noise.filter == "exponential" else (angle == 0.0).astype(float)
        errors.append(abs(np.mean(size[:, 1] - size[:, 0])))
    steps = np.diff(errors)
    assert math.log2(steps[1] / steps[0]) == pytest.approx(order, abs=0.3)
