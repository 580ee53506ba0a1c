"""Motions of upper floors: recorded with those of the ground, or computed of a building of one mode."""

import dataclasses
import html
import json
import math
import pathlib

import numpy as np
import pytest
from scripts import benchmark
from suites import SIZE, record
from test_spectra import oscillator

from fpk_rocking import Block, NoNoise, Record, Scene, cli
from fpk_rocking.results.remarks import drifting
from fpk_rocking.risk import (
    Building,
    Designs,
    FloorMotion,
    Fragility,
    Hazard,
    at_intensity,
    critical_intensities,
    fragility,
    intensities,
    response_spectrum,
    study,
    synthetic_records,
)
from fpk_rocking.risk.motions import intensity_of, recorded_scenes
from fpk_rocking.risk.rate import rate_text

G = 9.80665
BLOCK = Scene(Block(0.9, SIZE), record(0), NoNoise())
GROUND = synthetic_records(5, duration=5.0, seed=4)
BUILDING = Building(0.4, 0.05, 1.3)


@pytest.mark.parametrize(("period", "damping", "factor"), [(0.15, 0.05, 1.3), (0.8, 0.02, 0.6), (2.5, 0.1, 1.4)])
def test_a_floor_moves_as_integration_says_at_its_samples_and_nearly_so_between_them(period, damping, factor):
    samples = np.array(record(3).samples)[40:125]
    floor = Building(period, damping, factor).floor_motion(Record(0.02, samples, "g", 1.5))
    lasts = floor.interval * len(floor.samples)
    times, _, relative = oscillator(samples, 0.02, period, damping, 0.4 * lasts)
    # Relative and ground acceleration make that of the floor.
    exact = np.interp(times, 0.02 * np.arange(-1, samples.size + 1) + 0.02, [0.0, *samples, 0.0]) + factor * relative
    own = floor.interval * np.arange(len(floor.samples))
    between = np.interp(times, own, floor.corrected_samples)
    at_samples = np.abs(times / floor.interval - np.round(times / floor.interval)) < 1e-6
    assert at_samples.sum() > samples.size
    largest = np.abs(exact).max()
    assert (floor.scale, floor.units) == (1.5, "g")
    assert np.abs(between - exact)[at_samples].max() < 1e-9 * largest
    assert np.abs(between - exact).max() < 3e-3 * largest
    # It is followed until a thousandth of the free vibration is left.
    tail = np.abs(floor.corrected_samples[-round(period / floor.interval) :]).max()
    assert tail < 3e-3 * largest


def test_the_intensity_of_a_floor_is_that_of_the_ground_and_both_are_scaled():
    floor, ground = BUILDING.floor_motion(GROUND[0]), GROUND[0]
    on, below = (dataclasses.replace(BLOCK, forcing=motion) for motion in (floor, ground))
    assert intensities(on) == pytest.approx(intensities(below), rel=1e-12)
    assert intensity_of(on, "PFA") == pytest.approx(np.abs(floor.samples).max() / G, rel=1e-12)
    assert intensity_of(below, "PFA") == intensity_of(below, "PGA")
    there = at_intensity(on, "PGA", 0.5)
    factor = 0.5 / intensity_of(below, "PGA")
    assert there.forcing.largest == pytest.approx(factor * on.forcing.largest, rel=1e-12)
    assert intensity_of(there, "PFV") == pytest.approx(factor * intensity_of(on, "PFV"), rel=1e-12)
    assert intensity_of(there, "Sa(1.0)") == pytest.approx(factor * intensity_of(below, "Sa(1.0)"), rel=1e-12)
    # On another floor of the engines' time, as that of a larger block is.
    faster = on.forcing.scaled(2.0, 4.0)
    assert faster.ground_record.interval == pytest.approx(0.25 * ground.interval)
    assert faster.ground_record.scale == 2.0
    assert Scene.from_toml(there.to_toml()) == there


