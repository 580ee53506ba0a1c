"""What a sweep costs beside its scenes, what a second worker gains, and how long a fragility curve takes.

The cost of a sweep is measured twice: as the processor time, of this process and all that it started, of a task that
does nothing, and by the clock, on real scenes of about 0.1 s against a plain loop, in rounds in which the ways take
turns, so that whatever slows one slows all. What two plain loops in processes of their own reach over one is what the
machine allows: two threads of one core are no two cores. Scenes that only wait tell what a second worker gains whatever
else the machine does. Workers are started beforehand, and what that takes is told by itself. Needs the optional extra
"cluster".

    NUMBA_NUM_THREADS=1 python benchmarks/sweeps.py
    NUMBA_NUM_THREADS=1 python benchmarks/sweeps.py --only clock
"""

import argparse
import contextlib
import multiprocessing
import os
import time
from concurrent.futures import ProcessPoolExecutor

import numpy as np
from report import ROOT

from fpk_rocking import BandNoise, load_scene
from fpk_rocking.risk import fragility
from fpk_rocking.studies import grid, scaled, sweep
from fpk_rocking.studies.execution import seed_of
from montecarlo import simulate

SCENES, ROUNDS, SCENE_S = 1000, 20, 0.1
WAITING, WAIT_S = 300, 0.1
CYCLES = 10


def nap(scene, *, seed, seconds=0.0):
    """Wait, and return as much as "mc" does."""
    if seconds:
        time.sleep(seconds)
    return {"survival": [1.0] * 11, "survivors": seed % 2, "realizations": 2, "method": scene.noise.kind}


def loop(scenes, realizations):
    """Survivors of scenes, as a loop without a sweep counts them; the seeds are those of a sweep."""
    runs = (simulate(scene, cycles=CYCLES, realizations=realizations, seed=seed_of(1, n)) for n, scene in scenes)
    return [int(run.survivors[-1]) for run in runs]


def spent(workers, scenes):
    """Seconds of processor time of a sweep that does nothing."""
    before = sum(os.times()[:4])
    with workers() as executor:
        sweep(scenes, nap, workers=executor)
    return sum(os.times()[:4]) - before


@contextlib.contextmanager
def cluster(workers):
    """Yield the executor of a Dask cluster on this machine."""
    from distributed import Client, LocalCluster

    options = {"n_workers": workers, "threads_per_worker": 1, "dashboard_address": ":0"}
    with LocalCluster(**options) as local, Client(local) as client:
        sweep(SOME[:4], nap, workers=client.get_executor())
        yield client.get_executor()


scene = load_scene(ROOT / "cases" / "scenes" / "main.toml")
SOME = grid(scene, {"forcing.amplitude": np.linspace(3.0, 5.0, SCENES)}).scenes


def cost():
    """Print the processor time of a sweep of tasks that do nothing."""
    ways = {
        "in this process": lambda: contextlib.nullcontext(1),
        "two processes": lambda: contextlib.nullcontext(2),
        "two Dask workers": lambda: cluster(2),
    }
    for name, workers in ways.items():
        few, many = spent(workers, SOME[:10]), spent(workers, SOME)
        print(f"{name}: {1e3 * (many - few) / (SCENES - 10):.2f} ms a scene, {few:.1f} s to start", flush=True)


def waits():
    """Print what a second Dask worker gains on scenes that only wait."""
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


def clock():
    """Print the seconds of real scenes in a plain loop, in two plain loops at once, and in sweeps on all workers."""
    size = _realizations()
    with contextlib.ExitStack() as stack:
        pool = stack.enter_context(ProcessPoolExecutor(2, multiprocessing.get_context("spawn")))
        single, double = stack.enter_context(cluster(1)), stack.enter_context(cluster(2))

        def swept(workers):
            """Return a function of a list of scenes: their survivors, by a sweep on workers."""
            return lambda part: _survivors(sweep(part, cycles=CYCLES, realizations=size, workers=workers))

        def halves(part):
            """Survivors of scenes, by two plain loops in processes of their own."""
            numbered = list(enumerate(part))
            futures = [pool.submit(loop, numbered[half::2], size) for half in (0, 1)]
            results = [0] * len(part)
            results[::2], results[1::2] = (future.result() for future in futures)
            return results

        ways = {
            "plain loop": lambda part: loop(enumerate(part), size),
            "sweep in this process": swept(1),
            "two plain loops at once": halves,
            "sweep on the same two processes": swept(pool),
            "sweep on one Dask worker": swept(single),
            "sweep on two Dask workers": swept(double),
        }
        clock, processor = _in_turns(ways)
    names, rounds = list(ways), clock.shape[1]
    print(
        f"{rounds * SCENES // ROUNDS} scenes of {size} realizations in {rounds} rounds; medians of rounds in brackets"
    )
    for way, rival in enumerate([0, 0, 0, 2, 0, 2]):
        ratio = np.median(clock[way] / clock[rival])
        print(
            f"{names[way]}: {clock[way].sum():.1f} s, {clock[way].sum() / clock[rival].sum():.3f} ({ratio:.3f}) of "
            f"{names[rival]}; of processor time {processor[way].sum() / processor[rival].sum():.3f}"
        )
    for name, (single, double) in {"plain loops": (0, 2), "Dask workers": (4, 5)}.items():
        gain = np.median(clock[single] / clock[double])
        print(f"two {name} over one: {clock[single].sum() / clock[double].sum():.2f} ({gain:.2f})")


