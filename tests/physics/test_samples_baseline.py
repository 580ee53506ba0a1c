"""Baselines of records: exactness of the corrections, the filter's gain, what is told to drift, files as they come."""

import dataclasses
import json
import math
import sys

import numpy as np
import pytest
from scipy import signal

from fpk_rocking import Block, Dimensions, NoNoise, Record, Scene
from fpk_rocking.cli import main
from fpk_rocking.physics.forcing.samples import corrected, drift_of
from fpk_rocking.results.remarks import baseline_remark, scene_diagnostics
from fpk_rocking.risk import Hazard, at_intensity, intensities, study, synthetic_records
from fpk_rocking.scene.ranges import implausible

G = 9.80665
KINDS = ["mean", "linear", "high-pass"]


def drifting(record, offset=0.004, slope=2e-4):
    """Return a record in g with an offset, g, and a slope, g/s, about its middle."""
    steps = np.arange(len(record.samples)) - 0.5 * (len(record.samples) - 1)
    samples = np.array(record.samples) / (G if record.units == "m/s2" else 1.0)
    samples = samples + offset + slope * record.interval * steps
    return Record(record.interval, tuple(samples.tolist()), "g", source=record.source)


def scene_of(record):
    return Scene(Block(0.9, Dimensions(0.5, 1.8)), record, NoNoise())


def drift_sentences(record):
    return [diagnostic.message for diagnostic in scene_diagnostics(scene_of(record), "") if diagnostic.kind == "drift"]


@pytest.mark.parametrize("kind", KINDS)
def test_offset_and_slope_are_removed_exactly(kind):
    """An offset and a slope of many PGA leave PGV, PGA and forces as they are to 1e-9; the mean alone an offset."""
    (motion,) = synthetic_records(1)
    plain = dataclasses.replace(drifting(motion, 0.0, 0.0), baseline=kind)
    for offset, slope in ((0.004, 2e-4), (-3.0, 0.2)):
        other = dataclasses.replace(drifting(motion, offset, 0.0 if kind == "mean" else slope), baseline=kind)
        ours, theirs = intensities(scene_of(plain)), intensities(scene_of(other))
        assert theirs.pgv == pytest.approx(ours.pgv, rel=1e-9)
        assert theirs.pga == pytest.approx(ours.pga, rel=1e-9)
        assert other.corrected_samples == pytest.approx(plain.corrected_samples, abs=1e-9)
        assert other.correction.offset == pytest.approx(plain.correction.offset + G * offset, abs=1e-9)
        added = 0.0 if kind == "mean" else slope
        assert other.correction.slope == pytest.approx(plain.correction.slope + G * added, abs=1e-9)
        assert len(other.corrected_samples) == len(other.samples) == 2501


def test_without_a_correction_the_samples_act_bit_for_bit():
    (motion,) = synthetic_records(1)
    assert motion.baseline == "none"
    assert tuple(motion.corrected_samples.tolist()) == motion.samples
    assert motion.correction.removed_velocity == 0.0


@pytest.mark.parametrize("frequency", [0.02, 0.05, 0.1, 0.2, 0.5, 5.0])
@pytest.mark.parametrize("corner", [0.1, 0.25])
def test_the_gain_of_the_filter_is_that_of_order_4_without_a_change_of_phase(frequency, corner):
    """In the middle of 400 s the sine is itself, times 1 / (1 + (fc / f)^4), and times |H|² of scipy's `freqz`."""
    interval = 0.01
    times = interval * (np.arange(40_001) - 20_000)
    wave = np.sin(2.0 * math.pi * frequency * times)
    filtered = corrected(wave, interval, "high-pass", corner)
    middle = np.abs(times) < 10.0
    offset, slope = np.polyfit(times, wave, 1)[::-1]
    assert abs(offset) < 1e-9
    # The line of a slow sine is not 0; what the filter leaves of a line is 0 far from its ends.
    assert abs(slope) * 200.0 < 0.5
    gain = 1.0 / (1.0 + (corner / frequency) ** 4)
    assert filtered[middle] == pytest.approx(gain * wave[middle], abs=2e-3)
    _, response = signal.freqz(*signal.butter(2, corner, "highpass", fs=1.0 / interval), [frequency], fs=1.0 / interval)
    assert abs(response[0]) ** 2 == pytest.approx(gain, rel=1e-3)


