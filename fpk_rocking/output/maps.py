"""Pictures of joint densities as maps of the phase plane, one column a cycle, results above one another."""

from collections.abc import Sequence

import numpy as np
from matplotlib.colors import PowerNorm
from matplotlib.ticker import MaxNLocator

from fpk_rocking.base.types import File
from fpk_rocking.output.surfaces import row_name
from fpk_rocking.results import style
from fpk_rocking.results.binning import joint_edges
from fpk_rocking.results.remarks import cautions, scene_text
from fpk_rocking.results.survival import SurvivalResult

__all__ = ["density_maps"]

_PANEL = (2.75, 2.7)
_BESIDE = (0.9, 1.9)
_COLOURS = "magma_r"
_TICKS = np.array([0.0, 0.1, 0.4, 1.0])
_SHOWN = 0.9999


def density_maps(path: File, results: Sequence[SurvivalResult], cycles: Sequence[int], title: str) -> None:
    """Draw joint densities as colour maps of the phase plane, with one colour scale for each cycle.

    A map shows the probability in each bin divided by the area of the bin, for all engines alike. The velocities shown
    hold all but 1e-4 of the probability.

    Parameters
    ----------
    path : path
        File to write; the suffix chooses the format.
    results : sequence of SurvivalResult
        Results whose scenes differ in the noise alone, drawn from top to bottom.
    cycles : sequence of int
        Cycles, each at least 1, drawn from left to right.
    title : str
        Title of the figure.

    Examples
    --------
    >>> from fpk_rocking import load_scene, solve_fpk
    >>> from fpk_rocking.output.maps import density_maps
    >>> density = solve_fpk(load_scene("main"), cycles=4, tol=1e-2)
    >>> density_maps("maps.png", [density], cycles=[1, 4], title="The first cycles")
    """
    scene, edges = results[0].scene, joint_edges(results[0].scene)
    area = np.multiply.outer(*map(np.diff, edges))
    maps = [[np.asarray(result.bin_probabilities(cycle, *edges)) for cycle in cycles] for result in results]
    shown = _range(edges[1], sum(np.abs(bins) for row in maps for bins in row).sum(axis=0))
    size = _PANEL[0] * max(len(cycles), 2) + _BESIDE[0], _PANEL[1] * len(results) + _BESIDE[1]
    with style.page(path, size, title, _notes(results)) as figure:
        panels = figure.subplots(len(results), len(cycles), sharex=True, sharey=True, squeeze=False)
        for column, cycle in enumerate(cycles):
            highest = max((row[column] / area).max() for row in maps)
            norm = PowerNorm(0.5, 0.0, highest, clip=True)
            for axes, result, row in zip(panels[:, column], results, maps, strict=True):
                image = axes.pcolormesh(*edges, (row[column] / area).T, norm=norm, cmap=_COLOURS, rasterized=True)
                axes.grid(visible=False)
                axes.set_title(_heading(result, cycle), fontsize=10)
            bar = {"location": "bottom", "shrink": 0.9, "aspect": 22, "label": "density"}
            figure.colorbar(image, ax=panels[:, column], ticks=highest * _TICKS, format="%.2g", **bar)
        for axes in panels[-1]:
            axes.set_xlabel("angle Θ")
            axes.xaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))
        for axes, result in zip(panels[:, 0], results, strict=True):
            axes.set_ylabel(f"{row_name(result)}\n\nvelocity dΘ/dτ")
            axes.set(xlim=np.array([-1.0, 1.0]) * scene.overturning.angle, ylim=shown)


def _range(edges, masses):
    """Velocities between which all but a ten-thousandth of the masses of bins lies."""
    beyond = 0.5 * (1.0 - _SHOWN) * masses.sum()
    low, high = np.searchsorted(np.cumsum(masses), beyond), np.searchsorted(np.cumsum(masses[::-1]), beyond)
    return edges[low], edges[-1 - high]


def _heading(result, cycle):
    left, right = np.asarray(result.overturned)[cycle]
    when = f"{cycle} cycle{'s' if cycle > 1 else ''}"
    return f"{when}: survival {result.survival[cycle]:.3f}\noverturned {left:.3f} left, {right:.3f} right"


def _notes(results):
    drawn = (
        "Colours: mean density in bins of 0.1 × 0.1, one scale a cycle, in proportion to its square root. Left and "
        "right the panels end at the cut-off."
    )
    return (" ".join((scene_text(results[0].scene), drawn, *cautions(*results))),)
