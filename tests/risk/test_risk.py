"""From a fragility to an annual frequency: curves over records, hazards, closed forms."""

import csv
import dataclasses
import json
import math

import numpy as np
import pytest
from scipy import stats

from fpk_rocking import BandNoise, Block, Dimensions, Harmonic, NoNoise, Pulse, Record, Scene, cli, studies
from fpk_rocking.results.trust import CAUTION, UNUSABLE
from fpk_rocking.risk import Hazard, IntensityCurve, annual_frequency, at_intensity, study
from fpk_rocking.studies import drawn, fragility, synthetic_records
from fpk_rocking.studies.lognormal import LognormalFit, fit_lognormal
from fpk_rocking.studies.result import Fragility
from fpk_rocking.studies.scenes import intensities, intensity_of
from fpk_rocking.studies.tasks import TASKS
from montecarlo import histories, simulate

SIZE = Dimensions(0.6, 2.0)
SCALES = np.geomspace(0.1, 3.0, 12)


def curve_of(median=0.7, spread=0.4, records=1, replicates=None):
    """Make a curve whose points lie on a lognormal one."""
    fit = LognormalFit(median, spread, misfit=0.0)
    share = fit(SCALES)
    limits = np.stack([0.9 * share, np.minimum(1.0, 1.1 * share)], axis=-1)
    own = np.empty((0, 2)) if replicates is None else np.asarray(replicates, float)
    return IntensityCurve("overturned", "PGV", SCALES, share, limits, fit, own, records, units=records)


@pytest.mark.parametrize("median", [0.05, 0.7, 20.0])
@pytest.mark.parametrize("spread", [0.05, 0.4, 1.2])
@pytest.mark.parametrize("exponent", [0.5, 2.0, 6.0])
def test_the_frequency_of_a_lognormal_curve_under_a_power_law_is_the_closed_form(median, spread, exponent):
    risk = annual_frequency(curve_of(median, spread), Hazard.power_law(3e-4, exponent))
    exact = 3e-4 * median**-exponent * math.exp(0.5 * (exponent * spread) ** 2)
    assert risk.rate == pytest.approx(exact, rel=1e-10)
    assert risk.return_period == pytest.approx(1.0 / exact, rel=1e-10)
    assert risk.probability(10.0) == pytest.approx(1.0 - math.exp(-10.0 * exact), rel=1e-9)
    assert risk.contribution.sum() == pytest.approx(0.999, abs=1e-3)


def test_the_frequency_is_that_of_sampled_intensities():
    """A bent hazard, by 200,000 intensities drawn from it: 4 standard errors, false alarm 6e-5."""
    hazard = Hazard([0.1, 0.3, 1.0, 3.0], [1e-1, 2e-2, 1e-3, 1e-5])
    curve, rng = curve_of(0.8, 0.5), np.random.default_rng(1)
    rates = hazard(0.02) * (1.0 - rng.random(200_000))
    # The inverse of the hazard, piecewise linear in logarithms and going on beyond its points.
    grid = np.geomspace(0.02, 50.0, 40_001)
    drawn = np.exp(np.interp(-np.log(rates), -np.log(hazard(grid)), np.log(grid)))
    values = hazard(0.02) * curve(drawn)
    risk = annual_frequency(curve, hazard)
    assert abs(values.mean() - risk.rate) < 4.0 * values.std() / math.sqrt(values.size)
    middle, lost = np.sqrt(grid[1:] * grid[:-1]), -np.diff(hazard(grid))
    shares = np.histogram(middle, risk.edges, weights=lost * curve(middle))[0] / risk.rate
    assert np.abs(shares - risk.contribution).max() < 1e-3  # the points of the hazard lie inside bins


def test_a_curve_of_points_is_joined_by_lines_in_the_logarithm():
    curve = curve_of()
    points = IntensityCurve(**{**vars(curve), "fit": LognormalFit(reason="none")})
    hazard = Hazard.power_law(1e-3, 2.0)
    grid = np.linspace(math.log(SCALES[0]) - 7.0, math.log(SCALES[-1]) + 20.0, 2_000_001)
    middle = 0.5 * (grid[1:] + grid[:-1])
    rates = hazard(np.exp(grid))
    for side, found in ((curve.probability, "rate"), (curve.interval[:, 0], 0), (curve.interval[:, 1], 1)):
        joined = np.interp(middle, np.log(SCALES), side)
        below = stats.norm.cdf(stats.norm.ppf(side[0]) + (middle - math.log(SCALES[0])) / 0.5)
        shares = np.where(middle < math.log(SCALES[0]), below, joined) * -np.diff(rates)
        direct = shares.sum()
        risk = annual_frequency(points, hazard)
        if found == "rate":
            assert risk.below_curve == pytest.approx(shares[middle < math.log(SCALES[0])].sum() / direct, rel=1e-4)
            assert f"fragility give {100 * risk.below_curve:.2g} % of the rate." in risk.sentences[0]
        assert (risk.rate if found == "rate" else risk.interval[found]) == pytest.approx(direct, rel=1e-6)


