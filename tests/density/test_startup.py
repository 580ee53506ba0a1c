"""From a start to the mesh: against an independent simulation, closed moments, and paths where nothing is closed."""

import math

import numpy as np
import pytest
from density_operators import REST, affine, flight_noise, scene_of
from scipy.integrate import solve_ivp

from fpk_rocking import solve_fpk
from fpk_rocking.density.density import Density
from fpk_rocking.density.patches import Gaussian, exact_flight, moment_sums, patch_of
from fpk_rocking.density.resolution import PatchSettings
from fpk_rocking.density.space import Space, graded_lines
from fpk_rocking.density.startup import StartUp, takeover_step
from fpk_rocking.density.step import Exit
from fpk_rocking.density.step.dynamics import Dynamics
from fpk_rocking.density.step.scatter import AffinePaths
from fpk_rocking.density.step.step import Characteristics, Quadrature, Step
from fpk_rocking.physics.motion.equation import KernelBlock
from fpk_rocking.scene import Block, Harmonic, Overturning, Scene, Start, WhiteNoise
from montecarlo import simulate

QUADRATURE = Quadrature(5, 5, 5, 2)


def test_launch_layer_is_that_of_an_independent_simulation(named_scene):
    """Start at rest in the second scene, at 5T/16, against 1.2e6 paths with steps of a hundredth of the time elapsed.

    The layer moves the mean of the unimpeded flight by (.0017874, .0028889), good to .2 %, and multiplies its
    covariance by .98735, .99072 and .99456, good to 1e-4 each.
    """
    scene = named_scene("second")
    dynamics, step = Dynamics.of(scene), scene.period / 16
    space = Space(graded_lines(math.pi / 2, 36, 1.5), graded_lines(3.0, 56, 1.3), 3)
    startup = StartUp(dynamics, scene.start, PatchSettings(20, 8.0, 0.2, 0.005, 5), scene.period)
    first = takeover_step(startup, space, scene.period * np.arange(17) / 16)
    coefficients, outflow = startup.project(first * step, space)
    assert first <= 5
    for k in range(first, 5):
        coefficients, _ = Step(Characteristics(space, k * step, step, dynamics, QUADRATURE), space).apply(coefficients)
    density = Density(space, coefficients)
    _, unimpeded = affine(dynamics, 0.0, 5 * step, 1)
    assert density.mean - unimpeded == pytest.approx([0.0017874, 0.0028889], rel=0.01)
    ratios = density.covariance / flight_noise(dynamics, 5 * step)
    assert ratios == pytest.approx(np.array([[0.98735, 0.99072], [0.99072, 0.99456]]), abs=5e-4)
    assert np.abs(outflow).max() < 1e-9


QUIET = {
    "point": (None, 2e-5),
    "narrow": (((1e-5, 2e-6), (2e-6, 4e-6)), 2e-5),
    "wide": (((1e-2, 1e-3), (1e-3, 2e-2)), 1e-4),
}


@pytest.mark.parametrize(("covariance", "error"), QUIET.values(), ids=QUIET.keys())
def test_start_that_meets_nothing_keeps_gaussian_moments(covariance, error):
    """A cycle without events, from a point, a Gaussian that the mesh cannot resolve and one that it can.

    The first two begin on patches, which cut the density off at five standard deviations: that is counted as truncated.
    """
    scene = scene_of(0.8, start=Start(0.8, 0.15, covariance), diffusion=0.003, cutoff=2.5, frequency=8.0)
    evolution = solve_fpk(scene, cycles=1, tol=1e-2, bins_tol=math.inf)
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
}
PRESSED = pytest.param(2.0, 1.5, REST, id="at rest, pressed down", marks=pytest.mark.slow)  # its density is thin


