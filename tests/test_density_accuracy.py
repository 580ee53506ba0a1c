"""The density solver against closed forms, exact balances and symmetries, and against paths where nothing is closed."""

import dataclasses
import math

import numba
import numpy as np
import pytest
from density_operators import affine, flight_noise

from fpk_rocking import load_scene, solve_fpk
from fpk_rocking.density.density import Density
from fpk_rocking.density.lines import blur_variances
from fpk_rocking.density.mesh import graded_lines
from fpk_rocking.density.space import Space, gauss
from fpk_rocking.density.start import Departure, Gaussian, first_resolved
from fpk_rocking.density.step import Dynamics, Quadrature, Step, Trace
from fpk_rocking.density.window import Windows, window_of
from fpk_rocking.scene import Block, Forcing, Overturning, Scene, Start, WhiteNoise
from montecarlo import simulate

QUADRATURE = Quadrature(5, 5, 5, 2)
CALM = Dynamics((0.5, 2.0, 0.0), 0.01, 0.5, 6.0)
AWAY = Gaussian((2.0, -0.6), [[0.03, 0.003], [0.003, 0.04]])
REST = Start()


def scene_of(amplitude=4.6, phase=math.pi, start=REST, diffusion=0.02, cutoff=math.pi / 2, frequency=2.7):
    forcing = Forcing(amplitude, frequency, phase)
    return Scene(Block(0.5), forcing, WhiteNoise(diffusion), start, Overturning(cutoff))


def away_mesh(cells, degree=3):
    return Space(np.linspace(0.5, 3.7, cells + 1), np.linspace(-2.3, 1.8, cells + 1), degree)


def l2_error(density, truth):
    """L2 norm over the mesh of a density minus a function."""
    space, (nodes, weights) = density.space, gauss(8)
    angle, velocity = (line[:-1, None] + np.diff(line)[:, None] * nodes for line in density.mesh_lines)
    error = space.cell_values(density.coefficients, nodes, nodes)
    error = error - truth(angle[:, None, :, None], velocity[None, :, None, :])
    return math.sqrt(np.einsum("xvij,i,j,xv->", error**2, weights, weights, space.areas))


@pytest.mark.parametrize(
    ("degree", "least"),
    [
        pytest.param(1, 3e-2, marks=pytest.mark.slow),
        (2, 2e-3),
        (3, 1.2e-4),
        pytest.param(4, 7e-6, marks=pytest.mark.slow),
        pytest.param(5, 4e-7, marks=pytest.mark.slow),
    ],
)
def test_density_converges_with_order_degree_plus_one(degree, least):
    """Gaussian flight away from events in four steps; the truth is the closed form."""
    cells, errors = (20, 26, 32, 40), []
    for count in cells:
        space, truth = away_mesh(count, degree), AWAY
        coefficients = space.project(AWAY, 8)
        for k in range(4):
            step = Step(Trace(space, 0.1 * k, 0.1, CALM, QUADRATURE), space)
            coefficients, _ = step.apply(coefficients)
            matrix, shift = affine(CALM, 0.1 * k, 0.1, 1)
            covariance = matrix @ truth.covariance @ matrix.T + flight_noise(CALM, 0.1)
            truth = Gaussian(matrix @ truth.mean + shift, covariance)
        errors.append(l2_error(Density(space, coefficients), truth))
    slope = np.polyfit(np.log(cells), np.log(errors), 1)[0]
    assert slope == pytest.approx(-(degree + 1), abs=0.15)
    assert errors[-1] < least


@pytest.mark.parametrize("duration", [0.04, 0.2])
@pytest.mark.parametrize("same_mesh", [True, False])
def test_flight_and_noise_have_exact_moments(duration, same_mesh):
    """Mean and covariance, both by shifts of lines and by landing points."""
    source = away_mesh(24)
    target = source if same_mesh else Space(np.linspace(0.3, 3.9, 25), np.linspace(-2.5, 2.0, 25), 3)
    before = Density(source, source.project(AWAY, 8))
    after = Density(target, Step(Trace(source, 0.3, duration, CALM, QUADRATURE), target).apply(before.coefficients)[0])
    matrix, shift = affine(CALM, 0.3, duration, 1)
    covariance = matrix @ before.covariance @ matrix.T + flight_noise(CALM, duration)
    assert after.mean == pytest.approx(matrix @ before.mean + shift, abs=1e-12)
    assert after.covariance == pytest.approx(covariance, abs=1e-12)


