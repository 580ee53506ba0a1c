"""The deposit: every Gauss point of the source mesh puts its mass, times the test functions, where its nodes land.

The kernels evaluate the shape functions themselves; a test holds their operator against one assembled from
scikit-fem's own evaluation. Source columns are split into a fixed number of chunks, each with a buffer of its own,
and the buffers are added in a fixed order: the result does not depend on the number of threads.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import prange

from fpk_rocking.base.jit import kernel
from fpk_rocking.base.lanes import WIDTH
from fpk_rocking.density.step.landed import deposit_landed
from fpk_rocking.density.step.landing import LOST, locate, points_of
from fpk_rocking.physics.motion.flight import apply_affine

CHUNKS = 8
"""Parts of the source mesh, each with a buffer: as many threads at most."""

_C1, _C2, _C3, _C4, _C5 = math.sqrt(3.0), math.sqrt(5.0) / 2.0, math.sqrt(7.0) / 2.0, 3.0 / 8.0, math.sqrt(11.0) / 8.0


@kernel(fastmath={"contract"}, borrows=True)
def legendre(xi):
    """Legendre polynomials 0 to 5 at xi in [-1, 1], orthonormal for the measure of the unit interval."""
    square = xi * xi
    p2 = _C2 * (3.0 * square - 1.0)
    p3 = _C3 * xi * (5.0 * square - 3.0)
    p4 = _C4 * ((35.0 * square - 30.0) * square + 3.0)
    p5 = _C5 * xi * ((63.0 * square - 70.0) * square + 15.0)
    return 1.0, _C1 * xi, p2, p3, p4, p5


@kernel
def add_row(target, a, part, across, basis):
    """Add to one row of the unknowns of a cell."""
    modes = len(basis)
    # Scalars, not an array: a store to `target` could alias an array, and then nothing is vectorized.
    row = target[a * modes : (a + 1) * modes]
    row[0] += part * across[0]
    row[1] += part * across[1]
    if modes > 2:
        row[2] += part * across[2]
    if modes > 3:
        row[3] += part * across[3]
    if modes > 4:
        row[4] += part * across[4]
    if modes > 5:
        row[5] += part * across[5]


@kernel
def add(target, amount, xi, eta, basis):
    """Add a mass times the shape functions at a reference point to the unknowns of one cell."""
    modes = len(basis)
    along, across = legendre(xi), legendre(eta)
    add_row(target, 0, amount * along[0], across, basis)
    add_row(target, 1, amount * along[1], across, basis)
    if modes > 2:
        add_row(target, 2, amount * along[2], across, basis)
    if modes > 3:
        add_row(target, 3, amount * along[3], across, basis)
    if modes > 4:
        add_row(target, 4, amount * along[4], across, basis)
    if modes > 5:
        add_row(target, 5, amount * along[5], across, basis)


@kernel
def values_at_points(cell, area, points, rows, values, basis):
    """Masses (g, h) of the Gauss points of one cell."""
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


@kernel(fastmath={"contract", "reassoc", "nsz"}, tuned=True)
def deposit_free(values, node_weights, x, v, affine, offsets, angle_grid, velocity_grid, buffer, sink, basis):
    """Deposit one cell from which nothing but affine flight is possible; x (g,) and v (h,) are its Gauss points."""
    for p in range(values.shape[0]):
        for q in range(values.shape[1]):
            mean_x, mean_v = apply_affine(x[p], v[q], affine)
            for k in range(len(node_weights)):
                amount = values[p, q] * node_weights[k]
                i, xi = locate(angle_grid, mean_x + offsets[k, 0])
                j, eta = locate(velocity_grid, mean_v + offsets[k, 1])
                if i < 0 or j < 0:
                    sink[-1 - LOST] += amount
                else:
                    add(buffer[i * (len(velocity_grid[0]) - 1) + j], amount, xi, eta, basis)


@kernel
def deposit_chunk(
    source, cells, points, landed, flown, angle_grid, velocity_grid, chunk, buffer, sink, source_basis, basis
):
    """Deposit the columns of one chunk."""
    across = len(velocity_grid[0]) - 1
    sink[:] = 0.0
    buffer[chunk[2] * across : chunk[3] * across] = 0.0
    rows = np.empty((len(source_basis), len(points.velocity_points)))
    values = np.empty((len(points.angle_points), len(points.velocity_points)))
    masses, ordered = np.empty(values.size * len(flown.weights) + 1), np.empty((landed.most, WIDTH))
    for i in range(chunk[0], chunk[1]):
        for j in range(source.shape[1]):
            if not cells.chosen[i, j] or (source[i, j, 0, 0] == 0.0 and not np.any(source[i, j])):
                continue
            values_at_points(source[i, j], cells.areas[i, j], points, rows, values, source_basis)
            row = cells.events[i, j]
            if row >= 0:
                deposit_landed(values, flown.weights, row, landed, buffer, sink, masses, ordered, basis)
            else:
                side, x, v = points_of(i, j, points)
                affine = flown.cosh, flown.sinh, flown.shifts[side]
                deposit_free(
                    values, flown.weights, x, v, affine, flown.offsets, angle_grid, velocity_grid, buffer, sink, basis
                )


class Cells(NamedTuple):
    """Cells of the source, (angle, velocity): those to deposit, their areas, their rows in what landed (-1: free)."""

    chosen: np.ndarray
    areas: np.ndarray
    events: np.ndarray


class Flown(NamedTuple):
    """Where free cells fly: an `Affine`, and offsets (n, 2) and weights (n,) of the nodes of the noise."""

    cosh: float
    sinh: float
    shifts: np.ndarray
    offsets: np.ndarray
    weights: np.ndarray


class Parts(NamedTuple):
    """Chunks of a deposit, each of which writes to a buffer of its own.

    `chunks` (CHUNKS, 4): source columns from, to; target columns from, to. `buffers` (CHUNKS, target cells, modes *
    modes). `sinks` (CHUNKS, 3 or 4): what overturned to the left, to the right, left the mesh, and came to rest.
    """

    chunks: np.ndarray
    buffers: np.ndarray
    sinks: np.ndarray


@kernel(parallel=True)
def deposit(source, cells, points, landed, flown, angle_grid, velocity_grid, parts, source_basis, basis):
    """Deposit the density of the chosen cells into the buffers of the chunks.

    Parameters
    ----------
    source : ndarray, shape (angle cells, velocity cells, modes, modes)
        Coefficients.
    cells : Cells
    points : Gauss
    landed : Landed
        Of what was traced.
    flown : Flown
    angle_grid, velocity_grid : tuple
        Of the target, see `landing.locate`.
    parts : Parts
        Overwritten.
    source_basis, basis : tuple, shape (modes,)
        Of source and target: their lengths tell the compiler the numbers of modes.
    """
    for k in prange(len(parts.chunks)):
        deposit_chunk(
            source, cells, points, landed, flown, angle_grid, velocity_grid,
            parts.chunks[k], parts.buffers[k], parts.sinks[k], source_basis, basis,
        )  # fmt: skip


@kernel
def gather(buffers, chunks, areas, out):
    """Add the buffers of the chunks in their order and divide by the Jacobian: the coefficients, into `out`."""
    across, modes = out.shape[1], out.shape[2]
    out[:] = 0.0
    for k in range(len(chunks)):
        for i in range(chunks[k, 2], chunks[k, 3]):
            for j in range(across):
                for a in range(modes):
                    for b in range(modes):
                        out[i, j, a, b] += buffers[k, i * across + j, a * modes + b] / areas[i, j]
