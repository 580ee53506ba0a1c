"""Studies of risk, in Python and in the shell: files, names of motions, options, added intensities."""

import csv
import dataclasses
import html
import importlib.metadata
import json
import math
import re
import shlex

import numpy as np
import pytest
from suites import SIZE, record

from fpk_rocking import BandNoise, Block, Harmonic, NoNoise, Scene, cli
from fpk_rocking.risk import Hazard, IntensityCurve, annual_frequency, at_intensity, fragility, study, synthetic_records
from fpk_rocking.risk.curves import Fragility
from fpk_rocking.risk.designs import Designs
from fpk_rocking.risk.motions import intensities
from fpk_rocking.risk.rate import number_text
from fpk_rocking.studies.tasks import TASKS


def written_records(folder, count):
    """Paths of text files with some of the records, in m/s²."""
    files = [folder / f"{n}.txt" for n in range(count)]
    for n, file in enumerate(files):
        file.write_text("\n".join(f"{0.02 * k:.2f} {a!r}" for k, a in enumerate(record(n).samples)))
    return files


def without_forcing(scene):
    """Text of a scene file without its table of the forcing."""
    kept = "\n".join(part for part in scene.to_toml().split("\n\n") if not part.startswith("[forcing]"))
    assert "forcing" not in kept
    return kept


def test_a_study_writes_all_that_is_handed_on(tmp_path, capsys):
    """Six records from files by the command line; the figures of its JSON are those of the parts, one by one."""
    scene = Scene(Block(0.9, SIZE), Harmonic(1.0, 2.0), BandNoise(0.02, (0.0, 8.0), 20))
    (tmp_path / "rack.toml").write_text(scene.to_toml())
    (tmp_path / "h.csv").write_text("0.1,1e-1\n1,1e-3\n10,1e-6\n")
    files = written_records(tmp_path, 6)
    arguments = [
        "risk",
        str(tmp_path / "rack.toml"),
        "--records",
        *map(str, files),
        "--hazard",
        str(tmp_path / "h.csv"),
    ]
    arguments += ["--intensities", "0.2:3:7", "--units", "m/s2", "--realizations", "200", "--name", "rack"]
    assert cli.main([*arguments, "--out", str(tmp_path / "out")]) == 0
    printed = capsys.readouterr()
    assert "return period" in printed.out
    names = {file.name for file in (tmp_path / "out").iterdir()}
    assert names >= {"result.npz", "risk.json", "risk.txt", "curve.csv", "rack.xml", "risk.png", "report.html"}
    values = json.loads((tmp_path / "out" / "risk.json").read_text())
    scenes = [at_intensity(Scene(Block(0.9, SIZE), record(n), scene.noise)) for n in range(6)]
    curves = fragility(scenes, scale=np.geomspace(0.2, 3.0, 7), realizations=200)
    places = np.searchsorted(values["fragility"]["scale"], curves.scale * (1.0 - 1e-9))
    assert np.array(values["fragility"]["overturned"])[:, places].tolist() == curves.overturned.tolist()
    assert len(values["fragility"]["scale"]) == 7 + values["added_intensities"]
    curves = Fragility.load(tmp_path / "out" / "result.npz")
    risk = annual_frequency(IntensityCurve.of(curves, "PGV"), Hazard([0.1, 1.0, 10.0], [1e-1, 1e-3, 1e-6]))
    assert values["risk"]["rate"] == pytest.approx(risk.rate, rel=1e-12)
    page = (tmp_path / "out" / "report.html").read_text()
    for said in (
        "rack: annual rate of overturning = ",
        "0.6 m",
        "16.7°",
        "default-src 'none'",
        "What is left out",
        "How to cite",
    ):
        assert said in page
    rows = list(csv.DictReader((tmp_path / "out" / "motions.csv").open(encoding="utf-8")))
    assert list(rows[0]) == ["motion", "pga_g", "pgv_m_per_s"]
    for n, (file, row) in enumerate(zip(files, rows, strict=True)):
        # As they are recorded, and not as they are scaled to an intensity.
        own = intensities(Scene(Block(0.9, SIZE), record(n), scenes[n].noise))
        pga, pgv = own.pga / 9.80665, own.pgv
        factors = f"<td>{0.2 / pgv:.3g} to {3.0 / pgv:.3g}</td>"
        assert f">{file.name}</td><td>5.98</td>{factors}<td>{pga:.4g}</td><td>{pgv:.4g}</td>" in page
        assert f"{file.name}: PGA {pga:.3g} g, PGV {pgv:.3g} m/s.\n" in printed.out
        assert (row["motion"], float(row["pga_g"])) == (file.name, pytest.approx(pga, rel=1e-9))
        assert values["motions"]["pgv_m_per_s"][n] == pytest.approx(pgv, rel=1e-9)
    rms = math.sqrt(scenes[0].noise.variance) * SIZE.critical_angle
    assert f"rms {rms:.3g} g, 0 to {8.0 / SIZE.frequency(1.0):.3g} Hz" in page
    rates = [f"{value:.2e}".replace("e-0", "e-") for value in (risk.rate, *values["risk"]["interval"])]
    assert "annual rate of overturning = {} (95 %: {} to {})".format(*rates) in page
    # The headline stands once, the forcing of the scene file, which the records replace, nowhere.
    visible = page[page.index("<h1>") : page.index("<script")]
    assert visible.count("annual rate of overturning") == 1
    assert "<p>Return period " in visible
    assert "[block.dimensions]" in visible
    assert "[forcing]" not in visible
    rows = zip(*(values["curve"][name] for name in ("low", "high", "probability")), strict=True)
    for low, high, share in rows:
        assert "".join(f"<td>{number_text(value)}</td>" for value in (share, low, high)) in page
    assert Fragility.load(tmp_path / "out" / "result.npz").overturned.tolist() == curves.overturned.tolist()
    assert cli.main([*arguments, "--measure", "PGD"]) == 2
    assert "measure: got 'PGD', accepted: 'PGA', 'PGV'" in capsys.readouterr().err


