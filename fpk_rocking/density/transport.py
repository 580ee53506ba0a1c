"""The deposit: every Gauss point of the source mesh puts its mass, times the test functions, where its nodes land.

This is the one numerical kernel that evaluates shape functions itself; a test holds its operator against one assembled
from scikit-fem's own evaluation. Source columns are split into a fixed number of chunks, each with a buffer of its own,
and the buffers are added in a fixed order: the result does not depend on the number of threads.
"""

import functools

import numpy as np
from numba import prange

from fpk_rocking.density.landing import LOST, cell_of
from fpk_rocking.jit import kernel

CHUNKS = 8


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
        ``deposit(source, areas, table, weights, events, landed, free, angle_grid, velocity_grid, first, chunks,
        buffers, sinks)``; see the source for the shapes.
    """
    modes = degree + 1

    @kernel(inline="always")
    def legendre(xi, out):
        """Orthonormal Legendre polynomials at xi in [-1, 1], orthonormal for the measure of the unit interval."""
        before, value = 0.0, 1.0
        out[0] = 1.0
        for k in range(1, modes):
            before, value = value, ((2 * k - 1) * xi * value - (k - 1) * before) / k
            out[k] = np.sqrt(2.0 * k + 1.0) * value

    @kernel(inline="always")
    def add(target, amount, along, across):
        for a in range(modes):
            part = amount * along[a]
            for b in range(modes):
                target[a * modes + b] += part * across[b]

    @kernel(parallel=True, fastmath={"contract", "reassoc", "nsz"})
    def deposit(
        source,  # (angle cells, velocity cells, modes, modes) coefficients
        areas,  # (angle cells, velocity cells) of the source
        table,  # (g, modes) shape functions at the Gauss points
        weights,  # (g,) Gauss weights on [0, 1]
        events,  # (angle cells, velocity cells) row in `landed`, or -1 for a free cell
        landed,  # cells (m, g, g, n) and reference coordinates (m, g, g, n, 2)
        free,  # source lines, Gauss points (g,), cosh, sinh, shifts (3, 2) by side, offsets (n, 2), node weights (n,)
        angle_grid,
        velocity_grid,
        first,
        chunks,  # (CHUNKS, 4): source columns from, to; target columns from, to
        buffers,  # (CHUNKS, target angle cells * target velocity cells, modes * modes)
        sinks,  # (CHUNKS, 3) receives what overturned to the left, to the right, and left the mesh
    ):
        landed_cells, landed_points = landed
        source_angle, source_velocity, points, cosh, sinh, shifts, offsets, node_weights = free
        angle, velocity = angle_grid[0], velocity_grid[0]
        across_count, g, n = len(velocity) - 1, len(weights), len(node_weights)
        for chunk in prange(len(chunks)):
            buffer, sink = buffers[chunk], sinks[chunk]
            sink[:] = 0.0
            buffer[chunks[chunk, 2] * across_count : chunks[chunk, 3] * across_count] = 0.0
            rows, values = np.empty((modes, g)), np.empty((g, g))
            along, across = np.empty(modes), np.empty(modes)
            for i in range(chunks[chunk, 0], chunks[chunk, 1]):
                side = 1 if source_angle[i] + source_angle[i + 1] > 0.0 else -1
                width = source_angle[i + 1] - source_angle[i]
                for j in range(source.shape[1]):
                    cell = source[i, j]
                    if cell[0, 0] == 0.0 and not np.any(cell):
                        continue
                    for a in range(modes):
                        for q in range(g):
                            total = 0.0
                            for b in range(modes):
                                total += cell[a, b] * table[q, b]
                            rows[a, q] = total * weights[q] * areas[i, j]
                    for p in range(g):
                        for q in range(g):
                            total = 0.0
                            for a in range(modes):
                                total += rows[a, q] * table[p, a]
                            values[p, q] = total * weights[p]
                    row = events[i, j]
                    height = source_velocity[j + 1] - source_velocity[j]
                    for p in range(g):
                        x = source_angle[i] + points[p] * width
                        for q in range(g):
                            v = source_velocity[j] + points[q] * height
                            mean_x = shifts[side, 0] + cosh * x + sinh * v
                            mean_v = shifts[side, 1] + sinh * x + cosh * v
                            for k in range(n):
                                amount = values[p, q] * node_weights[k]
                                if row >= 0:
                                    target = landed_cells[row, p, q, k]
                                    if target < 0:
                                        sink[-1 - target] += amount
                                        continue
                                    xi, eta = landed_points[row, p, q, k, 0], landed_points[row, p, q, k, 1]
                                else:
                                    xn, vn = mean_x + offsets[k, 0], mean_v + offsets[k, 1]
                                    m, l = cell_of(angle_grid, velocity_grid, first, xn, vn, side)
                                    if m < 0:
                                        sink[-1 - LOST] += amount
                                        continue
                                    target = m * across_count + l
                                    xi = 2.0 * (xn - angle[m]) / (angle[m + 1] - angle[m]) - 1.0
                                    eta = 2.0 * (vn - velocity[l]) / (velocity[l + 1] - velocity[l]) - 1.0
                                legendre(xi, along)
                                legendre(eta, across)
                                add(buffer[target], amount, along, across)

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

