"""Monte Carlo: speed against error, for the three methods; writes its section of docs/benchmarks.md.

python benchmarks/monte_carlo.py            # about 3 minutes
"""

import dataclasses
import math

import numpy as np
from report import ROOT, medians, table, write_section

from fpk_rocking import load_scene
from fpk_rocking.base.jit import kernel, run_in_parts
from fpk_rocking.physics.noise import band
from fpk_rocking.scene import Start
from montecarlo import simulate
from montecarlo.engines import rk4
from montecarlo.engines.band_noise import draw_start_and_noise
from montecarlo.engines.random import open_stream, stream_keys

MAIN = load_scene(ROOT / "cases" / "scenes" / "main.toml")
CYCLES = 10
STEPS = 200
TARGET = 1e-6


@kernel
def rotation_sum(begin, end, keys, parameters, samples, spacing, sink):
    """Sum the squares of the noise of each realization at equal times, each harmonic rotated from time to time.

    Realizations `begin` to `end` of those of `keys` (4,) uint64; `samples` (realizations,) are their numbers of times,
    `spacing` is that of the times in cycles, `parameters` are those of `rk4`. The sums go to `sink` (realizations,).
    """
    for r in range(begin, end):
        own = band.allocate_realization(parameters.band.harmonics, 1)
        draw_start_and_noise(open_stream(keys, r), parameters.start, parameters.band, own)
        band.write_rotation(own.ratios, spacing, own.hop[0], own.hop[1])
        band.set_centre(own, 0, 0.0)
        sink[r] = _rotated(own, samples[r])


@kernel(fastmath={"contract", "reassoc"})
def _rotated(own, samples):
    """Sum of the squares of the noise of a `band.Realization` at so many times, its `hop` apart."""
    cosines, sines, c, s = own.cosines, own.sines, own.hop[0], own.hop[1]
    total = 0.0
    for _ in range(samples):
        value = 0.0
        for n in range(cosines.size):
            x, y = cosines[n], sines[n]
            value += x
            cosines[n] = x * c[n] - y * s[n]
            sines[n] = y * c[n] + x * s[n]
        total += value * value
    return total


