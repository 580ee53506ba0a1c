"""An engine of realizations, and the one loop over time of all engines.

An engine knows how its noise is drawn and how a block moves over one interval of a time grid. `_simulate_path` carries
a realization through the intervals, `_simulate` many of them. In both, `engine` stands for the functions of the engine
that they are compiled for.
"""

import dataclasses
import functools
import math
import pathlib
import types
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.arrays import borrowed, own
from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion.events import ImpactRecord
from fpk_rocking.physics.motion.impact import side_of_start
from montecarlo.engines.random import open_stream
from montecarlo.tuning import TUNING


@kernel(inline="always")
def angle_and_velocity(state, _side, _number, _j, _parameters, _workspace):
    """Return the state at an interval's end where it is (angle, velocity): `Engine.state_at_end`."""
    return state


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Engine:
    """How the realizations of some scenes are simulated: functions in the order in which they are called.

    In Python, once for a scene: `takes` and `parameters_of`. All others are compiled, and depend on nothing but their
    arguments. Once for a thread: `workspace_of`. Once for a realization: `begin`. In each interval: `draw` and
    `try_step`. Only where that cannot exclude an event, or where a state is wanted within the interval: `build_force`,
    and then `step_with_events`, to the time of each such state and to the interval's end. At last, where a state is
    wanted at the end of the interval: `state_at_end`. An engine whose paths cannot be looked at within a step has
    `simulate_path` in place of all these from `begin` on.

    `number` counts intervals from the beginning of the run, and j from that of the table period, as the rows of the
    tables do. A state is a tuple of numbers, in variables of the engine's choice; the side is +1, -1, or 0 at rest.

    * `method`: name by which a user asks for it; `task`: name by which it is compiled ahead (`batches.task_of`);
      `file`: source file of its functions.
    * `takes(scene)`: whether it simulates a scene.
    * `parameters_of(scene, steps_per_cycle, times)`: what the other functions need, as a tuple of numbers and arrays,
      among them `block`, a `KernelBlock`, and `grid`, a `TimeGrid`. The times (rows,) are those at which states are
      wanted, since the beginning of the table period; by default its end alone.
    * `workspace_of(parameters)`: arrays of a thread that the other functions write to, as a tuple.
    * `begin(stream, cycle, parameters, workspace)`: draws the start, and the noise up to the cycle at which the run
      begins; returns (angle, velocity) and the state. A stream (4,) uint64 is the state of the random numbers.
    * `draw(stream, number, j, cycle, parameters, workspace)`: draws, or computes, the noise in an interval.
    * `try_step(state, side, number, j, parameters, workspace)`: whether an interval surely passes without an event, and
      the state at its end if so.
    * `build_force(number, j, parameters, workspace)`: writes the force in an interval as a polynomial.
    * `step_with_events(state, end, side, number, j, share, cycle, parameters, workspace, impacts)`: carries a state
      through a share of an interval, through impacts, rest, lift-off and overturning; `end` is what `try_step` has
      returned, `impacts` an `ImpactRecord`. Returns state, side, and time τ of overturning, inf for none.
    * `step_within`: as `step_with_events`, for a share below 1 and to a state that begins with angle and velocity; by
      default that.
    * `state_at_end(state, side, number, j, parameters, workspace)`: angle and velocity at the end of an interval.
    * `simulate_path(stream, cycle, parameters, workspace, angle, velocity, impacts, unkept)`: as `_simulate_path`.
    * `renews`: whether a run that begins at another cycle has noise of its own, and not the same function of time.
    """

    method: str
    task: str
    file: str
    takes: Callable[..., bool]
    parameters_of: Callable[..., Any]
    workspace_of: Callable[..., Any]
    begin: Callable[..., Any] | None = None
    draw: Callable[..., Any] | None = None
    try_step: Callable[..., Any] | None = None
    build_force: Callable[..., Any] | None = None
    step_with_events: Callable[..., Any] | None = None
    step_within: Callable[..., Any] | None = None
    state_at_end: Callable[..., Any] = angle_and_velocity
    simulate_path: Callable[..., Any] | None = None
    renews: bool = False

    @functools.cached_property
    def simulate(self):
        """The function `_simulate` of this module, compiled for this engine."""
        # In line with what allocates the workspace, the compiler knows that its arrays do not overlap.
        functions = vars(self) | {"step_within": self.step_within or self.step_with_events}
        path = self.simulate_path or self._compiled(_simulate_path, functions, inline="always")
        return self._compiled(_simulate, {**vars(self), "simulate_path": path})

    def _compiled(self, function, functions, **options):
        """Return a compiled copy of `function`, one of this module, in which `engine` has these `functions`."""
        module = types.ModuleType(self.task)
        vars(module).update(functions)
        copy = types.FunctionType(function.__code__, globals() | {"engine": module}, f"{function.__name__}_{self.task}")
        copy.__qualname__ = copy.__name__
        return kernel(copy, file=pathlib.Path(self.file), **options)


engine = types.ModuleType("engine")


