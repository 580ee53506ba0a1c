"""Made results of studies: curves, surfaces, sweeps, probabilities, critical intensities, rates (see made_results)."""

import dataclasses
import itertools
import math

import numpy as np
from made_parts import CYCLES, MAIN, Made, wilson
from scipy import stats

from fpk_rocking import Scene
from fpk_rocking.risk import CriticalIntensities, Designs, Fragility, Hazard, IntensityCurve, Risk, Study
from fpk_rocking.risk.lognormal import LognormalFit
from fpk_rocking.studies import Sweep
from fpk_rocking.studies.probability import Probability

BLOCKS = tuple(
    Scene.from_block(width, height, peak, 1.5, noise_rms_acceleration=0.3, noise_band_hz=(0.0, 5.0))
    for width, height, peak in ((0.6, 2.4, 3.0), (0.5, 1.8, 4.0), (0.9, 2.0, 5.0))
)
LEVELS, SCALES = np.array([0.5, 1.1]), np.geomspace(0.4, 2.3, 20)


def fragility(axis="scene", sampled=True):
    rng = np.random.default_rng(11)
    shape = len(BLOCKS), 1 + LEVELS.size, SCALES.size
    rising = np.sort(rng.uniform(0.02, 0.98, shape), axis=-1)
    error = np.full(shape, math.nan) if sampled else rng.uniform(1e-3, 1e-2, shape)
    probability = np.round(rising * 1000) / 1000 if sampled else rising
    probability[1, 2, 3] = error[1, 2, 3] = math.nan
    reason = "ValueError: refused"
    place = np.array([1.5, 2.5, 4.0]) if axis != "scene" else np.arange(3.0)
    result = Fragility(
        scenes=BLOCKS,
        axis=axis,
        place=place,
        level=LEVELS,
        scale=SCALES,
        probability=probability,
        error_estimate=error,
        engine="exact" if sampled else "density",
        realizations=1000 if sampled else 0,
        noise_scaled=True,
        options={"cycles": 4, "seed": 1} | ({} if sampled else {"tol": 1e-2}),
        noise_replacement="",
        reasons={"1,2,3": reason},
        wall_s=1.0,
    )
    limits = wilson(np.nan_to_num(probability.ravel()), 1000).reshape(*shape, 2)
    if not sampled:
        limits = np.clip(np.stack([probability - error, probability + error], axis=-1), 0.0, 1.0)
    limits[1, 2, 3] = math.nan
    rows = []
    for (m, block), (n, scale), which in itertools.product(enumerate(BLOCKS), enumerate(SCALES), range(3)):
        size, at = block.block.dimensions, (m, which, n)
        unit, velocity = size.gravity * size.critical_angle, block.forcing.amplitude / block.forcing.frequency
        fit, level = result.fits[m][which], [block.overturning.angle, *LEVELS][which]
        row = {axis: str(block.forcing) if axis == "scene" else place[m], "scale": scale, "level": level}
        row["level_deg"] = level * math.degrees(math.atan2(size.width, size.height))
        row |= {"event": "reached" if which else "overturned", "probability": probability[at]}
        row |= {"low": limits[at][0], "high": limits[at][1]}
        row["lognormal"] = stats.norm.cdf(math.log(scale / fit.median) / fit.dispersion)
        row |= {"acceleration": scale * block.forcing.amplitude, "velocity": scale * velocity}
        row["pga_g"] = row["acceleration"] * unit / 9.80665
        row["pgv_m_per_s"] = row["velocity"] * unit / size.frequency_parameter
        relative = row["velocity"] * size.critical_angle / math.tan(size.critical_angle)
        rows.append(row | {"relative_velocity": relative, "reason": reason * (at == (1, 2, 3))})
    columns = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    dims = axis, "level", "scale"
    variables = {"probability": (dims, probability), "low": (dims, limits[..., 0]), "high": (dims, limits[..., 1])}
    cubes = {name: values.reshape(len(BLOCKS), SCALES.size, 3).swapaxes(1, 2) for name, values in columns.items()}
    variables |= {name: (dims, cubes[name]) for name in ("lognormal", "reason")}
    variables |= {
        "event_angle": (dims[:2], cubes["level"][..., 0]),
        "level_deg": (dims[:2], cubes["level_deg"][..., 0]),
    }
    variables["event"] = (dims[1:2], cubes["event"][0, :, 0])
    measures = "acceleration", "velocity", "pga_g", "pgv_m_per_s", "relative_velocity"
    variables |= {name: ((axis, "scale"), cubes[name][:, 0]) for name in measures}
    places = [str(block.forcing) for block in BLOCKS] if axis == "scene" else place
    return Made(result, columns, variables, {axis: places, "level": [math.inf, *LEVELS], "scale": SCALES})