@pytest.mark.parametrize(
    ("amplitude", "phase", "start"), [*(pytest.param(*row, id=name) for name, row in STARTS.items()), PRESSED]
)
def test_starts_that_meet_impacts_agree_with_paths(amplitude, phase, start):
    """One cycle against 20,000 paths of the white-noise engine; false alarm 7 x 6e-5 each."""
    scene = scene_of(amplitude, phase, start, 0.01)
    evolution = solve_fpk(scene, cycles=1, tol=3e-3, bins_tol=0.01 if start == REST else math.inf)
    assert evolution.mass_defect < 1e-12
    assert np.abs(evolution.truncated).max() < 1e-6
    assert np.abs(standard_errors(evolution, simulate(scene, cycles=1, realizations=20_000, seed=3))).max() < 4.0


LIFTED_OFF_LATE = {
    "A = 1.5": (1.5, 1.0, 0.5, 0.003, 0.03672),
    "A = 1.5, weak noise": (1.5, 1.0, 0.8, 0.001, 0.00421),
    "A = 2": (2.0, 1.5, 0.5, 0.005, 0.02409),
    "A = 2.5": (2.5, 2.0, 0.5, 0.003, 0.03160),
}
"""Amplitude, frequency, restitution, D; P(standing after a cycle) by 400,000 paths of the white-noise engine."""


@pytest.mark.parametrize(
    ("amplitude", "frequency", "restitution", "diffusion", "standing", "tol"),
    [
        (*LIFTED_OFF_LATE["A = 2.5"], 3e-3),
        *(pytest.param(*row, 1e-3, marks=pytest.mark.slow) for row in LIFTED_OFF_LATE.values()),
    ],
)
def test_a_block_at_rest_under_a_sine_stands_as_often_as_paths(
    amplitude, frequency, restitution, diffusion, standing, tol
):
    """It rattles until |f| = 1, and what the noise does then decides; false alarm 6e-5 each on top of the estimate."""
    forcing = Harmonic(amplitude, frequency, 0.5 * math.pi)
    scene = Scene(Block(restitution), forcing, WhiteNoise(diffusion), REST, Overturning())
    evolution = solve_fpk(scene, cycles=1, tol=tol, bins_tol=math.inf)
    error = math.sqrt(standing * (1.0 - standing) / 400_000)
    assert evolution.error_estimate < tol
    assert abs(evolution.survival[1] - standing) < 4.0 * error + evolution.error_estimate


SIDES_AT_REST = {
    "alpha .25, e .9": (Block(0.9, critical_angle=0.25), Harmonic(1.49, 1.54, 0.91), 0.0012, 0.5, 1, 0.66395),
    "alpha 1.2, e .597": (Block(0.597, critical_angle=1.2), Harmonic(2.444, 2.035, 1.56), 0.0062, 0.261, 2, 0.53075),
}
"""Block, forcing, D, cut-off, cycles; P(overturned to the left) by 400,000 paths or more of the white-noise engine."""


@pytest.mark.parametrize(
    ("block", "forcing", "diffusion", "cutoff", "cycles", "left"),
    [
        pytest.param(*row, id=name, marks=[pytest.mark.slow] * (name != "alpha .25, e .9"))
        for name, row in SIDES_AT_REST.items()
    ],
)
def test_the_side_of_a_block_that_is_lifted_off_late(block, forcing, diffusion, cutoff, cycles, left):
    """A mesh that took over while the block rattles decided the side by its cells; false alarm 5e-4 each."""
    scene = Scene(block, forcing, WhiteNoise(diffusion), REST, Overturning(cutoff))
    evolution = solve_fpk(scene, cycles=cycles, tol=1e-2, bins_tol=math.inf)
    error = math.sqrt(left * (1.0 - left) / 400_000)
    assert evolution.error_estimate < 1e-2
    assert abs(evolution.overturned[-1, 0] - left) < 3.5 * error + evolution.error_estimate


