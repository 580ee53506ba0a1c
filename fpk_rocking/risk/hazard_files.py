"""Files of hazard curves: two columns, named or not, and the curves that OpenQuake exports."""

import re

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array
from fpk_rocking.physics.forcing.readers import components

UNITS = {
    "PGV": {"m/s": 1.0, "cm/s": 0.01, "mm/s": 0.001},
    "PGA": {
        unit.replace("2", "²"): components.UNITS[unit] / components.UNITS["g"] for unit in ("g", "m/s2", "cm/s2", "%g")
    },
}
"""Units in which files give an intensity, in that of its curve, which is the first."""

_EXAMPLES = "'PGA (g),annual rate', 'PGV (cm/s),return period (years)' or 'PGA (g),probability in 50 years'"

_QUANTITIES = {
    "return periods": r"period|\bt_?r\b|\brp\b",
    "probabilities": r"prob|poe",
    "annual rates": r"rate|freq|\bafe\b|lambda|λ|per year|1/y|annual",
}
"""What a second column is, by patterns of its name, the first that is found."""

_INTENSITY = r"(?<![a-z])(pga|pgv|im|iml|intensity|a_?g)(?![a-z])|(?:peak )?(?:ground )?(acceleration|velocity)"

_MEASURES = {"pga": "PGA", "acceleration": "PGA", "ag": "PGA", "a_g": "PGA", "pgv": "PGV", "velocity": "PGV"}

_SPECTRAL = r"spectral|(?<![a-z])s[av](?![a-z])"

_UNIT = r"[(\[,_ ]\s*(?:in )?([a-z%][a-z0-9/^*²% .]*?)\s*[)\]]?$"

_TIME = r"([\d.]+)[ -]*(?:years?|yrs?|y|a)\b"

_VELOCITIES = {"kine": "cm/s", "mps": "m/s", "cmps": "cm/s"}

_USUAL = {0.63, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01}
"""Probabilities, most often in 50 years, that maps are drawn for."""

_MAPPED, _STRONGEST = 1.0 / 2500.0, {"PGA": 3.0, "PGV": 5.0}
"""An annual rate, and intensities in g and m/s that no map has at such rates: those of a column are in another unit."""

_LISTED = 10
"""Sites of a file that a message lists."""


def read(text: str, site: str | int | None = None) -> tuple[Array, Array, str, str]:
    """Return intensities and annual rates (n,), measure and note of the text of a file, as `Hazard.from_csv` says."""
    lines = [(number, line.strip()) for number, line in enumerate(text.splitlines(), start=1) if line.strip()]
    heads = [(number, line.lstrip("# ")) for number, line in lines if line.startswith("#")]
    comments = " ".join(line for _, line in heads)
    lines = [(number, line) for number, line in lines if not line.startswith("#")]
    if lines and re.search(r"\bpoe-", lines[0][1]):
        return _of_openquake(comments, lines, site)
    if site is not None:
        raise ValueError(checks.refusal("site", site, "none, as the file has one site"))
    if not lines:
        raise ValueError("got no numbers, accepted: lines of an intensity and a rate")
    if _numbers(lines[0][1]) is None:
        heads, lines = [lines[0]], lines[1:]
    else:
        heads = [head for head in heads if all(_columns(head[1])[1]) or all(_columns(head[1])[2])]
    names = _named(comments, *heads[-1]) if heads else None
    rows = [_numbers(line) for _, line in lines]
    for (number, line), row in zip(lines, rows, strict=True):
        if row is None:
            raise ValueError(f", line {number}: got {line!r}, accepted: an intensity and a rate, two plain numbers")
    columns = np.array(rows, float).reshape(-1, 2).T
    if names is None:
        _ask(columns[1], comments.lower())
        said = {measure for measure in UNITS if re.search(rf"\b{measure}\b", comments, re.IGNORECASE)}
        measure = said.pop() if len(said) == 1 else ""
        note = f"Its file names no columns: they were read as {measure or 'an intensity'} in "
        note += f"{next(iter(UNITS[measure])) if measure else 'the unit of the curve'}, and annual rates."
        return *columns, measure, note
    first, quantity, time, factor, measure, unit = names
    intensity, values = columns[:: 1 if first else -1]
    order = np.argsort(intensity, kind="stable")
    own, stated = next(iter(UNITS.get(measure, ["the unit of the curve"]))), unit or "no unit"
    rates, left = _rates(quantity, factor * values[order], time)
    kept = ~np.isinf(rates)
    scale = UNITS[measure][unit] if unit else 1.0
    often = intensity[order][kept & (rates >= _MAPPED)]
    if measure and not unit and often.size and often[-1] > _STRONGEST[measure]:
        accepted = ", ".join(f"'{measure} ({unit})'" for unit in UNITS[measure])
        got = f"{measure} in no unit, up to {often[-1]:g} at {_MAPPED:g} a year"
        raise ValueError(f"got {got}, accepted: its unit in the name of the column, {accepted}")
    note = f"Its file gives {measure or 'an intensity'} in {stated}{f', read in {own},' * (not unit)} and {quantity}"
    note += f" in {time:g} year{'s' * (time != 1.0)}" * (quantity == "probabilities")
    return scale * intensity[order][kept], rates[kept], measure, f"{note}{left}."


