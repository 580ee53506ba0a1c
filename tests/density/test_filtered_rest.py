"""Rest under filtered noise: its probability, its start, steps and nodes that resolve it, and sampled paths."""

import dataclasses
import importlib.util
import math

import numpy as np
import pytest
from filtered_grids import EDGES, MAIN, SCENES, grid_of

from fpk_rocking import (
    BandNoise,
    Block,
    FilteredNoise,
    Harmonic,
    Scene,
    Start,
    load_scene,
    solve_fpk,
)
from fpk_rocking.density.density import Density
from fpk_rocking.density.evolution import Evolution, warn_unresolved
from fpk_rocking.density.filter_nodes import Nodes, filtered_discretization
from fpk_rocking.density.filtered import FilteredPropagator, advance_from_rest
from fpk_rocking.density.resolution import bins_tolerance
from fpk_rocking.density.solver import with_few_harmonics
from fpk_rocking.density.startup import FilteredStart
from fpk_rocking.density.step.dynamics import Dynamics
from fpk_rocking.physics.motion.equation import KernelBlock
from fpk_rocking.results.remarks import remarks
from montecarlo import simulate


@pytest.fixture(scope="module")
def resting():
    """A block that nothing lifts off: what rests all the time is exact with any mesh, steps and nodes."""
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
    """Of 20,000 paths about as much rests: within .03, as the last noise is that of a step's middle."""
    run = FilteredPropagator(LIFTED, filtered_discretization(LIFTED, grid_of(LIFTED, 0, (1,), 4).plane, 0), 1e-8)
    solution = run.propagate(run.scene.period * np.arange(2))
    assert run.space.masses(solution.coefficients[1]).sum() == pytest.approx(
        solution.survival[1] - solution.at_rest[1], abs=1e-9
    )
    assert np.abs(solution.survival + solution.outflow.sum(axis=1) - 1.0).max() < 1e-12
    at_rest, survival = sampled_rest()
    assert solution.at_rest[1] == pytest.approx(at_rest, abs=0.03)
    assert np.all(np.abs(solution.survival - survival) <= 1e-2)


def test_few_harmonics_change_rest_and_motion_alike():
    """All probabilities are 1 in all, and those that stand are at rest or in the density."""
    run = FilteredPropagator(LIFTED, filtered_discretization(LIFTED, grid_of(LIFTED, 0, (1,), 4).plane, 0), 1e-8)
    times = run.scene.period * np.arange(2)
    solution = run.propagate(times)
    solution.edges = EDGES
    few = LIFTED.varied(noise=BandNoise(2.0, (0.0, 10.0), 20))  # strong, as it is to change much
    rested = solution.at_rest.copy()
    changed = with_few_harmonics(solution, few, 0.5, 20, 0.1, times)
    assert changed > 1e-2
    assert np.abs(solution.at_rest - rested).max() > 1e-3
    assert np.abs(solution.survival + solution.outflow.sum(axis=1) - 1.0).max() < 1e-12
    moving = run.space.masses(solution.coefficients[1]).sum()
    assert moving == pytest.approx(solution.survival[1] - solution.at_rest[1], abs=1e-9)


def test_a_block_that_overturns_in_the_step_that_lifts_it_off_is_not_lost():
    strong = LIFTED.varied(noise=FilteredNoise("exponential", 100.0, 2.0))
    run = FilteredPropagator(strong, grid_of(LIFTED, 0, (6,), 4), 1e-8)
    density, at_rest = np.zeros((*run.nodes.weights.shape, *run.space.shape)), run.rest_nodes.weights.copy()
    outflow = run._move(0, density, at_rest)
    assert outflow[:2].min() > 0.01
    moving = sum(run.space.masses(part).sum() for part in density[:, 0])
    assert moving + outflow.sum() + at_rest.sum() == pytest.approx(1.0, abs=1e-12)


def test_little_mass_at_rest_is_kept():
    run = FilteredPropagator(LIFTED, filtered_discretization(LIFTED, grid_of(LIFTED, 0, (1,), 4).plane, 0), 1e-8)
    density, at_rest = np.zeros((*run.nodes.weights.shape, *run.space.shape)), 1e-12 * run.rest_nodes.weights
    outflow = run._move(0, density, at_rest)
    moving = sum(run.space.masses(part).sum() for part in density[:, 0])
    assert at_rest.sum() > 0.1e-12
    assert moving + outflow.sum() + at_rest.sum() == pytest.approx(1e-12, rel=1e-9)


def test_the_mass_at_rest_does_not_jump_between_steps():
    """It is told at the end of a step and a ten-thousandth of a step later, by a part of the next."""
    run = FilteredPropagator(LIFTED, filtered_discretization(LIFTED, grid_of(LIFTED, 0, (1,), 4).plane, 0), 1e-8)
    end = run.time_of(2)
    at_end, later = run.propagate(np.array([0.0, end, end + 1e-4 * run.durations[0]])).at_rest[1:]
    assert at_end > 0.1
    assert later == pytest.approx(at_end, abs=5e-3)


