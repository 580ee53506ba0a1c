"""Reference values for other codes: twelve scenes, each by two engines, with random numbers of their own.

Of each scene are computed: survival, the probability of having overturned to each side, that of being at rest, and mean
and covariance of angle and velocity of the blocks that stand. One engine samples paths with a standard error of at most
2e-4 in each probability. The other is the density solver where the noise is white or filtered, and Runge-Kutta paths
with other random numbers where the noise has a band or only the start is random.

    python benchmarks/reference_values.py            # all scenes, about an hour on 2 cores
    python benchmarks/reference_values.py pulse ...  # these alone; the rows of the others are kept

Files: ``docs/reference_values/values.csv``, and each scene there as a scene file.
"""

import csv
import io
import math
import sys
from typing import NamedTuple

import numpy as np
from report import ROOT

from fpk_rocking import Scene, solve_fpk
from fpk_rocking.results.storage import write_text
from fpk_rocking.scene import (
    BandNoise,
    Block,
    Dimensions,
    FilteredNoise,
    Harmonic,
    NoNoise,
    Pulse,
    Record,
    Start,
    WhiteNoise,
)  # fmt: skip
from montecarlo import simulate

FOLDER = ROOT / "docs" / "reference_values"
QUANTITIES = (
    "survival", "overturned left", "overturned right", "at rest", "mean angle", "mean velocity",
    "variance of angle", "covariance", "variance of velocity",
)  # fmt: skip
HEAD = ("scene", "time", "quantity", "value", "standard error", "second value", "second error", "second engine")
BATCH, LARGEST_ERROR, SEED, OTHER_SEED = 100_000, 2e-4, 1, 1_000_001
CYCLES = 5


class Row(NamedTuple):
    """A scene, when it is observed (without times after each cycle), the density's tolerance, and its paths."""

    scene: Scene
    times: np.ndarray | None = None
    tol: float = 1e-4
    second_paths: int = 400_000
    steps: int = 200

    @property
    def when(self):
        """What an engine is told."""
        return {"cycles": CYCLES} if self.times is None else {"times": self.times}


def rows():
    """Return the scenes by name."""
    paper, second = Harmonic(4.6, 2.7, math.pi), Harmonic(3.0, 2.7, math.pi)
    exact, forced = Block(0.85, critical_angle=0.3), Harmonic(2.5, 2.7, 1.0)
    sweep = np.arange(241) * 0.02
    samples = 0.4 * np.sin(np.pi * sweep / 4.8) * np.sin(2.0 * np.pi * sweep * (0.6 + 0.2 * sweep))
    shaken = Record(0.02, tuple(samples.round(6).tolist()), "g")
    scattered = Start(0.2, 0.1, ((0.01, 0.002), (0.002, 0.02)))
    block = Scene.from_block(
        0.5, 1.8, 0.3 * 9.80665, 1.5, noise_rms_acceleration=0.5, noise_band_hz=(0.0, 5.0), frequencies="independent"
    )
    periodic = {
        "paper-white": Scene(Block(0.5), paper, WhiteNoise(0.002 * math.pi)),
        "second-white": Scene(Block(0.7), second, WhiteNoise(0.012)),
        "paper-band": Scene(Block(0.5), paper, BandNoise(0.04, (0.0, 10.0), 100)),
        "exact-white": Scene(exact, forced, WhiteNoise(0.02)),
        "exact-band": block,
        "exact-start": Scene(exact, forced, NoNoise(), scattered),
    }
    rows_by_name = {name: Row(scene) for name, scene in periodic.items()}
    pulse = Pulse("one-sine", 3.0, 3.0)
    sized = Block(None, Dimensions(0.5, 1.8))
    after = pulse.duration * np.array([0.5, 1.0, 1.5, 2.0, 3.0])
    rows_by_name["pulse-white"] = Row(Scene(exact, pulse, WhiteNoise(0.02)), after)
    rows_by_name["pulse-band"] = Row(Scene(Block(0.85), pulse, BandNoise(0.09, (0.0, 9.0), 60)), after)
    record = Scene(sized, shaken, WhiteNoise(0.01))
    ends = record.forcing.duration * np.array([0.25, 0.5, 0.75, 1.0, 1.25])
    rows_by_name["record-white"] = Row(record, ends, tol=1e-3)
    rows_by_name["record-band"] = Row(record.varied(noise=BandNoise(0.09, (0.0, 9.0), 60)), ends)
    for filter_, *of in (("exponential", 0.1, 5.0), ("kanai-tajimi", 0.2, 5.0, 0.6)):
        rows_by_name[filter_] = Row(Scene(Block(0.7), second, FilteredNoise(filter_, *of)), tol=1e-3, steps=400)
    return rows_by_name


