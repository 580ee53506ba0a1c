"""Digests of what every engine returns for small scenes, one a line: run under several numbers of threads."""

import hashlib
import math
import sys

import numpy as np

from fpk_rocking import BandNoise, Block, Harmonic, Scene, Start, WhiteNoise, solve_fpk
from montecarlo import histories, restarted_poincare_map, simulate, split, tally


def digest(name, *arrays):
    """Write the name of a result and the digest of its bytes."""
    text = hashlib.sha256(b"".join(np.ascontiguousarray(array).tobytes() for array in arrays)).hexdigest()
    sys.stdout.write(f"{name} {text}\n")


if __name__ == "__main__":
    band = Scene(Block(0.5), Harmonic(4.6, 2.7, math.pi), BandNoise(0.04, (0.0, 10.0), 100))
    start = Start(0.3, -0.2, ((0.01, 0.0), (0.0, 0.01)))
    white = Scene(Block(0.7), Harmonic(3.0, 2.7, math.pi), WhiteNoise(0.012), start)
    for method, scene in (("exact", band), ("rk4", band), ("white", white)):
        ensemble = simulate(scene, cycles=4, realizations=1000, method=method)
        digest(method, ensemble.angle, ensemble.velocity, ensemble.overturn_time, ensemble.overturn_side)
        digest(f"{method} tally", *tally(scene, cycles=4, realizations=1000, method=method).counts)
        kept = histories(scene, cycles=2, realizations=200, method=method)
        digest(f"{method} histories", kept.angle, kept.impact_time, kept.impact_velocity)
        digest(f"{method} map", restarted_poincare_map(scene, cycles=3, realizations=500, method=method).points)
    digest("split", split(white, cycles=2, walkers=50, repeats=4).repeat_overturned)
    density = solve_fpk(white, cycles=2, tol=1e-2)
    digest("solve_fpk", density.survival, density.overturned, density.truncated, density.coefficients)
