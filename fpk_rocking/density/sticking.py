"""When a block at rest under white noise may be taken as sticking there, and what that changes.

Under a force |f| < 1 and white noise of diffusion D a block at rest rattles in a thin layer about x = v = 0. Its speeds
at impact have the scale w = 4D / (3 (1 - e²)(1 - f²)). It forgets its state at the rate 9 (1 - e²)² (1 - f²)² / (256 D)
of the slowest mode of its energy (docs/theory.md, section 5). Let M be the integral of this rate from the end of the
sticking to the next lift-off. Of what the layer would have been without the sticking, the part exp(-M) is left at the
lift-off, so survival changes by less than that.

All this holds for hops that are short beside the time in which the force changes. Faster blocks can hop on for ever
under |f| < 1, in step with the force, and neither they nor a layer that reaches so far may stick.

At x = 0 an exact block is pulled back by (sin α/α)(1 - s f/F), where F = tan α/α is the force that lifts it off. So it
is a slender one under f/F and noise of D/F², with angles and velocities over sin α/α.
"""

import math

import numpy as np

from fpk_rocking.base.types import Array
from fpk_rocking.density.resolution import in_rest
from fpk_rocking.density.space.space import Space
from fpk_rocking.density.step.dynamics import Dynamics
from fpk_rocking.density.tuning import TUNING
from fpk_rocking.physics.motion.block import gravity_at_contact, saddle_speed


class Sticking:
    """Times at which a block at rest may be taken as sticking there.

    Parameters
    ----------
    dynamics : Dynamics
        With white noise.
    end : float
        Last time that matters.
    forgetting : float
        The least M: the layer may remember the part exp(-M) of a block's state.
    """

    def __init__(self, dynamics: Dynamics, end, forgetting):
        self._edges = np.linspace(0.0, end, max(math.ceil(end / TUNING.sticking_interval), 2) + 1)
        alpha, level = dynamics.critical_angle, dynamics.lift_off
        self._gravity = gravity_at_contact(alpha)
        values = np.array([dynamics.forcing.value(time) for time in self._edges]) / level
        forces = np.abs(values)
        most = np.minimum(np.maximum(forces[1:], forces[:-1]), 1.0)
        noise = dynamics.diffusion / level**2 * np.ones(len(most))
        if dynamics.envelope is not None:
            noise *= np.diff(dynamics.envelope.squared_integral(self._edges)) / np.diff(self._edges)
        loss, gap = 1.0 - dynamics.restitution**2, 1.0 - most**2
        pull, steady = 3.0 * loss * gap, self._steady(values, 1.0 - most, 1.0 - dynamics.restitution)
        over = np.array([saddle_speed(level * force, alpha) for force in most]) / self._gravity
        slow = np.minimum(TUNING.rest_velocity / self._gravity, steady)
        inside = 4.0 * noise <= pull * (slow / TUNING.layer_inside)
        safe = 4.0 * noise <= pull * (over / TUNING.layer_safe)
        rate = np.full(len(most), math.inf)
        np.divide(9.0 * (loss * gap) ** 2, 256.0 * noise, out=rate, where=noise > 0.0)
        self._lifting = most >= 1.0
        forgotten = self._until_lift_off(rate)
        self._sticks = ~self._lifting & inside & safe & (forgotten >= forgetting)
        self._stopping = self._fastest_to_stop(0.8 * 0.5 * (1.0 - dynamics.restitution) * gap, steady)

    def _steady(self, forces, pull, loss):
        """Speeds (n,) up to which hops die out under a changing force, inf where it does not change.

        `forces` are at the edges of the n intervals, `pull` (n,) is the least pull in each and `loss` is 1 - e. Two
        hops in turn, of the speed w under the pull g, lose 2 (1 - e) w, and gain up to 4 |f''| w³/(3 g³).
        """
        bend = np.pad(np.abs(np.diff(forces, 2)) / self._edges[1] ** 2, 1, mode="edge")
        speeds = np.full(len(pull), math.inf)
        gain = np.maximum(bend[1:], bend[:-1])
        np.divide(1.5 * TUNING.hop_gain * loss * pull**3, gain, out=speeds, where=gain > 0.0)
        return np.sqrt(speeds)

    def _until_lift_off(self, rate):
        """Integral (n,) of a rate (n,), per time in each interval, from its end to the next lift-off.

        It is inf where there is none.
        """
        integral, total = np.empty(len(rate)), math.inf
        for k in range(len(rate) - 1, -1, -1):
            total = 0.0 if self._lifting[k] else total
            integral[k] = total
            total += 0.0 if self._lifting[k] else rate[k] * (self._edges[k + 1] - self._edges[k])
        return integral

    def _fastest_to_stop(self, rate, steady):
        """Largest speed (n,) at the begin of each interval that falls to 0, at a rate (n,), before the next lift-off.

        On its way it stays within the speed up to which hops die out, `steady` (n,).
        """
        fastest, speed = np.empty(len(rate)), math.inf
        for k in range(len(rate) - 1, -1, -1):
            later = speed + rate[k] * (self._edges[k + 1] - self._edges[k])
            speed = 0.0 if self._lifting[k] else min(steady[k], later)
            fastest[k] = speed
        return fastest

    def _interval(self, time):
        """Return the number of the interval that begins at a `time` or goes on there, the last one after the end."""
        return min(
            max(int(np.searchsorted(self._edges, time * (1.0 + 1e-12), side="right")) - 1, 0), len(self._sticks) - 1
        )

    def until(self, time: float) -> float:
        """Time until which a block at rest may stick from a `time` on; the time itself where it may not."""
        first = self._interval(time)
        later = self._sticks[first:]
        return math.inf if later.all() else max(float(self._edges[first + np.argmin(later)]), time)

    def next_lift_off(self, time: float) -> float:
        """Time, from a `time` on, at which the forcing next lifts a block off; that itself where it never does."""
        later = self._edges[:-1][self._lifting]
        later = later[later >= time]
        return float(later[0]) if later.size else time

    def stopping_cells(self, time: float, space: Space) -> Array:
        """Cells from which a block comes to rest before the next lift-off without noise, from a `time` on.

        They are a mask (angle cells, velocity cells) of the mesh of a `Space`. Under a constant force a block of the
        speed v does so within 2v / ((1 - e)(1 - f²)), the sum of its hops to both sides. A force that changes within a
        hop can keep it hopping for ever, though |f| < 1 (`_steady`).
        """
        angles, velocities = (0.5 * np.abs(lines[1:] + lines[:-1]) for lines in space.lines)
        speeds = np.sqrt(2.0 * angles[:, None] / self._gravity + (velocities / self._gravity) ** 2)
        slow = in_rest(angles, velocities) & (speeds <= self._stopping[self._interval(time)])
        return slow | cells_at_origin(space)


def cells_at_origin(space: Space) -> Array:
    """Mark the cells (angle cells, velocity cells) of the mesh of a `Space` that touch the origin."""
    angle, velocity = ((lines[:-1] <= 0.0) & (lines[1:] >= 0.0) for lines in space.lines)
    return np.outer(angle, velocity)


def density_at_rest(space: Space) -> Array:
    """Coefficients (``space.shape``) of a density of mass 1 that is even over the cells at the origin.

    It stands for a block at rest.
    """
    cells, coefficients = cells_at_origin(space), np.zeros(space.shape)
    coefficients[cells, 0, 0] = 1.0 / (cells.sum() * space.areas[cells])
    return coefficients
