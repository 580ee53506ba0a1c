"""Clouds of weighted points set down on the nodes of a mesh: positive weights, exact masses, means and covariances.

A point that carries a mass is carried through a step by the nodes of `density.paths`, a cloud of end points with
positive weights. Each end point gives its mass to the four nodes around it with bilinear weights ("hats"), which keep
mass and mean but add the variance (x - a)(b - x) along each axis between the lines a and b. So before it is set down,
the part of a cloud on each side of x = 0 is drawn together about its mean, by as much variance as the hats will add:
mass, mean and covariance arrive as they are, and no weight is ever negative (derived in docs/numerics).
"""

import math

import numpy as np
from numba import prange

from fpk_rocking.density.paths import OVERTURNED_SIDE, trace
from fpk_rocking.jit import kernel
from fpk_rocking.physics.flight import TERMS

_ROUNDS = 4
_LEAST = 0.02
_CHUNKS = 32


@kernel(parallel=True)
def trace_points(x, v, side, start, duration, harmonic, diffusion, restitution, cutoff, nodes, offsets):
    """Carry all nodes of all points through a step.

    Parameters
    ----------
    x, v, side : ndarray, shape (n,)
        The points and their sides (+1, -1).
    start, duration : float
        The step, nondimensional times.
    harmonic, diffusion, restitution, cutoff
        As in `paths.trace`.
    nodes, offsets : ndarray, shape (k, 2)
        Nodes in standard deviations, and as offsets of an undisturbed flight.

    Returns
    -------
    states : ndarray, shape (n, k, 2)
        Angle and velocity at the end.
    codes : ndarray, shape (n, k)
        The side there, +-2 where overturned.
    """
    states, codes = np.empty((len(x), len(nodes), 2)), np.empty((len(x), len(nodes)), np.int32)
    margin = np.abs(offsets[:, 0]).max()
    for c in prange(_CHUNKS):
        scratch = np.empty((6, TERMS))
        for p in range(c * len(x) // _CHUNKS, (c + 1) * len(x) // _CHUNKS):
            trace(
                x[p], v[p], side[p], start, duration, harmonic, diffusion, restitution, cutoff, nodes, offsets, margin,
                scratch, states[p], codes[p],
            )  # fmt: skip
    return states, codes


@kernel
def bracket(lines, point):
    """Cell between mesh lines that holds a point, and where in it the point lies, 0 to 1 (held to the ends)."""
    i = min(max(np.searchsorted(lines, point, side="right") - 1, 0), len(lines) - 2)
    return i, min(max((point - lines[i]) / (lines[i + 1] - lines[i]), 0.0), 1.0)


@kernel
def _added(points, weights, lines, variances, offsets):
    """Sum weight times the variance and the displacement that hats add.

    `variances` and `offsets` (lines,) are moments about its node of what a node's mass will stand for.
    """
    variance, offset = 0.0, 0.0
    for k in range(len(points)):
        i, part = bracket(lines, points[k])
        low, high = lines[i] - points[k], lines[i + 1] - points[k]
        mean = (1.0 - part) * (low + offsets[i]) + part * (high + offsets[i + 1])
        square = (1.0 - part) * (low * low + 2.0 * low * offsets[i] + variances[i])
        square += part * (high * high + 2.0 * high * offsets[i + 1] + variances[i + 1])
        variance += weights[k] * (square - mean * mean)
        offset += weights[k] * mean
    return variance, offset


@kernel
def moments(x, v, weights):
    """Mass, mean (x, v) and covariance (xx, xv, vv) of weighted points."""
    total, mx, mv = weights.sum(), (weights * x).sum(), (weights * v).sum()
    mx, mv = mx / total, mv / total
    xx, xv, vv = 0.0, 0.0, 0.0
    for k in range(len(x)):
        a, b = x[k] - mx, v[k] - mv
        xx, xv, vv = xx + weights[k] * a * a, xv + weights[k] * a * b, vv + weights[k] * b * b
    return total, mx, mv, xx / total, xv / total, vv / total


@kernel
def draw_together(x, v, weights, limits, angle, velocity, moved):
    """Draw a cloud together by the variance that setting it down will add.

    Positions change linearly, (x, v) -> (c x + b v, r v) about the mean. Of the velocity's variance as much is taken as
    the cloud has to spare at its covariance, then of the angle's; a cloud on a line or a point is left as it is.

    Parameters
    ----------
    x, v, weights : ndarray, shape (k,)
        The cloud, on one side of x = 0.
    limits : tuple of float
        Range of angles of that side.
    angle, velocity : tuple
        Lines, and the variances and offsets of `_added`, of each axis.
    moved : ndarray, shape (2, k)
        Receives the positions.

    Returns
    -------
    float
        Variance, angle's plus velocity's, that is added in spite of this, times the mass.
    """
    total, mx, mv, xx, xv, vv = moments(x, v, weights)
    spare = xx - xv * xv / vv if vv > 0.0 else 0.0
    narrow = not spare > 1e-12 * xx
    shift_x, shift_v, b, c, r = 0.0, 0.0, 0.0, 1.0, 1.0
    more = 0.0
    for attempt in range(_ROUNDS):
        for k in range(len(x)):
            place = mx + shift_x + b * (v[k] - mv) + c * (x[k] - mx)
            moved[0, k] = min(max(place, limits[0]), limits[1])
            moved[1, k] = mv + shift_v + r * (v[k] - mv)
        (ax, ox), (av, ov) = _added(moved[0], weights, *angle), _added(moved[1], weights, *velocity)
        ax, av = ax / total, av / total
        if narrow:
            return total * (ax + av)
        new_vv = max(vv - av, xv * xv / (xx - _LEAST * spare), _LEAST * vv)
        new_xx = max(xx - ax, xv * xv / new_vv + _LEAST * spare)
        more = total * (ax - (xx - new_xx) + av - (vv - new_vv))
        if attempt < _ROUNDS - 1:
            r = math.sqrt(new_vv / vv)
            c = math.sqrt((new_xx - xv * xv / new_vv) / spare)
            b = xv / new_vv * r - c * xv / vv
            shift_x, shift_v = shift_x - 0.5 * ox / total, shift_v - 0.5 * ov / total
    return more


@kernel
def _share(x, v, mass, lines, velocity_lines, first, place, row, sink):
    """Give a mass to the four nodes around a point; `place` tells where in the row a node already stands."""
    if not (lines[0] <= x <= lines[-1] and velocity_lines[0] <= v <= velocity_lines[-1]):
        sink[2] += mass
        return
    targets, masses, filled = row
    i, along = bracket(lines, x)
    j, across = bracket(velocity_lines, v)
    for corner in range(4):
        right, up = corner // 2, corner % 2
        part = mass * (along if right else 1.0 - along) * (across if up else 1.0 - across)
        node = first + (i + right) * len(velocity_lines) + j + up
        if part > 0.0:
            if place[node] < 0:
                place[node] = filled[0]
                targets[filled[0]], masses[filled[0]] = node, 0.0
                filled[0] += 1
            masses[place[node]] += part


@kernel
def _select(states, codes, weights, code, x, v, parts):
    """Copy the points of a cloud that have a code, and return how many they are."""
    size = 0
    for k in range(len(codes)):
        if codes[k] == code:
            x[size], v[size], parts[size] = states[k, 0], states[k, 1], weights[k]
            size += 1
    return size


@kernel
def _set_down_side(limits, x, v, weights, angle, velocity, first, place, row, sink, moved):
    """Set down what stands on one side of x = 0, and return the variance that is added; see `set_down`."""
    if len(angle[0]) == 0:
        sink[2] += weights.sum()
        return 0.0
    more = draw_together(x, v, weights, limits, angle, velocity, moved)
    for k in range(len(x)):
        _share(moved[0, k], moved[1, k], weights[k], angle[0], velocity[0], first, place, row, sink)
    return more


@kernel
def _set_down_some(
    states, codes, weights, cutoff, left, right, velocity, targets, masses, counts, sinks, more
):  # fmt: skip
    """Set down the clouds of some points, into the last five arguments; see `set_down`."""
    first = 0, len(left[0]) * len(velocity[0])
    place = np.full(first[1] + len(right[0]) * len(velocity[0]), -1, np.int32)
    count = len(weights)
    x, v, parts, moved = np.empty(count), np.empty(count), np.empty(count), np.empty((2, count))
    for p in range(len(codes)):
        row = targets[p], masses[p], counts[p : p + 1]
        for way in range(2):
            side = 2 * way - 1
            size = _select(states[p], codes[p], weights, OVERTURNED_SIDE * side, x, v, parts)
            sinks[p, way] = parts[:size].sum()
            n = _select(states[p], codes[p], weights, side, x, v, parts)
            if n > 0:
                limits = (-cutoff, 0.0) if way == 0 else (0.0, cutoff)
                more[p] += _set_down_side(
                    limits, x[:n], v[:n], parts[:n], left if way == 0 else right, velocity, first[way], place, row,
                    sinks[p], moved[:, :n],
                )  # fmt: skip
        place[targets[p, : counts[p]]] = -1


@kernel(parallel=True)
def set_down(states, codes, weights, cutoff, left, right, velocity):
    """Set down the clouds of all points on the nodes of a mesh.

    Parameters
    ----------
    states, codes : ndarray
        From `trace_points`.
    weights : ndarray, shape (k,)
        Of the nodes of the noise; their sum is 1.
    cutoff : float
        Angle of overturning.
    left, right, velocity : tuple
        Mesh lines of the angle on both sides of x = 0 (none where the mesh does not reach there) and of the velocity;
        with each the variances and offsets of what a node's mass will stand for.

    Returns
    -------
    targets, masses : ndarray, shape (n, 4 k)
        Nodes that a point gives mass to, and how much of its own; `counts` of each row are in use.
    counts : ndarray, shape (n,)
    sinks : ndarray, shape (n, 3)
        What overturned to the left and to the right, and what landed outside the mesh.
    more : ndarray, shape (n,)
        Variance that setting it down adds to the covariance of a cloud, times its mass; see `draw_together`.
    """
    points, count = codes.shape
    targets, masses = np.empty((points, 4 * count), np.int32), np.empty((points, 4 * count))
    counts, sinks, more = np.zeros(points, np.int32), np.zeros((points, 3)), np.zeros(points)
    for c in prange(_CHUNKS):
        low, high = c * points // _CHUNKS, (c + 1) * points // _CHUNKS
        _set_down_some(
            states[low:high], codes[low:high], weights, cutoff, left, right, velocity, targets[low:high],
            masses[low:high], counts[low:high], sinks[low:high], more[low:high],
        )  # fmt: skip
    return targets, masses, counts, sinks, more
