"""A rigid body on two corners in metres and seconds by scipy's DOP853: the independent check of bodies.

Nothing nondimensional enters, no angle φ and no formula of a restitution. With the place (x, y) of the centre of mass
from the corner that carries the body, the torque of gravity and of the moving base turns it, (r² + x² + y²) θ'' =
(g + a_v) x + a y, and an impact keeps the angular momentum about the other corner. θ > 0 leans to the right, where a
base acceleration a > 0 throws the body.
"""

import bisect
import math

import numpy as np
from scipy.integrate import solve_ivp

SLOW = 1e-9
"""Angular velocity after an impact, rad/s, below which a body that is pressed down counts as at rest."""


class BodyInMetres:
    """A body from rest under the accelerations `base(t)` and `upward(t)`, m/s², until an angle `fallen`, radians.

    `lengths`: height of the centre, its distances from the right and from the left corner, radius of gyration. `kinks`
    (n,) are the times, seconds, between which the accelerations are smooth. `events` lists (time, angular velocity
    before the impact, side), and `outcome` is (time, side), or (nan, 0).
    """

    def __init__(self, lengths, gravity, base, kinks, fallen, upward=lambda _: 0.0):
        self.height, self.right, self.left, self.radius = lengths
        self.gravity, self.upward, self.base, self.kinks, self.fallen = gravity, upward, base, sorted(kinks), fallen
        self.time, self.state, self.side = 0.0, np.zeros(2), 0
        self.events, self.outcome, self.late = [], (math.nan, 0), 0.0

    def distance(self, side):
        """Horizontal distance of the centre of mass from the corner of a side."""
        return self.right if side > 0 else self.left

    def centre(self, angle, side):
        """Place of the centre of mass from the corner of a side."""
        x, y = -side * self.distance(side), self.height
        sine, cosine = math.sin(angle), math.cos(angle)
        return x * cosine + y * sine, y * cosine - x * sine

    def turning(self, time, angle, side):
        """Angular acceleration, rad/s²."""
        x, y = self.centre(angle, side)
        return ((self.gravity + self.upward(time)) * x + self.base(time) * y) / (self.radius**2 + x * x + y * y)

    def impact(self, rate):
        """Angular velocity after the impact of the body that leaves its side."""
        x, y = self.centre(0.0, self.side)
        forward, upward = rate * y, -rate * x
        x, y = self.centre(0.0, -self.side)
        momentum = self.radius**2 * rate + y * forward - x * upward
        return momentum / (self.radius**2 + x * x + y * y)

    def run(self, end):
        """Follow the body to the time `end`, seconds, or to its fall."""
        while self.time < end and self.outcome[1] == 0:
            place = bisect.bisect_right(self.kinks, self.time + 1e-12)
            stop = min(end, self.kinks[place]) if place < len(self.kinks) else end
            if self.side == 0:
                self.rest(stop)
            else:
                self.fly(stop)
        return self

    def pressed(self, time, side):
        """How far the base is from lifting the body to a side, m/s²."""
        return (self.gravity + self.upward(time)) * self.distance(side) / self.height - side * self.base(time)

    def rest(self, stop):
        """Wait for the lift-off, to `stop` at most."""
        times = np.linspace(self.time + 1e-12, stop, 20 + math.ceil(1e3 * (stop - self.time)))
        found = []
        for side in (1, -1):
            for k in np.flatnonzero(np.array([self.pressed(time, side) for time in times]) < 0.0)[:1]:
                low, high = (times[k - 1], times[k]) if k else (times[0], times[0])
                for _ in range(60):
                    middle = 0.5 * (low + high)
                    low, high = (middle, high) if self.pressed(middle, side) > 0.0 else (low, middle)
                found.append((high, side))
        self.time, self.side = min(found) if found else (stop, 0)
        self.state = np.zeros(2)

    def solve(self, start, state, stop, events=None, first=None):
        """Integrate a flight."""
        side = self.side
        return solve_ivp(
            lambda t, y: (y[1], self.turning(t, y[0], side)),
            (start, stop),
            state,
            "DOP853",
            events=events,
            first_step=first,
            max_step=0.06 * math.sqrt((self.radius**2 + self.height**2) / (self.gravity * self.height)),
            rtol=1e-13,
            atol=1e-15,
        )

    def fly(self, stop):
        """Fly to `stop`, or to the first impact or the fall."""
        side = self.side

        def lands(_, y):
            return side * y[0]

        def falls(_, y):
            return self.fallen - side * y[0]

        lands.terminal = falls.terminal = True
        lands.direction = falls.direction = -1
        start, first = self.time, None
        if self.state[0] == 0.0:
            bounce = abs(self.state[1] / self.turning(start, 0.0, side)) if self.state[1] else math.inf
            first = min(0.5 * bounce, 0.002, stop - start)
        path = self.solve(start, self.state, stop, (lands, falls), first)
        self.time, self.state = path.t[-1], path.y[:, -1]
        if path.status == 0:
            return
        # From the step before, and to the event by Newton's iteration.
        level = 0.0 if path.t_events[0].size else side * self.fallen
        before = max(len(path.t) - 2, 0)
        self.state = self.solve(path.t[before], path.y[:, before], self.time).y[:, -1]
        late = (self.state[0] - level) / self.state[1]
        rate = self.state[1] - late * self.turning(self.time, level, side)
        self.time -= late
        if level:
            self.outcome = self.time, side
            return
        self.events.append((self.time, rate, side))
        rate, self.side = self.impact(rate), -side
        self.state = np.array([0.0, rate])
        if abs(rate) < SLOW and self.pressed(self.time, 1) > 0.0 and self.pressed(self.time, -1) > 0.0:
            self.side, self.state = 0, np.zeros(2)
