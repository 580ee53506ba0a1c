"""Filtered noise: its filter sampled exactly at grid times, and closed-form flights between located impacts.

Over an interval of the grid the filter and the flight of a block, which are one linear system, are drawn together from
their exact Gaussian law: the filter's states z at the interval's end, and the angle and velocity that the noise adds to
a flight over it. A flight without an event is therefore exact in law, however long the interval.

Where a bound of the acceleration cannot exclude an event, the noise within the interval is needed. It is taken as the
polynomial of least degree that has the drawn states at both ends and moves a flight by what was drawn: the conditional
mean of the noise given all that, but for terms of relative order (interval times the filter's rate). Then
`physics.motion.transition.advance` follows the block through impacts, chatter, rest, uplift and overturning.
What the polynomial leaves out acts at events alone, and that is the method's only error (docs/monte_carlo.md). Under
an envelope, linear in pieces that end at its kinks, the product of both is taken in flights too.

The noise is the same function of time for any samples, and for runs that begin at any cycle.
"""

import dataclasses
import math
from typing import NamedTuple

import numpy as np
from numba import prange

from fpk_rocking.base import checks
from fpk_rocking.base.jit import kernel
from fpk_rocking.physics import filters
from fpk_rocking.physics.motion import TERMS
from fpk_rocking.physics.motion.polynomial import move_origin
from fpk_rocking.physics.motion.slender import segment_of
from fpk_rocking.physics.motion.transition import Impacts, advance
from montecarlo.engines.grid import grid_of
from montecarlo.engines.random import normal, open_stream
from montecarlo.engines.start import draw_start, start_numbers

NOISES = ("filtered",)

COARSEST = {"low-pass": 100.0, "exponential": 50.0, "kanai-tajimi": 50.0}
"""The longest interval times the filter's rate and `steps_per_cycle`: at 200 steps half a correlation time for smooth
noise and a quarter for rough noise, whose excursions within an interval lift a block off or let it rest.
"""

_FEWEST, _LONGEST = 16, 0.2
"""Intervals in the forcing's shortest period at least, and the longest interval."""

_MOST = 2**20
"""Most intervals in a cycle."""

_NEAR = 1e-9
"""Part of an interval within which a kink of the envelope is at its end."""

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(20)


class Problem(NamedTuple):
    """What the kernel has to know: a scene in numbers, nondimensional, and tables; m intervals in a lap, n states.

    `start` (5,), `marks`: see `montecarlo.engines.start` and `grid`. `span`: an interval's duration; `hyperbolic` (2,):
    its cosh and sinh. `stationary` (n,): standard deviations of the states at τ = 0, of noise of variance 1,
    derivatives in units of the interval. `move` (n + 2, n), `spread` (n + 2, n + 2): mean and Cholesky factor of
    states, angle and velocity at an interval's end. `shape` (d + 1, 2n + 2): Bernstein coefficients of the polynomial
    from the states at both ends and the flight; `powers` (d + 1, d + 1): its coefficients in the time from them.
    Of the noise's envelope, all empty without one: `first` (m + 1,): number of the first piece in each interval.
    `begins`, `ends` (pieces,): times since the interval's begin. `strength` (pieces, 2): the envelope at a piece's
    begin and its slope. `strongest` (m,): its largest value in an interval. `response` (m, 2, d + 1): angle and
    velocity that the Bernstein polynomials, times the envelope, add to a flight.
    `forced` (m, TERMS): P of the forcing since the interval's begin; `low`, `high` (m,): bounds of the forcing; `drift`
    (m, 2): angle and velocity that it adds to a flight.
    """

    restitution: float
    cutoff: float
    start: np.ndarray
    span: float
    hyperbolic: np.ndarray
    marks: np.ndarray
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


class Room(NamedTuple):
    """Working memory of one realization.

    `drawn` (2n + 2,): the states at the begin and at the end of an interval, and the angle and velocity that the noise
    adds to a flight over it. `normals` (n + 2,); `bernstein` (d + 1,); `signal`, `particular`, `force` (TERMS,).
    """

    drawn: np.ndarray
    normals: np.ndarray
    bernstein: np.ndarray
    signal: np.ndarray
    particular: np.ndarray
    force: np.ndarray


