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
    realizations: int | None = None,
    seed: int = 1,
    method: str | None = None,
    steps_per_cycle: int = 200,
    progress: Progress | None = None,
) -> Ensemble:
    """Simulate independent realizations of a scene by Monte Carlo.

    Realization number r depends on the seed and on r alone. It is the same however many realizations or threads there
    are. All processors are used; the environment variable ``NUMBA_NUM_THREADS`` sets another number of threads.

    Parameters
    ----------
    scene : Scene
        Block, forcing, noise, start and overturning.
    cycles : int, optional
        Number of forcing cycles, at least 1. Required where the forcing repeats, refused where it does not.
    times : array_like, optional
        For a pulse or a record: ascending nondimensional times at which results are wanted. By default 21 times over
        its duration, and 10 units of time after its end.
    realizations : int, optional
        Number of realizations, at least 1. Their states may take up to 4 GiB; `tally`, which keeps counts alone, has no
        such limit. A deterministic scene (`Scene.deterministic`) has one path and needs no number; with a larger one
        the path is computed once and stands in every row.
    seed : int
        Seed of the random numbers, from 0 to 2**64 - 1.
    method : {"exact", "rk4", "white", "filtered"}, optional
        By default the first of these that fits the noise. "exact", for band noise or none: event-driven, with flights
        in closed form between impacts. "rk4", for the same: the paper's Runge-Kutta steps, ten times slower. "white",
        for white noise: exact Gaussian steps. "filtered", for filtered noise: exact Gaussian steps between events.
    steps_per_cycle : int
        Time steps in a forcing cycle, at least 8; in a period of a pulse, in 2 units of time of a record. "rk4" takes
        this number of steps. "white" adapts its steps; none is shorter than a cycle over 256 times this number.
        "filtered" samples the noise at an interval proportional to 1/`steps_per_cycle`, which at 200 is half of
        1/(the rate of a low-pass filter) and a quarter of that of the other filters. "exact" takes no steps.
    progress : callable, optional
        Called as ``progress(done, total)`` between batches of realizations. An exception that it raises ends the run.

    Returns
    -------
    Ensemble

    Raises
    ------
    TypeError, ValueError
        A parameter is refused; the method does not fit the noise; the restitution is at most exp(-π/√3) = 0.163 under
        white noise, where impacts accumulate in finite time; or the states would take more than 4 GiB.

    Examples
    --------
    >>> from fpk_rocking import Scene
    >>> from montecarlo import simulate
    >>> rack = Scene.from_block(0.5, 1.8, "0.4 g", "1.5 Hz",
    ...                         noise_rms_acceleration=0.5, noise_band_hz=(0, 5))
    >>> ensemble = simulate(rack, cycles=4, realizations=1000)
    >>> print(ensemble.survival[4].round(3), ensemble.survival_interval()[4].round(3))
    0.984 [0.974 0.99 ]
    """
    started = time.perf_counter()
    run = running.checked(scene, cycles, realizations, seed, method, steps_per_cycle, progress, times)
    running.refuse_large(run, instead="; a tally keeps counts alone and has no such limit")
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
