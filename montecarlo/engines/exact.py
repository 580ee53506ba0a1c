"""Event-driven realizations under band noise or none: flights between located impacts, and no time step.

Noise and forcing are band-limited. The noise is sampled on a grid that is far coarser than the steps of an integrator,
and is a polynomial between grid points. Over an interval a block is carried in one flight; only the intervals in which
a bound of the acceleration cannot exclude an event are looked at more closely. There are three kinds of flight:

* A slender block is carried in closed form, s + P plus two exponentials, where P is the particular solution of forcing
  and noise, and a polynomial like them. The state is these exponentials and the folded angle, which costs a few
  operations an interval. Events are met by `physics.motion.crossing`.
* A slender block under noise with an envelope, η(τ) g(τ), is carried by what forcing and noise add to its angle and
  velocity over an interval. As g has kinks the product is not band-limited, and P is started anew in every interval.
* An exact block, with an envelope or without, is carried by collocation (`physics.motion.collocation`), for which the
  force is known at a few points by a table times the samples of the noise.
"""

import math

from fpk_rocking.base.arrays import borrowed
from fpk_rocking.base.jit import kernel
from fpk_rocking.base.simd import load, store
from fpk_rocking.physics.motion import TERMS, collocation
from fpk_rocking.physics.motion.equation import dispatch_on_block
from fpk_rocking.physics.motion.events import advance_through_events
from fpk_rocking.physics.motion.flight import dynamic_stiffness, exponential_parts, folded_angle, homogeneous_flight
from fpk_rocking.physics.motion.impact import side_of_start
from fpk_rocking.physics.motion.segment import particular_from_rest, segment_from_particular
from fpk_rocking.physics.motion.slender_interval import cross_interval, state_in_interval
from fpk_rocking.physics.noise.band import (
    WIDTH,
    evaluate_compensation,
)
from montecarlo.engines.band_noise import (
    CHUNK,
    divide_by_window,
    draw_start_and_noise,
    interpolate,
    parameters_of,
    workspace_of,
    write_first_samples,
    write_next_samples,
)
from montecarlo.engines.engine import Engine

# ----------------------------------------------------------------------------------------- a slender block, closed form


@kernel(fastmath={"contract"})
def _divide_by_stiffness(ratios, weights, frequency, compensation, ratio_scale):
    """Turn the weights (n,) of the noise's harmonics into those of the interpolant of P."""
    for n in range(ratios.size):
        gain = -evaluate_compensation(compensation, ratios[n] * ratio_scale)
        weights[n] *= gain / dynamic_stiffness(frequency * ratios[n])


@kernel(fastmath={"contract"})
def _write_nodes(samples, node, ends):
    """Write the noise's share of P at the ends of the intervals that the new samples complete."""
    node[:] = 0.0
    for i in range(0, WIDTH, 4):
        a, b, c, d = ends[0, i], ends[0, i + 1], ends[0, i + 2], ends[0, i + 3]
        for k in range(CHUNK):
            node[k] += (a * samples[k + i] + b * samples[k + i + 1]) + (c * samples[k + i + 2] + d * samples[k + i + 3])


@kernel(fastmath={"contract", "reassoc"})
def _noise_slope(samples, k, slopes):
    """Return the derivative of the noise's share of P at the end of interval k of a chunk."""
    total = 0.0
    for i in range(WIDTH):
        total += slopes[i] * samples[k + i]
    return total


@kernel(inline="always")
def _begin_closed(stream, cycle, parameters, workspace):
    """Draw the start and the noise; the state is the growing and the decaying exponential and the folded angle."""
    samples = workspace.samples
    x, v = draw_start_and_noise(stream, parameters.start, parameters.band, samples.harmonics)
    side = side_of_start(x, v)
    ratios, frequency = samples.harmonics.ratios, 2.0 * math.pi / (parameters.grid.count * parameters.grid.spacing)
    _divide_by_stiffness(ratios, samples.harmonics.weights, frequency, parameters.compensation, parameters.ratio_scale)
    write_first_samples(samples, cycle, parameters)
    _write_nodes(samples.values, workspace.node, parameters.flight.ends)
    _build_particular(0, 0, parameters, workspace)
    grow, decay = exponential_parts(x, v, side, workspace.interval.particular, -workspace.interval.half)
    return (x, v), (grow, decay, abs(x))


@kernel(forceinline=True)
def _draw_closed(stream, number, j, cycle, parameters, workspace):  # noqa: ARG001  (all is drawn with the start)
    """Write the samples of the noise for CHUNK intervals, where the last ones are used up."""
    if write_next_samples(workspace.samples, number, cycle, parameters):
        _write_nodes(workspace.samples.values, workspace.node, parameters.flight.ends)