def test_a_study_of_synthetic_motions_and_uncertain_blocks(tmp_path, capsys):
    scene = Scene(Block(0.9, SIZE), record(0), BandNoise(0.01, (0.0, 9.0), 20))
    (tmp_path / "rack.toml").write_text(scene.to_toml())
    (tmp_path / "h.csv").write_text("0.1,1e-1\n1,1e-3\n10,1e-6\n")
    arguments = ["risk", str(tmp_path / "rack.toml"), "--hazard", str(tmp_path / "h.csv"), "--intensities", "0.2:3:5"]
    arguments[3] = "1e-3:2.5"
    arguments += ["--synthetic", "5", "--realizations", "30"]
    drawing = ["--uncertain", "size_factor=lognormal:1:0.1", "--blocks", "2"]
    assert cli.main([*arguments, *drawing, "--json"]) == 0
    values = json.loads(capsys.readouterr().out)
    assert values["draws"]["origin"] == [0, 0, 1, 1, 2, 2, 3, 3, 4, 4]
    assert list(values["curve"]["sources"]) == ["noise", "size_factor", "record to record"]
    assert len(values["fragility"]["overturned"]) == 10
    # The rate is by the points; that of the lognormal fit is near.
    by_fit = 1e-3 * values["risk"]["median"] ** -2.5 * math.exp(0.5 * (2.5 * values["risk"]["dispersion"]) ** 2)
    assert values["risk"]["rate"] == pytest.approx(by_fit, rel=0.1)
    assert set(values["rank_correlation"]) == {"PGA", "PGV", "Sa(0.3)", "Sa(1.0)", "Sa(3.0)"}
    arguments[3] = "1e-3:-1"
    assert cli.main(arguments) == 2
    assert "--hazard: got '1e-3:-1', accepted: a file, or K0:K (exponent: got -1.0" in capsys.readouterr().err
    arguments[3] = "475:0.15"
    assert cli.main(arguments) == 2
    assert "K0:K (rate at 1 g or 1 m/s: got 475.0, accepted: a finite number > 0.0 and <= 1.0)" in (
        capsys.readouterr().err
    )
    arguments[3] = str(tmp_path / "h.csv")
    assert cli.main([*arguments, "--records", "x.AT2"]) == 2
    assert "--synthetic: got 5, accepted: nothing beside --records" in capsys.readouterr().err


