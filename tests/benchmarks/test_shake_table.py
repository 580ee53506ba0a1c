"""The benchmark of shake-table tests: its scores against sums of one's own, its page against what it measured."""

import importlib
import json
import math
import pathlib
import re
import sys

import numpy as np
import pytest
import scipy

from fpk_rocking import Record
from fpk_rocking.risk.calibration import block_scene
from montecarlo import simulate

ROOT = pathlib.Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "benchmarks"))
benchmark = importlib.import_module("shake_table")
scoring = importlib.import_module("shake_table_scores")
RESULTS = json.loads((ROOT / "docs" / "benchmarks" / "shake_table_tests.json").read_text(encoding="utf-8"))
PAGE = " ".join((ROOT / "docs" / "world.md").read_text(encoding="utf-8").split())


def test_a_test_is_predicted_by_what_is_fitted_to_other_motions():
    record = np.array(list("aabbcc"))
    observed = np.array([True, False, True, True, False, True])

    def model(outcomes):
        return lambda counted: np.full(6, outcomes[counted].mean())

    splits = np.array([[1, 1, 1, 1, 0, 0], [0, 0, 1, 1, 1, 1], [1, 1, 0, 0, 1, 1]], bool)
    brier, loss, right, p = scoring.cross_validated(model, observed, splits)[:, [0, 1, 4, 5]]
    # Of a and c the mean of the others in the split where they are left out.
    assert p == pytest.approx([0.75] * 4)
    assert brier == pytest.approx([0.0625, 0.5625, 0.5625, 0.0625])
    assert loss == pytest.approx(-np.log([0.75, 0.25, 0.25, 0.75]))
    assert list(right) == [1, 0, 0, 1]
    for counted in scoring.splits_of(record, count=30):
        assert all(len(set(counted[record == name])) == 1 for name in "abc")


def test_standard_errors_are_by_ground_motion():
    values, record = np.repeat([1.0, 3.0, 8.0], 4), np.repeat([0, 1, 2], 4)
    assert scoring.grouped_error(values, record) == pytest.approx(np.std([1.0, 3.0, 8.0], ddof=1) / math.sqrt(3))
    assert scoring.grouped_error(values, np.arange(12)) == pytest.approx(values.std(ddof=1) / math.sqrt(12))


def test_z_is_that_of_outcomes_drawn_with_the_probabilities():
    # Of 2,000 data sets; a standard deviation of 1 is off by .05 in 1 of 700.
    rng = np.random.default_rng(4)
    p = rng.uniform(0.05, 0.95, 300)
    z = np.array([scoring.calibration_z(p, rng.random(300) < p) for _ in range(2000)])
    assert z.mean(axis=0) == pytest.approx([0, 0], abs=0.08)
    assert z.std(axis=0) == pytest.approx([1, 1], abs=0.05)
    y = rng.random(300) < p
    deviation = math.sqrt(((1 - 2 * p) ** 2 * p * (1 - p)).sum())
    assert scoring.calibration_z(p, y)[1] == pytest.approx((np.square(y - p) - p * (1 - p)).sum() / deviation)
    assert min(scoring.calibration_z(p**2, rng.random(300) < p)) > 2


def test_logistic_regression_is_that_of_a_minimizer():
    rng = np.random.default_rng(5)
    x, y = rng.standard_normal((80, 2)), rng.random(80) < 0.4

    def loss(b):
        return np.logaddexp(0, np.where(y, -1, 1) * (b[0] + x @ b[1:])).sum() + 0.5e-3 * (b**2).sum()

    assert scoring.logistic(x, y) == pytest.approx(scipy.optimize.minimize(loss, np.zeros(3)).x, abs=1e-3)


def test_measures_and_their_order_of_outcomes():
    time = 0.005 * np.arange(2000)
    pulse = np.where(time < 0.5, np.sin(4 * np.pi * time), 0.0)
    measures = scoring.measures_of([0.1 * pulse, 0.3 * pulse], 0.005)
    assert measures["PGA"] == pytest.approx([0.1, 0.3], rel=1e-3)
    # ∫ sin = 2/ω of half a wave, less what is below the corner.
    assert measures["PGV"] == pytest.approx(9.80665 * measures["PGA"] * 2 / (4 * np.pi), rel=0.2)
    assert measures["CAV"] == pytest.approx(measures["PGA"] * 2 / np.pi * 0.5, rel=0.01)
    observed = np.array([True, False, True, False])
    pairs = [(3, 1), (3, 2), (2, 1), (2, 2)]
    wanted = np.mean([1.0 if high > low else 0.5 for high, low in pairs])
    assert scoring.area_under(np.array([3, 1, 2, 2]), observed) == pytest.approx(wanted)
    strange = scoring.inversions(np.array([0.1, 0.2, 0.3, 0.1]), np.array([0, 0, 0, 1]), observed)
    assert list(strange) == [True, True, False, False]


