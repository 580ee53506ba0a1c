"""`survey`: what record files have, component by component, and what a study would do with each."""

import dataclasses
import math
import pathlib
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from fpk_rocking.base.checks import File
from fpk_rocking.physics.forcing.readers import VERTICAL, reading, said_by_name
from fpk_rocking.physics.forcing.record import Record
from fpk_rocking.scene.units import STANDARD_GRAVITY


class Row(NamedTuple):
    """A component of a record file.

    Parameters
    ----------
    file, format, name : str
        Name of the file, format it was read as, and number and name of the component.
    unit : str
        Unit by the file, or as it was given; "" if unknown.
    interval : float
        Seconds; nan if unknown.
    samples : int
        Their number.
    pga, pgv : float
        Peak acceleration, g, and velocity, m/s; nan without a unit or an interval.
    drift : str
        "drifts", "offset", or "".
    does : str
        What `Record.from_file` does: "read", "left out", "vertical motion (--vertical)", or what it lacks or refuses.
    """

    file: str
    format: str
    name: str
    unit: str
    interval: float
    samples: int
    pga: float
    pgv: float
    drift: str
    does: str


def survey(
    files: Sequence[File],
    *,
    units: str | None = None,
    interval: float | None = None,
    component: str | int | None = None,
    **correction: Any,
) -> tuple[list[Row], list[str]]:
    """Return (rows, refused): a `Row` for each component of record files, and why others cannot be read.

    Parameters
    ----------
    files : sequence of str or pathlib.Path
        Files that `Record.from_file` reads.
    units, interval, component
        As for `Record.from_file`, where the files leave them open.
    **correction
        `baseline` and `corner_hz` of `Record`: peaks and drift are those after this correction, as in a study.

    Returns
    -------
    rows : list of Row
    refused : list of str
        A sentence for each file that cannot be read.

    Examples
    --------
    >>> from fpk_rocking.risk.records import survey
    >>> rows, refused = survey(["no.AT2"])
    >>> print(refused[0])
    forcing.file: no file 'no.AT2'
    """
    rows, refused = [], []
    for file in files:
        try:
            found = reading(pathlib.Path(file))
        except (ValueError, OSError) as error:
            refused.append(str(error))
            continue
        taken, why, lone = None, "", said_by_name(found) == VERTICAL
        components = [dataclasses.replace(one, upright=one.is_vertical or lone) for one in found.components]
        usable = [one for one in components if not (one.objection or one.upright)]
        try:
            taken = found.chosen(component, if_several=True)
        except ValueError as error:
            why = getattr(error.__cause__, "got", "")
            nothing = all(one.objection for one in components)
            refused += [str(error)] * (nothing or (len(components) == 1 and not components[0].upright))
        for number, (one, own) in enumerate(zip(components, found.components, strict=True), 1):
            does = "read" if own is taken else "left out"
            if one.upright and not one.objection:
                does = "vertical motion (--vertical)"
            elif not taken or one.objection:
                choose = len(usable) > 1 and not one.objection
                against = one.objection.got if one.objection else why
                does = f"choose: --component {number}" if choose else f"not read: {against}"
            place = found.path.name, found.format, f"{number} {one.name}".strip()
            rows.append(Row(*place, *_about(one, does, units, interval, correction)))
    return rows, refused


def _about(one, does, units, interval, correction):
    """The row of a component from its unit on; what is missing for it to be read is asked for in `does`."""
    unit, step = one.unit or units or "", one.interval or interval or math.nan
    missing = ["--units"] * (not unit) + ["--interval"] * math.isnan(step)
    pga, pgv, drift, notes = math.nan, math.nan, "", []
    if missing and not one.objection:
        notes = [f"needs {' '.join(missing)}"]
    elif not one.objection:
        record = Record(step, one.values.tolist(), unit, note=" ".join(one.sentences), **correction)
        notes = [sentence.rstrip(".") for sentence in record.implausible]
        pga, pgv, samples = record.drift.pga / STANDARD_GRAVITY, record.drift.pgv, record.corrected_samples
        offset = abs(samples.mean()) > 0.01 * np.abs(samples - samples.mean()).max()
        drift = "drifts" if record.drifts else "offset" if offset else ""
    does = "; ".join([does] * (does != "read" or not missing) + notes)
    return unit, step, len(one.values), pga, pgv, drift, does


def table_lines(rows: Sequence[Row]) -> list[str]:
    """Return a list of lines, the names of the columns and a line for each row, as wide as it has to be."""
    names = ["file", "format", "component", "unit", "s", "samples", "PGA, g", "PGV, m/s", "drift", "would be"]
    cells = [
        [f"{cell:.4g}".replace("nan", "-") if isinstance(cell, float) else str(cell) for cell in row] for row in rows
    ]
    widths = [max(map(len, column)) for column in zip(names, *cells, strict=True)]
    return [
        "  ".join(f"{cell:{width}}" for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in (names, *cells)
    ]
