"""FEMA P-58 and the effect of size on overturning.

FEMA P-58 gives bookcases and cabinets of nine sizes the median peak floor velocity at which they overturn. Its medians
are (g B/H) times .163 to .200 s for a depth B and a height H: two blocks of one slenderness have one median, whatever
their size. Here blocks of these sizes, and of other sizes at two slendernesses, stand on synthetic motions of firm
ground, each scaled to each velocity, without noise; a median is that of the lognormal curve over all motions.

Run time: about three minutes on 2 cores.

    python cases/fema_p58.py --out results/fema_p58

Files: ``fema_p58.png``, ``fema_p58.json``.

Source of the medians: SimCenter's DamageAndLossModelLibrary, FEMA P-58 2nd edition, component fragilities.
"""

import math

import numpy as np
from command import command

from fpk_rocking import Block, Dimensions, NoNoise, Scene
from fpk_rocking.output.tables import reporting
from fpk_rocking.results import pictures, storage
from fpk_rocking.results.storage import plain
from fpk_rocking.risk import IntensityCurve, at_intensity, fragility, synthetic_records

INCH, GRAVITY = 0.0254, 9.80665
PUBLISHED = (
    (12.625, 29.0, 0.724), (12.625, 41.0, 0.493), (12.625, 56.0, 0.361), (12.625, 71.0, 0.290), (12.625, 81.25, 0.251),
    (15.0, 24.0, 1.229), (15.0, 52.0, 0.498), (18.6, 52.5, 0.688), (18.6, 67.75, 0.526),
)  # fmt: skip
"""Depth and height, inches, and the median peak floor velocity, m/s; the dispersion of all is .5."""

SLENDER = (3.0, 5.0)
RADII = tuple(np.geomspace(0.3, 5.0, 6).tolist())
SCALES = tuple(np.geomspace(0.5, 14.0, 16).tolist())
"""Velocities in units of .18 s times g B/H."""


def median_of(size, motions, scales=SCALES) -> dict:
    """Median peak velocity at which a block of a size (m) overturns under motions, its 95 % limits, and the dispersion.

    Velocities are in m/s; `motions` are records, each of which is scaled to all velocities (`scales` as `SCALES`).
    """
    scenes = [Scene(Block(dimensions=size), motion, NoNoise()) for motion in motions]
    scale = 0.18 * GRAVITY * size.width / size.height * np.array(scales)
    curves = fragility([at_intensity(scene) for scene in scenes], scale=scale)
    fit = IntensityCurve.of(curves, samples=400).fit
    return {"median": fit.median, "interval": list(fit.median_interval), "dispersion": fit.dispersion}


def run(out, motions=30, radii=RADII, published=PUBLISHED, scales=SCALES, seed=1) -> dict:
    """Compute, draw and write everything.

    Parameters
    ----------
    out : pathlib.Path
        Folder for the files; created if missing.
    motions : int
        Number of synthetic motions.
    radii : sequence of float
        Half diagonals of the other blocks, m.
    published : sequence of (float, float, float)
        Depth and height, inches, and median, m/s.
    scales : sequence of float
        Velocities, as `SCALES`.
    seed : int
        Of the motions.

    Returns
    -------
    dict
        What ``fema_p58.json`` holds.
    """
    suite = synthetic_records(motions, seed=seed)
    sizes = [Dimensions(INCH * depth, INCH * height) for depth, height, _ in published]
    others = []
    for slender in SLENDER:
        widths = [2.0 * radius / math.hypot(1.0, slender) for radius in radii]
        others += [Dimensions(width, slender * width) for width in widths]
    blocks = []
    with reporting("blocks") as progress:
        for number, size in enumerate([*sizes, *others]):
            blocks.append({"width": size.width, "height": size.height} | median_of(size, suite, scales))
            progress(number + 1, len(sizes) + len(others))
    values = {"motions": motions, "published": [median for *_, median in published], "blocks": blocks}
    storage.write_json(out / "fema_p58.json", plain(values))
    draw(out / "fema_p58.png", values)
    return values


def seconds_of(block, median):
    """Median velocity (m/s) over g B/H of a block with width and height (m), seconds."""
    return np.asarray(median) * block["height"] / (GRAVITY * block["width"])


