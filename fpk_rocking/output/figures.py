"""Pictures that a command saves: survival and leakage of several results, and their joint densities.

Survival and leakage are drawn against the cycle, with sampling errors; densities as surfaces (paper Fig. 6), and as
colour maps of the phase plane.
"""

import pathlib
import textwrap
from collections.abc import Sequence

import numpy as np
from matplotlib.colors import PowerNorm
from matplotlib.ticker import MaxNLocator

from fpk_rocking.base.checks import File
from fpk_rocking.compare import compare
from fpk_rocking.results import pictures
from fpk_rocking.results.remarks import cautions, noise_text, scene_text
from fpk_rocking.results.survival import SurvivalResult
from fpk_rocking.scene.axes import joint_edges

_MARKERS = "osD^"
_LINE = 0.22
"""Height of a line of text, inches."""


def survival_figure(path: File, results: Sequence[SurvivalResult], title: str = "") -> pathlib.Path:
    """Draw survival, differences from the first result, and leakage per cycle and side; return the path.

    Samples have 95 % intervals; the interval of a difference assumes that both results have the same distribution.

    Parameters
    ----------
    path : path
        The suffix chooses the format.
    results : sequence of SurvivalResult
        Two to four, whose scenes differ in the noise alone; the first is the reference.
    title : str
        By default the survival at the end, and the largest difference.

    Examples
    --------
    >>> from fpk_rocking import load_scene, solve_fpk
    >>> from fpk_rocking.output.figures import survival_figure
    >>> from montecarlo import simulate
    >>> scene = load_scene("main")
    >>> results = solve_fpk(scene, cycles=4, tol=1e-2), simulate(scene, cycles=4, realizations=1000)
    >>> print(survival_figure("survival.png", results, title="Main scene, both engines"))
    survival.png
    """
    with pictures.drawing() as new_figure:
        replaced = filter(None, (result.noise_replacement for result in results))
        notes = textwrap.wrap(" ".join(dict.fromkeys((*replaced, *cautions(*results)))), 125)
        width, height = 10.5, 7.6 + _LINE * (len(results) + len(notes))
        figure = new_figure(figsize=(width, height))
        compared = [compare(result, results[0], joint_cycles=()) for result in results[1:]]
        title = title or _message(results, compared)
        figure.suptitle(
            title, fontsize=pictures.title_size(title, width), y=1.0 - 0.12 / height, va="top", in_layout=False
        )
        rows = [["survival", "tail", "leakage"], ["difference"] * 3]
        panels = figure.subplot_mosaic(rows, height_ratios=(0.9, 1.0))
        labels = [f"{result.label} ({_noise(result)})" for result in results]
        for result, label, colour, marker in zip(results, labels, pictures.COLOURS, _MARKERS, strict=False):
            _draw_survival(panels["survival"], result, label, colour, marker)
            _draw_survival(panels["tail"], result, label, colour, marker)
            _draw_leakage(panels["leakage"], result, colour, marker)
        for place, comparison in enumerate(compared, start=1):
            _draw_difference(panels["difference"], comparison, place)
        _label_panels(panels, results[0].engine, results[0].row_label)
        handles, names = panels["survival"].get_legend_handles_labels()
        figure.legend(handles, names, loc="upper center", bbox_to_anchor=(0.5, 1.0 - 0.36 / height), ncols=1)
        figure.text(0.02, 0.12 / height, "\n".join(notes), color="#333333", va="bottom", linespacing=1.5)
        bottom, top = (0.15 + _LINE * len(notes)) / height, 1.0 - (0.5 + _LINE * len(results)) / height
        figure.tight_layout(rect=(0.0, bottom, 1.0, top), w_pad=2.0, h_pad=1.5)
        return pictures.save(figure, path)


def _message(results, compared):
    """Survival of all results in the end, and the largest difference from the first, as a sentence."""
    ends = ", ".join(f"{result.survival[-1]:.3f}" for result in results)
    apart = max(float(np.abs(comparison.difference).max()) for comparison in compared)
    return f"Survival in the end {ends}; the largest difference is {apart:.2g}"


def _noise(result):
    """Name of the noise; a note below the panels says what a density has."""
    return "noise replaced, see below" if result.noise_replacement else noise_text(result.scene.noise)


def _open_markers(marker) -> dict:
    """Look, as ``axes.plot`` takes it, of points without a line, open inside."""
    return {"marker": marker, "markersize": 4.0, "markerfacecolor": "white", "linestyle": "none"}


