"""Movies of results: the plane with the probability in its bins, what has overturned, and survival, row by row."""

import pathlib
import subprocess
from typing import Any

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import File, Progress
from fpk_rocking.results import pictures
from fpk_rocking.results.storage import replaced_atomically

_SIZE = 8.6, 3.6
_DOTS = 90


def movie_writer(path: File, frames_per_second: float = 10.0, name: str = "path") -> Any:
    """Return matplotlib's writer of movies for a file; ValueError, with the `name` of the path, where there is none."""
    from matplotlib.animation import FFMpegWriter, PillowWriter

    suffix = checks.path(name, path).suffix.lower()
    if suffix == ".gif":
        return PillowWriter(fps=frames_per_second)  # type: ignore[arg-type]  # fractions are fine
    if suffix != ".mp4":
        raise ValueError(checks.refusal(name, str(path), "a name that ends with .gif or .mp4"))
    if not FFMpegWriter.isAvailable():
        accepted = ".gif, as .mp4 needs the program ffmpeg, which is not found: install it, or add its folder to PATH"
        raise ValueError(checks.refusal(name, str(path), accepted))
    return FFMpegWriter(fps=frames_per_second)  # type: ignore[arg-type]


def write_movie(path: File, result: Any, frames_per_second: float, progress: Progress | None) -> pathlib.Path:
    """Write the movie of a `SurvivalResult`, whole or not at all; see `SurvivalResult.animate`."""
    rate = checks.number("frames_per_second", frames_per_second, above=0.0)
    writer, report, rows = movie_writer(path, rate), checks.report(progress), len(result.times)
    cycles = [result.cycle_of(row) for row in range(rows)]
    edges = pictures.edges_of([result], cycles)
    areas = np.multiply.outer(*map(np.diff, edges))
    densities = np.maximum([result.bin_probabilities(cycle, *edges) / areas for cycle in cycles], 0.0)
    with pictures.drawing() as new_figure:
        figure = new_figure(figsize=_SIZE, layout="constrained")
        draw = _panels(figure, result, edges, densities)
        figure.canvas.draw()
        figure.set_layout_engine("none")  # the panels stay where they are
        with replaced_atomically(path) as temporary:
            try:
                with writer.saving(figure, str(temporary), _DOTS):
                    for row in range(rows):
                        draw(row)
                        writer.grab_frame()
                        if report:
                            report(row + 1, rows)
            except subprocess.CalledProcessError as error:
                raise OSError(f"{path}: ffmpeg failed: {error.stderr or error}") from error
    return pathlib.Path(path)


def _panels(figure, result, edges, densities):
    """Draw the panels of the last row; return a function that changes them to those of another row."""
    panels = figure.subplot_mosaic([["left", "plane", "right", "survival"]], width_ratios=(0.04, 1.0, 0.04, 0.8))
    plane, curve = panels["plane"], panels["survival"]
    # One scale for all frames: the narrow densities of the first ones pass its top.
    most = float(np.median(densities.max(axis=(1, 2))))
    shown = np.minimum(densities, most)
    units = pictures.plane_units(result.scene)
    top = np.full(shown[0].shape, most)
    pictures.plane_panel(figure, plane, edges, top, "probability in a bin / area", units=units)
    mesh = plane.collections[0]
    bars = []
    for side, place in (("left", 0), ("right", 1)):
        axes = panels[side]
        bars.append(axes.bar([0.0], [1.0], width=1.0, color=pictures.OVERTURNED, alpha=0.6)[0])
        axes.set(xlim=(-0.5, 0.5), ylim=(0.0, 1.0), xticks=[], yticks=[0.0, 0.5, 1.0] if place == 0 else [])
        axes.set_title(f"overturned\n{side}", fontsize=9)
        axes.grid(visible=False)
    values, survival = result.row_values, np.asarray(result.survival)
    curve.plot(values, survival, color=pictures.COLOURS[0])
    (point,) = curve.plot(values[-1:], survival[-1:], marker="o", color=pictures.COLOURS[0])
    curve.set(xlabel=result.row_label, ylabel="P(not overturned)", ylim=(-0.03, 1.03))

    def draw(row):
        mesh.set_array(shown[row].T / (units.angle * units.velocity))
        for bar, probability in zip(bars, result.overturned[row], strict=True):
            bar.set_height(max(float(probability), 0.0))
        point.set_data(values[row : row + 1], survival[row : row + 1])
        plane.set_title(f"{result.row_label}: {values[row]:.3f}")
        curve.set_title(f"survival {survival[row]:.4f}")

    draw(len(values) - 1)
    return draw
