"""Filtered noise: its filter sampled exactly at grid times, and closed-form flights between located impacts.

What is drawn of the noise over an interval of the grid (`filtered_noise`) contains what the noise adds to a flight, so
that a flight without an event is exact in law, however long the interval.

Where a bound of the acceleration cannot exclude an event, the noise within the interval is needed: it is taken as a
polynomial. Then `physics.motion.events.advance_through_events` follows the block through impacts, chatter, rest,
lift-off and overturning. What the polynomial leaves out acts at events alone, and that is the method's only error
(docs/monte_carlo.md). Under an envelope, linear in pieces that end at its kinks, the product of both is taken in
flights too.

For an exact block the polynomial is the force in every flight (`physics.motion.collocation`). It moves a slender block
as was drawn, so that what it leaves out acts in a flight through the curvature of the equation of motion alone.

The noise is the same function of time for any samples, and for runs that begin at any cycle.
"""

import math
from typing import NamedTuple

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.arrays import borrowed, load
from fpk_rocking.base.basis import bernstein_basis
from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion import TERMS, collocation
from fpk_rocking.physics.motion.collocation import NODES, PLACES, FlightTables, flight_tables
from fpk_rocking.physics.motion.equation import (
    KernelBlock,
    block_of_scene,
    dispatch_on_block,
    force_bounds,
    move_origin,
    particular_from_rest,
    segment_from_particular,
)
from fpk_rocking.physics.motion.events import advance_through_events, can_lift_off, surely_eventless
from fpk_rocking.physics.motion.flight import homogeneous_flight
from fpk_rocking.physics.motion.slender import force_series, forced_response, particular_at
from montecarlo.engines.engine import Engine, TimeGrid, time_grid
from montecarlo.engines.filtered_noise import (
    EnvelopeTables,
    NoiseTables,
    NoiseWorkspace,
    allocate_noise,
    bound_noise,
    draw_first_states,
    draw_next_interval,
    draw_parts,
    envelope_tables,
    noise_tables,
    polynomial_degree,
    response_to_noise,
    write_polynomial,
)
from montecarlo.engines.random import draw_start, start_parameters
from montecarlo.tuning import TUNING

_USUAL_STEPS = 200
"""Default of `steps_per_cycle`, for which the limits of an interval in `TUNING` hold."""


class FilteredParameters(NamedTuple):
    """A scene in numbers, nondimensional, and tables over the m intervals of a table period.

    `start` (5,): see `start_parameters`. `hyperbolic` (2,): cosh and sinh of an interval's duration. `noise`,
    `envelope`: see `filtered_noise`. `forced` (m, TERMS): P of the forcing since the interval's beginning, or the
    forcing itself for an exact block; `low`, `high` (m,): bounds of the forcing; `drift` (m, 2): angle and velocity
    that it adds to a flight. At the points of `physics.motion.collocation`: `pushes` (m, NODES), the forcing, `basis`
    (d + 1, NODES), Bernstein polynomials, `strength_at_points` (m, NODES), the envelope; `steps`: its tables.
    """

    block: KernelBlock
    start: np.ndarray
    grid: TimeGrid
    hyperbolic: np.ndarray
    noise: NoiseTables
    envelope: EnvelopeTables
    forced: np.ndarray
    low: np.ndarray
    high: np.ndarray
    drift: np.ndarray
    pushes: np.ndarray
    basis: np.ndarray
    strength_at_points: np.ndarray
    steps: FlightTables


class Workspace(NamedTuple):
    """Arrays of a thread: the noise, and scratch (TERMS,)."""

    noise: NoiseWorkspace
    share: np.ndarray
    particular: np.ndarray
    force: np.ndarray


def parameters_of(scene, steps_per_cycle, times=None):
    """Return the parameters of a scene: `steps_per_cycle` times the filter's fastest rate sets the longest interval.

    ValueError where that makes too many intervals.
    """
    envelope, space = scene.noise.envelope, scene.noise.space
    rate = space.fastest * steps_per_cycle
    longest = (TUNING.filtered_smooth if space.smooth else TUNING.filtered_rough) / rate
    if longest * TUNING.filtered_intervals < scene.forcing.time_scale:
        most = int(steps_per_cycle * longest * TUNING.filtered_intervals / scene.forcing.time_scale)
        raise ValueError(checks.refusal("steps_per_cycle", steps_per_cycle, f"up to {most} with a filter of this rate"))
    # Fewer steps than usual lengthen every interval, so that they tell the error of the steps.
    coarser = max(1.0, _USUAL_STEPS / steps_per_cycle)
    longest = min(
        longest, coarser * scene.forcing.shortest_period / TUNING.filtered_fewest, coarser * TUNING.filtered_longest
    )
    longest = longest if envelope is None else min(longest, envelope.spacing)
    return parameters_on_grid(scene, time_grid(scene, longest, times))


