"""Bodies of unequal sides against an integration in metres and seconds, and symmetric ones against rectangles."""

import math

import body_motion
import body_paths
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from transient_paths import SHAPES, pulse_force

from fpk_rocking import (
    BandNoise,
    Block,
    Body,
    Dimensions,
    FilteredNoise,
    Harmonic,
    NoNoise,
    Overturning,
    Pulse,
    Record,
    Scene,
    Start,
    WhiteNoise,
)
from fpk_rocking.physics.motion.floor import SidesOfContact
from fpk_rocking.physics.motion.floor import contact_forces as forces_at
from montecarlo import histories, simulate

LENGTHS = 1.1, 0.30, 0.38, 0.62
STATUE = Body(*LENGTHS)
SHAKING = Harmonic(1.3, 2.2, 0.4)
G = 9.80665


def drawn_body(rng):
    """Lengths of a body that does not stop at an impact: height of the centre, right, left, radius of gyration."""
    while True:
        height = rng.uniform(0.3, 2.0)
        right, left = height * rng.uniform(0.06, 0.6, 2)
        radius = height * rng.uniform(0.2, 1.2)
        if radius**2 + height**2 > 1.2 * right * left:
            return height, right, left, radius


def rates(lengths):
    """Critical angle, radians, and frequency parameter, rad/s, of the side that falls more easily."""
    height, right, left, radius = lengths
    square = height**2 + min(right, left) ** 2
    return math.atan(min(right, left) / height), math.sqrt(G * math.sqrt(square) / (radius**2 + square))


def pulse_case(rng):
    """Scene of a drawn body under a drawn pulse, and its motion in metres and seconds."""
    lengths = drawn_body(rng)
    alpha, rate = rates(lengths)
    level = math.tan(alpha) / alpha
    shape = SHAPES[rng.integers(len(SHAPES))]
    amplitude, frequency = level * rng.uniform(1.1, 5.0), rng.uniform(0.7, 6.0)
    pulse = Pulse(shape, amplitude, frequency, 3 if shape == "n-sine" else None)
    force, kinks = pulse_force(pulse)
    end = kinks[-1]
    cutoff = min(rng.uniform(0.8, 4.0), 1.0 + 0.49 * math.pi / alpha)
    scene = Scene(Block(body=Body(*lengths)), pulse, NoNoise(), overturning=Overturning(cutoff))

    def base(time):
        return G * alpha * force(rate * time) if rate * time < end else 0.0

    motion = body_motion.BodyInMetres(lengths, G, base, [end / rate], cutoff * alpha)
    return scene, motion, rate, 1.5 * end + 8.0


def record_case(rng):
    """Scene of a drawn body under a drawn record, linear between samples, and its motion in metres and seconds."""
    lengths = drawn_body(rng)
    alpha, rate = rates(lengths)
    step, count = 0.06, 70
    times = step * np.arange(count)
    waves = rng.uniform(0.3, 3.0, 12)
    sums = np.sin(2.0 * math.pi * (np.outer(times, waves) + rng.uniform(0.0, 1.0, 12))).sum(axis=1)
    samples = G * math.tan(alpha) * rng.uniform(1.5, 5.0) * sums / np.abs(sums).max()
    samples[0] = samples[-1] = 0.0
    record = Record(step, tuple(samples.tolist()), "m/s2")
    scene = Scene(Block(body=Body(*lengths)), record, NoNoise())

    def base(time):
        return float(np.interp(time, times, samples, right=0.0))

    motion = body_motion.BodyInMetres(lengths, G, base, times[1:].tolist(), 0.5 * math.pi * alpha)
    return scene, motion, rate, rate * times[-1] + 6.0


def vertical_case(rng):
    """As `record_case`, on a base that moves vertically too: at times so strongly that the body is drawn upwards."""
    scene, motion, rate, end = record_case(rng)
    record = scene.forcing
    times = record.interval * np.arange(len(record.samples) - 20)
    samples = G * rng.uniform(0.2, 1.3) * rng.uniform(-1.0, 1.0, times.size)
    samples[-1] = 0.0
    vertical = Record(record.interval, tuple((samples / G).tolist()), "g")
    motion.upward = lambda time: float(np.interp(time, times, samples, right=0.0))
    return scene.varied(forcing={"vertical": vertical}), motion, rate, end


