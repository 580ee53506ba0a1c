"""The march of realizations through the intervals of a grid, of which every engine has a kernel of its own made.

An engine says how its force is known on an interval. The march does the rest once for all of them: realizations in
parallel, starts beyond the cut-off, rows of states at the times wanted, and overturning. In the functions below
`engine` stands for the module of the engine (see `montecarlo.engines.Engine`); `realizer` puts it there.
"""

import math
import types

from numba import prange

from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion.events import ImpactRecord
from fpk_rocking.physics.motion.impact import side_of_start
from montecarlo.engines.random import open_stream

engine = types.ModuleType("engine")


def _march(stream, x, v, cycle, problem, room, angle, velocity, impacts):
    """Carry one realization from (x, v): fill its rows of states, return time (nan: never) and side of overturning."""
    intervals, marks, rows = problem.count, problem.marks, problem.marks.size
    side = side_of_start(x, v)
    state = engine.begin(stream, x, v, side, cycle, problem, room)
    row, j, mark = 1, 0 * intervals, marks[0]  # j is no literal, for which all of an engine would be compiled too
    for number in range((angle.size - 1) // rows * intervals):
        engine.know(stream, number, j, cycle, problem, room)
        quiet, ahead = engine.coast(state, side, number, j, problem, room)
        if not quiet or mark < number + 1:
            engine.resolve(number, j, problem, room)
            while mark < number + 1:
                angle[row], velocity[row] = engine.look(state, side, number, j, mark - number, problem, room)
                row += 1
                mark = marks[(row - 1) % rows] + (row - 1) // rows * intervals
        if quiet:
            state = ahead
        else:
            state, side, time = engine.cross(state, ahead, side, number, j, cycle, problem, room, impacts)
            if time < math.inf:
                return time, side
        if mark == number + 1:
            angle[row], velocity[row] = engine.seen(state, side, number, j, problem, room)
            row += 1
            mark = marks[(row - 1) % rows] + (row - 1) // rows * intervals
        if row == angle.size:
            break
        j = j + 1 if j + 1 < intervals else 0
    return math.nan, 0


def _realize(keys, first, cycle, problem, angle, velocity, overturn_time, overturn_side, impacts):
    """Simulate realizations `first`, `first` + 1, ... in parallel; see `montecarlo.engines.Engine`."""
    count = angle.shape[0]
    for block in prange((count + engine.BLOCK - 1) // engine.BLOCK):
        room = engine.room_of(problem)
        for r in range(block * engine.BLOCK, min((block + 1) * engine.BLOCK, count)):
            stream = open_stream(keys, first + r)
            x, v = engine.draw(stream, problem, room)
            if abs(x) >= problem.cutoff:
                lap = problem.count * problem.spacing
                overturn_time[r], overturn_side[r] = cycle * lap, (1 if x > 0.0 else -1)
                continue
            angle[r, 0], velocity[r, 0] = x, v
            own = ImpactRecord(impacts.count[r : r + 1], impacts.time[r], impacts.velocity[r])
            overturn_time[r], overturn_side[r] = engine.march(
                stream, x, v, cycle, problem, room, angle[r], velocity[r], own
            )


def _look(state, side, number, j, share, problem, room):
    """Angle and velocity after a share of a resolved interval, nan if overturned; the state is angle and velocity."""
    x, v, _, _ = engine.carry(*state, side, number, j, share, 0, problem, room, None)
    if abs(x) >= problem.cutoff:
        return math.nan, math.nan
    return x, v


def _cross(state, ahead, side, number, j, cycle, problem, room, impacts):  # noqa: ARG001
    """Carry a block through a resolved interval; the state is angle and velocity."""
    x, v, side, time = engine.carry(*state, side, number, j, 1.0, cycle, problem, room, impacts)
    return (x, v), side, (time if abs(x) >= problem.cutoff else math.inf)


@kernel(inline="always")
def the_state(state, side, number, j, problem, room):  # noqa: ARG001
    """Return the state, for an engine whose state is angle and velocity: its `seen`."""
    return state


def carriers(module):
    """Return `look` and `cross` of an engine whose state is angle and velocity, and which has `carry`."""
    return (kernel(_of(function, module), file=module.__file__, borrows=True) for function in (_look, _cross))


def marcher(module, **options):
    """Return the march of an engine through its intervals, for `realizer`; options are those of `kernel`."""
    return kernel(_of(_march, module), file=module.__file__, **options)


def realizer(module):
    """Return the kernel `realize` of an engine, whose module has `march`: from `marcher`, or its own."""
    return kernel(_of(_realize, module), file=module.__file__, parallel=True)


def _of(function, module):
    """Return a function in which `engine` is a module."""
    return types.FunctionType(function.__code__, globals() | {"engine": module}, function.__name__)
