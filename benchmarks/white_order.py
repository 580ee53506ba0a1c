"""Weak error of the white-noise paths against their shortest step, and what is left of it at the default.

The shortest step, T/(256 steps_per_cycle), decides about the bias of the method, so it is measured with shortest steps
far longer than any that `simulate` takes, and followed down.

First where the truth is known: an unforced block, folded a bouncing ball with noise, which rattles at speeds of about
2 D/(1 - e) for ever. Its energy balance (1 - e^2) M_3/2 = D, with M_3 the sum per time of the squared impact speeds, is
off by the error of the method alone; once by steps alone, whose order it tells, and once with low bounces in one draw
each, as `simulate` has them. Then survival and moments of the main and the second scene with m shortest steps a
cycle. Where the error at the first m is significant, S(m) = S + c m^-p is fitted. The bias at the default is what is
left of the difference at m = 256 if it falls with the first order from there on. Writes its section of
docs/benchmarks.md.

    python benchmarks/white_order.py            # 1 to 2 minutes
    python benchmarks/white_order.py 4000000    # paths a row, printed only
"""

import contextlib
import itertools
import math
import sys

import numpy as np
from report import ROOT, table, write_section
from scipy.optimize import curve_fit

from fpk_rocking.scene import Block, Harmonic, Scene, WhiteNoise, load_scene
from montecarlo import histories
from montecarlo.engines import batches, white
from montecarlo.tuning import TUNING

SCENES = ROOT / "cases" / "scenes"
PATHS = 200_000
STEPS = 200
DEFAULT = TUNING.finest_step * STEPS
COARSE = (64, 128, 256, 512, 1024)
REFERENCE = 256
CYCLES = (2, 10)
NAMES = ("S", "⟨x⟩", "⟨v⟩", "⟨x²⟩", "⟨v²⟩")


@contextlib.contextmanager
def shortest_steps(per_cycle, brief=TUNING.bounce_time):
    """Let the engine's shortest step be a cycle over `per_cycle`, and bounces as brief as `brief` one draw each."""
    white.TUNING = TUNING._replace(finest_step=per_cycle / STEPS, bounce_time=brief)
    try:
        yield
    finally:
        white.TUNING = TUNING


def balance(restitution, diffusion, step, paths, brief, seed=1, duration=16.0):
    """Return the relative error of the energy balance and its standard error, after a time of 1 for the start."""
    scene = Scene(Block(restitution), Harmonic(0.0, 2.0 * math.pi / duration), WhiteNoise(diffusion))
    with shortest_steps(duration / step, brief):
        run = histories(scene, cycles=1, realizations=paths, seed=seed, samples_per_cycle=1)
    late = run.impact_time > 1.0
    sums = np.bincount(run.impact_realization[late], run.impact_velocity[late] ** 2, minlength=paths)
    errors = (1.0 - restitution**2) * sums / (2.0 * diffusion * (duration - 1.0)) - 1.0
    return errors.mean(), errors.std() / math.sqrt(paths)


def survival_and_moments(scene, per_cycle, paths):
    """Return survival and moments of the standing paths, and their standard errors, each (cycles + 1, 5)."""
    sums, squares = np.zeros((2, max(CYCLES) + 1, len(NAMES)))
    run = batches.checked_run(scene, max(CYCLES), paths, per_cycle, "white", STEPS)
    with shortest_steps(per_cycle):
        for batch in batches.simulate_batches(run):
            standing = np.isfinite(batch.angle)
            x, v = np.where(standing, batch.angle, 0.0), np.where(standing, batch.velocity, 0.0)
            for i, values in enumerate((standing.astype(float), x, v, x * x, v * v)):
                sums[:, i] += values.sum(axis=0)
                squares[:, i] += np.square(values).sum(axis=0)
    mean = sums / paths
    return mean, np.sqrt((squares / paths - mean**2) / paths)


def order(rows):
    """Return the fitted order and its standard error of values (m, mean, error); nan where nothing is significant."""
    m, values, errors = np.array(rows).T
    if abs(values[0] - values[-1]) < 8.0 * math.hypot(errors[0], errors[-1]):
        return math.nan, math.nan

    def law(m, limit, factor, order):
        """Value at m shortest steps a cycle, by a limit, a factor and an order."""
        return limit + factor * m**-order

    guess = values[-1], (values[0] - values[-1]) * m[0], 1.0
    fitted, spread = curve_fit(law, m, values, guess, errors, absolute_sigma=True)
    return fitted[2], math.sqrt(spread[2, 2])


