"""The adjoint of a step: what a function of the state after it is worth, on average, before it.

A step maps a density p to the density P p after it and the masses m that went left, right and off the mesh. Its adjoint
maps a function q of the state after it, and the worth s of each way out, to the function r of the state before it with

    integral of p r = integral of (P p) q + m . s        for every p of the source space, to rounding.

With q = 1 and s = 0, r is the probability of not overturning. Landing points, shift matrices and tables are those of
the step itself, read the other way: a cell collects where its nodes landed and a line from the cells that it was cut
into. No two cells or lines write to the same place, so the result does not depend on the number of threads.
"""

import numpy as np
from numba import prange

from fpk_rocking.density.landing import LOST, locate
from fpk_rocking.density.transport import legendre
from fpk_rocking.jit import kernel


@kernel(fastmath={"contract", "reassoc", "nsz"})
def row_value(cell, a, across, norms):
    """One row of the coefficients of a cell, times the shape functions across."""
    modes = len(norms)
    row = cell[a * modes : (a + 1) * modes]
    total = row[0] * across[0] + row[1] * across[1]
    if modes > 2:
        total += row[2] * across[2]
    if modes > 3:
        total += row[3] * across[3]
    if modes > 4:
        total += row[4] * across[4]
    if modes > 5:
        total += row[5] * across[5]
    return total


@kernel(fastmath={"contract", "reassoc", "nsz"})
def value_at(cell, xi, eta, norms):
    """Value of a function at a reference point of one cell: the transpose of `transport.add`."""
    modes = len(norms)
    along, across = legendre(xi), legendre(eta)
    total = along[0] * row_value(cell, 0, across, norms) + along[1] * row_value(cell, 1, across, norms)
    if modes > 2:
        total += along[2] * row_value(cell, 2, across, norms)
    if modes > 3:
        total += along[3] * row_value(cell, 3, across, norms)
    if modes > 4:
        total += along[4] * row_value(cell, 4, across, norms)
    if modes > 5:
        total += along[5] * row_value(cell, 5, across, norms)
    return total


@kernel(fastmath={"contract", "reassoc", "nsz"})
def collect_landed(function, worth, node_weights, cells, points, values, norms):
    """Mean worth over the nodes of every Gauss point of one cell whose nodes were traced."""
    for p in range(values.shape[0]):
        for q in range(values.shape[1]):
            total = 0.0
            for k in range(len(node_weights)):
                target = cells[p, q, k]
                if target < 0:
                    total += node_weights[k] * worth[-1 - target]
                else:
                    total += node_weights[k] * value_at(function[target], points[p, q, k, 0], points[p, q, k, 1], norms)
            values[p, q] = total


@kernel(fastmath={"contract", "reassoc", "nsz"})
def collect_free(function, worth, node_weights, x, v, affine, offsets, angle_grid, velocity_grid, values, norms):
    """Mean worth over the nodes of every Gauss point of one cell that moves in affine flight."""
    cosh, sinh, shift = affine
    for p in range(values.shape[0]):
        for q in range(values.shape[1]):
            mean_x = shift[0] + cosh * x[p] + sinh * v[q]
            mean_v = shift[1] + sinh * x[p] + cosh * v[q]
            total = 0.0
            for k in range(len(node_weights)):
                i, xi = locate(angle_grid, mean_x + offsets[k, 0])
                j, eta = locate(velocity_grid, mean_v + offsets[k, 1])
                if i < 0 or j < 0:
                    total += node_weights[k] * worth[-1 - LOST]
                else:
                    cell = function[i * (len(velocity_grid[0]) - 1) + j]
                    total += node_weights[k] * value_at(cell, xi, eta, norms)
            values[p, q] = total


@kernel
def project_points(values, tables, weights, rows, out, norms):
    """Coefficients of one cell from values at its Gauss points: the transpose of `transport.values_at_points`."""
    modes = len(norms)
    (angle_table, velocity_table), (angle_weights, velocity_weights) = tables, weights
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


