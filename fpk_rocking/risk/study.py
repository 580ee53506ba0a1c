"""A study of risk: records at equal intensities, their curve, the hazard, and the files to hand on."""

import dataclasses
import json
import math
import pathlib
import re
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from typing import Any

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.files import plain, write_json, write_text
from fpk_rocking.base.types import Array, ArrayLike, File, Progress, not_none
from fpk_rocking.physics.forcing import Forcing
from fpk_rocking.results.pictures import figure_of
from fpk_rocking.results.result import Dataset, Result
from fpk_rocking.results.trust import CAUTION, Diagnostic
from fpk_rocking.risk.export import NAMES, check_name, not_for_pelicun, to_nrml, to_pelicun
from fpk_rocking.risk.hazard import Hazard
from fpk_rocking.risk.rate import Risk, annual_frequency, rate_text
from fpk_rocking.risk.refinement import MOVED, refined
from fpk_rocking.scene.scene import Scene
from fpk_rocking.studies.critical import (
    CriticalIntensities,
    critical_intensities,
    factor_diagnostics,
    motion_table,
)
from fpk_rocking.studies.curves import fragility
from fpk_rocking.studies.drawing import Draws, drawn
from fpk_rocking.studies.execution import seed_of
from fpk_rocking.studies.lognormal import ranked
from fpk_rocking.studies.motions import at_intensity, motion_lines, recorded_scenes
from fpk_rocking.studies.pooled import IntensityCurve
from fpk_rocking.studies.result import Fragility

FEWEST_RECORDS = 5
"""Least number of motions, or of blocks under one motion, that a study accepts beside one."""

