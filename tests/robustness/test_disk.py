"""A full disk, a folder that cannot be written to, and two runs into one folder.

The disk is full for whoever may write no file beyond some bytes (RLIMIT_FSIZE); a folder that takes no files is a file
in its place or a name too long, which holds for the superuser too.
"""

import contextlib
import json
import threading

import fakes
import pytest
import study_tasks
from test_fuzz_files import ASKED, content, evolution

from fpk_rocking import cli
from fpk_rocking.output import figures, vtk
from fpk_rocking.results import storage
from fpk_rocking.studies import sweep
from montecarlo import Ensemble, simulate

resource = pytest.importorskip("resource", reason="limits of a process are those of Unix")
WHITE = ASKED["scene"]


@contextlib.contextmanager
def disk_with(room):
    """Let no file of this process grow beyond some bytes within the block."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (room, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


NAMES = ["result", "text", "summary", "figure", "series"]


@pytest.fixture(scope="module")
def every_writer():
    """Everything that writes a file, by `NAMES`: what it is called with is the path."""
    fake = fakes.FakeEvolution(WHITE, cycles=2)
    functions = (
        evolution().save,
        lambda path: storage.write_text(path, "σ" * 4000),
        lambda path: storage.write_json(path, {"survival": [0.5] * 1000}),
        lambda path: figures.survival_figure(path.with_suffix(".png"), [fake], "Survival"),
        lambda path: vtk.write_series(path.parent, "jpdf", fake, [1, 2]),
    )
    return dict(zip(NAMES, functions, strict=True))


def state(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.mark.parametrize("name", NAMES)
def test_a_full_disk_leaves_the_old_file_and_nothing_else(name, every_writer, tmp_path):
    """However much still fits: a header, or all but the end."""
    write, path = every_writer[name], tmp_path / "kept.npz"
    write(path)
    before = state(tmp_path)
    largest = max(len(content) for content in before.values())
    for room in (100, largest - 1):
        with disk_with(room), pytest.raises(OSError, match=r"File too large|No space"):
            write(path)
        assert state(tmp_path) == before


@pytest.mark.parametrize("room", [0, 50, 400, 700])
def test_a_sweep_on_a_full_disk_goes_on_from_its_rows(room, tmp_path):
    """Full before the first line is whole, and amid rows: what is kept is read, what is not is computed again."""
    store, reported = tmp_path / "rows.jsonl", []
    asked = {"task": study_tasks.amplitude, "store": store}
    with disk_with(room), pytest.raises(OSError, match=r"File too large|No space"):
        sweep([WHITE] * 9, **asked, progress=lambda done, _: reported.append(done))
    before = store.read_bytes()
    assert len(before) == room
    assert before.count(b"\n") == max(reported, default=-1) + 1
    continued = sweep([WHITE] * 9, **asked)
    assert [row["values"] for row in continued.rows] == [
        row["values"] for row in sweep([WHITE] * 9, asked["task"]).rows
    ]
    assert [json.loads(line)["cell"] for line in store.read_text().splitlines()[1:]] == list(range(9))
    assert store.read_bytes().startswith(before[: before.rfind(b"\n") + 1])


def test_the_command_line_on_a_full_disk(tmp_path, capfd):
    scene, out = tmp_path / "scene.toml", tmp_path / "out"
    scene.write_text(WHITE.to_toml(), encoding="utf-8")
    command = ["mc", str(scene), "--cycles", "2", "--realizations", "2000", "--out", str(out)]
    assert cli.main(command) == 0
    before = state(out)
    capfd.readouterr()
    with disk_with(2000):
        assert cli.main(command) == 2
    printed, said = capfd.readouterr()
    assert printed == ""
    assert said.startswith("fpk-rocking mc: ")
    assert said.count("\n") == 1
    assert state(out) == before


def test_a_folder_that_cannot_be_made_is_refused_before_the_work(tmp_path, capsys, monkeypatch):
    scene = tmp_path / "scene.toml"
    scene.write_text(WHITE.to_toml(), encoding="utf-8")
    (tmp_path / "file").write_text("in the way\n")
    command = ["mc", str(scene), "--cycles", "1", "--realizations", str(2**31), "--tally", "--out"]
    assert cli.main([*command, str(tmp_path / "file" / "deeper" / "still")]) == 2
    assert "--out: got the file" in capsys.readouterr().err
    monkeypatch.setattr("os.access", lambda *_: False)
    assert cli.main([*command, str(tmp_path / "new")]) == 2
    assert capsys.readouterr().err.endswith("accepted: a folder that can be written to\n")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "scene.toml"]


def test_a_reader_sees_whole_results_while_others_write(tmp_path):
    """Two writers of one file, 30 times each: whoever reads meanwhile finds one of the two, whole."""
    path = tmp_path / "result.npz"
    results = [simulate(**ASKED | {"seed": seed, "realizations": 500}) for seed in (1, 2)]
    contents = [content(result) for result in results]
    results[0].save(path)

    def write(result):
        for _ in range(30):
            result.save(path)

    writers = [threading.Thread(target=write, args=(result,)) for result in results]
    for writer in writers:
        writer.start()
    seen = []
    while any(writer.is_alive() for writer in writers) or not seen:
        seen.append(contents.index(content(Ensemble.load(path))))
    assert len(seen) > 5
    assert [file.name for file in tmp_path.iterdir()] == ["result.npz"]
