"""Every line, band, bar and colour of a picture is the array of the result that it stands for."""

import math

import made_results
import meshio
import motion
import numpy as np
import pytest
from made_results import SAMPLES, WITH_ROWS, equal, kind
from matplotlib.figure import Figure
from scipy.interpolate import RegularGridInterpolator

from fpk_rocking.output import figures, vtk
from fpk_rocking.risk.picture import draw_surface
from montecarlo.poincare import MeanMap
from montecarlo.results.statistics import Histogram


def band(collection):
    """Lower and upper limits of a filled band at its places, in their order."""
    vertices = collection.get_paths()[0].vertices
    places = np.unique(vertices[:, 0])
    heights = [vertices[vertices[:, 0] == place, 1] for place in places]
    return places, np.array([height.min() for height in heights]), np.array([height.max() for height in heights])


def bars(container):
    """Lower and upper ends of error bars."""
    segments = np.array(container[2][0].get_segments())
    return segments[:, 0, 1], segments[:, 1, 1]


@pytest.mark.parametrize("name", WITH_ROWS)
def test_pictures_of_survival_and_bins(name):
    result, columns, _, _ = kind(name)
    figure = result.plot(cycle=97)
    axes, plane = figure.axes[:2]
    x = columns["time"] if result.scene.period is None else columns["cycle"]
    error = getattr(result, "error_estimate", math.nan)
    low, high = columns["survival"] - error, columns["survival"] + error
    if name in SAMPLES:
        low, high = columns["survival_low"], columns["survival_high"]
    (line,), (filled,) = axes.lines, axes.collections
    equal(line.get_xydata(), np.stack([x, columns["survival"]], axis=1))
    for drawn, wanted in zip(band(filled), (x, low, high), strict=True):
        equal(drawn, wanted)
    (mesh,) = plane.collections
    coordinates = mesh.get_coordinates()
    edges = coordinates[0, :, 0], coordinates[:, 0, 1]
    areas = np.multiply.outer(*map(np.diff, edges))
    equal(mesh.get_array(), (result.bin_probabilities(97, *edges) / areas).T)
    assert plane.get_title().endswith(f"survival {columns['survival'][97]:.4f}")


def test_pictures_of_survival_and_leakage_of_several_results(tmp_path, drawn):
    density, sample = kind("density"), kind("ensemble")
    figures.survival_figure(tmp_path / "survival.png", [density.result, sample.result], "Survival")
    survival, tail, leakage, difference = drawn[0].axes
    for axes in (survival, tail):
        equal(axes.lines[0].get_ydata(), density.columns["survival"])
        equal(axes.containers[0][0].get_ydata(), sample.columns["survival"])
        for ends, wanted in zip(bars(axes.containers[0]), ("survival_low", "survival_high"), strict=True):
            equal(ends, sample.columns[wanted])
    for place, columns in enumerate((density.columns, sample.columns)):
        above, below = (leakage.lines[2 * place + k] for k in (0, 1))
        equal(above.get_ydata(), np.diff(columns["overturned_right"]))
        equal(below.get_ydata(), -np.diff(columns["overturned_left"]))
    wanted = kind("comparison").columns
    equal(difference.containers[0][0].get_ydata(), wanted["difference"])
    equal(bars(difference.containers[0])[1], wanted["difference"] + 1.96 * wanted["standard_error"])
    figures.density_maps(tmp_path / "maps.png", [density.result, sample.result], [2, 140], "Maps")
    for axes, (columns, row) in zip(
        drawn[1].axes, ((result.columns, row) for result in (density, sample) for row in (2, 140)), strict=False
    ):
        left, right = columns["overturned_left"][row], columns["overturned_right"][row]
        assert " ".join(axes.get_title().split()).endswith(f"overturned left {left:.3f}, right {right:.3f}")


