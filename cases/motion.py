"""Pictures of blocks and ensembles: time histories, Poincaré points and their mean, overturning, impact speeds."""

import pathlib
from typing import Any

import numpy as np

from fpk_rocking.base.checks import File
from fpk_rocking.results import pictures
from fpk_rocking.results.remarks import cautions, noise_text

__all__ = ["ANGLE", "TIME", "VELOCITY", "history_panel", "motion_figure"]

TIME = "time τ, nondimensional"
ANGLE = r"angle Θ = θ / θ$_\mathrm{cr}$"
VELOCITY = "velocity dΘ/dτ, nondimensional"

_SIZE = (10.5, 10.4)


def motion_figure(
    path: File, histories: Any, ensemble: Any, maps: dict[str, Any], passage: Any, speeds: Any, title: str
) -> pathlib.Path:
    """Draw a few time histories with their impacts, and statistics of many realizations.

    Parameters
    ----------
    path : path
        File to write; the suffix chooses the format.
    histories : Histories
        One to four realizations.
    ensemble : Ensemble
        Realizations whose Poincaré points after the last cycle are shown.
    maps : dict of str to MeanMap
        One to four mean Poincaré maps by their labels; two are legible at a glance.
    passage, speeds : Histogram
        Densities of the time of overturning, and of the speed just before an impact.
    title : str
        Title of the figure.

    Returns
    -------
    pathlib.Path
        The file written.
    """
    scene = ensemble.scene
    notes = [f"{ensemble.label}; {noise_text(scene.noise)}. Bars: 95 % intervals.", *cautions(ensemble)]
    with pictures.page(path, _SIZE, title, notes) as figure:
        top, middle, bottom = figure.subfigures(3, 1, height_ratios=(1.1, 1.0, 0.8))
        rows = top.subplots(histories.realizations, 1, sharex=True, sharey=True, squeeze=False)[:, 0]
        for r, axes in enumerate(rows):
            history_panel(axes, histories, r)
        rows[0].set_title("(a) Single blocks: a dot is an impact, a cross the overturning at the cut-off (dashed)")
        rows[-1].set(xlabel=TIME, xlim=(0.0, _shown(histories)))
        top.supylabel(ANGLE, fontsize=10)
        panels = middle.subplot_mosaic([["points", "angle"], ["points", "velocity"]])
        _points(panels["points"], ensemble)
        for column, name in enumerate(("angle", "velocity")):
            _means(panels[name], maps, column)
        panels["angle"].set_title("(c) Mean Poincaré points")
        panels["angle"].tick_params(labelbottom=False)
        panels["angle"].set_ylabel("mean angle")
        panels["velocity"].set(xlabel="forcing cycles", ylabel="mean velocity")
        panels["velocity"].xaxis.get_major_locator().set_params(integer=True)
        middle.legend(*panels["angle"].get_legend_handles_labels(), fontsize=9, loc="outside lower right", ncols=2)
        first, impacts = bottom.subplots(1, 2)
        _bars(first, passage, "(d) Time of overturning", TIME)
        _bars(impacts, speeds, "(e) Speed just before an impact", "speed, nondimensional")
    return pathlib.Path(path)


def _shown(histories):
    """Return the time at which the histories may end: a little after the last overturning, if all overturn."""
    if np.all(histories.overturn_side != 0):
        return min(1.05 * float(histories.overturn_time.max()), histories.time[-1])
    return histories.time[-1]


def history_panel(axes, histories, r, impacts=True):
    """Draw the angle of one realization against time, its impacts as dots and its overturning as a cross.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
    histories : Histories
    r : int
        Number of the realization.
    impacts : bool
        Whether impacts are drawn: in a long history they would merge.
    """
    cutoff = histories.scene.overturning.angle
    axes.axhline(0.0, color="#888888", linewidth=0.8, zorder=1)
    for level in (-cutoff, cutoff):
        axes.axhline(level, color=pictures.OVERTURNED, linewidth=0.8, linestyle="--", zorder=1)
    axes.plot(histories.time, histories.angle[r], color=pictures.COLOURS[0], linewidth=1.2)
    if impacts:
        times = histories.impact_time[histories.impact_realization == r]
        axes.plot(times, np.zeros_like(times), "o", color="black", markersize=2.8)
    side = histories.overturn_side[r]
    if side:
        axes.plot(histories.overturn_time[r], side * cutoff, "x", color=pictures.OVERTURNED, markersize=8, mew=2)
    axes.set(ylim=(-1.15 * cutoff, 1.15 * cutoff), xlim=(0.0, histories.time[-1]))


def _points(axes, ensemble):
    """Draw the Poincaré points of an ensemble after its last cycle."""
    angle, velocity = ensemble.angle[:, -1], ensemble.velocity[:, -1]
    standing = np.count_nonzero(np.isfinite(angle))
    axes.plot(angle, velocity, ".", markersize=1.5, color=pictures.COLOURS[0], alpha=0.5, rasterized=True)
    axes.set(title=f"(b) Poincaré points of the {standing:,} that stand after {ensemble.cycles} cycles")
    axes.set(xlabel=ANGLE, ylabel=VELOCITY)


def _means(axes, maps, column):
    """Draw one coordinate of mean Poincaré points against the cycle, their curves side by side within it."""
    for k, ((label, mean_map), colour, marker) in enumerate(zip(maps.items(), pictures.COLOURS, "osD^", strict=False)):
        shape = {"marker": marker, "markersize": 3.5, "markerfacecolor": "white", "linewidth": 0.7, "elinewidth": 1.0}
        mean, error = mean_map.points[:, column], 1.96 * mean_map.standard_error[:, column]
        axes.errorbar(np.arange(len(mean)) + 0.12 * k, mean, error, color=colour, label=label, **shape)


def _bars(axes, histogram, title, label):
    """Draw a `Histogram` with its intervals."""
    middles = 0.5 * (histogram.edges[1:] + histogram.edges[:-1])
    axes.stairs(histogram.density, histogram.edges, color=pictures.COLOURS[0], fill=True, alpha=0.25)
    pictures.error_bars(axes, middles, histogram.density, histogram.interval, color=pictures.COLOURS[0], marker="none")
    axes.set(
        title=title,
        xlabel=label,
        ylabel="probability density",
        ylim=(0.0, None),
        xlim=(histogram.edges[0], histogram.edges[-1]),
    )
