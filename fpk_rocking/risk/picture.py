"""Pictures of fragility: curves with their intervals and fits, and a surface over a parameter and the scale."""

import itertools
import pathlib
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from rich.table import Table

from fpk_rocking.base.checks import Array, File
from fpk_rocking.output.tables import text_table, verdict_first
from fpk_rocking.results import pictures
from fpk_rocking.results.pictures import figure_of
from fpk_rocking.risk.motions import measure_of, motion_lines
from fpk_rocking.scene.axes import SETTLING

NAMES = {
    "size": "half diagonal R, m",
    "slenderness": "height over width",
    "width": "width, m",
    "height": "height, m",
}
"""What the parameters of a block are called on an axis."""


def curves_figure(path: File, results: Sequence[Any], title: str = "", which: int | None = 0) -> pathlib.Path:
    """Draw the fragility curves of one or two results, a panel for each scene; the first result has its fit drawn too.

    Parameters
    ----------
    path : path
        File to write; the suffix chooses the format.
    results : sequence of Fragility
        One or two results on the same scenes, by different engines.
    title : str
        By default that of the first result: the scale at which half of the blocks overturn.
    which : int or None
        Index of the probability: 0 overturning, 1, 2, ... the levels; None draws all of them.

    Returns
    -------
    pathlib.Path
        The file written.

    Examples
    --------
    >>> from fpk_rocking import Scene
    >>> from fpk_rocking.risk import fragility
    >>> from fpk_rocking.risk.picture import curves_figure
    >>> rack = Scene.from_block(0.5, 1.8, "0.5 g", "1.5 Hz",
    ...                         noise_rms_acceleration=0.5, noise_band_hz=(0, 5))
    >>> curve = fragility(rack, scale=[0.8, 1.0, 1.2], cycles=4, realizations=500)
    >>> print(curves_figure("curve.png", [curve], title="A rack"))
    curve.png
    """
    first = results[0]
    count = len(first.place)
    columns = min(count, 3)
    rows = -(-count // columns)
    events = range(len(first.names)) if which is None else [which]
    notes = _notes(results)
    size = (5.2 * columns if columns > 1 else 8.5, 4.6 * rows + 0.22 * len(notes) + 0.8)
    with pictures.page(path, size, title or message(first), notes) as figure:
        panels = np.atleast_1d(figure.subplots(rows, columns, sharex=True, sharey=True)).ravel()
        for panel in panels[count:]:
            panel.set_visible(False)
        for m, axes in enumerate(panels[:count]):
            _curves(axes, first, m, events)
            for other, colour in zip(results[1:], pictures.COLOURS[1:], strict=False):
                _curve(axes, other, m, events[0], colour, "x", fit=False)
            axes.set_title(first.label(m) if count > 1 else "")
            if m % columns == 0:
                axes.set_ylabel("probability" if which is None else _event(first, which))
            axes.legend(loc="best")
    return pathlib.Path(path)


def surface_figure(path: File, result: Any, title: str = "", which: int = 0) -> pathlib.Path:
    """Draw the probability over the scale and the parameter in which the scenes differ, with the medians of the fits.

    Parameters
    ----------
    path, title, which
        As for `curves_figure`.
    result : Fragility
        A result over a parameter.

    Returns
    -------
    pathlib.Path
        The file written.

    Examples
    --------
    >>> from fpk_rocking import Scene
    >>> from fpk_rocking.risk import fragility
    >>> from fpk_rocking.risk.picture import surface_figure
    >>> rack = Scene.from_block(0.5, 1.8, "0.5 g", "1.5 Hz",
    ...                         noise_rms_acceleration=0.5, noise_band_hz=(0, 5))
    >>> curves = fragility(rack, scale=[0.8, 1.0, 1.2], cycles=4, over={"size": [0.8, 1.0]}, realizations=500)
    >>> print(surface_figure("sizes.png", curves, title="Racks of two sizes"))
    sizes.png
    """
    notes = _notes([result])
    with pictures.page(path, (8.5, 5.8 + 0.22 * len(notes)), title or message(result), notes) as figure:
        _surface(figure, figure.subplots(), result, which)
    return pathlib.Path(path)


def draw_surface(axes: Any, result: Any, which: int = 0) -> Any:
    """Draw the probability over scale and parameter on matplotlib `axes`, with the medians of the fits."""
    filled = draw_map(axes, result.scale, result.place, result.probability[:, which])
    medians = np.array([fits[which].median for fits in result.fits])
    axes.plot(medians, result.place, "o", color=pictures.COLOURS[1], label="median of the lognormal fit")
    axes.set(xlabel=_scale_name(result, "scale of the shaking"), ylabel=NAMES.get(result.axis, result.axis))
    return filled


def draw_map(axes: Any, across: Array, up: Array, probability: Array) -> Any:
    """Draw probabilities (m, n) as contours on matplotlib `axes`, and return the filled ones, for a colour bar."""
    values = np.clip(probability, 0.0, 1.0)
    filled = axes.contourf(across, up, values, levels=np.linspace(0.0, 1.0, 11), cmap=pictures.SURFACE)
    lines = axes.contour(across, up, values, levels=[0.1, 0.5, 0.9], colors="black", linewidths=0.9)
    axes.clabel(lines, fmt="%g")
    axes.grid(visible=False)
    logarithmic(axes.set_xscale, axes.xaxis)
    logarithmic(axes.set_yscale, axes.yaxis)
    axes.set(xlim=(across[0], across[-1]), ylim=(up[0], up[-1]))
    return filled


def message(result: Any) -> str:
    """Return the title of a picture of a `Fragility`: the scale, or range, at which half of the blocks overturn."""
    if result.deterministic.all():
        return "Fragility"
    halves = np.array([_half(result.scale, curve) for curve in result.overturned])
    halves = halves[np.isfinite(halves)]
    if halves.size == 0:
        if np.isnan(result.overturned).all():
            return "No probability is known"
        low, high = np.nanmin(result.overturned), np.nanmax(result.overturned)
        return f"From {100.0 * low:.3g} to {100.0 * high:.3g} % of the blocks overturn"
    low, high = halves.min(), halves.max()
    if len(result.place) > 1:
        return f"Half of the blocks overturn at scales from {low:.3g} to {high:.3g}"
    measures = result.intensities[0].at(low)
    return f"Half of the blocks overturn at scale {low:.3g}" + f": {measures}" * bool(measures)


def _half(scale, probability):
    """Return the first scale (float), interpolated in its logarithm, at which the probability rises to 1/2, or nan."""
    finite = np.isfinite(probability)
    scale, probability = scale[finite], probability[finite]
    above = np.flatnonzero(probability >= 0.5)
    if above.size == 0 or above[0] == 0:
        return np.nan
    ends = slice(above[0] - 1, above[0] + 1)
    return np.exp(np.interp(0.5, probability[ends], np.log(scale[ends])))


def small_figure(result: Any) -> Any:
    """Return a matplotlib figure of a `Fragility`: the probability of overturning over scale and a parameter."""
    if result.axis != "scene" and min(result.probability.shape[::2]) > 1:
        return figure_of(lambda figure, axes: _surface(figure, axes, result, 0))
    events, count = range(len(result.names)), len(result.place)
    panels = [lambda _, axes, m=m: _curves(axes, result, m, events) for m in range(min(count, 3))]
    figure = figure_of(*panels)
    figure.axes[0].set_ylabel("probability")
    figure.suptitle(f"The first 3 of {count} curves" if count > 3 else message(result), fontsize=8)
    for m, axes in enumerate(figure.axes):
        axes.set_title(result.label(m) if count > 1 else "")
        axes.legend(loc="best", fontsize=7)
    return figure


def _surface(figure, axes, result, which):
    """Draw a `Fragility` over a parameter on `axes`, with legend, and a colour bar in `figure`, both matplotlib's."""
    filled = draw_surface(axes, result, which)
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0))
    figure.colorbar(filled, ax=axes, label=_event(result, which))