def balance_table(paths):
    """Table of the error of the energy balance by shortest step, with the order fitted to each block's."""
    lines = []
    for (restitution, diffusion), brief in itertools.product(((0.5, 0.01), (0.7, 0.005)), (0.0, TUNING.bounce_time)):
        steps, fitted = 2.0 ** -np.arange(7, 11), "-"
        balances = [balance(restitution, diffusion, step, paths, brief) for step in steps]
        error, noise = np.array(balances).T
        if brief == 0.0:
            slope, spread = np.polyfit(np.log(steps), np.log(error), 1, w=error / noise, cov="unscaled")
            fitted = f"{slope[0]:.2f} ± {math.sqrt(spread[0, 0]):.2f}"
        cells = [f"{mean:.4f} ± {own:.4f}" for mean, own in balances]
        lines.append([restitution, diffusion, "one draw" if brief else "steps", *cells, fitted])
    return table(["e", "D", "low bounces", *(f"h = 1/{2**k}" for k in range(7, 11)), "order"], lines)


def scene_table(scene, paths):
    """Table of survival and moments by shortest step, and the largest bias at the default with its standard error."""
    figures = {m: survival_and_moments(scene, m, paths) for m in (*COARSE, DEFAULT)}
    share, worst, lines = REFERENCE / (DEFAULT - REFERENCE), (0.0, 0.0), []
    for cycle, i in itertools.product(CYCLES, range(len(NAMES))):
        rows = [(m, mean[cycle, i], error[cycle, i]) for m, (mean, error) in figures.items()]
        best, noise = rows[-1][1:]
        if noise == 0.0:
            continue
        differences = {m: 1e4 * np.array([value - best, math.hypot(error, noise)]) for m, value, error in rows[:-1]}
        bias = share * differences[REFERENCE]
        worst = max(worst, tuple(np.abs(bias)))
        apart = [f"{value:.1f} ± {error:.1f}" for value, error in differences.values()]
        fit = "-" if math.isnan(order(rows)[0]) else "{:.2f} ± {:.2f}".format(*order(rows))
        lines.append([NAMES[i], cycle, f"{best:.4f} ± {noise:.4f}", *apart, fit, f"{bias[0]:.2f} ± {bias[1]:.2f}"])
    return table(["", "cycle", f"m = {DEFAULT:,}", *map(str, COARSE), "order", "bias"], lines), worst


def main():
    """Measure, and write the section or print."""
    paths = int(sys.argv[1]) if len(sys.argv) > 1 else PATHS
    few = max(1000, paths // 50)
    parts, biases = [], []
    for name in ("second", "main"):
        lines, worst = scene_table(load_scene(SCENES / f"{name}.toml").white_equivalent(), paths)
        bias = f"{worst[0]:.2f} ± {worst[1]:.2f}"
        biases.append(f"{bias} in the {name} scene")
        parts.append(f"**The {name} scene**, {paths:,} paths.\n\n{lines}")
    text = f"""**Result.** The largest bias at the default step, in units of 1e-4: {", ".join(biases)}.

White-noise paths take steps that shorten near an impact. The bias of survival and moments comes from the shortest one,
a cycle over m. It is measured with steps far longer than any that `simulate` allows, down to the default, m =
{DEFAULT:,}. The tables give differences from the default in 1e-4; S is survival, and ⟨ ⟩ are means in which a path that
has overturned counts as 0. The bias of the default is what is left of the difference at m = {REFERENCE} if it falls
with the first order from there on. Orders are fitted where the first difference is 8 standard errors or more.

**Energy balance** of an unforced block that rattles for ever: (1 - e²) n [w²] / 2 = D, with n the number of impacts in
a unit of time and [w²] the mean square of their speeds. The table gives its relative error by shortest step h, from
{few:,} paths: with steps alone, and with each low bounce as one draw, as the engine has it.

{balance_table(few)}

{(chr(10) * 2).join(parts)}
"""
    if paths == PATHS:
        write_section("White-noise paths: order of the time step", text)
    else:
        print(text)


if __name__ == "__main__":
    main()
