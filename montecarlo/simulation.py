"""`simulate`: from a scene to an ensemble."""

import time

import numpy as np

from montecarlo import engines
from montecarlo.ensemble import Ensemble


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
    run = engines.checked(scene, cycles, realizations, seed, method, steps_per_cycle)
    shape = (run.realizations, run.cycles + 1)
    arrays = np.empty(shape), np.empty(shape), np.empty(shape[0]), np.empty(shape[0], np.int8)
    for batch in engines.batches(run, progress=progress):
        for array, part in zip(arrays, batch[1:], strict=True):
            array[batch.first : batch.first + len(part)] = part
    return Ensemble(
        scene=scene,
        method=run.method,
        seed=run.seed,
        steps_per_cycle=run.steps_per_cycle,
        wall_s=time.perf_counter() - started,
        angle=arrays[0],
        velocity=arrays[1],
        overturn_time=arrays[2],
        overturn_side=arrays[3],
    )
