"""Survival after 200 forcing cycles against the variance of the noise: Fig. 7 of Lin and Yim (1996).

The main scene from rest, with the variance of the noise from 0 to 0.04. As in the paper each probability comes from
1,000 realizations, here with Wilson's intervals. Beside it stands the density after the same 200 cycles, by the modes
of its one-cycle operator, one operator a noise level: nothing is evolved over 200 cycles, and survival far below what
realizations can tell has an error estimate of its own. Without noise there is one motion, which the exact engine
follows. Monte Carlo with the white noise that the density assumes tells the error of the solver from that of replacing
noise of 100 harmonics by white noise, which 200 cycles multiply. The second panel has a logarithmic axis. The third
shows how much the noise band matters.

The paper does not state the noise band. The band [0, 10] is inferred by this project from the paper's claims. The
paper's caption has the variance up to 0.4, its text up to 0.04; the latter is taken.

Source: H. Lin and S. C. S. Yim, "Nonlinear rocking motions. I: Chaos under noisy periodic excitations", J. Eng. Mech.
122(8), 719-727, 1996, Fig. 7.

Run time: about a minute and a half on 2 cores, most of it the densities: the less noise, the longer.

    python cases/fig07_survival_against_noise.py --out results/fig07

Files: ``fig07.png``, ``fig07.json``.
"""

import argparse
import pathlib
import sys
import time

import numpy as np

from fpk_rocking import CycleOperator, NoNoise, load_scene
from fpk_rocking.output import style, summary
from fpk_rocking.output.intervals import error_bars
from fpk_rocking.remarks import remarks
from montecarlo import simulate, tally

SCENE = pathlib.Path(__file__).parent / "scenes" / "main.toml"
VARIANCES = (0.0005, 0.001, 0.0015, 0.002, 0.003, 0.004, 0.005, 0.0075, 0.01, 0.0125, 0.015, 0.02, 0.025, 0.03, 0.04)
DENSITY_VARIANCES = (0.0025, 0.005, 0.0075, 0.01, 0.0125, 0.015, 0.02, 0.025, 0.03, 0.04)
BANDS = (5.0, 10.0, 20.0)
OURS = 10.0
WHITE_TIMES = 10
_CLOSURE = "The density solver has white noise of equal Melnikov variance: a closure, to be judged by Monte Carlo."
_VARIANCE = "variance of the noise σ², nondimensional"


def run(
    out, cycles=200, realizations=1000, variances=VARIANCES, density_variances=DENSITY_VARIANCES, tol=1e-2, seed=1
) -> dict:
    """Compute, draw and write everything.

    Parameters
    ----------
    out : path
        Folder for the files; created if missing.
    cycles, realizations, seed : int
        Of each ensemble; those of white noise are ten times as large.
    variances, density_variances : sequence of float
        σ² of the ensembles and of the densities, above 0, nondimensional.
    tol : float
        Of the one-cycle operators.

    Returns
    -------
    dict
        What ``fig07.json`` holds.
    """
    out, scene = pathlib.Path(out), load_scene(SCENE)
    bands = {band: _ensembles(scene, band, variances, cycles, realizations, seed) for band in BANDS}
    quiet = simulate(scene.varied(noise=NoNoise()), cycles=cycles, realizations=1)
    white = [_white(scene, variance, cycles, WHITE_TIMES * realizations, seed) for variance in density_variances]
    densities = [_density(scene.varied(noise={"variance": variance}), cycles, tol) for variance in density_variances]
    values = {
        "figure": "Fig. 7 of Lin and Yim, J. Eng. Mech. 122(8), 1996",
        "scene": scene.to_toml(),
        "cycles": cycles,
        "realizations": realizations,
        "variances": list(variances),
        "bands": [_plain(band, ensembles) for band, ensembles in bands.items()],
        "stands_without_noise": bool(quiet.survivors[-1]),
        "density": [one | {"variance": v} for v, one in zip(density_variances, densities, strict=True)],
        "white": [
            {
                "variance": variance,
                "survival": float(one.survival[-1]),
                "interval": one.survival_interval()[-1].tolist(),
                "realizations": one.realizations,
            }
            for variance, one in zip(density_variances, white, strict=True)
        ],
        "remarks": list(dict.fromkeys((*remarks(*bands[OURS]), _CLOSURE))),
    }
    _draw(out / "fig07.png", values)
    summary.write_summary(out / "fig07.json", values)
    return values


def _density(scene, cycles, tol):
    """Survival by the one-cycle operator of a scene, with its error estimate."""
    begin = time.perf_counter()
    operator = CycleOperator(scene, tol=tol)
    outlook = operator.outlook([cycles])
    return {
        "survival": float(outlook.survival[0]),
        "error_estimate": float(outlook.error_estimate[0]),
        "escape_rate": operator.escape_rate,
        "negative_mass": operator.negative_mass,
        "wall_s": time.perf_counter() - begin,
    }


def _ensembles(scene, band, variances, cycles, realizations, seed):
    scenes = [scene.varied(noise={"variance": variance, "band": (0.0, band)}) for variance in variances]
    return [simulate(one, cycles=cycles, realizations=realizations, seed=seed) for one in scenes]


