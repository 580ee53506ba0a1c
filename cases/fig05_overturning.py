"""A periodic and a chaotic rocking motion, and noise that overturns a block late: cf. Fig. 5 of Lin and Yim (1996).

Shown are time histories of the angle with every impact,

* A = 4.2 without noise: after some cycles a periodic motion of two forcing cycles,
* the same block under noise: a realization that overturns after about 125 cycles, the number that the paper tells of,
* A = 4.6 without noise: a chaotic motion that stays bounded,

their Poincaré points, and how many realizations stand for how long under three noise bands. The realization shown is
the first of its ensemble that overturns within five cycles of the 125; how rare that is depends on the band, which the
paper does not state ([0, 10] is inferred by this project). That the 125 cycles belong to A = 4.2 and σ² = 0.04 is
inferred too: both amplitudes are therefore given.

Source: H. Lin and S. C. S. Yim, "Nonlinear rocking motions. I: Chaos under noisy periodic excitations", J. Eng. Mech.
122(8), 719-727, 1996, Fig. 5.

Run time: about five seconds on 2 cores, once the kernels are compiled.

    python cases/fig05_overturning.py --out results/fig05

Files: ``fig05.png``, ``fig05.json``.
"""

import argparse
import pathlib
import sys

import numpy as np

from fpk_rocking import NoNoise, load_scene
from fpk_rocking.output import motion, style, summary
from fpk_rocking.output.intervals import error_bars
from montecarlo import histories, simulate
from montecarlo.statistics import wilson_interval

SCENE = pathlib.Path(__file__).parent / "scenes" / "fig05.toml"
AMPLITUDES = (4.2, 4.6)
BANDS = (5.0, 10.0, 20.0)
LATE = 125
NEAR = 5
SETTLED = 100
_NOTE = "The noise bands are inferred by this project; the paper states none."


def run(out, realizations=10_000, cycles=200, bounded_cycles=2000, seed=1) -> dict:
    """Compute, draw and write everything.

    Parameters
    ----------
    out : path
        Folder for the files; created if missing.
    realizations, cycles, seed : int
        Of each ensemble; at least 130 cycles.
    bounded_cycles : int
        Cycles over which the motions without noise are followed.

    Returns
    -------
    dict
        What ``fig05.json`` holds.
    """
    out, scene = pathlib.Path(out), load_scene(SCENE)
    ensembles = {(a, b): _ensemble(scene, a, b, cycles, realizations, seed) for a in AMPLITUDES for b in BANDS}
    chosen = _late(ensembles[AMPLITUDES[0], 10.0])
    shown = histories(scene, cycles=LATE + 2 * NEAR, realizations=chosen + 1, seed=seed, samples_per_cycle=50)
    still = [scene.varied(forcing={"amplitude": amplitude}, noise=NoNoise()) for amplitude in AMPLITUDES]
    quiet = [histories(one, cycles=LATE + 2 * NEAR, samples_per_cycle=50) for one in still]
    long = [simulate(one, cycles=bounded_cycles, realizations=1) for one in still]
    values = {
        "figure": "Fig. 5 of Lin and Yim, J. Eng. Mech. 122(8), 1996",
        "scene": scene.to_toml(),
        "periodic_points": np.stack([long[0].angle[0, -2:], long[0].velocity[0, -2:]], axis=1).tolist(),
        "amplitudes": list(AMPLITUDES),
        "bounded_without_noise": [bool(one.survivors[-1]) for one in long],
        "bounded_cycles": bounded_cycles,
        "largest_angle": float(np.nanmax(np.abs(quiet[1].angle))),
        "realization": chosen,
        "overturned_after_cycles": float(shown.overturn_time[chosen] / scene.period),
        "late": [_lateness(ensemble, amplitude, band) for (amplitude, band), ensemble in ensembles.items()],
        "remarks": [_NOTE],
    }
    _draw(out / "fig05.png", quiet, shown, chosen, long[1], ensembles)
    summary.write_summary(out / "fig05.json", values)
    return values


def _ensemble(scene, amplitude, highest, cycles, realizations, seed):
    varied = scene.varied(forcing={"amplitude": amplitude}, noise={"band": (0.0, highest)})
    return simulate(varied, cycles=cycles, realizations=realizations, seed=seed)


def _late(ensemble):
    """Return the number of the first realization that overturns about as late as the paper's."""
    cycles = ensemble.overturn_time / ensemble.scene.period
    late = np.flatnonzero(np.abs(cycles - LATE) <= NEAR)
    if late.size == 0:
        accepted = f"enough for one to overturn after {LATE} cycles, give or take {NEAR}"
        raise ValueError(f"realizations: got {ensemble.realizations}, accepted: {accepted}")
    return int(late[0])


def _lateness(ensemble, amplitude, highest):
    """Survival and the cycles of overturning of an ensemble, as plain values."""
    cycles = np.where(ensemble.overturn_side != 0, ensemble.overturn_time / ensemble.scene.period, np.inf)
    beyond = int(np.count_nonzero(cycles > LATE))
    quartiles = np.quantile(cycles, (0.25, 0.5, 0.75), method="inverted_cdf")
    return {
        "amplitude": amplitude,
        "band": [0.0, highest],
        "standing_after_125": beyond / cycles.size,
        "interval": wilson_interval(beyond, cycles.size).tolist(),
        "quartiles_of_cycles": [float(one) if np.isfinite(one) else None for one in quartiles],
        "survival": ensemble.survival.tolist(),
    }