def test_pictures_of_a_comparison():
    result, columns, _, _ = kind("comparison")
    survival, difference = result.plot().axes
    error = result.error_estimate[1]
    second = columns["survival_second"]
    for which, (name, low, high) in enumerate(
        (
            ("survival_first", columns["survival_first_low"], columns["survival_first_high"]),
            ("survival_second", second - error, second + error),
        )
    ):
        equal(survival.lines[which].get_ydata(), columns[name])
        for drawn, wanted in zip(band(survival.collections[which])[1:], (low, high), strict=True):
            equal(drawn, wanted)
    equal(difference.containers[0][0].get_ydata(), columns["difference"])
    for ends, sign in zip(bars(difference.containers[0]), (-1.0, 1.0), strict=True):
        equal(ends, columns["difference"] + sign * 1.96 * columns["standard_error"])


def test_pictures_of_splitting_and_histories():
    result, columns, _, _ = kind("splitting")
    (axes,) = result.plot().axes
    equal(axes.containers[0][0].get_xdata(), columns["cycle"][1:])
    equal(axes.containers[0][0].get_ydata(), columns["probability"][1:])
    for ends, sign in zip(bars(axes.containers[0]), (-2.0, 2.0), strict=True):
        equal(ends, (columns["probability"] + sign * columns["standard_error"])[1:])
    result, _, variables, places = kind("histories")
    angles, plane = result.plot(4).axes
    for number in range(4):
        states = [variables[variable][1][number] for variable in ("angle", "velocity")]
        equal(angles.lines[number].get_xydata(), np.stack([places["time"], states[0]], axis=1))
        equal(plane.lines[number].get_xydata(), np.stack(states, axis=1))


@pytest.mark.parametrize("name", ["fragility", "fragility by density"])
def test_pictures_of_curves(name):
    result, _, variables, places = kind(name)
    arrays = {variable: values for variable, (_, values) in variables.items()}
    for m, axes in enumerate(result.plot().axes):
        assert len(axes.containers) == 3
        for which, container in enumerate(axes.containers):
            computed = np.isfinite(arrays["probability"][m, which])
            equal(container[0].get_xdata(), places["scale"][computed])
            equal(container[0].get_ydata(), arrays["probability"][m, which, computed])
            for ends, end in zip(bars(container), ("low", "high"), strict=True):
                equal(ends, arrays[end][m, which, computed])
            assert result.names[which] in container.get_label()
            fit = result.fits[m][which]
            lines = [line for line in axes.lines if line.get_label().startswith("lognormal fit")]
            drawn = lines[which].get_xydata()
            assert ("rejected" in lines[which].get_label()) == bool(fit.rejected)
            equal(drawn[:, 1], fit(drawn[:, 0]))


def test_pictures_of_surfaces_and_sweeps():
    result, _, variables, places = kind("surface")
    figure = result.plot()
    axes = figure.axes[0]
    equal(axes.lines[0].get_xydata(), np.stack([[fits[0].median for fits in result.fits], places["size"]], axis=1))
    assert axes.get_xlim() == pytest.approx((places["scale"][0], places["scale"][-1]))
    assert axes.get_ylim() == pytest.approx((places["size"][0], places["size"][-1]))
    alone = Figure().subplots()
    draw_surface(alone, result, 1)
    shown = RegularGridInterpolator((places["size"], places["scale"]), variables["probability"][1][:, 1])
    bands = alone.collections[0].get_paths()
    assert len(bands) == 10
    for number, filled in enumerate(bands):
        values = shown(filled.vertices[:, ::-1])
        assert (np.abs(values - 0.1 * number - 0.05) <= 0.05 + 1e-9).all()
    result, _, variables, places = kind("sweep")
    (axes,) = result.plot("survival").axes
    assert len(axes.lines) == len(places["b"])
    for k, line in enumerate(axes.lines):
        equal(line.get_xydata(), np.stack([places["a"], variables["survival"][1][:, k]], axis=1))
    result, _, variables, _ = kind("list")
    (line,) = result.plot("peak").axes[0].lines
    equal(line.get_ydata(), variables["peak"][1])