def _draw_survival(axes, result, label, colour, marker):
    """Draw survival: a line for a density, points with 95 % intervals for a sample."""
    cycles, survival = result.row_values, np.asarray(result.survival)
    if result.realizations is None:
        axes.plot(cycles, survival, color=colour, label=label)
        return
    look = {"color": colour, "label": label, "marker": marker, "markersize": 2.8}
    if result.deterministic:
        axes.plot(cycles, survival, **_open_markers(marker) | look)
        return
    pictures.error_bars(axes, cycles, survival, result.interval, **look)


def _draw_difference(axes, comparison, place):
    """Draw survival of the `place`-th result less that of the first with 95 % intervals, set off by its number."""
    bars = 1.96 * comparison.standard_error
    times = comparison.row_values
    beside = times + 0.3 * (place - 1) * times[1]
    axes.errorbar(beside, comparison.difference, bars, color=pictures.COLOURS[place], **_open_markers(_MARKERS[place]))


def _draw_leakage(axes, result, colour, marker):
    """Draw the probability of overturning in each row: to the right upwards, to the left downwards."""
    cycles = result.row_values[1:]
    left, right = np.diff(np.asarray(result.overturned), axis=0).T
    shape = _open_markers(marker) | {"markersize": 2.8} if result.realizations else {}
    for values in (right, -left):
        axes.plot(cycles, values, color=colour, **shape)


def _label_panels(panels, reference, counted):
    """Write titles and axes of the four panels."""
    survival, tail, leakage, difference = panels.values()
    survival.set(title="Survival", ylabel="P(not overturned)", ylim=(0.0, 1.03))
    tail.set(title="Survival, logarithmic", ylabel="P(not overturned)", yscale="log")
    difference.set(title=f"Survival less that of the {reference}, 95 % intervals", ylabel="difference of survival")
    difference.axhline(0.0, color=pictures.COLOURS[0], zorder=1)
    leakage.set(title="Overturned in each cycle", ylabel="left ← probability → right")
    leakage.axhline(0.0, color="black", linewidth=0.8)
    leakage.yaxis.set_major_formatter(lambda value, _: f"{abs(value):g}")
    for axes in panels.values():
        axes.set_xlabel(counted)
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))


_PIECES = 4
"""Points of a surface in the width of a bin."""


def surface_figure(path: File, results: Sequence[SurvivalResult], cycles: Sequence[float], title: str) -> pathlib.Path:
    """Draw joint densities as surfaces, one panel for each cycle, with walls for what overturned; return the path.

    The height of a surface is the probability in a bin around the point divided by its area, for all engines alike. The
    height of a wall at the overturning angle is the probability of having overturned to that side, up to 1. Panels of
    one cycle share their axes. A start from a point is drawn as a needle.

    Parameters
    ----------
    path : path
        The suffix chooses the format.
    results : sequence of SurvivalResult
        From top to bottom; their scenes differ in the noise alone.
    cycles : sequence of int
        From left to right, three in a row; four in two rows.
    title : str

    Examples
    --------
    >>> from fpk_rocking import load_scene, solve_fpk
    >>> from fpk_rocking.output.figures import surface_figure
    >>> density = solve_fpk(load_scene("main"), cycles=4, tol=1e-2)
    >>> print(surface_figure("surface.png", [density], cycles=[4], title="After 4 cycles"))
    surface.png
    """
    columns = 2 if len(cycles) == 4 else min(3, len(cycles))
    blocks = [cycles[first : first + columns] for first in range(0, len(cycles), columns)]
    rows = len(blocks) * len(results)
    notes = _surface_notes(results, columns)
    width, height = columns * 3.6 + 0.35, rows * 3.05 + 0.6 + 0.2 * len(notes)
    bottom, top = (0.3 + 0.2 * len(notes)) / height, 1.0 - 0.45 / height
    with pictures.drawing() as new_figure:
        figure = new_figure(figsize=(width, height))
        figure.suptitle(title, fontsize=pictures.title_size(title, width), y=1.0 - 0.12 / height, va="top")
        around = {"left": 0.04, "right": 0.965, "bottom": bottom, "top": top}
        cells = figure.add_gridspec(rows, columns, **around, wspace=0.0, hspace=0.0)
        for block, in_row in enumerate(blocks):
            for column, cycle in enumerate(in_row):
                surfaces = [_bin_averages(result, cycle) for result in results]
                highest = max(values.max() for *_, values in surfaces)
                for row, (result, surface) in enumerate(zip(results, surfaces, strict=True)):
                    cell = cells[block * len(results) + row, column]
                    _draw_surface(
                        figure.add_subplot(cell, projection="3d", elev=32, azim=-62), result, cycle, surface, highest
                    )
        # One result is named once, beside all its rows.
        spans = [(row, row) for row in range(rows)] if len(results) > 1 else [(0, rows - 1)]
        look = {"rotation": 90, "va": "center", "ha": "center", "weight": "bold", "linespacing": 1.4}
        for number, (first, last) in enumerate(spans):
            high, low = cells[first, 0].get_position(figure).y1, cells[last, 0].get_position(figure).y0
            figure.text(0.025, 0.5 * (low + high), _row_name(results[number % len(results)]), **look)
        for line, note in enumerate(reversed(notes)):
            figure.text(0.02, (0.12 + 0.2 * line) / height, note, color="#333333")
        return pictures.save(figure, path)


