"""Suites of motions: fields of a curve for a motion drawn from their population; and what speaks against a `Fragility`.

The fields are share, fit, limits and parts of the dispersion. Diagnostics, for a single motion too, are of missing
answers, noise, fits that the data reject, and curves that fall.
"""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import scipy

from fpk_rocking.base.checks import Array
from fpk_rocking.results.remarks import path_diagnostics, scene_diagnostics
from fpk_rocking.results.trust import CAUTION, UNUSABLE, Diagnostic
from fpk_rocking.risk.lognormal import LognormalFit, fit_lognormal

_TESTED = np.linspace(-2.5, 2.5, 41)
"""Where a fit to outcomes without noise is tested if some motions stand in the end, in dispersions from its median."""


def suite_fields(
    capacities: Any,
    intensity: Array,
    shares: Array,
    trials: int,
    drawn: Mapping[str, Any],
    samples: int | None,
    rng: np.random.Generator,
    steps: tuple[Array, Array, float] | None,
) -> dict[str, Any]:
    """Return fields of an `IntensityCurve`, a dict, for a motion drawn from the population of those of m rows."""
    mean, units = capacities.mean_of.T.dot(shares).mean(axis=0), capacities.mean_of.shape[1]
    fields = {
        "probability": mean,
        "units": units,
        "replicates": np.empty((0, 2)),
        "interval": binomial_limits(mean, units),
    }
    places, share, reach = (intensity, mean, math.inf) if steps is None else steps
    fit = fit_lognormal(intensity, mean) if steps is None else LognormalFit()
    if not fit.reason and capacities.complete.size < 2:
        where = "within these intensities" if steps is None else "for good"
        fit = LognormalFit(reason=f"fewer than two motions overturn a block {where}")
    if fit.reason:
        return fields | {"fit": fit}
    population, values = capacities.draws(samples or capacities.usual_draws, rng)
    spreads = np.linalg.norm(population[:, 1:], axis=1)
    # Where two of several motions overturn a block, medians beyond the largest number agree with that too.
    with np.errstate(over="ignore"):
        fields["replicates"] = np.stack([np.exp(population[:, 0]), spreads], axis=-1)
    if steps is not None:
        fit = LognormalFit(*capacities.moments(population))
        fit = fit._replace(misfit=float(np.abs(fit(places) - share).max(initial=0.0)))
        # Apart from the jumps: those of simulated suites lie elsewhere, and a distance is largest at a jump.
        places, known = fit.median * np.exp(fit.dispersion * _TESTED), places
        places = places[places <= reach] if (places <= reach).any() else np.array([reach])
        share = np.append(0.0, share)[np.searchsorted(known, places, side="right")]
    p_value = capacities.p_value(np.log(places), share, trials, rng)
    fit = with_intervals(fit._replace(p_value=p_value), fields["replicates"])
    if not fit.rejected:
        points = scipy.special.ndtr((np.log(intensity) - population[:, :1]) / spreads[:, None])
        fields["interval"] = np.quantile(points, [0.025, 0.975], axis=0).T
    sources = {"noise": (capacities.noise, capacities.noise * capacities.noise_error)} if capacities.noise else {}
    sources |= capacities.parts(values, drawn) if drawn else {}
    rest = math.sqrt(max(fit.dispersion**2 - sum(value**2 for value, _ in sources.values()), 0.0))
    sources["record to record"] = rest, float(np.diff(np.quantile(population[:, 1], [0.16, 0.84]))[0]) / 2.0
    return fields | {"fit": fit, "sources": sources}


def name_sources(suite: Mapping[str, Any], records: int) -> dict[str, Any]:
    """Return a dict of fields of an `IntensityCurve`: "records", "sources" and "source_errors" (float by name)."""
    sources = {
        name: part for name, part in suite.get("sources", {}).items() if records > 1 or name != "record to record"
    }
    values, errors = ({name: part[place] for name, part in sources.items()} for place in (0, 1))
    return {"records": records, "sources": values, "source_errors": errors}


def outcome_steps(jumps: Array) -> tuple[Array, Array]:
    """Intensities (k,), just before each of the jumps (r, b, k) and at it, and the share that overturns there."""
    signs = np.broadcast_to(1.0 - 2.0 * (np.arange(jumps.shape[-1]) % 2), jumps.shape)
    finite = np.isfinite(jumps)
    places, number = np.unique(jumps[finite], return_inverse=True)
    rises = np.bincount(number, signs[finite], places.size) / (jumps.shape[0] * jumps.shape[1])
    share = np.cumsum(rises)
    pairs = np.stack([(1.0 - 1e-9) * places, places], axis=-1), np.stack([share - rises, share], axis=-1)
    return tuple(np.clip(values.ravel()[1:], 0.0, np.inf) for values in pairs)


