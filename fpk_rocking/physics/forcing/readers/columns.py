"""Text and tables without a format of their own: columns with or without names and times, and values in rows.

A header is what stands before the first line of numbers: comments behind #, % or !, lines ``name: value``, names of
columns, a row of units. A first line of a count and an interval is taken where the count is that of what follows.
"""

import math
import re
from typing import NamedTuple

import numpy as np

from fpk_rocking.physics.forcing.readers import fields
from fpk_rocking.physics.forcing.readers.components import (
    SEISMOMETER,
    UNITS,
    Component,
    is_vertical,
    quantity_of,
    quantity_of_unit,
    unit_of,
)
from fpk_rocking.physics.forcing.readers.traces import EXTRA

NAME = "columns"

_MARKS = re.compile(r"\s*(?:[#%!]|//)+")
_TIME = re.compile(r"t|(?:t|time|zeit|temps|tiempo|zaman|sec(?:ond)?s?)\b.*|s|ms", re.IGNORECASE)
_SECONDS = {
    **dict.fromkeys(("s", "sec", "secs", "second", "seconds"), 1.0),
    **dict.fromkeys(("ms", "msec", "msecs", "millisecond", "milliseconds"), 1e-3),
    **dict.fromkeys(("min", "mins", "minute", "minutes"), 60.0),
}
_DIRECTION = re.compile(
    r"[NS]\d{1,3}[EW]|[NS]-?[NS]|[EW]-?[EW]|[NEWS]|[A-Z]{2}[NE12]|[HXYLT]\d?|\+?V|\d{1,3} ?DEG", re.I
)

_WILD = re.compile(r"[-+]?(nan|inf\w*)|\*{2,20}", re.IGNORECASE)
"""What stands for a sample that is none."""

_N = fields.NUMBER
_DECIMAL_COMMA = r"[-+]?\d+,\d+(?:[Ee][-+]?\d+)?"
_STEP = r"(?:\bdt|\bdelta ?t|\btime (?:step|increment|interval)|\bsampl\w* (?:interval|period|step)|\bintervals? of)"
_INTERVALS = rf"{_STEP}\b ?((?:[(\[]\w+[)\]])?\s*[=:]?\s*{_N} ?[a-z]*)", rf"equal spacing of ({_N} ?[a-z]*)"
_RATES = (
    rf"\bsampl\w* ?(?:rate|freq\w*)\s*(?:[(\[]?\s*hz[)\]]?)?\s*[=:]?\s*({_N})",
    rf"\b(?:samples? per second|fs)\s*[=:]\s*({_N})",
)
_WORDS = r"\b(?:npts?|ndata|nsamples|n|num(?:ber)?\.? of (?:points|data|samples|values)|no\.? of (?:points|data))"
_COUNTS = rf"{_WORDS}\s*[=:]\s*(\d+)(?![\d.])", r"^\s*(\d+) (?:data )?points\b"
_COMPONENTS = (r"^\s*(?:comp(?:onent)?\.?|orientation|channel|direction|azimuth)\s*[=:.]?\s+[=:]?\s*(\S.*?)\s*$",)
_PEAKS = (rf"\b(?:pga|peak value|peak acc\w*|max\. ?acc\w*)\s*(?:[(\[].*?[)\]])?\s*[=:]\s*({_N})",)


def recognized(_: list[str]) -> bool:
    """Whether there may be columns: always."""
    return True


