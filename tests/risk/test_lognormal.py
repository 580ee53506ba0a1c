"""The lognormal fit: the curve it was drawn from, an independent maximum, its intervals, its test, and no fit."""

import numpy as np
import pytest
from scipy import optimize, special, stats

from fpk_rocking.risk.lognormal import fit_lognormal, fit_rows

SCALE = np.geomspace(0.3, 3.0, 12)
MEDIAN, DISPERSION = 1.2, 0.4
TRUE = special.ndtr(np.log(SCALE / MEDIAN) / DISPERSION)


def drawn(law, realizations, seed):
    return np.random.default_rng(seed).binomial(realizations, law) / realizations


def test_a_lognormal_curve_is_found_to_rounding():
    fit = fit_lognormal(SCALE, TRUE)
    assert fit.median == pytest.approx(MEDIAN, rel=1e-9)
    assert fit.dispersion == pytest.approx(DISPERSION, rel=1e-9)
    assert np.allclose(fit(SCALE), TRUE, rtol=0.0, atol=1e-9)
    assert fit.misfit < 1e-9
    assert np.isnan([*fit.median_interval, *fit.dispersion_interval, fit.deviance, fit.p_value]).all()


def test_what_is_rejected():
    """By p below .01; by a misfit above .05 where there are no counts; never where there is no fit."""
    bent = np.where(SCALE > 1.2, 0.5, TRUE)
    good = fit_lognormal(SCALE, TRUE, 1000)
    sampled, plain = fit_lognormal(SCALE, bent, 1000), fit_lognormal(SCALE, bent)
    assert not good.rejected
    assert sampled.p_value < 0.001
    assert sampled.rejected == f"p = {sampled.p_value:.2g}, below 0.01"
    assert plain.misfit > 0.05
    assert plain.rejected == "misfit above 0.05"
    assert not plain._replace(misfit=0.05).rejected
    assert not sampled._replace(p_value=0.01).rejected
    assert not fit_lognormal(SCALE, np.zeros(12)).rejected


def test_against_an_independent_maximum_and_its_curvature():
    shares, size = drawn(TRUE, 60, 3), 60

    def loss(logs):
        return -stats.binom.logpmf(
            np.round(shares * size), size, stats.norm.cdf((np.log(SCALE) - logs[0]) / np.exp(logs[1]))
        ).sum()

    result = optimize.minimize(loss, [0.0, -1.0], method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 1e-12}).x
    fit = fit_lognormal(SCALE, shares, size, level=0.9)
    assert np.allclose([fit.median, fit.dispersion], np.exp(result), rtol=1e-6)
    step, hessian = 1e-3, np.empty((2, 2))
    for i, a in enumerate(np.eye(2) * step):
        for j, b in enumerate(np.eye(2) * step):
            corners = loss(result + a + b) - loss(result + a - b) - loss(result - a + b) + loss(result - a - b)
            hessian[i, j] = corners / (4.0 * step**2)
    errors = np.sqrt(np.diag(np.linalg.inv(hessian)))
    reach = np.exp(stats.norm.ppf(0.95) * errors)
    assert np.allclose(fit.median_interval, [fit.median / reach[0], fit.median * reach[0]], rtol=1e-4)
    assert np.allclose(fit.dispersion_interval, [fit.dispersion / reach[1], fit.dispersion * reach[1]], rtol=1e-4)


def test_intervals_cover_and_the_test_rejects_as_often_as_they_say():
    """Of 300 sets, at 95 % coverage and a 5 % test: binomial limits, missed by one in 10,000 choices of the seeds."""
    fits = [fit_lognormal(SCALE, drawn(TRUE, 50, seed), 50) for seed in range(300)]
    medians, spreads = (
        np.array([getattr(fit, name) for fit in fits]) for name in ("median_interval", "dispersion_interval")
    )
    low, high = stats.binom.ppf([5e-5, 1.0 - 5e-5], 300, 0.95)
    # The intervals are those of large samples: at 50 a scale they cover a per cent less.
    assert low - 3 <= np.count_nonzero((medians[:, 0] < MEDIAN) & (medians[:, 1] > MEDIAN)) <= high
    assert low - 3 <= np.count_nonzero((spreads[:, 0] < DISPERSION) & (spreads[:, 1] > DISPERSION)) <= high
    rejected = np.count_nonzero([fit.p_value <= 0.05 for fit in fits])
    assert 300 - high <= rejected <= 300 - low


@pytest.mark.parametrize(
    "law",
    [1.0 - np.exp(-((SCALE / 1.2) ** 3)), 0.9 * TRUE, np.clip(TRUE + 0.1 * np.sin(6.0 * np.log(SCALE)), 0.0, 1.0)],
)
def test_what_is_not_lognormal_is_told(law):
    fit = fit_lognormal(SCALE, drawn(law, 2000, 5), 2000)
    assert fit.p_value <= 0.002
    assert fit.misfit > 0.02


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2))])
def test_the_p_value_is_the_share_of_sets_of_counts_from_the_fitted_curve_that_lie_further(seed):
    """At 2,000 a scale and probabilities away from 0 and 1; 4.5 standard errors of 999 sets."""
    scale = np.geomspace(0.7, 2.0, 8)
    fit = fit_lognormal(scale, drawn(special.ndtr(np.log(scale / MEDIAN) / DISPERSION), 2000, seed), 2000)
    sets = (fit_lognormal(scale, drawn(fit(scale), 2000, 100 + number), 2000) for number in range(999))
    share = np.mean([drawn.deviance >= fit.deviance for drawn in sets])
    assert fit.p_value == pytest.approx(share, abs=4.5 * 0.5 / np.sqrt(999))
    assert fit_lognormal([1.0, 2.0], [0.2, 0.7], 100).p_value == 1.0


