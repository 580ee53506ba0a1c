"""Files that recorded motions come in: PEER's .AT2, ESM's .ASC, text of columns, and what ObsPy reads."""

import codecs
import math
import pathlib
import re
from typing import Any

import numpy as np

MOST = 2**20
"""Most samples: 87 minutes at 200 Hz."""

UNITS = {"g": 9.80665, "m/s2": 1.0, "cm/s2": 0.01}
"""Metres per second squared of a unit of acceleration."""

_SPELLINGS = {
    "g": "g",
    **dict.fromkeys(
        ("m/s2", "m/s^2", "m/s**2", "m/s/s", "m/s²", "m/sec2", "m/sec^2", "m/sec/sec", "ms2", "mps2", "m_s2", "m_s_2"),
        "m/s2",
    ),
    **dict.fromkeys(
        ("cm/s2", "cm/s^2", "cm/s**2", "cm/s/s", "cm/s²", "cm/sec2", "cm/sec^2", "cm/sec/sec", "gal", "cms2", "cm_s2"),
        "cm/s2",
    ),
}
"""Units by the ways in which they are written, in lower case."""


def unit_of(text: str) -> str | None:
    """Key of `UNITS` that a text such as "cm/sec^2" means, or None."""
    return _SPELLINGS.get(text.strip().lower())


def read(path: pathlib.Path) -> dict[str, Any]:
    """Arguments of a `Record` that a file says: interval, samples, units and event; "" is a unit that it does not say.

    The kind of the file follows from its first lines and its name. What is refused is an OSError or a ValueError that
    says what and where.
    """
    data = _data(path)
    try:
        try:
            if b"\0" in data:
                raise ValueError(f"got binary data, accepted: a text file, or what ObsPy reads{_OBSPY}")
            text = data.removeprefix(codecs.BOM_UTF8).decode("latin-1")
            kind = _peer if path.suffix.lower() == ".at2" else _esm if text.startswith("EVENT_NAME:") else _columns
            interval, samples, units, event = kind(text)
        except ValueError:
            traces = _traces(path)
            if traces is None:
                raise
            interval, samples, units, event = _trace(traces)
    except ValueError as error:
        raise ValueError(f"forcing.file: {str(path)!r}: {error}") from None
    return {"interval": interval, "samples": tuple(samples.tolist()), "units": units, "event": event}


_OBSPY = ' (pip install "fpk-rocking[obspy]")'


def _traces(path):
    """ObsPy's traces in a file; None where ObsPy cannot read it, or is missing."""
    try:
        import obspy
    except ImportError:
        return None
    try:
        return list(obspy.read(str(path)))
    except Exception:  # noqa: BLE001  (its readers raise whatever they meet)
        return None


def _trace(traces):
    """The only one of ObsPy's traces, whose unit is not said; ValueError where there is not one."""
    if len(traces) != 1:
        raise ValueError(f"got {len(traces)} traces, accepted: one horizontal component without gaps")
    (trace,) = traces
    _refuse_vertical("channel", trace.stats.channel[-1:])
    _check_count(len(trace.data))
    # What calib makes of counts is the unit of the instrument; it is 1 where the format has none.
    samples = np.asarray(trace.data, dtype=float) * trace.stats.calib
    if np.ma.is_masked(trace.data) or not np.isfinite(samples).all():
        raise ValueError("got samples that are missing or not finite")
    return float(trace.stats.delta), samples, "", ""


def _data(path):
    """Bytes of a file; OSError or ValueError if it is none, empty, or too large for a record."""
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
    return data


# The letter of an exponent may be Fortran's D here, so that what is refused is the number and not a part of it.
_HEADERS = (
    re.compile(r"NPTS\s*=\s*(\d{1,9})\s*,?\s*DT\s*=\s*([-+.\dDE]+)", re.IGNORECASE),
    re.compile(r"^\s*(\d{1,9})\s+([-+.\dDE]+)\s+NPTS\s*,\s*DT", re.IGNORECASE),
)


_VALUE = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:E[-+]?\d+)?", re.IGNORECASE)


