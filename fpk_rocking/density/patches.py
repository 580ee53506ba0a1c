"""Moving patches: small meshes that follow a density too narrow for the main mesh, and grow with it."""

import math

import numpy as np

from fpk_rocking.base.arrays import borrowed
from fpk_rocking.base.jit import kernel
from fpk_rocking.density.space.mesh import patch_lines
from fpk_rocking.density.space.space import Space
from fpk_rocking.density.step import Exit
from fpk_rocking.density.step.cells import points_of_cell
from fpk_rocking.density.step.scatter import AffinePaths
from fpk_rocking.density.step.step import Characteristics
from fpk_rocking.density.tuning import TUNING
from fpk_rocking.physics.motion.flight import apply_affine


def patch_of(settings, mean, covariance, cutoff, box=None):
    """`Space` on which a density of mean (2,) and covariance (2, 2) is resolved, `reach` deviations to all sides.

    `settings`: `PatchSettings`; `cutoff`: angle of overturning, where the patch ends. `box` (angle from, to, velocity
    from, to) holds what the moments do not tell of: tails, and what an impact has split off. The patch covers it with
    cells of the same size, up to 60 of them an axis.
    """
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
    """Mesh lines (n,) of equal cells, cut at ± the cut-off, an angle.

    A remainder below a tenth of a cell joins its neighbour.
    """
    first, last, thin = max(lines[0], -cutoff), min(lines[-1], cutoff), 0.1 * (lines[1] - lines[0])
    inner = lines[(lines > first + thin) & (lines < last - thin)]
    return np.concatenate([[first], inner, [last]])


def next_patch(settings, step: Characteristics, coefficients, cutoff):
    """Patch, a `Space`, for the density after a step, by the moments of the mass that has not overturned.

    `settings`: `PatchSettings`; `cutoff`: angle of overturning. `coefficients` are those of the density before the
    step, on the patch of its `Characteristics`.
    """
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
    """Return sums of mass times 1, x, v, x^2, xv, v^2 over the ends of paths that did not overturn, and their box.

    `values` are the masses of the Gauss points (angle cells, velocity cells, g, h), `flown` the `AffinePaths` of cells
    without events; `points`, `events`, `states`, `codes` are `points`, `numbers`, `ends`, `flags` of `Characteristics`.
    The box (angle from, to, velocity from, to) leaves out nodes with a mass below `least`.
    """
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
