"""Text and tables without a format of their own: columns with or without names and times, and values in rows.

A header is what stands before the first line of numbers: comments behind #, % or !, lines ``name: value``, names of
columns, a row of units. A first line of a count and an interval is taken where the count is that of what follows.
"""

import math
import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fpk_rocking.physics.forcing.readers import fields, headers, terms
from fpk_rocking.physics.forcing.readers.components import Component, ReadingError
from fpk_rocking.physics.forcing.readers.traces import EXTRA

NAME = "columns"

_MARKS = re.compile(r"\s*(?:[#%!]|//)+")
_TIME = re.compile(r"t|(?:t|time|zeit|temps|tiempo|zaman|sec(?:ond)?s?)\b.*|s|ms", re.IGNORECASE)
_DIRECTION = re.compile(
    r"[NS]\d{1,3}[EW]|[NS]-?[NS]|[EW]-?[EW]|[NEWS]|[A-Z]{2}[NE12]|[HXYLT]\d?|\+?V|\d{1,3} ?DEG", re.I
)
_WILD = re.compile(r"[-+]?(nan|inf\w*)|\*{2,20}", re.IGNORECASE)
"""What stands for a sample that is none."""

_DECIMAL_COMMA = r"[-+]?\d+(?:,\d+)?(?:[Ee][-+]?\d+)?"


def recognized(_: list[str]) -> bool:
    """Whether there may be columns: always."""
    return True


def components(lines: list[str]) -> list[Component]:
    """The columns of a text but for the times, or its values in rows."""
    text, count, interval = _stated(parted(lines))
    if not text.rows:
        raise ReadingError("0 samples", f"a text with numbers, or what ObsPy reads{EXTRA}")
    width = len(text.rows[0])
    names = _names(text.header, width)
    in_rows = _is_rows(text.rows, names, count)
    for number, row in zip(text.numbers, text.rows, strict=True):
        if len(row) != width and not (in_rows and number == text.numbers[-1] and len(row) < width):
            raise ReadingError(f"a line of {len(row)} columns", f"the {width} of the first one", number)
    if text.gap and (in_rows or not (any(map(_is_time, names)) or (not names and width == 2))):
        raise ReadingError("a comment or a blank line between samples", "none where there are no times", text.gap)
    words = [word.upper().replace("D", "E") for row in text.rows for word in row]
    samples = fields.numbers(words, [number for number, row in zip(text.numbers, text.rows, strict=True) for _ in row])
    if in_rows:
        return [_in_rows(text, samples, count, interval)]
    table = samples.reshape(-1, width)
    if count not in (None, fields.integer(len(table))):
        raise ReadingError(f"{len(table)} lines of numbers", f"the {count} that the file states")
    times = _time_column(names, table)
    if times is not None:
        interval = _interval(text, table[:, times], times, names, interval)
    places = [place for place in range(width) if place != times]
    if not names and len(places) == 1:
        return [_only(text.header, table[:, places[0]], interval)]
    said, unit = headers.quantity(text.header), headers.unit(text.header)
    if not names:
        # What it is, is for the user to say.
        said = "" if said == "acceleration" else said
        return [Component(f"column {place + 1}", table[:, place], interval, unit, said) for place in places]
    return [_column(names[place], table[:, place], interval, unit, said) for place in places]


class Text(NamedTuple):
    """Lines before the numbers; numbers of their lines, their entries; the line of a gap among them, or 0."""

    header: list[str]
    numbers: list[int]
    rows: list[list[str]]
    gap: int


def parted(lines: Sequence[str]) -> Text:
    """Return the named tuple `Text` of lines; `ReadingError` for what is neither numbers nor a header."""
    header: list[str] = []
    numbers: list[int] = []
    rows: list[list[str]] = []
    comments, blanks = [], []
    last: tuple[int, list[str], str] = 0, [], ""
    for number, line in enumerate(lines, 1):
        comment = _MARKS.match(line)
        if comment:
            header += [line[comment.end() :].strip()] * (not rows)
            comments.append((number, len(rows)))
            continue
        entries = line.split()
        if not entries:
            blanks.append((number, len(rows)))
            continue
        bad = _bad(entries)
        if bad is not None:
            entries = split_numbers(line)
            bad = _bad(entries)
        if bad is None:
            numbers.append(number)
            rows.append(entries)
        elif rows:
            raise ReadingError(repr(bad[:40]), "finite numbers", number)
        else:
            header.append(line.strip())
            last = number, entries, bad
    # A line of numbers of which one is none is no header.
    number, entries, bad = last
    wild = _WILD.fullmatch(bad) and not any(map(str.isalpha, "".join(entries).replace(bad, "")))
    if wild or (rows and len(entries) == len(rows[0]) > 1 and math.isfinite(fields.number(entries[0]))):
        raise ReadingError(repr(bad[:40]), "finite numbers", number)
    # Behind every line, a blank one means nothing.
    comments += blanks * (len([place for _, place in blanks if place]) < len(rows) - 1)
    return Text(header, numbers, rows, next((number for number, place in comments if 0 < place < len(rows)), 0))


