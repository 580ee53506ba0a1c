"""An audit that can be repeated: scenes of all kinds drawn at random, public answers with their errors, other engines.

A scene is drawn by `audit_scenes.py`, which knows no engine. The answer is that of a user's call with its stated
errors; the truth is that of the engine that shares least with it: paths for a density, an integration of this benchmark
(`audit_truth.py`) for paths of white and filtered noise and for motions without noise, and steps of rk4, which share
the noise alone, for the exact engine under band noise. What is outside is asked again, with other seeds and four times
the paths. `--out FILE.csv` keeps every comparison, and a further call goes on after those that are there.

    python benchmarks/audit.py --seed 1 --count 40 --limit-s 1500 --out results/audit.csv --page
    python benchmarks/audit.py --seed 7 --count 10 --kinds white density
    python benchmarks/audit.py --seed 1 --only white-3         # one scene, every comparison
"""

import argparse
import contextlib
import json
import math
import pathlib
import signal
import time
import warnings
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from audit_findings import (
    NEARLY,
    SIGMAS,
    Comparison,
    Finding,
    alarms,
    keep,
    kept,
    miss_lines,
    noticed,
    summary,
)
from audit_scenes import KINDS, Draw, drawn
from audit_truth import Motion, sampled
from report import VALIDATION, table, write_section

from fpk_rocking import CycleOperator, probability, solve_fpk
from fpk_rocking.base.jit import at_most
from fpk_rocking.results import sampling
from fpk_rocking.scene.axes import joint_edges
from montecarlo import simulate, split

TITLE = "Random audit"
MOTION_ERROR = 1e-5
"""Difference of a motion without noise that is let pass: a motion amplifies that of which it begins."""
STUDENT = 2.0395
"""97.5 % point of Student's distribution of 31 degrees of freedom, of 32 repeats of splitting."""
MISSES = ["outside", "quantity", "answer", "truth", "excess", "verdict", "method"]
_MORE = 4
_ANSWER_SEED, _TRUTH_SEED = 1, 70_001


class Answer(NamedTuple):
    """Values of a call with stated errors by quantity, its verdict and method, and what else it said."""

    values: dict[str, tuple[float, float]]
    verdict: str
    method: str
    hard: bool
    edges: tuple | None = None
    bins: np.ndarray | None = None


class Options(NamedTuple):
    """How exactly is asked: wanted error, paths of a truth, seconds that a scene may take, seed of the scenes."""

    tol: float = 5e-3
    paths: int = 100_000
    scene_s: float = 60.0
    seed: int = 1

    @property
    def settings(self) -> str:
        """What decides the numbers, as a text."""
        return f"seed {self.seed}, tol {self.tol:g}, {self.paths} paths"


class StoppedError(Exception):
    """A call took longer than a scene may."""


@contextlib.contextmanager
def _at_most(seconds):
    """Raise `StoppedError` in what runs within the block after some processor seconds, as other work has no say."""

    def stop(_signal, _frame):
        raise StoppedError

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


def answer_of(kind: str, draw: Draw, options: Options, seed: int) -> Answer:
    """Ask as a user does; ValueError where the call refuses."""
    if kind in ("density", "passing density", "filtered density"):
        return _density(draw, options)
    if kind == "operator":
        operator = CycleOperator(draw.scene, tol=options.tol)
        estimate = operator.estimate_survival(draw.looked_at)
        pairs = zip(draw.looked_at, estimate.survival, estimate.error_estimate, strict=True)
        return Answer({f"survival {k}": (s, e) for k, s, e in pairs}, operator.trust.verdict, "operator", True)
    if kind == "splitting":
        rare = split(draw.scene, cycles=draw.cycles, walkers=400, seed=seed)
        errors = STUDENT * rare.repeat_overturned.std(axis=0, ddof=1) / math.sqrt(rare.repeats)
        values = {}
        for k in draw.looked_at:
            values[f"survival {k}"] = float(rare.survival[k]), STUDENT * float(rare.standard_error[k])
            for column, name in enumerate(("left", "right")):
                values[f"{name} {k}"] = float(rare.overturned[k, column]), float(errors[k, column])
        return Answer(values, rare.trust.verdict, "splitting", False)
    answer = probability(draw.scene, **draw.rows, tol=options.tol, seed=seed, limit_s=options.scene_s)
    values = {}
    for k in draw.looked_at:
        for column, name in enumerate(("survival", "left", "right")):
            values[f"{name} {k}"] = float(getattr(answer, name)[k]), float(answer.errors[k, column])
    hard = answer.method in ("density", "one path")
    method = f"{answer.method} {answer.engine}".strip()
    if kind == "calm" and draw.scene.start.covariance is None:
        path = simulate(draw.scene, **draw.rows, realizations=1)
        over = float(path.overturn_time[0])
        values |= {"overturning time": (over, MOTION_ERROR)} if path.overturn_side[0] else {}
        if not path.overturn_side[0]:
            values["angle"] = float(path.angle[0, -1]), MOTION_ERROR
            values["velocity"] = float(path.velocity[0, -1]), MOTION_ERROR
    return Answer(values, answer.trust.verdict, method, hard)


