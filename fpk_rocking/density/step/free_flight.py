"""Free flight, the step of cells that no event can reach: exact shears along mesh lines, diffusion along them.

The affine flight z -> F z + d is a shear of the angle, a shear of the velocity and the same shear of the angle again,
F = X Y X with X = [[1, tanh(t/2)], [0, 1]] and Y = [[1, 0], [sinh t, 1]]. A shear moves every line of Gauss points as a
whole, so each is an L2 projection in one dimension, done exactly (`remap`), and cannot amplify. White noise is a small
diffusion of the angle with the first and the last shear and one of the velocity after the second: together they have
the covariance of the flight, exactly (derived in docs/theory). Mass is conserved line by line.

What an exact block has beyond this depends on the angle alone: it is added to the shear of the velocity half way, and
the noise by which lines of different angles differ diffuses them there too. The error is of second order in the step.

A density in flight is held by its values at the Gauss points of the cells. The adjoint of each shear stands below it.
"""

import math
from typing import NamedTuple

import numpy as np

from fpk_rocking.base.arrays import borrowed
from fpk_rocking.base.basis import gauss_hermite, gauss_legendre, legendre_at_gauss_points, legendre_basis
from fpk_rocking.base.jit import kernel
from fpk_rocking.base.threads import run_in_parts
from fpk_rocking.density.space.space import Space
from fpk_rocking.density.step.remap import (
    adjoint_clamp_to_end,
    adjoint_mass_past_end,
    adjoint_remap_row,
    balanced_order,
    clamp_to_end,
    join_sides,
    mask_of,
    mass_past_end,
    prepare_remap,
    ranges_of,
    remap_row,
    rows_along_angle,
    target_range,
    union,
)
from fpk_rocking.density.step.targets import FASTMATH
from fpk_rocking.density.tuning import TUNING
from fpk_rocking.physics.motion.block import force_factors, gravity_at_contact, gravity_correction
from fpk_rocking.physics.motion.flight import flight_shears, shear_diffusion_variances


class LineTables(NamedTuple):
    """Tables of a mesh for its lines of Gauss points.

    `to_values`, `to_coefficients` (modes, modes): from coefficients to values at the Gauss points, and back. `weights`
    (modes,) of the points. `ends` (2, modes): what a mass at the lower and the upper end of a cell adds to
    its values. `angle_sizes`, `velocity_sizes`: of the cells.
    """

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


