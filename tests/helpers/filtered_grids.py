"""A scene under filtered noise and its discretizations, for tests of the density and of rest."""

import math
import pathlib

import numpy as np

from fpk_rocking import Block, FilteredNoise, Harmonic, Scene
from fpk_rocking.density.filter_nodes import FilteredDiscretization
from fpk_rocking.density.resolution import RESOLUTIONS, explore
from fpk_rocking.density.space import velocity_bound

SCENES = pathlib.Path(__file__).parents[2] / "cases" / "scenes"
EDGES = np.linspace(-1.6, 1.6, 9), np.linspace(-4.0, 4.0, 9)
MAIN = Scene(Block(0.5), Harmonic(4.6, 2.7, math.pi), FilteredNoise("exponential", 0.04, 6.25))


def grid_of(scene, number, nodes, steps, points=8):
    white, times = scene.white_equivalent(), scene.period * np.arange(5)
    plane = RESOLUTIONS[number].adapted(white, velocity_bound(white, white.noise.diffusion), explore(white, times))
    return FilteredDiscretization(plane, nodes, points, even_time_grid(scene, steps))


def even_time_grid(scene, steps):
    periods = 2 if scene.forcing.half_antisymmetric else 1
    return np.linspace(0.0, 1.0 / periods, steps // periods + 1)
