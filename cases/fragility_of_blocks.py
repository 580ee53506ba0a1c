"""Fragility of three blocks under a record.

A bookcase of 0.35 m by 2.0 m, a rack of 0.6 m by 2.1 m and a statue on its pedestal of 0.9 m by 3.6 m stand from rest
on a base that moves as the strong 12 s of the project's synthetic record, with noise of 0.8 m/s² from 0 to 8 Hz whose
envelope rises and falls with the record, both times the scale. Two engines that share no numerics solve the same
equations under the same white noise with that envelope: paths, with 95 % intervals, and the density, a line through
its scales. Beside them stand paths under the band noise itself: where the forcing hardly lifts a block off, white noise
overturns it too often. Below are the differences of the paths from the density.

Run time: about five minutes on 2 cores, once the kernels are compiled; most of it is the density.

    python cases/fragility_of_blocks.py --out results/fragility_of_blocks

Files: ``blocks.png``, ``blocks.json``.
"""

import dataclasses
import pathlib

import numpy as np
from command import command
from scipy.interpolate import PchipInterpolator

from fpk_rocking import Record, Scene
from fpk_rocking.envelopes import Table
from fpk_rocking.output import style, summary
from fpk_rocking.output.progress import reporting
from fpk_rocking.studies import fragility
from fpk_rocking.studies.picture import logarithmic

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
    """Return the scene of a block, at scale 1."""
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
    found = {}
    sample = {"realizations": realizations, "seed": seed}
    for name in blocks:
        scene, own = scene_of(*BLOCKS[name]), {}
        for engine in ENGINES:
            asked = scales[name][::every] if engine == "density" else scales[name]
            options = {"tol": tol} if engine == "density" else sample
            with reporting(f"{name}, {engine}") as progress:
                own[engine] = fragility(scene, scale=asked, engine=engine, progress=progress, **options)
        found[name] = own
    apart = {name: difference(own["white"], own["density"]) for name, own in found.items()}
    _draw(out / "blocks.png", found, apart)
    values = {
        "blocks": {
            name: {"scene": own["white"].scenes[0].to_toml(), "largest_difference": apart[name]}
            | {engine: result.summary() for engine, result in own.items()}
            for name, own in found.items()
        }
    }
    summary.write_summary(out / "blocks.json", values)
    return values


def difference(paths, density) -> dict:
    """Return the largest difference of P(overturned), paths less density, where both know it, and what explains it."""
    apart, limits, estimate = differences(paths, density)
    n = int(np.nanargmax(np.abs(apart)))
    return {
        "scale": float(density.scale[n]),
        "difference": float(apart[n]),
        "interval": limits[n].tolist(),
        "error_estimate": float(estimate[n]),
    }


def differences(paths, density):
    """Return P(overturned) of paths less that of the density at its scales (n,), with limits (n, 2), and estimates."""
    place, known = np.searchsorted(paths.scale, density.scale), density.overturned[0]
    limits = paths.interval()[0, 0, place] - known[:, None]
    return paths.overturned[0, place] - known, limits, density.error_estimate[0, 0]


def _draw(path, found, apart):
    """Draw a column for each block: curves, and below them the differences from the density."""
    shaken = f"The strong {END - BEGIN:g} s of the project's synthetic record (peak 0.35 g at scale 1)"
    noise = "noise of 0.8 m/s² from 0 to 8 Hz with an envelope"
    followed = "A block is followed until it rests or has overturned. The density is solved at ×."
    notes = [f"{shaken} and {noise}, both times the scale. {followed}"]
    for name, own in found.items():
        far, (low, high) = apart[name], apart[name]["interval"]
        notes.append(
            f"{name}: largest difference of paths under white noise from the density {far['difference']:+.4f} (95 %: "
            f"{low:+.4f} to {high:+.4f}; estimate of the density {far['error_estimate']:.4f}), at scale "
            f"{far['scale']:.3g}. {own['white'].describe(0)}"
        )
    notes.append("p: probability that counts drawn from the fitted lognormal curve depart from it as far.")
    notes += _remarks({name: own["white"] for name, own in found.items()})
    with style.page(path, (16.0, 7.2 + 0.24 * len(notes)), "Fragility under a record plus noise", notes) as figure:
        panels = figure.subplots(2, len(found), sharex="col", sharey="row", height_ratios=(2.2, 1.0), squeeze=False)
        for (curves, rests), (name, own) in zip(panels.T, found.items(), strict=True):
            _curves(curves, own)
            _differences(rests, own)
            width, height = BLOCKS[name]
            curves.set_title(f"{name}, {width:g} m × {height:g} m")
        panels[0, 0].set_ylabel("P(overturned)")
        panels[1, 0].set_ylabel("difference from\nthe density")
        # In the last column, where the curve leaves the lower right corner free.
        panels[0, -1].legend(loc="lower right")
        panels[1, -1].legend(loc="upper right")


def _remarks(told):
    """Return the remarks on the blocks, each kind once: of the first block that it is for, with the names of others."""
    kinds = {}
    for name, curves in told.items():
        replaced = [(curves.closure, curves.closure)] * bool(curves.closure)
        for kind, text in replaced + [(doubt.kind, doubt.sentence) for doubt in curves.doubts]:
            kinds.setdefault(kind, {})[name] = text
    for (first, *others), texts in ((tuple(own), tuple(own.values())) for own in kinds.values()):
        alike = len(set(texts)) == 1 and len(texts) == len(told)
        yield texts[0] if alike else f"{first}: {texts[0]}" + f" ({', '.join(others)}: likewise.)" * bool(others)


def _curves(axes, own):
    density, colours = own["density"], style.COLOURS
    fine = np.geomspace(density.scale[0], density.scale[-1], 200)
    line = PchipInterpolator(np.log(density.scale), density.overturned[0])(np.log(fine))
    axes.plot(fine, line, color=colours[1], label="density, white noise")
    axes.plot(density.scale, density.overturned[0], "x", color=colours[1])
    looks = {"white": ("o", colours[0], "paths, the same white noise"), "exact": ("s", "0.5", "paths, band noise")}
    for engine, (marker, colour, label) in looks.items():
        result = own[engine]
        style.error_bars(
            axes, result.scale, result.overturned[0], result.interval()[0, 0], color=colour, marker=marker, label=label
        )
    axes.set(ylim=(-0.03, 1.03))


def _differences(axes, own):
    """Draw paths less density, with the intervals of the paths over a bar of the density's estimate."""
    scale, (apart, limits, estimate) = own["density"].scale, differences(own["white"], own["density"])
    look = {"color": style.COLOURS[1], "label": "estimate of the density"}
    axes.axhline(0.0, color=style.COLOURS[1])
    axes.errorbar(scale, 0.0 * apart, estimate, linestyle="none", linewidth=6.0, alpha=0.4, **look)
    style.error_bars(axes, scale, apart, limits, color=style.COLOURS[0], label="paths, white noise")
    axes.set(xlabel="scale of the shaking")
    logarithmic(axes.set_xscale, axes.xaxis)


def told(values):
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
        told=told,
        realizations="of an ensemble",
        tol="tolerance of the densities",
        seed="of the ensembles",
    )
