"""Integrations for `audit.py` that share no kernel with the engines: one motion, and paths under sampled noise.

Of the package they take the constants of a block (critical angle, saddles, scales, restitution) and the values of
pulses, chirps and envelopes. Equations are those of docs/theory.md, folded: u = s x, w = s v, on the side s.
"""

import itertools
import math
import time
from typing import Any, NamedTuple

import numba
import numpy as np
from audit_scenes import Draw
from scipy.integrate import solve_ivp
from scipy.linalg import expm, solve_continuous_lyapunov
from scipy.optimize import brentq

from fpk_rocking.scene import Record, Scene

G = 9.80665
ERROR, SLOW = 1e-11, 1e-9
STEPS = 400
"""Steps in a cycle, or in two units of time, of a path."""
REST = 1e-7
"""Velocity after an impact below which a sampled path rests until the force lifts it off."""
COARSER = 4
"""How many times longer the steps are that measure the error of the steps."""
_CHUNK = 2000
_compiled = numba.njit(nogil=True, cache=True, error_model="numpy")


class Constants(NamedTuple):
    """A block in numbers: critical angle, 0 if slender; cut-off; and by side (left, right) m, κ and e."""

    alpha: float
    cutoff: float
    saddle: tuple[float, float]
    scale: tuple[float, float]
    restitution: tuple[float, float]

    @classmethod
    def of(cls, scene: Scene) -> "Constants":
        """Constants of a scene's block."""
        block, sides = scene.block, ((1.0, 1.0), (1.0, 1.0))
        if not block.symmetric:
            sides = block.body.saddles, block.body.acceleration_scales
        return cls(block.critical_angle or 0.0, scene.overturning.angle, *sides, block.restitution_by_side)


def force_of(scene: Scene) -> Any:
    """Return the forcing as a function of an array of times."""
    forcing = scene.forcing
    if forcing.period is not None:
        waves = [(a, k * forcing.frequency, phase) for k, a, phase in forcing.components]
        return lambda t: -sum(a * np.cos(omega * np.asarray(t) + phase) for a, omega, phase in waves)
    if not isinstance(forcing, Record):
        return lambda t: forcing.values(np.atleast_1d(t)).reshape(np.shape(t))
    size = scene.block.size
    times = size.frequency_parameter * forcing.interval * np.arange(len(forcing.samples))
    factor = forcing.scale * G / (size.gravity * size.critical_angle)
    return lambda t: factor * np.interp(t, times, np.array(forcing.samples), right=0.0)


class Motion:
    """The one motion of a scene without noise that starts at a point, by scipy's DOP853 with events."""

    def __init__(self, scene: Scene) -> None:
        self.block, self.force, self.scene = Constants.of(scene), force_of(scene), scene
        angle, velocity = scene.start.angle, scene.start.velocity
        self.side = int(np.sign(angle) or np.sign(velocity))
        self.state = [abs(angle), self.side * velocity if self.side else 0.0]

    def outcome(self, times: np.ndarray) -> tuple[int, float, list[float]]:
        """Return side and time of overturning (0, nan), and angle and velocity at the last of the times."""
        end, forcing = float(times[-1]), self.scene.forcing
        knots = [0.0, end]
        if forcing.period is None:
            unit = forcing.duration / (len(forcing.samples) - 1) if isinstance(forcing, Record) else forcing.duration
            knots += [k * unit for k in range(1, round(forcing.duration / unit) + 1) if k * unit < end]
        knots.sort()
        for begin, stop in itertools.pairwise(knots):
            now = begin
            while now < stop - 1e-13 * (1.0 + stop):
                now = self._fly(now, stop) if self.side else self._rest(now, stop)
                if self.state[0] >= self.block.cutoff:
                    return self.side, now, [math.nan, math.nan]
        side = self.side or 1
        return 0, math.nan, [side * self.state[0], side * self.state[1]]

    def _excess(self, time, side):
        """Acceleration of a block at zero angle on a side."""
        return _python_acceleration(0.0, side * float(self.force(time)), side, self.block)

    def _rest(self, time, stop):
        """Return the time at which the block at rest lifts off, or the end of the piece."""
        grid = np.linspace(time, stop - 1e-12, max(50, int(200 * (stop - time))))
        first = None
        for side in (-1, 1):
            values = np.array([self._excess(t, side) for t in grid])
            above = np.flatnonzero(values > 0.0)
            if above.size:
                place = int(above[0])
                root = grid[0] if place == 0 else brentq(self._excess, grid[place - 1], grid[place], (side,), 1e-14)
                if first is None or root < first[0]:
                    first = root, side
        if first is None:
            return stop
        self.side, self.state = first[1], [0.0, 0.0]
        return min(first[0] + 1e-10, stop)

    def _fly(self, time, stop):
        """Follow a flight up to its impact, to overturning or to the end of the piece, and return when that is."""
        side, block, last = self.side, self.block, stop - 1e-13 * (1.0 + stop)

        def rates(t, state):
            """Rates of angle and velocity; at the end of a piece the force is that before a jump."""
            return [state[1], _python_acceleration(state[0], side * float(self.force(min(t, last))), side, block)]

        def impact(_, state):
            """Angle on the flight's side."""
            return state[0]

        def fall(_, state):
            """Angle beyond the cut-off."""
            return state[0] - block.cutoff

        def turn(_, state):
            """Velocity: where it falls through 0 the angle is largest."""
            return state[1]

        impact.terminal = fall.terminal = True
        impact.direction, fall.direction, turn.direction = -1, 1, -1
        # A first step beyond a low bounce would end below the floor, and the event would be found at its beginning.
        size = abs(rates(time, self.state)[1]) + 1e-3
        first = min(0.5 * (stop - time), max(0.2 * self.state[1] / size, 1e-9) if self.state[0] == 0.0 else 0.01)
        flight = solve_ivp(
            rates, (time, stop), self.state, "DOP853", events=(impact, fall, turn), rtol=ERROR, atol=1e-4 * ERROR,
            first_step=first, dense_output=True,
        )  # fmt: skip
        # An angle that passes the cut-off and comes back within a step is no event of its own.
        over = [when for when, (u, _) in zip(flight.t_events[2], flight.y_events[2], strict=True) if u >= block.cutoff]
        if over:
            self.state[0] = block.cutoff
            return float(brentq(lambda t: flight.sol(t)[0] - block.cutoff, time, over[0], xtol=1e-14))
        self.state = flight.y[:, -1].tolist()
        if flight.t_events[1].size:
            self.state[0] = block.cutoff
            return float(flight.t_events[1][0])
        if flight.t_events[0].size:
            speed = block.restitution[int(side > 0)] * abs(float(flight.y_events[0][0][1]))
            self.state = [0.0, speed]
            self.side = -side if speed > SLOW else 0
            return float(flight.t_events[0][0])
        return stop


