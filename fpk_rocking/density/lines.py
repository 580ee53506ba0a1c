"""Free flight without quadrature of the plane: exact shifts along mesh lines, and the noise as exact blurs of them.

The affine flight z -> M z + d is a shear of the angle, a shear of the velocity and the same shear of the angle again,
M = X V X with X = [[1, tanh(t/2)], [0, 1]] and V = [[1, 0], [sinh t, 1]]. A shear moves every line of Gauss points as a
whole, so each is an L2 projection in one dimension, done exactly, and cannot amplify. White noise is a small blur of
the angle with the first and the last shear and one of the velocity after the second: together they have the covariance
of the flight, exactly (derived in docs/theory). Mass is conserved line by line.
"""

import math

import numpy as np
from numba import prange

from fpk_rocking.density.adjoint import shift_lines_back
from fpk_rocking.density.space import Space, gauss, shapes
from fpk_rocking.density.transport import legendre
from fpk_rocking.jit import kernel

BLUR_NODES = 15
"""Gauss-Hermite nodes of the velocity's blur: they end at 6.4 standard deviations, beyond which nothing is sent."""

_FINE_NODES = 3


def hermite(count):
    """Gauss-Hermite nodes in standard deviations and weights, (count,) each."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(count)
    return nodes, weights / weights.sum()


def blur_variances(diffusion, duration):
    """Variances of the velocity's blur and of each of the angle's two blurs (derived in docs/theory)."""
    sinh = math.sinh(duration)
    if duration < 0.1:
        square = duration * duration
        deficit = square / 6.0 * (1.0 - square * (7.0 / 60.0) * (1.0 - square * (31.0 / 294.0)))
    else:
        deficit = 1.0 - duration / sinh
    small = diffusion * math.tanh(0.5 * duration) * deficit
    return diffusion * (sinh + duration * math.cosh(duration)), small


class FreeFlight:
    """Map of densities over one step for the cells of one side that no event can reach.

    Parameters
    ----------
    space : Space
        Source and target.
    side : int
        +1 or -1.
    affine : tuple
        cosh and sinh of the duration, and the shift (2,) of this side.
    diffusion, duration : float
        D and the length of the step.
    """

    def __init__(self, space: Space, side, affine, diffusion, duration):
        _, sinh, (dx, dv) = affine
        first = space.first_positive
        self.columns = slice(first, None) if side > 0 else slice(0, first)
        angle = space.angle_lines[first:] if side > 0 else space.angle_lines[: first + 1]
        velocity = space.velocity_lines
        points, weights = gauss(space.degree + 1)
        shear = math.tanh(0.5 * duration)
        drift = 0.5 * (dx - shear * dv)
        kick, small = blur_variances(diffusion, duration)
        along_angle = shear * _line_points(velocity, points) + drift
        along_velocity = sinh * _line_points(angle, points) + (dv - sinh * drift)
        still, blur, fine = hermite(1), hermite(BLUR_NODES), hermite(_FINE_NODES)
        table = shapes(points, space.degree)
        self.across = table, np.ascontiguousarray((table * weights[:, None]).T)
        self.shear = shift_blocks(angle, along_angle, math.sqrt(small) * fine[0], fine[1], space.degree)
        self.kick = shift_blocks(velocity, along_velocity, *still, space.degree)
        self.blur = shift_blocks(velocity, np.zeros(1), math.sqrt(kick) * blur[0], blur[1], space.degree)
        self.sizes = np.diff(angle), np.diff(velocity)
        self.inner = (side > 0, side < 0)

    def apply(self, coefficients):
        """Return the coefficients of this side after the step, and the masses that passed its four bounds.

        Parameters
        ----------
        coefficients : ndarray, shape (cells of the side, velocity cells, degree + 1, degree + 1)
            Before the step, 0 in the cells that an event can reach.

        Returns
        -------
        coefficients : ndarray, of the same shape
        angle_ends : ndarray, shape (2,)
            What passed the cut-off, at the lower and the upper end. Nothing passes x = 0: what a projection would put
            there is set down at it.
        velocity_ends : ndarray, shape (2,)
            What passed the velocity bound.
        """
        angle, velocity = self.sizes
        leave, press, norms = (False, False), (True, True), (1.0,) * len(self.across[0])
        now, _ = shift_lines(_other_axis(coefficients), self.shear, *self.across, angle, velocity, press, norms)
        now, kicked = shift_lines(_other_axis(now), self.kick, *self.across, velocity, angle, leave, norms)
        now, blurred = shift_lines(now, self.blur, *self.across, velocity, angle, leave, norms)
        now, out = shift_lines(_other_axis(now), self.shear, *self.across, angle, velocity, self.inner, norms)
        return _other_axis(now), out.sum(axis=0), (kicked + blurred).sum(axis=0)

    def apply_adjoint(self, values, worth):
        """Return what a function after the step is worth before it; see `adjoint`.

        Parameters
        ----------
        values : ndarray, shape (cells of the side, velocity cells, degree + 1, degree + 1)
            Coefficients of the function after the step.
        worth : ndarray, shape (3,)
            Of having passed the cut-off to the left, to the right, and the velocity bound.

        Returns
        -------
        ndarray, of the same shape
            Right in the cells that no event can reach.
        """
        left, right, lost = (float(value) for value in worth)
        angle, velocity = self.sizes
        ends, lost, leave, press = (left, right), (lost, lost), (False, False), (True, True)
        norms = (1.0,) * len(self.across[0])
        now = shift_lines_back(_other_axis(values), self.shear, *self.across, angle, self.inner, ends, norms)
        now = shift_lines_back(_other_axis(now), self.blur, *self.across, velocity, leave, lost, norms)
        now = shift_lines_back(now, self.kick, *self.across, velocity, leave, lost, norms)
        now = shift_lines_back(_other_axis(now), self.shear, *self.across, angle, press, ends, norms)
        return _other_axis(now)


def _other_axis(coefficients):
    """Exchange the roles of angle and velocity."""
    return np.ascontiguousarray(coefficients.transpose(1, 0, 3, 2))


def _line_points(lines, points):
    return (lines[:-1, None] + np.diff(lines)[:, None] * points).ravel()


@kernel
def overlap_range(lines, low, high):
    """First and last cell that meet an interval inside the mesh."""
    cells = len(lines) - 1
    first = min(max(np.searchsorted(lines, low, side="right") - 1, 0), cells - 1)
    last = min(max(np.searchsorted(lines, high, side="left") - 1, 0), cells - 1)
    return first, last


def shift_blocks(lines, shifts, nodes, weights, degree):
    """Matrices of the L2 projection after moving the functions on a line, averaged over nodes added to the shift.

    Parameters
    ----------
    lines : ndarray, shape (cells + 1,)
        Mesh lines that cut each line.
    shifts : ndarray, shape (lines,)
        How far each line moves; a single one serves all lines.
    nodes, weights : ndarray, shape (n,)
        Distribution of further movement.
    degree : int
        Polynomial degree.

    Returns
    -------
    first, count : ndarray of int, shape (lines, cells)
        Source cells of each target cell.
    blocks : ndarray, shape (lines, cells, width, degree + 1, degree + 1)
        Source mode before target mode.
    ends : ndarray, shape (lines, 2, cells, degree + 1)
        Mass that each mode sends below and above the mesh.
    """
    first, count = source_cells(lines, shifts, nodes)
    modes = degree + 1
    blocks = np.zeros((len(shifts), len(lines) - 1, int(count.max()), modes, modes))
    ends = np.zeros((len(shifts), 2, len(lines) - 1, modes))
    fill_blocks(lines, shifts, nodes, weights, *gauss(modes), first, blocks, ends)
    return first, count, blocks, ends


@kernel
def source_cells(lines, shifts, nodes):
    """First source cell and number of source cells, (lines, cells), of every target cell."""
    first = np.empty((len(shifts), len(lines) - 1), np.int32)
    count = np.empty_like(first)
    for s in range(len(shifts)):
        for c in range(len(lines) - 1):
            low, _ = overlap_range(lines, lines[c] - shifts[s] - nodes[-1], lines[c + 1])
            _, high = overlap_range(lines, lines[0], lines[c + 1] - shifts[s] - nodes[0])
            first[s, c], count[s, c] = low, high - low + 1
    return first, count


@kernel
def add_integral(start, stop, left, right, weight, points, point_weights, out):
    """Add the integrals of the shape functions of the cell [left, right] over a part of it, if there is one."""
    for q in range(len(points) if stop > start else 0):
        here = legendre(2.0 * (start + points[q] * (stop - start) - left) / (right - left) - 1.0)
        for k in range(len(out)):
            out[k] += weight * point_weights[q] * (stop - start) * here[k]


@kernel(parallel=True)
def fill_blocks(lines, shifts, nodes, weights, points, point_weights, first, blocks, ends):
    """Integrate products of shape functions over all overlaps, exactly; see `shift_blocks`."""
    cells, modes = len(lines) - 1, blocks.shape[3]
    for s in prange(len(shifts)):
        for n in range(len(nodes)):
            shift = shifts[s] + nodes[n]
            for source in range(cells):
                left, right = lines[source], lines[source + 1]
                low, high = overlap_range(lines, left + shift, right + shift)
                for target in range(low, high + 1):
                    start, stop = max(left, lines[target] - shift), min(right, lines[target + 1] - shift)
                    block, here_scale = blocks[s, target, source - first[s, target]], 2.0 / (right - left)
                    there_scale = 2.0 / (lines[target + 1] - lines[target])
                    for q in range(len(points) if stop > start else 0):
                        x = start + points[q] * (stop - start)
                        part = 0.5 * there_scale * weights[n] * point_weights[q] * (stop - start)
                        here = legendre(here_scale * (x - left) - 1.0)
                        there = legendre(there_scale * (x + shift - lines[target]) - 1.0)
                        for k in range(modes):
                            for i in range(modes):
                                block[k, i] += part * here[k] * there[i]
                for end in range(2):
                    start = left if end == 0 else max(left, lines[-1] - shift)
                    stop = right if end == 1 else min(right, lines[0] - shift)
                    add_integral(start, stop, left, right, weights[n], points, point_weights, ends[s, end, source])


@kernel(fastmath={"contract", "reassoc", "nsz"})
def move_line(values, first, count, blocks, moved, norms):
    """Apply the blocks of one line to its values (cells, modes)."""
    modes = len(norms)
    moved[:] = 0.0
    for c in range(len(values)):
        for w in range(count[c]):
            for k in range(modes):
                value = values[first[c] + w, k]
                for i in range(modes):
                    moved[c, i] += blocks[c, w, k, i] * value


@kernel(fastmath={"contract", "reassoc", "nsz"})
def shift_cell(t, data, shift, nodal, modal, sizes, width, pressed, out, left, norms):
    """Move the lines that run through one row of cells; see `shift_lines`."""
    first, count, blocks, ends = shift
    cells, modes = data.shape[0], len(norms)
    values, moved = np.zeros((cells, modes)), np.empty((cells, modes))
    for q in range(modes):
        line = 0 if len(first) == 1 else t * modes + q
        values[:] = 0.0
        for c in range(cells):
            for u in range(modes):
                for k in range(modes):
                    values[c, k] += nodal[q, u] * data[c, u, k]
        move_line(values, first[line], count[line], blocks[line], moved, norms)
        for end in range(2):
            mass = (ends[line, end] * values).sum()
            if pressed[end]:
                edge = legendre(2.0 * end - 1.0)
                for i in range(modes):
                    moved[end * (cells - 1), i] += mass / sizes[end * (cells - 1)] * edge[i]
            else:
                left[end] += mass * modal[0, q] * width
        for c in range(cells):
            for u in range(modes):
                for i in range(modes):
                    out[c, u, i] += modal[u, q] * moved[c, i]


@kernel(parallel=True)
def shift_lines(data, shift, nodal, modal, sizes, across, pressed, norms):
    """Move all lines of a density.

    Parameters
    ----------
    data : ndarray, shape (cells across, cells along, modes across, modes along)
        Coefficients.
    shift : tuple
        From `shift_blocks`; lines are the Gauss points of the cells across.
    nodal, modal : ndarray, shape (modes, modes)
        From modes to values at Gauss points, and back.
    sizes, across : ndarray
        Cell sizes along and across the lines.
    pressed : tuple of bool
        Whether what passes the lower, the upper end is set down at that end instead of leaving.
    norms : tuple, length modes
        Its length tells the compiler the number of modes.

    Returns
    -------
    out : ndarray, shape of `data`
    left : ndarray, shape (cells across, 2)
        Mass that passed the lower and the upper end.
    """
    out, left = np.zeros(data.shape), np.zeros((len(across), 2))
    for t in prange(len(across)):
        shift_cell(t, data[t], shift, nodal, modal, sizes, across[t], pressed, out[t], left[t], norms)
    return out, left
