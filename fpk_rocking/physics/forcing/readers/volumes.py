"""Volumes 1 and 2 of Caltech, as CSMIP, CESMD, USC, RENADIC and BHRC write them: texts, headers and data."""

import re

from fpk_rocking.physics.forcing.readers import fields, headers
from fpk_rocking.physics.forcing.readers.components import Component, ReadingError

NAME = "CSMIP volume"

_DATA = re.compile(r"^\s*(\d+)\s+(?:points of (acc|vel|dis)|(accelerogram) points)", re.IGNORECASE)
_CHANNEL = r"^\s*(?:chan(?:nel)?\s*\d+\s*:|comp\b)\s*(\S.*?)\s*(?:\s{2,}.*|\(.*|from\s*)?$"
_REAL_ROWS = 7
"""Rows of the 50 reals in the header of a volume 1."""


def recognized(lines: list[str]) -> bool:
    """Whether the first lines say a volume of accelerograms, and some line the number of points."""
    named = re.search("accelerogram|vol1ds|amplitude spectra", " ".join(lines[:3]), re.IGNORECASE)
    counted = r"no\. of points|points of acc|amplitude spectra"
    return bool(named) and any(re.search(counted, line, re.IGNORECASE) for line in lines[:60])


def components(lines: list[str]) -> list[Component]:
    """The accelerations of all channels."""
    if "spectra" in " ".join(lines[:2]).lower():
        raise ReadingError("response spectra (volume 3)", "the accelerogram, volume 1 or 2")
    found: list[Component] = []
    heading: list[str] = []
    blocks = [*fields.blocks(lines)]
    for (text, rows), (below, _) in zip(blocks, [*blocks[1:], ([""], [])], strict=True):
        heading += text
        data = _DATA.search(heading[-1])
        reals = next((place for place, row in enumerate(rows) if "." in row), len(rows)) + _REAL_ROWS
        if data and (data[2] or "acc").lower() == "acc":
            found.append(_series(heading, rows, data[1]))
        elif not data and len(rows) > reals and not _DATA.search(below[0]):
            found.append(_digitized(heading, rows[reals:]))
        elif not data:
            continue
        heading = []
    if not found:
        raise ReadingError("no block of accelerations", "a volume 1 or 2 with one")
    return found


def _series(heading, rows, count):
    """The channel whose last line above the data says what they are."""
    samples = fields.values(rows, count, heading[-1].rpartition("(")[2])
    return _channel(heading, samples, headers.interval(heading[-1:]), headers.unit(heading[-1:]))


def _digitized(heading, rows):
    """The channel of a volume 1: pairs of times and samples, or samples at a whole number in a second."""
    count = fields.integer(headers.required("the number of points", heading, r"no\. of points\s*=\s*(\d+)"))
    unit = headers.required("units", heading, r"units\b[^=]*?\bsec(?:onds)?\s+and\s+(\S+)").strip(".")
    if sum(len(fields.parted(word)) for word in " ".join(rows).split()) != count:
        pairs = fields.values(rows, 2 * count, "(10F7.3)", "times and samples")
        try:
            # Decimals of the times: three.
            interval = fields.interval_of(pairs[::2], [f"{time:.3f}" for time in pairs[::2]])
        except ReadingError as error:
            accepted = f"{error.accepted}, as a volume 2 has them: this volume 1 is as it was digitized"
            raise ReadingError(error.got, accepted) from None
        return _channel(heading, pairs[1::2], interval, unit)
    lasts = fields.seconds(headers.required("a duration", heading, rf"duration\s*=\s*({fields.NUMBER})"))
    each = round(count / lasts)
    if abs(count / lasts - each) > 1e-6 * each:
        raise ReadingError(f"{count} samples in {lasts:g} s", "a whole number of them in a second")
    return _channel(heading, fields.values(rows, count), 1.0 / each, unit)


def _channel(heading, samples, interval, unit):
    name, event = headers.stated(heading, _CHANNEL) or "", ", ".join(map(str.strip, heading[2:4]))
    return Component(name, samples, interval, unit, peak=headers.peak(heading), event=event)