def _stated(text):
    """(text without a first line of count and interval, count or None, interval or None), as the file states them."""
    header, numbers, rows, _ = text
    interval, count = headers.interval(header), headers.count(header)
    counted, widths = sum(map(len, rows[1:])), [len(row) for row in rows[:2]]
    words: list[str] = []
    counts: Sequence[int] = ()
    skipped = 0
    if len(rows) > 2 and widths[0] == 2:
        # Of times and samples there is one count, of samples in rows or in a column another.
        words, skipped, counts = rows[0], 1, [len(rows) - 1 if widths[1] == 2 else counted]
    elif len(rows) > 3 and widths == [1, 1]:
        words, skipped, counts = rows[0] + rows[1], 2, [counted - 1]
    elif rows and header and all(math.isfinite(fields.number(word)) for word in header[-1].split()):
        counts = range(counted + widths[0] - len(rows[-1]) + 1, counted + widths[0] + 1)
        words = header[-1].split()
    for first, second in (words[:2], words[1::-1]) if len(words) > 1 else ():
        if re.fullmatch(r"\d{1,9}", first) and int(first) in counts and 0.0 < fields.number(second) < 1.0:
            count = headers.agreed("a count", count, int(first))
            interval = headers.agreed("an interval", interval, fields.seconds(second))
            return text._replace(numbers=numbers[skipped:], rows=rows[skipped:]), count, interval
    if skipped == 1 and widths[1] != 2:
        accepted = "as many as the first line of numbers states, or lines of equal columns"
        raise ReadingError(f"{counted} samples below {' '.join(words)!r}", accepted)
    return text, count, interval


def _bad(entries):
    """The first of some entries that is no number, or None."""
    return next((entry for entry in entries if math.isnan(fields.number(entry))), None)


def split_numbers(line: str) -> list[str]:
    """Entries of a line of numbers; a comma is a decimal one where something else parts them."""
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


def _names(header, width):
    """Names of the columns, with the units that a row below them says; [] where the header has none."""
    # The nearest line first.
    rows = [row if len(row := split_names(line, width)) == width else [] for line in header[:-4:-1]]
    if len(rows) > 1 and rows[0] and rows[1] and all(terms.measured(unit.strip("()[]"))[0] for unit in rows[0]):
        return [f"{name} ({unit.strip('()[]')})" for name, unit in zip(rows[1], rows[0], strict=True)]
    apart = [row for line, row in zip(header[:-3:-1], rows, strict=False) if re.search(r"[,;\t]|\S\s{2,}\S", line)]
    names = next((row for row in rows if row and all(map(_is_known, row))), [])
    names = names or next((row for row in apart if any(map(_is_known, row))), [])
    if not header or (width > 1 and names):
        return names
    # A line of names that does not fit says that a column is missing, or one too many.
    above = split_names(header[-1], 0)
    if len(above) > 1 and all(map(_is_known, above)):
        raise ReadingError(f"{width} columns", f"the {len(above)} that the line of names has: {header[-1]!r}")
    own = width == 1 and len(header[-1]) < 40 and ":" not in header[-1] and terms.quantity_of(header[-1])
    return header[-1:] if own else []


def split_names(line: str, width: int) -> list[str]:
    """Names in a line, each with the unit in brackets behind it; where `width` can tell, by wider gaps."""
    line = re.sub(r"^\s*data\w*\s*:\s*", "", line.strip().rstrip(",;"), flags=re.IGNORECASE)
    parting = next((mark for mark in ";\t," if mark in line), "")
    names, wide = line.split(parting or None), re.split(r"\s{2,}", line)
    if not parting or (width and len(names) != width):
        names = re.findall(r"[^\s;,(\[]+(?:\s*[(\[][^)\]]*[)\]])?", line)
    names = wide if not parting and len(names) != width and len(wide) == width else names
    return [name.strip().strip("\"'").strip() for name in names]


def _is_time(name):
    """Whether a column of that name has the times."""
    return bool(_TIME.fullmatch(name.replace("_", " ")))


def _is_known(name):
    """Whether a text is a name of a column: a time, a quantity, a direction or a unit."""
    name = re.sub(r"\s*\([-+]\)$", "", name)
    if name.lower() == "in" or re.search("[=:]", name) or len(re.sub(r"[(\[].*?[)\]]", "", name).split()) > 3:
        return False
    known = _is_time(name) or (terms.quantity_of(name) and len(name) < 40) or _DIRECTION.fullmatch(name)
    return bool(known or terms.is_vertical(name) or terms.measured(name)[0])