def binomial_limits(mean: Array, count: int) -> Array:
    """Return Clopper's and Pearson's 95 % limits (n, 2) of a `mean` (n,) over `count` independent outcomes."""
    happened = mean * count
    low = scipy.special.betaincinv(np.maximum(happened, 1e-300), count - happened + 1.0, 0.025)
    high = scipy.special.betaincinv(happened + 1.0, np.maximum(count - happened, 1e-300), 0.975)
    return np.stack([np.where(happened > 0.0, low, 0.0), np.where(happened < count, high, 1.0)], axis=-1)


def with_intervals(fit: LognormalFit, replicates: Array) -> LognormalFit:
    """Return a `LognormalFit` with the 95 % intervals of `replicates` (b, 2), medians and dispersions; nan without."""
    if not len(replicates) or fit.reason:
        return fit._replace(median_interval=(math.nan, math.nan), dispersion_interval=(math.nan, math.nan))
    (low, narrow), (high, wide) = np.quantile(replicates, [0.025, 0.975], axis=0).tolist()
    return fit._replace(median_interval=(low, high), dispersion_interval=(narrow, wide))


def curve_diagnostics(result: Any) -> list[Diagnostic]:
    """Return a list of `Diagnostic` of a `studies.Fragility`, each kind once: its model, fits, missing answers."""
    return model_diagnostics(result) + _rejected(result) + _falling(result)


def model_diagnostics(result: Any) -> list[Diagnostic]:
    """Return a list of `Diagnostic` on model, noise and engine of a `studies.Fragility`, each kind once."""
    return (
        _unanswered(result) + _noise(result) + (path_diagnostics(result.engine) if result.deterministic.any() else [])
    )


def _unanswered(result):
    """Return a list with a `Diagnostic` if some probabilities of a `Fragility` have no answer; else an empty list."""
    if not result.reasons:
        return []
    count, first = result.probability.size, next(iter(result.reasons.values()))
    sentence = f"The engine gave no answer for {len(result.reasons)} of {count} probabilities: {first}"
    return [Diagnostic(CAUTION if len(result.reasons) < count else UNUSABLE, sentence, "unanswered")]


def _noise(result):
    """Return a list of `Diagnostic` on model and noise of the scenes of a `Fragility`, the severest of each kind."""
    kinds: dict[str, dict[Diagnostic, None]] = {}
    for scene in result.scenes:
        for diagnostic in scene_diagnostics(
            scene, result.noise_replacement, scales=(result.scale[0], result.scale[-1])
        ):
            kinds.setdefault(diagnostic.kind, {})[diagnostic] = None
    grouped = []
    for kind in kinds.values():
        first, *others = sorted(kind, key=lambda diagnostic: -diagnostic.severity)
        likewise = f" ({len(others)} of the others likewise.)" * bool(others)
        grouped.append(first._replace(message=first.message + likewise))
    return grouped


def _rejected(result):
    """Return a list with a `Diagnostic` if the data reject lognormal fits of a `Fragility`; else an empty list."""
    curves = [fit for fits in result.fits for fit in fits]
    rejected = [fit for fit in curves if fit.rejected]
    if not rejected:
        return []
    worst = max(rejected, key=lambda fit: fit.misfit)
    which = f" of {len(rejected)} of {len(curves)} curves" if len(curves) > 1 else ""
    sentence = (
        f"The lognormal fit{which} is rejected ({worst.rejected}): it is off by up to {worst.misfit:.2g}. "
        "Use the probabilities themselves."
    )
    return [Diagnostic(CAUTION, sentence, "fit")]


def _falling(result):
    """Return a list with a `Diagnostic` if a curve of a `Fragility` falls as the shaking grows; else an empty list."""
    # At this confidence chance alone seldom makes any curve fall.
    low, high = np.moveaxis(result.interval(0.9999), -1, 0)
    most = np.fmax.accumulate(low, axis=-1)
    fall = np.nan_to_num(most - high, nan=-1.0)
    fall[result.deterministic] = -1.0
    if fall.max() <= 0.0:
        return []
    m, which, last = np.unravel_index(fall.argmax(), fall.shape)
    curve, scale = result.probability[m, which], result.scale
    first = int(np.nanargmax(low[m, which, : last + 1]))
    repeats = "Harmonic shaking may do so by its phase: try others." if result.scenes[0].repeats else ""
    sentence = (
        f"The probability falls as the shaking grows: {curve[first]:.3g} at scale {scale[first]:.4g}, "
        f"{curve[last]:.3g} at {scale[last]:.4g}. {repeats}"
    )
    return [Diagnostic(CAUTION, sentence.strip(), "falls")]
