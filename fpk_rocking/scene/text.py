"""The text form of a scene's parts: readers of TOML tables, and the tables that they read back."""

import dataclasses
from typing import Any

from fpk_rocking.base import checks
from fpk_rocking.physics.forcing import FORCINGS, Harmonic
from fpk_rocking.physics.forcing.samples import Samples
from fpk_rocking.physics.noise.envelope import ENVELOPES
from fpk_rocking.physics.noise.filters import CloughPenzien, Filter, LinearFilter
from fpk_rocking.physics.noise.kinds import (
    FREQUENCIES,
    HARMONICS,
    NOISES,
    enough_harmonics,
)
from fpk_rocking.scene.parts import Block, Body, Overturning, Start
from fpk_rocking.scene.units import BlockSize, Dimensions, in_units

FILTER_KINDS = {cls.kind: cls for cls in (LinearFilter, CloughPenzien)}
"""Classes of filters by the kind of their table; a filter with a name needs no table."""


_STRENGTHS = {"peak_acceleration": ("amplitude", 1), "rms_acceleration": ("variance", 2)}
"""Accelerations by their keys: the nondimensional key, and the power of the acceleration that it is."""

_SUFFIXES = {"_hz": "frequency", "_s": "time", "_deg": "angle"}
"""Endings of keys with units, and the kind of their quantity."""


_WITH_UNITS = {"frequency": "frequency_hz", "angle": "angle_deg"} | {
    plain: key for key, (plain, _) in _STRENGTHS.items()
}
"""Keys with a unit by the nondimensional ones."""


def without_units(name: str, table: dict[str, Any], size: BlockSize | None) -> dict[str, Any]:
    """Return a table of a scene with nondimensional quantities under their keys in place of those with units.

    `name` is that of the table, `size` that of the block; `nondimensional` says which keys have units.
    """
    return {nondimensional(key): _nondimensional_value(name, key, table, size) for key in table}


def _nondimensional_value(name, key, table, size):
    """Return the value of an entry of a table, converted to a nondimensional one."""
    value, plain = table[key], nondimensional(key)
    name = f"{name}.{key}"
    if isinstance(value, dict):
        return without_units(name, value, size)
    if plain != key:
        other = f"{name.removesuffix(key)}{plain}"
        if plain in table:
            raise ValueError(checks.refusal(name, value, f"nothing beside {other}"))
        if size is None:
            accepted = f"a scene with [block.dimensions] or [block.body], or {other}, which is nondimensional"
            raise ValueError(checks.refusal(name, value, accepted))
        return _converted(name, key, value, size)
    if isinstance(value, str) and key in _WITH_UNITS and value[:1] in "+-.0123456789":
        accepted = f"a nondimensional number; with a unit it is {name.removesuffix(key)}{_WITH_UNITS[key]} = {value!r}"
        raise ValueError(checks.refusal(name, value, accepted))
    return value


def nondimensional(key: str) -> str:
    """Return the key of the nondimensional quantity for which a key of a scene file stands: "band" for "band_hz"."""
    if key == "corner_hz":  # of a record, which is in seconds
        return key
    ending = next((ending for ending in _SUFFIXES if key.endswith(ending)), "")
    return _STRENGTHS[key][0] if key in _STRENGTHS else key.removesuffix(ending)


def _converted(name, key, value, size):
    """Return a quantity with a unit, or a list of them, as a nondimensional float, or a list."""
    if key in _STRENGTHS:
        strength = checks.number(name, in_units(name, value, "acceleration"), at_least=0.0)
        return size.amplitude(strength) ** _STRENGTHS[key][1]
    kind = _SUFFIXES[key[key.rindex("_") :]]
    converted = in_units(name, value, kind)
    change = {"frequency": size.frequency, "time": size.tau, "angle": lambda angle: angle / size.critical_angle}[kind]
    if isinstance(converted, list | tuple):
        return [change(checks.number(f"{name}[{place}]", number)) for place, number in enumerate(converted)]
    return change(checks.number(name, converted))


