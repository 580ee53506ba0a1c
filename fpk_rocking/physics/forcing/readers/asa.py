"""ASA 2.0 of Mexico: a header in Spanish, and a column for each channel."""

from fpk_rocking.physics.forcing.readers import fields, headers
from fpk_rocking.physics.forcing.readers.components import Component, ReadingError

NAME = "ASA 2.0"

_KEYS = "ORIENTACION", r"NUM\. TOTAL DE MUESTRAS", "INTERVALO DE MUESTREO", r"ACEL\. MAX\. ?\(Gal\)"
"""Lines with an entry for each channel, apart by slashes: names, counts, intervals, peaks."""


def recognized(lines: list[str]) -> bool:
    """Whether one of the first lines is the title of the format."""
    return any("ARCHIVO ESTANDAR DE ACELERACION" in line.upper() for line in lines[:20])


def components(lines: list[str]) -> list[Component]:
    """The channels of a file."""
    begin = len(lines)
    while begin and (fields.is_numeric(lines[begin - 1]) or not lines[begin - 1].strip()):
        begin -= 1
    header = lines[:begin]

    def said(key):
        return headers.stated(header, rf"^\s*{key}[^:]*:\s*(\S.*?)\s*$") or ""

    rows = [said(rf"{key}.*?C1-C6").strip("/ ").split("/") for key in _KEYS]
    names, counts, intervals, peaks = ([entry.strip() for entry in row] for row in rows)
    if not len(names) == len(counts) == len(intervals) == len(peaks) or set(counts) != {counts[0]}:
        raise ReadingError(f"{len(names)} orientations, counts {counts}", "a count for each, all equal")
    above = next((line.split() for line in reversed(header) if line.strip("-+ \t")), [])
    if above != names:
        raise ReadingError(f"the columns {above}", f"{names} as its line ORIENTACION states")
    form = headers.stated(header, r"FORMATO (?:DE )?(?:LOS )?DATOS.*?:\s*(\S+)") or ""
    unit = headers.unit([f"unit {said('UNIDADES DE LOS DATOS')}"])
    event = f"{said('FECHA DEL SISMO')}, {said('CLAVE DE LA ESTACION')}"
    table = fields.values(lines[begin:], fields.integer(counts[0]) * len(names), form).reshape(-1, len(names))
    return [
        Component(name, column, fields.seconds(step), unit, peak=fields.number(peak), event=event)
        for name, column, step, peak in zip(names, table.T, intervals, peaks, strict=True)
    ]
