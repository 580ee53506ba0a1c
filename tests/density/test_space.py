"""The space against scikit-fem: what the solver reads off its coefficients is what scikit-fem's own basis says."""

import dataclasses
import math

import numpy as np
import pytest
from numpy.polynomial import polynomial
from scipy.integrate import quad
from skfem import Basis, BilinearForm, Functional, MeshQuad
from skfem.element import ElementQuad0

from fpk_rocking.density.density import Density
from fpk_rocking.density.space import Space, graded_lines, legendre_element, patch_lines, velocity_bound
from fpk_rocking.density.step import Exit
from fpk_rocking.density.step.scatter import locate_point
from fpk_rocking.scene import Block, Harmonic, Overturning, Scene, Start, WhiteNoise

ANGLE_LINES = np.array([-1.2, -0.7, -0.3, 0.0, 0.4, 1.3])
VELOCITY_LINES = np.array([-1.0, -0.2, 0.15, 1.7])
DEGREES = [1, 3, 5]


def space_of(degree=3):
    return Space(ANGLE_LINES, VELOCITY_LINES, degree)


def anything(space, seed=1):
    return np.random.default_rng(seed).normal(size=space.shape)


def skfem_integrals(space, coefficients, cuts, *weights):
    """Integrals of weight * density in every cell of the mesh refined by `cuts`, by scikit-fem."""
    lines = [np.union1d(old, new) for old, new in zip((space.angle_lines, space.velocity_lines), cuts, strict=True)]
    fine = Basis(MeshQuad.init_tensor(*lines), ElementQuad0(), intorder=2 * space.degree + 4)
    points = np.asarray(fine.global_coordinates())
    values = (space.basis().probes(points.reshape(2, -1)) @ coefficients.ravel()).reshape(points.shape[1:])
    return lines, [
        np.sum(weight(*points) * values * fine.dx, axis=1).reshape(len(lines[0]) - 1, -1) for weight in weights
    ]


@pytest.mark.parametrize("degree", DEGREES)
def test_mass_matrix_is_the_jacobian_times_the_identity(degree):
    space = space_of(degree)
    mass = BilinearForm(lambda u, v, _: u * v).assemble(space.basis()).toarray()
    assert mass.shape == (space.unknowns, space.unknowns)
    assert np.abs(mass - np.diag(np.repeat(space.areas, (degree + 1) ** 2))).max() < 1e-13


@pytest.mark.parametrize("degree", DEGREES)
def test_element_gradient_is_the_derivative_of_its_value(degree):
    element, points, h = legendre_element(degree), np.random.default_rng(2).random((2, 7)), 1e-6
    for i in range(element.interior_dofs):
        _, gradient = element.lbasis(points, i)
        for axis, part in enumerate(gradient):
            step = h * np.eye(2)[axis][:, None]
            slope = (element.lbasis(points + step, i)[0] - element.lbasis(points - step, i)[0]) / (2.0 * h)
            assert np.abs(part - slope).max() < 1e-5


@pytest.mark.parametrize("degree", DEGREES)
def test_evaluation_is_that_of_scikit_fem(degree):
    space = space_of(degree)
    coefficients = anything(space)
    points = np.random.default_rng(3).uniform([[-1.2], [-1.0]], [[1.3], [1.7]], (2, 60))
    expected = space.basis().probes(points) @ coefficients.ravel()
    assert np.abs(space.evaluate(coefficients, *points) - expected).max() < 1e-12


