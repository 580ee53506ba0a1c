"""Event-driven realizations under band noise or none: closed-form flights between located impacts, no time step.

The particular solution P of the forcing is band-limited. It is sampled on a grid that is far coarser than the steps of
an integrator, and is a polynomial between grid points (`fpk_rocking.physics.bandlimited`). The flight itself is s + P
plus two exponentials, so at grid points it costs a few operations; only the intervals in which a bound of the
acceleration cannot exclude an event are looked at, by `fpk_rocking.physics.motion.crossing`.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import prange

from fpk_rocking.base.jit import kernel
from fpk_rocking.physics import noise
from fpk_rocking.physics.bandlimited import OVERSAMPLING, WIDTH, compensate, compensation, pieces
from fpk_rocking.physics.motion import TERMS
from fpk_rocking.physics.motion.crossing import Interval, cross, interval_tables, state_at
from fpk_rocking.physics.motion.polynomial import polynomial
from fpk_rocking.physics.motion.slender import segment_of
from fpk_rocking.physics.motion.transition import Impacts
from montecarlo.engines.grid import grid_of
from montecarlo.engines.random import open_stream
from montecarlo.engines.shinozuka import band_numbers, draw
from montecarlo.engines.start import start_numbers

NOISES = ("band", "none")

HALF = 8
"""Samples on each side of the centre of a chunk of noise."""

CHUNK = 2 * HALF + 1

_LEAD = WIDTH // 2 + HALF
"""Centre of the samples that the CHUNK intervals from number 0 on still lack."""

_BLOCK = 64
"""Realizations that follow each other in a thread's working memory."""

FEWEST, LONGEST = 12, 0.2
"""Intervals of the grid in the forcing's shortest period at least, and the longest interval."""


