"""Scenes with white noise that do not repeat: a step is set up once, for the cells that hold something, and dropped.

A block at rest may stick there while the force cannot lift it off (`sticking`). Then it is re-injected: it starts up
again, from rest, on moving patches (`startup`) until the mesh resolves it.
"""

import dataclasses
import math
from typing import NamedTuple

import numpy as np

from fpk_rocking.base.checks import Array
from fpk_rocking.density.propagator import Propagator
from fpk_rocking.density.resolution import cycle_of
from fpk_rocking.density.space import Space
from fpk_rocking.density.startup import StartUp, takeover_step
from fpk_rocking.density.step.dynamics import Dynamics
from fpk_rocking.density.step.step import Characteristics, Step, mark_massive_cells
from fpk_rocking.density.sticking import Sticking, density_at_rest
from fpk_rocking.density.tuning import TUNING
from fpk_rocking.scene.parts import Start
from fpk_rocking.scene.scene import Scene


class ReInjection(NamedTuple):
    """A mass that was at rest, or at the start of the scene, on its way to the mesh."""

    startup: StartUp
    origin: float
    takeover: float
    mass: float
    resolved: bool

    def at(self, time: float, space: Space) -> tuple[Array, Array]:
        """Return (coefficients, outflow) of its density at a `time` τ: ``space.shape``, and (3,) since it began."""
        if time <= self.origin:
            return self.mass * density_at_rest(space), np.zeros(3)
        coefficients, outflow = self.startup.project(time - self.origin, space)
        return self.mass * coefficients, self.mass * outflow


@dataclasses.dataclass
class TransientState:
    """Parts of the probability between two steps; a step changes them in place."""

    edges: Array
    density: Array
    outflow: Array  # (3,)
    sticking: float = 0.0
    injections: list[ReInjection] = dataclasses.field(default_factory=list)
    reinjected: float = 0.0
    came_to_rest: bool = False
    spent: float = 0.0
    narrow_until: float = 0.0

    @property
    def time(self) -> float:
        """Nondimensional time τ of the state."""
        return float(self.edges[0])

    def spend(self, mass: float, most: float) -> bool:
        """Return whether a `mass` may be treated as small, a bool: all such masses together are at most `most`."""
        small = self.spent + mass <= most
        self.spent += mass if small else 0.0
        return small