def test_options_of_the_command_line_are_those_of_python(tmp_path, capsys):
    scene = Scene(Block(0.9, SIZE), record(0), BandNoise(0.01, (0.0, 9.0), 20))
    (tmp_path / "rack.toml").write_text(scene.to_toml())
    arguments = ["risk", str(tmp_path / "rack.toml"), "--hazard", "1e-3:2", "--intensities", "0.4,0.8,1.6", "--json"]
    arguments += ["--synthetic", "5", "--realizations", "20", "--seed", "7", "--measure", "PGA", "--keep-noise"]
    assert cli.main([*arguments, "--set", "block.restitution=0.8"]) == 0
    values = json.loads(capsys.readouterr().out)
    changed = scene.varied(block={"restitution": 0.8})
    options = {"measure": "PGA", "scale_noise": False, "realizations": 20, "seed": 7}
    result = study(changed, synthetic_records(5, seed=7), Hazard.power_law(1e-3, 2.0), (0.4, 0.8, 1.6), **options)
    assert values["fragility"]["overturned"] == result.fragility.overturned.tolist()
    assert (values["risk"]["measure"], values["risk"]["unit"]) == ("PGA", "g")
    assert len({json.dumps(row) for row in values["fragility"]["overturned"]}) > 1
    assert values["trust"]["verdict"] in {"caution", "do not use"}
    equal = [record(1), *map(record, range(1, 6))]
    twice = study(changed, equal, None, (0.4, 1.6), realizations=5)
    assert "1 of 6 motions is equal to another one, and they count as one." in twice.trust.reasons
    assert twice.curve.records == 5
    assert not any("equal to another" in reason for reason in result.trust.reasons)
    refused = (
        r"records: got 5 of 4 events, accepted: 1, or at least 5 of different events; .* \(1\), .* \(2\) have the "
    )
    with pytest.raises(ValueError, match=refused):
        study(changed, equal[:5], None, (0.4, 1.6), realizations=5)
    for text in ("block.restitution", "=0.8", " =0.8"):
        assert cli.main([*arguments, "--set", text]) == 2
        assert f"--set: got {text!r}, accepted: KEY=VALUE" in capsys.readouterr().err


def test_the_forcing_of_a_scene_that_records_replace_is_told(tmp_path, capsys):
    """Its own record 1.43 times as strong, or a harmonic one; not the same record, nor one that acts."""
    files = [str(file) for file in written_records(tmp_path, 5)]
    block, stronger = Block(0.9, SIZE), dataclasses.replace(record(0), scale=1.43, source="own.AT2")
    own = "record: own.AT2, 300 samples of 0.02 s, 1.43 times"
    forcings = {own: stronger, "harmonic: A = 1.5, Ω = 2, Ψ = 0": Harmonic(1.5, 2.0), "": record(0)}
    runs = [*((forcing, files, told) for told, forcing in forcings.items()), (stronger, [], "")]
    for forcing, records, told in runs:
        (tmp_path / "rack.toml").write_text(Scene(block, forcing, NoNoise()).to_toml())
        words = ["--units", "m/s2", "--records", *records] if records else []
        assert cli.main(["risk", str(tmp_path / "rack.toml"), "--json", *words]) == 0
        remarks = json.loads(capsys.readouterr().out)["remarks"]
        said = [sentence for sentence in remarks if sentence.startswith("The forcing of the scene")]
        assert said == [f"The forcing of the scene ({told}) is not used: the records replace it."] * bool(told)
    found = study(Scene(block, stronger, NoNoise()), [record(n) for n in range(5)], None)
    for answer in (found, Designs((found, dataclasses.replace(found, name="other")))):
        assert answer.text().count(f"The forcing of the scene ({own}) is not used") == 1


