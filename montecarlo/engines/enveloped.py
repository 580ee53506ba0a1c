"""Event-driven realizations of a slender block under band noise with an envelope: the engine `exact` for η(τ) g(τ).

The noise η is band-limited and a polynomial between the points of a coarse grid (`physics.noise.band`); so
is g, in pieces of its own where a kink of it falls into an interval. Their product is the force, in closed form as in
`exact`. As g has kinks the product is not band-limited, and P is started anew in every interval.
"""

import math
import sys
from typing import NamedTuple

import numpy as np

from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion import TERMS
from fpk_rocking.physics.motion.equation import block_of, block_of_scene
from fpk_rocking.physics.motion.events import advance_through_events, can_lift_off, surely_eventless
from fpk_rocking.physics.motion.flight import homogeneous_flight
from fpk_rocking.physics.motion.particular import forced_response, particular_at, particular_series
from fpk_rocking.physics.motion.segment import force_bounds, particular_from_rest, segment_from_particular
from fpk_rocking.physics.noise import band
from fpk_rocking.physics.noise.band import (
    OVERSAMPLING,
    WIDTH,
    evaluate_compensation,
    interpolant_polynomials,
    window_compensation,
)
from montecarlo.engines import shinozuka
from montecarlo.engines.exact import FEWEST, LONGEST
from montecarlo.engines.grid import grid_of
from montecarlo.engines.march import carriers, marcher, realizer, the_state
from montecarlo.engines.samples import CHUNK, allocate, extend, first_samples
from montecarlo.engines.shinozuka import band_of
from montecarlo.engines.start import start_numbers

METHOD = "exact"
RENEWS = False
BLOCK = 64

ORDER = 8
"""Coefficients of g in a piece; of a linear one 2 are used."""

_NEAR = 1e-9


def takes(scene):
    """Whether this engine simulates a scene."""
    return scene.noise.kind == "band" and scene.noise.envelope is not None and scene.block.critical_angle == 0.0


class Problem(NamedTuple):
    """What the kernel has to know: a scene in numbers, nondimensional, and tables over the m intervals of the time.

    As `montecarlo.engines.exact`, and: `piece` (m + 1,): number of the first piece of g in each interval. `ends`
    (pieces,): their ends, times since the interval's middle. `strength` (pieces, order): g in the time since the
    interval's middle. `response` (order, 2, WIDTH): angle and velocity that the polynomials of the interpolant, times
    powers of the time, add to a flight over an interval. `drift` (m, 2): those that the forcing adds.
    """

    restitution: float
    cutoff: float
    critical_angle: float | None
    start: np.ndarray
    low_ratio: float
    ratio_width: float
    weight: float
    harmonics: int
    count: int
    spacing: float
    marks: np.ndarray
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
    forced, shapes = forcing.pieces(middles), interpolant_polynomials(grid.spacing)
    band = band_of(scene, grid.duration)
    least, most = np.empty((2, grid.count))
    force_bounds(forced, half, least, most)
    largest = band.weight * band.harmonics * largest_strengths(envelope, grid)
    order = 2 if math.isinf(envelope.spacing) else ORDER
    return Problem(
        *block_of_scene(scene),
        start_numbers(scene.start),
        *band,
        *grid,
        shapes,
        window_compensation(),
        2.0 * OVERSAMPLING / grid.count,
        forced,
        *pieces_of(envelope, middles, half, order),
        np.stack([_response(np.pad(shapes, ((0, 0), (k, 0)))[:, :TERMS], half) for k in range(order)]),
        _added(forced, half).T.copy(),
        least - largest,
        most + largest,
    )


def largest_strengths(envelope, grid):
    """Return the largest g in each interval (m,)."""
    edges = grid.spacing * np.arange(grid.count + 1)
    values = envelope.value(edges)
    largest = np.maximum(values[:-1], values[1:])
    inside = envelope.kinks if len(envelope.kinks) else np.array([envelope.peak])
    places = np.searchsorted(edges, inside) - 1
    within = (places >= 0) & (places < grid.count)
    np.maximum.at(largest, places[within], envelope.value(inside[within]))
    return largest


def pieces_of(envelope, middles, half, order):
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
    return _added(particular_series(0.0, 0.0, force), half)


def _added(particular, half):
    """Angle and velocity (2, n) that flights over an interval gain from particular solutions (n, TERMS)."""
    return np.stack(forced_response(*particular_at(particular, -half), *particular_at(particular, half), 2.0 * half))


