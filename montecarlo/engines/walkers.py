"""White-noise paths that branch, and their score: how near to the moving separatrix a block will come without noise.

In the folded plane, u = s x >= 0 and w = s v, a flight has the separatrix z = 0, z = u + w - 1 - s (P + P')
(docs/theory section 7): z grows as exp(t), away from 0, so only an impact can bring a block from z < 0 nearer to
escape. The score of a state is the largest of its own z and of those right after the impacts of its motion without
noise within the next 7 units of time: only the noise raises it along a path. It is tabulated over angle, velocity and
phase; a rough score costs accuracy and never brings bias. An exact block takes the same z, to which its own separatrix
tends near the saddle. Everything is nondimensional.

A walker follows one path; its score is the highest along the path, infinite once the rare event has happened. Again and
again the lowest score among the n walkers becomes the *level*: all walkers at or below it are killed, K of them, and
each is replaced by a branch of a surviving path, drawn at random, from its first state strictly above the level. The
weight, at first 1, takes the factor 1 - K/n. When every score is infinite, weight x (share of the walkers with some
property of their paths) is an unbiased estimate of the probability of the rare event with that property, for any number
of walkers and any score; where all walkers are killed at once, the estimate is 0. Paths that share states have ties,
and those have to be killed together (C.-E. Brehier, M. Gazeau, L. Goudenege, T. Lelievre, M. Rousset, Ann. Appl.
Probab. 26, 3559-3601, 2016; the algorithm: F. Cerou, A. Guyader, Stoch. Anal. Appl. 25, 417-443, 2007).

Of a path only its records are kept, the states at which the score was higher than ever before: no other can be the
first above a level.
"""

import functools
import math
from typing import NamedTuple

import numpy as np

from fpk_rocking.base.arrays import borrowed, own
from fpk_rocking.base.jit import kernel, run_in_parts
from fpk_rocking.physics.motion.equation import (
    KernelBlock,
    Segment,
    block_of_scene,
    restitution_from,
    saddle,
)
from fpk_rocking.physics.motion.events import Event, next_event
from fpk_rocking.physics.motion.flight import unstable_coordinate
from fpk_rocking.physics.motion.impact import velocity_after_impact
from montecarlo.engines.random import draw_start, open_stream, uniform
from montecarlo.engines.white import first_side, segment_at, segments_of, step_interval
from montecarlo.tuning import TUNING


class Population(NamedTuple):
    """Walkers and the records of their paths, in the order of time."""

    score: np.ndarray  # (walkers, steps + 1)
    step: np.ndarray  # (walkers, steps + 1)
    state: np.ndarray  # (walkers, steps + 1, 3): (u, w, side)
    records: np.ndarray  # (walkers,): how many of them
    unfinished: np.ndarray  # (walkers,): paths that wait for continuation from their last record
    weight: np.ndarray  # (1,)
    levels: np.ndarray  # (1,), counted so far
    killed: np.ndarray  # (1,)


@kernel
def allocate_population(walkers, steps):
    return Population(
        np.empty((walkers, steps + 1)),
        np.empty((walkers, steps + 1), np.int64),
        np.empty((walkers, steps + 1, 3)),
        np.zeros(walkers, np.int64),
        np.ones(walkers, np.bool_),
        np.ones(1),
        np.zeros(1, np.int64),
        np.zeros(1, np.int64),
    )


@kernel
def record_score(population, i, score, step, a, b, c):
    """Record the state of walker i at a `step`, if the `score` is the highest along its path so far."""
    k = population.records[i]
    if k == 0 or score > population.score[i, k - 1]:
        population.score[i, k], population.step[i, k] = score, step
        population.state[i, k, 0], population.state[i, k, 1], population.state[i, k, 2] = a, b, c
        population.records[i] = k + 1


