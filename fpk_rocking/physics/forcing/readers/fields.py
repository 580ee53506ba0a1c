"""Numbers in text: words, fields of fixed width, what a header states, and times."""

import math
import re
from collections.abc import Iterable, Sequence

import numpy as np

from fpk_rocking.base.checks import Array
from fpk_rocking.physics.forcing.readers.components import MOST, UNITS, quantity_of_unit, unit_of

NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[EeDd][-+]?\d+)?"

_NUMBER = re.compile(NUMBER)
# A number that runs into its neighbour has a decimal point: 2011-02-22 is a date.
_GLUED = re.compile(r"[-+]?(?:\d+\.\d*|\.\d+)(?:[EeDd][-+]?\d+)?")
_LETTERS = re.compile(r"[^\s\d.,;+\-*]")


def is_numeric(line: str) -> bool:
    """Whether a line has numbers and nothing else; stars count as numbers that were too large for their fields."""
    return bool(re.search(r"[\d*]", line)) and not _LETTERS.search(re.sub(r"(?<=[\d.])[EeDd](?=[-+\d])", "", line))


def numbers(words: Sequence[str], lines: Sequence[int] = ()) -> Array:
    """Words (n) as finite numbers; ValueError, with the number of the line if `lines` are given."""
    try:
        values = np.array(words, dtype=float)
    except ValueError:
        values = np.array([number(word) for word in words])
    # Python reads 1_0 as 10.
    wild = np.flatnonzero(~np.isfinite(values) | np.array(["_" in word for word in words], dtype=bool))
    if wild.size:
        where = f" (line {lines[wild[0]]})" if lines else ""
        raise ValueError(f"got {words[wild[0]][:40]!r}, accepted: finite numbers{where}")
    return values


def number(word: str) -> float:
    """A word as a float, with Fortran's D as exponent; nan where it is no number."""
    return float(word.upper().replace("D", "E")) if _NUMBER.fullmatch(word) else math.nan


def parted(word: str) -> list[str]:
    """Numbers of a word that run together, or the word itself; only a sign tells where the next one begins."""
    parts = _GLUED.findall(word)
    signed = len(parts) > 1 and all(part[0] in "+-" for part in parts[1:])
    return parts if signed and "".join(parts) == word else [word]


def values(lines: Sequence[str], count: int, form: str = "", what: str = "samples") -> Array:
    """The stated `count` of numbers in lines, apart by blanks or in fields of a FORTRAN format such as "(8F10.5)"."""
    check_count(count)
    words = " ".join(lines).split()
    match = re.search(r"(\d+)?\s*[EFDGI](\d+)(?:\.\d+)?", form.upper())
    if len(words) != count and match:
        width, most = int(match[2]), int(match[1] or 1) * int(match[2])
        fields = [line[k : k + width].strip() for line in lines for k in range(0, min(len(line.rstrip()), most), width)]
        if len(fields) == count and all(map(_NUMBER.fullmatch, fields)):
            words = fields
    if len(words) != count:
        glued = [part for word in words for part in parted(word)]
        words = glued if len(glued) == count else words
    if len(words) != count:
        # A word that is not a number explains more than their count; the last one may be cut off.
        numbers(words[:-1])
        raise ValueError(f"got {len(words)} {what}, accepted: the {count} that the file states")
    return numbers(words)


def integer(text: str) -> int:
    """The count of samples that a text is, if a record may have so many; else ValueError."""
    return check_count(int(text) if len(text) < 10 else 10**9)


def check_count(count: int) -> int:
    """`count`, if a record may have so many samples; else ValueError."""
    if not 2 <= count <= MOST:
        raise ValueError(f"got {count} samples, accepted: 2 to {MOST}")
    return count


def stated(lines: Iterable[str], *patterns: str) -> str | None:
    """First group of the first pattern that the lines have, or None; ValueError where they have it in two values."""
    for pattern in patterns:
        found = dict.fromkeys(match for line in lines for match in re.findall(pattern, line, re.IGNORECASE))
        firsts = {text: re.match(rf"(?:[(\[]\w+[)\]])?[\s=:]*({NUMBER})", text) for text in found}
        distinct = {number(first[1]) if first else text for text, first in firsts.items()}
        if len(distinct) > 1:
            raise ValueError(f"got a header with {' and '.join(map(repr, found))} for one thing, accepted: one of them")
        if found:
            return next(iter(found))
    return None


def required(what: str, lines: Iterable[str], *patterns: str) -> str:
    """As `stated`; ValueError where the lines have none of the patterns."""
    found = stated(list(lines), *patterns)
    if found is None:
        raise ValueError(f"got a header without {what}, accepted: one that states it")
    return found