class FreeFlight:
    """Linear map of densities over one step for the cells that no event can reach, and its adjoint.

    Parameters
    ----------
    space : Space
        Source and target.
    free : ndarray of bool, shape (angle cells, velocity cells)
        The cells to fly from.
    affine : AffineFlights
    diffusion, duration : float
        D and the length of the step.
    nodes : int
        Gauss-Hermite nodes of the diffusion of the velocity.
    angle_remap : Remap, optional
        The shear of the angle, prepared for all cells (`angle_remap_of`); else it is prepared for those that need it.
    critical_angle : float, optional
        α of an exact block, whose force in `affine` is the part sin α/α of f, the mean of what turns it.
    """

    def __init__(self, space: Space, free, affine, diffusion, duration, nodes, angle_remap=None, critical_angle=None):
        sinh, shifts = flight_shears(duration)[1], affine.shifts
        self.free = free
        (limit, across), middle = free.shape, min(space.first_positive, free.shape[0])
        points, weights = gauss_legendre(space.degree + 1)
        table = legendre_at_gauss_points(space.degree + 1, space.degree)
        self.tables = LineTables(
            table, np.ascontiguousarray((table * weights[:, None]).T), weights,
            legendre_basis([0.0, 1.0], space.degree) @ table.T,
            np.diff(space.angle_lines), np.diff(space.velocity_lines),
        )  # fmt: skip
        sides, angle_shears, drift, narrow, narrow_weights = _angle_shears(
            space, affine, diffusion * gravity_at_contact(critical_angle) ** 2, duration
        )
        alike = np.ones_like(angle_shears)
        by_side = [shifts[side, 1] - sinh * drift[side] for side in (-1, 1)]
        pushes = np.repeat(by_side, (middle, limit - middle))[:, None]
        angles = _line_points(space.angle_lines, points)
        velocity_shears = sinh * angles + pushes
        if critical_angle:
            away = np.repeat([-1.0, 1.0], (middle, limit - middle))[:, None]
            more = force_factors(angles, critical_angle) / gravity_at_contact(critical_angle) - 1.0
            velocity_shears += sinh * gravity_correction(angles, away, critical_angle) + 0.5 * sum(by_side) * more
        all_cells, no_shift, one = np.tile([0, across], (limit, 1)), np.zeros((1, 1)), np.ones((1, 1))

        first = ranges_of(rows_along_angle(free, middle))
        first_targets = target_range(space.angle_lines, sides, angle_shears, alike, narrow, first)
        second = ranges_of(join_sides(mask_of(first_targets, limit)).T)
        variance, (wide, wide_weights) = shear_diffusion_variances(diffusion, duration)[0], gauss_hermite(nodes)
        spreads, (own, own_weights) = np.ones_like(velocity_shears), gauss_hermite(1)
        if critical_angle and diffusion > 0.0 and second.any():
            # The least diffusion of all lines is one remap for all, and what a line lacks is part of its shear.
            parts = force_factors(angles, critical_angle) ** 2
            needed = parts[second[:, 1] > second[:, 0]]
            least, most = needed.min(), needed.max()
            spreads, variance = np.sqrt(variance * np.maximum(parts - least, 0.0)), variance * least
            is_narrow = most - least <= TUNING.narrow_part * most
            own, own_weights = gauss_hermite(TUNING.narrow_nodes if is_narrow else nodes)
        wide = math.sqrt(variance) * wide
        sheared = target_range(space.velocity_lines, all_cells, velocity_shears, spreads, own, second)
        diffused = target_range(space.velocity_lines, all_cells, no_shift, one, wide, sheared)
        third = ranges_of(rows_along_angle(mask_of(diffused, across), middle))
        third_targets = target_range(space.angle_lines, sides, angle_shears, alike, narrow, third)
        degree, every = space.degree, ranges_of(mask_of(sheared, across).any(axis=0)[None])
        self._shared = angle_remap is not None
        self.angle_remap = angle_remap or prepare_remap(
            space.angle_lines, sides, angle_shears, alike, narrow, narrow_weights, degree, union(first, third)
        )
        self.velocity_remap = prepare_remap(
            space.velocity_lines, all_cells, velocity_shears, spreads, own, own_weights, degree, second
        )
        self.diffusion_remap = prepare_remap(
            space.velocity_lines, all_cells[:1], no_shift, one, wide, wide_weights, degree, every
        )
        self.first = AngleRows(balanced_order(first), first, first_targets)
        self.second = VelocityRows(balanced_order(second), second, sheared, diffused)
        self.third = AngleRows(balanced_order(third), third, third_targets)

    @property
    def nbytes(self):
        """Memory of the prepared remaps, one that was given left out; bytes."""
        own = (self.velocity_remap, self.diffusion_remap, *(() if self._shared else (self.angle_remap,)))
        return sum(part.nbytes for remap in own for part in remap)

    def apply(self, coefficients, out):
        """Add the density after the step to `out`, and return the masses that passed the bounds.

        Parameters
        ----------
        coefficients : ndarray, shape ``space.shape``
            Before the step; only the free cells are read.
        out : ndarray, shape ``space.shape``
            Coefficients after the step, added to.

        Returns
        -------
        ndarray, shape (3,)
            What passed the cut-off to the left and to the right, and the velocity bound. Nothing passes x = 0: what a
            projection would put there is clamped to it.
        """
        limit, across, modes, _ = coefficients.shape
        basis = (1.0,) * modes
        drifted, diffused = np.zeros(coefficients.shape), np.zeros((across, limit, modes, modes))
        truncated, overturned = np.zeros(limit), np.zeros((2, across))
        angle, velocity, tables = self.angle_remap, (self.velocity_remap, self.diffusion_remap), self.tables
        _run_on_rows(first_angle_shear, self.first, coefficients, self.free, angle, tables, drifted, overturned, basis)
        _run_on_rows(velocity_shear, self.second, drifted, *velocity, tables, diffused, truncated, basis)
        _run_on_rows(last_angle_shear, self.third, diffused, angle, tables, out, overturned, basis)
        return np.array([overturned[0].sum(), overturned[1].sum(), truncated.sum()])

    def apply_adjoint(self, function, exit_values, out):
        """Write to `out` the coefficients of a function before the step, by those after it: adjoint of `apply` in L2.

        Parameters
        ----------
        function, out : ndarray, shape ``space.shape``
            Coefficients after the step, and before it, of which only those of the free cells are written.
        exit_values : ndarray, shape (3,)
            Values of having passed the cut-off to the left and to the right, and the velocity bound.
        """
        limit, across, modes, _ = function.shape
        basis = (1.0,) * modes
        diffused, drifted = np.zeros((across, limit, modes, modes)), np.zeros(function.shape)
        angle, velocity, tables = self.angle_remap, (self.velocity_remap, self.diffusion_remap), self.tables
        _run_on_rows(adjoint_last_angle_shear, self.third, function, angle, tables, exit_values[:2], diffused, basis)
        _run_on_rows(adjoint_velocity_shear, self.second, diffused, *velocity, tables, exit_values[2], drifted, basis)
        _run_on_rows(
            adjoint_first_angle_shear, self.first, drifted, self.free, angle, tables, exit_values[:2], out, basis
        )