def components(lines: list[str]) -> list[Component]:
    """The columns of a text but for the times, or its values in rows."""
    text = _parted(lines)
    text, count, interval = _stated(text)
    if not text.rows:
        raise ValueError(f"got 0 samples, accepted: a text with numbers, or what ObsPy reads{EXTRA}")
    width = len(text.rows[0])
    names = _names(text.header, width)
    in_rows = _is_rows(text.rows, names, count)
    _check_widths(text, in_rows)
    timed = not in_rows and (any(map(_is_time, names)) or (not names and width == 2))
    if text.comment and not timed:
        accepted = "none where there are no times"
        raise ValueError(f"got a comment or a blank line between samples, accepted: {accepted} (line {text.comment})")
    if in_rows:
        return [_in_rows(text, count, interval)]
    words = [word.upper().replace("D", "E") for row in text.rows for word in row]
    table = fields.numbers(words, [number for number in text.numbers for _ in range(width)]).reshape(-1, width)
    fields.check_count(len(table))
    if count is not None and fields.integer(count) != len(table):
        raise ValueError(f"got {len(table)} lines of numbers, accepted: the {count} that the file states")
    times = _time_column(names, table)
    if times is not None:
        # Times at the ends of double precision may be further apart than that reaches, and are then refused.
        with np.errstate(over="ignore", invalid="ignore"):
            read = fields.interval_of(table[:, times], [row[times] for row in text.rows], text.numbers)
        read *= _time_unit(names[times]) if names else 1.0
        if read == 1.0 and len(table) >= 50:
            # Lines with numbers, at 1 Hz no record of an earthquake.
            read = interval
        elif interval is not None and not math.isclose(read, interval, rel_tol=0.01):
            raise ValueError(f"got times at {read:g} s, accepted: the {interval:g} s that the header states")
        interval = read if interval is None else interval
    places = [place for place in range(width) if place != times]
    return [_column(text, names, place, table[:, place], interval, len(places)) for place in places]


class _Text(NamedTuple):
    """Lines before the numbers; numbers of their lines, their entries; the line of a comment among them, or 0."""

    header: list[str]
    numbers: list[int]
    rows: list[list[str]]
    comment: int


def _parted(lines):
    """`_Text` of lines."""
    header: list[str] = []
    numbers: list[int] = []
    rows: list[list[str]] = []
    comments, blanks, last = [], [], None
    for number, line in enumerate(lines, 1):
        comment = _MARKS.match(line)
        if comment:
            header += [line[comment.end() :].strip()] * (not rows)
            comments.append((number, len(rows)))
            continue
        entries = line.split()
        blanks += [(number, len(rows))] * (not entries)
        if not _plain(entries):
            entries = _entries(line)
        bad = next((entry for entry in entries if math.isnan(fields.number(entry))), None)
        if bad is None:
            numbers += [number] * bool(entries)
            rows += [entries] * bool(entries)
        elif not rows and not (_WILD.fullmatch(bad) and not any(map(str.isalpha, "".join(entries).replace(bad, "")))):
            header.append(line.strip())
            last = number, entries, bad
        else:
            raise ValueError(f"got {bad[:40]!r}, accepted: finite numbers (line {number})")
    # A line of numbers of which one is none is no header.
    if last and rows and len(last[1]) == len(rows[0]) > 1 and math.isfinite(fields.number(last[1][0])):
        raise ValueError(f"got {last[2][:40]!r}, accepted: finite numbers (line {last[0]})")
    # Behind every line, a blank one means nothing.
    comments += blanks * (len([place for _, place in blanks if place]) < len(rows) - 1)
    return _Text(header, numbers, rows, next((number for number, place in comments if 0 < place < len(rows)), 0))


def _stated(text):
    """(text without a first line of count and interval, count or None, interval or None), as the file states them."""
    header, numbers, rows, comment = text
    interval, count, pair = _interval(header), fields.stated(header, *_COUNTS), None
    counted = sum(map(len, rows[1:]))
    if len(rows) > 2 and len(rows[0]) == 2:
        # Of times and samples there is one count, of samples in rows or in a column another.
        pair = _pair(rows[0], {len(rows) - 1} if len(rows[1]) == 2 else {counted})
        if not pair and len(rows[1]) != 2:
            accepted = "as many as the first line of numbers states, or lines of equal columns"
            raise ValueError(f"got {counted} samples below {' '.join(rows[0])!r}, accepted: {accepted}")
        numbers, rows = (numbers[1:], rows[1:]) if pair else (numbers, rows)
    elif len(rows) > 3 and len(rows[0]) == len(rows[1]) == 1:
        pair = _pair([rows[0][0], rows[1][0]], {counted - 1})
        numbers, rows = (numbers[2:], rows[2:]) if pair else (numbers, rows)
    elif rows and header and all(math.isfinite(fields.number(word)) for word in header[-1].split()):
        pair = _pair(header[-1].split(), range(counted + len(rows[0]) - len(rows[-1]) + 1, counted + len(rows[0]) + 1))
    if pair:
        count = _agreed("a count", count, str(int(pair[0])))
        interval = _agreed("an interval", interval, fields.seconds(pair[1]))
    return _Text(header, numbers, rows, comment), count, interval