def _curves(axes, result, m, events):
    """Draw the probabilities of some `events` of scene m of a `Fragility`, with their fits, over the scale."""
    for which in events:
        _curve(axes, result, m, which, pictures.COLOURS[which % 4], "osD^"[which % 4], fit=True)
    # Limits are set, as there may be no answer at all, and then nothing that a logarithmic axis could begin with.
    measures = result.intensities[m].at(1.0)
    axes.set(xlim=(0.93 * result.scale[0], 1.07 * result.scale[-1]), ylim=(-0.03, 1.03))
    axes.set_xlabel(_scale_name(result, "scale of the shaking") + f"\n(1: {measures})" * bool(measures))
    logarithmic(axes.set_xscale, axes.xaxis)


def _curve(axes, result, m, which, colour, marker, *, fit):
    """Draw the probability of event `which` of scene m of a `Fragility` with its limits, on matplotlib `axes`."""
    finite = np.isfinite(result.probability[m, which])
    scale, values = result.scale[finite], result.probability[m, which, finite]
    engine = "density solver" if result.engine == "density" else f"Monte Carlo {result.engine}"
    lognormal, label = result.fits[m][which], f"{engine}, {result.names_with_degrees[which]}"
    if fit and not lognormal.reason:
        fine = np.geomspace(result.scale[0], result.scale[-1], 200)
        verdict = f" (rejected, off by up to {lognormal.misfit:.2g})" if lognormal.rejected else ""
        look = {"color": colour, "linewidth": 1.0, "linestyle": "--" if lognormal.rejected else "-"}
        axes.plot(fine, lognormal(fine), label=f"lognormal fit{verdict}", **look)
    if result.deterministic[m]:
        look = {"linestyle": "none", "markersize": 4.0, "markerfacecolor": "white"}
        axes.plot(scale, values, color=colour, marker=marker, label=label, **look)
        return
    pictures.error_bars(
        axes, scale, values, result.interval()[m, which][finite], color=colour, marker=marker, label=label
    )