@kernel(inline="always")
def _is_eventless(u, end, side, j, parameters):
    """Whether a flight between two folded angles surely has no event in interval j."""
    s = 1 if side > 0 else 0
    return min(u, end) > parameters.least[j, s] and max(u, end) < parameters.most[j, s]


@kernel(forceinline=True)
def _try_closed(state, side, number, j, parameters, workspace):
    """Whether nothing happens in an interval, and the exponentials and the folded angle at its end if so."""
    factor, (grow, decay, u) = workspace.interval.factor * workspace.interval.factor, state
    grow, decay = grow * factor, decay * (1.0 / factor)
    end = folded_angle(side, parameters.flight.node[j, 0] + workspace.node[number % CHUNK], grow, decay)
    return side != 0 and _is_eventless(u, end, side, j, parameters), (grow, decay, end)


@kernel(inline="always")
def _build_particular(number, j, parameters, workspace):
    """Write P of forcing and noise in an interval."""
    particular, samples = workspace.interval.particular, workspace.samples.values
    interpolate(particular, parameters.forced[j], parameters.polynomials, samples, number % CHUNK)


@kernel(inline="always")
def _step_closed(state, end, side, number, j, share, cycle, parameters, workspace, impacts):  # noqa: ARG001
    """Carry a block through an interval."""
    middle = cycle * (parameters.grid.count * parameters.grid.spacing) + (number + 0.5) * parameters.grid.spacing
    node = parameters.flight.node[j, 0] + workspace.node[number % CHUNK]
    grow, decay, u, side, time = cross_interval(
        workspace.interval, node, state[0], state[1], state[2], end[2], side, parameters.block, impacts, middle
    )
    return (grow, decay, u), side, time


@kernel(inline="always")
def _step_within_closed(state, end, side, number, j, share, cycle, parameters, workspace, impacts):  # noqa: ARG001
    """Carry a block through a share of an interval, to angle and velocity, nan if it has overturned."""
    time, block = (share - 0.5) * parameters.grid.spacing, parameters.block
    return state_in_interval(workspace.interval, state[0], state[1], side, time, block, impacts), side, math.inf


@kernel(forceinline=True)
def _end_closed(state, side, number, j, parameters, workspace):
    """Angle and velocity at the end of an interval."""
    grow, decay, u = state
    if side == 0:
        return 0.0, 0.0
    slope = _noise_slope(workspace.samples.values, number % CHUNK, parameters.flight.ends[1])
    return side * u, parameters.flight.node[j, 1] + slope + grow - decay


# ------------------------------------------------------ an envelope, or an exact block; the state is angle and velocity


@kernel(inline="always")
def _begin(stream, cycle, parameters, workspace):
    """Draw the start and the noise, and make the first samples."""
    samples = workspace.samples
    x, v = draw_start_and_noise(stream, parameters.start, parameters.band, samples.harmonics)
    divide_by_window(samples.harmonics, parameters)
    write_first_samples(samples, cycle, parameters)
    return (x, v), (x, v)


@kernel(inline="always")
def _draw(stream, number, j, cycle, parameters, workspace):  # noqa: ARG001  (all is drawn with the start)
    """Write the samples of the noise for CHUNK intervals, where the last ones are used up."""
    write_next_samples(workspace.samples, number, cycle, parameters)


@kernel(fastmath={"contract"}, forceinline=True)
def _respond_to_force(x, v, side, j, k, parameters, workspace):
    """Angle and velocity of a slender block after interval j, number k of a chunk, if nothing happens in it."""
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


@kernel(fastmath={"contract"}, forceinline=True)
def _noise_at_points(values, g, k):
    """Noise at the points of an interval, less its envelope, from the samples from number k on."""
    one = load(values, 0) * g[k] + load(values, 1) * g[k + 1]
    two = load(values, 2) * g[k + 2] + load(values, 3) * g[k + 3]
    for i in range(4, WIDTH, 4):
        one = one + (load(values, i) * g[k + i] + load(values, i + 1) * g[k + i + 1])
        two = two + (load(values, i + 2) * g[k + i + 2] + load(values, i + 3) * g[k + i + 3])
    return one + two


@kernel(inline="always")
def _try_response(state, side, number, j, parameters, workspace):
    """Whether nothing happens to a slender block in an interval, and angle and velocity at its end if so."""
    x, v = state
    if side == 0:
        return parameters.stays[j], state
    if parameters.envelope.first[j + 1] > parameters.envelope.first[j] + 1:
        return False, state
    end = _respond_to_force(x, v, side, j, number % CHUNK, parameters, workspace)
    return _is_eventless(side * x, side * end[0], side, j, parameters), end


