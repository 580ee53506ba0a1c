"""Fig. 6: the joint density spreads and leaks.

The rocking block dx/dτ = v, dv/dτ = x - s - A cos(Ωτ + Ψ) + η(τ), impact v⁺ = e v⁻ at x = 0 (paper eqs. 1 to 4),
starts at rest. Its joint density of angle and velocity is shown after 2, 4, 10 and 20 forcing cycles as surfaces, from
the Fokker-Planck equation, with the probability that has overturned at the cut-off ±π/2. Maps show it after 2 to 40
cycles, also from Monte Carlo.

Two results are held side by side: the density, under filtered noise that stands for the paper's band, with what 100
harmonics change; and Monte Carlo with the paper's noise itself (method exact).

The paper does not state the noise band; [0, 10] is inferred from its figures (band_inferred.py).

Source: H. Lin and S. C. S. Yim, "Nonlinear rocking motions. I: Chaos under noisy periodic excitations", J. Eng. Mech.
122(8), 719-727, 1996, Fig. 6.

Run time: about a minute on 2 cores, compilation included.

    python cases/fig06_jpdf_evolution.py --out results/fig06
    python cases/view.py results/fig06

Files: ``fig06.png`` (surfaces), ``maps.png`` (the same as maps), ``survival.png``, ``summary.json``, ``jpdf.pvd``
(density) and ``jpdf_paths.pvd`` (histogram of the realizations), each with its .vtu files.
"""

from command import command
from opengl import probe_rendering

from fpk_rocking import load_scene, solve_fpk
from fpk_rocking.base.precompilation import queue_for_helpers
from fpk_rocking.compare import compare
from fpk_rocking.output import figures, tables, vtk
from fpk_rocking.output.tables import reporting
from fpk_rocking.results import storage
from fpk_rocking.results.remarks import remarks
from montecarlo import tally
from montecarlo.engines import engine_of
from montecarlo.engines.batches import compilation_of

CYCLES = (0, 2, 4, 10, 20, 40)
MOST_SURFACES = 4


def run(out, cycles=CYCLES, realizations=1_000_000, tol=1e-2, seed=1) -> dict:
    """Compute, compare and write everything.

    Parameters
    ----------
    out : pathlib.Path
        Folder for the files; created if missing.
    cycles : sequence of int
        Cycles to show, ascending.
    realizations : int
        Number of paths.
    tol : float
        Error of survival that the density solver aims at, and by which it chooses the noise.
    seed : int
        Of the paths.

    Returns
    -------
    dict
        What ``summary.json`` holds.
    """
    scene, last = load_scene("main"), max(cycles)
    queue_for_helpers(compilation_of(engine_of(scene), scene))

    with reporting("density") as progress:
        density = solve_fpk(scene, cycles=last, tol=tol, progress=progress)
    with reporting("Monte Carlo") as progress:
        paths = tally(scene, cycles=last, realizations=realizations, seed=seed, progress=progress)
    density = density.checked(paths)
    against = compare(paths, density, joint_cycles=[cycle for cycle in cycles if cycle > 0])

    vtk.write_series(out, "jpdf", density, cycles)
    vtk.write_series(out, "jpdf_paths", paths, cycles)
    draw(out, cycles, density, paths)

    rendering = probe_rendering()
    values = {
        "figure": "Fig. 6 of Lin and Yim, J. Eng. Mech. 122(8), 1996",
        "scene": scene.to_toml(),
        "shown_cycles": list(cycles),
        "density": density.summary(),
        "paths": paths.summary(),
        "paths_against_density": against.summary(),
        "rendering": {"works": rendering.works, "missing": list(rendering.missing), "reason": rendering.reason},
        "remarks": list(remarks(density, paths)),
    }
    storage.write_json(out / "summary.json", values)
    tables.show(*tables.comparison_table([against]))
    return values


def draw(out, cycles, density, paths):
    """Draw surfaces, maps and survival, each with what it shows as its title."""
    after_start = [cycle for cycle in cycles if cycle > 0]
    stands = [f"{100.0 * result.survival[max(cycles)]:.1f} %" for result in (density, paths)]
    title = f"Paper Fig. 6: the density spreads, splits and leaks; {stands[0]} stand after {max(cycles)} cycles"
    figures.surface_figure(out / "fig06.png", [density], after_start[:MOST_SURFACES], title)
    title = f"Density and Monte Carlo fill the same states; after {max(cycles)} cycles {' and '.join(stands)} stand"
    figures.density_maps(out / "maps.png", [density, paths], after_start, title)
    apart = float(abs(paths.survival - density.survival).max())
    title = f"The density meets paths of the paper's noise to {apart:.4f} in survival at all cycles"
    figures.survival_figure(out / "survival.png", [density, paths], title)


def report(values):
    """Say whether the density can be looked at in three dimensions here."""
    rendering = values["rendering"]
    if rendering["works"]:
        print("Look around in the density: python cases/view.py, and the folder of the files")
    else:
        print(f"No 3-D view on this machine: {rendering['reason']}. The figures were drawn without it.")


if __name__ == "__main__":
    command(
        run,
        "results/fig06",
        "fig06.png",
        "maps.png",
        "survival.png",
        "summary.json",
        "jpdf.pvd",
        "jpdf_paths.pvd",
        report=report,
        realizations="number of paths",
        tol="tolerance of the density",
        seed="of the paths",
    )
