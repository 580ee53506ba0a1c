"""The density of a block as it is: flight, the limit of a slender block, rest, and paths that share nothing with it."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from traced import path_ends
from white_paths import survival

from fpk_rocking import Block, FilteredNoise, Harmonic, Scene, Start, WhiteNoise
from fpk_rocking.base.basis import gauss_hermite_product
from fpk_rocking.density.density import Density
from fpk_rocking.density.filter_nodes import FilteredDiscretization, Nodes, may_rest
from fpk_rocking.density.filtered import FilteredPropagator
from fpk_rocking.density.patches import Gaussian
from fpk_rocking.density.propagator import PeriodicPropagator
from fpk_rocking.density.resolution import RESOLUTIONS, explore
from fpk_rocking.density.space import Space, velocity_bound
from fpk_rocking.density.startup import FilteredStart
from fpk_rocking.density.step.characteristics import Noise, principal_axes
from fpk_rocking.density.step.dynamics import Dynamics
from fpk_rocking.density.step.free_flight import displaced
from fpk_rocking.density.step.step import Characteristics, Quadrature, Step
from fpk_rocking.density.sticking import Sticking
from fpk_rocking.physics.motion.equation import KernelBlock, UnequalSides
from montecarlo import simulate

FORCING = Harmonic(3.6, 2.7, math.pi)
FILTERED = FilteredNoise("exponential", 0.05, 5.0)


def plane_of(scene, number=0):
    white, times = scene.white_equivalent(), scene.period * np.arange(3)
    return RESOLUTIONS[number].adapted(white, velocity_bound(white, white.noise.diffusion), explore(white, times))


def discretization_of(plane, scene, steps, nodes=(5,), points=5):
    periods = 2 if scene.forcing.half_antisymmetric else 1
    return FilteredDiscretization(plane, nodes, points, np.linspace(0.0, 1.0 / periods, steps // periods + 1))


def with_angle(scene, angle):
    return scene.varied(block=Block(scene.block.restitution, critical_angle=float(angle)))


def flown(alpha, forcing, states, duration, diffusion=0.0, side=1, saddle=1.0, scale=1.0):
    """Mean (2, n) and covariance (3, n) after a flight from points on a side, to second order in the noise."""

    def rates(time, flat):
        x, v, xx, xv, vv = flat.reshape(5, -1)
        phi, force = alpha * (saddle - side * x), forcing.value(time)
        stiff = scale * (np.cos(phi) + side * alpha * force * np.sin(phi))
        bend = 0.5 * alpha * scale * (side * np.sin(phi) - alpha * force * np.cos(phi)) * xx
        pull = scale * (force * np.cos(phi) - side * np.sin(phi) / alpha) + bend
        spread = 2.0 * stiff * xv + 2.0 * diffusion * (scale * np.cos(phi)) ** 2
        return np.concatenate([v, pull, 2.0 * xv, vv + stiff * xx, spread])

    begin = np.concatenate([states, np.zeros((3, len(states[0])))]).ravel()
    ends = solve_ivp(rates, (0.0, duration), begin, method="DOP853", rtol=1e-11, atol=1e-12).y[:, -1].reshape(5, -1)
    return ends[:2], ends[2:]


def spread_points(mean, covariance, count=12):
    """Points (2, n) and weights (n,) of Gauss-Hermite quadrature of a Gaussian."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(count)
    pairs = np.stack(np.meshgrid(nodes, nodes, indexing="ij")).reshape(2, -1)
    weights = np.outer(weights, weights).ravel() / weights.sum() ** 2
    return np.reshape(mean, (2, 1)) + np.linalg.cholesky(covariance) @ pairs, weights


UNEQUAL = UnequalSides((1.3, 1.1), (0.8, 1.15), (0.5, 0.6))


