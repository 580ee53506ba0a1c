"""Volumes 1 and 2 of Caltech, as CSMIP, CESMD, USC, RENADIC and BHRC write them: texts, headers and data."""

import re

from fpk_rocking.physics.forcing.readers import fields
from fpk_rocking.physics.forcing.readers.components import Component

NAME = "CSMIP volume"

_DATA = re.compile(r"^\s*(\d+)\s+(?:points of (acc|vel|dis)|(accelerogram) points)", re.IGNORECASE)
_CHANNEL = r"^\s*(?:chan(?:nel)?\s*\d+\s*:|comp\b)\s*(\S.*?)\s*(?:\s{2,}.*|\(.*|from\s*)?$"
_REAL_ROWS = 7
"""Rows of the 50 reals in the header of a volume 1."""


def recognized(lines: list[str]) -> bool:
    """Whether the first lines say a volume of accelerograms, and some line the number of points."""
    head = " ".join(lines[:3]).lower()
    named = "accelerogram" in head or "vol1ds" in head or "amplitude spectra" in head
    return named and any(
        re.search(r"no\. of points|points of acc|amplitude spectra", line, re.I) for line in lines[:60]
    )


def components(lines: list[str]) -> list[Component]:
    """The accelerations of all channels."""
    if "spectra" in " ".join(lines[:2]).lower():
        raise ValueError("got response spectra (volume 3), accepted: the accelerogram, volume 1 or 2")
    found: list[Component] = []
    heading: list[str] = []
    place = 0
    while place < len(lines):
        if not fields.is_numeric(lines[place]):
            # What a channel's end leaves behind is not of the next one.
            heading = [] if lines[place].startswith("/&") else [*heading, lines[place]]
            place += 1
            continue
        end = next((k for k in range(place, len(lines)) if not fields.is_numeric(lines[k])), len(lines))
        ahead = next(filter(str.strip, lines[end:]), "")
        component = _component(heading, lines[place:end], bool(_DATA.search(ahead)))
        if component:
            found.append(component)
            heading = []
        place = end
    if not found:
        raise ValueError("got no block of accelerations, accepted: a volume 1 or 2 with one")
    return found


def _component(heading, rows, headed):
    """The acceleration in rows below a heading; None for a velocity, a displacement, or a header of `headed` data."""
    data = _DATA.search(heading[-1]) if heading else None
    if data and (data[2] or "acc").lower() != "acc":
        return None
    name = fields.stated(heading, _CHANNEL) or ""
    event = fields.printable(", ".join(line.strip() for line in heading[2:4]))
    if data:
        samples = fields.values(rows, int(data[1]), heading[-1].rpartition("(")[2])
        rate = fields.stated(heading[-1:], r"at\s+(\d+)\s*pts/sec")
        interval = (
            1.0 / fields.seconds(rate)
            if rate
            else fields.seconds(fields.required("an interval", heading[-1:], rf"spaced at\s+({fields.NUMBER})\s*sec"))
        )
        unit = fields.unit_said([re.sub(r"^.*sec[.,]?\s+in\s+(?!unit)", "unit ", heading[-1], flags=re.IGNORECASE)])
        peak = fields.stated(heading, rf"peak acceleration\s*=\s*({fields.NUMBER})")
        return Component(name, samples, interval, unit, peak=float(peak) if peak else None, event=event)
    skipped = next((place for place, row in enumerate(rows) if "." in row), len(rows)) + _REAL_ROWS
    if headed or len(rows) <= skipped:
        return None
    count = int(fields.required("the number of points", heading, r"no\. of points\s*=\s*(\d+)"))
    said = fields.required("units", heading, r"units\b[^=]*?\bsec(?:onds)?\s+and\s+(\S+)").strip(".")
    rows = rows[skipped:]
    if sum(len(fields.parted(word)) for word in " ".join(rows).split()) != count:
        pairs = fields.values(rows, 2 * count, "(10F7.3)", "times and samples")
        times = pairs[::2]
        try:
            # Decimals of the times: three.
            interval = fields.interval_of(times, [f"{time:.3f}" for time in times])
        except ValueError as error:
            raise ValueError(f"{error}, as a volume 2 has them: this volume 1 is as it was digitized") from None
        return Component(name, pairs[1::2], interval, fields.unit_said([f"unit {said}"]), event=event)
    lasts = fields.seconds(fields.required("a duration", heading, rf"duration\s*=\s*({fields.NUMBER})"))
    each = count / lasts
    if abs(each - round(each)) > 1e-6 * each:
        raise ValueError(f"got {count} samples in {lasts:g} s, accepted: a whole number of them in a second")
    return Component(
        name, fields.values(rows, count), 1.0 / round(each), fields.unit_said([f"unit {said}"]), event=event
    )
