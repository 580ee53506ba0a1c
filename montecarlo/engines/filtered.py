"""Filtered noise: its filter sampled exactly at grid times, and closed-form flights between located impacts.

Over an interval of the grid the filter and the flight of a block, which are one linear system, are drawn together from
their exact Gaussian law: the filter's states z at the interval's end, and the angle and velocity that the noise adds to
a flight over it. A flight without an event is therefore exact in law, however long the interval.

Where a bound of the acceleration cannot exclude an event, the noise within the interval is needed. It is taken as the
polynomial of least degree that has the drawn states at both ends and moves a flight by what was drawn: the conditional
mean of the noise given all that, but for terms of relative order (interval times the filter's rate). Then
`physics.motion.events.advance_through_events` follows the block through impacts, chatter, rest, uplift and overturning.
What the polynomial leaves out acts at events alone, and that is the method's only error (docs/monte_carlo.md). Under
an envelope, linear in pieces that end at its kinks, the product of both is taken in flights too.

For an exact block the polynomial is the force in every flight (`physics.motion.collocation`). It moves a slender block
as was drawn, so that what it leaves out acts in a flight through the curvature of the equation of motion alone.

The noise is the same function of time for any samples, and for runs that begin at any cycle.
"""

import math
import sys
from typing import NamedTuple

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.jit import kernel
from fpk_rocking.base.lanes import load
from fpk_rocking.physics.motion import TERMS
from fpk_rocking.physics.motion.collocation import (
    NODES,
    PLACES,
    FlightTables,
    advance_collocated,
    flight_tables,
    fly_by_tables,
)
from fpk_rocking.physics.motion.equation import block_of, block_of_scene, dispatch_on_block
from fpk_rocking.physics.motion.events import advance_through_events, can_lift_off, surely_eventless
from fpk_rocking.physics.motion.flight import homogeneous_flight
from fpk_rocking.physics.motion.particular import (
    cosh_sinh,
    force_series,
    forced_response,
    impulse_response,
    particular_at,
)
from fpk_rocking.physics.motion.segment import force_bounds, move_origin, particular_from_rest, segment_from_particular
from fpk_rocking.physics.noise.state_space import transition_and_factor
from montecarlo.engines import start
from montecarlo.engines.grid import grid_of
from montecarlo.engines.march import carriers, marcher, realizer, the_state
from montecarlo.engines.random import normal
from montecarlo.engines.start import start_numbers

BLOCK = 1
"""Realizations that follow each other in a thread's working memory."""

METHOD = "filtered"
RENEWS = False

COARSEST = {True: 100.0, False: 50.0}
"""The longest interval times the filter's rate and `steps_per_cycle`, by whether noise has a derivative: at 200 steps
half a correlation time for smooth noise and a quarter for rough noise, whose excursions within an interval lift a block
off or let it rest.
"""

_DEGREE = {True: 5, False: 3}
"""Degree of the polynomial of the noise over an interval: it has what is drawn of a flight, and the noise at both ends,
and its derivative there where it has one."""

_FEWEST, _LONGEST = 16, 0.2
"""Intervals in the forcing's shortest period at least, and the longest interval."""

_MOST = 2**20
"""Most intervals in a cycle."""

_NEAR = 1e-9
"""Part of an interval within which a kink of the envelope is at its end."""

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(20)


def takes(scene):
    """Whether this engine simulates a scene."""
    return scene.noise.kind == "filtered"


