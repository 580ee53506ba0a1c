"""Files that are whole or not there, and results that come back bit by bit."""

import dataclasses
import json
import math
import os
import pathlib
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
import pytest

from fpk_rocking import Block, Dimensions, Harmonic, NoNoise, Scene
from fpk_rocking.base.checks import Array
from fpk_rocking.results import storage
from fpk_rocking.results.result import Result

SCENE = Scene(Block(1 / 3, Dimensions(0.4, 1.7)), Harmonic(4.6, 2.7, math.pi), NoNoise())


class Part(NamedTuple):
    """A part of a result that may be absent."""

    flags: Annotated[Array, "? 2"]
    note: str


@dataclasses.dataclass(frozen=True, eq=False)
class Things(Result):
    """Fields of every sort."""

    kind: ClassVar = "ensemble"
    scene: Scene
    survival: Annotated[Array, "f8 n"]
    counts: Annotated[Array, "i4 2 k+1"]
    empty: Annotated[Array, "f8 m n"]
    seed: int
    method: str
    wall_s: float
    bins: list
    options: dict[str, Any]
    part: Part | None = None


class Other(Things):
    kind = "evolution"


WHOLE = Things(
    SCENE,
    np.array([1.0, 0.1 + 0.2, math.nan, -0.0]),
    np.arange(6, dtype=np.int32).reshape(2, 3),
    np.zeros((0, 4)),
    2**63,
    "σ_M²/2",
    0.1,
    [1, 2.5],
    {"cycles": 4},
    Part(np.array([True, False]), "here"),
)
ARRAYS = {"survival": WHOLE.survival, "counts": WHOLE.counts, "empty": WHOLE.empty}


@pytest.fixture
def saved(tmp_path):
    path = tmp_path / "result.npz"
    WHOLE.save(path)
    return path


def test_result_comes_back_bit_by_bit(saved):
    found = Things.load(saved)
    assert found.scene == SCENE
    for name in ("seed", "method", "wall_s", "bins", "options"):
        assert getattr(found, name) == getattr(WHOLE, name)
    assert found.part.note == "here"
    pairs = [(getattr(found, name), values) for name, values in ARRAYS.items()]
    for values, wanted in [*pairs, (found.part.flags, WHOLE.part.flags)]:
        assert values.dtype == wanted.dtype
        assert values.shape == wanted.shape
        assert values.tobytes() == wanted.tobytes()
    assert not found.survival.flags.writeable
    assert storage.result_kind(saved) == "ensemble"
    assert [file.name for file in saved.parent.iterdir()] == ["result.npz"]


def test_header_names_the_versions(saved):
    with np.load(saved, allow_pickle=False) as archive:
        header = json.loads(str(archive["header"]))
    assert header["format"] == 7
    assert header["versions"].keys() == {"fpk-rocking", "numpy", "scipy", "numba"}


@pytest.mark.parametrize("where", ["header", "survival"])
def test_a_pickled_array_is_refused_and_never_run(saved, where):
    """Unpickling runs what the file says: here it would make a file."""
    trace = saved.parent / "trace"

    class Touching:
        def __reduce__(self):
            return pathlib.Path.touch, (trace,)

    with np.load(saved, allow_pickle=False) as archive:
        arrays = dict(archive)
    np.savez(saved, allow_pickle=True, **arrays | {where: np.array(Touching(), dtype=object)})
    with pytest.raises(ValueError, match=r"result\.npz: a damaged saved result \(Object arrays cannot be loaded"):
        Things.load(saved)
    assert not trace.exists()


def test_another_kind_is_refused(saved):
    with pytest.raises(ValueError, match=r"result\.npz: got a result of kind 'ensemble', accepted: 'evolution'"):
        Other.load(saved)


@pytest.mark.parametrize("number", [6, 8])
def test_another_format_is_refused(saved, number):
    header = {"format": number, "kind": "ensemble"}
    for more, by in (({}, "another version"), ({"versions": {"fpk-rocking": "0.3"}}, "version 0.3, which reads it")):
        np.savez(saved, header=np.array(json.dumps(header | more)))
        with pytest.raises(ValueError, match=rf"got format {number}, accepted: 7 \(saved by {by}\)"):
            storage.result_kind(saved)