def test_limits_are_those_of_the_replicates_and_what_lies_beyond_is_told():
    replicates = [(0.7 * math.exp(0.1 * z), 0.4) for z in np.linspace(-1.0, 1.0, 41)]
    risk = annual_frequency(curve_of(replicates=replicates), Hazard([0.5, 2.0], [4e-3, 2.5e-4]))
    assert risk.interval == pytest.approx([risk.rate * math.exp(0.2 * z) for z in (-0.95, 0.95)], rel=1e-9)
    assert risk.beyond_hazard > 0.2
    assert risk.sentences[0].startswith(
        "annual rate of overturning = 2.81e-3 (95 %: 2.32e-3 to 3.40e-3): return period"
    )
    assert any(
        "beyond the points of the hazard curve, where its last power law goes on: " in one for one in risk.sentences
    )
    points = annual_frequency(
        dataclasses.replace(curve_of(2.0), fit=LognormalFit(reason="left out")), Hazard.power_law(1e-3, 0.5)
    )
    assert "upper limits, which is wider than the limits of a fit" in points.sentences[0]
    assert "the fragility, where a lognormal curve of dispersion 0.5 goes on below, the last " in points.sentences[1]
    assert [diagnostic.kind for diagnostic in risk.diagnostics][:1] == ["the hazard curve"]
    assert risk.relative_error == pytest.approx(math.log(risk.interval[1] / risk.interval[0]) / (2 * 1.96))
    wide = annual_frequency(curve_of(), Hazard(np.geomspace(1e-3, 1e3, 30), 1e-3 * np.geomspace(1e-3, 1e3, 30) ** -2.0))
    assert wide.beyond_hazard < 1e-6
    assert wide.beyond_curve < 0.05
    assert len(wide.sentences) == 1
    assert wide.rate == pytest.approx(risk.rate, rel=1e-10)


@pytest.mark.parametrize(
    ("measure", "factor", "unit", "own"),
    [("PGV", 100.0, "cm/s", "m/s"), ("PGA", 9.80665, "m/s²", "g"), ("PGA", 980.665, "cm/s²", "g")],
)
def test_a_rate_from_beyond_the_points_is_of_no_use_and_the_unit_that_was_meant_is_named(measure, factor, unit, own):
    """The hazard of .003 to 6 of the right unit in a file of another one; then one that none explains."""
    curve = dataclasses.replace(
        curve_of(0.7 if factor < 10.0 else 0.3, 0.3, replicates=[(0.7, 0.3)] * 9), measure=measure
    )
    meant = Hazard(np.geomspace(0.02, 6.0, 20), np.geomspace(1e-1, 1e-6, 20))
    assert annual_frequency(curve, meant).diagnostics == []
    least = 0.02 if factor > 50.0 else 0.3
    given = factor * np.geomspace(least, 6.0, 20)
    ((severity, message, *_),) = annual_frequency(curve, Hazard(given, meant.rate)).diagnostics
    assert severity == UNUSABLE
    assert f"Are the intensities of the hazard in {unit}? They were read in {own}, as {given[0]:.4g} to" in message
    assert message.endswith(f"in {unit} they are {least:.4g} to 6 {own}.")
    far = annual_frequency(curve, Hazard(1e6 * meant.intensity, meant.rate)).diagnostics[0]
    assert (far.severity, far.message.endswith("goes on: give more of them.")) == (UNUSABLE, True)
    share = annual_frequency(curve, Hazard([0.71 * curve.fit.median, 6.0], [1e-2, 1e-5]))
    assert 0.05 < share.beyond_hazard < 0.5
    assert [one.severity for one in share.diagnostics] == [CAUTION]


def test_a_power_law_holds_at_all_intensities():
    """It says so by having no points that anything lies beyond, and by its law as a text."""
    law = Hazard.power_law(2e-3, 2.5)
    assert annual_frequency(curve_of(0.05, 0.3), law).beyond_hazard < 1e-6
    assert law.law == "0.002 im^-2.5"
    assert Hazard([0.1, 1.0, 3.0], [1e-2, 1e-3, 1e-4]).law == ""


@pytest.mark.parametrize(
    "text",
    ["im,rate\n0.1,1e-2\n1,1e-4\n", "# g\n0.1;1e-2\n\n1;1e-4", "0.1\t0.01\n1\t0.0001\n", "0.1 1e-2\n1 1e-4"],
    ids=["comma", "semicolon", "tab", "blank"],
)
def test_hazards_are_read_from_two_columns(tmp_path, text):
    file = tmp_path / "h.csv"
    file.write_text(text)
    assert Hazard.from_csv(file)(0.3) == pytest.approx(1e-2 * 3.0**-2.0, rel=1e-12)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "got no numbers"),
        ("0.1,1e-2\nx,1\n", "line 2: got 'x,1'"),
        ("0.1,1e-2\n1\n", "line 2: got '1'"),
        ("0.1,1e-2,3\n", "got no numbers"),
        ("0.1,1e-2\n0.1,1e-3\n", r"hazard\.intensity\[1\]: got 0\.1, accepted: values that rise"),
        ("0.1,1e-2\n0.2,1e-2\n", r"hazard\.rate\[1\]: got 0\.01, accepted: values that fall"),
        ("0.1,1e-2\n0.2,-1\n", r"hazard\.rate: got"),
        ("0.1,1e-2\n", r"hazard\.intensity: got"),
    ],
)
def test_what_is_no_hazard_is_refused_by_name(tmp_path, text, said):
    file = tmp_path / "h.csv"
    file.write_text(text)
    with pytest.raises(ValueError, match=said):
        Hazard.from_csv(file)


def record(seed):
    """Make a noisy record of a strength of its own."""
    time, rng = np.arange(0.0, 6.0, 0.02), np.random.default_rng(seed)
    waves = np.sin(2.0 * np.pi * np.outer(time, rng.uniform(0.5, 4.0, 6)) + rng.uniform(0.0, 6.0, 6)).sum(axis=1)
    return Record(0.02, rng.uniform(0.5, 2.0) * waves * np.exp(-(((time - 2.5) / 1.5) ** 2)), "m/s2", 1.0)


