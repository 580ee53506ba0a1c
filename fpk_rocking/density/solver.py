"""`solve_fpk`: the Fokker-Planck equation of a scene, solved from its start over whole cycles to a tolerance."""

import functools
import math
import time

import numpy as np

from fpk_rocking.base import ahead, checks
from fpk_rocking.density.evolution import Evolution
from fpk_rocking.density.pilot import in_rest, motion_of
from fpk_rocking.density.propagator import Propagator
from fpk_rocking.density.refinement import UNRESOLVED, Progress, bins_tolerance, candidates_for, refine
from fpk_rocking.density.refusals import refuse_broken, refuse_filtered, refuse_large, refuse_unsolvable, warn_beyond
from fpk_rocking.density.resolution import USUAL
from fpk_rocking.density.space.mesh import velocity_bound
from fpk_rocking.density.start.departure import Departure
from fpk_rocking.results.remarks import closure_of
from fpk_rocking.scene import limits
from fpk_rocking.scene.scene import Scene

NEGLIGIBLE = 1e-6
"""Mass over `tol` that a cell must have held to be active."""

BYTES = 2.0
"""Bytes that a run holds, about, over the `work` of its grid."""

SOLUTION_MEMORY = 1.5e9
"""Bytes that a finer solution may be expected to need."""

_LEAST_ERROR = 0.01
"""Least estimate of the error in survival over that of the binned density."""


def solve_fpk(
    scene: Scene, *, cycles: int, tol: float = 1e-3, bins_tol: float | None = None, progress: Progress | None = None
) -> Evolution:
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
        Wanted error in survival, from 1e-4 up.
    bins_tol : float, optional
        Wanted error of the binned density (L1), the bins being a twentieth of the range in which the block moves; above
        0. By default √tol / 3; inf leaves it out.
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
    tol = checks.number("tol", tol, at_least=min(USUAL))
    if bins_tol is None:
        bins_tol = bins_tolerance(tol)
    elif bins_tol != math.inf:
        bins_tol = checks.number("bins_tol", bins_tol, above=0.0)
    refuse_filtered(scene)
    white = scene.white_equivalent()
    refuse_unsolvable(white)
    ahead.before("fpk_rocking.density.ahead:solve", "fpk_rocking.density.ahead:flight")
    bound, departures, motion = velocity_bound(white, white.noise.diffusion), {}, motion_of(white, cycles)
    grids = [resolution.of(white, bound, motion) for resolution in candidates_for(tol)]
    least, count = grids[2], Progress(progress, cycles, least=3)
    refuse_large(BYTES * least.work, least.stored(cycles), cycles)

    def solved(grid, coarser):
        run = Propagator(white, grid, NEGLIGIBLE * tol, coarser and coarser.run)
        if grid.windows not in departures:
            departures[grid.windows] = Departure(run.dynamics, white.start, grid.windows, white.period)
        return Solved(run, run.evolve(cycles, departures[grid.windows], count.next()), motion.edges)

    def fits(level, grid):
        return level.memory * grid.work / level.run.grid.work + grid.stored(cycles) <= SOLUTION_MEMORY

    found = refine(grids, solved, fits, lambda found: found.within(tol, bins_tol))
    fine, run = found.fine.solution, found.fine.run
    result = Evolution(
        scene=scene,
        diffusion=white.noise.diffusion,
        closure=closure_of(scene, white),
        tol=tol,
        survival=fine.inside,
        overturned=fine.gone[:, :2],
        lost=fine.gone[:, 2],
        error_estimate=found.error,
        bins_error_estimate=found.bins_error,
        mass_defect=float(np.abs(fine.inside + fine.gone.sum(axis=1) - 1.0).max()),
        negative_mass=max(run.space.negative_mass(density) for density in fine.coefficients[1:]),
        wall_s=time.perf_counter() - begin,
        settings=run.grid.settings
        | {"unknowns": run.space.unknowns, "velocity_bound": float(run.space.velocity_lines[-1])},
        coefficients=fine.coefficients,
        space=run.space,
    )
    refuse_broken(result)
    _refuse_unresolved(result, found.fine.negative_mass)
    warn_beyond("survival", found, tol, bins_tol, f"compare with {limits.SAMPLING}", stacklevel=3)
    return result


class Solved:
    """A density over some cycles at one resolution: a level of the refinement.

    Parameters
    ----------
    run : Propagator
    solution : Solution
    edges : sequence of ndarray
        Of the bins in angle and in velocity that it is compared in.
    """

    def __init__(self, run, solution, edges):
        self.run, self.solution = run, solution
        self.bins = run.space.bin_integrals(solution.coefficients, *edges)
        self._resting = in_rest(*(0.5 * (line[1:] + line[:-1]) for line in edges))

    @functools.cached_property
    def negative_mass(self):
        """Largest of those after a cycle or more, of blocks that are not at rest."""
        space, densities = self.run.space, self.solution.coefficients[1:]
        moving = ~in_rest(*(0.5 * (line[1:] + line[:-1]) for line in space.lines))
        return max(space.negative_mass(np.where(moving[:, :, None, None], density, 0.0)) for density in densities)

    @property
    def memory(self):
        """Bytes that its run holds."""
        return self.run.memory

    def differences(self, coarser):
        """Largest differences of survival and of the binned density over the cycles; rest counts as one bin."""
        apart = (self.bins - coarser.bins)[1:]
        binned = np.abs(apart[:, ~self._resting]).sum(axis=1) + np.abs(apart[:, self._resting].sum(axis=1))
        return float(np.abs(self.solution.inside - coarser.solution.inside).max()), float(binned.max())

    def error(self, difference, bins):
        """Error of survival: not less than a hundredth of that of the bins, nor than what was lost."""
        return max(difference, _LEAST_ERROR * bins, float(np.abs(self.solution.gone[:, 2]).max()))

    def release(self):
        """Let go of the densities."""
        self.solution = self.solution._replace(coefficients=None)


def _refuse_unresolved(result, negative):
    if negative > UNRESOLVED:
        accepted = (
            f"a scene whose density a mesh can resolve; on {result.settings['unknowns']:,} unknowns its negative mass "
            f"is {negative:.1e}: the noise is too weak; take {limits.SAMPLING}"
        )
        raise ValueError(checks.refusal("scene", f"diffusion {result.diffusion:g}", accepted))