def test_the_padding_is_zeros_for_6_corner_periods_that_are_cut_off():
    """The filter over samples that were padded by hand with ten times as many zeros: the same to 1e-6 of the peak."""
    (motion,) = synthetic_records(1)
    samples = np.array(drifting(motion).samples)
    steps = np.arange(len(samples))
    straight = samples - np.polyval(np.polyfit(steps, samples, 1), steps)
    sections = signal.butter(2, 0.1, "highpass", fs=100.0, output="sos")
    padded = np.pad(straight, 60_000)
    filtered = corrected(samples, 0.01, "high-pass")
    forwards = signal.sosfilt(sections, signal.sosfilt(sections, padded)[::-1])[::-1]
    assert filtered == pytest.approx(forwards[60_000:-60_000], abs=1e-6 * np.abs(samples).max())


def test_the_figures_of_a_drift_are_those_of_sums_by_hand():
    samples = np.array([1.0, 3.0, -2.0, 4.0])
    drift = drift_of(samples, samples - 1.5, 0.5)
    assert (drift.pgv, drift.pga, drift.end_velocity) == (1.75, 4.0, 1.75)
    assert (drift.corrected_pgv, drift.corrected_pga, drift.removed_velocity) == (0.5, 3.5, 2.25)
    assert (drift.offset, drift.slope) == (1.5, pytest.approx(0.8))
    assert drift.drifts
    assert not drift_of(samples, samples, 0.5).drifts


def test_motions_that_drift_are_told_and_those_that_do_not_are_not():
    """Twelve motions, with .004 g and a slope of either sign and without: 36 verdicts, none wrong."""
    for motion in synthetic_records(12, duration=40.0, seed=3):
        clean = drifting(motion, 0.0, 0.0)
        assert not clean.drifts
        assert drift_sentences(clean) == []
        for sign in (1.0, -1.0):
            spoiled = drifting(motion, sign * 0.004, sign * 2e-4)
            (sentence,) = drift_sentences(spoiled)
            assert spoiled.drift.pgv > 1.25 * spoiled.drift.corrected_pgv
            assert f"its PGV is {spoiled.drift.pgv:.3g} m/s as recorded, but " in sentence
            assert f"an offset of {spoiled.drift.offset / G:.2g} g" in sentence
            assert sentence.endswith('Take baseline = "high-pass" (--baseline high-pass).')
            # Whatever the intensity it is scaled to, or the size of the block.
            assert drift_sentences(spoiled.scaled(0.01, 1.0)) == [sentence]
            assert spoiled.scaled(2.0, 3.0).drifts
            for kind in ("linear", "high-pass"):
                assert drift_sentences(dataclasses.replace(spoiled, baseline=kind)) == []


def test_what_the_mean_leaves_is_still_told_to_drift():
    (motion,) = synthetic_records(1, duration=40.0)
    sloping = dataclasses.replace(drifting(motion, 0.004, 5e-4), baseline="mean")
    assert len(drift_sentences(sloping)) == 1


def test_a_record_of_nothing_or_of_an_instant_does_not_drift():
    assert not Record(0.01, (0.0,) * 1000, "g").drifts
    assert not Record(0.01, (1.0,) * 10, "g").drifts
    assert Record(0.01, (0.01,) * 1000, "g").drifts


def test_scaling_keeps_the_correction_and_its_corner_in_periods():
    (motion,) = synthetic_records(1)
    record = dataclasses.replace(drifting(motion), baseline="high-pass", corner_hz=0.2)
    faster = record.scaled(2.0, 4.0)
    assert (faster.baseline, faster.corner_hz, faster.interval) == ("high-pass", 0.8, record.interval / 4.0)
    assert faster.corrected_samples == pytest.approx(record.corrected_samples, rel=1e-9, abs=1e-12)


def test_a_correction_is_written_and_read_back_and_comes_from_scene_files(tmp_path):
    (motion,) = synthetic_records(1, duration=10.0)
    spoiled = drifting(motion)
    path = tmp_path / "motion.csv"
    path.write_text("time,acc_g\n" + "".join(f"{0.01 * k:.2f},{a!r}\n" for k, a in enumerate(spoiled.samples)))
    head = "[block.dimensions]\nwidth = 0.5\nheight = 1.8\n[noise]\nkind = 'none'\n[forcing]\nkind = 'record'\n"
    text = head + "file = 'motion.csv'\nbaseline = 'high-pass'\ncorner_hz = 0.15\n"
    scene = Scene.from_toml(text, tmp_path)
    same = Record.from_file(path, baseline="high-pass", corner_hz=0.15).for_size(scene.block.dimensions)
    assert scene.forcing == same
    assert Scene.from_toml(scene.to_toml()) == scene
    assert np.array_equal(Scene.from_toml(scene.to_toml()).forcing.forces, same.forces)
    assert scene.forcing != Scene.from_toml(text.replace("high-pass", "linear"), tmp_path).forcing
    changed = Scene.from_toml(text, tmp_path, {"forcing.corner_hz": 0.3, "forcing.baseline": "high-pass"})
    assert changed.forcing.corner_hz == 0.3


