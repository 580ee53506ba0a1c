"""What a sweep costs beside its scenes, what a second worker gains, and how long a fragility curve takes.

Scenes that only wait measure a sweep alone, whatever else the machine does. Needs the optional extra "cluster".

    python benchmarks/sweeps.py
"""

import functools
import time

import numpy as np
from report import ROOT

from fpk_rocking import load_scene
from studies import fragility, grid, sweep

SCENES = 1000
WAIT_S = 0.05


def nap(scene, *, seed, seconds):
    """Wait, and return as much as "mc" does."""
    time.sleep(seconds)
    return {"survival": [1.0] * 11, "survivors": seed % 2, "realizations": 2, "method": scene.noise.kind}


def timed(function):
    """Seconds of a call."""
    begin = time.perf_counter()
    function()
    return time.perf_counter() - begin


def main():
    """Print one line a measurement."""
    scene = load_scene(ROOT / "cases" / "scenes" / "main.toml")
    scenes = grid(scene, {"forcing.amplitude": np.linspace(3.0, 5.0, SCENES)})
    waiting = functools.partial(sweep, scenes, nap, seconds=WAIT_S)

    def tell(name, seconds, workers):
        least = SCENES * WAIT_S / workers
        print(
            f"{name}: {seconds:.1f} s, {least:.1f} s of it scenes: {100.0 * (seconds / least - 1.0):.1f} %", flush=True
        )

    tell("in this process", timed(waiting), 1)
    tell("two processes", timed(lambda: waiting(workers=2)), 2)
    from distributed import Client, LocalCluster

    options = {"threads_per_worker": 1, "dashboard_address": None}
    spent = {}
    for workers in (1, 2):
        with LocalCluster(n_workers=workers, **options) as cluster, Client(cluster) as client:
            executor = client.get_executor()
            sweep(scenes.scenes[:8], nap, seconds=0.0, workers=executor)
            tell(f"Dask, {workers} workers", timed(lambda: waiting(workers=executor)), workers)  # noqa: B023
            common = {"workers": executor, "cycles": 10, "realizations": 5000}
            sweep(scenes.scenes[:8], "mc", **common)
            spent[workers] = timed(lambda: sweep(scenes.scenes[:200], "mc", **common))  # noqa: B023
    print(f"Dask, 200 scenes of Monte Carlo: {spent[1]:.1f} s by one worker, {spent[2]:.1f} s by two")
    curve = functools.partial(fragility, scene, scale=np.geomspace(0.3, 1.5, 20), cycles=10)
    curve(realizations=10)
    print(f"a curve of 20 scales by the exact engine, 10,000 realizations each: {timed(curve):.1f} s")
    print(f"the same over 40 cycles: {timed(functools.partial(curve, cycles=40)):.1f} s")


if __name__ == "__main__":
    main()
