"""The lognormal fragility curve N(ln(s/m)/β) by maximum likelihood: fit, test, regression and ranking with it.

With z = b₀ + b₁ ln s the curve is N(z), N being the normal distribution function, m = exp(-b₀/b₁) its median and
β = 1/b₁ its dispersion. The log-likelihood of independent binomial counts is concave in (b₀, b₁) (probit regression),
so that Newton's iteration finds its maximum, and the maximum exists unless some scale separates the failures from the
successes. Binomial likelihood in place of least squares: J. W. Baker, "Efficient analytical fragility function fitting
using dynamic structural analysis", Earthquake Spectra 31(1), 579-599, 2015.
"""

import math
from typing import Any, NamedTuple

import numpy as np
import scipy

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array, ArrayLike, Number

_STEEPEST = 1e6
"""Factor of a term above which a likelihood counts as one without a maximum."""

_FLATTEST = 1e-3
"""Rise of z over all scales up to which a likelihood counts as flat: it has a maximum by rounding alone."""

REJECTED = 0.05
"""p-value of the test of lognormal capacities below which a fit is rejected, and so the rate of its false alarms."""


class LognormalFit(NamedTuple):
    """A fitted lognormal curve N(ln(s/m)/β) of the scale s. Calling it evaluates it: ``fit(scale)``.

    Parameters
    ----------
    median : float
        m, in units of the scale; nan where there is no fit.
    dispersion : float
        β, the standard deviation of the logarithm; nan where there is no fit.
    median_interval, dispersion_interval : tuple of (float, float)
        Confidence limits by the observed information; nan if the fit is not to counts.
    misfit : float
        Largest difference of the curve from the data.
    deviance : float
        Twice the log-likelihood ratio of the data to the curve; nan if the fit is not to counts.
    p_value : float
        Of the chi-square test of the deviance (n - 2 degrees of freedom) for counts, of Lilliefors' test
        (`fpk_rocking.risk.capacities`) for the mean over motions; nan without a test.
    level : float
        Confidence of the intervals.
    reason : str
        Why there is no fit; empty where there is one.
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
    def rejected(self) -> str:
        """Why the data reject the fit, as a text; empty where they do not.

        p is below 0.01 for counts, below 0.05 for the mean over motions; without a test the misfit is above 0.05.
        """
        if not math.isnan(self.p_value):
            limit = REJECTED if math.isnan(self.deviance) else 0.01
            return f"p = {self.p_value:.2g}, below {limit}" if self.p_value < limit else ""
        return "misfit above 0.05" if self.misfit > 0.05 else ""

    def __call__(self, scale: Number) -> Number:
        """Probability at each scale.

        Parameters
        ----------
        scale : float or ndarray
            Above 0.
        """
        return scipy.special.ndtr(np.log(np.asarray(scale) / self.median) / self.dispersion)


def fit_lognormal(
    scale: ArrayLike,
    probability: ArrayLike,
    realizations: ArrayLike | None = None,
    *,
    level: float = 0.95,
) -> LognormalFit:
    """Fit a lognormal curve of greatest likelihood to probabilities at several scales.

    Parameters
    ----------
    scale : array_like, shape (n,)
        Scales of the shaking, above 0.
    probability : array_like, shape (n,)
        Probability at each scale, or the share of a sample that overturned; nan is left out.
    realizations : int or array_like, optional
        Size of each independent sample. None for probabilities that are not sampled: each counts like one realization,
        without intervals and test.
    level : float
        Confidence of the intervals, in (0, 1).

    Returns
    -------
    LognormalFit

    Examples
    --------
    >>> from fpk_rocking.risk.lognormal import fit_lognormal
    >>> fit = fit_lognormal([0.5, 1.0, 2.0], [0.1, 0.45, 0.9], realizations=100)
    >>> print(f"median {fit.median:.2f}, dispersion {fit.dispersion:.2f}, p = {fit.p_value:.2f}")
    median 1.03, dispersion 0.54, p = 0.47
    """
    level = checks.part("level", level)
    scale, probability = np.asarray(scale, float), np.asarray(probability, float)
    finite = np.isfinite(probability)
    trials = np.broadcast_to(np.asarray(1.0 if realizations is None else realizations, float), scale.shape)[finite]
    logs, share = np.log(scale[finite]), np.clip(probability[finite], 0.0, 1.0)
    count = share * trials if realizations is None else np.round(share * trials)
    reason = _undetermined(logs, count, trials)
    if reason:
        return LognormalFit(level=level, reason=reason)
    design = np.stack([np.ones_like(logs), logs])
    curve, information = _maximize(design, count[None], trials)
    intercept, slope = curve[0]
    reason = _unusable(slope, logs)
    if reason:
        return LognormalFit(level=level, reason=reason)
    fitted = scipy.special.ndtr(intercept + slope * logs)
    median, dispersion = math.exp(-intercept / slope), 1.0 / float(slope)
    fit = LognormalFit(median, dispersion, misfit=float(np.abs(fitted - share).max()), level=level)
    if realizations is None:
        return fit
    with np.errstate(over="ignore"):
        reach = np.exp(scipy.special.ndtri(0.5 + 0.5 * level) * _errors(intercept, slope, information[0]))
    if not (np.isfinite(reach).all() and math.isfinite(median * reach[0])):
        return LognormalFit(level=level, reason=_NO_RISE + "any median is as likely by these counts")
    deviance = float(_deviance(logs, count[None], trials, curve)[0])
    return fit._replace(
        median_interval=(float(median / reach[0]), float(median * reach[0])),
        dispersion_interval=(float(dispersion / reach[1]), float(dispersion * reach[1])),
        deviance=deviance,
        p_value=float(scipy.special.chdtrc(max(logs.size - 2, 1), max(deviance, 0.0))),
    )


def fit_rows(logs: Array, shares: Array, rows: Array | None = None) -> tuple[Array, Array, Array, Array]:
    """Fit a lognormal curve to each of many sets of probabilities at the same scales.

    Parameters
    ----------
    logs : ndarray, shape (n,)
        Logarithms of the scales.
    shares : ndarray, shape (m, n)
        Probabilities; each counts like one realization.
    rows : ndarray of int, optional
        Rows to fit; by default all.

    Returns
    -------
    rows : ndarray of int, shape (k,)
        Those of them that determine a curve, ascending as they came.
    log_medians : ndarray, shape (k,)
        Logarithm of the median of each.
    dispersions : ndarray, shape (k,)
    errors : ndarray, shape (k, 2)
        Standard errors of the logarithms of median and dispersion by one realization; of N realizations 1/√N of it.
    """
    trials, rows = np.ones(logs.size), np.arange(len(shares)) if rows is None else rows
    rows = np.array([row for row in rows if not _undetermined(logs, shares[row], trials)], int)
    if not rows.size:
        return rows, np.empty(0), np.empty(0), np.empty((0, 2))
    curve, information = _maximize(np.stack([np.ones_like(logs), logs]), shares[rows], trials)
    rises = np.array([not _unusable(slope, logs) for slope in curve[:, 1]])
    intercept, slope = curve[rises].T
    return rows[rises], -intercept / slope, 1.0 / slope, _errors(intercept, slope, information[rises])


class Ranking(NamedTuple):
    """How well an intensity measure orders the outcomes of many motions.

    Parameters
    ----------
    measure : str
        Its name, with its unit.
    deviance : float
        Of the lognormal curve over the measure: twice the log-likelihood that it loses to the probabilities themselves,
        each of which counts like one outcome. The smaller it is, the better the measure alone predicts the outcome.
    median, dispersion : float
        Of that curve.
    """

    measure: str
    deviance: float
    median: float
    dispersion: float


def ranked(fragility: Any, which: int = 0) -> list[Ranking]:
    """Order intensity measures by how well they predict overturning, over all scenes and scales of a fragility.

    Parameters
    ----------
    fragility : Fragility
        Of several motions, not pooled.
    which : int
        Index of the probability: 0 overturning, 1, 2, ... the levels.

    Returns
    -------
    list of Ranking
        Named tuples: `measure`, `deviance`, `median`, `dispersion`, the best first. A measure is left out if a scene
        lacks it, if the outcomes over it determine no curve, or if it is proportional to another one, as
        p PGV/(g tan θ_cr) is to PGV under motions of one block.

    Examples
    --------
    >>> from fpk_rocking import Scene
    >>> from fpk_rocking.risk import fragility, ranked, synthetic_records
    >>> motions = zip((1.2, 1.8, 2.4), synthetic_records(3, duration=5.0))
    >>> racks = [Scene.from_block(0.28 * height, height, record=record) for height, record in motions]
    >>> for ranking in ranked(fragility(racks, scale=[1.0, 2.0, 3.0, 4.0])):
    ...     print(f"{ranking.measure}: deviance {ranking.deviance:.1f}")
    p PGV / (g tan θ_cr): deviance 5.1
    PGV, m/s: deviance 8.0
    PGA, g: deviance 13.3
    """
    shares, rankings = fragility.probability[:, which].ravel(), []
    taken: list[Array] = []
    names = {"pga_g": "PGA, g", "pgv_m_per_s": "PGV, m/s", "relative_velocity": "p PGV / (g tan θ_cr)"}
    for field, name in names.items():
        rows = [measure.columns(1.0)[field] * fragility.scale for measure in fragility.intensities]
        values = np.concatenate(rows)
        positive = np.isfinite(shares) & np.isfinite(values) & (values > 0.0)
        if not positive.all() or (fit := fit_lognormal(values, shares)).reason:
            continue
        # A constant ratio but for rounding: one measure in two units.
        if any(np.ptp(values / other) < 1e-9 * (values / other).max() for other in taken):
            continue
        taken.append(values)
        curve = np.array([[-math.log(fit.median), 1.0]]) / fit.dispersion
        share = np.clip(shares, 0.0, 1.0)
        deviance = float(_deviance(np.log(values), share[None], np.ones(share.size), curve)[0])
        rankings.append(Ranking(name, deviance if math.isfinite(deviance) else math.inf, fit.median, fit.dispersion))
    return sorted(rankings, key=lambda ranking: ranking.deviance)


def _errors(intercept, slope, information):
    """Return standard errors (..., 2) of ln m = -b₀/b₁ and ln β = -ln b₁ by the delta method."""
    zero = np.zeros_like(slope)
    change = np.stack([-1.0 / slope, intercept / slope**2, zero, -1.0 / slope], axis=-1).reshape(*slope.shape, 2, 2)
    covariance = change @ np.linalg.pinv(information, hermitian=True) @ np.swapaxes(change, -1, -2)
    return np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1))


_NO_RISE = "the shares do not rise with intensity: "


def _unusable(slope, logs):
    """Return why a curve of some `slope` over `logs` (n,) is no fit; an empty text where it is one."""
    if not math.isfinite(slope) or slope >= _STEEPEST:
        return "the shares rise too steeply for these scales: put scales closer together"
    if slope * np.ptp(logs) > _FLATTEST:
        return ""
    return _NO_RISE + ("they fall" if slope * np.ptp(logs) < -_FLATTEST else "they are equal, or nearly so")


def _undetermined(logs, count, trials):
    """Return why the likelihood of counts (n,) at `logs` (n,), of `trials` (n,), has no maximum; else an empty text."""
    happened, missed = logs[count > 0.0], logs[count < trials]
    if not happened.size or not missed.size:
        return f"the probability is {'0' if not happened.size else '1'} at all scales"
    if happened.min() >= missed.max():
        return "fewer than two scales have a probability between 0 and 1: put scales closer together"
    return ""


def _likelihood(z, count, trials):
    """Return the log-likelihood (r,) of counts `count` (r, n) of `trials` (n,) under probits `z` (r, n)."""
    return (count * scipy.special.log_ndtr(z) + (trials - count) * scipy.special.log_ndtr(-z)).sum(axis=-1)


def _maximize(design, count, trials):
    """Maximize the likelihood of sets of counts under probits that are linear in some terms; return its place."""
    sets, terms = count.shape[0], len(design)
    middle, spread = design[1].mean(), max(design[1].std(), 1e-9)
    start = np.array([[-middle / spread, 1.0 / spread, *[0.0] * (terms - 2)]])
    curve = np.broadcast_to(start, (sets, terms)).copy()
    reached = _likelihood(curve @ design, count, trials)
    for _ in range(100):
        gradient, information = _derivatives(curve @ design, count, trials, design)
        # Sets that a scale separates have no maximum: their information vanishes, and their steps are held back.
        ridge = 1e-12 * np.trace(information, axis1=1, axis2=2)[:, None, None] * np.eye(terms) + 1e-300 * np.eye(terms)
        step = np.linalg.solve(information + ridge, gradient[..., None])[..., 0]
        step *= np.minimum(1.0, 0.5 * _STEEPEST / np.maximum(np.abs(step).max(axis=1, keepdims=True), 1.0))
        for _ in range(100):
            tried = _likelihood((curve + step) @ design, count, trials)
            worse = tried < reached - 1e-9 * np.abs(reached)
            if not worse.any():
                break
            step[worse] *= 0.5
        curve += step
        gained, reached = tried - reached, tried
        if np.all(np.abs(gained) <= 1e-9 * (1.0 + np.abs(reached))) or np.abs(curve).max() > _STEEPEST:
            break
    return curve, _derivatives(curve @ design, count, trials, design)[1]


def _derivatives(z, count, trials, design):
    """Gradient (r, k) of the log-likelihood by the factors of terms, and its observed information (r, k, k)."""
    density = -0.5 * z * z - 0.5 * math.log(2.0 * math.pi)
    rise, fall = np.exp(density - scipy.special.log_ndtr(z)), np.exp(density - scipy.special.log_ndtr(-z))
    gradient = (count * rise - (trials - count) * fall) @ design.T
    weight = count * rise * (rise + z) + (trials - count) * fall * (fall - z)
    return gradient, np.einsum("rn,in,jn->rij", weight, design, design)


def _deviance(logs, count, trials, curve):
    """Return the deviance (r,) of counts `count` (r, n) of `trials` (n,) from curves: twice the log-likelihood lost."""
    missed = trials - count
    best = scipy.special.xlogy(count, count / trials) + scipy.special.xlogy(missed, missed / trials)
    z = curve[:, :1] + curve[:, 1:] * logs
    return 2.0 * (best.sum(axis=-1) - _likelihood(z, count, trials))


def outcomes_text(scale: Array, curve: Array) -> str:
    """Return at which of `scale` (n,) a path overturns, or reaches a level, as a text; `curve` (n,) is 0, 1 or nan."""
    over = curve == 1.0
    if not over.any():
        return f"it happens at none of the {over.size} scales"
    first, not_over = over.argmax(), np.flatnonzero(~over)
    always = not_over[-1] + 1 if not_over.size else 0
    text = f"it happens at {over.sum()} of {over.size} scales"
    if over.sum() == 1:
        return f"{text}: {scale[first]:.4g}"
    if always == first:
        return f"{text}: from {scale[first]:.4g} on"
    last = f", and at all from {scale[always]:.4g} on" if always < over.size else ""
    return f"{text}: first at {scale[first]:.4g}{last}"


def limits_text(interval: tuple[float, float]) -> str:
    """Return confidence limits, a pair of floats, as a text " (0.9 to 1.1)"; empty where they are nan."""
    return " ({:.4g} to {:.4g})".format(*interval) if np.isfinite(interval[0]) else ""
