"""`study`: records at equal intensities, their curve, and the annual rate under a hazard."""

import dataclasses
import datetime as dt
import functools
import importlib.metadata
import json
import math
import pathlib
import re
import warnings
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from typing import Any

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array, ArrayLike, File, Progress, not_none
from fpk_rocking.physics.forcing import Forcing, Record
from fpk_rocking.physics.noise.kinds import NoNoise
from fpk_rocking.results.pictures import figure_of
from fpk_rocking.results.result import Result
from fpk_rocking.results.storage import plain, write_json, write_text
from fpk_rocking.results.trust import CAUTION, UNUSABLE, Diagnostic, Trust
from fpk_rocking.risk.anchor import hold, lift_off_g
from fpk_rocking.risk.critical import CriticalIntensities, critical_intensities, critical_text, factor_diagnostics
from fpk_rocking.risk.curves import Fragility, fragility
from fpk_rocking.risk.export import (
    NAMES,
    check_name,
    levels_text,
    not_for_openquake,
    not_for_pelicun,
    rising,
    to_nrml,
    write_pelicun,
)
from fpk_rocking.risk.floors import Building, FloorMotion
from fpk_rocking.risk.hazard import Hazard
from fpk_rocking.risk.inputs import Draws, drawn
from fpk_rocking.risk.motions import (
    FLOOR,
    at_intensity,
    intensity_of,
    measure_of,
    motion_lines,
    motion_names,
    motion_table,
    recorded_scenes,
    same_event,
    unused_forcing_text,
)
from fpk_rocking.risk.population import IntensityCurve
from fpk_rocking.risk.rate import Risk, annual_frequency, rate_text, years_text
from fpk_rocking.risk.search import FARTHEST, overturns
from fpk_rocking.scene.ranges import implausible_sizes
from fpk_rocking.scene.scene import Scene
from fpk_rocking.scene.units import STANDARD_GRAVITY
from fpk_rocking.studies.execution import seed_of

MOVED = 0.01
"""With noise intensities are added until they move the rate by less than this part."""


MANY = 30
"""Motions from which on the scatter between them is known to about an eighth of it (1/√(2 · 30))."""


FEWEST_RECORDS = 5
"""Least number of motions, or of blocks under one motion, that a study accepts beside one."""


BLOCKS = 100
"""Blocks that are drawn for all motions together: a dispersion that they give has a standard error of a tenth of β."""


STEP = 1.4
"""Factor between intensities that are added above those asked for."""


MOST_FRICTION = 2.0
"""Largest coefficient of friction that a study accepts: rubber on concrete has about 1."""


