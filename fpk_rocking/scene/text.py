"""The text form of a scene's parts: readers of TOML tables, and the tables that they read back."""

import dataclasses
from typing import Any

from fpk_rocking.base import checks
from fpk_rocking.base.types import File
from fpk_rocking.physics.forcing import FORCINGS, Harmonic
from fpk_rocking.physics.noise.clough_penzien import CloughPenzien
from fpk_rocking.physics.noise.envelope import ENVELOPES
from fpk_rocking.physics.noise.filters import LinearFilter
from fpk_rocking.scene.parts import NOISES, Block, Overturning, Start
from fpk_rocking.scene.units import Dimensions

FILTER_KINDS = {cls.kind: cls for cls in (LinearFilter, CloughPenzien)}
"""Classes of filters by the kind of their table; a filter with a name needs no table."""


def read_part(name: str, table: dict[str, Any], folder: File) -> Any:
    """Read a part of a scene.

    Parameters
    ----------
    name : str
        "block", "forcing", "noise", "start" or "overturning".
    table : dict
        Its TOML table.
    folder : str or pathlib.Path
        That the file of a record is relative to.

    Returns
    -------
    Block, Harmonic or another forcing, a noise, Start or Overturning

    Raises
    ------
    TypeError, ValueError
        A key is unknown, missing or refused; the message names it.
    """
    return _READERS[name](name, table, folder)


def table_of(name: str, part: Any) -> str:
    """Return the TOML table of a part of a scene, without the parts that have tables of their own."""
    lines = [f"[{name}]"]
    if getattr(part, "kind", Harmonic.kind) != Harmonic.kind:
        lines.append(f"kind = {_literal(part.kind)}")
    for field in dataclasses.fields(part):
        value = getattr(part, field.name)
        if value not in (None, "") and value is not False and not dataclasses.is_dataclass(value):
            lines.append(f"{field.name} = {_literal(value)}")
    return "\n".join(lines) + "\n"


def _read(cls):
    """Return the reader of a table with the parameters of a class."""
    return lambda name, table, _: cls(**checks.arguments(name, table, cls))


def _block(name, table, folder):
    values = checks.arguments(name, table, Block)
    if "dimensions" in values:
        values["dimensions"] = _read(Dimensions)(f"{name}.dimensions", values["dimensions"], folder)
    return Block(**values)


def _of_kind(classes, default=None, make=lambda cls, *given: _read(cls)(*given)):
    """Return the reader of a table whose key "kind" names one of several classes."""

    def read(name, table, folder):
        values, accepted = dict(checks.table(name, table)), ", ".join(map(repr, classes))
        kind = values.pop("kind", default)
        if kind is None:
            raise ValueError(f"{name}.kind: missing, accepted: {accepted}")
        if not isinstance(kind, str) or kind not in classes:
            raise ValueError(checks.refusal(f"{name}.kind", kind, accepted))
        return make(classes[kind], name, values, folder)

    return read


def _noise(name, table, folder):
    values = dict(checks.table(name, table))
    if "envelope" in values:
        values["envelope"] = _of_kind(ENVELOPES)(f"{name}.envelope", values["envelope"], folder)
    if isinstance(values.get("filter"), dict):
        values["filter"] = _of_kind(FILTER_KINDS)(f"{name}.filter", values["filter"], folder)
    return _of_kind(NOISES)(name, values, folder)


_READERS = {
    "block": _block,
    "forcing": _of_kind(FORCINGS, Harmonic.kind, lambda cls, *given: cls.from_table(*given)),
    "noise": _noise,
    "start": _read(Start),
    "overturning": _read(Overturning),
}


def _literal(value):
    if isinstance(value, str):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    if isinstance(value, bool):
        return str(value).lower()
    # Python's shortest exact forms of int and float are TOML too.
    return "[" + ", ".join(map(_literal, value)) + "]" if isinstance(value, tuple) else repr(value)
