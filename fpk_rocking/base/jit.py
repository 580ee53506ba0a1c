"""One decorator for every compiled kernel, with a disk cache that cannot go stale; and the threads that kernels run in.

Numba keys a cached kernel by its own file alone, so a kernel would keep running old machine code after a kernel that it
imports from another file has changed. Here the cache folder is named after the text of a kernel's file and of all the
project's files that it imports, directly or through others: a change anywhere else leaves the machine code valid.

Kernels release the interpreter lock, so threads of the standard library serve. Their number is that of the environment
variable NUMBA_NUM_THREADS, by default the number of processors. Work is parted such that no result depends on it.
"""

import atexit
import concurrent.futures
import contextlib
import contextvars
import functools
import gc
import hashlib
import math
import os
import pathlib
import re
import shutil
import tempfile
import threading

import numba
import numpy as np
from numba.extending import typeof_impl

try:
    import fcntl
except ImportError:  # not a POSIX system: processes that compile at the same time are on their own
    fcntl = None

_compiling = threading.Lock()
_ROOT = pathlib.Path(__file__).resolve().parents[2]
_IMPORT = re.compile(r"^ *from ((?:fpk_rocking|montecarlo)[\w.]*) import (\([^)]*\)|[^\n]*)", re.MULTILINE)


def _cache_root() -> pathlib.Path:
    """Return the folder (path) of all cached machine code: NUMBA_CACHE_DIR, else one in the user's cache folder."""
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    if chosen:
        return pathlib.Path(chosen)
    try:
        return pathlib.Path(os.environ.get("XDG_CACHE_HOME") or pathlib.Path.home() / ".cache") / "fpk-rocking"
    except RuntimeError as error:  # a user without a home
        raise FileNotFoundError("this user has no home folder, and NUMBA_CACHE_DIR names no other one") from error


@functools.cache
def source_files(path: pathlib.Path) -> frozenset:
    """Return a frozenset of paths: a source file of the project, and all of these that it imports, even indirectly."""
    files, todo = set(), [path]
    while todo:
        here = todo.pop()
        if here not in files:
            files.add(here)
            todo += _imported_files(here)
    return frozenset(files)


@functools.cache
def _imported_files(path):
    """Return a list of the paths of the project's files that a file at `path` imports, modules and packages alike."""
    files = []
    for module, names in _IMPORT.findall(path.read_text(encoding="utf-8")):
        folder = _ROOT.joinpath(*module.split("."))
        places = [folder.with_suffix(".py"), folder / "__init__.py"]
        places += [folder / f"{name}.py" for name in re.findall(r"\w+", names)]
        files += [place for place in places if place.is_file()]
    return files


@functools.cache
def cache_folder(path: pathlib.Path) -> pathlib.Path:
    """Return the path of the folder for the machine code of a source file at `path`.

    It is named after a digest of the file's text, of that of what it imports, and of numba's version, each of which
    discards what another one has kept. OSError where the user has no folder for it.
    """
    digest = hashlib.sha256(numba.__version__.encode())
    for source in sorted(source_files(path)):
        digest.update(source.name.encode() + b"\0" + source.read_bytes())
    return _cache_root() / digest.hexdigest()[:16]


