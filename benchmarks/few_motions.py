"""How often 95 % limits from few motions contain the truth, and how often the test of lognormality rejects.

Suites of 5 to 30 motions are drawn from populations whose capacities are lognormal, with median .7, dispersion .4 from
motion to motion, .25 from block to block (three blocks for each motion) and .25 by the noise, of which 50 paths are
drawn at each of 10 intensities, and of those that `study` adds until they move the rate by less than 1 %. The limits
are those that `IntensityCurve` and `annual_frequency` state of a suite.

    python benchmarks/few_motions.py [FILE]

Where a share is below .93, it is that of a thousand further suites. About twenty processor minutes.
"""

import dataclasses
import math
import sys

import numpy as np
from scipy import special, stats

from fpk_rocking import Scene
from fpk_rocking.results.storage import plain, write_json
from fpk_rocking.risk import Draws, Fragility, Hazard, IntensityCurve, annual_frequency
from fpk_rocking.risk.lognormal import REJECTED, fit_lognormal
from fpk_rocking.risk.search import MotionOutcomes, overturns
from fpk_rocking.risk.study import with_added_intensities

MEDIAN, RECORDS, BLOCKS, NOISE = 0.7, 0.4, 0.25, 0.25
EXPONENT, HIGHEST, PATHS = 2.5, 0.85, 50
HAZARD = Hazard.power_law(1.0, EXPONENT)
GRID, POINTS = 0.175 * 2.0 ** (0.5 * np.arange(10)), np.array([0.35, 0.7, 1.4])
LEAST, AGAIN = 0.93, 1000
NAMES = ("median", "dispersion", "rate", *(f"P at {point:g}" for point in POINTS))
KINDS = {
    "critical intensities": {},
    "critical intensities, known up to .85": {"highest": HIGHEST},
    "noise": {"noise": NOISE},
    "three blocks a motion": {"blocks": 3},
    "three blocks a motion, noise": {"blocks": 3, "noise": NOISE},
}
STILL = Scene.from_block(0.5, 1.8, "0.3 g", "1.5 Hz")
NOISY = Scene.from_block(0.5, 1.8, "0.3 g", "1.5 Hz", noise_rms_acceleration=0.3, noise_band_hz=(0, 5))


def suite(rng, motions, law=stats.norm, *, blocks=1, noise=0.0, highest=math.inf):
    """Return the `Fragility` of a suite, and of which motion each of its rows is, as `Draws` where blocks are drawn."""
    motion = np.repeat(np.arange(motions), blocks)
    logs = math.log(MEDIAN) + RECORDS * law.rvs(size=motions, random_state=rng)[motion]
    logs = logs + BLOCKS * (blocks > 1) * rng.standard_normal(motion.size)
    scenes = (NOISY if noise else STILL,) * motion.size
    draws = Draws(scenes, {}, tuple(motion.tolist())) if blocks > 1 else None

    def found(scale, shares, outcomes=None):
        unknown, trials = np.full_like(shares[:, None], math.nan), PATHS if noise else 1
        return Fragility(
            scenes, "scene", np.arange(motion.size), np.empty(0), scale, shares[:, None], unknown,
            "exact", trials, True, {}, "", {}, 0.0, outcomes,
        )  # fmt: skip

    def sample(scale, _):
        return found(scale, rng.binomial(PATHS, special.ndtr((np.log(scale) - logs[:, None]) / noise)) / PATHS)

    def risk_of(fragility):
        # What limits are made of takes most of the time, and the rate by points does not depend on it.
        mean = fragility.probability[:, 0].mean(axis=0)
        fit, rest = fit_lognormal(fragility.scale, mean), (np.full((mean.size, 2), math.nan), np.empty((0, 2)))
        curve = IntensityCurve("overturned", "scale", fragility.scale, mean, rest[0], fit, rest[1], 1, by_points=True)
        return annual_frequency(curve, HAZARD)

    if noise:
        return with_added_intensities(sample, risk_of, GRID)[0], draws
    scale = GRID[highest >= GRID]
    jumps = np.where(np.exp(logs) < scale[-1], np.exp(logs), np.nan)[:, None]
    outcomes = MotionOutcomes(jumps[:, None], *np.zeros((3, motion.size)))
    return found(scale, overturns(jumps, scale).astype(float), outcomes), draws


