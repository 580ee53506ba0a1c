"""Shifts along mesh lines, prepared: the matrices of exact L2 projections after a row of lines has moved.

A row holds the lines through the Gauss points of one row of cells; functions on a line are given by their values at its
own Gauss points. Only what a row's occupied cells need is prepared.
"""

from typing import NamedTuple

import numpy as np
from numba import prange

from fpk_rocking.base.basis import gauss_legendre, legendre_at_gauss_points
from fpk_rocking.base.jit import kernel
from fpk_rocking.density.step.deposit import CHUNKS, legendre


class Shift(NamedTuple):
    """Matrices of a shift; the index of a target cell c in row r is ``origin[r] + c``, one line may serve all.

    Parameters
    ----------
    origin : ndarray of int, shape (rows,)
        See above.
    first, count, start : ndarray of int, shape (target cells, lines)
        First source cell of a target cell, their number, and the place of the first one's block.
    blocks : ndarray, shape (n, modes, modes)
        Values at the Gauss points of the source before those of the target.
    beyond : ndarray of int, shape (rows, 2)
        Place in `ends` for the lower and the upper end, -1 where nothing passes it.
    ends : ndarray, shape (m, lines, cells, modes)
        Mass that a value at a Gauss point of a cell sends beyond the end, per mass of the lines across.
    """

    origin: np.ndarray
    first: np.ndarray
    count: np.ndarray
    start: np.ndarray
    blocks: np.ndarray
    beyond: np.ndarray
    ends: np.ndarray


def prepare_shift(lines, bounds, shifts, spreads, nodes, weights, degree, source):
    """Integrate what every cell of every row sends to the cells that it lands in, exactly.

    Parameters
    ----------
    lines : ndarray, shape (cells + 1,)
        Mesh lines that cut each line.
    bounds : ndarray of int, shape (rows, 2)
        First cell and the one after the last that a row runs through.
    shifts : ndarray, shape (rows, lines)
        How far each line moves.
    spreads : ndarray, shape (rows, lines)
        What the nodes of each line are multiplied by.
    nodes, weights : ndarray, shape (n,)
        Distribution of further movement, ascending.
    degree : int
        Polynomial degree.
    source : ndarray of int, shape (rows, 2)
        The cells that may hold something: first, and the one after the last.

    Returns
    -------
    Shift
    """
    target = landing_range(lines, bounds, shifts, spreads, nodes, source)
    sizes = target[:, 1] - target[:, 0]
    origin = np.cumsum(sizes) - sizes - target[:, 0]
    first, count = source_cells(lines, shifts, spreads, nodes, source, target, origin)
    start = (np.cumsum(count.ravel()) - count.ravel()).reshape(count.shape)
    beyond = passes_end(lines, bounds, shifts, spreads, nodes, source)
    points, point_weights = gauss_legendre(degree + 1)
    blocks = np.zeros((int(count.sum()), degree + 1, degree + 1))
    ends = np.zeros((int(beyond.max()) + 1, shifts.shape[1], len(lines) - 1, degree + 1))
    shift = Shift(origin, first, count, start, blocks, beyond, ends)
    basis = (1.0,) * (degree + 1)
    fill_blocks(lines, bounds, shifts, spreads, nodes, weights, points, point_weights, source, shift, basis)
    values = legendre_at_gauss_points(degree + 1, degree)
    moments = values * point_weights[:, None]
    to_values(moments, values, blocks, basis)
    return shift._replace(ends=np.einsum("rlck,mk->rlcm", ends, moments))


@kernel
def overlap_range(lines, bounds, low, high):
    """First and last cell that meet an interval inside a row."""
    first = min(max(np.searchsorted(lines, low, side="right") - 1, bounds[0]), bounds[1] - 1)
    last = min(max(np.searchsorted(lines, high, side="left") - 1, bounds[0]), bounds[1] - 1)
    return first, last


@kernel
def landing_range(lines, bounds, shifts, spreads, nodes, source):
    """Cells that each row's occupied cells can reach, (rows, 2): first, and the one after the last."""
    target = np.zeros((len(source), 2), np.int64)
    for r in range(len(source)):
        if source[r, 1] > source[r, 0]:
            row, spread = shifts[min(r, len(shifts) - 1)], spreads[min(r, len(shifts) - 1)].max()
            low = lines[source[r, 0]] + row.min() + spread * nodes[0]
            high = lines[source[r, 1]] + row.max() + spread * nodes[-1]
            first, last = overlap_range(lines, bounds[r], low, high)
            target[r, 0], target[r, 1] = first, last + 1
    return target


