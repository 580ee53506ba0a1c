"""The annual frequency of a limit state under a hazard."""

import dataclasses
import functools
import itertools
import math
from typing import Any

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.results.pictures import figure_of
from fpk_rocking.results.result import Dataset, Result
from fpk_rocking.results.trust import CAUTION, UNUSABLE, Diagnostic
from fpk_rocking.risk.hazard import Hazard
from fpk_rocking.scene.units import STANDARD_GRAVITY
from fpk_rocking.studies.pooled import IntensityCurve

_TAIL = 12.0
"""Dispersions, and units of 1/k, over which the frequency is integrated to either side: beyond lies less than 1e-30."""


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Risk(Result):
    """Annual frequency of a limit state.

    Parameters
    ----------
    rate : float
        λ = ∫ P(im) |dH(im)|, 1/year.
    interval : tuple of (float, float)
        95 % limits from the sample of the fragility: its replicates, or, of points, all of their lower or upper limits
        at once, which is wider. The hazard is taken as exact.
    edges : ndarray, shape (b + 1,)
        Intensities between which `contribution` is.
    contribution : ndarray, shape (b,)
        Share of λ that motions between two edges have (disaggregation); a thousandth of λ lies outside.
    beyond_hazard : float
        Share of λ from intensities below or above the points of the hazard, to which its last power laws go on.
    beyond_curve : float
        Share of λ from intensities below or above those of the fragility.
    below_curve : float
        Share of λ from intensities below those of the fragility, to which its curve goes on.
    curve : IntensityCurve
    hazard : Hazard

    Examples
    --------
    >>> from fpk_rocking import Scene
    >>> from fpk_rocking.risk import Hazard, IntensityCurve, annual_frequency, at_intensity
    >>> from fpk_rocking.studies import fragility
    >>> rack = Scene.from_block(0.5, 1.8, "0.3 g", "1.5 Hz",
    ...                         noise_rms_acceleration=0.5, noise_band_hz=(0, 5))
    >>> curves = fragility(at_intensity(rack, "PGV"), scale=[0.5, 0.6, 0.7, 0.8], cycles=4, realizations=500)
    >>> risk = annual_frequency(IntensityCurve.of(curves, "PGV"), Hazard.power_law(rate=1e-3, exponent=2.5))
    >>> print(f"every {risk.return_period:.0f} years, {risk.probability(50.0):.2f} in 50 years")
    every 310 years, 0.15 in 50 years
    """

    rate: float
    interval: tuple[float, float]
    edges: np.ndarray
    contribution: np.ndarray
    beyond_hazard: float
    beyond_curve: float
    below_curve: float
    curve: IntensityCurve
    hazard: Hazard

    @property
    def return_period(self) -> float:
        """Mean time between two events, 1/λ, years; inf where there is none."""
        return 1.0 / self.rate if self.rate > 0.0 else math.inf

    def probability(self, years: float = 50.0) -> float:
        """Return the probability of at least one event in a time, 1 - exp(-λt), the events being independent.

        Parameters
        ----------
        years : float
            At least 0.

        Returns
        -------
        float
        """
        return -math.expm1(-self.rate * checks.number("years", years, at_least=0.0))

    def model_diagnostics(self) -> list[Diagnostic]:
        """Return a list of `Diagnostic`: large shares of the rate from beyond the points of hazard or fragility.

        Above .05 there is caution, above .5 the rate is not to be used: it is then made of an extrapolation.
        """
        lognormal = "its lognormal curve goes on"
        points = f"a lognormal curve of dispersion {self.curve.tail:.2g} goes on below, the last probability above"
        fitted = self.curve.fitted and not self.curve.refined
        beyond = {
            "the hazard curve": (self.beyond_hazard, "its last power law goes on"),
            "the fragility": (self.beyond_curve, lognormal if fitted else points),
        }
        return [
            Diagnostic(
                CAUTION if share <= 0.5 else UNUSABLE,
                f"{100.0 * share:.0f} % of the rate come from intensities beyond the points of {what}, where "
                f"{continued}: give more of them.{self._other_unit() if share > 0.5 else ''}",
                what,
            )
            for what, (share, continued) in beyond.items()
            if share > 0.05
        ]

    def _other_unit(self):
        """Return a question, whether the hazard is in another unit, where that would fit its points; else empty."""
        units = {"PGV": {"cm/s": 100.0}, "PGA": {"m/s²": STANDARD_GRAVITY, "cm/s²": 100.0 * STANDARD_GRAVITY}}
        low, high = self.hazard.intensity[[0, -1]].tolist()
        for unit, factor in units[self.curve.measure].items():
            read = Hazard(self.hazard.intensity / factor, self.hazard.rate)
            beyond = annual_frequency(self.curve, read).beyond_hazard
            # The strongest recorded motions have less than 5 g, the fastest some 3 m/s.
            if high / factor <= 10.0 and beyond <= 0.5:
                return (
                    f" Are the intensities of the hazard in {unit}? They were read in {self.curve.unit}, as {low:.4g} "
                    f"to {high:.4g}; in {unit} they are {low / factor:.4g} to {high / factor:.4g} {self.curve.unit}."
                )
        return ""

    @property
    def rate_error(self) -> float:
        """Standard error of the logarithm of the rate, from its interval; inf where that begins at 0."""
        low, high = self.interval
        return math.inf if low <= 0.0 else math.log(high / low) / (2.0 * 1.96)

    @property
    def sentences(self) -> list[str]:
        """Sentences: the rate in words, with what its interval leaves out, and the messages of `model_diagnostics`."""
        sampled = " and ".join(
            ["records"] * (self.curve.records > 1)
            + ["blocks"] * bool(set(self.curve.sources) - {"noise", "record to record"})
            + ["noise"] * (not len(self.curve.jumps))
        )
        through = (
            "the lognormal curve" if self.curve.fitted and not self.curve.refined else "the points, joined by lines"
        )
        through = "all intensities at which each motion overturns the block" if self.curve.jumps.size else through
        at_once = " (all points at their lower, or all at their upper limits, which is wider than the limits of a fit)"
        wide = "" if self.curve.fitted else at_once
        limits = f"; the limits contain the sampling of {sampled}{wide}" * bool(sampled)
        text = (
            f"{self.title}{self._periods}. By {through}{limits}. The hazard and the model of the block count as known. "
            f"Intensities below those of the fragility give {100.0 * self.below_curve:.2g} % of the rate."
        )
        return [text, *(diagnostic.message for diagnostic in self.model_diagnostics())]

    @property
    def _periods(self):
        """Text of the return period and the probability in 50 years, or their limits if the rate is 0; or empty."""
        if self.rate > 0.0:
            years, probability = f"{self.return_period:.4g} years", f"{self.probability():.3g}"
        elif self.interval[1] > 0.0:
            years = f"above {1.0 / self.interval[1]:.4g} years"
            probability = f"below {-math.expm1(-50.0 * self.interval[1]):.3g}"
        else:
            return ""
        return f": return period {years}, probability in 50 years {probability}"

    @property
    def title(self) -> str:
        """The rate with its limits, as a line of text."""
        name = "overturning" if self.curve.name == "overturned" else self.curve.name
        low, high = map(rate_text, self.interval)
        if not (self.rate > 0.0 or self.interval[1] > 0.0):
            return f"no annual rate of {name}: no motion overturned the block up to the highest intensity"
        if not self.rate > 0.0:
            return f"annual rate of {name} below {high} (95 %: none of {self.curve.units} overturned)"
        limits = f" (95 %: {low} to {high})" if math.isfinite(self.interval[0]) else ""
        return f"annual rate of {name} = {rate_text(self.rate)}{limits}"

    @property
    def remarks(self) -> tuple[str, ...]:
        """The `sentences`."""
        return tuple(self.sentences)

    @property
    def metadata(self) -> dict[str, Any]:
        """Plain values by name: rate, limits, return period, shares beyond the points, measure, median, dispersion."""
        return super().metadata | {
            "interval": self.interval,
            "return_period": self.return_period,
            "probability_50_years": self.probability(),
            "measure": self.curve.measure,
            "unit": self.curve.unit,
            "median": self.curve.fit.median,
            "dispersion": self.curve.fit.dispersion,
        }

    def dataset(self) -> Dataset:
        """Return the `Dataset` of the disaggregation: share of the rate in each bin of intensity, "low" to "high"."""
        columns = {"low": self.edges[:-1], "high": self.edges[1:], "contribution": self.contribution}
        places = {"bin": np.arange(1, self.edges.size)}
        return Dataset({name: ("bin", values) for name, values in columns.items()}, places, ("bin",))

    def plot(self) -> Any:
        """Draw the contributions to the rate, and the hazard; returns a matplotlib figure."""
        from fpk_rocking.risk.report import draw_contributions

        return figure_of(lambda _, axes: draw_contributions(axes, self))


