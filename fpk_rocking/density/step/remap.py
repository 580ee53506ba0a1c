"""Remaps along mesh lines: the exact L2 projection of functions after a row of lines has moved, as prepared matrices.

A row holds the lines through the Gauss points of one row of cells: the cells that share an interval of the velocity, on
one side of x = 0, or an interval of the angle. A function on a line is given by its values at the line's own Gauss
points. Only what a row's active cells need is prepared.

Beyond each end of the mesh stands an *end cell*, which collects what leaves (`with_end_cells`): cell 0, and the last
one. What passes the outermost cell of a row piles up at the outer end of that cell. Where this is an end cell the mass
has left, and where it is a cell next to x = 0 nothing passes x = 0. So mass is conserved.

Named arguments: `lines` (cells + 1,) of the mesh with its end cells; `bounds`, `source`, `target` (rows, 2), first cell
and one past the last of a row, of its active cells, and of those that these reach; `shifts`, `spreads` (rows, lines),
how far each line moves, and is diffused per node; `nodes`, `weights` (n,) of the diffusion, ascending; `points`,
`point_weights` a Gauss-Legendre rule on [0, 1]; `basis`, a tuple whose length tells the compiler the number of modes.
"""

from typing import NamedTuple

import numpy as np

from fpk_rocking.base.arrays import borrowed, scratch
from fpk_rocking.base.basis import gauss_legendre, legendre_at_gauss_points
from fpk_rocking.base.jit import kernel, run_in_parts
from fpk_rocking.density.step.scatter import FASTMATH, MOST_MODES, legendre_at
from fpk_rocking.density.tuning import TUNING

_line_sums = scratch(1, MOST_MODES)


class Remap(NamedTuple):
    """Matrices of a remap; the index of a target cell c in row r is ``origin[r] + c``, one line may serve all."""

    sources: np.ndarray  # (rows, 2)
    targets: np.ndarray  # (rows, 2)
    origin: np.ndarray  # (rows,)
    first: np.ndarray  # (target cells, lines): first source cell
    count: np.ndarray  # (target cells, lines): number of source cells
    start: np.ndarray  # (target cells, lines): place of the first source cell's block
    blocks: np.ndarray  # (n, modes, modes): from values at the Gauss points of the source to those of the target

    def adjoint(self, sizes, weights):
        """Return the adjoint in L2, a remap from target to source cells; `weights` (modes,) of the Gauss points.

        `sizes` (cells,) are those of all cells, end cells among them.
        """
        origin, lines = origin_of(self.sources), self.first.shape[1]
        # Targets and source cells of a block; both ascend together, so that those of a source cell are consecutive.
        entry = np.repeat(np.arange(self.count.size), self.count.ravel())
        cell, line = np.divmod(entry, lines)
        row = np.repeat(np.arange(len(self.targets)), np.diff(self.targets).ravel())[cell]
        target = cell - self.origin[row]
        source = self.first.ravel()[entry] + np.arange(len(entry)) - self.start.ravel()[entry]
        place = (origin[row] + source) * lines + line
        order = np.lexsort((target, place))
        count = np.bincount(place, minlength=int(np.diff(self.sources).sum()) * lines)
        start, first = np.cumsum(count) - count, np.zeros_like(count)
        first[count > 0] = target[order][start[count > 0]]
        first, count, start = (part.reshape(-1, lines) for part in (first, count, start))
        masses = np.outer(sizes, weights)
        blocks = self.blocks[order].transpose(0, 2, 1) * masses[target[order], :, None] / masses[source[order], None]
        return Remap(self.targets, self.sources, origin, first, count, start, np.ascontiguousarray(blocks))


