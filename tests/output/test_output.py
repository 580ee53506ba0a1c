"""Pictures, tables and summaries: what they show, and complete or not there."""

import itertools
import math
import subprocess
import sys

import fakes
import matplotlib.image
import numpy as np
import opengl
import pytest

from fpk_rocking import BandNoise, Block, Harmonic, Scene
from fpk_rocking.compare import compare
from fpk_rocking.output import curves, maps, progress, style, summary, surfaces, tables
from fpk_rocking.results.binning import joint_edges

MAIN = Scene(Block(0.5), Harmonic(4.6, 2.7, math.pi), BandNoise(0.04, (0.0, 10.0), 100, "The band was assumed."))
DENSITY = fakes.FakeEvolution(MAIN)
ENSEMBLE = fakes.FakeEnsemble(MAIN, realizations=2_000)


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
    assert any("The band was assumed." in text.get_text() for text in figure.texts)


def test_surface_is_the_mean_over_a_bin():
    angle, velocity, heights = surfaces._surface(DENSITY, 4)
    place = np.argmin(np.hypot(angle - 0.2, velocity - 0.3))
    x, v = angle.flat[place], velocity.flat[place]
    inside = DENSITY.bin_probabilities(4, [x - 0.05, x + 0.05], [v - 0.05, v + 0.05])[0, 0]
    assert heights.flat[place] == pytest.approx(inside / 0.01, rel=1e-9)


def test_maps_of_both_engines(tmp_path, drawn):
    maps.density_maps(tmp_path / "maps.png", [DENSITY, ENSEMBLE], [2, 4, 10], "Both engines")
    (figure,) = drawn
    panels, bars = figure.axes[:6], figure.axes[6:]
    assert len(bars) == 3
    edges = joint_edges(MAIN)
    for axes, (result, cycle) in zip(panels, itertools.product([DENSITY, ENSEMBLE], [2, 4, 10]), strict=True):
        (image,) = axes.collections
        bins = result.bin_probabilities(cycle, *edges)
        area = np.outer(*map(np.diff, edges))
        np.testing.assert_allclose(image.get_array(), (bins / area).T)
        assert axes.get_title().startswith(f"{cycle} cycles: survival {result.survival[cycle]:.3f}")
        low, high = axes.get_ylim()
        inside = (edges[1][:-1] >= low - 1e-9) & (edges[1][1:] <= high + 1e-9)
        assert bins[:, inside].sum() > 0.999 * bins.sum()
    for above, below in zip(panels[:3], panels[3:], strict=True):
        assert above.collections[0].get_clim() == below.collections[0].get_clim()


def test_survival_figure(tmp_path, drawn):
    white = fakes.FakeEnsemble(MAIN.white_equivalent(), realizations=3_000, method="white")
    curves.survival_figure(tmp_path / "survival.png", [DENSITY, ENSEMBLE, white], "Survival")
    (figure,) = drawn
    survival, tail, leakage, difference = figure.axes
    np.testing.assert_allclose(survival.lines[0].get_ydata(), DENSITY.survival)
    assert tail.get_yscale() == "log"
    assert len(difference.containers) == 2
    np.testing.assert_allclose(difference.containers[0][0].get_ydata(), ENSEMBLE.survival - DENSITY.survival)
    assert leakage.get_ylim()[0] < 0.0 < leakage.get_ylim()[1]
    assert [path.name for path in tmp_path.iterdir()] == ["survival.png"]


def test_each_of_several_verdicts_says_what_it_is_on():
    """With one comparison the title tells."""
    white = fakes.FakeEnsemble(MAIN.white_equivalent(), realizations=2_000, method="white", seed=2)
    both = [compare(one, DENSITY, [2]) for one in (ENSEMBLE, white)]
    sentences = tables.comparison_table(both)[2]
    for sentence, name, compared in zip(sentences[:2], ("rk4", "white"), both, strict=True):
        assert sentence == f"Monte Carlo {name} against Fokker-Planck density, {compared.trust}"
    assert tables.comparison_table(both[:1])[2][0] == str(both[0].trust)


def test_comparison_table_is_plain_in_a_pipe(capsys):
    tables.show(*tables.comparison_table([compare(ENSEMBLE, DENSITY, [2, 10])]))
    printed = capsys.readouterr().out
    assert "\x1b" not in printed
    assert max(map(len, printed.splitlines())) <= 100
    rows = [line.split() for line in printed.splitlines()]
    assert ["2", "Fokker-Planck", "density", "0.8100"] in rows
    assert any(row[:4] == ["Monte", "Carlo", "rk4", f"{ENSEMBLE.survival[10]:.4f}"] for row in rows)
    assert "The band was assumed." in printed
    assert "impact loss M = 0.3750; deviation σ_M = 0.1121 by the noise, margin" in " ".join(printed.split())
    assert " = +0.7404, phase flux Φ = 0.18804." in " ".join(printed.split())


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
    assert captured.err == "density: 50 % after 11 s, about 20 s left\n"
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
