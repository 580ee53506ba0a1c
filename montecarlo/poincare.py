"""The mean Poincaré map (paper eq. 21) in both its readings, and the correlation dimension of its points.

*Ensemble*: the mean of realizations that run on freely. *Restart*: the mean of the images after one cycle, from which
all realizations start afresh. Where the map is not linear the two differ.
"""

import dataclasses
import math
from typing import NamedTuple

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array, ArrayLike, Progress
from fpk_rocking.physics.forcing import refuse_transient
from fpk_rocking.physics.noise.kinds import refuse_envelope
from fpk_rocking.scene.parts import Start
from fpk_rocking.scene.scene import Scene
from montecarlo.engines.batches import checked_run, refuse_large, simulate_batches
from montecarlo.results.ensemble import Ensemble


class MeanMap(NamedTuple):
    """Mean Poincaré points; nondimensional. Row 0 is for τ = 0.

    Attributes
    ----------
    points, standard_error : ndarray, shape (cycles + 1, 2)
        Mean angle and velocity, and their sampling errors: 0 where nothing is random; nan where too few count.
    counted : ndarray of int, shape (cycles + 1,)
        Number of realizations that count.
    overturned_after : int or None
        Cycles after which the mean lies at the cut-off, or no realization counts; None for never.
    """

    points: np.ndarray
    standard_error: np.ndarray
    counted: np.ndarray
    overturned_after: int | None


def mean_poincare_map(ensemble: Ensemble, overturned: str = "clamped") -> MeanMap:
    """Compute the mean Poincaré map of an ensemble whose realizations run on freely.

    Parameters
    ----------
    ensemble : Ensemble
        Under periodic forcing.
    overturned : {"clamped", "left out"}
        Overturned realizations stay at the cut-off with velocity 0, as in the paper, or do not count.

    Examples
    --------
    >>> from fpk_rocking import load_scene
    >>> from montecarlo import mean_poincare_map, simulate
    >>> ensemble = simulate(load_scene("main"), cycles=4, realizations=1000)
    >>> print(mean_poincare_map(ensemble).points[1:].round(2))
    [[-0.41  0.81]
     [-0.32  0.75]
     [-0.23  0.53]
     [-0.13  0.45]]
    """
    checks.instance("ensemble", ensemble, Ensemble)
    refuse_transient(ensemble.scene.forcing, "a Poincaré map")
    _refuse_unknown_rule(overturned)
    cutoff = ensemble.scene.overturning.angle
    columns = zip(ensemble.angle.T, ensemble.velocity.T, strict=True)
    rows = [mean_state(angle, velocity, ensemble.overturn_side, cutoff, overturned) for angle, velocity in columns]
    return _mean_map(rows, cutoff, ensemble.deterministic)


def restarted_poincare_map(
    scene: Scene,
    *,
    cycles: int,
    realizations: int | None = None,
    seed: int = 1,
    method: str | None = None,
    steps_per_cycle: int = 200,
    overturned: str = "clamped",
    progress: Progress | None = None,
) -> MeanMap:
    """Compute the mean Poincaré map with all realizations restarted from the mean after every cycle (paper eq. 21).

    A realization of band noise is one function of time through all restarts; white noise is new in every cycle. Once
    all realizations have overturned the map stays as it is. Standard errors are those of averaging over one cycle: they
    do not contain the error that the map carries on into the next cycles, which runs with other seeds show.

    Parameters
    ----------
    scene, cycles, realizations, seed, method, steps_per_cycle
        As for `montecarlo.simulate`. A start drawn from a Gaussian is drawn once, at τ = 0.
    overturned : {"clamped", "left out"}
        As for `mean_poincare_map`.
    progress : callable, optional
        Called as ``progress(done, total)`` after each cycle; an exception in it ends the run.

    Examples
    --------
    >>> from fpk_rocking import load_scene
    >>> from montecarlo import restarted_poincare_map
    >>> mean = restarted_poincare_map(load_scene("main"), cycles=2, realizations=1000)
    >>> print(mean.points.round(2))
    [[ 0.    0.  ]
     [-0.41  0.81]
     [-0.3   0.93]]
    """
    checks.instance("scene", scene, Scene)
    refuse_transient(scene.forcing, "a Poincaré map")
    refuse_envelope(scene.noise, "a restarted map")
    run = checked_run(scene, cycles, realizations, seed, method, steps_per_cycle, progress)
    refuse_large(run)
    run = run._replace(times=run.times[:2])
    _refuse_unknown_rule(overturned)
    cutoff, rows, place = scene.overturning.angle, [], scene.start
    for cycle in range(cycles):
        batches = simulate_batches(run._replace(scene=dataclasses.replace(scene, start=place)), cycle=cycle)
        images = zip(*((batch.angle, batch.velocity, batch.overturn_side) for batch in batches), strict=True)
        angle, velocity, side = map(np.concatenate, images)
        if cycle == 0:
            rows.append(mean_state(angle[:, 0], velocity[:, 0], side, cutoff, overturned))
        rows.append(mean_state(angle[:, 1], velocity[:, 1], side, cutoff, overturned))
        if progress is not None:
            progress(cycle + 1, cycles)
        mean = rows[-1][0]
        if not abs(mean[0]) < cutoff:
            rows += (cycles - cycle - 1) * rows[-1:]
            break
        place = Start(float(mean[0]), float(mean[1]))
    return _mean_map(rows, cutoff, scene.deterministic)


