"""The shears of a free flight, row by row of mesh lines, with the diffusion along them; the adjoint stands below each.

A density in flight is held by its values at the Gauss points of the cells.
"""

from typing import NamedTuple

import numpy as np

from fpk_rocking.base.arrays import borrowed
from fpk_rocking.base.jit import kernel
from fpk_rocking.density.step.remap_rows import (
    adjoint_clamp_to_end,
    adjoint_mass_past_end,
    adjoint_remap_row,
    clamp_to_end,
    mass_past_end,
    remap_row,
)
from fpk_rocking.density.step.targets import FASTMATH


class LineTables(NamedTuple):
    """Tables of a mesh for its lines of Gauss points."""

    to_values: np.ndarray
    to_coefficients: np.ndarray
    weights: np.ndarray
    ends: np.ndarray
    angle_sizes: np.ndarray
    velocity_sizes: np.ndarray


class AngleRows(NamedTuple):
    """Rows of one shear of the angle: their order, and their ranges (rows, 2) of source and target cells."""

    order: np.ndarray
    sources: np.ndarray
    targets: np.ndarray


class VelocityRows(NamedTuple):
    """Rows of the shear of the velocity, as `AngleRows`; `sheared` are the ranges between shear and diffusion."""

    order: np.ndarray
    sources: np.ndarray
    sheared: np.ndarray
    targets: np.ndarray


@kernel(fastmath=FASTMATH)
def _write_row(t, moved, target, out, basis):
    """Write row t, `moved` (cells, lines, modes), to `out` with its axes exchanged, as rows of the other direction."""
    for c in range(target[0], target[1]):
        for q in range(len(basis)):
            for i in range(len(basis)):
                out[c, t, i, q] = moved[c, q, i]


@kernel
def _read_row(t, values, target, out, basis):
    """Read row t to `out` (cells, lines, modes), from rows of the other direction: adjoint of `_write_row`."""
    for c in range(target[0], target[1]):
        for q in range(len(basis)):
            for i in range(len(basis)):
                out[c, q, i] = values[c, t, i, q]


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
def _integral_across(masses, weights, size):
    """Return the mass that values `masses` (modes,) at the Gauss points across a cell of a `size` stand for."""
    total = 0.0
    for q in range(len(masses)):
        total += masses[q] * weights[q]
    return total * size


@kernel
def _shear_angle_row(r, values, rows, remap, tables, moved, overturned, basis):
    """Write to `moved` the values (cells, lines, modes) of row r after a shear of the angle."""
    source, target, across = rows.sources[r], rows.targets[r], len(tables.velocity_sizes)
    column, j, masses = r // across, r % across, np.zeros(len(basis))
    remap_row(r, values, source, target, remap, moved, basis)
    for end in range(2):
        if mass_past_end(r, end, values, source, remap, masses):
            if end == column:
                overturned[column, j] += _integral_across(masses, tables.weights, tables.velocity_sizes[j])
            else:
                clamp_to_end(end, masses, target, tables.ends, tables.angle_sizes, moved)


@kernel
def _adjoint_shear_angle_row(r, values, rows, remap, tables, exit_values, moved, basis):
    """Add to `moved` the values (cells, lines, modes) of a function on row r before a shear of the angle."""
    source, target, across = rows.sources[r], rows.targets[r], len(tables.velocity_sizes)
    column, j, end_values = r // across, r % across, np.zeros(len(basis))
    adjoint_remap_row(r, values, source, target, remap, moved, basis)
    for end in range(2):
        if end == column:
            end_values[:] = exit_values[column] * tables.weights * tables.velocity_sizes[j]
        else:
            adjoint_clamp_to_end(end, values, target, tables.ends, tables.angle_sizes, end_values)
        adjoint_mass_past_end(r, end, end_values, source, remap, moved)


@kernel
def _first_angle_row(r, coefficients, free, rows, remap, tables, out, overturned, basis):
    """Write to `out` the values of row r (side, velocity cell) after the first shear of the angle."""
    (limit, across), modes = free.shape, len(basis)
    j, source = r % across, rows.sources[r]
    values, moved = np.zeros((limit, modes, modes)), np.zeros((limit, modes, modes))
    for c in range(source[0], source[1]):
        if free[c, j]:
            _transform(coefficients[c, j], tables.to_values, values[c], basis)
    _shear_angle_row(r, values, rows, remap, tables, moved, overturned, basis)
    _write_row(j, moved, rows.targets[r], out, basis)


@kernel
def first_angle_shear(begin, stop, rows, coefficients, free, remap, tables, out, overturned, basis):
    """Write to `out` values (angle cells, velocity cells, modes, modes) at Gauss points after the first shear."""
    rows, coefficients, free, remap, tables, out, overturned = borrowed(
        (rows, coefficients, free, remap, tables, out, overturned)
    )
    for n in range(begin, stop):
        r = rows.order[n]
        _first_angle_row(r, coefficients, free, rows, remap, tables, out, overturned, basis)