def test_a_part_may_be_absent_and_fields_have_to_be_there(tmp_path):
    path = tmp_path / "result.npz"
    dataclasses.replace(WHOLE, part=None).save(path)
    assert Things.load(path).part is None
    for changes, message in (
        ({"counts": np.arange(6.0).reshape(2, 3)}, r"counts: got float64 of shape \(2, 3\), accepted: 'i4 2 k\+1'"),
        ({"empty": np.zeros((0, 3))}, r"empty: got float64 of shape \(0, 3\), accepted: 'f8 m n' with n = 4"),
        ({"seed": "one"}, r"seed: got 'one', accepted: int"),
        ({"seed": True}, r"seed: got True, accepted: int"),
    ):
        dataclasses.replace(WHOLE, **changes).save(path)
        with pytest.raises(ValueError, match=rf"result\.npz: not the content of a saved result: {message}"):
            Things.load(path)


@pytest.mark.parametrize(
    "change",
    [
        lambda arrays, _: arrays.pop("survival"),
        lambda arrays, _: arrays.update(extra=np.zeros(2)),
        lambda arrays, _: arrays.update(survival_=arrays.pop("survival")),
        lambda _, header: header["attributes"].popitem(),
        lambda _, header: header["attributes"].update(seed=None),
        lambda _, header: header.update(scenes={}),
        lambda _, header: header.update(attributes=[1.0]),
        lambda _, header: header.clear(),
    ],
)
def test_archives_of_other_content_are_refused(saved, change):
    """Names that are missing, added or changed, and other headers; all checksums are right."""
    with np.load(saved) as archive:
        arrays = dict(archive)
    header = json.loads(str(arrays.pop("header")))
    change(arrays, header)
    np.savez(saved, header=np.array(json.dumps(header)), **arrays)
    with pytest.raises(ValueError, match=r"result\.npz: "):
        Things.load(saved)


@pytest.mark.parametrize("kept", [0, 10, 0.5, 0.999])
def test_truncated_file_is_refused(saved, kept):
    whole = saved.read_bytes()
    saved.write_bytes(whole[: kept if kept >= 1 else int(kept * len(whole))])
    for read in (storage.result_kind, Things.load):
        with pytest.raises(ValueError, match=r"result\.npz: not a saved result, or truncated"):
            read(saved)


def test_damaged_array_is_refused(saved):
    content = bytearray(saved.read_bytes())
    where = content.index(ARRAYS["survival"].tobytes())
    content[where + 3] ^= 255
    saved.write_bytes(content)
    with pytest.raises(ValueError, match=r"result\.npz: a damaged saved result"):
        Things.load(saved)


