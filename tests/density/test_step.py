"""The two ways a step moves mass, each against an operator assembled without its kernels.

Cells that an event can reach scatter their mass along paths: there the operator is put together from scikit-fem's
own evaluation of the basis. Free cells take exact shifts along lines: there from numpy's quadrature of the overlaps.
"""

import math

import numpy as np
import pytest
from density_operators import affine, flow, free_flight, gauss_points, hermite_weights, impact_time, noise_offsets
from numpy.polynomial import legendre
from scipy.sparse.linalg import spsolve
from skfem import BilinearForm
from traced import path_ends

from fpk_rocking.base.basis import gauss_hermite_product, gauss_legendre
from fpk_rocking.density.space import Space
from fpk_rocking.density.step import Exit
from fpk_rocking.density.step.characteristics import Noise
from fpk_rocking.density.step.dynamics import Dynamics, event_cells
from fpk_rocking.density.step.free_flight import FreeFlight
from fpk_rocking.density.step.remap import prepare_remap, remap_row, with_end_cells
from fpk_rocking.density.step.step import Characteristics, Quadrature, Step, overlapping_cells, with_neighbours
from fpk_rocking.physics.forcing import Harmonic
from fpk_rocking.physics.motion.equation import KernelBlock

CUTOFF = 1.2
DYNAMICS = Dynamics(Harmonic(4.6, 2.7, math.pi), 0.02, KernelBlock(0.5, CUTOFF))
START, DURATION = 0.53, 0.1
QUADRATURE = Quadrature(4, 5, 5, 2)
SOURCE = Space(
    np.array([-1.2, -0.9, -0.5, -0.2, 0.0, 0.003, 0.3, 0.7, 1.0, 1.2]), np.array([-3.0, -1.4, -0.3, 0.1, 1.5, 3.0]), 3
)
TARGET = Space(np.array([-1.15, -0.6, -0.1, 0.0, 0.25, 0.5, 1.1]), np.array([-2.6, -1.1, -0.35, 0.25, 0.9, 2.4]), 3)
SIDES = {1: slice(SOURCE.first_positive, None), -1: slice(0, SOURCE.first_positive)}


def lines_of(side):
    angle = SOURCE.angle_lines
    return angle[angle >= 0.0] if side > 0 else angle[angle <= 0.0], SOURCE.velocity_lines


def traced(points, side, dynamics, quadrature, duration=DURATION):
    """Landing points (points, nodes, 2) and flags (points, nodes), one call of the path kernel a point."""
    nodes, _ = gauss_hermite_product(quadrature.long, quadrature.short)
    offsets = noise_offsets(dynamics, duration, quadrature.long, quadrature.short)
    noise = Noise(duration, dynamics.diffusion, nodes, offsets, np.abs(offsets[:, 0]).max())
    segment = dynamics.segment(START, duration)
    states, flags = zip(*(path_ends(x, v, side, segment, dynamics.block, noise) for x, v in points), strict=True)
    return np.array(states), np.array(flags)


def affine_ends(points, side):
    """Landing points (points, nodes, 2) and flags (points, nodes) of a flight without events."""
    matrix, shift = affine(DYNAMICS, START, DURATION, side)
    offsets = noise_offsets(DYNAMICS, DURATION, QUADRATURE.long, QUADRATURE.short)
    return (points @ matrix.T + shift)[:, None] + offsets, np.full((len(points), len(offsets)), side)


def cells_of(trace, free):
    """Side, Gauss points and their areas for the cells of a step that are free, or for the others."""
    mesh_lines = SOURCE.angle_lines, SOURCE.velocity_lines
    for (i, j), points, areas in gauss_points(mesh_lines, (QUADRATURE.angle, QUADRATURE.velocity)):
        if (trace.numbers[i, j] < 0) == free:
            yield (1 if SOURCE.angle_lines[i] >= 0.0 else -1), points, areas


def deposited(trace, coefficients, target, free):
    """Coefficients and sinks of free cells or others, by scikit-fem's evaluation of both bases and its mass matrix."""
    parts = []
    for side, points, areas in cells_of(trace, free):
        landed = affine_ends(points, side) if free else traced(points, side, DYNAMICS, QUADRATURE)
        parts.append((points, areas, *landed))
    points, areas, states, flags = (np.concatenate(part) for part in zip(*parts, strict=True))
    mass = np.outer((SOURCE.basis().probes(points.T) @ coefficients.ravel()) * areas, hermite_weights(5, 2))
    x, v = np.moveaxis(states, -1, 0)
    x = np.where(x == 0.0, 1e-15 * np.where(flags < 0, -1, 1), x)
    standing = flags >= -1
    inside = standing & (x > target.angle_lines[0]) & (x < target.angle_lines[-1])
    inside &= (v > target.velocity_lines[0]) & (v < target.velocity_lines[-1])
    right = target.basis().probes(np.array([x[inside], v[inside]])).T @ mass[inside]
    matrix = BilinearForm(lambda u, w, _: u * w).assemble(target.basis())
    left, right_side = (mass[flags == way].sum() for way in (Exit.OVERTURNED_LEFT, Exit.OVERTURNED_RIGHT))
    sinks = [left, right_side, mass[standing & ~inside].sum()]
    return spsolve(matrix.tocsc(), right).reshape(target.shape), np.array(sinks)