def test_unknowns_are_numbered_cell_by_cell_with_the_velocity_fastest():
    space = space_of()
    for index in ((0, 0, 0, 0), (0, 0, 0, 1), (1, 2, 2, 1), (4, 1, 3, 0)):
        unit = np.zeros(space.shape)
        unit[index] = 1.0
        i, j, a, b = index
        x = ANGLE_LINES[i] + 0.3 * (ANGLE_LINES[i + 1] - ANGLE_LINES[i])
        v = VELOCITY_LINES[j] + 0.8 * (VELOCITY_LINES[j + 1] - VELOCITY_LINES[j])
        basis = math.sqrt((2 * a + 1) * (2 * b + 1))
        legendre = [np.polynomial.legendre.Legendre.basis(k)(2.0 * t - 1.0) for k, t in ((a, 0.3), (b, 0.8))]
        assert space.evaluate(unit, x, v) == pytest.approx(basis * legendre[0] * legendre[1], abs=1e-13)
        dof = np.ravel_multi_index(index, space.shape)
        assert dof in space.basis().element_dofs[:, i * (len(VELOCITY_LINES) - 1) + j]


def test_evaluation_broadcasts_takes_the_upper_cell_at_lines_and_is_zero_outside():
    space = space_of()
    coefficients = anything(space)
    values = space.evaluate(coefficients, np.array([[-0.5], [0.2]]), np.array([0.1, 0.3, 1.0]))
    assert values.shape == (2, 3)
    assert values[1, 2] == space.evaluate(coefficients, 0.2, 1.0)
    assert space.evaluate(coefficients, 0.2, 1.0).shape == ()
    at_zero, above, below = (float(space.evaluate(coefficients, x, 0.5)) for x in (0.0, 1e-12, -1e-12))
    assert at_zero == pytest.approx(above, abs=1e-9)
    assert abs(at_zero - below) > 0.1
    assert np.all(space.evaluate(coefficients, [-1.21, 1.31, 0.0, 0.0], [0.0, 0.0, -1.01, 1.71]) == 0.0)
    assert np.all(space.evaluate(coefficients, [-1.2, 1.3], [-1.0, 1.7]) != 0.0)


@pytest.mark.parametrize("degree", DEGREES)
def test_projection_reproduces_polynomials_and_is_that_of_scikit_fem(degree):
    space, rng = space_of(degree), np.random.default_rng(4)
    table = rng.normal(size=(degree + 1, degree + 1))
    points = rng.uniform([[-1.2], [-1.0]], [[1.3], [1.7]], (2, 40))

    def surface(x, v):
        return polynomial.polyval2d(*np.broadcast_arrays(x, v), table)

    assert np.abs(space.evaluate(space.project(surface, degree + 1), *points) - surface(*points)).max() < 1e-11

    def bump(x, v):
        return np.exp(-3.0 * (x - 0.1) ** 2 + x * v - 2.0 * v**2)

    expected = space.basis(order=2 * (degree + 3) - 1).project(lambda z: bump(z[0], z[1]))
    assert np.abs(space.project(bump, degree + 3).ravel() - expected).max() < 1e-12


@pytest.mark.parametrize("degree", DEGREES)
def test_bin_integrals_are_exact(degree):
    """Bins that cut cells, hold several, meet mesh lines and reach beyond the mesh."""
    space = space_of(degree)
    coefficients = anything(space)
    angle_edges = np.array([-1.6, -1.0, -0.7, -0.65, -0.6, 0.0, 1.0, 2.0])
    velocity_edges = np.array([-0.9, -0.1, 0.0, 1.7, 3.0])
    bins = space.bin_integrals(coefficients, angle_edges, velocity_edges)
    (x, v), (pieces,) = skfem_integrals(
        space, coefficients, (angle_edges[1:-1], velocity_edges[:-1]), lambda x, _: 1.0 + 0.0 * x
    )
    rows = np.searchsorted(angle_edges, 0.5 * (x[1:] + x[:-1])) - 1
    columns = np.searchsorted(velocity_edges, 0.5 * (v[1:] + v[:-1])) - 1
    expected = np.zeros(bins.shape)
    for (i, j), part in np.ndenumerate(pieces):
        if columns[j] >= 0:
            expected[rows[i], columns[j]] += part
    assert np.abs(bins - expected).max() < 1e-12
    assert np.all(bins[:, -1] == 0.0)


