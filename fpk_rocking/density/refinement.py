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
    """A solution at one resolution, and what refinement compares of it with other solutions."""

    solution: Any
    quantity: Array
    bins: Array  # (rows, bins)
    resolved: Array  # (rows,)
    error: Callable[[float, float], float]
    negative_mass: float
    memory: float
    seconds: float = 0.0

    def differences(self, coarser: "Level") -> tuple[float, float]:
        """Return the largest differences from a `coarser` level, (quantity's, binned density's in L1), floats."""
        quantity = float(abs(self.quantity - coarser.quantity).max())
        rows = self.resolved & coarser.resolved
        bins = float(abs(self.bins - coarser.bins)[rows].sum(axis=1).max(initial=0.0))
        return math.inf if math.isnan(quantity) else quantity, bins


class Refined(NamedTuple):
    """All levels of a refinement, and the estimated errors of the last."""

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
        """Whether both errors are as small as wanted, and the density is resolved: a bool."""
        resolved = self.fine.negative_mass <= TUNING.unresolved_negative_mass
        return self.error <= wanted and self.bins_error <= bins_wanted and resolved


def refine(
    resolutions: list[Any],
    solve: Callable[[Any, Level | None], Level],
    fits: Callable[[Level, Any], bool],
    is_done: Callable[[Refined], bool],
    coarser: Sequence[Any] = (),
) -> Refined:
    """Solve on ever finer resolutions until the errors are small enough."""
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
    """Return the `Refined` of some levels: the errors of the last, estimated from its differences from the others."""
    fine = levels[-1]
    quantity, bins = zip(*(fine.differences(level) for level in levels[:-1]), strict=True)
    if len(levels) == SOLUTIONS - 1:
        quantity, bins = (0.0, 2.0 * quantity[0]), (bins[0], bins[0])
    bins_error = max(bins[-1], min(TUNING.bins_before * bins[-2], TUNING.bins_at_most * bins[-1]))
    return Refined(levels, fine.error(safe_difference(quantity), bins[-1]), bins_error, finer)


def safe_difference(distances: tuple[float, ...]) -> float:
    """Return the estimated error, a float, of the last of finer and finer solutions, from its `distances` (n,)."""
    before, last = distances[-2:]
    return TUNING.safety * max(last, TUNING.difference_before * before)


class ProgressCount:
    """Counts the rows of all solutions, of which there are at least `SOLUTIONS`."""

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
