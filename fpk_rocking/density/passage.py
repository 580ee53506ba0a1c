"""A scene that does not repeat at one resolution: a step is set up once, where the density is, and dropped."""

import dataclasses
import functools
import math

import numpy as np

from fpk_rocking.density.pilot import REST, in_rest
from fpk_rocking.density.resolution import FEWEST, cycle_of
from fpk_rocking.density.space.solution import Solution
from fpk_rocking.density.space.space import Space
from fpk_rocking.density.start.departure import Departure, first_resolved, initial_density
from fpk_rocking.density.step.occupied import occupy
from fpk_rocking.density.step.step import Dynamics, Step, Trace, deposit_buffers

_NEAR = 0.3
"""Part of a step by which a time that is wanted, or the end of the motion, takes the place of a step's end."""

FAINT = 0.1
"""Mass over that of `Propagator` that a cell must hold to be active: here it is lost in every step anew."""

FADED = 0.05
"""Diffusion over that at g = 1 below which only survival is held to a tolerance: the density shrinks to rest."""

STIRRING = 0.5
"""Size of the force from which on a block at rest is followed, and up to which one may be held there."""

_LOOK = 0.02
"""Time between two looks at the forcing for when it passes `STIRRING`."""

_LAST = 1e4
"""Moving mass over that of `Propagator` below which all is held at rest: a hundredth of the tolerance."""

