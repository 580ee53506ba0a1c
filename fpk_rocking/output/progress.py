"""Progress of long work on standard error: a bar in a terminal, now and then a line elsewhere."""

import contextlib
import sys
import time
from collections.abc import Iterator

from fpk_rocking.base import types

__all__ = ["reporting"]

_SECONDS_BETWEEN_LINES = 10.0


@contextlib.contextmanager
def reporting(label: str) -> Iterator[types.Progress]:
    """Show the progress of one piece of work on standard error: ``with reporting("density") as progress: ...``.

    Parameters
    ----------
    label : str
        Name of the work.

    Yields
    ------
    callable
        Takes ``(done, total)``: the `progress` that engines accept.

    Examples
    --------
    >>> from fpk_rocking import load_scene
    >>> from fpk_rocking.output.progress import reporting
    >>> from montecarlo import simulate
    >>> with reporting("paths") as progress:
    ...     ensemble = simulate(load_scene("main"), cycles=4, realizations=1000, progress=progress)
    """
    if sys.stderr.isatty():
        with _bar(label) as report:
            yield report
    else:
        yield _lines(label)


@contextlib.contextmanager
def _bar(label):
    """Yield a `progress` function (done, total) that draws a bar on the terminal, with a label (text) in front."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn(), TextColumn("left"))
    columns = (*columns, TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True)) as progress:
        task = progress.add_task(label, total=None)
        yield lambda done, total: progress.update(task, completed=done, total=total)


def _lines(label):
    """Return a `progress` function (done, total) that prints a line from time to time, with a label (text) in front."""
    started = last = time.monotonic()
    first = None  # time and work done at the first report: work may go on from a file

    def report(done, total):
        """Print a line if the last one is some time ago; `done` and `total` count the parts of the work."""
        nonlocal last, first
        now = time.monotonic()
        first = first or (now, done)
        if now - last >= _SECONDS_BETWEEN_LINES and done < total:
            last = now
            text = f"{label}: {100.0 * done / total:.0f} % after {now - started:.0f} s"
            if done > first[1]:
                text += f", about {(now - first[0]) * (total - done) / (done - first[1]):.0f} s left"
            sys.stderr.write(text + "\n")

    return report
