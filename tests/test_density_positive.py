"""The non-negative evolution: its clouds, its sign and its accuracy."""

import dataclasses
import math
import pathlib

import numpy as np
import pytest

from fpk_rocking import Start, WhiteNoise, load_scene
from fpk_rocking.density.chain import Chain, NodeResolution
from fpk_rocking.density.evolution import Evolution
from fpk_rocking.density.mesh import graded_lines
from fpk_rocking.density.nodes import Clouds, NodeMesh
from fpk_rocking.density.positive import _judge, solve_positive
from fpk_rocking.density.positive_start import NodeDeparture, cell_sizes, lattice
from fpk_rocking.density.start import Gaussian
from fpk_rocking.density.step import Dynamics

MAIN = load_scene(pathlib.Path(__file__).parents[1] / "cases" / "scenes" / "main.toml").white_equivalent()


@pytest.fixture(scope="module")
def main():
    return solve_positive(MAIN, cycles=20)


def test_nothing_is_negative_at_any_step(main, reference):
    truth = reference("main_white")
    assert main.negative_mass == 0.0
    for cycle in range(1, 21):
        assert main.bin_probabilities(cycle, truth["angle_edges"], truth["velocity_edges"]).min() >= 0.0
    values = main.at(10).cell_values(3)
    assert values.min() >= -1e-15 * values.max()  # rounding of the polynomials, where the density is 0


def test_mass_is_conserved_to_rounding(main):
    assert main.mass_defect < 1e-13
    assert 0.0 <= main.lost[-1] < 1e-9


def test_survival_is_that_of_an_independent_program(main, reference):
    """Within 1e-3, and beyond cycle 10 within 3.5 standard errors more: those of the reference are up to 5e-4 there."""
    truth, paths = (reference("main_white")[name][:21] for name in ("survival", "paths"))
    error = np.abs(main.survival - truth)
    sampling = np.sqrt(truth * (1.0 - truth) / paths)
    assert error[:11].max() < 1e-3
    assert np.all(error < 1e-3 + 3.5 * sampling)
    assert error[:11].max() < main.error_estimate < 1e-3


def test_binned_density_is_that_of_an_independent_program(main, reference):
    truth = reference("main_white")
    for cycle, probabilities in zip(truth["cycles"], truth["probabilities"], strict=True):
        ours = main.bin_probabilities(int(cycle), truth["angle_edges"], truth["velocity_edges"])
        assert np.abs(ours - probabilities).sum() < 0.007


def test_launch_layer_is_resolved_without_a_negative_weight(named_scene, reference):
    """Second scene: a start that ignores the layer at rest is off by 2e-3 and more at cycle 1, 6e-3 at cycle 2."""
    scene = named_scene("second").white_equivalent()
    evolution, truth = solve_positive(scene, cycles=4, tol=1e-2), reference("second_white")
    assert np.abs(evolution.survival - truth["survival"][:5]).max() < 1.5e-3
    assert evolution.negative_mass == 0.0


def test_step_is_a_markov_chain():
    chain = Chain(MAIN, NodeResolution(60, 40, 4), 3.2)
    rng = np.random.default_rng(1)
    for step in chain.half:
        matrix = step._onto
        sums = np.asarray(matrix.sum(axis=0)).ravel() + step._sinks.sum(axis=1)
        assert matrix.min() >= 0.0
        assert np.abs(sums - 1.0).max() < 1e-14
        masses = rng.random(len(chain.mesh.areas))
        after, sinks = step.apply(masses)
        assert after.min() >= 0.0
        assert after.sum() + sinks.sum() == pytest.approx(masses.sum(), rel=1e-14)


def moments(x, v, weights):
    mean = np.array([weights @ x, weights @ v]) / weights.sum()
    return mean, np.cov(x, v, aweights=weights, ddof=0)


def test_clouds_arrive_with_their_moments():
    """On each side of x = 0, in units of the cloud's standard deviations; hats alone would add up to a tenth."""
    mesh = NodeMesh.of(graded_lines(1.6, 360, 1.2), graded_lines(3.3, 180, 1.1))
    rng = np.random.default_rng(2)
    x, v = rng.uniform(-0.9, 0.9, 400), rng.uniform(-1.5, 1.5, 400)
    clouds = Clouds((x, v, np.where(x > 0, 1, -1)), 0.3, MAIN.period / 6, Dynamics.of(MAIN))
    step = clouds.onto(mesh)
    angle, velocity, side = mesh.points
    errors = []
    for row in np.flatnonzero(step._more < 1e-9):
        masses = step._onto[:, [row]].toarray().ravel()
        for way in (-1, 1):
            if np.count_nonzero(clouds.codes[row] == way) == len(clouds.weights):
                mean, covariance = moments(*clouds.states[row].T, clouds.weights)
                there, spread = moments(angle[side == way], velocity[side == way], masses[side == way])
                assert np.abs(there - mean).max() < 1e-13
                scale = np.sqrt(np.diag(covariance))
                errors.append(np.abs((spread - covariance) / np.outer(scale, scale)).max())
    assert len(errors) > 100
    assert np.max(errors) < 0.03
    assert np.mean(errors) < 0.002


