"""What moves a block in a time step of the density, and the cells of the mesh that an event can reach.

Forcing, white noise and block move it. Bounds of the motion tell the cells: from their Gauss points begin
characteristics; all others are in free flight.
"""

import dataclasses
import functools
import math
from typing import NamedTuple

import numpy as np

from fpk_rocking.base.basis import gauss_legendre
from fpk_rocking.base.jit import kernel
from fpk_rocking.density.tuning import TUNING
from fpk_rocking.physics.forcing import Forcing
from fpk_rocking.physics.motion import TERMS, lift_off
from fpk_rocking.physics.motion.equation import (
    KernelBlock,
    acceleration_bounds,
    block_of_scene,
    contact_laws,
    force_factor,
    force_factors,
    segment_from_particular,
    tilt_angle,
)
from fpk_rocking.physics.motion.flight import flight_covariance
from fpk_rocking.physics.motion.slender import accumulated_covariance, affine_flights
from fpk_rocking.physics.noise.envelope import Envelope


@dataclasses.dataclass(frozen=True)
class Excess:
    """What the acceleration of an exact block has beyond that of the affine flights of a step.

    The affine flight is x'' = x + κ (-s sin φ₀/α + f cos φ₀), so that the excess c(x, t) is 0 at zero angle:
    c = κ [-s (sin φ - sin φ₀)/α + f (cos φ - cos φ₀)] - x, with φ = α (m - s x) and φ₀ = α m. Of equal sides m = κ = 1.
    """

    block: KernelBlock
    force: float  # f half way through the step
    shifts: np.ndarray  # (3,) by side: what affine flights from (0, 0) have added to the angle half way

    def __call__(self, angles, sides):
        """Return the excess c half way through the step at some angles on `sides`, ±1, arrays of one shape."""
        alpha, saddles = self.block.critical_angle, self.block.saddles
        sine, cosine = (_of_sides(sides, [part(alpha * m) for m in saddles]) for part in (math.sin, math.cos))
        phi = tilt_angle(angles, alpha, _of_sides(sides, saddles))
        turning = self.force * (np.cos(phi) - cosine)
        return _of_sides(sides, self.block.scales) * (turning - sides * (np.sin(phi) - sine) / alpha) - angles

    def force_factors(self, angles, sides):
        """Return the factors κ cos φ of force and noise in the acceleration at some angles on `sides`, ±1."""
        saddles, scales = (_of_sides(sides, pair) for pair in (self.block.saddles, self.block.scales))
        return force_factors(angles, self.block.critical_angle, saddles, scales)


def _of_sides(sides, pair):
    """Return the numbers of `sides`, ±1, from a `pair`, (left, right)."""
    return np.where(sides > 0.0, pair[1], pair[0])


@dataclasses.dataclass(frozen=True)
class Dynamics:
    """Forcing, white noise and block of a scene, as the steps of the density take them; nondimensional.

    With an envelope g the diffusion is D g², in a step at least D times `least_intensity`. `origin` is the time of the
    forcing and of g at which times here are 0.
    """

    forcing: Forcing
    diffusion: float
    block: KernelBlock
    envelope: Envelope | None = None
    least_intensity: float = TUNING.least_intensity
    origin: float = 0.0

    @classmethod
    def of(cls, scene):
        """Return the dynamics of a `Scene` with white noise."""
        diffusion = scene.noise.diffusion
        least = min(cls.least_intensity, TUNING.least_diffusion / diffusion if diffusion > 0.0 else math.inf)
        return cls(scene.forcing, diffusion, block_of_scene(scene), scene.noise.envelope, least)

    def later(self, time):
        """Return the dynamics whose times count from a `time` on."""
        return dataclasses.replace(self, origin=self.origin + time)

    def force(self, time):
        """Return the force f at a `time`."""
        return self.forcing.value(time + self.origin)

    def averaged_over(self, start, duration):
        """Return the dynamics with a constant diffusion: its mean over a step from `start` of a `duration`."""
        if self.envelope is None:
            return self
        begin, end = self.envelope.squared_integral(np.array([start, start + duration]) + self.origin)
        mean = max((end - begin) / duration, self.least_intensity)
        return dataclasses.replace(self, diffusion=self.diffusion * mean, envelope=None)

    def covariance(self, start, duration):
        """Return (xx, xv, vv), what noise adds to a slender flight without impact over a step."""
        if self.envelope is None:
            return flight_covariance(self.diffusion, duration)
        points, weights = gauss_legendre(16)
        late = duration * points[::-1]
        strength = np.maximum(self.envelope.value(start + duration - late + self.origin) ** 2, self.least_intensity)
        weights = 2.0 * self.diffusion * duration * weights * strength
        return tuple(float(part) for part in accumulated_covariance(weights, late))

    def segment(self, start, duration):
        """Return the `Segment`, the forcing over a step."""
        particular = self.forcing.particular_over(start + self.origin, duration)
        return segment_from_particular(particular, np.empty(TERMS), duration)

    def affine(self, start, duration):
        """Return the `AffineFlights` of both sides, without noise and events, over a `duration` from `start`.

        Of an exact block it is that whose acceleration is right at zero angle; `FreeFlight` adds the rest.
        """
        ends = start, start + duration
        particular = (value for time in ends for value in self.forcing.particular(time + self.origin))
        return affine_flights(*particular, duration, contact_laws(self.block))

    def excess(self, start, duration):
        """Return the `Excess` of an exact block over a step, None of a slender one."""
        if self.block.critical_angle is None:
            return None
        shifts = self.affine(start, 0.5 * duration).shifts[:, 0]
        return Excess(self.block, float(self.force(start + 0.5 * duration)), shifts)

    @property
    def largest_factor(self):
        """Bound of the factor by which noise moves the block, at least 1."""
        return max(1.0, *self.block.scales)

    @property
    def lift_off(self):
        """Largest |f| under which a block at rest stays: that of the side that falls more easily."""
        return min(self._lift_off_levels)

    @property
    def _lift_off_levels(self):
        """Largest force to the left, and to the right, under which a block at rest stays."""
        alpha = self.block.critical_angle or 0.0
        return [saddle * lift_off(alpha * saddle) for saddle in self.block.saddles]

    def rest_gap(self, time):
        """Return how far the force at a `time` is below lift-off to either side; below 0 where it lifts off."""
        (left, right), force = self._lift_off_levels, self.force(time)
        return min(right - force, left + force)

    def since_lift_off(self, time):
        """Return (elapsed, slope): time since |f| last rose through a side's level of lift-off, and d|f|/dτ there.

        They are as seen at `time`; (inf, 0) if the force never did so before.
        """
        left, right = self._lift_off_levels
        if left == right:
            return self._since_level(time, right)
        return min(self._since_level(time, left, -1), self._since_level(time, right, 1))

    def _since_level(self, time, level, side=None):
        """Return (elapsed, slope) since |f| on a `side`, ±1, or on both for None, last rose through a `level`."""
        force, earlier = _forcing_in_units_of(self.forcing, level), 0.0
        while earlier <= time:
            since, slope = force.since_lift_off(time - earlier + self.origin)
            crossed = time - earlier - since
            if side is None or math.isinf(since) or side * self.force(crossed) > 0.0:
                return earlier + since, level * slope
            earlier += since + 1e-9 * self.forcing.shortest_period
        return math.inf, 0.0


