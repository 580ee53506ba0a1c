"""Every method's time at equal error, and how the density solver's grows; a section of docs/benchmarks.md.

Also its pictures and its figures as JSON, in docs/benchmarks/.

python benchmarks/equal_error.py            # about 5 minutes
python benchmarks/equal_error.py --redraw   # the pictures alone, from the JSON file
"""

import json
import math
import subprocess
import sys
import time
import warnings

import numpy as np
from density import CYCLES, MAIN, TOLERANCES, peak_memory, run_of
from equal_pictures import WHITE_ERROR, draw_errors, draw_growth
from equal_truth import Truth
from eulerian_runs import EDGES, Row
from eulerian_runs import Run as Baseline
from report import DATA, ROOT, medians, slug, table, write_section

from fpk_rocking import CycleOperator, load_scene, solve_fpk
from fpk_rocking.density.resolution import RESOLUTIONS, PatchSettings, Resolution
from fpk_rocking.density.step.step import Quadrature
from fpk_rocking.results import sampling as distances
from fpk_rocking.scene import WhiteNoise
from montecarlo import simulate

SCENES = {"main": MAIN, "second": load_scene(ROOT / "cases" / "scenes" / "second.toml")}
BAND = load_scene(ROOT / "cases" / "scenes" / "main.toml")
METHODS = {
    "white": (MAIN, {"method": "white"}),
    "exact": (BAND, {"method": "exact"}),
    "rk4": (BAND, {"method": "rk4", "steps_per_cycle": 200}),
    "rk4, 50 steps": (BAND, {"method": "rk4", "steps_per_cycle": 50}),
}
TARGETS = {"L1 = 0.01, bins of .1": ("coarse", 0.01), "L1 = 0.01, bins of .025": ("fine", 0.01),
           "dS = 5e-4": ("survival", 5e-4), "dS = 1e-4": ("survival", 1e-4)}  # fmt: skip
OTHERS = *METHODS, "Eulerian"
SAMPLE = 50_000
_LEAN = PatchSettings(8, 4.5, 1.0, 0.05, 4)
ALONE = (
    Resolution(50, 90, 1, Quadrature(3, 3, 5, 2, 9), 6, _LEAN),
    Resolution(34, 60, 2, Quadrature(4, 4, 5, 2, 9), 8, _LEAN),
    Resolution(44, 80, 2, Quadrature(4, 4, 5, 2, 9), 12, _LEAN),
    *RESOLUTIONS[1:4],
)
DIFFUSIONS = 0.05, 0.02, 0.00628, 0.0025, 6.3e-4, 2.5e-4, 6.3e-5, 2.5e-5
HORIZONS = 10, 40, 100, 200
LOOSE = 1e-2
TITLE = "Time at equal error"
BASELINE = Row(24, 40, 3, 192)
PEAK = """
import pathlib, sys
from fpk_rocking import load_scene
from montecarlo import tally
scene, everywhere = load_scene(sys.argv[1]), {"angle_edges": [-2.0, 0.0, 2.0], "velocity_edges": [-20.0, 0.0, 20.0]}
tally(scene.white_equivalent() if sys.argv[2] == "white" else scene, cycles=10, realizations=50_000, method=sys.argv[2],
      **everywhere)
print(next(line.split()[1] for line in pathlib.Path("/proc/self/status").read_text().splitlines() if "VmHWM" in line))
"""


def solver_rows(scene, truth):
    """Seconds and errors of the density solver by tolerance."""
    seconds = medians({tol: lambda tol=tol: solve_fpk(scene, cycles=CYCLES, tol=tol) for tol in TOLERANCES}, rounds=3)
    rows = {}
    for tol in TOLERANCES:
        evolution = solve_fpk(scene, cycles=CYCLES, tol=tol)
        errors = truth.errors(
            evolution.survival, lambda edges, evolution=evolution: evolution.bin_probabilities(CYCLES, *edges)
        )
        certified = {"survival": evolution.error_estimate, "coarse": evolution.bins_error_estimate}
        rows[tol] = {"seconds": seconds[tol], "certified": certified} | errors
    return rows