def test_scenes_at_an_intensity_have_it():
    scene = Scene(Block(0.9, SIZE), record(1), BandNoise(0.01, (0.0, 10.0), 30))
    for measure, field, unit in (("PGA", "pga", 9.80665), ("PGV", "pgv", 1.0)):
        there = at_intensity(scene, measure, 0.4)
        assert getattr(intensities(there), field) == pytest.approx(0.4 * unit, rel=1e-12)
        assert intensity_of(there, measure) == pytest.approx(0.4, rel=1e-12)
        factor = 0.4 / intensity_of(scene, measure)
        assert there.noise.variance == pytest.approx(0.01 * factor**2, rel=1e-12)
        assert at_intensity(scene, measure, 0.4, noise=False).noise == scene.noise
    with pytest.raises(ValueError, match=r"^measure: got 'PGD', accepted: 'PGA', 'PGV'"):
        at_intensity(scene, "PGD")
    with pytest.raises(ValueError, match=r"^scene: got .* a block with dimensions"):
        at_intensity(Scene(Block(0.9), Harmonic(1.0, 2.0), NoNoise()))


def made(shares, scenes, realizations):
    """Make the fragility of some scenes with given probabilities (m, n)."""
    shares = np.asarray(shares, float)[:, None]
    return Fragility(
        tuple(scenes), "scene", np.arange(len(scenes)), np.empty(0), SCALES, shares, np.full(shares.shape, np.nan),
        "exact", realizations, True, {}, "", {}, 0.0,
    )  # fmt: skip


def test_the_dispersion_over_records_is_parted_from_that_of_the_noise():
    """Medians of 60 records with β_R = .4, curves of β_N = .3: total .5; 4 standard errors of 60, false alarm 1e-4."""
    medians = np.exp(0.4 * np.random.default_rng(3).standard_normal(60))
    scenes = [at_intensity(Scene(Block(0.9, SIZE), record(n), BandNoise(0.01, (0.0, 9.0), 9))) for n in range(60)]
    shares = [LognormalFit(m, 0.3)(SCALES) for m in medians]
    curve = IntensityCurve.of(made(shares, scenes, 1_000_000), "PGV", samples=400)
    noise, between = curve.sources["noise"], curve.sources["record to record"]
    assert noise == pytest.approx(0.3, abs=0.003)
    assert between == pytest.approx(np.log(medians).std(), abs=0.02)
    assert curve.fit.dispersion == pytest.approx(math.hypot(noise, between), rel=1e-12)
    assert curve.source_errors["record to record"] == pytest.approx(0.4 / math.sqrt(2 * 59), rel=0.3)
    assert curve.fit.median == pytest.approx(np.exp(np.log(medians).mean()), rel=0.03)
    low, high = curve.fit.median_interval
    assert math.log(high / low) == pytest.approx(2 * 1.96 * 0.4 / math.sqrt(60), rel=0.25)
    assert np.all((curve.interval[:, 0] <= curve.probability) & (curve.probability <= curve.interval[:, 1]))


def test_the_dispersion_of_uncertain_blocks_is_parted_from_that_of_records():
    """80 records of β_R = .3 with 4 blocks each of β_j = .25, noise .2: 4 standard errors of 80, false alarm 1e-4.

    Blocks under one record are no motions of their own: the interval is wider than that of 320 motions.
    """
    scene = at_intensity(Scene(Block(0.9, SIZE), record(1), BandNoise(0.01, (0.0, 9.0), 9)))
    rng = np.random.default_rng(8)
    draws = drawn([scene] * 80, {"block.restitution": "normal:0.9:0.01"}, 4)
    scores = (np.array(draws.values["block.restitution"]) - 0.9) / 0.01
    medians = 0.7 * np.exp(0.3 * np.repeat(rng.standard_normal(80), 4) - 0.25 * scores)
    shares = [LognormalFit(m, 0.2)(SCALES) for m in medians]
    curve = IntensityCurve.of(made(shares, draws.scenes, 1_000_000), "PGV", draws=draws, samples=400)
    assert (curve.records, list(curve.sources)) == (80, ["noise", "block.restitution", "record to record"])
    assert curve.sources["noise"] == pytest.approx(0.2, abs=0.01)
    assert curve.sources["block.restitution"] == pytest.approx(0.25, abs=0.02)
    assert curve.source_errors["block.restitution"] < 0.01  # the medians are nothing but the value and the record
    assert curve.sources["record to record"] == pytest.approx(0.3, abs=0.1)
    total = math.sqrt(sum(value**2 for value in curve.sources.values()))
    assert total == pytest.approx(curve.fit.dispersion, rel=1e-12)
    low, high = curve.fit.median_interval
    assert math.log(high / low) == pytest.approx(2 * 1.96 * math.hypot(0.3, 0.125) / math.sqrt(80), rel=0.3)
    one = drawn(scene, {"block.restitution": "normal:0.9:0.01"}, 320)
    alone = IntensityCurve.of(made(shares, one.scenes, 1_000_000), "PGV", draws=one, samples=200)
    assert alone.records == 1
    assert list(alone.sources) == ["noise", "block.restitution"]
    assert math.log(alone.fit.median_interval[1] / alone.fit.median_interval[0]) < 0.9 * math.log(high / low)