def prepare_remap(lines, bounds, shifts, spreads, nodes, weights, degree, source):
    """Return the `Remap` of rows of cells whose lines shift and are diffused by Gauss-Hermite nodes, exactly."""
    target = target_range(lines, bounds, shifts, spreads, nodes, source)
    origin = origin_of(target)
    first, count = source_cells(lines, bounds, shifts, spreads, nodes, source, target, origin)
    start = (np.cumsum(count.ravel()) - count.ravel()).reshape(count.shape)
    points, point_weights = gauss_legendre(degree + 1)
    blocks = np.zeros((int(count.sum()), degree + 1, degree + 1))
    remap = Remap(source, target, origin, first, count, start, blocks)
    basis = (1.0,) * (degree + 1)
    where = lines, bounds, shifts, spreads, nodes, weights, points, point_weights
    seconds = TUNING.seconds_integral * blocks.size
    run_in_parts(fill_blocks, len(source), *where, remap, basis, seconds=seconds)
    values = legendre_at_gauss_points(degree + 1, degree)
    moments = values * point_weights[:, None]
    run_in_parts(blocks_to_point_values, len(blocks), moments, values, blocks, basis, seconds=seconds)
    return remap


def with_end_cells(lines):
    """Return mesh lines (cells + 1,) with a cell of size 1 beyond each end."""
    return np.concatenate([[lines[0] - 1.0], lines, [lines[-1] + 1.0]])


def origin_of(ranges):
    """Return the numbers (rows,) of a cell 0 of each row, where the cells of `ranges` (rows, 2) are counted on."""
    sizes = ranges[:, 1] - ranges[:, 0]
    return np.cumsum(sizes) - sizes - ranges[:, 0]


@kernel
def cells_in_interval(lines, bounds, low, high):
    """Return (first, last), the cells of a row within `bounds` (2,) that overlap an interval [low, high]."""
    first = min(max(np.searchsorted(lines, low, side="right") - 1, bounds[0]), bounds[1] - 1)
    last = min(max(np.searchsorted(lines, high, side="left") - 1, bounds[0]), bounds[1] - 1)
    return first, last


@kernel
def target_range(lines, bounds, shifts, spreads, nodes, source):
    """Return the ranges (rows, 2) of cells that sources reach; one row of shifts and spreads may serve all rows."""
    target = np.zeros((len(source), 2), np.int64)
    for r in range(len(source)):
        if source[r, 1] > source[r, 0]:
            row, spread = shifts[min(r, len(shifts) - 1)], spreads[min(r, len(shifts) - 1)].max()
            low = lines[source[r, 0]] + row.min() + spread * nodes[0]
            high = lines[source[r, 1]] + row.max() + spread * nodes[-1]
            first, last = cells_in_interval(lines, bounds[r], low, high)
            target[r, 0], target[r, 1] = first, last + 1
    return target


@kernel
def source_cells(lines, bounds, shifts, spreads, nodes, source, target, origin):
    """Return (first, count), (target cells, lines): first source cell of every target cell, and their number."""
    cells = (target[:, 1] - target[:, 0]).sum()
    first = np.zeros((cells, shifts.shape[1]), np.int64)
    count = np.zeros((cells, shifts.shape[1]), np.int64)
    for r in range(len(source)):
        for c in range(target[r, 0], target[r, 1]):
            for q in range(shifts.shape[1]):
                early, late = spreads[r, q] * nodes[-1], spreads[r, q] * nodes[0]
                low, _ = cells_in_interval(lines, source[r], lines[c] - shifts[r, q] - early, lines[c + 1])
                _, high = cells_in_interval(lines, source[r], lines[0], lines[c + 1] - shifts[r, q] - late)
                # All that passes the outermost cell piles up there.
                low = source[r, 0] if c == bounds[r, 0] else low
                high = source[r, 1] - 1 if c == bounds[r, 1] - 1 else high
                first[origin[r] + c, q], count[origin[r] + c, q] = low, max(high - low + 1, 0)
    return first, count