class Problem(NamedTuple):
    """What the kernel has to know: a scene in numbers, nondimensional, and tables; m intervals in a lap, n states.

    `start` (5,); `count`, `spacing`, `marks`: see `montecarlo.engines.start` and `grid`. `hyperbolic` (2,): cosh and
    sinh of an interval's duration.
    `stationary` (n, n): Cholesky factor of the states at τ = 0, of noise of variance 1. `move` (n + 2, n), `spread`
    (n + 2, n + 2): mean and Cholesky factor of states, angle and velocity at an interval's end. `shape`
    (d + 1, 2n + 2): Bernstein coefficients of the polynomial from the states at both ends and the flight; `powers`
    (d + 1, d + 1): its coefficients in the time from them.
    Of the noise's envelope, all empty without one: `first` (m + 1,): number of the first piece in each interval.
    `begins`, `ends` (pieces,): times since the interval's begin. `strength` (pieces, 2): the envelope at a piece's
    begin and its slope. `strongest` (m,): its largest value in an interval. `response` (m, 2, d + 1): angle and
    velocity that the Bernstein polynomials, times the envelope, add to a flight.
    `forced` (m, TERMS): P of the forcing since the interval's begin, or the forcing itself for an exact block; `low`,
    `high` (m,): bounds of the forcing; `drift` (m, 2): angle and velocity that it adds to a flight.
    At the points of `physics.motion.collocation`: `pushes` (m, NODES): the forcing, `basis` (d + 1, NODES): Bernstein
    polynomials, `factors` (m, NODES): the envelope; `points` to `sinh`: see `Cruise`.
    """

    restitution: float
    cutoff: float
    critical_angle: float | None
    start: np.ndarray
    count: int
    spacing: float
    marks: np.ndarray
    hyperbolic: np.ndarray
    stationary: np.ndarray
    move: np.ndarray
    spread: np.ndarray
    shape: np.ndarray
    powers: np.ndarray
    forced: np.ndarray
    first: np.ndarray
    begins: np.ndarray
    ends: np.ndarray
    strength: np.ndarray
    strongest: np.ndarray
    response: np.ndarray
    low: np.ndarray
    high: np.ndarray
    drift: np.ndarray
    pushes: np.ndarray
    basis: np.ndarray
    factors: np.ndarray
    points: np.ndarray
    inner: np.ndarray
    cosh: float
    sinh: float


class Room(NamedTuple):
    """Working memory of one realization.

    `drawn` (2n + 2,): the states at the begin and at the end of an interval, and the angle and velocity that the noise
    adds to a flight over it. `normals` (n + 2,); `bernstein` (d + 1,); the others (TERMS,).
    """

    drawn: np.ndarray
    normals: np.ndarray
    bernstein: np.ndarray
    signal: np.ndarray
    share: np.ndarray
    particular: np.ndarray
    force: np.ndarray


def problem_of(scene, steps_per_cycle, times=None):
    """Return the `Problem` of a scene with filtered noise; a realization does not depend on `times`."""
    envelope = scene.noise.envelope
    space = scene.noise.space
    longest = COARSEST[space.smooth] / (space.fastest * steps_per_cycle)
    if longest * _MOST < scene.forcing.time_scale:
        most = int(steps_per_cycle * longest * _MOST / scene.forcing.time_scale)
        raise ValueError(checks.refusal("steps_per_cycle", steps_per_cycle, f"up to {most} with a filter of this rate"))
    longest = min(longest, scene.forcing.shortest_period / _FEWEST, _LONGEST)
    return on_grid(scene, grid_of(scene, longest if envelope is None else min(longest, envelope.spacing), times))


def on_grid(scene, grid):
    """Return the `Problem` of a scene for the intervals of a grid."""
    span, envelope, degree = grid.spacing, scene.noise.envelope, _DEGREE[scene.noise.space.smooth]
    begins = np.arange(grid.count) * span
    forced = scene.forcing.pieces(begins)
    low, high, drift = _forcing_tables(forced, span)
    force = force_series(forced)
    return Problem(
        *block_of_scene(scene),
        start_numbers(scene.start),
        *grid,
        cosh_sinh(span),
        *_noise_tables(scene.noise, span),
        force if scene.block.critical_angle else forced,
        *_envelope_tables(envelope, grid, degree),
        low,
        high,
        drift,
        force @ (span * PLACES) ** np.arange(TERMS)[:, None],
        _bernstein(degree, PLACES),
        np.empty((0, NODES)) if envelope is None else envelope.value(begins[:, None] + span * PLACES),
        *flight_tables(span),
    )


