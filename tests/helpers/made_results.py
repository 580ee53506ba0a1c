"""A result of every kind, made of arrays that no two readings can share: rows, sides, limits and scenes all differ.

Beside a result stand the table and dataset that it has to give, from these arrays and by other formulas than its own.
"""

import functools
import itertools
import math
import types

import made_studies
import numpy as np
from made_parts import CYCLES, MAIN, PATHS, PULSE, SPACE, UNEVEN, WHITE, WHOLE, Made, wilson

from fpk_rocking import CycleOperator
from fpk_rocking.compare import compare
from fpk_rocking.density.density import PlaneMap
from fpk_rocking.density.evolution import Evolution
from fpk_rocking.results import sampling as distances
from fpk_rocking.results.pictures import shown_edges
from fpk_rocking.scene.axes import joint_edges
from montecarlo import Ensemble, Histories, Splitting, Tally
from montecarlo.results.counts import PARTS, Counts


def _survival_grids(result, times, survival, overturned, limits=None):
    edges = result.bin_edges
    bins = np.stack([result.bin_probabilities(row, *edges) for row in range(len(times))])
    variables = {
        "survival": (("time",), survival),
        "overturned": (("time", "side"), overturned),
        "bin_probability": (("time", "bin_angle", "bin_velocity"), bins),
    }
    middles = [0.5 * (line[1:] + line[:-1]) for line in edges]
    places = {"time": times, "side": ["left", "right"], "bin_angle": middles[0], "bin_velocity": middles[1]}
    if result.scene.period is not None:
        places["cycle"] = np.arange(len(times))
    if limits is not None:
        variables["survival_interval"], places["limit"] = (("time", "limit"), limits), ["low", "high"]
    return variables, places


def _survival_columns(scene, times, survival, overturned, limits=None):
    columns = {} if scene.period is None else {"cycle": np.arange(len(times))}
    columns |= {"time": times, "survival": survival}
    if limits is not None:
        columns |= {"survival_low": limits[:, 0], "survival_high": limits[:, 1]}
    return columns | {"overturned_left": overturned[:, 0], "overturned_right": overturned[:, 1]}


def evolution(scene=MAIN, times=WHOLE, seed=1, rests_exactly=False, **settings):
    rng, rows = np.random.default_rng(seed), len(times)
    overturned = np.cumsum(rng.uniform(0.2, 1.0, (rows, 2)) * [0.6, 0.15] / rows, axis=0)
    overturned -= overturned[0]
    truncated = 1e-7 * np.sqrt(np.arange(rows))
    survival = 1.0 - overturned.sum(axis=1) - truncated
    at_rest = survival * rng.uniform(0.1, 0.3, rows)
    coefficients = np.zeros((rows, *SPACE.shape))
    masses = rng.uniform(0.5, 1.5, (rows, *SPACE.areas.shape))
    masses *= ((survival - at_rest * rests_exactly) / masses.sum(axis=(1, 2)))[:, None, None]
    coefficients[..., 0, 0] = masses / SPACE.areas
    coefficients[..., 0, 1] = 0.3 * coefficients[..., 0, 0] * rng.uniform(-1.0, 1.0, masses.shape)
    result = Evolution(
        scene=scene,
        diffusion=0.00628,
        noise_replacement="White noise stands for the band." * (scene.noise.kind == "band"),
        tol=1e-3,
        times=times,
        survival=survival,
        overturned=overturned,
        truncated=truncated,
        at_rest=at_rest,
        error_estimate=4e-4,
        bins_error_estimate=3e-3,
        rest_error_estimate=2e-3,
        mass_defect=1e-15,
        negative_mass=5e-4,
        moving_negative_mass=0.5 * 5e-4,
        wall_s=1.5,
        settings=settings,
        coefficients=coefficients,
        angle_lines=SPACE.angle_lines,
        velocity_lines=SPACE.velocity_lines,
        rests_exactly=rests_exactly,
    )
    columns = _survival_columns(scene, times, survival, overturned) | {"truncated": truncated, "at_rest": at_rest}
    variables, places = _survival_grids(result, times, survival, overturned)
    variables |= {"truncated": (("time",), truncated), "at_rest": (("time",), at_rest)}
    return Made(result, columns, variables, places)


