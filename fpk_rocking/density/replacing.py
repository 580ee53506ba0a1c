"""Which noise replaces a band in the density, by what that neglects: white noise, or filtered noise of 1 or 2 states.

All replacements have the band's Melnikov variance: they act alike on a block that remembers its flight before an
impact, whose weight of a frequency is 4/(1+ω²)². A block that an impact lets forget it has the weight 1/(1+ω²), and a
block of restitution e has a mean of both (`equivalence.response`). So two white noises, as strong as the band and as
its replacement for a block that forgets, tell how far apart the two can be: coarse densities under them are compared.
Of blocks that rest, white noise is right about none, and filtered noise about most. They are those that rattle next to
rest under white noise, the most at four times a cycle, and those that the band leaves at rest at the start; from a
start at rest they overturn no more often than all.

A realization of N independent harmonics keeps its strength, and has lighter tails than Gaussian noise. What both change
in a density, to first order in 1/N, follows from how it depends on the strength of the noise (docs/theory, "Finite N").
"""

import dataclasses
import functools
import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from fpk_rocking.base.checks import Array
from fpk_rocking.physics.noise.equivalence import forgetful_diffusion, realized_spread, relative_variance
from fpk_rocking.results.trust import REPLACED
from fpk_rocking.scene.scene import Scene

REPLACEMENTS = "white", "exponential", "filtered"
"""Noises in place of a band, by the time that they take: none, one and two states more."""

UNCERTAIN_PART = 0.5
"""Part of what few harmonics change that is uncertain: of 20 and 50 up to .48 was measured, in ten scenes."""

STRENGTHS = 0.7, 1.0, 1.3
"""Strengths of the noise, as parts of its own, whose densities tell how these depend on it."""

_WEIGHTS = {"white": (2.0, 1.0), "exponential": (1.0, 0.2), "filtered": (1.0, 0.05)}
"""Weights of the two parts of an estimate: the change by the difference of strengths, and the part of the blocks that
may rest and overturns. In 31 scenes, each held against 10⁶ paths, white noise erred by up to 1.5 times the first, as it
has no memory either; beyond the first the three erred by up to .75, .12 and .015 of the second."""

_COVERED = 0.85
"""Relative variance from which on a band contains the frequencies of a block (docs/paper, white for band noise)."""

_SOLVED_PART = 1.0 / 3.0
"""Error of a density, in parts of what its replacement neglects, below which a finer one changes little."""

_WIDEST = 8.0


class Choice(NamedTuple):
    """A replacement: its name, the scene with it, estimated errors of all candidates, and why it was chosen."""

    name: str
    scene: Scene
    errors: dict[str, float]
    reason: str
    tol: float
    """Error to solve the density to: the wanted one or, up to .01, a third of what the replacement neglects."""

    @property
    def error(self) -> float:
        """Estimated error of the probabilities by the replacement."""
        return self.errors[self.name]


