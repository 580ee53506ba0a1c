"""Runge-Kutta and white-noise paths of blocks as they are: orders, the slender limit, rest, pulses, and exact laws."""

import math

import numpy as np
import pytest
import white_paths
from scipy.integrate import solve_ivp
from whole_paths import followed

from fpk_rocking.physics.motion.equation import KernelBlock
from fpk_rocking.physics.motion.flight import covariance_factor
from fpk_rocking.scene import (
    BandNoise,
    Block,
    Dimensions,
    Harmonic,
    NoNoise,
    Overturning,
    Pulse,
    Scene,
    Start,
    WhiteNoise,
)
from montecarlo import histories, simulate
from montecarlo.engines import rk4
from montecarlo.engines.band_noise import draw_start_and_noise
from montecarlo.engines.barriers import nystrom_step
from montecarlo.engines.random import open_stream, stream_keys
from montecarlo.engines.rk4 import classical_step

ALPHA, CUTOFF = 0.3, math.pi / 2
FORCING = Harmonic(3.0, 2.7, math.pi)
BAND = Scene(Block(0.8, critical_angle=ALPHA), FORCING, BandNoise(0.04, (0.0, 10.0), 20))
WHITE = BAND.varied(noise=WhiteNoise(0.006))


def force(t):
    return 2.0 * math.cos(3.0 * t + 0.4)


def flight(u, w, side, end):
    """State after a flight without noise, and the covariance of unit diffusion that gathers in it."""

    def move(t, y):
        phi = ALPHA * (1.0 - y[0])
        steep = math.cos(phi) + side * force(t) * ALPHA * math.sin(phi)
        lift = side * force(t) * math.cos(phi) - math.sin(phi) / ALPHA
        return y[1], lift, 2.0 * y[3], y[4] + steep * y[2], 2.0 * (steep * y[3] + math.cos(phi) ** 2)

    return solve_ivp(move, (0.0, end), (u, w, 0.0, 0.0, 0.0), method="DOP853", rtol=1e-12, atol=1e-14).y[:, -1]


def stepped(method, u, w, side, n):
    """State after n steps through a flight of .6, and its covariance by differences of the state in every step."""
    h, body, covariance = 0.6 / n, KernelBlock(0.8, CUTOFF, ALPHA), np.zeros((2, 2))
    factor = np.zeros((2, 2))
    factor[np.tril_indices(2)] = covariance_factor(1.0, h)
    for k in range(n):
        forces = [force((k + part) * h) for part in (0.0, 0.5, 1.0)]
        states = [method(u + a, w + b, side, *forces, h, body) for a, b in ((0.0, 0.0), (1e-6, 0.0), (0.0, 1e-6))]
        here = np.array([state[:2] for state in states])
        turn = (here[1:] - here[0]).T / 1e-6
        strength = states[0][2] if len(states[0]) == 3 else math.nan
        covariance = turn @ covariance @ turn.T + strength**2 * factor @ factor.T
        u, w = here[0]
    return np.array([u, w, covariance[0, 0], covariance[0, 1], covariance[1, 1]])


def test_orders_of_a_flight():
    """State of order 4 by both methods; covariance, by differences of the state, of order 2 and to 1e-3 at h = .075."""
    counts = np.array([4, 8, 16, 32])
    flights = [(u, w, side) for u, w in ((0.3, 0.5), (0.9, -0.7)) for side in (-1, 1)]
    truth = np.array([flight(*start, 0.6) for start in flights])
    for method in (classical_step, nystrom_step):
        ends = np.array([[stepped(method, *start, n) for start in flights] for n in counts])
        errors = np.abs(ends - truth)
        state = errors[:, :, :2].max(axis=(1, 2))
        assert -np.polyfit(np.log(counts), np.log(state), 1)[0] == pytest.approx(4.0, abs=0.15)
        assert state[1] < 3e-6
    gathered = errors[:, :, 2:].max(axis=(1, 2)) / truth[:, 2:].max()
    assert -np.polyfit(np.log(counts), np.log(gathered), 1)[0] == pytest.approx(2.0, abs=0.15)
    assert gathered[1] < 1e-3