_LAYERS, _SAFE = 8.0, 25.0
"""Scales of the layer at rest that have to be within `REST` for a block to be held there, and within the least speed
that takes a block over, 1 - `STIRRING`, for noise alone not to do so."""


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
        self._negligible = negligible
        self.space = Space(grid.angle_lines, grid.velocity_lines, grid.degree)
        self.duration = cycle_of(white) / grid.steps
        self._buffers = deposit_buffers(self.space)

    @property
    def memory(self):
        """Bytes that the run holds, densities of all times left out."""
        return 2 * self._buffers.nbytes

    def departure(self, windows):
        """Return the `Departure` of the scene's start, from `origin` on; None for one that stays at rest."""
        if self.origin == math.inf:
            return None
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

        A block at rest is left there until |f| passes `STIRRING`; for ever, where it never does and noise alone cannot
        overturn the block.
        """
        start, forcing = self.scene.start, self.dynamics.forcing
        if start.angle or start.velocity or start.covariance or forcing.period is not None:
            return 0.0
        looks, stirring = self._looks
        if not stirring.any():
            thin = _SAFE * self._layer(self._strength(looks).max()) <= 1.0 - STIRRING
            return math.inf if thin else 0.0
        return float(looks[max(int(np.argmax(stirring)) - 1, 0)])

    @functools.cached_property
    def _looks(self):
        """Times (n,) over the motion, and whether |f| is above `STIRRING` at them."""
        forcing = self.dynamics.forcing
        looks = np.linspace(0.0, forcing.duration, math.ceil(forcing.duration / _LOOK) + 1)
        return looks, np.abs(forcing.values(looks)) > STIRRING

    @functools.cached_property
    def _stirs(self):
        """Times (n,) over the motion at which |f| is above `STIRRING`, ascending."""
        looks, stirring = self._looks
        return looks[stirring]

    def _layer(self, strength):
        """Scale of the speeds at rest under |f| = `STIRRING` and a part of the diffusion (docs/theory, section 5)."""
        return 4.0 * self.dynamics.diffusion * strength / (3.0 * self._loss)

    @property
    def _loss(self):
        """Part of the energy that an impact takes, times 1 - f² at |f| = `STIRRING`."""
        return (1.0 - self.dynamics.restitution**2) * (1.0 - STIRRING**2)

    def _holds(self, time):
        """Whether a block that rests at a time is held there: its layer is thin, and forgotten before |f| rises."""
        if self.dynamics.forcing.period is not None:
            return False
        strength = float(self._strength(np.array([time]))[0])
        if _LAYERS * self._layer(strength) > REST[1]:
            return False
        later = self._stirs[np.searchsorted(self._stirs, time) :]
        return not later.size or later[0] - time > 64.0 * self.dynamics.diffusion * strength / (3.0 * self._loss**2)

    def evolve(self, times, departure: Departure, progress=None):
        """Evolve over times from 0 on, from where the mesh takes over from the windows of a start."""
        count, edges = len(times), _edges(self.scene, self.duration, times)
        inside, out = np.ones(count), np.zeros((count, 3))
        coefficients = np.zeros((count, *self.space.shape))
        coefficients[0], out[0, :2] = initial_density(self.scene.start, self.space, self.scene.overturning.angle)
        inside[0] -= out[0].sum()
        resolved = (times > 0.0) & (self._strength(times) > FADED)
        if self.origin >= times[-1]:
            coefficients[1:] = resting(self.space)
            return Solution(inside, out, coefficients, resolved=np.zeros(count, dtype=bool))
        after = np.append(self.origin, edges[edges > self.origin * (1.0 + 1e-9)]) - self.origin
        place = first_resolved(departure, self.space, after[: np.searchsorted(after, departure.period) + 1])
        now, gone = departure.land(after[place], self.space)
        time, held, row = self.origin + after[place], 0.0, 1
        resolved &= times >= (time if self.origin == 0.0 else max(time, self._lift_off)) * (1.0 - 1e-12)
        edges = edges[edges > time * (1.0 + 1e-12)]
        while row < count:
            if times[row] <= time * (1.0 + 1e-12):
                # What comes before the mesh takes over is looked at from the windows.
                here = now + held * resting(self.space), gone
                if times[row] < time * (1.0 - 1e-12):
                    here = self._early(times[row] - self.origin, departure)
                coefficients[row], out[row] = here
                inside[row] = self.space.masses(here[0]).sum()
                row += 1
                if progress:
                    progress()
                continue
            now, held = self._rested(time, now, held)
            skipped = int(held > 0.0 and edges[0] < times[row] and self._twice)
            if now.any():
                now, sinks = self._step(time, edges[skipped], now).apply(now)
                gone = gone + sinks
            time, edges = edges[skipped], edges[skipped + 1 :]
        return Solution(inside, out, coefficients, resolved=resolved)

    @property
    def _lift_off(self):
        """Time at which the forcing first lifts a block off, or inf."""
        looks, _ = self._looks
        lifting = np.abs(self.dynamics.forcing.values(looks)) > 1.0
        return float(looks[np.argmax(lifting)]) if lifting.any() else math.inf

    @property
    def _twice(self):
        """Whether steps may be twice as long while what is slow, and asks for short steps, is held at rest."""
        return 2.0 * FEWEST * self.duration <= self.dynamics.forcing.shortest_period

    def _rested(self, time, now, held):
        """Exchange mass between the density and what is held at rest: (coefficients, mass held) at a time."""
        if not self._holds(time):
            return (now + held * resting(self.space) if held else now), 0.0
        masses = self.space.masses(now)
        slow = self._slow
        if np.abs(masses[~slow]).sum() < _LAST * self._negligible:
            return np.zeros_like(now), held + masses.sum()
        return np.where(slow[..., None, None], 0.0, now), held + masses[slow].sum()

    @functools.cached_property
    def _slow(self):
        """Cells (angle cells, velocity cells) of which the mass counts as rest."""
        middles = (0.5 * (line[1:] + line[:-1]) for line in self.space.lines)
        return in_rest(*middles) | (resting(self.space)[..., 0, 0] > 0.0)

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
        """Make the step from one time to another, for the cells that hold something."""
        occupied = np.zeros(self.space.shape[:2], dtype=bool)
        occupy(now, self.space.areas, FAINT * self._negligible, occupied, occupied)
        trace = Trace(self.space, start, end - start, self.dynamics, self.grid.quadrature, occupied)
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