def _pair(words, counts):
    """[count, interval] where the first two words are these, in any order, and it is one of some counts; else None."""
    for first, second in (words[:2], words[1::-1]) if len(words) > 1 else ():
        if re.fullmatch(r"\d{1,9}", first) and int(first) in counts and 0.0 < fields.number(second) < 1.0:
            return [first, second]
    return None


def _check_widths(text, in_rows):
    """Raise ValueError where a line has other columns than the first; the last of samples in rows may be shorter."""
    width = len(text.rows[0])
    for number, row in zip(text.numbers, text.rows, strict=True):
        if len(row) != width and not (in_rows and number == text.numbers[-1] and len(row) < width):
            accepted = f"the {width} of the first one"
            raise ValueError(f"got a line of {len(row)} columns, accepted: {accepted} (line {number})")


def _plain(entries):
    """Whether all entries are numbers as Python reads them, which most lines are, and need no second look."""
    try:
        return all(map(math.isfinite, map(float, entries))) and not any("_" in entry for entry in entries)
    except ValueError:
        return False


def _entries(line):
    """Entries of a line; a comma is a decimal one where something else parts them."""
    line = line.replace('"', "").replace("'", "").strip()
    whole = re.fullmatch(rf"{_DECIMAL_COMMA}(\s+{_DECIMAL_COMMA})+", line)
    if ";" in line or whole or ("\t" in line and re.search(r"\d,\d", line) and ", " not in line):
        words = re.split(r"[;\s]+", line.replace(",", ".").rstrip("; \t"))
    elif "," in line:
        # Between two commas something is missing; behind the last one is nothing.
        words = [word for part in re.sub(r"[,\s]+$", "", line).split(",") for word in part.split() or [""]]
    else:
        words = line.split()
    return [part for word in words for part in fields.parted(word)]


def _agreed(what, first, second):
    """The one of two that is stated, or both where they are equal; else ValueError."""
    if first is not None and not math.isclose(float(first), float(second), rel_tol=1e-6):
        raise ValueError(f"got a header with {first} and {second} as {what}, accepted: one of them")
    return second


def _interval(header):
    """Interval that a header states, seconds, or None."""
    text, rate = fields.stated(header, *_INTERVALS), fields.stated(header, *_RATES)
    interval = None
    if text:
        form = rf"(?:[(\[](\w+)[)\]])?\s*[=:]?\s*({_N}) ?([a-z]*)"
        bracket, value, word = re.findall(form, text, re.IGNORECASE)[0]
        if bracket and bracket.lower() not in _SECONDS:
            raise ValueError(f"got an interval in {bracket!r}, accepted: {', '.join(_SECONDS)}")
        interval = fields.seconds(value, _SECONDS.get((bracket or word).lower(), 1.0))
    if rate:
        interval = _agreed("an interval", interval, 1.0 / fields.seconds(rate))
    return interval


def _unit(header):
    """Unit of acceleration that a header says; "" for none."""
    near = []
    for line in header:
        near += re.findall(r"(?:accel\w*|\bacc|\bpga)\b[^(\[:=]*[(\[]([^)\]]+)[)\]]", line, re.IGNORECASE)
        near += re.findall(r"accel\w* (?:time (?:series|history) )?in (\S+)", line, re.IGNORECASE)
        near += re.findall(r"[^\s,;:()\[\]=]+/[^\s,;:()\[\]=]+", line)
    said = dict.fromkeys(filter(None, map(unit_of, near)))
    other = fields.unit_said(header)
    said |= {other: None} if other else {}
    if len(said) > 1:
        raise ValueError(f"got a header with the units {' and '.join(said)}, accepted: one of them")
    return next(iter(said), "")


def _quantity(header):
    """What a header says that the numbers are; "acceleration" where it does not."""
    text = " ".join(header)
    if re.search(r"(response|fourier|amplitude) spectr|spectral accel", text, re.IGNORECASE):
        return "response spectrum"
    if re.search(r"\bacc|acel", text, re.IGNORECASE):
        return "acceleration"
    # Of a filter and of the sampling are frequencies and periods that a header has.
    return quantity_of(re.sub(r"\ba\b|freq\w*|period\w*", " ", text, flags=re.IGNORECASE)) or "acceleration"


