"""Event-driven realizations under band noise or none: flights between located impacts, and no time step.

Noise and forcing are band-limited. The noise is sampled on a grid that is far coarser than the steps of an integrator,
and is a polynomial between grid points. Over an interval a block is carried in one flight; only the intervals in which
a bound of the acceleration cannot exclude an event are looked at more closely. There are three kinds of flight:

* A slender block is carried in closed form, s + P plus two exponentials, where P is the particular solution of forcing
  and noise, and a polynomial like them. The state is these exponentials and the folded angle.
* A slender block under noise with an envelope, η(τ) g(τ), is carried by what forcing and noise add to its angle and
  velocity over an interval. As g has kinks the product is not band-limited, and P is started anew in every interval.
* An exact block, with an envelope or without, is carried by collocation (`physics.motion.collocation`), for which the
  force is known at a few points by a table times the samples of the noise.
"""

import math

from fpk_rocking.base.arrays import borrowed, load, store
from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion import TERMS, collocation
from fpk_rocking.physics.motion.equation import dispatch_on_block, particular_from_rest, segment_from_particular
from fpk_rocking.physics.motion.events import advance_through_events, can_lift_off
from fpk_rocking.physics.motion.flight import exponential_parts, folded_angle, homogeneous_flight
from fpk_rocking.physics.motion.impact import side_of_start
from fpk_rocking.physics.motion.intervals import NODES, cross_interval, state_in_interval
from fpk_rocking.physics.noise.band import WIDTH, divide_by_stiffness, noise_at_points, noise_slope, write_product
from montecarlo.engines.band_noise import draw_start_and_noise, parameters_of, workspace_of
from montecarlo.engines.engine import Engine
from montecarlo.engines.noise_samples import (
    CHUNK,
    divide_by_window,
    interpolate,
    sample_and_part,
    write_first_samples,
    write_next_samples,
    write_nodes,
)

# ----------------------------------------------------------------------------------------- a slender block, closed form


@kernel(inline="always")
def _begin_closed(stream, cycle, parameters, workspace):
    """Draw start and noise from `stream` (4,) uint64; return (angle, velocity) and the state, nondimensional.

    Both are at the begin of a `cycle` (its number). The state is a tuple of three floats, the growing and the decaying
    exponential and the folded angle. The harmonics and the first samples of the noise are written to `workspace`.
    `parameters`, `workspace`: named tuples `Parameters` and `Workspace` of `band_noise`.
    """
    samples = workspace.samples
    x, v = draw_start_and_noise(stream, parameters.start, parameters.band, samples.harmonics)
    side = side_of_start(x, v)
    ratios, frequency = samples.harmonics.ratios, 2.0 * math.pi / (parameters.grid.count * parameters.grid.spacing)
    divide_by_stiffness(ratios, samples.harmonics.weights, frequency, parameters.compensation, parameters.ratio_scale)
    write_first_samples(samples, cycle, parameters)
    write_nodes(samples.values, workspace.node, parameters.flight.ends)
    _build_particular(0, 0, parameters, workspace)
    grow, decay = exponential_parts(x, v, side, workspace.interval.particular, -workspace.interval.half)
    return (x, v), (grow, decay, abs(x))


@kernel(forceinline=True)
def _draw_closed(stream, number, j, cycle, parameters, workspace):  # noqa: ARG001  (all is drawn with the start)
    """Write to `workspace` the noise's samples for the next CHUNK intervals, from `number` on, if none are left.

    `number` counts intervals from the begin of the run at `cycle`; `stream` and j are not used. The noise's share of P
    at these intervals' ends is written too. `parameters`, `workspace`: `Parameters` and `Workspace` of `band_noise`.
    """
    if write_next_samples(workspace.samples, number, cycle, parameters):
        write_nodes(workspace.samples.values, workspace.node, parameters.flight.ends)


