"""Seismic hazard: how often a year an intensity is exceeded, and integrals of a fragility over it.

The integrals, for `rate`, are annual rates, their limits, and what parts of them come from which intensities.
"""

import dataclasses
import functools
import itertools
import math
from collections.abc import Callable, Sequence
from typing import Self

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array, File, Number
from fpk_rocking.risk.capacities import DRAWS, Capacities
from fpk_rocking.risk.hazard_files import read
from fpk_rocking.risk.motions import measure_of
from fpk_rocking.risk.population import IntensityCurve
from fpk_rocking.risk.search import signs_of

_LAST = "a rate that falls to the last point, as the last power law goes on; or 0 there"

LARGEST = 690.0
"""Largest ln(intensity) whose intensity is a number."""


@dataclasses.dataclass(frozen=True, eq=False)
class Hazard:
    """Annual rate at which the ground motion exceeds an intensity, a power law between points and beyond the last ones.

    Before a point of rate 0 the last power law continues up to the intensity of that point; nothing exceeds it.

    Parameters
    ----------
    intensity : array_like, shape (n,)
        Intensities in the unit of the curve they are used with (g or m/s), ascending, above 0, at least two.
    rate : array_like, shape (n,)
        Annual rate of exceedance at each, 1/year: above 0 at two points or more, nowhere rising, and falling to the
        last. For a return period T, years, it is 1/T; for a probability p in t years -ln(1 - p)/t.
    source : str
        Where it is from, such as the name of a file.
    measure : str
        As for `at_intensity`; a curve of another measure is refused. Empty where it is not known.
    note : str
        Sentence on how a file was read.

    Raises
    ------
    TypeError, ValueError
        The numbers do not meet these conditions.

    Examples
    --------
    >>> from fpk_rocking.risk import Hazard
    >>> hazard = Hazard(intensity=[0.1, 0.5, 2.0], rate=[5e-2, 3e-3, 2.5e-5])
    >>> print(f"{hazard(0.3):.4f} per year", hazard.exponents.round(2))
    0.0073 per year [1.75 3.45]
    """

    intensity: np.ndarray
    rate: np.ndarray
    source: str = ""
    measure: str = ""
    note: str = ""

    def __post_init__(self):
        for name, accepted in (
            ("intensity", "2 to 10,000 finite numbers above 0"),
            ("rate", "2 to 10,000 finite numbers, none below 0"),
        ):
            values = np.array(checks.sequence(f"hazard.{name}", getattr(self, name), accepted), float)
            # `with_slopes` adds two.
            inside = values > 0.0 if name == "intensity" else values >= 0.0
            if not 2 <= values.size <= 10_002 or not np.all(inside & np.isfinite(values)):
                raise ValueError(checks.refusal(f"hazard.{name}", values.tolist(), accepted))
            object.__setattr__(self, name, values)
        if self.intensity.size != self.rate.size:
            raise ValueError(
                checks.refusal("hazard.rate", f"{self.rate.size} rates", f"{self.intensity.size}, one each")
            )
        object.__setattr__(self, "measure", self.measure and measure_of(self.measure, "hazard.measure").name)
        steps = np.diff(self.intensity), -np.diff(self.rate)
        if (steps[1] < 0.0).all():
            accepted = "rates, which fall; return periods rise: a rate is 1/period"
            raise ValueError(checks.refusal("hazard.rate", self.rate.tolist(), accepted))
        for name, kept, accepted in (
            ("intensity", steps[0] > 0.0, "values that rise strictly"),
            ("rate", steps[1] >= 0.0, "values that do not rise"),
            ("rate", np.append(np.full(steps[1].size - 1, True), steps[1][-1] > 0.0 or not self.rate[-1]), _LAST),
        ):
            if not kept.all():
                place = int(kept.argmin()) + 1
                raise ValueError(checks.refusal(f"hazard.{name}[{place}]", float(getattr(self, name)[place]), accepted))
        if (self.rate > 0.0).sum() < 2:
            raise ValueError(checks.refusal("hazard.rate", self.rate.tolist(), "at least two rates above 0"))

    @classmethod
    def power_law(cls, rate: float, exponent: float) -> Self:
        """Return the hazard k₀ im^(-k), with points at .001 and 1,000 g or m/s.

        Parameters
        ----------
        rate : float
            k₀: the annual rate at which 1 g or 1 m/s is exceeded, above 0, at most 1.
        exponent : float
            k, above 0.
        """
        rate = checks.number("rate at 1 g or 1 m/s", rate, above=0.0, at_most=1.0)
        exponent = checks.number("exponent", exponent, above=0.0)
        ends = np.array([1e-3, 1e3])
        return cls(ends, rate * ends**-exponent)

    @classmethod
    def from_csv(cls, path: File, site: str | int | None = None) -> Self:
        """Read a hazard curve from a file of two columns, or one that OpenQuake exports.

        Parameters
        ----------
        path : str or pathlib.Path
            Two columns, separated by commas, semicolons, tabs or blanks; except with commas, numbers may have decimal
            commas. Lines that begin with ``#`` are comments. The first line, or a comment, may name the columns, in
            any order: an intensity with its unit, and an annual rate, a return period in years, or a probability with
            its time, as in ``PGA (g),return period (years)`` or ``PGV (cm/s),probability in 50 years``. Columns without
            names are taken as intensity, in the unit of the curve, and annual rate; a comment may then name the measure
            alone. Or a hazard curve of OpenQuake (``lon,lat,depth,poe-...``), whose comment names measure and time.
        site : str or int, optional
            For a file of OpenQuake with several sites: "lon,lat" in degrees, or the number of its line, from 1.

        Returns
        -------
        Hazard
            With `measure`, where the file names it, and `note`.

        Raises
        ------
        FileNotFoundError
            There is no such file.
        ValueError
            A line cannot be read, or the numbers are no hazard curve; the message names the file, and the line or what
            to write. Columns without names that may be return periods or probabilities are refused.
        """
        file = checks.path("hazard", path)
        try:
            intensity, rate, measure, note = read(file.read_text(encoding="utf-8-sig"), site)
            return cls(intensity, rate, file.name, measure, note)
        except FileNotFoundError:
            raise FileNotFoundError(f"hazard: no file {str(path)!r}") from None
        except OSError as error:
            raise OSError(f"hazard: {str(path)!r} cannot be read ({error.strerror})") from None
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from None

    def check_measure(self, measure: str) -> None:
        """Raise ValueError if this hazard is for another measure than a curve.

        Parameters
        ----------
        measure : str
            That of the curve.
        """
        if self.measure not in ("", measure):
            accepted = f"{measure}, as for the curve; measure={self.measure!r} (--measure) changes that of the curve"
            raise ValueError(checks.refusal("measure of the hazard", self.measure, accepted))

    @property
    def exponents(self) -> Array:
        """Exponents k (n - 1,) of the power laws between the points that are above 0."""
        above = self.rate > 0.0
        return -np.diff(np.log(self.rate[above])) / np.diff(np.log(self.intensity[above]))

    @functools.cached_property
    def end(self) -> float:
        """Intensity from which nothing is exceeded; inf where the rate is above 0 at all points."""
        return float(self.intensity[self.rate == 0.0].min(initial=math.inf))

    @functools.cached_property
    def laws(self) -> tuple[Array, Array, Array]:
        """(logs, log_rates, slopes): ln of the points (m,), and exponents (m + 1,) below, between and beyond them.

        A point of rate 0 is replaced by the end of the last law, at its intensity; `__call__` uses no law beyond it.
        """
        above, slopes = self.rate > 0.0, self.exponents
        logs, values = np.log(self.intensity[above]), np.log(self.rate[above])
        slopes = np.concatenate([slopes[:1], slopes, slopes[-1:]])
        if math.isfinite(self.end):
            logs = np.append(logs, math.log(self.end))
            values = np.append(values, values[-1] - slopes[-1] * (logs[-1] - logs[-2]))
            slopes = np.append(slopes, max(slopes[-1], 1.0))
        return logs, values, slopes

    def with_slopes(self, below: float, beyond: float) -> Self:
        """Return the hazard with other exponents below its first and beyond its last point.

        Parameters
        ----------
        below, beyond : float
            Factors of these two exponents, above 0.
        """
        logs, _, slopes = self.laws
        rows = [(math.exp(logs[0]) / 2.0, self.rate[0] * 2.0 ** min(below * slopes[0], 900.0))]
        rows += zip(self.intensity, self.rate, strict=True)
        if math.isinf(self.end):
            rows.append((2.0 * self.intensity[-1], self.rate[-1] * 2.0 ** (-beyond * slopes[-1])))
        return dataclasses.replace(self, intensity=np.array(rows)[:, 0], rate=np.array(rows)[:, 1])

    @property
    def law(self) -> str:
        """Power law of a hazard of two points as a text, as in "0.001 im^-2.5"; empty for one of more points."""
        if self.intensity.size > 2:
            return ""
        exponent = float(self.exponents[0])
        return f"{self.rate[0] * self.intensity[0] ** exponent:.4g} im^-{exponent:.4g}"

    def log_rate(self, y: Number) -> Number:
        """Return ln of the annual rate as if no point had the rate 0.

        Parameters
        ----------
        y : float or ndarray
            ln(intensity).
        """
        logs, values, slopes = self.laws
        place = np.searchsorted(logs, y)
        point = np.maximum(place - 1, 0)
        return values[point] - slopes[place] * (y - logs[point])

    def slope(self, y: Number) -> Number:
        """Return the exponent of the power law at an intensity.

        Parameters
        ----------
        y : float or ndarray
            ln(intensity).
        """
        return self.laws[2][np.searchsorted(self.laws[0], y)]

    def last_log(self, y: float) -> float:
        """Return ln of an intensity, above all points, at which the rate is less than 1e-12 of that at another.

        Parameters
        ----------
        y : float
            ln of the other.
        """
        logs, values, slopes = self.laws
        return max(y, logs[-1] + max(values[-1] - self.log_rate(y) + TAIL * math.log(10.0), 0.0) / slopes[-1])

    def exceeded_at(self, rate: Array) -> Array:
        """Return the intensities (n,) that are exceeded at annual rates: inf for the rate 0, for a plateau its end.

        Parameters
        ----------
        rate : ndarray, shape (n,)
            1/year.
        """
        logs, values, slopes = self.laws
        with np.errstate(divide="ignore", over="ignore"):
            wanted = np.log(rate)
            place = np.searchsorted(-values, -wanted, side="right")
            point = np.maximum(place - 1, 0)
            away = np.divide(values[point] - wanted, slopes[place], np.zeros(wanted.shape), where=slopes[place] > 0.0)
            return np.exp(logs[point] + away)

    def __call__(self, intensity: Number) -> Number:
        """Return the annual rate, 1/year, at which an `intensity`, or each of an array, is exceeded."""
        with np.errstate(over="ignore"):
            return np.where(np.less(intensity, self.end), np.exp(self.log_rate(np.log(intensity))), 0.0)[()]


