"""The density of bodies of unequal sides: steps, mirror images, paths in metres and seconds, and the operator."""

import math

import body_motion
import body_paths
import numpy as np
import pytest
from numpy.polynomial import legendre
from traced import path_ends

from fpk_rocking import Block, Body, FilteredNoise, Harmonic, Pulse, Scene, Start, WhiteNoise, solve_fpk
from fpk_rocking.base.basis import gauss_hermite_product
from fpk_rocking.density.propagator import PeriodicPropagator
from fpk_rocking.density.resolution import RESOLUTIONS, StateRange
from fpk_rocking.density.space import Space, graded_lines, reflected, velocity_bound
from fpk_rocking.density.step.characteristics import Noise, principal_axes
from fpk_rocking.density.step.dynamics import Dynamics
from fpk_rocking.density.step.step import Characteristics, Quadrature, Step
from fpk_rocking.density.sticking import Sticking
from fpk_rocking.horizon.mesh_operator import MeshOperator
from fpk_rocking.physics.motion.flight import flight_covariance
from montecarlo import simulate

LENGTHS = 1.1, 0.30, 0.42, 0.62
STATUE = Body(*LENGTHS)
SHAKING = Harmonic(2.6, 2.2, 0.4)
SCENE = Scene(Block(body=STATUE), SHAKING, WhiteNoise(0.03), Start(0.2, 0.0))
MOTION = StateRange(0.8, 1.2, (-1.2, 1.2), (-1.6, 1.6), 2.0)
# As low on one side as on the other: restitutions that differ much, and a side that is hard to reach.
SQUAT = Scene(Block((0.75, 0.45), body=STATUE), SHAKING, WhiteNoise(0.03), Start(0.2, 0.0))


def propagator(scene, number=0):
    plane = RESOLUTIONS[number].adapted(scene, velocity_bound(scene, scene.noise.diffusion), MOTION)
    return PeriodicPropagator(scene, plane, 1e-8)


def test_a_step_conserves_mass_and_its_adjoint_is_dual_to_it():
    """Any density, any function after the step, any values of the three ways out."""
    dynamics, duration = Dynamics.of(SCENE), SCENE.period / 16
    lines = graded_lines(SCENE.overturning.angle, 14, 1.5), graded_lines(velocity_bound(SCENE, 0.03), 18, 1.3)
    space, rng = Space(*lines, 3), np.random.default_rng(7)
    step = Step(Characteristics(space, 3 * duration, duration, dynamics, Quadrature(5, 6, 5, 2)), space)
    density, function, values = rng.normal(size=space.shape), rng.normal(size=space.shape), rng.normal(size=3)
    after, outflow = step.apply(density)
    before = step.apply_adjoint(function, values)
    masses, expected = space.masses(density).sum(), np.einsum("xvab,xvab,xv->", after, function, space.areas)
    assert np.abs(outflow).min() > 1e-3
    assert space.masses(after).sum() + outflow.sum() == pytest.approx(masses, abs=1e-12)
    dual = np.einsum("xvab,xvab,xv->", density, before, space.areas)
    assert dual == pytest.approx(expected + outflow @ values, abs=1e-11)


@pytest.mark.parametrize("side", [-1, 1])
def test_noise_is_carried_through_an_impact_with_the_restitution_of_its_side(side):
    """Weak noise: covariance of the nodes against responses of the flow without noise to kicks, summed over time."""
    dynamics, duration, diffusion, step = Dynamics.of(SQUAT), 0.1, 1e-12, 1e-4
    start, point, block = 0.3, (side * 0.02, side * -0.7), dynamics.block

    def flow(state, on, begin, end):
        still = Noise(end - begin, 0.0, np.zeros((1, 2)), np.zeros((1, 2)), 0.0)
        states, flags = path_ends(*state, on, dynamics.segment(begin, end - begin), block, still)
        return states[0], int(flags[0])

    nodes, weights = gauss_hermite_product(5, 3)
    offsets = nodes @ np.reshape(principal_axes(*flight_covariance(diffusion, duration)), (2, 2))
    noise = Noise(duration, diffusion, nodes, offsets, np.abs(offsets[:, 0]).max())
    states, flags = path_ends(*point, side, dynamics.segment(start, duration), block, noise)
    mean, _ = flow(point, side, start, start + duration)
    assert np.all(flags == -side)
    early, late = start, start + duration
    for _ in range(50):
        middle = 0.5 * (early + late)
        early, late = (middle, late) if flow(point, side, start, middle)[1] == side else (early, middle)
    covariance, factors = np.zeros((2, 2)), []
    for low, high, on in ((start, early, side), (late, start + duration, -side)):
        for node, part in zip(*legendre.leggauss(6), strict=True):
            time = low + 0.5 * (high - low) * (node + 1.0)
            x, v = flow(point, side, start, time)[0]
            ahead, behind = (flow((x, v + kick), on, time, start + duration)[0] for kick in (step, -step))
            saddle, scale = (pair[on > 0] for pair in (block.saddles, block.scales))
            factor = scale * math.cos(block.critical_angle * (saddle - abs(x)))
            factors.append(factor)
            response = factor * (ahead - behind) / (2.0 * step)
            covariance += diffusion * (high - low) * part * np.outer(response, response)
    gathered = np.einsum("n,ni,nj->ij", weights, states - mean, states - mean)
    # Factors half way along a flight, growth as of a slender block: both of second order in the step.
    assert gathered == pytest.approx(covariance, rel=2e-3, abs=0.0)
    assert min(factors) < 0.97


