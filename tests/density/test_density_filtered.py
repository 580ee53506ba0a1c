"""The density under filtered noise: steps and their mirror image, rest, limits, refusals, and sampled paths."""

import dataclasses
import math

import filter_formulas as formulas
import numpy as np
import pytest
from filtered_grids import EDGES, MAIN, SCENES, grid_of
from scipy import integrate

from fpk_rocking import (
    Block,
    CloughPenzien,
    CycleOperator,
    FilteredNoise,
    Harmonic,
    LinearFilter,
    Overturning,
    Scene,
    Start,
    WhiteNoise,
    load_scene,
    solve_fpk,
)
from fpk_rocking.density import solver
from fpk_rocking.density.density import Density
from fpk_rocking.density.filter_nodes import FilteredDiscretization, Nodes, filtered_discretization
from fpk_rocking.density.filtered import FilteredPropagator
from fpk_rocking.density.resolution import RESOLUTIONS, explore
from fpk_rocking.density.space import velocity_bound
from fpk_rocking.density.startup import FilteredStart
from montecarlo import simulate

NOISES = (
    FilteredNoise("exponential", 0.03, 2.0),
    FilteredNoise("low-pass", 0.04, 6.0, 0.7),
    FilteredNoise("kanai-tajimi", 0.05, 4.0, 0.5),
)


KINDS = pytest.mark.parametrize("noise", NOISES, ids=lambda noise: noise.filter)


@KINDS
def test_a_flight_has_the_covariance_of_its_noise(noise):
    scene, time = MAIN.varied(noise=noise), 0.7
    run = FilteredPropagator(scene, grid_of(scene, 0, (3, 3), 8), 1e-9)
    flight = FilteredStart(scene, run.nodes, run.steps[0][0].characteristics.dynamics)
    _, covariance = flight.at(time)
    for i, j, kernels in ((0, 0, (np.sinh, np.sinh)), (0, 1, (np.sinh, np.cosh)), (1, 1, (np.cosh, np.cosh))):
        integral = integrate.dblquad(
            lambda s, t, first=kernels[0], second=kernels[1]: (
                first(time - s) * second(time - t) * formulas.autocovariance(noise, s - t)
            ),
            0.0,
            time,
            0.0,
            time,
            epsabs=1e-6,
        )[0]
        assert covariance[i, j] == pytest.approx(integral, rel=1e-4)
    assert covariance[2:, 2:] == pytest.approx(np.eye(len(covariance) - 2), abs=1e-12)


@pytest.mark.parametrize(
    ("noise", "nodes"),
    [(MAIN.noise, (8,)), *(pytest.param(noise, (6, 6), marks=pytest.mark.slow) for noise in NOISES[1:3])],
    ids=lambda part: str(part)[:30],
)
def test_survival_and_bins_are_those_of_sampled_paths(noise, nodes):
    """One false alarm in a thousand or fewer: 3.5 standard errors at four cycles, and a tolerance of the mesh."""
    scene, paths, cycles = MAIN.varied(noise=noise), 40_000, 4
    run = FilteredPropagator(scene, grid_of(scene, 1, nodes, 12), 1e-8)
    solution = run.propagate(scene.period * np.arange(cycles + 1))
    sample = simulate(scene, cycles=cycles, realizations=paths, seed=3)
    error = np.sqrt(sample.survival * (1.0 - sample.survival) / paths)
    assert np.all(np.abs(solution.survival - sample.survival) <= 3.5 * error + 3e-3)
    assert np.abs(solution.survival + solution.outflow.sum(axis=1) - 1.0).max() < 1e-12
    assert np.abs(solution.outflow[:, 2]).max() < 1e-5
    bins, sampled = (
        run.space.bin_integrals(solution.coefficients, *EDGES)[cycles],
        sample.bin_probabilities(cycles, *EDGES),
    )
    floor = np.sqrt(2.0 / math.pi * sampled / paths).sum()
    assert np.abs(bins - sampled).sum() < 1.3 * floor + 0.01