def _row_name(result: SurvivalResult) -> str:
    """Name of a row of panels: engine, its size, and whether noise was replaced."""
    return result.label.replace(", ", "\n") + "\nnoise replaced" * bool(result.noise_replacement)


def _bin_averages(result, cycle):
    """Angle, velocity and mean density in a bin around, (n, m) each, at points a quarter of a bin apart."""
    fine = [np.linspace(edges[0], edges[-1], _PIECES * (edges.size - 1) + 1) for edges in joint_edges(result.scene)]
    within = np.cumsum(np.cumsum(result.bin_probabilities(cycle, *fine), axis=0), axis=1)
    within = np.pad(within, ((1, 0), (1, 0)))
    below, left = within[:-_PIECES, _PIECES:], within[_PIECES:, :-_PIECES]
    bins = within[_PIECES:, _PIECES:] - below - left + within[:-_PIECES, :-_PIECES]
    area = np.multiply.outer(*(edges[_PIECES:] - edges[:-_PIECES] for edges in fine))
    middles = (0.5 * (edges[_PIECES:] + edges[:-_PIECES]) for edges in fine)
    return *np.meshgrid(*middles, indexing="ij"), bins / area


def _draw_surface(axes, result, cycle, surface, highest):
    """Draw the density of one row, as `_bin_averages` gives it, with walls for the overturned probability."""
    scene = result.scene
    cut_off, bound = scene.overturning.angle, surface[1].max()
    axes.patch.set_visible(False)
    axes.set(xlim=(-cut_off, cut_off), ylim=(-bound, bound), zlim=(0.0, highest))
    axes.set_box_aspect((1.3, 1.3, 0.8), zoom=1.08)
    point_start = cycle == 0 and scene.start.covariance is None
    if not point_start:
        # The root brings out the low parts, which hold most of the probability.
        colours = {"cmap": pictures.SURFACE, "norm": PowerNorm(0.5, 0.0, highest)}
        axes.plot_surface(*surface, **colours, rstride=1, cstride=1, linewidth=0.0)
    row = result.row_of(cycle)
    for probability, x in zip(result.overturned[row], (-cut_off, cut_off), strict=True):
        # The figure stands where no tick of the axes does: on the left wall in front, on the right wall half way.
        _draw_wall(axes, x, bound, probability * highest, f"{probability:z.3f}", -bound if x < 0.0 else -0.2 * bound)
    when = "start" if row == 0 else result.when(row).removeprefix("after ")
    axes.set_title(f"{when}: survival {result.survival[row]:.3f}", y=1.0, pad=0)
    axes.set_xlabel("angle Θ", labelpad=-6)
    axes.set_ylabel("velocity dΘ/dτ", labelpad=-5)
    axes.set_zlabel("density", labelpad=-7)
    axes.tick_params(pad=-3, labelsize=8)
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))
        axis.pane.set_facecolor("white")
    if point_start:
        _draw_needle(axes, scene.start, highest)


def _draw_wall(axes, x, bound, height, text, place):
    """Draw a wall at the angle x, from -bound to bound in velocity, with a text at the velocity `place`."""
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    corners = [(x, -bound, 0.0), (x, bound, 0.0), (x, bound, height), (x, -bound, height)]
    colour = pictures.OVERTURNED
    axes.add_collection3d(Poly3DCollection([corners], facecolor=colour, alpha=0.4, edgecolor=colour))
    box = {"facecolor": "white", "edgecolor": colour, "linewidth": 0.8, "boxstyle": "round,pad=0.15"}
    axes.text(x, place, height, text, ha="left" if x < 0.0 else "right", va="bottom", fontsize=9, bbox=box, zorder=100)


