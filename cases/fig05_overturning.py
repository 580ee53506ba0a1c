"""Fig. 5: a periodic motion overturned by noise.

The paper has A = 4.2 and Ψ = 3.14: (a) without noise a periodic motion of two forcing cycles; (b) with σ² = 0.05² one
realization that is chaotic for a while and overturns after 125 cycles, through the upper right corner of the phase
plane. Shown are time histories of the angle, the Poincaré points of both, and how many realizations
stand for how long under three noise bands. The realization shown is the first of its ensemble that overturns to the
right within five cycles of the 125. The paper does not state the band: how late blocks overturn depends on it.

Source: H. Lin and S. C. S. Yim, "Nonlinear rocking motions. I: Chaos under noisy periodic excitations", J. Eng. Mech.
122(8), 719-727, 1996, Fig. 5: (A, Ω, e, Ψ) = (4.2, 2.7, 0.5, 3.14).

Run time: about ten seconds on 2 cores, once the kernels are compiled.

    python cases/fig05_overturning.py --out results/fig05

Files: ``fig05.png``, ``fig05.json``.
"""

import motion
import numpy as np
from command import command

from fpk_rocking import NoNoise, load_scene
from fpk_rocking.results import pictures, storage
from fpk_rocking.results.sampling import wilson_interval
from montecarlo import histories, simulate

BANDS = (5.0, 10.0, 20.0)
OURS = 10.0
LATE = 125
NEAR = 5
SETTLED = 100


def run(out, realizations=20_000, cycles=400, bounded_cycles=2000, seed=1) -> dict:
    """Compute, draw and write everything.

    Parameters
    ----------
    out : pathlib.Path
        Folder for the files; created if missing.
    realizations, cycles, seed : int
        Of each ensemble; at least 130 cycles.
    bounded_cycles : int
        Cycles over which the motion without noise is followed.

    Returns
    -------
    dict
        What ``fig05.json`` holds.
    """
    scene = load_scene("fig05")
    sampled = {"cycles": cycles, "realizations": realizations, "seed": seed}
    ensembles = {band: simulate(scene.varied(noise={"band": (0.0, band)}), **sampled) for band in BANDS}
    chosen = _late(ensembles[OURS])
    paths = histories(scene, cycles=LATE + 2 * NEAR, realizations=chosen + 1, seed=seed, samples_per_cycle=50)
    still = scene.varied(noise=NoNoise())
    quiet = histories(still, cycles=LATE + 2 * NEAR, samples_per_cycle=50)
    long = simulate(still, cycles=bounded_cycles, realizations=1)
    values = {
        "figure": "Fig. 5 of Lin and Yim, J. Eng. Mech. 122(8), 1996",
        "scene": scene.to_toml(),
        "realizations": realizations,
        "periodic_points": np.stack([long.angle[0, -2:], long.velocity[0, -2:]], axis=1).tolist(),
        "bounded_without_noise": bool(long.survivors[-1]),
        "bounded_cycles": bounded_cycles,
        "realization": chosen,
        "overturned_after_cycles": float(paths.overturn_time[chosen] / scene.period),
        "late": [_lateness(ensemble, band) for band, ensemble in ensembles.items()],
        "remarks": [scene.noise.remark],
    }
    _draw(out / "fig05.png", quiet, paths, chosen, ensembles, values)
    storage.write_json(out / "fig05.json", values)
    return values


def _late(ensemble):
    """Return the number of the first realization that overturns to the right about as late as the paper's."""
    cycles = ensemble.overturn_time / ensemble.scene.period
    late = np.flatnonzero((np.abs(cycles - LATE) <= NEAR) & (ensemble.overturn_side > 0))
    if late.size == 0:
        accepted = f"enough for one to overturn to the right after {LATE} cycles, give or take {NEAR}"
        raise ValueError(f"realizations: got {ensemble.realizations}, accepted: {accepted}")
    return int(late[0])


def _lateness(ensemble, highest):
    """Survival and the cycles of overturning of an ensemble, as plain values."""
    overturned = ensemble.overturn_side != 0
    cycles = np.where(overturned, ensemble.overturn_time / ensemble.scene.period, np.inf)
    beyond = int(np.count_nonzero(cycles > LATE))
    shares = (0.025, 0.25, 0.5, 0.75, 0.975)
    quantiles = np.quantile(cycles, shares, method="inverted_cdf")
    every = 25
    return {
        "band": [0.0, highest],
        "standing_after_125": beyond / cycles.size,
        "interval": wilson_interval(beyond, cycles.size).tolist(),
        "to_the_right": float(np.mean(ensemble.overturn_side[overturned] > 0)),
        "quantiles_of_cycles": storage.plain(dict(zip(map(str, shares), quantiles, strict=True))),
        "survival_every_25_cycles": ensemble.survival[::every].tolist(),
    }


