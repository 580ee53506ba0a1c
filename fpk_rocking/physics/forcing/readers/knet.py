"""K-NET and KiK-net: 17 lines of header in two columns, and counts that its scale factor makes gal."""

import re

from fpk_rocking.physics.forcing.readers import fields, headers
from fpk_rocking.physics.forcing.readers.components import Component, ReadingError

NAME = "K-NET"

_DIRECTIONS = {"1": "NS1", "2": "EW1", "3": "UD1", "4": "NS2", "5": "EW2", "6": "UD2"}


def recognized(lines: list[str]) -> bool:
    """Whether the header has a scale factor and a direction."""
    starts = [line[:12] for line in lines[:20]]
    return "Scale Factor" in starts and any(start.startswith("Dir.") for start in starts)


def components(lines: list[str]) -> list[Component]:
    """The component of a file; the samples keep the offset of the recorder."""
    end = next((number for number, line in enumerate(lines) if line.startswith("Memo")), 16)
    said = {line[:18].strip(): line[18:].strip() for line in lines[: end + 1]}
    factor = re.fullmatch(r"([\d.]+)\s*\((.*?)\)\s*/\s*([\d.]+)", said.get("Scale Factor", ""))
    if not factor:
        raise ReadingError(f"the scale factor {said.get('Scale Factor', '')!r}", "one such as '3920(gal)/6182761'")
    rate = headers.required("'Sampling Freq(Hz)'", lines[:20], r"^Sampling Freq\(Hz\)\s*([\d.]+)")
    interval = 1.0 / fields.seconds(rate)
    lasts = fields.seconds(said.get("Duration Time(s)", "").rstrip("s") or "0")
    samples = fields.values(lines[end + 1 :], round(lasts / interval)) * (float(factor[1]) / float(factor[3]))
    direction = said.get("Dir.", "")
    name, peak = _DIRECTIONS.get(direction, direction.replace("-", "")), fields.number(said.get("Max. Acc. (gal)"))
    notes = ("It is of a borehole, below the ground.",) * (direction in ("1", "2", "3"))
    event = ", ".join(filter(None, map(said.get, ("Origin Time", "Station Code"))))
    return [Component(name, samples, interval, factor[2], notes=notes, peak=peak, event=event)]