@pytest.mark.slow
def test_the_mirror_image_of_a_body_has_the_mirror_image_of_its_density():
    image = SCENE.varied(
        block=Block(body=Body(1.1, 0.42, 0.30, 0.62)), forcing=SHAKING.at_phase(0.4 + math.pi), start=Start(-0.2, 0.0)
    )
    times = SCENE.period * np.arange(3)
    first, second = (propagator(scene).propagate(times) for scene in (SCENE, image))
    assert first.outflow[-1].min() > -1e-9
    assert abs(first.outflow[-1, 0] - first.outflow[-1, 1]) > 0.05
    assert second.outflow[:, [1, 0, 2]] == pytest.approx(first.outflow, abs=1e-10)
    assert np.abs(reflected(second.coefficients[-1]) - first.coefficients[-1]).max() < 1e-8


@pytest.mark.slow
def test_a_body_falls_as_often_as_in_metres_and_seconds():
    """Paths of a leapfrog, extrapolated, to either side: 4 standard errors are wrong once in 8,000 seeds."""
    alpha, rate, start, paths = STATUE.critical_angle, STATUE.frequency_parameter, SCENE.varied(start=Start()), 20_000
    unit, end = body_paths.G * alpha, 2.0 * SCENE.period / rate

    def base(time):
        return -2.6 * unit * math.cos(2.2 * rate * time + 0.4)

    random = body_paths.white(2.0 * 0.03 * unit**2 / rate)
    coarse, fine = (
        np.array(body_paths.overturned(LENGTHS, 0.5 * math.pi * alpha, base, random, end, paths, steps, seed=3))
        for steps in (300, 600)
    )
    outflow = propagator(start, 2).propagate(SCENE.period * np.arange(3)).outflow[-1, :2]
    assert outflow == pytest.approx(2.0 * fine - coarse, abs=4e-3 + 4.0 * math.sqrt(5.0 * 0.2 / paths))


@pytest.mark.slow
def test_the_operator_decays_as_the_density_and_repeats_after_a_whole_cycle():
    operator = MeshOperator(SCENE, RESOLUTIONS[0], MOTION, velocity_bound(SCENE, 0.03))
    survival = propagator(SCENE).propagate(SCENE.period * np.arange(11)).survival
    assert operator.periods == 1
    assert operator.rate == pytest.approx(math.log(survival[-2] / survival[-1]), rel=2e-3)
    assert operator.leaks.sum() == pytest.approx(-math.expm1(-operator.rate), rel=1e-6)
    assert operator.leaks[1] != pytest.approx(operator.leaks[0], rel=0.1)
    assert abs(operator.left_modes.values[0] - operator.modes.values[0]) < 1e-8


def test_a_body_lifts_off_to_each_side_at_its_own_level():
    """The force rises through the level of one side and then the other, half a cycle apart."""
    dynamics, alpha = Dynamics.of(SCENE), STATUE.critical_angle
    levels = {-1: 0.42 / 1.1 / alpha, 1: 0.30 / 1.1 / alpha}
    assert dynamics.lift_off == pytest.approx(levels[1], rel=1e-12)
    for time in np.linspace(0.0, SCENE.period, 40):
        force, (since, slope) = SHAKING.value(time), dynamics.since_lift_off(time)
        assert dynamics.rest_gap(time) == pytest.approx(min(levels[1] - force, levels[-1] + force), abs=1e-12)
        crossed = SHAKING.value(time - since)
        if since <= time:
            assert abs(crossed) == pytest.approx(levels[1 if crossed > 0.0 else -1], abs=1e-8)
            assert slope == pytest.approx(abs(SHAKING.slope(time - since)), rel=1e-6)
    weak = Dynamics.of(SCENE.varied(forcing=Harmonic(1.2, 2.2, 0.4)))
    assert levels[1] < 1.2 < levels[-1]
    crossings = {round(time - weak.since_lift_off(time)[0], 6) for time in np.linspace(4.0, 4.0 + SCENE.period, 30)}
    assert all(Harmonic(1.2, 2.2, 0.4).value(crossing) > 0.0 for crossing in crossings)


