"""Annual frequencies: closed forms, sampled intensities, limits, and units that were mistaken."""

import dataclasses
import math

import numpy as np
import pytest
from scipy import special, stats
from suites import SCALES, SIZE, curve_of, record, suite

from fpk_rocking import Block, NoNoise, Scene
from fpk_rocking.results.trust import CAUTION, UNUSABLE
from fpk_rocking.risk import Hazard, IntensityCurve, annual_frequency, at_intensity, fragility
from fpk_rocking.risk.lognormal import LognormalFit
from fpk_rocking.risk.rate import number_text, rate_text, years_text


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
    for side, which in ((curve.probability, "rate"), (curve.interval[:, 0], 0), (curve.interval[:, 1], 1)):
        joined = np.interp(middle, np.log(SCALES), side)
        below = stats.norm.cdf(stats.norm.ppf(side[0]) + (middle - math.log(SCALES[0])) / 0.5)
        shares = np.where(middle < math.log(SCALES[0]), below, joined) * -np.diff(rates)
        direct = shares.sum()
        risk = annual_frequency(points, hazard)
        if which == "rate":
            assert risk.below_curve == pytest.approx(shares[middle < math.log(SCALES[0])].sum() / direct, rel=1e-4)
            assert f"fragility give {100 * risk.below_curve:.2g} % of the rate." in risk.sentences[0]
        assert (risk.rate if which == "rate" else risk.interval[which]) == pytest.approx(direct, rel=1e-6)


def test_limits_are_those_of_the_replicates_and_what_lies_beyond_is_told():
    replicates = [(0.7 * math.exp(0.1 * z), 0.4) for z in np.linspace(-1.0, 1.0, 41)]
    risk = annual_frequency(curve_of(replicates=replicates), Hazard([0.5, 2.0], [4e-3, 2.5e-4]))
    assert risk.interval == pytest.approx([risk.rate * math.exp(0.2 * z) for z in (-0.95, 0.95)], rel=1e-9)
    assert risk.beyond_hazard > 0.2
    assert risk.sentences[0].startswith(
        "annual rate of overturning = 2.81e-3 (95 %: 2.32e-3 to 3.40e-3): return period"
    )
    assert any(
        "beyond the points of the hazard curve, where power laws extrapolate it; with half and with twice " in sentence
        for sentence in risk.sentences
    )
    points = annual_frequency(
        dataclasses.replace(curve_of(2.0), fit=LognormalFit(reason="left out")), Hazard.power_law(1e-3, 0.5)
    )
    limits = "computed with all probabilities at their lower, or all at their upper limits, as there is no fit; they"
    assert limits in points.sentences[0]
    assert "the fragility, where a lognormal curve of dispersion 0.5 is used below, the last " in points.sentences[1]
    assert [diagnostic.kind for diagnostic in risk.diagnostics if diagnostic.severity] == ["the hazard curve"]
    assert risk.rate_error == pytest.approx(math.log(risk.interval[1] / risk.interval[0]) / (2 * 1.96))
    wide = annual_frequency(curve_of(), Hazard(np.geomspace(1e-3, 1e3, 30), 1e-3 * np.geomspace(1e-3, 1e3, 30) ** -2.0))
    assert wide.beyond_hazard < 1e-6
    assert wide.beyond_curve < 0.05
    assert len(wide.sentences) == 1
    assert wide.rate == pytest.approx(risk.rate, rel=1e-10)


@pytest.mark.parametrize(("median", "spread"), [(0.3, 0.05), (0.7, 1.2), (40.0, 0.2)])
def test_limits_of_a_bent_hazard_are_the_integrals_of_the_replicates(median, spread):
    hazard = Hazard([0.1, 1.0, 3.0], [3e-3, 1e-3, 1e-3 * 3.0**-6.0])
    risk = annual_frequency(curve_of(median, spread, replicates=[(median, spread)] * 2), hazard)
    assert risk.interval == pytest.approx([risk.rate] * 2, rel=1e-9)
    # Few motions also agree with a median of 0: all intensities of the integral then overturn the block.
    assert annual_frequency(curve_of(replicates=[(0.0, 1.0)] * 2), hazard).interval[0] > hazard(0.1)