def _run_on_rows(shear, rows, *arguments):
    """Call a kernel of a shear, with `arguments`, for all rows of an `AngleRows` or `VelocityRows`, on threads."""
    run_in_parts(shear, len(rows.order), rows, *arguments)


def angle_remap_of(space, affine, diffusion, duration):
    """Return the `Remap` of both shears of the angle for all cells of a `Space`.

    It serves all flights of a `duration` that differ from `affine`, `AffineFlights`, in a constant force alone: that
    moves the velocity between the two shears of the angle, and neither of these. `diffusion` is D.
    """
    sides, shears, _, nodes, weights = _angle_shears(space, affine, diffusion, duration)
    return prepare_remap(space.angle_lines, sides, shears, np.ones_like(shears), nodes, weights, space.degree, sides)


def _angle_shears(space, affine, diffusion, duration):
    """Return what `prepare_remap` needs for a shear of the angle, for all cells of a `Space`.

    Bounds (rows, 2) of the rows, shifts (rows, lines) of their lines, the forcing's part of these by side (a dict),
    nodes (n,) of the diffusion and their weights. `affine`: `AffineFlights`; `diffusion`: D; `duration` of the step.
    """
    (limit, across, *_), shifts = space.shape, affine.shifts
    middle, shear = min(space.first_positive, limit), flight_shears(duration)[0]
    variance = shear_diffusion_variances(diffusion, duration)[1]
    nodes, weights = gauss_hermite(TUNING.narrow_nodes if variance > 0.0 else 1)
    drift = {side: 0.5 * (shifts[side, 0] - shear * shifts[side, 1]) for side in (1, -1)}
    along = shear * _line_points(space.velocity_lines, gauss_legendre(space.degree + 1)[0])
    sides = np.repeat([(0, middle), (middle, limit)], across, axis=0)
    return sides, np.concatenate([along + drift[-1], along + drift[1]]), drift, math.sqrt(variance) * nodes, weights


