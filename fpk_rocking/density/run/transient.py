"""A scene that does not repeat at one resolution: a step is set up once, where the density is, and dropped."""

import dataclasses
import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from fpk_rocking.base.types import Array
from fpk_rocking.density.pilot import REST
from fpk_rocking.density.resolution import FEWEST, cycle_of
from fpk_rocking.density.run.base import Run, Seen
from fpk_rocking.density.run.rest import Hold, resting
from fpk_rocking.density.space.space import Space
from fpk_rocking.density.start.departure import Departure, first_resolved
from fpk_rocking.density.step.step import Characteristics, Dynamics, Step, mark_massive_cells
from fpk_rocking.scene.parts import Start

_NEAR = 0.3
"""Part of a step by which a time that is wanted, or the end of the motion, takes the place of a step's end."""

FAINT = 0.1
"""Mass over that of `PeriodicRun` that a cell must hold to be active: here it is lost in every step anew."""

FADED = 0.05
"""Diffusion over that at g = 1 below which only survival is held to a tolerance: the density shrinks to rest."""

_REMEMBERED, _FIRST, _LONGER = 1e6, 0.5, 1.4
"""What a block may remember of having been held at rest at the third resolution (exp(-M), see `rest`), over
`negligible`: it is the tolerance. M at the first resolution over that, and at each resolution over M before."""

_FAINTER = 0.5
"""Least diffusion that stands for noise that has faded, over that at the resolution before."""

_SETTLED = 0.5
"""Part of what was released that counts as being at rest again, from which on it is taken over to be held."""

_SMALL = 1e4
"""Mass over that of `PeriodicRun` that may, in all, be held at rest while it moves, or be released as if it had the
size of the cells about the origin: a hundredth of the tolerance."""


class _Release(NamedTuple):
    """A block that was at rest, or at the start of the scene, on its way to the mesh.

    Parameters
    ----------
    departure : Departure
        Its times count from `origin`.
    origin, landing : float
        Time of the release, and that at which the mesh takes over.
    mass : float
        Its probability.
    """

    departure: Departure
    origin: float
    landing: float
    mass: float

    def at(self, time: float, space: Space) -> tuple[Array, Array]:
        """Coefficients and masses gone (3,) at a time since the release."""
        if time <= self.origin:
            return self.mass * resting(space), np.zeros(3)
        coefficients, gone = self.departure.land(time - self.origin, space)
        return self.mass * coefficients, self.mass * gone


class _Parts:
    """Parts of the probability: the density on the mesh, what is held at rest or on its way, and what is gone (3,)."""

    def __init__(self, space):
        self._space, self.now, self.gone = space, np.zeros(space.shape), np.zeros(3)
        self.held, self.under_way, self.released, self._spent = 0.0, [], 0.0, 0.0
        # Whether something came to rest on the way: a start at rest is known exactly.
        self.came = False

    def land(self, time):
        """Take what has arrived over to the mesh."""
        for one in [one for one in self.under_way if one.landing <= time]:
            self.under_way.remove(one)
            landed, left = one.at(time, self._space)
            self.now, self.gone = self.now + landed, self.gone + left

    def seen(self, time):
        """Coefficients and masses gone (3,), all parts together."""
        coefficients, gone = self.now + self.held * resting(self._space), self.gone
        for one in self.under_way:
            landed, left = one.at(time, self._space)
            coefficients, gone = coefficients + landed, gone + left
        return coefficients, gone

    def spend(self, mass, most):
        """Whether a mass may be treated as small: all such masses together are at most a bound."""
        small = self._spent + mass <= most
        self._spent += mass if small else 0.0
        return small


