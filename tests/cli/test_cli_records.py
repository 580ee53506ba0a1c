"""Files of recorded motions in the shell: `records`, and what `risk` and `fragility` make of several of them."""

import json
import pathlib

import numpy as np
import pytest

from fpk_rocking import Record, Scene
from fpk_rocking.cli import main
from fpk_rocking.risk.records import survey

SAMPLES = np.round(0.3 * np.sin(np.arange(120) / 7.0) ** 3 * np.hanning(120), 4)


@pytest.fixture
def files(tmp_path):
    """Files by name: with a component, with three, without a unit, a vertical one, and two that are refused."""
    rows = "".join(f"{0.01 * k:.2f},{a},{-a},{2 * a}\n" for k, a in enumerate(SAMPLES))
    body = "\n".join(map(str, SAMPLES)) + "\n"
    texts = {
        "one.AT2": f"PEER\nOWN, 1/2/03, TOWN, 040\nACCELERATION IN UNITS OF G\nNPTS= 120, DT= .0100 SEC\n{body}",
        "three.csv": f"time,acc_NS (g),acc_EW (g),acc_UD (g)\n{rows}",
        "bare.th": body,
        "cut.AT2": f"PEER\nOWN, 1/2/03, TOWN, 040\nACCELERATION IN UNITS OF G\nNPTS= 130, DT= .0100 SEC\n{body}",
        "up.AT2": f"PEER\nOWN, 1/2/03, TOWN, UP\nACCELERATION IN UNITS OF G\nNPTS= 120, DT= .0100 SEC\n{body}",
        "velocity.txt": body,
    }
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
    return {name: str(tmp_path / name) for name in texts}


def test_records_prints_a_row_for_each_component_and_bad_files_at_the_end(files, capsys):
    assert main(["records", *files.values()]) == 2
    out, err = capsys.readouterr()
    assert err == "fpk-rocking records: files: 2 of 6 cannot be read\n"
    lines = out.splitlines()
    assert [line.split()[0] for line in lines[1:8]] == [
        "one.AT2",
        *["three.csv"] * 3,
        "bare.th",
        "up.AT2",
        "velocity.txt",
    ]
    assert lines[1].split()[1:] == [
        "PEER",
        "1",
        "040",
        "g",
        "0.01",
        "120",
        f"{np.abs(SAMPLES).max():.4g}",
        *lines[1].split()[8:9],
        "read",
    ]
    assert lines[2].endswith("choose: --component 1")
    for line, peak in ((lines[4], 2.0 * np.abs(SAMPLES).max()), (lines[6], np.abs(SAMPLES).max())):
        assert line.endswith("vertical motion (--vertical)")
        assert f" {peak:.4g} " in line
    assert lines[5].endswith("needs --units --interval")
    assert lines[7].endswith("not read: a velocity, as the name of the file says; needs --units --interval")
    assert [line.partition(": got ")[2][:12] for line in lines[8:]] == ["120 samples,", "a velocity, "]
    assert main(["records", files["one.AT2"], files["up.AT2"]]) == 0
    assert capsys.readouterr().err == ""
    assert (
        main(
            [
                "records",
                files["three.csv"],
                files["bare.th"],
                "--component",
                "EW",
                "--units",
                "gal",
                "--interval",
                ".02",
                "--json",
            ]
        )
        == 0
    )
    rows = json.loads(capsys.readouterr().out)["records"]
    assert [row["does"].partition(";")[0] for row in rows[:2]] == ["left out", "read"]
    assert (rows[3]["unit"], rows[3]["interval"]) == ("gal", 0.02)
    assert rows[3]["pga"] == pytest.approx(np.abs(SAMPLES).max() / 980.665)
    assert "is its unit cm/s2" in rows[3]["does"]


def test_the_velocity_and_the_drift_of_a_row_are_those_of_the_record(files):
    (row,), refused = survey([files["one.AT2"]])
    assert refused == []
    velocity = 9.80665 * 0.01 * np.cumsum(0.5 * (SAMPLES[1:] + SAMPLES[:-1]))
    assert row.pgv == pytest.approx(np.abs(velocity).max())
    assert (row.samples, row.drift, row.does) == (120, "", "read")


def test_peaks_of_a_row_are_those_of_the_corrected_samples(files, capsys):
    assert main(["records", files["one.AT2"], "--baseline", "high-pass", "--corner-hz", "2", "--json"]) == 0
    row = json.loads(capsys.readouterr().out)["records"][0]
    record = Record.from_file(files["one.AT2"], baseline="high-pass", corner_hz=2.0)
    assert row["pga"] == pytest.approx(np.abs(record.corrected_samples).max(), rel=1e-9)
    assert row["pga"] < 0.8 * np.abs(SAMPLES).max()
    assert row["pgv"] == pytest.approx(record.drift.pgv)