class Room(NamedTuple):
    """Working memory of a thread: `samples` (WIDTH - 1 + CHUNK,) of the interpolant; the others (TERMS,) scratch."""

    harmonics: band.Realization
    samples: np.ndarray
    signal: np.ndarray
    particular: np.ndarray
    force: np.ndarray


@kernel
def room_of(problem):
    """Return the `Room` of a thread."""
    rows = np.empty((3, TERMS))
    harmonics, samples = allocate(problem.harmonics)
    return Room(harmonics, samples, rows[0], rows[1], rows[2])


@kernel(borrows=True)
def begin(stream, x, v, side, cycle, problem, room):  # noqa: ARG001  (all of the noise is drawn with the start)
    """Turn drawn harmonics of the noise into those of its interpolant, and make the first samples."""
    harmonics = room.harmonics
    for n in range(harmonics.ratios.size):
        harmonics.weights[n] *= evaluate_compensation(problem.compensation, harmonics.ratios[n] * problem.ratio_scale)
    first_samples(harmonics, room.samples, cycle, problem)
    return x, v


@kernel(borrows=True)
def know(stream, number, j, cycle, problem, room):  # noqa: ARG001
    """Make the samples of the noise for CHUNK intervals, where the last ones are used up."""
    if number % CHUNK == 0 and number > 0:
        band.rotate_centre(room.harmonics, room.harmonics.hop)
        extend(room.harmonics, room.samples)


@kernel(fastmath={"contract"}, borrows=True)
def _after(x, v, side, j, k, problem, room):
    """Angle and velocity after interval j, number k of a chunk, if nothing happens in it."""
    h, samples, response = problem.spacing, room.samples, problem.response
    strength = problem.strength[problem.piece[j]]
    push, kick = problem.drift[j, 0], problem.drift[j, 1]
    for n in range(strength.size):
        a, b = 0.0, 0.0
        for i in range(WIDTH):
            a += response[n, 0, i] * samples[k + i]
            b += response[n, 1, i] * samples[k + i]
        push += strength[n] * a
        kick += strength[n] * b
    y, v = homogeneous_flight(x - side, v, math.cosh(h), math.sinh(h))
    return side + y + push, v + kick


@kernel(borrows=True)
def coast(state, side, number, j, problem, room):
    """Whether nothing happens in an interval, and angle and velocity at its end if so."""
    low, high, (x, v) = problem.low[j], problem.high[j], state
    if side == 0:
        return not can_lift_off(low, high, block_of(problem)), state
    if problem.piece[j + 1] > problem.piece[j] + 1:
        return False, state
    ahead = _after(x, v, side, j, number % CHUNK, problem, room)
    return surely_eventless(side * x, side * ahead[0], side, low, high, problem.spacing, block_of(problem)), ahead


@kernel(fastmath={"contract"}, borrows=True)
def resolve(number, j, problem, room):  # noqa: ARG001
    """Write the noise in an interval, less its envelope, as a polynomial in the time since its middle."""
    k = number % CHUNK
    for n in range(TERMS):
        value = 0.0
        for i in range(WIDTH):
            value += room.samples[k + i] * problem.shapes[i, n]
        room.signal[n] = value


@kernel(borrows=True)
def carry(x, v, side, number, j, share, cycle, problem, room, impacts):
    """Carry a block through a share of a resolved interval; return x, v, side and the time reached."""
    spacing, time = problem.spacing, 0.0
    origin = cycle * (problem.count * spacing) + (number + 0.5) * spacing
    half, until, begin = 0.5 * spacing, (share - 0.5) * spacing, -0.5 * spacing
    for piece in range(problem.piece[j], problem.piece[j + 1]):
        strength, end = problem.strength[piece], min(problem.ends[piece], until)
        if begin >= until:
            break
        for n in range(TERMS):
            force = 0.0
            for i in range(min(n + 1, strength.size)):
                force += strength[i] * room.signal[n - i]
            room.force[n] = force
        particular_from_rest(room.force, room.particular)
        for n in range(TERMS):
            room.particular[n] += problem.forced[j, n]
        segment = segment_from_particular(room.particular, room.force, half)
        x, v, side, time = advance_through_events(x, v, side, segment, begin, end, block_of(problem), impacts, origin)
        if abs(x) >= problem.cutoff:
            break
        begin = end
    return x, v, side, origin + time


draw = shinozuka.draw
look, cross = carriers(sys.modules[__name__])
seen = the_state
march = marcher(sys.modules[__name__], borrows=True)
realize = realizer(sys.modules[__name__])