@pytest.mark.parametrize(
    ("diffusion", "sides", "side"), [(0.0, None, 1), (0.006, None, 1), (0.006, UNEQUAL, 1), (0.006, UNEQUAL, -1)]
)
def test_flight_is_of_second_order(diffusion, sides, side):
    """Moments after a flight in few steps: what is not linear shifts lines, and blurs them where there is noise."""
    alpha, forcing, duration, spread = 0.9, Harmonic(0.7, 3.0, math.pi + 0.4), 0.3, np.diag([0.0025, 0.0025])
    lines = np.array([-2.5, 0.0, *np.arange(0.05, 1.6, 0.07), 2.5]), np.array([-4.0, *np.arange(-1.2, 1.21, 0.07), 4.0])
    space = Space(np.sort(side * lines[0]), lines[1], 3)
    block = KernelBlock(None if sides else 0.5, 2.5, alpha, sides)
    dynamics, start = Dynamics(forcing, diffusion, block), [side * 0.65, 0.1]
    points, weights = spread_points(start, spread)
    own = block.saddles[side > 0], block.scales[side > 0]
    ends, gathered = flown(alpha, forcing, points, duration, diffusion, side, *own)
    mean = ends @ weights
    exact_moments = np.concatenate([mean, (ends - mean[:, None]) ** 2 @ weights + gathered[::2] @ weights])
    errors = []
    for steps in (2, 4):
        now, span = space.project(Gaussian(start, spread), 12), duration / steps
        for k in range(steps):
            quadrature = Quadrature(5, 5, 5, 2) if diffusion else Quadrature(5, 5, 1, 1, 1)
            now, _ = Step(Characteristics(space, k * span, span, dynamics, quadrature), space).apply(now)
        density = Density(space, now)
        errors.append(np.abs(np.concatenate([density.mean, np.diag(density.covariance)]) - exact_moments).max())
    assert math.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.15)


def displaced_all(states, time, displacement, segment, block):
    """States (2, n) on the right side displaced at a `time` of a segment, see `displaced`."""
    return np.transpose([displaced(x, v, 1, time, displacement, segment, block) for x, v in states.T])


def test_flight_between_displaced_states_is_of_fourth_order():
    """Mean and covariance after a flight in few steps, from real states to real ones by the displacements of both ends.

    What is of second order in the excess, α⁴, is below this at α = .5. Without displacements the order is 2.
    """
    alpha, forcing, duration, spread = 0.5, Harmonic(0.7, 3.0, math.pi + 0.4), 0.6, np.diag([0.0025, 0.0025])
    lines = np.array([-2.5, 0.0, *np.arange(0.05, 1.6, 0.07), 2.5]), np.array([-4.0, *np.arange(-1.2, 1.21, 0.07), 4.0])
    space, dynamics = Space(*lines, 3), Dynamics(forcing, 0.0, KernelBlock(0.5, 2.5, alpha))
    points, weights = spread_points([0.65, 0.1], spread)
    errors, plain = [], []
    for steps in (2, 4):
        now, span = space.project(Gaussian([0.65, 0.1], spread), 12), duration / steps
        for k in range(steps):
            path = Characteristics(space, k * span, span, dynamics, Quadrature(5, 5, 1, 1, 1))
            now, _ = Step(path, space).apply(now)
        density, block, part = Density(space, now), dynamics.block, span**2 / 24.0
        real = displaced_all(points, 0.0, part, dynamics.segment(0.0, span), block)
        displaced_ends = displaced_all(
            flown(alpha, forcing, real, duration)[0], 0.0, -part, dynamics.segment(duration, span), block
        )
        for moments_off, states in ((errors, displaced_ends), (plain, flown(alpha, forcing, points, duration)[0])):
            mean = states @ weights
            moments = np.concatenate([mean, (states - mean[:, None]) ** 2 @ weights])
            moments_off.append(np.abs(np.concatenate([density.mean, np.diag(density.covariance)]) - moments).max())
    assert math.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.3)
    assert math.log2(plain[0] / plain[1]) == pytest.approx(2.0, abs=0.2)
    assert errors[1] < plain[1] / 30.0


def test_an_exact_block_lands_on_another_mesh_only_by_a_trace_made_for_it():
    space, other = (Space(np.linspace(0.5, 0.7, count), np.linspace(-0.1, 0.1, 3), 3) for count in (3, 4))
    dynamics, quadrature = Dynamics(FORCING, 1e-3, KernelBlock(0.5, 1.5, 0.6)), Quadrature(2, 2, 2, 2)
    trace = Characteristics(space, 0.0, 0.01, dynamics, quadrature)
    Step(trace, space)
    Step(Characteristics(space, 0.0, 0.01, dynamics, quadrature, to_other_mesh=True), other)
    with pytest.raises(
        ValueError, match=r"^target: got .*, accepted: the mesh of the characteristics, or some with to_other_mesh"
    ):
        Step(trace, other)


