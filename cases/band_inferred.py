"""Which noise band did Lin and Yim (1996) use? What each of several bands would give, in a table; no choice is made.

The paper gives the variance of its noise and the number of its harmonics, but not their band. For bands [0, b] are
computed, with realizations of 100 harmonics and 95 % intervals,

* Fig. 6: survival of the main scene after 10, 20, 40, 60 and 200 cycles. The paper sees a leak at 10 cycles, hardly
  anything left at 60, and certain overturning at 200;
* Fig. 5(b): how many stand for 125 cycles and after how many half have overturned, for A = 4.2, the amplitude of its
  periodic motion, and for A = 4.6. The paper shows one realization that overturns after about 125 cycles;
* Fig. 7: the variance at which half of all overturn within 200 cycles, and that at which 99 % do;
* Fig. 9: the variance at which 1 % overturn within 200 cycles, taken for the onset.

Three statements can be put as a yes or no, with bounds of our own: "5b" that 125 cycles lie within the central 95 % of
the cycles of overturning at A = 4.2; "6" that at least a tenth has overturned after 10 cycles and at most a hundredth
stands after 60; "200" that at most one in a thousand stands after 200.

Source: H. Lin and S. C. S. Yim, "Nonlinear rocking motions. I: Chaos under noisy periodic excitations", J. Eng. Mech.
122(8), 719-727, 1996.

Run time: about half a minute on 2 cores, once the kernels are compiled.

    python cases/band_inferred.py --out results/band

Files: ``band.png``, ``band.json``.
"""

import argparse
import pathlib
import sys

import numpy as np
from rich import box
from rich.table import Table

from fpk_rocking import load_scene, melnikov
from fpk_rocking.output import style, summary, tables
from fpk_rocking.output.intervals import error_bars
from montecarlo import simulate

SCENES = pathlib.Path(__file__).parent / "scenes"
BANDS = (2.7, 5.0, 7.5, 10.0, 12.5, 15.0, 20.0, 30.0)
VARIANCES = (0.00025, 0.0005, 0.001, 0.0015, 0.002, 0.003, 0.004, 0.006, 0.01, 0.015, 0.02, 0.03, 0.04)
CYCLES = (10, 20, 40, 60, 200)
SHARES = (0.99, 0.5, 0.01)
LATE = 125


def run(out, bands=BANDS, variances=VARIANCES, realizations=50_000, fall_realizations=2000, seed=1) -> dict:
    """Compute, draw and write everything.

    Parameters
    ----------
    out : path
        Folder for the files; created if missing.
    bands : sequence of float
        Highest frequencies; each band begins at 0.
    variances : sequence of float
        σ² of the fall, ascending, nondimensional.
    realizations, fall_realizations, seed : int
        Of each ensemble of 200 cycles, and of each that tells the fall.

    Returns
    -------
    dict
        What ``band.json`` holds: one row a band.
    """
    out = pathlib.Path(out)
    main_scene, periodic = (load_scene(SCENES / name) for name in ("main.toml", "fig05.toml"))
    rows = []
    for band in bands:
        varied = [one.varied(noise={"band": (0.0, band)}) for one in (main_scene, periodic)]
        chaotic, late = (simulate(one, cycles=CYCLES[-1], realizations=realizations, seed=seed) for one in varied)
        fall = _fall(varied[0], variances, fall_realizations, seed)
        rows.append(_row(band, chaotic, late, fall, variances))
    values = {
        "scene": main_scene.to_toml(),
        "realizations": realizations,
        "fall_realizations": fall_realizations,
        "cycles": list(CYCLES),
        "variances": list(variances),
        "rows": rows,
    }
    _draw(out / "band.png", values)
    summary.write_summary(out / "band.json", values)
    return values


def _fall(scene, variances, realizations, seed):
    """Ensembles of 200 cycles, one a variance."""
    scenes = [scene.varied(noise={"variance": variance}) for variance in variances]
    return [simulate(one, cycles=CYCLES[-1], realizations=realizations, seed=seed) for one in scenes]


def _row(band, chaotic, late, fall, variances):
    noise = chaotic.scene.noise
    survival, gone_late = chaotic.survival, 1.0 - late.survival[LATE]
    at_200 = [float(one.survival[-1]) for one in fall]
    return {
        "band": [0.0, band],
        "melnikov_variance": float(melnikov.noise_variance(noise)),
        "diffusion": float(melnikov.equivalent_diffusion(noise)),
        "survival": chaotic.survival.tolist(),
        "interval": chaotic.survival_interval().tolist(),
        "late_survival": late.survival.tolist(),
        "late_interval": late.survival_interval().tolist(),
        "half_overturned_after": {"4.2": _half(late), "4.6": _half(chaotic)},
        "fall": at_200,
        "fall_interval": [one.survival_interval()[-1].tolist() for one in fall],
        "variance_at_survival": {str(share): _crossing(variances, at_200, share) for share in SHARES},
        "meets_5b": bool(0.025 <= gone_late <= 0.975),
        "meets_6": bool(survival[10] <= 0.9 and survival[60] <= 0.01),
        "meets_200": bool(survival[200] <= 0.001),
    }


