"""The mean Poincaré map under growing noise, in both its readings: cf. Fig. 8 of Lin and Yim (1996).

The main scene moves chaotically and bounded without noise. Shown are its time history and, for growing variances of the
noise, its Poincaré points without noise (grey) and the mean map (paper 21) in two readings:

* restarted: the mean of the images after one cycle, from which all realizations start again. It is a map of the plane,
  the deterministic one blurred by noise, and has an attractor of its own, of which many points are shown;
* ensemble: the mean of realizations that run on freely. It forgets its start within some ten cycles and comes to rest
  at the mean of whatever still stands, a point that no block ever need visit.

Overturned realizations are left out of the means. A mean over finitely many is itself noisy: a restarted map carries
that error on. It ends where all realizations overturn within one cycle, as in the last panels; the cycle at which that
happens depends on the size of the ensemble and on the seed (see fig09_onset.py).

What the panels of the paper's figure hold was inferred, not read off: a time history and mean maps. The paper does not
state the noise band. The band [0, 10] is inferred by this project from the paper's claims.

Source: H. Lin and S. C. S. Yim, "Nonlinear rocking motions. I: Chaos under noisy periodic excitations", J. Eng. Mech.
122(8), 719-727, 1996, eq. 21 and Fig. 8.

Run time: about twenty seconds on 2 cores, once the kernels are compiled.

    python cases/fig08_mean_poincare.py --out results/fig08

Files: ``fig08.png``, ``fig08.json``.
"""

import argparse
import pathlib
import sys

import numpy as np

from fpk_rocking import NoNoise, load_scene
from fpk_rocking.output import motion, style, summary
from fpk_rocking.output.progress import reporting
from fpk_rocking.remarks import remarks
from montecarlo import histories, mean_poincare_map, restarted_poincare_map, simulate

SCENE = pathlib.Path(__file__).parent / "scenes" / "main.toml"
VARIANCES = (0.0004, 0.0025, 0.005, 0.01, 0.02, 0.04)
SETTLED = 50
ENSEMBLE_CYCLES = 40
SHOWN_CYCLES = 60


def run(out, variances=VARIANCES, cycles=600, realizations=1000, seed=1) -> dict:
    """Compute, draw and write everything.

    Parameters
    ----------
    out : path
        Folder for the files; created if missing.
    variances : sequence of float
        σ², nondimensional; six at most.
    cycles : int
        Of the restarted maps and of the motion without noise, above 50.
    realizations, seed : int
        Of each mean; ensembles that run freely are ten times as large.

    Returns
    -------
    dict
        What ``fig08.json`` holds.
    """
    out, scene = pathlib.Path(out), load_scene(SCENE)
    quiet = scene.varied(noise=NoNoise())
    history = histories(quiet, cycles=SHOWN_CYCLES, samples_per_cycle=50)
    attractor = simulate(quiet, cycles=10 * cycles, realizations=1)
    sampled = {"realizations": realizations, "seed": seed, "overturned": "left out"}
    restarted, free = [], []
    for variance in variances:
        noisy = scene.varied(noise={"variance": variance})
        with reporting(f"restarted map, σ² = {variance:g}") as progress:
            restarted.append(restarted_poincare_map(noisy, cycles=cycles, progress=progress, **sampled))
        ensemble = simulate(noisy, cycles=ENSEMBLE_CYCLES, realizations=10 * realizations, seed=seed)
        free.append(mean_poincare_map(ensemble, "left out"))
    values = {
        "figure": "Fig. 8 of Lin and Yim, J. Eng. Mech. 122(8), 1996",
        "scene": scene.to_toml(),
        "cycles": cycles,
        "realizations": realizations,
        "without_noise": _spread(np.stack([attractor.angle[0], attractor.velocity[0]], axis=1)[SETTLED:]),
        "maps": [_plain(*one) for one in zip(variances, restarted, free, strict=True)],
        "remarks": list(remarks(ensemble)),
    }
    _draw(out / "fig08.png", history, attractor, values, restarted, free)
    summary.write_summary(out / "fig08.json", values)
    return values


