"""A checkpointed tally that saves after every small batch, and says on standard output what it has saved.

Run as ``python killed.py CHECKPOINT REALIZATIONS``; tests stop it in every way there is.
"""

import math
import sys

from fpk_rocking import Block, Harmonic, Scene, WhiteNoise
from montecarlo import Tally, tally
from montecarlo.engines import batches
from montecarlo.results.tally import Checkpoint

SCENE = Scene(Block(0.5), Harmonic(4.6, 2.7, math.pi), WhiteNoise(0.006))
ASKED = {"cycles": 4, "angle_edges": [-1.6, 0.0, 1.6], "velocity_edges": [-3.0, 0.0, 3.0]}


def save_and_report(self, path):
    """Save, and only then say so."""
    save(self, path)
    sys.stdout.write(f"{self.realizations}\n")
    sys.stdout.flush()


if __name__ == "__main__":
    save, Tally.save = Tally.save, save_and_report
    batches.TUNING = batches.TUNING._replace(batch_seconds=1e-9, smallest_batch=256)
    Checkpoint.least_s, Checkpoint.share = 0.0, math.inf
    tally(SCENE, **ASKED, realizations=int(sys.argv[2]), checkpoint=sys.argv[1])
