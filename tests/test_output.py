"""Files and pictures: read back by other programs, and complete or not there."""

import dataclasses
import math
import subprocess
import sys
import xml.etree.ElementTree as ET

import fakes
import matplotlib.image
import meshio
import numpy as np
import pytest
import pyvista

from fpk_rocking import BandNoise, Block, Forcing, Scene, Start
from fpk_rocking.compare import compare
from fpk_rocking.output import curves, opengl, progress, style, summary, surfaces, tables, vtk

MAIN = Scene(Block(0.5), Forcing(4.6, 2.7, math.pi), BandNoise(0.04, (0.0, 10.0), 100))
DENSITY = fakes.FakeEvolution(MAIN)
ENSEMBLE = fakes.FakeEnsemble(MAIN, realizations=2_000)


def areas(points, quads):
    """Half the cross product of the diagonals: positive where the corners run anticlockwise."""
    first, second = (points[quads[:, end], :2] - points[quads[:, start], :2] for start, end in ((0, 2), (1, 3)))
    return 0.5 * (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])


def test_density_file_read_by_meshio(tmp_path):
    vtk.write_series(tmp_path, "jpdf", DENSITY, [4])
    mesh = meshio.read(tmp_path / "jpdf_0004.vtu")
    quads, law = mesh.cells_dict["quad"], DENSITY.at(4)
    # 8 x 10 elements of degree 3: 3 x 3 pieces each, 4 x 4 points of its own.
    assert (len(quads), len(mesh.points)) == (80 * 9, 80 * 16)
    area = areas(mesh.points, quads)
    assert area.min() > 0.0
    # Cell means integrate to what the mesh covers of the survival, exactly; velocities end at 4.
    covered = DENSITY.bin_probabilities(4, [-2.0, 2.0], [-4.0, 4.0]).sum()
    assert mesh.cell_data_dict["density"]["quad"] @ area == pytest.approx(covered, rel=1e-12)
    assert mesh.cell_data_dict["probability"]["quad"].sum() == pytest.approx(covered, rel=1e-12)
    by_element = mesh.cell_data_dict["element_density"]["quad"].reshape(80, 9)
    probability = mesh.cell_data_dict["probability"]["quad"].reshape(80, 9).sum(axis=1)
    expected = probability / area.reshape(80, 9).sum(axis=1)
    np.testing.assert_allclose(by_element, np.repeat(expected[:, None], 9, axis=1), rtol=1e-9)
    away = mesh.points[:, 0] != 0.0
    x, v, z = mesh.points[away].T
    np.testing.assert_allclose(mesh.point_data["density"][away], law(x, v), rtol=1e-12)
    assert np.all(z == 0.0)
    fields = {name: float(value[0]) for name, value in mesh.field_data.items()}
    assert fields["cycle"] == 4.0
    assert fields["tau"] == 4.0 * MAIN.period
    assert fields["survival"] == DENSITY.survival[4]
    assert (fields["overturned_left"], fields["overturned_right"]) == tuple(DENSITY.overturned[4])


def test_both_sides_of_upright_are_kept(tmp_path):
    vtk.write_series(tmp_path, "jpdf", DENSITY, [1])
    mesh, law = meshio.read(tmp_path / "jpdf_0001.vtu"), DENSITY.at(1)
    corners = mesh.points[mesh.cells_dict["quad"]]
    used = np.unique(mesh.cells_dict["quad"])
    assert used.size == len(mesh.points)
    for side, inside in enumerate((corners[:, :, 0].mean(axis=1) < 0.0, corners[:, :, 0].mean(axis=1) > 0.0)):
        mine = mesh.cells_dict["quad"][inside].ravel()
        upright = mine[mesh.points[mine, 0] == 0.0]
        expected = law.on_side(side, 0.0, mesh.points[upright, 1])
        np.testing.assert_allclose(mesh.point_data["density"][upright], expected, rtol=1e-12)


