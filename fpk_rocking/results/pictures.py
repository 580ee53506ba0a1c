"""Small pictures of results, for ``plot()``: survival, and densities over the plane; matplotlib comes with them."""

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from fpk_rocking.base.types import Array
from fpk_rocking.results.binning import shown_edges
from fpk_rocking.results.style import COLOURS, SURFACE, drawing
from fpk_rocking.scene.scene import Scene

__all__ = [
    "edges_of",
    "figure_of",
    "function_panel",
    "plane_panel",
    "plane_units",
    "reliability_panel",
    "result_panels",
    "survival_panel",
]


class PlaneUnits(NamedTuple):
    """What an angle and a velocity of 1 are on the axes of a picture, and the names of the axes."""

    angle: float = 1.0
    velocity: float = 1.0
    names: tuple[str, str] = ("angle Θ", "velocity dΘ/dτ")


def plane_units(scene: Scene) -> PlaneUnits:
    """Return the `PlaneUnits` of a scene: degrees and degrees/s for a block with dimensions, else nondimensional."""
    size = scene.block.size
    if size is None:
        return PlaneUnits()
    angle = math.degrees(size.critical_angle)
    return PlaneUnits(angle, angle * size.frequency_parameter, ("angle θ, degrees", "velocity, degrees/s"))


def figure_of(*panels: Callable[[Any, Any], None]) -> Any:
    """Return a figure with panels side by side.

    Parameters
    ----------
    *panels : callable
        Each is called with the figure and one of its axes, and draws there.

    Returns
    -------
    matplotlib.figure.Figure
    """
    with drawing() as new_figure:
        figure = new_figure(figsize=(4.6 * len(panels), 3.3), layout="constrained")
        for panel, axes in zip(panels, np.atleast_1d(figure.subplots(1, len(panels))), strict=True):
            panel(figure, axes)
    return figure


def result_panels(result: Any, what: str | None, cycle: int) -> list[Callable[[Any, Any], None]]:
    """Return the panels, as `figure_of` takes them, of a `SurvivalResult` at a cycle (its row).

    `what` is "survival", "bins", "density", or None for the first two; see `SurvivalResult.plot`.
    """
    units = plane_units(result.scene)

    def survival(_, axes):
        """Draw survival on matplotlib's `axes`."""
        survival_panel(axes, result)

    def bins(figure, axes):
        """Draw the probability in each bin over the bin's area on matplotlib's `axes`, with a colour bar."""
        edges = edges_of([result], [cycle])
        areas = np.multiply.outer(*map(np.diff, edges))
        density = result.bin_probabilities(cycle, *edges) / areas
        plane_panel(figure, axes, edges, density, "probability in a bin / area", units=units)
        axes.set_title(_title(result, cycle))

    def density(figure, axes):
        """Draw the density itself on matplotlib's `axes`, with a colour bar in the figure."""
        edges = edges_of([result], [cycle])
        function_panel(figure, axes, result.at(cycle), edges, "density", units=units)
        axes.set_title(_title(result, cycle))

    panels = {"survival": survival, "bins": bins, "density": density}
    return [panels[name] for name in ([what] if what else ["survival", "bins"])]


def edges_of(results: Sequence[Any], cycles: Sequence[int]) -> list[Array]:
    """Return the edges, angle (n + 1,) and velocity (m + 1,), of the bins in which results are shown after some cycles.

    `results` are of the class `SurvivalResult`, and `cycles` are their rows; see `shown_edges`.
    """
    coarsest = min(results, key=lambda result: result.shown_bins)
    edges = coarsest.bin_edges
    probabilities = sum(np.asarray(result.bin_probabilities(cycle, *edges)) for result in results for cycle in cycles)
    return shown_edges(edges, np.asarray(probabilities), coarsest.shown_bins)


def survival_panel(axes: Any, *results: Any) -> None:
    """Draw survival against cycles or times, with 95 % intervals or estimated errors as bands.

    `axes` are matplotlib's; `results` are of the class `SurvivalResult`.
    """
    for result, colour in zip(results, COLOURS, strict=False):
        survival, label = np.asarray(result.survival), "one path" if result.deterministic else "95 % interval"
        interval = result.survival_interval()
        if interval is None:
            error, label = result.error_estimate, "estimated error"
            if result.replacement is not None:
                error, label = result.total_error[:, 0], "total error"
            interval = np.stack([survival - error, survival + error], -1)
        axes.fill_between(result.row_values, *np.asarray(interval).T, color=colour, alpha=0.3, linewidth=0.0)
        axes.plot(result.row_values, survival, color=colour, marker=".", label=f"{result.engine}, {label}")
    axes.set(xlabel=results[0].row_label, ylabel="P(not overturned)", ylim=(-0.03, 1.03))
    axes.legend(loc="best", fontsize=8)


def plane_panel(
    figure: Any,
    axes: Any,
    edges: Sequence[Array],
    values: Array,
    name: str,
    power: float = 0.5,
    units: PlaneUnits | None = None,
) -> None:
    """Draw a density (n, m) over cells of the plane, with a colour bar named `name` in the figure.

    `edges` of the cells are (n + 1,) in angle and (m + 1,) in velocity, and `values` (n, m) per unit of both, all
    nondimensional; `units` are what the axes show. Colours follow the values to the `power`: the root, 0.5, shows low
    parts.
    """
    from matplotlib.colors import PowerNorm

    units = units or PlaneUnits()
    values = values / (units.angle * units.velocity)
    scale = PowerNorm(power, 0.0, max(float(values.max()), np.finfo(float).tiny))
    mesh = axes.pcolormesh(edges[0] * units.angle, edges[1] * units.velocity, values.T, cmap=SURFACE, norm=scale)
    figure.colorbar(mesh, ax=axes, label=name)
    axes.set(xlabel=units.names[0], ylabel=units.names[1])
    axes.grid(visible=False)


def function_panel(
    figure: Any,
    axes: Any,
    function: Callable[[Array, Array], Array],
    edges: Sequence[Array],
    name: str,
    power: float = 0.5,
    units: PlaneUnits | None = None,
) -> None:
    """Draw a function of angle and velocity on a lattice between the outer edges.

    `function` takes two arrays of one shape and returns values of that shape; `edges` are an ascending array for each
    axis, nondimensional. The other arguments are those of `plane_panel`.
    """
    fine = [np.linspace(line[0], line[-1], 161) for line in edges]
    values = function(*np.meshgrid(*(0.5 * (line[1:] + line[:-1]) for line in fine), indexing="ij"))
    plane_panel(figure, axes, fine, values, name, power, units)


def _title(result, cycle):
    """Time of a row of a `SurvivalResult` and survival then, as a title of a panel; `cycle` is the row."""
    return f"{result.when(cycle)}, survival {result.survival[cycle]:.4f}"


def reliability_panel(axes: Any, probability: Array, observed: Array, groups: int = 8, **style: Any) -> None:
    """Draw observed shares with 95 % intervals (Wilson) over predicted probabilities (n,), in groups of equal size."""
    from scipy import stats

    look = {"color": COLOURS[0]} | style
    for part in np.array_split(np.argsort(probability, kind="stable"), groups):
        mean, over = probability[part].mean(), int(observed[part].sum())
        axes.plot([mean] * 2, stats.binomtest(over, len(part)).proportion_ci(method="wilson"), color=look["color"])
        axes.plot(mean, over / len(part), "o", **look)
    axes.plot([0, 1], [0, 1], "k:")
    axes.set(xlabel="predicted probability of overturning", ylabel="share that overturned")