def test_limits_of_a_rejected_fit_are_those_of_so_many_outcomes():
    """Two groups of motions, 8 and 12: Clopper and Pearson's for 20, by an independent function."""
    scenes = [at_intensity(Scene(Block(0.9, SIZE), record(1), NoNoise()))] * 20
    shares = [(one < SCALES).astype(float) for one in [0.2] * 8 + [2.0] * 12]
    curve = IntensityCurve.of(made(shares, scenes, 1), "PGV")
    assert curve.fit.rejected
    assert curve.fit.rejected.endswith("below 0.05")
    for share, limits in zip(curve.probability, curve.interval, strict=True):
        proper = stats.binomtest(round(20 * share), 20).proportion_ci(method="exact")
        assert limits == pytest.approx((proper.low, proper.high), abs=1e-9)
    assert np.array_equal(curve(SCALES), curve.probability)


def test_where_nothing_overturns_the_upper_limits_are_above_zero():
    """None of 8 motions, without noise: .369 at each intensity, and a rate below that of such a curve."""
    scenes = [at_intensity(Scene(Block(0.9, SIZE), record(1), NoNoise()))] * 8
    curve = IntensityCurve.of(made(np.zeros((8, 12)), scenes, 1), "PGV")
    upper = stats.binomtest(0, 8).proportion_ci(method="exact").high
    assert curve.interval == pytest.approx(np.tile([0.0, upper], (12, 1)))
    risk = annual_frequency(curve, Hazard.power_law(1e-3, 2.0))
    grid = np.linspace(-12.0, 12.0, 400_001)
    law = np.where(grid < 0.0, stats.norm.cdf(stats.norm.ppf(upper) + grid / 0.5), upper)
    wanted = np.trapezoid(law * 2e-3 * np.exp(-2.0 * (grid + math.log(SCALES[0]))), grid)
    assert (risk.rate, *risk.interval) == pytest.approx((0.0, 0.0, wanted), rel=1e-4)
    assert risk.title == f"annual rate of overturning below {wanted:.2e} (95 %: none of 8 overturned)".replace(
        "e-0", "e-"
    )


def test_one_scene_has_the_limits_of_its_sample():
    scene = at_intensity(Scene(Block(0.9, SIZE), Pulse("one-sine", 2.0, 4.0), BandNoise(0.05, (0.0, 10.0), 30)), "PGV")
    found = fragility(scene, scale=np.geomspace(0.4, 2.5, 8), realizations=300)
    curve = IntensityCurve.of(found, "PGV")
    assert np.array_equal(curve.probability, found.overturned[0])
    assert np.array_equal(curve.intensity, found.scale * intensity_of(scene, "PGV"))
    direct = fit_lognormal(curve.intensity, curve.probability, 300)
    assert curve.fit.median == pytest.approx(direct.median, rel=1e-9)
    # Two ways to the same interval: information, and counts drawn from the curve.
    for mine, other in zip(curve.fit.median_interval, direct.median_interval, strict=True):
        assert math.log(mine / direct.median) == pytest.approx(math.log(other / direct.median), rel=0.15)
    assert curve.records == 1
    assert curve.sources == {"noise": curve.fit.dispersion}


def test_what_is_no_suite_is_refused_by_name():
    scenes = [Scene(Block(0.9, SIZE), record(n), BandNoise(0.01, (0.0, 9.0), 9)) for n in range(6)]
    shares = [curve_of().probability] * 6
    with pytest.raises(ValueError, match=r"PGV of the scenes at scale 1: got .*at_intensity"):
        IntensityCurve.of(made(shares, scenes, 100), "PGV")
    equal = [at_intensity(scene) for scene in scenes]
    sizes = dataclasses.replace(made(shares, equal, 100), axis="size")
    with pytest.raises(ValueError, match=r"fragility: got .* of one scene, or of a list of scenes"):
        IntensityCurve.of(sizes, "PGV")
    shares = np.array(shares)
    shares[2, 3] = np.nan
    curve = IntensityCurve.of(made(shares, equal, 100), "PGV")
    assert curve.intensity == pytest.approx(np.delete(SCALES, 3), rel=1e-12)
    with pytest.raises(ValueError, match="got no scale at which all scenes have a probability"):
        IntensityCurve.of(made(np.full(shares.shape, np.nan), equal, 100), "PGV")


