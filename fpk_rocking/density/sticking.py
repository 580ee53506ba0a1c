"""Times at which a block at rest, under white noise, may be taken as sticking there.

Under a force that does not lift it off and white noise a block at rest rattles in a thin layer about x = v = 0. On the
side s it is pulled back by g_s, and noise has the diffusion D_s there: for a slender block 1 - s f and D, for any other
κ (sin(α m)/α - s f cos(α m)) and D κ² cos²(α m), with the κ and m of the side. Two hops, one to each side, take
4w/h at the speed w, with the harmonic mean h of the pulls, and keep the part E of the speed, the product of the two
restitutions. Let D be the mean of D_s with the weights 1/g_s, the times spent on the sides. The speeds at impact have
the scale w = 4D / (3 (1 - E) h), and the block forgets its state at the rate 9 (1 - E)² h² / (256 D) of the slowest
mode of its energy (docs/theory.md, section 5). Let M be the integral of this rate from the end of the sticking to the
next lift-off. Of what the layer would have been without the sticking, the part exp(-M) is left at the
lift-off, so survival changes by less than that.

All this holds for hops that are short beside the time in which the force changes. Faster blocks can hop on for ever
under |f| < 1, in step with the force, and neither they nor a layer that reaches so far may stick.
"""

import math

import numpy as np

from fpk_rocking.base.checks import Array, not_none
from fpk_rocking.density.resolution import in_rest
from fpk_rocking.density.space import Space
from fpk_rocking.density.step.dynamics import Dynamics
from fpk_rocking.density.tuning import TUNING
from fpk_rocking.physics.motion.equation import contact_laws, saddle_speed