@pytest.mark.parametrize(
    ("measure", "factor", "unit", "own"),
    [("PGV", 100.0, "cm/s", "m/s"), ("PGA", 9.80665, "m/s²", "g"), ("PGA", 980.665, "cm/s²", "g")],
)
def test_a_rate_from_beyond_the_points_is_of_no_use_and_the_unit_that_was_meant_is_named(
    tmp_path, measure, factor, unit, own
):
    """The hazard of .003 to 6 of the right unit in a file of another one; then one that none explains."""
    curve = dataclasses.replace(
        curve_of(0.7 if factor < 10.0 else 0.3, 0.3, replicates=[(0.7, 0.3)] * 9), measure=measure
    )
    meant = Hazard(np.geomspace(0.02, 6.0, 20), np.geomspace(1e-1, 1e-6, 20))
    assert annual_frequency(curve, meant).model_diagnostics() == []
    least = 0.02 if factor > 50.0 else 0.3
    intensity = factor * np.geomspace(least, 6.0, 20)
    ((severity, message, *_),) = annual_frequency(curve, Hazard(intensity, meant.rate)).model_diagnostics()
    assert severity == UNUSABLE
    # What is to be done comes first, and nothing else is advised.
    assert message.startswith(
        f"Are the intensities of the hazard in {unit}? They were read in {own}, as {intensity[0]:.4g} to"
    )
    assert f"; in {unit} they are {least:.4g} to 6 {own}. " in message
    assert message.endswith("extrapolate it.")
    heading = f"{measure} ({unit}),annual rate"
    assert f"If so, write '{heading}' as its first line." in message
    file = tmp_path / "hazard.csv"
    file.write_text("\n".join([heading, *(f"{a},{b}" for a, b in zip(intensity, meant.rate, strict=True))]))
    assert Hazard.from_csv(file).intensity == pytest.approx(intensity / factor, rel=1e-9)
    far = annual_frequency(curve, Hazard(1e6 * meant.intensity, meant.rate)).model_diagnostics()[0]
    assert (far.severity, far.message.endswith(": give more points.")) == (UNUSABLE, True)
    share = annual_frequency(curve, Hazard([0.71 * curve.fit.median, 6.0], [1e-2, 1e-5]))
    assert 0.05 < share.beyond_hazard < 0.5
    assert [diagnostic.severity for diagnostic in share.model_diagnostics()] == [CAUTION]


def test_a_power_law_holds_at_all_intensities():
    """It says so by having no points that anything lies beyond, and by its law as a text."""
    law = Hazard.power_law(2e-3, 2.5)
    assert annual_frequency(curve_of(0.05, 0.3), law).beyond_hazard < 1e-6
    assert law.law == "0.002 im^-2.5"
    assert Hazard([0.1, 1.0, 3.0], [1e-2, 1e-3, 1e-4]).law == ""


def test_what_lies_beyond_the_points_is_no_caution_where_the_rate_does_not_depend_on_it():
    """All overturn at the highest points, so that how often those are exceeded is all that counts."""
    hazard = Hazard([0.01, 0.15], [1e-2, 1e-3])
    sure = annual_frequency(curve_of(0.05, 0.3, replicates=[(0.05, 0.3)] * 9), hazard)
    assert 0.1 < sure.beyond_hazard < 0.5
    assert sure.by_other_slopes == pytest.approx([sure.rate] * 2, rel=2e-3)
    assert "the hazard curve" not in [one.name for one in sure.model_diagnostics()]
    curve, flat = dataclasses.replace(curve_of(0.7, 0.4), by_points=True), Hazard.power_law(1e-3, 0.3)
    whole = annual_frequency(curve, flat)
    assert whole.beyond_curve > 0.5
    assert whole.model_diagnostics() == []
    # Above .8 the probability may be 1: a quarter more. Above .4 it may be 1.5 times more.
    for part, severity in ((0.8, CAUTION), (0.4, UNUSABLE)):
        partly = annual_frequency(dataclasses.replace(curve, probability=part * curve.probability), flat)
        assert partly.beyond_curve == pytest.approx(whole.beyond_curve, rel=1e-2)
        assert [one.severity for one in partly.model_diagnostics() if one.name == "the fragility"] == [severity]


