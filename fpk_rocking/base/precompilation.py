"""Machine code made ahead of its use, by processes of their own: numba compiles one kernel at a time in a process.

A task calls kernels on as little as there is. Helpers run tasks beside the work that needs the same kernels a little
later: who comes second waits for the lock of a kernel and loads what the first has made (`base.jit`). Helpers say
nothing, and end with the process that started them.
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


class Task(NamedTuple):
    """A function that calls kernels: its name, "module:function" or "module:function:argument:argument" of texts.

    `seconds`: what a first run that needs them takes longer, about; on two cores of 2024.
    """

    name: str
    seconds: int


_RUN = """
import os, signal, sys, threading
signal.signal(signal.SIGINT, signal.SIG_DFL)
threading.Thread(target=lambda: (sys.stdin.read(), os._exit(1)), daemon=True).start()
sys.path[:] = {path!r}
from fpk_rocking.base import precompilation
for task in {tasks!r}:
    precompilation.run_task(precompilation.Task(*task))
os._exit(0)
"""

_helpers: list[subprocess.Popen | None] = []
_queued: list[Task] = []
_announced: list[Task] = []


def run_task(task: Task) -> None:
    """Run a task in this process, and mark it on the disk as compiled."""
    module, function, *arguments = task.name.split(":")
    start_no_helpers()
    getattr(importlib.import_module(module), function)(*arguments)
    _mark_compiled(task)


def start_no_helpers() -> None:
    """Have this process start no helpers from now on."""
    _helpers.append(None)


def queue_for_helpers(task: Task) -> None:
    """Have the helpers of the next `start_helpers` run a task after their own."""
    _queued.append(task)


def start_helpers(task: Task, *helping: Task) -> None:
    """Start helper processes for a call that is about to need a task's kernels, and report it on standard error.

    Only the first time in a process, and on a machine the first time that a process got here. With more than one
    processor, helpers run the tasks `helping` meanwhile; first those that are needed first.
    """
    if _helpers or multiprocessing.parent_process() is not None or _is_compiled(task):
        return
    from fpk_rocking.base import jit

    kept = "once" if jit.keeps_machine_code() else "which no folder keeps (set NUMBA_CACHE_DIR)"
    sys.stderr.write(f"compiling machine code for this machine, {kept}: about {task.seconds} s\n")
    left = [other for other in (*helping, *_queued) if not _is_compiled(other)]
    _helpers.extend([start_process(*share) for share in shares(left, processors() - 1)] or [None])
    _announced.append(task)


def mark_announced() -> None:
    """Mark on the disk what `start_helpers` announced: the call that needed it has come to its end.

    Until then it is not marked, so that after an interruption the next run says again that it compiles.
    """
    while _announced:
        _mark_compiled(_announced.pop())


def shares(tasks: Sequence[Task], processes: int) -> list[Sequence[Task]]:
    """Deal tasks to at most so many processes, in turn; none is without a task."""
    count = min(len(tasks), processes)
    return [tasks[k::count] for k in range(count)]


def ensure_compiled(task: Task) -> None:
    """Run a task in this process unless its code is on the disk: before workers start that need it."""
    if not _is_compiled(task):
        start_helpers(task)
        run_task(task)


def start_process(*tasks: Task) -> subprocess.Popen:
    """Start a process that runs tasks one after the other, and ends when its standard input is closed."""
    code = _RUN.format(path=sys.path, tasks=[tuple(task) for task in tasks])
    silent = {"stdin": subprocess.PIPE, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    return subprocess.Popen([sys.executable, "-c", code], **silent)  # noqa: S603  (this interpreter, our own text)


def compile_all(tasks: Iterable[Task], report: Callable[[str], None]) -> int:
    """Run tasks in processes of their own, as many at once as there are processors; return how many failed.

    `report` is called with a line of text for each of these.
    """
    todo, running, failed = list(tasks), {}, 0
    try:
        while todo or running:
            while todo and len(running) < processors():
                task = todo.pop(0)
                running[task] = start_process(task)
            ended = next((task for task, process in running.items() if process.poll() is not None), None)
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


def _mark_file(task):
    """Return the path of the file whose presence marks a task as compiled, for this source, numba and processor."""
    import numba
    from llvmlite import binding

    from fpk_rocking.base import jit

    module, *names = task.name.split(":")
    root = pathlib.Path(__file__).parents[2]
    folder = jit.cache_folder(root.joinpath(*module.split(".")).with_suffix(".py"))
    return folder / f"{'-'.join(names)}-{numba.__version__}-{binding.get_host_cpu_name()}.done"


def _is_compiled(task):
    try:
        return _mark_file(task).exists()
    except OSError:
        return False


def _mark_compiled(task):
    with contextlib.suppress(OSError):
        place = _mark_file(task)
        place.parent.mkdir(parents=True, exist_ok=True)
        place.touch()
