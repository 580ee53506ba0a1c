"""How pictures look, and the small ones of results, for ``plot()``: survival, and densities over the plane.

The style of every figure: sizes, fonts, the colour-blind-safe colours of Okabe and Ito, pages, and files. Matplotlib is
loaded with the first picture.
"""

import base64
import contextlib
import html
import io
import math
import pathlib
import textwrap
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from fpk_rocking.base.checks import Array, ArrayLike, File
from fpk_rocking.results.storage import replaced_atomically
from fpk_rocking.scene.scene import Scene

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7")
OVERTURNED = "#D55E00"
SURFACE = "GnBu"

_SETTINGS = {
    "font.size": 10,
    "axes.titlesize": 11,
    "axes.labelsize": 10,
    "axes.grid": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.6,
    "legend.frameon": False,
    "lines.linewidth": 1.6,
    "figure.dpi": 110,
    "savefig.dpi": 120,
}


@contextlib.contextmanager
def drawing() -> Iterator[Callable[..., Any]]:
    """Yield a function that makes matplotlib figures, from the options of their class, in the project's style.

    No window system is used.
    """
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    class Picture(Figure):
        """A figure that a notebook shows as the last value of a cell, where pyplot was never loaded too."""

        def _repr_png_(self):
            return png_of(self)

    def figure(**options):
        picture = Picture(**options)
        FigureCanvasAgg(picture)
        return picture

    with mpl.rc_context({**mpl.rcParamsDefault, **_SETTINGS}):  # type: ignore[dict-item]
        yield figure


@contextlib.contextmanager
def page(path: File, size: tuple[float, float], title: str, notes: Iterable[str] = ()) -> Iterator[Any]:
    """Yield a matplotlib figure of a `size` in inches for several panels; it is saved to `path` at the end.

    The title above is on one line: a long one is set smaller. Of the notes below, what a reader has to know to judge
    the panels, each begins a line of its own.
    """
    with drawing() as new_figure:
        figure = new_figure(figsize=size, layout="constrained")
        figure.get_layout_engine().set(h_pad=0.08, w_pad=0.08)
        figure.suptitle(title, fontsize=title_size(title, size[0]))
        if notes:
            text = "\n".join(line for note in notes for line in textwrap.wrap(note, round(13.0 * size[0])))
            figure.supxlabel(text, x=0.02, ha="left", color="#333333", fontsize=10, linespacing=1.5)
        yield figure
        save(figure, path)


def title_size(title: str, width: float) -> float:
    """Return the size of print, in points, at which a title fits on a line of a width in inches."""
    return min(15.0, 122.0 * width / max(len(title), 1))  # 122: points times letters an inch


def shades(count: int) -> list[str]:
    """Return colours "#rrggbb" for values in ascending order, dark to light, each legible as a line on white."""
    import matplotlib as mpl

    steps = range(count)
    return [mpl.colors.to_hex(mpl.colormaps["viridis"](0.82 * step / max(count - 1, 1))) for step in steps]


def named(
    axes: Any,
    text: str,
    point: tuple[float, float],
    colour: str,
    offset: tuple[float, float] = (5.0, -3.0),
    **look: Any,
) -> None:
    """Write the name of a curve in its colour beside one of its points, `offset` points of print away from it.

    The point is in units of the axes; `look` is as ``axes.annotate`` takes it.
    """
    axes.annotate(text, point, xytext=offset, textcoords="offset points", color=colour, **look)


def error_bars(axes: Any, x: ArrayLike, values: ArrayLike, interval: ArrayLike, **look: Any) -> None:
    """Draw values (n,) with the limits (n, 2) of their intervals, as open circles without a line by default.

    `look`: colour, label and marker, as ``axes.errorbar`` takes them.
    """
    centres, (low, high) = np.asarray(values), np.asarray(interval).T
    # Rounding may leave a limit on the wrong side of the value by one unit in the last place.
    bars = np.maximum([centres - low, high - centres], 0.0)
    shape: dict[str, Any] = {
        "marker": "o",
        "markersize": 4.0,
        "markerfacecolor": "white",
        "linestyle": "none",
        "elinewidth": 1.2,
    }
    axes.errorbar(x, centres, bars, **(shape | look))


def save(figure: Any, path: File) -> pathlib.Path:
    """Write a matplotlib figure to a file, whole or not at all, with its title; the suffix chooses the format."""
    with replaced_atomically(path) as temporary:
        figure.savefig(temporary, metadata={"Title": figure.get_suptitle()})
    return pathlib.Path(path)


def png_of(figure: Any, dots: int = 110) -> bytes:
    """Return a figure as a PNG of `dots` pixels an inch."""
    picture = io.BytesIO()
    figure.savefig(picture, format="png", dpi=dots)
    return picture.getvalue()


def picture_html(figure: Any, meaning: str, dots: int = 110) -> str:
    """Return a figure as an <img> of HTML that holds its own data, a PNG of `dots` pixels an inch.

    `meaning` is a text for those who do not see it.
    """
    data = base64.b64encode(png_of(figure, dots)).decode("ascii")
    return f"<img alt='{html.escape(meaning)}' src='data:image/png;base64,{data}'>"


