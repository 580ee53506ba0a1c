"""What terms of headers and columns mean: units, quantities, directions."""

import re

UNITS = {"g": 9.80665, "m/s2": 1.0, "cm/s2": 0.01, "mm/s2": 1e-3, "mg": 9.80665e-3, "g/10": 0.980665}
UNITS |= {"%g": 9.80665e-2, "ft/s2": 0.3048, "in/s2": 0.0254}
"""Metres per second squared of a unit of acceleration."""

SECONDS = {"s": 1.0, "ms": 1e-3, "min": 60.0}
"""Seconds in a unit of time."""

_LENGTHS = {"cms": "cm", "feet": "ft", "foot": "ft", "inch": "in", "inches": "in"}
_UNIT = re.compile(
    r"(?P<length>mm|cms?|m|ft|feet|foot|in|inch(?:es)?)"
    r"(?:[/._·*(]*(?:(?P<squared>s/s|s\(?-?2|ss|ps2|s_2|s\*2)\)?|(?P<once>s|ps|s-1)))?"
)
_SHORT = {"gal": "cm/s2", "gals": "cm/s2", "percentg": "%g", "milli-g": "mg", "kine": "cm/s", "kines": "cm/s"}
_SHORT |= {"millis": "ms", "mins": "min", "minute": "min", "minutes": "min"}

_QUANTITIES = {
    "response spectrum": r"spectr|fourier|\bp?sa\b|\bpsv\b|\bperiods?\b|\bfreq",
    "acceleration": r"\bacc|acel|\bag?\b|\bath\b",
    "velocity": r"\bvel(?!\. de muestreo)|\bv\b(?= *[(\[])",
    "displacement": r"\bdis(?:p|\b)|\bdesp",
    "strain": r"strain",
    "stress": r"stress",
    "counts": r"\bcounts?\b",
}

_VERTICAL = re.compile(r"UP|DN|DOWN|DWN|V\d?|VER|VERT|VERTICAL|VRT|\d*UD\d?|U|Z|[A-Z]{2}Z\d{0,2}|400|401")
_DOWN = re.compile(r"DN|DOWN|DWN|401")
_HORIZONTAL = re.compile(r"[HXYLT]\d?|F[NP]|LONG\w*|TRAN\w*|(?:[A-Z]{2})?(?:N-?S|E-?W|[NE12])\d?")

SEISMOMETER = re.compile(r"[A-Z]H[NEZ123]")
"""SEED's name of a channel that records a velocity; of an accelerometer the second letter is N, L or G."""


def measured(text: str) -> tuple[str, str]:
    """(quantity, unit) that a text such as "cm/sec^2" means: a key of `UNITS`, `SECONDS`, or another; else ("", "")."""
    word = re.sub(r"\s+|\^|\*\*|[{}]", "", text.lower()).replace("²", "2").strip(".:,;'\"")
    word = re.sub(r"seconds?|secs?", "s", word)
    word = _SHORT.get(word, word)
    if word in UNITS or word in SECONDS:
        return "acceleration" if word in UNITS else "time", word
    match = _UNIT.fullmatch(word)
    if match:
        power = 2 if match["squared"] else 1 if match["once"] else 0
        length = _LENGTHS.get(match["length"], match["length"])
        return ("displacement", "velocity", "acceleration")[power], length + ("", "/s", "/s2")[power]
    return ("counts", word) if re.fullmatch(r"counts?|volts?|v|mv|digits?", word) else ("", "")


def unit_of(text: str) -> str | None:
    """Key of `UNITS` that a text means, or None."""
    quantity, unit = measured(text)
    return unit if quantity == "acceleration" else None


def quantity_of_unit(text: str) -> str:
    """The quantity other than an acceleration that a unit measures: "velocity", "displacement", "counts"; else ""."""
    quantity, _ = measured(text)
    return "" if quantity in ("acceleration", "time") else quantity


def quantity_of(text: str) -> str:
    """The quantity that words name: "acceleration", "velocity", ...; "" where none is named."""
    words = text.lower().replace("_", " ")
    return next((name for name, pattern in _QUANTITIES.items() if re.search(pattern, words)), "")


def is_vertical(name: str) -> bool:
    """Whether a component's name, such as "UP", "acc_UD (gal)" or "BHZ00", is that of a vertical one."""
    return any(map(_VERTICAL.fullmatch, _parts(name))) or _parts(name) == ["U", "D"]


def is_downward(name: str) -> bool:
    """Whether a component's name, such as "DWN", says that downwards is positive."""
    return any(map(_DOWN.fullmatch, _parts(name)))


def is_horizontal(name: str) -> bool:
    """Whether a component's name, such as "H1" or "FN", is that of a horizontal one."""
    return any(map(_HORIZONTAL.fullmatch, _parts(name)))


def _parts(name):
    """Words of a component's name in capitals, without what stands in brackets."""
    return re.findall(r"[A-Z0-9]+", re.sub(r"[(\[].*?[)\]]", " ", name.upper()))
