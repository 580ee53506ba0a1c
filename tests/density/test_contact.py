"""Slow impacts in parts of a step: a linear map like any step, and densities of blocks that rattle."""

import dataclasses
import math
import pathlib

import numpy as np
import pytest

import fpk_rocking as fpk
from fpk_rocking.density import solver
from fpk_rocking.density.resolution import RESOLUTIONS, explore
from fpk_rocking.density.space import Space, graded_lines, velocity_bound
from fpk_rocking.density.step.contact import ContactStep
from fpk_rocking.density.step.dynamics import Dynamics
from fpk_rocking.density.step.step import Characteristics, Quadrature, Step

SCENES = pathlib.Path(__file__).parents[2] / "cases" / "scenes"
QUADRATURE = Quadrature(5, 6, 5, 2)
RATTLING = fpk.Scene(fpk.Block(0.423), fpk.Harmonic(1.05, 1.356, 3.77), fpk.WhiteNoise(0.00376), fpk.Start(0.1, -0.1))
EXACT = RATTLING.varied(block=fpk.Block(0.423, critical_angle=0.3))
SURVIVAL, NEAR, PATHS = 0.97632, 0.4407, 3_600_000
"""Survival of two cycles and the probability of 0 < x < .05 then, by so many paths of `montecarlo`'s white engine."""


def contact_step(scene, parts, active=None, cells=(24, 28)):
    """A step of a scene on its own mesh, in which the force stays below lift-off; all cells are active by default."""
    dynamics, duration = Dynamics.of(scene), scene.period / 50
    bound = velocity_bound(scene, dynamics.diffusion)
    space = Space(graded_lines(scene.overturning.angle, cells[0], 1.5), graded_lines(bound, cells[1], 1.3), 3)
    step = ContactStep(space, 6 * duration, duration, dynamics, QUADRATURE, parts)
    step.activate(np.ones(space.shape[:2], dtype=bool) if active is None else active(space))
    return step


def integral(space, first, second):
    """Integral of the product of two functions: Legendre products are orthonormal for the measure of a cell."""
    return np.einsum("xvab,xvab,xv->", first, second, space.areas)


@pytest.mark.parametrize("scene", [RATTLING, EXACT], ids=["slender", "exact"])
def test_mass_is_conserved_and_the_adjoint_is_dual(scene):
    """Any density, any function after the step, any values of the three ways out."""
    step, rng = contact_step(scene, 4), np.random.default_rng(5)
    assert 4 <= step.slow.sum() <= 0.1 * step.slow.size
    for _ in range(3):
        density, function, exit_values = (rng.normal(size=shape) for shape in (step.target.shape, step.target.shape, 3))
        after, left = step.apply(density)
        mass = step.target.masses(density).sum()
        assert step.target.masses(after).sum() + left.sum() == pytest.approx(mass, abs=1e-12)
        before = step.apply_adjoint(function, exit_values)
        expected = integral(step.target, after, function) + left @ exit_values
        assert integral(step.target, density, before) == pytest.approx(expected, rel=1e-12)


def test_what_is_worth_one_everywhere_is_worth_one_before():
    step = contact_step(RATTLING, 4)
    one = np.zeros(step.target.shape)
    one[:, :, 0, 0] = 1.0
    assert np.abs(step.apply_adjoint(one, (1.0, 1.0, 1.0)) - one).max() < 1e-12


def test_next_to_nothing_leaves_the_small_mesh():
    """What does would count as truncated."""
    step = contact_step(RATTLING, 4, cells=(44, 44))
    density = np.zeros(step.target.shape)
    density[step.slow, 0, 0] = 1.0
    _, left = step.apply(density)
    assert np.abs(left).max() < 1e-8 * step.target.masses(density).sum()


def test_where_the_force_lifts_a_block_off_cells_next_to_the_cutoff_are_not_slow():
    """Their blocks overturn: on the small mesh they would count as truncated."""
    forcing = fpk.Harmonics(2.7, (2.4, 1.0), (0.0, 0.5 * math.pi))
    scene = fpk.Scene(fpk.Block(0.6), forcing, fpk.WhiteNoise(0.008))
    assert parts_of(scene) == [2, 2, 3]
    result = fpk.solve_fpk(scene, cycles=2, tol=5e-2)
    assert result.survival[2] < 0.95
    assert abs(result.truncated[2]) < 1e-6


