"""Mesh lines of the phase plane, graded towards the origin or equal in a patch; the velocity bound where they end."""

import math

import numpy as np

from fpk_rocking.density.tuning import TUNING
from fpk_rocking.physics.motion.block import largest_correction


def graded_lines(half_width, cells, exponent):
    """Symmetric mesh lines on [-half_width, half_width] at half_width (j/n)^exponent, with 0 among them.

    Parameters
    ----------
    half_width : float
        Half of the interval, nondimensional.
    cells : int
        Number of cells, even.
    exponent : float
        1 is uniform; larger values make cells smaller towards 0.

    Returns
    -------
    ndarray, shape (cells + 1,)
    """
    half = half_width * (np.arange(cells // 2 + 1) / (cells // 2)) ** exponent
    return np.concatenate([-half[:0:-1], half])


def extended_lines(lines, half_width, growth=TUNING.cell_growth):
    """Symmetric mesh lines continued to a wider interval by cells that grow, each by the factor `growth` or so.

    Parameters
    ----------
    lines : ndarray
        Symmetric about 0.
    half_width : float
        At least this far; nondimensional.
    growth : float
        Above 1.

    Returns
    -------
    ndarray
        The lines as they are where they go as far.
    """
    gap, size = half_width - lines[-1], lines[-1] - lines[-2]
    if gap <= 0.0:
        return lines
    count = math.ceil(math.log1p(gap / size * (growth - 1.0) / growth) / math.log(growth) - 1e-9)
    places = np.cumsum(growth ** np.arange(count))
    beyond = lines[-1] + gap * places / places[-1]
    beyond[-1] = half_width
    return np.concatenate([-beyond[::-1], lines, beyond])


def patch_lines(low, high, cells):
    """About `cells` equal cells that cover [low, high], with 0 a mesh line where it lies inside or nearly so.

    Their mesh lines (cells + 1,) are returned, nondimensional angles or velocities.
    """
    size = (high - low) / cells
    if low > size or high < -size:
        return np.linspace(low, high, cells + 1)
    first, last = math.floor(min(low, 0.0) / size + 1e-9), math.ceil(max(high, 0.0) / size - 1e-9)
    return size * np.arange(first, last + 1)


def velocity_bound(scene, diffusion):
    """Velocity that is passed only by blocks bound to overturn, and by `deviations` of the noise of a scene.

    `diffusion` is the D that counts, nondimensional, of this scene or of what replaces its noise. Outward the bound
    lies beyond the moving separatrix, and beyond the speed of a slow escape at a far cut-off; inward it is what a block
    from rest can gain, plus what the start has in excess of that (derived in docs/theory). What an exact block has
    beyond a slender one moves the separatrix by no more than the bound of it, as it grows like e^τ.
    """
    forcing, start, exact = (
        scene.forcing,
        scene.start,
        largest_correction(scene.forcing.largest, scene.block.critical_angle),
    )
    bound = max(1.0, scene.overturning.angle - 1.0) + forcing.swing + exact + TUNING.deviations * math.sqrt(diffusion)
    (xx, xv), (_, vv) = start.covariance or ((0.0, 0.0), (0.0, 0.0))
    outward = abs(start.velocity) + TUNING.deviations * math.sqrt(vv)
    position, slope = forcing.particular(0.0)
    now = position - slope
    spread = TUNING.deviations * math.sqrt(max(xx + vv - 2.0 * xv, 0.0))
    excess = max(side * (start.angle - start.velocity - now) for side in (1.0, -1.0)) - 1.0 + exact + spread
    falls = start.angle * start.velocity < 0.0 or start.covariance is not None
    return max(bound + (max(excess, 0.0) if falls else 0.0), TUNING.start_margin * outward)
