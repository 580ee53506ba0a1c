"""ESM, ITACA and AFAD (DYNA): lines ``NAME: value``, any number of them, and a sample a line."""

from fpk_rocking.physics.forcing.readers import fields, headers
from fpk_rocking.physics.forcing.readers.components import Component, ReadingError

NAME = "ESM"


def recognized(lines: list[str]) -> bool:
    """Whether the header has what only this format has."""
    names = {line.partition(":")[0].strip() for line in lines[:100]}
    return len(names & {"EVENT_NAME", "EVENT_ID", "STATION_CODE", "NDATA", "SAMPLING_INTERVAL_S", "STREAM"}) >= 2


def components(lines: list[str]) -> list[Component]:
    """The component of a file."""
    begin = next((place for place, line in enumerate(lines) if fields.is_numeric(line)), len(lines))
    said = {name.strip(): value.strip() for name, _, value in (line.partition(":") for line in lines[:begin])}
    for name in ("SAMPLING_INTERVAL_S", "NDATA", "UNITS"):
        if not said.get(name):
            raise ReadingError(f"no line '{name}:' in the header", "a file of ESM")
    about = (said.get(name) for name in ("EVENT_NAME", "EVENT_DATE_YYYYMMDD", "STATION_CODE", "STATION_NAME"))
    quantity, peak = headers.quantity([said.get("DATA_TYPE", "")]), fields.number(said.get("PGA_CM/S^2"))
    samples, interval = fields.values(lines[begin:], said["NDATA"]), fields.seconds(said["SAMPLING_INTERVAL_S"])
    name, event = said.get("STREAM", ""), ", ".join(filter(None, about))
    return [Component(name, samples, interval, said["UNITS"], quantity, peak=peak, event=event)]
