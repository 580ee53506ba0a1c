"""What few motions tell of others: against the normal theory, an independent posterior, and how often limits hold."""

import math

import numpy as np
import pytest
from scipy import special, stats
from scripts import benchmark

from fpk_rocking.risk.capacities import Capacities
from fpk_rocking.risk.lognormal import REJECTED

DRAWS = 40_000
GRID = np.geomspace(0.15, 3.0, 10)


def quantiles(values):
    return np.quantile(values, [0.025, 0.5, 0.975])


def test_complete_capacities_have_the_limits_of_a_normal_sample():
    """Student's t and the chi-square distribution; quantiles of 40,000 draws are right to 3 % of their spread."""
    logs = np.array([-0.9, -0.5, -0.3, -0.25, 0.1, 0.4])
    population, values = Capacities.exact(np.exp(logs)).draws(DRAWS, np.random.default_rng(1))
    error = logs.std(ddof=1) / math.sqrt(6)
    assert quantiles(population[:, 0]) == pytest.approx(
        stats.t(5, logs.mean(), error).ppf([0.025, 0.5, 0.975]), abs=0.02
    )
    sigma = logs.std(ddof=1) * np.sqrt(5.0 / stats.chi2(5).ppf([0.975, 0.5, 0.025]))
    assert quantiles(population[:, 1]) == pytest.approx(sigma, rel=0.03)
    assert not population[:, 2:].any()
    assert values[7] == pytest.approx(logs, rel=1e-12)


def posterior(low, high, middle):
    """Quantiles of μ and σ by a sum over a grid under the prior dμ dσ/σ; nan in `middle` for a bracket."""
    mu, sigma = np.linspace(-4.0, 6.0, 701), np.geomspace(0.02, 20.0, 500)
    m, s = mu[:, None], sigma[None]
    loglike = np.zeros((mu.size, sigma.size))
    for a, b, c in zip(low, high, middle, strict=True):
        bracket = stats.norm.cdf((b - m) / s) - stats.norm.cdf((a - m) / s)
        loglike += np.log(np.maximum(bracket, 1e-300)) if math.isnan(c) else stats.norm.logpdf(c, m, s)
    weight = np.exp(loglike - loglike.max())

    def of(marginal, axis):
        part = np.cumsum(marginal) / marginal.sum()
        return np.interp([0.025, 0.5, 0.975], part, axis)

    return of(weight.sum(axis=1), mu), of(weight.sum(axis=0), sigma)


def test_motions_that_stand_have_the_limits_of_an_independent_posterior():
    """Three of eight stand up to .9."""
    logs = np.array([-0.9, -0.5, -0.3, -0.25, -0.15])
    capacities = Capacities.exact([*np.exp(logs), *[math.inf] * 3], 0.9)
    population, values = capacities.draws(DRAWS, np.random.default_rng(2))
    assert values[:, 5:].min() >= math.log(0.9)
    low = [*logs, *[math.log(0.9)] * 3]
    mu, sigma = posterior(low, [math.inf] * 8, [*logs, *[math.nan] * 3])
    assert quantiles(population[:, 0]) == pytest.approx(mu, abs=0.03)
    assert quantiles(population[:, 1]) == pytest.approx(sigma, rel=0.05)


def test_brackets_have_the_limits_of_an_independent_posterior():
    """Outcomes at four intensities; the second row falls again, and counts by how often it overturns."""
    scale = np.array([0.4, 0.6, 0.9, 1.4])
    shares = np.array([[0, 0, 1, 1], [0, 1, 0, 1], [1, 1, 1, 1], [0, 1, 1, 1], [0, 0, 0, 1], [0, 0, 0, 0.0]])
    capacities = Capacities.of(scale, shares, 1, np.arange(6))
    ends = np.concatenate([[-math.inf], np.log(scale), [math.inf]])
    first = np.array([2, 2, 0, 1, 3, 4])
    assert np.array_equal(capacities.low, ends[first])
    assert np.array_equal(capacities.high, ends[first + 1])
    population, _ = capacities.draws(DRAWS, np.random.default_rng(3))
    mu, sigma = posterior(ends[first], ends[first + 1], [math.nan] * 6)
    assert quantiles(population[:, 0]) == pytest.approx(mu, abs=0.03)
    assert quantiles(population[:, 1]) == pytest.approx(sigma, rel=0.06)


