"""A rocking block followed from event to event at 50 digits: the reference for event-driven engines.

It knows nothing of the kernels. Flights are closed forms, the particular solution is the exact sum over all harmonics,
no event is missed (`mp_motion`), and the numbers that describe force and block are taken as exact.

Beside the path runs a first-order bound of how far another exact but rounded path may have come apart from it. An
error vector of size up to `rounding` enters with every flight and impact and is carried on by the path's derivative,
M(t) in flight and the saltation matrix at an impact. With C the sum of the squares of n such vectors, no component of
their sum exceeds sqrt(n C_ii): where chaos has let that grow beyond what a comparison asks for is the horizon of it.
"""

import copy
import math
from dataclasses import dataclass, field

import mpmath
import numpy as np
from mp_motion import Motion, UndecidedError, next_event, polish
from mpmath import mp, mpf

AT_REST = mpf("1e-20")
"""Speed after an impact below which the rest of the chatter is summed as a geometric series."""


@dataclass
class Event:
    """What happened at `time`: "impact" (`velocity` is that before it), "rest", "uplift" or "overturning".

    `late` and `off` bound the errors of time and velocity of a path that was rounded otherwise.
    """

    time: mpf
    kind: str
    velocity: mpf
    late: float
    off: float


@dataclass
class State:
    """Angle, velocity and side (0 at rest) at `time`, and the bound of another path's errors in either."""

    time: mpf
    angle: mpf
    velocity: mpf
    side: int
    bound: float


@dataclass
class Path:
    """A path: its events, and its states at the times asked for, up to overturning."""

    events: list = field(default_factory=list)
    states: list = field(default_factory=list)

    @property
    def overturned(self):
        return bool(self.events) and self.events[-1].kind == "overturning"


class Spread:
    """The sum C of the squares of n error vectors, as its factor F, C = F F^T."""

    def __init__(self, rounding):
        self.rounding = rounding
        self.reset()

    def reset(self):
        self.factor, self.count = self.rounding * np.eye(2), 1

    def carry(self, linear):
        """Carry all errors on by a linear map and add a new one."""
        vectors = np.hstack([linear @ self.factor, self.rounding * np.eye(2)])
        self.factor, self.count = np.linalg.qr(vectors.T, mode="r").T, self.count + 1

    def fly(self, duration):
        cosh, sinh = math.cosh(duration), math.sinh(duration)
        self.carry(np.array([[cosh, sinh], [sinh, cosh]]))

    def along(self, *row):
        """Bound of a linear function of angle and velocity."""
        return math.sqrt(self.count) * float(np.linalg.norm(row @ self.factor))


def follow(signal, restitution, cutoff, angle, velocity, times, digits=50, rounding=2e-14):
    """Follow a block from `times[0]`, where it has the given state, to `times[-1]`.

    Parameters
    ----------
    signal : mp_motion.Signal
        The force.
    restitution, angle, velocity : float or mpf
    cutoff : float
    times : sequence of float or mpf
        Ascending; states are wanted at these times.
    digits : int
        Digits after the point to which an event is right; 15 more are carried, and errors grow along the path.
    rounding : float
        Error of the path to which this one is to be compared, in angle and velocity for each flight and impact.

    Returns
    -------
    Path

    Raises
    ------
    UndecidedError
        Something hangs on digits beyond those carried: a touch lighter than that, or a rest under |f| = 1.
    """
    with mp.workdps(digits + 15):
        follower = _Follower(signal, mpf(restitution), cutoff, [mpf(t) for t in times], rounding)
        follower.begin(mpf(angle), mpf(velocity))
        while follower.time < follower.times[-1] and not follower.path.overturned:
            follower.step()
        return follower.path


