"""Results as plain values for JSON."""

import json

import numpy as np

from fpk_rocking.results.remarks import noise_text, remarks
from fpk_rocking.results.storage import write_text

__all__ = ["result_summary", "write_summary"]


def result_summary(result) -> dict:
    """Return what a result says of itself, without its density or its paths.

    Parameters
    ----------
    result : Result
        Of any engine.

    Returns
    -------
    dict
        ``noise``, ``cycles`` or, where there are none, ``times``, ``survival``, ``overturned`` [left, right],
        ``wall_s``, ``trust`` (``verdict`` and ``reasons``) and ``remarks``; of a density also ``error_estimate``,
        ``bins_error_estimate``, ``rest_error_estimate``, ``mass_defect``, ``negative_mass``, ``lost``, ``at_rest``,
        ``moving_negative_mass``, ``diffusion``, ``tol``, ``bins_tol`` where it is finite, and where the replacement of
        the noise was checked the largest ``total_error`` and ``replacement`` (see `fpk_rocking.results.replacement`);
        of an ensemble also ``interval`` (95 %) and its largest ``half_width``, or ``outcome`` where nothing is random,
        ``method``, ``realizations``, ``seed`` and ``steps_per_cycle``.
    """
    common = {
        "noise": noise_text(result.scene.noise),
        **({"times": result.times.tolist()} if result.cycles is None else {"cycles": int(result.cycles)}),
        "survival": np.asarray(result.survival).tolist(),
        "overturned": np.asarray(result.overturned).tolist(),
        "wall_s": float(result.wall_s),
    }
    return common | result.facts | {"trust": result.trust.plain, "remarks": list(remarks(result))}


def write_summary(path, values):
    """Write plain values as a JSON file, whole or not at all; nan is refused, for JSON has none."""
    write_text(path, json.dumps(values, indent=1, allow_nan=False, ensure_ascii=False) + "\n")