def table_of(name: str, part: Any) -> str:
    """Return the TOML table of a part of a scene, without parts that have tables of their own."""
    if isinstance(part, Filter) and part.kind not in FILTER_KINDS:
        part = part.faster(1.0)  # a class that no reader knows, as its three matrices
    lines = [f"[{name}]"]
    if getattr(part, "kind", Harmonic.kind) != Harmonic.kind:
        lines.append(f"kind = {_literal(part.kind)}")
    for field in dataclasses.fields(part):
        value = getattr(part, field.name)
        if value not in (None, "") and value is not False and not dataclasses.is_dataclass(value):
            lines.append(f"{field.name} = {_literal(value)}")
    return "\n".join(lines) + "\n"


def _read(cls):
    """Return a reader (name, table, folder) of an object of a dataclass."""
    return lambda name, table, _: cls(**checks.arguments(name, table, cls))


def _block(name, table, folder):
    """Read a block, with the table of its dimensions or its body."""
    values = checks.arguments(name, table, Block)
    for part, cls in (("dimensions", Dimensions), ("body", Body)):
        if part in values:
            values[part] = _read(cls)(f"{name}.{part}", values[part], folder)
    return Block(**values)


def _of_kind(classes, default=None, make=lambda cls, *arguments: _read(cls)(*arguments)):
    """Return a reader of objects of the class that "kind" names; `default` is the kind where the key is missing."""

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
    """Read a noise, with the tables of its envelope and filter."""
    values = dict(checks.table(name, table))
    if "envelope" in values:
        values["envelope"] = _of_kind(ENVELOPES)(f"{name}.envelope", values["envelope"], folder)
    if isinstance(values.get("filter"), dict):
        values["filter"] = _of_kind(FILTER_KINDS)(f"{name}.filter", values["filter"], folder)
    return _of_kind(NOISES)(name, values, folder)


READERS = {
    "block": _block,
    "forcing": _of_kind(FORCINGS, Harmonic.kind, lambda cls, *table: cls.from_table(*table)),
    "noise": _noise,
    "start": _read(Start),
    "overturning": _read(Overturning),
}
"""Readers (name, table, folder) of the parts of a scene; the file of a record is relative to the folder."""


def _literal(value):
    """Return a value, or a tuple of values, as TOML text."""
    if isinstance(value, str):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    if isinstance(value, bool):
        return str(value).lower()
    # Python's shortest exact forms of int and float are TOML too.
    if not isinstance(value, tuple):
        return repr(value)
    if isinstance(value, Samples):
        return value.toml
    return "[" + ", ".join(map(_literal, value)) + "]"


def fields_of(value: Any) -> dict[str, Any]:
    """Return the fields of a dataclass object by name, themselves and not copied."""
    return {field.name: getattr(value, field.name) for field in dataclasses.fields(value)}


def change_document(document: dict[str, Any], name: str, value: Any) -> None:
    """Set a value in parsed TOML by its dotted name, in place of other forms of the same quantity."""
    *path, key = name.split(".")
    table = document
    for place, part in enumerate(path):
        table = checks.table(".".join(path[: place + 1]), table.setdefault(part, {}))
    for other in [name for name in table if key == "kind" or nondimensional(name) == nondimensional(key)]:
        del table[other]
    table[key] = value


NOISE_CYCLES = 30
"""Forcing cycles for which band noise of a block with dimensions has `enough_harmonics`, unless they are given."""


def with_harmonics(scene: Any, harmonics: int | None, frequencies: str) -> Any:
    """Return a copy of a scene whose band noise has so many harmonics, "stratified" or "independent".

    A scene without band noise, or whose block has no size, is returned as it is. By default stratified ones are enough
    for the duration of the forcing, or for `NOISE_CYCLES`.
    """
    noise, forcing = scene.noise, scene.forcing
    if scene.block.size is None or noise.kind != "band":
        return scene
    if harmonics is None:
        duration = forcing.duration if forcing.period is None else NOISE_CYCLES * forcing.period
        stratified = frequencies == FREQUENCIES[1]
        harmonics = max(HARMONICS, enough_harmonics(noise.band, duration)) if stratified else HARMONICS
    return dataclasses.replace(scene, noise=dataclasses.replace(noise, harmonics=harmonics, frequencies=frequencies))