def test_blocks_under_one_motion_are_one_random_effect():
    """Mean squares of a one-way analysis of variance: 20 motions of .4 with 5 blocks of .25."""
    rng = np.random.default_rng(4)
    motion = np.repeat(np.arange(20), 5)
    logs = 0.4 * rng.standard_normal(20)[motion] + 0.25 * rng.standard_normal(100)
    population, _ = Capacities.exact(np.exp(logs), motion=motion).draws(DRAWS, rng)
    rows = logs.reshape(20, 5)
    within = ((rows - rows.mean(axis=1, keepdims=True)) ** 2).sum()
    assert quantiles(population[:, 2] ** 2) == pytest.approx(within / stats.chi2(80).ppf([0.975, 0.5, 0.025]), rel=0.02)
    error = rows.mean(axis=1).std(ddof=1) / math.sqrt(20)
    limits = stats.t(19, logs.mean(), error).ppf([0.025, 0.5, 0.975])
    assert quantiles(population[:, 0]) == pytest.approx(limits, abs=0.01)
    assert np.median(population[:, 1]) == pytest.approx(math.sqrt(error**2 * 20 - within / 80 / 5), rel=0.05)


def test_noise_blurs_capacities():
    """1,000 paths at each of ten intensities: capacities to their standard errors (4 of them, false alarm 1e-3)."""
    rng = np.random.default_rng(5)
    logs = np.append(math.log(0.7) + 0.3 * rng.standard_normal(11), math.log(20.0))
    shares = rng.binomial(1000, special.ndtr((np.log(GRID) - logs[:, None]) / 0.2)) / 1000
    curve = Capacities.of(GRID, shares, 1000, np.arange(12))
    assert np.abs((curve.middle - logs) / curve.error)[:11].max() < 4.0
    assert curve.noise == pytest.approx(0.2, abs=4.0 * 0.2 * curve.noise_error)
    # None of 1,000 paths at 3 is as likely as not where the middle is 3.2 dispersions above.
    assert curve.low[11] == pytest.approx(math.log(3.0) - curve.noise * stats.norm.ppf(1.0 - 0.5**0.001), rel=1e-9)


def test_the_error_of_the_dispersion_by_noise_is_a_part_of_it():
    """Twenty motions of β = .1 and twenty of .3, nearly without sampling: mean and scatter of β²."""
    spread = np.repeat([0.1, 0.3], 20)
    fine = np.geomspace(0.1, 5.0, 100)
    shares = special.ndtr(np.log(fine) / spread[:, None])
    capacities = Capacities.of(fine, shares, 10**9, np.arange(40))
    assert capacities.noise == pytest.approx(math.sqrt(0.05), rel=1e-3)
    assert capacities.noise_error == pytest.approx((spread**2).std(ddof=1) / math.sqrt(40) / (2.0 * 0.05), rel=1e-3)


def test_intervals_of_overturning_add_to_the_dispersion():
    """The second moment of the share by a sum over a fine grid; a row that stands at the end has no part."""
    logs = np.array([[-0.4, -0.1, 0.2], [0.0, np.nan, np.nan], [-1.0, -0.9, 0.5], [0.3, 0.4, np.nan]])
    found = Capacities.of_jumps(np.exp(logs), np.full(4, 20.0), np.arange(4))
    grid = np.linspace(-3.0, 3.0, 60_001)
    over = ((logs[[0, 1, 2], None, :] <= grid[:, None]).sum(axis=-1) % 2).astype(float)
    means, squares = (np.diff(over, axis=1) @ (0.5 * (grid[1:] + grid[:-1])) ** power for power in (1, 2))
    own = squares - means**2
    assert found.noise == pytest.approx(math.sqrt(own.mean()), rel=1e-3)
    assert found.noise_error == pytest.approx(own.std(ddof=1) / math.sqrt(3) / (2.0 * own.mean()), rel=1e-3)
    assert found.middle[:3] == pytest.approx(means, abs=2e-4)
    settled = Capacities.of_jumps(np.exp(logs[:3]), np.full(3, 20.0), np.arange(3))
    assert settled.moments(np.empty(0))[1] ** 2 == pytest.approx(means.var(ddof=1) + own.mean(), rel=1e-3)


