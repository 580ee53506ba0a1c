"""Phase flux beside measured leakage.

The phase flux Φ (paper eq. 17, corrected) is the phase-space area that crosses the separatrix of one saddle per unit
time, to first order in forcing, noise and loss. The heteroclinic orbits enclose the area 2 and there are two saddles:
if blocks were spread evenly inside, and what leaves did not return, they would leave at the rate Φ, that is ΦT in
each forcing cycle. This is held against the rate of overturning of the blocks that stand after 20 cycles,

* (a) over noise levels, at the main scene's e = 0.5 and three noise bands,
* (b) over restitutions from 0.5 to 0.9, at σ² = 0.04.

Kendall's τ tells whether Φ puts the rates in the right order, their ratio how far it is off. Overturning is first
passage of the cut-off, not of the separatrix, and neither forcing nor loss is small here: the flux is asked for more
than it promises.

The paper does not state the noise band; [0, 10] is inferred from its figures (band_inferred.py).

Source: H. Lin and S. C. S. Yim, "Nonlinear rocking motions. I: Chaos under noisy periodic excitations", J. Eng. Mech.
122(8), 719-727, 1996, eqs. 17 to 20.

Run time: about fifteen seconds on 2 cores, once the kernels are compiled.

    python cases/leakage_against_flux.py --out results/flux

Files: ``flux.png``, ``flux.json``.
"""

import numpy as np
from command import command
from scipy import stats

from fpk_rocking import load_scene, melnikov
from fpk_rocking.results import pictures, storage
from montecarlo import overturning_rate, simulate

VARIANCES = (0.001, 0.0025, 0.005, 0.01, 0.02, 0.04, 0.08, 0.16)
RESTITUTIONS = tuple(np.round(np.linspace(0.5, 0.9, 9), 2).tolist())
BANDS = (5.0, 10.0, 20.0)
OURS = 10.0
FORGOTTEN = 20
BLOCK = 0.5


def run(out, variances=VARIANCES, restitutions=RESTITUTIONS, cycles=100, realizations=10_000, seed=1) -> dict:
    """Compute, draw and write everything.

    Parameters
    ----------
    out : pathlib.Path
        Folder for the files; created if missing.
    variances, restitutions : sequence of float
        σ² at e = 0.5, and e at σ² = 0.04, nondimensional.
    cycles, realizations, seed : int
        Of each ensemble; above 20 cycles.

    Returns
    -------
    dict
        What ``flux.json`` holds.
    """
    scene = load_scene("main")
    sampled = {"cycles": cycles, "realizations": realizations, "seed": seed}
    noises = {
        band: [scene.varied(noise={"variance": variance, "band": (0.0, band)}) for variance in variances]
        for band in BANDS
    }
    blocks = [scene.varied(block={"restitution": e}) for e in restitutions]
    values = {
        "scene": scene.to_toml(),
        "forgotten_cycles": FORGOTTEN,
        "cycles": cycles,
        "realizations": realizations,
        "variances": list(variances),
        "restitutions": list(restitutions),
        "over_noise": [{"band": [0.0, band]} | _compared(scenes, sampled) for band, scenes in noises.items()],
        "over_restitution": _compared(blocks, sampled),
        "remarks": [scene.noise.remark],
    }
    draw(out / "flux.png", values)
    storage.write_json(out / "flux.json", values)
    return values


def _compared(scenes, sampled):
    """Measured rates per cycle and ΦT of scenes, their ratio, and Kendall's rank correlation.

    `sampled` has the keywords of `simulate`: cycles, realizations, seed.
    """
    measured = [overturning_rate(simulate(scene, **sampled), FORGOTTEN) for scene in scenes]
    rates = [overturning.rate for overturning in measured]
    fluxes = [
        float(melnikov.phase_flux(scene.forcing, scene.block.restitution, scene.noise) * scene.period)
        for scene in scenes
    ]
    return {
        "flux_per_cycle": fluxes,
        "rate": rates,
        "interval": [overturning.interval.tolist() for overturning in measured],
        "count": [overturning.count for overturning in measured],
        "flux_over_rate": [flux / rate if rate else None for flux, rate in zip(fluxes, rates, strict=True)],
        "kendall": float(stats.kendalltau(fluxes, rates).statistic),
    }


