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
total derivative, (t²/24) (-c, v ∂c/∂x + ∂c/∂t) at the end less that at the start, which cancels from step to step. So a
density on the mesh is one of displaced states; what is left is of second order in c, and of fourth in the step to first
(derived in docs/theory).
"""

import functools
import math

import numpy as np

from fpk_rocking.base.basis import gauss_hermite, gauss_legendre, legendre_at_gauss_points
from fpk_rocking.base.jit import kernel, run_in_parts
from fpk_rocking.density.space import Space
from fpk_rocking.density.step.dynamics import Excess
from fpk_rocking.density.step.remap import Remap, prepare_remap, target_range, with_end_cells
from fpk_rocking.density.step.shears import (
    AngleRows,
    LineTables,
    VelocityRows,
    shear_coefficients,
    shear_values,
    shear_velocity,
)
from fpk_rocking.density.tuning import TUNING
from fpk_rocking.physics.motion.equation import (
    acceleration,
    acceleration_gradient,
    contact_laws,
    force_factor,
    value_and_slope,
)
from fpk_rocking.physics.motion.slender import (
    SLENDER_CONTACT,
    AffineFlights,
    flight_shears,
    shear_diffusion_variances,
)


class FreeFlight:
    """Linear map of densities over one step for the cells that no event can reach, and its adjoint.

    `free` (angle cells, velocity cells) is the mask of these cells; `nodes` is the number of Gauss-Hermite nodes of the
    diffusion of the velocity. `angle_remap`, of `angle_remap_of`, serves many flights. An exact block has an `excess`.
    """

    def __init__(
        self,
        space: Space,
        free: np.ndarray,
        affine: AffineFlights,
        diffusion: float,
        duration: float,
        nodes: int,
        angle_remap: Remap | None = None,
        excess: Excess | None = None,
    ):
        sinh, shifts = flight_shears(duration)[1], affine.shifts
        self.free = free
        self._shear_seconds = TUNING.seconds_flight / 3.0 * np.count_nonzero(free) * (space.degree + 1) ** 2
        (limit, across), middle, degree = free.shape, min(space.first_positive, free.shape[0]), space.degree
        points, weights = gauss_legendre(degree + 1)
        table = legendre_at_gauss_points(degree + 1, degree)
        tables = LineTables(
            table, np.ascontiguousarray((table * weights[:, None]).T), weights,
            np.diff(space.angle_lines), np.diff(space.velocity_lines),
        )  # fmt: skip
        laws = contact_laws(excess.block) if excess else SLENDER_CONTACT
        shear, drift = _angle_shears(space, affine, diffusion, duration, laws)
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

        # Masks of cells by row have the rows' end cells, from which nothing flies.
        left = np.arange(limit + 2) <= middle
        first = ranges_of(_rows_by_side(np.pad(free.T, ((0, 0), (1, 1))), left))
        first_targets = target_range(*shear[:-1], first)
        reached = mask_of(first_targets, limit + 2)
        second = ranges_of(np.pad((reached[:across] | reached[across:])[:, 1:-1].T, ((0, 0), (1, 1))))
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
        velocities, bounds = with_end_cells(space.velocity_lines), np.tile([0, across + 2], (limit, 1))
        push = velocities, bounds, velocity_shears, spreads, own
        spread = velocities, bounds, np.zeros((1, 1)), np.ones((1, 1)), math.sqrt(variance) * wide
        pushed = target_range(*push, second)
        inside = np.clip(pushed, 1, across + 1)
        diffused = target_range(*spread, inside)
        third = ranges_of(_rows_by_side(np.pad(mask_of(diffused, across + 2)[:, 1:-1].T, ((0, 0), (1, 1))), left))
        every = ranges_of(mask_of(inside, across + 2).any(axis=0)[None])
        self._shared = angle_remap is not None
        remaps = (
            angle_remap or prepare_remap(*shear, degree, union(first, third)),
            prepare_remap(*push, own_weights, degree, second),
            prepare_remap(velocities, bounds[:1], *spread[2:], wide_weights, degree, every),
        )
        rows = (
            AngleRows(balanced_order(first), first, first_targets),
            VelocityRows(balanced_order(second), second, pushed, inside, diffused),
            AngleRows(balanced_order(third), third, target_range(*shear[:-1], third)),
        )
        self._forward = rows, remaps, tables

    @functools.cached_property
    def _backward(self):
        """The rows, remaps and tables of the adjoint: the shears in reverse, sources and targets exchanged."""
        rows, (angle, push, spread), tables = self._forward
        angle_sizes, velocity_sizes = (
            np.pad(sizes, 1, constant_values=1.0) for sizes in (tables.angle_sizes, tables.velocity_sizes)
        )
        angle = angle.adjoint(angle_sizes, tables.weights)
        push, spread = (remap.adjoint(velocity_sizes, tables.weights) for remap in (push, spread))
        return [type(part)(part.order, *part[:0:-1]) for part in rows[::-1]], (angle, spread, push), tables

    @property
    def nbytes(self):
        """Bytes of the prepared remaps, one that was given left out."""
        return sum(part.nbytes for remap in self._forward[1][self._shared :] for part in remap)

    def apply(self, coefficients, out):
        """Add the density after the step to `out`; return the masses (3,) past the cut-offs and the velocity bound."""
        return self._fly(self._forward, coefficients, self.free, np.zeros(3), out)

    def apply_adjoint(self, function, exit_values, out):
        """Add the coefficients of a function before the step, by those after it, to `out`: `apply`, adjoint in L2.

        Only those of the free cells are right. `exit_values` (3,) are those of the masses that `apply` returns.
        """
        self._fly(self._backward, function, np.ones_like(self.free), exit_values, out)

    def _fly(self, way, coefficients, cells, exit_values, out):
        """Add the coefficients of `cells`, a mask, after the shears to `out`; return the masses (3,) that left."""
        (first, second, third), (angle, *velocity), tables = way
        limit, across, modes, _ = coefficients.shape
        basis, seconds = (1.0,) * modes, self._shear_seconds
        drifted, diffused = np.zeros((limit, across + 2, modes, modes)), np.zeros((across, limit + 2, modes, modes))
        overturned, truncated = np.zeros((2, across)), np.zeros((2, limit))
        sides, beyond = exit_values[:2], np.full(2, exit_values[2])
        run_in_parts(
            shear_coefficients, len(first.order), first, coefficients, cells, angle, tables, sides, drifted, overturned,
            basis, seconds=seconds,
        )  # fmt: skip
        run_in_parts(
            shear_velocity, len(second.order), second, drifted, *velocity, tables, beyond, diffused, truncated, basis,
            seconds=seconds,
        )  # fmt: skip
        run_in_parts(
            shear_values, len(third.order), third, diffused, angle, tables, sides, out, overturned, basis,
            seconds=seconds,
        )  # fmt: skip
        return np.array([overturned[0].sum(), overturned[1].sum(), truncated.sum()])


def angle_remap_of(space: Space, affine, diffusion, duration):
    """Return the `Remap` of both shears of the angle for all cells of a `Space`.

    It serves all flights of a `duration` that differ from `affine`, `AffineFlights`, in a constant force alone: that
    moves the velocity between the two shears of the angle, and neither of these.
    """
    shear, _ = _angle_shears(space, affine, diffusion, duration)
    return prepare_remap(*shear, space.degree, np.clip(shear[1], 1, space.shape[0] + 1))


def _angle_shears(space, affine, diffusion, duration, laws=SLENDER_CONTACT):
    """Return the first arguments of `prepare_remap` for a shear of the angle, and the forcing's part of it by side."""
    (limit, across, *_), shifts = space.shape, affine.shifts
    middle, shear = min(space.first_positive, limit), flight_shears(duration)[0]
    most = max(law.noise for law in laws.values())
    variance = shear_diffusion_variances(diffusion * most**2, duration)[1]
    nodes, weights = gauss_hermite(TUNING.narrow_nodes if variance > 0.0 else 1)
    drift = {side: 0.5 * (shifts[side, 0] - shear * shifts[side, 1]) for side in (1, -1)}
    along = shear * _line_points(space.velocity_lines, gauss_legendre(space.degree + 1)[0])
    bounds = np.repeat([(0, middle + 1), (middle + 1, limit + 2)], across, axis=0)
    shears = np.concatenate([along + drift[side] for side in (-1, 1)])
    spread = np.concatenate([np.full_like(along, laws[side].noise / most) for side in (-1, 1)])
    return (with_end_cells(space.angle_lines), bounds, shears, spread, math.sqrt(variance) * nodes, weights), drift