def test_records_of_a_floor_are_joined_with_those_of_the_ground_in_their_order(tmp_path):
    """Files with their own interval and unit; the critical scales do not depend on the ground."""
    for number, motion in enumerate(GROUND[:3]):
        floor = BUILDING.floor_motion(motion)
        step, samples = floor.interval, np.array(floor.samples)
        rows = "".join(f"{step * k:.9f},{a!r}\n" for k, a in enumerate(samples.tolist()))
        (tmp_path / f"floor{number}.csv").write_text(f"time (s),acc (m/s2)\n{rows}")
        rows = "".join(f"{0.01 * k:.2f},{100.0 * a!r}\n" for k, a in enumerate(motion.samples))
        (tmp_path / f"ground{number}.csv").write_text(f"time (s),acc (cm/s2)\n{rows}")
    files, below = ([tmp_path / f"{name}{n}.csv" for n in range(3)] for name in ("floor", "ground"))
    scenes = recorded_scenes(BLOCK, files, ground=below)
    computed = recorded_scenes(BLOCK, GROUND[:3], building=BUILDING)
    for scene, made, motion in zip(scenes, computed, GROUND, strict=False):
        assert scene.forcing.source.startswith("floor")
        assert scene.forcing.ground_source.startswith("ground")
        assert intensity_of(scene, "Sa(0.5)") == pytest.approx(response_spectrum(motion, [0.5])[0] / G, rel=1e-9)
        assert scene.forcing.largest == pytest.approx(made.forcing.largest, rel=1e-9)
    found = critical_intensities(BLOCK, files, ground=below, measure="PGA")
    scales = critical_intensities(computed, measure="scale").critical
    assert found.critical == pytest.approx(scales * [np.abs(one.samples).max() / G for one in GROUND[:3]], rel=2e-3)
    assert found.table()["pfa_g"] == pytest.approx([intensity_of(scene, "PFA") for scene in computed], rel=1e-9)


def test_what_makes_no_floor_is_refused_by_name():
    for name in ("ground", "vertical"):
        for count, got in ((2, "2 motions"), (1, "1 motion")):
            said = rf"^{name}: got '{got}', accepted: 3, one for each record in the same order$"
            with pytest.raises(ValueError, match=said):
                recorded_scenes(BLOCK, GROUND[:3], **{name: GROUND[:count]})
        said = rf"^building: got 'T = 0.4 s, ζ = 0.05, Γφ = 1.3', accepted: no building beside {name} \(--{name}\)$"
        with pytest.raises(ValueError, match=said):
            recorded_scenes(BLOCK, GROUND[:3], **{name: GROUND[:3]}, building=BUILDING)
    with pytest.raises(ValueError, match=r"^ground\.scale: got 2\.0, accepted: 1\.0, that of the floor"):
        FloorMotion.of(GROUND[0], dataclasses.replace(GROUND[1], scale=2.0))
    with pytest.raises(TypeError, match=r"^ground: got .*, accepted: a Record, of the ground"):
        BUILDING.floor_motion(BUILDING.floor_motion(GROUND[0]))
    with pytest.raises(ValueError, match=r"^baseline: got 'mean', accepted: nothing where there is no record"):
        recorded_scenes(BLOCK, [GROUND[0], BUILDING.floor_motion(GROUND[0])], baseline="mean")
    for values, said in (((0.0, 0.05, 1), "period"), ((0.05, 0.7, 1.2), "damping"), ((1.0, 0.05, -1.0), "factor")):
        with pytest.raises(ValueError, match=rf"^building\.{said}: got "):
            Building(*values)
    crossed = FloorMotion.of(Record(0.01, [0.0, 900.0, 0.0], "m/s2", source="f"), Record(0.01, [0.0, 1.0], "m/s2"))
    assert "The peak of f is 900 m/s², that of its ground 1 m/s² (): are units and order" in " ".join(
        crossed.implausible
    )


def test_what_has_no_effect_on_motions_in_hand_or_without_drawn_blocks_is_refused():
    for name, value in (("units", "g"), ("interval", 0.01), ("component", "NS")):
        said = rf"^{name}: got {value!r}, accepted: nothing where no motion is the name of a file$"
        with pytest.raises(ValueError, match=said):
            study(BLOCK, GROUND[:5], None, **{name: value})
    with pytest.raises(ValueError, match=r"^blocks: got 9, accepted: nothing without uncertain values"):
        study(BLOCK, GROUND[:5], None, blocks=9)