def test_a_scene_whose_motions_are_given_needs_no_forcing_and_a_store_goes_on(tmp_path, capsys, monkeypatch):
    """Interrupted at its fourth point: nothing is written but the store, and the same command computes the others."""
    scene = Scene(Block(0.9, SIZE), record(0), BandNoise(0.01, (0.0, 9.0), 20))
    text, kept = scene.to_toml(), without_forcing(scene)
    missing = kept + '\n[forcing]\nkind = "record"\nfile = "x"\n'
    motions = ["--intensities", "0.4,0.8", "--realizations", "20", "--units", "m/s2", "--json", "--records"]
    motions += map(str, written_records(tmp_path, 5))
    outcomes = []
    for number, content in enumerate((text, kept, missing)):
        file = tmp_path / f"rack{number}.toml"
        file.write_text(content)
        assert cli.main(["risk", str(file), *motions]) == 0
        answer = json.loads(capsys.readouterr().out)
        assert "forcing of the scene" not in " ".join(answer["remarks"])
        outcomes.append(answer["fragility"]["overturned"])
    assert outcomes[0] == outcomes[1] == outcomes[2]
    words = [*motions, "--hazard", "1e-3:2"]
    assert cli.main(["risk", str(file), *words]) == 0
    undisturbed = json.loads(capsys.readouterr().out)
    arguments = ["risk", str(file), *words, "--store", str(tmp_path / "points"), "--out", str(tmp_path / "out")]
    computed, task = [], TASKS["mc"]

    def stopping(scene, **options):
        computed.append(scene)
        if len(computed) == 4:
            raise KeyboardInterrupt
        return task(scene, **options)

    stopping.__module__, stopping.__qualname__ = task.__module__, task.__qualname__
    monkeypatch.setitem(TASKS, "mc", stopping)
    assert cli.main(arguments) == 130
    left = f"fpk-rocking: interrupted; the same command goes on from {tmp_path / 'points'}\n"
    assert capsys.readouterr().err.endswith(left)
    assert not (tmp_path / "out").exists()
    assert cli.main(arguments) == 0
    added = 5 * undisturbed["added_intensities"]
    assert len(computed) == 4 + 7 + added > 4 + 7
    written = json.loads((tmp_path / "out" / "risk.json").read_text())
    assert written["fragility"]["overturned"] == undisturbed["fragility"]["overturned"]
    capsys.readouterr()
    assert cli.main(arguments[: arguments.index("--out")]) == 0
    assert json.loads(capsys.readouterr().out)["fragility"]["overturned"] == undisturbed["fragility"]["overturned"]
    assert len(computed) == 4 + 7 + added


def test_rows_of_a_fragility_of_records_have_the_names_of_the_files(tmp_path, capsys):
    """In the terminal, in the CSV and in the JSON, each with its own probabilities."""
    (tmp_path / "rack.toml").write_text(Scene(Block(0.9, SIZE), record(0), BandNoise(0.01, (0.0, 9.0), 20)).to_toml())
    names = ["first.txt", "second.txt"]
    for n, name in enumerate(names):
        text = "\n".join(f"{0.02 * k:.2f} {(1 + 2 * n) * a!r}" for k, a in enumerate(record(n).samples))
        (tmp_path / name).write_text(text)
    files = [str(tmp_path / name) for name in names]
    words = ["fragility", str(tmp_path / "rack.toml"), "--records", *files, "--units", "m/s2", "--scales", "0.5,1,2"]
    assert cli.main([*words, "--realizations", "50", "--out", str(tmp_path / "out")]) == 0
    out = capsys.readouterr().out
    curves = Fragility.load(tmp_path / "out" / "result.npz")
    assert curves.overturned[0].tolist() != curves.overturned[1].tolist()
    frame = curves.table()
    assert frame["scene"].tolist() == [name for name in names for _ in range(3)]
    header, *rows = (tmp_path / "out" / "fragility.csv").read_text().splitlines()
    at = header.split(",").index("probability")
    assert [(row.split(",")[0], float(row.split(",")[at])) for row in rows] == [
        (name, share) for name, shares in zip(names, curves.overturned.tolist(), strict=True) for share in shares
    ]
    for name in names:
        assert f"{name}: at scale 1 PGA " in out
    # What is looked at is the curve over both; 3 rows in the terminal and in the report.
    values = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert values["pooled"]["probability"] == pytest.approx(curves.overturned.mean(axis=0))
    for share in values["pooled"]["probability"]:
        assert f"{share:.4g}" in out
    assert "is not used" not in out  # the scene has the forcing of the first file
    words[words.index("--scales")] = "--pgv"
    levels = ["--levels", "0.05", "--out", str(tmp_path / "levels"), "--set", "forcing.scale=2"]
    assert cli.main([*words, "--realizations", "50", *levels]) == 0
    out, files = capsys.readouterr().out, tmp_path / "levels"
    assert "PGV_m_per_s" in out
    assert "is not used: the records replace it." in " ".join(out.split())
    (level,) = json.loads((files / "summary.json").read_text())["pooled_levels"]
    reached = Fragility.load(files / "result.npz").reached[:, 0].mean(axis=0)
    assert level["probability"] == pytest.approx(reached)
    rows = [row.split() for row in out.splitlines() if row.strip().startswith("|Θ| ≥ 0.05 ")]
    assert [float(row[4]) for row in rows] == pytest.approx(reached, abs=1e-4)
    assert reached.max() > 0.0
    drawn_too = [*words, "--realizations", "9", *levels, "--uncertain", "size_factor=uniform:0.9:1.1", "--blocks", "3"]
    assert cli.main(drawn_too) == 0
    out = capsys.readouterr().out
    lines = [line.split(",") for line in (files / "fragility.csv").read_text().splitlines()[1:]]
    assert [line[0] for line in lines] == ["overturned"] * 3 + ["|Θ| ≥ 0.05"] * 3
    for line in lines:
        assert f" {float(line[2]):.4g} " in out
    assert cli.main([*words, "--realizations", "50", "--report", str(tmp_path / "r.html"), "--json"]) == 0
    values = json.loads(capsys.readouterr().out)
    assert values["scale"] == [0.5, 1.0, 2.0]
    assert [motion["pgv"] for motion in values["intensities"]] == pytest.approx([1.0, 1.0])
    page = (tmp_path / "r.html").read_text()
    rows = page[page.index("<h2>Numbers") : page.index("<h2>Scene")].count("<tr>") - 1
    assert rows == 3
    assert "samples = [" not in page[: page.index("<script")]
    assert cli.main([*words, "--scales", "1"]) == 2
    assert (
        "--scales: got '1', accepted: factors, or --pga, --pgv or --intensities in its place" in capsys.readouterr().err
    )