def test_only_slow_cells_take_parts_and_one_part_is_a_step():
    step, whole, rng = contact_step(RATTLING, 4), contact_step(RATTLING, 1), np.random.default_rng(6)
    dynamics, space = Dynamics.of(RATTLING), whole.target
    paths = Characteristics(space, 6 * RATTLING.period / 50, RATTLING.period / 50, dynamics, QUADRATURE)
    plain, density = Step(paths, space), rng.normal(size=space.shape)
    assert np.array_equal(whole.apply(density)[0], plain.apply(density)[0])
    density[step.slow] = 0.0
    assert step.apply(density)[0] == pytest.approx(plain.apply(density)[0], abs=1e-12)


def test_of_cells_that_are_not_active_all_is_truncated():
    step = contact_step(RATTLING, 4, active=lambda space: np.zeros(space.shape[:2], dtype=bool))
    density = np.ones(step.target.shape)
    after, left = step.apply(density)
    assert not after.any()
    assert left == pytest.approx([0.0, 0.0, step.target.masses(density).sum()])


def parts_of(scene, **options):
    """Parts of a step at the resolutions 1, 2 and 3."""
    motion, bound = explore(scene, scene.period * np.arange(3)), velocity_bound(scene, scene.noise.diffusion)
    return [RESOLUTIONS[k].adapted(scene, bound, motion, **options).contact_parts for k in (1, 2, 3)]


def test_parts_are_for_slow_impacts_and_two_solutions_differ_in_them():
    assert parts_of(RATTLING) == [3, 4, 5]
    assert parts_of(RATTLING, filtered=True) == [1, 1, 1]
    assert parts_of(RATTLING.varied(block=fpk.Block(0.8))) == [1, 1, 1]
    assert parts_of(fpk.load_scene(SCENES / "main.toml").white_equivalent()) == [1, 1, 1]
    assert max(parts_of(RATTLING.varied(noise=fpk.WhiteNoise(0.1)))) <= 2


@pytest.fixture(scope="module")
def solutions():
    """A function of the number of parts: probabilities of survival and of 0 < x < .05 after two cycles."""
    times = RATTLING.period * np.arange(3)
    motion = explore(RATTLING, times)
    adapted = solver._discretizations(RATTLING, RATTLING, motion, [RESOLUTIONS[2]])[0]

    def solution(parts):
        mesh = dataclasses.replace(adapted, contact_parts=parts)
        solved = solver._solve(RATTLING, mesh, 1e-3, times, motion.edges, None, None)
        bins = solved.propagator.space.bin_integrals(solved.coefficients[-1:], [0.0, 0.05], [-9.0, 9.0])
        return np.array([solved.survival[-1], bins.sum()])

    return solution


def test_the_error_falls_with_the_number_of_parts(solutions):
    """On one mesh, with an order near 1.2: without parts a step is too long by far."""
    parts = np.array([1, 2, 4])
    errors = np.array([solutions(count) for count in parts.tolist()]) - (SURVIVAL, NEAR)
    assert errors[0, 0] > 0.0012
    assert errors[0, 1] > 0.015
    for error in errors.T:
        order = -np.polyfit(np.log(parts), np.log(error), 1)[0]
        assert 0.9 < order < 1.8, errors


@pytest.mark.parametrize("tol", [1e-2, 1e-3])
def test_a_block_that_rattles_agrees_with_paths(tol):
    result = fpk.solve_fpk(RATTLING, cycles=2, tol=tol)
    sampling = 3.0 * math.sqrt(SURVIVAL * (1.0 - SURVIVAL) / PATHS), 3.0 * math.sqrt(NEAR * (1.0 - NEAR) / PATHS)
    near = result.bin_probabilities(2, [0.0, 0.05], [-9.0, 9.0]).sum()
    assert result.error_estimate < max(0.1 * tol, 4e-4)
    assert abs(result.survival[2] - SURVIVAL) < result.error_estimate + sampling[0]
    assert abs(near - NEAR) < 0.5 * result.bins_error_estimate + sampling[1]


def test_the_estimated_time_knows_the_parts():
    times = RATTLING.period * np.arange(3)
    adapted = solver._discretizations(RATTLING, RATTLING, explore(RATTLING, times), [RESOLUTIONS[2]])[0]
    plain = dataclasses.replace(adapted, contact_parts=1)
    assert solver.estimated_seconds(RATTLING, adapted, times) > 1.3 * solver.estimated_seconds(RATTLING, plain, times)
    assert adapted.settings["contact_parts"] == 4
    assert "contact_parts" not in plain.settings
