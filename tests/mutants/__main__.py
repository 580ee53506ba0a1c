"""Mutation run: one-line mistakes drawn at random over the packages, and whether the tests notice them.

    python tests/mutants --count 20 --seed 1        (or `make mutants COUNT=20 SEED=1`)

The tests that run a mutant's function are run, those that mirror its file first, until one fails or BUDGET seconds of
tests have passed; tests that fail without a mistake are left out. Of a mutant that survives it is said how many of the
tests were run. (mutmut leaves decorated functions alone, and so
every kernel; cosmic-ray has one command for all mutants, here the whole suite.)
"""

import argparse
import itertools
import json
import math
import os
import random
import signal
import sys
import time

import covering
import drawing
import sitecustomize
from running import PACKAGES, TREE, forked, prepare, run

PATIENCE, WAITING = (10.0, 5.0), 10.0
"""Seconds, and times those of a test, that a test may compute for, and how many times longer it may take."""

COMPILING = 60.0
"""Seconds that the compilation of kernels may take."""


class _Judge:
    """Runs some tests, (file, name, seconds) each, in their order, up to the first that fails: `by`."""

    def __init__(self, tests, patience):
        self.by, self.tests, self.patience = "", {name: seconds for _, name, seconds in tests}, patience

    def pytest_collection_modifyitems(self, items):
        collected = {item.nodeid: item for item in items}
        items[:] = [collected[name] for name in self.tests if name in collected]

    def pytest_runtest_logstart(self, nodeid):
        patience = self.patience + PATIENCE[1] * self.tests[nodeid]
        signal.setitimer(signal.ITIMER_PROF, patience)
        signal.setitimer(signal.ITIMER_REAL, WAITING * patience)

    def pytest_runtest_logreport(self, report):
        self.by = self.by or (report.nodeid if report.failed else "")

    pytest_collectreport = pytest_runtest_logreport


def noticed(mutant, compiled, tests):
    """Return the first of some tests that fails with a mutant; "" where none fails."""
    judge = _Judge(tests, PATIENCE[0] + COMPILING * compiled)
    mistake = {"file": str(TREE / mutant.file), "source": mutant.source, "compiled": compiled}
    os.environ["FPK_ROCKING_MUTANT"] = json.dumps(mistake)
    sitecustomize.put(**mistake)
    from fpk_rocking.base import precompilation

    precompilation.start_no_helpers()  # which would compile ahead what no test here may need
    status = run(dict.fromkeys(file for file, *_ in tests), judge, "-x") if tests else 0
    return judge.by or (f"status {status}" if status else "")


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--count", type=int, default=20, help="number of mutants")
    parser.add_argument("--seed", type=int, default=1, help="seed of their drawing")
    parser.add_argument("--jobs", type=int, default=1, help="mutants at a time, each on one processor")
    parser.add_argument("--budget", type=float, default=40.0, help="seconds of tests for each")
    parser.add_argument("--only", type=int, nargs="*", help="numbers of the mutants to try; all by default")
    options = parser.parse_args()
    prepare()
    tests_of, kernels = covering.measured(options.jobs)
    files = sorted(file for package in PACKAGES for file in (TREE / package).rglob("*.py"))
    texts = {file.relative_to(TREE).as_posix(): file.read_text(encoding="utf-8") for file in files}
    mutants = list(itertools.islice(drawing.drawn(random.Random(options.seed), texts), options.count))

    def tried(number):
        mutant = mutants[number]
        tests = covering.tests_for(mutant, tests_of, kernels, options.budget)
        return noticed(mutant, covering.compiled(mutant, kernels), tests)

    def survives(mutant):
        run, known_ones = (
            len(covering.tests_for(mutant, tests_of, kernels, budget)) for budget in (options.budget, math.inf)
        )
        return f"SURVIVES {run} of {known_ones} tests"

    todo, score, begin = options.only or range(options.count), 0, time.monotonic()
    for number, by in forked(tried, todo, options.jobs):
        mutant, score = mutants[number], score + (by != "")
        verdict = survives(mutant) if by == "" else f"noticed by {by or 'its end: killed, or too late'}"
        print(f"{number} {mutant.file}:{mutant.line}: {verdict}, {time.monotonic() - begin:.0f} s")
        print(f"    {mutant.before}", f"    {mutant.after}", sep="\n", flush=True)
    print(f"{score} of {len(todo)} noticed, seed {options.seed}")


if __name__ == "__main__":
    sys.exit(main())