def test_a_block_at_rest_under_noise_alone_overturns_as_often_to_either_side():
    """It is its own mirror image. With the pull back of one side alone in the first instants they differed by .0023."""
    scene = Scene(Block(0.7), Harmonic(1e-6, 2.0, 0.0), WhiteNoise(2.0), REST)
    left, right = solve_fpk(scene, cycles=1, tol=1e-2, bins_tol=math.inf).overturned[1]
    assert left == pytest.approx(right, abs=1e-5)
    assert left + right == pytest.approx(0.757, abs=2e-3)


@pytest.mark.parametrize(("amplitude", "cutoff"), [(13.0, 2.0), (3.0, 0.5)])
def test_a_start_that_overturns_before_a_mesh_takes_over(amplitude, cutoff):
    scene = Scene(Block(0.17), Harmonic(amplitude, 1.0, 0.0), WhiteNoise(0.002), Start(-0.49, 0.0), Overturning(cutoff))
    result = solve_fpk(scene, cycles=1, tol=1e-2)
    assert result.survival[1] == pytest.approx(0.0, abs=1e-7)
    assert result.overturned[1] == pytest.approx([1.0, 0.0], abs=1e-7)
    assert result.mass_defect < 1e-12


@pytest.mark.parametrize(("mean", "cutoff"), [(0.0, 1.0), (-0.7501, 0.5), (-0.7499, 0.5), (0.7501, 0.5)])
def test_patches_have_no_thin_cells_at_the_cutoff(mean, cutoff):
    """Cells of about 0.25 with a line at 0 that reach from the cut-off to the other side of 0, or to both cut-offs."""
    patch = patch_of(PatchSettings(8, 2.0, 0.4, 0.01, 4), np.array([mean, 0.0]), np.diag([0.25, 0.25]), cutoff)
    lines, sizes = patch.angle_lines, np.diff(patch.angle_lines)
    assert cutoff in np.abs(lines[[0, -1]])
    assert 0.0 in lines
    assert sizes[1:-1] == pytest.approx(sizes[1], rel=1e-12)
    assert 0.1 * sizes[1] <= sizes[[0, -1]].min() <= sizes[[0, -1]].max() <= 1.1 * sizes[1]


def test_a_patch_of_a_gaussian_below_the_rounding_of_its_mean_has_a_width():
    settings, mean = PatchSettings(8, 2.0, 0.4, 0.01, 4), np.array([0.3, -0.7])
    for box in (None, np.array([0.2, 0.4, -0.8, -0.6])):
        patch = patch_of(settings, mean, np.diag([1e-40, 1e-36]), 1.5, box)
        assert all((np.diff(lines) > 0.0).all() for lines in patch.lines)
        assert all(lines[0] < middle < lines[-1] for lines, middle in zip(patch.lines, mean, strict=True))


def test_the_moments_after_a_step_are_of_all_that_has_not_overturned(main_scene):
    """Of a step from a mesh about x = 1.5 and one about impact, where the paths of cells with events were traced."""
    scene = main_scene.white_equivalent()
    for angles, overturns in ((np.linspace(1.2, 1.55, 5), True), (np.linspace(-0.2, 0.2, 5), False)):
        source = Space(angles, np.linspace(-0.5, 1.5, 6), 1)
        trace = Characteristics(source, 0.0, 0.2, Dynamics.of(scene), Quadrature(2, 2, 3, 1), to_other_mesh=True)
        traced = np.argwhere(trace.numbers >= 0)
        values = np.zeros((4, 5, 2, 2))
        values[tuple(traced.T)] = np.random.default_rng(4).random((len(traced), 2, 2))
        rows = trace.numbers[tuple(traced.T)]
        masses = (values[tuple(traced.T)][..., None] * trace.node_weights)[np.argsort(rows)]
        standing = trace.flags > Exit.OVERTURNED_LEFT
        assert standing.any()
        assert overturns == (not standing.all())
        x, v = np.moveaxis(np.where(standing[..., None], trace.ends, 0.0), -1, 0)
        expected = [
            (np.where(standing, masses, 0.0) * monomial).sum()
            for monomial in (1.0 + 0.0 * x, x, v, x * x, x * v, v * v)
        ]
        flown = AffinePaths(*trace.affine, trace.offsets, trace.node_weights)
        sums = moment_sums(values, trace.points, flown, trace.numbers, trace.ends, trace.flags, 0.0)
        assert sums[:6] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(("part", "bent"), [(0.99, False), (1.01, True)])
