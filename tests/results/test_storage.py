"""Files that are whole or not there, and results that come back bit by bit."""

import json
import math
import os
import pathlib

import numpy as np
import pytest

from fpk_rocking import Block, Dimensions, Harmonic, NoNoise, Scene
from fpk_rocking.results import storage
from fpk_rocking.results.layout import Layout

SCENE = Scene(Block(1 / 3, Dimensions(0.4, 1.7)), Harmonic(4.6, 2.7, math.pi), NoNoise())
ARRAYS = {
    "survival": np.array([1.0, 0.1 + 0.2, math.nan, -0.0]),
    "counts": np.arange(6, dtype=np.int32).reshape(2, 3),
    "flags": np.array([True, False]),
    "empty": np.zeros((0, 4)),
}
LAYOUT = Layout(
    {"survival": "f8 n", "counts": "i4 2 k+1", "flags": "? 2", "empty": "f8 m n"},
    {"seed": int, "method": str, "wall_s": float, "closure": str, "tol": type(None), "bins": list},
)
ATTRIBUTES = {"seed": 2**63, "method": "rk4", "wall_s": 0.1, "closure": "σ_M²/2", "tol": None, "bins": [1, 2.5]}


@pytest.fixture
def saved(tmp_path):
    path = tmp_path / "result.npz"
    storage.write_result(path, "ensemble", SCENE, ARRAYS, ATTRIBUTES)
    return path


def test_result_comes_back_bit_by_bit(saved):
    scene, arrays, attributes = storage.read_result(saved, "ensemble", LAYOUT)
    assert scene == SCENE
    assert attributes == ATTRIBUTES
    assert arrays.keys() == ARRAYS.keys()
    for name, values in ARRAYS.items():
        assert arrays[name].dtype == values.dtype
        assert arrays[name].shape == values.shape
        assert arrays[name].tobytes() == values.tobytes()
    assert storage.result_kind(saved) == "ensemble"
    assert [file.name for file in saved.parent.iterdir()] == ["result.npz"]


def test_header_names_the_versions(saved):
    with np.load(saved, allow_pickle=False) as archive:
        header = json.loads(str(archive["header"]))
    assert header["format"] == 6
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
        storage.read_result(saved, "ensemble", LAYOUT)
    assert not trace.exists()


def test_another_kind_is_refused(saved):
    with pytest.raises(ValueError, match=r"result\.npz: got a result of kind 'ensemble', accepted: 'evolution'"):
        storage.read_result(saved, "evolution", LAYOUT)


@pytest.mark.parametrize("number", [5, 7])
def test_another_format_is_refused(saved, number):
    np.savez(saved, header=np.array(json.dumps({"format": number, "kind": "ensemble"})))
    with pytest.raises(ValueError, match=rf"got format {number}, accepted: 6"):
        storage.result_kind(saved)


@pytest.mark.parametrize("kept", [0, 10, 0.5, 0.999])
def test_truncated_file_is_refused(saved, kept):
    whole = saved.read_bytes()
    saved.write_bytes(whole[: kept if kept >= 1 else int(kept * len(whole))])
    for read in (storage.result_kind, lambda path: storage.read_result(path, "ensemble", LAYOUT)):
        with pytest.raises(ValueError, match=r"result\.npz: not a saved result, or truncated"):
            read(saved)


def test_damaged_array_is_refused(saved):
    content = bytearray(saved.read_bytes())
    where = content.index(ARRAYS["survival"].tobytes())
    content[where + 3] ^= 255
    saved.write_bytes(content)
    with pytest.raises(ValueError, match=r"result\.npz: a damaged saved result"):
        storage.read_result(saved, "ensemble", LAYOUT)


def test_a_flipped_bit_of_a_shape_is_refused(tmp_path):
    """A smaller shape or type reads only a part of the array: its checksum must be taken over all of it."""
    path, layout = tmp_path / "large.npz", Layout({"values": "f8 n k"}, {})
    values = np.arange(3200.0).reshape(800, 4)
    storage.write_result(path, "ensemble", SCENE, {"values": values}, {})
    whole = path.read_bytes()
    for k in range(8 * 128):
        spoiled = bytearray(whole)
        spoiled[whole.index(b"\x93NUMPY", whole.index(b"values.npy")) + k // 8] ^= 1 << k % 8
        path.write_bytes(spoiled)
        with pytest.raises(ValueError, match="a damaged saved result"):
            storage.read_result(path, "ensemble", layout)


def test_other_files_are_refused(tmp_path):
    text, plain = tmp_path / "notes.txt", tmp_path / "plain.npz"
    text.write_text("survival 0.5\n")
    np.savez(plain, survival=np.ones(3))
    with pytest.raises(ValueError, match=r"notes\.txt: not a saved result"):
        storage.result_kind(text)
    with pytest.raises(ValueError, match=r"plain\.npz: not a saved result \(no header\)"):
        storage.read_result(plain, "ensemble", LAYOUT)
    with pytest.raises(FileNotFoundError, match=r"no result file .*absent\.npz"):
        storage.read_result(tmp_path / "absent.npz", "ensemble", LAYOUT)


def test_what_json_does_not_hold_is_refused_and_leaves_no_file(tmp_path):
    with pytest.raises(TypeError, match="int64"):
        storage.write_result(tmp_path / "result.npz", "ensemble", SCENE, ARRAYS, {"seed": np.int64(1)})
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
