#!/usr/bin/env bash
# VTK: the integral of a field over cells of second order is that of their corners or of a few straight pieces.
#
# One would guess: vtkIntegrateAttributes (ParaView's "Integrate Variables") integrates a density on quadrilaterals of
# nine points with the shape functions of these. The density (9/16) (1 - x^2) (1 - y^2) on one cell has the integral 1.
# What happens: it gives .375 for a biquadratic and .5625 for a Lagrange quadrilateral, which are the same cell, since it
# cuts them into straight pieces, differently. Tessellating before, to any depth, leaves .5625: the middle point times
# the area. On finer meshes the error falls with the square of the size alone. The area itself is right.
# Seen with VTK 9.7.2 through PyVista 0.49.1.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check numpy==2.4.6 pyvista==0.49.1 vtk==9.7.2
cd "$folder"
"$folder/venv/bin/python" - <<'PYTHON'
import numpy as np
import pyvista
import vtk

CORNERS_MIDDLES_CENTRE = [(0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1), (1, 1)]


def density(kind, cells):
    """Mesh of cells x cells of nine points on [-1, 1]^2 that carries the density at its points."""
    own = np.array([np.add(CORNERS_MIDDLES_CENTRE, (2 * i, 2 * j)) for i in range(cells) for j in range(cells)])
    x, y = (own.reshape(-1, 2) / cells - 1.0).T
    rows = np.insert(np.arange(9 * cells**2).reshape(-1, 9), 0, 9, axis=1)
    mesh = pyvista.UnstructuredGrid(rows.ravel(), np.full(cells**2, kind), np.column_stack([x, y, 0.0 * x]))
    mesh.point_data["p"] = 9.0 / 16.0 * (1.0 - x**2) * (1.0 - y**2)
    return mesh


def integral(mesh):
    total = mesh.integrate_data()
    assert abs(total["Area"][0] - 4.0) < 1e-12
    return float(total["p"][0])


print("vtk", vtk.vtkVersion.GetVTKVersion(), "pyvista", pyvista.__version__)
kinds = {"biquadratic": vtk.VTK_BIQUADRATIC_QUAD, "Lagrange": vtk.VTK_LAGRANGE_QUADRILATERAL}
for (name, kind), one in zip(kinds.items(), (0.375, 0.5625), strict=True):
    values = [integral(density(kind, cells)) for cells in (1, 2, 4, 8)]
    fine = integral(density(kind, 1).tessellate(max_n_subdivide=4))
    print(name, "integral of 1, 4, 16, 64 cells:", *np.round(values, 4), "tessellated:", round(fine, 4))
    assert abs(values[0] - one) < 1e-9
    assert abs(fine - 0.5625) < 1e-9
    assert abs((1.0 - values[-2]) / (1.0 - values[-1]) - 4.0) < 0.2
PYTHON