def pooled():
    """A curve over 130 intensities for a motion drawn from a population."""
    intensity, rng = np.geomspace(0.1, 3.0, 130), np.random.default_rng(13)
    share = np.sort(rng.uniform(0.0, 1.0, 130))
    limits = np.stack([0.8 * share, 0.8 * share + 0.2], axis=-1)
    fit = LognormalFit(0.7, 0.4, (0.6, 0.8), (0.3, 0.6), misfit=0.1, p_value=0.4)
    result = IntensityCurve(
        "overturned", "PGV", intensity, share, limits, fit, np.array([[0.6, 0.3], [0.8, 0.5]]), 8, {"noise": 0.2},
        {"noise": 0.01}, 8, BLOCKS,
    )  # fmt: skip
    own = (
        stats.beta.ppf(0.025, 8.0 * share, 9.0 - 8.0 * share),
        stats.beta.ppf(0.975, 8.0 * share + 1.0, 8.0 - 8.0 * share),
    )
    columns = {"PGV_m_per_s": intensity, "probability": share, "low": own[0], "high": own[1]}
    columns["lognormal"] = stats.norm.cdf(np.log(intensity / 0.7) / 0.4)
    columns |= {"lognormal_low": limits[:, 0], "lognormal_high": limits[:, 1]}
    variables = {name: (("PGV_m_per_s",), values) for name, values in columns.items() if name != "PGV_m_per_s"}
    return Made(result, columns, variables, {"PGV_m_per_s": intensity})


def probability():
    """An answer after each of 150 cycles."""
    rng = np.random.default_rng(17)
    left, right = (np.sort(rng.uniform(0.0, 0.5, CYCLES + 1)) for _ in range(2))
    errors, times = rng.uniform(0.0, 0.01, (CYCLES + 1, 3)), MAIN.period * np.arange(CYCLES + 1)
    result = Probability(
        MAIN, times, left, right, errors, "paths", "exact", "Because.", 0.02, 0.0, np.array([3, 0]), 1000, 1, False, 1.0
    )  # fmt: skip
    names = "survival", "left", "right"
    columns = {"cycle": np.arange(CYCLES + 1), "time": times}
    columns |= dict(zip(names, (1.0 - left - right, left, right), strict=True))
    columns |= {f"{name}_error": errors[:, k] for k, name in enumerate(names)}
    variables = {name: (("time",), values) for name, values in columns.items() if name not in {"cycle", "time"}}
    return Made(result, columns, variables, {"cycle": columns["cycle"], "time": times})


def sweep(gridded=True):
    rng, count = np.random.default_rng(12), 132
    axes = {"a": tuple(np.arange(11.0)), "b": tuple(10.0 + np.arange(12.0) ** 2)} if gridded else {}
    survival, seconds, seeds = (
        rng.uniform(0.0, 1.0, (count, 3)),
        rng.uniform(0.0, 1.0, count),
        rng.integers(1, 99, count),
    )
    failed = count - 5
    rows = tuple(
        {
            "cell": k,
            "seed": int(seeds[k]),
            "wall_s": seconds[k],
            "values": {} if k == failed else {"survival": survival[k].tolist(), "peak": 2.0 * k, "trust": "ok"},
            "reason": "ValueError: refused" * (k == failed),
        }
        for k in range(count)
    )
    wrong = np.arange(count) == failed
    peaks, last = np.where(wrong, math.nan, 2.0 * np.arange(count)), np.where(wrong, math.nan, survival[:, -1])
    columns = {"cell": np.arange(count)}
    if gridded:
        columns |= {"a": np.repeat(axes["a"], 12), "b": np.tile(axes["b"], 11)}
    columns |= {"peak": peaks, "trust": np.where(wrong, "nan", "ok"), "wall_s": seconds}
    columns["reason"] = np.where(wrong, "ValueError: refused", "")
    shape, dims = ((11, 12), ("a", "b")) if gridded else ((count,), ("cell",))
    variables = {"survival": (dims, last.reshape(shape)), "peak": (dims, peaks.reshape(shape))}
    return Made(Sweep(rows, axes, 2.0), columns, variables, {name: np.array(values) for name, values in axes.items()})


