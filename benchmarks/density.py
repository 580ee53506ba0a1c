"""The density solver: speed against error; writes its section of docs/benchmarks.md.

python benchmarks/density.py            # about 2 minutes
"""

import dataclasses
import math
import subprocess
import sys

import numpy as np
from hard_rows import load
from report import ROOT, medians, table, write_section

from fpk_rocking import load_scene, solve_fpk
from fpk_rocking.base.jit import kernel, run_in_parts
from fpk_rocking.density.propagator import PeriodicPropagator
from fpk_rocking.density.resolution import RESOLUTIONS, USUAL, explore
from fpk_rocking.density.space import velocity_bound
from fpk_rocking.density.tuning import TUNING
from fpk_rocking.results import sampling as distances
from fpk_rocking.scene import WhiteNoise

MAIN = load_scene(ROOT / "cases" / "scenes" / "main.toml").white_equivalent()
WEAK = dataclasses.replace(MAIN, noise=WhiteNoise(2.5e-4))
CYCLES = 10
TOLERANCES = sorted(USUAL, reverse=True)
LOOKED_AT = 1, 2, 4, 10
FINE_EDGES = np.linspace(-1.6, 1.6, 129), np.linspace(-3.2, 3.2, 257)

PEAK = """
import pathlib, sys
from fpk_rocking import load_scene, solve_fpk
solve_fpk(load_scene(sys.argv[1]).white_equivalent(), cycles=10, tol=float(sys.argv[2]))
print(next(line.split()[1] for line in pathlib.Path("/proc/self/status").read_text().splitlines() if "VmHWM" in line))
"""


def run_of(scene, resolution, tol):
    """Solve a scene once at a `Resolution`, with no estimate: its `PeriodicPropagator`, and its solution by cycle."""
    bound, times = velocity_bound(scene, scene.noise.diffusion), scene.period * np.arange(CYCLES + 1)
    adapted = resolution.adapted(scene, bound, explore(scene, times))
    run = PeriodicPropagator(scene, adapted, TUNING.negligible_mass * tol)
    return run, run.propagate(times)


def peak_memory(tol):
    """Peak memory of a process that solves the main scene, in MB; read from /proc, as getrusage keeps the parent's."""
    scene = str(ROOT / "cases" / "scenes" / "main.toml")
    out = subprocess.run([sys.executable, "-c", PEAK, scene, str(tol)], capture_output=True, text=True, check=True)
    return int(out.stdout) / 1024.0


def fine_bins(space, coefficients):
    """Bins of .025 at the cycles that are looked at."""
    return [space.bin_integrals(coefficients[k], *FINE_EDGES) for k in LOOKED_AT]


def main_rows():
    """Rows of the main scene by tolerance: seconds, errors against both references, estimates, size."""
    truth_run, truth = run_of(MAIN, RESOLUTIONS[-1], 1e-4)
    finest = fine_bins(truth_run.space, truth.coefficients)
    reference = np.load(ROOT / "tests" / "data" / "main_white.npz")
    edges, sampled = (reference["angle_edges"], reference["velocity_edges"]), reference["survival"][: CYCLES + 1]
    seconds = medians({tol: lambda tol=tol: solve_fpk(MAIN, cycles=CYCLES, tol=tol) for tol in TOLERANCES}, rounds=3)
    rows, points = [], []
    for tol in TOLERANCES:
        evolution = solve_fpk(MAIN, cycles=CYCLES, tol=tol)
        coarse = [
            distances.l1(evolution.bin_probabilities(int(k), *edges), theirs)
            for k, theirs in zip(reference["cycles"], reference["probabilities"], strict=True)
            if k in LOOKED_AT
        ]
        fine = [
            np.abs(ours - theirs).sum()
            for ours, theirs in zip(fine_bins(evolution.space, evolution.coefficients), finest, strict=True)
        ]
        points.append((seconds[tol], max(fine)))
        rows.append(
            [
                f"{tol:g}", f"{seconds[tol]:.2f}", f"{np.abs(evolution.survival - sampled).max():.1e}",
                f"{np.abs(evolution.survival - truth.survival).max():.1e}", f"{evolution.error_estimate:.1e}",
                " ".join(f"{value:.4f}" for value in coarse), " ".join(f"{value:.4f}" for value in fine),
                f"{evolution.settings['unknowns']:,}", f"{peak_memory(tol):.0f}",
            ]
        )  # fmt: skip
    slope = np.polyfit(*np.log(np.array(points)).T[::-1], 1)[0]
    return rows, slope


