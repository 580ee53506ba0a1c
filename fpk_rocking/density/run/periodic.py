"""A scene that repeats, under white noise, at one resolution: the steps of a leg of its cycle, set up once."""

import math

import numpy as np

from fpk_rocking.density.run.base import Seen
from fpk_rocking.density.run.cyclic import CyclicRun, State
from fpk_rocking.density.space.space import reflected
from fpk_rocking.density.start.departure import Departure, first_resolved
from fpk_rocking.density.step.step import Characteristics, Dynamics, Step, mark_massive_cells, with_neighbours


class PeriodicRun(CyclicRun):
    """A scene with white noise that repeats, at one resolution; parameters as of `Run`.

    Attributes
    ----------
    leg : list of Step
        The steps of a leg.
    """

    def __init__(self, scene, grid, negligible, guide=None):
        self.dynamics, self.duration = Dynamics.of(scene), scene.period / grid.steps
        steps = grid.steps // (2 if scene.forcing.half_antisymmetric else 1)
        super().__init__(scene, grid, grid, negligible, np.arange(steps + 1) * self.duration, guide)
        self.leg = [
            Step(
                Characteristics(self.space, begin, self.duration, self.dynamics, grid.quadrature, cells=False),
                self.space,
                self.buffers,
            )
            for begin in self.begins[:-1].tolist()
        ]
        # What a start leaves on windows does not depend on the mesh.
        self._departures = guide._departures if guide and guide.grid.windows == grid.windows else {}

    @property
    def memory(self) -> float:
        """Bytes that the run holds, densities of all cycles left out."""
        return self.buffers.nbytes + sum(step.nbytes for step in self.leg)

    def _around(self, time):
        place = time / self.duration
        return math.floor(place + 1e-9), math.ceil(place - 1e-9)

    def _begin(self, start):
        if start not in self._departures:
            self._departures[start] = Departure(self.dynamics, start, self.grid.windows, self.scene.period)
        departure = self._departures[start]
        first = first_resolved(departure, self.space, np.arange(self.steps + 1) * self.duration)
        return State(*departure.land(first * self.duration, self.space)), first

    def _after(self, k, state, first):  # noqa: ARG002  (as of other runs)
        """Carry the density by step k of the leg, with all cells active that hold something."""
        step = self.leg[k]
        if mark_massive_cells(
            state.density, self.space.areas, self.negligible, step.characteristics.active, self.occupied[k]
        ):
            step.activate(with_neighbours(self.occupied[k]))
        return state.after(*step.apply(state.density))

    def _seen(self, state):
        return Seen(reflected(state.density) if state.turned else state.density, state.gone)
