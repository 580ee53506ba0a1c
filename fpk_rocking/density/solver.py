"""`solve_fpk`: the Fokker-Planck equation of a scene, from its start over whole forcing cycles, to a tolerance."""

import dataclasses
import time

import numpy as np

from fpk_rocking import checks
from fpk_rocking.density.acceptance import (
    Progress,
    bins_tolerance,
    closure_of,
    refuse_broken,
    refuse_large,
    refuse_unsolvable,
    safe_difference,
    warn_beyond,
)
from fpk_rocking.density.evolution import Evolution
from fpk_rocking.density.mesh import velocity_bound
from fpk_rocking.density.resolution import ENOUGH, LADDER
from fpk_rocking.density.run import Run
from fpk_rocking.density.start import Departure
from fpk_rocking.scene import Scene

UNRESOLVED = 0.05
"""Negative mass above which a density counts as not resolved."""

NEGLIGIBLE = 1e-6
"""Mass over `tol` that a cell must have held to be covered."""

BYTES = 2.0
"""Bytes that a run holds, about, over the `work` of its resolution."""

MEMORY = 1.5e9
"""Bytes that a finer solution may be expected to need."""


def solve_fpk(scene, *, cycles, tol=1e-3, progress=None):
    """Evolve the joint density of angle and velocity of a rocking block.

    Band noise is replaced by white noise of equal Melnikov variance, and the result's `closure` says so. The solution
    is refined until its difference from the one before is below the tolerance, or memory ends it.

    Parameters
    ----------
    scene : Scene
        With white or band noise.
    cycles : int
        Forcing cycles to evolve.
    tol : float
        Wanted error in survival, from 1e-4 up; the binned density is wanted to `bins_tolerance`.
    progress : callable, optional
        Called as ``progress(done, total)`` after each cycle of each solution; `total` grows when one is added.

    Returns
    -------
    Evolution

    Warns
    -----
    RuntimeWarning
        The finest solution that memory allows is not within the tolerance by its own estimate.

    Raises
    ------
    TypeError, ValueError
        A parameter is not acceptable; no noise, and a restitution below `CRITICAL_RESTITUTION`, are refused, as is a
        scene whose density the finest mesh does not resolve.
    """
    begin = time.perf_counter()
    checks.instance("scene", scene, Scene)
    cycles = checks.count("cycles", cycles)
    tol = checks.number("tol", tol, at_least=min(ENOUGH))
    white = scene.white_equivalent()
    refuse_unsolvable(white)
    run, fine, errors = _refined(white, cycles, tol, Progress(progress, cycles, least=3))
    result = Evolution(
        scene=scene,
        diffusion=white.noise.diffusion,
        closure=closure_of(scene, white),
        tol=tol,
        survival=fine.inside,
        overturned=fine.gone[:, :2],
        lost=fine.gone[:, 2],
        mass_defect=float(np.abs(fine.inside + fine.gone.sum(axis=1) - 1.0).max()),
        wall_s=time.perf_counter() - begin,
        settings=dataclasses.asdict(run.resolution)
        | {"unknowns": run.space.unknowns, "velocity_bound": float(run.space.velocity_lines[-1])},
        coefficients=fine.coefficients,
        space=run.space,
        **errors,
    )
    _judge(result)
    return result


def _refined(white, cycles, tol, progress):
    """Climb the ladder until all errors are acceptable: the last run, its solution, and its errors by name."""
    bound = velocity_bound(white, white.noise.diffusion)
    enough = ENOUGH[max(known for known in ENOUGH if known <= tol)]
    least = LADDER[enough].of(white, bound)
    refuse_large(BYTES * least.work, least.stored(cycles), cycles)
    run, fine, differences, departures = None, None, [], {}
    for rung in range(enough - 2, len(LADDER)):
        resolution = LADDER[rung].of(white, bound)
        if rung > enough and run.memory * resolution.work / run.resolution.work + resolution.stored(cycles) > MEMORY:
            break
        coarse, fine = fine and fine._replace(coefficients=None), None
        run = Run(white, resolution, bound, NEGLIGIBLE * tol, run)
        windows = resolution.windows
        if windows not in departures:
            departures[windows] = Departure(run.dynamics, white.start, windows, white.period)
        fine = run.evolve(cycles, departures[windows], progress.next())
        if coarse:
            differences.append(
                (
                    float(np.abs(fine.inside - coarse.inside).max()),
                    float(np.abs(fine.bins - coarse.bins)[1:].sum(axis=(1, 2)).max()),
                )
            )
        if rung >= enough:
            error, bins_error = estimated_error(differences, fine), differences[-1][1]
            negative = max(run.space.negative_mass(density) for density in fine.coefficients[1:])
            if error <= tol and bins_error <= bins_tolerance(tol) and negative <= UNRESOLVED:
                break
    return run, fine, {"error_estimate": error, "bins_error_estimate": bins_error, "negative_mass": negative}


def estimated_error(differences, solution):
    """Error in survival of the last of three or more solutions, from the differences (survival, bins) of neighbours.

    The `safe_difference` of survival, and not less than a hundredth of the difference in the bins, and what was lost.
    """
    (before, _), (last, bins) = differences[-2:]
    lost = float(np.abs(solution.gone[:, 2]).max())
    return max(safe_difference(before, last), 0.01 * bins, lost)


def _judge(result):
    """Refuse what is not resolved, and warn of what is not within the tolerance."""
    refuse_broken(result)
    if result.negative_mass > UNRESOLVED:
        accepted = (
            f"a scene whose density a mesh can resolve; on {result.settings['unknowns']:,} unknowns its negative mass "
            f"is {result.negative_mass:.1e}: the noise is too weak, or the block rattles at rest (use simulate())"
        )
        raise ValueError(checks.refusal("scene", f"diffusion {result.diffusion:g}", accepted))
    warn_beyond(result, "compare with simulate()")