def test_a_study_writes_all_that_is_handed_on(tmp_path, capsys):
    """Six records from files by the command line; the figures of its JSON are those of the parts, one by one."""
    scene = Scene(Block(0.9, SIZE), Harmonic(1.0, 2.0), BandNoise(0.02, (0.0, 8.0), 20))
    (tmp_path / "rack.toml").write_text(scene.to_toml())
    (tmp_path / "h.csv").write_text("0.1,1e-1\n1,1e-3\n10,1e-6\n")
    files = [tmp_path / f"{n}.txt" for n in range(6)]
    for n, file in enumerate(files):
        file.write_text("\n".join(f"{0.02 * k:.2f} {a!r}" for k, a in enumerate(record(n).samples)))
    arguments = [
        "risk",
        str(tmp_path / "rack.toml"),
        "--records",
        *map(str, files),
        "--hazard",
        str(tmp_path / "h.csv"),
    ]
    arguments += ["--intensities", "0.2:3:7", "--units", "m/s2", "--realizations", "200", "--name", "rack"]
    assert cli.main([*arguments, "--out", str(tmp_path / "out")]) == 0
    printed = capsys.readouterr()
    assert "return period" in printed.out
    names = {file.name for file in (tmp_path / "out").iterdir()}
    assert names >= {"result.npz", "risk.json", "risk.txt", "curve.csv", "rack.xml", "risk.png", "report.html"}
    values = json.loads((tmp_path / "out" / "risk.json").read_text())
    scenes = [at_intensity(Scene(Block(0.9, SIZE), record(n), scene.noise)) for n in range(6)]
    found = fragility(scenes, scale=np.geomspace(0.2, 3.0, 7), realizations=200)
    places = np.searchsorted(values["fragility"]["scale"], found.scale * (1.0 - 1e-9))
    assert np.array(values["fragility"]["overturned"])[:, places].tolist() == found.overturned.tolist()
    assert len(values["fragility"]["scale"]) == 7 + values["added_intensities"]
    found = Fragility.load(tmp_path / "out" / "result.npz")
    risk = annual_frequency(IntensityCurve.of(found, "PGV"), Hazard([0.1, 1.0, 10.0], [1e-1, 1e-3, 1e-6]))
    assert values["risk"]["rate"] == pytest.approx(risk.rate, rel=1e-12)
    page = (tmp_path / "out" / "report.html").read_text()
    for said in (
        "rack: annual rate of overturning = ",
        "0.6 m",
        "16.7°",
        "default-src 'none'",
        "What is left out",
        "How to cite",
    ):
        assert said in page
    rows = list(csv.DictReader((tmp_path / "out" / "motions.csv").open(encoding="utf-8")))
    assert list(rows[0]) == ["motion", "pga_g", "pgv_m_per_s"]
    for n, (file, row) in enumerate(zip(files, rows, strict=True)):
        # As they are recorded, and not as they are scaled to an intensity.
        own = intensities(Scene(Block(0.9, SIZE), record(n), scenes[n].noise))
        pga, pgv = own.pga / 9.80665, own.pgv
        factors = f"<td>{0.2 / pgv:.3g} to {3.0 / pgv:.3g}</td>"
        assert f">{file.name}</td><td>5.98</td>{factors}<td>{pga:.4g}</td><td>{pgv:.4g}</td>" in page
        assert f"{file.name}: PGA {pga:.3g} g, PGV {pgv:.3g} m/s.\n" in printed.out
        assert (row["motion"], float(row["pga_g"])) == (file.name, pytest.approx(pga, rel=1e-9))
        assert values["motions"]["pgv_m_per_s"][n] == pytest.approx(pgv, rel=1e-9)
    rms = math.sqrt(scenes[0].noise.variance) * SIZE.critical_angle
    assert f"rms {rms:.3g} g, 0 to {8.0 / SIZE.frequency(1.0):.3g} Hz" in page
    told = [f"{value:.2e}".replace("e-0", "e-") for value in (risk.rate, *values["risk"]["interval"])]
    assert "annual rate of overturning = {} (95 %: {} to {})".format(*told) in page
    # The headline stands once, the forcing of the scene file, which the records replace, nowhere.
    visible = page[page.index("<h1>") : page.index("<script")]
    assert visible.count("annual rate of overturning") == 1
    assert "<p>Return period " in visible
    assert "[block.dimensions]" in visible
    assert "[forcing]" not in visible
    for (low, high), share in zip(values["curve"]["interval"], values["curve"]["probability"], strict=True):
        assert f"<td>{share:.4g}</td><td>{low:.4g}</td><td>{high:.4g}</td>" in page
    assert Fragility.load(tmp_path / "out" / "result.npz").overturned.tolist() == found.overturned.tolist()
    assert cli.main([*arguments, "--measure", "PGD"]) == 2
    assert "measure: got 'PGD', accepted: 'PGA', 'PGV'" in capsys.readouterr().err


def test_a_study_of_synthetic_motions_and_uncertain_blocks(tmp_path, capsys):
    scene = Scene(Block(0.9, SIZE), record(0), BandNoise(0.01, (0.0, 9.0), 20))
    (tmp_path / "rack.toml").write_text(scene.to_toml())
    (tmp_path / "h.csv").write_text("0.1,1e-1\n1,1e-3\n10,1e-6\n")
    arguments = ["risk", str(tmp_path / "rack.toml"), "--hazard", str(tmp_path / "h.csv"), "--intensities", "0.2:3:5"]
    arguments[3] = "1e-3:2.5"
    arguments += ["--synthetic", "5", "--realizations", "30"]
    drawing = ["--uncertain", "size_factor=lognormal:1:0.1", "--blocks", "2"]
    assert cli.main([*arguments, *drawing, "--json"]) == 0
    values = json.loads(capsys.readouterr().out)
    assert values["draws"]["origin"] == [0, 0, 1, 1, 2, 2, 3, 3, 4, 4]
    assert list(values["curve"]["sources"]) == ["noise", "size_factor", "record to record"]
    assert len(values["fragility"]["overturned"]) == 10
    assert values["risk"]["rate"] == pytest.approx(
        1e-3 * values["risk"]["median"] ** -2.5 * math.exp(0.5 * (2.5 * values["risk"]["dispersion"]) ** 2), rel=1e-9
    )
    assert {one["measure"] for one in values["ranking"]} == {"PGA, g", "PGV, m/s", "p PGV / (g tan θ_cr)"}
    arguments[3] = "1e-3:-1"
    assert cli.main(arguments) == 2
    assert "--hazard: got '1e-3:-1', accepted: a file, or K0:K (exponent: got -1.0" in capsys.readouterr().err
    arguments[3] = str(tmp_path / "h.csv")
    assert cli.main([*arguments, "--records", "x.AT2"]) == 2
    assert "--synthetic: got 5, accepted: nothing beside --records" in capsys.readouterr().err


