"""SHAKE91: blocks of a title, a line ``N = n DT = seconds``, and samples in g."""

import re

from fpk_rocking.physics.forcing.readers import fields, terms
from fpk_rocking.physics.forcing.readers.components import Component

NAME = "SHAKE91"

_HEADER = re.compile(
    rf"^\s*N\s*=\s*(\d+)\s+DT\s*=\s*({fields.NUMBER})\s+[AVD]?MAX\s*=\s*({fields.NUMBER})", re.IGNORECASE
)


def recognized(lines: list[str]) -> bool:
    """Whether the second line states N, DT and AMAX."""
    return len(lines) > 2 and bool(_HEADER.match(lines[1]))


def components(lines: list[str]) -> list[Component]:
    """The blocks of a file, one for each layer."""
    matches = [(place, match) for place, match in enumerate(map(_HEADER.match, lines)) if match]
    found, ends = [], [*(place - 1 for place, _ in matches[1:]), len(lines)]
    for (place, header), end in zip(matches, ends, strict=True):
        title = " ".join(lines[place - 1].split())
        name = title.partition(" - ")[0].replace("ACCE. TH AT ", "")
        quantity = "acceleration" if "ACCE" in title.upper() else terms.quantity_of(title) or "unknown quantity"
        samples, interval = fields.values(lines[place + 1 : end], header[1], "(8F10.6)"), fields.seconds(header[2])
        found.append(Component(name, samples, interval, "g", quantity, peak=float(header[3]), event=title))
    return found