def alone_rows(scene, truth):
    """Seconds and errors of single runs by resolution."""
    names = [f"{r.angle_cells} × {r.velocity_cells}, degree {r.degree}, {r.steps} steps" for r in ALONE]
    solvers = dict(zip(names, [lambda r=r: run_of(scene, r, TOLERANCES[0]) for r in ALONE], strict=True))
    seconds = medians(solvers, rounds=3)
    rows = {}
    for name, call in solvers.items():
        run, solution = call()
        last = solution.coefficients[CYCLES]
        errors = truth.errors(
            solution.survival, lambda edges, run=run, last=last: run.space.bin_integrals(last, *edges)
        )
        rows[name] = {"seconds": seconds[name]} | errors
    return rows


def sampling_rates(methods):
    """Seconds a realization by method, in turns."""
    engines = {
        name: lambda scene=scene, how=how: simulate(scene, cycles=CYCLES, realizations=SAMPLE, **how)
        for name, (scene, how) in methods.items()
    }
    return {name: seconds / SAMPLE for name, seconds in medians(engines, rounds=3).items()}


def baseline_row(truth):
    """Seconds and errors of the Eulerian baseline, from the solver's density after a cycle."""
    start = solve_fpk(MAIN, cycles=1, tol=1e-4)
    run, survival = None, np.array(truth.survival)

    def solve():
        nonlocal run
        run = Baseline(BASELINE, start.at(1))
        for k in range(2, CYCLES + 1):
            run.cycle()
            survival[k] = run.mass

    begin = time.perf_counter()
    solve()
    return {"seconds": time.perf_counter() - begin} | truth.errors(survival, run.bins)


def at_equal_error(truth, solver, alone, rates, baseline=None):
    """Rows of seconds at each target: the cheapest whole call and run alone that meet it, sampling extrapolated."""
    rows = []
    for name, (kind, error) in TARGETS.items():
        entry = {"target": name}
        bounds = {
            "whole": {how: row[kind] + truth.unsure[kind] for how, row in solver.items()},
            "certified": {how: row["certified"][kind] for how, row in solver.items() if kind in row["certified"]},
            "alone": {how: row[kind] + truth.unsure[kind] for how, row in alone.items()},
        }
        for method, bound in bounds.items():
            meeting = [((solver | alone)[how]["seconds"], bound[how], how) for how in bound if bound[how] <= error]
            if meeting:
                entry[method] = dict(zip(("seconds", "error", "how"), min(meeting), strict=True))
        for method, rate in rates.items():
            entry[method] = truth.paths(kind, error) * rate
        if baseline:
            # Fourth order in the mesh, steps in proportion: cost as the third power of the size, error as the fourth.
            entry["Eulerian"] = baseline["seconds"] * (baseline[kind] / error) ** 0.75
        rows.append(entry)
    return rows


def noise_rows():
    """Seconds of the solver at `LOOSE` and of the white engine at L1 = .01 of the bins of .1, as noise falls."""
    rows = []
    for diffusion in DIFFUSIONS:
        scene = MAIN.varied(noise=WhiteNoise(diffusion))
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            evolution = solve_fpk(scene, cycles=CYCLES, tol=LOOSE)
        bins = np.clip(evolution.bin_probabilities(CYCLES, *EDGES), 0.0, 1.0)
        rate = sampling_rates({"white": (scene, METHODS["white"][1])})["white"]
        paths = SAMPLE * (distances.l1_floor(bins, SAMPLE, math.inf) / WHITE_ERROR) ** 2
        rows.append(
            {"diffusion": diffusion, "seconds": evolution.wall_s, "unknowns": evolution.settings["unknowns"],
             "error_estimate": evolution.error_estimate, "bins_estimate": evolution.bins_error_estimate,
             "warned": bool(caught), "white": paths * rate}
        )  # fmt: skip
    return rows