def test_the_corner_of_the_correction_is_set_from_outside(tmp_path, capsys):
    (tmp_path / "rack.toml").write_text(without_forcing(Scene(Block(0.9, SIZE), record(0), NoNoise())))
    arguments = ["risk", str(tmp_path / "rack.toml"), "--intensities", "0.01,0.02", "--json"]
    tables = {}
    for corner in ("0.1", "2"):
        more = ["--synthetic", "5", "--baseline", "high-pass", "--corner-hz", corner]
        assert cli.main([*arguments, *more]) == 0
        tables[corner] = json.loads(capsys.readouterr().out)["motions"]["pgv_m_per_s"]
    own = [dataclasses.replace(record, baseline="high-pass", corner_hz=2.0) for record in synthetic_records(5)]
    assert tables["2"] == pytest.approx([intensities(Scene(Block(0.9, SIZE), record, NoNoise())).pgv for record in own])
    assert tables["2"] != tables["0.1"]
    for more, said in (
        (["--corner-hz", "2"], "corner_hz: got 2.0, accepted: nothing without the baseline 'high-pass'"),
        (["--corner-hz", "-1", "--baseline", "high-pass"], "forcing.corner_hz: got -1.0"),
    ):
        assert cli.main([*arguments, "--synthetic", "5", *more]) == 2
        assert said.replace("'", '"') in capsys.readouterr().err.replace("'", '"')


def test_one_motion_is_accepted_and_doubted_and_a_few_are_refused_before_anything_is_computed(tmp_path, capsys):
    scene = Scene(Block(0.9, SIZE), record(0), BandNoise(0.01, (0.0, 9.0), 20))
    (tmp_path / "rack.toml").write_text(scene.to_toml())
    arguments = ["risk", str(tmp_path / "rack.toml"), "--intensities", "0.4,0.5,0.6"]
    arguments += ["--realizations", "20", "--name", "rack", "--out", str(tmp_path / "out")]
    assert cli.main([*arguments, "--synthetic", "1"]) == 0
    printed = capsys.readouterr()
    assert "One motion: the scatter from motion to motion is neither in the rate nor in its limits." in printed.out
    assert "The points, joined by lines, are used instead." in printed.out
    refused = "fpk-rocking risk: rack.csv and rack.json for pelicun are not written: probability at the highest"
    assert f"{refused} intensity: got 0" in printed.err
    assert not (tmp_path / "out" / "rack.csv").exists()
    # What another command left under either name goes with it, and nothing else does.
    for name in ("rack.csv", "rack.json", "old.xml", "own.csv"):
        (tmp_path / "out" / name).write_text("old")
    values = json.loads((tmp_path / "out" / "risk.json").read_text())
    assert (values["exports"], values["pelicun"][:15]) == (["rack.xml"], "probability at ")
    exports = ["rack.csv", "rack.json", "old.xml", "../own.csv", "curve.csv", "risk.json", 3]
    (tmp_path / "out" / "risk.json").write_text(json.dumps({"exports": exports}))
    (tmp_path / "own.csv").write_text("mine")
    assert cli.main([*arguments, "--synthetic", "1"]) == 0
    left = {
        "result.npz",
        "risk.json",
        "risk.txt",
        "risk.png",
        "curve.csv",
        "report.html",
        "rack.xml",
        "own.csv",
        "motions.csv",
    }
    assert {file.name for file in (tmp_path / "out").iterdir()} == left
    assert (tmp_path / "own.csv").read_text() == "mine"
    refused = {
        "name: got 'risk', accepted: up to 75 letters, digits, _ and -, and none of risk, curve, motions": [
            "--name",
            "risk",
        ],
        "records: got 3, accepted: 1, or at least 5": ["--synthetic", "3"],
        "blocks: got 1, accepted: at least 5 for one motion": [
            "--uncertain",
            "size_factor=uniform:0.9:1.1",
            "--blocks",
            "1",
        ],
        "name: got 'a b', accepted: up to 75 letters": ["--name", "a b"],
    }
    for said, more in refused.items():
        assert cli.main([*arguments, "--realizations", "100000000", *more]) == 2
        assert said in capsys.readouterr().err


