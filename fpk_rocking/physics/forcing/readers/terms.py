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
_HORIZONTAL = re.compile(
    r"[HXYLT]\d?|F[NP]|LN|TR|LONG(?:IT\w*)?|TRAN(?:S|SV\w*)?|RADIAL|(?:[A-Z]{2})?(?:N-?S|E-?W|[NE12])\d?"
)
_TURNED = re.compile(r"[NS]\s?\d{1,2}\s?[EW]|\d{1,3}(?:\s?(?:DEG\w*|°))?|[NSEW]|N-?S|E-?W|U-?D")
_CODE, _CHANNEL = re.compile(r"(?!NS|EW|UD)[A-Z]{2}(?:[ZNE12]|N-?S|E-?W)\d*"), re.compile(r"[BCDEHLS][HLNG][ZNE12]\d*")
_END = re.compile(r"(.*?)\s*(\b(?:COMP(?:ONENT)?\b\W*\S+|\S+\s+COMP(?:ONENT)?\.?|LONGITUDINAL|TRANSVERSE|VERTICAL))")

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


def azimuth(name: str) -> float | None:
    """Degrees from north that the name of a component says; None where it says none."""
    words = re.sub(r"[(\[].*?[)\]]", " ", name.upper()).replace("_", " ")
    match = re.search(r"\b([NS])\s?(\d{1,2})\s?([EW])\b", words)
    if match:
        turned = 1.0 if (match[1] == "N") == (match[3] == "E") else -1.0
        return (180.0 * (match[1] == "S") + turned * float(match[2])) % 360.0
    match = re.search(r"^\s*(\d{1,3})\s*$|\b(\d{1,3})\s*(?:DEG|°)", words)
    if match and int(match[1] or match[2]) <= 360:
        return float(match[1] or match[2])
    # In a longer name these may be of a unit, or of another thing.
    if words.strip() in ("S", "W"):
        return 180.0 if words.strip() == "S" else 270.0
    letters = re.search(r"\b(?:[A-Z]{2})?(N-?S|E-?W|N|E)\d?\b", words)
    return None if not letters else 0.0 if letters[1][0] == "N" else 90.0


def is_component(text: str) -> bool:
    """Whether a text is the name of a component and nothing else, as "N09E", "TR", "acc_NS (gal)" or "UP"."""
    name = re.sub(r"[(\[].*?[)\]]", " ", text.upper()).replace("_", " ")
    name = re.sub(r"\b(?:ACC|COMP(?:ONENT)?)\b", " ", name).strip(" .:+")
    # Stations have codes of three letters too.
    if (_CODE.fullmatch(name) and not _CHANNEL.fullmatch(name)) or (name.isdigit() and int(name) > 360):
        return False
    return any(pattern.fullmatch(name) for pattern in (_VERTICAL, _HORIZONTAL, _TURNED))


def divided(event: str) -> tuple[str, str]:
    """What a text says of event and station, and the name of a component at its end, or "" for either.

    A bracket behind the name stays with the station, if it is no unit.
    """
    bracket = re.search(r"\s[(\[]([^()\[\]]*)[)\]]\s*$", event)
    text = (event[: bracket.start()] if bracket else event).rstrip()
    head, _, last = text.rpartition(",")
    name = last.strip()
    if not is_component(name):
        match = _END.fullmatch(name.upper())
        if not match or not is_component(match[2]):
            return event, ""
        head, name = text[: len(text) - len(match[2])], name[-len(match[2]) :]
    kept = bracket[0].rstrip() if bracket and measured(bracket[1]) == ("", "") else ""
    return head.rstrip(" ,") + kept, name


def _parts(name):
    """Words of a component's name in capitals, without what stands in brackets."""
    return re.findall(r"[A-Z0-9]+", re.sub(r"[(\[].*?[)\]]", " ", name.upper()))