def _draw(path, quiet, paths, chosen, ensembles, values):
    """Draw histories without noise and with it (`paths`, of which one is chosen by number), and survival by band."""
    noise, after = paths.scene.noise, values["overturned_after_cycles"]
    note = (
        f"(b) is chosen, because it overturns after {after:.0f} cycles as the paper's does. (d): "
        f"{values['realizations']:,} realizations a band, σ² = {noise.variance:g}; the paper states no band."
    )
    gone = 1.0 - next(late["standing_after_125"] for late in values["late"] if late["band"] == list(noise.band))
    title = f"Paper Fig. 5: periodic without noise; with it {100.0 * gone:.1f} % overturn within {LATE} cycles"
    with pictures.page(path, (10.5, 9.2), title, [note]) as figure:
        rows = [["periodic", "periodic"], ["noisy", "noisy"], ["points", "standing"]]
        panels = figure.subplot_mosaic(rows, height_ratios=(0.5, 0.5, 1.0))
        band = f"[{noise.band[0]:g}, {noise.band[1]:g}]"
        titles = ("(a) No noise", f"(b) σ² = {noise.variance:g} on {band}, realization {chosen}")
        drawn = (("periodic", quiet, 0), ("noisy", paths, chosen))
        for (name, history, r), text in zip(drawn, titles, strict=True):
            motion.history_panel(panels[name], history, r, impacts=False)
            panels[name].set_title(text, loc="left")
            panels[name].set_ylabel(motion.ANGLE)
        panels["noisy"].set_title("dashed: the cut-off; cross: the overturning", loc="right", color="#333333")
        panels["noisy"].set_xlabel(f"{motion.TIME} (a forcing cycle is {paths.scene.period:.3f})")
        _points(panels["points"], quiet, paths, chosen)
        _standing(panels["standing"], ensembles)


def _points(axes, periodic, paths, chosen):
    """Draw the Poincaré points of the periodic history and of the chosen path."""
    cutoff = paths.scene.overturning.angle
    angle, velocity = (states[chosen] for states in paths.poincare())
    axes.plot(
        angle, velocity, "o", markersize=3.5, markerfacecolor="white", color=pictures.COLOURS[1], label="(b) noise"
    )
    angle, velocity = (states[0, SETTLED:] for states in periodic.poincare())
    axes.plot(angle, velocity, "D", markersize=6, color=pictures.COLOURS[0], label="(a) no noise: two points")
    last = np.flatnonzero(np.isfinite(paths.angle[chosen]))
    end = slice(int(last[-1]) - 20, None)
    axes.plot(paths.angle[chosen, end], paths.velocity[chosen, end], color=pictures.OVERTURNED, linewidth=1.0,
              label="(b) its last motion")  # fmt: skip
    axes.axvline(cutoff, color=pictures.OVERTURNED, linewidth=0.8, linestyle="--")
    axes.set(title="(c) Poincaré points of (a) and (b)", xlabel=motion.ANGLE, ylabel=motion.VELOCITY)
    axes.legend(fontsize=9, markerscale=1.2, loc="upper left")


def _standing(axes, ensembles):
    """Draw survival of ensembles, by the end of their band."""
    for (band, ensemble), colour in zip(ensembles.items(), pictures.shades(len(BANDS)), strict=True):
        axes.plot(ensemble.survival, color=colour)
        places = np.arange(0, ensemble.cycles + 1, 50)
        limits = ensemble.survival_interval()[places]
        pictures.error_bars(axes, places, ensemble.survival[places], limits, color=colour, markersize=3.0)
        pictures.named(axes, f"[0, {band:g}]", (ensemble.cycles, ensemble.survival[-1]), colour)
    axes.axvline(LATE, color="black", linewidth=0.8)
    axes.annotate(f"{LATE} cycles", (LATE, 0.02), xytext=(4, 0), textcoords="offset points", va="bottom")
    axes.set(ylim=(0.0, 1.05), xlim=(0.0, 1.13 * ensemble.cycles))
    axes.set(title="(d) Survival by noise band, 95 % intervals", xlabel="forcing cycles", ylabel="P(not overturned)")


def report(values):
    """Print how late realizations overturn."""
    for late in values["late"]:
        low, high = late["interval"]
        chance = f"P(standing after {LATE} cycles) {late['standing_after_125']:.4f} ({low:.4f} to {high:.4f})"
        quantiles = ", ".join(
            "-" if cycle is None else f"{cycle:.1f}" for cycle in late["quantiles_of_cycles"].values()
        )
        right = f"{100 * late['to_the_right']:.0f} % to the right"
        print(f"band {late['band']}: {chance}, {right}, 2.5, 25, 50, 75, 97.5 % overturned after {quantiles} cycles")
    print(f"Shown: realization {values['realization']}, {values['overturned_after_cycles']:.1f} cycles")


if __name__ == "__main__":
    command(
        run,
        "results/fig05",
        "fig05.png",
        "fig05.json",
        report=report,
        realizations="of an ensemble",
        seed="of the ensembles",
    )