def sampled(row, paths, **method):
    """Return values and standard errors (times, quantities) of so many paths; with 0, of as many as need be."""
    sums, moments, count, seed = 0.0, 0.0, 0, method.pop("seed")
    while count < (paths or math.inf):
        run = simulate(row.scene, realizations=BATCH, **row.when, seed=seed, steps_per_cycle=row.steps, **method)
        x, v, side = run.angle[:, 1:], run.velocity[:, 1:], run.overturn_side[:, None]
        stands = ~np.isnan(x)
        x, v = np.nan_to_num(x), np.nan_to_num(v)
        events = [stands, ~stands & (side < 0), ~stands & (side > 0), stands & (x == 0.0) & (v == 0.0)]
        sums = sums + np.array([event.sum(axis=0) for event in events])
        powers = [x, v, x * x, x * v, v * v, x**4, (x * v) ** 2, v**4]
        moments = moments + np.array([power.sum(axis=0) for power in powers])
        count, seed = count + BATCH, seed + 1
        share = sums / count
        error = np.sqrt(share * (1.0 - share) / count)
        if not paths and error.max() <= LARGEST_ERROR and count >= 10 * BATCH:
            break
    with np.errstate(invalid="ignore", divide="ignore"):
        x, v, xx, xv, vv, x4, xv2, v4 = moments / sums[0]
        values = np.array([*share, x, v, xx - x * x, xv - x * v, vv - v * v])
        spread = np.array([values[6], values[8], x4 - xx * xx, xv2 - xv * xv, v4 - vv * vv]) / sums[0]
    return values.T, np.array([*error, *np.sqrt(spread)]).T


def solved(row):
    """Return values and estimated errors (times, quantities; none for moments) of the density solver."""
    noise_replacement = "filtered" if row.scene.noise.kind == "filtered" else "white"
    evolution = solve_fpk(row.scene, tol=row.tol, noise_replacement=noise_replacement, **row.when)
    count = evolution.survival.size - 1
    rest = evolution.at_rest if evolution.rests_exactly else np.full(count + 1, np.nan)
    moments = np.full((5, count), np.nan)
    if not evolution.rests_exactly:
        for k in range(count):
            density = evolution.at(k + 1)
            (xx, xv), (_, vv) = density.covariance
            moments[:, k] = *density.mean, xx, xv, vv
    values = np.array([evolution.survival[1:], *evolution.overturned[1:].T, rest[1:], *moments]).T
    errors = np.full(values.shape, np.nan)
    errors[:, :3] = evolution.error_estimate
    return values, errors


def by_paths(scene):
    """Whether the second method of a scene is paths."""
    return scene.noise.kind in ("band", "none")


def lines_of(name, row):
    """Return the lines of a scene."""
    first = sampled(row, 0, seed=SEED)
    again = by_paths(row.scene)
    second = sampled(row, row.second_paths, seed=OTHER_SEED, method="rk4") if again else solved(row)
    engine = "Runge-Kutta paths" if again else "density"
    lines = []
    times = row.scene.period * np.arange(1, CYCLES + 1) if row.times is None else row.times
    for k, time in enumerate(times):
        for j, quantity in enumerate(QUANTITIES):
            numbers = (first[0][k, j], first[1][k, j], second[0][k, j], second[1][k, j])
            written = [
                "" if math.isnan(number) else f"{number:.3g}" if i % 2 else f"{number:z.7f}"
                for i, number in enumerate(numbers)
            ]
            lines.append([name, f"{time:.10g}", quantity, *written, engine if written[2] else ""])
    return lines


def load():
    """Return the lines of the file."""
    path = FOLDER / "values.csv"
    return list(csv.DictReader(path.open(encoding="utf-8"))) if path.exists() else []


def main():
    """Compute the scenes that are asked for and write the file after each."""
    rows_by_name = rows()
    for name in sys.argv[1:] or rows_by_name:
        lines = lines_of(name, rows_by_name[name])
        other_lines = [list(line.values()) for line in load() if line["scene"] != name]
        order = list(rows_by_name)
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerows([HEAD, *sorted(other_lines + lines, key=lambda line: order.index(line[0]))])
        write_text(FOLDER / "values.csv", text.getvalue())
        write_text(FOLDER / f"{name}.toml", rows_by_name[name].scene.to_toml())
        last = lines[-len(QUANTITIES)]
        print(f"{name}: survival {last[3]} ± {last[4]}; {last[7]} {last[5]} ± {last[6]}", flush=True)


if __name__ == "__main__":
    main()
