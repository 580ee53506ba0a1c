"""The pictures of `equal_error.py`: error against time, and time against noise and cycles."""

import numpy as np
from density import CYCLES

from fpk_rocking.results import pictures

WHITE_ERROR = 0.01  # L1 in bins of 0.1 to which the time of Monte Carlo is given


def draw_errors(path, figures):
    """Errors that are certified against seconds, and beside them measured ones; sampling as lines.

    Parameters
    ----------
    path : path
        Picture to write.
    figures : dict
        What the JSON file of the section holds of a scene.
    """
    (first, others), (second, also) = (
        _certified(figures["equal"], target) for target in ("L1 = 0.01, bins of .1", "dS = 5e-4")
    )
    title = (
        f"To certify an L1 error of 0.01 takes the density solver {first:.2g} s, the fastest sampler {others:.2g} s; "
        f"5e-4 in survival {second:.2g} s and {also:.2g} s"
    )
    note = (
        f"{CYCLES} cycles of the main scene. Lines: expected error of a sample, extrapolated (white: the density's "
        "noise; exact, rk4: band noise). Measured errors below the dotted line are drawn on it."
    )
    with pictures.page(path, (10.0, 5.0), title, [note]) as figure:
        panels = figure.subplots(1, 2)
        for axes, (kind, (name, target)) in zip(panels, SHOWN.items(), strict=True):
            _errors(axes, figures, kind, target)
            axes.set(xscale="log", yscale="log", xlabel="seconds", ylabel=name, xlim=(0.05, 5000.0))
            axes.set_ylim(bottom=0.5 * figures["unsure"][kind])
        named = list(zip(*panels[0].get_legend_handles_labels(), strict=True))
        for axes, sampled in zip(panels, (False, True), strict=True):
            own = [pair for pair in named if pair[1].startswith("Monte Carlo") == sampled]
            axes.legend(*zip(*own, strict=True), loc="upper right", fontsize=8)


SHOWN = {
    "survival": ("largest error in survival", "dS = 1e-4"),
    "coarse": ("L1 error of the density, bins of 0.1", "L1 = 0.01, bins of .1"),
}
TARGETS = {"dS = 1e-4": 1e-4, "L1 = 0.01, bins of .1": 0.01}


def _certified(equal, target):
    """Return the seconds that the density solver and the fastest sampler take to certify an error."""
    (row,) = (entry for entry in equal if entry["target"] == target)
    return row["certified"]["seconds"], min(row[method] for method in ("white", "exact", "rk4"))


def _errors(axes, figures, kind, target):
    """Draw the errors of one kind, those of samplers through the time in which they meet a target."""
    floor, seconds = figures["unsure"][kind], [row["seconds"] for row in figures["solver"].values()]
    certified = [row["certified"][kind] for row in figures["solver"].values()]
    axes.plot(seconds, certified, "D-", color="black", label="density solver, error it certifies")
    for part, mark, name in (
        ("solver", "D", "the same, measured error"),
        ("alone", "x", "on one mesh, measured error"),
    ):
        errors = [max(row[kind], floor) for row in figures[part].values()]
        times = [row["seconds"] for row in figures[part].values()]
        axes.plot(times, errors, mark, linestyle="none", color="black", markerfacecolor="white", label=name)
    (row,) = (entry for entry in figures["equal"] if entry["target"] == target)
    for method, colour in zip(figures["rates"], (*pictures.COLOURS[:3], "#66c2a5"), strict=False):
        times = np.geomspace(1e4, 1e9, 2) * figures["rates"][method]
        # The error of a sample falls with the square root of its time.
        errors = TARGETS[target] * np.sqrt(row[method] / times)
        axes.plot(times, errors, color=colour, label=f"Monte Carlo {method}")
    axes.plot(figures["baseline"]["seconds"], figures["baseline"][kind], "s", color="#777777", label="Eulerian solver")
    axes.axhline(floor, color="#777777", ls=":", lw=1.0, label="uncertainty of the reference")


def draw_growth(path, noise, horizon, tol):
    """Seconds as the noise falls, for both engines to the same error, and as the horizon grows.

    `noise` and `horizon` are rows of the JSON file of the section, `tol` is the tolerance of the density solver.
    """
    note = (
        f"Main scene, tol {tol:g}. (a) Both to the same L1 error in bins of 0.1: that which the density solver "
        "estimates."
    )
    diffusions, warned, seconds = (
        np.array([row[name] for row in noise]) for name in ("diffusion", "warned", "seconds")
    )
    note += " Open: it warns that it misses its tolerance." * bool(warned.any())
    sampled = np.array([row["white"] * (WHITE_ERROR / row["bins_estimate"]) ** 2 for row in noise])
    faster = diffusions[(seconds < sampled) & ~warned]
    *steps, operator = horizon
    pays = np.interp(operator["seconds"], *([row[name] for row in steps] for name in ("seconds", "cycles")))
    title = (
        f"The density solver is faster than paths for D from {faster.min():g} to {faster.max():g}, the one-cycle "
        f"operator faster from {pays:.0f} cycles"
    )
    with pictures.page(path, (10.0, 4.8), title, [note]) as figure:
        left, right = figure.subplots(1, 2)
        left.plot(diffusions, seconds, "-", color="black")
        left.plot(diffusions[~warned], seconds[~warned], "D", color="black")
        left.plot(diffusions[warned], seconds[warned], "D", color="black", markerfacecolor="white")
        left.plot(diffusions, sampled, "o-", color=pictures.COLOURS[0])
        pictures.named(left, "density solver", (diffusions[-1], seconds[-1]), "black", offset=(8.0, 4.0))
        place = diffusions[sampled.argmax()], sampled.max()
        pictures.named(left, "Monte Carlo", place, pictures.COLOURS[0], offset=(0.0, 8.0), ha="center")
        left.set(xscale="log", yscale="log", xlabel="diffusion D of the noise, nondimensional", ylabel="seconds")
        left.set_title(f"(a) {CYCLES} cycles, against the noise")
        last = steps[-1]
        right.plot([row["cycles"] for row in steps], [row["seconds"] for row in steps], "D-", color="black")
        right.axhline(operator["seconds"], color=pictures.COLOURS[1])
        place = last["cycles"], last["seconds"]
        pictures.named(right, "density solver, cycle by cycle", place, "black", offset=(-10.0, -3.0), ha="right")
        place = last["cycles"], operator["seconds"]
        pictures.named(
            right, "one-cycle operator, any number", place, pictures.COLOURS[1], offset=(0.0, -14.0), ha="right"
        )
        right.set(xlabel="forcing cycles", ylabel="seconds", xlim=(0.0, None), ylim=(0.0, None))
        right.set_title("(b) D = 0.00628, against the horizon")
