"""`histories`: whole time histories of realizations, with their impacts."""

import time

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.types import ArrayLike, Progress
from fpk_rocking.scene.scene import Scene
from montecarlo.engines import running
from montecarlo.results.histories import Histories

_ROOM_PER_CYCLE = 16
_SAMPLES, _PARTS = 100, 1000


def histories(
    scene: Scene,
    *,
    cycles: int | None = None,
    times: ArrayLike | None = None,
    realizations: int = 1,
    seed: int = 1,
    method: str | None = None,
    steps_per_cycle: int = 200,
    samples_per_cycle: int | None = None,
    progress: Progress | None = None,
) -> Histories:
    """Simulate realizations and keep their time histories with every impact.

    Realization number r is that of `montecarlo.simulate` with the same seed, method and steps. The method "white" is an
    exception: its paths depend on `samples_per_cycle` too, though their probabilities do not.

    Parameters
    ----------
    scene : Scene
        Block, forcing, noise, start and overturning.
    cycles, realizations, seed, method, steps_per_cycle, progress
        As for `montecarlo.simulate`.
    times : array_like, optional
        For a pulse or a record: ascending nondimensional times of the states. By default 1001 times until 10 units of
        time after its end.
    samples_per_cycle : int, optional
        Number of states in each cycle, at least 1; by default 100. Refused where the forcing does not repeat.

    Returns
    -------
    Histories

    Raises
    ------
    TypeError, ValueError
        A parameter is refused, as by `montecarlo.simulate`.

    Examples
    --------
    >>> from fpk_rocking import Scene
    >>> from montecarlo import histories
    >>> rack = Scene.from_block(0.5, 1.8, "0.4 g", "1.5 Hz")
    >>> path = histories(rack, cycles=2)
    >>> print(path.angle.shape, path.impact_time.round(2))
    (1, 201) [0.62 2.16 3.7 ]
    """
    started = time.perf_counter()
    run = running.checked(scene, cycles, realizations, seed, method, steps_per_cycle, progress, times)
    samples = checks.count("samples_per_cycle", _SAMPLES if samples_per_cycle is None else samples_per_cycle)
    if scene.period is None:
        if samples_per_cycle is not None:
            accepted = f"nothing, as a {scene.forcing.kind} has no cycles; use times"
            raise ValueError(checks.refusal("samples_per_cycle", samples_per_cycle, accepted))
        samples = 1
        if times is None:
            run = run._replace(times=np.linspace(0.0, run.times[-1], _PARTS + 1))
    running.refuse_large(run, samples + _ROOM_PER_CYCLE)
    parts = [(batch, _listed(batch)) for batch in _complete(run, samples, progress)]
    columns = [np.concatenate(column) for column in zip(*(batch[1:5] for batch, _ in parts), strict=True)]
    impacts = [np.concatenate(column) for column in zip(*(listed for _, listed in parts), strict=True)]
    return Histories(
        scene,
        run.method,
        run.seed,
        run.steps_per_cycle,
        samples,
        time.perf_counter() - started,
        run.times if scene.period is None else scene.period * (np.arange(run.rows * samples + 1) / samples),
        *columns,
        *impacts,
    )


def _complete(run, samples, progress):
    """Yield batches that hold all their impacts: one that has more than its room is simulated again with enough."""
    room = _ROOM_PER_CYCLE * run.rows
    for batch in running.batches(run, samples=samples, capacity=room, progress=progress):
        needed = int(batch.impacts.count.max())
        if needed <= room:
            yield batch
        else:
            again = run._replace(realizations=batch.first + batch.angle.shape[0])
            running.refuse_large(again._replace(realizations=batch.angle.shape[0], times=run.times[:2]), needed)
            yield from running.batches(again, first=batch.first, samples=samples, capacity=needed)


def _listed(batch):
    """Return realization, time and velocity of each impact of a batch, shape (n_impacts,)."""
    kept = np.arange(batch.impacts.time.shape[1]) < batch.impacts.count[:, None]
    return batch.first + np.nonzero(kept)[0], batch.impacts.time[kept], batch.impacts.velocity[kept]