@pytest.mark.parametrize(
    ("correction", "says"),
    [
        ({"baseline": "highpass"}, "forcing.baseline: got 'highpass', accepted: 'none' or 'mean' or 'linear' or 'high"),
        ({"corner_hz": 0.0}, "forcing.corner_hz: got 0"),
        ({"baseline": "high-pass", "corner_hz": 60.0}, r"forcing.corner_hz: got 60.0, accepted: from .* to 49.9 Hz"),
        ({"baseline": "high-pass", "corner_hz": 1e-9}, "forcing.corner_hz: got 1e-09, accepted: from 0.000286 to"),
    ],
)
def test_what_is_no_correction_is_refused(correction, says):
    with pytest.raises(ValueError, match=says):
        Record(0.01, (0.0, 1.0, 0.0), "g", **correction)
    with pytest.raises(TypeError, match=r"forcing.baseline: got 3"):
        Record(0.01, (0.0, 1.0, 0.0), "g", baseline=3)


def test_a_correction_is_remarked_with_what_it_removes():
    motions = synthetic_records(3, duration=40.0)
    assert baseline_remark(motions) == ""
    records = [dataclasses.replace(drifting(motion), baseline="high-pass") for motion in motions]
    correction = records[0].correction
    sentence = baseline_remark([records[0].scaled(3.0, 1.0), records[0]])
    assert sentence.startswith("Baseline of synthetic motion 1 of seed 1, ")
    assert (
        "corrected (high-pass, 0.1 Hz), which removes an offset of 0.004 g and a slope of 0.0002 g/s: PGV " in sentence
    )
    assert f"PGV {correction.corrected_pgv:.3g} in place of {correction.pgv:.3g} m/s" in sentence
    ratios = sorted(record.correction.corrected_pgv / record.correction.pgv for record in records)
    assert f"This multiplies PGV by {ratios[0]:.3g} to {ratios[-1]:.3g} and PGA by" in baseline_remark(records)


def test_units_and_steps_that_were_typed_wrong_are_named():
    """The record of cm/s² that are read as g, and of 10 times the interval, in the words of what was meant."""
    (motion,) = synthetic_records(1, duration=20.0)
    assert implausible(scene_of(motion)) == []
    gal = tuple(100.0 * a for a in motion.samples)
    (sentence,) = implausible(scene_of(Record(0.01, gal, "g", scale=1e-3, source="x.txt")))
    assert f"The peak acceleration of x.txt is {G * max(map(abs, gal)):.4g} m/s²" in sentence
    meant = f"Are its numbers in cm/s², with {max(map(abs, motion.samples)):.4g} m/s²? 1 g is 9.80665 m/s² or "
    meant += "980.665 cm/s²."
    meant += " A unit is given by units (--units); one that the file states has to be changed in the file."
    assert sentence.endswith(meant)
    (sentence,) = implausible(scene_of(Record(0.01, gal, "m/s2")))
    assert sentence.endswith(meant)
    largest = max(map(abs, motion.samples))
    (sentence,) = implausible(scene_of(Record(0.01, tuple(3.5 * a / largest for a in motion.samples), "g", scale=0.1)))
    assert (
        "34.32 m/s² (3.5 g). Are its numbers in m/s², with 3.5 m/s², or in cm/s², with 0.035 m/s²? 1 g is" in sentence
    )
    assert implausible(scene_of(Record(0.01, tuple(2.8 * a / largest for a in motion.samples), "g"))) == []
    slow = Record(0.2, tuple(3.0 * a for a in motion.samples), "m/s2", source="y.txt")
    (sentence,) = implausible(scene_of(slow))
    assert sentence.startswith("The PGV of y.txt is ")
    assert sentence.endswith("it lasts 400 s: is its interval 0.2 s, and its unit m/s2?")