def curve_of(fragility, draws, samples, seed=1):
    """Return the `IntensityCurve` of a suite as `study` has it: with noise, rates are by its points."""
    curve = IntensityCurve.of(fragility, "scale", draws=draws, samples=samples, seed=seed)
    return dataclasses.replace(curve, by_points=fragility.motions is None)


def coverage(motions, suites, seed, samples, first=0, **kind):
    """Share of suites whose limits contain the truth, by name; nan for what no suite has limits of.

    "rejected" is the share of which the test of lognormality rejects the fit.
    `first`: number of the first suite, from which its random numbers follow.
    """
    total = math.sqrt(RECORDS**2 + kind.get("noise", 0.0) ** 2 + (BLOCKS if "blocks" in kind else 0.0) ** 2)
    rate = MEDIAN**-EXPONENT * math.exp(0.5 * (EXPONENT * total) ** 2)
    truth = np.array([MEDIAN, total, rate, *special.ndtr(np.log(POINTS / MEDIAN) / total)])
    limits, p_values = np.full((suites, truth.size, 2), math.nan), np.full(suites, math.nan)
    for row in range(suites):
        number = first + row
        rng = np.random.default_rng([seed, motions, number])
        fragility, draws = suite(rng, motions, **kind)
        curve = curve_of(fragility, draws, samples, number)
        p_values[row] = curve.fit.p_value
        if curve.fit.reason:
            continue
        risk = annual_frequency(curve, HAZARD)
        limits[row, :3] = curve.fit.median_interval, curve.fit.dispersion_interval, risk.interval
        for place, point in enumerate(POINTS, 3):
            at = np.flatnonzero(np.isclose(curve.intensity, point))
            limits[row, place] = curve.interval[at[0]] if at.size else math.nan
    low, high = np.moveaxis(limits, -1, 0)
    stated = np.isfinite(low).sum(axis=0)
    inside = ((low <= truth) & (truth <= high)).sum(axis=0)
    shares = np.where(stated, inside / np.maximum(stated, 1), math.nan).round(3).tolist()
    counts = {"drawn": suites, "suites": int(stated[0]), "rejected": _share_rejected(p_values)}
    return counts | dict(zip(NAMES, shares, strict=True))


def repeated(motions, suites, seed, samples, again, **kind):
    """Coverage, of as many further suites as `again` says where a share of the first ones is below `LEAST`."""
    shares = coverage(motions, suites, seed, samples, **kind)
    lowest = min(shares[name] for name in NAMES if math.isfinite(shares[name]))
    if not again or lowest >= LEAST:
        return shares
    return coverage(motions, again, seed, samples, suites, **kind) | {"lowest share at first": lowest}


LAWS = {
    "lognormal": stats.norm,
    "uniform logarithm": stats.uniform(-math.sqrt(3.0), 2.0 * math.sqrt(3.0)),
    "exponential logarithm": stats.expon(-1.0),
    "two groups, 3 deviations apart": None,
}


class _Groups:
    """Normal values of two groups with means ±1.5 deviations."""

    @staticmethod
    def rvs(size, random_state):
        """Values (size,) drawn from a generator, as of a law of scipy."""
        return 1.5 * random_state.choice([-1.0, 1.0], size) + random_state.standard_normal(size)


def rejected(motions, suites, seed, law, **kind):
    """Share of suites that the test of lognormality rejects."""
    values = []
    for number in range(suites):
        fragility, draws = suite(np.random.default_rng([seed, motions, number]), motions, law or _Groups, **kind)
        values.append(curve_of(fragility, draws, 1, number).fit.p_value)
    return _share_rejected(np.array(values))


def _share_rejected(p_values):
    """Share of the suites that have a p-value (n,), nan for the others, of which the test rejects the fit."""
    return round(float(np.mean(p_values[np.isfinite(p_values)] < REJECTED)), 3)


