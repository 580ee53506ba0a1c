"""Kernels compiled ahead of their use, in other processes, as numba compiles one at a time in a process.

A `Compilation` names a function that calls kernels on as little data as there is. Each solver and engine has its own
beside its kernels; ``fpk-rocking warmup``, the solvers and the workers of a sweep run them here. Helpers are processes
that run compilations while the caller works. Who needs a kernel second waits for its lock and loads it from the cache
(`base.jit`). Helpers print nothing, and end with the process that started them.
"""

import contextlib
import importlib
import multiprocessing
import os
import pathlib
import subprocess
import sys
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple


class Compilation(NamedTuple):
    """A function that has kernels compiled by calling them.

    `name`: "module:function", or "module:function:argument:argument" with arguments that are texts. `seconds`: about
    how much longer a first run takes that needs the kernels, on two cores of 2024.
    """

    name: str
    seconds: int


_RUN = """
import os, signal, sys, threading
signal.signal(signal.SIGINT, signal.SIG_DFL)
threading.Thread(target=lambda: (sys.stdin.read(), os._exit(1)), daemon=True).start()
sys.path[:] = {path!r}
from fpk_rocking.base import precompilation
for compilation in {compilations!r}:
    precompilation.run_compilation(precompilation.Compilation(*compilation))
os._exit(0)
"""

_helpers: list[subprocess.Popen | None] = []
_queued: list[Compilation] = []
_announced: list[Compilation] = []


def run_compilation(compilation: Compilation) -> None:
    """Run a compilation in this process, and mark it on the disk as done."""
    module, function, *arguments = compilation.name.split(":")
    start_no_helpers()
    getattr(importlib.import_module(module), function)(*arguments)
    _mark_compiled(compilation)


def start_no_helpers() -> None:
    """Have this process start no helpers from now on."""
    _helpers.append(None)


def queue_for_helpers(compilation: Compilation) -> None:
    """Have the next `start_helpers` run a compilation after those that it is given."""
    _queued.append(compilation)


def start_helpers(compilation: Compilation, *helping: Compilation) -> None:
    """Start helpers for a caller that is about to compile the kernels of `compilation`, and say so on standard error.

    This happens once in a process, and only where the kernels have not been compiled on this machine. With more than
    one processor the helpers run the compilations `helping` meanwhile, in this order.
    """
    if _helpers or multiprocessing.parent_process() is not None or _is_compiled(compilation):
        return
    from fpk_rocking.base import jit

    kept = "once" if jit.keeps_machine_code() else "which is not kept (set NUMBA_CACHE_DIR)"
    sys.stderr.write(f"compiling machine code for this machine, {kept}: about {compilation.seconds} s\n")
    left = [other for other in (*helping, *_queued) if not _is_compiled(other)]
    _helpers.extend([start_process(*share) for share in shares(left, processors() - 1)] or [None])
    _announced.append(compilation)


def mark_announced() -> None:
    """Mark on the disk what `start_helpers` announced: the call that needed it has come to its end.

    Until then it is not marked, so that after an interruption the next run says again that it compiles.
    """
    while _announced:
        _mark_compiled(_announced.pop())


def shares(compilations: Sequence[Compilation], processes: int) -> list[Sequence[Compilation]]:
    """Deal compilations in turn to as many processes, or to fewer so that each has one."""
    count = min(len(compilations), processes)
    return [compilations[k::count] for k in range(count)]


def ensure_compiled(compilation: Compilation) -> None:
    """Run a compilation in this process unless it was done on this machine: before workers start that need it."""
    if not _is_compiled(compilation):
        start_helpers(compilation)
        run_compilation(compilation)


def start_process(*compilations: Compilation) -> subprocess.Popen:
    """Start a process that runs compilations one after the other, and ends when its standard input is closed."""
    code = _RUN.format(path=sys.path, compilations=[tuple(compilation) for compilation in compilations])
    silent = {"stdin": subprocess.PIPE, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    return subprocess.Popen([sys.executable, "-c", code], **silent)  # noqa: S603  (this interpreter, our own text)


def compile_all(compilations: Iterable[Compilation], report: Callable[[str], None]) -> int:
    """Run compilations in other processes, as many at once as there are processors; return how many failed.

    `report` is called with a line of text for each that failed.
    """
    todo, running, failed = list(compilations), {}, 0
    try:
        while todo or running:
            while todo and len(running) < processors():
                compilation = todo.pop(0)
                running[compilation] = start_process(compilation)
            ended = next((compilation for compilation, process in running.items() if process.poll() is not None), None)
            if ended is None:
                with contextlib.suppress(subprocess.TimeoutExpired):
                    next(iter(running.values())).wait(0.1)
            elif running.pop(ended).returncode != 0:
                report(f"not compiled: {ended.name}")
                failed += 1
    finally:
        for process in running.values():
            process.kill()
            process.wait()
    return failed


def processors() -> int:
    """Return how many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _mark_file(compilation):
    """Return the path of the file that marks a compilation as done, for this source, numba and processor."""
    import numba
    from llvmlite import binding

    from fpk_rocking.base import jit

    module, *names = compilation.name.split(":")
    root = pathlib.Path(__file__).parents[2]
    folder = jit.cache_folder(root.joinpath(*module.split(".")).with_suffix(".py"))
    return folder / f"{'-'.join(names)}-{numba.__version__}-{binding.get_host_cpu_name()}.done"


def _is_compiled(compilation):
    try:
        return _mark_file(compilation).exists()
    except OSError:
        return False


def _mark_compiled(compilation):
    with contextlib.suppress(OSError):
        place = _mark_file(compilation)
        place.parent.mkdir(parents=True, exist_ok=True)
        place.touch()
