"""A run of any engine: its checked parameters, and its realizations in batches, each simulated in parallel."""

import math
import time
from typing import NamedTuple

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.jit import map_threads, thread_count
from fpk_rocking.base.precompilation import Compilation, mark_announced, start_helpers
from fpk_rocking.physics.motion.events import ImpactRecord
from fpk_rocking.results.returns import angle_of_fall
from fpk_rocking.scene import ranges
from fpk_rocking.scene.axes import result_times
from fpk_rocking.scene.least import kind_of, least_scene_with_vertical, least_scenes
from fpk_rocking.scene.scene import Scene
from montecarlo.engines import ENGINES, engine_of
from montecarlo.engines.random import keys_at, stream_keys
from montecarlo.tuning import TUNING


class Run(NamedTuple):
    """Checked parameters of a run, as `montecarlo.simulate` describes them."""

    scene: Scene
    times: np.ndarray  # (rows + 1,) from 0 on
    realizations: int
    seed: int
    method: str
    steps_per_cycle: int

    @property
    def rows(self):
        """Number of times beside 0: of cycles where the forcing repeats."""
        return len(self.times) - 1


class Batch(NamedTuple):
    """Realizations `first`, `first` + 1, ... of a run, n of them; nan after overturning."""

    first: int
    angle: np.ndarray  # (n, rows * samples + 1)
    velocity: np.ndarray
    overturn_time: np.ndarray  # (n,)
    overturn_side: np.ndarray  # (n,)
    impacts: ImpactRecord  # (n,), (n, capacity), (n, capacity), velocities just before
    returns: np.ndarray  # (2,), as of `Ensemble`


def checked_run(scene, cycles, realizations, seed, method, steps_per_cycle, progress=None, times=None):
    """Return the `Run` of the parameters of `montecarlo.simulate` after checks, that of `progress` too."""
    checks.instance("scene", scene, Scene)
    ranges.check(scene)
    checks.report(progress)
    return Run(
        scene,
        result_times(scene, cycles, times),
        checks.count("realizations", 1 if realizations is None and scene.deterministic else realizations),
        checks.count("seed", seed, 0, 2**64 - 1),
        engine_of(scene, method).method,
        checks.count("steps_per_cycle", steps_per_cycle, 8, 10**6),
    )


def refuse_large(run, per_cycle=1, instead=""):
    """Raise ValueError where a run's states, `per_cycle` in a cycle, do not fit into 4 GiB; `instead` ends it."""
    if run.realizations * (run.rows * per_cycle + 1) > TUNING.most_states:
        rows = "times" if run.scene.period is None else "cycles"
        rows += "" if per_cycle == 1 else f" x {per_cycle}"
        accepted = f"realizations x ({rows} + 1) <= {TUNING.most_states}, 4 GiB of states{instead}"
        raise ValueError(checks.refusal("realizations", run.realizations, accepted))


