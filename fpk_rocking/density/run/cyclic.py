"""Runs of scenes that repeat: the steps of a forcing cycle, or of half of it, serve all cycles.

Where the forcing is its own mirror image half a cycle later, the steps of the first half serve the second one too: the
density is turned about the origin instead. That half, or else the whole cycle, is a *leg* here.
"""

import abc
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from fpk_rocking.base.types import Array
from fpk_rocking.density.run.base import Run, Seen
from fpk_rocking.density.space.space import Space, reflected
from fpk_rocking.density.step.step import overlapping_cells
from fpk_rocking.scene.parts import Start


class State(NamedTuple):
    """What a run has between two steps.

    Parameters
    ----------
    density : ndarray, shape (..., *space.shape)
        Coefficients; under filtered noise at each node of it.
    gone : ndarray, shape (3,)
        Masses that went left, right and were lost.
    turned : bool
        Whether density and rest are those of the mirror image: turned, with the nodes in reverse.
    rest : ndarray, optional
        Masses at rest at the nodes.
    """

    density: Array
    gone: Array
    turned: bool = False
    rest: Array | None = None

    def mirrored(self) -> "State":
        """Return the state turned about the origin, or back."""
        density, rest = reflected(self.density), self.rest
        if rest is not None:
            density, rest = density[::-1, ::-1], rest[::-1, ::-1]
        return State(density, self.gone, not self.turned, rest)

    def after(self, density: Array, sinks: Array, rest: Array | None = None) -> "State":
        """Return the state after a step, in which the masses (3,) of `sinks` went."""
        return State(density, self.gone + (sinks[[1, 0, 2]] if self.turned else sinks), self.turned, rest)


class CyclicRun(Run):
    """A run over whole forcing cycles; a subclass makes the steps of a leg, and takes a state from one to the next.

    Attributes
    ----------
    begins : ndarray, shape (steps of a leg + 1,)
        Begins of the steps of a leg, nondimensional, and its end.
    steps : int
        Steps of a cycle.
    legs : int
        Legs in a cycle, 1 or 2; with 2 the density is turned after each.
    occupied : ndarray of bool, shape (steps of a leg, ..., angle cells, velocity cells)
        Cells that have held something at the begin of a step.
    """

    def __init__(self, scene, grid, plane, negligible, begins, guide=None):
        super().__init__(scene, grid, plane, negligible)
        self.begins, self.steps, self.legs = begins, grid.steps, grid.steps // (len(begins) - 1)
        self.occupied = np.zeros((len(begins) - 1, *self.space.shape[:2]), dtype=bool)
        if guide:
            self.occupied[:] = [guide.occupied_near(begin, self.space) for begin in begins[:-1]]

    def occupied_near(self, time: float, space: Space) -> Array:
        """Cells of another space that meet one which was occupied about a time, within the first leg."""
        before, after = self._around(time)
        return overlapping_cells(
            self.space, self.occupied[before] | self.occupied[min(after, len(self.occupied) - 1)], space
        )

    @abc.abstractmethod
    def _around(self, time):
        """Return the numbers of the last step that begins by a time, and of one that begins after it or then."""

    @abc.abstractmethod
    def _begin(self, start):
        """Return the first state, and the number of steps that led there from a start."""

    @abc.abstractmethod
    def _after(self, k, state, first):
        """Return the state after step k of the leg; `first`: whether it is the first step of all."""

    @abc.abstractmethod
    def _seen(self, state) -> Seen:
        """Return what there is to see of a state."""

    def states(self, cycles: int, start: Start) -> Iterator[tuple[int, State]]:
        """Yield the number of steps from τ = 0 on and the state, before each step and at the end."""
        state, first = self._begin(start)
        for k in range(first, cycles * self.steps + 1):
            yield k, state
            if k < cycles * self.steps:
                here = k % len(self.occupied)
                state = state.mirrored() if (k % self.steps != here) != state.turned else state
                state = self._after(here, state, k == first)

    def march(self, times: Array, start: Start) -> Iterator[Seen]:
        """Show the density after every cycle."""
        for k, state in self.states(len(times) - 1, start):
            if k and k % self.steps == 0:
                yield self._seen(state)