def test_options_of_the_command_line_are_those_of_python(tmp_path, capsys):
    scene = Scene(Block(0.9, SIZE), record(0), BandNoise(0.01, (0.0, 9.0), 20))
    (tmp_path / "rack.toml").write_text(scene.to_toml())
    arguments = ["risk", str(tmp_path / "rack.toml"), "--hazard", "1e-3:2", "--intensities", "0.4,0.8,1.6", "--json"]
    arguments += ["--synthetic", "5", "--realizations", "20", "--seed", "7", "--measure", "PGA", "--keep-noise"]
    assert cli.main([*arguments, "--set", "block.restitution=0.8"]) == 0
    values = json.loads(capsys.readouterr().out)
    changed = scene.varied(block={"restitution": 0.8})
    options = {"measure": "PGA", "scale_noise": False, "realizations": 20, "seed": 7}
    found = study(changed, synthetic_records(5, seed=7), Hazard.power_law(1e-3, 2.0), (0.4, 0.8, 1.6), **options)
    assert values["fragility"]["overturned"] == found.fragility.overturned.tolist()
    assert (values["risk"]["measure"], values["risk"]["unit"]) == ("PGA", "g")
    assert len({json.dumps(row) for row in values["fragility"]["overturned"]}) > 1
    assert values["trust"]["verdict"] in {"caution", "do not use"}
    twice = study(
        changed, [record(1), *map(record, range(1, 5))], Hazard.power_law(1e-3, 2.0), (0.4, 1.6), realizations=5
    )
    assert "1 of 5 motions are the same as another one." in twice.trust.reasons
    assert not any("are the same" in reason for reason in found.trust.reasons)
    for text in ("block.restitution", "=0.8", " =0.8"):
        assert cli.main([*arguments, "--set", text]) == 2
        assert f"--set: got {text!r}, accepted: KEY=VALUE" in capsys.readouterr().err


def test_a_scene_whose_motions_are_given_needs_no_forcing_and_a_store_goes_on(tmp_path, capsys, monkeypatch):
    """Interrupted at its fourth point: nothing is written but the store, and the same command computes the others."""
    scene = Scene(Block(0.9, SIZE), record(0), BandNoise(0.01, (0.0, 9.0), 20))
    text = scene.to_toml()
    kept = "\n".join(part for part in text.split("\n\n") if not part.startswith("[forcing]"))
    assert "forcing" not in kept
    missing = kept + '\n[forcing]\nkind = "record"\nfile = "x"\n'
    words = ["--hazard", "1e-3:2", "--intensities", "0.4,0.8", "--realizations", "20", "--synthetic", "5"]
    found = []
    for number, one in enumerate((text, kept, missing)):
        file = tmp_path / f"rack{number}.toml"
        file.write_text(one)
        assert cli.main(["risk", str(file), *words, "--json"]) == 0
        found.append(json.loads(capsys.readouterr().out)["fragility"]["overturned"])
    assert found[0] == found[1] == found[2]
    arguments = ["risk", str(file), *words, "--store", str(tmp_path / "points"), "--out", str(tmp_path / "out")]
    computed, task = [], TASKS["mc"]

    def stopping(scene, **options):
        computed.append(scene)
        if len(computed) == 4:
            raise KeyboardInterrupt
        return task(scene, **options)

    stopping.__module__, stopping.__qualname__ = task.__module__, task.__qualname__
    monkeypatch.setitem(TASKS, "mc", stopping)
    assert cli.main(arguments) == 130
    left = f"fpk-rocking: interrupted; the same command goes on from {tmp_path / 'points'}\n"
    assert capsys.readouterr().err.endswith(left)
    assert not (tmp_path / "out").exists()
    assert cli.main(arguments) == 0
    added = 5 * json.loads((tmp_path / "out" / "risk.json").read_text())["added_intensities"]
    assert len(computed) == 4 + 7 + added
    assert cli.main(arguments) == 0
    assert len(computed) == 4 + 7 + added
    assert json.loads((tmp_path / "out" / "risk.json").read_text())["fragility"]["overturned"] == found[0]


def test_rows_of_a_fragility_of_records_have_the_names_of_the_files(tmp_path, capsys):
    """In the terminal, in the CSV and in the JSON, each with its own probabilities."""
    (tmp_path / "rack.toml").write_text(Scene(Block(0.9, SIZE), record(0), BandNoise(0.01, (0.0, 9.0), 20)).to_toml())
    names = ["first.txt", "second.txt"]
    for n, name in enumerate(names):
        text = "\n".join(f"{0.02 * k:.2f} {(1 + 2 * n) * a!r}" for k, a in enumerate(record(n).samples))
        (tmp_path / name).write_text(text)
    files = [str(tmp_path / name) for name in names]
    words = ["fragility", str(tmp_path / "rack.toml"), "--records", *files, "--units", "m/s2", "--scales", "0.5,1,2"]
    assert cli.main([*words, "--realizations", "50", "--out", str(tmp_path / "out")]) == 0
    out = capsys.readouterr().out
    found = Fragility.load(tmp_path / "out" / "result.npz")
    assert found.overturned[0].tolist() != found.overturned[1].tolist()
    frame = found.table()
    assert frame["scene"].tolist() == [name for name in names for _ in range(3)]
    header, *rows = (tmp_path / "out" / "fragility.csv").read_text().splitlines()
    at = header.split(",").index("probability")
    assert [(row.split(",")[0], float(row.split(",")[at])) for row in rows] == [
        (name, share) for name, shares in zip(names, found.overturned.tolist(), strict=True) for share in shares
    ]
    for name in names:
        assert f"{name}: PGA " in out
    # What is looked at is the curve over both; 3 rows in the terminal and in the report.
    values = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert values["pooled"]["probability"] == pytest.approx(found.overturned.mean(axis=0))
    for share in values["pooled"]["probability"]:
        assert f"{share:.4g}" in out
    words[words.index("--scales")] = "--pgv"
    assert cli.main([*words, "--realizations", "50", "--report", str(tmp_path / "r.html"), "--json"]) == 0
    values = json.loads(capsys.readouterr().out)
    assert values["scale"] == [0.5, 1.0, 2.0]
    assert [motion["pgv"] for motion in values["intensities"]] == pytest.approx([1.0, 1.0])
    page = (tmp_path / "r.html").read_text()
    rows = page[page.index("<h2>Numbers") : page.index("<h2>Scene")].count("<tr>") - 1
    assert rows == 3
    assert "samples = [" not in page[: page.index("<script")]
    assert cli.main([*words, "--scales", "1"]) == 2
    assert "--scales: got '1', accepted: a list of factors, or --pga or --pgv" in capsys.readouterr().err


