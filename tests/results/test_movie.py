"""Movies: a frame for each row, the whole file or none, and refusals before any work."""

import itertools
import pathlib
import stat

import numpy as np
import pytest
from PIL import Image, ImageSequence

from fpk_rocking import cli, load_scene, solve_fpk
from fpk_rocking.results import movie, pictures
from montecarlo import simulate

SCENE = load_scene("main").white_equivalent()


@pytest.fixture(scope="module")
def paths():
    return simulate(SCENE, cycles=4, samples_per_cycle=2, realizations=500)


@pytest.fixture(scope="module")
def density():
    options = {"tol": 3e-2, "bins_tol": np.inf, "noise_replacement": "white"}
    return solve_fpk(SCENE, cycles=2, samples_per_cycle=2, **options)


def frames(path):
    with Image.open(path) as image:
        return [np.asarray(frame.convert("RGB"), dtype=float) for frame in ImageSequence.Iterator(image)]


def orange(frame, left):
    """Part of the pixels of one side bar that have the colour of what has overturned; the bars are narrow."""
    red, green, blue = frame.transpose(2, 0, 1)
    columns = np.flatnonzero(((red > 180) & (green < 190) & (blue < 140) & (red - blue > 80)).any(axis=0))
    middle = frame.shape[1] / 3
    return columns[columns < middle].size if left else columns[columns >= middle].size


def test_a_movie_has_a_frame_for_each_row_and_shows_what_overturned(paths, tmp_path):
    done = []
    file = paths.animate(tmp_path / "new" / "paths.gif", frames_per_second=20.0, progress=lambda *at: done.append(at))
    shown = frames(file)
    assert len(shown) == 9
    assert done == [(row, 9) for row in range(1, 10)]
    assert orange(shown[0], left=True) == orange(shown[0], left=False) == 0
    assert paths.overturned[-1].min() > 0.0
    assert orange(shown[-1], left=True) > 0 < orange(shown[-1], left=False)
    assert all(np.abs(a - b).max() > 50 for a, b in itertools.pairwise(shown))
    with Image.open(file) as image:
        assert image.info["duration"] == 50  # milliseconds
    assert [path.name for path in file.parent.iterdir()] == ["paths.gif"]


def test_the_plane_shows_the_bins_of_each_row(density):
    cycles = [density.cycle_of(row) for row in range(5)]
    edges = pictures.edges_of([density], cycles)
    areas = np.multiply.outer(*map(np.diff, edges))
    values = np.maximum([density.bin_probabilities(cycle, *edges) / areas for cycle in cycles], 0.0)
    with pictures.drawing() as new_figure:
        figure = new_figure()
        draw = movie._panels(figure, density, edges, values)
        for row in (3, 1):
            draw(row)
            plane = next(axes for axes in figure.axes if axes.get_ylabel().startswith("velocity"))
            top = np.median(values.max(axis=(1, 2)))
            assert np.array_equal(plane.collections[0].get_array(), np.minimum(values[row], top).T)
            assert plane.get_title() == f"forcing cycles: {row / 2:.3f}"


def test_what_is_no_movie_is_refused(paths, density, tmp_path, monkeypatch):
    for name in ("paths.avi", "paths"):
        with pytest.raises(ValueError, match=r"^path: got .*paths.*, accepted: a name that ends with \.gif or \.mp4"):
            paths.animate(tmp_path / name)
    with pytest.raises(ValueError, match=r"^frames_per_second: got 0"):
        density.animate(tmp_path / "density.gif", frames_per_second=0)
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(ValueError, match=r"accepted: \.gif, as \.mp4 needs the program ffmpeg, which is not found"):
        paths.animate(tmp_path / "paths.mp4")
    assert list(tmp_path.iterdir()) == []


@pytest.fixture
def ffmpeg(tmp_path, monkeypatch):
    """A program of this name that writes its arguments and all that it is given to the file that is named last."""

    def program(body):
        file = tmp_path / "bin" / "ffmpeg"
        file.parent.mkdir(exist_ok=True)
        file.write_text(f"#!/bin/sh\n{body}\n")
        file.chmod(file.stat().st_mode | stat.S_IEXEC)
        monkeypatch.setenv("PATH", f"{file.parent}:/usr/bin:/bin")

    return program


def test_an_mp4_is_written_by_ffmpeg_and_only_when_that_succeeds(paths, ffmpeg, tmp_path):
    ffmpeg('for last; do :; done; cat > "$last"')
    size = paths.animate(tmp_path / "paths.mp4").stat().st_size
    assert size % 9 == 0
    ffmpeg("cat > /dev/null; echo no such codec >&2; exit 1")
    with pytest.raises(OSError, match=r"other\.mp4: ffmpeg failed"):
        paths.animate(tmp_path / "other.mp4")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bin", "paths.mp4"]


def test_a_movie_that_is_stopped_leaves_the_file_that_was_there(paths, tmp_path):
    file = tmp_path / "paths.gif"
    file.write_bytes(b"old")

    def stop(*_):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        paths.animate(file, progress=stop)
    assert file.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [file]


def test_the_command_line_writes_movies_and_refuses_before_any_work(tmp_path, capsys):
    file = pathlib.Path(tmp_path) / "paths.gif"
    assert cli.main(["mc", "main", "--cycles", "1", "--realizations", "200", "--movie", str(file)]) == 0
    assert len(frames(file)) == 17
    arguments = ["fpk", "main", "--cycles", "1", "--tol", "0.03", "--no-check", "--samples-per-cycle", "3"]
    assert cli.main([*arguments, "--out", str(tmp_path), "--movie", str(tmp_path / "density.gif")]) == 0
    assert len(frames(tmp_path / "density.gif")) == 4
    assert len(list(tmp_path.glob("jpdf_*.vtu"))) == 4
    capsys.readouterr()
    for name, said in (("x.avi", "a name that ends with"), (".", "a file to write")):
        assert cli.main(["fpk", "main", "--movie", str(tmp_path / name)]) == 2
        assert said in capsys.readouterr().err
    assert cli.main(["mc", "main", "--tally", "--samples-per-cycle", "2"]) == 2
    assert "--samples-per-cycle: got 2, accepted: nothing beside --tally" in capsys.readouterr().err
