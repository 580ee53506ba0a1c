"""Event-driven realizations under band noise with an envelope: the engine `exact` for η(τ) g(τ).

The noise η is band-limited and a polynomial between the points of a coarse grid (`fpk_rocking.physics.bandlimited`); so
is g, in pieces of its own where a kink of it falls into an interval. Their product is the force, in closed form as in
`exact`. As g has kinks the product is not band-limited, and P is started anew in every interval.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import prange

from fpk_rocking.base.jit import kernel
from fpk_rocking.physics import noise
from fpk_rocking.physics.bandlimited import OVERSAMPLING, WIDTH, compensate, compensation, pieces
from fpk_rocking.physics.motion import TERMS
from fpk_rocking.physics.motion.slender import segment_of
from fpk_rocking.physics.motion.transition import Impacts, advance
from montecarlo.engines.exact import CHUNK, FEWEST, HALF, LONGEST, force_bounds
from montecarlo.engines.filtered import side_of
from montecarlo.engines.grid import grid_of
from montecarlo.engines.random import open_stream
from montecarlo.engines.shinozuka import band_numbers, draw
from montecarlo.engines.start import start_numbers

NOISES = ("band",)

_LEAD = WIDTH // 2 + HALF
_BLOCK = 64

_ORDER = 8
"""Coefficients of g in a piece; of a linear one 2 are used."""

_NEAR = 1e-9


class Problem(NamedTuple):
    """What the kernel has to know: a scene in numbers, nondimensional, and tables over the m intervals of the time.

    As `montecarlo.engines.exact`, and: `piece` (m + 1,): number of the first piece of g in each interval. `ends`
    (pieces,): their ends, times since the interval's middle. `strength` (pieces, order): g in the time since the
    interval's middle. `response` (order, 2, WIDTH): angle and velocity that the polynomials of the interpolant, times
    powers of the time, add to a flight over an interval. `drift` (m, 2): those that the forcing adds.
    """

    restitution: float
    cutoff: float
    lap: float
    start: np.ndarray
    band_low: float
    band_width: float
    weight: float
    harmonics: int
    marks: np.ndarray
    spacing: float
    shapes: np.ndarray
    compensation: np.ndarray
    ratio_scale: float
    forced: np.ndarray
    piece: np.ndarray
    ends: np.ndarray
    strength: np.ndarray
    response: np.ndarray
    drift: np.ndarray
    low: np.ndarray
    high: np.ndarray


def problem_of(scene, steps_per_cycle, times):  # noqa: ARG001  (this engine takes no steps)
    """Return the `Problem` of a scene with band noise that has an envelope."""
    forcing, envelope = scene.forcing, scene.noise.envelope
    longest = min(LONGEST, forcing.shortest_period / FEWEST, math.pi / (OVERSAMPLING * scene.noise.band[1]))
    grid = grid_of(scene, longest, times)
    half = 0.5 * grid.spacing
    middles = (np.arange(grid.count) + 0.5) * grid.spacing
    forced, shapes = forcing.pieces(middles), pieces(grid.spacing)
    low, width, weight, harmonics = band_numbers(scene, grid.duration)
    least, most = np.empty((2, grid.count))
    force_bounds(forced, half, least, most)
    largest = weight * harmonics * _largest(envelope, grid)
    order = 2 if math.isinf(envelope.spacing) else _ORDER
    return Problem(
        scene.block.restitution,
        scene.overturning.angle,
        grid.duration,
        start_numbers(scene.start),
        low,
        width,
        weight,
        harmonics,
        grid.marks,
        grid.spacing,
        shapes,
        compensation(),
        2.0 * OVERSAMPLING / grid.count,
        forced,
        *_pieces(envelope, middles, half, order),
        np.stack([_response(np.pad(shapes, ((0, 0), (k, 0)))[:, :TERMS], half) for k in range(order)]),
        _added(forced, half).T.copy(),
        least - largest,
        most + largest,
    )


def _largest(envelope, grid):
    """Return the largest g in each interval (m,)."""
    edges = grid.spacing * np.arange(grid.count + 1)
    values = envelope.value(edges)
    largest = np.maximum(values[:-1], values[1:])
    inside = envelope.kinks if len(envelope.kinks) else np.array([envelope.peak])
    places = np.searchsorted(edges, inside) - 1
    within = (places >= 0) & (places < grid.count)
    np.maximum.at(largest, places[within], envelope.value(inside[within]))
    return largest


def _pieces(envelope, middles, half, order):
    """Return `piece`, `ends` and `strength` of a `Problem`."""
    piece, ends, centres, owners = [0], [], [], []
    kinks = np.sort(envelope.kinks)
    for middle in middles:
        inside = kinks[np.abs(kinks - middle) < half * (1.0 - _NEAR)] - middle
        stops = [*inside.tolist(), half]
        for begin, end in zip([-half, *stops[:-1]], stops, strict=True):
            ends.append(end)
            centres.append(middle + 0.5 * (begin + end))
            owners.append(middle)
        piece.append(len(ends))
    # Linear pieces are moved to the interval's middle, and others begin there.
    strength = envelope.series(np.array(centres), order)
    if order == 2:
        strength[:, 0] += strength[:, 1] * (np.array(owners) - np.array(centres))
    return np.array(piece), np.array(ends), strength


def _response(force, half):
    """Angle and velocity (2, n) that forces with coefficients (n, TERMS) since the middle add to a flight."""
    particular = np.zeros(force.shape)
    for k in range(TERMS - 2):
        particular[:, k + 2] = (particular[:, k] + force[:, k]) / ((k + 1) * (k + 2))
    return _added(particular, half)


def _added(particular, half):
    """Angle and velocity (2, n) that flights over an interval gain from particular solutions (n, TERMS)."""
    order = np.arange(TERMS)
    (p0, q0), (p1, q1) = (
        (particular @ end**order, particular[:, 1:] @ (order[1:] * end ** order[:-1])) for end in (-half, half)
    )
    cosh, sinh = math.cosh(2.0 * half), math.sinh(2.0 * half)
    return np.stack([p1 - cosh * p0 - sinh * q0, q1 - sinh * p0 - cosh * q0])


class Room(NamedTuple):
    """Working memory of a thread: `samples` (WIDTH - 1 + CHUNK,) of the interpolant; the others (TERMS,) scratch."""

    harmonics: noise.Harmonics
    samples: np.ndarray
    signal: np.ndarray
    particular: np.ndarray
    force: np.ndarray


@kernel
def _room(problem):
    samples = np.zeros(WIDTH - 1 + CHUNK)
    return Room(noise.allocate(problem.harmonics, HALF), samples, np.empty(TERMS), np.empty(TERMS), np.empty(TERMS))


@kernel(fastmath={"contract"}, borrows=True)
def _prepare(problem, room):
    """Turn drawn harmonics of the noise into those of its interpolant, and tabulate their rotations."""
    harmonics = room.harmonics
    for n in range(harmonics.ratios.size):
        harmonics.weights[n] *= compensate(problem.compensation, harmonics.ratios[n] * problem.ratio_scale)
    spacing = problem.spacing / problem.lap
    noise.prepare(harmonics, HALF, spacing)
    noise.set_rotation(harmonics.ratios, CHUNK * spacing, harmonics.hop[0], harmonics.hop[1])
    noise.anchor(harmonics, 0, (_LEAD - CHUNK) / problem.forced.shape[0])
    _extend(room)
    noise.rotate(harmonics, harmonics.hop)
    _extend(room)


@kernel(fastmath={"contract"}, borrows=True)
def _extend(room):
    """Make the next CHUNK samples."""
    samples = room.samples
    for k in range(WIDTH - 1):
        samples[k] = samples[k + CHUNK]
    samples[WIDTH - 1 :] = 0.0
    noise.add_chunk(room.harmonics, HALF, samples[WIDTH - 1 :])


@kernel(fastmath={"contract"}, borrows=True)
def _after(x, v, side, j, k, problem, room):
    """Angle and velocity after interval j, number k of a chunk, if nothing happens in it."""
    h, samples, strength, response = problem.spacing, room.samples, problem.strength[problem.piece[j]], problem.response
    push, kick = problem.drift[j, 0], problem.drift[j, 1]
    for n in range(strength.size):
        a, b = 0.0, 0.0
        for i in range(WIDTH):
            a += response[n, 0, i] * samples[k + i]
            b += response[n, 1, i] * samples[k + i]
        push += strength[n] * a
        kick += strength[n] * b
    cosh, sinh = math.cosh(h), math.sinh(h)
    return side + cosh * (x - side) + sinh * v + push, sinh * (x - side) + cosh * v + kick


@kernel(fastmath={"contract"}, borrows=True)
def _open(k, problem, room):
    """Write the noise in number k of a chunk, less its envelope, as a polynomial in the time since its middle."""
    for n in range(TERMS):
        value = 0.0
        for i in range(WIDTH):
            value += room.samples[k + i] * problem.shapes[i, n]
        room.signal[n] = value


@kernel(borrows=True)
def _carry(x, v, side, j, until, problem, room, impacts, origin):
    """Carry a block from the begin of interval j to a time since its middle; returns as `advance`."""
    signal, particular, half, begin, time = (
        room.signal,
        room.particular,
        0.5 * problem.spacing,
        -0.5 * problem.spacing,
        0.0,
    )
    for piece in range(problem.piece[j], problem.piece[j + 1]):
        strength, end = problem.strength[piece], min(problem.ends[piece], until)
        if begin >= until:
            break
        particular[0], particular[1] = 0.0, 0.0
        for n in range(TERMS - 2):
            force = 0.0
            for i in range(min(n + 1, strength.size)):
                force += strength[i] * signal[n - i]
            particular[n + 2] = (particular[n] + force) / ((n + 1) * (n + 2))
        for n in range(TERMS):
            particular[n] += problem.forced[j, n]
        segment = segment_of(particular, room.force, half)
        x, v, side, time = advance(
            x, v, side, segment, begin, end, problem.restitution, problem.cutoff, impacts, origin
        )
        if abs(x) >= problem.cutoff:
            break
        begin = end
    return x, v, side, time


@kernel(borrows=True)
def _is_quiet(u, end, side, j, problem):
    """Whether a flight between two folded angles has no event in interval j."""
    low, high = (problem.low[j], problem.high[j]) if side > 0 else (-problem.high[j], -problem.low[j])
    sag = 0.125 * problem.spacing * problem.spacing
    below, above = sag * max(problem.cutoff - 1.0 + high, 0.0), sag * max(1.0 - low, 0.0)
    return min(u, end) > below and max(u, end) + above < problem.cutoff


@kernel(borrows=True)
def _next(x, v, side, j, k, problem, room):
    """Say whether nothing happens in interval j, number k of a chunk; angle and velocity at its end if so."""
    if side == 0:
        return max(problem.high[j], -problem.low[j]) < 1.0, 0.0, 0.0
    if problem.piece[j + 1] > problem.piece[j] + 1:
        return False, 0.0, 0.0
    x_next, v_next = _after(x, v, side, j, k, problem, room)
    return _is_quiet(side * x, side * x_next, side, j, problem), x_next, v_next


@kernel(borrows=True)
def _look(x, v, side, j, row, problem, room, angle, velocity):
    """Write the states wanted within interval j, from number `row` on; return the number of the next one."""
    while row < angle.size and problem.marks[row - 1] < j + 1:
        time = (problem.marks[row - 1] - j - 0.5) * problem.spacing
        seen, speed, _, _ = _carry(x, v, side, j, time, problem, room, None, 0.0)
        if abs(seen) < problem.cutoff:
            angle[row], velocity[row] = seen, speed
        row += 1
    return row


@kernel(borrows=True)
def _realize(x, v, problem, room, angle, velocity, impacts):
    """Simulate one realization from (x, v): fill its states, return time (nan: never) and side of overturning."""
    marks, half, k, row = problem.marks, 0.5 * problem.spacing, 0, 1
    _prepare(problem, room)
    side = side_of(x, v)
    for j in range(problem.forced.shape[0]):
        if k == CHUNK:
            noise.rotate(room.harmonics, room.harmonics.hop)
            _extend(room)
            k = 0
        quiet, x_next, v_next = _next(x, v, side, j, k, problem, room)
        if not quiet or marks[row - 1] < j + 1:
            _open(k, problem, room)
            row = _look(x, v, side, j, row, problem, room, angle, velocity)
        if quiet:
            x, v = x_next, v_next
        else:
            origin = (j + 0.5) * problem.spacing
            x, v, side, time = _carry(x, v, side, j, half, problem, room, impacts, origin)
            if abs(x) >= problem.cutoff:
                return origin + time, side
        if row < angle.size and marks[row - 1] == j + 1:
            angle[row], velocity[row] = x, v
            row += 1
        if row == angle.size:
            break
        k += 1
    return math.nan, 0


@kernel(parallel=True)
def realize(keys, first, cycle, problem, angle, velocity, overturn_time, overturn_side, impacts):  # noqa: ARG001
    """Simulate realizations `first`, `first` + 1, ... in parallel; see `montecarlo.engines.Engine`."""
    count = angle.shape[0]
    for block in prange((count + _BLOCK - 1) // _BLOCK):
        room = _room(problem)
        for r in range(block * _BLOCK, min((block + 1) * _BLOCK, count)):
            x, v = draw(open_stream(keys, first + r), problem, room.harmonics)
            if abs(x) >= problem.cutoff:
                overturn_time[r], overturn_side[r] = 0.0, (1 if x > 0.0 else -1)
                continue
            angle[r, 0], velocity[r, 0] = x, v
            own = Impacts(impacts.count[r : r + 1], impacts.time[r], impacts.velocity[r])
            overturn_time[r], overturn_side[r] = _realize(x, v, problem, room, angle[r], velocity[r], own)
