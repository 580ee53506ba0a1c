"""`solve_fpk`: the Fokker-Planck equation of a scene, solved from its start over whole cycles to a tolerance."""

import functools
import math
import time

import numpy as np

from fpk_rocking.base import ahead, checks
from fpk_rocking.base.types import ArrayLike, Progress
from fpk_rocking.density.evolution import Evolution, near_rest
from fpk_rocking.density.outlook import tell, tell_finer
from fpk_rocking.density.pilot import in_rest, motion_of
from fpk_rocking.density.refinement import LEAST, UNRESOLVED, Count, bins_tolerance, candidates_for, refine
from fpk_rocking.density.refusals import (
    refuse_broken,
    refuse_large,
    refuse_slow,
    refuse_unsolvable,
    warn_beyond,
    warn_unresolved,
)
from fpk_rocking.density.resolution import RESOLUTIONS, USUAL
from fpk_rocking.density.run import kind_of
from fpk_rocking.density.space.mesh import velocity_bound
from fpk_rocking.physics.noise.equivalence import equivalent_diffusion
from fpk_rocking.results.remarks import describe_replacement
from fpk_rocking.results.times import result_times
from fpk_rocking.scene.scene import Scene

NEGLIGIBLE = 1e-6
"""Mass over `tol` that a cell must have held to be active."""

CLOSURES = ("white", "filtered")
"""Noises that may stand for band noise."""

SOLUTION_MEMORY = {"white": 3e9, "filtered": 4e9}
"""Bytes that a finer solution may be expected to need, by the noise that is solved for."""

_FINER = 1.4
"""Steps of a solution over those of the one before."""

_RESTING = 4.0
"""Error of the last solution over its difference from the one before, where blocks rest under noise held over a step,
or come to rest and are lifted off again: which of them rest by then is told by cells, of first order or less.
2.5 would be an error of first order; with smooth noise it falls more slowly (docs/numerics.md, "Filtered noise")."""

_FASTER = 1.1
"""Velocity bound over the largest speed of the pilot's paths, at least, where the motion does not repeat."""

_LESSENS = 0.8
"""Negative mass over that of the solution before, at most, that finer ones are taken to have: soon after a start it may
stay as large over two solutions and then fall by ten."""

_LEAST_ERROR = 0.01
"""Least estimate of the error in survival over that of the binned density."""


