"""`solve_fpk`: the Fokker-Planck equation of a scene, solved from its start to the wanted times and to a tolerance."""

import math
import time

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import ArrayLike, Progress
from fpk_rocking.base.precompilation import Task, start_helpers
from fpk_rocking.density.evolution import Evolution, near_rest, refuse_broken, warn_unresolved
from fpk_rocking.density.filtered import FilteredPropagator
from fpk_rocking.density.notices import (
    announce,
    announce_finer,
    estimated_seconds,
    refuse_large,
    refuse_slow,
    refuse_unsolvable,
    warn_beyond,
)
from fpk_rocking.density.propagator import PeriodicPropagator
from fpk_rocking.density.refinement import SOLUTIONS, Level, ProgressCount, refine
from fpk_rocking.density.resolution import RESOLUTIONS, USUAL, bins_tolerance, explore, in_rest, resolutions_for
from fpk_rocking.density.space import Space, graded_lines, velocity_bound
from fpk_rocking.density.step.dynamics import Dynamics
from fpk_rocking.density.step.free_flight import FreeFlight
from fpk_rocking.density.transient import TransientPropagator
from fpk_rocking.density.tuning import TUNING
from fpk_rocking.physics.noise.equivalence import equivalent_diffusion
from fpk_rocking.results.remarks import describe_replacement
from fpk_rocking.scene.least import KINDS, kind_of, least_scenes
from fpk_rocking.scene.ranges import result_times
from fpk_rocking.scene.scene import Scene


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
        Survival, overturning to either side, densities and estimated errors at all times.

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
    tol, bins_tol, judged_by = _tolerances(scene, tol, bins_tol)
    solved = _with_noise_replaced(scene, noise_replacement)
    white, advances, filtered = solved.white_equivalent(), len(times) - 1, solved.noise.kind == "filtered"
    start_helpers(DENSITY[kind_of(scene.block)], FREE_FLIGHT)

    motion = explore(white, times)
    meshes = _discretizations(solved, white, motion, resolutions_for(tol, SOLUTIONS, filtered))
    first = len(meshes) - len(resolutions_for(tol, SOLUTIONS - 1, filtered))
    coarser, meshes = meshes[:first], meshes[first:]
    usual, count = meshes[SOLUTIONS - 1], ProgressCount(progress, advances)
    refuse_large(usual.memory, usual.stored(advances), solved, advances)
    announce(solved, meshes[:SOLUTIONS], times, tol)

    def solve(mesh, coarser):
        return _solve_level(solved, mesh, tol, times, motion.edges, coarser, count.start_solution())

    def fits(level, mesh):
        before = level.solution[0].discretization
        needed = level.memory * mesh.memory / before.memory + mesh.stored(advances)
        if needed > (TUNING.finer_filtered if filtered else TUNING.finer_white):
            return False
        announce_finer(solved, before, mesh, times, level.seconds)
        return True

    def is_done(refined):
        return refined.within(tol, bins_tol) or _is_stagnated(refined)

    refined = refine(meshes, solve, fits, is_done, coarser)

    propagator, fine = refined.fine.solution
    at_rest = fine.at_rest
    unresolved = [row for row in range(1, advances + 1) if not fine.resolved[row]]
    result = Evolution(
        scene=scene,
        diffusion=white.noise.diffusion,
        noise_replacement=describe_replacement(scene, solved),
        tol=tol,
        times=times,
        survival=fine.survival,
        overturned=fine.outflow[:, :2],
        at_rest=near_rest(propagator.space, fine.coefficients, scene.start) if at_rest is None else at_rest,
        truncated=fine.outflow[:, 2],
        error_estimate=refined.error,
        bins_error_estimate=refined.bins_error,
        rest_error_estimate=_rest_error(refined.levels),
        mass_defect=float(np.abs(fine.survival + fine.outflow.sum(axis=1) - 1.0).max()),
        negative_mass=max(map(propagator.space.negative_mass, fine.coefficients[fine.resolved]), default=0.0),
        moving_negative_mass=refined.fine.negative_mass,
        wall_s=time.perf_counter() - begin,
        settings=propagator.discretization.settings
        | {"unknowns": propagator.space.unknowns, "velocity_bound": float(propagator.space.velocity_lines[-1])}
        | {"bins_tol": judged_by}
        | ({"unresolved": unresolved} if unresolved else {}),
        coefficients=fine.coefficients,
        angle_lines=propagator.space.angle_lines,
        velocity_lines=propagator.space.velocity_lines,
        rests_exactly=filtered,
    )
    refuse_broken(result)
    _refuse_unresolved(result)
    warn_beyond("survival", refined, tol, bins_tol, "compare with Monte Carlo", stacklevel=3)
    warn_unresolved(result, bins_tol, stacklevel=3)
    return result


