"""The noise band of Lin and Yim (1996), inferred.

The paper gives the variance of its noise and the number of its harmonics, not the band of their frequencies. Five of
its figures say something that depends on it; each is held against many bands. For a band [a, b] each is put as a
probability, its likelihood: how probable is what the paper saw, if that was its band?

* **Fig. 3** (e = 0.5, σ² = 0.286): noise lowers the critical amplitude. It has to leave one, so σ_M < (1-e²)/2: yes
  or no.
* **Fig. 5(b)** (A = 4.2, σ² = 0.05²): a block overturns after 125 cycles. Met where 125 lies within the central 95 % of
  the law of the first passage; likelihood: that a block overturns after 113 to 137 cycles (125 and a tenth of it).
* **Fig. 6** (σ² = 0.04): few are left after 60 cycles. Likelihood: that at most 10 of 1,000 are.
* **Fig. 7** (σ² = 0.04): practically none is left after 200 cycles. Likelihood: that at most 2 of 1,000 are.
* **Fig. 9** (1,200 realizations, 500 cycles), the mean Poincaré map restarted from the mean after each cycle,
  overturned realizations lying at the cut-off. (a) The fractal attractor is kept at σ = 0.05 and not at 0.06: kept
  means that the correlation dimension of the mean points between lengths of 0.05 and 0.4 is at least 1. (b) The mean
  overturns at σ = 0.13 and 0.16 but not at 0.05, 0.06 and 0.12. Both are counted over seeds; the paper has one.

A hint is met where its likelihood is at least 5 %. Their product over bands [0, b] gives an interval of b, where it is
within e^-1.92 of its largest value. Bands that begin above 0 are tried too, and Fig. 9 with overturned realizations
left out of the mean. That few or practically none are left is put into numbers by us, as is the dimension of 1.

Source: H. Lin and S. C. S. Yim, "Nonlinear rocking motions. I: Chaos under noisy periodic excitations", J. Eng. Mech.
122(8), 719-727, 1996.

Run time: about a quarter of an hour on 2 cores.

    python cases/band_inferred.py --out results/band

Files: ``band.png``, ``band.json``.
"""

import math

import numpy as np
from command import command
from fig08_mean_poincare import LENGTHS, SETTLED
from scipy import stats

from fpk_rocking import BandNoise, load_scene, melnikov
from fpk_rocking.output import tables
from fpk_rocking.output.tables import reporting
from fpk_rocking.results import pictures, storage
from montecarlo import correlation_dimension, restarted_poincare_map, simulate

BANDS = (5.0, 6.0, 7.0, 8.0, 9.0, 9.5, 10.0, 10.5, 11.0, 12.0, 13.0, 14.0, 16.0, 20.0)
RAISED = (
    *((0.25, b) for b in (6.0, 7.0, 8.0, 10.0)),
    *((0.5, b) for b in (4.0, 5.0, 6.0, 8.0)),
    *((1.0, b) for b in (3.0, 4.0, 6.0, 8.0)),
    *((2.0, b) for b in (3.0, 4.0, 6.0, 8.0)),
)
LEFT_OUT = (6.0, 7.0, 8.0, 10.0)
LATE, NEAR = 125, 12
FEW, NONE, SAMPLE = 10, 2, 1000
LIKELY = 0.05
WITHIN = 1.92
HINTS = ("Fig. 3", "Fig. 5(b)", "Fig. 6", "Fig. 7", "Fig. 9 (a)", "Fig. 9 (b)")


def run(
    out, bands=BANDS, raised=RAISED, left_out=LEFT_OUT, realizations=20_000, seeds=20, few_seeds=8, map_size=1200,
    map_cycles=500,
) -> dict:  # fmt: skip
    """Compute, draw and write everything.

    Parameters
    ----------
    out : pathlib.Path
        Folder for the files; created if missing.
    bands : sequence of float
        b of the bands [0, b], ascending.
    raised : sequence of (float, float)
        Bands that begin above 0.
    left_out : sequence of float
        b of the bands for which mean maps leave overturned realizations out.
    realizations : int
        Of each ensemble; they run for 200 cycles.
    seeds, few_seeds : int
        Of the mean maps that decide about overturning under bands [0, b], and of all others.
    map_size, map_cycles : int
        Realizations and cycles of a mean map; the paper has 1,200 and 500.

    Returns
    -------
    dict
        What ``band.json`` holds: one row a band, with the likelihood of each hint.
    """
    maps = {"realizations": map_size, "cycles": map_cycles}
    rows, variants = [], []
    todo = [((0.0, b), seeds) for b in bands] + [(band, few_seeds) for band in raised]
    with reporting("bands") as progress:
        for done, (band, count) in enumerate(todo):
            rows.append(_row(band, realizations, count, min(few_seeds, count), maps))
            progress(done + 1, len(todo) + len(left_out))
        for done, b in enumerate(left_out):
            variants.append(_fates((0.0, b), few_seeds, few_seeds, maps, overturned="left out") | {"band": [0.0, b]})
            progress(len(todo) + done + 1, len(todo) + len(left_out))
    from_zero = rows[: len(bands)]
    values = {
        "realizations": realizations,
        "map": maps | {"seeds": seeds, "seeds_of_others": few_seeds, "lengths": list(LENGTHS)},
        "rows": rows,
        "left_out": variants,
        "joint": _joint(from_zero, seeds, few_seeds),
    }
    draw(out / "band.png", values)
    storage.write_json(out / "band.json", values)
    return values


