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
from fpk_rocking.base.files import plain, write_csv, write_json, write_text
from fpk_rocking.base.types import Array, ArrayLike, File, Progress
from fpk_rocking.physics.forcing import Forcing
from fpk_rocking.results.remarks import baseline_remark
from fpk_rocking.results.trust import CAUTION, Diagnostic, Trust, assess, verdict
from fpk_rocking.risk.export import NAMES, check_name, not_for_pelicun, to_nrml, to_pelicun
from fpk_rocking.risk.hazard import Hazard, Risk, annual_frequency
from fpk_rocking.scene.scene import Scene
from fpk_rocking.studies.critical import (
    CriticalIntensities,
    critical_intensities,
    factor_diagnostics,
    motion_table,
)
from fpk_rocking.studies.curves import fragility
from fpk_rocking.studies.diagnostics import model_diagnostics
from fpk_rocking.studies.drawing import Draws, drawn
from fpk_rocking.studies.execution import seed_of
from fpk_rocking.studies.lognormal import ranked
from fpk_rocking.studies.pooled import IntensityCurve
from fpk_rocking.studies.result import Fragility
from fpk_rocking.studies.scenes import at_intensity, motion_lines, recorded_scenes

FEWEST_RECORDS = 5
"""Least number of motions, or of blocks under one motion, that a study accepts beside one."""

BLOCKS = 100
"""Blocks that are drawn for all motions together: a dispersion that they give has a standard error of a tenth of β."""

MOVED, CLOSEST, MOST_INTENSITIES = 0.02, 0.02, 64
"""With noise intensities are added until the rate moves by less than this part, no closer in the logarithm than this to
others, up to so many, or twice those asked for."""


