"""Which test files run a function, found by a run of each of them.

Compiled kernels cannot be watched: a file that calls one counts as running all kernels of the sources that it is made
of. What a test runs in a process of its own is not seen.
"""

import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import threading
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
PLACE = ROOT / "build" / "mutants"
PACKAGES = "fpk_rocking", "montecarlo"
PYTEST = sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider"
_NO_TESTS = 5


def environment(tree):
    """Return the environment in which a tree's own packages are used, on one processor."""
    folder = PLACE / f"cache-{tree.name}"
    return os.environ | {"PYTHONPATH": str(tree), "NUMBA_NUM_THREADS": "1", "NUMBA_CACHE_DIR": str(folder)}


def watched(anew):
    """Return what `watch` finds of every test file that passes, by its name; from earlier runs unless `anew`."""
    kept, found = PLACE / "map", {}
    if anew:
        shutil.rmtree(kept, ignore_errors=True)
    kept.mkdir(parents=True, exist_ok=True)
    tests = (one for one in (ROOT / "tests").glob("*/test_*.py") if one.parent.name != "robustness")
    for test in sorted(tests):
        out = kept / f"{test.stem}.json"
        if not out.exists():
            print(f"which functions run in {test.name}", flush=True)
            command = [sys.executable, __file__, str(test), str(out)]
            subprocess.run(command, env=environment(ROOT), check=False, stdout=subprocess.DEVNULL)
        if out.exists():
            found[test.relative_to(ROOT).as_posix()] = json.loads(out.read_text(encoding="utf-8"))
    bad = [name for name, one in found.items() if one["status"] not in {0, _NO_TESTS}]
    if bad:
        print(f"left out, as they fail without any mistake: {', '.join(bad)}", flush=True)
    return {name: one for name, one in found.items() if one["status"] == 0}


def watch(test, out):
    """Run a test file; write its seconds, its exit status, the functions that ran, and the sources of kernels."""
    import pytest

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

    jit.kernel, begin = kernel, time.monotonic()
    threading.setprofile(note)
    sys.setprofile(note)
    status = int(pytest.main([*PYTEST[3:], test]))
    sys.setprofile(None)
    made_of = {one for file in kernels if ROOT in file.parents for one in jit.sources(file)}
    ran = {(_name(code.co_filename), code.co_name) for code in codes}
    found = {
        "seconds": time.monotonic() - begin,
        "status": status,
        "functions": sorted(f"{file}:{name}" for file, name in ran if file),
        "kernels": sorted(filter(None, map(_name, made_of))),
    }
    pathlib.Path(out).write_text(json.dumps(found), encoding="utf-8")


def _name(file):
    """Path of a source of the packages within the tree; else empty."""
    path = pathlib.Path(file)
    name = path.relative_to(ROOT).as_posix() if ROOT in path.parents else ""
    return name if name.startswith(PACKAGES) else ""


def files_for(mutant, found):
    """Return the test files that run the function of a mutant: those that import its module first, then by seconds."""
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


if __name__ == "__main__":
    watch(*sys.argv[1:])