def annual_frequency(curve: IntensityCurve, hazard: Hazard) -> Risk:
    """Return the annual frequency of a limit state.

    The integral is taken over the logarithm of the intensity by Gauss-Legendre rules between the points of the hazard;
    for a lognormal curve and a power law it is right to rounding (λ = k₀ M^(-k) exp(k²β²/2)). A curve whose intensities
    were refined counts by its points, whatever the fit. Without noise it is a sum: each interval of intensities in
    which a motion overturns the block adds the difference of the hazard at its ends.

    Parameters
    ----------
    curve : IntensityCurve
    hazard : Hazard
        In the measure and the unit of the curve.

    Returns
    -------
    Risk
        `rate`, 1/year, and its 95 % limits `interval`; shares of the rate by intensity.

    Examples
    --------
    >>> from fpk_rocking import Scene
    >>> from fpk_rocking.risk import Hazard, IntensityCurve, annual_frequency, at_intensity
    >>> from fpk_rocking.studies import fragility, synthetic_records
    >>> motions = synthetic_records(5, duration=5.0)
    >>> racks = [at_intensity(Scene.from_block(0.5, 1.8, record=motion)) for motion in motions]
    >>> curve = IntensityCurve.of(fragility(racks, scale=[0.5, 1.0, 2.0]))
    >>> risk = annual_frequency(curve, Hazard.power_law(rate=1e-3, exponent=2.5))
    >>> print(f"{risk.rate:.1e} per year")
    1.9e-03 per year
    """
    checks.instance("curve", curve, IntensityCurve)
    checks.instance("hazard", hazard, Hazard)
    edges_of_rule = _edges(curve, hazard)
    low, high = _limits(curve, hazard, edges_of_rule)
    if np.isfinite(curve.jumps).any():
        return _by_jumps(curve, hazard, (low, high))
    by, (y, weights) = _probability(curve), _gauss(edges_of_rule)
    share = weights * _density(by, hazard, y)
    rate, (edges, contribution) = float(share.sum()), _contributions(by, hazard, y, share)
    return Risk(
        rate,
        # The limits of a fit are those of the population's curve; the mean over these motions is a point of them.
        (min(low, rate), max(high, rate)) if curve.refined else (low, high),
        edges,
        contribution,
        _beyond(y, share, hazard.intensity),
        _beyond(y, share, curve.intensity),
        _beyond(y, share, [curve.intensity[0], math.inf]),
        curve,
        hazard,
    )