def _numbers(line):
    """Return the two numbers of a line, or None; commas are decimal where other signs part the columns."""
    for sign in (";", "\t", ",", None):
        parts = [part.strip() for part in line.split(sign)]
        if len(parts) != 2:
            continue
        if sign != ",":
            if any(re.fullmatch(r"[1-9]\d{0,2},\d{3}", part) for part in parts):
                return None  # Thousands, or a decimal comma?
            parts = [part.replace(",", ".") if part.count(",") == 1 and "." not in part else part for part in parts]
        try:
            return float(parts[0]), float(parts[1])
        except ValueError:
            continue
    return None


def _columns(line):
    """Return the two names of a line, and as pairs what intensity and quantity they are, in this order and the other.

    A quantity is empty, and an intensity None, where the names are not such.
    """
    names = next((parts for sign in (";", "\t", ",", None) if len(parts := line.lower().split(sign)) == 2), ("", ""))
    kinds = [next((kind for kind, form in _QUANTITIES.items() if re.search(form, name)), "") for name in names]
    found = [None if re.search(_SPECTRAL, name) else re.search(_INTENSITY, name) for name in names]
    return names, (found[0], kinds[1]), (found[1], kinds[0])


def _named(comments, number, line):
    """Return whether the intensity comes first, quantity, time, factor, measure and unit by the names of columns."""
    names, *orders = _columns(line)
    first = all(orders[0])
    match, quantity = orders[not first]
    name, other = names if first else names[::-1]
    if all(orders[0]) == all(orders[1]):
        raise ValueError(f", line {number}: got {line!r}, accepted: two numbers, or two names as in {_EXAMPLES}")
    measure, unit = _measured(number, match, name[match.end() :].replace("_per_", "/"))
    time, common = re.search(_TIME, other), re.search(r"investigation_time\s*[=:]\s*([\d.]+)", comments)
    years = float(time[1]) if time else 1.0 if "annual" in other else float(common[1]) if common else 0.0
    if quantity == "probabilities" and not years > 0.0:
        raise ValueError(f", line {number}: got {line!r}, accepted: its time too, as in 'probability in 50 years'")
    return first, quantity, years, 0.01 if "%" in other else 1.0, measure, unit


def _measured(number, match, rest):
    """Return measure and unit, empty where they are not known, by the `match` of a name and the `rest` of it."""
    measure = _MEASURES.get(match[1] or match[2], "")
    said = re.search(_UNIT, rest)
    if not said:
        return measure, ""
    velocity = said[1].replace(" ", "").replace("sec", "s")
    unit = (components.unit_of(said[1]) or "").replace("2", "²") or _VELOCITIES.get(velocity, velocity)
    measures = [kind for kind in UNITS if unit in UNITS[kind] and measure in ("", kind)]
    if not measures:
        accepted = ", ".join(unit for kind in UNITS if measure in ("", kind) for unit in UNITS[kind])
        raise ValueError(f", line {number}: {checks.refusal('unit of the intensity', said[1], accepted)}")
    return measures[0], unit


