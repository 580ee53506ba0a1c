"""Readers of recorded motions: a module for each family of files, chosen by what a file says and not by its name."""

import codecs
import dataclasses
import gzip
import pathlib
import re
import zlib
from typing import Any, NamedTuple

from fpk_rocking.physics.forcing.readers import (
    asa,
    columns,
    cosmos,
    dyna,
    geonet,
    knet,
    peer,
    shake,
    smc,
    terms,
    traces,
    volumes,
)
from fpk_rocking.physics.forcing.readers.components import ACCEPTED, MOST, Component, ReadingError, chosen

FAMILIES: list[Any] = [peer, knet, dyna, cosmos, geonet, smc, volumes, asa, shake, columns]
"""Modules with NAME, ``recognized(lines)`` and ``components(lines)``; the first that recognizes a file reads it."""

VERTICAL = "vertical component"
"""What the name of a file may say of a motion, see `said_by_name`."""

_LARGEST = 64 * MOST


class Reading(NamedTuple):
    """What a file has: the name of its format, its components, and whether its name may say more than its content."""

    path: pathlib.Path
    format: str
    components: list[Component]
    unnamed: bool = False

    def chosen(
        self, component: str | int | None = None, *, if_several: bool = False, upright: bool = False
    ) -> Component:
        """Return the `Component` that has a name or a number from 1, or the only one; else ValueError.

        With `if_several` the name counts only where more than one can be read. It is a horizontal one, `upright` the
        vertical one.
        """
        try:
            said = said_by_name(self)
            if said and not (upright and said == VERTICAL):
                raise ReadingError(f"a {said}, as the name of the file says", ACCEPTED)
            found = self.components
            if upright:
                found = [dataclasses.replace(one, upright=True) for one in found]
            return chosen(found, component, if_several=if_several)
        except ReadingError as error:
            raise ValueError(f"forcing.file: {str(self.path)!r}: {error}") from error


def reading(path: pathlib.Path) -> Reading:
    """Return the named tuple `Reading` of a file; what is refused is an OSError or a ValueError that says why."""
    try:
        text = _text(_data(path))
        lines = [] if text is None else text.splitlines()
        family = next(family for family in FAMILIES if family.recognized(lines))
        try:
            if text is None:
                raise ReadingError("binary data", f"a text file, or what ObsPy reads{traces.EXTRA}")
            return Reading(path, family.NAME, family.components(lines), family is columns)
        except ReadingError:
            # ObsPy has formats of text too.
            found = traces.components(path) if family is columns else None
            if found is None:
                raise
            return Reading(path, *found, True)
    except FileNotFoundError:
        raise FileNotFoundError(f"forcing.file: no file {str(path)!r}") from None
    except (OSError, EOFError, zlib.error) as error:
        raise OSError(f"forcing.file: {str(path)!r} cannot be read ({error})") from None
    except ReadingError as error:
        raise ValueError(f"forcing.file: {str(path)!r}: {error}") from None


def _data(path):
    """Bytes of a file, unpacked; OSError or `ReadingError` if it is none, empty, or too large for a record."""
    size = path.stat().st_size
    # A device or a pipe may never end.
    if not path.is_file():
        raise OSError("it is no file")
    data = b"" if size > _LARGEST else path.read_bytes()
    if data[:2] == b"\x1f\x8b":
        with gzip.open(path) as file:
            data = file.read(_LARGEST + 1)
        size = len(data)
    if size > _LARGEST:
        raise ReadingError(f"{size} bytes", f"at most {_LARGEST} bytes, and {MOST} samples")
    if not data.strip():
        raise ReadingError("an empty file", "a record")
    return data


def _text(data):
    """The text in bytes; None for binary data."""
    marks = {codecs.BOM_UTF8: "utf-8", codecs.BOM_UTF16_LE: "utf-16-le", codecs.BOM_UTF16_BE: "utf-16-be"}
    mark = next(filter(data.startswith, marks), b"")
    # In UTF-16 every other byte of plain text is 0.
    zeros = [data[first::2].count(0) > 0.45 * len(data) for first in (0, 1)]
    code = marks.get(mark, "utf-16-be" if zeros[0] else "utf-16-le" if zeros[1] else "utf-8")
    data = data.removeprefix(mark)
    try:
        text = data.decode(code)
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    return None if "\0" in text else text


def said_by_name(found: Reading) -> str:
    """What a file's name says that a record may not be: "velocity", "vertical component", ...; "" for nothing."""
    path = found.path.with_suffix("") if found.path.suffix.lower() == ".gz" else found.path
    stem, suffix = path.stem, path.suffix.lower().lstrip(".")
    kind = re.fullmatch(r"(vt2|vel)|(dt2|disp?)", suffix)
    if kind:
        return "velocity" if kind[1] else "displacement"
    if not found.unnamed:
        return ""
    # Words end at capitals too: velocityHistory.
    words = re.split(r"[^A-Za-z0-9]+", re.sub(r"(?<=[a-z])(?=[A-Z])", " ", stem))
    said = [terms.quantity_of(word) for word in words if len(word) > 2]
    # Motions that match a spectrum are motions.
    fits = re.search("match|compat|target", stem, re.IGNORECASE)
    said = [quantity for quantity in said if quantity and not (fits and "spectr" in quantity)]
    said += ["seismometer's velocity"] * any(map(terms.SEISMOMETER.fullmatch, words))
    if said and "acceleration" not in said:
        return said[0]
    last = words[-1].upper()
    ends = re.fullmatch(r"ud\d?|z", suffix) or (len(words) > 1 and re.fullmatch(r"UP|UD\d?|[UZV]|VERT\w*|DW?N", last))
    vertical = ends or any(re.fullmatch(r"[A-Z][NLG]Z", word) for word in words)
    return VERTICAL if vertical and len(found.components) == 1 else ""
