"""Files of hazard curves: two columns, named or not, and the curves that OpenQuake exports."""

import csv
import re

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array
from fpk_rocking.physics.forcing.readers import columns, fields, terms
from fpk_rocking.physics.forcing.readers.components import ReadingError
from fpk_rocking.risk.motions import SPECTRAL, measure_of

UNITS = {
    "PGV": {"m/s": 1.0, "cm/s": 0.01, "mm/s": 0.001},
    "PGA": {unit.replace("2", "²"): terms.UNITS[unit] / terms.UNITS["g"] for unit in ("g", "m/s2", "cm/s2", "%g")},
}
"""Units in which files give an intensity, in that of its curve, which is the first."""


def units_of(measure: str) -> dict[str, float]:
    """Return the units in which files give a measure, of the kind of PGV or of PGA, as in `UNITS`."""
    return UNITS["PGV" if measure in ("PGV", "PFV") else "PGA"]


_EXAMPLES = "'PGA (g),annual rate', 'PGV (cm/s),return period (years)' or 'PGA (g),probability in 50 years'"

_QUANTITIES = {
    "return periods": r"period|\bt_?r\b|\brp\b",
    "probabilities": r"prob|poe",
    "annual rates": r"rate|freq|\bafe\b|lambda|λ|per year|1/y|annual",
}
"""What a second column is, by patterns of its name, the first that is found."""

_INTENSITY = re.compile(
    r"(?<![a-z])(?:(?P<PGA>pga|a_?g)|(?P<PGV>pgv)|(?P<PFA>pfa)|(?P<PFV>pfv)|im|iml|intensity)(?![a-z*])|"
    r"(?:peak )?(?:ground )?(?:(?P<acceleration>acceleration)|velocity)"
)
"""What the name of an intensity begins with."""

_SPECTRAL = r"spectral|(?<![a-z])p?s[av](?![a-z])"

_SA = re.compile(rf"(?<![a-z]){SPECTRAL}")

_UNIT = r"[(\[,_ ]\s*(?:in )?([a-z%][a-z0-9/^*²% .]*?)\s*[)\]]?$"

_TIME = r"([\d.]+)[ -]*(?:years?|yrs?|y|a)\b"

_USUAL = {0.63, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01}
"""Probabilities, most often in 50 years, that maps are drawn for."""

_MAPPED, _STRONGEST = 1.0 / 2500.0, {"PGA": 3.0, "PGV": 5.0}
"""An annual rate, and intensities in g and m/s that no map has at such rates: those of a column are in another unit."""

_IMPOSSIBLE = 20.0
"""Intensity in g and m/s that has never been recorded: a column with more is another one."""

_LISTED = 10
"""Sites of a file that a message lists."""


def read(text: str, site: str | int | None = None) -> tuple[Array, Array, str, str]:
    """Return intensities and annual rates (n,), measure and note of the text of a file, as `Hazard.from_csv` says."""
    lines = [line.strip() for line in text.splitlines()]
    said = [line.lstrip("# ") for line in lines if line.startswith("#")]
    plain, comments = [line for line in lines if line and not line.startswith("#")], " ".join(said)
    if plain and re.search(r"\bpoe-", plain[0]):
        return _of_openquake(comments, plain, site)
    if site is not None:
        raise ValueError(checks.refusal("site", site, "none, as the file has one site"))
    table = columns.parted(lines)
    for number, row in zip(table.numbers, table.rows, strict=True):
        # Of thousands, or with a decimal comma?
        parts = re.split(r"[;\s]+", lines[number - 1])
        if len(row) != 2 or (len(parts) > 1 and any(re.fullmatch(r"[1-9]\d{0,2},\d{3}", part) for part in parts)):
            raise ReadingError(repr(lines[number - 1]), "an intensity and a rate, two plain numbers", number)
    # A first line is never dropped; a comment may name the columns.
    heads = plain[: len(plain) - len(table.rows)]
    named = [_named(line, comments) for line in heads or said]
    for line, names in zip(heads, named, strict=False):
        if not names:
            accepted = f"two numbers, or two names as in {_EXAMPLES}"
            raise ReadingError(repr(line), accepted, lines.index(line) + 1)
    if not table.rows:
        raise ReadingError("no numbers", "lines of an intensity and a rate")
    values = fields.numbers([word for row in table.rows for word in row]).reshape(-1, 2)
    named = [names for names in named if names]
    if not named:
        _ask(values[:, 1], comments.lower())
        found = {name.upper() for name in re.findall(r"\bp[gf][av]\b", comments.lower())}
        found |= {measure_of(match[0]).name for match in _SA.finditer(comments.lower())}
        measure = found.pop() if len(found) == 1 else ""
        unit = next(iter(units_of(measure))) if measure else "the unit of the curve"
        note = f"Its file names no columns: they were read as {measure or 'an intensity'} in {unit}, and annual rates."
        return *values.T, measure, note
    first, quantity, years, factor, measure, unit = named[-1]
    intensity, values = values.T[:: 1 if first else -1]
    order = np.argsort(intensity, kind="stable")
    rates, left = _rates(quantity, factor * values[order], years)
    kept = ~np.isinf(rates)
    intensity, rates = intensity[order][kept], rates[kept]
    factor = units_of(measure)[unit] if unit else 1.0
    _refuse_intensities(intensity[rates >= _MAPPED], measure, unit, factor)
    own = next(iter(units_of(measure))) if measure else "the unit of the curve"
    note = f"The hazard's file gives {measure or 'an intensity'} in {unit or f'no unit, read in {own},'} and {quantity}"
    note += f" in {years:g} year{'s' * (years != 1.0)}" * (quantity == "probabilities")
    # Curves of probabilities end at exactly 1, which no rate does twice.
    several = (rates == 1.0).sum() > 1 or re.search(r"investigation_time|\b(?!1\b)\d+[ -]*(?:years|yrs?)\b", comments)
    asked = quantity == "annual rates" and rates.max() <= 1.0 and several
    note += f"{left}." + " Are they not probabilities in several years?" * bool(asked)
    return factor * intensity, rates, measure, note