def solve_fpk(
    scene: Scene,
    *,
    cycles: int | None = None,
    times: ArrayLike | None = None,
    tol: float | None = None,
    bins_tol: float | None = None,
    noise_replacement: str = "white",
    progress: Progress | None = None,
) -> Evolution:
    """Solve the Fokker-Planck equation of a scene for the joint density of angle and velocity.

    The solver takes white noise and filtered noise as they are. It replaces band noise, as `noise_replacement` says.
    The mesh is refined until the estimated errors are within the tolerances, or until a finer one would take too much
    memory.

    The solver pays off for errors below 1e-3, for joint densities and for small probabilities. Where a standard error
    of 1e-3 in survival is enough, `montecarlo.simulate` is as fast or faster on most blocks of practical sizes.

    Parameters
    ----------
    scene : Scene
        With white, filtered or band noise. Filtered noise needs a scene that repeats (`Scene.repeats`).
    cycles : int, optional
        Number of forcing cycles. Required where the forcing repeats, refused where it does not.
    times : array_like, optional
        For a pulse or a record: ascending nondimensional times at which results are wanted. By default 21 times over
        its duration, and 10 units of time after its end.
    tol : float, optional
        Wanted error of survival, at least 1e-4. By default .001, and .01 where the forcing does not repeat.
    bins_tol : float, optional
        Wanted error of the binned density (L1), above 0; a bin is a twentieth of the range in which the block moves.
        With inf the binned density is not refined for. By default √tol / 3; where the forcing does not repeat,
        the verdict is by that too, but refinement is for survival alone.
    noise_replacement : {"white", "filtered"}
        What replaces band noise: white noise of equal Melnikov variance, or low-pass noise of equal variance and
        Melnikov variance. Blocks come to rest under low-pass noise, and never do under white noise.
    progress : callable, optional
        Called as ``progress(done, total)`` after each cycle of each solution; `total` grows with every refinement.

    Returns
    -------
    Evolution

    Warns
    -----
    RuntimeWarning
        The estimated error on the finest mesh is larger than `tol` or `bins_tol`; or, under filtered noise, that of the
        probability of being at rest is larger than `bins_tol`.

    Raises
    ------
    TypeError, ValueError
        A parameter is refused; or the solver cannot take the scene: it has no noise, a restitution of at most
        exp(-π/√3) = 0.163 under white noise, filtered noise that is too slow for the start, a density that needs too
        much memory, or one that the finest mesh does not resolve.

    Examples
    --------
    >>> from fpk_rocking import load_scene, solve_fpk
    >>> density = solve_fpk(load_scene("main"), cycles=4, tol=1e-2)
    >>> print(density.survival.round(2), density.error_estimate < 1e-2)
    [1.   1.   1.   0.96 0.86] True
    """
    begin = time.perf_counter()
    checks.instance("scene", scene, Scene)
    times = result_times(scene, cycles, times)
    tol, bins_tol, judged = _tolerances(scene, tol, bins_tol)
    solved = _solvable(scene, noise_replacement)
    white, rows = solved.white_equivalent(), len(times) - 1
    ahead.before(ahead.of_block("fpk_rocking.density.ahead:solve", scene), "fpk_rocking.density.ahead:flight")
    kind, motion = kind_of(solved), motion_of(white, times)
    grids = _grids(solved, white, motion, candidates_for(tol))
    usual, count = grids[LEAST - 1], Count(progress, rows)
    refuse_large(usual.memory, usual.stored(rows), solved, rows)

    def made(grid, coarser):
        started = time.perf_counter()
        if coarser and coarser.number >= LEAST:
            tell_finer(solved, coarser.run.grid, grid, times, coarser.seconds)
        run = kind(solved, grid, NEGLIGIBLE * tol, coarser and coarser.run)
        if coarser:
            coarser.run = None
        solution = run.evolve(times, count.next())
        return Solved(run, solution, motion.edges, coarser, time.perf_counter() - started)

    def fits(level, grid):
        held = level.memory * grid.memory / level.run.grid.memory
        return held + grid.stored(rows) <= SOLUTION_MEMORY[solved.noise.kind]

    tell(solved, grids[:LEAST], times, tol)
    found = refine(grids, made, fits, lambda found: found.within(tol, bins_tol) or _hopeless(found))
    fine, run = found.fine.solution, found.fine.run
    unresolved = [row for row in range(1, rows + 1) if row not in fine.shown]
    result = Evolution(
        scene=scene,
        diffusion=white.noise.diffusion,
        noise_replacement=describe_replacement(scene, solved),
        tol=tol,
        times=times,
        survival=fine.inside,
        overturned=fine.gone[:, :2],
        at_rest=near_rest(run.space, fine.coefficients, scene.start) if fine.at_rest is None else fine.at_rest,
        lost=fine.gone[:, 2],
        error_estimate=found.error,
        bins_error_estimate=found.bins_error,
        rest_error_estimate=found.fine.rest_error,
        mass_defect=float(np.abs(fine.inside + fine.gone.sum(axis=1) - 1.0).max()),
        negative_mass=max((run.space.negative_mass(one) for one in fine.coefficients[fine.shown]), default=0.0),
        moving_negative_mass=found.fine.negative_mass,
        wall_s=time.perf_counter() - begin,
        settings=run.grid.settings
        | {"unknowns": run.space.unknowns, "velocity_bound": float(run.space.velocity_lines[-1]), "bins_tol": judged}
        | ({"unresolved": unresolved} if unresolved else {}),
        coefficients=fine.coefficients,
        angle_lines=run.space.angle_lines,
        velocity_lines=run.space.velocity_lines,
        atom=solved.noise.kind == "filtered",
    )
    refuse_broken(result)
    _refuse_unresolved(result, found.fine.negative_mass)
    warn_beyond("survival", found, tol, bins_tol, "compare with Monte Carlo", stacklevel=3)
    warn_unresolved(result, bins_tol, stacklevel=3)
    return result


