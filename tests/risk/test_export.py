"""Files for OpenQuake and pelicun: what they hold, by readers of their formats (the real ones: `make interop`)."""

import csv
import dataclasses
import json
import math
import re
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from suites import SCALES, curve_of

from fpk_rocking.risk import Hazard, IntensityCurve, annual_frequency, to_nrml, to_pelicun
from fpk_rocking.risk.export import levels_text, rate_by_levels
from fpk_rocking.risk.lognormal import LognormalFit
from fpk_rocking.risk.rate import rate_text

SPACE = "{http://openquake.org/xmlns/nrml/0.5}"


def certain_at_last(curve):
    return dataclasses.replace(curve, probability=np.append(curve.probability[:-1], 1.0))


def table_of(file):
    (row,) = csv.DictReader(file.open())
    return (np.array(part.split(","), float) for part in row["LS1-Theta_0"].split("|"))


def refused(curve):
    return IntensityCurve(**{**vars(curve), "fit": LognormalFit(reason="made so")})


def test_a_lognormal_curve_in_nrml(tmp_path):
    file = tmp_path / "curve.xml"
    mild = IntensityCurve(**{**vars(curve_of(0.4, 0.3)), "name": "|Θ| ≥ 0.5"})
    to_nrml(file, [mild, curve_of(0.7, 0.4)], "rack_1", "a & b")
    model = ET.parse(file).getroot()[0]
    assert model.attrib == {"assetCategory": "contents", "id": "rack_1", "lossCategory": "contents"}
    assert [element.tag for element in model] == [
        SPACE + tag for tag in ("description", "limitStates", "fragilityFunction")
    ]
    verdict = "Verdict: caution. From 1 scene, the probabilities for others of its kind are known to ±0.091 at worst "
    verdict += "(95 %). PGV in this file is in cm/s."
    assert (model[0].text, model[1].text) == (f"a & b {verdict}", "angle_0p5 overturned")
    function = model[2]
    assert function.attrib == {"id": "rack_1", "format": "continuous", "shape": "logncdf"}
    assert function[0].attrib["imt"] == "PGV"
    low, high = (float(function[0].attrib[end]) for end in ("minIML", "maxIML"))
    assert function[0].attrib["noDamageLimit"] == function[0].attrib["minIML"]
    assert max(mild.fit(0.01 * low), curve_of(0.7, 0.4).fit(0.01 * low)) < 6e-7
    assert min(mild.fit(0.01 * high), curve_of(0.7, 0.4).fit(0.01 * high)) > 1.0 - 6e-7
    for params, state, median, spread in zip(
        function[1:], ("angle_0p5", "overturned"), (40.0, 70.0), (0.3, 0.4), strict=True
    ):
        mean, deviation = float(params.attrib["mean"]), float(params.attrib["stddev"])
        sigma = math.sqrt(math.log1p((deviation / mean) ** 2))  # as OpenQuake reads them
        assert params.attrib["ls"] == state
        assert sigma == pytest.approx(spread, rel=1e-12)
        assert mean * math.exp(-0.5 * sigma**2) == pytest.approx(median, rel=1e-12)  # cm/s


def test_a_curve_of_points_in_nrml(tmp_path):
    file, curve = tmp_path / "curve.xml", refused(curve_of())
    to_nrml(file, [curve], "rack")
    function = ET.parse(file).getroot()[0][2]
    assert function.attrib["format"] == "discrete"
    levels, row = (np.array(part.text.split(), float) for part in function)
    assert set(100.0 * SCALES) <= set(levels)
    assert np.array_equal(row[np.isin(levels, 100.0 * SCALES)], curve.probability)
    # Straight lines between the levels are the curve, also below its lowest point, where it is a lognormal tail.
    im = np.geomspace(levels[0], levels[-1], 5000)
    assert np.interp(im, levels, row) == pytest.approx(curve(0.01 * im), abs=2e-4)
    assert float(function[0].attrib["noDamageLimit"]) == levels[0]
    assert row[0] < 1e-6
    about = ET.parse(file).getroot()[0][0].text
    assert "made so" in about
    assert f"The curve stands here at {levels.size} levels, for straight lines between them." in about


