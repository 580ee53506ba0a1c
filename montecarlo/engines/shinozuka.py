"""A realization of Shinozuka noise and of the start, from its stream of random numbers; shared by the band engines."""

import math

from fpk_rocking.base.jit import kernel
from montecarlo.engines.random import uniform_pairs
from montecarlo.engines.start import draw_start


def band_numbers(scene, lap):
    """Return lowest frequency and width of the band in turns per lap, amplitude and number of the harmonics."""
    if scene.noise.kind != "band":
        return 0.0, 0.0, 0.0, 0
    low, high = (frequency * lap / (2.0 * math.pi) for frequency in scene.noise.band)
    return low, high - low, math.sqrt(2.0 * scene.noise.variance / scene.noise.harmonics), scene.noise.harmonics


@kernel
def draw(stream, problem, harmonics):
    """Draw the start and the noise of one realization; the start comes first.

    Of the problem `start` (5,), `band_low`, `band_width`, `weight` and `harmonics` are used, of the harmonics `ratios`,
    `phases` and `weights` written.
    """
    angle, velocity = draw_start(stream, problem.start)
    uniform_pairs(stream, harmonics.ratios, harmonics.phases, problem.harmonics)
    for n in range(problem.harmonics):
        harmonics.ratios[n] = problem.band_low + problem.band_width * harmonics.ratios[n]
        harmonics.weights[n] = problem.weight
    return angle, velocity