def test_a_node_next_to_contact_has_an_error_of_third_order_in_the_step():
    """A path that leaves x = 0, without noise: what units and the rest of the acceleration leave out."""
    alpha, forcing, errors = 0.6, Harmonic(1.5, 1.5, math.pi - 0.5), []
    for duration in (0.05, 0.025):
        dynamics = Dynamics(forcing, 1e-3, KernelBlock(0.5, 1.5, alpha))
        noise = Noise(duration, dynamics.diffusion, np.zeros((1, 2)), np.zeros((1, 2)), 1.0)
        states, _ = path_ends(0.1, 0.4, 1, dynamics.segment(0.0, duration), dynamics.block, noise)
        exact_ends, _ = flown(alpha, forcing, np.array([[0.1], [0.4]]), duration)
        errors.append(np.abs(states[0] - exact_ends[:, 0]).max())
    assert math.log2(errors[0] / errors[1]) == pytest.approx(3.0, abs=0.15)


def test_noise_of_a_path_without_events_is_that_half_way_along_it():
    """Variance of the velocity at the ends of its nodes, against the moments: the error is of order 2 in the step."""
    alpha, forcing, diffusion, errors = 0.9, Harmonic(2.0, 2.0, 0.3), 1e-6, []
    nodes, weights = gauss_hermite_product(3, 2)
    for duration in (0.1, 0.05):
        dynamics = Dynamics(forcing, diffusion, KernelBlock(0.5, 2.5, alpha))
        offsets = nodes @ np.reshape(principal_axes(*dynamics.covariance(0.0, duration)), (2, 2))
        noise = Noise(duration, diffusion, nodes, offsets, np.abs(offsets[:, 0]).max())
        states, codes = path_ends(0.3, 0.4, 1, dynamics.segment(0.0, duration), dynamics.block, noise)
        assert codes.tolist() == [1] * len(nodes)
        _, exact_covariance = flown(alpha, forcing, np.array([[0.3], [0.4]]), duration, diffusion)
        away = states - weights @ states
        errors.append(abs(weights @ away[:, 1] ** 2 / exact_covariance[2, 0] - 1.0))
    assert errors[0] < 2e-3
    assert math.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.2)


@pytest.mark.parametrize(
    "noise", [WhiteNoise(0.02), pytest.param(FILTERED, marks=pytest.mark.slow)], ids=["white", "filtered"]
)
def test_a_block_becomes_slender_with_order_2(noise):
    """Survival on one mesh, impacts, rest and overturning included."""
    scene = Scene(Block(0.7), Harmonic(4.2, 2.7, math.pi), noise)
    plane, survivals = plane_of(scene), []
    for angle in (0.0, 0.1, 0.2):
        tall = with_angle(scene, angle)
        if noise.kind == "white":
            run = PeriodicPropagator(tall, plane, 1e-9)
        else:
            run = FilteredPropagator(tall, discretization_of(plane, tall, 16), 1e-9)
        solution = run.propagate(scene.period * np.arange(3))
        assert solution.reinjected == 0.0
        survivals.append(solution.survival[-1])
    slender, *exact = survivals
    assert abs(exact[1] - slender) > 1e-3
    assert math.log2((exact[1] - slender) / (exact[0] - slender)) == pytest.approx(2.0, abs=0.15)


def test_the_gaussian_of_a_start_is_of_second_order_in_its_spread():
    """The mean of an undisturbed flight against paths: what is left is of the fourth order of the start's deviation."""
    errors = []
    for deviation in (0.05, 0.1):
        spread = np.diag([deviation**2, deviation**2])
        start = Start(0.8, 0.1, tuple(map(tuple, spread)))
        noise = FilteredNoise("exponential", 1e-12, 3.0)
        scene = Scene(Block(0.5, critical_angle=0.8), Harmonic(0.7, 3.0, 0.4), noise, start)
        mean, _ = FilteredStart(scene, Nodes(noise, (2,)), Dynamics.of(scene.white_equivalent())).at(1.0)
        points, weights = spread_points([0.8, 0.1], spread)
        errors.append(np.abs(mean - flown(0.8, scene.forcing, points, 1.0)[0] @ weights).max())
    assert math.log2(errors[1] / errors[0]) == pytest.approx(4.0, abs=0.3)


