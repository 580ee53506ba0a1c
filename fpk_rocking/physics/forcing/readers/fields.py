"""Numbers in text: words, fields of fixed width, blocks of them, and times."""

import itertools
import math
import re
from collections.abc import Iterator, Sequence

import numpy as np

from fpk_rocking.base.checks import Array
from fpk_rocking.physics.forcing.readers.components import MOST, ReadingError

NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[EeDd][-+]?\d+)?"

_NUMBER = re.compile(NUMBER)
# A number that runs into its neighbour has a decimal point: 2011-02-22 is a date.
_GLUED = re.compile(r"[-+]?(?:\d+\.\d*|\.\d+)(?:[EeDd][-+]?\d+)?")
_LETTERS = re.compile(r"[^\s\d.,;+\-*]")


def is_numeric(line: str) -> bool:
    """Whether a line has numbers and nothing else; stars count as numbers that were too large for their fields."""
    return bool(re.search(r"[\d*]", line)) and not _LETTERS.search(re.sub(r"(?<=[\d.])[EeDd](?=[-+\d])", "", line))


def blocks(lines: Sequence[str]) -> Iterator[tuple[list[str], list[str]]]:
    """(text, numbers): lines of text but for what ends a channel, and lines of numbers, none below the last text."""
    text: list[str] = []
    for numeric, group in itertools.groupby(lines, is_numeric):
        if not numeric:
            text = [line for line in group if not re.match(r"\s*(?:/&|end-of-data)", line, re.IGNORECASE)]
        elif text:
            yield text, list(group)
            text = []
    if any(map(str.strip, text)):
        yield text, []


def numbers(words: Sequence[str], lines: Sequence[int] = ()) -> Array:
    """Words (n) as finite numbers; `ReadingError`, with the number of the line if `lines` are given."""
    try:
        values = np.array(words, dtype=float)
    except ValueError:
        values = np.array([number(word) for word in words])
    # Python reads 1_0 as 10.
    wild = np.flatnonzero(~np.isfinite(values) | np.array(["_" in word for word in words], dtype=bool))
    if wild.size:
        raise ReadingError(repr(words[wild[0]][:40]), "finite numbers", lines[wild[0]] if lines else 0)
    return values


def number(word: str | None) -> float:
    """A word as a float, with Fortran's D as exponent; nan where it is no number."""
    return float(word.upper().replace("D", "E")) if word and _NUMBER.fullmatch(word) else math.nan


def parted(word: str) -> list[str]:
    """Numbers of a word that run together, or the word itself; only a sign tells where the next one begins."""
    parts = _GLUED.findall(word)
    signed = len(parts) > 1 and all(part[0] in "+-" for part in parts[1:])
    return parts if signed and "".join(parts) == word else [word]


def values(lines: Sequence[str], count: int | str, form: str = "", what: str = "samples") -> Array:
    """The stated `count` of numbers in lines, apart by blanks or in fields of a FORTRAN format such as "(8F10.5)"."""
    count = integer(count)
    words = " ".join(lines).split()
    match = re.search(r"(\d+)?\s*[EFDGI](\d+)(?:\.\d+)?", form.upper())
    if len(words) != count and match:
        width, most = int(match[2]), int(match[1] or 1) * int(match[2])
        fields = [line[k : k + width].strip() for line in lines for k in range(0, min(len(line.rstrip()), most), width)]
        words = fields if len(fields) == count and all(map(_NUMBER.fullmatch, fields)) else words
    if len(words) != count:
        glued = [part for word in words for part in parted(word)]
        words = glued if len(glued) == count else words
    if len(words) != count:
        # A word that is not a number explains more than their count; the last one may be cut off.
        numbers(words[:-1])
        raise ReadingError(f"{len(words)} {what}", f"the {count} that the file states")
    return numbers(words)


def integer(count: int | str) -> int:
    """A count of samples, or its text, as a number, if a record may have so many; else `ReadingError`."""
    if not str(count).isdecimal():
        raise ReadingError(repr(count), "a number of samples")
    count = int(count) if len(str(count)) < 10 else 10**9
    if not 2 <= count <= MOST:
        raise ReadingError(f"{count} samples", f"2 to {MOST}")
    return count


def seconds(word: str, unit: float = 1.0) -> float:
    """An interval in seconds; `ReadingError` where it is not above 0."""
    value = float(numbers([word.upper().replace("D", "E")])[0]) * unit
    if not 0.0 < value < math.inf:
        raise ReadingError(f"the interval {word}", "a number above 0")
    return value


def interval_of(times: Array, words: Sequence[str], lines: Sequence[int] = ()) -> float:
    """Interval of times (n,), seconds; `ReadingError`, with the line's number, where they are not equally spaced."""
    steps = np.diff(times)
    interval = float((times[-1] - times[0]) / (len(times) - 1))
    late = times - (times[0] + interval * np.arange(len(times)))
    # Files round times.
    if (steps > 0.0).all() and np.abs(late).max() <= 0.02 * interval:
        return interval
    rounded = _rounded_interval(times, words)
    if rounded:
        return rounded
    usual = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0
    place = int(np.argmax(np.abs(steps - usual) > 0.02 * usual))
    # A time that is too late is itself what is wrong, not the next one, which it may be after.
    rises = bool(steps[place] > 0.0)
    if rises and np.ptp(steps) <= 0.04 * usual:
        # Where each step is usual, the sum of what they are off is not.
        place = int(np.argmax(np.abs(late))) - 1
        usual = times[place + 1] - late[place + 1] - times[place]
    got = f"the time {times[place + 1]:g} " + (f"for {times[place] + usual:g}" if rises else f"after {times[place]:g}")
    raise ReadingError(got, f"{'equally spaced' if rises else 'ascending'} times", lines[place + 1] if lines else 0)


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
            rises = np.ptp(times - first * count) <= np.ptp(times - second * count)
            low, high = (low, second) if rises else (first, high)
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
