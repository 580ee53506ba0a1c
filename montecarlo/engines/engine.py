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
    return state


@kernel
def no_workspace(_parameters):
    return


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Engine:
    """How the realizations of some scenes are simulated: its functions in the order in which they are called."""

    # All functions but the first two are compiled, and depend on nothing but their arguments. `number` counts intervals
    # from the beginning of the run, and j from that of the table period, as the rows of the tables do. A state is a
    # tuple of numbers, in variables of the engine's choice; the side is +1, -1, or 0 at rest. A stream (4,) uint64 is
    # the state of the random numbers.
    method: str  # by which a user asks for it
    # Once for a scene. (scene): whether it simulates it.
    takes: Callable[..., bool]
    # (scene, steps_per_cycle, times): what the other functions need, as a tuple of numbers and arrays with a `block`,
    # a `KernelBlock`, and a `grid`, a `TimeGrid`. States are wanted at the times (rows,) since the beginning of the
    # table period; by default at its end alone.
    parameters_of: Callable[..., Any]
    # Once for a thread. (parameters): arrays that the other functions write to, as a tuple.
    workspace_of: Callable[..., Any] = no_workspace
    # Once for a realization. (stream, cycle, parameters, workspace): draws the start, and the noise up to the cycle at
    # which the run begins; returns (angle, velocity) and the state.
    begin: Callable[..., Any] | None = None
    # In each interval. (stream, number, j, cycle, parameters, workspace): draws, or computes, the noise in it.
    draw: Callable[..., Any] | None = None
    # (state, side, number, j, parameters, workspace): whether it surely passes without an event, and then the state at
    # its end.
    try_step: Callable[..., Any] | None = None
    # If not surely, or if a state within it is wanted. (number, j, parameters, workspace): writes the force in it as a
    # polynomial.
    build_force: Callable[..., Any] | None = None
    # Then to its end. (state, end, side, number, j, share, cycle, parameters, workspace, impacts): carries a state
    # through a share of it, through impacts, rest, lift-off and overturning; `end` is what `try_step` has returned,
    # `impacts` an `ImpactRecord`. Returns state, side, and time τ of overturning, inf for none.
    step_with_events: Callable[..., Any] | None = None
    # The same to a state within it that begins with angle and velocity; by default `step_with_events`.
    step_within: Callable[..., Any] | None = None
    # Where a state is wanted at its end. (state, side, number, j, parameters, workspace): angle and velocity there.
    state_at_end: Callable[..., Any] = angle_and_velocity
    # In place of all from `begin` on, for paths that cannot be looked at within a step; parameters of `_simulate_path`.
    simulate_path: Callable[..., Any] | None = None
    renews: bool = False  # whether a run from another cycle on has noise of its own, not the same function of time

    @property
    def file(self):
        """Source file of its functions; the name of the file is the engine's."""
        return pathlib.Path(self.parameters_of.__code__.co_filename)

    @functools.cached_property
    def simulate(self):
        """`_simulate`, compiled for this engine."""
        # In line with what allocates the workspace, the compiler knows that its arrays do not overlap.
        functions = vars(self) | {"step_within": self.step_within or self.step_with_events}
        path = self.simulate_path or self._compiled(_simulate_path, functions, inline="always")
        return self._compiled(_simulate, functions | {"simulate_path": path})

    def _compiled(self, function, functions, **options):
        """Return a compiled copy of `function`, one of this module, in which `engine` has these `functions`."""
        name = self.file.stem
        module = types.ModuleType(name)
        vars(module).update(functions)
        copy = types.FunctionType(function.__code__, globals() | {"engine": module}, f"{function.__name__}_{name}")
        copy.__qualname__ = copy.__name__
        return kernel(copy, file=self.file, **options)


engine = types.ModuleType("engine")


def _simulate(keys, numbers, cycle, parameters, angle, velocity, overturn_time, overturn_side, impacts):
    """Simulate realizations by their `numbers` (count,) into arrays as of `Batch`; `keys` (4,) are of the seed."""
    # A count of references would cost more than the steps.
    keys, numbers, parameters, angle, velocity, impacts = borrowed(
        (keys, numbers, parameters, angle, velocity, impacts)
    )
    # States are kept at the beginning and at the `rows` output times of each table period, up to overturning. Times
    # count from τ = 0, also where the run begins at a later `cycle`. All impacts are counted, also beyond the capacity.
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
    """Simulate one realization into `angle`, `velocity`; return (time, side) of overturning, or (nan, 0)."""
    # Impacts on the way to a state within an interval go to `unkept`, which has no room: a record of another type would
    # have all functions of the engine compiled twice.
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
    """Equal intervals of the table period: a cycle where the scene repeats, else the time up to the last output."""

    count: int  # intervals
    spacing: float  # duration of one
    # (rows,) since the beginning, in intervals, ascending; within rounding of a whole number it is that
    output_times: np.ndarray

    @property
    def duration(self):
        return self.count * self.spacing

    def with_all_ends(self):
        """The grid with states wanted at the end of each interval, in the last one at its last output."""
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
