"""Threads of the standard library for compiled kernels, which release the interpreter lock.

Their number is that of the environment variable NUMBA_NUM_THREADS, by default the number of processors. Work is parted
such that no result depends on it.
"""

import concurrent.futures
import contextlib
import contextvars
import functools
import os

import numba

_most = contextvars.ContextVar[int]("most threads")


def thread_count():
    """Return the number of threads that kernels may use here."""
    return min(numba.config.NUMBA_NUM_THREADS, _most.get(numba.config.NUMBA_NUM_THREADS))


@contextlib.contextmanager
def at_most(threads):
    """Let kernels that are called within the block use at most `threads` threads (int)."""
    token = _most.set(threads)
    try:
        yield
    finally:
        _most.reset(token)


@functools.cache
def _pool():
    """Pool of the threads, made at the first call."""
    return concurrent.futures.ThreadPoolExecutor(numba.config.NUMBA_NUM_THREADS)


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_pool.cache_clear)  # a forked process has none of its parent's threads


def map_threads(function, items):
    """Call a function, which runs kernels, with each of some items (a sequence); the threads take them in turn."""
    waiting = iter(items)

    def work():
        """Call the function with the items that no other thread has taken."""
        for item in waiting:
            function(item)

    _run_together([work] * max(min(thread_count(), len(items)), 1))


def run_in_parts(kernel, count, *arguments):
    """Call ``kernel(begin, end, *arguments)`` for ranges that together are 0 to `count`, a range for each thread.

    `arguments` are the same in each call; the kernel returns nothing.
    """
    threads = max(min(thread_count(), count), 1)
    ends = [count * k // threads for k in range(threads + 1)]
    _run_together([functools.partial(kernel, *ends[k : k + 2], *arguments) for k in range(threads)])


def _run_together(tasks):
    """Call `tasks`, a list of functions without arguments, at the same time; return when all have ended.

    The first runs in this thread.
    """
    if len(tasks) == 1:
        tasks[0]()
        return
    futures = [_pool().submit(task) for task in tasks[1:]]
    try:
        tasks[0]()
    finally:
        concurrent.futures.wait(futures)
    for future in futures:
        future.result()