class PlaneUnits(NamedTuple):
    """What an angle and a velocity of 1 are on the axes of a picture, and the names of the axes."""

    angle: float = 1.0
    velocity: float = 1.0
    names: tuple[str, str] = ("angle Θ", "velocity dΘ/dτ")


def plane_units(scene: Scene) -> PlaneUnits:
    """Return the units for a scene: degrees and degrees/s for a block with dimensions, else 1 and 1."""
    size = scene.block.size
    if size is None:
        return PlaneUnits()
    angle = math.degrees(size.critical_angle)
    return PlaneUnits(angle, angle * size.frequency_parameter, ("angle θ, degrees", "velocity, degrees/s"))


def figure_of(*panels: Callable[[Any, Any], None]) -> Any:
    """Return a matplotlib figure of panels side by side; each is called with the figure and its axes to draw there."""
    with drawing() as new_figure:
        figure = new_figure(figsize=(4.6 * len(panels), 3.3), layout="constrained")
        for panel, axes in zip(panels, np.atleast_1d(figure.subplots(1, len(panels))), strict=True):
            panel(figure, axes)
    return figure


def result_panels(result: Any, what: str | None, cycle: float) -> list[Callable[[Any, Any], None]]:
    """Return the panels of a `SurvivalResult` that `SurvivalResult.plot` shows, as `figure_of` takes them."""
    units = plane_units(result.scene)

    def survival(_, axes):
        survival_panel(axes, result)

    def bins(figure, axes):
        edges = edges_of([result], [cycle])
        areas = np.multiply.outer(*map(np.diff, edges))
        density = result.bin_probabilities(cycle, *edges) / areas
        plane_panel(figure, axes, edges, density, "probability in a bin / area", units=units)
        axes.set_title(_title(result, cycle))

    def density(figure, axes):
        edges = edges_of([result], [cycle])
        function_panel(figure, axes, result.at(cycle), edges, "density", units=units)
        axes.set_title(_title(result, cycle))

    panels = {"survival": survival, "bins": bins, "density": density}
    return [panels[name] for name in ([what] if what else ["survival", "bins"])]


def shown_edges(edges: Sequence[Array], probabilities: Array, least: int) -> list[np.ndarray]:
    """Return edges of bins, angle and velocity, for pictures: where the probability is, neither too few nor too many.

    They are around all but 1e-3 of the `probabilities` (angle bins, velocity bins) on each axis, with a bin more on
    either side. Bins are cut into equal parts where there are fewer than `least`, and merged where there are more than
    96. With 0 for `least` none is cut.
    """
    masses = np.maximum(probabilities, 0.0)
    return [_cut_or_merged(edges[axis], masses.sum(axis=1 - axis), least) for axis in (0, 1)]


def _cut_or_merged(edges, masses, least):
    """Edges (m,) around most of the `masses` (bins,), cut into at least `least` bins or merged into at most 96."""
    below = np.cumsum(masses) / max(masses.sum(), np.finfo(float).tiny)
    first, last = np.searchsorted(below, 5e-4, "right"), np.searchsorted(below, 1.0 - 5e-4)
    inner = edges[max(first - 1, 0) : min(last, masses.size - 1) + 3]
    count = inner.size - 1
    if count < least:
        parts = -(-least // count)
        return np.interp(np.arange(parts * count + 1) / parts, np.arange(count + 1), inner)
    return np.append(inner[: -1 : -(-count // 96)], inner[-1])


def edges_of(results: Sequence[Any], cycles: Sequence[float]) -> list[Array]:
    """Return edges in angle and velocity of the bins in which the rows `cycles` of all `results` are shown."""
    coarsest = min(results, key=lambda result: result.shown_bins)
    edges = coarsest.bin_edges
    probabilities = sum(np.asarray(result.bin_probabilities(cycle, *edges)) for result in results for cycle in cycles)
    return shown_edges(edges, np.asarray(probabilities), coarsest.shown_bins)


def survival_panel(axes: Any, *results: Any) -> None:
    """Draw survival of each `SurvivalResult` against its rows, with 95 % intervals or estimated errors as bands."""
    for result, colour in zip(results, COLOURS, strict=False):
        survival, label, interval = np.asarray(result.survival), "95 % interval", result.interval
        if result.deterministic:
            label, interval = "one path", np.stack([survival, survival], -1)
        elif interval is None:
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

    Edges and values are nondimensional; `units` are what the axes show. Colours follow the values to the `power`: the
    root, 0.5, shows low parts.
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
    """Draw a function of angle and velocity, sampled at 160 x 160 points between the outer edges; see `plane_panel`."""
    fine = [np.linspace(line[0], line[-1], 161) for line in edges]
    values = function(*np.meshgrid(*(0.5 * (line[1:] + line[:-1]) for line in fine), indexing="ij"))
    plane_panel(figure, axes, fine, values, name, power, units)


def _title(result, cycle):
    """Time after a number of cycles of a `SurvivalResult`, and survival then, as a text for the title of a panel."""
    row = result.row_of(cycle)
    return f"{result.when(row)}, survival {result.survival[row]:.4f}"
