"""The look of every figure: sizes, fonts and the colour-blind-safe colours of Okabe and Ito."""

import contextlib

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