def test_a_ground_motion_whose_file_says_another_event_is_told():
    """Motions in the wrong order are; two that differ in their last word, the component, are not."""
    samples = [0.0, 1.0, -1.0, 0.0]
    floors, below = (
        [Record(0.01, samples, "m/s2", source=f"{name}{n}", event=f"EVENT {n}, TOWN, {name}") for n in range(2)]
        for name in ("floor", "ground")
    )
    assert [FloorMotion.of(*both).implausible for both in zip(floors, below, strict=True)] == [[], []]
    told = recorded_scenes(BLOCK, floors, ground=below[::-1])[1].forcing.scaled(2.0, 1.0).implausible
    said = "(EVENT 1, TOWN, floor; EVENT 0, TOWN, ground): is their order right?"
    assert told == [f"The files of floor1 and of its ground, ground0, say different events or places {said}"]
    assert FloorMotion.of(floors[0], dataclasses.replace(below[1], event="")).implausible == []
    on_floor = recorded_scenes(BLOCK, floors[:1], building=BUILDING)[0]
    assert on_floor.forcing.ground_record.event == floors[0].event
    assert on_floor.forcing.implausible == []


def test_a_drift_is_said_of_the_file_that_drifts_and_unequal_durations_are_told():
    straight, tilted = (dataclasses.replace(one, source=name) for one, name in zip(GROUND[:2], "ab", strict=True))
    tilted = dataclasses.replace(tilted, samples=tuple(a + 0.3 for a in tilted.samples))
    for floor, below in ((straight, tilted), (tilted, straight), (dataclasses.replace(tilted, source="c"), tilted)):
        (told,) = drifting(recorded_scenes(BLOCK, [floor], ground=[below])[0].forcing)
        assert told.message.startswith("b drifts: its PGV is ")
    for count, told in ((1.05, []), (1.2, ["a lasts 7.2 s, its ground, b, 6 s: is the order of the files right?"])):
        pulse = np.sin(np.linspace(0.0, 40.0, 601))
        longer = Record(0.01, np.append(pulse, np.zeros(round(600 * (count - 1.0)))), "m/s2", source="a")
        assert FloorMotion.of(longer, Record(0.01, pulse, "m/s2", source="b")).implausible == told


def test_the_baseline_is_that_of_the_ground_before_a_building_and_of_both_where_both_are_recorded():
    tilted = [dataclasses.replace(one, samples=tuple(a + 0.3 for a in one.samples)) for one in GROUND[:2]]
    straight = [BUILDING.floor_motion(dataclasses.replace(one, baseline="mean")) for one in tilted]
    for scene, motion in zip(recorded_scenes(BLOCK, tilted, building=BUILDING, baseline="mean"), straight, strict=True):
        assert scene.forcing == motion.for_size(SIZE)
        assert scene.forcing.correction.offset == pytest.approx(0.3 + np.mean(GROUND[0].samples), abs=0.05)
        assert scene.forcing.corrected_samples.tolist() == list(motion.samples)
    (pair,) = recorded_scenes(BLOCK, tilted[:1], ground=tilted[1:], baseline="mean")
    assert abs(pair.forcing.corrected_samples.mean()) < 1e-12
    assert abs(pair.forcing.ground_record.corrected_samples.mean()) < 1e-12
    assert recorded_scenes(BLOCK, tilted[:1], ground=tilted[1:])[0].forcing.drifts