def _row(band, realizations, seeds, few_seeds, maps):
    """Return all hints for one band, as plain values."""
    main, late = (load_scene(name).varied(noise={"band": band}) for name in ("main", "fig05"))
    ensembles = [simulate(scene, cycles=200, realizations=realizations) for scene in (main, late)]
    survival = ensembles[0].survival
    cycles = np.where(ensembles[1].overturn_side != 0, ensembles[1].overturn_time / late.period, np.inf)
    passed = float(np.mean(cycles <= LATE))
    fates = _fates(band, seeds, few_seeds, maps)
    deviation = math.sqrt(melnikov.noise_variance(BandNoise(0.286, band, 100)))
    likelihood = {
        "Fig. 3": float(deviation < melnikov.impact_loss(0.5)),
        "Fig. 5(b)": float(np.mean(np.abs(cycles - LATE) <= NEAR)),
        "Fig. 6": float(stats.binom.cdf(FEW, SAMPLE, survival[60])),
        "Fig. 7": float(stats.binom.cdf(NONE, SAMPLE, survival[200])),
        **_fate_likelihoods(fates),
    }
    meets = {name: chance >= LIKELY for name, chance in likelihood.items()}
    meets["Fig. 5(b)"] = 0.025 <= passed <= 0.975
    return {
        "band": list(band),
        "melnikov_variance_of_fig3": deviation**2,
        "late_survival": float(ensembles[1].survival[LATE]),
        "late_interval": ensembles[1].survival_interval()[LATE].tolist(),
        "survival": {str(k): float(survival[k]) for k in (4, 10, 20, 40, 60, 200)},
        "interval": {str(k): ensembles[0].survival_interval()[k].tolist() for k in (10, 60, 200)},
        **fates,
        "likelihood": likelihood,
        "meets": meets,
    }


def _fates(band, seeds, few_seeds, maps, overturned="clamped"):
    """Count the mean maps that stand, and those that are fractal, for each σ: [count, of so many]."""
    stands, fractal = {}, {}
    for deviation, count in ((0.05, few_seeds), (0.06, few_seeds), (0.12, seeds), (0.13, seeds), (0.16, few_seeds)):
        maps_of_seeds = [mean_points(band, deviation, seed, overturned, **maps) for seed in range(1, count + 1)]
        stands[str(deviation)] = [sum(stood for _, stood in maps_of_seeds), count]
        if deviation < 0.1:
            dimensions = [correlation_dimension(points, *LENGTHS) for points, _ in maps_of_seeds]
            fractal[str(deviation)] = [sum(dimension >= 1.0 for dimension in dimensions), count]
    return {"mean_stands": stands, "mean_is_fractal": fractal}


def mean_points(band, deviation, seed, overturned="clamped", *, realizations=1200, cycles=500):
    """Return the settled points (n, 2) of a restarted mean map of the paper's Figs. 8 and 9, and whether it stands.

    Parameters
    ----------
    band : (float, float)
        Lowest and highest frequency of the noise.
    deviation : float
        σ, nondimensional; 0 for none.
    seed, realizations, cycles : int
    overturned : str
        "clamped" or "left out", see `montecarlo.restarted_poincare_map`.
    """
    noise = {"variance": deviation**2, "band": band}
    scene = load_scene("main").varied(forcing={"phase": 3.14}, noise=noise)
    sampled = {"cycles": cycles, "realizations": realizations, "seed": seed, "overturned": overturned}
    mean_map = restarted_poincare_map(scene, **sampled)
    return mean_map.points[SETTLED + 1 : mean_map.overturned_after], mean_map.overturned_after is None


def _fate_likelihoods(fates):
    """Probability of the paper's fates, from the shares of the seeds that show them."""
    stands, fractal = (
        {name: k / n for name, (k, n) in fates[kind].items()} for kind in ("mean_stands", "mean_is_fractal")
    )
    falls = {name: 1.0 - share for name, share in stands.items()}
    return {
        "Fig. 9 (a)": fractal["0.05"] * (1.0 - fractal["0.06"]),
        "Fig. 9 (b)": stands["0.05"] * stands["0.06"] * stands["0.12"] * falls["0.13"] * falls["0.16"],
    }


def _joint(rows, seeds, few_seeds):
    """Product of the likelihoods over bands [0, b], and the bands that meet every hint or are within `WITHIN`."""
    # What no seed has shown has a probability that is small, but not known to be 0.
    least = {"Fig. 9 (a)": 0.5 / (few_seeds + 1), "Fig. 9 (b)": 0.5 / (seeds + 1)}
    logs = [
        sum(math.log(max(chance, least.get(name, 1e-12))) for name, chance in row["likelihood"].items()) for row in rows
    ]
    ends = [row["band"][1] for row in rows]
    best = max(logs)
    return {
        "log_likelihood": logs,
        "best": ends[int(np.argmax(logs))],
        "within": [b for b, log in zip(ends, logs, strict=True) if log >= best - WITHIN],
        "meets_all": [b for b, row in zip(ends, rows, strict=True) if all(row["meets"].values())],
    }


