"""Sentences beside the numbers of every table, figure and file: which noise they are for, and what was assumed."""

import dataclasses
import math
from collections.abc import Iterable
from typing import Any

from fpk_rocking.physics.forcing import Record
from fpk_rocking.physics.forcing.base import Forcing
from fpk_rocking.physics.noise.filters import FILTERS
from fpk_rocking.physics.noise.kinds import BandNoise, FilteredNoise, NoNoise, WhiteNoise, enough_harmonics
from fpk_rocking.results.trust import CAUTION, VERDICTS, Diagnostic
from fpk_rocking.scene.ranges import implausible
from fpk_rocking.scene.scene import Scene
from fpk_rocking.scene.units import STANDARD_GRAVITY

RARE = 0.05
"""Probability of overturning below which the number of harmonics of band noise may change it by a factor."""

UNCHECKED = "Replaced, not checked: what replacing the noise changes is not contained in the errors stated here."


def scene_text(scene: Scene) -> str:
    """Return forcing, restitution, start and noise of a scene as one line of text, for a note below a picture."""
    start = f"start at ({scene.start.angle:g}, {scene.start.velocity:g})"
    restitution = scene.block.restitution_text()
    return f"{scene.forcing}, e = {restitution}, {start}, {noise_text(scene.noise)}; all nondimensional."


def noise_text(noise: BandNoise | WhiteNoise | FilteredNoise | NoNoise) -> str:
    """Return a noise and its parameters as text: "band noise, variance 0.04 on [0, 10], 100 harmonics"."""
    if noise.envelope is not None:
        return f"{noise_text(dataclasses.replace(noise, envelope=None))}, envelope {noise.envelope}"
    if noise.kind == "band":
        low, high = noise.band
        harmonics = "stratified harmonics" if noise.frequencies == "stratified" else "harmonics"
        return f"band noise, variance {noise.variance:g} on [{low:g}, {high:g}], {noise.harmonics} {harmonics}"
    if noise.kind == "white":
        return f"white noise, diffusion {noise.diffusion:.6g}"
    if noise.kind == "filtered":
        if not isinstance(noise.filter, str):
            return f"{noise.filter}, variance {noise.variance:g}"
        damping = "" if noise.damping is None else f", damping {noise.damping:g}"
        name = FILTERS[noise.filter].text
        return f"{name} noise, variance {noise.variance:g}, frequency {noise.frequency:g}{damping}"
    return "no noise"


def describe_replacement(scene: Scene, solved: Scene) -> str:
    """Return a sentence on which noise of the scene that was `solved` replaced the band noise; empty where none did."""
    noise = scene.noise
    if noise.kind != "band" or noise == solved.noise:
        return ""
    low, high = noise.band
    instead = (
        f"white noise of equal Melnikov variance, D = {solved.noise.diffusion:.6g}"
        if solved.noise.kind == "white"
        else f"{noise_text(solved.noise)}, of equal variance and Melnikov variance"
    )
    return (
        f"Band noise (variance {noise.variance:g} on [{low:g}, {high:g}]) was replaced by {instead}. This is an "
        "approximation."
    )


def remarks(*results: Any) -> tuple[str, ...]:
    """Return the sentences that a reader of some results needs, each once: of scene, noise and failed checks.

    Parameters
    ----------
    *results : Result
        Results that are shown together, of any engine.

    Examples
    --------
    >>> from fpk_rocking import Scene
    >>> from fpk_rocking.results.remarks import remarks
    >>> from montecarlo import simulate
    >>> print(*remarks(simulate(Scene.from_block(0.5, 1.8, "0.4 g", "1.5 Hz"), cycles=2)))
    A block with a friction coefficient below 0.278 slides before it rocks; rocking needs a higher one (contact_forces).
    """
    return tuple(dict.fromkeys(sentence for result in results for sentence in result.remarks))


