"""White noise: paths of dv = (x - s + f) dt + sqrt(2 D) dW, exact in law between impacts of a slender block.

Away from x = 0 and from the cut-off a step of any length is one draw from the Gaussian of the flight. The draw of an
exact block, dv = (-s sin φ/α + f cos φ) dt + sqrt(2 D) cos φ dW, is about the path without noise, by a method of order
4, with the covariance of a slender block times the cos² φ halfway: of weak order 2. Steps shrink to keep 4 standard
deviations from both barriers. Once 2 D t < w^2/1000 over the time t that the block needs to the barrier at speed w, one
more draw carries it to its expected arrival; the small miss is made good along a parabola, forwards or backwards alike,
so that its first-order effect cancels. A low bounce is one draw: see `montecarlo.engines.barriers`.

No step is shorter than T/(256 steps_per_cycle). The bias is of first order in that; it matters where impacts are slow.
The motion is folded: u = s x >= 0, w = s v. Everything is nondimensional.
"""

import math
from typing import NamedTuple

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion import CRITICAL_RESTITUTION
from fpk_rocking.physics.motion.equation import (
    KernelBlock,
    Segment,
    block_of_scene,
    dispatch_on_block,
    force_from_particular,
    value_and_slope,
)
from fpk_rocking.physics.motion.events import advance_through_events, folded_angle_bounds
from fpk_rocking.physics.motion.flight import (
    covariance_factor,
    flight_covariance,
    homogeneous_flight,
    slender_flight_end,
)
from fpk_rocking.physics.motion.slender import accumulated_covariance
from fpk_rocking.physics.noise.envelope import mean_diffusions
from montecarlo.engines.barriers import draw_bounce, leave_rest, nystrom_step, reflect_draw, step_near_barrier
from montecarlo.engines.engine import Engine, TimeGrid, time_grid
from montecarlo.engines.random import draw_start, normal, start_parameters
from montecarlo.tuning import TUNING


class WhiteParameters(NamedTuple):
    """A scene in numbers, nondimensional, and tables over the m intervals of a table period."""

    block: KernelBlock
    grid: TimeGrid
    diffusion: np.ndarray  # (m,): D, 0 where it counts as none
    start: np.ndarray  # (5,), of `start_parameters`
    forcing: Segment  # of `segments_of`
    stages: np.ndarray  # (m, 3): the forcing at the beginning, middle and end of intervals
    drift: np.ndarray  # (m, 2, 2), by side < 0, > 0: a slender block after an interval from (0, 0)
    hyperbolic: np.ndarray  # (2,): cosh and sinh of an interval's duration
    spread: np.ndarray  # (m, 3): Cholesky factor of the noise that a slender block gathers
    shortest: float  # duration of the shortest step
    brief: float  # half the duration of the longest bounce that is one draw
    reach: np.ndarray  # (m,): a step keeps reach t^1.5 after t, and `margin` after an interval, from a barrier
    margin: np.ndarray  # (m,)
    repeats: bool  # so that a bounce may go on into the next intervals


@kernel
def segments_of(particular, duration):
    """Return a `Segment` of arrays (m, TERMS) and (m,): the forcing over m segments of a duration, by P (m, TERMS)."""
    force, (low, high, curvature) = np.empty_like(particular), np.empty((3, particular.shape[0]))
    for j in range(low.size):
        low[j], high[j], curvature[j] = force_from_particular(particular[j], duration, force[j])
    return Segment(particular, force, low, high, curvature)


@kernel(inline="always")
def segment_at(segments, j):
    low, high, curvature = segments.force_low[j], segments.force_high[j], segments.force_curvature[j]
    return Segment(segments.particular[j], segments.force[j], low, high, curvature)


@kernel
def _write_tables(forcing, span, stages, drift, block):
    for j in range(stages.shape[0]):
        segment = segment_at(forcing, j)
        for k in range(3):
            stages[j, k] = value_and_slope(segment.force, 0.5 * k * span)[0]
        for k in range(2):
            drift[j, k, 0], drift[j, k, 1] = slender_flight_end(0.0, 0.0, 2 * k - 1, segment, 0.0, span, block)


