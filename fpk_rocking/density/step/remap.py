"""Remaps along mesh lines: the exact L2 projection of functions after a row of lines has moved, as prepared matrices.

A row holds the lines through the Gauss points of one row of cells: the cells that share an interval of the velocity, on
one side of x = 0, or an interval of the angle. A function on a line is given by its values at the line's own Gauss
points. Only what a row's active cells need is prepared. `remap_rows.py` applies the matrices.
"""

from typing import NamedTuple

import numpy as np

from fpk_rocking.base.arrays import borrowed
from fpk_rocking.base.basis import gauss_legendre, legendre_at_gauss_points
from fpk_rocking.base.jit import kernel, run_in_parts
from fpk_rocking.density.step.targets import legendre_at
from fpk_rocking.density.tuning import TUNING


class Remap(NamedTuple):
    """Matrices of a remap; the index of a target cell c in row r is ``origin[r] + c``, one line may serve all."""

    origin: np.ndarray  # (rows,)
    first: np.ndarray  # (target cells, lines)
    count: np.ndarray  # (target cells, lines)
    start: np.ndarray  # (target cells, lines)
    blocks: np.ndarray  # (n, modes, modes)
    end_places: np.ndarray  # (rows, 2)
    end_masses: np.ndarray  # (m, lines, cells, modes)


def prepare_remap(lines, bounds, shifts, spreads, nodes, weights, degree, source):
    """Return the `Remap` of rows of cells whose lines shift and are diffused by Gauss-Hermite nodes, exactly."""
    target = target_range(lines, bounds, shifts, spreads, nodes, source)
    sizes = target[:, 1] - target[:, 0]
    origin = np.cumsum(sizes) - sizes - target[:, 0]
    first, count = source_cells(lines, shifts, spreads, nodes, source, target, origin)
    start = (np.cumsum(count.ravel()) - count.ravel()).reshape(count.shape)
    end_places = places_of_ends(lines, bounds, shifts, spreads, nodes, source)
    points, point_weights = gauss_legendre(degree + 1)
    blocks = np.zeros((int(count.sum()), degree + 1, degree + 1))
    end_masses = np.zeros((int(end_places.max()) + 1, shifts.shape[1], len(lines) - 1, degree + 1))
    remap = Remap(origin, first, count, start, blocks, end_places, end_masses)
    basis = (1.0,) * (degree + 1)
    where = lines, bounds, shifts, spreads, nodes, weights, points, point_weights, source
    seconds = TUNING.seconds_integral * blocks.size
    run_in_parts(fill_blocks, len(source), *where, remap, basis, seconds=seconds)
    values = legendre_at_gauss_points(degree + 1, degree)
    moments = values * point_weights[:, None]
    run_in_parts(blocks_to_point_values, len(blocks), moments, values, blocks, basis, seconds=seconds)
    return remap._replace(end_masses=np.einsum("rlck,mk->rlcm", end_masses, moments))


@kernel
def cells_in_interval(lines, bounds, low, high):
    """Return (first, last): indices of the first and the last cell of a row that overlap an interval [low, high]."""
    first = min(max(np.searchsorted(lines, low, side="right") - 1, bounds[0]), bounds[1] - 1)
    last = min(max(np.searchsorted(lines, high, side="left") - 1, bounds[0]), bounds[1] - 1)
    return first, last


@kernel
def target_range(lines, bounds, shifts, spreads, nodes, source):
    """Return ranges (rows, 2), first cell and one past the last, of the cells that a remap's sources reach."""
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
def source_cells(lines, shifts, spreads, nodes, source, target, origin):
    """Return (first, count), ints (target cells, lines): first source cell of every target cell, and their number."""
    cells = (target[:, 1] - target[:, 0]).sum()
    first = np.zeros((cells, shifts.shape[1]), np.int64)
    count = np.zeros((cells, shifts.shape[1]), np.int64)
    for r in range(len(source)):
        for c in range(target[r, 0], target[r, 1]):
            for q in range(shifts.shape[1]):
                early, late = spreads[r, q] * nodes[-1], spreads[r, q] * nodes[0]
                low, _ = cells_in_interval(lines, source[r], lines[c] - shifts[r, q] - early, lines[c + 1])
                _, high = cells_in_interval(lines, source[r], lines[0], lines[c + 1] - shifts[r, q] - late)
                first[origin[r] + c, q], count[origin[r] + c, q] = low, max(high - low + 1, 0)
    return first, count