def run(suites=300, sizes=(5, 8, 14, 30), seed=1, samples=399, tests=1000, kinds=KINDS, again=AGAIN):
    """Compute all tables: coverage by kind and number of motions, false alarms and power of the test."""
    shares = {
        name: {str(size): repeated(size, suites, seed, samples, again, **kind) for size in sizes}
        for name, kind in kinds.items()
    }
    return {
        "suites": suites,
        "tests": tests,
        "coverage": shares,
        "rejected at 5 %, critical intensities": {
            name: {str(size): rejected(size, tests, seed, law) for size in sizes} for name, law in LAWS.items()
        },
        "rejected at 5 %, lognormal": {
            name: {size: row["rejected"] for size, row in shares[name].items()}
            for name, kind in kinds.items()
            if kind.get("noise") or kind.get("blocks")
        },
    }


def page(values):
    """Title and text of the results, in Markdown."""
    coverage = values["coverage"]
    shares = np.array([[row[name] for name in NAMES] for kind in coverage.values() for row in kind.values()])
    shares = shares[np.isfinite(shares)]
    rows = [row for kind in coverage.values() for row in kind.values()]
    lacking = max(1.0 - row["suites"] / row["drawn"] for row in rows)
    anew = [row["lowest share at first"] for row in rows if "lowest share at first" in row]
    tests = values["rejected at 5 %, critical intensities"]
    binned = values["rejected at 5 %, lognormal"]
    sizes = list(next(iter(coverage.values())))
    low, high = min(tests["lognormal"].values()), max(tests["lognormal"].values())
    result = (
        f"**Result.** 95 % limits contain the truth in {shares.mean():.3f} of the suites on average; the single shares "
        f"below are {shares.min():.3f} to {shares.max():.3f} (standard error of {values['suites']}: "
        f"{math.sqrt(0.0475 / values['suites']):.3f}). The test of lognormality rejects {low:.3f} to {high:.3f} of "
        "lognormal suites at 5 %."
    )
    method = (
        "Suites are drawn from populations of motions whose capacities are lognormal: median 0.7, dispersion 0.4 from "
        "motion to motion, 0.25 from block to block and 0.25 by the noise. The rate is that under a hazard im^-2.5. "
        "With noise a suite has ten intensities, and those that `study` adds where the rate comes from. "
        f"Suites that determine no curve, up to {100.0 * lacking:.0f} %, are left out. Suites of one number share "
        "their random numbers, so that the shares of different outcomes deviate together."
    )
    if anew:
        method += (
            f" {len(anew)} of {len(rows)} rows had a share below {LEAST} ({min(anew):.3f} to {max(anew):.3f}); theirs "
            f"are those of {AGAIN} further suites."
        )
    text = [
        result,
        "",
        method,
        "",
        f"| outcomes | motions | suites | {' | '.join(NAMES)} |",
        "|---|---|---|" + "---|" * len(NAMES),
    ]
    for name, sizes_of in coverage.items():
        for size, row in sizes_of.items():
            cells = (f"{row[column]:.3f}".replace("nan", "") for column in NAMES)
            text.append(f"| {name} | {size} | {row['suites']} | {' | '.join(cells)} |")
    text += ["", "Share of suites that the test rejects at 5 %, by the law of the capacities:", ""]
    text += [f"| law | {' | '.join(f'{size} motions' for size in sizes)} |", "|---|" + "---|" * len(sizes)]
    text += [f"| {law} | {' | '.join(f'{row[size]:.3f}' for size in sizes)} |" for law, row in tests.items()]
    text += [
        f"| lognormal, {kind} | {' | '.join(f'{row[size]:.3f}' for size in sizes)} |" for kind, row in binned.items()
    ]
    return {"title": "Limits and tests from few motions", "text": text}


if __name__ == "__main__":
    tables = run()
    write_json(sys.argv[1] if len(sys.argv) > 1 else "docs/benchmarks/few_motions.json", plain(page(tables) | tables))