def _ask(values, comments):
    """Raise ValueError for a column without a name that may be one of return periods or probabilities."""
    steps = np.diff(values)
    what = ""
    if re.search(f"{_QUANTITIES['return periods']}|{_QUANTITIES['probabilities']}", comments):
        what = "while a comment speaks of return periods or probabilities"
    elif values.size > 1 and (steps > 0.0).all():
        what = "that rise, as return periods do"
    elif values.size > 1 and ({*values} <= _USUAL or {*np.round(values / 100.0, 9)} <= _USUAL):
        what = "of which maps are drawn as probabilities in 50 years"
    elif values.size > 1 and 0.5 <= values.max() <= 1.0:
        what = f"from {values.max():.4g} down, as of probabilities in several years"
    if what:
        shown = ", ".join(f"{value:g}" for value in values[:3])
        raise ValueError(
            f"got {shown}, ... in the second column, {what}; accepted: a first line that names the columns, as "
            f"{_EXAMPLES}"
        )


def _rates(quantity, values, years):
    """Return annual rates (n,), inf for a probability of 1, and what was left out, as the end of a sentence."""
    if quantity == "annual rates":
        return values, ""
    if quantity == "return periods":
        if not (values > 0.0).all():
            raise ValueError(checks.refusal("return period", float(values.min()), "years above 0"))
        return 1.0 / values, ""
    if not ((values >= 0.0) & (values <= 1.0)).all():
        worst = float(values[np.argmax(np.abs(values - 0.5))])
        raise ValueError(checks.refusal("probability", worst, "0 to 1, or a name of the column with %"))
    with np.errstate(divide="ignore"):
        rates = -np.log1p(-values) / years
    certain = int((values == 1.0).sum())
    return rates, f"; those of 1 ({certain}) tell no rate and are left out" * bool(certain)


def _of_openquake(comments, lines, site):
    """Return what `read` does of OpenQuake's hazard curves: a line of names, and one for each site."""
    says = dict(re.findall(r"""(\w+)\s*=\s*['"]?([^,'"]+)""", comments))
    measure, years = says.get("imt", ""), says.get("investigation_time", "")
    if measure not in UNITS or not years or says.get("kind") == "std":
        got = f"imt={measure or 'nothing'}, investigation_time={years or 'nothing'}, kind={says.get('kind', 'nothing')}"
        accepted = "imt='PGA' or 'PGV' and investigation_time in the comment, and any kind but the deviation 'std'"
        raise ValueError(checks.refusal("hazard curves of OpenQuake", got, accepted))
    names = [name.strip() for name in lines[0][1].split(",")]
    levels = [place for place, name in enumerate(names) if name.startswith("poe-")]
    sites = [line.split(",") for _, line in lines[1:]]
    lon, lat = names.index("lon"), names.index("lat")
    places = [f"{parts[lon]},{parts[lat]}" for parts in sites if len(parts) == len(names)]
    if len(places) != len(sites) or not sites:
        raise ValueError(f"got {len(sites)} lines below the names, accepted: sites with {len(names)} columns each")
    row = sites[_site(places, site)]
    intensity = np.array([float(names[place].removeprefix("poe-")) for place in levels])
    rates, left = _rates("probabilities", np.array([float(row[place]) for place in levels]), float(years))
    kept, unit = ~np.isinf(rates), "cm/s" if measure == "PGV" else "g"
    note = f"It is OpenQuake's {measure} at {row[lon]},{row[lat]}, from probabilities in {float(years):g} years{left}."
    return UNITS[measure][unit] * intensity[kept], rates[kept], measure, note


def _site(places, site):
    """Return the number, from 0, of the `site` that was asked for among the `places`, texts of degrees."""
    if site is None and len(places) == 1:
        return 0
    asked = str(site).strip()
    if re.fullmatch(r"\d+", asked) and 1 <= int(asked) <= len(places):
        return int(asked) - 1
    try:
        lon, lat = map(float, asked.split(","))
        degrees = np.array([place.split(",") for place in places], float)
        away = np.abs(degrees - [lon, lat]).max(axis=1)
        if away.min() < 0.01:
            return int(away.argmin())
    except ValueError:
        pass
    shown = "; ".join(f"{number}: {place}" for number, place in enumerate(places[:_LISTED], start=1))
    more = f"; ... {len(places)} in all" * (len(places) > _LISTED)
    raise ValueError(checks.refusal("site", site, f"'lon,lat' to .01°, or a number, of {shown}{more}"))