def test_the_test_of_exact_capacities_is_lilliefors():
    """Against scipy's, by 1,999 suites here and 9,999 there: 4 standard errors of the p-value; blocks as a motion."""
    for seed in range(4):
        rng = np.random.default_rng([9, seed])
        logs = (rng.standard_normal(14), rng.exponential(size=14))[seed % 2]
        mine = Capacities.exact(np.exp(logs)).lilliefors(rng)
        other = stats.goodness_of_fit(stats.norm, logs, statistic="ks", n_mc_samples=9_999, rng=rng).pvalue
        assert mine == pytest.approx(other, abs=4.0 * math.sqrt(other * (1.0 - other) / 1_999) + 0.002)
        twice = Capacities.exact(np.exp(np.repeat(logs, 2)), motion=np.repeat(np.arange(14), 2)).lilliefors(rng)
        assert twice == pytest.approx(other, abs=6.0 * math.sqrt(other * (1.0 - other) / 1_999) + 0.002)


def test_lognormal_motions_and_blocks_are_seldom_rejected():
    """Of 300 suites of eight motions, three blocks each, 4 to 27 at 5 %: outside by chance .3 %."""
    rng, motion, alarms = np.random.default_rng(10), np.repeat(np.arange(8), 3), 0
    for _ in range(300):
        logs = 0.4 * rng.standard_normal(8)[motion] + 0.25 * rng.standard_normal(24)
        alarms += Capacities.exact(np.exp(logs), motion=motion).lilliefors(rng) < REJECTED
    assert 4 <= alarms <= 27


@pytest.mark.parametrize(
    ("kind", "motions"),
    [
        ("critical intensities", 5),
        *(
            pytest.param(*row, marks=pytest.mark.slow)
            for row in [("critical intensities", 14), ("noise", 5), ("noise", 14)]
        ),
    ],
)
def test_limits_hold(kind, motions):
    """Of 100 suites at least 88 of each; a share of .95 has less in .4 % of such counts."""
    script = benchmark("few_motions")
    result = script.coverage(motions, 100, 6, 199, **script.KINDS[kind])
    assert min(result[name] for name in script.NAMES) >= 0.88


@pytest.mark.slow
def test_what_is_not_lognormal_is_rejected():
    """At 5 %: of 200 lognormal suites 3 to 19 (outside by chance: 2 %), of 30 exponential capacities most."""
    script = benchmark("few_motions")
    kinds = script.KINDS
    assert 0.015 <= script.rejected(14, 200, 7, stats.norm, **kinds["critical intensities"]) <= 0.095
    assert script.rejected(8, 100, 7, stats.norm, **kinds["noise"]) <= 0.11
    assert script.rejected(30, 100, 7, stats.expon(-1.0), **kinds["critical intensities"]) > 0.6
    assert script.rejected(30, 50, 7, stats.expon(-1.0), **kinds["noise"]) > 0.4


def test_the_page_quotes_the_figures():
    script = benchmark("few_motions")
    kinds = {"noise": script.KINDS["noise"]}
    result = script.run(suites=4, sizes=(5, 8), samples=49, tests=4, kinds=kinds, again=5)
    page = script.page(result)
    row = next(text for text in page["text"] if text.startswith("| noise | 8 |"))
    assert [float(cell) for cell in row.split("|")[4:-1]] == [
        result["coverage"]["noise"]["8"][name] for name in script.NAMES
    ]
    assert any(text.startswith("| lognormal, noise | ") for text in page["text"])
