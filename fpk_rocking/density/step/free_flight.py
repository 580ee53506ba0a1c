"""Free flight, the step of cells that no event can reach: exact shears along mesh lines, diffusion along them.

The affine flight z -> F z + d is a shear of the angle, a shear of the velocity and the same shear of the angle again,
F = X Y X with X = [[1, tanh(t/2)], [0, 1]] and Y = [[1, 0], [sinh t, 1]]. A shear moves every line of Gauss points as a
whole (`shears`), so each is an L2 projection in one dimension, done exactly (`remap`), and cannot amplify. White noise
is a small diffusion of the angle with the first and the last shear and one of the velocity after the second: together
they have the covariance of the flight, exactly (derived in docs/theory). Mass is conserved line by line.

What the acceleration of an exact block has beyond this, c, depends on angle and time alone: it is a kick of the
velocity half way through the step, in which the noise by which lines of different angles differ diffuses them too. The
middle of X Y X is the state half way but for a stretch: angle / cosh(t/2), velocity cosh(t/2). To first order in c,
such a kick is the exact flight between states that are displaced a little (`displaced`): its error is a
total derivative, (t²/24) (-c, v ∂c/∂x + ∂c/∂t) at the end less that at the begin, which cancels from step to step. So a
density on the mesh is one of displaced states; what is left is of second order in c, and of fourth in the step to first
(derived in docs/theory).
"""

import math

import numpy as np

from fpk_rocking.base.basis import gauss_hermite, gauss_legendre, legendre_at_gauss_points, legendre_basis
from fpk_rocking.base.jit import kernel, run_in_parts
from fpk_rocking.density.space import Space
from fpk_rocking.density.step.remap import prepare_remap, target_range
from fpk_rocking.density.step.shears import (
    AngleRows,
    LineTables,
    VelocityRows,
    adjoint_first_angle_shear,
    adjoint_last_angle_shear,
    adjoint_velocity_shear,
    first_angle_shear,
    last_angle_shear,
    velocity_shear,
)
from fpk_rocking.density.tuning import TUNING
from fpk_rocking.physics.motion.equation import (
    acceleration,
    acceleration_gradient,
    contact_laws,
    dispatch_on_block,
    force_factor,
    value_and_slope,
)
from fpk_rocking.physics.motion.slender import SLENDER_CONTACT, flight_shears, shear_diffusion_variances