def test_bin_integrals_of_a_polynomial_in_closed_form():
    space = space_of()
    cubic = space.project(lambda x, v: 1.0 + x**3 * v**2, 4)
    (value,) = space.bin_integrals(cubic, [-0.5, 1.1], [-0.3, 0.9])[0]
    assert value == pytest.approx(1.6 * 1.2 + (1.1**4 - 0.5**4) / 4 * (0.9**3 + 0.3**3) / 3, abs=1e-13)


def test_masses_and_negative_mass():
    space = space_of()
    coefficients = anything(space)
    _, (expected,) = skfem_integrals(space, coefficients, ([], []), lambda x, _: 1.0 + 0.0 * x)
    assert np.abs(space.masses(coefficients) - expected).max() < 1e-13
    assert space.masses(coefficients).sum() == pytest.approx(
        float(space.bin_integrals(coefficients, [-2.0, 2.0], [-2.0, 2.0])[0, 0]), abs=1e-12
    )
    steps = np.zeros(space.shape)
    steps[1, 2, 0, 0], steps[3, 0, 0, 0] = -0.25, 4.0
    assert space.negative_mass(steps) == pytest.approx(0.25 * 0.4 * 1.55, abs=1e-14)
    assert space.negative_mass(-steps) == pytest.approx(4.0 * 0.4 * 0.8, abs=1e-13)
    assert space.absolute_mass(steps) == pytest.approx(0.25 * 0.4 * 1.55 + 4.0 * 0.4 * 0.8, abs=1e-13)


def test_marginals_are_integrals_of_the_density():
    space = space_of()
    coefficients = anything(space)
    density = Density(space, coefficients)
    nodes, weights = np.polynomial.legendre.leggauss(4)
    for marginal, lines, others, order in (
        (density.marginal_angle, ANGLE_LINES, VELOCITY_LINES, 1),
        (density.marginal_velocity, VELOCITY_LINES, ANGLE_LINES, -1),
    ):
        points = np.random.default_rng(5).uniform(lines[0], lines[-1], 20)
        sizes = np.diff(others)
        along = others[:-1, None] + sizes[:, None] * 0.5 * (nodes + 1.0)
        values = density(*(points[:, None, None], along)[::order])
        expected = np.einsum("pcq,c,q->p", values, sizes, 0.5 * weights)
        assert np.abs(marginal(points) - expected).max() < 1e-12
        assert np.all(marginal([lines[0] - 0.1, lines[-1] + 0.1]) == 0.0)


def test_moments_are_those_of_scikit_fem():
    space = space_of()
    density = Density(space, anything(space))
    powers = [(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2), (3, 1), (0, 4)]
    weights = [lambda x, v, m=m, n=n: x**m * v**n for m, n in powers]
    _, expected = skfem_integrals(space, density.coefficients, ([], []), *weights)
    for (m, n), parts in zip(powers, expected, strict=True):
        assert density.moment(m, n) == pytest.approx(parts.sum(), abs=1e-12)


def test_mean_and_covariance_are_of_what_is_left():
    """A plane with the mass .6 on one cell has a mean and covariance in closed form."""
    space = Space(np.array([0.0, 2.0]), np.array([-1.0, 3.0]), 3)
    density = Density(space, space.project(lambda x, _: 0.6 * (0.05 + 0.075 * x), 4))
    mean = np.array([4.0 * (0.05 * 2.0 + 0.075 * 8.0 / 3.0), 1.0])
    square = 4.0 * (0.05 * 8.0 / 3.0 + 0.075 * 4.0)
    assert density.moment(0, 0) == pytest.approx(0.6, abs=1e-14)
    assert density.mean == pytest.approx(mean, abs=1e-13)
    assert density.covariance == pytest.approx(np.diag([square - mean[0] ** 2, 16.0 / 12.0]), abs=1e-13)


