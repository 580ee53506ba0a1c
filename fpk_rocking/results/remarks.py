"""Sentences beside the numbers of every table, figure and file: which noise they are for, and what was assumed."""

import dataclasses
import math
from typing import Any

from fpk_rocking.physics import equivalence
from fpk_rocking.results.trust import CAUTION, UNUSABLE, Doubt

__all__ = ["closure_of", "doubts", "noise_text", "remarks"]

_FILTERS = {"exponential": "exponential", "low-pass": "low-pass", "kanai-tajimi": "Kanai-Tajimi"}

SLENDER = 0.05
"""Error of the linearized moments up to which a block counts as slender."""


def scene_text(scene):
    """Return forcing, restitution, start and noise of a scene, for a note below a picture."""
    start = f"start at ({scene.start.angle:g}, {scene.start.velocity:g})"
    return f"{scene.forcing}, e = {scene.block.restitution:g}, {start}, {noise_text(scene.noise)}; all nondimensional."


def noise_text(noise) -> str:
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
        damping = "" if noise.damping is None else f", damping {noise.damping:g}"
        name = _FILTERS[noise.filter]
        return f"{name} noise, variance {noise.variance:g}, frequency {noise.frequency:g}{damping}"
    return "no noise"


def closure_of(scene, solved) -> str:
    """Say which noise, that of the scene `solved`, replaced the band noise of a scene; empty where none did."""
    if scene.noise == solved.noise:
        return ""
    low, high = scene.noise.band
    instead = (
        f"white noise of equal Melnikov variance, D = {solved.noise.diffusion:.6g}"
        if solved.noise.kind == "white"
        else f"{noise_text(solved.noise)}, of equal variance and Melnikov variance"
    )
    return (
        f"Band noise (variance {scene.noise.variance:g} on [{low:g}, {high:g}]) was replaced by {instead}. This is an "
        "approximation, which Monte Carlo can check."
    )


def remarks(*results: Any) -> tuple[str, ...]:
    """Return the sentences that a reader of some results needs, each once.

    They say where the block is too squat for the model, what the scene remarks on its noise, which noise replaced band
    noise, what a density does not resolve, and where the noise that was solved for is not to be trusted.

    Parameters
    ----------
    *results : Result
        Results that are shown together, of any engine.

    Returns
    -------
    tuple of str
        Empty where there is nothing to say.
    """
    sentences = []
    for result in results:
        sentences += filter(None, (getattr(result.scene.noise, "remark", ""), result.closure))
        sentences += [doubt.sentence for doubt in doubts(result, beside=results)]
    return tuple(dict.fromkeys(sentences))


def doubts(result, beside=()) -> list[Doubt]:
    """Return what speaks against a result whatever its own errors: model and noise; `beside`: results shown with it."""
    found = _squat(result.scene.block.dimensions)
    if getattr(result, "unresolved", ""):
        found.append(Doubt(CAUTION, result.unresolved, "unresolved"))
    if _stands_for((result, *beside), result):
        filtered = getattr(result, "atom", False)
        found += _closure_doubts(result.scene, result.survival, result.averaged, filtered)
    return found


def _squat(size):
    """Say how wrong the moments of a slender block are for one that is not."""
    if size is None or max(size.slenderness_error) <= SLENDER:
        return []
    gravity, shaking = (100.0 * error for error in size.slenderness_error)
    sentence = (
        f"Squat block: {size.width:.3g} m by {size.height:.3g} m is treated as slender: the moment of gravity is then "
        f"too large by up to {gravity:.2g} % and that of the shaking by up to {shaking:.2g} %."
    )
    return [Doubt(CAUTION, sentence, "squat")]


def _stands_for(results, result) -> bool:
    """Whether the noise of a result is held against its equivalent white noise, within itself or in another."""
    noise = result.scene.noise
    if noise.kind not in {"band", "filtered"} or noise.variance == 0.0:
        return False
    diffusion = equivalence.equivalent_diffusion(noise)
    whites = (other.scene.noise.diffusion for other in results if other.scene.noise.kind == "white")
    return bool(result.closure) or any(math.isclose(white, diffusion) for white in whites)


def _closure_doubts(scene, survival, averaged, filtered):
    """Yield what speaks against white noise for the noise of a scene; bounds and figures are of `equivalence`.

    A result that is averaged over realizations has the scatter between them, one with `filtered` noise in place of a
    band has the rest of its blocks.
    """
    noise = scene.noise
    part = equivalence.cover(noise)
    if noise.kind == "filtered":
        if part < equivalence.TRUSTED_COVER:
            sentence = (
                f"Not to be trusted: the spectrum of the filtered noise covers {100 * part:.2g} % of the Melnikov "
                f"variance of white noise as strong as its peak ({100 * equivalence.TRUSTED_COVER:g} % are needed), "
                "too little for white noise to replace it. Solve for the filtered noise itself."
            )
            yield Doubt(UNUSABLE, sentence, "cover")
        return
    low, high = noise.band
    spread = equivalence.realized_spread(noise, scene.block.restitution)
    lifted = equivalence.LIFTED if scene.period is not None else equivalence.LIFTED_ONCE
    if scene.forcing.largest <= lifted and survival[-1] < equivalence.STANDING and not filtered:
        sentence = (
            f"Not to be trusted, as the block rests: the forcing, at most {scene.forcing.largest:.3g}, hardly lifts "
            "it off. Under band noise it rests now and then, under the white noise that was solved for never. In such "
            f"scenes survival was found wrong by up to {equivalence.RESTLESS:g}, mostly too low. Use Monte Carlo"
            + (", or the closure 'filtered'." if scene.repeats else ".")
        )
        yield Doubt(UNUSABLE, sentence, "resting")
    if part < equivalence.TRUSTED_COVER and filtered:
        sentence = (
            f"Not tested: the band [{low:g}, {high:g}] covers {100 * part:.2g} % of the Melnikov variance of equally "
            "strong white noise; low-pass noise was tested for bands that cover all of it. Use Monte Carlo."
        )
        yield Doubt(CAUTION, sentence, "cover")
    elif part < equivalence.TRUSTED_COVER:
        sentence = (
            f"Not to be trusted: the band [{low:g}, {high:g}] covers {100 * part:.2g} % of the Melnikov variance of "
            f"equally strong white noise ({100 * equivalence.TRUSTED_COVER:g} % are needed). For such bands survival "
            f"under the equivalent white noise was found wrong by up to {equivalence.WORST:g}, in either direction. "
            "Use Monte Carlo."
        )
        yield Doubt(UNUSABLE, sentence, "cover")
    if spread > equivalence.TRUSTED_SPREAD and not averaged:
        excess = min(equivalence.EXCESS * spread**2, 1.0)
        sentence = (
            f"Few harmonics: realizations of {noise.harmonics} harmonics differ in strength by {100 * spread:.0f} % "
            f"({100 * equivalence.TRUSTED_SPREAD:.0f} % are trusted), so more blocks survive than under white noise, "
            f"by up to about {excess:.2g} within 40 cycles. Use Monte Carlo, or an average over realizations."
        )
        yield Doubt(CAUTION, sentence, "harmonics")
