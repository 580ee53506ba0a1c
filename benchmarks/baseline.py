"""Drift of measured motions: how many drift, what a correction does to PGV, and to the annual rate of a study.

FILE is an .npz with `ids` (n,), `dt`, seconds, and for each id `a<id>`, the acceleration in 1e-4 g. The repository
holds no copy of measured motions. A minute:

    python benchmarks/baseline.py --motions FILE.npz
"""

import argparse

import numpy as np
from report import table, write_section

from fpk_rocking import Record, Scene
from fpk_rocking.physics.forcing.files import UNITS
from fpk_rocking.risk import Hazard, study
from fpk_rocking.scene import NoNoise
from fpk_rocking.studies import synthetic_records

OFFSET, SLOPE = 0.004, 2e-4
HAZARD = Hazard.power_law(rate=1e-4, exponent=2.5)
INTENSITIES = np.geomspace(0.1, 4.0, 24)
MOTIONS = 14


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


def corrected(record):
    """Return a record of the samples that a high-pass correction leaves."""
    left = Record(record.interval, record.samples, record.units, baseline="high-pass").corrected_samples
    return Record(record.interval, tuple(left.tolist()), record.units, source=record.source)


def rate_of(records, baseline):
    """Return the annual rate of a rack of 0.5 m by 1.8 m under records without noise."""
    rack = Scene.from_block(0.5, 1.8, record=records[0])
    assert isinstance(rack.noise, NoNoise)
    return study(rack, records, HAZARD, INTENSITIES, baseline=baseline, realizations=1).risk.rate


def main():
    """Measure, and write the section."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--motions", required=True, metavar="FILE", help=".npz of the measured motions")
    raw = motions_of(parser.parse_args().motions)
    clean = [corrected(record) for record in raw]
    synthetic = [corrected(record) for record in synthetic_records(len(raw))]
    groups = {
        "measured": raw,
        f"measured, {OFFSET} g and {SLOPE} g/s added": [drifting(record) for record in raw],
        "measured, high-passed": clean,
        f"measured, high-passed, {OFFSET} g and {SLOPE} g/s added": [drifting(record) for record in clean],
        "synthetic": list(synthetic_records(len(raw))),
        f"synthetic, {OFFSET} g and {SLOPE} g/s added": [drifting(record) for record in synthetic],
    }
    rows, shares = [], {}
    for name, records in groups.items():
        drifts = [record.drift for record in records]
        ratio = np.quantile([drift.pgv / drift.corrected_pgv for drift in drifts], [0.05, 0.5, 0.95])
        shares[name] = float(np.mean([record.drifts for record in records]))
        drifting_of_all = f"{sum(record.drifts for record in records)} of {len(records)}"
        rows.append([name, drifting_of_all, *(f"{value:.3g}" for value in ratio)])
    chosen = raw[:: len(raw) // MOTIONS][:MOTIONS]
    added = [drifting(record) for record in chosen]
    rates = {
        "as measured": rate_of(chosen, "none"),
        "as measured, drift added": rate_of(added, "none"),
        "high-pass": rate_of(chosen, "high-pass"),
        "drift added, high-pass": rate_of(added, "high-pass"),
        "linear": rate_of(chosen, "linear"),
        "drift added, linear": rate_of(added, "linear"),
    }
    base = rates["high-pass"]
    change = rates["drift added, high-pass"] / base - 1.0
    assert abs(change) < 0.05, change
    assert len(raw) == sum(record.drifts for record in groups[list(groups)[3]])
    measured, spoiled, *_ = shares.values()
    head = f"annual rate, {MOTIONS} motions", "1/year", "over that of high-pass"
    undone = 100.0 * (1.0 - spoiled)
    of_raw = rates["as measured"] / base
    of_added = rates["as measured, drift added"] / base
    body = (
        f"Of {len(raw)} measured motions {100.0 * measured:.0f} % drift so far that their PGV is that of the drift. A "
        f"study of {MOTIONS} of them has {of_raw:.2g} of the annual rate that they give after a high-pass correction. "
        f"With an offset of {OFFSET} g and a slope of {SLOPE} g/s added it has {of_added:.2g} of it; corrected, "
        f"what was added changes the rate by {abs(change):.1g} of it.\n\n"
        "The motions were measured on a shake table at 800 Hz, and the mean of their first half second was removed. A "
        "record counts as drifting where the line of least squares and what lies below 0.1 Hz have a velocity of more "
        f"than .24 of the PGV that is left. So do all {len(raw)} motions that were high-passed before the drift was "
        f"added. Of motions that drift by themselves {undone:.2g} % do not after it was added, as it takes their "
        "own away. The columns 5 %, median and 95 % are of PGV as it is over PGV without drift. Synthetic motions are "
        "those of `synthetic_records`.\n\n"
    )
    body += table(["motions", "drifting", "5 %", "median", "95 %"], rows) + "\n\n"
    body += table(head, [[name, f"{rate:.3e}", f"{rate / base:.3f}"] for name, rate in rates.items()]) + "\n\n"
    body += "Block of 0.5 m by 1.8 m, no noise, PGV from 0.1 to 4 m/s in 24 steps, hazard 1e-4 im^-2.5."
    write_section("Records that drift", body, page=None, values={"shares": shares, "rates": rates})


if __name__ == "__main__":
    main()
