"""Joint densities as a VTK time series: one .vtu file a row and a .pvd file that lists them by time.

Every file has, for points and cells, ``density`` (per unit angle and velocity; of a cell, its mean) and, for cells,
``probability`` (their sum is the survival) and ``element_density``, the mean over the finite element or the bin that
the cell is a part of: point values of a discontinuous solution are much rougher than its means. The plane is z = 0 and
left to the viewer to warp. No two elements share points, so both sides of x = 0, and of every other line where the
density jumps, are there. Field data: ``cycle``, ``tau``, ``survival``, ``overturned_left``, ``overturned_right``,
``cut_off``.

``element_density`` is what a viewer shows first, as the active scalars of the file. Point values are those of a
polynomial in each element, which may swing far below 0 and above the density where it is steep: of the main scene after
4 cycles they run from -10 to 18 where the means run from -.8 to 9. All are values as computed; the files of a density
also have ``negative_mass``, the largest over its cycles.
"""

import pathlib
from collections.abc import Sequence
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import File
from fpk_rocking.results.storage import replaced_atomically, write_text
from fpk_rocking.results.survival import SurvivalResult
from fpk_rocking.scene.axes import joint_edges

__all__ = ["write_function", "write_series"]

_SHOWN = "element_density"
"""Name of the array that a viewer shows first."""


def write_series(
    folder: File, name: str, result: SurvivalResult, cycles: Sequence[float] | None = None
) -> pathlib.Path:
    """Write the joint density of angle and velocity after each of some cycles as VTK files, for ParaView for example.

    A density is written on its own mesh; each cell is cut into as many pieces a side as its polynomial degree, so that
    the values at the points determine the polynomial. A sample is written as a histogram. A start from a point has no
    density: its file holds an empty mesh and one vertex of probability 1.

    Parameters
    ----------
    folder : path
        Created if missing.
    name : str
        First part of the names of files: ``<name>.pvd``, ``<name>_0000.vtu``, ... with the number of the row.
    result : SurvivalResult
    cycles : sequence of int or float, optional
        Each is written once; by default all rows are.

    Returns
    -------
    pathlib.Path
        The .pvd file, which lists the others. It is written last.

    Examples
    --------
    >>> from fpk_rocking import load_scene, solve_fpk
    >>> from fpk_rocking.output.vtk import write_series
    >>> density = solve_fpk(load_scene("main"), cycles=4, tol=1e-2)
    >>> print(write_series("vtk", "main", density, cycles=[1, 4]).name)
    main.pvd
    """
    checks.instance("result", result, SurvivalResult)
    folder, entries = pathlib.Path(folder), []
    rows = range(len(result.times)) if cycles is None else [result.row_of(cycle, "cycles") for cycle in cycles]
    for row in dict.fromkeys(rows):  # a row is one file, and one entry, however often it is named
        file = folder / f"{name}_{row:04d}.vtu"
        _write_mesh(file, _mesh_of_row(result, row), _field_values(result, row))
        entries.append((float(result.times[row]), file.name))
    listing = folder / f"{name}.pvd"
    write_text(listing, _collection(entries))
    return listing


def write_function(file: File, function: Any, name: str) -> pathlib.Path:
    """Write a `Density`, or a `PlaneMap`, on its mesh as a VTK file; returns its path.

    Parameters
    ----------
    file : path
        With the suffix .vtu; its folder is created if missing.
    function : Density or PlaneMap
    name : str
        Name of its values in the file.

    Examples
    --------
    >>> from fpk_rocking import load_scene, solve_fpk
    >>> from fpk_rocking.output.vtk import write_function
    >>> density = solve_fpk(load_scene("main"), cycles=4, tol=1e-2)
    >>> print(write_function("density.vtu", density.at(4), "density"))
    density.vtu
    """
    pieces = max(function.degree, 1)
    lines = [np.linspace(values[:-1], values[1:], pieces + 1, axis=1) for values in function.mesh_lines]
    points, quads = _lattice_mesh(*lines)
    import meshio

    values = np.ascontiguousarray(function.cell_values(pieces + 1)).ravel()
    with replaced_atomically(file) as temporary:
        meshio.Mesh(points, [("quad", quads)], point_data={name: values}).write(temporary, file_format="vtu")
    return pathlib.Path(file)


def _mesh_of_row(result, row):
    """Mesh with the density of a row: the solver's, a histogram of a sample, or the cell of a point start."""
    if row == 0 and result.scene.start.covariance is None:
        return _mesh_of_point(result.scene)
    cycle = result.cycle_of(row)
    return _mesh_of_density(result.at(cycle)) if result.realizations is None else _mesh_of_histogram(result, cycle)


def _mesh_of_density(law):
    """Mesh of a `Density` with point values and cell means; an element has as many pieces a side as its degree."""
    pieces = max(law.degree, 1)
    # Interpolated as linspace does, both ends of a cell are the mesh lines themselves, x = 0 among them.
    lines = [np.linspace(values[:-1], values[1:], pieces + 1, axis=1) for values in law.mesh_lines]
    # The solver's own bin integrals on the pieces give their exact means; a mean of corner values would not.
    edges = [np.append(values[:, :-1].ravel(), values[-1, -1]) for values in lines]
    shape = (len(lines[0]), pieces, len(lines[1]), pieces)
    probability = np.asarray(law.bin_probabilities(*edges)).reshape(shape).swapaxes(1, 2)
    return _mesh_of_lattices(*lines, np.asarray(law.cell_values(pieces + 1)), probability)


