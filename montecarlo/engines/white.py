"""White noise: paths of dv = (x - s + f) dt + sqrt(2 D) dW, exact in law between impacts of a slender block.

Away from x = 0 and from the cut-off a step of any length is one draw from the Gaussian of the flight. The draw of an
exact block, dv = (-s sin φ/α + f cos φ) dt + sqrt(2 D) cos φ dW, is about the path without noise, by a method of order
4, with the covariance of a slender block times the cos² φ halfway: of weak order 2. A step is as long as it can be
while neither barrier is within `REACH` standard deviations, so steps shrink as a barrier comes near, faster than
geometrically where the block is fast. Once the noise still to come hardly matters, 2 D t < FAST w^2 over the time t
that the block needs to the barrier at speed w, one more draw carries it to its expected arrival; the small miss is made
good along a parabola, forwards or backwards alike, so that its first-order effect cancels. A low bounce, from an impact
to the next, BRIEF intervals up and as much down, is one draw: see `montecarlo.engines.bounce`.

No step is shorter than T/(FINEST steps_per_cycle). That resolution matters where impacts are slow, at speeds about
sqrt(2 D) times its root, as in a start from rest, and it decides about the bias, which is of first order in it.

The motion is folded: u = s x >= 0, w = s v. Everything is nondimensional.
"""

import math
import sys
from typing import NamedTuple

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion import CRITICAL_RESTITUTION, TERMS
from fpk_rocking.physics.motion.equation import block_of, block_of_scene, dispatch_on_block
from fpk_rocking.physics.motion.events import advance_through_events, folded_angle_bounds
from fpk_rocking.physics.motion.flight import (
    accumulated_covariance,
    covariance_factor,
    flight_covariance,
    homogeneous_flight,
    slender_flight_end,
)
from fpk_rocking.physics.motion.particular import cosh_sinh
from fpk_rocking.physics.motion.segment import Segment, segment_from_particular, value_and_slope
from fpk_rocking.physics.noise.envelope import mean_squares
from montecarlo.engines import start as start_of
from montecarlo.engines.approach import land, near
from montecarlo.engines.bounce import bounce
from montecarlo.engines.grid import grid_of
from montecarlo.engines.march import realizer
from montecarlo.engines.random import normal
from montecarlo.engines.start import start_numbers
from montecarlo.engines.steps import nystrom

METHOD = "white"
RENEWS = True
BLOCK = 1

REACH = 4.0
"""Standard deviations of the noise by which a step stays away from a barrier."""

BRIEF = 0.5
"""Longest time up, and as much down, of a bounce that is one draw, over an interval."""

FINEST = 256
"""Shortest steps in one of `steps_per_cycle`."""

_FEWEST, _LONGEST = 16, 0.075
"""Intervals in the forcing's shortest period at least, and the longest interval."""


def takes(scene):
    """Whether this engine simulates a scene."""
    return scene.noise.kind == "white"


class Problem(NamedTuple):
    """What the kernel has to know: a scene in numbers, nondimensional, and tables over the m intervals of a lap.

    `start` (5,); `count`, `spacing`, `marks`: see `montecarlo.engines.start` and `grid`.
    `particular`, `force` (m, TERMS), `low`, `high`, `curvature` (m,): segments of the forcing; `stages` (m, 3): its
    values at their begin, middle and end. `diffusion` (m,): D, 0 where it counts as none (`mean_squares`).
    `drift` (m, 2, 2): angle and velocity of a slender block after an interval from (0, 0), indexed [interval, side < 0
    or > 0]; `hyperbolic` (2,): cosh and sinh of an interval's duration; `spread` (m, 3): Cholesky factor of the noise
    that a slender block gathers. `shortest`: duration of the shortest step. `brief`: half the duration of the longest
    bounce that is one draw. `reach`: REACH standard deviations of the angle after a time t <= span are at most reach
    t^1.5, and `margin` after an interval, (m,) both.
    `repeats`: whether a lap does, and has no kinks, so that a bounce in one draw may go on into the next intervals.
    """

    restitution: float
    cutoff: float
    critical_angle: float | None
    count: int
    spacing: float
    marks: np.ndarray
    diffusion: np.ndarray
    start: np.ndarray
    particular: np.ndarray
    force: np.ndarray
    low: np.ndarray
    high: np.ndarray
    curvature: np.ndarray
    stages: np.ndarray
    drift: np.ndarray
    hyperbolic: np.ndarray
    spread: np.ndarray
    shortest: float
    brief: float
    reach: np.ndarray
    margin: np.ndarray
    repeats: bool


