"""Histories under white noise by parameters of the engine that no user can choose."""

import types

import numpy as np

from montecarlo.engines import white
from montecarlo.engines.batches import checked_run, simulate_batches
from montecarlo.simulation import impacts_of

CAPACITY = 4000


def white_histories(scene, *, cycles=1, realizations, seed, steps_per_cycle=200, samples_per_cycle=1, **changes):
    """As `montecarlo.histories`, with `changes` of the engine's parameters; at most 4000 impacts on a path."""
    run = checked_run(scene, cycles, realizations, seed, "white", steps_per_cycle)
    times = scene.period * np.arange(1, samples_per_cycle + 1) / samples_per_cycle
    parameters = white.parameters_of(scene, steps_per_cycle, times)._replace(**changes)
    names = "angle", "velocity", "impact_realization", "impact_time", "impact_velocity"
    parts = []
    for batch in simulate_batches(run, samples=samples_per_cycle, capacity=CAPACITY, parameters=parameters):
        assert batch.impacts.count.max() <= CAPACITY
        parts.append((batch.angle, batch.velocity, *impacts_of(batch)))
    return types.SimpleNamespace(**dict(zip(names, map(np.concatenate, zip(*parts, strict=True)), strict=True)))
