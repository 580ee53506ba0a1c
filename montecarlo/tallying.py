"""`tally`: counts over an ensemble of any size, in little memory and, with a checkpoint, in parts."""

import time

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.types import ArrayLike, File, Progress
from fpk_rocking.results.binning import ascending_edges, joint_edges
from fpk_rocking.scene.scene import Scene
from montecarlo.engines import running
from montecarlo.results.counts import LARGEST, add, empty_counts
from montecarlo.results.tally import Checkpoint, Tally, resumed

_HISTOGRAM_BYTES = 2**29
_BATCH_STATES = 2**22


def tally(
    scene: Scene,
    *,
    cycles: int | None = None,
    times: ArrayLike | None = None,
    realizations: int | None = None,
    seed: int = 1,
    method: str | None = None,
    steps_per_cycle: int = 200,
    angle_edges: ArrayLike | None = None,
    velocity_edges: ArrayLike | None = None,
    checkpoint: File | None = None,
    progress: Progress | None = None,
) -> Tally:
    """Simulate realizations of a scene and keep counts alone, in little memory however many there are.

    Survival, joint histograms and moments after each cycle are counted. The realizations are those of `simulate` with
    the same parameters. The result does not depend on the number of threads, nor on where a run was stopped and
    resumed.

    Parameters
    ----------
    scene, cycles, times, seed, method, steps_per_cycle, progress
        As for `simulate`.
    realizations : int, optional
        Number of realizations, 1 to 2**31 - 1. A deterministic scene needs no number, as for `simulate`.
    angle_edges, velocity_edges : array_like, optional
        Ascending edges of the bins that are counted, nondimensional. The default bins, 0.05 wide, are those that
        comparisons and pictures need.
    checkpoint : path, optional
        File that keeps the state of the run. It is written from time to time, at the end, and when the run is
        interrupted. Where the file exists, the run goes on from it: `realizations` may then be larger than before, all
        other parameters have to be the same. `Tally.load` reads it.

    Returns
    -------
    Tally

    Raises
    ------
    TypeError, ValueError
        As `simulate`; or the edges do not ascend, the histograms would take more than 512 MiB, or the checkpoint is
        damaged or belongs to another run, and is then left as it is.

    Examples
    --------
    >>> from fpk_rocking import load_scene
    >>> from montecarlo import tally
    >>> print(tally(load_scene("main"), cycles=4, realizations=1000).survival.round(2))
    [1.   1.   1.   0.97 0.86]
    """
    started = time.perf_counter()
    run = running.checked(scene, cycles, realizations, seed, method, steps_per_cycle, progress, times)
    checks.count("realizations", run.realizations, at_most=LARGEST)
    angles, velocities = joint_edges(scene)
    edges = _edges("angle_edges", angle_edges, angles), _edges("velocity_edges", velocity_edges, velocities)
    _check_size(run, edges)
    counts, spent = empty_counts(run.scene, run.times, *edges), 0.0
    if checkpoint is not None and checks.path("checkpoint", checkpoint).exists():
        counts, spent = resumed(checkpoint, run, counts)

    def result():
        wall_s = spent + time.perf_counter() - started
        return Tally(scene, run.method, run.seed, run.steps_per_cycle, wall_s, counts)

    done = result().realizations
    saved = Checkpoint(checkpoint, done)
    try:
        for batch in _batches(run, done, progress):
            add(counts, batch)
            if saved.is_due:
                saved.save(result())
    finally:
        saved.save(result())
    return result()


def _batches(run, first, progress):
    """Yield the batches of a run from a realization on, none of more states than are held at once."""
    most = max(1, _BATCH_STATES // (run.rows + 1))
    report = None if progress is None else lambda done, _: progress(done, run.realizations)
    for begin in range(first, run.realizations, most):
        piece = run._replace(realizations=min(begin + most, run.realizations))
        yield from running.batches(piece, first=begin, progress=report)


def _halved(edges):
    """Return the edges and the middles between them, the edges as they are to the last bit."""
    return np.sort(np.concatenate([edges, 0.5 * (edges[1:] + edges[:-1])]))


def _edges(name, given, default):
    return _halved(default) if given is None else ascending_edges(name, given, finite=True)


def _check_size(run, edges):
    """Refuse histograms that do not fit into little memory."""
    bins = [values.size - 1 for values in edges]
    most = _HISTOGRAM_BYTES // (4 * bins[0] * bins[1]) - 1
    if most < 1:
        accepted = f"at most {_HISTOGRAM_BYTES // 8} bins; fewer edges of your own make fewer than the default ones"
        raise ValueError(checks.refusal("angle_edges, velocity_edges", f"{bins[0]} x {bins[1]} bins", accepted))
    if run.rows > most:
        accepted = f"1 to {most} with {bins[0]} x {bins[1]} bins, more with fewer bins"
        raise ValueError(checks.refusal("cycles" if run.scene.period else "number of times", run.rows, accepted))
