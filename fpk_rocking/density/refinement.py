"""Refinement: solve at finer and finer resolutions until differences show that the last solution is good enough.

The same loop serves `solve_fpk`, whose solutions are densities over some cycles, and the one-cycle operator, whose
solutions are the operator on one mesh each. `estimate_errors` makes the estimates of differences; what differences do
not tell comes with each `Level`: in `solver._level_of` what is truncated, negative probability, and rest.
"""

import dataclasses
import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array, Progress
from fpk_rocking.density.tuning import TUNING

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