def simulate_batches(run, first=0, samples=1, capacity=0, cycle=0, progress=None, parameters=None, followed=None):
    """Yield the realizations of a run from `first` on as `Batch` after `Batch`, each simulated in parallel.

    A cycle has `samples` states; `capacity` impacts of a path are kept. Times count from τ = 0, whatever the first
    `cycle`. `followed`: how many realizations before `first` were followed on to the fall; None follows none.
    """
    engine, period, alike = engine_of(run.scene, run.method), run.scene.period, run.scene.deterministic
    start_helpers(compilation_of(engine, run.scene))
    times = run.times if period is None else period * (cycle + np.arange(run.rows * samples + 1) / samples)
    if parameters is None:
        outputs = period * np.arange(1, samples + 1) / samples if run.scene.repeats else times[1:]
        parameters = engine.parameters_of(run.scene, run.steps_per_cycle, outputs)
    fall = None if followed is None else angle_of_fall(run.scene)
    keys = keys_at(stream_keys(run.seed), cycle) if engine.renews else stream_keys(run.seed)

    def simulate(parameters, numbers, *arrays):
        engine.simulate(keys, numbers, cycle, parameters, *arrays)

    size = max(TUNING.smallest_batch, TUNING.first_batch // run.rows)
    while first < run.realizations:
        began = time.perf_counter()
        count = run.realizations - first if alike else min(size, run.realizations - first)
        numbers = np.arange(1) if alike else np.arange(first, first + count)
        batch = _simulated(simulate, parameters, numbers, len(times), capacity, 4 * thread_count())
        if not run.scene.repeats:
            # An engine goes on to the end of the interval in which the last time is.
            later = batch.overturn_time > times[-1]
            batch.overturn_time[later], batch.overturn_side[later] = math.nan, 0
        _refuse_missing_states(batch, run, times)
        if fall:
            later = parameters._replace(block=parameters.block._replace(cutoff=fall))
            paths = _paths_to_follow(batch, engine.renews, followed)
            batch.returns[:] = _returns(paths, run, engine.renews, later, simulate, len(times))
            followed += int(batch.returns[0])
        mark_announced()
        yield _repeated(batch, first, count) if alike else batch
        first += count
        if progress is not None:
            progress(first, run.realizations)
        size = next_size(size, time.perf_counter() - began)


def next_size(size, seconds):
    """How many realizations the next batch has, after one of a `size` that took some `seconds`."""
    return max(TUNING.smallest_batch, int(min(size * TUNING.batch_seconds / seconds, 4 * size)))


def _simulated(simulate, parameters, numbers, states, capacity, parts):
    """Return a new `Batch` of the realizations with some `numbers` (count,), in parts that the threads take in turn."""
    count = len(numbers)
    angle, velocity = np.full((2, count, states), math.nan)
    impacts = ImpactRecord(np.zeros(count, np.int64), *np.full((2, count, capacity), math.nan))
    arrays = angle, velocity, np.empty(count), np.empty(count, np.int8)
    size = -(-count // parts)

    def fill(begin):
        part = slice(begin, begin + size)
        record = ImpactRecord(*(array[part] for array in impacts))
        simulate(parameters, numbers[part], *(array[part] for array in arrays), record)

    map_threads(fill, range(0, count, size))
    return Batch(int(numbers[0]), *arrays, impacts, np.zeros(2, np.int64))


def _repeated(batch, first, count):
    """Return a `Batch` of `count` equal realizations, numbered from `first` on, by a `Batch` of one."""
    states, impacts = ([np.repeat(part, count, axis=0) for part in parts] for parts in (batch[1:5], batch.impacts))
    return Batch(first, *states, ImpactRecord(*impacts), batch.returns)


def _refuse_missing_states(batch, run, times):
    """Raise FloatingPointError where a state up to overturning is not finite, or one after it is."""
    standing, last = batch.overturn_side == 0, len(times) - 1.0
    ends = np.where(standing, last, np.interp(batch.overturn_time, times, np.arange(len(times))))
    counts = np.count_nonzero(np.isfinite(batch.angle) & np.isfinite(batch.velocity), axis=1)
    # What overturns between two samples, or within rounding of one, has those before it.
    near = 1e-9 * (1.0 + times[-1] / np.diff(times).min())
    right = np.where(standing, counts == ends + 1.0, (counts >= ends - near) & (counts <= ends + 1.0 + near))
    if not right.all():
        number = batch.first + int(np.argmin(right))
        raise FloatingPointError(
            f"realization {number} of method {run.method!r}, seed {run.seed}: {counts[number - batch.first]} finite "
            f"states, overturning at {batch.overturn_time[number - batch.first]}: the engine fails on {run.scene}"
        )


def _paths_to_follow(batch, unseen, already):
    """Return the numbers of the realizations of a `Batch` that are followed on to the fall; `already` were before it.

    Of the first n realizations at most √n `TUNING.followed` of those that overturn; of all if a path depends on the
    cut-off (`unseen`). Batches of other sizes make the same choice.
    """
    numbers = batch.first + np.flatnonzero(batch.overturn_side | unseen)
    chosen, place = [], 0
    if unseen:
        already = math.ceil(TUNING.followed * math.sqrt(batch.first))
    while True:
        least = ((already + len(chosen)) / TUNING.followed) ** 2
        place += int(np.searchsorted(numbers[place:], least))
        if place == len(numbers):
            return chosen
        chosen.append(int(numbers[place]))
        place += 1


def _returns(numbers, run, unseen, parameters, simulate, states):
    """Return how many paths overturn on the way to the fall (all, unless `unseen`), and how many of these come back."""
    if not numbers:
        return 0, 0
    cutoff = run.scene.overturning.angle
    if unseen:
        grid = parameters.grid.with_all_ends()
        parameters = parameters._replace(grid=grid)
        states = (run.rows if run.scene.repeats else 1) * grid.count + 1
    paths = _simulated(simulate, parameters, np.array(numbers), states, 0, thread_count())
    angles = np.abs(paths.angle)
    over = (paths.overturn_side != 0) | (angles.max(axis=1) >= cutoff) if unseen else np.full(len(numbers), True)
    return over.sum(), (over & (angles[:, -1] < cutoff)).sum()


_SECONDS = {"exact_slender": 7, "exact_enveloped": 7, "exact_block": 9, "rk4": 7, "white": 6, "filtered": 7}
"""What compiling takes, about, by the file of an engine; 2 more for a block that is not slender."""


def compilation_of(engine, scene):
    """Return the `Compilation` of an engine for the kind of block of a scene."""
    name, kind = engine.file.stem, kind_of(scene.block)
    vertical = ":vertical" * (scene.forcing.vertical is not None)
    return Compilation(f"{__name__}:compile_engine:{name}:{kind}{vertical}", _SECONDS[name] + 2 * (kind != "slender"))


def compile_engine(name, kind, vertical=""):
    (engine,) = (engine for engine in ENGINES if engine.file.stem == name)
    scenes = [least_scene_with_vertical(kind)] if vertical else least_scenes(kind).values()
    scene = next(scene for scene in scenes if engine.takes(scene))
    run = checked_run(scene, None if vertical else 1, 1, 1, engine.method, 200)
    for _ in simulate_batches(run, followed=0):
        pass
