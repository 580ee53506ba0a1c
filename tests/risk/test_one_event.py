"""Motions of one event: one motion for curve, rate and limits, as files say or as a user does."""

import dataclasses
import json
import math
import re

import numpy as np
import pytest
from scripts import benchmark
from suites import SIZE, record, searched

from fpk_rocking import Block, NoNoise, Record, Scene, cli
from fpk_rocking.risk import Hazard, IntensityCurve, annual_frequency, study
from fpk_rocking.risk.motions import same_event


@pytest.mark.slow
def test_limits_hold_where_an_event_of_two_components_is_one_motion():
    """Of 200 suites of 20 events at least 90 %; each component for itself covers the median in fewer."""
    script = benchmark("paired_motions")
    grouped, single = (script.events_hold(20, 200, 3, grouped=grouped) for grouped in (True, False))
    assert min(grouped.values()) >= 0.9
    assert single["median"] < grouped["median"] - 0.03


def test_an_event_counts_as_one_motion_by_the_mean_of_its_components():
    """Three events of one, two and three components, by hand; a hazard im^-1 makes the rate a mean of 1/capacity."""
    critical, labels = np.array([0.5, 0.8, 1.1, 0.4, 0.9, 1.5]), ["b", "a", "a", "c", "c", "c"]
    curve = IntensityCurve.of(searched(np.log(critical)), "scale", samples=99, events=labels)
    groups = [critical[:1], critical[1:3], critical[3:]]
    assert (curve.records, curve.units) == (3, 3)
    expected = [np.mean([(group < place).mean() for group in groups]) for place in curve.intensity]
    assert curve.probability == pytest.approx(expected, abs=1e-12)
    risk = annual_frequency(curve, Hazard.power_law(1.0, 1.0))
    assert risk.rate == pytest.approx(np.mean([(1.0 / group).mean() for group in groups]), rel=1e-12)
    assert curve.fit.median == pytest.approx(math.exp(np.mean([np.log(group).mean() for group in groups])), rel=1e-12)


def test_the_part_of_the_records_has_an_error_where_components_differ_more_than_events():
    """Nothing is left between eight events; 8 degrees of freedom tell the scatter within them to a quarter."""
    logs = np.tile([-0.4, 0.4], 8) + np.repeat(np.linspace(0.0, 0.1, 8), 2)
    curve = IntensityCurve.of(searched(logs), "scale", samples=999, events=np.repeat(np.arange(8), 2).tolist())
    assert curve.sources == {"record to record": pytest.approx(curve.fit.dispersion, rel=1e-12)}
    assert curve.source_errors["record to record"] == pytest.approx(0.25 * curve.fit.dispersion, rel=0.4)


def test_two_components_of_one_event_alone_have_no_limits():
    """As two motions they would have the limits of two outcomes."""
    curve = IntensityCurve.of(searched(np.log([0.5, 0.8])), "scale", samples=99, events=["a", "a"])
    assert (curve.records, curve.units) == (1, 1)
    assert curve.title.endswith("from one event")
    assert np.isnan(curve.point_limits).all()
    assert set(curve.probability) <= {0.0, 0.5, 1.0}


def test_two_components_whose_files_say_the_same_event_and_station_are_one_motion():
    texts = ["EVENT, STATION, 090", "EVENT, STATION, 000", "EVENT, OTHER, 090", "", "", "PEER", "PEER", "PEER"]
    texts += ["A, EW", "A, NS", "TIME, ABN", "TIME, CDN", "10:05, IWT008", "10:05, IWT008"]
    motions = [Record(0.1, (0.0, 1.0 + n, 0.0), "m/s2", event=text) for n, text in enumerate(texts)]
    scenes = [Scene(Block(0.9, SIZE), motion, NoNoise()) for motion in motions]
    assert same_event(scenes) == [0, 0, 2, 3, 4, 5, 6, 7, 8, 8, 10, 11, 12, 12]
    # Equal motions are one, whatever files say, and do not make three of two components.
    again = [*scenes, scenes[1], dataclasses.replace(scenes[3], forcing=dataclasses.replace(motions[3], event="X"))]
    assert same_event(again) == [0, 0, 2, 3, 4, 5, 6, 7, 8, 8, 10, 11, 12, 12, 0, 3]


