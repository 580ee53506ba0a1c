"""The deposit: every Gauss point of the source mesh puts its mass, times the test functions, where its nodes land.

This is the one numerical kernel that evaluates shape functions itself; a test holds its operator against one assembled
from scikit-fem's own evaluation. Source columns are split into a fixed number of chunks, each with a buffer of its own,
and the buffers are added in a fixed order: the result does not depend on the number of threads.
"""

import functools
import math

import numpy as np
from numba import prange

from fpk_rocking.density.landing import LOST, locate
from fpk_rocking.jit import kernel

CHUNKS = 8


MAX_DEGREE = 5


@kernel
def legendre(xi):
    """Legendre polynomials 0 to 5 at xi in [-1, 1], orthonormal for the measure of the unit interval."""
    p2 = 1.5 * xi * xi - 0.5
    p3 = (5.0 * xi * p2 - 2.0 * xi) / 3.0
    p4 = (7.0 * xi * p3 - 3.0 * p2) / 4.0
    p5 = (9.0 * xi * p4 - 4.0 * p3) / 5.0
    return 1.0, math.sqrt(3.0) * xi, math.sqrt(5.0) * p2, math.sqrt(7.0) * p3, 3.0 * p4, math.sqrt(11.0) * p5


@functools.cache
def deposit_kernel(degree):
    """Compile the deposit for one polynomial degree.

    Parameters
    ----------
    degree : int
        Polynomial degree in each direction, of source and target.

    Returns
    -------
    callable
        ``deposit(source, areas, tables, weights, events, landed, free, angle_grid, velocity_grid, chunks,
        buffers, sinks)``; see the source for the shapes.
    """
    modes = degree + 1

    @kernel
    def add_row(target, a, part, across):
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
    def add(target, amount, xi, eta):
        along, across = legendre(xi), legendre(eta)
        add_row(target, 0, amount * along[0], across)
        add_row(target, 1, amount * along[1], across)
        if modes > 2:
            add_row(target, 2, amount * along[2], across)
        if modes > 3:
            add_row(target, 3, amount * along[3], across)
        if modes > 4:
            add_row(target, 4, amount * along[4], across)
        if modes > 5:
            add_row(target, 5, amount * along[5], across)

    @kernel(parallel=True, fastmath={"contract", "reassoc", "nsz"})
    def deposit(
        source,  # (angle cells, velocity cells, modes, modes) coefficients
        areas,  # (angle cells, velocity cells) of the source
        tables,  # (g, modes), (h, modes) shape functions at the Gauss points of both axes
        weights,  # (g,), (h,) Gauss weights on [0, 1]
        events,  # (angle cells, velocity cells) row in `landed`, or -1 for a free cell
        landed,  # cells (m, g, h, n) and reference coordinates (m, g, h, n, 2)
        free,  # source lines, Gauss points (g,), (h,), cosh, sinh, shifts (3, 2) by side, offsets (n, 2), node weights (n,)
        angle_grid,
        velocity_grid,
        chunks,  # (CHUNKS, 4): source columns from, to; target columns from, to
        buffers,  # (CHUNKS, target angle cells * target velocity cells, modes * modes)
        sinks,  # (CHUNKS, 3) receives what overturned to the left, to the right, and left the mesh
    ):
        landed_cells, landed_points = landed
        source_angle, source_velocity, angle_points, velocity_points, cosh, sinh, shifts, offsets, node_weights = free
        (angle_table, velocity_table), (angle_weights, velocity_weights) = tables, weights
        across_count, g, h, n = len(velocity_grid[0]) - 1, len(angle_points), len(velocity_points), len(node_weights)
        for chunk in prange(len(chunks)):
            buffer, sink = buffers[chunk], sinks[chunk]
            sink[:] = 0.0
            buffer[chunks[chunk, 2] * across_count : chunks[chunk, 3] * across_count] = 0.0
            rows, values = np.empty((modes, h)), np.empty((g, h))
            for i in range(chunks[chunk, 0], chunks[chunk, 1]):
                side = 1 if source_angle[i] + source_angle[i + 1] > 0.0 else -1
                width = source_angle[i + 1] - source_angle[i]
                for j in range(source.shape[1]):
                    cell = source[i, j]
                    if cell[0, 0] == 0.0 and not np.any(cell):
                        continue
                    for a in range(modes):
                        for q in range(h):
                            total = 0.0
                            for b in range(modes):
                                total += cell[a, b] * velocity_table[q, b]
                            rows[a, q] = total * velocity_weights[q] * areas[i, j]
                    for p in range(g):
                        for q in range(h):
                            total = 0.0
                            for a in range(modes):
                                total += rows[a, q] * angle_table[p, a]
                            values[p, q] = total * angle_weights[p]
                    height = source_velocity[j + 1] - source_velocity[j]
                    row = events[i, j]
                    if row >= 0:
                        for p in range(g):
                            for q in range(h):
                                for k in range(n):
                                    amount = values[p, q] * node_weights[k]
                                    target = landed_cells[row, p, q, k]
                                    if target < 0:
                                        sink[-1 - target] += amount
                                    else:
                                        point = landed_points[row, p, q, k]
                                        add(buffer[target], amount, point[0], point[1])
                        continue
                    for p in range(g):
                        x = source_angle[i] + angle_points[p] * width
                        for q in range(h):
                            v = source_velocity[j] + velocity_points[q] * height
                            mean_x = shifts[side, 0] + cosh * x + sinh * v
                            mean_v = shifts[side, 1] + sinh * x + cosh * v
                            for k in range(n):
                                amount = values[p, q] * node_weights[k]
                                m, xi = locate(angle_grid, mean_x + offsets[k, 0])
                                c, eta = locate(velocity_grid, mean_v + offsets[k, 1])
                                if m < 0 or c < 0:
                                    sink[-1 - LOST] += amount
                                else:
                                    add(buffer[m * across_count + c], amount, xi, eta)

    return deposit


@kernel(parallel=True)
def gather(buffers, chunks, areas, out):
    """Add the chunks' buffers in their order and divide by the Jacobian: coefficients (angle, velocity, modes, modes)."""
    angle_count, velocity_count, modes = out.shape[0], out.shape[1], out.shape[2]
    for i in prange(angle_count):
        column = out[i].reshape(velocity_count, modes * modes)
        column[:] = 0.0
        for chunk in range(len(chunks)):
            if chunks[chunk, 2] <= i < chunks[chunk, 3]:
                column += buffers[chunk, i * velocity_count : (i + 1) * velocity_count]
        for j in range(velocity_count):
            column[j] /= areas[i, j]

