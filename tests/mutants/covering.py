"""Which tests run a function: found by one run of the suite under Python's own profiler.

Compiled kernels are not seen there. Those that a Python function can reach by the names in it count as run with it.
"""

import cProfile
import hashlib
import json
import sys
import time
import types

import pytest
from running import PACKAGES, PLACE, TREE, forked, run

_LOADING = 0.5
"""Seconds that a test file takes to be loaded, about."""


def found(jobs):
    """Return, by test file, its tests with their seconds and the functions they run; anew for a changed file."""
    kept, texts = PLACE / "map", {one: one.read_bytes() for one in sorted(TREE.glob("tests/*/test_*.py"))}
    kept.mkdir(parents=True, exist_ok=True)
    places = {str(one.relative_to(TREE)): kept / hashlib.sha256(text).hexdigest() for one, text in texts.items()}
    for file, one in forked(watched, [file for file, place in places.items() if not place.exists()], jobs):
        print(f"{file}: {len(one['tests']) if one else 'does not end'}", flush=True)
        places[file].write_text(json.dumps(one or {"tests": {}, "kernels": []}), encoding="utf-8")
    return {file: json.loads(place.read_text(encoding="utf-8")) for file, place in places.items()}


def watched(file):
    """Run a test file; return its tests that pass, and the functions of the packages that are kernels."""
    watch = _Watch()
    run([file], watch)
    kernels = _Kernels()
    passed = {name: one for name, one in watch.tests.items() if name not in watch.failed}
    return {
        "tests": {
            name: {"seconds": s, "runs": sorted(kernels.with_codes(codes))} for name, (s, codes) in passed.items()
        },
        "kernels": sorted({_name(code) for one in kernels.of for code in _nested(one.py_func.__code__)}),
    }


class _Watch:
    def __init__(self):
        self.tests, self.failed = {}, set()

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item):
        from numba.core.event import TimingListener, install_listener

        profile, compiling, begin = cProfile.Profile(builtins=False), TimingListener(), time.monotonic()
        with install_listener("numba:compile", compiling), profile:
            yield_ = yield
        seconds = time.monotonic() - begin - (compiling.duration if compiling.done else 0.0)
        codes = {one.code for one in profile.getstats() if hasattr(one.code, "co_filename")}
        self.tests[item.nodeid] = seconds, {code for code in codes if _name(code)}
        return yield_

    def pytest_runtest_logreport(self, report):
        if report.failed or report.skipped:
            self.failed.add(report.nodeid)


class _Kernels:
    """Kernels of the loaded modules of the packages."""

    def __init__(self):
        from numba.core.dispatcher import Dispatcher

        self.kind = Dispatcher
        loaded = list(sys.modules.items())
        self.scopes = {one.__file__: vars(one) for name, one in loaded if name.startswith(PACKAGES) and one.__file__}
        self.by_name = {}
        for scope in self.scopes.values():
            for name, value in scope.items():
                if isinstance(value, Dispatcher):
                    self.by_name.setdefault(name, set()).add(value)
        self.of = {one for same in self.by_name.values() for one in same}

    def with_codes(self, codes):
        """Return the names of functions that run, by their code, and of the kernels that these can call."""
        names, todo = set(), [(code, self.scopes.get(code.co_filename, {})) for code in codes]
        while todo:
            code, scope = todo.pop()
            if (code, id(scope)) in names:
                continue
            names.add((code, id(scope)))
            todo += [(one, scope) for one in _nested(code)]
            for kernel in self._called(code, scope):
                todo.append((kernel.py_func.__code__, kernel.py_func.__globals__))
        return {_name(code) for code, _ in names}

    def _called(self, code, scope):
        """Kernels that a function names: of its own module, of one that it names, or else of any."""
        for name in code.co_names:
            value = scope.get(name)
            if isinstance(value, self.kind):
                yield value
            elif isinstance(value, types.ModuleType):
                yield from (one for one in map(vars(value).get, code.co_names) if isinstance(one, self.kind))
            elif name not in scope:
                yield from self.by_name.get(name, ())


def _nested(code):
    """A code and those of the functions within it."""
    yield code
    for one in code.co_consts:
        if isinstance(one, types.CodeType):
            yield from _nested(one)


def _name(code):
    """Name "file:function" of a code of the packages; else empty."""
    file = code.co_filename.removeprefix(f"{TREE}/")
    return f"{file}:{code.co_qualname}" if file.startswith(PACKAGES) else ""


def tests_for(mutant, known, kernels, budget):
    """Return tests that may notice a mutant, as many as a budget of seconds allows, those that mirror its file first.

    These are the tests that run its function, and then all others of the files that are named after its file or import
    it: what is solved once for many tests runs in the first of them alone. Kernels of one name cannot be told apart: of
    their tests those go first that run most of what is no kernel in the same file.
    """
    *folders, leaf = mutant.file.removesuffix(".py").split("/")
    wanted, module, ranked = f"{mutant.file}:{mutant.function}", ".".join([*folders, leaf]), []
    for file, one in known.items():
        near = 2 * (leaf in file) + 2 * (module in (TREE / file).read_text(encoding="utf-8"))
        direct = {
            name: test["seconds"]
            for name, test in one["tests"].items()
            if (wanted in test["runs"] if mutant.function else any(run.startswith(wanted) for run in test["runs"]))
        }
        near += len(set(folders) & set(file.split("/")))
        for name, test in one["tests"].items():
            if name in direct or near > 2:
                own = sum(run.startswith(f"{mutant.file}:") and run not in kernels for run in test["runs"])
                ranked.append(
                    (
                        name not in direct,
                        -own if wanted in kernels else 0,
                        -near,
                        sum(direct.values()),
                        file,
                        test["seconds"],
                        name,
                    )
                )
    chosen, files = [], set()
    for *_, file, seconds, name in sorted(ranked):
        cost = seconds + (0.0 if file in files else _LOADING)
        if cost <= budget:
            budget -= cost
            files.add(file)
            chosen.append((file, name, seconds))
    return chosen
