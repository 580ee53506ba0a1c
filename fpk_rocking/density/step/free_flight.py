"""The step of cells that no event can reach: flight as exact shears along mesh lines, noise as blurs along them.

The affine flight z -> F z + d is a shear of the angle, a shear of the velocity and the same shear of the angle again,
F = X Y X with X = [[1, tanh(t/2)], [0, 1]] and Y = [[1, 0], [sinh t, 1]]. A shear moves every line of Gauss points as a
whole, so each is an L2 projection in one dimension, done exactly, and cannot amplify. White noise is a small blur of
the angle with the first and the last shear and one of the velocity after the second: together they have the covariance
of the flight, exactly (derived in docs/theory). Mass is conserved line by line.

What an exact block has beyond this depends on the angle alone: it is added to the shear of the velocity half way, and
the noise by which lines of different angles differ blurs them there too. The error is of second order in the step.

A density in flight is held by its values at the Gauss points of the cells; its rows are the cells that share an
interval of the velocity, one row for each side of x = 0, or an interval of the angle.
"""

import math

import numpy as np
from numba import prange

from fpk_rocking.base.basis import gauss_hermite, gauss_legendre, legendre_at_gauss_points, legendre_basis
from fpk_rocking.base.jit import kernel
from fpk_rocking.density.space.space import Space
from fpk_rocking.density.step.rows import angle_rows, by_velocity, covered, hulls, order, union
from fpk_rocking.density.step.shifts import landing_range, prepare_shift
from fpk_rocking.physics.motion.block import force_factors, gravity_at_contact, gravity_correction
from fpk_rocking.physics.motion.flight import flight_shears, shear_diffusion_variances

_FINE_NODES = 3
"""Of the angle's blurs, which are far narrower than a cell: moments up to the fifth are exact."""

_SMALL_PART = 0.25
"""Part of the velocity's variance that `_FINE_NODES` may stand for."""

_FASTMATH = {"contract", "reassoc", "nsz"}