def cautions(*results: Any) -> tuple[str, ...]:
    """Return the reasons of those verdicts on results that are not "ok", each once.

    A picture has room for these alone; the `remarks` stand in tables and files.
    """
    doubtful = (result for result in results if result.trust.verdict != VERDICTS[0])
    sentences = (f"{result.engine}: {reason}" for result in doubtful for reason in result.trust.reasons)
    return tuple(dict.fromkeys(sentences))


def scene_remarks(result: Any) -> tuple[str, ...]:
    """Return sentences about the scene of a `Result`: noise and what replaced it, sliding, a corrected baseline."""
    scene = result.scene
    replacement, baseline = getattr(result, "noise_replacement", ""), baseline_remark([scene.forcing])
    return tuple(filter(None, (scene.noise.remark, _harmonics(result), _sliding(scene.block), replacement, baseline)))


def _harmonics(result):
    """Sentences on what the number of harmonics does to a probability below `RARE`; else an empty text."""
    noise = result.scene.noise
    sampled = noise.kind == "band" and (getattr(result, "realizations", None) or 0) > 0 and hasattr(result, "survival")
    if not sampled or not 0.0 < 1.0 - result.survival[-1] < RARE:
        return ""
    enough = enough_harmonics(noise.band, float(result.times[-1]))
    if noise.frequencies == "stratified":
        if noise.harmonics >= enough:
            return ""
        return (
            f"Few harmonics: noise of this band and duration needs {enough}, and {noise.harmonics} are drawn. A "
            "probability as small as this may be too large: with 100 in place of 248 it was, by a factor of 1.5."
        )
    return (
        f"The frequencies of the {noise.harmonics} harmonics are drawn independently, so realizations differ in "
        "strength. A probability as small as this may then be larger than under Gaussian noise, even several times: "
        'take frequencies = "stratified" unless independent frequencies are meant.'
    )


def baseline_remark(forcings: Iterable[Forcing]) -> str:
    """Return sentences on what was removed from the baselines of records, and how this changes PGV and PGA.

    Equal samples count once; the text is empty where no baseline was corrected.
    """
    records = [forcing for forcing in forcings if isinstance(forcing, Record) and forcing.baseline != "none"]
    records = list({(record.samples, record.interval, record.baseline): record for record in records}.values())
    if not records:
        return ""
    first, kinds = records[0].correction, dict.fromkeys(map(_correction, records))
    done = f"corrected ({'; '.join(kinds)}), which removes"
    if len(records) == 1:
        return (
            f"Baseline of {records[0].source or 'the record'} {done} {_line_of(first)}: PGV {first.corrected_pgv:.3g} "
            f"in place of {first.pgv:.3g} m/s, PGA {first.corrected_pga / STANDARD_GRAVITY:.3g} in place of "
            f"{first.pga / STANDARD_GRAVITY:.3g} g, as recorded."
        )
    every = [record.correction for record in records]
    offset = max(abs(drift.offset) for drift in every) / STANDARD_GRAVITY
    ratios = {
        "PGV": sorted(drift.corrected_pgv / drift.pgv for drift in every if drift.pgv > 0.0),
        "PGA": sorted(drift.corrected_pga / drift.pga for drift in every if drift.pga > 0.0),
    }
    texts = (f"{name} by {values[0]:.3g} to {values[-1]:.3g}" for name, values in ratios.items() if values)
    return (
        f"Baselines of {len(records)} records {done} offsets of up to {offset:.2g} g. This multiplies "
        f"{' and '.join(texts)}."
    )


def _correction(record):
    """Correction of a `Record`'s baseline as a text, as "linear", or "high-pass" with the corner in Hz."""
    return f"high-pass, {record.corner_hz:.3g} Hz" if record.baseline == "high-pass" else record.baseline


def _line_of(drift):
    """Line of least squares of a `Drift`, its offset and slope, as a text in g and g/s."""
    slope = drift.slope / STANDARD_GRAVITY
    return f"an offset of {drift.offset / STANDARD_GRAVITY:.2g} g and a slope of {slope:.2g} g/s"


