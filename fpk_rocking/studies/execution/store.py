"""The file of a sweep: its rows as they come, so that a sweep that is stopped goes on from there.

A text file of one JSON object a line. The first says what sweep it is; each of the others is a row. A row is appended
in one piece; what a kill or a full disk leaves of the last line is no row and is overwritten. One sweep at a time has
the file: it is locked where the file system has locks, and the lock ends with the process.
"""

import contextlib
import io
import json
from typing import Any

from fpk_rocking.base import checks
from fpk_rocking.base.types import known

try:
    import fcntl
except ImportError:  # outside Unix
    fcntl = None  # type: ignore[assignment]  # None tells that there are no locks

_FORMAT = 1
_ROW = {"cell": int, "seed": int, "digest": str, "wall_s": float, "values": dict, "reason": str}


class Store:
    """Rows kept in a file, which is open and locked until `close`, or in memory alone.

    Parameters
    ----------
    path : path or None
        Made where missing, its folder too. None keeps nothing on the disk.
    about : dict
        What the sweep is, as plain values; a file that was begun with others is refused.
    cells : sequence of Cell
        Those of the sweep.

    Attributes
    ----------
    rows : dict of int to dict
        Rows by the number of their cell.

    Raises
    ------
    TypeError, ValueError
        The file is no store, is damaged, belongs to another sweep or to other scenes, or is that of a sweep that still
        runs; it is left as it is.
    """

    def __init__(self, path, about, cells):
        self.path = None if path is None else checks.path("store", path)
        self.rows: dict[int, dict[str, Any]] = {}
        self._file: io.FileIO | None = None
        if self.path is None:
            return
        if self.path.exists() and not self.path.is_file():
            raise ValueError(checks.refusal("store", str(self.path), "a file, made where it is missing"))
        header = _text({"format": _FORMAT} | about)
        self.path.parent.mkdir(parents=True, exist_ok=True)
        # Appending: two processes that both find no file must not make it anew over each other's. Without a buffer:
        # what a full disk does not take must not be tried again when the file is closed.
        self._file = self.path.open("a+b", buffering=0)
        try:
            self._claim()
            self._read(header, {cell.number: cell.digest for cell in cells})
        except BaseException:
            self.close()
            raise

    def add(self, row: dict[str, Any]) -> None:
        """Take a row, and append it to the file."""
        self.rows[row["cell"]] = row
        if self._file is not None:
            self._write(_text(row))

    def close(self) -> None:
        """Leave the file to others."""
        if self._file is None:
            return
        with self._file, contextlib.suppress(OSError):
            # Closing is not enough where a process that was forked meanwhile has the file open too.
            if fcntl is not None:
                fcntl.flock(self._file, fcntl.LOCK_UN)

    def _write(self, text):
        left, file = text.encode(), known(self._file)
        while left:
            left = left[file.write(left) :]

    def _claim(self):
        if fcntl is None:
            return
        try:
            fcntl.flock(known(self._file), fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            accepted = "a file that no sweep in progress writes to"
            raise ValueError(checks.refusal("store", str(self.path), accepted)) from None
        except OSError:
            pass  # a file system without locks

    def _read(self, wanted, digests):
        """Take the rows of the file, and end it after its last whole line; begin a new file with the header."""
        file = known(self._file)
        file.seek(0)
        content = file.read()
        if wanted.encode().startswith(content):
            file.truncate(0)
            self._write(wanted)
            return
        *lines, rest = content.split(b"\n")
        header, wanted = self._entry(lines[0] if lines else b"", 1), json.loads(wanted)
        for name in wanted | header:
            if header.get(name) != wanted.get(name):
                raise self._of_another(f"{name} = {header.get(name)!r}", f"{name} = {wanted.get(name)!r}")
        for number, line in enumerate(lines[1:], 2):
            row = self._entry(line, number)
            if row.keys() != _ROW.keys() or not all(isinstance(row[name], cls) for name, cls in _ROW.items()):
                raise self._damaged(number)
            if digests.get(row["cell"]) != row["digest"]:
                raise self._of_another(f"another cell {row['cell']}", "the same scenes, in this order, and seed")
            self.rows[row["cell"]] = row
        file.truncate(len(content) - len(rest))

    def _entry(self, line, number):
        try:
            entry = json.loads(line)
        except ValueError:
            raise self._damaged(number) from None
        if not isinstance(entry, dict):
            raise self._damaged(number)
        return entry

    def _of_another(self, found, wanted):
        return ValueError(
            f"store: got {self.path} with {found}, accepted: a new file, or that of a sweep with {wanted}"
        )

    def _damaged(self, number):
        return ValueError(
            f"store: {self.path} is damaged or not the file of a sweep (line {number}); accepted: a new file"
        )


def _text(entry):
    try:
        return json.dumps(entry, allow_nan=False, ensure_ascii=False) + "\n"
    except (TypeError, ValueError) as error:
        raise TypeError(
            f"options: {error}, accepted with a store: numbers, texts, None, lists and dicts of them"
        ) from None