class FreeFlight:
    """Linear map of densities over one step for the cells that no event can reach, and its adjoint."""

    def __init__(self, space: Space, free, affine, diffusion, duration, nodes, angle_remap=None, excess=None):
        sinh, shifts = flight_shears(duration)[1], affine.shifts
        self.free = free
        self._shear_seconds = TUNING.seconds_flight / 3.0 * np.count_nonzero(free) * (space.degree + 1) ** 2
        (limit, across), middle = free.shape, min(space.first_positive, free.shape[0])
        points, weights = gauss_legendre(space.degree + 1)
        table = legendre_at_gauss_points(space.degree + 1, space.degree)
        self.tables = LineTables(
            table, np.ascontiguousarray((table * weights[:, None]).T), weights,
            legendre_basis([0.0, 1.0], space.degree) @ table.T,
            np.diff(space.angle_lines), np.diff(space.velocity_lines),
        )  # fmt: skip
        laws = contact_laws(excess.block) if excess else SLENDER_CONTACT
        sides, angle_shears, drift, spread, narrow, narrow_weights = _angle_shears(
            space, affine, diffusion, duration, laws
        )
        by_side = [shifts[side, 1] - sinh * drift[side] for side in (-1, 1)]
        pushes = np.repeat(by_side, (middle, limit - middle))[:, None]
        angles = _line_points(space.angle_lines, points)
        velocity_shears = sinh * angles + pushes
        if excess:
            counts, stretch = (middle, limit - middle), math.cosh(0.5 * duration)
            by_half = [excess.shifts[side] - stretch * drift[side] for side in (-1, 1)]
            angles = stretch * angles + np.repeat(by_half, counts)[:, None]
            where = np.repeat([-1.0, 1.0], counts)[:, None]
            velocity_shears += stretch * duration * excess(angles, where)
        all_cells, no_shift, no_spread = np.tile([0, across], (limit, 1)), np.zeros((1, 1)), np.ones((1, 1))

        first = ranges_of(rows_along_angle(free, middle))
        first_targets = target_range(space.angle_lines, sides, angle_shears, spread, narrow, first)
        second = ranges_of(join_sides(mask_of(first_targets, limit)).T)
        variance, (wide, wide_weights) = shear_diffusion_variances(diffusion, duration)[0], gauss_hermite(nodes)
        spreads, (own, own_weights) = np.ones_like(velocity_shears), gauss_hermite(1)
        if excess and diffusion > 0.0 and second.any():
            # The least diffusion of all lines is one remap for all, and what a line lacks is part of its shear.
            parts = excess.force_factors(angles, where) ** 2
            needed = parts[second[:, 1] > second[:, 0]]
            least, most = needed.min(), needed.max()
            spreads, variance = np.sqrt(variance * np.maximum(parts - least, 0.0)), variance * least
            is_narrow = most - least <= TUNING.narrow_part * most
            own, own_weights = gauss_hermite(TUNING.narrow_nodes if is_narrow else nodes)
        wide = math.sqrt(variance) * wide
        sheared = target_range(space.velocity_lines, all_cells, velocity_shears, spreads, own, second)
        diffused = target_range(space.velocity_lines, all_cells, no_shift, no_spread, wide, sheared)
        third = ranges_of(rows_along_angle(mask_of(diffused, across), middle))
        third_targets = target_range(space.angle_lines, sides, angle_shears, spread, narrow, third)
        degree, every = space.degree, ranges_of(mask_of(sheared, across).any(axis=0)[None])
        self._shared = angle_remap is not None
        self.angle_remap = angle_remap or prepare_remap(
            space.angle_lines, sides, angle_shears, spread, narrow, narrow_weights, degree, union(first, third)
        )
        self.velocity_remap = prepare_remap(
            space.velocity_lines, all_cells, velocity_shears, spreads, own, own_weights, degree, second
        )
        self.diffusion_remap = prepare_remap(
            space.velocity_lines, all_cells[:1], no_shift, no_spread, wide, wide_weights, degree, every
        )
        self.first = AngleRows(balanced_order(first), first, first_targets)
        self.second = VelocityRows(balanced_order(second), second, sheared, diffused)
        self.third = AngleRows(balanced_order(third), third, third_targets)

    @property
    def nbytes(self):
        """Bytes, an int, of the prepared remaps, one that was given left out."""
        own = (self.velocity_remap, self.diffusion_remap, *(() if self._shared else (self.angle_remap,)))
        return sum(part.nbytes for remap in own for part in remap)

    def apply(self, coefficients, out):
        """Add the density after the step to `out`, and return the masses that passed the bounds."""
        limit, across, modes, _ = coefficients.shape
        basis = (1.0,) * modes
        drifted, diffused = np.zeros(coefficients.shape), np.zeros((across, limit, modes, modes))
        truncated, overturned = np.zeros(limit), np.zeros((2, across))
        angle, velocity, tables = self.angle_remap, (self.velocity_remap, self.diffusion_remap), self.tables
        self._run_on_rows(
            first_angle_shear, self.first, coefficients, self.free, angle, tables, drifted, overturned, basis
        )
        self._run_on_rows(velocity_shear, self.second, drifted, *velocity, tables, diffused, truncated, basis)
        self._run_on_rows(last_angle_shear, self.third, diffused, angle, tables, out, overturned, basis)
        return np.array([overturned[0].sum(), overturned[1].sum(), truncated.sum()])

    def apply_adjoint(self, function, exit_values, out):
        """Write to `out` the coefficients of a function before the step, by those after it: the L2 adjoint."""
        limit, across, modes, _ = function.shape
        basis = (1.0,) * modes
        diffused, drifted = np.zeros((across, limit, modes, modes)), np.zeros(function.shape)
        angle, velocity, tables = self.angle_remap, (self.velocity_remap, self.diffusion_remap), self.tables
        self._run_on_rows(
            adjoint_last_angle_shear, self.third, function, angle, tables, exit_values[:2], diffused, basis
        )
        self._run_on_rows(
            adjoint_velocity_shear, self.second, diffused, *velocity, tables, exit_values[2], drifted, basis
        )
        self._run_on_rows(
            adjoint_first_angle_shear, self.first, drifted, self.free, angle, tables, exit_values[:2], out, basis
        )

    def _run_on_rows(self, shear, rows, *arguments):
        """Call a kernel of a shear, with `arguments`, for all rows of an `AngleRows` or `VelocityRows`, on threads."""
        run_in_parts(shear, len(rows.order), rows, *arguments, seconds=self._shear_seconds)