@kernel(inline="always")
def _is_eventless(u, end, side, j, parameters):
    """Whether a flight from folded angle u to folded angle `end` surely has no event in interval j of the tables.

    Folded angles are `side`, 1 or -1, times angles, nondimensional. Of `parameters`, `Parameters` of `band_noise`,
    `least` and `most` are read: bounds of both.
    """
    s = 1 if side > 0 else 0
    return min(u, end) > parameters.least[j, s] and max(u, end) < parameters.most[j, s]


@kernel(forceinline=True)
def _try_closed(state, side, number, j, parameters, workspace):
    """Return whether interval j surely has no event (bool), and the state at its end if so.

    A state is a tuple, the growing and the decaying exponential and the folded angle, nondimensional; `state` is that
    at the begin, `side` 1, -1 or 0 at rest, for which the answer is no. `number` counts intervals from the begin of the
    run, j is the row of the tables. The noise is in `workspace`. `parameters`, `workspace`: those of `band_noise`.
    """
    factor, (grow, decay, u) = workspace.interval.factor * workspace.interval.factor, state
    grow, decay = grow * factor, decay * (1.0 / factor)
    end = folded_angle(side, parameters.flight.node[j, 0] + workspace.node[number % CHUNK], grow, decay)
    return side != 0 and _is_eventless(u, end, side, j, parameters), (grow, decay, end)


@kernel(inline="always")
def _build_particular(number, j, parameters, workspace):
    """Write P of forcing and noise in interval j to `workspace.interval.particular` (TERMS,), for a slender block.

    P solves P'' = P + f; it is a polynomial in the time since the interval's middle. `number` counts intervals from the
    begin of the run, j is the row of the tables. `parameters`, `workspace`: those of `band_noise`.
    """
    particular, samples = workspace.interval.particular, workspace.samples.values
    interpolate(particular, parameters.forced[j], parameters.polynomials[0], samples, number % CHUNK)


@kernel(inline="always")
def _step_closed(state, end, side, number, j, share, cycle, parameters, workspace, impacts):  # noqa: ARG001
    """Carry a block through interval j with its events; return (state, side, time τ of overturning or inf).

    A state is a tuple, the growing and the decaying exponential and the folded angle, nondimensional. `state` is that
    at the begin, `end` that at the end if there were no event, from `_try_closed`; `side` is 1, -1, or 0 at rest;
    `share` is 1. `impacts` is an `ImpactRecord`, of times since τ = 0. `number` counts intervals from the begin of the
    run at `cycle`, j is the row of the tables. `parameters`, `workspace`: those of `band_noise`.
    """
    middle = cycle * (parameters.grid.count * parameters.grid.spacing) + (number + 0.5) * parameters.grid.spacing
    node = parameters.flight.node[j, 0] + workspace.node[number % CHUNK]
    grow, decay, u, side, time = cross_interval(
        workspace.interval, node, state[0], state[1], state[2], end[2], side, parameters.block, impacts, middle
    )
    return (grow, decay, u), side, time


@kernel(inline="always")
def _step_within_closed(state, end, side, number, j, share, cycle, parameters, workspace, impacts):  # noqa: ARG001
    """Carry a block through a `share`, below 1, of interval j; return ((angle, velocity), `side` as passed, inf).

    Angle and velocity, nondimensional, are those at the end of that share, nan if the block has overturned by then.
    `state` is that at the begin, two exponentials and the folded angle; `end`, j, `number` and `cycle` are not used.
    `impacts`: an `ImpactRecord`; `parameters`, `workspace`: `Parameters` and `Workspace` of `band_noise`.
    """
    time, block = (share - 0.5) * parameters.grid.spacing, parameters.block
    return state_in_interval(workspace.interval, state[0], state[1], side, time, block, impacts), side, math.inf


@kernel(forceinline=True)
def _end_closed(state, side, number, j, parameters, workspace):
    """Return (angle, velocity) at the end of interval j, nondimensional; (0, 0) at rest, which is `side` 0.

    `state` is that at the end: the growing and the decaying exponential and the folded angle. `number` counts intervals
    from the begin of the run, j is the row of the tables. `parameters`, `workspace`: those of `band_noise`.
    """
    grow, decay, u = state
    if side == 0:
        return 0.0, 0.0
    slope = noise_slope(workspace.samples.values, number % CHUNK, parameters.flight.ends[1])
    return side * u, parameters.flight.node[j, 1] + slope + grow - decay


