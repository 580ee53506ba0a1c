"""A block that rests: survival under three noises.

The forcing alone never lifts this block off (A = .867), the noise does now and then. Under band noise the block rests
in between. White noise of equal Melnikov variance lets it never rest, and far more blocks overturn. Low-pass noise of
the same variance and Melnikov variance lets it rest; its density has two more dimensions, the states of the filter.

Shown are survival by Monte Carlo of the band noise and of the low-pass noise, and by the density solver with low-pass
noise (``noise_replacement="filtered"``) and with white noise; the probability of being at rest after every cycle; and,
over the second cycle, the probability of being at rest at every value of the noise.

Noise, block and forcing are this project's.

Run time: about six minutes on 2 cores, once the kernels are compiled; most of it the density with low-pass noise.

    python cases/rest.py --out results/rest

Files: ``rest.png``, ``rest.json``.
"""

import math
import warnings

import numpy as np
from command import command

from fpk_rocking import Scene, load_scene, solve_fpk
from fpk_rocking.density.filter_nodes import filtered_discretization
from fpk_rocking.density.filtered import FilteredPropagator
from fpk_rocking.density.resolution import RESOLUTIONS, explore
from fpk_rocking.density.space import velocity_bound
from fpk_rocking.results import pictures, storage
from montecarlo import simulate

CYCLES, STEPS, SHOWN = 10, 128, 3.5  # steps in a cycle that is looked into; standard deviations of the noise in (c)


def run(out, cycles=CYCLES, realizations=20_000, tol=1e-2, resolution=2, seed=1) -> dict:
    """Compute, draw and write everything.

    Parameters
    ----------
    out : pathlib.Path
        Folder for the files; created if missing.
    cycles : int
        Forcing cycles.
    realizations : int
        Of each ensemble.
    tol : float
        Error of survival that the densities aim at.
    resolution : int
        Of the density that is looked into over a cycle.
    seed : int
        Of the ensembles.

    Returns
    -------
    dict
        What ``rest.json`` holds.
    """
    scene = load_scene("rest")
    filtered = scene.filtered_equivalent()
    values = {"scene": scene.to_toml(), "filtered": filtered.to_toml(), "realizations": realizations}
    values["sampled"] = {name: _sampled(noisy, cycles, realizations, seed) for name, noisy in _noises(scene, filtered)}
    values["solved"] = {replacement: _solved(scene, cycles, tol, replacement) for replacement in ("filtered", "white")}
    values["inside"] = look_inside(filtered, resolution)
    draw(out / "rest.png", values)
    storage.write_json(out / "rest.json", values)
    return values


def _noises(scene, filtered):
    """Names of the noises whose paths are shown, and their scenes."""
    return ("band", scene), ("low-pass", filtered)


def _sampled(scene, cycles, realizations, seed):
    """Survival and share at rest by cycle, by paths."""
    ensemble = simulate(scene, cycles=cycles, realizations=realizations, seed=seed)
    return {"survival": ensemble.survival.tolist(), "at_rest": ensemble.at_rest.tolist()}


def _solved(scene, cycles, tol, replacement):
    """Survival and probability at rest by cycle, by the density with a replacement of the noise."""
    with warnings.catch_warnings():  # the probability at rest is looked at here, not the bins
        warnings.simplefilter("ignore", RuntimeWarning)
        evolution = solve_fpk(scene, cycles=cycles, tol=tol, bins_tol=math.inf, noise_replacement=replacement)
    names = ("error_estimate", "rest_error_estimate", "wall_s")
    values = {name: getattr(evolution, name) for name in names}
    return values | {"survival": evolution.survival.tolist(), "at_rest": evolution.at_rest.tolist()}