def _python_acceleration(u, pull, side, block):
    """Acceleration u'' at the angle u under s f."""
    if block.alpha == 0.0:
        return u - 1.0 + pull
    phi = block.alpha * (block.saddle[int(side > 0)] - u)
    return block.scale[int(side > 0)] * (pull * math.cos(phi) - math.sin(phi) / block.alpha)


_acceleration = _compiled(_python_acceleration)


@_compiled
def _step(u, w, pull, t, side, block):
    """One step of the classical Runge-Kutta method under a constant force."""
    a = _acceleration(u, pull, side, block)
    b = _acceleration(u + 0.5 * t * w, pull, side, block)
    c = _acceleration(u + 0.5 * t * (w + 0.5 * t * a), pull, side, block)
    d = _acceleration(u + t * (w + 0.5 * t * b), pull, side, block)
    return u + t * w + t * t * (a + b + c) / 6.0, w + t * (a + 2.0 * b + 2.0 * c + d) / 6.0


@_compiled
def _turning(u, w, pull, t, side, block):
    """Time within t at which the velocity changes its sign."""
    low, high = 0.0, t
    for _ in range(40):
        middle = 0.5 * (low + high)
        if (_step(u, w, pull, middle, side, block)[1] > 0.0) == (w > 0.0):
            low = middle
        else:
            high = middle
    return high


@_compiled
def _landing(u, w, pull, t, side, block):
    """Time within t of the impact: the angle is below 0 at t."""
    low, high = 0.0, t
    fall = -_acceleration(u, pull, side, block)
    now = (w + math.sqrt(max(w * w + 2.0 * fall * u, 0.0))) / fall if fall > 0.0 else 0.5 * t
    for _ in range(60):
        if not low < now < high:
            now = 0.5 * (low + high)
        angle, velocity = _step(u, w, pull, now, side, block)
        if angle > 0.0:
            low = now
        else:
            high = now
        change = angle / velocity if velocity < 0.0 else 0.0
        if (velocity < 0.0 and abs(change) <= 1e-13 * now) or high - low <= 1e-13 * high:
            return now
        now -= change if velocity < 0.0 else now
    return high


@_compiled
def _advance(u, w, side, force, h, block):
    """(u, w, side, over) after a step h under a constant force, with all impacts in it."""
    left, impacts = h, 0
    while left > 0.0:
        if u == 0.0 and w == 0.0:
            if _acceleration(0.0, force, 1, block) > 0.0:
                side = 1
            elif _acceleration(0.0, -force, -1, block) > 0.0:
                side = -1
            else:
                return u, w, side, False
        pull = side * force
        end, (u1, w1) = left, _step(u, w, pull, left, side, block)
        lands = u1 <= 0.0
        if not lands and w * w1 < 0.0:
            turn = _turning(u, w, pull, left, side, block)
            u2 = _step(u, w, pull, turn, side, block)[0]
            if u2 >= block.cutoff:
                return u2, 0.0, side, True
            if u2 < 0.0 and w < 0.0:
                lands, end = True, turn
        if not lands:
            return u1, w1, side, u1 >= block.cutoff
        flight = _landing(u, w, pull, end, side, block)
        w = block.restitution[1 if side > 0 else 0] * abs(_step(u, w, pull, flight, side, block)[1])
        u, side, left, impacts = 0.0, -side, left - flight, impacts + 1
        if impacts > 200 or w < REST:
            w = 0.0
    return u, w, side, False