CLOSEST, MOST_INTENSITIES = 0.02, 64
"""Intensities are added no closer in the logarithm than this to others, up to so many, or twice those asked for."""


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Study(Result):
    """Fragility and annual rate of a block under several motions, as `study` returns them.

    Parameters
    ----------
    fragility : Fragility
        Probabilities under each record at each intensity.
    curve : IntensityCurve
        Curve for a motion drawn from the population of the records.
    risk : Risk or None
        None without a hazard.
    name : str
        Identifier of the block in exported files.
    scene : Scene
        Block and noise as passed to `study`.
    draws : Draws or None
        Blocks that were drawn.
    recorded : list of Scene
        The block as passed to `study` under each motion, at the motion's own scale.
    critical : CriticalIntensities or None
        Critical intensities of `recorded`; None with noise.
    added : int
        Number of intensities that were added where most of the rate arises; 0 without noise.
    moved : float
        Relative change of the rate by the last of them.
    uncorrected : IntensityCurve or None
        Curve without the baseline correction; None without a correction, with noise, or with drawn blocks.
    events : sequence
        A label for each of `recorded`; motions of one label count as one.
    asked : ndarray, shape (a,)
        Intensities that were asked for; if there are none, with a mass those of the curve, else (0,).
    mass : float or None
        Mass of the block, kg.
    friction : float or None
        Coefficient of friction below the block.
    about_forcing : str
        Sentence that the records replace the forcing of `scene`; empty if it has none of its own.
    """

    fragility: Fragility
    curve: IntensityCurve
    risk: Risk | None
    name: str
    scene: Scene
    draws: Draws | None = None
    recorded: Sequence[Scene] = ()
    critical: CriticalIntensities | None = None
    added: int = 0
    moved: float = 0.0
    uncorrected: IntensityCurve | None = None
    events: Sequence[Any] = ()
    asked: Array = dataclasses.field(default_factory=lambda: np.empty(0))
    mass: float | None = None
    friction: float | None = None
    about_forcing: str = ""

    row_dims = ("motion",)

    @property
    def title(self) -> str:
        """The rate with its limits, or, without a hazard, the title of the curve, as a line of text."""
        return self.curve.title if self.risk is None else self.risk.title

    @property
    def motions(self) -> list[Scene]:
        """The scene of each record at the intensity 1 (with its first block, if drawn), or the one scene."""
        scenes = self.fragility.scenes
        if self.draws is None:
            return list(scenes)
        return [scenes[self.draws.origin.index(record)] for record in sorted(set(self.draws.origin))]

    @property
    def records(self) -> Array:
        """Probability of overturning by each record, (r, n), at the intensities of the curve, over its blocks."""
        shares = self.fragility.overturned
        shares = shares[:, np.isfinite(shares).all(axis=0)]
        if self.draws is None:
            return shares
        origin = np.array(self.draws.origin)
        return np.array([shares[origin == record].mean(axis=0) for record in np.unique(origin)])

    @property
    def factors(self) -> Array:
        """Factor (r,) of its own strength at which each motion overturns the block, or half of paths; inf for none."""
        if self.critical is not None:
            return self.critical.factor
        own = np.array([intensity_of(scene, self.curve.measure) for scene in self.recorded])
        overturns = self.records >= 0.5
        first = np.where(overturns.any(axis=1), self.curve.intensity[overturns.argmax(axis=1)], math.inf)
        return first / own

    @property
    def diagnostics(self) -> list[Diagnostic]:
        """A list of `Diagnostic`: of scenes, engine, records, and the error of the rate, or without a hazard the curve.

        A rate does not depend on the error of one probability.
        """
        if self.risk is None:
            return [*self.curve.diagnostics, *self.model_diagnostics()]
        return [*self.curve.model, *self.risk.diagnostics, *self.model_diagnostics()]

    def model_diagnostics(self) -> list[Diagnostic]:
        """Return a list of `Diagnostic` that speak against the motions and the intensities.

        There is one motion, some are equal or scaled far, the rate still changes with more intensities, or the block
        slides before it rocks.
        """
        against, count, motions = [], self.curve.records, [scene.forcing for scene in self.motions]
        least = not_none(self.scene.block.least_friction)
        if self.friction is not None and self.friction < least:
            sentence = (
                f"With a coefficient of friction of {self.friction:g}, below {least:.3g}, the block slides before it "
            )
            against.append(Diagnostic(UNUSABLE, f"{sentence}rocks. The answer is for one that rocks.", "friction"))
        elif self.friction is not None and (body := self.scene.block.body):
            farther = max(body.left, body.right) / body.height_of_centre
            if self.friction < farther:
                sentence = f"With a coefficient of friction of {self.friction:g}, below {farther:.3g}, the block "
                sentence += "slides before it rocks on its farther corner. The answer is for one that rocks on both."
                against.append(Diagnostic(CAUTION, sentence, "friction"))
        if count == 1:
            sentence = "One motion: the scatter from motion to motion is neither in the rate nor in its limits."
            if self.curve.units == 1 and len(self.curve.jumps):
                sentence = "One motion gives no limits: how much another one would differ is not known."
            against.append(Diagnostic(CAUTION, sentence, "one record"))
        same = len(motions) - len(dict.fromkeys(motions))
        if same:
            equal = "motions are each equal" if same > 1 else "motions is equal"
            sentence = f"{same} of {len(motions)} {equal} to another one, and they count as one."
            against.append(Diagnostic(CAUTION, sentence, "equal records"))
        always = None if self.critical is None else self.critical.always / self.critical.own
        against += factor_diagnostics(self.factors, always)
        if MOVED < self.moved < math.inf:
            sentence = (
                f"The rate still changed by {100.0 * self.moved:.2g} % with the last of {self.added} intensities that "
                "were added to those asked for: give more realizations, or intensities where most of the rate arises."
            )
            against.append(Diagnostic(CAUTION, sentence, "intensities"))
        return against

    @property
    def remarks(self) -> tuple[str, ...]:
        """Sentences on noise, baselines, number of motions, a replaced forcing, and the effect of the correction."""
        count = self.curve.records
        what = "events" if 1 < count < len(self.recorded) else "motions"
        few = f"{count} {what} are few: 30 are needed to rely on the scatter between them." * (1 < count < MANY)
        remarks = [self.about_forcing, *self.about_motions, self.about_correction, few, self._standing()]
        return (*self.curve.remarks, *filter(None, remarks))

    @property
    def about_motions(self) -> list[str]:
        """Sentences on floors, vertical motions, and several motions of one event, for each where there are any."""
        count, of = self.curve.records, len(self.recorded)
        upward = "The vertical motions act, too, and are scaled with the horizontal ones." * self._lifted
        grouped = f"{of} motions are of {count} events; those of one event count as one motion." * (1 < count < of)
        return [text for text in (self._floor(), upward, grouped) if text]

    def _floor(self):
        """Return what moves the block and what the intensities are of, for floors, a sentence; else an empty text."""
        floors = [scene.forcing for scene in self.recorded if isinstance(scene.forcing, FloorMotion)]
        if not floors:
            return ""
        building = floors[0].building
        made = f"computed from those of the ground (one mode, {building})" if building else "recorded"
        of = "its own" if self.curve.measure in FLOOR else "the ground's, and floor and ground are scaled together"
        return f"The block stands on an upper floor, whose motions are {made}; intensities are {of}."

    @property
    def _lifted(self):
        """Whether the base moves vertically in any motion."""
        return any(shaken.forcing.vertical is not None for shaken in self.recorded)

    def _standing(self):
        """Return the names of the motions under which the block stands at the end of the search; empty for none."""
        suite = self.critical
        if suite is None or np.isfinite(suite.always).all():
            return ""
        names = ", ".join(name for name, always in zip(suite.names, suite.always, strict=True) if math.isinf(always))
        end = f"at {FARTHEST:,.0f} times the acceleration that lifts it off, where the search ends"
        return f"The block still stands {end}, under {names}. The limits count these motions as overturning above that."

    @property
    def about_correction(self) -> str:
        """Sentence: how the correction of the baselines changes probabilities and rate; empty without a correction."""
        if not corrected(self.recorded):
            return ""
        if self.uncorrected is None:
            return 'baseline = "none" (--baseline none) gives the result without the correction of the baselines.'
        both = self.curve.jumps, self.uncorrected.jumps
        places = np.unique(np.concatenate([self.curve.intensity, *(jumps[np.isfinite(jumps)] for jumps in both)]))
        shares = (overturns(np.concatenate(list(jumps)), places).mean(axis=0) for jumps in both)
        change = np.abs(np.subtract(*shares))
        place = int(change.argmax())
        intensity = f"{self.curve.measure} {places[place]:.3g} {self.curve.unit}"
        text = f"Without the correction of the baselines P({self.curve.name}) would differ by up to "
        text += f"{change[place]:.2g} (at {intensity})"
        if self.risk is None:
            return f"{text}."
        rate = annual_frequency(self.uncorrected, self.risk.hazard).rate
        ratio = f", {rate / self.risk.rate:.3g} times this one" if self.risk.rate > 0.0 else ""
        text += f", and the annual rate would be {rate_text(rate)}{ratio}"
        return f"{text}; the limits do not contain this difference."

    @property
    def at_asked(self) -> dict[str, Array]:
        """Columns (n,) at the intensities that were asked for: intensity, probability with its own limits, and the tie.

        "exported" is the probability by the curve that files for other programs carry. "peak_g" is the largest peak
        acceleration of the motions there, "top" and "edge" are the forces that hold the block under it
        (`fpk_rocking.risk.anchor`), in units of its weight: of the block as passed, without noise.
        """
        curve, at = self.curve, [int(np.abs(self.curve.intensity - value).argmin()) for value in self.asked]
        peak = STANDARD_GRAVITY * max(intensity_of(scene, "PFA") for scene in self.motions) * curve.intensity[at]
        ties = np.array([hold(self.scene.block, value) for value in peak]).reshape(-1, 2)
        names = *curve.row_dims, "probability", "low", "high", "exported", "peak_g", "top", "edge"
        values = [curve.intensity[at], curve.probability[at], *curve.point_limits[at].T, curve(curve.intensity[at])]
        values += [peak / STANDARD_GRAVITY, *ties.T]
        return dict(zip(names, values, strict=True))

    @property
    def tie(self) -> tuple[str, str]:
        """Where the two forces of `at_asked` act, as texts."""
        return "horizontal at the " + ("top" if self.scene.block.body is None else "centre of mass"), "down at one edge"

    def force_text(self, weights: float) -> str:
        """Return a force as a text: in N where the mass of the block is known.

        Parameters
        ----------
        weights : float
            In units of its weight.
        """
        if self.mass is None or not weights:
            return f"{weights:.2g} of its weight" if weights else "none"
        return f"{years_text(weights * self.mass * not_none(self.scene.block.size).gravity, 3)} N"

    @property
    def block_sentences(self) -> list[str]:
        """Sentences on lift-off and sliding, and on ties if there are intensities that were asked for."""
        level, friction = lift_off_g(self.scene.block), self.scene.block.least_friction
        text = f"The block lifts off at {level:.3g} g{self._lift_off_on_ground(level)}. "
        text += f"With a coefficient of friction below {friction:.3g} it slides "
        tied = "Forces of ties are static, at the largest peak acceleration of the motions, and hold for rigid ties. "
        tied += "If a tie stretches or has slack, the block begins to rock, and the force may be larger."
        text += "before it rocks; rocking needs somewhat more friction."
        if self.friction is not None and self.friction >= not_none(friction):
            text += f" With {self.friction:g} it lifts off; montecarlo.contact_forces tells whether it slides then."
        text += " These values, and forces of ties, do not include the vertical motions." * self._lifted
        return [text, *[tied] * bool(self.asked.size)]

    def _lift_off_on_ground(self, level):
        """Return the intensities at which motions of a floor reach a `level` (g) there, as a text; or an empty one."""
        floors = [scene for scene in self.recorded if isinstance(scene.forcing, FloorMotion)]
        measure = self.curve.measure
        if not floors or measure in FLOOR:
            return ""
        least = [level * intensity_of(scene, measure) / intensity_of(scene, "PFA") for scene in floors]
        places = " to ".join(dict.fromkeys([f"{min(least):.3g}", f"{max(least):.3g}"]))
        return f" on the floor, reached at {measure} {places} {self.curve.unit}".rstrip() + " on the ground"

    @property
    def block_lines(self) -> list[str]:
        """`block_sentences`, and of each intensity that was asked for the probability with its limits, and the tie."""
        curve, lines = self.curve, self.block_sentences
        for value, share, low, high, exported, peak, *forces in zip(*self.at_asked.values(), strict=True):
            limits = f"95 %: {low:.2g} to {high:.2g}" if math.isfinite(low) else "one motion, no limits"
            limits += f"; by the lognormal curve of files {exported:.3g}" * curve.fitted
            text = f"At {curve.measure} {value:.4g} {curve.unit}: P({curve.name}) {share:.3g} ({limits}); "
            text += f"peak acceleration up to {peak:.3g} g, "
            (top, edge), (where, down) = map(self.force_text, forces), self.tie
            held = f"a tie of {top} {where}, or of {edge} {down}, holds it" if forces[0] else "it does not lift off"
            lines.append(f"{text}{held}.")
        return lines

    def text(self) -> str:
        """Return rate, verdict, fit, remarks, and rank correlations of measures as lines of one text."""
        curve, fit = self.curve, self.curve.fit
        lines = [
            self.risk.sentences[0] if self.risk else f"{self.title}. No annual rate, as there is no hazard (--hazard).",
            str(self.trust),
            *self.block_lines,
        ]
        points = "The points, joined by lines, are used instead"
        if curve.jumps.size and self.risk:
            points = "The rate follows from the intensities at which each motion overturns the block"
        if fit.reason:
            lines.append(f"No lognormal fit: {fit.reason}. {points}.")
        else:
            low, high = fit.median_interval
            text = f"Lognormal: median {curve.measure} {fit.median:.4g} {curve.unit} [{low:.4g}, {high:.4g}], "
            text += f"dispersion {fit.dispersion:.3g}" + f", of which {curve.parts}" * bool(curve.parts)
            at = "all intensities" if curve.jumps.size else "these intensities"
            misfit = f"curve and mean of the motions differ by {fit.misfit:.2g} at most, over {at}"
            if fit.rejected:
                misfit += f": the fit is rejected ({fit.rejected}). {points}"
            elif math.isfinite(fit.p_value):
                misfit += f"; a test does not reject the lognormal form (p = {fit.p_value:.2g})"
            lines.append(f"{text}; {misfit}.")
        if self.added and self.moved <= MOVED:
            moved = f"the last of them changed the rate by {100.0 * self.moved:.2g} %"
            lines.append(f"{self.added} intensities were added where most of the rate arises; {moved}.")
        lines += [text for text in self.remarks if text not in self.trust.reasons]
        lines += self._ordered()
        lines += filter(None, [self.about_critical])
        return "\n".join([*lines, *motion_lines(self.table(), curve.measure)])

    @property
    def about_critical(self) -> str:
        """What the critical intensities of the table are, as sentences; empty with noise."""
        if self.critical is None:
            return ""
        certain = "The table of the motions is of the block without its uncertain values. " * (self.draws is not None)
        return certain + critical_text(self.curve.measure)

    @functools.cached_property
    def rank_correlation(self) -> dict[str, float]:
        """Spearman's rank correlation of intensity measures with `factors`, the best (-1) first; {} for few motions."""
        from scipy import stats

        forcings, factors = [scene.forcing for scene in self.recorded], self.factors
        if len(forcings) < FEWEST_RECORDS or np.ptp(np.minimum(factors, 1e300)) == 0.0:
            return {}
        names = ["PGA", "PGV", "PFA", "PFV"][: 4 if any(isinstance(motion, FloorMotion) for motion in forcings) else 2]
        names += ["Sa(0.3)", "Sa(1.0)", "Sa(3.0)"] * all(isinstance(motion, Record) for motion in forcings)
        found = {
            name: float(stats.spearmanr([intensity_of(scene, name) for scene in self.recorded], factors).statistic)
            for name in dict.fromkeys([*names, self.curve.measure])
        }
        return dict(sorted(found.items(), key=lambda item: item[1]))

    def _ordered(self):
        """Return the rank correlations as a sentence in a list, empty for few motions."""
        text = "Rank correlation with the factor at which a motion overturns the block (-1: the measure decides): "
        ranks = "; ".join(f"{name} {value:.2f}" for name, value in self.rank_correlation.items())
        return [f"{text}{ranks}."] * bool(ranks)

    @functools.cached_property
    def _columns(self):
        """Columns of the table by name: name, PGA, PGV, those of `critical`, and the PGV before it was corrected."""
        columns = self.critical.table() if self.critical else motion_table(self.recorded)
        if corrected(self.recorded):
            columns["pgv_as_recorded_m_per_s"] = np.array([_recorded_pgv(scene.forcing) for scene in self.recorded])
        return columns

    def places(self) -> dict[str, Any]:
        """Names of the motions, and the intensities of the curve."""
        return {"motion": self._columns["motion"].tolist()} | self.curve.places()

    def derived(self) -> dict[str, Any]:
        """Columns of each motion; beside the table the curve, and the probability of each motion over the intensity."""
        columns = {name: ("motion", values) for name, values in self._columns.items() if name != "motion"}
        by_motion = {"probability_of_motion": (("motion", *self.curve.row_dims), self.records)}
        return columns | by_motion | self.curve.variables

    def summary(self) -> dict[str, Any]:
        """Return a dict for JSON: "risk", "curve", "fragility" and other parts as plain values, "trust", "remarks"."""
        parts = {
            "risk": self.risk and self.risk.summary(),
            "curve": self.curve.summary(),
            "rank_correlation": self.rank_correlation,
            "draws": self.draws and {"origin": self.draws.origin, "values": self.draws.values},
            "motions": self.table(),
            "asked": self.at_asked,
            "lift_off_g": lift_off_g(self.scene.block),
            "least_friction": self.scene.block.least_friction,
            "added_intensities": self.added,
            "rate_moved": self.moved,
            "fragility": self.fragility.summary(),
        }
        return plain(parts | {"trust": self.trust.plain, "remarks": self.remarks})

    def plot(self) -> Any:
        """Draw the curve with its records, and the contributions to the rate; returns a matplotlib figure."""
        from fpk_rocking.risk.picture import draw_contributions, draw_curve

        panels = [lambda _, axes: draw_curve(axes, self.curve, self.records)]
        risk = self.risk
        panels += [] if risk is None else [lambda _, axes: draw_contributions(axes, risk)]
        return figure_of(*panels)

    @property
    def not_for_openquake(self) -> str:
        """Why OpenQuake has no hazard for the curve, as a text; empty if it has one."""
        return not_for_openquake(self.curve)

    @property
    def not_for_pelicun(self) -> str:
        """Why pelicun could not take the curve, as a text; empty where it can."""
        return not_for_pelicun(self.curve)

    def _about_curve(self):
        """Return what the curve in files is, and which rates it has, as sentences."""
        about = " ".join([self.curve.describe(), *self.about_motions])
        if not self.risk:
            return about
        text = f"{about} Annual rate: {rate_text(self.risk.exported_rate)} by the curve of this file, "
        return text + f"{rate_text(self.risk.rate)} by the study."

    def for_pelicun(self) -> dict[str, tuple[IntensityCurve, str, Trust | None]]:
        """Return curve, description and verdict by the name of the block, as `write_pelicun` takes them."""
        about = self._about_curve()
        if self.risk and not self.curve.fitted and (np.diff(self.curve.probability) < 0.0).any():
            rate = annual_frequency(rising(self.curve), self.risk.hazard).exported_rate
            about += f" Its points fall in places. Those for pelicun do not, and give the rate {rate_text(rate)}."
        return {self.name: (self.curve, about, self.trust)}

    def origin(self, command: str = "") -> str:
        """Return date, version, hazard and the command that made a study, as a line of text.

        Parameters
        ----------
        command : str
            As it was typed; empty of a study in Python.
        """
        version, today = importlib.metadata.version("fpk-rocking"), dt.datetime.now(dt.UTC).date()
        text = f"Made on {today} by fpk-rocking {version}"
        source = self.risk.hazard.source if self.risk else ""
        text += f" with the hazard of {source}" * bool(source)
        return f"{text}{f': {command}' if command else '.'}"

    def write(self, folder: File, command: str = "") -> None:
        """Write report.html, risk.png, risk.txt, risk.json, result.npz, curve.csv, motions.csv, NAME.xml, .csv, .json.

        Parameters
        ----------
        folder : str or pathlib.Path
            Created if missing. motions.csv is the `table`. NAME.xml is OpenQuake's NRML, NAME.csv and NAME.json are
            pelicun's; pelicun's files are left out where it could not take the curve: `not_for_pelicun` says why, and
            so does risk.json. Files for other programs that an earlier call left there, which risk.json lists, are
            removed.
        command : str
            Command that made the study, for report.html, risk.txt and risk.json.
        """
        from fpk_rocking.risk.report import risk_figure, write_risk_report

        out = pathlib.Path(folder)
        _remove_exports(out)
        self.fragility.save(out / "result.npz")
        self.curve.to_csv(out / "curve.csv")
        self.to_csv(out / "motions.csv")
        about = self._about_curve()
        levels = f"{about} {levels_text(self.risk)}" if self.risk and self.risk.exported_rate > 0.0 else about
        unknown = self.not_for_openquake
        if not unknown:
            to_nrml(out / f"{self.name}.xml", [self.curve], self.name, levels, self.trust)
        refused = self.not_for_pelicun
        if not refused:
            write_pelicun(out / f"{self.name}.csv", self.for_pelicun())
        exports = [f"{self.name}.{kind}" for kind in (*["xml"] * (not unknown), *["csv", "json"] * (not refused))]
        files: dict[str, Any] = {"openquake": unknown or f"{self.name}.xml", "pelicun": refused or f"{self.name}.csv"}
        files |= {"exports": exports, "origin": self.origin(command)}
        write_json(out / "risk.json", self.summary() | files)
        write_text(out / "risk.txt", f"{self.text()}\n{self.origin(command)}\n")
        risk_figure(out / "risk.png", self)
        write_risk_report(out / "report.html", self, command)