@dataclasses.dataclass(frozen=True, eq=False)
class Study:
    """Fragility and annual rate of a block under several motions, as `study` returns them.

    Parameters
    ----------
    fragility : Fragility
        Of each record at each intensity.
    risk : Risk
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

    Examples
    --------
    >>> from fpk_rocking import Scene
    >>> from fpk_rocking.risk import Hazard, study
    >>> from fpk_rocking.studies import synthetic_records
    >>> rack = Scene.from_block(0.5, 1.8, "0.3 g", "1.5 Hz",
    ...                         noise_rms_acceleration=0.3, noise_band_hz=(0, 8))
    >>> motions, hazard = synthetic_records(5, duration=5.0), Hazard.power_law(rate=1e-3, exponent=2.5)
    >>> found = study(rack, motions, hazard, [0.3, 0.6, 1.2], realizations=20)
    >>> print(found.records.shape, found.trust.verdict)
    (5, 13) caution
    """

    fragility: Fragility
    risk: Risk
    name: str
    scene: Scene
    draws: Draws | None = None
    recorded: Sequence[Scene] = ()
    critical: CriticalIntensities | None = None
    added: int = 0
    moved: float = 0.0

    @property
    def motion_table(self) -> dict[str, Array]:
        """Columns with a row for each motion: name, own PGA and PGV, and without noise what `critical` says."""
        return motion_table(self.recorded, self.critical)

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
    def trust(self) -> Trust:
        """Verdict on the rate: its relative standard error, and what speaks against scenes, engine, hazard, records."""
        model = model_diagnostics(self.fragility) + self.risk.diagnostics + self._of_records()
        model += [] if self.critical is None else factor_diagnostics(self.critical.factor)
        if MOVED < self.moved < math.inf:
            sentence = (
                f"The rate still moved by {100.0 * self.moved:.2g} % with the last of {self.added} intensities that "
                "were added to those asked for: give more realizations, or more intensities where the rate comes from."
            )
            model.append(Diagnostic(CAUTION, sentence, "intensities"))
        return verdict([*model, *assess({"relative_error": self.risk.relative_error})])

    def _of_records(self):
        """Return what speaks against the motions: that there is one, or that some are equal."""
        against, count, motions = [], self.risk.curve.records, [scene.forcing for scene in self.motions]
        if count == 1:
            sentence = "One motion: the scatter from motion to motion is neither in the rate nor in its limits."
            against.append(Diagnostic(CAUTION, sentence, "one record"))
        same = len(motions) - len(dict.fromkeys(motions))
        if same:
            sentence = f"{same} of {len(motions)} motions are the same as another one."
            against.append(Diagnostic(CAUTION, sentence, "equal records"))
        return against

    def text(self) -> str:
        """Return rate, verdict, fit, remarks on noise and baseline, and deviances by measure as lines of one text."""
        curve, lines = self.risk.curve, [self.risk.sentences[0], str(self.trust)]
        points = "In its place stand the points, joined by lines"
        points = (
            "The rate is by the intensities at which each motion overturns the block" if curve.jumps.size else points
        )
        fit = curve.fit
        if fit.reason:
            lines.append(f"No lognormal fit: {fit.reason}. {points}.")
        else:
            low, high = fit.median_interval
            text = (
                f"Lognormal: median {curve.measure} {fit.median:.4g} {curve.unit} [{low:.4g}, {high:.4g}], dispersion "
            )
            text += f"{fit.dispersion:.3g}"
            text += f", of which {curve.parts}" * bool(curve.parts)
            misfit = f"largest misfit of a probability {fit.misfit:.2g}"
            misfit += f": the fit is rejected ({fit.rejected}). {points}" if fit.rejected else ", the fit is accepted"
            lines.append(f"{text}; {misfit}.")
        if self.added and self.moved <= MOVED:
            moved = f"the last of them moved the rate by {100.0 * self.moved:.2g} %"
            lines.append(f"{self.added} intensities were added where the rate comes from; {moved}.")
        lines += filter(None, dict.fromkeys(scene.noise.remark for scene in self.motions))
        lines += filter(None, [baseline_remark(scene.forcing for scene in self.motions)])
        return "\n".join([*lines, *self._ordered(), *motion_lines(self.motion_table, curve.measure)])

    def _ordered(self):
        """Return the deviances of intensity measures as a sentence in a list, empty for one motion."""
        rankings = ranked(self.fragility)
        if self.risk.curve.records == 1 or len(rankings) < 2:
            return []
        texts = (f"{ranking.measure} {ranking.deviance:.4g}" for ranking in rankings)
        return [
            f"Deviance of the outcomes from a curve over each intensity measure, least is best: {'; '.join(texts)}."
        ]

    def summary(self) -> dict[str, Any]:
        """Return all figures as plain values, for JSON."""
        names = "intensity", "probability", "interval", "sources", "source_errors", "units"
        values = {
            "risk": self.risk.summary(),
            "curve": {name: getattr(self.risk.curve, name) for name in names},
            "trust": self.trust.plain,
            "ranking": [ranking._asdict() for ranking in ranked(self.fragility)],
            "draws": None if self.draws is None else {"origin": self.draws.origin, "values": self.draws.values},
            "motions": self.motion_table,
            "added_intensities": self.added,
            "rate_moved": self.moved,
            "fragility": self.fragility.summary(),
        }
        return plain(values)

    @property
    def not_for_pelicun(self) -> str:
        """Why pelicun could not take the curve; empty where it can."""
        return not_for_pelicun(self.risk.curve)

    def write(self, folder: File) -> None:
        """Write report.html, risk.png, risk.txt, risk.json, result.npz, curve.csv, motions.csv, NAME.xml, .csv, .json.

        Parameters
        ----------
        folder : str or pathlib.Path
            Created if missing. motions.csv is `motion_table`. NAME.xml is OpenQuake's NRML, NAME.csv and NAME.json are
            pelicun's; pelicun's files are left out where it could not take the curve: `not_for_pelicun` says why, and
            so does risk.json. Files for other programs that an earlier call left there, which risk.json lists, are
            removed.
        """
        from fpk_rocking.risk.report import risk_figure, write_risk_report

        out, curve = pathlib.Path(folder), self.risk.curve
        _remove_exports(out)
        self.fragility.save(out / "result.npz")
        curve.to_csv(out / "curve.csv")
        table = self.motion_table
        write_csv(out / "motions.csv", table, zip(*(column.tolist() for column in table.values()), strict=True))
        to_nrml(out / f"{self.name}.xml", [curve], self.name)
        refused = self.not_for_pelicun
        if not refused:
            to_pelicun(out / f"{self.name}.csv", curve, self.name)
        exports = [f"{self.name}.{kind}" for kind in ("xml", *(() if refused else ("csv", "json")))]
        write_json(out / "risk.json", self.summary() | {"pelicun": refused or f"{self.name}.csv", "exports": exports})
        write_text(out / "risk.txt", self.text() + "\n")
        risk_figure(out / "risk.png", self.risk, self.records)
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
    hazard: Hazard | File,
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
    """Compute the annual frequency at which a block overturns.

    Each record is scaled to each intensity; the probability of overturning is that over the records and the noise.

    Parameters
    ----------
    scene : Scene
        Block with dimensions, and noise of the shaking; its forcing is replaced by each record.
    records : sequence of Record, str or pathlib.Path
        One, or at least five; or files that `Record.from_file` reads. Where there is none the forcing of the scene is
        taken.
    hazard : Hazard, str or pathlib.Path
        In the unit of the measure; or a file that `Hazard.from_csv` reads.
    intensities : array_like
        Intensities, ascending, in g or m/s. With noise others are added where the rate comes from, until they move it
        by less than 2 %; without noise the rate does not depend on them, and the largest ends the search.
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
    >>> found = study(rack, motions, hazard, [0.3, 0.6, 1.2], realizations=20)
    >>> print(f"{found.risk.rate:.0e} per year, {found.added} intensities added")
    2e-03 per year, 10 intensities added
    """
    checks.instance("scene", scene, Scene)
    check_name(name)
    exceeded = hazard if isinstance(hazard, Hazard) else Hazard.from_csv(hazard)
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
    curves, added, moved = _refined(
        lambda scale, number: fragility(
            at_one if len(at_one) > 1 else at_one[0],
            scale=scale,
            realizations=realizations,
            # Independent of the samples of earlier rounds, in a file of their own.
            seed=seed_of(seed, 2**32 + number) if number else seed,
            scale_noise=scale_noise,
            workers=workers,
            store=_store_of(store, number),
            progress=progress,
        ),
        lambda curves: annual_frequency(IntensityCurve.of(curves, measure, draws=draws, samples=1), exceeded),
        asked,
    )
    curve = IntensityCurve.of(curves, measure, draws=draws)
    critical = _critical(scenes, measure, curves, draws)
    risk = annual_frequency(curve, exceeded)
    return Study(curves, risk, name, scene, draws, scenes, critical, added, moved)


