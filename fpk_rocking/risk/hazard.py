"""Seismic hazard: how often a year an intensity is exceeded, and integrals of a fragility over it.

The integrals, for `rate`, are annual rates, their limits, and what parts of them come from which intensities.
"""

import dataclasses
import itertools
import math
import re
from collections.abc import Callable, Sequence
from typing import Self

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array, File, Number
from fpk_rocking.risk.population import IntensityCurve


@dataclasses.dataclass(frozen=True, eq=False)
class Hazard:
    """Annual rate at which the ground motion exceeds an intensity, a power law between points and beyond the last ones.

    Parameters
    ----------
    intensity : array_like, shape (n,)
        Intensities in the unit of the curve they are used with (g or m/s), ascending, above 0, at least two.
    rate : array_like, shape (n,)
        Annual rate of exceedance at each, 1/year, above 0, descending.
    source : str
        Where it is from, such as the name of a file.

    Raises
    ------
    TypeError, ValueError
        The numbers are not such.

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

    def __post_init__(self):
        for name in ("intensity", "rate"):
            accepted = "2 to 10,000 finite numbers above 0"
            values = np.array(checks.sequence(f"hazard.{name}", getattr(self, name), accepted), float)
            if not 2 <= values.size <= 10_000 or not np.all((values > 0.0) & np.isfinite(values)):
                raise ValueError(checks.refusal(f"hazard.{name}", getattr(self, name), accepted))
            object.__setattr__(self, name, values)
        if self.intensity.size != self.rate.size:
            raise ValueError(
                checks.refusal("hazard.rate", f"{self.rate.size} rates", f"{self.intensity.size}, one each")
            )
        for name, sign in (("intensity", 1.0), ("rate", -1.0)):
            steps = sign * np.diff(getattr(self, name))
            if not np.all(steps > 0.0):
                place = int(np.argmin(steps > 0.0)) + 1
                accepted = f"values that {'rise' if sign > 0.0 else 'fall'} strictly"
                raise ValueError(checks.refusal(f"hazard.{name}[{place}]", float(getattr(self, name)[place]), accepted))

    @classmethod
    def power_law(cls, rate: float, exponent: float) -> Self:
        """Return the hazard k₀ im^(-k), with points at .001 and 1,000 g or m/s.

        Parameters
        ----------
        rate : float
            k₀: the annual rate at which the intensity 1 is exceeded, above 0.
        exponent : float
            k, above 0.
        """
        rate, exponent = checks.number("rate", rate, above=0.0), checks.number("exponent", exponent, above=0.0)
        ends = np.array([1e-3, 1e3])
        return cls(ends, rate * ends**-exponent)

    @classmethod
    def from_csv(cls, path: File) -> Self:
        """Read a hazard curve from a file of two columns: intensity, and annual rate of exceedance.

        Parameters
        ----------
        path : str or pathlib.Path
            Columns parted by commas, semicolons, tabs or blanks; empty lines, lines that begin with ``#`` and one line
            of names are skipped.

        Returns
        -------
        Hazard

        Raises
        ------
        FileNotFoundError
            There is no such file.
        ValueError
            A line has not two numbers, or they are no hazard curve; the message names the file and the line.
        """
        file = checks.path("hazard", path)
        rows, begun = [], False
        for number, line in enumerate(file.read_text(encoding="utf-8-sig").splitlines(), start=1):
            if not line.strip() or line.lstrip().startswith("#"):
                continue
            try:
                first, second = map(float, re.split(r"[,;\s]+", line.strip()))
            except ValueError:
                if begun:
                    raise ValueError(
                        f"{path}, line {number}: got {line!r}, accepted: an intensity and a rate"
                    ) from None
            else:
                rows.append((first, second))
            begun = True
        if not rows:
            raise ValueError(f"{path}: got no numbers, accepted: lines of an intensity and a rate")
        try:
            intensity, rate = np.array(rows).T
            return cls(intensity, rate, file.name)
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from None

    @property
    def exponents(self) -> Array:
        """Exponents k (n - 1,) of the power laws between the points."""
        return -np.diff(np.log(self.rate)) / np.diff(np.log(self.intensity))

    @property
    def law(self) -> str:
        """Power law of a hazard of two points as a text, as in "0.001 im^-2.5"; empty for one of more points."""
        if self.intensity.size > 2:
            return ""
        exponent = float(self.exponents[0])
        return f"{self.rate[0] * self.intensity[0] ** exponent:.4g} im^-{exponent:.4g}"

    def __call__(self, intensity: Number) -> Number:
        """Return the annual rate, 1/year, at which an `intensity`, or each of an array, is exceeded."""
        logs, slopes = np.log(self.intensity), self.exponents
        y = np.log(intensity)
        place = np.clip(np.searchsorted(logs, y) - 1, 0, slopes.size - 1)
        return np.exp(np.log(self.rate)[place] - slopes[place] * (y - logs[place]))


TAIL = 12.0
"""Dispersions, and units of 1/k, over which the frequency is integrated to either side: beyond lies less than 1e-30."""


def edges_of_rules(curve: IntensityCurve, hazard: Hazard) -> Array:
    """Return edges (n + 1,) in ln(intensity) of Gauss-Legendre rules."""
    places = curve.outcomes[0]
    steep, gentle = hazard.exponents.max(), hazard.exponents.min()
    points = np.log(hazard.intensity)
    spread = curve.tail
    # The product of curve and hazard peaks k β² below the median, and falls as the normal density or as im^(-k).
    low = math.log(curve.fit.median if curve.fitted else places[0]) - steep * spread**2 - TAIL * spread
    high = TAIL * math.log(10.0) / gentle
    if curve.fitted:
        high += math.log(curve.fit.median) + TAIL * spread
    else:
        high += math.log(places[-1])
    if curve.by_points or not curve.fitted:
        points = np.concatenate([points, np.log(places)])
    width = min(0.25 * spread, 1.0 / steep)
    points = np.unique(np.concatenate([[low, high], points[(points > low) & (points < high)]]))
    parts = [
        np.linspace(a, b, max(1, math.ceil((b - a) / width)), endpoint=False) for a, b in itertools.pairwise(points)
    ]
    return np.append(np.concatenate(parts), high)


def gauss_nodes(edges: Array) -> tuple[Array, Array]:
    """Return (nodes, weights), (12 n,) each, of Gauss-Legendre rules of 12 points between `edges` (n + 1,)."""
    nodes, weights = np.polynomial.legendre.leggauss(12)
    half = 0.5 * np.diff(edges)[:, None]
    return (edges[:-1, None] + half * (1.0 + nodes)).ravel(), (half * weights).ravel()


def rate_density(probability: Callable[[Array], Array], hazard: Hazard, y: Array) -> Array:
    """Return the annual rate (n,) in a unit of y = ln(intensity), at y (n,): |dH| = k H dy, times the probability."""
    place = np.clip(np.searchsorted(np.log(hazard.intensity), y) - 1, 0, hazard.intensity.size - 2)
    return hazard.exponents[place] * hazard(np.exp(y)) * probability(np.exp(y))


def rate_limits(curve: IntensityCurve, hazard: Hazard, edges: Array) -> tuple[float, float]:
    """Return 95 % limits (low, high) of the rate, 1/year, of the curve's, or nan; `edges`: of `edges_of_rules`."""
    if curve.fitted and len(curve.replicates):
        low, high = np.quantile(lognormal_rates(curve.replicates, hazard, edges[0], edges[-1]), [0.025, 0.975]).tolist()
        return low, high
    if curve.fitted:
        return math.nan, math.nan
    y, weights = gauss_nodes(edges)
    density = weights * rate_density(np.ones_like, hazard, y)
    low, high = (float(density @ side) for side in curve.limits(np.exp(y)))
    return low, high


