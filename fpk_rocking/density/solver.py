"""`solve_fpk`: the Fokker-Planck equation of a scene, solved from its start to the wanted times and to a tolerance."""

import dataclasses
import math
import sys
import time
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array, ArrayLike, Progress, not_none
from fpk_rocking.base.precompilation import Compilation, mark_announced, start_helpers
from fpk_rocking.density.evolution import Evolution, near_rest, refuse_broken, warn_unresolved
from fpk_rocking.density.filter_nodes import FilteredDiscretization, filtered_discretization, may_rest
from fpk_rocking.density.filtered import REST, FilteredPropagator
from fpk_rocking.density.propagator import PeriodicPropagator, Solution
from fpk_rocking.density.refinement import SOLUTIONS, ProgressCount, refine, warn_beyond
from fpk_rocking.density.replacing import (
    REPLACEMENTS,
    STRENGTHS,
    UNCERTAIN_PART,
    choose,
    lighter_tails,
    replaced_scene,
    scatter_of_strength,
    second_derivative,
)
from fpk_rocking.density.resolution import (
    RESOLUTIONS,
    USUAL,
    Discretization,
    StateRange,
    bins_tolerance,
    cycle_of,
    explore,
    periods_per_cycle,
    resolutions_for,
)
from fpk_rocking.density.space import Space, graded_lines, velocity_bound
from fpk_rocking.density.startup import spread_left
from fpk_rocking.density.step.dynamics import Dynamics
from fpk_rocking.density.step.free_flight import FreeFlight
from fpk_rocking.density.step.step import Characteristics
from fpk_rocking.density.transient import TransientPropagator
from fpk_rocking.density.tuning import TUNING
from fpk_rocking.physics.forcing import refuse_vertical
from fpk_rocking.physics.motion import CRITICAL_RESTITUTION
from fpk_rocking.physics.noise.equivalence import equivalent_diffusion
from fpk_rocking.results.remarks import describe_replacement
from fpk_rocking.scene import ranges
from fpk_rocking.scene.axes import result_times, times_in_cycles
from fpk_rocking.scene.least import KINDS, kind_of, least_scenes
from fpk_rocking.scene.scene import Scene


