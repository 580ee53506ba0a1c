"""Escape rates at low noise, to 1e-10 a cycle.

As noise falls the rate of overturning falls like exp(-V/D). At A = 3 the block without noise follows an orbit of one
cycle, far from overturning, and at D = 0.00095 a block stands for some 10¹⁰ cycles. The one-cycle operator has the rate
from what leaves its quasi-stationary density; a mesh that is too coarse has negative parts in the tails, and the rate
is then wrong in size or sign. The second panel shows the rate on every mesh against that on the finest: where the mesh
no longer sets it, the curves are flat. Adaptive multilevel splitting, which knows no mesh, starts on the orbit; its
rate is that between the fourth and the twelfth cycle.

Source: the scene and the methods are this project's (docs/theory.md, docs/monte_carlo.md).

Run time: about three minutes on 2 cores, once the kernels are compiled.

    python cases/low_noise.py --out results/low_noise

Files: ``low_noise.png``, ``low_noise.json``.
"""

import math
import time

import numpy as np
from command import command

from fpk_rocking import CycleOperator, NoNoise, WhiteNoise, load_scene
from fpk_rocking.results import pictures, storage
from montecarlo import simulate, split

AMPLITUDE = 3.0
DIFFUSIONS = (0.006, 0.004, 0.003, 0.002, 0.0014, 0.00095)
SPLIT = {0.006: 1000, 0.003: 1000, 0.002: 1000, 0.0014: 2000}
BETWEEN = 4, 12
REPEATS = 20


def run(out, diffusions=DIFFUSIONS, walkers=SPLIT, tol=0.035, seed=1) -> dict:
    """Compute, draw and write everything.

    Parameters
    ----------
    out : pathlib.Path
        Folder for the files; created if missing.
    diffusions : sequence of float
        D of the white noise, descending, nondimensional.
    walkers : dict of float to int
        Diffusions for which paths are split, and walkers of a repeat.
    tol : float
        Of the operators: the relative error of the rate is wanted to exp(1) tol.
    seed : int
        Of the splitting.

    Returns
    -------
    dict
        What ``low_noise.json`` holds.
    """
    scene = load_scene("main").varied(forcing={"amplitude": AMPLITUDE})
    rows = []
    for diffusion in diffusions:
        begin = time.perf_counter()
        operator = CycleOperator(scene.varied(noise=WhiteNoise(diffusion)), tol=tol)
        rows.append(
            {
                "diffusion": diffusion, "escape_rate": operator.escape_rate, "escape_error": operator.escape_error,
                "refinement": operator.refinement, "negative_mass": operator.negative_mass,
                "truncated": operator.truncated, "wall_s": time.perf_counter() - begin,
            }
        )  # fmt: skip
    quiet = simulate(scene.varied(noise=NoNoise()), cycles=400, realizations=1)
    orbit = {"angle": float(quiet.angle[0, -1]), "velocity": float(quiet.velocity[0, -1])}
    sampled = [
        _split(scene.varied(noise=WhiteNoise(diffusion), start=orbit), count, seed)
        for diffusion, count in walkers.items()
    ]
    values = {"scene": scene.to_toml(), "orbit": orbit, "tol": tol, "operator": rows, "splitting": sampled}
    draw(out / "low_noise.png", values)
    storage.write_json(out / "low_noise.json", values)
    return values


def _split(scene, walkers, seed):
    """Rate of overturning per cycle of a scene between the cycles `BETWEEN`, and its standard error over repeats."""
    splitting = split(scene, cycles=BETWEEN[1], walkers=walkers, repeats=REPEATS, seed=seed)
    before, after = (splitting.repeat_probability[:, cycle] for cycle in BETWEEN)
    rates = (after - before) / np.diff(BETWEEN)
    return {
        "diffusion": scene.noise.diffusion, "walkers": walkers, "repeats": REPEATS, "rate": float(rates.mean()),
        "standard_error": float(rates.std(ddof=1) / math.sqrt(REPEATS)), "skewed": splitting.skewed,
        "wall_s": splitting.wall_s,
    }  # fmt: skip


def draw(path, values):
    """Draw what the JSON file holds."""
    rows, sampled = values["operator"], values["splitting"]
    note = (
        "Main scene with A = 3, white noise of diffusion D. Bars: error estimates of the operator, refined to "
        f"{100 * math.e * values['tol']:.1f} %; two standard errors of the splitting, {REPEATS} repeats."
    )
    title = (
        f"Two methods agree on escape rates down to {min(row['rate'] for row in sampled):.0e} a cycle; the operator "
        f"reaches {min(row['escape_rate'] for row in rows):.0e}"
    )
    with pictures.page(path, (11.0, 5.6), title, [note]) as figure:
        left, right = figure.subplots(1, 2)
        rate = np.array([row["escape_rate"] for row in rows])
        error = rate * [row["escape_error"] for row in rows]
        inverse = [1.0 / row["diffusion"] for row in rows]
        look = {"marker": "o", "color": pictures.COLOURS[0], "capsize": 2}
        left.errorbar(inverse, rate, error, **look, label="one-cycle operator")
        columns = [[row[name] for row in sampled] for name in ("diffusion", "rate", "standard_error")]
        columns = 1.0 / np.array(columns[0]), columns[1], 2.0 * np.array(columns[2])
        look = {"fmt": "s", "markersize": 9, "color": pictures.COLOURS[1], "markerfacecolor": "none", "capsize": 2}
        left.errorbar(*columns, **look, label="multilevel splitting")
        left.set(yscale="log", xlabel="1 / D, nondimensional", ylabel="escape rate per cycle")
        left.set_title("(a) Rate of two methods")
        left.legend(loc="lower left")
        for row, colour in zip(rows, pictures.shades(len(rows)), strict=True):
            unknowns, rates = np.array(row["refinement"][-3:]).T
            ratio = rates / rates[-1]
            right.plot(unknowns, ratio, "o-", color=colour)
            pictures.named(
                right,
                f"{row['diffusion']:g}",
                (unknowns[0], ratio[0]),
                colour,
                offset=(0.0, 8.0 if ratio[0] > 1.0 else -15.0),
                ha="center",
            )
        right.set(xscale="log", xlabel="unknowns of the mesh", ylabel="rate / rate on the finest")
        right.margins(x=0.08, y=0.12)
        right.set_title("(b) The last three meshes, by D")


def report(values):
    """Print the rates."""
    for row in values["operator"]:
        meshes = ", ".join(f"{rate:.3g} ({unknowns:,})" for unknowns, rate in row["refinement"])
        print(f"D = {row['diffusion']:<7g} rate {row['escape_rate']:.4g} ± {100 * row['escape_error']:.1f} % "
              f"({row['wall_s']:.0f} s); meshes {meshes}")  # fmt: skip
    for row in values["splitting"]:
        rate = f"{row['rate']:.3g} ± {row['standard_error']:.1g}"
        print(f"D = {row['diffusion']:<7g} splitting {rate} ({row['wall_s']:.0f} s)")


if __name__ == "__main__":
    command(run, "results/low_noise", "low_noise.png", "low_noise.json", report=report, tol="of the operators")
