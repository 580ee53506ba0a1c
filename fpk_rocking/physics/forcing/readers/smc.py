"""SMC of the USGS: 11 lines of text, 48 integers, 50 reals, comments, and samples that run together."""

import re

from fpk_rocking.physics.forcing.readers import fields, headers
from fpk_rocking.physics.forcing.readers.components import Component, ReadingError

NAME = "SMC"


def recognized(lines: list[str]) -> bool:
    """Whether the first line states a kind of the format, and the second is a comment."""
    kinds = r"\s*\d +(?:(?:un)?corrected accelerogram|unknown|velocity|displacement|.*spectr)"
    return len(lines) > 27 and bool(re.match(kinds, lines[0], re.I)) and lines[1].startswith("*")


def components(lines: list[str]) -> list[Component]:
    """The component of a file."""
    kind = re.search("uncorrected|velocity|displacement|spectr|unknown", lines[0].lower())
    if kind and kind[0] == "uncorrected":
        raise ReadingError("an uncorrected record, whose times are unequal", "a corrected one (kind 2)")
    if kind and kind[0] != "unknown":
        got = kind[0].replace("spectr", "spectrum")
        raise ReadingError(f"a {got} (first line)", "a corrected accelerogram (kind 2)")
    integers = fields.values(lines[11:17], 48, "(8I10)", "integers").astype(int)
    rate = float(fields.values(lines[17:27], 50, "(5E15.7)", "reals")[1])
    inclination, azimuth, comments, count = integers[[12, 13, 15, 16]].tolist()
    begin = 27 + comments
    if any(not line.startswith("|") for line in lines[27:begin]):
        raise ReadingError(f"other lines than the {comments} comments that the header states", "as many")
    samples = fields.values(lines[begin:], count, "(8E10.4)")
    if not 1.0 <= rate < 1e5:
        raise ReadingError(f"the sampling rate {rate:g}", "samples in a second")
    name, vertical = f"{azimuth} Deg" if 0 <= azimuth <= 360 else "", inclination in (0, 180)
    name = "DOWN" if inclination == 180 else name
    # What a kind 0 is, is for the user to say.
    unit, quantity = ("", "") if kind else ("cm/s2", "acceleration")
    peak = headers.peak(lines[:11])
    return [Component(name, samples, 1.0 / rate, unit, quantity, vertical, peak=peak, event=lines[3])]
