"""Densities from samples, each bin with its own sampling noise: first-passage times and impact speeds.

Intervals are Wilson's. The bins of one histogram are not independent of each other: each interval has its level alone.
"""

from typing import NamedTuple

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.types import Array, ArrayLike
from fpk_rocking.results.binning import ascending_edges
from fpk_rocking.results.intervals import wilson_interval
from montecarlo.results.ensemble import Ensemble
from montecarlo.results.histories import Histories


class Histogram(NamedTuple):
    """A probability density estimated in n bins; nondimensional.

    Attributes
    ----------
    edges : ndarray, shape (n + 1,)
        Edges of the bins.
    counts : ndarray of int, shape (n,)
        Number of values in each bin.
    density : ndarray, shape (n,)
        Mean density over each bin.
    interval : ndarray, shape (n, 2)
        Confidence limits of the density.

    Examples
    --------
    >>> from fpk_rocking import load_scene
    >>> from montecarlo import first_passage, simulate
    >>> passage = first_passage(simulate(load_scene("main"), cycles=4, realizations=1000), [0.0, 4.0, 8.0])
    >>> print(passage.counts, passage.interval.round(3))
    [ 0 98] [[0.    0.001]
     [0.02  0.029]]
    """

    edges: np.ndarray
    counts: np.ndarray
    density: np.ndarray
    interval: np.ndarray


def first_passage(result: Ensemble | Histories, edges: ArrayLike, level: float = 0.95) -> Histogram:
    """Estimate the probability density of the time of overturning.

    It integrates to the probability of overturning between the outer edges, which is less than 1 where blocks survive.

    Parameters
    ----------
    result : Ensemble or Histories
        Realizations with their times of overturning.
    edges : array_like, shape (n + 1,)
        Ascending times τ; bins are closed to the left, the last one to both sides.
    level : float
        Confidence of each interval, in (0, 1).

    Returns
    -------
    Histogram

    Raises
    ------
    TypeError, ValueError
        The edges or the level are refused.

    Examples
    --------
    >>> from fpk_rocking import load_scene
    >>> from montecarlo import first_passage, simulate
    >>> ensemble = simulate(load_scene("main"), cycles=4, realizations=1000)
    >>> print(first_passage(ensemble, [0.0, 4.0, 8.0]).density.round(3))
    [0.    0.024]
    """
    checks.instance("result", result, Ensemble, Histories)
    edges = ascending_edges("edges", edges, finite=True)
    times = np.asarray(result.overturn_time)
    counts = np.histogram(times[np.isfinite(times)], edges)[0]
    return _histogram(edges, counts, times.size, wilson_interval(counts, times.size, level))


def impact_speeds(histories: Histories, edges: ArrayLike, level: float = 0.95) -> Histogram:
    """Estimate the probability density of the speed just before an impact, over all impacts of all realizations.

    It integrates to the share of the impacts between the outer edges. The impacts of one realization depend on each
    other; the realizations do not. So the variance of a bin's share is computed as that of a ratio of sums over
    realizations, and its interval is Wilson's for as many independent impacts as have this variance (cf. E. L. Korn, B.
    I. Graubard, Survey Methodology 24, 193-201, 1998): at most the number of impacts, and for an empty bin the number
    of realizations that had an impact.

    Parameters
    ----------
    histories : Histories
        At least two realizations of them have an impact.
    edges : array_like, shape (n + 1,)
        Ascending speeds; bins are closed to the left, the last one to both sides.
    level : float
        Confidence of each interval, in (0, 1).

    Returns
    -------
    Histogram

    Raises
    ------
    TypeError, ValueError
        The edges or the level are refused, or too few realizations had an impact.

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

    Parameters
    ----------
    probabilities : array_like
        Estimates, each a count over `realizations`.
    realizations : int
        Size of the sample.

    Returns
    -------
    ndarray, shape of the probabilities
        Half the width of Wilson's interval of one standard deviation: √(p (1 - p)/n) in a bin of many realizations, and
        about 1/(2 n) in an empty one, where that would be 0.

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
    widths = np.diff(edges)
    return Histogram(edges, counts, counts / trials / widths, interval / widths[:, None])
