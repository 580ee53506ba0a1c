"""Counts of white-noise paths on bins of .025, against which `equal_error.py` holds the finest mesh.

python benchmarks/fine_reference.py            # about a minute; writes tests/data/main_white_fine.npz
"""

from typing import NamedTuple

import numpy as np
from density import CYCLES, FINE_EDGES, MAIN
from report import ROOT

from fpk_rocking.results.storage import replaced_atomically
from montecarlo import tally

FILE = ROOT / "tests" / "data" / "main_white_fine.npz"
PATHS, SEED = 3_000_000, 9


class Counts(NamedTuple):
    """Paths, those that stand after the last cycle, and how many of these are in each bin."""

    paths: int
    standing: int
    bins: np.ndarray


def load():
    """Read the tracked counts."""
    with np.load(FILE) as file:
        return Counts(int(file["paths"]), int(file["standing"]), file["bins"].astype(float))


def main():
    """Sample, and write the counts."""
    angle, velocity = FINE_EDGES
    counts = tally(MAIN, cycles=CYCLES, realizations=PATHS, seed=SEED, angle_edges=angle, velocity_edges=velocity)
    bins = np.rint(counts.bin_probabilities(CYCLES, angle, velocity) * PATHS).astype(np.uint16)
    with replaced_atomically(FILE) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, paths=PATHS, standing=np.rint(counts.survival[CYCLES] * PATHS), bins=bins)


if __name__ == "__main__":
    main()