def _in_turns(ways):
    """Seconds by the clock and of processor time (ways, rounds); in each round in another order.

    What is done can be stopped by an interruption: the rounds that are whole count.
    """
    seconds, names, size = [], list(ways), SCENES // ROUNDS
    for name in names:
        assert ways[name](SOME[:6]) == ways["plain loop"](SOME[:6]), "not the same bits"
    with contextlib.suppress(KeyboardInterrupt):
        for number in range(ROUNDS):
            part, own = SOME[number::ROUNDS][:size], {}
            for way in np.random.default_rng(number).permutation(len(names)):
                begin = time.perf_counter(), _processor()
                ways[names[way]](part)
                own[way] = time.perf_counter() - begin[0], _processor() - begin[1]
            seconds.append([own[way] for way in range(len(names))])
            print(f"round {number + 1} of {ROUNDS}: {np.round(seconds[-1], 1).T.tolist()}", flush=True)
    return np.transpose(seconds, (2, 1, 0))


def _processor():
    """Seconds of processor time of this process and all that it started."""
    import psutil

    own = psutil.Process()
    return sum(sum(process.cpu_times()[:2]) for process in [own, *own.children(recursive=True)])


def _realizations():
    """Realizations of which a scene takes about `SCENE_S` of processor time."""
    loop([(0, SOME[0])], 100)
    begin = time.process_time()
    loop([(0, SOME[0])], 4000)
    return round(4000 * SCENE_S / (time.process_time() - begin))


def _survivors(result):
    """Survivors of each scene of a `Sweep`."""
    return [row["values"]["survivors"] for row in result.rows]


def curves():
    """Print how long fragility curves take by the exact engine: of the main scene, and of the record of the project."""
    for cycles in (10, 40):
        result = fragility(scene, scale=np.geomspace(0.3, 1.5, 20), cycles=cycles)
        print(f"main scene, 20 scales, 10,000 realizations of {cycles} cycles: {result.wall_s:.1f} s", flush=True)
    shaken = recorded()
    for scale in (0.5, 0.7, 1.0, 1.5):
        begin = time.perf_counter(), time.process_time()
        result = simulate(scaled(shaken, scale), realizations=4000)
        clock, processor = time.perf_counter() - begin[0], time.process_time() - begin[1]
        rates = f"{60 * 4000 / clock:.2g} realizations a minute, {60 * 4000 / processor:.2g} a minute of processor time"
        print(f"record of 40 s at scale {scale}, {1.0 - result.survival[-1]:.3f} overturn: {rates}", flush=True)
    begin = time.process_time()
    result = fragility(shaken, scale=np.geomspace(0.3, 1.5, 20))
    print(
        f"record of 40 s, 20 scales, 10,000 realizations: {result.wall_s:.1f} s, {time.process_time() - begin:.1f} s "
        f"of processor time; P from {result.overturned[0, 0]:.3f} to {result.overturned[0, -1]:.3f}"
    )


def recorded():
    """Return the scene of the project's record, with band noise of 0.3 m/s² up to 8 Hz in place of white noise."""
    shaken = load_scene(ROOT / "cases" / "scenes" / "record.toml")
    size = shaken.block.dimensions
    noise = BandNoise(size.amplitude(0.3) ** 2, (0.0, size.frequency(8.0)), 100, envelope=shaken.noise.envelope)
    return shaken.varied(noise=noise)


if __name__ == "__main__":
    parts = {"cost": cost, "waits": waits, "clock": clock, "curves": curves}
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", choices=parts, nargs="+", default=tuple(parts), help="what to measure (all)")
    for chosen in parser.parse_args().only:
        parts[chosen]()