def test_series_read_by_pyvista(tmp_path):
    listing = vtk.write_series(tmp_path, "jpdf", DENSITY, [0, 1, 10])
    entries = [entry.attrib for entry in ET.parse(listing).iter("DataSet")]
    assert [entry["file"] for entry in entries] == ["jpdf_0000.vtu", "jpdf_0001.vtu", "jpdf_0010.vtu"]
    reader = pyvista.get_reader(listing)
    assert reader.time_values == [0.0, MAIN.period, 10.0 * MAIN.period]
    reader.set_active_time_value(10.0 * MAIN.period)
    mesh = reader.read()[0]
    sized = mesh.compute_cell_sizes(length=False, volume=False)
    covered = DENSITY.bin_probabilities(10, [-2.0, 2.0], [-4.0, 4.0]).sum()
    assert sized.cell_data["Area"] @ sized.cell_data["density"] == pytest.approx(covered, rel=1e-12)
    assert mesh.field_data["cycle"][0] == 10.0


def test_point_start_is_one_vertex_of_probability_one(tmp_path):
    scene = dataclasses.replace(MAIN, start=Start(0.2, -0.1))
    vtk.write_series(tmp_path, "jpdf", fakes.FakeEvolution(scene), [0])
    mesh = meshio.read(tmp_path / "jpdf_0000.vtu")
    (vertex,) = mesh.cells_dict["vertex"].ravel()
    assert mesh.points[vertex].tolist() == [0.2, -0.1, 0.0]
    assert mesh.cell_data_dict["probability"]["vertex"].tolist() == [1.0]
    assert mesh.cell_data_dict["probability"]["quad"].sum() == 0.0


def test_histogram_of_an_ensemble(tmp_path):
    vtk.write_series(tmp_path, "jpdf_rk4", ENSEMBLE, [2])
    mesh = meshio.read(tmp_path / "jpdf_rk4_0002.vtu")
    quads = mesh.cells_dict["quad"]
    heights = mesh.cell_data_dict["density"]["quad"]
    assert heights @ areas(mesh.points, quads) == pytest.approx(ENSEMBLE.survival[2], rel=1e-12)
    np.testing.assert_allclose(mesh.point_data["density"][quads], np.repeat(heights[:, None], 4, axis=1), rtol=1e-12)


def test_interrupted_series_leaves_whole_files_and_no_listing(tmp_path, monkeypatch):
    write = meshio.Mesh.write

    def interrupted(mesh, path, **options):
        write(mesh, path, **options)
        if "0002" in path.name:
            raise KeyboardInterrupt

    monkeypatch.setattr(meshio.Mesh, "write", interrupted)
    with pytest.raises(KeyboardInterrupt):
        vtk.write_series(tmp_path, "jpdf", DENSITY, [1, 2, 4])
    assert [path.name for path in tmp_path.iterdir()] == ["jpdf_0001.vtu"]


@pytest.fixture
def drawn(monkeypatch):
    """The figures that were saved."""
    figures, save = [], style.save

    def keep(figure, path):
        figures.append(figure)
        return save(figure, path)

    monkeypatch.setattr(style, "save", keep)
    return figures


def test_surfaces_of_both_engines(tmp_path, drawn):
    path = surfaces.surface_figure(tmp_path / "fig06.png", [DENSITY, ENSEMBLE], [0, 2, 4, 10], "Both engines")
    pixels = matplotlib.image.imread(path)
    assert pixels.shape[0] > 800
    (figure,) = drawn
    panels = figure.axes
    assert len(panels) == 8
    for axes in panels:
        written = [text.get_text() for text in axes.texts]
        # One surface and two walls, or the needle of the start and two walls.
        start = axes.get_title().startswith("start")
        assert len(axes.collections) == (2 if start else 3)
        assert ("probability 1 at one point" in written) == start
    titles = [axes.get_title() for axes in panels]
    assert f"10 cycles: survival {ENSEMBLE.survival[10]:.3f}" in titles
    after_four = [axes for axes in panels if axes.get_title().startswith("4 cycles")]
    assert after_four[0].get_zlim() == after_four[1].get_zlim()
    assert f"{DENSITY.overturned[4, 0]:.3f}" in [text.get_text() for text in after_four[0].texts]
    assert any("inferred by this project" in text.get_text() for text in figure.texts)


def test_surface_is_the_mean_over_a_bin():
    angle, velocity, heights = surfaces._surface(DENSITY, 4)
    place = np.argmin(np.hypot(angle - 0.2, velocity - 0.3))
    x, v = angle.flat[place], velocity.flat[place]
    inside = DENSITY.bin_probabilities(4, [x - 0.05, x + 0.05], [v - 0.05, v + 0.05])[0, 0]
    assert heights.flat[place] == pytest.approx(inside / 0.01, rel=1e-9)