def test_cell_values_have_the_angle_first_and_keep_both_sides_of_a_line():
    space = space_of()
    coefficients = anything(space)
    density = Density(space, coefficients)
    values = density.cell_values(5)
    assert values.shape == (5, 3, 5, 5)
    x = ANGLE_LINES[3] + 0.25 * (ANGLE_LINES[4] - ANGLE_LINES[3])
    v = VELOCITY_LINES[1] + 0.75 * (VELOCITY_LINES[2] - VELOCITY_LINES[1])
    assert values[3, 1, 1, 3] == pytest.approx(float(density(x, v)), abs=1e-12)
    assert values[3, 1, 0, 3] == pytest.approx(float(density(0.0, v)), abs=1e-12)
    assert values[2, 1, -1, 3] == pytest.approx(float(density(-1e-13, v)), abs=1e-9)
    assert abs(values[2, 1, -1, 3] - values[3, 1, 0, 3]) > 0.1
    assert [line.tolist() for line in density.mesh_lines] == [ANGLE_LINES.tolist(), VELOCITY_LINES.tolist()]
    assert density.degree == 3


def test_graded_lines_are_symmetric_and_finest_at_zero():
    lines = graded_lines(1.5, 20, 1.5)
    assert lines.shape == (21,)
    assert np.array_equal(lines, -lines[::-1])
    assert (lines[0], lines[10], lines[-1]) == (-1.5, 0.0, 1.5)
    assert np.all(np.diff(lines[10:], 2) > 0.0)
    assert graded_lines(1.5, 6, 1.0) == pytest.approx(np.linspace(-1.5, 1.5, 7), abs=1e-15)


@pytest.mark.parametrize(
    ("low", "high"), [(-0.3, 0.7), (0.01, 0.5), (-0.4, -0.001), (-1e-4, 2.0), (0.2, 0.5), (-3.0, -1.0)]
)
def test_patch_lines_cover_and_meet_zero(low, high):
    lines = patch_lines(low, high, 20)
    assert lines[0] <= low < high <= lines[-1]
    assert np.diff(lines) == pytest.approx((high - low) / 20, rel=1e-9)
    if lines[0] < 0.0 < lines[-1]:
        assert 0.0 in lines
    assert len(lines) <= 23


def test_velocity_bound_covers_the_separatrix_and_the_start():
    noise, forcing = WhiteNoise(0.0025), Harmonic(4.6, 2.7, 0.3)
    edge = 1.0 + 4.6 / math.sqrt(1.0 + 2.7**2) + 0.4
    assert velocity_bound(Scene(Block(0.5), forcing, noise), 0.0025) == pytest.approx(edge, abs=1e-12)
    outward = Scene(Block(0.5), forcing, noise, Start(0.5, 6.0))
    assert velocity_bound(outward, 0.0025) == pytest.approx(1.2 * 6.0, abs=1e-12)
    held = Scene(Block(0.5), forcing, noise, Start(-1.5))
    assert velocity_bound(held, 0.0025) == pytest.approx(edge, abs=1e-12)
    far = dataclasses.replace(held, overturning=Overturning(3.5))
    assert velocity_bound(far, 0.0025) == pytest.approx(edge + 1.5, abs=1e-12)


