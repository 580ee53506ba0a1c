"""When blocks overturn: first-passage times.

Shown are

* (a) at which moment of the first cycles blocks pass the cut-off, and on which side: counts in twentieths of a cycle,
* (b) the probability of overturning per cycle, for three variances of the noise: counts of the same realizations with
  Wilson's intervals, and beside them the differences of the density's overturned probability,
* (c), (d) counts less the density, for the white noise that it assumes and for band noise. The first tells whether the
  density solver is right; band noise adds what its replacement by white noise costs.

The paper does not state the noise band; [0, 10] is inferred from its figures (band_inferred.py).

Source: the scene is that of Fig. 6 of H. Lin and S. C. S. Yim, "Nonlinear rocking motions. I: Chaos under noisy
periodic excitations", J. Eng. Mech. 122(8), 719-727, 1996.

Run time: about half a minute on 2 cores, once the kernels are compiled.

    python cases/first_passage.py --out results/passage

Files: ``passage.png``, ``passage.json``.
"""

import motion
import numpy as np
from command import command

from fpk_rocking import Scene, load_scene, solve_fpk
from fpk_rocking.output.tables import reporting
from fpk_rocking.results import pictures, storage
from fpk_rocking.results.sampling import wilson_interval
from montecarlo import tally

VARIANCES = (0.01, 0.02, 0.04)
EARLY = 6
PARTS = 20
_REPLACEMENT = (
    "The density solver has white noise of equal Melnikov variance, D = {:.3f} σ²: an approximation that paths judge."
)


def run(out, variances=VARIANCES, cycles=30, realizations=100_000, tol=2e-3, seed=1) -> dict:
    """Compute, draw and write everything.

    Parameters
    ----------
    out : pathlib.Path
        Folder for the files; created if missing.
    variances : sequence of float
        σ², nondimensional; the last one is shown in twentieths of a cycle.
    cycles : int
        At least 6.
    realizations, seed : int
        Of each ensemble.
    tol : float
        Error of survival that the density solver aims at.

    Returns
    -------
    dict
        What ``passage.json`` holds.
    """
    scene = load_scene("main")
    sampled = {"cycles": cycles, "realizations": realizations, "seed": seed}
    rows = []
    for variance in variances:
        noisy = scene.varied(noise={"variance": variance})
        with reporting(f"density, σ² = {variance:g}") as progress:
            density = solve_fpk(noisy, cycles=cycles, tol=tol, noise_replacement="white", progress=progress)
        band, white = _counted(noisy, sampled), _counted(noisy.white_equivalent(), sampled)
        rows.append({"variance": variance} | _row(density, band, white))
    values = {
        "scene": scene.to_toml(),
        "realizations": realizations,
        "cycles": cycles,
        "noise": rows,
        "early": band.first_passage[1 : EARLY * PARTS + 1].tolist(),
        "remarks": [
            scene.noise.remark,
            _REPLACEMENT.format(scene.white_equivalent().noise.diffusion / scene.noise.variance),
        ],
    }
    draw(out / "passage.png", values)
    storage.write_json(out / "passage.json", values)
    return values


def _counted(scene, sampled):
    """Tally of a scene with one large bin, as only first passages are used; `sampled`: cycles, realizations, seed."""
    return tally(scene, angle_edges=[-2.0, 2.0], velocity_edges=[-20.0, 20.0], **sampled)


def _row(density, band, white):
    """Probability of overturning in each cycle by the density and by tallies of band and white noise, as plain values.

    z is the difference of a tally from the density in standard errors of the tally, in cycles with 10 or more paths.
    """
    expected = np.diff(density.overturned.sum(axis=1))
    row = {"density": expected.tolist(), "error_estimate": float(density.error_estimate)}
    for name, sample in (("band", band), ("white", white)):
        counts = -np.diff(sample.survivors)
        row[name] = (counts / sample.realizations).tolist()
        row[f"{name}_interval"] = wilson_interval(counts, sample.realizations).tolist()
        enough = expected * sample.realizations >= 10.0
        share, errors = expected[enough], np.sqrt(expected[enough] * (1.0 - expected[enough]) / sample.realizations)
        z = (counts[enough] / sample.realizations - share) / errors
        row[f"{name}_z"] = dict(zip(map(str, 1 + np.flatnonzero(enough)), z.tolist(), strict=True))
    return row


