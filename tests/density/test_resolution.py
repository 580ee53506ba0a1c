"""Exploratory paths, which tell where a mesh has to be fine, and how fine meshes and steps are."""

import dataclasses
import itertools
import math

import numpy as np
import pytest

from fpk_rocking import Block, Harmonic, Overturning, Pulse, Scene, Start, WhiteNoise, solve_fpk
from fpk_rocking.density.resolution import RESOLUTIONS, StateRange, explore
from fpk_rocking.density.space import velocity_bound
from fpk_rocking.density.tuning import TUNING
from fpk_rocking.physics.forcing import Harmonics
from montecarlo import histories


def scene_of(amplitude, frequency, restitution, diffusion, start=None, phase=0.0):
    forcing = Harmonic(amplitude, frequency, phase)
    return Scene(Block(restitution), forcing, WhiteNoise(diffusion), start or Start(), Overturning())


SCENES = {
    "small motion": scene_of(2.8, 9.5, 0.936, 0.002),
    "rattling at rest": scene_of(0.74, 5.0, 0.92, 0.0022),
    "large motion": scene_of(2.6, 3.8, 0.954, 0.0138),
}


@pytest.mark.parametrize("scene", SCENES.values(), ids=SCENES.keys())
def test_exploratory_paths_tell_the_range_of_white_noise_paths(scene):
    """Against 2,000 paths at 16 times a cycle; the 256 scatter by some per cent."""
    motion = explore(scene, scene.period * np.arange(11))
    paths = histories(scene, cycles=10, realizations=2000, seed=2, samples_per_cycle=16)
    for usual, values in ((motion.angle, paths.angle), (motion.velocity, paths.velocity)):
        assert usual == pytest.approx(np.nanquantile(np.abs(values), 0.9), rel=0.2)
    for ends, values in ((motion.angles, paths.angle), (motion.velocities, paths.velocity)):
        assert np.ptp(ends) == pytest.approx(np.ptp(np.nanquantile(values, [0.001, 0.999])), rel=0.3)


def test_exploratory_paths_are_the_same_in_every_call_and_mirrored_for_the_mirror_image():
    scene = scene_of(2.6, 3.8, 0.9, 0.0138, Start(0.1, -0.2, ((1e-3, 0.0), (0.0, 1e-3))))
    mirror = dataclasses.replace(
        scene, forcing=scene.forcing.at_phase(math.pi), start=Start(-0.1, 0.2, scene.start.covariance)
    )
    motion, mirrored = explore(scene, scene.period * np.arange(5)), explore(mirror, mirror.period * np.arange(5))
    assert motion == explore(scene, scene.period * np.arange(5))
    assert [*mirrored[:2], mirrored.fastest] == pytest.approx([*motion[:2], motion.fastest], rel=1e-12)
    assert motion.fastest >= max(np.abs(motion.velocities)) > 0.0
    for ends, others in zip(motion[2:4], mirrored[2:4], strict=True):
        assert others == pytest.approx((-ends[1], -ends[0]), rel=1e-12)


def test_a_block_at_rest_and_one_that_falls_at_once_have_a_motion():
    times = 2.0 * math.pi / 5.0 * np.arange(4)
    rest = explore(scene_of(0.1, 5.0, 0.8, 1e-6), times)
    assert max(rest.angle, rest.velocity) < 0.01
    assert [np.ptp(ends) for ends in rest[2:4]] == pytest.approx(
        [TUNING.least_angle_range, TUNING.least_velocity_range]
    )
    fallen = explore(scene_of(0.1, 5.0, 0.8, 1e-6, Start(1.55, 30.0)), times)
    assert 0.0 < fallen.angle <= math.pi / 2


def test_time_at_rest_after_a_pulse_does_not_narrow_its_range():
    pulsed = Scene(Block(0.5), Pulse("one-sine", 1.3, 5.0), WhiteNoise(1e-8))
    short, long = (explore(pulsed, pulsed.forcing.duration * np.arange(count)) for count in (3, 60))
    assert short.angle > 0.01
    assert long.angle == pytest.approx(short.angle, rel=0.1)


