"""Outcomes of shake-table tests, predicted before they are seen: a planar rocking block against intensity measures.

FILE is an .npz with `ids` (n,), `dt`, seconds, and for each id `a<id>`, the acceleration of the table in 1e-4 g. With
`overturned` (n, 2), whether specimen 1 and 2 did, and `record` (n,), the ground motion that was scaled, blocks are
fitted, compared, and kept in docs/benchmarks. The repository holds no copy of measured motions. Five processor
minutes, and fifteen more with --more; tables of outcomes are kept in FOLDER:

    python benchmarks/shake_table.py --motions FILE.npz --tables FOLDER [--draws 64] [--more]

With the blocks that are kept, the probability of overturning under other motions, five processor minutes for a hundred:

    python benchmarks/shake_table.py --motions FILE.npz --out PROBABILITIES.json
"""

import argparse
import dataclasses
import json
import math
import pathlib
import time

import numpy as np
import scipy
from report import DATA, table, write_section
from shake_table_scores import (
    SEED,
    SPLITS,
    area_under,
    by_block,
    by_logistic,
    inversions,
    logistic,
    measures_of,
    scores,
    splits_of,
)

from fpk_rocking import Record
from fpk_rocking.results.pictures import COLOURS, drawing
from fpk_rocking.results.storage import write_json
from fpk_rocking.risk.calibration import (
    PRIOR,
    Calibration,
    block_scenes,
    calibrated,
    drawn_names,
    outcomes_of,
    reliability_panel,
)

BLOCKS = DATA / "shake_table_blocks.json"
SPECIMENS = "specimen 1", "specimen 2"
DRAWS, REFINED, FEW, FILTERED, IN_THREE, STIFF = 64, 64, 8, 32, 32, 0.94
HOUSNER = {name: law for name, law in PRIOR.items() if name != "restitution"}
UNEQUAL = PRIOR | {"offset": "normal:0:0.1"}
NO_SCATTER = {"spread": 0.0, "scatter": None, "stray": "uniform:0.01:0.6"}
VARIANTS = {
    "low-pass 20 Hz": {"hertz": 20.0},
    "low-pass 10 Hz": {"hertz": 10.0},
    "from .04 g to 1 s after .04 g": {"level": 0.04},
    "overturned at 4 critical angles": {"overturning": 4.0},
}
PRIORS = {
    "prior of the angle: median .15, dispersion .6": {"critical_angle": "lognormal:0.15:0.6"},
    "prior of the scatter: .02 to .25": {"scatter": "uniform:0.02:0.25"},
    "no stray outcomes (.001)": {"stray": "uniform:0.0005:0.0015"},
    "p and restitution do not scatter": {"spread": 0.0},
    "they scatter by .05": {"spread": 0.05},
    "they scatter by .2": {"spread": 0.2},
}
MAIN, LOGISTIC = "planar block", "logistic, "
ON_PAGE = (
    MAIN,
    f"{MAIN}, Housner's restitution",
    f"{MAIN}, no scatter",
    *(LOGISTIC + measures for measures in ("PGA and PGV/PGA", "PGA", "PGV")),
)


def samples_of(file):
    """Accelerations of the tests of a file, g, as a list of arrays, and seconds between samples."""
    return [1e-4 * file[f"a{number}"].astype(float) for number in file["ids"]], float(file["dt"])


def motions_of(file, hertz=None, level=None):
    """Return the tests of a file as records; low-passed, or cut to what is above a level in g and a second more."""
    arrays, step = samples_of(file)
    if hertz:
        arrays = [scipy.signal.filtfilt(*scipy.signal.butter(4, 2.0 * hertz * step), array) for array in arrays]
    if level:
        places = [np.flatnonzero(np.abs(array) > level) for array in arrays]
        arrays = [
            array[max(at[0] - 20, 0) : at[-1] + round(1.0 / step)] if at.size else array[:9]
            for array, at in zip(arrays, places, strict=True)
        ]
    pairs = zip(file["ids"], arrays, strict=True)
    return [Record(step, tuple(array.tolist()), "g", source=str(number)) for number, array in pairs]


