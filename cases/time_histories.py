"""Time histories, impacts and mean maps.

Shown are a few time histories of the angle with every impact (as in Figs. 5 and 8 of the paper), the Poincaré points of
an ensemble after its last cycle, the mean Poincaré map (paper 21) in both readings, the density of the time of
overturning, and that of the speed before an impact, each with its sampling noise.

The mean map has two readings: the mean of an ensemble that runs on freely, or the mean of the images after one cycle,
from which all realizations start again ("restarted"). Overturned realizations lie at the cut-off ("clamped") or are
left out. Drawn are the free ensemble without those that have overturned and the restarted one with them; the numbers
have all four. The restarted map carries the error of each mean on into the next cycle, which its intervals do not
contain: it is repeated with another seed, and the largest distance between the two is printed.

Source: H. Lin and S. C. S. Yim, "Nonlinear rocking motions. I: Chaos under noisy periodic excitations", J. Eng. Mech.
122(8), 719-727, 1996. It does not state its noise band; [0, 10] is inferred (band_inferred.py).

Run time: about ten seconds on 2 cores, once the kernels are compiled.

    python cases/time_histories.py --out results/histories
    python cases/time_histories.py --scene cases/scenes/second.toml --out results/second

Files: ``histories.png``, ``histories.json``, ``histories.npz`` (read it with ``montecarlo.Histories.load``).
"""

import motion
import numpy as np
from command import command

from fpk_rocking import load_scene
from fpk_rocking.output.tables import reporting
from fpk_rocking.results import storage
from fpk_rocking.results.storage import plain
from montecarlo import (
    first_passage,
    histories,
    impact_speeds,
    mean_poincare_map,
    restarted_poincare_map,
    simulate,
)

SHOWN = 3
RULES = ("clamped", "left out")
DRAWN = {"ensemble, left out": "blocks that stand", "restarted, clamped": "restarted from the mean each cycle"}


def run(out, scene="main", cycles=20, realizations=20_000, seed=1) -> dict:
    """Compute, draw and write everything.

    Parameters
    ----------
    out : pathlib.Path
        Folder for the files; created if missing.
    scene : str
        Scene file, or name of a scene of the package.
    cycles, realizations, seed : int
        Of the ensemble and of each mean map; a fiftieth of the realizations, at least 200, tells the impact speeds.

    Returns
    -------
    dict
        What ``histories.json`` holds.
    """
    scene = load_scene(scene)
    few = histories(scene, cycles=cycles, realizations=SHOWN, seed=seed)
    few.save(out / "histories.npz")
    with reporting("ensemble") as progress:
        ensemble = simulate(scene, cycles=cycles, realizations=realizations, seed=seed, progress=progress)
    sampled = {"cycles": cycles, "realizations": realizations}
    restarted, other = {}, {}
    for rule in RULES:
        with reporting(f"restarted map, {rule}") as progress:
            restarted[rule] = restarted_poincare_map(scene, seed=seed, overturned=rule, progress=progress, **sampled)
            other[rule] = restarted_poincare_map(scene, seed=seed + 1, overturned=rule, **sampled)
    maps = {f"ensemble, {rule}": mean_poincare_map(ensemble, rule) for rule in RULES}
    maps |= {f"restarted, {rule}": restarted[rule] for rule in RULES}

    many = max(200, realizations // 50)
    hits = histories(scene, cycles=cycles, realizations=many, seed=seed, samples_per_cycle=1)
    fastest = np.abs(hits.impact_velocity).max()
    speeds = impact_speeds(hits, np.linspace(0.0, np.ceil(10.0 * fastest) / 10.0, 31))
    passage = first_passage(ensemble, scene.period * np.arange(cycles + 1))

    share, most = 100.0 * (1.0 - ensemble.survival[-1]), 1 + int(np.argmax(passage.density))
    title = f"{share:.0f} % of the blocks overturn within {cycles} cycles, most often in cycle {most}"
    drawn = {label: maps[name] for name, label in DRAWN.items()}
    motion.motion_figure(out / "histories.png", few, ensemble, drawn, passage, speeds, title)
    values = {
        "scene": scene.to_toml(),
        "ensemble": ensemble.summary(),
        "impacts_per_realization": float(hits.impacts.mean()),
        "maps": {name: plain(mean_map._asdict()) for name, mean_map in maps.items()},
        "restarts_differ_by": {rule: _distance(restarted[rule], other[rule]) for rule in RULES},
        "first_passage": plain(passage._asdict()),
        "impact_speeds": plain(speeds._asdict()),
    }
    storage.write_json(out / "histories.json", values)
    return values


def _distance(first, second) -> list:
    """Distance of two maps after each cycle; None where one of them has ended."""
    return plain(np.hypot(*(first.points - second.points).T))


def report(values):
    """Print how far maps of two seeds differ."""
    for rule, distances in values["restarts_differ_by"].items():
        worst = max((distance for distance in distances if distance is not None), default=0.0)
        print(f"Two seeds of the restarted map ({rule}) differ by up to {worst:.2g}")


if __name__ == "__main__":
    command(
        run,
        "results/histories",
        "histories.png",
        "histories.json",
        "histories.npz",
        report=report,
        scene="scene file, or name of a scene of the package",
        cycles="forcing cycles",
        realizations="of the ensemble",
        seed="of all",
    )
