"""Safe basins in noise, for every start at once.

The adjoint of the density solver's steps gives the probability of standing for a number of cycles as a function of the
start, for the whole plane in one backward run. Without noise it is 1 inside the safe basin and 0 outside, which the
exact engine tells start by start: here from random starts all over the plane. With x = Θ and v = dΘ/dτ the lines x + v
= ±1 + (A/√(1+Ω²)) cos(Ψ + atan Ω) are the moving separatrices: beyond them a block that meets no impact goes over. The
integral of the probability over the plane is the safe area, an integrity measure; its fall as noise grows is the
erosion curve.

Noise is white here: D = σ_M²/2 of the main scene's band [0, 10], which is inferred (band_inferred.py).

Source: the moving separatrix and the adjoint are derived in docs/theory.md; safe areas as a measure of integrity: M. S.
Soliman and J. M. T. Thompson, "Integrity measures quantifying the erosion of smooth and fractal basins of attraction",
J. Sound Vib. 135(3), 453-475, 1989.

Run time: about a minute on 2 cores, once the kernels are compiled.

    python cases/safe_basins.py --out results/basins

Files: ``basins.png``, ``basins.vtu`` (survival at the largest of the shown noises), ``basins.json``.
"""

import math

import motion
import numpy as np
from command import command

from fpk_rocking import CycleOperator, NoNoise, Start, load_scene
from fpk_rocking.output.vtk import write_function
from fpk_rocking.results import pictures, storage
from montecarlo import simulate

VARIANCES = (0.0025, 0.005, 0.01, 0.02, 0.04, 0.09, 0.16)
SHOWN = (0.0025, 0.01, 0.04)
HORIZONS = (10, 50)
_STATE = {"xlabel": motion.ANGLE, "ylabel": motion.VELOCITY}
_BINS = 120, 180
_SPREAD = 1.0, 1.7
_FASTEST = 3.2


def run(out, variances=VARIANCES, shown=SHOWN, horizons=HORIZONS, starts=1_000_000, tol=1e-2, seed=1) -> dict:
    """Compute, draw and write everything.

    Parameters
    ----------
    out : pathlib.Path
        Folder for the files; created if missing.
    variances, shown : sequence of float
        σ² of the erosion curve and, three among them, of the maps; nondimensional.
    horizons : sequence of int
        Cycles to stand; the maps are those of the first.
    starts, seed : int
        Random starts of the block without noise.
    tol : float
        Of the operators.

    Returns
    -------
    dict
        What ``basins.json`` holds.
    """
    scene = load_scene("main")
    rows, maps, mean = [], {}, None
    for variance in variances:
        operator = CycleOperator(scene.varied(noise={"variance": variance}), tol=tol)
        maps_of_horizons = [operator.survival_map(cycles) for cycles in horizons]
        if variance in shown:
            maps[variance] = maps_of_horizons[0]
            mean = operator.mean_cycles_map() if variance == max(shown) else mean
        rows.append(
            {
                "variance": variance,
                "area": [survival_map.integral for survival_map in maps_of_horizons],
                "escape_rate": operator.escape_rate,
            }
            | {"error": [survival_map.error_estimate * survival_map.integral for survival_map in maps_of_horizons]}
        )
    bound = maps[max(shown)].mesh_lines[1][-1]
    quiet, quiet_areas = _quiet(scene, horizons, starts, seed, bound)
    values = {
        "scene": scene.to_toml(), "cycles": list(horizons), "starts": starts, "erosion": rows,
        "area_without_noise": [list(area) for area in quiet_areas],
    }  # fmt: skip
    _draw(out / "basins.png", scene, quiet, maps, mean, values)
    write_function(out / "basins.vtu", maps[max(shown)], "survival")
    storage.write_json(out / "basins.json", values)
    return values


def _quiet(scene, horizons, count, seed, bound):
    """Basin of a scene without noise, from `count` random starts: its map after the first horizon, and its areas.

    The map is (edges, parts): edges of bins of angle and velocity (up to `bound`), and the part of the starts in each
    bin that stand. The areas are one a horizon, each with its standard error.
    """
    wide = Start(0.0, 0.0, tuple(map(tuple, np.diag(np.square(_SPREAD)).tolist())))
    ensemble = simulate(scene.varied(noise=NoNoise(), start=wide), cycles=max(horizons), realizations=count, seed=seed)
    x, v = ensemble.angle[:, 0], ensemble.velocity[:, 0]
    weights = 2.0 * math.pi * math.prod(_SPREAD) * np.exp(0.5 * ((x / _SPREAD[0]) ** 2 + (v / _SPREAD[1]) ** 2))
    inside = np.abs(v) < bound
    limits = scene.overturning.angle, bound
    edges = [np.linspace(-limit, limit, count + 1) for limit, count in zip(limits, _BINS, strict=True)]
    areas, parts = [], None
    for cycles in horizons:
        stands = ~np.isnan(ensemble.angle[:, cycles]) & inside
        # A start beyond the cut-off weighs nothing: its state is nan from the beginning.
        share = np.where(stands, weights, 0.0)
        areas.append((share.mean(), share.std() / math.sqrt(count)))
        if parts is None:
            some = ~np.isnan(x)
            total = np.histogram2d(x[some], v[some], bins=edges)[0]
            standing = np.histogram2d(x[stands], v[stands], bins=edges)[0]
            parts = np.divide(standing, total, out=np.full_like(total, np.nan), where=total > 0)
    return (edges, parts), areas