@pytest.mark.parametrize("duration", [1e-3, 0.03, 0.0999, 0.1, 0.5])
def test_blurs_have_the_covariance_of_the_flight(duration):
    """A blur of the angle, a kick's blur and another of the angle, carried on by the shears between them."""
    kick, small = blur_variances(0.7, duration)
    early, middle, late = (
        [math.cosh(duration), math.sinh(duration)],
        [math.tanh(duration / 2.0), 1.0],
        [1.0, 0.0],
    )
    covariance = small * np.outer(early, early) + kick * np.outer(middle, middle) + small * np.outer(late, late)
    truth = flight_noise(Dynamics((0.0, 1.0, 0.0), 0.7, 0.5, 1.0), duration)
    assert covariance == pytest.approx(truth, rel=1e-9 if duration > 0.01 else 1e-5, abs=0.0)


@pytest.mark.parametrize("start", [0.0, 0.7, 1.9])
def test_mass_that_crosses_zero_or_overturns_is_balanced(start):
    """One step of a Gaussian astride x = 0 that reaches both cut-offs; all that is not inside is in the sinks."""
    dynamics = Dynamics((4.6, 2.7, math.pi), 0.02, 0.5, 1.2)
    space = Space(graded_lines(1.2, 20, 1.5), graded_lines(3.5, 24, 1.3), 3)
    coefficients = space.project(Gaussian((0.02, 0.1), [[0.25, 0.02], [0.02, 0.6]]), 8)
    after, sinks = Step(Trace(space, start, 0.15, dynamics, QUADRATURE), space).apply(coefficients)
    assert sinks[:2].min() > 1e-3
    left = [space.masses(now)[: space.first_positive].sum() for now in (coefficients, after)]
    assert abs(left[1] + sinks[0] - left[0]) > 1e-3
    assert space.masses(after).sum() + sinks.sum() == pytest.approx(space.masses(coefficients).sum(), abs=1e-13)


def test_mass_that_overturns_as_a_whole_is_in_the_sink():
    """Nothing of this window is left after the step: no column of it lands anywhere."""
    dynamics = Dynamics((4.6, 2.7, math.pi), 0.02, 0.5, 1.2)
    window = Space(np.linspace(0.8, 1.2, 17), np.linspace(6.0, 9.0, 9), 3)
    coefficients = window.project(Gaussian((1.0, 7.5), [[1e-3, 0.0], [0.0, 0.04]]), 8)
    for target in (window, Space(np.linspace(-1.2, 1.2, 9), np.linspace(-4.0, 4.0, 9), 3)):
        after, sinks = Step(Trace(window, 0.0, 0.15, dynamics, QUADRATURE), target).apply(coefficients)
        assert sinks[1] == pytest.approx(window.masses(coefficients).sum(), abs=1e-13)
        assert np.abs(after).max() == 0.0


@pytest.mark.parametrize(("amplitude", "cutoff"), [(13.0, 2.0), (3.0, 0.5)])
def test_a_start_that_overturns_before_a_mesh_takes_over(amplitude, cutoff):
    scene = Scene(Block(0.17), Forcing(amplitude, 1.0, 0.0), WhiteNoise(0.002), Start(-0.49, 0.0), Overturning(cutoff))
    result = solve_fpk(scene, cycles=1, tol=1e-2)
    assert result.survival[1] == pytest.approx(0.0, abs=1e-7)
    assert result.overturned[1] == pytest.approx([1.0, 0.0], abs=1e-7)
    assert result.mass_defect < 1e-12


@pytest.mark.parametrize(("mean", "cutoff"), [(0.0, 1.0), (-0.7501, 0.5), (-0.7499, 0.5), (0.7501, 0.5)])
def test_windows_have_no_thin_cells_at_the_cutoff(mean, cutoff):
    """Cells of about 0.25 with a line at 0 that reach from the cut-off to the other side of 0, or to both cut-offs."""
    window = window_of(Windows(8, 2.0, 0.4, 0.01, 4), np.array([mean, 0.0]), np.diag([0.25, 0.25]), cutoff)
    lines, sizes = window.angle_lines, np.diff(window.angle_lines)
    assert cutoff in np.abs(lines[[0, -1]])
    assert 0.0 in lines
    assert sizes[1:-1] == pytest.approx(sizes[1], rel=1e-12)
    assert 0.1 * sizes[1] <= sizes[[0, -1]].min() <= sizes[[0, -1]].max() <= 1.1 * sizes[1]


@pytest.fixture(scope="module")
def skewed():
    """Two cycles of a Gaussian start without any symmetry, part of it beyond the cut-off."""
    start = Start(0.7, -0.6, ((0.08, 0.01), (0.01, 0.1)))
    return solve_fpk(scene_of(phase=1.0, start=start), cycles=2, tol=1e-2)