def lognormal_rates(replicates: Array, hazard: Hazard, first: float, last: float) -> Array:
    """Return annual rates (b,) by lognormal curves, (median, dispersion) (b, 2), over ln(im) from `first` to `last`."""
    from scipy import special

    # Few motions agree with medians of 0 and inf.
    with np.errstate(divide="ignore"):
        middle = np.clip(np.log(replicates[:, :1]), -1e4, 1e4)
    spread, logs = replicates[:, 1:], np.log(hazard.intensity)
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


def contributions_by_bin(
    probability: Callable[[Array], Array], hazard: Hazard, y: Array, share: Array
) -> tuple[Array, Array]:
    """(edges, shares): edges (25,) of bins of intensity with all but a thousandth of the rate; its shares (24,)."""
    total = share.sum()
    if not total > 0.0:
        return np.exp(y[[0, -1]]), np.zeros(1)
    part = np.cumsum(share) / total
    low, high = y[np.searchsorted(part, [5e-4, 1.0 - 5e-4])].tolist()
    edges = np.linspace(low, high, 25)
    nodes, weights = gauss_nodes(edges)
    return np.exp(edges), (weights * rate_density(probability, hazard, nodes)).reshape(24, -1).sum(axis=1) / total


def share_beyond(y: Array, share: Array, points: Sequence[float] | Array) -> float:
    """Return the part (float) of the rate from outside the intensities from `points[0]` to `points[-1]`."""
    outside = (y < math.log(points[0])) | (y > math.log(points[-1]))
    total = share.sum()
    return float(share[outside].sum() / total) if total > 0.0 else 0.0