def _simulate(keys, numbers, cycle, parameters, angle, velocity, overturn_time, overturn_side, impacts):
    """Simulate the realizations with given numbers (count,), each from its own stream of random numbers, into arrays.

    `keys` (4,) uint64 are those of the seed. `angle`, `velocity` (count, periods * rows + 1), nan before, are filled at
    the beginning and at the `rows` output times of each table period, up to overturning; `overturn_time`,
    `overturn_side` (count,) with the time τ, nan for never, and -1, 1, or 0 for never; `impacts` with impacts up to its
    capacity, all of which are counted. Times count from τ = 0, also where the run begins at a later `cycle`.
    """
    # A count of references would cost more than the steps.
    keys, numbers, parameters, angle, velocity, impacts = borrowed(
        (keys, numbers, parameters, angle, velocity, impacts)
    )
    owned, count = engine.workspace_of(parameters), np.zeros(1, np.int64)
    workspace = borrowed(owned)
    unkept = ImpactRecord(borrowed(count), impacts.time[0, :0], impacts.velocity[0, :0])
    for r in range(angle.shape[0]):
        own_stream = open_stream(keys, numbers[r])
        stream = borrowed(own_stream)
        record = ImpactRecord(impacts.count[r : r + 1], impacts.time[r], impacts.velocity[r])
        overturn_time[r], overturn_side[r] = engine.simulate_path(
            stream, cycle, parameters, workspace, angle[r], velocity[r], record, unkept
        )
        own((owned, count, own_stream))


def _simulate_path(stream, cycle, parameters, workspace, angle, velocity, impacts, unkept):
    """Simulate one realization into `angle`, `velocity`; return (time, side) of overturning, (nan, 0) for never.

    Impacts on the way to a state within an interval go to `unkept`, which has no room: a record of another type would
    have all functions of the engine compiled twice.
    """
    intervals, times, rows = parameters.grid.count, parameters.grid.output_times, parameters.grid.output_times.size
    (x, v), state = engine.begin(stream, cycle, parameters, workspace)
    if abs(x) >= parameters.block.cutoff:
        return cycle * (intervals * parameters.grid.spacing), (1 if x > 0.0 else -1)
    angle[0], velocity[0] = x, v
    side = side_of_start(x, v)
    row, j, row_time = 1, 0 * intervals, times[0]  # j is no literal, for which all of an engine would be compiled too
    for number in range((angle.size - 1) // rows * intervals):
        engine.draw(stream, number, j, cycle, parameters, workspace)
        eventless, end = engine.try_step(state, side, number, j, parameters, workspace)
        if not eventless or row_time < number + 1:
            engine.build_force(number, j, parameters, workspace)
            while row_time < number + 1:
                share = row_time - number
                within, _, time = engine.step_within(
                    state, end, side, number, j, share, cycle, parameters, workspace, unkept
                )
                angle[row], velocity[row] = (within[0], within[1]) if time == math.inf else (math.nan, math.nan)
                row += 1
                row_time = times[(row - 1) % rows] + (row - 1) // rows * intervals
        if eventless:
            state = end
        else:
            state, side, time = engine.step_with_events(
                state, end, side, number, j, 1.0, cycle, parameters, workspace, impacts
            )
            if time < math.inf:
                return time, side
        if row_time == number + 1:
            angle[row], velocity[row] = engine.state_at_end(state, side, number, j, parameters, workspace)
            row += 1
            row_time = times[(row - 1) % rows] + (row - 1) // rows * intervals
        if row == angle.size:
            break
        j = j + 1 if j + 1 < intervals else 0
    return math.nan, 0


class TimeGrid(NamedTuple):
    """Equal intervals of the table period: a cycle where the scene repeats, else the time up to the last output.

    `count`: intervals in it; `spacing`: duration of one; `output_times` (rows,): times since its beginning at which
    states are wanted, in intervals, ascending; one within rounding of a whole number is it.
    """

    count: int
    spacing: float
    output_times: np.ndarray

    @property
    def duration(self):
        """Duration of the table period."""
        return self.count * self.spacing

    def with_all_ends(self):
        """Return the grid with states wanted at the end of each interval, but in the last one at its last output."""
        return self._replace(output_times=np.append(np.arange(1.0, self.count), self.output_times[-1]))


def time_grid(scene, longest, times=None):
    """Return the `TimeGrid` of a scene for `times` in its table period, with intervals of `longest` at most."""
    rounding, most = 1e-9, TUNING.most_intervals
    times = np.array([scene.period]) if times is None else times
    spacing = scene.forcing.spacing(longest)
    end = scene.period if scene.repeats else times[-1]
    count = int(np.ceil(end / spacing - rounding))
    if count > most:
        accepted = f"at most {most} intervals of {spacing:.3g}, which this forcing and noise need"
        raise ValueError(checks.refusal("scene" if scene.repeats else "times", f"a duration of {end:g}", accepted))
    outputs = times / spacing
    nearest = np.rint(outputs)
    return TimeGrid(count, spacing, np.where(np.abs(outputs - nearest) < rounding, nearest, outputs))
