"""Paths from one point of the phase plane, by the kernel that a step of the density solver has compiled anyway."""

import numpy as np

from fpk_rocking.density.step.dynamics import GaussPoints
from fpk_rocking.density.step.step import trace_cells


def path_ends(x, v, side, segment, block, noise):
    """Ends (n, 2) and flags (n,) at the end of a step for its n nodes, from the one Gauss point of a cell."""
    # The tables are not used; in another order than that of a step the kernel would be compiled once more.
    begin, weight, table = np.zeros(1), np.ones(1), np.ones((2, 2), order="F")
    lines = np.array([x, x + side]), np.array([v, v + 1.0])
    points = GaussPoints(*lines, begin, begin, weight, weight, table, table)
    ends, flags = trace_cells(np.zeros((1, 2), int), points, segment, block, noise)
    return ends[0, 0, 0], flags[0, 0, 0]
