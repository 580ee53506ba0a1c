"""Several blocks under the same motions, or both planes of one: ratios of what they withstand, and of their rates."""

import dataclasses
import functools
import math
import pathlib
from typing import Any, NamedTuple

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array, File
from fpk_rocking.results.pictures import figure_of, save
from fpk_rocking.results.result import Result
from fpk_rocking.results.storage import plain, write_json, write_text
from fpk_rocking.results.trust import Diagnostic
from fpk_rocking.risk.capacities import DRAWS, paired_draws
from fpk_rocking.risk.export import write_pelicun
from fpk_rocking.risk.hazard import replicate_rates
from fpk_rocking.risk.motions import intensity_of
from fpk_rocking.risk.population import IntensityCurve
from fpk_rocking.risk.rate import Risk, rate_text
from fpk_rocking.risk.study import Study

_NO_BOUND = (
    "Neither is a bound in three dimensions. If motion in one plane did not affect the other, the rate of overturning "
    "would be at least the larger one, and at most the sum. But both components act at once, and the block may roll on "
    "a corner and turn."
)


class Ratio(NamedTuple):
    """Capacity and annual rate of overturning of a block, divided by those of the first block.

    Parameters
    ----------
    median, median_low, median_high : float
        Ratio of the median capacities, with its 95 % limits.
    rate, rate_low, rate_high : float
        Ratio of the annual rates; nan without a hazard.
    """

    median: float
    median_low: float
    median_high: float
    rate: float
    rate_low: float
    rate_high: float


def ratio_of(first: IntensityCurve, risk: Risk | None, other: IntensityCurve, other_risk: Risk | None) -> Ratio:
    """Return the `Ratio` of two blocks under the same motions, with limits by draws of both populations together.

    Parameters
    ----------
    first, other : IntensityCurve
    risk, other_risk : Risk or None
        Of these curves.
    """
    limits, ratio = [math.nan] * 4, math.nan
    own = [
        curve.unless_rejected(curve.capacities) if curve.capacities and not curve.fit.reason else None
        for curve in (first, other)
    ]
    drawn = _drawn(*own)
    if len(drawn):
        limits[:2] = np.quantile(drawn[:, 1, 0] / drawn[:, 0, 0], [0.025, 0.975]).tolist()
    if risk and other_risk and risk.rate > 0.0:
        ratio, both = other_risk.rate / risk.rate, (risk, other_risk)
        by_fit = (capacities if of.curve.fitted else None for of, capacities in zip(both, own, strict=True))
        drawn = _drawn(*(of.capacities or fit for of, fit in zip(both, by_fit, strict=True)))
        if len(drawn):
            one, two = (replicate_rates(drawn[:, n], of.curve, of.hazard) for n, of in enumerate(both))
            low, high = np.quantile(two / one, [0.025, 0.975]).tolist()
            # As the limits of a rate, they are those of the populations; the ratio of these motions is a point.
            limits[2:] = min(low, ratio), max(high, ratio)
    return Ratio(other.fit.median / first.fit.median, limits[0], limits[1], ratio, limits[2], limits[3])