TAIL = 12.0
"""Dispersions, and units of 1/k, over which the frequency is integrated to either side: beyond lies less than 1e-30."""


def edges_of_rules(curve: IntensityCurve, hazard: Hazard) -> Array:
    """Return edges (n + 1,) in ln(intensity) of Gauss-Legendre rules."""
    places = np.log(curve.outcomes[0])
    points, spread = hazard.laws[0], curve.tail
    first = last = math.log(curve.fit.median) if curve.fitted else places[0]
    if curve.fitted:
        last += TAIL * spread
    if curve.by_points or not curve.fitted:
        points, first, last = np.concatenate([points, places]), min(first, places[0]), max(last, places[-1])
    first = min(first, math.log(hazard.end))
    # Where the product of hazard and lognormal curve is less than 1e-30 of that at its median or where the hazard ends.
    away = TAIL + 2.0 * hazard.laws[2].max() * spread
    for _ in range(60):
        gained = hazard.log_rate(first - away * spread) - hazard.log_rate(first)
        away = math.sqrt(TAIL**2 + 2.0 * max(gained, 0.0))
    low, high = max(first - away * spread, -LARGEST), min(hazard.last_log(last), math.log(hazard.end), LARGEST)
    last = min(last, high)
    if hazard.log_rate(low) > LARGEST:
        accepted = "less, as this power law leads to infinite rates below the points: give lower intensities"
        raise ValueError(checks.refusal("lowest exponent of the hazard", round(float(hazard.laws[2][0]), 1), accepted))
    ends = np.unique(np.concatenate([[low, last, high], points[(points > low) & (points < high)]]))
    middles = 0.5 * (ends[1:] + ends[:-1])
    # Where the hazard does not fall nothing happens; beyond the curve its power law alone is integrated.
    fall = hazard.slope(middles)
    parts = np.diff(ends) * np.where(middles < last, np.maximum(fall, 4.0 / spread), fall) * (fall > 0.0)
    counts = np.maximum(np.ceil(parts), 1.0).astype(int)
    rules = [np.linspace(a, b, n, endpoint=False) for (a, b), n in zip(itertools.pairwise(ends), counts, strict=True)]
    return np.append(np.concatenate(rules), high)


