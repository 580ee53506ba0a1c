"""Fragility of three blocks under a record.

A bookcase of 0.35 m by 2.0 m, a rack of 0.6 m by 2.1 m and a statue on its pedestal of 0.9 m by 3.6 m stand from rest
on a base that moves as the strong 12 s of the project's synthetic record, with noise of 0.8 m/s² from 0 to 8 Hz whose
envelope rises and falls with the record, both times the scale. Two engines that share no numerics solve the same
equations under the same white noise with that envelope: paths, with 95 % intervals, and the density. Beside them stand
paths under the band noise itself: where the forcing hardly lifts a block off, white noise overturns it too often. Below
are the differences of the paths from the density.

Run time: about five minutes on 2 cores, once the kernels are compiled; most of it is the density.

    python cases/fragility_of_blocks.py --out results/fragility_of_blocks

Files: ``blocks.png``, ``blocks.json``.
"""

import dataclasses
import pathlib

import numpy as np
from command import command

from fpk_rocking import Record, Scene
from fpk_rocking.envelopes import Table
from fpk_rocking.output.tables import reporting
from fpk_rocking.results import pictures, storage
from fpk_rocking.risk import fragility
from fpk_rocking.risk.picture import logarithmic

MOTION = pathlib.Path(__file__).parent / "records" / "synthetic.AT2"
BEGIN, END = 3.0, 15.0
BLOCKS = {"bookcase": (0.35, 2.0), "rack": (0.6, 2.1), "statue": (0.9, 3.6)}
SCALES = {
    "bookcase": tuple(np.geomspace(0.45, 1.2, 9).tolist()),
    "rack": tuple(np.geomspace(0.8, 2.4, 9).tolist()),
    "statue": tuple(np.geomspace(0.8, 2.6, 9).tolist()),
}
EVERY = 2
HARMONICS = 400
ENGINES = "white", "density", "exact"


def scene_of(width, height):
    """Return the scene of a block of a width and height (m) under the strong part of the record, at scale 1."""
    record = Record.from_file(MOTION)
    first, last = (round(time / record.interval) for time in (BEGIN, END))
    strong = dataclasses.replace(record, samples=record.samples[first : last + 1])
    noise = {"noise_rms_acceleration": 0.8, "noise_band_hz": (0.0, 8.0), "harmonics": HARMONICS}
    scene = Scene.from_block(width, height, record=strong, **noise)
    # Half at both ends, whole from the second to the ninth second, and none after the record.
    times = scene.block.dimensions.frequency_parameter * np.array([0.0, 2.0, 9.0, 12.0, 12.1])
    return scene.varied(noise={"envelope": Table(tuple(times.tolist()), (0.5, 1.0, 1.0, 0.5, 0.0))})


def run(out, blocks=tuple(BLOCKS), scales=SCALES, every=EVERY, realizations=10_000, tol=1e-2, seed=1) -> dict:
    """Compute, draw and write everything.

    Parameters
    ----------
    out : pathlib.Path
        Folder for the files; created if missing.
    blocks : sequence of str
        Names of `BLOCKS`.
    scales : dict of str to sequence of float
        Of each block.
    every : int
        The density is solved at every so many of them.
    realizations, seed : int
        Of each ensemble.
    tol : float
        Error that the density solver aims at.

    Returns
    -------
    dict
        What ``blocks.json`` holds.
    """
    curves_by_block = {}
    sample = {"realizations": realizations, "seed": seed}
    for name in blocks:
        scene, own = scene_of(*BLOCKS[name]), {}
        for engine in ENGINES:
            asked = scales[name][::every] if engine == "density" else scales[name]
            options = {"tol": tol} if engine == "density" else sample
            with reporting(f"{name}, {engine}") as progress:
                own[engine] = fragility(scene, scale=asked, engine=engine, progress=progress, **options)
        curves_by_block[name] = own
    apart = {name: difference(own["white"], own["density"]) for name, own in curves_by_block.items()}
    values = {
        "blocks": {
            name: {"scene": own["white"].scenes[0].to_toml(), "largest_difference": apart[name]}
            | {engine: result.summary() for engine, result in own.items()}
            for name, own in curves_by_block.items()
        }
    }
    draw(out / "blocks.png", values)
    storage.write_json(out / "blocks.json", values)
    return values


def difference(paths, density) -> dict:
    """Return the largest difference of P(overturned), paths less density, where both know it, and what explains it."""
    place, expected = np.searchsorted(paths.scale, density.scale), density.overturned[0]
    apart = paths.overturned[0, place] - expected
    n = int(np.nanargmax(np.abs(apart)))
    return {
        "scale": float(density.scale[n]),
        "difference": float(apart[n]),
        "interval": (paths.interval()[0, 0, place[n]] - expected[n]).tolist(),
        "error_estimate": float(density.error_estimate[0, 0, n]),
    }


