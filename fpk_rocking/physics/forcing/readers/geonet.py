"""GeoNet's V1A and V2A: for each component 16 lines of text, 10 of numbers, and samples in fields of 8."""

import re

from fpk_rocking.physics.forcing.readers import fields, headers
from fpk_rocking.physics.forcing.readers.components import Component, ReadingError

NAME = "GeoNet"

_TEXTS, _HEADER = 16, 10

_PEAK = re.compile(rf"^acceleration:\s*peak\s+({fields.NUMBER})\s*(\S+)", re.IGNORECASE | re.MULTILINE)


def recognized(lines: list[str]) -> bool:
    """Whether the texts are those of a GeoNet file."""
    head = " ".join(lines[:_TEXTS]).lower()
    return all(words in head for words in ("corrected accelerogram", "number of points", "displacement", "rms"))


def components(lines: list[str]) -> list[Component]:
    """The accelerations of all components; a V2A file has velocities and displacements behind them."""
    found = []
    for texts, rows in fields.blocks([line.rstrip() for line in lines]):
        counts = fields.values(rows[3:4], 10)[3:6].astype(int).tolist()
        lines_of = [-(-count // 10) for count in counts]
        peak = _PEAK.search("\n".join(texts))
        if len(texts) != _TEXTS or len(rows) != _HEADER + sum(lines_of) or not peak:
            accepted = f"{_TEXTS} with the peak, and {_HEADER + sum(lines_of)} as the header states"
            raise ReadingError(f"{len(texts)} lines of text, {len(rows)} of numbers", accepted)
        samples = fields.values(rows[_HEADER : _HEADER + lines_of[0]], counts[0], "(10F8.3)")
        name, event = headers.stated(texts, r"^component\s+(\S+)") or "", ", ".join(texts[1:3])
        found.append(Component(name, samples, headers.interval(texts), peak[2], peak=float(peak[1]), event=event))
    return found
