"""Filtered noise by `solve_fpk` and by sampling, with and without rest; writes its table into docs/benchmarks.

Random scenes start at rest with phase 0 and are followed for ten cycles. Paths of the engine `filtered` take 1,600
steps a cycle: the share of blocks at rest converges slowly in them, and eight times the usual number leaves .002.

    python benchmarks/filtered_noise.py                  # about 30 minutes
    python benchmarks/filtered_noise.py --seed 7 --scenes 2
"""

import argparse
import time
import warnings

import numpy as np
from report import table, write_section

from fpk_rocking import Block, FilteredNoise, Harmonic, Scene, solve_fpk
from montecarlo import simulate

SEED = 25114
FILTERS = "exponential", "low-pass", "kanai-tajimi"
TOL, CYCLES, STEPS = 1e-2, 10, 1600
SIGMAS, LEFT = 3.5, 0.002
COLUMNS = [
    "filter, frequency",
    "A, Ω, e, variance",
    "S(10), paths",
    "largest error of S",
    "estimate",
    "at rest after 10, paths",
    "largest error at rest",
    "estimate",
    "CPU s, density",
    "paths",
    "warning or refusal",
]


def random_scene(rng, filtered, rests):
    """Draw a scene whose forcing alone lifts the block off, or does not."""
    frequency = rng.uniform(5.0, 12.0)
    noise = FilteredNoise(filtered, rng.uniform(0.01, 0.045), frequency, *[0.6][: filtered != "exponential"])
    amplitude = rng.uniform(0.7, 1.0) if rests else rng.uniform(2.5, 4.0)
    return Scene(Block(rng.uniform(0.5, 0.9)), Harmonic(amplitude, rng.uniform(1.5, 3.0)), noise)


def judged(scene, paths):
    """Return a row of the table, and whether survival and rest are right within tolerance, estimate and sampling."""
    begin = time.process_time()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            density = solve_fpk(scene, cycles=CYCLES, tol=TOL)
        except ValueError as refusal:
            return [*_names(scene), *["-"] * 8, f"refused: {refusal}"], None
    solving = time.process_time() - begin
    begin = time.process_time()
    sample = simulate(scene, cycles=CYCLES, realizations=paths, seed=1, steps_per_cycle=STEPS)
    sampling = time.process_time() - begin
    apart = [np.abs(density.survival - sample.survival), np.abs(density.at_rest - sample.at_rest)]
    errors = [np.sqrt(part * (1.0 - part) / paths) for part in (sample.survival, sample.at_rest)]
    estimates = density.error_estimate, density.rest_error_estimate
    allowed = max(TOL, estimates[0]), estimates[1] + LEFT
    inside = [
        bool((difference <= most + SIGMAS * error).all())
        for difference, most, error in zip(apart, allowed, errors, strict=True)
    ]
    row = _names(scene)
    for ours, theirs, difference, estimate in zip(
        (density.survival, density.at_rest), (sample.survival, sample.at_rest), apart, estimates, strict=True
    ):
        row += [f"{ours[-1]:.4f}, {theirs[-1]:.4f}", f"{difference.max():.4f}", f"{estimate:.4f}"]
    messages = "; ".join(str(warning.message) for warning in caught) or "-"
    return [*row, f"{solving:.0f}", f"{sampling:.0f}", messages], inside


def _names(scene):
    """Filter and forcing of a scene, as two cells of text."""
    noise, force = scene.noise, scene.forcing
    return [
        f"{noise.filter}, {noise.frequency:.1f}",
        f"{force.amplitude:.2f}, {force.frequency:.2f}, {scene.block.restitution:.2f}, {noise.variance:.3f}",
    ]


def main():
    """Judge the scenes and write the section."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--scenes", type=int, default=2, help="of each filter, with rest and without")
    parser.add_argument("--paths", type=int, default=40_000)
    options = parser.parse_args()
    rng, rows, inside_by_scene = np.random.default_rng(options.seed), [], []
    for rests in (False, True):
        for filtered in FILTERS:
            for _ in range(options.scenes):
                row, inside = judged(random_scene(rng, filtered, rests), options.paths)
                rows.append(row)
                inside_by_scene.append(inside)
                print(*row, inside, flush=True)
    text = section(rows, inside_by_scene, options.seed, options.paths)
    if options.seed == SEED:
        write_section("Density solver: filtered noise", text, page=None)
    else:
        print(text)


def section(rows, inside_by_scene, seed, paths):
    """Return the text of the section: how many scenes are right, and the rows of the table."""
    answered = [inside for inside in inside_by_scene if inside]
    rests = [inside[1] for row, inside in zip(rows, inside_by_scene, strict=True) if inside and float(row[7]) > 0.0]
    seconds = [float(row[8]) for row in rows if row[8] != "-"]
    return f"""**Result**, `solve_fpk` at tol {TOL:g}: {len(answered)} of {len(rows)} scenes answered; survival is
right in {sum(survives for survives, _ in answered)} of them, the share of blocks at rest in {sum(rests)} of the
{len(rests)} in which any rest. A call took {min(seconds):.0f} to {max(seconds):.0f} CPU s.

Random scenes (seed {seed}, drawn after the solver was finished); {CYCLES} cycles from rest, against {paths:,} paths of
the engine `filtered` with {STEPS:,} steps a cycle, whose sampling is part of the errors in the table. Right: within the
larger of tol and estimate (survival), within estimate and {LEFT:g} for what steps leave (rest), and {SIGMAS} standard
errors of the paths. A, Ω: amplitude and frequency of the forcing.

{table(COLUMNS, rows)}
"""


if __name__ == "__main__":
    main()