class FreeFlight:
    """Map of densities over one step for the cells that no event can reach.

    Parameters
    ----------
    space : Space
        Source and target.
    free : ndarray of bool, shape (angle cells, velocity cells)
        The cells to fly from.
    affine : Affine
    diffusion, duration : float
        D and the length of the step.
    nodes : int
        Gauss-Hermite nodes of the velocity's blur.
    angle_shear : Shift, optional
        The shear of the angle, prepared for all cells (`angle_shear_of`); else it is prepared for those that need it.
    critical_angle : float, optional
        α of an exact block, whose force in `affine` is the part sin α/α of f, the mean of what turns it.
    """

    def __init__(self, space: Space, free, affine, diffusion, duration, nodes, angle_shear=None, critical_angle=None):
        sinh, shifts = flight_shears(duration)[1], affine.shifts
        self.space, self.free = space, free
        (limit, across), middle = free.shape, min(space.first_positive, free.shape[0])
        points, weights = gauss_legendre(space.degree + 1)
        table = legendre_at_gauss_points(space.degree + 1, space.degree)
        self.tables = table, np.ascontiguousarray((table * weights[:, None]).T), weights
        self.edges = legendre_basis([0.0, 1.0], space.degree) @ table.T
        self.sizes = np.diff(space.angle_lines), np.diff(space.velocity_lines)
        sides, angle_shears, drift, fine, fine_weights = _angle_shears(
            space, affine, diffusion * gravity_at_contact(critical_angle) ** 2, duration
        )
        alike = np.ones_like(angle_shears)
        by_side = [shifts[side, 1] - sinh * drift[side] for side in (-1, 1)]
        pushes = np.repeat(by_side, (middle, limit - middle))[:, None]
        angles = _line_points(space.angle_lines, points)
        velocity_shears = sinh * angles + pushes
        if critical_angle:
            away = np.repeat([-1.0, 1.0], (middle, limit - middle))[:, None]
            more = force_factors(angles, critical_angle) / gravity_at_contact(critical_angle) - 1.0
            velocity_shears += sinh * gravity_correction(angles, away, critical_angle) + 0.5 * sum(by_side) * more
        whole, nothing = np.tile([0, across], (limit, 1)), np.zeros((1, 1))

        first = hulls(angle_rows(free, middle))
        drifted = landing_range(space.angle_lines, sides, angle_shears, alike, fine, first)
        second = hulls(by_velocity(covered(drifted, limit)).T)
        variance, (blur, blur_weights) = shear_diffusion_variances(diffusion, duration)[0], gauss_hermite(nodes)
        spreads, (own, own_weights) = np.ones_like(velocity_shears), gauss_hermite(1)
        if critical_angle and diffusion > 0.0 and second.any():
            # The least that all lines are blurred by, and on each of them what it lacks.
            parts = force_factors(angles, critical_angle) ** 2
            held = parts[second[:, 1] > second[:, 0]]
            least, most = held.min(), held.max()
            spreads, variance = np.sqrt(variance * np.maximum(parts - least, 0.0)), variance * least
            own, own_weights = gauss_hermite(_FINE_NODES if most - least <= _SMALL_PART * most else nodes)
        blur, alone = math.sqrt(variance) * blur, np.ones((1, 1))
        sheared = landing_range(space.velocity_lines, whole, velocity_shears, spreads, own, second)
        blurred = landing_range(space.velocity_lines, whole, nothing, alone, blur, sheared)
        third = hulls(angle_rows(covered(blurred, across), middle))
        landed = landing_range(space.angle_lines, sides, angle_shears, alike, fine, third)
        self.ranges = (first, drifted), (second, sheared, blurred), (third, landed)
        self.orders = order(first), order(second), order(third)
        degree, every = space.degree, hulls(covered(sheared, across).any(axis=0)[None])
        self._borrowed = angle_shear is not None
        self.angle_shear = angle_shear or prepare_shift(
            space.angle_lines, sides, angle_shears, alike, fine, fine_weights, degree, union(first, third)
        )
        self.velocity_shear = prepare_shift(
            space.velocity_lines, whole, velocity_shears, spreads, own, own_weights, degree, second
        )
        self.blur = prepare_shift(space.velocity_lines, whole[:1], nothing, alone, blur, blur_weights, degree, every)

    @property
    def memory(self):
        """Bytes of the prepared shifts, one that was given left out."""
        own = (self.velocity_shear, self.blur, *(() if self._borrowed else (self.angle_shear,)))
        return sum(part.nbytes for shift in own for part in shift)

    def apply(self, coefficients, out):
        """Add the density after the step to `out`, and return the masses that passed the bounds.

        Parameters
        ----------
        coefficients : ndarray, shape ``space.shape``
            Before the step; only the free cells are read.
        out : ndarray, shape ``space.shape``
            Coefficients of what else there is after the step.

        Returns
        -------
        ndarray, shape (3,)
            What passed the cut-off to the left and to the right, and the velocity bound. Nothing passes x = 0: what a
            projection would put there is set down at it.
        """
        limit, across, modes, _ = coefficients.shape
        basis = (1.0,) * modes
        drifted, blurred = np.zeros(coefficients.shape), np.zeros((across, limit, modes, modes))
        lost, left = np.zeros(limit), np.zeros((2, across))
        shear_angle(
            coefficients, self.free, self.orders[0], *self.ranges[0], self.angle_shear, self.tables, self.edges,
            self.sizes, drifted, left, basis,
        )  # fmt: skip
        shear_velocity(
            drifted, self.orders[1], *self.ranges[1], self.velocity_shear, self.blur, self.tables, self.sizes, blurred,
            lost, basis,
        )  # fmt: skip
        finish_rows(
            blurred, self.orders[2], *self.ranges[2], self.angle_shear, self.tables, self.edges, self.sizes, out, left,
            basis,
        )  # fmt: skip
        return np.array([left[0].sum(), left[1].sum(), lost.sum()])


def angle_shear_of(space, affine, diffusion, duration):
    """Prepare the shear of the angle for all cells, for flights that differ in a constant force alone.

    A constant force moves the velocity between the two shears of the angle, and neither of these.
    """
    sides, shears, _, fine, weights = _angle_shears(space, affine, diffusion, duration)
    return prepare_shift(space.angle_lines, sides, shears, np.ones_like(shears), fine, weights, space.degree, sides)


