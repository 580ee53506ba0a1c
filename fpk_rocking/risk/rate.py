"""The annual frequency of a limit state under a hazard.

Which curve makes the rate, its limits, and what files for other programs carry (`Risk.exported_rate`):

| outcomes | rate | limits | files |
|---|---|---|---|
| without noise (`IntensityCurve.jumps`) | ends of all intervals of overturning | motions | as below |
| with noise, of `study` (`by_points`) | points, joined by lines in ln(im) | motions | as below |
| other curves with a lognormal fit | lognormal | lognormal | lognormal |
| other curves without one, or rejected | points | points | points |

"Motions": the rate is the mean of the rates under each motion alone, and the limits are of that mean. A motion counts
as if it had one threshold, which gives its own rate, and these thresholds as lognormal (`rate_capacities`); limits by a
bootstrap over the motions would hold in .74 of lognormal suites of 5, .86 of 30. If a test rejects that, or fewer than
two motions have a threshold, the limits are those of the points. "Lognormal" is a fit that the data do not reject
(`IntensityCurve.fitted`), and files carry it.
"""

import dataclasses
import functools
import itertools
import math
from typing import Any

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.results.pictures import figure_of
from fpk_rocking.results.result import Result
from fpk_rocking.results.trust import CAUTION, UNUSABLE, Diagnostic
from fpk_rocking.risk.capacities import Capacities
from fpk_rocking.risk.hazard import (
    LARGEST,
    Hazard,
    contributions_by_bin,
    edges_of_rules,
    lognormal_rates,
    motion_rates,
    rate_capacities,
    rate_limits,
    rate_replicates,
    replicate_rates,
    share_beyond,
    shares_of_rate,
)
from fpk_rocking.risk.hazard_files import units_of
from fpk_rocking.risk.population import IntensityCurve
from fpk_rocking.risk.search import signs_of

_FEW, _MOST = 0.05, 0.5
"""Parts of a rate that are told, and from which on it is not to be used, where they come from an extrapolation."""