def difference(case):
    """Largest differences in time (τ) and in velocity of the events of a case from those in metres and seconds.

    Impacts slower than 1e-4, of a burst that is summed as chatter, and those after the last time are left out. inf
    where outcome, side or number of impacts differ.
    """
    scene, motion, rate, end = case
    alpha = scene.block.critical_angle
    paths = histories(scene, times=[0.5 * end, end])
    motion.run(end / rate)
    time, side = motion.outcome
    events = np.array([(rate * when, speed / (alpha * rate)) for when, speed, _ in motion.events]).reshape(-1, 2)
    ours = np.column_stack([paths.impact_time, paths.impact_velocity])
    ours, events = (rows[(np.abs(rows[:, 1]) > 1e-4) & (rows[:, 0] < end)] for rows in (ours, events))
    if paths.overturn_side[0] != side or len(ours) != len(events):
        return math.inf, math.inf
    last = abs(paths.overturn_time[0] - rate * time) if side else 0.0
    apart = np.abs(ours - events).max(axis=0, initial=0.0)
    return max(apart[0], last), apart[1]


@pytest.mark.parametrize("make", [pulse_case, record_case, vertical_case])
def test_bodies_move_as_in_metres_and_seconds(make):
    rng = np.random.default_rng(20)
    sides = []
    for _ in range(12):
        case = make(rng)
        time, velocity = difference(case)
        assert max(time, velocity) < 1e-8
        sides.append(case[1].outcome[1])
    assert {-1, 0, 1} == set(sides)


@pytest.mark.slow
@pytest.mark.parametrize("make", [pulse_case, record_case, vertical_case])
def test_many_bodies_move_as_in_metres_and_seconds(make):
    rng = np.random.default_rng(21)
    worst = np.array([difference(make(rng)) for _ in range(100)])
    assert worst.max() < 1e-8


def test_the_mirror_image_of_a_body_moves_as_the_mirror_image():
    samples = np.append(4.0 * np.sin(np.arange(60) ** 1.3), 0.0)
    path, image = (
        histories(
            Scene(Block(body=body), Record(0.08, tuple(sign * samples), "m/s2"), NoNoise(), Start(sign * 0.3)),
            times=np.linspace(0.5, 16.0, 32),
        )
        for sign, body in ((1.0, STATUE), (-1.0, Body(1.1, 0.38, 0.30, 0.62)))
    )
    assert np.array_equal(path.angle, -image.angle, equal_nan=True)
    assert path.impact_time.size > 3
    assert np.array_equal(path.impact_time, image.impact_time)


@pytest.mark.parametrize("slender", [False, True])
def test_a_symmetric_body_moves_as_a_rectangle_with_its_numbers(slender):
    """Bit for bit: what a body adds is another critical angle, frequency parameter and restitution."""
    size, noise = Dimensions(0.6, 2.0), BandNoise(0.3, (0.0, 8.0), 20)
    body = Body(1.0, 0.3, 0.3, math.hypot(0.6, 2.0) / math.sqrt(12.0))
    rectangle = Block(0.9, size, slender=slender)
    solid = Block(0.9, critical_angle=None if slender else size.critical_angle, body=body, slender=slender)
    first, second = (
        simulate(Scene(block, SHAKING, noise), cycles=6, realizations=50, seed=3) for block in (rectangle, solid)
    )
    assert np.array_equal(first.angle, second.angle, equal_nan=True)
    assert np.array_equal(first.overturn_time, second.overturn_time, equal_nan=True)
    assert 0 < np.count_nonzero(first.overturn_side) < 50


