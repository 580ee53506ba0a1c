"""The non-negative view of a density: nowhere negative, conservative, local, and no further off than it must be."""

import dataclasses

import numpy as np
import pytest
from scipy.stats import binom

from fpk_rocking import solve_fpk
from fpk_rocking.density.space.density import Density
from fpk_rocking.density.space.mesh import graded_lines
from fpk_rocking.density.space.space import Space, gauss

LINES = graded_lines(1.5, 12, 1.5), graded_lines(3.0, 10, 1.3)
DEGREES = [1, 2, 3, 4, 5]


def signed(degree, seed=1, wild=0.4):
    """A density with negative parts in most cells and negative masses in some, on either side of x = 0."""
    rng = np.random.default_rng(seed)
    space = Space(*LINES, degree)
    means = np.exp(rng.normal(0.0, 3.0, space.shape[:2])) * np.where(rng.random(space.shape[:2]) < 0.2, -0.03, 1.0)
    coefficients = means[:, :, None, None] * rng.normal(0.0, wild, space.shape)
    coefficients[..., 0, 0] = means
    coefficients[2, 3] = coefficients[8, 1:4] = 0.0
    return Density(space, coefficients)


def steps(masses, angle_lines=(-3.0, -2.0, -1.0, 0.0, 1.0, 2.0, 3.0)):
    """A density that is constant in every cell, of area 1, and has these masses."""
    masses = np.array(masses, dtype=float)
    space = Space(np.array(angle_lines), np.arange(masses.shape[1] + 1.0), 2)
    coefficients = np.zeros(space.shape)
    coefficients[..., 0, 0] = masses
    return Density(space, coefficients)


def cell_masses(view, law):
    """Masses of a view in the cells of the density that it is of."""
    return view.bin_probabilities(*law.mesh_lines)


def on_pieces(law, view, count):
    """Values of a density and of its view at Gauss points of every piece, and their weights."""
    pieces, (nodes, weights) = max(law.degree, 1), gauss(count)
    points = ((np.arange(pieces)[:, None] + nodes) / pieces).ravel()
    raw = law.space.cell_values(law.coefficients, points, points)
    n_angle, n_velocity = law.space.shape[:2]
    split = view.space.cell_values(view.coefficients, nodes, nodes)
    split = split.reshape(n_angle, pieces, n_velocity, pieces, count, count).transpose(0, 2, 1, 4, 3, 5)
    weights = np.tile(weights, pieces) / pieces
    return raw, split.reshape(raw.shape), law.space.areas[:, :, None, None] * np.outer(weights, weights)


def mirrored(law):
    odd = (-1.0) ** np.add.outer(*[np.arange(law.degree + 1)] * 2)
    return Density(law.space, law.coefficients[::-1, ::-1] * odd)


@pytest.fixture(scope="module")
def band(main_scene):
    return solve_fpk(main_scene, cycles=2, tol=1e-2)


@pytest.mark.parametrize("degree", DEGREES)
def test_nothing_that_is_evaluated_or_integrated_is_negative(degree):
    for seed in range(3):
        law = signed(degree, seed)
        assert law.space.negative_mass(law.coefficients) > 0.05
        view, rng = law.nonnegative(), np.random.default_rng(seed)
        points = rng.uniform(-1.5, 1.5, 10_000), rng.uniform(-3.0, 3.0, 10_000)
        edges = np.sort(rng.uniform(-1.5, 1.5, 200)), np.sort(rng.uniform(-3.0, 3.0, 200))
        assert view.cell_values(9).min() >= 0.0
        assert view(*points).min() >= 0.0
        assert view.bin_probabilities(*edges).min() >= 0.0
        assert view.marginal_angle(points[0]).min() >= 0.0
        assert view.marginal_velocity(points[1]).min() >= 0.0
        assert view.space.negative_mass(view.coefficients) == 0.0


def test_a_dip_between_the_points_of_a_lattice_is_found():
    """(t - 1/7)² - 1e-6 is negative on one part in 500 of a cell alone."""
    law, cell = steps(np.ones((6, 3))), Space(np.array([0.0, 1.0]), np.array([0.0, 1.0]), 2)
    law.coefficients[4, 1] = cell.project(lambda t, v: (t - 1 / 7) ** 2 - 1e-6 + 0.0 * v, 3)[0, 0]
    bottom = 1.0 + 1 / 7, 1.5
    assert law(*bottom) == pytest.approx(-1e-6, rel=1e-6)
    assert law.cell_values(7).min() > 0.0
    assert law.nonnegative()(*bottom) >= 0.0


@pytest.mark.parametrize("degree", DEGREES)
def test_mass_stays_in_total_on_each_side_and_in_cells_that_need_not_pay(degree):
    law = signed(degree)
    masses, kept = law.space.masses(law.coefficients), cell_masses(law.nonnegative(), law)
    size = np.abs(masses).sum()
    for side in (slice(0, 6), slice(6, 12)):
        assert abs(kept[side].sum() - masses[side].sum()) < 1e-14 * size
    assert np.abs(kept[masses < 0.0]).max() == 0.0
    assert np.all(kept <= np.maximum(masses, 0.0) * (1.0 + 1e-13))
    mild = Density(law.space, law.coefficients * np.where(masses < 0.0, 0.0, 1.0)[:, :, None, None])
    expected = np.maximum(masses, 0.0)
    assert np.abs(cell_masses(mild.nonnegative(), mild) - expected).max() < 1e-14 * expected.max()
    assert np.all(np.abs(cell_masses(mild.nonnegative(), mild) - expected) <= 1e-13 * expected)