def choose(
    scene: Scene, tol: float, solve: Callable[[Scene], tuple[Array, float]], accepts: Callable[[Scene], Any]
) -> Choice:
    """Return the fastest replacement of a band whose estimated error is within `tol`, else the most accurate one.

    Parameters
    ----------
    scene : Scene
        With band noise.
    tol : float
        Wanted error of the probabilities.
    solve : callable
        Of a scene with white noise, about: survival, overturned left and right, (rows, 3), and the largest part that
        is next to rest.
    accepts : callable
        Raises ValueError for a scene that the solver does not take.
    """
    white = scene.white_equivalent()

    @functools.cache
    def candidate(name):
        try:
            replaced = replaced_scene(scene, name)
            accepts(replaced)
        except ValueError:
            return None
        return replaced

    if not any(map(candidate, REPLACEMENTS)):
        accepts(white)
    usual, resting = solve(white)
    resting = min(resting + _left_at_rest(scene), 1.0)

    def times_as_strong(ratio):
        ratio = min(max(ratio, 1.0 / _WIDEST), _WIDEST)
        noise = dataclasses.replace(white.noise, diffusion=ratio * white.noise.diffusion)
        return solve(dataclasses.replace(white, noise=noise))[0]

    covered = relative_variance(scene.noise, critical_angle=scene.block.critical_angle)
    # A block that feels the frequencies of the band alone feels white noise of the level that the band has there.
    in_band = [times_as_strong(1.0 / covered)] if covered < _COVERED else []

    def estimate(name, replaced):
        others = [times_as_strong(forgetful_diffusion(scene.noise) / forgetful_diffusion(replaced.noise)), *in_band]
        # The future of a block that rests is that of a start at rest; of another start it is not known.
        overturned = 1.0 - float(min(found[-1, 0] for found in (usual, *others))) if scene.start.at_rest else 1.0
        parts = max(float(np.abs(other - usual).max()) for other in others), resting * overturned
        return float(np.dot(_WEIGHTS[name], parts))

    errors, texts = {}, []
    for name in REPLACEMENTS:
        replaced = candidate(name)
        if replaced is None:
            texts.append(f"{name} refused")
            continue
        errors[name] = estimate(name, replaced)
        if name == "exponential" and candidate("filtered") is None:
            # Noise too slow for two states: what its memory changes is in no estimate, so it is no better than none.
            errors[name] = max(errors[name], errors.get("white") or estimate("white", white))
        texts.append(f"{name} {errors[name]:.1g}")
        if errors[name] <= tol:
            break
    name = min(errors, key=lambda name: errors[name])
    why = f"the fastest within {tol:g}" if errors[name] <= tol else f"the most accurate, as none is within {tol:g}"
    reason = f"{name} noise is {why} (estimated errors: {', '.join(texts)})"
    # Beyond REPLACED the verdict would allow more.
    solved_to = max(tol, min(_SOLVED_PART * errors[name], REPLACED))
    reason += f"; the density is therefore solved to an error of {solved_to:.1g}" * (solved_to > tol)
    return Choice(name, replaced_scene(scene, name), errors, reason, solved_to)


def _left_at_rest(scene):
    """Probability that the noise of a scene does not lift the block off at the start; 0.0 of one that does not rest."""
    level = scene.block.lift_off
    if not scene.start.at_rest:
        return 0.0
    ends = [(level - scene.forcing.value(0.0)), (-level - scene.forcing.value(0.0))]
    above, below = (0.5 * math.erf(end / math.sqrt(2.0 * scene.noise.variance)) for end in ends)
    return above - below


def replaced_scene(scene: Scene, name: str) -> Scene:
    """Return a scene with one of `REPLACEMENTS` in place of its band; filtered noise is returned as it is."""
    if scene.noise.kind == "filtered":
        return scene
    if name == "white":
        return scene.white_equivalent()
    return scene.filtered_equivalent(states=1 if name == "exponential" else 2)


def scatter_of_strength(scene: Scene) -> float:
    """Return the relative scatter of strength between the realizations of a scene's noise; 0.0 of Gaussian noise."""
    noise, block = scene.noise, scene.block
    if noise.kind != "band" or noise.frequencies == "stratified":
        return 0.0
    return realized_spread(noise, block.restitution, critical_angle=block.critical_angle)


def second_derivative(values: Sequence[Array]) -> Array:
    """Return that by the strength, like each of the `values`, three at `STRENGTHS`."""
    low, usual, high = values
    return (low - 2.0 * usual + high) / (STRENGTHS[1] - STRENGTHS[0]) ** 2


def lighter_tails(scatter: float, harmonics: int, survivals: Sequence[Array]) -> Array:
    """Return the relative change of survival (rows,) by tails that are lighter than those of a mean over strengths.

    With survival exp(-h) at `STRENGTHS`, few harmonics change it by (h'² s² - h'' m²)/2, in which s is the scatter and
    m² = (s² - 1/N)/2 a third of the excess kurtosis of the noise; a mean over strengths alone by (h'² - h'') s²/2.
    """
    hazards = [-np.log(np.maximum(survival, np.finfo(float).tiny)) for survival in survivals]
    return 0.25 * (scatter**2 + 1.0 / harmonics) * second_derivative(hazards)
