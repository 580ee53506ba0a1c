"""A time step in which slow impacts are followed in shorter parts of it.

Under |f| < 1 a block that meets x = 0 slowly bounces many times within a step, and noise moves it between the bounces.
`characteristics.trace_point` takes that noise as two kicks of the velocity. That has an error of an order between 1 and
1.5 in the step, of which the differences of solutions show a part only. So the cells from which impacts may be that
slow, `slow_cells`, take the step in parts, on a small mesh about the origin whose lines are lines of the mesh, and all
others at once. Both are linear maps of the density, and the step is their sum. How many parts: `Resolution.adapted`.
"""

import math

import numpy as np

from fpk_rocking.density.space import Space
from fpk_rocking.density.step.dynamics import Dynamics
from fpk_rocking.density.step.step import (
    Characteristics,
    Quadrature,
    Step,
    mark_massive_cells,
    scatter_buffers,
    with_neighbours,
)
from fpk_rocking.density.tuning import TUNING
from fpk_rocking.physics.motion.equation import acceleration, acceleration_bounds

SIDES = -1, 1


class ContactStep:
    """The transfer operator of one step on a mesh, of which the `slow` cells take the step in equal parts.

    It is used like a `Step`. Of the small mesh, in each part, a cell becomes active when it holds more than
    `negligible`; without a negligible mass all of its cells are active.

    Parameters
    ----------
    space : Space
        The mesh before and after the step.
    start, duration : float
        Time at which the step begins, and its length, τ.
    dynamics : Dynamics
        What moves the block.
    quadrature : Quadrature
        Numbers of nodes, of the whole step and of its parts.
    parts : int
        Number of parts; with 1 the step is a `Step`.
    negligible : float
        Mass that a cell of the small mesh must have held to be active.
    buffers : ndarray, optional
        As of `Step`.
    """

    def __init__(
        self,
        space: Space,
        start,
        duration,
        dynamics: Dynamics,
        quadrature: Quadrature,
        parts: int,
        negligible: float = 0.0,
        buffers=None,
    ):
        whole = Characteristics(space, start, duration, dynamics, quadrature, cells=False)
        self._whole, self._negligible, self.target = Step(whole, space, buffers), negligible, space
        self.slow = slow_cells(whole) if parts > 1 else np.zeros_like(whole.active)
        self.active = np.zeros_like(whole.active)
        self._parts: list[Step] = []
        if self.slow.any():
            self.window = _window(whole, self.slow)
            small = _part_of(space, self.window)
            # An end of the small mesh that is not one of the mesh is no cut-off.
            reaches = self.window[0].start == 0, self.window[0].stop == len(whole.active)
            self._exits = [side if reached else 2 for side, reached in enumerate(reaches)] + [2]
            shared, part = scatter_buffers(small), duration / parts
            for begin in (start + part * np.arange(parts)).tolist():
                paths = Characteristics(small, begin, part, dynamics, quadrature, cells=False)
                self._parts.append(Step(paths, small, shared))

    @property
    def nbytes(self):
        """Bytes of the whole step and of its parts, as of `Step`."""
        return sum(step.nbytes for step in (self._whole, *self._parts))

    def activate(self, cells):
        """Add the cells of a mask (angle cells, velocity cells) to those whose mass the step moves."""
        self.active |= cells
        self._whole.activate(cells & ~self.slow)
        if self._negligible == 0.0:
            for step in self._parts:
                step.activate(np.ones(step.target.shape[:2], dtype=bool))

    def apply(self, coefficients):
        """Return (coefficients, masses): the density after the step, and what left in it (3,), as of `Step`."""
        if not self._parts:
            return self._whole.apply(coefficients)
        slow = (self.slow & self.active)[..., None, None]
        out, absorbed = self._whole.apply(np.where(slow, 0.0, coefficients))
        density = np.where(slow, coefficients, 0.0)[self.window]
        for step in self._parts:
            marks = np.zeros(step.active.shape, dtype=bool)
            if mark_massive_cells(density, step.target.areas, self._negligible, step.active, marks):
                step.activate(with_neighbours(marks))
            density, left = step.apply(density)
            np.add.at(absorbed, self._exits, left)
        out[self.window] += density
        return out, absorbed

    def apply_adjoint(self, values, exit_values):
        """Return the mean, before the step, of a function of the state after it: the adjoint of `apply` in L2.

        What leaves the small mesh other than past the cut-off counts as truncated.
        """
        out = self._whole.apply_adjoint(values, exit_values)
        if self._parts:
            function, exits = np.ascontiguousarray(values[self.window]), np.asarray(exit_values, float)[self._exits]
            for step in reversed(self._parts):
                function = step.apply_adjoint(function, exits)
            slow = self.slow & self.active
            out[slow] = function[slow[self.window]]
        return out


def slow_cells(whole: Characteristics):
    """Return a mask (angle cells, velocity cells) of cells from which an impact within a step may be slow.

    An impact is slow below `linear_impact` standard deviations of the velocity that noise gathers in a step.
    """
    dynamics, duration, (angle, velocity) = whole.dynamics, whole.duration, whole.source.lines
    segment = dynamics.segment(whole.start, duration)
    ends = (-1, segment.force_low), (1, segment.force_high)
    pulls = [-acceleration(0.0, side, force, dynamics.block) for side, force in ends]
    pull = np.where(angle[:-1] + angle[1:] > 0.0, pulls[1], pulls[0])
    low, slow = (_least_size(lines) for lines in (angle, velocity))
    fastest = TUNING.linear_impact * math.sqrt(2.0 * dynamics.diffusion * duration)
    # Before an impact that is slow a block has not been faster, but where the force lifts it off.
    near = low < fastest * duration + 0.5 * np.maximum(-pull, 0.0) * duration**2
    return whole.event_cells & near[:, None] & (slow**2 + (2.0 * np.maximum(pull, 0.0) * low)[:, None] < fastest**2)


def _least_size(lines):
    """Return the least size (cells,) of the numbers in the cells between lines (cells + 1,)."""
    ends = np.sort(np.abs([lines[:-1], lines[1:]]), axis=0)
    return np.where(lines[:-1] * lines[1:] < 0.0, 0.0, ends[0])


def _window(whole, cells):
    """Return slices of the angle and of the velocity cells that paths from a mask of cells reach within a step."""
    dynamics, duration, lines = whole.dynamics, whole.duration, whole.source.lines
    segment, noise = dynamics.segment(whole.start, duration), math.sqrt(2.0 * dynamics.diffusion * duration)
    bounds = [acceleration_bounds(side, segment.force_low, segment.force_high, dynamics.block) for side in SIDES]
    far, fast = (max(-part[k.min()], part[k.max() + 1]) for part, k in zip(lines, np.nonzero(cells), strict=True))
    fast += np.max(bounds) * duration + TUNING.deviations * dynamics.largest_factor * noise
    far += fast * duration
    # The projection of what is near an edge of the small mesh reaches a few cells further.
    ends = ((np.searchsorted(part, (-most, most)), part) for part, most in zip(lines, (far, fast), strict=True))
    rim = TUNING.contact_rim
    return tuple(slice(max(int(low) - 1 - rim, 0), min(int(high) + rim, len(part) - 1)) for (low, high), part in ends)


def _part_of(space, window):
    """Return the `Space` of the cells of another one in `window`, slices of angle and velocity cells."""
    angle, velocity = (lines[k.start : k.stop + 1] for lines, k in zip(space.lines, window, strict=True))
    return Space(angle, velocity, space.degree)
