"""From the start to the first density that the main mesh resolves.

A start that is a point, or a Gaussian finer than the mesh, is carried on *windows*: small meshes that follow the
density and grow with it. While nothing can happen to the block the density is a Gaussian in closed form. Next to x = 0
it is not: at rest under |f| > 1 noise beats drift until about t* = D / (|f| - 1)^2, the block rattles through x = 0 and
only then lifts off; under |f| <= 1 it keeps rattling. There the windows take steps in proportion to the time elapsed.
"""

import math

import numpy as np

from fpk_rocking.density.landing import classify
from fpk_rocking.density.space import Space
from fpk_rocking.density.step import Dynamics, Quadrature, Step, Trace
from fpk_rocking.density.window import NEGLIGIBLE, Windows, next_window, window_of
from fpk_rocking.physics.gaussian import flight_covariance

FINE, WIDE = Quadrature(5, 5, 5, 2), Quadrature(5, 5, 9, 3)
"""Sampling of a step between windows, and of a longer one in which nothing can happen."""

RESOLVED = 0.3
"""The mesh resolves a Gaussian whose conditional standard deviations are at least this part of its cells."""

_RATTLE, _MOST_STEPS = 0.25, 200


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
        """Return the Gaussian after a flight on one side in which nothing happens."""
        cosh, sinh, shifts = dynamics.affine(start, duration)
        matrix = np.array([[cosh, sinh], [sinh, cosh]])
        xx, xv, vv = flight_covariance(dynamics.diffusion, duration)
        covariance = matrix @ self.covariance @ matrix.T + [[xx, xv], [xv, vv]]
        return Gaussian(matrix @ self.mean + shifts[side], covariance)


def initial_density(start, space, cutoff):
    """Coefficients of a Gaussian start, for looking at it, and what of it is beyond the cut-off; zeros for a point."""
    if start.covariance is None:
        return np.zeros(space.shape), [0.0, 0.0]
    gaussian = Gaussian.of(start)
    return space.project(gaussian, 2 * space.degree + 2), gaussian.tails(cutoff)


class Launch:
    """The density at the first step boundary where the main mesh resolves it.

    Attributes
    ----------
    coefficients : ndarray
        On the main mesh.
    step : int
        Its time in steps.
    sinks : ndarray, shape (3,)
        What overturned to the left and right, and what left the windows, on the way.
    """

    def __init__(self, dynamics: Dynamics, start, space: Space, duration, steps, windows: Windows):
        self.dynamics, self.space, self.windows = dynamics, space, windows
        initial = Gaussian.of(start)
        self.step = self._first_resolved(initial, duration, steps)
        end = self.step * duration
        time = self._quiet_time(initial, end)
        gaussian = self._flight(initial, time)
        window = window_of(windows, gaussian.mean, gaussian.covariance, dynamics.cutoff)
        coefficients = window.project(gaussian, FINE.angle)
        tails = gaussian.tails(dynamics.cutoff)
        self.sinks = np.array([*tails, 1.0 - sum(tails) - window.masses(coefficients).sum()])
        gathered = initial.covariance[1, 1] / (2.0 * dynamics.diffusion)
        self._follow(window, coefficients, time, end, gathered)

    def _flight(self, initial, time):
        side = 1 if initial.mean[0] > 0.0 or (initial.mean[0] == 0.0 and initial.mean[1] > 0.0) else -1
        if not initial.mean.any():
            side = 1 if self.dynamics.force(0.0) > 0.0 else -1
        return initial.after(self.dynamics, 0.0, time, side) if time > 0.0 else initial

    def _first_resolved(self, initial, duration, steps):
        """First step boundary, one cycle at most, at which the mesh resolves an undisturbed Gaussian."""
        for step in range(1, steps):
            gaussian = self._flight(initial, step * duration)
            xx, xv, vv = gaussian.covariance[0, 0], gaussian.covariance[0, 1], gaussian.covariance[1, 1]
            angle = RESOLVED * _cell_size(self.space.angle_lines, gaussian.mean[0])
            velocity = RESOLVED * _cell_size(self.space.velocity_lines, gaussian.mean[1])
            if xx - xv * xv / vv >= angle * angle and vv - xv * xv / xx >= velocity * velocity:
                return step
        return steps

    def _quiet_time(self, initial, end):
        """Last time before `end` until which the density is a Gaussian that nothing has disturbed."""
        if not initial.mean.any() and not initial.covariance.any():
            return min(self.windows.early * _drift_time(self.dynamics), 0.5 * end)
        quiet = 0.0 if initial.covariance.any() else 1e-9 * end
        for time in np.geomspace(max(quiet, 1e-9 * end), 0.75 * end, 100):
            gaussian = self._flight(initial, time)
            reach = self.windows.reach * math.sqrt(gaussian.covariance[0, 0])
            if (
                not reach < abs(gaussian.mean[0]) < self.dynamics.cutoff - reach
                or gaussian.mean[0] * (initial.mean[0] or initial.mean[1]) < 0.0
            ):
                break
            quiet = time
        return quiet

    def _follow(self, window, coefficients, time, end, gathered):
        """Carry a density from window to window, and to the main mesh at `end`."""
        dynamics = self.dynamics
        while time < end:
            duration = min(self.windows.growth * (time + gathered), self._longest(time, end), end - time)
            free = self._free_time(window, coefficients, time, end - time)
            quiet = free >= duration
            duration = max(free, duration)
            if end - time - duration < 0.1 * duration:
                duration = end - time
            trace = Trace(window, time, duration, dynamics, WIDE if quiet else FINE)
            time += duration
            target = self.space if time >= end else next_window(self.windows, trace, coefficients, dynamics.cutoff)
            coefficients, sinks = Step(trace, target).apply(coefficients)
            self.sinks += sinks
            window = target
        self.coefficients = coefficients

    def _longest(self, time, end):
        """Longest step next to x = 0: under |f| < 1 the noise must still lift the block off within it."""
        gap = 1.0 - abs(self.dynamics.force(time))
        return max(_RATTLE * self.dynamics.diffusion / gap**2, end / _MOST_STEPS) if gap > 0.0 else math.inf

    def _free_time(self, window, coefficients, time, longest):
        """Longest of the halvings of a duration within which nothing can happen to a density; 0 below a 64th of it."""
        dynamics, masses = self.dynamics, np.abs(window.masses(coefficients))
        for duration in longest * 0.5 ** np.arange(7):
            reach = self.windows.reach * math.sqrt(flight_covariance(dynamics.diffusion, duration)[0])
            events = classify(
                window.angle_lines, window.velocity_lines, time, duration, dynamics.harmonic, dynamics.cutoff, reach
            )
            if masses[events].sum() < NEGLIGIBLE:
                return duration
        return 0.0


def _drift_time(dynamics: Dynamics):
    """Time t* at which the drift from rest overtakes the noise: D / (|f| - 1)^2, less where f changes sooner."""
    amplitude, frequency, _ = dynamics.harmonic
    drift = abs(abs(dynamics.force(0.0)) - 1.0)
    change = amplitude * frequency
    steady = dynamics.diffusion / drift**2 if drift > 0.0 else math.inf
    return min(steady, (dynamics.diffusion / change**2) ** (1.0 / 3.0) if change > 0.0 else math.inf, 1.0)


def _cell_size(lines, point):
    cell = np.clip(np.searchsorted(lines, point) - 1, 0, len(lines) - 2)
    return lines[cell + 1] - lines[cell]
