"""Evolution from the start of a scene to the first density that the main mesh resolves.

A start that is a point, or a Gaussian finer than the mesh, is carried on *windows*: small meshes that follow the
density and grow with it. While nothing can happen to the block the density is a Gaussian in closed form. Next to x = 0
it is not: at rest under |f| > 1 noise beats drift until about t* = D / (|f| - 1)^2, the block rattles through x = 0 and
only then lifts off; under |f| <= 1 it keeps rattling. There the windows take steps in proportion to the time elapsed.
"""

import bisect
import math
from typing import NamedTuple

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.density.space.space import Space
from fpk_rocking.density.start.windows import NEGLIGIBLE, WindowSettings, next_window, window_of
from fpk_rocking.density.step.characteristics import event_cells
from fpk_rocking.density.step.step import Characteristics, Dynamics, Quadrature, Step

SHORT, LONG = (5, 2), (9, 3)
"""Nodes of the noise, along its long and its short axis, in a step between windows and in one without events."""

MISSING = 1e-5
"""Most that the projection of a Gaussian on its window may miss of its mass."""

MORE = 1
"""Gauss points an axis added while the forcing cannot lift the block off: it rattles, and many short steps follow."""

RESOLVED = 0.2
"""The mesh resolves a Gaussian whose conditional standard deviations are at least this part of its cells."""

BARELY = 0.15
"""The same, where the windows would otherwise have to follow the density through an event."""

BROKEN = 100.0
"""Sum of the sizes of the masses of a window's cells above which its density grows without bound."""

_RATTLE, _SINCE = 0.25, 0.4
"""Longest step over `WindowSettings.growth`: in units of the time of the lift-off, and of the time since."""

_AHEAD = 0.1
"""Longest step over `WindowSettings.growth`, in units of the time until the forcing lifts the block off."""

_MOST_STEPS, _LEAST_STEPS = 320, 16
"""A step of a block that rattles is no shorter than a cycle over the first, one of a window no longer than the
forcing's shortest period over the second."""

_ALONE = 0.3
"""Longest flight of an exact block between windows, over `WindowSettings.growth`."""

_SPREADING, _BENT = 0.125, 1e-4
"""Shift of a mean in a time t by the curvature α² (1 + |f|) of the acceleration, about, over that, the variance of the
angle and t²; and what an exact block may be shifted by as a Gaussian, over `WindowSettings.growth`."""

_HANDOVER = 0.75
"""Part of the time to the main mesh, or of a cycle, up to which an undisturbed Gaussian is taken in closed form."""


class Gaussian:
    """A Gaussian density of angle and velocity: mean (2,), covariance (2, 2); nondimensional."""

    def __init__(self, mean, covariance):
        self.mean, self.covariance = np.asarray(mean, dtype=float), np.asarray(covariance, dtype=float)

    @classmethod
    def of(cls, start):
        """Take the start of a scene; a point has covariance 0."""
        return cls((start.angle, start.velocity), np.zeros((2, 2)) if start.covariance is None else start.covariance)

    def __call__(self, angle, velocity):
        """Density at points (broadcast)."""
        xx, xv, vv = self.covariance[0, 0], self.covariance[0, 1], self.covariance[1, 1]
        determinant = xx * vv - xv * xv
        x, v = angle - self.mean[0], velocity - self.mean[1]
        exponent = (vv * x * x - 2.0 * xv * x * v + xx * v * v) / determinant
        return np.exp(-0.5 * exponent) / (2.0 * math.pi * math.sqrt(determinant))

    def tails(self, cutoff):
        """Mass beyond the cut-off, to the left and to the right."""
        spread = math.sqrt(2.0 * self.covariance[0, 0])
        return [0.5 * math.erfc((cutoff + sign * self.mean[0]) / spread) for sign in (1.0, -1.0)]

    def after(self, dynamics: Dynamics, start, duration, side):
        """Return the Gaussian after a flight on one side in which nothing happens, of a slender block."""
        flight = dynamics.affine(start, duration)
        xx, xv, vv = dynamics.covariance(start, duration)
        covariance = flight.matrix @ self.covariance @ flight.matrix.T + [[xx, xv], [xv, vv]]
        return Gaussian(flight.matrix @ self.mean + flight.shifts[side], covariance)

    def course(self, dynamics: Dynamics, end, side):
        """Return the Gaussians, as a function of the time up to an end, of an exact block: see `moments`."""
        xx, xv, vv = self.covariance[0, 0], self.covariance[0, 1], self.covariance[1, 1]
        found = moments(dynamics, np.array([*self.mean, xx, xv, vv]), end, side)

        def at(time):
            x, v, xx, xv, vv = found(time)
            return Gaussian((x, v), [[xx, xv], [xv, vv]])

        return at