def correlation_dimension(points: ArrayLike, shortest: float, longest: float) -> float:
    """Estimate the correlation dimension of a set of points between two lengths.

    The number of pairs nearer than r grows like r to this power: 1 on a curve, 2 in a part of the plane, between them
    on a fractal (P. Grassberger, I. Procaccia, Physica D 9, 189-208, 1983). Both lengths have to lie above the noise of
    the points and below the extent of the set. It is nan where no pair is nearer than `shortest`.

    Parameters
    ----------
    points : array_like, shape (n, 2)
        For example Poincaré points; those with a nan are left out.
    shortest, longest : float
        Lengths r, 0 < shortest < longest; the angle and the velocity count alike.

    Examples
    --------
    >>> import numpy as np
    >>> from montecarlo import correlation_dimension
    >>> line = np.linspace(0.0, 1.0, 500)
    >>> print(f"{correlation_dimension(np.stack([line, line], axis=1), 0.02, 0.2):.1f}")
    1.0
    """
    from scipy.spatial import KDTree

    longest = checks.number("longest", longest, above=checks.number("shortest", shortest, above=0.0))
    points = np.asarray(points, dtype=float)
    if points.ndim != 2 or points.shape[1] != 2:
        raise ValueError(checks.refusal("points", f"an array of shape {points.shape}", "an array of shape (n, 2)"))
    tree = KDTree(points[np.isfinite(points).all(axis=1)])
    # Pairs are counted in both orders, and each point with itself.
    near, far = (tree.count_neighbors(tree, np.array([shortest, longest])) - tree.n) / 2.0
    return math.log(far / near) / math.log(longest / shortest) if near > 0.0 else math.nan


def _refuse_unknown_rule(overturned):
    if overturned not in ("clamped", "left out"):
        raise ValueError(checks.refusal("overturned", overturned, "'clamped' or 'left out'"))


def mean_state(angle: Array, velocity: Array, side: Array, cutoff: float, overturned: str) -> tuple[Array, Array, int]:
    """Return the mean (2,) of states (n,), nan after overturning to a side, its error (2,), and how many count."""
    states, over = np.stack([angle, velocity]), np.isnan(angle)
    if overturned == "left out":
        states = states[:, ~over]
    else:
        states[0, over], states[1, over] = side[over] * cutoff, 0.0
    counted = states.shape[1]
    if counted == 0:
        return np.full(2, np.nan), np.full(2, np.nan), 0
    # About one of the states, so that equal states have exactly that mean.
    mean = states[:, 0] + (states - states[:, :1]).mean(axis=1)
    if counted == 1:
        return mean, np.full(2, np.nan), 1
    return mean, np.sqrt(np.square(states - mean[:, None]).sum(axis=1) / (counted - 1) / counted), counted


def _mean_map(rows, cutoff, deterministic):
    points, errors, counted = map(np.array, zip(*rows, strict=True))
    if deterministic:
        errors[counted > 0] = 0.0
    beyond = ~(np.abs(points[:, 0]) < cutoff)
    return MeanMap(points, errors, counted, int(np.argmax(beyond)) if beyond.any() else None)
