"""Files for OpenQuake and pelicun: what they hold, by readers of their formats (the real ones: `make interop`)."""

import csv
import json
import math
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from suites import SCALES, curve_of

from fpk_rocking.risk import IntensityCurve, to_nrml, to_pelicun
from fpk_rocking.risk.lognormal import LognormalFit

SPACE = "{http://openquake.org/xmlns/nrml/0.5}"


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
    verdict = "Verdict: caution. For others of their kind 1 scene tell the probabilities to ±0.091 at worst (95 %). "
    verdict += "PGV in this file is in cm/s."
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
    assert np.array_equal(np.array(function[0].text.split(), float), 100.0 * SCALES)
    assert np.array_equal(np.array(function[1].text.split(), float), curve.probability)
    assert "made so" in ET.parse(file).getroot()[0][0].text


def test_one_curve_of_points_makes_the_others_points_too(tmp_path):
    file, mild = tmp_path / "curve.xml", IntensityCurve(**{**vars(curve_of(0.4)), "name": "|Θ| ≥ 0.5"})
    to_nrml(file, [mild, refused(curve_of())], "rack")
    function = ET.parse(file).getroot()[0][2]
    assert function.attrib["format"] == "discrete"
    rows = {row.attrib["ls"]: np.array(row.text.split(), float).tolist() for row in function[1:]}
    assert rows == {"angle_0p5": mild.probability.tolist(), "overturned": curve_of().probability.tolist()}


def test_accelerations_stay_in_g(tmp_path):
    file = tmp_path / "curve.xml"
    to_nrml(file, [refused(IntensityCurve(**{**vars(curve_of()), "measure": "PGA"}))], "rack")
    function = ET.parse(file).getroot()[0][2]
    assert function[0].attrib["imt"] == "PGA"
    assert np.array_equal(np.array(function[0].text.split(), float), SCALES)


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
        x, p = (np.array(part.split(","), float) for part in row["LS1-Theta_0"].split("|"))
        assert p.tolist() == [0.0, 0.1, 0.3, 0.4, 0.6, 0.8, 1.0]
        assert np.array_equal(x, SCALES[[1, 2, 3, 6, 7, 8, 9]])
    assert (
        json.loads(file.with_suffix(".json").read_text())["RACK"]["LimitStates"]["LS1"]["DS1"]["Description"]
        == "overturned"
    )


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
