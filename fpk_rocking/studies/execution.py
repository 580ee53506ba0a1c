"""Jobs of a sweep, each a scene with its seed: run on workers, with a file that keeps their rows as they come.

The file is text, one JSON object a line. The first line describes the sweep; each other one is the row of a job. A row
is appended in one piece: what a kill or a full disk leaves of the last line is no row and is overwritten. One sweep
at a time has the file: it is locked where the file system has locks, and the lock ends with the process.
"""

import concurrent.futures
import contextlib
import hashlib
import importlib.metadata
import json
import multiprocessing
import os
import pathlib
import signal
import threading
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from fpk_rocking.base import checks, precompilation
from fpk_rocking.base.checks import File, Progress
from fpk_rocking.base.precompilation import Compilation
from fpk_rocking.console import line
from fpk_rocking.scene.scene import Scene

try:
    import fcntl
except ImportError:  # outside Unix
    fcntl = None  # type: ignore[assignment]  # None: there are no locks of files

_EXECUTOR_ENDED = concurrent.futures.CancelledError, concurrent.futures.BrokenExecutor
_ROW = {"cell": int, "seed": int, "digest": str, "wall_s": float, "values": dict, "reason": str}


class Job(NamedTuple):
    """A scene of a sweep, with its number from 0 and the seed of its random numbers."""

    number: int
    scene: Scene
    seed: int

    def row(self, wall_s: float, values: dict[str, Any], reason: str) -> dict[str, Any]:
        """Row of this job: its number and seed, seconds, what the task returned, and why it failed, else empty."""
        return {"cell": self.number, "seed": self.seed, "wall_s": wall_s, "values": values, "reason": reason}


def seed_of(seed: int, number: int) -> int:
    """Return the seed of a job, 0 to 2**64 - 1, by that of the sweep and the job's number."""
    return int(np.random.SeedSequence([seed, number]).generate_state(1, np.uint64)[0])


def run_jobs(
    task: Callable[..., Any],
    jobs: Sequence[Job],
    options: dict[str, Any],
    kernels_of: Callable[..., list[Compilation]],
    *,
    workers: int | concurrent.futures.Executor,
    store: File | None = None,
    progress: Progress | None = None,
) -> tuple[dict[str, Any], ...]:
    """Run a task on jobs, or take their rows from a store; return the rows (`Job.row`) in the order of the jobs.

    The task is called as ``task(scene, seed=seed, **options)`` and returns a dict of what JSON holds;
    ``kernels_of(task, scenes, options)`` lists what to compile before several workers need it. `workers`, `store` and
    `progress` are as for `fpk_rocking.studies.sweep`.
    """
    if not isinstance(workers, concurrent.futures.Executor):
        workers = checks.count("workers", workers)
    checks.report(progress)
    sweep = {
        "task": f"{task.__module__}.{getattr(task, '__qualname__', type(task).__qualname__)}",
        "options": options,
        "version": importlib.metadata.version("fpk-rocking"),
    }
    with _opened_store(store, sweep, jobs) as (rows, keep):
        left = [job for job in jobs if job.number not in rows]
        if progress is not None:
            progress(len(rows), len(jobs))
        if left and workers != 1:
            for kernels in kernels_of(task, [job.scene for job in left], options):
                precompilation.ensure_compiled(kernels)
        with contextlib.closing(_rows_from(workers, task, left, options)) as computed:
            for row in computed:
                rows[row["cell"]] = row
                keep(row)
                if progress is not None:
                    progress(len(rows), len(jobs))
    return tuple(rows[job.number] for job in jobs)


def run_job(task: Callable[..., Any], job: Job, options: dict[str, Any]) -> dict[str, Any]:
    """Run a task on a job, with all threads, and return its row. An exception becomes its "reason"."""
    started, values, reason = time.perf_counter(), {}, ""
    try:
        values = json.loads(json.dumps(dict(task(job.scene, seed=job.seed, **options)), allow_nan=False))
    except Exception as error:  # noqa: BLE001  (whatever it is: a row says so, and the sweep goes on)
        reason = f"{type(error).__name__}: {line(error)}"
    return job.row(time.perf_counter() - started, values, reason)


