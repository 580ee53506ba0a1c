"""Axes of results: their times, and bins of angle and velocity that cover what can be expected of a scene.

Results are for forcing cycles, or for times of their own where the forcing does not repeat.
"""

import math

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array, ArrayLike, not_none
from fpk_rocking.physics.noise.equivalence import equivalent_diffusion
from fpk_rocking.scene.scene import Scene

SETTLING = 10.0
"""Time for which a block is followed after a motion unless `times` tell otherwise.

A free block whose unstable coordinate is off the separatrix by δ has decided after log(1/δ): of blocks that are spread
over the plane a part exp(-10) has not.
"""

PARTS = 20
"""Parts of a motion's duration after each of which a result is for, unless `times` tell otherwise."""


def samples_in_cycle(scene: Scene, samples_per_cycle: int | None, default: int = 1) -> int:
    """Return at how many times in each cycle a result is wanted; refused where the forcing does not repeat."""
    if scene.period is None and samples_per_cycle is not None:
        accepted = f"nothing, as a {scene.forcing.kind} has no cycles; use times"
        raise ValueError(checks.refusal("samples_per_cycle", samples_per_cycle, accepted))
    return checks.count("samples_per_cycle", default if samples_per_cycle is None else samples_per_cycle)


def times_in_cycles(scene: Scene, cycles: int, samples: int) -> Array:
    """Return the times τ (cycles · samples + 1,) from 0 on, `samples` of them in each cycle; whole cycles exactly."""
    return not_none(scene.period) * (np.arange(cycles * samples + 1) / samples)


def result_times(
    scene: Scene, cycles: int | None = None, times: ArrayLike | None = None, samples_per_cycle: int | None = None
) -> Array:
    """Return the times τ (n + 1,) of a result, the first 0: in `cycles`, or at `times`, each exactly where it fits.

    A forcing that does not repeat has by default `PARTS` equal parts of its duration and, `SETTLING` later, the time
    when free blocks have settled or overturned.
    """
    samples = samples_in_cycle(scene, samples_per_cycle)
    if scene.period is not None:
        if times is not None:
            accepted = "nothing, as this forcing repeats; use cycles"
            raise ValueError(checks.refusal("times", times, accepted))
        return times_in_cycles(scene, checks.count("cycles", cycles, at_most=2**24), samples)
    if cycles is not None:
        raise ValueError(
            checks.refusal("cycles", cycles, f"nothing, as a {scene.forcing.kind} has no cycles; use times")
        )
    duration = scene.forcing.duration
    if times is None:
        return np.append(duration * np.arange(PARTS + 1) / PARTS, duration + SETTLING)
    accepted = "1 to 100,000 finite numbers from 0 on, ascending, the last above 0"
    rows = checks.array("times", times, accepted)
    rising = rows.ndim == 1 and 1 <= rows.size <= 100_000 and (rows[1:] > rows[:-1]).all()
    if not rising or not rows[0] >= 0.0 or not 0.0 < rows[-1] < np.inf:
        raise ValueError(checks.refusal("times", times, accepted))
    return rows if rows[0] == 0.0 else np.append(0.0, rows)


def ascending_edges(name: str, value: ArrayLike, *, finite: bool) -> np.ndarray:
    """Return the edges of bins (n + 1,) after a check; `finite`: whether the outer ones have to be."""
    accepted = f"two or more {'finite ' if finite else ''}numbers in ascending order"
    edges = checks.array(name, value, accepted)
    ascending = edges.ndim == 1 and edges.size >= 2 and np.all(edges[:-1] < edges[1:])
    if not ascending or (finite and not np.isfinite(edges).all()):
        raise ValueError(checks.refusal(name, value, accepted))
    return edges


def centred_edges(low: float, high: float, count: int) -> Array:
    """Return the edges of equal bins that cover the interval from `low` to `high`, `count` of them as wide as it.

    0, where blocks rest, is amid a bin.
    """
    size = (high - low) / count
    return size * (np.arange(math.floor(low / size - 0.5), math.ceil(high / size - 0.5) + 1) + 0.5)


def joint_edges(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Return edges of bins of width 0.1 over angles up to the cut-off and the velocities that can be expected there.

    x = 0 and v = 0 are edges; the main scene has 32 bins on [-1.6, 1.6] and 64 on [-3.2, 3.2]. The velocity bound is
    derived for long flights: with s the side and B the forcing's swing (A/sqrt(1+Ω²) of a harmonic one), the amplitude
    of the driven relaxation, w = v - x obeys dw/dτ = -w - s + f. On the right side w so tends to [-1-B, B-1] from at
    most e (1 + B), after an impact at speed 1 + B, and v = w + x with x between 0 and the cut-off c gives |v| <= max(1
    + B, c + e (1 + B), c + B - 1). Before w has forgotten the impact it may pass this: with a cut-off far out, strong
    forcing and e < .3 by up to 28 % in 1,466 random scenes. The spread of w under white noise, sqrt(D), is added four
    times; a start far from rest widens the range.
    """
    cut_off = scene.overturning.angle
    driven = scene.forcing.swing
    rebound = max(scene.block.restitution_by_side) * (1.0 + driven)
    started = abs(scene.start.velocity) + abs(scene.start.angle)
    if scene.start.covariance is not None:
        (xx, _), (_, vv) = scene.start.covariance
        started += 4.0 * (math.sqrt(xx) + math.sqrt(vv))
    velocity = max(1.0 + driven, cut_off + max(rebound, driven - 1.0, started))
    velocity += 4.0 * math.sqrt(equivalent_diffusion(scene.noise, critical_angle=scene.block.critical_angle))
    return _edges(cut_off), _edges(velocity)


def _edges(bound) -> np.ndarray:
    """Return the edges of bins of width 0.1 from -bound to `bound`, which is rounded up to a tenth."""
    half = math.ceil(round(bound * 10, 9))
    return np.arange(-half, half + 1) / 10
