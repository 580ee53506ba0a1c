"""What a cell of a sweep does by name: the engines' verbs, with results reduced to a row."""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from fpk_rocking.density import solve_fpk
from fpk_rocking.density.ahead import tasks_of_density
from fpk_rocking.scene.scene import Scene
from fpk_rocking.studies.execution.cells import Cell
from montecarlo import simulate
from montecarlo.engines.choice import fitting, task_of


def mc(scene: Scene, *, seed: int, **options: Any) -> dict[str, Any]:
    """Survival after each cycle of `montecarlo.simulate`, with the count of those that stand and the verdict."""
    result = simulate(scene, seed=seed, **options)
    return {
        "survival": result.survival.tolist(),
        "survivors": int(result.survivors[-1]),
        "realizations": result.realizations,
        "method": result.method,
        "trust": result.trust.verdict,
    }


def fpk(scene: Scene, *, seed: int, **options: Any) -> dict[str, Any]:  # noqa: ARG001  (a verb has a seed; a density has no use for it)
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


def tasks_of(verb: Callable[..., Any], cells: Sequence[Cell], options: dict[str, Any]) -> list[str]:
    """Return the tasks of `base.ahead` that compile what a verb of `VERBS` needs for these cells."""
    found: set[str] = set()
    for cell in cells:
        if verb is mc:
            found.update(task_of(engine, cell.scene) for engine in fitting(cell.scene, options.get("method"))[:1])
        elif verb is fpk:
            found.update(tasks_of_density(cell.scene, options.get("noise_replacement")))
    return sorted(found)
