"""Kinds of filtered noise, and scenes with them."""

import math

from fpk_rocking import CloughPenzien, FilteredNoise, LinearFilter, Start
from fpk_rocking.scene import Block, Harmonic, Scene

LOW_PASS = FilteredNoise("low-pass", 0.04, 9.0, math.sqrt(0.5))
NOISES = [
    LOW_PASS,
    FilteredNoise("exponential", 0.04, 5.0),
    FilteredNoise("kanai-tajimi", 0.04, 9.0, 0.6),
    FilteredNoise("kanai-tajimi", 0.04, 3.0, 2.0),
]


def soil_noise(low_frequency, low_damping):
    return FilteredNoise(CloughPenzien(9.0, 0.6, low_frequency, low_damping), 0.04)


SOIL = soil_noise(1.5, 0.4)
# (d + 5)(d² + 5 d + 25) η = w: noise with a derivative, from three states.
THIRD = FilteredNoise(LinearFilter([[0, 1, 0], [0, 0, 1], [-125, -50, -10]], [0, 0, 1], [1, 0, 0]), 0.04)


def scene_of(noise, amplitude=4.6, frequency=2.7, restitution=0.5, start=None):
    return Scene(Block(restitution), Harmonic(amplitude, frequency, math.pi), noise, start or Start())
