"""What every propagator has: a scene at one resolution, and the loop that carries its density from time to time.

`PeriodicPropagator` below, `transient` and `filtered` each know one kind of scene: how its density begins, and how a
step changes it. Where a scene repeats, the steps of a symmetry period are set up once and serve all cycles. Where the
forcing is its own mirror image half a cycle later, and the sides of the block are equal, the symmetry period is half a
cycle: its steps serve the other half too, with the density reflected, (x, v) -> (-x, -v). Else it is the whole cycle.
"""

import abc
import dataclasses
import functools
import math
from collections.abc import Callable, Iterator
from typing import Any, ClassVar, NamedTuple

import numpy as np

from fpk_rocking.base.checks import Array, not_none
from fpk_rocking.density.patches import initial_density
from fpk_rocking.density.resolution import Discretization, in_rest, periods_per_cycle
from fpk_rocking.density.space import Space, reflected
from fpk_rocking.density.startup import StartUp, takeover_step
from fpk_rocking.density.step.contact import ContactStep
from fpk_rocking.density.step.dynamics import Dynamics
from fpk_rocking.density.step.step import (
    Characteristics,
    Step,
    mark_massive_cells,
    overlapping_cells,
    scatter_buffers,
    with_neighbours,
)
from fpk_rocking.density.tuning import TUNING
from fpk_rocking.scene.parts import Start
from fpk_rocking.scene.scene import Scene


@dataclasses.dataclass
class Solution:
    """A density at all times that are asked for, the rows of its arrays, by a propagator at one resolution."""

    propagator: Any
    survival: Array  # (rows,)
    outflow: Array  # (rows, 3)
    coefficients: Any  # (rows, *space.shape); None once released
    at_rest: Array | None  # (rows,)
    resolved: Array  # (rows,)
    reinjected: float = 0.0
    edges: Any = None
    seconds: float = 0.0

    def release(self) -> Any:
        """Drop the density, keep what is compared, and return the propagator, for the next finer solution."""
        self.bins, self.negative_mass, self.memory  # noqa: B018  (computed while there is a density)
        propagator, self.propagator, self.coefficients = self.propagator, None, None
        return propagator

    @functools.cached_property
    def memory(self) -> float:
        """Bytes that the propagator took."""
        return self.propagator.memory

    @functools.cached_property
    def bins(self) -> Array:
        """Probabilities (rows, bins) in the bins between `edges`; those at rest are one bin."""
        bins = self.propagator.space.bin_integrals(self.coefficients, *self.edges)
        if self.at_rest is not None:
            bins += self.at_rest[:, None, None] * np.histogram2d([0.0], [0.0], bins=self.edges)[0]
        resting = in_rest(*(0.5 * (line[1:] + line[:-1]) for line in self.edges))
        return np.column_stack([bins[:, ~resting], bins[:, resting].sum(axis=1)])

    @functools.cached_property
    def negative_mass(self) -> float:
        """Worst negative mass of the resolved densities of moving blocks."""
        space = self.propagator.space
        moving = ~in_rest(*(0.5 * (line[1:] + line[:-1]) for line in space.lines))[:, :, None, None]
        densities = self.coefficients[self.resolved]
        return max((space.negative_mass(np.where(moving, density, 0.0)) for density in densities), default=0.0)

    @property
    def quantity(self) -> Array:
        """Survival, overturned to the left and to the right, (rows, 3)."""
        return np.column_stack([self.survival, self.outflow[:, :2]])

    def error(self, difference: float, bins_difference: float) -> float:
        """Error of survival: its estimate, raised by what is truncated, negative probability, bins and rest."""
        rested = self.reinjected if self.at_rest is None else self.at_rest[1:].max()
        scaled = TUNING.rest_error_factor * difference if rested > difference else difference
        if self.at_rest is not None:
            # No more than what rests can be wrong by resting.
            scaled = max(difference, min(scaled, rested))
        truncated = float(np.abs(self.outflow[:, 2]).max())
        negative = -float(min(self.quantity.min(), (1.0 - self.survival).min()))
        return max(scaled, TUNING.bins_part * bins_difference, truncated, negative)


