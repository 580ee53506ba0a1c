"""`solve_fpk`: the Fokker-Planck equation of a scene, from its start over whole forcing cycles, to a tolerance."""

import dataclasses
import math
import time
import warnings

import numpy as np

from fpk_rocking import checks
from fpk_rocking.density.evolution import Evolution
from fpk_rocking.density.mesh import velocity_bound
from fpk_rocking.density.resolution import ENOUGH, LADDER
from fpk_rocking.density.run import Run
from fpk_rocking.density.start import Departure
from fpk_rocking.physics.contact import CRITICAL_RESTITUTION
from fpk_rocking.scene import Scene

UNRESOLVED = 0.05
"""Negative mass above which a density counts as not resolved."""

NEGLIGIBLE = 1e-6
"""Mass over `tol` that a cell must have held to be covered."""

MEMORY = 1.5e9
"""Bytes that a finer solution may be expected to need."""


def bins_tolerance(tol):
    """Return the error (L1) in the binned density that goes with an error `tol` in survival.

    The bins are 32 x 64 equal ones between the cut-offs and the velocity bounds: .1 x .1 in the main scene.
    """
    return math.sqrt(tol) / 3.0


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
    _refuse_unsolvable(white)
    run, fine, errors = _refined(white, cycles, tol, _Progress(progress, cycles))
    result = Evolution(
        scene=scene,
        diffusion=white.noise.diffusion,
        closure=_closure(scene, white),
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
    run, fine, differences, departures = None, None, [], {}
    for rung in range(enough - 2, len(LADDER)):
        resolution, coarse = LADDER[rung].of(white, bound), fine
        if rung > enough and run.memory * resolution.work / run.resolution.work > MEMORY:
            break
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

    The last difference, which estimates the error of the one but last; where it is small by chance, as the one before
    tells, up to two and a half times as much. Not less than what was lost.
    """
    (before, _), (last, _) = differences[-2:]
    return max(last, min(0.3 * before, 2.5 * last), float(np.abs(solution.gone[:, 2]).max()))


class _Progress:
    """Counts the cycles of all solutions; three are needed, and one more whenever they do not agree."""

    def __init__(self, report, cycles):
        self.report, self.cycles, self.done, self.total = report, cycles, 0, cycles

    def next(self):
        self.total = max(self.done + self.cycles, 3 * self.cycles)
        return self._count

    def _count(self):
        self.done += 1
        if self.report:
            self.report(self.done, self.total)


def _judge(result):
    """Refuse what is not resolved, and warn of what is not within the tolerance."""
    if result.negative_mass > UNRESOLVED:
        accepted = (
            f"a scene whose density a mesh can resolve; on {result.settings['unknowns']:,} unknowns its negative mass "
            f"is {result.negative_mass:.1e}: the noise is too weak, or the block rattles at rest (use simulate())"
        )
        raise ValueError(checks.refusal("scene", f"diffusion {result.diffusion:g}", accepted))
    wanted = bins_tolerance(result.tol)
    if result.error_estimate > result.tol or result.bins_error_estimate > wanted:
        warnings.warn(
            f"not within the tolerance: estimated error {result.error_estimate:.1e} in survival (tol {result.tol:g}) "
            f"and {result.bins_error_estimate:.1e} in the binned density ({wanted:.1e}) on the finest mesh for this "
            "scene; take a larger tol, or compare with simulate()",
            RuntimeWarning,
            stacklevel=3,
        )


def _refuse_unsolvable(white):
    if white.noise.diffusion == 0.0:
        accepted = "noise: without it there is no density to evolve (simulate() follows single trajectories)"
        raise ValueError(checks.refusal("noise", "none, or of size 0", accepted))
    if white.block.restitution <= CRITICAL_RESTITUTION:
        accepted = (
            f"above {CRITICAL_RESTITUTION:.5f} with white noise: below it there are infinitely many impacts in finite "
            "time, and what follows is not defined (band noise can be sampled with simulate())"
        )
        raise ValueError(checks.refusal("block.restitution", white.block.restitution, accepted))


def _closure(scene, white):
    if scene.noise.kind == "white":
        return ""
    low, high = scene.noise.band
    return (
        f"Band noise (variance {scene.noise.variance:g} on [{low:g}, {high:g}]) is solved as white noise of equal "
        f"Melnikov variance, D = {white.noise.diffusion:.6g}: a closure, to be judged by Monte Carlo."
    )
