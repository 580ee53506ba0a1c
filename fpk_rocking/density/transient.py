"""Scenes with white noise that do not repeat: a step is set up once, for the cells that hold something, and dropped.

A block at rest may stick there while the force cannot lift it off: `Sticking` says when. Then it is re-injected: it
starts up again, from rest, on moving patches (`startup`) until the mesh resolves it.

Under a force that does not lift it off and white noise a block at rest rattles in a thin layer about x = v = 0. On the
side s it is pulled back by g_s, and noise has the diffusion D_s there: for a slender block 1 - s f and D, for any other
κ (sin(α m)/α - s f cos(α m)) and D κ² cos²(α m), with the κ and m of the side. Two hops, one to each side, take
4w/h at the speed w, with the harmonic mean h of the pulls, and keep the part E of the speed, the product of the two
restitutions. Let D be the mean of D_s with the weights 1/g_s, the times spent on the sides. The speeds at impact have
the scale w = 4D / (3 (1 - E) h), and the block forgets its state at the rate 9 (1 - E)² h² / (256 D) of the slowest
mode of its energy (docs/theory.md, section 5). Let M be the integral of this rate from the end of the sticking to the
next lift-off. Of what the layer would have been without the sticking, the part exp(-M) is left at the
lift-off, so survival changes by less than that.

All this holds for hops that are short beside the time in which the force changes. Faster blocks can hop on for ever
under |f| < 1, in step with the force, and neither they nor a layer that reaches so far may stick.
"""

import dataclasses
import math
from typing import NamedTuple

import numpy as np

from fpk_rocking.base.checks import Array, not_none
from fpk_rocking.density.propagator import Propagator, Snapshot
from fpk_rocking.density.resolution import cycle_of, in_rest
from fpk_rocking.density.space import Space
from fpk_rocking.density.startup import StartUp, takeover_step
from fpk_rocking.density.step.dynamics import Dynamics
from fpk_rocking.density.step.step import Characteristics, Step, mark_massive_cells
from fpk_rocking.density.tuning import TUNING
from fpk_rocking.physics.motion.equation import contact_laws, saddle_speed
from fpk_rocking.scene.parts import Start
from fpk_rocking.scene.scene import Scene


class Sticking:
    """Times at which a block at rest may be taken as sticking there."""

    def __init__(self, dynamics: Dynamics, end, forgetting):
        self._edges = np.linspace(0.0, end, max(math.ceil(end / TUNING.sticking_interval), 2) + 1)
        self._laws = contact_laws(dynamics.block)
        values = np.array([dynamics.forcing.value(time) for time in self._edges])
        # By side and edge. Both means are largest or least at an end of an interval.
        pulls = np.array([np.maximum(law.gravity - side * law.part * values, 0.0) for side, law in self._laws.items()])
        squares = [law.part**2 for law in self._laws.values()]
        gap = _least(2.0 * pulls[0] * pulls[1] / pulls.sum(axis=0))
        noise = -_least(-(squares[0] * pulls[1] + squares[1] * pulls[0]) / pulls.sum(axis=0)) * dynamics.diffusion
        if dynamics.envelope is not None:
            noise *= np.diff(dynamics.envelope.squared_integral(self._edges)) / np.diff(self._edges)
        sides = dynamics.block.sides
        restitution = sides.restitution if sides else [not_none(dynamics.block.restitution)] * 2
        loss, slowing = 1.0 - math.prod(restitution), 1.0 - 0.5 * sum(restitution)
        steady = self._steady(values * math.sqrt(max(squares)), _least(pulls.min(axis=0)), slowing)
        inside = 4.0 * noise <= 3.0 * loss * gap * (np.minimum(TUNING.rest_velocity, steady) / TUNING.layer_inside)
        safe = 4.0 * noise <= 3.0 * loss * gap * (self._over(values, dynamics.block) / TUNING.layer_safe)
        rate = np.full(len(gap), math.inf)
        np.divide(9.0 * (loss * gap) ** 2, 256.0 * noise, out=rate, where=noise > 0.0)
        self._lifting = gap <= 0.0
        forgotten = self._until_lift_off(rate)
        self._sticks = ~self._lifting & inside & safe & (forgotten >= forgetting)
        self._stopping = self._fastest_to_stop(0.8 * 0.5 * slowing * gap, steady)

    def _over(self, forces, block):
        """Return least speeds (n,) at which a block passes a saddle in each interval, by `forces` (n + 1,) at edges."""
        speeds = [
            saddle_speed(min(side * force, law.gravity / law.part), block.critical_angle, saddle, scale)
            for (side, law), saddle, scale in zip(self._laws.items(), block.saddles, block.scales, strict=True)
            for force in forces
        ]
        return _least(np.reshape(speeds, (2, -1)).min(axis=0))

    def _steady(self, forces, pull, loss):
        """Return speeds (n,) up to which hops die out under a changing force, inf where it does not change."""
        bend = np.pad(np.abs(np.diff(forces, 2)) / self._edges[1] ** 2, 1, mode="edge")
        speeds = np.full(len(pull), math.inf)
        gain = np.maximum(bend[1:], bend[:-1])
        np.divide(1.5 * TUNING.hop_gain * loss * pull**3, gain, out=speeds, where=gain > 0.0)
        return np.sqrt(speeds)

    def _until_lift_off(self, rate):
        """Return the integral (n,) of a `rate` (n,), per time in each interval, from its end to the next lift-off."""
        integral, total = np.empty(len(rate)), math.inf
        for k in range(len(rate) - 1, -1, -1):
            total = 0.0 if self._lifting[k] else total
            integral[k] = total
            total += 0.0 if self._lifting[k] else rate[k] * (self._edges[k + 1] - self._edges[k])
        return integral

    def _fastest_to_stop(self, rate, steady):
        """Return the largest speed (n,) at each interval's begin that falls to 0 at a `rate` (n,) before a lift-off."""
        fastest, speed = np.empty(len(rate)), math.inf
        for k in range(len(rate) - 1, -1, -1):
            later = speed + rate[k] * (self._edges[k + 1] - self._edges[k])
            speed = 0.0 if self._lifting[k] else min(steady[k], later)
            fastest[k] = speed
        return fastest

    def _interval(self, time):
        """Return the index, an int, of the interval that begins at a `time` or goes on there; the last after them."""
        return min(
            max(int(np.searchsorted(self._edges, time * (1.0 + 1e-12), side="right")) - 1, 0), len(self._sticks) - 1
        )

    def until(self, time: float) -> float:
        """Return the time until which a block at rest may stick from `time` on, maybe inf; `time` where it may not."""
        first = self._interval(time)
        later = self._sticks[first:]
        return math.inf if later.all() else max(float(self._edges[first + np.argmin(later)]), time)

    def next_lift_off(self, time: float) -> float:
        """Return the first time from `time` on at which the forcing lifts a block off; `time` where it never does."""
        later = self._edges[:-1][self._lifting]
        later = later[later >= time]
        return float(later[0]) if later.size else time

    def stopping_cells(self, time: float, space: Space) -> Array:
        """Return a mask (angle cells, velocity cells): from there a block comes to rest before the next lift-off."""
        angles, velocities = (0.5 * (lines[1:] + lines[:-1]) for lines in space.lines)
        gravity = np.where(angles > 0.0, self._laws[1].gravity, self._laws[-1].gravity)
        speeds = np.sqrt((2.0 * gravity * np.abs(angles))[:, None] + velocities**2)
        slow = in_rest(angles, velocities) & (speeds <= self._stopping[self._interval(time)])
        return slow | cells_at_origin(space)


