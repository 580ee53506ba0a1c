"""A sweep that says on standard output how many rows its store holds; tests kill it at any instant.

Run as ``python killed_sweep.py STORE WORKERS``.
"""

import sys

import fuzz
import study_tasks

from fpk_rocking.studies import sweep

SCENES = [fuzz.scene(forcing=fuzz.Harmonic(1.0 + 1e-3 * k, 2.7)) for k in range(3000)]


def told(done, _):
    """Say how many rows are kept."""
    sys.stdout.write(f"{done}\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sweep(SCENES, study_tasks.slow, workers=int(sys.argv[2]), store=sys.argv[1], progress=told, seconds=0.01)