def predicted_seconds(
    scene: Scene, *, tol: float, cycles: int | None = None, times: ArrayLike | None = None
) -> list[float]:
    """Predict the seconds of one processor that each solution of `solve_fpk` takes, to about a factor of two."""
    refuse_unsolvable(scene)
    rows = result_times(scene, cycles, times)
    meshes = _discretizations(scene, scene, explore(scene, rows), resolutions_for(tol, before=SOLUTIONS))
    first = len(meshes) - len(resolutions_for(tol, before=SOLUTIONS - 1))
    third = meshes[0] if first else meshes[SOLUTIONS - 1]
    return [estimated_seconds(scene, mesh, rows) for mesh in (*meshes[first : first + SOLUTIONS - 1], third)]


def _tolerances(scene, tol, bins_tol):
    """Return (tol, bins_tol, judged_by): errors of survival and of bins (L1) to refine for, and of bins to judge by."""
    tol = checks.number("tol", (1e-3 if scene.repeats else 1e-2) if tol is None else tol, at_least=min(USUAL))
    if bins_tol is None:
        judged_by = bins_tolerance(tol)
        return tol, judged_by if scene.repeats else math.inf, judged_by
    bins_tol = bins_tol if bins_tol == math.inf else checks.number("bins_tol", bins_tol, above=0.0)
    return tol, bins_tol, bins_tol


def _with_noise_replaced(scene, noise_replacement):
    """Return the scene to solve, with white or filtered noise: band noise is replaced, other scenes refused."""
    accepted = "'white' or 'filtered'"
    if not isinstance(noise_replacement, str):
        raise TypeError(checks.refusal("noise_replacement", noise_replacement, accepted))
    if noise_replacement not in ("white", "filtered"):
        raise ValueError(checks.refusal("noise_replacement", noise_replacement, accepted))
    if scene.noise.kind != "filtered":
        scene = scene.filtered_equivalent() if noise_replacement == "filtered" else scene.white_equivalent()
    if scene.noise.kind == "filtered" and not scene.repeats:
        accepted = "'white', or 'band' with the default replacement, as this scene does not repeat; or use Monte Carlo"
        raise ValueError(checks.refusal("noise.kind", scene.noise.kind, accepted))
    refuse_unsolvable(scene)
    refuse_slow(scene)
    return scene


def propagator_for(scene: Scene) -> type[PeriodicPropagator | TransientPropagator | FilteredPropagator]:
    """Return the class of propagator, a subclass of `Propagator`, for a scene whose noise is white or filtered."""
    if scene.noise.kind == "filtered":
        return FilteredPropagator
    return PeriodicPropagator if scene.repeats else TransientPropagator


def _discretizations(scene, white, motion, resolutions):
    """Return mesh and steps for each of some `resolutions`, a list of `Resolution`: a list of as many."""
    diffusion = white.noise.diffusion
    if scene.noise.kind == "filtered":
        # Noise of high frequencies moves a flight further than white noise of equal Melnikov variance.
        diffusion = max(equivalent_diffusion(scene.noise), scene.noise.variance * scene.noise.space.inward_variance)
    # Blocks that are bound to overturn, but have not yet, may be faster than the bound.
    bound = max(velocity_bound(white, diffusion), 1.1 * motion.fastest)
    planes, kind = [resolution.adapted(white, bound, motion) for resolution in resolutions], propagator_for(scene)
    first = len(RESOLUTIONS) - len(resolutions)
    return [kind.adapted(scene, plane, number) for number, plane in enumerate(planes, first)]


def _solve_level(scene, discretization, tol, times, edges, coarser, progress):
    """Solve at one resolution; of the coarser level, drop all that error estimates do not need."""
    begin, coarse = time.perf_counter(), None
    if coarser:
        coarse, densities = coarser.solution
        coarser.solution = None, densities._replace(coefficients=None)
    propagator = propagator_for(scene)(scene, discretization, TUNING.negligible_mass * tol, coarse)
    del coarse
    solution = propagator.propagate(times, progress)
    return _level_of(propagator, solution, edges, time.perf_counter() - begin)