def test_a_curve_that_begins_high_goes_on_below_its_lowest_point(tmp_path):
    """From .4 on, a straight line down from its first point would give 3 times the rate."""
    places = np.geomspace(0.4, 3.0, 12)
    own = {"intensity": places, "probability": curve_of().fit(places), "interval": np.zeros((12, 2))}
    curve = refused(IntensityCurve(**{**vars(curve_of()), **own}))
    to_nrml(tmp_path / "curve.xml", [curve], "rack")
    to_pelicun(tmp_path / "rack.csv", certain := certain_at_last(curve), "rack")
    function = ET.parse(tmp_path / "curve.xml").getroot()[0][2]
    levels, row = (np.array(part.text.split(), float) for part in function)
    hazard = Hazard([0.1, 0.5, 2.0], [5e-2, 3e-3, 2.5e-5])
    im = np.geomspace(1e-3, 30.0, 200_001)
    middle, lost = np.sqrt(im[1:] * im[:-1]), -np.diff(hazard(im))
    rate = annual_frequency(curve, hazard).exported_rate
    assert (np.interp(100.0 * middle, levels, row, left=0.0) * lost).sum() == pytest.approx(rate, rel=1e-3)
    assert (np.interp(middle, curve.intensity, curve.probability) * lost).sum() > 2.0 * rate
    x, p = table_of(tmp_path / "rack.csv")
    assert (np.interp(middle, x, p) * lost).sum() == pytest.approx(annual_frequency(certain, hazard).rate, rel=2e-3)


def test_one_curve_of_points_makes_the_others_points_too(tmp_path):
    file, mild = tmp_path / "curve.xml", IntensityCurve(**{**vars(curve_of(0.4)), "name": "|Θ| ≥ 0.5"})
    to_nrml(file, [mild, refused(curve_of())], "rack")
    function = ET.parse(file).getroot()[0][2]
    assert function.attrib["format"] == "discrete"
    kept = np.isin(np.array(function[0].text.split(), float), 100.0 * SCALES)
    rows = {row.attrib["ls"]: np.array(row.text.split(), float)[kept].tolist() for row in function[1:]}
    assert rows == {"angle_0p5": mild.probability.tolist(), "overturned": curve_of().probability.tolist()}


@pytest.mark.parametrize("fitted", [True, False])
def test_states_that_cross_are_refused_or_told(tmp_path, fitted):
    made = (lambda curve: curve) if fitted else refused
    mild = made(IntensityCurve(**{**vars(curve_of(0.6, 0.3)), "name": "|Θ| ≥ 0.5"}))
    with pytest.raises(ValueError, match=r"^curves: got \"'overturned' likelier than '\|Θ\| ≥ 0\.5' by 0\.\d+ at PGV "):
        to_nrml(tmp_path / "x", [mild, made(curve_of(0.6, 0.4))], "rack")
    with pytest.raises(ValueError, match="accepted: the milder state first"):
        to_nrml(tmp_path / "x", [curve_of(0.9), mild], "rack")
    assert not list(tmp_path.iterdir())
    to_nrml(tmp_path / "x", [mild, made(curve_of(0.9, 0.42))], "rack")
    about = ET.parse(tmp_path / "x").getroot()[0][0].text
    at = np.geomspace(0.1, 3.0, 20_001)
    worst = (curve_of(0.9, 0.42).fit(at) - curve_of(0.6, 0.3).fit(at)).max()
    assert 1e-5 < worst < 0.01
    assert f"The states cross: 'overturned' likelier than '|Θ| ≥ 0.5' by {worst:.2g} at PGV " in about or not fitted
    assert "; OpenQuake counts that as a negative share." in about


def test_accelerations_stay_in_g(tmp_path):
    file = tmp_path / "curve.xml"
    to_nrml(file, [refused(IntensityCurve(**{**vars(curve_of()), "measure": "PGA"}))], "rack")
    function = ET.parse(file).getroot()[0][2]
    assert function[0].attrib["imt"] == "PGA"
    assert set(SCALES) <= set(np.array(function[0].text.split(), float))


