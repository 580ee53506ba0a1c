"""Results of a known law, for tests of what stands above the engines.

After k cycles a share ``KEPT**k`` has not overturned. Its angle is normal, cut to one side of x = 0 and to the strip,
its velocity normal and independent of the angle; both depend on the side, so the density jumps at x = 0.
"""

import dataclasses
import functools
import math
from typing import ClassVar

import numpy as np
from scipy.special import ndtr, ndtri

from fpk_rocking import Scene
from fpk_rocking.density.evolution import Evolution
from montecarlo.results.ensemble import Sample

KEPT = 0.9
LEFT_SHARE = 0.6  # of what is left, and of what has overturned
ANGLE_MEAN, ANGLE_SPREAD = (-0.5, 0.4), 0.35
VELOCITY_MEAN, VELOCITY_SPREAD = (-0.4, 0.9), 0.6


def _sides(scene):
    cut_off = scene.overturning.angle
    return ((-cut_off, 0.0, LEFT_SHARE), (0.0, cut_off, 1.0 - LEFT_SHARE))


def _normal(value, mean, spread):
    return np.exp(-0.5 * np.square((value - mean) / spread)) / (spread * math.sqrt(2.0 * math.pi))


def exact_bins(scene, cycle, angle_edges, velocity_edges):
    """Closed form of what `bin_probabilities` returns after a cycle."""
    total = 0.0
    for side, (low, high, share) in enumerate(_sides(scene)):
        limits = ndtr((np.clip(angle_edges, low, high) - ANGLE_MEAN[side]) / ANGLE_SPREAD)
        normalization = ndtr((high - ANGLE_MEAN[side]) / ANGLE_SPREAD) - ndtr((low - ANGLE_MEAN[side]) / ANGLE_SPREAD)
        velocity = np.diff(ndtr((np.asarray(velocity_edges) - VELOCITY_MEAN[side]) / VELOCITY_SPREAD))
        total = total + share * np.multiply.outer(np.diff(limits) / normalization, velocity)
    return KEPT**cycle * total


@dataclasses.dataclass(frozen=True)
class FakeDensity:
    """The density after a cycle on an 8 x 10 mesh of degree 3."""

    scene: Scene
    cycle: int
    degree: int = 3

    @property
    def mesh_lines(self):
        cut_off = self.scene.overturning.angle
        return np.linspace(-cut_off, cut_off, 9), np.linspace(-4.0, 4.0, 11)

    def on_side(self, side, angle, velocity):
        low, high, share = _sides(self.scene)[side]
        normalization = ndtr((high - ANGLE_MEAN[side]) / ANGLE_SPREAD) - ndtr((low - ANGLE_MEAN[side]) / ANGLE_SPREAD)
        shape = _normal(angle, ANGLE_MEAN[side], ANGLE_SPREAD) / normalization
        return KEPT**self.cycle * share * shape * _normal(velocity, VELOCITY_MEAN[side], VELOCITY_SPREAD)

    def __call__(self, angle, velocity):
        return np.where(np.asarray(angle) < 0.0, self.on_side(0, angle, velocity), self.on_side(1, angle, velocity))

    def cell_values(self, points):
        angle, velocity = (
            values[:-1, None] + np.diff(values)[:, None] * np.linspace(0.0, 1.0, points) for values in self.mesh_lines
        )
        grid = angle[:, None, :, None], velocity[None, :, None, :]
        left = (angle.mean(axis=1) < 0.0)[:, None, None, None]
        return np.where(left, self.on_side(0, *grid), self.on_side(1, *grid))

    def bin_probabilities(self, angle_edges, velocity_edges):
        return exact_bins(self.scene, self.cycle, angle_edges, velocity_edges)


