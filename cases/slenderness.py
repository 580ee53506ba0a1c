"""Error of the equation of a slender block.

Shown is how many fewer or more blocks overturn by the exact equation than by that of a slender block, which leaves the
critical angle α out, over α and the frequency. Blocks from rest are shaken by a one-sine pulse, and by ten cycles of a
harmonic acceleration, both with band noise; the strength at each frequency is that at which half of the slender blocks
overturn. Both equations meet the same realizations of the noise.

Run time: one minute on 2 cores, once the kernels are compiled.

    python cases/slenderness.py --out results/slenderness

Files: ``slenderness.png``, ``slenderness.json``.
"""

import math

import numpy as np
from command import command

from fpk_rocking import BandNoise, Block, Harmonic, Pulse, Scene
from fpk_rocking.output.tables import reporting
from fpk_rocking.results import pictures, storage
from fpk_rocking.results.storage import plain
from fpk_rocking.risk import fragility
from fpk_rocking.studies import scaled
from montecarlo import simulate

RESTITUTION, NOISE, CYCLES, FREE = 0.9, 0.15, 10, 15.0
ANGLES = (0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35)
FREQUENCIES = tuple(np.geomspace(1.0, 8.0, 13).tolist())
SCALES = tuple(np.geomspace(0.5, 16.0, 41).tolist())


def scene_of(kind, frequency, critical_angle=0.0):
    """Scene of a `kind` of shaking ("pulse" or "harmonic") of amplitude 1, with noise of a part of its rms.

    `frequency` is nondimensional, the critical angle of the block in radians (0: a slender block).
    """
    forcing = Pulse("one-sine", 1.0, frequency) if kind == "pulse" else Harmonic(1.0, frequency)
    noise = BandNoise(0.5 * NOISE**2, (0.0, 3.0 * frequency), 60)
    return Scene(Block(RESTITUTION, critical_angle=critical_angle), forcing, noise)


def rows_of(scene):
    """Keyword of `simulate` for the end of a scene: `cycles` where its forcing repeats, else `times`."""
    return {"cycles": CYCLES} if scene.period else {"times": [scene.forcing.duration + FREE]}


def half(scene, realizations, seed):
    """Scale of the shaking from which half of the realizations overturn, between two of `SCALES`; nan for none."""
    curves = fragility(scene, scale=SCALES, realizations=realizations, seed=seed, **rows_of(scene))
    overturned_share = curves.overturned[0]
    above = np.flatnonzero(overturned_share >= 0.5)
    if not above.size or above[0] == 0:
        return math.nan
    k = above[0]
    share = (0.5 - overturned_share[k - 1]) / (overturned_share[k] - overturned_share[k - 1])
    return SCALES[k - 1] * (SCALES[k] / SCALES[k - 1]) ** share


def overturned(scene, scale, realizations, seed):
    """Probability that a scene, its shaking and noise times a scale, has overturned in the end; by Monte Carlo."""
    return 1.0 - float(
        simulate(scaled(scene, scale), realizations=realizations, seed=seed, **rows_of(scene)).survival[-1]
    )


def run(out, angles=ANGLES, frequencies=FREQUENCIES, realizations=4000, seed=1) -> dict:
    """Compute, draw and write everything.

    Parameters
    ----------
    out : pathlib.Path
        Folder for the files; created if missing.
    angles, frequencies : sequence of float
        Critical angles, radians, and frequencies of the shaking, nondimensional.
    realizations, seed : int
        Of each ensemble.

    Returns
    -------
    dict
        What ``slenderness.json`` holds.
    """
    values = {"angles": list(angles), "frequencies": list(frequencies), "realizations": realizations}
    for kind in ("pulse", "harmonic"):
        scales, slender, exact = [], [], []
        with reporting(kind) as progress:
            for number, frequency in enumerate(frequencies):
                scale = half(scene_of(kind, frequency), realizations // 4, seed)
                scales.append(scale)
                finite = math.isfinite(scale)
                slender.append(overturned(scene_of(kind, frequency), scale, realizations, seed) if finite else math.nan)
                exact.append(
                    [
                        overturned(scene_of(kind, frequency, angle), scale, realizations, seed) if finite else math.nan
                        for angle in angles
                    ]
                )
                progress(number + 1, len(frequencies))
        values[kind] = {"scale": scales, "slender": slender, "exact": exact}
    storage.write_json(out / "slenderness.json", plain(values))
    draw(out / "slenderness.png", values)
    return values


def draw(path, values):
    """Draw the differences over critical angle and frequency."""
    sampled = f"{values['realizations']:,} realizations a point, the same for both"
    shaking = f"restitution {RESTITUTION:g}, noise of {NOISE:g} of the rms of the shaking"
    notes = [f"Where half of the slender blocks overturn. {sampled}; {shaking}."]
    off = {kind: np.array(values[kind]["exact"]) - np.array(values[kind]["slender"])[:, None] for kind in NAMES}
    most = max(float(np.nanmax(np.abs(differences))) for differences in off.values())
    title = f"With noise the equation of a slender block overturns squat blocks too often, by up to {most:.2f}"
    with pictures.page(path, (11.0, 5.2), title, notes) as figure:
        panels = figure.subplots(1, 2, sharey=True)
        for axes, (kind, name) in zip(panels, NAMES.items(), strict=True):
            drawn = axes.pcolormesh(
                values["angles"],
                values["frequencies"],
                off[kind],
                cmap="RdBu_r",
                vmin=-most,
                vmax=most,
                shading="nearest",
            )
            axes.set_yscale("log")
            axes.set_yticks([1, 2, 4, 8], ["1", "2", "4", "8"])
            axes.minorticks_off()
            axes.grid(visible=False)
            axes.set(title=name, xlabel="critical angle α, rad")
        panels[0].set_ylabel("frequency Ω = ω / p")
        figure.colorbar(drawn, ax=panels, label="P(overturned), exact less slender")


NAMES = {"pulse": "(a) One-sine pulse", "harmonic": f"(b) {CYCLES} harmonic cycles"}


def report(values):
    """Print the largest differences."""
    for kind in NAMES:
        off = np.array(values[kind]["exact"]) - np.array(values[kind]["slender"])[:, None]
        print(f"{kind}: exact less slender from {np.nanmin(off):+.3f} to {np.nanmax(off):+.3f}")


if __name__ == "__main__":
    command(
        run,
        "results/slenderness",
        "slenderness.png",
        "slenderness.json",
        report=report,
        realizations="a point",
        seed="seed",
    )
