"""What the vertical motion of the base changes under measured motions, and paths under both against an integration.

FILE has a line for each motion: the file of a horizontal component, a tab, the file of the vertical one beside it. The
repository holds no copy of measured motions. An hour on one processor:

    python benchmarks/vertical_motion.py --pairs FILE
"""

import argparse
import dataclasses
import math
import pathlib
import sys

import numpy as np
from report import table, write_section

from fpk_rocking import Block, Body, NoNoise, Record, Scene
from fpk_rocking.physics.forcing.readers.terms import UNITS
from fpk_rocking.results.storage import plain
from fpk_rocking.risk import Hazard, study
from fpk_rocking.risk.search import overturns
from montecarlo import histories

sys.path.insert(0, str(pathlib.Path(__file__).parents[1] / "tests" / "oracles"))
from body_motion import BodyInMetres

G = 9.80665
RUNS, LASTING, COARSE, LOOKS = 200, 10.0, 0.02, 100
WEAKEST, MARGIN = 0.05, 5.0
BLOCKS = {"0.5 m by 1.8 m": (0.5, 1.8), "0.3 m by 1.0 m": (0.3, 1.0), "1.0 m by 3.0 m": (1.0, 3.0)}
HAZARD = Hazard.power_law(rate=1e-4, exponent=2.5)
INTENSITIES = np.geomspace(0.1, 5.0, 200)


def accelerations(record):
    """Samples of a record, m/s²."""
    return UNITS[record.units] * np.array(record.samples)


def excerpt(record, begin, end):
    """The part of both motions of a record between two numbers of samples, without their means."""

    def part(one):
        """Of one motion."""
        samples = accelerations(one)[begin:end]
        return Record(one.interval, tuple((samples - samples.mean()).tolist()), "m/s2", source=one.source)

    return dataclasses.replace(part(record), vertical=part(record.vertical))


def strong_part(record):
    """The part of a record with 5 to 95 % of its Arias intensity, and `MARGIN` seconds on either side."""
    arias = np.cumsum(accelerations(record) ** 2)
    begin, end = (int(place) for place in np.searchsorted(arias, np.array([0.05, 0.95]) * arias[-1]))
    more = round(MARGIN / record.interval)
    return excerpt(record, max(0, begin - more), end + more)


def coarse_part(record):
    """`LASTING` seconds from before the peak of a record on, at `COARSE` seconds, 0 at both ends."""
    stride = max(1, round(COARSE / record.interval))
    begin = max(0, int(np.abs(accelerations(record)).argmax()) - round(0.3 * LASTING / record.interval))
    count = round(LASTING / (stride * record.interval))
    own, up = (accelerations(one)[begin::stride][:count] for one in (record, record.vertical))
    count = min(own.size, up.size)
    own, up = own[:count] - own[:count].mean(), up[:count] - up[:count].mean()
    for samples in (own, up):
        samples[[0, -1]] = 0.0
    return stride * record.interval, own, up


def drawn_case(rng, records):
    """A block and a motion by chance: the scene, the body in metres, and the end in seconds."""
    height = rng.uniform(0.25, 1.2)
    right, left = height * rng.uniform(0.12, 0.5), height * rng.uniform(0.12, 0.5)
    if rng.random() < 0.5:
        left = right
    radius = math.hypot(height, 0.5 * (right + left)) / math.sqrt(3.0)
    step, own, up = coarse_part(records[rng.integers(len(records))])
    factor = G * min(right, left) / height * math.exp(rng.uniform(math.log(1.1), math.log(4.0))) / np.abs(own).max()
    own, up = factor * own, factor * up
    times = step * np.arange(own.size)
    vertical = Record(step, tuple(up.tolist()), "m/s2")
    record = Record(step, tuple(own.tolist()), "m/s2", vertical=vertical)
    scene = Scene(Block(body=Body(height, right, left, radius)), record, NoNoise())
    fallen = 0.5 * math.pi * scene.block.critical_angle
    lengths, kinks = (height, right, left, radius), times[1:].tolist()
    motion = BodyInMetres(
        lengths,
        G,
        lambda time: float(np.interp(time, times, own, right=0.0)),
        kinks,
        fallen,
        lambda time: float(np.interp(time, times, up, right=0.0)),
    )
    return scene, motion, times[-1] + 4.0


def compared(records):
    """Equal outcomes and sides, of how many; largest difference of angles and times of runs, and counts by outcome."""
    rng, apart, sides, equal = np.random.default_rng(56), [], [], 0
    for number in range(RUNS):
        scene, motion, end = drawn_case(rng, records)
        alpha, rate = scene.block.critical_angle, scene.block.size.frequency_parameter
        looks = np.linspace(0.0, end, LOOKS + 1)[1:]
        path = histories(scene, times=rate * looks, realizations=1)
        worst, lasting = 0.0, path.angle[0, 1:]
        for look, angle in zip(looks, lasting, strict=True):
            motion.run(look)
            if motion.outcome[1]:
                break
            worst = max(worst, abs(motion.state[0] / alpha - angle) if math.isfinite(angle) else math.inf)
        time, side = motion.outcome
        same = side == path.overturn_side[0]
        equal += same
        if side and same:
            worst = max(worst, abs(rate * time - path.overturn_time[0]))
        apart.append(worst)
        sides.append(side)
        print(number, side, same, f"{worst:.1e}", len(motion.events), flush=True)
    return equal, np.array(apart), np.array(sides)