def noise_of(scene, number, seed):
    """Force of a realization as a function of time, from the frequencies and phases that the engine draws."""
    parameters = rk4.parameters_of(scene, 50)
    harmonics = rk4.workspace_of(parameters).harmonics
    draw_start_and_noise(open_stream(stream_keys(seed), number), parameters.start, parameters.band, harmonics)
    rates, phases = 2.0 * math.pi * harmonics.ratios / scene.period, 2.0 * math.pi * harmonics.phases
    harmonic = scene.forcing
    return lambda t: (
        -harmonic.amplitude * math.cos(harmonic.frequency * t + harmonic.phase)
        + float(harmonics.weights @ np.cos(rates * t + phases))
    )


def test_runge_kutta_is_of_order_four_along_the_same_noise():
    counts, size, times = np.array([50, 100, 200, 400]), 12, BAND.period * np.arange(1, 3)
    truth = np.array([followed(ALPHA, 0.8, CUTOFF, noise_of(BAND, r, 3), (0.0, 0.0), times) for r in range(size)])
    medians = []
    for n in counts:
        ensemble = simulate(BAND, cycles=2, realizations=size, seed=3, method="rk4", steps_per_cycle=int(n))
        assert np.array_equal(np.isnan(ensemble.angle[:, 1:]), np.isnan(truth[:, :, 0]))
        medians.append(np.nanmedian(np.abs(ensemble.angle[:, 1:] - truth[:, :, 0])))
    assert np.isfinite(truth).mean() > 0.5
    assert -np.polyfit(np.log(counts), np.log(medians), 1)[0] == pytest.approx(4.0, abs=0.15)
    assert medians[-1] < 1e-8


@pytest.mark.parametrize(("scene", "method"), [(BAND, "rk4"), (WHITE, "white")])
def test_the_slender_block_is_the_limit(scene, method):
    """The same realizations: second order in the critical angle, and the same to the last bit at 0."""
    common = {"cycles": 1, "realizations": 300, "seed": 5, "method": method}
    slender = simulate(scene.varied(block=Block(0.8)), **common)
    tall = Dimensions(0.5, 1.8)
    for block in (Block(0.8, critical_angle=0.0), Block(0.8, tall, slender=True)):
        assert simulate(scene.varied(block=block), **common).angle.tobytes() == slender.angle.tobytes()
    angles, medians = np.array([0.02, 0.04, 0.08]), []
    for angle in angles:
        ensemble = simulate(scene.varied(block=Block(0.8, critical_angle=float(angle))), **common)
        medians.append(np.nanmedian(np.abs(ensemble.angle - slender.angle)[:, 1]))
    assert np.polyfit(np.log(angles), np.log(medians), 1)[0] == pytest.approx(2.0, abs=0.15)


def test_mirrored_scenes_have_mirrored_paths():
    scene = BAND.varied(noise=NoNoise(), start=Start(0.2, 0.3))
    mirrored = scene.varied(forcing=Harmonic(3.0, 2.7, 2.0 * math.pi), start=Start(-0.2, -0.3))
    paths = [simulate(side, cycles=3, realizations=1, method="rk4") for side in (scene, mirrored)]
    assert paths[0].angle == pytest.approx(-paths[1].angle, abs=1e-9)


def test_a_block_at_rest_leaves_above_its_own_level():
    """tan(α)/α = 1.0311."""
    for amplitude, leaves in ((1.031, False), (1.032, True)):
        scene = BAND.varied(forcing=Harmonic(amplitude, 2.7, 0.3), noise=NoNoise())
        history = histories(scene, cycles=1, realizations=1, method="rk4", samples_per_cycle=32)
        assert (np.abs(history.angle).max() > 0.0) == leaves


@pytest.mark.parametrize(("amplitude", "overturns"), [(1.4647, 0), (1.4649, 1), (3.6042, 1), (3.6044, 0), (3.7933, 1)])
def test_pulses_overturn_where_independent_integrations_say(amplitude, overturns):
    """One-sine pulse, ω/p = 3 and Housner's restitution; overturned where the angle is π/2 radians, known to 1e-4."""
    block = Block(1.0 - 1.5 * math.sin(ALPHA) ** 2, critical_angle=ALPHA)
    scene = Scene(block, Pulse("one-sine", amplitude, 3.0), NoNoise(), overturning=Overturning(0.5 * math.pi / ALPHA))
    path = simulate(scene, times=np.array([60.0]), method="rk4", steps_per_cycle=400)
    assert abs(path.overturn_side[0]) == overturns


