"""How often the printed total error holds where noise was replaced; writes docs/benchmarks/replacement_*.json.

Random blocks under band noise, in periodic shaking (those of `practical_blocks`) and in random records, are solved and
checked by `fpk_rocking.studies.checked`, and held against many more paths under the same band noise.

    python benchmarks/replacement.py periodic                 # 24 scenes, some minutes
    python benchmarks/replacement.py record --paths 100000    # 12 scenes, most of an hour
"""

import argparse
import itertools
import json
import math
import statistics
import warnings

import numpy as np
from practical_blocks import CYCLES, practical_blocks
from report import ROOT

from fpk_rocking import Record, Scene, solve_fpk
from fpk_rocking.results import storage
from fpk_rocking.results.trust import REPLACED
from fpk_rocking.studies import checked
from montecarlo import simulate, tally

TOL = 1e-2
COLUMNS = [
    "", "A or peak", "e", "S", "numerics", "replacement", "total", "S, many paths", "largest dS", "rows inside",
    "trust", "solve, s", "check, s",
]  # fmt: skip
_GRAVITY = 9.81
_SCREENED = 1000
_REFERENCE_SEED = 99


def records(seed, count):
    """Draw scenes: a block as in `practical_blocks`, a record of 8 to 16 s, and band noise of .02 to .1 g beside it.

    The record is a sum of harmonics of .3 to 10 Hz with Kanai and Tajimi's spectrum, times an envelope, with a peak of
    .15 to .8 g. A scene in which fewer than .02 or more than .98 of the blocks stand in the end is drawn again.
    """
    rng = np.random.default_rng(seed)
    while count > 0:
        duration, ground = rng.uniform(8.0, 16.0), rng.uniform(1.5, 4.0)
        time, hertz = np.arange(0.0, duration, 0.01), np.linspace(0.3, 10.0, 200)
        ratio = (hertz / ground) ** 2
        size = np.sqrt((1.0 + 1.44 * ratio) / ((1.0 - ratio) ** 2 + 1.44 * ratio))
        phase = rng.uniform(0.0, 2.0 * math.pi, hertz.size)
        shaking = np.cos(2.0 * math.pi * np.outer(time, hertz) + phase) @ size
        shaking *= np.interp(time / duration, [0.0, 0.2, 0.6, 1.0], [0.0, 1.0, 1.0, 0.0])
        peak = math.exp(rng.uniform(math.log(0.15), math.log(0.8)))
        record = Record(0.01, tuple((peak / np.abs(shaking).max() * shaking).tolist()), "g")
        width = rng.uniform(0.3, 1.2)
        noise = {"noise_rms_acceleration": _GRAVITY * rng.uniform(0.02, 0.1)}
        noise |= {"noise_band_hz": (0.0, rng.uniform(5.0, 10.0)), "harmonics": 100}
        scene = Scene.from_block(width, width * rng.uniform(2.5, 6.0), record=record, **noise)
        if 0.02 <= simulate(scene, realizations=_SCREENED).survival[-1] <= 0.98:
            count -= 1
            yield scene


def judged(scene, paths):
    """Solve and check a scene, and sample it with many paths: all of these, or the reason of a refusal, as a dict.

    `apart` is survival of the paths less that of the density, at each row but the start.
    """
    rows = {"cycles": CYCLES} if scene.period else {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        try:
            density = checked(solve_fpk(scene, tol=TOL, noise_replacement="white", **rows))
        except ValueError as reason:
            return {"scene": scene, "reason": str(reason)}
    end = scene.overturning.angle
    edges = {"angle_edges": [-end, end], "velocity_edges": [-1e6, 1e6]}
    many = tally(scene, realizations=paths, seed=_REFERENCE_SEED, **rows, **edges)
    apart = (many.survival - density.survival)[1:]
    return {"scene": scene, "density": density, "many": many, "apart": apart}


def cells_of(number, row):
    """Cells of a row of the table."""
    scene = row["scene"]
    first = [number, f"{scene.forcing.largest:.2f}", f"{scene.block.restitution:.2f}"]
    if "reason" in row:
        return [*first, *["-"] * (len(COLUMNS) - 4), row["reason"].replace("|", "¦")]
    density, check = row["density"], row["density"].replacement
    return [
        *first, f"{density.survival[-1]:.4f}", f"{density.error_estimate:.1g}",
        f"{check.difference[-1, 0]:+.4f} ± {check.sampling_error[-1, 0]:.4f}", f"{density.total_error[-1, 0]:.4f}",
        f"{row['many'].survival[-1]:.4f}", f"{row['apart'][np.abs(row['apart']).argmax()]:+.4f}",
        f"{inside(row).sum()} of {inside(row).size}", density.trust.verdict, f"{density.wall_s:.1f}",
        f"{check.wall_s:.2f}",
    ]  # fmt: skip


def inside(row):
    """Whether the printed interval holds survival by the many paths, in each row but the start."""
    return np.abs(row["apart"]) <= row["density"].total_error[1:, 0]


def summary(rows):
    """Figures that sum up the rows."""
    answered = [row for row in rows if "density" in row]
    held = np.concatenate([inside(row) for row in answered])
    trusted = [row for row in answered if row["density"].trust.verdict == "ok"]
    seconds = {"solve": [row["density"].wall_s for row in answered]}
    seconds["check"] = [row["density"].replacement.wall_s for row in answered]
    return {
        "answered": f"{len(answered)} of {len(rows)}",
        "rows inside the total error": f"{held.sum()} of {held.size}",
        "ok": len(trusted),
        f"ok, off by more than {max(REPLACED, TOL):g}": sum(
            bool(np.abs(row["apart"]).max() > max(REPLACED, TOL)) for row in trusted
        ),
        "ok, with a row outside": sum(not inside(row).all() for row in trusted),
    } | {
        f"seconds to {name}, median and worst": [statistics.median(spent), max(spent)]
        for name, spent in seconds.items()
    }


def main():
    """Judge the scenes, print each as it comes, and write the file."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("kind", choices=["periodic", "record"], help="of the shaking")
    parser.add_argument("--seed", type=int, default=241, help="of the scenes (default: %(default)s)")
    parser.add_argument("--scenes", type=int, help="how many (default: 24, and 12 records)")
    parser.add_argument("--paths", type=int, default=400_000, help="beside each (default: %(default)s)")
    options = parser.parse_args()
    draw, usual = {"periodic": (practical_blocks, 24), "record": (records, 12)}[options.kind]
    rows = []
    for scene in draw(options.seed, options.scenes or usual):
        rows.append(judged(scene, options.paths))
        print(*cells_of(len(rows), rows[-1]), sep=" | ", flush=True)
    values = {"seed": options.seed, "tol": TOL, "paths": options.paths} | summary(rows)
    values |= {"columns": COLUMNS, "rows": list(itertools.starmap(cells_of, enumerate(rows, 1)))}
    storage.write_text(ROOT / "docs" / "benchmarks" / f"replacement_{options.kind}.json", json.dumps(values, indent=1))
    print(*(f"{name}: {value}" for name, value in values.items() if name not in {"columns", "rows"}), sep="\n")


if __name__ == "__main__":
    main()
