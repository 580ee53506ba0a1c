"""Files of recorded motions: headers, units, columns, and what is refused by name."""

import dataclasses
import math

import numpy as np
import pytest

from fpk_rocking import Dimensions, Record, Scene
from fpk_rocking.physics.forcing.readers.components import MOST

SAMPLES = np.random.default_rng(3).normal(size=60)

NEW = "PEER NGA\nEvent\nACCELERATION TIME SERIES IN UNITS OF G\nNPTS=   {n}, DT=   .0100 SEC\n"
OLD = "PEER STRONG MOTION\nEvent\nACCELERATION TIME HISTORY IN UNITS OF G\n  {n}    0.0100    NPTS, DT\n"


def peer(header, samples, count=None):
    rows = [samples[k : k + 5] for k in range(0, len(samples), 5)]
    body = "\n".join("".join(f"{value:15.7E}" for value in row) for row in rows)
    return header.format(n=len(samples) if count is None else count) + body + "\n"


@pytest.mark.parametrize("header", [NEW, OLD, NEW.replace(", DT", ",DT").replace("NPTS=   ", "NPTS= ")])
def test_peer_files_with_every_header_are_read(header, tmp_path):
    path = tmp_path / "motion.AT2"
    path.write_text(peer(header, SAMPLES))
    record = Record.from_file(path, scale=2.0)
    assert (record.interval, record.units, record.scale, record.source) == (0.01, "g", 2.0, "motion.AT2")
    assert record.samples == pytest.approx(SAMPLES, rel=1e-7)
    columns = tmp_path / "motion.csv"
    columns.write_text("\n".join(f"{0.1 + 0.01 * k:.2f}, {a}" for k, a in enumerate(record.samples)))
    same = Record.from_file(columns, units="g", scale=2.0)
    assert same.samples == record.samples
    assert same.interval == pytest.approx(record.interval)


@pytest.mark.parametrize(
    ("spelling", "units", "si"),
    [
        ("G", "g", 9.80665),
        ("m/s^2", "m/s2", 1.0),
        ("M/SEC/SEC", "m/s2", 1.0),
        ("gal", "cm/s2", 0.01),
        ("cm/s²", "cm/s2", 0.01),
    ],
)
def test_units_are_known_by_their_spellings(spelling, units, si):
    record = Record(0.01, [0.0, 2.0, 0.0], spelling)
    assert record.units == units
    assert record.for_size(Dimensions(0.5, 1.8)).largest == pytest.approx(
        2.0 * si / (9.80665 * math.atan(0.5 / 1.8)), rel=1e-12
    )


def test_peer_files_in_centimetres_and_with_values_that_run_together_are_read(tmp_path):
    path = tmp_path / "motion.AT2"
    path.write_text(NEW.replace("OF G", "OF CM/SEC/SEC").format(n=5) + "-.1234E-02-.2345E-03 .5\n1.5-2.5\n")
    record = Record.from_file(path)
    assert record.samples == (-0.1234e-2, -0.2345e-3, 0.5, 1.5, -2.5)
    assert record.units == "cm/s2"


def esm(samples, **changed):
    header = {"EVENT_NAME": "X", "NDATA": len(samples), "SAMPLING_INTERVAL_S": 0.005, "UNITS": "cm/s^2"} | changed
    lines = [f"{name}: {value}" for name, value in header.items() if value is not None]
    return (
        "\n".join(lines + [f"USER{k}: " for k in range(64 - len(lines))] + [str(sample) for sample in samples]) + "\n"
    )


def test_event_date_and_station_are_kept_as_far_as_a_file_says_them(tmp_path):
    """Through a scene and back, beside what is compared; what no terminal shows is left out."""
    peer, other = tmp_path / "a.AT2", tmp_path / "b.ASC"
    peer.write_text("PEER\nImperial  Valley-02,\t5/19/1940, El Centro #9\nUNITS OF G\nNPTS= 3, DT= .1 SEC\n0. 1. 0.\n")
    other.write_text(esm([0.5, 1.0], EVENT_DATE_YYYYMMDD=20160824, STATION_CODE="AMT"))
    record = Record.from_file(peer)
    assert record.event == "Imperial Valley-02, 5/19/1940, El Centro #9"
    assert Record.from_file(other).event == "X, 20160824, AMT"
    assert record == dataclasses.replace(record, event="")
    scene = Scene.from_block(0.5, 1.8, record=record)
    assert Scene.from_toml(scene.to_toml()).forcing.event == record.event


