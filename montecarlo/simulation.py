"""`simulate`: from a scene to an ensemble."""

import math
import time

import numpy as np

from fpk_rocking import checks
from fpk_rocking.scene import Scene
from montecarlo import rk4, white
from montecarlo.ensemble import Ensemble
from montecarlo.random import stream_keys

_ENGINES = {"rk4": rk4, "white": white}
_METHOD_OF_NOISE = {"band": "rk4", "none": "rk4", "white": "white"}
_BATCH_S = 0.3
_SMALLEST_BATCH = 64


def simulate(scene, *, cycles, realizations, seed=1, method=None, steps_per_cycle=200, progress=None):
    """Simulate an ensemble of independent realizations in parallel.

    Realization r depends only on the seed and on r: not on the number of realizations, nor on that of threads.

    Parameters
    ----------
    scene : Scene
        Block, forcing, noise, start and overturning.
    cycles : int
        Forcing cycles, at least 1.
    realizations : int
        Size of the ensemble, at least 1.
    seed : int
        From 0 to 2**64 - 1.
    method : str, optional
        "rk4" for band noise or none: classical Runge-Kutta steps with located impacts. "white" for white noise: exact
        Gaussian steps. By default the one that fits the noise.
    steps_per_cycle : int
        At least 8. For "rk4" the number of its steps in a cycle; "white" adapts its steps and takes none shorter than
        a 256th of a cycle over this number.
    progress : callable, optional
        Called as ``progress(done, total)`` between batches of realizations; may raise.

    Returns
    -------
    Ensemble

    Raises
    ------
    TypeError, ValueError
        A parameter is refused, or the method does not fit the noise; white noise is refused for a restitution below
        exp(-π/√3), where impacts accumulate.
    """
    started = time.perf_counter()
    checks.instance("scene", scene, Scene)
    cycles, realizations = checks.count("cycles", cycles), checks.count("realizations", realizations)
    seed = _whole("seed", seed, 0, 2**64 - 1)
    steps_per_cycle = _whole("steps_per_cycle", steps_per_cycle, 8, 10**6)
    method = _method(method, scene.noise.kind)
    engine = _ENGINES[method]
    problem, keys = engine.problem_of(scene, steps_per_cycle), stream_keys(seed)
    angle = np.full((realizations, cycles + 1), math.nan)
    velocity = np.full((realizations, cycles + 1), math.nan)
    overturn_time, overturn_side = np.empty(realizations), np.empty(realizations, np.int8)
    done, size = 0, _SMALLEST_BATCH
    while done < realizations:
        began = time.perf_counter()
        batch = slice(done, done + size)
        engine.realize(keys, done, problem, angle[batch], velocity[batch], overturn_time[batch], overturn_side[batch])
        done = min(done + size, realizations)
        if progress is not None:
            progress(done, realizations)
        # Batches are short enough to be interrupted and long enough to keep all threads busy.
        wanted = size * _BATCH_S / (time.perf_counter() - began)
        size = max(_SMALLEST_BATCH, int(min(wanted, 4 * size)))
    return Ensemble(
        scene=scene,
        method=method,
        seed=seed,
        steps_per_cycle=steps_per_cycle,
        wall_s=time.perf_counter() - started,
        angle=angle,
        velocity=velocity,
        overturn_time=overturn_time,
        overturn_side=overturn_side,
    )


def _whole(name, value, low, high):
    accepted = f"a whole number from {low} to {high}"
    if isinstance(value, bool) or not isinstance(value, int | np.integer):
        raise TypeError(checks.refusal(name, value, accepted))
    if not low <= value <= high:
        raise ValueError(checks.refusal(name, value, accepted))
    return int(value)


def _method(method, kind):
    fitting = _METHOD_OF_NOISE[kind]
    if method is None or method == fitting:
        return fitting
    if method not in _ENGINES:
        accepted = ", ".join(map(repr, _ENGINES)) + " or None (what fits the noise)"
        raise ValueError(checks.refusal("method", method, accepted))
    accepted = f"{fitting!r} for noise of kind {kind!r}"
    if method == "white":
        accepted += "; 'white' takes a scene with white noise, which scene.white_equivalent() makes"
    raise ValueError(checks.refusal("method", method, accepted))
