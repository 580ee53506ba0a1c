"""How often 95 % limits from few motions contain the truth, and how often the test of lognormality rejects.

Suites of 5 to 30 motions are drawn from populations whose capacities are lognormal, with median .7, dispersion .4 from
motion to motion, .25 from block to block (three blocks for each motion) and .25 by the noise, of which 50 paths are
drawn at each of 10 intensities. Of each suite limits are computed as `fragility` and `risk` do.

    python benchmarks/few_motions.py [FILE]

About 6 processor minutes.
"""

import math
import sys

import numpy as np
from scipy import special, stats

from fpk_rocking.base.files import write_json
from fpk_rocking.studies.capacities import Capacities
from fpk_rocking.studies.lognormal import REJECTED, fit_lognormal

MEDIAN, RECORDS, BLOCKS, NOISE = 0.7, 0.4, 0.25, 0.25
EXPONENT, HIGHEST, PATHS = 2.5, 0.85, 50
GRID, POINTS = np.geomspace(0.15, 3.0, 10), np.array([0.35, 0.7, 1.4])
NAMES = ("median", "dispersion", "rate", *(f"P at {point:g}" for point in POINTS))
KINDS = {
    "critical intensities": {},
    "critical intensities, known up to .85": {"highest": HIGHEST},
    "outcomes at 10 intensities": {"grid": True},
    "noise": {"grid": True, "noise": NOISE},
    "three blocks a motion": {"grid": True, "blocks": 3},
    "three blocks a motion, noise": {"grid": True, "blocks": 3, "noise": NOISE},
}


def outcomes(rng, motions, law=stats.norm, *, blocks=1, noise=0.0, grid=False, highest=math.inf):
    """Capacities of a suite, and what its test of lognormality takes: mean shares on the grid, and paths."""
    motion = np.repeat(np.arange(motions), blocks)
    logs = math.log(MEDIAN) + RECORDS * law.rvs(size=motions, random_state=rng)[motion]
    logs = logs + BLOCKS * (blocks > 1) * rng.standard_normal(motion.size)
    if not grid:
        return Capacities.exact(np.where(logs < math.log(highest), np.exp(logs), math.inf), highest), None, 0
    away = np.log(GRID) - logs[:, None]
    shares = rng.binomial(PATHS, special.ndtr(away / noise)) / PATHS if noise else (away > 0.0).astype(float)
    return Capacities.of(GRID, shares, PATHS * bool(noise), motion), shares.mean(axis=0), PATHS * bool(noise)


def coverage(motions, suites, seed, samples, **kind):
    """Share of suites whose limits contain the truth, by name, and of those that give limits."""
    total = math.sqrt(RECORDS**2 + kind.get("noise", 0.0) ** 2 + (BLOCKS if "blocks" in kind else 0.0) ** 2)
    rate = -EXPONENT * math.log(MEDIAN) + 0.5 * (EXPONENT * total) ** 2
    truth = [math.log(MEDIAN), total, rate, *special.ndtr(np.log(POINTS / MEDIAN) / total)]
    inside, answered = np.zeros(len(truth)), 0
    for suite in range(suites):
        rng = np.random.default_rng([seed, motions, suite])
        capacities, means, _ = outcomes(rng, motions, **kind)
        # As `IntensityCurve` does: such suites determine no lognormal curve.
        if capacities.complete.size < 2 or (means is not None and fit_lognormal(GRID, means).reason):
            continue
        population = capacities.draws(samples, rng)[0]
        middle, spread = population[:, 0], np.linalg.norm(population[:, 1:], axis=1)
        points = special.ndtr((np.log(POINTS) - middle[:, None]) / spread[:, None])
        drawn = np.column_stack([middle, spread, -EXPONENT * middle + 0.5 * (EXPONENT * spread) ** 2, points])
        low, high = np.quantile(drawn, [0.025, 0.975], axis=0)
        inside += (low <= truth) & (truth <= high)
        answered += 1
    return {"suites": answered} | dict(zip(NAMES, (inside / answered).round(3).tolist(), strict=True))


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
    count = answered = 0
    for suite in range(suites):
        rng = np.random.default_rng([seed, motions, suite])
        capacities, means, paths = outcomes(rng, motions, law or _Groups, **kind)
        if capacities.complete.size < 2:
            continue
        p_value = capacities.p_value(np.log(GRID), means, paths, rng)
        answered += math.isfinite(p_value)
        count += p_value < REJECTED
    return round(count / answered, 3)