@pytest.mark.parametrize("phase", [0.3, 2.0, 3.5, 5.0])
@pytest.mark.parametrize("side", [1, -1])
def test_velocity_bound_grows_by_what_an_inward_start_has_in_excess(phase, side):
    """Of the motion w = v - x, w' = -w - s + f, that has been driven for ever: there w is known by quadrature."""
    noise, forcing = WhiteNoise(0.0025), Harmonic(2.0, 2.7, phase)
    driven = quad(lambda t: -2.0 * math.exp(-t) * math.cos(phase - 2.7 * t), 0.0, 40.0, limit=200)[0]
    plain = velocity_bound(Scene(Block(0.5), forcing, noise), 0.0025)
    for excess in (-0.1, 0.0, 0.25, 0.7):
        velocity = 0.1 * side - side + driven - side * excess
        scene = Scene(Block(0.5), forcing, noise, Start(0.1 * side, velocity))
        assert velocity * side < 0.0
        assert velocity_bound(scene, 0.0025) == pytest.approx(plain + max(excess, 0.0), abs=1e-7)
    spread = dataclasses.replace(scene, start=Start(0.1 * side, velocity, ((0.09, -0.02), (-0.02, 0.01))))
    deviation = math.sqrt(0.09 + 0.01 + 2.0 * 0.02)
    assert velocity_bound(spread, 0.0025) == pytest.approx(plain + 0.7 + 8.0 * deviation, abs=1e-7)


def test_a_density_goes_into_functionals_of_scikit_fem():
    """Mean energy and a marginal, as docs/numerics.md shows them; exact where the integrand is a polynomial."""
    lines = np.linspace(-1.2, 1.2, 9), np.linspace(-2.0, 2.0, 11)
    space = Space(*lines, 3)
    density = Density(space, space.project(lambda x, v: (1.5 + x) * (4.0 - v * v) * (1.0 + 0.1 * x * v), 6))

    @Functional
    def energy(w):
        angle, velocity = w.x
        return (0.5 * velocity**2 + np.abs(angle) - 0.5 * angle**2) * w["density"]

    basis = density.basis(order=8)
    mean_energy = energy.assemble(basis, density=basis.interpolate(density.vector))
    assert mean_energy == pytest.approx(
        density.integral(lambda x, v: 0.5 * v**2 + np.abs(x) - 0.5 * x**2, 8), rel=1e-14
    )
    nodes, weights = np.polynomial.legendre.leggauss(12)
    halves = [(0.6 * (side + nodes), 0.6 * weights) for side in (-1.0, 1.0)]
    x = np.concatenate([points for points, _ in halves])[:, None]
    v, w = 2.0 * nodes, np.outer(np.concatenate([share for _, share in halves]), 2.0 * weights)
    p = (1.5 + x) * (4.0 - v * v) * (1.0 + 0.1 * x * v)
    assert mean_energy == pytest.approx(np.sum(w * p * (0.5 * v**2 + np.abs(x) - 0.5 * x**2)), rel=1e-13)
    for low, high in zip(lines[0][:-1], lines[0][1:], strict=True):
        inside = density.integral(lambda x, v, low=low, high=high: (x > low) & (x < high) & (v < np.inf))
        assert inside == pytest.approx(density.bin_probabilities([low, high], [-2.0, 2.0]).item(), rel=1e-12)
    assert density.moment(3, 2) == pytest.approx(np.sum(w * p * x**3 * v**2), rel=1e-12)


def test_cells_are_found_on_lines_of_any_sizes():
    """Sizes from 1e-9 on: the table stays small, and every point is in the cell that a search finds."""
    positive = np.append(np.geomspace(1e-9, 1.0, 40), 1.5)
    space = Space(np.concatenate([-positive[::-1], [0.0], positive]), np.linspace(-1.0, 1.0, 9), 1)
    for table in space.cell_searches:
        lines = table[0]
        points = np.random.default_rng(1).choice([-1.0, 1.0], 500) * np.geomspace(1e-10, 0.999, 500)
        cells_and_places = [locate_point(table, point) for point in points]
        cells = np.searchsorted(lines, points, side="right") - 1
        assert [cell for cell, _ in cells_and_places] == cells.tolist()
        middles, halves = 0.5 * (lines[1:] + lines[:-1])[cells], 0.5 * np.diff(lines)[cells]
        assert [place for _, place in cells_and_places] == pytest.approx((points - middles) / halves, abs=1e-9)
        assert table[2].nbytes < 1e6
        assert locate_point(table, lines[-1])[0] == Exit.TRUNCATED
