"""The picture of a risk: the curve with its records, the hazard, and which intensities the frequency comes from."""

from typing import Any

import numpy as np

from fpk_rocking.base.types import Array, File
from fpk_rocking.output import style
from fpk_rocking.risk.frequency import Risk


def risk_figure(path: File, risk: Risk, records: Array) -> Any:
    """Draw a risk.

    Parameters
    ----------
    path : str or pathlib.Path
        PNG file to write.
    risk : Risk
    records : ndarray, shape (r, n)
        Probabilities of each record at the curve's intensities.
    """
    curve, colour = risk.curve, style.COLOURS[0]
    name = f"{curve.measure}, {curve.unit}"
    title = f"Annual frequency {risk.rate:.2g}: return period {risk.return_period:,.0f} years"
    with style.page(path, (11.0, 5.2), title, risk.sentences) as figure:
        left, right = figure.subplots(1, 2)
        for number, row in enumerate(records if len(records) > 1 else ()):
            label = "" if number else f"each of {len(records)} records"
            left.plot(curve.intensity, row, color="0.75", linewidth=0.6, label=label)
        low, high = curve.interval.T
        bars = np.maximum(0.0, [curve.probability - low, high - curve.probability])
        label = "mean, 95 % limits"
        left.errorbar(curve.intensity, curve.probability, bars, fmt="o", color=colour, label=label, zorder=3)
        grid = np.geomspace(0.8 * curve.intensity[0], 1.25 * curve.intensity[-1], 300)
        shown = "lognormal fit" if curve.fitted else "points joined by lines"
        left.plot(grid, curve(grid), color="black", label=shown)
        left.set(title=f"(a) P({curve.name})", xlabel=name, ylabel="probability", xscale="log", ylim=(-0.02, 1.02))
        left.legend(loc="upper left")
        widths = np.diff(risk.edges)
        if risk.rate > 0.0:
            look = {"align": "edge", "color": style.COLOURS[1], "edgecolor": "white"}
            right.bar(risk.edges[:-1], risk.contribution, widths, **look)
        right.set(title="(b) Where the frequency comes from", xlabel=name, ylabel="share (bars)", xscale="log")
        other = right.twinx()
        span = np.geomspace(risk.edges[0], risk.edges[-1], 200)
        other.loglog(span, risk.hazard(span), color="black")
        other.set_ylabel("hazard: exceeded per year (line)")
