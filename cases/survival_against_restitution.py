"""Survival against the restitution of impacts.

The main scene from rest with restitutions from 0.5 to 1, a study that Lin and Yim (1996) leave to their Part II. Shown
is the probability of standing after 10, 20 and 40 forcing cycles by Monte Carlo with Wilson's intervals and by the
density, (a) on linear and (b) on logarithmic axes; and (c) survival after 20 cycles under three noise bands. A triangle
in (b) is the upper end of the interval where none stands. Grey are the restitutions with which the block overturns from
rest without noise, of the 200 cycles for which it is followed.

The paper does not state the noise band; [0, 10] is inferred from its figures (band_inferred.py).

Source: H. Lin and S. C. S. Yim, "Nonlinear rocking motions. I: Chaos under noisy periodic excitations", J. Eng. Mech.
122(8), 719-727, 1996.

Run time: about half a minute on 2 cores, once the kernels are compiled.

    python cases/survival_against_restitution.py --out results/restitution

Files: ``restitution.png``, ``restitution.json``.
"""

import numpy as np
from command import command

from fpk_rocking import NoNoise, load_scene, solve_fpk
from fpk_rocking.output.tables import reporting
from fpk_rocking.results import pictures, storage
from fpk_rocking.results.remarks import remarks
from montecarlo import simulate

RESTITUTIONS = tuple(np.round(np.linspace(0.5, 1.0, 21), 3).tolist())
DENSITY_RESTITUTIONS = tuple(np.round(np.linspace(0.5, 1.0, 11), 2).tolist())
CYCLES = (10, 20, 40)
QUIET_CYCLES = 200
BANDS = (5.0, 10.0, 20.0)
OURS, COMPARED_AT = 10.0, 20
_RESTITUTION = "restitution e, nondimensional"


def run(
    out, restitutions=RESTITUTIONS, density_restitutions=DENSITY_RESTITUTIONS, realizations=10_000, tol=1e-2, seed=1
) -> dict:
    """Compute, draw and write everything.

    Parameters
    ----------
    out : pathlib.Path
        Folder for the files; created if missing.
    restitutions, density_restitutions : sequence of float
        e of the ensembles and of the densities.
    realizations, seed : int
        Of each ensemble.
    tol : float
        Error of survival that the density solver aims at.

    Returns
    -------
    dict
        What ``restitution.json`` holds.
    """
    scene = load_scene("main")
    sampled = {"cycles": max(CYCLES), "realizations": realizations, "seed": seed}
    ensembles = {band: [simulate(_varied(scene, e, band), **sampled) for e in restitutions] for band in BANDS}
    densities = []
    for e in density_restitutions:
        with reporting(f"density, e = {e:g}") as progress:
            options = {"cycles": max(CYCLES), "tol": tol, "noise_replacement": "white"}
            densities.append(solve_fpk(_varied(scene, e, OURS), **options, progress=progress))
    replacements = [density.noise_replacement for density in densities[:1]]
    values = {
        "scene": scene.to_toml(),
        "cycles": list(CYCLES),
        "restitutions": list(restitutions),
        "realizations": realizations,
        "bands": [
            {
                "band": [0.0, band],
                "survival": [ensemble.survival[list(CYCLES)].tolist() for ensemble in ensembles_of_band],
                "interval": [ensemble.survival_interval()[list(CYCLES)].tolist() for ensemble in ensembles_of_band],
            }
            for band, ensembles_of_band in ensembles.items()
        ],
        "density": [
            {
                "restitution": e,
                "survival": density.survival[list(CYCLES)].tolist(),
                "error_estimate": density.error_estimate,
            }
            for e, density in zip(density_restitutions, densities, strict=True)
        ],
        "cycles_without_noise": [_stood(scene, e) for e in restitutions],
        "remarks": list(dict.fromkeys((scene.noise.remark, *remarks(*ensembles[OURS]), *replacements))),
    }
    draw(out / "restitution.png", values)
    storage.write_json(out / "restitution.json", values)
    return values


def _varied(scene, restitution, band):
    """Scene with another restitution and the end of its noise band."""
    return scene.varied(block={"restitution": restitution}, noise={"band": (0.0, band)})


def _stood(scene, restitution):
    """Cycles that the block stands without noise, at most 200."""
    quiet = simulate(_varied(scene, restitution, OURS).varied(noise=NoNoise()), cycles=QUIET_CYCLES, realizations=1)
    return float(quiet.overturn_time[0] / scene.period) if quiet.overturn_side[0] else float(QUIET_CYCLES)


