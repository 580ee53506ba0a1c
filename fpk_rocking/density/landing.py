"""Where the mass of every Gauss point goes in one step: noise carried along the path, through impacts (docs/numerics).

The transition from a point is represented by Gauss-Hermite nodes along the principal axes of its Gaussian covariance.
Each node is a whole path, not an end point: the most probable noise that leads to it is added to the forcing, and the
block is then carried by the exact flow with its own impacts, rest and overturning. Where the path without noise meets
an impact, covariance and noise are those carried through it by the saltation matrix. Cells that no event can reach
within the step ("free") share one affine map and need no stored landing.
"""

import math

import numpy as np
from numba import prange

from fpk_rocking.jit import kernel
from fpk_rocking.physics.flight import IMPACT, TERMS, harmonic_particular, next_event, polynomial, segment_of
from fpk_rocking.physics.gaussian import flight_covariance
from fpk_rocking.physics.transition import advance

LEFT, RIGHT, LOST = -1, -2, -3
"""Landing cells below zero: overturned to the left, to the right, outside the mesh."""

OVERTURNED_SIDE = 2
"""A node's code is its side, times this where its path overturned there."""

_FAST = 2.0


def hermite_nodes(long, short):
    """Gauss-Hermite nodes (n, 2) along the long and the short axis in standard deviations, and weights (n,)."""
    (x, u), (y, w) = np.polynomial.hermite_e.hermegauss(long), np.polynomial.hermite_e.hermegauss(short)
    nodes = np.array([(a, b) for a in x for b in y])
    weights = np.outer(u, w).ravel()
    return nodes, weights / weights.sum()


@kernel
def principal_axes(xx, xv, vv):
    """Principal axes of a covariance, scaled by their standard deviations: long (x, v), short (x, v)."""
    mean, difference = 0.5 * (xx + vv), 0.5 * (xx - vv)
    radius = math.hypot(difference, xv)
    long = mean + radius
    short = max(xx * vv - xv * xv, 0.0) / long
    angle = 0.5 * math.atan2(xv, difference)
    c, s = math.cos(angle), math.sin(angle)
    a, b = math.sqrt(long), math.sqrt(short)
    return a * c, a * s, -b * s, b * c


@kernel
def bend(particular, duration, dx, dv, out):
    """Copy a particular solution, with the cubic added that starts from rest and reaches (dx, dv) after `duration`."""
    for k in range(TERMS):
        out[k] = particular[k]
    out[2] += (3.0 * dx - duration * dv) / (duration * duration)
    out[3] += (duration * dv - 2.0 * dx) / (duration * duration * duration)


@kernel
def through_impact(diffusion, before, after, v, force, side, restitution):
    """Carry the covariance through an impact by the saltation matrix (derived in docs/theory).

    Parameters
    ----------
    diffusion, before, after : float
        D, and the times before and after the impact.
    v, force, side : float, float, int
        Velocity and forcing just before the impact, and the side before it.
    restitution : float
        Velocity ratio e.

    Returns
    -------
    final, early : tuple (xx, xv, vv)
        Covariance at the end, and the part gathered before the impact, taken at it.
    map : tuple (b11, b12, b21, b22)
        Carries a displacement from the impact time to the end.
    """
    kick = ((side + force) - restitution * (force - side)) / v
    c, s = math.cosh(after), math.sinh(after)
    b11, b12, b21, b22 = c * restitution + s * kick, s * restitution, s * restitution + c * kick, c * restitution
    xx, xv, vv = flight_covariance(diffusion, before)
    final_xx, final_xv, final_vv = flight_covariance(diffusion, after)
    final_xx += b11 * b11 * xx + 2.0 * b11 * b12 * xv + b12 * b12 * vv
    final_xv += b11 * b21 * xx + (b11 * b22 + b12 * b21) * xv + b12 * b22 * vv
    final_vv += b21 * b21 * xx + 2.0 * b21 * b22 * xv + b22 * b22 * vv
    return (final_xx, final_xv, final_vv), (xx, xv, vv), (b11, b12, b21, b22)