def _run_on_one_thread(task, job, options, attempt):  # noqa: ARG001  (Dask answers equal calls with the first result)
    """Run a task on a job in a worker, which has one processor."""
    from fpk_rocking.base.jit import at_most

    with at_most(1):
        return run_job(task, job, options)


def _rows_from(workers, task, jobs, options) -> Generator[dict[str, Any], None, None]:
    """Yield the rows of jobs as they come, from this process, from several, or from an executor."""
    if workers == 1:
        for job in jobs:
            yield run_job(task, job, options)
    elif isinstance(workers, int):
        yield from _rows_from_processes(workers, task, jobs, options)
    else:
        try:
            yield from _rows_from_executor(workers, task, jobs, options)
        except _EXECUTOR_ENDED as error:
            raise RuntimeError(
                "workers: the executor ended before all scenes were run, as where the scheduler of a cluster "
                "ends; rows in a store are kept, and the same call with other workers goes on from there"
            ) from error


def _rows_from_executor(executor, task, jobs, options, attempt=1):
    """Yield the rows of jobs as they end. Those that the executor cannot run are tried again alone, once."""
    started, failed = time.perf_counter(), []
    # An executor that takes no more jobs raises here: that is no failure of a job.
    futures = {executor.submit(_run_on_one_thread, task, job, options, attempt): job for job in jobs}
    try:
        for future in concurrent.futures.as_completed(futures):
            try:
                yield future.result()
            except _EXECUTOR_ENDED:
                raise
            except Exception as error:  # noqa: BLE001  (of a job that no worker survived, or of one behind it)
                if attempt == 1:
                    failed.append(futures[future])
                else:
                    reason = f"{type(error).__name__}: {line(error)}"
                    yield futures[future].row(time.perf_counter() - started, {}, reason)
    finally:
        for future in futures:
            future.cancel()
    for job in failed:
        yield from _rows_from_executor(executor, task, [job], options, attempt=2)


def _rows_from_processes(count, task, jobs, options, alone=False):
    """Yield the rows of jobs on processes. If one is killed, jobs then running are tried again `alone`, once."""
    left, started = {job.number: job for job in jobs}, time.perf_counter()
    while left:
        try:
            with _processes(min(count, len(left))) as pool:
                for row in _rows_from_executor(pool, task, list(left.values()), options):
                    del left[row["cell"]]
                    yield row
        except concurrent.futures.BrokenExecutor:
            # Jobs begin in their order, so those that were running are the first that have no row.
            for number in list(left)[:count]:
                job = left.pop(number)
                if alone:
                    reason = "its process was killed, or ran out of memory"
                    yield job.row(time.perf_counter() - started, {}, reason)
                else:
                    yield from _rows_from_processes(1, task, [job], options, alone=True)


@contextlib.contextmanager
def _processes(count):
    """Yield an executor of some processes, which end at once with the block or with this process."""
    # Spawned, not forked: a fork after a parallel kernel has run would stand still.
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    pool = concurrent.futures.ProcessPoolExecutor(count, context, _begin_process, (theirs,))
    try:
        yield pool
    finally:
        ours.close()
        pool.shutdown(wait=True, cancel_futures=True)
        theirs.close()


