"""Intensities that are added to those asked for, where the rate under noise comes from."""

import dataclasses
import math
from collections.abc import Callable

import numpy as np

from fpk_rocking.base.checks import Array
from fpk_rocking.risk.rate import Risk
from fpk_rocking.studies.result import Fragility

MOVED, CLOSEST, MOST_INTENSITIES = 0.01, 0.02, 64
"""With noise intensities are added until the rate moves by less than this part, no closer in the logarithm than this to
others, up to so many, or twice those asked for."""


def refined(
    sample: Callable[[Array, int], Fragility], risk_of: Callable[[Fragility], Risk], asked: Array
) -> tuple[Fragility, int, float]:
    """Add intensities where the rate comes from, until a round of them moves it by less than `MOVED`.

    Parameters
    ----------
    sample : callable
        `Fragility` of intensities (n,) and the number of the round.
    risk_of : callable
        `Risk` of a `Fragility`.
    asked : ndarray, shape (n,)
        Intensities to begin with, ascending.

    Returns
    -------
    curves : Fragility
    added : int
        Number of intensities that were added; 0 without noise, where the rate does not depend on them.
    moved : float
        Part of the rate by which the last round moved it; inf where the rate is 0.
    """
    curves, rounds = sample(asked, 0), 0
    if curves.motions is not None:
        return curves, 0, 0.0
    risk, moved = risk_of(curves), math.inf
    while risk.rate > 0.0 and moved > MOVED and curves.scale.size < max(MOST_INTENSITIES, 2 * asked.size):
        more, rounds = _more_intensities(risk), rounds + 1
        if not more.size:
            return curves, curves.scale.size - asked.size, 0.0
        curves, before = _joined(curves, sample(more, rounds)), risk.rate
        risk = risk_of(curves)
        moved = abs(risk.rate / before - 1.0)
    return curves, curves.scale.size - asked.size, moved


def _more_intensities(risk):
    """Intensities (n,) that part the intervals of a curve in which the rate is least known, four fifths of it in all.

    By how much: half the rise of the probability over an interval, times the rate at which it is met. Below the lowest
    point the probability may be that of it or 0. Intervals narrower than `CLOSEST` are not parted.
    """
    y, shares = np.log(risk.curve.intensity), np.maximum.accumulate(risk.curve.probability)
    step = max(float(np.diff(y).max(initial=0.0)), CLOSEST)
    y, shares = np.append(y[0] - 2.0 * step, y), np.append(0.0, shares)
    doubt = -0.5 * np.diff(shares) * np.diff(risk.hazard(np.exp(y)))
    doubt[np.diff(y) < 2.0 * CLOSEST] = 0.0
    order = np.argsort(-doubt, kind="stable")
    chosen = order[: np.searchsorted(np.cumsum(doubt[order]), 0.8 * doubt.sum()) + 1]
    chosen = chosen[doubt[chosen] > 1e-3 * risk.rate]
    return np.sort(np.exp(0.5 * (y[1:] + y[:-1])[chosen]))


def _joined(first, second):
    """Return the `Fragility` of the scales of two, of the same scenes."""
    scale = np.concatenate([first.scale, second.scale])
    order = np.argsort(scale)
    place = np.argsort(order)
    reasons = {
        ",".join([*key.split(",")[:2], str(place[int(key.split(",")[2]) + begin])]): reason
        for part, begin in ((first, 0), (second, first.scale.size))
        for key, reason in part.reasons.items()
    }
    parts = {
        name: np.concatenate([getattr(first, name), getattr(second, name)], axis=-1)[..., order]
        for name in ("scale", "probability", "error_estimate")
    }
    return dataclasses.replace(first, **parts, reasons=reasons, wall_s=first.wall_s + second.wall_s)
