"""Bodies of unequal sides against an integration in metres and seconds, and symmetric ones against rectangles."""

import math

import body_motion
import numpy as np
import pytest
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
    WhiteNoise,
)
from montecarlo import contact_forces, histories, simulate, split

STATUE = Body(1.1, 0.30, 0.38, 0.62)
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


def difference(case):
    """Largest differences in time (τ) and in velocity of the events of a case from those in metres and seconds.

    Impacts slower than 1e-4, of a burst that is summed as chatter, are left out. inf where outcome, side or number of
    impacts differ.
    """
    scene, motion, rate, end = case
    alpha = scene.block.critical_angle
    paths = histories(scene, times=[0.5 * end, end])
    motion.run(end / rate)
    time, side = motion.outcome
    events = np.array([(rate * when, speed / (alpha * rate)) for when, speed, _ in motion.events]).reshape(-1, 2)
    ours = np.column_stack([paths.impact_time, paths.impact_velocity])
    ours, events = (rows[np.abs(rows[:, 1]) > 1e-4] for rows in (ours, events))
    if paths.overturn_side[0] != side or len(ours) != len(events):
        return math.inf, math.inf
    last = abs(paths.overturn_time[0] - rate * time) if side else 0.0
    apart = np.abs(ours - events).max(axis=0, initial=0.0)
    return max(apart[0], last), apart[1]


@pytest.mark.parametrize("make", [pulse_case, record_case])
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
@pytest.mark.parametrize("make", [pulse_case, record_case])
def test_many_bodies_move_as_in_metres_and_seconds(make):
    rng = np.random.default_rng(21)
    worst = np.array([difference(make(rng)) for _ in range(100)])
    assert worst.max() < 1e-8