def test_survival_figure(tmp_path, drawn):
    white = fakes.FakeEnsemble(MAIN.white_equivalent(), realizations=3_000, method="white")
    curves.survival_figure(tmp_path / "survival.png", [DENSITY, ENSEMBLE, white], "Survival")
    (figure,) = drawn
    survival, tail, difference, leakage = figure.axes
    np.testing.assert_allclose(survival.lines[0].get_ydata(), DENSITY.survival)
    assert tail.get_yscale() == "log"
    assert len(difference.containers) == 2
    np.testing.assert_allclose(difference.containers[0][0].get_ydata(), ENSEMBLE.survival - DENSITY.survival)
    assert leakage.get_ylim()[0] < 0.0 < leakage.get_ylim()[1]
    assert [path.name for path in tmp_path.iterdir()] == ["survival.png"]


def test_comparison_table_is_plain_in_a_pipe(capsys):
    tables.show(*tables.comparison_table([compare(ENSEMBLE, DENSITY, [2, 10])]))
    printed = capsys.readouterr().out
    assert "\x1b" not in printed
    assert max(map(len, printed.splitlines())) <= 100
    rows = [line.split() for line in printed.splitlines()]
    assert ["2", "Fokker-Planck", "density", "0.8100"] in rows
    assert any(row[:4] == ["Monte", "Carlo", "rk4", f"{ENSEMBLE.survival[10]:.4f}"] for row in rows)
    assert "inferred by this project" in printed


@pytest.mark.parametrize("result", [DENSITY, ENSEMBLE])
def test_result_table_and_summary(capsys, result):
    tables.show(*tables.result_table(result))
    printed = capsys.readouterr().out
    assert f"{result.survival[7]:.5f}" in printed
    values = summary.result_summary(result)
    assert values["survival"] == pytest.approx(result.survival.tolist())
    assert ("interval" in values) == (result is ENSEMBLE)
    assert ("error_estimate" in values) == (result is DENSITY)


def test_summary_refuses_nan(tmp_path):
    with pytest.raises(ValueError, match="not JSON compliant"):
        summary.write_summary(tmp_path / "summary.json", {"survival": math.nan})
    assert list(tmp_path.iterdir()) == []


def test_progress_without_a_terminal_is_a_line_now_and_then(capsys, monkeypatch):
    clock = iter([0.0, 1.0, 11.0, 12.0, 30.0])
    monkeypatch.setattr(progress.time, "monotonic", lambda: next(clock))
    with progress.reporting("density") as report:
        for done in (1, 2, 3, 4):
            report(done, 4)
    captured = capsys.readouterr()
    assert captured.err == "density: 50 % after 11 s\n"
    assert captured.out == ""


def test_progress_in_a_terminal_is_a_bar_on_standard_error(capsys, monkeypatch):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    with progress.reporting("density") as report:
        report(1, 2)
        report(2, 2)
    captured = capsys.readouterr()
    assert "density" in captured.err
    assert captured.out == ""


def test_probe_survives_a_crash_and_names_the_library(monkeypatch):
    crashed = subprocess.CompletedProcess([], -11, "missing libEGL.so.1\nmissing libOSMesa.so.8\n", "noise\n")
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: crashed)
    rendering = opengl.probe_rendering()
    assert not rendering.works
    assert rendering.missing == ("libEGL.so.1", "libOSMesa.so.8")
    assert "SIGSEGV" in rendering.reason
    assert "libEGL.so.1" in rendering.reason


@pytest.mark.parametrize("error", [subprocess.TimeoutExpired("probe", 60.0), OSError("no more processes")])
def test_probe_never_raises(monkeypatch, error):
    def fail(*_, **__):
        raise error

    monkeypatch.setattr(subprocess, "run", fail)
    rendering = opengl.probe_rendering()
    assert not rendering.works
    assert rendering.reason


def test_probe_names_a_missing_package(monkeypatch):
    failed = subprocess.CompletedProcess([], 1, "", "ModuleNotFoundError: No module named 'pyvista'\n")
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: failed)
    assert "fpk-rocking[view]" in opengl.probe_rendering().reason
