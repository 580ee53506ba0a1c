"""The pilot: a few sampled paths of a scene, which tell how far the motion goes and so where a mesh has to be fine.

Nothing of it enters a result: the mesh it leads to is refined like any other, and what it did not see is resolved by
cells that grow towards the cut-off and the velocity bound.
"""

import math
from typing import NamedTuple

import numpy as np

from fpk_rocking.base.jit import kernel
from fpk_rocking.density.step.characteristics import Exit, Noise, principal_axes, trace_point
from fpk_rocking.density.step.step import Dynamics
from fpk_rocking.physics.motion import TERMS
from fpk_rocking.physics.motion.flight import flight_covariance
from fpk_rocking.results.binning import centred_edges

PATHS = 256
"""Sampled paths."""

CYCLES = 12
"""Most cycles that they are followed for."""

LONGEST = 0.12
"""Longest step; the shortest period of the forcing has at least 6."""

USUAL_PART, NEARLY_ALL = 0.9, 0.998
"""Parts of the sampled states that `Motion` tells the range of."""


REST = 0.005, 0.1
"""Angle and velocity within which a block counts as being at rest: no mesh is made for less."""

LEAST_RANGE = 0.1, 0.5
"""Least widths of the ranges of angle and velocity: less counts as being at rest."""


BINS = 20
"""Bins an axis of the range of the motion."""


def in_rest(angles, velocities):
    """Mark the pairs (n, m) of angles (n,) and velocities (m,) that count as rest."""
    return np.outer(*(np.abs(values) < most for values, most in zip((angles, velocities), REST, strict=True)))


class Motion(NamedTuple):
    """How far a block moves before it overturns, over all sampled times; nondimensional.

    Parameters
    ----------
    angle, velocity : float
        |x| and |v| that `USUAL_PART` of the states are below.
    angles, velocities : tuple of float
        Lowest and highest angle and velocity of `NEARLY_ALL` of the states.
    fastest : float
        Largest |v| of all states.
    """

    angle: float
    velocity: float
    angles: tuple[float, float]
    velocities: tuple[float, float]
    fastest: float

    @property
    def edges(self):
        """Edges in angle and velocity of the bins in which two solutions are compared: `BINS` of them span a range."""
        return [centred_edges(*ends, BINS) for ends in (self.angles, self.velocities)]


def motion_of(white, times):
    """Sample some paths of a scene with white noise, always the same ones, and return their `Motion`.

    Parameters
    ----------
    white : Scene
        With white noise.
    times : ndarray, shape (n + 1,)
        That the density is wanted for, from 0 on; of a scene that repeats they are whole cycles.

    Returns
    -------
    Motion
    """
    dynamics, random = Dynamics.of(white), np.random.default_rng(0)
    spread = np.linalg.cholesky(np.array(white.start.covariance or np.zeros((2, 2))) + 1e-300 * np.eye(2))
    states = np.array([white.start.angle, white.start.velocity]) + _pairs(random) @ spread.T
    sides = np.sign(np.where(states[:, 0], states[:, 0], states[:, 1]))
    # The integers that a side is in every other kernel: of others the tracing would be compiled once more.
    sides = np.where(sides, sides, np.sign(white.forcing.value(0.0)) or 1.0).astype(np.int64)
    seen = [np.array([[dynamics.cutoff, 1.0]])]
    for segment, duration, diffusion, axes in _steps(white, dynamics, times):
        nodes = _pairs(random)
        follow(states, sides, segment, dynamics.block, Noise(duration, diffusion, nodes, nodes @ axes, 0.0))
        seen.append(states[sides > Exit.OVERTURNED_LEFT])
    seen = np.concatenate(seen[1:] if len(seen[1]) else seen)
    if not white.repeats:
        # Before and after a motion a block may rest for long, which must not decide how far it goes.
        moving = (np.abs(seen) >= REST).any(axis=1)
        seen = seen[moving] if moving.any() else seen
    usual = np.quantile(np.abs(seen), USUAL_PART, axis=0)
    fastest = float(np.abs(seen[:, 1]).max())
    ranges = np.quantile(seen, [0.5 - 0.5 * NEARLY_ALL, 0.5 + 0.5 * NEARLY_ALL], axis=0).T
    ranges += np.outer(np.maximum(LEAST_RANGE - np.ptp(ranges, axis=1), 0.0), [-0.5, 0.5])
    return Motion(*usual.tolist(), *(tuple(ends) for ends in ranges.tolist()), fastest)


def _steps(white, dynamics, times):
    """Yield segment, duration, diffusion and axes (2, 2) of the noise of the steps that paths are followed for."""
    longest = min(LONGEST, white.forcing.shortest_period / 6.0)
    if white.repeats:
        steps, cycles = math.ceil(white.period / longest - 1e-9), min(len(times) - 1, CYCLES)
        made = [_step(dynamics, k * white.period / steps, white.period / steps) for k in range(steps)]
        yield from made * cycles
        return
    steps = math.ceil(times[-1] / longest)
    for k in range(steps):
        yield _step(dynamics, k * times[-1] / steps, times[-1] / steps)


def _step(dynamics, start, duration):
    diffusion = dynamics.averaged_over(start, duration).diffusion
    axes = np.reshape(principal_axes(*flight_covariance(diffusion, duration)), (2, 2))
    return dynamics.segment(start, duration), duration, diffusion, axes


def _pairs(random):
    """Draw normal numbers (PATHS, 2), in pairs of either sign: the mirror image of a scene has mirrored paths."""
    half = random.standard_normal((PATHS // 2, 2))
    return np.concatenate([half, -half])


@kernel
def follow(states, sides, segment, block, noise):
    """Carry every path, in place, through a step of which one node of the noise is sampled; see `trace_point`.

    `sides` are +-1, +-2 for a path that has overturned there and stays.
    """
    scratch, codes = np.empty((4, TERMS)), np.empty(1, np.int32)
    for n in range(len(states)):
        if sides[n] <= Exit.OVERTURNED_LEFT:
            continue
        offsets = noise.offsets[n : n + 1]
        own = Noise(noise.duration, noise.diffusion, noise.nodes[n : n + 1], offsets, abs(offsets[0, 0]))
        trace_point(states[n, 0], states[n, 1], sides[n], segment, block, own, scratch, states[n : n + 1], codes)
        sides[n] = codes[0]