def test_turned_scene_has_the_turned_density(skewed):
    """(x, v, Psi) -> (-x, -v, Psi + pi): all coefficients, as masses."""
    scene, start = skewed.scene, skewed.scene.start
    turned = solve_fpk(
        dataclasses.replace(
            scene,
            forcing=dataclasses.replace(scene.forcing, phase=scene.forcing.phase + math.pi),
            start=Start(-start.angle, -start.velocity, start.covariance),
        ),
        cycles=2,
        tol=1e-2,
    )
    assert turned.survival == pytest.approx(skewed.survival, abs=1e-12)
    assert turned.overturned == pytest.approx(skewed.overturned[:, ::-1], abs=1e-12)
    signs = np.multiply.outer((-1.0) ** np.arange(4), (-1.0) ** np.arange(4))
    difference = turned.coefficients[:, ::-1, ::-1] * signs - skewed.coefficients
    assert np.abs(difference * skewed.space.areas[..., None, None]).max() < 1e-12


def test_nothing_is_unaccounted_for(skewed):
    balance = skewed.survival + skewed.overturned.sum(axis=1) + skewed.lost
    assert np.abs(balance - 1.0).max() < 1e-12
    assert skewed.mass_defect == pytest.approx(np.abs(balance - 1.0).max(), abs=1e-14)
    assert skewed.survival[1:] == pytest.approx([skewed.at(k).moment(0, 0) for k in (1, 2)], abs=1e-13)
    assert np.all(np.diff(skewed.survival) < -0.01)
    assert np.all(np.diff(skewed.overturned, axis=0) > 0.0)
    assert np.abs(skewed.lost).max() < 3e-6
    assert skewed.negative_mass == pytest.approx(
        max(skewed.space.negative_mass(coefficients) for coefficients in skewed.coefficients), rel=1e-12
    )


def test_what_starts_beyond_the_cutoff_has_overturned(skewed):
    spread = math.sqrt(2.0 * 0.08)
    tails = [0.5 * math.erfc((math.pi / 2 + 0.7) / spread), 0.5 * math.erfc((math.pi / 2 - 0.7) / spread)]
    assert skewed.overturned[0] == pytest.approx(tails, rel=1e-12)
    assert skewed.survival[0] == pytest.approx(1.0 - sum(tails), abs=1e-15)
    assert skewed.at(0).moment(0, 0) == pytest.approx(skewed.survival[0], abs=1e-4)
    assert skewed.at(0)(0.7, -0.6) == pytest.approx(1.0 / (2.0 * math.pi * math.sqrt(0.08 * 0.1 - 1e-4)), rel=0.02)


def test_same_bits_for_any_number_of_threads(skewed):
    threads = numba.get_num_threads()
    try:
        for count in {1, threads}:
            numba.set_num_threads(count)
            again = solve_fpk(skewed.scene, cycles=2, tol=1e-2)
            assert again.coefficients.tobytes() == skewed.coefficients.tobytes()
            assert again.overturned.tobytes() == skewed.overturned.tobytes()
    finally:
        numba.set_num_threads(threads)


def test_launch_layer_is_that_of_an_independent_simulation():
    """Start at rest in the second scene, at 5T/16, against 1.2e6 paths with steps of a hundredth of the time elapsed.

    The layer moves the mean of the unimpeded flight by (.0017874, .0028889), good to .2 %, and multiplies its
    covariance by .98735, .99072 and .99456, good to 1e-4 each.
    """
    scene = load_scene("cases/scenes/second.toml")
    dynamics, step = Dynamics.of(scene), scene.period / 16
    space = Space(graded_lines(math.pi / 2, 36, 1.5), graded_lines(3.0, 56, 1.3), 3)
    departure = Departure(dynamics, scene.start, Windows(20, 8.0, 0.2, 0.005, 5), scene.period)
    first = first_resolved(departure, space, 16)
    coefficients, gone = departure.land(first * step, space)
    assert first <= 5
    for k in range(first, 5):
        coefficients, _ = Step(Trace(space, k * step, step, dynamics, QUADRATURE), space).apply(coefficients)
    density = Density(space, coefficients)
    _, unimpeded = affine(dynamics, 0.0, 5 * step, 1)
    assert density.mean - unimpeded == pytest.approx([0.0017874, 0.0028889], rel=0.01)
    ratios = density.covariance / flight_noise(dynamics, 5 * step)
    assert ratios == pytest.approx(np.array([[0.98735, 0.99072], [0.99072, 0.99456]]), abs=5e-4)
    assert np.abs(gone).max() < 1e-9


QUIET = {
    "point": (None, 2e-5),
    "narrow": (((1e-5, 2e-6), (2e-6, 4e-6)), 2e-5),
    "wide": (((1e-2, 1e-3), (1e-3, 2e-2)), 1e-4),
}


