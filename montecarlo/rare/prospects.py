"""The score of multilevel splitting: how near to the moving separatrix a block will come without further noise.

In the folded plane, u = s x >= 0 and w = s v, a flight has the separatrix z = 0, z = u + w - 1 - s (P + P')
(docs/theory section 7): z grows as exp(t), away from 0, so only an impact can bring a block from z < 0 nearer to
escape. The prospect of a state is the largest of its own z and of those right after the impacts of its motion without
noise within the next `AHEAD`. It does not depend on the noise and stays the same along a path without noise until its
largest z has passed: only the noise raises it. It is tabulated over angle, velocity and phase; a rough score costs
accuracy and never brings bias. The motion of an exact block is followed as it is, and z, to which its own separatrix
tends near the saddle, is taken all the same. Everything is nondimensional.
"""

import functools
import math
from typing import NamedTuple

import numpy as np
from numba import prange

from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion import TERMS
from fpk_rocking.physics.motion.equation import block_of, block_of_scene
from fpk_rocking.physics.motion.events import Event, next_event
from fpk_rocking.physics.motion.flight import unstable_coordinate
from fpk_rocking.physics.motion.impact import velocity_after_impact
from fpk_rocking.physics.motion.segment import Segment, force_from_particular

AHEAD = 7.0
"""Time for which the motion without noise is followed."""

_ANGLES, _VELOCITIES = 96, 192
"""Nodes of the table."""

_VALID = 0.8
"""Longest segment of the motion that is followed."""

_SLOW = 1e-3
"""Impacts that are slower end the motion: the block comes to rest."""


class Course(NamedTuple):
    """Noise-free forcing from each of the m times of a cycle on, for `stride` of the intervals between them.

    `particular`, `force` (m, TERMS), `low`, `high`, `curvature` (m,): segments of `duration`; `count` make up `AHEAD`.
    """

    particular: np.ndarray
    force: np.ndarray
    low: np.ndarray
    high: np.ndarray
    curvature: np.ndarray
    duration: float
    stride: int
    count: int
    restitution: float
    cutoff: float
    critical_angle: float | None


class Prospects(NamedTuple):
    """`table` (m, 2, n_angle, n_velocity): the prospects at the m times of a cycle, side < 0 or > 0, at u and w.

    u runs from 0 to the cut-off and w from -`fastest` to `fastest`; `per_angle`, `per_velocity`: cells per unit.
    """

    table: np.ndarray
    fastest: float
    per_angle: float
    per_velocity: float


@functools.lru_cache(maxsize=1)
def prospects_of(scene, intervals):
    """Return the `Prospects` of a scene with white noise between equal intervals of a cycle; the last one is kept."""
    cutoff, span = scene.overturning.angle, scene.period / intervals
    # No faster block falls back, nor comes in from a fall (docs/theory section 7).
    fastest = 1.0 + scene.forcing.swing + 8.0 * math.sqrt(scene.noise.diffusion)
    course = _course(scene, intervals, span)
    table = np.empty((intervals, 2, _ANGLES, _VELOCITIES), np.float32)
    _fill(table, course, fastest)
    return Prospects(table, fastest, (_ANGLES - 1) / cutoff, (_VELOCITIES - 1) / (2.0 * fastest))


def _course(scene, intervals, span):
    # Segments as long as their polynomials are good.
    stride = max(1, int(min(_VALID, scene.forcing.longest_piece) / span))
    duration = stride * span
    particular, force = scene.forcing.pieces(np.arange(intervals) * span), np.empty((intervals, TERMS))
    low, high, curvature = np.empty((3, intervals))
    for j in range(intervals):
        low[j], high[j], curvature[j] = force_from_particular(particular[j], duration, force[j])
    ahead = (duration, stride, math.ceil(AHEAD / duration), *block_of_scene(scene))
    return Course(particular, force, low, high, curvature, *ahead)


@kernel
def _ahead(u, w, side, j, course):
    """Prospects of a state at time j of the cycle; a block is followed until it escapes or comes to rest."""
    best = unstable_coordinate(u, w, side, course.particular[j], 0.0)
    x, v = side * u, side * w
    for _ in range(course.count):
        segment = Segment(course.particular[j], course.force[j], course.low[j], course.high[j], course.curvature[j])
        t = 0.0
        while t < course.duration and best <= 0.0:
            kind, t, x, v = next_event(x, v, side, segment, t, course.duration, block_of(course))
            if kind == Event.OVERTURNING or (kind == Event.IMPACT and abs(v) < _SLOW):
                return best
            if kind == Event.IMPACT:
                v, side = velocity_after_impact(v, course.restitution), -side
                best = max(best, unstable_coordinate(0.0, side * v, side, course.particular[j], t))
        j = (j + course.stride) % course.low.size
    return best


@kernel(parallel=True)
def _fill(table, course, fastest):
    times, sides, angles, velocities = table.shape
    for row in prange(times * sides * angles):
        j, k, a = row // (sides * angles), (row // angles) % sides, row % angles
        u = course.cutoff * a / (angles - 1)
        for b in range(velocities):
            w = fastest * (2.0 * b / (velocities - 1) - 1.0)
            table[j, k, a, b] = _ahead(u, w, 2 * k - 1, j, course)


@kernel
def prospect(u, w, side, j, prospects):
    """Prospect of a state at time j of the cycle, bilinear between the table's nodes; beyond them, that at its edge."""
    table = prospects.table[j, (side + 1) // 2]
    a = min(max(u * prospects.per_angle, 0.0), table.shape[0] - 1.0)
    b = min(max((w + prospects.fastest) * prospects.per_velocity, 0.0), table.shape[1] - 1.0)
    i, k = min(int(a), table.shape[0] - 2), min(int(b), table.shape[1] - 2)
    a, b = a - i, b - k
    near = (1.0 - b) * table[i, k] + b * table[i, k + 1]
    far = (1.0 - b) * table[i + 1, k] + b * table[i + 1, k + 1]
    return (1.0 - a) * near + a * far
