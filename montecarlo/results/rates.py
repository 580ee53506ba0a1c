"""The rate of overturning once the start is forgotten, from counts over cycles lived."""

import numbers
from typing import NamedTuple

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.types import known
from fpk_rocking.physics.forcing import refuse_transient
from montecarlo.results.ensemble import Ensemble


class Rate(NamedTuple):
    """A rate of overturning with its confidence interval.

    Attributes
    ----------
    rate : float
        Overturned blocks over the sum of the cycles that all blocks stood.
    interval : ndarray, shape (2,)
        Confidence limits of the rate.
    count : int
        Number of overturned blocks behind it.

    Examples
    --------
    >>> from fpk_rocking import load_scene
    >>> from montecarlo import overturning_rate, simulate
    >>> rate = overturning_rate(simulate(load_scene("main"), cycles=4, realizations=1000), after=2)
    >>> print(rate.count, rate.interval.round(3))
    138 [0.061 0.086]
    """

    rate: float
    interval: np.ndarray
    count: int  # type: ignore[assignment]  # a field, in place of the method of a tuple


def overturning_rate(ensemble: Ensemble, after: int, level: float = 0.95, side: int | None = None) -> Rate:
    """Estimate the rate of overturning of the blocks that still stand after some cycles.

    Parameters
    ----------
    ensemble : Ensemble
        Under periodic forcing, of a scene that is not deterministic.
    after : int
        Number of forcing cycles at the beginning that do not count, fewer than the ensemble has.
    level : float
        Confidence of the interval, in (0, 1).
    side : {None, -1, 1}
        Side to which blocks overturn that count: -1 left, 1 right, None either.

    Returns
    -------
    Rate
        Per forcing cycle. The interval is the exact one of a Poisson count (F. Garwood, Biometrika 28, 437-442, 1936)
        and supposes that all blocks have the same rate. Under band noise they have not: its frequencies are drawn once
        for each block, and blocks in greater danger overturn earlier.

    Raises
    ------
    TypeError, ValueError
        A parameter is refused, the scene is deterministic, or no block stands after these cycles.

    Examples
    --------
    >>> from fpk_rocking import load_scene
    >>> from montecarlo import overturning_rate, simulate
    >>> ensemble = simulate(load_scene("main"), cycles=4, realizations=1000)
    >>> rate = overturning_rate(ensemble, after=2)
    >>> print(f"{rate.rate:.3f} per cycle, {rate.interval.round(3)}")
    0.073 per cycle, [0.061 0.086]
    """
    checks.instance("ensemble", ensemble, Ensemble)
    refuse_transient(ensemble.scene.forcing, "a rate of overturning per cycle")
    if ensemble.deterministic:
        accepted = "a scene with noise or a start that is spread; one path has a time of overturning and no rate"
        raise ValueError(checks.refusal("ensemble", "a deterministic scene", accepted))
    after, level = checks.count("after", after), checks.part("level", level)
    if isinstance(side, bool) or not (side is None or (isinstance(side, numbers.Integral) and abs(side) == 1)):
        raise ValueError(checks.refusal("side", side, "None, or -1 (left) or 1 (right)"))
    cycles, period = known(ensemble.cycles), known(ensemble.scene.period)
    if after >= cycles or ensemble.survivors[after] == 0:
        accepted = f"a number below {cycles}, of cycles after which a block still stands"
        raise ValueError(checks.refusal("after", after, accepted))
    ends = ensemble.overturn_time / period
    lived = np.where(ensemble.overturn_side == 0, cycles, ends) - after
    exposure = lived[lived > 0.0].sum()
    standing = np.isfinite(ensemble.angle[:, after])
    counted = (ensemble.overturn_side != 0) if side is None else (ensemble.overturn_side == side)
    count = int(np.count_nonzero(standing & counted))
    tail = 0.5 - 0.5 * level
    from scipy import stats

    low = 0.5 * stats.chi2.ppf(tail, 2 * count) if count else 0.0
    return Rate(float(count / exposure), np.array([low, 0.5 * stats.chi2.isf(tail, 2 * count + 2)]) / exposure, count)