def changed(records, size):
    """Outcomes and rates of a block with and without the vertical motions, as numbers by name."""
    block = Scene.from_block(*size, record=records[0])
    alone = [dataclasses.replace(record, vertical=None) for record in records]
    studies = [study(block, motions, HAZARD) for motions in (records, alone)]
    both, flat = (one.critical for one in studies)
    outcomes = [overturns(suite.jumps, INTENSITIES) for suite in (both, flat)]
    rates = [one.risk for one in studies]
    finite = np.isfinite(both.critical) & np.isfinite(flat.critical)
    ratio = both.critical[finite] / flat.critical[finite]
    between = outcomes[0].any(axis=0) & ~outcomes[1].all(axis=0)
    away = [
        math.isfinite(record.for_size(block.block.size).weightless(most))
        for record, most in zip(records, both.critical / both.own, strict=True)
    ]
    own = [suite.overturn_side != 0 for suite in (both, flat)]
    return {
        "motions": len(records),
        "outcomes that differ, of those between the first and the last": float(
            (outcomes[0] != outcomes[1])[:, between].mean()
        ),
        "outcomes at the motions' own strength that differ": int((own[0] != own[1]).sum()),
        "ratio of critical PGV: median": float(np.median(ratio)),
        "ratio of critical PGV: 16 and 84 %": np.quantile(ratio, [0.16, 0.84]).tolist(),
        "ratio of critical PGV: least and largest": [float(ratio.min()), float(ratio.max())],
        "rate with": rates[0].rate,
        "rate without": rates[1].rate,
        "limits without": list(rates[1].interval),
        "without weight below the critical PGV": int(np.sum(away)),
    }


def main():
    """Measure, and write the section."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pairs", required=True, metavar="FILE", help="two files of records in a line, tab between")
    lines = pathlib.Path(parser.parse_args().pairs).read_text().splitlines()
    read = [Record.from_file(own, vertical=up, where_unstated=True) for own, up in map(str.split, lines)]
    records = [record for record in map(strong_part, read) if np.abs(accelerations(record)).max() > WEAKEST * G]
    equal, apart, sides = compared(read)
    found = {name: changed(records, size) for name, size in BLOCKS.items()}
    within = apart < 1e-6
    rows = [
        [
            name,
            f"{row['outcomes that differ, of those between the first and the last']:.3f}",
            f"{row['outcomes at the motions' + chr(39) + ' own strength that differ']} of {row['motions']}",
            f"{row['ratio of critical PGV: median']:.3f}",
            " to ".join(f"{value:.2f}" for value in row["ratio of critical PGV: 16 and 84 %"]),
            " to ".join(f"{value:.2f}" for value in row["ratio of critical PGV: least and largest"]),
            f"{row['rate with'] / row['rate without']:.3f}",
            row["without weight below the critical PGV"],
        ]
        for name, row in found.items()
    ]
    peaks = [np.abs(accelerations(record.vertical)).max() / np.abs(accelerations(record)).max() for record in records]
    ratios = [row["rate with"] / row["rate without"] for row in found.values()]
    shares = [row["outcomes that differ, of those between the first and the last"] for row in found.values()]
    body = (
        f"Under {len(records)} measured motions the vertical component changes {100 * min(shares):.1f} to "
        f"{100 * max(shares):.1f} % of the outcomes, and the annual rate by factors of {min(ratios):.2f} to "
        f"{max(ratios):.2f}. Of {RUNS} paths under both components {equal} have the outcome and the side of an "
        f"independent integration in metres; of {within.sum()} all angles differ by less than 1e-6 θ_cr.\n\n"
        f"Motions: PGA above {WEAKEST} g, of {len(records)} horizontal components the part with 5 to 95 % of the Arias "
        f"intensity and {MARGIN:g} s on either side, means removed; vertical over horizontal PGA {min(peaks):.2f} to "
        f"{max(peaks):.2f}, median {np.median(peaks):.2f}. Outcomes are those at 200 PGV from .1 to 5 m/s between the "
        "lowest at which a motion overturns the block and the highest at which one does not; both components are "
        "scaled together. Rates under the hazard 1e-4 im^-2.5. Paths of the comparison: bodies of equal and of unequal "
        f"sides drawn by chance, {LASTING:g} s of a motion about its peak at {COARSE} s, its horizontal PGA 1.1 to 4 "
        f"times that of lift-off; {np.count_nonzero(sides)} of {RUNS} overturn. The integration is scipy's DOP853 "
        "with the angular momentum at impacts and nothing nondimensional (tests/oracles/body_motion.py); angles are "
        f"compared at {LOOKS} times, and times of overturning. The largest differences, of chaotic paths, are "
        f"{', '.join(f'{value:.0e}' for value in np.sort(apart)[-3:])}.\n\n"
    )
    head = [
        "block",
        "share of outcomes that differ",
        "at the motions' own strength",
        "critical PGV with over without: median",
        "16 to 84 %",
        "range",
        "rate with over without",
        "motions that leave no weight below their critical PGV",
    ]
    body += table(head, rows)
    values = {"blocks": found, "apart": np.sort(apart), "equal": equal, "runs": RUNS}
    write_section("Vertical motion", body, page=None, values=plain(values))


if __name__ == "__main__":
    main()