class Solved:
    """A density over some cycles at one resolution: a level of the refinement.

    Parameters
    ----------
    run : Run
        Dropped once the next level has made its own.
    solution : Solution
    edges : sequence of ndarray
        Of the bins in angle and in velocity that it is compared in.
    coarser : Solved, optional
        The level before.
    seconds : float
        That it took.

    Attributes
    ----------
    number : int
        Of the level, the first being 1.
    """

    def __init__(self, run, solution, edges, coarser=None, seconds=0.0):
        self.run, self.solution, self.seconds = run, solution, seconds
        self._rests = [*(coarser._rests if coarser else ()), solution.at_rest]
        self.number = len(self._rests)
        self.bins = run.space.bin_integrals(solution.coefficients, *edges)
        if solution.at_rest is not None:
            self.bins += solution.at_rest[:, None, None] * np.histogram2d([0.0], [0.0], bins=edges)[0]
        self._resting = in_rest(*(0.5 * (line[1:] + line[:-1]) for line in edges))

    @functools.cached_property
    def negative_mass(self) -> float:
        """Largest of those after a cycle or more, of blocks that are not at rest."""
        space, densities = self.run.space, self.solution.coefficients[self.solution.shown]
        moving = ~in_rest(*(0.5 * (line[1:] + line[:-1]) for line in space.lines))
        parts = (space.negative_mass(np.where(moving[:, :, None, None], density, 0.0)) for density in densities)
        return max(parts, default=0.0)

    @property
    def memory(self) -> float:
        """Bytes that its run holds."""
        return self.run.memory

    def differences(self, coarser: "Solved") -> tuple[float, float]:
        """Largest differences of survival and of the binned density over the cycles; rest counts as one bin."""
        apart = (self.bins - coarser.bins)[np.intersect1d(self.solution.shown, coarser.solution.shown)]
        binned = np.abs(apart[:, ~self._resting]).sum(axis=1) + np.abs(apart[:, self._resting].sum(axis=1))
        return float(np.abs(self.solution.inside - coarser.solution.inside).max()), float(binned.max(initial=0.0))

    def error(self, difference: float, bins: float) -> float:
        """Error of survival: not less than a hundredth of that of the bins, nor than what was lost."""
        at_rest, released = self.solution.at_rest, self.solution.released
        if (released if at_rest is None else at_rest[1:].max()) > difference:
            difference *= _RESTING
        return max(difference, _LEAST_ERROR * bins, float(np.abs(self.solution.gone[:, 2]).max()))

    @property
    def rest_error(self) -> float:
        """Error of what is at rest, 0 where nothing is: what the levels before tell, and what they cannot, together.

        The former is of first order in the step where noise is smooth; else of order 1/2, and the last steps of a level
        are half as long as before. The latter is what nodes of the noise leave unseen.
        """
        if self.solution.at_rest is None:
            return 0.0
        apart = [float(np.abs(self._rests[-1] - before).max()) for before in self._rests[-2:-4:-1]]
        told = max(apart[k] / (_FINER ** (k + 1) - 1.0) for k in (0, 1))
        return told + self.run.unseen * float(self.solution.at_rest[1:].max())

    def release(self) -> None:
        """Let go of the densities, of which the negative mass is kept."""
        self.negative_mass  # noqa: B018  (what it is cannot be told later)
        self.solution = self.solution._replace(coefficients=None)


def _tolerances(scene, tol, bins_tol):
    """Return the tolerances of survival and of the bins, and that by which the bins are judged.

    By default what does not repeat is refined for survival alone, and judged by the bins all the same.
    """
    tol = checks.number("tol", (1e-3 if scene.repeats else 1e-2) if tol is None else tol, at_least=min(USUAL))
    if bins_tol is None:
        judged = bins_tolerance(tol)
        return tol, judged if scene.repeats else math.inf, judged
    bins_tol = bins_tol if bins_tol == math.inf else checks.number("bins_tol", bins_tol, above=0.0)
    return tol, bins_tol, bins_tol


def _hopeless(found):
    """Whether the density will not be resolved, though the next solutions gain twice as many digits as the last."""
    now, before = found.fine.negative_mass, found.coarse.negative_mass
    lessens = min(now / before, _LESSENS) if before > 0.0 else _LESSENS
    return now > UNRESOLVED and now * lessens ** (2 * found.left) > UNRESOLVED


def _grids(scene, white, motion, resolutions):
    """Return the grids of resolutions; `white` is the scene with equivalent white noise."""
    kind, bound = kind_of(scene), velocity_bound(white, _spread(scene.noise))
    if not scene.repeats:
        # Blocks that are bound to overturn, but have not yet, may be faster.
        bound = max(bound, _FASTER * motion.fastest)
    grids = [resolution.of(white, bound, motion) for resolution in resolutions]
    coarsest = len(RESOLUTIONS) - len(resolutions)
    return [kind.adapted(scene, grid, number) for number, grid in enumerate(grids, coarsest)]


def _solvable(scene, noise_replacement):
    """Return the scene to solve: with band noise replaced, and refused if it cannot be solved."""
    accepted = " or ".join(map(repr, CLOSURES))
    if not isinstance(noise_replacement, str):
        raise TypeError(checks.refusal("noise_replacement", noise_replacement, accepted))
    if noise_replacement not in CLOSURES:
        raise ValueError(checks.refusal("noise_replacement", noise_replacement, accepted))
    if scene.noise.kind != "filtered":
        scene = scene.filtered_equivalent() if noise_replacement == "filtered" else scene.white_equivalent()
    if scene.noise.kind == "filtered" and not scene.repeats:
        accepted = "'white', or 'band' with the default replacement, as this scene does not repeat; or use Monte Carlo"
        raise ValueError(checks.refusal("noise.kind", scene.noise.kind, accepted))
    refuse_unsolvable(scene)
    refuse_slow(scene)
    return scene


def _spread(noise):
    """Return the diffusion that bounds how far noise moves a flight: D, or more for noise of high frequencies."""
    if noise.kind == "white":
        return noise.diffusion
    return max(equivalent_diffusion(noise), noise.variance * noise.space.inward_variance)


def _refuse_unresolved(result, negative):
    if negative > UNRESOLVED:
        raise ValueError(
            f"scene: got a density that a mesh of {result.settings['unknowns']:,} unknowns does not resolve, nor would "
            f"the finest (negative mass {negative:.1e}), accepted: up to {UNRESOLVED}; the noise, of diffusion "
            f"{result.diffusion:.3g}, is too weak, or filtered noise too slow: use Monte Carlo"
        )