def _store_of(store, number):
    """Return the file that keeps the rows of a round: beside that of the first one each has its own."""
    if store is None or not number:
        return store
    path = checks.path("store", store)
    return path.with_name(f"{path.stem}-{number + 1}{path.suffix}")


def _refined(sample, risk_of, asked):
    """Add intensities where the rate comes from, until a round of them moves it by less than `MOVED`.

    Parameters
    ----------
    sample : callable
        `Fragility` of intensities (n,) and the number of the round.
    risk_of : callable
        `Risk` of a `Fragility`.
    asked : ndarray, shape (n,)
        Intensities to begin with, ascending.

    Returns
    -------
    curves : Fragility
    added : int
        Number of intensities that were added; 0 without noise, where the rate does not depend on them.
    moved : float
        Part of the rate by which the last round moved it; inf where the rate is 0.
    """
    curves, rounds = sample(asked, 0), 0
    if curves.motions is not None:
        return curves, 0, 0.0
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
    """Intensities (n,) that part the intervals of a curve in which the rate is least known, four fifths of it in all.

    By how much: half the rise of the probability over an interval, times the rate at which it is met. Below the lowest
    point the probability may be that of it or 0. Intervals narrower than `CLOSEST` are not parted.
    """
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
    """Return the `Fragility` of the scales of two, of the same scenes."""
    scale = np.concatenate([first.scale, second.scale])
    order = np.argsort(scale)
    place = np.argsort(order)
    reasons = {
        ",".join([*key.split(",")[:2], str(place[int(key.split(",")[2]) + begin])]): reason
        for one, begin in ((first, 0), (second, first.scale.size))
        for key, reason in one.reasons.items()
    }
    parts = {
        name: np.concatenate([getattr(first, name), getattr(second, name)], axis=-1)[..., order]
        for name in ("scale", "probability", "error_estimate")
    }
    return dataclasses.replace(first, **parts, reasons=reasons, wall_s=first.wall_s + second.wall_s)


def _critical(scenes, measure, curves, draws):
    """Return the `CriticalIntensities` of a block under motions at their own scales; None with noise."""
    highest = float(curves.scale[-1])
    if curves.motions is None or draws is not None:
        return None if curves.motions is None else critical_intensities(scenes, measure=measure, highest=highest)
    # Up to an intensity this low nothing is searched for: what each motion does at its own scale is left.
    found = critical_intensities(scenes, measure=measure, highest=1e-9 * highest)
    return dataclasses.replace(found, highest=highest, jumps=curves.motions.jumps[:, 0].copy())