def _peer(text):
    """A PEER file: four lines of header, and samples in rows."""
    lines = text.splitlines()
    if len(lines) < 5:
        raise ValueError(f"got {len(lines)} lines, accepted: four of header and the samples")
    _refuse_vertical("second line", re.split(r"[\s,:-]+", lines[1].strip())[-1])
    stated = re.search(r"units\s+of\s+([^\s,;]+)", lines[2], re.IGNORECASE)
    units = unit_of(stated[1]) if stated else None
    if units is None:
        raise ValueError(f"got the third line {lines[2][:80]!r}, accepted: one that says 'UNITS OF G', or of cm/s2")
    match = next(filter(None, (header.search(lines[3]) for header in _HEADERS)), None)
    if match is None:
        accepted = "'NPTS= n, DT= seconds' or 'n seconds NPTS, DT'"
        raise ValueError(f"got the fourth line {lines[3][:80]!r}, accepted: {accepted}")
    count, interval = int(match[1]), _numbers([match[2]])[0]
    if not 0.0 < interval < math.inf:
        raise ValueError(f"got DT = {match[2]}, accepted: a number above 0")
    _check_count(count)
    words = _parted(" ".join(lines[4:]).split(), count)
    if len(words) != count:
        # A word that is not a number explains more than their count; the last one may be cut off.
        _numbers(words[:-1])
        raise ValueError(f"got {len(words)} samples, accepted: the {count} that its fourth line states")
    return float(interval), _numbers(words), units, _printable(lines[1])


def _refuse_vertical(where, component):
    """Raise ValueError where `component`, from the place `where` of a header, is the vertical one.

    Archives hand out three components of each motion, and no plot of one tells which it is.
    """
    if component.upper() in {"UP", "DN", "DOWN", "DWN", "V", "VER", "VERT", "VERTICAL", "UD", "Z"}:
        raise ValueError(
            f"got the vertical component ({where} ends with {component!r}), accepted: a horizontal one, as the base "
            "moves horizontally"
        )


def _printable(text):
    """A line of text, at most 200 characters, without what a terminal or a page could not show."""
    return " ".join("".join(letter if letter.isprintable() else " " for letter in text).split())[:200]


def _parted(words, count):
    """`words`, with numbers that run together parted if that gives the stated `count` of them.

    Numbers that fill their columns have no blank between them.
    """
    parts = [part for word in words for part in (_VALUE.findall(word) if len(word) > 1 else [word])]
    return parts if len(words) != count == len(parts) and "".join(parts) == "".join(words) else words


def _esm(text):
    """A file of the Engineering Strong Motion database: 64 lines ``NAME: value``, and a sample a line."""
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
    _refuse_vertical("line STREAM", header.get("STREAM", "")[-1:])
    words = " ".join(lines[64:]).split()
    if header["NDATA"] != str(len(words)):
        raise ValueError(f"got {len(words)} samples from line 65 on, accepted: the {header['NDATA']} of its line NDATA")
    _check_count(len(words))
    about = (header.get(name, "") for name in ("EVENT_NAME", "EVENT_DATE_YYYYMMDD", "STATION_CODE", "STATION_NAME"))
    return float(interval), _numbers(words), units, _printable(", ".join(filter(None, about)))