def _refuse_intensities(often, measure, unit, factor):
    """Raise ReadingError for ascending intensities of such rates that are no `measure`, or in another unit."""
    largest = often[-1] if measure and often.size else 0.0
    got = f"{measure} in {unit or 'no unit'}, up to {largest:g} at {_MAPPED:g} a year"
    if not unit and largest > _STRONGEST.get(measure, 5.0):
        accepted = ", ".join(f"'{measure} ({unit})'" for unit in units_of(measure))
        raise ReadingError(got, f"its unit in the name of the column, {accepted}")
    if factor * largest > _IMPOSSIBLE:
        raise ReadingError(got, f"up to {_IMPOSSIBLE:g} g or m/s: are the columns exchanged, or is it another unit?")


def _named(line, comments):
    """(whether the intensity is first, quantity, years, factor, measure, unit) by two names; None without such."""
    names = columns.split_names(line.lower(), 2)
    found = []
    for name, other in (names, names[::-1]) if len(names) == 2 else ():
        match = (_SA if re.search(_SPECTRAL, name) else _INTENSITY).search(name)
        quantity = next((kind for kind, form in _QUANTITIES.items() if re.search(form, other)), "")
        if match and quantity:
            found.append((name == names[0], match, name[match.end() :], other, quantity))
    if len(found) != 1:
        return None
    first, match, rest, other, quantity = found[0]
    measure, unit = _measured(match, rest.replace("_per_", "/"))
    time, common = re.search(_TIME, other), re.search(r"investigation_time\s*[=:]\s*([\d.]+)", comments)
    years = float(time[1]) if time else 1.0 if "annual" in other else float(common[1]) if common else 0.0
    if quantity == "probabilities" and not years > 0.0:
        raise ReadingError(repr(line), "its time too, as in 'probability in 50 years'")
    return first, quantity, years, 0.01 if "%" in other else 1.0, measure, unit


def _measured(match, rest):
    """Measure and unit, empty where they are not known, by the `match` of a name and the `rest` of it."""
    measure = {"acceleration": "PGA", None: "PGV" if "velocity" in match[0] else ""}.get(
        match.lastgroup, match.lastgroup
    )
    measure = measure_of(match[0]).name if match.re is _SA else measure
    said = re.search(_UNIT, rest)
    if not said:
        return measure, ""
    unit = terms.measured(said[1])[1].replace("2", "²")
    units = {unit: kind for kind in ([measure] if measure else UNITS) for unit in units_of(kind)}
    if unit not in units:
        raise ValueError(checks.refusal("unit of the intensity", said[1], ", ".join(units)))
    return units[unit], unit