@kernel
def chunked_sum(begin, end, keys, parameters, samples, spacing, half, sink):
    """Make the same samples as `rotation_sum` as the engines make them: chunks of 2 * half + 1 about a centre.

    The arguments are those of `rotation_sum`; `sink` (realizations,) gets a number that depends on all samples.
    """
    for r in range(begin, end):
        own = band.allocate_realization(parameters.band.harmonics, half)
        draw_start_and_noise(open_stream(keys, r), parameters.start, parameters.band, own)
        band.write_sample_rotations(own, half, spacing)
        band.write_rotation(own.ratios, 2 * half * spacing, own.hop[0], own.hop[1])
        band.set_centre(own, 0, half * spacing)
        workspace, total = np.zeros(2 * half + 1), 0.0
        for _ in range((samples[r] + 2 * half - 1) // (2 * half)):
            workspace[:] = 0.0
            band.add_samples(own, half, workspace)
            band.rotate_centre(own, own.hop)
            total += workspace[0]
        sink[r] = total


def floor(realizations=20_000):
    """Return the time of rk4, of the rotation sum and of the chunked sum on the samples that rk4 needs."""
    ensemble = simulate(MAIN, cycles=CYCLES, realizations=realizations, method="rk4", steps_per_cycle=STEPS)
    parameters, keys, sink = rk4.parameters_of(MAIN, STEPS), stream_keys(1), np.empty(realizations)
    spacing, half = 0.5 / STEPS, rk4.workspace_of(parameters).low.size
    chunk = MAIN.period / STEPS * half
    lived = np.where(np.isnan(ensemble.overturn_time), CYCLES * MAIN.period, ensemble.overturn_time)
    samples = (np.ceil(lived / chunk - 1e-9) * 2 * half).astype(np.int64)
    return medians(
        {
            "rk4, the whole engine": lambda: simulate(
                MAIN, cycles=CYCLES, realizations=realizations, method="rk4", steps_per_cycle=STEPS
            ),
            "rotation sum alone": lambda: run_in_parts(
                rotation_sum, len(sink), keys, parameters, samples, spacing, sink
            ),
            "the engine's own sum alone": lambda: run_in_parts(
                chunked_sum, len(sink), keys, parameters, samples, spacing, half, sink
            ),
        }
    )


def map_errors(steps, realizations=4000):
    """Return the median error of rk4's one-cycle map from a cloud of starts, for each number of steps."""
    scene = dataclasses.replace(MAIN, start=Start(0.0, 0.3, ((0.25, 0.0), (0.0, 0.4))))
    exact = simulate(scene, cycles=1, realizations=realizations, method="exact")
    errors = []
    for n in steps:
        run = simulate(scene, cycles=1, realizations=realizations, method="rk4", steps_per_cycle=n)
        errors.append(np.nanmedian(np.hypot(run.angle - exact.angle, run.velocity - exact.velocity)[:, 1]))
    return np.array(errors)


def steps_at(error, steps, errors):
    """Return the number of steps with a given median error, from the fitted power law."""
    slope, offset = np.polyfit(np.log(steps), np.log(errors), 1)
    return math.ceil(math.exp((math.log(error) - offset) / slope))


def dynamics(realizations=20_000):
    """Compare exact with rk4 at several steps: rows of steps, map error, and time over that of exact."""
    tried = np.array([32, 48, 64, 96])
    target = steps_at(TARGET, tried, map_errors(tried))
    steps = [target, 100, STEPS, 800]

    def run(**options):
        return simulate(MAIN, cycles=CYCLES, realizations=realizations, **options)

    engines = {"exact": lambda: run(method="exact")}
    engines |= {f"{n}": lambda n=n: run(method="rk4", steps_per_cycle=n) for n in steps}
    seconds = medians(engines)
    errors = map_errors(steps)
    rows = [["exact", "-", "1e-13 *", "1"]]
    rows += [
        ["rk4", n, f"{error:.1e}", f"{seconds[str(n)] / seconds['exact']:.1f}"]
        for n, error in zip(steps, errors, strict=True)
    ]
    return rows, 1e6 * seconds["exact"] / realizations


def sampling():
    """Compare the three methods over realizations: rows of error in survival, of bins, and seconds."""
    rows, white = [], MAIN.white_equivalent()
    for method, scene, name in (
        ("exact", MAIN, "main_band"),
        ("rk4", MAIN, "main_band"),
        ("white", white, "main_white"),
    ):
        reference = np.load(ROOT / "tests" / "data" / f"{name}.npz")
        place = list(reference["cycles"]).index(4)
        for n in (1_000, 10_000, 100_000):
            ensembles = []

            def run(n=n, method=method, scene=scene, ensembles=ensembles):
                ensembles.append(simulate(scene, cycles=CYCLES, realizations=n, method=method, seed=1 + len(ensembles)))

            seconds = medians({"run": run}, rounds=3)["run"]
            survival = np.mean([np.abs(e.survival - reference["survival"][: CYCLES + 1]).max() for e in ensembles])
            edges = reference["angle_edges"], reference["velocity_edges"]
            l1 = np.mean(
                [np.abs(e.bin_probabilities(4, *edges) - reference["probabilities"][place]).sum() for e in ensembles]
            )
            rows.append([method, f"{n:,}", f"{survival:.1e}", f"{l1:.3f}", f"{seconds:.3f}"])
    return rows


def main():
    """Run all three parts and write the section."""
    sums = floor()
    unit = sums["rotation sum alone"]
    rows, micro = dynamics()
    times = {row[1]: row[3] for row in rows}
    write_section(
        "Monte Carlo: speed against error",
        f"""**Result.** `exact` is {times[STEPS]} times as fast as `rk4` with {STEPS} steps a cycle, and exact to
rounding.

Main scene (band [0, 10], 100 harmonics), {CYCLES} cycles, both cores.

**rk4 against its floor**, {STEPS} steps a cycle. What any such engine must do at least is to sample the noise. The
rotation sum does only that, at the same times of the same realizations, with one complex rotation for each harmonic and
sample. The engine's own way of summing is faster. Times are relative to the rotation sum.

{table(["", "time"], [[name, f"{seconds / unit:.2f}"] for name, seconds in sums.items()])}

**exact against rk4**, with the same realizations. Map error: the distance in angle and velocity after one cycle, as a
median over starts all over the plane. The first row of rk4 has the number of steps at which it is {TARGET:.0e}. Times
are relative to that of exact.

{table(["method", "steps a cycle", "map error", "time"], rows)}

\\* median error of impact times of random scenes over 5 cycles, against a solver with 50 digits
(`tests/montecarlo/test_exact.py`).
A realization of exact took {micro:.1f} μs in this run.

**Sampling**: errors against reference samples (`tests/data`; 10⁵ other realizations for band noise, 10⁷ paths for white
noise), as means over four seeds. L1 is that of the bins of 0.1 after cycle 4.

{table(["method", "realizations", "dS", "L1", "seconds"], sampling())}
""",
    )


if __name__ == "__main__":
    main()
