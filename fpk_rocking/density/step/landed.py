"""Where traced paths landed: the paths of every source cell in groups by target cell, in blocks of eight.

A group's masses are deposited, or a function collected, with eight paths at once in vector registers (`base.lanes`),
and a target cell is written to once a group instead of once a path.
"""

from typing import NamedTuple

import numpy as np
from numba import prange

from fpk_rocking.base.jit import kernel
from fpk_rocking.base.lanes import WIDTH, load, store, total
from fpk_rocking.base.stack import scratch
from fpk_rocking.density.step.landing import settle

_ROOM = 2.0
"""Room for later cells, over what is needed now: memory that is not written to costs nothing."""

_CHUNKS = 8
"""Parts of the cells, as many threads at most; each counts in a table of its own."""

_MODES = 6
"""Polynomials an axis, at most."""


class Landed(NamedTuple):
    """Paths of m traced cells; the last entries of the arrays may be room that is not in use.

    Parameters
    ----------
    groups : ndarray of int, shape (m + 1,)
        First group of each cell.
    blocks : ndarray of int, shape (g + 1,)
        First block of each group.
    targets : ndarray of int, shape (g,)
        Cell where a group's paths end; below 0 a way out (`landing`).
    places : ndarray of int, shape (b, 8)
        Number of each path within its cell; that of one past the last path fills up a group's last block.
    points : ndarray, shape (2 b, 8)
        Reference coordinates of each block, in angle and in velocity.
    most : int
        Blocks of a cell, at most.
    """

    groups: np.ndarray
    blocks: np.ndarray
    targets: np.ndarray
    places: np.ndarray
    points: np.ndarray
    most: int

    @classmethod
    def nothing(cls):
        """Return what no cell has landed."""
        none = np.zeros(1, np.int64)
        return cls(none, none, np.empty(0, np.int32), np.empty((0, WIDTH), np.int32), np.empty((0, WIDTH)), 0)

    @property
    def cells(self):
        """Number of cells."""
        return len(self.groups) - 1

    @property
    def used(self):
        """Groups and blocks in use."""
        groups = int(self.groups[-1])
        return groups, int(self.blocks[groups])

    @property
    def memory(self):
        """Bytes in use."""
        groups, blocks = self.used
        return self.groups.nbytes + 12 * groups + 20 * WIDTH * blocks

    def reach(self, across, limit):
        """First and last column of the target, (m,) each, in which something landed, of `limit` with `across` cells."""
        groups, _ = self.used
        columns, begins = self.targets[:groups] // across, self.groups[:-1]
        if not groups:
            return begins, begins
        return np.minimum.reduceat(np.where(columns < 0, limit, columns), begins), np.maximum.reduceat(columns, begins)

    def joined(self, states, codes, grids, first):
        """Return these and further cells together.

        Parameters
        ----------
        states, codes : ndarray
            Ends of the paths of the further cells, see `landing.trace_cells`; the states are overwritten.
        grids : tuple
            Of the target in angle and velocity, see `landing.locate`.
        first : int
            First column of the target with x > 0.

        Returns
        -------
        Landed
        """
        if not len(codes):
            return self
        states, codes = states.reshape(len(codes), -1, 2), codes.reshape(len(codes), -1)
        cells, sizes = np.empty(codes.shape, np.int32), np.empty((len(codes), 2), np.int64)
        slots = len(grids[0][1]) * len(grids[1][1]) + 4
        _settle(states, codes, *grids, first, slots, cells, sizes)
        before = self.used
        ends = np.cumsum(sizes, axis=0) + before
        groups, blocks = ends[-1]
        found = self._replace(
            groups=np.append(self.groups, ends[:, 0]),
            blocks=_with_room(self.blocks, before[0] + 1, groups + 1),
            targets=_with_room(self.targets, before[0], groups),
            places=_with_room(self.places, before[1], blocks),
            points=_with_room(self.points, 2 * before[1], 2 * blocks),
            most=max(self.most, int(sizes[:, 1].max())),
        )
        _arrange(cells, states, self.cells, np.ascontiguousarray(ends[:, 1]), slots, *found[:-1])
        return found