def _ask(values, comments):
    """Raise `ReadingError` for a column without a name that may be one of return periods or probabilities."""
    usual = {*values} <= _USUAL or {*np.round(values / 100.0, 9)} <= _USUAL
    periods = f"{_QUANTITIES['return periods']}|{_QUANTITIES['probabilities']}"
    doubts = {
        "while a comment speaks of return periods or probabilities": bool(re.search(periods, comments)),
        "that rise, as return periods do": values.size > 1 and (np.diff(values) > 0.0).all(),
        "of which maps are drawn as probabilities in 50 years": values.size > 1 and usual,
        f"from {values.max():.4g} down, as of probabilities in several years": (
            values.size > 1 and 0.5 <= values.max() <= 1.0
        ),
    }
    for doubt in (text for text, doubtful in doubts.items() if doubtful):
        got = f"{', '.join(f'{value:g}' for value in values[:3])}, ... in the second column, {doubt}"
        raise ReadingError(got, f"a first line that names the columns, as {_EXAMPLES}")


def _rates(quantity, values, years):
    """Return annual rates (n,), inf for a probability of 1, and what was left out, as the end of a sentence."""
    if quantity == "annual rates":
        return values, ""
    if quantity == "return periods":
        if not (values > 0.0).all():
            raise ValueError(checks.refusal("return period", float(values.min()), "years above 0"))
        return 1.0 / values, ""
    worst = float(values[np.argmax(np.abs(values - 0.5))])
    if not 0.0 <= worst <= 1.0:
        raise ValueError(checks.refusal("probability", worst, "0 to 1, or a name of the column with %"))
    with np.errstate(divide="ignore"):
        rates = -np.log1p(-values) / years
    certain = int((values == 1.0).sum())
    return rates, f"; those equal to 1 ({certain}) give no rate and are left out" * bool(certain)


def _of_openquake(comments, lines, site):
    """Return what `read` does of OpenQuake's hazard curves: a line of names, and one for each site."""
    says = dict(re.findall(r"""(\w+)\s*=\s*['"]?([^,'"]+)""", comments))
    measure, years, kind = (says.get(key, "nothing") for key in ("imt", "investigation_time", "kind"))
    if not (measure in UNITS or _SA.fullmatch(measure.lower())) or years == "nothing" or kind == "std":
        accepted = "imt='PGA', 'PGV' or 'SA(T)' and investigation_time in the comment, any kind but the deviation 'std'"
        got = f"imt={measure}, investigation_time={years}, kind={kind}"
        raise ValueError(checks.refusal("hazard curves of OpenQuake", got, accepted))
    table = [[entry.strip() for entry in row] for row in csv.reader(lines)]
    sites = [dict(zip(table[0], row, strict=False)) for row in table[1:]]
    if not sites or any(len(row) != len(table[0]) for row in table):
        raise ReadingError(f"{len(sites)} lines below the names", f"sites with {len(table[0])} columns each")
    places = [f"{row['lon']},{row['lat']}" for row in sites]
    chosen = _site(places, site)
    levels = {name: value for name, value in sites[chosen].items() if name.startswith("poe-")}
    rates, left = _rates("probabilities", np.array(list(levels.values()), float), float(years))
    kept, unit = ~np.isinf(rates), "cm/s" if measure == "PGV" else "g"
    intensity = units_of(measure)[unit] * np.array([float(name.removeprefix("poe-")) for name in levels])
    note = f"It is OpenQuake's {measure} at {places[chosen]}, from probabilities in {float(years):g} years{left}."
    return intensity[kept], rates[kept], measure_of(measure).name, note


def _site(places, site):
    """Return the number, from 0, of the `site` that was asked for among the `places`, texts of degrees."""
    if site is None and len(places) == 1:
        return 0
    asked = str(site).strip()
    if re.fullmatch(r"\d+", asked) and 1 <= int(asked) <= len(places):
        return int(asked) - 1
    if re.fullmatch(rf"{fields.NUMBER}\s*,\s*{fields.NUMBER}", asked):
        degrees = np.array([place.split(",") for place in [asked, *places]], float)
        away = np.abs(degrees[1:] - degrees[0]).max(axis=1)
        if away.min() < 0.01:
            return int(away.argmin())
    shown = "; ".join(f"{number}: {place}" for number, place in enumerate(places[:_LISTED], start=1))
    more = f"; ... {len(places)} in all" * (len(places) > _LISTED)
    raise ValueError(checks.refusal("site", site, f"'lon,lat' to .01°, or a number, of {shown}{more}"))
