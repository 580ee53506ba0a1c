"""A run of any engine: its checked parameters, and its realizations in batches, each simulated in parallel.

`ScaledPaths` are the paths of a deterministic scene at many scales of its forcing.
"""

import functools
import math
import time
from typing import NamedTuple

import numpy as np

from fpk_rocking.base import checks, precompilation
from fpk_rocking.base.jit import map_threads, thread_count
from fpk_rocking.physics.motion import lift_off
from fpk_rocking.physics.motion.events import ImpactRecord
from fpk_rocking.results.sampling import angle_of_fall
from fpk_rocking.scene import ranges
from fpk_rocking.scene.ranges import result_times
from fpk_rocking.scene.scene import Scene
from montecarlo.engines import engine_of, task_of
from montecarlo.engines.band_noise import scaled_parameters
from montecarlo.engines.random import keys_at, stream_keys
from montecarlo.tuning import TUNING


class Run(NamedTuple):
    """Checked parameters of a run, as `montecarlo.simulate` describes them; `times` (rows + 1,) from 0 on."""

    scene: Scene
    times: np.ndarray
    realizations: int
    seed: int
    method: str
    steps_per_cycle: int

    @property
    def rows(self):
        """Number (int) of times beside 0: of cycles where the forcing repeats."""
        return len(self.times) - 1


class Batch(NamedTuple):
    """Realizations `first`, `first` + 1, ... of a run, `count` of them; nondimensional.

    `angle`, `velocity` (count, rows * samples + 1): nan after overturning. `overturn_time`, `overturn_side` (count,):
    as in `montecarlo.Ensemble`. `impacts`: `ImpactRecord` of arrays (count,), (count, capacity) and (count, capacity),
    times and velocities just before; nan beyond the count. `returns` (2,): how many of the paths that overturn were
    followed on to the fall, and how many of these came back.
    """

    first: int
    angle: np.ndarray
    velocity: np.ndarray
    overturn_time: np.ndarray
    overturn_side: np.ndarray
    impacts: ImpactRecord
    returns: np.ndarray


def checked_run(scene, cycles, realizations, seed, method, steps_per_cycle, progress=None, times=None):
    """Return the named tuple `Run` of a user's parameters, those of `montecarlo.simulate`, after checks.

    Raises TypeError or ValueError for a wrong one, `progress` (a callable or None) too, which is not part of a run.
    `scene`: a `Scene`; `realizations` (int) may be None for a deterministic one; `method` is a name or None; `times`
    (rows,), nondimensional, or None where there are `cycles`; `seed` and `steps_per_cycle` are integers.
    """
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
    """Raise ValueError for a `Run` whose states, `per_cycle` (int) in a cycle, do not fit into 4 GiB; return None.

    `instead`: a text that ends the message, of what the user may do in place of it.
    """
    if run.realizations * (run.rows * per_cycle + 1) > TUNING.most_states:
        rows = "times" if run.scene.period is None else "cycles"
        rows += "" if per_cycle == 1 else f" x {per_cycle}"
        accepted = f"realizations x ({rows} + 1) <= {TUNING.most_states}, 4 GiB of states{instead}"
        raise ValueError(checks.refusal("realizations", run.realizations, accepted))


