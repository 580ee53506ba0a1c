"""Densities too narrow for the main mesh: Gaussians carried through eventless flights, and moving patches.

A Gaussian is carried in closed form for a slender block, and by linearized moments for an exact one. Patches are small
meshes that follow a narrow density and grow with it; this module makes them, `startup.StartUp` moves them.
"""

import bisect
import math

import numpy as np

from fpk_rocking.base.arrays import borrowed
from fpk_rocking.base.basis import find_cells
from fpk_rocking.base.jit import kernel
from fpk_rocking.density.space import Space, patch_lines
from fpk_rocking.density.step import Exit
from fpk_rocking.density.step.dynamics import Dynamics, points_of_cell
from fpk_rocking.density.step.scatter import AffinePaths
from fpk_rocking.density.step.step import Characteristics
from fpk_rocking.density.tuning import TUNING
from fpk_rocking.physics.motion.flight import apply_affine


class Gaussian:
    """A Gaussian density of angle and velocity: mean (2,), covariance (2, 2); nondimensional."""

    def __init__(self, mean, covariance):
        self.mean, self.covariance = np.asarray(mean, dtype=float), np.asarray(covariance, dtype=float)

    @classmethod
    def of(cls, start):
        """Return the Gaussian of the start of a scene, a `Start`; a point has covariance 0."""
        return cls((start.angle, start.velocity), np.zeros((2, 2)) if start.covariance is None else start.covariance)

    def __call__(self, angle, velocity):
        """Return the density at points `angle`, `velocity`, nondimensional: an array of their broadcast shape."""
        xx, xv, vv = self.covariance[0, 0], self.covariance[0, 1], self.covariance[1, 1]
        determinant = xx * vv - xv * xv
        x, v = angle - self.mean[0], velocity - self.mean[1]
        exponent = (vv * x * x - 2.0 * xv * x * v + xx * v * v) / determinant
        return np.exp(-0.5 * exponent) / (2.0 * math.pi * math.sqrt(determinant))

    def tails(self, cutoff):
        """Return the masses beyond the cut-off, an angle, to the left and to the right: a list of two probabilities."""
        spread = math.sqrt(2.0 * self.covariance[0, 0])
        return [0.5 * math.erfc((cutoff + sign * self.mean[0]) / spread) for sign in (1.0, -1.0)]

    def resolution(self, space):
        """Return the least conditional standard deviation over the size of the cell that the mean is in, a float."""
        return resolution_of(self.mean, self.covariance, space)

    def after_flight(self, dynamics: Dynamics, start, duration, side):
        """Return the `Gaussian` after a flight of a slender block, on `side`, ±1, in which nothing happens."""
        flight = dynamics.affine(start, duration)
        xx, xv, vv = dynamics.covariance(start, duration)
        covariance = flight.matrix @ self.covariance @ flight.matrix.T + [[xx, xv], [xv, vv]]
        return Gaussian(flight.matrix @ self.mean + flight.shifts[side], covariance)


def resolution_of(mean, covariance, space):
    """Return a Gaussian's least conditional standard deviation over the size of the mesh cell that its mean is in."""
    (xx, xv), (_, vv) = covariance
    if min(xx, vv) <= 0.0:
        return 0.0
    angle, velocity = (cell_size(lines, point) for lines, point in zip(space.lines, mean, strict=True))
    return min(math.sqrt(max(xx - xv * xv / vv, 0.0)) / angle, math.sqrt(max(vv - xv * xv / xx, 0.0)) / velocity)


def exact_flight(gaussian: Gaussian, dynamics: Dynamics, side):
    """Return a function of time: the `Gaussian` of an exact block in an eventless flight, linearized about its mean."""
    from scipy.integrate import DOP853  # takes longer to import than all else here

    block, envelope = dynamics.block, dynamics.envelope
    alpha, saddle, scale = block.critical_angle, block.saddles[side > 0], block.scales[side > 0]

    def rates(time, state):
        x, v, xx, xv, vv = state.tolist()
        phi, force = alpha * (saddle - side * x), dynamics.force(time)
        sine, cosine = scale * math.sin(phi), scale * math.cos(phi)
        stiff = cosine + side * force * alpha * sine
        noise = 2.0 * dynamics.diffusion * cosine**2
        if envelope is not None:
            noise *= max(envelope.value(time + dynamics.origin) ** 2, dynamics.least_intensity)
        return np.array([v, force * cosine - side * sine / alpha, 2.0 * xv, vv + stiff * xx, 2.0 * stiff * xv + noise])

    (xx, xv), (_, vv) = gaussian.covariance
    # Most starts meet the mesh long before the end, and a record makes many steps. No variance is below 1e-24.
    solver = DOP853(rates, 0.0, np.array([*gaussian.mean, xx, xv, vv]), math.inf, rtol=1e-10, atol=1e-30)
    ends, pieces = [], []

    def at(time):
        while not ends or ends[-1] < time:
            solver.step()
            ends.append(solver.t)
            pieces.append(solver.dense_output())
        x, v, xx, xv, vv = pieces[bisect.bisect_left(ends, time)](time)
        return Gaussian((x, v), [[xx, xv], [xv, vv]])

    return at


