"""ASA 2.0 of Mexico: a header in Spanish, and a column for each channel."""

import re

from fpk_rocking.physics.forcing.readers import fields
from fpk_rocking.physics.forcing.readers.components import Component

NAME = "ASA 2.0"


def recognized(lines: list[str]) -> bool:
    """Whether one of the first lines is the title of the format."""
    return any("ARCHIVO ESTANDAR DE ACELERACION" in line.upper() for line in lines[:20])


def components(lines: list[str]) -> list[Component]:
    """The channels of a file."""
    begin = len(lines)
    while begin and (fields.is_numeric(lines[begin - 1]) or not lines[begin - 1].strip()):
        begin -= 1
    header = lines[:begin]
    names = _of_channels(header, r"ORIENTACION C1-C6")
    counts = [int(text) for text in _of_channels(header, r"NUM\. TOTAL DE MUESTRAS, C1-C6")]
    intervals = [fields.seconds(text) for text in _of_channels(header, r"INTERVALO DE MUESTREO, C1-C6")]
    peaks = [float(text) for text in _of_channels(header, r"ACEL\. MAX\. ?\(Gal\), C1-C6")]
    unit = fields.unit_said(line for line in header if "UNIDADES DE LOS DATOS" in line.upper())
    if not len(names) == len(counts) == len(intervals) == len(peaks) or set(counts) != {counts[0]}:
        raise ValueError(f"got {len(names)} orientations, counts {counts}, accepted: a count for each, all equal")
    above = next((line.split() for line in reversed(header) if line.strip("-+ \t")), [])
    if above != names:
        raise ValueError(f"got the columns {above}, accepted: {names} as its line ORIENTACION states")
    form = fields.stated(header, r"FORMATO (?:DE )?(?:LOS )?DATOS.*?:\s*(\S+)") or ""
    table = fields.values(lines[begin:], counts[0] * len(names), form).reshape(-1, len(names))
    event = fields.printable(", ".join(_after(header, key) for key in ("FECHA DEL SISMO", "CLAVE DE LA ESTACION")))
    return [
        Component(name, table[:, place], intervals[place], unit, peak=peaks[place], event=event)
        for place, name in enumerate(names)
    ]


def _after(header, key):
    """What stands behind the colon of the line that begins with a key."""
    return next((line.partition(":")[2].strip() for line in header if re.match(key, line.strip(), re.I)), "")


def _of_channels(header, key):
    """Entries, apart by slashes, of the line that begins with a key; ValueError without one."""
    text = _after(header, key)
    entries = [entry.strip() for entry in text.strip("/ ").split("/")]
    if not all(entries):
        raise ValueError(f"got no line {key!r} with an entry for each channel, accepted: a file with one")
    return entries
