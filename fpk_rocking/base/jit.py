"""One decorator for every compiled kernel, with a disk cache that cannot go stale.

Numba keys a cached kernel by its own file alone, so a kernel would keep running old machine code after a kernel that it
imports from another file has changed. Here the cache folder is named after the text of a kernel's file and of all the
project's files that it imports, directly or through others: a change anywhere else leaves the machine code valid.
"""

import contextlib
import functools
import gc
import hashlib
import os
import pathlib
import re

# Threads that wait in a busy loop starve whatever else runs on the machine, the project's other runs included. The
# OpenMP library reads this when it is loaded, so it is set before; a value that the user has set is kept.
os.environ.setdefault("OMP_WAIT_POLICY", "passive")

import numba

try:
    import fcntl
except ImportError:  # not a POSIX system: processes that compile at the same time are on their own
    fcntl = None

from fpk_rocking.base.kept import Kept
from fpk_rocking.base.whole import Tuned, Whole, available


def _can_borrow():
    try:
        from numba.core.cpu import CPUTargetOptions
    except ImportError:
        return False
    return hasattr(CPUTargetOptions, "_nrt") and "FPK_ROCKING_COUNT_REFERENCES" not in os.environ


BORROWS = _can_borrow()
"""Whether kernels that only borrow arrays are compiled without counting references to them.

The option is one of numba's own, without a promise to stay. Without it, or with FPK_ROCKING_COUNT_REFERENCES set,
results are the same and the engines slower.
"""

WHOLE = available()
"""Whether kernels are compiled as a whole; see `base.whole`."""

_ROOT = pathlib.Path(__file__).resolve().parents[2]
_IMPORT = re.compile(r"^ *from ((?:fpk_rocking|montecarlo)[\w.]*) import (\([^)]*\)|[^\n]*)", re.MULTILINE)


def _cache_root() -> pathlib.Path:
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    if chosen:
        return pathlib.Path(chosen)
    return pathlib.Path(os.environ.get("XDG_CACHE_HOME") or pathlib.Path.home() / ".cache") / "fpk-rocking"


@functools.cache
def sources(path: pathlib.Path) -> frozenset:
    """Return a source file of the project and all of the project's files that it imports, directly or not."""
    found, todo = set(), [path]
    while todo:
        here = todo.pop()
        if here not in found:
            found.add(here)
            todo += _imported(here)
    return frozenset(found)


@functools.cache
def _imported(path):
    """Files of the project that a file imports, modules and packages alike."""
    found = []
    for module, names in _IMPORT.findall(path.read_text(encoding="utf-8")):
        folder = _ROOT.joinpath(*module.split("."))
        places = [folder.with_suffix(".py"), folder / "__init__.py"]
        places += [folder / f"{name}.py" for name in re.findall(r"\w+", names)]
        found += [place for place in places if place.is_file()]
    return found


@functools.cache
def cache_folder(path: pathlib.Path) -> pathlib.Path:
    """Return the folder for what is made of a source file and of those that it imports."""
    digest = hashlib.sha256()
    for source in sorted(sources(path)):
        digest.update(source.name.encode() + b"\0" + source.read_bytes())
    return _cache_root() / digest.hexdigest()[:16]


def kernel(function=None, *, borrows=False, tuned=False, file=None, **options):
    """Compile a function to machine code on first call; the result is kept on disk between runs.

    Parameters
    ----------
    function : callable
        A function in the subset of Python that numba compiles.
    borrows : bool
        Leave out the counting of references to arrays, which can cost more than a small kernel itself, where numba has
        the option (see `BORROWS`). Only for a function that neither makes arrays nor returns any, and calls none that
        does.
    tuned : bool
        Optimize it by itself before it becomes part of a kernel that calls it (see `base.whole`).
    file : path, optional
        Source file that decides, with those that it imports, whether what is on disk is still right; by default that of
        the function. A function that is made for a module has its text elsewhere.
    **options
        Passed to `numba.njit`, e.g. ``parallel=True``, ``fastmath={"contract"}``, ``inline="always"``.

    Returns
    -------
    callable
        The compiled dispatcher. Division by zero gives inf or nan as in numpy, never an exception.
    """
    if function is None:
        return functools.partial(kernel, borrows=borrows, tuned=tuned, file=file, **options)
    if BORROWS:
        options["_nrt"] = not borrows
    # What is not set here numba takes from whichever kernel happens to call this one first in a process.
    # No C function of it is asked for, and to make one takes a fifteenth of the time.
    options = {"error_model": "numpy", "fastmath": False, "no_cfunc_wrapper": True} | options
    file = pathlib.Path(file or function.__code__.co_filename).resolve()
    called = numba.njit(**({"pipeline_class": Whole} if WHOLE else {}), **options)(function)
    if WHOLE:
        # What other kernels call is a function of its own: nothing of it is loaded, or kept on disk.
        options |= {"no_cpython_wrapper": True} | ({"pipeline_class": Tuned} if tuned else {})
        part = functools.cache(lambda: numba.njit(**options)(function))
        called.get_call_template = lambda *types: part().get_call_template(*types)
        called.get_overload = lambda signature: part().get_overload(signature)
    called.compile = _in_turn(called, cache_folder(file))
    return called


def _kept(function, folder):
    """Return the disk cache of a function in a folder."""
    previous, numba.config.CACHE_DIR = numba.config.CACHE_DIR, str(folder)
    try:
        return Kept(function)
    finally:
        numba.config.CACHE_DIR = previous


def _in_turn(called, folder):
    """Let one process at a time compile a kernel or load it, so that the second finds what the first has made.

    Numba's cache does not survive two processes that write to it at once (its issue 4807).
    """
    compile_for, function = called.compile, called.py_func
    lock = folder / f"{function.__qualname__}.lock"

    def compile_in_turn(signature):
        with contextlib.ExitStack() as stack:
            # Where the folder cannot be written to, nothing is kept there, and there is nothing to guard.
            with contextlib.suppress(OSError):
                lock.parent.mkdir(parents=True, exist_ok=True)
                file = stack.enter_context(lock.open("a"))
                if fcntl:
                    fcntl.flock(file, fcntl.LOCK_EX)
            if not isinstance(called._cache, Kept):
                called._cache = _kept(function, folder)
            # The collector goes through all that the compiler holds, again and again, and finds little.
            if gc.isenabled():
                stack.callback(gc.enable)
                gc.disable()
            return compile_for(signature)

    return compile_in_turn
