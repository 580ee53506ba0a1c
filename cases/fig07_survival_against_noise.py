"""Fig. 7: survival against the noise variance.

A block from rest with Ψ = 0 and the variance of the noise from 0 to 0.04. As in the paper each probability comes from
1,000 realizations, here with Wilson's intervals. Beside it stands the density after the same 200 cycles, by the modes
of its one-cycle operator, one operator a noise level: nothing is evolved over 200 cycles, and survival far below what
realizations can tell has an error estimate of its own. Without noise there is one motion, which the exact engine
follows. Monte Carlo with the white noise that the density assumes tells the error of the solver from that of replacing
noise of 100 harmonics by white noise, which 200 cycles multiply.

* (a) the fall of survival, and (b) the same on a logarithmic axis as far as the paper's last σ². A triangle in (b) is
  the upper end of the 95 % interval where no realization stands: survival is below it, and nothing more is known from
  them.
* (c) other noise bands.
* (d) other phases Ψ: π, that of the paper's Fig. 6, is the mirror image of 0, so that from rest survival is the same by
  symmetry; π/2 is not.

The axis is that of σ, for the fall is over in the first quarter of the paper's axis of σ². The paper's caption has the
variance up to 0.4, its text up to 0.04; the latter is taken.

Source: H. Lin and S. C. S. Yim, "Nonlinear rocking motions. I: Chaos under noisy periodic excitations", J. Eng. Mech.
122(8), 719-727, 1996, Fig. 7: (A, Ω, e, Ψ) = (4.6, 2.7, 0.5, 0).

Run time: about a minute and a half on 2 cores, most of it the densities: the less noise, the longer.

    python cases/fig07_survival_against_noise.py --out results/fig07

Files: ``fig07.png``, ``fig07.json``.
"""

import time

import numpy as np
from command import command

from fpk_rocking import CycleOperator, NoNoise, load_scene
from fpk_rocking.results import pictures, storage
from montecarlo import simulate, tally

VARIANCES = (0.0005, 0.001, 0.0015, 0.002, 0.003, 0.004, 0.005, 0.0075, 0.01, 0.0125, 0.015, 0.02, 0.025, 0.03, 0.04)
DENSITY_VARIANCES = (0.0025, 0.005, 0.0075, 0.01, 0.0125, 0.015, 0.02, 0.025, 0.03, 0.04)
BANDS = (5.0, 10.0, 20.0)
OURS = 10.0
PHASES = {"0 (the paper's)": 0.0, "π/2": np.pi / 2, "π": np.pi}
PHASE_VARIANCES = (0.001, 0.002, 0.003, 0.005, 0.0075, 0.01)
PHASE_TIMES = 20
WHITE_TIMES = 10
# By symmetry the third phase has the curve of the first: larger symbols, without a line.
_PHASE_LOOKS = (
    {"color": pictures.COLOURS[0]},
    {"color": pictures.COLOURS[1], "marker": "s"},
    {"color": "#555555", "marker": "D", "markersize": 9.0, "markerfacecolor": "none", "linestyle": "none"},
)
_REPLACEMENT = "The density solver has white noise of equal Melnikov variance: an approximation that paths judge."
_DEVIATION = "standard deviation of the noise σ, nondimensional"


