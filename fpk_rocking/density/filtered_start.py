"""The start-up under filtered noise: from the start of a scene to the first densities that the mesh holds.

A block at rest stays in the mass at rest of its node. From any other start, and from rest under a force that lifts the
block off for certain, the flight is linear until something happens to the block: angle, velocity and the states of the
filter are Gaussian together, in closed form, and at each node of the filter's states so are angle and velocity. The
mesh takes over when it resolves these, or else at the last step before anything can happen. So narrow a density of an
exact block is taken as Gaussian too: see `exact_moments`.
"""

import math

import numpy as np

from fpk_rocking.base.basis import legendre_basis
from fpk_rocking.density.filter_nodes import whitened
from fpk_rocking.density.gaussian import resolution_of
from fpk_rocking.density.tuning import TUNING
from fpk_rocking.physics.noise.state_space import transition_and_factor


class FilteredStart:
    """The Gaussian of angle, velocity and the filter's states, in a flight from the start in which nothing happens.

    Parameters
    ----------
    scene : Scene
        With filtered noise.
    nodes : Nodes
    dynamics : Dynamics
        Without noise.
    """

    def __init__(self, scene, nodes, dynamics):
        self.scene, self.nodes, self.dynamics = scene, nodes, dynamics
        start = scene.start
        self._mean = np.array([start.angle, start.velocity])
        self._covariance = np.zeros((2, 2)) if start.covariance is None else np.array(start.covariance)
        push = self._mean[0] or self._mean[1] or scene.forcing.value(0.0)
        self.side = 1 if push > 0.0 else -1
        self._moments = None
        if dynamics.critical_angle is not None:
            self._moments = exact_moments(dynamics, nodes, self._mean, self._covariance, scene.period, self.side)

    @property
    def at_rest(self):
        """Whether the block starts at rest and the noise decides when it is lifted off."""
        if self._mean.any() or self._covariance.any():
            return False
        room = TUNING.filtered_reach * math.sqrt(self.scene.noise.variance)
        return abs(self.scene.forcing.value(0.0)) <= self.dynamics.lift_off + room

    def at(self, time):
        """Mean (2,) and covariance (2 + states, 2 + states) at a `time` since τ = 0.

        The mean is of angle and velocity, the covariance of these and the whitened states.
        """
        if self._moments:
            return self._moments(time)
        flight = self.dynamics.affine(0.0, time)
        mean = flight.matrix @ self._mean + flight.shifts[self.side]
        return mean, _joint_covariance(self.nodes, self._covariance, time)

    def undisturbed(self, time):
        """Whether nothing can have happened by a `time`: the block is far from x = 0 and from the cut-off."""
        mean, covariance = self.at(time)
        reach = TUNING.filtered_reach * math.sqrt(covariance[0, 0])
        return reach < self.side * mean[0] < self.dynamics.cutoff - reach

    def takeover_step(self, space, begins):
        """Return the number of the step before which the mesh takes over: resolved, or the last without an event.

        `begins` (n,) are the times at which steps begin, from 0 on.
        """
        last = 0
        for step, time in enumerate(begins[1:], 1):
            if not self.undisturbed(time):
                break
            last = step
            if self.resolution(time, space) >= TUNING.filtered_resolved:
                break
        return last

    def resolution(self, time, space):
        """Least standard deviation at a node of the noise, at a `time`, over the size of a cell of a mesh.

        The mesh is that of a `Space`; see `resolution_of`.
        """
        mean, covariance = self.at(time)
        return resolution_of(mean, covariance[:2, :2] - covariance[:2, 2:] @ covariance[2:, :2], space)

    def project(self, time, space):
        """Densities at a `time` on a mesh, a `Space`, and the outflow (3,).

        The densities are coefficients (nodes in y1, nodes in y2, *space.shape).
        """
        mean, covariance = (
            self.at(time) if time > 0.0 else (self._mean, np.pad(self._covariance, (0, len(self.nodes.drift))))
        )
        slope = covariance[:2, 2:]
        rest = covariance[:2, :2] - slope @ slope.T
        points, weights = _points(rest)
        out, outflow = np.zeros((*self.nodes.weights.shape, *space.shape)), np.zeros(3)
        for place, weight in np.ndenumerate(self.nodes.weights):
            states = points + mean + slope @ self.nodes.states[place][: slope.shape[1]]
            outflow += deposit_points(space, states, weight * weights, self.side, out[place])
        return out, outflow


def _joint_covariance(nodes, covariance, time):
    """Covariance (2 + states, 2 + states) of angle, velocity and states at a `time` of a slender block's flight.

    `covariance` (2, 2) is that of angle and velocity at its begin; `nodes`: `Nodes`, or the `Whitened` filter.
    """
    count = len(nodes.drift)
    joint = np.zeros((2 + count, 2 + count))
    joint[0, 1] = joint[1, 0] = 1.0
    joint[1, 2] = nodes.sigma
    joint[2:, 2:] = nodes.drift
    phi, factor = transition_and_factor(joint, np.append([0.0, 0.0], nodes.input), time)
    begin = np.eye(2 + count)
    begin[:2, :2] = covariance
    return phi @ begin @ phi.T + factor @ factor.T


