"""Fig. 8: a late overturning and a mean map.

For weak noise, σ² = 0.04², the paper shows (a) the Poincaré points of one realization that overturns, against the
number of the cycle, and (b) the mean map (its eq. 21), which reconstructs the chaotic attractor that the noise hides:
1,200 realizations are averaged after each forcing cycle and all restarted from the mean, for 500 cycles. Here are

* (a) the first realization that overturns after cycle 100 of the 200 that are sampled,
* (b) that mean map over the attractor without noise (grey), with the correlation dimension of both,
* (c) the points of single noisy blocks that have not overturned, for contrast: the attractor as noise blurs it,
* (d) the mean of realizations that run on freely, which is another thing: it forgets its start within ten cycles and
  comes to rest at the mean of whatever still stands, a point that no block need ever visit.

Overturned realizations lie at the cut-off, as in the paper's densities, except in (d), where they are left out.

Source: H. Lin and S. C. S. Yim, "Nonlinear rocking motions. I: Chaos under noisy periodic excitations", J. Eng. Mech.
122(8), 719-727, 1996, eq. 21 and Fig. 8: (A, Ω, e, Ψ) = (4.6, 2.7, 0.5, 3.14).

Run time: about ten seconds on 2 cores, once the kernels are compiled.

    python cases/fig08_mean_poincare.py --out results/fig08

Files: ``fig08.png``, ``fig08.json``.
"""

import motion
import numpy as np
from command import command

from fpk_rocking import NoNoise, load_scene
from fpk_rocking.results import pictures, storage
from montecarlo import correlation_dimension, mean_poincare_map, restarted_poincare_map, simulate

VARIANCE = 0.04**2
LENGTHS = (0.05, 0.4)
SETTLED = 5
FREE_CYCLES = 40
LATE, SHOWN_CYCLES = 100, 200


def run(out, variance=VARIANCE, cycles=500, realizations=1200, seeds=8) -> dict:
    """Compute, draw and write everything.

    Parameters
    ----------
    out : pathlib.Path
        Folder for the files; created if missing.
    variance : float
        σ², nondimensional.
    cycles, realizations : int
        Of the restarted mean map; the paper has 500 and 1,200. The free ensemble is ten times as large.
    seeds : int
        Mean maps from which the dimension and its scatter are taken; the first is drawn.

    Returns
    -------
    dict
        What ``fig08.json`` holds.
    """
    scene = load_scene("main").varied(forcing={"phase": 3.14})
    attractor = attractor_of(scene, seeds * cycles)
    noisy = scene.varied(noise={"variance": variance})
    free = simulate(noisy, cycles=SHOWN_CYCLES, realizations=10 * realizations)
    chosen = int(np.flatnonzero(free.overturn_time > LATE * scene.period)[0])
    sampled = {"cycles": cycles, "realizations": realizations}
    maps = [restarted_poincare_map(noisy, seed=seed, **sampled) for seed in range(1, seeds + 1)]
    mean = mean_poincare_map(free, "left out")
    settled = [mean_map.points[SETTLED + 1 :] for mean_map in maps]
    values = {
        "figure": "Fig. 8 of Lin and Yim, J. Eng. Mech. 122(8), 1996",
        "scene": noisy.to_toml(),
        **sampled,
        "seeds": seeds,
        "lengths": list(LENGTHS),
        "realization": chosen,
        "overturned_after_cycles": float(free.overturn_time[chosen] / scene.period),
        "standing_after_shown_cycles": float(free.survival[-1]),
        "mean_overturned_after": [mean_map.overturned_after for mean_map in maps],
        "without_noise": _spread(attractor) | dimensions_of(np.split(attractor, seeds)),
        "restarted": _spread(np.concatenate(settled)) | dimensions_of(settled),
        "restarted_standard_error": maps[0].standard_error[1:].mean(axis=0).tolist(),
        "free_last": mean.points[FREE_CYCLES].tolist(),
        "free_last_standard_error": mean.standard_error[FREE_CYCLES].tolist(),
        "remarks": [scene.noise.remark],
    }
    _draw(out / "fig08.png", attractor, free, maps[0], mean, values)
    storage.write_json(out / "fig08.json", values)
    return values


def attractor_of(scene, count):
    """Poincaré points (count, 2) of a block without noise, from the 101st on."""
    quiet = simulate(scene.varied(noise=NoNoise()), cycles=count + 100, realizations=1)
    return np.stack([quiet.angle[0], quiet.velocity[0]], axis=1)[101:]


def _spread(points):
    """Mean and standard deviation of Poincaré points (n, 2)."""
    return {"mean": points.mean(axis=0).tolist(), "deviation": points.std(axis=0).tolist()}


def dimensions_of(samples):
    """Mean and standard deviation of the correlation dimensions of sets of points."""
    dimensions = [correlation_dimension(points, *LENGTHS) for points in samples]
    return {
        "dimension": float(np.mean(dimensions)),
        "deviation_of_dimension": float(np.std(dimensions, ddof=len(dimensions) > 1)),
    }