def test_unknown_probabilities_are_left_out():
    holes = TRUE.copy()
    holes[[0, 4]] = np.nan
    fit = fit_lognormal(SCALE, holes)
    assert fit.median == pytest.approx(MEDIAN, rel=1e-9)


def test_a_density_a_little_beyond_0_and_1_is_fitted_as_0_and_1():
    """A solver's probabilities may be that: the fit is that of the probabilities cut to [0, 1], to the last digit."""
    sure = np.where(TRUE < 0.01, 0.0, np.where(TRUE > 0.98, 1.0, TRUE))
    beyond = sure - 1e-3 * (sure == 0.0) + 1e-3 * (sure == 1.0)
    assert beyond.min() == -1e-3
    assert beyond.max() == 1.0 + 1e-3
    result, fit_of_cut = fit_lognormal(SCALE, beyond), fit_lognormal(SCALE, sure)
    assert (result.median, result.dispersion, result.misfit) == (
        fit_of_cut.median,
        fit_of_cut.dispersion,
        fit_of_cut.misfit,
    )
    assert result.reason == ""
    assert result.median == pytest.approx(MEDIAN, rel=0.01)
    assert fit_lognormal(SCALE, np.full(12, -1e-3)).reason == "the probability is 0 at all scales"


@pytest.mark.parametrize(
    ("shares", "reason"),
    [
        ([0.0, 0.0, 0.0], "the probability is 0 at all scales"),
        ([1.0, 1.0, 1.0], "the probability is 1 at all scales"),
        ([0.0, 0.0, 1.0], "fewer than two scales have a probability between 0 and 1"),
        ([0.0, 0.4, 1.0], "fewer than two scales have a probability between 0 and 1"),
        ([1.0, 0.5, 0.0], "the shares do not rise with intensity: they fall"),
        ([np.nan, 0.5, np.nan], "fewer than two scales"),
        ([np.nan, np.nan, np.nan], "the probability is 0 at all scales"),
    ],
)
def test_no_fit_has_a_reason(shares, reason):
    fit = fit_lognormal([1.0, 1.5, 2.0], shares, 10)
    assert fit.reason.startswith(reason)
    assert np.isnan([fit.median, fit.dispersion, *fit.median_interval, fit.p_value]).all()


@pytest.mark.parametrize("level", [0.0, 1.0, np.nan])
def test_levels_are_checked(level):
    with pytest.raises(ValueError, match="level: got"):
        fit_lognormal(SCALE, TRUE, 10, level=level)


FLAT = [[0.5] * 4, [0.5, 0.5, 0.5, 0.500001], [0.2] * 4, [0.5, 0.5001, 0.5, 0.5], [0.5, 0.50001, 0.50002, 0.50003]]


@pytest.mark.parametrize("realizations", [None, 20, 1000, 10**6, [20, 30, 40, 50]])
@pytest.mark.parametrize("shares", [*FLAT, [0.9, 0.6, 0.4, 0.2], [0.5, 0.5, 0.5, 0.4], [1.0, 0.0, 0.5, 0.5]])
def test_shares_that_do_not_rise_have_no_fit_and_a_reason(shares, realizations):
    """The likelihood of equal shares is flat: its maximum is where rounding puts it, at a dispersion of 1e16."""
    with np.errstate(all="raise"):
        fit = fit_lognormal([1.0, 2.0, 3.0, 4.0], shares, realizations)
    assert fit.reason.startswith("the shares do not rise with intensity: ")
    falls = shares not in FLAT
    assert ("they fall" in fit.reason) == falls or realizations == [20, 30, 40, 50]
    assert np.isnan([fit.median, fit.dispersion, *fit.median_interval, *fit.dispersion_interval, fit.misfit]).all()
    assert not fit.rejected


@pytest.mark.parametrize("last", [0.51, 0.55, 0.6])
@pytest.mark.parametrize("realizations", [None, 20, 1000])
def test_what_is_reported_of_shares_that_hardly_rise_is_finite(last, realizations):
    fit = fit_lognormal([1.0, 2.0, 3.0, 4.0], [0.5, 0.5, 0.5, last], realizations)
    limits = np.array([*fit.median_interval, *fit.dispersion_interval])
    assert fit.reason or (fit.dispersion < 1e3 and (np.isfinite(limits).all() or realizations is None))
    assert not np.isinf(limits).any()


def test_rows_of_equal_shares_are_left_out():
    rows = np.array([[0.5] * 4, [0.1, 0.3, 0.6, 0.8], [0.8, 0.6, 0.3, 0.1], [0.5, 0.5, 0.5, 0.500001]])
    fitted, medians, spreads, errors = fit_rows(np.log([1.0, 2.0, 3.0, 4.0]), rows)
    assert fitted.tolist() == [1]
    assert len(medians) == len(spreads) == len(errors) == 1