def predict(file, blocks=BLOCKS):
    """Probabilities of overturning under the motions of a file, by specimen and number of the test."""
    motions, probabilities = motions_of(file), {}
    for name, stored in json.loads(blocks.read_text(encoding="utf-8")).items():
        angles, weights = np.array(stored["critical_angle"]), np.array(stored["weights"])
        scenes = block_scenes(stored["parameters"], np.array(stored["draws"]), angles, 0.5 * math.pi, motions)
        means = np.einsum("nkj,kj->n", outcomes_of(scenes, motions), weights / weights.sum())
        values = 0.5 * stored["stray"] + (1.0 - stored["stray"]) * means
        probabilities[name] = {motion.source: round(float(p), 5) for motion, p in zip(motions, values, strict=True)}
    return probabilities


def kept_table(folder, name, file, draws, compute, prior=PRIOR, overturning=0.5 * math.pi, **motions):
    """Calibration with the paths of a model, kept in the folder of tables; None if neither there nor wanted."""
    path = pathlib.Path(folder) / f"{name.replace(' ', '_')}.npz"
    if not path.exists():
        if not compute:
            return None
        records = motions_of(file, **motions)
        calibrated(records, file["overturned"][:, 0], prior, draws=draws, overturning=overturning, seed=SEED).save(path)
    return Calibration.load(path)


def refined_table(folder, name, file, planar, k, compute):
    """Calibration to specimen k with draws from about its posterior; without these if neither there nor wanted."""
    path = pathlib.Path(folder) / f"{name.replace(' ', '_')}.npz"
    own = planar.counting(planar.counted, file["overturned"][:, k])
    if not path.exists():
        if not compute:
            return own
        own.refined(motions_of(file), REFINED).save(path)
    return Calibration.load(path)


def with_draws(calibration, some):
    """Return a calibration by some of its draws, an index."""
    return dataclasses.replace(
        calibration,
        draws=calibration.draws[some],
        importance=calibration.importance[some],
        overturns=calibration.overturns[:, some],
    )


def models_of(planar, tables, measures):
    """Models by name: blocks, and regressions on intensity measures (n,)."""
    pairs = {"PGA and PGV/PGA": ("PGA", "PGV/PGA")} | {name: (name,) for name in measures if name != "PGV/PGA"}
    regressions = {LOGISTIC + text: by_logistic(*(measures[key] for key in names)) for text, names in pairs.items()}
    stiff = with_draws(planar, planar.draws[:, 1] > STIFF)
    blocks = {MAIN: planar, f"{MAIN}, restitution above {STIFF}": stiff}
    blocks |= {f"{MAIN}, {text}": table for text, table in tables.items() if table}
    models = {name: by_block(block) for name, block in blocks.items()}
    models |= {f"{name}, no scatter": by_block(block, **NO_SCATTER) for name, block in blocks.items()}
    return models | regressions


def kept_blocks(fits):
    """Blocks and weights of the calibrations by specimen, for `predict`."""
    values = {}
    for name, fit in fits.items():
        some = fit.population.sum(axis=1) > 1e-4
        values[name] = {
            "parameters": drawn_names(fit.prior),
            "draws": fit.draws[some].round(6).tolist(),
            "critical_angle": fit.angles.round(8).tolist(),
            "weights": fit.population[some].round(5).tolist(),
            "stray": round(fit.stray_mean, 6),
            "posterior": {key: [float(f"{value:.4g}") for value in row] for key, row in fit.posterior.items()},
        }
    return values


def draw(path, message, titles, panel):
    """Write a picture with a panel for each specimen, by `panel(axes, specimen)`; the file holds its message."""
    with drawing() as new_figure:
        figure = new_figure(figsize=(9.2, 4.2), layout="constrained")
        for axes, name, title in zip(figure.subplots(1, 2), SPECIMENS, titles, strict=True):
            panel(axes, name)
            axes.set_title(title, fontsize=9)
        figure.savefig(path, dpi=110, metadata={"Title": message})