class TransientPropagator(Propagator):
    """A scene with white noise that does not repeat, at one resolution; parameters as of `Propagator`."""

    def __init__(self, scene, discretization, negligible, coarse=None):
        super().__init__(scene, discretization, discretization, negligible)
        self.dynamics = Dynamics.of(scene)
        if coarse:
            self._forgetting = TUNING.forgetting_growth * coarse._forgetting
            least_intensity = TUNING.faintest_ratio * coarse.dynamics.least_intensity
        else:
            # At the third resolution what a block may remember of having stuck is the tolerance, exp(-M) = 1e6 times
            # the negligible mass; M grows by about 1.4 from one resolution to the next.
            self._forgetting, least_intensity = -0.5 * math.log(1e6 * negligible), self.dynamics.least_intensity
        self.dynamics = dataclasses.replace(self.dynamics, least_intensity=least_intensity)
        self.duration = cycle_of(scene) / discretization.steps
        # Small masses may in all be a hundredth of the tolerance.
        self._small = 1e4 * negligible

    @property
    def memory(self) -> float:
        """Bytes that a step takes."""
        return 2 * self.buffers.nbytes

    def initial_state(self, start: Start, times: Array) -> TransientState:
        """Return the `TransientState` at τ = 0: a start at rest sticks, any other is on its way to the mesh."""
        self._sticking = Sticking(self.dynamics, times[-1], self._forgetting)
        edges = step_edges(self.scene, self.duration, times)
        state = TransientState(edges, np.zeros(self.space.shape), np.zeros(3))
        if start.at_rest:
            state.sticking = 1.0
        else:
            state.injections.append(self._injection(0.0, 1.0, start, edges))
        return state

    def advance(self, state: TransientState, latest: float) -> TransientState:
        """Return the `TransientState`, changed in place, after one step, or after two at once."""
        edges, time = state.edges, state.time
        pair = 2 if self._steps_may_be_long and edges[1] < latest else 1
        until = self._sticking.until(time)
        if until >= edges[pair] * (1.0 - 1e-12):
            self._stick(state, time)
        elif state.sticking and state.spend(state.sticking, self._small):
            state.density, state.sticking = state.density + state.sticking * density_at_rest(self.space), 0.0
        elif state.sticking:
            state.injections.append(self._injection(max(until, time), state.sticking, Start(), edges))
            state.reinjected = max(state.reinjected, state.sticking if state.came_to_rest else 0.0)
            state.sticking = 0.0
        count = pair if state.sticking else 1
        if state.density.any():
            state.density, outflow = self._step(time, edges[count], state.density).apply(state.density)
            state.outflow = state.outflow + outflow
        state.edges = edges[count:]
        for arrived in [injection for injection in state.injections if injection.takeover <= state.time]:
            state.injections.remove(arrived)
            coefficients, outflow = arrived.at(state.time, self.space)
            state.density, state.outflow = state.density + coefficients, state.outflow + outflow
            if not arrived.resolved:
                state.narrow_until = arrived.takeover + 0.9 * cycle_of(self.scene)
        return state

    def density_of(self, state: TransientState) -> tuple[Array, Array, float, bool]:
        """Return density and outflow of all parts of a state together; what sticks is a part of the density."""
        coefficients, outflow = state.density + state.sticking * density_at_rest(self.space), state.outflow
        for injection in state.injections:
            more, left = injection.at(state.time, self.space)
            coefficients, outflow = coefficients + more, outflow + left
        envelope = self.dynamics.envelope
        strength = 1.0 if envelope is None else envelope.value(state.time) ** 2
        resolved = strength > TUNING.faded_noise and not state.injections and state.time >= state.narrow_until
        return coefficients, outflow, 0.0, resolved

    def _stick(self, state, time):
        """Let those blocks of a `TransientState` stick that come to rest before the next lift-off; return None."""
        masses, stopping = self.space.masses(state.density), self._sticking.stopping_cells(time, self.space)
        if state.spend(np.abs(masses[~stopping]).sum(), self._small):
            stopping = np.ones_like(stopping)
        state.sticking += masses[stopping].sum()
        state.came_to_rest = state.came_to_rest or bool(state.density.any())
        state.density = np.where(stopping[..., None, None], 0.0, state.density)

    def _injection(self, origin, mass, start, edges):
        """Return the `ReInjection` of a `mass`, a probability, which is at the `Start` at a time `origin`."""
        dynamics = self.dynamics.later(origin) if origin > 0.0 else self.dynamics
        lift_off = self._sticking.next_lift_off(origin)
        startup = StartUp(dynamics, start, self.discretization.patches, cycle_of(self.scene), lift_off - origin)
        after = np.append(origin, edges[edges > origin * (1.0 + 1e-9)]) - origin

        def settled(since):
            time = origin + since
            sticks = time > lift_off and self._sticking.until(time) > time
            near = startup.mass_within(since, TUNING.rest_angle, TUNING.rest_velocity) if sticks else 0.0
            return near > TUNING.settled_part

        step = takeover_step(startup, self.space, after, settled)
        # Of what was lifted off later only a part of the density is as narrow.
        resolved = origin > 0.0 or startup.resolution(after[step], self.space) >= TUNING.barely_resolved
        return ReInjection(startup, origin, origin + after[step], mass, resolved or settled(after[step]))

    @property
    def _steps_may_be_long(self):
        """Whether steps may be twice as long while slow blocks, which need short steps, stick at rest: a bool."""
        return 2.0 * TUNING.steps_per_harmonic * self.duration <= self.dynamics.forcing.shortest_period

    def _step(self, begin, end, density):
        """Return a `Step` from time `begin` to `end` for the active cells."""
        active = np.zeros(self.space.shape[:2], dtype=bool)
        # What is not active is truncated anew in every step, so less counts as negligible than in a cycle's own steps.
        mark_massive_cells(density, self.space.areas, 0.1 * self.negligible, active, active)
        rule = self.discretization.quadrature
        return Step(
            Characteristics(self.space, begin, end - begin, self.dynamics, rule, active), self.space, self.buffers
        )


def step_edges(scene: Scene, duration: float, times: Array) -> Array:
    """Return the edges (n,), from 0 on, of steps of about a `duration`, to the last of the `times` (rows,)."""
    fixed = np.unique([time for time in (*times[1:], scene.forcing.duration) if time <= times[-1]])
    fixed = fixed[np.append(True, np.diff(fixed) > 1e-9 * duration)]
    even = np.arange(np.ceil(times[-1] / duration)) * duration
    apart = np.abs(even[:, None] - fixed).min(axis=1) if fixed.size else np.full(even.size, np.inf)
    return np.unique(np.append(even[(apart > 0.3 * duration) | (even == 0.0)], fixed))
