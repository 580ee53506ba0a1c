"""White-noise paths that branch: the kernels of `montecarlo.rare.splitting`. Everything is nondimensional."""

import math

from fpk_rocking.base.jit import kernel
from montecarlo.engines.random import open_stream
from montecarlo.engines.start import draw_start
from montecarlo.engines.white import first_side, interval
from montecarlo.rare.levels import climb, populate, raise_level
from montecarlo.rare.prospects import prospect


@kernel
def _begin(stream, i, population, problem, prospects):
    x, v = draw_start(stream, problem.start)
    side = first_side(x, v, problem)
    score = math.inf if side * x >= problem.cutoff else prospect(side * x, side * v, side, 0, prospects)
    climb(population, i, score, 0, side * x, side * v, side)


@kernel
def _continue(stream, i, population, steps, problem, prospects):
    """Take walker i from its last record to overturning or to the last step."""
    k = population.records[i] - 1
    step, state = population.step[i, k], population.state[i, k]
    u, w, side = state[0], state[1], int(state[2])
    intervals = problem.count
    while step < steps and u < problem.cutoff:
        u, w, side, _ = interval(stream, u, w, side, step % intervals, problem)
        step += 1
        score = math.inf if u >= problem.cutoff else prospect(u, w, side, step % intervals, prospects)
        climb(population, i, score, step, u, w, side)


@kernel(nogil=True)
def realize(repeat, keys, walkers, problem, prospects, overturned):
    """Run one splitting, its random numbers a function of the keys, its number among the repeats and the walkers.

    Adds its estimates to `overturned` (cycles + 1, 2) zeros; returns the numbers of levels and of killed walkers.
    """
    intervals = problem.count
    steps = (overturned.shape[0] - 1) * intervals
    population = populate(walkers, steps)
    # No two paths share a stream, nor one with a realization of an ensemble: those have the numbers below 2^32.
    name = (repeat + 1) << 32
    chooser = open_stream(keys, name)
    for i in range(walkers):
        _begin(chooser, i, population, problem, prospects)
    while True:
        for i in range(walkers):
            if population.unfinished[i]:
                name += 1
                _continue(open_stream(keys, name), i, population, steps, problem, prospects)
        if not raise_level(population, chooser):
            break
    if population.weight[0] > 0.0:
        for i in range(walkers):
            k = population.records[i] - 1
            side = int(population.state[i, k, 2])
            for cycle in range(-(-population.step[i, k] // intervals), overturned.shape[0]):
                overturned[cycle, (side + 1) // 2] += population.weight[0] / walkers
    return population.levels[0], population.killed[0]
