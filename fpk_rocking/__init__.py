"""Rocking of a rigid block under periodic and random shaking: the probability density of its motion, and overturning.

``Scene`` or ``load_scene`` states a problem, and ``solve_fpk`` solves its Fokker-Planck equation for the joint density
of angle and velocity. The package ``montecarlo`` has independent Monte Carlo engines, ``fpk_rocking.studies``
has sweeps, ``fpk_rocking.risk`` curves over the strength of ground motions and annual rates.
"""

import importlib

__all__ = [
    "BandNoise",
    "Block",
    "Body",
    "CloughPenzien",
    "CycleOperator",
    "Dimensions",
    "Evolution",
    "Filter",
    "FilteredNoise",
    "Forcing",
    "Harmonic",
    "Harmonics",
    "LinearFilter",
    "NoNoise",
    "Overturning",
    "Pulse",
    "Record",
    "Scene",
    "Start",
    "StateSpace",
    "WhiteNoise",
    "load_scene",
    "melnikov",
    "probability",
    "solve_fpk",
]

# Everything is loaded on first use: the density solver brings the compiler, and even a scene brings numpy.
_LAZY = dict.fromkeys(__all__, "fpk_rocking.scene")
_LAZY |= dict.fromkeys(("solve_fpk", "Evolution"), "fpk_rocking.density")
_LAZY |= {"CycleOperator": "fpk_rocking.horizon", "melnikov": "fpk_rocking.analytics"}
_LAZY |= {"probability": "fpk_rocking.studies.probability"}


def __getattr__(name):
    if name in _LAZY:
        module = importlib.import_module(_LAZY[name])
        return importlib.import_module(f"{_LAZY[name]}.{name}") if name == "melnikov" else getattr(module, name)
    if name == "__version__":
        return importlib.import_module("importlib.metadata").version("fpk-rocking")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__():
    return sorted({*globals(), *_LAZY, "__version__"})