@pytest.mark.parametrize(("covariance", "error"), QUIET.values(), ids=QUIET.keys())
def test_start_that_meets_nothing_keeps_gaussian_moments(covariance, error):
    """A cycle without events, from a point, a Gaussian that the mesh cannot resolve and one that it can.

    The first two begin on windows, which cut the density off at five standard deviations: that is counted as lost.
    """
    scene = scene_of(0.8, start=Start(0.8, 0.15, covariance), diffusion=0.003, cutoff=2.5, frequency=8.0)
    evolution = solve_fpk(scene, cycles=1, tol=1e-2)
    matrix, shift = affine(Dynamics.of(scene), 0.0, scene.period, 1)
    truth = matrix @ np.array(covariance or np.zeros((2, 2))) @ matrix.T + flight_noise(
        Dynamics.of(scene), scene.period
    )
    assert evolution.at(1).mean == pytest.approx(matrix @ [0.8, 0.15] + shift, abs=error)
    assert evolution.at(1).covariance == pytest.approx(truth, rel=error)
    assert evolution.survival[1] == pytest.approx(1.0, abs=1e-6)
    assert evolution.mass_defect < 1e-12


def standard_errors(evolution, ensemble):
    """Differences after a cycle in standard errors of the ensemble: overturned to each side, mean, covariance (7,)."""
    points = np.stack([ensemble.angle[:, 1], ensemble.velocity[:, 1]])
    points = points[:, np.isfinite(points[0])]
    density, size, count = evolution.at(1), ensemble.realizations, points.shape[1]
    overturned = ensemble.overturned[1]
    error = np.sqrt(np.maximum(overturned * (1.0 - overturned), 1.0 / size) / size)
    covariance = np.cov(points)
    spread = np.sqrt((covariance**2 + np.outer(np.diag(covariance), np.diag(covariance))) / count)
    scores = list((evolution.overturned[1] - overturned) / error)
    scores += list((density.mean - points.mean(axis=1)) / np.sqrt(np.diag(covariance) / count))
    return np.array(scores + list(((density.covariance - covariance) / spread)[np.triu_indices(2)]))


STARTS = {
    "astride zero": (4.6, math.pi, Start(0.1, -0.3, ((0.05, 0.01), (0.01, 0.2)))),
    "point at an impact": (4.6, math.pi, Start(1e-3, -0.3)),
    "narrow at rest": (4.6, math.pi, Start(0.0, 0.0, ((1e-6, 1e-7), (1e-7, 4e-6)))),
    "at rest, pressed down": (2.0, 1.5, REST),
}


@pytest.mark.parametrize(("amplitude", "phase", "start"), STARTS.values(), ids=STARTS.keys())
def test_starts_that_meet_impacts_agree_with_paths(amplitude, phase, start):
    """One cycle against 20,000 paths of the white-noise engine; false alarm 7 x 6e-5 each."""
    scene = scene_of(amplitude, phase, start, 0.01)
    evolution = solve_fpk(scene, cycles=1, tol=1e-3)
    assert evolution.mass_defect < 1e-12
    assert np.abs(evolution.lost).max() < 1e-6
    assert np.abs(standard_errors(evolution, simulate(scene, cycles=1, realizations=20_000, seed=3))).max() < 4.0


LIFTED_OFF_LATE = {
    "A = 1.5": (1.5, 1.0, 0.5, 0.003, 0.03672),
    "A = 1.5, weak noise": (1.5, 1.0, 0.8, 0.001, 0.00421),
    "A = 2": (2.0, 1.5, 0.5, 0.005, 0.02409),
    "A = 2.5": (2.5, 2.0, 0.5, 0.003, 0.03160),
}
"""Amplitude, frequency, restitution, D; P(standing after a cycle) by 400,000 paths of the white-noise engine."""


@pytest.mark.parametrize(
    ("amplitude", "frequency", "restitution", "diffusion", "standing"),
    [LIFTED_OFF_LATE["A = 1.5"], *(pytest.param(*row, marks=pytest.mark.slow) for row in LIFTED_OFF_LATE.values())],
)
def test_block_at_rest_under_a_sine(amplitude, frequency, restitution, diffusion, standing):
    """It rattles until |f| = 1, and what the noise does then decides; false alarm 6e-5 each on top of the estimate."""
    forcing = Forcing(amplitude, frequency, 0.5 * math.pi)
    scene = Scene(Block(restitution), forcing, WhiteNoise(diffusion), REST, Overturning())
    evolution = solve_fpk(scene, cycles=1, tol=1e-3)
    error = math.sqrt(standing * (1.0 - standing) / 400_000)
    assert evolution.error_estimate < 1e-3
    assert abs(evolution.survival[1] - standing) < 4.0 * error + evolution.error_estimate
