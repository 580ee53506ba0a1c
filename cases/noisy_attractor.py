"""The noisy attractor and how long it lasts.

The one-cycle operator of the density has a leading mode: the density that keeps its shape while it leaks. It stands
beside the attractor of the block without noise, which the exact engine follows; one less its eigenvalue is the escape
rate. The other eigenvalues say how soon a start is forgotten. The density is drawn as means over small bins: near Θ = 0
it is singular, and the polynomials of the solver swing about it there. Survival from rest follows from the modes,
beside Monte Carlo with the same white noise.

The paper does not state the noise band; [0, 10] is inferred from its figures (band_inferred.py).

Source: H. Lin and S. C. S. Yim, "Nonlinear rocking motions. I: Chaos under noisy periodic excitations", J. Eng. Mech.
122(8), 719-727, 1996, for the scene; the operator is this project's (docs/theory.md).

Run time: about half a minute on 2 cores, once the kernels are compiled.

    python cases/noisy_attractor.py --out results/attractor

Files: ``attractor.png``, ``attractor.vtu``, ``attractor.json``.
"""

import motion
import numpy as np
from command import command
from matplotlib.colors import PowerNorm

from fpk_rocking import CycleOperator, NoNoise, load_scene
from fpk_rocking.output.vtk import write_function
from fpk_rocking.results import pictures, storage
from montecarlo import simulate

LONG = (1, 10, 100, 200, 1000, 10**4)
FORGOTTEN = 100
_STATE = {"xlabel": motion.ANGLE, "ylabel": motion.VELOCITY}


def run(out, tol=1e-3, realizations=100_000, cycles=60, points=20_000, seed=1) -> dict:
    """Compute, draw and write everything.

    Parameters
    ----------
    out : pathlib.Path
        Folder for the files; created if missing.
    tol : float
        Of the operator.
    realizations, cycles, seed : int
        Of the ensemble.
    points : int
        Poincaré points of the block without noise.

    Returns
    -------
    dict
        What ``attractor.json`` holds.
    """
    scene = load_scene("main")
    operator = CycleOperator(scene, tol=tol)
    quiet = simulate(scene.varied(noise=NoNoise()), cycles=points + FORGOTTEN, realizations=1)
    ensemble = simulate(scene.white_equivalent(), cycles=cycles, realizations=realizations, seed=seed)
    estimate, long = operator.estimate_survival(range(201)), operator.estimate_survival(LONG)
    values = {
        "scene": scene.to_toml(),
        "escape_rate": operator.escape_rate,
        "escape_error": operator.escape_error,
        "mean_cycles": operator.mean_cycles,
        "forgetting_cycles": operator.forgetting_cycles,
        "leakage": operator.leakage.tolist(),
        "negative_mass": operator.negative_mass,
        "eigenvalues": [[eigenvalue.real, eigenvalue.imag] for eigenvalue in operator.eigenvalues],
        "survival": {str(k): [s, e] for k, s, e in zip(LONG, long.survival, long.error_estimate, strict=True)},
        "noise_replacement": operator.noise_replacement,
    }
    _draw(out / "attractor.png", operator, quiet, ensemble, estimate)
    write_function(out / "attractor.vtu", operator.quasi_stationary, "density")
    storage.write_json(out / "attractor.json", values)
    return values


def _draw(path, operator, quiet, ensemble, estimate):
    """Draw the attractor without noise, the leading mode, the eigenvalues, and survival by modes and by paths."""
    leading = operator.eigenvalues[0].real
    title = f"Noise blurs the attractor, and {100.0 * (1.0 - leading):.1f} % of the blocks on it overturn in each cycle"
    note = (
        "Main scene; the operator has white noise of equal Melnikov variance, D = "
        f"{ensemble.scene.noise.diffusion:.3g}."
    )
    with pictures.page(path, (11.0, 8.4), title, [note]) as figure:
        (first, second), (third, fourth) = figure.subplots(2, 2)
        first.plot(quiet.angle[0, FORGOTTEN:], quiet.velocity[0, FORGOTTEN:], ",", color=pictures.COLOURS[0], alpha=0.6)
        first.set(title=f"(a) Without noise: {quiet.cycles - FORGOTTEN:,} cycles of one block", **_STATE)
        limit = {"xlim": (-np.pi / 2, np.pi / 2), "ylim": (-0.8, 1.9)}
        first.set(**limit)
        # Means over small bins: near x = 0 the density is singular, and its polynomials swing about it.
        edges = np.linspace(*limit["xlim"], 141), np.linspace(*limit["ylim"], 141)
        density = operator.quasi_stationary.bin_probabilities(*edges) / np.multiply.outer(*map(np.diff, edges))
        shade = PowerNorm(0.5, 0.0, density.max())
        image = second.pcolormesh(*edges, np.maximum(density, 0.0).T, cmap="viridis", norm=shade, rasterized=True)
        figure.colorbar(image, ax=second, label="density, nondimensional")
        second.set(title="(b) With noise: quasi-stationary density", **_STATE, **limit)
        second.grid(visible=False)
        circle = np.exp(1j * np.linspace(0.0, 2.0 * np.pi, 300))
        third.plot(circle.real, circle.imag, color="#999999", linewidth=0.8)
        third.plot(operator.eigenvalues.real, operator.eigenvalues.imag, "o", color=pictures.COLOURS[1])
        look = {"ha": "right", "arrowprops": {"arrowstyle": "-", "color": "#777777", "shrinkB": 4.0}}
        pictures.named(third, f"{leading:.3f}: share that stands", (leading, 0.0), "black", (-30.0, 45.0), **look)
        third.set(
            title="(c) Leading eigenvalues of a cycle, unit circle",
            xlabel="real part",
            ylabel="imaginary part",
            aspect="equal",
        )
        fourth.plot(estimate.cycles, estimate.survival, color=pictures.COLOURS[0], label="one-cycle operator")
        rows = np.arange(5, ensemble.cycles + 1, 5)
        interval = ensemble.survival_interval()[rows]
        look = {"color": pictures.COLOURS[1], "marker": "o", "linestyle": "none", "markersize": 4}
        label = f"Monte Carlo of white noise, {ensemble.realizations:,} realizations"
        pictures.error_bars(fourth, rows, ensemble.survival[rows], interval, label=label, **look)
        fourth.set(title="(d) Survival from rest, 95 % intervals", xlabel="forcing cycles", ylabel="P(not overturned)")
        fourth.set_yscale("log")
        fourth.legend()


def report(values):
    """Print the long run."""
    print(f"Escape rate {values['escape_rate']:.6f} a cycle, relative error estimate {values['escape_error']:.1e}")
    print(f"Mean index (from 1) of the cycle of overturning {values['mean_cycles']:.2f}")
    print(f"A start is forgotten by a factor e in {values['forgetting_cycles']:.2f} cycles")
    for cycles, (survival, error) in values["survival"].items():
        print(f"S({cycles}) = {survival:.6g} ± {error:.1e}")


if __name__ == "__main__":
    command(
        run,
        "results/attractor",
        "attractor.png",
        "attractor.vtu",
        "attractor.json",
        report=report,
        tol="of the operator",
        realizations="of the ensemble",
    )