def _draw(path, attractor, free, mapped, mean, values):
    """Draw a realization of the free ensemble, the restarted map, the attractor (n, 2), and the free mean map."""
    noise = free.scene.noise
    notes = [f"Noise of σ² = {noise.variance:g} on [{noise.band[0]:g}, {noise.band[1]:g}], which is inferred."]
    dimensions = (values[name]["dimension"] for name in ("restarted", "without_noise"))
    title = "Paper Fig. 8: the mean map restores the attractor: dimension {:.2f}, without noise {:.2f}"
    title = title.format(*dimensions)
    with pictures.page(path, (10.5, 10.6), title, notes) as figure:
        panels = figure.subplot_mosaic([["a", "a"], ["b", "c"], ["d", "d"]], height_ratios=(0.6, 1.0, 0.6))
        _cycle_by_cycle(panels["a"], free, values)
        for name in "bc":
            panels[name].plot(*attractor.T, ".", markersize=1.0, color="#bbbbbb", rasterized=True)
            panels[name].set(xlabel=motion.ANGLE, ylabel=motion.VELOCITY, xlim=(-1.6, 0.5), ylim=(-0.5, 1.4))
        panels["b"].plot(*mapped.points[SETTLED + 1 :].T, ".", markersize=3.0, color=pictures.COLOURS[0])
        dimensions = (
            f"{values[name]['dimension']:.2f} ± {values[name]['deviation_of_dimension']:.2f}"
            for name in ("restarted", "without_noise")
        )
        text = "(b) Mean of {:,}, restarted each cycle:\ndimension {} (blue), {} without noise (grey)"
        panels["b"].set_title(text.format(values["realizations"], *dimensions), loc="left", fontsize=10)
        single = free.angle[:, SETTLED + 1 : 26], free.velocity[:, SETTLED + 1 : 26]
        first = slice(0, values["cycles"] // 20)
        panels["c"].plot(*(states[first].ravel() for states in single), ".", markersize=3.0, color=pictures.COLOURS[1])
        panels["c"].set_title("(c) As many points of single blocks", loc="left", fontsize=10)
        _free_mean(panels["d"], mean)


def _cycle_by_cycle(axes, free, values):
    """Draw the Poincaré angles of the chosen realization against the cycle."""
    chosen, cutoff = values["realization"], free.scene.overturning.angle
    angle = free.angle[chosen]
    axes.plot(angle, "o-", markersize=2.5, linewidth=0.6, color=pictures.COLOURS[0])
    end = values["overturned_after_cycles"]
    axes.plot(end, free.overturn_side[chosen] * cutoff, "x", color=pictures.OVERTURNED, markersize=9, mew=2)
    for level in (-cutoff, cutoff):
        axes.axhline(level, color=pictures.OVERTURNED, linewidth=0.8, linestyle="--")
    axes.set(xlabel="forcing cycles", ylabel=motion.ANGLE, xlim=(0.0, 1.04 * end))
    title = (
        f"(a) Poincaré angles of realization {chosen}, which overturns after {end:.1f} cycles (cross at the cut-off)"
    )
    axes.set_title(title, loc="left", fontsize=10)


def _free_mean(axes, mean):
    """Draw a mean map of a free ensemble against the cycle, with intervals."""
    for k, (name, colour) in enumerate(zip(("angle", "velocity"), pictures.COLOURS, strict=False)):
        means, error = mean.points[: FREE_CYCLES + 1, k], 1.96 * mean.standard_error[: FREE_CYCLES + 1, k]
        axes.errorbar(np.arange(FREE_CYCLES + 1), means, error, marker="o", markersize=3, linewidth=0.8, color=colour)
        axes.annotate(name, (FREE_CYCLES, means[-1]), xytext=(8, -3), textcoords="offset points", color=colour)
    axes.set(xlabel="forcing cycles", ylabel="mean, nondimensional", xlim=(-0.5, 1.1 * FREE_CYCLES))
    axes.set_title("(d) Mean of an ensemble that runs freely, 95 % intervals: it settles", loc="left", fontsize=10)


def report(values):
    """Print what became of the maps."""
    for name in ("without_noise", "restarted"):
        figures = values[name]
        dimension = f"{figures['dimension']:.3f} ± {figures['deviation_of_dimension']:.3f}"
        print(f"{name.replace('_', ' ')}: dimension {dimension}, deviation {np.round(figures['deviation'], 3)}")
    print(
        f"Shown: realization {values['realization']}, overturned after {values['overturned_after_cycles']:.1f} cycles"
    )
    print(f"Free ensemble: last mean {np.round(values['free_last'], 3)}")


if __name__ == "__main__":
    command(
        run,
        "results/fig08",
        "fig08.png",
        "fig08.json",
        report=report,
        realizations="of the mean map",
        seeds="of the mean map",
    )