def _half(ensemble):
    """First cycle after which at most half stand; None if more than half stand at the end."""
    few = ensemble.survival <= 0.5
    return int(np.argmax(few)) if few.any() else None


def _crossing(variances, survival, share):
    """Variance at which survival falls to a share, straight between two of the grid; None outside it."""
    below = np.flatnonzero(np.array(survival) <= share)
    if below.size == 0 or below[0] == 0:
        return None
    first = below[0]
    return float(np.interp(-share, -np.array(survival[first - 1 : first + 1]), variances[first - 1 : first + 1]))


def _draw(path, values):
    size = f"{values['realizations']:,} realizations above, {values['fall_realizations']:,} a point below"
    notes = [f"{size}; 100 harmonics. The paper states no band."]
    with style.page(path, (10.5, 9.0), "What each noise band would give", notes) as figure:
        panels = figure.subplot_mosaic([["main", "late"], ["fall", "fall"]])
        _survival(panels["main"], values, "survival", "interval", (10, 60))
        panels["main"].set_title("A = 4.6, σ² = 0.04; lines at 10 and 60 cycles")
        _survival(panels["late"], values, "late_survival", "late_interval", (LATE,))
        panels["late"].set_title(f"A = 4.2, σ² = 0.04; line at {LATE} cycles")
        for row, colour in _coloured(values):
            look = {"color": colour, "linestyle": "-", "linewidth": 0.8, "label": f"[0, {row['band'][1]:g}]"}
            error_bars(panels["fall"], values["variances"], row["fall"], row["fall_interval"], **look)
        panels["fall"].set(title="A = 4.6, after 200 cycles, 95 % intervals", xscale="log", ylim=(-0.02, 1.05))
        panels["fall"].set(xlabel="variance of the noise σ², nondimensional", ylabel="P(not overturned)")
        panels["fall"].legend(title="band", ncols=2)


def _coloured(values):
    return zip(values["rows"], style.shades(len(values["rows"])), strict=True)


def _survival(axes, values, name, interval, lines):
    for row, colour in _coloured(values):
        survival, limits = np.array(row[name]), np.array(row[interval])
        places = np.arange(0, survival.size, 20)[survival[::20] > 0.0]
        axes.plot(np.where(survival > 0.0, survival, np.nan), color=colour, linewidth=1.2)
        error_bars(axes, places, survival[places], limits[places], color=colour, markersize=3.0)
    for line in lines:
        axes.axvline(line, color="black", linewidth=0.8)
    axes.set(yscale="log", ylim=(0.5 / values["realizations"], 1.5), xlim=(0.0, CYCLES[-1]))
    axes.set(xlabel="forcing cycles", ylabel="P(not overturned)")


def table(values):
    """One column a band, as a table for the terminal."""
    rows = values["rows"]
    made = Table(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False, padding=(0, 1, 0, 0))
    made.add_column("band")
    for row in rows:
        made.add_column(f"[0, {row['band'][1]:g}]", justify="right")
    made.add_row("σ_M²", *(f"{row['melnikov_variance']:.4f}" for row in rows))
    for cycle in CYCLES:
        made.add_row(f"A = 4.6: S({cycle})", *(f"{row['survival'][cycle]:.4f}" for row in rows))
    for name, key in (("4.6", "survival"), ("4.2", "late_survival")):
        made.add_row(f"A = {name}: S({LATE})", *(f"{row[key][LATE]:.4f}" for row in rows))
        halves = (row["half_overturned_after"][name] for row in rows)
        made.add_row(f"A = {name}: half after", *(str(half or f"> {CYCLES[-1]}") for half in halves))
    for share in SHARES:
        falls = (row["variance_at_survival"][str(share)] for row in rows)
        made.add_row(f"σ² at S(200) = {share:g}", *("outside" if fall is None else f"{fall:.5f}" for fall in falls))
    for name in ("5b", "6", "200"):
        made.add_row(f'meets "{name}"', *("yes" if row[f"meets_{name}"] else "no" for row in rows))
    return made


def main() -> int:
    """Read the command line, run, print the table."""
    parser = argparse.ArgumentParser(description="What several noise bands would give.")
    parser.add_argument("--out", type=pathlib.Path, default="results/band", help="folder (default: %(default)s)")
    parser.add_argument("--realizations", type=int, default=50_000, help="of an ensemble (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="of the ensembles (default: %(default)s)")
    options = parser.parse_args()
    values = run(options.out, realizations=options.realizations, seed=options.seed)
    size = f"{values['realizations']:,} realizations, {values['fall_realizations']:,} for the variances"
    sentences = [f"S: survival after so many cycles, {size}. The half: cycles until half have overturned."]
    tables.show("What each noise band would give", table(values), sentences)
    print(f"Files in {options.out}: band.png, band.json")
    return 0


if __name__ == "__main__":
    sys.exit(main())