def test_predictions_are_means_over_the_kept_blocks(tmp_path):
    samples = np.round(5000 * np.sin(2 * np.pi * 0.005 * np.arange(300))).astype(np.int16)
    file = {"ids": np.array([7, 9]), "dt": 0.005, "a7": samples, "a9": samples // 4}
    angles, draws = [0.06, 0.12, 0.24], [[5.0, 0.8], [4.0, 0.9]]
    stored = {
        "parameters": ["frequency_parameter", "restitution"],
        "draws": draws,
        "critical_angle": angles,
        "weights": [[0.1, 0.2, 0.1], [0.3, 0.2, 0.1]],
        "stray": 0.04,
    }
    path = tmp_path / "blocks.json"
    path.write_text(json.dumps({"rock": stored}), encoding="utf-8")
    predicted = benchmark.predict(file, path)["rock"]
    for number in ("7", "9"):
        motion, mean = Record(0.005, tuple((1e-4 * file[f"a{number}"]).tolist()), "g"), 0.0
        for (p, e), weights in zip(draws, stored["weights"], strict=True):
            for angle, weight in zip(angles, weights, strict=True):
                scene = block_scene(motion, critical_angle=angle, frequency_parameter=p, restitution=e)
                mean += weight * bool(simulate(scene, times=[scene.forcing.duration + 10.0]).overturn_side[0])
        assert predicted[number] == pytest.approx(0.02 + 0.96 * mean, abs=1e-5)
    assert predicted["7"] > predicted["9"]


def pair(value, digits):
    """Text "a and b" of a number of either specimen, `value(row of the results)`, without the zero before the point."""
    texts = (f"{value(RESULTS[name]):.{digits}f}" for name in benchmark.SPECIMENS)
    return " and ".join(re.sub(r"\b0\.", ".", text) for text in texts)


def phrases():
    """What the text of the page says in numbers."""
    area, variants = "area under the ROC", "sensitivity"
    main, both = benchmark.MAIN, "logistic, PGA and PGV/PGA"
    yield f"of frequency parameter and restitution count like {pair(lambda row: row['effective draws'], 0)} equally"
    yield f"is {pair(lambda row: row['scores'][main]['z of the sum'], 1)} standard deviations from"
    yield f"{pair(lambda row: row['wrong'], 0)} of 238 are predicted wrongly"
    yield f"its area under the ROC curve is {pair(lambda row: row[area]['PGV'], 3)}, against"
    yield f"against {pair(lambda row: row[area]['PGA'], 3)} of PGA"
    yield f"not seen, have {pair(lambda row: row[area][main], 3)}."
    first, second = (
        RESULTS[name]["scores"][both]["Brier above"] / RESULTS[name]["scores"][both]["Brier above, error"]
        for name in benchmark.SPECIMENS
    )
    yield f"of the pair PGA and PGV/PGA by {second:.1f} on specimen 2, but by only {first:.1f} on specimen 1"
    single = [
        row["Brier above"] / row["Brier above, error"]
        for name in benchmark.SPECIMENS
        for model, row in RESULTS[name]["scores"].items()
        if model.startswith(benchmark.LOGISTIC) and model != both
    ]
    yield f"of every single intensity measure by at least {min(single):.1f} standard errors"
    housner = pair(lambda row: 1.0 - 1.5 * math.sin(row["posterior"]["critical_angle"][0]) ** 2, 3)
    yield f"Housner's restitution would be {housner}."
    yield f"This page uses {len(RESULTS['tests']['id'])} tests of each rock"
    missed = (
        f"{RESULTS[name]['wrong, predicted to stand']} of {RESULTS[name]['wrong']}" for name in benchmark.SPECIMENS
    )
    yield f"{' and '.join(missed)} overturned"
    priors = [[RESULTS[name][variants][text] for name in benchmark.SPECIMENS] for text in benchmark.PRIORS]
    most = (max(abs(row["Brier above"]) for rows in some for row in rows) for some in (priors[:3], priors[3:]))
    for text, value in zip(("the Brier score by at most", "were tried, with scores within"), most, strict=True):
        yield f"{text} {value:.4f}".replace("0.", ".")


@pytest.mark.parametrize("line", [*benchmark.page_rows(RESULTS), *phrases()])
def test_the_page_has_what_was_measured(line):
    assert " ".join(line.split()) in PAGE


def test_the_readme_has_the_shares_right():
    text = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    first, second = (100.0 * RESULTS[name]["scores"][benchmark.MAIN]["share right"] for name in benchmark.SPECIMENS)
    assert f"it predicts {first:.0f} and {second:.0f} % of the outcomes correctly" in text