@functools.lru_cache(maxsize=8)
def _forcing_in_units_of(forcing, level):
    """Return `forcing` over a `level` of lift-off, the same object each time: it keeps its lift-offs."""
    return forcing.in_units_of(level)


class GaussPoints(NamedTuple):
    """Mesh lines, and Gauss points of a cell, g in angle and h in velocity."""

    angle_lines: np.ndarray
    velocity_lines: np.ndarray
    angle_points: np.ndarray  # (g,) on [0, 1]
    velocity_points: np.ndarray  # (h,)
    angle_weights: np.ndarray  # (g,)
    velocity_weights: np.ndarray  # (h,)
    angle_table: np.ndarray  # (g, modes), shape functions at the points
    velocity_table: np.ndarray  # (h, modes)


@kernel
def points_of_cell(i, j, points):
    """Return (side, angles, velocities) of cell (i, j): ±1, and the places (g,) and (h,) of its Gauss points."""
    angle, velocity = points.angle_lines, points.velocity_lines
    x = angle[i] + points.angle_points * (angle[i + 1] - angle[i])
    v = velocity[j] + points.velocity_points * (velocity[j + 1] - velocity[j])
    return (1 if angle[i] + angle[i + 1] > 0.0 else -1), x, v


@kernel
def is_event_free(low, high, slow, fast, side, segment, duration, block, margins):
    """Whether no path from a cell meets an impact in a step, and none past the cut-off may return.

    In folded coordinates s x, s v the cell is [low, high] in angle and [slow, fast] in velocity, on the side s, `side`;
    `margins` (2) are what noise adds to both. A path that passes the cut-off with a velocity that stays positive is
    beyond it at the end.
    """
    fall, rise = acceleration_bounds(side, segment.force_low, segment.force_high, block)
    least = min(low, low + slow * duration - 0.5 * max(fall, 0.0) * duration * duration)
    most = high + max(fast, 0.0) * duration + 0.5 * max(rise, 0.0) * duration * duration
    if least <= margins[0]:
        return False
    # The pull towards x = 0 is weaker than there by what the angle has gained, times the cosine that turns it.
    fall -= (least - margins[0]) * min(force_factor(0.0, side, block), force_factor(block.cutoff, side, block))
    return most < block.cutoff - margins[0] or slow - max(fall, 0.0) * duration > margins[1]


@kernel
def event_cells(angle_lines, velocity_lines, segment, duration, block, margins):
    """Return a mask (angle cells, velocity cells) of the cells that an event can reach within a step.

    `margins` (2) are what noise adds to angle and velocity.
    """
    marks = np.empty((len(angle_lines) - 1, len(velocity_lines) - 1), np.bool_)
    for i in range(marks.shape[0]):
        side = 1 if angle_lines[i] + angle_lines[i + 1] > 0.0 else -1
        low, high = min(abs(angle_lines[i]), abs(angle_lines[i + 1])), max(abs(angle_lines[i]), abs(angle_lines[i + 1]))
        for j in range(marks.shape[1]):
            slow, fast = side * velocity_lines[j], side * velocity_lines[j + 1]
            slow, fast = min(slow, fast), max(slow, fast)
            marks[i, j] = not is_event_free(low, high, slow, fast, side, segment, duration, block, margins)
    return marks