def test_files_of_esm_are_read(tmp_path):
    path = tmp_path / "IT.XYZ.ASC"
    path.write_text(esm([0.5, -1.25, 2.0]))
    record = Record.from_file(path)
    assert (record.interval, record.samples, record.units) == (0.005, (0.5, -1.25, 2.0), "cm/s2")
    for changed, says in (
        ({"NDATA": 4}, "got 3 samples, accepted: the 4 that the file states"),
        ({"NDATA": "x"}, "got 'x', accepted: a number of samples"),
        ({"UNITS": "cm"}, "got the unit 'cm' of a displacement, accepted: an acceleration"),
        ({"UNITS": "mGal"}, "got the unknown unit 'mGal', accepted: g, "),
        ({"UNITS": None}, "got no line 'UNITS:'"),
        ({"DATA_TYPE": "VELOCITY"}, "got a velocity, accepted: a horizontal acceleration"),
        ({"SAMPLING_INTERVAL_S": "0"}, "got the interval 0, accepted: a number above 0"),
        ({"SAMPLING_INTERVAL_S": "x"}, "got 'X', accepted: finite"),
    ):
        path.write_text(esm([0.5, -1.25, 2.0], **changed))
        with pytest.raises(ValueError, match=says):
            Record.from_file(path)


@pytest.mark.parametrize(
    ("text", "units"),
    [
        ("time,acc\n0.0,1.5\n0.1,-2.5\n", ""),
        ("Time [s];Acceleration [cm/s2]\n0,0;1,5\n0,1;-2,5\n", "cm/s2"),
        ("t (s)\ta (m/s^2)\n0.0\t1.5\n0.1\t-2.5\n", "m/s2"),
        ("0,0\t1,5\n0,1\t-2,5\n", ""),
        ("# from a table\n0.0;1.5;\n0.1;-2.5;\n", ""),
        ('"time","acc (g)"\r\n0.0, 1.5\r\n0.1, -2.5\r\n', "g"),
        ("time acc\ns g\n0.0 1.5\n0.1 -2.5\n", "g"),
        ("0.0 1.5D0\n1.D-1 -2.5D+00\n", ""),
        ("0,0 1,5\n0,1 -2,5\n", ""),
        ("0.0 1.5\n0.1-2.5\n", ""),
        ("'0.0','1.5',\n'0.1','-2.5',\n", ""),
        ("time (ms), acc (mg)\n0, 1.5\n100, -2.5\n", "mg"),
        ("t_min,acc (%g)\n0,1.5\n0.00166666667,-2.5\n", "%g"),
        ("! dt = 100 ms, acceleration (ft/s^2)\n1.5\n-2.5\n", "ft/s2"),
        ("% Time Step (ms): 100\n% units: mm/s/s\n1.5\n-2.5\n", "mm/s2"),
        ("# time N-S U-D\n0 1.5 9\n.1 -2.5 9\n", ""),
    ],
    ids=[
        *("names", "decimal commas", "tabs", "tabs and commas", "semicolons", "quotes", "a row of units", "Fortran"),
        *("decimal commas between blanks", "glued", "trailing commas", "ms", "minutes", "no times", "%", "directions"),
    ],
)
def test_columns_are_read_as_people_have_them(tmp_path, text, units):
    path = tmp_path / "motion.csv"
    path.write_text(text, newline="")
    record = Record.from_file(path, units=None if units else "gal")
    assert (record.samples, record.units) == ((1.5, -2.5), units or "cm/s2")
    assert record.interval == pytest.approx(0.1, rel=1e-8)
    if units == "g":
        with pytest.raises(ValueError, match=r"forcing.units: got 'm/s2', accepted: 'g', as the file "):
            Record.from_file(path, units="m/s2")


