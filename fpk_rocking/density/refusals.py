"""Refusals and warnings of the density solver: scenes that it cannot solve, and results that miss the tolerance."""

import itertools
import warnings

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.types import known
from fpk_rocking.density.evolution import Evolution
from fpk_rocking.density.memory.start import spread_left
from fpk_rocking.density.refinement import Refined
from fpk_rocking.physics.motion import CRITICAL_RESTITUTION
from fpk_rocking.scene import limits
from fpk_rocking.scene.scene import Scene

LARGEST = {"white": 8e9, "filtered": 4e9}
"""Bytes that a solution may be expected to take, by the noise that is solved for."""

_FLIGHT, _SPREAD_LEFT = 2.33, {1: 0.6, 2: 0.95}
"""Least time that filtered noise has to spread a density, and the least part of the angle's spread that must then be
left where the states of the filter are known, by their number; measured (docs/numerics.md, "Filtered noise")."""

MOST_STATES = 2
"""States of a filter that the density may have as further variables."""

_FASTER = 1.05
"""Ratio of the frequencies that are tried for one that is accepted."""


def refuse_filtered(scene: Scene) -> None:
    """Refuse filtered noise: the one-cycle operator has no states of a filter."""
    if scene.noise.kind == "filtered":
        takes = f"solve_fpk() takes filters of up to {MOST_STATES} states"
        accepted = (
            f"'band' or 'white', as the one-cycle operator has no states of a filter; {takes}, and "
            "scene.white_equivalent() replaces filtered noise by white noise, under which no block rests"
        )
        raise ValueError(checks.refusal("noise.kind", scene.noise.kind, accepted))


def refuse_unsolvable(scene: Scene) -> None:
    """Refuse a scene out of range, without noise, of too many states of a filter, or with infinitely many impacts.

    Its noise is white or filtered.
    """
    limits.check(scene)
    noise = scene.noise
    if noise.kind == "filtered" and noise.space.order > MOST_STATES:
        accepted = (
            f"filters of up to {MOST_STATES} states, each of which is one more variable of the density; use Monte "
            "Carlo, simulate(), or scene.white_equivalent(), white noise of equal Melnikov variance"
        )
        raise ValueError(f"noise.filter: got {noise.filter} ({noise.space.order} states), accepted: {accepted}")
    if (noise.diffusion if noise.kind == "white" else noise.variance) == 0.0:
        accepted = "noise of a variance or diffusion above 0, as without noise there is no density; use Monte Carlo"
        raise ValueError(f"noise: got none, accepted: {accepted}")
    if noise.kind == "white" and scene.block.restitution <= CRITICAL_RESTITUTION:
        accepted = (
            f"above {CRITICAL_RESTITUTION:.5f} under white noise, as at or below that impacts accumulate in finite "
            "time and the motion after them is not defined; use Monte Carlo under band noise, or "
            "noise_replacement='filtered'"
        )
        raise ValueError(checks.refusal("block.restitution", scene.block.restitution, accepted))


def refuse_slow(scene: Scene) -> None:
    """Refuse filtered noise that is so slow that a start of small spread stays a curve at each state of the filter."""
    noise = scene.noise
    if noise.kind != "filtered":
        return
    time = max(known(scene.period), _FLIGHT)
    wanted, faster = _SPREAD_LEFT[noise.space.order], 1.0
    while spread_left(noise.scaled(1.0, faster), scene.start.covariance, time) < wanted:
        faster *= _FASTER
    if faster > 1.0:
        frequency = noise.frequency
        least = f"{frequency * faster:.2g}" if frequency is not None else f"{faster:.2g} times as fast"
        accepted = (
            f"at least about {least} with this filter, start and period, as under slower noise the density is too "
            "narrow for any mesh; use Monte Carlo"
        )
        name, value = ("noise.frequency", frequency) if frequency is not None else ("noise.filter", noise.filter)
        raise ValueError(checks.refusal(name, value, accepted))


def refuse_large(held: float, stored: float, scene: Scene, rows: int) -> None:
    """Refuse more than `LARGEST` bytes: `held` by a solution, `stored` of its density after all `rows` times."""
    largest = LARGEST[scene.noise.kind]
    if held > largest:
        raise ValueError(
            f"scene: got a mesh and time steps that take {held:.1e} bytes, accepted: up to {largest:g}; stronger "
            "noise, a shorter period or a smaller overturning angle need less, or use Monte Carlo"
        )
    if held + stored > largest:
        accepted = f"fewer, as the densities after all of them would take {stored:.1e} bytes, more than {largest:g}"
        raise ValueError(checks.refusal("number of times" if scene.period is None else "cycles", rows, accepted))


def refuse_broken(result: Evolution) -> None:
    """Raise FloatingPointError where a result has something that is not a finite number."""
    parts = ("survival", "overturned", "lost", "coefficients", "error_estimate", "bins_error_estimate", "negative_mass")
    for name in parts:
        if not np.all(np.isfinite(getattr(result, name))):
            raise FloatingPointError(
                f"{name}: got a number that is not finite, an error of the solver in {result.scene}"
            )


def warn_beyond(
    what: str,
    found: Refined,
    wanted: float,
    bins_wanted: float,
    instead: str,
    stacklevel: int,
    names: tuple[str, str] = ("tol", "bins_tol"),
) -> None:
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
    names : tuple of str
        Parameters that tell what is wanted.
    """
    if found.error > wanted or found.bins_error > bins_wanted:
        missed = itertools.compress(names, (found.error > wanted, found.bins_error > bins_wanted))
        allowed = " and ".join(dict.fromkeys(missed))
        warnings.warn(
            f"not within the tolerance: estimated error {found.error:.1e} in {what} ({wanted:.1e} wanted) and "
            f"{found.bins_error:.1e} in the binned density ({bins_wanted:.1e} wanted) on the finest mesh for this "
            f"scene; allow a larger {allowed}, or {instead}",
            RuntimeWarning,
            stacklevel=stacklevel,
        )


def warn_unresolved(result: Evolution, wanted: float, stacklevel: int) -> None:
    """Warn where the estimated error of what is at rest is larger than wanted; inf leaves it out."""
    sentence = result.unresolved_beyond(wanted)
    if sentence:
        warnings.warn(sentence, RuntimeWarning, stacklevel=stacklevel)