def solve_fpk(
    scene: Scene,
    *,
    cycles: int | None = None,
    times: ArrayLike | None = None,
    samples_per_cycle: int | None = None,
    tol: float | None = None,
    bins_tol: float | None = None,
    noise_replacement: str = "auto",
    progress: Progress | None = None,
) -> Evolution:
    """Solve the Fokker-Planck equation of a scene for the joint density of angle and velocity.

    White noise and filtered noise are solved as they are, band noise is replaced. The mesh is refined until the
    estimated errors are within the tolerances, or until a finer one would take too much memory.

    The solver pays off for errors below 1e-3, for joint densities and for small probabilities; else
    `montecarlo.simulate` is as fast or faster on most blocks of practical sizes.

    Parameters
    ----------
    scene : Scene
        With white, filtered or band noise. Filtered noise needs a scene that repeats (`Scene.repeats`).
    cycles : int, optional
        Required where the forcing repeats, refused where it does not.
    times : array_like, optional
        For a pulse or a record: ascending, nondimensional; by default 21 over its duration, and one 10 after its end.
    samples_per_cycle : int, optional
        Number of times in each cycle, equally spaced; by default 1, its end. Refused where the forcing does not repeat.
    tol : float, optional
        Wanted error of survival, at least 1e-4. By default .001, or .01 for a scene that does not repeat. If the
        estimated error of the chosen noise replacement is above 3 `tol`, a third of it is aimed at instead, up to .01.
    bins_tol : float, optional
        Wanted error of the binned density (L1), above 0; a bin is a twentieth of the range in which the block moves.
        With inf the mesh is refined for survival alone. By default √tol / 3. If the scene does not repeat, this default
        decides about the verdict alone, and the mesh is refined for survival.
    noise_replacement : {"auto", "white", "exponential", "filtered"}
        What replaces band noise: white noise of equal Melnikov variance, under which no block comes to rest, or
        exponential or low-pass noise of equal variance and Melnikov variance, under which blocks do. By default the
        fastest of these whose estimated error is within `tol`, else the most accurate; the effect of finitely many
        independent harmonics is then added (`density.replacing`). If the scene does not repeat, white noise.
    progress : callable, optional
        Called as ``progress(done, total)`` after each cycle of each solution; `total` grows with every refinement.

    Warns
    -----
    RuntimeWarning
        The estimated error on the finest mesh is larger than `tol` or `bins_tol`; under filtered noise, also where that
        of the probability of being at rest is larger than `bins_tol`.

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
    [1.   1.   1.   0.97 0.87] True
    """
    begin = time.perf_counter()
    checks.instance("scene", scene, Scene)
    times = result_times(scene, cycles, times, samples_per_cycle)
    wanted, *_ = _tolerances(scene, tol, bins_tol)
    replaced, choice = _with_noise_replaced(scene, noise_replacement, times, wanted)
    tol, bins_tol, judged_by = _tolerances(scene, choice.tol if choice else wanted, bins_tol)
    advances, filtered = len(times) - 1, replaced.noise.kind == "filtered"
    _start_compiling(scene)
    solved, motion, coarser, meshes = _planned(replaced, times, tol)
    # The factor of the last difference of the bins is held against true errors where white noise and cycles are.
    calibrated, count = solved.repeats and not filtered, ProgressCount(progress, advances)
    announce(solved, meshes[:SOLUTIONS], times, tol)

    def solve(mesh, coarser):
        return _solve(solved, mesh, tol, times, motion.edges, coarser, count.start_solution())

    def fits(solution, mesh):
        before = solution.propagator.discretization
        needed = solution.memory * mesh.memory / before.memory + mesh.stored(advances)
        if needed > (TUNING.finer_filtered if filtered else TUNING.finer_white):
            return False
        announce_finer(solved, before, mesh, times, solution.seconds)
        return True

    def is_done(refined):
        return refined.within(tol, bins_tol) or _is_stagnated(refined)

    refined = refine(meshes, solve, fits, is_done, coarser, TUNING.bins_last if calibrated else 1.0)
    mark_announced()

    fine = refined.solutions[-1]
    propagator = fine.propagator
    neglected = {} if choice is None else {"choice": choice.reason, "errors": choice.errors, "error": choice.error}
    scatter = 0.0 if choice is None else scatter_of_strength(scene)
    if scatter and scene.noise.kind == "band":
        changed = with_few_harmonics(fine, scene, scatter, scene.noise.harmonics, tol, times)
        neglected |= {"scatter": scatter, "error": choice.error + UNCERTAIN_PART * changed}
    at_rest = fine.at_rest
    unresolved = [row for row in range(1, advances + 1) if not fine.resolved[row]]
    result = Evolution(
        scene=scene,
        diffusion=replaced.white_equivalent().noise.diffusion,
        noise_replacement=describe_replacement(scene, replaced),
        tol=tol,
        times=times,
        survival=fine.survival,
        overturned=fine.outflow[:, :2],
        at_rest=near_rest(propagator.space, fine.coefficients, scene.start) if at_rest is None else at_rest,
        truncated=fine.outflow[:, 2],
        error_estimate=refined.error,
        bins_error_estimate=refined.bins_error,
        rest_error_estimate=_rest_error(refined.solutions, replaced.noise),
        mass_defect=float(np.abs(fine.survival + fine.outflow.sum(axis=1) - 1.0).max()),
        negative_mass=max(map(propagator.space.negative_mass, fine.coefficients[fine.resolved]), default=0.0),
        moving_negative_mass=fine.negative_mass,
        wall_s=time.perf_counter() - begin,
        settings=propagator.discretization.settings
        | {"unknowns": propagator.space.unknowns, "velocity_bound": float(propagator.space.velocity_lines[-1])}
        | {"bins_tol": judged_by}
        | ({"unresolved": unresolved} if unresolved else {})
        | ({"replacement": neglected} if neglected else {}),
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


class Plan(NamedTuple):
    """What is solved: a scene, how far it moves, meshes whose solutions only start others, and those of the ladder."""

    scene: Scene
    motion: StateRange
    coarser: list[Discretization | FilteredDiscretization]
    meshes: list[Discretization | FilteredDiscretization]


def _planned(replaced, times, tol):
    """Return the `Plan` for a scene with white or filtered noise; ValueError if it cannot be solved."""
    _refuse(replaced)
    filtered = replaced.noise.kind == "filtered"
    # Meshes, steps and thresholds go by D: it is that of the noise at its peak.
    white = _at_unit_peak(replaced.white_equivalent())
    solved = replaced if filtered else white
    motion = explore(white, times)
    # With coarser steps the probability of being at rest, and the estimate of its error, are too far off.
    early = not may_rest(solved) if filtered else solved.repeats and motion.standing >= TUNING.mostly_standing
    meshes = _discretizations(solved, white, motion, resolutions_for(tol, SOLUTIONS, filtered, early))
    first = len(meshes) - len(resolutions_for(tol, SOLUTIONS - 1, filtered, early))
    plan = Plan(solved, motion, meshes[:first], meshes[first:])
    usual, advances = plan.meshes[SOLUTIONS - 1], len(times) - 1
    refuse_large(usual.memory, usual.stored(advances), solved, advances)
    return plan


def predicted_seconds(
    scene: Scene, *, tol: float, cycles: int | None = None, times: ArrayLike | None = None
) -> list[float]:
    """Predict the seconds of one processor that each solution of `solve_fpk` takes, to about a factor of two."""
    rows = result_times(scene, cycles, times)
    plan = _planned(scene, rows, tol)
    third = plan.coarser[0] if plan.coarser else plan.meshes[SOLUTIONS - 1]
    return [estimated_seconds(scene, mesh, rows) for mesh in (*plan.meshes[: SOLUTIONS - 1], third)]


def _tolerances(scene, tol, bins_tol):
    """Return (tol, bins_tol, judged_by): errors of survival and of bins (L1) to refine for, and of bins to judge by."""
    tol = checks.number("tol", (1e-3 if scene.repeats else 1e-2) if tol is None else tol, at_least=min(USUAL))
    if bins_tol is None:
        judged_by = bins_tolerance(tol)
        return tol, judged_by if scene.repeats else math.inf, judged_by
    bins_tol = bins_tol if bins_tol == math.inf else checks.number("bins_tol", bins_tol, above=0.0)
    return tol, bins_tol, bins_tol


def _with_noise_replaced(scene, noise_replacement, times, tol):
    """Return the scene to solve, with white or filtered noise, and the `Choice` of a replacement, None if not asked."""
    accepted = "'white', 'exponential', 'filtered' or 'auto'"
    if not isinstance(noise_replacement, str):
        raise TypeError(checks.refusal("noise_replacement", noise_replacement, accepted))
    if noise_replacement not in (*REPLACEMENTS, "auto"):
        raise ValueError(checks.refusal("noise_replacement", noise_replacement, accepted))
    chosen = noise_replacement == "auto" and scene.repeats and scene.noise.kind == "band" and scene.noise.variance > 0.0
    if not chosen:
        return replaced_scene(scene, "white" if noise_replacement == "auto" else noise_replacement), None
    _start_compiling(scene)

    def solve(white):
        return _solve_coarsely(white, round(times[-1] / white.period))

    choice = choose(scene, tol, solve, lambda replaced: _planned(replaced, times, tol))
    return choice.scene, choice


def _start_compiling(scene):
    """Start helpers that compile what the density of a scene needs."""
    start_helpers(DENSITY[kind_of(scene.block)], FREE_FLIGHT)


def _refuse(scene):
    """Raise ValueError for a scene, with white or filtered noise, that cannot be solved."""
    if scene.noise.kind == "filtered" and not scene.repeats:
        accepted = "'white', or 'band' with the default replacement, as this scene does not repeat; or use Monte Carlo"
        raise ValueError(checks.refusal("noise.kind", scene.noise.kind, accepted))
    refuse_unsolvable(scene)
    refuse_slow(scene)


def _solve_coarsely(white, cycles):
    """Return (quantity, part next to rest) of a scene with white noise, at four times a cycle on the coarsest mesh.

    The quantity is survival, overturned left and right, (rows, 3); the part is the largest from the first cycle on.
    """
    times = times_in_cycles(white, cycles, 4)
    motion = explore(white, times)
    (mesh,) = _discretizations(white, white, motion, RESOLUTIONS[:1])
    solution = _solve(white, mesh, max(USUAL), times, motion.edges, None, None)
    resting = near_rest(solution.propagator.space, solution.coefficients, white.start)
    return solution.quantity, float(resting[4:].max())


def with_few_harmonics(
    solution: Solution, scene: Scene, scatter: float, harmonics: int, tol: float, times: Array
) -> float:
    """Change a `Solution` in place by the `scatter` of strength and the tails of few harmonics; return by how much.

    The changes are those of densities under white noise on the same mesh, or in proportion to it.
    """
    discretization = solution.propagator.discretization
    plane = getattr(discretization, "plane", discretization)
    white, parts = _at_unit_peak(scene.white_equivalent()), []
    for strength in STRENGTHS:
        noise = dataclasses.replace(white.noise, diffusion=strength * white.noise.diffusion)
        parts.append(_solve(white.varied(noise=noise), plane, tol, times, solution.edges, None, None))
    before, variance = solution.quantity, 0.5 * scatter**2
    tails = lighter_tails(scatter, harmonics, [part.survival for part in parts])
    overturned = solution.outflow.sum(axis=1)
    back = np.divide(tails * solution.survival, overturned, out=np.zeros_like(tails), where=overturned > 0.0)
    solution.coefficients *= 1.0 + tails.reshape(-1, *(1,) * (solution.coefficients.ndim - 1))
    solution.coefficients += variance * second_derivative([part.coefficients for part in parts])
    if solution.at_rest is not None:
        solution.at_rest *= 1.0 + tails
    solution.survival *= 1.0 + tails
    solution.survival += variance * second_derivative([part.survival for part in parts])
    solution.outflow *= 1.0 - back[:, None]
    solution.outflow += variance * second_derivative([part.outflow for part in parts])
    return float(np.abs(solution.quantity - before).max())


def _at_unit_peak(white):
    """Return a scene with the same white noise by an envelope whose largest value is 1."""
    noise = white.noise.with_unit_peak
    return white if noise is white.noise else dataclasses.replace(white, noise=noise)


def propagator_for(scene: Scene) -> type[PeriodicPropagator | TransientPropagator | FilteredPropagator]:
    """Return the subclass of `Propagator` for a scene whose noise is white or filtered."""
    if scene.noise.kind == "filtered":
        return FilteredPropagator
    return PeriodicPropagator if scene.repeats else TransientPropagator


def _discretizations(scene, white, motion, resolutions):
    """Return one discretization, mesh and steps, for each resolution."""
    diffusion = white.noise.diffusion
    if scene.noise.kind == "filtered":
        # Noise of high frequencies moves a flight further than white noise of equal Melnikov variance.
        diffusion = max(equivalent_diffusion(scene.noise), scene.noise.variance * scene.noise.space.inward_variance)
    # Blocks that are bound to overturn, but have not yet, may be faster than the bound.
    bound = max(velocity_bound(white, diffusion), 1.1 * motion.fastest)
    filtered = scene.noise.kind == "filtered"
    planes = [resolution.adapted(white, bound, motion, filtered=filtered) for resolution in resolutions]
    if not filtered:
        return planes
    start_helpers(REST[kind_of(scene.block)])
    first = len(RESOLUTIONS) - len(resolutions)
    return [filtered_discretization(scene, plane, max(number, 0)) for number, plane in enumerate(planes, first)]


def _solve(scene, discretization, tol, times, edges, coarser, progress):
    """Return the `Solution` at one resolution, for times (rows,); it starts from what the coarser one found."""
    begin = time.perf_counter()
    coarse = coarser.release() if coarser else None
    propagator = propagator_for(scene)(scene, discretization, TUNING.negligible_mass * tol, coarse)
    del coarse
    solution = propagator.propagate(times, progress)
    solution.edges, solution.seconds = edges, time.perf_counter() - begin
    return solution


def _rest_error(solutions, noise):
    """Return the estimated error of the probability of being at rest; 0.0 where nothing can rest.

    Of what passes the level of lift-off between two steps and comes back a part of the order of the step is missed,
    or of its root where white noise drives the force itself.
    """
    fine = solutions[-1]
    if fine.at_rest is None:
        return 0.0
    order = 1.0 if noise.space.smooth else 0.5
    differences = [float(np.abs(fine.at_rest - coarser.at_rest).max()) for coarser in solutions[-2:-4:-1]]
    return max(differences[k] / (1.4 ** (order * (k + 1)) - 1.0) for k in (0, 1))


def _is_stagnated(refined):
    """Whether the density of a `Refined` will not be resolved by the finer solutions that are left: a bool."""
    if len(refined.solutions) <= SOLUTIONS:
        return False
    before, now = (solution.negative_mass for solution in refined.solutions[-2:])
    ratio = min(now / before, TUNING.negative_mass_ratio) if before > 0.0 else TUNING.negative_mass_ratio
    limit = TUNING.unresolved_negative_mass
    return now > limit and now * ratio ** (2 * refined.finer) > limit


def _refuse_unresolved(result):
    """Raise ValueError where the negative mass of the moving blocks of an `Evolution` is too large."""
    negative, limit = result.moving_negative_mass, TUNING.unresolved_negative_mass
    if negative > limit:
        raise ValueError(
            f"scene: got a density that a mesh of {result.settings['unknowns']:,} unknowns does not resolve, nor would "
            f"the finest (negative mass {negative:.1e}), accepted: a mass up to {limit}; the noise, of diffusion "
            f"{result.diffusion:.3g}, is too weak for motions of such different sizes, or filtered noise too slow: use "
            "Monte Carlo"
        )


def refuse_unsolvable(scene: Scene) -> None:
    """Raise ValueError for a scene that the density solver cannot take."""
    ranges.check(scene)
    refuse_vertical(scene.forcing, "densities")
    noise = scene.noise
    if noise.kind == "filtered":
        reason = "the density under filtered noise, which lifts a block off to both sides at one level of the force"
        scene.block.require_symmetric(reason, "use Monte Carlo, or white noise")
    if noise.kind == "filtered" and noise.space.order > 2:
        accepted = (
            "filters of up to 2 states, each of which is one more variable of the density; use Monte "
            "Carlo, simulate(), or scene.white_equivalent(), white noise of equal Melnikov variance"
        )
        raise ValueError(f"noise.filter: got {noise.filter} ({noise.space.order} states), accepted: {accepted}")
    if (noise.diffusion if noise.kind == "white" else noise.variance) == 0.0:
        accepted = "noise of a variance or diffusion above 0, as without noise there is no density; use Monte Carlo"
        raise ValueError(f"noise: got none, accepted: {accepted}")
    if noise.kind == "white" and math.prod(scene.block.restitution_by_side) <= CRITICAL_RESTITUTION**2:
        accepted = (
            f"above {CRITICAL_RESTITUTION:.5f} under white noise, as at or below that impacts accumulate in finite "
            "time and the motion after them is not defined; use Monte Carlo under band noise, or "
            "noise_replacement='filtered'"
        )
        raise ValueError(checks.refusal("block.restitution", scene.block.restitution, accepted))


def refuse_slow(scene: Scene) -> None:
    """Raise ValueError for a scene with noise so slow that a start of small spread stays a curve."""
    noise = scene.noise
    if noise.kind != "filtered":
        return
    time = max(not_none(scene.period), TUNING.spreading_time)
    wanted = TUNING.spread_left_of_one if noise.space.order == 1 else TUNING.spread_left_of_two
    faster = 1.0
    while spread_left(noise.scaled(1.0, faster), scene.start.covariance, time) < wanted:
        faster *= 1.05
    if faster > 1.0:
        frequency = noise.frequency
        least = f"{frequency * faster:.2g}" if frequency is not None else f"{faster:.2g} times as fast"
        accepted = (
            f"at least about {least} with this filter, start and period, as under slower noise the density is too "
            "narrow for any mesh; use Monte Carlo"
        )
        name, value = ("noise.frequency", frequency) if frequency is not None else ("noise.filter", noise.filter)
        raise ValueError(checks.refusal(name, value, accepted))


def refuse_large(needed: float, stored: float, scene: Scene, rows: int) -> None:
    """Raise ValueError for too many bytes: `needed` by a solution, `stored` of its density at all `rows` times."""
    largest = TUNING.largest_filtered if scene.noise.kind == "filtered" else TUNING.largest_white
    if needed > largest:
        raise ValueError(
            f"scene: got a mesh and time steps that take {needed:.1e} bytes, accepted: up to {largest:g}; stronger "
            "noise, a shorter period or a smaller overturning angle need less, or use Monte Carlo"
        )
    if needed + stored > largest:
        accepted = f"fewer, as the densities after all of them would take {stored:.1e} bytes, more than {largest:g}"
        raise ValueError(checks.refusal("number of times" if scene.period is None else "cycles", rows, accepted))


def estimated_seconds(scene: Scene, discretization: Discretization, times: Array) -> float:
    """Seconds of one processor that a solution takes, to about a factor of two."""
    space = Space(discretization.angle_lines, discretization.velocity_lines, discretization.degree)
    dynamics, rule = Dynamics.of(scene), discretization.quadrature
    duration = cycle_of(scene) / discretization.steps
    # The cells that events can reach are counted in eight of the steps.
    begins = np.linspace(0.0, scene.period or times[-1], 8, endpoint=False)
    traces = [Characteristics(space, begin, duration, dynamics, rule, cells=False) for begin in begins.tolist()]
    paths = np.mean([trace.event_cells.sum() for trace in traces]) * rule.angle * rule.velocity * rule.long * rule.short
    steps = times[-1] / duration
    different = discretization.steps / periods_per_cycle(scene) if scene.repeats else steps
    path = TUNING.seconds_exact_path if scene.block.critical_angle else TUNING.seconds_path
    preparation = paths * path + space.unknowns * TUNING.seconds_preparation
    if discretization.contact_parts > 1:
        preparation += discretization.contact_parts * TUNING.seconds_contact_part
    application = paths * TUNING.seconds_deposit + space.unknowns * TUNING.seconds_flight
    return float(TUNING.seconds_startup + different * preparation + steps * application)


def announce(scene: Scene, discretizations: Sequence[Discretization], times: Array, tol: float) -> None:
    """Print to standard error the estimated time of some solutions, if long, and of the sampling that replaces them."""
    if scene.noise.kind != "white":
        return
    seconds = sum(estimated_seconds(scene, discretization, times) for discretization in discretizations)
    if seconds >= TUNING.long_seconds:
        rounded, paths = float(f"{seconds:.1g}"), 10 ** math.ceil(math.log10(0.25 / tol**2) - 1e-9)
        sys.stderr.write(
            f"density: about {rounded:,.0f} s of one processor, more where the tolerance asks for a finer solution; "
            f"{paths:,} sampled paths give a standard error of {0.5 / math.sqrt(paths):.1g}\n"
        )


def announce_finer(scene: Scene, before: Discretization, finer: Discretization, times: Array, taken: float) -> None:
    """Print to standard error the estimated time of a finer solution, if long, by that of the one before."""
    if scene.noise.kind != "white":
        return
    seconds = taken * estimated_seconds(scene, finer, times) / estimated_seconds(scene, before, times)
    if seconds >= TUNING.long_seconds:
        sys.stderr.write(f"density: the tolerance asks for a finer solution, about {float(f'{seconds:.1g}'):,.0f} s\n")


FREE_FLIGHT = Compilation(f"{__name__}:compile_free_flight", 15)
DENSITY = {kind: Compilation(f"{__name__}:compile_density:{kind}", 15 if kind == "slender" else 20) for kind in KINDS}
"""Compilations of the kernels of a density, by kind of block."""


def compile_density(kind: str) -> None:
    """Solve one cycle coarsely, which needs all kernels of a density under white noise."""
    solve_fpk(least_scenes(kind)["white"], cycles=1, tol=1e-3)


def compile_free_flight() -> None:
    """Take a step of free flight, which a density needs last, on few cells of the degree at which it usually ends."""
    space = Space(graded_lines(1.5, 4, 1.0), graded_lines(2.0, 4, 1.0), RESOLUTIONS[USUAL[1e-3]].degree)
    free, affine = np.ones(space.shape[:2], dtype=bool), Dynamics.of(least_scenes("slender")["white"]).affine(0.0, 0.1)
    FreeFlight(space, free, affine, 0.05, 0.1, 5).apply(np.ones(space.shape), np.zeros(space.shape))