def _paths(times, seed, paths=PATHS):
    """States (paths, rows), nan after overturning, and the times and sides of that; three in four go left."""
    rng, rows = np.random.default_rng(seed), len(times)
    ends = rng.uniform(0.0, 1.4 * times[-1], paths)
    side = np.where(ends > times[-1], 0, np.where(rng.random(paths) < 0.75, -1, 1)).astype("i1")
    angle, velocity = rng.uniform(-1.0, 1.4, (paths, rows)), rng.normal(0.3, 0.8, (paths, rows))
    for states in (angle, velocity):
        states[times >= ends[:, None]] = math.nan
    ends[side == 0] = math.nan
    return angle, velocity, ends, side


def ensemble(scene=MAIN, times=WHOLE, seed=5, method="rk4"):
    angle, velocity, ends, side = _paths(times, seed)
    result = Ensemble(scene, method, seed, 200, 2.5, times, angle, velocity, ends, side, np.array([9, 0]))
    overturned = np.array([[np.sum((ends <= time) & (side == sign)) for sign in (-1, 1)] for time in times]) / PATHS
    survival = 1.0 - overturned.sum(axis=1)
    limits = wilson(survival, PATHS)
    variables, places = _survival_grids(result, times, survival, overturned, limits)
    variables |= {"angle": (("realization", "time"), angle), "velocity": (("realization", "time"), velocity)}
    variables |= {"overturn_time": (("realization",), ends), "overturn_side": (("realization",), side)}
    return Made(result, _survival_columns(scene, times, survival, overturned, limits), variables, places)


def tally():
    rng, (angles, velocities) = np.random.default_rng(7), joint_edges(MAIN)
    passages = rng.integers(0, [5, 2], (PARTS * CYCLES + 1, 2))
    passages[0] = 0
    overturned_counts = np.array([passages[: PARTS * k + 1].sum(axis=0) for k in range(CYCLES + 1)])
    size = int(overturned_counts[-1].sum()) + 2000
    standing = size - overturned_counts.sum(axis=1)
    share = rng.dirichlet(np.full((angles.size - 1) * (velocities.size - 1), 0.5))
    histogram = rng.multinomial(standing, share).reshape(CYCLES + 1, angles.size - 1, -1).astype(np.int32)
    sums, products = np.zeros((CYCLES + 1, 2), np.int64), np.zeros((CYCLES + 1, 3, 2), np.int64)
    quantum = np.array([2.0**-30, 2.0**-28])
    counts = Counts(WHOLE, angles, velocities, quantum, standing, passages, histogram, sums, products, np.array([0, 0]))
    result = Tally(MAIN, "exact", 7, 200, 3.5, counts)
    survival, overturned = standing / size, overturned_counts / size
    limits = wilson(survival, size)
    columns = _survival_columns(MAIN, WHOLE, survival, overturned, limits)
    return Made(result, columns, *_survival_grids(result, WHOLE, survival, overturned, limits))


def histories():
    samples, paths = 40, 5
    times = MAIN.period * np.arange(4 * samples + 1) / samples
    angle, velocity, ends, side = _paths(times, 8, paths)
    rng = np.random.default_rng(9)
    impacts = np.sort(rng.integers(0, paths, 17)), rng.uniform(0.0, times[-1], 17), rng.normal(0.0, 1.0, 17)
    result = Histories(MAIN, "rk4", 8, 200, 0.5, samples, times, angle, velocity, ends, side, *impacts)
    numbers, time = map(np.array, zip(*itertools.product(range(paths), times), strict=True))
    columns = {
        "realization": numbers,
        "time": time,
        "angle": np.concatenate(angle),
        "velocity": np.concatenate(velocity),
        "overturn_time": ends[numbers],
        "overturn_side": side[numbers],
    }
    variables = {"angle": (("realization", "time"), angle), "velocity": (("realization", "time"), velocity)}
    variables |= {"overturn_time": (("realization",), ends), "overturn_side": (("realization",), side)}
    names = "impact_realization", "impact_time", "impact_velocity"
    variables |= {name: (("impact",), values) for name, values in zip(names, impacts, strict=True)}
    return Made(result, columns, variables, {"realization": np.arange(paths), "time": times})


