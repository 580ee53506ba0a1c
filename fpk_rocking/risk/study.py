"""`study`: records at equal intensities, their curve, and the annual rate under a hazard."""

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from typing import Any

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array, ArrayLike, File, Progress, not_none
from fpk_rocking.physics.forcing import Forcing
from fpk_rocking.physics.noise.kinds import NoNoise
from fpk_rocking.risk.critical import critical_intensities
from fpk_rocking.risk.curves import Fragility, fragility
from fpk_rocking.risk.drawing import drawn
from fpk_rocking.risk.export import check_name
from fpk_rocking.risk.hazard import Hazard
from fpk_rocking.risk.motions import at_intensity, recorded_scenes
from fpk_rocking.risk.population import IntensityCurve
from fpk_rocking.risk.rate import Risk, annual_frequency
from fpk_rocking.risk.result import MOVED, Study, corrected
from fpk_rocking.scene.scene import Scene
from fpk_rocking.studies.execution import seed_of

FEWEST_RECORDS = 5
"""Least number of motions, or of blocks under one motion, that a study accepts beside one."""

BLOCKS = 100
"""Blocks that are drawn for all motions together: a dispersion that they give has a standard error of a tenth of β."""

STEP = 1.4
"""Factor between intensities that are added above those asked for."""

CLOSEST, MOST_INTENSITIES = 0.02, 64
"""Intensities are added no closer in the logarithm than this to others, up to so many, or twice those asked for."""


def study(
    scene: Scene,
    records: Sequence[Forcing | File],
    hazard: Hazard | File | None,
    intensities: ArrayLike | None = None,
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
        One, or at least five, or files that `Record.from_file` reads; with none the forcing of the scene counts.
    hazard : Hazard, str or pathlib.Path, or None
        In the unit of the measure, or a file that `Hazard.from_csv` reads; with None there is no rate.
    intensities : array_like, optional
        Points of the curve, in g or m/s; by default twelve, from half of the lowest at which a motion overturns the
        block without noise to above the highest. With noise and a hazard others are added until they move the rate by
        less than 1 %. Without noise rate and limits do not depend on them.
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
        Distributions of values of the block, see `fpk_rocking.risk.drawing.drawn`.
    blocks : int
        Blocks that are drawn for each record, at least five for one record; by default a hundred for all together.
    name : str
        Identifier of the block in exported files.
    workers, store, progress
        As for `fpk_rocking.studies.sweep`, with a motion at an intensity for a scene.

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
    options: dict[str, Any] = {"realizations": realizations, "scale_noise": scale_noise, "workers": workers}
    deterministic = all(shaken.deterministic for shaken in scenes)
    uncorrected_too = deterministic and draws is None and corrected(scenes)
    report = _RoundsReport(progress, 1 + uncorrected_too)

    def sample(scale, number, scenes=at_one):
        own = {"seed": seed_of(seed, 2**32 + number) if number else seed, "store": _store_of(store, number)}
        report.begin_round()
        return fragility(scenes if len(scenes) > 1 else scenes[0], scale=scale, progress=report, **options, **own)

    def risk_of(curves):
        curve = IntensityCurve.of(curves, measure, draws=draws, samples=1)
        return annual_frequency(dataclasses.replace(curve, refined=True), not_none(exceeded))

    asked = None if intensities is None else np.sort(np.asarray(intensities, float))
    if deterministic:
        curves, added, moved = sample(np.ones(1) if asked is None else asked, 0), 0, 0.0
        if asked is None:
            curves = curves.at_scales(_range(not_none(curves.critical)))
    else:
        calm = None if asked is not None and exceeded is None else _without_noise(scenes, measure, workers)
        asked = _range(not_none(calm)) if asked is None else asked
        if exceeded is None:
            curves, added, moved = sample(asked, 0), 0, 0.0
        else:
            curves, added, moved = refined(sample, risk_of, asked, _above(asked[-1], not_none(calm)))
    curve, uncorrected = IntensityCurve.of(curves, measure, draws=draws), None
    curve = dataclasses.replace(curve, refined=exceeded is not None and curves.motions is None)
    if uncorrected_too:
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
    """Return twelve intensities over the range in which motions overturn a block, by its `CriticalIntensities`."""
    low, high = critical.critical.min(), critical.equivalent[np.isfinite(critical.equivalent)].max(initial=0.0)
    if math.isinf(low):
        accepted = "a list of them, as no motion overturns the block without noise"
        raise ValueError(checks.refusal("intensities", None, accepted))
    return np.geomspace(0.5 * low, 1.25 * max(low, high), 12)


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


def refined(
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
