"""Monte Carlo runs of a scene: `simulate`, `histories` and `tally`, by what they keep of the realizations."""

import time

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array, ArrayLike, File, Progress
from fpk_rocking.scene.axes import ascending_edges, joint_edges, samples_in_cycle, times_in_cycles
from fpk_rocking.scene.scene import Scene
from montecarlo.engines.batches import Batch, checked_run, refuse_large, simulate_batches
from montecarlo.results.counts import LARGEST, add, empty_counts
from montecarlo.results.ensemble import Ensemble, Histories
from montecarlo.results.tally import Checkpoint, Tally, resumed
from montecarlo.tuning import TUNING


def simulate(
    scene: Scene,
    *,
    cycles: int | None = None,
    times: ArrayLike | None = None,
    realizations: int | None = None,
    seed: int = 1,
    method: str | None = None,
    steps_per_cycle: int = 200,
    samples_per_cycle: int | None = None,
    progress: Progress | None = None,
) -> Ensemble:
    """Simulate independent realizations of a scene by Monte Carlo.

    Realization number r depends on the seed and on r alone, not on how many realizations or threads there are. The
    environment variable ``NUMBA_NUM_THREADS`` sets the number of threads; by default all processors are used.

    Parameters
    ----------
    scene : Scene
        Block, forcing, noise, start and overturning.
    cycles : int, optional
        Number of forcing cycles, at least 1. Required where the forcing repeats, refused where it does not.
    times : array_like, optional
        For a pulse or a record: ascending nondimensional times of the results; by default 21 over its duration, and
        one 10 after its end.
    realizations : int, optional
        Number of realizations, at least 1, whose states take up to 4 GiB. A deterministic scene (`Scene.deterministic`)
        needs no number: every row is its one path.
    seed : int
        Seed of the random numbers, from 0 to 2**64 - 1.
    method : {"exact", "rk4", "white", "filtered"}, optional
        By default the first of these that fits the noise. "exact", for band noise or none: event-driven, with flights
        in closed form between impacts. "rk4", for the same: the paper's Runge-Kutta steps, ten times slower. "white"
        and "filtered", for noise of these kinds: exact Gaussian steps, the latter between events.
    steps_per_cycle : int
        Time steps of "rk4" in a forcing cycle, a period of a pulse, or 2 units of time of a record; at least 8. "white"
        adapts its steps, the shortest to a cycle / (256 `steps_per_cycle`). "filtered" samples the noise at intervals
        proportional to 1/`steps_per_cycle`: at 200 steps .5/(rate of the filter) for a low-pass filter, for others
        .25/(rate). "exact" takes no steps.
    samples_per_cycle : int, optional
        Number of times in each cycle, equally spaced; by default 1, its end. Refused where the forcing does not repeat.
        Paths of the method "white" depend on it too, though their probabilities do not.
    progress : callable, optional
        Called as ``progress(done, total)`` between batches of realizations. An exception that it raises ends the run.

    Raises
    ------
    TypeError, ValueError
        A parameter is refused; the method does not fit the noise; white noise with a restitution of at most exp(-π/√3)
        = 0.163, where impacts accumulate in finite time; more than 4 GiB of states.

    Examples
    --------
    >>> from fpk_rocking import Scene
    >>> from montecarlo import simulate
    >>> rack = Scene.from_block(0.5, 1.8, "0.4 g", "1.5 Hz",
    ...                         noise_rms_acceleration=0.5, noise_band_hz=(0, 5))
    >>> ensemble = simulate(rack, cycles=4, realizations=1000)
    >>> print(ensemble.survival[4].round(3), ensemble.survival_interval()[4].round(3))
    0.982 [0.972 0.989]
    """
    started = time.perf_counter()
    run = checked_run(scene, cycles, realizations, seed, method, steps_per_cycle, progress, times)
    samples = samples_in_cycle(scene, samples_per_cycle)
    refuse_large(run, samples, instead="; a tally keeps counts alone and has no such limit")
    shape = (run.realizations, run.rows * samples + 1)
    arrays = {
        "angle": np.empty(shape),
        "velocity": np.empty(shape),
        "overturn_time": np.empty(run.realizations),
        "overturn_side": np.empty(run.realizations, np.int8),
    }
    returns = np.zeros(2, np.int64)
    for batch in simulate_batches(run, samples=samples, progress=progress, followed=0):
        returns += batch.returns
        for name, array in arrays.items():
            part = getattr(batch, name)
            array[batch.first : batch.first + len(part)] = part
    return Ensemble(
        scene=run.scene,
        times=run.times if scene.period is None else times_in_cycles(scene, run.rows, samples),
        method=run.method,
        seed=run.seed,
        steps_per_cycle=run.steps_per_cycle,
        wall_s=time.perf_counter() - started,
        **arrays,
        returns=returns,
    )


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

    Realization number r is that of `montecarlo.simulate` with the same seed, method and steps; paths of the method
    "white" depend on `samples_per_cycle` too, though their probabilities do not.

    Parameters
    ----------
    scene, cycles, realizations, seed, method, steps_per_cycle, progress
        As for `montecarlo.simulate`.
    times : array_like, optional
        As for `montecarlo.simulate`, by default 1001 times.
    samples_per_cycle : int, optional
        Number of states in each cycle, at least 1; by default 100. Refused where the forcing does not repeat.

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
    run = checked_run(scene, cycles, realizations, seed, method, steps_per_cycle, progress, times)
    samples = samples_in_cycle(scene, samples_per_cycle, default=1 if scene.period is None else 100)
    if scene.period is None and times is None:
        run = run._replace(times=np.linspace(0.0, run.times[-1], 1001))
    refuse_large(run, samples + TUNING.impacts_per_cycle)
    parts = [(batch[1:5], impacts_of(batch)) for batch in _batches_with_all_impacts(run, samples, progress)]
    states, impacts = (map(np.concatenate, zip(*rows, strict=True)) for rows in zip(*parts, strict=True))
    return Histories(
        scene,
        run.method,
        run.seed,
        run.steps_per_cycle,
        time.perf_counter() - started,
        samples,
        run.times if scene.period is None else times_in_cycles(scene, run.rows, samples),
        *states,
        *impacts,
    )