def _envelope_tables(envelope, grid, degree):
    """Return `first`, `begins`, `ends`, `strength`, `strongest` and `response` of a `Problem`."""
    if envelope is None:
        return np.zeros(0, int), np.empty(0), np.empty(0), np.empty((0, 2)), np.empty(0), np.empty((0, 2, degree + 1))
    span = grid.spacing
    first, owner, begins, ends = _pieces(np.sort(envelope.kinks) / span, grid.count)
    strength = _strengths(envelope, owner + begins, owner + ends, span)
    begins, ends = span * begins, span * ends
    strongest = np.zeros(grid.count)
    np.maximum.at(strongest, owner, np.maximum(strength[:, 0], strength[:, 0] + strength[:, 1] * (ends - begins)))
    impulse_response = np.einsum("pn,ncd->pcd", strength[first[:-1]], _response(degree, span, 0.0, span))
    for j in np.nonzero(np.diff(first) > 1)[0]:
        parts = range(first[j], first[j + 1])
        impulse_response[j] = sum(
            np.tensordot(strength[p], _response(degree, span, begins[p], ends[p]), 1) for p in parts
        )
    return first, begins, ends, strength, strongest, impulse_response


def _pieces(kinks, count):
    """Cut intervals at the kinks inside, all in intervals.

    Return numbers of the first piece of each interval (count + 1,) and, for each piece, the number of its interval, and
    its begin and end since that interval's begin.
    """
    inside = kinks[(np.abs(kinks - np.rint(kinks)) > _NEAR) & (kinks > 0.0) & (kinks < count)]
    edges = np.sort(np.concatenate([np.arange(count), inside]))
    owner = np.floor(edges).astype(int)
    begins = edges - owner
    ends = np.append(begins[1:], 0.0)
    return np.searchsorted(owner, np.arange(count + 1)), owner, begins, np.where(ends == 0.0, 1.0, ends)


def _strengths(envelope, begins, ends, span):
    """Return the envelope at the begins of pieces and its slopes there (pieces, 2); times are in intervals."""
    if len(envelope.kinks) == 0:
        values = envelope.value(span * begins)
        return np.stack([values, (envelope.value(span * ends) - values) / (span * (ends - begins))], axis=-1)
    strength = envelope.series(0.5 * span * (begins + ends), 2)
    strength[:, 0] -= 0.5 * span * (ends - begins) * strength[:, 1]
    return strength


def _response(degree, span, begin, end):
    """Return angle and velocity (2, 2, degree + 1) that forces from a begin to an end add to a flight over an interval.

    The forces are the Bernstein polynomials of the interval, and these times the time since the begin.
    """
    since = 0.5 * (end - begin) * (1.0 + _NODES)
    t = (begin + since) / span
    weights = 0.5 * (end - begin) * _WEIGHTS * impulse_response(span * (1.0 - t))
    return np.stack([weights @ _bernstein(degree, t).T, (weights * since) @ _bernstein(degree, t).T])


def _bernstein(degree, t):
    """Return Bernstein polynomials (degree + 1, n) at points (n,) of [0, 1]."""
    return np.array([math.comb(degree, k) * t**k * (1.0 - t) ** (degree - k) for k in range(degree + 1)])


def _forcing_tables(forced, span):
    """Return bounds of the forcing over the intervals, and what it adds to a flight: `low`, `high`, `drift`."""
    low, high = np.empty((2, len(forced)))
    force_bounds(forced, span, low, high)
    return low, high, np.stack(forced_response(forced[:, 0], forced[:, 1], *particular_at(forced, span), span), axis=-1)