def moments(dynamics: Dynamics, begin, end, side):
    """Follow mean and covariance of an exact block in a flight in which nothing happens, to first order in its spread.

    Parameters
    ----------
    dynamics : Dynamics
    begin : ndarray, shape (5,)
        Angle, velocity and covariance xx, xv, vv at time 0.
    end : float
    side : int

    Returns
    -------
    callable
        These (5,) as a function of a time up to the end.
    """
    from scipy.integrate import DOP853  # takes longer to import than all else here

    alpha, forcing, envelope = dynamics.critical_angle, dynamics.forcing, dynamics.envelope

    def rates(time, state):
        x, v, xx, xv, vv = state
        phi, force = alpha * (1.0 - side * x), forcing.value(time)
        sine, cosine = math.sin(phi), math.cos(phi)
        stiff = cosine + side * force * alpha * sine
        noise = 2.0 * dynamics.diffusion * cosine**2
        if envelope is not None:
            noise *= max(envelope.value(time) ** 2, dynamics.least_intensity)
        return [v, force * cosine - side * sine / alpha, 2.0 * xv, vv + stiff * xx, 2.0 * stiff * xv + noise]

    solver = DOP853(rates, 0.0, begin, end, rtol=1e-8, atol=1e-30)
    ends, pieces = [], []

    def at(time):
        # Most starts meet the mesh long before the end, and a record makes many steps.
        while solver.status == "running" and solver.t < max(time, 1e-300):
            solver.step()
            ends.append(solver.t)
            pieces.append(solver.dense_output())
        return pieces[min(bisect.bisect_left(ends, time), len(pieces) - 1)](time)

    return at


def initial_density(start, space, cutoff):
    """Coefficients of a Gaussian start, for looking at it, and what of it is beyond the cut-off; zeros for a point."""
    if start.covariance is None:
        return np.zeros(space.shape), [0.0, 0.0]
    gaussian = Gaussian.of(start)
    return space.project(gaussian, 2 * space.degree + 2), gaussian.tails(cutoff)


class Carried(NamedTuple):
    """A density on a window: its time, the window, the coefficients, and what has gone (3,) on the way."""

    time: float
    window: Space
    coefficients: np.ndarray
    gone: np.ndarray