def parameters_on_grid(scene, grid):
    """Return the parameters of a scene with its noise drawn in the intervals of a grid."""
    span, envelope, degree = grid.spacing, scene.noise.envelope, polynomial_degree(scene.noise.space)
    begins = np.arange(grid.count) * span
    forced = scene.forcing.pieces(begins)
    force = force_series(forced)
    low, high = np.empty((2, grid.count))
    force_bounds(forced, span, low, high)
    return FilteredParameters(
        block_of_scene(scene),
        start_parameters(scene.start),
        grid,
        np.array([math.cosh(span), math.sinh(span)]),
        noise_tables(scene.noise, span),
        envelope_tables(envelope, grid, degree),
        force if scene.block.critical_angle else forced,
        low,
        high,
        np.stack(forced_response(forced[:, 0], forced[:, 1], *particular_at(forced, span), span), axis=-1),
        force @ (span * PLACES) ** np.arange(TERMS)[:, None],
        bernstein_basis(PLACES, degree),
        np.empty((0, NODES)) if envelope is None else envelope.value(begins[:, None] + span * PLACES),
        flight_tables(span),
    )


@kernel
def workspace_of(parameters):
    """Return the `Workspace` of a thread."""
    rows = np.empty((3, TERMS))
    return Workspace(allocate_noise(parameters.noise), rows[0], rows[1], rows[2])


@kernel(inline="always")
def _begin(stream, cycle, parameters, workspace):
    """Draw the start, and the noise up to the run's first cycle."""
    state = draw_start(stream, parameters.start)
    draw_first_states(stream, parameters.noise, workspace.noise)
    for _ in range(cycle * parameters.grid.count):
        draw_next_interval(stream, parameters.noise, workspace.noise)
    return state, state


@kernel(inline="always")
def _draw(stream, _number, _j, _cycle, parameters, workspace):
    """Draw the noise of the next interval."""
    draw_next_interval(stream, parameters.noise, workspace.noise)


@kernel(inline="always")
def _fly_slender(x, v, side, j, parameters, workspace, _block):
    """Return (x, v, True) of a slender block at the end of interval j if it has no event."""
    push, kick = response_to_noise(j, parameters.envelope, workspace.noise)
    end, speed = homogeneous_flight(x - side, v, parameters.hyperbolic[0], parameters.hyperbolic[1])
    return end + side + parameters.drift[j, 0] + push, speed + parameters.drift[j, 1] + kick, True


@kernel(fastmath={"contract"}, forceinline=True)
def _fly_exact(x, v, side, j, parameters, workspace, block):
    """Return (x, v, right) of an exact block at the end of interval j if it has no event.

    `right` is False where the envelope has a kink inside the interval, or collocation does not converge.
    """
    if parameters.envelope.first.size > 0 and parameters.envelope.first[j + 1] > parameters.envelope.first[j] + 1:
        return x, v, False
    noise = workspace.noise.bernstein[0] * load(parameters.basis, 0)
    for i in range(1, workspace.noise.bernstein.size):
        noise = noise + workspace.noise.bernstein[i] * load(parameters.basis, i)
    if parameters.strength_at_points.shape[0] > 0:
        noise = load(parameters.strength_at_points, j) * noise
    push, tables = load(parameters.pushes, j) + noise, parameters.steps
    end, speed, _, converged = collocation.fly_by_tables(
        side * x, side * v, side, side * push, tables, parameters.grid.spacing, block
    )
    return side * end, side * speed, converged


_fly = dispatch_on_block(_fly_slender, _fly_exact)


@kernel(inline="always")
def _takes_parts(state, side, parameters):
    """Whether a block is moved by the noise drawn anew in parts of an interval, as it is at rest or nearly so.

    Never so for noise that has a derivative.
    """
    parts = parameters.noise.parts
    return parts.gain.shape[0] > 0 and (side == 0 or abs(state[1]) < parts.slowest)


@kernel(inline="always")
def _try_step(state, side, _number, j, parameters, workspace):
    """Whether interval j surely has no event, and the state at its end."""
    margin = parameters.noise.parts.margin if _takes_parts(state, side, parameters) else 0.0
    noise, envelope = workspace.noise, parameters.envelope
    low, high = bound_noise(j, parameters.noise.shape, noise.drawn, noise.bernstein, envelope, margin)
    low, high, (x, v) = low + parameters.low[j], high + parameters.high[j], state
    if side == 0:
        return not can_lift_off(low, high, parameters.block), state
    block = parameters.block
    end, speed, right = _fly(x, v, side, j, parameters, workspace, block)
    eventless = right and surely_eventless(side * x, side * end, side, low, high, parameters.grid.spacing, block)
    return eventless, (end, speed)


@kernel(fastmath={"contract"})
def _build_force(_number, j, parameters, workspace):
    """Write P of forcing and noise in interval j to `workspace.particular`; for an exact block the force itself.

    Under an envelope only the noise is written, to `workspace.noise.signal`. Time counts from the interval's beginning.
    The noise's share begins with zero angle and velocity. The one that is a polynomial no higher than the noise's, with
    the terms -(η + η'' + ...), would be as large as the fourth derivative, and its rounding far above the angle's.
    """
    write_polynomial(parameters.noise, workspace.noise)
    if parameters.envelope.strength.size == 0:
        _write_particular(workspace.noise.signal, workspace.particular, parameters.block)
        for k in range(TERMS):
            workspace.particular[k] += parameters.forced[j, k]


