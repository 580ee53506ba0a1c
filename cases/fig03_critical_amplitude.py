"""Critical amplitude of the forcing against its frequency, with and without noise: cf. Fig. 3 of Lin and Yim (1996).

From the critical amplitude on, the Melnikov criterion lets blocks cross the separatrix. Shown are

* the paper's criterion (14) for several restitutions, without noise and with σ² = 0.16,
* at e = 0.5 the criteria against each other: (14), which adds the peak of the harmonic part to the mean square of the
  noise; the mean square of both; and the exact crossing of the manifolds without noise,
* (14) without noise over the exact amplitude: where the first order in 1 - e, A and σ holds,
* (14) at Ω = 4 against the variance of the noise, for three bands; it is zero where the noise alone meets it.

The paper does not state the noise band. The band [0, 10] is inferred by this project from the paper's claims.

Source: H. Lin and S. C. S. Yim, "Nonlinear rocking motions. I: Chaos under noisy periodic excitations", J. Eng. Mech.
122(8), 719-727, 1996, Fig. 3.

Run time: about two seconds.

    python cases/fig03_critical_amplitude.py --out results/fig03

Files: ``fig03.png``, ``fig03.json``.
"""

import argparse
import pathlib
import sys

import numpy as np

from fpk_rocking import BandNoise, NoNoise, melnikov
from fpk_rocking.output import style, summary

RESTITUTIONS = (0.3, 0.5, 0.7, 0.9)
BANDS = (5.0, 10.0, 20.0)
SHOWN = (0.5, 1.0, 2.0, 2.7, 4.0, 6.0)
_NOTE = "Noise band [0, 10] unless stated: inferred by this project; the paper states none."
_AMPLITUDE = "amplitude A, nondimensional"
_FREQUENCY = "frequency Ω, nondimensional"


def run(out, variance=0.16, points=241) -> dict:
    """Compute, draw and write everything.

    Parameters
    ----------
    out : path
        Folder for the files; created if missing.
    variance : float
        σ² of the noise on [0, 10].
    points : int
        Of each curve.

    Returns
    -------
    dict
        What ``fig03.json`` holds: amplitudes at the frequencies `SHOWN` by criterion, one row a restitution.
    """
    out, noise = pathlib.Path(out), BandNoise(variance, (0.0, 10.0), 100)
    draw(out / "fig03.png", noise, points)
    e = np.reshape(RESTITUTIONS, (-1, 1))
    bands = [BandNoise(variance, (0.0, high), 100) for high in BANDS]
    values = {
        "figure": "Fig. 3 of Lin and Yim, J. Eng. Mech. 122(8), 1996",
        "variance": variance,
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
        "remarks": [_NOTE],
    }
    summary.write_summary(out / "fig03.json", values)
    return values


def draw(path, noise, points):
    """Write the picture."""
    omega = np.linspace(0.05, 6.0, points)
    with style.page(path, (10.5, 8.6), "Critical amplitude of the forcing (cf. paper Fig. 3)", [_NOTE]) as figure:
        (paper, criteria), (ratio, noisy) = figure.subplots(2, 2)
        _paper(paper, omega, noise)
        _criteria(criteria, omega, noise)
        _ratio(ratio, omega)
        _noisy(noisy, points)


def _paper(axes, omega, noise):
    for e, colour in zip(RESTITUTIONS, style.shades(len(RESTITUTIONS)), strict=True):
        axes.plot(omega, melnikov.critical_amplitude(omega, e, NoNoise()), color=colour, label=f"e = {e:g}")
        axes.plot(omega, melnikov.critical_amplitude(omega, e, noise), "--", color=colour)
    axes.plot([], [], "--", color="#555555", label=f"with noise, σ² = {noise.variance:g}")
    _scenes(axes)
    axes.set(title="Criterion (14)", xlabel=_FREQUENCY, ylabel=_AMPLITUDE, ylim=(-0.1, 8.0))
    axes.legend(loc="upper left", title="solid: without noise")