@kernel
def trace(x, v, side, start, duration, harmonic, diffusion, restitution, cutoff, nodes, scratch, states, codes):
    """Carry all nodes of one point through a step.

    Parameters
    ----------
    x, v, side : float, float, int
        The point.
    start, duration : float
        The step, nondimensional times.
    harmonic : tuple
        Amplitude, frequency and phase of the forcing.
    diffusion, restitution, cutoff : float
        D, e and the angle of overturning.
    nodes : ndarray, shape (n, 2)
        Nodes along the long and the short axis, in standard deviations.
    scratch : ndarray, shape (6, TERMS)
        Overwritten.
    states : ndarray, shape (n, 2)
        Receives angle and velocity at the end.
    codes : ndarray, shape (n,)
        Receives the side at the end, +-2 where the node's path overturned there.
    """
    amplitude, frequency, phase = harmonic
    base, late = scratch[0], scratch[3]
    harmonic_particular(start, amplitude, frequency, phase, base)
    segment = segment_of(base, scratch[1], duration)
    kind, time, _, speed = next_event(x, v, side, segment, 0.0, duration, cutoff)
    rest = duration - time
    fast = kind == IMPACT and abs(speed) > _FAST * math.sqrt(2.0 * diffusion * duration)
    fast = fast and min(time, rest) > 1e-6 * duration
    if fast:
        force, _ = polynomial(segment.force, time)
        final, early, (b11, b12, b21, b22) = through_impact(diffusion, time, rest, speed, force, side, restitution)
        harmonic_particular(start + time, amplitude, frequency, phase, late)
        after_xx, after_xv, after_vv = flight_covariance(diffusion, rest)
    else:
        final = flight_covariance(diffusion, duration)
    long_x, long_v, short_x, short_v = principal_axes(*final)
    long, short = long_x * long_x + long_v * long_v, short_x * short_x + short_v * short_v
    for n in range(len(nodes)):
        a, b = nodes[n]
        xn, vn, sn, end = x, v, side, 0.0
        if fast:
            p = a * long_x / long + (b * short_x / short if b != 0.0 else 0.0)
            q = a * long_v / long + (b * short_v / short if b != 0.0 else 0.0)
            g, h = b11 * p + b21 * q, b12 * p + b22 * q
            bend(base, time, early[0] * g + early[1] * h, early[1] * g + early[2] * h, scratch[2])
            xn, vn, sn, end = advance(
                xn, vn, sn, segment_of(scratch[2], scratch[5], time), 0.0, time, restitution, cutoff
            )
            if end == time:
                bend(late, rest, after_xx * p + after_xv * q, after_xv * p + after_vv * q, scratch[4])
                xn, vn, sn, end = advance(
                    xn, vn, sn, segment_of(scratch[4], scratch[5], rest), 0.0, rest, restitution, cutoff
                )
                end += time
        else:
            bend(base, duration, a * long_x + b * short_x, a * long_v + b * short_v, scratch[2])
            xn, vn, sn, end = advance(
                xn, vn, sn, segment_of(scratch[2], scratch[5], duration), 0.0, duration, restitution, cutoff
            )
        states[n, 0], states[n, 1] = xn, vn
        codes[n] = side if sn == 0 else sn
        if abs(xn) >= cutoff:
            codes[n] = OVERTURNED_SIDE * sn


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
    if fall <= 0.0 and slow < 0.0:
        least = low + slow * duration
    most = high + max(fast, 0.0) * duration + 0.5 * max(rise, 0.0) * duration * duration
    return least > margin and most < cutoff - margin


@kernel
def classify(angle_lines, velocity_lines, start, duration, harmonic, cutoff, margin):
    """Mark the cells that an event can reach within a step: (angle cells, velocity cells) of bool."""
    amplitude, frequency, phase = harmonic
    particular, force = np.empty(TERMS), np.empty(TERMS)
    harmonic_particular(start, amplitude, frequency, phase, particular)
    segment = segment_of(particular, force, duration)
    marks = np.empty((len(angle_lines) - 1, len(velocity_lines) - 1), np.bool_)
    for i in range(marks.shape[0]):
        side = 1 if angle_lines[i] + angle_lines[i + 1] > 0.0 else -1
        low, high = min(abs(angle_lines[i]), abs(angle_lines[i + 1])), max(abs(angle_lines[i]), abs(angle_lines[i + 1]))
        for j in range(marks.shape[1]):
            slow, fast = side * velocity_lines[j], side * velocity_lines[j + 1]
            slow, fast = min(slow, fast), max(slow, fast)
            marks[i, j] = not free(low, high, slow, fast, side, segment, duration, cutoff, margin)
    return marks


@kernel(parallel=True)
def trace_cells(
    cells, angle_lines, velocity_lines, angle_points, velocity_points, start, duration, harmonic, diffusion,
    restitution, cutoff, nodes,
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
        The side there, +-2 where overturned.
    """
    shape = len(cells), len(angle_points), len(velocity_points), len(nodes)
    states, codes = np.empty((*shape, 2)), np.empty(shape, np.int32)
    for c in prange(len(cells)):
        scratch = np.empty((6, TERMS))
        i, j = cells[c]
        side = 1 if angle_lines[i] + angle_lines[i + 1] > 0.0 else -1
        for p in range(len(angle_points)):
            x = angle_lines[i] + angle_points[p] * (angle_lines[i + 1] - angle_lines[i])
            for q in range(len(velocity_points)):
                v = velocity_lines[j] + velocity_points[q] * (velocity_lines[j + 1] - velocity_lines[j])
                trace(
                    x, v, side, start, duration, harmonic, diffusion, restitution, cutoff, nodes, scratch,
                    states[c, p, q], codes[c, p, q],
                )  # fmt: skip
    return states, codes


@kernel
def locate(grid, point):
    """Cell that holds a point and its reference coordinate on [-1, 1]; (LOST, 0) outside the mesh.

    `grid` is (lines, 2 / cell sizes, table, density of the table): the table has the cells of equidistant points, with
    at most one mesh line between neighbours.
    """
    lines, scales, table, density = grid
    if not lines[0] <= point < lines[-1]:
        return LOST, 0.0
    i = table[int((point - lines[0]) * density)]
    i += point >= lines[i + 1]
    return i, (point - lines[i]) * scales[i] - 1.0


@kernel(parallel=True)
def settle_in_cells(states, codes, angle_grid, velocity_grid, first):
    """Turn traced states into cells and, in place, into reference coordinates on [-1, 1].

    Returns
    -------
    ndarray, shape (m, g, g, n)
        Flat cell index, or LEFT, RIGHT, LOST.
    """
    across = len(velocity_grid[0]) - 1
    cells = np.empty(codes.shape, np.int32)
    flat_states, flat_codes, flat_cells = states.reshape(-1, 2), codes.reshape(-1), cells.reshape(-1)
    for n in prange(len(flat_codes)):
        if abs(flat_codes[n]) == OVERTURNED_SIDE:
            flat_cells[n] = LEFT if flat_codes[n] < 0 else RIGHT
            continue
        x, v = flat_states[n]
        i, xi = locate(angle_grid, x)
        j, eta = locate(velocity_grid, v)
        if i == first and x == 0.0 and flat_codes[n] < 0 and i > 0:
            i, xi = i - 1, 1.0
        flat_cells[n] = LOST if i < 0 or j < 0 else i * across + j
        flat_states[n, 0], flat_states[n, 1] = xi, eta
    return cells
