"""A rocking block followed by scipy's DOP853, with rules of contact of its own: the independent check of the kernels.

It knows nothing of closed forms or of the kernels. Beside the state it carries a first-order bound of how far two exact
but differently rounded paths may have come apart: errors of `ROUNDING` enter with every flight and impact, grow like
exp(t) in flight and by the norm of the saltation matrix at an impact, and vanish when the block comes to rest.
"""

import math
from dataclasses import dataclass, field

import numpy as np
from scipy.integrate import solve_ivp

ROUNDING = 2e-14
"""Error of one integration or one impact time, at rtol 1e-13."""

AT_REST = 1e-8
"""Speed after an impact below which chatter under |f| < 1 is taken as rest."""


@dataclass
class Block:
    """A block under f = -A cos(Omega t + Psi); `side` is 0 at rest; `events` lists (time, name)."""

    amplitude: float
    frequency: float
    phase: float
    restitution: float
    cutoff: float
    x: float = 0.0
    v: float = 0.0
    side: int = 0
    t: float = 0.0
    bound: float = 2 * ROUNDING
    overturned: bool = False
    events: list = field(default_factory=list)
    critical_angle: float = 0.0

    @property
    def level(self):
        """Largest |f| under which the block stays at rest."""
        return math.tan(self.critical_angle) / self.critical_angle if self.critical_angle else 1.0

    def pull(self, x, side, force):
        """Acceleration at an angle, on a side."""
        if not self.critical_angle:
            return x - side + force
        phi = self.critical_angle * (1.0 - side * x)
        return -side * math.sin(phi) / self.critical_angle + force * math.cos(phi)

    def _grown(self, time):
        """Factor by which a flight carries a small difference apart at most."""
        return math.exp(time * math.sqrt(1.0 + self.critical_angle * self.amplitude))

    def force(self, t):
        return -self.amplitude * math.cos(self.frequency * t + self.phase)

    def advance(self, end):
        """Carry the block to the time `end`, or to its overturning."""
        while self.t < end and not self.overturned:
            if self.side == 0:
                self._rest(end)
            else:
                self._fly(end)

    def _rest(self, end):
        uplift = self.t
        if abs(self.force(self.t)) <= self.level:
            uplift = self.t + self._wait()
        if uplift >= end:
            self.t = end
            return
        self.t, self.x, self.v, self.bound = uplift, 0.0, 0.0, 2 * ROUNDING
        self.side = -1 if math.cos(self.frequency * uplift + self.phase) > 0.0 else 1
        self.events.append((uplift, "uplift"))

    def _wait(self):
        """Time until A |cos| passes 1: the angle, modulo pi, must come to pi - arccos(1/A)."""
        if self.amplitude <= self.level:
            return math.inf
        angle = (self.frequency * self.t + self.phase) % math.pi
        return max(math.pi - math.acos(self.level / self.amplitude) - angle, 0.0) / self.frequency

    def _integrate(self, start, state, end, events=None, first=None):
        side = self.side
        return solve_ivp(
            lambda t, y: (y[1], self.pull(y[0], side, self.force(t))),
            (start, end),
            state,
            method="DOP853",
            rtol=1e-13,
            atol=1e-14,
            events=events,
            first_step=first,
            max_step=0.06,
            dense_output=True,
        )

    def _hidden(self, path):
        """First sampled time inside a step at which the block is out of bounds though the step's ends are not."""
        times = (path.t[:-1, None] + np.diff(path.t)[:, None] * np.linspace(0.0, 1.0, 17)[1:-1]).ravel()
        u = self.side * path.sol(times)[0]
        outside = np.flatnonzero((u < 0.0) | (u > self.cutoff))
        return times[outside[0]] if outside.size else None

    def _fly(self, end):
        """Fly to `end` or to the first event: bracketed by steps, then integrated to and met by one step of Newton."""
        side = self.side

        def land(_, y):
            return side * y[0]

        def overturn(_, y):
            return self.cutoff - side * y[0]

        for event in (land, overturn):
            event.terminal, event.direction = True, -1
        start = self.t
        half_bounce = abs(self.v) / (1.0 + self.amplitude) if self.x == 0.0 else 0.0
        first = min(half_bounce, end - start, 0.01) or None
        path = self._integrate(start, (self.x, self.v), end, (land, overturn), first)
        hidden = self._hidden(path)
        if hidden is not None:
            end = hidden
            path = self._integrate(start, (self.x, self.v), end, (land, overturn), min(first or math.inf, end - start))
        if path.status == 0:
            self.t, (self.x, self.v) = end, path.y[:, -1]
            self.bound = self.bound * self._grown(end - start) + ROUNDING
            return
        hits_zero = path.t_events[0].size > 0
        level = 0.0 if hits_zero else side * self.cutoff
        t, (x, v) = path.t[-1], path.y[:, -1]
        before = np.flatnonzero(path.t < t - 1e-9)[-1] if path.t[0] < t - 1e-9 else 0
        x, v = self._integrate(path.t[before], path.y[:, before], t).y[:, -1]
        late = (x - level) / v
        self.t, self.x, self.v = t - late, level, v - late * self.pull(x, side, self.force(t))
        self.bound = self.bound * self._grown(self.t - start) + ROUNDING
        if hits_zero:
            self._land()
        else:
            self.bound *= max(1.0, 1.0 / abs(self.v), abs(self.pull(self.x, side, self.force(self.t))) / abs(self.v))
            self.overturned = True
            self.events.append((self.t, "overturning"))

    def _land(self):
        e, force, incoming = self.restitution, self.force(self.t), self.v
        self.events.append((self.t, "impact"))
        before, after = self.pull(0.0, self.side, force), self.pull(0.0, -self.side, force)
        saltation = np.array([[e, 0.0], [(after - e * before) / incoming, e]])
        self.bound = min(self.bound * np.linalg.norm(saltation, 2) + ROUNDING, 1.0)
        self.v, self.side = e * incoming, -self.side
        gap = self.level - abs(force)
        if abs(self.v) < AT_REST and gap > 0.0 and self._ends_soon(gap):
            self.x, self.v, self.side = 0.0, 0.0, 0
            self.events.append((self.t, "rest"))
        elif abs(self.v) < ROUNDING and gap < 0.0:
            self.v, self.side = 0.0, (1 if force > 0.0 else -1)

    def _ends_soon(self, gap):
        """Whether the bounces, each shorter than 2 |v| / gap, end before the force can have used up half of the gap."""
        if self.restitution == 1.0:
            return False
        return 2.0 * abs(self.v) / (gap * (1.0 - self.restitution)) * self.amplitude * self.frequency < 0.5 * gap
