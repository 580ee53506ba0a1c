"""Fig. 3: critical amplitude against frequency.

From the critical amplitude on, the Melnikov criterion lets blocks cross the separatrix. Shown are

* (a) the paper's figure: its criterion (14) at e = 0.5, without noise and with σ² = 0.286. Beside it the exact crossing
  of the manifolds without noise, and a criterion by the mean squares of both parts of the Melnikov process: (14) adds
  the peak of the harmonic part to the mean square of the noise,
* (b) criterion (14) for other restitutions,
* (c) (14) without noise over the exact amplitude: where the first order in 1 - e, A and σ holds,
* (d) (14) at Ω = 4 against the variance of the noise, for three bands, until the noise alone meets it.

The paper does not state the noise band. That its noise leaves a critical amplitude, as its figure shows, excludes bands
[0, b] below b = 6.4 (see band_inferred.py).

Source: H. Lin and S. C. S. Yim, "Nonlinear rocking motions. I: Chaos under noisy periodic excitations", J. Eng. Mech.
122(8), 719-727, 1996, Fig. 3: e = 0.5, Ψ = 0 (of which nothing here depends).

Run time: about two seconds.

    python cases/fig03_critical_amplitude.py --out results/fig03

Files: ``fig03.png``, ``fig03.json``.
"""

import numpy as np
from command import command

from fpk_rocking import BandNoise, NoNoise, load_scene, melnikov
from fpk_rocking.results import pictures, storage

RESTITUTIONS = (0.3, 0.5, 0.7, 0.9)
PAPER = 0.5
BANDS = (5.0, 10.0, 20.0)
SHOWN = (0.5, 1.0, 2.0, 2.7, 4.0, 6.0)
POINTS = 241
_HIGHEST = 7.6
_AMPLITUDE = "amplitude A, nondimensional"
_FREQUENCY = "frequency Ω, nondimensional"


def run(out, variance=0.286) -> dict:
    """Compute, draw and write everything.

    Parameters
    ----------
    out : pathlib.Path
        Folder for the files; created if missing.
    variance : float
        σ² of the noise.

    Returns
    -------
    dict
        What ``fig03.json`` holds: amplitudes at the frequencies `SHOWN` by criterion, one row a restitution.
    """
    noise = noise_of(variance)
    e = np.reshape(RESTITUTIONS, (-1, 1))
    bands = [BandNoise(variance, (0.0, high), 100) for high in BANDS]
    values = {
        "figure": "Fig. 3 of Lin and Yim, J. Eng. Mech. 122(8), 1996",
        "variance": variance,
        "deviation_of_the_process": melnikov.noise_variance(noise) ** 0.5,
        "restitutions": list(RESTITUTIONS),
        "frequencies": list(SHOWN),
        "impact_loss": melnikov.impact_loss(RESTITUTIONS).tolist(),
        "without_noise": melnikov.critical_amplitude(SHOWN, e, NoNoise()).tolist(),
        "with_noise": melnikov.critical_amplitude(SHOWN, e, noise).tolist(),
        "mean_square_without_noise": melnikov.critical_amplitude(SHOWN, e, NoNoise(), "mean square").tolist(),
        "mean_square_with_noise": melnikov.critical_amplitude(SHOWN, e, noise, "mean square").tolist(),
        "exact_without_noise": melnikov.exact_critical_amplitude(SHOWN, e).tolist(),
        "bands": list(BANDS),
        "deviation_by_band": [melnikov.noise_variance(band) ** 0.5 for band in bands],
        "amplitude_by_band_at_4": melnikov.critical_amplitude(4.0, e, bands).tolist(),
        "remarks": [noise.remark],
    }
    draw(out / "fig03.png", values)
    storage.write_json(out / "fig03.json", values)
    return values


def noise_of(variance):
    """Return the band noise of the main scene with another variance."""
    ours = load_scene("main").noise
    return BandNoise(variance, ours.band, ours.harmonics, ours.remark)


def draw(path, values):
    """Draw the criteria for the variance of the JSON file."""
    omega, noise = np.linspace(0.05, 6.0, POINTS), noise_of(values["variance"])
    row, column = values["restitutions"].index(PAPER), values["frequencies"].index(4.0)
    without, with_noise = (values[name][row][column] for name in ("without_noise", "with_noise"))
    title = (
        f"Paper Fig. 3: noise lowers the critical amplitude, at e = {PAPER:g} and Ω = 4 from {without:.2f} to "
        f"{with_noise:.2f}"
    )
    note = (
        "(14): the paper's Melnikov criterion. Mean square: of both parts of the Melnikov process. Exact "
        f"crossing: of the manifolds of the saddles. e: restitution. Noise band [{noise.band[0]:g}, "
        f"{noise.band[1]:g}], which is inferred."
    )
    with pictures.page(path, (10.5, 9.0), title, [note]) as figure:
        (paper, others), (ratio, noisy) = figure.subplots(2, 2)
        _paper(paper, omega, noise)
        _others(others, omega, noise)
        _ratio(ratio, omega)
        _noisy(noisy)