class Sticking:
    """Times at which a block at rest may be taken as sticking there."""

    def __init__(self, dynamics: Dynamics, end, forgetting):
        self._edges = np.linspace(0.0, end, max(math.ceil(end / TUNING.sticking_interval), 2) + 1)
        self._laws = contact_laws(dynamics.block)
        values = np.array([dynamics.forcing.value(time) for time in self._edges])
        # By side and edge. Both means are largest or least at an end of an interval.
        pulls = np.array([np.maximum(law.gravity - side * law.part * values, 0.0) for side, law in self._laws.items()])
        squares = [law.part**2 for law in self._laws.values()]
        gap = _least(2.0 * pulls[0] * pulls[1] / pulls.sum(axis=0))
        noise = -_least(-(squares[0] * pulls[1] + squares[1] * pulls[0]) / pulls.sum(axis=0)) * dynamics.diffusion
        if dynamics.envelope is not None:
            noise *= np.diff(dynamics.envelope.squared_integral(self._edges)) / np.diff(self._edges)
        sides = dynamics.block.sides
        restitution = sides.restitution if sides else [not_none(dynamics.block.restitution)] * 2
        loss, slowing = 1.0 - math.prod(restitution), 1.0 - 0.5 * sum(restitution)
        steady = self._steady(values * math.sqrt(max(squares)), _least(pulls.min(axis=0)), slowing)
        inside = 4.0 * noise <= 3.0 * loss * gap * (np.minimum(TUNING.rest_velocity, steady) / TUNING.layer_inside)
        safe = 4.0 * noise <= 3.0 * loss * gap * (self._over(values, dynamics.block) / TUNING.layer_safe)
        rate = np.full(len(gap), math.inf)
        np.divide(9.0 * (loss * gap) ** 2, 256.0 * noise, out=rate, where=noise > 0.0)
        self._lifting = gap <= 0.0
        forgotten = self._until_lift_off(rate)
        self._sticks = ~self._lifting & inside & safe & (forgotten >= forgetting)
        self._stopping = self._fastest_to_stop(0.8 * 0.5 * slowing * gap, steady)

    def _over(self, forces, block):
        """Return least speeds (n,) at which a block passes a saddle in each interval, by `forces` (n + 1,) at edges."""
        speeds = [
            saddle_speed(min(side * force, law.gravity / law.part), block.critical_angle, saddle, scale)
            for (side, law), saddle, scale in zip(self._laws.items(), block.saddles, block.scales, strict=True)
            for force in forces
        ]
        return _least(np.reshape(speeds, (2, -1)).min(axis=0))

    def _steady(self, forces, pull, loss):
        """Return speeds (n,) up to which hops die out under a changing force, inf where it does not change."""
        bend = np.pad(np.abs(np.diff(forces, 2)) / self._edges[1] ** 2, 1, mode="edge")
        speeds = np.full(len(pull), math.inf)
        gain = np.maximum(bend[1:], bend[:-1])
        np.divide(1.5 * TUNING.hop_gain * loss * pull**3, gain, out=speeds, where=gain > 0.0)
        return np.sqrt(speeds)

    def _until_lift_off(self, rate):
        """Return the integral (n,) of a `rate` (n,), per time in each interval, from its end to the next lift-off."""
        integral, total = np.empty(len(rate)), math.inf
        for k in range(len(rate) - 1, -1, -1):
            total = 0.0 if self._lifting[k] else total
            integral[k] = total
            total += 0.0 if self._lifting[k] else rate[k] * (self._edges[k + 1] - self._edges[k])
        return integral

    def _fastest_to_stop(self, rate, steady):
        """Return the largest speed (n,) at each interval's begin that falls to 0 at a `rate` (n,) before a lift-off."""
        fastest, speed = np.empty(len(rate)), math.inf
        for k in range(len(rate) - 1, -1, -1):
            later = speed + rate[k] * (self._edges[k + 1] - self._edges[k])
            speed = 0.0 if self._lifting[k] else min(steady[k], later)
            fastest[k] = speed
        return fastest

    def _interval(self, time):
        """Return the index, an int, of the interval that begins at a `time` or goes on there; the last after them."""
        return min(
            max(int(np.searchsorted(self._edges, time * (1.0 + 1e-12), side="right")) - 1, 0), len(self._sticks) - 1
        )

    def until(self, time: float) -> float:
        """Return the time until which a block at rest may stick from `time` on, maybe inf; `time` where it may not."""
        first = self._interval(time)
        later = self._sticks[first:]
        return math.inf if later.all() else max(float(self._edges[first + np.argmin(later)]), time)

    def next_lift_off(self, time: float) -> float:
        """Return the first time from `time` on at which the forcing lifts a block off; `time` where it never does."""
        later = self._edges[:-1][self._lifting]
        later = later[later >= time]
        return float(later[0]) if later.size else time

    def stopping_cells(self, time: float, space: Space) -> Array:
        """Return a mask (angle cells, velocity cells): from there a block comes to rest before the next lift-off."""
        angles, velocities = (0.5 * (lines[1:] + lines[:-1]) for lines in space.lines)
        gravity = np.where(angles > 0.0, self._laws[1].gravity, self._laws[-1].gravity)
        speeds = np.sqrt((2.0 * gravity * np.abs(angles))[:, None] + velocities**2)
        slow = in_rest(angles, velocities) & (speeds <= self._stopping[self._interval(time)])
        return slow | cells_at_origin(space)


def _least(edges):
    """Return the lesser of the values (n,) at both ends of each interval, of values `edges` (n + 1,) at the edges."""
    return np.minimum(edges[1:], edges[:-1])


def cells_at_origin(space: Space) -> Array:
    """Return a mask (angle cells, velocity cells) of the cells of a `Space`'s mesh that touch the origin."""
    angle, velocity = ((lines[:-1] <= 0.0) & (lines[1:] >= 0.0) for lines in space.lines)
    return np.outer(angle, velocity)


def density_at_rest(space: Space) -> Array:
    """Return coefficients (``space.shape``) of a density of mass 1 that is even over the cells at the origin."""
    cells, coefficients = cells_at_origin(space), np.zeros(space.shape)
    coefficients[cells, 0, 0] = 1.0 / (cells.sum() * space.areas[cells])
    return coefficients
