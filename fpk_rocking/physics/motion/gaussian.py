"""Gaussian flight: the covariance that white noise gathers between impacts (derived in docs/theory)."""

import math

from fpk_rocking.base.jit import kernel


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