def look_inside(scene, resolution):
    """Rest by value of the noise at every step of the second cycle."""
    white = scene.white_equivalent()
    bound = velocity_bound(white, white.noise.diffusion)
    plane = RESOLUTIONS[resolution].adapted(white, bound, explore(white, white.period * np.arange(3)))
    grid = filtered_discretization(scene, plane, resolution)._replace(time_grid=np.linspace(0.0, 0.5, STEPS // 2 + 1))
    run = FilteredPropagator(scene, grid, 1e-8)
    times, resting = [], []

    each = run.rest_nodes.weights.sum(axis=1)
    for state in run.states(scene.period * np.arange(3), scene.start):
        if state.step < STEPS:
            continue
        times.append(state.step / STEPS - 1.0)
        resting.append((run.masses_at_rest(state).sum(axis=1) / each)[:: -1 if state.reflected else 1].tolist())
    return {"noise": (run.nodes.sigma * run.rest_nodes.values).tolist(), "times": times, "resting": resting}


def draw(path, values):
    """Draw survival, rest by cycle, and rest by value of the noise."""
    scene = Scene.from_toml(values["scene"])
    forcing, noise, solved, sampled = scene.forcing, scene.noise, values["solved"], values["sampled"]
    overturned = [1.0 - result["survival"][-1] for result in (solved["white"], sampled["band"], solved["filtered"])]
    title = (
        "White noise overturns a block that rests in between too often: {:.2f} against {:.2f} (band noise) and {:.2f} "
        "(low-pass noise)"
    ).format(*overturned)
    note = (
        f"e = {scene.block.restitution:g}, {forcing}, T = 2π/Ω; band noise of variance {noise.variance:g} on "
        f"[{noise.band[0]:g}, {noise.band[1]:g}]; all nondimensional. Points: {values['realizations']:,} paths. "
        "Lines: density, noise of equal Melnikov variance (low-pass: also of equal variance)."
    )
    with pictures.page(path, (12.0, 5.2), title, [note]) as figure:
        survival, rest, cycle = figure.subplots(1, 3)
        _by_cycle(survival, values, "survival")
        _by_cycle(rest, values, "at_rest")
        survival.set(title="(a) Survival", ylabel="P(not overturned)")
        rest.set(title="(b) Rest; band: estimated error", ylabel="P(at rest)")
        line, error = np.array(solved["filtered"]["at_rest"]), solved["filtered"]["rest_error_estimate"]
        rest.fill_between(
            np.arange(1, line.size), line[1:] - error, line[1:] + error, color=pictures.COLOURS[1], alpha=0.2
        )
        rest.set_ylim(bottom=0.0)
        survival.legend(loc="lower left", fontsize=10)
        _over_cycle(figure, cycle, values["inside"], SHOWN * math.sqrt(noise.variance))


def _by_cycle(axes, values, name):
    """Draw a quantity ("survival" or "at_rest") by cycle."""
    for (noise, result), colour, marker in zip(values["sampled"].items(), pictures.COLOURS, "os", strict=False):
        axes.plot(result[name], marker, color=colour, markersize=5, label=f"{noise} noise, paths")
    axes.plot(values["solved"]["filtered"][name], color=pictures.COLOURS[1], label="low-pass noise, density")
    if name == "survival":
        axes.plot(values["solved"]["white"][name], color=pictures.COLOURS[2], label="white noise, density")
    axes.set(xlabel="forcing cycles")
    axes.xaxis.get_major_locator().set_params(integer=True)


def _over_cycle(figure, axes, inside, most):
    """Draw the probability of rest over time and noise, up to a largest noise."""
    image = axes.pcolormesh(
        inside["times"], inside["noise"], np.array(inside["resting"]).T, vmin=0.0, vmax=1.0, cmap="GnBu"
    )
    figure.colorbar(image, ax=axes, label="P(at rest | η)")
    axes.set(
        title="(c) Rest in the second cycle, by the low-pass noise",
        xlabel="time τ/T",
        ylabel="noise η",
        ylim=(-most, most),
    )
    axes.grid(visible=False)


def report(values):
    """Print survival."""
    for kind in ("sampled", "solved"):
        for name, result in values[kind].items():
            print(f"{kind} {name}: survival {result['survival'][-1]:.4f}, at rest {result['at_rest'][-1]:.4f}")


if __name__ == "__main__":
    command(
        run,
        "results/rest",
        "rest.png",
        "rest.json",
        report=report,
        realizations="of an ensemble",
        tol="tolerance of the densities",
        seed="of the ensembles",
    )
