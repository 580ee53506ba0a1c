"""Cells on workers: in this process, on processes of its own, or on any executor of `concurrent.futures`."""

import concurrent.futures
import contextlib
import multiprocessing
import os
import signal
import threading
import time

from studies.cells import perform, perform_alone, row_of


def rows_of(verb, cells, options, workers):
    """Run a verb on cells.

    Parameters
    ----------
    verb, options
        As `studies.cells.perform`.
    cells : sequence of Cell
    workers : int or concurrent.futures.Executor
        1: one cell after the other in this process, with all threads. More: as many processes, one thread each. An
        executor: every cell is handed to it at once.

    Yields
    ------
    dict
        Rows as they come.
    """
    if not isinstance(workers, int):
        yield from _handed(workers, verb, cells, options)
    elif workers == 1:
        for cell in cells:
            yield perform(verb, cell, options)
    else:
        yield from _pooled(verb, cells, options, workers)


def _handed(executor, verb, cells, options):
    """Yield rows of an executor; what it could not run is a row, unless the executor itself has come to its end."""
    futures = {executor.submit(perform_alone, verb, cell, options): cell for cell in cells}
    begin = time.perf_counter()
    try:
        for future in concurrent.futures.as_completed(futures):
            try:
                row = future.result()
            except (concurrent.futures.CancelledError, concurrent.futures.BrokenExecutor):
                raise
            except Exception as error:  # noqa: BLE001  (a task that no worker survived, say)
                row = row_of(futures[future], time.perf_counter() - begin, {}, f"{type(error).__name__}: {error}")
            yield row
    finally:
        for future in futures:
            future.cancel()


def _pooled(verb, cells, options, count):
    """Yield rows of processes; where one of these is killed, the cells that were running are tried one by one."""
    left = {cell.number: cell for cell in cells}
    while left:
        try:
            with _pool(count) as pool:
                for row in _handed(pool, verb, left.values(), options):
                    del left[row["cell"]]
                    yield row
        except concurrent.futures.BrokenExecutor:
            # Cells are begun in their order, so those that were running are the first that are left.
            for cell in list(left.values())[:count]:
                del left[cell.number]
                yield _alone(verb, cell, options)


def _alone(verb, cell, options):
    begin = time.perf_counter()
    try:
        with _pool(1) as pool:
            return pool.submit(perform_alone, verb, cell, options).result()
    except concurrent.futures.BrokenExecutor:
        reason = "its process was killed, or ran out of memory"
        return row_of(cell, time.perf_counter() - begin, {}, reason)


@contextlib.contextmanager
def _pool(count):
    """Yield an executor of processes that end at once with the block, or with this process, however it ends."""
    # Spawned, not forked: a fork after a parallel kernel has run would stand still.
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    pool = concurrent.futures.ProcessPoolExecutor(count, context, _begin, (theirs,))
    try:
        yield pool
    finally:
        ours.close()
        pool.shutdown(wait=True, cancel_futures=True)
        theirs.close()


def _begin(parent):
    """Set up a worker: it leaves interruptions to its parent, and ends when the pipe from there is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def watch():
        with contextlib.suppress(EOFError, OSError):
            parent.recv()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
