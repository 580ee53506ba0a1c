"""Where the mass of every Gauss point goes in one step: from the ends of its paths to the cells of a mesh.

Cells that no event can reach within the step ("free") share one affine map and need no stored landing; the paths of the
others are those of `density.step.noise_paths`.
"""

import numpy as np
from numba import prange

from fpk_rocking.base.jit import kernel
from fpk_rocking.density.step.noise_paths import OVERTURNED_SIDE, trace
from fpk_rocking.physics.motion import TERMS

LEFT, RIGHT, LOST, REST = -1, -2, -3, -4
"""Landing cells below zero: overturned to the left, to the right, outside the mesh, at rest."""


@kernel
def free(low, high, slow, fast, side, segment, duration, cutoff, margin):
    """Whether no path from a cell comes within `margin` of an impact or the cut-off during a step.

    In folded coordinates the cell is [low, high] in angle and [slow, fast] in velocity.
    """
    if side > 0:
        fall, rise = 1.0 - segment.force_low, cutoff - 1.0 + segment.force_high
    else:
        fall, rise = 1.0 + segment.force_high, cutoff - 1.0 - segment.force_low
    least = min(low, low + slow * duration - 0.5 * max(fall, 0.0) * duration * duration)
    most = high + max(fast, 0.0) * duration + 0.5 * max(rise, 0.0) * duration * duration
    return least > margin and most < cutoff - margin


@kernel
def classify(angle_lines, velocity_lines, segment, duration, cutoff, margin):
    """Mark the cells that an event can reach within a step: (angle cells, velocity cells) of bool."""
    marks = np.empty((len(angle_lines) - 1, len(velocity_lines) - 1), np.bool_)
    for i in range(marks.shape[0]):
        side = 1 if angle_lines[i] + angle_lines[i + 1] > 0.0 else -1
        low, high = min(abs(angle_lines[i]), abs(angle_lines[i + 1])), max(abs(angle_lines[i]), abs(angle_lines[i + 1]))
        for j in range(marks.shape[1]):
            slow, fast = side * velocity_lines[j], side * velocity_lines[j + 1]
            slow, fast = min(slow, fast), max(slow, fast)
            marks[i, j] = not free(low, high, slow, fast, side, segment, duration, cutoff, margin)
    return marks


@kernel
def _trace_cell(
    i, j, angle_lines, velocity_lines, angle_points, velocity_points, segment, duration, diffusion, restitution,
    cutoff, nodes, offsets, margin, states, codes,
):  # fmt: skip
    scratch = np.empty((4, TERMS))
    side = 1 if angle_lines[i] + angle_lines[i + 1] > 0.0 else -1
    for p in range(len(angle_points)):
        x = angle_lines[i] + angle_points[p] * (angle_lines[i + 1] - angle_lines[i])
        for q in range(len(velocity_points)):
            v = velocity_lines[j] + velocity_points[q] * (velocity_lines[j + 1] - velocity_lines[j])
            trace(
                x, v, side, segment, duration, diffusion, restitution, cutoff, nodes, offsets, margin, scratch,
                states[p, q], codes[p, q],
            )  # fmt: skip


@kernel(parallel=True)
def _trace_all(
    cells, angle_lines, velocity_lines, angle_points, velocity_points, segment, duration, diffusion, restitution,
    cutoff, nodes, offsets, margin, states, codes,
):  # fmt: skip
    for c in prange(len(cells)):
        _trace_cell(
            cells[c, 0], cells[c, 1], angle_lines, velocity_lines, angle_points, velocity_points, segment, duration,
            diffusion, restitution, cutoff, nodes, offsets, margin, states[c], codes[c],
        )  # fmt: skip


def trace_cells(
    cells, angle_lines, velocity_lines, angle_points, velocity_points, segment, duration, diffusion, restitution,
    cutoff, nodes, offsets, margin,
):  # fmt: skip
    """Trace all nodes of all Gauss points of the given cells.

    Parameters
    ----------
    cells : ndarray, shape (m, 2)
        Angle and velocity index of each cell.
    angle_points, velocity_points : ndarray, shape (g,), (h,)
        Gauss points on [0, 1].

    Returns
    -------
    states : ndarray, shape (m, g, h, n, 2)
        Angle and velocity at the end of the step.
    codes : ndarray, shape (m, g, h, n)
        The side there, +-2 where overturned, 0 at rest.
    """
    shape = len(cells), len(angle_points), len(velocity_points), len(nodes)
    states, codes = np.empty((*shape, 2)), np.empty(shape, np.int32)
    _trace_all(
        np.ascontiguousarray(cells), angle_lines, velocity_lines, angle_points, velocity_points, segment, duration,
        diffusion, restitution, cutoff, nodes, offsets, margin, states, codes,
    )  # fmt: skip
    return states, codes


@kernel(borrows=True)
def locate(grid, point):
    """Cell that holds a point and its reference coordinate on [-1, 1]; (LOST, 0) outside the mesh.

    `grid` is (lines, 2 / cell sizes, table, density of the table): the table has the cells of equidistant points, with
    few mesh lines between neighbours.
    """
    lines, scales, table, density = grid
    if not lines[0] <= point < lines[-1]:
        return LOST, 0.0
    i = table[int((point - lines[0]) * density)]
    while point >= lines[i + 1]:
        i += 1
    return i, (point - lines[i]) * scales[i] - 1.0


@kernel(borrows=True, tuned=True)
def _settle(n, states, codes, angle_grid, velocity_grid, first):
    """Cell of traced state n, which becomes its reference coordinates unless it overturned."""
    x, v, code = states[n, 0], states[n, 1], codes[n]
    if abs(code) == OVERTURNED_SIDE:
        return LEFT if code < 0 else RIGHT
    if code == 0:
        return REST
    i, xi = locate(angle_grid, x)
    j, eta = locate(velocity_grid, v)
    if v == 0.0 and code < 0 and j > 0 and velocity_grid[0][j] == 0.0:
        j, eta = j - 1, 1.0
    if i == first and x == 0.0 and code < 0 and i > 0:
        i, xi = i - 1, 1.0
    states[n, 0], states[n, 1] = xi, eta
    return LOST if i < 0 or j < 0 else i * (len(velocity_grid[0]) - 1) + j


@kernel(parallel=True)
def _settle_all(states, codes, angle_grid, velocity_grid, first, cells):
    for n in prange(len(codes)):
        cells[n] = _settle(np.int64(n), states, codes, angle_grid, velocity_grid, first)


def settle_in_cells(states, codes, angle_grid, velocity_grid, first):
    """Turn traced states into cells and, in place, into reference coordinates on [-1, 1].

    Returns
    -------
    ndarray, shape (m, g, g, n)
        Flat cell index, or LEFT, RIGHT, LOST, REST.
    """
    cells = np.empty(codes.shape, np.int32)
    _settle_all(states.reshape(-1, 2), codes.reshape(-1), angle_grid, velocity_grid, first, cells.reshape(-1))
    return cells