def draw(path, values):
    """Draw a column for each block: curves, and below them the differences of paths from the density."""
    blocks = values["blocks"]
    apart = max(abs(block["largest_difference"]["difference"]) for block in blocks.values())
    name, cost = max(((name, _cost(block)) for name, block in blocks.items()), key=lambda pair: pair[1])
    title = (
        f"Density and paths agree within {apart:.3f}; white noise for band noise overturns the {name} too often, by "
        f"up to {cost:.2f}"
    )
    shaken = f"The strong {END - BEGIN:g} s of the project's synthetic record (peak 0.35 g at scale 1)"
    note = (
        f"{shaken} and noise of 0.8 m/s² from 0 to 8 Hz with an envelope, both times the scale, until the block "
        f"rests or has overturned. Paths: {_realizations(blocks):,} a point, 95 % intervals."
    )
    with pictures.page(path, (12.0, 7.2), title, [note]) as figure:
        panels = figure.subplots(2, len(blocks), sharex="col", sharey="row", height_ratios=(2.0, 1.0), squeeze=False)
        for (curves, rests), (name, block) in zip(panels.T, blocks.items(), strict=True):
            _curves(curves, block)
            _differences(rests, block)
            width, height = BLOCKS[name]
            curves.set_title(f"{name}, {width:g} m × {height:g} m")
        panels[0, 0].set_ylabel("P(overturned)")
        panels[1, 0].set_ylabel("paths less density,\nwhite noise")
        # In the last column, where the curve leaves the lower right corner free.
        panels[0, -1].legend(loc="lower right", fontsize=10)


def _realizations(blocks):
    """Return the number of paths behind a point."""
    return next(iter(blocks.values()))["white"]["realizations"]


def _cost(block):
    """Return by how much more often paths of white noise overturn than paths of band noise, at most."""
    return float(np.subtract(block["white"]["overturned"], block["exact"]["overturned"]).max())


def _curves(axes, block):
    """Draw P(overturned) of a block against the scale, by engine."""
    density = block["density"]
    label = "density, white noise"
    axes.plot(density["scale"], density["overturned"][0], "x-", color=pictures.COLOURS[1], linewidth=1.0, label=label)
    looks = {"white": ("o", pictures.COLOURS[0], "paths, white noise"), "exact": ("s", "0.5", "paths, band noise")}
    for engine, (marker, colour, label) in looks.items():
        curve = block[engine]
        points = curve["scale"], curve["overturned"][0], curve["interval"][0][0]
        pictures.error_bars(axes, *points, color=colour, marker=marker, label=label)
    axes.set(ylim=(-0.03, 1.03))


def _differences(axes, block):
    """Draw paths less density with the intervals of the paths, over a bar of the density's estimate."""
    density, paths = block["density"], block["white"]
    place, scale = np.searchsorted(paths["scale"], density["scale"]), density["scale"]
    expected = np.array(density["overturned"][0])
    apart = np.array(paths["overturned"][0])[place] - expected
    limits = np.array(paths["interval"][0][0])[place] - expected[:, None]
    estimate = np.array(density["error_estimate"][0][0], dtype=float)
    axes.axhline(0.0, color=pictures.COLOURS[1], linewidth=1.0)
    look = {"color": pictures.COLOURS[1], "linestyle": "none", "linewidth": 6.0, "alpha": 0.4}
    axes.errorbar(scale, 0.0 * apart, estimate, **look)
    pictures.error_bars(axes, scale, apart, limits, color=pictures.COLOURS[0])
    axes.set(xlabel="scale of the shaking (bars: estimate of the density)")
    logarithmic(axes.set_xscale, axes.xaxis)


def report(values):
    """Print the largest differences and the fits."""
    for name, block in values["blocks"].items():
        far, (low, high) = block["largest_difference"], block["largest_difference"]["interval"]
        print(f"{name:9} paths less density {far['difference']:+.4f} at most (95 %: {low:+.4f} to {high:+.4f}; "
              f"estimate {far['error_estimate']:.4f}), at scale {far['scale']:.3g}; "
              + ", ".join(f"{engine} {block[engine]['wall_s']:.0f} s" for engine in ENGINES))  # fmt: skip


if __name__ == "__main__":
    command(
        run,
        "results/fragility_of_blocks",
        "blocks.png",
        "blocks.json",
        report=report,
        realizations="of an ensemble",
        tol="tolerance of the densities",
        seed="of the ensembles",
    )
