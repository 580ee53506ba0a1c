"""Mutation run: one-line mistakes drawn at random over the packages, and whether the tests notice them.

    python tests/mutants --count 20 --seed 1        (or `make mutants COUNT=20 SEED=1`)

Each mutant goes into a copy of the tree under build/mutants. There the test files that run its function are run until a
test fails that does not fail without the mistake. What runs which function is found once, by a run of every test file;
`--map` finds it anew. (mutmut leaves decorated functions alone, and so every kernel; cosmic-ray has one command for all
mutants, here the whole suite.)
"""

import argparse
import concurrent.futures
import functools
import os
import pathlib
import queue
import random
import re
import shutil
import subprocess
import sys
import time

import covering
import drawing
from covering import PACKAGES, PLACE, PYTEST, ROOT, environment

PATIENCE = 600.0, 5.0
"""Seconds, and times those of the test files, after which a mutant is noticed: something does not come to its end."""


def _left_out(folder, names):
    """Names in a folder of the tree that are no part of it."""
    made = {".git", ".venv", ".venv-peers", "__pycache__", ".ruff_cache", ".pytest_cache", ".hypothesis"}
    made |= {"build", "dist", "results"} if pathlib.Path(folder) == ROOT else set()
    return made.intersection(names)


def copied(number):
    """Return a copy of the tree; times of files are kept, for the compiler's cache goes by them."""
    tree = PLACE / f"{number}"
    shutil.rmtree(tree, ignore_errors=True)
    shutil.copytree(ROOT, tree, ignore=_left_out)
    # Where the copy is not whole, every mutant would count as noticed.
    subprocess.run([*PYTEST, "--collect-only"], cwd=tree, env=environment(tree), check=True, stdout=subprocess.DEVNULL)
    return tree


def failure(tree, tests, longest):
    """Return the first of some tests that fails in a tree; "time" where they do not end, "" where none fails."""
    options = {"cwd": tree, "env": environment(tree), "capture_output": True, "text": True, "timeout": longest}
    try:
        done = subprocess.run([*PYTEST, "-x", *tests], check=False, **options)
    except subprocess.TimeoutExpired:
        return "time"
    failed = re.findall(r"^(?:FAILED|ERROR) (.+?)(?: - .*)?$", done.stdout, re.MULTILINE)
    return (failed or [f"status {done.returncode}"])[0] if done.returncode else ""


def noticed(mutant, tests, tree, longest):
    """Return the first test that fails with a mutant, and does not fail without it; "" for none."""
    file, left_out = tree / mutant.file, []
    times, text = file.stat(), file.read_bytes()
    while True:
        file.write_text(mutant.source, encoding="utf-8")
        by = failure(tree, [*tests, *left_out], longest)
        file.write_bytes(text)
        os.utime(file, ns=(times.st_atime_ns, times.st_mtime_ns))
        for folder in pathlib.Path(environment(tree)["NUMBA_CACHE_DIR"]).glob("*"):
            if folder.name not in _folders():  # machine code of a mistake is of no use again
                shutil.rmtree(folder, ignore_errors=True)
        if "::" not in by or not failure(tree, [by], longest):
            return by
        left_out += ["--deselect", by]


@functools.cache
def _folders():
    """Names of the folders of machine code of the tree without mistakes."""
    from fpk_rocking.base import jit

    places = [ROOT / name for name in (*PACKAGES, "tests")]
    return {jit.cache_folder(file).name for place in places for file in place.rglob("*.py")}


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--count", type=int, default=20, help="number of mutants")
    parser.add_argument("--seed", type=int, default=1, help="seed of their drawing")
    parser.add_argument("--jobs", type=int, default=2, help="mutants at a time, each on one processor")
    parser.add_argument("--map", action="store_true", help="find anew which test files run which functions")
    options = parser.parse_args()
    files = sorted(file for package in PACKAGES for file in (ROOT / package).rglob("*.py"))
    texts = {file.relative_to(ROOT).as_posix(): file.read_text(encoding="utf-8") for file in files}
    rng, found, trees = random.Random(options.seed), covering.watched(options.map), queue.SimpleQueue()
    mutants = [drawing.draw(rng, texts) for _ in range(options.count)]
    for number in range(options.jobs):
        trees.put(copied(number))

    def tried(mutant):
        tree, tests, begin = trees.get(), covering.files_for(mutant, found), time.monotonic()
        longest = PATIENCE[0] + PATIENCE[1] * sum(found[name]["seconds"] for name in tests)
        by = noticed(mutant, tests, tree, longest) if tests else ""
        trees.put(tree)
        verdict = f"noticed by {by}" if by else f"SURVIVES {len(tests)} test files"
        told = f"{mutant.file}:{mutant.line}: {verdict}, {time.monotonic() - begin:.0f} s"
        print(told, f"    {mutant.before}", f"    {mutant.after}", sep="\n", flush=True)
        return bool(by)

    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        score = sum(pool.map(tried, mutants))
    print(f"{score} of {len(mutants)} noticed, seed {options.seed}")


if __name__ == "__main__":
    sys.exit(main())
