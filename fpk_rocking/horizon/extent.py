"""How fast a block may start and still stand for a cycle: the velocity bound of a mesh for starts anywhere."""

import math

import numpy as np

from fpk_rocking.density.resolution import RESOLUTIONS
from fpk_rocking.density.space.mesh import velocity_bound
from fpk_rocking.density.space.tuning import TUNING
from fpk_rocking.horizon.leg import CycleLeg
from fpk_rocking.physics.motion.block import largest_correction

_SEEN = 1e-6
"""Part of the largest product of reach and chance below which a cell does not count."""


def plane_bound(white, motion):
    """Velocity that no block needs that stands for a cycle, wherever it starts at the scene's phase.

    A block that starts inward far faster than one from rest ever moves may lose so much at its impact that it stands.
    How fast that can be follows in closed form for the worst phase, and for the scene's own phase from a coarse mesh up
    to that bound: the cells that are reached from a start that stands for the cycle, before they overturn.

    Parameters
    ----------
    white : Scene
        With white noise.
    motion : Motion
        Where a mesh has to be fine.

    Returns
    -------
    float
        At least `velocity_bound`, nondimensional.
    """
    own, wide = velocity_bound(white, white.noise.diffusion), worst_bound(white)
    scout = CycleLeg(white, RESOLUTIONS[0].of(white, wide, motion, growth=TUNING.growth))
    chances = [scout.one]
    for _ in range(scout.count):
        chances.append(scout.turned(chances.pop()))
        for step in reversed(scout.run.leg):
            chances.append(step.apply_adjoint(chances[-1], np.zeros(3)))
    reached, used = np.where(_largest(chances[-1]) > _SEEN, 1.0, 0.0), np.zeros(scout.space.shape[1], dtype=bool)
    density = scout.one * reached[:, :, None, None]
    for _ in range(scout.count):
        for step in scout.run.leg:
            both = _largest(density) * _largest(chances.pop())
            used |= (both > _SEEN * both.max()).any(axis=0)
            density, _ = step.apply(density)
        density = scout.turned(density)
    lines = scout.space.velocity_lines
    fastest = max(-lines[:-1][used].min(initial=0.0), lines[1:][used].max(initial=0.0))
    return max(own, float(fastest))


def worst_bound(white):
    """Bound for every phase: to stand after an impact at v, e v must be below the speed of a sure escape.

    What is lost on the way to the impact is bounded by the cut-off, the swing of the forcing and eight standard
    deviations of the noise (derived in docs/theory, "One cycle as an operator").
    """
    swing, cutoff, noise = (
        white.forcing.swing,
        white.overturning.angle,
        TUNING.deviations * math.sqrt(white.noise.diffusion),
    )
    exact = largest_correction(white.forcing.largest, white.block.critical_angle)
    escape = max(1.0, cutoff - 1.0) + swing + exact + noise
    return escape / white.block.restitution + cutoff + 2.0 * swing + exact + noise


def _largest(coefficients):
    return np.abs(coefficients).max(axis=(2, 3))
