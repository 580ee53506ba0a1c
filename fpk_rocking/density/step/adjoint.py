"""The adjoint of a step: the mean, before it, of a function of the state after it (the backward equation).

A step maps a density p to the density P p after it and the masses m that went left, right and off the mesh. Its adjoint
maps a function q of the state after it, and a value s for each way out, to the function r of the state before it with

    integral of p r = integral of (P p) q + m . s        for every p of the source space, to rounding.

With q = 1 and s = 0, r is the probability of not overturning. Landing points, shift matrices and tables are those of
the step itself, read the other way: a cell collects where its nodes landed and a line from the cells that it was cut
into. No two cells or lines write to the same place, so the result does not depend on the number of threads.
"""

import numpy as np
from numba import prange

from fpk_rocking.base.jit import kernel
from fpk_rocking.base.lanes import WIDTH
from fpk_rocking.density.step.deposit import legendre
from fpk_rocking.density.step.free_flight import transform
from fpk_rocking.density.step.landed import collect_landed
from fpk_rocking.density.step.landing import LOST, locate, points_of
from fpk_rocking.physics.motion.flight import apply_affine

_FASTMATH = {"contract", "reassoc", "nsz"}


@kernel(fastmath=_FASTMATH)
def row_value(cell, a, across, basis):
    """One row of the coefficients of a cell, times the shape functions across."""
    modes = len(basis)
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


@kernel(fastmath=_FASTMATH)
def value_at(cell, xi, eta, basis):
    """Value of a function at a reference point of one cell: the transpose of `deposit.add`."""
    modes = len(basis)
    along, across = legendre(xi), legendre(eta)
    total = along[0] * row_value(cell, 0, across, basis) + along[1] * row_value(cell, 1, across, basis)
    if modes > 2:
        total += along[2] * row_value(cell, 2, across, basis)
    if modes > 3:
        total += along[3] * row_value(cell, 3, across, basis)
    if modes > 4:
        total += along[4] * row_value(cell, 4, across, basis)
    if modes > 5:
        total += along[5] * row_value(cell, 5, across, basis)
    return total


@kernel(fastmath=_FASTMATH)
def collect_free(function, exit_values, node_weights, x, v, affine, offsets, angle_grid, velocity_grid, values, basis):
    """Mean value over the nodes of every Gauss point of one cell that moves in affine flight."""
    for p in range(values.shape[0]):
        for q in range(values.shape[1]):
            mean_x, mean_v = apply_affine(x[p], v[q], affine)
            total = 0.0
            for k in range(len(node_weights)):
                i, xi = locate(angle_grid, mean_x + offsets[k, 0])
                j, eta = locate(velocity_grid, mean_v + offsets[k, 1])
                if i < 0 or j < 0:
                    total += node_weights[k] * exit_values[-1 - LOST]
                else:
                    cell = function[i * (len(velocity_grid[0]) - 1) + j]
                    total += node_weights[k] * value_at(cell, xi, eta, basis)
            values[p, q] = total


@kernel
def project_points(values, points, rows, out, basis):
    """Coefficients of one cell from values at its Gauss points: the transpose of `deposit.values_at_points`."""
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


@kernel(parallel=True)
def collect(
    function, exit_values, points, events, landed, flown, angle_grid, velocity_grid, cells, out, source_basis, basis
):
    """Transpose of `deposit.deposit`, whose arguments these are.

    Parameters
    ----------
    function : ndarray, shape (target angle cells * target velocity cells, modes * modes)
        Coefficients after the step.
    exit_values : ndarray, shape (3,)
        Of what overturned to the left, to the right, and left the mesh.
    cells : ndarray, shape (m, 2)
        The source cells whose coefficients are wanted.
    out : ndarray, shape of the source's coefficients
        Receives them; others are left as they are.
    """
    for n in prange(len(cells)):
        i, j = cells[n]
        rows = np.empty((len(points.angle_points), len(source_basis)))
        values = np.empty((len(points.angle_points), len(points.velocity_points)))
        row = events[i, j]
        if row >= 0:
            found, ordered = np.empty(values.size * len(flown.weights) + 1), np.empty((landed.most, WIDTH))
            collect_landed(function, exit_values, flown.weights, row, landed, values, found, ordered, basis)
        else:
            side, x, v = points_of(i, j, points)
            affine = flown.cosh, flown.sinh, flown.shifts[side]
            collect_free(
                function, exit_values, flown.weights, x, v, affine, flown.offsets, angle_grid, velocity_grid, values,
                basis,
            )  # fmt: skip
        project_points(values, points, rows, out[i, j], source_basis)


@kernel(fastmath=_FASTMATH)
def shift_row_back(r, values, source, target, shift, moved, basis):
    """Transpose of `free_flight.shift_row`, added to `moved` (cells, lines, modes)."""
    origin, first, count, start, blocks, _, _ = shift
    modes, shared = len(basis), first.shape[1] == 1
    base = origin[min(r, len(origin) - 1)]
    for c in range(target[0], target[1]):
        for q in range(modes):
            line = 0 if shared else q
            begin = first[base + c, line]
            low, high = max(begin, source[0]), min(begin + count[base + c, line], source[1])
            block = start[base + c, line] + low - begin
            for s in range(low, high):
                for k in range(modes):
                    total = 0.0
                    for i in range(modes):
                        total += blocks[block, k, i] * values[c, q, i]
                    moved[s, q, k] += total
                block += 1


