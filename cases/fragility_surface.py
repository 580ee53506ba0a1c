"""Overturning against size and shape of a block.

Of two blocks of one shape the larger one stands longer. Blocks from rest are shaken for ten cycles at 1.5 Hz and 3
m/s², with noise of 0.3 m/s² from 0 to 8 Hz. Shown is the probability of overturning over the half diagonal R and the
slenderness (height over width) at this shaking, and, for one slenderness and for one size, against the scale of the
shaking. The first is a sweep over a grid, the others are fragility surfaces; `--workers 2` runs all of them on two
processes.

Run time: about half a minute on 2 cores, once the kernels are compiled.

    python cases/fragility_surface.py --out results/fragility_surface

Files: ``surface.png``, ``surface.json``.
"""

import numpy as np
from command import command

from fpk_rocking import Scene
from fpk_rocking.output.tables import reporting
from fpk_rocking.results import pictures, storage
from fpk_rocking.risk import fragility
from fpk_rocking.risk.picture import NAMES, draw_map
from fpk_rocking.studies import grid, sweep

SIZES = tuple(np.geomspace(0.3, 3.0, 15).tolist())
SLENDERNESSES = tuple(np.geomspace(3.0, 9.0, 13).tolist())
SCALES = tuple(np.geomspace(0.5, 5.0, 16).tolist())
CYCLES = 10
SCENE = Scene.from_block(0.6, 2.4, 3.0, 1.5, noise_rms_acceleration=0.3, noise_band_hz=(0.0, 8.0))


def run(out, sizes=SIZES, slendernesses=SLENDERNESSES, scales=SCALES, realizations=2000, seed=1, workers=1) -> dict:
    """Compute, draw and write everything.

    Parameters
    ----------
    out : pathlib.Path
        Folder for the files; created if missing.
    sizes, slendernesses, scales : sequence of float
        Half diagonals in metres, heights over widths, and factors of the shaking.
    realizations, seed : int
        Of each ensemble.
    workers : int
        Processes.

    Returns
    -------
    dict
        What ``surface.json`` holds.
    """
    common = {"cycles": CYCLES, "realizations": realizations, "seed": seed, "workers": workers}
    blocks = grid(SCENE, {"size": sizes, "slenderness": slendernesses})
    with reporting("sizes and slendernesses") as progress:
        result = sweep(blocks, "mc", progress=progress, **common)
    with reporting("sizes") as progress:
        by_size = fragility(SCENE, scale=scales, over={"size": sizes}, progress=progress, **common)
    with reporting("slendernesses") as progress:
        by_shape = fragility(SCENE, scale=scales, over={"slenderness": slendernesses}, progress=progress, **common)
    overturned = 1.0 - result.values("survival")
    values = {
        "scene": SCENE.to_toml(),
        "sizes": list(sizes),
        "slendernesses": list(slendernesses),
        "overturned": overturned.tolist(),
        "realizations": realizations,
        "by_size": by_size.summary(),
        "by_slenderness": by_shape.summary(),
    }
    draw(out / "surface.png", values)
    storage.write_json(out / "surface.json", values)
    return values


def draw(path, values):
    """Draw P(overturned) over size and slenderness, and over the scale with either of them."""
    size, overturned = SCENE.block.dimensions, np.array(values["overturned"])
    sizes, middle = values["sizes"], len(values["slendernesses"]) // 2
    half = float(np.interp(0.5, overturned[::-1, middle], sizes[::-1]))
    title = (
        f"Large and squat blocks stand longer: of height over width {values['slendernesses'][middle]:.2g} half "
        f"overturn at R = {half:.2g} m"
    )
    shaking = f"Scale 1: {CYCLES} cycles of 3 m/s² at 1.5 Hz, noise of 0.3 m/s² from 0 to 8 Hz"
    notes = [f"{shaking}. {values['realizations']:,} paths a point. R: half diagonal."]
    with pictures.page(path, (12.0, 5.4), title, notes) as figure:
        panels = figure.subplots(1, 3)
        filled = draw_map(panels[0], sizes, values["slendernesses"], overturned.T)
        panels[0].set(xlabel=NAMES["size"], ylabel=NAMES["slenderness"])
        panels[0].set_title("(a) Scale 1")
        _over_scale(panels[1], values["by_size"])
        panels[1].set_title(f"(b) {NAMES['slenderness'].capitalize()} {size.height / size.width:.2g}")
        _over_scale(panels[2], values["by_slenderness"])
        panels[2].set_title(f"(c) R = {size.half_diagonal:.2f} m")
        figure.colorbar(filled, ax=panels, label="P(overturned)")


def _over_scale(axes, curves):
    """Draw P(overturned) over the scale and the size or shape, from a summary of curves."""
    draw_map(axes, curves["scale"], curves["place"], curves["overturned"])
    axes.set(xlabel="scale of the shaking", ylabel=NAMES[curves["axis"]])


def report(values):
    """Print the medians."""
    for name in ("by_size", "by_slenderness"):
        for place, (fit,) in zip(values[name]["place"], values[name]["fits"], strict=True):
            median = f"{fit['median']:.3f}" if fit["median"] else fit["reason"]
            print(f"{values[name]['axis']} {place:.3f}: median scale {median}")


if __name__ == "__main__":
    command(
        run,
        "results/fragility_surface",
        "surface.png",
        "surface.json",
        report=report,
        realizations="of an ensemble",
        seed="of the ensembles",
        workers="processes",
    )