def _mesh_of_histogram(sample, cycle):
    """Mesh of the bins of a sample, with the density at points and cells, and the probability in cells."""
    edges = joint_edges(sample.scene)
    probability = np.asarray(sample.bin_probabilities(cycle, *edges))
    lines = [np.stack([values[:-1], values[1:]], axis=-1) for values in edges]
    heights = probability / np.multiply.outer(*map(np.diff, edges))
    values = np.broadcast_to(heights[:, :, None, None], (*heights.shape, 2, 2))
    return _mesh_of_lattices(*lines, values, probability[:, :, None, None])


def _mesh_of_lattices(angle, velocity, values, probability):
    """Mesh of separate lattices, one an element: n_angle by n_velocity elements of n by n points.

    Lines `angle` (n_angle, n) and `velocity` (n_velocity, n); densities at points, `values` (n_angle, n_velocity, n,
    n); `probability` (n_angle, n_velocity, n - 1, n - 1) in cells.
    """
    points, quads = _lattice_mesh(angle, velocity)
    areas = np.diff(angle)[:, None, :, None] * np.diff(velocity)[None, :, None, :]
    within = (2, 3)
    element = probability.sum(axis=within, keepdims=True) / areas.sum(axis=within, keepdims=True)
    cell_data = {
        _SHOWN: [np.broadcast_to(element, probability.shape).ravel()],
        "density": [(probability / areas).ravel()],
        "probability": [probability.ravel()],
    }
    return _meshio_mesh(points, [("quad", quads)], values.ravel(), cell_data)


def _lattice_mesh(angle, velocity):
    """Points (p, 3) and quadrilaterals (q, 4) of separate lattices, one an element; lines as of `_mesh_of_lattices`."""
    shape = (len(angle), len(velocity), angle.shape[1], velocity.shape[1])
    points = np.zeros((np.prod(shape), 3))
    points[:, 0] = np.broadcast_to(angle[:, None, :, None], shape).ravel()
    points[:, 1] = np.broadcast_to(velocity[None, :, None, :], shape).ravel()
    index = np.arange(len(points)).reshape(shape)
    corners = (index[..., :-1, :-1], index[..., 1:, :-1], index[..., 1:, 1:], index[..., :-1, 1:])
    return points, np.stack([corner.ravel() for corner in corners], axis=-1)


def _mesh_of_point(scene):
    """Mesh, empty but for one vertex of probability 1, for a scene whose start is a point."""
    cut_off, bound = scene.overturning.angle, joint_edges(scene)[1][-1]
    corners = [
        corner
        for low, high in ((-cut_off, 0.0), (0.0, cut_off))
        for corner in ((low, -bound, 0.0), (high, -bound, 0.0), (high, bound, 0.0), (low, bound, 0.0))
    ]
    points = np.array([*corners, (scene.start.angle, scene.start.velocity, 0.0)])
    cells = [("quad", np.arange(8).reshape(2, 4)), ("vertex", np.array([[8]]))]
    zeros = [np.zeros(2), np.zeros(1)]
    cell_data = {_SHOWN: zeros, "density": zeros, "probability": [np.zeros(2), np.ones(1)]}
    return _meshio_mesh(points, cells, np.zeros(9), cell_data)


def _meshio_mesh(points, cells, values, cell_data):
    """Mesh with the density at the points (p, 3) and fields of the cells, a list of arrays for each type."""
    import meshio

    return meshio.Mesh(points, cells, point_data={"density": np.array(values)}, cell_data=cell_data)


def _field_values(result, row) -> dict[str, float]:
    """Field data of the file of a row."""
    left, right = result.overturned[row]
    fields = {} if result.realizations else {"negative_mass": result.negative_mass}
    return fields | {
        "cycle": result.cycle_of(row),
        "tau": result.times[row],
        "survival": result.survival[row],
        "overturned_left": left,
        "overturned_right": right,
        "cut_off": result.scene.overturning.angle,
    }


def _write_mesh(file, mesh, fields):
    """Write a mesh with field data to a .vtu file, whole or not at all."""
    with replaced_atomically(file) as temporary:
        mesh.write(temporary, file_format="vtu")
        # meshio reads field data of a .vtu file but does not write it.
        grid = "<UnstructuredGrid>"
        text = temporary.read_text(encoding="utf-8").replace(grid, grid + _field_data(fields), 1)
        # Nor which array is the active one: a viewer would show the first of the points.
        text = text.replace("<CellData>", f'<CellData Scalars="{_SHOWN}">', 1)
        temporary.write_text(text, encoding="utf-8")


def _field_data(fields) -> str:
    """XML element of field data."""
    head = '<DataArray type="Float64" NumberOfTuples="1" format="ascii"'
    arrays = (f'{head} Name="{name}">{float(value)!r}</DataArray>' for name, value in fields.items())
    return f"<FieldData>{''.join(arrays)}</FieldData>"


def _collection(entries) -> str:
    """Text of a .pvd file that lists pairs of time τ and file name."""
    lines = "".join(
        f'    <DataSet timestep="{time!r}" group="" part="0" file={quoteattr(file)}/>\n' for time, file in entries
    )
    head = '<VTKFile type="Collection" version="0.1" byte_order="LittleEndian">'
    return f'<?xml version="1.0"?>\n{head}\n  <Collection>\n{lines}  </Collection>\n</VTKFile>\n'