def _batches_with_all_impacts(run, samples, progress):
    """Yield each `Batch` with all impacts: one with more than there was space for is simulated again."""
    capacity = TUNING.impacts_per_cycle * run.rows
    for batch in simulate_batches(run, samples=samples, capacity=capacity, progress=progress):
        needed = int(batch.impacts.count.max())
        if needed <= capacity:
            yield batch
        else:
            again = run._replace(realizations=batch.first + batch.angle.shape[0])
            refuse_large(again._replace(realizations=batch.angle.shape[0], times=run.times[:2]), needed)
            yield from simulate_batches(again, first=batch.first, samples=samples, capacity=needed)


def impacts_of(batch: Batch) -> tuple[Array, Array, Array]:
    """Return realization, time τ and velocity just before of all impacts of a `Batch`, (impacts,) each."""
    recorded = np.arange(batch.impacts.time.shape[1]) < batch.impacts.count[:, None]
    return batch.first + np.nonzero(recorded)[0], batch.impacts.time[recorded], batch.impacts.velocity[recorded]


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

    Survival, joint histograms and moments after each cycle are counted. The realizations are those of `simulate`.
    Threads, interruptions and continuations do not change the result.

    Parameters
    ----------
    scene, cycles, times, seed, method, steps_per_cycle, progress
        As for `simulate`.
    realizations : int, optional
        Number of realizations, 1 to 2**31 - 1. A deterministic scene needs no number.
    angle_edges, velocity_edges : array_like, optional
        Ascending edges of the bins, nondimensional; by default 0.05 apart, as comparisons and pictures need them. The
        histograms may take 512 MiB.
    checkpoint : path, optional
        File of the state of the run, written from time to time, at the end, and on an interruption; `Tally.load` reads
        it. If the file exists, the run continues from it: `realizations` may be larger than before, all else has to be
        the same, else ValueError.

    Examples
    --------
    >>> from fpk_rocking import load_scene
    >>> from montecarlo import tally
    >>> print(tally(load_scene("main"), cycles=4, realizations=1000).survival.round(2))
    [1.   1.   1.   0.97 0.86]
    """
    started = time.perf_counter()
    run = checked_run(scene, cycles, realizations, seed, method, steps_per_cycle, progress, times)
    checks.count("realizations", run.realizations, at_most=LARGEST)
    angles, velocities = joint_edges(scene)
    angles = _checked_edges("angle_edges", angle_edges, angles)
    edges = angles, _checked_edges("velocity_edges", velocity_edges, velocities)
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
        for batch in _small_batches(run, done, progress, counts):
            add(counts, batch)
            if saved.is_due:
                saved.save(result())
    finally:
        saved.save(result())
    return result()


def _small_batches(run, first, progress, counts):
    """Yield each `Batch` from realization number `first` on, none of more states than are held at once."""
    most = max(1, TUNING.tally_states // (run.rows + 1))
    report = None if progress is None else lambda done, _: progress(done, run.realizations)
    for begin in range(first, run.realizations, most):
        piece = run._replace(realizations=min(begin + most, run.realizations))
        yield from simulate_batches(piece, first=begin, progress=report, followed=int(counts.returns[0]))


def _checked_edges(name, edges, default):
    """Return a user's edges of bins after a check, or the default ones and their middles."""
    if edges is None:
        return np.sort(np.concatenate([default, 0.5 * (default[1:] + default[:-1])]))
    return ascending_edges(name, edges, finite=True)


def _check_size(run, edges):
    """Refuse histograms at all times of a run that would take more than 512 MiB."""
    bins = [values.size - 1 for values in edges]
    most = TUNING.tally_bytes // (4 * bins[0] * bins[1]) - 1
    if most < 1:
        accepted = f"at most {TUNING.tally_bytes // 8} bins; fewer edges of your own make fewer than the default ones"
        raise ValueError(checks.refusal("angle_edges, velocity_edges", f"{bins[0]} x {bins[1]} bins", accepted))
    if run.rows > most:
        accepted = f"1 to {most} with {bins[0]} x {bins[1]} bins, more with fewer bins"
        raise ValueError(checks.refusal("cycles" if run.scene.period else "number of times", run.rows, accepted))
