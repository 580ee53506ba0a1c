"""What the solvers of the density have in common: which scenes they take, and when a solution is good enough."""

import math
import warnings

from fpk_rocking import checks
from fpk_rocking.physics.contact import CRITICAL_RESTITUTION


def refuse_unsolvable(white):
    """Refuse a scene without noise, or with infinitely many impacts."""
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
        self.report, self.cycles, self.done, self.total = report, cycles, 0, least * cycles

    def next(self):
        """Begin another solution: what to call after each of its cycles."""
        self.total = max(self.done + self.cycles, self.total)
        return self._count

    def _count(self):
        self.done += 1
        if self.report:
            self.report(self.done, self.total)
