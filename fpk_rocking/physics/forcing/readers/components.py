"""Components of a record file: their units and quantities, what speaks against one, and which one is read."""

import dataclasses
import math
import re
from collections.abc import Sequence

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array

MOST = 2**20
"""Most samples: 87 minutes at 200 Hz."""

UNITS = {"g": 9.80665, "m/s2": 1.0, "cm/s2": 0.01, "mm/s2": 1e-3, "mg": 9.80665e-3, "g/10": 0.980665}
UNITS |= {"%g": 9.80665e-2, "ft/s2": 0.3048, "in/s2": 0.0254}
"""Metres per second squared of a unit of acceleration."""

SECONDS = {"s": 1.0, "ms": 1e-3, "min": 60.0}
"""Seconds in a unit of time."""

ACCEPTED = "a horizontal acceleration of the base"

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

_AXES = {"N": 0.0, "NS": 0.0, "E": 90.0, "EW": 90.0}
"""Degrees from north of the directions that may be asked for whatever a file calls its components."""

SEISMOMETER = re.compile(r"[A-Z]H[NEZ123]")
"""SEED's name of a channel that records a velocity; of an accelerometer the second letter is N, L or G."""


class ReadingError(ValueError):
    """A file has what is not read: what was got, what is accepted, and the number of its line, or 0."""

    def __init__(self, got: str, accepted: str, line: int = 0):
        super().__init__(f"got {got}, accepted: {accepted}" + f" (line {line})" * (line > 0))
        self.got, self.accepted = got, accepted


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
    words = re.sub(r"[(\[].*?[)\]]", " ", name.upper())
    parts = re.split(r"[^A-Z0-9]+", words)
    return any(map(_VERTICAL.fullmatch, parts)) or words.strip() == "U-D"


@dataclasses.dataclass(frozen=True, eq=False)
class Component:
    """One component of a record file, as the file has it.

    Parameters
    ----------
    name : str
        As the file calls it, such as "360 Deg", "N08W" or "acc_EW (gal)"; "" where it does not.
    values : array_like
        Samples (n,), in `unit`.
    interval : float or None
        Seconds between them; None where the file does not say it.
    unit : str
        Key of `UNITS` in any spelling, or another text that the file says; "" where it says none.
    quantity : str
        "acceleration", or what else it is; "" for a column of unknown meaning, which is read only where it is asked
        for.
    vertical : bool
        Whether the file says so by more than the name.
    notes : tuple of str
        Sentences on what a user should know.
    peak : float
        Peak that the file states, in `unit`; nan where it states none.
    event : str
        Event, date and station; at most 200 characters that a terminal shows are kept.
    """

    name: str
    values: Array
    interval: float | None = None
    unit: str = ""
    quantity: str = "acceleration"
    vertical: bool = False
    notes: tuple[str, ...] = ()
    peak: float = math.nan
    event: str = ""

    def __post_init__(self):
        shown = "".join(letter if letter.isprintable() else " " for letter in self.event)
        checks.keep(self, unit=unit_of(self.unit) or self.unit, event=" ".join(shown.split())[:200])

    @property
    def azimuth(self) -> float | None:
        """Degrees from north that the name says; None where it says none, or the component is vertical."""
        words = re.sub(r"[(\[].*?[)\]]", " ", self.name.upper()).replace("_", " ")
        match = re.search(r"\b([NS])\s?(\d{1,2})\s?([EW])\b", words)
        if match:
            turned = 1.0 if (match[1] == "N") == (match[3] == "E") else -1.0
            return (180.0 * (match[1] == "S") + turned * float(match[2])) % 360.0
        match = re.search(r"^\s*(\d{1,3})\s*$|\b(\d{1,3})\s*(?:DEG|°)", words)
        if match and int(match[1] or match[2]) <= 360:
            return float(match[1] or match[2])
        letters = re.search(r"\b(?:[A-Z]{2})?(N-?S|E-?W|N|E)\d?\b", words)
        return None if not letters else 0.0 if letters[1][0] == "N" else 90.0

    @property
    def objection(self) -> ReadingError | None:
        """Why the component is not read; None where nothing speaks against it."""
        named, other = f" {self.name!r}" if self.name else "", quantity_of_unit(self.unit)
        if self.quantity not in ("acceleration", ""):
            return ReadingError(f"a {self.quantity}{named}".replace("a counts", "raw counts"), ACCEPTED)
        if self.vertical or is_vertical(self.name):
            return ReadingError(f"the vertical component{named}", "a horizontal one, as the base moves horizontally")
        if other:
            return ReadingError(f"the unit {self.unit!r} of a {other}{named}", f"an acceleration in {', '.join(UNITS)}")
        if self.unit and self.unit not in UNITS:
            return ReadingError(f"the unknown unit {self.unit!r}{named}", ", ".join(UNITS))
        return None

    @property
    def sentences(self) -> tuple[str, ...]:
        """The notes, and a stated peak that the samples do not have to a tenth, with or without their mean."""
        found, stated = [float(np.abs(self.values - mean).max()) for mean in (0.0, self.values.mean())], abs(self.peak)
        if math.isnan(stated) or any(abs(stated - peak) <= 0.1 * peak + 1e-3 for peak in found):
            return self.notes
        return (*self.notes, f"The file states a peak of {stated:g}, its samples have {found[0]:.4g}.")

    @property
    def description(self) -> str:
        """Name, azimuth and peak of the component, or why it is not read, as a text."""
        azimuth = "" if self.azimuth is None else f", {self.azimuth:g}°"
        text = f"peak {np.abs(self.values).max():.4g} {self.unit or '(unit not said)'}{azimuth}"
        return f"{self.name or 'no name'} ({f'not read: {self.objection.got}' if self.objection else text})"


