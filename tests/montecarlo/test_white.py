"""White-noise paths against closed forms and independent survival."""

import dataclasses
import math

import numpy as np
import pytest
from tuned_histories import white_histories
from two_samples import survival_test

from fpk_rocking.base.jit import at_most, thread_count
from fpk_rocking.physics.motion import CRITICAL_RESTITUTION, TERMS
from fpk_rocking.physics.motion.equation import KernelBlock, segment_from_particular
from fpk_rocking.physics.motion.flight import flight_covariance, flight_end
from fpk_rocking.scene import Block, Harmonic, Scene, Start, WhiteNoise
from montecarlo import histories, simulate

REST = Start()


def scene_of(amplitude=4.6, restitution=0.5, diffusion=0.002 * math.pi, frequency=2.7, start=REST):
    return Scene(Block(restitution), Harmonic(amplitude, frequency, math.pi), WhiteNoise(diffusion), start)


@pytest.mark.parametrize("covariance", [None, ((2e-4, 1e-4), (1e-4, 3e-4))])
def test_flight_has_its_gaussian_moments(covariance):
    """Mean and covariance after a cycle without impact, whole intervals and short steps; false alarm 5 x 6e-5."""
    start = Start(0.6, 0.2, covariance)
    scene = scene_of(0.8, frequency=8.0, diffusion=0.003, start=start)
    ensemble = simulate(scene, cycles=1, realizations=200_000, seed=2)
    period, forcing = scene.period, scene.forcing
    x, v = start.angle, start.velocity
    for i in range(16):
        segment = segment_from_particular(forcing.pieces([i * period / 16])[0], np.empty(TERMS), period / 16)
        x, v = flight_end(x, v, 1, segment, 0.0, period / 16, KernelBlock(0.9, 1.5))
    xx, xv, vv = flight_covariance(scene.noise.diffusion, period)
    grow = np.array([[math.cosh(period), math.sinh(period)], [math.sinh(period), math.cosh(period)]])
    truth = np.array([[xx, xv], [xv, vv]]) + grow @ np.array(covariance or np.zeros((2, 2))) @ grow.T
    points = np.stack([ensemble.angle[:, 1], ensemble.velocity[:, 1]])
    assert ensemble.survival[1] == 1.0
    assert points[0].min() > 0.0
    n = points.shape[1]
    assert np.abs((points.mean(axis=1) - [x, v]) / np.sqrt(np.diag(truth) / n)).max() < 4.0
    error = np.sqrt((truth**2 + np.outer(np.diag(truth), np.diag(truth))) / n)
    assert np.abs((np.cov(points) - truth) / error).max() < 4.0


@pytest.mark.parametrize(("name", "scene"), [("main_white", scene_of()), ("second_white", scene_of(3.0, 0.7, 0.012))])
def test_survival_is_that_of_an_independent_program(name, scene, reference):
    """40,000 paths against the reference of 4e5 or more, 10 cycles; false alarm 1e-3 each."""
    truth = reference(name)
    ensemble = simulate(scene, cycles=10, realizations=40_000, seed=4)
    size = int(truth["paths"][10])
    expected = np.rint(truth["survival"][1:11] * size).astype(int)
    assert survival_test(ensemble.survivors[1:], ensemble.realizations, expected, size).agrees


def test_binned_density_is_that_of_an_independent_program(reference):
    """L1 of the bins within 4 standard deviations of what sampling explains; false alarm 3 x 3e-5."""
    independent = reference("main_white")
    ensemble = simulate(scene_of(), cycles=4, realizations=40_000, seed=5)
    for k, truth in zip(independent["cycles"], independent["probabilities"], strict=True):
        if k <= 4:
            bins = ensemble.bin_probabilities(int(k), independent["angle_edges"], independent["velocity_edges"])
            variance = truth * (1.0 - truth) * (1.0 / 40_000 + 1e-7)
            limit = np.sqrt(2.0 / math.pi * variance).sum() + 4.0 * math.sqrt((1.0 - 2.0 / math.pi) * variance.sum())
            assert np.abs(bins - truth).sum() < limit


def test_symmetric_scene_leaves_rest_to_both_sides():
    """Without forcing each side is as likely; false alarm 6e-5."""
    angle = simulate(scene_of(0.0, frequency=20.0), cycles=1, realizations=4000).angle[:, 1]
    assert abs(np.count_nonzero(angle > 0.0) - 2000) < 4.0 * math.sqrt(1000.0)