@kernel(forceinline=True)
def _respond_slender(force, particular, _block):
    """Write the P with P'' = P + f, P = P' = 0 at t = 0, of a force f (TERMS,), for a slender block."""
    particular_from_rest(force, particular)


@kernel(forceinline=True)
def _respond_exact(force, particular, _block):
    """Copy the coefficients of a force, for an exact block."""
    for k in range(TERMS):
        particular[k] = force[k]


_write_particular = dispatch_on_block(_respond_slender, _respond_exact)


@kernel(forceinline=True)
def _advance_slender(x, v, side, start, end, span, workspace, impacts, origin, block):
    """Carry a slender block from `start` to `end` under P, good to `span`; return (x, v, side, time)."""
    segment = borrowed(segment_from_particular(workspace.particular, workspace.force, span))
    return advance_through_events(x, v, side, segment, start, end, block, impacts, origin)


@kernel(forceinline=True)
def _advance_exact(x, v, side, start, end, span, workspace, impacts, origin, block):
    """As `_advance_slender`, of an exact block under the force in `workspace.particular`."""
    return collocation.advance_collocated(workspace.particular, span, x, v, side, start, end, block, impacts, origin)


_advance = dispatch_on_block(_advance_slender, _advance_exact)


@kernel(fastmath={"contract"})
def _build_force_in_piece(j, time, since, value, slope, parameters, workspace):
    """Write P of forcing and noise, or the force, to `workspace.particular`, by the time since a `time` in interval j.

    The noise's polynomial counts from the beginning of its part, `since` before `time`; the envelope is `value` +
    `slope` times the time since `time`.
    """
    particular, force, share = workspace.particular, workspace.force, workspace.share
    move_origin(workspace.noise.signal, since, share)
    for k in range(TERMS):
        force[k] = value * share[k] + (slope * share[k - 1] if k > 0 else 0.0)
    _write_particular(force, share, parameters.block)
    move_origin(parameters.forced[j], time, particular)
    for k in range(TERMS):
        particular[k] += share[k]


@kernel
def _advance_through_pieces(x, v, side, j, until, parameters, workspace, impacts, origin):
    """Carry a block from the beginning of interval j to `until`, by parts of its noise and pieces of the envelope.

    Return (x, v, side, time), the time of overturning or `until`.
    """
    noise, envelope, block = workspace.noise, parameters.envelope, parameters.block
    enveloped, count = envelope.strength.size > 0, 1
    if _takes_parts((x, v), side, parameters):
        count = noise.parts.shape[0]
        draw_parts(parameters.noise.parts, noise)
    piece, length = envelope.first[j] if enveloped else 0, parameters.grid.spacing / count
    for part in range(count):
        begin = part * length
        stop = min(begin + length, until) if part + 1 < count else until
        if begin >= until:
            break
        if count > 1:
            low, high = bound_noise(j, parameters.noise.parts.shape, noise.parts[part], noise.bernstein, envelope, 0.0)
            if side == 0 and not can_lift_off(low + parameters.low[j], high + parameters.high[j], block):
                continue
            write_polynomial(parameters.noise.parts, noise)
        time = begin
        while time < stop:
            value, slope, end = 1.0, 0.0, stop
            if enveloped:
                while envelope.ends[piece] <= time and piece + 1 < envelope.first[j + 1]:
                    piece += 1
                slope = envelope.strength[piece, 1]
                value = envelope.strength[piece, 0] + slope * (time - envelope.begins[piece])
                end = min(envelope.ends[piece], stop) if piece + 1 < envelope.first[j + 1] else stop
            _build_force_in_piece(j, time, time - begin, value, slope, parameters, workspace)
            last = end - time
            x, v, side, reached = _advance(x, v, side, 0.0, last, last, workspace, impacts, origin + time, block)
            if abs(x) >= block.cutoff:
                return x, v, side, time + reached
            time = end
    return x, v, side, until


@kernel(inline="always")
def _step_with_events(state, _end, side, number, j, share, cycle, parameters, workspace, impacts):
    """Carry a block through a share of interval j."""
    origin, until = (cycle * parameters.grid.count + number) * parameters.grid.spacing, share * parameters.grid.spacing
    x, v = state
    if parameters.envelope.strength.size > 0 or _takes_parts(state, side, parameters):
        x, v, side, time = _advance_through_pieces(x, v, side, j, until, parameters, workspace, impacts, origin)
    else:
        span, block = parameters.grid.spacing, parameters.block
        x, v, side, time = _advance(x, v, side, 0.0, until, span, workspace, impacts, origin, block)
    return (x, v), side, (origin + time if abs(x) >= parameters.block.cutoff else math.inf)


ENGINE = Engine(
    method="filtered",
    task="filtered",
    file=__file__,
    takes=lambda scene: scene.noise.kind == "filtered",
    parameters_of=parameters_of,
    workspace_of=workspace_of,
    begin=_begin,
    draw=_draw,
    try_step=_try_step,
    build_force=_build_force,
    step_with_events=_step_with_events,
)