class Propagator(abc.ABC):
    """A scene at one resolution: its mesh, its steps, and the loop over them."""

    rests_exactly: ClassVar[bool] = False
    """Whether blocks rest at x = v = 0, with a probability that the density does not contain."""

    @property
    @abc.abstractmethod
    def memory(self) -> float:
        """Bytes that steps and states take, a number, without the densities of all rows."""

    def __init__(self, scene: Scene, discretization: Any, plane: Discretization, negligible: float) -> None:
        self.scene, self.discretization, self.negligible = scene, discretization, negligible
        self.space = Space(plane.angle_lines, plane.velocity_lines, plane.degree)
        self.buffers = scatter_buffers(self.space)

    @abc.abstractmethod
    def initial_state(self, start: Start, times: Array) -> Any:
        """Return the first state from the start on whose density the mesh resolves; its class is the subclass's."""

    @abc.abstractmethod
    def advance(self, state: Any, latest: float) -> Any:
        """Return the state after one step or more, not later than `latest`, a time at which a step ends."""

    @abc.abstractmethod
    def density_of(self, state: Any) -> tuple[Array, Array, float, bool]:
        """Return (coefficients, outflow, mass at rest, whether the mesh resolves the density) of a state."""

    def states_before(self, first: Any, times: Array, start: Start) -> Iterator[Any]:  # noqa: ARG002  (`first` is at 0)
        """Yield the states at those of the times that are before the `first` of `initial_state`."""
        yield from ()

    def state_between(self, state: Any, time: float) -> Any:  # noqa: ARG002  (`advance` stops at each wanted time)
        """Return the state at a `time` within the step after a `state`, from which nothing goes on; else None."""
        return None

    def states(self, times: Array, start: Start) -> Iterator[Any]:
        """Yield the states at each of the times and after every step, in order, to the last of the times."""
        state = self.initial_state(start, times)
        yield from self.states_before(state, times, start)
        yield state
        for time in times[1:]:
            while not _reached(state, time):
                between = self.state_between(state, time)
                if between:
                    yield between
                    break
                state = self.advance(state, time)
                yield state

    def propagate(
        self, times: Array, progress: Callable[[], object] | None = None, start: Start | None = None
    ) -> Solution:
        """Propagate the density from the start of the scene to all times that are asked for."""
        rows, row, start = len(times), 1, start or self.scene.start
        coefficients, outflow = np.zeros((rows, *self.space.shape)), np.zeros((rows, 3))
        survival, at_rest, resolved = np.ones(rows), np.zeros(rows), np.zeros(rows, dtype=bool)
        coefficients[0], outflow[0, :2] = initial_density(start, self.space, self.scene.overturning.angle)
        survival[0] -= outflow[0].sum()
        at_rest[0] = float(self.rests_exactly and start.at_rest)
        for state in self.states(times, start):
            if _reached(state, times[row]):
                coefficients[row], outflow[row], at_rest[row], resolved[row] = self.density_of(state)
                survival[row] = self.space.masses(coefficients[row]).sum() + at_rest[row]
                row += 1
                if progress:
                    progress()
        reinjected = getattr(state, "reinjected", 0.0)
        resting = at_rest if self.rests_exactly else None
        return Solution(self, survival, outflow, coefficients, resting, resolved, reinjected)


def _reached(state, time):
    """Whether a `state`, of a class of a propagator, is at a `time` or after it, to rounding: a bool."""
    return state.time >= time * (1.0 - 1e-12)


class PeriodicState(NamedTuple):
    """A density between two steps."""

    step: int
    time: float
    density: Array  # (..., *space.shape)
    outflow: Array  # (3,)
    reflected: bool = False
    at_rest: Array | None = None
    first: bool = False

    def mirror_image(self) -> "PeriodicState":
        """Return the state reflected about the origin, (x, v) -> (-x, -v), or back."""
        density, at_rest = reflected(self.density), self.at_rest
        if at_rest is not None:
            density, at_rest = density[::-1, ::-1], at_rest[::-1, ::-1]
        return self._replace(density=density, at_rest=at_rest, reflected=not self.reflected)


class CyclicPropagator(Propagator):
    """A propagator over whole forcing cycles; a subclass makes the steps of a symmetry period and applies them."""

    steps: list[Any]

    def __init__(self, scene, discretization, plane, negligible, step_begins, coarse=None):
        super().__init__(scene, discretization, plane, negligible)
        self.step_begins, self.steps_per_cycle = step_begins, discretization.steps
        self.periods_per_cycle = self.steps_per_cycle // (len(step_begins) - 1)
        self.active = np.zeros((len(step_begins) - 1, *self.space.shape[:2]), dtype=bool)
        if coarse:
            self.active[:] = [coarse.active_about(begin, self.space) for begin in step_begins[:-1]]

    def active_about(self, time: float, space: Space) -> Array:
        """Return a mask of the cells of another `Space` that meet an active cell of the steps about a `time`."""
        before, after = self._steps_about(time)
        return overlapping_cells(self.space, self.active[before] | self.active[min(after, len(self.active) - 1)], space)

    @abc.abstractmethod
    def early_state(self, start: Start, time: float) -> PeriodicState:
        """Return the `PeriodicState` at a `time` before the mesh takes the start over; it is narrower than cells."""

    def states_before(self, first: PeriodicState, times: Array, start: Start) -> Iterator[PeriodicState]:
        """Yield the states at those of the times at which the mesh has not taken the start over."""
        return (self.early_state(start, time) for time in times[1:] if time < first.time * (1.0 - 1e-12))

    @abc.abstractmethod
    def _steps_about(self, time):
        """Two numbers: that of the last step that begins by a `time`, and of one that begins after it or then."""

    @abc.abstractmethod
    def _apply(self, k, state, duration=None):
        """Return (density, outflow, at rest) of a `PeriodicState` after step k, or a `duration` of it.

        Numbers of steps count in the symmetry period.
        """

    def advance(self, state: PeriodicState, latest: float) -> PeriodicState:  # noqa: ARG002  (as of other kinds)
        """Return the `PeriodicState` after the next step; `latest` is not used."""
        moved = self._moved(state)
        return moved._replace(step=state.step + 1, time=self.time_of(state.step + 1))

    def state_between(self, state: PeriodicState, time: float) -> PeriodicState | None:
        """Return the `PeriodicState` at a `time` within the next step, from which nothing goes on; else None."""
        if time >= self.time_of(state.step + 1) * (1.0 - 1e-12):
            return None
        return self._moved(state, time - state.time)._replace(time=time)

    def is_resolved(self, state: PeriodicState) -> bool:
        """Whether the density is judged: in the first cycle, in which it may be too narrow for the mesh, it is not."""
        return state.time >= not_none(self.scene.period) * (1.0 - 1e-12)

    def _moved(self, state, duration=None):
        """Return a `PeriodicState`, with the old step and time, after the next step or a `duration` of it."""
        k = state.step % len(self.active)
        if (state.step % self.steps_per_cycle != k) != state.reflected:
            state = state.mirror_image()
        density, outflow, at_rest = self._apply(k, state, duration)
        outflow = state.outflow + (outflow[[1, 0, 2]] if state.reflected else outflow)
        return state._replace(density=density, outflow=outflow, at_rest=at_rest, first=False)

    def time_of(self, step: int) -> float:
        """Return the nondimensional time τ at which a step begins, by its number from τ = 0 on."""
        period, k = divmod(step, len(self.active))
        return period * not_none(self.scene.period) / self.periods_per_cycle + self.step_begins[k]