def test_pictures_and_files_of_functions_of_the_plane(tmp_path):
    result, columns, _, _ = kind("operator")
    density, modes, *_ = result.plot().axes
    equal(modes.lines[1].get_xydata(), np.stack([columns["real"], columns["imaginary"]], axis=1))
    plane = made_results.plane_map()
    for axes, function in ((density, result.quasi_stationary), (plane.plot().axes[0], plane)):
        (mesh,) = axes.collections
        x, y = np.moveaxis(mesh.get_coordinates(), -1, 0)
        middle = [0.25 * (corner[1:, 1:] + corner[1:, :-1] + corner[:-1, 1:] + corner[:-1, :-1]) for corner in (x, y)]
        equal(mesh.get_array(), function(*middle))
    vtk.write_function(tmp_path / "map.vtu", plane, "survival")
    mesh = meshio.read(tmp_path / "map.vtu")
    inside = np.all([~np.isin(mesh.points[:, axis], lines) for axis, lines in enumerate(plane.mesh_lines)], axis=0)
    quads = mesh.points[mesh.cells_dict["quad"]].mean(axis=1)
    values = mesh.point_data["survival"][mesh.cells_dict["quad"]].mean(axis=1)
    assert not inside.any()  # of degree 1 all points are on lines, and the mean is the value in the middle
    equal(values, plane(quads[:, 0], quads[:, 1]))


def test_the_picture_of_motions(tmp_path, drawn):
    """Histories with impacts and overturning, points of the last cycle, their mean, and two histograms."""
    result, _, variables, _ = kind("histories")
    paths, states = result.realizations, kind("ensemble").variables
    few = {name: values for name, (_, values) in variables.items()}
    rng, edges = np.random.default_rng(13), np.array([0.0, 1.0, 3.0, 4.0])
    means = MeanMap(rng.normal(size=(5, 2)), rng.uniform(size=(5, 2)), np.full(5, 9), None)
    bins = [Histogram(edges, np.zeros(3), *_with_limits(rng.uniform(1.0, 2.0, 3))) for _ in range(2)]
    motion.motion_figure(tmp_path / "motion.png", result, kind("ensemble").result, {"mean": means}, *bins, "Motions")
    panels = {axes.get_title() or axes.get_ylabel(): axes for axes in drawn[0].axes[paths:]}
    assert [axes.get_title()[:3] for axes in drawn[0].axes[:paths]] == ["(a)"] + [""] * (paths - 1)
    for number, axes in enumerate(drawn[0].axes[:paths]):
        curves = {line.get_marker(): line for line in axes.lines[3:]}
        equal(curves["None"].get_ydata(), few["angle"][number])
        equal(curves["o"].get_xdata(), few["impact_time"][few["impact_realization"] == number])
        assert axes.get_xlim() == (0.0, motion._shown(result))
        side = few["overturn_side"][number]
        assert ("x" in curves) == (side != 0)
        if side:
            cut = result.scene.overturning.angle
            equal(curves["x"].get_xydata(), [[few["overturn_time"][number], side * cut]])
    alone = Figure().subplots()
    motion.history_panel(alone, result, 0, impacts=False)
    cut = result.scene.overturning.angle
    assert (alone.get_xlim(), alone.get_ylim()) == ((0.0, result.time[-1]), (-1.15 * cut, 1.15 * cut))
    assert "o" not in {line.get_marker() for line in alone.lines}
    (points,) = (axes for title, axes in panels.items() if title.startswith("(b) Poincaré points"))
    equal(points.lines[0].get_xydata(), np.stack([states[name][1][:, -1] for name in ("angle", "velocity")], axis=1))
    standing = np.isfinite(states["angle"][1][:, -1]).sum()
    assert f"of the {standing} that stand after {made_results.CYCLES} cycles" in points.get_title()
    for column, axes in enumerate((panels["(c) Mean Poincaré points"], panels["mean velocity"])):
        equal(axes.containers[0][0].get_ydata(), means.points[:, column])
        equal(bars(axes.containers[0])[1], means.points[:, column] + 1.96 * means.standard_error[:, column])
    for title, wanted in zip(("(d) Time of overturning", "(e) Speed just before an impact"), bins, strict=True):
        equal(panels[title].patches[0].get_data().values, wanted.density)
        equal(np.array(bars(panels[title].containers[0])), wanted.interval.T)


def _with_limits(density):
    return density, np.stack([0.9 * density, 1.2 * density], axis=1)
