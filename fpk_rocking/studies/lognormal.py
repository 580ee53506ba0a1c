"""The lognormal fragility curve N(ln(s/m)/β) by maximum likelihood, its uncertainty, and whether it fits at all.

With z = b₀ + b₁ ln s the curve is N(z), N being the normal distribution function, m = exp(-b₀/b₁) its median and
β = 1/b₁ its dispersion. The log-likelihood of independent binomial counts is concave in (b₀, b₁) (probit regression),
so that Newton's iteration finds its maximum, and the maximum exists unless some scale separates the failures from the
successes. Binomial likelihood in place of least squares: J. W. Baker, "Efficient analytical fragility function fitting
using dynamic structural analysis", Earthquake Spectra 31(1), 579-599, 2015.
"""

import math
from typing import NamedTuple

import numpy as np
import scipy

from fpk_rocking.base import checks
from fpk_rocking.base.types import Array, ArrayLike, Number

P_VALUE = "p: probability that counts drawn from the fitted curve differ from it as much; a small p: not lognormal."
"""What stands below fits with a p-value."""

REJECTED, MISFIT = 0.01, 0.05
"""The p-value below which a fit is rejected; for probabilities that are no counts, the misfit above which it is."""

_ROUNDS, _SMALL = 100, 1e-9
_LOG_ROOT = 0.5 * math.log(2.0 * math.pi)
_STEEPEST = 1e6


class LognormalFit(NamedTuple):
    """A fitted lognormal curve N(ln(s/m)/β) of the scale s. Calling it evaluates it: ``fit(scale)``.

    Parameters
    ----------
    median : float
        m, in units of the scale; nan where there is no fit.
    dispersion : float
        β, the standard deviation of the logarithm; nan where there is no fit.
    median_interval, dispersion_interval : tuple of (float, float)
        Confidence limits, from the observed information, symmetric in ln m and ln β; nan for a fit not to counts.
    misfit : float
        Largest difference of the curve from the data.
    deviance : float
        Twice the log-likelihood ratio of the data to the curve; nan where the fit is not to counts.
    p_value : float
        Probability that counts drawn from the fitted curve have at least this deviance. A small one says that the data
        are not lognormal. nan where the fit is not to counts.
    level : float
        Confidence of the intervals.
    reason : str
        Why there is no fit; empty where there is one.

    Examples
    --------
    >>> from fpk_rocking.studies.lognormal import fit_lognormal
    >>> fit = fit_lognormal([0.5, 1.0, 2.0], [0.1, 0.45, 0.9], realizations=100)
    >>> print(fit([0.7, 1.4]).round(2), [round(limit, 2) for limit in fit.median_interval])
    [0.24 0.71] [0.94, 1.13]
    """

    median: float = math.nan
    dispersion: float = math.nan
    median_interval: tuple[float, float] = (math.nan, math.nan)
    dispersion_interval: tuple[float, float] = (math.nan, math.nan)
    misfit: float = math.nan
    deviance: float = math.nan
    p_value: float = math.nan
    level: float = 0.95
    reason: str = ""

    @property
    def rejected(self) -> bool:
        """Whether there is a fit and the data reject it: p below 0.01; without counts, a misfit above 0.05."""
        if self.reason:
            return False
        return self.misfit > MISFIT if math.isnan(self.p_value) else self.p_value < REJECTED

    def __call__(self, scale: Number) -> Number:
        """Evaluate the curve.

        Parameters
        ----------
        scale : float or ndarray
            Above 0.

        Returns
        -------
        float or ndarray
            Probability at the scale.
        """
        return scipy.special.ndtr(np.log(np.asarray(scale) / self.median) / self.dispersion)