@pytest.mark.slow
def test_fast_noise_is_white_noise():
    """At a fixed diffusion the difference from white noise falls with the correlation time, in first order."""
    white = MAIN.varied(noise=WhiteNoise(0.00628))
    white_survival = solve_fpk(white, cycles=4, tol=1e-2).survival[4]
    differences, frequencies = [], np.array([5.0, 10.0, 1000.0])
    for frequency in frequencies:
        variance = 0.00628 * (1.0 + frequency) ** 2 / (2.0 + frequency)
        scene = MAIN.varied(noise=FilteredNoise("exponential", variance, frequency))
        assert scene.white_equivalent().noise.diffusion == pytest.approx(0.00628)
        run = FilteredPropagator(scene, grid_of(scene, 2, (6,), 16), 1e-8)
        differences.append(run.propagate(scene.period * np.arange(5)).survival[4] - white_survival)
    assert abs(differences[2]) < 1.5e-3
    first, second = np.array(differences[:2]) - differences[2]
    assert first > second > 0.5e-3


def test_slow_noise_is_a_mixture_over_constant_forces():
    """A noise that hardly changes: each node moves as under its own constant force."""
    start = Start(0.0, 0.0, ((0.01, 0.0), (0.0, 0.01)))
    scene = MAIN.varied(noise=FilteredNoise("exponential", 0.04, 1e-3), start=start)
    density = (
        FilteredPropagator(scene, grid_of(scene, 1, (16,), 12), 1e-8).propagate(scene.period * np.arange(3)).survival[2]
    )
    sample = simulate(scene, cycles=2, realizations=20_000, seed=5).survival[2]
    assert density == pytest.approx(sample, abs=3.5 * math.sqrt(sample * (1.0 - sample) / 20_000) + 0.01)


def test_noise_too_slow_for_its_start_is_refused_before_the_work(monkeypatch):
    """It was solved for minutes before, wrong by .03 and more, and refused in the end for its negative mass."""
    scene = Scene(Block(0.6), Harmonic(3.0, 2.7, math.pi), FilteredNoise("exponential", 0.03, 0.1))
    monkeypatch.setattr(solver, "explore", lambda *_: 1 / 0)
    with pytest.raises(ValueError, match=r"noise.frequency: got 0.1, accepted: at least about 0.17 .* Monte Carlo"):
        solve_fpk(scene, cycles=1)
    with pytest.raises(ValueError, match=r"noise.frequency: got 0.001, accepted: at least about 0.17 "):
        solve_fpk(scene.varied(noise=FilteredNoise("exponential", 0.03, 1e-3)), cycles=1)
    wide = Start(0.0, 0.0, ((0.01, 0.0), (0.0, 0.01)))
    smooth = scene.varied(noise=FilteredNoise("low-pass", 0.03, 1.5, 0.7))
    with pytest.raises(ValueError, match=r"noise.frequency: got 1.5, accepted: at least about 1.6 "):
        solve_fpk(smooth, cycles=1)
    some = Start(0.0, 0.0, ((0.002, 0.0), (0.0, 0.002)))  # enough of a spread beside weak noise
    for variance, least in ((0.03, 0.094), (0.12, 0.15)):
        slow = scene.varied(noise=FilteredNoise("exponential", variance, 0.05), start=some)
        with pytest.raises(ValueError, match=rf"noise.frequency: got 0.05, accepted: at least about {least} "):
            solve_fpk(slow, cycles=1)
    for answered in (scene.varied(noise=FilteredNoise("exponential", 0.03, 0.2)), scene.varied(start=wide)):
        with pytest.raises(ZeroDivisionError):
            solve_fpk(answered, cycles=1)


def test_a_filter_of_more_states_is_refused_before_the_work(monkeypatch):
    scene = MAIN.varied(noise=FilteredNoise(CloughPenzien(15.0, 0.6, 1.5, 0.6), 0.04))
    monkeypatch.setattr(solver, "explore", lambda *_: 1 / 0)
    refused = r"noise\.filter: got Clough-Penzien noise.* \(4 states\), accepted: filters of up to 2 states.*simulate"
    with pytest.raises(ValueError, match=refused):
        solve_fpk(scene, cycles=1)
    with pytest.raises(ValueError, match=r"noise\.kind: got 'filtered'.* up to 2 states, and scene\.white_equivalent"):
        CycleOperator(scene)


