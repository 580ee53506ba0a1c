"""Cells that hold something, which alone a step has to move."""

import numpy as np

from fpk_rocking.base.jit import kernel


def with_neighbours(cells):
    """Mark the cells beside marked ones too, so that a growing density does not ask for new ones every time."""
    grown = cells.copy()
    grown[1:] |= cells[:-1]
    grown[:-1] |= cells[1:]
    grown[:, 1:] |= cells[:, :-1]
    grown[:, :-1] |= cells[:, 1:]
    return grown


def meeting(space, cells, other):
    """Mark the cells of another space that meet marked cells (..., angle, velocity) of a space."""
    angle, velocity = (
        (theirs[:-1, None] < own[1:]) & (theirs[1:, None] > own[:-1])
        for theirs, own in zip(other.lines, space.lines, strict=True)
    )
    return angle.astype(np.int32) @ cells @ velocity.T > 0


@kernel
def occupy(coefficients, areas, negligible, active, occupied):
    """Mark the cells that hold more than a mass, and tell whether one of them is not active."""
    (limit, across, modes, _), beyond = coefficients.shape, False
    for i in range(limit):
        for j in range(across):
            least = negligible / areas[i, j]
            for a in range(modes):
                for b in range(modes):
                    if abs(coefficients[i, j, a, b]) > least:
                        occupied[i, j] = True
            beyond |= occupied[i, j] and not active[i, j]
    return beyond