def test_files_say_what_made_them_and_what_they_are_worth(tmp_path, capsys):
    """Date, version, hazard and command in report, text and JSON; the verdict in what other programs read."""
    (tmp_path / "rack.toml").write_text(without_forcing(Scene(Block(0.9, SIZE), record(0), NoNoise())))
    (tmp_path / "site 3.csv").write_text("0.1,1e-1\n1,1e-3\n")
    words = ["risk", str(tmp_path / "rack.toml"), "--synthetic", "5", "--hazard", str(tmp_path / "site 3.csv")]
    words += ["--name", "rack", "--out", str(tmp_path / "out")]
    assert cli.main(words) == 0
    verdict = capsys.readouterr().out.split("trust: ")[1].partition(".")[0]
    assert verdict in {"caution", "do not use"}
    out = tmp_path / "out"
    made = f"by fpk-rocking {importlib.metadata.version('fpk-rocking')} with the hazard of site 3.csv"
    line = f"{made}: {shlex.join(['fpk-rocking', *words])}"
    assert (out / "risk.txt").read_text().splitlines()[-1].endswith(line)
    assert json.loads((out / "risk.json").read_text())["origin"].endswith(line)
    page = html.unescape((out / "report.html").read_text())
    assert f"{line}</p>" in page
    # A hazard of two points is told as a law, and as what its file has.
    assert re.search(
        r"<p>Exceeded 0\.001 im\^-2 times a year .*exceeded, 1/year.*>1\.00e-1<.*>1\.00e-3<", page, re.DOTALL
    )
    assert f"Verdict: {verdict}. " in (out / "rack.xml").read_text()
    (row,) = csv.DictReader((out / "rack.csv").open())
    assert row["Verdict"] == verdict
    about = json.loads((out / "rack.json").read_text())["rack"]
    assert about["Verdict"] == json.loads((out / "risk.json").read_text())["trust"]
    assert f"Verdict: {verdict}. " in about["Description"]


def test_without_a_hazard_there_is_a_curve_and_no_rate(tmp_path, capsys):
    """In the shell: the curve of `fragility` at the intensities that were asked for, and files without a rate."""
    scene = Scene(Block(0.9, SIZE), record(0), BandNoise(0.01, (0.0, 9.0), 20))
    (tmp_path / "rack.toml").write_text(scene.to_toml())
    words = ["risk", str(tmp_path / "rack.toml"), "--synthetic", "5", "--intensities", "0.4,0.8,1.6"]
    assert cli.main([*words, "--realizations", "50", "--out", str(tmp_path / "out")]) == 0
    printed = capsys.readouterr().out
    motions = [at_intensity(dataclasses.replace(scene, forcing=motion)) for motion in synthetic_records(5)]
    curve = IntensityCurve.of(fragility(motions, scale=[0.4, 0.8, 1.6], realizations=50), "PGV")
    assert printed.startswith(f"{curve.title}. No annual rate, as there is no hazard (--hazard).\n")
    values = json.loads((tmp_path / "out" / "risk.json").read_text())
    assert values["risk"] is None
    assert values["curve"]["intensity"] == pytest.approx([0.4, 0.8, 1.6])
    assert values["curve"]["probability"] == curve.probability.tolist()
    assert values["trust"] == curve.trust.plain
    page = (tmp_path / "out" / "report.html").read_text()
    assert "No annual rate" in page
    assert "Hazard and risk" not in page
    assert (tmp_path / "out" / "risk.png").stat().st_size > 10_000
