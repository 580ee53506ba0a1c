"""Mutation run: one-line mistakes drawn at random over the packages, and whether the tests notice them.

    python tests/mutants.py --count 20 --seed 1        (or `make mutants COUNT=20 SEED=1`)

Each mutant goes into a copy of the tree under build/mutants. There the test files that run its function are run until
one fails: first those that import its module, and of these the quickest. Which files run which functions is found by a
run of each of them, once; `--map` finds it anew. Compiled kernels cannot be watched, so a file that calls one counts as
running all kernels of the sources that this one is made of.

No package does that here: mutmut leaves decorated functions alone, and so every kernel; cosmic-ray knows one command
for all mutants, the whole suite.
"""

import argparse
import concurrent.futures
import functools
import json
import os
import pathlib
import queue
import random
import re
import shutil
import subprocess
import sys
import threading
import time

import mutations

ROOT = pathlib.Path(__file__).resolve().parents[1]
PLACE = ROOT / "build" / "mutants"
PACKAGES = "fpk_rocking", "montecarlo", "studies"
LEFT_OUT = shutil.ignore_patterns(".*", "build", "dist", "results", "__pycache__", "*.egg-info")
LONGEST_S = 1200
"""A mutant whose tests take longer is noticed: something does not come to its end."""


def watch(test, out):
    """Run a test file; write its seconds, its exit status, the functions that ran, and the files of kernels."""
    from fpk_rocking.base import jit

    codes, kernels, make = set(), set(), jit.kernel

    def kernel(function=None, **options):
        if function is None:
            return lambda one: kernel(one, **options)
        made = make(function, **options)
        compiled, file = made.compile, pathlib.Path(function.__code__.co_filename)
        made.compile = lambda signature: (kernels.add(file), compiled(signature))[1]
        return made

    def note(frame, event, _):
        if event == "call":
            codes.add(frame.f_code)

    import pytest

    jit.kernel, begin = kernel, time.monotonic()
    threading.setprofile(note)
    sys.setprofile(note)
    status = int(pytest.main(["-q", "-p", "no:cacheprovider", test]))
    sys.setprofile(None)
    made_of = {one for file in kernels if ROOT in file.parents for one in jit.sources(file)}
    found = {
        "seconds": time.monotonic() - begin,
        "status": status,
        "functions": sorted({f"{_name(code.co_filename)}:{code.co_name}" for code in codes if _name(code.co_filename)}),
        "kernels": sorted(filter(None, map(_name, made_of))),
    }
    pathlib.Path(out).write_text(json.dumps(found), encoding="utf-8")


def _name(file):
    """Path of a source of the packages within the tree; else empty."""
    path = pathlib.Path(file)
    name = path.relative_to(ROOT).as_posix() if ROOT in path.parents else ""
    return name if name.startswith(PACKAGES) else ""


def watched(anew):
    """Return what `watch` finds of every test file, by its name."""
    kept = PLACE / "map"
    if anew:
        shutil.rmtree(kept, ignore_errors=True)
    kept.mkdir(parents=True, exist_ok=True)
    found = {}
    for test in sorted((ROOT / "tests").glob("test_*.py")):
        out = kept / f"{test.stem}.json"
        if not out.exists():
            print(f"which functions run in {test.name}", flush=True)
            command = [sys.executable, __file__, "--watch", str(test), str(out)]
            subprocess.run(command, env=_environment(ROOT), check=False, stdout=subprocess.DEVNULL)
        if out.exists():
            found[test.relative_to(ROOT).as_posix()] = json.loads(out.read_text(encoding="utf-8"))
    bad = [name for name, one in found.items() if one["status"] not in {0, 5}]
    if bad:
        print(f"left out, as they fail without any mistake: {', '.join(bad)}", flush=True)
    return {name: one for name, one in found.items() if one["status"] == 0}


def covering(mutant, found):
    """Return the test files that run the function of a mutant, those that import its module first, then by seconds."""
    folder, _, leaf = mutant.file.removesuffix(".py").replace("/", ".").rpartition(".")
    imports = re.compile(rf"(from|import) {folder}(\.{leaf}\b| import .*\b{leaf}\b)")

    def runs(one):
        if mutant.compiled:
            return mutant.file in one["kernels"]
        ran = [name for name in one["functions"] if name.startswith(f"{mutant.file}:")]
        return f"{mutant.file}:{mutant.function}" in ran if mutant.function else bool(ran)

    def order(name):
        return not imports.search((ROOT / name).read_text(encoding="utf-8")), found[name]["seconds"]

    return sorted((name for name, one in found.items() if runs(one)), key=order)


def _environment(tree):
    folder = PLACE / f"cache-{tree.name}"
    return os.environ | {"PYTHONPATH": str(tree), "NUMBA_NUM_THREADS": "1", "NUMBA_CACHE_DIR": str(folder)}


def copied(number):
    """Return a copy of the tree; times of files are kept, for the compiler's cache goes by them."""
    tree = PLACE / f"{number}"
    shutil.rmtree(tree, ignore_errors=True)
    shutil.copytree(ROOT, tree, ignore=LEFT_OUT)
    return tree


def noticed(mutant, tests, tree):
    """Return the first test that fails with a mutant, "time" where none ends, or an empty text."""
    file = tree / mutant.file
    times, text = file.stat(), file.read_bytes()
    file.write_text(mutant.source, encoding="utf-8")
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *tests]
    try:
        done = subprocess.run(
            command, cwd=tree, env=_environment(tree), capture_output=True, text=True, check=False, timeout=LONGEST_S
        )
    except subprocess.TimeoutExpired:
        return "time"
    finally:
        file.write_bytes(text)
        os.utime(file, ns=(times.st_atime_ns, times.st_mtime_ns))
        for folder in pathlib.Path(_environment(tree)["NUMBA_CACHE_DIR"]).glob("*"):
            if folder.name not in _folders():  # machine code of a mistake is of no use again
                shutil.rmtree(folder, ignore_errors=True)
    failed = re.findall(r"^(?:FAILED|ERROR) (\S+)", done.stdout, re.MULTILINE)
    return (failed or [f"status {done.returncode}"])[0] if done.returncode else ""


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
    parser.add_argument("--watch", nargs=2, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.watch:
        watch(*options.watch)
        return
    files = sorted(file for package in PACKAGES for file in (ROOT / package).rglob("*.py"))
    texts = {file.relative_to(ROOT).as_posix(): file.read_text(encoding="utf-8") for file in files}
    rng, found, trees = random.Random(options.seed), watched(options.map), queue.SimpleQueue()
    mutants = [mutations.draw(rng, texts) for _ in range(options.count)]
    for number in range(options.jobs):
        trees.put(copied(number))

    def tried(mutant):
        tree, tests = trees.get(), covering(mutant, found)
        begin = time.monotonic()
        by = noticed(mutant, tests, tree) if tests else ""
        trees.put(tree)
        verdict = f"noticed by {by}" if by else f"SURVIVES {len(tests)} test files"
        where = f"{mutant.file}:{mutant.line}"
        print(
            f"{where}: {verdict}, {time.monotonic() - begin:.0f} s\n    {mutant.before}\n    {mutant.after}", flush=True
        )
        return bool(by)

    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        score = sum(pool.map(tried, mutants))
    print(f"{score} of {len(mutants)} noticed ({100 * score / max(len(mutants), 1):.0f} %), seed {options.seed}")


if __name__ == "__main__":
    main()