def _least(edges):
    """Return the lesser of the values (n,) at both ends of each interval, of values `edges` (n + 1,) at the edges."""
    return np.minimum(edges[1:], edges[:-1])


def cells_at_origin(space: Space) -> Array:
    """Return a mask (angle cells, velocity cells) of the cells of a `Space`'s mesh that touch the origin."""
    angle, velocity = ((lines[:-1] <= 0.0) & (lines[1:] >= 0.0) for lines in space.lines)
    return np.outer(angle, velocity)


def density_at_rest(space: Space) -> Array:
    """Return coefficients (``space.shape``) of a density of mass 1 that is even over the cells at the origin."""
    cells, coefficients = cells_at_origin(space), np.zeros(space.shape)
    coefficients[cells, 0, 0] = 1.0 / (cells.sum() * space.areas[cells])
    return coefficients


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
        if coarse:
            self._forgetting = TUNING.forgetting_growth * coarse._forgetting
            least_intensity = TUNING.faintest_ratio * coarse.dynamics.least_intensity
        else:
            # At the third resolution what a block may remember of having stuck is the tolerance, exp(-M) = 1e6 times
            # the negligible mass; M grows by about 1.4 from one resolution to the next.
            self._forgetting, least_intensity = -0.5 * math.log(1e6 * negligible), Dynamics.least_intensity
        self.dynamics = dataclasses.replace(Dynamics.of(scene), least_intensity=least_intensity)
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
        if start.angle or start.velocity or start.covariance:
            state.injections.append(self._injection(0.0, 1.0, start, edges))
        else:
            state.sticking = 1.0
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

    def snapshot(self, state: TransientState) -> Snapshot:
        """Return the `Snapshot` of all parts of a `TransientState` together: coefficients of the density, outflow."""
        coefficients, outflow = state.density + state.sticking * density_at_rest(self.space), state.outflow
        for injection in state.injections:
            more, left = injection.at(state.time, self.space)
            coefficients, outflow = coefficients + more, outflow + left
        envelope = self.dynamics.envelope
        strength = 1.0 if envelope is None else envelope.value(state.time) ** 2
        resolved = strength > TUNING.faded_noise and not state.injections and state.time >= state.narrow_until
        return Snapshot(coefficients, outflow, resolved=resolved, reinjected=state.reinjected)

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

        step = takeover_step(startup, self.space, after[: np.searchsorted(after, startup.longest) + 1], settled)
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
    fixed = fixed[np.append(True, np.diff(fixed) > 1e-9)]
    even = np.arange(np.ceil(times[-1] / duration)) * duration
    apart = np.abs(even[:, None] - fixed).min(axis=1) if fixed.size else np.full(even.size, np.inf)
    return np.unique(np.append(even[(apart > 0.3 * duration) | (even == 0.0)], fixed))
