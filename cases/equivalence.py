"""Where is the density solver's white noise trustworthy? Five bands, four numbers of harmonics, and an error budget.

The density solver replaces band noise by white noise with D = σ_M²/2. Here its survival is held against Shinozuka
Monte Carlo over bands, some of them without low frequencies, and over the number N of harmonics; for the first band
also its average over the diffusions of single realizations (`fpk_rocking.realizations`). There the difference is
divided into parts, each isolated by switching one thing:

* finite N: N = 100 against N = 1000,
* band: N = 1000 against white noise, both sampled,
* discretization: white noise, sampled, against the density solver,
* sampling: the standard error of the first.

Cover is the part of the Melnikov variance of white noise that a band takes in, (1/π) ∫ 4/(1+ω²)² dω over the band.

Source: the closure is eq. 15 of H. Lin and S. C. S. Yim, "Nonlinear rocking motions. I: Chaos under noisy periodic
excitations", J. Eng. Mech. 122(8), 719-727, 1996; the bands other than [0, 10] are this project's.

Run time: about a minute on 2 cores, once the kernels are compiled.

    python cases/equivalence.py --out results/equivalence

Files: ``equivalence.png``, ``equivalence.json``.
"""

import argparse
import math
import pathlib
import sys
import warnings

import numpy as np

from fpk_rocking import BandNoise, load_scene, melnikov, solve_fpk
from fpk_rocking.output import style, summary
from fpk_rocking.realizations import solve_realizations
from montecarlo import simulate

SCENE = pathlib.Path(__file__).parent / "scenes" / "main.toml"
NOISES = (((0.0, 10.0), 0.2), ((0.0, 2.7), 0.2), ((1.0, 6.0), 0.2), ((2.0, 10.0), 0.3), ((4.0, 10.0), 0.6))
HARMONICS = (10, 30, 100, 1000)
CYCLES = (4, 10, 20)


def cover(noise):
    """Part of the Melnikov variance of equally strong white noise that a band takes in."""
    low, high = noise.band
    return melnikov.noise_variance(noise) * (high - low) / (math.pi * noise.variance)


def run(out, noises=NOISES, harmonics=HARMONICS, realizations=50_000, tol=1e-2, seed=1, nodes=5) -> dict:
    """Compute, draw and write everything.

    Parameters
    ----------
    out : path
        Folder for the files; created if missing.
    noises : sequence of ((float, float), float)
        Bands and σ, nondimensional; the first is that of the error budget.
    harmonics : sequence of int
        Numbers N, ascending.
    realizations, seed : int
        Of each ensemble; ten times as many for the error budget.
    tol : float
        Of the density solver.
    nodes : int
        Diffusions that stand for the realizations.

    Returns
    -------
    dict
        What ``equivalence.json`` holds.
    """
    out, scene = pathlib.Path(out), load_scene(SCENE)
    rows = []
    for band, sigma in noises:
        counted = [scene.varied(noise=BandNoise(sigma * sigma, band, count)) for count in harmonics]
        white = _solved(solve_fpk, counted[0], tol)
        sampled = [simulate(one, cycles=max(CYCLES), realizations=realizations, seed=seed) for one in counted]
        several = [one for one in counted if one.noise.harmonics <= 100] if not rows else []
        averaged = [_solved(solve_realizations, one, 1e-2, nodes=nodes) for one in several]
        rows.append(
            {
                "band": band, "sigma": sigma, "cover": cover(counted[0].noise),
                "diffusion": melnikov.equivalent_diffusion(counted[0].noise), "harmonics": list(harmonics),
                "density": [float(white.survival[k]) for k in CYCLES],
                "sampled": [[float(one.survival[k]) for k in CYCLES] for one in sampled],
                "averaged": [[float(one.survival[k]) for k in CYCLES] for one in averaged],
            }
        )  # fmt: skip
    findings = {"cycles": CYCLES, "realizations": realizations, "bands": rows}
    findings["budget"] = budget(scene, noises[0], 10 * realizations, tol, seed)
    draw(out / "equivalence.png", findings)
    summary.write_summary(out / "equivalence.json", findings)
    return findings