def _noise_tables(noise, span):
    """Return `stationary`, `move`, `spread`, `shape` and `powers` of a `Problem`.

    Time counts in intervals here, and the flight accordingly: every entry is then about 1 or less, and none lost in
    the rounding of another.
    """
    space = noise.space
    n = space.order
    drift = np.zeros((n + 2, n + 2))
    drift[:n, :n] = span * space.drift
    drift[n, n + 1], drift[n + 1, n], drift[n + 1, :n] = 1.0, span * span, space.output
    source = np.append(math.sqrt(span) * space.input, [0.0, 0.0])
    phi, spread = transition_and_factor(drift, source, 1.0)
    # Angle and velocity of the flight in their own units, and as strong as the noise.
    sigma = math.sqrt(noise.variance)
    sizes = np.append(np.ones(n), [sigma * span * span, sigma * span])[:, None]
    shape, powers = _interpolant(space, span, sigma)
    return np.linalg.cholesky(space.correlation), sizes * phi[:, :n], sizes * spread, shape, powers


def _interpolant(space, span, sigma):
    """Return `shape` and `powers`: the polynomial of the noise over an interval.

    It meets the derivative at both ends too, where the noise has one.
    """
    n, degree = space.order, _DEGREE[space.smooth]
    shape = np.zeros((degree + 1, 2 * n + 2))
    shape[0, :n] = shape[degree, n : 2 * n] = sigma * space.output
    if space.smooth:
        slope = span * sigma * (space.output @ space.drift) / degree
        shape[1, :n], shape[degree - 1, n : 2 * n] = sigma * space.output + slope, sigma * space.output - slope
    middle = degree // 2
    # What a polynomial adds to a flight, by its Bernstein coefficients.
    moments = _response(degree, span, 0.0, span)[0]
    known = -moments @ shape
    known[:, 2 * n :] = np.eye(2)
    shape[middle : middle + 2] = np.linalg.solve(moments[:, middle : middle + 2], known)
    return shape, _powers(degree, span)


def _powers(degree, span):
    """Return coefficients (degree + 1, degree + 1) in the time of the Bernstein polynomials over an interval."""
    rows = np.zeros((degree + 1, degree + 1))
    for k in range(degree + 1):
        for i in range(degree - k + 1):
            rows[k + i, k] = math.comb(degree, k) * math.comb(degree - k, i) * (-1) ** i
    return rows / span ** np.arange(degree + 1)[:, None]


@kernel
def room_of(problem):
    """Return the `Room` of one realization."""
    n, terms = problem.stationary.shape[0], problem.powers.shape[0]
    rows = np.empty((4, TERMS))
    return Room(np.zeros(2 * n + 2), np.empty(n + 2), np.empty(terms), rows[0], rows[1], rows[2], rows[3])


@kernel(borrows=True)
def begin_noise(stream, problem, room):
    """Draw the filter's states at τ = 0."""
    drawn, normals, n = room.drawn, room.normals, problem.stationary.shape[0]
    for i in range(n):
        normals[i] = normal(stream)
        drawn[n + i] = 0.0
        for k in range(i + 1):
            drawn[n + i] += problem.stationary[i, k] * normals[k]


@kernel(borrows=True)
def begin(stream, x, v, side, cycle, problem, room):  # noqa: ARG001
    """Draw the noise up to the begin of the run."""
    begin_noise(stream, problem, room)
    for _ in range(cycle * problem.count):
        draw_noise(stream, problem, room)
    return x, v


@kernel(borrows=True)
def know(stream, number, j, cycle, problem, room):  # noqa: ARG001
    """Draw the noise of the next interval."""
    draw_noise(stream, problem, room)


@kernel(fastmath={"contract"}, borrows=True)
def draw_noise(stream, problem, room):
    """Draw the noise of the next interval."""
    drawn, normals, n = room.drawn, room.normals, problem.stationary.shape[0]
    for i in range(n):
        drawn[i] = drawn[n + i]
    for i in range(n + 2):
        normals[i] = normal(stream)
    for i in range(n + 2):
        total = 0.0
        for k in range(n):
            total += problem.move[i, k] * drawn[k]
        for k in range(i + 1):
            total += problem.spread[i, k] * normals[k]
        drawn[n + i] = total