def draw_curve(axes: Any, curve: Any, records: Array | tuple[()] = ()) -> None:
    """Draw an `IntensityCurve` on matplotlib `axes`: the probability with its limits, and the curve that is used."""
    grid, searched = _grid([curve]), curve.jumps.size > 0
    if searched and len(records) > 1:
        label = f"share of the {len(records)} motions"
        axes.plot(*curve.outcomes[:2], color="0.6", linewidth=0.8, label=label)
    for number, row in enumerate(records if len(records) > 1 and not searched else ()):
        label = "" if number else f"each of {len(records)} records"
        axes.plot(curve.intensity, row, color="0.75", linewidth=0.6, label=label)
    look = {"color": pictures.COLOURS[0], "marker": "o", "zorder": 3}
    if curve.records > 1 and curve.fitted:
        # The limits are those of the curve, not of the points.
        label = "at the intensities of the table" if searched else "mean of the motions"
        axes.plot(curve.intensity, curve.probability, linestyle="", label=label, **look)
    else:
        pictures.error_bars(
            axes, curve.intensity, curve.probability, curve.point_limits, label="mean, 95 % limits", **look
        )
    if len(curve.replicates) and curve.fitted:
        from scipy import special

        medians, spreads = curve.replicates.T[:, :, None]
        # Of two motions some medians are too small for a number.
        with np.errstate(divide="ignore"):
            low, high = np.quantile(special.ndtr(np.log(grid / medians) / spreads), [0.025, 0.975], axis=0)
        axes.fill_between(grid, low, high, color="black", alpha=0.12, linewidth=0.0, label="95 % band of the fit")
    axes.plot(grid, curve(grid), color="black", label="lognormal fit" if curve.fitted else "points joined by lines")
    axes.set(xlabel=curve.measure + f", {curve.unit}" * bool(curve.unit), ylabel=f"P({curve.name})", ylim=(-0.02, 1.02))
    logarithmic(axes.set_xscale, axes.xaxis)
    axes.legend(loc="best", fontsize=8)


def draw_contributions(axes: Any, risk: Any) -> None:
    """Draw the share of the rate that intensities have by a `Risk`, and the hazard, on matplotlib `axes`."""
    if risk.rate > 0.0:
        look = {"align": "edge", "color": pictures.COLOURS[1], "edgecolor": "white", "linewidth": 0.5}
        axes.bar(risk.edges[:-1], 100.0 * risk.contribution, np.diff(risk.edges), **look)
    axes.set(
        xlabel=f"{risk.curve.measure}, {risk.curve.unit}",
        ylabel="share of the rate, % (bars)",
        xlim=(risk.edges[0], risk.edges[-1]),
    )
    logarithmic(axes.set_xscale, axes.xaxis)
    axes.grid(visible=False)
    other = axes.twinx()
    span = np.geomspace(risk.edges[0], risk.edges[-1], 200)
    other.plot(span, risk.hazard(span), color="black")
    inside = (risk.hazard.intensity >= span[0]) & (risk.hazard.intensity <= span[-1])
    other.plot(risk.hazard.intensity[inside], risk.hazard.rate[inside], "o", color="black", markersize=3.5)
    other.set(yscale="log", ylabel="exceeded, 1/year (line)")
    other.grid(visible=False)


