"""How often 95 % limits hold on an upper floor, where motions overturn a block in many intervals of intensity.

Two cabinets, of 0.6 m and 0.75 m by 2 m, stand on a floor of a building of one mode. The population is 160 synthetic
ground motions; suites are drawn from it with replacement, so that its rates, shares and ratios are the truth. The
limits are those that `annual_frequency`, `IntensityCurve.point_limits` and `designs.ratio_of` state of a suite.

    python benchmarks/floor_limits.py [FILE]

Fifteen processor minutes, nearly all of them for the critical intensities of the population.
"""

import math
import sys

import numpy as np

from fpk_rocking import Scene
from fpk_rocking.results.storage import plain, write_json
from fpk_rocking.risk import (
    Building,
    Fragility,
    Hazard,
    IntensityCurve,
    annual_frequency,
    critical_intensities,
    synthetic_records,
)
from fpk_rocking.risk.designs import ratio_of
from fpk_rocking.risk.search import MotionOutcomes, equivalent_scale, overturns, signs_of

WIDTHS, POPULATION, FLOOR = (0.6, 0.75), 160, Building(0.6, 0.05, 1.1)
HAZARDS = {
    "of seven points": Hazard([0.02, 0.05, 0.1, 0.2, 0.4, 0.8, 1.6], [9e-2, 2.5e-2, 8e-3, 2.1e-3, 4e-4, 4e-5, 2e-6]),
    "im^-2.5": Hazard.power_law(1e-3, 2.5),
}
STILL = Scene.from_block(0.6, 2.0, "0.3 g", "1.5 Hz")


def population(count=POPULATION, seed=56):
    """PGA of the ground, g, at which outcomes change under each motion: an array (count, k) for each of the blocks."""
    ground = synthetic_records(count, duration=6.0, interval=0.02, seed=seed, low_frequency_hz=0.4)
    scenes = [Scene.from_block(width, 2.0, record=ground[0]) for width in WIDTHS]
    return [critical_intensities(scene, ground, building=FLOOR, measure="PGA").jumps for scene in scenes]


def rates(jumps, hazard):
    """Annual rate (n,) under each motion, by its jumps (n, k)."""
    return np.nansum(signs_of(jumps) * hazard(jumps), axis=1)


def suite(jumps, scale):
    """Return the `IntensityCurve` of a suite with some jumps (n, k)."""
    shares, count = overturns(jumps, scale).astype(float), len(jumps)
    fragility = Fragility(
        (STILL,) * count, "scene", np.arange(count), np.empty(0), scale, shares[:, None],
        np.full_like(shares[:, None], math.nan), "exact", 1, True, {}, "", {}, 0.0,
        MotionOutcomes(jumps[:, None], *np.zeros((3, count))),
    )  # fmt: skip
    return IntensityCurve.of(fragility, "scale", samples=999)


def held(pairs, hazard, truth, shares, median):
    """Shares of suites, pairs of curves, whose limits contain rates (2,), probabilities and the ratios of both."""
    found = {"rate": [], "P": [], "ratio of medians": [], "ratio of rates": []}
    rejected = []
    for curves in pairs:
        risks = [annual_frequency(curve, hazard) for curve in curves]
        for curve, risk, true, share in zip(curves, risks, truth, shares, strict=True):
            found["rate"].append((*risk.interval, true))
            found["P"] += [(*pair, of) for pair, of in zip(curve.point_limits, share, strict=True)]
            rejected.append((bool(curve.fit.rejected), risk.capacities is None))
        both = ratio_of(curves[0], risks[0], curves[1], risks[1])
        found["ratio of medians"].append((both.median_low, both.median_high, median))
        found["ratio of rates"].append((both.rate_low, both.rate_high, truth[1] / truth[0]))
    row = {}
    for name, limits in found.items():
        low, high, true = np.array(limits).T
        stated = np.isfinite(low)
        inside = (low <= true) & (true <= high)
        row |= {name: round(float(inside[stated].mean()), 3), f"{name}, stated": int(stated.sum())}
    fits, thresholds = np.mean(rejected, axis=0).round(3).tolist()
    return row | {"fits rejected": fits, "thresholds rejected": thresholds}


def run(jumps=None, suites=300, sizes=(8, 15, 30), seed=1):
    """Shares of suites whose limits contain the truth, by hazard and number of motions."""
    jumps = population() if jumps is None else jumps
    places = [np.quantile(equivalent_scale(one), [0.2, 0.5, 0.8]) for one in jumps]
    shares = [overturns(one, scale).mean(axis=0) for one, scale in zip(jumps, places, strict=True)]
    median = np.exp(np.diff([np.log(equivalent_scale(one)).mean() for one in jumps])[0])
    table = {}
    for size in sizes:
        chosen = [
            np.random.default_rng([seed, size, number]).integers(len(jumps[0]), size=size) for number in range(suites)
        ]
        pairs = [[suite(one[rows], scale) for one, scale in zip(jumps, places, strict=True)] for rows in chosen]
        for name, hazard in HAZARDS.items():
            truth = [rates(one, hazard).mean() for one in jumps]
            table.setdefault(name, {})[str(size)] = held(pairs, hazard, truth, shares, median)
    intervals = [float(np.isfinite(one[:, 2:]).any(axis=1).mean()) for one in jumps]
    return {"suites": suites, "several intervals": intervals, "coverage": table}


def page(values):
    """Title and text of the results, in Markdown."""
    names = "rate", "P", "ratio of medians", "ratio of rates", "fits rejected", "thresholds rejected"
    rows = [(hazard, size, row) for hazard, sizes in values["coverage"].items() for size, row in sizes.items()]
    shares = {name: [row[name] for _, _, row in rows] for name in names[:4]}
    spans = [f"{name} {min(of):.3f} to {max(of):.3f}" for name, of in shares.items()]
    about = (
        "Cabinets of 0.6 m and 0.75 m by 2 m on a floor of a building of one mode (0.6 s, 5 %, Γφ = 1.1); suites drawn "
        f"with replacement from {POPULATION} synthetic motions, of which {min(values['several intervals']):.2f} or "
        "more overturn a cabinet in several intervals of intensity. Rates and probabilities are those of both "
        "cabinets, P at three intensities each; a ratio counts where limits are stated."
    )
    text = [
        f"**Result.** Shares of {values['suites']} suites whose 95 % limits contain the truth: {'; '.join(spans)}.",
        "",
        about,
        "",
        f"| hazard | motions | {' | '.join(names)} | ratios of rates with limits |",
        "|---|---|" + "---|" * (len(names) + 1),
    ]
    for hazard, size, row in rows:
        cells = (f"{row[name]:.3f}" for name in names)
        text.append(f"| {hazard} | {size} | {' | '.join(cells)} | {row['ratio of rates, stated']} |")
    return {"title": "Limits on an upper floor", "text": text}


if __name__ == "__main__":
    tables = run()
    write_json(sys.argv[1] if len(sys.argv) > 1 else "docs/benchmarks/floor_limits.json", plain(page(tables) | tables))