def test_the_corner_of_the_correction_is_set_from_outside(tmp_path, capsys):
    scene = Scene(Block(0.9, SIZE), record(0), NoNoise())
    (tmp_path / "rack.toml").write_text(scene.to_toml())
    arguments = ["risk", str(tmp_path / "rack.toml"), "--hazard", "1e-3:2", "--intensities", "0.4,0.8", "--json"]
    tables = {}
    for corner in ("0.1", "2"):
        more = ["--synthetic", "5", "--baseline", "high-pass", "--corner-hz", corner]
        assert cli.main([*arguments, *more]) == 0
        tables[corner] = json.loads(capsys.readouterr().out)["motions"]["pgv_m_per_s"]
    own = [dataclasses.replace(one, baseline="high-pass", corner_hz=2.0) for one in synthetic_records(5)]
    assert tables["2"] == pytest.approx([intensities(Scene(Block(0.9, SIZE), one, NoNoise())).pgv for one in own])
    assert tables["2"] != tables["0.1"]
    for more, said in (
        (["--corner-hz", "2"], "corner_hz: got 2.0, accepted: nothing without the baseline 'high-pass'"),
        (["--corner-hz", "-1", "--baseline", "high-pass"], "forcing.corner_hz: got -1.0"),
    ):
        assert cli.main([*arguments, "--synthetic", "5", *more]) == 2
        assert said.replace("'", '"') in capsys.readouterr().err.replace("'", '"')


def test_one_motion_is_accepted_and_doubted_and_a_few_are_refused_before_anything_is_computed(tmp_path, capsys):
    scene = Scene(Block(0.9, SIZE), record(0), BandNoise(0.01, (0.0, 9.0), 20))
    (tmp_path / "rack.toml").write_text(scene.to_toml())
    arguments = ["risk", str(tmp_path / "rack.toml"), "--hazard", "1e-3:2", "--intensities", "0.4,0.5,0.6"]
    arguments += ["--realizations", "20", "--name", "rack", "--out", str(tmp_path / "out")]
    assert cli.main([*arguments, "--synthetic", "1"]) == 0
    printed = capsys.readouterr()
    assert "One motion: the scatter from motion to motion is neither in the rate nor in its limits." in printed.out
    assert "In its place stand the points, joined by lines." in printed.out
    assert "fpk-rocking risk: rack.csv and rack.json for pelicun are not written: probability[-1]: got 0" in printed.err
    assert not (tmp_path / "out" / "rack.csv").exists()
    # What another command left under either name goes with it, and nothing else does.
    for name in ("rack.csv", "rack.json", "old.xml", "own.csv"):
        (tmp_path / "out" / name).write_text("old")
    values = json.loads((tmp_path / "out" / "risk.json").read_text())
    assert (values["exports"], values["pelicun"][:15]) == (["rack.xml"], "probability[-1]")
    exports = ["rack.csv", "rack.json", "old.xml", "../own.csv", "curve.csv", "risk.json", 3]
    (tmp_path / "out" / "risk.json").write_text(json.dumps({"exports": exports}))
    (tmp_path / "own.csv").write_text("mine")
    assert cli.main([*arguments, "--synthetic", "1"]) == 0
    left = {
        "result.npz",
        "risk.json",
        "risk.txt",
        "risk.png",
        "curve.csv",
        "report.html",
        "rack.xml",
        "own.csv",
        "motions.csv",
    }
    assert {file.name for file in (tmp_path / "out").iterdir()} == left
    assert (tmp_path / "own.csv").read_text() == "mine"
    refused = {
        "name: got 'risk', accepted: up to 75 letters, digits, _ and -, and none of risk, curve, motions": [
            "--name",
            "risk",
        ],
        "records: got 3, accepted: 1, or at least 5": ["--synthetic", "3"],
        "blocks: got 1, accepted: at least 5 for one motion": [
            "--uncertain",
            "size_factor=uniform:0.9:1.1",
            "--blocks",
            "1",
        ],
        "name: got 'a b', accepted: up to 75 letters": ["--name", "a b"],
    }
    for said, more in refused.items():
        assert cli.main([*arguments, "--realizations", "100000000", *more]) == 2
        assert said in capsys.readouterr().err