def test_bins_are_a_twentieth_of_the_range_about_a_middle_bin_at_rest():
    for edges, ends in zip(
        StateRange(0.1, 0.2, (-0.307, 0.1), (-1.0, 1.0), 1.0).edges, ((-0.307, 0.1), (-1.0, 1.0)), strict=True
    ):
        size = np.ptp(ends) / 20
        assert np.diff(edges) == pytest.approx(size)
        assert np.abs(edges).min() == pytest.approx(0.5 * size)
        assert edges[0] <= ends[0] < edges[1]
        assert edges[-2] < ends[1] <= edges[-1]


def test_cells_beyond_the_motion_are_refined_with_the_others():
    """Weak noise, whose tails cells of one and the same growth never resolve: survival lost .001 then."""
    scene = scene_of(4.6, 2.7, 0.5, 2.5e-4, phase=math.pi)
    bound, motion = velocity_bound(scene, 2.5e-4), explore(scene, scene.period * np.arange(11))
    assert motion.velocity < 0.8 * bound
    sizes = [np.diff(resolution.adapted(scene, bound, motion).velocity_lines)[-1] for resolution in RESOLUTIONS[1:]]
    assert all(fine < 0.9 * coarse for coarse, fine in itertools.pairwise(sizes))


def test_rattling_at_rest_has_the_energy_of_paths():
    """Mean square of the velocity without forcing; 10^5 paths of the white-noise engine gave .000651 ± .000002.

    Steps are longer than most bounces. With noise that is smooth over a step in place of jumps, blocks come to rest:
    .0000035.
    """
    density = solve_fpk(scene_of(0.0, 5.0, 0.9, 0.002), cycles=12, tol=1e-2).at(12)
    assert density.integral(lambda x, v: v * v + 0.0 * x, 8) == pytest.approx(0.00065, rel=0.25)


def test_a_block_that_stays_at_rest_is_answered():
    """The layer of rattling is a fifth of what counts as rest: all of it is there, and none has overturned."""
    scene = scene_of(0.0, 20.0, 0.5, 0.001)
    density = solve_fpk(scene, cycles=3, tol=1e-2)
    assert density.survival == pytest.approx(np.ones(4), abs=1e-3)
    assert density.at_rest == pytest.approx(np.ones(4), abs=1e-3)
    assert density.bins_error_estimate < 1e-2
    assert density.negative_mass > 0.1
    assert density.moving_negative_mass < 1e-3
    assert density.trust.verdict == "ok"
    lifted = solve_fpk(SCENES["large motion"], cycles=1, tol=1e-2)
    assert lifted.at_rest[0] == 1.0
    assert lifted.at_rest[1] < 0.05


@pytest.mark.parametrize("highest", [1, 3, 32])
def test_the_forcing_is_a_polynomial_in_every_step(highest):
    """To 1e-11 of its size, for a cycle with one harmonic of any number; the highest one sets the shortest step."""
    amplitudes = np.zeros(highest)
    amplitudes[-1] = 3.0
    forcing = Harmonics(1.5, tuple(amplitudes), (0.4,) * highest)
    scene = Scene(Block(0.5), forcing, WhiteNoise(0.02))
    for resolution in RESOLUTIONS:
        steps = resolution.adapted(scene, 4.0, StateRange(1.2, 1.8, (-1.2, 1.2), (-1.8, 1.8), 2.0)).steps
        assert steps % 2 == 0
        duration = scene.period / steps
        size = 3.0 / (1.0 + (1.5 * highest) ** 2)
        for begin in (0.0, 0.3 * scene.period):
            rows = np.asarray(forcing.particular_over(begin, duration))
            for part in (0.25, 0.6, 1.0):
                value = np.polynomial.polynomial.polyval(part * duration, rows)
                assert value == pytest.approx(forcing.particular(begin + part * duration)[0], abs=1e-11 * size)
    assert math.isclose(forcing.shortest_period, scene.period / highest)