@kernel
def add_product(start, stop, left, right, low, high, shift, weight, points, point_weights, block, basis):
    """Add to `block` (modes, modes) `weight` times the integrals over [start, stop] of products of shape functions.

    One is of the source cell [left, right], one of the target cell [low, high], moved by `shift`; beyond that cell the
    latter is what it is at the cell's end.
    """
    here_scale, there_scale, modes = 2.0 / (right - left), 2.0 / (high - low), len(basis)
    for q in range(len(points)):
        x = start + points[q] * (stop - start)
        part = 0.5 * there_scale * weight * point_weights[q] * (stop - start)
        here = legendre_at(here_scale * (x - left) - 1.0)
        there = legendre_at(min(max(there_scale * (x + shift - low) - 1.0, -1.0), 1.0))
        for k in range(modes):
            for i in range(modes):
                block[k, i] += part * here[k] * there[i]


@kernel
def fill_blocks(begin, end, lines, bounds, shifts, spreads, nodes, weights, points, point_weights, remap, basis):
    """Integrate products of shape functions over all overlaps, exactly, into the blocks of a `Remap`."""
    lines, bounds, shifts, spreads, nodes, weights, points, point_weights, remap = borrowed(
        (lines, bounds, shifts, spreads, nodes, weights, points, point_weights, remap)
    )
    source, origin, first, start, blocks = remap.sources, remap.origin, remap.first, remap.start, remap.blocks
    for r in range(begin, end):
        for q in range(shifts.shape[1] if source[r, 1] > source[r, 0] else 0):
            for n in range(len(nodes)):
                move = shifts[r, q] + spreads[r, q] * nodes[n]
                for cell in range(source[r, 0], source[r, 1]):
                    left, right = lines[cell], lines[cell + 1]
                    nearest, farthest = cells_in_interval(lines, bounds[r], left + move, right + move)
                    for target in range(nearest, farthest + 1):
                        low, high = lines[target], lines[target + 1]
                        enter, leave = min(max(low - move, left), right), min(max(high - move, left), right)
                        block = blocks[start[origin[r] + target, q] + cell - first[origin[r] + target, q]]
                        below = left if target == bounds[r, 0] else enter
                        above = right if target == bounds[r, 1] - 1 else leave
                        for start_at, stop_at in ((enter, leave), (below, enter), (leave, above)):
                            if stop_at > start_at:
                                add_product(
                                    start_at, stop_at, left, right, low, high, move, weights[n], points, point_weights,
                                    block, basis,
                                )  # fmt: skip


@kernel
def blocks_to_point_values(begin, end, moments, values, blocks, basis):
    """Turn the blocks (n, modes, modes) from `begin` to `end`, in place, from moments to values at Gauss points.

    `values` (points, modes) are the shape functions at the points, `moments` the same times the points' weights.
    """
    moments, values, blocks = borrowed((moments, values, blocks))
    modes, half = len(basis), np.empty(values.shape)
    for b in range(begin, end):
        for k in range(modes):
            for i in range(modes):
                total = 0.0
                for m in range(modes):
                    total += moments[k, m] * blocks[b, m, i]
                half[k, i] = total
        for k in range(modes):
            for i in range(modes):
                total = 0.0
                for m in range(modes):
                    total += half[k, m] * values[i, m]
                blocks[b, k, i] = total


@kernel(fastmath=FASTMATH)
def remap_row(r, values, source, target, remap, moved, basis):
    """Write to `moved` the values (cells, lines, modes) of the target cells of row r by `values` of its source cells.

    `source`, `target` (2,): first cell of each and the one after the last, within those that `remap` is prepared for.
    """
    origin, first, count, start, blocks = remap.origin, remap.first, remap.count, remap.start, remap.blocks
    modes, shared = len(basis), first.shape[1] == 1
    base, sums = origin[min(r, len(origin) - 1)], _line_sums()
    for c in range(target[0], target[1]):
        for q in range(modes):
            line = 0 if shared else q
            begin = first[base + c, line]
            low, high = max(begin, source[0]), min(begin + count[base + c, line], source[1])
            block = start[base + c, line] + low - begin
            for i in range(modes):
                sums[0, i] = 0.0
            for s in range(low, high):
                for k in range(modes):
                    value = values[s, q, k]
                    for i in range(modes):
                        sums[0, i] += blocks[block, k, i] * value
                block += 1
            for i in range(modes):
                moved[c, q, i] = sums[0, i]
