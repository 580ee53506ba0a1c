"""ESM, ITACA and AFAD (DYNA): lines ``NAME: value``, any number of them, and a sample a line."""

import math

from fpk_rocking.physics.forcing.readers import fields
from fpk_rocking.physics.forcing.readers.components import Component, quantity_of, unit_of

NAME = "ESM"


def recognized(lines: list[str]) -> bool:
    """Whether the header has what only this format has."""
    names = {line.partition(":")[0].strip() for line in lines[:100]}
    return len(names & {"EVENT_NAME", "EVENT_ID", "STATION_CODE", "NDATA", "SAMPLING_INTERVAL_S", "STREAM"}) >= 2


def components(lines: list[str]) -> list[Component]:
    """The component of a file."""
    end = next((number for number, line in enumerate(lines) if fields.is_numeric(line)), len(lines))
    header = {
        name.strip(): value.strip() for name, colon, value in (line.partition(":") for line in lines[:end]) if colon
    }
    for name in ("SAMPLING_INTERVAL_S", "NDATA", "UNITS"):
        if not header.get(name):
            raise ValueError(f"got no line '{name}:' in the header, accepted: a file of ESM")
    if not header["NDATA"].isdecimal():
        raise ValueError(f"got NDATA: {header['NDATA']!r}, accepted: a number of samples")
    samples = fields.values(lines[end:], int(header["NDATA"]))
    quantity = quantity_of(header.get("DATA_TYPE", "")) or "acceleration"
    peak = fields.number(header.get("PGA_CM/S^2", ""))
    about = (header.get(name, "") for name in ("EVENT_NAME", "EVENT_DATE_YYYYMMDD", "STATION_CODE", "STATION_NAME"))
    return [
        Component(
            header.get("STREAM", ""),
            samples,
            fields.seconds(header["SAMPLING_INTERVAL_S"]),
            unit_of(header["UNITS"]) or header["UNITS"],
            quantity,
            peak=None if math.isnan(peak) else peak,
            event=fields.printable(", ".join(filter(None, about))),
        )
    ]
