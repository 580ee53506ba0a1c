"""`probability` against ten times the paths: is the truth inside answer ± error, and what does the answer cost.

The scenes are drawn at random, in turn of these kinds: exact blocks under band noise, white noise, filtered noise, a
pulse with band noise, a record with band noise. The truth is the same engine with other seeds and ten times the paths;
where these take more than a fifth of `--truth-s` processor seconds, as many as bring its standard error to a third of
the answer's error, or as near as `--truth-s` brings it; of a rare probability of which these see few, splitting.
Hindsight is the time that the cheapest single engine takes: paths alone, as many as the true probability asks for, at
the speed of the reference; under white noise the density too, where its error is small enough, or splitting.

    python benchmarks/probability.py                              # 60 scenes at 5e-3, 30 processor minutes
    python benchmarks/probability.py --tol 5e-4 --scenes 15
    python benchmarks/probability.py --rtol 0.1 --scenes 20 --rare
    python benchmarks/probability.py --coverage                   # of the rule by which paths are added, without blocks
"""

import argparse
import json
import math
import pathlib
import re
import statistics
import time
import types
import warnings

import numpy as np
from report import table, write_section

from fpk_rocking import Scene, probability, solve_fpk
from fpk_rocking.base.jit import at_most
from fpk_rocking.results.sampling import wilson_interval
from fpk_rocking.risk import synthetic_records
from fpk_rocking.scene import FilteredNoise, Pulse
from fpk_rocking.studies import probability as choice
from fpk_rocking.studies.probability import PILOT, REPEATS, WantedError
from montecarlo import simulate, split
from montecarlo.engines.walkers import score_table

CYCLES = 10
KINDS = "band", "white", "filtered", "pulse", "record"
_Z = 1.959964
_TRUTH_SEED, _ANSWER_SEED = 5001, 1
_FEW = 400
"""Overturned paths of a truth below which splitting takes their place."""


def drawn(kind, random):
    """Return a scene of a kind, and the rows that are asked for."""
    width = random.uniform(0.3, 1.2)
    height = width * random.uniform(2.5, 6.0)
    peak, hertz = math.exp(random.uniform(math.log(0.2), math.log(0.8))), random.uniform(0.6, 3.0)
    rms, band = 9.81 * random.uniform(0.02, 0.1), (0.0, random.uniform(5.0, 10.0))
    noise = {"noise_rms_acceleration": rms, "noise_band_hz": band}
    if kind == "record":
        motion = synthetic_records(1, duration=8.0, seed=int(random.integers(1 << 30)))[0]
        return Scene.from_block(width, height, record=motion, **noise), {}
    scene = Scene.from_block(width, height, f"{peak:.3f} g", f"{hertz:.3f} Hz", **noise)
    if kind == "pulse":
        pulse = Pulse("one-sine", scene.forcing.amplitude * 1.5, scene.forcing.frequency)
        return scene.varied(forcing=pulse), {}
    if kind == "white":
        scene = scene.white_equivalent()
    if kind == "filtered":
        ratio = random.uniform(0.5, 1.0)
        noise = FilteredNoise("low-pass", scene.noise.variance, random.uniform(4.0, 12.0), ratio)
        scene = scene.varied(noise=noise)
    return scene, {"cycles": CYCLES}


def scenes(seed, count, rare):
    """Draw scenes whose probability is above .002 and below .998, or with `rare` from 1e-6 to 1e-2."""
    random = np.random.default_rng(seed)
    while count > 0:
        kind = KINDS[(count - 1) % (2 if rare else len(KINDS))]
        scene, rows = drawn(kind, random)
        share = 1.0 - simulate(scene, realizations=1000 if rare else 4000, seed=9, **rows).survival[-1]
        if rare and share < 0.003:
            if kind == "white":
                share = float(split(scene, walkers=20, repeats=10, seed=9, **rows).probability[-1])
            else:
                share = 1.0 - simulate(scene, realizations=100_000, seed=9, **rows).survival[-1]
        if (1e-6 < share < 1e-2) if rare else (0.002 < share < 0.998):
            count -= 1
            yield kind, scene, rows


def row_of(kind, scene, rows, wanted, truth_s):
    """Answer a scene, and hold the answer against the truth; return a row as a dict."""
    begin = time.process_time()
    try:
        answer = probability(scene, seed=_ANSWER_SEED, **rows, **wanted)
    except ValueError as error:
        return {"kind": kind, "refused": str(error), "seconds": time.process_time() - begin}
    spent = time.process_time() - begin
    truth, sampling, path_s = _truth(scene, rows, answer, truth_s)
    hindsight = path_s * _paths(truth, answer.wanted)
    if scene.noise.kind == "white" and answer.wanted >= 1e-4:
        hindsight = min(hindsight, _density_seconds(scene, rows, answer.wanted))
    if answer.method == "splitting":
        hindsight = min(hindsight, _splitting_seconds(scene, rows, answer))
    return {
        "kind": kind,
        "truth": truth,
        "sampling": sampling,
        "answer": answer.overturned,
        "error": answer.error,
        "wanted": answer.wanted,
        "inside": bool(abs(truth - answer.overturned) <= math.hypot(answer.error, sampling)),
        "verdict": answer.verdict,
        "method": answer.method,
        "seconds": spent,
        "hindsight": hindsight,
    }


