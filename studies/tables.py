"""Fragility curves as a table on standard output."""

import numpy as np
from rich import box
from rich.table import Table

from fpk_rocking.output.tables import told
from studies.lognormal import P_VALUE

__all__ = ["fragility_table"]


def fragility_table(result):
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
    table = Table(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False, padding=(0, 1, 0, 0))
    many = len(result.scenes) > 1
    for name in ([result.axis] if many else []) + ["scale", "p PGV / (g tan θ_cr)"]:
        table.add_column(name, justify="right")
    limits = result.interval()
    for name in result.names:
        table.add_column(name, justify="right")
        table.add_column("95 %" if result.realizations else "± estimate", justify="center")
    for m, place in enumerate(result.place):
        for n, scale in enumerate(result.scale):
            cells = [f"{place:g}"] * many + [f"{scale:.4g}", f"{scale * result.intensities[m].relative_velocity:.3f}"]
            for which in range(len(result.names)):
                value, (low, high) = result.probability[m, which, n], limits[m, which, n]
                cells += [f"{value:z.4f}", f"{low:.4f}–{high:.4f}"] if np.isfinite(value) else ["-", "-"]
            table.add_row(*cells)
        table.add_section()
    size = f"{result.realizations:,} realizations a point" if result.realizations else "with error estimates"
    title = f"Fragility by {result.engine}, {size}"
    fits = [result.describe(m, which) for m in range(len(result.place)) for which in range(len(result.names))]
    notes = [P_VALUE] if result.realizations else []
    notes.append("p PGV / (g tan θ_cr): peak velocity of the shaking without noise, nondimensional.")
    return title, table, told(result.trust, *fits, *notes, f"{result.wall_s:.1f} s.", *result.remarks)