def draw(path, values):
    """Draw what the JSON file holds."""
    note = (
        f"{values['realizations']:,} realizations of each noise, 95 % intervals. T: forcing period. The density has "
        "white noise of equal Melnikov variance; the band [0, 10] is inferred."
    )
    last = values["noise"][-1]
    peak = int(np.argmax(last["band"]))
    cost = max(float(np.abs(np.subtract(row["band"], row["density"])).max()) for row in values["noise"])
    title = (
        f"Blocks overturn in bursts, most often in cycle {peak + 1}; white noise for band noise errs by up to "
        f"{cost:.4f} a cycle"
    )
    with pictures.page(path, (10.5, 12.0), title, [note]) as figure:
        early, cycle, white, band = figure.subplots(4, 1, height_ratios=(0.8, 1.0, 0.8, 0.8))
        white.sharex(cycle)
        band.sharex(cycle)
        band.sharey(white)
        _early(early, values)
        _cycles(cycle, values)
        _differences(white, values, "white", "(c) Paths of white noise less density: the error of the solver")
        _differences(
            band, values, "band", "(d) Paths of band noise less density: what the replacement of the noise costs"
        )


def _early(axes, values):
    """Draw the density of the time of overturning in the first cycles, left and right."""
    scene = Scene.from_toml(values["scene"])
    early, trials = np.array(values["early"]), values["realizations"]
    width = scene.period / PARTS
    edges = width * np.arange(len(early) + 1)
    middles = 0.5 * (edges[1:] + edges[:-1])
    for column, sign, colour in ((1, 1.0, pictures.COLOURS[0]), (0, -1.0, pictures.COLOURS[1])):
        density = early[:, column] / width
        limits = sign * wilson_interval(np.rint(early[:, column] * trials), trials) / width
        axes.stairs(sign * density, edges, color=colour, fill=True, alpha=0.25)
        pictures.error_bars(
            axes, middles, sign * density, np.sort(limits, axis=1), color=colour, marker="none", elinewidth=0.8
        )
    axes.axhline(0.0, color="black", linewidth=0.8)
    axes.yaxis.set_major_formatter(lambda value, _: f"{abs(value):g}")
    variance = values["noise"][-1]["variance"]
    axes.set(
        title=f"(a) Time of overturning in the first {EARLY} cycles, σ² = {variance:g}, band noise",
        xlabel=motion.TIME,
    )
    axes.set(ylabel="probability density\nleft ← → right", xlim=(0.0, edges[-1]))
    axes.set_xticks(scene.period * np.arange(EARLY + 1), [f"{k} T" if k else "0" for k in range(EARLY + 1)])


def _cycles(axes, values):
    """Draw the probability of overturning in each cycle, of paths and of the density, by variance."""
    cycles = np.arange(1, values["cycles"] + 1)
    for row, colour, marker in zip(values["noise"], pictures.COLOURS, "osD", strict=False):
        label = f"σ² = {row['variance']:g}"
        steps = {"baseline": None, "color": colour, "linewidth": 1.0}
        axes.stairs(np.maximum(row["density"], 1e-12), np.arange(cycles.size + 1) + 0.5, **steps)
        probability, limits = np.array(row["band"]), np.array(row["band_interval"])
        some = probability > 0.0
        pictures.error_bars(
            axes, cycles[some], probability[some], limits[some], color=colour, marker=marker, label=label
        )
    axes.set(title="(b) Overturned in each cycle: paths of band noise (points), density (steps)", yscale="log")
    axes.set(xlabel="forcing cycle", ylabel="probability", ylim=(3e-6, 0.3), xlim=(0.0, cycles[-1] + 1.0))
    axes.legend(ncols=3)


def _differences(axes, values, name, title):
    """Draw what the share of paths that overturn in a cycle differs by from the density."""
    for place, (row, colour, marker) in enumerate(zip(values["noise"], pictures.COLOURS, "osD", strict=False)):
        density = np.array(row["density"])
        cycles = 1.0 + np.arange(density.size) + 0.25 * (place - 1)
        apart, limits = np.subtract(row[name], density), np.subtract(row[f"{name}_interval"], density[:, None])
        pictures.error_bars(axes, cycles, apart, limits, color=colour, marker=marker)
    axes.axhline(0.0, color="black", linewidth=0.8, zorder=1)
    axes.set(title=title, xlabel="forcing cycle", ylabel="difference\nof probability")


def report(values):
    """Print how far the engines differ."""
    for row in values["noise"]:
        peak = int(np.argmax(row["band"])) + 1
        worst = {name: max(row[f"{name}_z"].values(), key=abs) for name in ("white", "band")}
        largest = f"largest difference white {worst['white']:+.1f}, band {worst['band']:+.1f} standard errors"
        print(f"σ² = {row['variance']:<6g} most overturn in cycle {peak} ({max(row['band']):.4f}); {largest}")


if __name__ == "__main__":
    command(
        run,
        "results/passage",
        "passage.png",
        "passage.json",
        report=report,
        cycles="forcing cycles",
        realizations="of an ensemble",
        tol="tolerance of the densities",
        seed="of the ensembles",
    )