def _probability(curve):
    """Return a function of intensities that gives probabilities: an `IntensityCurve`, or by its points if refined."""
    return functools.partial(curve.along, curve.probability) if curve.refined else curve


def _by_jumps(curve, hazard, limits):
    """Return the `Risk` of motions without noise, from the intensities at which their outcomes change.

    `curve`: an `IntensityCurve` with `jumps`; `limits`: 95 % limits (low, high) of the population's rate, 1/year.
    """
    signs = 1.0 - 2.0 * (np.arange(curve.jumps.shape[-1]) % 2)

    def above(intensity):
        """Return the annual rate (r,) at which each record overturns a block at intensities above `intensity`."""
        return np.nansum(signs * hazard(np.maximum(curve.jumps, intensity)), axis=-1).mean(axis=-1)

    rates, lowest = above(0.0), np.nanmin(curve.jumps)
    rate = float(rates.mean())
    # The limits are those of the population's curve; the mean over these motions is a point of them.
    limits = min(limits[0], rate), max(limits[1], rate)
    ends = []
    for part in (1.0 - 5e-4, 5e-4):
        left, right = math.log(lowest), math.log(lowest) + _TAIL * math.log(10.0) / hazard.exponents.min()
        for _ in range(60):  # halvings to rounding
            middle = 0.5 * (left + right)
            left, right = (middle, right) if above(math.exp(middle)).mean() > part * rate else (left, middle)
        ends.append(right)
    edges = np.exp(np.linspace(ends[0], ends[1], 25))
    share = np.array([above(edge).mean() for edge in edges]) / rate
    points = *hazard.intensity[[0, -1]], *curve.intensity[[0, -1]]
    first, last, least, most = (above(point).mean() / rate for point in points)
    below = 1.0 - least
    return Risk(rate, limits, edges, -np.diff(share), 1.0 - first + last, most, below, curve, hazard)


def rate_text(rate: float) -> str:
    """Return a rate as a text of three digits, as "1.23e-4"."""
    return f"{rate:.2e}".replace("e-0", "e-").replace("e+00", "")


def _edges(curve, hazard):
    """Return edges (n + 1,) in ln(intensity), points of `Hazard` and curve among them, of Gauss-Legendre rules."""
    steep, gentle = hazard.exponents.max(), hazard.exponents.min()
    points = np.log(hazard.intensity)
    spread = curve.tail
    # The product of curve and hazard peaks k β² below the median, and falls as the normal density or as im^(-k).
    low = math.log(curve.fit.median if curve.fitted else curve.intensity[0]) - steep * spread**2 - _TAIL * spread
    high = _TAIL * math.log(10.0) / gentle
    if curve.fitted:
        high += math.log(curve.fit.median) + _TAIL * spread
    else:
        high += math.log(curve.intensity[-1])
    if curve.refined or not curve.fitted:
        points = np.concatenate([points, np.log(curve.intensity)])
    width = min(0.25 * spread, 1.0 / steep)
    points = np.unique(np.concatenate([[low, high], points[(points > low) & (points < high)]]))
    parts = [
        np.linspace(a, b, max(1, math.ceil((b - a) / width)), endpoint=False) for a, b in itertools.pairwise(points)
    ]
    return np.append(np.concatenate(parts), high)


