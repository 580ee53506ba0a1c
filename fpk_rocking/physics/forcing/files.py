"""Files that recorded motions come in: PEER's .AT2, ESM's .ASC, and text of two columns."""

import codecs
import math
import pathlib
import re
from typing import NamedTuple

import numpy as np

from fpk_rocking.base.types import Array

MOST = 2**20
"""Most samples: 87 minutes at 200 Hz."""

UNITS = {"g": 9.80665, "m/s2": 1.0, "cm/s2": 0.01}
"""Metres per second squared of a unit of acceleration."""

_SPELLINGS = {
    "g": "g",
    **dict.fromkeys(("m/s2", "m/s^2", "m/s**2", "m/s/s", "m/s²", "m/sec2", "m/sec^2", "m/sec/sec"), "m/s2"),
    **dict.fromkeys(
        ("cm/s2", "cm/s^2", "cm/s**2", "cm/s/s", "cm/s²", "cm/sec2", "cm/sec^2", "cm/sec/sec", "gal"), "cm/s2"
    ),
}
"""Units by the ways in which they are written, in lower case."""


class FileRecord(NamedTuple):
    """Contents of a file: the interval, seconds, the samples (n,), and their unit, empty where the file says none."""

    interval: float
    samples: Array
    units: str


def unit_of(text: str) -> str | None:
    """Return the unit in `UNITS` that a text means, or None."""
    return _SPELLINGS.get(text.strip().lower())


def read(path: pathlib.Path) -> FileRecord:
    """Read a record from a file, whose kind follows from its first lines and its name.

    Parameters
    ----------
    path : pathlib.Path

    Returns
    -------
    FileRecord

    Raises
    ------
    FileNotFoundError
        There is no such file.
    OSError, ValueError
        The file cannot be read, has another format, is truncated, or has values that are not finite or times that are
        not equally spaced; the message says what and where.
    """
    text = _text(path)
    kind = _peer if path.suffix.lower() == ".at2" else _esm if text.startswith("EVENT_NAME:") else _columns
    try:
        return kind(text)
    except ValueError as error:
        raise ValueError(f"forcing.file: {str(path)!r}: {error}") from None


def _text(path):
    """Read a text file of a size that a record can have."""
    try:
        size = path.stat().st_size
        # A device or a pipe may never end.
        if not path.is_file():
            raise OSError("it is no file")
        if size > 64 * MOST:
            accepted = f"at most {64 * MOST} bytes, and {MOST} samples"
            raise ValueError(f"forcing.file: {str(path)!r}: got {size} bytes, accepted: {accepted}")
        data = path.read_bytes()
    except FileNotFoundError:
        raise FileNotFoundError(f"forcing.file: no file {str(path)!r}") from None
    except OSError as error:
        raise OSError(f"forcing.file: {str(path)!r} cannot be read ({error})") from None
    if not data.strip():
        raise ValueError(f"forcing.file: {str(path)!r}: got an empty file, accepted: a record")
    if b"\0" in data:
        raise ValueError(f"forcing.file: {str(path)!r}: got binary data, accepted: a text file")
    return data.removeprefix(codecs.BOM_UTF8).decode("latin-1")


# The letter of an exponent may be Fortran's D here, so that what is refused is the number and not a part of it.
_HEADERS = (
    re.compile(r"NPTS\s*=\s*(\d{1,9})\s*,?\s*DT\s*=\s*([-+.\dDE]+)", re.IGNORECASE),
    re.compile(r"^\s*(\d{1,9})\s+([-+.\dDE]+)\s+NPTS\s*,\s*DT", re.IGNORECASE),
)


_VALUE = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:E[-+]?\d+)?", re.IGNORECASE)


def _peer(text):
    """Read a PEER file: four lines of header, and samples in rows."""
    lines = text.splitlines()
    if len(lines) < 5:
        raise ValueError(f"got {len(lines)} lines, accepted: four of header and the samples")
    said = re.search(r"units\s+of\s+([^\s,;]+)", lines[2], re.IGNORECASE)
    units = unit_of(said[1]) if said else None
    if units is None:
        raise ValueError(f"got the third line {lines[2][:80]!r}, accepted: one that says 'UNITS OF G', or of cm/s2")
    match = next(filter(None, (header.search(lines[3]) for header in _HEADERS)), None)
    if match is None:
        accepted = "'NPTS= n, DT= seconds' or 'n seconds NPTS, DT'"
        raise ValueError(f"got the fourth line {lines[3][:80]!r}, accepted: {accepted}")
    count, interval = int(match[1]), _numbers([match[2]])[0]
    if not 0.0 < interval < math.inf:
        raise ValueError(f"got DT = {match[2]}, accepted: a number above 0")
    _accept_count(count)
    words = _parted(" ".join(lines[4:]).split(), count)
    if len(words) != count:
        # What is no number tells more than their count does; the last one may be cut.
        _numbers(words[:-1])
        raise ValueError(f"got {len(words)} samples, accepted: the {count} that its fourth line states")
    return FileRecord(float(interval), _numbers(words), units)


