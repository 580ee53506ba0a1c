"""Every method's time at equal error, and how the density solver's grows; a section of docs/benchmarks.md.

Also docs/benchmarks/equal_error.json and .png.

python benchmarks/equal_error.py            # about 5 minutes
"""

import json
import math
import subprocess
import sys
import time
import warnings

import numpy as np
from density import CYCLES, FINE_EDGES, MAIN, TOLERANCES, run_of
from eulerian_runs import EDGES, Row
from eulerian_runs import Run as Baseline
from fine_reference import load
from report import PAGE, ROOT, medians, table, write_section

from fpk_rocking import CycleOperator, distances, load_scene, solve_fpk
from fpk_rocking.density.resolution import LADDER
from fpk_rocking.output import style
from fpk_rocking.scene import WhiteNoise
from fpk_rocking.storage import write_text
from montecarlo import simulate

SCENES = {"main": MAIN, "second": load_scene(ROOT / "cases" / "scenes" / "second.toml")}
BAND = load_scene(ROOT / "cases" / "scenes" / "main.toml")
METHODS = {"white": MAIN, "exact": BAND, "rk4": BAND}
TARGETS = {"L1 = 0.01, bins of .1": ("coarse", 0.01), "L1 = 0.01, bins of .025": ("fine", 0.01),
           "dS = 5e-4": ("survival", 5e-4), "dS = 1e-4": ("survival", 1e-4)}  # fmt: skip
OTHERS = "white", "exact", "rk4", "Eulerian"
SAMPLE = 50_000
DIFFUSIONS = 0.05, 0.02, 0.00628, 0.0025, 6.3e-4, 2.5e-4, 6.3e-5, 2.5e-5
HORIZONS = 10, 40, 200
BINS = {"coarse": EDGES, "fine": FINE_EDGES}
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


class Truth:
    """Survival and last bins of a scene on the solver's finest mesh."""

    def __init__(self, scene):
        run, solution = run_of(scene, len(LADDER) - 1, 1e-4)
        self.survival = solution.inside
        last = solution.coefficients[CYCLES]
        self.bins = {name: run.space.bin_integrals(last, *edges) for name, edges in BINS.items()}

    def errors(self, survival, bins):
        """Errors by kind: the largest in survival, and L1 after the last cycle."""
        apart = {name: distances.l1(bins(edges), self.bins[name]) for name, edges in BINS.items()}
        return {"survival": float(np.abs(survival - self.survival).max())} | apart

    def sampled(self, count):
        """Return the expected errors of a sample: that of survival is the standard error where it is largest."""
        worst = float(np.sqrt(self.survival * (1.0 - self.survival)).max())
        laws = {name: np.clip(bins, 0.0, 1.0) for name, bins in self.bins.items()}
        floors = {name: distances.l1_floor(law, count, math.inf) for name, law in laws.items()}
        return {"survival": worst / math.sqrt(count)} | floors

    def against_paths(self):
        """L1 on fine bins against the tracked paths, and what their sampling alone explains."""
        kept = load()
        apart = distances.l1(self.bins["fine"], kept.bins / kept.paths)
        return apart, distances.l1_floor(np.clip(self.bins["fine"], 0.0, 1.0), kept.paths, math.inf), kept.paths

    def paths(self, kind, error):
        """Realizations that a sample needs for an expected error."""
        low, high = 1.0, 1e15
        while high > 1.0001 * low:
            middle = math.sqrt(low * high)
            low, high = (middle, high) if self.sampled(middle)[kind] > error else (low, middle)
        return high


def solver_rows(scene, truth):
    """Seconds and errors of the density solver by tolerance."""
    seconds = medians({tol: lambda tol=tol: solve_fpk(scene, cycles=CYCLES, tol=tol) for tol in TOLERANCES}, rounds=3)
    rows = {}
    for tol in TOLERANCES:
        found = solve_fpk(scene, cycles=CYCLES, tol=tol)
        errors = truth.errors(found.survival, lambda edges, found=found: found.bin_probabilities(CYCLES, *edges))
        rows[tol] = {"seconds": seconds[tol]} | errors
    return rows


def sampling_rates(methods):
    """Seconds a realization by method, in turns."""
    calls = {
        name: lambda name=name, scene=scene: simulate(scene, cycles=CYCLES, realizations=SAMPLE, method=name)
        for name, scene in methods.items()
    }
    return {name: seconds / SAMPLE for name, seconds in medians(calls, rounds=3).items()}


