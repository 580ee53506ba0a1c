"""Cells of a mesh as a step takes them: their Gauss points, and by bounds of the motion those that an event can reach.

From the points of the latter begin characteristics; all others are in free flight.
"""

from typing import NamedTuple

import numpy as np

from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion.equation import acceleration_bounds, force_factor


class GaussPoints(NamedTuple):
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
def points_of_cell(i, j, points):
    """Side of cell (i, j), and angles (g,) and velocities (h,) of its Gauss points.

    `points` are the `GaussPoints` of the mesh.
    """
    angle, velocity = points.angle_lines, points.velocity_lines
    x = angle[i] + points.angle_points * (angle[i + 1] - angle[i])
    v = velocity[j] + points.velocity_points * (velocity[j + 1] - velocity[j])
    return (1 if angle[i] + angle[i + 1] > 0.0 else -1), x, v


@kernel
def is_event_free(low, high, slow, fast, side, segment, duration, block, margins):
    """Whether no path from a cell meets an impact in a step of a `duration`, and none past the cut-off may return.

    In folded coordinates the cell is [low, high] in angle and [slow, fast] in velocity; `margins` are what noise adds
    to both. A path that passes the cut-off with a velocity that stays positive is beyond it at the end. `segment` is
    the forcing over the step, of which bounds enter.
    """
    fall, rise = acceleration_bounds(side, segment.force_low, segment.force_high, block)
    least = min(low, low + slow * duration - 0.5 * max(fall, 0.0) * duration * duration)
    most = high + max(fast, 0.0) * duration + 0.5 * max(rise, 0.0) * duration * duration
    if least <= margins[0]:
        return False
    # The pull towards x = 0 is weaker than there by what the angle has gained, times the cosine that turns it.
    fall -= (least - margins[0]) * min(force_factor(0.0, side, block), force_factor(block.cutoff, side, block))
    return most < block.cutoff - margins[0] or slow - max(fall, 0.0) * duration > margins[1]


@kernel
def event_cells(angle_lines, velocity_lines, segment, duration, block, margins):
    """Mark the cells that an event can reach within a step: (angle cells, velocity cells) of bool.

    `margins` are what noise adds to angle and velocity within its `duration`, whose forcing is the `Segment`.
    `angle_lines`, `velocity_lines` are those of the mesh.
    """
    marks = np.empty((len(angle_lines) - 1, len(velocity_lines) - 1), np.bool_)
    for i in range(marks.shape[0]):
        side = 1 if angle_lines[i] + angle_lines[i + 1] > 0.0 else -1
        low, high = min(abs(angle_lines[i]), abs(angle_lines[i + 1])), max(abs(angle_lines[i]), abs(angle_lines[i + 1]))
        for j in range(marks.shape[1]):
            slow, fast = side * velocity_lines[j], side * velocity_lines[j + 1]
            slow, fast = min(slow, fast), max(slow, fast)
            marks[i, j] = not is_event_free(low, high, slow, fast, side, segment, duration, block, margins)
    return marks
