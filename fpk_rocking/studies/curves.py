"""`fragility`: the probability of overturning as a function of the scale of the shaking."""

import math
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from typing import Any

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import ArrayLike, File, Progress
from fpk_rocking.scene.ranges import result_times
from fpk_rocking.scene.scene import Scene
from fpk_rocking.studies.execution import Job, run_jobs, seed_of
from fpk_rocking.studies.outcomes import FARTHEST, MotionOutcomes, overturns, search
from fpk_rocking.studies.outcomes import kernels_of as kernels_of_paths
from fpk_rocking.studies.result import Fragility
from fpk_rocking.studies.scenes import checked_scenes, grid, scaled
from fpk_rocking.studies.tasks import TASKS, kernels_of
from montecarlo.engines import engine_of


def fragility(
    scene: Scene | Sequence[Scene],
    *,
    scale: ArrayLike,
    cycles: int | None = None,
    times: ArrayLike | None = None,
    engine: str | None = None,
    levels: ArrayLike = (),
    over: Mapping[str, ArrayLike] | None = None,
    scale_noise: bool = True,
    realizations: int = 10_000,
    tol: float = 1e-2,
    seed: int = 1,
    workers: int | Executor = 1,
    store: File | None = None,
    progress: Progress | None = None,
) -> Fragility:
    """Compute the probability of overturning as a function of the scale of the shaking.

    The result is a curve, a curve for each of several scenes, or a surface over a parameter. Each level x gives the
    probability P(max |Θ| ≥ x) too. The samples of different scales and of different scenes are independent of each
    other, as the fit supposes. Levels share random numbers, and so do the values of a parameter, so their differences
    have less sampling noise; the curves of two levels never cross under band noise or none.

    Without noise all scales at which the outcome changes are searched for (`critical_intensities`), and a probability
    is 0 or 1 by those. The search does not depend on `scale`.

    Parameters
    ----------
    scene : Scene, or sequence of Scene
        The scene at scale 1, or several, such as one for each recorded motion.
    scale : sequence of float
        Factors of the acceleration of the forcing and of the noise, above 0.
    cycles : int, optional
        Number of forcing cycles in which the block may overturn. Required where the forcing repeats, refused where it
        does not.
    times : sequence of float, optional
        For a pulse or a record: ascending nondimensional times; overturning counts until the last one. By default it
        counts until 10 units of time after the end of each motion.
    engine : {"exact", "rk4", "white", "filtered", "density"}, optional
        A method of `montecarlo.simulate`, or "density" for `fpk_rocking.solve_fpk`. "white" and "filtered" replace band
        noise. By default the Monte Carlo method that fits the noise.
    levels : sequence of float
        Angles x in units of θ_cr, between the start and overturning.
    over : dict of str to sequence of float, optional
        One parameter of a single scene with its values, for a surface: ``{"size": [0.5, 1.0, 2.0]}``. Names are those
        of `fpk_rocking.studies.scenes.varied`.
    scale_noise : bool
        Whether the noise is scaled with the forcing.
    realizations : int
        Number of realizations of each sample. Deterministic scenes have one path each whatever the number.
    tol : float
        Wanted error of the engine "density".
    seed : int
        Seed of the random numbers, at least 0.
    workers, store, progress
        As for `fpk_rocking.studies.sweep`.

    Returns
    -------
    Fragility
        `probability` (scenes, 1 + levels, scales), its `interval`, lognormal `fits` and others. Where the engine
        refuses some of the scales, the probability is nan there and `Fragility.reasons` says why.

    Raises
    ------
    TypeError, ValueError
        A parameter is refused, the engine refuses all scales, or the store belongs to another study or to one that
        still runs.
    RuntimeError
        The executor came to its end, as where the scheduler of a cluster is killed. The store keeps what came.

    Examples
    --------
    >>> from fpk_rocking import Scene
    >>> from fpk_rocking.studies import fragility
    >>> rack = Scene.from_block(0.5, 1.8, "0.5 g", "1.5 Hz",
    ...                         noise_rms_acceleration=0.5, noise_band_hz=(0, 5))
    >>> print(fragility(rack, scale=[0.8, 1.0, 1.2], cycles=4, realizations=500).overturned)
    [[0.002 0.094 0.352]]
    """
    started = time.perf_counter()
    scenes, axis, places = _scenes(scene, over)
    factors = tuple(sorted(checks.several("scale", scale, most=10_000, above=0.0)))
    if len(set(factors)) != len(factors):
        raise ValueError(checks.refusal("scale", scale, "numbers that differ from each other"))
    levels = () if isinstance(levels, tuple | list) and not levels else checks.several("levels", levels, most=10_000)
    _check_levels(levels, scenes)
    seed = checks.count("seed", seed, at_least=0)
    engine, shaken = _engine(engine, scenes)
    for scene_at_one in shaken:
        result_times(scene_at_one, cycles, times)
    lasting: dict[str, Any] = {} if cycles is None else {"cycles": int(cycles)}
    lasting |= {} if times is None else {"times": np.asarray(times, float).tolist()}
    options, realizations = _options(engine, shaken, lasting, realizations, tol)
    shape = len(scenes), 1 + len(levels), len(factors)
    searched = engine == "exact" and all(scene_at_one.deterministic for scene_at_one in shaken)
    jobs: list[Job] = []
    job_of = np.arange(math.prod(shape[:2] if searched else shape)).reshape(*shape[:2], -1) + np.zeros(shape, int)
    for m, which, n in np.ndindex(*shape[:2], 1 if searched else shape[2]):
        own = seed_of(seed, n if over else m * len(factors) + n)
        level = levels[which - 1] if which else None
        jobs.append(Job(len(jobs), _at(shaken[m], 1.0 if searched else factors[n], level, scale_noise), own))
    running: dict[str, Any] = {"workers": workers, "store": store, "progress": progress}
    if searched:
        bounds = {"measure": "scale", "highest": None} | lasting
        options |= {"farthest": FARTHEST}
        rows = run_jobs(search, jobs, bounds, kernels_of_paths, **running)
    else:
        rows = run_jobs(TASKS["fpk" if engine == "density" else "mc"], jobs, options, kernels_of, **running)
    values = [row["values"] for row in rows]
    if not any(values):
        raise ValueError(f"scale: the engine answers none of {list(factors)}; the first reason: {rows[0]['reason']}")
    outcomes = MotionOutcomes.of(values, shape[1]) if searched else None
    if outcomes is None:
        probability = np.array([_overturned(row) for row in values])[job_of]
    else:
        overturned = overturns(outcomes.jumps.reshape(len(rows), -1), factors).reshape(shape)
        probability = np.where(np.array(list(map(bool, values)))[job_of], overturned, np.nan)
    noise = "white" if any(row.get("noise_replacement") for row in values) else engine if shaken != scenes else ""
    replaced = (
        f"At every scale {noise} noise of equal Melnikov variance replaces that of the scene: an approximation, which "
        "Monte Carlo under the noise of the scene can check."
    )
    return Fragility(
        scenes=scenes,
        axis=axis,
        place=np.array(places, float),
        level=np.array(levels, float),
        scale=np.array(factors),
        probability=probability,
        error_estimate=np.array([row.get("error_estimate", np.nan) for row in values])[job_of],
        engine=engine,
        realizations=realizations,
        noise_scaled=bool(scale_noise),
        options=options | {"seed": seed},
        noise_replacement=replaced * bool(noise),
        reasons={
            ",".join(map(str, place)): rows[number]["reason"]
            for place, number in np.ndenumerate(job_of)
            if rows[number]["reason"]
        },
        wall_s=time.perf_counter() - started,
        motions=outcomes,
    )