@kernel(fastmath={"contract"}, borrows=True)
def bound_noise(j, problem, room):
    """Write the polynomial of the noise in interval j, less its envelope; return bounds of it, with its envelope.

    The polynomial lies between its Bernstein coefficients.
    """
    low, high = math.inf, -math.inf
    for i in range(room.bernstein.size):
        value = 0.0
        for k in range(room.drawn.size):
            value += problem.shape[i, k] * room.drawn[k]
        room.bernstein[i] = value
        low, high = min(low, value), max(high, value)
    if problem.strongest.size > 0:
        most = problem.strongest[j]
        return min(most * low, 0.0), max(most * high, 0.0)
    return low, high


@kernel(borrows=True)
def _added(j, problem, room):
    """Angle and velocity that the noise adds to a flight over interval j."""
    n = room.drawn.size - 2
    if problem.response.size == 0:
        return room.drawn[n], room.drawn[n + 1]
    x, v = 0.0, 0.0
    for i in range(room.bernstein.size):
        x += problem.response[j, 0, i] * room.bernstein[i]
        v += problem.response[j, 1, i] * room.bernstein[i]
    return x, v


@kernel(forceinline=True, borrows=True)
def _fly_slender(x, v, side, j, problem, room, block):  # noqa: ARG001
    """Angle and velocity after interval j if nothing happens in it, and whether that is known."""
    push, kick = _added(j, problem, room)
    end, speed = homogeneous_flight(x - side, v, problem.hyperbolic[0], problem.hyperbolic[1])
    return end + side + problem.drift[j, 0] + push, speed + problem.drift[j, 1] + kick, True


@kernel(fastmath={"contract"}, forceinline=True, borrows=True)
def _fly_exact(x, v, side, j, problem, room, block):
    """Angle and velocity after interval j if nothing happens in it, and whether that is known."""
    if problem.first.size > 0 and problem.first[j + 1] > problem.first[j] + 1:
        return x, v, False
    noise = room.bernstein[0] * load(problem.basis, 0)
    for i in range(1, room.bernstein.size):
        noise = noise + room.bernstein[i] * load(problem.basis, i)
    if problem.factors.shape[0] > 0:
        noise = load(problem.factors, j) * noise
    push, tables = (
        load(problem.pushes, j) + noise,
        FlightTables(problem.points, problem.inner, problem.cosh, problem.sinh),
    )
    end, speed, _, found = fly_by_tables(side * x, side * v, side * push, tables, problem.spacing, block)
    return side * end, side * speed, found


_fly = dispatch_on_block(_fly_slender, _fly_exact)


@kernel(forceinline=True, borrows=True)  # see events.next_event
def coast(state, side, number, j, problem, room):  # noqa: ARG001
    """Whether nothing happens in an interval, and angle and velocity at its end if so."""
    low, high = bound_noise(j, problem, room)
    low, high, (x, v) = low + problem.low[j], high + problem.high[j], state
    if side == 0:
        return not can_lift_off(low, high, block_of(problem)), state
    end, speed, known = _fly(x, v, side, j, problem, room, block_of(problem))
    return known and surely_eventless(side * x, side * end, side, low, high, problem.spacing, block_of(problem)), (
        end,
        speed,
    )


@kernel(fastmath={"contract"}, borrows=True)
def _write_signal(problem, room):
    """Write the noise in an interval, less its envelope, as a polynomial in the time since its begin."""
    signal, bernstein = room.signal, room.bernstein
    signal[:] = 0.0
    for k in range(bernstein.size):
        for i in range(k + 1):
            signal[k] += problem.powers[k, i] * bernstein[i]


