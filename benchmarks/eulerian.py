"""An Eulerian baseline: the Fokker-Planck equation of the main scene by upwind DG forms and implicit steps.

Its speed and error beside the density solver's, both against the 10^7 paths in tests/data, and the orders observed.
Every row has a process to itself.

    python benchmarks/eulerian.py          # 2 to 3 minutes; writes its section of docs/benchmarks.md
    python benchmarks/eulerian.py --all    # 12 minutes; the section of the finer meshes as well
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
from fpk_rocking.results import distances

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
    apart = [distances.l1(found, truth) for found, truth in zip(bins, REFERENCE["probabilities"], strict=True)]
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
    survival, bins, gone, defect = [run.mass], [run.bins(EDGES)], np.zeros(3), 0.0
    for cycle in range(2, CYCLES + 1):
        gone += run.cycle()
        survival.append(run.mass)
        defect = max(defect, abs(survival[-1] + gone.sum() - survival[0]))
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
    found = errors(evolution.survival[1:], [evolution.bin_probabilities(cycle, *EDGES) for cycle in BINNED])
    steps, unknowns = evolution.settings["steps"], f"{density.space.unknowns:,}"
    return [
        f"density solver, tol {tol:g}", mesh, density.degree, steps, unknowns, *3 * [""], f"{cpu:.1f}", f"{wall:.1f}",
        memory(), *found,
    ]  # fmt: skip


def save_truth(path):
    """Write two cycles of the density solver, for the baseline to begin with and to be held against."""
    solve_fpk(SCENE, cycles=2, tol=TRUTH).save(path)


def alone(call, *arguments):
    """Return what a call returns in a process of its own."""
    with concurrent.futures.ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        return pool.submit(call, *arguments).result()


def compared(rows, truth):
    """Run rows of the baseline and the density solver; return the table, and a remark on balance and iterations."""
    runs = []
    for row in rows:
        runs.append(alone(baseline, row, truth))
        print(*runs[-1], flush=True)
    lines, defects, iterations = zip(*runs, strict=True)
    lines += tuple(alone(density_solver, tol) for tol in TOLS)
    least, most = min(iterations), max(iterations)
    remark = f"Balance of mass kept to {max(defects):.0e}; {least:.0f} to {most:.0f} iterations of GMRES a step."
    return table(COLUMNS, lines), remark


def write_rows(truth):
    """Run the quick rows and the orders, and write their section."""
    lines, remark = compared(ROWS, truth)
    meshes, mesh_order = alone(finer_meshes, truth)
    write_section(
        "Eulerian baseline",
        f"""The Fokker-Planck equation of the main scene with white noise on a mesh that stays where it is: finite
elements in both variables and implicit steps, as usual since Spencer and Bergman (1993, Nonlinear Dynamics 4, 357).
For comparison only (`benchmarks/eulerian_operator.py`, `benchmarks/eulerian_steps.py`).

Space: discontinuous, on tensor meshes graded like the density solver's; upwind fluxes across lines of the angle, local
Lax-Friedrichs fluxes and interior penalty across those of the velocity. Impact: what flows out of one side of x = 0 at
v flows into the other at e v. Time: Crank-Nicolson, or Gauss's method of two stages as one complex solve with the mean
force of the step. Linear solver: GMRES to {TOLERANCE:.0e}, preconditioned by inverted blocks of the cells.

A start at rest has no density on a mesh, so the baseline begins at the end of cycle 1 with the density solver's at tol
{TRUTH:g}: its L1 at 1 cycle is that of its mesh alone, and its times are those of the nine cycles that follow. The
density solver's are those of a whole call of ten cycles with its error estimate. dS is the largest error in survival,
L1 that of the bins of 0.1, against 10⁷ paths (sampling alone: 1.6e-4; .0014 .0023 .0026 .0020). Seconds of CPU:
assembly, inverted blocks, steps, and all; then seconds of the wall clock, where the baseline has one core and the
density solver two. Memory: the most that the process had, some 120 MB of it interpreter and libraries.

{lines}

{remark}

**Orders**, after one cycle from that start, against the density solver at tol {TRUTH:g}. Degree 3, Gauss; the order in
the mesh, fitted to the bins of 0.025, is {mesh_order:.1f}.

{table(["mesh", "steps a cycle", "dS", "L1, bins of 0.1", "L1, bins of 0.025"], meshes)}

16 × 28 cells of degree 3, against {CONVERGED} steps a cycle, bins of 0.025:

{table(["method", "steps a cycle", "L1", "order"], alone(shorter_steps, truth))}

**Alternatives tried**, on 24 × 40 cells of degree 3. Sparse LU factors instead of GMRES, kept for the 96 phases of half
a cycle: 0.2 s and 64 MB each, and no faster over ten cycles. One factor as preconditioner: twice the iterations of the
blocks when it is a quarter of a cycle away. Explicit Runge-Kutta steps of order 4: stable with 1,270 a cycle, that is
5,080 products with the matrix, of which GMRES takes 3,300. SDIRK of order 4 with 32 steps a cycle, 160 solves, was off
twice as much as Gauss with 64.
""",
    )


def write_finer_rows(truth):
    """Run the slow rows and write their section."""
    lines, remark = compared(FINER, truth)
    write_section(
        "Eulerian baseline: finer meshes",
        f"""As above, with the meshes of the density solver (`python benchmarks/eulerian.py --all`).

{lines}

{remark}
""",
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
