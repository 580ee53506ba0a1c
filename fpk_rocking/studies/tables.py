"""Fragility curves as a table on standard output."""

from typing import Any

import numpy as np
from rich.table import Table

from fpk_rocking.output.tables import text_table, told
from fpk_rocking.studies.lognormal import P_VALUE

__all__ = ["fragility_table", "size_of"]


def size_of(result: Any) -> str:
    """Return how many paths are behind each probability, as a text."""
    mean = f"{result.label(0)}, " * result.mixture
    if result.deterministic.all():
        return f"{mean}one path a point"
    return mean + (f"{result.realizations:,} realizations a point" if result.realizations else "with error estimates")


def fragility_table(result: Any) -> tuple[str, Table, tuple[str, ...]]:
    """Return title, table and closing sentences for the probabilities at each scale, for `output.tables.show`.

    Parameters
    ----------
    result : Fragility

    Returns
    -------
    title : str
    table : rich.table.Table
    sentences : tuple of str
        The verdict, the fits, notes on the columns, the seconds, and the remarks.
    """
    many, still = len(result.place) > 1, result.deterministic
    sized = all(np.isfinite(measure.pga) or np.isfinite(measure.pgv) for measure in result.intensities)
    names = [result.axis] * many + ["scale"] + (["PGA, g", "PGV, m/s"] if sized else ["p PGV / (g tan θ_cr)"])
    for name in result.names_with_degrees:
        names += [name] + ["95 %" if result.realizations else "± estimate"] * (not still.all())
    limits = result.interval()

    def rows(m, place):
        for n, scale in enumerate(result.scale):
            measures = result.intensities[m].columns(scale)
            shown = [measures[name] for name in (("pga_g", "pgv_m_per_s") if sized else ("relative_velocity",))]
            cells = [f"{place:g}"] * many + [f"{scale:.4g}"]
            cells += [f"{value:.3f}" if np.isfinite(value) else "-" for value in shown]
            for which in range(len(result.names)):
                value, (low, high) = result.probability[m, which, n], limits[m, which, n]
                error = "exact" if still[m] else f"{low:.4f}–{high:.4f}"
                shown = [f"{value:z.4f}", error] if np.isfinite(value) else ["-", "-"]
                cells += shown[: 1 if still.all() else 2]
            yield cells

    title = f"Fragility by {result.engine}, {size_of(result)}"
    fits = [result.describe(m, which) for m in range(len(result.place)) for which in range(len(result.names))]
    notes = [P_VALUE] if result.tested else []
    what = "PGA, PGV: peak acceleration and velocity" if sized else "p PGV / (g tan θ_cr): peak velocity"
    notes.append(f"{what} of the shaking without noise{'' if sized else ', nondimensional'}.")
    table = text_table(names, *(rows(*place) for place in enumerate(result.place)))
    return title, table, told(result.trust, *fits, *notes, f"{result.wall_s:.1f} s.", *result.remarks)