def _white(scene, variance, cycles, realizations, seed):
    noisy = scene.varied(noise={"variance": variance}).white_equivalent()
    everywhere = {"angle_edges": [-2.0, 2.0], "velocity_edges": [-20.0, 20.0]}
    return tally(noisy, cycles=cycles, realizations=realizations, seed=seed, **everywhere)


def _plain(band, ensembles):
    """Survival after the last cycle and its interval, one a variance."""
    return {
        "band": [0.0, band],
        "survival": [float(one.survival[-1]) for one in ensembles],
        "interval": [one.survival_interval()[-1].tolist() for one in ensembles],
    }


def _draw(path, values):
    title = f"Survival after {values['cycles']} cycles against noise (cf. paper Fig. 7)"
    with style.page(path, (10.5, 9.6), title, values["remarks"]) as figure:
        panels = figure.subplot_mosaic([["ours", "ours"], ["tail", "bands"]], height_ratios=(1.0, 0.9))
        for name in ("ours", "tail"):
            _both(panels[name], values)
        panels["ours"].set(title=f"1 realization without noise, {values['realizations']:,} with", ylim=(-0.02, 1.05))
        panels["ours"].legend()
        panels["tail"].set(title="The same, logarithmic; a wedge is an upper limit", yscale="log", ylim=(1e-10, 3.0))
        _bands(panels["bands"], values)
        for axes in panels.values():
            axes.set(xlabel=_VARIANCE, ylabel="P(not overturned)")


def _both(axes, values):
    ours = next(one for one in values["bands"] if one["band"][1] == OURS)
    look = {"color": style.COLOURS[1], "label": "Monte Carlo exact, band [0, 10], 95 % intervals"}
    _limited(axes, values["variances"], ours["survival"], ours["interval"], look)
    white, found = values["white"], values["density"]
    columns = ([one[name] for one in white] for name in ("variance", "survival", "interval"))
    label = f"Monte Carlo white, {white[0]['realizations']:,} realizations"
    _limited(axes, *columns, {"color": style.COLOURS[2], "marker": "s", "label": label})
    columns = ([one[name] for one in found] for name in ("variance", "survival"))
    look = {"marker": "D", "markersize": 8.0, "markerfacecolor": "none", "linestyle": "none"}
    axes.plot(*columns, color=style.COLOURS[0], label="Fokker-Planck density", **look)
    axes.plot(0.0, float(values["stands_without_noise"]), "*", color="black", markersize=11, label="no noise", zorder=3)


def _limited(axes, variances, survival, interval, look):
    """Draw survival with its intervals where any realization stands, else the upper limit."""
    variances, survival, interval = map(np.asarray, (variances, survival, interval))
    some = survival > 0.0
    error_bars(axes, variances[some], survival[some], interval[some], **look)
    axes.plot(variances[~some], interval[~some, 1], "v", color=look["color"], markersize=5)


def _bands(axes, values):
    look = zip(values["bands"], style.shades(len(values["bands"])), "osD", strict=True)
    for found, colour, marker in look:
        label = f"band [0, {found['band'][1]:g}]"
        shape = {"color": colour, "marker": marker, "linestyle": "-", "linewidth": 0.8, "label": label}
        error_bars(axes, values["variances"], found["survival"], found["interval"], **shape)
    axes.set(title="Three noise bands, Monte Carlo exact", ylim=(-0.02, 1.05))
    axes.legend()


def main() -> int:
    """Read the command line, run, print the survival and say where the files are."""
    parser = argparse.ArgumentParser(description="Fig. 7 of Lin and Yim (1996).")
    parser.add_argument("--out", type=pathlib.Path, default="results/fig07", help="folder (default: %(default)s)")
    parser.add_argument("--cycles", type=int, default=200, help="forcing cycles (default: %(default)s)")
    parser.add_argument("--realizations", type=int, default=1000, help="of an ensemble (default: %(default)s)")
    parser.add_argument("--tol", type=float, default=1e-2, help="tolerance of the operators (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="of the ensembles (default: %(default)s)")
    options = parser.parse_args()
    values = run(options.out, options.cycles, options.realizations, tol=options.tol, seed=options.seed)
    for row, variance in enumerate(values["variances"]):
        bands = "".join(f"   [0, {one['band'][1]:g}] {one['survival'][row]:.3f}" for one in values["bands"])
        print(f"σ² = {variance:<8g}{bands}")
    for one, white in zip(values["density"], values["white"], strict=True):
        beside = f"white Monte Carlo {white['survival']:.3g} ({white['interval'][0]:.3g} to {white['interval'][1]:.3g})"
        print(f"σ² = {one['variance']:<8g}   density {one['survival']:.3g} ({one['wall_s']:.1f} s), {beside}")
    print(f"Without noise: {'bounded' if values['stands_without_noise'] else 'overturned'}")
    print(f"Files in {options.out}: fig07.png, fig07.json")
    return 0


if __name__ == "__main__":
    sys.exit(main())
