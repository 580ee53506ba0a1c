"""The disk cache of compiled kernels: kept between runs, and never older than the text that it was made from."""

import os
import pathlib
import shutil
import subprocess
import sys

import pytest

import fpk_rocking
from fpk_rocking.base import jit

PROBE = """
from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion.equation import KernelBlock
from fpk_rocking.physics.motion.impact import chatter_time

@kernel
def probe(speed):
    return chatter_time(speed, 1, 0.0, KernelBlock(0.0, 1.5, None, None))
"""

RUN = """
from fpk_rocking.physics.probe import probe
print(probe(0.25), *(sum(made.stats.cache_hits.values()) for made in probe.for_types.values()))
"""


@pytest.fixture
def package(tmp_path):
    """Copy the package and add a kernel that calls one in another file."""
    source = pathlib.Path(fpk_rocking.__file__).parent
    copy = shutil.copytree(source, tmp_path / "fpk_rocking", ignore=shutil.ignore_patterns("__pycache__"))
    (copy / "physics" / "probe.py").write_text(PROBE)
    return copy


def run(package, first="", /, **environment):
    """Value of the probe in a fresh process, and how many kernels' machine code came from the disk."""
    kept = {name: value for name, value in os.environ.items() if name not in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME")}
    command = [sys.executable, "-c", first + RUN]
    where = {"cwd": package.parent, "env": kept | environment}
    answer = subprocess.run(command, **where, check=True, capture_output=True, text=True, timeout=120)
    value, hits = answer.stdout.split()
    return float(value), int(hits)


def test_an_edited_kernel_is_compiled_anew_also_where_another_file_calls_it(package, tmp_path):
    cache = tmp_path / "chosen"
    assert run(package, NUMBA_CACHE_DIR=str(cache)) == (0.5, 0)
    assert run(package, NUMBA_CACHE_DIR=str(cache)) == (0.5, 1)
    before = set(cache.iterdir())
    files = package / "results" / "storage.py"
    files.write_text(files.read_text() + "\n")
    assert run(package, NUMBA_CACHE_DIR=str(cache)) == (0.5, 1)
    assert set(cache.iterdir()) == before
    contact = package / "physics" / "motion" / "impact.py"
    contact.write_text(contact.read_text().replace("return 2.0 * speed *", "return 6.0 * speed *"))
    assert run(package, NUMBA_CACHE_DIR=str(cache)) == (1.5, 0)
    # That of the file that imports the edited one: what other kernels call is not kept by itself.
    assert len(list(cache.iterdir())) == len(before) + 1
    assert len({path.relative_to(cache).parts[0] for path in cache.rglob("*.nbc")}) == 2


def test_the_cache_is_in_the_users_cache_folder_unless_chosen(package, tmp_path):
    assert run(package, XDG_CACHE_HOME=str(tmp_path / "user")) == (0.5, 0)
    assert list((tmp_path / "user" / "fpk-rocking").iterdir())
    assert not list(package.rglob("*.nbc"))


def test_damaged_machine_code_is_compiled_anew(package, tmp_path):
    """Once: what was damaged is kept again, whole."""
    cache = tmp_path / "chosen"
    run(package, NUMBA_CACHE_DIR=str(cache))
    for kept, part in [("*.nbi", 0.0), ("*.nbi", 0.5), ("*.nbc", 0.0), ("*.nbc", 0.95)]:
        for path in cache.rglob(kept):
            path.write_bytes(path.read_bytes()[: int(part * path.stat().st_size)])
        assert run(package, NUMBA_CACHE_DIR=str(cache)) == (0.5, 0), (kept, part)
    assert run(package, NUMBA_CACHE_DIR=str(cache)) == (0.5, 1)


READ_ONLY = """
import errno, pathlib, tempfile
opened, temporary = pathlib.Path.open, tempfile.TemporaryFile

def refuse(path, *arguments, **named):
    if str(path).startswith({cache!r}) and (arguments or ("r",))[0] != "r":
        raise PermissionError(errno.EACCES, "read-only", str(path))
    return opened(path, *arguments, **named)

def refuse_temporary(*arguments, dir=None, **named):
    if str(dir).startswith({cache!r}):
        raise PermissionError(errno.EACCES, "read-only", str(dir))
    return temporary(*arguments, dir=dir, **named)

pathlib.Path.open, tempfile.TemporaryFile = refuse, refuse_temporary
"""


def test_a_warmed_cache_that_cannot_be_written_to_is_used(package, tmp_path):
    cache = tmp_path / "chosen"
    run(package, NUMBA_CACHE_DIR=str(cache))
    before = sorted(cache.rglob("*"))
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    first = READ_ONLY.format(cache=str(cache))
    assert run(package, first, NUMBA_CACHE_DIR=str(cache), TMPDIR=str(temporary)) == (0.5, 1)
    assert sorted(cache.rglob("*")) == before
    assert not list(temporary.iterdir())  # a copy ends with the process


def test_without_a_home_and_a_name_a_user_gets_answers(package, tmp_path):
    first = """
import pathlib

def home():
    raise RuntimeError("Could not determine home directory.")

pathlib.Path.home = home
from fpk_rocking.base import precompilation
precompilation.start_helpers(precompilation.Compilation("fpk_rocking.physics.probe:probe", 1))
precompilation.mark_announced()
"""
    assert run(package, first) == (0.5, 0)
    assert run(package, first, NUMBA_CACHE_DIR=str(tmp_path / "chosen")) == (0.5, 0)
    assert run(package, first, NUMBA_CACHE_DIR=str(tmp_path / "chosen")) == (0.5, 1)


@pytest.mark.skipif(jit.fcntl is None, reason="no locks on this system")
def test_where_there_are_no_locks_machine_code_is_kept_without(package, tmp_path):
    first = """
import errno, fcntl

def flock(file, operation):
    raise OSError(errno.ENOLCK, "No locks available")

fcntl.flock = flock
"""
    assert run(package, first, NUMBA_CACHE_DIR=str(tmp_path / "chosen")) == (0.5, 0)
    assert run(package, first, NUMBA_CACHE_DIR=str(tmp_path / "chosen")) == (0.5, 1)


def test_places_that_the_user_names_for_numba_are_not_taken(package, tmp_path):
    """Beside a source file numba keeps machine code that is stale once an imported file has changed."""
    named = {"NUMBA_CACHE_DIR": str(tmp_path / "chosen"), "NUMBA_CACHE_LOCATOR_CLASSES": "InTreeCacheLocator"}
    assert run(package, **named) == (0.5, 0)
    contact = package / "physics" / "motion" / "impact.py"
    contact.write_text(contact.read_text().replace("return 2.0 * speed *", "return 6.0 * speed *"))
    assert run(package, **named) == (1.5, 0)
    assert not list(package.rglob("*.nbi"))


def test_each_version_of_numba_keeps_its_own_machine_code(package, tmp_path):
    """Else one discards what another one has kept, and what is marked as compiled is compiled without a word."""
    other = 'import numba\nnumba.__version__ = "0.0.1"\n'
    folder = {"NUMBA_CACHE_DIR": str(tmp_path / "chosen")}
    assert [run(package, first, **folder) for first in ("", other, "", other)] == [
        (0.5, 0),
        (0.5, 0),
        (0.5, 1),
        (0.5, 1),
    ]


BORROWED = """
import numpy as np

from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion import TERMS
from fpk_rocking.physics.motion.equation import Segment, force_from_particular

@kernel
def make(particular, force, duration):
    return Segment(particular, force, *force_from_particular(particular, duration, force))

@kernel
def borrower(particular, force):
    return make(particular, force, 0.1).force_low

@kernel
def owner(forced, low, force):
    for i in range(low.size):
        low[i] = make(forced[i], force, 0.1).force_low

forced, force, low = np.ones((50, TERMS)), np.zeros(TERMS), np.zeros(50)
borrower(forced[0], force)
for _ in range(30):
    owner(forced, low, force)
del force
print(round(low[0], 3))
"""


def test_a_kernel_does_not_depend_on_which_kernel_called_it_first(tmp_path):
    """Numba hands options on to what a kernel calls: arrays that `make` hands on without counting were freed twice."""
    (tmp_path / "borrowed.py").write_text(BORROWED, encoding="utf-8")
    environment = os.environ | {
        "NUMBA_CACHE_DIR": str(tmp_path),
        "PYTHONPATH": str(pathlib.Path(jit.__file__).parents[2]),
    }
    run = subprocess.run(
        [sys.executable, tmp_path / "borrowed.py"], env=environment, capture_output=True, text=True, check=False
    )
    assert (run.returncode, run.stdout) == (0, "0.368\n"), run.stderr


def test_a_thread_gets_enough_work_to_be_worth_its_start(monkeypatch):
    monkeypatch.setattr(jit, "thread_count", lambda: 4)
    parts = []

    def ranges(count, **seconds):
        parts.clear()
        jit.run_in_parts(lambda begin, end, word: parts.append((begin, end, word)), count, "same", **seconds)
        return sorted(parts)

    assert ranges(8) == [(0, 2, "same"), (2, 4, "same"), (4, 6, "same"), (6, 8, "same")]
    assert ranges(8, seconds=2.5 * jit.LEAST_SECONDS) == [(0, 4, "same"), (4, 8, "same")]
    assert ranges(8, seconds=0.0) == [(0, 8, "same")]
    assert ranges(3) == [(0, 1, "same"), (1, 2, "same"), (2, 3, "same")]
