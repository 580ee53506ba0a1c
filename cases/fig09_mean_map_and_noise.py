"""Fig. 9: the mean Poincaré map as noise grows.

The paper averages 1,200 realizations after each forcing cycle and restarts all of them from the mean (its eq. 21); it
shows 500 mean points for σ = 0, 0.05, 0.06, 0.12, 0.13 and 0.16 and says: the fractal structure is kept at 0.05 and
wears away from 0.06 to 0.12, where mean points stay bounded; from 0.13 on the mean itself overturns. Here

* the six panels (a) to (f), one seed each, over the attractor without noise (grey). Overturned realizations lie at the
  cut-off, as in the paper's densities; the mean has overturned once it is there itself, as all realizations are then;
* (g) the correlation dimension of the mean points against σ, over several seeds: 1 on a curve, more on this attractor.
  It is taken between lengths of 0.05 and 0.4, above the sampling error of a mean and below the size of the attractor;
* (h) the number of cycles after which the mean overturns, for the same seeds, and above them for how many it does
  within 500; a triangle there stands for seeds with which it does not. Filled symbols have the paper's σ.

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

from fpk_rocking import load_scene
from fpk_rocking.base import files
from fpk_rocking.output.tables import reporting
from fpk_rocking.results import pictures
from montecarlo import restarted_poincare_map

PAPER = (0.0, 0.05, 0.06, 0.12, 0.13, 0.16)
BETWEEN = (0.02, 0.03, 0.04, 0.045, 0.055, 0.07, 0.08, 0.09, 0.1, 0.11, 0.115, 0.125, 0.14)
_DEVIATION = "standard deviation of the noise σ, nondimensional"


def run(out, paper=PAPER, between=BETWEEN, seeds=8, realizations=1200, cycles=500) -> dict:
    """Compute, draw and write everything.

    Parameters
    ----------
    out : pathlib.Path
        Folder for the files; created if missing.
    paper, between : sequence of float
        σ of the panels (six, the first 0), and further ones for the curves; nondimensional.
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
        noisy = sorted({*paper[1:], *between})
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
        "without_noise": dimensions_of(np.split(attractor, seeds)),
        "maps": [_judged(deviation, maps_of_seeds, cycles) for deviation, maps_of_seeds in maps.items()],
        "remarks": [scene.noise.remark],
    }
    _draw(out / "fig09.png", attractor, [maps[deviation][0] for deviation in paper[1:]], paper, values)
    files.write_json(out / "fig09.json", values)
    return values


def _settled(mean_map):
    """Mean points from the sixth cycle on, until the mean overturns."""
    return mean_map.points[SETTLED + 1 : mean_map.overturned_after]


def _judged(deviation, maps, cycles):
    """Fate and dimension of the maps of one σ, as plain values; a map of few points has no dimension."""
    settled = [_settled(mean_map) for mean_map in maps]
    many = [points for points in settled if len(points) > 0.2 * cycles]
    return {
        "deviation": deviation,
        "overturned_after": [mean_map.overturned_after for mean_map in maps],
        "largest_angle": [float(np.abs(points[:, 0]).max(initial=0.0)) for points in settled],
        **(dimensions_of(many) if many else {"dimension": None, "deviation_of_dimension": None}),
    }


def _draw(path, attractor, mean_maps, paper, values):
    """Draw the mean maps of the σ of `paper` over the attractor (n, 2), and the curves over all σ."""
    size = f"Means of {values['realizations']:,} realizations, {values['cycles']} cycles"
    note = (
        f"{size}, noise on [0, 10], which is inferred. Grey: without noise. Cross: overturned, at the cut-off. "
        f"(a) to (f): seed 1; (g), (h): {values['seeds']} seeds, filled at the σ of (a) to (f); triangles: the "
        "mean does not overturn."
    )
    fractal = max((row["deviation"] for row in values["maps"] if (row["dimension"] or 0.0) > 1.0), default=0.0)
    falls = min((row["deviation"] for row in values["maps"] if any(row["overturned_after"])), default=np.inf)
    title = f"Paper Fig. 9: the mean map is fractal up to σ = {fractal:g}; from σ = {falls:g} on the mean can overturn"
    with pictures.page(path, (10.5, 11.4), title, [note]) as figure:
        top, bottom = figure.subfigures(2, 1, height_ratios=(1.5, 1.0))
        panels = top.subplots(2, 3, sharex=True, sharey=True).ravel()
        for letter, axes, deviation, mean_map in zip("abcdef", panels, paper, [None, *mean_maps], strict=True):
            axes.plot(*attractor.T, ".", markersize=1.0, color="#bbbbbb", rasterized=True)
            axes.axvline(np.pi / 2, color=pictures.OVERTURNED, linewidth=0.8, linestyle="--")
            axes.set_title(_panel(letter, deviation, mean_map), fontsize=10)
            points = _settled(mean_map) if mean_map else attractor[: values["cycles"]]
            axes.plot(*points.T, ".", markersize=2.0, color=pictures.COLOURS[0])
            if mean_map and mean_map.overturned_after:
                axes.plot(*mean_map.points[-1], "x", color=pictures.OVERTURNED, markersize=9, mew=2)
        panels[0].annotate("cut-off", (np.pi / 2, -1.1), xytext=(-4, 0), textcoords="offset points", rotation=90,
                           color=pictures.OVERTURNED, ha="right", va="bottom")  # fmt: skip
        top.supxlabel(motion.ANGLE, fontsize=10)
        top.supylabel(motion.VELOCITY, fontsize=10)
        dimension, ended = bottom.subplots(1, 2)
        _dimension_panel(dimension, paper, values)
        _ended_panel(ended, paper, values)


