"""The density under filtered noise: steps and their mirror image, rest, limits, refusals, and sampled paths."""

import dataclasses
import importlib.util
import math
import pathlib

import filter_formulas as formulas
import numpy as np
import pytest
from scipy import integrate

from fpk_rocking import (
    Block,
    CloughPenzien,
    CycleOperator,
    FilteredNoise,
    Harmonic,
    LinearFilter,
    Overturning,
    Scene,
    Start,
    WhiteNoise,
    load_scene,
    solve_fpk,
)
from fpk_rocking.density import filter_nodes, solver
from fpk_rocking.density.density import Density
from fpk_rocking.density.evolution import Evolution
from fpk_rocking.density.filter_nodes import FilteredDiscretization, Nodes, filtered_discretization
from fpk_rocking.density.filtered import FilteredPropagator, FilteredStart
from fpk_rocking.density.notices import warn_unresolved
from fpk_rocking.density.resolution import RESOLUTIONS, bins_tolerance, explore
from fpk_rocking.density.space import velocity_bound
from fpk_rocking.density.step.dynamics import Dynamics
from fpk_rocking.physics.motion.equation import KernelBlock
from fpk_rocking.results.remarks import remarks
from montecarlo import simulate

SCENES = pathlib.Path(__file__).parents[2] / "cases" / "scenes"


NOISES = (
    FilteredNoise("exponential", 0.03, 2.0),
    FilteredNoise("low-pass", 0.04, 6.0, 0.7),
    FilteredNoise("kanai-tajimi", 0.05, 4.0, 0.5),
)


KINDS = pytest.mark.parametrize("noise", NOISES, ids=lambda noise: noise.filter)


MAIN = Scene(Block(0.5), Harmonic(4.6, 2.7, math.pi), FilteredNoise("exponential", 0.04, 6.25))


EDGES = np.linspace(-1.6, 1.6, 9), np.linspace(-4.0, 4.0, 9)


def grid_of(scene, number, nodes, steps, points=8):
    white, times = scene.white_equivalent(), scene.period * np.arange(5)
    plane = RESOLUTIONS[number].adapted(white, velocity_bound(white, white.noise.diffusion), explore(white, times))
    return FilteredDiscretization(plane, nodes, points, even_time_grid(scene, steps))