def _line_points(lines, points):
    """Return the Gauss points (cells, n) of all cells between mesh lines, for `points` (n,) on [0, 1]."""
    return lines[:-1, None] + np.diff(lines)[:, None] * points


@kernel(fastmath=FASTMATH)
def _write_row(t, moved, target, out, basis):
    """Write row t, `moved` (cells, lines, modes), to `out` with its axes exchanged, as rows of the other direction.

    `target`: its first cell and the one after the last; `out` (cells, rows, modes, lines). `basis`, a tuple (modes,),
    tells the compiler the number of modes.
    """
    for c in range(target[0], target[1]):
        for q in range(len(basis)):
            for i in range(len(basis)):
                out[c, t, i, q] = moved[c, q, i]


@kernel
def _read_row(t, values, target, out, basis):
    """Read row t, `out` (cells, lines, modes), from rows of the other direction: adjoint of `_write_row`.

    `target`: its first cell and the one after the last; `values` (cells, rows, modes, lines). `basis`, a tuple
    (modes,), tells the compiler the number of modes.
    """
    for c in range(target[0], target[1]):
        for q in range(len(basis)):
            for i in range(len(basis)):
                out[c, q, i] = values[c, t, i, q]


@kernel(fastmath=FASTMATH)
def _transform(cell, table, out, basis):
    """Apply a table to both axes of a cell and exchange them: out[j, i] = sum of table[j, b] table[i, a] cell[a, b].

    All are (modes, modes); `basis`, a tuple (modes,), tells the compiler the number of modes.
    """
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
    """Return the mass that values `masses` (modes,) at the Gauss points across a cell of a `size` stand for.

    `weights` (modes,) are those of the points.
    """
    total = 0.0
    for q in range(len(masses)):
        total += masses[q] * weights[q]
    return total * size


@kernel
def _shear_angle_row(r, values, rows, remap, tables, moved, overturned, basis):
    """Write to `moved` the values (cells, lines, modes) of row r after a shear of the angle.

    `values`: before it; `rows`: `AngleRows`; `remap`: `Remap`; `tables`: `LineTables`. What passes the cut-off is added
    to `overturned` (2, velocity cells), what passes x = 0 is clamped to it. `basis`, a tuple (modes,), tells the
    compiler the number of modes.
    """
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
    """Add to `moved` the values of a function on row r before a shear of the angle.

    Adjoint of `_shear_angle_row`: `values` (cells, lines, modes) are those after it, `exit_values` (2,) those of having
    passed the cut-off to the left and to the right. `rows`: `AngleRows`; `remap`: `Remap`; `tables`: `LineTables`.
    `basis` (modes,) tells the compiler the modes.
    """
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
    """Write to `out` row r (side, velocity cell) after the first shear of the angle.

    `coefficients` (the space's shape) are those before it in the cells of the mask `free`. `out`: values (angle cells,
    velocity cells, modes, modes); `rows`: `AngleRows`; `remap`: `Remap`; `tables`: `LineTables`. Masses past the
    cut-off are added to `overturned` (2, velocity cells). `basis` (modes,) tells the compiler the modes.
    """
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
    """Write to `out` values (angle cells, velocity cells, angle, velocity) after the first shear.

    It does so for places `begin` to `stop` in the order of `AngleRows`, from `coefficients` (the space's shape) before
    it in the cells of the mask `free`. Masses that passed the cut-off, which do not return, are added to `overturned`
    (2, velocity cells). `remap`: `Remap`; `tables`: `LineTables`; `basis` (modes,) tells the compiler the modes.
    """
    rows, coefficients, free, remap, tables, out, overturned = borrowed(
        (rows, coefficients, free, remap, tables, out, overturned)
    )
    for n in range(begin, stop):
        r = rows.order[n]
        _first_angle_row(r, coefficients, free, rows, remap, tables, out, overturned, basis)


