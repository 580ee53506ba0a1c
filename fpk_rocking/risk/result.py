"""The result of `study`: fragility and annual rate of a block under several motions, and the files to hand on."""

import dataclasses
import datetime as dt
import functools
import importlib.metadata
import json
import math
import pathlib
import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from fpk_rocking.base.checks import Array, File
from fpk_rocking.results.pictures import figure_of
from fpk_rocking.results.result import Result
from fpk_rocking.results.storage import plain, write_json, write_text
from fpk_rocking.results.trust import CAUTION, Diagnostic
from fpk_rocking.risk.critical import CriticalIntensities, critical_text, factor_diagnostics
from fpk_rocking.risk.curves import Fragility
from fpk_rocking.risk.drawing import Draws
from fpk_rocking.risk.export import NAMES, not_for_pelicun, to_nrml, to_pelicun
from fpk_rocking.risk.lognormal import ranked
from fpk_rocking.risk.motions import intensity_of, motion_lines, motion_table
from fpk_rocking.risk.outcomes import FARTHEST, overturns
from fpk_rocking.risk.population import IntensityCurve
from fpk_rocking.risk.rate import Risk, annual_frequency, rate_text
from fpk_rocking.scene.scene import Scene

MOVED = 0.01
"""With noise intensities are added until they move the rate by less than this part."""
MANY = 30
"""Motions from which on the scatter between them is known to about an eighth of it (1/√(2 · 30))."""


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Study(Result):
    """Fragility and annual rate of a block under several motions, as `study` returns them.

    Parameters
    ----------
    fragility : Fragility
        Of each record at each intensity.
    curve : IntensityCurve
        For a motion drawn from the population of these.
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
        Of these scenes; None with noise.
    added : int
        Number of intensities that were added where the rate comes from; 0 without noise.
    moved : float
        Part of the rate by which the last of them moved it.
    uncorrected : IntensityCurve or None
        Curve of the motions without baseline correction, where there was one, and neither noise nor a drawn block.

    Examples
    --------
    >>> from fpk_rocking import Scene
    >>> from fpk_rocking.risk import Hazard, study
    >>> from fpk_rocking.risk import synthetic_records
    >>> rack = Scene.from_block(0.5, 1.8, "0.3 g", "1.5 Hz",
    ...                         noise_rms_acceleration=0.3, noise_band_hz=(0, 8))
    >>> motions, hazard = synthetic_records(5, duration=5.0), Hazard.power_law(rate=1e-3, exponent=2.5)
    >>> racks = study(rack, motions, hazard, [0.3, 0.6, 1.2], realizations=20)
    >>> print(racks.records.shape, racks.trust.verdict)
    (5, 17) caution
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

    row_dims = ("motion",)

    @property
    def title(self) -> str:
        """The rate with its limits, or without a hazard what the curve is of, as a line of text."""
        return self.curve.title if self.risk is None else self.risk.title

    @property
    def motions(self) -> list[Scene]:
        """The scene of each record at the intensity 1, or the one scene; of drawn blocks the first."""
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

        A rate does not depend on the lognormal fit where that is rejected, nor on the error of one probability.
        """
        if self.risk is None:
            return [*self.curve.diagnostics, *self.model_diagnostics()]
        return [*self.curve.model, *self.risk.diagnostics, *self.model_diagnostics()]

    def model_diagnostics(self) -> list[Diagnostic]:
        """Return a list of `Diagnostic`: what speaks against the motions and the intensities.

        That there is one motion, that some are equal or scaled far, or that the rate still moves with more intensities.
        """
        against, count, motions = [], self.curve.records, [scene.forcing for scene in self.motions]
        if count == 1:
            sentence = "One motion: the scatter from motion to motion is neither in the rate nor in its limits."
            against.append(Diagnostic(CAUTION, sentence, "one record"))
        same = len(motions) - len(dict.fromkeys(motions))
        if same:
            sentence = f"{same} of {len(motions)} motions are the same as another one."
            against.append(Diagnostic(CAUTION, sentence, "equal records"))
        always = None if self.critical is None else self.critical.always / self.critical.own
        against += factor_diagnostics(self.factors, always)
        if MOVED < self.moved < math.inf:
            sentence = (
                f"The rate still moved by {100.0 * self.moved:.2g} % with the last of {self.added} intensities that "
                "were added to those asked for: give more realizations, or more intensities where the rate comes from."
            )
            against.append(Diagnostic(CAUTION, sentence, "intensities"))
        return against

    @property
    def remarks(self) -> tuple[str, ...]:
        """Sentences on noise, baselines and the number of motions, and what the correction of the baselines changes."""
        few = f"{self.curve.records} motions are few: 30 are needed to rely on the scatter between them."
        remarks = [self.about_correction, few * (1 < self.curve.records < MANY), self._standing()]
        return (*self.curve.remarks, *filter(None, remarks))

    def _standing(self):
        """Return the names of the motions under which the block stands at the end of the search; empty for none."""
        suite = self.critical
        if suite is None or np.isfinite(suite.always).all():
            return ""
        names = ", ".join(name for name, always in zip(suite.names, suite.always, strict=True) if math.isinf(always))
        end = f"at {FARTHEST:,.0f} times the acceleration that lifts it off, where the search ends"
        return f"The block stands {end}, under {names}. For the limits, such a motion overturns it above that."

    @property
    def about_correction(self) -> str:
        """What the correction of the baselines changes of probabilities and rate, a sentence; empty without one."""
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
        return f"{text}, and the annual rate would be {rate_text(rate)}{ratio}; the limits do not contain this."

    def text(self) -> str:
        """Return rate, verdict, fit, remarks, and deviances by measure as lines of one text."""
        curve, fit = self.curve, self.curve.fit
        lines = [
            self.risk.sentences[0] if self.risk else f"{self.title}. No annual rate, as there is no hazard (--hazard).",
            str(self.trust),
        ]
        points = "In its place stand the points, joined by lines"
        if curve.jumps.size and self.risk:
            points = "The rate is by the intensities at which each motion overturns the block"
        if fit.reason:
            lines.append(f"No lognormal fit: {fit.reason}. {points}.")
        else:
            low, high = fit.median_interval
            text = f"Lognormal: median {curve.measure} {fit.median:.4g} {curve.unit} [{low:.4g}, {high:.4g}], "
            text += f"dispersion {fit.dispersion:.3g}" + f", of which {curve.parts}" * bool(curve.parts)
            misfit = "largest distance of the curve from the mean over the motions"
            misfit += f"{', at any intensity,' * bool(curve.jumps.size)} {fit.misfit:.2g}"
            if fit.rejected:
                misfit += f": the fit is rejected ({fit.rejected}). {points}"
            elif math.isfinite(fit.p_value):
                misfit += f"; a test does not reject the lognormal form (p = {fit.p_value:.2g})"
            lines.append(f"{text}; {misfit}.")
        if self.added and self.moved <= MOVED:
            moved = f"the last of them moved the rate by {100.0 * self.moved:.2g} %"
            lines.append(f"{self.added} intensities were added where the rate comes from; {moved}.")
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

    def _ordered(self):
        """Return the deviances of intensity measures as a sentence in a list, empty for one motion."""
        rankings = ranked(self.fragility)
        if self.curve.records == 1 or len(rankings) < 2:
            return []
        texts = (f"{ranking.measure} {ranking.deviance:.4g}" for ranking in rankings)
        text = (
            "Deviance (-2 ln of the likelihood) of a lognormal curve over each intensity measure, the lower the better"
        )
        return [f"{text}: {'; '.join(texts)}."]

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
            "ranking": [ranking._asdict() for ranking in ranked(self.fragility)],
            "draws": self.draws and {"origin": self.draws.origin, "values": self.draws.values},
            "motions": self.table(),
            "added_intensities": self.added,
            "rate_moved": self.moved,
            "fragility": self.fragility.summary(),
        }
        return plain(parts | {"trust": self.trust.plain, "remarks": self.remarks})

    def plot(self) -> Any:
        """Draw the curve with its records, and the contributions to the rate; returns a matplotlib figure."""
        from fpk_rocking.risk.picture import draw_curve
        from fpk_rocking.risk.report import draw_contributions

        panels = [lambda _, axes: draw_curve(axes, self.curve, self.records)]
        risk = self.risk
        panels += [] if risk is None else [lambda _, axes: draw_contributions(axes, risk)]
        return figure_of(*panels)

    @property
    def not_for_pelicun(self) -> str:
        """Why pelicun could not take the curve, as a text; empty where it can."""
        return not_for_pelicun(self.curve)

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
        about = self.curve.describe()
        if self.risk:
            about += f" Annual rate by the curve of this file {rate_text(self.risk.exported_rate)}, "
            about += f"as the study states it {rate_text(self.risk.rate)}."
        to_nrml(out / f"{self.name}.xml", [self.curve], self.name, about, self.trust)
        refused = self.not_for_pelicun
        if not refused:
            to_pelicun(out / f"{self.name}.csv", self.curve, self.name, about, self.trust)
        exports = [f"{self.name}.{kind}" for kind in ("xml", *(() if refused else ("csv", "json")))]
        files = {"pelicun": refused or f"{self.name}.csv", "exports": exports, "origin": self.origin(command)}
        write_json(out / "risk.json", self.summary() | files)
        write_text(out / "risk.txt", f"{self.text()}\n{self.origin(command)}\n")
        risk_figure(out / "risk.png", self)
        write_risk_report(out / "report.html", self, command)


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
