"""Event-driven realizations of an exact block under band noise or none: the engine `exact` for its equation of motion.

The force, with the noise η(τ) or η(τ) g(τ) under an envelope, is known at the points of a collocation by a table times
the samples of the noise, and as a polynomial where an interval needs a closer look. `physics.motion.collocation`
carries the block: over an interval without an event in one flight, else from event to event.
"""

import math
import sys
from typing import NamedTuple

import numpy as np

from fpk_rocking.base.jit import kernel
from fpk_rocking.base.lanes import load, store
from fpk_rocking.physics.motion import TERMS, lift_off
from fpk_rocking.physics.motion.collocation import (
    NODES,
    PLACES,
    FlightTables,
    advance_from_flight,
    flight_tables,
    fly_by_tables,
)
from fpk_rocking.physics.motion.equation import block_of, block_of_scene
from fpk_rocking.physics.motion.events import chord_clearance
from fpk_rocking.physics.motion.particular import force_series
from fpk_rocking.physics.motion.segment import force_bounds
from fpk_rocking.physics.noise import band
from fpk_rocking.physics.noise.band import (
    OVERSAMPLING,
    WIDTH,
    evaluate_compensation,
    interpolant_polynomials,
    window_compensation,
)
from montecarlo.engines import shinozuka
from montecarlo.engines.enveloped import ORDER, largest_strengths, pieces_of
from montecarlo.engines.exact import FEWEST, LONGEST
from montecarlo.engines.grid import grid_of
from montecarlo.engines.march import marcher, realizer, the_state
from montecarlo.engines.samples import CHUNK, allocate, first_samples, interpolate, more_samples
from montecarlo.engines.shinozuka import band_of
from montecarlo.engines.start import start_numbers

METHOD = "exact"
RENEWS = False
BLOCK = 64


def takes(scene):
    """Whether this engine simulates a scene."""
    return scene.noise.kind in ("none", "band") and scene.block.critical_angle > 0.0


class Problem(NamedTuple):
    """What the kernel has to know: a scene in numbers, nondimensional, and tables over the m intervals of a lap.

    `start` (5,); `low_ratio` to `harmonics`; `count`, `spacing`, `marks`: see `montecarlo.engines.start`, `shinozuka`
    and `grid`. `shapes` (WIDTH, TERMS), `compensation`, `ratio_scale`: interpolant of the noise; `values` (WIDTH,
    NODES): its values at the points of an interval. `forced` (m, TERMS): the forcing in the time since the interval's
    middle; `pushes` (m, NODES): its values at the points. `silence` (TERMS,): zeros.
    Of the envelope g: `piece` (m + 1,): number of its first piece in each interval. `ends` (pieces,): their ends, times
    since the interval's middle. `strength` (pieces, order): g in the time since then. `factors` (m, NODES): its values
    at the points, (0, NODES) without one.
    `least`, `most` (m, 2), indexed [interval, side < 0 or > 0]: between these angles at both ends of an interval a
    flight has no event in it. `holds` (m,): whether a block at rest surely stays. `points` to `sinh`: see `Cruise`.
    """

    restitution: float
    cutoff: float
    critical_angle: float
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
    values: np.ndarray
    forced: np.ndarray
    pushes: np.ndarray
    silence: np.ndarray
    piece: np.ndarray
    ends: np.ndarray
    strength: np.ndarray
    factors: np.ndarray
    least: np.ndarray
    most: np.ndarray
    holds: np.ndarray
    points: np.ndarray
    inner: np.ndarray
    cosh: float
    sinh: float


