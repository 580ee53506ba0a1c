"""PEER: a line with ``NPTS= n, DT= seconds`` or ``n seconds NPTS, DT``, the lines before it, and samples in rows."""

import re

from fpk_rocking.physics.forcing.readers import fields, headers, terms
from fpk_rocking.physics.forcing.readers.components import Component

NAME = "PEER"

# The letter of an exponent may be Fortran's D here, so that what is refused is the number and not a part of it.
_HEADER = re.compile(
    r"NPTS\s*=\s*(\d+)\s*,?\s*DT\s*=\s*([-+.\dDE]+)|^\s*(\d+)\s+([-+.\dDE]+)\s+NPTS\s*,\s*DT", re.IGNORECASE
)
_SAYS = re.compile(r"\bunits?\b|\b(?:acc\w*|vel\w*|disp\w*)\s*(?:in\b|(?=[(\[]))", re.IGNORECASE)


def recognized(lines: list[str]) -> bool:
    """Whether one of the first lines states NPTS and DT."""
    return any(map(_HEADER.search, lines[:12]))


def components(lines: list[str]) -> list[Component]:
    """The component of a file."""
    place, match = next((place, match) for place, match in enumerate(map(_HEADER.search, lines)) if match)
    rows = lines[place + 1 :]
    # Some say where the data end.
    while rows and re.fullmatch(r"[\s*]*end\b[^\d]*|\s*", rows[-1], re.IGNORECASE):
        rows.pop()
    count, step = filter(None, match.groups())
    samples = fields.values(rows, count)
    head = [line for line in lines[:place] if line.strip()]
    title = head[1] if len(head) > 1 else ""
    words = re.sub(r"\(.*?\)", " ", title.rpartition(",")[2]).split()
    # A longer end is no name of a component, but its last word may be.
    name = " ".join(words) if len(words) <= 3 else words[-1] if terms.is_vertical(words[-1]) else ""
    said = [line for line in head if _SAYS.search(line)][-1:]
    return [Component(name, samples, fields.seconds(step), headers.unit(said), headers.quantity(said), event=title)]
