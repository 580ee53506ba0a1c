"""Scatter of a step's paths to unknowns (Lagrange-Galerkin projection), and the gather that is its adjoint.

Every Gauss point of the source mesh adds its mass, times the test functions, where its paths end. The adjoint gives a
Gauss point the mean of a function over the ends of its paths. A test holds the operator against one assembled from
scikit-fem's evaluation. Source columns are split into a fixed number of chunks, each with a buffer of its own, and the
buffers are added in a fixed order; a gather writes to no place twice: neither depends on the number of threads.
"""

from typing import NamedTuple

import numpy as np

from fpk_rocking.base.arrays import WIDTH, borrowed, own
from fpk_rocking.base.jit import kernel
from fpk_rocking.density.step import Exit
from fpk_rocking.density.step.dynamics import points_of_cell
from fpk_rocking.density.step.targets import FASTMATH, gather_cell, legendre_at, locate_point, scatter_cell
from fpk_rocking.physics.motion.flight import apply_affine


class SourceCells(NamedTuple):
    """Cells (angle, velocity) of the source: a mask of those to scatter, areas, numbers among the traced ones or -1."""

    mask: np.ndarray
    areas: np.ndarray
    numbers: np.ndarray


class AffinePaths(NamedTuple):
    """Paths of cells without events: affine flights, and offsets (n, 2) and weights (n,) of the nodes of the noise."""

    cosh: float
    sinh: float
    shifts: np.ndarray
    offsets: np.ndarray
    weights: np.ndarray


class Chunks(NamedTuple):
    """Chunks of a scatter, each of which writes to a buffer of its own."""

    columns: np.ndarray
    buffers: np.ndarray
    absorbed: np.ndarray


@kernel
def scatter_point(target, amount, xi, eta, basis):
    """Add a mass `amount` times the shape functions at a point to `target` (modes²,), unknowns of one cell."""
    modes = len(basis)
    along, across = legendre_at(xi), legendre_at(eta)
    for a in range(modes):
        part = amount * along[a]
        for b in range(modes):
            target[a * modes + b] += part * across[b]


@kernel
def point_masses(cell, area, points, rows, values, basis):
    """Write to `values` (g, h) the masses of the Gauss points of a cell, by its coefficients `cell` (modes, modes)."""
    modes = len(basis)
    angle_table, velocity_table = points.angle_table, points.velocity_table
    angle_weights, velocity_weights = points.angle_weights, points.velocity_weights
    for a in range(modes):
        for q in range(values.shape[1]):
            total = 0.0
            for b in range(modes):
                total += cell[a, b] * velocity_table[q, b]
            rows[a, q] = total * velocity_weights[q] * area
    for p in range(values.shape[0]):
        for q in range(values.shape[1]):
            total = 0.0
            for a in range(modes):
                total += rows[a, q] * angle_table[p, a]
            values[p, q] = total * angle_weights[p]


@kernel
def project_point_values(values, points, rows, out, basis):
    """Write to `out` (modes, modes) the coefficients of a cell by `values` (g, h) at its `GaussPoints`."""
    modes = len(basis)
    angle_table, velocity_table = points.angle_table, points.velocity_table
    angle_weights, velocity_weights = points.angle_weights, points.velocity_weights
    for p in range(values.shape[0]):
        for b in range(modes):
            total = 0.0
            for q in range(values.shape[1]):
                total += values[p, q] * velocity_weights[q] * velocity_table[q, b]
            rows[p, b] = total * angle_weights[p]
    for a in range(modes):
        for b in range(modes):
            total = 0.0
            for p in range(values.shape[0]):
                total += rows[p, b] * angle_table[p, a]
            out[a, b] = total


