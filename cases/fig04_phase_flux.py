"""Fig. 4: phase flux against the parameters.

The phase flux Φ is the mean positive part of the Melnikov process: the phase-space area that crosses a separatrix per
unit time, to first order. Around (A, Ω) = (4, 4), without noise and with σ² = 0.16, are shown

* (a) the Melnikov process of one realization of the noise, whose positive part, shaded, has the mean Φ,
* Φ (b) against the amplitude, (c) against the frequency and (e) against the variance of the noise, for two e,
* (d) Φ against the restitution: corrected, as eqs. 17 and 18 are printed (docs/theory.md), and by Monte Carlo of the
  expectation.

Band noise of finitely many harmonics is not Gaussian; the mean of the positive part over many realizations tells how
much of Φ rests on its being so.

The paper does not state the noise band; [0, 10] is inferred from its figures (band_inferred.py).

Source: H. Lin and S. C. S. Yim, "Nonlinear rocking motions. I: Chaos under noisy periodic excitations", J. Eng. Mech.
122(8), 719-727, 1996, Fig. 4.

Run time: about five seconds.

    python cases/fig04_phase_flux.py --out results/fig04

Files: ``fig04.png``, ``fig04.json``.
"""

import math

import numpy as np
from command import command
from fig03_critical_amplitude import noise_of

from fpk_rocking import BandNoise, Harmonic, NoNoise, melnikov
from fpk_rocking.results import pictures, storage

FORCING = Harmonic(4.0, 4.0)
RESTITUTIONS = (0.3, 0.5, 0.7, 0.9, 1.0)
BANDS = (5.0, 10.0, 20.0)
SHOWN = (0.5, 0.9)
SHOWN_CYCLES, POINTS = 12, 121
PHASES, APART = 32, 13
_FLUX = "phase flux Φ, nondimensional"


def run(out, variance=0.16, strata=512, realizations=4000, seed=1) -> dict:
    """Compute, draw and write everything.

    Parameters
    ----------
    out : pathlib.Path
        Folder for the files; created if missing.
    variance : float
        σ² of the noise on [0, 10].
    strata, realizations, seed : int
        Of the sampled expectation, and of the band noise whose processes are averaged.

    Returns
    -------
    dict
        What ``fig04.json`` holds: fluxes without and with noise by method, one column a restitution.
    """
    noise = noise_of(variance)
    noises = [[NoNoise()], [noise]]
    corrected = melnikov.phase_flux(FORCING, RESTITUTIONS, noises)
    sampled, error = melnikov.phase_flux_sampled(FORCING, RESTITUTIONS, noises, strata=strata, seed=seed)
    printed = {n: melnikov.phase_flux_as_printed(FORCING, RESTITUTIONS, noises, n) for n in (17, 18)}
    processes = [process_flux(noise, e, realizations, seed) for e in RESTITUTIONS]
    bands = [[BandNoise(variance, (0.0, high), 100)] for high in BANDS]
    values = {
        "figure": "Fig. 4 of Lin and Yim, J. Eng. Mech. 122(8), 1996",
        "amplitude": FORCING.amplitude,
        "frequency": FORCING.frequency,
        "variances": [0.0, variance],
        "seed": seed,
        "restitutions": list(RESTITUTIONS),
        "corrected": corrected.tolist(),
        "sampled": sampled.tolist(),
        "sampled_standard_error": error.tolist(),
        "printed_17": printed[17].tolist(),
        "printed_18": printed[18].tolist(),
        "processes": [mean for mean, _ in processes],
        "processes_standard_error": [deviation for _, deviation in processes],
        "bands": list(BANDS),
        "corrected_by_band": melnikov.phase_flux(FORCING, RESTITUTIONS, bands).tolist(),
        "remarks": [noise.remark],
    }
    draw(out / "fig04.png", values)
    storage.write_json(out / "fig04.json", values)
    return values


def drawn(noise, count, seed):
    """Frequencies and phases (rad), (count, N) each, of `count` realizations of noise of N harmonics (paper eq. 4)."""
    generator = np.random.default_rng(seed)
    shape = (count, noise.harmonics)
    return generator.uniform(*noise.band, shape), generator.uniform(0.0, 2.0 * math.pi, shape)