@kernel
def _segments(particular, span, force, low, high, curvature, stages, drift, block):
    for j in range(low.size):
        segment = segment_from_particular(particular[j], force[j], span)
        low[j], high[j], curvature[j] = segment.force_low, segment.force_high, segment.force_curvature
        for k in range(3):
            stages[j, k] = value_and_slope(force[j], 0.5 * k * span)[0]
        for k in range(2):
            drift[j, k, 0], drift[j, k, 1] = slender_flight_end(0.0, 0.0, 2 * k - 1, segment, 0.0, span, block)


def _factors(diffusions, envelope, span):
    """Return `spread` of a `Problem`, exact where the envelope is smooth."""
    if envelope is None:
        return np.sqrt(diffusions)[:, None] * np.array(covariance_factor(1.0, span))
    nodes, weights = np.polynomial.legendre.leggauss(8)
    s = 0.5 * span * (1.0 + nodes)
    strength = envelope.value(span * np.arange(len(diffusions))[:, None] + s) ** 2
    means = strength @ weights / 2.0
    weights = span * weights * strength * (diffusions / np.where(means > 0.0, means, 1.0))[:, None]
    xx, xv, vv = accumulated_covariance(weights, span - s)
    x = np.sqrt(xx)
    v = np.divide(xv, x, out=np.zeros_like(x), where=x > 0.0)
    return np.stack([x, v, np.sqrt(np.maximum(vv - v * v, 0.0))], axis=-1)


def problem_of(scene, steps_per_cycle, times=None):
    """Return the `Problem` of a scene with white noise.

    No step and no bounce that is one draw outlasts a time in `times`, so other times mean other paths (of the same
    law).
    """
    restitution, diffusion = scene.block.restitution, scene.noise.diffusion
    if diffusion == 0.0:
        accepted = "a number > 0 by the method 'white'; a scene without noise has noise.kind 'none'"
        raise ValueError(checks.refusal("noise.diffusion", diffusion, accepted))
    if restitution <= CRITICAL_RESTITUTION:
        accepted = (
            f"above {CRITICAL_RESTITUTION:.5f} under white noise, as at or below that impacts accumulate in finite "
            "time and the motion after them is not defined; band noise and filtered noise have no such limit"
        )
        raise ValueError(checks.refusal("block.restitution", restitution, accepted))
    longest, envelope = min(scene.forcing.shortest_period / _FEWEST, _LONGEST), scene.noise.envelope
    grid = grid_of(scene, longest if envelope is None else min(longest, envelope.spacing), times)
    intervals, span = grid.count, grid.spacing
    diffusions = diffusion * mean_squares(envelope, span * np.arange(intervals + 1))
    tables = (
        np.empty((intervals, TERMS)),
        np.empty(intervals),
        np.empty(intervals),
        np.empty(intervals),
        np.empty((intervals, 3)),
        np.empty((intervals, 2, 2)),
    )
    particular = scene.forcing.pieces(np.arange(intervals) * span)
    _segments(particular, span, *tables, block_of_scene(scene))
    xx, _, _ = flight_covariance(1.0, span)
    roots = np.sqrt(diffusions)
    return Problem(
        *block_of_scene(scene),
        *grid,
        diffusions,
        start_numbers(scene.start),
        particular,
        *tables,
        cosh_sinh(span),
        _factors(diffusions, envelope, span),
        scene.forcing.time_scale / (FINEST * steps_per_cycle),
        BRIEF * span,
        REACH * math.sqrt(xx / span**3) * roots,
        REACH * math.sqrt(xx) * roots,
        scene.repeats and scene.period is not None,
    )


