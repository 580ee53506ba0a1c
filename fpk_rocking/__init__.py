"""Noisy periodic rocking of a rigid block: probability densities by finite elements, beside Monte Carlo.

``load_scene`` or ``Scene`` states a problem and ``solve_fpk`` evolves its probability density; the independent Monte
Carlo engines are in the package ``montecarlo``.
"""

import importlib

from fpk_rocking.analytics import melnikov
from fpk_rocking.scene import (
    BandNoise,
    Block,
    Dimensions,
    FilteredNoise,
    Forcing,
    Harmonics,
    NoNoise,
    Overturning,
    Scene,
    Start,
    WhiteNoise,
    load_scene,
)

# The density solver brings the compiler and the finite-element library: loaded on first use.
_LAZY = dict.fromkeys(("solve_fpk", "solve_realizations", "Evolution"), "fpk_rocking.density")
_LAZY |= {"CycleOperator": "fpk_rocking.horizon"}

__all__ = [
    "BandNoise",
    "Block",
    "CycleOperator",
    "Dimensions",
    "Evolution",
    "FilteredNoise",
    "Forcing",
    "Harmonics",
    "NoNoise",
    "Overturning",
    "Scene",
    "Start",
    "WhiteNoise",
    "load_scene",
    "melnikov",
    "solve_fpk",
    "solve_realizations",
]


def __getattr__(name):
    if name in _LAZY:
        return getattr(importlib.import_module(_LAZY[name]), name)
    if name == "__version__":
        return importlib.import_module("importlib.metadata").version("fpk-rocking")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__():
    return sorted({*globals(), *_LAZY, "__version__"})