# ------------------------------------------------------ an envelope, or an exact block; the state is angle and velocity


@kernel(inline="always")
def _begin(stream, cycle, parameters, workspace):
    """Draw start and noise from `stream` (4,) uint64; return (angle, velocity) twice, also as the state.

    They are nondimensional. The harmonics, and their samples for the first intervals of `cycle` (its number), are
    written to `workspace`. `parameters`, `workspace`: named tuples `Parameters` and `Workspace` of `band_noise`.
    """
    samples = workspace.samples
    x, v = draw_start_and_noise(stream, parameters.start, parameters.band, samples.harmonics)
    divide_by_window(samples.harmonics, parameters)
    write_first_samples(samples, cycle, parameters)
    return (x, v), (x, v)


@kernel(inline="always")
def _draw(stream, number, j, cycle, parameters, workspace):  # noqa: ARG001  (all is drawn with the start)
    """Write to `workspace` the noise's samples for the next CHUNK intervals, from `number` on, if none are left.

    `number` counts intervals from the begin of the run at `cycle`; `stream` and j are not used. `parameters`,
    `workspace`: `Parameters` and `Workspace` of `band_noise`.
    """
    write_next_samples(workspace.samples, number, cycle, parameters)


@kernel(fastmath={"contract"}, forceinline=True)
def _respond_to_force(x, v, side, j, k, parameters, workspace):
    """Return (angle, velocity) of a slender block at the end of interval j if it has no event in it; nondimensional.

    (x, v), angle and velocity, are at its begin, `side` is 1 or -1, j the row of the tables, k the interval's number in
    the chunk of samples in `workspace`. The envelope is one piece. `parameters`, `workspace`: those of `band_noise`.
    """
    h, samples, response = parameters.grid.spacing, workspace.samples.values, parameters.flight.noise
    strength = parameters.envelope.strength[parameters.envelope.first[j]]
    push, kick = parameters.flight.forcing[j, 0], parameters.flight.forcing[j, 1]
    for n in range(strength.size):
        a, b = 0.0, 0.0
        for i in range(WIDTH):
            a += response[n, 0, i] * samples[k + i]
            b += response[n, 1, i] * samples[k + i]
        push += strength[n] * a
        kick += strength[n] * b
    y, v = homogeneous_flight(x - side, v, math.cosh(h), math.sinh(h))
    return side + y + push, v + kick


@kernel(inline="always")
def _try_response(state, side, number, j, parameters, workspace):
    """Return whether interval j surely has no event for a slender block (bool), and (angle, velocity) at its end if so.

    `state` is (angle, velocity) at its begin, nondimensional, `side` 1, -1 or 0 at rest; `number` counts intervals from
    the begin of the run, j is the row of the tables. Where the envelope has a kink inside the interval the answer is
    no. `parameters`, `workspace`: `Parameters` and `Workspace` of `band_noise`.
    """
    x, v = state
    if side == 0:
        return parameters.stays[j], state
    if parameters.envelope.first[j + 1] > parameters.envelope.first[j] + 1:
        return False, state
    end = _respond_to_force(x, v, side, j, number % CHUNK, parameters, workspace)
    return _is_eventless(side * x, side * end[0], side, j, parameters), end


@kernel(forceinline=True)
def _surely_rests(force, slack, scratch, block):
    """Whether a block surely stays at rest in an interval (bool).

    `force`: f at the NODES points of the interval, nondimensional, as `Lanes` (eight floats); `slack`: how far f may
    pass these values in between. `scratch` (1, NODES) is written to, and `block` is a `KernelBlock`.
    """
    store(scratch, 0, force)
    low, high = scratch[0, 0], scratch[0, 0]
    for n in range(1, NODES):
        low, high = min(low, scratch[0, n]), max(high, scratch[0, n])
    return not can_lift_off(low - slack, high + slack, block)