def test_a_gaussian_of_an_exact_block_is_bent_where_curvature_shifts_its_mean(part, bent):
    """By α² (1 + |f|) xx t²/8, against 1e-4 of the growth of patches."""
    patches = PatchSettings(10, 5.0, 0.5, 0.01, 4)
    dynamics = Dynamics(Harmonic(3.0, 2.0), 1e-3, KernelBlock(0.8, 1.5, 0.3))
    startup = StartUp(dynamics, Start(0.5, 0.0), patches, math.pi)
    least = 1e-4 * 0.5 / (0.125 * 0.3**2 * (1.0 + 3.0) * 0.2**2)
    assert startup._bent(Gaussian([0.5, 0.0], np.diag([part * least, 1.0])), 0.2) == bent


@pytest.mark.parametrize(("side", "covariance"), [(1, np.zeros((2, 2))), (-1, np.array([[1e-3, 2e-4], [2e-4, 2e-3]]))])
def test_moments_of_an_exact_flight_are_those_of_an_integration(side, covariance):
    """Of x'' = -s sin φ/α + f cos φ, φ = α (1 - s x), against DOP853 at 1e-12."""
    alpha, forcing, diffusion = 0.3, Harmonic(1.7, 2.0), 1e-3

    def rates(time, state):
        x, v, xx, xv, vv = state
        phi, force = alpha * (1.0 - side * x), forcing.value(time)
        slope = math.cos(phi) + side * force * alpha * math.sin(phi)
        fall = -side * math.sin(phi) / alpha + force * math.cos(phi)
        return [v, fall, 2.0 * xv, vv + slope * xx, 2.0 * (slope * xv + diffusion * math.cos(phi) ** 2)]

    flight = exact_flight(
        Gaussian((0.4 * side, 0.2), covariance), Dynamics(forcing, diffusion, KernelBlock(0.8, 1.5, alpha)), side
    )
    times = [0.01, 0.3, 1.1, 2.0, 2.05, 2.6]
    moments = [[*gaussian.mean, *gaussian.covariance[np.triu_indices(2)]] for gaussian in map(flight, times)]
    start = [0.4 * side, 0.2, *covariance[np.triu_indices(2)]]
    expected = solve_ivp(rates, (0.0, 2.6), start, "DOP853", times, rtol=1e-12, atol=1e-18).y.T
    assert moments == pytest.approx(expected, rel=1e-8)


def test_sides_from_rest_under_strong_noise_are_those_of_paths():
    """Of 6 million paths under white noise, with a standard error of 2e-4 each."""
    scene = Scene(Block(0.7), Harmonic(1.0, 2.0, 0.3), WhiteNoise(5.0))
    density = solve_fpk(scene, cycles=1, tol=1e-3, bins_tol=math.inf)
    accepted = density.error_estimate + 3.0 * 2e-4
    assert density.overturned[-1] == pytest.approx([0.44631, 0.45644], abs=accepted)


def test_slow_impacts_under_strong_noise_are_those_of_paths():
    """Of 2.9 million paths, half of them by a program of its own; with kicks at the ends of a step, 5 s.e. too few."""
    scene = Scene(Block(0.521), Harmonic(0.833, 3.441, 5.33), WhiteNoise(2.663))
    density = solve_fpk(scene, cycles=1, tol=6e-4, bins_tol=math.inf)
    accepted = density.error_estimate + 3.0 * 2.7e-4
    assert density.error_estimate < 6e-4
    assert density.overturned[-1] == pytest.approx([0.28639, 0.21839], abs=accepted)
    assert density.survival[-1] == pytest.approx(1.0 - 0.50478, abs=accepted)
