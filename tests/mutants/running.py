"""Tests in forks of a process that has loaded what the packages stand on, but nothing of the packages themselves."""

import contextlib
import importlib
import json
import os
import pathlib
import resource
import shutil
import signal
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
PLACE = ROOT / "build" / "mutants"
TREE = PLACE / "tree"
PACKAGES = "fpk_rocking", "montecarlo"
_LOADED = "distributed hypothesis matplotlib.pyplot numba pandas pyvista scipy.integrate scipy.stats skfem xarray"
_MEMORY = 8 << 30


def prepare():
    """Copy the tree, so that it may be worked on meanwhile, and load what all tests need."""
    shutil.rmtree(TREE, ignore_errors=True)
    TREE.mkdir(parents=True)
    for entry in ROOT.iterdir():
        if entry.name[0] != "." and entry.name not in {"build", "dist", "results"}:
            # Times of files are kept, for numba's cache goes by them.
            (shutil.copytree if entry.is_dir() else shutil.copy2)(entry, TREE / entry.name)
    os.chdir(TREE)
    sys.path.insert(0, str(TREE))
    os.environ |= {"PYTHONPATH": f"{TREE}{os.pathsep}{pathlib.Path(__file__).parent}", "MPLBACKEND": "agg"}
    os.environ |= {"NUMBA_CACHE_DIR": str(PLACE / "cache"), "NUMBA_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    for name in _LOADED.split():
        with contextlib.suppress(ImportError):
            importlib.import_module(name)
    import numba

    numba.njit(lambda x: x)(1.0)  # the first kernel takes a second more than the others


def forked(work, todo, jobs):
    """Yield each thing to do with what `work` makes of it in a process of its own, None where that died."""
    running, todo = {}, list(todo)
    while running or todo:
        while todo and len(running) < jobs:
            task, out = todo.pop(0), tempfile.TemporaryFile("w+", encoding="utf-8")  # noqa: SIM115
            pid = os.fork()
            if not pid:
                os.setsid()
                with contextlib.suppress(BaseException):
                    json.dump(work(task), out)
                    out.flush()
                os._exit(0)
            running[pid] = task, out
        pid, _ = os.wait()
        with contextlib.suppress(ProcessLookupError):
            os.killpg(pid, signal.SIGKILL)  # what a test has started
        task, out = running.pop(pid)
        with out:
            out.seek(0)
            text = out.read()
        yield task, json.loads(text) if text else None


def run(files, plugin, *options):
    """Run test files here with a plugin, without a word; return the exit status."""
    import pytest

    silent = os.open(os.devnull, os.O_RDWR)
    for stream in range(3):
        os.dup2(silent, stream)
    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
    return int(pytest.main(["-q", "-p", "no:cacheprovider", *options, *files], plugins=[plugin]))