@kernel(fastmath={"contract"}, borrows=True)
def resolve(number, j, problem, room):  # noqa: ARG001
    """Write P of forcing and noise in an interval, the force for an exact block; under an envelope, the noise alone.

    The noise's share begins with zero angle and velocity. The one that is a polynomial no higher than the noise's, with
    the terms -(η + η'' + ...), would be as large as the fourth derivative, and its rounding far above the angle's.
    """
    _write_signal(problem, room)
    if problem.strength.size == 0:
        _answer(room.signal, room.particular, block_of(problem))
        for k in range(TERMS):
            room.particular[k] += problem.forced[j, k]


@kernel(forceinline=True, borrows=True)
def _respond_slender(force, particular, block):  # noqa: ARG001
    """Write P of the force."""
    particular_from_rest(force, particular)


@kernel(forceinline=True, borrows=True)
def _respond_exact(force, particular, block):  # noqa: ARG001
    """Write the force itself."""
    for k in range(TERMS):
        particular[k] = force[k]


_answer = dispatch_on_block(_respond_slender, _respond_exact)


@kernel(forceinline=True, borrows=True)
def _advance_slender(x, v, side, start, end, span, room, impacts, origin, block):
    """Carry a block under the force that `room` knows."""
    segment = segment_from_particular(room.particular, room.force, span)
    return advance_through_events(x, v, side, segment, start, end, block, impacts, origin)


@kernel(forceinline=True, borrows=True)
def _advance_exact(x, v, side, start, end, span, room, impacts, origin, block):
    """Carry a block under the force that `room` knows."""
    return advance_collocated(room.particular, span, x, v, side, start, end, block, impacts, origin)


_advance = dispatch_on_block(_advance_slender, _advance_exact)


@kernel(fastmath={"contract"}, borrows=True)
def _open_piece(j, piece, problem, room):
    """Write P of forcing and noise in a piece of the envelope, or the force, in the time since the piece's begin."""
    particular, force, share = room.particular, room.force, room.share
    begin, value, slope = problem.begins[piece], problem.strength[piece, 0], problem.strength[piece, 1]
    move_origin(room.signal, begin, share)
    for k in range(TERMS):
        force[k] = value * share[k] + (slope * share[k - 1] if k > 0 else 0.0)
    _answer(force, share, block_of(problem))
    move_origin(problem.forced[j], begin, particular)
    for k in range(TERMS):
        particular[k] += share[k]


@kernel(borrows=True)
def _through_pieces(x, v, side, j, until, problem, room, impacts, origin):
    """Carry a block under an envelope from the begin of interval j to a time since then; return as `advance`."""
    time = 0.0
    for piece in range(problem.first[j], problem.first[j + 1]):
        begin, end = problem.begins[piece], min(problem.ends[piece], until)
        if begin >= until:
            break
        _open_piece(j, piece, problem, room)
        last, block = end - begin, block_of(problem)
        x, v, side, time = _advance(x, v, side, 0.0, last, last, room, impacts, origin + begin, block)
        time += begin
        if abs(x) >= problem.cutoff:
            break
    return x, v, side, time


@kernel(forceinline=True, borrows=True)  # see events.next_event
def carry(x, v, side, number, j, share, cycle, problem, room, impacts):
    """Carry a block through a share of a resolved interval; return x, v, side and the time reached."""
    origin, until = (cycle * problem.count + number) * problem.spacing, share * problem.spacing
    if problem.strength.size > 0:
        x, v, side, time = _through_pieces(x, v, side, j, until, problem, room, impacts, origin)
    else:
        span, block = problem.spacing, block_of(problem)
        x, v, side, time = _advance(x, v, side, 0.0, until, span, room, impacts, origin, block)
    return x, v, side, origin + time


draw = start.draw
look, cross = carriers(sys.modules[__name__])
seen = the_state
march = marcher(sys.modules[__name__])
realize = realizer(sys.modules[__name__])
