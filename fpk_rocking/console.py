"""The process of the command line: signals, warnings, output folders, and output that cannot be written."""

import _thread
import contextlib
import os
import queue
import signal
import sys
import threading
import warnings

_AGAIN_S = 0.02
"""Seconds after which a signal that was swallowed is raised anew."""


class Terminated(KeyboardInterrupt):
    """SIGTERM: whatever tidies up after an interruption from the keyboard does so here too."""


class Interrupted(KeyboardInterrupt):
    """SIGINT, by a name of its own.

    Once a plain KeyboardInterrupt has left code that `exec` or `eval` was given as text, ``python -m`` ends by the
    signal itself and not with the exit status that it was told, caught or not. Libraries run such code while they are
    imported, and numba while it compiles.
    """


@contextlib.contextmanager
def terminable():
    """Raise `Terminated` at SIGTERM and `Interrupted` at SIGINT within the block.

    Only the main thread can, in another one nothing changes; nor does it for SIGINT where it is ignored, or somebody
    else's.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(number, _):
        """Raise the exception that stands for the signal of a number, `Terminated` or `Interrupted`."""
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
def insistent():
    """Raise again an interruption that C code swallowed in the block, at its end or before; in the main thread only.

    The exception of a signal cannot pass a callback from C or a finalizer: Python prints it there and goes on. A signal
    that comes while LLVM makes machine code ends like that, for the first Python code to run afterwards, where it is
    handled, is a callback. numba then goes on, or fails for want of what the callback should have kept. Here nothing is
    printed, the exception comes once more a moment later, and it stands for any error that came in between.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    previous, swallowed = sys.unraisablehook, []
    numbers, ended = queue.SimpleQueue(), threading.Event()

    def again(ignored):
        """Have the signal of an ignored interruption raised anew; other exceptions go to the previous hook.

        `ignored`: what `sys.unraisablehook` takes.
        """
        if not issubclass(ignored.exc_type, KeyboardInterrupt):
            previous(ignored)
            return
        number = signal.SIGTERM if issubclass(ignored.exc_type, Terminated) else signal.SIGINT
        swallowed.append(ignored.exc_type)
        # Nothing is waited for: what an earlier one raises anew would come in here, where it is printed and lost.
        numbers.put(number)

    def watch():
        """Raise the signals of the queue anew in the main thread, each a moment later, until the block has ended."""
        while (number := numbers.get()) and not ended.wait(_AGAIN_S):
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
    """Show a warning within the block as one line, as an error is shown; `command` is that of the command line."""

    def show(message, *_):
        """Write a warning's message as one line to standard error."""
        sys.stderr.write(f"fpk-rocking {command}: warning: {line(message)}\n")

    with warnings.catch_warnings():
        warnings.showwarning = show
        yield


def line(message):
    """Return a message, a text or an exception or warning, on one line of text."""
    return " ".join(str(message).split())


def what_is_left(begun, folder, state):
    """Return what an interrupted command leaves behind, as a text without a full stop.

    Parameters
    ----------
    begun : float
        Time at which it began, as of `time.time`.
    folder : pathlib.Path or None
        For its files.
    state : pathlib.Path or None
        File from which it can go on.
    """
    files = folder.iterdir() if folder and folder.is_dir() else ()
    written = sorted(file.name for file in files if file.is_file() and file.stat().st_mtime >= begun)
    texts = [f"whole files in {folder}: {', '.join(written)}"] if written else []
    texts += [f"the same command goes on from {state}"] if state and state.is_file() else []
    return "; ".join(texts) or "no result was written"


def check_folder(name, folder):
    """Raise ValueError for a folder that cannot be made or written to, before the work that would be lost.

    Nothing is made yet.

    Parameters
    ----------
    name : str
        Of the parameter, for the message.
    folder : pathlib.Path

    Raises
    ------
    ValueError
        A file is in the way, or the permissions or the file system do not allow writing.
    """
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