def exact_moments(dynamics, nodes, mean, covariance, end, side):
    """Gaussian of an exact block and the filter's states, as long as nothing happens, to second order in its spread.

    Parameters
    ----------
    dynamics : Dynamics
        Without noise.
    nodes : Nodes
    mean, covariance : ndarray, shapes (2,), (2, 2)
        Of angle and velocity at time 0.
    end : float
    side : int

    Returns
    -------
    callable
        Mean (2,) and covariance (2 + states, 2 + states) as a function of a time up to the end.
    """
    from scipy.integrate import solve_ivp  # takes longer to import than all else here

    alpha, forcing, size = dynamics.critical_angle, dynamics.forcing, 2 + len(nodes.drift)
    rate, source = np.zeros((size, size)), np.zeros((size, size))
    rate[0, 1], rate[2:, 2:], source[2:, 2:] = 1.0, nodes.drift, np.outer(nodes.input, nodes.input)

    def rates(time, state):
        """Time derivative of mean and joint covariance, flattened like these in `state`, at a `time`."""
        x, v, joint = state[0], state[1], state[2:].reshape(size, size)
        phi, force = alpha * (1.0 - side * x), forcing.value(time)
        sine, cosine = side * alpha * math.sin(phi), math.cos(phi)
        rate[1, 0], rate[1, 2] = cosine + force * sine, nodes.sigma * cosine
        bend = 0.5 * (sine - force * alpha**2 * cosine) * joint[0, 0] + nodes.sigma * sine * joint[0, 2]
        moved = rate @ joint
        return np.concatenate([[v, force * cosine - sine / alpha**2 + bend], (moved + moved.T + source).ravel()])

    begin = np.eye(size)
    begin[:2, :2] = covariance
    states = np.concatenate([mean, begin.ravel()])
    moments_at = solve_ivp(rates, (0.0, end), states, method="DOP853", rtol=1e-8, atol=1e-14, dense_output=True).sol
    return lambda time: (moments_at(time)[:2], moments_at(time)[2:].reshape(size, size))


def spread_left(noise, covariance, time):
    """Part of the angle's standard deviation, at a time of a flight, that is left where the filter's states are known.

    `noise`: filtered; `covariance` (2, 2) of angle and velocity at the begin, or None; `time`: since then.
    """
    joint = _joint_covariance(whitened(noise), covariance or np.zeros((2, 2)), time)
    return math.sqrt(max(1.0 - joint[0, 2:] @ joint[2:, 0] / joint[0, 0], 0.0))


def _points(covariance):
    """Points (n, 2) and weights (n,) that stand for a Gaussian about 0 of a covariance (2, 2).

    They are exact in its first moments. Along both axes they have a spacing of a tenth of a standard deviation, up to
    six.
    """
    values, axes = np.linalg.eigh(covariance)
    lines, spacing = [], 0.1
    for value in np.sqrt(np.maximum(values, 0.0)):
        count = 60 if value > 0.0 else 0
        lines.append(value * spacing * np.arange(-count, count + 1))
    weights = [np.exp(-0.5 * np.square(spacing * (np.arange(len(line)) - len(line) // 2))) for line in lines]
    weights = [weight / weight.sum() for weight in weights]
    grid = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 2)
    return grid @ axes.T, np.outer(*weights).ravel()


def deposit_points(space, states, masses, side, out):
    """Add point masses (n,) at states (n, 2), angle and velocity, to the coefficients `out` of a density.

    `out` has the shape of the `Space`; a point on x = 0 is on the given side. Returns the outflow (3,): beyond the
    cut-off to the left and to the right, and beyond the velocity bound.
    """
    cells, references = [], []
    for lines, values in zip(space.lines, states.T, strict=True):
        cell = np.searchsorted(lines, values, side="right" if side > 0 else "left") - 1
        nearest = np.clip(cell, 0, len(lines) - 2)
        references.append((values - lines[nearest]) / np.diff(lines)[nearest])
        cells.append(cell)
    (i, j), (limit, across) = cells, space.shape[:2]
    beyond = [i < 0, i >= limit, (i >= 0) & (i < limit) & ((j < 0) | (j >= across))]
    outflow = np.array([masses[where].sum() for where in beyond])
    inside = ~(beyond[0] | beyond[1] | beyond[2])
    i, j = i[inside], j[inside]
    along, across = (legendre_basis(part[inside], space.degree) for part in references)
    values = np.einsum("n,na,nb->nab", masses[inside] / space.areas[i, j], along, across)
    np.add.at(out, (i, j), values)
    return outflow