class Problem(NamedTuple):
    """What the kernel has to know: a scene in numbers, nondimensional, and tables over the m intervals of a lap.

    `lap`, `marks`, `spacing`: duration of a lap, and see `montecarlo.engines.grid`. `start` (5,), `band_low`,
    `band_width`, `weight`, `harmonics`: as in `rk4`.
    `pieces` (WIDTH, TERMS), `compensation`, `ratio_scale`: interpolant of the noise, and `ends`
    (2, WIDTH): it and its derivative at an interval's end. `forced` (m, TERMS): P of the forcing in the time
    since the interval's middle; `node` (m, 2): it and its derivative at the interval's end. `least`, `most` (m, 2),
    indexed [interval, side < 0 or > 0]: between these angles at both ends of an interval a flight has no event in it.
    `exponentials`, `bend`: see `fpk_rocking.physics.motion.crossing.Interval`.
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
    pieces: np.ndarray
    compensation: np.ndarray
    ratio_scale: float
    forced: np.ndarray
    node: np.ndarray
    least: np.ndarray
    most: np.ndarray
    exponentials: np.ndarray
    bend: np.ndarray
    ends: np.ndarray


def problem_of(scene, steps_per_cycle, times=None):  # noqa: ARG001  (this engine takes no steps)
    """Return the `Problem` of a scene with band noise or none; a realization does not depend on `times`."""
    forcing, noisy = scene.forcing, scene.noise.kind == "band"
    longest = min(LONGEST, forcing.shortest_period / FEWEST)
    grid = grid_of(scene, min(longest, math.pi / (OVERSAMPLING * scene.noise.band[1])) if noisy else longest, times)
    intervals, spacing = grid.count, grid.spacing
    low, width, weight, harmonics = band_numbers(scene, grid.duration)
    forced = forcing.pieces((np.arange(intervals) + 0.5) * spacing)
    powers = (0.5 * spacing) ** np.arange(TERMS)
    order = np.arange(TERMS)
    shapes = pieces(spacing)
    ends = np.stack([shapes @ powers, shapes[:, 1:] @ (order[1:] * powers[:-1])])
    node = np.stack([forced @ powers, forced[:, 1:] @ (order[1:] * powers[:-1])], axis=-1)
    least, most = _clearance(scene.overturning.angle, forced, spacing, weight * harmonics)
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
        spacing,
        shapes,
        compensation(),
        2.0 * OVERSAMPLING / intervals,
        forced,
        node,
        least,
        most,
        *interval_tables(0.5 * spacing),
        ends,
    )


@kernel
def force_bounds(forced, half, low, high):
    """Write bounds (m,) of the force over intervals, from P in the time since their middles."""
    scratch = np.empty(TERMS)
    for i in range(low.size):
        segment = segment_of(forced[i], scratch, half)
        low[i], high[i] = segment.force_low, segment.force_high


def _clearance(cutoff, forced, spacing, noise_bound):
    """Angles (m, 2) that a flight at an interval's both ends must exceed, and not reach, to have no event within.

    Between its ends a path lies within |u''| d^2 / 8 of the chord, and u'' = u - 1 + s f.
    """
    low, high = np.empty((2, len(forced)))
    force_bounds(forced, 0.5 * spacing, low, high)
    rise, fall = np.stack([-low, high], axis=-1) + noise_bound, np.stack([high, -low], axis=-1) + noise_bound
    least = np.maximum(cutoff - 1.0 + rise, 0.0) * spacing**2 / 8.0
    most = cutoff - np.maximum(1.0 + fall, 0.0) * spacing**2 / 8.0
    return least, most


@kernel(fastmath={"contract"}, forceinline=True, borrows=True)
def _prepare(harmonics, problem):
    """Turn drawn harmonics of the noise into those of the interpolant of P, and tabulate their rotations."""
    ratios, weights = harmonics.ratios, harmonics.weights
    frequency = 2.0 * math.pi / problem.lap
    for n in range(ratios.size):
        nu = frequency * ratios[n]
        weights[n] *= -compensate(problem.compensation, ratios[n] * problem.ratio_scale) / (1.0 + nu * nu)
    spacing = problem.spacing / problem.lap
    noise.prepare(harmonics, HALF, spacing)
    noise.set_rotation(ratios, CHUNK * spacing, harmonics.hop[0], harmonics.hop[1])


@kernel(fastmath={"contract"}, borrows=True)
def _extend(harmonics, samples, node, ends):
    """Make the next CHUNK samples, and P at the ends of the intervals that they complete."""
    for k in range(WIDTH - 1):
        samples[k] = samples[k + CHUNK]
    samples[WIDTH - 1 :] = 0.0
    noise.add_chunk(harmonics, HALF, samples[WIDTH - 1 :])
    node[:] = 0.0
    for i in range(0, WIDTH, 4):
        a, b, c, d = ends[0, i], ends[0, i + 1], ends[0, i + 2], ends[0, i + 3]
        for k in range(CHUNK):
            node[k] += (a * samples[k + i] + b * samples[k + i + 1]) + (c * samples[k + i + 2] + d * samples[k + i + 3])


# Sixteen products in one expression: a loop over them would keep the sums in memory, at three times the cost.
@kernel(fastmath={"contract"}, forceinline=True, borrows=True)
def _open(particular, forced, i, s, g, k):
    """Write P in interval i of a cycle, k of a chunk: polynomials `s` (WIDTH, TERMS), weighted with samples `g`."""
    a0, a1, a2, a3, a4, a5, a6, a7 = g[k], g[k + 1], g[k + 2], g[k + 3], g[k + 4], g[k + 5], g[k + 6], g[k + 7]
    k += 8
    b0, b1, b2, b3, b4, b5, b6, b7 = g[k], g[k + 1], g[k + 2], g[k + 3], g[k + 4], g[k + 5], g[k + 6], g[k + 7]
    for n in range(particular.size):
        first = (a0 * s[0, n] + a1 * s[1, n]) + (a2 * s[2, n] + a3 * s[3, n])
        second = (a4 * s[4, n] + a5 * s[5, n]) + (a6 * s[6, n] + a7 * s[7, n])
        third = (b0 * s[8, n] + b1 * s[9, n]) + (b2 * s[10, n] + b3 * s[11, n])
        fourth = (b4 * s[12, n] + b5 * s[13, n]) + (b6 * s[14, n] + b7 * s[15, n])
        particular[n] = forced[i, n] + ((first + second) + (third + fourth))


@kernel(fastmath={"contract", "reassoc"}, borrows=True)
def _slope(samples, k, slopes):
    """Return the derivative of the noise's P at the end of interval k of a chunk."""
    total = 0.0
    for i in range(WIDTH):
        total += slopes[i] * samples[k + i]
    return total


class Room(NamedTuple):
    """Working memory of a thread.

    `samples` (WIDTH - 1 + CHUNK,): the interpolant's samples of the noise, the last CHUNK of them new. `node` (CHUNK,):
    the noise's share of P at the ends of the CHUNK intervals that these samples complete.
    """

    harmonics: noise.Harmonics
    samples: np.ndarray
    node: np.ndarray
    interval: Interval


@kernel
def _room(problem):
    half, rows = 0.5 * problem.spacing, np.empty((3, TERMS))
    interval = Interval(rows[0], rows[1], rows[2], problem.exponentials, problem.bend, half, math.exp(half))
    return Room(noise.allocate(problem.harmonics, HALF), np.zeros(WIDTH - 1 + CHUNK), np.empty(CHUNK), interval)


