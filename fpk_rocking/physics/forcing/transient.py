"""Forcing that ends: its particular solution from its Taylor series.

The bounded particular solution is P = -½ (L + R), with P' = ½ (L - R), where L(τ) = ∫ exp(-(τ-s)) f(s) ds up to τ and
R(τ) = ∫ exp(-(s-τ)) f(s) ds from τ on. Both are sums over the intervals of a grid that no kink of f falls into. P and
P' are continuous whatever jumps f has, and P falls off like exp(-τ) after the end.
"""

import abc
import functools
import itertools
import math

import numpy as np

from fpk_rocking.base.basis import gauss_legendre
from fpk_rocking.base.checks import Array, ArrayLike
from fpk_rocking.physics.forcing.base import Forcing
from fpk_rocking.physics.motion import LIFT_OFF, TERMS
from fpk_rocking.physics.motion.slender import forced_response, linear_force_response, particular_series


class TransientForcing(Forcing):
    """A forcing that is 0 from `duration` on, and does not repeat; everything is nondimensional.

    A kind is a frozen dataclass with `duration`, `shortest_period`, `largest`, `steepest`, `time_scale`, `series` and
    `scaled`, and `unit` where f has kinks or jumps other than at its ends. It has a ``__dict__``, in which results are
    kept.
    """

    period = None
    half_antisymmetric = False
    longest_rest = math.inf

    @property
    def unit(self) -> float:
        """Spacing of a grid from 0 on that all kinks and jumps of f fall on; it divides the duration."""
        return self.duration

    @abc.abstractmethod
    def series(self, times: Array) -> Array:
        """Taylor coefficients (n, TERMS) of f about times (n,); at a kink, of the piece that begins there."""

    @property
    def longest_piece(self) -> float:
        return min(0.8 * self.shortest_period / (2.0 * math.pi), 0.5)

    def spacing(self, longest: float) -> float:
        return self.unit / math.ceil(self.unit / longest - 1e-9)

    def pieces(self, instants: ArrayLike) -> Array:
        times = np.asarray(instants, dtype=float)
        spacing, states = self._grid
        last = len(states) - 1
        node = np.minimum((times / spacing + 1e-9).astype(np.int64), last)
        since = times - node * spacing
        p, q = states[node].T
        near = particular_series(p, q, self.series(node * spacing))
        # After the end P = P(end) exp(-since); a piece from there need not reach as far.
        decay = np.exp(-since)
        ended = node == last
        # Instants on a grid have few such times, and a power costs as much as all else of an instant.
        few, place = np.unique(since, return_inverse=True)
        powers, order = (few[:, None] ** np.arange(TERMS))[place], np.arange(1, TERMS)
        p = np.where(ended, p * decay, (near * powers).sum(axis=1))
        q = np.where(ended, q * decay, (near[:, 1:] * order * powers[:, :-1]).sum(axis=1))
        return particular_series(p, q, self.series(times))

    def particular_over(self, start: float, duration: float) -> Array:
        """Coefficients of P over a step; with kinks in it, of a linear force that ends flights in the same state."""
        first, last = (
            int(np.floor(time / self.unit + shift)) for time, shift in ((start, 1e-6), (start + duration, -1e-6))
        )
        if last <= first or start >= self.duration:
            return self.pieces([start])[0]
        (p0, q0), (p1, q1) = self.particular(start), self.particular(start + duration)
        force = np.zeros((1, TERMS))
        force[0, :2] = np.linalg.solve(linear_force_response(duration), forced_response(p0, q0, p1, q1, duration))
        return particular_series(np.array([p0]), np.array([q0]), force)[0]

    @functools.cached_property
    def _grid(self) -> tuple[float, Array]:
        """(spacing, states): a grid of n intervals from 0 to the end, and (P, P') at its nodes (n + 1, 2)."""
        spacing = self.spacing(min(0.2, self.longest_piece))
        count = round(self.duration / spacing)
        points, point_weights = gauss_legendre(12, -1.0, 1.0)
        inside = 0.5 * spacing * (1.0 + points)
        order = np.arange(TERMS)
        forces = self.series(np.arange(count) * spacing) @ (inside ** order[:, None])
        weights = 0.5 * spacing * point_weights
        before, after = forces @ (weights * np.exp(inside - spacing)), forces @ (weights * np.exp(-inside))
        fade = math.exp(-spacing)
        left, right = (
            np.array(list(itertools.accumulate(gains.tolist(), lambda last, gain: last * fade + gain, initial=0.0)))
            for gains in (before, after[::-1])
        )
        right = right[::-1]
        return spacing, np.stack([-0.5 * (left + right), 0.5 * (left - right)], axis=-1)

    def particular(self, time: float) -> tuple[float, float]:
        if time not in self._particulars:
            ((value, slope, *_),) = self.pieces([time])
            self._particulars[time] = float(value), float(slope)
        return self._particulars[time]

    @functools.cached_property
    def _particulars(self) -> dict[float, tuple[float, float]]:
        """What `particular` has returned, by time."""
        return {}

    def values(self, times: ArrayLike) -> Array:
        """Force (n,) at times (n,); at a jump, that after it."""
        return self.series(np.asarray(times, dtype=float))[:, 0]

    def value(self, time: float) -> float:
        return float(self.values([time])[0])

    def stage_values(self, spacing: float, count: int) -> Array:
        parts = (spacing * np.array([[0.0], [0.5], [1.0]])) ** np.arange(TERMS)
        return self.series(np.arange(count) * spacing) @ parts.T

    def slope(self, time: float) -> float:
        return float(self.series(np.array([time]))[0, 1])

    @functools.cached_property
    def swing(self) -> float:
        # Both change by less than the force and themselves, so between samples by no more than over their distance.
        times = self._sample_times
        p, q = self.pieces(times)[:, :2].T
        largest = float(max(np.abs(p + q).max(), np.abs(p - q).max()))
        return largest + times[1] * max(largest, self.largest)

    @functools.cached_property
    def largest_velocity(self) -> float:
        # It is reached at an end of a piece or where f changes its sign.
        spacing = self.spacing(self.longest_piece)
        force = self.series(np.arange(round(self.duration / spacing)) * spacing)
        order = np.arange(TERMS)
        gain = (force * spacing ** (order + 1) / (order + 1)).sum(axis=1)
        velocity = np.concatenate([[0.0], np.cumsum(gain)])
        end = (force * spacing**order).sum(axis=1)
        turning = np.flatnonzero(force[:, 0] * end < 0.0)
        low, high = np.zeros(turning.size), np.full(turning.size, spacing)
        for _ in range(50):  # halvings to rounding
            middle = 0.5 * (low + high)
            before = (force[turning] * middle[:, None] ** order).sum(axis=1) * force[turning, 0] > 0.0
            low, high = np.where(before, middle, low), np.where(before, high, middle)
        turns = velocity[turning] + (force[turning] * low[:, None] ** (order + 1) / (order + 1)).sum(axis=1)
        return float(np.abs(np.concatenate([velocity, turns])).max())

    @property
    def _sample_times(self) -> Array:
        """Times (n,) from 0 to the end, an eighth of the grid's spacing apart."""
        spacing = self._grid[0] / 8
        return np.arange(round(self.duration / spacing) + 1) * spacing

    @functools.cached_property
    def _lift_offs(self) -> Array:
        """Times (n,) at which |f| rises through 1, ascending."""
        grid = self._sample_times
        above = np.concatenate([[False], np.abs(self.values(grid[:-1])) > LIFT_OFF, [False]])
        rises: list[float] = []
        for place in np.flatnonzero(above[1:] & ~above[:-1]).tolist():
            low, high = grid[max(place - 1, 0)], grid[place]
            for _ in range(60):
                middle = 0.5 * (low + high)
                if abs(self.value(middle)) > LIFT_OFF:
                    high = middle
                else:
                    low = middle
            rises.append(high)
        return np.array(rises)

    def since_lift_off(self, time: float) -> tuple[float, float]:
        rises = self._lift_offs
        before = rises[rises <= time + 1e-12 * self.duration]
        if not before.size:
            return math.inf, 0.0
        return max(time - float(before[-1]), 0.0), abs(self.slope(float(before[-1])))
