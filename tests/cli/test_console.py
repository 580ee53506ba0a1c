"""The process of a command: signals, also those that C code swallows, warnings, and what an interruption leaves."""

import ctypes
import os
import signal
import sys
import time
import warnings

import fakes
import pytest

from fpk_rocking import console, load_scene
from fpk_rocking.output import vtk

KINDS = {signal.SIGINT: console.Interrupted, signal.SIGTERM: console.Terminated}


@ctypes.CFUNCTYPE(None, ctypes.c_int)
def swallowing(sign):
    """A callback from C, as LLVM calls one when a kernel is compiled: no exception passes it."""
    signal.raise_signal(sign)


def swallow(*signs, then=None, again_s=60.0):
    """Swallow signals in a block of a command, which then raises, or computes for ten seconds."""
    with console.terminable(), console.insistent(again_s):
        for sign in signs:
            swallowing(sign)
        end = time.monotonic() + 10.0
        while then == "computes" and time.monotonic() < end:
            pass
        if then == "fails":
            raise RuntimeError


@pytest.mark.usefixtures("interruptible")
@pytest.mark.parametrize("sign", KINDS)
@pytest.mark.parametrize("times", [1, 2])
@pytest.mark.parametrize(("then", "cause"), [("ends", type(None)), ("fails", RuntimeError)])
def test_a_swallowed_signal_is_raised_at_the_end_of_the_block(sign, times, then, cause):
    """In place of an error that came of it."""
    hook = sys.unraisablehook
    with pytest.raises(KINDS[sign]) as result:
        swallow(*[sign] * times, then=then)
    assert isinstance(result.value.__cause__, cause)
    assert sys.unraisablehook is hook


@pytest.mark.usefixtures("interruptible")
@pytest.mark.parametrize("sign", KINDS)
def test_a_swallowed_signal_comes_again_while_the_block_lasts(sign):
    """Twice in callbacks, and then in code that computes."""
    began = time.monotonic()
    with pytest.raises(KINDS[sign]):
        swallow(sign, sign, then="computes", again_s=0.02)
    assert time.monotonic() < began + 9.0


@pytest.mark.usefixtures("interruptible")
def test_the_last_of_several_signals_counts():
    with pytest.raises(console.Terminated):
        swallow(signal.SIGINT, signal.SIGTERM)


@pytest.mark.usefixtures("interruptible")
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_other_exceptions_that_nobody_takes_are_shown_as_before():
    """In a callback as anywhere; and afterwards everything is as it was."""

    @ctypes.CFUNCTYPE(None)
    def failing():
        raise ValueError("said")

    shown, handlers = [], [signal.getsignal(sign) for sign in KINDS]
    hook, sys.unraisablehook = sys.unraisablehook, shown.append
    try:
        own = sys.unraisablehook
        with console.terminable(), console.insistent():
            failing()
        assert sys.unraisablehook is own
    finally:
        sys.unraisablehook = hook
    assert [type(problem.exc_value) for problem in shown] == [ValueError]
    assert [signal.getsignal(sign) for sign in KINDS] == handlers
    with pytest.raises(ZeroDivisionError), console.insistent():
        raise ZeroDivisionError


def test_a_warning_is_one_line(capsys):
    with console.plain_warnings("fpk"):
        warnings.warn("not within\nthe tolerance", RuntimeWarning, stacklevel=1)
    assert capsys.readouterr().err == "fpk-rocking fpk: warning: not within the tolerance\n"


def test_interrupted_writing_leaves_whole_files(tmp_path):
    class Interrupted(fakes.FakeEvolution):
        def at(self, cycle):
            if cycle == 2:
                raise KeyboardInterrupt
            return super().at(cycle)

    begun = time.time()
    (tmp_path / "older").touch()
    os.utime(tmp_path / "older", (1.0, 1.0))
    with pytest.raises(KeyboardInterrupt):
        vtk.write_series(tmp_path, "jpdf", Interrupted(load_scene("main"), cycles=4), [0, 1, 2, 4])
    left = console.what_is_left(begun - 1.0, tmp_path, None)
    assert left == f"complete files in {tmp_path}: jpdf_0000.vtu, jpdf_0001.vtu"
    assert console.what_is_left(begun + 1000.0, tmp_path, None) == "no result was written"
    state = tmp_path / "older"
    assert console.what_is_left(begun + 1000.0, tmp_path, state) == f"the same command goes on from {state}"
