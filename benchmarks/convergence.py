"""Draw how the density's error falls with the mesh, from the tables that other benchmarks keep in docs/benchmarks.

python benchmarks/convergence.py
"""

import json
import math

import numpy as np
from report import DATA

from fpk_rocking.results import pictures

CYCLES = (1, 2, 4, 10)
WIDTHS = ("0.1", "0.025")
FINEST = 44  # cells of an axis from which on the order is fitted: coarser meshes do not resolve the density


def main():
    """Draw docs/benchmarks/convergence.png."""
    (table,) = json.loads((DATA / "density_solver_mesh_nodes_and_orders.json").read_text(encoding="utf-8"))["tables"]
    draw(DATA / "convergence.png", table)


def draw(path, table):
    """Draw the L1 error of the bins over the unknowns of an axis, a panel for each width of the bins.

    Parameters
    ----------
    path : path
        Picture to write.
    table : dict
        ``columns`` and ``rows`` of the table of meshes.
    """
    columns = table["columns"]
    meshes = [dict(zip(columns, row, strict=True)) for row in table["rows"]]
    unknowns = np.array([_unknowns(mesh["cells, degree"]) for mesh in meshes])
    fine = [int(mesh["cells, degree"].split()[0]) >= FINEST for mesh in meshes]
    errors = {width: np.array([_numbers(mesh[f"L1, bins of {width}"]) for mesh in meshes]) for width in WIDTHS}
    slope = np.polyfit(np.log(unknowns[fine]), np.log(errors["0.025"][fine][:, -1]), 1)[0]
    title = f"The error of the density after {CYCLES[-1]} cycles falls like the unknowns of an axis to the {slope:.1f}"
    note = (
        "Main scene, white noise; meshes from before version 0.3. L1: sum of |difference| of the probabilities in "
        "bins, from a finer mesh (116 × 196 cells of degree 4). Points of one mesh differ in quadrature and steps. "
        "Impacts limit the order."
    )
    with pictures.page(path, (10.0, 4.8), title, [note]) as figure:
        for axes, width in zip(figure.subplots(1, 2, sharey=True), WIDTHS, strict=True):
            for after, cycle, colour in zip(errors[width].T, CYCLES, pictures.COLOURS, strict=True):
                some = after > 0.0
                axes.plot(unknowns[some], after[some], "o", color=colour, label=f"after cycle {cycle}")
            axes.set(xscale="log", yscale="log", xlabel="unknowns of an axis (root of those of the mesh)")
            axes.set_xticks([60, 100, 200, 400], ["60", "100", "200", "400"])
            axes.set_xticks([], minor=True)
            axes.set_title(f"bins of {width}")
        figure.axes[0].set_ylabel("L1 error of the density")
        figure.axes[0].legend(loc="lower left", fontsize=9)


def _unknowns(mesh):
    """Root of the unknowns of a mesh written as in "32 × 56, 3": cells by cells, degree."""
    cells, degree = mesh.split(", ")
    across, along = map(int, cells.split(" × "))
    return math.sqrt(across * along) * int(degree)


def _numbers(text):
    """Entries of a cell of the table as numbers."""
    return [float(entry) for entry in text.split()]


if __name__ == "__main__":
    main()
