"""What decides about a flight by its polynomial, against numpy's polynomials."""

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from fpk_rocking.physics.motion import TERMS
from fpk_rocking.physics.motion.collocation import NODES, divide_by_time_since_start, surely_rises
from fpk_rocking.physics.motion.equation import KernelBlock

BLOCK = KernelBlock(0.9, 2.0, 0.3)


def test_a_flight_surely_rises_whose_acceleration_grows_from_0_whatever_the_signs_of_its_terms():
    rng, times, angle, seen = np.random.default_rng(1), np.linspace(-1.0, 1.0, 41), np.zeros(TERMS), set()
    for _ in range(400):
        angle[2 : NODES + 2] = rng.normal(size=NODES) * np.where(np.arange(NODES) < 2, 1.0, 0.004)
        begin = rng.choice([-1e-3, 1e-3])
        angle[2] += 0.5 * (begin - Polynomial(angle).deriv(2)(-1.0))
        jerk, *others = Polynomial(angle).deriv(3).coef
        grows, sure = np.diff(Polynomial(angle).deriv(2)(times)).min() > 0.0, jerk > np.abs(others).sum()
        assert surely_rises.py_func(0.0, 0.5, angle, 1.0, 0.5, BLOCK) == (sure and begin > 0.0)
        assert grows or not sure
        seen.add((sure, grows))
    assert seen == {(True, True), (False, True), (False, False)}


def test_a_flight_surely_rises_from_x_0_only_without_a_fall_and_below_the_cut_off():
    angle = np.zeros(TERMS)
    angle[2:4] = 3.0, 1.0  # u'' is 0 at the begin
    assert surely_rises.py_func(0.0, 0.0, angle, 1.0, 0.999, BLOCK)
    for u, w, fall in ((1e-9, 0.5, 0.5), (0.0, -1e-9, 0.5), (0.0, 0.5, 1.0)):
        assert not surely_rises.py_func(u, w, angle, 1.0, fall, BLOCK)


def test_a_polynomial_is_divided_by_the_time_since_the_begin():
    expected = np.append(np.random.default_rng(2).normal(size=TERMS - 1), 0.0)
    divided = np.empty(TERMS)
    divide_by_time_since_start.py_func((Polynomial(expected) * Polynomial([1.0, 1.0])).coef[:TERMS], divided)
    assert divided == pytest.approx(expected, abs=1e-12)