def test_one_motion_without_noise_has_no_limits():
    """It is told, and none stand there that look exact; the error of the rate is not judged."""
    scene = at_intensity(Scene(Block(0.9, SIZE), record(1), NoNoise()))
    curve = IntensityCurve.of(fragility(scene, scale=[0.1, 0.5]))
    assert np.isnan(curve.point_limits).all()
    places, share, limits = curve.outcomes
    assert np.array_equal(limits, np.stack([share, share], axis=-1))
    assert limits.shape == (places.size, 2)
    risk = annual_frequency(curve, Hazard.power_law(1e-3, 2.0))
    assert np.isnan(risk.interval).all()
    assert risk.title == f"annual rate of overturning = {rate_text(risk.rate)} (no limits)"
    assert f"years, probability in 50 years {risk.probability():.2g}. Computed" in risk.sentences[0]
    assert risk.trust.verdict == "caution"
    assert "No error is estimated." in risk.trust.reasons


def test_the_verdict_tells_a_rejected_fit_and_an_exported_curve_with_another_rate():
    law = Hazard.power_law(rate=1e-3, exponent=2.0)
    rejected = dataclasses.replace(curve_of(), fit=LognormalFit(0.7, 0.4, p_value=0.01, misfit=0.2))
    reasons = annual_frequency(rejected, law).trust.reasons
    assert "The lognormal fit is rejected (p = 0.01, below 0.05): it is off by up to 0.2. Use the" in reasons[0]
    jumps = np.array([0.4, 0.9, 1.6])[:, None, None]
    rate = np.mean(1e-3 * jumps**-2.0)
    for part, told in ((0.89, True), (0.91, False), (1.09, False), (1.11, True)):
        # The curve of dispersion .2 that gives this part of the rate.
        median = math.sqrt(1e-3 * math.exp(2.0 * 0.2**2) / (part * rate))
        risk = annual_frequency(dataclasses.replace(curve_of(median, 0.2), jumps=jumps, units=3), law)
        assert risk.exported_rate / risk.rate == pytest.approx(part, rel=1e-9)
        said = f"carry the lognormal curve, by which the rate is {rate_text(part * rate)}."
        assert [said in one.message for one in risk.diagnostics if one.name == "exported rate"] == [True] * told
        assert [one.severity for one in risk.diagnostics if one.name == "exported rate"] == [CAUTION] * told
        assert (said in risk.sentences[0]) != told


def test_limits_without_noise_are_of_the_rates_under_single_motions():
    """Each motion counts at the threshold that has its rate; a power law of these: Student's t and chi-square."""
    law, rng = Hazard.power_law(rate=1e-3, exponent=2.0), np.random.default_rng(3)
    first = 0.7 * np.exp(0.4 * rng.standard_normal(12))
    jumps = np.stack([first, 1.3 * first, 1.5 * first], axis=-1)  # stands again up to 1.5 times the first one
    jumps[::2, 1:] = np.nan
    risk = annual_frequency(dataclasses.replace(curve_of(9.0), jumps=jumps[:, None], units=12, records=12), law)
    rates = np.nansum(1e-3 * jumps**-2.0 * [1.0, -1.0, 1.0], axis=1)
    assert risk.rate == pytest.approx(rates.mean(), rel=1e-12)
    logs = np.log(rates / 1e-3) / -2.0
    assert risk.capacities.middle == pytest.approx(logs, abs=1e-12)
    spread = np.sqrt(logs.var(ddof=1) * 11.0 / rng.chisquare(11, 200_000))
    middle = logs.mean() + spread / math.sqrt(12.0) * rng.standard_normal(200_000)
    drawn = np.quantile(1e-3 * np.exp(-2.0 * middle + 2.0 * spread**2), [0.025, 0.975])
    # 20,000 draws of a long tail.
    assert np.log(risk.interval) == pytest.approx(np.log(drawn), abs=0.04 * math.log(drawn[1] / drawn[0]))
    limits = "limits are computed from the rates under single motions; they contain the uncertainty from finite samples"
    assert f". The {limits} of records. " in risk.sentences[0]
    # Where thresholds are of two groups, far apart, they are those of the outcomes.
    groups = np.repeat([0.2, 2.0], [10, 10]) * np.tile([1.0, 1.1], 10)
    two = {"fit": LognormalFit(reason="two"), "units": 20, "records": 20}
    parted = dataclasses.replace(curve_of(), jumps=groups[:, None, None], **two)
    assert annual_frequency(parted, law).capacities is None
    assert "computed with all probabilities at their lower, or all" in annual_frequency(parted, law).sentences[0]


