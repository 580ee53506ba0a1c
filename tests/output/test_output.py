"""Pictures, tables and summaries: what they show, and complete or not there."""

import itertools
import json
import math
import re
import sys

import fakes
import matplotlib.image
import numpy as np
import opengl
import PIL.Image
import pytest

from fpk_rocking import BandNoise, Block, Dimensions, Harmonic, Pulse, Scene
from fpk_rocking.compare import compare
from fpk_rocking.output import figures, report, tables
from fpk_rocking.results import pictures, storage
from fpk_rocking.results.pictures import edges_of
from fpk_rocking.scene.axes import joint_edges

MAIN = Scene(Block(0.5), Harmonic(4.6, 2.7, math.pi), BandNoise(0.04, (0.0, 10.0), 100, "The band was assumed."))
DENSITY = fakes.FakeEvolution(MAIN)
ENSEMBLE = fakes.FakeEnsemble(MAIN, realizations=2_000)


def test_surfaces_of_both_engines(tmp_path, drawn):
    path = figures.surface_figure(tmp_path / "fig06.png", [DENSITY, ENSEMBLE], [0, 2, 4, 10], "Both engines")
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
    texts = [text.get_text() for text in figure.texts]
    assert [line.endswith("noise replaced") for line in texts[1:5]] == [True, False, True, False]
    assert any("Replaced, not checked" in line for line in texts)
    width, height = figure.get_size_inches()
    assert width == pytest.approx(2 * 3.6, abs=0.5)
    for axes in panels:
        assert axes.get_position().height * height == pytest.approx(3.05, rel=0.05)
    middles = {round(axes.get_position().intervaly.mean(), 6) for axes in panels}
    names = [text.get_position()[1] for text in figure.texts if text.get_position()[0] == 0.025]
    assert sorted(names) == pytest.approx(sorted(middles), abs=1e-5)


def test_one_result_is_named_once_beside_all_its_rows(tmp_path, drawn):
    figures.surface_figure(tmp_path / "fig06.png", [DENSITY], [1, 2, 4, 10], "One engine")
    (figure,) = drawn
    (name,) = (text for text in figure.texts if text.get_position()[0] == 0.025)
    assert name.get_text() == f"{DENSITY.label}\nnoise replaced"
    middles = [axes.get_position().intervaly.mean() for axes in figure.axes]
    assert len(middles) == 4
    assert name.get_position()[1] == pytest.approx(np.mean(middles), abs=1e-5)


def test_surface_is_the_mean_over_a_bin():
    angle, velocity, heights = figures._bin_averages(DENSITY, 4)
    place = np.argmin(np.hypot(angle - 0.2, velocity - 0.3))
    x, v = angle.flat[place], velocity.flat[place]
    inside = DENSITY.bin_probabilities(4, [x - 0.05, x + 0.05], [v - 0.05, v + 0.05])[0, 0]
    assert heights.flat[place] == pytest.approx(inside / 0.01, rel=1e-9)


def test_maps_of_both_engines(tmp_path, drawn):
    figures.density_maps(tmp_path / "maps.png", [DENSITY, ENSEMBLE], [2, 4, 10], "Both engines")
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


def test_the_survival_figure_draws_survival_and_differences(tmp_path, drawn):
    white = fakes.FakeEnsemble(MAIN.white_equivalent(), realizations=3_000, method="white")
    figures.survival_figure(tmp_path / "survival.png", [DENSITY, ENSEMBLE, white], "Survival")
    (figure,) = drawn
    survival, tail, leakage, difference = figure.axes
    np.testing.assert_allclose(survival.lines[0].get_ydata(), DENSITY.survival)
    assert tail.get_yscale() == "log"
    assert len(difference.containers) == 2
    np.testing.assert_allclose(difference.containers[0][0].get_ydata(), ENSEMBLE.survival - DENSITY.survival)
    assert leakage.get_ylim()[0] < 0.0 < leakage.get_ylim()[1]
    (legend,) = figure.legends
    handles, names = survival.get_legend_handles_labels()
    assert [text.get_text() for text in legend.get_texts()] == names
    assert len(legend.legend_handles) == len(handles) == 3
    assert [path.name for path in tmp_path.iterdir()] == ["survival.png"]


def test_a_picture_says_what_it_shows_and_so_does_its_file(tmp_path, drawn):
    path = figures.survival_figure(tmp_path / "survival.png", [DENSITY, ENSEMBLE])
    apart = np.abs(ENSEMBLE.survival - DENSITY.survival).max()
    ends = f"{DENSITY.survival[-1]:.3f}, {ENSEMBLE.survival[-1]:.3f}"
    title = f"Survival in the end {ends}; the largest difference is {apart:.2g}"
    assert drawn[0].get_suptitle() == title
    with PIL.Image.open(path) as picture:
        assert picture.info["Title"] == title
    assert pictures.title_size("x" * 10, 10.0) == 15.0
    assert pictures.title_size("x" * 122, 10.0) == 10.0


def test_each_of_several_verdicts_says_what_it_is_on():
    """With one comparison the title tells."""
    white = fakes.FakeEnsemble(MAIN.white_equivalent(), realizations=2_000, method="white", seed=2)
    both = [compare(sample, DENSITY, [2]) for sample in (ENSEMBLE, white)]
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
    values = result.summary()
    assert values["survival"] == pytest.approx(result.survival.tolist())
    assert ("interval" in values) == (result is ENSEMBLE)
    assert ("error_estimate" in values) == (result is DENSITY)


