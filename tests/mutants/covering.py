"""Which tests run a function: found by one run of the suite under Python's own profiler.

Compiled kernels are not seen there. Those that a Python function can reach by the names in it count as run with it, if
Python has called the first of them in the same test file.
"""

import ast
import cProfile
import hashlib
import json
import re
import signal
import sys
import time
import types

import pytest
from running import PACKAGES, PLACE, TREE, forked, run

_LOADING, _LONGEST = 0.5, 120
"""Seconds that a test file takes to be loaded, about, and those after which a test is given up: no budget allows it."""

_NEAREST = 4
"""How near a test file is that is named after a file and imports it; folders of the same name add to that."""


def measured(jobs):
    """Return, by test file, its tests with their seconds and the functions they run, and the names of all kernels.

    Only test files that have changed since the last time are run.
    """
    (PLACE / "map").mkdir(parents=True, exist_ok=True)
    files = sorted(TREE.glob("tests/*/test_*.py"))
    places = {
        str(path.relative_to(TREE)): PLACE / "map" / hashlib.sha256(path.read_bytes()).hexdigest() for path in files
    }
    for file, entry in forked(_watched, [file for file, place in places.items() if not place.exists()], jobs):
        print(f"{file}: {len(entry['tests']) if entry else 'does not end'}", flush=True)
        places[file].write_text(json.dumps(entry or {"tests": {}, "kernels": []}), encoding="utf-8")
    coverage = {file: json.loads(place.read_text(encoding="utf-8")) for file, place in places.items()}
    kernels = {name for entry in coverage.values() for name in entry["kernels"]}
    return {file: entry["tests"] for file, entry in coverage.items()}, kernels


class _Watch:
    def __init__(self):
        self.tests, self.failed = {}, set()

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item):
        from numba.core.event import TimingListener, install_listener

        profile, compiling, begin = cProfile.Profile(builtins=False), TimingListener(), time.monotonic()
        signal.alarm(_LONGEST)
        with install_listener("numba:compile", compiling), profile:
            result = yield
        signal.alarm(0)
        seconds = time.monotonic() - begin - (compiling.duration if compiling.done else 0.0)
        codes = {entry.code for entry in profile.getstats() if isinstance(entry.code, types.CodeType)}
        self.tests[item.nodeid] = seconds, {code for code in codes if _name(code)}
        return result

    def pytest_runtest_logreport(self, report):
        if not report.passed:
            self.failed.add(report.nodeid)


def _give_up(*_):
    raise TimeoutError


def _called(code, scope, kernels, compiled):
    """Kernels that a code names: of its own module, of one that it names, of either block, or, in Python, of any."""
    for name in code.co_names:
        value = scope.get(name)
        candidates = [value] if name in scope else kernels.get(name, ())
        if isinstance(value, types.ModuleType):
            candidates = map(vars(value).get, code.co_names)
        elif isinstance(value, types.FunctionType):
            candidates = [cell.cell_contents for cell in value.__closure__ or ()]
        yield from (
            candidate for candidate in candidates if _is_kernel(candidate) and (compiled or _is_compiled(candidate))
        )


def _is_compiled(kernel):
    return kernel.for_types if hasattr(kernel, "for_types") else kernel.overloads


def _is_kernel(value):
    from numba.core.dispatcher import Dispatcher

    from fpk_rocking.base.jit import Kernel

    return isinstance(value, Dispatcher | Kernel)


def _watched(file):
    """Run a test file; return its tests that pass, and the functions of the packages that are kernels."""
    watch = _Watch()
    signal.signal(signal.SIGALRM, _give_up)
    run([file], watch)
    modules = [module for name, module in list(sys.modules.items()) if name.startswith(PACKAGES) and module.__file__]
    scopes, kernels = {module.__file__: vars(module) for module in modules}, {}
    for scope in scopes.values():
        for name, value in scope.items():
            # An engine holds the kernels that are made of its functions.
            held = vars(value) if type(value).__module__.startswith(PACKAGES) and hasattr(value, "__dict__") else {}
            for kernel_name, kernel in {name: value, **held}.items():
                if _is_kernel(kernel):
                    kernels.setdefault(kernel_name, set()).add(kernel)

    def reached(codes, compiled=False):
        """Names of functions, and of all kernels that they reach."""
        names, todo = set(), [(code, scopes.get(code.co_filename, {}), compiled) for code in codes]
        for code, scope, by_kernel in todo:  # it grows meanwhile
            if (code, id(scope), by_kernel) in names or code.co_name == "<module>":
                continue
            names.add((code, id(scope), by_kernel))
            todo += [
                (constant, scope, by_kernel) for constant in code.co_consts if isinstance(constant, types.CodeType)
            ]
            more = [called.py_func for called in _called(code, scope, kernels, by_kernel)]
            todo += [(called.__code__, called.__globals__, True) for called in more]
        return sorted({_name(code) for code, *_ in names})

    passed = {name: functions for name, functions in watch.tests.items() if name not in watch.failed}
    return {
        "tests": {name: {"seconds": seconds, "runs": reached(codes)} for name, (seconds, codes) in passed.items()},
        "kernels": reached(
            {function.py_func.__code__ for same in kernels.values() for function in same}, compiled=True
        ),
    }


def _name(code):
    """Name "file:function" of a code of the packages; else empty."""
    file = code.co_filename.removeprefix(f"{TREE}/")
    return f"{file}:{code.co_qualname}" if file.startswith(PACKAGES) else ""


def compiled(mutant, kernels):
    """Whether machine code depends on a mutant: on a kernel, a value made as a module is loaded, or a compiler."""
    outside = [
        statement
        for statement in ast.parse(mutant.source).body
        if not isinstance(statement, ast.FunctionDef | ast.ClassDef)
    ]
    names = {node.id for statement in outside for node in ast.walk(statement) if isinstance(node, ast.Name)}
    within = mutant.function.partition(".")[0]
    return f"{mutant.file}:{mutant.function}" in kernels or within in {"", *names} or "numba.extending" in mutant.source


def tests_for(mutant, coverage, kernels, budget):
    """Return (file, name, seconds) of tests that may notice a mutant, as many as a budget of seconds allows.

    These are the tests of the file that is named after its file and imports it, those that run its function, and then
    all others of the files that do either: what is solved once for many tests runs in the first of them alone, and what
    a test's own kernel calls is not seen. Kernels of one name cannot be told apart: of tests as near those go first
    that run most of what is no kernel in the same file.
    """
    *folders, leaf = mutant.file.removesuffix(".py").split("/")
    wanted, package, ranked = f"{mutant.file}:{mutant.function}", re.escape(".".join(folders)), []
    imported = re.compile(rf"{package}(\.| import .*\b){leaf}\b")
    for file, tests in coverage.items():
        near = 2 * (leaf in file) + 2 * bool(imported.search((TREE / file).read_text(encoding="utf-8")))
        near += len(set(folders) & set(file.split("/")))
        for name, test in tests.items():
            here = [run for run in test["runs"] if run.startswith(f"{mutant.file}:")]
            direct = wanted in here if mutant.function else bool(here)
            own = len(set(here) - kernels)
            if direct or near > 1:
                ranked.append((not direct and near < _NEAREST, -near, not direct, -own, file, test["seconds"], name))
    chosen, files = [], set()
    for *_, file, seconds, name in sorted(ranked):
        cost = seconds + (0.0 if file in files else _LOADING)
        if cost <= budget:
            budget -= cost
            files.add(file)
            chosen.append((file, name, seconds))
    return chosen
