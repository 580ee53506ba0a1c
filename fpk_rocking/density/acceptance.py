"""What the solvers of the density have in common: which scenes they take, and when a solution is good enough."""

import math
import warnings

import numpy as np

from fpk_rocking import checks, limits
from fpk_rocking.physics.contact import CRITICAL_RESTITUTION

LARGEST = 8e9
"""Bytes that a solution may be expected to take."""


def refuse_unsolvable(white):
    """Refuse a scene out of range, without noise, or with infinitely many impacts."""
    limits.check(white)
    if white.noise.diffusion == 0.0:
        accepted = "noise: without it there is no density to evolve (simulate() follows single trajectories)"
        raise ValueError(checks.refusal("noise", "none, or of size 0", accepted))
    if white.block.restitution <= CRITICAL_RESTITUTION:
        accepted = (
            f"above {CRITICAL_RESTITUTION:.5f} with white noise: below it there are infinitely many impacts in finite "
            "time, and what follows is not defined (band noise can be sampled with simulate())"
        )
        raise ValueError(checks.refusal("block.restitution", white.block.restitution, accepted))


def closure_of(scene, white):
    """Say how band noise became white noise; empty where it was white."""
    if scene.noise.kind == "white":
        return ""
    low, high = scene.noise.band
    return (
        f"Band noise (variance {scene.noise.variance:g} on [{low:g}, {high:g}]) is solved as white noise of equal "
        f"Melnikov variance, D = {white.noise.diffusion:.6g}: a closure, to be judged by Monte Carlo."
    )


def bins_tolerance(tol):
    """Return the error (L1) in the binned density that goes with an error `tol` in survival.

    The bins are 32 x 64 equal ones between the cut-offs and the velocity bounds: .1 x .1 in the main scene.
    """
    return math.sqrt(tol) / 3.0


def safe_difference(before, last):
    """Error of the last of three or more solutions of growing fineness, from the differences of neighbours.

    The last difference, which estimates the error of the one but last; where it is small by chance, as the one before
    tells, up to two and a half times as much; and 1.4 for safety.
    """
    return 1.4 * max(last, min(0.3 * before, 2.5 * last))


def refuse_large(held, stored, cycles):
    """Refuse more than `LARGEST` bytes: `held` by a solution, `stored` of its density after all cycles."""
    if held > LARGEST:
        accepted = f"{LARGEST:g}: stronger noise, a shorter period or a nearer cut-off, or simulate()"
        raise ValueError(checks.refusal("scene, bytes that its mesh and steps take", float(held), accepted))
    if held + stored > LARGEST:
        accepted = f"fewer: the densities after all of them would take {stored:.1e} bytes, of {LARGEST:g} at most"
        raise ValueError(checks.refusal("cycles", cycles, accepted))


def refuse_broken(result):
    """Raise FloatingPointError where a result has something that is not a finite number."""
    parts = ("survival", "overturned", "lost", "coefficients", "error_estimate", "bins_error_estimate", "negative_mass")
    for name in parts:
        if not np.all(np.isfinite(getattr(result, name))):
            raise FloatingPointError(f"{name}: has a number that is not finite; this must not be, in {result.scene}")


def warn_beyond(result, instead):
    """Warn of a result that is not within its tolerance by its own estimates; `instead` is what else to try."""
    wanted = bins_tolerance(result.tol)
    if result.error_estimate > result.tol or result.bins_error_estimate > wanted:
        warnings.warn(
            f"not within the tolerance: estimated error {result.error_estimate:.1e} in survival (tol {result.tol:g}) "
            f"and {result.bins_error_estimate:.1e} in the binned density ({wanted:.1e}) on the finest mesh for this "
            f"scene; take a larger tol, or {instead}",
            RuntimeWarning,
            stacklevel=4,
        )


class Progress:
    """Counts the cycles of all solutions, of which there are at least `least`.

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
