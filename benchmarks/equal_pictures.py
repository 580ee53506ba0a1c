"""The pictures of `equal_error.py`: error against time, and time against noise and cycles."""

import numpy as np
from density import CYCLES

from fpk_rocking.output import style

WHITE_ERROR = 0.01  # L1 in bins of 0.1 to which the time of Monte Carlo is given


def draw_errors(path, found):
    """Errors against seconds: the solver's measured, sampling as lines from the measured rate."""
    with style.page(path, (11.0, 5.0), f"Main scene, {CYCLES} cycles: error against time") as figure:
        axes = figure.subplots(1, 3)
        kinds = (("survival", "largest error in survival"), ("coarse", "L1 error of the density, bins of 0.1"),
                 ("fine", "L1 error of the density, bins of 0.025"))  # fmt: skip
        marks = {
            "solver": ("D", "-", "density solver, estimating its error"),
            "alone": ("x", "none", "density solver on one mesh, no estimate"),
        }
        for ax, (kind, label) in zip(axes, kinds, strict=True):
            floor = found["truth"].unsure[kind]
            for part, (mark, line, name) in marks.items():
                seconds, errors = (np.array([row[v] for row in found[part].values()]) for v in ("seconds", kind))
                known = errors > floor
                ax.plot(seconds, np.maximum(errors, floor), linestyle=line, color="black")
                ax.plot(seconds[known], errors[known], mark, linestyle="none", color="black")
                ax.plot(seconds[~known], np.full(np.count_nonzero(~known), floor), "v", color="black", markersize=7)
                ax.plot([], [], mark, linestyle=line, color="black", label=name)
            for (method, rate), colour in zip(found["rates"].items(), (*style.COLOURS[:3], "#66c2a5"), strict=False):
                counts = np.geomspace(1e4, 1e9, 20)
                errors = [found["truth"].sampled(count)[kind] for count in counts]
                ax.plot(counts * rate, errors, color=colour, label=f"Monte Carlo {method}")
            ax.plot(
                found["baseline"]["seconds"], found["baseline"][kind], "s", color="#777777", label="Eulerian solver"
            )
            ax.axhline(floor, color="#777777", ls=":", lw=1.0, label="uncertainty of the reference")
            ax.plot([], [], "v", color="black", markersize=7, label="an error below that line")
            limits = {"xlim": (0.05, 5000.0), "ylim": (0.5 * floor, None)}
            ax.set(xscale="log", yscale="log", xlabel="seconds", ylabel=label, **limits)
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=8)


def draw_growth(path, noise, horizon, tol):
    """Seconds as the noise falls, for both engines to the same error, and as the horizon grows."""
    note = (
        "(a) Both to the same L1 error in bins of 0.1: that which the density solver estimates for itself. Open: it "
        "warns that it misses its tolerance."
    )
    with style.page(path, (9.0, 4.8), f"Main scene, tol {tol:g}: time of the density solver", [note]) as figure:
        left, right = figure.subplots(1, 2)
        diffusions = np.array([row["diffusion"] for row in noise])
        warned = np.array([row["warned"] for row in noise])
        seconds = np.array([row["seconds"] for row in noise])
        sampled = [row["white"] * (WHITE_ERROR / row["bins_estimate"]) ** 2 for row in noise]
        left.plot(diffusions, seconds, "-", color="black")
        left.plot(diffusions[~warned], seconds[~warned], "D", color="black")
        left.plot(diffusions[warned], seconds[warned], "D", color="black", markerfacecolor="white")
        left.plot(diffusions, sampled, "o-", color=style.COLOURS[0])
        style.named(left, "density solver", (diffusions[-1], seconds[-1]), "black", offset=(8.0, 4.0))
        style.named(left, "Monte Carlo", (diffusions[-1], sampled[-1]), style.COLOURS[0], offset=(8.0, -8.0))
        left.set(xscale="log", yscale="log", xlabel="diffusion D of the noise", ylabel="seconds")
        left.set_title(f"(a) {CYCLES} cycles, against the noise")
        *steps, operator = horizon
        last = steps[-1]
        right.plot([row["cycles"] for row in steps], [row["seconds"] for row in steps], "D-", color="black")
        right.axhline(operator["seconds"], color=style.COLOURS[1])
        place = last["cycles"], last["seconds"]
        style.named(right, "density solver, cycle by cycle", place, "black", offset=(-10.0, -3.0), ha="right")
        place = last["cycles"], operator["seconds"]
        style.named(right, "one-cycle operator, any number", place, style.COLOURS[1], offset=(0.0, -14.0), ha="right")
        right.set(xlabel="forcing cycles", ylabel="seconds", xlim=(0.0, None), ylim=(0.0, None))
        right.set_title("(b) D = 0.00628, against the horizon")
