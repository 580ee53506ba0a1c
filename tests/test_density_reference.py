"""The density solver on both white scenes against an independent program (tests/data), and the law of impact."""

import pathlib

import numpy as np
import pytest
from numpy.polynomial import legendre

from fpk_rocking import load_scene, solve_fpk

ROOT = pathlib.Path(__file__).parents[1]


def solved(name, cycles):
    scene = load_scene(ROOT / "cases" / "scenes" / f"{name}.toml").white_equivalent()
    return solve_fpk(scene, cycles=cycles), np.load(ROOT / "tests" / "data" / f"{name}_white.npz")


@pytest.fixture(scope="module")
def main():
    return solved("main", 40)


@pytest.fixture(scope="module")
def second():
    return solved("second", 10)


@pytest.mark.parametrize("which", ["main", "second"])
def test_survival_is_that_of_an_independent_program(which, request):
    evolution, reference = request.getfixturevalue(which)
    assert np.abs(evolution.survival - reference["survival"][: evolution.cycles + 1]).max() < 2e-3


@pytest.mark.parametrize("which", ["main", "second"])
def test_binned_density_is_that_of_an_independent_program(which, request):
    evolution, reference = request.getfixturevalue(which)
    edges = reference["angle_edges"], reference["velocity_edges"]
    for cycle, truth in zip(reference["cycles"], reference["probabilities"], strict=True):
        assert np.abs(evolution.bin_probabilities(int(cycle), *edges) - truth).sum() < 0.02


@pytest.mark.parametrize("which", ["main", "second"])
def test_result_is_honest_about_itself(which, request):
    evolution, _ = request.getfixturevalue(which)
    assert evolution.mass_defect < 1e-12
    assert np.abs(evolution.lost).max() < 1e-6
    assert 0.0 < evolution.negative_mass < 5e-3
    assert 0.0 < evolution.error_estimate < 1e-2


def test_escape_rate_is_that_of_an_independent_program(main):
    evolution, reference = main
    cycles = np.arange(20, 41)
    rates = [
        -np.polyfit(cycles, np.log(survival[20:41]), 1)[0] for survival in (evolution.survival, reference["survival"])
    ]
    assert rates[0] == pytest.approx(rates[1], rel=0.02)


@pytest.mark.parametrize("power", [1, 2, 3])
def test_impact_keeps_flux_and_scales_velocity(main, power):
    """p(0+, v) = e^-2 p(0-, v/e): the moments of |v| on both sides of x = 0 have the ratio e^(power - 1).

    The density changes there within x ~ v^2/11, less than a cell, so its one-sided values are good to a tenth only.
    """
    evolution, _ = main
    restitution, (nodes, weights) = evolution.scene.block.restitution, legendre.leggauss(4)
    for cycle in (2, 10):
        density, moments = evolution.at(cycle), {}
        velocity = density.mesh_lines[1]
        speeds = velocity[velocity >= 0.0]
        speed = 0.5 * (speeds[1:] + speeds[:-1])[:, None] + 0.5 * np.diff(speeds)[:, None] * nodes
        parts = 0.5 * np.diff(speeds)[:, None] * weights * speed**power
        for side in (1, -1):
            for way in (1, -1):
                moments[side, way] = np.sum(parts * density(side * 1e-13, way * speed))
        for way in (1, -1):
            assert moments[way, way] / moments[-way, way] == pytest.approx(restitution ** (power - 1), rel=0.2)
