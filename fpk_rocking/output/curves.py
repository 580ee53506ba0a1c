"""Pictures of survival and leakage of several results against the cycle, with their sampling errors."""

import pathlib
import textwrap
from collections.abc import Sequence

import numpy as np
from matplotlib.ticker import MaxNLocator

from fpk_rocking.base.types import File
from fpk_rocking.compare import compare
from fpk_rocking.results import style
from fpk_rocking.results.remarks import cautions, noise_text
from fpk_rocking.results.survival import SurvivalResult

__all__ = ["survival_figure"]

_MARKERS = "osD^"
_LINE = 0.22
"""Height of a line of text, inches."""


def survival_figure(path: File, results: Sequence[SurvivalResult], title: str = "") -> pathlib.Path:
    """Draw survival, also on a logarithmic axis, differences from the first result, and leakage per cycle and side.

    Samples are drawn with their 95 % intervals. The interval of a difference supposes that both results have the same
    distribution.

    Parameters
    ----------
    path : path
        File to write; the suffix chooses the format.
    results : sequence of SurvivalResult
        Two to four results, whose scenes differ in the noise alone; the first is the reference.
    title : str
        By default survival in the end, and the largest difference from the first result.

    Returns
    -------
    pathlib.Path
        The file written.

    Examples
    --------
    >>> from fpk_rocking import load_scene, solve_fpk
    >>> from fpk_rocking.output.curves import survival_figure
    >>> from montecarlo import simulate
    >>> scene = load_scene("main")
    >>> results = solve_fpk(scene, cycles=4, tol=1e-2), simulate(scene, cycles=4, realizations=1000)
    >>> print(survival_figure("survival.png", results, title="Main scene, both engines"))
    survival.png
    """
    with style.drawing() as new_figure:
        replaced = filter(None, (result.noise_replacement for result in results))
        notes = textwrap.wrap(" ".join(dict.fromkeys((*replaced, *cautions(*results)))), 125)
        width, height = 10.5, 7.6 + _LINE * (len(results) + len(notes))
        figure = new_figure(figsize=(width, height))
        compared = [compare(result, results[0], joint_cycles=()) for result in results[1:]]
        title = title or _message(results, compared)
        figure.suptitle(
            title, fontsize=style.title_size(title, width), y=1.0 - 0.12 / height, va="top", in_layout=False
        )
        rows = [["survival", "tail", "leakage"], ["difference"] * 3]
        panels = figure.subplot_mosaic(rows, height_ratios=(0.9, 1.0))
        labels = [f"{result.label} ({_noise(result)})" for result in results]
        for result, label, colour, marker in zip(results, labels, style.COLOURS, _MARKERS, strict=False):
            _draw_survival(panels["survival"], result, label, colour, marker)
            _draw_survival(panels["tail"], result, label, colour, marker)
            _draw_leakage(panels["leakage"], result, colour, marker)
        for place, (result, comparison) in enumerate(zip(results[1:], compared, strict=True), start=1):
            _draw_difference(panels["difference"], comparison, result.row_values, place)
        _label_panels(panels, results[0].engine, results[0].row_label)
        handles, names = panels["survival"].get_legend_handles_labels()
        figure.legend(handles, names, loc="upper center", bbox_to_anchor=(0.5, 1.0 - 0.36 / height), ncols=1)
        figure.text(0.02, 0.12 / height, "\n".join(notes), color="#333333", va="bottom", linespacing=1.5)
        bottom, top = (0.15 + _LINE * len(notes)) / height, 1.0 - (0.5 + _LINE * len(results)) / height
        figure.tight_layout(rect=(0.0, bottom, 1.0, top), w_pad=2.0, h_pad=1.5)
        return style.save(figure, path)


def _message(results, compared):
    """Return a sentence on survival of all results in the end, and on the largest difference from the first.

    `results` are of the class `SurvivalResult`, and `compared` are the `Comparison` of all but the first with it.
    """
    ends = ", ".join(f"{result.survival[-1]:.3f}" for result in results)
    apart = max(float(np.abs(comparison.difference).max()) for comparison in compared)
    return f"Survival in the end {ends}; the largest difference is {apart:.2g}"


def _noise(result):
    """Name the noise of a `SurvivalResult`; a note below the panels says what a density has in its place."""
    return "noise replaced, see below" if result.noise_replacement else noise_text(result.scene.noise)


def _open_markers(marker) -> dict:
    """Return the look (dict, as ``axes.plot`` takes it) of points of a marker without a line, open inside."""
    return {"marker": marker, "markersize": 4.0, "markerfacecolor": "white", "linestyle": "none"}


def _draw_survival(axes, result, label, colour, marker):
    """Draw survival of a `SurvivalResult` against its rows on matplotlib's `axes`, with a label, a colour and a marker.

    It is a line for a density, points with 95 % intervals for a sample.
    """
    cycles, survival = result.row_values, np.asarray(result.survival)
    if result.realizations is None:
        axes.plot(cycles, survival, color=colour, label=label)
        return
    look = {"color": colour, "label": label, "marker": marker, "markersize": 2.8}
    if result.deterministic:
        axes.plot(cycles, survival, **_open_markers(marker) | look)
        return
    style.error_bars(axes, cycles, survival, result.survival_interval(0.95), **look)


def _draw_difference(axes, comparison, times, place):
    """Draw survival of one result less that of the first on matplotlib's `axes`, with 95 % intervals.

    `comparison` is their `Comparison`, `times` are the rows as their label counts them, and `place`, from 1 on, the
    number of the result, by which the points are set off.
    """
    bars = 1.96 * comparison.standard_error
    times = times[: len(comparison.difference)]
    beside = times + 0.3 * (place - 1) * times[1]
    axes.errorbar(beside, comparison.difference, bars, color=style.COLOURS[place], **_open_markers(_MARKERS[place]))


def _draw_leakage(axes, result, colour, marker):
    """Draw the probability of overturning in each row of a `SurvivalResult` on matplotlib's `axes`.

    It is drawn to the right upwards and to the left downwards, with a colour and a marker.
    """
    cycles = result.row_values[1:]
    left, right = np.diff(np.asarray(result.overturned), axis=0).T
    shape = _open_markers(marker) | {"markersize": 2.8} if result.realizations else {}
    for values in (right, -left):
        axes.plot(cycles, values, color=colour, **shape)


def _label_panels(panels, reference, counted):
    """Write titles and axes of the four panels, a dict of matplotlib's axes by name.

    `reference` names the first result's engine, and `counted` what the rows are counted in.
    """
    survival, tail, leakage, difference = panels.values()
    survival.set(title="Survival", ylabel="P(not overturned)", ylim=(0.0, 1.03))
    tail.set(title="Survival, logarithmic", ylabel="P(not overturned)", yscale="log")
    difference.set(title=f"Survival less that of the {reference}, 95 % intervals", ylabel="difference of survival")
    difference.axhline(0.0, color=style.COLOURS[0], zorder=1)
    leakage.set(title="Overturned in each cycle", ylabel="left ← probability → right")
    leakage.axhline(0.0, color="black", linewidth=0.8)
    leakage.yaxis.set_major_formatter(lambda value, _: f"{abs(value):g}")
    for axes in panels.values():
        axes.set_xlabel(counted)
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