def test_what_files_leave_open_is_given_in_the_shell_and_all_bad_ones_are_named(files, tmp_path, capsys):
    rack = tmp_path / "rack.toml"
    rack.write_text(Scene.from_block(0.5, 1.8, "0.3 g", 1.5).to_toml())
    good = [files[name] for name in ("one.AT2", "three.csv", "bare.th")]
    stated = ["--units", "g", "--interval", "0.03", "--component", "EW"]
    curves = ["fragility", str(rack), "--pga", "0.3,1", "--realizations", "1", "--json", "--records"]
    assert main([*curves, *good, *stated]) == 0
    assert json.loads(capsys.readouterr().out)["pooled"]["records"] == 3
    for command in (curves, ["risk", str(rack), "--hazard", "1e-3:2", "--records"]):
        assert main([*command, *files.values()]) == 2
        err = capsys.readouterr().err
        assert "records: 5 of 6 files are refused (a line for each: fpk-rocking records): records: '" in err
        for name in ("three.csv", "bare.th", "cut.AT2", "up.AT2", "velocity.txt"):
            assert name in err
    for option, value in (("units", "gal"), ("interval", "0.02")):
        assert main([*curves, files["one.AT2"], f"--{option}", value]) == 2
        assert f"{option}: got {value!r}, accepted: nothing, as all files say their" in capsys.readouterr().err.replace(
            "0.02,", "'0.02',"
        )
    assert main(["fragility", str(rack), "--pga", "1", "--component", "EW"]) == 2
    assert "--component: got 'EW', accepted: together with --records" in capsys.readouterr().err


@pytest.mark.usefixtures("files")
def test_a_scene_file_takes_the_same_keys(tmp_path):
    scene = "[block.dimensions]\nwidth = 0.5\nheight = 1.8\n[noise]\nkind = 'none'\n[forcing]\nkind = 'record'\n"
    own = Scene.from_toml(f"{scene}file = 'three.csv'\ncomponent = 'EW'\n", folder=tmp_path).forcing
    assert own.samples == tuple(-SAMPLES)
    bare = f"{scene}file = 'bare.th'\nunits = '%g'\ninterval = 0.02\n"
    own = Scene.from_toml(bare, folder=tmp_path).forcing
    assert (own.interval, own.units) == (0.02, "%g")
    with pytest.raises(ValueError, match=r"forcing.interval: missing, the file '.*bare.th' does not say it"):
        Scene.from_toml(bare.replace("interval", "scale"), folder=tmp_path)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--records", "no.AT2"], "records: no file 'no.AT2'"),
        (["--records", "one.AT2", "--ground", "no.AT2"], "ground: no file 'no.AT2'"),
        (["--records", "one.AT2", "--vertical", "no.AT2"], "vertical: no file 'no.AT2'"),
        (["--records", "one.AT2", "--hazard", "no.csv"], "hazard: no file 'no.csv'"),
        (["--records", "one.AT2", "--hazard", "."], "hazard: '.' cannot be read (Is a directory)"),
        ([], "rack.toml: forcing: missing, required: [forcing], or recorded motions in its place (--records)"),
        (["--mass", "400 kg"], "argument --mass: got '400 kg', accepted: a number without a unit"),
        (
            ["rack.toml", "--synthetic", "5", "--mass", "400"],
            "--mass: got 400.0, accepted: one scene, not 2",
        ),
        (["--synthetic", "5", "--keep-noise"], "--keep-noise: got scenes without noise, accepted: scenes with [noise]"),
        (["--seed", "1.5"], "argument --seed: got '1.5', accepted: a whole number"),
        (["--records", "one.AT2", "--intensities", "0,1"], "intensities[0]: got 0.0, accepted: a finite number > 0.0"),
    ],
)
def test_what_is_missing_or_no_number_is_refused_by_the_name_of_its_option(files, words, said, monkeypatch, capsys):
    monkeypatch.chdir(pathlib.Path(files["one.AT2"]).parent)
    pathlib.Path("rack.toml").write_text("[block.dimensions]\nwidth = 0.5\nheight = 1.8\n[noise]\nkind = 'none'\n")
    try:
        status = main(["risk", "rack.toml", *words])
    except SystemExit as end:
        status = end.code
    assert (status, capsys.readouterr().err) == (2, f"fpk-rocking risk: {said}\n")
