"""The density solver on both white scenes against an independent program (tests/data)."""

import numpy as np
import pytest

from fpk_rocking import solve_fpk
from fpk_rocking.density.resolution import bins_tolerance


@pytest.fixture(scope="module")
def main(named_scene, reference):
    return solve_fpk(named_scene("main").white_equivalent(), cycles=40), reference("main_white")


@pytest.fixture(scope="module")
def second(named_scene, reference):
    return solve_fpk(named_scene("second").white_equivalent(), cycles=10), reference("second_white")


@pytest.mark.parametrize("which", ["main", "second"])
def test_survival_is_that_of_an_independent_program(which, request):
    """Within the own estimate, the program's 3e-4 and 4.5 standard errors of its paths; false alarm 3e-4 a scene."""
    evolution, reference = request.getfixturevalue(which)
    truth, paths = (reference[name][: evolution.cycles + 1] for name in ("survival", "paths"))
    sampling = 4.5 * np.sqrt(truth * (1.0 - truth) / paths) + 3e-4
    assert np.all(np.abs(evolution.survival - truth) <= evolution.error_estimate + sampling)


@pytest.mark.parametrize("which", ["main", "second"])
def test_binned_density_is_that_of_an_independent_program(which, request):
    """Its distance (L1) is that of sampling, sqrt(2p/πn) a bin and 10 % of scatter, and half of the own estimate."""
    evolution, reference = request.getfixturevalue(which)
    edges = reference["angle_edges"], reference["velocity_edges"]
    for cycle, truth in zip(reference["cycles"], reference["probabilities"], strict=True):
        floor = np.sqrt(2.0 / np.pi * truth / reference["paths"][cycle]).sum()
        distance = np.abs(evolution.bin_probabilities(int(cycle), *edges) - truth).sum()
        assert distance <= 1.1 * floor + 0.5 * evolution.bins_error_estimate


@pytest.mark.parametrize("which", ["main", "second"])
def test_result_is_honest_about_itself(which, request):
    evolution, _ = request.getfixturevalue(which)
    assert evolution.mass_defect < 1e-12
    assert np.abs(evolution.truncated).max() < 1e-6
    assert 0.0 < evolution.negative_mass < 2e-3
    assert 1e-4 < evolution.error_estimate <= evolution.tol == 1e-3
    assert 1e-3 < evolution.bins_error_estimate <= bins_tolerance(1e-3)


def test_escape_rate_is_that_of_an_independent_program(main):
    evolution, reference = main
    cycles = np.arange(20, 41)
    rates = [
        -np.polyfit(cycles, np.log(survival[20:41]), 1)[0] for survival in (evolution.survival, reference["survival"])
    ]
    assert rates[0] == pytest.approx(rates[1], rel=0.02)
