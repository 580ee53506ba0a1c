"""What a cell of a sweep does by name: the engines' verbs, with results reduced to a row."""

import math

import numpy as np

from fpk_rocking.density import solve_fpk
from montecarlo import simulate
from montecarlo.engines.running import ENGINES


def mc(scene, *, seed, **options):
    """Survival after each cycle of `montecarlo.simulate`, with the count of those that stand and the verdict."""
    result = simulate(scene, seed=seed, **options)
    return {
        "survival": result.survival.tolist(),
        "survivors": int(result.survivors[-1]),
        "realizations": result.realizations,
        "method": result.method,
        "trust": result.trust.verdict,
    }


def fpk(scene, *, seed, **options):  # noqa: ARG001  (a verb has a seed; a density has no use for it)
    """Survival after each cycle of `fpk_rocking.solve_fpk`, its errors and the verdict; not refined for bins."""
    result = solve_fpk(scene, **{"bins_tol": math.inf} | options)
    return {
        "survival": np.asarray(result.survival).tolist(),
        "error_estimate": result.error_estimate,
        "mass_defect": result.mass_defect,
        "negative_mass": result.negative_mass,
        "closure": result.closure,
        "trust": result.trust.verdict,
    }


VERBS = {"mc": mc, "fpk": fpk}
"""Verbs of a sweep by name."""


def engine_of(scene):
    """Return the Monte Carlo method that fits the noise of a scene: the default of `simulate`."""
    return next(name for name, engine in ENGINES.items() if scene.noise.kind in engine.NOISES)


def tasks_of(verb, cells, options):
    """Return the tasks of `base.ahead` that compile what a verb of `VERBS` needs for these cells."""
    if verb is fpk:
        return ["fpk_rocking.density.ahead:solve"]
    if verb is mc:
        methods = {options.get("method") or engine_of(cell.scene) for cell in cells}
        return [f"montecarlo.ahead:{method}" for method in sorted(methods & ENGINES.keys())]
    return []