def test_start_layer_converges_with_the_shortest_step():
    """Mean angle after a cycle of the second scene: shortest steps 32 times apart; false alarm 6e-5."""
    means = []
    for n in (8, 256):
        angle = simulate(scene_of(3.0, 0.7, 0.012), cycles=1, realizations=50_000, seed=n, steps_per_cycle=n).angle[
            :, 1
        ]
        angle = angle[np.isfinite(angle)]
        means.append((angle.mean(), angle.var() / angle.size))
    (coarse, coarse_variance), (fine, fine_variance) = means
    assert abs(coarse - fine) < 4.0 * math.sqrt(coarse_variance + fine_variance)


def test_same_paths_for_any_threads_and_any_size(named_scene):
    scene, threads, results = named_scene("second"), thread_count(), []
    for count, size in ((1, 500), (threads, 500), (threads, 900)):
        with at_most(count):
            results.append(simulate(scene, cycles=4, realizations=size, seed=2**63))
    for name in ("angle", "velocity", "overturn_time", "overturn_side"):
        first = getattr(results[0], name)
        for other in results[1:]:
            assert first.tobytes() == getattr(other, name)[:500].tobytes()


def test_certain_overturning_is_located():
    """x - 1 = 0.2 cosh t + sinh t reaches 0.5 in closed form; the noise is too weak to matter."""
    time = math.log((0.5 + math.sqrt(0.25 + 1.0 - 0.04)) / 1.2)
    scene = dataclasses.replace(scene_of(0.0, diffusion=1e-12, start=Start(-1.2, -1.0)))
    scene = dataclasses.replace(scene, overturning=dataclasses.replace(scene.overturning, angle=1.5))
    ensemble = simulate(scene, cycles=1, realizations=50)
    assert ensemble.overturn_time == pytest.approx(time, abs=1e-5)
    assert ensemble.overturned[1].tolist() == [1.0, 0.0]


def test_impacts_keep_the_velocity_ratio_where_noise_is_weak():
    """Peaks of free rocking from 0.5 without noise: 0.098612 to the left, where it is after half a bounce."""
    scene = scene_of(0.0, diffusion=1e-10, frequency=2.0 * math.pi / 1.78, start=Start(0.5))
    ensemble = simulate(scene, cycles=1, realizations=50)
    assert ensemble.angle[:, 1] == pytest.approx(np.full(50, -0.098612), abs=2e-4)


@pytest.mark.parametrize(("restitution", "diffusion"), [(0.5, 0.01), (0.8, 0.004)])
def test_unforced_block_bounces_as_it_must(restitution, diffusion):
    """Balances of momentum, energy and virial in the quasi-steady state, a bouncing ball with noise (u = |x|).

    With M_2, M_3 the sums per time of the impact speeds and their squares: (1 + e) M_2 = 1 - <u>,
    (1 - e^2) M_3 / 2 = D, <v^2> = <u (1 - u)>. Speeds are about 2 D/(1 - e) = 0.04; to overturn takes 1. From cycle 1
    to 4, 1500 paths tell the three to 0.2, 0.5, 0.7 % (e = 0.8: 0.1, 0.8, 0.5 %). False alarm 6 x 6e-5.
    """
    scene, paths, burnt = scene_of(0.0, restitution, diffusion, frequency=2.0 * math.pi), 1500, 1.0
    run = histories(scene, cycles=4, realizations=paths, seed=3, steps_per_cycle=100, samples_per_cycle=16)
    late = run.impact_time > burnt
    who, speed = run.impact_realization[late], np.abs(run.impact_velocity[late])
    momentum, energy = (np.bincount(who, speed**k, minlength=paths) / (4.0 - burnt) for k in (1, 2))
    u, v = np.abs(run.angle[:, 17:]), run.velocity[:, 17:]
    balances = np.stack(
        [
            (1.0 + restitution) * momentum - 1.0 + u.mean(axis=1),
            (1.0 - restitution**2) * energy / 2.0 - diffusion,
            (v * v).mean(axis=1) - (u * (1.0 - u)).mean(axis=1),
        ]
    )
    assert not np.any(run.overturn_side)
    error = balances.std(axis=1, ddof=1) / math.sqrt(paths)
    assert np.all(error < [0.003, 0.008 * diffusion, 0.01 * (v * v).mean()])
    assert np.abs(balances.mean(axis=1) / error).max() < 4.0