@kernel(parallel=True)
def collect(
    function, worth, tables, weights, events, landed, free, angle_grid, velocity_grid, cells, out, source_norms, norms
):
    """Transpose of `transport.deposit`, whose arguments these are.

    Parameters
    ----------
    function : ndarray, shape (target angle cells * target velocity cells, modes * modes)
        Coefficients after the step.
    worth : ndarray, shape (3,)
        Of what overturned to the left, to the right, and left the mesh.
    cells : ndarray, shape (m, 2)
        The source cells whose coefficients are wanted.
    out : ndarray, shape of the source's coefficients
        Receives them; others are left as they are.
    """
    angle_lines, velocity_lines, angle_points, velocity_points, cosh, sinh, shifts, offsets, node_weights = free
    for n in prange(len(cells)):
        i, j = cells[n]
        rows = np.empty((len(angle_points), len(source_norms)))
        values = np.empty((len(angle_points), len(velocity_points)))
        row = events[i, j]
        if row >= 0:
            collect_landed(function, worth, node_weights, landed[0][row], landed[1][row], values, norms)
        else:
            x = angle_lines[i] + angle_points * (angle_lines[i + 1] - angle_lines[i])
            v = velocity_lines[j] + velocity_points * (velocity_lines[j + 1] - velocity_lines[j])
            affine = cosh, sinh, shifts[1 if angle_lines[i] + angle_lines[i + 1] > 0.0 else -1]
            collect_free(function, worth, node_weights, x, v, affine, offsets, angle_grid, velocity_grid, values, norms)
        project_points(values, tables, weights, rows, out[i, j], source_norms)


@kernel(fastmath={"contract", "reassoc", "nsz"})
def move_line_back(values, first, count, blocks, sizes, moved, norms):
    """Transpose of `lines.move_line` in L2, times the sizes of the cells; adds to `moved` (cells, modes)."""
    modes = len(norms)
    for c in range(len(values)):
        for w in range(count[c]):
            for k in range(modes):
                total = 0.0
                for i in range(modes):
                    total += blocks[c, w, k, i] * values[c, i]
                moved[first[c] + w, k] += total * sizes[c]


@kernel(fastmath={"contract", "reassoc", "nsz"})
def add_ends(values, ends, pressed, worth, moved, norms):
    """Add what passes the ends of a line: it is worth the value at an end that is pressed, else what is given."""
    for end in range(2):
        beyond = worth[end]
        if pressed[end]:
            edge = legendre(2.0 * end - 1.0)
            beyond = 0.0
            for i in range(len(norms)):
                beyond += values[end * (len(values) - 1), i] * edge[i]
        for c in range(len(values)):
            for k in range(len(norms)):
                moved[c, k] += beyond * ends[end, c, k]


@kernel(fastmath={"contract", "reassoc", "nsz"})
def shift_cell_back(t, data, shift, nodal, modal, sizes, pressed, worth, out, norms):
    """Move the lines that run through one row of cells backwards; see `shift_lines_back`."""
    first, count, blocks, ends = shift
    cells, modes = data.shape[0], len(norms)
    values, moved = np.zeros((cells, modes)), np.empty((cells, modes))
    for q in range(modes):
        line = 0 if len(first) == 1 else t * modes + q
        values[:], moved[:] = 0.0, 0.0
        for c in range(cells):
            for u in range(modes):
                for k in range(modes):
                    values[c, k] += nodal[q, u] * data[c, u, k]
        move_line_back(values, first[line], count[line], blocks[line], sizes, moved, norms)
        add_ends(values, ends[line], pressed, worth, moved, norms)
        for c in range(cells):
            for u in range(modes):
                for k in range(modes):
                    out[c, u, k] += modal[u, q] / sizes[c] * moved[c, k]


@kernel(parallel=True)
def shift_lines_back(data, shift, nodal, modal, sizes, pressed, worth, norms):
    """Transpose of `lines.shift_lines` in L2, whose arguments these are.

    Parameters
    ----------
    data : ndarray, shape (cells across, cells along, modes across, modes along)
        Coefficients of a function after the shift.
    worth : tuple of float
        Of what passed the lower and the upper end and was not pressed.

    Returns
    -------
    ndarray, shape of `data`
    """
    out = np.zeros(data.shape)
    for t in prange(data.shape[0]):
        shift_cell_back(t, data[t], shift, nodal, modal, sizes, pressed, worth, out[t], norms)
    return out
