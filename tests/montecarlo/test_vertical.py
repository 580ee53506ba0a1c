"""A base that moves vertically too, in every engine of paths; what refuses it. Bodies in metres: test_bodies.py."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fpk_rocking import (
    BandNoise,
    Block,
    Dimensions,
    FilteredNoise,
    NoNoise,
    Record,
    Scene,
    Start,
    WhiteNoise,
    solve_fpk,
)
from fpk_rocking.physics.motion.equation import KernelBlock, Weight, acceleration_bounds
from fpk_rocking.physics.motion.floor import contact_forces as forces_at
from fpk_rocking.results.remarks import airborne
from fpk_rocking.risk import at_intensity, critical_intensities, fragility
from fpk_rocking.studies import scaled
from montecarlo import contact_forces, histories, simulate

G, STEP = 9.80665, 0.02
SIZE = Dimensions(0.5, 1.8)
TIMES = STEP * np.arange(300)
WAVES = np.random.default_rng(4).uniform(0.4, 3.0, (2, 8))
EAST, UP = (np.sin(2.0 * math.pi * np.outer(TIMES, waves) + waves).sum(axis=1) for waves in WAVES)
NOISE = BandNoise(0.01, (0.0, 12.0), 40)


def record(vertical=None, strength=2.0):
    """A motion of 6 s."""
    return Record(STEP, strength * EAST, "m/s2", vertical=vertical)


def upward(strength=1.5):
    """The vertical motion beside it."""
    return Record(STEP, strength * UP, "m/s2")


def under(motion, **parts):
    """The block of 0.5 m by 1.8 m under a motion without noise."""
    return Scene(Block(0.9, SIZE), motion, NoNoise()).varied(**parts)


def path(scene, method="exact", times=TIMES[1:]):
    """Angles (n,) of the first path at some seconds."""
    return histories(
        scene, times=scene.block.size.tau(times), method=method, realizations=1, steps_per_cycle=800
    ).angle[0]


@pytest.mark.parametrize(("method", "error"), [("exact", 1e-9), ("rk4", 1e-8)])
@pytest.mark.parametrize("part", [-0.3, 0.6])
def test_a_constant_vertical_acceleration_is_another_gravity(part, method, error):
    lifted = under(record(Record(STEP, np.full(TIMES.size, part * G), "m/s2"), 2.0 * (1.0 + part)))
    heavy = under(record(strength=2.0 * (1.0 + part)), block={"dimensions": Dimensions(0.5, 1.8, (1.0 + part) * G)})
    one, other = path(lifted, method, TIMES[1:-2]), path(heavy, method, TIMES[1:-2])
    assert 0.1 < np.nanmax(np.abs(one)) < 1.57
    assert np.allclose(one, other, rtol=0.0, atol=error, equal_nan=True)


@pytest.mark.parametrize("noise", [NoNoise(), NOISE])
def test_both_engines_follow_the_same_motion(noise):
    scene = under(record(upward()), noise=noise)
    one, other = path(scene), path(scene, "rk4")
    assert np.nanmax(np.abs(one)) > 0.3
    assert np.allclose(one, other, rtol=0.0, atol=1e-5, equal_nan=True)
    assert not np.allclose(one, path(under(record(), noise=noise)), rtol=0.0, atol=1e-2, equal_nan=True)


@pytest.mark.parametrize("method", ["exact", "rk4"])
def test_a_slender_block_obeys_its_own_equation(method):
    scene = under(record(upward()), block={"slender": True}, start=Start(0.6, 0.1))
    rate, alpha = SIZE.frequency_parameter, SIZE.critical_angle
    east, up = 2.0 * EAST / (G * alpha), 1.5 * UP / G

    def pull(time, state):
        """Rates of angle and velocity on the right side."""
        f, weight = np.interp(time / rate, TIMES, east), 1.0 + np.interp(time / rate, TIMES, up)
        return [state[1], weight * (state[0] - 1.0) + f]

    end = 0.5 * rate  # before the first impact
    truth = solve_ivp(pull, (0.0, end), (0.6, 0.1), "DOP853", max_step=0.02 * rate, rtol=1e-11, atol=1e-12).y[0, -1]
    assert truth > 0.05
    found = histories(scene, times=[end], method=method, realizations=1, steps_per_cycle=800).angle[0, -1]
    assert found == pytest.approx(truth, abs=1e-8)


@pytest.mark.parametrize("side", [-1, 1])
@pytest.mark.parametrize("method", ["exact", "rk4"])
def test_a_block_lifts_off_where_the_force_exceeds_its_weight_times_the_slenderness(method, side):
    # f = c t and G = 1 - t/2 meet where c t = (1 - t/2) tan α, in units of g and of the record's 4 s.
    ramp = np.linspace(0.0, 1.0, 201)
    scene = under(Record(STEP, side * 0.5 * ramp, "g", vertical=Record(STEP, -0.5 * ramp, "g")))
    level = math.tan(SIZE.critical_angle)
    lifts = 4.0 * level / (0.5 + 0.5 * level)
    near = SIZE.tau(np.array([lifts - 1e-3, lifts + 1e-3]))
    angles = histories(scene, times=near, method=method, realizations=1, steps_per_cycle=800).angle[0]
    assert angles[1] == 0.0
    assert side * angles[2] > 0.0


def test_scales_multiply_both_motions():
    scene = under(record(upward(), 0.9))
    suite = critical_intensities([scene], measure="scale", highest=3.0)
    (first, *_), alone = (
        suite.jumps[0],
        critical_intensities([under(record(strength=0.9))], measure="scale", highest=3.0),
    )
    assert abs(first / alone.jumps[0, 0] - 1.0) > 0.01
    sides = [simulate(scaled(scene, factor * first)).overturned[-1].sum() for factor in (0.998, 1.002)]
    assert sides == [0.0, 1.0]
    assert fragility(scene, scale=[0.998 * first, 1.002 * first]).overturned.tolist() == [[0.0, 1.0]]
    assert scene.forcing.scaled(2.0, 1.0).swaying == pytest.approx(2.0 * scene.forcing.swaying)
    assert scaled(scene, 2.0) != scaled(under(record(strength=0.9)), 2.0)


def test_a_vertical_motion_alone_lifts_a_block_off_only_without_weight():
    still = Record(STEP, np.zeros(TIMES.size), "g", vertical=Record(STEP, -0.99 * np.ones(TIMES.size), "g"))
    assert not simulate(under(still)).angle.any()
    assert under(still).forcing.lifting(1.0) == pytest.approx(0.99)


def test_a_motion_that_takes_all_weight_off_is_a_caution_that_names_file_and_time():
    for least, doubtful in ((-0.999, False), (-1.0, True)):
        samples = np.zeros(200)
        samples[120] = least
        motion = Record(STEP, 0.5 * EAST[:200], "m/s2", source="east.AT2", vertical=Record(STEP, samples, "g"))
        trust = simulate(under(motion)).trust
        told = [reason for reason in trust.reasons if "leave the ground" in reason]
        assert bool(told) == doubtful
        assert not told or ("of east.AT2 takes all weight off" in told[0] and "at 2.4 s" in told[0])


def test_it_is_so_many_times_as_strong_as_recorded_whatever_the_intensity():
    """A vertical peak of .25 g takes all weight off from 4 times as strong; an intensity of 2 g is 5 times .4 g."""
    samples = np.zeros(200)
    samples[120] = -0.25
    motion = Record(STEP, 0.4 * EAST[:200] / np.abs(EAST[:200]).max(), "g", vertical=Record(STEP, samples, "g"))
    for scene, most in ((under(motion), 5.0), (at_intensity(under(motion), "PGA"), 2.0)):
        (told,) = airborne([(scene.forcing, most)])
        assert "The vertical motion of the record, 5 times as strong as recorded, takes all weight off" in told.message


def test_contact_forces_have_the_weight():
    scene = under(record(upward(), 0.2))
    paths = histories(scene, times=SIZE.tau(TIMES[1:-1]))
    assert not paths.angle.any()
    assert contact_forces(paths).normal[0] == pytest.approx(1.0 + 1.5 * UP[:-1] / G, abs=1e-9)
    # Newton's law of the centre of mass, half a diagonal R from the corner, by differences of its height.
    alpha, angle, speed, force, weight = SIZE.critical_angle, 0.4, 0.3, 0.8, 1.3
    turning = -weight * math.sin(alpha * 0.6) / alpha + force * math.cos(alpha * 0.6)
    step = 1e-4
    angles = angle + speed * step * np.array([-1.0, 0.0, 1.0]) + 0.5 * turning * step**2 * np.array([1.0, 0.0, 1.0])
    heights = 0.75 * np.cos(alpha * (1.0 - angles))  # p² R/g = 3/4
    normal = weight + (heights[0] - 2.0 * heights[1] + heights[2]) / step**2
    assert forces_at(angle, speed, force, alpha, weight=weight)[1] == pytest.approx(normal, abs=1e-5)
    # A block that rests lifts off at once where the force exceeds the slenderness times the weight.
    level = math.tan(alpha) / alpha
    for weight, part, rests in ((0.8, 0.9, False), (0.8, 0.7, True), (1.2, 1.1, True), (1.2, 1.3, False)):
        for side in (-1, 1):
            pair = forces_at(0.0, 0.0, side * part * level, alpha, weight=weight)
            assert np.allclose(pair, [-alpha * side * part * level, weight], rtol=1e-12) == rests


@pytest.mark.parametrize("side", [-1, 1])
def test_bounds_of_the_acceleration_hold_for_all_weights_of_a_segment(side):
    """By the equation, at angles up to the cut-off, under forces and weights within their bounds; each is needed."""
    alpha, low, high, sway = 0.3, -0.7, 0.5, 0.4
    bounds = acceleration_bounds(side, low, high, KernelBlock(0.9, 1.5, alpha, None, Weight(1.1, 0.0, sway)))
    angle, force, weight = np.meshgrid(np.linspace(0.0, 1.5, 301), side * np.array([low, high]), [1 - sway, 1 + sway])
    turn = alpha * (1.0 - angle)
    moved = force * np.cos(turn) - weight * np.sin(turn) / alpha
    assert -bounds[0] <= moved.min() < 0.8 * -bounds[0]
    assert 0.8 * bounds[1] < moved.max() <= bounds[1]


def test_a_vertical_motion_counts_in_parts_of_the_gravity_of_the_block():
    moon = under(record(upward()), block={"dimensions": Dimensions(0.5, 1.8, 1.62)})
    assert moon.forcing.swaying == pytest.approx(1.5 * UP / 1.62, rel=1e-12)


@pytest.mark.parametrize(
    ("noise", "what"),
    [
        (WhiteNoise(0.01), "paths under white noise"),
        (FilteredNoise("low-pass", 0.01, 9.0, 0.7), "paths under filtered"),
    ],
)
def test_what_leaves_a_vertical_motion_out_refuses_it_by_name(noise, what):
    scene = under(record(upward()), noise=noise)
    with pytest.raises(ValueError, match=rf"forcing.vertical: .* none, as {what}"):
        simulate(scene, realizations=10)


@pytest.mark.parametrize("noise", [NOISE, WhiteNoise(0.01)])
def test_densities_refuse_a_vertical_motion_by_name(noise):
    scene = under(record(upward()), noise=noise)
    with pytest.raises(ValueError, match=r"forcing.vertical: .* none, as densities leave it out; Monte Carlo by"):
        solve_fpk(scene, tol=1e-2)
    with pytest.raises(ValueError, match=r"forcing.vertical: .* none, as densities"):
        fragility(scene, scale=[1.0], engine="density")
