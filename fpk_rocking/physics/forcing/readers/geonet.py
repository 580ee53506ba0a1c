"""GeoNet's V1A and V2A: for each component 16 lines of text, 10 of numbers, and samples in fields of 8."""

import re

from fpk_rocking.physics.forcing.readers import fields
from fpk_rocking.physics.forcing.readers.components import Component, unit_of

NAME = "GeoNet"

_TEXTS, _HEADER, _FORM = 16, 10, "(10F8.3)"


def recognized(lines: list[str]) -> bool:
    """Whether the texts are those of a GeoNet file."""
    head = " ".join(lines[:_TEXTS]).lower()
    return "corrected accelerogram" in head and "number of points" in head and "displacement" in head and "rms" in head


def components(lines: list[str]) -> list[Component]:
    """The accelerations of all components; a V2A file has velocities and displacements behind them."""
    found, place = [], 0
    lines = [line.rstrip() for line in lines]
    while place < len(lines) and any(lines[place:]):
        texts, header = lines[place : place + _TEXTS], lines[place + _TEXTS : place + _TEXTS + _HEADER]
        place += _TEXTS + _HEADER
        if len(header) < _HEADER or not all(map(fields.is_numeric, header)) or any(map(fields.is_numeric, texts[:4])):
            raise ValueError(
                f"got other lines than 16 of text and 10 of numbers up to line {place}, accepted: GeoNet's"
            )
        count = int(fields.required("the number of points", texts, r"number of points\s+(\d+)"))
        counts = [int(number) for number in fields.values(header[3:4], 10)[3:6]]
        interval = fields.required(
            "an interval",
            texts,
            rf"intervals of\s+({fields.NUMBER})\s*s",
            rf"at\s+({fields.NUMBER})\s*sec\w* intervals",
        )
        peak = rf"acceleration:\s*peak\s+({fields.NUMBER})\s*(\S+)"
        match = next(filter(None, (re.search(peak, text, re.IGNORECASE) for text in texts)), None)
        if count != counts[0] or not match:
            raise ValueError(
                f"got {count} points in the text, {counts[0]} in the header, accepted: equal ones, and a peak"
            )
        rows = -(-count // 10)
        samples = fields.values(lines[place : place + rows], count, _FORM)
        name = fields.stated(texts, r"^component\s+(\S+)") or ""
        found.append(
            Component(
                name,
                samples,
                fields.seconds(interval),
                unit_of(match[2]) or match[2],
                peak=float(match[1]),
                event=fields.printable(", ".join(texts[1:3])),
            )
        )
        place += sum(-(-number // 10) for number in counts)
    return found
