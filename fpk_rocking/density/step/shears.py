"""The shears of a free flight, row by row of mesh lines, with the diffusion along them; or of its adjoint.

A density in flight is held by its values at the Gauss points of the cells, (cells, cells of the row, modes, modes) with
the row last: rows of velocity cells, of angle cells, and of velocity cells again. A row has an end cell at both ends
(`remap`). In a flight these collect the mass that leaves. In the adjoint, with the order of the shears reversed and the
adjoints of all remaps, they hold the values of having left.

Arguments: rows from number `begin` to `stop` in the order of `AngleRows` or `VelocityRows` are sheared; `exits` (2,)
are values of having left at the lower and the upper end; `left` (2, rows), masses that left there, is added to.
`basis`, a tuple, tells the compiler the number of modes by its length.
"""

from typing import NamedTuple

import numpy as np

from fpk_rocking.base.arrays import borrowed
from fpk_rocking.base.jit import kernel
from fpk_rocking.density.step.remap import remap_row
from fpk_rocking.density.step.scatter import FASTMATH


class LineTables(NamedTuple):
    """Tables of a mesh for its lines of Gauss points."""

    to_values: np.ndarray  # (modes, modes): from coefficients to values at the Gauss points
    to_coefficients: np.ndarray  # (modes, modes): and back
    weights: np.ndarray  # (modes,) of the Gauss points
    angle_sizes: np.ndarray  # of the cells
    velocity_sizes: np.ndarray


class AngleRows(NamedTuple):
    """Rows of one shear of the angle: row `side * velocity cells + velocity cell`, side 0 or 1."""

    order: np.ndarray  # (n,) rows that are not empty
    sources: np.ndarray  # (rows, 2): first cell and one past the last
    targets: np.ndarray  # (rows, 2)


class VelocityRows(NamedTuple):
    """Rows of the two remaps of the velocity, by angle cell."""

    order: np.ndarray  # (n,) rows that are not empty
    sources: np.ndarray  # (rows, 2) of the first remap
    first_targets: np.ndarray  # (rows, 2)
    second_sources: np.ndarray  # (rows, 2): the same without end cells; in the adjoint these are there, not above
    targets: np.ndarray  # (rows, 2) of the second remap


@kernel(fastmath=FASTMATH)
def _write_row(t, row, cells, out, basis):
    """Write row t (cells, lines, modes) to `out` (cells, cells, modes, lines), rows of the other axis, at column t."""
    for c in range(max(cells[0], 1), min(cells[1], len(row) - 1)):
        for q in range(len(basis)):
            for i in range(len(basis)):
                out[c - 1, t + 1, i, q] = row[c, q, i]


@kernel(fastmath=FASTMATH)
def _transform(cell, table, out, basis):
    """Apply a table to both axes of a cell and exchange them: out[j, i] = sum of table[j, b] table[i, a] cell[a, b]."""
    modes = len(basis)
    for j in range(modes):
        for i in range(modes):
            out[j, i] = 0.0
    for i in range(modes):
        for b in range(modes):
            part = 0.0
            for a in range(modes):
                part += table[i, a] * cell[a, b]
            for j in range(modes):
                out[j, i] += table[j, b] * part


@kernel
def _set_ends(row, cells, exits):
    """Write the values of having left to the end cells of a row within `cells` (2,)."""
    for end in range(2):
        c = end * (len(row) - 1)
        if cells[0] <= c < cells[1]:
            row[c] = exits[end]


@kernel
def _collect_ends(t, row, cells, weights, size, left):
    """Add the masses in the end cells of a row within `cells` (2,) to `left`, at t."""
    for end in range(2):
        c = end * (len(row) - 1)
        for q in range(len(weights) if cells[0] <= c < cells[1] else 0):
            for i in range(len(weights)):
                left[end, t] += row[c, q, i] * weights[q] * weights[i] * size


@kernel
def _shear_row(r, t, row, source, target, remap, exits, weights, size, moved, left, basis):
    """Remap row r, with its end cells, to `moved`; its cells are of a `size` across, and `left` has it at t."""
    _set_ends(row, source, exits)
    remap_row(r, row, source, target, remap, moved, basis)
    _collect_ends(t, moved, target, weights, size, left)


@kernel
def shear_coefficients(begin, stop, rows, coefficients, cells, remap, tables, exits, out, left, basis):
    """Shear the angle of `coefficients` (the space's shape) in the mask `cells`; write values, by angle cell."""
    rows, coefficients, cells, remap, tables, exits, out, left = borrowed(
        (rows, coefficients, cells, remap, tables, exits, out, left)
    )
    (limit, across), modes = cells.shape, len(basis)
    for n in range(begin, stop):
        r = rows.order[n]
        j, source, target = r % across, rows.sources[r], rows.targets[r]
        row, moved = np.zeros((limit + 2, modes, modes)), np.zeros((limit + 2, modes, modes))
        for c in range(max(source[0], 1), min(source[1], limit + 1)):
            if cells[c - 1, j]:
                _transform(coefficients[c - 1, j], tables.to_values, row[c], basis)
        size = tables.velocity_sizes[j]
        _shear_row(r, j, row, source, target, remap, exits, tables.weights, size, moved, left, basis)
        _write_row(j, moved, target, out, basis)


@kernel
def shear_velocity(begin, stop, rows, values, first_remap, second_remap, tables, exits, out, left, basis):
    """Remap the velocity twice, by `values` of `shear_coefficients`; write values, by velocity cell."""
    rows, values, first_remap, second_remap, tables, exits, out, left = borrowed(
        (rows, values, first_remap, second_remap, tables, exits, out, left)
    )
    weights = tables.weights
    for n in range(begin, stop):
        c = rows.order[n]
        size, target = tables.angle_sizes[c], rows.targets[c]
        between, moved = np.zeros(values[c].shape), np.zeros(values[c].shape)
        _shear_row(
            c, c, values[c], rows.sources[c], rows.first_targets[c], first_remap, exits, weights, size, between, left,
            basis,
        )  # fmt: skip
        _shear_row(
            c, c, between, rows.second_sources[c], target, second_remap, exits, weights, size, moved, left, basis
        )
        _write_row(c, moved, target, out, basis)


@kernel
def shear_values(begin, stop, rows, values, remap, tables, exits, out, left, basis):
    """Shear the angle by `values` of `shear_velocity`; add coefficients to `out` (the space's shape)."""
    rows, values, remap, tables, exits, out, left = borrowed((rows, values, remap, tables, exits, out, left))
    across, modes = len(values), len(basis)
    for n in range(begin, stop):
        r = rows.order[n]
        j, target = r % across, rows.targets[r]
        moved, cell = np.zeros(values[j].shape), np.zeros((modes, modes))
        size = tables.velocity_sizes[j]
        _shear_row(r, j, values[j], rows.sources[r], target, remap, exits, tables.weights, size, moved, left, basis)
        for c in range(max(target[0], 1), min(target[1], len(moved) - 1)):
            _transform(moved[c], tables.to_coefficients, cell, basis)
            for a in range(modes):
                for b in range(modes):
                    out[c - 1, j, a, b] += cell[a, b]