def _columns(text):
    """A text of columns: time in seconds and acceleration, or those that names in the first line tell."""
    lines = [
        (number, line)
        for number, line in enumerate(text.splitlines(), 1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    rows = [(number, _entries(line)) for number, line in lines]
    names, units = [], ""
    if rows and all(math.isnan(_number(entry)) for entry in rows[0][1]):
        names, rows = _names(lines[0][1]), rows[1:]
    _check_count(len(rows))
    places = _places(names)
    time, acceleration = places or (0, 1)
    width = len(names) if places else 2
    number, row = next(((number, row) for number, row in rows if len(row) != width), (0, []))
    if number:
        accepted = "time in seconds and acceleration of one horizontal component, or a first line of names of which "
        accepted = f"the {width} that the first line names" if width != 2 else f"{accepted}one is 'time' and one 'acc'"
        raise ValueError(f"got a line of {len(row)} columns, accepted: {accepted} (line {number})")
    units = _unit_in(names[acceleration]) if places else next(filter(None, map(_unit_in, names)), "")
    words = [entry for _, row in rows for entry in (row[time], row[acceleration])]
    numbers = [number for number, _ in rows]
    times, samples = _numbers(words, [number for number in numbers for _ in range(2)]).reshape(-1, 2).T
    # Times at the ends of double precision may be further apart than that reaches, and the interval is then refused.
    with np.errstate(over="ignore", invalid="ignore"):
        return _interval(times, words[::2], numbers), samples, units, ""


def _names(line):
    """Names of columns in a line, each with the unit in brackets behind it."""
    parting = next((mark for mark in ";\t," if mark in line), "")
    names = line.split(parting) if parting else re.findall(r"\S+(?:\s*[(\[][^)\]]*[)\]])?", line)
    return [name.strip().strip("\"'") for name in names]


def _places(names):
    """Indices (time, acceleration) of these columns; None where the names do not tell one of each."""
    times = [place for place, name in enumerate(names) if re.match(r"t(ime|\b|_)", name, re.IGNORECASE)]
    columns = [place for place, name in enumerate(names) if re.match(r"a(cc|\b|_)", name, re.IGNORECASE)]
    columns = columns or [place for place, name in enumerate(names) if place not in times and _unit_in(name)]
    return (times[0], columns[0]) if len(times) == len(columns) == 1 else None


def _unit_in(name):
    """Key of `UNITS` in a column's name, as in ``acc_m_s2`` or ``Acceleration (g)``; else ""."""
    words = re.findall(r"[^\s,;()\[\]\"']+", name)
    parts = [word.split("_", start)[-1] for word in words for start in range(word.count("_") + 1)]
    return next(filter(None, map(unit_of, parts)), "")


def _entries(line):
    """Entries of a line; a comma is a decimal one where semicolons or tabs part them."""
    if ";" in line or ("\t" in line and "," in line):
        return re.split(r"[;\s]+", line.replace(",", ".").strip().rstrip(";"))
    return line.replace(",", " ").split()


def _interval(times, words, lines):
    """Interval of times (n,), seconds; ValueError, with the number of the line, where they are not equally spaced."""
    steps = np.diff(times)
    interval = (times[-1] - times[0]) / (len(times) - 1)
    late = times - (times[0] + interval * np.arange(len(times)))
    # Files round times.
    if (steps > 0.0).all() and np.abs(late).max() <= 0.02 * interval:
        return float(interval)
    rounded = _rounded_interval(times, words)
    if rounded:
        return rounded
    usual = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0
    place = int(np.argmax(np.abs(steps - usual) > 0.02 * usual))
    # A time that is too late is itself what is wrong, not the next one, which it may be after.
    if not steps[place] > 0.0:
        raise ValueError(
            f"got the time {times[place + 1]:g} after {times[place]:g}, accepted: ascending times "
            f"(line {lines[place + 1]})"
        )
    # Where each step is usual, the sum of what they are off is not.
    if np.ptp(steps) > 0.04 * usual:
        expected = times[place] + usual
    else:
        place = int(np.argmax(np.abs(late))) - 1
        expected = times[place + 1] - late[place + 1]
    raise ValueError(
        f"got the time {times[place + 1]:g} for {expected:g}, accepted: equally spaced times (line {lines[place + 1]})"
    )


def _rounded_interval(times, words):
    """Interval of equally spaced times that the file has rounded to decimals; 0.0 where rounding does not explain them.

    Some line has all of them within half a unit of the last decimal then. Fewer than ten tell nothing.
    """
    decimals = max(len(word.partition(".")[2]) for word in words)
    half, count = 0.5 * 10.0**-decimals, np.arange(len(times))
    if len(times) < 10 or any("e" in word.lower() for word in words) or not (np.diff(times) >= 0.0).all():
        return 0.0
    ends = (times[-1] - times[0]) / (len(times) - 1)
    # The range of what is left is convex in the interval, and the ends are off by half a unit each at most.
    low, high = (ends + sign * 2.0 * half / (len(times) - 1) for sign in (-1.0, 1.0))
    for _ in range(60):
        first, second = low + (high - low) / 3.0, high - (high - low) / 3.0
        if np.ptp(times - first * count) <= np.ptp(times - second * count):
            high = second
        else:
            low = first
    interval = float(0.5 * (low + high))
    explained = np.ptp(times - interval * count) <= 2.0 * half * (1.0 + 1e-6) + 1e-12 * abs(times[-1])
    return interval if explained and interval > 0.0 else 0.0


def _check_count(count):
    if not 2 <= count <= MOST:
        raise ValueError(f"got {count} samples, accepted: 2 to {MOST}")


def _numbers(words, lines=()):
    """Words (n) as an array of finite numbers; ValueError, with the number of the line if `lines` are given."""
    try:
        values = np.array(words, dtype=float)
    except ValueError:
        values = np.array([_number(word) for word in words])
    # Python reads 1_0 as 10.
    wild = np.flatnonzero(~np.isfinite(values) | np.array(["_" in word for word in words], dtype=bool))
    if wild.size:
        where = f" (line {lines[wild[0]]})" if lines else ""
        raise ValueError(f"got {words[wild[0]][:40]!r}, accepted: finite numbers{where}")
    return values


def _number(word):
    """A word as a float, nan where it is no number."""
    try:
        return float(word)
    except ValueError:
        return math.nan