def test_a_filter_of_ones_own_is_solved_as_the_named_one_is():
    """The low-pass filter by other states, which depend on each other: the same nodes and the same refusal."""
    named, states = NOISES[1], np.array([[1.0, 0.5], [0.3, 2.0]])
    drift = states @ np.array([[0.0, 1.0], [-36.0, -8.4]]) @ np.linalg.inv(states)
    output = np.linalg.inv(states)[0]
    own = FilteredNoise(LinearFilter(drift.tolist(), states[:, 1].tolist(), output.tolist()), 0.04)
    ours, theirs = Nodes(own, (5, 5)), Nodes(named, (5, 5))
    assert ours.transition_matrix(0.2) @ theirs.weights.ravel() == pytest.approx(theirs.weights.ravel(), abs=1e-12)
    eta = np.repeat(theirs.values, 5)
    for step in (0.02, 0.3):
        assert ours.piecewise_constant_factor(step) == pytest.approx(theirs.piecewise_constant_factor(step), rel=1e-12)
        covariance, named_covariance = (
            eta @ nodes.transition_matrix(step) @ (eta * theirs.weights.ravel()) for nodes in (ours, theirs)
        )
        assert covariance == pytest.approx(named_covariance, rel=1e-10)
    slow = MAIN.varied(noise=own.scaled(1.0, 0.05))
    with pytest.raises(ValueError, match=r"noise\.filter: got .*at least about .* times as fast"):
        solve_fpk(slow, cycles=1)


@pytest.mark.slow
def test_noise_that_is_not_refused_as_slow_is_answered():
    """One false alarm in a thousand or fewer: 3.5 standard errors at two cycles, and the tolerance."""
    scene, paths = (
        MAIN.varied(forcing=Harmonic(3.0, 2.7, math.pi), noise=FilteredNoise("exponential", 0.03, 0.4)),
        40_000,
    )
    density = solve_fpk(scene, cycles=2, tol=1e-2, bins_tol=math.inf)
    sample = simulate(scene, cycles=2, realizations=paths, seed=4)
    error = np.sqrt(sample.survival * (1.0 - sample.survival) / paths)
    assert np.all(np.abs(density.survival - sample.survival) <= 3.5 * error + 1e-2)
    assert density.error_estimate <= 1e-2


def test_a_band_may_be_solved_as_filtered_noise(monkeypatch):
    band = load_scene(SCENES / "main.toml")
    seen = []
    monkeypatch.setattr(FilteredPropagator, "__init__", lambda _, scene, *__: seen.append(scene.noise) or 1 / 0)
    with pytest.raises(ZeroDivisionError):
        solve_fpk(band, cycles=1, tol=1e-2, noise_replacement="filtered")
    assert seen == [band.filtered_equivalent().noise]
    with pytest.raises(
        ValueError, match="noise_replacement: got 'pink', accepted: 'white', 'exponential', 'filtered' or 'auto'"
    ):
        solve_fpk(band, cycles=1, noise_replacement="pink")


def test_memory_is_known_before_the_work():
    scene = MAIN.varied(noise=NOISES[1])
    grid = filtered_discretization(scene, grid_of(scene, 1, (1,), 4).plane, 1)
    run = FilteredPropagator(scene, grid, 1e-8)
    run.propagate(run.scene.period * np.arange(2))
    assert 0.2 < run.memory / grid.memory < 1.1
    with pytest.raises(ValueError, match=r"scene: got a mesh .* bytes, accepted: up to 4e\+09"):
        solve_fpk(scene.varied(noise=FilteredNoise("low-pass", 0.04, 3000.0, 0.01)), cycles=1)


