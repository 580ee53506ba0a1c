"""Calibration: a block fitted to tests in which it overturned or stood. The model and its posterior: `posterior`."""

import math
import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import scipy

from fpk_rocking.base import checks
from fpk_rocking.base.checks import ArrayLike, Progress
from fpk_rocking.physics.forcing import Record
from fpk_rocking.risk.drawing import distribution_of
from fpk_rocking.risk.outcomes import SCATTERED, SHARED, block_scenes, outcomes_as_bool, outcomes_of
from fpk_rocking.risk.posterior import Calibration, drawn_names, values_at

PRIOR = {
    SCATTERED: "lognormal:0.09:0.3",
    SHARED: "lognormal:4.8:0.2",
    "restitution": "uniform:0.4:1",
    "scatter": "uniform:0.02:0.5",
    "stray": "beta:1:30:0:1",
}
"""Prior of a free-standing block of half a metre to a metre."""

NODES = 25
"""Critical angles at which blocks are followed."""


def calibrated(
    motions: Sequence[Record],
    outcomes: ArrayLike,
    prior: Mapping[str, Any] | None = None,
    *,
    draws: int = 32,
    spread: float = 0.1,
    overturning: float = 0.5 * math.pi,
    seed: int = 1,
    progress: Progress | None = None,
) -> Calibration:
    """Fit a block to tests: in which of them it overturned.

    Each motion shakes `draws` blocks at up to 25 critical angles. An angle whose neighbours have the same outcome is
    taken to have it too.

    Parameters
    ----------
    motions : sequence of Record, (n,)
        Accelerations of the base as measured.
    outcomes : array_like of bool, (n,)
        Whether the block overturned in each test.
    prior : dict of str, optional
        Distributions by name, as texts of `drawn`. Of the block: "critical_angle" (radians; of its median),
        "frequency_parameter" (rad/s), "restitution" (without it Housner's) and "offset" of the centre of mass (half
        widths; without it 0). "scatter" is the dispersion of the critical angle from test to test, "stray" the share of
        outcomes that the model does not explain; without them there is none. By default `PRIOR`.
    draws : int
        Blocks that differ in frequency parameter and restitution, a power of 2.
    spread : float
        Standard deviation of these two, and of the offset, from test to test, in quantiles of their priors.
    overturning : float
        Angle of overturning, in critical angles.
    seed : int
        Seed of the scrambled Sobol points.
    progress : callable, optional
        Called as ``progress(done, total)`` after each motion.

    Returns
    -------
    Calibration
        With `posterior` of the parameters, `predicted` for the tests, and `predict` for other motions.

    Raises
    ------
    TypeError, ValueError
        A parameter is refused.

    Examples
    --------
    >>> from fpk_rocking.risk import calibrated, synthetic_records
    >>> motions = synthetic_records(6, duration=4.0, rms=2.5)
    >>> block = calibrated(motions, [True, True, False, True, False, False], draws=8)
    >>> print(len(block.predicted.probability), block.prior["restitution"])
    6 uniform:0.4:1
    """
    started = time.perf_counter()
    prior = dict(PRIOR if prior is None else prior)
    motions = checks.sequence("motions", motions, "records, one for each test")
    for number, motion in enumerate(motions):
        checks.instance(f"motions[{number}]", motion, Record)
    observed = outcomes_as_bool("outcomes", outcomes, len(motions))
    if SCATTERED not in prior or not {"scatter", "stray"} & prior.keys():
        accepted = f"{SCATTERED}, with scatter or stray or both: no block explains all outcomes"
        raise ValueError(checks.refusal("prior", sorted(prior), accepted))
    draws = checks.count("draws", draws, at_most=4096)
    if draws & (draws - 1):
        raise ValueError(checks.refusal("draws", draws, "a power of 2"))
    spread = checks.number("spread", spread, at_least=0.0)
    for name, law in prior.items():
        distribution_of(name, law)
    names = drawn_names(prior)
    points = scipy.stats.qmc.Sobol(len(names), rng=checks.count("seed", seed, at_least=0)).random(draws)
    values = values_at(points, prior)
    low, high = distribution_of(SCATTERED, prior[SCATTERED]).ppf([0.001, 0.999])
    angles = np.geomspace(low, high, NODES)
    overturns = outcomes_of(block_scenes(names, values, angles, overturning, motions), motions, progress)
    own, wall_s = [motion.source for motion in motions], time.perf_counter() - started
    counted, importance = np.ones(len(own), bool), np.ones(draws)
    settings = spread, overturning, wall_s
    return Calibration(own, prior, angles, values, importance, overturns, observed, counted, *settings)