@kernel
def adjoint_first_angle_shear(begin, stop, rows, values, free, remap, tables, exit_values, out, basis):
    """Write to `out` the coefficients of a function in the free cells, by values after the first shear.

    Adjoint of `first_angle_shear`: `values` have the shape of its `out`, `free` is the mask of the cells and
    `exit_values` (2,) are those of having passed the cut-off to the left and to the right. It does so for places
    `begin` to `stop` in the order of `AngleRows`; `remap`: `Remap`; `tables`: `LineTables`. `basis` (modes,) tells the
    compiler the modes.
    """
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
    """Write to `out` row c, an angle cell, after shear and diffusion of the velocity; return the truncated mass.

    `values` (velocity cells, modes, modes) are those of the row before, `out` is that of `velocity_shear`. `rows`:
    `VelocityRows`; both remaps: `Remap`; `tables`: `LineTables`. `basis` (modes,) tells the compiler the modes.
    """
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
    """Write values after the shear and diffusion of the velocity to `out`, with the axes of the cells exchanged.

    It does so for places `begin` to `stop` in the order of `VelocityRows`, whose rows are angle cells. `values` (angle
    cells, velocity cells, modes, modes) are those of `first_angle_shear`; both remaps: `Remap`; `tables`: `LineTables`.
    The masses that passed the velocity bound are written to `truncated` (angle cells,). `basis` (modes,) tells the
    compiler the modes.
    """
    rows, values, velocity_remap, diffusion_remap, tables, out, truncated = borrowed(
        (rows, values, velocity_remap, diffusion_remap, tables, out, truncated)
    )
    for n in range(begin, stop):
        c = rows.order[n]
        truncated[c] = _velocity_row(c, values[c], rows, velocity_remap, diffusion_remap, tables, out, basis)


@kernel
def adjoint_velocity_shear(begin, stop, rows, values, velocity_remap, diffusion_remap, tables, exit_value, out, basis):
    """Write to `out` the values of a function before shear and diffusion of the velocity.

    Adjoint of `velocity_shear`, for places `begin` to `stop` in the order of `VelocityRows`: `values` (velocity cells,
    angle cells, modes, modes) are those after, and `exit_value` is that of having passed the velocity bound. Both
    remaps: `Remap`; `tables`: `LineTables`. `basis` (modes,) tells the compiler the modes.
    """
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
    """Add to `out`, coefficients in the space's shape, those of row r (side, velocity cell) after the last shear.

    `values` (velocity cells, angle cells, modes, modes) are those before it at Gauss points. `rows`: `AngleRows`;
    `remap`: `Remap`; `tables`: `LineTables`. Masses past the cut-off are added to `overturned` (2, velocity cells).
    `basis` (modes,) tells the compiler the modes.
    """
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
    """Add coefficients after the last shear to `out`; masses past the cut-off, to `overturned` (2, velocity cells).

    It does so for places `begin` to `stop` in the order of `AngleRows`; `values` (velocity cells, angle cells, modes,
    modes) are those of `velocity_shear`. `remap`: `Remap`; `tables`: `LineTables`; `basis` (modes,) tells the compiler
    the modes.
    """
    rows, values, remap, tables, out, overturned = borrowed((rows, values, remap, tables, out, overturned))
    for n in range(begin, stop):
        r = rows.order[n]
        _last_angle_row(r, values, rows, remap, tables, out, overturned, basis)


@kernel
def adjoint_last_angle_shear(begin, stop, rows, function, remap, tables, exit_values, out, basis):
    """Write to `out` the values of a function before the last shear by coefficients after it.

    Adjoint of `last_angle_shear`, for places `begin` to `stop` in the order of `AngleRows`: `function` has the space's
    shape, `exit_values` (2,) are those of having passed the cut-off to the left and to the right. `remap`: `Remap`;
    `tables`: `LineTables`. `basis` (modes,) tells the compiler the modes.
    """
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