class Departure:
    """A start carried from window to window, as far as anyone asks; the ways to several meshes share it.

    Parameters
    ----------
    dynamics : Dynamics
    start : Start
        Of the scene.
    windows : WindowSettings
        Their fineness.
    period : float
        Of the forcing: nothing is carried further, but for `patience`.
    patience : float
        Time until which the forcing is known not to lift a block off that is at rest.
    """

    def __init__(self, dynamics: Dynamics, start, windows: WindowSettings, period, patience=0.0):
        self.dynamics, self.start, self.windows, self._cycle = dynamics, start, windows, period
        self._patience, self.period = patience, period + patience
        self._initial = Gaussian.of(start)
        x, v = self._initial.mean
        self._side = 1 if (x or v or dynamics.forcing.value(0.0)) > 0.0 else -1
        self._exact = dynamics.critical_angle is not None
        self._flying = self._initial.course(dynamics, self.period, self._side) if self._exact else None
        self._alone = _ALONE * windows.growth if self._exact else math.inf
        self._gathered = self._initial.covariance[1, 1] / (2.0 * dynamics.averaged_over(0.0, 1e-9 * period).diffusion)
        self._quiet = self._quiet_time()
        self._carried, self._next = [self._undisturbed(self._quiet)], None

    @property
    def rests(self):
        """Whether the block is at rest and the forcing does not lift it off."""
        still = not self._initial.mean.any() and not self._initial.covariance.any()
        return still and abs(self.dynamics.forcing.value(0.0)) <= self.dynamics.lift_off

    def flight(self, time):
        """Gaussian that an undisturbed flight leads to."""
        if time <= 0.0:
            return self._initial
        return self._flying(time) if self._exact else self._initial.after(self.dynamics, 0.0, time, self._side)

    def spread(self, time):
        """Gaussian that tells how far a start has spread: about rest where the forcing has not lifted the block off."""
        gaussian = self.flight(time)
        if self.rests and self.dynamics.since_lift_off(time)[0] > time:
            gaussian.mean = np.zeros(2)
        return gaussian

    def resolution(self, time, space):
        """Least conditional standard deviation of the density at a time over the size of a cell of a mesh."""
        if not self._patience:
            return _resolution(self.spread(time), space)
        window = self._before(time).window
        sizes = [np.diff(lines).min() * self.windows.cells / (2.0 * self.windows.reach) for lines in window.lines]
        mean = self.flight(time).mean if self.dynamics.since_lift_off(time)[0] <= time else np.zeros(2)
        return min(size / _cell_size(lines, at) for size, lines, at in zip(sizes, space.lines, mean, strict=True))

    def within(self, time, angle, velocity):
        """Part of the density at a time that is within an angle and a velocity of the origin."""
        now = self._before(time)
        return float(now.window.bin_integrals(now.coefficients[None], [-angle, angle], [-velocity, velocity]).sum())

    def undisturbed(self, gaussian):
        """Whether a Gaussian is on the side of the start, and keeps away from x = 0 and the cut-off."""
        reach = self.windows.reach * math.sqrt(gaussian.covariance[0, 0])
        return reach < self._side * gaussian.mean[0] < self.dynamics.cutoff - reach

    def land(self, end, target: Space):
        """Density at a time on a mesh: coefficients, and the masses (3,) that have gone."""
        now = self._before(end)
        duration = end - now.time
        quiet = self._free_time(now, duration) >= duration
        coefficients, sinks = Step(self._trace(now, duration, quiet), target).apply(now.coefficients)
        return coefficients, now.gone + sinks

    def _before(self, end):
        """Last density on a window from which one step leads to a time."""
        if end <= self._quiet / _HANDOVER:
            return self._undisturbed(min(self._quiet, max(_HANDOVER * end, end - self._alone)))
        while self._carried[-1].time < end:
            self._carried.append(self._further(self._carried[-1]))
        return next(now for now in reversed(self._carried) if now.time < end)

    def _further(self, now):
        """Carry a density by one step, as long as its spread and what may happen to it allow."""
        longest = self.dynamics.forcing.shortest_period / _LEAST_STEPS
        duration = min(self.windows.growth * (now.time + self._gathered), longest)
        if self._rattles(now, duration):
            duration = min(duration, self._longest(now.time))
        free = self._free_time(now, min(self.period - now.time, self._alone)) if now.time < self.period else 0.0
        quiet = free >= duration
        duration, dynamics = max(free, duration), self.dynamics
        trace = self._trace(now, duration, quiet)
        target = next_window(self.windows, trace, now.coefficients, dynamics.cutoff)
        coefficients, sinks = Step(trace, target).apply(now.coefficients)
        if not np.abs(target.masses(coefficients)).sum() < BROKEN:
            raise ValueError(
                "scene: got a density that the meshes of the start do not resolve, accepted: stronger noise than the "
                f"diffusion {dynamics.diffusion:.3g}, or another start; or use Monte Carlo"
            )
        return Carried(now.time + duration, target, coefficients, now.gone + sinks)

    def _trace(self, now, duration, quiet):
        """Return the characteristics of one step from the cells of a window that are not empty."""
        points = self.windows.points + (
            0 if abs(self.dynamics.forcing.value(now.time)) > self.dynamics.lift_off else MORE
        )
        quadrature = Quadrature(points, points, *(LONG if quiet else SHORT))
        holding = np.abs(now.coefficients).max(axis=(2, 3)) * now.window.areas > NEGLIGIBLE
        return Characteristics(now.window, now.time, duration, self.dynamics, quadrature, holding, to_other_mesh=True)

    def _undisturbed(self, time):
        gaussian, cutoff = self.flight(time), self.dynamics.cutoff
        window = window_of(self.windows, gaussian.mean, gaussian.covariance, cutoff)
        coefficients, tails = window.project(gaussian, self.windows.points + 1), gaussian.tails(cutoff)
        missing = 1.0 - sum(tails) - window.masses(coefficients).sum()
        if abs(missing) > MISSING:
            accepted = "a wider Gaussian, or one with less correlation, as the mesh does not resolve this one"
            raise ValueError(checks.refusal("start.covariance", gaussian.covariance.tolist(), accepted))
        gone = np.array([*tails, missing])
        return Carried(time, window, coefficients, gone)

    def _quiet_time(self):
        """Last time until which the density is a Gaussian that nothing has disturbed."""
        initial, least = self._initial, 1e-9 * self._cycle
        if not initial.mean.any() and not initial.covariance.any():
            return self.windows.early * _drift_time(self.dynamics)
        quiet = 0.0 if initial.covariance.any() else least
        for time in np.geomspace(least, _HANDOVER * self.period, 100):
            gaussian = self.flight(time)
            if not self.undisturbed(gaussian) or self._bent(gaussian, time):
                break
            quiet = time
        return quiet

    def _bent(self, gaussian, time):
        """Whether a Gaussian is so wide that the curvature of an exact block's acceleration matters to its mean."""
        if not self._exact:
            return False
        alpha, force = self.dynamics.critical_angle, self.dynamics.forcing.largest
        return _SPREADING * alpha**2 * (1.0 + force) * gaussian.covariance[0, 0] * time**2 > _BENT * self.windows.growth

    def _longest(self, time):
        """Longest step for a block that rattles at x = 0, and while it is lifted off.

        Noise lifts a block off within D / gap^2 under |f| = 1 - gap and within t = (D / f'^2)^(1/3) of |f| = 1. Steps
        are a part of that; from |f| = 1 on they also grow with the time since.
        """
        dynamics, growth = self.dynamics.averaged_over(time, 1e-6 * self._cycle), self.windows.growth
        gap, change = dynamics.lift_off - abs(dynamics.forcing.value(time)), abs(dynamics.forcing.slope(time))
        if gap > 0.0:
            lifting = min(dynamics.diffusion / gap**2, _crossing_time(dynamics, change))
            return growth * max(_RATTLE * lifting, self._cycle / _MOST_STEPS, _AHEAD * (self._patience - time))
        since, change = dynamics.since_lift_off(time)
        if since > time:
            return math.inf
        return growth * (_SINCE * since + _RATTLE * _crossing_time(dynamics, change))

    def _rattles(self, now, duration):
        """Whether mass that matters may come to rest at x = 0 within a step."""
        slow = max(self.dynamics.lift_off - abs(self.dynamics.forcing.value(now.time)), 0.0) * duration
        slow += self.windows.reach * math.sqrt(
            2.0 * self.dynamics.averaged_over(now.time, duration).diffusion * duration
        )
        angle, velocity = (
            (lines[:-1] < size) & (lines[1:] > -size)
            for lines, size in zip(now.window.lines, (slow * duration, slow), strict=True)
        )
        return np.abs(now.window.masses(now.coefficients))[np.ix_(angle, velocity)].sum() > MISSING

    def _free_time(self, now, longest):
        """Longest of the halvings of a duration within which nothing can happen to a density; 0 below a 64th of it."""
        dynamics, window, masses = self.dynamics, now.window, np.abs(now.window.masses(now.coefficients))
        for duration in longest * 0.5 ** np.arange(7):
            reach = self.windows.reach * math.sqrt(dynamics.covariance(now.time, duration)[0])
            segment = dynamics.segment(now.time, duration)
            events = event_cells(*window.lines, segment, duration, dynamics.block, (reach, math.inf))
            if masses[events].sum() < NEGLIGIBLE:
                return duration
        return 0.0


