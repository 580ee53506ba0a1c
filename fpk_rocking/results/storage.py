"""Saved results, and files that are written whole or not at all.

A result file is an .npz archive without pickled objects: the arrays as they are, and one JSON header with the format's
version, the kind of result, the scene as TOML, the scalar attributes and the versions of the programs that wrote it.
"""

import contextlib
import csv
import importlib.metadata
import io
import json
import os
import pathlib
import secrets
import zipfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, ClassVar, Self

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.types import ArrayLike, File
from fpk_rocking.results.layout import Layout
from fpk_rocking.scene.scene import Scene

_FORMAT = 6
_HEADER = "header"
_HEADER_PARTS = {"kind": str, "scene": str, "attributes": dict}
_PIECE = 2**20


@contextlib.contextmanager
def replaced_atomically(path: File) -> Iterator[pathlib.Path]:
    """Give a temporary path to write to; it takes the place of `path` when the block ends without an exception.

    Parameters
    ----------
    path : str or pathlib.Path
        The file to write; its folder is made where missing.

    Yields
    ------
    pathlib.Path
        A new name in the same folder with the same suffix. Whatever is there is removed on any exception, an
        interruption included, and `path` is then as it was.
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


def write_csv(path: File, names: Iterable[str], rows: Iterable[Iterable[Any]]) -> None:
    """Write a table as a CSV file in UTF-8, whole or not at all."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([names, *rows])
    write_text(path, text.getvalue())


def write_result(
    path: File, kind: str, scene: Scene, arrays: Mapping[str, ArrayLike], attributes: dict[str, Any]
) -> None:
    """Save a result.

    Parameters
    ----------
    path : str or pathlib.Path
        File to write, by custom with the suffix .npz.
    kind : str
        "evolution" (density solver), "ensemble", "tally" or "histories" (Monte Carlo), "fragility" (either).
    scene : Scene
        The scene as it was asked for.
    arrays : dict of str to array_like
        Numbers or booleans.
    attributes : dict of str
        What JSON holds: numbers, strings, None, lists, dicts.

    Raises
    ------
    TypeError
        An attribute is not JSON.
    """
    header = {
        "format": _FORMAT,
        "kind": kind,
        "scene": scene.to_toml(),
        "attributes": attributes,
        "versions": {name: importlib.metadata.version(name) for name in ("fpk-rocking", "numpy", "scipy", "numba")},
    }
    text = json.dumps(header)
    with replaced_atomically(path) as temporary, temporary.open("wb") as file:
        np.savez(file, **{_HEADER: np.array(text)}, **arrays)  # type: ignore[arg-type]  # none is called allow_pickle


def read_result(path: File, kind: str, *layouts: Layout, make: Callable[..., Any] | None = None) -> Any:
    """Load a result that `write_result` saved, all that is read of it held against its checksum.

    Parameters
    ----------
    path : str or pathlib.Path
    kind : str
        The kind that is wanted.
    *layouts : fpk_rocking.results.layout.Layout
        What it has to hold: one of these, which differ in the names of their arrays.
    make : callable, optional
        Makes the result of scene, arrays and attributes, which come back as they are without it.

    Returns
    -------
    result
        What `make` returns.

    Raises
    ------
    FileNotFoundError
        There is no such file.
    ValueError
        The file is not a result, is damaged or truncated, or holds another kind, format or content.
    """
    with _opened(path) as (header, archive):
        if header["kind"] != kind:
            raise ValueError(f"{path}: got a result of kind {header['kind']!r}, accepted: {kind!r}")
        names = {name.removesuffix(".npy") for name in archive.namelist()} - {_HEADER}
        arrays = {name: _array(path, archive, name) for name in sorted(names)}
    layout = next((one for one in layouts if one.arrays.keys() == arrays.keys()), layouts[0])
    try:
        layout.check(arrays, header["attributes"])
        found = Scene.from_toml(header["scene"]), arrays, header["attributes"]
        return found if make is None else make(*found)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{path}: not the content of a saved result: {error}") from None


class Saved:
    """A result that can be saved to a file and loaded again.

    A subclass has the kind of its file and what that holds; where its fields are not that, also `_stored` and
    `_restored`.
    """

    _kind: ClassVar[str]
    _layouts: ClassVar[tuple[Layout, ...]]

    def save(self, path: File) -> None:
        """Save the result to a file; an interruption leaves no partial file.

        Parameters
        ----------
        path : str or pathlib.Path
            File to write, by custom with the suffix .npz; its folder is created if missing.
        """
        write_result(path, self._kind, *self._stored())

    @classmethod
    def load(cls, path: File) -> Self:
        """Load a saved result.

        Parameters
        ----------
        path : str or pathlib.Path
            A file that `save` wrote.

        Returns
        -------
        result
            Of this class.

        Raises
        ------
        FileNotFoundError
            There is no such file.
        ValueError
            The file is damaged, or holds something else.
        """
        return read_result(path, cls._kind, *cls._layouts, make=cls._restored)

    def _stored(self) -> tuple[Any, dict[str, Any], dict[str, Any]]:
        """Return the scene, the arrays and the attributes to save."""
        own: Any = self
        return own.scene, *self._layouts[0].of(self)

    @classmethod
    def _restored(cls, scene: Scene, arrays: dict[str, Any], attributes: dict[str, Any]) -> Self:
        """Make the result from what was saved."""
        own: Any = cls
        return own(scene=scene, **arrays, **attributes)


def result_kind(path: File) -> str:
    """Return the kind of a saved result; raises as `read_result`."""
    with _opened(path) as (header, _):
        return header["kind"]


@contextlib.contextmanager
def _opened(path):
    """Open a result file as (header, archive)."""
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
    """Read an array, to the end first: numpy reads no further than a shape says, and the checksum is known last."""
    try:
        with archive.open(f"{name}.npy") as member:
            while member.read(_PIECE):
                pass
        with archive.open(f"{name}.npy") as member:
            return np.lib.format.read_array(member, allow_pickle=False)
    except Exception as error:  # whatever damage makes of a zip member or of an array's header
        raise _damaged(path, error) from error


def _damaged(path, error):
    return ValueError(f"{path}: a damaged saved result ({error})")


def _header(path, archive):
    strange = f"{path}: not a saved result (no header); accepted: a result file (.npz)"
    if f"{_HEADER}.npy" not in archive.namelist():
        raise ValueError(strange)
    text = str(_array(path, archive, _HEADER))
    try:
        header = json.loads(text)
        found = header["format"]
        whole = found != _FORMAT or all(isinstance(header[name], cls) for name, cls in _HEADER_PARTS.items())
    except (KeyError, TypeError, ValueError, RecursionError):
        raise ValueError(strange) from None
    if found != _FORMAT:
        raise ValueError(f"{path}: got format {found!r}, accepted: {_FORMAT} (saved by another version)")
    if not whole:
        raise ValueError(strange)
    return header