def fit_lognormal(
    scale: ArrayLike,
    probability: ArrayLike,
    realizations: ArrayLike | None = None,
    *,
    level: float = 0.95,
    samples: int = 999,
    seed: int = 1,
) -> LognormalFit:
    """Fit a lognormal curve of greatest likelihood to probabilities at several scales.

    Parameters
    ----------
    scale : array_like, shape (n,)
        Scales of the shaking, above 0.
    probability : array_like, shape (n,)
        Probability at each scale, or the share of a sample that overturned; nan is left out.
    realizations : int or array_like, optional
        Number of realizations of each sample; samples are independent of each other. None for probabilities that are
        not sampled: each is clipped to [0, 1] and counts like one realization, and there is no interval and no test.
    level : float
        Confidence of the intervals, in (0, 1).
    samples : int
        Number of sets of counts that are drawn from the fitted curve for `LognormalFit.p_value` (parametric bootstrap).
    seed : int
        Seed of these draws.

    Returns
    -------
    LognormalFit

    Examples
    --------
    >>> from fpk_rocking.studies.lognormal import fit_lognormal
    >>> fit = fit_lognormal([0.5, 1.0, 2.0], [0.1, 0.45, 0.9], realizations=100)
    >>> print(f"median {fit.median:.2f}, dispersion {fit.dispersion:.2f}, rejected: {fit.rejected}")
    median 1.03, dispersion 0.54, rejected: False
    """
    level = checks.part("level", level)
    scale, probability = np.asarray(scale, float), np.asarray(probability, float)
    known = np.isfinite(probability)
    trials = np.broadcast_to(np.asarray(1.0 if realizations is None else realizations, float), scale.shape)[known]
    logs, share = np.log(scale[known]), np.clip(probability[known], 0.0, 1.0)
    count = share * trials if realizations is None else np.round(share * trials)
    reason = _undetermined(logs, count, trials)
    if reason:
        return LognormalFit(level=level, reason=reason)
    design = np.stack([np.ones_like(logs), logs])
    curve, information = maximize(design, count[None], trials)
    if not 0.0 < curve[0, 1] < _STEEPEST:
        return LognormalFit(level=level, reason="the probability does not rise with the scale")
    intercept, slope = curve[0]
    fitted = scipy.special.ndtr(intercept + slope * logs)
    median, dispersion = math.exp(-intercept / slope), 1.0 / float(slope)
    fit = LognormalFit(median, dispersion, misfit=float(np.abs(fitted - share).max()), level=level)
    if realizations is None:
        return fit
    # Errors of ln m = -b₀/b₁ and ln β = -ln b₁ by the delta method.
    change = np.array([[-1.0 / slope, intercept / slope**2], [0.0, -1.0 / slope]])
    errors = np.sqrt(np.diag(change @ np.linalg.inv(information[0]) @ change.T))
    reach = np.exp(scipy.special.ndtri(0.5 + 0.5 * level) * errors)
    deviance = float(_deviance(logs, count[None], trials, curve)[0])
    drawn = np.random.default_rng(seed).binomial(trials.astype(int), fitted, (samples, logs.size)).astype(float)
    lost = _deviance(logs, drawn, trials, maximize(design, drawn, trials, curve)[0])
    # What rounding leaves of two equal deviances is no difference.
    as_far = np.count_nonzero(lost >= deviance - _SMALL * (1.0 + deviance))
    return fit._replace(
        median_interval=(float(median / reach[0]), float(median * reach[0])),
        dispersion_interval=(float(dispersion / reach[1]), float(dispersion * reach[1])),
        deviance=deviance,
        p_value=float((1 + as_far) / (samples + 1)),
    )


def refitted(scale: ArrayLike, shares: Array) -> Array:
    """Fit lognormal curves to many sets of probabilities at the same scales.

    Parameters
    ----------
    scale : array_like, shape (n,)
        Above 0.
    shares : ndarray, shape (b, n)
        Probabilities, in [0, 1].

    Returns
    -------
    ndarray, shape (c, 2)
        Median and dispersion, of those sets that determine a curve.
    """
    logs, trials = np.log(np.asarray(scale, float)), np.ones(np.size(scale))
    known = np.array([not _undetermined(logs, share, trials) for share in shares], bool)
    if not known.any():
        return np.empty((0, 2))
    intercept, slope = maximize(np.stack([np.ones_like(logs), logs]), shares[known], trials)[0].T
    rises = (slope > 0.0) & (slope < _STEEPEST)
    return np.stack([np.exp(-intercept[rises] / slope[rises]), 1.0 / slope[rises]], axis=-1)