def _noise_factors(diffusions, envelope, span):
    """Return `spread` (m, 3), exact where the envelope is smooth, by the mean of D in each interval."""
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


def parameters_of(scene, steps_per_cycle, times=None):
    """Return the parameters of a scene. No step and no bounce outlasts one of the `times`: others mean other paths."""
    diffusion = scene.noise.diffusion
    if diffusion == 0.0:
        accepted = "a number > 0 by the method 'white'; a scene without noise has noise.kind 'none'"
        raise ValueError(checks.refusal("noise.diffusion", diffusion, accepted))
    left, right = scene.block.restitution_by_side
    if left * right <= CRITICAL_RESTITUTION**2:
        accepted = (
            f"above {CRITICAL_RESTITUTION:.5f} under white noise, as at or below that impacts accumulate in finite "
            "time and the motion after them is not defined; band noise and filtered noise have no such limit"
        )
        raise ValueError(checks.refusal("block.restitution", scene.block.restitution, accepted))
    longest = min(scene.forcing.shortest_period / TUNING.white_fewest, TUNING.white_longest)
    envelope = scene.noise.envelope
    grid = time_grid(scene, longest if envelope is None else min(longest, envelope.spacing), times)
    intervals, span = grid.count, grid.spacing
    diffusions = mean_diffusions(diffusion, envelope, span * np.arange(intervals + 1))
    block, forcing = block_of_scene(scene), segments_of(scene.forcing.pieces(np.arange(intervals) * span), span)
    stages, drift = np.empty((intervals, 3)), np.empty((intervals, 2, 2))
    _write_tables(forcing, span, stages, drift, block)
    xx, _, _ = flight_covariance(1.0, span)
    roots = scene.block.largest_scale * np.sqrt(diffusions)
    return WhiteParameters(
        block=block,
        grid=grid,
        diffusion=diffusions,
        start=start_parameters(scene.start),
        forcing=forcing,
        stages=stages,
        drift=drift,
        hyperbolic=np.array([math.cosh(span), math.sinh(span)]),
        spread=_noise_factors(diffusions, envelope, span),
        shortest=scene.forcing.time_scale / (TUNING.finest_step * steps_per_cycle),
        brief=TUNING.bounce_time * span,
        reach=TUNING.barrier_distance * math.sqrt(xx / span**3) * roots,
        margin=TUNING.barrier_distance * math.sqrt(xx) * roots,
        repeats=scene.repeats and scene.period is not None,
    )