def initial_density(start, space, cutoff):
    """Return (coefficients, masses) of a Gaussian start on a mesh: its density, and what is past the cut-offs."""
    if start.covariance is None:
        return np.zeros(space.shape), [0.0, 0.0]
    gaussian = Gaussian.of(start)
    return space.project(gaussian, 2 * space.degree + 2), gaussian.tails(cutoff)


def cell_size(lines, point):
    """Return the size, a float, of the cell between ascending `lines` (n,) that `point`, a number, is in."""
    cell = find_cells(lines, point, "left")
    return lines[cell + 1] - lines[cell]


def patch_of(settings, mean, covariance, cutoff, box=None):
    """Return a `Space`, `settings.reach` standard deviations to all sides of the mean (2,), for a covariance (2, 2)."""
    # A thin oblique ellipse needs cells as small as its own width, not as its shadow on an axis.
    thin = math.sqrt(max(1.0 - covariance[0, 1] ** 2 / (covariance[0, 0] * covariance[1, 1]), 1e-2))
    count = math.ceil(settings.cells * max(1.0, 0.5 / thin))
    # The rounding of the mean must leave every cell a width.
    spread = np.maximum(np.sqrt(np.diag(covariance)), count * np.spacing(np.abs(mean)))
    low, high = mean - settings.reach * spread, mean + settings.reach * spread
    sizes = (high - low) / count
    if box is not None:
        low, high = np.minimum(low, box[::2]), np.maximum(high, box[1::2])
    low[0], high[0] = max(low[0], -cutoff), min(high[0], cutoff)
    counts = np.minimum(np.ceil((high - low) / sizes - 1e-9), max(60, count)).astype(int)
    angle, velocity = (patch_lines(*edges) for edges in zip(low, high, counts, strict=True))
    return Space(_within(angle, cutoff), velocity, degree=3)


def _within(lines, cutoff):
    """Return mesh lines (m,) of equal cells, cut at ± the cut-off, an angle, from `lines` (n,)."""
    first, last, thin = max(lines[0], -cutoff), min(lines[-1], cutoff), 0.1 * (lines[1] - lines[0])
    inner = lines[(lines > first + thin) & (lines < last - thin)]
    return np.concatenate([[first], inner, [last]])


def next_patch(settings, step: Characteristics, coefficients, cutoff):
    """Return a `Space`, a patch for the density after a step, by the moments of the mass that has not overturned."""
    source = step.source
    # Cells that are not active have no characteristics.
    points = step.points
    values = np.where(step.active[..., None, None], points.angle_table @ coefficients @ points.velocity_table.T, 0.0)
    values *= np.outer(points.angle_weights, points.velocity_weights)
    values *= source.areas[..., None, None]
    flown = AffinePaths(*step.affine, step.offsets, step.node_weights)
    sums = moment_sums(values, points, flown, step.numbers, step.ends, step.flags, TUNING.visible_mass)
    total, x, v, xx, xv, vv, box = sums
    if total < TUNING.no_mass:
        return source
    x, v, xx, xv, vv = x / total, v / total, xx / total, xv / total, vv / total
    # The density is not resolved below half a cell of the source.
    xx = max(xx - x * x, 0.25 * np.diff(source.angle_lines).min() ** 2)
    vv = max(vv - v * v, 0.25 * np.diff(source.velocity_lines).min() ** 2)
    return patch_of(settings, np.array([x, v]), np.array([[xx, xv - x * v], [xv - x * v, vv]]), cutoff, box)


@kernel
def moment_sums(values, points, flown, events, states, codes, least):
    """Return sums of mass times 1, x, v, x^2, xv, v^2 over the ends of paths that did not overturn, and their box."""
    total, sx, sv, sxx, sxv, svv = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    points = borrowed(points)
    left, right, slow, fast = np.inf, -np.inf, np.inf, -np.inf
    for i in range(values.shape[0]):
        for j in range(values.shape[1]):
            side, x, v = points_of_cell(i, j, points)
            affine, row = (flown.cosh, flown.sinh, flown.shifts[side]), events[i, j]
            for p in range(len(x)):
                for q in range(len(v)):
                    for n in range(len(flown.weights)):
                        mass = values[i, j, p, q] * flown.weights[n]
                        if row >= 0:
                            if codes[row, p, q, n] <= Exit.OVERTURNED_LEFT:
                                continue
                            xn, vn = states[row, p, q, n]
                        else:
                            xn, vn = apply_affine(x[p], v[q], affine)
                            xn, vn = xn + flown.offsets[n, 0], vn + flown.offsets[n, 1]
                        total += mass
                        sx += mass * xn
                        sv += mass * vn
                        sxx += mass * xn * xn
                        sxv += mass * xn * vn
                        svv += mass * vn * vn
                        if abs(mass) > least:
                            left, right = min(left, xn), max(right, xn)
                            slow, fast = min(slow, vn), max(fast, vn)
    return total, sx, sv, sxx, sxv, svv, (left, right, slow, fast)
