"""Motion between two events at any number of digits, and a search that cannot miss the next event.

A *motion* u(t) = 1 + sum c_n cos(w_n t + p_n) + G exp(t) + D exp(-t) lasts while 0 < u < `limit`: the folded angle of
a flight, or the distance 1 - f from uplift of a block at rest. Intervals of time are shown to be free of events, or to
hold exactly one, by value and slope in their middle and a bound of |u''|; all others are halved. Values are
floating-point numbers with bounds of their errors; where these do not decide, numbers of many digits take their place.
"""

import math

import mpmath
import numpy as np
from mpmath import mp, mpf

ROUND = 2.0**-50
"""Eight units of roundoff: every bound of an error below counts roundings and is then eight times too large."""

DIGITS = 120
"""Digits of a `Signal`, more than any path is followed with."""

ORDER = 6
"""Terms of the Taylor polynomial that is used close to the begin of a motion, where it keeps relative precision."""


class UndecidedError(ArithmeticError):
    """A touch so light that the digits carried do not tell whether it is an event."""


class Sum:
    """sum c_n cos(w_n t + p_n); `sizes` bound it and its derivatives."""

    def __init__(self, frequencies, weights):
        self.rows = [[c * w**k for c, w in zip(weights, frequencies, strict=True)] for k in range(ORDER + 1)]
        self.sizes = [float(mpmath.fsum(row, absolute=True)) * (1.0 + ROUND) for row in self.rows]

    def derivatives(self, waves, count):
        """The sum and its derivatives, `count` numbers, from the cosines and sines of its harmonics."""
        signs = (1, -1, -1, 1)
        return [signs[k % 4] * mpmath.fdot(self.rows[k], waves[k % 2]) for k in range(count)]


class Signal:
    """The force f = sum a_n cos(w_n t + p_n) and P = -sum a_n/(1 + w_n^2) cos(w_n t + p_n), so that P'' = P + f.

    Frequencies, phases and weights are taken as exact, whether float or mpf.
    """

    def __init__(self, frequencies, phases, weights):
        with mp.workdps(DIGITS):
            self.frequencies, self.phases = [mpf(w) for w in frequencies], [mpf(p) for p in phases]
            particular = [-a / (1 + w * w) for a, w in zip(weights, self.frequencies, strict=True)]
            self.force, self.particular = (Sum(self.frequencies, row) for row in (weights, particular))

    def waves(self, time):
        """Cosines and sines of all harmonics."""
        angles = (w * time + p for w, p in zip(self.frequencies, self.phases, strict=True))
        return tuple(zip(*map(mpmath.cos_sin, angles), strict=True)) or ((), ())


class Motion:
    """A motion from `time` on: `sign` times a `Sum`, and two exponentials of the time tau since then.

    `zeros` counts how many of u, u', u'' are 0 at the begin by the nature of the event that began the motion.
    """

    def __init__(self, signal, terms, sign, time, waves, limit, growth=0, decay=0, zeros=0):
        self.signal, self.terms, self.sign, self.time = signal, terms, sign, time
        self.limit, self.growth, self.decay = limit, growth, decay
        self.w = np.array([float(w) for w in signal.frequencies])
        weights = np.array([float(sign * c) for c in terms.rows[0]])
        self.cosines, self.sines = (weights * np.array([float(value) for value in wave]) for wave in waves)
        self.exponentials = float(growth), float(decay)
        derivatives = self.derivatives(0, waves, ORDER)
        self.taylor = [0.0 if k < zeros else float(derivatives[k] / math.factorial(k)) for k in range(ORDER)]
        self.zeros = zeros

    def derivatives(self, tau, waves, count=5):
        """Return u and its derivatives, `count` many-digit numbers, at a many-digit time."""
        sums = self.terms.derivatives(waves, count)
        up, down = self.growth * mpmath.exp(tau), self.decay * mpmath.exp(-tau)
        return [(k == 0) + self.sign * sums[k] + up + (-1) ** k * down for k in range(count)]

    def bound(self, k, tau):
        """Bound of the k-th derivative up to tau."""
        growth, decay = self.exponentials
        return (self.terms.sizes[k] + abs(growth) * math.exp(tau) + abs(decay)) * (1.0 + ROUND)

    def bend(self, tau):
        """Bound of |u''| up to tau: that of the sums, or of the Taylor polynomial, which knows a gentle begin."""
        local = sum(k * (k - 1) * abs(c) * tau ** (k - 2) for k, c in enumerate(self.taylor) if k > 1)
        local += self.bound(ORDER, tau) * tau ** (ORDER - 2) / math.factorial(ORDER - 2)
        return min(self.bound(2, tau), local * (1.0 + ROUND))

    def at(self, tau):
        """Value, slope and the bounds of their errors at a float time, in floating-point numbers."""
        rest = self.bound(ORDER, tau) * tau ** (ORDER - 1) / math.factorial(ORDER - 1)
        sizes = [abs(c) * tau**k for k, c in enumerate(self.taylor)]
        error, slope_error = rest * tau + ROUND * sum(sizes), rest + ROUND * ORDER * sum(sizes[1:]) / tau
        most = ROUND * (self.w.size + 4)
        if error < most:
            value = sum(c * tau**k for k, c in enumerate(self.taylor))
            return value, sum(k * c * tau ** (k - 1) for k, c in enumerate(self.taylor) if k), error, slope_error
        c, s = np.cos(self.w * tau), np.sin(self.w * tau)
        up, down = self.exponentials[0] * math.exp(tau), self.exponentials[1] * math.exp(-tau)
        value = 1.0 + float(self.cosines @ c - self.sines @ s) + up + down
        slope = -float((self.w * self.cosines) @ s + (self.w * self.sines) @ c) + up - down
        error, slope_error = (most * (2.0 * self.bound(k, tau) + tau * self.bound(k + 1, tau) + 1.0) for k in (0, 1))
        return value, slope, error, slope_error

    def at_length(self, tau):
        """As `at`, with all digits."""
        u, slope = self.derivatives(mpf(tau), self.signal.waves(self.time + mpf(tau)), 2)
        error = (2.0 + self.bound(1, tau)) * mpf(10) ** (8 - mp.dps)
        return u, slope, error, error

    def leave(self, longest):
        """A time up to which the motion certainly has no event though it begins at u = 0 (0 if it begins inside)."""
        if self.zeros == 0:
            return 0.0
        lead, tau = self.taylor[self.zeros], longest
        if lead <= 0.0:
            raise UndecidedError(f"a motion that begins with {self.taylor}")
        while True:
            rest = self.bound(ORDER, tau) * tau**ORDER / math.factorial(ORDER)
            terms = [c * tau**k for k, c in enumerate(self.taylor)]
            against = rest - sum(term for term in terms[self.zeros + 1 :] if term < 0.0)
            if against < 0.5 * terms[self.zeros] and rest + sum(map(abs, terms)) < 0.5 * self.limit:
                return tau
            tau *= 0.5


