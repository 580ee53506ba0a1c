"""Refinement: solve at finer and finer resolutions until the differences show that the last solution is good enough.

The same loop serves `solve_fpk`, whose levels are densities over some cycles, and the one-cycle operator, whose levels
are the operator on one mesh each. The first levels serve the error estimate only.
"""

import math
from typing import NamedTuple, Protocol

from fpk_rocking.base import checks
from fpk_rocking.density.resolution import RESOLUTIONS, USUAL

UNRESOLVED = 0.05
"""Negative mass above which a density counts as not resolved."""

LEAST = 3
"""Least number of solutions: the last, and two that serve its error estimate."""

_SAFETY, _BEFORE, _AT_MOST = 1.4, 0.3, 2.5
"""Factors of `safe_difference`: of all, of the distance from the solution before the one before, and of the last
distance where it may be chance."""

_BINS_BEFORE, _BINS_AT_MOST = 0.4, 1.5
"""The same for the binned density: its errors are sums over bins and seldom small by chance."""

_BINS = 3.0
"""Square root of the tolerance over the tolerance of the binned density."""


class Level(Protocol):
    """A solution at one resolution."""

    memory: float
    negative_mass: float

    def differences(self, coarser):
        """Differences from a coarser level: of the quantity that is wanted, and of the binned density (L1)."""

    def error(self, difference, bins):
        """Error of the wanted quantity, where refinement tells `difference` of it and `bins` of the binned density."""

    def release(self):
        """Let go of what only the finest level has to hold."""


class Refined(NamedTuple):
    """The last two levels, and the estimated errors of the last one: of what is wanted, and of the binned density.

    `left` is the number of finer resolutions.
    """

    fine: Level
    coarse: Level
    error: float
    bins_error: float
    left: int

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
        Takes the last level and a candidate: whether there is memory for it. The first `LEAST` are not asked for.
    done : callable
        Takes a `Refined`: whether it is good enough, or there is no hope that finer levels are.

    Returns
    -------
    Refined
    """
    levels, found = [], None
    for candidate in candidates:
        if len(levels) >= LEAST and not fits(levels[-1], candidate):
            break
        if levels:
            levels[-1].release()
        levels.append(make(candidate, levels[-1] if levels else None))
        if len(levels) >= LEAST:
            found = _refined(levels, len(candidates) - len(levels))
            if done(found):
                break
    return found


def _refined(levels, left):
    fine = levels[-1]
    wanted, bins = zip(*(fine.differences(level) for level in levels[:-1]), strict=True)
    error = fine.error(safe_difference(wanted), bins[-1])
    bins_error = max(bins[-1], min(_BINS_BEFORE * bins[-2], _BINS_AT_MOST * bins[-1]))
    return Refined(fine, levels[-2], error, bins_error, left)


def candidates_for(tol):
    """Return the resolutions for a tolerance. The `LEAST`-th is usually enough; those before serve its estimate."""
    usual = USUAL[max(known for known in USUAL if known <= tol)]
    return RESOLUTIONS[usual + 1 - LEAST :]


def bins_tolerance(tol):
    """Return the error (L1) in the binned density that goes with an error `tol` in survival."""
    return math.sqrt(tol) / _BINS


def safe_difference(distances):
    """Error of the last of three or more solutions of growing fineness, from its distances (n,) to all before it.

    The last distance is the error of the solution before, if the last solution is far better; it may be small by
    chance. The distance before tells whether it is: the error falls to .3 at least over two solutions. Of that no more
    than two and a half times the last distance counts. The result is 1.4 times the larger, for safety.
    """
    before, last = distances[-2:]
    return _SAFETY * max(last, min(_BEFORE * before, _AT_MOST * last))


class Count:
    """Count of the cycles of all solutions, of which there are at least `LEAST`.

    Parameters
    ----------
    report : callable or None
        Called as ``report(done, total)``.
    cycles : int
    """

    def __init__(self, report, cycles):
        self.report, self.cycles, self.done, self.total = checks.report(report), cycles, 0, LEAST * cycles

    def next(self):
        """Begin another solution: what to call after each of its cycles."""
        self.total = max(self.done + self.cycles, self.total)
        return self._count

    def _count(self):
        self.done += 1
        if self.report:
            self.report(self.done, self.total)