def angle_remap_of(space, affine, diffusion, duration):
    """Return the `Remap`, a named tuple of matrices, of both shears of the angle for all cells of a `Space`."""
    sides, shears, _, spread, nodes, weights = _angle_shears(space, affine, diffusion, duration)
    return prepare_remap(space.angle_lines, sides, shears, spread, nodes, weights, space.degree, sides)


def _angle_shears(space, affine, diffusion, duration, laws=SLENDER_CONTACT):
    """Return (bounds, shifts, drift, spread, nodes, weights), what `prepare_remap` needs for a shear of the angle."""
    (limit, across, *_), shifts = space.shape, affine.shifts
    middle, shear = min(space.first_positive, limit), flight_shears(duration)[0]
    most = max(law.noise for law in laws.values())
    variance = shear_diffusion_variances(diffusion * most**2, duration)[1]
    nodes, weights = gauss_hermite(TUNING.narrow_nodes if variance > 0.0 else 1)
    drift = {side: 0.5 * (shifts[side, 0] - shear * shifts[side, 1]) for side in (1, -1)}
    along = shear * _line_points(space.velocity_lines, gauss_legendre(space.degree + 1)[0])
    sides = np.repeat([(0, middle), (middle, limit)], across, axis=0)
    shears = np.concatenate([along + drift[side] for side in (-1, 1)])
    spread = np.concatenate([np.full_like(along, laws[side].noise / most) for side in (-1, 1)])
    return sides, shears, drift, spread, math.sqrt(variance) * nodes, weights


def _line_points(lines, points):
    """Return the Gauss points (cells, n) of all cells between mesh lines, for `points` (n,) on [0, 1]."""
    return lines[:-1, None] + np.diff(lines)[:, None] * points


def rows_along_angle(cells, middle):
    """Mask (2 velocity cells, angle cells), one row a side and velocity cell, from a mask (angle, velocity)."""
    rows = np.concatenate([cells.T, cells.T])
    rows[: cells.shape[1], middle:] = False
    rows[cells.shape[1] :, :middle] = False
    return rows


def join_sides(rows):
    """Return a mask (velocity cells, angle cells) from one by rows along the angle, (2 velocity cells, angle cells)."""
    left, right = np.split(rows, 2)
    return left | right


def ranges_of(rows):
    """Return ranges (rows, 2) of what a mask (rows, cells) marks: first, and one past the last; 0, 0 of nothing."""
    ends = np.stack([rows.argmax(axis=1), rows.shape[1] - rows[:, ::-1].argmax(axis=1)], axis=1)
    return np.where(rows.any(axis=1)[:, None], ends, 0)


def mask_of(ranges, cells):
    """Return a mask (rows, `cells`) of ranges (rows, 2), each a first cell and one past the last."""
    places = np.arange(cells)
    return (places >= ranges[:, :1]) & (places < ranges[:, 1:])


def union(first, second):
    """Return the ranges (rows, 2) that contain both of two ranges (rows, 2) in each row, `first` and `second`."""
    empty = [(part[:, 1] == part[:, 0])[:, None] for part in (first, second)]
    both = np.stack([np.minimum(first[:, 0], second[:, 0]), np.maximum(first[:, 1], second[:, 1])], axis=1)
    return np.where(empty[0], second, np.where(empty[1], first, both))


def balanced_order(ranges):
    """Return the indices of the rows whose range (rows, 2) is not empty, in a balanced order, (n,)."""
    rows = np.flatnonzero(ranges[:, 1] > ranges[:, 0])
    return np.concatenate([rows[::2], rows[1::2]])


@kernel(inline="always")
def _slender_displaced(x, v, side, time, displacement, segment, block):  # noqa: ARG001
    """Return (x, v), the angle and velocity of a slender block, as they are; no other argument is used."""
    return x, v


@kernel
def _exact_displaced(x, v, side, time, displacement, segment, block):
    """Return (x, v), angle and velocity of an exact block on `side`, ±1, displaced at a `time` of a `Segment`."""
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