@kernel(inline="always")
def _draw_slender(u, w, side, first, second, j, parameters, _block):
    """Return the folded (u, w) of a slender block at the end of interval j, without an event, by two normal numbers."""
    drift = parameters.drift[j, (side + 1) // 2]
    keep, swap = parameters.hyperbolic
    xx, vx, vv = parameters.spread[j, 0], parameters.spread[j, 1], parameters.spread[j, 2]
    u, w = homogeneous_flight(u, w, keep, swap)
    return u + side * (drift[0] + xx * first), w + side * (drift[1] + vx * first + vv * second)


@kernel(inline="always")
def _draw_exact(u, w, side, first, second, j, parameters, block):
    begin, middle, end = parameters.stages[j, 0], parameters.stages[j, 1], parameters.stages[j, 2]
    u, w, strength = nystrom_step(u, w, side, begin, middle, end, parameters.grid.spacing, block)
    xx, vx, vv = parameters.spread[j, 0], parameters.spread[j, 1], parameters.spread[j, 2]
    return u + side * strength * (xx * first), w + side * strength * (vx * first + vv * second)


_draw = dispatch_on_block(_draw_slender, _draw_exact)


@kernel(forceinline=True)  # see events.next_event
def step_interval(stream, u, w, side, j, parameters, impacts=None, origin=0.0, start=0.0, end=math.inf, until=0.0):
    """Take the block from `start` to `end` of interval j, a bounce up to `until`; return (u, w, side, time)."""
    span, cutoff, time = parameters.grid.spacing, parameters.block.cutoff, start
    end = min(end, span)
    segment = segment_at(parameters.forcing, j)
    if start == 0.0 and end == span and is_clear(u, w, side, j, parameters):
        first, second = normal(stream), normal(stream)
        u, w = _draw(u, w, side, first, second, j, parameters, parameters.block)
        if u >= 0.0:
            return u, w, side, span
        u, w, side, time = reflect_draw(u, w, side, segment, 0.0, span, span, parameters, impacts, origin)
    if parameters.diffusion[j] == 0.0:
        return _undisturbed(u, w, side, segment, time, end, parameters, impacts, origin)
    if u == 0.0 and w == 0.0:
        u, w, side, time = leave_rest(stream, segment, j, time, end, parameters, impacts, origin)
    until = max(until, end)
    while time < end and u < cutoff:
        if u == 0.0 and w > 0.0:
            w, after, time = draw_bounce(stream, w, side, j, time, until, parameters, impacts, origin)
            if after != 0:
                side = after
                continue
        u, w, side, time = step_near_barrier(stream, u, w, side, segment, j, time, end, parameters, impacts, origin)
    return u, w, side, time


@kernel
def _undisturbed(u, w, side, segment, start, end, parameters, impacts, origin):
    """Take the block through a part of an interval without noise; return (u, w, side, time), (0, 0, 1) at rest."""
    side = 0 if u == 0.0 and w == 0.0 else side
    x, v, side, time = advance_through_events(
        side * u, side * w, side, segment, start, end, parameters.block, impacts, origin
    )
    if side == 0:
        return 0.0, 0.0, 1, time
    return side * x, side * v, side, time


@kernel
def is_clear(u, w, side, j, parameters):
    """Whether a block surely keeps 4 standard deviations from both barriers, x = 0 and the cut-off, in interval j."""
    forcing = parameters.forcing
    below, above = folded_angle_bounds(
        u, w, side, forcing.force_low[j], forcing.force_high[j], parameters.grid.spacing, parameters.block
    )
    return below >= parameters.margin[j] and parameters.block.cutoff - above >= parameters.margin[j]


@kernel
def first_side(x, v, parameters):
    """Return the side of a start, at rest that of the force until `leave_rest` decides it."""
    push = v if v != 0.0 else parameters.forcing.force[0, 0]
    return 1 if x > 0.0 or (x == 0.0 and push > 0.0) else -1


@kernel(forceinline=True)
def _simulate_path(stream, cycle, parameters, _workspace, angle, velocity, impacts, _unkept):
    """As `_simulate_path` of `engine`; steps end at the output times, as a look within one takes random numbers."""
    intervals, span, times = parameters.grid.count, parameters.grid.spacing, parameters.grid.output_times
    x, v = draw_start(stream, parameters.start)
    if abs(x) >= parameters.block.cutoff:
        return cycle * (intervals * span), (1 if x > 0.0 else -1)
    angle[0], velocity[0] = x, v
    side = first_side(x, v, parameters)
    u, w = side * x, side * v
    elapsed, start = cycle * intervals, 0.0
    for row in range(1, angle.size):
        row_time = times[(row - 1) % times.size] + (cycle + (row - 1) // times.size) * intervals
        while elapsed < row_time:
            left, j, origin = row_time - elapsed, elapsed % intervals, elapsed * span
            end = min(left, 1.0) * span
            if start < end:
                until = left * span if parameters.repeats else 0.0
                u, w, side, start = step_interval(stream, u, w, side, j, parameters, impacts, origin, start, end, until)
                if u >= parameters.block.cutoff:
                    return origin + start, side
            if left < 1.0:
                break
            passed = min(int(left), max(1, int(start / span)))
            start = max(0.0, start - passed * span) if passed < left else 0.0
            elapsed += passed
        angle[row], velocity[row] = side * u, side * w
    return math.nan, 0


ENGINE = Engine(
    method="white",
    takes=lambda scene: scene.noise.kind == "white" and scene.forcing.vertical is None,
    parameters_of=parameters_of,
    simulate_path=_simulate_path,
    renews=True,
)