@kernel
def places_of_ends(lines, bounds, shifts, spreads, nodes, source):
    """Return `Remap.end_places`: numbers (rows, 2), from 0 by row, of the ends that sources pass, -1 for the others."""
    places = np.full((len(source), 2), -1, np.int64)
    number = 0
    for r in range(len(source)):
        if source[r, 1] <= source[r, 0]:
            continue
        spread = spreads[r].max()
        if lines[source[r, 0]] + shifts[r].min() + spread * nodes[0] < lines[bounds[r, 0]]:
            places[r, 0] = number
            number += 1
        if lines[source[r, 1]] + shifts[r].max() + spread * nodes[-1] > lines[bounds[r, 1]]:
            places[r, 1] = number
            number += 1
    return places


@kernel
def add_integral(start, stop, left, right, weight, points, point_weights, out):
    """Add to `out` (modes,) `weight` times the integrals over [start, stop] of a cell's shape functions."""
    for q in range(len(points) if stop > start else 0):
        here = legendre_at(2.0 * (start + points[q] * (stop - start) - left) / (right - left) - 1.0)
        for k in range(len(out)):
            out[k] += weight * point_weights[q] * (stop - start) * here[k]


@kernel
def add_product(start, stop, left, right, low, high, shift, weight, points, point_weights, block, basis):
    """Add to `block` (modes, modes) `weight` times the integrals over [start, stop] of products of shape functions."""
    here_scale, there_scale, modes = 2.0 / (right - left), 2.0 / (high - low), len(basis)
    for q in range(len(points)):
        x = start + points[q] * (stop - start)
        part = 0.5 * there_scale * weight * point_weights[q] * (stop - start)
        here = legendre_at(here_scale * (x - left) - 1.0)
        there = legendre_at(there_scale * (x + shift - low) - 1.0)
        for k in range(modes):
            for i in range(modes):
                block[k, i] += part * here[k] * there[i]


@kernel
def _fill_row(r, lines, bounds, shifts, spreads, nodes, weights, points, point_weights, source, remap, basis):
    """Add integrals of row r to `blocks` and `end_masses` of a `Remap`, see `fill_blocks` for the arguments."""
    origin, first, start, blocks = remap.origin, remap.first, remap.start, remap.blocks
    places, masses = remap.end_places, remap.end_masses
    floor, top = lines[bounds[r, 0]], lines[bounds[r, 1]]
    for q in range(shifts.shape[1] if source[r, 1] > source[r, 0] else 0):
        for n in range(len(nodes)):
            move = shifts[r, q] + spreads[r, q] * nodes[n]
            for cell in range(source[r, 0], source[r, 1]):
                left, right = lines[cell], lines[cell + 1]
                low, high = cells_in_interval(lines, bounds[r], left + move, right + move)
                for target in range(low, high + 1):
                    begin, stop = max(left, lines[target] - move), min(right, lines[target + 1] - move)
                    if stop > begin:
                        place = start[origin[r] + target, q] + cell - first[origin[r] + target, q]
                        add_product(
                            begin, stop, left, right, lines[target], lines[target + 1], move, weights[n], points,
                            point_weights, blocks[place], basis,
                        )  # fmt: skip
                if places[r, 0] >= 0:
                    stop = min(right, floor - move)
                    add_integral(
                        left, stop, left, right, weights[n], points, point_weights, masses[places[r, 0], q, cell]
                    )
                if places[r, 1] >= 0:
                    begin = max(left, top - move)
                    add_integral(
                        begin, right, left, right, weights[n], points, point_weights, masses[places[r, 1], q, cell]
                    )


@kernel
def fill_blocks(
    begin, end, lines, bounds, shifts, spreads, nodes, weights, points, point_weights, source, remap, basis
):
    """Integrate products of shape functions over all overlaps, exactly, into blocks and masses of a `Remap`."""
    lines, bounds, shifts, spreads, nodes, weights, points, point_weights, source, remap = borrowed(
        (lines, bounds, shifts, spreads, nodes, weights, points, point_weights, source, remap)
    )
    for r in range(begin, end):
        _fill_row(r, lines, bounds, shifts, spreads, nodes, weights, points, point_weights, source, remap, basis)


@kernel
def _block_to_point_values(b, moments, values, blocks, half, basis):
    """Turn block b of `blocks` (n, modes, modes) from moments to values at Gauss points, in place."""
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


@kernel
def blocks_to_point_values(begin, end, moments, values, blocks, basis):
    """Turn the blocks from `begin` to `end`, in place, from moments to values at Gauss points."""
    moments, values, blocks = borrowed((moments, values, blocks))
    half = np.empty(values.shape)
    for b in range(begin, end):
        _block_to_point_values(b, moments, values, blocks, half, basis)