def gauss_nodes(edges: Array) -> tuple[Array, Array]:
    """Return (nodes, weights), (12 n,) each, of Gauss-Legendre rules of 12 points between `edges` (n + 1,)."""
    nodes, weights = np.polynomial.legendre.leggauss(12)
    half = 0.5 * np.diff(edges)[:, None]
    return (edges[:-1, None] + half * (1.0 + nodes)).ravel(), (half * weights).ravel()


def rate_density(probability: Callable[[Array], Array], hazard: Hazard, y: Array) -> Array:
    """Return the annual rate (n,) in a unit of y = ln(intensity), at y (n,): |dH| = k H dy, times the probability."""
    return hazard.slope(y) * np.exp(hazard.log_rate(y)) * probability(np.exp(y))


def shares_of_rate(probability: Callable[[Array], Array], hazard: Hazard, edges: Array) -> tuple[Array, Array]:
    """Return (y, share), (n,) each: nodes in ln(intensity) of rules between `edges`, and the rate (1/year) of each.

    At the last edge is what is exceeded there: all that is left where the hazard ends, and the rest of a law that
    hardly falls.
    """
    y, weights = gauss_nodes(edges)
    share = weights * rate_density(probability, hazard, y)
    last = np.exp(hazard.log_rate(edges[-1:])) * probability(np.exp(edges[-1:]))
    return np.append(y, edges[-1]), np.append(share, last)


