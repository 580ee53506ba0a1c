"""What speaks against fragility curves: the noise, missing answers, fits that the data reject."""

from typing import Any

import numpy as np

from fpk_rocking.results.remarks import path_diagnostics, scene_diagnostics
from fpk_rocking.results.trust import CAUTION, UNUSABLE, Diagnostic


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
    """Return a list with a `Diagnostic` if a curve of a `Fragility` falls as the shaking grows; else an empty list.

    It falls by more than its limits of 99.99 %: weaker shaking is then not safer.
    """
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
