"""The process of the command line: signals, warnings, output folders, and output that cannot be written."""

import _thread
import contextlib
import os
import queue
import signal
import sys
import threading
import warnings


class Terminated(KeyboardInterrupt):
    """SIGTERM, which is tidied up after as after an interruption from the keyboard."""


class Interrupted(KeyboardInterrupt):
    """SIGINT, by a name of its own.

    Once a plain KeyboardInterrupt has left code that `exec` or `eval` was given as text, ``python -m`` ends by the
    signal itself and not with the exit status that it was told, caught or not. Libraries run such code while they are
    imported, and numba while it compiles.
    """


@contextlib.contextmanager
def terminable():
    """Raise `Terminated` at SIGTERM and `Interrupted` at SIGINT within the block, in the main thread.

    Where SIGINT is ignored, or handled by others, it stays so.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(number, _):
        raise Terminated if number == signal.SIGTERM else Interrupted

    numbers = [signal.SIGTERM]
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        numbers.append(signal.SIGINT)
    previous = {number: signal.signal(number, stop) for number in numbers}
    try:
        yield
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler or signal.SIG_DFL)


@contextlib.contextmanager
def insistent(again_s=0.02):
    """Raise again an interruption that C code swallowed in the block, some seconds later or at its end.

    The exception of a signal cannot pass a callback from C or a finalizer: Python prints it there and goes on. A signal
    that comes while LLVM makes machine code ends like that, for the first Python code to run afterwards, where it is
    handled, is a callback. numba then goes on, or fails for want of what the callback should have kept. Here nothing is
    printed, and the exception stands for any error that came in between. Only the main thread can.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    previous, swallowed = sys.unraisablehook, []
    numbers, ended = queue.SimpleQueue(), threading.Event()

    def again(ignored):
        if not issubclass(ignored.exc_type, KeyboardInterrupt):
            previous(ignored)
            return
        number = signal.SIGTERM if issubclass(ignored.exc_type, Terminated) else signal.SIGINT
        swallowed.append(ignored.exc_type)
        # Nothing is waited for: what an earlier one raises anew would come in here, where it is printed and lost.
        numbers.put(number)

    def watch():
        while (number := numbers.get()) and not ended.wait(again_s):
            _thread.interrupt_main(number)

    sys.unraisablehook = again
    try:
        threading.Thread(target=watch).start()
        yield
        # The block may end before the signal has come again.
        if swallowed:
            raise swallowed[-1]
    except Exception as error:
        if swallowed:
            raise swallowed[-1] from error
        raise
    finally:
        sys.unraisablehook = previous
        ended.set()
        numbers.put(None)


@contextlib.contextmanager
def plain_warnings(command):
    """Show a warning within the block as one line, as an error of a command is shown."""

    def show(message, *_):
        sys.stderr.write(f"fpk-rocking {command}: warning: {line(message)}\n")

    with warnings.catch_warnings():
        warnings.showwarning = show
        yield


def line(message):
    """Return a text, or that of an exception or warning, on one line."""
    return " ".join(str(message).split())


def what_is_left(begun, folder, state):
    """Say what a command that began at a time leaves in a folder, and in a file from which it can go on."""
    files = folder.iterdir() if folder and folder.is_dir() else ()
    written = sorted(file.name for file in files if file.is_file() and file.stat().st_mtime >= begun)
    texts = [f"complete files in {folder}: {', '.join(written)}"] if written else []
    texts += [f"the same command goes on from {state}"] if state and state.is_file() else []
    return "; ".join(texts) or "no result was written"


def check_folder(name, folder):
    """Refuse a folder that cannot be made or written to, before the work that would be lost; nothing is made yet."""
    existing = next(place for place in (folder, *folder.absolute().parents) if place.exists())
    if not existing.is_dir():
        raise ValueError(f"{name}: got the file {str(existing)!r}, accepted: a folder; a missing one is created")
    if not os.access(existing, os.W_OK | os.X_OK):
        raise ValueError(f"{name}: got {str(folder)!r}, accepted: a folder that can be written to")


def drop_unwritten():
    """Let go of what standard output could not take; else Python would fail on it again at exit."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