def motion_rates(curve: IntensityCurve, hazard: Hazard, above: float = 0.0) -> Array:
    """Return the annual rate (r,) under each motion, or event, alone, 1/year; the rate of a curve is their mean.

    Parameters
    ----------
    curve : IntensityCurve
    hazard : Hazard
    above : float
        Without noise: intensity above which events count.
    """
    if curve.jumps.size:
        rates = signs_of(curve.jumps) * hazard(np.maximum(curve.jumps, above))
        return np.nansum(rates, axis=-1).mean(axis=-1)
    y, share = shares_of_rate(np.ones_like, hazard, edges_of_rules(curve, hazard))
    return np.array([share @ curve.along(row, np.exp(y)) for row in curve.shares])


def rate_capacities(curve: IntensityCurve, hazard: Hazard) -> Capacities | None:
    """Return `Capacities`, of each motion the threshold at which it would have its own annual rate.

    A threshold beyond the outcomes, or where the hazard ends, is known to lie there. None where the rate is not the
    mean over several motions, fewer than two have a threshold, or a test rejects that thresholds are lognormal.
    """
    if curve.units == 1 or not (curve.jumps.size or (curve.by_points and len(curve.shares))):
        return None
    end = min(curve.reach if curve.jumps.size else curve.intensity[-1], hazard.end)
    critical = hazard.exceeded_at(motion_rates(curve, hazard))
    critical[critical >= end] = math.inf
    if np.isfinite(critical).sum() < 2:
        return None
    return curve.unless_rejected(Capacities.exact(critical, end))


def rate_replicates(curve: IntensityCurve, capacities: Capacities | None) -> Array:
    """Return the draws (b, 2) of medians and dispersions that limits of the rate are by; (0, 2) where there are none.

    Those of `rate_capacities`, or of the lognormal curve that the rate is by.
    """
    if capacities is None:
        return curve.replicates if curve.fitted else np.empty((0, 2))
    samples = DRAWS if capacities.error.any() else capacities.usual_draws
    return capacities.lognormal(capacities.draws(samples, np.random.default_rng(1))[0])