def run(suites=300, sizes=(5, 8, 14, 30), seed=1, samples=399, tests=500, kinds=KINDS):
    """Compute all tables: coverage by kind and number of motions, false alarms and power of the test."""
    exact = KINDS["critical intensities"]
    return {
        "suites": suites,
        "coverage": {
            name: {str(size): coverage(size, suites, seed, samples, **kind) for size in sizes}
            for name, kind in kinds.items()
        },
        "rejected at 5 %, critical intensities": {
            name: {str(size): rejected(size, tests, seed, law, **exact) for size in sizes} for name, law in LAWS.items()
        },
        "rejected at 5 %, lognormal": {
            name: {str(size): rejected(size, suites, seed, stats.norm, **kind) for size in sizes[::2]}
            for name, kind in kinds.items()
            if kind.get("grid")
        },
    }


def page(values):
    """Title and text of the results, in Markdown."""
    coverage = values["coverage"]
    shares = np.array([[row[name] for name in NAMES] for kind in coverage.values() for row in kind.values()])
    answered = [row["suites"] for kind in coverage.values() for row in kind.values()]
    lacking = values["suites"] - min(answered)
    tests = values["rejected at 5 %, critical intensities"]
    binned = values["rejected at 5 %, lognormal"]
    sizes = list(next(iter(coverage.values())))
    low, high = min(tests["lognormal"].values()), max(tests["lognormal"].values())
    result = (
        f"**Result.** 95 % limits contain the truth in {shares.mean():.3f} of the suites on average; the single shares "
        f"below are {shares.min():.3f} to {shares.max():.3f} (standard error "
        f"{math.sqrt(0.0475 / values['suites']):.3f}). The test of lognormality rejects {low:.3f} to {high:.3f} of "
        "lognormal suites at 5 %."
    )
    method = (
        "Suites are drawn from populations of motions whose capacities are lognormal: median 0.7, dispersion 0.4 from "
        "motion to motion, 0.25 from block to block and 0.25 by the noise. The rate is that under a hazard im^-2.5. "
        f"Suites that determine no curve, up to {lacking} of {values['suites']}, are left out. Suites of one number "
        "share their random numbers, so that the shares of different outcomes deviate together."
    )
    text = [
        result,
        "",
        method,
        "",
        f"| outcomes | motions | {' | '.join(NAMES)} |",
        "|---|---|" + "---|" * len(NAMES),
    ]
    for name, rows in coverage.items():
        text += [
            f"| {name} | {size} | {' | '.join(f'{row[column]:.3f}' for column in NAMES)} |"
            for size, row in rows.items()
        ]
    text += ["", "Share of suites that the test rejects at 5 %, by the law of the capacities:", ""]
    text += [f"| law | {' | '.join(f'{size} motions' for size in sizes)} |", "|---|" + "---|" * len(sizes)]
    text += [f"| {law} | {' | '.join(f'{row[size]:.3f}' for size in sizes)} |" for law, row in tests.items()]
    text += [
        f"| lognormal, {kind} | {' | '.join(f'{row[size]:.3f}' if size in row else '' for size in sizes)} |"
        for kind, row in binned.items()
    ]
    return {"title": "Limits and tests from few motions", "text": text}


if __name__ == "__main__":
    tables = run()
    write_json(sys.argv[1] if len(sys.argv) > 1 else "docs/benchmarks/few_motions.json", page(tables) | tables)
