"""Runge-Kutta realizations against closed-form flight, exact orbits and independent survival."""

import dataclasses
import functools
import math

import numpy as np
import pytest
from two_samples import survival_test

import montecarlo
from fpk_rocking.base.jit import at_most, thread_count
from fpk_rocking.physics.motion import TERMS
from fpk_rocking.physics.motion.equation import KernelBlock, segment_from_particular
from fpk_rocking.physics.motion.events import advance_through_events
from fpk_rocking.physics.motion.impact import side_of_start
from fpk_rocking.scene import BandNoise, Block, Harmonic, NoNoise, Overturning, Scene, Start

simulate = functools.partial(montecarlo.simulate, method="rk4")

REST = Start()


def noise_free(amplitude=0.0, restitution=0.5, frequency=2.7, phase=math.pi, start=REST, cutoff=math.pi / 2):
    forcing = Harmonic(amplitude, frequency, phase)
    return Scene(Block(restitution), forcing, NoNoise(), start, Overturning(cutoff))


def closed_form(scene, x, v, cycles):
    """Poincaré points (cycles + 1, 2) by exact flights; nan after overturning."""
    forcing, span = scene.forcing, scene.period / 16
    side = side_of_start(x, v)
    points = np.full((cycles + 1, 2), math.nan)
    points[0] = x, v
    for i in range(16 * cycles):
        segment = segment_from_particular(forcing.pieces([i * span])[0], np.empty(TERMS), span)
        cutoff = scene.overturning.angle
        x, v, side, _ = advance_through_events(
            x, v, side, segment, 0.0, span, KernelBlock(scene.block.restitution, cutoff)
        )
        if abs(x) >= cutoff:
            break
        if i % 16 == 15:
            points[i // 16 + 1] = x, v
    return points


def test_order_is_four_through_impacts():
    scene = noise_free(3.0, 0.7, start=Start(0.2, 0.3, ((0.01, 0.0), (0.0, 0.01))))
    steps, medians, truth = np.array([25, 50, 100, 200, 400]), [], None
    for n in steps:
        ensemble = simulate(scene, cycles=2, realizations=40, steps_per_cycle=int(n))
        if truth is None:
            starts = zip(ensemble.angle[:, 0], ensemble.velocity[:, 0], strict=True)
            truth = np.array([closed_form(scene, *start, cycles=2) for start in starts])
        assert np.array_equal(np.isnan(ensemble.angle), np.isnan(truth[:, :, 0]))
        error = np.hypot(ensemble.angle - truth[:, :, 0], ensemble.velocity - truth[:, :, 1])[:, 2]
        medians.append(np.median(error[np.isfinite(error)]))
    assert -np.polyfit(np.log(steps), np.log(medians), 1)[0] == pytest.approx(4.0, abs=0.15)
    assert medians[-1] < 1e-9


def test_orbit_of_two_cycles(named_scene):
    scene = dataclasses.replace(named_scene("fig05"), noise=NoNoise())
    angle = simulate(scene, cycles=200, realizations=1).angle[0, -4:]
    assert sorted(angle) == pytest.approx([-0.0836, -0.0836, -0.0219, -0.0219], abs=5e-5)
    assert angle[:2] == pytest.approx(angle[2:], abs=1e-6)


def test_free_rocking_peaks_then_rest():
    scene = noise_free(frequency=1000.0 * math.pi, start=Start(0.5))
    ensemble = simulate(scene, cycles=3500, realizations=1, steps_per_cycle=8)
    angle = np.abs(ensemble.angle[0])
    peaks = angle[1:-1][(angle[1:-1] > angle[:-2]) & (angle[1:-1] >= angle[2:])]
    assert peaks[:3] == pytest.approx([0.098612, 0.023719, 0.005877], abs=1e-6)
    assert angle[-1] == 0.0
    assert ensemble.velocity[0, -1] == 0.0


@pytest.mark.parametrize("noise", [NoNoise(), BandNoise(1e-6, (0.0, 10.0), 20)])
def test_no_uplift_while_the_force_is_below_one(noise):
    scene = dataclasses.replace(noise_free(0.98), noise=noise)
    ensemble = simulate(scene, cycles=20, realizations=10)
    assert np.all(ensemble.angle == 0.0)
    assert np.all(ensemble.velocity == 0.0)


def test_grazing_within_a_step():
    """Thrown at x = 0 against the force, a block dips below it between two ends of a step, or just turns before it.

    Under f - 1 = 2 it comes from 0.01 to its lowest point after 0.1, inside the second step, where both ends are
    above; missing the impact there would change the angle after the cycle by 0.01.
    """
    ends = []
    for speed in (0.995, 1.005):
        start = Start(0.01, -speed * math.sqrt(2.0 * 2.0 * 0.01))
        scene = noise_free(3.0, start=start, cutoff=50.0)
        ensemble = simulate(scene, cycles=1, realizations=1, steps_per_cycle=28)
        ends.append(ensemble.angle[0, 1])
        assert ends[-1] == pytest.approx(closed_form(scene, start.angle, start.velocity, 1)[1, 0], abs=1e-4)
    assert abs(ends[1] - ends[0]) > 0.01


def test_first_passage_counts_where_the_block_returns_within_the_step():
    """x = 1 - 0.1 cosh t + 0.05 sinh t peaks at 1 - sqrt(0.0075); the cut-off is put just below and just above."""
    peak = 1.0 - math.sqrt(0.0075)
    for cutoff, side in ((peak - 1e-6, 1), (peak + 1e-6, 0)):
        scene = noise_free(start=Start(0.9, 0.05), cutoff=cutoff)
        ensemble = simulate(scene, cycles=1, realizations=1, steps_per_cycle=8)
        assert ensemble.overturn_side[0] == side
        assert ensemble.survival[1] == 1 - side


def test_overturning_is_located_on_either_side():
    """x - 1 = 0.2 cosh t + sinh t reaches 0.5; to the left mirrored."""
    time = math.log((0.5 + math.sqrt(0.25 + 1.0 - 0.04)) / 1.2)
    for side in (-1, 1):
        scene = noise_free(start=Start(1.2 * side, 1.0 * side), cutoff=1.5)
        ensemble = simulate(scene, cycles=3, realizations=1)
        assert ensemble.overturn_time[0] == pytest.approx(time, abs=1e-9)
        assert ensemble.overturned[1].tolist() == [float(side < 0), float(side > 0)]
        assert np.isnan(ensemble.angle[0, 1:]).all()


def test_same_realizations_for_any_threads_and_any_size(main_scene):
    threads, results = thread_count(), []
    for count, size in ((1, 150), (threads, 150), (threads, 400)):
        with at_most(count):
            results.append(simulate(main_scene, cycles=6, realizations=size, seed=11, steps_per_cycle=50))
    for name in ("angle", "velocity", "overturn_time", "overturn_side"):
        first = getattr(results[0], name)
        for other in results[1:]:
            assert first.tobytes() == getattr(other, name)[:150].tobytes()
    assert not np.array_equal(results[0].angle[0], results[0].angle[1])


def test_survival_is_that_of_an_independent_program(main_scene, reference):
    """20,000 realizations against 100,000 over 20 cycles; false alarm 1e-3."""
    ensemble = simulate(main_scene, cycles=20, realizations=20_000, seed=3, steps_per_cycle=100)
    truth = reference("main_band")
    size = int(truth["paths"][0])
    expected = np.rint(truth["survival"][1:21] * size).astype(int)
    assert survival_test(ensemble.survivors[1:], ensemble.realizations, expected, size).agrees
