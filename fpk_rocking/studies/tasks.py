"""What is computed of one scene: a sample, a density, a density with its check, and the cost of slenderness."""

import math
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import ArrayLike, Progress
from fpk_rocking.base.precompilation import Compilation
from fpk_rocking.density.evolution import Evolution
from fpk_rocking.density.filtered import REST
from fpk_rocking.density.solver import DENSITY, solve_fpk
from fpk_rocking.scene.least import kind_of
from fpk_rocking.scene.scene import Scene
from montecarlo.engines import engine_of, engines_for
from montecarlo.engines.batches import compilation_of
from montecarlo.simulation import simulate


def mc(scene: Scene, *, seed: int, **options: Any) -> dict[str, Any]:
    """Sample a scene by `montecarlo.simulate`, which takes the options; survival is a list by row."""
    result = simulate(scene, seed=seed, **options)
    return {
        "survival": result.survival.tolist(),
        "survivors": int(result.survivors[-1]),
        "realizations": result.realizations,
        "method": result.method,
        "trust": result.trust.verdict,
    }


def fpk(scene: Scene, *, seed: int, **options: Any) -> dict[str, Any]:  # noqa: ARG001  (every task takes a seed)
    """Solve a scene by `fpk_rocking.solve_fpk`, which takes the options, not refined for bins."""
    result = solve_fpk(scene, **{"bins_tol": math.inf} | options)
    return {
        "survival": np.asarray(result.survival).tolist(),
        "error_estimate": result.error_estimate,
        "mass_defect": result.mass_defect,
        "negative_mass": result.negative_mass,
        "noise_replacement": result.noise_replacement,
        "trust": result.trust.verdict,
    }


TASKS = {"mc": mc, "fpk": fpk}
"""Tasks of a sweep by name."""


def kernels_of(task: Callable[..., Any], scenes: Iterable[Scene], options: dict[str, Any]) -> list[Compilation]:
    """Compilations of the kernels that a task of `TASKS` needs for some scenes, sorted."""
    names: set[Compilation] = set()
    for scene in scenes:
        if task is mc:
            names.update(compilation_of(engine, scene) for engine in engines_for(scene, options.get("method"))[:1])
        elif task is fpk:
            replaced = scene.noise.kind == "band" and options.get("noise_replacement") != "white"
            filtered = replaced or scene.noise.kind == "filtered"
            tables = [DENSITY] + [REST] * filtered
            names.update(table[kind_of(scene.block)] for table in tables)
    return sorted(names)


CHECK_SEED, CHECK_PATHS = 2, 40_000
"""Seed of the paths of a check, not that of `simulate`, so that an ensemble beside a check is independent of it; and
their number: over ten cycles of 100 harmonics they take .1 to .7 s on two cores, longest where blocks rest."""


def checked(
    density: Evolution,
    *,
    realizations: int | None = None,
    seed: int = CHECK_SEED,
    beside: Any = None,
    progress: Progress | None = None,
) -> Evolution:
    """Return a density with its ``replacement``: the error by replacing the noise, measured by Monte Carlo paths.

    Parameters
    ----------
    density : Evolution
        A density whose noise was not replaced is returned unchanged.
    realizations : int, optional
        Number of paths. By default 40,000, or 10,000 for a record.
    seed : int
        Seed of the paths.
    beside : Ensemble or Tally, optional
        Used in place of new paths if it is for the same scene and has 40,000 or more.
    progress : callable, optional
        Called as ``progress(done, total)`` between batches of paths.

    Examples
    --------
    >>> from fpk_rocking import load_scene, solve_fpk
    >>> from fpk_rocking.studies import checked
    >>> density = solve_fpk(load_scene("main"), cycles=4, tol=1e-2)
    >>> print(checked(density, realizations=1000).total_error[4].round(2))
    [0.03 0.02 0.03]
    """
    scene = density.scene
    realizations = check_paths(scene) if realizations is None else checks.count("realizations", realizations)
    seed = checks.count("seed", seed, at_least=0)
    if not density.noise_replacement:
        return density
    if beside is not None and beside.scene == scene and beside.realizations >= CHECK_PATHS:
        return density.checked(beside)
    within: Any = {"cycles": density.cycles, "samples_per_cycle": density.samples_per_cycle}
    rows = within if scene.period else {"times": density.times[1:]}
    return density.checked(simulate(scene, **rows, realizations=realizations, seed=seed, progress=progress))