class PeriodicPropagator(CyclicPropagator):
    """A scene with white noise that repeats, at one resolution; parameters as of `Propagator`."""

    def __init__(self, scene, discretization, negligible, coarse=None):
        self.dynamics, self.duration = Dynamics.of(scene), scene.period / discretization.steps
        count = discretization.steps // periods_per_cycle(scene)
        step_begins = np.arange(count + 1) * self.duration
        super().__init__(scene, discretization, discretization, negligible, step_begins, coarse)
        self.steps = [self._step(begin, self.duration) for begin in step_begins[:-1].tolist()]
        self._parts: dict[tuple[int, float], Any] = {}
        self._rings = 1 if coarse else TUNING.first_rings
        # What a start leaves on patches does not depend on the mesh.
        same = coarse and coarse.discretization.patches == discretization.patches
        self._startups = coarse._startups if same else {}

    def _step(self, begin, duration):
        """Return a `Step` of a `duration` from a time `begin` on, or a `ContactStep`, without active cells."""
        rule, parts = self.discretization.quadrature, self.discretization.contact_parts
        if parts > 1:
            return ContactStep(self.space, begin, duration, self.dynamics, rule, parts, self.negligible, self.buffers)
        characteristics = Characteristics(self.space, begin, duration, self.dynamics, rule, cells=False)
        return Step(characteristics, self.space, self.buffers)

    @property
    def memory(self) -> float:
        """Bytes that the steps take, an int."""
        return self.buffers.nbytes + sum(step.nbytes for step in (*self.steps, *self._parts.values()))

    def _steps_about(self, time):
        """Return two numbers: of the last step that begins by a `time`, and of one that begins after it or then."""
        place = time / self.duration
        return math.floor(place + 1e-9), math.ceil(place - 1e-9)

    def initial_state(self, start: Start, times: Array) -> PeriodicState:  # noqa: ARG002  (as of other kinds)
        """Return the `PeriodicState` at the end of the step at which the mesh takes the start over, for any `times`."""
        startup = self._startup(start)
        first = takeover_step(startup, self.space, np.arange(self.steps_per_cycle + 1) * self.duration)
        time = first * self.duration
        return PeriodicState(first, self.time_of(first), *startup.project(time, self.space))

    def early_state(self, start: Start, time: float) -> PeriodicState:
        """Return the `PeriodicState` at a `time` before the mesh takes the start over; it is narrower than cells."""
        return PeriodicState(0, time, *self._startup(start).project(time, self.space))

    def _startup(self, start):
        """Return the `StartUp` of a start, which is kept."""
        if start not in self._startups:
            patches = self.discretization.patches
            self._startups[start] = StartUp(self.dynamics, start, patches, self.scene.period)
        return self._startups[start]

    def _apply(self, k, state, duration=None):
        """Return (density, outflow, None) of a `PeriodicState` after step k: shapes ``space.shape`` and (3,)."""
        step = self.steps[k]
        if duration is not None:
            key = k, round(duration / self.duration, 9)
            if key not in self._parts:
                self._parts[key] = self._step(self.step_begins[k], duration)
            step = self._parts[key]
        if mark_massive_cells(state.density, self.space.areas, self.negligible, step.active, self.active[k]):
            step.activate(with_neighbours(self.active[k], self._rings))
        return *step.apply(state.density), None

    def density_of(self, state: PeriodicState) -> tuple[Array, Array, float, bool]:
        """Return density and outflow of a state, reflected back if it is a mirror image; nothing rests."""
        density = reflected(state.density) if state.reflected else state.density
        return density, state.outflow, 0.0, self.is_resolved(state)