@kernel(inline="always")
def _try_collocation(state, side, number, j, parameters, workspace):
    """Return whether interval j surely has no event for an exact block (bool), and (angle, velocity) at its end if so.

    `state` is (angle, velocity) at its begin, nondimensional, `side` 1, -1 or 0 at rest; `number` counts intervals from
    the begin of the run, j is the row of the tables. The angle is nan if collocation has not converged; u'' is written
    to `workspace.acceleration` (1, NODES). `parameters`, `workspace`: `Parameters` and `Workspace` of `band_noise`.
    """
    x, v = state
    if side == 0 and (parameters.stays[j] or parameters.flight.slack[j] == math.inf):
        return parameters.stays[j], state
    if parameters.envelope.first[j + 1] > parameters.envelope.first[j] + 1:
        return False, state
    tables, block = parameters.flight, parameters.block
    sample, part = sample_and_part(number, parameters)
    push = noise_at_points(tables.values, part, workspace.samples.values, sample % CHUNK)
    if tables.envelope.shape[0] > 0:
        push = load(tables.envelope, j) * push
    push = load(tables.forcing, j) + push
    if side == 0:
        return _surely_rests(push, tables.slack[j], workspace.acceleration, block), state
    u, push = side * x, side * push
    end, speed, acceleration, converged = collocation.fly_by_tables(
        u, side * v, side, push, tables.steps, parameters.grid.spacing, block
    )
    store(workspace.acceleration, 0, acceleration)
    eventless = converged and _is_eventless(u, end, side, j, parameters)
    return eventless, (side * end if converged else math.nan, side * speed)


@kernel(fastmath={"contract"}, forceinline=True)
def _build_noise_slender(number, j, parameters, workspace):  # noqa: ARG001
    """Write the noise, without the factor of its envelope, to `workspace.noise` (TERMS,), for a slender block.

    It is a polynomial in the time since the middle of the interval `number`, counted from the begin of the run.
    `parameters`, `workspace`: `Parameters` and `Workspace` of `band_noise`. j is not used.
    """
    k, samples, polynomials = number % CHUNK, workspace.samples.values, parameters.polynomials[0]
    for n in range(TERMS):
        value = 0.0
        for i in range(WIDTH):
            value += samples[k + i] * polynomials[i, n]
        workspace.noise[n] = value


@kernel(inline="always")
def _build_noise(number, j, parameters, workspace):  # noqa: ARG001
    """Write the noise, without the factor of its envelope, to `workspace.noise` (TERMS,), for an exact block.

    It is a polynomial in the time since the middle of the interval `number`, counted from the begin of the run.
    `parameters`, `workspace`: `Parameters` and `Workspace` of `band_noise`. j is not used.
    """
    sample, part = sample_and_part(number, parameters)
    samples, polynomials = workspace.samples.values, parameters.polynomials[part]
    interpolate(workspace.noise, parameters.zeros, polynomials, samples, sample % CHUNK)


@kernel(inline="always")
def _advance_slender(x, v, side, j, begin, end, strength, tried, last, parameters, workspace, impacts, origin, block):  # noqa: ARG001
    """Carry a slender block from `begin` to `end` of interval j; return (x, v, side, time), nondimensional.

    (x, v) are angle and velocity, `side` is 1, -1, or 0 at rest; the time is `end`, or that of overturning. Times are
    since the interval's middle; `origin` is the τ of the middle, to record `impacts` (an `ImpactRecord`, or None). From
    `begin` to `end` the envelope is the polynomial `strength` (order,) in these times. `tried`, `last` are not used.
    `parameters`, `workspace`: `Parameters` and `Workspace` of `band_noise`. Its `interval` is overwritten.
    """
    force, particular, half = workspace.interval.force, workspace.interval.particular, workspace.interval.half
    write_product(strength, workspace.noise, parameters.zeros, force)
    particular_from_rest(force, particular)
    for n in range(TERMS):
        particular[n] += parameters.forced[j, n]
    segment = borrowed(segment_from_particular(particular, force, half))
    return advance_through_events(x, v, side, segment, begin, end, block, impacts, origin)