def run(
    out, cycles=200, realizations=1000, variances=VARIANCES, density_variances=DENSITY_VARIANCES,
    phase_variances=PHASE_VARIANCES, tol=1e-2, seed=1,
) -> dict:  # fmt: skip
    """Compute, draw and write everything.

    Parameters
    ----------
    out : pathlib.Path
        Folder for the files; created if missing.
    cycles, realizations, seed : int
        Of each ensemble; those of white noise are ten times as large, those of other phases twenty times.
    variances, density_variances, phase_variances : sequence of float
        σ² of the ensembles, of the densities and of other phases, above 0, nondimensional.
    tol : float
        Of the one-cycle operators.

    Returns
    -------
    dict
        What ``fig07.json`` holds.
    """
    scene = load_scene("main").varied(forcing={"phase": 0.0})
    bands = {band: _ensembles(scene, band, variances, cycles, realizations, seed) for band in BANDS}
    by_phase = {name: scene.varied(forcing={"phase": phase}) for name, phase in PHASES.items()}
    phases = {
        name: _ensembles(at_phase, OURS, phase_variances, cycles, PHASE_TIMES * realizations, seed)
        for name, at_phase in by_phase.items()
    }
    stands = {name: _stands(at_phase.varied(noise=NoNoise()), cycles) for name, at_phase in by_phase.items()}
    white = [_white(scene, variance, cycles, WHITE_TIMES * realizations, seed) for variance in density_variances]
    densities = [_density(scene.varied(noise={"variance": variance}), cycles, tol) for variance in density_variances]
    values = {
        "figure": "Fig. 7 of Lin and Yim, J. Eng. Mech. 122(8), 1996",
        "scene": scene.to_toml(),
        "cycles": cycles,
        "realizations": realizations,
        "variances": list(variances),
        "bands": [{"band": [0.0, band]} | _plain(ensembles) for band, ensembles in bands.items()],
        "phase_variances": list(phase_variances),
        "phases": [
            {"phase": name, "stands_without_noise": stands[name]} | _plain(ensembles)
            for name, ensembles in phases.items()
        ],
        "stands_without_noise": next(iter(stands.values())),
        "density": [density | {"variance": v} for v, density in zip(density_variances, densities, strict=True)],
        "white": [
            {
                "variance": variance,
                "survival": float(sample.survival[-1]),
                "interval": sample.survival_interval()[-1].tolist(),
                "realizations": sample.realizations,
            }
            for variance, sample in zip(density_variances, white, strict=True)
        ],
        "remarks": [scene.noise.remark, _REPLACEMENT],
    }
    draw(out / "fig07.png", values)
    storage.write_json(out / "fig07.json", values)
    return values


def _density(scene, cycles, tol):
    """Survival by the one-cycle operator of a scene, with its error estimate."""
    begin = time.perf_counter()
    operator = CycleOperator(scene, tol=tol)
    estimate = operator.estimate_survival([cycles])
    return {
        "survival": float(estimate.survival[0]),
        "error_estimate": float(estimate.error_estimate[0]),
        "escape_rate": operator.escape_rate,
        "negative_mass": operator.negative_mass,
        "wall_s": time.perf_counter() - begin,
    }


def _stands(scene, cycles):
    """Whether the block without noise has not overturned."""
    return bool(simulate(scene, cycles=cycles, realizations=1).survivors[-1])


def _ensembles(scene, band, variances, cycles, realizations, seed):
    """Ensembles of a scene with band noise up to a frequency, one a variance."""
    scenes = [scene.varied(noise={"variance": variance, "band": (0.0, band)}) for variance in variances]
    return [simulate(noisy, cycles=cycles, realizations=realizations, seed=seed) for noisy in scenes]


def _white(scene, variance, cycles, realizations, seed):
    """Tally of a scene with the white noise that stands for band noise of a variance."""
    noisy = scene.varied(noise={"variance": variance}).white_equivalent()
    everywhere = {"angle_edges": [-2.0, 2.0], "velocity_edges": [-20.0, 20.0]}
    return tally(noisy, cycles=cycles, realizations=realizations, seed=seed, **everywhere)


def _plain(ensembles):
    """Survival after the last cycle, its interval, and the share of the right among the overturned, one a variance."""
    return {
        "survival": [float(ensemble.survival[-1]) for ensemble in ensembles],
        "interval": [ensemble.survival_interval()[-1].tolist() for ensemble in ensembles],
        "to_the_right": [
            float(ensemble.overturned[-1, 1] / max(ensemble.overturned[-1].sum(), 1e-300)) for ensemble in ensembles
        ],
    }


def draw(path, values):
    """Draw what the JSON file holds."""
    count, ours = values["realizations"], next(row for row in values["bands"] if row["band"][1] == OURS)
    half = np.interp(0.5, ours["survival"][::-1], np.sqrt(values["variances"])[::-1])
    last, end = (values["density"][-1][name] for name in ("variance", "survival"))
    title = (
        f"Paper Fig. 7: half of the blocks stand for {values['cycles']} cycles at σ = {half:.2g} of band "
        f"noise, {end:.0e} at {np.sqrt(last):g} of the white equivalent"
    )
    note = (
        f"Bars: 95 % intervals of {count:,} realizations of band noise, {PHASE_TIMES * count:,} in (d). The density "
        "has white noise of equal Melnikov variance. (d): by symmetry Ψ = 0 and π survive equally."
    )
    with pictures.page(path, (10.5, 10.0), title, [note]) as figure:
        (both, tail), (bands, phases) = figure.subplots(2, 2)
        _both(both, values)
        _both(tail, values, limits=True)
        both.set_title("(a) The paper's figure, and the density; symbols as in (b)")
        tail.set(title="(b) The same to the paper's last σ, logarithmic", yscale="log", ylim=(1e-10, 3.0))
        tail.legend(fontsize=9, loc="lower left")
        rows = {f"band [0, {row['band'][1]:g}]": row for row in reversed(values["bands"])}
        looks = (
            {"color": colour, "marker": marker} for colour, marker in zip(pictures.shades(3)[::-1], "Dso", strict=True)
        )
        _several(bands, values["variances"], rows, looks)
        bands.set_title("(c) Band noise, three bands")
        _several(phases, values["phase_variances"], {_phase_label(row): row for row in values["phases"]}, _PHASE_LOOKS)
        phases.set_title("(d) Three phases Ψ of the forcing")
        for axes in (both, tail, bands, phases):
            axes.set(xlabel=_DEVIATION, ylabel="P(not overturned)", xlim=(-0.004, 0.21))
        for axes in (both, bands, phases):
            axes.set_ylim(-0.02, 1.05)
        for axes in (both, phases):
            axes.set_xlim(-0.002, 0.118)