def _paths(share, wanted):
    """Return the number of paths whose 95 % interval (Wilson's) about a share reaches as far as the wanted error."""
    count = max(share * (1.0 - share) * (_Z / wanted) ** 2, 1.0)
    while np.abs(wilson_interval(share * count, count) - share).max() > wanted:
        count *= 1.01
    return count


def _truth(scene, rows, answer, truth_s):
    """Probability by other seeds, half of its 95 % interval, and processor seconds of a path."""
    simulate(scene, realizations=200, seed=_TRUTH_SEED, **rows)
    begin = time.process_time()
    simulate(scene, realizations=2000, seed=_TRUTH_SEED, **rows)
    path_s = (time.process_time() - begin) / 2000
    variance = max(answer.overturned * (1.0 - answer.overturned), 1e-12)
    tenfold = max(10.0 * variance * (_Z / answer.wanted) ** 2, 20_000)
    most = max(truth_s / path_s, 4000)
    third = max(variance * (3.0 / answer.error) ** 2, 20_000)
    count = int(tenfold if 5.0 * tenfold <= most else min(third, most))
    if count * answer.overturned < _FEW and answer.method == "splitting":
        rare = split(scene, walkers=1200, repeats=32, seed=_TRUTH_SEED, **rows)
        return float(rare.probability[-1]), 2.04 * float(rare.standard_error[-1]), path_s
    begin = time.process_time()
    sample = simulate(scene, realizations=count, seed=_TRUTH_SEED, **rows)
    path_s = (time.process_time() - begin) / count
    truth = 1.0 - float(sample.survival[-1])
    return truth, _Z * math.sqrt(max(truth * (1.0 - truth), 1.0 / count) / count), path_s