def _level_of(propagator, solution, edges, seconds=0.0):
    """Return the `Level` of a `Solution`: survival and both sides, and binned densities in which rest is one bin."""
    space, densities, at_rest = propagator.space, solution.coefficients, solution.at_rest
    bins = space.bin_integrals(densities, *edges)
    if at_rest is not None:
        bins += at_rest[:, None, None] * np.histogram2d([0.0], [0.0], bins=edges)[0]
    resting = in_rest(*(0.5 * (line[1:] + line[:-1]) for line in edges))
    bins = np.column_stack([bins[:, ~resting], bins[:, resting].sum(axis=1)])
    moving = ~in_rest(*(0.5 * (line[1:] + line[:-1]) for line in space.lines))[:, :, None, None]
    negative = [
        space.negative_mass(np.where(moving, coefficients, 0.0)) for coefficients in densities[solution.resolved]
    ]
    rested = solution.reinjected if at_rest is None else at_rest[1:].max()
    truncated = float(np.abs(solution.outflow[:, 2]).max())
    probabilities = np.column_stack([solution.survival, 1.0 - solution.survival, solution.outflow[:, :2]])
    negative_probability = -float(probabilities.min())

    def error(difference, bins_difference):
        scale = TUNING.rest_error_factor if rested > difference else 1.0
        return max(scale * difference, TUNING.bins_part * bins_difference, truncated, negative_probability)

    return Level(
        solution=(propagator, solution),
        quantity=probabilities[:, [0, 2, 3]],
        bins=bins,
        resolved=solution.resolved,
        error=error,
        negative_mass=max(negative, default=0.0),
        memory=propagator.memory,
        seconds=seconds,
    )


def _rest_error(levels):
    """Return the estimated error of the probability of being at rest, a float; 0.0 where nothing can rest."""
    propagator, solution = levels[-1].solution
    if solution.at_rest is None:
        return 0.0
    before = [level.solution[1].at_rest for level in levels[-2:-4:-1]]
    differences = [float(np.abs(solution.at_rest - rest).max()) for rest in before]
    extrapolated = max(differences[k] / (1.4 ** (k + 1) - 1.0) for k in (0, 1))
    return extrapolated + propagator.node_error * float(solution.at_rest[1:].max())


def _is_stagnated(refined):
    """Whether the density of a `Refined` will not be resolved by the finer solutions that are left: a bool."""
    if len(refined.levels) <= SOLUTIONS:
        return False
    now, before = refined.fine.negative_mass, refined.coarse.negative_mass
    ratio = min(now / before, TUNING.negative_mass_ratio) if before > 0.0 else TUNING.negative_mass_ratio
    limit = TUNING.unresolved_negative_mass
    return now > limit and now * ratio ** (2 * refined.finer) > limit


def _refuse_unresolved(result):
    """Raise ValueError where the negative mass of the moving blocks of an `Evolution` is too large."""
    negative, limit = result.moving_negative_mass, TUNING.unresolved_negative_mass
    if negative > limit:
        raise ValueError(
            f"scene: got a density that a mesh of {result.settings['unknowns']:,} unknowns does not resolve, nor would "
            f"the finest (negative mass {negative:.1e}), accepted: up to {limit}; the noise, of diffusion "
            f"{result.diffusion:.3g}, is too weak, or filtered noise too slow: use Monte Carlo"
        )


FREE_FLIGHT = Task(f"{__name__}:compile_free_flight", 15)
DENSITY = {kind: Task(f"{__name__}:compile_density:{kind}", 15 if kind == "slender" else 20) for kind in KINDS}
"""Tasks that compile the kernels of a density, by kind of block."""


def compile_density(kind):
    """Solve one cycle coarsely, which needs all kernels of a density under white noise."""
    solve_fpk(least_scenes(kind)["white"], cycles=1, tol=1e-3)


def compile_free_flight():
    """Take a step of free flight, which a density needs last, on few cells of the degree at which it usually ends."""
    space = Space(graded_lines(1.5, 4, 1.0), graded_lines(2.0, 4, 1.0), RESOLUTIONS[USUAL[1e-3]].degree)
    free, affine = np.ones(space.shape[:2], dtype=bool), Dynamics.of(least_scenes("slender")["white"]).affine(0.0, 0.1)
    FreeFlight(space, free, affine, 0.05, 0.1, 5).apply(np.ones(space.shape), np.zeros(space.shape))
