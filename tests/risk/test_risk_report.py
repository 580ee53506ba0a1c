"""What the report of a risk says of its motions and draws of its block, and its pictures: every line, bar and band."""

import dataclasses
import html
import re
import types

import matplotlib.pyplot as plt
import numpy as np
import pytest

from fpk_rocking import BandNoise, Block, Dimensions, Harmonic, NoNoise, Pulse, Record, Scene
from fpk_rocking.risk import Hazard, IntensityCurve, annual_frequency, report, study, synthetic_records
from fpk_rocking.risk.lognormal import LognormalFit
from fpk_rocking.risk.rate import rate_text

SIZE, SCALES = Dimensions(0.6, 2.0), np.geomspace(0.1, 3.0, 12)
MOTIONS = synthetic_records(6, duration=5.0, rms=1.5)
HAZARD = Hazard(np.geomspace(0.01, 30.0, 15), np.geomspace(0.5, 1e-7, 15))


@pytest.fixture
def axes():
    figure, axes = plt.subplots()
    yield axes
    plt.close(figure)


def risk_of(fit, replicates=()):
    share = LognormalFit(0.7, 0.4)(SCALES)
    limits = np.stack([0.9 * share, np.minimum(1.0, 1.1 * share)], axis=-1)
    own = np.reshape(replicates, (-1, 2))
    curve = IntensityCurve("overturned", "PGV", SCALES, share, limits, fit, own, 3)
    return annual_frequency(curve, HAZARD)


def test_motions_stand_one_above_the_other_in_parts_of_their_peaks(axes):
    """All of them, by name and PGA, none beyond the picture; of a record each sample."""
    pulses = [Scene(Block(0.9, SIZE), Pulse("one-cosine", amplitude, 3.0), NoNoise()) for amplitude in (1.5, 4.0)]
    samples = (0.0, 0.1, -0.4, 0.2, 0.0)
    record = Scene(Block(0.9, SIZE), Record(0.1, samples, "g", source=f"{'a' * 20}{'b' * 20}.AT2"), NoNoise())
    scenes = [*pulses, *[record] * 13]
    report.draw_motions(axes, [Scene(Block(0.9), pulses[0].forcing, NoNoise()), *scenes], axes.figure)
    assert axes.get_yticks().tolist() == [-place for place in range(15)]
    labels = [label.get_text() for label in axes.get_yticklabels()]
    unit = SIZE.critical_angle * SIZE.gravity / 9.80665
    assert [label.split("\n")[-1] for label in labels[:3]] == [f"{1.5 * unit:.3g} g", f"{4.0 * unit:.3g} g", "0.4 g"]
    # The whole name, in lines, and a row as high as the longest one needs.
    assert labels[2].split("\n") == [f"{'a' * 20}{'b' * 12}", f"{'b' * 8}.AT2 (1)", "0.4 g"]
    assert axes.figure.get_size_inches()[1] == pytest.approx(1.0 + 0.54 * 15)
    for place, (line, scene) in enumerate(zip(axes.lines, scenes, strict=True)):
        seconds, height = line.get_data()
        times, low, high = seconds * SIZE.frequency_parameter, *axes.get_ylim()
        assert (times[0], times[-1]) == pytest.approx((0.0, scene.forcing.duration))
        assert low < height.min() < height.max() < high
        assert np.abs(height + place).max() == pytest.approx(0.5, rel=1e-3)
        if place < 2:
            peak = abs(scene.forcing.amplitude)
            assert height + place == pytest.approx([0.5 * scene.forcing.value(t) / peak for t in times], abs=1e-9)
        else:
            assert height + place == pytest.approx(0.5 * np.array(samples) / 0.4, abs=1e-12)


def test_the_curve_has_its_points_its_records_and_its_band(axes):
    replicates = [(0.6, 0.3), (0.7, 0.4), (0.8, 0.5)]
    risk, rows = risk_of(LognormalFit(0.7, 0.4, misfit=0.0), replicates), np.linspace(0.0, 1.0, 36).reshape(3, 12)
    report.draw_curve(axes, risk.curve, rows)
    lines = {line.get_label(): line for line in axes.lines}
    records = [line for line in axes.lines if line.get_color() == "0.75"]
    assert [line.get_ydata().tolist() for line in records] == rows.tolist()
    assert records[0].get_label() == "each of 3 records"
    assert np.array_equal(lines["mean of the motions"].get_xydata(), np.stack([SCALES, risk.curve.probability], axis=1))
    assert not axes.containers
    grid, values = lines["lognormal fit"].get_data()
    assert (grid[0], grid[-1]) == pytest.approx((0.8 * SCALES[0], 1.25 * SCALES[-1]))
    assert np.array_equal(values, risk.curve(grid))
    (band,) = (drawn for drawn in axes.collections if drawn.get_label() == "95 % band of the fit")
    limits = np.quantile([LognormalFit(*drawn)(grid) for drawn in replicates], [0.025, 0.975], axis=0)
    corners = band.get_paths()[0].vertices[:, 1]
    assert (corners.min(), corners.max()) == pytest.approx((limits.min(), limits.max()), abs=1e-12)
    assert set(np.round(limits.ravel(), 9)) <= set(np.round(corners, 9))