def baseline_row(truth):
    """Seconds and errors of the Eulerian baseline, from the solver's density after a cycle."""
    start = solve_fpk(MAIN, cycles=1, tol=1e-4)
    run, survival = None, np.array(truth.survival)

    def whole():
        nonlocal run
        run = Baseline(BASELINE, start.at(1))
        for k in range(2, CYCLES + 1):
            run.cycle()
            survival[k] = run.mass

    begin = time.perf_counter()
    whole()
    return {"seconds": time.perf_counter() - begin} | truth.errors(survival, run.bins)


def at_equal_error(truth, solver, rates, baseline=None):
    """Rows of seconds at each target: the cheapest tolerance that meets it, sampling extrapolated, ratios."""
    rows = []
    for name, (kind, error) in TARGETS.items():
        meeting = [tol for tol in TOLERANCES if solver[tol][kind] <= error]
        if not meeting:
            continue
        tol = meeting[0]
        own = solver[tol]["seconds"]
        entry = {"target": name, "tol": tol, "seconds": own, "error": solver[tol][kind]}
        for method, rate in rates.items():
            entry[method] = truth.paths(kind, error) * rate
        if baseline:
            # Fourth order in the mesh, steps in proportion: cost as the third power of the size, error as the fourth.
            entry["Eulerian"] = baseline["seconds"] * (baseline[kind] / error) ** 0.75
        rows.append(entry)
    return rows


def noise_rows():
    """Seconds of the solver at tol 1e-2 and of the white engine at L1 = .01 of the bins of .1, as noise falls."""
    rows = []
    for diffusion in DIFFUSIONS:
        scene = MAIN.varied(noise=WhiteNoise(diffusion))
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            found = solve_fpk(scene, cycles=CYCLES, tol=1e-2)
        bins = np.clip(found.bin_probabilities(CYCLES, *EDGES), 0.0, 1.0)
        rate = sampling_rates({"white": scene})["white"]
        paths = SAMPLE * (distances.l1_floor(bins, SAMPLE, math.inf) / 0.01) ** 2
        rows.append(
            {"diffusion": diffusion, "seconds": found.wall_s, "unknowns": found.settings["unknowns"],
             "error_estimate": found.error_estimate, "warned": bool(caught), "white": paths * rate}
        )  # fmt: skip
    return rows


def horizon_rows():
    """Seconds by number of cycles, and of the one-cycle operator for a million."""
    rows = [{"cycles": k, "seconds": solve_fpk(MAIN, cycles=k, tol=1e-2).wall_s} for k in HORIZONS]
    operator = medians({"": lambda: CycleOperator(MAIN, tol=1e-2).survival([10**6])}, rounds=1)[""]
    return [*rows, {"cycles": 10**6, "seconds": operator}]


def peaks():
    """Peak memory of processes that sample 50,000 realizations, in MB."""
    path = str(ROOT / "cases" / "scenes" / "main.toml")
    calls = {name: [sys.executable, "-c", PEAK, path, name] for name in METHODS}
    return {
        name: int(subprocess.run(call, capture_output=True, text=True, check=True).stdout) / 1024.0
        for name, call in calls.items()
    }


def draw(path, scenes):
    """Errors against seconds: the solver's measured, sampling as lines from the measured rate."""
    with style.page(path, (11.0, 4.8), "Error against time, 10 cycles") as figure:
        axes = figure.subplots(1, 3)
        found = scenes["main"]
        kinds = (("survival", "largest error in survival"), ("coarse", "L1 of the density, bins of .1"),
                 ("fine", "L1 of the density, bins of .025"))  # fmt: skip
        for ax, (kind, label) in zip(axes, kinds, strict=True):
            own = found["solver"].values()
            columns = [[row[name] for row in own] for name in ("seconds", kind)]
            ax.plot(*columns, "D-", color="black", label="density solver")
            for (method, rate), colour in zip(found["rates"].items(), style.COLOURS, strict=False):
                counts = np.geomspace(1e4, 1e8, 20)
                errors = [found["truth"].sampled(count)[kind] for count in counts]
                ax.plot(counts * rate, errors, color=colour, label=f"Monte Carlo {method}")
            place = found["baseline"]["seconds"], found["baseline"][kind]
            ax.plot(*place, "s", color="#777777", label="Eulerian baseline")
            ax.set(xscale="log", yscale="log", xlabel="seconds, 2 cores", ylabel=label, xlim=(0.1, 5000.0))
        axes[0].legend(fontsize=8)


