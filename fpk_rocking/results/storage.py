"""Files: written whole or not at all, values as JSON and CSV hold them, and saved results.

A result file is an .npz archive without pickled objects: the arrays as they are, and one JSON header with the format's
version, the kind of result, its scenes as TOML, the scalar attributes and the versions of the programs that wrote it.
What a file of a kind holds follows from the fields of its class, see `Result`.
"""

import contextlib
import csv
import dataclasses
import importlib.metadata
import io
import json
import math
import os
import pathlib
import re
import secrets
import typing
import zipfile
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import File
from fpk_rocking.scene.scene import Scene


@contextlib.contextmanager
def replaced_atomically(path: File) -> Iterator[pathlib.Path]:
    """Give a temporary path beside `path`; it takes its place when the block ends without an exception.

    Folders are made where missing. On any exception, an interruption included, whatever was written is removed, and
    `path` is as it was.
    """
    file_path = checks.path("path", path)
    file_path.parent.mkdir(parents=True, exist_ok=True)
    temporary = file_path.with_name(f".{file_path.stem}-{secrets.token_hex(6)}{file_path.suffix}")
    try:
        yield temporary
        # On the disk before it has the name: a machine that stops must not leave an empty file in an old one's place.
        with temporary.open("rb") as file:
            os.fsync(file.fileno())
        temporary.replace(file_path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def write_text(path: File, text: str) -> None:
    """Write a text file in UTF-8, whole or not at all."""
    with replaced_atomically(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")


def write_csv(path: File, columns: Mapping[str, Any]) -> None:
    """Write columns of equal length by name as a CSV file in UTF-8, whole or not at all."""
    values = (column.tolist() if isinstance(column, np.ndarray) else column for column in columns.values())
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([columns, *zip(*values, strict=True)])
    write_text(path, text.getvalue())


def write_json(path: File, values: Any) -> None:
    """Write values such as `plain` returns as a JSON file, whole or not at all; ValueError for nan."""
    write_text(path, json.dumps(values, indent=1, allow_nan=False, ensure_ascii=False) + "\n")


def plain(value: Any) -> Any:
    """Return a value, at any depth, as JSON holds it: dicts, lists, Python's numbers, and None in place of nan."""
    if isinstance(value, dict):
        return {name: plain(entry) for name, entry in value.items()}
    if isinstance(value, list | tuple):
        return [plain(entry) for entry in value]
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    return None if isinstance(value, float) and not math.isfinite(value) else value


_FORMAT = 7
_HEADER = "header"


LABELS = {"side": ("left", "right"), "limit": ("low", "high"), "result": ("first", "second")}
"""Dimensions whose places have names."""


def save(result: Any, path: File) -> None:
    """Write a `Result` to a file; see `Result.save`."""
    if not result.kind:
        raise TypeError(f"{type(result).__name__}: results of this class have no files")
    arrays: dict[str, Any] = {}
    attributes: dict[str, Any] = {}
    scenes: list[Scene] = []
    _take_apart(result, "", arrays, attributes, scenes)
    header = {
        "format": _FORMAT,
        "kind": result.kind,
        "scenes": [scene.to_toml() for scene in scenes],
        "attributes": attributes,
        "versions": {name: importlib.metadata.version(name) for name in ("fpk-rocking", "numpy", "scipy", "numba")},
    }
    text = json.dumps(header)
    with replaced_atomically(path) as temporary, temporary.open("wb") as file:
        np.savez(file, **{_HEADER: np.array(text)}, **arrays)  # type: ignore[arg-type]  # none is called allow_pickle


def load(cls: Any, path: File) -> Any:
    """Read a `Result` of the class `cls` from a file; see `Result.load`."""
    with _opened(path) as (header, archive):
        if header["kind"] != cls.kind:
            raise ValueError(f"{path}: got a result of kind {header['kind']!r}, accepted: {cls.kind!r}")
        names = {name.removesuffix(".npy") for name in archive.namelist()} - {_HEADER}
        arrays = {name: _array(path, archive, name) for name in sorted(names)}
    parts = arrays | header["attributes"]
    try:
        result = _build(cls, "", parts, [Scene.from_toml(text) for text in header["scenes"]], {})
        if parts:
            raise ValueError(f"got {', '.join(sorted(parts))}, which it does not have")
    except (TypeError, ValueError) as error:
        raise ValueError(f"{path}: not the content of a saved result: {error}") from None
    return result


def result_kind(path: File) -> str:
    """Return the kind, as "ensemble", of the saved result in the file at a path; raises as `Result.load`."""
    with _opened(path) as (header, _):
        return header["kind"]


def fields_of(cls: type) -> list[tuple[str, Any]]:
    """Return pairs (name, annotation) of the fields of a dataclass or a NamedTuple; none of another class."""
    if not (hasattr(cls, "_fields") or dataclasses.is_dataclass(cls)):
        return []
    hints = typing.get_type_hints(cls, include_extras=True)
    names = cls._fields if hasattr(cls, "_fields") else [field.name for field in dataclasses.fields(cls)]
    return [(name, hints[name]) for name in names]


def form_of(annotation: Any) -> str | None:
    """Return the text of dtype and dimensions of an annotated array, as "f8 time side"; None for other annotations."""
    return annotation.__metadata__[0] if typing.get_origin(annotation) is typing.Annotated else None


def _nested(annotation):
    """(class, whether None is allowed) of an annotation by a NamedTuple or a dataclass; None for any other."""
    options = [option for option in typing.get_args(annotation) if option is not type(None)]
    cls = options[0] if len(options) == 1 else annotation
    return (cls, cls is not annotation) if hasattr(cls, "_fields") or dataclasses.is_dataclass(cls) else None


def _take_apart(result, prefix, arrays, attributes, scenes):
    """Collect arrays, plain attributes and scenes of a result by their names in a file, which begin with `prefix`."""
    for name, annotation in fields_of(type(result)):
        value = getattr(result, name)
        if form_of(annotation):
            arrays[prefix + name] = value
        elif annotation in (Scene, tuple[Scene, ...]):
            scenes.extend([value] if annotation is Scene else value)
        elif not _nested(annotation):
            attributes[prefix + name] = value
        elif value is not None:
            _take_apart(value, f"{prefix}{name}.", arrays, attributes, scenes)


def _build(cls, prefix, parts, scenes, lengths):
    """An object of a class from what `_take_apart` collected, taken out of `parts`; `lengths` as of `_fits`."""
    values = {}
    for name, annotation in fields_of(cls):
        key, nested = prefix + name, _nested(annotation)
        if annotation is Scene and len(scenes) != 1:
            raise ValueError(f"scenes: got {len(scenes)}, accepted: 1")
        if annotation in (Scene, tuple[Scene, ...]):
            values[name] = scenes[0] if annotation is Scene else tuple(scenes)
        elif nested:
            absent = nested[1] and not any(part.startswith(f"{key}.") for part in parts)
            values[name] = None if absent else _build(nested[0], f"{key}.", parts, scenes, lengths)
        elif key not in parts:
            raise ValueError(f"{key} is missing")
        else:
            values[name] = parts.pop(key)
            _check(key, values[name], annotation, lengths)
    return cls(**values)


def _check(name, value, annotation, lengths):
    """Refuse a value, an array or an attribute, that is not as its annotation says."""
    form = form_of(annotation)
    if form is None:
        kind = typing.get_origin(annotation) or annotation
        if isinstance(value, bool) != (kind is bool) or not isinstance(value, (int, float) if kind is float else kind):
            raise ValueError(f"{name}: got {value!r}, accepted: {kind.__name__}")
        return
    code, *dims = form.split()
    fits = isinstance(value, np.ndarray) and value.dtype == np.dtype(code) and value.ndim == len(dims)
    if not fits or not all(_fits(*pair, lengths) for pair in zip(value.shape, dims, strict=True)):
        sizes = ", ".join(f"{letter} = {length}" for letter, length in lengths.items())
        description = f"{value.dtype} of shape {value.shape}" if isinstance(value, np.ndarray) else repr(value)
        raise ValueError(f"{name}: got {description}, accepted: {form!r} with {sizes}")


def _fits(length, dim, lengths):
    """Whether the length of an axis is as stated by a text such as "2", "side", "n" or "20k+1"."""
    ((factor, name, added),) = re.findall(r"^(\d*)([a-z_]*)(\+1)?$", dim)
    length, factor = length - bool(added), int(factor or 1)
    if not name or name in LABELS:
        return length == len(LABELS.get(name, range(factor)))
    return length % factor == 0 and length >= 0 and lengths.setdefault(name, length // factor) == length // factor


@contextlib.contextmanager
def _opened(path):
    """Open a result file and yield its header, a dict, and the `zipfile.ZipFile`."""
    try:
        file = checks.path("path", path).open("rb")
    except FileNotFoundError:
        raise FileNotFoundError(f"no result file {str(path)!r} (looked from {str(pathlib.Path.cwd())!r})") from None
    with file:
        if not zipfile.is_zipfile(file):
            raise ValueError(f"{path}: not a saved result, or truncated; accepted: a whole result file (.npz)")
        try:
            archive = zipfile.ZipFile(file)
        except Exception as error:  # whatever damage makes of a list of contents
            raise _damaged(path, error) from error
        with archive:
            yield _header(path, archive), archive


def _array(path, archive, name):
    """Read an array from a result file.

    It is read to the end first: numpy reads no further than a shape says, and the checksum is known last.
    """
    try:
        with archive.open(f"{name}.npy") as member:
            while member.read(2**20):
                pass
        with archive.open(f"{name}.npy") as member:
            return np.lib.format.read_array(member, allow_pickle=False)
    except Exception as error:  # whatever damage makes of a zip member or of an array's header
        raise _damaged(path, error) from error


def _damaged(path, error):
    """Error for a file whose bytes are damaged."""
    return ValueError(f"{path}: a damaged saved result ({error})")


def _header(path, archive):
    """Read and check the header of a result file."""
    refusal = f"{path}: not a saved result (no header); accepted: a result file (.npz)"
    if f"{_HEADER}.npy" not in archive.namelist():
        raise ValueError(refusal)
    text = str(_array(path, archive, _HEADER))
    try:
        header = json.loads(text)
        number = header["format"]
        parts = (header.get(name) for name in ("kind", "scenes", "attributes"))
        valid = all(isinstance(*pair) for pair in zip(parts, (str, list, dict), strict=True))
        valid = valid and all(isinstance(scene, str) for scene in header["scenes"])
    except (AttributeError, KeyError, TypeError, ValueError, RecursionError):
        raise ValueError(refusal) from None
    if number != _FORMAT:
        version = header.get("versions")
        version = version.get("fpk-rocking") if isinstance(version, dict) else None
        by = f"version {version}, which reads it" if version else "another version"
        raise ValueError(f"{path}: got format {number!r}, accepted: {_FORMAT} (saved by {by})")
    if not valid:
        raise ValueError(refusal)
    return header