def _density(draw, options):
    """Return survival, sides, the table of bins and rectangles of a density."""
    density = solve_fpk(draw.scene, **draw.rows, tol=options.tol)
    values, error = {}, float(density.error_estimate)
    for k in draw.looked_at:
        values[f"survival {k}"] = float(density.survival[k]), error
        for column, name in enumerate(("left", "right")):
            values[f"{name} {k}"] = float(density.overturned[k, column]), error
    last = draw.looked_at[-1]
    edges = bins = None
    if last not in density.settings.get("unresolved", ()):
        # The region of rest is in one bin: of it the mesh knows the whole alone.
        limits = joint_edges(draw.scene)
        inner = [-0.6, -0.25, -0.06, 0.06, 0.25, 0.6], [-1.2, -0.5, -0.15, 0.15, 0.5, 1.2]
        edges = tuple(
            np.array([line[0], *(x for x in cuts if line[0] < x < line[-1]), line[-1]])
            for line, cuts in zip(limits, inner, strict=True)
        )
        bins = np.asarray(density.bin_probabilities(last, *edges))
        stated = float(density.bins_error_estimate + density.rest_error_estimate)
        values[f"bins {last}"] = 0.0, stated
        for name, place in _RECTANGLES.items():
            values[f"{name} {last}"] = float(bins[place(bins.shape)].sum()), stated
    return Answer(values, density.trust.verdict, "density", True, edges, bins)