def test_limits_with_noise_are_of_the_rates_under_single_motions():
    """Under a power law a motion of median m and dispersion β has the rate of the threshold m exp(-k β²/2)."""
    law, medians = Hazard.power_law(rate=1e-3, exponent=2.0), np.array([0.5, 0.6, 0.7, 0.9, 1.0])
    fine = np.geomspace(0.05, 6.0, 400)
    shares = np.array([LognormalFit(median, 0.25)(fine) for median in medians])
    curve = dataclasses.replace(curve_of(9.0), intensity=fine, probability=shares.mean(axis=0), shares=shares, units=5)
    assert annual_frequency(curve, law).capacities is None  # by the lognormal curve, rate and limits
    risk = annual_frequency(dataclasses.replace(curve, by_points=True), law)
    assert np.exp(risk.capacities.middle) == pytest.approx(medians * math.exp(-(0.25**2)), rel=1e-3)
    assert risk.interval[0] < risk.rate < risk.interval[1]
    # A motion that overturns nothing within the points, or little, is known to have its threshold above them.
    for last in (0.0, 0.01):
        shares[4] = np.where(fine < fine[-1], 0.0, last)
        stands = annual_frequency(dataclasses.replace(curve, shares=shares, by_points=True), law)
        assert stands.capacities.low[4] == pytest.approx(math.log(6.0), rel=1e-12)
        assert np.isinf(stands.capacities.high[4])
    # Such thresholds are not tested: they go with the fit.
    rejected = dataclasses.replace(curve, fit=curve.fit._replace(p_value=0.01, misfit=0.2))
    assert rejected.unless_rejected(stands.capacities) is None


def test_where_nothing_overturns_the_upper_limits_are_above_zero():
    """None of 8 motions: .369 at each intensity, and a rate below that of such a curve, up to the highest of them."""
    scenes = [at_intensity(Scene(Block(0.9, SIZE), record(n), NoNoise())) for n in range(8)]
    curve = IntensityCurve.of(suite(np.zeros((8, 12)), scenes, 1), "PGV")
    upper = stats.binomtest(0, 8).proportion_ci(method="exact").high
    assert curve.interval == pytest.approx(np.tile([0.0, upper], (12, 1)))
    risk = annual_frequency(curve, Hazard.power_law(1e-3, 2.0))
    grid = np.linspace(-12.0, 12.0, 400_001)
    law = np.where(grid < 0.0, stats.norm.cdf(stats.norm.ppf(upper) + grid / 0.5), upper)
    wanted = np.trapezoid(law * 2e-3 * np.exp(-2.0 * (grid + math.log(SCALES[-1]))), grid)
    assert (risk.rate, *risk.interval) == pytest.approx((0.0, 0.0, wanted), rel=1e-4)
    assert risk.title == f"annual rate of overturning below {wanted:.2e} (95 %: none of 8 overturned)".replace(
        "e-0", "e-"
    )
    assert (
        f": return period above {years_text(1.0 / wanted, 3)} years, probability in 50 years below "
        in risk.sentences[0]
    )
    alone = annual_frequency(IntensityCurve.of(suite(np.zeros((1, 12)), scenes[:1], 1), "PGV"), risk.hazard)
    assert alone.sentences[0].startswith(
        "no annual rate of overturning: no motion overturned the block up to the highest intensity. Computed from the "
    )