def _angle_shears(space, affine, diffusion, duration):
    """Rows, how far their lines move, the part of it that is the forcing's by side, and the nodes of the blur."""
    (limit, across, *_), shifts = space.shape, affine.shifts
    middle, shear = min(space.first_positive, limit), flight_shears(duration)[0]
    small = shear_diffusion_variances(diffusion, duration)[1]
    nodes, weights = gauss_hermite(_FINE_NODES if small > 0.0 else 1)
    drift = {side: 0.5 * (shifts[side, 0] - shear * shifts[side, 1]) for side in (1, -1)}
    along = shear * _line_points(space.velocity_lines, gauss_legendre(space.degree + 1)[0])
    sides = np.repeat([(0, middle), (middle, limit)], across, axis=0)
    return sides, np.concatenate([along + drift[-1], along + drift[1]]), drift, math.sqrt(small) * nodes, weights


def _line_points(lines, points):
    """Gauss points (cells, points) of all cells of a line."""
    return lines[:-1, None] + np.diff(lines)[:, None] * points


@kernel(fastmath=_FASTMATH, tuned=True)
def shift_row(r, values, source, target, shift, moved, basis):
    """Move the lines of row r: values (cells, lines, modes) of its source cells to those of its target cells."""
    origin, first, count, start, blocks, _, _ = shift
    modes, shared = len(basis), first.shape[1] == 1
    base = origin[min(r, len(origin) - 1)]
    for c in range(target[0], target[1]):
        for q in range(modes):
            line = 0 if shared else q
            begin = first[base + c, line]
            low, high = max(begin, source[0]), min(begin + count[base + c, line], source[1])
            block = start[base + c, line] + low - begin
            # Scalars, not an array: a store could alias what is read, and then nothing is vectorized.
            a0, a1, a2, a3, a4, a5 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            for s in range(low, high):
                for k in range(modes):
                    value = values[s, q, k]
                    a0 += blocks[block, k, 0] * value
                    a1 += blocks[block, k, 1] * value
                    if modes > 2:
                        a2 += blocks[block, k, 2] * value
                    if modes > 3:
                        a3 += blocks[block, k, 3] * value
                    if modes > 4:
                        a4 += blocks[block, k, 4] * value
                    if modes > 5:
                        a5 += blocks[block, k, 5] * value
                block += 1
            moved[c, q, 0] = a0
            moved[c, q, 1] = a1
            if modes > 2:
                moved[c, q, 2] = a2
            if modes > 3:
                moved[c, q, 3] = a3
            if modes > 4:
                moved[c, q, 4] = a4
            if modes > 5:
                moved[c, q, 5] = a5


@kernel(fastmath=_FASTMATH)
def mass_beyond(r, end, values, source, shift, masses):
    """Masses of the lines of row r that pass an end, per size of their cells across; whether there are any."""
    place = shift.beyond[min(r, len(shift.beyond) - 1), end]
    if place < 0:
        return False
    ends = shift.ends[place]
    for q in range(len(masses)):
        line = ends[0 if len(ends) == 1 else q]
        masses[q] = 0.0
        for c in range(source[0], source[1]):
            for k in range(len(masses)):
                masses[q] += line[c, k] * values[c, q, k]
    return True


@kernel(fastmath=_FASTMATH)
def set_down(end, masses, target, edges, sizes, moved):
    """Set down at an end of a row what passed it."""
    cell = target[0] if end == 0 else target[1] - 1
    for q in range(len(masses)):
        for i in range(len(masses)):
            moved[cell, q, i] += masses[q] / sizes[cell] * edges[end, i]


@kernel(fastmath=_FASTMATH)
def turn_row(t, moved, target, out, basis):
    """Write row t (cells, lines, modes) where the rows of the other direction find it."""
    for c in range(target[0], target[1]):
        for q in range(len(basis)):
            for i in range(len(basis)):
                out[c, t, i, q] = moved[c, q, i]


@kernel(fastmath=_FASTMATH)
def transform(cell, first, second, out, basis):
    """Apply tables to both axes of a cell and exchange them: out[j, i] = sum of second[j, b] first[i, a] cell[a, b]."""
    modes = len(basis)
    for j in range(modes):
        for i in range(modes):
            out[j, i] = 0.0
    for i in range(modes):
        for b in range(modes):
            part = 0.0
            for a in range(modes):
                part += first[i, a] * cell[a, b]
            for j in range(modes):
                out[j, i] += second[j, b] * part


