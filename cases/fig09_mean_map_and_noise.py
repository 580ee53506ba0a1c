"""Fig. 9: the mean Poincaré map as noise grows.

The paper averages 1,200 realizations after each forcing cycle and restarts all of them from the mean (its eq. 21); it
shows 500 mean points for σ = 0, 0.05, 0.06, 0.12, 0.13 and 0.16 and says: the fractal structure is kept at 0.05 and
wears away from 0.06 to 0.12, where mean points stay bounded; from 0.13 on the mean itself overturns. Here

* four panels (a) to (d), one seed each, over the attractor without noise (grey). Overturned realizations lie at the
  cut-off, as in the paper's densities; the mean has overturned once it is there itself, as all realizations are then;
* (e) the part of the attractor without noise that has a mean point within 0.1, over several seeds, and for how many of
  them the mean overturns within 500 cycles. Filled symbols have the paper's σ.

The file of numbers also has correlation dimensions, between lengths of 0.05 and 0.4. Of 500 points they do not tell a
fractal from a curve: without noise it is 1.07 ± 0.02.

Source: H. Lin and S. C. S. Yim, "Nonlinear rocking motions. I: Chaos under noisy periodic excitations", J. Eng. Mech.
122(8), 719-727, 1996, Fig. 9: (A, Ω, e, Ψ) = (4.6, 2.7, 0.5, 3.14).

Run time: about two and a half minutes on 2 cores.

    python cases/fig09_mean_map_and_noise.py --out results/fig09

Files: ``fig09.png``, ``fig09.json``.
"""

import motion
import numpy as np
from command import command
from fig08_mean_poincare import LENGTHS, SETTLED, attractor_of, dimensions_of
from scipy.spatial import KDTree

from fpk_rocking import load_scene
from fpk_rocking.output.tables import reporting
from fpk_rocking.results import pictures, storage
from montecarlo import restarted_poincare_map

PAPER = (0.05, 0.06, 0.12, 0.13, 0.16)
BETWEEN = (0.02, 0.03, 0.04, 0.045, 0.055, 0.07, 0.09, 0.1, 0.11, 0.125, 0.14)
NEAR = 0.1
"""Distance, nondimensional, within which a point of the attractor is covered."""


def run(out, paper=PAPER, between=BETWEEN, seeds=8, realizations=1200, cycles=500) -> dict:
    """Compute, draw and write everything.

    Parameters
    ----------
    out : pathlib.Path
        Folder for the files; created if missing.
    paper, between : sequence of float
        σ of the paper, of which the first four are panels, and further ones; above 0, nondimensional.
    seeds : int
        Seeds of each mean map.
    realizations, cycles : int
        Of each mean map; the paper has 1,200 and 500.

    Returns
    -------
    dict
        What ``fig09.json`` holds.
    """
    scene = load_scene("main").varied(forcing={"phase": 3.14})
    attractor = attractor_of(scene, seeds * cycles)
    sizes, maps = {"realizations": realizations, "cycles": cycles}, {}
    with reporting("mean maps") as progress:
        noisy = sorted({*paper, *between})
        for done, deviation in enumerate(noisy):
            varied = scene.varied(noise={"variance": deviation**2})
            maps[deviation] = [restarted_poincare_map(varied, seed=seed, **sizes) for seed in range(1, seeds + 1)]
            progress(done + 1, len(noisy))
    values = {
        "figure": "Fig. 9 of Lin and Yim, J. Eng. Mech. 122(8), 1996",
        "scene": scene.to_toml(),
        **sizes,
        "seeds": seeds,
        "lengths": list(LENGTHS),
        "near": NEAR,
        "without_noise": _shape(np.split(attractor, seeds), attractor),
        "maps": [_judged(deviation, maps_of_seeds, attractor) for deviation, maps_of_seeds in maps.items()],
        "remarks": [scene.noise.remark],
    }
    _draw(out / "fig09.png", attractor, [maps[deviation][0] for deviation in paper[:4]], paper, values)
    storage.write_json(out / "fig09.json", values)
    return values


def _settled(mean_map):
    """Mean points from the sixth cycle on, until the mean overturns."""
    return mean_map.points[SETTLED + 1 : mean_map.overturned_after]


def _judged(deviation, maps, attractor):
    """Fate and shape of the maps of one σ, as plain values; a map of few points has no shape."""
    settled = [_settled(mean_map) for mean_map in maps]
    many = [points for points in settled if len(points) > 0.2 * len(attractor) / len(maps)]
    return {
        "deviation": deviation,
        "overturned_after": [mean_map.overturned_after for mean_map in maps],
        "largest_angle": [float(np.abs(points[:, 0]).max(initial=0.0)) for points in settled],
        **_shape(many, attractor),
    }


