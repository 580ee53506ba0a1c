"""Machine code made ahead of its use, by processes of their own: numba compiles one kernel at a time in a process.

A task is a function "module:name" that calls kernels on as little as there is. Helpers run tasks beside the work that
needs the same kernels a little later: who comes second waits for the lock of a kernel and loads what the first has made
(`base.jit`). Helpers say nothing, and end with the process that started them.
"""

import contextlib
import multiprocessing
import os
import pathlib
import subprocess
import sys

TASKS = {
    "fpk_rocking.least_runs:free_flight": 15,
    "fpk_rocking.least_runs:density": 15,
    "fpk_rocking.least_runs:density_exact": 20,
    "fpk_rocking.least_runs:rest": 3,
    "fpk_rocking.least_runs:rest_exact": 3,
    "fpk_rocking.least_runs:exact": 7,
    "fpk_rocking.least_runs:enveloped": 7,
    "fpk_rocking.least_runs:nonlinear_exact": 11,
    "fpk_rocking.least_runs:rk4": 7,
    "fpk_rocking.least_runs:rk4_exact": 9,
    "fpk_rocking.least_runs:white": 6,
    "fpk_rocking.least_runs:white_exact": 8,
    "fpk_rocking.least_runs:filtered": 6,
    "fpk_rocking.least_runs:filtered_exact": 9,
    "fpk_rocking.least_runs:operator": 12,
}
"""Tasks, and the seconds that a first run which needs them takes longer, about; on two cores of 2024."""

ALL_S = 80
"""Seconds that all of them take side by side, about."""

BODY_TASKS = {
    "fpk_rocking.least_runs:density_body": 20,
    "fpk_rocking.least_runs:nonlinear_body": 11,
    "fpk_rocking.least_runs:rk4_body": 9,
    "fpk_rocking.least_runs:white_body": 8,
    "fpk_rocking.least_runs:filtered_body": 9,
}
"""Tasks for bodies of unequal sides, which `compile_all` leaves to the first call that needs them; seconds likewise."""

_RUN = """
import importlib, os, signal, sys, threading
signal.signal(signal.SIGINT, signal.SIG_DFL)
threading.Thread(target=lambda: (sys.stdin.read(), os._exit(1)), daemon=True).start()
sys.path[:] = {path!r}
from fpk_rocking.base import precompilation
for task in {tasks!r}:
    precompilation.run_task(task)
os._exit(0)
"""

_helpers = []
_queued = []


def task_for_block(task, scene):
    """Return the name (str) of the task that compiles for a `Scene`: kernels are made for each kind of block.

    `task` is that for slender blocks; that for exact ones ends with "_exact", that for unequal sides with "_body".
    """
    if not scene.block.symmetric:
        return f"{task}_body"
    return f"{task}_exact" if scene.block.critical_angle > 0.0 else task


def run_task(task):
    """Run a task, one of `TASKS` ("module:function"), in this process, and mark it on the disk as compiled."""
    import importlib

    module, name = task.split(":")
    _helpers.append(None)  # a helper starts no others
    getattr(importlib.import_module(module), name)()
    _mark_compiled(task)


def queue_for_helpers(task):
    """Add a task, one of `TASKS`, to those that helper processes of the next `start_helpers` compile after its own."""
    _queued.append(task)


def start_helpers(task, *helping):
    """Start helper processes for a call that compiles for the first time, and report it on standard error.

    Only the first time in a process and, where that ran to its end, on a machine.

    Parameters
    ----------
    task : str
        One of `TASKS`: what the caller is about to need.
    *helping : str
        Tasks that helpers take on meanwhile, where there is more than one processor; first those that are needed first.
    """
    if _helpers or multiprocessing.parent_process() is not None or _is_compiled(task):
        return
    sys.stderr.write(f"compiling machine code for this machine, once: about {(TASKS | BODY_TASKS)[task]} s\n")
    helping = [name for name in (*helping, *_queued) if not _is_compiled(name)]
    count = min(len(helping), processors() - 1)
    _helpers.extend([start_process(*helping[k::count]) for k in range(count)] or [None])
    _mark_compiled(task)


def ensure_compiled(task):
    """Run a task, one of `TASKS`, in this process unless its code is on the disk: before workers start that need it."""
    if not _is_compiled(task):
        start_helpers(task)
        run_task(task)


def start_process(*tasks):
    """Start a process that runs `tasks`, of `TASKS`, one after the other; return its `subprocess.Popen`.

    The process ends when its standard input is closed.
    """
    code = _RUN.format(path=sys.path, tasks=tasks)
    silent = {"stdin": subprocess.PIPE, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    return subprocess.Popen([sys.executable, "-c", code], **silent)  # noqa: S603  (this interpreter, our own text)


def compile_all(report):
    """Run all `TASKS` in processes of their own, as many at once as there are processors.

    Parameters
    ----------
    report : callable
        Called with a line of text for each task that failed.

    Returns
    -------
    int
        Number of tasks that failed.
    """
    todo, running, failed = list(TASKS), {}, 0
    try:
        while todo or running:
            while todo and len(running) < processors():
                task = todo.pop(0)
                running[task] = start_process(task)
            task = next((name for name, run in running.items() if run.poll() is not None), None)
            if task is None:
                try:
                    next(iter(running.values())).wait(0.1)
                except subprocess.TimeoutExpired:
                    continue
            elif running.pop(task).returncode != 0:
                report(f"not compiled: {task}")
                failed += 1
    finally:
        for run in running.values():
            run.kill()
            run.wait()
    return failed


def processors():
    """Return how many processors (int) this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _mark_file(task):
    """Return the path of the file whose presence marks a task, one of `TASKS`, as compiled.

    It holds for this source code, this numba and this processor.
    """
    import numba
    from llvmlite import binding

    from fpk_rocking.base import jit

    module, name = task.split(":")
    root = pathlib.Path(__file__).parents[2]
    folder = jit.cache_folder(root.joinpath(*module.split(".")).with_suffix(".py"))
    return folder / f"{name}-{numba.__version__}-{binding.get_host_cpu_name()}.done"


def _is_compiled(task):
    """Whether the machine code of a task, one of `TASKS`, is on the disk (bool)."""
    try:
        return _mark_file(task).exists()
    except OSError:
        return False


def _mark_compiled(task):
    """Mark a task, one of `TASKS`, as compiled, where the disk can be written to."""
    with contextlib.suppress(OSError):
        place = _mark_file(task)
        place.parent.mkdir(parents=True, exist_ok=True)
        place.touch()