def _with_room(array, used, wanted):
    """Return an array whose first entries are those in use, with room for as many as are wanted."""
    if len(array) >= wanted:
        return array
    larger = np.empty((int(_ROOM * wanted), *array.shape[1:]), array.dtype)
    larger[:used] = array[:used]
    return larger


@kernel(parallel=True)
def _settle(states, codes, angle_grid, velocity_grid, first, slots, cells, sizes):
    """Write the cells (m, n) where paths end, their reference coordinates, and numbers (m, 2) of groups and blocks."""
    for chunk in prange(_CHUNKS):
        counts = np.zeros(slots, np.int32)
        for r in range(chunk * len(codes) // _CHUNKS, (chunk + 1) * len(codes) // _CHUNKS):
            for n in range(codes.shape[1]):
                cells[r, n] = settle(n, states[r], codes[r], angle_grid, velocity_grid, first)
                counts[cells[r, n] + 4] += 1
            groups, blocks = 0, 0
            for n in range(codes.shape[1]):
                count = counts[cells[r, n] + 4]
                if count > 0:
                    groups += 1
                    blocks += (count + WIDTH - 1) // WIDTH
                    counts[cells[r, n] + 4] = 0
            sizes[r, 0], sizes[r, 1] = groups, blocks


@kernel(parallel=True)
def _arrange(cells, states, before, ends, slots, groups, blocks, targets, places, points):
    """Write the groups of new cells (m, n), which come after `before` others; `ends` are the ends of their blocks."""
    (count, paths), first = cells.shape, blocks[groups[before]]
    for chunk in prange(_CHUNKS):
        left, place = np.zeros(slots, np.int32), np.zeros(slots, np.int64)
        for r in range(chunk * count // _CHUNKS, (chunk + 1) * count // _CHUNKS):
            for n in range(paths):
                left[cells[r, n] + 4] += 1
            group, block = groups[before + r], first if r == 0 else ends[r - 1]
            for n in range(paths):
                slot = cells[r, n] + 4
                if left[slot] > 0:
                    targets[group], place[slot] = cells[r, n], WIDTH * block
                    group, block = group + 1, block + (left[slot] + WIDTH - 1) // WIDTH
                    blocks[group] = block
                    for k in range(WIDTH * block - 1, place[slot] + left[slot] - 1, -1):
                        places[k // WIDTH, k % WIDTH] = paths
                        points[2 * (k // WIDTH), k % WIDTH] = 0.0
                        points[2 * (k // WIDTH) + 1, k % WIDTH] = 0.0
                    left[slot] = 0
                row, lane = place[slot] // WIDTH, place[slot] % WIDTH
                places[row, lane] = n
                points[2 * row, lane], points[2 * row + 1, lane] = states[r, n, 0], states[r, n, 1]
                place[slot] += 1


_FASTMATH = {"contract", "reassoc", "nsz"}
_C1, _C2, _C3, _C4, _C5 = (np.sqrt(2.0 * k + 1.0).item() for k in range(1, 6))
_ZERO = np.zeros((1, WIDTH))
_polynomials, _sums = scratch(2 * _MODES, WIDTH), scratch(_MODES * _MODES, WIDTH)


@kernel(fastmath=_FASTMATH, borrows=True, forceinline=True)
def _legendre(xi, first, rows):
    """Write `deposit.legendre` at eight points, but for the 1, to rows from `first` on."""
    square = xi * xi
    store(rows, first + 1, _C1 * xi)
    store(rows, first + 2, 0.5 * _C2 * (3.0 * square - 1.0))
    store(rows, first + 3, 0.5 * _C3 * xi * (5.0 * square - 3.0))
    store(rows, first + 4, 0.125 * _C4 * ((35.0 * square - 30.0) * square + 3.0))
    store(rows, first + 5, 0.125 * _C5 * xi * ((63.0 * square - 70.0) * square + 15.0))


@kernel(fastmath=_FASTMATH, borrows=True, tuned=True)
def deposit_group(target, begin, end, points, masses, basis):
    """Add masses (blocks, 8) times the shape functions at the points of a group's blocks to the unknowns of a cell."""
    modes, sums, rows = len(basis), _sums(), _polynomials()
    for k in range(modes * modes):
        store(sums, k, load(_ZERO, 0))
    for b in range(begin, end):
        _legendre(load(points, 2 * b), 0, rows)
        _legendre(load(points, 2 * b + 1), _MODES, rows)
        for i in range(modes):
            part = load(masses, b - begin)
            if i > 0:
                part = part * load(rows, i)
            store(sums, i * modes, load(sums, i * modes) + part)
            for j in range(1, modes):
                store(sums, i * modes + j, load(sums, i * modes + j) + part * load(rows, _MODES + j))
    for k in range(modes * modes):
        target[k] += total(load(sums, k))


@kernel(fastmath=_FASTMATH, borrows=True, tuned=True)
def collect_group(function, begin, end, points, values, basis):
    """Write the values (blocks, 8) of a function, by its coefficients in a cell, at the points of a group's blocks."""
    modes, rows = len(basis), _polynomials()
    for b in range(begin, end):
        _legendre(load(points, 2 * b), 0, rows)
        _legendre(load(points, 2 * b + 1), _MODES, rows)
        value = load(_ZERO, 0)
        for i in range(modes):
            part = load(_ZERO, 0) + function[i * modes]
            for j in range(1, modes):
                part = part + load(rows, _MODES + j) * function[i * modes + j]
            if i > 0:
                part = part * load(rows, i)
            value = value + part
        store(values, b - begin, value)


@kernel
def deposit_landed(values, node_weights, r, landed, buffer, sink, masses, ordered, basis):
    """Deposit cell r of the traced ones; `masses` (n + 1,) and `ordered` (most, 8) are overwritten."""
    n = 0
    for p in range(values.shape[0]):
        for q in range(values.shape[1]):
            for k in range(len(node_weights)):
                masses[n] = values[p, q] * node_weights[k]
                n += 1
    masses[n] = 0.0
    first, last = landed.groups[r], landed.groups[r + 1]
    base = landed.blocks[first]
    for b in range(landed.blocks[last] - base):
        for k in range(WIDTH):
            ordered[b, k] = masses[landed.places[base + b, k]]
    for g in range(first, last):
        target, begin, end = landed.targets[g], landed.blocks[g], landed.blocks[g + 1]
        if target < 0:
            sink[-1 - target] += ordered[begin - base : end - base].sum()
        else:
            deposit_group(buffer[target], begin, end, landed.points, ordered[begin - base :], basis)


@kernel
def collect_landed(function, exit_values, node_weights, r, landed, values, found, ordered, basis):
    """Mean value over the nodes of every Gauss point of cell r: the transpose of `deposit_landed`."""
    first, last = landed.groups[r], landed.groups[r + 1]
    base = landed.blocks[first]
    for g in range(first, last):
        target, begin, end = landed.targets[g], landed.blocks[g], landed.blocks[g + 1]
        if target < 0:
            ordered[begin - base : end - base] = exit_values[-1 - target]
        else:
            collect_group(function[target], begin, end, landed.points, ordered[begin - base :], basis)
    for b in range(landed.blocks[last] - base):
        for k in range(WIDTH):
            found[landed.places[base + b, k]] = ordered[b, k]
    n = 0
    for p in range(values.shape[0]):
        for q in range(values.shape[1]):
            values[p, q] = 0.0
            for k in range(len(node_weights)):
                values[p, q] += node_weights[k] * found[n]
                n += 1