def _draw_needle(axes, start, highest):
    """Draw a start from a point as a needle."""
    axes.plot([start.angle] * 2, [start.velocity] * 2, [0.0, 0.9 * highest], color="black", linewidth=2.0)
    axes.text(start.angle, start.velocity, 0.92 * highest, "probability 1 at one point", ha="center", va="bottom")
    axes.set_zlabel("")
    axes.set_zticks([])


def _surface_notes(results, columns):
    """Lines below the surfaces: what is drawn, and what speaks against the results."""
    drawn = "Density: mean in 0.1 × 0.1. Walls: probability overturned to that side, full height = 1."
    return [line for text in (drawn, *cautions(*results)) for line in textwrap.wrap(text, 50 * columns)]


def density_maps(path: File, results: Sequence[SurvivalResult], cycles: Sequence[float], title: str) -> None:
    """Draw joint densities as colour maps of the phase plane, with one colour scale for each cycle.

    A map shows the probability in each bin divided by its area, for velocities that contain all but 1e-4 of it.

    Parameters
    ----------
    path, results, cycles, title
        As of `surface_figure`; cycles at least 1.

    Examples
    --------
    >>> from fpk_rocking import load_scene, solve_fpk
    >>> from fpk_rocking.output.figures import density_maps
    >>> density = solve_fpk(load_scene("main"), cycles=4, tol=1e-2)
    >>> density_maps("maps.png", [density], cycles=[1, 4], title="The first cycles")
    """
    scene, edges = results[0].scene, joint_edges(results[0].scene)
    area = np.multiply.outer(*map(np.diff, edges))
    maps = [[np.asarray(result.bin_probabilities(cycle, *edges)) for cycle in cycles] for result in results]
    velocities = _inner_velocities(edges[1], sum(np.abs(bins) for row in maps for bins in row).sum(axis=0))
    size = 2.2 * max(len(cycles), 2) + 0.9, 2.6 * len(results) + 2.0
    with pictures.page(path, size, title, _map_notes(results)) as figure:
        panels = figure.subplots(len(results), len(cycles), sharex=True, sharey=True, squeeze=False)
        for column, cycle in enumerate(cycles):
            highest = max((row[column] / area).max() for row in maps)
            norm = PowerNorm(0.5, 0.0, highest, clip=True)
            for axes, result, row in zip(panels[:, column], results, maps, strict=True):
                image = axes.pcolormesh(*edges, (row[column] / area).T, norm=norm, cmap="magma_r", rasterized=True)
                axes.grid(visible=False)
                axes.set_title(_heading(result, cycle), fontsize=10)
            bar = {"location": "bottom", "shrink": 0.9, "aspect": 22, "label": "density"}
            figure.colorbar(
                image, ax=panels[:, column], ticks=highest * np.array([0.0, 0.1, 0.4, 1.0]), format="%.2g", **bar
            )
        for axes in panels[-1]:
            axes.set_xlabel("angle Θ")
            axes.xaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))
        for axes, result in zip(panels[:, 0], results, strict=True):
            axes.set_ylabel(f"{_row_name(result)}\n\nvelocity dΘ/dτ")
            axes.set(xlim=np.array([-1.0, 1.0]) * scene.overturning.angle, ylim=velocities)


def _inner_velocities(edges, masses):
    """Velocities between which all but a ten-thousandth of the masses (n,) of bins lies; `edges` (n + 1,)."""
    beyond = 0.5e-4 * masses.sum()
    low, high = np.searchsorted(np.cumsum(masses), beyond), np.searchsorted(np.cumsum(masses[::-1]), beyond)
    return edges[low], edges[-1 - high]


def _heading(result, cycle):
    """Time, survival and overturned probabilities of a row, as a text of three lines."""
    row = result.row_of(cycle)
    left, right = np.asarray(result.overturned)[row]
    when = result.when(row).removeprefix("after ")
    return f"{when}: survival {result.survival[row]:.3f}\noverturned left {left:.3f},\nright {right:.3f}"


def _map_notes(results):
    """Note below the maps: the scene, what is drawn, and what speaks against the results."""
    drawn = (
        "Colours: mean density in bins of 0.1 × 0.1, one scale a cycle, in proportion to its square root. Left and "
        "right the panels end at the cut-off."
    )
    return (" ".join((scene_text(results[0].scene), drawn, *cautions(*results))),)
