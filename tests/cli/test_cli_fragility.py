"""The command ``fragility``: what it prints and writes is what Python returns, and what it refuses."""

import json

import numpy as np
import pytest

from fpk_rocking import cli, load_scene
from fpk_rocking.risk import Fragility, fragility


def run(*arguments):
    """Exit status of a command."""
    return cli.main([str(argument) for argument in arguments])


@pytest.fixture
def scene_file(tmp_path, main_scene):
    (tmp_path / "scene.toml").write_text(main_scene.to_toml(), encoding="utf-8")
    return tmp_path / "scene.toml"


def test_command_line(tmp_path, capsys, scene_file):
    common = "fragility", scene_file, "--cycles", 4, "--realizations", 300, "--seed", 5
    out = tmp_path / "out"
    assert run(*common, "--scales", "0.5:1.4:4", "--levels", "0.5", "--out", out, "--json") == 0
    printed = json.loads(capsys.readouterr().out)
    kept = Fragility.load(out / "result.npz")
    direct = fragility(
        load_scene(scene_file), scale=np.geomspace(0.5, 1.4, 4), cycles=4, levels=(0.5,), realizations=300, seed=5
    )
    assert np.allclose(kept.scale, direct.scale, rtol=1e-14)
    assert printed["overturned"] == kept.overturned.tolist()
    assert np.array_equal(kept.probability, direct.probability)
    assert json.loads((out / "summary.json").read_text()) == printed
    assert {path.name for path in out.iterdir()} == {"result.npz", "summary.json", "fragility.csv", "fragility.png"}
    assert {"interval", "fits", "intensities", "wall_s", "error_estimate"} <= printed.keys()
    over = (
        "--scales",
        "0.8,1.2",
        "--over",
        "noise.variance=0.02,0.04",
        "--keep-noise",
        "--store",
        tmp_path / "rows.jsonl",
    )
    assert run(*common, *over) == 0
    text = capsys.readouterr().out
    assert "Fragility by exact, 300 realizations a point" in text
    assert (tmp_path / "rows.jsonl").read_text().count("\n") == 5


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("--scales", "1:2"), "--scales: got '1:2', accepted: numbers A,B,C, or LOW:HIGH:COUNT"),
        (("--scales", "a,b"), "--scales: got 'a,b'"),
        (("--scales", "2:1:5"), "--scales: got '2:1:5'"),
        (("--scales", "1,2", "--over", "size"), "--over: got 'size', accepted: NAME=A,B,C"),
        (("--scales", "1,2", "--engine", "fpk"), "engine: got 'fpk'"),
    ],
)
def test_command_line_refusals(capsys, scene_file, words, text):
    assert run("fragility", scene_file, *words) == 2
    assert capsys.readouterr().err.startswith(f"fpk-rocking fragility: {text}")
