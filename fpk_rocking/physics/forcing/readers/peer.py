"""PEER: a line with ``NPTS= n, DT= seconds`` or ``n seconds NPTS, DT``, the lines before it, and samples in rows."""

import re

from fpk_rocking.physics.forcing.readers import fields
from fpk_rocking.physics.forcing.readers.components import Component, is_vertical, quantity_of, unit_of

NAME = "PEER"

# The letter of an exponent may be Fortran's D here, so that what is refused is the number and not a part of it.
_HEADERS = (
    re.compile(r"NPTS\s*=\s*(\d+)\s*,?\s*DT\s*=\s*([-+.\dDE]+)", re.IGNORECASE),
    re.compile(r"^\s*(\d+)\s+([-+.\dDE]+)\s+NPTS\s*,\s*DT", re.IGNORECASE),
)
_UNITS = re.compile(r"\bunits?\b\s*(?:of|are|in|is|:|=)?\s*", re.IGNORECASE)
_IN = re.compile(r"\b(?:acc\w*|vel\w*|disp\w*)\s*(?:in\b|(?=[(\[]))", re.IGNORECASE)


def recognized(lines: list[str]) -> bool:
    """Whether one of the first lines states NPTS and DT."""
    return _header(lines)[1] is not None


def _header(lines):
    """(number, match) of the line that states count and interval."""
    for number, line in enumerate(lines[:12]):
        match = next(filter(None, (header.search(line) for header in _HEADERS)), None)
        if match:
            return number, match
    return 0, None


def components(lines: list[str]) -> list[Component]:
    """The component of a file."""
    number, match = _header(lines)
    rows = lines[number + 1 :]
    # Some say where the data end.
    while rows and re.fullmatch(r"[\s*]*end\b[^\d]*|\s*", rows[-1], re.IGNORECASE):
        rows.pop()
    samples = fields.values(rows, fields.integer(match[1]))
    head = [line for line in lines[:number] if line.strip()]
    title = head[1] if len(head) > 1 else ""
    words = re.sub(r"\(.*?\)", " ", title.rpartition(",")[2]).split()
    # A longer end is no name of a component, but its last word may be.
    name = " ".join(words) if len(words) <= 3 else words[-1] if is_vertical(words[-1]) else ""
    said = [line for line in head if _UNITS.search(line) or _IN.search(line)]
    unit = _unit(said[-1]) if said else ""
    quantity = next(filter(None, map(quantity_of, said[-1:])), "acceleration")
    event = fields.printable(title)
    return [Component(name, samples, fields.seconds(match[2]), unit, quantity, event=event)]


def _unit(line):
    """The unit that a line says."""
    words = (_UNITS if _UNITS.search(line) else _IN).split(line, maxsplit=1)[1].strip(" ([")
    word = re.split(r"[\s,;:()\[\]]+", words)[0].rstrip(".")
    return unit_of(word) or word