def flight(steps):
    """Error in L2 of a Gaussian flight away from events on the mesh of so many steps, and of its covariance."""
    dynamics, duration = Dynamics((0.0, 1.0, 0.0), 0.006, 0.5, 10.0), 1.2 / steps
    start = Gaussian((2.0, -0.6), [[0.02, 0.003], [0.003, 0.03]])
    exact = start.after(dynamics, 0.0, 1.2, 1)
    cells = cell_sizes(dynamics.diffusion, duration)
    lines = [
        np.linspace(low, high, math.ceil((high - low) / cell) + 1)
        for low, high, cell in zip((0.05, -2.6), (4.5, 3.0), cells, strict=True)
    ]
    mesh = NodeMesh.of(*lines)
    points, masses = lattice(start, (1.0, 1.0))
    for k in range(steps):
        step = Clouds(points, k * duration, duration, dynamics).onto(mesh, spread=k == steps - 1)
        masses, _ = step.apply(masses)
        points = mesh.points
    x, v, _ = points
    truth = exact(x, v)
    error = math.sqrt(((masses / mesh.areas - truth) ** 2 @ mesh.areas) / (truth**2 @ mesh.areas))
    _, covariance = moments(x, v, masses)
    covariance += np.diag([np.diff(line)[0] ** 2 / 6.0 for line in lines])
    return error, np.abs(covariance / exact.covariance - 1.0).max()


@pytest.mark.slow
def test_gaussian_flight_keeps_its_covariance_and_converges():
    """Half the step takes 0.71 of the velocity cells and 0.35 of the angle's; second order in the former or better."""
    (coarse, moved), (fine, also) = flight(3), flight(6)
    assert max(moved, also) < 3e-4
    assert 2.0 * math.log2(coarse / fine) > 1.9
    assert fine < 0.01


def test_mirrored_scene_has_the_mirrored_solution():
    mirrored = dataclasses.replace(MAIN, forcing=dataclasses.replace(MAIN.forcing, phase=0.0))
    ours, theirs = (
        Chain(scene, NodeResolution(120, 60, 4), 3.2).evolve(3, NodeDeparture(Dynamics.of(scene), Start(), MAIN.period))
        for scene in (MAIN, mirrored)
    )
    assert ours.gone[-1, :2].min() > 1e-4
    assert theirs.gone[:, [1, 0]] == pytest.approx(ours.gone[:, :2], abs=1e-12)


@pytest.mark.slow
def test_wide_start_has_its_tails_overturned():
    start = Start(1.0, 0.0, ((0.09, 0.0), (0.0, 0.04)))
    evolution = solve_positive(dataclasses.replace(MAIN, start=start), cycles=1, tol=1e-2)
    tail = 0.5 * math.erfc((math.pi / 2 - 1.0) / math.sqrt(2.0 * 0.09))
    assert evolution.overturned[0, 1] == pytest.approx(tail, rel=1e-6)
    edges = np.linspace(-math.pi / 2, math.pi / 2, 3), np.linspace(-2.0, 2.0, 3)
    assert evolution.bin_probabilities(0, *edges).sum() == pytest.approx(1.0 - tail, rel=1e-6)


def test_result_is_saved_and_loaded(main, tmp_path):
    main.save(tmp_path / "positive.npz")
    loaded = Evolution.load(tmp_path / "positive.npz")
    assert loaded.settings == main.settings
    assert np.array_equal(
        loaded.at(3).bin_probabilities([-1, 0, 1], [-1, 0, 1]), main.at(3).bin_probabilities([-1, 0, 1], [-1, 0, 1])
    )


def test_progress_counts_all_solutions():
    seen = []
    scene = dataclasses.replace(MAIN, noise=WhiteNoise(0.05))
    solve_positive(scene, cycles=2, tol=1e-2, progress=lambda done, total: seen.append((done, total)))
    assert seen == [(1, 4), (2, 4), (3, 4), (4, 4)]


def test_what_is_not_resolved_is_refused_or_told(main):
    assert 1e-5 < main.settings["origin_mass"] < 1e-3
    with pytest.raises(ValueError, match="rattles at rest"):
        _judge(dataclasses.replace(main, settings=main.settings | {"origin_mass": 0.6}))
    with pytest.warns(RuntimeWarning, match=r"estimated error 2.0e-03 in survival \(tol 0.001\)"):
        _judge(dataclasses.replace(main, error_estimate=2e-3))


@pytest.mark.parametrize(
    ("change", "arguments", "message"),
    [
        ({}, {"cycles": 0}, "cycles"),
        ({}, {"cycles": 1, "tol": 1e-5}, "tol"),
        ({"noise": WhiteNoise(1e-5)}, {"cycles": 1}, "noise: got 'white noise of D = 1e-05', accepted: .* nodes"),
        ({"noise": WhiteNoise(0.0)}, {"cycles": 1}, "noise"),
    ],
)
def test_unacceptable_input_is_refused(change, arguments, message):
    with pytest.raises(ValueError, match=message):
        solve_positive(dataclasses.replace(MAIN, **change), **arguments)