BAD_PEER = {
    "cut": (peer(NEW, SAMPLES)[:-200], "got [45][0-9] samples, accepted: the 60"),
    "count": (peer(NEW, SAMPLES, 61), "got 60 samples, accepted: the 61"),
    "other units": (peer(NEW.replace("OF G", "OF CM/S"), SAMPLES), "got the unit 'CM/S' of a velocity 'Event', acc"),
    "unknown units": (peer(NEW.replace("OF G", "OF KIPS"), SAMPLES), "got the unknown unit 'KIPS' 'Event', accepted"),
    "velocity": (peer(NEW.replace("ACCELERATION", "VELOCITY"), SAMPLES), "got a velocity 'Event', accepted: a horiz"),
    "interval 0": (peer(NEW.replace(".0100", ".0000"), SAMPLES), "got the interval .0000, accepted: a number above 0"),
    "nan": (peer(NEW, np.append(SAMPLES, math.nan)), "got 'NAN', accepted: finite numbers"),
    "stars": (peer(NEW, SAMPLES, 61) + " ******", r"got '\*\*\*\*\*\*', accepted: finite numbers"),
    "one sample": (peer(NEW, SAMPLES[:1]), "got 1 samples, accepted: 2 to"),
    "many samples": (peer(NEW, SAMPLES, 10_000_000), f"got 10000000 samples, accepted: 2 to {MOST}"),
    "short": ("a\nb\n", "got 0 samples"),
    "count of many digits": (peer(NEW, SAMPLES, "9" * 5000), f"got 1000000000 samples, accepted: 2 to {MOST}"),
    "glued": (NEW.format(n=4) + "0.1-0.2 0.3", "got '0.1-0.2', accepted: finite numbers"),
    "underscore": (NEW.format(n=2) + "1_0 2", "got '1_0', accepted: finite numbers"),
}
BAD_COLUMNS = {
    "three columns": ("0 1 2\n1 1 2\n", "got 2 components, accepted: one of them by component .* 1 column 2 .peak 1"),
    "cut": ("0.00 1\n0.01 2\n0.0", "got a line of 1 columns"),
    "descending": ("0.00 1\n0.02 2\n0.01 3\n", "got the time 0.01 after 0.02, accepted: ascending"),
    "twice": ("0.00 1\n0.00 2\n0.01 3\n", "got the time 0 after 0"),
    "late": ("0.00 1\n0.01 2\n0.20 3\n0.03 4\n0.04 5\n", r"got the time 0.2 for 0.02, accepted: equally .* \(line 3\)"),
    "early": ("0.00 1\n0.01 2\n0.02 3\n0.003 4\n0.04 5\n", r"got the time 0.003 after 0.02, .* \(line 4\)"),
    "uneven": ("0.00 1\n0.01 2\n0.03 3\n", "got the time 0.01 for 0.015, accepted: equally spaced"),
    "nan": ("0.00 1\n0.01 nan\n", "got 'nan', accepted: finite numbers"),
    "words": ("time acc\n0.0 1\n", "got 1 samples"),
    "words later": ("0.0 1\ntime acc\n0.1 1\n", "got 'time', accepted: finite numbers"),
    "the first line": ("0.0 x\n0.1 1\n0.2 1\n", r"got 'x', accepted: finite numbers \(line 1\)"),
    "one line": ("0.0 1\n", "got 1 samples"),
    "whole numbers run together": ("0.0 1\n0.1 1-2\n", "got '1-2', accepted: finite numbers"),
    "three by semicolons": ("0,0;1,0;2\n0,1;2,0;2\n", "got 2 components"),
    "nothing between commas": ("0.0,1\n0.1,,2\n", "got '', accepted: finite numbers .*line 2"),
}


@pytest.mark.parametrize("place", [1, 30, 58])
def test_times_of_a_file_may_be_rounded_by_2_per_cent_of_the_interval(place, tmp_path):
    """One of 60 times is off by 1 % of the interval, which is read, or by 3 %, which is refused."""
    for part in (0.01, -0.01, 0.03, -0.03):
        times = 0.5 + 0.01 * np.arange(60)
        times[place] += part * 0.01
        path = tmp_path / "motion.txt"
        path.write_text("\n".join(f"{time:.6f} {a}" for time, a in zip(times, SAMPLES, strict=True)))
        if abs(part) < 0.02:
            assert Record.from_file(path, units="g").interval == pytest.approx(0.01, rel=1e-9)
        else:
            with pytest.raises(ValueError, match="accepted: equally spaced times"):
                Record.from_file(path, units="g")


@pytest.mark.parametrize(("name", "kind"), [(n, "AT2") for n in BAD_PEER] + [(n, "txt") for n in BAD_COLUMNS])
def test_bad_files_are_refused_by_name(name, kind, tmp_path):
    text, says = BAD_PEER[name] if kind == "AT2" else BAD_COLUMNS[name]
    path = tmp_path / f"motion.{kind}"
    path.write_text(text)
    with pytest.raises(ValueError, match=rf"forcing.file: '.*motion.{kind}': {says}"):
        Record.from_file(path, units="g")