def _names(header, width):
    """Names of the columns, with the units that a row below them says; [] where the header has none."""
    rows = [_split(line, width) for line in header[-3:]]
    rows = [row if len(row) == width else [] for row in rows]
    units = rows[-1] if rows else []
    if units and len(rows) > 1 and rows[-2] and all(map(_is_unit, units)):
        return [f"{name} ({unit.strip('()[]')})" for name, unit in zip(rows[-2], units, strict=True)]
    names: list[str] = next((row for row in reversed(rows) if row and all(map(_is_known, row))), [])
    apart = [
        line for line in header[-2:] if len(_split(line, width)) == width and re.search(r"[,;\t]|\S\s{2,}\S", line)
    ]
    names = names or next((row for row in map(_split, reversed(apart), [width] * 2) if any(map(_is_known, row))), [])
    if width > 1 and names:
        return names
    # A line of names that does not fit says that a column is missing, or one too many.
    above = _split(header[-1], 0) if header else []
    if len(above) > 1 and all(map(_is_known, above)):
        raise ValueError(f"got {width} columns, accepted: the {len(above)} that the line of names has: {header[-1]!r}")
    own = header[-1:] if width == 1 and header and len(header[-1]) < 40 and ":" not in header[-1] else []
    return own if own and quantity_of(own[0]) else []


def _split(line, width):
    """Names in a line, each with the unit in brackets behind it; where `width` can tell, by wider gaps."""
    line = re.sub(r"^\s*data\w*\s*:\s*", "", line.strip().rstrip(",;"), flags=re.IGNORECASE)
    parting = next((mark for mark in ";\t," if mark in line), "")
    names = line.split(parting) if parting else []
    if not parting or (width and len(names) != width):
        names = re.findall(r"[^\s;,(\[]+(?:\s*[(\[][^)\]]*[)\]])?", line)
    wide = re.split(r"\s{2,}", line)
    names = wide if not parting and len(names) != width and len(wide) == width else names
    return [name.strip().strip("\"'").strip() for name in names]


def _is_time(name):
    """Whether a column of that name has the times."""
    return bool(_TIME.fullmatch(name.replace("_", " ")))


def _is_unit(text):
    """Whether a text is a unit of time, acceleration, or another quantity."""
    word = text.strip("()[] ")
    return bool(word.lower() in _SECONDS or unit_of(word) or quantity_of_unit(word))


def _is_known(name):
    """Whether a text is a name of a column: a time, a quantity, a direction or a unit."""
    name = re.sub(r"\s*\([-+]\)$", "", name)
    if name.lower() == "in" or re.search("[=:]", name) or len(re.sub(r"[(\[].*?[)\]]", "", name).split()) > 3:
        return False
    known = _is_time(name) or (quantity_of(name) and len(name) < 40) or _DIRECTION.fullmatch(name)
    return bool(known or is_vertical(name) or _is_unit(name))


def _is_rows(rows, names, count):
    """Whether the rows are samples one after the other, and not columns; ValueError where nothing tells."""
    width, total = len(rows[0]), sum(map(len, rows))
    if names or width == 1 or (len(rows) == 1 and width > 3):
        return not names
    if (
        count is not None
        and total - len(rows[-1]) < fields.integer(count) <= total
        and fields.integer(count) != len(rows)
    ):
        return True
    if width < 5:
        return False
    first = np.array([fields.number(row[0]) for row in rows])
    steps = np.diff(first)
    if len(first) > 2 and (steps > 0.0).all():
        return False
    if count is not None and fields.integer(count) == len(rows):
        return False
    whole = np.array([fields.number(word) for row in rows if len(row) == width for word in row]).reshape(-1, width)
    along, down = np.abs(np.diff(whole, axis=1)).mean(), np.abs(np.diff(whole, axis=0)).mean()
    if len(whole) > 2 and down < 0.8 * along:
        raise ValueError(
            f"got {width} columns without names, each smoother than the rows, accepted: samples in rows, or "
            "names of the columns"
        )
    return True


