"""The case of time histories and mean maps, re-run coarse."""

import json
import pathlib

import matplotlib.image
import numpy as np
import pytest

from fpk_rocking import cli
from montecarlo import Histories

CASES = pathlib.Path(__file__).parents[2] / "cases"


@pytest.fixture(scope="module")
def coarse(case, tmp_path_factory):
    """Folder and numbers of a coarse run of the second scene."""
    folder = tmp_path_factory.mktemp("histories")
    return folder, case("time_histories").run(folder, "second", cycles=4, realizations=3000, seed=3)


def test_numbers_agree_with_each_other(coarse):
    values = coarse[1]
    survival, passage = values["ensemble"]["survival"], values["first_passage"]
    by_cycle = np.array(passage["density"]) * np.diff(passage["edges"])
    assert np.cumsum(by_cycle) == pytest.approx(1.0 - np.array(survival[1:]), abs=1e-12)
    speeds = values["impact_speeds"]
    assert np.dot(speeds["density"], np.diff(speeds["edges"])) == pytest.approx(1.0, abs=1e-12)
    maps = values["maps"]
    assert set(maps) == {f"{kind}, {rule}" for kind in ("ensemble", "restarted") for rule in ("clamped", "left out")}
    for rule in ("clamped", "left out"):
        assert maps[f"ensemble, {rule}"]["points"][:2] == maps[f"restarted, {rule}"]["points"][:2]
    assert maps["ensemble, left out"]["counted"] == np.rint(3000 * np.array(survival)).tolist()


def test_survival_is_the_known_one(coarse):
    """Independent values .9595 and .4039 after 1 and 4 cycles; 4.5 standard errors, 7e-6 each."""
    survival = coarse[1]["ensemble"]["survival"]
    for cycle, expected in ((1, 0.9595), (4, 0.4039)):
        assert survival[cycle] == pytest.approx(expected, abs=4.5 * np.sqrt(expected * (1.0 - expected) / 3000))


def test_its_files_hold_numbers_and_pictures(coarse):
    folder, values = coarse
    assert {path.name for path in folder.iterdir()} == {"histories.png", "histories.json", "histories.npz"}
    assert json.loads((folder / "histories.json").read_text(encoding="utf-8")) == values
    assert Histories.load(folder / "histories.npz").realizations == 3
    pixels = matplotlib.image.imread(folder / "histories.png")[..., :3]
    assert min(pixels.shape[:2]) > 1000
    assert np.unique((255 * pixels[::4, ::4]).astype(int).reshape(-1, 3), axis=0).shape[0] > 100


def test_command_line_has_no_use_for_histories(coarse, capsys):
    file = str(coarse[0] / "histories.npz")
    assert cli.main(["compare", file, file]) != 0
    message = capsys.readouterr().err
    assert "got a saved result of kind 'histories', accepted: 'evolution' or 'ensemble' or 'tally'" in message
