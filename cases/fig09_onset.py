"""How noise diffuses the chaotic attractor until it leaks: the onset of overturning, cf. Fig. 9 of Lin and Yim (1996).

For growing variances of the noise are shown

* the Poincaré points of the blocks that still stand after 20 cycles, over the attractor without noise (grey),
* the rate of overturning per cycle once the start is forgotten, under three noise bands. It is counted from the
  20th cycle on: overturned blocks over cycles lived, with the exact interval of a Poisson count, as if all blocks had
  the same rate (the drawn frequencies of the noise make some realizations more dangerous than others),
* the number of cycles after which the restarted mean map (paper 21) overturns as a whole, for several seeds and two
  sizes of the ensemble. It is a blurred deterministic map, and below some noise it has an attractor.

The onset is put where one block in a hundred overturns within 200 cycles: at a rate of 5e-5 a cycle. It depends on
that choice, for the rate falls steeply but without a threshold.

What the paper's figure holds was inferred: an onset of overturning as noise grows. The paper does not state the noise
band. The band [0, 10] is inferred by this project from the paper's claims.

Source: H. Lin and S. C. S. Yim, "Nonlinear rocking motions. I: Chaos under noisy periodic excitations", J. Eng. Mech.
122(8), 719-727, 1996, Fig. 9.

Run time: about forty seconds on 2 cores, once the kernels are compiled.

    python cases/fig09_onset.py --out results/fig09

Files: ``fig09.png``, ``fig09.json``.
"""

import argparse
import math
import pathlib
import sys

import numpy as np

from fpk_rocking import NoNoise, load_scene
from fpk_rocking.output import motion, style, summary
from fpk_rocking.output.intervals import error_bars
from fpk_rocking.remarks import remarks
from montecarlo import overturning_rate, restarted_poincare_map, simulate

SCENE = pathlib.Path(__file__).parent / "scenes" / "main.toml"
SHOWN = (0.0004, 0.0025, 0.01, 0.04)
VARIANCES = (0.00025, 0.0005, 0.00075, 0.001, 0.0015, 0.0025, 0.005, 0.01, 0.02, 0.04)
BANDS = (5.0, 10.0, 20.0)
MAP_VARIANCES = (0.005, 0.01, 0.015, 0.0175, 0.02, 0.03, 0.04)
MAP_SIZES = (250, 1000)
SEEDS = (1, 2, 3)
FORGOTTEN = 20
ONSET_RATE = 0.01 / 200
_VARIANCE = "variance of the noise σ², nondimensional"


def run(out, variances=VARIANCES, cycles=200, realizations=3000, map_variances=MAP_VARIANCES, map_cycles=200) -> dict:
    """Compute, draw and write everything.

    Parameters
    ----------
    out : path
        Folder for the files; created if missing.
    variances, map_variances : sequence of float
        σ² at which rates are counted and at which mean maps are followed, nondimensional.
    cycles, realizations : int
        Of each ensemble; above 20 cycles.
    map_cycles : int
        Cycles over which mean maps are followed.

    Returns
    -------
    dict
        What ``fig09.json`` holds.
    """
    out, scene = pathlib.Path(out), load_scene(SCENE)
    quiet = simulate(scene.varied(noise=NoNoise()), cycles=3000, realizations=1)
    shown = [_ensemble(scene, variance, 10.0, FORGOTTEN, realizations) for variance in SHOWN]
    rates = {
        band: [_rate(_ensemble(scene, variance, band, cycles, realizations)) for variance in variances]
        for band in BANDS
    }
    values = {
        "figure": "Fig. 9 of Lin and Yim, J. Eng. Mech. 122(8), 1996",
        "scene": scene.to_toml(),
        "cycles": cycles,
        "realizations": realizations,
        "variances": list(variances),
        "rates": [{"band": [0.0, band], "per_cycle": found} for band, found in rates.items()],
        "onset_rate": ONSET_RATE,
        "onset": [{"band": [0.0, band], "variance": _onset(variances, found)} for band, found in rates.items()],
        "map_cycles": map_cycles,
        "maps": [_map(scene, variance, size, map_cycles) for size in MAP_SIZES for variance in map_variances],
        "remarks": list(remarks(shown[0])),
    }
    _draw(out / "fig09.png", quiet, shown, values)
    summary.write_summary(out / "fig09.json", values)
    return values


def _ensemble(scene, variance, band, cycles, realizations):
    noisy = scene.varied(noise={"variance": variance, "band": (0.0, band)})
    return simulate(noisy, cycles=cycles, realizations=realizations)


def _rate(ensemble):
    """Rate of overturning per cycle after the start is forgotten, as plain values."""
    found = overturning_rate(ensemble, FORGOTTEN)
    return {"rate": found.rate, "interval": found.interval.tolist(), "count": found.count}


def _onset(variances, found):
    """Variance at which the rate passes the onset's, between two of the grid on logarithmic axes; None outside it."""
    rates = np.array([one["rate"] for one in found])
    above = np.flatnonzero(rates >= ONSET_RATE)
    if above.size == 0 or above[0] == 0 or rates[above[0] - 1] == 0.0:
        return None
    places = slice(above[0] - 1, above[0] + 1)
    logarithm = np.interp(math.log(ONSET_RATE), np.log(rates[places]), np.log(variances[places]))
    return float(math.exp(logarithm))


def _map(scene, variance, realizations, cycles):
    ended = [_ended(scene, variance, realizations, cycles, seed) for seed in SEEDS]
    return {"variance": variance, "realizations": realizations, "ended": ended}


