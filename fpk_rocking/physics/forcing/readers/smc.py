"""SMC of the USGS: 11 lines of text, 48 integers, 50 reals, comments, and samples that run together."""

import re

from fpk_rocking.physics.forcing.readers import fields
from fpk_rocking.physics.forcing.readers.components import Component

NAME = "SMC"

_TEXTS, _INTEGERS, _REALS = 11, 6, 10


def recognized(lines: list[str]) -> bool:
    """Whether the first line states a kind of the format, and the second is a comment."""
    kinds = r"\s*[1-9] +(un)?corrected accelerogram|\s*[1-9] +(velocity|displacement|.*spectr)"
    return (
        len(lines) > _TEXTS + _INTEGERS + _REALS and bool(re.match(kinds, lines[0], re.I)) and lines[1].startswith("*")
    )


def components(lines: list[str]) -> list[Component]:
    """The component of a file."""
    kind = lines[0].lower()
    if "uncorrected" in kind:
        raise ValueError("got an uncorrected record, whose times are unequal, accepted: a corrected one (kind 2)")
    quantity = next((name for name in ("velocity", "displacement") if name in kind), "")
    if quantity or "spectr" in kind:
        raise ValueError(f"got a {quantity or 'spectrum'} (first line), accepted: a corrected accelerogram (kind 2)")
    end = _TEXTS + _INTEGERS
    integers = fields.values(lines[_TEXTS:end], 48, "(8I10)", "integers").astype(int)
    reals = fields.values(lines[end : end + _REALS], 50, "(5E15.7)", "reals")
    inclination, azimuth, comments, count = integers[[12, 13, 15, 16]]
    begin = end + _REALS + int(comments)
    if any(not line.startswith("|") for line in lines[end + _REALS : begin]):
        raise ValueError(f"got other lines than the {comments} comments that the header states, accepted: as many")
    samples = fields.values(lines[begin:], int(count), "(8E10.4)")
    rate = float(reals[1])
    if not 1.0 <= rate < 1e5:
        raise ValueError(f"got the sampling rate {rate:g}, accepted: samples in a second")
    peak = fields.stated(lines[:_TEXTS], rf"\bpk\s*(?:acc)?\s*=\s*({fields.NUMBER})")
    return [
        Component(
            f"{azimuth} Deg" if 0 <= azimuth <= 360 else "",
            samples,
            1.0 / rate,
            "cm/s2",
            vertical=int(inclination) in (0, 180),
            peak=None if peak is None else float(peak),
            event=fields.printable(lines[3]),
        )
    ]