def test_runge_kutta_steps_of_a_body_converge_to_its_path():
    scene = Scene(Block(body=STATUE), SHAKING, BandNoise(0.3, (0.0, 8.0), 20))
    exact = simulate(scene, cycles=3, realizations=60, seed=2)
    errors = []
    for steps in (50, 100, 200):
        ensemble = simulate(scene, cycles=3, realizations=60, seed=2, method="rk4", steps_per_cycle=steps)
        errors.append(np.nanmedian(np.abs(ensemble.angle - exact.angle)[:, 1:]))
    assert np.polyfit(np.log([50, 100, 200]), np.log(errors), 1)[0] == pytest.approx(-4.0, abs=0.5)


@pytest.mark.parametrize("size", [pytest.param(1, id="few"), pytest.param(10, marks=pytest.mark.slow, id="many")])
@pytest.mark.parametrize("kind", ["white", "filtered"])
def test_bodies_under_noise_fall_as_often_as_in_metres_and_seconds(kind, size):
    """To either side, within what four times as many steps change and 5 standard errors: a false alarm in a million."""
    alpha, rate = rates(LENGTHS)
    unit, end = G * alpha, 6.0 * SHAKING.period / rate
    noise = WhiteNoise(0.02) if kind == "white" else FilteredNoise("low-pass", 0.3, 4.0, 0.7)
    random = body_paths.white(0.04 * unit**2 / rate)
    if kind == "filtered":
        random = body_paths.low_pass(0.3 * unit**2, 4.0 * rate, 0.7)

    def base(time):
        return -1.3 * unit * math.cos(2.2 * rate * time + 0.4)

    paths = 1_000 * size
    coarse, fine = (
        np.array(body_paths.overturned(LENGTHS, 0.5 * math.pi * alpha, base, random, end, paths, steps, seed=steps))
        for steps in (1_200, 4_800 if size > 1 else 2_400)
    )
    ensemble = simulate(Scene(Block(body=STATUE), SHAKING, noise), cycles=6, realizations=20_000, seed=5)
    shares = np.array([np.mean(ensemble.overturn_side == side) for side in (-1, 1)])
    spread = np.sqrt(shares * (1.0 - shares) * (1.0 / 20_000 + 1.0 / paths))
    assert np.all(np.abs(shares - fine) < np.abs(fine - coarse) + 5.0 * spread)
    assert shares.min() > 0.02


@pytest.mark.parametrize("side", [-1, 1])
def test_forces_accelerate_the_centre_of_a_body(side):
    """The corner moves with the base; the second difference of the centre's place over a step h has the order 2."""
    alpha, rate = rates(LENGTHS)

    def base(time):
        return side * G * alpha * (0.6 + 0.9 * np.cos(3.0 * rate * time))

    body = body_motion.BodyInMetres(LENGTHS, G, base, [], 1.0)
    solved = solve_ivp(
        lambda t, y: (y[1], body.turning(t, y[0], side)), (0.0, 1.2 / rate), side * alpha * np.array([0.3, 0.9 * rate]),
        "DOP853", rtol=1e-13, atol=1e-14, dense_output=True,
    )  # fmt: skip

    def centre(times):
        return np.array([body.centre(angle, side) for angle in solved.sol(times)[0]]).T

    times = np.linspace(0.1, 1.1, 11) / rate
    angle, velocity = solved.sol(times)[0] / alpha, solved.sol(times)[1] / (alpha * rate)
    assert np.all(side * angle > 0.0)
    sides = SidesOfContact(STATUE.saddles, STATUE.acceleration_scales, STATUE.levers)
    forces = forces_at(angle, velocity, base(times) / (G * alpha), alpha, False, sides)
    errors = []
    for step in (0.02, 0.01, 0.005):
        h = step / rate
        second = (centre(times + h) - 2.0 * centre(times) + centre(times - h)) / h**2
        second[0] -= base(times)
        second[1] += G
        errors.append(np.abs(forces - second / G).max())
    assert np.polyfit(np.log([0.02, 0.01, 0.005]), np.log(errors), 1)[0] == pytest.approx(2.0, abs=0.05)
    assert errors[-1] < 1e-4