def test_a_flipped_bit_of_a_shape_is_refused(tmp_path):
    """A smaller shape or type reads only a part of the array: its checksum must be taken over all of it."""
    path = tmp_path / "large.npz"
    dataclasses.replace(WHOLE, counts=np.arange(6400, dtype=np.int32).reshape(2, 3200)).save(path)
    whole = path.read_bytes()
    for k in range(8 * 128):
        spoiled = bytearray(whole)
        spoiled[whole.index(b"\x93NUMPY", whole.index(b"counts.npy")) + k // 8] ^= 1 << k % 8
        path.write_bytes(spoiled)
        with pytest.raises(ValueError, match="a damaged saved result"):
            Things.load(path)


def test_other_files_are_refused(tmp_path):
    text, plain = tmp_path / "notes.txt", tmp_path / "plain.npz"
    text.write_text("survival 0.5\n")
    np.savez(plain, survival=np.ones(3))
    with pytest.raises(ValueError, match=r"notes\.txt: not a saved result"):
        storage.result_kind(text)
    with pytest.raises(ValueError, match=r"plain\.npz: not a saved result \(no header\)"):
        Things.load(plain)
    with pytest.raises(FileNotFoundError, match=r"no result file .*absent\.npz"):
        Things.load(tmp_path / "absent.npz")


def test_what_json_does_not_hold_is_refused_and_leaves_no_file(tmp_path):
    with pytest.raises(TypeError, match="int64"):
        dataclasses.replace(WHOLE, seed=np.int64(1)).save(tmp_path / "result.npz")
    assert list(tmp_path.iterdir()) == []


def write_half(path, interruption):
    with storage.replaced_atomically(path) as temporary:
        temporary.write_text("half of the n")
        raise interruption


@pytest.mark.parametrize("interruption", [KeyboardInterrupt, OSError, SystemExit])
def test_interrupted_writing_leaves_the_old_file_and_nothing_else(tmp_path, interruption):
    path = tmp_path / "table.txt"
    storage.write_text(path, "old σ\n")
    with pytest.raises(interruption):
        write_half(path, interruption)
    assert path.read_text(encoding="utf-8") == "old σ\n"
    assert list(tmp_path.iterdir()) == [path]


def test_a_file_is_on_the_disk_before_it_has_its_name(tmp_path, monkeypatch):
    """All of its bytes: a machine that stops then has the old file or the new one."""
    path, events = tmp_path / "table.txt", []
    fsync, replace = os.fsync, pathlib.Path.replace

    def forced(file):
        fsync(file)
        events.append((os.fstat(file).st_ino, os.fstat(file).st_size, path.exists()))

    def renamed(self, target):
        events.append("renamed")
        return replace(self, target)

    monkeypatch.setattr(os, "fsync", forced)
    monkeypatch.setattr(pathlib.Path, "replace", renamed)
    storage.write_text(path, "whole\n")
    assert events == [(path.stat().st_ino, len("whole\n"), False), "renamed"]


def test_temporary_file_stands_beside_its_target_with_the_same_suffix(tmp_path):
    path = tmp_path / "new" / "deeper" / "picture.png"
    with storage.replaced_atomically(str(path)) as temporary:
        assert temporary.parent == path.parent
        assert temporary.suffix == ".png"
        assert not path.exists()
        temporary.write_bytes(b"all of it")
    assert path.read_bytes() == b"all of it"
    assert list(path.parent.iterdir()) == [path]
    assert isinstance(temporary, pathlib.Path)


@dataclasses.dataclass(frozen=True, eq=False)
class Rows(Result):
    """Arrays with named dimensions, and one of the file alone."""

    kind: ClassVar = "rows"
    row_dims = ("time",)
    times: Annotated[Array, "f8 time"]
    overturned: Annotated[Array, "f8 time side"]
    paths: Annotated[Array, "f8 path time"]
    lines: Annotated[Array, "f8 x+1"]

    def derived(self):
        return {"doubled": ("time", 2.0 * self.times)}


ROWS = Rows(np.array([0.0, 0.5]), np.array([[0.1, 0.2], [0.3, 0.4]]), np.ones((3, 2)), np.zeros(4))


def test_words_are_the_dimensions_of_the_table():
    assert list(ROWS.variables) == ["overturned", "paths", "doubled"]
    table = {name: column.tolist() for name, column in ROWS.table().items()}
    sides = {"overturned_left": [0.1, 0.3], "overturned_right": [0.2, 0.4]}
    assert table == {"time": [0.0, 0.5]} | sides | {"doubled": [0.0, 1.0]}
    assert list(table) == ["time", *sides, "doubled"]
    assert ROWS.coordinates["side"] == (("side",), ["left", "right"])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"overturned": np.ones((2, 3))}, r"overturned: got float64 of shape \(2, 3\), accepted: 'f8 time side'"),
        ({"paths": np.ones((3, 1))}, r"paths: got float64 of shape \(3, 1\), accepted: 'f8 path time' with time = 2"),
    ],
)
def test_dimensions_have_one_length(tmp_path, changes, message):
    path = tmp_path / "rows.npz"
    ROWS.save(path)
    assert Rows.load(path).paths.tolist() == ROWS.paths.tolist()
    dataclasses.replace(ROWS, **changes).save(path)
    with pytest.raises(ValueError, match=message):
        Rows.load(path)