def _begin_process(pipe):
    """Have this worker process ignore interruptions, and end when its parent closes the pipe or is killed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def watch():
        with contextlib.suppress(EOFError, OSError):
            pipe.recv()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


@contextlib.contextmanager
def _opened_store(
    path: File | None, sweep: dict[str, Any], jobs: Sequence[Job]
) -> Iterator[tuple[dict[int, dict[str, Any]], Callable[[dict[str, Any]], None]]]:
    """Yield the rows in the file of a sweep, by the number of their job, and a function that appends a row.

    The file is locked; it is made where it is missing, and without a path nothing is kept. `sweep` are plain values
    that identify the sweep. TypeError or ValueError, and the file is left as it is, where it is no store, is damaged,
    belongs to another sweep or other scenes, or is that of a sweep that still runs.
    """
    if path is None:
        yield {}, lambda _: None
        return
    file_path = checks.path("store", path)
    if file_path.exists() and not file_path.is_file():
        raise ValueError(checks.refusal("store", str(file_path), "a file, made where it is missing"))
    header = _json_line({"format": 1} | sweep)
    file_path.parent.mkdir(parents=True, exist_ok=True)
    # Appending: two processes that both find no file must not make it anew over each other's. Without a buffer: what a
    # full disk does not take must not be tried again when the file is closed.
    with file_path.open("a+b", buffering=0) as file:
        _lock(file, file_path)
        try:
            digests = {job.number: _digest(job) for job in jobs}
            rows = _read_rows(file, file_path, header, digests)

            def keep(row):
                own = {"cell": row["cell"], "seed": row["seed"], "digest": digests[row["cell"]]}
                _append(file, _json_line(own | row))

            yield rows, keep
        finally:
            # Closing is not enough where a process that was forked meanwhile has the file open too.
            with contextlib.suppress(OSError):
                if fcntl is not None:
                    fcntl.flock(file, fcntl.LOCK_UN)


def _digest(job):
    """16 hexadecimal digits that identify scene and seed."""
    return hashlib.sha256(f"{job.seed}\n{job.scene.to_toml()}".encode()).hexdigest()[:16]


def _lock(file, path):
    """Lock an open file; ValueError where another sweep has it locked."""
    if fcntl is None:
        return
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise ValueError(checks.refusal("store", str(path), "a file that no sweep in progress writes to")) from None
    except OSError:
        pass  # a file system without locks


def _read_rows(file, path: pathlib.Path, header: bytes, digests: dict[int, str]) -> dict[int, dict[str, Any]]:
    """Return the rows of a store by the number of their job; cut the store after its last complete line.

    A new file gets the header. ValueError, and the file is left as it is, where a line is damaged, the header differs,
    or a row is of a job with another digest.
    """
    file.seek(0)
    content = file.read()
    if header.startswith(content):
        file.truncate(0)
        _append(file, header)
        return {}
    *lines, rest = content.split(b"\n")
    refused = f"store: got {path} with {{}}, accepted: a new file, or that of a sweep with {{}}"
    first, wanted, rows = _entry(path, lines[0] if lines else b"", 1), json.loads(header), {}
    for name in wanted | first:
        if first.get(name) != wanted.get(name):
            raise ValueError(refused.format(f"{name} = {first.get(name)!r}", f"{name} = {wanted.get(name)!r}"))
    for number, text in enumerate(lines[1:], 2):
        row = _entry(path, text, number, _ROW)
        if digests.get(row["cell"]) != row.pop("digest"):
            accepted = "the same scenes, motions and intensities, in this order, and seed"
            raise ValueError(refused.format(f"another scene {row['cell']}", accepted))
        rows[row["cell"]] = row
    file.truncate(len(content) - len(rest))
    return rows


def _entry(path, text, number, types=None):
    """Return the JSON object in a line of a store, with values of some types by name; ValueError for anything else."""
    try:
        entry = json.loads(text)
    except ValueError:
        entry = None
    sound = isinstance(entry, dict)
    if sound and types:
        sound = entry.keys() == types.keys() and all(isinstance(entry[name], cls) for name, cls in types.items())
    if not sound:
        damage = f"{path} is damaged or not the file of a sweep (line {number})"
        raise ValueError(f"store: {damage}; accepted: a new file")
    return entry


def _append(file, content: bytes):
    """Write all bytes of `content` to an unbuffered file."""
    while content:
        content = content[file.write(content) :]


def _json_line(entry) -> bytes:
    """Return a line of JSON with its newline; TypeError for values that are not plain."""
    try:
        return (json.dumps(entry, allow_nan=False, ensure_ascii=False) + "\n").encode()
    except (TypeError, ValueError) as error:
        accepted = "accepted with a store: numbers, texts, None, lists and dicts of them"
        raise TypeError(f"options: {error}, {accepted}") from None