def seconds(word: str, unit: float = 1.0) -> float:
    """An interval in seconds; ValueError where it is not above 0."""
    value = float(numbers([word.upper().replace("D", "E")])[0]) * unit
    if not 0.0 < value < math.inf:
        raise ValueError(f"got the interval {word}, accepted: a number above 0")
    return value


def unit_said(lines: Iterable[str]) -> str:
    """Unit that a header says, key of `UNITS` or the unit of another quantity; "" for none.

    A word after "unit" that is no unit is returned as it is.
    """
    found = {}
    for line in lines:
        match = re.search(r"(?:\b[Uu]|(?<=[a-z])U)nits?\b|UNITS?\b|UNIDADES", line)
        if not match:
            continue
        rest = re.sub(r"1\.0* (?=mm)", "", line[match.end() :])
        words = [word.strip(".:") for word in re.findall(r"[^\s,;()\[\]=]+", rest)]
        known = [unit_of(word) or word for word in words if unit_of(word) or quantity_of_unit(word)]
        known = [word for word in known if word.lower() not in ("in", "m", "v")] or known
        if known:
            found[known[0]] = True
        else:
            other = [
                word for word in words if word.lower() not in ("of", "are", "is", "in", "the", "de", "los", "datos")
            ]
            found[other[0][:40] if other else ""] = True
    found.pop("", None)
    if len(found) > 1:
        raise ValueError(f"got a header with the units {' and '.join(found)}, accepted: one of {', '.join(UNITS)}")
    return next(iter(found), "")


def printable(text: str) -> str:
    """A line of text, at most 200 characters, without what a terminal or a page could not show."""
    return " ".join("".join(letter if letter.isprintable() else " " for letter in text).split())[:200]


def interval_of(times: Array, words: Sequence[str], lines: Sequence[int] = ()) -> float:
    """Interval of times (n,), seconds; ValueError, with the number of the line, where they are not equally spaced."""
    at = [f" (line {line})" for line in lines] or [""] * len(times)
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
            f"got the time {times[place + 1]:g} after {times[place]:g}, accepted: ascending times{at[place + 1]}"
        )
    # Where each step is usual, the sum of what they are off is not.
    if np.ptp(steps) > 0.04 * usual:
        expected = times[place] + usual
    else:
        place = int(np.argmax(np.abs(late))) - 1
        expected = times[place + 1] - late[place + 1]
    raise ValueError(
        f"got the time {times[place + 1]:g} for {expected:g}, accepted: equally spaced times{at[place + 1]}"
    )


def _rounded_interval(times, words):
    """Interval of equally spaced times that the file has rounded; 0.0 where rounding does not explain them.

    Rounded to decimals, some line has all of them within half a unit of the last one. Rounded to significant digits,
    the line through the best of them has all within a unit of theirs. Fewer than ten tell nothing.
    """
    if len(times) < 10 or not (np.diff(times) >= 0.0).all():
        return 0.0
    count, ends = np.arange(len(times)), (times[-1] - times[0]) / (len(times) - 1)
    if not any("e" in word.lower() for word in words):
        half = 0.5 * 10.0 ** -max(len(word.partition(".")[2]) for word in words)
        # The range of what is left is convex in the interval, and the ends are off by half a unit each at most.
        low, high = (ends + sign * 2.0 * half / (len(times) - 1) for sign in (-1.0, 1.0))
        for _ in range(60):
            first, second = low + (high - low) / 3.0, high - (high - low) / 3.0
            if np.ptp(times - first * count) <= np.ptp(times - second * count):
                high = second
            else:
                low = first
        interval = float(0.5 * (low + high))
        if np.ptp(times - interval * count) <= 2.0 * half * (1.0 + 1e-6) + 1e-12 * abs(times[-1]) and interval > 0.0:
            return interval
    digits = max(len(re.sub(r"\D", "", re.split("[EeDd]", word)[0]).lstrip("0")) for word in words)
    # Fewer are no times of a record, which may only look as if rounded.
    if digits < 4 or not times[0] >= 0.0:
        return 0.0
    units = 10.0 ** (np.floor(np.log10(np.maximum(times, ends))) + 1 - digits)
    # The time that tells the interval best: late, and with many decimals.
    best = 1 + int(np.argmin(units[1:] / count[1:]))
    interval = float((times[best] - times[0]) / best)
    explained = (np.abs(times - times[0] - interval * count) <= units).all() and units[1] < 0.1 * interval
    return interval if explained else 0.0