def _ended(scene, variance, realizations, cycles, seed):
    """Cycle at which all realizations of a restarted mean map overturned; None if that never happened."""
    noisy = scene.varied(noise={"variance": variance})
    sampled = {"cycles": cycles, "realizations": realizations, "seed": seed}
    counted = restarted_poincare_map(noisy, overturned="left out", **sampled).counted
    return int(np.argmax(counted == 0)) if (counted == 0).any() else None


def _draw(path, quiet, shown, values):
    size = f"{values['realizations']:,} realizations of each noise, {values['cycles']} cycles; rates after {FORGOTTEN}"
    notes = [f"{size}. Grey: without noise.", *values["remarks"]]
    title = "The noisy attractor and the onset of overturning (cf. paper Fig. 9)"
    with style.page(path, (10.5, 10.0), title, notes) as figure:
        top, bottom = figure.subfigures(2, 1, height_ratios=(1.25, 1.0))
        panels = top.subplots(2, 2, sharex=True, sharey=True).ravel()
        for axes, ensemble in zip(panels, shown, strict=True):
            axes.plot(quiet.angle[0, 50:], quiet.velocity[0, 50:], ".", markersize=1.0, color="#999999")
            look = {"markersize": 1.0, "color": style.COLOURS[0], "alpha": 0.6, "rasterized": True}
            axes.plot(ensemble.angle[:, -1], ensemble.velocity[:, -1], ".", **look)
            standing = f"{ensemble.survivors[-1]:,} of {ensemble.realizations:,} stand"
            axes.set_title(f"σ² = {ensemble.scene.noise.variance:g}: {standing} after {FORGOTTEN} cycles", fontsize=10)
        top.supxlabel(motion.ANGLE, fontsize=10)
        top.supylabel(motion.VELOCITY, fontsize=10)
        rates, maps = bottom.subplots(1, 2)
        _rates(rates, values)
        _maps(maps, values)


def _rates(axes, values):
    variances = np.array(values["variances"])
    for one, colour, marker in zip(values["rates"], style.shades(len(values["rates"])), "osD", strict=True):
        rate = np.array([found["rate"] for found in one["per_cycle"]])
        limits, some = np.array([found["interval"] for found in one["per_cycle"]]), rate > 0.0
        shape = {"color": colour, "marker": marker, "linestyle": "-", "linewidth": 0.8}
        label = f"band [0, {one['band'][1]:g}]"
        error_bars(axes, variances[some], rate[some], limits[some], label=label, **shape)
        axes.plot(variances[~some], limits[~some, 1], "v", color=colour, markersize=5)
    axes.axhline(values["onset_rate"], color="black", linewidth=0.8, linestyle="--")
    axes.set(xscale="log", yscale="log", xlabel=_VARIANCE, ylabel="rate per forcing cycle")
    axes.set_title("Rate of overturning, 95 % intervals\na wedge is an upper limit; dashed: the onset", fontsize=10)
    axes.legend()


def _maps(axes, values):
    last = values["map_cycles"]
    for size, colour, marker, shift in zip(MAP_SIZES, style.COLOURS, "os", (-2e-4, 2e-4), strict=False):
        found = [one for one in values["maps"] if one["realizations"] == size]
        pairs = [(one["variance"] + shift, ended) for one in found for ended in one["ended"]]
        gone = np.array([pair for pair in pairs if pair[1] is not None]).reshape(-1, 2)
        kept = np.array([variance for variance, ended in pairs if ended is None])
        shape = {"color": colour, "marker": marker, "linestyle": "none", "markerfacecolor": "white"}
        axes.plot(*gone.T, label=f"mean of {size:,}", **shape)
        axes.plot(kept, np.full(kept.shape, 1.3 * last), "^", color=colour, markersize=6)
    axes.set(yscale="log", xlabel=_VARIANCE, ylabel="forcing cycles until the mean overturns")
    title = f"End of the restarted mean map, band [0, 10], {len(SEEDS)} seeds\na triangle: not in {last} cycles"
    axes.set_title(title, fontsize=10)
    axes.legend(loc="lower left")


def main() -> int:
    """Read the command line, run, print rates and onset."""
    parser = argparse.ArgumentParser(description="Fig. 9 of Lin and Yim (1996).")
    parser.add_argument("--out", type=pathlib.Path, default="results/fig09", help="folder (default: %(default)s)")
    parser.add_argument("--cycles", type=int, default=200, help="of the ensembles (default: %(default)s)")
    parser.add_argument("--realizations", type=int, default=3000, help="of an ensemble (default: %(default)s)")
    options = parser.parse_args()
    values = run(options.out, cycles=options.cycles, realizations=options.realizations)
    for row, variance in enumerate(values["variances"]):
        found = (one["per_cycle"][row]["rate"] for one in values["rates"])
        print(f"σ² = {variance:<8g} rate per cycle, bands to {BANDS}: " + "  ".join(f"{rate:.2e}" for rate in found))
    for one in values["onset"]:
        print(f"Onset, band {one['band']}: σ² = {one['variance'] and round(one['variance'], 5)}")
    for one in values["maps"]:
        print(f"Mean map of {one['realizations']}, σ² = {one['variance']:<8g} ended at cycle {one['ended']}")
    print(f"Files in {options.out}: fig09.png, fig09.json")
    return 0


if __name__ == "__main__":
    sys.exit(main())