def draw(path, values):
    """Draw the medians against the published ones, and over the size of the block."""
    count = len(values["published"])
    same, others = values["blocks"][:count], values["blocks"][count:]
    note = (
        f"{values['motions']} synthetic motions of firm ground (nonstationary Kanai-Tajimi), scaled to equal PGV, "
        "without noise; Housner's restitution. Bars: 95 % intervals, of a motion drawn from their population."
    )
    alike = [block for block in others if math.isclose(block["height"] / block["width"], SLENDER[0], rel_tol=1e-9)]
    rise = seconds_of(alike[-1], alike[-1]["median"]) / seconds_of(alike[0], alike[0]["median"])
    low, high = (0.5 * math.hypot(block["width"], block["height"]) for block in (alike[0], alike[-1]))
    title = (
        f"FEMA P-58 knows no effect of size; a rigid block of R = {high:.2g} m stands {rise:.1f} times the PGV of one "
        f"of {low:.2g} m"
    )
    with pictures.page(path, (11.0, 5.4), title, [note]) as figure:
        left, right = figure.subplots(1, 2)
        ours, limits = [block["median"] for block in same], [block["interval"] for block in same]
        pictures.error_bars(left, values["published"], ours, limits, color=pictures.COLOURS[0], label="the nine sizes")
        span = np.array([0.2, 4.0])
        left.plot(span, span, color="black", linewidth=0.8, label="equal")
        left.set(title="(a) Median PGV of overturning", xlabel="FEMA P-58, m/s", ylabel="rigid block, m/s")
        radii = [0.5 * math.hypot(block["width"], block["height"]) for block in same]
        theirs = [seconds_of(block, median) for block, median in zip(same, values["published"], strict=True)]
        right.plot(radii, theirs, "s", color="black", markersize=5.0, label="FEMA P-58")
        _sizes(right, same, pictures.COLOURS[0], "the nine sizes", "o")
        for slender, colour, marker in zip(SLENDER, pictures.COLOURS[1:], "D^", strict=False):
            rows = [block for block in others if math.isclose(block["height"] / block["width"], slender, rel_tol=1e-9)]
            _sizes(right, rows, colour, f"height over width {slender:g}", marker, line="-")
        right.set(
            title="(b) Median over g B/H", xlabel="half diagonal R, m", ylabel="median · H / (g B), s", xscale="log"
        )
        for axes in (left, right):
            axes.set_yscale("log")
            axes.legend(fontsize=9)
        left.set_xscale("log")
        _plain(left.xaxis, left.yaxis, right.xaxis, right.yaxis)


def _plain(*lines):
    """Write plain numbers at 1, 2 and 5 times powers of ten."""
    from matplotlib.ticker import LogLocator, NullLocator

    for line in lines:
        line.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        line.set_major_formatter("{x:g}")
        line.set_minor_locator(NullLocator())


def _sizes(axes, rows, colour, label, marker, line="none"):
    """Draw medians over g B/H of some blocks against their half diagonals."""
    radii = [0.5 * math.hypot(block["width"], block["height"]) for block in rows]
    middle = [float(seconds_of(block, block["median"])) for block in rows]
    limits = [seconds_of(block, block["interval"]) for block in rows]
    pictures.error_bars(axes, radii, middle, limits, color=colour, marker=marker, label=label, linestyle=line)


def report(values):
    """Print what the medians over g B/H span."""
    count = len(values["published"])
    same, others = values["blocks"][:count], values["blocks"][count:]
    theirs = [seconds_of(block, median) for block, median in zip(same, values["published"], strict=True)]
    for name, medians in (
        ("FEMA P-58, nine sizes", theirs),
        ("rigid block, nine sizes", [seconds_of(block, block["median"]) for block in same]),
        ("rigid block, other sizes", [seconds_of(block, block["median"]) for block in others]),
    ):
        print(f"{name}: median over g B/H from {min(medians):.3f} to {max(medians):.3f} s")


if __name__ == "__main__":
    command(
        run,
        "results/fema_p58",
        "fema_p58.png",
        "fema_p58.json",
        report=report,
        motions="of the suite",
        seed="seed",
    )
