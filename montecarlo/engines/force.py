"""The force on the realizations of a run at given times, which paths do not keep: their noise is drawn again."""

import math
from typing import NamedTuple

import numpy as np

from fpk_rocking.base.jit import kernel
from montecarlo.engines import filtered
from montecarlo.engines.random import open_stream, stream_keys
from montecarlo.engines.shinozuka import band_of, draw_band
from montecarlo.engines.start import draw_start, start_numbers


def forces_of(scene, seed, count, steps_per_cycle, times):
    """Return the force (count, n) at times (n,) on the realizations 0, 1, ... of a scene without white noise."""
    noise = scene.noise
    force = np.tile([scene.forcing.value(time) for time in times.tolist()], (count, 1))
    if noise.kind == "none":
        return force
    draw = _of_band if noise.kind == "band" else _of_filter
    strength = 1.0 if noise.envelope is None else noise.envelope.value(times)
    return force + strength * draw(scene, seed, count, steps_per_cycle, times)


class _Drawn(NamedTuple):
    """What `draw_band` needs and writes, of one realization."""

    start: np.ndarray
    low_ratio: float
    ratio_width: float
    weight: float
    harmonics: int
    ratios: np.ndarray
    phases: np.ndarray
    weights: np.ndarray


def _of_band(scene, seed, count, _, times):
    """Return band noise, less its envelope: the sum of its harmonics."""
    keys, values, band = stream_keys(seed), np.empty((count, times.size)), band_of(scene, 2.0 * math.pi)
    for number in range(count):
        drawn = _Drawn(start_numbers(scene.start), *band, *np.empty((3, band.harmonics)))
        draw_band(open_stream(keys, number), drawn, drawn)
        values[number] = np.cos(np.outer(times, drawn.ratios) + 2.0 * math.pi * drawn.phases) @ drawn.weights
    return values


def _of_filter(scene, seed, count, steps_per_cycle, times):
    """Return filtered noise, less its envelope: that of the engine, a polynomial in each of its intervals."""
    problem = filtered.problem_of(scene, steps_per_cycle, None if scene.repeats else times[1:])
    values = np.empty((count, times.size))
    _follow(stream_keys(seed), problem, times / problem.spacing, values)
    return values


@kernel
def _follow(keys, problem, places, values):
    """Write the noise (count, n) at places (n,), ascending, in intervals."""
    room = filtered.room_of(problem)
    for realization in range(values.shape[0]):
        stream, drawn = open_stream(keys, realization), -1
        draw_start(stream, problem.start)
        filtered.begin_noise(stream, problem, room)
        for k in range(places.size):
            number = int(places[k])
            while drawn < number:
                filtered.draw_noise(stream, problem, room)
                drawn += 1
            filtered.bound_noise(number % problem.count, problem, room)
            share, row = places[k] - number, room.bernstein
            for last in range(row.size - 1, 0, -1):
                for i in range(last):
                    row[i] += share * (row[i + 1] - row[i])
            values[realization, k] = row[0]