def test_what_noise_lifts_off_moves_on_from_there():
    """In a step the part of the mass at rest beyond the level leaves, all of it, by its path and with its noise."""
    run = FilteredPropagator(LIFTED, filtered_discretization(LIFTED, grid_of(LIFTED, 0, (1,), 4).plane, 0), 1e-8)
    density, at_rest = np.zeros((*run.nodes.weights.shape, *run.space.shape)), run.rest_nodes.weights.copy()
    outflow = run._move(0, density, at_rest)
    # |f| falls from .8 on: what is lifted off, to the left, is so at once.
    factor = run.nodes.sigma * run.nodes.piecewise_constant_factor(run.durations[0])
    parts, values = run.rest_nodes.parts_between(-np.inf, -0.2 / factor)
    lifted = parts * run.rest_nodes.weights[:, 0]
    assert 0.05 < lifted.sum() < 0.95
    assert run.rest_nodes.weights[:, 0] - at_rest[:, 0] == pytest.approx(lifted, abs=1e-14)
    moving = run.space.masses(density.reshape(-1, *run.space.shape).transpose(1, 2, 0, 3, 4).sum(axis=2)).sum()
    assert moving + outflow.sum() == pytest.approx(lifted.sum(), rel=1e-12)
    masses = np.array([run.space.masses(part).sum() for part in density[:, 0]])
    for power in (1, 2, 3):
        assert masses @ run.nodes.states[:, 0, 0] ** power == pytest.approx(lifted @ values**power, rel=1e-9)
    segments = [run._dynamics(factor * value) for value in values[lifted > 0.0]]
    ends = [advance_from_rest(own.segment(0.0, run.durations[0]), run.durations[0], own.block)[:2] for own in segments]
    mean = Density(run.space, density.sum(axis=(0, 1)) / lifted.sum()).mean
    assert mean == pytest.approx(lifted[lifted > 0.0] @ np.array(ends) / lifted.sum(), rel=1e-9)


def sampled_rest():
    """Of 20,000 paths of `LIFTED`: part at rest after a cycle, and survival."""
    sample = simulate(LIFTED, cycles=1, realizations=20_000, seed=2)
    assert 0.05 < sample.at_rest[1] < 0.95
    return sample.at_rest[1], sample.survival


@pytest.mark.slow
def test_rest_and_motion_add_up():
    """What rests is beside the density; of paths as much does, within the estimate."""
    with pytest.warns(RuntimeWarning, match="at rest is not resolved: its estimated error is 0.037"):
        density = solve_fpk(LIFTED, cycles=1, tol=1e-2)
    assert density.mass_defect < 1e-12
    assert density.bin_probabilities(1, *EDGES).sum() == pytest.approx(density.survival[1], abs=1e-9)
    assert density.space.masses(density.coefficients[1]).sum() == pytest.approx(
        density.survival[1] - density.at_rest[1], abs=1e-9
    )
    at_rest, survival = sampled_rest()
    assert np.all(np.abs(density.survival - survival) <= 1e-2)
    assert density.at_rest[1] == pytest.approx(at_rest, abs=density.rest_error_estimate + 0.01)


def test_cells_are_as_small_as_blocks_come_to_rest_from_in_a_step():
    resting, moving = (grid_with_rest(Harmonic(amplitude, 2.7, math.pi)) for amplitude in (0.9, 3.0))
    for grid in (resting, moving):
        assert grid.time_grid == pytest.approx(np.linspace(0.0, 0.5, len(grid.time_grid)), abs=1e-15)
    # At a pull of 1 impacts of a block that falls back at a speed v take 2 v / (1 - e).
    step, loss = np.diff(resting.time_grid)[0] * 2.0 * math.pi / 2.7, 1.0 - MAIN.block.restitution
    assert 2.0 * smallest_speed(resting) / loss < 0.36 * step
    assert smallest_speed(moving) > 2.0 * smallest_speed(resting)


def smallest_speed(grid):
    return grid.plane.velocity_lines[grid.plane.velocity_lines > 0.0][0]


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
    assert np.array_equal(resting.at_rest, run.rest_nodes.weights)
    assert resting.at_rest.sum() == pytest.approx(1.0, abs=1e-14)
    assert not resting.density.any()
    assert (resting.time, resting.step) == (0.0, 0)
    assert not moving.at_rest.any()
    mass = sum(run.space.masses(density).sum() for density in moving.density.reshape(-1, *run.space.shape))
    assert mass + moving.outflow.sum() == pytest.approx(1.0, abs=1e-6)
