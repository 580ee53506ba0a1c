"""Sampled values with their confidence intervals, drawn the same way in every figure."""

import numpy as np

__all__ = ["error_bars"]


def error_bars(axes, x, values, interval, **look):
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
    values, (low, high) = np.asarray(values), np.asarray(interval).T
    # Rounding may leave a limit on the wrong side of the value by one unit in the last place.
    bars = np.maximum([values - low, high - values], 0.0)
    shape = {"marker": "o", "markersize": 4.0, "markerfacecolor": "white", "linestyle": "none", "elinewidth": 1.2}
    axes.errorbar(x, values, bars, **(shape | look))
