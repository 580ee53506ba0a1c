"""What headers state, in the words of archives and of people: one grammar of patterns for all readers."""

import math
import re
from collections.abc import Sequence
from typing import Any

from fpk_rocking.physics.forcing.readers import fields, terms
from fpk_rocking.physics.forcing.readers.components import ReadingError

_N = fields.NUMBER
_STEP = (
    r"(?:\bdt|\bdelta ?t|\btime (?:step|increment|interval)|\bsampl\w* (?:interval|period|step)|\bintervals? of|"
    r"spaced at)"
)
_INTERVALS = (
    rf"{_STEP}\b\s*((?:[(\[]\w+[)\]])?\s*[=:]?\s*{_N} ?[a-z]*)",
    rf"equal spacing of ({_N} ?[a-z]*)",
    rf"\bat\s+({_N} ?[a-z]*) intervals",
)
_RATES = (
    rf"\bsampl\w* ?(?:rate|freq\w*)\s*(?:[(\[]?\s*hz[)\]]?)?\s*[=:]?\s*({_N})",
    rf"\b(?:samples? per second|fs)\s*[=:]\s*({_N})",
    r"\bat\s+(\d+)\s*pts/sec",
)
_WORDS = r"\b(?:npts?|ndata|nsamples|n|num(?:ber)?\.? of (?:points|data|samples|values)|no\.? of (?:points|data))"
_COUNTS = rf"{_WORDS}\s*[=:]\s*(\d+)(?![\d.])", r"^\s*(\d+) (?:data )?points\b"
_NAMES = (r"^\s*(?:comp(?:onent)?\.?|orientation|channel|direction|azimuth)\s*[=:.]?\s+[=:]?\s*(\S.*?)\s*$",)
_PEAK = r"(?:pga|peak value|peak acc\w*|pk(?: +acc)?|max\. ?acc\w*\.?)"
_PEAKS = (rf"\b{_PEAK}\s*(?:[(\[].*?[)\]])?\s*[=:]\s*({_N})",)


def stated(lines: Sequence[str], *patterns: str) -> str | None:
    """First group of the first pattern that lines have, or None; `ReadingError` where they have it in two values."""
    for pattern in patterns:
        found = dict.fromkeys(match for line in lines for match in re.findall(pattern, line, re.IGNORECASE))
        firsts = {text: re.match(rf"(?:[(\[]\w+[)\]])?[\s=:]*({_N})", text) for text in found}
        distinct = {fields.number(first[1]) if first else text for text, first in firsts.items()}
        if len(distinct) > 1:
            raise ReadingError(f"a header with {' and '.join(map(repr, found))} for one thing", "one of them")
        if found:
            return next(iter(found))
    return None


def required(what: str, lines: Sequence[str], *patterns: str) -> str:
    """As `stated`; `ReadingError` where the lines have none of the patterns."""
    found = stated(lines, *patterns)
    if found is None:
        raise ReadingError(f"a header without {what}", "one that states it")
    return found


def agreed(what: str, first: Any, second: Any) -> Any:
    """The one of two that is stated, or both where they are equal; else `ReadingError`."""
    if first is not None and not math.isclose(float(first), float(second), rel_tol=1e-6):
        raise ReadingError(f"a header with {first} and {second} as {what}", "one of them")
    return second


def count(lines: Sequence[str]) -> int | None:
    """Number of samples that a header states, or None."""
    found = stated(lines, *_COUNTS)
    return None if found is None else fields.integer(found)


def name(lines: Sequence[str]) -> str:
    """Name of the component that a header states, or ""."""
    return stated(lines, *_NAMES) or ""


def interval(lines: Sequence[str]) -> float | None:
    """Interval that a header states, seconds, or None."""
    text, rate, found = stated(lines, *_INTERVALS), stated(lines, *_RATES), None
    if text:
        form = rf"(?:[(\[](\w+)[)\]])?\s*[=:]?\s*({_N}) ?([a-z]*)"
        bracket, value, word = re.findall(form, text, re.IGNORECASE)[0]
        unit = terms.measured(bracket or word)[1]
        if bracket and unit not in terms.SECONDS:
            raise ReadingError(f"an interval in {bracket!r}", ", ".join(terms.SECONDS))
        found = fields.seconds(value, terms.SECONDS.get(unit, 1.0))
    return agreed("an interval", found, 1.0 / fields.seconds(rate)) if rate else found


def unit(lines: Sequence[str]) -> str:
    """Unit that a header says: key of `UNITS`, unit of another quantity, or what stands after "unit"; "" for none."""
    near: list[str] = []
    said: dict[str, None] = {}
    for line in lines:
        near += re.findall(r"(?:accel\w*|\bacc|\bpga)\b[^(\[:=]*[(\[]([^)\]]+)[)\]]", line, re.IGNORECASE)
        near += re.findall(r"accel\w* (?:time (?:series|history) )?in (\S+)", line, re.IGNORECASE)
        near += re.findall(r"[^\s,;:()\[\]=]+/[^\s,;:()\[\]=]+", line)
        match = re.search(r"(?:\b[Uu]|(?<=[a-z])U)nits?\b|UNITS?\b|UNIDADES", line)
        rest = re.sub(r"1\.0* (?=mm)", "", line[match.end() :]) if match else ""
        words = [word.strip(".:") for word in re.findall(r"[^\s,;()\[\]=]+", rest)]
        known = [terms.unit_of(word) or word for word in words if terms.unit_of(word) or terms.quantity_of_unit(word)]
        known = [word for word in known if word.lower() not in ("in", "m", "v")] or known
        other = [word for word in words if word.lower() not in ("of", "are", "is", "in", "the", "de", "los", "datos")]
        said |= dict.fromkeys(word[:40] for word in (known or other)[:1])
    found = list(dict.fromkeys([*filter(None, map(terms.unit_of, near)), *filter(None, said)]))
    if len(found) > 1:
        raise ReadingError(f"a header with the units {' and '.join(found)}", "one of them")
    return found[0] if found else ""


def quantity(lines: Sequence[str]) -> str:
    """What a header says that the numbers are; "acceleration" where it does not."""
    text = " ".join(lines)
    if re.search(r"(response|fourier|amplitude) spectr|spectral accel", text, re.IGNORECASE):
        return "response spectrum"
    if re.search(r"\bacc|acel", text, re.IGNORECASE):
        return "acceleration"
    # Of a filter and of the sampling are frequencies and periods that a header has.
    return terms.quantity_of(re.sub(r"\ba\b|freq\w*|period\w*", " ", text, flags=re.IGNORECASE)) or "acceleration"


def peak(lines: Sequence[str]) -> float:
    """Peak that a header states; nan where it does not."""
    return fields.number(stated(lines, *_PEAKS))