def replicate_rates(replicates: Array, curve: IntensityCurve, hazard: Hazard, last: float = math.inf) -> Array:
    """Return annual rates (b,) by `lognormal_rates` up to ln(im) `last`, of what lifts the blocks of a curve off."""
    logs, values, slopes = hazard.laws
    # Below, a hazard would exceed e^300 a year; no draw of a population reaches there that a limit is by.
    first = logs[0] - (300.0 - values[0]) / slopes[0] if slopes[0] > 0.0 else -LARGEST
    return lognormal_rates(replicates, hazard, max(first, -LARGEST, curve.log_lift_off), last)


def rate_limits(curve: IntensityCurve, hazard: Hazard, edges: Array) -> tuple[float, float]:
    """Return 95 % limits (low, high) of the rate, 1/year, of the curve's, or nan; `edges`: of `edges_of_rules`."""
    replicates = rate_replicates(curve, rate_capacities(curve, hazard))
    if len(replicates):
        low, high = np.quantile(replicate_rates(replicates, curve, hazard), [0.025, 0.975]).tolist()
        return low, high
    if curve.fitted:
        return math.nan, math.nan
    y, share = shares_of_rate(np.ones_like, hazard, edges)
    low, high = (float(share @ side) for side in curve.limits(np.exp(y)))
    return low, high


def lognormal_rates(replicates: Array, hazard: Hazard, first: float, last: float = math.inf) -> Array:
    """Return annual rates (b,) by lognormal curves, (median, dispersion) (b, 2), over ln(im) from `first` to `last`."""
    from scipy import special

    # Few motions agree with medians of 0 and inf.
    with np.errstate(divide="ignore"):
        middle = np.clip(np.log(replicates[:, :1]), -1e4, 1e4)
    spread, logs = replicates[:, 1:], hazard.laws[0]
    stop = max(first, min(last, math.log(hazard.end)))
    ends = np.concatenate([[first], logs[(logs > first) & (logs < stop)], [stop]])
    at = ends[:-1]
    k, away = hazard.laws[2][np.searchsorted(logs, at, side="right")], (ends - middle) / spread
    low, high = away[:, :-1] + k * spread, away[:, 1:] + k * spread
    # Tails are subtracted on the side where the normal distribution has its digits.
    turned = low > 0.0
    low, high = np.where(turned, -high, low), np.where(turned, -low, high)
    factor = hazard.log_rate(at) + k * (at - middle) + 0.5 * (k * spread) ** 2
    with np.errstate(over="ignore"):
        parts = np.exp(factor + special.log_ndtr(high)) - np.exp(factor + special.log_ndtr(low))
    # Up to where the hazard ends, all that is exceeded there counts.
    rates = np.exp(hazard.log_rate(ends[[0, -1]])) * [1.0, last < math.log(hazard.end)]
    left, right = (rates * special.ndtr(away[:, [0, -1]])).T
    return parts.sum(axis=1) + left - right


def contributions_by_bin(
    probability: Callable[[Array], Array], hazard: Hazard, y: Array, share: Array
) -> tuple[Array, Array]:
    """(edges, shares): edges (25,) of bins of intensity with all but a thousandth of the rate; its shares (24,)."""
    total = share.sum()
    if not total > 0.0:
        return np.exp(y[[0, -1]]), np.zeros(1)
    part = np.cumsum(share) / total
    low, high = y[np.searchsorted(part, [5e-4, 1.0 - 5e-4])].tolist()
    # All of it may come from the end of the hazard; a bin of 1 % is as good as another.
    low = low if low < high else high - 0.24
    edges = np.linspace(low, high, 25)
    kinks = hazard.laws[0]
    parts = np.unique(np.concatenate([edges, kinks[(kinks > low) & (kinks < high)]]))
    nodes, weights = gauss_nodes(parts)
    rates = (weights * rate_density(probability, hazard, nodes)).reshape(-1, 12).sum(axis=1)
    shares = np.bincount(np.searchsorted(edges, parts[:-1], side="right") - 1, rates, 24)
    shares[-1] += share[-1] if high == y[-1] else 0.0
    return np.exp(edges), shares / total


def share_beyond(y: Array, share: Array, points: Sequence[float] | Array) -> float:
    """Return the part (float) of the rate from outside the intensities from `points[0]` to `points[-1]`."""
    outside = (y < math.log(points[0])) | (y > math.log(points[-1]))
    total = share.sum()
    return float(share[outside].sum() / total) if total > 0.0 else 0.0
