"""The density solver against closed forms, exact balances and symmetries."""

import dataclasses
import math

import numpy as np
import pytest
from density_operators import affine, flight_noise, scene_of

from fpk_rocking import Harmonic, solve_fpk
from fpk_rocking.base.basis import gauss_legendre
from fpk_rocking.base.jit import at_most, thread_count
from fpk_rocking.density.density import Density
from fpk_rocking.density.patches import Gaussian
from fpk_rocking.density.space import Space, graded_lines
from fpk_rocking.density.step.dynamics import Dynamics
from fpk_rocking.density.step.step import Characteristics, Quadrature, Step
from fpk_rocking.physics.motion.equation import KernelBlock
from fpk_rocking.physics.motion.slender import shear_diffusion_variances
from fpk_rocking.scene import Start

QUADRATURE = Quadrature(5, 5, 5, 2)
CALM = Dynamics(Harmonic(0.5, 2.0, 0.0), 0.01, KernelBlock(0.5, 6.0))
AWAY = Gaussian((2.0, -0.6), [[0.03, 0.003], [0.003, 0.04]])


def away_mesh(cells, degree=3):
    return Space(np.linspace(0.5, 3.7, cells + 1), np.linspace(-2.3, 1.8, cells + 1), degree)


def l2_error(density, truth):
    """L2 norm over the mesh of a density minus a function."""
    space, (nodes, weights) = density.space, gauss_legendre(8)
    angle, velocity = (line[:-1, None] + np.diff(line)[:, None] * nodes for line in density.mesh_lines)
    error = space.cell_values(density.coefficients, nodes, nodes)
    error = error - truth(angle[:, None, :, None], velocity[None, :, None, :])
    return math.sqrt(np.einsum("xvij,i,j,xv->", error**2, weights, weights, space.areas))


@pytest.mark.parametrize(
    ("degree", "least"),
    [
        pytest.param(1, 3e-2, marks=pytest.mark.slow),
        pytest.param(2, 2e-3, marks=pytest.mark.slow),
        (3, 1.2e-4),
        pytest.param(4, 7e-6, marks=pytest.mark.slow),
        pytest.param(5, 4e-7, marks=pytest.mark.slow),
    ],
)
def test_density_converges_with_order_degree_plus_one(degree, least):
    """Gaussian flight away from events in four steps; the truth is the closed form.

    Every degree has kernels of its own, whose compiling is most of the time.
    """
    cells, errors = (20, 26, 32, 40), []
    for count in cells:
        space, truth = away_mesh(count, degree), AWAY
        coefficients = space.project(AWAY, 8)
        for k in range(4):
            step = Step(Characteristics(space, 0.1 * k, 0.1, CALM, QUADRATURE), space)
            coefficients, _ = step.apply(coefficients)
            matrix, shift = affine(CALM, 0.1 * k, 0.1, 1)
            covariance = matrix @ truth.covariance @ matrix.T + flight_noise(CALM, 0.1)
            truth = Gaussian(matrix @ truth.mean + shift, covariance)
        errors.append(l2_error(Density(space, coefficients), truth))
    slope = np.polyfit(np.log(cells), np.log(errors), 1)[0]
    assert slope == pytest.approx(-(degree + 1), abs=0.15)
    assert errors[-1] < least


@pytest.mark.parametrize("duration", [0.04, 0.2])
@pytest.mark.parametrize("same_mesh", [True, False])
def test_flight_and_noise_have_exact_moments(duration, same_mesh):
    """Mean and covariance, both by remaps of lines and by scattered paths."""
    source = away_mesh(24)
    target = source if same_mesh else Space(np.linspace(0.3, 3.9, 25), np.linspace(-2.5, 2.0, 25), 3)
    before = Density(source, source.project(AWAY, 8))
    trace = Characteristics(source, 0.3, duration, CALM, QUADRATURE, to_other_mesh=not same_mesh)
    after = Density(target, Step(trace, target).apply(before.coefficients)[0])
    matrix, shift = affine(CALM, 0.3, duration, 1)
    covariance = matrix @ before.covariance @ matrix.T + flight_noise(CALM, duration)
    assert after.mean == pytest.approx(matrix @ before.mean + shift, abs=1e-12)
    assert after.covariance == pytest.approx(covariance, abs=1e-12)


@pytest.mark.parametrize("duration", [1e-3, 0.03, 0.0999, 0.1, 0.5])
def test_diffusions_have_the_covariance_of_the_flight(duration):
    """A diffusion of the angle, one of the velocity and another of the angle, carried on by the shears between them."""
    velocity_shear, small = shear_diffusion_variances(0.7, duration)
    early, middle, late = (
        [math.cosh(duration), math.sinh(duration)],
        [math.tanh(duration / 2.0), 1.0],
        [1.0, 0.0],
    )
    covariance = (
        small * np.outer(early, early) + velocity_shear * np.outer(middle, middle) + small * np.outer(late, late)
    )
    truth = flight_noise(Dynamics(Harmonic(0.0, 1.0, 0.0), 0.7, KernelBlock(0.5, 1.0)), duration)
    assert covariance == pytest.approx(truth, rel=1e-9 if duration > 0.01 else 1e-5, abs=0.0)