def _plain(variance, restarted, free):
    """How far both maps spread, and when the restarted one ended."""
    ended = np.flatnonzero(restarted.counted == 0)
    points = restarted.points[SETTLED:]
    points = points[np.isfinite(points[:, 0])]
    return {
        "variance": variance,
        "restarted_ended_at_cycle": int(ended[0]) if ended.size else None,
        "restarted": _spread(points) if len(points) > 1 else None,
        "restarted_standard_error": np.nanmean(restarted.standard_error[1:], axis=0).tolist(),
        "ensemble_last": free.points[-1].tolist(),
        "ensemble_last_standard_error": free.standard_error[-1].tolist(),
        "ensemble_standing": int(free.counted[-1]),
    }


def _spread(points):
    """Mean and standard deviation of Poincaré points (n, 2)."""
    return {"mean": points.mean(axis=0).tolist(), "deviation": points.std(axis=0).tolist()}


def _draw(path, history, attractor, values, restarted, free):
    size = values["realizations"]
    notes = [f"Means of {size:,} realizations where restarted, of {10 * size:,} where free.", *values["remarks"]]
    with style.page(path, (10.5, 9.8), "Mean Poincaré maps under growing noise (cf. paper Fig. 8)", notes) as figure:
        top, bottom = figure.subfigures(2, 1, height_ratios=(0.32, 1.0))
        axes = top.subplots()
        motion.history_panel(axes, history, 0)
        axes.set(xlabel=motion.TIME, ylabel="angle / critical angle")
        axes.set_title("Without noise: chaotic and bounded; a dot is an impact", loc="left")
        panels = bottom.subplots(2, 3, sharex=True, sharey=True).ravel()
        for axes, value, mapped, mean in zip(panels, values["maps"], restarted, free, strict=False):
            _maps(axes, attractor, mapped, mean)
            ended = value["restarted_ended_at_cycle"]
            fate = "" if ended is None else f", restarted ends at cycle {ended}"
            axes.set_title(f"σ² = {value['variance']:g}{fate}", fontsize=10)
        for axes in panels[len(values["maps"]) :]:
            axes.remove()
        handles, names = panels[0].get_legend_handles_labels()
        bottom.legend(handles, names, loc="outside upper center", ncols=3, markerscale=2.0)
        bottom.supxlabel(motion.ANGLE, fontsize=10)
        bottom.supylabel(motion.VELOCITY, fontsize=10)


def _maps(axes, attractor, mapped, mean):
    points = attractor.angle[0, SETTLED:], attractor.velocity[0, SETTLED:]
    axes.plot(*points, ".", markersize=1.0, color="#bbbbbb", label="no noise", rasterized=True)
    axes.plot(*mapped.points.T, ".", markersize=2.5, color=style.COLOURS[0], label="restarted from the mean")
    shape = {"marker": "o", "markersize": 3.0, "markerfacecolor": "white", "linewidth": 0.7}
    axes.plot(*mean.points.T, color=style.COLOURS[1], label="mean of a free ensemble", **shape)


def main() -> int:
    """Read the command line, run, print what became of the maps."""
    parser = argparse.ArgumentParser(description="Fig. 8 of Lin and Yim (1996).")
    parser.add_argument("--out", type=pathlib.Path, default="results/fig08", help="folder (default: %(default)s)")
    parser.add_argument("--cycles", type=int, default=600, help="of the restarted maps (default: %(default)s)")
    parser.add_argument("--realizations", type=int, default=1000, help="of each mean (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="of all (default: %(default)s)")
    options = parser.parse_args()
    values = run(options.out, cycles=options.cycles, realizations=options.realizations, seed=options.seed)
    print(f"without noise: deviation {values['without_noise']['deviation']}")
    for one in values["maps"]:
        deviation = one["restarted"] and [round(number, 3) for number in one["restarted"]["deviation"]]
        last = [round(number, 3) for number in one["ensemble_last"]]
        ended = one["restarted_ended_at_cycle"]
        fate = f"restarted: deviation {deviation}, ended at cycle {ended}"
        print(f"σ² = {one['variance']:<8g} {fate}; ensemble's last mean {last}")
    print(f"Files in {options.out}: fig08.png, fig08.json")
    return 0


if __name__ == "__main__":
    sys.exit(main())
