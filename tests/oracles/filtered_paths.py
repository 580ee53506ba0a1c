"""Paths under filtered noise on two grids at once: the same noise, so that their difference has little scatter."""

import math

import numpy as np
from numba import prange

from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion.impact import side_of_start
from montecarlo.engines.filtered import begin_noise, carry, coast, draw_noise, on_grid, resolve, room_of
from montecarlo.engines.grid import Grid
from montecarlo.engines.random import open_stream, stream_keys
from montecarlo.engines.start import draw_start


def with_intervals(scene, intervals):
    """The engine's `Problem` of a scene for a number of intervals in a cycle."""
    return on_grid(scene, Grid(intervals, scene.period / intervals, np.array([float(intervals)])))


@kernel
def _gather(fine, part, problem, room):
    """Add part number `part` of a coarse interval's noise, drawn on the fine grid: states and flight."""
    n = fine.drawn.size // 2 - 1
    keep, swap = problem.hyperbolic
    if part == 0:
        for i in range(n):
            room.drawn[i] = fine.drawn[i]
        room.drawn[2 * n], room.drawn[2 * n + 1] = 0.0, 0.0
    x, v = room.drawn[2 * n], room.drawn[2 * n + 1]
    room.drawn[2 * n] = keep * x + swap * v + fine.drawn[2 * n]
    room.drawn[2 * n + 1] = swap * x + keep * v + fine.drawn[2 * n + 1]
    for i in range(n):
        room.drawn[n + i] = fine.drawn[n + i]


@kernel
def interval(x, v, side, number, j, problem, room):
    """Carry a block through an interval whose noise is drawn; return x, v, side and the time reached."""
    quiet, ahead = coast((x, v), side, number, j, problem, room)
    if quiet:
        return *ahead, side, (number + 1) * problem.spacing
    resolve(number, j, problem, room)
    return carry(x, v, side, number, j, 1.0, 0, problem, room, None)


@kernel
def _pair(stream, fine, coarse, factor, cycles):
    """Follow one path on both grids; return both times of overturning (inf: none) and both last angles."""
    rooms = room_of(fine), room_of(coarse)
    x, v = draw_start(stream, fine.start)
    states = [(x, v, side_of_start(x, v)), (x, v, side_of_start(x, v))]
    times = [math.inf, math.inf]
    begin_noise(stream, fine, rooms[0])
    intervals = fine.low.size
    for number in range(cycles * intervals):
        draw_noise(stream, fine, rooms[0])
        _gather(rooms[0], number % factor, fine, rooms[1])
        if times[0] == math.inf:
            x, v, side = states[0]
            x, v, side, time = interval(x, v, side, number, number % intervals, fine, rooms[0])
            states[0] = x, v, side
            if abs(x) >= fine.cutoff:
                times[0] = time
        if times[1] == math.inf and number % factor == factor - 1:
            x, v, side = states[1]
            j = number % intervals // factor
            x, v, side, time = interval(x, v, side, number // factor, j, coarse, rooms[1])
            states[1] = x, v, side
            if abs(x) >= fine.cutoff:
                times[1] = time
    return times[0], times[1], states[0][0], states[1][0]


@kernel(parallel=True)
def _pairs(keys, fine, coarse, factor, cycles, out, angle):
    for r in prange(out.shape[0]):
        out[r, 0], out[r, 1], angle[r, 0], angle[r, 1] = _pair(open_stream(keys, r), fine, coarse, factor, cycles)


def coupled(scene, intervals, factor, cycles, paths, seed=1):
    """Return times of overturning and last angles, (paths, 2) each: `intervals` in a cycle, `factor` times fewer."""
    out, angle = np.empty((2, paths, 2))
    problems = with_intervals(scene, intervals), with_intervals(scene, intervals // factor)
    _pairs(stream_keys(seed), *problems, factor, cycles, out, angle)
    return out, angle


@kernel
def _noise(keys, problem, states, flights):
    n = len(problem.stationary)
    for r in range(states.shape[0]):
        stream, room = open_stream(keys, r), room_of(problem)
        begin_noise(stream, problem, room)
        for k in range(states.shape[1]):
            states[r, k] = room.drawn[n : 2 * n]
            draw_noise(stream, problem, room)
            flights[r, k] = room.drawn[2 * n :]


def noise_of(problem, count, paths, seed=1):
    """Return states (paths, count, n) of the filter of noise of variance 1, and flights (paths, count, 2) between."""
    states, flights = np.empty((paths, count, len(problem.stationary))), np.empty((paths, count, 2))
    _noise(stream_keys(seed), problem, states, flights)
    return states, flights
