"""Files of a vertical motion beside those of a record: in Python, in a scene file and in the shell."""

import csv
import json

import numpy as np
import pytest

from fpk_rocking import NoNoise, Record, Scene
from fpk_rocking.cli import main
from fpk_rocking.risk import critical_intensities, study

SIDE = np.round(0.6 * np.sin(np.arange(300) / 9.0) * np.hanning(300), 4)
UP = np.round(0.4 * np.sin(np.arange(290) / 3.0 + 1.0) * np.hanning(290), 4)
G = 9.80665


def peer(name, samples, place="OWN, 1/2/03, TOWN", step=0.02):
    """Text of a file in PEER's format."""
    body = "\n".join(map(str, samples))
    head = f"ACCELERATION TIME SERIES IN UNITS OF G\nNPTS= {len(samples)}, DT= {step} SEC"
    return f"PEER NGA\n{place}, {name}\n{head}\n{body}\n"


@pytest.fixture
def files(tmp_path):
    """Paths by name."""
    texts = {
        "side.AT2": peer("090", SIDE),
        "up.AT2": peer("UP", UP),
        "down.AT2": peer("DWN", -UP),
        "other.AT2": peer("UP", UP, "OWN, 1/2/03, ELSEWHERE"),
        "fine.AT2": peer("UP", UP, step=0.01),
        "three.csv": "time,acc_NS (gal),acc_UD (gal)\n0,1,4\n0.02,2,5\n0.04,3,6\n",
        "bare.txt": "\n".join(map(str, UP)),
    }
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
    return {name: str(tmp_path / name) for name in texts}


def test_a_vertical_motion_is_read_from_its_own_file_or_from_the_same(files):
    record = Record.from_file(files["side.AT2"], vertical=files["up.AT2"], scale=2.0)
    assert record.vertical.samples == tuple(UP)
    assert record.for_size(Scene.from_block(0.5, 1.8, record=record).block.size).swaying == pytest.approx(
        2.0 * np.append(UP, np.zeros(10))
    )
    assert str(record) == "side.AT2 with up.AT2, 300 samples of 0.02 s, 2 times"
    both = Record.from_file(files["three.csv"], vertical=files["three.csv"])
    assert (both.samples, both.vertical.samples) == ((1.0, 2.0, 3.0), (4.0, 5.0, 6.0))
    bare = Record.from_file(files["side.AT2"], vertical=files["bare.txt"], units="g", interval=0.02)
    assert bare.vertical.samples == tuple(UP)


def test_a_component_that_counts_downwards_is_turned(files):
    up, down = (Record.from_file(files["side.AT2"], vertical=files[name]) for name in ("up.AT2", "down.AT2"))
    assert up == down
    assert up != Record.from_file(files["side.AT2"])


@pytest.mark.parametrize(
    ("vertical", "message"),
    [
        ("side.AT2", r"forcing.file: '.*side.AT2': got the horizontal component '090', accepted: the vertical one"),
        ("fine.AT2", r"forcing.vertical.interval: got 0.01, accepted: 0.02, as the horizontal motion has"),
        ("none.AT2", r"forcing.file: no file '.*none.AT2'"),
    ],
)
def test_another_motion_in_its_place_is_refused(vertical, message, files, tmp_path):
    with pytest.raises((ValueError, OSError), match=message):
        Record.from_file(files["side.AT2"], vertical=tmp_path / vertical)


def test_a_vertical_motion_of_another_place_is_told(files):
    told = Record.from_file(files["side.AT2"], vertical=files["other.AT2"]).implausible
    assert told == [
        "other.AT2 and side.AT2 state different places: OWN, 1/2/03, ELSEWHERE, UP; OWN, 1/2/03, TOWN, 090."
    ]
    assert not Record.from_file(files["side.AT2"], vertical=files["up.AT2"]).implausible


@pytest.mark.parametrize(
    "names", [("009 (STATION 1)", "UP (STATION 1)"), ("N", "V (STATION 1)"), ("TR COMP", "VERTICAL COMP")]
)
def test_a_vertical_motion_of_the_same_place_is_known_by_any_name_of_components(names, tmp_path):
    for file, name, samples in zip(("side.AT2", "up.AT2"), names, (SIDE, UP), strict=True):
        (tmp_path / file).write_text(peer(name, samples))
    assert not Record.from_file(tmp_path / "side.AT2", vertical=tmp_path / "up.AT2").implausible