@kernel(fastmath=_FASTMATH)
def value_beyond(r, end, beyond, source, shift, moved):
    """Transpose of `free_flight.mass_beyond`: what lies beyond an end of row r has the values `beyond` (lines,)."""
    place = shift.beyond[min(r, len(shift.beyond) - 1), end]
    if place < 0:
        return
    ends = shift.ends[place]
    for q in range(len(beyond)):
        line = ends[0 if len(ends) == 1 else q]
        for c in range(source[0], source[1]):
            for k in range(len(beyond)):
                moved[c, q, k] += beyond[q] * line[c, k]


@kernel(fastmath=_FASTMATH)
def pressed_value(end, values, target, edges, sizes, beyond):
    """Transpose of `free_flight.set_down`."""
    cell = target[0] if end == 0 else target[1] - 1
    for q in range(len(beyond)):
        beyond[q] = 0.0
        for i in range(len(beyond)):
            beyond[q] += values[cell, q, i] * edges[end, i] / sizes[cell]


@kernel
def return_row(t, values, target, out, basis):
    """Transpose of `free_flight.turn_row`: read row t (cells, lines, modes) from where the other direction left it."""
    for c in range(target[0], target[1]):
        for q in range(len(basis)):
            for i in range(len(basis)):
                out[c, q, i] = values[c, t, i, q]


@kernel(parallel=True)
def finish_rows_back(function, order, sources, targets, shift, tables, edges, sizes, exit_values, out, basis):
    """Transpose of `free_flight.finish_rows`: from coefficients, times the areas of their cells, to values."""
    (across, limit), modes = out.shape[:2], len(basis)
    for n in prange(len(order)):
        r = order[n]
        side, j, source, target = r // across, r % across, sources[r], targets[r]
        values, beyond = np.zeros((limit, modes, modes)), np.zeros(modes)
        for c in range(target[0], target[1]):
            transform(function[c, j] * (sizes[0][c] * sizes[1][j]), tables[1].T, tables[1].T, values[c], basis)
        shift_row_back(r, values, source, target, shift, out[j], basis)
        for end in range(2):
            if end == side:
                beyond[:] = exit_values[side] * tables[2] * sizes[1][j]
            else:
                pressed_value(end, values, target, edges, sizes[0], beyond)
            value_beyond(r, end, beyond, source, shift, out[j])


@kernel(parallel=True)
def shear_velocity_back(
    values, order, sources, sheared, blurred, velocity_shear, blur, tables, sizes, lost, out, basis
):
    """Transpose of `free_flight.shear_velocity`."""
    across, modes = values.shape[0], len(basis)
    for n in prange(len(order)):
        c = order[n]
        now, moved = np.zeros((across, modes, modes)), np.zeros((across, modes, modes))
        beyond = lost * tables[2] * sizes[0][c]
        return_row(c, values, blurred[c], now, basis)
        shift_row_back(c, now, sheared[c], blurred[c], blur, moved, basis)
        for end in range(2):
            value_beyond(c, end, beyond, sheared[c], blur, moved)
        shift_row_back(c, moved, sources[c], sheared[c], velocity_shear, out[c], basis)
        for end in range(2):
            value_beyond(c, end, beyond, sources[c], velocity_shear, out[c])


@kernel(parallel=True)
def shear_angle_back(values, free, order, sources, targets, shift, tables, edges, sizes, exit_values, out, basis):
    """Transpose of `free_flight.shear_angle`: coefficients of the free cells, per area of their cells."""
    (limit, across), modes = free.shape, len(basis)
    for n in prange(len(order)):
        r = order[n]
        side, j, source, target = r // across, r % across, sources[r], targets[r]
        now, moved = np.zeros((limit, modes, modes)), np.zeros((limit, modes, modes))
        beyond = np.zeros(modes)
        return_row(j, values, target, now, basis)
        shift_row_back(r, now, source, target, shift, moved, basis)
        for end in range(2):
            if end == side:
                beyond[:] = exit_values[side] * tables[2] * sizes[1][j]
            else:
                pressed_value(end, now, target, edges, sizes[0], beyond)
            value_beyond(r, end, beyond, source, shift, moved)
        for c in range(source[0], source[1]):
            if free[c, j]:
                transform(moved[c] / (sizes[0][c] * sizes[1][j]), tables[0].T, tables[0].T, out[c, j], basis)


def fly_back(flight, function, exit_values, out):
    """Transpose of `free_flight.FreeFlight.apply` in L2: coefficients of a function after the step to those before it.

    Parameters
    ----------
    flight : FreeFlight
        The flight; it moves the free cells, and only their coefficients in `out` are written.
    function, out : ndarray, shape of a density
        Coefficients after the step, and before it.
    exit_values : ndarray, shape (3,)
        Of having passed the cut-off to the left and to the right, and the velocity bound.
    """
    limit, across, modes, _ = function.shape
    basis, (first, second, third) = (1.0,) * modes, flight.ranges
    turned, values = np.zeros((across, limit, modes, modes)), np.zeros(function.shape)
    fixed = flight.tables, flight.edges, flight.sizes
    finish_rows_back(function, flight.orders[2], *third, flight.angle_shear, *fixed, exit_values[:2], turned, basis)
    velocity_shear, blur, tables, sizes = flight.velocity_shear, flight.blur, flight.tables, flight.sizes
    shear_velocity_back(
        turned, flight.orders[1], *second, velocity_shear, blur, tables, sizes, exit_values[2], values, basis
    )
    shear_angle_back(
        values, flight.free, flight.orders[0], *first, flight.angle_shear, *fixed, exit_values[:2], out, basis
    )