def horizon_rows():
    """Seconds by number of cycles, and of the one-cycle operator for a million."""
    rows = [{"cycles": k, "seconds": solve_fpk(MAIN, cycles=k, tol=LOOSE).wall_s} for k in HORIZONS]
    operator = medians({"": lambda: CycleOperator(MAIN, tol=LOOSE).survival([10**6])}, rounds=1)[""]
    return [*rows, {"cycles": 10**6, "seconds": operator}]


def peaks():
    """Peak memory of processes that count 50,000 realizations, and of the density solver's, in MB."""
    path = str(ROOT / "cases" / "scenes" / "main.toml")
    commands = {name: [sys.executable, "-c", PEAK, path, name] for name in ("white", "exact", "rk4")}
    held = {
        name: int(subprocess.run(call, capture_output=True, text=True, check=True).stdout) / 1024.0
        for name, call in commands.items()
    }
    return held | {f"density solver at tol {tol:g}": peak_memory(tol) for tol in TOLERANCES}


def main():
    """Measure, and write the section, the picture and the figures as JSON."""
    scenes = {}
    for name, scene in SCENES.items():
        truth = Truth(scene)
        methods = METHODS if name == "main" else {"white": (scene, METHODS["white"][1])}
        scenes[name] = {
            "truth": truth, "solver": solver_rows(scene, truth), "alone": alone_rows(scene, truth),
            "rates": sampling_rates(methods),
            "baseline": baseline_row(truth) if name == "main" else None,
        }  # fmt: skip
        parts = (scenes[name][part] for part in ("solver", "alone", "rates", "baseline"))
        scenes[name]["equal"] = at_equal_error(truth, *parts)
    noise, horizon, memory = noise_rows(), horizon_rows(), peaks()
    plain = {
        name: {k: v for k, v in figures.items() if k != "truth"} | {"unsure": figures["truth"].unsure}
        for name, figures in scenes.items()
    }
    values = {"cycles": CYCLES, "scenes": plain, "noise": noise, "horizon": horizon, "peak_MB": memory}
    write_section(TITLE, body(scenes, noise, horizon, memory), values=values)
    draw(values)


def draw(values):
    """Draw what the JSON file of the section holds, as small as the pictures of the gallery."""
    sys.path.insert(0, str(ROOT / "cases"))
    from gallery import reduce

    errors, growth = (DATA / f"{slug(TITLE)}{part}.png" for part in ("", "_growth"))
    draw_errors(errors, values["scenes"]["main"])
    draw_growth(growth, values["noise"], values["horizon"], LOOSE)
    for picture in (errors, growth):
        reduce(picture, picture)


