"""Sentences beside the numbers of every table, figure and file: which noise they are for, and what was assumed."""

import dataclasses
from typing import Any

from fpk_rocking.physics.noise.filters import FILTERS
from fpk_rocking.physics.noise.kinds import BandNoise, FilteredNoise, NoNoise, WhiteNoise
from fpk_rocking.results.trust import CAUTION, VERDICTS, Diagnostic
from fpk_rocking.scene.limits import implausible
from fpk_rocking.scene.scene import Scene

__all__ = [
    "cautions",
    "describe_replacement",
    "noise_text",
    "remarks",
    "scene_diagnostics",
    "scene_remarks",
    "scene_text",
]

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


def describe_replacement(scene: Scene, solved: Scene) -> str:
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
    return tuple(dict.fromkeys(sentence for result in results for sentence in result.remarks))


def cautions(*results: Any) -> tuple[str, ...]:
    """Return the sentences, each once, that speak against some results: the reasons of verdicts that are not "ok".

    A picture has room for these alone; the `remarks` stand in tables and files.
    """
    sentences = (
        f"{one.engine}: {reason}" for one in results if one.trust.verdict != VERDICTS[0] for reason in one.trust.reasons
    )
    return tuple(dict.fromkeys(sentences))


def scene_remarks(result: Any) -> tuple[str, ...]:
    """Sentences about the scene of a result: on its noise, when its block slides, which noise replaced that noise."""
    scene = result.scene
    return tuple(filter(None, (scene.noise.remark, _sliding(scene.block), getattr(result, "noise_replacement", ""))))


def scene_diagnostics(
    scene: Scene, noise_replacement: str, unresolved: str = "", scales: tuple[float, float] = (1.0, 1.0)
) -> list[Diagnostic]:
    """Diagnostics of the model for a scene: known errors of any result for it, whatever the errors of the method.

    Parameters
    ----------
    scene : Scene
    noise_replacement : str
        Which noise replaced that of the scene, if what this changes was not checked; else empty.
    unresolved : str
        What the result does not resolve, as a sentence; empty where it resolves everything.
    scales : (float, float)
        Smallest and largest scale of the shaking, where there are several.

    Returns
    -------
    list of Diagnostic
    """
    diagnostics = _slender(scene.block)
    implausibilities = implausible(scene, *scales)
    diagnostics += [Diagnostic(CAUTION, " ".join(implausibilities), "implausible")] * bool(implausibilities)
    diagnostics += [Diagnostic(CAUTION, unresolved, "unresolved")] * bool(unresolved)
    return diagnostics + [Diagnostic(CAUTION, UNCHECKED, "unchecked")] * bool(noise_replacement)


def _sliding(block):
    """Return with which friction a block slides before it rocks, as a sentence; empty where its size is unknown."""
    least = block.least_friction
    if least is None:
        return ""
    return (
        f"A block with a friction coefficient below {least:.3g} slides before it rocks; rocking needs more still "
        "(contact_forces)."
    )


def _slender(block):
    """Diagnostic of a block that is taken as slender in spite of its dimensions: by how much its moments are wrong."""
    if not block.slender or block.dimensions is None:
        return []
    size = block.dimensions
    gravity, shaking = (100.0 * error for error in size.slenderness_error)
    sentence = (
        f"Slender block: {size.width:.3g} m by {size.height:.3g} m is treated as slender, as block.slender asks. The "
        f"moment of gravity is then too large by up to {gravity:.2g} %, that of the shaking by up to {shaking:.2g} %: "
        "fpk_rocking.studies.slenderness_cost(scene) measures what this changes."
    )
    return [Diagnostic(CAUTION, sentence, "slender")]