class FakeEvolution(Evolution):
    """An evolution of the known law; a subclass may have other arrays and numbers as attributes of the class."""

    def __init__(self, scene, cycles=10, **fields):
        stands = "Band noise stands as white noise of equal Melnikov variance."
        survival = KEPT ** np.arange(cycles + 1)
        usual = {
            "scene": scene,
            "diffusion": 0.00628,
            "noise_replacement": stands * (scene.noise.kind == "band"),
            "tol": 1e-3,
            "times": (scene.period or 1.0) * np.arange(cycles + 1),
            "survival": survival,
            "overturned": np.multiply.outer(1.0 - survival, [LEFT_SHARE, 1.0 - LEFT_SHARE]),
            "truncated": np.zeros(cycles + 1),
            "at_rest": np.zeros(cycles + 1),
            "error_estimate": 1e-4,
            "bins_error_estimate": 1e-3,
            "rest_error_estimate": 0.0,
            "mass_defect": 1e-15,
            "negative_mass": 0.0,
            "moving_negative_mass": 0.0,
            "wall_s": 1.5,
            "settings": {},
            "coefficients": np.zeros((cycles + 1, 1, 1, 1, 1)),
            "angle_lines": np.array([-1.0, 1.0]),
            "velocity_lines": np.array([-1.0, 1.0]),
            "rests_exactly": False,
            "replacement": None,
        }
        own = {name for cls in type(self).__mro__[:-1] if issubclass(cls, FakeEvolution) for name in vars(cls)}
        vars(self).update({name: value for name, value in (usual | fields).items() if name not in own})

    def at(self, cycle):
        if cycle == 0:
            raise ValueError("cycle: got 0, accepted: 1 or more, a point has no density")
        return FakeDensity(self.scene, cycle)

    def bin_probabilities(self, cycle, angle_edges, velocity_edges):
        if cycle == 0:
            return np.histogram2d([0.0], [0.0], [angle_edges, velocity_edges])[0]
        return self.at(cycle).bin_probabilities(angle_edges, velocity_edges)


@dataclasses.dataclass(frozen=True)
class FakeEnsemble(Sample):
    kind: ClassVar = "ensemble"
    scene: Scene
    cycles: int = 10
    realizations: int = 1000
    seed: int = 1
    method: str = "rk4"
    steps_per_cycle: int = 200
    wall_s: float = 2.5
    first_overturning = None
    returns = np.zeros(2, np.int64)

    @property
    def times(self):
        return self.scene.period * np.arange(self.cycles + 1)

    @functools.cached_property
    def _draws(self):
        """Cycle of overturning, side, angles and velocities, drawn from the law itself."""
        rng = np.random.default_rng(self.seed)
        lasts = rng.geometric(1.0 - KEPT, self.realizations)
        left = rng.random((self.realizations, self.cycles + 1)) < LEFT_SHARE
        quantile = rng.random(left.shape)
        angle, velocity = np.empty(left.shape), np.empty(left.shape)
        for side, (low, high, _) in enumerate(_sides(self.scene)):
            limits = ndtr((np.array([low, high]) - ANGLE_MEAN[side]) / ANGLE_SPREAD)
            chosen = left if side == 0 else ~left
            drawn = ANGLE_MEAN[side] + ANGLE_SPREAD * ndtri(limits[0] + quantile * np.diff(limits))
            angle[chosen] = drawn[chosen]
            velocity[chosen] = rng.normal(VELOCITY_MEAN[side], VELOCITY_SPREAD, chosen.sum())
        angle[:, 0] = velocity[:, 0] = 0.0
        absorbed = lasts[:, None] <= np.arange(self.cycles + 1)
        angle[absorbed] = velocity[absorbed] = math.nan
        return lasts, rng.random(self.realizations) < LEFT_SHARE, angle, velocity

    @property
    def angle(self):
        return self._draws[2]

    @property
    def velocity(self):
        return self._draws[3]

    @property
    def overturn_time(self):
        lasts = self._draws[0]
        return np.where(lasts <= self.cycles, (lasts - 0.5) * self.scene.period, math.nan)

    @property
    def survival(self):
        return np.isfinite(self.angle).mean(axis=0)

    @property
    def overturned(self):
        lasts, left, _, _ = self._draws
        absorbed = lasts[:, None] <= np.arange(self.cycles + 1)
        return np.stack([(absorbed & left[:, None]).mean(axis=0), (absorbed & ~left[:, None]).mean(axis=0)], axis=-1)

    def survival_interval(self, level=0.95):
        z, n, p = ndtri(0.5 + level / 2.0), self.realizations, self.survival
        centre = (p + z * z / (2 * n)) / (1 + z * z / n)
        half = z / (1 + z * z / n) * np.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
        return np.stack([centre - half, centre + half], axis=-1)

    def bin_probabilities(self, cycle, angle_edges, velocity_edges):
        alive = np.isfinite(self.angle[:, cycle])
        edges = [angle_edges, velocity_edges]
        counts = np.histogram2d(self.angle[alive, cycle], self.velocity[alive, cycle], edges)[0]
        return counts / self.realizations