def shares_deviance(scale: ArrayLike, probability: ArrayLike, fit: LognormalFit) -> float:
    """Return twice the log-likelihood that probabilities, each counting like one outcome, lose by a fit.

    Parameters
    ----------
    scale, probability : array_like, shape (n,)
    fit : LognormalFit

    Returns
    -------
    float
    """
    logs, share = np.log(np.asarray(scale, float)), np.clip(np.asarray(probability, float), 0.0, 1.0)
    curve = np.array([[-math.log(fit.median), 1.0]]) / fit.dispersion
    return float(_deviance(logs, share[None], np.ones(share.size), curve)[0])


def _undetermined(logs, count, trials):
    """Say why a likelihood has no maximum, or return an empty text."""
    happened, missed = logs[count > 0.0], logs[count < trials]
    if not happened.size or not missed.size:
        return f"the probability is {'0' if not happened.size else '1'} at all scales"
    if happened.min() >= missed.max():
        return "fewer than two scales have a probability between 0 and 1: put scales closer together"
    if np.ptp(logs) == 0.0:
        return "a curve takes two scales"
    return ""


def _likelihood(z, count, trials):
    """Log-likelihood (r,) of counts (r, n) under probits z (r, n)."""
    return (count * scipy.special.log_ndtr(z) + (trials - count) * scipy.special.log_ndtr(-z)).sum(axis=-1)


def maximize(design: Array, count: Array, trials: Array, start: Array | None = None) -> tuple[Array, Array]:
    """Maximize the likelihood of sets of counts under probits that are linear in some terms.

    Parameters
    ----------
    design : ndarray, shape (k, n)
        Values of the terms: ones, the logarithms of the scales, and any others.
    count : ndarray, shape (r, n)
        Sets of counts.
    trials : ndarray, shape (n,)
    start : ndarray, shape (r or 1, k), optional
        Where to begin.

    Returns
    -------
    curve : ndarray, shape (r, k)
        Factors of the terms.
    information : ndarray, shape (r, k, k)
        Observed information.
    """
    sets, terms = count.shape[0], len(design)
    if start is None:
        middle, spread = design[1].mean(), max(design[1].std(), _SMALL)
        start = np.array([[-middle / spread, 1.0 / spread, *[0.0] * (terms - 2)]])
    curve = np.broadcast_to(start, (sets, terms)).copy()
    reached = _likelihood(curve @ design, count, trials)
    for _ in range(_ROUNDS):
        gradient, information = _derivatives(curve @ design, count, trials, design)
        # Sets that a scale separates have no maximum: their information vanishes, and their steps are held back.
        ridge = 1e-12 * np.trace(information, axis1=1, axis2=2)[:, None, None] * np.eye(terms) + 1e-300 * np.eye(terms)
        step = np.linalg.solve(information + ridge, gradient[..., None])[..., 0]
        step *= np.minimum(1.0, 0.5 * _STEEPEST / np.maximum(np.abs(step).max(axis=1, keepdims=True), 1.0))
        for _ in range(_ROUNDS):
            tried = _likelihood((curve + step) @ design, count, trials)
            worse = tried < reached - _SMALL * np.abs(reached)
            if not worse.any():
                break
            step[worse] *= 0.5
        curve += step
        gained, reached = tried - reached, tried
        if np.all(np.abs(gained) <= _SMALL * (1.0 + np.abs(reached))) or np.abs(curve).max() > _STEEPEST:
            break
    return curve, _derivatives(curve @ design, count, trials, design)[1]


def _derivatives(z, count, trials, design):
    """Gradient (r, k) of the log-likelihood, and its observed information (r, k, k)."""
    density = -0.5 * z * z - _LOG_ROOT
    rise, fall = np.exp(density - scipy.special.log_ndtr(z)), np.exp(density - scipy.special.log_ndtr(-z))
    gradient = (count * rise - (trials - count) * fall) @ design.T
    weight = count * rise * (rise + z) + (trials - count) * fall * (fall - z)
    return gradient, np.einsum("rn,in,jn->rij", weight, design, design)


def _deviance(logs, count, trials, curve):
    """Twice the log-likelihood (r,) that counts (r, n) lose by curves (r, 2)."""
    missed = trials - count
    best = scipy.special.xlogy(count, count / trials) + scipy.special.xlogy(missed, missed / trials)
    z = curve[:, :1] + curve[:, 1:] * logs
    return 2.0 * (best.sum(axis=-1) - _likelihood(z, count, trials))
