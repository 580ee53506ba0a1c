"""COSMOS V1.20: 13 lines of text, 100 integers, 100 reals, comments, and samples in a format that is stated."""

import math
import re

from fpk_rocking.physics.forcing.readers import fields, headers, terms
from fpk_rocking.physics.forcing.readers.components import Component, ReadingError

NAME = "COSMOS"

_REALS = re.compile(r"^\s*(\d+).*real-header values.*ormat(.*)", re.IGNORECASE)
_DATA = re.compile(
    r"^\s*(\d+)\s+(\S.*?)\s+pts.*?units\s*=\s*([^,(]+?)\s*\(\s*\d+\s*\)\s*,\s*format\s*=\s*(\(?[^)]*\)?)", re.IGNORECASE
)
_MILLISECONDS, _LENGTH, _LARGEST = 61, 62, 63
"""Places of the reals: interval of these samples (the raw record's is another), their length in s, the largest."""


def recognized(lines: list[str]) -> bool:
    """Whether the first line states the version of the format."""
    return bool(lines) and "(format v" in lines[0].lower()


def components(lines: list[str]) -> list[Component]:
    """The channels of a file."""
    found: list[Component] = []
    heading: list[str] = []
    reals = None
    for text, rows in fields.blocks(lines):
        heading += text
        head, data = _REALS.search(text[-1]), _DATA.search(text[-1])
        if head:
            reals = fields.values(rows, head[1], head[2])
        if data:
            if reals is None:
                raise ReadingError("a header without 'Real-header values'", "a COSMOS file with them")
            found.append(_component(heading, reals, data, rows))
            heading, reals = [], None
    if not found:
        raise ReadingError("no line 'n ... pts, ..., units=...,Format=...'", "a COSMOS file with one")
    return found


def _component(heading, reals, data, rows):
    """The channel below a heading."""
    code = headers.stated(heading, r"<SCNL>[^.\s]*\.([^.\s]+)") or ""
    direction = headers.stated(heading, r"^\s*Sta Cha\w*\s*:?\s*\S+?:\s*(\S.*?)\s*\(") or ""
    samples = fields.values(rows, data[1], data[4])
    interval, length = fields.seconds(f"{reals[_MILLISECONDS]:.12g}", 1e-3), reals[_LENGTH]
    if length > 0.0 and abs(len(samples) * interval - length) > 0.01 * length + 2.0 * interval:
        raise ReadingError(f"{len(samples)} samples at {interval:g} s", f"the {length:g} s that it states")
    quantity = "counts" if "raw" in data[2].lower() else terms.quantity_of(data[2]) or "unknown quantity"
    name, event = f"{code} {direction.removeprefix('Other')}".strip(), heading[1].removeprefix("Record of ")
    peak = float(reals[_LARGEST]) if abs(reals[_LARGEST] + 999.0) > 1.0 else math.nan
    return Component(name, samples, interval, data[3], quantity, peak=peak, event=event)