def even_time_grid(scene, steps):
    periods = 2 if scene.forcing.half_antisymmetric else 1
    return np.linspace(0.0, 1.0 / periods, steps // periods + 1)


@KINDS
def test_a_flight_has_the_covariance_of_its_noise(noise):
    scene, time = MAIN.varied(noise=noise), 0.7
    run = FilteredPropagator(scene, grid_of(scene, 0, (3, 3), 8), 1e-9)
    flight = FilteredStart(scene, run.nodes, run.steps[0][0].characteristics.dynamics)
    _, covariance = flight.at(time)
    for i, j, kernels in ((0, 0, (np.sinh, np.sinh)), (0, 1, (np.sinh, np.cosh)), (1, 1, (np.cosh, np.cosh))):
        integral = integrate.dblquad(
            lambda s, t, first=kernels[0], second=kernels[1]: (
                first(time - s) * second(time - t) * formulas.autocovariance(noise, s - t)
            ),
            0.0,
            time,
            0.0,
            time,
            epsabs=1e-6,
        )[0]
        assert covariance[i, j] == pytest.approx(integral, rel=1e-4)
    assert covariance[2:, 2:] == pytest.approx(np.eye(len(covariance) - 2), abs=1e-12)


@pytest.mark.parametrize(
    ("noise", "nodes"),
    [(MAIN.noise, (8,)), *(pytest.param(noise, (6, 6), marks=pytest.mark.slow) for noise in NOISES[1:3])],
    ids=lambda part: str(part)[:30],
)
def test_survival_and_bins_are_those_of_sampled_paths(noise, nodes):
    """One false alarm in a thousand or fewer: 3.5 standard errors at four cycles, and a tolerance of the mesh."""
    scene, paths, cycles = MAIN.varied(noise=noise), 40_000, 4
    run = FilteredPropagator(scene, grid_of(scene, 1, nodes, 12), 1e-8)
    solution = run.propagate(scene.period * np.arange(cycles + 1))
    sample = simulate(scene, cycles=cycles, realizations=paths, seed=3)
    error = np.sqrt(sample.survival * (1.0 - sample.survival) / paths)
    assert np.all(np.abs(solution.survival - sample.survival) <= 3.5 * error + 3e-3)
    assert np.abs(solution.survival + solution.outflow.sum(axis=1) - 1.0).max() < 1e-12
    assert np.abs(solution.outflow[:, 2]).max() < 1e-5
    bins, sampled = (
        run.space.bin_integrals(solution.coefficients, *EDGES)[cycles],
        sample.bin_probabilities(cycles, *EDGES),
    )
    floor = np.sqrt(2.0 / math.pi * sampled / paths).sum()
    assert np.abs(bins - sampled).sum() < 1.3 * floor + 0.01


@pytest.mark.slow
def test_fast_noise_is_white_noise():
    """At a fixed diffusion the difference from white noise falls with the correlation time, in first order."""
    white = MAIN.varied(noise=WhiteNoise(0.00628))
    white_survival = solve_fpk(white, cycles=4, tol=1e-2).survival[4]
    differences, frequencies = [], np.array([5.0, 10.0, 1000.0])
    for frequency in frequencies:
        variance = 0.00628 * (1.0 + frequency) ** 2 / (2.0 + frequency)
        scene = MAIN.varied(noise=FilteredNoise("exponential", variance, frequency))
        assert scene.white_equivalent().noise.diffusion == pytest.approx(0.00628)
        run = FilteredPropagator(scene, grid_of(scene, 2, (6,), 16), 1e-8)
        differences.append(run.propagate(scene.period * np.arange(5)).survival[4] - white_survival)
    assert abs(differences[2]) < 1.5e-3
    first, second = np.array(differences[:2]) - differences[2]
    assert first > second > 0.5e-3


def test_slow_noise_is_a_mixture_over_constant_forces():
    """A noise that hardly changes: each node moves as under its own constant force."""
    start = Start(0.0, 0.0, ((0.01, 0.0), (0.0, 0.01)))
    scene = MAIN.varied(noise=FilteredNoise("exponential", 0.04, 1e-3), start=start)
    density = (
        FilteredPropagator(scene, grid_of(scene, 1, (16,), 12), 1e-8).propagate(scene.period * np.arange(3)).survival[2]
    )
    sample = simulate(scene, cycles=2, realizations=20_000, seed=5).survival[2]
    assert density == pytest.approx(sample, abs=3.5 * math.sqrt(sample * (1.0 - sample) / 20_000) + 0.01)


def test_noise_too_slow_for_its_start_is_refused_before_the_work(monkeypatch):
    """It was solved for minutes before, wrong by .03 and more, and refused in the end for its negative mass."""
    scene = Scene(Block(0.6), Harmonic(3.0, 2.7, math.pi), FilteredNoise("exponential", 0.03, 0.1))
    monkeypatch.setattr(solver, "explore", lambda *_: 1 / 0)
    with pytest.raises(ValueError, match=r"noise.frequency: got 0.1, accepted: at least about 0.17 .* Monte Carlo"):
        solve_fpk(scene, cycles=1)
    with pytest.raises(ValueError, match=r"noise.frequency: got 0.001, accepted: at least about 0.17 "):
        solve_fpk(scene.varied(noise=FilteredNoise("exponential", 0.03, 1e-3)), cycles=1)
    wide = Start(0.0, 0.0, ((0.01, 0.0), (0.0, 0.01)))
    smooth = scene.varied(noise=FilteredNoise("low-pass", 0.03, 1.5, 0.7))
    with pytest.raises(ValueError, match=r"noise.frequency: got 1.5, accepted: at least about 1.6 "):
        solve_fpk(smooth, cycles=1)
    for answered in (scene.varied(noise=FilteredNoise("exponential", 0.03, 0.2)), scene.varied(start=wide)):
        with pytest.raises(ZeroDivisionError):
            solve_fpk(answered, cycles=1)


def test_a_filter_of_more_states_is_refused_before_the_work(monkeypatch):
    scene = MAIN.varied(noise=FilteredNoise(CloughPenzien(15.0, 0.6, 1.5, 0.6), 0.04))
    monkeypatch.setattr(solver, "explore", lambda *_: 1 / 0)
    refused = r"noise\.filter: got Clough-Penzien noise.* \(4 states\), accepted: filters of up to 2 states.*simulate"
    with pytest.raises(ValueError, match=refused):
        solve_fpk(scene, cycles=1)
    with pytest.raises(ValueError, match=r"noise\.kind: got 'filtered'.* up to 2 states, and scene\.white_equivalent"):
        CycleOperator(scene)


def test_a_filter_of_ones_own_is_solved_as_the_named_one_is():
    """The low-pass filter by other states, which depend on each other: the same nodes and the same refusal."""
    named, states = NOISES[1], np.array([[1.0, 0.5], [0.3, 2.0]])
    drift = states @ np.array([[0.0, 1.0], [-36.0, -8.4]]) @ np.linalg.inv(states)
    output = np.linalg.inv(states)[0]
    own = FilteredNoise(LinearFilter(drift.tolist(), states[:, 1].tolist(), output.tolist()), 0.04)
    ours, theirs = Nodes(own, (5, 5)), Nodes(named, (5, 5))
    assert ours.transition_matrix(0.2) @ theirs.weights.ravel() == pytest.approx(theirs.weights.ravel(), abs=1e-12)
    eta = np.repeat(theirs.values, 5)
    for step in (0.02, 0.3):
        assert ours.piecewise_constant_factor(step) == pytest.approx(theirs.piecewise_constant_factor(step), rel=1e-12)
        covariance, named_covariance = (
            eta @ nodes.transition_matrix(step) @ (eta * theirs.weights.ravel()) for nodes in (ours, theirs)
        )
        assert covariance == pytest.approx(named_covariance, rel=1e-10)
    slow = MAIN.varied(noise=own.scaled(1.0, 0.05))
    with pytest.raises(ValueError, match=r"noise\.filter: got .*at least about .* times as fast"):
        solve_fpk(slow, cycles=1)


@pytest.mark.slow
def test_noise_that_is_not_refused_as_slow_is_answered():
    """One false alarm in a thousand or fewer: 3.5 standard errors at two cycles, and the tolerance."""
    scene, paths = (
        MAIN.varied(forcing=Harmonic(3.0, 2.7, math.pi), noise=FilteredNoise("exponential", 0.03, 0.4)),
        40_000,
    )
    density = solve_fpk(scene, cycles=2, tol=1e-2, bins_tol=math.inf)
    sample = simulate(scene, cycles=2, realizations=paths, seed=4)
    error = np.sqrt(sample.survival * (1.0 - sample.survival) / paths)
    assert np.all(np.abs(density.survival - sample.survival) <= 3.5 * error + 1e-2)
    assert density.error_estimate <= 1e-2


@pytest.fixture(scope="module")
def resting():
    """A block that nothing lifts off, with few nodes and long steps: what rests all the time is exact with any."""
    coarse = {"last_step_rough": (4,) * len(RESOLUTIONS), "resting_spacing": (2.0,) * len(RESOLUTIONS)}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(filter_nodes, "TUNING", filter_nodes.TUNING._replace(**coarse))
        scene = Scene(Block(0.8), Harmonic(0.3, 2.0), FilteredNoise("exponential", 1e-4, 3.0))
        return solve_fpk(scene, cycles=1, tol=0.1)


def test_a_block_that_nothing_lifts_off_rests(resting, tmp_path):
    assert resting.at_rest == pytest.approx(np.ones(2), abs=1e-12)
    assert resting.survival == pytest.approx(np.ones(2), abs=1e-12)
    assert resting.rests_exactly
    assert resting.bin_probabilities(1, *EDGES)[4, 4] == pytest.approx(1.0, abs=1e-12)
    resting.save(tmp_path / "rest.npz")
    again = Evolution.load(tmp_path / "rest.npz")
    assert again.rests_exactly
    assert np.array_equal(again.at_rest, resting.at_rest)


def test_rest_that_is_not_resolved_is_told(resting):
    tolerance = bins_tolerance(0.1)
    below, above = (dataclasses.replace(resting, rest_error_estimate=part * tolerance) for part in (0.9, 1.1))
    assert list(remarks(below)) == below.summary()["remarks"] == []
    assert list(remarks(above)) == above.summary()["remarks"] == [above.unresolved]
    assert above.summary()["rest_error_estimate"] == above.rest_error_estimate
    with pytest.warns(RuntimeWarning, match="at rest is not resolved: its estimated error is 0.12"):
        warn_unresolved(above, tolerance, stacklevel=1)


LIFTED = Scene(Block(0.5), Harmonic(0.8, 1.5), FilteredNoise("exponential", 0.04, 2.0))
"""Blocks that are lifted off now and then."""


def test_rest_and_motion_add_up_on_a_coarse_mesh():
    """Of 20,000 paths about as much rests: within .015, five of their standard errors."""
    run = FilteredPropagator(LIFTED, filtered_discretization(LIFTED, grid_of(LIFTED, 0, (1,), 4).plane, 0), 1e-8)
    solution = run.propagate(run.scene.period * np.arange(2))
    assert run.space.masses(solution.coefficients[1]).sum() == pytest.approx(
        solution.survival[1] - solution.at_rest[1], abs=1e-9
    )
    assert np.abs(solution.survival + solution.outflow.sum(axis=1) - 1.0).max() < 1e-12
    at_rest, survival = sampled_rest()
    assert solution.at_rest[1] == pytest.approx(at_rest, abs=0.015)
    assert 0.0 < run.node_error < 0.1
    assert np.all(np.abs(solution.survival - survival) <= 1e-2)


def test_what_noise_lifts_off_at_a_node_moves_on_from_there():
    """In a step mass at rest stays at its node or leaves for good, all of it, with angle and velocity of its path."""
    run = FilteredPropagator(LIFTED, filtered_discretization(LIFTED, grid_of(LIFTED, 0, (1,), 4).plane, 0), 1e-8)
    density, at_rest = np.zeros((*run.nodes.weights.shape, *run.space.shape)), run.nodes.weights.copy()
    outflow = run._move(0, density, at_rest)
    lifted = np.abs(LIFTED.forcing.value(0.0) + run.nodes.values) > 1.0
    assert 0 < lifted.sum() < len(lifted)
    assert not at_rest[lifted].any()
    assert at_rest[~lifted] == pytest.approx(run.nodes.weights[~lifted], rel=1e-12)
    assert np.abs(outflow).max() < 1e-12
    for a in np.flatnonzero(lifted):
        mass = run.space.masses(density[a, 0]).sum()
        assert mass == pytest.approx(run.nodes.weights[a, 0], rel=1e-12)
        x, v, _ = run._from_rest(run.steps[0][a].characteristics)
        assert Density(run.space, density[a, 0] / mass).mean == pytest.approx([x, v], rel=1e-9)


def sampled_rest():
    """Of 20,000 paths of `LIFTED`: part at rest after a cycle, and survival."""
    sample = simulate(LIFTED, cycles=1, realizations=20_000, seed=2)
    assert 0.05 < sample.at_rest[1] < 0.95
    return sample.at_rest[1], sample.survival


@pytest.mark.slow
def test_rest_and_motion_add_up():
    """What rests is beside the density; of paths as much does, within the estimate."""
    density = solve_fpk(LIFTED, cycles=1, tol=1e-2)
    assert density.rest_error_estimate < bins_tolerance(1e-2)
    assert density.mass_defect < 1e-12
    assert density.bin_probabilities(1, *EDGES).sum() == pytest.approx(density.survival[1], abs=1e-9)
    assert density.space.masses(density.coefficients[1]).sum() == pytest.approx(
        density.survival[1] - density.at_rest[1], abs=1e-9
    )
    at_rest, survival = sampled_rest()
    assert np.all(np.abs(density.survival - survival) <= 1e-2)
    assert density.at_rest[1] == pytest.approx(at_rest, abs=density.rest_error_estimate + 0.01)


def test_steps_shorten_to_the_end_of_a_cycle_where_blocks_may_rest():
    resting, moving = (grid_with_rest(Harmonic(amplitude, 2.7, math.pi)) for amplitude in (0.9, 3.0))
    assert moving.time_grid == pytest.approx(np.linspace(0.0, 0.5, len(moving.time_grid)), abs=1e-15)
    steps = np.diff(resting.time_grid)
    assert resting.time_grid[[0, -1]] == pytest.approx([0.0, 0.5], abs=1e-15)
    assert np.all(np.diff(steps) < 1e-15)
    # Rest lags by half of the last step.
    assert steps[-1] < 0.01 * steps[0]
    # A block falling back at the speed of the finest cell rests within the last step.
    speed, period = resting.plane.velocity_lines[resting.plane.velocity_lines > 0.0][0], 2.0 * math.pi / 2.7
    assert 2.0 * speed / (1.0 - MAIN.block.restitution) < 1.01 * steps[-1] * period


def grid_with_rest(forcing):
    scene = MAIN.varied(forcing=forcing)
    return filtered_discretization(scene, grid_of(scene, 1, (1,), 4).plane, 2)


def test_blocks_come_to_rest():
    """After a push under a constant force of next to nothing every block ends at rest."""
    scene = Scene(Block(0.3), Harmonic(0.2, 1.0), FilteredNoise("exponential", 1e-4, 1.0), Start(0.0, 0.5))
    run = FilteredPropagator(scene, grid_of(scene, 1, (3,), 32), 1e-9)
    solution = run.propagate(run.scene.period * np.arange(2))
    assert solution.at_rest[0] == 0.0
    assert solution.at_rest[1] == pytest.approx(1.0, abs=1e-3)


def test_a_band_may_be_solved_as_filtered_noise(monkeypatch):
    band = load_scene(SCENES / "main.toml")
    seen = []
    monkeypatch.setattr(FilteredPropagator, "__init__", lambda _, scene, *__: seen.append(scene.noise) or 1 / 0)
    with pytest.raises(ZeroDivisionError):
        solve_fpk(band, cycles=1, tol=1e-2, noise_replacement="filtered")
    assert seen == [band.filtered_equivalent().noise]
    with pytest.raises(ValueError, match="noise_replacement: got 'pink', accepted: 'white' or 'filtered'"):
        solve_fpk(band, cycles=1, noise_replacement="pink")


def test_memory_is_known_before_the_work():
    scene = MAIN.varied(noise=NOISES[1])
    grid = filtered_discretization(scene, grid_of(scene, 1, (1,), 4).plane, 1)
    run = FilteredPropagator(scene, grid, 1e-8)
    run.propagate(run.scene.period * np.arange(2))
    assert 0.2 < run.memory / grid.memory < 1.1
    with pytest.raises(ValueError, match=r"scene: got a mesh .* bytes, accepted: up to 4e\+09"):
        solve_fpk(scene.varied(noise=FilteredNoise("low-pass", 0.04, 3000.0, 0.01)), cycles=1)


def test_a_case_looks_into_a_density():
    spec = importlib.util.spec_from_file_location("rest", SCENES.parent / "rest.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    module.STEPS = 6
    scene = load_scene(SCENES / "rest.toml").filtered_equivalent()
    inside = module.look_inside(scene, 0)
    resting, noise = np.array(inside["resting"]), np.array(inside["noise"])
    assert inside["times"][0] == 0.0
    assert inside["times"][-1] == 1.0
    assert resting.shape == (len(inside["times"]), len(noise))
    # At the end of the second cycle the force is -A: under these values of the noise nothing rests.
    assert resting[-1][noise < -0.3] == pytest.approx(0.0, abs=1e-12)
    assert resting[-1][(noise > 0.3) & (noise < 0.9)].min() > 0.3  # nodes beyond hold next to nothing


def plane_of(scene):
    white, times = scene.white_equivalent(), scene.period * np.arange(3)
    return RESOLUTIONS[0].adapted(white, velocity_bound(white, white.noise.diffusion), explore(white, times))


@pytest.mark.parametrize("noise", [FilteredNoise("low-pass", 0.04, 1.5, 0.7), FilteredNoise("exponential", 0.04, 1.0)])
def test_half_a_cycle_and_its_mirror_image_are_a_cycle(noise):
    """Steps of half a cycle used twice, or of a whole one: the same to rounding, and what rests at each node too."""
    scene = Scene(Block(0.5), Harmonic(0.9, 2.0, 0.4), noise)
    plane, solutions = plane_of(scene), []
    for periods in (2, 1):
        grid = FilteredDiscretization(plane, (5, 3), 3, np.linspace(0.0, 1.0 / periods, 8 // periods + 1))
        run = FilteredPropagator(scene, grid, 1e-12)
        states = run.states(scene.period * np.arange(2), scene.start)
        rests = [(state.mirror_image() if state.reflected else state).at_rest for state in states]
        solutions.append((run.propagate(scene.period * np.arange(2)), np.array(rests)))
    (halves, rests), (wholes, rests_of_wholes) = solutions
    assert 0.1 < wholes.at_rest[1] < 0.9
    assert wholes.reinjected == 0.0  # what rests is an atom of its own, whose error the estimate has
    assert np.abs(rests_of_wholes - rests_of_wholes[:, ::-1, ::-1]).max() > 1e-3  # a mirror image is another state
    if rests_of_wholes.shape[2] > 1:
        assert np.abs(rests_of_wholes - rests_of_wholes[:, :, ::-1]).max() > 1e-3
    assert rests == pytest.approx(rests_of_wholes, abs=1e-10)
    assert halves.at_rest == pytest.approx(wholes.at_rest, abs=1e-10)
    assert halves.survival == pytest.approx(wholes.survival, abs=1e-10)


def test_piecewise_constant_noise_is_of_second_order_in_flight():
    """Variance of the velocity of a Gaussian far from all events, with steps that grow fivefold over the cycle.

    The mesh keeps it exactly, the step does not.
    """
    noise, start = FilteredNoise("exponential", 0.5, 3.0), Start(10.0, 0.0, ((0.25, 0.0), (0.0, 0.25)))
    scene = Scene(Block(0.5), Harmonic(0.0, 6.0), noise, start, Overturning(40.0))
    plane = dataclasses.replace(
        plane_of(scene),
        angle_lines=np.array([-40.0, *np.arange(-22.0, -5.0), 0.0, *np.arange(6.0, 23.0), 40.0]),
        velocity_lines=np.arange(-20.0, 21.0),
    )
    errors, counts = [], np.array([24, 48])
    for steps in counts:
        part = np.linspace(0.0, 1.0, steps + 1)
        run = FilteredPropagator(scene, FilteredDiscretization(plane, (3,), 5, part * (1.0 + 2.0 * part) / 3.0), 1e-12)
        _, exact_covariance = FilteredStart(scene, run.nodes, run.steps[0][0].characteristics.dynamics).at(scene.period)
        density = Density(run.space, run.propagate(scene.period * np.arange(2)).coefficients[1])
        errors.append(abs(density.covariance[1, 1] - exact_covariance[1, 1]))
    assert math.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.15)


@pytest.mark.parametrize(
    ("start", "amplitude", "rests"),
    [
        (Start(), 0.9, True),
        (Start(), 3.0, False),
        (Start(0.1), 0.9, False),
        (Start(0.0, 0.1), 0.9, False),
        (Start(0.0, 0.0, ((1e-4, 0.0), (0.0, 1e-4))), 0.9, False),
    ],
)
def test_a_start_is_at_rest_where_only_noise_can_lift_the_block(start, amplitude, rests):
    scene = Scene(Block(0.5), Harmonic(amplitude, 2.0), FilteredNoise("exponential", 0.01, 1.0), start)
    dynamics = Dynamics(scene.forcing, 0.0, KernelBlock(0.5, scene.overturning.angle))
    assert FilteredStart(scene, Nodes(scene.noise, (3,)), dynamics).at_rest is rests


def test_a_block_at_rest_begins_at_rest_at_every_value_of_the_noise():
    """With the probability of that value and without a density; a block that moves has its density and no rest."""
    scene = Scene(Block(0.5), Harmonic(0.9, 2.0), FilteredNoise("exponential", 0.01, 1.0))
    run = FilteredPropagator(scene, grid_of(scene, 0, (3,), 8), 1e-9)
    resting, moving = (run.initial_state(start, scene.period * np.arange(2)) for start in (Start(), Start(0.1)))
    assert np.array_equal(resting.at_rest, run.nodes.weights)
    assert resting.at_rest.sum() == pytest.approx(1.0, abs=1e-14)
    assert not resting.density.any()
    assert (resting.time, resting.step) == (0.0, 0)
    assert not moving.at_rest.any()
    mass = sum(run.space.masses(density).sum() for density in moving.density.reshape(-1, *run.space.shape))
    assert mass + moving.outflow.sum() == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize(("clear", "fine", "last"), [(0.55, 9.0, 5), (0.55, 0.25, 3), (0.05, 9.0, 0), (9.0, 9.0, 8)])
def test_the_mesh_takes_over_before_anything_can_happen_or_once_it_resolves(clear, fine, last, monkeypatch):
    """Steps of a tenth: nothing happens until `clear`, and the Gaussian is resolved from `fine` on."""
    monkeypatch.setattr(FilteredStart, "undisturbed", lambda _, time: time < clear)
    monkeypatch.setattr(FilteredStart, "resolution", lambda _, time, __: float(time > fine))
    assert FilteredStart.__new__(FilteredStart).takeover_step(None, 0.1 * np.arange(9)) == last
