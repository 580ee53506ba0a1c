"""Blocks under the same motions: ratios with their limits by other formulas, what is printed, drawn and exported."""

import csv
import dataclasses
import json
import math
import re

import matplotlib.pyplot as plt
import numpy as np
import pytest
from scipy import stats
from scripts import benchmark
from suites import SCALES, SIZE, record, searched, suite

from fpk_rocking import BandNoise, Block, Dimensions, NoNoise, Record, Scene, cli
from fpk_rocking.risk import Designs, Hazard, IntensityCurve, annual_frequency, at_intensity, study
from fpk_rocking.risk.capacities import Capacities, paired_draws
from fpk_rocking.risk.designs import ratio_of
from fpk_rocking.risk.picture import draw_curves, draw_ratios

# Pulses overturn a block from one intensity on, nearly: a lognormal fit stands.
TIMES = np.arange(0.0, 3.0, 0.02)
MOTIONS = [
    Record(0.02, np.where(period > TIMES, 4.0 * np.sin(2.0 * np.pi * TIMES / period), 0.0), "m/s2", event=f"{period:g}")
    for period in np.linspace(1.3, 2.3, 6)
]
HAZARD = Hazard.power_law(1e-3, 2.5)
BLOCKS = {"narrow": SIZE, "wide": Dimensions(0.75, 2.0)}


def studied(name):
    scene = Scene(Block(0.9, BLOCKS[name]), MOTIONS[0], NoNoise())
    return study(scene, MOTIONS, HAZARD, [0.4, 0.8, 1.6], name=name)


@pytest.fixture(scope="module")
def both():
    return Designs((studied("narrow"), studied("wide")))


def test_limits_of_the_ratio_of_medians_are_those_of_a_paired_t_test(both):
    (ratio,) = both.ratios
    logs = np.diff(np.log(both.equivalent), axis=1)[:, 0]
    limits = stats.ttest_1samp(logs, 0.0).confidence_interval(0.95)
    assert ratio.median == pytest.approx(math.exp(logs.mean()), rel=1e-9)
    # 5,000 draws: a limit moves by a fiftieth of its distance.
    reach = 0.05 * (limits.high - limits.low)
    assert (math.log(ratio.median_low), math.log(ratio.median_high)) == pytest.approx(tuple(limits), abs=reach)
    first, second = (one.curve.fit.median_interval for one in both.studies)
    assert ratio.median_high / ratio.median_low < 0.7 * (second[1] / first[0]) / (second[0] / first[1])
    assert ratio.rate == pytest.approx(both.studies[1].risk.rate / both.studies[0].risk.rate, rel=1e-12)
    assert ratio.rate_low < ratio.rate < ratio.rate_high


def test_draws_of_pairs_have_the_margins_of_each_block():
    """Medians of the differences by t, dispersions of both by chi-square: quantiles of 20,000 draws."""
    rng = np.random.default_rng(4)
    logs = rng.multivariate_normal([0.1, 0.4], [[0.16, 0.13], [0.13, 0.25]], 12)
    one, two = (Capacities.exact(np.exp(column)) for column in logs.T)
    drawn = paired_draws(one, two, 20_000, rng)
    differences = np.log(drawn[:, 1, 0] / drawn[:, 0, 0])
    apart = logs[:, 1] - logs[:, 0]
    expected = stats.t(11, apart.mean(), apart.std(ddof=1) / math.sqrt(12)).ppf([0.025, 0.5, 0.975])
    assert np.quantile(differences, [0.025, 0.5, 0.975]) == pytest.approx(expected, abs=0.01)
    for place in (0, 1):
        spread = logs[:, place].std(ddof=1)
        # The order of the pair, difference first, makes dispersions of few motions a tenth wider than for one block.
        alone = spread * math.sqrt(11 / stats.chi2(11).median())
        assert alone < np.median(drawn[:, place, 1]) < 1.15 * alone
        assert np.median(np.log(drawn[:, place, 0])) == pytest.approx(logs[:, place].mean(), abs=0.01)
    # With two rows for each motion the scatter within is that of the rows.
    motion, within = np.repeat(np.arange(60), 2), 0.2 * rng.standard_normal((120, 2))
    rows = rng.multivariate_normal([0.0, 0.0], [[0.09, 0.05], [0.05, 0.09]], 60)[motion] + within
    one, two = (Capacities.exact(np.exp(column), motion=motion) for column in rows.T)
    drawn = paired_draws(one, two, 20_000, rng)
    for place, part in enumerate((one, two)):
        population, _ = part.draws(20_000, rng)
        alone = np.quantile(np.linalg.norm(population[:, 1:], axis=1), [0.025, 0.5, 0.975])
        assert np.quantile(drawn[:, place, 1], [0.025, 0.5, 0.975]) == pytest.approx(alone, rel=0.05)