def _is_rows(rows, names, count):
    """Whether the rows are samples one after the other, and not columns; `ReadingError` where nothing tells."""
    width, total = len(rows[0]), sum(map(len, rows))
    if names or width == 1 or (len(rows) == 1 and width > 3):
        return not names
    if count not in (None, len(rows)) and total - len(rows[-1]) < count <= total:
        return True
    if width < 5 or count == len(rows):
        return False
    whole = np.array([list(map(fields.number, row)) for row in rows if len(row) == width])
    if len(rows) > 2 and (np.diff(whole[:, 0]) > 0.0).all():
        return False
    along, down = np.abs(np.diff(whole, axis=1)).mean(), np.abs(np.diff(whole, axis=0)).mean()
    if len(whole) > 2 and down < 0.8 * along:
        accepted = "samples in rows, or names of the columns"
        raise ReadingError(f"{width} columns without names, each smoother than the rows", accepted)
    return True


def _in_rows(text, samples, count, interval):
    """The component whose samples stand in rows, of which there are as many as the file states."""
    surplus = 0 if count is None else len(samples) - count
    if surplus and not (0 < surplus < len(text.rows[-1]) and not samples[-surplus:].any()):
        raise ReadingError(f"{len(samples)} samples", f"the {count} that the file states")
    notes = (f"{surplus} zeros behind the last sample are left out.",) * bool(surplus)
    return _only(text.header, samples[: fields.integer(len(samples) - surplus)], interval, notes)


def _only(header, samples, interval, notes=()):
    """The only component of a file, about which the header says everything."""
    vertical = bool(re.search(r"\bvertical\b|\bup-?down\b", " ".join(header), re.IGNORECASE))
    event = header[0] if header else ""
    about = headers.unit(header), headers.quantity(header), vertical, notes, headers.peak(header), event
    return Component(headers.name(header), samples, interval, *about)


def _time_column(names, table):
    """Place of the times; None where there are none."""
    if names:
        places = [place for place, name in enumerate(names) if _is_time(name)]
        if len(places) > 1:
            raise ReadingError(f"{len(places)} columns of times", f"one: {', '.join(names)}")
        if any(terms.quantity_of(name) == "response spectrum" for name in names):
            raise ReadingError(f"a response spectrum, with the columns {', '.join(names[:4])}", "an accelerogram")
        return places[0] if places else None
    rising = [place for place, steps in enumerate(np.diff(table, axis=0).T) if len(steps) and (steps > 0.0).all()]
    if len(rising) > 1 and table.shape[1] > 2 and len(table) > 2:
        raise ReadingError(f"{len(rising)} columns that rise, without names", "names, or times in the first one")
    return 0 if table.shape[1] == 2 or 0 in rising else None


def _interval(text, times, place, names, stated):
    """Interval of the times (n,) in the column at a place, which may be stated too."""
    # Times at the ends of double precision may be further apart than that reaches, and are then refused.
    with np.errstate(over="ignore", invalid="ignore"):
        interval = fields.interval_of(times, [row[place] for row in text.rows], text.numbers)
    interval *= _time_unit(names[place]) if names else 1.0
    if interval == 1.0 and len(times) >= 50:
        # Lines with numbers, at 1 Hz no record of an earthquake.
        return stated
    if stated is not None and not math.isclose(interval, stated, rel_tol=0.01):
        raise ReadingError(f"times at {interval:g} s", f"the {stated:g} s that the header states")
    return interval if stated is None else stated


def _time_unit(name):
    """Seconds in the unit of a column of times; `ReadingError` for an unknown one."""
    words = re.split(r"[\s_,;()\[\]]+", name)
    known = [terms.SECONDS[unit] for quantity, unit in map(terms.measured, words) if quantity == "time"]
    bracket = re.search(r"[(\[](.*?)[)\]]", name)
    if not known and bracket:
        raise ReadingError(f"times in {bracket[1]!r}", ", ".join(terms.SECONDS))
    return known[-1] if known else 1.0


def _column(name, samples, interval, unit, said):
    """The component of a column with a name, in a file whose header says a unit and a quantity."""
    own, quantity = _unit_in(name), terms.quantity_of(name)
    if not own and terms.SEISMOMETER.fullmatch(name):
        quantity = "seismometer's velocity"
    other = terms.quantity_of_unit(own) if own else ""
    direction = _DIRECTION.fullmatch(re.sub(r"[(\[].*", "", name).strip()) or terms.is_vertical(name)
    quantity = other or quantity or ("acceleration" if own in terms.UNITS else said if direction else "")
    if said != "acceleration" and quantity in ("", "acceleration"):
        quantity = said
    return Component(name, samples, interval, own or ("" if other else unit), quantity)


def _unit_in(name):
    """Unit in a column's name, as in ``acc_m_s2`` or ``Acceleration (g)``; what else looks like one; else ""."""
    words = re.findall(r"[^\s,;()\[\]\"']+", name)
    parts = [word.split("_", start)[-1] for word in words for start in range(word.count("_") + 1)]
    bracket = re.search(r"[(\[]\s*(.*?)\s*[)\]]", name)
    text = bracket[1] if bracket else ""
    found = next(filter(None, map(terms.unit_of, [text, *parts])), "")
    other = _DIRECTION.fullmatch(text) or terms.is_vertical(text) or not re.search("[A-Za-z%]", text)
    return found or ("" if other else text)
