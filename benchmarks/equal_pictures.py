"""The pictures of `equal_error.py`: error against time, and time against noise and cycles."""

import numpy as np
from density import CYCLES

from fpk_rocking.output import style


def draw_errors(path, found):
    """Errors against seconds: the solver's measured, sampling as lines from the measured rate."""
    with style.page(path, (11.0, 4.8), f"Main scene, {CYCLES} cycles: error against time") as figure:
        axes = figure.subplots(1, 3)
        kinds = (("survival", "largest error in survival"), ("coarse", "L1 of the density, bins of 0.1"),
                 ("fine", "L1 of the density, bins of 0.025"))  # fmt: skip
        marks = {"solver": ("D-", "black", "density solver, with estimate"), "alone": ("x", "black", "one run alone")}
        for ax, (kind, label) in zip(axes, kinds, strict=True):
            for part, (mark, colour, name) in marks.items():
                columns = [[row[value] for row in found[part].values()] for value in ("seconds", kind)]
                ax.plot(*columns, mark, color=colour, label=name)
            for (method, rate), colour in zip(found["rates"].items(), (*style.COLOURS[:3], "#66c2a5"), strict=False):
                counts = np.geomspace(1e4, 1e9, 20)
                errors = [found["truth"].sampled(count)[kind] for count in counts]
                ax.plot(counts * rate, errors, color=colour, label=f"Monte Carlo {method}")
            ax.plot(found["baseline"]["seconds"], found["baseline"][kind], "s", color="#777777", label="Eulerian")
            ax.axhline(found["truth"].unsure[kind], color="#777777", ls=":", lw=1.0, label="error of the truth")
            least = min(row[kind] for row in found["solver"].values())
            limits = {"xlim": (0.05, 5000.0), "ylim": (0.5 * min(least, found["truth"].unsure[kind]), None)}
            ax.set(xscale="log", yscale="log", xlabel="seconds", ylabel=label, **limits)
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=8)


def draw_growth(path, noise, horizon, tol):
    """Seconds as the noise falls and as the horizon grows."""
    with style.page(path, (9.0, 4.2), f"Main scene, tol {tol:g}: time of the density solver") as figure:
        left, right = figure.subplots(1, 2)
        diffusions = [row["diffusion"] for row in noise]
        left.plot(diffusions, [row["seconds"] for row in noise], "D-", color="black", label="density solver")
        left.plot(diffusions, [row["white"] for row in noise], color=style.COLOURS[0], label="white, to L1 = 0.01")
        left.set(xscale="log", xlabel="diffusion D", ylabel=f"seconds, {CYCLES} cycles", ylim=(0.0, None))
        left.legend()
        *steps, operator = horizon
        right.plot([row["cycles"] for row in steps], [row["seconds"] for row in steps], "D-", color="black",
                   label="density solver")  # fmt: skip
        right.axhline(operator["seconds"], color=style.COLOURS[1], label="one-cycle operator, any number")
        right.set(xlabel="cycles", ylabel="seconds", xlim=(0.0, None), ylim=(0.0, None))
        right.legend()