@pytest.mark.slow
def test_weak_order_is_one():
    """Error of the energy balance of the unforced block against shortest steps T/(256 n) of 0.8 to 0.1 D, steps alone.

    With 16,000 paths the order is 1.02 and the largest error 0.1181 ± 0.0007, larger where the impact is not put on a
    parabola; 4000 tell them to 0.026 and 0.0015. False alarm 6e-5.
    """
    steps, paths, errors, scene = np.array([8, 16, 32, 64]), 4000, [], scene_of(0.0, 0.5, 0.01, frequency=math.pi / 8.0)
    for n in steps:
        run = white_histories(scene, realizations=paths, seed=int(n), steps_per_cycle=int(n), brief=0.0)
        late = run.impact_time > 1.0
        sums = np.bincount(run.impact_realization[late], run.impact_velocity[late] ** 2, minlength=paths)
        error = 0.375 * sums / 15.0 / 0.01 - 1.0
        errors.append((error.mean(), error.std() / math.sqrt(paths)))
    mean, noise = np.array(errors).T
    slope, spread = np.polyfit(np.log(steps), np.log(mean), 1, w=mean / noise, cov="unscaled")
    assert math.sqrt(spread[0, 0]) < 0.035
    assert -slope[0] == pytest.approx(1.0, abs=0.15)
    assert mean[0] == pytest.approx(0.118, abs=0.006)


def test_refuses_what_white_noise_cannot_be():
    with pytest.raises(ValueError, match=r"block\.restitution: got 0\.16, accepted: above 0\.16303 under white"):
        simulate(scene_of(restitution=0.16), cycles=1, realizations=1)
    with pytest.raises(ValueError, match=r"noise\.diffusion: got 0\.0, accepted: a number > 0 .* noise.kind 'none'"):
        simulate(scene_of(diffusion=0.0), cycles=1, realizations=1)
    assert simulate(scene_of(restitution=1.001 * CRITICAL_RESTITUTION), cycles=1, realizations=2).realizations == 2


@pytest.mark.parametrize("phase", [0.0, math.pi])
def test_a_block_at_rest_begins_on_the_side_of_the_push(phase):
    """Under |f(0)| = 4.6 and noise that is too weak to matter the first impact ends the first swing."""
    scene = Scene(Block(0.5), Harmonic(4.6, 2.7, phase), WhiteNoise(1e-9))
    run = histories(scene, cycles=1, realizations=20, samples_per_cycle=64)
    assert (np.sign(run.angle[:, 1]) == -math.cos(phase)).all()
    assert run.impact_time.min() > 1.0


@pytest.mark.parametrize("restitution", [0.35, 0.7])
def test_the_side_of_a_negligible_force_decides_no_path_from_rest(restitution):
    """Of equal noise. A sixth of the paths changed side where the first step met an impact on the way to one side."""
    scenes = [Scene(Block(restitution), Harmonic(1e-9, 20.0, phase), WhiteNoise(3.0)) for phase in (0.0, math.pi)]
    one, other = (simulate(scene, cycles=1, realizations=1000).angle[:, 1] for scene in scenes)
    assert np.mean(np.sign(one) != np.sign(other)) < 0.01
    assert 400 < np.count_nonzero(one > 0.0) < 600


def test_a_remark_says_that_impacts_from_rest_are_those_of_the_steps():
    """Mean number of impacts in two cycles; seed 3, 2,000 paths: standard error about .1."""
    scene = Scene(Block(0.9), Harmonic(0.0, 2.0 * math.pi), WhiteNoise(0.05))
    counts = {
        start: [
            histories(scene.varied(start=start), cycles=2, realizations=2000, seed=3, steps_per_cycle=steps)
            for steps in (50, 800)
        ]
        for start in (Start(), Start(0.5))
    }
    few, many = (found.impacts.mean() for found in counts[Start()])
    assert many > few + 0.5
    assert any("impacts without limit" in remark for remark in counts[Start()][0].remarks)
    few, many = (found.impacts.mean() for found in counts[Start(0.5)])
    assert abs(many - few) < 0.3
    assert not any("impacts without limit" in remark for remark in counts[Start(0.5)][0].remarks)