@pytest.mark.parametrize("fitted", [True, False])
def test_a_row_of_pelicun(tmp_path, fitted):
    share = np.array([0, 0, 0.1, 0.3, 0.3, 0.2, 0.4, 0.6, 0.8, 1, 1, 1])
    points = refused(IntensityCurve(**{**vars(curve_of()), "probability": share}))
    file, curve = tmp_path / "rack.csv", curve_of() if fitted else points
    to_pelicun(file, curve, "RACK")
    (row,) = csv.DictReader(file.open())
    assert (row["ID"], row["Demand-Type"], row["Demand-Unit"]) == ("RACK", "Peak Ground Velocity", "mps")
    if fitted:
        assert (row["LS1-Family"], float(row["LS1-Theta_0"]), float(row["LS1-Theta_1"])) == ("lognormal", 0.7, 0.4)
    else:
        assert row["LS1-Family"] == "multilinear_CDF"
        x, p = table_of(file)
        assert set(SCALES[[2, 3, 6, 7, 8, 9]]) <= set(x)
        rising = curve.along(np.maximum.accumulate(share), middle := np.geomspace(0.1, 3.0, 999))
        assert np.interp(middle, x, p) == pytest.approx(rising, abs=5e-4)
        # What pelicun refuses, after it has rounded both to six digits.
        assert (p[0], p[-1]) == (0.0, 1.0)
        for values in (x, p):
            assert (np.diff([float(f"{value:g}") for value in values]) > 1e-8).all()
    assert row["Demand-Directional"] == "1"  # a demand without a direction counts 1.2 times
    assert "pelicun takes as 1.2 times" in json.loads(file.with_suffix(".json").read_text())["RACK"]["Description"]
    assert (
        json.loads(file.with_suffix(".json").read_text())["RACK"]["LimitStates"]["LS1"]["DS1"]["Description"]
        == "overturned"
    )


def test_points_close_to_0_and_1_are_left_out_for_pelicun(tmp_path):
    share = np.array([0, 1e-9, 2e-9, 0.3, 0.3 + 1e-8, 0.5, 0.9, 1 - 1e-9, 1 - 1e-10, 1, 1, 1])
    to_pelicun(tmp_path / "rack.csv", refused(IntensityCurve(**{**vars(curve_of()), "probability": share})), "rack")
    _, p = table_of(tmp_path / "rack.csv")
    assert (np.diff([float(f"{value:g}") for value in p]) > 1e-8).all()
    assert (p[0], p[-1]) == (0.0, 1.0)


def test_what_openquake_makes_of_levels():
    """Three levels by hand; and many, of which it gives the rate itself."""
    curve, hazard = curve_of(0.7, 0.4), Hazard([0.1, 0.5, 2.0], [5e-2, 3e-3, 2.5e-5])
    occurring = [0.5 * (5e-2 - 3e-3), 0.5 * (5e-2 - 2.5e-5), 0.5 * (3e-3 - 2.5e-5)]
    own = sum(rate * curve(level) for rate, level in zip(occurring, hazard.intensity, strict=True))
    assert rate_by_levels(curve, hazard.intensity, hazard.rate) == pytest.approx(own, rel=1e-12)
    risk = annual_frequency(curve, hazard)
    assert own > 3.0 * risk.rate
    text = levels_text(risk)
    said = f"alone: its classical_damage gives the rate {rate_text(own)} from the 3 levels of this study, and "
    assert said in text
    found = re.search(r" and (.*) from (\d+) levels 5 % apart from ([\d.]+) to ([\d.]+) cm/s\.$", text)
    dense, count, low, high = found.groups()
    assert float(dense) == pytest.approx(risk.rate, rel=2e-3)
    assert float(high) / float(low) == pytest.approx(1.05 ** (int(count) - 1), rel=1e-2)


def test_pelicun_takes_no_points_that_end_below_certainty(tmp_path):
    with pytest.raises(ValueError, match=r"^probability at the highest intensity: got 0\.99.*give higher intensities"):
        to_pelicun(tmp_path / "x", refused(curve_of()), "RACK")


def test_what_cannot_be_written_is_refused_by_name(tmp_path):
    other = IntensityCurve(**{**vars(curve_of()), "intensity": 2.0 * SCALES})
    with pytest.raises(ValueError, match=r"^curves: got 'overturned', accepted: curves of one measure"):
        to_nrml(tmp_path / "x", [curve_of(), other], "rack")
    with pytest.raises(ValueError, match=r"^curves: got \[\], accepted: at least one"):
        to_nrml(tmp_path / "x", [], "rack")
    for name in ("a b", "", "x" * 76, 3):
        with pytest.raises(ValueError, match=r"^name: got "):
            to_pelicun(tmp_path / "x", curve_of(), name)
    assert not list(tmp_path.iterdir())
