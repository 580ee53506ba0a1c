"""Refusals and warnings of the density solver: scenes that it cannot solve, and results that miss the tolerance."""

import warnings

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.physics.contact import CRITICAL_RESTITUTION
from fpk_rocking.scene import limits

LARGEST = 8e9
"""Bytes that a solution may be expected to take."""


def refuse_filtered(scene):
    """Refuse filtered noise: the density has no states of a filter."""
    if scene.noise.kind == "filtered":
        accepted = (
            "'band' or 'white' for a density; filtered noise is sampled by simulate() or fpk-rocking mc, and "
            "scene.white_equivalent() has white noise of equal Melnikov variance instead, under which no block rests"
        )
        raise ValueError(checks.refusal("noise.kind", scene.noise.kind, accepted))


def refuse_unsolvable(white):
    """Refuse a scene out of range, without noise, or with infinitely many impacts."""
    limits.check(white)
    if white.noise.diffusion == 0.0:
        accepted = (
            "noise: without it there is no density to evolve; single trajectories are followed by " + limits.SAMPLING
        )
        raise ValueError(checks.refusal("noise", "none, or of size 0", accepted))
    if white.block.restitution <= CRITICAL_RESTITUTION:
        accepted = (
            f"above {CRITICAL_RESTITUTION:.5f} with white noise: below it there are infinitely many impacts in finite "
            f"time, and what follows is not defined; band noise can be sampled by {limits.SAMPLING}"
        )
        raise ValueError(checks.refusal("block.restitution", white.block.restitution, accepted))


def refuse_large(held, stored, scene, rows):
    """Refuse more than `LARGEST` bytes: `held` by a solution, `stored` of its density after all `rows` times."""
    if held > LARGEST:
        accepted = f"{LARGEST:g}: stronger noise, a shorter period, a nearer cut-off, or {limits.SAMPLING}"
        raise ValueError(checks.refusal("scene, bytes that its mesh and steps take", float(held), accepted))
    if held + stored > LARGEST:
        accepted = f"fewer: the densities after all of them would take {stored:.1e} bytes, of {LARGEST:g} at most"
        raise ValueError(checks.refusal("number of times" if scene.period is None else "cycles", rows, accepted))


def refuse_broken(result):
    """Raise FloatingPointError where a result has something that is not a finite number."""
    parts = ("survival", "overturned", "lost", "coefficients", "error_estimate", "bins_error_estimate", "negative_mass")
    for name in parts:
        if not np.all(np.isfinite(getattr(result, name))):
            raise FloatingPointError(f"{name}: has a number that is not finite; this must not be, in {result.scene}")


def warn_beyond(what, found, wanted, bins_wanted, instead, stacklevel):
    """Warn where an estimated error, or that of the binned density, is larger than wanted.

    Parameters
    ----------
    what : str
        The quantity that the first error is of.
    found : Refined
        Its estimates.
    wanted, bins_wanted : float
        What they should be.
    instead : str
        What else to try.
    stacklevel : int
        Calls from here to the user's, for the warning's line.
    """
    if found.error > wanted or found.bins_error > bins_wanted:
        warnings.warn(
            f"not within the tolerance: estimated error {found.error:.1e} in {what} ({wanted:.1e} wanted) and "
            f"{found.bins_error:.1e} in the binned density ({bins_wanted:.1e}) on the finest mesh for this scene; take "
            f"a larger tol, or {instead}",
            RuntimeWarning,
            stacklevel=stacklevel,
        )
