"""A realization of Shinozuka noise and of the start, from its stream of random numbers; shared by the band engines."""

import math
from typing import NamedTuple

from fpk_rocking.base.jit import kernel
from montecarlo.engines.random import uniform_pairs
from montecarlo.engines.start import draw_start


class Band(NamedTuple):
    """Lowest frequency and width of the band in turns per lap; amplitude and number of the harmonics."""

    low_ratio: float
    ratio_width: float
    weight: float
    harmonics: int


def band_of(scene, lap):
    """Return the `Band` of a scene; without noise it has no harmonics."""
    if scene.noise.kind != "band":
        return Band(0.0, 0.0, 0.0, 0)
    low, high = (frequency * lap / (2.0 * math.pi) for frequency in scene.noise.band)
    weight = math.sqrt(2.0 * scene.noise.variance / scene.noise.harmonics)
    return Band(low, high - low, weight, scene.noise.harmonics)


@kernel
def draw_band(stream, problem, harmonics):
    """Draw the start and the noise of one realization; the start comes first.

    Of the problem `start` and what is in a `Band` are used. Of the harmonics `ratios`, `phases` and `weights` are
    written.
    """
    angle, velocity = draw_start(stream, problem.start)
    uniform_pairs(stream, harmonics.ratios, harmonics.phases, problem.harmonics)
    for n in range(problem.harmonics):
        harmonics.ratios[n] = problem.low_ratio + problem.ratio_width * harmonics.ratios[n]
        harmonics.weights[n] = problem.weight
    return angle, velocity


@kernel(inline="always")
def draw(stream, problem, room):
    """Draw the start and the noise of one realization into a room with `harmonics`."""
    return draw_band(stream, problem, room.harmonics)