@kernel
def source_cells(lines, shifts, spreads, nodes, source, target, origin):
    """First source cell and number of source cells, (target cells, lines), of every target cell."""
    cells = (target[:, 1] - target[:, 0]).sum()
    first = np.zeros((cells, shifts.shape[1]), np.int64)
    count = np.zeros((cells, shifts.shape[1]), np.int64)
    for r in range(len(source)):
        for c in range(target[r, 0], target[r, 1]):
            for q in range(shifts.shape[1]):
                early, late = spreads[r, q] * nodes[-1], spreads[r, q] * nodes[0]
                low, _ = overlap_range(lines, source[r], lines[c] - shifts[r, q] - early, lines[c + 1])
                _, high = overlap_range(lines, source[r], lines[0], lines[c + 1] - shifts[r, q] - late)
                first[origin[r] + c, q], count[origin[r] + c, q] = low, max(high - low + 1, 0)
    return first, count


@kernel
def passes_end(lines, bounds, shifts, spreads, nodes, source):
    """Numbers (rows, 2) for the ends that something passes, -1 for the others."""
    beyond = np.full((len(source), 2), -1, np.int64)
    number = 0
    for r in range(len(source)):
        if source[r, 1] <= source[r, 0]:
            continue
        spread = spreads[r].max()
        if lines[source[r, 0]] + shifts[r].min() + spread * nodes[0] < lines[bounds[r, 0]]:
            beyond[r, 0] = number
            number += 1
        if lines[source[r, 1]] + shifts[r].max() + spread * nodes[-1] > lines[bounds[r, 1]]:
            beyond[r, 1] = number
            number += 1
    return beyond


@kernel
def add_integral(start, stop, left, right, weight, points, point_weights, out):
    """Add the integrals of the shape functions of the cell [left, right] over a part of it, if there is one."""
    for q in range(len(points) if stop > start else 0):
        here = legendre(2.0 * (start + points[q] * (stop - start) - left) / (right - left) - 1.0)
        for k in range(len(out)):
            out[k] += weight * point_weights[q] * (stop - start) * here[k]


@kernel
def add_product(start, stop, left, right, low, high, shift, weight, points, point_weights, block, basis):
    """Add the integrals of products of shape functions of a source and a target cell over a part of the source."""
    here_scale, there_scale, modes = 2.0 / (right - left), 2.0 / (high - low), len(basis)
    for q in range(len(points)):
        x = start + points[q] * (stop - start)
        part = 0.5 * there_scale * weight * point_weights[q] * (stop - start)
        here = legendre(here_scale * (x - left) - 1.0)
        there = legendre(there_scale * (x + shift - low) - 1.0)
        for k in range(modes):
            for i in range(modes):
                block[k, i] += part * here[k] * there[i]


@kernel
def _fill_row(r, lines, bounds, shifts, spreads, nodes, weights, points, point_weights, source, shift, basis):
    origin, first, _, start, blocks, beyond, ends = shift
    floor, top = lines[bounds[r, 0]], lines[bounds[r, 1]]
    for q in range(shifts.shape[1] if source[r, 1] > source[r, 0] else 0):
        for n in range(len(nodes)):
            move = shifts[r, q] + spreads[r, q] * nodes[n]
            for cell in range(source[r, 0], source[r, 1]):
                left, right = lines[cell], lines[cell + 1]
                low, high = overlap_range(lines, bounds[r], left + move, right + move)
                for target in range(low, high + 1):
                    begin, stop = max(left, lines[target] - move), min(right, lines[target + 1] - move)
                    if stop > begin:
                        place = start[origin[r] + target, q] + cell - first[origin[r] + target, q]
                        add_product(
                            begin, stop, left, right, lines[target], lines[target + 1], move, weights[n], points,
                            point_weights, blocks[place], basis,
                        )  # fmt: skip
                if beyond[r, 0] >= 0:
                    stop = min(right, floor - move)
                    add_integral(
                        left, stop, left, right, weights[n], points, point_weights, ends[beyond[r, 0], q, cell]
                    )
                if beyond[r, 1] >= 0:
                    begin = max(left, top - move)
                    add_integral(
                        begin, right, left, right, weights[n], points, point_weights, ends[beyond[r, 1], q, cell]
                    )


@kernel(parallel=True)
def fill_blocks(lines, bounds, shifts, spreads, nodes, weights, points, point_weights, source, shift, basis):
    """Integrate products of shape functions over all overlaps, exactly, into the blocks and ends of a shift.

    `basis`, a tuple (modes,), tells the compiler the number of modes.
    """
    for r in prange(len(source)):
        _fill_row(
            np.int64(r), lines, bounds, shifts, spreads, nodes, weights, points, point_weights, source, shift, basis
        )


@kernel(borrows=True, tuned=True)
def _block_to_values(b, moments, values, blocks, half, basis):
    modes = len(basis)
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


@kernel(parallel=True)
def to_values(moments, values, blocks, basis):
    """Turn blocks between moments into blocks between values at Gauss points, in place."""
    for chunk in prange(CHUNKS):
        half = np.empty(values.shape)
        for b in range(chunk * len(blocks) // CHUNKS, (chunk + 1) * len(blocks) // CHUNKS):
            _block_to_values(np.int64(b), moments, values, blocks, half, basis)
