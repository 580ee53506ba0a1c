"""The paths of the cells that an event can reach: from each of their Gauss points, between displaced states.

A density on the mesh is one of states that are displaced a little from the real ones (`free_flight`); paths are
followed from real states to real ones.
"""

import numpy as np

from fpk_rocking.base.arrays import borrowed, scratch
from fpk_rocking.base.jit import kernel, run_in_parts
from fpk_rocking.density.step.characteristics import trace_point, write_end
from fpk_rocking.density.step.dynamics import points_of_cell
from fpk_rocking.density.tuning import TUNING
from fpk_rocking.physics.motion import TERMS
from fpk_rocking.physics.motion.equation import (
    acceleration,
    acceleration_gradient,
    dispatch_on_block,
    force_factor,
    value_and_slope,
)

_four_polynomials = scratch(4, TERMS)


@kernel(inline="always")
def _slender_displaced(x, v, side, time, displacement, segment, block):  # noqa: ARG001
    """Return (x, v), the angle and velocity of a slender block, as they are; no other argument is used."""
    return x, v


@kernel
def _exact_displaced(x, v, side, time, displacement, segment, block):
    """Return (x, v), angle and velocity of an exact block on `side`, ±1, displaced at a `time` of a `Segment`.

    `displacement` is that of `displaced`, a square of a time; `block` is a `KernelBlock`. All are nondimensional.
    """
    u, (force, slope) = side * x, value_and_slope(segment.force, time)
    excess = acceleration(u, side, force, block) - acceleration(0.0, side, force, block) - u
    gradient = acceleration_gradient(u, side, force, block) - 1.0
    rise = slope * (force_factor(u, side, block) - force_factor(0.0, side, block))
    return x - side * displacement * excess, v + displacement * (v * gradient + rise)


displaced = dispatch_on_block(_slender_displaced, _exact_displaced)
"""State (x, v) on a side, plus `displacement` times (-c, v ∂c/∂x + ∂c/∂t) of an exact block at a `time` of a `Segment`.

`c` is the acceleration less that of the affine flights, see `free_flight`. States of the mesh are the real ones less
this at duration²/24.
"""


@kernel
def _trace_cell(i, j, points, segment, block, noise, displacement, ends, flags):
    """Write `ends` (g, h, n, 2) and `flags` (g, h, n) of the paths of cell (i, j), see `trace_cells`.

    They are angle and velocity at the end, and the side there or an `Exit`, for g, h Gauss points and n nodes of the
    noise. `points`: `GaussPoints`; `segment`: the forcing over the step, a `Segment`; `block`: a `KernelBlock`;
    `noise`: the `Noise` in it; `displacement`: as of `trace_cells`.
    """
    scratch, (side, x, v) = _four_polynomials(), points_of_cell(i, j, points)
    for p in range(len(x)):
        for q in range(len(v)):
            xp, vq = displaced(x[p], v[q], side, 0.0, displacement, segment, block)
            trace_point(xp, vq, side, segment, block, noise, scratch, ends[p, q], flags[p, q])
            if displacement > 0.0:
                _displace_back(segment, block, noise.duration, displacement, ends[p, q], flags[p, q])


@kernel
def _displace_back(segment, block, duration, displacement, ends, flags):
    """Replace the real `ends` (n, 2) of paths, in place, by states of the mesh, where `flags` (n,) are a side, ±1.

    `displacement`, the squared time ≥ 0 that `trace_cells` has added, is taken off here, see `displaced`. `block`: a
    `KernelBlock`. `segment` is the forcing over the step of a `duration`, a `Segment`. What is past the cut-off then
    has overturned: its flag becomes an `Exit`. Rows with other flags stay.
    """
    for n in range(len(ends)):
        side = flags[n]
        if abs(side) == 1:
            x, v = displaced(ends[n, 0], ends[n, 1], side, duration, -displacement, segment, block)
            write_end(n, x, v, side, side, block.cutoff, ends, flags)


@kernel
def _trace_all(begin, end, cells, points, segment, block, noise, displacement, ends, flags):
    """Write the ends and flags of the paths of the cells from number `begin` to `end`, see `trace_cells`.

    `cells` (m, 2) are their indices, `ends` (m, g, h, n, 2) and `flags` (m, g, h, n) are written. `points`:
    `GaussPoints`; `segment`: the forcing over the step, a `Segment`; `noise`: the `Noise` in it; the others as of
    `trace_cells`.
    """
    cells, points, segment, noise, ends, flags = borrowed((cells, points, segment, noise, ends, flags))
    for c in range(begin, end):
        _trace_cell(cells[c, 0], cells[c, 1], points, segment, block, noise, displacement, ends[c], flags[c])


def trace_cells(cells, points, segment, block, noise, displacement=0.0):
    """Return the ends of the characteristics of all Gauss points of some cells, one for each node of the noise.

    Parameters
    ----------
    cells : ndarray, shape (m, 2)
        Angle and velocity index of each cell.
    points : GaussPoints
        g points a cell in angle, h in velocity.
    segment : Segment
        The forcing over the step.
    block : KernelBlock
    noise : Noise
        With n nodes.
    displacement : float
        Of states of the mesh from the real ones (`displaced`), at begin and end; the square of a nondimensional time.

    Returns
    -------
    ends : ndarray, shape (m, g, h, n, 2)
        Angle and velocity at the end of the step.
    flags : ndarray of int, shape (m, g, h, n)
        The side there, -1 or 1, or an `Exit`, below these.
    """
    shape = len(cells), len(points.angle_points), len(points.velocity_points), len(noise.nodes)
    ends, flags = np.empty((*shape, 2)), np.empty(shape, np.int32)
    parts = np.ascontiguousarray(cells), points, segment, block, noise, displacement, ends, flags
    path = TUNING.seconds_path if block.critical_angle is None else TUNING.seconds_exact_path
    run_in_parts(_trace_all, len(cells), *parts, seconds=path * flags.size)
    return ends, flags
