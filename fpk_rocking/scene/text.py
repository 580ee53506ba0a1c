"""The text form of a scene's parts: readers of TOML tables, and the tables that they read back."""

import dataclasses
from typing import Any

from fpk_rocking.base import checks
from fpk_rocking.base.checks import File
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
    """Return a table of a scene with nondimensional quantities in place of those with units.

    Parameters
    ----------
    name : str
        Of the table, for messages.
    table : dict
        A key ``peak_acceleration`` becomes ``amplitude``, ``rms_acceleration`` ``variance``, and ``x_hz``, ``x_s`` and
        ``x_deg`` become ``x``. Values are as `fpk_rocking.scene.units.in_units` takes them.
    size : Dimensions, Body or None
        Of the block.

    Returns
    -------
    dict
        A new table, with the same entries under nondimensional keys.

    Raises
    ------
    TypeError, ValueError
        A value is refused, the block has no size, or a quantity is given twice.
    """
    return {nondimensional(key): _nondimensional_value(name, key, table, size) for key in table}


def _nondimensional_value(name, key, table, size):
    """Return the value of the entry `key` of a table (dict), converted to a nondimensional one; ValueError if refused.

    `name` is the table's, and `size` the `Dimensions` or `Body` of the block, or None.
    """
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
    """Return the key of the nondimensional quantity for which a key of a scene file stands: "band" for "band_hz".

    "peak_acceleration" gives "amplitude", and "rms_acceleration" "variance". Any other key without a unit is returned
    as it is, and so is "corner_hz", as a record is in seconds.
    """
    if key == "corner_hz":  # of a record, which is in seconds
        return key
    ending = next((ending for ending in _SUFFIXES if key.endswith(ending)), "")
    return _STRENGTHS[key][0] if key in _STRENGTHS else key.removesuffix(ending)


def _converted(name, key, value, size):
    """Return a `value` with a unit, a number, a text or a list of such, as a nondimensional float or a list of floats.

    `name` is its dotted name, `key` the last part of that, and `size` the `Dimensions` or `Body` of the block.
    """
    if key in _STRENGTHS:
        strength = checks.number(name, in_units(name, value, "acceleration"), at_least=0.0)
        return size.amplitude(strength) ** _STRENGTHS[key][1]
    kind = _SUFFIXES[key[key.rindex("_") :]]
    converted = in_units(name, value, kind)
    change = {"frequency": size.frequency, "time": size.tau, "angle": lambda angle: angle / size.critical_angle}[kind]
    if isinstance(converted, list | tuple):
        return [change(checks.number(f"{name}[{place}]", number)) for place, number in enumerate(converted)]
    return change(checks.number(name, converted))


def read_part(name: str, table: dict[str, Any], folder: File) -> Any:
    """Read a part of a scene from its table.

    Parameters
    ----------
    name : str
        "block", "forcing", "noise", "start" or "overturning".
    table : dict
        Its TOML table, its quantities nondimensional but for those of the block and of a record.
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
    """Return the TOML table, as a text, of a part of a scene, a dataclass, without parts that have tables of their own.

    `name` is that of the table.
    """
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
    """Return a function (name, table, folder) that makes an object of the dataclass `cls` of a table (dict)."""
    return lambda name, table, _: cls(**checks.arguments(name, table, cls))


def _block(name, table, folder):
    """Return the `Block` of a table (dict), with the table of its dimensions or its body.

    `name` is the table's; the folder, for files, is not used.
    """
    values = checks.arguments(name, table, Block)
    for part, cls in (("dimensions", Dimensions), ("body", Body)):
        if part in values:
            values[part] = _read(cls)(f"{name}.{part}", values[part], folder)
    return Block(**values)


def _of_kind(classes, default=None, make=lambda cls, *arguments: _read(cls)(*arguments)):
    """Return a function (name, table, folder) that makes an object of a table (dict), of the class that "kind" names.

    `classes` (dict) are these by their kind, `default` is the kind where the key is missing, or None where it is
    required, and `make(cls, name, table, folder)` makes an object from the table without its kind.
    """

    def read(name, table, folder):
        """Return the object of a table (dict); `name` is the table's, and files in it are relative to a folder."""
        values, accepted = dict(checks.table(name, table)), ", ".join(map(repr, classes))
        kind = values.pop("kind", default)
        if kind is None:
            raise ValueError(f"{name}.kind: missing, accepted: {accepted}")
        if not isinstance(kind, str) or kind not in classes:
            raise ValueError(checks.refusal(f"{name}.kind", kind, accepted))
        return make(classes[kind], name, values, folder)

    return read


def _noise(name, table, folder):
    """Return the noise of a table (dict), of one of the classes `NOISES`, with the tables of its envelope and filter.

    `name` is the table's; the folder, for files, is not used.
    """
    values = dict(checks.table(name, table))
    if "envelope" in values:
        values["envelope"] = _of_kind(ENVELOPES)(f"{name}.envelope", values["envelope"], folder)
    if isinstance(values.get("filter"), dict):
        values["filter"] = _of_kind(FILTER_KINDS)(f"{name}.filter", values["filter"], folder)
    return _of_kind(NOISES)(name, values, folder)


_READERS = {
    "block": _block,
    "forcing": _of_kind(FORCINGS, Harmonic.kind, lambda cls, *table: cls.from_table(*table)),
    "noise": _noise,
    "start": _read(Start),
    "overturning": _read(Overturning),
}


def _literal(value):
    """Return a str, a bool, an int, a float, or a tuple of such, nested or not, as TOML text."""
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
    """Return the fields of a dataclass object as a dict by name, themselves and not copied."""
    return {field.name: getattr(value, field.name) for field in dataclasses.fields(value)}


def change_document(document: dict[str, Any], name: str, value: Any) -> None:
    """Set a `value` in place in `document`, parsed TOML (dict), by its dotted name; tables that are missing are added.

    Another form of the same quantity gives way to it.
    """
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
    """Return a copy of a scene whose band noise has `harmonics` (their number) and `frequencies` (how they are drawn).

    A scene without band noise, or whose block has no size, is returned as it is. `frequencies` is "stratified" or
    "independent". Where `harmonics` is None, stratified ones are enough for the duration of the forcing, or for
    `NOISE_CYCLES`.
    """
    noise, forcing = scene.noise, scene.forcing
    if scene.block.size is None or noise.kind != "band":
        return scene
    if harmonics is None:
        duration = forcing.duration if forcing.period is None else NOISE_CYCLES * forcing.period
        stratified = frequencies == FREQUENCIES[1]
        harmonics = max(HARMONICS, enough_harmonics(noise.band, duration)) if stratified else HARMONICS
    return dataclasses.replace(scene, noise=dataclasses.replace(noise, harmonics=harmonics, frequencies=frequencies))
