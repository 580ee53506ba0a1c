"""What the search for critical intensities misses, against a scan five times as fine; rates with noise by 8 to 48.

FILE is an .npz as of `records_against_integration.py`. Half an hour on one processor:

    python benchmarks/critical_search.py --motions FILE.npz
"""

import argparse
import dataclasses
import math

import numpy as np
from baseline import motions_of
from report import table, write_section

from fpk_rocking import BandNoise, Scene
from fpk_rocking.risk import Hazard, critical_intensities, study
from fpk_rocking.risk.search import FINE, SETTLED, first_scale
from montecarlo.engines.scaled_paths import ScaledPaths

BLOCKS = (0.5, 1.8), (0.3, 1.5)
SCAN, EXPONENT = 0.002, 3.0
RATE_MOTIONS, COUNTS, NOISE_G, PATHS = 14, (8, 24, 48), 0.02, 500


def scanned(scene, jumps):
    """Return the scales (k,) at which outcomes change in a scan in steps of `SCAN`, as far as the search has gone.

    `jumps` (j,) are those of the search.
    """
    paths = ScaledPaths(scene)
    low, high = paths.least_scale, SETTLED * jumps[-1]
    scales = np.geomspace(low, high, math.ceil(math.log(high / low) / SCAN) + 1)
    over = paths(scales).overturned
    return np.sqrt(scales[1:] * scales[:-1])[over[1:] != over[:-1]]


def intervals(jumps):
    """Return begin and end (k, 2) of the intervals between jumps: those of overturning, and of standing between."""
    return np.stack([jumps[:-1], jumps[1:]], axis=1)


def missed(fine, coarse):
    """Return the widths in the logarithm (k,) of the intervals of a fine scan, and whether the search misses each."""
    ends = intervals(fine)
    inside = (coarse[None] > ends[:, :1]) & (coarse[None] < ends[:, 1:])
    middle = np.sqrt(ends[:, 0] * ends[:, 1])
    same = np.searchsorted(coarse, middle) % 2 == (np.arange(len(ends)) + 1) % 2
    return np.log(ends[:, 1] / ends[:, 0]), ~same & ~inside.any(axis=1)


def exceedance(jumps):
    """Return the integral of the outcome over a hazard im^-EXPONENT (float), by its jumps (k,)."""
    return float(((-1.0) ** np.arange(jumps.size) * jumps**-EXPONENT).sum())


def block_row(size, motions):
    """Compare search and scan under all motions; return a dict of the row's values for one block (width, height)."""
    suite = critical_intensities(Scene.from_block(*size, record=motions[0]), motions, measure="PGV")
    own, fine = [], []
    for scene, row, unit in zip(suite.scenes, suite.jumps, suite.own, strict=True):
        jumps = row[np.isfinite(row)]
        if jumps.size % 2:  # the block overturns at the end of the search
            own.append(jumps)
            fine.append(unit * scanned(scene, jumps / unit))
            print(size, len(own), jumps.size, fine[-1].size, flush=True)
    widths, lost = map(np.concatenate, zip(*map(missed, fine, own), strict=True))
    grid = np.geomspace(min(row[0] for row in own), max(row[-1] for row in own), 4001)
    before, after = (np.mean([np.searchsorted(row, grid) % 2 for row in rows], axis=0) for rows in (fine, own))
    truth = np.mean([exceedance(row) for row in fine])
    return {
        "motions": len(own),
        "intervals": widths.size,
        "narrow": float((widths < FINE).mean()),
        "missed": float(lost.mean()),
        "missed of 1 % or more": float(lost[widths >= FINE].mean()),
        "mean change of P": float((after - before).mean()),
        "rate by lowest": float(np.mean([row[0] ** -EXPONENT for row in fine]) / truth),
        "rate by critical": float(np.mean([first_scale(row[None]) ** -EXPONENT for row in fine]) / truth),
        "rate by search": float(np.mean([exceedance(row) for row in own]) / truth),
    }


def rate_of(motions, count):
    """Return the annual rate under motions with noise, with a number of intensities asked for."""
    block = Scene.from_block(*BLOCKS[0], record=motions[0])
    variance = (NOISE_G * 9.80665 / (block.block.size.gravity * block.block.critical_angle)) ** 2
    noise = BandNoise(variance, tuple(block.block.size.frequency(1.0) * f for f in (0.2, 8.0)), 100)
    noisy = dataclasses.replace(block, noise=noise)
    hazard = Hazard.power_law(rate=1e-4, exponent=2.5)
    scales = np.geomspace(0.2, 4.0, count)
    return study(noisy, motions, hazard, scales, baseline="high-pass", realizations=PATHS).risk.rate


def main():
    """Measure, and write the section."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--motions", required=True, metavar="FILE", help=".npz of the measured motions")
    motions = motions_of(parser.parse_args().motions)
    chosen = motions[:: len(motions) // RATE_MOTIONS][:RATE_MOTIONS]
    rows = {f"{width} m × {height} m": block_row((width, height), motions) for width, height in BLOCKS}
    print(rows, flush=True)
    rates = {count: rate_of(chosen, count) for count in COUNTS}
    spread = max(rates.values()) / min(rates.values()) - 1.0
    assert spread < 0.02
    of_all, of_wide = (
        " and ".join(f"{row[name]:{form}}" for row in rows.values())
        for name, form in (("missed", ".2f"), ("missed of 1 % or more", ".4f"))
    )
    body = (
        f"Against a scan in steps of {100 * SCAN:g} % under {len(motions)} measured motions the search misses "
        f"{of_all} of the intervals of overturning and of "
        f"standing, and {of_wide} of those that "
        f"are {100 * FINE:g} % wide or more. With noise the annual rate moves by {100 * spread:.2g} % between "
        f"{', '.join(map(str, COUNTS))} intensities.\n\n"
        "Rates are over that of the scan's outcomes, hazard im^-3: by the lowest intensity of the scan that overturns "
        f"the block, by the lowest from which it does over {100 * FINE:g} %, and by the search's outcomes. Motions "
        "are as measured, no baseline corrected. The change of P is the mean over the logarithm of the intensity.\n\n"
    )
    columns = list(next(iter(rows.values())))
    cells = [[name, *(f"{value:.4g}" for value in row.values())] for name, row in rows.items()]
    body += table(["block", *columns], cells) + "\n\n"
    body += (
        f"With noise of {NOISE_G} g rms, .2 to 8 Hz, scaled with {RATE_MOTIONS} of the motions (high-pass), "
        f"{PATHS:,} paths, hazard 1e-4 im^-2.5, PGV 0.2 to 4 m/s:\n\n"
    )
    body += table(["intensities", "annual rate"], [[number, f"{rate:.3e}"] for number, rate in rates.items()])
    write_section("Search for critical intensities", body, page=None, values={"blocks": rows})


if __name__ == "__main__":
    main()
