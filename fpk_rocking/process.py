"""What the command line does about the process that it is: signals, warnings, folders, and output that nobody takes."""

import contextlib
import os
import signal
import sys
import threading
import warnings


class Terminated(KeyboardInterrupt):
    """SIGTERM: whatever tidies up after an interruption from the keyboard does so here too."""


@contextlib.contextmanager
def terminable():
    """Raise `Terminated` at SIGTERM within the block; only the main thread can, in another one nothing changes."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def terminate(*_):
        raise Terminated

    previous = signal.signal(signal.SIGTERM, terminate)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, previous or signal.SIG_DFL)


@contextlib.contextmanager
def plain_warnings(command):
    """Show a warning within the block as one line, as an error is shown."""

    def show(message, *_):
        sys.stderr.write(f"fpk-rocking {command}: warning: {line(message)}\n")

    with warnings.catch_warnings():
        warnings.showwarning = show
        yield


def line(message):
    """Return a message on one line."""
    return " ".join(str(message).split())


def check_folder(name, folder):
    """Refuse a folder that cannot be made or written to, before the work that would be lost; make nothing yet.

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
        raise ValueError(f"{name}: got the file {str(existing)!r}, accepted: a folder, made where missing")
    if not os.access(existing, os.W_OK | os.X_OK):
        raise ValueError(f"{name}: got {str(folder)!r}, accepted: a folder that can be written to")


def drop_unwritten():
    """Let go of what standard output could not take; else Python would fail on it again at exit."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
