"""A scene that does not repeat at one resolution: a step is set up once, where the density is, and dropped."""

import dataclasses
import functools

import numpy as np

from fpk_rocking.density.resolution import cycle_of
from fpk_rocking.density.space.solution import Solution
from fpk_rocking.density.space.space import Space
from fpk_rocking.density.start.departure import Departure, first_resolved, initial_density
from fpk_rocking.density.step.occupied import occupy, with_neighbours
from fpk_rocking.density.step.step import Dynamics, Step, Trace, deposit_buffers

_NEAR = 0.3
"""Part of a step by which a time that is wanted, or the end of the motion, takes the place of a step's end."""

FAINT = 0.01
"""Mass over that of `Propagator` that a cell must hold to be active: here it is lost in every step anew."""


FADED = 0.05
"""Diffusion over that at g = 1 below which only survival is held to a tolerance: the density shrinks to rest."""

STIRRING = 0.5
"""Size of the force from which on a block at rest is followed."""

_LOOKS = 4001


class _Later:
    """A forcing or an envelope whose times count from an origin."""

    def __init__(self, whole, origin):
        self._whole, self._origin = whole, origin

    def __getattr__(self, name):
        return getattr(self._whole, name)

    def value(self, time):
        return self._whole.value(time + self._origin)

    def squared(self, times):
        return self._whole.squared(times + self._origin)

    def slope(self, time):
        return self._whole.slope(time + self._origin)

    def particular(self, time):
        return self._whole.particular(time + self._origin)

    def over(self, start, duration):
        return self._whole.over(start + self._origin, duration)

    def since_lift_off(self, time):
        return self._whole.since_lift_off(time + self._origin)


class Passage:
    """A scene with white noise, its forcing or noise a transient, at one resolution.

    Parameters
    ----------
    white : Scene
        With white noise.
    grid : Grid
        Mesh and steps.
    negligible : float
        A cell that holds less is not active: what is in it is lost, and counted.
    """

    def __init__(self, white, grid, negligible):
        self.scene, self.dynamics, self.grid = white, Dynamics.of(white), grid
        self.negligible = FAINT * negligible
        self.space = Space(grid.angle_lines, grid.velocity_lines, grid.degree)
        self.duration = cycle_of(white) / grid.steps
        self._buffers = deposit_buffers(self.space)

    @property
    def memory(self):
        """Bytes that the run holds, densities of all times left out."""
        return 2 * self._buffers.nbytes

    def departure(self, windows):
        """Return the `Departure` of the scene's start: from τ = 0, or from when a block at rest may begin to move."""
        return Departure(self._dynamics_from(self.origin), self.scene.start, windows, cycle_of(self.scene))

    def _dynamics_from(self, origin):
        """Dynamics with their times counted from an origin."""
        if origin == 0.0:
            return self.dynamics
        forcing, envelope = self.dynamics.forcing, self.dynamics.envelope
        later = {"forcing": _Later(forcing, origin), "envelope": envelope and _Later(envelope, origin)}
        return dataclasses.replace(self.dynamics, **later)

    @functools.cached_property
    def origin(self):
        """Time from which the density is followed.

        A block at rest is left there until the forcing first reaches `STIRRING`, if it is lifted off later.
        """
        start, forcing = self.scene.start, self.dynamics.forcing
        if start.angle or start.velocity or start.covariance or forcing.period is not None:
            return 0.0
        looks = np.linspace(0.0, forcing.duration, _LOOKS)
        stirring = np.abs(forcing.values(looks)) > STIRRING
        lifting = np.abs(forcing.values(looks)) > 1.0
        if not lifting.any() or stirring[0]:
            return 0.0
        return float(looks[int(np.argmax(stirring)) - 1])

    def evolve(self, times, departure: Departure, progress=None):
        """Evolve over times from 0 on, from where the mesh takes over from the windows of a start."""
        count, edges = len(times), _edges(self.scene, self.duration, times)
        inside, out = np.ones(count), np.zeros((count, 3))
        coefficients = np.zeros((count, *self.space.shape))
        coefficients[0], out[0, :2] = initial_density(departure.start, self.space, self.scene.overturning.angle)
        inside[0] -= out[0].sum()
        after = np.append(self.origin, edges[edges > self.origin * (1.0 + 1e-9)]) - self.origin
        place = first_resolved(departure, self.space, after[: np.searchsorted(after, departure.period) + 1])
        now, gone = departure.land(after[place], self.space)
        time, row = self.origin + after[place], 1
        resolved = (times >= time * (1.0 - 1e-12)) & (self._strength(times) > FADED)
        resolved[0] = False
        edges = edges[edges > time * (1.0 + 1e-12)]
        while row < count:
            if times[row] <= time * (1.0 + 1e-12):
                # What comes before the mesh takes over is looked at from the windows.
                here = now, gone
                if times[row] < time * (1.0 - 1e-12):
                    here = self._early(times[row] - self.origin, departure)
                coefficients[row], out[row] = here
                inside[row] = self.space.masses(here[0]).sum()
                row += 1
                if progress:
                    progress()
                continue
            now, sinks = self._step(time, edges[0], now).apply(now)
            gone, time, edges = gone + sinks, edges[0], edges[1:]
        return Solution(inside, out, coefficients, resolved=resolved)

    def _strength(self, times):
        """Diffusion at times over that at g = 1."""
        envelope = self.dynamics.envelope
        return np.ones(len(times)) if envelope is None else envelope.value(times) ** 2

    def _early(self, time, departure):
        """Coefficients and masses gone (3,) at a time since the origin before the mesh takes over."""
        if time <= 0.0:
            return resting(self.space), np.zeros(3)
        coefficients, gone = departure.land(time, self.space)
        # The mesh does not resolve it: of each cell only the mass is right.
        coefficients[..., 1:, :] = coefficients[..., :, 1:] = 0.0
        return coefficients, gone

    def _step(self, start, end, now):
        """Make the step from one time to another, for the cells that hold something and those beside them."""
        occupied = np.zeros(self.space.shape[:2], dtype=bool)
        occupy(now, self.space.areas, self.negligible, occupied, occupied)
        cells = with_neighbours(occupied)
        trace = Trace(self.space, start, end - start, self.dynamics, self.grid.quadrature, cells)
        return Step(trace, self.space, self._buffers)


def resting(space):
    """Coefficients of a block at rest: its mass is spread evenly over the cells around the origin."""
    coefficients = np.zeros(space.shape)
    angle, velocity = (np.flatnonzero((lines[:-1] <= 0.0) & (lines[1:] >= 0.0)) for lines in space.lines)
    cells = np.ix_(angle, velocity)
    masses = np.zeros(space.shape[:2])
    masses[cells] = 0.25
    coefficients[..., 0, 0] = masses / space.areas
    return coefficients


def _edges(scene, duration, times):
    """Edges of steps of about a duration, to the last time: among them all times and the end of the forcing."""
    fixed = [*times[1:]]
    if scene.period is None:
        fixed.append(scene.forcing.duration)
    fixed = np.unique([time for time in fixed if time <= times[-1]])
    fixed = fixed[np.append(True, np.diff(fixed) > 1e-9)]
    even = np.arange(np.ceil(times[-1] / duration)) * duration
    apart = np.abs(even[:, None] - fixed).min(axis=1) if fixed.size else np.full(even.size, np.inf)
    return np.unique(np.append(even[(apart > _NEAR * duration) | (even == 0.0)], fixed))