def study(
    scene: Scene,
    records: Sequence[Forcing | File],
    hazard: Hazard | File | None,
    intensities: ArrayLike | None = None,
    *,
    measure: str = "PGV",
    ground: Sequence[Record | File] = (),
    building: Building | None = None,
    units: str | None = None,
    interval: float | None = None,
    component: str | int | None = None,
    baseline: str | None = None,
    corner_hz: float | None = None,
    vertical: Sequence[Record | File] = (),
    realizations: int = 10_000,
    seed: int = 1,
    scale_noise: bool = True,
    uncertain: Mapping[str, Any] | None = None,
    events: Sequence[Any] | None = None,
    blocks: int | None = None,
    mass: float | None = None,
    friction: float | None = None,
    name: str = "rocking_block",
    workers: int | Executor = 1,
    store: File | None = None,
    progress: Progress | None = None,
) -> Study:
    """Compute the fragility of a block under recorded motions, and the annual frequency at which it overturns.

    Each record is scaled to each intensity; the probability of overturning is the mean over the records and the noise.

    Parameters
    ----------
    scene : Scene
        Block with dimensions, and noise of the shaking; its forcing is replaced by each record.
    records : sequence of Record, str or pathlib.Path
        One, or at least five; files are read by `Record.from_file`. With none the forcing of the scene is taken.
    hazard : Hazard, str or pathlib.Path, or None
        In the unit of the measure, or a file that `Hazard.from_csv` reads; with None there is no rate.
    intensities : array_like, optional
        Points of the curve, in the unit of the measure. By default twelve. The first is half of the lowest intensity at
        which a motion overturns the block without noise. From the last on all motions overturn it, except those that
        never do. With noise and a hazard others are added until they change the rate by less than 1 %. Without noise
        rate and limits do not depend on them.
    measure : str
        As for `fpk_rocking.risk.at_intensity`, that of the hazard.
    ground : sequence of Record, str or pathlib.Path
        For records of an upper floor: the ground motion of each, in this order. The intensity is that of the ground
        motion, and both are scaled together.
    building : Building, optional
        For records of the ground and a block on a floor of this building.
    units, interval, component : optional
        Unit of the records, time between samples, seconds, and name or number of the component, where their files leave
        them open: see `Record.from_file`.
    baseline : {"none", "mean", "linear", "high-pass"}, optional
        Correction of the records' baselines, see `Record`; by default that of each `Record`, and none for files.
    corner_hz : float, optional
        Corner of the correction "high-pass", Hz.
    vertical : sequence of Record, str or pathlib.Path, optional
        The vertical motion of each of the records, in the same order: it changes the weight, and is scaled with them.
    realizations : int
        Number of paths for each record at each intensity.
    seed : int
        Seed of the random numbers.
    scale_noise : bool
        Whether the noise is scaled with the records.
    uncertain : dict of str, optional
        Distributions of values of the block, see `fpk_rocking.risk.inputs.drawn`.
    events : sequence, optional
        A label for each record. Records of one label, as the components of one event, count as one motion, with
        the mean of their probabilities. By default two whose files state the same event and station have one label.
    blocks : int
        Number of blocks drawn for each record, at least five for one record; by default a hundred in all.
    mass : float, optional
        Mass of the block, kg. Forces that hold it are then in N. If `intensities` are not given, these forces are
        stated only with a mass, at the intensities of the curve.
    friction : float, optional
        Coefficient of friction below the block, up to 2. The verdict is "do not use" if it slides before it rocks.
    name : str
        Identifier of the block in exported files.
    workers, store, progress
        As for `fpk_rocking.studies.sweep`. Each scene of it is here one motion at one intensity.

    Returns
    -------
    Study
        With `curve`, `risk` (the annual rate) and `fragility` of each motion.

    Raises
    ------
    TypeError, ValueError, OSError
        A parameter or a file is refused, before anything is computed.

    Examples
    --------
    >>> from fpk_rocking import Scene
    >>> from fpk_rocking.risk import Hazard, study
    >>> from fpk_rocking.risk import synthetic_records
    >>> rack = Scene.from_block(0.5, 1.8, "0.3 g", "1.5 Hz",
    ...                         noise_rms_acceleration=0.3, noise_band_hz=(0, 8))
    >>> motions, hazard = synthetic_records(5, duration=5.0), Hazard.power_law(rate=1e-3, exponent=2.5)
    >>> racks = study(rack, motions, hazard, [0.3, 0.6, 1.2], realizations=20)
    >>> print(f"{racks.risk.rate:.0e} per year, {racks.added} intensities added")
    2e-03 per year, 14 intensities added
    """
    _check_scene(scene)
    check_name(name)
    mass, friction = _mass_and_friction(mass, friction)
    measure = measure_of(measure).name
    if intensities is not None:
        listed = intensities.tolist() if isinstance(intensities, np.ndarray) else intensities
        intensities = sorted(checks.several("intensities", listed, most=10_000, above=0.0))
    exceeded = hazard if isinstance(hazard, Hazard) or hazard is None else Hazard.from_csv(hazard)
    if exceeded is not None:
        exceeded.check_measure(measure)
    reading: dict[str, Any] = {"units": units, "interval": interval, "component": component}
    reading |= {"ground": ground, "building": building, "vertical": vertical}
    scenes = recorded_scenes(scene, records, **reading, baseline=baseline, corner_hz=corner_hz)
    events = _labels(events, scenes)
    blocks = _blocks_of_a_motion(blocks, uncertain, len(scenes))
    at_one = [at_intensity(shaken, measure, noise=scale_noise) for shaken in scenes]
    draws = drawn(at_one, uncertain, blocks, seed) if uncertain else None
    at_one = at_one if draws is None else list(draws.scenes)
    options: dict[str, Any] = {"realizations": realizations, "scale_noise": scale_noise, "workers": workers}
    options |= {"measure": measure}
    deterministic = all(shaken.deterministic for shaken in scenes)
    uncorrected_too = deterministic and draws is None and corrected(scenes)
    report = _RoundsReport(progress, 1 + uncorrected_too)

    def sample(scale, number, scenes=at_one):
        own = {"seed": seed_of(seed, 2**32 + number) if number else seed, "store": _store_of(store, number)}
        report.begin_round()
        return fragility(scenes if len(scenes) > 1 else scenes[0], scale=scale, progress=report, **options, **own)

    def risk_of(curves):
        curve = IntensityCurve.of(curves, measure, draws=draws, events=events, samples=1)
        return annual_frequency(dataclasses.replace(curve, by_points=True), not_none(exceeded))

    asked = None if intensities is None else np.array(intensities)
    if deterministic:
        curves, added, moved = sample(np.ones(1) if asked is None else asked, 0), 0, 0.0
        if asked is None:
            asked = _range(not_none(curves.critical))
            curves = curves.at_scales(asked)
    else:
        calm = None if asked is not None and exceeded is None else _without_noise(scenes, measure, workers)
        asked = _range(not_none(calm)) if asked is None else asked
        if exceeded is None:
            curves, added, moved = sample(asked, 0), 0, 0.0
        else:
            curves, added, moved = with_added_intensities(sample, risk_of, asked, _above(asked[-1], not_none(calm)))
    curve, uncorrected = IntensityCurve.of(curves, measure, draws=draws, events=events), None
    curve = dataclasses.replace(curve, by_points=exceeded is not None and curves.motions is None)
    if uncorrected_too:
        raw = recorded_scenes(scene, records, **reading, baseline="none")
        raw = [at_intensity(shaken, measure, noise=scale_noise) for shaken in raw]
        uncorrected = IntensityCurve.of(sample(curves.scale, -1, raw), measure, events=events, samples=1)
    return Study(
        fragility=curves,
        curve=curve,
        risk=None if exceeded is None else annual_frequency(curve, exceeded),
        name=name,
        scene=scene,
        draws=draws,
        recorded=scenes,
        critical=_critical(scenes, measure, curves, draws),
        added=added,
        moved=moved,
        uncorrected=uncorrected,
        events=events,
        asked=np.empty(0) if intensities is None and mass is None else asked,
        mass=mass,
        friction=friction,
        about_forcing=unused_forcing_text(scene, records, scenes),
    )


