"""`solve_fpk` on blocks that people own, beside Monte Carlo; writes its section of docs/benchmarks.md.

The blocks are drawn at random: .3 to 1.2 m wide, 2.5 to 6 times as high, shaken at .15 to .8 g and .6 to 4 Hz for ten
cycles, with noise of .02 to .1 g. White-noise paths judge the answers; they are kept in results/practical_blocks, and
deleting that folder renews them.

    python benchmarks/practical_blocks.py                                # 24 scenes, 1e5 paths each
    python benchmarks/practical_blocks.py --seed 2 --tol 1e-2 --scenes 6 --paths 400000
"""

import argparse
import hashlib
import itertools
import math
import statistics
import time
import warnings
from typing import NamedTuple

import numpy as np
from hard_cases import bin_distances, sampling
from hard_rows import Reference
from report import ROOT, table, write_section

from fpk_rocking import load_scene, solve_fpk
from fpk_rocking.density.tuning import TUNING
from fpk_rocking.results import storage
from fpk_rocking.scene.axes import centred_edges, joint_edges
from fpk_rocking.scene.scene import Scene
from montecarlo import histories, simulate, tally

CYCLES = 10
BINNED = 4, 10
LEAST_STANDING = 0.01
TARGETS = 1e-3, 1e-4
BINNED_TARGET = 0.01
KEPT = ROOT / "results" / "practical_blocks"
TITLE = "Practical blocks"
COLUMNS = [
    "", "width, m", "height, m", "m/s²", "Hz", "e", "A", "Ω", "D", "S(10)", "dS (z)", "estimate", "L1 after 4",
    "L1 after 10", "s", "white, s", "exact, s", "warning or refusal",
]  # fmt: skip
_GRAVITY = 9.81
_SCREENED = 10_000
_TIMED = 20_000
_PATHS_SEED = 12
_TIMED_SEED = 13


def practical_blocks(seed, count, least=LEAST_STANDING):
    """Draw some number of scenes: band noise, Housner's restitution, from rest at phase 0.

    A scene in which less than a `least` part of the blocks stands after ten cycles is drawn again.
    """
    rng = np.random.default_rng(seed)

    def logarithmic(low, high):
        """Draw a number uniformly in its logarithm."""
        return math.exp(rng.uniform(math.log(low), math.log(high)))

    while count > 0:
        width = rng.uniform(0.3, 1.2)
        height = width * rng.uniform(2.5, 6.0)
        peak = _GRAVITY * logarithmic(0.15, 0.8)
        hertz = logarithmic(0.6, 4.0)
        rms = _GRAVITY * rng.uniform(0.02, 0.1)
        band = 0.0, rng.uniform(5.0, 10.0)
        scene = Scene.from_block(width, height, peak, hertz, noise_rms_acceleration=rms, noise_band_hz=band)
        if simulate(scene, cycles=CYCLES, realizations=_SCREENED, method="exact").survival[-1] >= least:
            count -= 1
            yield scene


class Row(NamedTuple):
    """What a scene came to: the answer, its errors, and the seconds that it took.

    `survival`: after ten cycles, by the reference, of which there are `paths`. `error`, `z`: largest error in survival
    over the cycles, and it over its standard error. `estimate`, `bins_estimate`: the solver's own. `distances`: of the
    two binned cycles, L1 and what sampling alone gives. From `error` to `distances` all are None without an answer.
    `seconds`: of `solve_fpk`, refused or not. `variance`, `rates`: the largest S (1 - S) over the cycles and seconds a
    path, by engine. `remark`: warnings, or the reason why there is no answer.
    """

    scene: Scene
    diffusion: float
    survival: float
    error: float | None
    z: float | None
    estimate: float | None
    bins_estimate: float | None
    distances: list | None
    paths: int
    seconds: float
    variance: dict
    rates: dict
    remark: str

    @property
    def answered(self):
        """Whether `solve_fpk` gave an answer."""
        return self.error is not None

    def sampling_seconds(self, engine, error):
        """Seconds that an engine needs for a standard error in survival."""
        return self.rates[engine] * max(1.0, self.variance[engine] / error**2)

    def binning_seconds(self, engine, distance):
        """Seconds that an engine needs for an expected L1 in the bins, of both binned cycles."""
        return self.rates[engine] * self.paths * (max(floor for _, floor in self.distances) / distance) ** 2

    def is_cheapest(self, seconds, target):
        """Whether `solve_fpk` answered in less time than any engine needs for a target, by a method that tells it."""
        return self.answered and self.seconds < min(seconds(engine, target) for engine in self.rates)


