"""Statistics of samples with their sampling errors: first-passage times, impact speeds, the rate of overturning.

Intervals of densities are Wilson's. Each bin's interval has its level alone: the bins depend on each other.
"""

import numbers
from typing import NamedTuple

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array, ArrayLike, not_none
from fpk_rocking.physics.forcing import refuse_transient
from fpk_rocking.results.sampling import wilson_interval
from fpk_rocking.scene.axes import ascending_edges
from montecarlo.results.ensemble import Ensemble, Histories


class Histogram(NamedTuple):
    """A probability density estimated in n bins; nondimensional.

    Attributes
    ----------
    edges, counts : ndarray, shape (n + 1,) and (n,)
        Edges of the bins, and number of values in each.
    density, interval : ndarray, shape (n,) and (n, 2)
        Mean density over each bin, and its confidence limits.
    """

    edges: np.ndarray
    counts: np.ndarray
    density: np.ndarray
    interval: np.ndarray


def first_passage(result: Ensemble | Histories, edges: ArrayLike, level: float = 0.95) -> Histogram:
    """Estimate the probability density of the time of overturning; where blocks survive it integrates to less than 1.

    Parameters
    ----------
    result : Ensemble or Histories
    edges : array_like, shape (n + 1,)
        Ascending times τ; bins are closed to the left, the last one to both sides.
    level : float
        Confidence of each interval, in (0, 1).

    Examples
    --------
    >>> from fpk_rocking import load_scene
    >>> from montecarlo import first_passage, simulate
    >>> ensemble = simulate(load_scene("main"), cycles=4, realizations=1000)
    >>> print(first_passage(ensemble, [0.0, 4.0, 8.0]).density.round(3))
    [0.    0.024]
    """
    _refuse_late_times("result", checks.instance("result", result, Ensemble, Histories))
    edges = ascending_edges("edges", edges, finite=True)
    times = np.asarray(result.overturn_time)
    counts = np.histogram(times[np.isfinite(times)], edges)[0]
    return _histogram(edges, counts, times.size, wilson_interval(counts, times.size, level))


def _refuse_late_times(name, result):
    """Raise ValueError for a result of `Ensemble.from_paths`: a block has overturned before the time that it has."""
    if isinstance(result, Ensemble) and not result.steps_per_cycle:
        got = "own paths, whose times of overturning are those of the first state after it"
        raise ValueError(checks.refusal(name, got, "what `simulate` or `histories` returns"))


def impact_speeds(histories: Histories, edges: ArrayLike, level: float = 0.95) -> Histogram:
    """Estimate the probability density of the speed just before an impact, over all impacts of all realizations.

    The impacts of one realization depend on each other. So the variance of a bin's share is that of a ratio of sums
    over realizations, and its interval is Wilson's for as many independent impacts as have this variance (cf. E. L.
    Korn, B. I. Graubard, Survey Methodology 24, 193-201, 1998): at most all impacts; for an empty bin, as many as
    realizations have one.

    Parameters
    ----------
    histories : Histories
        At least two realizations have an impact, else ValueError.
    edges : array_like, shape (n + 1,)
        Ascending speeds; bins are closed to the left, the last one to both sides.
    level : float
        Confidence of each interval, in (0, 1).

    Examples
    --------
    >>> from fpk_rocking import load_scene
    >>> from montecarlo import histories, impact_speeds
    >>> paths = histories(load_scene("main"), cycles=4, realizations=100)
    >>> print(impact_speeds(paths, [0.0, 1.0, 2.0, 3.0]).density.round(2))
    [0.07 0.28 0.66]
    """
    checks.instance("histories", histories, Histories)
    edges = ascending_edges("edges", edges, finite=True)
    owners, owner = np.unique(histories.impact_realization, return_inverse=True)
    units, total = owners.size, owner.size
    if units < 2:
        accepted = "at least 2, as the sampling noise follows from their scatter"
        raise ValueError(checks.refusal("histories: realizations with an impact", units, accepted))
    speeds = np.abs(histories.impact_velocity)
    place = np.searchsorted(edges, speeds, side="right") - 1
    place[speeds == edges[-1]] = edges.size - 2
    inside = (place >= 0) & (place < edges.size - 1)
    table = np.zeros((units, edges.size - 1))
    np.add.at(table, (owner[inside], place[inside]), 1.0)
    counts = table.sum(axis=0).astype(int)
    share = counts / total
    residual = table - share * np.bincount(owner)[:, None]
    variance = units / (units - 1) * np.square(residual).sum(axis=0) / total**2
    independent = np.full(share.shape, float(units))
    np.divide(share * (1.0 - share), variance, out=independent, where=variance > 0.0)
    trials = np.minimum(independent, total)
    return _histogram(edges, counts, total, wilson_interval(share * trials, trials, level))


