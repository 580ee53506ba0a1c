"""How fine a solution under filtered noise is: a mesh of the plane, nodes of the filter's states, steps."""

import dataclasses
import math
from typing import NamedTuple

import numpy as np

_TURN = 1.2
"""Longest step times the frequency at which a filter swings: held noise that swings faster would alias."""

_NODES = {1: (5, 6, 8, 10, 12, 14, 16), 2: (4, 5, 6, 8, 10, 12, 14)}
"""Nodes in each state of a filter of one state, or two, by resolution from coarse to fine."""

_POINTS = 8
"""Gauss points of a cell, an axis: each is one path."""

_RESTING_NODES = {
    1: ((12,), (16,), (20,), (24,), (28,), (32,), (36,)),
    2: ((12, 4), (14, 5), (18, 6), (22, 7), (26, 8), (30, 9), (34, 10)),
}
"""Nodes of a scene that may rest after a cycle: the noise that lifts a block off has to be met."""

_RESTING_POINTS = 5
"""Gauss points of a cell, an axis, where the mesh is fine about rest."""

_RESTING_PART = 0.5
"""Part of the cells that hold something, about, where blocks may rest: the others are for the few that do not."""

_MAY_REST = 4.0
"""A block may rest where |f| without noise is below its lift-off and so many standard deviations of the noise."""

_LAST, _GROWTH = (100, 140, 200, 300, 420, 600, 840), 0.2
"""Parts of a cycle that the last step is, by resolution, and length of a step over the time from its end to the
cycle's, where a block may rest."""

_REST_CELLS = 0.35, 10.0
"""Cells at rest: in velocity, over the speed from which a block comes to rest in the last step; in angle, over the
square of that cell."""

_ANGLE_RATIO, _VELOCITY_RATIO = 4.0, 2.5
"""Sizes of neighbouring cells where the mesh is made finer about rest."""

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
    marks : ndarray
        Begins of the steps of a leg and its end, as parts of a cycle; of the legs of a cycle, see `density.propagator`,
        the steps of one are kept.
    part : float
        Part of the cells that hold something, about.
    """

    plane: object
    nodes: tuple[int, ...]
    points: int
    marks: np.ndarray
    part: float = 1.0

    @property
    def legs(self):
        """Legs of a cycle."""
        return round(1.0 / self.marks[-1])

    @property
    def steps(self):
        """Steps a cycle."""
        return self.legs * (len(self.marks) - 1)

    @property
    def memory(self):
        """Bytes that a run takes, about, densities after all cycles left out."""
        modes, cells = self.plane.degree + 1, math.prod(self.plane.cells)
        unknowns = cells * modes**2
        step = self.part * cells * (20 * _EVENTS * self.points**2 + 8 * 2.2 * modes**3)
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
    space = scene.noise.space
    states, swings = space.order, float(np.abs(space.rates.imag).max())
    legs = 2 if scene.forcing.half_antisymmetric else 1
    steps = math.ceil(max(plane.steps, scene.period * swings / _TURN) / legs)
    if not may_rest(scene):
        marks = np.linspace(0.0, 1.0 / legs, steps + 1)
        return NodeGrid(plane, (_NODES[states][number],) * states, _POINTS, marks)
    last = 1.0 / _LAST[number]
    marks = graded_marks(1.0 / legs, 1.0 / (legs * steps), last)
    fine = _fine_about_rest(plane, scene, last)
    return NodeGrid(fine, _RESTING_NODES[states][number], _RESTING_POINTS, marks, _RESTING_PART)


def may_rest(scene):
    """Whether noise may leave a block at rest at the end of a cycle."""
    return abs(scene.forcing.value(0.0)) < scene.block.lift_off + _MAY_REST * math.sqrt(scene.noise.variance)


def graded_marks(leg, longest, shortest):
    """Begins of steps and their end, in [0, leg], steps that grow from the end backwards."""
    before = [0.0]
    while before[-1] < leg * (1.0 - 1e-12):
        before.append(before[-1] + min(longest, max(shortest, _GROWTH * before[-1])))
    return leg * (1.0 - np.array(before[::-1]) / before[-1])


def _fine_about_rest(plane, scene, last):
    """Mesh with more lines about x = v = 0, for blocks that come to rest in the last step, a part of a cycle."""
    part, square = _REST_CELLS
    velocity = part * 0.5 * (1.0 - scene.block.restitution) * last * scene.period
    angle = square * velocity**2
    return dataclasses.replace(
        plane,
        angle_lines=_with_finer(plane.angle_lines, angle, _ANGLE_RATIO),
        velocity_lines=_with_finer(plane.velocity_lines, velocity, _VELOCITY_RATIO),
    )


def _with_finer(lines, least, ratio):
    """Lines and more of them about 0, by a ratio from one to the next, down to a least one."""
    first = lines[lines > 0.0][0]
    more = first * ratio ** -np.arange(1.0, 1.0 + max(math.floor(math.log(first / least) / math.log(ratio)), 0))
    return np.sort(np.concatenate([lines, more, -more]))
