"""Eight numbers at once against numpy."""

import numba
import numpy as np
import pytest

from fpk_rocking.base.arrays import WIDTH, load, spread, store, total


@numba.njit
def _worked(table, number, out):
    first, second = load(table, 0), load(table, 2)
    store(out, 0, first + second)
    store(out, 1, first - second)
    store(out, 2, first * second)
    store(out, 3, number - first * number)
    store(out, 4, spread(second, 5) * first)
    return total(first)


def test_arithmetic_is_that_of_numbers():
    table, out = np.random.default_rng(3).normal(size=(3, WIDTH + 4)), np.full((5, WIDTH), np.nan)
    lanes = _worked(table, 1.7, out)
    first, second = table[0, :WIDTH], table[2, :WIDTH]
    wanted = [first + second, first - second, first * second, 1.7 - first * 1.7, second[5] * first]
    assert out == pytest.approx(np.array(wanted), rel=1e-15, abs=1e-15)
    assert lanes == pytest.approx(first.sum(), rel=1e-14)
