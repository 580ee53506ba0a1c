"""Where the mass of every Gauss point goes in one step: from the ends of its paths to the cells of a mesh.

Cells that no event can reach within the step ("free") share one affine map and need no stored landing; the paths of the
others are those of `density.step.noise_paths`.
"""

from typing import NamedTuple

import numpy as np
from numba import prange

from fpk_rocking.base.jit import kernel
from fpk_rocking.density.step.noise_paths import OVERTURNED_SIDE, trace
from fpk_rocking.physics.motion import TERMS
from fpk_rocking.physics.motion.equation import acceleration_bounds, force_factor

LEFT, RIGHT, LOST, REST = -1, -2, -3, -4
"""Landing cells below zero: overturned to the left, to the right, outside the mesh, at rest."""


class Gauss(NamedTuple):
    """Gauss points of a mesh: its lines, points (g,), (h,) on [0, 1] in a cell, and their weights.

    The tables hold the shape functions there, (g, modes) and (h, modes).
    """

    angle_lines: np.ndarray
    velocity_lines: np.ndarray
    angle_points: np.ndarray
    velocity_points: np.ndarray
    angle_weights: np.ndarray
    velocity_weights: np.ndarray
    angle_table: np.ndarray
    velocity_table: np.ndarray


@kernel
def points_of(i, j, points):
    """Side of a cell, and angles (g,) and velocities (h,) of its Gauss points."""
    angle, velocity = points.angle_lines, points.velocity_lines
    x = angle[i] + points.angle_points * (angle[i + 1] - angle[i])
    v = velocity[j] + points.velocity_points * (velocity[j + 1] - velocity[j])
    return (1 if angle[i] + angle[i + 1] > 0.0 else -1), x, v


@kernel
def free(low, high, slow, fast, side, segment, duration, block, margins):
    """Whether no path from a cell comes to an impact during a step, and none that passes the cut-off may return.

    In folded coordinates the cell is [low, high] in angle and [slow, fast] in velocity; `margins` are what noise adds
    to both. A path that passes the cut-off with a velocity that stays positive is beyond it at the end.
    """
    fall, rise = acceleration_bounds(side, segment.force_low, segment.force_high, block)
    least = min(low, low + slow * duration - 0.5 * max(fall, 0.0) * duration * duration)
    most = high + max(fast, 0.0) * duration + 0.5 * max(rise, 0.0) * duration * duration
    if least <= margins[0]:
        return False
    # The pull towards x = 0 is weaker than there by what the angle has gained, times the cosine that turns it.
    fall -= (least - margins[0]) * min(force_factor(0.0, block), force_factor(block.cutoff, block))
    return most < block.cutoff - margins[0] or slow - max(fall, 0.0) * duration > margins[1]


@kernel
def classify(angle_lines, velocity_lines, segment, duration, block, margins):
    """Mark the cells that an event can reach within a step: (angle cells, velocity cells) of bool."""
    marks = np.empty((len(angle_lines) - 1, len(velocity_lines) - 1), np.bool_)
    for i in range(marks.shape[0]):
        side = 1 if angle_lines[i] + angle_lines[i + 1] > 0.0 else -1
        low, high = min(abs(angle_lines[i]), abs(angle_lines[i + 1])), max(abs(angle_lines[i]), abs(angle_lines[i + 1]))
        for j in range(marks.shape[1]):
            slow, fast = side * velocity_lines[j], side * velocity_lines[j + 1]
            slow, fast = min(slow, fast), max(slow, fast)
            marks[i, j] = not free(low, high, slow, fast, side, segment, duration, block, margins)
    return marks


@kernel
def _trace_cell(i, j, points, segment, block, noise, states, codes):
    scratch = np.empty((4, TERMS))
    side, x, v = points_of(i, j, points)
    for p in range(len(x)):
        for q in range(len(v)):
            trace(x[p], v[q], side, segment, block, noise, scratch, states[p, q], codes[p, q])


@kernel(parallel=True)
def _trace_all(cells, points, segment, block, noise, states, codes):
    for c in prange(len(cells)):
        _trace_cell(cells[c, 0], cells[c, 1], points, segment, block, noise, states[c], codes[c])


def trace_cells(cells, points, segment, block, noise):
    """Trace all nodes of all Gauss points of the given cells.

    Parameters
    ----------
    cells : ndarray, shape (m, 2)
        Angle and velocity index of each cell.
    points : Gauss
    segment : Segment
    block : Body
    noise : Noise

    Returns
    -------
    states : ndarray, shape (m, g, h, n, 2)
        Angle and velocity at the end of the step.
    codes : ndarray, shape (m, g, h, n)
        The side there, +-2 where overturned, 0 at rest.
    """
    shape = len(cells), len(points.angle_points), len(points.velocity_points), len(noise.nodes)
    states, codes = np.empty((*shape, 2)), np.empty(shape, np.int32)
    _trace_all(np.ascontiguousarray(cells), points, segment, block, noise, states, codes)
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
def settle(n, states, codes, angle_grid, velocity_grid, first):
    """Cell of traced state n, below 0 where it is gone; the state becomes its reference coordinates unless it is."""
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
