"""Cells on workers: in this process, on processes of its own, or on any executor of `concurrent.futures`."""

import concurrent.futures
import contextlib
import itertools
import math
import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable, Generator, Sequence
from typing import Any

from fpk_rocking.console import line
from fpk_rocking.studies.execution.cells import Cell, perform, perform_alone, row_of

_PACKS = 16
"""Packs that n cells are handed over in, over √n: single cells up to 256, few enough packs of many."""

_ENDED = concurrent.futures.CancelledError, concurrent.futures.BrokenExecutor
"""Errors of a task whose executor has come to its end."""


def rows_of(
    verb: Callable[..., Any], cells: Sequence[Cell], options: dict[str, Any], workers: int | concurrent.futures.Executor
) -> Generator[dict[str, Any], None, None]:
    """Run a verb on cells.

    Parameters
    ----------
    verb, options
        As `fpk_rocking.studies.execution.cells.perform`.
    cells : sequence of Cell
    workers : int or concurrent.futures.Executor
        1: one cell after the other in this process, with all threads. More: as many processes, one thread each. An
        executor: all cells are handed to it at once.

    Yields
    ------
    dict
        Rows as they come.
    """
    if not isinstance(workers, int):
        try:
            yield from _handed(workers, verb, cells, options)
        except _ENDED as error:
            raise RuntimeError(
                "workers: the executor came to its end before all scenes were run, as where the scheduler of a cluster "
                "ends; rows in a store are kept, and the same call with other workers goes on from there"
            ) from error
    elif workers == 1:
        for cell in cells:
            yield perform(verb, cell, options)
    else:
        yield from _pooled(verb, cells, options, workers)


def _handed(executor, verb, cells, options):
    """Yield rows of an executor, which gets packs of cells; those of a pack that it could not run are tried alone."""
    packs = _packs(list(cells))
    futures = {executor.submit(perform_alone, verb, pack, options): pack for pack in packs}
    failed = []
    try:
        for future in concurrent.futures.as_completed(futures):
            try:
                rows = future.result()
            except _ENDED:
                raise
            except Exception:  # noqa: BLE001  (a task that no worker survived, or one that stood in line behind it)
                failed += futures[future]
            else:
                yield from rows
    finally:
        for future in futures:
            future.cancel()
    for cell in failed:
        yield _alone(executor, verb, cell, options)


def _pooled(verb, cells, options, count):
    """Yield rows of processes; where one of these is killed, the cells that were running are tried one by one."""
    left = {cell.number: cell for cell in cells}
    while left:
        packs = _packs(list(left.values()))
        try:
            with _pool(min(count, len(packs))) as pool:
                for row in _handed(pool, verb, left.values(), options):
                    del left[row["cell"]]
                    yield row
        except concurrent.futures.BrokenExecutor:
            # Packs are begun in their order, so those that were running are the first of which something is left.
            unfinished = [pack for pack in packs if pack[-1].number in left]
            for cell in itertools.chain(*unfinished[:count]):
                del left[cell.number]
                with _pool(1) as pool:
                    yield _alone(pool, verb, cell, options, dies="its process was killed, or ran out of memory")


def _packs(cells):
    size = math.ceil(math.sqrt(len(cells)) / _PACKS)
    return [cells[first : first + size] for first in range(0, len(cells), size)]


def _alone(executor, verb, cell, options, dies=None):
    """Return the row of a cell that an executor runs by itself; `dies` is the reason where that ends the executor."""
    begin = time.perf_counter()
    # A tuple and not a list: Dask gives equal calls one key, and so the result of the first. An executor that takes no
    # more work raises here: that is no failure of the cell.
    future = executor.submit(perform_alone, verb, (cell,), options)
    try:
        return future.result()[0]
    except _ENDED:
        if dies is None:
            raise
        reason = dies
    except Exception as error:  # noqa: BLE001  (whatever it is: a row says so, and the sweep goes on)
        reason = f"{type(error).__name__}: {line(error)}"
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
