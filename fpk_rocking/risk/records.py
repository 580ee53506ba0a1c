"""`survey`: what record files have, component by component, and what a study would do with each."""

import math
import pathlib
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from fpk_rocking.base.checks import File
from fpk_rocking.physics.forcing.readers import read, reading
from fpk_rocking.physics.forcing.readers.components import Component
from fpk_rocking.physics.forcing.record import Record
from fpk_rocking.scene.units import STANDARD_GRAVITY


class Row(NamedTuple):
    """A component of a record file.

    Parameters
    ----------
    file, format, name : str
        Name of the file, format it was read as, and number and name of the component.
    unit : str
        As the file says it, or as it was given; "" where neither says one.
    interval : float
        Seconds; nan where neither says it.
    samples : int
        Their number.
    pga, pgv : float
        Peak acceleration, g, and velocity, m/s; nan without a unit or an interval.
    drift : str
        "drifts", "offset", or "".
    does : str
        What `Record.from_file` does: "read", or what it asks for or refuses.
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
) -> tuple[list[Row], list[str]]:
    """Return (rows, refused): a `Row` for each component of record files, and why others cannot be read.

    Parameters
    ----------
    files : sequence of str or pathlib.Path
        Files that `Record.from_file` reads.
    units, interval, component
        As for `Record.from_file`, where the files leave them open.

    Returns
    -------
    rows : list of Row
    refused : list of str
        A sentence for each file of which nothing can be read.

    Examples
    --------
    >>> from fpk_rocking.risk.records import survey
    >>> rows, refused = survey(["no.AT2"])
    >>> print(refused[0])
    forcing.file: no file 'no.AT2'
    """
    rows, refused = [], []
    for file in files:
        path = pathlib.Path(file)
        try:
            found = reading(path)
        except (ValueError, OSError) as error:
            refused.append(str(error))
            continue
        try:
            chosen, why = read(path, component, if_several=True), ""
        except ValueError as error:
            chosen, why = None, str(error).partition("': got ")[2].partition(", accepted")[0]
            if all(one.objection for one in found.components) or len(found.components) == 1:
                refused.append(str(error))
        several = sum(not one.objection for one in found.components) > 1
        for number, one in enumerate(found.components, 1):
            picked = chosen is not None and chosen.name == one.name and np.array_equal(chosen.values, one.values)
            if one.objection:
                does = f"not read: {one.objection.removeprefix('got ').partition(', accepted')[0]}"
            elif picked or (chosen is None and several):
                does = "read" if picked else f"choose: --component {number}"
            else:
                does = "left out" if chosen is not None else f"not read: {why}"
            rows.append(_row(path.name, found.format, number, one, units, interval, does))
    return rows, refused


def _row(file: str, form: str, number: int, one: Component, units: Any, interval: Any, does: str) -> Row:
    """The row of a component; what is missing for it to be read is asked for in `does`."""
    unit, step = one.unit or units or "", one.interval or interval or math.nan
    missing = ["--units"] * (not unit) + ["--interval"] * math.isnan(step)
    pga = pgv = math.nan
    drift, notes = "", [f"needs {' '.join(missing)}"] * bool(missing and not one.objection)
    if not missing and not one.objection:
        record = Record(step, tuple(one.values.tolist()), unit, note=" ".join(one.sentences))
        notes += [sentence.rstrip(".") for sentence in record.implausible]
        pga, pgv = record.drift.pga / STANDARD_GRAVITY, record.drift.pgv
        offset = abs(one.values.mean()) > 0.01 * np.abs(one.values - one.values.mean()).max()
        drift = "drifts" if record.drifts else "offset" if offset else ""
    does = "; ".join([does] * (does != "read" or not missing) + notes)
    return Row(file, form, f"{number} {one.name}".strip(), unit, step, len(one.values), pga, pgv, drift, does)


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