def test_without_noise_the_share_of_the_motions_is_drawn_at_all_intensities(axes):
    """Of three motions one overturns the block from .5 to .6 and from .9 on, the others from .7 and .8 on."""
    jumps = np.array([[[0.5, 0.6, 0.9]], [[0.7, np.nan, np.nan]], [[0.8, np.nan, np.nan]]])
    curve = dataclasses.replace(risk_of(LognormalFit(0.7, 0.4, misfit=0.0), [(0.7, 0.4)]).curve, jumps=jumps, units=3)
    report.draw_curve(axes, curve, np.zeros((3, 12)))
    (line,) = (drawn for drawn in axes.lines if drawn.get_label() == "share of the 3 motions")
    places, share = line.get_data()
    assert np.interp([0.45, 0.55, 0.65, 0.75, 0.85, 0.95], places, share, 0.0) == pytest.approx(
        np.array([0, 1, 0, 1, 2, 3]) / 3
    )
    assert not any(drawn.get_color() == "0.75" for drawn in axes.lines)


def test_the_fit_and_its_band_reach_over_points_and_outcomes(axes):
    """Points from .6 to 5, outcomes from .5 to .9."""
    jumps, points = np.array([0.5, 0.7, 0.9])[:, None, None], np.array([0.6, 5.0])
    curve = risk_of(LognormalFit(0.7, 0.4, misfit=0.0), [(0.7, 0.4), (0.8, 0.4)]).curve
    two = {"intensity": points, "probability": np.array([0.3, 1.0]), "interval": np.zeros((2, 2))}
    report.draw_curve(axes, dataclasses.replace(curve, jumps=jumps, units=3, **two), np.zeros((3, 2)))
    (fit,) = (line for line in axes.lines if line.get_label() == "lognormal fit")
    (band,) = (drawn for drawn in axes.collections if drawn.get_label() == "95 % band of the fit")
    for places in (fit.get_xdata(), band.get_paths()[0].vertices[:, 0]):
        assert (places.min(), places.max()) == pytest.approx((0.4, 6.25))


def test_bars_are_the_limits_of_the_table_and_end_at_lift_off(axes):
    """Of three motions, none overturns; nothing lifts a block of .6 × 2 m off at .3 g or less."""
    scenes = tuple(Scene(Block(0.9, SIZE), motion, NoNoise()) for motion in MOTIONS[:3])
    fields = {"jumps": np.full((3, 1, 1), np.nan), "reach": 3.0, "records": 3, "units": 3, "measure": "PGA"}
    curve = dataclasses.replace(
        risk_of(LognormalFit(reason="none"), []).curve, **fields, scenes=scenes, probability=np.zeros(12)
    )
    report.draw_curve(axes, curve, np.zeros((3, 12)))
    (bars,) = axes.containers
    drawn = np.array([segment[:, 1] for segment in bars[2][0].get_segments()])
    assert drawn == pytest.approx(curve.point_limits, abs=1e-12)
    assert (drawn[:, 1] > 0.0).tolist() == (SCALES > 0.3).tolist()


def test_the_answer_stands_first_and_the_motions_behind_a_fold(tmp_path):
    """Title with one rate, verdict, asked intensities, pictures; the motions with whole names, in columns that wrap."""
    records = [dataclasses.replace(one, source=f"{n}_{'long' * 20}.AT2") for n, one in enumerate(MOTIONS)]
    found = study(Scene.from_block(0.5, 1.8, record=records[0]), records, HAZARD, [0.3, 0.9])
    report.write_risk_report(tmp_path / "report.html", found)
    page = (tmp_path / "report.html").read_text(encoding="utf-8").partition("<script")[0]
    heads = ["<h1>", "trust: ", "<td>0.3</td>", "<img alt='Probability", "<img alt='Contributions", "<h2>Block</h2>"]
    places = [page.index(text) for text in [*heads, "<h2>Motions</h2>", "<details>", "<img alt='Accelerations"]]
    assert places == sorted(places)
    low, high = map(rate_text, found.risk.interval)
    title = f"annual rate of overturning = {rate_text(found.risk.rate)} (95 %: {low} to {high})</h1>"
    assert f"<h1>rocking_block: {title}" in page
    fold = page[page.index("<details>") : page.index("</details>")]
    for record in records:
        assert f"<td class='text'>{record.source}</td>" in fold
        assert page.count(record.source) == 1
    assert "<td>5.00e-1</td>" in page  # the rate of the first point of the hazard
    assert not re.search(r">[\d.]+e-0", page)