class _Follower:
    """The path so far: `time`, the waves there, side (0 at rest), folded angle `u` and velocity `w`."""

    def __init__(self, signal, restitution, cutoff, times, rounding):
        self.signal, self.e, self.cutoff, self.times = signal, restitution, cutoff, times
        self.path, self.spread = Path(), Spread(rounding)

    def begin(self, x, v):
        self.time, self.waves = self.times[0], self.signal.waves(self.times[0])
        self.side = int(mpmath.sign(x) or mpmath.sign(v))
        self.u, self.w = self.side * x, self.side * v
        self.zeros = 0 if x else 1
        if self.u >= self.cutoff:
            self.log("overturning", v)
        elif self.side == 0:
            self.settle()

    def settle(self):
        """Rest at x = 0 without velocity, unless the force lifts the block."""
        (force,) = self.signal.force.derivatives(self.waves, 1)
        if abs(abs(force) - 1) < mpf(10) ** (15 - mp.dps):
            raise UndecidedError("rest under a force of 1")
        self.side, self.u, self.w, self.zeros = 0, mp.zero, mp.zero, 2
        if abs(force) > 1:
            self.side = int(mpmath.sign(force))
        else:
            self.log("rest")

    def step(self):
        """Go on to the next event."""
        longest = float(self.times[-1] - self.time) * (1.0 + 1e-15)
        motion = self.rest() if self.side == 0 else self.flight()
        event = next_event(motion, longest)
        time = mp.inf
        if event:
            level = event[2]
            time, waves, derivatives = polish(motion, *event)
        self.see(time, motion)
        if time > self.times[-1]:
            self.time = self.times[-1]
            return
        duration, self.time, self.waves = float(time - self.time), time, waves
        if self.side == 0:
            self.side, self.u, self.w, self.zeros = (-1 if level else 1), mp.zero, mp.zero, 3
            self.spread.reset()
            self.log("uplift")
            return
        self.spread.fly(duration)
        v, a = (float(self.side * derivatives[k]) for k in (1, 2))
        bounds = self.spread.along(1.0 / v, 0.0), self.spread.along(-a / v, 1.0)
        self.log("overturning" if level else "impact", self.side * derivatives[1], *bounds)
        if not level:
            self.land(derivatives[1])

    def rest(self):
        return Motion(self.signal, self.signal.force, -1, self.time, self.waves, 2.0)

    def flight(self):
        p, q = (self.side * value for value in self.signal.particular.derivatives(self.waves, 2))
        up, down = (self.u - 1 - p + self.w - q) / 2, (self.u - 1 - p - self.w + q) / 2
        terms = self.signal.particular
        return Motion(self.signal, terms, self.side, self.time, self.waves, self.cutoff, up, down, self.zeros)

    def land(self, slope):
        (force,) = self.signal.force.derivatives(self.waves, 1)
        before, after = float(force) - self.side, float(force) + self.side
        e = float(self.e)
        self.spread.carry(np.array([[e, 0.0], [(after - e * before) / float(self.side * slope), e]]))
        self.side, self.u, self.w, self.zeros = -self.side, mp.zero, -self.e * slope, 1
        if self.w == 0:
            self.settle()
        elif self.w < AT_REST and self.e < 1:
            self.sum_chatter(force)

    def sum_chatter(self, force):
        """Rest after a geometric series of bounces, if 1 - |f| surely changes by less than a thousandth meanwhile."""
        gap = 1 - abs(force)
        if gap > 0:
            longest = 2 * self.w / (gap * (1 - self.e))
            slope = abs(self.signal.force.derivatives(self.waves, 2)[1]) + self.signal.force.sizes[2] * longest
            if slope * longest < gap / 1000:
                against, along = 1 - self.side * force, 1 + self.side * force
                self.time += 2 * self.w / (1 - self.e**2) * (1 / against + self.e / along)
                self.waves = self.signal.waves(self.time)
                self.settle()

    def log(self, kind, velocity=mp.zero, late=0.0, off=0.0):
        self.path.events.append(Event(self.time, kind, velocity, late, off))

    def see(self, until, motion):
        """Note the states at the times asked for that come before `until`."""
        for time in self.times[len(self.path.states) :]:
            if time >= until:
                break
            if self.side == 0:
                self.path.states.append(State(time, mp.zero, mp.zero, 0, 0.0))
                continue
            u, w = motion.derivatives(time - motion.time, self.signal.waves(time), 2)
            there = copy.copy(self.spread)
            there.fly(float(time - motion.time))
            bound = max(there.along(1.0, 0.0), there.along(0.0, 1.0))
            self.path.states.append(State(time, self.side * u, self.side * w, self.side, bound))
