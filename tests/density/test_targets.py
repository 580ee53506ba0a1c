"""Paths by target in groups of eight against the same paths one by one."""

import numpy as np
import pytest

from fpk_rocking.base.basis import legendre_basis
from fpk_rocking.density.space import Space
from fpk_rocking.density.step import Exit
from fpk_rocking.density.step.scatter import Targets, gather_cell, scatter_cell

TARGET = Space(np.array([-1.0, -0.4, 0.0, 0.3, 1.0]), np.array([-1.0, -0.2, 0.5, 1.0]), 3)
POINTS, NODES = (3, 4), np.array([0.2, 0.5, 0.3])
BASIS = (1.0,) * 4


def ends(rng, cells):
    """Ends of the paths of some cells, of which some overturn; where these are is not a number."""
    shape = (cells, *POINTS, len(NODES))
    ends_of_paths = rng.uniform(-1.3, 1.3, (*shape, 2)) * [0.7, 0.8]
    flags = np.where(ends_of_paths[..., 0] < 0.0, -1, 1).astype(np.int32)
    flags[0] = Exit.OVERTURNED_RIGHT
    flags[1:, 0] = Exit.OVERTURNED_LEFT
    ends_of_paths[flags < -1] = np.nan
    return ends_of_paths, flags


def one_by_one(values, ends_of_paths, flags):
    """Unknowns (cells, modes²) of the target and absorbed (3,), by numpy's searches and the space's own polynomials."""
    buffer, absorbed = np.zeros((TARGET.areas.size, 16)), np.zeros(3)
    for place in np.ndindex(flags.shape):
        amount, (x, v) = values[place[:2]] * NODES[place[2]], ends_of_paths[place]
        if flags[place] < -1:
            absorbed[Exit.OVERTURNED_LEFT - flags[place]] += amount
            continue
        cell = [
            np.searchsorted(lines, coordinate, side="right") - 1
            for lines, coordinate in zip(TARGET.lines, (x, v), strict=True)
        ]
        if not all(0 <= n < len(lines) - 1 for n, lines in zip(cell, TARGET.lines, strict=True)):
            absorbed[2] += amount
            continue
        parts = [
            legendre_basis(np.array([(coordinate - lines[n]) / (lines[n + 1] - lines[n])]), 3)[0]
            for n, lines, coordinate in zip(cell, TARGET.lines, (x, v), strict=True)
        ]
        buffer[cell[0] * TARGET.areas.shape[1] + cell[1]] += amount * np.outer(*parts).ravel()
    return buffer, absorbed


@pytest.fixture(scope="module")
def some_targets():
    rng = np.random.default_rng(4)
    ends_of_paths, flags = ends(rng, 5)
    searches, first = TARGET.cell_searches, TARGET.first_positive
    targets = Targets.empty().extended(ends_of_paths[:2].copy(), flags[:2], searches, first)
    return rng, ends_of_paths, flags, targets.extended(ends_of_paths[2:].copy(), flags[2:], searches, first)


def test_groups_scatter_what_single_paths_do(some_targets):
    rng, ends_of_paths, flags, targets = some_targets
    assert len(targets.groups) == 6
    for cell in range(5):
        values, buffer, absorbed = rng.normal(size=POINTS), np.zeros((TARGET.areas.size, 16)), np.zeros(3)
        masses, ordered = np.empty(values.size * 3 + 1), np.empty((targets.most, 8))
        scatter_cell(values, NODES, cell, targets, buffer, absorbed, masses, ordered, BASIS)
        expected = one_by_one(values, ends_of_paths[cell], flags[cell])
        np.testing.assert_allclose(buffer, expected[0], rtol=0.0, atol=1e-13)
        np.testing.assert_allclose(absorbed, expected[1], rtol=0.0, atol=1e-14)


def test_groups_gather_the_transpose(some_targets):
    rng, ends_of_paths, flags, targets = some_targets
    function, exits = rng.normal(size=(TARGET.areas.size, 16)), rng.normal(size=3)
    for cell in range(5):
        values, gathered, ordered = np.empty(POINTS), np.empty(12 * 3 + 1), np.empty((targets.most, 8))
        gather_cell(function, exits, NODES, cell, targets, values, gathered, ordered, BASIS)
        masses = rng.normal(size=POINTS)
        buffer, absorbed = one_by_one(masses, ends_of_paths[cell], flags[cell])
        assert (masses * values).sum() == pytest.approx((buffer * function).sum() + absorbed @ exits, abs=1e-12)


def test_later_cells_take_the_spare_entries(some_targets):
    *_, ends_of_paths, flags, _ = some_targets
    searches, first = TARGET.cell_searches, TARGET.first_positive
    three_cells = Targets.empty().extended(ends_of_paths[:3].copy(), flags[:3], searches, first)
    four_cells = three_cells.extended(ends_of_paths[3:4].copy(), flags[3:4], searches, first)
    assert four_cells.coordinates is three_cells.coordinates
    at_once = Targets.empty().extended(ends_of_paths[:4].copy(), flags[:4], searches, first)
    assert four_cells.nbytes == at_once.nbytes
    for mine, other in zip(four_cells.columns(3, 4), at_once.columns(3, 4), strict=True):
        np.testing.assert_array_equal(mine, other)
