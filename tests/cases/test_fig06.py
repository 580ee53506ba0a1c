"""The case of Fig. 6, re-run coarse, and the viewer of what it writes."""

import json
import os
import pathlib
import subprocess
import sys

import fakes
import matplotlib.image
import meshio
import numpy as np
import opengl
import pytest

from fpk_rocking.output import vtk

CASES = pathlib.Path(__file__).parents[2] / "cases"


@pytest.fixture(scope="module")
def coarse(case, tmp_path_factory):
    """Folder and summary of a coarse run."""
    folder = tmp_path_factory.mktemp("fig06")
    return folder, case("fig06_jpdf_evolution").run(folder, cycles=(0, 2, 4), realizations=10_000, tol=5e-3, seed=5)


def test_survival_of_both(coarse):
    """Against 2·10⁶ independent paths; 4.5 standard errors of 10,000 realizations are a false alarm of 1e-5 each."""
    _, values = coarse
    assert values["density"]["survival"][2] == pytest.approx(0.9976, abs=1e-3)
    assert values["density"]["survival"][4] == pytest.approx(0.8670, abs=1.5e-3)
    error = np.sqrt(0.8670 * 0.1330 / 10_000)
    assert values["paths"]["survival"][4] == pytest.approx(0.8670, abs=4.5 * error)


def test_paths_lie_at_the_sampling_floor_of_the_density(coarse):
    """The ratio to the floor, 25 seeds: L1 1.05 ± 0.10, Hellinger 1.03 ± 0.06. The bounds are four deviations away."""
    compared = coarse[1]["paths_against_density"]
    assert compared["joint_cycles"] == [2, 4]
    assert np.all(np.array(compared["l1"]) < 1.45 * np.array(compared["l1_floor"]))
    assert np.all(np.array(compared["hellinger"]) < 1.27 * np.array(compared["hellinger_floor"]))


def test_its_files_hold_numbers_and_pictures(coarse):
    folder, values = coarse
    ends = (".pvd", "_0000.vtu", "_0002.vtu", "_0004.vtu")
    series = {f"{name}{end}" for name in ("jpdf", "jpdf_paths") for end in ends}
    others = {"fig06.png", "maps.png", "survival.png", "summary.json"}
    assert {path.name for path in folder.iterdir()} == series | others
    assert json.loads((folder / "summary.json").read_text(encoding="utf-8")) == values
    assert any("inferred from its Figs" in remark for remark in values["remarks"])
    for picture in ("fig06.png", "maps.png", "survival.png"):
        pixels = matplotlib.image.imread(folder / picture)[..., :3]
        assert min(pixels.shape[:2]) > 400
        assert np.unique((255 * pixels[::4, ::4]).astype(int).reshape(-1, 3), axis=0).shape[0] > 100


def test_density_file_holds_the_survival(coarse):
    folder, values = coarse
    for cycle in (2, 4):
        mesh = meshio.read(folder / f"jpdf_{cycle:04d}.vtu")
        quads = mesh.cells_dict["quad"]
        sides = mesh.points[quads[:, 2], :2] - mesh.points[quads[:, 0], :2]
        integral = mesh.cell_data_dict["density"]["quad"] @ sides.prod(axis=1)
        assert integral == pytest.approx(values["density"]["survival"][cycle], abs=1e-10)


@pytest.fixture(scope="module")
def series(main_scene, tmp_path_factory):
    folder = tmp_path_factory.mktemp("series")
    vtk.write_series(folder, "jpdf", fakes.FakeEvolution(main_scene), [0, 2, 4])
    return folder


def works():
    return opengl.Rendering(True, (), "")


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="elsewhere there is a display")
def test_viewer_without_a_display_says_what_to_do(series, case, monkeypatch, capsys):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    assert case("view").main([str(series)], works) == 1
    message = capsys.readouterr().err
    assert "--screenshot" in message
    assert "ParaView" in message


def test_viewer_without_opengl_names_the_library(series, case, capsys):
    missing = opengl.Rendering(False, ("libEGL.so.1",), "OpenGL library not found: libEGL.so.1")
    assert case("view").main([str(series), "--screenshot", "none.png"], lambda: missing) == 1
    message = capsys.readouterr().err
    assert "libEGL.so.1" in message
    assert "ParaView" in message


def test_viewer_names_what_is_missing(tmp_path, series, case, capsys):
    view = case("view").main
    assert view([str(tmp_path)], works) == 1
    assert "jpdf.pvd" in capsys.readouterr().err
    assert view([str(series), "--cycle", "3", "--screenshot", "none.png"], works) == 1
    assert "--cycle: got 3, accepted: 0, 2, 4" in capsys.readouterr().err


@pytest.mark.slow
def test_viewer_takes_a_picture_or_says_why_not(tmp_path, series):
    """In a process of its own, for VTK would end this one without OpenGL; which it is, the probe of rendering knows."""
    picture = tmp_path / "density.png"
    command = [sys.executable, CASES / "view.py", series, "--cycle", "4", "--screenshot", picture]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False, env=dict(os.environ))
    assert "Traceback" not in done.stderr
    rendering = opengl.probe_rendering()
    if rendering.works:
        assert done.returncode == 0
        pixels = matplotlib.image.imread(picture)
        assert pixels.shape[:2] == (900, 1200)
        assert pixels.std() > 0.05
    else:
        assert done.returncode == 1
        assert rendering.reason in done.stderr
        assert not picture.exists()