def problem_of(scene, steps_per_cycle, times=None):  # noqa: ARG001  (this engine takes no steps)
    """Return the `Problem` of a scene with an exact block; a realization does not depend on `times`."""
    forcing, envelope = scene.forcing, scene.noise.envelope
    longest = min(LONGEST, forcing.shortest_period / FEWEST)
    if scene.noise.kind == "band":
        longest = min(longest, math.pi / (OVERSAMPLING * scene.noise.band[1]))
    grid = grid_of(scene, longest, times)
    half, middles = 0.5 * grid.spacing, (np.arange(grid.count) + 0.5) * grid.spacing
    band, block, shapes = band_of(scene, grid.duration), block_of_scene(scene), interpolant_polynomials(grid.spacing)
    powers = (half * (2.0 * PLACES - 1.0)) ** np.arange(TERMS)[:, None]
    particular, (low, high) = forcing.pieces(middles), np.empty((2, grid.count))
    force_bounds(particular, half, low, high)
    forced = force_series(particular)
    loudest = band.weight * band.harmonics * (1.0 if envelope is None else largest_strengths(envelope, grid))
    return Problem(
        *block,
        start_numbers(scene.start),
        *band,
        *grid,
        shapes,
        window_compensation(),
        2.0 * OVERSAMPLING / grid.count,
        shapes @ powers,
        forced,
        forced @ powers,
        np.zeros(TERMS),
        *_strengths(envelope, grid, middles, half),
        *_quiet(low - loudest, high + loudest, grid.spacing, block),
        *flight_tables(grid.spacing),
    )


def _strengths(envelope, grid, middles, half):
    """Return `piece`, `ends`, `strength` and `factors` of a `Problem`."""
    if envelope is None:
        count = grid.count
        return np.arange(count + 1), np.full(count, half), np.ones((count, 1)), np.empty((0, NODES))
    parts = pieces_of(envelope, middles, half, 2 if math.isinf(envelope.spacing) else ORDER)
    return *parts, envelope.value(middles[:, None] + half * (2.0 * PLACES - 1.0))


def _quiet(low, high, spacing, block):
    """Return `least`, `most` and `holds` of a `Problem` from bounds (m,) of the force."""
    least, most = np.empty((2, low.size, 2))
    _clearances(low, high, spacing, block, least, most)
    return least, block.cutoff - most, np.maximum(high, -low) < lift_off(block.critical_angle)


@kernel
def _clearances(low, high, spacing, block, least, most):
    for j in range(low.size):
        for k in range(2):
            least[j, k], most[j, k] = chord_clearance(2 * k - 1, low[j], high[j], spacing, block)


class Room(NamedTuple):
    """Working memory of a thread.

    `samples` (WIDTH - 1 + CHUNK,): the interpolant's samples of the noise, the last CHUNK of them new. `signal`,
    `force` (TERMS,): scratch. `bend` (1, NODES): u'' in the flight over an interval, if nothing happens in it.
    """

    harmonics: band.Realization
    samples: np.ndarray
    signal: np.ndarray
    force: np.ndarray
    bend: np.ndarray


@kernel
def room_of(problem):
    """Return the `Room` of a thread."""
    rows = np.empty((2, TERMS))
    harmonics, samples = allocate(problem.harmonics)
    return Room(harmonics, samples, rows[0], rows[1], np.zeros((1, NODES)))


@kernel(borrows=True)
def begin(stream, x, v, side, cycle, problem, room):  # noqa: ARG001  (all of the noise is drawn with the start)
    """Turn drawn harmonics of the noise into those of its interpolant, and make the first samples."""
    harmonics = room.harmonics
    for n in range(harmonics.ratios.size):
        harmonics.weights[n] *= evaluate_compensation(problem.compensation, harmonics.ratios[n] * problem.ratio_scale)
    first_samples(harmonics, room.samples, cycle, problem)
    return x, v


@kernel(forceinline=True, borrows=True)
def know(stream, number, j, cycle, problem, room):  # noqa: ARG001
    """Make the samples of the noise for CHUNK intervals, where the last ones are used up."""
    more_samples(room.harmonics, room.samples, number, cycle, problem)