def splitting(repeats=30):
    rng = np.random.default_rng(10)
    estimates = np.cumsum(1e-7 * rng.uniform(0.5, 1.5, (repeats, CYCLES + 1, 2)) * [3.0, 1.0], axis=1)
    estimates[:, 0] = 0.0
    levels, killed = rng.integers(5, 9, repeats), rng.integers(60, 90, repeats)
    result = Splitting(WHITE, 100, 10, 200, 0.5, estimates, levels, killed)
    totals = estimates[..., 0] + estimates[..., 1]
    error = np.sqrt(((totals - totals.mean(axis=0)) ** 2).sum(axis=0) / (repeats * (repeats - 1)))
    columns = {"cycle": np.arange(CYCLES + 1), "probability": totals.mean(axis=0), "standard_error": error}
    left, right = (sum(estimates[:, :, side]) / repeats for side in (0, 1))
    variables = {name: (("cycle",), columns[name]) for name in ("probability", "standard_error")}
    variables["overturned"] = ("cycle", "side"), np.stack([left, right], axis=1)
    variables["repeat_overturned"] = ("repeat", "cycle", "side"), estimates
    variables |= {"levels": (("repeat",), levels), "killed": (("repeat",), killed)}
    places = {"cycle": np.arange(CYCLES + 1), "side": ["left", "right"]}
    return Made(result, columns | {"overturned_left": left, "overturned_right": right}, variables, places)


JOINT = [3, 70, 149]


def comparison():
    sample, density = ensemble(), evolution()
    result = compare(sample.result, density.result, JOINT)
    first, second = sample.columns, density.columns
    pair = first["survival"], second["survival"]
    # Of a sample and a law the common probability is that of the law.
    error = np.sqrt(pair[1] * (1.0 - pair[1]) / PATHS)
    with np.errstate(invalid="ignore"):
        scores = np.where(pair[0] == pair[1], 0.0, (pair[0] - pair[1]) / error)
    limits = first["survival_low"], first["survival_high"]
    nothing = np.full(CYCLES + 1, math.nan)
    columns = {"cycle": np.arange(CYCLES + 1), "time": WHOLE}
    columns |= {"survival_first": pair[0], "survival_second": pair[1]}
    columns |= {"survival_first_low": limits[0], "survival_first_high": limits[1]}
    columns |= {"survival_second_low": nothing, "survival_second_high": nothing}
    columns |= {"difference": pair[0] - pair[1], "standard_error": error, "z": scores}
    variables = {name: (("cycle",), columns[name]) for name in ("difference", "standard_error", "z")}
    bins = [
        [compared.result.bin_probabilities(cycle, *joint_edges(MAIN)) for cycle in JOINT]
        for compared in (sample, density)
    ]
    figures = {
        "l1": [np.abs(ours - theirs).sum() for ours, theirs in zip(*bins, strict=True)],
        "l1_floor": [distances.l1_floor(law, PATHS, math.inf) for law in bins[1]],
        "hellinger": [math.sqrt(0.5 * ((np.sqrt(a) - np.sqrt(b)) ** 2).sum()) for a, b in zip(*bins, strict=True)],
        "hellinger_floor": [distances.hellinger_floor(law, PATHS, math.inf) for law in bins[1]],
    }
    for name, values in figures.items():
        columns[name] = nothing.copy()
        columns[name][JOINT] = values
        variables[name] = ("cycle",), columns[name]
    empty = np.stack([nothing, nothing], axis=1)
    variables["survival"] = ("cycle", "result"), np.stack(pair, axis=1)
    variables["survival_interval"] = ("cycle", "result", "limit"), np.stack([np.stack(limits, axis=1), empty], axis=1)
    sides = [np.stack([table["overturned_left"], table["overturned_right"]], axis=1) for table in (first, second)]
    variables["leakage"] = (
        ("during", "result", "side"),
        np.stack([side[1:] - side[:-1] for side in sides], axis=1),
    )
    places = {"cycle": np.arange(CYCLES + 1), "time": WHOLE, "during": np.arange(1, CYCLES + 1)}
    places |= {"result": ["first", "second"], "limit": ["low", "high"], "side": ["left", "right"]}
    return Made(result, columns, variables, places)