_RECTANGLES: dict[str, Callable] = {
    "rest": lambda shape: (shape[0] // 2, shape[1] // 2),
    "lower left": lambda shape: (slice(0, shape[0] // 2), slice(0, shape[1] // 2)),
    "upper left": lambda shape: (slice(0, shape[0] // 2), slice(shape[1] // 2 + 1, None)),
    "lower right": lambda shape: (slice(shape[0] // 2 + 1, None), slice(0, shape[1] // 2)),
    "upper right": lambda shape: (slice(shape[0] // 2 + 1, None), slice(shape[1] // 2 + 1, None)),
}
"""Unions of bins by name: the bin about the origin, and the four corners around it."""


def truth_of(
    kind: str, draw: Draw, answer: Answer, paths: int, seed: int, scene_s: float = math.inf
) -> dict[str, tuple[float, float]]:
    """Return truth and standard error by quantity, from the engine that shares least with the answer."""
    if kind == "calm" and draw.scene.start.covariance is None:
        return _motion(draw)
    if answer.method in ("paths white", "paths filtered"):
        sides, changes, count = sampled(draw, max(paths // 5, 1000), seed, scene_s)
        return _shares(draw, sides, count, changes)
    method = "rk4" if answer.method == "paths exact" else None
    count = paths if method is None else max(paths // 3, 1000)
    steps = {} if method is None else {"steps_per_cycle": 400}
    run = simulate(draw.scene, **draw.rows, realizations=count, seed=seed, method=method, **steps)
    values = _shares(draw, run.overturned_counts[draw.looked_at], count)
    if answer.bins is not None:
        last = draw.looked_at[-1]
        theirs = np.asarray(run.bin_probabilities(last, *answer.edges))
        for name, place in _RECTANGLES.items():
            values[f"{name} {last}"] = _share(theirs[place(theirs.shape)].sum() * count, count)
        floor = sampling.l1_floor(np.clip(answer.bins, 0.0, 1.0), math.inf, count)
        # Absolute deviations of bins are nearly independent, each of variance (1 - 2/π) p (1 - p) / n.
        spread = math.sqrt((1.0 - 2.0 / math.pi) * float((theirs * (1.0 - theirs)).sum()) / count)
        values[f"bins {last}"] = max(sampling.l1(answer.bins, theirs) - floor, 0.0), spread
    return {name: pair for name, pair in values.items() if name in answer.values}  # an operator has no sides


def _motion(draw):
    """Outcome of the integration of one motion, as probabilities 0 and 1, and its last state."""
    times = draw.times(draw.looked_at)
    side, over, state = Motion(draw.scene).outcome(times)
    values = {"overturning time": (over, 0.0)} if side else {"angle": (state[0], 0.0), "velocity": (state[1], 0.0)}
    for k, end in zip(draw.looked_at, times, strict=True):
        happened = side != 0 and over <= end
        values[f"survival {k}"] = float(not happened), 0.0
        for name, sign in (("left", -1), ("right", 1)):
            values[f"{name} {k}"] = float(happened and side == sign), 0.0
    return values


def _shares(draw, sides, count, changes=None):
    """Shares with standard errors of paths (rows, 2) that have overturned; `changes` by longer steps are a third."""
    values = {}
    for row, k in enumerate(draw.looked_at):
        numbers = {"survival": count - sides[row].sum(), "left": sides[row, 0], "right": sides[row, 1]}
        for name, number in numbers.items():
            share, error = _share(number, count)
            if changes is not None:
                # Of order 1/2 the error of the steps is as large as what steps four times as long change.
                change = changes[row].sum() if name == "survival" else changes[row, int(name == "right")]
                error = math.hypot(error, float(change) / count / SIGMAS)
            values[f"{name} {k}"] = share, error
    return values


def _share(number, count):
    """Share of paths with its standard error, not 0 where all are, or none."""
    share = float(number) / count
    return share, math.sqrt(max(share * (1.0 - share), 1.0 / count) / count)


def compared(answer: Answer, truth: dict[str, tuple[float, float]]) -> list[Comparison]:
    """Hold the values that an answer and a truth share against each other; what only one has is a miss."""
    names = [*answer.values, *(name for name in truth if name not in answer.values)]
    missing = math.nan, 0.0
    return [
        Comparison(name, *answer.values.get(name, missing), *truth.get(name, missing), answer.hard) for name in names
    ]


def judged(kind: str, number: int, draw: Draw, options: Options, shift: float = 0.0) -> Finding:
    """Ask, compare, and ask again where a comparison is outside; `shift` is added to every answer, to try the audit."""
    begin, looks, remarks, answer = time.perf_counter(), [], [], None
    outcome = "answered"
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            for look in (0, 1):
                if answer is None or not answer.hard:
                    with _at_most(options.scene_s):
                        answer = answer_of(kind, draw, options, _ANSWER_SEED + look)
                    shifted = {name: (value + shift, stated) for name, (value, stated) in answer.values.items()}
                    answer = answer._replace(values=shifted)
                truth = truth_of(kind, draw, answer, options.paths * _MORE**look, _TRUTH_SEED + look, options.scene_s)
                looks.append(compared(answer, truth))
                if all(one.excess <= 1.0 for one in looks[-1]) or kind == "calm":
                    break
        except StoppedError:
            outcome = "answered" if looks else "stopped"
        except ValueError as error:
            if looks:
                raise
            outcome, remarks = "refused", [str(error)]
        except Exception as error:  # noqa: BLE001  (whatever comes is a finding, and the audit goes on)
            outcome, remarks, looks = "failed", [f"{type(error).__name__}: {error}"], []
    remarks += dict.fromkeys(str(warning.message) for warning in caught if warning.category is RuntimeWarning)
    verdict = answer.verdict if answer else ""
    seconds, text = time.perf_counter() - begin, json.dumps(draw.scene.to_toml(), ensure_ascii=False)
    method = answer.method if answer else ""
    return Finding(kind, number, outcome, looks, verdict, method, seconds, "; ".join(remarks), options.settings, text)


def body(findings: list[Finding], options: argparse.Namespace) -> str:
    """Text of the section."""
    answered = [one for one in findings if one.outcome == "answered"]
    ok = [one for one in answered if one.ok]
    number, chance = alarms(findings)
    lines = miss_lines(findings)
    return f"""**Result.** Of {len(findings)} scenes drawn at random (seed {options.seed}) {len(answered)} are answered,
{len(ok)} of them with the verdict "ok". Of these {len(ok)},
{sum(one.missed for one in ok)} are outside their stated error, {sum(one.missed_twice for one in ok)} outside twice it;
in {sum(one.certain for one in ok)} nearly all blocks stand or nearly none, which tests little. Elsewhere half of the
comparisons would notice an error of
{noticed(findings):.2g}.

Scenes are drawn by a generator that knows no engine: slender and exact blocks, rectangles and bodies of unequal sides,
restitution .1 to .98, harmonic shaking, several harmonics, pulses, chirps, records, or none; white, band and filtered
noise, weak and strong, with and without envelopes; starts at rest, at a point and as a Gaussian; one to ten cycles.
The wanted error is {options.tol:g}. Truth is by the engine that shares least with the answer: {options.paths:,} paths
for a density, the operator and splitting; a third as many of rk4 with 400 steps a cycle for the exact engine; a fifth
as many of an integration of this benchmark's own for the engines of white and filtered noise, with what steps four
times as long change; scipy's DOP853 for motions without noise.

A comparison is outside where |answer - truth| is above the stated error and three standard errors of the truth. That
happens by chance with a probability of .0027 at most where the stated error is a bound, and of up to .05 where it is
that of a sample: together in {chance:.1f} of {number} comparisons at most. What is outside is asked again, with other
seeds and {_MORE} times the paths, and is counted if it is outside again. Twice: above twice the stated error and three
standard errors. Nearly: up to {NEARLY:g} of them. Refused: the call says why not. Stopped: it took more than
{options.scene_s:g} processor seconds. Warned: the verdict is not "ok". On one processor; s is by the clock, beside
other work.

{summary(findings)}

{table(MISSES, lines) if lines else "Nothing is outside."}
"""


def scenes(kinds: list[str], count: int) -> list[tuple[str, int]]:
    """Return kind and number of the first scenes, the kinds in turn."""
    return [(kinds[k % len(kinds)], k // len(kinds)) for k in range(count)]


def run(options: argparse.Namespace, names: list[tuple[str, int]]) -> list[Finding]:
    """Judge scenes until all are, or the time is over; those in the file are not judged again."""
    path = pathlib.Path(options.out) if options.out else None
    asked, findings = Options(options.tol, options.paths, options.scene_s, options.seed), kept(path)
    for other in {one.settings for one in findings} - {asked.settings}:
        raise SystemExit(f"{path}: holds an audit of {other}, and this one is of {asked.settings}")
    done, begin = {(one.kind, one.number) for one in findings}, time.perf_counter()
    for kind, number in names:
        if (kind, number) in done:
            continue
        if time.perf_counter() - begin > options.limit_s:
            print(f"--limit-s: {options.limit_s:g} s are over, {len(findings)} scenes are judged", flush=True)
            break
        draw = drawn(kind, options.seed, number)
        finding = judged(kind, number, draw, asked, options.shift)
        findings.append(finding)
        worst = max((one.excess for one in finding.looks[-1]), default=math.nan) if finding.looks else math.nan
        says = finding.verdict or finding.remark.partition("\n")[0][:150]
        cells = f"{kind}-{number}", finding.outcome, finding.method, says, f"excess {worst:.2f}"
        print(*cells, f"{finding.seconds:.1f} s", "OUTSIDE" * finding.missed, sep=" | ", flush=True)
        if path:
            keep(path, findings)
    order = {name: place for place, name in enumerate(names)}
    return sorted((one for one in findings if (one.kind, one.number) in order), key=lambda f: order[f.kind, f.number])


def _cell(value):
    """Entry of a table of comparisons."""
    return f"{value:.5g}" if isinstance(value, float) else value


def main(arguments: list[str] | None = None) -> list[Finding]:
    """Judge the scenes, print misses by kind, and write the section where that is asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    defaults = Options()
    parser.add_argument("--seed", type=int, default=1, help="of the scenes (default: %(default)s)")
    parser.add_argument("--count", type=int, default=45, help="how many scenes (default: %(default)s)")
    parser.add_argument(
        "--kinds", nargs="+", choices=list(KINDS), default=list(KINDS), metavar="KIND", help="by default all"
    )
    parser.add_argument("--only", nargs="+", metavar="KIND-NUMBER", help="these scenes, and every comparison of them")
    parser.add_argument("--tol", type=float, default=defaults.tol, help="wanted error (default: %(default)s)")
    parser.add_argument("--paths", type=int, default=defaults.paths, help="paths of a truth (default: %(default)s)")
    parser.add_argument("--scene-s", type=float, default=defaults.scene_s, help="of a call (default: %(default)s)")
    parser.add_argument("--limit-s", type=float, default=math.inf, help="seconds after which no scene is begun")
    parser.add_argument("--out", metavar="FILE.csv", help="file of all comparisons, which is gone on with")
    parser.add_argument("--page", action="store_true", help="write the section of docs/validation.md")
    parser.add_argument("--shift", type=float, default=0.0, help="added to every answer, to see that this is noticed")
    options = parser.parse_args(arguments)
    names = scenes(list(dict.fromkeys(options.kinds)), options.count)
    if options.only:
        names = [(kind, int(number)) for kind, _, number in (name.rpartition("-") for name in options.only)]
    with at_most(1):
        findings = run(options, names)
    for one in findings if options.only else ():
        print(json.loads(one.scene), one.remark, sep="\n")
        every = [[look, *map(_cell, (*c[:5], c.z, c.excess))] for look, part in enumerate(one.looks) for c in part]
        print(table(["look", "quantity", "answer", "stated", "truth", "s.e.", "z", "excess"], every))
    if options.page:
        write_section(TITLE, body(findings, options), VALIDATION)
    else:
        number, chance = alarms(findings)
        print(summary(findings), f"{number} comparisons, at most {chance:.2f} outside by chance at first", sep="\n\n")
        print(table(MISSES, miss_lines(findings)))
    return findings


if __name__ == "__main__":
    main()