def _phase_label(row):
    """Label of a row of `phases`."""
    return f"Ψ = {row['phase']}" + ("" if row["stands_without_noise"] else ": overturns without noise too")


def _both(axes, values, limits=False):
    """Draw survival of paths and densities against σ, with upper limits where no path stands if `limits`."""
    ours = next(row for row in values["bands"] if row["band"][1] == OURS)
    look = {"color": pictures.COLOURS[1], "label": f"band noise, {values['realizations']:,} realizations"}
    _limited(axes, values["variances"], ours["survival"], ours["interval"], look, limits)
    white, densities = values["white"], values["density"]
    columns = ([row[name] for row in white] for name in ("variance", "survival", "interval"))
    label = f"white noise, {white[0]['realizations']:,} realizations"
    _limited(axes, *columns, {"color": pictures.COLOURS[2], "marker": "s", "label": label}, limits)
    if limits:
        axes.plot([], [], "v", color="#777777", markersize=5, label="no realization stands: 95 % upper limit")
    columns = ([row[name] for row in densities] for name in ("variance", "survival"))
    look = {"marker": "D", "markersize": 8.0, "markerfacecolor": "none", "linestyle": "none"}
    variances, survival = columns
    axes.plot(
        np.sqrt(variances), survival, color=pictures.COLOURS[0], label="Fokker-Planck density, white noise", **look
    )
    axes.plot(0.0, float(values["stands_without_noise"]), "*", color="black", markersize=11, label="no noise", zorder=3)


def _limited(axes, variances, survival, interval, look, limits):
    """Draw survival with its intervals where any realization stands, else, if wanted, the upper limit."""
    places, survival, interval = np.sqrt(variances), np.asarray(survival), np.asarray(interval)
    some = survival > 0.0
    pictures.error_bars(axes, places[some], survival[some], interval[some], **look)
    if limits:
        axes.plot(places[~some], interval[~some, 1], "v", color=look["color"], markersize=5)


def _several(axes, variances, rows, looks):
    """Draw survival of rows, by their labels, against σ, each with a look."""
    for (label, columns), look in zip(rows.items(), looks, strict=True):
        shape = {"linestyle": "-", "linewidth": 0.8, "label": label}
        pictures.error_bars(axes, np.sqrt(variances), columns["survival"], columns["interval"], **(shape | look))
    axes.legend(fontsize=9)


def report(values):
    """Print the survival."""
    for row, variance in enumerate(values["variances"]):
        bands = "".join(f"   [0, {curve['band'][1]:g}] {curve['survival'][row]:.3f}" for curve in values["bands"])
        print(f"σ² = {variance:<8g}{bands}")
    for density, white in zip(values["density"], values["white"], strict=True):
        beside = f"white Monte Carlo {white['survival']:.3g} ({white['interval'][0]:.3g} to {white['interval'][1]:.3g})"
        print(
            f"σ² = {density['variance']:<8g}   density {density['survival']:.3g} ({density['wall_s']:.1f} s), {beside}"
        )
    for row in values["phases"]:
        right = f"{100 * row['to_the_right'][-1]:.0f} % of the overturned to the right"
        print(f"Ψ = {row['phase']}: S {np.round(row['survival'], 4)}, {right} at the last σ²")
    print(f"Without noise: {'bounded' if values['stands_without_noise'] else 'overturned'}")


if __name__ == "__main__":
    command(
        run,
        "results/fig07",
        "fig07.png",
        "fig07.json",
        report=report,
        cycles="forcing cycles",
        realizations="of an ensemble",
        tol="tolerance of the operators",
        seed="of the ensembles",
    )