def _panel(letter, deviation, mean_map):
    """Title of a panel: which noise, and what becomes of the mean."""
    if mean_map is None:
        return f"({letter}) σ = 0"
    after = mean_map.overturned_after
    return f"({letter}) σ = {deviation:g}: {f'the mean overturns in cycle {after}' if after else 'bounded'}"


def _dimension_panel(axes, paper, values):
    """Draw the correlation dimension against σ."""
    some = [row for row in values["maps"] if row["dimension"] is not None]
    columns = ([row[name] for row in some] for name in ("deviation", "dimension", "deviation_of_dimension"))
    x, y, error = map(np.array, columns)
    shape = {"marker": "o", "markersize": 4, "linestyle": "none", "color": pictures.COLOURS[0]}
    for chosen, face in _by_paper(x, paper):
        axes.errorbar(x[chosen], y[chosen], error[chosen], markerfacecolor=face, **shape)
    still = values["without_noise"]
    axes.errorbar(0.0, still["dimension"], still["deviation_of_dimension"], **(shape | {"color": "black"}))
    axes.axhline(1.0, color="black", linewidth=0.8, linestyle="--")
    axes.annotate("a curve", (0.0, 1.0), xytext=(2, -12), textcoords="offset points")
    axes.set(
        title="(g) Correlation dimension of the mean points;\nbars: standard deviation over seeds", xlabel=_DEVIATION
    )
    axes.set_ylabel("correlation dimension")


def _ended_panel(axes, paper, values):
    """Draw the cycles until the mean overturns against σ."""
    last = values["cycles"]
    pairs = [(row["deviation"], after) for row in values["maps"] for after in row["overturned_after"]]
    ended = np.array([pair for pair in pairs if pair[1]]).reshape(-1, 2)
    standing = np.array(sorted({deviation for deviation, after in pairs if not after}))
    look = {"color": pictures.COLOURS[0], "linestyle": "none"}
    for chosen, face in _by_paper(ended[:, 0], paper):
        axes.plot(*ended[chosen].T, "o", markersize=4, markerfacecolor=face, **look)
    for chosen, face in _by_paper(standing, paper):
        axes.plot(standing[chosen], np.full(chosen.sum(), last), "^", markersize=5, markerfacecolor=face, **look)
    for row in values["maps"]:
        fallen = sum(after is not None for after in row["overturned_after"])
        if row["deviation"] in (0.05, 0.06, *[d for d in paper if d > 0.1], 0.125, 0.115):
            axes.annotate(f"{fallen}", (row["deviation"], 2.2 * last), ha="center", fontsize=9)
    axes.annotate(f"of {values['seeds']} seeds:", (0.045, 2.2 * last), ha="right", fontsize=9)
    axes.set(yscale="log", ylim=(5, 3.5 * last), xlim=(-0.005, 0.168), xlabel=_DEVIATION)
    axes.set(ylabel="forcing cycles until the mean overturns")
    axes.set_title("(h) Overturning of the mean, and\nhow many seeds overturn")


def _by_paper(deviations, paper):
    """Return which values of σ the paper shows, for filled symbols, and which it does not, for open ones."""
    in_paper = np.isin(deviations, paper)
    return (in_paper, pictures.COLOURS[0]), (~in_paper, "white")


def report(values):
    """Print dimensions and fates."""
    rows = [{"deviation": 0.0, "overturned_after": [], **values["without_noise"]}, *values["maps"]]
    for row in rows:
        dimension = "-" if row["dimension"] is None else f"{row['dimension']:.3f} ± {row['deviation_of_dimension']:.3f}"
        print(f"σ = {row['deviation']:<6g} dimension {dimension}, overturned after {row['overturned_after']}")


if __name__ == "__main__":
    command(run, "results/fig09", "fig09.png", "fig09.json", report=report, seeds="of each mean map")