def test_a_symmetric_body_is_the_rectangle():
    size = math.hypot(0.6, 2.0) / math.sqrt(12.0)
    body, rectangle = Block(0.9, body=Body(1.0, 0.3, 0.3, size)), Block(0.9, critical_angle=math.atan(0.3))
    assert Dynamics.of(SCENE.varied(block=body)) == Dynamics.of(SCENE.varied(block=rectangle))


@pytest.mark.slow
def test_a_pulse_on_a_body_agrees_with_paths():
    """To either side and in survival, at two times: 4 standard errors are wrong once in 3,000 seeds."""
    body, pulse, size = Body(1.09, 0.30, 0.43, 0.70), Pulse("one-cosine", 3.4, 3.9), 20_000
    scene = Scene(Block(body=body), pulse, WhiteNoise(0.03))
    density = solve_fpk(scene, times=[2.0, 5.6], tol=1e-2)
    paths = simulate(scene, times=[2.0, 5.6], realizations=size, seed=6)
    expected = np.column_stack([paths.survival, paths.overturned])
    error = density.error_estimate + 4.0 * np.sqrt(expected * (1.0 - expected) / size) + 1.0 / size
    assert np.all(np.abs(np.column_stack([density.survival, density.overturned]) - expected) <= error)
    assert 0.01 < expected[-1, 1] < 0.9 * expected[-1, 2]


def test_a_body_sticks_by_the_means_over_both_sides():
    """Where the scale of the speeds of its layer, 4 D / (3 (1 - E) h), is at most an eighth of .1 at the worst force.

    Pulls and noise at zero angle are those of a body in metres and seconds.
    """
    alpha, rate, peak, e = STATUE.critical_angle, STATUE.frequency_parameter, 0.5, STATUE.restitution
    scales = []
    for force in np.linspace(-peak, peak, 41):
        pulls, parts = [], []
        for side in (-1, 1):
            turnings = []
            for f in (force, force + 1.0):
                motion = body_motion.BodyInMetres(
                    LENGTHS, body_paths.G, lambda _, f=f: body_paths.G * alpha * f, [], 1.0
                )
                turnings.append(motion.turning(0.0, 0.0, side) / (alpha * rate**2))
            pulls.append(-side * turnings[0])
            parts.append(turnings[1] - turnings[0])
        weights = 1.0 / np.array(pulls)
        noise = (weights * np.square(parts)).sum() / weights.sum()
        scales.append(4.0 * noise / (3.0 * (1.0 - e[0] * e[1]) * 2.0 / weights.sum()))
    limit = 0.1 / 8.0 / max(scales)
    force = Pulse("n-sine", peak, 0.1 * math.pi, 2)
    for diffusion, sticks in ((0.98 * limit, True), (1.02 * limit, False)):
        rule = Sticking(Dynamics.of(Scene(Block(body=STATUE), force, WhiteNoise(diffusion))), 45.0, 1.0)
        assert (rule.until(0.0) == np.inf) is sticks


@pytest.mark.slow
def test_a_body_that_is_all_but_symmetric_has_the_density_of_the_symmetric_one():
    """It sticks, is lifted off twice by a slow pulse, and sticks again."""
    scene = Scene(Block((0.7, 0.7), body=Body(1.0, 0.3, 0.3, 0.6)), Pulse("n-sine", 1.25, 1.2, 1), WhiteNoise(1e-3))
    assert scene.block.symmetric
    uneven = scene.varied(block=Block((0.7, 0.7 - 1e-9), body=Body(1.0, 0.3, 0.3 + 1e-9, 0.6)))
    first, second = (solve_fpk(each, times=[3.0, 8.0], tol=1e-2) for each in (scene, uneven))
    assert second.survival == pytest.approx(first.survival, abs=1e-4)
    assert 0.01 < first.survival[-1] < 0.99


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"noise": FilteredNoise("exponential", 0.1, 4.0)}, "for the density under filtered noise"),
        ({"block": Block((0.9, 0.02), body=STATUE)}, r"^block.restitution: got \(0.9, 0.02\)"),
    ],
)
def test_what_a_body_cannot_have_is_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        solve_fpk(SCENE.varied(**changes), cycles=1)