def stepped(count):
    block, motions = Scene.from_block(0.5, 1.8, "0.3 g", "1.5 Hz"), synthetic_records(6, duration=5.0, rms=1.5)
    return study(block, motions, Hazard([0.2, 0.7, 3.0], [2e-3, 8e-5, 1e-6]), np.geomspace(0.3, 3.0, count))


def test_without_noise_the_rate_is_that_of_the_share_of_motions_that_overturn():
    found = stepped(5)
    jumps, hazard = found.fragility.motions.jumps[:, 0], found.risk.hazard
    # The share over the hazard on a grid of its own; beyond the search what stands or overturns goes on.
    grid = np.geomspace(0.05, 3e3, 400_001)
    share = ((jumps[:, None, :] <= np.sqrt(grid[1:] * grid[:-1])[:, None]).sum(axis=-1) % 2).mean(axis=0)
    parts = share * -np.diff(hazard(grid))
    assert found.risk.rate == pytest.approx(parts.sum(), rel=1e-4)
    inside = (found.risk.edges[:-1, None] <= grid[:-1]) & (grid[:-1] < found.risk.edges[1:, None])
    assert found.risk.contribution == pytest.approx((inside * parts).sum(axis=1) / parts.sum(), abs=1e-4)
    assert found.risk.contribution.sum() == pytest.approx(0.999, abs=1e-6)
    beyond = parts[grid[:-1] >= 3.0].sum() / parts.sum()
    assert found.risk.beyond_curve == pytest.approx(beyond, abs=1e-4)
    assert found.risk.beyond_hazard == pytest.approx(beyond + parts[grid[:-1] < 0.2].sum() / parts.sum(), abs=1e-4)
    assert found.risk.interval[0] < found.risk.rate < found.risk.interval[1]
    assert "By all intensities at which each motion overturns" in found.text()


def test_without_noise_the_rate_does_not_depend_on_the_number_of_intensities():
    assert [stepped(count).risk.rate for count in (5, 9, 24)] == pytest.approx([stepped(5).risk.rate] * 3, rel=1e-12)


def test_without_noise_each_motion_is_told_by_name(tmp_path):
    found = stepped(5)
    motions = synthetic_records(6, duration=5.0, rms=1.5)
    found.write(tmp_path)
    rows = list(csv.DictReader((tmp_path / "motions.csv").open(encoding="utf-8")))
    lines = found.text().splitlines()[-6:]
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    for motion, row, line in zip(motions, rows, lines, strict=True):
        scene = Scene.from_block(0.5, 1.8, record=motion)
        own, path = intensities(scene).pgv, histories(scene, times=np.linspace(0.0, 25.0, 20_001))
        assert row["motion"] == motion.source
        assert float(row["peak_rotation"]) == pytest.approx(np.nanmax(np.abs(path.angle)), abs=1e-5)
        factor = float(row["critical_scale"])
        sides = [simulate(studies.scaled(scene, factor * change)).overturn_side[0] for change in (0.9995, 1.0005)]
        assert sides[0] == 0
        assert sides[1] != 0
        assert float(row["critical_intensity"]) == pytest.approx(factor * own, rel=1e-9)
        assert line.startswith(f"{motion.source}: PGA ")
        assert line.endswith(f"critical at PGV {factor * own:.4g} m/s, {factor:.3g} times its own strength.")
        assert f"<td>{factor:.4g}</td>" in page


def shaken(count, realizations=60):
    block = Scene.from_block(0.5, 1.8, "0.3 g", "1.5 Hz", noise_rms_acceleration=0.3, noise_band_hz=(0, 8))
    motions = synthetic_records(6, duration=4.0, rms=1.5)
    return study(block, motions, Hazard.power_law(1e-4, 2.5), np.geomspace(0.3, 3.0, count), realizations=realizations)


def test_with_noise_intensities_are_added_where_the_rate_comes_from():
    few, asked = shaken(4), np.geomspace(0.3, 3.0, 4)
    scale = few.fragility.scale
    assert np.isin(np.round(asked, 12), np.round(scale, 12)).all()
    assert few.added == scale.size - 4 > 2
    assert (np.diff(scale) > 0.0).all()
    assert few.moved <= 0.02
    assert f"{few.added} intensities were added" in few.text()
    # A curve that is as dense everywhere has this rate but for the scatter of its samples; as asked for, another.
    dense = np.geomspace(0.1, 3.0, 30)
    paths = few.fragility
    others = [fragility(list(paths.scenes), scale=dense, realizations=60, seed=seed) for seed in (7, 8, 9)]
    wanted = np.mean([annual_frequency(IntensityCurve.of(one, "PGV"), few.risk.hazard).rate for one in others])
    coarse = fragility(list(paths.scenes), scale=asked, realizations=60, seed=7)
    assert few.risk.rate == pytest.approx(wanted, rel=0.08)
    assert annual_frequency(IntensityCurve.of(coarse, "PGV"), few.risk.hazard).rate != pytest.approx(wanted, rel=0.16)


def test_intensities_asked_for_keep_their_samples():
    found, asked = shaken(4), np.geomspace(0.3, 3.0, 4)
    alone = fragility(list(found.fragility.scenes), scale=asked, realizations=60, seed=1)
    places = np.searchsorted(found.fragility.scale, asked * (1.0 - 1e-9))
    assert np.array_equal(found.fragility.overturned[:, places], alone.overturned)


def test_a_rate_that_still_moves_is_a_caution():
    restless = dataclasses.replace(shaken(4), moved=0.07)
    (reason,) = [text for text in restless.trust.reasons if "still moved" in text]
    assert "by 7 % with the last of" in reason
    assert restless.trust.verdict == "caution"