def _parted(words, count):
    """Return words, with numbers that fill their columns and run together parted if that gives the stated count."""
    parts = [part for word in words for part in (_VALUE.findall(word) if len(word) > 1 else [word])]
    return parts if len(words) != count == len(parts) and "".join(parts) == "".join(words) else words


def _esm(text):
    """Read a file of the Engineering Strong Motion database: 64 lines ``NAME: value``, and a sample a line."""
    lines = text.splitlines()
    header = {
        name.strip(): value.strip() for name, colon, value in (line.partition(":") for line in lines[:64]) if colon
    }
    for name in ("SAMPLING_INTERVAL_S", "NDATA", "UNITS"):
        if name not in header:
            raise ValueError(f"got no line '{name}:' among the first 64, accepted: a file of ESM")
    units, interval = unit_of(header["UNITS"]), _numbers([header["SAMPLING_INTERVAL_S"]])[0]
    if units is None:
        raise ValueError(f"got UNITS: {header['UNITS']!r}, accepted: an acceleration in {', '.join(UNITS)}")
    if not interval > 0.0:
        raise ValueError(f"got SAMPLING_INTERVAL_S: {header['SAMPLING_INTERVAL_S']}, accepted: a number above 0")
    words = " ".join(lines[64:]).split()
    if header["NDATA"] != str(len(words)):
        raise ValueError(f"got {len(words)} samples from line 65 on, accepted: the {header['NDATA']} of its line NDATA")
    _accept_count(len(words))
    return FileRecord(float(interval), _numbers(words), units)


def _columns(text):
    """Read two columns, parted by commas, semicolons, tabs or blanks; a line of names may say the unit."""
    lines = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    rows = [_entries(line) for line in lines]
    units = ""
    if rows and not any(_is_number(entry) for entry in rows[0]):
        units = next(filter(None, map(unit_of, re.findall(r"[^\s,;()\[\]\"']+", lines[0]))), "")
        rows = rows[1:]
    _accept_count(len(rows))
    wrong = next((row for row in rows if len(row) != 2), None)
    if wrong is not None:
        raise ValueError(f"got a line of {len(wrong)} columns, accepted: time in seconds and acceleration")
    times, samples = _numbers([entry for row in rows for entry in row]).reshape(-1, 2).T
    # Times at the ends of double precision may be further apart than that reaches, and the interval is then refused.
    with np.errstate(over="ignore", invalid="ignore"):
        return FileRecord(_interval(times), samples, units)


def _entries(line):
    """Return the entries of a line; a comma is a decimal one where semicolons or tabs part them."""
    if ";" in line or ("\t" in line and "," in line):
        return re.split(r"[;\s]+", line.replace(",", ".").strip().rstrip(";"))
    return line.replace(",", " ").split()


def _is_number(word):
    """Whether a word is a number, other than nan."""
    return not math.isnan(_number(word))


def _interval(times):
    """Return the interval of times (n,), or refuse them where it is not one."""
    steps = np.diff(times)
    if not (steps > 0.0).all():
        place = int(np.argmax(~(steps > 0.0)))
        raise ValueError(f"got the time {times[place + 1]:g} after {times[place]:g}, accepted: ascending times")
    interval = (times[-1] - times[0]) / (len(times) - 1)
    late = times - (times[0] + interval * np.arange(len(times)))
    place = int(np.argmax(np.abs(late)))
    # Files round times.
    if abs(late[place]) > 0.02 * interval:
        expected = times[place] - late[place]
        raise ValueError(f"got the time {times[place]:g} for {expected:g}, accepted: equally spaced times")
    return float(interval)


def _accept_count(count):
    """Refuse a number of samples that a record cannot have."""
    if not 2 <= count <= MOST:
        raise ValueError(f"got {count} samples, accepted: 2 to {MOST}")


def _numbers(words):
    """Return words as finite numbers."""
    try:
        values = np.array(words, dtype=float)
    except ValueError:
        values = np.array([_number(word) for word in words])
    # Python reads 1_0 as 10.
    wild = np.flatnonzero(~np.isfinite(values) | np.array(["_" in word for word in words], dtype=bool))
    if wild.size:
        raise ValueError(f"got {words[wild[0]][:40]!r}, accepted: finite numbers")
    return values


def _number(word):
    """Return a word as a float, nan where it is no number."""
    try:
        return float(word)
    except ValueError:
        return math.nan
