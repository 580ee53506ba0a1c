"""Speed against error on the main scene with white noise, 10 cycles: the density solver beside Monte Carlo.

Errors are against the 10^7 independent paths in tests/data, times are whole calls after a first one that compiles, and
are given as ratios to the first row of the same run.

    python benchmarks/main_scene.py
"""

import pathlib
import time

import numpy as np

from fpk_rocking import load_scene, solve_fpk
from montecarlo import simulate

ROOT = pathlib.Path(__file__).parents[1]
CYCLES = 10


def timed(call):
    """Return the result of a call, and the seconds of a second one."""
    result = call()
    begin = time.perf_counter()
    call()
    return result, time.perf_counter() - begin


def errors(result, reference):
    """Return the largest difference in survival up to 10 cycles, and L1 of the binned density after 4."""
    survival = np.abs(np.asarray(result.survival) - reference["survival"][: CYCLES + 1]).max()
    row = list(reference["cycles"]).index(4)
    bins = result.bin_probabilities(4, reference["angle_edges"], reference["velocity_edges"])
    return survival, np.abs(bins - reference["probabilities"][row]).sum()


def main():
    """Run every row and print the table."""
    scene = load_scene(ROOT / "cases" / "scenes" / "main.toml").white_equivalent()
    reference = np.load(ROOT / "tests" / "data" / "main_white.npz")
    rows = {
        f"density, tol {tol:g}": lambda tol=tol: solve_fpk(scene, cycles=CYCLES, tol=tol) for tol in (1e-2, 1e-3, 1e-4)
    }
    rows |= {
        f"white, {n:,} paths": lambda n=n: simulate(scene, cycles=CYCLES, realizations=n, method="white")
        for n in (10_000, 100_000, 1_000_000)
    }
    print(f"{'':24} {'time':>8} {'max |dS|':>10} {'L1 at 4':>8}")
    unit = None
    for name, call in rows.items():
        result, seconds = timed(call)
        unit = unit or seconds
        survival, distance = errors(result, reference)
        print(f"{name:24} {seconds / unit:8.2f} {survival:10.1e} {distance:8.4f}", flush=True)
    print(f"time 1 = {unit:.2f} s; the reference's own sampling: dS 1.6e-4, L1 .0026")


if __name__ == "__main__":
    main()