def _is_writable(folder):
    """Whether files can be written to a `folder`, which is made if it is missing."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


@functools.cache
def _copy_of(folder):
    """Return the path of a copy, until the process ends, of a `folder`: numba reads from none that it cannot write."""
    copy = pathlib.Path(tempfile.mkdtemp(prefix="fpk-rocking-"))
    atexit.register(shutil.rmtree, copy, ignore_errors=True)
    return shutil.copytree(folder, copy, dirs_exist_ok=True, copy_function=shutil.copyfile)


def _remove_machine_code(folder):
    """Remove all machine code in a `folder`; a process that is about to read it compiles instead."""
    for path in (*folder.rglob("*.nbi"), *folder.rglob("*.nbc")):
        with contextlib.suppress(OSError):
            path.unlink()


def keeps_machine_code():
    """Whether this user has a folder in which machine code outlasts the process."""
    try:
        return _is_writable(cache_folder(pathlib.Path(__file__).resolve()))
    except OSError:
        return False


def kernel(function=None, *, file=None, **options):
    """Compile a function to machine code on first call; the code is kept on disk between runs.

    `file` is the source file that decides, with those that it imports, whether what is on disk is still right: by
    default that of the function, but a function that is made for a module has its text elsewhere. `options` go to
    `numba.njit`. The compiled function releases the interpreter lock while it runs; division by zero gives inf or nan
    as in numpy, never an exception.
    """
    if function is None:
        return functools.partial(kernel, file=file, **options)
    # What is not set here numba takes from whichever kernel happens to call this one first in a process.
    # No C function of it is asked for, and to make one takes a fifteenth of the time.
    options = {"error_model": "numpy", "fastmath": False, "nogil": True, "no_cfunc_wrapper": True} | options
    # What numba puts in line as text it has to see as its own; no other kernel calls machine code of it.
    if options.get("inline") == "always":
        return numba.njit(**options)(function)
    return Kernel(function, pathlib.Path(file or function.__code__.co_filename).resolve(), options)


class Kernel:
    """A function compiled twice, where both are needed: for Python, which keeps it on disk, and for other kernels.

    Most kernels are called by others alone. Their machine code becomes a part of the caller's. So it is neither kept on
    disk nor made callable from Python: the wrappers alone took 15 to 18 % of the time of a first answer.
    """

    def __init__(self, function, file, options):
        functools.update_wrapper(self, function)
        self.py_func, self._file, self._options = function, file, options
        self._for_kinds = {}
        self.for_types = {}
        """What numba made of the function for calls from Python, by the tuple of numba types of the arguments."""

    def __call__(self, *arguments):
        """Call the compiled function from Python."""
        missing = self.py_func.__code__.co_argcount - len(arguments)
        if missing:
            arguments += (self.py_func.__defaults__ or ())[-missing:]
        kinds = tuple(map(_kind, arguments))
        if kinds not in self._for_kinds:
            self._for_kinds[kinds] = self._compiled(tuple(map(numba.typeof, arguments)))
        return self._for_kinds[kinds](*arguments)

    @functools.cached_property
    def for_kernels(self):
        """What numba makes of the function for calls from other kernels, which Python cannot call."""
        return numba.njit(**self._options, no_cpython_wrapper=True)(self.py_func)

    def _compiled(self, types):
        """Return the function compiled for numba types, by one thread of one process at a time.

        The second process finds what the first has made. Numba's cache does not survive two that write to it at once
        (its issue 4807).
        """
        with _compiling, contextlib.ExitStack() as stack:
            if types in self.for_types:
                return self.for_types[types]
            kept = self._open_folder(stack)
            # The collector goes through all that the compiler holds, again and again, and finds little.
            if gc.isenabled():
                stack.callback(gc.enable)
                gc.disable()
            self.for_types[types] = self._loaded_or_compiled(types, kept)
            return self.for_types[types]

    def _open_folder(self, stack):
        """Have numba keep machine code in this kernel's folder, locked, until `stack` ends; whether there is one."""
        try:
            folder = cache_folder(self._file)
            folder = folder if _is_writable(folder) else _copy_of(folder)
        except OSError:
            return False
        # Some file systems have no locks: two processes may then compile the same kernel.
        with contextlib.suppress(OSError):
            lock = stack.enter_context((folder / f"{self.py_func.__qualname__}.lock").open("a"))
            if fcntl:
                fcntl.flock(lock, fcntl.LOCK_EX)
        # Other places that the user's settings name know nothing of the files that a kernel imports.
        for name, value in (("CACHE_DIR", str(folder)), ("CACHE_LOCATOR_CLASSES", "")):
            stack.callback(setattr, numba.config, name, getattr(numba.config, name, ""))
            setattr(numba.config, name, value)
        return True

    def _loaded_or_compiled(self, types, kept):
        """Return the function for numba types, from the disk if `kept`; what is damaged there is compiled anew."""
        if kept:
            for attempt in range(2):
                try:
                    return numba.njit(types, cache=True, **self._options)(self.py_func)
                except Exception:  # noqa: BLE001  (reading a damaged file raises whatever its bytes make of it)
                    if attempt == 0:
                        _remove_machine_code(pathlib.Path(numba.config.CACHE_DIR))
        return numba.njit(types, **self._options)(self.py_func)


def _kind(value):
    """Return what decides the numba type of an argument, many times as fast as `numba.typeof`."""
    if isinstance(value, np.ndarray):
        return value.dtype, value.ndim, value.flags.num
    return (type(value), *map(_kind, value)) if isinstance(value, tuple) else type(value)


@typeof_impl.register(Kernel)
def _type_in_kernels(compiled, context):
    """Return the numba type of a `Kernel` in the text of another one."""
    return typeof_impl(compiled.for_kernels, context)


_most = contextvars.ContextVar[int]("most threads")


def thread_count():
    """Return the number of threads (int) that kernels may use here: `at_most` of them, or NUMBA_NUM_THREADS."""
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
    """Return the ThreadPoolExecutor of the process, made at the first call."""
    return concurrent.futures.ThreadPoolExecutor(numba.config.NUMBA_NUM_THREADS)


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_pool.cache_clear)  # a forked process has none of its parent's threads


def map_threads(function, items):
    """Call a function, which runs kernels, with each of some items (a sequence); return None when all have ended.

    The threads take the items in turn; what the function returns is dropped.
    """
    waiting = iter(items)

    def work():
        """Call the function with the items that no other thread has taken."""
        for item in waiting:
            function(item)

    _run_together([work] * max(min(thread_count(), len(items)), 1))


LEAST_SECONDS = 2e-4
"""Least work of a thread: a tenth of a millisecond is lost where a second one takes a part."""


def run_in_parts(kernel, count, *arguments, seconds=math.inf):
    """Call ``kernel(begin, end, *arguments)`` for ranges that together are 0 to `count`, a range for each thread.

    `arguments` are the same in each call; the kernel returns nothing. All ranges together take about `seconds` of one
    processor: short work is shared by fewer threads.
    """
    threads = int(max(min(thread_count(), count, seconds / LEAST_SECONDS), 1))
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