@kernel
def _shear_angle_row(r, coefficients, free, source, target, shift, tables, edges, sizes, out, left, basis):
    (limit, across), modes = free.shape, len(basis)
    side, j = r // across, r % across
    values, moved, masses = np.zeros((limit, modes, modes)), np.zeros((limit, modes, modes)), np.zeros(modes)
    for c in range(source[0], source[1]):
        if free[c, j]:
            transform(coefficients[c, j], tables[0], tables[0], values[c], basis)
    shift_row(r, values, source, target, shift, moved, basis)
    for end in range(2):
        if mass_beyond(r, end, values, source, shift, masses):
            if end == side:
                left[side, j] += _weighted(masses, tables[2], sizes[1][j])
            else:
                set_down(end, masses, target, edges, sizes[0], moved)
    turn_row(j, moved, target, out, basis)


@kernel(parallel=True)
def shear_angle(coefficients, free, order, sources, targets, shift, tables, edges, sizes, out, left, basis):
    """First shear: from coefficients to values (angle cells, velocity cells, angle, velocity).

    Masses that passed the cut-off, which do not return, are added to `left` (2, velocity cells).
    """
    for n in prange(len(order)):
        r = order[n]
        _shear_angle_row(r, coefficients, free, sources[r], targets[r], shift, tables, edges, sizes, out, left, basis)


@kernel
def _weighted(masses, weights, size):
    total = 0.0
    for q in range(len(masses)):
        total += masses[q] * weights[q]
    return total * size


@kernel
def _shear_velocity_row(c, values, source, sheared, blurred, velocity_shear, blur, tables, size, out, basis):
    """Shear one row; return the mass that left."""
    (across, modes, _), left = values.shape, 0.0
    now, moved, masses = np.zeros((across, modes, modes)), np.zeros((across, modes, modes)), np.zeros(modes)
    shift_row(c, values, source, sheared, velocity_shear, now, basis)
    shift_row(c, now, sheared, blurred, blur, moved, basis)
    for end in range(2):
        if mass_beyond(c, end, values, source, velocity_shear, masses):
            left += _weighted(masses, tables[2], size)
        if mass_beyond(c, end, now, sheared, blur, masses):
            left += _weighted(masses, tables[2], size)
    turn_row(c, moved, blurred, out, basis)
    return left


@kernel(parallel=True)
def shear_velocity(values, order, sources, sheared, blurred, velocity_shear, blur, tables, sizes, out, left, basis):
    """Shear and blur of the velocity: values to (velocity cells, angle cells, velocity, angle).

    The masses that left are written to `left` (angle cells,).
    """
    for n in prange(len(order)):
        c = order[n]
        left[c] = _shear_velocity_row(
            c, values[c], sources[c], sheared[c], blurred[c], velocity_shear, blur, tables, sizes[0][c], out, basis
        )


@kernel
def _finish_row(r, values, source, target, shift, tables, edges, sizes, out, left, basis):
    (across, limit), modes = values.shape[:2], len(basis)
    side, j = r // across, r % across
    moved, masses, cell = np.zeros((limit, modes, modes)), np.zeros(modes), np.zeros((modes, modes))
    shift_row(r, values[j], source, target, shift, moved, basis)
    for end in range(2):
        if mass_beyond(r, end, values[j], source, shift, masses):
            if end == side:
                left[side, j] += _weighted(masses, tables[2], sizes[1][j])
            else:
                set_down(end, masses, target, edges, sizes[0], moved)
    for c in range(target[0], target[1]):
        transform(moved[c], tables[1], tables[1], cell, basis)
        for a in range(modes):
            for b in range(modes):
                out[c, j, a, b] += cell[a, b]


@kernel(parallel=True)
def finish_rows(values, order, sources, targets, shift, tables, edges, sizes, out, left, basis):
    """Last shear: from values to coefficients, added; masses that passed the cut-off, to `left` (2, velocity cells)."""
    for n in prange(len(order)):
        r = order[n]
        _finish_row(r, values, sources[r], targets[r], shift, tables, edges, sizes, out, left, basis)