@pytest.fixture(scope="module")
def trace():
    return Characteristics(SOURCE, START, DURATION, DYNAMICS, QUADRATURE)


@pytest.fixture(scope="module")
def away():
    """Of the same step, to another mesh."""
    return Characteristics(SOURCE, START, DURATION, DYNAMICS, QUADRATURE, to_other_mesh=True)


@pytest.fixture(scope="module")
def coefficients():
    return np.random.default_rng(1).normal(size=SOURCE.shape)


def test_scatter_is_the_operator_assembled_from_scikit_fem(away, coefficients):
    """Onto another mesh all cells land: impacts, rest, overturning, what leaves the mesh, and free cells."""
    (events, event_sinks), (free, free_sinks) = (deposited(away, coefficients, TARGET, free) for free in (False, True))
    out, sinks = Step(away, TARGET).apply(coefficients)
    assert np.abs(event_sinks).min() > 1e-3
    assert np.abs(free).max() > 0.1
    assert np.abs(out - events - free).max() < 1e-12 * np.abs(events + free).max()
    assert sinks == pytest.approx(event_sinks + free_sinks, abs=1e-13)


def test_step_on_one_mesh_is_scatter_and_exact_remaps(trace, coefficients):
    """Onto its own mesh only the cells that an event can reach land; the others are moved line by line."""
    expected, sinks = deposited(trace, coefficients, SOURCE, free=False)
    free = np.where((trace.numbers < 0)[:, :, None, None], coefficients, 0.0)
    for side, columns in SIDES.items():
        part, out, lost = free_flight(free[columns], lines_of(side), DYNAMICS, START, DURATION, side)
        expected[columns] += part
        sinks += [*out, lost.sum()]
    result, result_sinks = Step(trace, SOURCE).apply(coefficients)
    assert np.abs(result - expected).max() < 1e-12 * np.abs(expected).max()
    assert result_sinks == pytest.approx(sinks, abs=1e-13)


def test_the_tested_step_holds_every_kind_of_event(trace):
    """What the comparisons above cover: impacts to both sides, paths set off from rest, overturning to both sides."""
    middles = SOURCE.angle_lines[1:] + SOURCE.angle_lines[:-1]
    before = np.sign(middles).repeat(SOURCE.shape[1])[trace.numbers.ravel() >= 0]
    for side, flag in ((-1, Exit.OVERTURNED_LEFT), (-1, -1), (1, 1), (1, Exit.OVERTURNED_RIGHT)):
        assert np.any(trace.flags[before == side] == flag)
    assert np.any(trace.flags[before < 0] == 1)
    assert np.any(trace.flags[before > 0] == -1)
    assert np.any((trace.ends[..., 0] == 0.0) & (trace.flags >= -1))


