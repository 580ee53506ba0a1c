"""How fine a solution under filtered noise is: a mesh of the plane, nodes of the filter's states, steps."""

import math
from typing import NamedTuple

_TURN = 1.2
"""Longest step times the frequency at which a filter swings: held noise that swings faster would alias."""

_NODES = {1: (5, 6, 8, 10, 12, 14, 16), 2: (4, 5, 6, 8, 10, 12, 14)}
"""Nodes in each state of a filter of one state, or two, by resolution from coarse to fine."""

_POINTS = 8
"""Gauss points of a cell, an axis: each is one path."""

_EVENTS = 0.5
"""Part of the cells that an event can reach, about; the paths from these are kept."""


class NodeGrid(NamedTuple):
    """What a solution of one scene is made with.

    Parameters
    ----------
    plane : Grid
        Mesh of angle and velocity, made for white noise of equal Melnikov variance.
    nodes : tuple of int
        Gauss-Hermite nodes in each state of the filter.
    points : int
        Gauss points of a cell in both axes.
    steps : int
        Steps a cycle, even.
    legs : int
        Legs of a cycle, see `density.propagator`: the steps of one are kept.
    """

    plane: object
    nodes: tuple[int, ...]
    points: int
    steps: int
    legs: int

    @property
    def memory(self):
        """Bytes that a run takes, about, densities after all cycles left out."""
        modes, cells = self.plane.degree + 1, math.prod(self.plane.cells)
        unknowns = cells * modes**2
        step = cells * (20 * _EVENTS * self.points**2 + 8 * 2.2 * modes**3)
        return 8 * unknowns * (8 + 3 * math.prod(self.nodes)) + self.steps / self.legs * (self.nodes[0] + 1) * step

    def stored(self, cycles):
        """Bytes of the marginal densities after all cycles."""
        return self.plane.stored(cycles)

    @property
    def settings(self):
        """Mesh, degree, nodes and steps as plain values."""
        angle_cells, velocity_cells = self.plane.cells
        plain = {"angle_cells": angle_cells, "velocity_cells": velocity_cells, "degree": self.plane.degree}
        return plain | {"nodes": list(self.nodes), "points": self.points, "steps": self.steps}


def node_grid(scene, plane, number):
    """Return the `NodeGrid` of a scene with filtered noise on a mesh made by resolution `number`."""
    states = 1 if scene.noise.filter == "exponential" else 2
    swings = scene.noise.frequency * math.sqrt(max(1.0 - (scene.noise.damping or 1.0) ** 2, 0.0))
    steps = max(plane.steps, scene.period * swings / _TURN)
    legs = 2 if scene.forcing.half_antisymmetric else 1
    return NodeGrid(plane, (_NODES[states][number],) * states, _POINTS, 2 * math.ceil(0.5 * steps), legs)