def test_a_block_has_its_own_rate_against_itself(both):
    (ratio,) = Designs((both.studies[0], dataclasses.replace(both.studies[0], name="again"))).ratios
    assert (ratio.median, ratio.rate) == (1.0, 1.0)
    assert (ratio.rate_low, ratio.median_high) == pytest.approx((1.0, 1.0), abs=1e-3)


def test_with_noise_blocks_are_compared_too():
    """Twenty motions, 1,000 paths at each scale, the second block 1.3 times as strong; noise of dispersion .2."""
    rng = np.random.default_rng(7)
    noise = BandNoise(0.01, (0.0, 8.0), 10)
    noisy = [at_intensity(Scene(Block(0.9, SIZE), record(n), noise)) for n in range(20)]
    logs, found = math.log(0.6) + 0.3 * rng.standard_normal(20), []
    for shift in (0.0, math.log(1.3)):
        own = logs + shift + 0.05 * rng.standard_normal(20)
        shares = rng.binomial(1000, stats.norm.cdf((np.log(SCALES) - own[:, None]) / 0.2)) / 1000
        curve = IntensityCurve.of(suite(shares, noisy, 1000), "PGV", samples=99)
        found += [curve, annual_frequency(curve, HAZARD)]
    ratio = ratio_of(*found)
    assert ratio.median == pytest.approx(1.3, rel=0.05)
    assert 1.2 < ratio.median_low < ratio.median < ratio.median_high < 1.4
    assert 0.8 * 1.3**-2.5 < ratio.rate_low < ratio.rate < ratio.rate_high < 1.25 * 1.3**-2.5


def test_what_holds_for_all_blocks_is_printed_once(both):
    text = both.text()
    lines = [line for one in both.studies for line in one.block_lines]
    assert {text.count(line) for line in lines} == {1}
    assert len(set(lines)) == len(lines) - 1  # how forces of ties are meant
    reasons = [reason for one in both.studies for reason in one.trust.reasons]
    assert len(reasons) >= 2
    for reason in reasons:
        assert text.count(reason) == 1
    assert text.count(f"trust: {both.studies[0].trust.verdict}, for reasons above") == 2


def test_what_cannot_be_compared_is_refused_by_name(both):
    narrow, wide = both.studies
    other = dataclasses.replace(wide.curve, measure="PGA")
    for changed, text in (
        ({"name": "narrow"}, "studies: got ['narrow', 'narrow'], accepted: names that differ"),
        ({"events": [0, 0, 1, 2, 3, 4]}, "accepted: the same records in the same order"),
        ({"curve": other}, "accepted: one measure"),
        ({"risk": None}, "and a hazard for all or for none"),
    ):
        with pytest.raises(ValueError, match=re.escape(text)):
            Designs((narrow, dataclasses.replace(wide, **changed)))


def test_without_a_fit_there_are_ratios_and_no_limits():
    """Capacities of two groups are not lognormal."""
    logs, found = np.repeat([0.0, 2.0], 10) + 0.01 * np.arange(20), []
    for shift in (0.0, 0.3):
        curve = IntensityCurve.of(searched(logs + shift), "scale", samples=99)
        found += [curve, annual_frequency(curve, HAZARD)]
    assert found[0].fit.rejected
    ratio = ratio_of(*found)
    assert (ratio.median, ratio.rate) == pytest.approx((math.exp(0.3), math.exp(-0.3 * 2.5)), rel=1e-9)
    assert np.isnan([ratio.median_low, ratio.median_high, ratio.rate_low, ratio.rate_high]).all()


def test_a_ratio_of_rates_without_limits_says_why(both):
    made = Designs(both.studies)
    made.__dict__["ratios"] = [both.ratios[0]._replace(rate_low=math.nan, rate_high=math.nan)]
    reason = "times (no limits, as the intensities that represent the motions' rates are not lognormal)."
    assert made.sentences[0].endswith(reason)
    assert "no limits" not in both.sentences[0]


