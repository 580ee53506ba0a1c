"""Record files from anything: read as finite samples, or refused with the file's name; and scenes that name them."""

import math
import re

import fuzz
import numpy as np
import pytest
from hypothesis import strategies as st
from test_fuzz_cli import check, run
from test_fuzz_files import damaged, damages

from fpk_rocking import Record

SAMPLES = np.random.default_rng(5).normal(size=40)
BODY = "\n".join("".join(f"{value:15.7E}" for value in row) for row in SAMPLES.reshape(-1, 5)) + "\n"
HEAD = "PEER NGA\nEvent\nACCELERATION TIME SERIES IN UNITS OF G\n"
COLUMNS = "# s, m/s2\n" + "".join(f"{0.01 * k:.2f} {value:.5f}\n" for k, value in enumerate(SAMPLES))
TEXTS = {
    "motion.AT2": (HEAD + "NPTS=  40, DT=   .0100 SEC\n" + BODY, None),
    "old.at2": (HEAD + "   40    0.0100    NPTS, DT\n" + BODY, None),
    "motion.txt": (COLUMNS, "m/s2"),
    "motion.csv": (COLUMNS.replace(" ", ", ").replace("#,", "#"), "m/s2"),
}
WORDS = st.one_of(
    st.sampled_from(
        ["0.1-0.2", "1.0D-02", "1_000", "1e400", "nan", "-inf", "******", "0,5", "1e308", "5e-324", "-0.0"]
    ),
    st.sampled_from(["", "NPTS=", "DT=", "UNITS", "G", "#", "\x00", "\ufeff", "9" * 5000, "1" * 400, "٣", "½"]),
    st.floats().map(str),
    st.integers().map(str),
    st.text(max_size=6),
)
ENDS = ["\n", "\r\n", "\r", "\x0c", "\n\n", " \n"]
CODES = ["utf-8", "utf-8", "utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-32"]


@st.composite
def spoiled(draw, text):
    """The bytes of a record with words lost or replaced, other ends of lines, in another code, or damaged."""
    words = re.split(r"(\s+)", text)
    for _ in range(draw(st.integers(0, 3))):
        words[draw(st.integers(0, len(words) - 1))] = draw(WORDS)
    text = "".join(words).replace("\n", draw(st.sampled_from(ENDS[:1] * 4 + ENDS)))
    data = text.encode(draw(st.sampled_from(CODES)), "surrogatepass")
    return damaged(data, draw(damages())) if data and draw(st.integers(0, 2)) == 0 else data


@pytest.mark.parametrize("name", TEXTS)
@fuzz.sizes(30, 4000)
def test_spoiled_record_files_are_read_as_finite_or_refused(examples, name, tmp_path):
    (text, units), path = TEXTS[name], tmp_path / name
    names = "forcing.file", "forcing.interval", "forcing.units"

    def claim(data):
        path.write_bytes(data)
        records = []
        if not fuzz.refused(lambda: records.append(Record.from_file(path, units=units)), *names):
            assert len(records[0].samples) >= 2
            assert all(map(math.isfinite, (records[0].interval, *records[0].samples)))

    fuzz.hold(examples, claim, data=spoiled(text) | st.binary(max_size=80))


@pytest.mark.parametrize("ends", ENDS)
@pytest.mark.parametrize("name", TEXTS)
def test_ends_of_lines_and_a_mark_of_utf_8_change_nothing(name, ends, tmp_path):
    (text, units), path = TEXTS[name], tmp_path / name
    # A header has four lines, none of them empty.
    ends = "\n" if units is None and ends == "\n\n" else ends
    path.write_bytes(text.replace("\n", ends).encode("utf-8-sig"))
    record = Record.from_file(path, units=units)
    assert record.samples == pytest.approx(SAMPLES, abs=1e-5)
    assert record.interval == pytest.approx(0.01)


SCENE = """
[block.dimensions]
width = 0.5
height = 1.8
[forcing]
kind = "record"
file = "{file}"
[noise]
kind = "none"
"""


@pytest.mark.parametrize("file", [".", "none.AT2", "", "/dev/zero", "a" * 5000, "\\u0000", "scene.toml"])
def test_a_scene_with_what_is_no_record_file_is_refused(file, tmp_path):
    scene = tmp_path / "scene.toml"
    scene.write_text(SCENE.format(file=file), encoding="utf-8")
    status, out, err = run("mc", scene)
    check(status, out, err, as_json=False)
    assert status == 2
    assert "forcing.file: " in err or "forcing.units: missing" in err