def _grid(curves):
    """Intensities (400,) over all points of `IntensityCurve`s, and over all at which an outcome is known."""
    ends = np.concatenate([places[[0, -1]] for curve in curves for places in (curve.intensity, curve.outcomes[0])])
    return np.geomspace(0.8 * ends.min(), 1.25 * ends.max(), 400)


def draw_curves(axes: Any, curves: Mapping[str, Any]) -> None:
    """Draw `IntensityCurve`s by their names on matplotlib `axes`: outcomes or points, and the curve that is used."""
    grid = _grid(curves.values())
    for (name, curve), colour in zip(curves.items(), itertools.cycle(pictures.COLOURS), strict=False):
        look = {"linewidth": 0.7} if curve.jumps.size else {"linestyle": "", "marker": "o", "markersize": 4.0}
        axes.plot(*curve.outcomes[:2], color=colour, alpha=0.5, **look)
        axes.plot(grid, curve(grid), color=colour, label=name)
    axes.set(xlabel=curve.measure + f", {curve.unit}" * bool(curve.unit), ylabel=f"P({curve.name})", ylim=(-0.02, 1.02))
    logarithmic(axes.set_xscale, axes.xaxis)
    axes.legend(loc="upper left", fontsize=8)


def draw_ratios(axes: Any, designs: Any) -> None:
    """Draw the ratio of each motion's equivalent intensities to that of the first block, and of medians, on `axes`."""
    first, *others = designs.studies
    own = designs.equivalent[:, 0]
    for number, (other, ratio) in enumerate(zip(others, designs.ratios, strict=True), 1):
        colour, values = pictures.COLOURS[number % len(pictures.COLOURS)], designs.equivalent[:, number]
        known = np.isfinite(own) & np.isfinite(values)
        axes.plot(own[known], values[known] / own[known], "o", color=colour, markersize=4.0)
        axes.axhline(ratio.median, color=colour, linewidth=1.2, label=f"{other.name}: medians, 95 %")
        axes.axhspan(ratio.median_low, ratio.median_high, color=colour, alpha=0.15, linewidth=0.0)
    axes.axhline(1.0, color="0.4", linewidth=0.8)
    name = f"equivalent {first.curve.measure}"
    axes.set(xlabel=f"{name}, {first.curve.unit}, of {first.name}", ylabel=f"{name}, times that of {first.name}")
    axes.legend(fontsize=8)


def logarithmic(set_scale: Callable[[str], object], axis: Any) -> None:
    """Make an axis logarithmic, with plain numbers at 1, 2 and 5 times the powers of ten, more within a decade."""
    from matplotlib.ticker import LogLocator, NullLocator

    set_scale("log")
    low, high = axis.get_view_interval()
    subs = (1.0, 2.0, 5.0) if high > 10.0 * low else (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0)
    axis.set_major_locator(LogLocator(subs=subs))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_locator(NullLocator())


def _event(result, which):
    """Return the label (str) of a probability of a `Fragility`, by its index `which`, as "P(overturned)"."""
    return "P(overturned)" if which == 0 else f"P(max {result.names[which]})"


def _notes(results):
    """Return a list of notes, texts, below a picture of `results`, each a `Fragility`."""
    first = results[0]
    sizes = (f"{result.engine}: {size_of(result)}" for result in results)
    sampled = any(result.realizations and not result.deterministic.all() for result in results)
    scaled = "forcing and noise" if first.noise_scaled else "the forcing alone"
    text = f"{'; '.join(sizes)}{', 95 % intervals' if sampled else ''}. Scale: of {scaled}. {_duration(first)}"
    return [text, *dict.fromkeys(str(result.trust) for result in results if result.trust.verdict != "ok")]


def _duration(result):
    """Return until when overturning counts in a `Fragility`, as a sentence."""
    if "cycles" in result.options:
        return f"Within {result.options['cycles']} forcing cycles."
    last, after = (result.options["times"][-1], "") if "times" in result.options else (SETTLING, " after the motion")
    sizes = {scene.block.size for scene in result.scenes}
    size = sizes.pop() if len(sizes) == 1 else None
    return f"Until {f'τ = {last:g}' if size is None else f'{size.seconds(last):.3g} s'}{after}."


def size_of(result: Any) -> str:
    """Return how many paths are behind each probability of a `Fragility`, as a text."""
    if result.deterministic.all():
        return "one path a point"
    return f"{result.realizations:,} realizations a point" if result.realizations else "with error estimates"