def problem_of(scene, steps_per_cycle, times=None):
    """Return the `Problem` of a scene with filtered noise; a realization does not depend on `times`."""
    envelope = scene.noise.envelope
    longest = COARSEST[scene.noise.filter] / (filters.fastest(scene.noise) * steps_per_cycle)
    if longest * _MOST < scene.forcing.time_scale:
        most = int(steps_per_cycle * longest * _MOST / scene.forcing.time_scale)
        raise ValueError(checks.refusal("steps_per_cycle", steps_per_cycle, f"up to {most} with a filter of this rate"))
    longest = min(longest, scene.forcing.shortest_period / _FEWEST, _LONGEST)
    return on_grid(scene, grid_of(scene, longest if envelope is None else min(longest, envelope.spacing), times))


def on_grid(scene, grid):
    """Return the `Problem` of a scene for the intervals of a grid."""
    span = grid.spacing
    forced = scene.forcing.pieces(np.arange(grid.count) * span)
    low, high, drift = _forcing_tables(forced, span)
    return Problem(
        scene.block.restitution,
        scene.overturning.angle,
        start_numbers(scene.start),
        span,
        np.array([math.cosh(span), math.sinh(span)]),
        grid.marks,
        *_noise_tables(scene.noise, span),
        forced,
        *_envelope_tables(scene.noise.envelope, grid, 5 if scene.noise.filter == "low-pass" else 3),
        low,
        high,
        drift,
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
    response = np.einsum("pn,ncd->pcd", strength[first[:-1]], _response(degree, span, 0.0, span))
    for j in np.nonzero(np.diff(first) > 1)[0]:
        parts = range(first[j], first[j + 1])
        response[j] = sum(np.tensordot(strength[p], _response(degree, span, begins[p], ends[p]), 1) for p in parts)
    return first, begins, ends, strength, strongest, response


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
    weights = 0.5 * (end - begin) * _WEIGHTS * np.stack([np.sinh(span * (1.0 - t)), np.cosh(span * (1.0 - t))])
    return np.stack([weights @ _bernstein(degree, t).T, (weights * since) @ _bernstein(degree, t).T])


def _bernstein(degree, t):
    """Return Bernstein polynomials (degree + 1, n) at points (n,) of [0, 1]."""
    return np.array([math.comb(degree, k) * t**k * (1.0 - t) ** (degree - k) for k in range(degree + 1)])


def _forcing_tables(forced, span):
    """Return bounds of the forcing over the intervals, and what it adds to a flight: `low`, `high`, `drift`."""
    low, high = np.empty((2, len(forced)))
    powers, order = span ** np.arange(TERMS), np.arange(TERMS)
    for j, row in enumerate(forced):
        segment = segment_of(row, np.empty(TERMS), span)
        low[j], high[j] = segment.force_low, segment.force_high
    p0, q0, p1, q1 = forced[:, 0], forced[:, 1], forced @ powers, forced[:, 1:] @ (order[1:] * powers[:-1])
    cosh, sinh = math.cosh(span), math.sinh(span)
    return low, high, np.stack([p1 - cosh * p0 - sinh * q0, q1 - sinh * p0 - cosh * q0], axis=-1)


def _noise_tables(noise, span):
    """Return `stationary`, `move`, `spread`, `shape` and `powers` of a `Problem`.

    Time counts in intervals here, and derivatives and the flight accordingly: every entry is then about 1 or less,
    and none lost in the rounding of another.
    """
    space = filters.state_space(dataclasses.replace(noise, variance=1.0))
    n = space.drift.shape[0]
    units = span ** np.arange(n)
    output = space.output / units
    drift = np.zeros((n + 2, n + 2))
    drift[:n, :n] = span * units[:, None] * space.drift / units
    drift[n, n + 1], drift[n + 1, n], drift[n + 1, :n] = 1.0, span * span, output
    source = np.append(math.sqrt(span) * units * space.input, [0.0, 0.0])
    phi, covariance = filters.transition(drift, source, 1.0)
    scale = np.sqrt(np.diag(covariance))
    spread = scale[:, None] * np.linalg.cholesky(covariance / np.outer(scale, scale))
    # Angle and velocity of the flight in their own units, and as strong as the noise.
    sigma = math.sqrt(noise.variance)
    sizes = np.append(np.ones(n), [sigma * span * span, sigma * span])[:, None]
    shape, powers = _interpolant(noise, output, span, sigma)
    return units * space.spread, sizes * phi[:, :n], sizes * spread, shape, powers


def _interpolant(noise, output, span, sigma):
    """Return `shape` and `powers`: the polynomial of the noise over an interval.

    The low-pass filter's noise has a derivative, which the polynomial meets at both ends too.
    """
    n, smooth = output.size, noise.filter == "low-pass"
    degree = 5 if smooth else 3
    shape = np.zeros((degree + 1, 2 * n + 2))
    shape[0, :n] = shape[degree, n : 2 * n] = sigma * output
    if smooth:
        shape[1, 0] = shape[degree - 1, n] = sigma
        shape[1, 1], shape[degree - 1, n + 1] = sigma / degree, -sigma / degree
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
def make_room(problem):
    """Make the `Room` of one realization."""
    n, terms = problem.stationary.size, problem.powers.shape[0]
    return Room(
        np.zeros(2 * n + 2), np.empty(n + 2), np.empty(terms), np.empty(TERMS), np.empty(TERMS), np.empty(TERMS)
    )


@kernel(borrows=True)
def begin_noise(stream, problem, room):
    """Draw the filter's states at τ = 0."""
    n = problem.stationary.size
    for i in range(n):
        room.drawn[n + i] = problem.stationary[i] * normal(stream)


@kernel(fastmath={"contract"}, borrows=True)
def draw_noise(stream, problem, room):
    """Draw the noise of the next interval."""
    drawn, normals, n = room.drawn, room.normals, problem.stationary.size
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


@kernel(fastmath={"contract"}, borrows=True)
def _open(j, problem, room):
    """Write P of forcing and noise in interval j, from the polynomial of the noise.

    The noise's share begins with zero angle and velocity. The one that is a polynomial no higher than the noise's, with
    the terms -(η + η'' + ...), would be as large as the fourth derivative, and its rounding far above the angle's.
    """
    particular, share, bernstein = room.particular, room.force, room.bernstein
    share[0], share[1] = 0.0, 0.0
    for k in range(TERMS - 2):
        value = 0.0
        if k < bernstein.size:
            for i in range(k + 1):
                value += problem.powers[k, i] * bernstein[i]
        share[k + 2] = (share[k] + value) / ((k + 1) * (k + 2))
    for k in range(TERMS):
        particular[k] = problem.forced[j, k] + share[k]


@kernel(fastmath={"contract"}, borrows=True)
def _open_piece(j, piece, problem, room):
    """Write P of forcing and noise in a piece of the envelope in interval j, in the time since the piece's begin."""
    particular, signal, share, bernstein = room.particular, room.signal, room.force, room.bernstein
    signal[:] = 0.0
    for k in range(bernstein.size):
        for i in range(k + 1):
            signal[k] += problem.powers[k, i] * bernstein[i]
    begin, value, slope = problem.begins[piece], problem.strength[piece, 0], problem.strength[piece, 1]
    move_origin(problem.forced[j], begin, particular)
    move_origin(signal, begin, share)
    for k in range(TERMS):
        signal[k] = value * share[k] + (slope * share[k - 1] if k > 0 else 0.0)
    share[0], share[1] = 0.0, 0.0
    for k in range(TERMS - 2):
        share[k + 2] = (share[k] + signal[k]) / ((k + 1) * (k + 2))
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
        segment = segment_of(room.particular, room.force, end - begin)
        x, v, side, time = advance(
            x, v, side, segment, 0.0, end - begin, problem.restitution, problem.cutoff, impacts, origin + begin
        )
        time += begin
        if abs(x) >= problem.cutoff:
            break
    return x, v, side, time


@kernel(forceinline=True, borrows=True)  # see events.next_event
def interval(x, v, side, j, problem, room, impacts, origin):
    """Take the block through interval j of a cycle, whose noise is drawn; return as `advance`."""
    low, high = bound_noise(j, problem, room)
    low, high = low + problem.low[j], high + problem.high[j]
    span, cutoff = problem.span, problem.cutoff
    if side == 0:
        if max(high, -low) < 1.0:
            return x, v, side, span
    else:
        keep, swap = problem.hyperbolic
        push, kick = _added(j, problem, room)
        x_next = keep * (x - side) + swap * v + side + problem.drift[j, 0] + push
        # Between its ends the angle lies within |u''| span^2 / 8 of its chord; u'' = u - 1 + s f.
        rise, fall = (high, low) if side > 0 else (-low, -high)
        below = 0.125 * span * span * max(cutoff - 1.0 + rise, 0.0)
        above = 0.125 * span * span * max(1.0 - fall, 0.0)
        u, end = side * x, side * x_next
        if min(u, end) > below and max(u, end) + above < cutoff:
            v_next = swap * (x - side) + keep * v + problem.drift[j, 1] + kick
            return x_next, v_next, side, span
    if problem.strength.size > 0:
        return _through_pieces(x, v, side, j, span, problem, room, impacts, origin)
    _open(j, problem, room)
    segment = segment_of(room.particular, room.force, span)
    return advance(x, v, side, segment, 0.0, span, problem.restitution, cutoff, impacts, origin)


@kernel(borrows=True)
def _look(x, v, side, j, time, problem, room):
    """State at a time in interval j, nan if overturned."""
    bound_noise(j, problem, room)
    if problem.strength.size > 0:
        x, v, _, _ = _through_pieces(x, v, side, j, time, problem, room, None, 0.0)
    else:
        _open(j, problem, room)
        segment = segment_of(room.particular, room.force, problem.span)
        x, v, _, _ = advance(x, v, side, segment, 0.0, time, problem.restitution, problem.cutoff)
    if abs(x) >= problem.cutoff:
        return math.nan, math.nan
    return x, v


@kernel
def side_of(x, v):
    """Side at the start: that of the angle, else of the velocity, else 0 for rest, which may end at once."""
    if x == 0.0:
        return 0 if v == 0.0 else (1 if v > 0.0 else -1)
    return 1 if x > 0.0 else -1


@kernel
def _realize(stream, cycle, problem, angle, velocity, impacts):
    """Simulate one realization: fill its rows of states, return time (nan: never) and side of overturning."""
    intervals, marks, span, room = problem.low.size, problem.marks, problem.span, make_room(problem)
    rows = marks.size
    x, v = draw_start(stream, problem.start)
    side = side_of(x, v)
    if abs(x) >= problem.cutoff:
        return cycle * intervals * span, side
    angle[0], velocity[0] = x, v
    begin_noise(stream, problem, room)
    for _ in range(cycle * intervals):
        draw_noise(stream, problem, room)
    row, j, mark = 1, 0, marks[0]
    for number in range((angle.size - 1) // rows * intervals):
        draw_noise(stream, problem, room)
        while mark < number + 1:
            angle[row], velocity[row] = _look(x, v, side, j, (mark - number) * span, problem, room)
            row += 1
            mark = marks[(row - 1) % rows] + (row - 1) // rows * intervals
        origin = (cycle * intervals + number) * span
        x, v, side, time = interval(x, v, side, j, problem, room, impacts, origin)
        if abs(x) >= problem.cutoff:
            return origin + time, side
        if mark == number + 1:
            angle[row], velocity[row] = x, v
            row += 1
            mark = marks[(row - 1) % rows] + (row - 1) // rows * intervals
        if row == angle.size:
            break
        j = j + 1 if j + 1 < intervals else 0
    return math.nan, 0


@kernel(parallel=True)
def realize(keys, first, cycle, problem, angle, velocity, overturn_time, overturn_side, impacts):
    """Simulate realizations `first`, `first` + 1, ... in parallel; see `montecarlo.engines.Engine`."""
    for r in prange(angle.shape[0]):
        stream = open_stream(keys, first + r)
        hits = Impacts(impacts.count[r : r + 1], impacts.time[r], impacts.velocity[r])
        overturn_time[r], overturn_side[r] = _realize(stream, cycle, problem, angle[r], velocity[r], hits)
