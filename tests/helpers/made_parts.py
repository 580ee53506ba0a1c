"""What all made results share: scenes, times, a mesh, and what stands beside a result."""

import math
from typing import Any, NamedTuple

import numpy as np

from fpk_rocking import BandNoise, Block, Harmonic, Pulse, Scene, WhiteNoise
from fpk_rocking.density.space import Space

CYCLES, PATHS = 150, 400
MAIN = Scene(Block(0.5), Harmonic(4.6, 2.7, math.pi), BandNoise(0.04, (0.0, 10.0), 100))
WHITE = MAIN.varied(noise=WhiteNoise(0.006))
PULSE = WHITE.varied(forcing=Pulse("one-sine", 1.5, 1.1))
WHOLE = MAIN.period * np.arange(CYCLES + 1)
UNEVEN = np.append(0.0, np.cumsum(np.random.default_rng(0).uniform(0.01, 0.2, CYCLES)))
SPACE = Space(np.array([-1.6, -0.7, 0.0, 0.4, 1.6]), np.array([-3.0, -1.1, 0.0, 0.8, 3.2]), 1)


class Made(NamedTuple):
    """A result; what `table` has to return; and what `dataset` has to: (dimensions, array) by name, and coordinates."""

    result: Any
    columns: dict
    variables: dict
    places: dict


def wilson(share, size):
    """Wilson's limits (n, 2) at 95 %: the roots c of (share - c)² = z² c (1 - c)/size."""
    z = 1.959963984540054**2 / size
    roots = [np.sort(np.roots([1.0 + z, -2.0 * p - z, p * p]).real) for p in share]
    return np.array(
        [[0.0 if p == 0.0 else low, 1.0 if p == 1.0 else high] for p, (low, high) in zip(share, roots, strict=True)]
    )