def _solved(solve, scene, tol, **options):
    with warnings.catch_warnings():
        warnings.simplefilter(
            "ignore", RuntimeWarning
        )  # weak equivalent noise: its estimate stands in the error budget
        return solve(scene, cycles=max(CYCLES), tol=tol, **options)


def budget(scene, noise, realizations, tol, seed):
    """Divide the difference between 100 harmonics and the density solver: parts of S by name, at `CYCLES`."""
    (band, sigma), last = noise, max(CYCLES)
    few, many = (scene.varied(noise=BandNoise(sigma * sigma, band, count)) for count in (100, 1000))
    first = simulate(few, cycles=last, realizations=realizations, seed=seed).survival
    second = simulate(many, cycles=last, realizations=realizations, seed=seed + 1).survival
    third = simulate(few.white_equivalent(), cycles=last, realizations=realizations, seed=seed, method="white").survival
    ours = solve_fpk(few, cycles=last, tol=tol)
    error = np.sqrt(first * (1.0 - first) / realizations)
    parts = {
        "whole": first - ours.survival, "finite N": first - second, "band": second - third,
        "discretization": third - ours.survival, "standard error of each": error,
    }  # fmt: skip
    return {name: [float(part[k]) for k in CYCLES] for name, part in parts.items()} | {
        "error_estimate": ours.error_estimate,
        "realizations": realizations,
    }


def draw(path, findings):
    """Draw survival after 10 cycles by band and N, and the error budget."""
    rows, middle = findings["bands"], CYCLES.index(10)
    with style.drawing() as figure:
        made = figure(figsize=(12.0, 4.8), layout="constrained")
        left, right = made.subplots(1, 2, width_ratios=(1.6, 1.0))
        shades = style.shades(len(rows[0]["harmonics"]))
        for place, row in enumerate(rows):
            left.hlines(
                row["density"][middle], place - 0.4, place + 0.4, color="black", label="" if place else "density solver"
            )
            for k, (count, colour) in enumerate(zip(row["harmonics"], shades, strict=True)):
                x = place + 0.18 * (k - 1.5)
                value = row["sampled"][k][middle]
                error = 1.96 * math.sqrt(value * (1.0 - value) / findings["realizations"])
                left.errorbar(
                    x, value, error, fmt="o", ms=5, color=colour, label="" if place else f"Monte Carlo, N = {count}"
                )
                if k < len(row["averaged"]):
                    name = "" if place or k else "density solver, averaged over realizations"
                    left.plot(x, row["averaged"][k][middle], "x", ms=7, color=colour, label=name)
        labels = [
            f"[{row['band'][0]:g}, {row['band'][1]:g}]\nσ = {row['sigma']:g}\ncover {row['cover']:.2f}" for row in rows
        ]
        left.set_xticks(range(len(rows)), labels)
        left.set(
            xlabel="noise band, nondimensional",
            ylabel="survival after 10 cycles",
            ylim=(0.0, 1.0),
            title="White noise for band noise",
        )
        left.legend(fontsize=8, loc="lower right")
        names = ["whole", "finite N", "band", "discretization", "standard error of each"]
        for k, cycle in enumerate(CYCLES):
            right.barh(np.arange(5) + 0.25 * (1 - k), [findings["budget"][name][k] for name in names], 0.23,
                       color=style.COLOURS[k], label=f"after {cycle} cycles")  # fmt: skip
        right.set_yticks(range(5), names)
        right.invert_yaxis()
        right.set(
            xlabel="Monte Carlo less density solver, in survival",
            title="Error budget: [0, 10], σ = 0.2, N = 100",
        )
        right.legend(fontsize=8)
        style.save(made, path)


def main(arguments=None) -> int:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--out", type=pathlib.Path, default="results/equivalence", help="folder for the files (default %(default)s)"
    )
    findings = run(parser.parse_args(arguments).out)
    for row in findings["bands"]:
        print(
            row["band"],
            f"cover {row['cover']:.3f}",
            "density",
            row["density"],
            "sampled",
            row["sampled"],
            "averaged",
            row["averaged"],
        )
    print("budget", findings["budget"])
    return 0


if __name__ == "__main__":
    sys.exit(main())
