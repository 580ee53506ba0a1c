"""Paths of a deterministic scene at many scales of its forcing."""

import functools
import math
from typing import NamedTuple

import numpy as np

from fpk_rocking.base.jit import map_threads
from fpk_rocking.physics.motion import TERMS, lift_off
from fpk_rocking.physics.motion.slender import force_series
from montecarlo.engines import engine_of
from montecarlo.engines.batches import checked_run, simulate_batches
from montecarlo.engines.exact import eventless_angles
from montecarlo.engines.exact_block import Collocation


class Outcomes(NamedTuple):
    """What n paths come to, nondimensional: nan and 0 for one that stands, as in `montecarlo.Ensemble`."""

    overturn_time: np.ndarray  # (n,)
    overturn_side: np.ndarray  # (n,)
    peak: np.ndarray  # (n,): largest |Θ|, that of overturning at most

    @property
    def overturned(self):
        return self.overturn_side != 0


class ScaledPaths:
    """Paths of a deterministic scene under its forcing times any factor, up to the last of the cycles or times."""

    def __init__(self, scene, cycles=None, times=None):
        run = checked_run(scene, cycles, None, 1, "exact", 200, times=times)
        parameters = engine_of(scene, "exact").parameters_of(scene, 200, None if scene.repeats else run.times[-1:])
        grid = parameters.grid.with_all_ends()
        if scene.repeats:
            self._run, self._samples = run, grid.count
            self.times = run.times[-1] / (grid.count * run.rows) * np.arange(grid.count * run.rows + 1)
        else:
            self.times = grid.spacing * np.append(0.0, grid.output_times)
            self._run, self._samples = run._replace(times=self.times), 1
        self._parameters = parameters._replace(grid=grid)
        self.cutoff = scene.overturning.angle

    @functools.cached_property
    def least_scale(self):
        """Factor up to which the forcing does not lift off a block at rest; 0 for one that starts otherwise."""
        scene = self._run.scene
        lifting = scene.forcing.lifting(lift_off(scene.block.critical_angle))
        return 1.0 / lifting if scene.start.at_rest and lifting > 0.0 else 0.0

    def __call__(self, scales):
        """Return the `Outcomes` of n paths, one at each of the `scales` (n,), factors above 0."""
        outcomes = Outcomes(*np.full((3, len(scales)), math.nan))

        def follow(number):
            parameters = scaled_parameters(self._parameters, scales[number], scales[number])
            (path,) = simulate_batches(self._run, samples=self._samples, parameters=parameters)
            time, side = path.overturn_time[0], path.overturn_side[0]
            peak = self.cutoff if side else largest_angle(self.times, path.angle[0], path.velocity[0])
            for array, value in zip(outcomes, (time, side, peak), strict=True):
                array[number] = value

        map_threads(follow, range(len(scales)))
        return outcomes


def largest_angle(times, angle, velocity):
    """Return the largest |Θ| of a path by cubics between its states, right to some 1e-5 over intervals of .2."""
    h, side = np.diff(times), np.sign(angle[:-1])
    u, end, v, w = side * angle[:-1], side * angle[1:], side * velocity[:-1], side * velocity[1:]
    turns = (end > 0.0) & (v > 0.0) & (w < 0.0)
    u, end, v, w, h = u[turns], end[turns], v[turns], w[turns], h[turns]
    mean = (end - u) / h
    # The slope of the cubic is v + s (b + s a) at the part s of the interval.
    a, b = 3.0 * (v + w - 2.0 * mean), -2.0 * (2.0 * v + w - 3.0 * mean)
    s = 2.0 * v / (np.sqrt(np.maximum(b * b - 4.0 * a * v, 0.0)) - b)
    tops = u + h * s * (v + s * (0.5 * b + s * a / 3.0))
    return max(float(np.abs(angle).max()), float(tops.max(initial=0.0)))


def scaled_parameters(parameters, factor, sway):
    """Return the `ExactParameters` of a scene without noise, with f times `factor`, a vertical motion times `sway`."""
    flight, forced = parameters.flight, factor * parameters.forced
    if isinstance(flight, Collocation):
        force, flight = forced, flight._replace(forcing=factor * flight.forcing, slack=factor * flight.slack)
    else:
        force, flight = force_series(forced), flight._replace(node=factor * flight.node)
    spread = np.abs(force[:, 1:]) @ (0.5 * parameters.grid.spacing) ** np.arange(1, TERMS)
    bounds = force[:, 0] - spread, force[:, 0] + spread
    weights = sway * parameters.weights
    weights[:, 0] += 1.0 - sway
    least, most, stays = eventless_angles(*bounds, weights, parameters.grid.spacing, parameters.block)
    return parameters._replace(forced=forced, flight=flight, least=least, most=most, stays=stays, weights=weights)