def first_resolved(departure: Departure, space: Space, edges, settled=None):
    """Return the number of the step edge, of those (n,) of a cycle at most, at which a mesh takes over from windows.

    It is the first at which the mesh resolves an undisturbed Gaussian, or the last before an event if that Gaussian is
    at least `BARELY` resolved there: the windows would have to follow it through the event. Or it is the first at whose
    time `settled` is true.
    """
    before, last = None, len(edges) - 1
    for step in range(1, last):
        gaussian = departure.flight(edges[step])
        resolved = departure.resolution(edges[step], space)
        if resolved >= RESOLVED or (settled and settled(edges[step])):
            return step
        if departure.undisturbed(gaussian):
            before = step if resolved >= BARELY else None
        elif before:
            return before
    return last


def _resolution(gaussian, space):
    """Conditional standard deviations of a Gaussian over the size of the cell it is centred in: the lesser one."""
    xx, xv, vv = gaussian.covariance[0, 0], gaussian.covariance[0, 1], gaussian.covariance[1, 1]
    angle, velocity = (_cell_size(lines, mean) for lines, mean in zip(space.lines, gaussian.mean, strict=True))
    return min(math.sqrt(max(xx - xv * xv / vv, 0.0)) / angle, math.sqrt(max(vv - xv * xv / xx, 0.0)) / velocity)


def _drift_time(dynamics: Dynamics):
    """Time t* at which the drift from rest overtakes the noise: D / (|f| - 1)^2, less where f changes sooner."""
    dynamics = dynamics.averaged_over(0.0, 1e-9)
    drift = abs(abs(dynamics.forcing.value(0.0)) - dynamics.lift_off)
    steady = dynamics.diffusion / drift**2 if drift > 0.0 else math.inf
    return min(steady, _crossing_time(dynamics, dynamics.forcing.steepest), 1.0)


def _crossing_time(dynamics: Dynamics, change):
    """Time in which a drift that grows from 0 at a rate overtakes the noise, (D / rate^2)^(1/3)."""
    return (dynamics.diffusion / change**2) ** (1.0 / 3.0) if change > 0.0 else math.inf


def _cell_size(lines, point):
    cell = np.clip(np.searchsorted(lines, point) - 1, 0, len(lines) - 2)
    return lines[cell + 1] - lines[cell]
