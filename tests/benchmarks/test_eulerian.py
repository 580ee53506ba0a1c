"""The Eulerian baseline of the benchmarks: what its fluxes keep, its orders, and a cycle of the main scene."""

import importlib
import math
import pathlib
import sys

import numpy as np
import pytest

from fpk_rocking import Scene, solve_fpk
from fpk_rocking.density.space import Space
from fpk_rocking.physics.motion.flight import flight_covariance
from fpk_rocking.results import sampling as distances
from fpk_rocking.scene import Block, Harmonic, Overturning, WhiteNoise

ROOT = pathlib.Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "benchmarks"))
eulerian_operator = importlib.import_module("eulerian_operator")
eulerian_runs = importlib.import_module("eulerian_runs")
eulerian_steps = importlib.import_module("eulerian_steps")

DIFFUSION, FORCE, DURATION = 0.02, 0.6, 0.25
SCHEMES = {4: eulerian_steps.GAUSS, 2: eulerian_steps.CRANK_NICOLSON}


def scene(restitution=0.5):
    return Scene(Block(restitution), Harmonic(0.0, 2.0 * math.pi), WhiteNoise(DIFFUSION), overturning=Overturning(1.6))


def uneven(restitution=0.5):
    """An operator on a mesh without symmetry, whose lines an impact does not map onto each other; a random density."""
    space = Space(np.array([-1.6, -0.7, -0.1, 0.0, 0.3, 1.6]), np.array([-2.0, -0.9, -0.2, 0.0, 0.7, 1.0, 2.0]), 2)
    operator = eulerian_operator.Operator(space, scene(restitution))
    return operator, np.random.default_rng(5).standard_normal(space.unknowns)


@pytest.mark.parametrize("force", [-3.0, 0.4, 5.0])
def test_what_leaves_the_cells_overturns_or_is_lost(force):
    operator, density = uneven()
    change = operator.at(force)[0] @ density
    losses = operator.losses(density, force)
    assert np.all(losses != 0.0)
    assert abs(operator.unit @ change + losses.sum()) < 1e-14 * np.abs(change).sum()


@pytest.mark.parametrize("direction", [1, -1])
def test_impact_enters_at_the_restituted_velocity(direction):
    """The k-th moment of the velocities that enter is e^k times that of those that leave."""
    restitution = 0.3
    operator, density = uneven(restitution)
    space, basis = operator.space, operator.space.basis()
    cells = density.reshape(space.shape)
    cells[:, space.velocity_lines[:-1] * direction < (direction < 0)] = 0.0
    flux = eulerian_operator.impact(basis, space, operator.scene) @ density
    for power in range(space.degree + 1):
        entering, leaving = (
            space.project(lambda x, v, s=side, k=power: v**k * (s * x > 0.0), 4).ravel() @ flux
            for side in (direction, -direction)
        )
        assert entering == pytest.approx(-(restitution**power) * leaving, rel=1e-12)
        assert abs(leaving) > 1e-3


def test_impact_fills_a_cell_from_the_velocities_that_it_takes_there():
    """A density of 1 before impact is one of e^-2 after it, as far as the mesh reaches."""
    restitution = 0.3
    operator, _ = uneven(restitution)
    space, lines = operator.space, operator.space.velocity_lines
    flux = eulerian_operator.impact(space.basis(), space, operator.scene) @ operator.unit
    for direction, column in ((1, space.first_positive), (-1, space.first_positive - 1)):
        ends = np.where(lines * direction > 0.0, np.clip(lines / restitution, lines[0], lines[-1]), 0.0)
        before = np.where(lines * direction < 0.0, lines, 0.0)
        expected = direction * 0.5 * np.diff(ends**2 + before**2)
        assert flux.reshape(space.shape)[column, :, 0, 0] == pytest.approx(expected, abs=1e-13)


@pytest.mark.parametrize("force", [-3.0, 0.4, 5.0])
def test_elastic_impacts_and_upwind_fluxes_never_add_to_the_square_of_a_density(force):
    operator, _ = uneven(restitution=1.0)
    matrix = operator.at(force)[0].toarray()
    growth = np.linalg.eigvalsh(matrix + matrix.T)
    assert growth.max() < 1e-12 * np.abs(growth).max()


