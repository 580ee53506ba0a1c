"""Scatter of a step's paths to unknowns (Lagrange-Galerkin projection), and the gather that is its adjoint.

Every Gauss point of the source mesh adds its mass, times the test functions, where its paths end. The adjoint gives a
Gauss point the mean of a function over the ends of its paths. A test holds the operator against one assembled from
scikit-fem's evaluation. Source columns are split into a fixed number of chunks, each with a buffer of its own, and the
buffers are added in a fixed order; a gather writes to no place twice: neither depends on the number of threads.

The paths of a source cell are kept in groups by target, in blocks of eight. With eight paths at once in vector
registers (`base.arrays`) a group's masses are scattered to the unknowns of its target, or a function is gathered from
there; a target is written to once a group instead of once a path.

Named arguments: `basis`, a tuple whose length tells the compiler the number of modes; both searches, the `CellSearch`
of the target mesh in angle and velocity; `buffer` (target cells, modes²), its unknowns; `absorbed` (3 or 4,), masses by
`Exit`: left, right, truncated, at rest; `first_positive`, the first column of the target mesh with x > 0; `slots`, the
number of its cells and of exits.
"""

import math
from typing import NamedTuple

import numpy as np

from fpk_rocking.base.arrays import WIDTH, borrowed, load, own, scratch, store, total
from fpk_rocking.base.jit import kernel, run_in_parts
from fpk_rocking.density.step import Exit
from fpk_rocking.density.step.dynamics import points_of_cell
from fpk_rocking.density.tuning import TUNING
from fpk_rocking.physics.motion.flight import apply_affine

FASTMATH = {"contract", "reassoc", "nsz"}
"""Rounding that the compiler may change in sums of products; nan and inf stay what they are."""

MOST_MODES = 6
"""Legendre polynomials an axis, at most: degree 5."""

_EXITS = -Exit.REST.value
"""Entries before the first cell of a table by target: exits are negative."""

_ZEROS = np.zeros((1, WIDTH))
_polynomials, _sums = scratch(2 * MOST_MODES, WIDTH), scratch(MOST_MODES * MOST_MODES, WIDTH)


class Targets(NamedTuple):
    """Targets of the paths of m source cells; the last entries of the arrays may be spare."""

    groups: np.ndarray  # (m + 1,): first group of each source cell
    blocks: np.ndarray  # (g + 1,): first block of each group
    cells: np.ndarray  # (g,): target cell of each group, or the `Exit` of its paths
    # Number of each path among those of its source cell; the number of paths where a group's last block is filled up.
    paths: np.ndarray  # (b, 8)
    coordinates: np.ndarray  # (2 b, 8): those of each block's paths in their target, -1 to 1, in angle and in velocity
    most: int  # blocks of a source cell, at most

    @classmethod
    def empty(cls):
        """Return the targets of no source cells."""
        none = np.zeros(1, np.int64)
        return cls(none, none, np.empty(0, np.int32), np.empty((0, WIDTH), np.int32), np.empty((0, WIDTH)), 0)

    @property
    def used(self):
        """Numbers (groups, blocks), without spare ones."""
        groups = int(self.groups[-1])
        return groups, int(self.blocks[groups])

    @property
    def nbytes(self):
        """Bytes, without spare entries."""
        groups, blocks = self.used
        return self.groups.nbytes + 12 * groups + 20 * WIDTH * blocks

    def columns(self, across, limit):
        """Return first and last target column (m,) of every source cell; `limit` and -1 where all paths exit."""
        groups, _ = self.used
        columns, begins = self.cells[:groups] // across, self.groups[:-1]
        if not groups:
            return begins, begins
        return np.minimum.reduceat(np.where(columns < 0, limit, columns), begins), np.maximum.reduceat(columns, begins)

    def extended(self, ends, flags, searches, first_positive):
        """Return these targets and those of m further source cells.

        `ends` (m, g, h, n, 2), which are overwritten, and `flags` (m, g, h, n) are those of `step.trace_cells`.
        """
        if not len(flags):
            return self
        ends, flags = ends.reshape(len(flags), -1, 2), flags.reshape(len(flags), -1)
        cells, sizes = np.empty(flags.shape, np.int32), np.empty((len(flags), 2), np.int64)
        slots = len(searches[0].scales) * len(searches[1].scales) + _EXITS
        seconds = TUNING.seconds_deposit * flags.size
        run_in_parts(
            _locate_paths, len(flags), ends, flags, *searches, first_positive, slots, cells, sizes, seconds=seconds
        )
        before = self.used
        limits = np.cumsum(sizes, axis=0) + before
        groups, blocks = limits[-1]
        larger = self._replace(
            groups=np.append(self.groups, limits[:, 0]),
            blocks=_with_spare(self.blocks, before[0] + 1, groups + 1),
            cells=_with_spare(self.cells, before[0], groups),
            paths=_with_spare(self.paths, before[1], blocks),
            coordinates=_with_spare(self.coordinates, 2 * before[1], 2 * blocks),
            most=max(self.most, int(sizes[:, 1].max())),
        )
        where = len(self.groups) - 1, np.ascontiguousarray(limits[:, 1]), slots
        run_in_parts(_group_paths, len(cells), cells, ends, *where, *larger[:-1], seconds=seconds)
        return larger