def _splitting_seconds(scene, rows, answer):
    """Processor seconds of splitting alone with the walkers of an answer, its score included."""
    score_table.cache_clear()
    begin = time.process_time()
    split(scene, walkers=answer.realizations // REPEATS, repeats=REPEATS, seed=_TRUTH_SEED, **rows)
    return time.process_time() - begin


def _density_seconds(scene, rows, wanted):
    """Processor seconds of the density where its estimated error is within the wanted one, else inf."""
    begin = time.process_time()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            density = solve_fpk(scene, tol=wanted, bins_tol=math.inf, **rows)
    except ValueError:
        return math.inf
    return time.process_time() - begin if density.error_estimate <= wanted else math.inf


def coverage(share, wanted, repeats, random):
    """Share of repetitions whose answer ± error contains the probability, and the mean number of paths.

    Only the number of overturned paths is drawn (binomial); stages are added by the rule of `probability`.
    """
    inside = total = 0
    for _ in range(repeats):
        paths = overturned = 0
        until = 2 * PILOT
        while True:
            overturned += random.binomial(until - paths, share)
            paths = until
            low, high = wilson_interval(overturned, paths)
            error = max(high - overturned / paths, overturned / paths - low)
            if error <= wanted.of(overturned / paths):
                break
            until = wanted.next_stage(overturned, paths)
        inside += abs(overturned / paths - share) <= error
        total += paths
    return inside / repeats, total / repeats


def write_coverage(repeats=20_000, seed=3902):
    """Measure the coverage of the stopping rule, and write the section."""
    random = np.random.default_rng(seed)
    asked = [("tol", 5e-3), ("tol", 1e-3), ("rtol", 0.1)]
    rows = []
    for name, value in asked:
        wanted = WantedError(**({"tol": 0.0, "rtol": 0.0} | {name: value}))
        for share in (1e-5, 1e-4, 1e-3, 0.01, 0.03, 0.1, 0.3, 0.5):
            rows.append([f"{name} {value:g}", share, *coverage(share, wanted, repeats, random)])
            print(rows[-1], flush=True)
    lines = table(
        ["wanted", "probability", "inside", "mean paths"],
        [[asked, f"{share:g}", f"{inside:.4f}", f"{paths:.3g}"] for asked, share, inside, paths in rows],
    )
    least, error = min(row[2] for row in rows), math.sqrt(0.05 * 0.95 / repeats)
    body = f"""**Result.** Paths added in stages until the error is as wanted: answer ± error contains the
probability in {100.0 * least:.1f} % of {repeats:,} repetitions or more
(standard error {100.0 * error:.2f} %), of 95 % asked.

{lines}
"""
    write_section("Coverage of the stopping rule of probability", body, page=None)


def _answers(options, wanted):
    """Draw scenes and answer them; return their rows. Those in the file `options.keep` are not answered again."""
    kept = pathlib.Path(options.keep) if options.keep else None
    lines = kept.read_text().splitlines() if kept and kept.exists() else []
    results = {row["number"]: row for row in map(json.loads, lines)}
    for kind in KINDS:  # machine code
        scene, rows = drawn(kind, np.random.default_rng(0))
        probability(scene, tol=0.05, **rows)
    white = drawn("white", np.random.default_rng(0))[0]
    solve_fpk(white, cycles=1, tol=1e-2)
    split(white, cycles=1, walkers=10, repeats=2)
    for number, draw in enumerate(scenes(options.seed, options.scenes, options.rare)):
        if number in results:
            continue
        results[number] = {"number": number} | row_of(*draw, wanted, options.truth_s)
        print(results[number], flush=True)
        if kept:
            with kept.open("a") as file:
                file.write(json.dumps(results[number]) + "\n")
    return [results[number] for number in sorted(results)]


def write_answers(options):
    """Draw scenes, answer them, and write the section."""
    wanted = {name: getattr(options, name) for name in ("tol", "rtol") if getattr(options, name)} or {"tol": 5e-3}
    # Processor seconds on one thread: what else the machine does has no influence on the choice of engines.
    choice.time = types.SimpleNamespace(perf_counter=time.process_time)
    with at_most(1):
        results = _answers(options, wanted | {"limit_s": options.limit_s})
    write_rows(results, ", ".join(f"{name} {value:g}" for name, value in wanted.items()), options.limit_s)


def write_rows(results, asked, limit_s):
    """Write the section of rows (dicts), as `row_of` returns them; one without seconds was not timed.

    `limit_s`: seconds that an answer might take.
    """
    answered = [row for row in results if "answer" in row]
    refused = [row for row in results if "refused" in row]
    inside = sum(row["inside"] for row in answered)
    twice = sum(
        row["verdict"] == "ok" and abs(row["truth"] - row["answer"]) > 2.0 * row["error"] + row["sampling"]
        for row in answered
    )
    sharp = [row for row in answered if row["sampling"] <= 0.4 * _Z * row["error"]]
    ratios = [row["seconds"] / row["hindsight"] for row in answered if row.get("hindsight", 0.0) > 0.2]
    spent = [row["seconds"] for row in refused] or [math.nan]
    predicted = [min(map(float, re.findall(r"about ([\d.e+]+) s", row["refused"]))) for row in refused]
    body = f"""**Result.** The truth was inside answer ± error in {inside} of {len(answered)} scenes ({asked}); "ok" was
wrong by more than twice its error in {twice}; {len(refused)} of {len(results)} were refused as longer than {
        limit_s:g} s,
after {statistics.median(spent):.1f} s (median; the longest {max(spent):.1f} s).

Of those refused {sum(seconds <= 600.0 for seconds in predicted)} were predicted to take less than 600 s, the default
limit; the median was {statistics.median(predicted or [math.nan]):.0f} s.

Inside: the truth less the answer is at most the root of the sum of the squares of the answer's error and of half of the
95 % interval of the truth. The standard error of the truth is at most .4 of the answer's error in {len(sharp)}
scenes, of which {sum(row["inside"] for row in sharp)} are inside; in the others the truth is the less certain.

Processor seconds over those of the cheapest engine in hindsight, where that takes more than .2 s ({len(ratios)}
scenes): median {statistics.median(ratios) if ratios else math.nan:.2f}, largest {max(ratios, default=math.nan):.2f}.

{
        table(
            ["kind", "truth", "answer", "error", "wanted", "method", "verdict", "s", "hindsight, s"],
            [
                [
                    row["kind"],
                    f"{row['truth']:.3g} ± {row['sampling']:.1g}",
                    f"{row['answer']:.3g}",
                    f"{row['error']:.2g}",
                    f"{row['wanted']:.2g}",
                    row["method"],
                    row["verdict"],
                    *(f"{row[name]:.2f}" if name in row else "-" for name in ("seconds", "hindsight")),
                ]
                for row in answered
            ],
        )
    }
"""
    write_section(f"Probability of overturning, {asked}", body, page=None, values={"rows": results})


def main():
    """Measure what was asked for, and write the section."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=3901)
    parser.add_argument("--scenes", type=int, default=60)
    parser.add_argument("--tol", type=float)
    parser.add_argument("--rtol", type=float)
    parser.add_argument("--rare", action="store_true")
    parser.add_argument("--limit-s", type=float, default=600.0, help="seconds that an answer may take")
    parser.add_argument("--truth-s", type=float, default=60.0, help="processor seconds that a truth may take")
    parser.add_argument("--keep", help="file to which each row is added, and that is gone on with")
    parser.add_argument("--coverage", action="store_true")
    options = parser.parse_args()
    if options.coverage:
        write_coverage()
    else:
        write_answers(options)


if __name__ == "__main__":
    main()
