"""Refinement: solve at finer and finer resolutions until the differences show that the last solution is good enough.

The same loop serves `solve_fpk`, whose levels are densities over some cycles, and the one-cycle operator, whose levels
are the operator on one mesh each. The first two levels serve the error estimate only.
"""

import math
from typing import NamedTuple, Protocol

from fpk_rocking.base import checks
from fpk_rocking.density.resolution import RESOLUTIONS, USUAL

UNRESOLVED = 0.05
"""Negative mass above which a density counts as not resolved."""

_SAFETY, _BEFORE, _AT_MOST = 1.4, 0.3, 2.5
"""Factors of `safe_difference`: of all, of the difference before, and of the last difference where it may be chance."""

_BINS = 3.0
"""Square root of the tolerance over the tolerance of the binned density."""


class Level(Protocol):
    """A solution at one resolution."""

    memory: float
    negative_mass: float

    def differences(self, coarser):
        """Differences from the level before: of the quantity that is wanted, and of the binned density (L1)."""

    def error(self, difference, bins):
        """Error of the wanted quantity, where refinement tells `difference` of it and `bins` of the binned density."""

    def release(self):
        """Let go of what only the finest level has to hold."""


class Refined(NamedTuple):
    """The last two levels, and the estimated errors of the last one: of what is wanted, and of the binned density."""

    fine: Level
    coarse: Level
    error: float
    bins_error: float

    def within(self, wanted, bins_wanted):
        """Whether the errors are as small as wanted, and the density is resolved."""
        return self.error <= wanted and self.bins_error <= bins_wanted and self.fine.negative_mass <= UNRESOLVED


def refine(candidates, make, fits, done):
    """Solve on ever finer resolutions.

    Parameters
    ----------
    candidates : sequence
        What `make` makes levels of, from coarse to fine.
    make : callable
        Takes a candidate and the level before (None at first), returns a `Level`.
    fits : callable
        Takes the last level and a candidate: whether there is memory for it. The first three are not asked for.
    done : callable
        Takes a `Refined`: whether it is good enough, or there is no hope that finer levels are.

    Returns
    -------
    Refined
    """
    coarse, fine, before, found = None, None, None, None
    for number, candidate in enumerate(candidates):
        if number > 2 and not fits(fine, candidate):
            break
        if fine:
            fine.release()
        coarse, fine = fine, make(candidate, fine)
        if not coarse:
            continue
        last, bins = fine.differences(coarse)
        if before is not None:
            found = Refined(fine, coarse, fine.error(safe_difference(before, last), bins), bins)
            if done(found):
                break
        before = last
    return found


def candidates_for(tol):
    """Return the resolutions for a tolerance: two coarser than is usually enough, that, and all finer ones."""
    return RESOLUTIONS[USUAL[max(known for known in USUAL if known <= tol)] - 2 :]


def bins_tolerance(tol):
    """Return the error (L1) in the binned density that goes with an error `tol` in survival."""
    return math.sqrt(tol) / _BINS


def safe_difference(before, last):
    """Error of the last of three or more solutions of growing fineness, from the differences of neighbours.

    The last difference, which estimates the error of the one but last; where it is small by chance, as the one before
    tells, up to two and a half times as much; and 1.4 for safety.
    """
    return _SAFETY * max(last, min(_BEFORE * before, _AT_MOST * last))


class Count:
    """Count of the cycles of all solutions, of which there are at least `least`.

    Parameters
    ----------
    report : callable or None
        Called as ``report(done, total)``.
    cycles, least : int
    """

    def __init__(self, report, cycles, least):
        self.report, self.cycles, self.done, self.total = checks.report(report), cycles, 0, least * cycles

    def next(self):
        """Begin another solution: what to call after each of its cycles."""
        self.total = max(self.done + self.cycles, self.total)
        return self._count

    def _count(self):
        self.done += 1
        if self.report:
            self.report(self.done, self.total)
