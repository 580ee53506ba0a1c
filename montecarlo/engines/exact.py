"""Event-driven realizations under band noise or none: closed-form flights between located impacts, no time step.

The particular solution P of the forcing is band-limited. It is sampled on a grid that is far coarser than the steps of
an integrator, and is a polynomial between grid points (`physics.noise.band`). The flight itself is s + P
plus two exponentials, so at grid points it costs a few operations; only the intervals in which a bound of the
acceleration cannot exclude an event are looked at, by `physics.motion.slender_interval`.
"""

import math
import sys
from typing import NamedTuple

import numpy as np

from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion import TERMS
from fpk_rocking.physics.motion.equation import block_of, block_of_scene, slender_acceleration_bounds
from fpk_rocking.physics.motion.flight import dynamic_stiffness, exponential_parts, folded_angle
from fpk_rocking.physics.motion.particular import particular_at
from fpk_rocking.physics.motion.segment import force_bounds
from fpk_rocking.physics.motion.slender_interval import Interval, cross_interval, interval_tables, state_in_interval
from fpk_rocking.physics.noise import band
from fpk_rocking.physics.noise.band import (
    OVERSAMPLING,
    WIDTH,
    evaluate_compensation,
    interpolant_polynomials,
    window_compensation,
)
from montecarlo.engines import shinozuka
from montecarlo.engines.grid import grid_of
from montecarlo.engines.march import marcher, realizer
from montecarlo.engines.samples import CHUNK, allocate, first_samples, interpolate, more_samples
from montecarlo.engines.shinozuka import band_of
from montecarlo.engines.start import start_numbers

METHOD = "exact"
RENEWS = False
BLOCK = 64

FEWEST, LONGEST = 12, 0.2
"""Intervals of the grid in the forcing's shortest period at least, and the longest interval."""


def takes(scene):
    """Whether this engine simulates a scene."""
    plain = scene.noise.kind == "none" or (scene.noise.kind == "band" and scene.noise.envelope is None)
    return plain and scene.block.critical_angle == 0.0


class Problem(NamedTuple):
    """What the kernel has to know: a scene in numbers, nondimensional, and tables over the m intervals of a lap.

    `start` (5,); `count`, `spacing`, `marks`; `low_ratio` to `harmonics`: see `montecarlo.engines.start`, `grid` and
    `shinozuka`. `pieces` (WIDTH, TERMS), `compensation`,
    `ratio_scale`: interpolant of the noise, and `ends` (2, WIDTH): it and its derivative at an interval's end. `forced`
    (m, TERMS): P of the forcing in the time since the interval's middle; `node` (m, 2): it and its derivative at the
    interval's end. `least`, `most` (m, 2), indexed [interval, side < 0 or > 0]: between these angles at both ends of an
    interval a flight has no event in it. `exponentials`, `bend`: see `physics.motion.slender_interval.Interval`.
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
    block, band = block_of_scene(scene), band_of(scene, grid.duration)
    forced = forcing.pieces((np.arange(intervals) + 0.5) * spacing)
    shapes, half = interpolant_polynomials(spacing), 0.5 * spacing
    return Problem(
        *block,
        start_numbers(scene.start),
        *band,
        *grid,
        shapes,
        window_compensation(),
        2.0 * OVERSAMPLING / intervals,
        forced,
        np.stack(particular_at(forced, half), axis=-1),
        *_quiet_angles(forced, grid, block, band.weight * band.harmonics),
        *interval_tables(half),
        np.stack(particular_at(shapes, half)),
    )


def _quiet_angles(forced, grid, block, loudest):
    """Angles (m, 2) that a flight at both ends of an interval must exceed, and not reach, to have no event within."""
    low, high = np.empty((2, len(forced)))
    force_bounds(forced, 0.5 * grid.spacing, low, high)
    fall, rise = np.array(
        [slender_acceleration_bounds.py_func(side, low - loudest, high + loudest, block) for side in (-1, 1)]
    ).swapaxes(0, 1)
    sag = 0.125 * grid.spacing * grid.spacing
    return (sag * np.maximum(rise, 0.0)).T.copy(), (block.cutoff - sag * np.maximum(fall, 0.0)).T.copy()


@kernel(fastmath={"contract"}, borrows=True)
def _divide(harmonics, problem):
    """Turn drawn harmonics of the noise into those of the interpolant of P."""
    ratios, frequency = harmonics.ratios, 2.0 * math.pi / (problem.count * problem.spacing)
    for n in range(ratios.size):
        gain = -evaluate_compensation(problem.compensation, ratios[n] * problem.ratio_scale)
        harmonics.weights[n] *= gain / dynamic_stiffness(frequency * ratios[n])


@kernel(fastmath={"contract"}, borrows=True)
def _set_nodes(samples, node, ends):
    """Write the noise's share of P at the ends of the intervals that the new samples complete."""
    node[:] = 0.0
    for i in range(0, WIDTH, 4):
        a, b, c, d = ends[0, i], ends[0, i + 1], ends[0, i + 2], ends[0, i + 3]
        for k in range(CHUNK):
            node[k] += (a * samples[k + i] + b * samples[k + i + 1]) + (c * samples[k + i + 2] + d * samples[k + i + 3])


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

    harmonics: band.Realization
    samples: np.ndarray
    node: np.ndarray
    interval: Interval