def _criteria(axes, omega, noise):
    e = 0.5
    for criterion, colour, label in zip(("peak", "mean square"), style.COLOURS, ("(14)", "mean square"), strict=False):
        for one, line in ((NoNoise(), "-"), (noise, "--")):
            amplitude = melnikov.critical_amplitude(omega, e, one, criterion)
            axes.plot(omega, amplitude, line, color=colour, label=f"{label}, σ² = {getattr(one, 'variance', 0.0):g}")
    exact = melnikov.exact_critical_amplitude(omega, e)
    axes.plot(omega, exact, color="black", linestyle="-.", label="manifolds cross (exact), σ² = 0")
    _scenes(axes)
    axes.set(title=f"The criteria at e = {e:g}", xlabel=_FREQUENCY, ylabel=_AMPLITUDE, ylim=(-0.1, 8.0))
    axes.legend(loc="upper left")


def _ratio(axes, omega):
    for e, colour in zip(RESTITUTIONS, style.shades(len(RESTITUTIONS)), strict=True):
        amplitude = melnikov.critical_amplitude(omega, e, NoNoise())
        axes.plot(omega, amplitude / melnikov.exact_critical_amplitude(omega, e), color=colour, label=f"e = {e:g}")
    axes.axhline(1.0, color="black", linewidth=0.8)
    axes.set(title="(14) over the exact amplitude, without noise", xlabel=_FREQUENCY, ylabel="ratio of amplitudes")
    axes.legend(loc="upper left")


def _noisy(axes, points):
    variance, lines = np.linspace(0.0, 1.0, points), (":", "-", "--")
    for e, colour in zip(RESTITUTIONS, style.shades(len(RESTITUTIONS)), strict=True):
        for high, line in zip(BANDS, lines, strict=True):
            noises = [BandNoise(one, (0.0, high), 100) for one in variance]
            axes.plot(variance, melnikov.critical_amplitude(4.0, e, noises), line, color=colour)
        axes.plot([], [], color=colour, label=f"e = {e:g}")
    for high, line in zip(BANDS, lines, strict=True):
        axes.plot([], [], line, color="#555555", label=f"band [0, {high:g}]")
    axes.set(title="(14) at Ω = 4 against the noise", xlabel="variance of the noise σ², nondimensional")
    axes.set(ylabel=_AMPLITUDE, ylim=(-0.1, 5.4))
    axes.legend(ncols=2, loc="upper right")


def _scenes(axes):
    box = {"facecolor": "white", "edgecolor": "none", "pad": 1.0}
    look = {"textcoords": "offset points", "color": style.OVERTURNED, "bbox": box, "ha": "center"}
    for omega, amplitude, name, place in ((2.7, 4.6, "main scene", (0, -16)), (4.0, 4.0, "(4, 4)", (24, -3))):
        axes.plot(omega, amplitude, "x", color=style.OVERTURNED, markersize=8, mew=2, zorder=5)
        axes.annotate(name, (omega, amplitude), xytext=place, **look)


def main() -> int:
    """Read the command line, run, print the amplitudes and say where the files are."""
    parser = argparse.ArgumentParser(description="Fig. 3 of Lin and Yim (1996).")
    parser.add_argument("--out", type=pathlib.Path, default="results/fig03", help="folder (default: %(default)s)")
    parser.add_argument("--variance", type=float, default=0.16, help="of the noise (default: %(default)s)")
    options = parser.parse_args()
    values = run(options.out, options.variance)
    print(f"{'':34}" + "".join(f"Ω = {omega:<7g}" for omega in values["frequencies"]))
    for name in ("without_noise", "with_noise", "exact_without_noise"):
        for e, row in zip(values["restitutions"], values[name], strict=True):
            print(f"{name.replace('_', ' '):24}e = {e:<6g}" + "".join(f"{one:<11.4f}" for one in row))
    print(f"Files in {options.out}: fig03.png, fig03.json")
    return 0


if __name__ == "__main__":
    sys.exit(main())
