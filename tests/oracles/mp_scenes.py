"""The many-digit reference for realizations of scenes: the same random numbers, a list of scenes, and the comparison.

Impacts are compared in their order, so one that is missed or invented is noticed. Those slower than `SLOW` are left
out, as engines sum them; impacts end to be comparable at the *horizon*, where `Event.late` first exceeds `LOST`.
"""

import math

import numpy as np
from mp_motion import Signal
from mp_oracle import follow
from mpmath import mp, mpf

from fpk_rocking.physics.noise import band
from fpk_rocking.scene import BandNoise, Block, Harmonic, NoNoise, Scene, Start
from montecarlo.engines import band_noise, rk4
from montecarlo.engines.random import open_stream, stream_keys

SLOW = 1e-5
LOST = 1e-4


def follow_scene(scene, seed, realization, cycles, rounding=2e-14, digits=50):
    """Follow one realization of a scene with band noise or none; the states are its Poincaré points.

    Frequencies and phases are the very numbers that the engines draw; what they are multiplied with is exact.
    """
    parameters = rk4.parameters_of(scene, 8)
    harmonics = band.allocate_realization(parameters.band.harmonics, 1)
    stream = open_stream(stream_keys(seed), realization)
    angle, velocity = band_noise.draw_start_and_noise(stream, parameters.start, parameters.band, harmonics)
    rows = harmonics.ratios, harmonics.phases, harmonics.weights
    ratios, phases, weights = (row[: parameters.band.harmonics].tolist() for row in rows)
    forcing = scene.forcing
    with mp.workdps(digits + 15):
        omega = mpf(forcing.frequency)
        signal = Signal(
            [omega, *(ratio * omega for ratio in ratios)],
            [forcing.phase, *(2 * mp.pi * phase for phase in phases)],
            [-forcing.amplitude, *weights],
        )
        times = [2 * mp.pi * k / omega for k in range(cycles + 1)]
    return follow(signal, scene.block.restitution, scene.overturning.angle, angle, velocity, times, digits, rounding)


def random_scenes(count, seed=1):
    """Return scenes of many kinds, from rest and from anywhere; the same ones for the same seed, however many."""
    return [_random_scene(np.random.default_rng([seed, number])) for number in range(count)]


def _random_scene(rng):
    restitution = rng.choice([0.0, 1.0, rng.uniform(), rng.uniform(0.3, 0.95)], p=[0.05, 0.05, 0.45, 0.45])
    forcing = Harmonic(rng.uniform(0.5, 6.0), rng.uniform(1.0, 6.0), rng.uniform(0.0, 2.0 * math.pi))
    edges = np.sort(rng.uniform(0.0, 12.0, 2))
    harmonics = int(rng.integers(0, 31))
    disturbance = BandNoise(rng.uniform(0.0, 0.3), tuple(edges), harmonics) if harmonics else NoNoise()
    start = Start(rng.uniform(-0.8, 0.8), rng.uniform(-0.8, 0.8)) if rng.uniform() < 0.5 else Start()
    return Scene(Block(float(restitution)), forcing, disturbance, start)


def compare(path, times, velocities):
    """Compare the impacts that an engine lists with those of a path, up to the horizon.

    Parameters
    ----------
    path : mp_oracle.Path
        Made with the `rounding` that is expected of the engine.
    times, velocities : array_like, shape (n,)
        Impacts of the engine in their order; velocities just before.

    Returns
    -------
    ndarray, shape (compared, 4)
        Of each impact within the horizon `Event.late`, the error in time, `Event.off` and the error in velocity.

    Raises
    ------
    AssertionError
        The numbers of impacts within the horizon differ.
    """
    expected, horizon = [], math.inf
    for event in path.events:
        if event.kind != "impact" or abs(event.velocity) <= SLOW:
            continue
        if event.late > LOST:
            # An engine's impact belongs to the horizon's or to an earlier one, whichever is nearer.
            horizon = 0.5 * float(event.time + (expected[-1].time if expected else path.states[0].time))
            break
        expected.append(event)
    times, velocities = np.asarray(times), np.asarray(velocities)
    listed = (np.abs(velocities) > SLOW) & (times < horizon)
    assert listed.sum() == len(expected), (times[listed], [float(event.time) for event in expected])
    rows = zip(times[listed].tolist(), velocities[listed].tolist(), expected, strict=True)
    errors = [(e.late, float(abs(time - e.time)), e.off, float(abs(v - e.velocity))) for time, v, e in rows]
    return np.array(errors).reshape(-1, 4)