@pytest.mark.parametrize("side", [1, -1])
def test_shifts_are_projections_of_the_moved_lines(trace, coefficients, side):
    """With coefficients in all cells of a side much passes every end: nothing passes x = 0, and mass is balanced."""
    affinity, columns = trace.affine, SIDES[side]
    free, out = np.zeros(SOURCE.shape[:2], dtype=bool), np.zeros(SOURCE.shape)
    free[columns] = True
    overturned_left, overturned_right, lost = FreeFlight(
        SOURCE, free, affinity, DYNAMICS.diffusion, DURATION, 15
    ).apply(coefficients, out)
    expected, angle_ends, velocity_ends = free_flight(
        coefficients[columns], lines_of(side), DYNAMICS, START, DURATION, side
    )
    assert np.abs(out[columns] - expected).max() < 1e-12 * np.abs(expected).max()
    assert not out[SIDES[-side]].any()
    assert [overturned_left, overturned_right] == pytest.approx(angle_ends, abs=1e-13)
    assert lost == pytest.approx(velocity_ends.sum(), abs=1e-13)
    assert angle_ends[(1 - side) // 2] == 0.0
    assert np.abs([angle_ends[(1 + side) // 2], *velocity_ends]).min() > 1e-4
    difference = np.sum((coefficients[columns] - out[columns])[:, :, 0, 0] * SOURCE.areas[columns])
    assert difference == pytest.approx(angle_ends.sum() + velocity_ends.sum(), abs=1e-13)


def test_a_step_that_covers_part_of_the_plane_moves_that_part(trace, coefficients):
    """What is outside is lost; covering more later is the same as covering it from the start."""
    cells = np.random.default_rng(2).random(SOURCE.shape[:2]) < 0.4
    more = cells | (np.random.default_rng(3).random(cells.shape) < 0.3)
    step = Step(Characteristics(SOURCE, START, DURATION, DYNAMICS, QUADRATURE, cells=False), SOURCE)
    everywhere = Step(trace, SOURCE)
    for covered in (cells, more):
        step.activate(covered)
        inside = np.where(covered[:, :, None, None], coefficients, 0.0)
        expected, sinks = everywhere.apply(inside)
        out, others = step.apply(coefficients)
        sinks[2] += SOURCE.masses(coefficients - inside).sum()
        assert np.abs(out - expected).max() < 1e-13 * np.abs(expected).max()
        assert others == pytest.approx(sinks, abs=1e-14)
        exit_values = np.array([0.3, -0.7, 0.2])
        before = step.apply_adjoint(coefficients, exit_values)
        assert np.sum(before * coefficients * SOURCE.areas[..., None, None]) == pytest.approx(
            np.sum(out * coefficients * SOURCE.areas[..., None, None]) + others @ exit_values, rel=1e-12
        )


@pytest.mark.parametrize("target", [SOURCE, TARGET])
def test_mass_is_balanced_through_all_events(trace, away, coefficients, target):
    out, sinks = Step(trace if target is SOURCE else away, target).apply(coefficients)
    assert target.masses(out).sum() + sinks.sum() == pytest.approx(SOURCE.masses(coefficients).sum(), abs=1e-13)


def test_paths_of_free_cells_meet_nothing(trace):
    """The kernel's path to every node of a free cell ends where the affine flight and the node's offset put it.

    It has overturned if that is beyond the cut-off, and only then.
    """
    passed = []
    for side, points, _ in cells_of(trace, free=True):
        (states, flags), (landed, _) = traced(points, side, DYNAMICS, QUADRATURE), affine_ends(points, side)
        beyond = side * landed[..., 0] >= CUTOFF
        assert np.all(flags == np.where(beyond, Exit.OVERTURNED_LEFT if side < 0 else Exit.OVERTURNED_RIGHT, side))
        assert np.abs(states - landed)[~beyond].max(initial=0.0) < 1e-13
        passed.append(beyond.mean())
    assert max(passed) > 0.0
    assert min(passed) == 0.0


def test_free_cells_are_those_that_no_flight_leaves():
    """Corners of random cells flown without noise: none that is free meets an event, but the cut-off for good.

    For good means at a velocity that stays above a margin. A flight is affine in its start, so that corners are the
    extremes. Of those not called free few could be.
    """
    rng, counts = np.random.default_rng(12), np.zeros((2, 2), dtype=int)
    for _ in range(60):
        forcing = Harmonic(rng.uniform(0.0, 8.0), rng.uniform(1.0, 4.0), rng.uniform(0.0, 6.3))
        dynamics = Dynamics(forcing, 0.02, KernelBlock(0.5, CUTOFF))
        start, duration, margin = rng.uniform(0.0, 3.0), rng.uniform(0.05, 0.3), rng.uniform(0.0, 0.1)
        faster = 2.0 * margin
        angle_lines = np.sort([*rng.uniform(-CUTOFF, CUTOFF, 7), -CUTOFF, 0.0, CUTOFF])
        velocity_lines = np.sort(rng.uniform(-3.0, 3.0, 7))
        segment = dynamics.segment(start, duration)
        marks = event_cells(angle_lines, velocity_lines, segment, duration, dynamics.block, (margin, faster))
        for side, columns in ((-1, angle_lines[:-1] < 0.0), (1, angle_lines[:-1] >= 0.0)):
            edges = np.array([angle_lines[:-1][columns], angle_lines[1:][columns]])
            sides = np.array([velocity_lines[:-1], velocity_lines[1:]])
            least, most, slowest = np.inf, -np.inf, np.inf
            for time in np.linspace(0.0, duration, 41)[1:]:
                matrix, shift = affine(dynamics, start, time, side)
                angle = matrix[0, 0] * edges[:, None, :, None] + matrix[0, 1] * sides[None, :, None, :] + shift[0]
                least = np.minimum(least, np.min(side * angle, axis=(0, 1)))
                most = np.maximum(most, np.max(side * angle, axis=(0, 1)))
                speed = matrix[1, 0] * edges[:, None, :, None] + matrix[1, 1] * sides[None, :, None, :] + shift[1]
                slowest = np.minimum(slowest, np.min(side * speed, axis=(0, 1)))
            meets = (least <= margin) | ((most >= CUTOFF - margin) & (slowest <= faster))
            np.add.at(counts, (marks[columns].astype(int), meets.astype(int)), 1)
    assert counts[0, 1] == 0
    assert counts[0, 0] > 500
    assert counts[1, 0] < 0.2 * counts[1, 1]


@pytest.mark.parametrize(("point", "side"), [((0.06, -0.4), 1), ((0.05, -0.25), 1), ((-0.04, 0.3), -1)])
def test_noise_is_carried_through_an_impact(point, side):
    """Weak noise: mean and covariance of the nodes against responses of the exact flow to kicks, summed over time."""
    weak, duration, step = Dynamics(DYNAMICS.forcing, 1e-12, DYNAMICS.block), 0.25, 1e-5
    (states,), (flags,) = traced([point], side, weak, Quadrature(1, 1, 5, 3), duration)
    end, weights = START + duration, hermite_weights(5, 3)
    mean, impact = flow(weak, point, side, START, end), impact_time(weak, point, side, START, end)
    assert np.all(flags == -side)
    assert weights @ states == pytest.approx(mean, abs=1e-10)
    covariance = np.zeros((2, 2))
    for low, high, on in ((START, impact, side), (impact, end, -side)):
        for node, part in zip(*legendre.leggauss(6), strict=True):
            time = low + 0.5 * (high - low) * (node + 1.0)
            x, v = flow(weak, point, side, START, time)
            ahead, behind = (flow(weak, (x, v + velocity_shear), on, time, end) for velocity_shear in (step, -step))
            response = (ahead - behind) / (2.0 * step)
            covariance += weak.diffusion * (high - low) * part * np.outer(response, response)
    gathered = np.einsum("n,ni,nj->ij", weights, states - mean, states - mean)
    assert gathered == pytest.approx(covariance, rel=1e-5, abs=0.0)


def test_a_remap_conserves_mass_and_has_an_adjoint():
    """Rows of sources that pass both ends, none, that hold nothing, that pass the lower end, and the upper one."""
    lines = with_end_cells(np.array([0.0, 0.9, 2.0, 3.1, 4.0, 5.0]))
    source = np.array([[1, 6], [2, 5], [4, 4], [1, 5], [2, 6]])
    bounds, spread = np.tile([0, 7], (5, 1)), np.ones((5, 1))
    bounds[3, 0], rng = 1, np.random.default_rng(3)
    shifts = np.array([0.1, 0.0, 0.3, -0.05, 0.25])[:, None]
    nodes, weights = np.array([-0.2, 0.2]), np.array([0.4, 0.6])
    remap = prepare_remap(lines, bounds, shifts, spread, nodes, weights, 2, source)
    assert remap.targets.tolist() == [[0, 7], [1, 6], [0, 0], [1, 6], [2, 7]]
    sizes, (_, points) = np.diff(lines), gauss_legendre(3)
    back, masses = remap.adjoint(sizes, points), np.multiply.outer(sizes, np.outer(np.ones(3), points))
    for r, (start, end) in enumerate(source):
        before, moved, function, gathered = np.zeros((4, 7, 3, 3))
        before[start:end] = rng.normal(size=(end - start, 3, 3))
        function[slice(*remap.targets[r])] = rng.normal(size=(np.diff(remap.targets[r]).item(), 3, 3))
        remap_row(r, before, source[r], remap.targets[r], remap, moved, (1.0,) * 3)
        remap_row(r, function, back.sources[r], back.targets[r], back, gathered, (1.0,) * 3)
        assert (moved * masses).sum(axis=(0, 2)) == pytest.approx((before * masses).sum(axis=(0, 2)))
        assert (before * gathered * masses).sum() == pytest.approx((moved * function * masses).sum(), abs=1e-13)


def test_cells_that_meet_a_marked_one_are_marked():
    """Of the same mesh itself, of one shifted by half a cell along an axis two, and with its neighbours five."""
    lines = np.linspace(-2.0, 2.0, 9)
    space, shifted = Space(lines, lines, 1), Space(lines, lines + 0.25, 1)
    cells = np.zeros((8, 8), dtype=bool)
    cells[2, 5] = True
    assert np.array_equal(overlapping_cells(space, cells, space), cells)
    assert np.argwhere(overlapping_cells(space, cells, shifted)).tolist() == [[2, 4], [2, 5]]
    assert np.argwhere(with_neighbours(cells)).tolist() == [[1, 5], [2, 4], [2, 5], [2, 6], [3, 5]]
    near = np.abs(np.subtract.outer(np.arange(8), 2))[:, None] + np.abs(np.arange(8) - 5)
    assert np.array_equal(with_neighbours(cells, rings=2), near <= 2)
