"""Which noise replaces a band in the density, by what that neglects: white noise, or filtered noise of 1 or 2 states.

All replacements have the band's Melnikov variance: they act alike on a block that remembers its flight before an
impact, whose weight of a frequency is 4/(1+ω²)². A block that an impact lets forget it has the weight 1/(1+ω²), and a
block of restitution e has a mean of both (`equivalence.response`). So two white noises, as strong as the band and as
its replacement for a block that forgets, tell how far apart the two can be: coarse densities under them are compared.
Of blocks that rest, white noise is right about none, and filtered noise about most. They are those that rattle next to
rest under white noise, the most at four times a cycle, and those that the band leaves at rest at the start.

A realization of N independent harmonics is stronger or weaker than another. Its density is a mean over strengths with
the scatter that a block sees which forgets (`equivalence.realized_spread` at e = 0); both are derived in docs/theory.
"""

import dataclasses
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from fpk_rocking.base.checks import Array
from fpk_rocking.physics.noise.equivalence import forgetful_diffusion, realized_spread
from fpk_rocking.scene.scene import Scene

REPLACEMENTS = "white", "exponential", "filtered"
"""Noises in place of a band, by the time that they take: none, one and two states more."""

UNCERTAIN_PART = 0.5
"""Part of what the mean over strengths changes that is uncertain: of 20 to 100 harmonics up to .25 was measured."""

_WRONG_AT_REST = {"white": 1.0, "exponential": 0.2, "filtered": 0.1}
"""Part of the blocks that may rest whose overturning a replacement may get wrong; measured: up to .5, .03, .07."""

_WIDEST, _LARGEST_SCATTER = 8.0, 0.5


class Choice(NamedTuple):
    """A replacement: its name, the scene with it, estimated errors of all candidates, and why it was chosen."""

    name: str
    scene: Scene
    errors: dict[str, float]
    reason: str

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
    (usual, resting), errors, scenes = solve(white), {}, {}
    resting = min(resting + _left_at_rest(scene), 1.0)
    for name in REPLACEMENTS:
        try:
            replaced = replaced_scene(scene, name)
            accepts(replaced)
        except ValueError:
            continue
        ratio = forgetful_diffusion(scene.noise) / forgetful_diffusion(replaced.noise)
        ratio = min(max(ratio, 1.0 / _WIDEST), _WIDEST)
        noise = dataclasses.replace(white.noise, diffusion=ratio * white.noise.diffusion)
        apart = float(np.abs(solve(dataclasses.replace(white, noise=noise))[0] - usual).max())
        scenes[name], errors[name] = replaced, apart + _WRONG_AT_REST[name] * resting
    if not scenes:
        accepts(white)
    enough = [name for name, error in errors.items() if error <= tol]
    name = enough[0] if enough else min(errors, key=lambda name: errors[name])
    texts = ", ".join(f"{other} {error:.1g}" for other, error in errors.items())
    why = f"the fastest within {tol:g}" if enough else f"the most accurate, as none is within {tol:g}"
    return Choice(name, scenes[name], errors, f"{name} noise is {why} (estimated errors: {texts})")


def _left_at_rest(scene):
    """Probability that the noise of a scene does not lift the block off at the start; 0.0 of one that does not rest."""
    start, level = scene.start, scene.block.lift_off
    if start.angle or start.velocity or start.covariance:
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
    noise = scene.noise
    if noise.kind != "band" or noise.frequencies == "stratified":
        return 0.0
    return min(realized_spread(noise, 0.0, scene.block.critical_angle), _LARGEST_SCATTER)


def strengths(scatter: float) -> list[tuple[float, float]]:
    """Pairs (strength, weight) whose mean is that over a normal strength of mean 1, less the value at strength 1."""
    step = math.sqrt(3.0) * scatter
    return [(1.0 - step, 1.0 / 6.0), (1.0, -1.0 / 3.0), (1.0 + step, 1.0 / 6.0)]