def motion_edges(scene):
    """Edges of bins, a twentieth of the range that the block moves in; the outermost bins go to the ends of the plane.

    The range leaves out a thousandth of the states of 2,000 white-noise paths at 16 times a cycle, symmetric about 0; 0
    is in the middle of a bin. As in the solver, a range below the least one is not divided further.
    """
    run = histories(scene, cycles=CYCLES, realizations=2000, seed=_TIMED_SEED, samples_per_cycle=16)
    ends = [edges[-1] for edges in joint_edges(scene)]
    edges_of_axes = []
    for values, end, least in zip(
        (run.angle, run.velocity), ends, (TUNING.least_angle_range, TUNING.least_velocity_range), strict=True
    ):
        reach = min(max(np.nanquantile(np.abs(values), 0.999), 0.5 * least), 0.95 * end)
        edges_of_axes.append(np.concatenate([[-end], centred_edges(-reach, reach, 20), [end]]))
    return edges_of_axes


def reference_of(scene, paths, kept=KEPT):
    """Return the `Reference` of a scene with white noise; from the folder of those kept where it is there."""
    settings = scene.to_toml(), paths, _PATHS_SEED, 200
    name = hashlib.sha256(repr((*settings, CYCLES, BINNED)).encode()).hexdigest()[:16]
    file = kept / f"{name}.npz"
    if file.exists():
        with np.load(file) as stored:
            return Reference(**stored)
    edges = motion_edges(scene)
    run = tally(
        scene,
        cycles=CYCLES,
        realizations=paths,
        seed=_PATHS_SEED,
        method="white",
        angle_edges=edges[0],
        velocity_edges=edges[1],
    )
    histogram = run.counts.histogram[list(BINNED)]
    reference = Reference(*map(np.array, settings), run.survivors, np.array(BINNED), *edges, histogram)
    kept.mkdir(parents=True, exist_ok=True)
    with storage.replaced_atomically(file) as temporary:
        np.savez_compressed(temporary, **reference._asdict())
    return reference


def engine_rates(scene, white, paths):
    """Return the largest S (1 - S) over the cycles and the seconds a path, of the white and of the exact engine."""
    variance, rates = {}, {}
    for engine, own in {"white": white, "exact": scene}.items():
        run = simulate(own, cycles=CYCLES, realizations=paths, method=engine, seed=_TIMED_SEED)
        likely = (run.survivors[1:] + 1.0) / (paths + 2.0)
        variance[engine], rates[engine] = float((likely * (1.0 - likely)).max()), run.wall_s / paths
    return variance, rates


def judged(scene, tol, paths, kept=KEPT):
    """Solve a scene and hold the answer against its reference: a `Row`, whatever comes."""
    white = scene.white_equivalent()
    reference = reference_of(white, paths, kept)
    variance, rates = engine_rates(scene, white, min(paths, _TIMED))
    begin = time.perf_counter()
    error = z = estimate = bins = apart = None
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            evolution = solve_fpk(scene, cycles=CYCLES, tol=tol, noise_replacement="white")
        except Exception as reason:  # noqa: BLE001  (the table says what came, and goes on)
            seconds, messages = time.perf_counter() - begin, [f"{type(reason).__name__}: {reason}"]
        else:
            seconds, messages = time.perf_counter() - begin, [str(warning.message) for warning in caught]
            truth, noise = sampling(reference)
            errors = np.asarray(evolution.survival) - truth
            worst = 1 + int(np.abs(errors[1:]).argmax())
            error, z, estimate = errors[worst], errors[worst] / noise[worst], evolution.error_estimate
            bins = evolution.bins_error_estimate
            apart = [(distance, floor) for distance, floor, _ in bin_distances(evolution, reference)]
    survival = reference.standing[-1] / reference.paths
    diffusion = white.noise.diffusion
    figures = error, z, estimate, bins, apart
    return Row(scene, diffusion, survival, *figures, paths, seconds, variance, rates, "; ".join(messages))


def cells_of(number, row):
    """Cells of a row of the table."""
    scene, size = row.scene, row.scene.block.dimensions
    frequency = scene.forcing.frequency * size.frequency_parameter / (2.0 * math.pi)
    peak = scene.forcing.amplitude * size.gravity * size.critical_angle
    own = ["-"] * 4
    if row.answered:
        own = [f"{row.error:+.1e} ({row.z:+.1f})", f"{row.estimate:.0e}"]
        own += [f"{distance:.4f} ({floor:.4f})" for distance, floor in row.distances]
    return [
        number,
        *(f"{value:.2f}" for value in (size.width, size.height, peak, frequency)),
        *(f"{value:.3g}" for value in (scene.block.restitution, scene.forcing.amplitude, scene.forcing.frequency)),
        f"{row.diffusion:.2g}",
        f"{row.survival:.5g}",
        *own,
        f"{row.seconds:.1f}",
        *(f"{row.sampling_seconds(engine, TARGETS[0]):.2g}" for engine in ("white", "exact")),
        row.remark.replace("|", "¦").replace("\n", " ") or "-",
    ]