def plane_of(scene):
    white, times = scene.white_equivalent(), scene.period * np.arange(3)
    return RESOLUTIONS[0].adapted(white, velocity_bound(white, white.noise.diffusion), explore(white, times))


@pytest.mark.parametrize("noise", [FilteredNoise("low-pass", 0.04, 1.5, 0.7), FilteredNoise("exponential", 0.04, 1.0)])
def test_half_a_cycle_and_its_mirror_image_are_a_cycle(noise):
    """Steps of half a cycle used twice, or of a whole one: the same to rounding, and what rests at each node too."""
    scene = Scene(Block(0.5), Harmonic(0.9, 2.0, 0.4), noise)
    plane, solutions = plane_of(scene), []
    for periods in (2, 1):
        grid = FilteredDiscretization(plane, (5, 3), 3, np.linspace(0.0, 1.0 / periods, 8 // periods + 1))
        run = FilteredPropagator(scene, grid, 1e-12)
        states = run.states(scene.period * np.arange(2), scene.start)
        rests = [(state.mirror_image() if state.reflected else state).at_rest for state in states]
        solutions.append((run.propagate(scene.period * np.arange(2)), np.array(rests)))
    (halves, rests), (wholes, rests_of_wholes) = solutions
    assert 0.1 < wholes.at_rest[1] < 0.9
    assert wholes.reinjected == 0.0  # what rests is an atom of its own, whose error the estimate has
    assert np.abs(rests_of_wholes - rests_of_wholes[:, ::-1, ::-1]).max() > 1e-3  # a mirror image is another state
    if rests_of_wholes.shape[2] > 1:
        assert np.abs(rests_of_wholes - rests_of_wholes[:, :, ::-1]).max() > 1e-3
    assert rests == pytest.approx(rests_of_wholes, abs=1e-10)
    assert halves.at_rest == pytest.approx(wholes.at_rest, abs=1e-10)
    assert halves.survival == pytest.approx(wholes.survival, abs=1e-10)


def test_piecewise_constant_noise_is_of_second_order_in_flight():
    """Variance of the velocity of a Gaussian far from all events, with steps that grow fivefold over the cycle.

    The mesh keeps it exactly, the step does not.
    """
    noise, start = FilteredNoise("exponential", 0.5, 3.0), Start(10.0, 0.0, ((0.25, 0.0), (0.0, 0.25)))
    scene = Scene(Block(0.5), Harmonic(0.0, 6.0), noise, start, Overturning(40.0))
    plane = dataclasses.replace(
        plane_of(scene),
        angle_lines=np.array([-40.0, *np.arange(-22.0, -5.0), 0.0, *np.arange(6.0, 23.0), 40.0]),
        velocity_lines=np.arange(-20.0, 21.0),
    )
    errors, counts = [], np.array([24, 48])
    for steps in counts:
        part = np.linspace(0.0, 1.0, steps + 1)
        run = FilteredPropagator(scene, FilteredDiscretization(plane, (3,), 5, part * (1.0 + 2.0 * part) / 3.0), 1e-12)
        _, exact_covariance = FilteredStart(scene, run.nodes, run.steps[0][0].characteristics.dynamics).at(scene.period)
        density = Density(run.space, run.propagate(scene.period * np.arange(2)).coefficients[1])
        errors.append(abs(density.covariance[1, 1] - exact_covariance[1, 1]))
    assert math.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.15)


@pytest.mark.parametrize(("clear", "fine", "last"), [(0.55, 9.0, 5), (0.55, 0.25, 3), (0.05, 9.0, 0), (9.0, 9.0, 8)])
def test_the_mesh_takes_over_before_anything_can_happen_or_once_it_resolves(clear, fine, last, monkeypatch):
    """Steps of a tenth: nothing happens until `clear`, and the Gaussian is resolved from `fine` on."""
    monkeypatch.setattr(FilteredStart, "undisturbed", lambda _, time: time < clear)
    monkeypatch.setattr(FilteredStart, "resolution", lambda _, time, __: float(time > fine))
    assert FilteredStart.__new__(FilteredStart).takeover_step(None, 0.1 * np.arange(9)) == last