def fragility_table(result: Any) -> tuple[str, Table, tuple[str, ...]]:
    """Return title, table and closing sentences for the probabilities at each scale, for `output.tables.show`."""
    many, still = len(result.place) > 1, result.deterministic
    motions = motion_lines(result.motion_table, result.measure, at_one=True) if result.axis == "scene" else ()
    sized = all(np.isfinite(measure.pga) or np.isfinite(measure.pgv) for measure in result.intensities)
    places = result.places()[result.axis]
    named = any(isinstance(place, str) for place in places)
    strength = (
        {"PGA, g": "pga_g", "PGV, m/s": "pgv_m_per_s"} if sized else {"p PGV / (g tan θ_cr)": "relative_velocity"}
    )
    # The scale is that measure itself.
    strength = {name: field for name, field in strength.items() if name[:3] != result.measure}
    names = ["motion" if named else result.axis] * many + [_scale_name(result), *strength]
    for name in result.names_with_degrees:
        names += [name] + ["95 %" if result.realizations else "± estimate"] * (not still.all())
    limits = result.interval()

    def rows(m, place):
        for n, scale in enumerate(result.scale):
            measures = result.intensities[m].columns(scale)
            strengths = [measures[field] for field in strength.values()]
            cells = [place if named else f"{place:g}"] * many + [f"{scale:.4g}"]
            cells += [f"{value:.3f}" if np.isfinite(value) else "-" for value in strengths]
            for which in range(len(result.names)):
                value, (low, high) = result.probability[m, which, n], limits[m, which, n]
                error = "exact" if still[m] else f"{low:.4f}–{high:.4f}"
                texts = [f"{value:z.4f}", error] if np.isfinite(value) else ["-", "-"]
                cells += texts[: 1 if still.all() else 2]
            yield cells

    title = f"Fragility by {result.engine}, {size_of(result)}"
    fits = [result.describe(m, which) for m in range(len(result.place)) for which in range(len(result.names))]
    tested = any(np.isfinite(fit.p_value) for fits in result.fits for fit in fits)
    p_value = "p: probability that counts drawn from the fitted curve differ from it as much; if small, not lognormal."
    notes = [p_value] * tested
    what = "PGA, PGV: peak acceleration and velocity" if sized else "p PGV / (g tan θ_cr): peak velocity"
    notes.append(f"{what} of the shaking without noise{'' if sized else ', nondimensional'}.")
    table = text_table(names, *(rows(*place) for place in enumerate(places)))
    seconds = f"{result.wall_s:.1f} s."
    return title, table, verdict_first(result.trust, *fits, *motions, *notes, seconds, *result.remarks)


def _scale_name(result, name="scale"):
    """Return what the scale of a `Fragility` is called: a peak of the shaking with its unit, or else `name`."""
    return name if result.measure == "scale" else ", ".join(filter(None, measure_of(result.measure)[:3:2]))


def curve_columns(curves: Sequence[Any]) -> dict[str, Array]:
    """Return columns by name of `IntensityCurve`s, one below the other: the event, and those of their tables."""
    tables = [{"event": np.full(curve.intensity.shape, curve.name)} | curve.table() for curve in curves]
    return {name: np.concatenate([table[name] for table in tables]) for name in tables[0]}


def curves_title(curves: Sequence[Any]) -> str:
    """Return a line of text about `IntensityCurve`s of one or more events."""
    first, *others = curves
    names = ", ".join(f"'{curve.name}'" for curve in curves)
    return f"probabilities of {names} {first.against}" if others else first.title


def curve_table(curves: Sequence[Any]) -> tuple[str, Table, tuple[str, ...]]:
    """Return a title, a `rich.table.Table` and a tuple of sentences of the `IntensityCurve`s of one or more events."""
    first, *others = curves
    columns = curve_columns(curves)
    if not others:
        del columns["event"]

    def texts(values):
        return values if values.dtype.kind == "U" else [f"{v:.4g}" if np.isfinite(v) else "-" for v in values]

    rows = zip(*map(texts, columns.values()), strict=True)
    groups = [list(itertools.islice(rows, curve.intensity.size)) for curve in curves]
    of_others = [text for curve in others for text in (f"'{curve.name}', {curve.trust}", curve.describe())]
    return (
        curves_title(curves),
        text_table(list(columns), *groups),
        verdict_first(first.trust, first.describe(), *of_others, *first.remarks),
    )