@kernel(fastmath={"contract"}, forceinline=True, borrows=True)
def _interpolated(values, g, k):
    """Noise at the points of an interval, less its envelope, from the samples from number k on."""
    one = load(values, 0) * g[k] + load(values, 1) * g[k + 1]
    two = load(values, 2) * g[k + 2] + load(values, 3) * g[k + 3]
    for i in range(4, WIDTH, 4):
        one = one + (load(values, i) * g[k + i] + load(values, i + 1) * g[k + i + 1])
        two = two + (load(values, i + 2) * g[k + i + 2] + load(values, i + 3) * g[k + i + 3])
    return one + two


@kernel(forceinline=True, borrows=True)
def coast(state, side, number, j, problem, room):
    """Whether nothing happens in an interval, and angle and velocity at its end if so."""
    x, v = state
    if side == 0:
        return problem.holds[j], state
    if problem.piece[j + 1] > problem.piece[j] + 1:
        return False, state
    k, s = number % CHUNK, 1 if side > 0 else 0
    push = _interpolated(problem.values, room.samples, k)
    if problem.factors.shape[0] > 0:
        push = load(problem.factors, j) * push
    u, push = side * x, side * (load(problem.pushes, j) + push)
    tables = FlightTables(problem.points, problem.inner, problem.cosh, problem.sinh)
    end, speed, bend, found = fly_by_tables(u, side * v, push, tables, problem.spacing, block_of(problem))
    store(room.bend, 0, bend)
    quiet = found and min(u, end) > problem.least[j, s] and max(u, end) < problem.most[j, s]
    return quiet, (side * end if found else math.nan, side * speed)


@kernel(forceinline=True, borrows=True)
def resolve(number, j, problem, room):  # noqa: ARG001
    """Write the noise in an interval, less its envelope, as a polynomial in the time since its middle."""
    interpolate(room.signal, problem.silence, problem.shapes, room.samples, number % CHUNK)


@kernel(forceinline=True, borrows=True)
def _carry(x, v, side, number, j, share, cycle, problem, room, impacts, known, last, speed):
    """Carry a block through a share of a resolved interval; return x, v, side and the time reached."""
    half, time = 0.5 * problem.spacing, 0.0
    origin = cycle * (problem.count * problem.spacing) + (number + 0.5) * problem.spacing
    until, start, bend = (share - 0.5) * problem.spacing, -half, load(room.bend, 0)
    for piece in range(problem.piece[j], problem.piece[j + 1]):
        strength, end = problem.strength[piece], min(problem.ends[piece], until)
        if start >= until:
            break
        for n in range(TERMS):
            force = problem.forced[j, n]
            for i in range(min(n + 1, strength.size)):
                force += strength[i] * room.signal[n - i]
            room.force[n] = force
        x, v, side, time = advance_from_flight(
            room.force,
            half,
            x,
            v,
            side,
            start,
            end,
            block_of(problem),
            impacts,
            origin,
            known,
            last,
            speed,
            bend,
        )
        if abs(x) >= problem.cutoff:
            break
        start = end
    return x, v, side, origin + time


@kernel(borrows=True)
def look(state, side, number, j, share, problem, room):
    """Angle and velocity after a share of a resolved interval, nan if overturned."""
    x, v = state
    x, v, _, _ = _carry(x, v, side, number, j, share, 0, problem, room, None, False, 0.0, 0.0)
    if abs(x) >= problem.cutoff:
        return math.nan, math.nan
    return x, v


@kernel(borrows=True)
def cross(state, ahead, side, number, j, cycle, problem, room, impacts):
    """Carry a block on through a resolved interval, from what `coast` has found; return state, side and time."""
    (x, v), (end, speed) = state, ahead
    known = side != 0 and not math.isnan(end) and problem.piece[j + 1] == problem.piece[j] + 1
    x, v, side, time = _carry(
        x, v, side, number, j, 1.0, cycle, problem, room, impacts, known, side * end, side * speed
    )
    return (x, v), side, (time if abs(x) >= problem.cutoff else math.inf)


draw = shinozuka.draw
seen = the_state
march = marcher(sys.modules[__name__], borrows=True)
realize = realizer(sys.modules[__name__])
