"""Mean and covariance of a flight that nothing disturbs, under noise with an envelope, by quadrature."""

import math

import numpy as np


def flight_moments(scene, times, covariance):
    """Mean and covariance of an undisturbed flight under f_0 + g η, η of an autocovariance; (n, 2), (n, 2, 2)."""
    nodes, weights = np.polynomial.legendre.leggauss(12)
    means, covariances = [], []
    for time in times:
        kinks = [k for k in scene.noise.envelope.kinks if 0.0 < k < time]
        edges = np.union1d(np.linspace(0.0, time, 41), kinks)
        s = (0.5 * (edges[1:] + edges[:-1])[:, None] + 0.5 * np.diff(edges)[:, None] * nodes).ravel()
        w = (0.5 * np.diff(edges)[:, None] * weights).ravel()
        kernel = np.stack([np.sinh(time - s), np.cosh(time - s)]) * w * scene.noise.envelope.value(s)
        if covariance is None:
            covariances.append(2.0 * scene.noise.diffusion * (kernel / w) @ kernel.T)
        else:
            covariances.append(kernel @ covariance(s[:, None] - s) @ kernel.T)
        (p0, q0), (p1, q1) = scene.forcing.particular(0.0), scene.forcing.particular(time)
        y, z = scene.start.angle - 1.0 - p0, scene.start.velocity - q0
        c, h = math.cosh(time), math.sinh(time)
        means.append([1.0 + p1 + c * y + h * z, q1 + h * y + c * z])
    return np.array(means), np.array(covariances)
