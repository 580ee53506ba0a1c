"""Refinement: solve at finer and finer resolutions until differences show that the last solution is good enough.

The same loop serves `solve_fpk`, whose solutions are densities over some cycles, and the one-cycle operator, whose
solutions are the operator on one mesh each. `estimate_errors` makes the estimates of differences; what differences do
not tell comes with each `Level`: in `solver._level_of` what is truncated, negative probability, and rest.

What a user is told beside it: scenes refused, seconds that the solutions take, results that miss the tolerance.
"""

import dataclasses
import itertools
import math
import sys
import warnings
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array, Progress, not_none
from fpk_rocking.density.filter_nodes import spread_left
from fpk_rocking.density.resolution import Discretization, cycle_of, periods_per_cycle
from fpk_rocking.density.space import Space
from fpk_rocking.density.step.dynamics import Dynamics
from fpk_rocking.density.step.step import Characteristics
from fpk_rocking.density.tuning import TUNING
from fpk_rocking.physics.motion import CRITICAL_RESTITUTION
from fpk_rocking.scene import ranges
from fpk_rocking.scene.scene import Scene

SOLUTIONS = 3
"""Least number of solutions: the last, and two that serve its error estimate alone."""


@dataclasses.dataclass
class Level:
    """A solution at one resolution, and what refinement compares of it with other solutions.

    Parameters
    ----------
    solution : object
        What the caller computed.
    quantity : ndarray
        The wanted quantity, whose largest difference counts: survival, left and right at all times, or the logarithm of
        a rate.
    bins : ndarray, shape (rows, bins)
        Probabilities in the bins of each density, whose L1 difference counts.
    resolved : ndarray of bool, shape (rows,)
        Rows of the bins that are compared.
    error : callable
        Takes estimated errors of the quantity and of the bins from differences; returns the error of the quantity with
        all that differences do not tell.
    negative_mass : float
        Largest integral of max(-p, 0) over the densities p.
    memory : float
        Bytes that it took.
    seconds : float
        Seconds that it took.
    """

    solution: Any
    quantity: Array
    bins: Array
    resolved: Array
    error: Callable[[float, float], float]
    negative_mass: float
    memory: float
    seconds: float = 0.0

    def differences(self, coarser: "Level") -> tuple[float, float]:
        """Return the largest differences from a `coarser` level, (quantity's, binned density's in L1), floats.

        They are inf where undefined.
        """
        quantity = float(abs(self.quantity - coarser.quantity).max())
        rows = self.resolved & coarser.resolved
        bins = float(abs(self.bins - coarser.bins)[rows].sum(axis=1).max(initial=0.0))
        return math.inf if math.isnan(quantity) else quantity, bins


class Refined(NamedTuple):
    """All levels of a refinement, and the estimated errors of the last.

    Parameters
    ----------
    levels : list of Level
        From coarse to fine.
    error, bins_error : float
        Estimated errors of the wanted quantity and of the binned density (L1).
    finer : int
        Number of finer resolutions that are left.
    """

    levels: list[Level]
    error: float
    bins_error: float
    finer: int

    @property
    def fine(self) -> Level:
        """The last `Level`, of the finest resolution."""
        return self.levels[-1]

    @property
    def coarse(self) -> Level:
        """The `Level` before the last."""
        return self.levels[-2]

    def within(self, wanted: float, bins_wanted: float) -> bool:
        """Whether both errors are as small as wanted, and the density is resolved: a bool.

        `wanted` is that of the quantity, `bins_wanted` that of the binned density (L1).
        """
        resolved = self.fine.negative_mass <= TUNING.unresolved_negative_mass
        return self.error <= wanted and self.bins_error <= bins_wanted and resolved


def refine(
    resolutions: list[Any],
    solve: Callable[[Any, Level | None], Level],
    fits: Callable[[Level, Any], bool],
    is_done: Callable[[Refined], bool],
    coarser: Sequence[Any] = (),
) -> Refined:
    """Solve on ever finer resolutions until the errors are small enough.

    Where the first two agree well, the third solution is coarser than both, and cheap, and not finer.

    Parameters
    ----------
    resolutions : list
        What `solve` takes, from coarse to fine; at least `SOLUTIONS`.
    solve : callable
        Takes a resolution and the level before (None at first), returns a level.
    fits : callable
        Takes the last level and a resolution: whether there is memory for it. Not called for the first `SOLUTIONS`.
    is_done : callable
        Takes a `Refined`: whether it is good enough, or finer levels will not be.
    coarser : sequence, optional
        Resolutions coarser than the first, from coarse to fine.

    Returns
    -------
    Refined
        Named tuple of all levels and the errors of the last.
    """
    levels: list[Level] = []
    for number, resolution in enumerate(resolutions, 1):
        if number > SOLUTIONS and not fits(levels[-1], resolution):
            break
        levels.append(solve(resolution, levels[-1] if levels else None))
        finer = len(resolutions) - number
        if number == SOLUTIONS - 1 and coarser and is_done(estimate_errors(levels, finer)):
            levels.insert(0, solve(coarser[-1], None))
        if len(levels) >= SOLUTIONS:
            refined = estimate_errors(levels, finer)
            if is_done(refined):
                break
    return refined


