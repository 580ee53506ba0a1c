"""How often limits hold if motions are not independent: two blocks under the same motions, two components an event.

Two blocks: logarithms of the capacities of each motion are binormal; coverage of the 95 % limits of the ratios of
medians and of rates by `fpk_rocking.risk.capacities.paired_draws`, for pairs of dispersions and correlations. Two
components: the events are drawn with dispersion .4, their components around them with .3, and every third event has one
component only; coverage of the limits of median, dispersion and rate by `Capacities.draws` where an event counts as one
motion, and where each component counts as one.

    python benchmarks/paired_motions.py [FILE]

About a processor minute.
"""

import math
import sys

import numpy as np

from fpk_rocking.results.storage import plain, write_json
from fpk_rocking.risk import Hazard
from fpk_rocking.risk.capacities import Capacities, paired_draws
from fpk_rocking.risk.hazard import lognormal_rates

MEDIAN, EXPONENT, EVENTS, COMPONENTS, DRAWS = 0.7, 2.5, 0.4, 0.3, 5_000
PAIRS = {
    "dispersions .4 and .4, correlation .9, medians 1 and 1.2": (0.4, 0.4, 0.9, 1.2),
    "dispersions .5 and .4, correlation .95, medians 1 and 1.3": (0.5, 0.4, 0.95, 1.3),
    "dispersions .35 and .5, correlation .8, medians 1 and 1.3": (0.35, 0.5, 0.8, 1.3),
    "dispersions .4 and .4, correlation .5, medians 1 and 1": (0.4, 0.4, 0.5, 1.0),
}
HAZARD = Hazard.power_law(1.0, EXPONENT)


def contain(draws, truth):
    """Return whether the 95 % limits of draws (k, n) contain each truth (k,), a list of bool."""
    low, high = np.quantile(draws, [0.025, 0.975], axis=-1)
    return ((low <= truth) & (truth <= high)).tolist()


def ratios_hold(motions, suites, seed, first, second, correlation, median):
    """Share of suites in which the limits of the ratios of medians and of rates contain the truth."""
    covariance = [[first**2, correlation * first * second], [correlation * first * second, second**2]]
    truth = median, median**-EXPONENT * math.exp(0.5 * EXPONENT**2 * (second**2 - first**2))
    inside = []
    for number in range(suites):
        rng = np.random.default_rng([seed, motions, number])
        logs = math.log(MEDIAN) + rng.multivariate_normal([0.0, math.log(median)], covariance, motions)
        drawn = paired_draws(*map(Capacities.exact, np.exp(logs.T)), DRAWS, rng)
        rates = [lognormal_rates(drawn[:, place], HAZARD, -40.0) for place in (0, 1)]
        inside.append(contain([drawn[:, 1, 0] / drawn[:, 0, 0], rates[1] / rates[0]], np.array(truth)))
    return dict(zip(("median", "rate"), np.mean(inside, axis=0).round(3).tolist(), strict=True))


def events_hold(events, suites, seed, *, grouped):
    """Share of suites in which the limits of median, dispersion and rate contain the truth."""
    total, inside = math.hypot(EVENTS, COMPONENTS), []
    truth = MEDIAN, total, MEDIAN**-EXPONENT * math.exp(0.5 * (EXPONENT * total) ** 2)
    for number in range(suites):
        rng = np.random.default_rng([seed, events, number])
        labels = np.delete(np.repeat(np.arange(events), 2), np.arange(0, 2 * events, 6))
        own = math.log(MEDIAN) + EVENTS * rng.standard_normal(events)
        logs = own[labels] + COMPONENTS * rng.standard_normal(labels.size)
        motion = labels if grouped else np.arange(labels.size)
        population, _ = Capacities.exact(np.exp(logs), motion=motion).draws(DRAWS, rng)
        lognormal = np.stack([np.exp(population[:, 0]), np.linalg.norm(population[:, 1:], axis=1)], axis=-1)
        inside.append(contain([*lognormal.T, lognormal_rates(lognormal, HAZARD, -40.0)], np.array(truth)))
    return dict(zip(("median", "dispersion", "rate"), np.mean(inside, axis=0).round(3).tolist(), strict=True))


def run(suites=1000, sizes=(10, 20, 40), seed=2):
    """Compute both tables."""
    return {
        "suites": suites,
        "two blocks": {
            name: {str(size): ratios_hold(size, suites, seed, *pair) for size in sizes} for name, pair in PAIRS.items()
        },
        "two components": {
            name: {str(size): events_hold(size, suites, seed, grouped=grouped) for size in sizes}
            for name, grouped in (("an event is one motion", True), ("each component is one motion", False))
        },
    }


def page(values):
    """Title and text of the results, in Markdown."""
    text, shares = [], {}
    for kind, names in (("two blocks", ("median", "rate")), ("two components", ("median", "dispersion", "rate"))):
        text += ["", f"| {kind} | motions or events | {' | '.join(names)} |", "|---|---|" + "---|" * len(names)]
        for name, sizes in values[kind].items():
            for size, row in sizes.items():
                text.append(f"| {name} | {size} | {' | '.join(f'{row[one]:.3f}' for one in names)} |")
                shares.setdefault(kind if kind == "two blocks" else name, []).extend(row[one] for one in names)
    spans = [f"{name}: {min(rows):.3f} to {max(rows):.3f}" for name, rows in shares.items()]
    error = math.sqrt(0.0475 / values["suites"])
    result = (
        f"**Result.** Shares of {values['suites']} suites whose 95 % limits contain the truth (standard error of .95: "
    )
    result += f"{error:.3f}). {'; '.join(spans)}."
    return {"title": "Limits from motions that are not independent", "text": [result, *text]}


if __name__ == "__main__":
    tables = run()
    write_json(
        sys.argv[1] if len(sys.argv) > 1 else "docs/benchmarks/paired_motions.json", plain(page(tables) | tables)
    )