@kernel(forceinline=True, borrows=True)
def _begin(x, v, cycle, problem, room):
    """Make the first samples of the noise; return the flight from (x, v): its side and exponentials."""
    _prepare(room.harmonics, problem)
    noise.anchor(room.harmonics, cycle, (_LEAD - CHUNK) / problem.forced.shape[0])
    _extend(room.harmonics, room.samples, room.node, problem.ends)
    noise.rotate(room.harmonics, room.harmonics.hop)
    _extend(room.harmonics, room.samples, room.node, problem.ends)
    side = 1 if x > 0.0 or (x == 0.0 and v > 0.0) else -1
    if x == 0.0 and v == 0.0:
        side = 0
    _open(room.interval.particular, problem.forced, 0, problem.pieces, room.samples, 0)
    p, q = polynomial(room.interval.particular, -room.interval.half)
    y, z = x - side - p, v - q
    return side, 0.5 * (y + z), 0.5 * (y - z)


@kernel(forceinline=True, borrows=True)
def _continue(j, anchored, cycle, problem, room):
    """Make the samples of the next CHUNK intervals, from number j on; return the number at the last fresh anchor."""
    intervals = problem.forced.shape[0]
    if j - anchored >= noise.ANCHOR_CYCLES * intervals:
        anchored, centre = j, j + _LEAD
        noise.anchor(room.harmonics, cycle + centre // intervals, centre % intervals / intervals)
    else:
        noise.rotate(room.harmonics, room.harmonics.hop)
    _extend(room.harmonics, room.samples, room.node, problem.ends)
    return anchored


@kernel(borrows=True)
def _realize(x, v, cycle, problem, room, angle, velocity, impacts):
    """Simulate one realization from (x, v): fill its states, return time (nan: never) and side of overturning."""
    samples, node, interval = room.samples, room.node, room.interval
    forced, shapes, forced_node, least, most = problem.forced, problem.pieces, problem.node, problem.least, problem.most
    intervals, marks, rows, u = forced.shape[0], problem.marks, problem.marks.size, abs(x)
    side, grow, decay = _begin(x, v, cycle, problem, room)
    stretch, shrink = interval.factor * interval.factor, 1.0 / (interval.factor * interval.factor)
    anchored, k, i, row, mark = 0, 0, 0, 1, marks[0]
    for j in range((angle.size - 1) // rows * intervals):
        if k == CHUNK:
            anchored, k = _continue(j, anchored, cycle, problem, room), 0
        next_grow, next_decay = grow * stretch, decay * shrink
        particular = forced_node[i, 0] + node[k]
        end, s = 1.0 + side * (particular + next_grow + next_decay), 1 if side > 0 else 0
        quiet = side != 0 and min(u, end) > least[i, s] and max(u, end) < most[i, s]
        if not quiet or mark < j + 1:
            _open(interval.particular, forced, i, shapes, samples, k)
            while mark < j + 1:
                time = (mark - j - 0.5) * problem.spacing
                angle[row], velocity[row] = state_at(
                    interval, grow, decay, side, time, problem.restitution, problem.cutoff
                )
                row += 1
                mark = marks[(row - 1) % rows] + (row - 1) // rows * intervals
        if quiet:
            grow, decay, u = next_grow, next_decay, end
        else:
            middle = cycle * problem.lap + (j + 0.5) * problem.spacing
            grow, decay, u, side, time = cross(
                interval, particular, grow, decay, u, end, side, problem, impacts, middle
            )
            if time < math.inf:
                return time, side
        if mark == j + 1:
            angle[row], velocity[row] = side * u, 0.0
            if side != 0:
                velocity[row] = forced_node[i, 1] + _slope(samples, k, problem.ends[1]) + grow - decay
            row += 1
            mark = marks[(row - 1) % rows] + (row - 1) // rows * intervals
        if row == angle.size:
            break
        k += 1
        i = i + 1 if i + 1 < intervals else 0
    return math.nan, 0


@kernel(parallel=True)
def realize(keys, first, cycle, problem, angle, velocity, overturn_time, overturn_side, impacts):
    """Simulate realizations `first`, `first` + 1, ... in parallel; see `montecarlo.engines.Engine`."""
    count = angle.shape[0]
    for block in prange((count + _BLOCK - 1) // _BLOCK):
        room = _room(problem)
        for r in range(block * _BLOCK, min((block + 1) * _BLOCK, count)):
            x, v = draw(open_stream(keys, first + r), problem, room.harmonics)
            if abs(x) >= problem.cutoff:
                overturn_time[r], overturn_side[r] = cycle * problem.lap, (1 if x > 0.0 else -1)
                continue
            angle[r, 0], velocity[r, 0] = x, v
            own = Impacts(impacts.count[r : r + 1], impacts.time[r], impacts.velocity[r])
            overturn_time[r], overturn_side[r] = _realize(x, v, cycle, problem, room, angle[r], velocity[r], own)
