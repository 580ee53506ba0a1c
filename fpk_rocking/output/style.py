"""One look for every figure: sizes, fonts and the colour-blind-safe colours of Okabe and Ito."""

import contextlib
import pathlib

from fpk_rocking.storage import replaced_atomically

__all__ = ["COLOURS", "OVERTURNED", "SURFACE", "drawing", "save", "shades"]

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
def drawing():
    """Yield matplotlib's figure class with the project's settings in force; no window system is used."""
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    def figure(**options):
        made = Figure(**options)
        FigureCanvasAgg(made)
        return made

    with mpl.rc_context({**mpl.rcParamsDefault, **_SETTINGS}):
        yield figure


def shades(count) -> list:
    """Return colours for `count` values in ascending order, dark to light, each legible as a line on white."""
    import matplotlib as mpl

    steps = range(count)
    return [mpl.colors.to_hex(mpl.colormaps["viridis"](0.82 * step / max(count - 1, 1))) for step in steps]


def save(figure, path) -> pathlib.Path:
    """Write a figure whole or not at all; the suffix of the path chooses the format."""
    with replaced_atomically(path) as temporary:
        figure.savefig(temporary)
    return pathlib.Path(path)