@pytest.mark.parametrize(
    ("name", "text", "where"),
    [
        (
            "a.AT2",
            peer(NEW.replace("Event", "Imperial Valley-02, El Centro #9, UP"), SAMPLES),
            "'UP'",
        ),
        (
            "b.AT2",
            peer(OLD.replace("Event", "IMPERIAL VALLEY, CERRO PRIETO, DWN"), SAMPLES),
            "'DWN'",
        ),
        ("c.ASC", esm([0.5, 1.0], STREAM="HNZ"), "'HNZ'"),
    ],
)
def test_a_vertical_component_is_refused(name, text, where, tmp_path):
    """What the horizontal ones of the same headers are called is read."""
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(ValueError, match=rf"forcing.file: .* the vertical component {where}, accepted: a"):
        Record.from_file(path)
    for before, after in ((", UP", ", 180"), (", DWN", ", 147"), ("HNZ", "HNE")):
        text = text.replace(before, after)
    path.write_text(text)
    assert len(Record.from_file(path).samples) == len(SAMPLES) * name.endswith("AT2") + 2 * name.endswith("ASC")


def test_of_three_components_one_is_chosen_by_name_or_number(tmp_path):
    path = tmp_path / "motion.csv"
    path.write_text("time,acc_ew,acc_ns,acc_ud\n0.0,1,2,3\n0.1,1,2,3\n")
    with pytest.raises(ValueError, match=r"got 3 components, .* by component .*: 1 acc_ew \(.*, 90°\); 2 acc_ns .*"):
        Record.from_file(path, units="g")
    for component in ("NS", "ns", "acc_ns", 2, "2"):
        assert Record.from_file(path, units="g", component=component).samples == (2.0, 2.0)
    for component in (3, "UD"):
        with pytest.raises(ValueError, match="got the vertical component 'acc_ud'"):
            Record.from_file(path, units="g", component=component)
    for component in ("acc", "0", 4, "", "north"):
        with pytest.raises(
            ValueError, match=rf"got the component {component!r}, accepted: a name or a number of 1 acc"
        ):
            Record.from_file(path, units="g", component=component)
    with pytest.raises(TypeError, match=r"forcing.component: got 2.0, accepted: a name, or a number from 1"):
        Record.from_file(path, units="g", component=2.0)


@pytest.mark.parametrize("names", ["N00E,+V,N90E", "360 Deg,Up,90 Deg", "S00E,UP,090", "N-S,U-D,E-W", "N(+),U(+),E(+)"])
def test_a_direction_chooses_whatever_the_archive_calls_it(tmp_path, names):
    """One option serves for files of several archives; the table of motions says what was taken."""
    path, (north, _, east) = tmp_path / "motion.csv", names.split(",")
    path.write_text(f"time,{names}\n0.0,1,2,3\n0.1,1,2,3\n")
    for component, sample, name in (("NS", 1.0, north), ("n", 1.0, north), ("E-W", 3.0, east), ("E", 3.0, east)):
        record = Record.from_file(path, units="g", component=component)
        assert (record.samples, record.event) == ((sample, sample), name)
    # Of components that are turned, or two that lie alike, none is guessed.
    for oblique in ("N08W,UP,S82W", "360 Deg,0 Deg,180 Deg"):
        path.write_text(f"time,{oblique}\n0.0,1,2,3\n0.1,1,2,3\n")
        with pytest.raises(ValueError, match="got the component 'NS', accepted: a name or a number of 1 "):
            Record.from_file(path, units="g", component="NS")


def test_what_is_no_text_file_is_refused_by_name(tmp_path):
    path = tmp_path / "motion.AT2"
    for data, says in ((b"", "an empty file"), (b" \n ", "an empty file"), (bytes(range(256)) * 9, "binary data")):
        path.write_bytes(data)
        with pytest.raises(ValueError, match=rf"forcing.file: .*got {says}"):
            Record.from_file(path)
    with path.open("wb") as file:
        file.truncate(200_000_000)
    with pytest.raises(ValueError, match=r"forcing.file: .*got 200000000 bytes"):
        Record.from_file(path)
    with pytest.raises(FileNotFoundError, match=r"forcing.file: no file .*none.AT2"):
        Record.from_file(tmp_path / "none.AT2")
    path.write_text(peer(NEW, SAMPLES))
    with pytest.raises(
        ValueError, match=r"units: got 'm/s2', accepted: 'g', as the file '.*motion.AT2' says, or nothing"
    ):
        Record.from_file(path, units="m/s2")
    (tmp_path / "motion.txt").write_text("0 1\n1 2\n")
    with pytest.raises(ValueError, match=r"forcing.units: missing, the file '.*motion.txt' does not say it"):
        Record.from_file(tmp_path / "motion.txt")
    with pytest.raises(OSError, match=r"forcing.file: .* cannot be read"):
        Record.from_file(tmp_path, units="g")
