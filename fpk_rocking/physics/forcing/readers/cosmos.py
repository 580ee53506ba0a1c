"""COSMOS V1.20: 13 lines of text, 100 integers, 100 reals, comments, and samples in a format that is stated."""

import re

from fpk_rocking.physics.forcing.readers import fields
from fpk_rocking.physics.forcing.readers.components import Component, quantity_of, unit_of

NAME = "COSMOS"

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
    found, begin = [], 0
    for place, line in enumerate(lines):
        data = _DATA.search(line)
        if data:
            end = next((k for k in range(place + 1, len(lines)) if not fields.is_numeric(lines[k])), len(lines))
            found.append(_component(lines[begin:place], data, lines[place + 1 : end]))
            begin = end + 1
    if not found:
        raise ValueError("got no line 'n ... pts, ..., units=...,Format=...', accepted: a COSMOS file with one")
    return found


def _component(heading, data, rows):
    """The channel below a heading."""
    place = next((k for k, line in enumerate(heading) if re.search(r"real-header values", line, re.I)), None)
    if place is None:
        raise ValueError("got a header without 'Real-header values', accepted: a COSMOS file with them")
    form = heading[place].rpartition("ormat")[2]
    end = next((k for k in range(place + 1, len(heading)) if not fields.is_numeric(heading[k])), len(heading))
    reals = fields.values(
        heading[place + 1 : end], int(fields.required("reals", heading[place : place + 1], r"^\s*(\d+)")), form
    )
    code = fields.stated(heading, r"<SCNL>[^.\s]*\.([^.\s]+)") or ""
    direction = fields.stated(heading, r"^\s*Sta Cha\w*\s*:?\s*\S+?:\s*(\S.*?)\s*\(") or ""
    samples = fields.values(rows, int(data[1]), data[4])
    interval, length = fields.seconds(f"{reals[_MILLISECONDS]:.12g}", 1e-3), reals[_LENGTH]
    if length > 0.0 and abs(len(samples) * interval - length) > 0.01 * length + 2.0 * interval:
        raise ValueError(f"got {len(samples)} samples at {interval:g} s, accepted: the {length:g} s that it states")
    quantity = quantity_of(data[2]) if "raw" not in data[2].lower() else "counts"
    return Component(
        " ".join(filter(None, (code, direction.removeprefix("Other")))),
        samples,
        interval,
        unit_of(data[3]) or data[3],
        quantity or "unknown quantity",
        peak=float(reals[_LARGEST]) if reals[_LARGEST] > -998.0 or reals[_LARGEST] < -1000.0 else None,
        event=fields.printable(heading[1].removeprefix("Record of ")),
    )