@kernel(fastmath=FASTMATH)
def scatter_affine_cell(values, paths, side, x, v, angle_search, velocity_search, buffer, absorbed, basis):
    """Add the point masses `values` (g, h) of a cell without events to `buffer` and `absorbed`."""
    affine, offsets, node_weights = (paths.cosh, paths.sinh, paths.shifts[side]), paths.offsets, paths.weights
    for p in range(values.shape[0]):
        for q in range(values.shape[1]):
            mean_x, mean_v = apply_affine(x[p], v[q], affine)
            for k in range(len(node_weights)):
                amount = values[p, q] * node_weights[k]
                i, xi = locate_point(angle_search, mean_x + offsets[k, 0])
                j, eta = locate_point(velocity_search, mean_v + offsets[k, 1])
                if i < 0 or j < 0:
                    absorbed[Exit.OVERTURNED_LEFT - Exit.TRUNCATED] += amount
                else:
                    scatter_point(buffer[i * len(velocity_search.scales) + j], amount, xi, eta, basis)


@kernel
def _scatter_chunk(
    source,
    cells,
    points,
    targets,
    affine,
    angle_search,
    velocity_search,
    columns,
    buffer,
    absorbed,
    source_basis,
    basis,
):
    """Scatter the density `source` (its space's shape) in the columns of one chunk to the chunk's buffer."""
    across = len(velocity_search.scales)
    absorbed[:] = 0.0
    buffer[columns[2] * across : columns[3] * across] = 0.0
    owned = (
        np.empty((len(source_basis), len(points.velocity_points))),
        np.empty((len(points.angle_points), len(points.velocity_points))),
        np.empty(len(points.angle_points) * len(points.velocity_points) * len(affine.weights) + 1),
        np.empty((targets.most, WIDTH)),
    )
    rows, values, masses, ordered = borrowed(owned)
    for i in range(columns[0], columns[1]):
        for j in range(source.shape[1]):
            if not cells.mask[i, j] or (source[i, j, 0, 0] == 0.0 and not np.any(source[i, j])):
                continue
            point_masses(source[i, j], cells.areas[i, j], points, rows, values, source_basis)
            number = cells.numbers[i, j]
            if number >= 0:
                scatter_cell(values, affine.weights, number, targets, buffer, absorbed, masses, ordered, basis)
            else:
                side, x, v = points_of_cell(i, j, points)
                scatter_affine_cell(values, affine, side, x, v, angle_search, velocity_search, buffer, absorbed, basis)
    own(owned)


@kernel
def scatter(
    begin, end, source, cells, points, targets, affine, angle_search, velocity_search, chunks, source_basis, basis
):
    """Scatter the density of some cells to the buffers of the chunks from `begin` to `end`."""
    source, cells, points, targets, affine, angle_search, velocity_search, chunks = borrowed(
        (source, cells, points, targets, affine, angle_search, velocity_search, chunks)
    )
    for k in range(begin, end):
        _scatter_chunk(
            source, cells, points, targets, affine, angle_search, velocity_search,
            chunks.columns[k], chunks.buffers[k], chunks.absorbed[k], source_basis, basis,
        )  # fmt: skip


@kernel
def sum_buffers(buffers, columns, areas, out):
    """Write to `out`, coefficients (angle cells, velocity cells, modes, modes), the sum of the chunks' buffers."""
    across, modes = out.shape[1], out.shape[2]
    out[:] = 0.0
    for k in range(len(columns)):
        for i in range(columns[k, 2], columns[k, 3]):
            for j in range(across):
                for a in range(modes):
                    for b in range(modes):
                        out[i, j, a, b] += buffers[k, i * across + j, a * modes + b] / areas[i, j]


@kernel
def gather(begin, end, function, exit_values, points, numbers, targets, node_weights, cells, out, source_basis, basis):
    """Write coefficients of a function before the step by those after it: adjoint of `scatter` in cells with events."""
    function, exit_values, points, numbers, targets, node_weights, cells, out = borrowed(
        (function, exit_values, points, numbers, targets, node_weights, cells, out)
    )
    for n in range(begin, end):
        i, j = cells[n]
        rows = np.empty((len(points.angle_points), len(source_basis)))
        values = np.empty((len(points.angle_points), len(points.velocity_points)))
        path_values, ordered = np.empty(values.size * len(node_weights) + 1), np.empty((targets.most, WIDTH))
        gather_cell(function, exit_values, node_weights, numbers[i, j], targets, values, path_values, ordered, basis)
        project_point_values(values, points, rows, out[i, j], source_basis)