def test_all_blocks_stand_in_one_table_of_pelicun_one_picture_and_one_report(tmp_path, capsys, both):
    for name in BLOCKS:
        text = both.studies[list(BLOCKS).index(name)].scene.to_toml()
        (tmp_path / f"{name} rack.toml").write_text("\n".join(p for p in text.split("\n\n") if "[forcing]" not in p))
    files = []
    for number, motion in enumerate(MOTIONS):
        files.append(tmp_path / f"{number}.txt")
        files[-1].write_text("\n".join(f"{0.02 * k:.2f} {a!r}" for k, a in enumerate(motion.samples)))
    scenes = [str(tmp_path / f"{name} rack.toml") for name in BLOCKS]
    arguments = ["risk", *scenes, "--records", *map(str, files), "--units", "m/s2", "--hazard", "1e-3:2.5"]
    arguments += ["--intensities", "0.4,0.8,1.6", "--friction", "0.35"]
    out = tmp_path / "out"
    assert cli.main([*arguments, "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    (ratio,) = both.ratios
    assert f"wide_rack over narrow_rack: median PGV that overturns it {ratio.median:.3g} times" in printed
    assert f"annual rate {ratio.rate:.3g} times (95 %: {ratio.rate_low:.3g} to {ratio.rate_high:.3g})" in printed
    slides = "wide_rack: With a coefficient of friction of 0.35, below 0.375, the block slides before it rocks"
    assert slides in " ".join(printed.split())
    assert f"narrow_rack: {slides[11:]}" not in printed
    lines = printed.splitlines()
    (verdict,) = [number for number, line in enumerate(lines) if line.startswith("trust: ")][:1]
    assert verdict < lines.index(next(line for line in lines if line.startswith("narrow_rack: annual rate")))
    row = both.equivalent[3]
    assert f"3.txt: {row[0]:.4g}, {row[1]:.4g} ({row[1] / row[0]:.3g} times)" in printed
    rows = list(csv.DictReader((out / "pelicun.csv").open(encoding="utf-8")))
    assert [row["ID"] for row in rows] == ["narrow_rack", "wide_rack"]
    for row, one in zip(rows, both.studies, strict=True):
        assert float(row["LS1-Theta_0"]) == pytest.approx(one.curve.fit.median, rel=1e-9)
    assert list(json.loads((out / "pelicun.json").read_text())) == ["narrow_rack", "wide_rack"]
    table = list(csv.DictReader((out / "designs.csv").open(encoding="utf-8")))
    ratios = [float(row["ratio_wide_rack"]) for row in table]
    assert ratios == pytest.approx(both.equivalent[:, 1] / both.equivalent[:, 0], rel=1e-9)
    page = (out / "report.html").read_text()
    for said in ("<h2>narrow_rack</h2>", "<h2>wide_rack</h2>", "href='wide_rack/report.html'", "lifts off at 0.375 g"):
        assert said in page
    assert (out / "designs.png").stat().st_size > 10_000
    assert {path.name for path in (out / "wide_rack").iterdir()} >= {"report.html", "curve.csv", "wide_rack.xml"}
    for more, text in (
        (["--name", "x"], "--name: got 'x', accepted: one scene"),
        (["--depth", "1"], "--depth: got '1'"),
    ):
        assert cli.main([*arguments, *more]) == 2
        assert text in capsys.readouterr().err
    assert cli.main(["risk", "main", "second", "--hazard", "1e-3:2.5"]) == 2
    assert "accepted: motions for several blocks (or --synthetic)" in capsys.readouterr().err


def test_the_pictures_have_every_curve_and_every_ratio(both):
    figure, axes = plt.subplots(1, 2)
    draw_curves(axes[0], {one.name: one.curve for one in both.studies})
    lines = {line.get_label(): line for line in axes[0].lines if line.get_label() in BLOCKS}
    for one in both.studies:
        grid, values = lines[one.name].get_data()
        assert np.array_equal(values, one.curve(grid))
        assert grid[0] < one.curve.outcomes[0][0]
        assert grid[-1] > one.curve.outcomes[0][-1]
    draw_ratios(axes[1], both)
    points = axes[1].lines[0].get_xydata()
    assert points == pytest.approx(
        np.stack([both.equivalent[:, 0], both.equivalent[:, 1] / both.equivalent[:, 0]], axis=1)
    )
    assert axes[1].lines[1].get_ydata()[0] == both.ratios[0].median
    plt.close(figure)


@pytest.mark.slow
def test_limits_of_ratios_hold():
    """Of 200 suites at least 90 % of each; a share of .95 has less in .2 % of such counts."""
    script = benchmark("paired_motions")
    found = script.ratios_hold(10, 200, 3, *script.PAIRS["dispersions .35 and .5, correlation .8, medians 1 and 1.3"])
    assert min(found["median"], found["rate"]) >= 0.9