def test_the_rate_on_a_floor_is_that_of_scales_of_the_ground(tmp_path):
    """By hand: records divided by the intensity of the ground, over the scale. The wrong way is told."""
    hazard = Hazard([0.05, 0.5, 3.0], [5e-2, 1e-3, 1e-5], measure="Sa(1.0)")
    floors = study(BLOCK, GROUND, hazard, measure="Sa(1.0)", building=BUILDING)
    made = [BUILDING.floor_motion(one) for one in GROUND]
    own = [response_spectrum(one, [1.0])[0] / G for one in GROUND]
    plain = [
        Record(floor.interval, np.array(floor.samples) / one, "m/s2") for floor, one in zip(made, own, strict=True)
    ]
    jumps = critical_intensities([dataclasses.replace(BLOCK, forcing=one) for one in plain], measure="scale").jumps
    signs = 1.0 - 2.0 * (np.arange(jumps.shape[1]) % 2)
    by_hand = np.nansum(signs * hazard(jumps), axis=1).mean()
    assert floors.risk.rate == pytest.approx(by_hand, rel=5e-3)
    assert (
        "The block stands on an upper floor, whose motions are computed from those of the ground (one mode, T = 0.4 s, "
        in floors.text()
    )
    assert "Rank correlation with the factor" in floors.text()
    floors.write(tmp_path)
    kept = Fragility.load(tmp_path / "result.npz")
    assert (kept.measure, kept.scenes[0].forcing) == ("Sa(1.0)", floors.fragility.scenes[0].forcing)
    xml = (tmp_path / "rocking_block.xml").read_text(encoding="utf-8")
    assert 'imt="SA(1.0)"' in xml
    pelicun = json.loads((tmp_path / "rocking_block.json").read_text())["rocking_block"]["Description"]
    for text in (xml, pelicun):
        assert "(one mode, T = 0.4 s, ζ = 0.05, Γφ = 1.3); intensities are the ground's" in text
    assert ",Spectral Acceleration|1.0,g,0,1," in (tmp_path / "rocking_block.csv").read_text()
    assert "give the component location 0" in pelicun
    wrong = study(BLOCK, [Record(one.interval, one.samples, "m/s2") for one in made], hazard, measure="Sa(1.0)")
    assert wrong.risk.rate < 0.5 * floors.risk.rate


def test_a_floor_of_factor_0_is_the_ground():
    """The same samples on finer lines, and critical intensities to the tolerance of their search."""
    ground = Building(0.4, 0.05, 0.0)
    floor = ground.floor_motion(GROUND[0])
    times = floor.interval * np.arange(len(floor.samples))
    points = [0.0, *GROUND[0].samples, 0.0]
    lines = np.interp(times, GROUND[0].interval * np.arange(len(points)), points)
    assert np.abs(np.array(floor.samples) - lines).max() < 1e-12
    on, below = (critical_intensities(BLOCK, GROUND, building=building).critical for building in (ground, None))
    assert on == pytest.approx(below, rel=1e-6)
    with pytest.raises(ValueError, match=r"building\.factor: got -0\.1, accepted: a finite number >= 0\.0"):
        Building(0.4, 0.05, -0.1)


def test_the_intensity_of_the_ground_at_which_a_block_lifts_off_on_a_floor_is_told():
    """SIZE lifts off at .3 g; each motion reaches that on the floor at its own intensity of the ground."""
    found = study(BLOCK, GROUND, None, [0.2], building=BUILDING)
    scenes = recorded_scenes(BLOCK, GROUND, building=BUILDING)
    least = [0.3 * intensity_of(scene, "PGV") / intensity_of(scene, "PFA") for scene in scenes]
    said = f"The block lifts off at 0.3 g on the floor, reached at PGV {min(least):.3g} to {max(least):.3g} m/s on the"
    assert f"{said} ground. With a coefficient" in found.text()


def test_several_blocks_on_a_floor_are_those_of_single_runs(tmp_path, capsys):
    """In the shell: rates, intensities and tables of `a.toml b.toml --building` and of each file alone."""
    for name, width in (("narrow", 0.5), ("wide", 0.7)):
        size = f"[block.dimensions]\nwidth = {width}\nheight = 1.8\n[noise]\nkind = 'none'\n"
        (tmp_path / f"{name}.toml").write_text(size)
    files, motions = [str(tmp_path / f"{name}.toml") for name in ("narrow", "wide")], []
    for number, motion in enumerate(GROUND):
        motions.append(str(tmp_path / f"{number}.txt"))
        pathlib.Path(motions[-1]).write_text("\n".join(f"{0.01 * k:.2f} {a!r}" for k, a in enumerate(motion.samples)))
    options = ["--records", *motions, "--units", "m/s2", "--hazard", "1e-3:2.5", "--building", "0.4,0.05,1.3", "--json"]
    assert cli.main(["risk", *files, *options]) == 0
    together = json.loads(capsys.readouterr().out)["studies"]
    for file, one in zip(files, together.values(), strict=True):
        assert cli.main(["risk", file, *options]) == 0
        alone = json.loads(capsys.readouterr().out)
        assert one["risk"] == alone["risk"]
        assert one["motions"] == alone["motions"]
        assert max(one["motions"]["pfa_g"]) > 1.2 * max(one["motions"]["pga_g"])
    assert together["narrow"]["risk"]["rate"] > together["wide"]["risk"]["rate"]


