"""Sentences beside the numbers of every table, figure and file: which noise they are for, and what was assumed."""

import dataclasses
from typing import Any

import numpy as np

from fpk_rocking.physics.noise import equivalence
from fpk_rocking.physics.noise.filters import FILTERS
from fpk_rocking.physics.noise.kinds import BandNoise, FilteredNoise, NoNoise, WhiteNoise
from fpk_rocking.results.trust import CAUTION, REPLACED, VERDICTS, Doubt
from fpk_rocking.scene.limits import implausible
from fpk_rocking.scene.scene import Scene

__all__ = ["cautions", "closure_of", "doubts", "noise_text", "remarks"]

UNCHECKED = "Replaced, not checked: what the replacement of the noise changes is not part of the errors stated here."


def scene_text(scene: Scene) -> str:
    """Return forcing, restitution, start and noise of a scene, for a note below a picture."""
    start = f"start at ({scene.start.angle:g}, {scene.start.velocity:g})"
    return f"{scene.forcing}, e = {scene.block.restitution:g}, {start}, {noise_text(scene.noise)}; all nondimensional."


def noise_text(noise: BandNoise | WhiteNoise | FilteredNoise | NoNoise) -> str:
    """One line that names a noise and its parameters (nondimensional).

    Parameters
    ----------
    noise : BandNoise, WhiteNoise, FilteredNoise or NoNoise
        The noise of a scene.

    Returns
    -------
    str
        For example ``"band noise, variance 0.04 on [0, 10], 100 harmonics"``.
    """
    if noise.envelope is not None:
        return f"{noise_text(dataclasses.replace(noise, envelope=None))}, envelope {noise.envelope}"
    if noise.kind == "band":
        low, high = noise.band
        return f"band noise, variance {noise.variance:g} on [{low:g}, {high:g}], {noise.harmonics} harmonics"
    if noise.kind == "white":
        return f"white noise, diffusion {noise.diffusion:.6g}"
    if noise.kind == "filtered":
        if not isinstance(noise.filter, str):
            return f"{noise.filter}, variance {noise.variance:g}"
        damping = "" if noise.damping is None else f", damping {noise.damping:g}"
        name = FILTERS[noise.filter].text
        return f"{name} noise, variance {noise.variance:g}, frequency {noise.frequency:g}{damping}"
    return "no noise"


def closure_of(scene: Scene, solved: Scene) -> str:
    """Say which noise, that of the scene `solved`, replaced the band noise of a scene; empty where none did."""
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
    """Return the sentences that a reader of some results needs, each once.

    They say with which friction a block slides before it rocks, where one of some size is taken as slender, what the
    scene remarks on its noise, which noise replaced band noise and what that changes, what a density does not resolve,
    and what a check that failed may be due to.

    Parameters
    ----------
    *results : Result
        Results that are shown together, of any engine.

    Returns
    -------
    tuple of str
        Empty where there is nothing to say.

    Examples
    --------
    >>> from fpk_rocking import Scene
    >>> from fpk_rocking.results.remarks import remarks
    >>> from montecarlo import simulate
    >>> print(*remarks(simulate(Scene.from_block(0.5, 1.8, "0.4 g", "1.5 Hz"), cycles=2)))
    A block with a friction coefficient below 0.278 slides before it rocks; rocking needs more still (contact_forces).
    """
    sentences: list[str] = []
    for result in results:
        sentences += filter(None, (result.scene.noise.remark, _sliding(result.scene.block), result.closure))
        sentences += [doubt.sentence for doubt in doubts(result)]
        sentences += filter(None, [result.check, result.unjudged])
        sentences += _explained(result)
    return tuple(dict.fromkeys(sentences))


def cautions(*results: Any) -> tuple[str, ...]:
    """Return what speaks against some results, each sentence once: the reasons of verdicts that are not "ok".

    A picture has room for these alone; the `remarks` stand in tables and files.
    """
    told = (
        f"{one.engine}: {reason}" for one in results if one.trust.verdict != VERDICTS[0] for reason in one.trust.reasons
    )
    return tuple(dict.fromkeys(told))


def doubts(result: Any) -> list[Doubt]:
    """Return what speaks against a result whatever its own errors: the model, and noise whose replacement is unchecked.

    A replacement that was checked is judged by its figure, ``total_error``, as all figures are.
    """
    return scene_doubts(result.scene, "" if result.replacement else result.closure, result.unresolved)


def scene_doubts(
    scene: Scene, closure: str, unresolved: str = "", scales: tuple[float, float] = (1.0, 1.0)
) -> list[Doubt]:
    """Return what speaks against any result for a scene, in which another noise may have replaced that of the scene.

    Between the smallest and the largest of some scales of its shaking, where there are several.
    """
    found = _slender(scene.block)
    told = implausible(scene, *scales)
    found += [Doubt(CAUTION, " ".join(told), "implausible")] * bool(told)
    found += [Doubt(CAUTION, unresolved, "unresolved")] * bool(unresolved)
    return found + [Doubt(CAUTION, UNCHECKED, "unchecked")] * bool(closure)


def _sliding(block):
    least = block.least_friction
    if least is None:
        return ""
    return (
        f"A block with a friction coefficient below {least:.3g} slides before it rocks; rocking needs more still "
        "(contact_forces)."
    )


def _slender(block):
    """Say how wrong the moments are where a block is taken as slender in spite of its dimensions."""
    if not block.slender or block.dimensions is None:
        return []
    size = block.dimensions
    gravity, shaking = (100.0 * error for error in size.slenderness_error)
    sentence = (
        f"Slender block: {size.width:.3g} m by {size.height:.3g} m is treated as slender, as block.slender asks. The "
        f"moment of gravity is then too large by up to {gravity:.2g} %, that of the shaking by up to {shaking:.2g} %: "
        "fpk_rocking.studies.slenderness_cost(scene) measures what this changes."
    )
    return [Doubt(CAUTION, sentence, "slender")]


def _explained(result):
    """Yield what helps where the check says that the replacement of noise is off, and what may explain it."""
    check = result.replacement
    if check is None or result.facts["total_error"] <= max(REPLACED, result.facts["tol"]):
        return
    worst = np.unravel_index(result.total_error.argmax(), result.total_error.shape)
    if check.sampling_error[worst] > abs(check.difference[worst]):
        yield "Most of the total error is the sampling error of the check: more paths make it smaller."
        return
    alone = 1.0 - result.survival[-1] - check.difference[-1, 0]
    yield (
        f"Better here are the paths alone: P(overturned) = {alone:.4f} ± {check.sampling_error[-1, 0]:#.2g} in the end."
    )
    noise, block = result.scene.noise, result.scene.block
    part = equivalence.cover(noise, block.critical_angle)
    spread = equivalence.realized_spread(noise, block.restitution, block.critical_angle)
    rest = (
        f"; the forcing alone reaches {result.scene.forcing.largest:.3g}, a block at rest lifts off above "
        f"{block.lift_off:.4g}, and under white noise none rests"
    )
    yield (
        f"What may explain it: the band [{noise.band[0]:g}, {noise.band[1]:g}] covers {100.0 * part:.0f} % of the "
        f"Melnikov variance of equally strong white noise; realizations of {noise.harmonics} harmonics differ in "
        f"strength by {100.0 * spread:.0f} %{'' if result.atom else rest}."
    )