def bin_errors(probabilities: ArrayLike, realizations: int) -> Array:
    """Return the sampling error of each bin's probability, as `Ensemble.bin_probabilities` estimates them.

    Half of Wilson's interval of one standard deviation: √(p (1 - p)/n), but about 1/(2 n) in an empty bin.

    Parameters
    ----------
    probabilities : array_like
        Estimates, each a count over `realizations`.
    realizations : int
        Size of the sample.

    Examples
    --------
    >>> from montecarlo import bin_errors
    >>> print(bin_errors([0.0, 0.1, 0.5], realizations=1000).round(4))
    [0.0005 0.0095 0.0158]
    """
    share = np.asarray(probabilities, float)
    trials = checks.count("realizations", realizations)
    return np.sqrt(share * (1.0 - share) / trials + 0.25 / trials**2) / (1.0 + 1.0 / trials)


def _histogram(edges, counts, trials, interval):
    """Return the `Histogram` of counts among `trials` values, by limits of each bin's share (n, 2)."""
    widths = np.diff(edges)
    return Histogram(edges, counts, counts / trials / widths, interval / widths[:, None])


class Rate(NamedTuple):
    """A rate of overturning.

    Attributes
    ----------
    rate : float
        Overturned blocks over the sum of the cycles that all blocks stood.
    interval : ndarray, shape (2,)
        Confidence limits of the rate.
    count : int
        Number of overturned blocks behind it.
    """

    rate: float
    interval: np.ndarray
    count: int  # type: ignore[assignment]  # a field, in place of the method of a tuple


def overturning_rate(ensemble: Ensemble, after: int, level: float = 0.95, side: int | None = None) -> Rate:
    """Estimate the rate of overturning per forcing cycle of the blocks that still stand after some cycles.

    The interval is the exact one of a Poisson count (F. Garwood, Biometrika 28, 437-442, 1936), as if all blocks had
    the same rate. Under band noise they have not: its frequencies are drawn once for each block.

    Parameters
    ----------
    ensemble : Ensemble
        Under periodic forcing, of a scene that is not deterministic.
    after : int
        Number of forcing cycles at the beginning that do not count, fewer than the ensemble has.
    level : float
        Confidence of the interval, in (0, 1).
    side : {None, -1, 1}
        Side of overturning: -1 left, 1 right, None either.

    Examples
    --------
    >>> from fpk_rocking import load_scene
    >>> from montecarlo import overturning_rate, simulate
    >>> ensemble = simulate(load_scene("main"), cycles=4, realizations=1000)
    >>> rate = overturning_rate(ensemble, after=2)
    >>> print(f"{rate.rate:.3f} per cycle, {rate.interval.round(3)}")
    0.073 per cycle, [0.061 0.086]
    """
    _refuse_late_times("ensemble", checks.instance("ensemble", ensemble, Ensemble))
    refuse_transient(ensemble.scene.forcing, "a rate of overturning per cycle")
    if ensemble.deterministic:
        accepted = "a scene with noise or a start that is spread; one path has a time of overturning and no rate"
        raise ValueError(checks.refusal("ensemble", "a deterministic scene", accepted))
    after, level = checks.count("after", after), checks.part("level", level)
    if isinstance(side, bool) or not (side is None or (isinstance(side, numbers.Integral) and abs(side) == 1)):
        raise ValueError(checks.refusal("side", side, "None, or -1 (left) or 1 (right)"))
    cycles, period = not_none(ensemble.cycles), not_none(ensemble.scene.period)
    if after >= cycles or ensemble.survivors[ensemble.row_of(after)] == 0:
        accepted = f"a number below {cycles}, of cycles after which a block still stands"
        raise ValueError(checks.refusal("after", after, accepted))
    ends = ensemble.overturn_time / period
    lived = np.where(ensemble.overturn_side == 0, cycles, ends) - after
    exposure = lived[lived > 0.0].sum()
    standing = np.isfinite(ensemble.angle[:, ensemble.row_of(after)])
    counted = (ensemble.overturn_side != 0) if side is None else (ensemble.overturn_side == side)
    count = int(np.count_nonzero(standing & counted))
    tail = 0.5 - 0.5 * level
    from scipy import stats

    low = 0.5 * stats.chi2.ppf(tail, 2 * count) if count else 0.0
    return Rate(float(count / exposure), np.array([low, 0.5 * stats.chi2.isf(tail, 2 * count + 2)]) / exposure, count)
