"""Motions in a plane from two components: known ones, paths in metres, pairs that are none, both planes of a block."""

import json
import math
import re

import body_motion
import numpy as np
import pytest

from fpk_rocking import Block, Body, NoNoise, Record, Scene, cli
from fpk_rocking.results.trust import VERDICTS
from fpk_rocking.risk import Hazard, in_plane, study
from fpk_rocking.studies import resized
from montecarlo import simulate

G, STEP = 9.80665, 0.05
LENGTHS = 1.0, 0.25, 0.32, 0.6


def toward(azimuth):
    """North and east parts of the unit vector towards an azimuth, degrees clockwise from north."""
    return np.array([math.cos(math.radians(azimuth)), math.sin(math.radians(azimuth))])


def ground(seed, count=80):
    """North and east accelerations (count, 2) of a base, m/s², 0 at both ends."""
    rng, times = np.random.default_rng(seed), STEP * np.arange(count)
    waves = np.sin(2.0 * math.pi * (np.outer(times, rng.uniform(0.3, 2.5, 12)) + rng.uniform(0.0, 1.0, 12)))
    parts = waves @ rng.standard_normal((12, 2))
    parts *= 7.0 / np.abs(parts).max() * np.sin(math.pi * np.arange(count) / (count - 1))[:, None]
    parts[0] = parts[-1] = 0.0
    return parts


def peer(path, samples, name, place="STATION, 1"):
    """Write samples, m/s², as a file of PEER whose component has a name."""
    numbers = "\n".join(f"{value / G!r}" for value in samples.tolist())
    path.write_text(
        f"PEER\nEVENT, {place}, {name}\nACCELERATION IN UNITS OF G\nNPTS= {samples.size}, DT= {STEP}\n{numbers}\n"
    )
    return path


def pair(folder, parts, azimuths, stem="m"):
    """Two files of PEER of a base with north and east accelerations (n, 2), from sensors at two azimuths."""
    return [peer(folder / f"{stem}{turn:03d}.AT2", parts @ toward(turn), f"{turn:03d}") for turn in azimuths]


@pytest.mark.parametrize("azimuths", [(0, 90), (9, 279), (120, 30), (350, 262)])
def test_a_base_that_moves_along_one_line_is_seen_whole_along_it_and_not_across(tmp_path, azimuths):
    """The last pair is 2° off a right angle."""
    motion = ground(1)[:, 0]
    files = pair(tmp_path, np.outer(motion, toward(50.0)), azimuths)
    for azimuth, share in ((50.0, 1.0), (230.0, -1.0), (140.0, 0.0), (110.0, 0.5)):
        (record,) = in_plane(files, azimuth)
        assert np.array(record.samples) == pytest.approx(share * motion, abs=1e-12)
        assert (record.interval, record.units) == (STEP, "m/s2")
    assert in_plane(files[::-1], 110.0)[0].samples == pytest.approx(record.samples, abs=1e-12)
    assert record.source == f"m{azimuths[0]:03d}.AT2 + m{azimuths[1]:03d}.AT2"
    assert record.event == "EVENT, STATION, 1, along 110°"


def test_one_file_of_two_components_is_read_as_a_pair_of_files_is(tmp_path):
    parts = ground(2)
    rows = [f"{STEP * k:.2f},{east!r},{north!r}" for k, (north, east) in enumerate(parts.tolist())]
    (tmp_path / "both.csv").write_text("\n".join(["time (s),acc_EW,acc_NS", *rows]))
    (record,) = in_plane([tmp_path / "both.csv"], 75.0, units="m/s2")
    (other,) = in_plane(pair(tmp_path, parts, (0, 90)), 75.0)
    assert record.samples == pytest.approx(other.samples, abs=1e-12)
    assert record.samples == pytest.approx(parts @ toward(75.0), abs=1e-12)