def _check_scene(scene):
    """Raise TypeError for what is no `Scene`, and warn of sizes that were hardly meant."""
    for sentence in implausible_sizes(checks.instance("scene", scene, Scene).block):
        # The search for intensities may take minutes, and end without any.
        warnings.warn(sentence, stacklevel=3)


def _blocks_of_a_motion(blocks, uncertain, motions):
    """Return the number of blocks that are drawn for each of some number of motions, after a check."""
    if blocks is None:
        return -(-BLOCKS // motions)
    if not uncertain:
        raise ValueError(checks.refusal("blocks", blocks, "nothing without uncertain values, as no block is drawn"))
    count = checks.count("blocks", blocks)
    if motions == 1 and count < FEWEST_RECORDS:
        raise ValueError(checks.refusal("blocks", blocks, f"at least {FEWEST_RECORDS} for one motion"))
    return count


def _mass_and_friction(mass, friction):
    """Return mass and friction after a check: floats above 0, or None."""
    mass = None if mass is None else checks.number("mass", mass, above=0.0)
    return mass, None if friction is None else checks.number("friction", friction, above=0.0, at_most=MOST_FRICTION)


def _labels(events, scenes):
    """Return a list of labels, one for the event of each of some scenes; ValueError where there are too few events."""
    if events is not None and len(events) != len(scenes):
        raise ValueError(checks.refusal("events", f"{len(events)} labels", f"{len(scenes)}, one for each record"))
    labels = same_event(scenes) if events is None else list(events)
    count = len(set(labels))
    if len(scenes) > 1 and count < FEWEST_RECORDS:
        got = f"{len(scenes)} of {count} events" if count < len(scenes) else count
        accepted = f"1, or at least {FEWEST_RECORDS} of different events"
        if events is None and count < len(scenes):
            names = zip(motion_names(scenes), labels, strict=True)
            same = ", ".join([name for name, label in names if labels.count(label) > 1][:FEWEST_RECORDS])
            accepted += f"; {same} have the samples, or the event and station, of another one"
        raise ValueError(f"records: got {got}, accepted: {accepted}")
    return labels


class _RoundsReport:
    """A `progress` function for rounds of work, which counts the parts of all of them, of at least `rounds`."""

    def __init__(self, progress, rounds):
        self.progress, self.rounds, self.finished, self.parts = progress, rounds, 0, 0

    def begin_round(self):
        """Count the parts of the round before as finished."""
        self.finished, self.parts = self.finished + self.parts, 0

    def __call__(self, done, total):
        """Report `done` of the `total` parts of a round, after those that are finished."""
        self.parts = total
        if self.progress:
            self.progress(self.finished + done, max(self.finished + total, self.rounds * total))


def _without_noise(scenes, measure, workers):
    """Return the `CriticalIntensities` of scenes (a list) without their noise."""
    calm = [
        dataclasses.replace(shaken, noise=NoNoise(), start=dataclasses.replace(shaken.start, covariance=None))
        for shaken in scenes
    ]
    return critical_intensities(calm, measure=measure, workers=workers)


def _range(critical):
    """Return twelve intensities from where no motion overturns a block to where all do that ever overturn it for good.

    By its `CriticalIntensities`.
    """
    if math.isinf(critical.critical.min()):
        accepted = "a list of them, as no motion overturns the block without noise"
        accepted = "; ".join([accepted, *implausible_sizes(critical.scenes[0].block)])
        raise ValueError(checks.refusal("intensities", None, accepted))
    return np.geomspace(0.5 * np.nanmin(critical.jumps), 1.01 * np.nanmax(critical.jumps), 12)


def _above(highest, critical):
    """Return intensities (k,) above the highest one asked for, up to where each motion overturns without noise."""
    top = critical.equivalent[np.isfinite(critical.equivalent)].max(initial=highest)
    return highest * STEP ** np.arange(1.0, math.ceil(math.log(top / highest) / math.log(STEP)) + 1.0)


def _store_of(store, number):
    """Return the path of the file that keeps the rows of the round of a `number`: `store` for 0, others beside it."""
    if store is None or not number:
        return store
    path = checks.path("store", store)
    return path.with_name(f"{path.stem}-{number + 1}{path.suffix}")


def _critical(scenes, measure, curves, draws):
    """Return the `CriticalIntensities` of a block under motions, the `scenes`, at their own scales; None with noise."""
    if curves.motions is None or draws is not None:
        return None if curves.motions is None else critical_intensities(scenes, measure=measure)
    # Up to an intensity this low nothing is searched for: what each motion does at its own scale is left.
    own = critical_intensities(scenes, measure=measure, highest=1e-12)
    return dataclasses.replace(own, highest=math.inf, jumps=curves.motions.jumps[:, 0].copy())


def with_added_intensities(
    sample: Callable[[Array, int], Fragility],
    risk_of: Callable[[Fragility], Risk],
    asked: Array,
    above: Sequence[float] = (),
) -> tuple[Fragility, int, float]:
    """Add intensities where the rate comes from, until a round of them moves it by less than `MOVED`."""
    curves, rounds = sample(asked, 0), 0
    if len(above):
        curves, rounds = _joined(curves, sample(np.asarray(above), 1)), 1
    risk, moved = risk_of(curves), math.inf
    while risk.rate > 0.0 and moved > MOVED and curves.scale.size < max(MOST_INTENSITIES, 2 * asked.size):
        more, rounds = _more_intensities(risk), rounds + 1
        if not more.size:
            return curves, curves.scale.size - asked.size, 0.0
        curves, before = _joined(curves, sample(more, rounds)), risk.rate
        risk = risk_of(curves)
        moved = abs(risk.rate / before - 1.0)
    return curves, curves.scale.size - asked.size, moved


def _more_intensities(risk):
    """Intensities (n,), ascending, amid those intervals of the curve of a `Risk` where the rate is least known."""
    y, shares = np.log(risk.curve.intensity), np.maximum.accumulate(risk.curve.probability)
    step = max(float(np.diff(y).max(initial=0.0)), CLOSEST)
    y, shares = np.append(y[0] - 2.0 * step, y), np.append(0.0, shares)
    doubt = -0.5 * np.diff(shares) * np.diff(risk.hazard(np.exp(y)))
    doubt[np.diff(y) < 2.0 * CLOSEST] = 0.0
    order = np.argsort(-doubt, kind="stable")
    chosen = order[: np.searchsorted(np.cumsum(doubt[order]), 0.8 * doubt.sum()) + 1]
    chosen = chosen[doubt[chosen] > 1e-3 * risk.rate]
    return np.sort(np.exp(0.5 * (y[1:] + y[:-1])[chosen]))


def _joined(first, second):
    """Return a `Fragility` with the scales of two, `first` and `second`, of the same scenes, in ascending order."""
    scale = np.concatenate([first.scale, second.scale])
    order = np.argsort(scale)
    place = np.argsort(order)
    reasons = {
        ",".join([*key.split(",")[:2], str(place[int(key.split(",")[2]) + begin])]): reason
        for part, begin in ((first, 0), (second, first.scale.size))
        for key, reason in part.reasons.items()
    }
    parts = {
        name: np.concatenate([getattr(first, name), getattr(second, name)], axis=-1)[..., order]
        for name in ("scale", "probability", "error_estimate")
    }
    return dataclasses.replace(first, **parts, reasons=reasons, wall_s=first.wall_s + second.wall_s)


def _remove_exports(folder):
    """Remove the files for other programs that an earlier study has left in a `folder` (path), by its risk.json."""
    try:
        left = json.loads((folder / "risk.json").read_text(encoding="utf-8"))["exports"]
    except (OSError, ValueError, KeyError, TypeError):
        return
    for name in left if isinstance(left, list) else ():
        stem, _, kind = str(name).partition(".")
        if kind in {"xml", "csv", "json"} and re.fullmatch(NAMES, stem):
            (folder / name).unlink(missing_ok=True)


def corrected(scenes: Sequence[Scene]) -> bool:
    """Whether the baseline of the motion of any scene is corrected (bool)."""
    return any(getattr(scene.forcing, "baseline", "none") != "none" for scene in scenes)


def _recorded_pgv(forcing):
    """Return the PGV (m/s, float) of a `forcing` before its baseline was corrected; nan of one that is no record."""
    correction = getattr(forcing, "correction", None)
    return math.nan if correction is None else forcing.scale * correction.pgv