def operator():
    """Without its meshes: what is shown is its numbers, and one density."""
    result = CycleOperator.__new__(CycleOperator)
    density = evolution().result.coefficients[5]
    density = density / SPACE.masses(density).sum()
    values = np.array([0.93, 0.4 + 0.3j, 0.4 - 0.3j, -0.2])
    leakage = np.array([0.05, 0.02])
    own = {"scene": MAIN, "noise_replacement": "", "diffusion": 0.006, "tol": 1e-3, "escape_rate": -math.log(0.93)}
    own |= {
        "escape_error": 1e-4,
        "refinement": [(10, 0.07)],
        "leakage": leakage,
        "truncated": 0.0,
        "eigenvalues": values,
    }
    own |= {"residuals": np.full(4, 1e-9), "negative_mass": 1e-5, "settings": {}}
    vars(result).update(own, _fine=types.SimpleNamespace(space=SPACE, quasi_stationary=density))
    edges = shown_edges(joint_edges(MAIN), SPACE.bin_integrals(density, *joint_edges(MAIN)), 64)
    columns = {"mode": np.arange(4), "modulus": np.array([0.93, 0.5, 0.5, 0.2])}
    columns |= {"real": np.array([0.93, 0.4, 0.4, -0.2]), "imaginary": np.array([0.0, 0.3, -0.3, 0.0])}
    variables = {name: (("mode",), columns[name]) for name in ("modulus", "real", "imaginary")}
    variables |= {"leakage": (("side",), leakage)}
    variables |= {"bin_probability": (("bin_angle", "bin_velocity"), SPACE.bin_integrals(density, *edges))}
    middles = [0.5 * (line[1:] + line[:-1]) for line in edges]
    places = {"mode": np.arange(4), "side": ["left", "right"], "bin_angle": middles[0], "bin_velocity": middles[1]}
    return Made(result, columns, variables, places)


def plane_map():
    return PlaneMap(SPACE, evolution().result.coefficients[9], 0.3, 1e-3)


KINDS = {
    "density": evolution,
    "density with rest": functools.partial(evolution, rests_exactly=True),
    "density after a pulse": functools.partial(evolution, PULSE, UNEVEN),
    "ensemble": ensemble,
    "ensemble after a pulse": functools.partial(ensemble, PULSE, UNEVEN, method="white"),
    "tally": tally,
    "histories": histories,
    "splitting": splitting,
    "comparison": comparison,
    "fragility": made_studies.fragility,
    "fragility by density": functools.partial(made_studies.fragility, sampled=False),
    "surface": functools.partial(made_studies.fragility, "size"),
    "critical": made_studies.critical,
    "pooled": made_studies.pooled,
    "probability": made_studies.probability,
    "risk": made_studies.risk,
    "study": made_studies.study,
    "designs": made_studies.designs,
    "sweep": made_studies.sweep,
    "list": functools.partial(made_studies.sweep, gridded=False),
    "operator": operator,
}
"""Functions that make each kind."""

WITH_ROWS = [name for name in KINDS if name.startswith(("density", "ensemble", "tally"))]
"""Those with rows of survival, and with bins."""

SAMPLES = [name for name in WITH_ROWS if name.startswith(("ensemble", "tally"))]
"""Those with intervals."""


@functools.cache
def kind(name):
    """Return what is made of a kind; once, as nothing changes it."""
    return KINDS[name]()


def equal(actual, expected, name=""):
    """Hold arrays against each other: texts and whole numbers exactly, others to 1e-9."""
    actual, expected = np.asarray(actual), np.asarray(expected)
    assert actual.shape == expected.shape, name
    if expected.dtype.kind in "fc":
        np.testing.assert_allclose(actual, expected, rtol=1e-9, atol=1e-12, err_msg=name)
    else:
        assert actual.tolist() == expected.tolist(), name