def gaussian(mean, covariance):
    inverse = np.linalg.inv(covariance)
    scale = math.sqrt(np.linalg.det(inverse)) / (2.0 * math.pi)

    def density(angle, velocity):
        x, v = angle - mean[0], velocity - mean[1]
        return scale * np.exp(-0.5 * (inverse[0, 0] * x * x + 2.0 * inverse[0, 1] * x * v + inverse[1, 1] * v * v))

    return density


def flown(cells, degree, steps, scheme=eulerian_steps.GAUSS, tolerance=eulerian_steps.TOLERANCE):
    """Fly a Gaussian under a constant force away from x = 0; return the space, the density, and the exact one."""
    mean, covariance = np.array([0.8, 0.2]), np.diag([0.012, 0.05])
    velocity = 1.6 / cells * np.arange(-3 * cells // 4, 5 * cells // 4 + 1)
    space = Space(np.array([-1.6, *np.linspace(0.0, 1.6, cells + 1)]), velocity, degree)
    operator = eulerian_operator.Operator(space, scene())
    march = eulerian_steps.March(operator, round(steps / DURATION), scheme, tolerance)
    density = space.project(gaussian(mean, covariance), degree + 3).ravel()
    for _ in range(steps):
        density, _ = march.step(density, FORCE)
    cosh, sinh = math.cosh(DURATION), math.sinh(DURATION)
    matrix, centre = np.array([[cosh, sinh], [sinh, cosh]]), np.array([1.0 - FORCE, 0.0])
    xx, xv, vv = flight_covariance(DIFFUSION, DURATION)
    end = gaussian(matrix @ (mean - centre) + centre, matrix @ covariance @ matrix.T + [[xx, xv], [xv, vv]])
    return space, density.reshape(space.shape), space.project(end, degree + 3)


def distance(space, first, second):
    return math.sqrt(float((space.areas[..., None, None] * (first - second) ** 2).sum()))


@pytest.mark.parametrize(("degree", "cells"), [(2, (16, 24)), (3, (12, 16))])
def test_flight_converges_to_its_closed_form(degree, cells):
    errors = [distance(*flown(count, degree, 10)) for count in cells]
    assert eulerian_runs.order(1.0 / np.array(cells), errors) == pytest.approx(degree + 1.0, abs=0.15)


@pytest.mark.parametrize("order", [2, 4])
def test_steps_have_their_order(order):
    steps = 4, 6, 8
    space, converged, _ = flown(8, 2, 64, SCHEMES[order], 1e-12)
    errors = [distance(space, flown(8, 2, count, SCHEMES[order], 1e-12)[1], converged) for count in steps]
    assert eulerian_runs.order(1.0 / np.array(steps), errors) == pytest.approx(order, abs=0.15)


@pytest.mark.slow
def test_a_cycle_of_the_main_scene_agrees_with_independent_paths():
    """On a coarse mesh L1 is .054, and the error in survival 2e-5 beside 3e-4 of the reference."""
    start = solve_fpk(eulerian_runs.SCENE, cycles=1, tol=1e-2).at(1)
    run = eulerian_runs.Run(eulerian_runs.Row(16, 28, 3, 128), start)
    before = run.mass
    outflow = run.cycle()
    reference = eulerian_runs.REFERENCE
    assert abs(run.mass + outflow.sum() - before) < 1e-13
    assert abs(run.mass - reference["survival"][2]) < 4e-4
    assert distances.l1(run.bins(eulerian_runs.EDGES), reference["probabilities"][1]) < 0.07


def test_mesh_without_its_lines_of_symmetry_is_refused():
    lines = np.array([-1.0, -0.3, 0.4, 1.0])
    for name, space in (
        ("angle_lines", Space(lines, np.linspace(-1.0, 1.0, 3), 1)),
        ("velocity_lines", Space(np.linspace(-1.0, 1.0, 3), lines, 1)),
    ):
        with pytest.raises(ValueError, match=f"{name}: got .*, accepted: mesh lines with 0.0"):
            eulerian_operator.Operator(space, scene())