@kernel
def room_of(problem):
    """Return the `Room` of a thread."""
    half, rows = 0.5 * problem.spacing, np.empty((3, TERMS))
    interval = Interval(rows[0], rows[1], rows[2], problem.exponentials, problem.bend, half, math.exp(half))
    harmonics, samples = allocate(problem.harmonics)
    return Room(harmonics, samples, np.empty(CHUNK), interval)


@kernel(forceinline=True, borrows=True)
def begin(stream, x, v, side, cycle, problem, room):  # noqa: ARG001  (all of the noise is drawn with the start)
    """Make the first samples of the noise; return the flight from (x, v): its exponentials and its folded angle."""
    _divide(room.harmonics, problem)
    first_samples(room.harmonics, room.samples, cycle, problem)
    _set_nodes(room.samples, room.node, problem.ends)
    resolve(0, 0, problem, room)
    grow, decay = exponential_parts(x, v, side, room.interval.particular, -room.interval.half)
    return grow, decay, abs(x)


@kernel(forceinline=True, borrows=True)
def know(stream, number, j, cycle, problem, room):  # noqa: ARG001
    """Make the samples of the noise for CHUNK intervals, where the last ones are used up."""
    if more_samples(room.harmonics, room.samples, number, cycle, problem):
        _set_nodes(room.samples, room.node, problem.ends)


@kernel(forceinline=True, borrows=True)
def coast(state, side, number, j, problem, room):
    """Whether nothing happens in an interval, and the flight at its end if so."""
    factor, (grow, decay, u) = room.interval.factor * room.interval.factor, state
    grow, decay = grow * factor, decay * (1.0 / factor)
    end, s = folded_angle(side, problem.node[j, 0] + room.node[number % CHUNK], grow, decay), 1 if side > 0 else 0
    quiet = side != 0 and min(u, end) > problem.least[j, s] and max(u, end) < problem.most[j, s]
    return quiet, (grow, decay, end)


@kernel(forceinline=True, borrows=True)
def resolve(number, j, problem, room):
    """Write P in an interval."""
    interpolate(room.interval.particular, problem.forced[j], problem.pieces, room.samples, number % CHUNK)


@kernel(forceinline=True, borrows=True)
def look(state, side, number, j, share, problem, room):  # noqa: ARG001
    """Angle and velocity in a resolved interval, nan if overturned."""
    return state_in_interval(
        room.interval, state[0], state[1], side, (share - 0.5) * problem.spacing, block_of(problem)
    )


@kernel(forceinline=True, borrows=True)
def cross(state, ahead, side, number, j, cycle, problem, room, impacts):
    """Carry a block through a resolved interval."""
    middle = cycle * (problem.count * problem.spacing) + (number + 0.5) * problem.spacing
    node = problem.node[j, 0] + room.node[number % CHUNK]
    grow, decay, u, side, time = cross_interval(
        room.interval, node, state[0], state[1], state[2], ahead[2], side, block_of(problem), impacts, middle
    )
    return (grow, decay, u), side, time


@kernel(forceinline=True, borrows=True)
def seen(state, side, number, j, problem, room):
    """Angle and velocity at the end of an interval."""
    grow, decay, u = state
    if side == 0:
        return 0.0, 0.0
    return side * u, problem.node[j, 1] + _slope(room.samples, number % CHUNK, problem.ends[1]) + grow - decay


draw = shinozuka.draw
march = marcher(sys.modules[__name__], borrows=True)
realize = realizer(sys.modules[__name__])