def process_flux(noise, restitution, realizations, seed):
    """Mean positive part of sampled Melnikov processes of a noise and a restitution, and its standard error.

    The mean is over realizations and over the phases of the forcing `FORCING`, which are taken from cycles far apart,
    at which the noise has forgotten itself.
    """
    times = FORCING.period * (APART + 1.0 / PHASES) * np.arange(PHASES)
    means = []
    for part in np.array_split(np.column_stack(drawn(noise, realizations, seed)), max(realizations // 500, 1)):
        process = melnikov.sampled_process(FORCING, restitution, noise, times, *np.split(part, 2, axis=1))
        means.append(np.maximum(process, 0.0).mean(axis=1))
    means = np.concatenate(means)
    return float(means.mean()), float(means.std(ddof=1) / math.sqrt(realizations))


def draw(path, values):
    """Draw what the JSON file holds, and the curves in closed form."""
    noise, place = noise_of(values["variances"][1]), RESTITUTIONS.index(SHOWN[0])
    without, with_noise = (row[place] for row in values["corrected"])
    title = (
        f"Paper Fig. 4: noise of σ² = {noise.variance:g} raises the phase flux, at e = {SHOWN[0]:g} from "
        f"{without:.3f} to {with_noise:.3f}"
    )
    symbols = (
        "A, Ω: amplitude and frequency of the forcing (vertical lines: 4). e: restitution. σ²: variance of the noise"
    )
    notes = [f"{symbols}, band [{noise.band[0]:g}, {noise.band[1]:g}]."]
    with pictures.page(path, (10.5, 11.2), title, notes) as figure:
        rows = [["process", "process"], ["amplitude", "frequency"], ["restitution", "variance"]]
        panels = figure.subplot_mosaic(rows, height_ratios=(0.8, 1.0, 1.0))
        _process(panels["process"], noise, values["seed"])
        _sweep(panels["amplitude"], np.linspace(0.0, 8.0, POINTS), 0, noise, "amplitude A")
        _sweep(panels["frequency"], np.linspace(0.5, 8.0, POINTS), 1, noise, "frequency Ω")
        _restitution(panels["restitution"], noise, values)
        _variance(panels["variance"])


def _process(axes, noise, seed):
    """Draw the Melnikov process of a realization of the noise, and its mean."""
    e = 0.5
    time = np.linspace(0.0, SHOWN_CYCLES * FORCING.period, 1500)
    process = melnikov.sampled_process(FORCING, e, noise, time, *drawn(noise, 1, seed))[0]
    axes.plot(
        time, melnikov.process_mean(FORCING, e, time), "--", color=pictures.COLOURS[0], label="mean, that is σ² = 0"
    )
    axes.plot(time, process, color=pictures.COLOURS[1], label=f"one realization, σ² = {noise.variance:g}")
    part = {"color": pictures.COLOURS[1], "alpha": 0.3, "linewidth": 0.0, "label": "positive part"}
    axes.fill_between(time, 0.0, np.maximum(process, 0.0), **part)
    axes.axhline(0.0, color="black", linewidth=0.8)
    axes.set(title=f"(a) Melnikov process at A = 4, Ω = 4, e = {e:g}", xlabel="time offset τ₀, nondimensional")
    axes.set(ylabel="energy, nondimensional", xlim=(0.0, time[-1]))
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.25 * (high - low))
    axes.legend(loc="upper left", ncols=3)


def _sweep(axes, swept, place, noise, name):
    """Φ against one parameter of the forcing, the other as in `FORCING`."""
    forcing = [FORCING.amplitude, FORCING.frequency]
    axes.axvline(forcing[place], color="#999999", linewidth=0.8)
    forcing[place] = swept
    for e, colour in zip(RESTITUTIONS, pictures.shades(len(RESTITUTIONS)), strict=True):
        still, noisy = (melnikov.phase_flux(tuple(forcing), e, curve_noise) for curve_noise in (NoNoise(), noise))
        axes.plot(swept, still, color=colour)
        axes.plot(swept, noisy, "--", color=colour)
        # Over the frequency only the curves with noise reach the end. A line of the grid passes through the last name.
        end, free = (noisy if place else still)[-1], {"facecolor": "white", "edgecolor": "none", "pad": 1.0}
        pictures.named(axes, f"e = {e:g}", (swept[-1], end), colour, fontsize=9, bbox=free)
    axes.plot([], [], color="#555555", label="no noise")
    axes.plot([], [], "--", color="#555555", label=f"σ² = {noise.variance:g}")
    fixed = f"A = {FORCING.amplitude:g}" if place else f"Ω = {FORCING.frequency:g}"
    letter = "c" if place else "b"
    axes.set(title=f"({letter}) Against the {name}, {fixed}", xlabel=f"{name}, nondimensional", ylabel=_FLUX)
    axes.set(xlim=(swept[0] - 0.4, 9.3), xticks=range(0, 9, 2))
    if place:
        # Over the frequency the flux spans orders of magnitude; without noise it ends where D_m = M.
        axes.set(yscale="log", ylim=(1e-4, 4.0))
    else:
        axes.set_ylim(0.0, None)
    axes.legend(loc="lower left" if place else "upper left")


def _restitution(axes, noise, values):
    """Draw the flux against the restitution: corrected, as printed, and sampled (`values`)."""
    e = np.linspace(0.0, 1.0, POINTS)
    curves = (
        (melnikov.phase_flux(FORCING, e, NoNoise()), "-", 0, "corrected, σ² = 0"),
        (melnikov.phase_flux(FORCING, e, noise), "-", 1, f"corrected, σ² = {noise.variance:g}"),
        (melnikov.phase_flux_as_printed(FORCING, e, noise, 17), "--", 2, "paper (17) as printed"),
        (melnikov.phase_flux_as_printed(FORCING, e, noise, 18), ":", 3, "paper (18) as printed"),
    )
    for flux, line, colour, label in curves:
        axes.plot(e, flux, line, color=pictures.COLOURS[colour], label=label)
    points = {"marker": "o", "linestyle": "none", "markerfacecolor": "white", "markersize": 5.0, "color": "black"}
    for row, label in zip(values["sampled"], ("Monte Carlo of the expectation", None), strict=True):
        axes.plot(RESTITUTIONS, row, label=label, **points)
    axes.axhline(0.0, color="black", linewidth=0.8)
    axes.set(
        title="(d) Against the restitution, A = 4, Ω = 4",
        xlabel="restitution e, nondimensional",
        ylabel=_FLUX,
    )
    axes.legend(loc="upper left", fontsize=9)


def _variance(axes):
    """Draw the flux against the variance of the noise, by band."""
    variance, lines = np.linspace(0.0, 0.4, POINTS), (":", "-", "--")
    for e, colour in zip(SHOWN, pictures.COLOURS, strict=False):
        for high, line in zip(BANDS, lines, strict=True):
            flux = melnikov.phase_flux(FORCING, e, [BandNoise(strength, (0.0, high), 100) for strength in variance])
            axes.plot(variance, flux, line, color=colour)
            text = f"e = {e:g}, band [0, {high:g}]"
            pictures.named(axes, text, (variance[-1], flux[-1]), colour, fontsize=9)
    axes.set(title="(e) Against the noise, A = 4, Ω = 4", xlabel="variance of the noise σ², nondimensional")
    axes.set(ylabel=_FLUX, ylim=(0.0, None), xlim=(-0.02, 0.63), xticks=(0.0, 0.1, 0.2, 0.3, 0.4))


def report(values):
    """Print the fluxes."""
    for row, variance in enumerate(values["variances"]):
        print(f"σ² = {variance:<10g}" + "".join(f"e = {e:<8g}" for e in values["restitutions"]))
        for name in ("corrected", "sampled", "printed_17", "printed_18"):
            print(f"{name.replace('_', ' '):15}" + "".join(f"{flux:<12.6f}" for flux in values[name][row]))
    print(f"{'processes':15}" + "".join(f"{flux:<12.6f}" for flux in values["processes"]))


if __name__ == "__main__":
    command(
        run,
        "results/fig04",
        "fig04.png",
        "fig04.json",
        report=report,
        variance="of the noise",
        realizations="of the noise",
        seed="of all samples",
    )