def test_a_record_is_judged_as_it_was_recorded_and_not_as_it_is_scaled():
    """A drift of .02 g, at a PGV of 2 m/s that is that of the drift: the PGA is .06 g, and nothing else was meant."""
    (motion,) = synthetic_records(1, duration=20.0)
    drifting = dataclasses.replace(motion, samples=tuple(a + 0.3 for a in motion.samples))
    scene = at_intensity(scene_of(drifting), "PGV", 2.0)
    assert scene.forcing.drifts
    assert scene.forcing.largest < scene.block.lift_off
    assert implausible(scene) == []
    # So is one that is scaled down, and one that is scaled to more than any ground motion has.
    assert implausible(scene_of(dataclasses.replace(motion, scale=0.01))) == []
    assert implausible(scene_of(motion), 30.0, 40.0) == []
    (sentence,) = implausible(scene_of(dataclasses.replace(motion, samples=tuple(0.02 * a for a in motion.samples))))
    assert sentence.endswith("g meant?")


def test_a_record_that_ends_at_rest_does_not_drift():
    """A pulse of 10 s and shaking, 60 s in all, whose high-pass correction takes most of the velocity away."""
    time = 0.01 * np.arange(6001)
    velocity = 0.25 * np.sin(2 * np.pi * (time - 30) / 10) * np.exp(-(((time - 30) / 6) ** 2))
    velocity += 0.05 * np.sin(3 * np.pi * time) * np.exp(-(((time - 25) / 5) ** 2))
    samples = np.gradient(velocity, time)
    resting = Record(0.01, samples.tolist(), "m/s2")
    assert resting.drift.drifts
    assert not resting.drifts
    # An offset of .004 g, and a slope that a mean does not remove.
    assert Record(0.01, (samples + 0.04).tolist(), "m/s2").drifts
    assert Record(0.01, (samples + 0.002 * time).tolist(), "m/s2", baseline="mean").drifts


def test_what_is_hardly_an_acceleration_in_any_unit_is_told():
    shape = np.sin(0.2 * np.arange(400)) * np.hanning(400)
    for samples, units, says in (
        (
            3100.0 * shape,
            "cm/s2",
            "is its unit cm/s2, or are its numbers, up to 3090, counts? A unit is given by units (--",
        ),
        (0.9 * shape, "cm/s2", "is its unit cm/s2"),
        (31.0 * shape, "g/10", "is its unit g/10"),
        (np.round(2000.0 * shape), "cm/s2", "The samples of own.txt are whole numbers: are they counts of a recorder?"),
        (np.abs(shape), "m/s2", "All samples of own.txt have one sign: are they a spectrum, or have an offset?"),
        (-np.abs(shape), "m/s2", "have one sign"),
    ):
        sentences = implausible(scene_of(Record(0.01, samples.tolist(), units, source="own.txt")))
        assert sum(says in sentence for sentence in sentences) == 1, sentences
    offset = Record(0.01, (shape - 2.0).tolist(), "m/s2")
    assert [sentence.partition(", which")[0] for sentence in offset.implausible] == [
        "All samples of the record lie around an offset of -0.2 g"
    ]
    assert dataclasses.replace(offset, baseline="mean").implausible == []
    assert Record(0.01, (2.0 * shape).tolist(), "m/s2").implausible == []
    assert Record(0.01, (200.0 * shape).tolist(), "cm/s2", note="Of a borehole.").implausible == ["Of a borehole."]


def test_a_lone_sample_and_peaks_that_are_cut_off_are_told_and_nothing_is_said_of_other_motions():
    motions = synthetic_records(60, duration=10.0, seed=3)
    assert [motion.implausible for motion in motions] == [[]] * 60
    samples = np.array(motions[0].samples)
    peak = np.abs(samples).max()
    for factor, told in ((1.95, False), (2.05, True)):
        spoiled = samples.copy()
        spoiled[900] = -factor * peak
        said = f"One sample of the record, at 9 s, has {factor * peak / 9.80665:.3g} g, all others at most "
        sentences = Record(0.01, spoiled.tolist(), "m/s2", scale=3.0).implausible
        assert [sentence.startswith(said) for sentence in sentences] == [True] * told, factor
    cut = np.clip(samples, -0.5 * peak, 0.5 * peak)
    (sentence,) = Record(0.01, cut.tolist(), "m/s2").implausible
    assert f"The peak of the record, {0.5 * peak / 9.80665:.3g} g, is held for 3 samples or more at " in sentence
    # One peak that is held is none that is cut off, nor are the flat tops of coarse counts.
    wave = np.cos(0.05 * (np.arange(2001) - 1000.0)) * np.hanning(2001)
    for part, told in ((0.995, False), (0.9, True)):
        flat = np.clip(wave, -part * wave.max(), part * wave.max())
        assert bool(Record(0.01, flat.tolist(), "m/s2").implausible) == told, part
    counts = 0.1 * np.round(12.0 * np.sin(0.1 * np.arange(2000)))
    assert Record(0.01, counts.tolist(), "m/s2").implausible == []


