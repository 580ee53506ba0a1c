"""Mesh lines of the phase plane, with x = 0 always among them: graded, or a window on a density that is still small."""

import math

import numpy as np

ANGLE_GRADING = 1.5
VELOCITY_GRADING = 1.3


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


def window_lines(low, high, cells):
    """About `cells` equal cells that cover [low, high], with 0 a mesh line where it lies inside or nearly so."""
    size = (high - low) / cells
    if low > size or high < -size:
        return np.linspace(low, high, cells + 1)
    first, last = math.floor(min(low, 0.0) / size), math.ceil(max(high, 0.0) / size)
    return size * np.arange(first, last + 1)


def velocity_bound(scene, diffusion):
    """Velocity beyond which a block is bound to overturn: past the moving separatrix by eight widths of the noise.

    The separatrix is x + v = 1 + A / sqrt(1 + Omega^2) at most (derived in docs/theory); the start is covered too.
    """
    forcing, start = scene.forcing, scene.start
    bound = 1.0 + forcing.amplitude / math.hypot(1.0, forcing.frequency) + 8.0 * math.sqrt(diffusion)
    spread = 0.0 if start.covariance is None else 8.0 * math.sqrt(start.covariance[1][1])
    return max(bound, 1.2 * (abs(start.velocity) + spread))