def chosen(components: Sequence[Component], wanted: str | int | None, *, if_several: bool = False) -> Component:
    """The component with a name or a number from 1, or the only one that can be read; else `ReadingError`.

    With `if_several` what is wanted counts only where more than one can be read.
    """
    usable = [component for component in components if component.quantity and not component.objection]
    listed = "; ".join(f"{number} {component.description}" for number, component in enumerate(components, 1))
    if wanted is None or (if_several and len(usable) == 1):
        if len(usable) == 1:
            return usable[0]
        objections = [component.objection for component in components]
        if objections[0] and all(objections):
            more = f"; the file has: {listed}" * (len(components) > 1)
            raise ReadingError(objections[0].got, objections[0].accepted + more)
        got = f"{len(components)} components" if len(components) > 1 else "a column whose name says no acceleration"
        raise ReadingError(got, f"one of them by component (in a shell --component), its name or its number: {listed}")
    component = _named(components, wanted)
    if component is None:
        raise ReadingError(f"the component {wanted!r}", f"a name or a number of {listed}")
    if component.objection:
        raise component.objection
    return component


def _named(components, wanted):
    """The component that a name or a number means; None where it means none, or several."""
    text = str(wanted).strip()
    if re.fullmatch(r"\d+", text) and 1 <= int(text) <= len(components):
        return components[int(text) - 1]
    name = _letters(text)
    found = [one for one in components if _letters(one.name) == name] or [
        one for one in components if name in map(_letters, re.split(r"[\s_()\[\],;:/]+", one.name))
    ]
    if not found and name in _AXES:
        # Archives write one direction as N-S, N00E, 360 Deg or N(+), and one option serves for all of them.
        lying = [(one, one.azimuth) for one in components if not one.objection]
        found = [one for one, azimuth in lying if azimuth is not None and azimuth % 180.0 == _AXES[name]]
    return found[0] if name and len(found) == 1 else None


def _letters(text):
    """Letters and digits of a text, in capitals."""
    return re.sub(r"[^A-Z0-9]", "", text.upper())