def test_one_record_and_points_have_neither_lines_of_their_own_nor_a_band(axes):
    risk = risk_of(LognormalFit(reason="none"), [(0.6, 0.3)])
    report.draw_curve(axes, risk.curve, np.zeros((1, 12)))
    assert [line.get_label() for line in axes.lines if line.get_color() in {"0.75", "black"}] == [
        "points joined by lines"
    ]
    (bars,) = axes.containers
    ends = np.array([segment[:, 1] for segment in bars[2][0].get_segments()])
    assert ends == pytest.approx(risk.curve.interval)
    assert not any(drawn.get_label() == "95 % band of the fit" for drawn in axes.collections)


def test_the_shares_of_the_frequency_stand_beside_the_hazard(axes):
    risk = risk_of(LognormalFit(0.7, 0.4, misfit=0.0))
    report.draw_contributions(axes, risk)
    assert [bar.get_height() for bar in axes.patches] == pytest.approx(100.0 * risk.contribution)
    assert [bar.get_x() for bar in axes.patches] == pytest.approx(risk.edges[:-1])
    assert [bar.get_width() for bar in axes.patches] == pytest.approx(np.diff(risk.edges))
    assert axes.get_xlim() == pytest.approx((risk.edges[0], risk.edges[-1]))
    (other,) = (panel for panel in axes.figure.axes if panel is not axes)
    line, points = other.lines
    assert line.get_ydata() == pytest.approx(HAZARD(line.get_xdata()))
    inside = (HAZARD.intensity >= risk.edges[0]) & (HAZARD.intensity <= risk.edges[-1])
    assert 0 < inside.sum() < 15
    assert np.array_equal(points.get_xydata(), np.stack([HAZARD.intensity, HAZARD.rate], axis=1)[inside])


def text_of(*noises, scaled=False):
    motions = [Scene(Block(0.9, SIZE), Harmonic(1.0, 2.0), noise) for noise in noises]
    result = types.SimpleNamespace(noise_scaled=scaled, realizations=1200, options={"seed": 7})
    return report._motions_text(types.SimpleNamespace(motions=motions, fragility=result, draws=None))


def test_the_noise_that_is_named_is_that_of_the_first_motion():
    strong, weak = (BandNoise(variance, (0.0, 9.0), 20) for variance in (0.04, 0.01))
    rms = SIZE.gravity * SIZE.critical_angle / 9.80665
    single, two, quiet = text_of(weak, scaled=True), text_of(strong, weak), text_of(NoNoise())
    assert single.startswith("1 motion, each scaled")
    assert f"rms {0.1 * rms:.3g} g" in single
    assert "it is scaled with the motion. 1,200 paths of each motion at each intensity. Seed 7." in single
    assert two.startswith("2 motions, each scaled")
    assert f"rms {0.2 * rms:.3g} g" in two
    assert "it is not scaled with the motion" in two
    assert quiet == "1 motion, each scaled to each intensity. "


@pytest.mark.parametrize("size", [(0.6, 2.0), (2.0, 0.6), (1.0, 1.0)])
def test_the_sketch_has_the_proportions_and_the_figures_of_the_block(size):
    drawn = report._sketch(Dimensions(*size))
    x, y, w, h = map(float, re.search(r"<rect x='(.*?)' y='(.*?)' width='(.*?)' height='(.*?)'", drawn).groups())
    assert (w, h) == pytest.approx([150.0 * length / max(size) for length in size], abs=0.06)
    line = re.search(r"<line x1='(.*?)' y1='(.*?)' x2='(.*?)' y2='(.*?)'", drawn.partition("stroke-width='3'/>")[2])
    corner, centre = [float(text) for text in line.groups()[:2]], [float(text) for text in line.groups()[2:]]
    assert corner == pytest.approx([x + w, y + h], abs=0.11)
    assert centre == pytest.approx([x + 0.5 * w, y + 0.5 * h], abs=0.11)
    width, height = (float(text) for text in re.search(r"<svg width='(\d+)' height='(\d+)'", drawn).groups())
    assert x + w < width
    assert y + h + 20.0 < height
    for figure in (
        f"{size[0]:.3g} m",
        f"{size[1]:.3g} m",
        f"θ_cr = {Dimensions(*size).critical_angle * 57.29578:.3g}°",
    ):
        assert f">{figure}</text>" in drawn


def test_the_scene_is_shown_without_its_forcing():
    """Motions replace it; nothing else is left out, and what HTML would read is written for it."""
    scene = Scene(Block(0.9, SIZE), Record(interval=0.5, samples=(0.0, 1.0, 0.0), units="g"), NoNoise())
    lines = scene.to_toml().splitlines()
    begin, end = lines.index("[forcing]"), lines.index("[noise]")
    assert report._without_forcing(scene).splitlines() == [html.escape(line) for line in [*lines[:begin], *lines[end:]]]
    assert 5 < end - begin < len(lines) - 5
