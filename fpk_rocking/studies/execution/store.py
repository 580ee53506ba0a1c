"""The file of a sweep: its rows as they come, so that a sweep that is stopped goes on from there.

A text file of one JSON object a line. The first says what sweep it is; each of the others is a row. A row is appended
in one piece; what a kill leaves of the last line is no row and is overwritten.
"""

import contextlib
import json

from fpk_rocking.base import checks
from fpk_rocking.results.storage import write_text

_FORMAT = 1
_ROW = {"cell": int, "seed": int, "digest": str, "wall_s": float, "values": dict, "reason": str}


class Store:
    """Rows kept in a file, or in memory alone.

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
        The file is no store, is damaged, or belongs to another sweep or to other scenes; it is left as it is.
    """

    def __init__(self, path, about, cells):
        self.path, self.rows = None if path is None else checks.path("store", path), {}
        if self.path is None:
            return
        if self.path.exists() and not self.path.is_file():
            raise ValueError(checks.refusal("store", str(self.path), "a file, made where it is missing"))
        header = _text({"format": _FORMAT} | about)
        if not self.path.exists():
            write_text(self.path, header)
        self._whole = self._read(json.loads(header), {cell.number: cell.digest for cell in cells})

    @contextlib.contextmanager
    def appending(self):
        """Yield a function that takes a row; the file is open within the block."""
        if self.path is None:
            yield self._take
            return
        with self.path.open("r+b") as file:
            file.truncate(self._whole)
            file.seek(self._whole)

            def add(row):
                self._take(row)
                file.write(_text(row).encode())
                file.flush()

            yield add

    def _take(self, row):
        self.rows[row["cell"]] = row

    def _read(self, wanted, digests):
        """Take the rows of the file; return the bytes up to the end of its last whole line."""
        *lines, rest = self.path.read_bytes().split(b"\n")
        whole = self.path.stat().st_size - len(rest)
        header = self._entry(lines[0] if lines else b"", 1)
        for name in wanted | header:
            if header.get(name) != wanted.get(name):
                raise self._of_another(f"{name} = {header.get(name)!r}", f"{name} = {wanted.get(name)!r}")
        for number, line in enumerate(lines[1:], 2):
            row = self._entry(line, number)
            if row.keys() != _ROW.keys() or not all(isinstance(row[name], cls) for name, cls in _ROW.items()):
                raise self._damaged(number)
            if digests.get(row["cell"]) != row["digest"]:
                raise self._of_another(f"another cell {row['cell']}", "the same scenes, in this order, and seed")
            self._take(row)
        return whole

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