def body(scenes, noise, horizon, memory):
    """Text of the section."""
    rates, base = scenes["main"]["rates"], scenes["main"]["baseline"]
    truth = scenes["main"]["truth"]
    paths, apart, floor, difference, error = truth.against_paths()
    finest, held = RESOLUTIONS[-1], ", ".join(f"{name} {value:.0f} MB" for name, value in memory.items())
    met, certified = (ratio_range(scenes["main"]["equal"], way) for way in ("whole", "certified"))
    head = ["D", "s", "unknowns", "estimate of S", "estimate of bins", "white, s", "ratio"]
    return f"""**Result**, main scene: sampling takes {met} as long as the density solver for the same error.
Where the solver's own estimate has to certify the error, the range is {certified}.

**Truth.** White noise, {CYCLES} cycles from rest; dS over the cycles, L1 after the tenth. Errors are against the
solver's finest mesh ({finest.angle_cells} × {finest.velocity_cells} cells of degree {finest.degree}). The next finest
differs from it by {truth.unsure["survival"]:.1e} in survival, and by {truth.unsure["coarse"]:.4f} and
{truth.unsure["fine"]:.4f} in L1 on bins of .1 and .025. This difference is added to every error before it may meet a
target. The finest mesh differs from {paths:,} paths by {difference:+.1e} ± {error:.1e} in S(10), and by {apart:.4f} in
L1 on bins of .025, of which sampling explains {floor:.4f}.

**Density solver**, in three ways:

* *call*: the fastest whole call whose measured error meets the target;
* *call that certifies*: the fastest whole call whose own estimate meets it (bins of .025 have no estimate);
* *one run alone*, without estimates: the fastest of {len(ALONE)} resolutions whose measured error meets it.

**Others.** Their times are extrapolated. For a sampler it is the time after which the expected error of its sample
meets the target, from the time of {SAMPLE:,} realizations on both cores
({", ".join(f"{name} {1e6 * rate:.1f}" for name, rate in rates.items())} μs a realization; rk4 has the 200 steps a cycle
of the paper unless said). exact and rk4 sample the band noise itself, whose law is not that of the equivalent white
noise; their times are those for the same error in their own law. The Eulerian baseline, on one core, is extrapolated at
fourth order from {BASELINE.mesh} cells, {base["seconds"]:.0f} s for nine cycles (dS {base["survival"]:.1e}, L1
{base["coarse"]:.4f}, {base["fine"]:.4f}).

Each entry is in seconds. In brackets, for the density solver: what was run, and its error or estimate. In brackets, for
the others: time over that of the call / of the call that certifies / of the run alone.

{table(["scene", "target", "call, s", "call that certifies, s", "one run alone, s", *OTHERS], equal_lines(scenes))}

Peak memory of a process, of which interpreter and libraries take some 200 MB: {held}. The samplers
only count here, so more than 50,000 realizations take the same.

![Error against time](benchmarks/{slug(TITLE)}.png)

![Time against noise and cycles](benchmarks/{slug(TITLE)}_growth.png)

**As noise falls**: seconds of the density solver in the main scene at tol {LOOSE:g}, and of the white engine at L1 =
0.01 on bins of .1 after the tenth cycle (extrapolated). The ratio is white over solver. Where the solver warns that it
misses its tolerance, the two are no longer at equal error. The picture has the white engine at the
solver's own estimate instead.

{table(head, [noise_line(row) for row in noise])}

**As the number of cycles grows**, at tol {LOOSE:g}. The last row is by the one-cycle operator.

{table(["cycles", "s"], [[f"{row['cycles']:,}", f"{row['seconds']:.2f}"] for row in horizon])}
"""


def ratio_range(rows, way):
    """Return the least and the largest time of a sampler over that of the density solver, as text."""
    ratios = [row[method] / row[way]["seconds"] for row in rows if way in row for method in METHODS]
    return f"{min(ratios):.2g} to {max(ratios):,.0f} times"


def equal_lines(scenes):
    """Lines of the table at equal error."""
    lines = []
    for name, figures in scenes.items():
        for row in figures["equal"]:
            own = [row.get(method) for method in ("whole", "certified", "alone")]
            labels = ("tol {how:g}: {error:.1e}", "tol {how:g}: {error:.1e}", "{how}: {error:.1e}")
            cells = [
                f"{entry['seconds']:.2f} ({label.format(**entry)})" if entry else "-"
                for entry, label in zip(own, labels, strict=True)
            ]
            others = []
            for method in OTHERS:
                ratios = [f"{row[method] / e['seconds']:,.3g}" if e else "-" for e in own] if method in row else []
                others.append(f"{row[method]:,.1f} ({' / '.join(ratios)})" if ratios else "-")
            lines.append([name, row["target"], *cells, *others])
    return lines


def noise_line(row):
    """Line of the table over noise."""
    estimates = f"{row['error_estimate']:.1e}", f"{row['bins_estimate']:.3f}{' (warned)' if row['warned'] else ''}"
    ratio = f"{row['white'] / row['seconds']:.1f}"
    own = [f"{row['diffusion']:g}", f"{row['seconds']:.2f}", f"{row['unknowns']:,}"]
    return [*own, *estimates, f"{row['white']:.1f}", ratio]


if __name__ == "__main__":
    if "--redraw" in sys.argv:
        draw(json.loads((DATA / f"{slug(TITLE)}.json").read_text(encoding="utf-8")))
    else:
        main()