@kernel
def raise_level(population, stream):
    """Kill all walkers at the lowest score and branch survivors in their place; return whether the chain goes on."""
    walkers = population.records.size
    level = math.inf
    for i in range(walkers):
        level = min(level, population.score[i, population.records[i] - 1])
    if level == math.inf:
        return False
    survivors, count = np.empty(walkers, np.int64), 0
    for i in range(walkers):
        population.unfinished[i] = population.score[i, population.records[i] - 1] <= level
        if not population.unfinished[i]:
            survivors[count] = i
            count += 1
    population.weight[0] *= count / walkers
    population.levels[0] += 1
    population.killed[0] += walkers - count
    if count > 0:
        for i in range(walkers):
            if population.unfinished[i]:
                _branch(population, i, survivors[int(uniform(stream) * count)], level)
    return count > 0


@kernel
def _branch(population, i, parent, level):
    """Begin walker i anew: its records become the first state of walker `parent` above `level`."""
    k = 0
    while population.score[parent, k] <= level:
        k += 1
    state = population.state[parent, k]
    population.records[i] = 0
    record_score(population, i, population.score[parent, k], population.step[parent, k], state[0], state[1], state[2])


class NoiselessForcing(NamedTuple):
    """The forcing from each of m equally spaced times of a cycle on, for motion without noise."""

    segments: Segment  # of `white.segments_of`
    duration: float  # of a segment
    stride: int  # times from one segment to the next
    count: int  # segments that a path is followed for
    block: KernelBlock


class ScoreTable(NamedTuple):
    """The score over times, sides, angles and velocities."""

    table: np.ndarray  # (m, 2, n_angle, n_velocity): u up to the cut-off, w to ±`fastest`
    fastest: float
    per_angle: float
    per_velocity: float


@functools.lru_cache(maxsize=1)
def score_table(scene, intervals):
    """Return the `ScoreTable` of a scene with white noise, at the beginnings of `intervals` equal parts of a cycle."""
    cutoff, span = scene.overturning.angle, scene.period / intervals
    # No faster block falls back, nor comes in from a fall (docs/theory section 7).
    fastest = 1.0 + scene.forcing.swing + 8.0 * math.sqrt(scene.noise.diffusion)
    # Segments as long as their polynomials are good to 1e-6.
    stride = max(1, int(min(0.8, scene.forcing.longest_piece) / span))
    duration = stride * span
    segments = segments_of(scene.forcing.pieces(np.arange(intervals) * span), duration)
    count = math.ceil(TUNING.foresight / duration)
    forcing = NoiselessForcing(segments, duration, stride, count, block_of_scene(scene))
    table = np.empty((intervals, 2, TUNING.score_angles, TUNING.score_velocities), np.float32)
    run_in_parts(_write_scores, math.prod(table.shape[:3]), table, forcing, fastest)
    angles, velocities = table.shape[2:]
    return ScoreTable(table, fastest, (angles - 1) / cutoff, (velocities - 1) / (2.0 * fastest))


@kernel(inline="always")
def _distance(u, w, side, particular, t, block):
    """Return z = u + w - m - s (P + P') at t, the distance from the separatrix; above 0 the block escapes."""
    return unstable_coordinate(u + (1.0 - saddle(side, block)), w, side, particular, t)


@kernel
def _follow(u, w, side, j, forcing):
    """Return the score of a state at the j-th time: the largest z of its path without noise, now and after impacts."""
    best = _distance(u, w, side, forcing.segments.particular[j], 0.0, forcing.block)
    x, v = side * u, side * w
    for _ in range(forcing.count):
        segment = segment_at(forcing.segments, j)
        t = 0.0
        while t < forcing.duration and best <= 0.0:
            kind, t, x, v = next_event(x, v, side, segment, t, forcing.duration, forcing.block)
            # A slower impact counts as the last one, before rest: a rough score costs accuracy, not bias.
            if kind == Event.OVERTURNING or (kind == Event.IMPACT and abs(v) < 1e-3):
                return best
            if kind == Event.IMPACT:
                v, side = velocity_after_impact(v, restitution_from(side, forcing.block)), -side
                best = max(best, _distance(0.0, side * v, side, segment.particular, t, forcing.block))
        j = (j + forcing.stride) % forcing.segments.force.shape[0]
    return best


