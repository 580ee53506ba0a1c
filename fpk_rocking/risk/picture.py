"""Pictures of a risk: the motions, the curve with its records, the hazard, and where the frequency comes from."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from fpk_rocking.base.types import Array, File
from fpk_rocking.output import style
from fpk_rocking.risk.frequency import Risk
from fpk_rocking.scene.scene import Scene
from fpk_rocking.scene.units import STANDARD_GRAVITY
from fpk_rocking.studies.measures import intensities
from fpk_rocking.studies.picture import logarithmic

_SAMPLES = 2000
"""Times at which a motion is drawn."""


def risk_figure(path: File, risk: Risk, records: Array) -> None:
    """Draw a risk as a page: curve, hazard and contributions.

    Parameters
    ----------
    path : str or pathlib.Path
        PNG file to write.
    risk : Risk
    records : ndarray, shape (r, n)
        Probabilities of each record at the curve's intensities.
    """
    title = f"{risk.headline[0].upper()}{risk.headline[1:]}"
    with style.page(path, (11.0, 5.2), title, risk.sentences) as figure:
        left, right = figure.subplots(1, 2)
        draw_curve(left, risk, records)
        draw_contributions(right, risk)
        left.set_title(f"(a) P({risk.curve.name})")
        right.set_title("(b) Where the rate comes from")


def draw_curve(axes: Any, risk: Risk, records: Array) -> None:
    """Draw the probability with its limits against the intensity, each record, and the curve that is used."""
    curve, colour = risk.curve, style.COLOURS[0]
    for number, row in enumerate(records if len(records) > 1 else ()):
        label = "" if number else f"each of {len(records)} records"
        axes.plot(curve.intensity, row, color="0.75", linewidth=0.6, label=label)
    look = {"color": colour, "marker": "o", "label": "mean, 95 % limits", "zorder": 3}
    style.error_bars(axes, curve.intensity, curve.probability, curve.interval, **look)
    grid = np.geomspace(0.8 * curve.intensity[0], 1.25 * curve.intensity[-1], 300)
    if len(curve.replicates) and curve.fitted:
        from scipy import special

        medians, spreads = curve.replicates.T[:, :, None]
        low, high = np.quantile(special.ndtr(np.log(grid / medians) / spreads), [0.025, 0.975], axis=0)
        axes.fill_between(grid, low, high, color="black", alpha=0.12, linewidth=0.0, label="its 95 % band")
    axes.plot(grid, curve(grid), color="black", label="lognormal fit" if curve.fitted else "points joined by lines")
    axes.set(xlabel=_name(risk), ylabel=f"P({curve.name})", ylim=(-0.02, 1.02))
    logarithmic(axes.set_xscale, axes.xaxis)
    axes.legend(loc="upper left", fontsize=8)


def draw_contributions(axes: Any, risk: Risk) -> None:
    """Draw the share of the frequency that intensities have, and the hazard on an axis of its own."""
    if risk.rate > 0.0:
        look = {"align": "edge", "color": style.COLOURS[1], "edgecolor": "white", "linewidth": 0.5}
        axes.bar(risk.edges[:-1], 100.0 * risk.contribution, np.diff(risk.edges), **look)
    axes.set(xlabel=_name(risk), ylabel="share of the rate, % (bars)", xlim=(risk.edges[0], risk.edges[-1]))
    logarithmic(axes.set_xscale, axes.xaxis)
    axes.grid(visible=False)
    other = axes.twinx()
    span = np.geomspace(risk.edges[0], risk.edges[-1], 200)
    other.plot(span, risk.hazard(span), color="black")
    known = (risk.hazard.intensity >= span[0]) & (risk.hazard.intensity <= span[-1])
    other.plot(risk.hazard.intensity[known], risk.hazard.rate[known], "o", color="black", markersize=3.5)
    other.set(yscale="log", ylabel="exceeded, 1/year (line)")
    other.grid(visible=False)


def draw_motions(axes: Any, scenes: Sequence[Scene]) -> None:
    """Draw the acceleration of each motion against time, one above the other, all with the same unit."""
    found = [(one, one.block.dimensions) for one in scenes if one.block.dimensions is not None]
    peaks = [intensities(one).pga / STANDARD_GRAVITY for one, _ in found]
    step = 1.6 * max(peaks, default=1.0)
    for place, (one, size) in enumerate(found):
        span = one.forcing.duration if np.isfinite(one.forcing.duration) else 5.0 * one.forcing.time_scale
        times = np.linspace(0.0, span, _SAMPLES)
        unit = size.gravity * size.critical_angle / STANDARD_GRAVITY
        force = unit * np.array([one.forcing.value(time) for time in times])
        axes.plot(size.seconds(times), force - step * place, color=style.COLOURS[0], linewidth=0.5)
    axes.set(xlabel="time, s", yticks=[-step * place for place in range(len(found))])
    axes.set_yticklabels([str(place + 1) for place in range(len(found))], fontsize=7)
    axes.set(ylabel=f"motion; {step:.2g} g from line to line", ylim=(-step * (len(found) - 0.4), 0.6 * step))


def _name(risk):
    return f"{risk.curve.measure}, {risk.curve.unit}"