@pytest.mark.parametrize("noise", [FILTERED, FilteredNoise("low-pass", 0.05, 4.0, 0.7)], ids=["one", "two"])
def test_the_gaussian_of_a_start_becomes_that_of_a_slender_block(noise):
    scene, moments = Scene(Block(0.5), Harmonic(4.6, 2.7, math.pi), noise), []
    for angle in (0.0, 0.01, 0.02):
        tall = with_angle(scene, angle)
        mean, covariance = FilteredStart(tall, Nodes(noise, (3, 3)), Dynamics.of(tall.white_equivalent())).at(0.5)
        moments.append(np.concatenate([mean, covariance.ravel()]))
    slender, *exact = moments
    near, far = (np.abs(moment - slender).max() for moment in exact)
    assert far < 1e-3
    assert math.log2(far / near) == pytest.approx(2.0, abs=0.15)


def test_a_block_rests_below_its_own_level():
    """Under |f| up to 1.05 a slender block lifts off; one of tan α/α = 1.084 stays, and the atom holds all of it."""
    scene = Scene(Block(0.5), Harmonic(1.05, 2.0), FilteredNoise("exponential", 1e-6, 4.0))
    plane, rests = plane_of(scene), []
    for angle in (0.0, 0.48):
        tall = with_angle(scene, angle)
        rests.append(
            FilteredPropagator(tall, discretization_of(plane, tall, 8), 1e-9)
            .propagate(scene.period * np.arange(2))
            .at_rest[1]
        )
        assert may_rest(tall) is (angle > 0.0)
    assert rests[0] < 0.5
    assert rests[1] == pytest.approx(1.0, abs=1e-12)


def test_sticking_is_that_of_a_slender_block_in_units_of_the_level():
    alpha, noise = 0.5, 1e-4
    level, pull = math.tan(alpha) / alpha, math.sin(alpha) / alpha
    forcing = Harmonic(1.2, 0.5, 0.3)
    exact = Sticking(Dynamics(forcing, noise, KernelBlock(0.6, 1.5, alpha)), 12.0, 5.0)
    slender = Sticking(Dynamics(forcing.scaled(1.0 / level, 1.0), noise / level**2, KernelBlock(0.6, 1.5)), 12.0, 5.0)
    times = np.linspace(0.0, 12.0, 101)
    assert [exact.next_lift_off(time) for time in times] == [slender.next_lift_off(time) for time in times]
    held = np.array([[sticking.until(time) for time in times] for sticking in (exact, slender)])
    assert 10 < (held[1] > times).sum() < 90
    # The layer is as thick in units of the pull, the velocity of rest is not: where they differ it is at its limit.
    assert np.mean(held[0] == held[1]) > 0.9
    assert pull < 1.0


@pytest.mark.parametrize("paths", [4_000, pytest.param(20_000, marks=pytest.mark.slow)])
def test_white_noise_agrees_with_small_steps_of_another_scheme(paths):
    """Paths of a leapfrog with impacts, extrapolated: 4 standard errors are wrong once in 16,000 seeds."""
    alpha, e, diffusion, shaking = 0.45, 0.7, 0.02, (4.2, 2.7, math.pi)
    scene = Scene(Block(e, critical_angle=alpha), Harmonic(*shaking), WhiteNoise(diffusion), Start(0.3, 0.0))
    density = PeriodicPropagator(scene, plane_of(scene, 2), 1e-8).propagate(scene.period * np.arange(3)).survival[1:]
    fine, coarse = survival((alpha, e), scene.overturning.angle, shaking, diffusion, (0.3, 0.0), 2, paths, 400, 3)
    extrapolated = 2.0 * fine - coarse
    assert density == pytest.approx(extrapolated, abs=2e-3 + 4.0 * math.sqrt(0.09 / paths))


def test_filtered_noise_agrees_with_paths():
    """20,000 event-driven paths: 4 standard errors are wrong once in 16,000 seeds."""
    scene = Scene(Block(0.7, critical_angle=0.29), Harmonic(4.2, 2.7, math.pi), FILTERED)
    run = FilteredPropagator(scene, discretization_of(plane_of(scene, 1), scene, 16, (7,), 8), 1e-8)
    density = run.propagate(scene.period * np.arange(3)).survival[1:]
    paths = simulate(scene, cycles=2, realizations=20_000, seed=4, method="filtered").survival[1:]
    assert density == pytest.approx(paths, abs=2e-3 + 4.0 * math.sqrt(0.1 / 20_000))