def next_event(motion, longest):
    """Bracket the first time in (0, `longest`] at which u comes to 0 or to its limit.

    Returns
    -------
    (low, high, level) or None
        u is monotone between the two float times and crosses the level, 0 or the limit, there and not before.
    """
    free = motion.leave(longest)
    step, at = max(free, 0.05), motion.at
    while free < longest:
        end = min(free + step, longest)
        event = _examine(motion, at, free, end)
        if event is _FREE:
            free, step, at = end, 2.0 * step, motion.at
        elif event is _UNCLEAR:
            step = 0.5 * (end - free)
            if step < 4.0 * math.ulp(end):
                raise UndecidedError(f"a touch at {mpmath.nstr(motion.time + free, 20)}")
        elif event is _INEXACT:
            if at == motion.at_length:
                raise UndecidedError(f"a touch at {mpmath.nstr(motion.time + free, 20)}")
            at = motion.at_length
        else:
            return event
    return None


_FREE, _UNCLEAR, _INEXACT = "free", "unclear", "inexact"


def _examine(motion, at, low, high):
    """Say of an interval at whose begin 0 < u < limit whether it is free of events, unclear, or brackets one."""
    middle = 0.5 * (low + high)
    radius = max(high - middle, middle - low) * (1.0 + ROUND)
    u, slope, error, slope_error = at(middle)
    bend = motion.bend(high)
    reach = (abs(slope) + slope_error + 0.5 * bend * radius) * radius + error
    rooms = (u, motion.limit - u)
    if min(rooms) > reach:
        return _FREE
    near = 0 if rooms[0] < rooms[1] else 1
    if rooms[1 - near] > reach and abs(slope) > bend * radius + slope_error:
        if (slope > 0) == (near == 0):
            # Monotone away from the level, and on the right side of it at the begin.
            return _FREE
        u, _, error, _ = at(high)
        room = (u, motion.limit - u)[near]
        if room > error:
            return _FREE
        if room < -error:
            return low, high, (0.0, motion.limit)[near]
    hopeless = bend * radius * radius < error or bend * radius < slope_error
    return _INEXACT if hopeless else _UNCLEAR


def polish(motion, low, high, level):
    """Time of a bracketed event at full precision, the harmonics' waves there, and u and its derivatives."""
    tau = mpf(_solve(motion, low, high, level))
    step = mp.one
    while abs(step) > mpf(10) ** (-mp.dps // 6):
        waves = motion.signal.waves(motion.time + tau)
        derivatives = motion.derivatives(tau, waves)
        step = _newton([derivatives[0] - level, *derivatives[1:]])
        tau += step
    if not low <= tau <= high:
        raise UndecidedError(f"an event at {tau}, bracketed by {low} and {high}: it needs more digits")
    time = motion.time + tau
    waves = motion.signal.waves(time)
    return time, waves, motion.derivatives(tau, waves)


def _solve(motion, low, high, level):
    """Root within a bracket in floating-point numbers: Newton, or bisection where that leaves the bracket."""
    tau = 0.5 * (low + high)
    for _ in range(100):
        u, slope, *_ = motion.at(tau)
        if (u > level) == (slope < 0.0):
            low = tau
        else:
            high = tau
        following = tau - (u - level) / slope if slope else low
        if not low < following < high:
            following = 0.5 * (low + high)
        if abs(following - tau) <= 2.0 * math.ulp(tau):
            break
        tau = following
    return tau


def _newton(derivatives):
    """Root next to 0 of a Taylor polynomial."""
    coefficients = [d / math.factorial(k) for k, d in enumerate(derivatives)]
    step = -coefficients[0] / coefficients[1]
    for _ in range(8):
        value = mpmath.fsum(c * step**k for k, c in enumerate(coefficients))
        slope = mpmath.fsum(k * c * step ** (k - 1) for k, c in enumerate(coefficients) if k)
        step -= value / slope
    return step
