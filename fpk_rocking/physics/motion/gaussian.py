"""Gaussian flight: the covariance that white noise gathers between impacts (derived in docs/theory)."""

import math

import numpy as np

from fpk_rocking.base.jit import kernel
from fpk_rocking.base.types import Array


@kernel
def flight_covariance(diffusion, duration):
    """Covariance of angle and velocity after a flight from a point, dv = (x - s + f) dt + sqrt(2 D) dW.

    Parameters
    ----------
    diffusion : float
        D, nondimensional.
    duration : float
        Flight time t, nondimensional.

    Returns
    -------
    xx, xv, vv : float
        D (sinh(2t)/2 - t), D sinh(t)^2, D (t + sinh(2t)/2). Short flights use the series of xx, which would cancel.
    """
    t = duration
    sinh = math.sinh(t)
    if t < 0.1:
        square = t * t
        xx = t * square * (2.0 / 3.0) * (1.0 + square / 5.0 * (1.0 + square * (2.0 / 21.0) * (1.0 + square / 18.0)))
    else:
        xx = 0.5 * math.sinh(2.0 * t) - t
    return diffusion * xx, diffusion * sinh * sinh, diffusion * (t + 0.5 * math.sinh(2.0 * t))


_TWO_THIRDS, _THREE_HALVES, _HALF = math.sqrt(2.0 / 3.0), math.sqrt(1.5), math.sqrt(0.5)


@kernel
def covariance_factor(diffusion, duration):
    """Cholesky factor xx, vx, vv of the covariance of a flight of at most 0.1, to rounding (`flight_covariance`)."""
    root, square = math.sqrt(diffusion * duration), duration * duration
    xx = 1.0 + square * (1.0 / 10.0 + square * (19.0 / 4200.0 + square * (29.0 / 378000.0)))
    vx = 1.0 + square * (7.0 / 30.0 + square * (209.0 / 12600.0 + square * (29.0 / 75600.0)))
    vv = 1.0 - square * (1.0 / 30.0 - square * (17.0 / 12600.0 - square / 54000.0))
    return _TWO_THIRDS * duration * root * xx, _THREE_HALVES * root * vx, _HALF * root * vv


def accumulated_covariance(weights: Array, left: Array) -> tuple[Array, Array, Array]:
    """Covariance xx, xv, vv of noise of strengths `weights` (..., n), 2 D dt, at times `left` (n,) before the end."""
    sinh, cosh = np.sinh(left), np.cosh(left)
    return weights @ sinh**2, weights @ (sinh * cosh), weights @ cosh**2


def flight_shears(duration: float) -> tuple[float, float]:
    """Shears (angle by velocity, velocity by angle) of which a flight is made: the first, the second, the first."""
    return math.tanh(0.5 * duration), math.sinh(duration)


def shear_diffusion_variances(diffusion: float, duration: float) -> tuple[float, float]:
    """Variances by which velocity and angle (twice) diffuse between the three shears of a flight (docs/theory)."""
    shear, sinh = flight_shears(duration)
    if duration < 0.1:
        square = duration * duration
        deficit = square / 6.0 * (1.0 - square * (7.0 / 60.0) * (1.0 - square * (31.0 / 294.0)))
    else:
        deficit = 1.0 - duration / sinh
    return diffusion * (sinh + duration * math.cosh(duration)), diffusion * shear * deficit