@kernel(inline="always")
def _try_collocation(state, side, number, j, parameters, workspace):
    """Whether nothing happens to an exact block in an interval, and angle and velocity at its end if so."""
    x, v = state
    if side == 0:
        return parameters.stays[j], state
    if parameters.envelope.first[j + 1] > parameters.envelope.first[j] + 1:
        return False, state
    tables, block = parameters.flight, parameters.block
    push = _noise_at_points(tables.values, workspace.samples.values, number % CHUNK)
    if tables.envelope.shape[0] > 0:
        push = load(tables.envelope, j) * push
    u, push = side * x, side * (load(tables.forcing, j) + push)
    end, speed, acceleration, converged = collocation.fly_by_tables(
        u, side * v, push, tables.steps, parameters.grid.spacing, block
    )
    store(workspace.acceleration, 0, acceleration)
    eventless = converged and _is_eventless(u, end, side, j, parameters)
    return eventless, (side * end if converged else math.nan, side * speed)


@kernel(fastmath={"contract"}, forceinline=True)
def _build_noise_slender(number, j, parameters, workspace):  # noqa: ARG001
    """Write the noise in an interval, less its envelope, as a polynomial in the time since its middle."""
    k, samples, polynomials = number % CHUNK, workspace.samples.values, parameters.polynomials
    for n in range(TERMS):
        value = 0.0
        for i in range(WIDTH):
            value += samples[k + i] * polynomials[i, n]
        workspace.noise[n] = value


@kernel(inline="always")
def _build_noise(number, j, parameters, workspace):  # noqa: ARG001
    """Write the noise in an interval, less its envelope, as a polynomial in the time since its middle."""
    interpolate(workspace.noise, parameters.zeros, parameters.polynomials, workspace.samples.values, number % CHUNK)


@kernel(forceinline=True)
def _write_product(strength, noise, base, out):
    """Write a polynomial (TERMS,) plus the product of envelope and noise."""
    for n in range(TERMS):
        force = base[n]
        for i in range(min(n + 1, strength.size)):
            force += strength[i] * noise[n - i]
        out[n] = force


@kernel(inline="always")
def _advance_slender(x, v, side, j, begin, end, strength, known, last, parameters, workspace, impacts, origin, block):  # noqa: ARG001
    """Carry a slender block through a piece of the envelope in interval j."""
    force, particular, half = workspace.interval.force, workspace.interval.particular, workspace.interval.half
    _write_product(strength, workspace.noise, parameters.zeros, force)
    particular_from_rest(force, particular)
    for n in range(TERMS):
        particular[n] += parameters.forced[j, n]
    segment = borrowed(segment_from_particular(particular, force, half))
    return advance_through_events(x, v, side, segment, begin, end, block, impacts, origin)


@kernel(inline="always")
def _advance_exact(x, v, side, j, begin, end, strength, known, last, parameters, workspace, impacts, origin, block):
    """Carry an exact block through a piece of the envelope in interval j; `last` is the state at its end if `known`."""
    force, half, acceleration = workspace.interval.force, workspace.interval.half, load(workspace.acceleration, 0)
    _write_product(strength, workspace.noise, parameters.forced[j], force)
    angle, speed = last
    return collocation.advance_from_flight(
        force, half, x, v, side, begin, end, block, impacts, origin, known, side * angle, side * speed, acceleration
    )


_advance = dispatch_on_block(_advance_slender, _advance_exact)


@kernel(forceinline=True)
def _step(state, end, side, number, j, share, cycle, parameters, workspace, impacts):
    """Carry a block through a share of an interval, piece by piece of the envelope."""
    (x, v), first = state, parameters.envelope.first
    spacing, time, known = parameters.grid.spacing, 0.0, False
    if share == 1.0:
        known = side != 0 and not math.isnan(end[0]) and first[j + 1] == first[j] + 1
    origin = cycle * (parameters.grid.count * spacing) + (number + 0.5) * spacing
    until, begin, block = (share - 0.5) * spacing, -0.5 * spacing, parameters.block
    for piece in range(first[j], first[j + 1]):
        strength, stop = parameters.envelope.strength[piece], min(parameters.envelope.ends[piece], until)
        if begin >= until:
            break
        x, v, side, time = _advance(
            x, v, side, j, begin, stop, strength, known, end, parameters, workspace, impacts, origin, block
        )
        if abs(x) >= parameters.block.cutoff:
            return (x, v), side, origin + time
        begin = stop
    return (x, v), side, math.inf


def _takes(enveloped, exact):
    """Return `Engine.takes` for scenes with or without an envelope (None: either), and an exact or slender block."""

    def takes(scene):
        """Whether the engine simulates a scene."""
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
