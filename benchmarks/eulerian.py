"""An Eulerian baseline: the Fokker-Planck equation of the main scene by upwind DG forms and implicit steps.

Its speed and error beside the density solver's, both against the 10^7 paths in tests/data, and the orders observed.
Every row has a process to itself.

    python benchmarks/eulerian.py          # 2 to 3 minutes; writes its tables into docs/benchmarks
    python benchmarks/eulerian.py --all    # 12 minutes; the table of the finer meshes as well
"""

import concurrent.futures
import multiprocessing
import os
import pathlib
import resource
import sys
import tempfile
import time

import numpy as np
from eulerian_runs import CONVERGED, EDGES, REFERENCE, SCENE, Row, Run, finer_meshes, shorter_steps
from eulerian_steps import CRANK_NICOLSON, TOLERANCE
from report import table, write_section

from fpk_rocking import solve_fpk
from fpk_rocking.density.evolution import Evolution
from fpk_rocking.results import sampling as distances

CYCLES, BINNED = 10, (1, 2, 4, 10)
TRUTH, TOLS = 1e-4, (1e-2, 1e-3)
COLUMNS = [
    "", "mesh", "degree", "steps a cycle", "unknowns", "assembly", "blocks", "steps", "all", "wall", "memory", "dS",
    "L1 at 1, 2, 4, 10 cycles",
]  # fmt: skip


ROWS = [
    Row(40, 64, 1, 256, CRANK_NICOLSON),
    Row(16, 28, 3, 512, CRANK_NICOLSON),
    Row(16, 28, 3, 128),
    Row(24, 40, 3, 192),
]
FINER = [Row(24, 40, 3, 1024, CRANK_NICOLSON), Row(32, 56, 3, 320), Row(44, 80, 3, 448)]


def errors(survival, bins):
    """Return the largest error in survival after 1 cycle or more, and L1 of the bins, as text."""
    apart = [distances.l1(binned, truth) for binned, truth in zip(bins, REFERENCE["probabilities"], strict=True)]
    largest = np.abs(np.asarray(survival) - REFERENCE["survival"][1 : CYCLES + 1]).max()
    return [f"{largest:.1e}", " ".join(f"{value:.4f}" for value in apart)]


def memory():
    """Return the most memory that this process has had, as text."""
    return f"{resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MB"


def baseline(row, truth):
    """Run the baseline from the end of cycle 1.

    Parameters
    ----------
    row : Row
    truth : pathlib.Path
        A saved evolution to begin with.

    Returns
    -------
    cells : list
        Its line in the table.
    defect : float
        The largest defect of its balance of mass.
    iterations : float
        Of the linear solver a step.
    """
    start = Evolution.load(truth).at(1)
    wall, cpu = time.perf_counter(), time.process_time()
    run = Run(row, start)
    survival, bins, outflow, defect = [run.mass], [run.bins(EDGES)], np.zeros(3), 0.0
    for cycle in range(2, CYCLES + 1):
        outflow += run.cycle()
        survival.append(run.mass)
        defect = max(defect, abs(survival[-1] + outflow.sum() - survival[0]))
        if cycle in BINNED:
            bins.append(run.bins(EDGES))
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    seconds = run.assembly, run.march.seconds, cpu - run.assembly - run.march.seconds, cpu, wall
    cells = [
        row.scheme.name, row.mesh, row.degree, row.steps, f"{run.density.size:,}",
        *(f"{value:.1f}" for value in seconds), memory(), *errors(survival, bins),
    ]  # fmt: skip
    return cells, defect, run.march.iterations / (row.steps * (CYCLES - 1))


def density_solver(tol):
    """Run the density solver from the start; return the cells of its line in the table."""
    solve_fpk(SCENE, cycles=1, tol=tol)  # compiles
    wall, cpu = time.perf_counter(), time.process_time()
    evolution = solve_fpk(SCENE, cycles=CYCLES, tol=tol)
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    density = evolution.at(1)
    mesh = " × ".join(str(len(lines) - 1) for lines in density.mesh_lines)
    distances = errors(evolution.survival[1:], [evolution.bin_probabilities(cycle, *EDGES) for cycle in BINNED])
    steps, unknowns = evolution.settings["steps"], f"{density.space.unknowns:,}"
    return [
        f"density solver, tol {tol:g}", mesh, density.degree, steps, unknowns, *3 * [""], f"{cpu:.1f}", f"{wall:.1f}",
        memory(), *distances,
    ]  # fmt: skip


def save_truth(path):
    """Write two cycles of the density solver, for the baseline to begin with and to be held against."""
    solve_fpk(SCENE, cycles=2, tol=TRUTH).save(path)


def alone(call, *arguments):
    """Return what a call returns in a process of its own."""
    with concurrent.futures.ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        return pool.submit(call, *arguments).result()


