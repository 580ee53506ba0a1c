"""What a sweep costs beside its scenes, what a second worker gains, and how long a fragility curve takes.

The cost of a sweep is the processor time, of this process and all that it started, of a verb that does nothing. Scenes
that only wait tell what a second worker gains whatever else the machine does. Needs the optional extra "cluster".

    python benchmarks/sweeps.py
"""

import contextlib
import os
import time

import numpy as np
from report import ROOT

from fpk_rocking import load_scene
from studies import fragility, grid, sweep

SCENES = 1000
WAITING, WAIT_S = 300, 0.1


def nap(scene, *, seed, seconds=0.0):
    """Wait, and return as much as "mc" does."""
    if seconds:
        time.sleep(seconds)
    return {"survival": [1.0] * 11, "survivors": seed % 2, "realizations": 2, "method": scene.noise.kind}


def spent(workers, scenes):
    """Seconds of processor time of a sweep that does nothing, and seconds by the clock of one that waits."""
    before = sum(os.times()[:4])
    with workers() as executor:
        sweep(scenes, nap, workers=executor)
    return sum(os.times()[:4]) - before


@contextlib.contextmanager
def cluster(workers):
    """Yield the executor of a Dask cluster on this machine."""
    from distributed import Client, LocalCluster

    options = {"n_workers": workers, "threads_per_worker": 1, "dashboard_address": None}
    with LocalCluster(**options) as made, Client(made) as client:
        sweep(SOME[:4], nap, workers=client.get_executor())
        yield client.get_executor()


scene = load_scene(ROOT / "cases" / "scenes" / "main.toml")
SOME = grid(scene, {"forcing.amplitude": np.linspace(3.0, 5.0, SCENES)}).scenes


def main():
    """Print one line a measurement."""
    ways = {
        "in this process": lambda: contextlib.nullcontext(1),
        "two processes": lambda: contextlib.nullcontext(2),
        "two Dask workers": lambda: cluster(2),
    }
    for name, workers in ways.items():
        few, many = spent(workers, SOME[:10]), spent(workers, SOME)
        print(f"{name}: {1e3 * (many - few) / (SCENES - 10):.2f} ms a scene, {few:.1f} s to start", flush=True)
    clock = {}
    for workers in (1, 2):
        with cluster(workers) as executor:
            begin = time.perf_counter()
            sweep(SOME[:WAITING], nap, workers=executor, seconds=WAIT_S)
            clock[workers] = time.perf_counter() - begin
    least = WAITING * WAIT_S
    print(
        f"{WAITING} waits of {WAIT_S} s: one Dask worker {clock[1]:.1f} s ({least:.0f} at least), two {clock[2]:.1f} s"
    )
    for cycles in (10, 40):
        found = fragility(scene, scale=np.geomspace(0.3, 1.5, 20), cycles=cycles)
        print(f"a curve of 20 scales by the exact engine, 10,000 realizations of {cycles} cycles: {found.wall_s:.1f} s")


if __name__ == "__main__":
    main()