def test_summary_refuses_nan(tmp_path):
    with pytest.raises(ValueError, match="not JSON compliant"):
        storage.write_json(tmp_path / "summary.json", {"survival": math.nan})
    assert list(tmp_path.iterdir()) == []


def test_progress_without_a_terminal_is_a_line_now_and_then(capsys, monkeypatch):
    clock = iter([0.0, 0.5, 1.0, 11.0, 12.0, 30.0])
    monkeypatch.setattr(tables.time, "monotonic", lambda: next(clock))
    with tables.reporting("density") as report:
        for done in (0, 1, 3, 4, 5):
            report(done, 5)
    captured = capsys.readouterr()
    assert captured.err == "density: 60 % after 11 s, about 10 s left\n"
    assert captured.out == ""


def test_progress_in_a_terminal_is_a_bar_on_standard_error(capsys, monkeypatch):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    with tables.reporting("density") as report:
        report(1, 2)
        report(2, 2)
    captured = capsys.readouterr()
    assert "density" in captured.err
    assert captured.out == ""


def test_probe_survives_a_crash_and_names_the_library():
    lines = [f"print('missing {name}', flush=True)" for name in ("libEGL.so.1", "libOSMesa.so.8")]
    rendering = opengl.probe_rendering(program="\n".join([*lines, "import os", "os.kill(os.getpid(), 11)"]))
    assert not rendering.works
    assert rendering.missing == ("libEGL.so.1", "libOSMesa.so.8")
    assert "SIGSEGV" in rendering.reason
    assert "libEGL.so.1" in rendering.reason


@pytest.mark.parametrize("program", ["import time; time.sleep(60.0)", "# longer than an argument may be\n" * 10**6])
def test_probe_never_raises(program):
    rendering = opengl.probe_rendering(1.0, program)
    assert not rendering.works
    assert rendering.reason.startswith("the off-screen rendering probe ")


def test_probe_names_a_missing_package():
    program = "raise ModuleNotFoundError(\"No module named 'pyvista'\")"
    assert "fpk-rocking[view]" in opengl.probe_rendering(program=program).reason


def test_times_after_a_pulse_are_in_seconds_where_the_size_is_known():
    sized = Scene(Block(0.9, Dimensions(0.6, 2.0)), Pulse("one-sine", 1.4, 3.0), BandNoise(0.01, (0.0, 9.0), 20))
    size, times = sized.block.dimensions, np.array([0.0, 2.0, 7.0])
    density = fakes.FakeEvolution(sized, cycles=2, times=times)
    assert density.row_values == pytest.approx(size.seconds(times), rel=1e-15)
    assert (density.row_label, density.when(2)) == ("time, s", f"after {size.seconds(7.0):.4g} s")
    bare = fakes.FakeEvolution(sized.varied(block=Block(0.9)), cycles=2, times=times)
    assert bare.row_values.tolist() == times.tolist()
    assert (bare.row_label, bare.when(2)) == ("time τ", "τ = 7")


def test_a_block_with_a_size_is_shown_in_seconds_and_degrees(capsys, tmp_path):
    scene = Scene(Block(0.9, Dimensions(0.6, 2.0)), Harmonic(1.4, 3.0), BandNoise(0.01, (0.0, 9.0), 20))
    size = scene.block.dimensions
    ensemble = fakes.FakeEnsemble(scene, realizations=500)
    tables.show(*tables.result_table(ensemble))
    first, _, head, _, *rows = capsys.readouterr().out.splitlines()
    last, half = (
        size.seconds(ensemble.times[-1]),
        np.abs(ensemble.survival_interval()[-1] - ensemble.survival[-1]).max(),
    )
    sentence = f"P(overturned) = {1.0 - ensemble.survival[-1]:.4f} ± {half:#.2g} (95 %, sampling), after "
    assert first == f"{sentence}10 cycles ({last:.4g} s)"
    assert head.split()[:3] == ["cycles", "time,", "s"]
    assert float(rows[4].split()[1]) == pytest.approx(size.seconds(ensemble.times[4]), rel=1e-3)
    assert ensemble.table()["time_s"] == pytest.approx(size.seconds(ensemble.times))
    survival, plane = ensemble.plot(cycle=4).axes[:2]
    assert survival.get_xlabel() == "forcing cycles"
    assert (plane.get_xlabel(), plane.get_ylabel()) == ("angle θ, degrees", "velocity, degrees/s")
    (mesh,) = plane.collections
    coordinates = mesh.get_coordinates()
    edges = coordinates[0, :, 0], coordinates[:, 0, 1]
    areas = np.multiply.outer(*map(np.diff, edges))
    unit = math.degrees(size.critical_angle)
    bins = ensemble.bin_probabilities(4, edges[0] / unit, edges[1] / (unit * size.frequency_parameter))
    np.testing.assert_allclose(mesh.get_array(), (bins / areas).T, rtol=1e-9, atol=1e-12)
    report.write_report(tmp_path / "x.html", ensemble, {}, films=[ensemble], scenes=[scene])
    text = (tmp_path / "x.html").read_text(encoding="utf-8")
    film = json.loads(re.search(r"id='film'>(.*?)</script>", text)[1])
    assert film["names"] == ["angle θ, degrees", "velocity, degrees/s"]
    assert film["angle"][-1] == pytest.approx(unit * edges_of([ensemble], [4])[0][-1], rel=0.2)
    assert f"Here the critical angle is {unit:.4g}°, and τ = 1 is {size.seconds(1.0):.4g} s." in text
    assert "<th>time, s</th>" in text