def columns_of(tmp_path, text, **options):
    path = tmp_path / "motion.csv"
    path.write_text(text)
    return Record.from_file(path, **options)


@pytest.mark.parametrize(
    ("header", "units"),
    [
        ("time,acc_g", "g"),
        ("time_s,acc_m_s2", "m/s2"),
        ("t,acceleration_g", "g"),
        ("Time (s),Acceleration (g)", "g"),
        ("time,acc_cm_s2", "cm/s2"),
        ("time,acc_gal", "cm/s2"),
        ("time,acc_ms2", "m/s2"),
    ],
)
def test_names_of_columns_say_the_unit(tmp_path, header, units):
    record = columns_of(tmp_path, f"{header}\n0.0,1.5\n0.1,-2.5\n")
    assert (record.samples, record.units) == ((1.5, -2.5), units)


@pytest.mark.parametrize(
    "text",
    [
        "time,acc_g,velocity\n0.0,1.5,9\n0.1,-2.5,8\n",
        "number;Velocity [cm/s];Time [s];Acceleration [g]\n1;7;0,0;1,5\n2;6;0,1;-2,5\n",
        "acc_g time\n1.5 0.0\n-2.5 0.1\n",
        "time (s)  acc (g)  vel (cm/s)\n0.0 1.5 1\n0.1 -2.5 2\n",
    ],
)
def test_names_tell_the_columns_of_time_and_acceleration(tmp_path, text):
    record = columns_of(tmp_path, text)
    assert (record.samples, record.units) == ((1.5, -2.5), "g")
    assert record.interval == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("# three\n0.0,1.5,2\n0.1,2.5,2\n", r"got 2 components, accepted: .* 1 column 2 \(peak 2.5 .*; 2 column 3"),
        ("time,acc_x,acc_y\n0.0,1.5,2\n0.1,2.5,2\n", r"got 2 components, accepted: .* 1 acc_x \(peak 2.5 .*; 2 acc_y"),
        ("time,acc,v\n0.0,1.5,2\n0.1,2.5\n", r"got a line of 2 columns, accepted: the 3 of the first one \(line 3\)"),
        ("time,acc\n0.0,1.5\n0.1,x\n", r"got 'x', accepted: finite numbers \(line 3\)"),
        ("time,acc\n0.0,1.5\n0.1,2\n\n0.1,2\n", r"got the time 0.1 after 0.1, accepted: ascending times \(line 5\)"),
    ],
)
def test_columns_are_refused_with_the_line(tmp_path, text, says):
    with pytest.raises(ValueError, match=says):
        columns_of(tmp_path, text, units="g")


def test_a_size_that_stands_for_a_missing_sample_is_refused_and_a_true_one_is_not(tmp_path):
    for value, others, refused in (
        (-999.0, 19.9, True),
        (9999.0, 199.0, True),
        (-999.0, 20.0, False),
        (998.0, 1.0, False),
    ):
        text = f"time,acc\n0.0,{others}\n0.1,{value}\n0.2,{-others}\n"
        if refused:
            with pytest.raises(ValueError, match=rf"^forcing\.samples: got {value:g} as sample 2 of .*accepted"):
                columns_of(tmp_path, text, units="cm/s2")
        else:
            columns_of(tmp_path, text, units="cm/s2")