class TransientRun(Run):
    """A scene with white noise that does not repeat, at one resolution; parameters as of `Run`.

    What a coarser run, the guide, assumes of rest and of noise that has faded this one assumes less of.
    """

    def __init__(self, scene, grid, negligible, guide=None):
        super().__init__(scene, grid, grid, negligible)
        self._memory = _LONGER * guide._memory if guide else -_FIRST * math.log(_REMEMBERED * negligible)
        least_intensity = _FAINTER * guide.dynamics.least_intensity if guide else Dynamics.least_intensity
        self.dynamics = dataclasses.replace(Dynamics.of(scene), least_intensity=least_intensity)
        self.duration = cycle_of(scene) / grid.steps

    @property
    def memory(self) -> float:
        """Bytes that the run holds, densities of all times left out."""
        return 2 * self.buffers.nbytes

    def march(self, times: Array, start: Start) -> Iterator[Seen]:
        """Show the density at times."""
        self._hold = Hold(self.dynamics, times[-1], self._memory)
        edges = _edges(self.scene, self.duration, times)
        parts = self._start(start, edges)
        for time in times[1:]:
            while time > edges[0] * (1.0 + 1e-12):
                edges = edges[self._advance(parts, edges, time) :]
                parts.land(edges[0])
            coefficients, gone = parts.seen(edges[0])
            resolved = self._strength(time) > FADED and not parts.under_way
            yield Seen(coefficients, gone, resolved=resolved, released=parts.released)

    def _start(self, start, edges):
        parts = _Parts(self.space)
        if start.angle or start.velocity or start.covariance:
            parts.under_way.append(self._release(0.0, 1.0, start, edges))
        else:
            parts.held = 1.0
        return parts

    def _advance(self, parts, edges, most):
        """Carry the parts over one of the steps between some edges, or two, to a time at most; return how many."""
        time = edges[0]
        twice = 2 if self._twice and edges[1] < most else 1
        until = self._hold.until(time)
        if until >= edges[twice] * (1.0 - 1e-12):
            self._rest(parts, time)
        elif parts.held and parts.spend(parts.held, _SMALL * self.negligible):
            parts.now, parts.held = parts.now + parts.held * resting(self.space), 0.0
        elif parts.held:
            parts.under_way.append(self._release(max(until, time), parts.held, Start(), edges))
            parts.released, parts.held = max(parts.released, parts.held if parts.came else 0.0), 0.0
        steps = twice if parts.held else 1
        if parts.now.any():
            parts.now, sinks = self._step(time, edges[steps], parts.now).apply(parts.now)
            parts.gone = parts.gone + sinks
        return steps

    def _rest(self, parts, time):
        """Hold at rest what stops before the next lift-off."""
        masses, slow = self.space.masses(parts.now), self._hold.stopped(time, self.space)
        if parts.spend(np.abs(masses[~slow]).sum(), _SMALL * self.negligible):
            slow = np.ones_like(slow)
        parts.held, parts.came = parts.held + masses[slow].sum(), parts.came or bool(parts.now.any())
        parts.now = np.where(slow[..., None, None], 0.0, parts.now)

    def _release(self, origin, mass, start, edges):
        """Release what was at rest, or the start of the scene, at a time before the second of some edges of steps."""
        dynamics = self.dynamics.later(origin) if origin > 0.0 else self.dynamics
        lift_off = self._hold.lift_off(origin)
        patience = lift_off - origin
        departure = Departure(dynamics, start, self.grid.windows, cycle_of(self.scene), patience)
        after = np.append(origin, edges[edges > origin * (1.0 + 1e-9)]) - origin

        def settled(since):
            held = origin + since > lift_off and self._hold.until(origin + since) > origin + since
            return held and departure.within(since, *REST) > _SETTLED

        place = first_resolved(departure, self.space, after[: np.searchsorted(after, departure.period) + 1], settled)
        return _Release(departure, origin, origin + after[place], mass)

    @property
    def _twice(self):
        """Whether steps may be twice as long while what is slow, and asks for short steps, is held at rest."""
        return 2.0 * FEWEST * self.duration <= self.dynamics.forcing.shortest_period

    def _strength(self, time):
        """Diffusion at a time over that at g = 1."""
        envelope = self.dynamics.envelope
        return 1.0 if envelope is None else envelope.value(time) ** 2

    def _step(self, start, end, now):
        """Make the step from one time to another, for the cells that hold something."""
        occupied = np.zeros(self.space.shape[:2], dtype=bool)
        mark_massive_cells(now, self.space.areas, FAINT * self.negligible, occupied, occupied)
        trace = Characteristics(self.space, start, end - start, self.dynamics, self.grid.quadrature, occupied)
        return Step(trace, self.space, self.buffers)


def _edges(scene, duration, times):
    """Edges of steps of about a duration, to the last time: among them all times and the end of the forcing."""
    fixed = np.unique([time for time in (*times[1:], scene.forcing.duration) if time <= times[-1]])
    fixed = fixed[np.append(True, np.diff(fixed) > 1e-9)]
    even = np.arange(np.ceil(times[-1] / duration)) * duration
    apart = np.abs(even[:, None] - fixed).min(axis=1) if fixed.size else np.full(even.size, np.inf)
    return np.unique(np.append(even[(apart > _NEAR * duration) | (even == 0.0)], fixed))