@pytest.mark.parametrize("start", [0.0, 0.7, 1.9])
def test_mass_that_crosses_zero_or_overturns_is_balanced(start):
    """One step of a Gaussian astride x = 0 that reaches both cut-offs; all that is not inside is in the sinks."""
    dynamics = Dynamics(Harmonic(4.6, 2.7, math.pi), 0.02, KernelBlock(0.5, 1.2))
    space = Space(graded_lines(1.2, 20, 1.5), graded_lines(3.5, 24, 1.3), 3)
    coefficients = space.project(Gaussian((0.02, 0.1), [[0.25, 0.02], [0.02, 0.6]]), 8)
    after, sinks = Step(Characteristics(space, start, 0.15, dynamics, QUADRATURE), space).apply(coefficients)
    assert sinks[:2].min() > 1e-3
    left = [space.masses(now)[: space.first_positive].sum() for now in (coefficients, after)]
    assert abs(left[1] + sinks[0] - left[0]) > 1e-3
    assert space.masses(after).sum() + sinks.sum() == pytest.approx(space.masses(coefficients).sum(), abs=1e-13)


def test_mass_that_overturns_as_a_whole_is_in_the_sink():
    """Nothing of this window is left after the step: no column of it lands anywhere."""
    dynamics = Dynamics(Harmonic(4.6, 2.7, math.pi), 0.02, KernelBlock(0.5, 1.2))
    window = Space(np.linspace(0.8, 1.2, 17), np.linspace(6.0, 9.0, 9), 3)
    coefficients = window.project(Gaussian((1.0, 7.5), [[1e-3, 0.0], [0.0, 0.04]]), 8)
    for target in (window, Space(np.linspace(-1.2, 1.2, 9), np.linspace(-4.0, 4.0, 9), 3)):
        trace = Characteristics(window, 0.0, 0.15, dynamics, QUADRATURE, to_other_mesh=target is not window)
        after, sinks = Step(trace, target).apply(coefficients)
        assert sinks[1] == pytest.approx(window.masses(coefficients).sum(), abs=1e-13)
        assert np.abs(after).max() == 0.0


@pytest.fixture(scope="module")
def skewed():
    """Two cycles of a Gaussian start without any symmetry, part of it beyond the cut-off."""
    start = Start(0.7, -0.6, ((0.08, 0.01), (0.01, 0.1)))
    return solve_fpk(scene_of(phase=1.0, start=start), cycles=2, tol=1e-2)


def test_turned_scene_has_the_turned_density(skewed):
    """(x, v, Psi) -> (-x, -v, Psi + pi): all coefficients, as masses."""
    scene, start = skewed.scene, skewed.scene.start
    turned = solve_fpk(
        dataclasses.replace(
            scene,
            forcing=dataclasses.replace(scene.forcing, phase=scene.forcing.phase + math.pi),
            start=Start(-start.angle, -start.velocity, start.covariance),
        ),
        cycles=2,
        tol=1e-2,
    )
    assert turned.survival == pytest.approx(skewed.survival, abs=1e-12)
    assert turned.overturned == pytest.approx(skewed.overturned[:, ::-1], abs=1e-12)
    signs = np.multiply.outer((-1.0) ** np.arange(4), (-1.0) ** np.arange(4))
    difference = turned.coefficients[:, ::-1, ::-1] * signs - skewed.coefficients
    assert np.abs(difference * skewed.space.areas[..., None, None]).max() < 1e-12


def test_nothing_is_unaccounted_for(skewed):
    balance = skewed.survival + skewed.overturned.sum(axis=1) + skewed.truncated
    assert np.abs(balance - 1.0).max() < 1e-12
    assert skewed.mass_defect == pytest.approx(np.abs(balance - 1.0).max(), abs=1e-14)
    assert skewed.survival[1:] == pytest.approx([skewed.at(k).moment(0, 0) for k in (1, 2)], abs=1e-13)
    assert np.all(np.diff(skewed.survival) < -0.01)
    assert np.all(np.diff(skewed.overturned, axis=0) > 0.0)
    assert np.abs(skewed.truncated).max() < 3e-6
    assert skewed.negative_mass == pytest.approx(
        max(skewed.space.negative_mass(coefficients) for coefficients in skewed.coefficients), rel=1e-12
    )


def test_what_starts_beyond_the_cutoff_has_overturned(skewed):
    spread = math.sqrt(2.0 * 0.08)
    tails = [0.5 * math.erfc((math.pi / 2 + 0.7) / spread), 0.5 * math.erfc((math.pi / 2 - 0.7) / spread)]
    assert skewed.overturned[0] == pytest.approx(tails, rel=1e-12)
    assert skewed.survival[0] == pytest.approx(1.0 - sum(tails), abs=1e-15)
    assert skewed.at(0).moment(0, 0) == pytest.approx(skewed.survival[0], abs=1e-4)
    assert skewed.at(0)(0.7, -0.6) == pytest.approx(1.0 / (2.0 * math.pi * math.sqrt(0.08 * 0.1 - 1e-4)), rel=0.02)


def test_same_bits_for_any_number_of_threads(skewed):
    threads = thread_count()
    for count in {1, threads}:
        with at_most(count):
            again = solve_fpk(skewed.scene, cycles=2, tol=1e-2)
            assert again.coefficients.tobytes() == skewed.coefficients.tobytes()
            assert again.overturned.tobytes() == skewed.overturned.tobytes()