def test_paths_of_vanishing_noise_are_those_without():
    """Through impacts, of a cycle and of a pulse."""
    for forcing, times in ((Harmonic(1.5, 2.7, 0.3), {"cycles": 2}), (Pulse("one-sine", 1.4, 3.0), {})):
        scene = Scene(Block(0.8, critical_angle=ALPHA), forcing, NoNoise(), Start(0.5, 0.0))
        truth = simulate(scene, method="rk4", steps_per_cycle=1000, realizations=1, **times)
        ensemble = simulate(scene.varied(noise=WhiteNoise(1e-12)), realizations=3, **times)
        assert np.isfinite(truth.angle).all()
        assert np.abs(ensemble.angle - truth.angle).max() < 2e-5


@pytest.mark.parametrize(("angle", "diffusion"), [(0.5, 0.006), (0.8, 0.001)])
def test_an_unforced_block_bounces_as_it_must(angle, diffusion):
    """Balances of momentum, energy and virial in the quasi-steady state, u = |x|.

    With M_2, M_3 the sums per time of the impact speeds and their squares: (1 + e) M_2 = <sin φ>/α,
    (1 - e^2) M_3/2 = D <cos² φ>, <v^2> = <u sin φ>/α. Under the weaker noise nearly all bounces are one draw. False
    alarm 6 x 6e-5.
    """
    restitution, paths, burnt = 0.6, 600, 1.0
    scene = Scene(Block(restitution, critical_angle=angle), Harmonic(0.0, 2.0 * math.pi), WhiteNoise(diffusion))
    run = histories(scene, cycles=4, realizations=paths, seed=3, steps_per_cycle=100, samples_per_cycle=16)
    late = run.impact_time > burnt
    who, speed = run.impact_realization[late], np.abs(run.impact_velocity[late])
    momentum, energy = (np.bincount(who, speed**k, minlength=paths) / (4.0 - burnt) for k in (1, 2))
    u, v = np.abs(run.angle[:, 17:]), run.velocity[:, 17:]
    phi = angle * (1.0 - u)
    balances = np.stack(
        [
            (1.0 + restitution) * momentum - (np.sin(phi) / angle).mean(axis=1),
            (1.0 - restitution**2) * energy / 2.0 - diffusion * (np.cos(phi) ** 2).mean(axis=1),
            (v * v).mean(axis=1) - (u * np.sin(phi) / angle).mean(axis=1),
        ]
    )
    assert not np.any(run.overturn_side)
    error = balances.std(axis=1, ddof=1) / math.sqrt(paths)
    assert np.all(error < [0.003, 0.01 * diffusion, 0.015 * (v * v).mean()])
    assert np.abs(balances.mean(axis=1) / error).max() < 4.0


@pytest.mark.parametrize("paths", [4_000, pytest.param(20_000, marks=pytest.mark.slow)])
def test_survival_is_that_of_an_independent_program(paths):
    """100,000 paths against fewer in small steps; false alarm 3 x 6e-5."""
    scene = WHITE.varied(noise=WhiteNoise(0.012))
    ensemble = simulate(scene, cycles=3, realizations=100_000, seed=4)
    forcing = scene.forcing.amplitude, scene.forcing.frequency, scene.forcing.phase
    fine, coarse = white_paths.survival((ALPHA, 0.8), CUTOFF, forcing, 0.012, (0.0, 0.0), 3, paths, 240, 6)
    error = np.sqrt(fine * (1.0 - fine) / paths + ensemble.survival[1:] * (1.0 - ensemble.survival[1:]) / 100_000)
    assert 0.1 < fine[-1] < 0.9
    assert np.abs(coarse - fine).max() < 0.01
    assert np.abs((ensemble.survival[1:] - fine) / error).max() < 4.0
