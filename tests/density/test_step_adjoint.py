"""The adjoint of a step: dual to the step itself, and what it means for a start."""

import math
import pathlib

import numpy as np
import pytest
from density_operators import affine, flight_noise
from numpy.polynomial.legendre import legvander

from fpk_rocking import Harmonic, load_scene
from fpk_rocking.base.jit import at_most, thread_count
from fpk_rocking.density.space import Space, graded_lines, velocity_bound
from fpk_rocking.density.step import scatter
from fpk_rocking.density.step.dynamics import Dynamics
from fpk_rocking.density.step.step import Characteristics, Quadrature, Step
from fpk_rocking.physics.motion.equation import KernelBlock

SCENES = pathlib.Path(__file__).parents[2] / "cases" / "scenes"
QUADRATURE = Quadrature(5, 6, 5, 2)


def step_of(name, kind="own mesh"):
    """One step of a scene: on its own mesh, or from a window astride x = 0 to that mesh."""
    scene = load_scene(SCENES / f"{name}.toml").white_equivalent()
    dynamics, duration = Dynamics.of(scene), scene.period / 16
    bound = velocity_bound(scene, dynamics.diffusion)
    main = Space(graded_lines(scene.overturning.angle, 20, 1.5), graded_lines(bound, 28, 1.3), 3)
    window = Space(np.linspace(-0.2, 0.2, 9), np.linspace(-0.5, 0.5, 9), 3)
    source, target = {
        "own mesh": (main, main),
        "window to mesh": (window, main),
        "window to finer degree": (window, Space(main.angle_lines, main.velocity_lines, 4)),
    }[kind]
    return Step(
        Characteristics(source, 3 * duration, duration, dynamics, QUADRATURE, to_other_mesh=source is not target),
        target,
    )


def integral(space, first, second):
    """Integral of the product of two functions: Legendre products are orthonormal for the measure of a cell."""
    return np.einsum("xvab,xvab,xv->", first, second, space.areas)


def unit(rng, space):
    """A random function of norm 1."""
    coefficients = rng.normal(size=space.shape)
    return coefficients / math.sqrt(integral(space, coefficients, coefficients))


@pytest.mark.parametrize("name", ["main", "second"])
def test_adjoint_is_dual_to_the_step(name):
    """Any density, any function after the step, any values of the three ways out."""
    step, rng = step_of(name), np.random.default_rng(7)
    source, target = step.characteristics.source, step.target
    for _ in range(3):
        density, function, exit_values = unit(rng, source), unit(rng, target), rng.normal(size=3)
        after, sinks = step.apply(density)
        before = step.apply_adjoint(function, exit_values)
        expected = integral(target, after, function) + sinks @ exit_values
        assert abs(expected) > 1e-6
        assert integral(source, density, before) == pytest.approx(expected, abs=1e-13)


def test_adjoint_of_each_exit_is_the_mass_that_takes_it():
    """Worth 1 of one way out and 0 elsewhere; every way out is taken by the density it is tried on."""
    step, rng = step_of("main"), np.random.default_rng(8)
    density, nothing = np.abs(unit(rng, step.characteristics.source)), np.zeros(step.target.shape)
    _, sinks = step.apply(density)
    assert np.abs(sinks).min() > 1e-4
    for way, mass in enumerate(sinks):
        before = step.apply_adjoint(nothing, np.eye(3)[way])
        assert integral(step.characteristics.source, density, before) == pytest.approx(mass, abs=1e-13)


def test_what_is_worth_one_everywhere_is_worth_one_before():
    """A block is somewhere after the step: conservation of mass, cell by cell."""
    step = step_of("second")
    ones = {space: np.zeros(space.shape) for space in (step.characteristics.source, step.target)}
    for values in ones.values():
        values[:, :, 0, 0] = 1.0
    before = step.apply_adjoint(ones[step.target], (1.0, 1.0, 1.0))
    assert np.abs(before - ones[step.characteristics.source]).max() < 1e-13


def test_a_point_is_scattered_by_the_polynomials_of_numpy():
    """Of the highest degree that a mesh may have, orthonormal for the measure of a cell.

    Kernels as Python: to compile them for that degree would take longer than all that is tested here.
    """
    place, scattered = (-0.3, 0.8), np.zeros(36)
    along, across = legvander(place, 5) * np.sqrt(2.0 * np.arange(6) + 1.0)
    scatter.scatter_point.py_func(scattered, 2.0, *place, (0.0,) * 6)
    assert scattered.reshape(6, 6) == pytest.approx(2.0 * np.outer(along, across), rel=1e-13)


def test_a_step_to_another_mesh_has_no_adjoint():
    step = step_of("main", "window to mesh")
    with pytest.raises(ValueError, match=r"(?s)^target: got .*, accepted: the mesh of the characteristics"):
        step.apply_adjoint(np.zeros(step.target.shape), np.zeros(3))


def test_mean_of_a_quadratic_after_a_flight_is_the_closed_form():
    """Where nothing happens, 1 + x - 2 v + 3 x^2 - x v + 2 v^2 has the mean of its value at the mean, plus noise."""
    dynamics, start, duration = Dynamics(Harmonic(0.5, 2.0, 0.0), 0.01, KernelBlock(0.5, 6.0)), 0.3, 0.1
    source = Space(np.linspace(0.5, 3.7, 13), np.linspace(-2.3, 1.8, 13), 3)
    step = Step(Characteristics(source, start, duration, dynamics, QUADRATURE), source)

    def quadratic(x, v):
        return 1.0 + x - 2.0 * v + 3.0 * x * x - x * v + 2.0 * v * v

    before = step.apply_adjoint(source.project(quadratic, 4), np.zeros(3))
    matrix, shift = affine(dynamics, start, duration, 1)
    noise = flight_noise(dynamics, duration)
    x, v = np.random.default_rng(11).uniform([[1.5], [-1.0]], [[2.7], [0.7]], (2, 50))
    mean = matrix @ [x, v] + shift[:, None]
    expected = quadratic(*mean) + 3.0 * noise[0, 0] - noise[0, 1] + 2.0 * noise[1, 1]
    assert source.evaluate(before, x, v) == pytest.approx(expected, abs=1e-11)


def test_adjoint_has_the_same_bits_for_any_number_of_threads():
    step, rng = step_of("main"), np.random.default_rng(9)
    function, exit_values = unit(rng, step.target), rng.normal(size=3)
    threads, results = thread_count(), set()
    for count in {1, 2, threads} & set(range(1, threads + 1)):
        with at_most(count):
            results.add(step.apply_adjoint(function, exit_values).tobytes())
    assert len(results) == 1


@pytest.mark.slow
def test_degrees_of_source_and_target_are_independent():
    """Legendre moments up to the lower degree of two targets do not depend on the degree."""
    cubic, quartic = step_of("main", "window to mesh"), step_of("main", "window to finer degree")
    density = unit(np.random.default_rng(10), cubic.characteristics.source)
    (lower, sinks), (higher, others) = cubic.apply(density), quartic.apply(density)
    assert np.abs(higher[..., :4, :4] - lower).max() < 1e-12 * np.abs(lower).max()
    assert np.abs(higher[..., 4, :]).max() > 1e-3 * np.abs(lower).max()
    assert sinks == pytest.approx(others, abs=1e-15)