def _draw(path, quiet, shown, chosen, chaotic, ensembles):
    sizes = {ensemble.realizations for ensemble in ensembles.values()}
    notes = [f"Survival of {max(sizes):,} realizations each, σ² = 0.04. {_NOTE}"]
    with style.page(path, (10.5, 11.0), "Periodic, overturned by noise, chaotic (cf. paper Fig. 5)", notes) as figure:
        rows = [["periodic", "periodic"], ["noisy", "noisy"], ["chaotic", "chaotic"], ["points", "standing"]]
        panels = figure.subplot_mosaic(rows, height_ratios=(0.55, 0.55, 0.55, 1.0))
        noise = shown.scene.noise
        titles = ("A = 4.2, no noise", f"A = 4.2, σ² = {noise.variance:g} on [0, 10], realization {chosen}")
        titles = (*titles, "A = 4.6, no noise")
        drawn = (("periodic", quiet[0], 0), ("noisy", shown, chosen), ("chaotic", quiet[1], 0))
        for (name, history, r), title in zip(drawn, titles, strict=True):
            motion.history_panel(panels[name], history, r)
            panels[name].set_title(title, loc="left")
            panels[name].set_ylabel("angle / critical angle")
        panels["periodic"].set_title("a dot is an impact, a cross the overturning", loc="right", color="#333333")
        panels["chaotic"].set_xlabel(motion.TIME)
        _points(panels["points"], quiet[0], shown, chosen, chaotic)
        _standing(panels["standing"], ensembles)


def _points(axes, periodic, shown, chosen, chaotic):
    axes.plot(chaotic.angle[0, 10:], chaotic.velocity[0, 10:], ".", markersize=1.5, color="#999999", label="A = 4.6")
    angle, velocity = (states[chosen] for states in shown.poincare())
    label = "A = 4.2 with noise"
    axes.plot(angle, velocity, "o", markersize=3.5, markerfacecolor="white", color=style.COLOURS[1], label=label)
    angle, velocity = (states[0, SETTLED:] for states in periodic.poincare())
    axes.plot(angle, velocity, "D", markersize=6, color=style.COLOURS[0], label="A = 4.2, two points")
    axes.set(title="Poincaré points", xlabel=motion.ANGLE, ylabel=motion.VELOCITY)
    axes.legend(fontsize=9, markerscale=1.2)


def _standing(axes, ensembles):
    colours = dict(zip(BANDS, style.shades(len(BANDS)), strict=True))
    for (amplitude, band), ensemble in ensembles.items():
        line = "-" if amplitude == AMPLITUDES[0] else "--"
        standing = np.where(ensemble.survivors > 0, ensemble.survival, np.nan)
        axes.plot(standing, line, color=colours[band], label=f"A = {amplitude:g}, band [0, {band:g}]")
        places = np.arange(0, ensemble.cycles + 1, 25)
        places = places[ensemble.survivors[places] > 0]
        limits = ensemble.survival_interval()[places]
        error_bars(axes, places, ensemble.survival[places], limits, color=colours[band], markersize=3.0)
    axes.axvline(LATE, color="black", linewidth=0.8)
    axes.annotate(f"{LATE} cycles", (LATE, 1.0), xytext=(4, 0), textcoords="offset points", va="bottom")
    axes.set(yscale="log", ylim=(0.5 / ensemble.realizations, 1.6), xlim=(0.0, ensemble.cycles))
    axes.set(title="Not yet overturned, 95 % intervals", xlabel="forcing cycles", ylabel="P(not overturned)")
    axes.legend(fontsize=9, ncols=2, loc="upper center", bbox_to_anchor=(0.5, -0.16))


def main() -> int:
    """Read the command line, run, print how late realizations overturn."""
    parser = argparse.ArgumentParser(description="Fig. 5 of Lin and Yim (1996).")
    parser.add_argument("--out", type=pathlib.Path, default="results/fig05", help="folder (default: %(default)s)")
    parser.add_argument("--realizations", type=int, default=10_000, help="of an ensemble (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="of the ensembles (default: %(default)s)")
    options = parser.parse_args()
    values = run(options.out, options.realizations, seed=options.seed)
    for late in values["late"]:
        low, high = late["interval"]
        chance = f"P(standing after {LATE} cycles) {late['standing_after_125']:.4f} ({low:.4f} to {high:.4f})"
        quartiles = ", ".join("never" if one is None else f"{one:.1f}" for one in late["quartiles_of_cycles"])
        print(f"A = {late['amplitude']:g}, band {late['band']}: {chance}, quartiles {quartiles} cycles")
    print(f"Shown: realization {values['realization']}, {values['overturned_after_cycles']:.1f} cycles")
    print(f"Files in {options.out}: fig05.png, fig05.json")
    return 0


if __name__ == "__main__":
    sys.exit(main())