def compared(rows, truth):
    """Run rows of the baseline and the density solver; return the table, a remark on the balance, and the result."""
    runs = []
    for row in rows:
        runs.append(alone(baseline, row, truth))
        print(*runs[-1], flush=True)
    lines, defects, iterations = zip(*runs, strict=True)
    best, ours = lines[-1], [alone(density_solver, tol) for tol in TOLS]
    cpu, error = (COLUMNS.index(name) for name in ("all", "dS"))
    result = (
        f"**Result.** The density solver at tol {TOLS[0]:g} takes {ours[0][cpu]} s and errs by {ours[0][error]} in "
        f"survival. The finest run of the baseline takes {best[cpu]} s and errs by {best[error]}."
    )
    lines += tuple(ours)
    least, most = min(iterations), max(iterations)
    remark = f"Balance of mass kept to {max(defects):.0e}; {least:.0f} to {most:.0f} iterations of GMRES a step."
    return table(COLUMNS, lines), remark, result


def write_rows(truth):
    """Run the quick rows and the orders, and write their section."""
    lines, remark, result = compared(ROWS, truth)
    meshes, mesh_order = alone(finer_meshes, truth)
    write_section(
        "Eulerian baseline",
        f"""{result}

The baseline solves the Fokker-Planck equation of the main scene with white noise in the usual way (since Spencer and
Bergman 1993, Nonlinear Dynamics 4, 357): finite elements in both variables on a fixed mesh, and implicit steps. It
exists for comparison only (`benchmarks/eulerian_operator.py`, `benchmarks/eulerian_steps.py`).

* Space: discontinuous elements on tensor meshes graded like the density solver's. Fluxes are upwind across lines of the
  angle, and local Lax-Friedrichs with interior penalty across those of the velocity.
* Impact: what flows out of one side of x = 0 at v flows into the other at e v.
* Time: Crank-Nicolson, or Gauss's method of two stages as one complex solve with the mean force of the step.
* Linear solver: GMRES to {TOLERANCE:.0e}, preconditioned by inverted blocks of the cells.

A start at rest has no density on a mesh. The baseline therefore begins at the end of cycle 1 with the density that the
solver finds at tol {TRUTH:g}. So its L1 at 1 cycle is that of its mesh alone, and its times are those of the nine
cycles that follow. The times of the density solver are those of a whole call of ten cycles with its error estimate.
Errors are against 10⁷ paths (sampling alone: dS 1.6e-4, L1 .0014 .0023 .0026 .0020); bins of 0.1. Times are seconds of
CPU for assembly, inverted blocks, steps, and all; then seconds of the wall clock, where the baseline has one core and
the density solver two. Memory is the peak of the process, of which interpreter and libraries take some 120 MB.

{lines}

{remark}

**Orders**, after one cycle from that start, against the density solver at tol {TRUTH:g}. Degree 3, Gauss. The order in
the mesh, fitted to L1 of the bins of 0.025, is {mesh_order:.1f}.

{table(["mesh", "steps a cycle", "dS", "L1, bins of 0.1", "L1, bins of 0.025"], meshes)}

The order in the step, on 16 × 28 cells of degree 3, against {CONVERGED} steps a cycle; L1 of bins of 0.025:

{table(["method", "steps a cycle", "L1", "order"], alone(shorter_steps, truth))}

**Alternatives tried**, on 24 × 40 cells of degree 3:

* Sparse LU factors instead of GMRES, kept for the 96 phases of half a cycle: 0.2 s and 64 MB each, and no faster over
  ten cycles.
* One such factor as preconditioner: twice as many iterations as with the blocks when it is a quarter of a cycle away.
* Explicit Runge-Kutta steps of order 4: stable with 1,270 steps a cycle. That is 5,080 products with the matrix a
  cycle, where GMRES needs 3,300.
* SDIRK of order 4 with 32 steps a cycle (160 solves): twice the error of Gauss with 64.
""",
        page=None,
    )


def write_finer_rows(truth):
    """Run the slow rows and write their section."""
    lines, remark, result = compared(FINER, truth)
    write_section(
        "Eulerian baseline: finer meshes",
        f"""{result}

The baseline of the section "Eulerian baseline", which explains the columns, on the meshes that the density solver takes
(`python benchmarks/eulerian.py --all`).

{lines}

{remark}
""",
        page=None,
    )


def main():
    """Write the section, and with --all that of the finer meshes."""
    # The vectors are too short for threads, which would wait for each other; read by the processes of the rows.
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    with tempfile.TemporaryDirectory() as folder:
        truth = pathlib.Path(folder) / "truth.npz"
        alone(save_truth, truth)
        write_rows(truth)
        if "--all" in sys.argv[1:]:
            write_finer_rows(truth)


if __name__ == "__main__":
    main()