def drifting(forcing: Forcing) -> list[Diagnostic]:
    """Return a caution where the velocity of a record is that of a drift of its baseline; else an empty list."""
    if not isinstance(forcing, Record) or not forcing.drifts:
        return []
    drift = forcing.drift
    sentence = (
        f"{forcing.drift_source or 'The record'} drifts: its PGV is {drift.pgv:.3g} m/s as recorded, but "
        f"{drift.corrected_pgv:.3g} m/s without {_line_of(drift)} and without frequencies below "
        f'{forcing.corner_hz:.3g} Hz. Take baseline = "high-pass" (--baseline high-pass).'
    )
    return [Diagnostic(CAUTION, sentence, "drift")]


def airborne(motions: Iterable[tuple[Forcing, float]]) -> list[Diagnostic]:
    """Return a caution where motions, times a factor each, leave a block no weight; else an empty list."""
    found = []
    for forcing, factor in motions:
        if isinstance(forcing, Record) and forcing.vertical is not None and math.isfinite(factor):
            time = forcing.weightless(factor)
            found += [(forcing, factor, time)] * math.isfinite(time)
    if not found:
        return []
    forcing, factor, time = found[0]
    times = float(factor * forcing.scale)
    strength = f", {times:.3g} times as strong as recorded," * (times != 1.0)
    sentence = (
        f"The vertical motion of {forcing.source or 'the record'}{strength} takes all weight off the block at "
        f"{time:.4g} s: the block would leave the ground, but the model keeps its corner on the ground."
    )
    others = f" (The same holds for {len(found) - 1} of the other motions.)" * (len(found) > 1)
    return [Diagnostic(CAUTION, sentence + others, "airborne")]


def scene_diagnostics(
    scene: Scene, noise_replacement: str, unresolved: str = "", scales: tuple[float, float] = (1.0, 1.0)
) -> list[Diagnostic]:
    """Return known errors of any result for a scene, whatever those of the method.

    `noise_replacement` says which noise replaced that of the scene, if what this changes was not checked; `unresolved`
    what the result does not resolve; both may be empty. `scales` are the smallest and the largest scale of the shaking.
    """
    diagnostics = _slender(scene.block) + drifting(scene.forcing) + airborne([(scene.forcing, scales[1])])
    implausibilities = implausible(scene, *scales)
    diagnostics += [Diagnostic(CAUTION, " ".join(implausibilities), "implausible")] * bool(implausibilities)
    diagnostics += [Diagnostic(CAUTION, unresolved, "unresolved")] * bool(unresolved)
    return diagnostics + [Diagnostic(CAUTION, UNCHECKED, "unchecked")] * bool(noise_replacement)


def _sliding(block):
    """With which friction a `Block` slides before it rocks, as a sentence; empty where its size is unknown."""
    least = block.least_friction
    if least is None:
        return ""
    return (
        f"A block with a friction coefficient below {least:.3g} slides before it rocks; rocking needs a higher one "
        "(contact_forces)."
    )


def _slender(block):
    """A caution where a `Block` is taken as slender in spite of its dimensions: how wrong its moments are."""
    if not block.slender or block.size is None:
        return []
    size = block.size
    gravity, shaking = (100.0 * error for error in size.slenderness_error)
    sentence = (
        f"Slender block: {size} is treated as slender, as block.slender asks. The "
        f"moment of gravity is then too large by up to {gravity:.2g} %, that of the shaking by up to {shaking:.2g} %: "
        "fpk_rocking.studies.slenderness_cost(scene) measures what this changes."
    )
    return [Diagnostic(CAUTION, sentence, "slender")]


EXACT_PATH = "Deterministic: one path, exact but for rounding errors, which grow in a chaotic motion."
"""Reason of the verdict on the one path of a deterministic scene by the method "exact"."""


def path_diagnostics(method: str) -> list[Diagnostic]:
    """Return a caution on the one path of a deterministic scene, or nothing if the method is exact."""
    if method == "exact":
        return []
    sentence = (
        f"Deterministic: one path, by the time steps of the method {method!r}, whose error is not estimated. Compare "
        "with the method 'exact', or with another `steps_per_cycle`."
    )
    return [Diagnostic(CAUTION, sentence, "steps")]