def _scenes(scene, over):
    """Return (scenes, axis, places): scenes at scale 1, the name of what they differ in, and its value for each.

    `scene` and `over` are as of `fragility`; without `over` the name is "scene" and the values are 0, 1, ...
    """
    if over is None:
        scenes = (scene,) if isinstance(scene, Scene) else checked_scenes("scene", scene)
        return scenes, "scene", range(len(scenes))
    surface = grid(scene, over)
    if len(surface.axes) != 1 or "scale" in surface.axes:
        raise ValueError(checks.refusal("over", over, 'one parameter other than the scale, {"size": [0.5, 1.0]}'))
    ((axis, places),) = surface.axes.items()
    return surface.scenes, axis, places


def _check_levels(levels, scenes):
    """Raise ValueError for one of `levels`, angles in units of θ_cr, not between all scenes' start and overturning."""
    least = max(abs(scene.start.angle) for scene in scenes)
    most = min(scene.overturning.angle for scene in scenes)
    for number, level in enumerate(levels):
        if not least < level < most:
            accepted = f"an angle above that of the start, {least:g}, and below that of overturning, {most:g}"
            raise ValueError(checks.refusal(f"levels[{number}]", level, accepted))


def _engine(engine, scenes):
    """Return (engine, scenes): the name of the engine, one that fits for None, and the scenes with noise it takes.

    ValueError where no one engine takes all `scenes`, or there is none of this name.
    """
    engines = "exact", "rk4", "white", "filtered", "density"
    if engine is not None and engine not in engines:
        accepted = ", ".join(map(repr, engines)) + " or None (the Monte Carlo method that fits the noise)"
        raise ValueError(checks.refusal("engine", engine, accepted))
    if engine is None:
        kinds = {engine_of(scene).method for scene in scenes}
        if len(kinds) != 1:
            accepted = "scenes whose noise one method takes, or an `engine` that replaces it"
            raise ValueError(checks.refusal("scene", f"methods {sorted(kinds)}", accepted))
        return kinds.pop(), scenes
    if engine in {"white", "filtered"}:
        return engine, tuple(getattr(scene, f"{engine}_equivalent")() for scene in scenes)
    return engine, scenes


def _options(engine, scenes, lasting, realizations, tol):
    """Return (options, realizations): a dict of options of the task, and the size (int) of a sample, 0 for a density.

    `engine` is its name, `scenes` are `Scene`s, `lasting` a dict with cycles or times, `realizations` (int) the wanted
    size, of which 1 is left where no scene is random, `tol` the wanted error of the probabilities of a density.
    """
    if engine == "density":
        return lasting | {"tol": tol}, 0
    realizations = checks.count("realizations", realizations)
    realizations = 1 if all(scene.deterministic for scene in scenes) else realizations
    return lasting | {"realizations": realizations, "method": engine}, realizations


def _at(scene, factor, level, scale_noise):
    """Return the scene scaled by `factor`, its angle of overturning set to `level`, or kept where that is None.

    `scale_noise`: whether the noise is scaled too.
    """
    shaken = scaled(scene, factor, noise=scale_noise)
    return shaken if level is None else shaken.varied(overturning={"angle": level})


def _overturned(values):
    """Return the last probability of overturning (float) by `values`, the dict of a row of a task; nan of an empty one.

    Of a sample it is a ratio of whole numbers.
    """
    if not values:
        return np.nan
    if "survivors" in values:
        return (values["realizations"] - values["survivors"]) / values["realizations"]
    return 1.0 - values["survival"][-1]