def simulate_batches(run, first=0, samples=1, capacity=0, cycle=0, progress=None, parameters=None, followed=None):
    """Simulate the realizations of a run from `first` on, in parallel; those of a deterministic scene are one path.

    Parameters
    ----------
    run : Run
    first : int
        Number of the first realization that is wanted; the last is that before `run.realizations`.
    samples : int
        States wanted in each cycle, at equal times; with 1 these are the Poincaré points. 1 where there are no cycles.
    capacity : int
        Impacts of a realization that are kept; all are counted.
    cycle : int
        Number of the cycle at which the run begins, from the scene's start; times count from τ = 0. Band noise
        and filtered noise are the same function of time for every such run, white noise is independent.
    progress : callable, optional
        Called as ``progress(done, total)`` after each batch; may raise.
    parameters : tuple, optional
        What the engine's `parameters_of` makes of the scene, where the caller has it.
    followed : int, optional
        How many realizations before `first` were followed on to the fall (`Ensemble.returns`); None follows none.

    Yields
    ------
    Batch
        Named tuple of arrays, new ones each time, of consecutive realizations.
    """
    engine, period, alike = engine_of(run.scene, run.method), run.scene.period, run.scene.deterministic
    precompilation.start_helpers(task_of(engine, run.scene))
    times = run.times if period is None else period * (cycle + np.arange(run.rows * samples + 1) / samples)
    if parameters is None:
        outputs = period * np.arange(1, samples + 1) / samples if run.scene.repeats else times[1:]
        parameters = engine.parameters_of(run.scene, run.steps_per_cycle, outputs)
    fall = None if followed is None else angle_of_fall(run.scene)
    keys = keys_at(stream_keys(run.seed), cycle) if engine.renews else stream_keys(run.seed)

    def simulate(parameters, numbers, part):
        """Simulate realizations of `numbers` (count,), by the engine's `parameters`, into the arrays of a `Batch`."""
        engine.simulate(keys, numbers, cycle, parameters, *part[1:6])

    size = max(TUNING.smallest_batch, TUNING.first_batch // run.rows)
    while first < run.realizations:
        began = time.perf_counter()
        count = run.realizations - first if alike else min(size, run.realizations - first)
        batch = _empty_batch(0, 1, len(times), capacity) if alike else _empty_batch(first, count, len(times), capacity)
        numbers = np.arange(batch.first, batch.first + len(batch.angle))
        _fill(batch, numbers, functools.partial(simulate, parameters), 4 * thread_count())
        if not run.scene.repeats:
            _drop_overturning_after(batch, times[-1])
        _refuse_missing_states(batch, run, times)
        if fall:
            later = parameters._replace(block=parameters.block._replace(cutoff=fall))
            paths = _paths_to_follow(batch, engine.renews, followed)
            _write_returns(batch.returns, paths, run, engine.renews, later, simulate)
            followed += int(batch.returns[0])
        yield _repeated(batch, first, count) if alike else batch
        first += count
        if progress is not None:
            progress(first, run.realizations)
        # Batches are short enough to be interrupted and long enough to keep all threads busy.
        affordable = size * TUNING.batch_seconds / (time.perf_counter() - began)
        size = max(TUNING.smallest_batch, int(min(affordable, 4 * size)))


def _paths_to_follow(batch, unseen, already):
    """Return a list of int, the numbers of realizations of a `Batch` that are followed on to the fall.

    Of the first n realizations these are at most √n `TUNING.followed` of those that overturn; where a path is not the
    same to another cut-off (`unseen`, a bool), of all. `already` (int): how many before the batch were followed. The
    choice does not depend on how realizations are divided into batches.
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


def _write_returns(returns, numbers, run, unseen, parameters, simulate):
    """Write to `returns` (2,) how many of some paths overturn on the way to the fall, and how many of these come back.

    `numbers`: a list of the paths' numbers, all of which overturn unless `unseen`: then (a bool, as in
    `_paths_to_follow`) overturning is looked for at the end of each interval. `run`: their `Run`; `parameters`: the
    engine's, with the cut-off at the fall; `simulate`: a function of these, numbers (n,) and a `Batch` that it fills.
    """
    if not numbers:
        return
    states, cutoff = run.rows + 1, run.scene.overturning.angle
    if unseen:
        grid, ends = parameters.grid, np.arange(1.0, parameters.grid.count + 1.0)
        if not run.scene.repeats:  # the last interval ends at the last time or after it
            ends[-1] = grid.output_times[-1]
        parameters = parameters._replace(grid=grid._replace(output_times=ends))
        states = (run.rows if run.scene.repeats else 1) * grid.count + 1
    paths = _empty_batch(0, len(numbers), states, 0)
    _fill(paths, np.array(numbers), functools.partial(simulate, parameters), thread_count())
    angles = np.abs(paths.angle)
    over = (paths.overturn_side != 0) | (angles.max(axis=1) >= cutoff) if unseen else np.full(len(numbers), True)
    returns[:] = over.sum(), (over & (angles[:, -1] < cutoff)).sum()


def _fill(batch, numbers, simulate, parts):
    """Fill a `Batch` with realizations of `numbers` (count,), in a number of `parts` that the threads take in turn.

    `simulate`: function of numbers and of the `Batch` that it fills.
    """
    size = -(-len(numbers) // parts)
    ranges = [slice(begin, begin + size) for begin in range(0, len(numbers), size)]
    map_threads(lambda part: simulate(numbers[part], _part(batch, part)), ranges)


def _part(batch, places):
    """Return the named tuple `Batch` of the realizations at `places`, a slice, of another: views of its arrays."""
    impacts = ImpactRecord(*(array[places] for array in batch.impacts))
    return Batch(batch.first + places.start, *(array[places] for array in batch[1:5]), impacts, batch.returns)


def _repeated(batch, first, count):
    """Return the named tuple `Batch` of `count` equal realizations, numbered from `first` on, by a `Batch` of one."""
    states, impacts = ([np.repeat(part, count, axis=0) for part in parts] for parts in (batch[1:5], batch.impacts))
    return Batch(first, *states, ImpactRecord(*impacts), batch.returns)


def _drop_overturning_after(batch, end):
    """Set times and sides of overturning of a `Batch`, in place, to nan and 0 where the time is after `end`.

    `end`: the last time τ that is wanted; an engine goes on to the end of the interval in which it is.
    """
    later = batch.overturn_time > end
    batch.overturn_time[later], batch.overturn_side[later] = math.nan, 0


def _refuse_missing_states(batch, run, times):
    """Raise FloatingPointError where a state of a `Batch` is missing or is no number.

    Every one up to overturning, and none after it, has to be a finite number. `times` (rows * samples + 1,) are those
    of the states, nondimensional; `run`: the `Run`, for the message.
    """
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


def _empty_batch(first, count, rows, capacity):
    """Return the named tuple `Batch`, to be filled: `count` realizations, numbered from `first` on.

    Its states are arrays (count, rows), nan at first; there is space for `capacity` impacts of each realization.
    """
    angle, velocity = np.full((2, count, rows), math.nan)
    time, speed = np.full((2, count, capacity), math.nan)
    hits = ImpactRecord(np.zeros(count, np.int64), time, speed)
    return Batch(first, angle, velocity, np.empty(count), np.empty(count, np.int8), hits, np.zeros(2, np.int64))


class Outcomes(NamedTuple):
    """What n paths come to, nondimensional.

    `overturn_time`, `overturn_side` (n,): as in `montecarlo.Ensemble`, nan and 0 of a path that stands. `peak` (n,):
    largest |Θ| up to overturning, where it is that of overturning.
    """

    overturn_time: np.ndarray
    overturn_side: np.ndarray
    peak: np.ndarray

    @property
    def overturned(self):
        """Whether each path overturns, an array (n,) of bool."""
        return self.overturn_side != 0


class ScaledPaths:
    """Paths of a scene without noise under its forcing times any factor, as the engine "exact" follows them.

    Parameters
    ----------
    scene : Scene
        `Scene.deterministic`.
    cycles, times
        As for `montecarlo.simulate`: overturning counts until the last of them.
    """

    def __init__(self, scene, cycles=None, times=None):
        run = checked_run(scene, cycles, None, 1, "exact", 200, times=times)
        parameters = engine_of(scene, "exact").parameters_of(scene, 200, None if scene.repeats else run.times[-1:])
        grid, self._samples = parameters.grid, 1
        ends = np.arange(1.0, grid.count + 1.0)
        if scene.repeats:
            self._run, self._samples = run, grid.count
            self.times = run.times[-1] / (grid.count * run.rows) * np.arange(grid.count * run.rows + 1)
        else:
            # The last interval ends at the last time or after it.
            ends[-1] = grid.output_times[-1]
            self.times = grid.spacing * np.append(0.0, ends)
            self._run = run._replace(times=self.times)
        self._parameters = parameters._replace(grid=grid._replace(output_times=ends))
        self.cutoff = scene.overturning.angle

    @functools.cached_property
    def least_scale(self):
        """Factor (float) up to which the forcing does not lift off a block at rest; 0 for one that starts otherwise."""
        scene = self._run.scene
        if scene.start.angle or scene.start.velocity or not scene.forcing.largest:
            return 0.0
        return lift_off(scene.block.critical_angle) / scene.forcing.largest

    def __call__(self, scales):
        """Return the named tuple `Outcomes` of n paths, one at each of the `scales` (n,), factors above 0.

        Arrays (n,): time τ and side of overturning, and the largest |Θ|. The threads share the paths.
        """
        outcomes = Outcomes(*np.full((3, len(scales)), math.nan))
        map_threads(lambda number: self._follow(number, scales[number], outcomes), range(len(scales)))
        return outcomes

    def _follow(self, number, scale, outcomes):
        """Follow the path under the forcing times `scale` (float) and write what it comes to into `outcomes`.

        That is at place `number` of the arrays of `outcomes`, an `Outcomes`.
        """
        parameters = scaled_parameters(self._parameters, scale)
        (path,) = simulate_batches(self._run, samples=self._samples, parameters=parameters)
        outcomes.overturn_time[number], outcomes.overturn_side[number] = path.overturn_time[0], path.overturn_side[0]
        peak = self.cutoff if path.overturn_side[0] else largest_angle(self.times, path.angle[0], path.velocity[0])
        outcomes.peak[number] = peak


def largest_angle(times, angle, velocity):
    """Return the largest |Θ| (float) of a path from its states `angle`, `velocity` (n,) at `times` (n,).

    All are nondimensional. It is that of cubics between these, and right to some 1e-5 over intervals of .2. An interval
    with an impact counts at its ends alone: what rises and returns within it has a small angle.
    """
    h, side = np.diff(times), np.sign(angle[:-1])
    u, end, v, w = side * angle[:-1], side * angle[1:], side * velocity[:-1], side * velocity[1:]
    turns = (end > 0.0) & (v > 0.0) & (w < 0.0)
    u, end, v, w, h = u[turns], end[turns], v[turns], w[turns], h[turns]
    mean = (end - u) / h
    # The slope of the cubic is v + s (b + s a) at the part s of the interval.
    a, b = 3.0 * (v + w - 2.0 * mean), -2.0 * (2.0 * v + w - 3.0 * mean)
    s = 2.0 * v / (np.sqrt(np.maximum(b * b - 4.0 * a * v, 0.0)) - b)
    tops = u + h * s * (v + s * (0.5 * b + s * a / 3.0))
    return max(float(np.abs(angle).max()), float(tops.max(initial=0.0)))