def test_the_rate_of_the_exported_curve_is_named_where_it_differs():
    curve, law = curve_of(0.7, 0.5), Hazard.power_law(rate=1e-3, exponent=2.0)
    closed = 1e-3 * 0.7**-2.0 * math.exp(2.0 * 0.5**2)
    along = annual_frequency(dataclasses.replace(curve, probability=0.5 * curve.probability, by_points=True), law)
    assert along.exported_rate == pytest.approx(closed, rel=1e-9)
    assert along.rate < 0.7 * closed
    assert along.title == f"annual rate of overturning = {rate_text(along.rate)} (no limits)"
    carried = f"Files for OpenQuake and pelicun carry the lognormal curve, by which the rate is {rate_text(closed)}."
    assert carried in along.sentences[1:]
    assert "OpenQuake" not in annual_frequency(curve, law).sentences[0]
    without = dataclasses.replace(curve, fit=LognormalFit(reason="left out"))
    points = annual_frequency(without, law)
    assert points.exported_rate == points.rate
    # Motions without noise, and a rejected fit: the rate is by the motions, files carry the points.
    jumps = np.array([0.4, 0.9, 1.6])[:, None, None]
    stepped = annual_frequency(dataclasses.replace(without, jumps=jumps, probability=np.full(12, 0.5)), law)
    assert stepped.rate == pytest.approx(np.mean(1e-3 * jumps**-2.0), rel=1e-12)
    constant = 0.5 * law(without.intensity[0])  # and what lies below the points
    assert stepped.exported_rate > constant
    said = "Files for OpenQuake and pelicun carry the points of the curve, by which the rate is "
    said = f"{said}{rate_text(stepped.exported_rate)}. With points at more intensities the files come closer."
    assert said in stepped.sentences


def test_what_of_the_upper_limit_comes_from_where_no_motion_overturns():
    """Thirty motions: the lognormal rates whose draws lie at the upper limit, below the lowest, in closed form."""
    logs, rng = np.log(0.7) + 0.5 * stats.norm.ppf((np.arange(30) + 0.5) / 30), np.random.default_rng(4)
    law, jumps = Hazard.power_law(rate=1e-3, exponent=3.0), np.exp(logs)[:, None, None]
    risk = annual_frequency(dataclasses.replace(curve_of(0.7, 0.5), jumps=jumps, units=30), law)
    spread = np.sqrt(logs.var(ddof=1) * 29.0 / rng.chisquare(29, 100_000))
    middle = logs.mean() + spread / math.sqrt(30.0) * rng.standard_normal(100_000)
    rates, lowest = np.exp(-3.0 * middle + 4.5 * spread**2), logs[0]
    below = rates * special.ndtr((lowest - middle) / spread + 3.0 * spread)
    below -= math.exp(-3.0 * lowest) * special.ndtr((lowest - middle) / spread)
    near = np.abs(np.searchsorted(np.sort(rates), rates) / 1e5 - 0.975) < 0.01
    share = below[near].sum() / rates[near].sum()
    assert risk.upper_from_below == pytest.approx(share, abs=0.06)  # a hundred draws are near the limit
    assert 0.25 < share < 0.9
    share = risk.upper_from_below
    sentence = (
        f" {100.0 * share:.0f} % of the upper limit of the rate comes from below PGV {math.exp(lowest):.3g} m/s, "
    )
    assert f"{sentence}where no motion" in risk.sentences[0]
    often = rate_text(float(law(math.exp(lowest))))
    assert f" This intensity is exceeded {often} times a year." in risk.sentences[0]
    assert annual_frequency(curve_of(0.7, 0.5), law).upper_from_below == 0.0


def test_years_are_plain_numbers():
    texts = [
        years_text(years, digits)
        for years, digits in ((4981.2, 3), (372.9, 2), (9261.0, 2), (3.14159, 3), (2.345e9, 3))
    ]
    assert texts == ["4,980", "370", "9,300", "3.14", "2.34e+09"]


def test_small_numbers_are_written_as_rates_are():
    assert list(map(rate_text, (6.746e-4, 1.2, math.nan))) == ["6.75e-4", "1.20", "-"]
    texts = list(map(number_text, (4.3123e-5, 0.0006746, 12.3456, 0.0, math.nan, math.inf)))
    assert texts == ["4.312e-5", "6.746e-4", "12.35", "0", "", ""]