def _drawn(one, two):
    """Paired draws (b, 2, 2) of two populations of the same motions; (0, 2, 2) where there are none."""
    if one is None or two is None or not np.array_equal(one.motion, two.motion):
        return np.empty((0, 2, 2))
    return paired_draws(one, two, DRAWS, np.random.default_rng(1))


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Designs(Result):
    """Studies of several blocks under the same motions, or of both planes of one block.

    Parameters
    ----------
    studies : tuple of Study
        Of different names, and of the same measure.
    azimuths : tuple of float
        Of the planes of one block, degrees; empty for several blocks.

    Raises
    ------
    ValueError
        Names are equal, or motions, measures or hazards differ.

    Examples
    --------
    >>> from fpk_rocking import Scene
    >>> from fpk_rocking.risk import Designs, Hazard, study, synthetic_records
    >>> motions, hazard = synthetic_records(8, duration=5.0), Hazard.power_law(rate=1e-3, exponent=2.5)
    >>> racks = {f"w{w}": Scene.from_block(f"{w} cm", 1.8, record=motions[0]) for w in (50, 60)}
    >>> both = Designs(tuple(study(rack, motions, hazard, name=name) for name, rack in racks.items()))
    >>> print(f"{both.ratios[0].median:.2f} times the PGV, {both.ratios[0].rate:.2f} times the rate")
    1.36 times the PGV, 0.44 times the rate
    """

    studies: tuple[Study, ...]
    azimuths: tuple[float, ...] = ()

    row_dims = ("motion",)

    def __post_init__(self) -> None:
        names, measures = [one.name for one in self.studies], {one.curve.measure for one in self.studies}
        if len(set(names)) < len(names):
            raise ValueError(checks.refusal("studies", names, "names that differ"))
        motions = [self._motions(one) for one in self.studies]
        if len(measures) > 1 or len({one.risk is None for one in self.studies}) > 1:
            raise ValueError(
                checks.refusal("studies", sorted(measures), "one measure, and a hazard for all or for none")
            )
        if not self.azimuths and any(other != motions[0] for other in motions):
            raise ValueError(checks.refusal("studies", "different motions", "the same records in the same order"))

    @staticmethod
    def _motions(one):
        """Return what two studies of the same motions have in common: names, intensities to rounding, and events."""
        table = one.table()
        return [*table["motion"].tolist(), *np.round(np.log(table["pga_g"]), 6).tolist(), *map(str, one.events)]

    @functools.cached_property
    def ratios(self) -> list[Ratio]:
        """The `Ratio` of each block but the first to the first; limits are nan where capacities are not lognormal."""
        first, *others = [(one.curve, one.risk) for one in self.studies]
        return [ratio_of(*first, *other) for other in others]

    @property
    def equivalent(self) -> Array:
        """Equivalent intensity (m, s) of each motion for each block; with noise where half of paths overturn."""
        rows = []
        for one in self.studies:
            own = np.array([intensity_of(scene, one.curve.measure) for scene in one.recorded])
            rows.append(one.factors * own if one.critical is None else one.critical.equivalent)
        return np.stack(rows, axis=-1)

    @property
    def rate_texts(self) -> list[list[str]]:
        """Annual rate of each block with its 95 % limits, as texts; empty ones without a hazard."""
        rates = [(one.risk.rate, *one.risk.interval) if one.risk else () for one in self.studies]
        return [[rate_text(rate) for rate in row] or [""] * 3 for row in rates]

    @property
    def title(self) -> str:
        """Names of the blocks and their rates, as a line of text."""
        texts = [f"{one.name} {rate_text(one.risk.rate)}" if one.risk else one.name for one in self.studies]
        what = "annual rates of overturning" if self.studies[0].risk else "fragility"
        return f"{what}: {', '.join(texts)}"

    @property
    def diagnostics(self) -> list[Diagnostic]:
        """List of `Diagnostic` of the studies: once if it holds for all blocks, else after the name of the block."""
        messages = [{found.message for found in one.diagnostics} for one in self.studies]
        common = set.intersection(*messages)

        def named(one, found):
            own = found.message and found.message not in common
            return found._replace(message=f"{one.name}: {found.message}") if own else found

        every = [named(one, found) for one in self.studies for found in one.diagnostics]
        return list({found.message or found: found for found in every}.values())

    @property
    def sentences(self) -> list[str]:
        """Sentences: ratios of blocks, or rates in both planes, their sum, why neither is a bound; of the motions."""
        first, unit = self.studies[0], self.studies[0].curve.measure
        if self.azimuths:
            where = [f"{one.name}, {turn:g}°" for one, turn in zip(self.studies, self.azimuths, strict=True)]
            if not first.risk:
                text = f"Both planes: {'; '.join(where)}. No rates, as there is no hazard (--hazard). {_NO_BOUND}"
                return [text, *self._of_motions]
            rates = [one.risk.rate for one in self.studies if one.risk]
            text = "; ".join(f"{name}: {rate_text(rate)}" for name, rate in zip(where, rates, strict=True))
            larger = f"the larger is {rate_text(max(rates))}, the sum {rate_text(sum(rates))}"
            return [f"Annual rate in each plane: {text}; {larger}. {_NO_BOUND}", *self._of_motions]
        texts = []
        for other, ratio, row in zip(self.studies[1:], self.ratios, self._each, strict=True):
            each = row[np.isfinite(row)]
            text = f"{other.name} over {first.name}: median {unit} that overturns it {_limits(*ratio[:3])}"
            if math.isnan(ratio.median_low):
                text += " (no limits, as one of the two has no lognormal capacities)"
            text += f", for single motions {each.min():.3g} to {each.max():.3g}" * bool(each.size)
            text += f"; annual rate {_limits(*ratio[3:])}" * bool(first.risk)
            unknown = math.isnan(ratio.rate_low) and not math.isnan(ratio.rate)
            text += " (no limits, as the intensities that represent the motions' rates are not lognormal)" * unknown
            texts.append(f"{text}.")
        same = "All blocks have the same motions, and the limits of the ratios take this into account."
        return [*texts, same, *self._of_motions]

    @property
    def _of_motions(self):
        """Return what the motions are, and which forcing of a scene they replace, as sentences."""
        return [*filter(None, dict.fromkeys(one.about_forcing for one in self.studies)), *self.studies[0].about_motions]

    def text(self) -> str:
        """Return one text: `sentences` and verdict, then rate and asked intensities of each block, then each motion.

        What holds for all blocks is stated once, above them, and so are the reasons of their verdicts.
        """
        common = [line for line in self.studies[0].block_lines if all(line in one.block_lines for one in self.studies)]
        lines = [*self.sentences, str(self.trust), *common]
        for one in self.studies:
            rate, verdict = one.risk.sentences[0] if one.risk else one.title, one.trust.verdict
            trust = str(one.trust) if verdict == "ok" else f"trust: {verdict}, for reasons above"
            lines += ["", f"{one.name}: {rate}", trust, *(line for line in one.block_lines if line not in common)]
        lines += ["", self.about_motions]
        each = np.transpose(self._each) if not self.azimuths else np.empty((len(self.equivalent), 0))
        for name, row, times in zip(self.places()["motion"], self.equivalent, each, strict=True):
            ratios = f" ({', '.join(f'{ratio:.3g}' for ratio in times)} times)" * bool(times.size)
            lines.append(f"{name}: {', '.join(f'{value:.4g}' for value in row)}{ratios}")
        return "\n".join(lines)

    @property
    def about_motions(self) -> str:
        """What the intensities of the table are, a sentence."""
        curve, names = self.studies[0].curve, ", ".join(one.name for one in self.studies)
        text = (
            f"Equivalent {curve.measure}, {curve.unit}, of each motion for {names}: the one threshold above which it "
        )
        text += "would overturn the block over the same total range of the logarithm"
        return text + ("." if self.studies[0].critical else ", with noise that at which half of the paths overturn.")

    def places(self) -> dict[str, Any]:
        """Names of the motions."""
        return {"motion": self.studies[0].table()["motion"].tolist()}

    def derived(self) -> dict[str, Any]:
        """Equivalent intensity of each motion for each block and, of several blocks, its ratio to that of the first."""
        columns = {
            f"equivalent_{one.name}": column for one, column in zip(self.studies, self.equivalent.T, strict=True)
        }
        if not self.azimuths:
            columns |= {f"ratio_{one.name}": row for one, row in zip(self.studies[1:], self._each, strict=True)}
        return {name: ("motion", column) for name, column in columns.items()}

    @property
    def _each(self):
        """Ratios (s - 1, m) of equivalent intensities to those of the first block; nan where neither overturns."""
        with np.errstate(invalid="ignore"):
            return self.equivalent.T[1:] / self.equivalent[:, 0]

    def summary(self) -> dict[str, Any]:
        """Return a dict for JSON: ratios or azimuths, the summary of each study by its name, and verdict."""
        ratios = {one.name: ratio._asdict() for one, ratio in zip(self.studies[1:], self.ratios, strict=True)}
        parts = {"azimuths": self.azimuths} if self.azimuths else {"ratios": ratios, "first": self.studies[0].name}
        studies = {one.name: one.summary() for one in self.studies}
        return plain(parts | {"sentences": self.sentences, "studies": studies, "trust": self.trust.plain})

    def plot(self) -> Any:
        """Draw the curves of all blocks and, of several, the ratios of their equivalent intensities."""
        from fpk_rocking.risk.picture import draw_curves, draw_ratios

        panels = [lambda _, axes: draw_curves(axes, {one.name: one.curve for one in self.studies})]
        panels += [] if self.azimuths else [lambda _, axes: draw_ratios(axes, self)]
        return figure_of(*panels)

    def write(self, folder: File, command: str = "") -> None:
        """Write report.html, designs.png, .txt, .json and .csv, pelicun.csv and .json, and a folder for each study.

        Parameters
        ----------
        folder : str or pathlib.Path
            Created if missing. The folders have the names of the studies, see `Study.write`. pelicun's table has all
            blocks that it could take.
        command : str
            As for `Study.write`.
        """
        from fpk_rocking.risk.report import write_designs_report

        out = pathlib.Path(folder)
        for one in self.studies:
            one.write(out / one.name, command)
        self.to_csv(out / "designs.csv")
        taken = [one.for_pelicun() for one in self.studies if not one.not_for_pelicun]
        if taken:
            write_pelicun(out / "pelicun.csv", {name: item for items in taken for name, item in items.items()})
        write_json(out / "designs.json", self.summary())
        write_text(out / "designs.txt", f"{self.text()}\n{self.studies[0].origin(command)}\n")
        save(self.plot(), out / "designs.png")
        write_designs_report(out / "report.html", self, command)


def _limits(value, low, high):
    """Return a ratio with its limits, unless they are nan, as a text."""
    return f"{value:.3g} times" + f" (95 %: {low:.3g} to {high:.3g})" * math.isfinite(low)
