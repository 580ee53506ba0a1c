"""Point masses on the nodes of a tensor mesh: the mesh, and a step of them as a matrix without negative entries.

The line x = 0 has two columns of nodes, one for each side. The masses of a mesh are an array (nodes,): the left side
first, angle by angle, the velocity fastest.
"""

import dataclasses
import functools
import math

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.sparse import csr_matrix

from fpk_rocking.density.clouds import set_down, trace_points
from fpk_rocking.density.paths import hermite_nodes, principal_axes
from fpk_rocking.density.space import Space
from fpk_rocking.density.step import Dynamics
from fpk_rocking.physics.gaussian import flight_covariance

LONG, SHORT = 7, 2
"""Gauss-Hermite nodes along both axes of the noise."""


@dataclasses.dataclass(frozen=True, eq=False)
class NodeMesh:
    """Nodes of a tensor mesh, apart on both sides of x = 0.

    Parameters
    ----------
    left, right : ndarray
        Ascending mesh lines of the angle for x < 0 and x > 0, with 0 as the last or first; empty where there are none.
    velocity : ndarray
        Ascending mesh lines of the velocity.
    """

    left: np.ndarray
    right: np.ndarray
    velocity: np.ndarray

    @classmethod
    def of(cls, angle_lines, velocity_lines):
        """Take the lines of a tensor mesh on which x = 0 is a line if it lies inside."""
        left, right = angle_lines[angle_lines <= 0.0], angle_lines[angle_lines >= 0.0]
        none = np.empty(0)
        return cls(left if len(left) > 1 else none, right if len(right) > 1 else none, velocity_lines)

    @functools.cached_property
    def points(self):
        """Angle, velocity and side of the nodes, (nodes,) each."""
        angle, velocity = np.concatenate([self.left, self.right]), self.velocity
        side = np.repeat([-1, 1], [len(self.left) * len(velocity), len(self.right) * len(velocity)])
        return np.repeat(angle, len(velocity)), np.tile(velocity, len(angle)), side

    @functools.cached_property
    def areas(self):
        """Integrals of the hat functions of the nodes, (nodes,)."""
        left, right, velocity = (0.5 * sum(_gaps(lines)) for lines in (self.left, self.right, self.velocity))
        return np.outer(np.concatenate([left, right]), velocity).ravel()

    @functools.cached_property
    def space(self):
        """Space of the bilinear functions that jump at x = 0, as discontinuous functions of degree 1."""
        return Space(np.union1d(self.left, self.right), self.velocity, 1)

    @functools.cached_property
    def origin(self):
        """Mark the nodes (nodes,) around the origin: no farther off than one mesh line, on both sides."""
        x, v, _ = self.points
        near = (
            max(-self.left[-2], self.right[1]),
            np.abs(np.delete(self.velocity, np.abs(self.velocity).argmin())).min(),
        )
        return (np.abs(x) <= near[0]) & (np.abs(v) <= near[1])

    def coefficients(self, masses):
        """Coefficients in `space` of the density in which the mass of a node is spread as its hat function."""
        values = (masses / self.areas).reshape(-1, len(self.velocity))
        corners = [sliding_window_view(part, (2, 2)) for part in np.split(values, [len(self.left)])]
        return np.einsum("xvij,ai,bj->xvab", np.concatenate(corners), _TO_LEGENDRE, _TO_LEGENDRE, optimize=True)

    def axes(self, *, spread):
        """Lines of both sides and of the velocity, each with variances and offsets of what a mass stands for.

        `spread` says whether that is the hat function about the node, for looking at it, or the node itself.
        """
        return tuple((lines, *_hat_moments(lines, spread)) for lines in (self.left, self.right, self.velocity))


_TO_LEGENDRE = np.array([[0.5, 0.5], [-0.5 / math.sqrt(3.0), 0.5 / math.sqrt(3.0)]])


def _gaps(lines):
    """Distance from each line to the one before and to the one after, 0 at the ends."""
    sizes = np.diff(lines)
    if not len(lines):
        return sizes, sizes
    return np.concatenate([[0.0], sizes]), np.concatenate([sizes, [0.0]])


def _hat_moments(lines, spread):
    """Second moments and means of normalized hat functions about their nodes; zeros without `spread`."""
    if not spread:
        return np.zeros(len(lines)), np.zeros(len(lines))
    before, after = _gaps(lines)
    return (before**3 + after**3) / (6.0 * (before + after)), (after - before) / 3.0


class Clouds:
    """Where the masses of a set of points go in one step, before it is known on which nodes they are set down.

    Parameters
    ----------
    points : tuple of ndarray, shape (n,)
        Angle, velocity and side.
    start, duration : float
        The step, nondimensional times.
    dynamics : Dynamics
    """

    def __init__(self, points, start, duration, dynamics: Dynamics):
        nodes, self.weights = hermite_nodes(LONG, SHORT)
        axes = principal_axes(*flight_covariance(dynamics.diffusion, duration))
        self.cutoff = dynamics.cutoff
        self.states, self.codes = trace_points(
            *points, start, duration, dynamics.harmonic, dynamics.diffusion, dynamics.restitution, dynamics.cutoff,
            nodes, nodes @ np.reshape(axes, (2, 2)),
        )  # fmt: skip

    def onto(self, mesh: NodeMesh, *, spread=False):
        """Set all clouds down on a mesh; `spread` as in `NodeMesh.axes`."""
        axes = mesh.axes(spread=spread)
        targets, masses, counts, sinks, more = set_down(self.states, self.codes, self.weights, self.cutoff, *axes)
        used = np.arange(targets.shape[1]) < counts[:, None]
        ends = np.concatenate([[0], np.cumsum(counts)])
        shape = len(counts), (len(mesh.left) + len(mesh.right)) * len(mesh.velocity)
        return NodeStep(csr_matrix((masses[used], targets[used], ends), shape=shape), sinks, more)


class NodeStep:
    """A step of masses from points to the nodes of a mesh; no entry is negative, and each row sums to 1 with its sinks.

    Parameters
    ----------
    matrix : csr_matrix, shape (points, nodes)
    sinks : ndarray, shape (points, 3)
        Part that overturns to the left, to the right, and that lands outside the mesh.
    more : ndarray, shape (points,)
        Variance that setting down adds to what a point's noise has.
    """

    def __init__(self, matrix, sinks, more):
        self._onto, self._sinks, self._more = matrix.T, sinks, more

    def apply(self, masses):
        """Return the masses (nodes,) after the step, and the masses (3,) that went to the sinks."""
        return self._onto @ masses, masses @ self._sinks

    def excess(self, masses):
        """Variance that setting down adds to the density, on average over the masses."""
        return float(masses @ self._more / masses.sum()) if masses.any() else 0.0