@kernel
def _write_scores(begin, end, table, forcing, fastest):
    """Write the scores in rows `begin` up to `end` of `table`, counted over time, side and folded angle."""
    _, sides, angles, velocities = table.shape
    for row in range(begin, end):
        j, k, a = row // (sides * angles), (row // angles) % sides, row % angles
        u = forcing.block.cutoff * a / (angles - 1)
        for b in range(velocities):
            w = fastest * (2.0 * b / (velocities - 1) - 1.0)
            table[j, k, a, b] = _follow(u, w, 2 * k - 1, j, forcing)


@kernel
def score_of_state(u, w, side, j, scores):
    """Return the score of a state at the j-th time, bilinear between the table's nodes, constant beyond."""
    table = scores.table[j, (side + 1) // 2]
    a = min(max(u * scores.per_angle, 0.0), table.shape[0] - 1.0)
    b = min(max((w + scores.fastest) * scores.per_velocity, 0.0), table.shape[1] - 1.0)
    i, k = min(int(a), table.shape[0] - 2), min(int(b), table.shape[1] - 2)
    a, b = a - i, b - k
    near = (1.0 - b) * table[i, k] + b * table[i, k + 1]
    far = (1.0 - b) * table[i + 1, k] + b * table[i + 1, k + 1]
    return (1.0 - a) * near + a * far


@kernel
def _begin_walker(stream, i, population, parameters, scores):
    """Draw the start of walker i and record it; its score is inf where it starts overturned."""
    x, v = draw_start(stream, parameters.start)
    side = first_side(x, v, parameters)
    score = math.inf if side * x >= parameters.block.cutoff else score_of_state(side * x, side * v, side, 0, scores)
    record_score(population, i, score, 0, side * x, side * v, side)


@kernel
def _continue_walker(stream, i, population, steps, parameters, scores):
    """Take walker i from its last record to overturning or to step number `steps`, and record it."""
    k = population.records[i] - 1
    step, state = population.step[i, k], population.state[i, k]
    u, w, side = state[0], state[1], int(state[2])
    intervals = parameters.grid.count
    while step < steps and u < parameters.block.cutoff:
        u, w, side, _ = step_interval(stream, u, w, side, step % intervals, parameters)
        step += 1
        score = math.inf if u >= parameters.block.cutoff else score_of_state(u, w, side, step % intervals, scores)
        record_score(population, i, score, step, u, w, side)


@kernel
def simulate_splitting(repeat, keys, walkers, parameters, scores, overturned):
    """Run one splitting, add its probabilities to `overturned`; return the levels passed and the walkers killed."""
    # A count of references would cost more than the steps.
    keys, parameters, scores, overturned = borrowed((keys, parameters, scores, overturned))
    intervals = parameters.grid.count
    steps = (overturned.shape[0] - 1) * intervals
    owned = allocate_population(walkers, steps)
    population = borrowed(owned)
    # No two paths share a stream, nor one with a realization of an ensemble: those have the numbers below 2^32.
    name = (repeat + 1) << 32
    own_chooser = open_stream(keys, name)
    chooser = borrowed(own_chooser)
    for i in range(walkers):
        _begin_walker(chooser, i, population, parameters, scores)
    while True:
        for i in range(walkers):
            if population.unfinished[i]:
                name += 1
                stream = open_stream(keys, name)
                _continue_walker(borrowed(stream), i, population, steps, parameters, scores)
                own(stream)
        if not raise_level(population, chooser):
            break
    if population.weight[0] > 0.0:
        for i in range(walkers):
            k = population.records[i] - 1
            side = int(population.state[i, k, 2])
            for cycle in range(-(-population.step[i, k] // intervals), overturned.shape[0]):
                overturned[cycle, (side + 1) // 2] += population.weight[0] / walkers
    counts = population.levels[0], population.killed[0]
    own((owned, own_chooser))
    return counts