@pytest.mark.parametrize("decimals", [2, 3])
@pytest.mark.parametrize("interval", [0.005, 1.0 / 128.0, 0.0139, 1.0 / 60.0, 0.02])
def test_rounded_times_are_read_where_rounding_explains_them(tmp_path, interval, decimals):
    """Of 2,000 times; the interval comes out to a unit of the last decimal over the duration."""
    times = [f"{3.0 + interval * k:.{decimals}f}" for k in range(2000)]
    lines = [f"{time} {0.1 * (k % 7):.1f}" for k, time in enumerate(times)]
    record = columns_of(tmp_path, "\n".join(lines), units="g")
    assert len(record.samples) == 2000
    assert record.interval == pytest.approx(interval, abs=10.0**-decimals / 1999)
    # Two units of the last decimal are no rounding.
    lines[700] = f"{float(times[700]) + 2.0 * 10.0**-decimals:.{decimals}f} 0.0"
    if 2.0 * 10.0**-decimals > 0.02 * interval:
        with pytest.raises(ValueError, match=r"got the time .*, accepted: .* times \(line \d+\)"):
            columns_of(tmp_path, "\n".join(lines), units="g")


def test_a_gap_in_the_times_is_named_where_it_is(tmp_path):
    times = [0.01 * k for k in range(1000) if not 1 <= k % 700 - 600 < 9]
    with pytest.raises(ValueError, match=r"got the time 6.09 for 6.01, accepted: equally spaced times \(line 602\)"):
        columns_of(tmp_path, "\n".join(f"{time:.2f} 1" for time in times), units="g")


HAZARD = Hazard.power_law(1e-3, 2.0)


def write_motions(folder, count=5):
    """Write motions that drift, every other one in a file that says its unit; return the files."""
    files = []
    for number, motion in enumerate(synthetic_records(count, duration=20.0, seed=11)):
        spoiled = drifting(motion, 0.006, 1e-4)
        factor, name = (1.0, "time,acc_g") if number % 2 else (G, "time,acc")
        files.append(folder / f"motion{number}.csv")
        rows = "".join(f"{0.01 * k:.2f},{factor * a!r}\n" for k, a in enumerate(spoiled.samples))
        files[-1].write_text(f"{name}\n{rows}")
    return files


def test_a_study_of_records_that_drift_tells_so_and_corrects_them_on_request(tmp_path):
    """Units are given for the files that say none; after the correction the rate is that without drift.

    No interval of these motions is so narrow that what the filter leaves of the drift, some 1e-6, changes an outcome.
    """
    files = write_motions(tmp_path)
    rack = scene_of(synthetic_records(1, duration=5.0)[0])
    options = {"units": "m/s2", "realizations": 1}
    grid = np.geomspace(0.1, 4.0, 12)
    raw = study(rack, files, HAZARD, grid, **options)
    assert "drifts: its PGV is " in str(raw.trust)
    assert "--baseline high-pass" in raw.text()
    assert "Baseline" not in raw.text()
    mended = study(rack, files, HAZARD, grid, baseline="high-pass", **options)
    assert "drifts" not in mended.text()
    assert "Baselines of 5 records corrected (high-pass, 0.1 Hz), which removes offsets of up to 0.006" in mended.text()
    assert any(sentence.startswith("Baselines of 5 records") for sentence in mended.fragility.remarks)
    plain = [drifting(motion, 0.0, 0.0) for motion in synthetic_records(5, duration=20.0, seed=11)]
    true = study(rack, plain, HAZARD, grid, baseline="high-pass", realizations=1)
    assert mended.risk.rate == pytest.approx(true.risk.rate, rel=1e-6)
    assert abs(raw.risk.rate / true.risk.rate - 1.0) > 0.05
    with pytest.raises(ValueError, match="baseline: got 'high', accepted: 'none' or 'mean'"):
        study(rack, files, HAZARD, grid, baseline="high", **options)
    with pytest.raises(ValueError, match=r"units: got 'gal', accepted: nothing, as all files say their unit \(g\)"):
        study(rack, [files[1]], HAZARD, grid, units="gal")
    harmonic = Scene.from_block(0.5, 1.8, "0.3 g", 1.5)
    with pytest.raises(ValueError, match="baseline: got 'mean', accepted: nothing where there is no record"):
        study(harmonic, [], HAZARD, grid, baseline="mean")