@kernel(inline="always")
def _slender_draw(u, w, side, first, second, j, problem, block):  # noqa: ARG001
    drift = problem.drift[j, (side + 1) // 2]
    keep, swap = problem.hyperbolic
    xx, vx, vv = problem.spread[j, 0], problem.spread[j, 1], problem.spread[j, 2]
    u, w = homogeneous_flight(u, w, keep, swap)
    return u + side * (drift[0] + xx * first), w + side * (drift[1] + vx * first + vv * second)


@kernel(inline="always")
def _exact_draw(u, w, side, first, second, j, problem, block):
    begin, middle, end = problem.stages[j, 0], problem.stages[j, 1], problem.stages[j, 2]
    u, w, strength = nystrom(u, w, side, begin, middle, end, problem.spacing, block)
    xx, vx, vv = problem.spread[j, 0], problem.spread[j, 1], problem.spread[j, 2]
    return u + side * strength * (xx * first), w + side * strength * (vx * first + vv * second)


_draw = dispatch_on_block(_slender_draw, _exact_draw)
"""Folded angle and velocity after interval j without an event, by two normal numbers."""


@kernel(forceinline=True, borrows=True)  # see events.next_event
def interval(stream, u, w, side, j, problem, impacts=None, origin=0.0, start=0.0, end=math.inf, until=0.0):
    """Take the block from `start` to `end` of interval j of a lap; return u, w, side and the time reached.

    That is less than `end` if it has overturned, and up to `until` if it bounces then. Times count from `origin`, that
    of the interval's begin, and `end` is at most its end; `impacts` records the impacts.
    """
    span, cutoff, time = problem.spacing, problem.cutoff, start
    end = min(end, span)
    segment = Segment(problem.particular[j], problem.force[j], problem.low[j], problem.high[j], problem.curvature[j])
    if start == 0.0 and end == span and is_clear(u, w, side, j, problem):
        first, second = normal(stream), normal(stream)
        u, w = _draw(u, w, side, first, second, j, problem, block_of(problem))
        if u >= 0.0:
            return u, w, side, span
        u, w, side, time = land(u, w, side, segment, 0.0, span, span, problem, impacts, origin)
    if problem.diffusion[j] == 0.0:
        return _undisturbed(u, w, side, segment, time, end, problem, impacts, origin)
    if u == 0.0 and w == 0.0:
        # At rest the first step would begin with an impact if the force pressed the block down.
        side = 1 if value_and_slope(segment.force, time)[0] > 0.0 else -1
    until = max(until, end)
    while time < end and u < cutoff:
        if u == 0.0 and w > 0.0:
            w, after, time = bounce(stream, w, side, j, time, until, problem, impacts, origin)
            if after != 0:
                side = after
                continue
        u, w, side, time = near(stream, u, w, side, segment, j, time, end, problem, impacts, origin)
    return u, w, side, time


@kernel(borrows=True)
def _undisturbed(u, w, side, segment, start, end, problem, impacts, origin):
    """Take the block through a part of an interval without noise, in which it may rest: u = w = 0."""
    side = 0 if u == 0.0 and w == 0.0 else side
    x, v, side, time = advance_through_events(
        side * u, side * w, side, segment, start, end, block_of(problem), impacts, origin
    )
    if side == 0:
        return 0.0, 0.0, 1, time
    return side * x, side * v, side, time


@kernel(borrows=True)
def is_clear(u, w, side, j, problem):
    """Whether neither barrier is within REACH standard deviations in all of interval j."""
    below, above = folded_angle_bounds(u, w, side, problem.low[j], problem.high[j], problem.spacing, block_of(problem))
    return below >= problem.margin[j] and problem.cutoff - above >= problem.margin[j]


@kernel
def first_side(x, v, problem):
    """Side of a start; at rest it is where the force pushes, or the first step would begin with an impact."""
    push = v if v != 0.0 else problem.force[0, 0]
    return 1 if x > 0.0 or (x == 0.0 and push > 0.0) else -1


@kernel
def room_of(problem):  # noqa: ARG001
    """Return nothing: a path needs no working memory."""
    return


@kernel(forceinline=True, borrows=True)
def march(stream, x, v, cycle, problem, room, angle, velocity, impacts):  # noqa: ARG001
    """Simulate one path from (x, v): fill its rows of states, return time (nan: never) and side of overturning.

    A path cannot be looked at within a step, as that would take random numbers: its steps end at the times wanted.
    """
    side = first_side(x, v, problem)
    u, w = side * x, side * v
    intervals, span, marks = problem.count, problem.spacing, problem.marks
    elapsed, start = cycle * intervals, 0.0
    for row in range(1, angle.size):
        mark = marks[(row - 1) % marks.size] + (cycle + (row - 1) // marks.size) * intervals
        while elapsed < mark:
            left, j, origin = mark - elapsed, elapsed % intervals, elapsed * span
            end = min(left, 1.0) * span
            if start < end:
                until = left * span if problem.repeats else 0.0
                u, w, side, start = interval(stream, u, w, side, j, problem, impacts, origin, start, end, until)
                if u >= problem.cutoff:
                    return origin + start, side
            if left < 1.0:
                break
            passed = min(int(left), max(1, int(start / span)))
            start = max(0.0, start - passed * span) if passed < left else 0.0
            elapsed += passed
        angle[row], velocity[row] = side * u, side * w
    return math.nan, 0


draw = start_of.draw
realize = realizer(sys.modules[__name__])