def pictures(predictions, observed, measures, record):
    """Draw reliability, the tests that are missed, and fragility over PGV, into docs/benchmarks."""
    regression = LOGISTIC + "PGA and PGV/PGA"

    def reliability(axes, name):
        """Draw both models' observed shares over predicted probabilities."""
        for colour, model in zip(COLOURS, (MAIN, regression), strict=False):
            reliability_panel(axes, predictions[name][model], observed[name], 7, color=colour, label=model)
        handles = dict(zip(*reversed(axes.get_legend_handles_labels()), strict=True))
        axes.legend(handles.values(), handles.keys(), fontsize=8)

    def misses(axes, name):
        """Draw the outcome of each test over PGA and PGV/PGA, and circles where the model was wrong."""
        p, y = predictions[name][MAIN], observed[name]
        wrong, strange = (p > 0.5) != y, inversions(measures["PGA"], record, y)
        for over, text in ((False, "stood"), (True, "overturned")):
            some = y == over
            axes.plot(measures["PGA"][some], measures["PGV/PGA"][some], ".", color=COLOURS[int(over)], label=text)
        for kind, style, text in (
            (wrong & strange, "s", "wrong, outcomes not in order"),
            (wrong & ~strange, "o", "wrong"),
        ):
            axes.plot(measures["PGA"][kind], measures["PGV/PGA"][kind], style, mfc="none", mec="black", label=text)
        axes.set(xscale="log", yscale="log", xlabel="PGA, g", ylabel="PGV/PGA, m/s/g")
        axes.set_yticks([0.2, 0.3, 0.4, 0.6, 1.0], minor=False)
        axes.set_yticks([], minor=True)
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_formatter("{x:g}")
        axes.legend(fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.15), ncols=2, frameon=False)

    def fragility(axes, name):
        """Draw shares that overturned over PGV, the curve fitted to them, and one fitted to the predictions."""
        logs, y = np.log(measures["PGV"]), observed[name]
        order, grid = np.argsort(logs), np.linspace(logs.min(), logs.max(), 80)
        parts = np.array_split(order, 8)
        middles, shares = np.exp([logs[part].mean() for part in parts]), np.array([y[part].mean() for part in parts])
        counts = np.array([(y[part].sum() + 0.5, (~y[part]).sum() + 0.5) for part in parts]).T
        low, high = scipy.stats.beta.ppf([[0.025], [0.975]], *counts)
        # Jeffreys' limits do not contain a share of 0 or 1.
        away = np.maximum([shares - low, high - shares], 0.0)
        label = "share that overturned (95 %)"
        axes.errorbar(middles, shares, away, fmt="ko", markersize=4, elinewidth=1.0, label=label)
        for colour, values, text in (
            (COLOURS[0], y, "fitted to outcomes"),
            (COLOURS[1], predictions[name][MAIN], MAIN),
        ):
            b = logistic(logs[:, None], values)
            axes.plot(np.exp(grid), scipy.special.expit(b[0] + b[1] * grid), color=colour, label=text)
        axes.set(xscale="log", xlabel="PGV, m/s", ylabel="P(overturned)")
        axes.xaxis.set_major_formatter("{x:g}")
        axes.legend(fontsize=8)

    wrong = {name: int(((predictions[name][MAIN] > 0.5) != observed[name]).sum()) for name in SPECIMENS}
    total = len(record)
    draw(
        DATA / "shake_table_reliability.png",
        "Predicted probabilities of overturning hold for motions that the fit has not seen",
        [f"{name}: motions that the fit has not seen" for name in SPECIMENS],
        reliability,
    )
    missed = " and ".join(str(wrong[name]) for name in SPECIMENS)
    message = f"Of {total} tests of each rock {missed} are predicted wrongly, by a fit that has not seen the motion"
    draw(
        DATA / "shake_table_missed.png",
        message,
        [f"{name}: {wrong[name]} of {total} wrong" for name in SPECIMENS],
        misses,
    )
    message = "Curves over PGV fitted to predictions lie near those fitted to outcomes"
    draw(DATA / "shake_table_fragility.png", message, [f"{name}: fragility over PGV" for name in SPECIMENS], fragility)
    return wrong


