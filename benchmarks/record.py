"""Survival under the project's record by `solve_fpk` and white-noise paths; writes its table into docs/benchmarks.

The scene is `cases/scenes/record.toml`, a rack of 0.5 m by 1.8 m under the synthetic record of 40 s with white noise
that rises and dies away, at scales of the record at which nearly all blocks stand to nearly all overturn. Paths are
followed to half of the record, after which a handful in a thousand overturn at most; they come in batches, a seed
each, kept as lines of results/record_paths.jsonl, and a run adds what is missing. Deleting that file renews them.

    python benchmarks/record.py                          # ten minutes and more, and 6 ms for each path that is missing
    python benchmarks/record.py --paths 400000 --scales 1.3 2
"""

import argparse
import json
import math
import time
import warnings

import numpy as np
from report import ROOT, table, write_section

from fpk_rocking import load_scene, solve_fpk
from fpk_rocking.scene.axes import result_times
from montecarlo import tally

SCENE = ROOT / "cases" / "scenes" / "record.toml"
SCALES = 0.8, 1.0, 1.3, 1.6, 2.0, 3.0
BATCH = 10_000
ROWS = 11
TOL = 1e-2
SIGMAS = 3.5
KEPT = ROOT / "results" / "record_paths.jsonl"
TITLE = "A record of 40 s"
COLUMNS = [
    "scale",
    "peak",
    "S density",
    "S paths",
    "largest dS",
    "its s.e.",
    "estimate",
    "density, s",
    "paths, s",
    "verdict",
]


def paths_of(scene, scale, paths):
    """Return survival of white-noise paths at the first `ROWS` times, their number, and the seconds that they took."""
    lines = KEPT.read_text().splitlines() if KEPT.exists() else []
    batches = [batch for batch in map(json.loads, lines) if batch["scale"] == scale]
    while sum(batch["paths"] for batch in batches) < paths:
        seed = 1 + max((batch["seed"] for batch in batches), default=0)
        begin = time.process_time()
        counts = tally(scene, times=result_times(scene)[1:ROWS], realizations=BATCH, seed=seed)
        batch = {"scale": scale, "seed": seed, "paths": BATCH, "standing": counts.survivors.tolist()}
        batches.append(batch | {"seconds": time.process_time() - begin})
        KEPT.parent.mkdir(exist_ok=True)
        with KEPT.open("a") as file:
            file.write(json.dumps(batches[-1]) + "\n")
    count = sum(batch["paths"] for batch in batches)
    standing = np.sum([batch["standing"] for batch in batches], axis=0)
    return standing / count, count, sum(batch["seconds"] for batch in batches)


def row_of(scene, scale, paths, bins_tol):
    """Return a row of the table: entries as text."""
    scene = scene.varied(forcing={"scale": scale})
    sampled, count, sampling = paths_of(scene, scale, paths)
    begin = time.process_time()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        density = solve_fpk(scene, tol=TOL, bins_tol=bins_tol)
    seconds, messages = time.process_time() - begin, [str(warning.message) for warning in caught]
    error = np.sqrt(np.maximum(sampled * (1.0 - sampled), 1.0 / count) / count)
    apart = np.abs(density.survival[:ROWS] - sampled)
    worst, inside = int(np.argmax(apart)), bool((apart <= TOL + SIGMAS * error).all())
    return [
        f"{scale:g}", f"{scene.forcing.largest:.2f}", f"{density.survival[ROWS - 1]:.4f}", f"{sampled[-1]:.4f}",
        f"{apart[worst]:.4f}", f"{error[worst]:.4f}", f"{density.error_estimate:.4f}", f"{seconds:.1f}",
        f"{sampling:.0f} for {count:,}", "; ".join(["inside" if inside else "**outside**", *messages]),
    ]  # fmt: skip


def main():
    """Solve, sample and write the section."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--scales", type=float, nargs="+", default=SCALES)
    parser.add_argument("--paths", type=int, default=BATCH, help="at each scale (default: %(default)s)")
    parser.add_argument("--bins-tol", type=float, default=math.inf, help="of the density (default: %(default)s)")
    options = parser.parse_args()
    scene = load_scene(SCENE)
    solve_fpk(scene, times=[12.0], tol=TOL, bins_tol=math.inf)  # compiles
    rows = []
    for scale in options.scales:
        rows.append(row_of(scene, scale, options.paths, options.bins_tol))
        print(*rows[-1], flush=True)
    end = result_times(scene)[ROWS - 1]
    inside = sum(row[-1].startswith("inside") for row in rows)
    body = (
        f"**Result.** Density and paths agree at {inside} of {len(rows)} scales; the density takes "
        f"{min(float(row[7]) for row in rows):.0f} to {max(float(row[7]) for row in rows):.0f} s a scale.\n\n"
        f"Survival to τ = {end:.0f} (half of the record) of a rack of 0.5 m by 1.8 m under "
        f"`cases/records/synthetic.AT2`, with white noise of D = {scene.noise.diffusion:g} and an envelope, "
        f"tol {TOL:g}, bins_tol {options.bins_tol:g}. The largest difference is over {ROWS - 1} times, and inside "
        f"means within tol and {SIGMAS} standard errors at each. *Peak* is the largest |f|; seconds are processor "
        "time. `benchmarks/record.py`.\n\n" + table(COLUMNS, rows)
    )
    write_section(TITLE, body, page=None)


if __name__ == "__main__":
    main()
