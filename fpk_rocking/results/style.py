"""The drawing style of every figure: sizes, fonts, the colour-blind-safe colours of Okabe and Ito, pages, and files."""

import base64
import contextlib
import html
import io
import pathlib
import textwrap
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import numpy as np

from fpk_rocking.base.files import replaced_atomically
from fpk_rocking.base.types import ArrayLike, File

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
    """Yield matplotlib's figure class with the project's settings in force; no window system is used."""
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    def figure(**options):
        """Return a figure, made with the options of matplotlib's class, that needs no window."""
        canvas_figure = Figure(**options)
        FigureCanvasAgg(canvas_figure)
        return canvas_figure

    with mpl.rc_context({**mpl.rcParamsDefault, **_SETTINGS}):  # type: ignore[dict-item]
        yield figure


@contextlib.contextmanager
def page(path: File, size: tuple[float, float], title: str, notes: Iterable[str] = ()) -> Iterator[Any]:
    """Yield a figure for several panels, with a title above and notes below them; it is saved at the end.

    Parameters
    ----------
    path : path
        Where to write; the suffix chooses the format.
    size : (float, float)
        In inches.
    title : str
        On one line: a long one is set smaller.
    notes : sequence of str
        What a reader has to know to judge the panels; each begins a line of its own.
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
    """Return a list of `count` colours for values in ascending order, dark to light, each legible as a line on white.

    A colour is a text "#rrggbb".
    """
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
    """Write the name of a curve in its colour beside one of its points.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
    text : str
    point : (float, float)
        In the units of the axes.
    colour : str
    offset : (float, float)
        From the point to the text, in points of print.
    **look
        As ``axes.annotate`` takes it.
    """
    axes.annotate(text, point, xytext=offset, textcoords="offset points", color=colour, **look)


def error_bars(axes: Any, x: ArrayLike, values: ArrayLike, interval: ArrayLike, **look: Any) -> None:
    """Draw values with the limits of their intervals.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
    x, values : array_like, shape (n,)
    interval : array_like, shape (n, 2)
        Lower and upper limits.
    **look
        Colour, label and marker, as ``axes.errorbar`` takes them; open circles without a line by default.
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
    """Write matplotlib's figure complete or not at all, its title with it; return the path.

    The suffix of the path chooses the format.
    """
    with replaced_atomically(path) as temporary:
        figure.savefig(temporary, metadata={"Title": figure.get_suptitle()})
    return pathlib.Path(path)


def picture_html(figure: Any, meaning: str, dots: int = 110) -> str:
    """Return a figure as an image of HTML that holds its own data.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
    meaning : str
        Text for those who do not see it.
    dots : int
        An inch.
    """
    picture = io.BytesIO()
    figure.savefig(picture, format="png", dpi=dots)
    data = base64.b64encode(picture.getvalue()).decode("ascii")
    return f"<img alt='{html.escape(meaning)}' src='data:image/png;base64,{data}'>"