def estimate_errors(levels: list[Level], finer: int) -> Refined:
    """Return the `Refined` of some levels: the errors of the last, estimated from its differences from the others.

    `levels` are from coarse to fine; `finer` is the number of resolutions that are left. Two levels may agree by
    chance: their difference counts twice. Errors of bins are sums over many and seldom small by chance, so the
    difference before the last counts less there.
    """
    fine = levels[-1]
    quantity, bins = zip(*(fine.differences(level) for level in levels[:-1]), strict=True)
    if len(levels) == SOLUTIONS - 1:
        quantity, bins = (0.0, 2.0 * quantity[0]), (bins[0], bins[0])
    bins_error = max(bins[-1], min(TUNING.bins_before * bins[-2], TUNING.bins_at_most * bins[-1]))
    return Refined(levels, fine.error(safe_difference(quantity), bins[-1]), bins_error, finer)


def safe_difference(distances: tuple[float, ...]) -> float:
    """Return the estimated error, a float, of the last of finer and finer solutions, from its `distances` (n,).

    These are its distances to the other solutions, in their order. The solutions are three or more. The last distance
    is the error of the solution before, if the last solution is far better. It can be accidentally small; .3 of the
    previous distance is therefore a floor. The result is 1.4 times the larger, for safety. Earlier distances do not
    enter.
    """
    before, last = distances[-2:]
    return TUNING.safety * max(last, TUNING.difference_before * before)


class ProgressCount:
    """Counts the rows of all solutions, of which there are at least `SOLUTIONS`.

    Parameters
    ----------
    report : callable or None
        Called as ``report(done, total)`` after each row, with numbers of rows.
    rows : int
        Rows, the times but the first, of one solution.
    """

    def __init__(self, report: Progress | None, rows: int) -> None:
        self.report, self.rows, self.done, self.total = checks.report(report), rows, 0, SOLUTIONS * rows

    def start_solution(self) -> Callable[[], None]:
        """Count another solution in, and return a function without arguments to call after each of its rows."""
        self.total = max(self.done + self.rows, self.total)
        return self._count

    def _count(self) -> None:
        """Report one more row to `report`; return None."""
        self.done += 1
        if self.report:
            self.report(self.done, self.total)


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
    """Raise ValueError for a scene that the density solver cannot take, else return None.

    Its noise is white or filtered. It is out of range, without noise, of too many states of a filter, or with
    infinitely many impacts.
    """
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
    """Raise ValueError for a scene with noise so slow that a start of small spread stays a curve; else return None.

    The noise is filtered: the curve is the density at each of its states.
    """
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
    """Raise ValueError for too many bytes: `needed` by a solution, `stored` of its density at all `rows` times.

    `scene` is solved, and `rows` a count; otherwise None is returned.
    """
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
    """Warn where an estimated error, or that of the binned density, is larger than wanted; nothing is returned.

    Parameters
    ----------
    what : str
        The quantity that the first error is of, for the text of the warning.
    refined : Refined
        Its estimates.
    wanted, bins_wanted : float
        What they should be at most; the second is an L1 error.
    instead : str
        What else to try, in the imperative, which ends the warning: "compare with Monte Carlo".
    stacklevel : int
        Calls from here to the user's, for the warning's line.
    names : tuple of str
        Parameters that tell what is wanted: that of the first error and that of the second.
    """
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
    """Seconds of one processor that a solution takes, to about a factor of two.

    Parameters
    ----------
    scene : Scene
        With white noise.
    discretization : Discretization
        Its mesh and steps.
    times : ndarray, shape (rows,)
        Nondimensional times that it is wanted for.

    Returns
    -------
    float
        Seconds.
    """
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
    """Print to standard error the estimated time of some solutions, if long, and of the sampling that replaces them.

    `times` (rows,): those of the result, nondimensional; `tol`: wanted error of survival, which sets the number of
    sampled paths; `discretizations`: mesh and steps of each solution of `scene`. Nothing is returned.
    """
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
    """Print to standard error the estimated time of a finer solution, if long, by that of the one before.

    `before`, `finer`: their meshes and steps; `times` (rows,): those of the result, nondimensional; `taken`: seconds
    that the one before took. Only white noise has an estimate: for other noise nothing is printed. Nothing is returned.
    """
    if scene.noise.kind != "white":
        return
    seconds = taken * estimated_seconds(scene, finer, times) / estimated_seconds(scene, before, times)
    if seconds >= TUNING.long_seconds:
        sys.stderr.write(f"density: the tolerance asks for a finer solution, about {float(f'{seconds:.1g}'):,.0f} s\n")