def weak_rows():
    """Rows at D = 2.5e-4 against 500,000 paths of the white-noise engine."""
    reference = load()["D = 2.5e-4"]
    standing = reference.standing / reference.paths
    rows = []
    for tol in (1e-2, 1e-3):
        seconds = medians({"": lambda tol=tol: solve_fpk(WEAK, cycles=CYCLES, tol=tol)}, rounds=1)[""]
        evolution = solve_fpk(WEAK, cycles=CYCLES, tol=tol)
        parts = []
        for cycle, counts in zip(reference.binned, reference.counts, strict=True):
            ours = evolution.bin_probabilities(int(cycle), reference.angle_edges, reference.velocity_edges)
            floor = distances.l1_floor(np.clip(ours, 0.0, 1.0), math.inf, int(reference.paths))
            parts.append(f"{distances.l1(ours, counts / reference.paths):.4f} ({floor:.4f})")
        rows.append(
            [f"{tol:g}", f"{seconds:.1f}", f"{np.abs(evolution.survival - standing[: CYCLES + 1]).max():.1e}",
             f"{evolution.error_estimate:.1e}", ", ".join(parts), f"{evolution.settings['unknowns']:,}"]
        )  # fmt: skip
    return rows


@kernel
def copy_part(begin, end, source, target):
    """Copy a part of an array."""
    for k in range(begin, end):
        target[k] = source[k]


def copy_bandwidth():
    """Bandwidth of a copy of a large array, bytes a second."""
    source = np.ones(30_000_000)
    target = np.empty_like(source)
    return 2 * source.nbytes / medians({"copy": lambda: run_in_parts(copy_part, len(source), source, target)})["copy"]


def step_figures(tol=1e-3):
    """Unknowns moved a second by the steps of the last run for a tolerance, bytes and seconds a step."""
    run, solution = run_of(MAIN, RESOLUTIONS[USUAL[tol]], tol)
    density, steps = solution.coefficients[4], run.steps
    seconds = medians({"": lambda: [step.apply(density) for step in steps]})[""] / len(steps)
    moved = 16 * run.space.unknowns + sum(step.nbytes for step in steps) / len(steps)
    return run.space.unknowns / seconds, moved, seconds


def main():
    """Measure, and write the section."""
    rows, slope = main_rows()
    weak = weak_rows()
    bandwidth, (rate, moved, seconds) = copy_bandwidth(), step_figures()
    result = "; ".join(f"tol {tol}, {time} s, {error}" for tol, time, _, error, *_ in rows)
    head = [
        "tol", "s", "dS (10⁷ paths)", "dS (converged)", "estimate", "L1, bins of .1 (10⁷ paths)",
        "L1, bins of .025 (converged)", "unknowns", "peak MB",
    ]  # fmt: skip
    write_section(
        "Density solver: speed against error",
        f"""**Result** (tolerance, seconds, largest error in survival): {result}.
Errors are distances from the finest mesh. The mesh of the last tolerance is hardly coarser (error {rows[-1][3]}), so
smaller errors cannot be resolved.

Main scene with white noise, 10 cycles, from rest. Seconds are those of the whole call, set-up and estimate included:
median of three, on both cores. Errors are against 10⁷ independent paths (sampling alone: dS 1.6e-4, L1 .0014 .0023
.0026 .0020; their D is 0.002π, .04 % above the solver's, which alone makes about 1e-4 in S(10)), and against the
solver's finest resolution, {RESOLUTIONS[-1].angle_cells} × {RESOLUTIONS[-1].velocity_cells} cells of degree
{RESOLUTIONS[-1].degree} ("converged"). L1 is given after 1, 2, 4 and 10 cycles.

{table(head, rows)}

The time goes with the error of the fine bins to the power {slope:.2f}. Memory is the peak of a process that does
nothing else.

The same with D = 2.5e-4, against 500,000 paths, after cycles 2 and 10; in brackets the L1 of sampling alone:

{table(["tol", "s", "dS", "estimate", "L1, bins of .1", "unknowns"], weak)}

**How near to the machine.** A step at tol 1e-3 moves {rate / 1e6:.0f} million unknowns a second, most of them in cells
that hold nothing and are skipped. It takes {seconds * 1e3:.2f} ms, at {moved / seconds / 1e9:.1f} GB/s of prepared
matrices, targets of paths and coefficients (a copy reaches {bandwidth / 1e9:.0f}).
""",
    )


if __name__ == "__main__":
    main()