def _in_rows(text, count, interval):
    """The component whose samples stand in rows, of which there are as many as the file states."""
    words = [word.upper().replace("D", "E") for row in text.rows for word in row]
    at = [number for number, row in zip(text.numbers, text.rows, strict=True) for _ in row]
    samples = fields.numbers(words, at)
    notes: tuple[str, ...] = ()
    if count is not None:
        surplus = len(samples) - fields.integer(count)
        if surplus and not (0 < surplus < len(text.rows[-1]) and not samples[-surplus:].any()):
            raise ValueError(f"got {len(samples)} samples, accepted: the {count} that the file states")
        if surplus:
            samples, notes = samples[:-surplus], (f"{surplus} zeros behind the last sample are left out.",)
    fields.check_count(len(samples))
    return _only(text.header, samples, interval, notes)


def _only(header, samples, interval, notes=()):
    """The only component of a file, about which the header says everything."""
    peak = fields.stated(header, *_PEAKS)
    return Component(
        fields.stated(header, *_COMPONENTS) or "",
        samples,
        interval,
        _unit(header),
        _quantity(header),
        bool(re.search(r"\bvertical\b|\bup-?down\b", " ".join(header), re.IGNORECASE)),
        notes,
        None if peak is None else fields.number(peak),
        fields.printable(header[0]) if header else "",
    )


def _time_column(names, table):
    """Place of the times; None where there are none."""
    if names:
        places = [place for place, name in enumerate(names) if _is_time(name)]
        if len(places) > 1:
            raise ValueError(f"got {len(places)} columns of times, accepted: one: {', '.join(names)}")
        if any(quantity_of(name) == "response spectrum" for name in names):
            columns = ", ".join(names[:4])
            raise ValueError(f"got a response spectrum, with the columns {columns}, accepted: an accelerogram")
        return places[0] if places else None
    rising = [place for place, steps in enumerate(np.diff(table, axis=0).T) if len(steps) and (steps > 0.0).all()]
    if len(rising) > 1 and table.shape[1] > 2 and len(table) > 2:
        raise ValueError(
            f"got {len(rising)} columns that rise, without names, accepted: names, or times in the first one"
        )
    return 0 if table.shape[1] == 2 or 0 in rising else None


def _time_unit(name):
    """Seconds in the unit of a column of times; ValueError for an unknown one."""
    words = [word.lower() for word in re.split(r"[\s_,;()\[\]]+", name) if word]
    known = [_SECONDS[word] for word in words if word in _SECONDS]
    bracket = re.search(r"[(\[](.*?)[)\]]", name)
    if not known and bracket:
        raise ValueError(f"got times in {bracket[1]!r}, accepted: {', '.join(_SECONDS)}")
    return known[-1] if known else 1.0


def _column(text, names, place, samples, interval, of):
    """The component of a column, of several."""
    if not names and of == 1:
        return _only(text.header, samples, interval)
    said, unit = _quantity(text.header), _unit(text.header)
    if not names:
        # What it is, is for the user to say.
        return Component(f"column {place + 1}", samples, interval, unit, "" if said == "acceleration" else said)
    name = names[place]
    own, quantity = _unit_in(name), quantity_of(name)
    if not own and SEISMOMETER.fullmatch(name):
        quantity = "seismometer's velocity"
    other = quantity_of_unit(own) if own else ""
    quantity = other or quantity or ("acceleration" if own in UNITS else "")
    if not quantity and (_DIRECTION.fullmatch(re.sub(r"[(\[].*", "", name).strip()) or is_vertical(name)):
        quantity = said
    if said != "acceleration" and quantity in ("", "acceleration"):
        quantity = said
    return Component(name, samples, interval, own or (unit if not other else ""), quantity)


def _unit_in(name):
    """Unit in a column's name, as in ``acc_m_s2`` or ``Acceleration (g)``; what else looks like one; else ""."""
    words = re.findall(r"[^\s,;()\[\]\"']+", name)
    parts = [word.split("_", start)[-1] for word in words for start in range(word.count("_") + 1)]
    bracket = re.search(r"[(\[]\s*(.*?)\s*[)\]]", name)
    parts = ([bracket[1]] if bracket else []) + parts
    found = next(filter(None, map(unit_of, parts)), "")
    if found or not bracket:
        return found
    text = bracket[1]
    return "" if _DIRECTION.fullmatch(text) or is_vertical(text) or not re.search("[A-Za-z%]", text) else text
