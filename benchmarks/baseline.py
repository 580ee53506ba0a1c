"""Drift of measured motions: how many are told, what a correction does to PGV, and to the annual rate of overturning.

FILE is an .npz with `ids` (n,), `dt`, seconds, and for each id `a<id>`, the acceleration in 1e-4 g. The repository
holds no copy of measured motions. Ten minutes:

    python benchmarks/baseline.py --motions FILE.npz
"""

import argparse

import numpy as np
from report import table, write_section

from fpk_rocking import Record, Scene
from fpk_rocking.physics.forcing.readers.terms import UNITS
from fpk_rocking.risk import Hazard, at_intensity, fragility, synthetic_records
from fpk_rocking.risk.motions import recorded_scenes

OFFSET, SLOPE = 0.004, 2e-4
HAZARD = Hazard.power_law(rate=1e-4, exponent=2.5)
HIGHEST = 4.0
EVERY = 4


def motions_of(path):
    """Return the motions of a file as records."""
    with np.load(path) as file:
        interval = float(file["dt"])
        return [Record(interval, tuple((1e-4 * file[f"a{k}"]).tolist()), "g", source=str(k)) for k in file["ids"]]


def drifting(record, offset=OFFSET, slope=SLOPE):
    """Return a record in g with an offset, g, and a slope, g/s, about its middle."""
    steps = np.arange(len(record.samples)) - 0.5 * (len(record.samples) - 1)
    samples = np.array(record.samples) * UNITS[record.units] / UNITS["g"] + offset + slope * record.interval * steps
    return Record(record.interval, tuple(samples.tolist()), "g", source=record.source)


def without_long_periods(record):
    """Return a record without what lies below 0.05 Hz, by its Fourier transform, not by the filter that is judged.

    The transfer function rises as a half cosine to 1 at 0.1 Hz; 60 s of zeros stand on either side.
    """
    samples = np.array(record.samples)
    padding = round(60.0 / record.interval)
    padded = np.pad(samples, padding)
    frequency = np.fft.rfftfreq(padded.size, record.interval)
    gain = 0.5 - 0.5 * np.cos(np.pi * np.clip(frequency / 0.05 - 1.0, 0.0, 1.0))
    left = np.fft.irfft(gain * np.fft.rfft(padded), padded.size)[padding:-padding]
    return Record(record.interval, tuple(left.tolist()), record.units, source=record.source)


def corrected(record):
    """Return a record of the samples that a high-pass correction leaves."""
    left = Record(record.interval, record.samples, record.units, baseline="high-pass").corrected_samples
    return Record(record.interval, tuple(left.tolist()), record.units, source=record.source)


def rates_of(records, baseline, workers):
    """Return the annual rates (n,) at which a rack of 0.5 m by 1.8 m overturns under each of some records."""
    rack = Scene.from_block(0.5, 1.8, record=records[0])
    scenes = [at_intensity(scene) for scene in recorded_scenes(rack, records, baseline=baseline)]
    curves = fragility(scenes, scale=[0.1, HIGHEST], workers=workers)
    jumps = curves.motions.jumps[:, 0]
    signs = 1.0 - 2.0 * (np.arange(jumps.shape[1]) % 2)
    return np.nansum(signs * HAZARD(jumps), axis=1)


def main():
    """Measure, and write the section."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--motions", required=True, metavar="FILE", help=".npz of the measured motions")
    parser.add_argument("--workers", type=int, default=1, help="worker processes")
    asked = parser.parse_args()
    raw, workers = motions_of(asked.motions), asked.workers
    clean, other = [without_long_periods(record) for record in raw], [corrected(record) for record in raw]
    synthetic = [corrected(record) for record in synthetic_records(len(raw))]
    groups = {
        "measured": raw,
        f"measured, {OFFSET} g and {SLOPE} g/s added": [drifting(record) for record in raw],
        "measured, high-passed": other,
        f"measured, high-passed, {OFFSET} g and {SLOPE} g/s added": [drifting(record) for record in other],
        "measured, without long periods": clean,
        f"measured, without long periods, {OFFSET} g and {SLOPE} g/s added": [drifting(record) for record in clean],
        "synthetic": list(synthetic_records(len(raw))),
        f"synthetic, {OFFSET} g and {SLOPE} g/s added": [drifting(record) for record in synthetic],
    }
    rows, told = [], {}
    for name, records in groups.items():
        drifts = [record.drift for record in records]
        ratio = np.quantile([drift.pgv / drift.corrected_pgv for drift in drifts], [0.05, 0.5, 0.95])
        told[name] = sum(record.drifts for record in records)
        rows.append([name, f"{told[name]} of {len(records)}", *(f"{value:.3g}" for value in ratio)])
    added = groups[list(groups)[5]]
    reference = rates_of(clean, None, workers)
    mended = rates_of(added, "high-pass", workers)
    subset = slice(None, None, EVERY)
    rates = {
        "without long periods": (reference, reference),
        "the same, high-pass": (rates_of(clean[subset], "high-pass", workers), reference[subset]),
        "the same, drift added": (rates_of(added[subset], None, workers), reference[subset]),
        "the same, drift added, linear": (rates_of(added[subset], "linear", workers), reference[subset]),
        "the same, drift added, high-pass": (mended, reference),
        "as measured": (rates_of(raw[subset], None, workers), reference[subset]),
        "as measured, high-pass": (rates_of(raw[subset], "high-pass", workers), reference[subset]),
    }
    ratios = {name: values.mean() / wanted.mean() for name, (values, wanted) in rates.items()}
    change = ratios["the same, drift added, high-pass"] - 1.0
    undrifted = rates["the same, high-pass"][0]
    added_change = mended[subset].mean() / undrifted.mean() - 1.0
    moved = np.count_nonzero(np.abs(mended[subset] - undrifted) > 1e-6 * undrifted)
    assert abs(added_change) < 0.05
    count = len(raw)
    body = (
        f"{count} motions, measured on a shake table at 800 Hz, the mean of their first half second removed. What lies "
        "below 0.05 Hz is taken out by a Fourier transform, which is not the filter that is judged; the rate under "
        f"these motions is the reference. Then {OFFSET} g and {SLOPE} g/s are added to each: "
        f"{told[list(groups)[5]]} are told, and the drift of the others cancels what was added. "
        f"After the correction the rate is {100.0 * change:+.1f} % off the reference. This is what the correction "
        "itself changes: the rate under motions to which nothing was added is the same to "
        f"{100.0 * abs(added_change):.1g} % after it, and that under a single motion differs by more than 1e-6 in "
        f"{moved} of {undrifted.size}, whose outcomes change between scales a thousandth apart.\n\n"
        "A record counts as drifting where the line of least squares and what lies below 0.1 Hz have a velocity above "
        ".24 of the PGV that is left. Columns 5 %, median and 95 % are of PGV as it is over PGV without drift. "
        "Synthetic motions are those of `synthetic_records`.\n\n"
    )
    body += table(["motions", "told", "5 %", "median", "95 %"], rows) + "\n\n"
    lines = [
        [name, len(rates[name][0]), f"{rates[name][0].mean():.3e}", f"{ratio:.3f}"] for name, ratio in ratios.items()
    ]
    body += table(["annual rate", "motions", "1/year", "over the reference"], lines) + "\n\n"
    body += f"Block of 0.5 m by 1.8 m, no noise, PGV up to {HIGHEST:g} m/s, hazard 1e-4 im^-2.5."
    values = {"told": told, "ratios": ratios, "rates": {name: values.mean() for name, (values, _) in rates.items()}}
    write_section("Records that drift", body, page=None, values=values)


if __name__ == "__main__":
    main()