def compare(file, folder, draws, more):
    """Compute all that the section says; return it, and the calibrations by specimen."""
    began = time.process_time()
    planar = kept_table(folder, "planar", file, draws, compute=True)
    blocks = {name: refined_table(folder, name, file, planar, k, more) for k, name in enumerate(SPECIMENS)}
    others = {"Housner's restitution": kept_table(folder, "housner", file, FEW, more, prior=HOUSNER)}
    record, splits, measures = file["record"], splits_of(file["record"]), measures_of(*samples_of(file))
    observed = {name: file["overturned"][:, k].astype(bool) for k, name in enumerate(SPECIMENS)}
    counts = {text: FILTERED if "hertz" in options else FEW for text, options in VARIANTS.items()}
    tables = {text: kept_table(folder, text, file, counts[text], more, **VARIANTS[text]) for text in VARIANTS}
    unequal = kept_table(folder, "unequal", file, IN_THREE, more, prior=UNEQUAL)
    results, predictions = {}, {}
    for name in SPECIMENS:
        models = models_of(blocks[name], others, measures)
        variants = {"as above": models[MAIN], f"{FEW} draws": by_block(with_draws(planar, slice(FEW)))}
        variants |= {f"{count} draws": by_block(with_draws(planar, slice(count))) for count in (draws // 2, draws)}
        if unequal:
            variants[f"{IN_THREE} draws, unequal sides"] = by_block(unequal)
        variants |= {text: by_block(blocks[name], **laws) for text, laws in PRIORS.items()}
        variants |= {f"{counts[text]} draws, {text}": by_block(some) for text, some in tables.items() if some}
        rows, predictions[name] = scores(models, observed[name], record, splits, MAIN)
        sensitivity, _ = scores(variants, observed[name], record, splits, "as above")
        order = {key: round(area_under(values, observed[name]), 3) for key, values in measures.items()}
        order[MAIN] = round(area_under(predictions[name][MAIN], observed[name]), 3)
        wrong = (predictions[name][MAIN] > 0.5) != observed[name]
        strange = inversions(measures["PGA"], record, observed[name])
        results[name] = {
            "scores": rows,
            "sensitivity": sensitivity,
            "area under the ROC": order,
            "wrong": int(wrong.sum()),
            "wrong, predicted to stand": int((wrong & observed[name]).sum()),
            "outcomes not in order": int(strange.sum()),
            "wrong among these": int((wrong & strange).sum()),
            "draws": len(blocks[name].draws),
            "effective draws": round(blocks[name].effective_draws, 1),
            "posterior": {key: [float(f"{value:.3g}") for value in row] for key, row in blocks[name].posterior.items()},
        }
        if unequal:
            fit = unequal.counting(unequal.counted, observed[name])
            results[name]["offset"] = [float(f"{value:.3g}") for value in fit.posterior["offset"]]
            results[name]["effective draws, unequal sides"] = round(fit.effective_draws, 1)
    pictures(predictions, observed, measures, record)
    results["tests"] = {
        "id": file["ids"].tolist(),
        **{key: [float(f"{value:.4g}") for value in measures[key]] for key in ("PGA", "PGV")},
        **{f"{name} overturned": observed[name].astype(int).tolist() for name in SPECIMENS},
        **{f"{name} predicted": predictions[name][MAIN].round(4).tolist() for name in SPECIMENS},
    }
    results["processor seconds, with the paths that were not kept"] = round(time.process_time() - began, 1)
    return results, blocks


def page_rows(results):
    """Lines of the tables of the page: of the posteriors, and of the scores."""
    lines = []
    first, second = (results[name]["posterior"] for name in SPECIMENS)
    texts = {
        "critical_angle": "critical angle, rad",
        "frequency_parameter": "frequency parameter p, rad/s",
        "restitution": "restitution",
        "scatter": "scatter of the critical angle",
        "stray": "share of stray outcomes",
    }
    for key, text in texts.items():
        cells = [f"{_short(row[0])} ({_short(row[1])} to {_short(row[2])})" for row in (first[key], second[key])]
        lines.append(f"| {text} | {cells[0]} | {cells[1]} |")
    for model in ON_PAGE:
        cells = []
        for name in SPECIMENS:
            row = results[name]["scores"][model]
            error = f"{row['Brier above, error']:.3f}".lstrip("0")
            above = "" if model == MAIN else f"{row['Brier above']:+.3f} ± {error}".replace("0.", ".", 1)
            cells += [_short(row["share right"], 3), _short(row["Brier"], 3), above]
        lines.append(f"| {model} | " + " | ".join(cells) + " |")
    return lines


def _short(value, digits=None):
    """Text of a number without the zero before the point."""
    text = f"{value:.3g}" if digits is None else f"{value:.{digits}f}"
    return text.removeprefix("0") if value else text


def section(results):
    """Title and body of the section."""
    rows, sensitive = [], []
    for name in SPECIMENS:
        for model, row in results[name]["scores"].items():
            above = "" if model == MAIN else f"{row['Brier above']:+.3f} ± {row['Brier above, error']:.3f}"
            z = f"{row['z of the sum']:+.1f}, {row['z of the Brier score']:+.1f}"
            rows.append(
                [
                    name,
                    model,
                    f"{row['share right']:.3f}",
                    f"{row['Brier']:.3f} ± {row['Brier error']:.3f}",
                    above,
                    f"{row['log-likelihood']:.3f}",
                    z,
                ]
            )
        sensitive += [
            [name, model, f"{row['Brier']:.4f}", f"{row['Brier above']:+.4f}", f"{row['log-likelihood']:.3f}"]
            for model, row in results[name]["sensitivity"].items()
        ]
    first, second = (results[name]["scores"][MAIN] for name in SPECIMENS)
    result = (
        "**Result.** Fitted to half of the ground motions, a planar rocking block with scatter predicts "
        f"{first['share right']:.3f} and {second['share right']:.3f} of the outcomes of the other half (Brier score "
        f"{first['Brier']:.3f}, {second['Brier']:.3f})."
    )
    head = ["", "model", "share right", "Brier score", "above the block", "log-likelihood", "z"]
    method = (
        f"Means over the tests that are left out in {SPLITS} random splits of 28 ground motions into halves; ± is one "
        "standard error by ground motion, paired where it is that of a difference. z: standardized deviations of the "
        "number that overturned and of the Brier score from what the probabilities make likely."
    )
    other = ["", "variant", "Brier score", "above", "log-likelihood"]
    return "Shake-table tests", "\n\n".join(
        [result, method, table(head, rows), "Sensitivity:", table(other, sensitive)]
    )


def main():
    """Predict by the blocks that are kept, or fit and compare."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--motions", required=True, metavar="FILE", help=".npz of the measured motions")
    parser.add_argument("--out", metavar="FILE", help="JSON of probabilities by specimen and test")
    parser.add_argument("--tables", default="build/shake_table", metavar="FOLDER", help="tables of outcomes")
    parser.add_argument("--draws", type=int, default=DRAWS, metavar="N", help="blocks, a power of 2")
    parser.add_argument(
        "--more",
        action="store_true",
        help="further draws, unequal sides, other restitution, filters, lengths, cut-offs",
    )
    options = parser.parse_args()
    with np.load(options.motions) as file:
        if options.out:
            write_json(options.out, predict(file))
            return
        results, fits = compare(file, options.tables, options.draws, options.more)
    write_json(BLOCKS, kept_blocks(fits))
    write_section(*section(results), page=None, values=results)


if __name__ == "__main__":
    main()