def _draw(path, scene, quiet, maps, mean, values):
    """Draw the basin without noise, survival maps by variance, the map of the mean time, and the safe areas."""
    note = (
        "Main scene with white noise of equal Melnikov variance. Dashed: moving separatrices. (f) without noise from "
        f"{values['starts']:,} random starts; bars: error estimates of the meshes."
    )
    horizon, noisiest = values["cycles"][0], max(maps)
    (row,) = (row for row in values["erosion"] if row["variance"] == noisiest)
    parts = zip(row["area"], values["area_without_noise"], values["cycles"], strict=True)
    left = ", to ".join(f"{100.0 * area / alone[0]:.0f} % over {cycles} cycles" for area, alone, cycles in parts)
    title = f"Noise of σ = {math.sqrt(noisiest):g} shrinks the area of safe starts to {left}"
    limit = scene.overturning.angle
    with pictures.page(path, (12.0, 9.4), title, [note]) as figure:
        panels = figure.subplot_mosaic([["quiet", 0, "time"], [1, 2, "erosion"]])
        edges, parts = quiet
        grid = np.linspace(-limit, limit, 500), np.linspace(-_FASTEST, _FASTEST, 500)
        look = {"cmap": "viridis", "vmin": 0.0, "vmax": 1.0, "rasterized": True}
        panels["quiet"].pcolormesh(*edges, parts.T, **look)
        panels["quiet"].set_title("(a) No noise, exact engine")
        for letter, (place, (variance, survival_map)) in zip("bde", enumerate(maps.items()), strict=False):
            image = panels[place].pcolormesh(*grid, survival_map(grid[0][:, None], grid[1][None]).T, **look)
            panels[place].set_title(f"({letter}) σ = {math.sqrt(variance):g}")
        four = [panels[name] for name in ("quiet", 0, 1, 2)]
        bar = {"location": "bottom", "aspect": 50, "shrink": 0.7}
        figure.colorbar(image, ax=four, label=f"P(not overturned) after {horizon} cycles, by start", **bar)
        time = mean(grid[0][:, None], grid[1][None])
        shade = panels["time"].pcolormesh(*grid, time.T, cmap="cividis", vmin=0.0, rasterized=True)
        figure.colorbar(shade, ax=panels["time"], label="forcing cycles")
        panels["time"].set_title(f"(c) σ = {math.sqrt(max(maps)):g}: mean time to overturning")
        for axes in (*four, panels["time"]):
            _separatrices(axes, scene)
            axes.set(xlim=(-limit, limit), ylim=(-_FASTEST, _FASTEST), **_STATE)
            axes.grid(visible=False)
        _erosion(panels["erosion"], values)


def _separatrices(axes, scene):
    """Draw the moving separatrices of a scene at τ = 0."""
    forcing, x = scene.forcing, np.array([-2.0, 2.0])
    swing = forcing.amplitude / math.hypot(1.0, forcing.frequency)
    shift = swing * math.cos(forcing.phase + math.atan(forcing.frequency))
    for side in (1.0, -1.0):
        axes.plot(x, side + shift - x, "--", color=pictures.OVERTURNED, linewidth=1.4)


def _erosion(axes, values):
    """Draw the safe area against σ, by horizon."""
    for k, cycles in enumerate(values["cycles"]):
        columns = [[row[name][k] for row in values["erosion"]] for name in ("area", "error")]
        places = np.sqrt([row["variance"] for row in values["erosion"]])
        axes.errorbar(places, *columns, marker="o", color=pictures.COLOURS[k], capsize=2)
        middle = len(places) // 2
        pictures.named(
            axes, f"{cycles} cycles", (places[middle], columns[0][middle]), pictures.COLOURS[k], offset=(8.0, 4.0)
        )
    # Without noise the areas of all horizons are nearly the same: larger open stars around smaller ones.
    for k, (area, _) in enumerate(values["area_without_noise"]):
        axes.plot(0.0, area, "*", color=pictures.COLOURS[k], markersize=16 - 7 * k, markerfacecolor="none")
    pictures.named(axes, "no noise, both", (0.0, values["area_without_noise"][0][0]), "black", offset=(12.0, -3.0))
    axes.set(
        title="(f) Safe area",
        xlabel="standard deviation of the noise σ, nondimensional",
        ylabel="safe area, nondimensional",
    )
    axes.set_ylim(bottom=0.0)


def report(values):
    """Print the areas."""
    print("safe area after", values["cycles"], "cycles")
    print("without noise", [f"{area:.4f} ± {error:.4f}" for area, error in values["area_without_noise"]])
    for row in values["erosion"]:
        areas = ", ".join(f"{area:.4f} ± {error:.4f}" for area, error in zip(row["area"], row["error"], strict=True))
        print(f"σ² = {row['variance']:<7g} {areas}   escape rate {row['escape_rate']:.3g}")


if __name__ == "__main__":
    command(
        run,
        "results/basins",
        "basins.png",
        "basins.vtu",
        "basins.json",
        report=report,
        tol="of the operators",
    )
