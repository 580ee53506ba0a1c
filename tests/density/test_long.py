"""Five hundred cycles: nothing is lost count of, and the sampled step does not amplify where noise is weakest."""

import dataclasses
import math

import numpy as np
import pytest

from fpk_rocking import solve_fpk
from fpk_rocking.density.patches import Gaussian
from fpk_rocking.density.space import Space, graded_lines, velocity_bound
from fpk_rocking.density.step.dynamics import Dynamics
from fpk_rocking.density.step.step import Characteristics, Quadrature, Step
from fpk_rocking.scene import WhiteNoise

CYCLES = 500

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("name", ["main", "second"])
def test_everything_is_accounted_for_after_500_cycles(name, named_scene):
    evolution = solve_fpk(named_scene(name).white_equivalent(), cycles=CYCLES, tol=1e-2)
    balance = evolution.survival + evolution.overturned.sum(axis=1) + evolution.truncated
    assert np.abs(balance - 1.0).max() <= 1e-12
    assert evolution.overturned[-1].sum() > 0.99
    assert np.all(np.diff(evolution.overturned, axis=0) > -1e-12)


def turned(coefficients):
    """Mirror image, (x, v) -> (-x, -v)."""
    signs = (-1.0) ** np.arange(coefficients.shape[-1])
    return np.ascontiguousarray(coefficients[::-1, ::-1]) * np.outer(signs, signs)


@pytest.mark.parametrize(
    ("cells", "cycles", "rise", "worst"), [((64, 112), CYCLES, 0.0, 0.13), ((128, 224), 60, 5e-6, 0.06)]
)
def test_weakest_noise_is_stable(cells, cycles, rise, worst, main_scene):
    """Main scene at D = 2.5e-5 on the mesh of the loosest tolerance, and for 500 cycles on one with half the cells.

    The filaments are not resolved, 5 % and 11 % of the mass are negative; but that and the L2 norm stay as they are.
    Escape is below what the projection makes of it: a loss of 4e-4 a cycle on the coarse mesh, a gain of 3e-6 on the
    fine one. (On 32 x 56 cells the norm grows by 0.2 % a cycle.)
    """
    scene = dataclasses.replace(main_scene, noise=WhiteNoise(2.5e-5))
    dynamics, duration = Dynamics.of(scene), scene.period / 12
    bound = velocity_bound(scene, dynamics.diffusion)
    space = Space(graded_lines(scene.overturning.angle, cells[0], 1.5), graded_lines(bound, cells[1], 1.3), 3)
    steps = [
        Step(Characteristics(space, k * duration, duration, dynamics, Quadrature(5, 5, 5, 2)), space) for k in range(6)
    ]
    density, out = space.project(Gaussian((0.3, -0.2), [[0.01, 0.0], [0.0, 0.02]]), 8), 0.0
    start, inside, basis, negative = space.masses(density).sum(), [], [], []
    for k in range(2 * cycles):
        for step in steps:
            density, sinks = step.apply(density)
            out += sinks.sum()
        density = turned(density)
        inside.append(space.masses(density).sum())
        basis.append(math.sqrt(np.einsum("xvab,xvab,xv->", density, density, space.areas)))
        if k % 20 == 19:
            negative.append(space.negative_mass(density, 5))
        assert abs(inside[-1] + out - start) < 1e-12
    inside, basis = np.array(inside), np.array(basis)
    late = slice(60, None)
    assert np.all((inside > 0.0) & (inside < start))
    assert np.diff(inside[late]).max() < rise
    assert basis[late].max() < 1.02 * basis[late][0]
    assert max(negative) < worst