def draw(path, values):
    """Draw what the JSON file holds."""
    drawn = (
        f"Open symbols: {values['realizations']:,} paths a point, band noise of variance 0.04, 95 % intervals "
        "(triangles: upper limits). Lines through dots: density, with white noise of equal Melnikov variance; colours "
        "as in (a). Grey: overturns without noise."
    )
    places, survival = values["restitutions"], np.array(_ours(values)["survival"])[:, -1]
    best = int(np.argmax(survival))
    title = (
        f"Survival is largest at a restitution of {places[best]:.3g}: {survival[best]:.2f} after "
        f"{values['cycles'][-1]} cycles, {survival[0]:.2f} at {places[0]:g}"
    )
    with pictures.page(path, (12.0, 5.4), title, [drawn]) as figure:
        linear, logarithmic, bands = figure.subplots(1, 3)
        _both(linear, values)
        _both(logarithmic, values, limits=True)
        linear.set(title="(a) Survival, band [0, 10]", ylim=(-0.02, 1.02))
        logarithmic.set(title="(b) The same, logarithmic", yscale="log", ylim=(None, 2.0))
        _bands(bands, values)
        for axes in (linear, logarithmic, bands):
            axes.set(xlabel=_RESTITUTION, ylabel="P(not overturned)")
            _quiet(axes, values)


def _quiet(axes, values):
    """Shade the restitutions with which the block overturns without noise."""
    overturns = np.array(values["cycles_without_noise"]) < QUIET_CYCLES
    if overturns.any():
        quiet = np.array(values["restitutions"])[overturns]
        axes.axvspan(quiet[0], quiet[-1], color="#dddddd", zorder=0)


def _ours(values):
    """Row of the band `OURS`."""
    return next(curve for curve in values["bands"] if curve["band"][1] == OURS)


def _both(axes, values, limits=False):
    """Draw survival of paths and densities against the restitution, with upper limits if `limits`."""
    ours = _ours(values)
    survival, interval = np.array(ours["survival"]), np.array(ours["interval"])
    lines = np.array([row["survival"] for row in values["density"]])
    places = [row["restitution"] for row in values["density"]]
    for column, (cycle, colour) in enumerate(zip(values["cycles"], pictures.COLOURS, strict=False)):
        axes.plot(places, lines[:, column], ".-", color=colour, linewidth=1.2)
        some = survival[:, column] > 0.0
        x, values_at = np.array(values["restitutions"])[some], survival[some, column]
        pictures.error_bars(axes, x, values_at, interval[some, column], color=colour)
        if limits:
            look = {"color": colour, "markersize": 5}
            axes.plot(np.array(values["restitutions"])[~some], interval[~some, column, 1], "v", **look)
        else:
            _named_at_peak(axes, x, values_at, f"{cycle} cycles", colour)


def _bands(axes, values):
    """Draw survival after `COMPARED_AT` cycles against the restitution, by band."""
    column = values["cycles"].index(COMPARED_AT)
    for curve, colour, marker in zip(values["bands"], pictures.shades(len(values["bands"])), "osD", strict=True):
        survival, limits = np.array(curve["survival"])[:, column], np.array(curve["interval"])[:, column]
        shape = {"marker": marker, "linestyle": "-", "linewidth": 0.8}
        pictures.error_bars(axes, values["restitutions"], survival, limits, color=colour, **shape)
        _named_at_peak(axes, values["restitutions"], survival, f"band [0, {curve['band'][1]:g}]", colour)
    axes.set(title=f"(c) Three noise bands, {COMPARED_AT} cycles", ylim=(-0.02, 1.02))


def _named_at_peak(axes, places, survival, text, colour):
    """Name a curve above its largest value."""
    peak = int(np.argmax(survival))
    pictures.named(axes, text, (places[peak], survival[peak]), colour, offset=(0.0, 8.0), ha="center")


def report(values):
    """Print the survival."""
    ours = _ours(values)
    survival_at = {row["restitution"]: row["survival"] for row in values["density"]}
    print(f"e: survival after {values['cycles']} cycles, Monte Carlo | density; cycles stood without noise")
    for e, row, quiet in zip(values["restitutions"], ours["survival"], values["cycles_without_noise"], strict=True):
        density = "  ".join(f"{share:.5f}" for share in survival_at.get(e, ()))
        print(f"{e:<6g}" + "  ".join(f"{share:.4f}" for share in row) + f" | {density:27} ; {quiet:.1f}")


if __name__ == "__main__":
    command(
        run,
        "results/restitution",
        "restitution.png",
        "restitution.json",
        report=report,
        realizations="of an ensemble",
        tol="tolerance of the densities",
        seed="of the ensembles",
    )
