"""Overturning spectrum under one-sine pulses.

A free-standing block may overturn under a one-sine pulse in two ways: after one impact (mode 1), or without any
(mode 2). Against the frequency of the pulse, the amplitudes that overturn it after an impact are a band with a gap
above it, in which it stands, up to those that overturn it without an impact; beyond a frequency only mode 2 is left.
The figure shows for which amplitudes and frequencies the block ends up overturned, the mode, and the least amplitude of
either mode. No noise; a block is followed until 20 units of time after the pulse, its cut-off is far out.

Source: J. Zhang and N. Makris, "Rocking response of free-standing blocks under cycloidal pulses", J. Eng. Mech. 127(5),
473-483, 2001.

Run time: two minutes on 2 cores, once the kernels are compiled.

    python cases/overturning_spectrum.py --out results/overturning_spectrum

Files: ``overturning_spectrum.png``, ``overturning_spectrum.json`` (the least amplitudes).
"""

import numpy as np
from command import command
from matplotlib.colors import ListedColormap

from fpk_rocking import Block, NoNoise, Overturning, Pulse, Scene
from fpk_rocking.results import pictures, storage
from fpk_rocking.results.storage import plain
from montecarlo import histories

RESTITUTION = 0.9
FREQUENCIES = np.linspace(1.0, 8.0, 57)
AMPLITUDES = np.geomspace(1.02, 13.0, 90)
FREE, FAR = 20.0, 3.0
ANGLES = (0.1, 0.2, 0.3)
STANDS = -1


def impacts_before(amplitude, frequency, critical_angle=0.0, restitution=RESTITUTION):
    """Impacts before overturning under a one-sine pulse, at most 2; STANDS where the block does not overturn.

    0 is mode 2 of Zhang and Makris, 1 their mode 1. Amplitude and frequency of the pulse are nondimensional, the
    critical angle is in radians (0: a slender block).
    """
    pulse = Pulse("one-sine", float(amplitude), float(frequency))
    scene = Scene(Block(restitution, critical_angle=critical_angle), pulse, NoNoise(), overturning=Overturning(FAR))
    run = histories(scene, times=[pulse.duration + FREE])
    return min(len(run.impact_time), 2) if run.overturn_side[0] else STANDS


def least(modes, amplitudes, wanted, refine):
    """Least amplitude that overturns after one of the numbers of impacts in `wanted`, by bisection; nan for none.

    `modes` has the impacts at ascending `amplitudes`; `refine` is the function of an amplitude that counts them.
    """
    hits = np.flatnonzero(np.isin(modes, wanted))
    if not hits.size:
        return np.nan
    if hits[0] == 0:
        return amplitudes[0]
    low, high = amplitudes[hits[0] - 1], amplitudes[hits[0]]
    for _ in range(20):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if refine(middle) in wanted else (middle, high)
    return high


def spectrum(frequencies, amplitudes, critical_angle=0.0):
    """Impacts (frequencies, amplitudes), and the least amplitudes (frequencies, 2) with and without impact."""
    modes = np.array([[impacts_before(a, w, critical_angle) for a in amplitudes] for w in frequencies])
    bounds = []
    for row, w in zip(modes, frequencies, strict=True):
        bounds.append(
            [
                least(row, amplitudes, wanted, lambda a, w=w: impacts_before(a, w, critical_angle))
                for wanted in ((1, 2), (0,))
            ]
        )
    return modes, np.array(bounds)


def draw(path, frequencies, amplitudes, modes, bounds, exact):
    """Draw the regions of both modes and their lower ends, and what the critical angle makes of these."""
    title = "The equation of a slender block is safe under long pulses, unsafe under short ones"
    notes = [f"Restitution {RESTITUTION:g}, p = √(3g / 4R). (b): above 1 the equation of a slender block is safe."]
    with pictures.page(path, (12.0, 5.8), title, notes) as figure:
        axes, ratios = figure.subplots(1, 2)
        for mode, colour in ((0, "0.78"), (1, "#9ecae1")):
            of_mode = np.where(np.minimum(modes.T, 1) == mode, 1.0, np.nan)
            axes.pcolormesh(frequencies, amplitudes, of_mode, cmap=ListedColormap([colour]), shading="nearest")
        axes.plot(frequencies, bounds[:, 1], color="black", label="least amplitude without impact")
        axes.plot(
            frequencies, bounds[:, 0], color=pictures.COLOURS[1], marker=".", label="least amplitude with impacts"
        )
        middle = {"ha": "center", "va": "center"}
        axes.text(2.4, 7.0, "overturns without\nimpact (mode 2)", **middle)
        axes.text(3.6, 2.6, "overturns after\nan impact (mode 1)", **middle)
        axes.text(6.3, 2.6, "does not overturn", **middle)
        axes.set(
            title="(a) Slender block under a one-sine pulse",
            ylabel=r"amplitude A = peak acceleration / (g θ$_\mathrm{cr}$)",
            yscale="log",
            ylim=(1.0, amplitudes[-1]),
        )
        axes.set_yticks([1, 2, 3, 5, 10], ["1", "2", "3", "5", "10"])
        axes.legend(loc="lower right")
        for colour, (angle, own) in zip(pictures.shades(len(exact)), exact.items(), strict=True):
            for column, line in ((1, "-"), (0, ":")):
                label = f"α = {angle:g}" if column else None
                ratios.plot(frequencies, own[:, column] / bounds[:, column], color=colour, linestyle=line, label=label)
        ratios.axhline(1.0, color="black", linewidth=0.8)
        ratios.set(
            title="(b) Without impact (lines), with impacts (dots)", ylabel="least amplitude, exact over slender"
        )
        ratios.legend(loc="lower left")
        for panel in (axes, ratios):
            panel.set_xlabel("frequency of the pulse Ω = ω / p")


def run(out) -> dict:
    """Compute the spectrum, write the figure and its numbers.

    Parameters
    ----------
    out : pathlib.Path
        Folder for the files; created if missing.

    Returns
    -------
    dict
        What ``overturning_spectrum.json`` holds.
    """
    modes, bounds = spectrum(FREQUENCIES, AMPLITUDES)
    exact = {angle: spectrum(FREQUENCIES, AMPLITUDES, angle)[1] for angle in ANGLES}
    draw(out / "overturning_spectrum.png", FREQUENCIES, AMPLITUDES, modes, bounds, exact)
    with_impacts, without = plain(bounds.T)
    values = {
        "restitution": RESTITUTION,
        "frequencies": FREQUENCIES.tolist(),
        "least_amplitude_with_impacts": with_impacts,
        "least_amplitude_without_impact": without,
        "exact": {str(angle): plain(own.T) for angle, own in exact.items()},
    }
    storage.write_json(out / "overturning_spectrum.json", values)
    return values


if __name__ == "__main__":
    command(run, "results/overturning_spectrum", "overturning_spectrum.png", "overturning_spectrum.json")
