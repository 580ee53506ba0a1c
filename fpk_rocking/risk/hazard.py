"""Seismic hazard: how often a year an intensity is exceeded."""

import dataclasses
import re
from typing import Self

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array, File, Number


@dataclasses.dataclass(frozen=True, eq=False)
class Hazard:
    """Annual rate at which the ground motion exceeds an intensity, a power law between points and beyond the last ones.

    Parameters
    ----------
    intensity : array_like, shape (n,)
        Intensities in the unit of the curve they are used with (g or m/s), ascending, above 0, at least two.
    rate : array_like, shape (n,)
        Annual rate of exceedance at each, 1/year, above 0, descending.

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

        Returns
        -------
        Hazard
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
            Columns parted by commas, semicolons, tabs or blanks. Empty lines, lines that begin with ``#`` and one line
            of names are passed over.

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
            return cls(*np.array(rows).T)
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
