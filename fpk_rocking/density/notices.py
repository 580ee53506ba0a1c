"""What a user is told beside a density: scenes refused, too much memory, seconds to come, a tolerance that is missed.

The one-cycle operator (`horizon`) uses the refusals and the warning too.
"""

import itertools
import math
import sys
import warnings
from collections.abc import Sequence

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array, not_none
from fpk_rocking.density.filter_nodes import spread_left
from fpk_rocking.density.refinement import Refined
from fpk_rocking.density.resolution import Discretization, cycle_of, periods_per_cycle
from fpk_rocking.density.space import Space
from fpk_rocking.density.step.dynamics import Dynamics
from fpk_rocking.density.step.step import Characteristics
from fpk_rocking.density.tuning import TUNING
from fpk_rocking.physics.motion import CRITICAL_RESTITUTION
from fpk_rocking.scene import ranges
from fpk_rocking.scene.scene import Scene


def refuse_filtered(scene: Scene) -> None:
    """Raise ValueError for a scene with filtered noise, as the one-cycle operator has no states of a filter."""
    if scene.noise.kind == "filtered":
        takes = "solve_fpk() takes filters of up to 2 states"
        accepted = (
            f"'band' or 'white', as the one-cycle operator has no states of a filter; {takes}, and "
            "scene.white_equivalent() replaces filtered noise by white noise, under which no block rests"
        )
        raise ValueError(checks.refusal("noise.kind", scene.noise.kind, accepted))


def refuse_unsolvable(scene: Scene) -> None:
    """Raise ValueError for a scene that the density solver cannot take, else return None."""
    ranges.check(scene)
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
    """Raise ValueError for a scene with noise so slow that a start of small spread stays a curve; else return None."""
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


def warn_beyond(
    what: str,
    refined: Refined,
    wanted: float,
    bins_wanted: float,
    instead: str,
    stacklevel: int,
    names: tuple[str, str] = ("tol", "bins_tol"),
) -> None:
    """Warn where an estimated error, or that of the binned density, is larger than wanted; nothing is returned."""
    if refined.error > wanted or refined.bins_error > bins_wanted:
        missed = itertools.compress(names, (refined.error > wanted, refined.bins_error > bins_wanted))
        allowed = " and ".join(dict.fromkeys(missed))
        warnings.warn(
            f"not within the tolerance: estimated error {refined.error:.1e} in {what} ({wanted:.1e} wanted) and "
            f"{refined.bins_error:.1e} in the binned density ({bins_wanted:.1e} wanted) on the finest mesh for this "
            f"scene; allow a larger {allowed}, or {instead}",
            RuntimeWarning,
            stacklevel=stacklevel,
        )


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