def test_several_blocks_on_a_floor_say_so_once_and_how_many_events_there_are(tmp_path):
    motions, hazard = synthetic_records(10, duration=5.0, seed=4), Hazard.power_law(1e-3, 2.5)
    events = [number // 2 for number in range(10)]
    studies = [study(BLOCK, motions, hazard, building=BUILDING, events=events, name=name) for name in ("one", "two")]
    both = Designs(tuple(studies))
    both.write(tmp_path)
    visible = (tmp_path / "report.html").read_text(encoding="utf-8").partition("<script")[0]
    for text in (both.text(), html.unescape(visible)):
        assert text.count("on an upper floor, whose motions are computed from those of the ground (one mode, T") == 1
        assert text.count("10 motions are of 5 events; those of one event count as one motion.") == 1
    rate = studies[0].risk.rate
    assert f"<td>{rate_text(rate)}</td>" in visible
    assert f"<td>{rate:.4g}</td>" not in visible


def test_records_that_look_like_those_of_a_floor_are_a_caution():
    floors = [Building(0.5, 0.02, 1.4).floor_motion(one) for one in GROUND]
    plain = [Record(one.interval, one.samples, "m/s2") for one in floors]
    for motions, told in ((plain, True), (floors, False)):
        for measure, counts in (("PGA", True), ("PFA", False)):
            found = critical_intensities(BLOCK, motions, measure=measure, highest=1e-3)
            assert any("one narrow peak" in text for text in found.trust.reasons) == (told and counts)
    scenes = [at_intensity(dataclasses.replace(BLOCK, forcing=one), "PGA") for one in plain]
    curves = fragility(scenes, scale=[1e-3], engine="rk4", times=[1.0])
    assert any("one narrow peak" in text for text in curves.trust.reasons)


def test_a_curve_of_the_floors_own_peak_is_for_pelicun_and_no_hazard_of_the_ground(tmp_path):
    floors = study(BLOCK, GROUND, None, measure="PFA", building=BUILDING)
    plain = [Record(one.interval, one.samples, "m/s2") for one in (BUILDING.floor_motion(one) for one in GROUND)]
    assert floors.critical.critical == pytest.approx(
        critical_intensities(BLOCK, plain, measure="PGA").critical, rel=2e-3
    )
    floors.write(tmp_path)
    assert ",Peak Floor Acceleration,g,0,1," in (tmp_path / "rocking_block.csv").read_text()
    assert "a component that stands on floor 3 has location 4" in (tmp_path / "rocking_block.json").read_text()
    assert not (tmp_path / "rocking_block.xml").exists()
    assert (
        "accepted: PGA, PGV or Sa(T), of which OpenQuake"
        in json.loads((tmp_path / "risk.json").read_text())["openquake"]
    )
    with pytest.raises(ValueError, match=r"^measure of the hazard: got 'PGA', accepted: PFA, as for the curve"):
        study(BLOCK, GROUND, Hazard([0.1, 1.0], [1e-2, 1e-4], measure="PGA"), measure="PFA", building=BUILDING)


def test_what_lifts_a_block_off_on_a_floor_is_no_bound_of_the_ground():
    """A PGA of the ground below that may overturn it: the building makes more of it."""
    for measure, bounded in (("PGA", False), ("PFA", True)):
        result = study(BLOCK, GROUND, Hazard.power_law(1e-3, 1.0), measure=measure, building=BUILDING)
        assert (result.risk.interval[1] <= 1e-3 / 0.3) == bounded


def test_the_command_takes_ground_building_and_measure(tmp_path, capsys):
    (tmp_path / "rack.toml").write_text(BLOCK.to_toml())
    for number, one in enumerate(GROUND):
        rows = "".join(f"{0.01 * k:.2f},{a!r}\n" for k, a in enumerate(one.samples))
        (tmp_path / f"g{number}.csv").write_text(f"time (s),acc (m/s2)\n{rows}")
    (tmp_path / "h.csv").write_text("Sa(1.0) (g),annual rate\n0.05,5e-2\n0.5,1e-3\n3,1e-5\n")
    files = [str(tmp_path / f"g{number}.csv") for number in range(5)]
    words = ["risk", str(tmp_path / "rack.toml"), "--records", *files, "--hazard", str(tmp_path / "h.csv"), "--json"]
    assert cli.main([*words, "--measure", "SA(1)", "--building", "0.4,0.05,1.3"]) == 0
    told = json.loads(capsys.readouterr().out)
    expected = study(BLOCK, files, Hazard.from_csv(tmp_path / "h.csv"), measure="Sa(1.0)", building=BUILDING)
    assert told["risk"]["rate"] == expected.risk.rate
    assert told["rank_correlation"] == pytest.approx(expected.rank_correlation)
    assert cli.main([*words, "--building", "0.6,0.05"]) == 2
    accepted = "accepted: T,ZETA,FACTOR: three numbers, as 0.6,0.05,1.1"
    assert f"--building: got '0.6,0.05', {accepted}" in capsys.readouterr().err
    assert cli.main([*words, "--building", "0.6 s,5 %,1.1"]) == 2
    assert f"--building: got '0.6 s,5 %,1.1', {accepted}" in capsys.readouterr().err
    words = ["fragility", str(tmp_path / "rack.toml"), "--records", *files, "--intensities", "0.5,1,2"]
    assert cli.main([*words, "--measure", "Sa(1.0)", "--ground", *files]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert "probability of 'overturned' against Sa(1.0) (g), from 5 motions" in printed
    assert cli.main([*words[:-2], "--pga", "1", "--measure", "PGA"]) == 2
    assert "--measure: got 'PGA', accepted: together with --intensities" in capsys.readouterr().err
    assert cli.main(["fragility", str(tmp_path / "rack.toml"), "--scales", "1", "--ground", files[0]]) == 2
    assert "--ground: got" in capsys.readouterr().err


def test_rank_correlations_are_those_of_own_intensity_and_critical_factor():
    """Motions of very different strength: each measure orders them, and the weakest has the largest factor."""
    motions = [dataclasses.replace(one, scale=8.0**k) for one, k in zip(GROUND, (0, 2, 1, -1, -2), strict=True)]
    ranks = study(BLOCK, motions, None, measure="Sa(0.7)").rank_correlation
    assert ranks == pytest.approx(dict.fromkeys(("PGA", "PGV", "Sa(0.3)", "Sa(1.0)", "Sa(3.0)", "Sa(0.7)"), -1.0))
    mixed = study(BLOCK, GROUND, None)
    own, factor = np.argsort(np.argsort(mixed.table()["pga_g"])), np.argsort(np.argsort(mixed.factors))
    assert mixed.rank_correlation["PGA"] == pytest.approx(np.corrcoef(own, factor)[0, 1])
    assert list(mixed.rank_correlation.values()) == sorted(mixed.rank_correlation.values())
    assert math.isfinite(mixed.rank_correlation["PGV"])


def test_the_page_of_limits_on_a_floor_quotes_the_figures():
    """Of a block that withstands 1.3 times as much under all motions, of which half overturn it in two intervals."""
    script, rng = benchmark("floor_limits"), np.random.default_rng(3)
    jumps = 0.5 * np.exp(0.3 * rng.standard_normal(40))[:, None] * [1.0, 1.1, 1.4]
    jumps[::2, 1:] = np.nan
    values = script.run([jumps, 1.3 * jumps], suites=4, sizes=(6,))
    assert values["several intervals"] == [0.5, 0.5]
    row = values["coverage"]["im^-2.5"]["6"]
    assert row["ratio of medians"] == row["ratio of rates"] == 1.0
    cells = script.page(values)["text"][-1].split("|")[3:-1]
    names = "rate", "P", "ratio of medians", "ratio of rates", "fits rejected", "thresholds rejected"
    assert [float(cell) for cell in cells] == [*(row[name] for name in names), row["ratio of rates, stated"]]