@kernel
def adjoint_first_angle_shear(begin, stop, rows, values, free, remap, tables, exit_values, out, basis):
    """Write to `out` the coefficients of a function in the free cells, by values after the first shear."""
    rows, values, free, remap, tables, exit_values, out = borrowed(
        (rows, values, free, remap, tables, exit_values, out)
    )
    (limit, across), modes = free.shape, len(basis)
    for n in range(begin, stop):
        r = rows.order[n]
        j, source = r % across, rows.sources[r]
        now, moved = np.zeros((limit, modes, modes)), np.zeros((limit, modes, modes))
        _read_row(j, values, rows.targets[r], now, basis)
        _adjoint_shear_angle_row(r, now, rows, remap, tables, exit_values, moved, basis)
        for c in range(source[0], source[1]):
            if free[c, j]:
                area = tables.angle_sizes[c] * tables.velocity_sizes[j]
                _transform(moved[c] / area, tables.to_values.T, out[c, j], basis)


@kernel
def _velocity_row(c, values, rows, velocity_remap, diffusion_remap, tables, out, basis):
    """Write to `out` row c, an angle cell, after shear and diffusion of the velocity; return the truncated mass."""
    (across, modes, _), truncated, size = values.shape, 0.0, tables.angle_sizes[c]
    source, sheared, target = rows.sources[c], rows.sheared[c], rows.targets[c]
    now, moved, masses = np.zeros((across, modes, modes)), np.zeros((across, modes, modes)), np.zeros(modes)
    remap_row(c, values, source, sheared, velocity_remap, now, basis)
    remap_row(c, now, sheared, target, diffusion_remap, moved, basis)
    for end in range(2):
        if mass_past_end(c, end, values, source, velocity_remap, masses):
            truncated += _integral_across(masses, tables.weights, size)
        if mass_past_end(c, end, now, sheared, diffusion_remap, masses):
            truncated += _integral_across(masses, tables.weights, size)
    _write_row(c, moved, target, out, basis)
    return truncated


@kernel
def velocity_shear(begin, stop, rows, values, velocity_remap, diffusion_remap, tables, out, truncated, basis):
    """Write values after shear and diffusion of the velocity to `out` (velocity cells, angle cells, modes, modes)."""
    rows, values, velocity_remap, diffusion_remap, tables, out, truncated = borrowed(
        (rows, values, velocity_remap, diffusion_remap, tables, out, truncated)
    )
    for n in range(begin, stop):
        c = rows.order[n]
        truncated[c] = _velocity_row(c, values[c], rows, velocity_remap, diffusion_remap, tables, out, basis)


@kernel
def adjoint_velocity_shear(begin, stop, rows, values, velocity_remap, diffusion_remap, tables, exit_value, out, basis):
    """Write to `out` (x cells, v cells, modes, modes) a function before shear and diffusion of the velocity."""
    rows, values, velocity_remap, diffusion_remap, tables, out = borrowed(
        (rows, values, velocity_remap, diffusion_remap, tables, out)
    )
    across, modes = values.shape[0], len(basis)
    for n in range(begin, stop):
        c = rows.order[n]
        source, sheared, target = rows.sources[c], rows.sheared[c], rows.targets[c]
        now, moved = np.zeros((across, modes, modes)), np.zeros((across, modes, modes))
        end_values = exit_value * tables.weights * tables.angle_sizes[c]
        _read_row(c, values, target, now, basis)
        adjoint_remap_row(c, now, sheared, target, diffusion_remap, moved, basis)
        for end in range(2):
            adjoint_mass_past_end(c, end, end_values, sheared, diffusion_remap, moved)
        adjoint_remap_row(c, moved, source, sheared, velocity_remap, out[c], basis)
        for end in range(2):
            adjoint_mass_past_end(c, end, end_values, source, velocity_remap, out[c])


@kernel
def _last_angle_row(r, values, rows, remap, tables, out, overturned, basis):
    """Add to `out`, coefficients in the space's shape, those of row r (side, velocity cell) after the last shear."""
    (across, limit), modes, target = values.shape[:2], len(basis), rows.targets[r]
    j = r % across
    moved, cell = np.zeros((limit, modes, modes)), np.zeros((modes, modes))
    _shear_angle_row(r, values[j], rows, remap, tables, moved, overturned, basis)
    for c in range(target[0], target[1]):
        _transform(moved[c], tables.to_coefficients, cell, basis)
        for a in range(modes):
            for b in range(modes):
                out[c, j, a, b] += cell[a, b]


@kernel
def last_angle_shear(begin, stop, rows, values, remap, tables, out, overturned, basis):
    """Add coefficients after the last shear to `out` (the space's shape), masses past the cut-off to `overturned`."""
    rows, values, remap, tables, out, overturned = borrowed((rows, values, remap, tables, out, overturned))
    for n in range(begin, stop):
        r = rows.order[n]
        _last_angle_row(r, values, rows, remap, tables, out, overturned, basis)


@kernel
def adjoint_last_angle_shear(begin, stop, rows, function, remap, tables, exit_values, out, basis):
    """Write to `out` (velocity cells, angle cells, modes, modes) a function's values before the last shear."""
    rows, function, remap, tables, exit_values, out = borrowed((rows, function, remap, tables, exit_values, out))
    (across, limit), modes = out.shape[:2], len(basis)
    for n in range(begin, stop):
        r = rows.order[n]
        j, target = r % across, rows.targets[r]
        values = np.zeros((limit, modes, modes))
        for c in range(target[0], target[1]):
            area = tables.angle_sizes[c] * tables.velocity_sizes[j]
            _transform(function[c, j] * area, tables.to_coefficients.T, values[c], basis)
        _adjoint_shear_angle_row(r, values, rows, remap, tables, exit_values, out[j], basis)