def _with_spare(array, used, needed):
    """Return an array with room for `needed` rows or more, whose first `used` rows are those of `array`."""
    if len(array) >= needed:
        return array
    larger = np.empty((int(TUNING.spare * needed), *array.shape[1:]), array.dtype)
    larger[:used] = array[:used]
    return larger


@kernel(forceinline=True)
def locate_point(search, point):
    """Return the cell that holds a point of an axis, and its place there, -1 to 1; else (TRUNCATED, 0)."""
    lines, scales = search.lines, search.scales
    if not lines[0] <= point < lines[-1]:
        return Exit.TRUNCATED.value, 0.0
    i = search.table[int((point - lines[0]) * search.density)]
    while point >= lines[i + 1]:
        i += 1
    return i, (point - lines[i]) * scales[i] - 1.0


@kernel(forceinline=True)
def locate_path(n, ends, flags, angle_search, velocity_search, first_positive):
    """Return the target cell of path n, or its `Exit`; change its end, in `ends` (n, 2), to coordinates there."""
    x, v, flag = ends[n, 0], ends[n, 1], flags[n]
    if flag < -1:
        return flag
    i, xi = locate_point(angle_search, x)
    j, eta = locate_point(velocity_search, v)
    if v == 0.0 and flag < 0 and j > 0 and velocity_search.lines[j] == 0.0:
        j, eta = j - 1, 1.0
    if i == first_positive and x == 0.0 and flag < 0 and i > 0:
        i, xi = i - 1, 1.0
    ends[n, 0], ends[n, 1] = xi, eta
    return Exit.TRUNCATED.value if i < 0 or j < 0 else i * len(velocity_search.scales) + j


@kernel
def _locate_paths(begin, end, ends, flags, angle_search, velocity_search, first_positive, slots, cells, sizes):
    """Write the target cells or exits of paths to `cells` (m, n), of groups and blocks to `sizes` (m, 2).

    The paths' `ends` (m, n, 2) become coordinates in these cells; `flags` (m, n) are their sides or exits.
    """
    ends, flags, angle_search, velocity_search, cells, sizes = borrowed(
        (ends, flags, angle_search, velocity_search, cells, sizes)
    )
    counts = np.zeros(slots, np.int32)
    for r in range(begin, end):
        for n in range(flags.shape[1]):
            cells[r, n] = locate_path(n, ends[r], flags[r], angle_search, velocity_search, first_positive)
            counts[cells[r, n] + _EXITS] += 1
        groups, blocks = 0, 0
        for n in range(flags.shape[1]):
            count = counts[cells[r, n] + _EXITS]
            if count > 0:
                groups += 1
                blocks += (count + WIDTH - 1) // WIDTH
                counts[cells[r, n] + _EXITS] = 0
        sizes[r, 0], sizes[r, 1] = groups, blocks


