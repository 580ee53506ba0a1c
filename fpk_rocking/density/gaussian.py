"""A Gaussian density of angle and velocity in closed form: a start, and what it becomes while nothing can happen."""

import bisect
import math

import numpy as np

from fpk_rocking.base.basis import find_cells
from fpk_rocking.density.step.dynamics import Dynamics


class Gaussian:
    """A Gaussian density of angle and velocity: mean (2,), covariance (2, 2); nondimensional."""

    def __init__(self, mean, covariance):
        self.mean, self.covariance = np.asarray(mean, dtype=float), np.asarray(covariance, dtype=float)

    @classmethod
    def of(cls, start):
        """Take the start of a scene, a `Start`; a point has covariance 0."""
        return cls((start.angle, start.velocity), np.zeros((2, 2)) if start.covariance is None else start.covariance)

    def __call__(self, angle, velocity):
        """Density at points `angle`, `velocity` (broadcast)."""
        xx, xv, vv = self.covariance[0, 0], self.covariance[0, 1], self.covariance[1, 1]
        determinant = xx * vv - xv * xv
        x, v = angle - self.mean[0], velocity - self.mean[1]
        exponent = (vv * x * x - 2.0 * xv * x * v + xx * v * v) / determinant
        return np.exp(-0.5 * exponent) / (2.0 * math.pi * math.sqrt(determinant))

    def tails(self, cutoff):
        """Masses beyond the cut-off, an angle, to the left and to the right; a list of two."""
        spread = math.sqrt(2.0 * self.covariance[0, 0])
        return [0.5 * math.erfc((cutoff + sign * self.mean[0]) / spread) for sign in (1.0, -1.0)]

    def resolution(self, space):
        """Least conditional standard deviation over the size of the cell of a mesh (`Space`) that the mean is in."""
        return resolution_of(self.mean, self.covariance, space)

    def after_flight(self, dynamics: Dynamics, start, duration, side):
        """Gaussian after a flight of a slender block, on one side, in which nothing happens.

        The flight is from time `start` on for a `duration`, under `Dynamics`, nondimensional.
        """
        flight = dynamics.affine(start, duration)
        xx, xv, vv = dynamics.covariance(start, duration)
        covariance = flight.matrix @ self.covariance @ flight.matrix.T + [[xx, xv], [xv, vv]]
        return Gaussian(flight.matrix @ self.mean + flight.shifts[side], covariance)


def resolution_of(mean, covariance, space):
    """Least conditional standard deviation of a Gaussian over the size of the cell of a mesh that its mean is in.

    `mean` (2,) and `covariance` (2, 2) are those of angle and velocity; the mesh is a `Space`.
    """
    (xx, xv), (_, vv) = covariance
    if min(xx, vv) <= 0.0:
        return 0.0
    angle, velocity = (cell_size(lines, point) for lines, point in zip(space.lines, mean, strict=True))
    return min(math.sqrt(max(xx - xv * xv / vv, 0.0)) / angle, math.sqrt(max(vv - xv * xv / xx, 0.0)) / velocity)


def exact_flight(gaussian: Gaussian, dynamics: Dynamics, end, side):
    """Return a function of time, 0 to `end`: the Gaussian of an exact block in a flight in which nothing happens.

    `gaussian` is that at time 0. Its moments obey ordinary differential equations of first order in its spread, which
    are integrated as far as asked. `dynamics` are those of the scene, with its noise.
    """
    from scipy.integrate import DOP853  # takes longer to import than all else here

    alpha, forcing, envelope = dynamics.critical_angle, dynamics.forcing, dynamics.envelope

    def rates(time, state):
        """Time derivatives of the means x, v and the covariances xx, xv, vv, `state`, at a `time`."""
        x, v, xx, xv, vv = state
        phi, force = alpha * (1.0 - side * x), forcing.value(time)
        sine, cosine = math.sin(phi), math.cos(phi)
        stiff = cosine + side * force * alpha * sine
        noise = 2.0 * dynamics.diffusion * cosine**2
        if envelope is not None:
            noise *= max(envelope.value(time) ** 2, dynamics.least_intensity)
        return [v, force * cosine - side * sine / alpha, 2.0 * xv, vv + stiff * xx, 2.0 * stiff * xv + noise]

    (xx, xv), (_, vv) = gaussian.covariance
    solver = DOP853(rates, 0.0, np.array([*gaussian.mean, xx, xv, vv]), end, rtol=1e-8, atol=1e-30)
    ends, pieces = [], []

    def at(time):
        """`Gaussian` at a `time` up to the end, integrated up to there if it is not yet."""
        # Most starts meet the mesh long before the end, and a record makes many steps.
        while solver.status == "running" and solver.t < max(time, 1e-300):
            solver.step()
            ends.append(solver.t)
            pieces.append(solver.dense_output())
        x, v, xx, xv, vv = pieces[min(bisect.bisect_left(ends, time), len(pieces) - 1)](time)
        return Gaussian((x, v), [[xx, xv], [xv, vv]])

    return at


def initial_density(start, space, cutoff):
    """Coefficients (``space.shape``) of a Gaussian start on a mesh, and its masses past the cut-offs (2,).

    Both are zero for a point. `start`: that of a scene; `cutoff`: angle of overturning.
    """
    if start.covariance is None:
        return np.zeros(space.shape), [0.0, 0.0]
    gaussian = Gaussian.of(start)
    return space.project(gaussian, 2 * space.degree + 2), gaussian.tails(cutoff)


def cell_size(lines, point):
    """Size of the cell between ascending lines (n,) that a point, a number, is in."""
    cell = find_cells(lines, point, "left")
    return lines[cell + 1] - lines[cell]
