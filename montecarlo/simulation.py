"""`simulate`: an ensemble of realizations of a scene, every one kept."""

import time

import numpy as np

from fpk_rocking.base.types import ArrayLike, Progress
from fpk_rocking.scene.scene import Scene
from montecarlo.engines import running
from montecarlo.results.ensemble import Ensemble


def simulate(
    scene: Scene,
    *,
    cycles: int | None = None,
    times: ArrayLike | None = None,
    realizations: int,
    seed: int = 1,
    method: str | None = None,
    steps_per_cycle: int = 200,
    progress: Progress | None = None,
) -> Ensemble:
    """Simulate an ensemble of independent realizations in parallel.

    Realization r depends only on the seed and on r: not on the number of realizations, nor on that of threads.

    Parameters
    ----------
    scene : Scene
        Block, forcing, noise, start and overturning.
    cycles : int, optional
        Forcing cycles, at least 1; given exactly where the forcing repeats.
    times : array_like, optional
        Ascending nondimensional times for a forcing that does not repeat, by default 20 parts of its duration and 10
        units of time later (`fpk_rocking.results.times`).
    realizations : int
        Size of the ensemble, at least 1. Their states at all times may take 4 GiB; `tally` keeps none and takes more.
    seed : int
        From 0 to 2**64 - 1.
    method : str, optional
        For band noise or none "exact", closed-form flights between located impacts, or "rk4", the paper's Runge-Kutta
        steps, ten times slower; "white" for white noise, exact Gaussian steps; "filtered" for filtered noise, exact
        Gaussian steps between events. By default the first that fits.
    steps_per_cycle : int
        At least 8, in a cycle; for a pulse in its period, for a record in 2 units of time. For "rk4" the number of its
        steps in a cycle; "white" adapts its steps and takes none shorter than a 256th of a cycle over this number;
        "filtered" samples the noise at intervals inversely proportional to it, at 200 of half (exponential and
        Kanai-Tajimi: a quarter) of 1/(the filter's rate); "exact" takes none.
    progress : callable, optional
        Called as ``progress(done, total)`` between batches of realizations; may raise.

    Returns
    -------
    Ensemble

    Raises
    ------
    TypeError, ValueError
        A parameter is refused, or the method does not fit the noise; white noise is refused for a restitution below
        exp(-π/√3), where impacts accumulate; the states would take more than 4 GiB.
    """
    started = time.perf_counter()
    run = running.checked(scene, cycles, realizations, seed, method, steps_per_cycle, progress, times)
    running.refuse_large(run, instead="; `tally` keeps none and takes more")
    shape = (run.realizations, run.rows + 1)
    arrays = {
        "angle": np.empty(shape),
        "velocity": np.empty(shape),
        "overturn_time": np.empty(run.realizations),
        "overturn_side": np.empty(run.realizations, np.int8),
    }
    for batch in running.batches(run, progress=progress):
        for name, array in arrays.items():
            part = getattr(batch, name)
            array[batch.first : batch.first + len(part)] = part
    return Ensemble(
        scene=run.scene,
        times=run.times,
        method=run.method,
        seed=run.seed,
        steps_per_cycle=run.steps_per_cycle,
        wall_s=time.perf_counter() - started,
        **arrays,
    )