def test_a_cell_of_negative_mass_is_paid_for_by_the_cells_around_it_in_proportion():
    masses = np.ones((6, 7))
    masses[1, 3], masses[1, 2], masses[0, 0] = -0.5, 4.0, 9.0
    expected = masses.copy()
    expected[0:3, 2:5] *= 1.0 - 0.5 / 11.0
    expected[1, 3] = 0.0
    law = steps(masses)
    assert np.abs(cell_masses(law.nonnegative(), law) - expected).max() < 1e-15 * 9.0


def test_the_square_grows_until_it_can_pay_and_no_further():
    """One cell away there is 0.25 and two away 1.75 more: both pay half of what they have, others nothing."""
    masses = np.zeros((6, 9))
    masses[0, 4], masses[0, 5], masses[1, 2] = -1.0, 0.25, 1.75
    masses[0, 1] = masses[0, 0] = masses[3, 4] = 7.0
    law = steps(masses)
    expected = masses.copy()
    expected[0, 4], expected[0, 5], expected[1, 2] = 0.0, 0.125, 0.875
    assert np.abs(cell_masses(law.nonnegative(), law) - expected).max() < 1e-14


def test_nothing_crosses_upright_however_near_the_mass_there_is():
    masses = np.zeros((6, 7))
    masses[3, 3], masses[2, 3], masses[5, 6] = -0.5, 100.0, 0.75
    law = steps(masses)
    kept = cell_masses(law.nonnegative(), law)
    assert kept[2, 3] == pytest.approx(100.0, rel=1e-14)
    assert kept[5, 6] == pytest.approx(0.25, rel=1e-13)
    assert np.count_nonzero(kept) == 2


def test_cells_that_ask_for_the_same_mass_share_it_whatever_their_order():
    """Two owe 1 each; between them is 1.5, and what it cannot pay comes from one cell further away."""
    masses = np.zeros((6, 7))
    masses[1, 2] = masses[1, 4] = -1.0
    masses[1, 3], masses[1, 0], masses[1, 6] = 1.5, 2.0, 3.0
    law = steps(masses)
    kept = cell_masses(law.nonnegative(), law)
    assert kept[1] == pytest.approx([1.75, 0.0, 0.0, 0.0, 0.0, 0.0, 2.75], abs=1e-14)


@pytest.mark.parametrize("degree", DEGREES)
def test_the_view_of_a_view_is_the_view(degree):
    for seed in range(5):
        view = signed(degree, seed).nonnegative()
        assert view.nonnegative() is view


def test_a_density_that_is_not_negative_is_its_own_view():
    law = signed(3, wild=0.01)
    law.coefficients[...] *= np.sign(law.coefficients[..., :1, :1])
    assert law.nonnegative() is law
    law.coefficients[4, 4, 3, 3] = -law.coefficients[4, 4, 0, 0]
    view = law.nonnegative()
    assert view is not law
    points = np.random.default_rng(2).uniform([[-1.5], [-3.0]], [[1.5], [3.0]], (2, 5000))
    cell = [np.searchsorted(lines, along) - 1 for lines, along in zip(LINES, points, strict=True)]
    there = (cell[0] == 4) & (cell[1] == 4)
    assert 0 < there.sum() < 100
    assert np.all(np.abs(view(*points) - law(*points))[~there] <= 1e-13 * law(*points)[~there])
    assert np.abs(view(*points) - law(*points))[there].max() > 0.1 * law.coefficients[4, 4, 0, 0]


@pytest.mark.parametrize("degree", DEGREES)
def test_mirror_images_have_mirrored_views(degree):
    law = signed(degree)
    there, here = mirrored(law).nonnegative(), law.nonnegative()
    points = np.random.default_rng(3).uniform([[-1.5], [-3.0]], [[1.5], [3.0]], (2, 5000))
    values = here(*points)
    assert np.abs(there(*-points) - values).max() < 1e-13 * values.max()


def test_the_view_is_continuous_within_the_cells_of_the_density():
    law = signed(3)
    values = law.nonnegative().cell_values(4).reshape(12, 3, 10, 3, 4, 4)
    sizes = np.abs(law.coefficients).max()
    assert np.abs(values[:, :-1, :, :, -1] - values[:, 1:, :, :, 0]).max() < 1e-12 * sizes
    assert np.abs(values[:, :, :, :-1, :, -1] - values[:, :, :, 1:, :, 0]).max() < 1e-12 * sizes