@pytest.mark.parametrize("azimuth", [20.0, 110.0, 200.0])
def test_paths_in_a_plane_are_those_of_an_integration_in_metres(tmp_path, azimuth):
    """A body of unequal sides, its left towards the azimuth, under bases of two components: sides, times and angles."""
    fell = []
    for seed in range(3, 9):
        parts = ground(seed)
        (record,) = in_plane(pair(tmp_path, parts, (9, 279)), azimuth)
        block = Block(body=Body(*LENGTHS))
        alpha, rate = block.critical_angle, block.body.frequency_parameter
        path = simulate(Scene(block, record, NoNoise()), times=[6.0, 14.0])
        along, times = parts @ toward(azimuth), STEP * np.arange(len(parts))

        def base(time, along=along, times=times):
            return float(np.interp(time, times, along, right=0.0))

        motion = body_motion.BodyInMetres(LENGTHS, G, base, times[1:].tolist(), 0.5 * math.pi * alpha)
        motion.run(6.0 / rate)
        if motion.outcome[1] == 0:
            assert alpha * path.angle[0, 1] == pytest.approx(motion.state[0], abs=1e-6)
        motion.run(14.0 / rate)
        assert path.overturn_side[0] == motion.outcome[1]
        if motion.outcome[1]:
            assert path.overturn_time[0] / rate == pytest.approx(motion.outcome[0], abs=1e-6)
        fell.append(motion.outcome[1])
    assert len(set(fell)) > 1


def test_components_to_the_north_and_the_west_are_a_pair_and_a_bracket_names_the_station(tmp_path):
    parts = ground(3)
    files = [
        peer(tmp_path / f"{name}.AT2", parts @ toward(turn), f"{name} (NET 1)")
        for name, turn in (("N", 0.0), ("W", 270.0))
    ]
    (record,) = in_plane(files, 30.0)
    assert np.array(record.samples) == pytest.approx(parts @ toward(30.0), abs=1e-12)
    assert record.event == "EVENT, STATION, 1 (NET 1), along 30°"
    other = peer(tmp_path / "other.AT2", parts[:, 1], "W (NET 2)")
    with pytest.raises(ValueError, match="accepted: two components of one motion at right angles"):
        in_plane([files[0], other], 30.0)


def test_files_that_do_not_say_their_event_are_paired_in_their_order_and_this_is_told(tmp_path):
    parts = ground(4)
    named, files = pair(tmp_path, parts, (0, 90)), []
    for name, column in zip(("NS", "EW"), parts.T, strict=True):
        files.append(tmp_path / f"{name}.csv")
        rows = [f"{STEP * k:.2f},{sample!r}" for k, sample in enumerate(column.tolist())]
        files[-1].write_text("\n".join([f"time (s),acc_{name} (m/s2)", *rows]))
    said = "Paired with EW.csv as the next file: they do not both say event and station."
    (record,) = in_plane(files, 30.0)
    assert said in record.note
    assert any(said in sentence for sentence in record.implausible)
    assert in_plane(named, 30.0)[0].note == ""
    assert "Paired with" in in_plane([named[0], files[1]], 30.0)[0].note


def test_what_is_no_pair_is_refused_by_name(tmp_path):
    parts = ground(1)
    north, east = pair(tmp_path, parts, (0, 90))
    skew, up = peer(tmp_path / "skew.AT2", parts[:, 0], "060"), peer(tmp_path / "up.AT2", parts[:, 0], "UP")
    unnamed, other = (
        peer(tmp_path / "h1.AT2", parts[:, 0], "H1"),
        peer(tmp_path / "o.AT2", parts[:, 1], "090", "ELSEWHERE"),
    )
    short = peer(tmp_path / "short.AT2", parts[:70, 1], "090")
    for files, text in (
        ([north], "azimuth: got '1 horizontal components', accepted: two each"),
        ([north, skew], "accepted: two components of one motion at right angles"),
        ([north, other], "accepted: two components of one motion at right angles"),
        ([north, unnamed], "got components '000' and 'H1', accepted: names that say the azimuth"),
        ([north, up], "got 0 horizontal components (UP (not read"),
        ([north, short], "got 80 samples at 0.05 s and 70 samples at 0.05 s, accepted: the same of both"),
    ):
        with pytest.raises(ValueError, match=re.escape(text)):
            in_plane(files, 30.0)
    with pytest.raises(ValueError, match="azimuth: got nan"):
        in_plane([north, east], math.nan)
    (tmp_path / "both.csv").write_text("time (s),acc_EW,acc_NS\n0,0,0\n0.1,1,2\n0.2,0,0\n")
    with pytest.raises(ValueError, match="units is missing"):
        in_plane([tmp_path / "both.csv"], 30.0)