def test_baselines_in_the_shell(tmp_path, capsys):
    files = [str(file) for file in write_motions(tmp_path)]
    path = tmp_path / "rack.toml"
    path.write_text(Scene.from_block(0.5, 1.8, "0.3 g", 1.5).to_toml())
    common = ["--records", *files, "--units", "m/s2"]
    risk = ["risk", str(path), *common, "--hazard", "1e-3:2", "--intensities", "0.3,1,2"]
    curves = ["fragility", str(path), *common, "--pga", "0.1,0.4"]
    for arguments in (risk, curves):
        assert main(arguments) == 0
        out = " ".join(capsys.readouterr().out.split())
        assert "drifts: its PGV is " in out
        assert main([*arguments, "--baseline", "high-pass"]) == 0
        out = " ".join(capsys.readouterr().out.split())
        assert "drifts" not in out
        assert "Baselines of 5 records corrected (high-pass, 0.1 Hz)" in out
    assert main([*curves, "--baseline", "linear", "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert any("corrected (linear)" in sentence for sentence in printed["remarks"])
    assert main(["fragility", str(path), str(path), *common, "--pga", "0.1,0.4"]) == 2
    assert "--records: got 2 scenes, accepted: one" in capsys.readouterr().err
    assert main(["fragility", str(path), "--units", "g", "--pga", "0.1,0.4"]) == 2
    assert "--units: got 'g', accepted: together with --records" in capsys.readouterr().err
    assert main([*risk, "--baseline", "other"]) == 2
    assert "baseline: got 'other'" in capsys.readouterr().err


@pytest.mark.parametrize(("name", "kind"), [("motion.sac", "SAC"), ("motion.mseed", "MSEED")])
def test_other_formats_are_read_by_obspy(tmp_path, name, kind):
    obspy = pytest.importorskip("obspy")
    samples = np.random.default_rng(4).normal(size=200).astype(np.float32)
    obspy.Stream([obspy.Trace(samples, {"sampling_rate": 50.0})]).write(str(tmp_path / name), format=kind)
    record = Record.from_file(tmp_path / name, units="m/s2", baseline="mean")
    assert record.interval == pytest.approx(0.02, rel=1e-6)
    assert record.samples == tuple(samples.astype(float).tolist())
    assert record.baseline == "mean"
    with pytest.raises(ValueError, match=r"forcing.units: missing"):
        Record.from_file(tmp_path / name)
    vertical = obspy.Trace(samples, {"sampling_rate": 50.0, "channel": "HNZ"})
    vertical.write(str(tmp_path / name), format=kind)
    with pytest.raises(ValueError, match=r"forcing.file: .* the vertical component 'HNZ'"):
        Record.from_file(tmp_path / name, units="g")
    (tmp_path / name).write_bytes(b"\0" * 1000)
    with pytest.raises(ValueError, match=r"got binary data, accepted: a text file, or what ObsPy reads .*\[obspy\]"):
        Record.from_file(tmp_path / name, units="g")


def test_obspy_traces_that_are_no_acceleration_are_refused(tmp_path):
    """Calibration factors, counts, seismometers; and no format is asked for that may run what a file says."""
    obspy = pytest.importorskip("obspy")
    samples = np.random.default_rng(4).normal(size=200).astype(np.float32)

    def refused(says, data=samples, form="SAC", **stats):
        trace = obspy.Trace(data, {"sampling_rate": 50.0, "channel": "HNE"} | stats)
        trace.write(str(tmp_path / "motion"), format=form)
        with pytest.raises(ValueError, match=says):
            Record.from_file(tmp_path / "motion", units="g")

    refused(r"got a calibration factor of 6.3e-07 in the header \(SAC\), accepted: 1, as", calib=6.3e-7)
    refused("got raw counts 'HNE'", (1000 * samples).astype(np.int32), "MSEED")
    refused("got a seismometer's velocity 'BHE'", channel="BHE")
    refused("got a seismometer's velocity 'BHE'", channel="BHE", form="TSPAIR")
    refused("got binary data", form="PICKLE")
    stream = obspy.Stream([obspy.Trace(samples, {"channel": f"HN{letter}"}) for letter in "ENZ"])
    stream.write(str(tmp_path / "motion"), format="MSEED")
    with pytest.raises(ValueError, match=r"got 3 components, .* 1 HNE \(.*, 90°\); 2 HNN .*; 3 HNZ \(not read: the"):
        Record.from_file(tmp_path / "motion", units="g")
    assert Record.from_file(tmp_path / "motion", units="g", component="HNN").samples == tuple(samples.astype(float))


def test_a_binary_file_without_obspy_names_the_extra(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "obspy", None)
    (tmp_path / "motion.sac").write_bytes(bytes(range(256)))
    with pytest.raises(
        ValueError, match=r"accepted: a text file, or what ObsPy reads \(pip install .fpk-rocking\[obspy"
    ):
        Record.from_file(tmp_path / "motion.sac", units="g")
