"""K-NET and KiK-net: 17 lines of header in two columns, and counts that its scale factor makes gal."""

import math
import re

from fpk_rocking.physics.forcing.readers import fields
from fpk_rocking.physics.forcing.readers.components import Component, unit_of

NAME = "K-NET"

_DIRECTIONS = {"1": "NS1", "2": "EW1", "3": "UD1", "4": "NS2", "5": "EW2", "6": "UD2"}


def recognized(lines: list[str]) -> bool:
    """Whether the header has a scale factor and a direction."""
    starts = [line[:12] for line in lines[:20]]
    return "Scale Factor" in starts and any(start.startswith("Dir.") for start in starts)


def components(lines: list[str]) -> list[Component]:
    """The component of a file; the samples keep the offset of the recorder."""
    end = next((number for number, line in enumerate(lines) if line.startswith("Memo")), 16)
    header = {line[:18].strip(): line[18:].strip() for line in lines[: end + 1]}
    factor = re.fullmatch(r"([\d.]+)\s*\((.*?)\)\s*/\s*([\d.]+)", header.get("Scale Factor", ""))
    if not factor:
        accepted = "one such as '3920(gal)/6182761'"
        raise ValueError(f"got the scale factor {header.get('Scale Factor', '')!r}, accepted: {accepted}")
    rate = re.match(r"[\d.]+", header.get("Sampling Freq(Hz)", ""))
    if not rate:
        raise ValueError("got a header without 'Sampling Freq(Hz)', accepted: one that states it")
    interval = 1.0 / fields.seconds(rate[0])
    lasts = fields.seconds(header.get("Duration Time(s)", "").rstrip("s") or "0")
    samples = fields.values(lines[end + 1 :], round(lasts / interval)) * (float(factor[1]) / float(factor[3]))
    direction = header.get("Dir.", "")
    name = _DIRECTIONS.get(direction, direction.replace("-", ""))
    unit = unit_of(factor[2]) or factor[2]
    notes = ["It is of a borehole, below the ground."] * (direction in ("1", "2", "3"))
    said = fields.number(header.get("Max. Acc. (gal)", ""))
    event = fields.printable(", ".join(filter(None, map(header.get, ("Origin Time", "Station Code")))))
    return [
        Component(
            name, samples, interval, unit, notes=tuple(notes), peak=None if math.isnan(said) else said, event=event
        )
    ]
