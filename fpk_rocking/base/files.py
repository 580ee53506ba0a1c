"""Files that are written whole or not at all, and values as JSON and CSV hold them."""

import contextlib
import csv
import io
import json
import math
import os
import pathlib
import secrets
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import File


@contextlib.contextmanager
def replaced_atomically(path: File) -> Iterator[pathlib.Path]:
    """Give a temporary path to write to; it takes the place of `path` when the block ends without an exception.

    Parameters
    ----------
    path : str or pathlib.Path
        The file to write; its folder is made where missing.

    Yields
    ------
    pathlib.Path
        A new name in the same folder with the same suffix. Whatever is there is removed on any exception, an
        interruption included, and `path` is then as it was.
    """
    file_path = checks.path("path", path)
    file_path.parent.mkdir(parents=True, exist_ok=True)
    temporary = file_path.with_name(f".{file_path.stem}-{secrets.token_hex(6)}{file_path.suffix}")
    try:
        yield temporary
        # On the disk before it has the name: a machine that stops must not leave an empty file in an old one's place.
        with temporary.open("rb") as file:
            os.fsync(file.fileno())
        temporary.replace(file_path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def write_text(path: File, text: str) -> None:
    """Write a text file in UTF-8, complete or not at all; `path` is its path."""
    with replaced_atomically(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")


def write_csv(path: File, names: Iterable[str], rows: Iterable[Iterable[Any]]) -> None:
    """Write a table as a CSV file in UTF-8 at a path, complete or not at all.

    `names` are those of the columns, and `rows` sequences of as many values.
    """
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([names, *rows])
    write_text(path, text.getvalue())


def write_json(path: File, values: Any) -> None:
    """Write values as a JSON file, complete or not at all; ValueError for nan, which JSON has not.

    `values` are such as `plain` returns.
    """
    write_text(path, json.dumps(values, indent=1, allow_nan=False, ensure_ascii=False) + "\n")


def plain(value: Any) -> Any:
    """Return a value, at any depth, as JSON holds it: dicts of text, lists, Python's numbers, and None in place of nan.

    Lists stand in place of arrays and tuples, and Python's numbers in place of numpy's.
    """
    if isinstance(value, dict):
        return {name: plain(entry) for name, entry in value.items()}
    if isinstance(value, list | tuple):
        return [plain(entry) for entry in value]
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    return None if isinstance(value, float) and not math.isfinite(value) else value