@kernel(inline="always")
def _advance_exact(x, v, side, j, begin, end, strength, tried, last, parameters, workspace, impacts, origin, block):
    """Carry an exact block from `begin` to `end` of interval j; return (x, v, side, time), nondimensional.

    Arguments and result are as of `_advance_slender`. If `tried` (bool), `last` is (angle, velocity) at `end` of the
    flight from `begin` if it meets no event, and `workspace.acceleration` has its u''.
    """
    force, half, acceleration = workspace.interval.force, workspace.interval.half, load(workspace.acceleration, 0)
    write_product(strength, workspace.noise, parameters.forced[j], force)
    angle, speed = last
    return collocation.advance_from_flight(
        force, half, x, v, side, begin, end, block, impacts, origin, tried, side * angle, side * speed, acceleration
    )


_advance = dispatch_on_block(_advance_slender, _advance_exact)


@kernel(forceinline=True)
def _step(state, end, side, number, j, share, cycle, parameters, workspace, impacts):
    """Carry a block through a `share`, up to 1, of interval j; return ((angle, velocity), side, time).

    The time is the τ of overturning, or inf; all is nondimensional. `state` is (angle, velocity) at the interval's
    begin, `side` 1, -1 or 0 at rest, `end` the state at its end as tried without an event. `number` counts intervals
    from the begin of the run at `cycle`, j is the row of the tables; `impacts` is an `ImpactRecord`, of times since τ =
    0. `parameters`, `workspace`: `Parameters` and `Workspace` of `band_noise`.
    """
    (x, v), first = state, parameters.envelope.first
    spacing, time, tried = parameters.grid.spacing, 0.0, False
    if share == 1.0:
        tried = side != 0 and not math.isnan(end[0]) and first[j + 1] == first[j] + 1
    origin = cycle * (parameters.grid.count * spacing) + (number + 0.5) * spacing
    until, begin, block = (share - 0.5) * spacing, -0.5 * spacing, parameters.block
    for piece in range(first[j], first[j + 1]):
        strength, stop = parameters.envelope.strength[piece], min(parameters.envelope.ends[piece], until)
        if begin >= until:
            break
        x, v, side, time = _advance(
            x, v, side, j, begin, stop, strength, tried, end, parameters, workspace, impacts, origin, block
        )
        if abs(x) >= parameters.block.cutoff:
            return (x, v), side, origin + time
        begin = stop
    return (x, v), side, math.inf


def _takes(enveloped, exact):
    """Return a function of a `Scene` that tells (bool) whether it has band noise or none, of the wanted kind.

    `enveloped`: whether the noise has an envelope, None for either; `exact`: whether the critical angle is above 0.
    """

    def takes(scene):
        """Whether the engine simulates a `Scene` (bool)."""
        noise, block = scene.noise, scene.block
        fits = enveloped in (None, noise.kind == "band" and noise.envelope is not None)
        return noise.kind in {"none", "band"} and fits and (block.critical_angle > 0.0) == exact

    return takes


_COMMON = {"method": "exact", "file": __file__, "parameters_of": parameters_of, "workspace_of": workspace_of}

SLENDER = Engine(
    task="exact",
    takes=_takes(False, False),
    begin=_begin_closed,
    draw=_draw_closed,
    try_step=_try_closed,
    build_force=_build_particular,
    step_with_events=_step_closed,
    step_within=_step_within_closed,
    state_at_end=_end_closed,
    **_COMMON,
)
ENVELOPED = Engine(
    task="enveloped",
    takes=_takes(True, False),
    begin=_begin,
    draw=_draw,
    try_step=_try_response,
    build_force=_build_noise_slender,
    step_with_events=_step,
    **_COMMON,
)
EXACT_BLOCK = Engine(
    task="nonlinear",
    takes=_takes(None, True),
    begin=_begin,
    draw=_draw,
    try_step=_try_collocation,
    build_force=_build_noise,
    step_with_events=_step,
    **_COMMON,
)
