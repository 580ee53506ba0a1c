"""Landed paths in groups of eight against the same paths one by one."""

import numpy as np
import pytest

from fpk_rocking.base.basis import legendre_basis
from fpk_rocking.density.space.space import Space
from fpk_rocking.density.step.landed import Landed, collect_landed, deposit_landed
from fpk_rocking.density.step.noise_paths import OVERTURNED_SIDE

TARGET = Space(np.array([-1.0, -0.4, 0.0, 0.3, 1.0]), np.array([-1.0, -0.2, 0.5, 1.0]), 3)
POINTS, NODES = (3, 4), np.array([0.2, 0.5, 0.3])
BASIS = (1.0,) * 4


def ends(rng, cells):
    """Ends of the paths of some cells, of which some overturn; where these are is not a number."""
    shape = (cells, *POINTS, len(NODES))
    states = rng.uniform(-1.3, 1.3, (*shape, 2)) * [0.7, 0.8]
    codes = np.where(states[..., 0] < 0.0, -1, 1).astype(np.int32)
    codes[0] = OVERTURNED_SIDE
    codes[1:, 0] = -OVERTURNED_SIDE
    states[np.abs(codes) == OVERTURNED_SIDE] = np.nan
    return states, codes


def one_by_one(values, states, codes):
    """Unknowns (cells, modes²) of the target and sinks (3,), by numpy's searches and the space's own polynomials."""
    buffer, sinks = np.zeros((TARGET.areas.size, 16)), np.zeros(3)
    for place in np.ndindex(codes.shape):
        amount, (x, v) = values[place[:2]] * NODES[place[2]], states[place]
        if abs(codes[place]) == OVERTURNED_SIDE:
            sinks[0 if codes[place] < 0 else 1] += amount
            continue
        found = [np.searchsorted(lines, one, side="right") - 1 for lines, one in zip(TARGET.lines, (x, v), strict=True)]
        if not all(0 <= n < len(lines) - 1 for n, lines in zip(found, TARGET.lines, strict=True)):
            sinks[2] += amount
            continue
        parts = [
            legendre_basis(np.array([(one - lines[n]) / (lines[n + 1] - lines[n])]), 3)[0]
            for n, lines, one in zip(found, TARGET.lines, (x, v), strict=True)
        ]
        buffer[found[0] * TARGET.areas.shape[1] + found[1]] += amount * np.outer(*parts).ravel()
    return buffer, sinks


@pytest.fixture(scope="module")
def landed_paths():
    rng = np.random.default_rng(4)
    states, codes = ends(rng, 5)
    grids, first = TARGET.tables, TARGET.first_positive
    landed = Landed.nothing().joined(states[:2].copy(), codes[:2], grids, first)
    return rng, states, codes, landed.joined(states[2:].copy(), codes[2:], grids, first)


def test_groups_deposit_what_single_paths_do(landed_paths):
    rng, states, codes, landed = landed_paths
    assert landed.cells == 5
    for cell in range(5):
        values, buffer, sinks = rng.normal(size=POINTS), np.zeros((TARGET.areas.size, 16)), np.zeros(3)
        masses, ordered = np.empty(values.size * 3 + 1), np.empty((landed.most, 8))
        deposit_landed(values, NODES, cell, landed, buffer, sinks, masses, ordered, BASIS)
        expected = one_by_one(values, states[cell], codes[cell])
        np.testing.assert_allclose(buffer, expected[0], rtol=0.0, atol=1e-13)
        np.testing.assert_allclose(sinks, expected[1], rtol=0.0, atol=1e-14)


def test_groups_collect_the_transpose(landed_paths):
    rng, states, codes, landed = landed_paths
    function, exits = rng.normal(size=(TARGET.areas.size, 16)), rng.normal(size=3)
    for cell in range(5):
        values, found, ordered = np.empty(POINTS), np.empty(12 * 3 + 1), np.empty((landed.most, 8))
        collect_landed(function, exits, NODES, cell, landed, values, found, ordered, BASIS)
        masses = rng.normal(size=POINTS)
        buffer, sinks = one_by_one(masses, states[cell], codes[cell])
        assert (masses * values).sum() == pytest.approx((buffer * function).sum() + sinks @ exits, abs=1e-12)


def test_later_cells_take_the_room_that_is_left(landed_paths):
    *_, states, codes, _ = landed_paths
    grids, first = TARGET.tables, TARGET.first_positive
    one = Landed.nothing().joined(states[:3].copy(), codes[:3], grids, first)
    more = one.joined(states[3:4].copy(), codes[3:4], grids, first)
    assert more.points is one.points
    whole = Landed.nothing().joined(states[:4].copy(), codes[:4], grids, first)
    assert more.memory == whole.memory
    for mine, other in zip(more.reach(3, 4), whole.reach(3, 4), strict=True):
        np.testing.assert_array_equal(mine, other)
