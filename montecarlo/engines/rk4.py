"""Classical Runge-Kutta of order 4 with Shinozuka noise: the paper's method.

Steps of T/n see the forcing at their begin, middle and end. Between impacts the motion is linear, so the four stages
add up to one fixed matrix and three fixed weights. A step in which an impact, the cut-off or uplift cannot be excluded
takes the forcing as the parabola through its three values and follows the block in closed form (`fpk_rocking.physics`):
impacts, chatter, rest and first passage are located there, and order 4 is kept because such steps are few.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import prange

from fpk_rocking.base.jit import kernel
from fpk_rocking.physics import noise
from fpk_rocking.physics.contact import side_at_zero
from fpk_rocking.physics.flight import segment_of
from fpk_rocking.physics.forcing import TERMS
from fpk_rocking.physics.transition import Impacts, advance
from montecarlo.engines.grid import grid_of
from montecarlo.engines.random import open_stream
from montecarlo.engines.shinozuka import band_numbers, draw
from montecarlo.engines.start import start_numbers

NOISES = ("band", "none")

CHUNK_STEPS = 20
"""Steps for which noise is made at once, at most: an overturned block has cost no more than that in vain."""


class Problem(NamedTuple):
    """What the kernel has to know: a scene in numbers, nondimensional.

    `lap`, `marks`: duration of a lap of n steps, and see `montecarlo.engines.grid`. `start` (5,): see
    `montecarlo.engines.start`. `forcing` (n, 3): its values at the begin, the middle and the end of the steps of a lap.
    `strength` (n, 3): the noise's envelope there. `band_low`, `band_width`: the noise's frequencies in turns per lap.
    `weight`: amplitude of each of its harmonics.
    """

    restitution: float
    cutoff: float
    lap: float
    start: np.ndarray
    forcing: np.ndarray
    strength: np.ndarray
    band_low: float
    band_width: float
    weight: float
    harmonics: int
    marks: np.ndarray


class Chunk(NamedTuple):
    """Forcing of a chunk of steps and what RK4 makes of it; m steps.

    `noise` (2 m + 1,) at the half steps; `force` (m, 3) with it at begin, middle and end of the steps; `low`, `high`
    (m,) bound the parabola through the three values of a step; `push` (m, 2) is the forcing's contribution to angle and
    velocity over a step. `particular`, `scratch` (TERMS,) are room for a `Segment`.
    """

    noise: np.ndarray
    force: np.ndarray
    low: np.ndarray
    high: np.ndarray
    push: np.ndarray
    particular: np.ndarray
    scratch: np.ndarray


def problem_of(scene, steps_per_cycle, times=None):
    """Return the `Problem` of a scene with band noise or none; a realization does not depend on `times`."""
    grid = grid_of(scene, scene.forcing.time_scale / steps_per_cycle, times)
    return Problem(
        scene.block.restitution,
        scene.overturning.angle,
        grid.duration,
        start_numbers(scene.start),
        scene.forcing.stages(grid.spacing, grid.count),
        _strengths(scene.noise.envelope, grid),
        *band_numbers(scene, grid.duration),
        grid.marks,
    )


def _strengths(envelope, grid):
    """Return the envelope (n, 3) at the begin, the middle and the end of every step."""
    if envelope is None:
        return np.ones((grid.count, 3))
    places = np.arange(grid.count)[:, None] + np.array([0.0, 0.5, 1.0])
    return envelope.value(grid.spacing * places)


@kernel
def _room(length):
    """Make room for a chunk of at most `length` steps."""
    return Chunk(
        np.empty(2 * length + 1),
        np.empty((length, 3)),
        np.empty(length),
        np.empty(length),
        np.empty((length, 2)),
        np.zeros(TERMS),
        np.empty(TERMS),
    )


@kernel(fastmath={"contract"})
def _tabulate(chunk, steps, h):
    """Work out what the forcing of a chunk does in each step, and its bounds."""
    for j in range(steps):
        begin, middle, end = chunk.force[j, 0], chunk.force[j, 1], chunk.force[j, 2]
        bend = 0.125 * abs(begin - 2.0 * middle + end)
        chunk.low[j] = min(begin, middle, end) - bend
        chunk.high[j] = max(begin, middle, end) + bend
        chunk.push[j, 0] = h * h * ((1.0 + 0.25 * h * h) * begin + 2.0 * middle) / 6.0
        chunk.push[j, 1] = h * ((1.0 + 0.5 * h * h) * begin + (4.0 + 0.5 * h * h) * middle + end) / 6.0


@kernel
def _resolve(x, v, side, chunk, j, until, h, problem, impacts=None, origin=0.0):
    """Follow the block to time `until` of step j, whose forcing is the parabola through its three values."""
    begin, middle, end = chunk.force[j, 0], chunk.force[j, 1], chunk.force[j, 2]
    slope = (4.0 * middle - 3.0 * begin - end) / h
    curvature = 4.0 * (begin - 2.0 * middle + end) / (h * h)
    # With f a parabola, P = -f - f'' solves P'' = P + f.
    chunk.particular[0] = -begin - curvature
    chunk.particular[1] = -slope
    chunk.particular[2] = -0.5 * curvature
    segment = segment_of(chunk.particular, chunk.scratch, h)
    return advance(x, v, side, segment, 0.0, until, problem.restitution, problem.cutoff, impacts, origin)


@kernel(fastmath={"contract"})
def _steps(x, v, side, chunk, first, last, h, problem, impacts, origin):
    """Take steps `first` to `last` - 1 of a chunk that begins at `origin`.

    Return x, v, side and the time since the chunk's begin, which is less than that of step `last` if it overturned.
    """
    keep, swap = 1.0 + h * h * (0.5 + h * h / 24.0), h * (1.0 + h * h / 6.0)
    side_x, side_v = h * h * (3.0 + 0.25 * h * h) / 6.0, swap
    half = 0.5 * h * h
    for j in range(first, last):
        if side != 0:
            u, w = side * x, side * v
            low, high = (chunk.low[j], chunk.high[j]) if side > 0 else (-chunk.high[j], -chunk.low[j])
            floor = u + h * w + half * min(0.0, low - 1.0)
            roof = u + h * w + half * max(0.0, problem.cutoff - 1.0 + high)
            x_next = keep * x + swap * v + chunk.push[j, 0] - side * side_x
            v_next = swap * x + keep * v + chunk.push[j, 1] - side * side_v
            if floor > 0.0 and roof < problem.cutoff and 0.0 < side * x_next < problem.cutoff:
                x, v = x_next, v_next
                continue
        elif max(chunk.high[j], -chunk.low[j]) < 1.0:
            continue
        x, v, side, time = _resolve(x, v, side, chunk, j, h, h, problem, impacts, origin + j * h)
        if abs(x) >= problem.cutoff:
            return x, v, side, j * h + time
    return x, v, side, last * h


@kernel(forceinline=True)  # see flight.next_event
def _run_chunk(x, v, side, chunk, first, steps, row, h, problem, angle, velocity, impacts, origin):
    """Take the block through a chunk of a cycle, from its step `first` on; write its samples from number `row` on.

    Return x, v, side, the time since the chunk's begin, and the number of the next sample. A sample within a step is
    a look aside: the step itself is taken whole.
    """
    done, rows = 0, problem.marks.size
    while True:
        place = (row - 1) % rows
        whole = int(problem.marks[place]) - first
        rest = problem.marks[place] - first - whole
        last = min(whole, steps)
        x, v, side, time = _steps(x, v, side, chunk, done, last, h, problem, impacts, origin)
        if abs(x) >= problem.cutoff or whole > steps or (whole == steps and rest > 0.0):
            return x, v, side, time, row
        done = last
        if rest == 0.0:
            angle[row], velocity[row] = x, v
        else:
            seen, speed, _, _ = _resolve(x, v, side, chunk, done, h * rest, h, problem)
            if abs(seen) < problem.cutoff:
                angle[row], velocity[row] = seen, speed
        row += 1
        if place == rows - 1:
            return x, v, side, time, row


@kernel
def _realize(stream, cycle, problem, angle, velocity, impacts):
    """Simulate one realization: fill its rows of states, return time (nan: never) and side of overturning."""
    n = problem.forcing.shape[0]
    h = problem.lap / n
    chunks = (n + CHUNK_STEPS - 1) // CHUNK_STEPS
    length = (n + chunks - 1) // chunks
    harmonics = noise.allocate(problem.harmonics, length)
    x, v = draw(stream, problem, harmonics)
    noise.prepare(harmonics, length, 0.5 / n)
    noise.set_rotation(harmonics.ratios, length / n, harmonics.hop[0], harmonics.hop[1])
    noise.set_rotation(harmonics.ratios, 1.0 - length * (chunks - 1) / n, harmonics.wrap[0], harmonics.wrap[1])
    chunk = _room(length)
    if abs(x) >= problem.cutoff:
        return cycle * problem.lap, (1 if x > 0.0 else -1)
    angle[0], velocity[0] = x, v
    side = 1 if x > 0.0 else -1
    if x == 0.0:
        side = side_at_zero(v, problem.forcing[0, 0] + problem.strength[0, 0] * noise.noise_at(harmonics, cycle, 0.0))
    row, fresh = 1, True
    while row < angle.size:
        for part in range(chunks):
            if fresh or (part == 0 and cycle % noise.ANCHOR_CYCLES == 0):
                noise.anchor(harmonics, cycle, 0.5 * length / n)
                fresh = False
            else:
                noise.rotate(harmonics, harmonics.wrap if part == 0 else harmonics.hop)
            first = part * length
            steps = min(length, n - first)
            chunk.noise[:] = 0.0
            noise.add_chunk(harmonics, length, chunk.noise)
            for j in range(steps):
                for i in range(3):
                    chunk.force[j, i] = problem.forcing[first + j, i]
                    chunk.force[j, i] += problem.strength[first + j, i] * chunk.noise[2 * j + i]
            _tabulate(chunk, steps, h)
            origin = cycle * problem.lap + first * h
            x, v, side, time, row = _run_chunk(
                x, v, side, chunk, first, steps, row, h, problem, angle, velocity, impacts, origin
            )
            if abs(x) >= problem.cutoff:
                return origin + time, side
            if row == angle.size:
                break
        cycle += 1
    return math.nan, 0


@kernel(parallel=True)
def realize(keys, first, cycle, problem, angle, velocity, overturn_time, overturn_side, impacts):
    """Simulate realizations in parallel; see `montecarlo.engines.Engine`."""
    for r in prange(angle.shape[0]):
        stream = open_stream(keys, first + r)
        hits = Impacts(impacts.count[r : r + 1], impacts.time[r], impacts.velocity[r])
        overturn_time[r], overturn_side[r] = _realize(stream, cycle, problem, angle[r], velocity[r], hits)