BLOCKS = 100
"""Blocks that are drawn for all motions together: a dispersion that they give has a standard error of a tenth of β."""


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
        Number of intensities that were added to those asked for, where the rate comes from; 0 without noise.
    moved : float
        Part of the rate by which the last of them moved it.
    uncorrected : IntensityCurve or None
        The curve of the motions as recorded, where baselines were corrected and there is neither noise nor a drawn
        block: it then costs no more than the curve itself.

    Examples
    --------
    >>> from fpk_rocking import Scene
    >>> from fpk_rocking.risk import Hazard, study
    >>> from fpk_rocking.studies import synthetic_records
    >>> rack = Scene.from_block(0.5, 1.8, "0.3 g", "1.5 Hz",
    ...                         noise_rms_acceleration=0.3, noise_band_hz=(0, 8))
    >>> motions, hazard = synthetic_records(5, duration=5.0), Hazard.power_law(rate=1e-3, exponent=2.5)
    >>> racks = study(rack, motions, hazard, [0.3, 0.6, 1.2], realizations=20)
    >>> print(racks.records.shape, racks.trust.verdict)
    (5, 13) caution
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
    def diagnostics(self) -> list[Diagnostic]:
        """What speaks against scenes, engine and records, and the error of the rate, or without a hazard of the curve.

        A rate does not depend on the lognormal fit where that is rejected, nor on the error of one probability.
        """
        if self.risk is None:
            return [*self.curve.diagnostics, *self.model_diagnostics()]
        return [*self.curve.model, *self.risk.diagnostics, *self.model_diagnostics()]

    def model_diagnostics(self) -> list[Diagnostic]:
        """Return what speaks against the motions and the intensities.

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
        against += [] if self.critical is None else factor_diagnostics(self.critical.factor)
        if MOVED < self.moved < math.inf:
            sentence = (
                f"The rate still moved by {100.0 * self.moved:.2g} % with the last of {self.added} intensities that "
                "were added to those asked for: give more realizations, or more intensities where the rate comes from."
            )
            against.append(Diagnostic(CAUTION, sentence, "intensities"))
        return against

    @property
    def remarks(self) -> tuple[str, ...]:
        """Remarks on noise and baselines, and what the correction of the baselines changes."""
        return (*self.curve.remarks, *filter(None, [self._of_correction()]))

    def _of_correction(self):
        """Return what the correction of the baselines changes of probabilities and rate; empty without one."""
        if not _corrected(self.recorded):
            return ""
        if self.uncorrected is None:
            return 'baseline = "none" (--baseline none) gives the result without the correction of the baselines.'
        change = np.abs(self.uncorrected.probability - self.curve.probability)
        place = int(change.argmax())
        intensity = f"{self.curve.measure} {self.curve.intensity[place]:.3g} {self.curve.unit}"
        text = f"Without the correction P({self.curve.name}) would differ by up to {change[place]:.2g} (at {intensity})"
        if self.risk is None:
            return f"{text}."
        rate = annual_frequency(self.uncorrected, self.risk.hazard).rate
        ratio = f", {rate / self.risk.rate:.3g} times this one" if self.risk.rate > 0.0 else ""
        return f"{text}, and the annual rate would be {rate_text(rate)}{ratio}."

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
            misfit = f"largest misfit of a probability {fit.misfit:.2g}"
            misfit += f": the fit is rejected ({fit.rejected}). {points}" if fit.rejected else ", the fit is accepted"
            lines.append(f"{text}; {misfit}.")
        if self.added and self.moved <= MOVED:
            moved = f"the last of them moved the rate by {100.0 * self.moved:.2g} %"
            lines.append(f"{self.added} intensities were added where the rate comes from; {moved}.")
        lines += [text for text in self.remarks if text not in self.trust.reasons]
        return "\n".join([*lines, *self._ordered(), *motion_lines(self.table(), curve.measure)])

    def _ordered(self):
        """Return the deviances of intensity measures as a sentence in a list, empty for one motion."""
        rankings = ranked(self.fragility)
        if self.curve.records == 1 or len(rankings) < 2:
            return []
        texts = (f"{ranking.measure} {ranking.deviance:.4g}" for ranking in rankings)
        return [
            f"Deviance of the outcomes from a curve over each intensity measure, least is best: {'; '.join(texts)}."
        ]

    def dataset(self) -> Dataset:
        """Return a row for each motion at its own scale: name, PGA and PGV, and without noise what `critical` says.

        Beside the table the curve, and the probability of each motion, over the intensity.
        """
        columns, curve = motion_table(self.recorded, self.critical), self.curve.dataset()
        variables = {name: ("motion", values) for name, values in columns.items() if name != "motion"}
        by_motion = {"probability_of_motion": (("motion", *curve.rows), self.records)}
        places = {"motion": columns["motion"].tolist()} | curve.coordinates
        return Dataset(variables | by_motion | curve.variables, places, ("motion",))

    def summary(self) -> dict[str, Any]:
        """Return all figures as plain values, for JSON."""
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
        from fpk_rocking.risk.report import draw_contributions
        from fpk_rocking.studies.picture import draw_curve

        panels = [lambda _, axes: draw_curve(axes, self.curve, self.records)]
        risk = self.risk
        panels += [] if risk is None else [lambda _, axes: draw_contributions(axes, risk)]
        return figure_of(*panels)

    @property
    def not_for_pelicun(self) -> str:
        """Why pelicun could not take the curve; empty where it can."""
        return not_for_pelicun(self.curve)

    def write(self, folder: File) -> None:
        """Write report.html, risk.png, risk.txt, risk.json, result.npz, curve.csv, motions.csv, NAME.xml, .csv, .json.

        Parameters
        ----------
        folder : str or pathlib.Path
            Created if missing. motions.csv is the `table`. NAME.xml is OpenQuake's NRML, NAME.csv and NAME.json are
            pelicun's; pelicun's files are left out where it could not take the curve: `not_for_pelicun` says why, and
            so does risk.json. Files for other programs that an earlier call left there, which risk.json lists, are
            removed.
        """
        from fpk_rocking.risk.report import risk_figure, write_risk_report

        out = pathlib.Path(folder)
        _remove_exports(out)
        self.fragility.save(out / "result.npz")
        self.curve.to_csv(out / "curve.csv")
        self.to_csv(out / "motions.csv")
        to_nrml(out / f"{self.name}.xml", [self.curve], self.name)
        refused = self.not_for_pelicun
        if not refused:
            to_pelicun(out / f"{self.name}.csv", self.curve, self.name)
        exports = [f"{self.name}.{kind}" for kind in ("xml", *(() if refused else ("csv", "json")))]
        write_json(out / "risk.json", self.summary() | {"pelicun": refused or f"{self.name}.csv", "exports": exports})
        write_text(out / "risk.txt", self.text() + "\n")
        risk_figure(out / "risk.png", self)
        write_risk_report(out / "report.html", self)


def _remove_exports(folder):
    """Remove the files for other programs that an earlier study has left in a folder, by its risk.json."""
    try:
        left = json.loads((folder / "risk.json").read_text(encoding="utf-8"))["exports"]
    except (OSError, ValueError, KeyError, TypeError):
        return
    for name in left if isinstance(left, list) else ():
        stem, _, kind = str(name).partition(".")
        if kind in {"xml", "csv", "json"} and re.fullmatch(NAMES, stem):
            (folder / name).unlink(missing_ok=True)


def study(
    scene: Scene,
    records: Sequence[Forcing | File],
    hazard: Hazard | File | None,
    intensities: ArrayLike,
    *,
    measure: str = "PGV",
    units: str | None = None,
    baseline: str | None = None,
    corner_hz: float | None = None,
    realizations: int = 10_000,
    seed: int = 1,
    scale_noise: bool = True,
    uncertain: Mapping[str, Any] | None = None,
    blocks: int | None = None,
    name: str = "rocking_block",
    workers: int | Executor = 1,
    store: File | None = None,
    progress: Progress | None = None,
) -> Study:
    """Compute the fragility of a block under recorded motions, and the annual frequency at which it overturns.

    Each record is scaled to each intensity; the probability of overturning is that over the records and the noise.

    Parameters
    ----------
    scene : Scene
        Block with dimensions, and noise of the shaking; its forcing is replaced by each record.
    records : sequence of Record, str or pathlib.Path
        One, or at least five; or files that `Record.from_file` reads. Where there is none the forcing of the scene is
        taken.
    hazard : Hazard, str or pathlib.Path, or None
        In the unit of the measure; or a file that `Hazard.from_csv` reads. With None there is a curve and no rate, and
        no intensities are added.
    intensities : array_like
        Intensities, ascending, in g or m/s. With noise others are added where the rate comes from, until they move it
        by less than 1 %, and the rate is by the points; without noise the rate does not depend on them, and the largest
        ends the search.
    measure : str
        "PGV" (in m/s) or "PGA" (in g).
    units : str, optional
        Unit of the records where their files do not say it.
    baseline : {"none", "mean", "linear", "high-pass"}, optional
        Correction of the records' baselines, see `Record`; by default that of each `Record`, and none of files.
    corner_hz : float, optional
        Corner of the correction "high-pass", Hz.
    realizations : int
        Paths of a record at each intensity.
    seed : int
        Seed of the random numbers.
    scale_noise : bool
        Whether the noise is scaled with the records.
    uncertain : dict of str, optional
        Distributions of values of the block, see `fpk_rocking.studies.drawing.drawn`.
    blocks : int
        Blocks that are drawn for each record, at least five for one record; by default a hundred for all together.
    name : str
        Identifier of the block in exported files.
    workers, store, progress
        As for `fpk_rocking.studies.sweep`, with a motion at an intensity for a scene.

    Returns
    -------
    Study

    Raises
    ------
    TypeError, ValueError, OSError
        A parameter or a file is refused, before anything is computed.

    Examples
    --------
    >>> from fpk_rocking import Scene
    >>> from fpk_rocking.risk import Hazard, study
    >>> from fpk_rocking.studies import synthetic_records
    >>> rack = Scene.from_block(0.5, 1.8, "0.3 g", "1.5 Hz",
    ...                         noise_rms_acceleration=0.3, noise_band_hz=(0, 8))
    >>> motions, hazard = synthetic_records(5, duration=5.0), Hazard.power_law(rate=1e-3, exponent=2.5)
    >>> racks = study(rack, motions, hazard, [0.3, 0.6, 1.2], realizations=20)
    >>> print(f"{racks.risk.rate:.0e} per year, {racks.added} intensities added")
    2e-03 per year, 10 intensities added
    """
    checks.instance("scene", scene, Scene)
    check_name(name)
    exceeded = hazard if isinstance(hazard, Hazard) or hazard is None else Hazard.from_csv(hazard)
    scenes = recorded_scenes(scene, records, units=units, baseline=baseline, corner_hz=corner_hz)
    if 1 < len(scenes) < FEWEST_RECORDS:
        raise ValueError(checks.refusal("records", len(scenes), f"1, or at least {FEWEST_RECORDS}"))
    blocks = -(-BLOCKS // len(scenes)) if blocks is None else checks.count("blocks", blocks)
    if uncertain and len(scenes) == 1 and blocks < FEWEST_RECORDS:
        raise ValueError(checks.refusal("blocks", blocks, f"at least {FEWEST_RECORDS} for one motion"))
    at_one = [at_intensity(shaken, measure, noise=scale_noise) for shaken in scenes]
    draws = drawn(at_one, uncertain, blocks, seed) if uncertain else None
    at_one = at_one if draws is None else list(draws.scenes)
    asked = np.sort(np.asarray(intensities, float))
    options: dict[str, Any] = {"realizations": realizations, "scale_noise": scale_noise, "workers": workers}

    def sample(scale, number, scenes=at_one):
        """Return the `Fragility` of a round of intensities, whose samples are independent of those of other rounds."""
        own = {"seed": seed_of(seed, 2**32 + number) if number else seed, "store": _store_of(store, number)}
        return fragility(scenes if len(scenes) > 1 else scenes[0], scale=scale, progress=progress, **options, **own)

    def risk_of(curves):
        """Return the `Risk` of a `Fragility`, without the replicates of its limits."""
        curve = IntensityCurve.of(curves, measure, draws=draws, samples=1)
        return annual_frequency(dataclasses.replace(curve, refined=True), not_none(exceeded))

    curves, added, moved = (sample(asked, 0), 0, 0.0) if exceeded is None else refined(sample, risk_of, asked)
    curve, uncorrected = IntensityCurve.of(curves, measure, draws=draws), None
    curve = dataclasses.replace(curve, refined=exceeded is not None and curves.motions is None)
    if curves.motions is not None and draws is None and _corrected(scenes):
        raw = recorded_scenes(scene, [shaken.forcing for shaken in scenes], baseline="none")
        raw = [at_intensity(shaken, measure, noise=scale_noise) for shaken in raw]
        uncorrected = IntensityCurve.of(sample(curves.scale, -1, raw), measure, samples=1)
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
    )


def _corrected(scenes):
    """Whether the baseline of the motion of any scene is corrected."""
    return any(getattr(scene.forcing, "baseline", "none") != "none" for scene in scenes)


def _store_of(store, number):
    """Return the file that keeps the rows of a round: beside that of the first one each has its own."""
    if store is None or not number:
        return store
    path = checks.path("store", store)
    return path.with_name(f"{path.stem}-{number + 1}{path.suffix}")


def _critical(scenes, measure, curves, draws):
    """Return the `CriticalIntensities` of a block under motions at their own scales; None with noise."""
    highest = float(curves.scale[-1])
    if curves.motions is None or draws is not None:
        return None if curves.motions is None else critical_intensities(scenes, measure=measure, highest=highest)
    # Up to an intensity this low nothing is searched for: what each motion does at its own scale is left.
    own = critical_intensities(scenes, measure=measure, highest=1e-9 * highest)
    return dataclasses.replace(own, highest=highest, jumps=curves.motions.jumps[:, 0].copy())