def _shape(samples, attractor):
    """Dimension of sets of points, and the part of the attractor (n, 2) that each covers; none of no sets."""
    if not samples:
        return dict.fromkeys(("dimension", "deviation_of_dimension", "covered", "deviation_of_covered"))
    covered = [float((KDTree(points).query(attractor)[0] < NEAR).mean()) for points in samples]
    spread = float(np.std(covered, ddof=len(covered) > 1))
    return dimensions_of(samples) | {"covered": float(np.mean(covered)), "deviation_of_covered": spread}


def _draw(path, attractor, mean_maps, paper, values):
    """Draw the mean maps of the first four σ of `paper` over the attractor (n, 2), and what they cover over all σ."""
    drawn = f"{values['cycles']} means of {values['realizations']:,} realizations"
    notes = [
        f"{drawn}; noise on [0, 10], which is inferred. Grey: without noise.",
        f"(a) to (d): seed 1; (e): mean of {values['seeds']} seeds, 95 % bars, filled at the paper's σ.",
    ]
    covered = {row["deviation"]: row["covered"] for row in values["maps"]}
    first, second = paper[:2]
    title = (
        f"Paper Fig. 9: mean points cover {100 * covered[first]:.0f} % of the attractor at σ = {first:g}, "
        f"{100 * covered[second]:.0f} % at {second:g}"
    )
    with pictures.page(path, (7.0, 9.4), title, notes) as figure:
        top, bottom = figure.subfigures(2, 1, height_ratios=(1.7, 1.0))
        panels = top.subplots(2, 2, sharex=True, sharey=True).ravel()
        for letter, axes, deviation, mean_map in zip("abcd", panels, paper, mean_maps, strict=False):
            axes.plot(*attractor.T, ".", markersize=1.0, color="#bbbbbb", rasterized=True)
            axes.axvline(np.pi / 2, color=pictures.OVERTURNED, linewidth=0.8, linestyle="--")
            after = mean_map.overturned_after
            fate = f"overturns in cycle {after}" if after else "bounded"
            axes.set_title(f"({letter}) σ = {deviation:g}: {fate}", fontsize=11)
            axes.plot(*_settled(mean_map).T, ".", markersize=3.0, color=pictures.COLOURS[0])
            if after:
                axes.plot(*mean_map.points[-1], "x", color=pictures.OVERTURNED, markersize=9, mew=2)
        panels[0].annotate("cut-off", (np.pi / 2, 0.7), xytext=(-4, 0), textcoords="offset points", rotation=90,
                           color=pictures.OVERTURNED, ha="right", va="bottom")  # fmt: skip
        top.supxlabel(motion.ANGLE, fontsize=11)
        top.supylabel(motion.VELOCITY, fontsize=11)
        _covered_panel(bottom.subplots(), paper, values)


def _covered_panel(axes, paper, values):
    """Draw what mean points cover of the attractor against σ, and for how many seeds the mean overturns."""
    rows = [{"deviation": 0.0, **values["without_noise"]}, *values["maps"]]
    for row in (row for row in rows if row["covered"] is not None):
        face = pictures.COLOURS[0] if row["deviation"] in (0.0, *paper) else "white"
        error = 1.96 * row["deviation_of_covered"] / np.sqrt(values["seeds"])
        axes.errorbar(row["deviation"], row["covered"], error, marker="o", markersize=5, linestyle="none",
                      color=pictures.COLOURS[0], markerfacecolor=face)  # fmt: skip
    for row in values["maps"]:
        fallen = sum(after is not None for after in row["overturned_after"])
        if row["deviation"] in (0.05, 0.09, 0.11, 0.12, 0.13, 0.14, 0.16):
            axes.annotate(f"{fallen}", (row["deviation"], 1.12), ha="center", color=pictures.OVERTURNED)
    axes.annotate(f"overturn, of {values['seeds']}:", (0.044, 1.12), ha="right", color=pictures.OVERTURNED)
    axes.set(ylim=(0.0, 1.25), yticks=(0.0, 0.5, 1.0), xlim=(-0.005, 0.168))
    axes.set_xlabel("standard deviation of the noise σ, nondimensional", fontsize=11)
    axes.set_ylabel("part of the attractor\nwithin 0.1 of a mean point", fontsize=11)
    axes.set_title("(e) What mean points cover, and for how many seeds the mean overturns", fontsize=11)


def report(values):
    """Print dimensions, covered parts and fates."""
    rows = [{"deviation": 0.0, "overturned_after": [], **values["without_noise"]}, *values["maps"]]
    for row in rows:
        dimension = "-" if row["dimension"] is None else f"{row['dimension']:.3f} ± {row['deviation_of_dimension']:.3f}"
        covered = "-" if row["covered"] is None else f"{row['covered']:.3f} ± {row['deviation_of_covered']:.3f}"
        print(f"σ = {row['deviation']:<6g} dimension {dimension}, covered {covered}, {row['overturned_after']}")


if __name__ == "__main__":
    command(run, "results/fig09", "fig09.png", "fig09.json", report=report, seeds="of each mean map")