def draw(path, values):
    """Draw what the JSON file holds of the bands that begin at 0."""
    rows = [row for row in values["rows"] if row["band"][0] == 0.0]
    joint, ends = values["joint"], [row["band"][1] for row in rows]
    met = joint["meets_all"]
    inferred = f"b from {min(met):g} to {max(met):g}" if met else "no b"
    note = (
        f"{values['realizations']:,} realizations a band. Dashed: {100 * LIKELY:g} %, from which on a statement "
        f"counts as met (Fig. 5(b): where {LATE} cycles lie within the central 95 %). Grey: b whose likelihood is "
        f"within a factor e^{WITHIN:g} of the largest. Triangles: lower than drawn."
    )
    title = f"Noise bands [0, b] meet what the paper shows with {inferred}; the likeliest b is {joint['best']:g}"
    with pictures.page(path, (10.5, 8.2), title, [note]) as figure:
        panels = figure.subplots(2, 3, sharex=True).ravel()
        for name, axes in zip((*HINTS[1:], "all"), panels, strict=True):
            _likelihood(axes, name, rows, ends, joint)
        for axes in panels[3:]:
            axes.set_xlabel("highest frequency b, nondimensional")
        panels[0].set_ylabel("probability of what the paper shows")
        panels[3].set_ylabel("probability of what the paper shows")


_SHOWN = 12.0
_TITLES = {
    "Fig. 5(b)": "Fig. 5(b): overturns after\n125 cycles (113 to 137)",
    "Fig. 6": "Fig. 6: at most 10 of 1,000\nstand after 60 cycles",
    "Fig. 7": "Fig. 7: at most 2 of 1,000\nstand after 200 cycles",
    "Fig. 9 (a)": "Fig. 9: mean map fractal\nat σ = 0.05, not at 0.06",
    "Fig. 9 (b)": "Fig. 9: mean stands at\nσ = 0.12, overturns at 0.13",
}


def _likelihood(axes, name, rows, ends, joint):
    """Draw the likelihood of a hint, or of "all", against the ends b of the bands, beside the interval of `_joint`."""
    axes.axvspan(min(joint["within"]), max(joint["within"]), color="#dddddd", zorder=0)
    if name == "all":
        logs = np.array(joint["log_likelihood"])
        less, drawn = logs - logs.max(), np.array(ends)
        visible = less > -_SHOWN
        axes.plot(drawn[visible], less[visible], "o-", color=pictures.COLOURS[1], markersize=4)
        axes.plot(
            drawn[~visible], np.full(np.count_nonzero(~visible), -_SHOWN), "v", color=pictures.COLOURS[1], markersize=6
        )
        axes.axhline(-WITHIN, color="black", linewidth=0.8, linestyle="--")
        axes.set(title="Figs. 3 to 9 together:\nlikelihood, over its largest", ylim=(-_SHOWN - 0.6, 0.6))
        axes.set_ylabel("natural logarithm of the ratio")
        return
    chances = [row["likelihood"][name] for row in rows]
    axes.plot(ends, chances, "o-", color=pictures.COLOURS[0], markersize=4)
    if name == "Fig. 5(b)":
        axes.set(title=_TITLES[name], ylim=(0.0, 1.25 * max(chances)))
    else:
        axes.axhline(LIKELY, color="black", linewidth=0.8, linestyle="--")
        axes.set(title=_TITLES[name], ylim=(-0.03, 1.03))


def table(values):
    """One row a band, as a table for the terminal."""
    rows = []
    for row in values["rows"]:
        low, high = row["band"]
        chances = (f"{row['likelihood'][name]:.3f}{'' if row['meets'][name] else ' no'}" for name in HINTS)
        survival = row["late_survival"], row["survival"]["60"], row["survival"]["200"]
        rows.append([f"[{low:g}, {high:g}]", *(f"{share:.4f}" for share in survival), *chances])
    return tables.text_table(("band", "S(125) of 5(b)", "S(60)", "S(200)", *HINTS), rows)


def report(values):
    """Print the table and the verdict."""
    joint = values["joint"]
    sentences = [
        "Columns named after figures: probability of what the paper shows there; no: a statement that is not met.",
        f"Most likely b: {joint['best']:g}; within the interval: {joint['within']}; meet all: {joint['meets_all']}.",
    ]
    tables.show("Noise bands against the paper's statements", table(values), sentences)
    for row in values["left_out"]:
        print(f"Overturned left out of the mean, band {row['band']}: stands {row['mean_stands']}")


if __name__ == "__main__":
    command(
        run,
        "results/band",
        "band.png",
        "band.json",
        report=report,
        realizations="of an ensemble",
        seeds="of the mean maps",
    )