@kernel
def _group_paths(begin, end, cells, coordinates, before, ends, slots, groups, blocks, targets, paths, points):
    """Write the arrays of a `Targets` for further source cells `begin` to `end`, after `before` others.

    `cells` (m, n) and `coordinates` (m, n, 2) are those of the paths, `ends` (m,) the ends of the source cells' blocks.
    """
    cells, coordinates, ends, groups, blocks, targets, paths, points = borrowed(
        (cells, coordinates, ends, groups, blocks, targets, paths, points)
    )
    nodes, first = cells.shape[1], blocks[groups[before]]
    remaining, place = np.zeros(slots, np.int32), np.zeros(slots, np.int64)
    for r in range(begin, end):
        for n in range(nodes):
            remaining[cells[r, n] + _EXITS] += 1
        group, block = groups[before + r], first if r == 0 else ends[r - 1]
        for n in range(nodes):
            slot = cells[r, n] + _EXITS
            if remaining[slot] > 0:
                targets[group], place[slot] = cells[r, n], WIDTH * block
                group, block = group + 1, block + (remaining[slot] + WIDTH - 1) // WIDTH
                blocks[group] = block
                for k in range(WIDTH * block - 1, place[slot] + remaining[slot] - 1, -1):
                    paths[k // WIDTH, k % WIDTH] = nodes
                    points[2 * (k // WIDTH), k % WIDTH] = 0.0
                    points[2 * (k // WIDTH) + 1, k % WIDTH] = 0.0
                remaining[slot] = 0
            row, lane = place[slot] // WIDTH, place[slot] % WIDTH
            paths[row, lane] = n
            points[2 * row, lane], points[2 * row + 1, lane] = coordinates[r, n, 0], coordinates[r, n, 1]
            place[slot] += 1


def _legendre(xi):
    """Return Legendre polynomials 0 to 5 at `xi` in [-1, 1], a number or `Lanes`, orthonormal on the unit interval."""
    square = xi * xi
    p2 = 0.5 * math.sqrt(5.0) * (3.0 * square - 1.0)
    p3 = 0.5 * math.sqrt(7.0) * xi * (5.0 * square - 3.0)
    p4 = 0.375 * ((35.0 * square - 30.0) * square + 3.0)
    p5 = 0.125 * math.sqrt(11.0) * xi * ((63.0 * square - 70.0) * square + 15.0)
    return 1.0, math.sqrt(3.0) * xi, p2, p3, p4, p5


legendre_at = kernel(fastmath={"contract"})(_legendre)
_legendre_in_lanes = kernel(fastmath=FASTMATH, forceinline=True)(_legendre)


@kernel(fastmath=FASTMATH, forceinline=True)
def _store_polynomials(points, b, rows):
    """Write polynomials 1 to 5 of the paths of block b to `rows` (2 `MOST_MODES`, 8): of angle, and then velocity."""
    for axis in range(2):
        _, p1, p2, p3, p4, p5 = _legendre_in_lanes(load(points, 2 * b + axis))
        first = axis * MOST_MODES
        store(rows, first + 1, p1)
        store(rows, first + 2, p2)
        store(rows, first + 3, p3)
        store(rows, first + 4, p4)
        store(rows, first + 5, p5)


@kernel(fastmath=FASTMATH)
def scatter_group(target, begin, end, points, masses, basis):
    """Add `masses` (blocks, 8) times the shape functions at `points` (2 blocks, 8) to `target` (modes²,)."""
    modes, sums, rows = len(basis), _sums(), _polynomials()
    for k in range(modes * modes):
        store(sums, k, load(_ZEROS, 0))
    for b in range(begin, end):
        _store_polynomials(points, b, rows)
        for i in range(modes):
            part = load(masses, b - begin)
            if i > 0:
                part = part * load(rows, i)
            store(sums, i * modes, load(sums, i * modes) + part)
            for j in range(1, modes):
                store(sums, i * modes + j, load(sums, i * modes + j) + part * load(rows, MOST_MODES + j))
    for k in range(modes * modes):
        target[k] += total(load(sums, k))


@kernel(fastmath=FASTMATH)
def gather_group(function, begin, end, points, values, basis):
    """Write a function of coefficients `function` (modes²,) at `points` (2 blocks, 8) to `values` (blocks, 8)."""
    modes, rows = len(basis), _polynomials()
    for b in range(begin, end):
        _store_polynomials(points, b, rows)
        value = load(_ZEROS, 0)
        for i in range(modes):
            part = load(_ZEROS, 0) + function[i * modes]
            for j in range(1, modes):
                part = part + load(rows, MOST_MODES + j) * function[i * modes + j]
            if i > 0:
                part = part * load(rows, i)
            value = value + part
        store(values, b - begin, value)


@kernel
def scatter_cell(values, node_weights, r, targets, buffer, absorbed, masses, ordered, basis):
    """Scatter masses `values` (g, h) of source cell r; `masses` (g h n + 1,), `ordered` (most, 8) are overwritten."""
    n = 0
    for p in range(values.shape[0]):
        for q in range(values.shape[1]):
            for k in range(len(node_weights)):
                masses[n] = values[p, q] * node_weights[k]
                n += 1
    masses[n] = 0.0
    first, last = targets.groups[r], targets.groups[r + 1]
    base = targets.blocks[first]
    for b in range(targets.blocks[last] - base):
        for k in range(WIDTH):
            ordered[b, k] = masses[targets.paths[base + b, k]]
    for g in range(first, last):
        target, begin, end = targets.cells[g], targets.blocks[g], targets.blocks[g + 1]
        if target < 0:
            absorbed[Exit.OVERTURNED_LEFT - target] += ordered[begin - base : end - base].sum()
        else:
            scatter_group(buffer[target], begin, end, targets.coordinates, ordered[begin - base :], basis)


@kernel
def gather_cell(function, exit_values, node_weights, r, targets, values, path_values, ordered, basis):
    """Write means of a function at the paths' ends of source cell r to `values` (g, h): adjoint of `scatter_cell`.

    `function` (target cells, modes²), `exit_values` (3,); overwritten: `path_values` (g h n + 1,), `ordered` (most, 8).
    """
    first, last = targets.groups[r], targets.groups[r + 1]
    base = targets.blocks[first]
    for g in range(first, last):
        target, begin, end = targets.cells[g], targets.blocks[g], targets.blocks[g + 1]
        if target < 0:
            ordered[begin - base : end - base] = exit_values[Exit.OVERTURNED_LEFT - target]
        else:
            gather_group(function[target], begin, end, targets.coordinates, ordered[begin - base :], basis)
    for b in range(targets.blocks[last] - base):
        for k in range(WIDTH):
            path_values[targets.paths[base + b, k]] = ordered[b, k]
    n = 0
    for p in range(values.shape[0]):
        for q in range(values.shape[1]):
            values[p, q] = 0.0
            for k in range(len(node_weights)):
                values[p, q] += node_weights[k] * path_values[n]
                n += 1


class SourceCells(NamedTuple):
    """Cells of the source, arrays (angle cells, velocity cells)."""

    mask: np.ndarray  # those to scatter
    areas: np.ndarray
    numbers: np.ndarray  # among the traced cells, or -1


class AffinePaths(NamedTuple):
    """Paths of cells without events: affine flights, and the nodes of the noise."""

    cosh: float  # of the duration
    sinh: float
    shifts: np.ndarray  # (3, 2), by side, of angle and velocity
    offsets: np.ndarray  # (n, 2), of angle and velocity
    weights: np.ndarray  # (n,)


class Chunks(NamedTuple):
    """Chunks of a scatter, each of which writes to a buffer of its own."""

    columns: np.ndarray  # (chunks, 4): source columns from, to; target columns from, to
    buffers: np.ndarray  # (chunks, target cells, modes²)
    absorbed: np.ndarray  # (chunks, 3 or 4)


@kernel
def scatter_point(target, amount, xi, eta, basis):
    """Add a mass times the shape functions at (xi, eta), -1 to 1, to `target` (modes²,), unknowns of one cell."""
    modes = len(basis)
    along, across = legendre_at(xi), legendre_at(eta)
    for a in range(modes):
        part = amount * along[a]
        for b in range(modes):
            target[a * modes + b] += part * across[b]


@kernel
def point_masses(cell, area, points, rows, values, basis):
    """Write the masses of the Gauss points of a cell of coefficients `cell` (modes, modes) to `values` (g, h)."""
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
    """Write the L2 projection (modes, modes) of `values` (g, h) at Gauss points to `out`."""
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
    """Add the point masses `values` (g, h) of a cell without events, at x (g,) and v (h,), along affine `paths`."""
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
def scatter(
    begin, end, source, cells, points, targets, affine, angle_search, velocity_search, chunks, source_basis, basis
):
    """Scatter the coefficients `source` of `cells`, `SourceCells`, to the buffers of the `Chunks` begin to end.

    Those with a number have `Targets`, all others are in affine flight.
    """
    source, cells, points, targets, affine, angle_search, velocity_search, chunks = borrowed(
        (source, cells, points, targets, affine, angle_search, velocity_search, chunks)
    )
    across = len(velocity_search.scales)
    owned = (
        np.empty((len(source_basis), len(points.velocity_points))),
        np.empty((len(points.angle_points), len(points.velocity_points))),
        np.empty(len(points.angle_points) * len(points.velocity_points) * len(affine.weights) + 1),
        np.empty((targets.most, WIDTH)),
    )
    rows, values, masses, ordered = borrowed(owned)
    for k in range(begin, end):
        columns, buffer, absorbed = chunks.columns[k], chunks.buffers[k], chunks.absorbed[k]
        absorbed[:] = 0.0
        buffer[columns[2] * across : columns[3] * across] = 0.0
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
                    scatter_affine_cell(
                        values, affine, side, x, v, angle_search, velocity_search, buffer, absorbed, basis
                    )
    own(owned)


@kernel
def sum_buffers(buffers, columns, areas, out):
    """Write the sum of the chunks' buffers over the cells' `areas` to the coefficients `out`."""
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
    """Write coefficients before the step to `out` in source `cells` (m, 2): adjoint of `scatter` where events are.

    `function` (target cells, modes²) are those after it, `exit_values` (3,) those of left, right and truncated.
    """
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