@pytest.mark.parametrize("degree", DEGREES)
def test_distance_is_between_twice_the_negative_mass_and_twice_that_of_the_bernstein_coefficients(degree):
    law = signed(degree)
    raw, view, weights = on_pieces(law, law.nonnegative(), 24)
    nodes = np.linspace(0.0, 1.0, degree + 1)
    bernstein = binom.pmf(np.arange(degree + 1), degree, nodes[:, None])
    points = (np.arange(degree)[:, None] + nodes) / degree
    values = law.space.cell_values(law.coefficients, points.ravel(), points.ravel())
    values = values.reshape(12, 10, degree, degree + 1, degree, degree + 1)
    solve = np.linalg.inv(bernstein)
    control = np.einsum("xvkilj,ai,bj->xvkalb", values, solve, solve)
    highest = (np.maximum(-control, 0.0).mean(axis=(2, 3, 4, 5)) * law.space.areas).sum()
    distance = (np.abs(view - raw) * weights).sum()
    lowest = (np.maximum(-raw, 0.0) * weights).sum()
    assert 2.0 * lowest * 0.999 <= distance <= 2.0 * highest * 1.001


def test_refuses_a_side_of_negative_mass_and_takes_rounding_for_none():
    masses = np.ones((6, 4))
    masses[4, 1] = -12.5
    law = steps(masses)
    message = r"density: got the mass -1\.5e\+00 on the side angle > 0, accepted: 0 or more"
    with pytest.raises(ValueError, match=message):
        law.nonnegative()
    with pytest.raises(ValueError, match="on the side angle < 0"):
        mirrored(steps(np.where(masses < 0.0, masses, 1.0))).nonnegative()
    masses[3:], masses[5, 2], masses[5, 3] = 0.0, -2e-16, 1e-16
    law = steps(masses)
    kept = cell_masses(law.nonnegative(), law)
    assert np.all(kept[3:] == 0.0)
    assert kept.sum() == pytest.approx(12.0, rel=1e-15)


def test_a_mesh_on_one_side_of_upright():
    masses = np.ones((3, 4))
    masses[1, 1] = -0.5
    for lines in ((1.0, 2.0, 3.0, 4.0), (-4.0, -3.0, -2.0, -1.0)):
        law = steps(masses, lines)
        assert law.nonnegative().moment(0, 0) == pytest.approx(10.5, rel=1e-14)


def test_tails_down_to_the_smallest_numbers():
    space = Space(*LINES, 3)
    for rate in (400.0, 500.0, 700.0, 900.0):
        law = Density(space, space.project(lambda x, v, k=rate: np.exp(-k * ((x - 0.2) ** 2 + (v + 0.3) ** 2)), 8))
        sizes = np.abs(law.coefficients).max(axis=(2, 3))
        assert np.any((sizes > 0.0) & (sizes < 1e-300))
        view = law.nonnegative()
        assert view.cell_values(9).min() >= 0.0
        assert view.nonnegative() is view
        assert view.moment(0, 0) == pytest.approx(law.moment(0, 0), rel=1e-13)


def test_the_main_scene_is_off_by_a_few_times_its_negative_mass(band):
    for cycle, most in ((1, 9.0), (2, 5.5)):
        law = band.at(cycle)
        view = law.nonnegative()
        raw, values, weights = on_pieces(law, view, 8)
        negative = (np.maximum(-raw, 0.0) * weights).sum()
        assert 0.0 < negative <= 1.1 * band.negative_mass
        assert values.min() >= 0.0
        assert 2.0 * 0.99 * negative <= (np.abs(values - raw) * weights).sum() <= most * negative
        masses, kept = law.space.masses(law.coefficients), cell_masses(view, law)
        for side in (slice(0, law.space.first_positive), slice(law.space.first_positive, None)):
            assert abs(kept[side].sum() - masses[side].sum()) < 1e-14
        assert np.abs(kept - masses).sum() <= 2.001 * np.maximum(-masses, 0.0).sum() < 1e-3


def test_bins_of_an_evolution_on_request(band):
    edges = np.linspace(-1.6, 1.6, 129), np.linspace(-4.0, 4.0, 161)
    raw = band.bin_probabilities(2, *edges)
    bins = band.bin_probabilities(2, *edges, nonnegative=True)
    assert raw.min() < 0.0 <= bins.min()
    assert bins.sum() == pytest.approx(band.survival[2], abs=1e-13)
    assert np.abs(bins - raw).sum() < 5.5 * band.negative_mass
    assert np.array_equal(bins, band.at(2).nonnegative().bin_probabilities(*edges))
    assert np.array_equal(raw, band.bin_probabilities(2, *edges, nonnegative=False))
    atom = band.bin_probabilities(0, [-1.0, 0.0, 1.0], [-0.5, 0.5], nonnegative=True)
    assert atom.tolist() == [[0.0], [1.0]]


def test_an_evolution_without_a_view_says_so(band):
    broken = dataclasses.replace(band, coefficients=-band.coefficients)
    with pytest.raises(ValueError, match=r"density: got the mass .* on the side angle < 0"):
        broken.bin_probabilities(1, [0.0, 1.0], [0.0, 1.0], nonnegative=True)
    assert broken.bin_probabilities(1, [-2.0, 2.0], [-9.0, 9.0])[0, 0] < 0.0