def _line_points(lines, points):
    """Return the Gauss points (cells, n) of all cells between mesh lines, for `points` (n,) on [0, 1]."""
    return lines[:-1, None] + np.diff(lines)[:, None] * points


def _rows_by_side(rows, left):
    """Return a mask (2 rows, cells) of a mask (rows, cells): its cells in the mask `left` (cells,), then the others."""
    return np.concatenate([rows & left, rows & ~left])


def ranges_of(rows):
    """Return ranges (rows, 2) of what a mask (rows, cells) marks: first, and one past the last; 0, 0 of nothing."""
    ends = np.stack([rows.argmax(axis=1), rows.shape[1] - rows[:, ::-1].argmax(axis=1)], axis=1)
    return np.where(rows.any(axis=1)[:, None], ends, 0)


def mask_of(ranges, cells):
    """Return a mask (rows, `cells`) of ranges (rows, 2), each a first cell and one past the last."""
    places = np.arange(cells)
    return (places >= ranges[:, :1]) & (places < ranges[:, 1:])


def union(first, second):
    """Return the ranges (rows, 2) that contain both of two ranges (rows, 2) in each row."""
    empty = [(part[:, 1] == part[:, 0])[:, None] for part in (first, second)]
    both = np.stack([np.minimum(first[:, 0], second[:, 0]), np.maximum(first[:, 1], second[:, 1])], axis=1)
    return np.where(empty[0], second, np.where(empty[1], first, both))


def balanced_order(ranges):
    """Return the rows (n,) whose range (rows, 2) is not empty, such that equal parts of them take about equal time."""
    rows = np.flatnonzero(ranges[:, 1] > ranges[:, 0])
    return np.concatenate([rows[::2], rows[1::2]])


@kernel
def displaced(x, v, side, time, displacement, segment, block):
    """Return a state (x, v) on a side, plus `displacement` times (-c, v ∂c/∂x + ∂c/∂t), at a `time` of a `Segment`.

    c is the acceleration less that of the affine flights, 0 of a slender block. States of the mesh are the real ones
    less this at duration²/24.
    """
    u, (force, slope) = side * x, value_and_slope(segment.force, time)
    excess = acceleration(u, side, force, block) - acceleration(0.0, side, force, block) - u
    gradient = acceleration_gradient(u, side, force, block) - 1.0
    rise = slope * (force_factor(u, side, block) - force_factor(0.0, side, block))
    return x - side * displacement * excess, v + displacement * (v * gradient + rise)