def test_both_planes_of_a_block_in_one_run(tmp_path, capsys):
    """Width along the azimuth and depth across it: the two rates are those of two studies, with larger and sum."""
    files = [file for n in range(5) for file in pair(tmp_path, 2.0 * ground(20 + n), (0, 90), f"m{n}-")]
    scene = Scene.from_block(0.5, 2.0, record=Record(0.1, (0.0, 1.0, 0.0), "m/s2"))
    text = "\n".join(part for part in scene.to_toml().split("\n\n") if not part.startswith("[forcing]"))
    (tmp_path / "cabinet.toml").write_text(text)
    arguments = ["risk", tmp_path / "cabinet.toml", "--records", *files, "--hazard", "1e-3:2.5", "--azimuth", 30]
    assert (
        cli.main([*map(str, arguments), "--depth", "80 cm", "--json", "--name", "cab", "--out", str(tmp_path / "out")])
        == 0
    )
    values = json.loads(capsys.readouterr().out)
    hazard, rates = Hazard.power_law(1e-3, 2.5), []
    for name, block, turn in (("cab_width", scene, 30.0), ("cab_depth", resized(scene, width=0.8), 120.0)):
        alone = study(block, in_plane(files, turn), hazard)
        rates.append(alone.risk.rate)
        assert values["studies"][name]["risk"]["rate"] == pytest.approx(alone.risk.rate, rel=1e-12)
        assert (tmp_path / "out" / name / "report.html").exists()
    assert values["azimuths"] == [30.0, 120.0]
    (said,) = values["sentences"]
    larger, total = (f"{value:.2e}".replace("e-0", "e-") for value in (max(rates), sum(rates)))
    assert rates[0] != rates[1]
    assert f"the larger is {larger}, the sum {total}. Neither is a bound in three dimensions." in said
    verdicts = [VERDICTS.index(one["trust"]["verdict"]) for one in values["studies"].values()]
    assert values["trust"]["verdict"] == VERDICTS[max(verdicts)] != "ok"
    assert cli.main([*map(str, arguments[:-2]), "--depth", "80 cm"]) == 2
    assert "--depth: got '80 cm', accepted: together with --azimuth, which is missing" in capsys.readouterr().err
    assert cli.main([*map(str, [*arguments[:2], *arguments[1:]]), "--depth", "80 cm"]) == 2
    assert "--depth: got '80 cm', accepted: with one scene, not with 2" in capsys.readouterr().err
    assert cli.main([*map(str, arguments), "--component", "NS"]) == 2
    assert "--component: got 'NS', accepted: nothing beside --azimuth" in capsys.readouterr().err


@pytest.mark.parametrize(("option", "value"), [("--azimuth", "90"), ("--depth", "80 cm")])
def test_motions_of_the_ground_are_not_turned_and_refused(tmp_path, capsys, option, value):
    """Else the intensity is of another direction than the motion of the floor."""
    (tmp_path / "rack.toml").write_text(Scene.from_block(0.5, 2.0, "0.3 g", "1.5 Hz").to_toml())
    files = list(map(str, pair(tmp_path, ground(1), (0, 90))))
    assert (
        cli.main(["risk", str(tmp_path / "rack.toml"), "--records", *files, option, value, "--ground", files[0]]) == 2
    )
    told = capsys.readouterr().err
    assert f"{option}: got " in told
    assert "accepted: without --ground, whose motions are not turned" in told