def draw(path, values):
    """Draw what the JSON file holds."""
    studies = *values["over_noise"], values["over_restitution"]
    ratios = [float(f"{ratio:.2g}") for study in studies for ratio in study["flux_over_rate"] if ratio]
    note = (
        f"Φ: phase flux (paper eq. 17, corrected), T: forcing period; ΦT is {min(ratios)} to {max(ratios):,.0f} times "
        f"the rate. Points, with 95 % intervals: rate of overturning at A = 4.6 of those of {values['realizations']:,} "
        f"blocks that stand after {values['forgotten_cycles']} cycles, until cycle {values['cycles']}."
    )
    fluxes, rates = (values["over_noise"][1][name] for name in ("flux_per_cycle", "rate"))
    weak, strong = values["variances"][0], values["variances"][-1]
    title = (
        f"Noise of σ² = {strong:g} in place of {weak:g} raises the phase flux by "
        f"{100.0 * (fluxes[-1] / fluxes[0] - 1.0):.0f} %, the rate of overturning {rates[-1] / rates[0]:,.0f}-fold"
    )
    with pictures.page(path, (10.5, 5.6), title, [note]) as figure:
        noise, block = figure.subplots(1, 2, sharey=True)
        for study, colour, marker in zip(values["over_noise"], pictures.shades(len(BANDS)), "osD", strict=True):
            _pair(noise, values["variances"], study, colour, marker)
            point = values["variances"][0], study["rate"][0]
            pictures.named(noise, f"band [0, {study['band'][1]:g}]", point, colour, offset=(10.0, -4.0))
        point = values["variances"][0], values["over_noise"][0]["flux_per_cycle"][0]
        pictures.named(noise, "ΦT, all three bands", point, "black", (0.0, 6.0))
        noise.set(xscale="log", xlabel="variance of the noise σ², nondimensional", ylabel="ΦT and rate, per cycle")
        noise.set_title(f"(a) Restitution e = {BLOCK:g}")
        _pair(block, values["restitutions"], values["over_restitution"], pictures.shades(len(BANDS))[1], "s")
        ours = values["over_restitution"]
        pictures.named(block, "ΦT", (values["restitutions"][0], ours["flux_per_cycle"][0]), "black", (0.0, 6.0))
        pictures.named(
            block,
            "band [0, 10]",
            (values["restitutions"][0], ours["rate"][0]),
            pictures.shades(len(BANDS))[1],
            (10.0, 0.0),
        )
        block.set(xlabel="restitution e, nondimensional", yscale="log")
        block.set_title("(b) Variance σ² = 0.04")


def _pair(axes, places, study, colour, marker):
    """Draw ΦT and the measured rate of a study, see `_compared`, against its places."""
    axes.plot(places, study["flux_per_cycle"], "-", color="black", linewidth=0.8)
    rate, limits = np.array(study["rate"]), np.array(study["interval"])
    some = rate > 0.0
    pictures.error_bars(axes, np.array(places)[some], rate[some], limits[some], color=colour, marker=marker)


def report(values):
    """Print how far the flux is off."""
    studies = [("σ²", values["variances"], f"band {study['band']}", study) for study in values["over_noise"]]
    studies.append(("e", values["restitutions"], "σ² = 0.04", values["over_restitution"]))
    for name, places, title, study in studies:
        print(f"{title}: Kendall's τ {study['kendall']:+.2f}")
        columns = zip(places, study["flux_per_cycle"], study["rate"], study["flux_over_rate"], strict=True)
        for place, flux, rate, ratio in columns:
            print(f"  {name} = {place:<7g} Φ T {flux:.4f}   rate {rate:.5f}   ratio {ratio or float('inf'):.1f}")


if __name__ == "__main__":
    command(
        run,
        "results/flux",
        "flux.png",
        "flux.json",
        report=report,
        realizations="of an ensemble",
        seed="of the ensembles",
    )