def summary(rows, tol):
    """Lines that sum up the rows."""
    answers = [row for row in rows if row.answered]
    lines = [f"* answered: {len(answers)} of {len(rows)}, {sum(bool(row.remark) for row in answers)} with a warning"]
    for name, chosen in {"answers": answers, "refusals": [row for row in rows if not row.answered]}.items():
        spent = [row.seconds for row in chosen]
        if spent:
            lines.append(f"* seconds of the {name}: median {statistics.median(spent):.1f}, worst {max(spent):.1f}")
    if answers:
        worst = max(answers, key=lambda row: abs(row.error))
        largest = max(row.estimate for row in answers)
        lines.append(f"* largest |dS|, in units of tol: {abs(worst.error) / tol:.2g} (z = {worst.z:+.1f})")
        lines.append(f"* largest estimate, in units of tol: {largest / tol:.2g}")
    for error in TARGETS:
        cheap = [row for row in rows if row.is_cheapest(row.sampling_seconds, error)]
        count = sum(row.estimate <= error for row in cheap)
        lines.append(
            f"* faster than the best Monte Carlo at a standard error of {error:g} in survival: {len(cheap)} of "
            f"{len(rows)}; its own estimate certifies the error in {count}"
        )
    cheap = [row for row in rows if row.is_cheapest(row.binning_seconds, BINNED_TARGET)]
    count = sum(row.bins_estimate <= BINNED_TARGET for row in cheap)
    lines.append(
        f"* faster than the best Monte Carlo at an expected L1 of {BINNED_TARGET:g} in the bins: {len(cheap)} of "
        f"{len(rows)}; its own estimate certifies the error in {count}"
    )
    return "\n".join(lines)


def body(rows, options):
    """Text of the section."""
    lines = itertools.starmap(cells_of, enumerate(rows, 1))
    return f"""**Result**, `solve_fpk` at tol {options.tol:g}:

{summary(rows, options.tol)}

The {len(rows)} blocks are drawn at random (seed {options.seed}): width .3 to 1.2 m, height 2.5 to 6 times that,
Housner's restitution e, a peak acceleration of .15 to .8 g at .6 to 4 Hz, noise of .02 to .1 g from 0 to 5-10 Hz; from
rest, {CYCLES} cycles. A block that stands with a probability below {LEAST_STANDING:g} under band noise is drawn again.
A and Ω are the nondimensional amplitude and frequency of the forcing, D is the diffusion of the equivalent white noise.

S(10) is by {options.paths:,} white-noise paths, and all errors are against them. z is the error dS over its standard
error. Estimate: the solver's own. Bins are a twentieth of the motion's range in angle and in velocity, those about
rest, |x| < {TUNING.rest_angle:g} and |v| < {TUNING.rest_velocity:g}, together one; in brackets the L1 of sampling
alone. s: seconds of one call of `solve_fpk`, answered or refused. white, exact: seconds of these engines for a standard
error of {TARGETS[0]:g} in survival. From n paths that took t this is t S (1 - S) / (n {TARGETS[0]:g}²), with S at the
cycle where S (1 - S) is largest, and at least one path. An error ten times smaller takes a hundred times as long.
All on both cores.

{table(COLUMNS, lines)}
"""


def main():
    """Judge the scenes, print each as it comes, and write the section."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=5119, help="of the scenes (default: %(default)s)")
    parser.add_argument("--tol", type=float, default=1e-3, help="asked of solve_fpk (default: %(default)s)")
    parser.add_argument("--scenes", type=int, default=24, help="how many (default: %(default)s)")
    parser.add_argument("--paths", type=int, default=100_000, help="white-noise paths a scene (default: %(default)s)")
    options = parser.parse_args()
    rows = []
    for number, scene in enumerate(practical_blocks(options.seed, options.scenes), 1):
        if not rows:
            compile_all(scene)
        rows.append(judged(scene, options.tol, options.paths))
        print(*cells_of(number, rows[-1]), sep=" | ", flush=True)
    write_section(TITLE, body(rows, options))


def compile_all(scene):
    """Compile what is timed; the solver on a scene that it answers."""
    engine_rates(scene, scene.white_equivalent(), 64)
    solve_fpk(load_scene(ROOT / "cases" / "scenes" / "main.toml"), cycles=1, tol=1e-2)


if __name__ == "__main__":
    main()