_DIFFERENT = 0.1
"""Part of a rate above which there is caution where that of the exported curve differs."""


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Risk(Result):
    """Annual frequency of a limit state.

    Parameters
    ----------
    rate : float
        λ = ∫ P(im) |dH(im)|, 1/year.
    interval : tuple of (float, float)
        95 % limits, which contain the rate; the hazard is taken as exact. nan for one block under one motion without
        noise, for which there are none.
    edges : ndarray, shape (b + 1,)
        Edges of the bins of intensity of `contribution`.
    contribution : ndarray, shape (b,)
        Share of λ between two edges (disaggregation); a thousandth lies outside.
    beyond_hazard : float
        Share of λ from intensities outside the points of the hazard.
    beyond_curve : float
        Share of λ from intensities outside those of the fragility; 0 without noise.
    below_curve : float
        Share of λ from intensities below those of the fragility; 0 without noise.
    curve : IntensityCurve
    hazard : Hazard
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

    row_dims = ("bin",)

    @property
    def return_period(self) -> float:
        """Mean time between two events, 1/λ, years; inf where there is none."""
        return 1.0 / self.rate if self.rate > 0.0 else math.inf

    @functools.cached_property
    def exported_rate(self) -> float:
        """Annual rate, 1/year, by the curve in exported files: lognormal if the fit stands, else points and lines."""
        edges = edges_of_rules(self.curve, self.hazard)
        if self.curve.fitted:
            curve = np.array([[self.curve.fit.median, self.curve.fit.dispersion]])
            return float(lognormal_rates(curve, self.hazard, edges[0])[0])
        return float(shares_of_rate(_by_points(self.curve), self.hazard, edges)[1].sum())

    def probability(self, years: float = 50.0) -> float:
        """Return the probability of at least one event in a time, 1 - exp(-λt), the events being independent.

        Parameters
        ----------
        years : float
            At least 0.
        """
        return -math.expm1(-self.rate * checks.number("years", years, at_least=0.0))

    def model_diagnostics(self) -> list[Diagnostic]:
        """Return a list of `Diagnostic`: large shares of the rate from beyond the points of hazard or fragility.

        Above .05 there is caution if the rate depends on them. Above .5 the rate is mostly extrapolated and not
        to be used: for the hazard, if `by_other_slopes` differ by more than a factor of 7, or another unit of its
        intensities would fit. A rejected fit, and another rate by the curve in files, are cautions, too.
        """
        against, share = list(self.curve.fit_diagnostics), self.beyond_hazard
        parts = "{:.0f} % of the rate comes from intensities beyond the points of "
        if share > _FEW:
            low, high = self.by_other_slopes
            text = f"{parts.format(100.0 * share)}the hazard curve, where power laws extrapolate it"
            unit = self._other_unit() if share > _MOST else ""
            # As a `rate_error` of .5, its limit.
            useless = bool(unit or (share > _MOST and high > low * math.exp(2.0 * 1.96 * 0.5)))
            slopes = f"with half and with twice their exponents there the rate is {rate_text(low)} to {rate_text(high)}"
            text = f"{unit} {text}." if unit else f"{text}; {slopes}{': give more points' * useless}."
            if useless or high > (1.0 + _FEW) * low:
                against.append(Diagnostic(UNUSABLE if useless else CAUTION, text, "the hazard curve"))
        doubt, fitted = self.beyond_curve, self.curve.fitted and not self.curve.by_points
        if not fitted:
            # Above the last probability it can rise to 1, and no further.
            last = float(self.curve.probability[-1])
            above = doubt - self.below_curve
            doubt = self.below_curve + (above * (1.0 / last - 1.0) if last > 0.0 else above)
        if doubt > _FEW:
            law = "its lognormal curve extrapolates it"
            points = f"a lognormal curve of dispersion {self.curve.tail:.2g} is used below, the last probability above"
            text = f"{parts.format(100.0 * self.beyond_curve)}the fragility, where {law if fitted else points}"
            severity = UNUSABLE if doubt > _MOST else CAUTION
            against.append(Diagnostic(severity, f"{text}: give more points.", "the fragility"))
        if self._two_rates > _DIFFERENT:
            advice = "" if self.curve.fitted else " With points at more intensities the files come closer."
            against.append(Diagnostic(CAUTION, f"{self._carried}{advice}", "exported rate"))
        return against

    @functools.cached_property
    def by_other_slopes(self) -> tuple[float, float]:
        """Least and largest rate, 1/year, if the hazard fell half or twice as steeply beyond each of its ends."""
        rates = [self.rate]
        for factors in itertools.product((0.5, 2.0), repeat=2):
            try:
                rates.append(float(_shares(self.curve, self.hazard.with_slopes(*factors))[1].sum()))
            except ValueError:
                rates.append(math.inf)  # the law below is too steep
        return min(rates), max(rates)

    def _other_unit(self):
        """Return a question, whether the hazard is in another unit, where that would fit its points; else empty."""
        if self.hazard.measure and "no unit" not in self.hazard.note:
            return ""
        low, high = self.hazard.intensity[[0, -1]].tolist()
        for unit, factor in units_of(self.curve.measure).items():
            read = Hazard(self.hazard.intensity * factor, self.hazard.rate)
            # The strongest recorded motions have less than 5 g, the fastest some 3 m/s.
            if factor < 1.0 and high * factor <= 10.0 and self._beyond(read) <= 0.5:
                return (
                    f"Are the intensities of the hazard in {unit}? They were read in {self.curve.unit}, as {low:.4g} "
                    f"to {high:.4g}; in {unit} they are {low * factor:.4g} to {high * factor:.4g} {self.curve.unit}. "
                    f"If so, write '{self.curve.measure} ({unit}),annual rate' as its first line."
                )
        return ""

    def _beyond(self, hazard):
        """Return `beyond_hazard` of another hazard; 1 of one that is refused."""
        try:
            return annual_frequency(self.curve, hazard).beyond_hazard
        except ValueError:
            return 1.0

    @property
    def rate_error(self) -> float | None:
        """Width of the 95 % limits of ln(rate) over 3.92; inf if they begin at 0, None without limits."""
        low, high = self.interval
        if math.isnan(low):
            return None
        return math.inf if low <= 0.0 else math.log(high / low) / (2.0 * 1.96)

    @property
    def sentences(self) -> list[str]:
        """Sentences: the rate, what its interval leaves out, and the messages of `model_diagnostics`."""
        sampled = " and ".join(
            ["records"] * (self.curve.records > 1)
            + ["blocks"] * bool(set(self.curve.sources) - {"noise", "intervals", "record to record"})
            + ["noise"] * (not len(self.curve.jumps))
        )
        if self.curve.jumps.size:
            through = "every intensity at which a motion overturns the block"
        elif self.curve.fitted and not self.curve.by_points:
            through = "the lognormal curve"
        else:
            through = "the points, joined by lines"
        at_once = "with all probabilities at their lower, or all at their upper limits, as there is no fit"
        by = "from the lognormal curve" if self.curve.fitted else at_once
        by = "from the rates under single motions" if self.capacities else by
        limits = f" The limits are computed {by}; they contain the uncertainty from finite samples of {sampled}."
        text = (
            f"{self.title}{self._periods}. Computed from {through}.{limits * bool(sampled)} "
            "The hazard and the model of the block are taken as known."
        )
        text += f" {self.hazard.note}" * bool(self.hazard.note)
        if 0.02 < self._two_rates <= _DIFFERENT:
            text += f" {self._carried}"
        if self.upper_from_below > 0.2:
            lowest = f"{self.curve.measure} {np.nanmin(self.curve.jumps):.3g} {self.curve.unit}"
            text += f" {100.0 * self.upper_from_below:.0f} % of the upper limit of the rate comes from below {lowest}, "
            text += "where no motion overturns the block and the curve is an extrapolation. This intensity is exceeded "
            text += f"{rate_text(float(self.hazard(np.nanmin(self.curve.jumps))))} times a year."
        if not self.curve.jumps.size:
            text += f" Intensities below those of the fragility give {100.0 * self.below_curve:.2g} % of the rate."
        return [text, *(diagnostic.message for diagnostic in self.model_diagnostics())]

    @functools.cached_property
    def capacities(self) -> Capacities | None:
        """`Capacities` from which the limits follow: thresholds that give the rates under single motions; or None."""
        return rate_capacities(self.curve, self.hazard)

    @property
    def _two_rates(self):
        """Part (float) by which the rate of the exported curve differs."""
        return abs(self.exported_rate / self.rate - 1.0) if self.rate > 0.0 else 0.0

    @property
    def _carried(self):
        """What files for other programs carry, and its rate, a sentence."""
        carried = "the lognormal curve" if self.curve.fitted else "the points of the curve"
        return f"Files for OpenQuake and pelicun carry {carried}, by which the rate is {rate_text(self.exported_rate)}."

    @functools.cached_property
    def upper_from_below(self) -> float:
        """Share of the upper limit from intensities at which no motion overturns the block; 0 with noise, or no fit."""
        curve, replicates = self.curve, rate_replicates(self.curve, self.capacities)
        if not (len(replicates) and np.isfinite(curve.jumps).any()):
            return 0.0
        rates = replicate_rates(replicates, curve, self.hazard)
        low, high = np.quantile(rates, [0.965, 0.985])
        near = (rates >= low) & (rates <= high)
        lowest = math.log(np.nanmin(curve.jumps))
        return float(replicate_rates(replicates[near], curve, self.hazard, lowest).sum() / rates[near].sum())

    @property
    def _periods(self):
        """Text of the return period and the probability in 50 years, or their limits if the rate is 0; or empty."""
        low, high = self.interval
        if self.rate > 0.0:
            years, probability = f"{years_text(self.return_period, 3)} years", f"{self.probability():.2g}"
            if low > 0.0:
                years += f" ({years_text(1.0 / high, 2)} to {years_text(1.0 / low, 2)})"
                probability += f" ({-math.expm1(-50.0 * low):.2g} to {-math.expm1(-50.0 * high):.2g})"
        elif high > 0.0:
            years = f"above {years_text(1.0 / high, 3)} years"
            probability = f"below {-math.expm1(-50.0 * high):.2g}"
        else:
            return ""
        return f": return period {years}, probability in 50 years {probability}"

    @property
    def title(self) -> str:
        """The rate with its limits, as a line of text."""
        name = "overturning" if self.curve.name == "overturned" else self.curve.name
        low, high = map(rate_text, self.interval)
        if not self.rate > 0.0 and math.isfinite(self.hazard.end):
            end = f"{self.curve.measure} {self.hazard.end:.3g} {self.curve.unit}"
            return f"annual rate of {name} = 0 (95 %: up to {high}): by the hazard nothing exceeds {end}"
        if not (self.rate > 0.0 or self.interval[1] > 0.0):
            return f"no annual rate of {name}: no motion overturned the block up to the highest intensity"
        if not self.rate > 0.0:
            return f"annual rate of {name} below {high} (95 %: none of {self.curve.units} overturned)"
        limits = f"95 %: {low} to {high}" if math.isfinite(self.interval[0]) else "no limits"
        return f"annual rate of {name} = {rate_text(self.rate)} ({limits})"

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
            "exported_rate": self.exported_rate,
        }

    def places(self) -> dict[str, Any]:
        """Numbers of the bins of intensity."""
        return {"bin": np.arange(1, self.edges.size)}

    def derived(self) -> dict[str, Any]:
        """Disaggregation: share of the rate in each bin, from the intensity "low" to "high"."""
        columns = {"low": self.edges[:-1], "high": self.edges[1:], "contribution": self.contribution}
        return {name: ("bin", values) for name, values in columns.items()}

    def plot(self) -> Any:
        """Draw the contributions to the rate, and the hazard; returns a matplotlib figure."""
        from fpk_rocking.risk.picture import draw_contributions

        return figure_of(lambda _, axes: draw_contributions(axes, self))


def annual_frequency(curve: IntensityCurve, hazard: Hazard) -> Risk:
    """Return the annual frequency of a limit state.

    Gauss-Legendre rules over the logarithm of the intensity between the points of the hazard: exact to rounding for a
    lognormal curve and a power law (λ = k₀ M^(-k) exp(k²β²/2)). For a curve that is `by_points` its points are
    used. Without noise each interval of overturning adds the difference of the hazard at its ends.

    Parameters
    ----------
    curve : IntensityCurve
    hazard : Hazard
        Hazard in the measure and the unit of the curve.

    Returns
    -------
    Risk
        `rate`, 1/year, and its 95 % limits `interval`; shares of the rate by intensity.

    Examples
    --------
    >>> from fpk_rocking import Scene
    >>> from fpk_rocking.risk import Hazard, IntensityCurve, annual_frequency, at_intensity
    >>> from fpk_rocking.risk import fragility, synthetic_records
    >>> motions = synthetic_records(5, duration=5.0)
    >>> racks = [at_intensity(Scene.from_block(0.5, 1.8, record=motion)) for motion in motions]
    >>> curve = IntensityCurve.of(fragility(racks, scale=[0.5, 1.0, 2.0]))
    >>> risk = annual_frequency(curve, Hazard.power_law(rate=1e-3, exponent=2.5))
    >>> print(f"{risk.rate:.1e} per year")
    1.9e-03 per year
    """
    checks.instance("curve", curve, IntensityCurve)
    checks.instance("hazard", hazard, Hazard).check_measure(curve.measure)
    edges_of_rule = edges_of_rules(curve, hazard)
    low, high = rate_limits(curve, hazard, edges_of_rule)
    if np.isfinite(curve.jumps).any():
        return _by_jumps(curve, hazard, (low, high))
    y, share = _shares(curve, hazard)
    rate, (edges, contribution) = float(share.sum()), contributions_by_bin(_probability(curve), hazard, y, share)
    return Risk(
        rate,
        # Limits are those of the population; the mean over these motions is a point of them.
        (min(low, rate), max(high, rate)) if curve.by_points else (low, high),
        edges,
        contribution,
        share_beyond(y, share, [hazard.intensity[0], math.inf if math.isfinite(hazard.end) else hazard.intensity[-1]]),
        share_beyond(y, share, curve.intensity),
        share_beyond(y, share, [curve.intensity[0], math.inf]),
        curve,
        hazard,
    )


def _probability(curve):
    """Return a function of intensities that gives probabilities: an `IntensityCurve`, or by its points."""
    return _by_points(curve) if curve.by_points else curve


def _by_points(curve):
    """Return a function of intensities that gives probabilities along the points of an `IntensityCurve`."""
    return functools.partial(curve.along, curve.probability)


def _shares(curve, hazard):
    """Return (y, share), (n,) each: ln(intensity), and the part of the rate that comes from there."""
    if np.isfinite(curve.jumps).any():
        jumps = curve.jumps.reshape(-1, curve.jumps.shape[-1])
        return np.log(jumps).ravel(), np.nan_to_num(signs_of(jumps) * hazard(jumps)).ravel() / len(jumps)
    return shares_of_rate(_probability(curve), hazard, edges_of_rules(curve, hazard))


def _by_jumps(curve, hazard, limits):
    """Return the `Risk` of motions without noise, from the intensities at which their outcomes change."""

    def above(intensity):
        return motion_rates(curve, hazard, intensity).mean()

    rate, lowest = float(above(0.0)), np.nanmin(curve.jumps)
    # Limits are those of the population; the mean over these motions is a point of them.
    limits = (math.nan, math.nan) if curve.units == 1 else (min(limits[0], rate), max(limits[1], rate))
    ends = []
    for part in (1.0 - 5e-4, 5e-4):
        left, right = math.log(lowest), min(hazard.last_log(math.log(lowest)), LARGEST)
        for _ in range(60):  # halvings to rounding
            middle = 0.5 * (left + right)
            left, right = (middle, right) if above(math.exp(middle)) > part * rate else (left, middle)
        ends.append(right)
    edges = np.exp(np.linspace(ends[0], ends[1], 25))
    share = np.array([above(edge) for edge in edges]) / (rate or 1.0)
    first, last = (above(point) / (rate or 1.0) for point in hazard.intensity[[0, -1]])
    return Risk(rate, limits, edges, -np.diff(share), (rate > 0.0) - first + last, 0.0, 0.0, curve, hazard)


def years_text(years: float, digits: int) -> str:
    """Return a number of years as a text of so many significant digits, as "4,980"."""
    rounded = float(f"{years:.{digits}g}")
    return f"{rounded:,.0f}" if 10.0 <= rounded < 1e7 else f"{rounded:g}"


def rate_text(rate: float) -> str:
    """Return a rate as a text of three digits, as "1.23e-4"; "-" of nan."""
    return "-" if math.isnan(rate) else f"{rate:.2e}".replace("e-0", "e-").replace("e+00", "")


def number_text(value: float) -> str:
    """Return a number as a text of up to four digits, below .001 as rates are, as "1.23e-4"; empty of nan and inf."""
    if not math.isfinite(value):
        return ""
    if value == 0.0 or abs(value) >= 1e-3:
        return f"{value:.4g}"
    digits, power = f"{value:.3e}".split("e")
    return f"{float(digits):g}e{int(power)}"
