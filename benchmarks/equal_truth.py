"""A scene as well as it is known, and what a sample of it is expected to err by; for `equal_error.py`."""

import math

import numpy as np
from density import CYCLES, FINE_EDGES, run_of
from eulerian_runs import EDGES
from fine_reference import load

from fpk_rocking.density.resolution import RESOLUTIONS
from fpk_rocking.results import sampling as distances

BINS = {"coarse": EDGES, "fine": FINE_EDGES}
DRAWN = 20_000


class Truth:
    """Survival and last bins of a scene on the solver's finest mesh, and how far the next one is from them."""

    def __init__(self, scene):
        run, solution = run_of(scene, RESOLUTIONS[-1], 1e-4)
        self.survival = solution.survival
        last = solution.coefficients[CYCLES]
        self.bins = {name: run.space.bin_integrals(last, *edges) for name, edges in BINS.items()}
        run, solution = run_of(scene, RESOLUTIONS[-2], 1e-4)
        last = solution.coefficients[CYCLES]
        self.unsure = self.errors(solution.survival, lambda edges: run.space.bin_integrals(last, *edges))
        joint = np.minimum.outer(self.survival, self.survival) - np.outer(self.survival, self.survival)
        drawn = np.random.default_rng(1).multivariate_normal(np.zeros(CYCLES + 1), joint, DRAWN)
        self._worst = float(np.abs(drawn).max(axis=1).mean())

    def errors(self, survival, bins):
        """Errors by kind: the largest in survival, and L1 after the last cycle."""
        apart = {name: distances.l1(bins(edges), self.bins[name]) for name, edges in BINS.items()}
        return {"survival": float(np.abs(survival - self.survival).max())} | apart

    def sampled(self, count):
        """Return the expected errors of a sample: that of survival is the largest over the cycles."""
        laws = {name: np.clip(bins, 0.0, 1.0) for name, bins in self.bins.items()}
        floors = {name: distances.l1_floor(law, count, math.inf) for name, law in laws.items()}
        return {"survival": self._worst / math.sqrt(count)} | floors

    def against_paths(self):
        """Hold it against the tracked paths: their number, L1 on fine bins, its floor, survival less theirs, error."""
        counts = load()
        apart = distances.l1(self.bins["fine"], counts.bins / counts.paths)
        floor = distances.l1_floor(np.clip(self.bins["fine"], 0.0, 1.0), counts.paths, math.inf)
        standing = counts.standing / counts.paths
        error = math.sqrt(standing * (1.0 - standing) / counts.paths)
        return counts.paths, apart, floor, self.survival[CYCLES] - standing, error

    def paths(self, kind, error):
        """Realizations that a sample needs for an expected error."""
        low, high = 1.0, 1e15
        while high > 1.0001 * low:
            middle = math.sqrt(low * high)
            low, high = (middle, high) if self.sampled(middle)[kind] > error else (low, middle)
        return high
