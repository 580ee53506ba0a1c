"""The start of a realization: a point, or a draw from a Gaussian."""

import numpy as np

from fpk_rocking.base.jit import kernel
from montecarlo.engines.random import normal


def start_numbers(start):
    """Return angle, velocity and the Cholesky factor xx, vx, vv of their covariance, shape (5,); zeros for a point."""
    spread = np.zeros((2, 2)) if start.covariance is None else np.linalg.cholesky(np.array(start.covariance))
    return np.array([start.angle, start.velocity, spread[0, 0], spread[1, 0], spread[1, 1]])


@kernel
def draw_start(stream, numbers):
    """Draw the angle and velocity at time 0; a point takes no random numbers."""
    angle, velocity, xx, vx, vv = numbers
    if xx > 0.0:
        first, second = normal(stream), normal(stream)
        angle, velocity = angle + xx * first, velocity + vx * first + vv * second
    return angle, velocity


@kernel(inline="always")
def draw(stream, problem, room):  # noqa: ARG001
    """Draw the start alone."""
    return draw_start(stream, problem.start)
