"""Adaptive multilevel splitting of any chain of states with a score: walkers, levels, killings and branches.

A walker follows one path; its score is the highest along the path, infinite once the rare event has happened. Again and
again the lowest score among the n walkers becomes the *level*: all walkers at or below it are killed, K of them, and
each is replaced by a branch of a surviving path, drawn at random, from its first state strictly above the level. The
weight, at first 1, takes the factor 1 - K/n. When every score is infinite, weight x (share of the walkers with some
property of their paths) is an unbiased estimate of the probability of the rare event with that property, for any number
of walkers and any score; where all walkers are killed at once, the estimate is 0. Paths that share states have ties,
and those have to be killed together (C.-E. Brehier, M. Gazeau, L. Goudenege, T. Lelievre, M. Rousset, Ann. Appl.
Probab. 26, 3559-3601, 2016; the algorithm: F. Cerou, A. Guyader, Stoch. Anal. Appl. 25, 417-443, 2007).

Of a path only its records are kept, the states at which the score was higher than ever before: no other can be the
first above a level. The chain is the caller's, who begins every path (`record_score` of its state at step 0) and then
in turn continues the paths of the walkers that are `unfinished` (`record_score` of each state) and calls `raise_level`,
until that returns False.
"""

import math
from typing import NamedTuple

import numpy as np

from fpk_rocking.base.jit import kernel
from montecarlo.engines.random import uniform


class Population(NamedTuple):
    """Walkers and the records of their paths.

    `score`, `step` (walkers, steps + 1) and `state` (walkers, steps + 1, 3): records in the order of time, `records`
    (walkers,) of them. `unfinished` (walkers,): paths that wait for continuation from their last record. `weight` (1,).
    `levels`, `killed` (1,): counts so far.
    """

    score: np.ndarray
    step: np.ndarray
    state: np.ndarray
    records: np.ndarray
    unfinished: np.ndarray
    weight: np.ndarray
    levels: np.ndarray
    killed: np.ndarray


@kernel
def allocate_population(walkers, steps):
    """Return a `Population` of walkers without a record, for paths of so many steps; memory is touched as it fills."""
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
    """Record the state (a, b, c) of walker i at a `step`, if its score is the highest along its path so far.

    `population`: the `Population` that is written to.
    """
    k = population.records[i]
    if k == 0 or score > population.score[i, k - 1]:
        population.score[i, k], population.step[i, k] = score, step
        population.state[i, k, 0], population.state[i, k, 1], population.state[i, k, 2] = a, b, c
        population.records[i] = k + 1


@kernel
def raise_level(population, stream):
    """Kill all walkers of a `Population` at the lowest score and branch survivors in their place.

    `stream` draws the survivors. Return False if every score is infinite, or no walker survives.
    """
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
    """Begin walker i of a `Population` anew at the first state above the `level` (a score) of walker `parent`."""
    k = 0
    while population.score[parent, k] <= level:
        k += 1
    state = population.state[parent, k]
    population.records[i] = 0
    record_score(population, i, population.score[parent, k], population.step[parent, k], state[0], state[1], state[2])
