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

_RESTING_SPACING, _REACH = (0.55, 0.46, 0.4, 0.34, 0.29, 0.25, 0.21), 5.0
"""Most spacing of the nodes in y1, by resolution, and the least y1 of the last, where blocks may rest at the end of a
cycle."""

_RESTING_BESIDE = (4, 5, 6, 7, 8, 9, 10)
"""Gauss-Hermite nodes in y2 then."""

_RESTING_POINTS = 5
"""Gauss points of a cell, an axis, where the mesh is fine about rest."""

_RESTING_PART = 0.5
"""Part of the cells that hold something, about, where blocks may rest: the others are for the few that do not."""

_MAY_REST = 4.0
"""A block may rest where |f| without noise is below its lift-off and so many standard deviations of the noise."""

_LAST = {
    True: (100, 140, 200, 300, 420, 600, 840),
    False: (200, 400, 800, 1600, 3200, 6400, 12800),
}
"""Parts of a cycle that the last step is, by resolution, where a block may rest, for noise that has a derivative and
that has none: excursions beyond the level of lift-off within a step are missed, an error of order 1/2 then."""

_GROWTH = 0.3
"""Length of a step over the time from its end to the cycle's, where a block may rest."""

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
        Nodes in each state of the filter.
    points : int
        Gauss points of a cell in both axes.
    marks : ndarray
        Begins of the steps of a leg and its end, as parts of a cycle; of the legs of a cycle, see `density.propagator`,
        the steps of one are kept.
    part : float
        Part of the cells that hold something, about.
    spacing : float, optional
        Of the nodes in the first state; Gauss-Hermite nodes unless given.
    """

    plane: object
    nodes: tuple[int, ...]
    points: int
    marks: np.ndarray
    part: float = 1.0
    spacing: float | None = None

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
    last = 1.0 / _LAST[space.smooth][number]
    marks = graded_marks(1.0 / legs, 1.0 / (legs * steps), last)
    fine = _fine_about_rest(plane, scene, last)
    count, spacing = lattice(scene, _RESTING_SPACING[number])
    return NodeGrid(fine, (count, _RESTING_BESIDE[number])[:states], _RESTING_POINTS, marks, _RESTING_PART, spacing)


def may_rest(scene):
    """Whether noise may leave a block at rest at the end of a cycle."""
    return abs(scene.forcing.value(0.0)) < scene.block.lift_off + _MAY_REST * math.sqrt(scene.noise.variance)


def lattice(scene, most):
    """Return number and spacing of nodes of y1, the level of lift-off at a cycle's end half way between two of them.

    Which nodes are beyond it tells the part of the blocks that the noise lifts off: with Gauss-Hermite nodes that part
    was off by up to the half of a weight.
    """
    level = abs(scene.block.lift_off - abs(scene.forcing.value(0.0))) / math.sqrt(scene.noise.variance)
    halves = math.ceil(2.0 * level / most - 1e-9) if 4.0 * level > most else 0
    spacing = 2.0 * level / halves if halves else most
    count = math.ceil(2.0 * _REACH / spacing) + 1
    return count + (count + halves) % 2, spacing


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
    """Lines and more of them about 0, down to a least one, by a ratio at most from one to the next."""
    first = lines[lines > 0.0][0]
    count = max(math.ceil(math.log(first / least) / math.log(ratio)), 0)
    more = first * (least / first) ** (np.arange(1.0, 1.0 + count) / max(count, 1))
    return np.sort(np.concatenate([lines, more, -more]))