def _gauss(edges):
    """Return (nodes, weights), (12 n,) each, of Gauss-Legendre rules of 12 points between `edges` (n + 1,)."""
    nodes, weights = np.polynomial.legendre.leggauss(12)
    half = 0.5 * np.diff(edges)[:, None]
    return (edges[:-1, None] + half * (1.0 + nodes)).ravel(), (half * weights).ravel()


def _density(probability, hazard, y):
    """Return the annual rate (n,) in a unit of y = ln(intensity), at y (n,): |dH| = k H dy, times the probability.

    `probability`: a function of the intensities; `hazard`: the `Hazard` H, of exponent k between two of its points.
    """
    place = np.clip(np.searchsorted(np.log(hazard.intensity), y) - 1, 0, hazard.intensity.size - 2)
    return hazard.exponents[place] * hazard(np.exp(y)) * probability(np.exp(y))


def _limits(curve, hazard, edges):
    """Return 95 % limits (low, high) of the rate, 1/year, from those of the curve, or nan; `edges`: of `_edges`."""
    if curve.fitted and len(curve.replicates):
        low, high = np.quantile(_by_replicates(curve, hazard, edges[0], edges[-1]), [0.025, 0.975]).tolist()
        return low, high
    if curve.fitted:
        return math.nan, math.nan
    y, weights = _gauss(edges)
    density = weights * _density(np.ones_like, hazard, y)
    low, high = (float(density @ curve.along(side, np.exp(y))) for side in curve.interval.T)
    return low, high


def _by_replicates(curve, hazard, first, last):
    """Return annual rates (b,) by the b lognormal curves of the replicates, over ln(intensity) from `first` to `last`.

    By parts ∫ N |dH| = -[H N] + ∫ H dN, and the power law H of exponent k moves the normal density by -k β².
    """
    from scipy import special

    # Few motions agree with medians of 0 and inf.
    with np.errstate(divide="ignore"):
        middle = np.clip(np.log(curve.replicates[:, :1]), -1e4, 1e4)
    spread, logs = curve.replicates[:, 1:], np.log(hazard.intensity)
    ends = np.concatenate([[first], logs[(logs > first) & (logs < last)], [last]])
    place = np.clip(np.searchsorted(logs, 0.5 * (ends[1:] + ends[:-1])) - 1, 0, logs.size - 2)
    k, away = hazard.exponents[place], (ends - middle) / spread
    low, high = away[:, :-1] + k * spread, away[:, 1:] + k * spread
    # Tails are subtracted on the side where the normal distribution has its digits.
    turned = low > 0.0
    low, high = np.where(turned, -high, low), np.where(turned, -low, high)
    factor = np.log(hazard.rate)[place] + k * (logs[place] - middle) + 0.5 * (k * spread) ** 2
    parts = np.exp(factor + special.log_ndtr(high)) - np.exp(factor + special.log_ndtr(low))
    left, right = (hazard(np.exp(ends[[0, -1]])) * special.ndtr(away[:, [0, -1]])).T
    return parts.sum(axis=1) + left - right


def _contributions(probability, hazard, y, share):
    """Return (edges, shares): edges (25,) of bins of intensity with all but a thousandth of the rate; its shares (24,).

    `probability`: a function of intensities; `share` (n,): parts of the rate at the nodes y = ln(intensity), (n,). Of a
    rate of 0 it is one bin, of 0.
    """
    total = share.sum()
    if not total > 0.0:
        return np.exp(y[[0, -1]]), np.zeros(1)
    part = np.cumsum(share) / total
    low, high = y[np.searchsorted(part, [5e-4, 1.0 - 5e-4])].tolist()
    edges = np.linspace(low, high, 25)
    nodes, weights = _gauss(edges)
    return np.exp(edges), (weights * _density(probability, hazard, nodes)).reshape(24, -1).sum(axis=1) / total


def _beyond(y, share, points):
    """Return the part (float) of the rate from outside the intensities from `points[0]` to `points[-1]`.

    `share` (n,): contributions to the rate at the nodes y = ln(intensity), (n,).
    """
    outside = (y < math.log(points[0])) | (y > math.log(points[-1]))
    total = share.sum()
    return float(share[outside].sum() / total) if total > 0.0 else 0.0
