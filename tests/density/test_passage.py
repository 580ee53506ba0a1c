"""First passage of the cut-off: counted within the step, and where the bounded motion itself comes near it."""

import dataclasses
import math

import numpy as np
import pytest
from density_operators import affine, flight_noise

from fpk_rocking import solve_fpk
from fpk_rocking.density.patches import Gaussian
from fpk_rocking.density.space import Space
from fpk_rocking.density.step.dynamics import Dynamics
from fpk_rocking.density.step.step import Characteristics, Quadrature, Step
from fpk_rocking.physics.motion.equation import KernelBlock
from fpk_rocking.scene import Harmonic, Overturning
from montecarlo import simulate

MEAN, SPREAD = np.array([1.36, 0.4]), np.array([0.02, 0.1])


def paths_over(dynamics, start, duration, paths, pieces, seed):
    """Parts of white-noise paths on the side x > 0 that start below the cut-off and pass it, or end beyond it."""
    rng = np.random.default_rng(seed)
    state = MEAN[:, None] + SPREAD[:, None] * rng.normal(size=(2, paths))
    state = state[:, state[0] < dynamics.block.cutoff]
    passed, short = np.zeros(state.shape[1], bool), duration / pieces
    root = np.linalg.cholesky(flight_noise(dynamics, short))
    for k in range(pieces):
        matrix, shift = affine(dynamics, start + k * short, short, 1)
        after = matrix @ state + shift[:, None] + root @ rng.normal(size=state.shape)
        # Half a piece at a quarter of the lower speed: the rise of a parabola that turns within the piece.
        rise = np.where((state[1] > 0.0) & (after[1] < 0.0), np.minimum(state[1], -after[1]) * short / 8.0, 0.0)
        passed |= np.maximum(state[0], after[0]) + rise >= dynamics.block.cutoff
        state = after
    return passed.sum() / paths, (state[0] >= dynamics.block.cutoff).sum() / paths


@pytest.mark.parametrize("steps", [8, 16])
def test_paths_that_pass_the_cutoff_and_return_within_a_step_have_overturned(steps):
    """One step of a Gaussian that turns back at the cut-off 1.4, against 100,000 paths of 32 pieces; false alarm 6e-5.

    At 8 steps a cycle nearly all that overturn are back below the cut-off when the step ends.
    """
    period, paths = 2.0 * math.pi / 2.7, 100_000
    dynamics, duration = Dynamics(Harmonic(4.6, 2.7, math.pi), 0.00628, KernelBlock(0.5, 1.4)), period / steps
    start = 0.5 * (period - duration)
    window = Space(np.linspace(1.2, 1.4, 17), np.linspace(-0.4, 1.2, 33), 3)
    density = window.project(Gaussian(MEAN, np.diag(SPREAD**2)), 8)
    trace = Characteristics(window, start, duration, dynamics, Quadrature(6, 6, 5, 2), to_other_mesh=True)
    _, sinks = Step(trace, Space(np.linspace(0.0, 1.4, 20), np.linspace(-4.0, 4.0, 33), 3)).apply(density)
    passed, beyond = paths_over(dynamics, start, duration, paths, 32, seed=3)
    error = math.sqrt(passed * (1.0 - passed) / paths)
    assert passed - beyond > 20.0 * error
    assert abs(sinks[1] - passed) < 4.0 * error
    assert sinks[[0, 2]] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("side", [1, -1])
def test_what_passes_the_cutoff_for_good_is_exact(side):
    """One step of a Gaussian that leaves: a normal probability, to what the mesh resolves of the Gaussian.

    By points it would be the mass of those that land beyond the cut-off, off by 1e-3 with five of them an axis.
    """
    dynamics, duration = Dynamics(Harmonic(0.5, 2.7, math.pi), 0.00628, KernelBlock(0.5, 1.2)), 0.1
    mean, covariance = side * np.array([1.05, 1.5]), np.diag([0.04**2, 0.1**2])
    lines = np.sort(side * np.linspace(0.8, 1.2, 25)), np.sort(side * np.linspace(0.8, 2.2, 41))
    space = Space(*lines, 3)
    density = space.project(Gaussian(mean, covariance), 12)
    after, sinks = Step(Characteristics(space, 0.0, duration, dynamics, Quadrature(2, 2, 3, 2)), space).apply(density)
    matrix, shift = affine(dynamics, 0.0, duration, side)
    spread = (matrix @ covariance @ matrix.T + flight_noise(dynamics, duration))[0, 0]
    ends = (1.05, 0.04), (side * (matrix @ mean + shift)[0], math.sqrt(spread))
    beyond, passed = (0.5 * math.erfc((1.2 - mid) / (math.sqrt(2.0) * wide)) for mid, wide in ends)
    expected = passed - beyond  # what starts beyond it is not on the mesh
    assert 0.3 < expected < 0.7
    assert sinks[(1 + side) // 2] == pytest.approx(expected, abs=2e-7)
    assert space.masses(after).sum() + sinks.sum() == pytest.approx(space.masses(density).sum(), abs=1e-13)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["main", "second"])
def test_first_passage_of_a_near_cutoff_agrees_with_paths(name, named_scene):
    """Cut-off 1.4: overturned to each side by each of 4 cycles, against 40,000 paths of the white-noise engine.

    4 standard errors, false alarm 8 x 6e-5; with the cut-off at pi/2 the same scene is far outside them.
    """
    scene, paths = named_scene(name).white_equivalent(), 40_000
    near = dataclasses.replace(scene, overturning=Overturning(1.4))
    evolution, ensemble = solve_fpk(near, cycles=4), simulate(near, cycles=4, realizations=paths, seed=5)
    expected = evolution.overturned[1:]
    error = np.sqrt(np.maximum(expected * (1.0 - expected), 1.0 / paths) / paths)
    assert np.abs((ensemble.overturned[1:] - expected) / error).max() < 4.0
    far = solve_fpk(scene, cycles=4, tol=1e-2)
    assert np.abs((far.overturned[1:] - ensemble.overturned[1:]) / error).max() > 8.0