def check_paths(scene: Scene) -> int:
    """Number of paths of a check; fewer in a record, where a path takes up to a hundred times as long."""
    return 10_000 if scene.forcing.dimensional else CHECK_PATHS


def kernels_of_check(scene: Scene) -> list[Compilation]:
    """Compilations of the kernels that the check of a scene's density needs: of paths, under band noise."""
    return [compilation_of(engine_of(scene), scene)] if scene.noise.kind == "band" else []


class SlendernessCost(NamedTuple):
    """Probability of overturning by the exact and by the slender equation, in pairs of paths under the same motion.

    Parameters
    ----------
    exact, slender : float
        Part of the paths that overturned.
    standard_error : float
        Standard error of `difference`, from the pairs that differ; from one such pair if none differs. 0 without noise.
    realizations : int
        Number of pairs.
    """

    exact: float
    slender: float
    standard_error: float
    realizations: int

    @property
    def difference(self) -> float:
        """What taking the block as slender adds to the probability of overturning: `slender` - `exact`."""
        return self.slender - self.exact

    def __str__(self):
        return (
            f"Of {self.realizations:,} motions {self.slender:.4f} overturned the block by the equation of a slender "
            f"one, {self.exact:.4f} by the exact one: the difference is {self.difference:+.4f} ± "
            f"{self.standard_error:.2g} (standard error)."
        )


def slenderness_cost(
    scene: Scene,
    *,
    cycles: int | None = None,
    times: ArrayLike | None = None,
    realizations: int = 5000,
    seed: int = 1,
    method: str | None = None,
) -> SlendernessCost:
    """Measure what the slender equation adds to the probability of overturning of a block, by Monte Carlo.

    Both equations meet the same realizations of the noise and of the start.

    Parameters
    ----------
    scene : Scene
        Its block has dimensions or a critical angle above 0; its value of `slender` has no influence.
    cycles, times, seed, method
        As for `montecarlo.simulate`.
    realizations : int
        Number of pairs.

    Examples
    --------
    >>> from fpk_rocking import Scene
    >>> from fpk_rocking.studies import slenderness_cost
    >>> rack = Scene.from_block(0.5, 1.8, "0.5 g", "1.5 Hz",
    ...                         noise_rms_acceleration=0.5, noise_band_hz=(0, 5))
    >>> print(f"{slenderness_cost(rack, cycles=4, realizations=1000).difference:.3f}")
    0.076
    """
    block = checks.instance("scene", scene, Scene).block
    if block.least_friction is None:
        accepted = "an angle above 0, or block.dimensions, for the cost of slenderness"
        raise ValueError(checks.refusal("block.critical_angle", block.critical_angle, accepted))
    exact = scene.varied(block={"slender": False}) if block.slender else scene
    overturned = []
    for equation in (exact, scene.varied(block={"slender": True})):
        ensemble = simulate(equation, cycles=cycles, times=times, realizations=realizations, seed=seed, method=method)
        overturned.append(np.isfinite(ensemble.overturn_time))
    pairs, count = overturned[1].astype(int) - overturned[0], overturned[0].size
    spread = max(int(np.count_nonzero(pairs)), 1) / count - pairs.mean() ** 2
    error = 0.0 if scene.deterministic else math.sqrt(spread / count)
    return SlendernessCost(float(overturned[0].mean()), float(overturned[1].mean()), error, count)
