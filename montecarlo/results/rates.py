"""The rate of overturning once the start is forgotten, from counts over cycles lived."""

import numbers
from typing import NamedTuple

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.physics.forcing import refuse_transient
from montecarlo.results.ensemble import Ensemble


class Rate(NamedTuple):
    """Overturned blocks per cycle lived: `rate`, its confidence limits `interval` (2,), and the `count` behind it."""

    rate: float
    interval: np.ndarray
    count: int


def overturning_rate(ensemble: Ensemble, after: int, level: float = 0.95, side: int | None = None) -> Rate:
    """Estimate the rate of overturning of the blocks that still stand after some cycles.

    Parameters
    ----------
    ensemble : Ensemble
    after : int
        Forcing cycles that do not count, below the ensemble's.
    level : float
        Confidence of the interval, in (0, 1).
    side : {None, -1, 1}
        Side to which a block has to overturn in order to count: left -1, right 1, either None.

    Returns
    -------
    Rate
        Per forcing cycle. The interval is the exact one of a Poisson count (F. Garwood, Biometrika 28, 437-442, 1936),
        as if all blocks had one rate. Under band noise they have not, as its frequencies are drawn once for each block;
        the most endangered go first.

    Raises
    ------
    TypeError, ValueError
        A parameter is refused, or no block stands after these cycles.
    """
    checks.instance("ensemble", ensemble, Ensemble)
    refuse_transient(ensemble.scene.forcing, "a rate of overturning per cycle")
    after, level = checks.count("after", after), checks.number("level", level, above=0.0)
    if level >= 1.0:
        raise ValueError(checks.refusal("level", level, "a number above 0 and below 1"))
    if isinstance(side, bool) or not (side is None or (isinstance(side, numbers.Integral) and abs(side) == 1)):
        raise ValueError(checks.refusal("side", side, "None, or -1 (left) or 1 (right)"))
    if after >= ensemble.cycles or ensemble.survivors[after] == 0:
        accepted = f"cycles below {ensemble.cycles}, after which a block still stands"
        raise ValueError(checks.refusal("after", after, accepted))
    ends = ensemble.overturn_time / ensemble.scene.period
    lived = np.where(ensemble.overturn_side == 0, ensemble.cycles, ends) - after
    exposure = lived[lived > 0.0].sum()
    standing = np.isfinite(ensemble.angle[:, after])
    counted = (ensemble.overturn_side != 0) if side is None else (ensemble.overturn_side == side)
    count = int(np.count_nonzero(standing & counted))
    tail = 0.5 - 0.5 * level
    from scipy import stats

    low = 0.5 * stats.chi2.ppf(tail, 2 * count) if count else 0.0
    return Rate(float(count / exposure), np.array([low, 0.5 * stats.chi2.isf(tail, 2 * count + 2)]) / exposure, count)
