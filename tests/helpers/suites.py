"""Curves, records and suites of motions with probabilities of their own, for tests of studies and risk."""

import dataclasses

import numpy as np

from fpk_rocking import Dimensions, Record, Scene
from fpk_rocking.risk import IntensityCurve
from fpk_rocking.risk.curves import Fragility
from fpk_rocking.risk.lognormal import LognormalFit
from fpk_rocking.risk.search import MotionOutcomes, overturns

SIZE = Dimensions(0.6, 2.0)


SCALES = np.geomspace(0.1, 3.0, 12)


def curve_of(median=0.7, spread=0.4, records=1, replicates=None):
    """Make a curve whose points lie on a lognormal one."""
    fit = LognormalFit(median, spread, misfit=0.0)
    share = fit(SCALES)
    limits = np.stack([0.9 * share, np.minimum(1.0, 1.1 * share)], axis=-1)
    own = np.empty((0, 2)) if replicates is None else np.asarray(replicates, float)
    return IntensityCurve("overturned", "PGV", SCALES, share, limits, fit, own, records, units=records)


def record(seed):
    """Make a noisy record of a strength of its own."""
    time, rng = np.arange(0.0, 6.0, 0.02), np.random.default_rng(seed)
    waves = np.sin(2.0 * np.pi * np.outer(time, rng.uniform(0.5, 4.0, 6)) + rng.uniform(0.0, 6.0, 6)).sum(axis=1)
    return Record(0.02, rng.uniform(0.5, 2.0) * waves * np.exp(-(((time - 2.5) / 1.5) ** 2)), "m/s2", 1.0)


def suite(shares, scenes, realizations):
    """Fragility of some scenes with probabilities (m, n) at `SCALES`."""
    shares = np.asarray(shares, float)[:, None]
    return Fragility(
        tuple(scenes), "scene", np.arange(len(scenes)), np.empty(0), SCALES, shares, np.full(shares.shape, np.nan),
        "exact", realizations, True, {}, "", {}, 0.0,
    )  # fmt: skip


def searched(logs):
    """Fragility of motions (m,) without noise that overturn a block from the exponentials of these logarithms on."""
    jumps, scenes = np.exp(logs)[:, None], (Scene.from_block(0.5, 1.8, "0.3 g", "1.5 Hz"),) * len(logs)
    made = suite(overturns(jumps, SCALES), scenes, 1)
    outcomes = MotionOutcomes(jumps[:, None], *np.zeros((3, len(logs))))
    return dataclasses.replace(made, motions=outcomes, options={"farthest": 1000.0})