def critical():
    rng, count = np.random.default_rng(13), 132
    peaks = rng.uniform(1.0, 9.0, count)
    scenes = tuple(Scene.from_block(0.5, 1.8, peak, 1.5 + 0.01 * k) for k, peak in enumerate(peaks))
    own, jumps = peaks / 9.80665, np.sort(rng.uniform(0.3, 1.0, (count, 3)), axis=1) * np.array([1.0, 1.5, 2.5])
    jumps[0, 2] = jumps[1] = math.nan
    jumps[2, :2] = 0.5, 0.502  # too narrow to count
    turned, tops = np.where(np.arange(count) % 3, rng.uniform(1.0, 9.0, count), math.nan), rng.uniform(0.0, 1.5, count)
    sides = np.where(np.isnan(turned), 0, 1 - 2 * (np.arange(count) % 2)).astype(np.int8)
    result = CriticalIntensities(
        scenes=scenes,
        measure="PGA",
        highest=3.0,
        own=own,
        jumps=jumps,
        peak=tops,
        overturn_time=turned,
        overturn_side=sides,
        options={"cycles": 4},
        wall_s=1.0,
    )
    first = jumps[:, 0].copy()
    first[1], first[2] = math.inf, jumps[2, 2]
    p = math.sqrt(3.0 * 9.80665 / (2.0 * math.hypot(0.5, 1.8)))
    texts = [
        "" if k == 1 else "{:.4g}-{:.4g}".format(*row) + ("" if k == 0 else f"; {row[2]:.4g}-")
        for k, row in enumerate(jumps)
    ]
    variables = {
        "pga_g": own,
        "pgv_m_per_s": peaks / (2.0 * math.pi * (1.5 + 0.01 * np.arange(count))),
        "own_intensity": own,
        "critical_intensity": first,
        "always_intensity": np.where(np.isfinite(jumps[:, 2]), jumps[:, 2], math.inf),
        "equivalent_intensity": np.where(np.isfinite(jumps[:, 2]), jumps[:, 0] * jumps[:, 2] / jumps[:, 1], math.inf),
        "critical_scale": first / own,
        "peak_rotation": tops,
        "overturn_time": turned,
        "overturn_s": turned / p,
        "overturn_side": np.array([{-1: "left", 0: "", 1: "right"}[side] for side in sides.tolist()]),
        "overturns_at": np.array(texts),
    }
    names = [str(scene.forcing) for scene in scenes]
    arrays = {name: (("motion",), values) for name, values in variables.items()}
    places = {"motion": names, "number": [1, 2, 3]}
    columns = {"motion": np.array(names)} | variables
    return Made(result, columns, arrays | {"jump": (("motion", "number"), jumps)}, places)


def risk():
    """A rate from 130 bins of intensity."""
    edges, contribution = np.geomspace(0.1, 3.0, 131), np.random.default_rng(19).dirichlet(np.ones(130))
    result = Risk(
        1e-4, (5e-5, 2e-4), edges, contribution, 0.01, 0.02, 0.005, pooled().result, Hazard.power_law(1e-3, 2.5)
    )
    columns = {"bin": np.arange(1, 131), "low": edges[:-1], "high": edges[1:], "contribution": contribution}
    variables = {name: (("bin",), values) for name, values in columns.items() if name != "bin"}
    return Made(result, columns, variables, {"bin": columns["bin"]})


def study():
    """A study of 132 motions without noise, at 130 intensities."""
    suite, curve = critical(), pooled()
    intensity = curve.places["PGV_m_per_s"]
    shares = np.random.default_rng(23).integers(0, 2, (len(suite.result.scenes), intensity.size)).astype(float)
    curves = Fragility(
        suite.result.scenes, "scene", np.arange(len(shares)), np.empty(0), intensity, shares[:, None],
        np.full_like(shares[:, None], math.nan), "exact", 1, True, {"cycles": 4}, "", {}, 1.0,
    )  # fmt: skip
    recorded = {"recorded": suite.result.scenes, "critical": suite.result}
    result = Study(curves, curve.result, risk().result, "rack", BLOCKS[0], **recorded)
    variables = {name: (("motion",), values) for name, values in suite.columns.items() if name != "motion"}
    variables |= {"probability_of_motion": (("motion", "PGV_m_per_s"), shares)} | curve.variables
    return Made(result, suite.columns, variables, {"motion": suite.places["motion"]} | curve.places)


def designs():
    """Two blocks under the motions of `study`, of which the second withstands 1.1 to 1.4 times as much."""
    made, times = study(), np.random.default_rng(29).uniform(1.1, 1.4, 132)
    suite = dataclasses.replace(made.result.critical, jumps=made.result.critical.jumps * times[:, None])
    result = Designs((made.result, dataclasses.replace(made.result, name="wide", critical=suite)))
    own = made.columns["equivalent_intensity"]
    variables = {
        "equivalent_rack": own,
        "equivalent_wide": own * times,
        "ratio_wide": np.where(np.isinf(own), np.nan, times),
    }
    columns = {"motion": made.columns["motion"]} | variables
    arrays = {name: (("motion",), values) for name, values in variables.items()}
    return Made(result, columns, arrays, {"motion": made.places["motion"]})