@_compiled
def _paths(angle, velocity, forces, h, block, over_side, over_step):
    """Follow paths under forces (paths, steps); write to which side, and in which step, each overturns."""
    for i in range(angle.size):
        u = abs(angle[i])
        side = 1 if angle[i] > 0.0 or (angle[i] == 0.0 and velocity[i] >= 0.0) else -1
        w, over_side[i], over_step[i] = side * velocity[i], 0, forces.shape[1] + 1
        if u >= block.cutoff:
            over_side[i], over_step[i] = side, 0
            continue
        for k in range(forces.shape[1]):
            u, w, side, over = _advance(u, w, side, forces[i, k], h, block)
            if over:
                over_side[i], over_step[i] = side, k + 1
                break


def sampled(draw: Draw, paths: int, seed: int, most_s: float = math.inf) -> tuple[np.ndarray, np.ndarray, int]:
    """Integrate paths under white or filtered noise that is sampled on a grid; fewer where they take too many seconds.

    Returns
    -------
    sides : ndarray, shape (rows, 2)
        Paths that have overturned to the left and to the right at the times that are looked at.
    changes : ndarray, shape (rows, 2)
        By how many these are more than with steps four times as long, under the same noise.
    paths : int
        How many there are.
    """
    scene, times = draw.scene, draw.times(draw.looked_at)
    longest = scene.forcing.time_scale / STEPS
    if scene.noise.kind == "filtered":
        longest = min(longest, 0.1 / float(np.abs(np.linalg.eigvals(scene.noise.space.drift)).max()))
    unit = COARSER * len(draw.looked_at) * (1 if draw.cycles is None else draw.looked_at[-1])
    count = unit * math.ceil(times[-1] / longest / unit)
    h = times[-1] / count
    ends = np.rint(times / h).astype(int)
    middles = h * (np.arange(count) + 0.5)
    known, envelope = np.asarray(force_of(scene)(middles), dtype=float) * np.ones(count), scene.noise.envelope
    strength = np.ones(count) if envelope is None else np.asarray(envelope.value(middles))
    rng, block = np.random.default_rng(seed), Constants.of(scene)
    sides, changes = np.zeros((2, len(ends), 2))
    until = time.process_time() + most_s
    for begin in range(0, paths, _CHUNK):
        size = min(_CHUNK, paths - begin)
        angle, velocity = _starts(scene, size, rng)
        forces = known + strength * _noise(scene.noise, size, count, h, rng)
        for factor in (1, COARSER):
            side, step = np.zeros((2, size), dtype=np.int64)
            grouped = forces if factor == 1 else forces.reshape(size, -1, factor).mean(axis=2)
            _paths(angle, velocity, grouped, factor * h, block, side, step)
            numbers = np.stack([[(step * factor <= end) & (side == s) for s in (-1, 1)] for end in ends]).sum(axis=2)
            sides += numbers if factor == 1 else 0
            changes += numbers if factor == 1 else -numbers
        if time.process_time() > until:
            return sides, changes, begin + size
    return sides, changes, paths


def _starts(scene, size, rng):
    """Angles and velocities at τ = 0."""
    start = scene.start
    if start.covariance is None:
        return np.full(size, float(start.angle)), np.full(size, float(start.velocity))
    return rng.multivariate_normal([start.angle, start.velocity], start.covariance, size).T.copy()


def _noise(noise, size, count, h, rng):
    """Noise (size, count): of white noise the mean over each step, of filtered noise the mean of its ends."""
    if noise.kind == "white":
        return math.sqrt(2.0 * noise.diffusion / h) * rng.standard_normal((size, count))
    space = noise.space
    drift, output = np.atleast_2d(space.drift), np.asarray(space.output)
    source = np.asarray(space.input)[:, None]
    covariance = solve_continuous_lyapunov(drift, -source @ source.T)
    scale = math.sqrt(noise.variance / float(output @ covariance @ output))
    carry = expm(drift * h)
    # Over a short step the covariance of a smooth filter is singular to rounding.
    sizes, vectors = np.linalg.eigh(covariance - carry @ covariance @ carry.T)
    kick = vectors * np.sqrt(np.maximum(sizes, 0.0))
    state = rng.standard_normal((size, len(drift))) @ np.linalg.cholesky(covariance).T
    values = np.empty((size, count + 1))
    values[:, 0] = state @ output
    for k in range(count):
        state = state @ carry.T + rng.standard_normal(state.shape) @ kick.T
        values[:, k + 1] = state @ output
    return 0.5 * scale * (values[:, 1:] + values[:, :-1])
