"""Refinement: solve at finer and finer resolutions until differences show that the last solution is good enough.

The same loop serves `solve_fpk`, whose solutions are densities over some cycles, and the one-cycle operator, whose
solutions are the operator on one mesh each. `estimate_errors` makes estimates from differences; what differences do not
show, each solution adds by its `error`: what is truncated, negative probability, rest.
"""

import itertools
import math
import warnings
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Progress
from fpk_rocking.density.tuning import TUNING
from fpk_rocking.results.trust import NEGATIVE

SOLUTIONS = 3
"""Least number of solutions: the last, and two that serve its error estimate alone."""


def differences(fine: Any, coarser: Any) -> tuple[float, float]:
    """Return the largest differences of a solution from a coarser one, (quantity's, binned density's in L1)."""
    quantity = float(abs(fine.quantity - coarser.quantity).max())
    rows = fine.resolved & coarser.resolved
    bins = float(abs(fine.bins - coarser.bins)[rows].sum(axis=1).max(initial=0.0))
    return math.inf if math.isnan(quantity) else quantity, bins


class Refined(NamedTuple):
    """Solutions from coarse to fine, the estimated errors of the last, and how many could follow."""

    solutions: list[Any]
    error: float
    bins_error: float
    finer: int

    def within(self, wanted: float, bins_wanted: float) -> bool:
        """Whether both errors are as small as wanted, and the density is resolved."""
        resolved = self.solutions[-1].negative_mass <= TUNING.unresolved_negative_mass
        return self.error <= wanted and self.bins_error <= bins_wanted and resolved


def refine(
    resolutions: list[Any],
    solve: Callable[[Any, Any], Any],
    fits: Callable[[Any, Any], bool],
    is_done: Callable[[Refined], bool],
    coarser: Sequence[Any] = (),
    bins_last: float = 1.0,
) -> Refined:
    """Solve on ever finer resolutions until the errors are small enough.

    A solution has a `quantity` (array), `bins` (rows, bins), the mask `resolved` (rows,), a `negative_mass`, and
    `error`, from the estimated error of the quantity and the difference of the bins to the whole error. `bins_last` is
    as of `estimate_errors`.
    """
    solutions: list[Any] = []
    for number, resolution in enumerate(resolutions, 1):
        if number > SOLUTIONS and not fits(solutions[-1], resolution):
            break
        solutions.append(solve(resolution, solutions[-1] if solutions else None))
        finer = len(resolutions) - number
        agree = number == SOLUTIONS - 1 and coarser and is_done(estimate_errors(solutions, finer, bins_last))
        if agree and solutions[-1].negative_mass <= NEGATIVE:
            solutions.insert(0, solve(coarser[-1], None))
        if len(solutions) >= SOLUTIONS:
            refined = estimate_errors(solutions, finer, bins_last)
            if is_done(refined):
                break
    return refined


def estimate_errors(solutions: list[Any], finer: int, bins_last: float = 1.0) -> Refined:
    """Estimate the errors of the last solution from its differences from the others.

    `bins_last` is the least error of the bins over their last difference, where two coarser solutions tell it.
    """
    fine = solutions[-1]
    quantity, bins = zip(*(differences(fine, solution) for solution in solutions[:-1]), strict=True)
    if len(solutions) == SOLUTIONS - 1:
        # As if the one before were as far off as it may be without a say.
        quantity, bins = (quantity[0] / TUNING.difference_before, *quantity), (bins[0] / TUNING.bins_before, *bins)
    bins_error = max(bins_last * bins[-1], min(TUNING.bins_before * bins[-2], TUNING.bins_at_most * bins[-1]))
    error = fine.error(safe_difference(quantity), bins[-1])
    # A probability that survival lacks is one that the bins lack, even where no row has a density to compare.
    return Refined(solutions, error, max(error, bins_error), finer)


def safe_difference(distances: tuple[float, ...]) -> float:
    """Return the estimated error, a float, of the last of finer and finer solutions, from its `distances` (n,)."""
    before, last = distances[-2:]
    return TUNING.safety * max(last, TUNING.difference_before * before)


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