def main():
    """Measure, and write the section, the picture and the figures as JSON."""
    scenes = {}
    for name, scene in SCENES.items():
        truth = Truth(scene)
        methods = METHODS if name == "main" else {"white": scene}
        scenes[name] = {
            "truth": truth, "solver": solver_rows(scene, truth), "rates": sampling_rates(methods),
            "baseline": baseline_row(truth) if name == "main" else None,
        }  # fmt: skip
        parts = (scenes[name][part] for part in ("solver", "rates", "baseline"))
        scenes[name]["equal"] = at_equal_error(truth, *parts)
    noise, horizon, memory = noise_rows(), horizon_rows(), peaks()
    folder = PAGE.parent / "benchmarks"
    folder.mkdir(exist_ok=True)
    draw(folder / "equal_error.png", scenes)
    kept = {name: {k: v for k, v in found.items() if k != "truth"} for name, found in scenes.items()}
    values = {"cycles": CYCLES, "scenes": kept, "noise": noise, "horizon": horizon, "peak_MB": memory}
    write_text(folder / "equal_error.json", json.dumps(values, indent=1) + "\n")
    write_section("Time at equal error", body(scenes, noise, horizon, memory))


def body(scenes, noise, horizon, memory):
    """Text of the section."""
    rates, base = scenes["main"]["rates"], scenes["main"]["baseline"]
    apart, floor, paths = scenes["main"]["truth"].against_paths()
    finest, held = LADDER[-1], ", ".join(f"{name} {value:.0f} MB" for name, value in memory.items())
    return f"""White noise, 10 cycles from rest, both cores. Errors against the solver's finest mesh
({finest.angle_cells} × {finest.velocity_cells} cells of degree {finest.degree}), which {paths:,} paths confirm: L1
{apart:.4f} on bins of .025, of which sampling explains {floor:.4f}. dS is the largest in survival over the cycles,
L1 after the tenth. The density solver's seconds are those of a whole call with its error estimates, at the largest
tolerance that met the target. Sampling is **extrapolated** from the time of {SAMPLE:,} realizations (white
{rates["white"] * 1e6:.1f}, exact {rates["exact"] * 1e6:.1f}, rk4 with 200 steps a cycle {rates["rk4"] * 1e6:.1f} μs)
by the expected error of a sample; exact and rk4 sample band noise, so theirs is the time to know their own law as well.
The Eulerian baseline is **extrapolated** at fourth order from {BASELINE.mesh} cells, {base["seconds"]:.0f} s for nine
cycles (dS {base["survival"]:.1e}, L1 {base["coarse"]:.4f}, {base["fine"]:.4f}).
In brackets: time over that of the density solver.

{table(["scene", "target", "density solver, s", *OTHERS], equal_lines(scenes))}

Peak memory of {SAMPLE:,} counted realizations: {held}.

![Error against time](benchmarks/equal_error.png)

**As noise falls**: main scene at tol 1e-2; the white engine at L1 = 0.01 of the bins of .1 after the tenth cycle
(extrapolated), and its time over the solver's.

{table(["D", "s", "unknowns", "error estimate", "white, s", "ratio"], [noise_line(row) for row in noise])}

**As the horizon grows**, tol 1e-2; the last row is the one-cycle operator's.

{table(["cycles", "s"], [[f"{row['cycles']:,}", f"{row['seconds']:.2f}"] for row in horizon])}
"""


def equal_lines(scenes):
    """Lines of the table at equal error."""
    lines = []
    for name, found in scenes.items():
        for row in found["equal"]:
            own = f"{row['seconds']:.2f} (tol {row['tol']:g}: {row['error']:.1e})"
            others = [f"{row[m]:,.1f} ({row[m] / row['seconds']:,.0f})" if m in row else "-" for m in OTHERS]
            lines.append([name, row["target"], own, *others])
    return lines


def noise_line(row):
    """Line of the table over noise."""
    estimate = f"{row['error_estimate']:.1e}{' (warned)' if row['warned'] else ''}"
    ratio = f"{row['white'] / row['seconds']:.1f}"
    own = [f"{row['diffusion']:g}", f"{row['seconds']:.2f}", f"{row['unknowns']:,}"]
    return [*own, estimate, f"{row['white']:.1f}", ratio]


if __name__ == "__main__":
    main()