@pytest.mark.parametrize(
    ("first", "second", "one"),
    [
        ("A, B, LN (SCE STATION 23)", "A, B, TR (SCE STATION 23)", True),
        ("A, CHY101, N (CWB)", "A, CHY101, W (CWB)", True),
        ("A, B, FN", "A, B, FP", True),
        ("A, B, N09E", "A, B, S81E", True),
        ("A, B ,360", "A, B ,090", True),
        ("A, B, IRAN TRANSVERSE COMP", "A, B, IRAN LONGITUDINAL COMP", True),
        ("A, B, acc_NS (gal)", "A, B, acc_EW (gal)", True),
        ("A, B, HNN", "A, B, HNE", True),
        ("A, B, EW1", "A, B, NS1", True),
        ("A, B, 000 (STATION 1)", "A, B, 090 (STATION 2)", False),
        ("A, N HOLLYWOOD", "A, E HOLLYWOOD", False),
        ("A, LONGVIEW", "A, TRANCAS", False),
        ("A, ABN", "A, CDE", False),
        ("A, 400", "A, 401", False),
        ("A, B, N", "A, B, 000", False),
        ("A, B, 360", "A, B, 0", False),
        ("A, B, LN", "A, B, ln", False),
        ("A, B, TR", "A, B", False),
        ("LN", "TR", False),
    ],
)
def test_components_count_as_one_motion_by_any_name_and_stations_do_not(first, second, one):
    motions = [Record(0.1, (0.0, peak, 0.0), "m/s2", event=text) for peak, text in ((1.0, first), (2.0, second))]
    assert same_event([Scene(Block(0.9, SIZE), motion, NoNoise()) for motion in motions]) == [0, 0 if one else 1]


def test_records_of_one_event_are_grouped_by_a_number_in_the_shell(tmp_path, capsys):
    """Ten files in pairs are five events; the rate is the same, its limits are those of a study with labels."""
    scene, hazard, files = Scene(Block(0.9, SIZE), record(0), NoNoise()), Hazard.power_law(1e-3, 2.5), []
    (tmp_path / "rack.toml").write_text("\n".join(p for p in scene.to_toml().split("\n\n") if "[forcing]" not in p))
    for number in range(10):
        files.append(tmp_path / f"{number}.txt")
        files[-1].write_text("\n".join(f"{0.02 * k:.2f} {a!r}" for k, a in enumerate(record(number).samples)))
    arguments = ["risk", str(tmp_path / "rack.toml"), "--records", *map(str, files), "--units", "m/s2"]
    arguments += ["--hazard", "1e-3:2.5"]
    assert cli.main([*arguments, "--events", "2", "--json"]) == 0
    values = json.loads(capsys.readouterr().out)
    alone, labels = [record(number) for number in range(10)], [chr(97 + number // 2) for number in range(10)]
    labelled = study(scene, alone, hazard, events=labels)
    each = annual_frequency(IntensityCurve.of(labelled.fragility, "PGV"), hazard)
    assert values["risk"]["interval"] == pytest.approx(labelled.risk.interval, rel=1e-9)
    assert values["risk"]["rate"] == pytest.approx(each.rate, rel=1e-9)
    assert each.interval != pytest.approx(labelled.risk.interval, rel=1e-3)
    assert (labelled.curve.records, each.curve.records) == (5, 10)
    assert "10 motions are of 5 events; those of one event count as one motion." in values["remarks"]
    with pytest.raises(ValueError, match=re.escape("events: got '3 labels', accepted: 10, one for each record")):
        study(scene, alone, hazard, events=labels[:3])
    for number, said in (
        ("5", "records: got 10 of 2 events, accepted: 1, or at least 5 of different events"),
        ("4", "--events: got 4, accepted: a number of which the 10 records are a multiple"),
        ("0", "--events: got 0, accepted: a number of which the 10 records are a multiple"),
    ):
        assert cli.main([*arguments, "--events", number]) == 2
        assert said in capsys.readouterr().err