def test_a_scene_file_names_it_and_a_scene_keeps_its_samples(files, tmp_path):
    text = "[block.dimensions]\nwidth = 0.5\nheight = 1.8\n[noise]\nkind = 'none'\n[forcing]\nkind = 'record'\n"
    scene = Scene.from_toml(f"{text}file = 'side.AT2'\nvertical = 'up.AT2'\nscale = 1.5\n", folder=tmp_path)
    assert scene.forcing == Record.from_file(files["side.AT2"], vertical=files["up.AT2"], scale=1.5)
    again = Scene.from_toml(scene.to_toml())
    assert again == scene
    assert again.forcing.vertical.samples == tuple(UP)
    assert again != scene.varied(forcing={"vertical": None})
    assert hash(again.forcing) == hash(scene.forcing)


def test_a_baseline_is_taken_from_both(files):
    record = Record.from_file(files["side.AT2"], vertical=files["up.AT2"], baseline="mean")
    assert record.vertical.baseline == "mean"
    block = Scene.from_block(0.5, 1.8, record=record)
    suite = critical_intensities(block, [files["side.AT2"]], vertical=[files["up.AT2"]], baseline="mean", highest=1e-9)
    assert suite.scenes[0].forcing == record


def test_the_shell_scales_both_and_names_both(files, tmp_path, capsys):
    rack, records = tmp_path / "rack.toml", [files["side.AT2"]]
    rack.write_text(Scene.from_block(0.5, 1.8, "0.3 g", 1.5).to_toml())
    command = ["risk", str(rack), "--measure", "PGA", "--hazard", "1e-3:2", "--records", *records]
    assert main([*command, "--vertical", files["up.AT2"], "--out", str(tmp_path / "out")]) == 0
    out = capsys.readouterr().out
    assert f"side.AT2: PGA {np.abs(SIDE).max():.3g} g" in out
    assert f"vertical PGA {np.abs(UP).max():.3g} g" in out
    (row,) = csv.DictReader((tmp_path / "out" / "motions.csv").open())
    assert row["vertical"] == "up.AT2"
    assert float(row["vertical_pga_g"]) == pytest.approx(np.abs(UP).max())
    assert ">up.AT2<" in (tmp_path / "out" / "report.html").read_text()
    exported = (tmp_path / "out" / "rocking_block.xml").read_text(encoding="utf-8")
    assert "vertical motions act, too, and are scaled with the horizontal ones" in exported
    scene = Scene.from_block(0.5, 1.8, record=Record.from_file(records[0], vertical=files["up.AT2"]))
    result = study(scene, records, None, vertical=[files["up.AT2"]], measure="PGA")
    assert float(row["critical_intensity"]) == pytest.approx(result.critical.critical[0])
    assert result.recorded == [scene]
    for verb in (["fragility", str(rack), "--pga", "1", "--json"], ["risk", str(rack)]):
        assert main([*verb, "--records", *records, "--vertical", *records, *records]) == 2
        told = capsys.readouterr().err
        assert "vertical: got '2 motions', accepted: 1, one for each record in the same order" in told
        assert main([*verb, "--vertical", files["up.AT2"]]) == 2
        assert "vertical" in capsys.readouterr().err
    curves = ["fragility", str(rack), "--pga", "0.3,3", "--json", "--records", *records]
    assert main([*curves, "--vertical", files["up.AT2"]]) == 0
    assert json.loads(capsys.readouterr().out)["motions"]["vertical"] == ["up.AT2"]


def test_stored_rows_of_one_motion_do_not_serve_for_another(files, tmp_path):
    block = Scene.from_block(0.5, 1.8, record=Record.from_file(files["side.AT2"])).varied(noise=NoNoise())
    stored = {"measure": "scale", "store": tmp_path / "rows.jsonl"}
    critical_intensities(block, [files["side.AT2"]], **stored)
    with pytest.raises(ValueError, match="store"):
        critical_intensities(block, [files["side.AT2"]], vertical=[files["up.AT2"]], **stored)