def _paper(axes, omega, noise):
    """Draw the criteria against the frequencies (n,), without noise and with it, at the restitution `PAPER`."""
    still, noisy = "no noise", f"σ² = {noise.variance:g}"
    for criterion, colour, name in (
        ("peak", pictures.COLOURS[0], "(14)"),
        ("mean square", pictures.COLOURS[1], "mean square"),
    ):
        for curve_noise, line, label in ((NoNoise(), "-", still), (noise, "--", noisy)):
            amplitude = melnikov.critical_amplitude(omega, PAPER, curve_noise, criterion)
            width = 2.2 if criterion == "peak" else 1.0
            axes.plot(omega, amplitude, line, color=colour, linewidth=width)
            last = np.flatnonzero(amplitude < _HIGHEST)[-1]
            pictures.named(axes, f"{name}, {label}", (omega[last], amplitude[last]), colour, fontsize=9)
    exact = melnikov.exact_critical_amplitude(omega, PAPER)
    axes.plot(omega, exact, color="black", linestyle="-.", linewidth=1.0)
    pictures.named(axes, "exact crossing, no noise", (omega[-1], exact[-1]), "black", offset=(5.0, -5.0), fontsize=9)
    axes.set(title=f"(a) The paper's figure, e = {PAPER:g}; thin lines: ours", xlabel=_FREQUENCY, ylabel=_AMPLITUDE)
    axes.set(ylim=(-0.1, 8.0), xlim=(-0.25, 9.4), xticks=range(7))


def _others(axes, omega, noise):
    """Draw criterion (14) against the frequencies (n,) for all restitutions."""
    for e, colour in zip(RESTITUTIONS, pictures.shades(len(RESTITUTIONS)), strict=True):
        still = melnikov.critical_amplitude(omega, e, NoNoise())
        axes.plot(omega, still, color=colour)
        noisy = melnikov.critical_amplitude(omega, e, noise)
        axes.plot(omega, np.where(noisy > 0.0, noisy, np.nan), "--", color=colour)
        last = np.flatnonzero(still < _HIGHEST)[-1]
        pictures.named(axes, f"e = {e:g}", (omega[last], still[last]), colour)
    axes.plot([], [], color="#555555", label="no noise")
    axes.plot([], [], "--", color="#555555", label=f"σ² = {noise.variance:g}; 0 for e = 0.7 and 0.9")
    axes.set(title="(b) Criterion (14) for other restitutions", xlabel=_FREQUENCY, ylabel=_AMPLITUDE)
    axes.set(ylim=(-0.1, 8.0), xlim=(-0.25, 6.9))
    axes.legend(loc="upper left")


def _ratio(axes, omega):
    """Draw criterion (14) without noise over the exact amplitude, against the frequencies (n,)."""
    for e, colour in zip(RESTITUTIONS, pictures.shades(len(RESTITUTIONS)), strict=True):
        amplitude = melnikov.critical_amplitude(omega, e, NoNoise())
        ratio = amplitude / melnikov.exact_critical_amplitude(omega, e)
        axes.plot(omega, ratio, color=colour)
        pictures.named(axes, f"e = {e:g}", (omega[-1], ratio[-1]), colour)
    axes.axhline(1.0, color="black", linewidth=0.8)
    axes.set(title="(c) (14) over the exact amplitude, without noise", xlabel=_FREQUENCY, ylabel="ratio of amplitudes")
    axes.set(xlim=(-0.25, 6.9))


def _noisy(axes):
    """Draw criterion (14) against the variance of the noise, by band."""
    variance, lines = np.linspace(0.0, 1.0, POINTS), (":", "-", "--")
    for e, colour in zip(RESTITUTIONS, pictures.shades(len(RESTITUTIONS)), strict=True):
        for high, line in zip(BANDS, lines, strict=True):
            noises = [BandNoise(strength, (0.0, high), 100) for strength in variance]
            amplitude = melnikov.critical_amplitude(4.0, e, noises)
            axes.plot(variance, _until_zero(amplitude), line, color=colour)
        pictures.named(axes, f"e = {e:g}", (0.0, amplitude[0]), colour, offset=(-5.0, -3.0), ha="right")
    for high, line in zip(BANDS, lines, strict=True):
        axes.plot([], [], line, color="#555555", label=f"band [0, {high:g}]")
    axes.set(title="(d) Criterion (14) at Ω = 4 against the noise", xlabel="variance of the noise σ², nondimensional")
    axes.set(ylabel=_AMPLITUDE, ylim=(-0.1, 5.0), xlim=(-0.19, 1.03), xticks=np.linspace(0.0, 1.0, 6))
    axes.legend(loc="upper right")


def _until_zero(amplitude):
    """Leave out what comes after the first zero: from there on the noise alone meets the criterion."""
    return np.where(np.append(True, amplitude[:-1] > 0.0), amplitude, np.nan)


def report(values):
    """Print the amplitudes."""
    print(f"{'':34}" + "".join(f"Ω = {omega:<7g}" for omega in values["frequencies"]))
    for name in ("without_noise", "with_noise", "exact_without_noise"):
        for e, row in zip(values["restitutions"], values[name], strict=True):
            print(f"{name.replace('_', ' '):24}e = {e:<6g}" + "".join(f"{amplitude:<11.4f}" for amplitude in row))


if __name__ == "__main__":
    command(run, "results/fig03", "fig03.png", "fig03.json", report=report, variance="of the noise")
